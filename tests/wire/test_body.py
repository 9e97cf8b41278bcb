"""Servos of a wire at the links of the SO-101."""

import pytest

from wire_talk import Client, feetech, word

pytest.importorskip("mujoco", reason="MuJoCo is not installed")
from servotwin.wire.arms import Asked, arm_bus
from servotwin.wire.twins import LinkCrew


@pytest.fixture
def bus():
    found, names = arm_bus(Asked(arm="so101", supply="12V:0.1ohm"), registers=lambda servo, words: servo)
    assert names[1] == "shoulder_pan"
    assert isinstance(found.crew, LinkCrew)
    return found


@pytest.fixture
def client(bus):
    return Client(bus)


def tell_all(bus, count):
    bus.ask(feetech(0xFE, 0x83, 42, 2, *[byte for id in bus.ids for byte in (id, *word(count))]))


def go_on(bus, seconds):
    for _ in range(round(seconds / 0.01)):
        bus.advance(0.01)


def test_a_limp_arm_falls_and_a_told_one_holds(bus, client):
    go_on(bus, 1.0)
    assert abs(client.number(2, 56) - 2048) > 100
    tell_all(bus, 2150)
    go_on(bus, 2.0)
    assert all(abs(client.number(id, 56) - 2150) < 40 for id in bus.ids)
    assert abs(client.number(2, 60, sign=10)) > 50  # it carries the arm


def test_torque_off_is_off_while_it_moves(bus, client):
    client.goal(1, 1024)
    go_on(bus, 0.4)
    assert client.number(1, 58) < -500
    client.write(1, 40, 0)
    go_on(bus, 0.5)
    assert client.number(1, 58) == 0
    assert bus.seen(1).duty == 0.0


def test_registers_act(bus, client):
    client.write(1, 46, *word(100))
    client.goal(1, 1024)
    go_on(bus, 0.5)
    assert client.number(1, 58) == pytest.approx(-100, abs=20)


def test_a_hand_holds_a_limp_joint(bus, client):
    bus.hand(1, 0.3)
    go_on(bus, 0.2)
    assert client.number(1, 56) == 2244
    bus.hand(1, None)
    go_on(bus, 0.5)
    assert abs(client.number(1, 56) - 2244) <= 10  # of which a gear's play lets it go


def test_power_cycle(bus, client):
    tell_all(bus, 2150)
    go_on(bus, 1.0)
    before = client.number(1, 56)
    bus.power_cycle()
    go_on(bus, 0.2)
    assert client.read(1, 40, 1) == b"\0"
    assert abs(client.number(1, 56) - before) < 20


def test_the_same_bytes_in_every_run():
    def run():
        bus, _ = arm_bus(Asked(arm="so101", supply="12V:0.1ohm"), registers=lambda servo, words: servo)
        out = b""
        for k in range(100):
            out += bus.ask(feetech(0xFE, 0x82, 56, 15, *bus.ids))
            tell_all(bus, 2048 + 3 * k)
            bus.advance(0.01)
        return out

    assert run() == run()
