"""What moves behind the registers: the same servo as `simulate` has."""

import math
import resource

import numpy as np
import pytest

import servotwin as st
from wire_talk import COUNT, STS, Client, feetech, word


def bus_of(count=1, **more):
    return st.wire.Bus({k: STS for k in range(1, count + 1)}, **more)


def test_a_step_through_the_wire_is_that_of_the_servo_to_a_count():
    bus = bus_of()
    bus.advance(0.1)
    bus.write(feetech(1, 3, 42, *word(3000)))
    seen = []
    for _ in range(300):
        bus.advance(5e-3)
        seen.append(bus.registers(1)["Present_Position"])
    run = st.simulate(st.DigitalServo(st.load_servo(STS)), st.signals.step(0.0, 952 * COUNT, at=0.1, unit="rad"),
                      duration=1.6, output_step=5e-3)
    wanted = np.floor(run["output_angle"] / COUNT + 0.5)[21:321] + 2048
    assert np.abs(wanted - seen).max() <= 1
    assert wanted[-1] > 2900


@pytest.mark.parametrize(("slowest", "counts", "ticks"), [(1, 100, 400), (0, 100, 429), (1, 10, 108), (1, 600, 1056)])
def test_the_profile_takes_its_ticks(slowest, counts, ticks):
    bus = bus_of()
    for data in ((41, 20), (46, *word(1000)), (83, slowest)):
        bus.write(feetech(1, 3, *data))
        bus.advance(1e-3)
    bus.write(feetech(1, 3, 42, *word(2048 + counts)))
    bus.advance(0.5e-3)  # the first tick is that of the write
    done, client = 1, Client(bus)
    while client.read(1, 66, 1) == b"\1":
        bus.advance(1e-3 - 7e-5)
        done += 1
    assert done == ticks


def test_overload_trips_after_two_seconds_and_torque_enable_releases_it():
    bus = bus_of(loads={1: st.loads.Coulomb(20.0)})
    client = Client(bus)
    for data in ((85, 254), (41, 254), (28, *word(511))):
        client.write(1, *data)
    start = bus.time
    client.goal(1, 2148)
    while not client.read(1, 65, 1)[0]:
        bus.advance(1e-3)
    assert client.read(1, 65, 1)[0] == 32
    assert bus.ask(feetech(1, 1)) == feetech(1, 32)
    assert bus.time - start == pytest.approx(2.0, abs=0.15)  # and what it takes to ask for more than 80 %
    bus.advance(3e-3)
    assert client.number(1, 60, sign=10) == 200
    client.write(1, 40, 1)
    bus.advance(5e-3)
    assert client.read(1, 65, 1)[0] == 0
    bus.advance(0.5)
    assert client.number(1, 60, sign=10) > 800


@pytest.mark.parametrize("mass", [1.0, 1.5])
def test_load_tells_how_far_a_mass_draws_the_arm_down(mass):
    bus = bus_of(loads={1: st.loads.Constant(mass * 9.80665 * 0.1)})
    client = Client(bus)
    client.goal(1, 2048)
    bus.advance(3.0)
    low = 2048 - client.number(1, 56)
    told = client.number(1, 60, sign=10)
    assert low > 3
    assert told in [32 * (abs(e) - 1) // 4 + 16 for e in (low - 1, low, low + 1)]


def test_servos_on_one_supply_draw_it_down():
    bus = bus_of(2, supply=st.Supply(open_circuit_voltage=12.0, internal_resistance=0.5))
    Client(bus).goal(1, 4000)
    lowest = 12.0
    for _ in range(50):
        bus.advance(5e-3)
        lowest = min(lowest, bus.seen(2).voltage)
    assert lowest < 11.9


@pytest.mark.parametrize("cut", [1, 3])
def test_the_same_bytes_in_every_run(cut):
    def run():
        bus, out = bus_of(3, supply=st.Supply(open_circuit_voltage=12.0, internal_resistance=0.2), seed=3), []
        for k in range(200):
            bus.write(feetech(0xFE, 0x82, 56, 15, 1, 2, 3))
            for _ in range(cut):
                out.append(bus.advance(6e-3 / cut))
            at = 2048 + round(500 * math.sin(0.1 * k))
            bus.write(feetech(0xFE, 0x83, 42, 2, *[b for id in (1, 2, 3) for b in (id, *word(at))]))
            out.append(bus.advance(4e-3))
        return b"".join(out)

    assert run() == run()


def test_numbers_of_registers_act():
    bus = bus_of()
    client = Client(bus)
    client.write(1, 46, *word(500))
    client.goal(1, 3000)
    bus.advance(1.0)
    assert client.number(1, 58) == pytest.approx(500, abs=15)
    client.write(1, 46, *word(200))
    bus.advance(0.6)
    assert client.number(1, 58) == pytest.approx(200, abs=15)


def test_what_cannot_be_computed_is_said_and_changes_nothing():
    bus = bus_of()
    client = Client(bus)
    client.write(1, 81, 0)  # a derivative over no tick
    bus.advance(0.1)
    assert client.read(1, 81, 1) == b"\0"
    assert bus.counts.said


def storm(count, seed):
    draw, bus = np.random.default_rng(seed), bus_of(2)
    for _ in range(count):
        code = int(draw.choice([1, 2, 3, 4, 5, 0x82, 0x83, 0x0B]))
        data = draw.integers(0, 256, int(draw.integers(0, 8))).tolist()
        if code in (2, 3, 4) and data:
            data[0] = int(draw.integers(0, 90))
        if draw.random() < 0.5:
            data = draw.integers(0, 256, int(draw.integers(0, 20))).tolist()
            bus.write(bytes([0xFF, 0xFF, *data]))
        else:
            bus.write(feetech(int(draw.choice([1, 2, 3, 0xFE])), code, *data))
        bus.advance(float(draw.choice([0.0, 1e-4, 2e-3])))
    return bus


def check_storm(count, seed):
    bus = storm(count, seed)
    assert all(math.isfinite(one.angle) and abs(one.speed) < 50.0 for one in map(bus.crew.seen, (0, 1)))
    bus.power_cycle()


def test_random_packets_do_no_harm():
    check_storm(2000, 5)


@pytest.mark.slow
def test_many_random_packets_do_no_harm_and_take_no_memory():
    check_storm(5000, 6)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    check_storm(20000, 7)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 5 * 1024  # kB
