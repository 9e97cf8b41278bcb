"""What an STS3215 does with packets and registers, as its sources say."""

import pytest

import servotwin as st
from servotwin.wire import service
from servotwin.wire.service import Keep, read_kept
from wire_talk import COUNT, STS, Client, feetech, word


def bus_of(count=1, **more):
    return st.wire.Bus({k: STS for k in range(1, count + 1)}, **more)


@pytest.fixture
def bus():
    return bus_of()


@pytest.fixture
def client(bus):
    return Client(bus)


def test_ping_model_and_firmware(bus, client):
    assert bus.ask(feetech(1, 1)) == feetech(1, 0)
    assert client.read(1, 3, 2) == bytes([9, 3])
    assert client.read(1, 0, 2) == bytes([3, 10])


def test_an_answer_takes_its_bytes_and_the_return_delay(bus, client):
    bus.write(feetech(1, 1))
    assert bus.due == pytest.approx(6e-5)
    assert bus.advance(5.9e-5) == b""
    assert bus.advance(0.2e-5) == feetech(1, 0)
    client.write(1, 7, 250)
    start = bus.time
    bus.write(feetech(1, 1))
    assert bus.due - start == pytest.approx(250 * 2e-6 + 6e-5)


def test_silence(bus):
    bent = bytearray(feetech(1, 1))
    bent[-1] ^= 1
    for data in (bytes(bent), feetech(2, 1), feetech(1, 1)[:-1], feetech(1, 8), feetech(1, 2, 87, 1), feetech(1, 2)):
        assert bus.ask(data) == b""
        bus.advance(0.03)
    assert bus.counts.bad == 1
    assert bus.ask(feetech(1, 1)) == feetech(1, 0)  # an unfinished packet is forgotten


def test_all_answer_a_ping_to_all_in_the_order_of_their_ids():
    bus = bus_of(3)
    assert bus.ask(feetech(0xFE, 1)) == b"".join(feetech(k, 0) for k in (1, 2, 3))


def test_sync_read_leaves_a_gap_for_who_is_absent():
    bus = bus_of(3)
    bus.write(feetech(0xFE, 0x82, 56, 2, 3, 9, 1))
    slot = 8 * 1e-5
    assert bus.advance(slot) == feetech(3, 0, *word(2048))
    assert bus.advance(1.9 * slot) == b""
    assert bus.advance(0.2 * slot) == feetech(1, 0, *word(2048))


def test_sync_write_is_not_answered():
    bus = bus_of(2)
    assert bus.ask(feetech(0xFE, 0x83, 41, 1, 1, 5, 2, 7)) == b""
    client = Client(bus)
    assert (client.read(1, 41, 1), client.read(2, 41, 1)) == (b"\5", b"\7")


def test_reg_write_waits_for_action(client, bus):
    assert bus.ask(feetech(1, 4, 41, 9)) == feetech(1, 0)
    assert client.read(1, 41, 1) == b"\0"
    assert client.read(1, 64, 1) == b"\1"
    assert bus.ask(feetech(0xFE, 5)) == b""
    assert client.read(1, 41, 1) == b"\t"
    assert bus.ask(feetech(1, 5)) == feetech(1, 0)
    assert client.read(1, 41, 1) == b"\t"


def test_at_level_0_only_ping_and_read_are_answered(client, bus):
    client.write(1, 8, 0)
    assert client.write(1, 41, 9) == b""
    assert client.read(1, 41, 1) == b"\t"
    assert bus.ask(feetech(1, 1)) == feetech(1, 0)


def test_a_read_is_cut_at_the_end_of_the_memory(client):
    assert len(client.read(1, 80, 20)) == 7


def test_bytes_that_are_read_only_are_passed_over(client):
    assert client.write(1, 3, 1, 1) == feetech(1, 0)
    assert client.read(1, 3, 2) == bytes([9, 3])
    client.write(1, 55, 0, 7, 7)
    assert client.read(1, 55, 3) == bytes([0, *word(2048)])


@pytest.mark.parametrize("code", range(8))
def test_baud(code):
    bus, rate = bus_of(), (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)[code]
    bus.rate = 1_000_000
    client = Client(bus)
    assert client.write(1, 6, code) == feetech(1, 0)
    assert bool(bus.ask(feetech(1, 1))) is (code == 0)
    bus.rate = rate
    start = bus.time
    assert bus.ask(feetech(1, 1)) == feetech(1, 0)
    assert bus.time - start == pytest.approx(60 / rate)


def test_an_id_that_is_written_counts_at_once(client, bus):
    assert client.write(1, 5, 9) == feetech(1, 0)
    assert bus.ask(feetech(1, 1)) == b""
    assert bus.ask(feetech(9, 1)) == feetech(9, 0)


# --- what is stored -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("locked", "lock", "now", "later"), [
    (0, "keep", 20, 20), (1, "keep", 20, 32), (1, "drop", 32, 32), (0, "drop", 20, 20)])
def test_lock(locked, lock, now, later):
    bus = bus_of(lock=lock)
    client = Client(bus)
    client.write(1, 55, locked)
    client.write(1, 21, 20)
    assert client.read(1, 21, 1) == bytes([now])
    bus.power_cycle()
    assert client.read(1, 21, 1) == bytes([later])


def test_power_up(client, bus):
    client.write(1, 55, 0)
    client.write(1, 16, *word(500))
    assert client.number(1, 48) == 1000  # copied at power-up only
    client.goal(1, 2100)
    bus.power_cycle()
    assert client.read(1, 40, 1) == b"\0"
    assert client.read(1, 55, 1) == b"\1"
    assert client.number(1, 48) == 500
    bus.advance(0.5)
    assert bus.device(1).seen.duty != 0 or not bus.seen(1).speed  # limp: it stands where it is


def test_reset_keeps_the_id(client, bus):
    client.write(1, 55, 0)
    client.write(1, 5, 4)
    client.write(4, 21, 7)
    bus.ask(feetech(4, 6))
    assert client.read(4, 21, 1) == bytes([32])


def test_what_was_stored_goes_into_another_bus(client, bus):
    client.write(1, 55, 0)
    client.write(1, 31, *word(-100, 11))
    assert bus.to_keep
    other = bus_of()
    other.take_kept(bus.kept())
    assert not other.to_keep
    assert other.registers(1)["Homing_Offset"] == -100
    assert Client(other).read(1, 31, 2) == bytes([0x64, 0x08])


def test_a_file_that_cannot_be_written_is_said_once_and_tried_again(client, bus, tmp_path, monkeypatch):
    folder, said = tmp_path / "gone", []
    folder.mkdir()
    keep = Keep(folder / "kept.json", bus, said.append)
    monkeypatch.setattr(service, "_AGAIN", 0.0)
    client.write(1, 55, 0)
    folder.rmdir()
    for offset in (-100, -200):  # the bus answers all the while
        client.write(1, 31, *word(offset, 11))
        keep.save(always=False)
    assert said == [f"registers cannot be kept in {folder / 'kept.json'} (No such file or directory): tried again "
                    "every second"]
    keep.save(always=True)
    assert said[1].endswith("what is stored is lost")
    folder.mkdir()
    keep.save()
    assert said[2:] == [f"registers are kept in {folder / 'kept.json'} again"]
    assert read_kept(folder / "kept.json", bus)["1"]["Homing_Offset"] == -200
    assert [path.name for path in folder.iterdir()] == ["kept.json"]


# --- counts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("raw", "present"), [(0, 2047), (1, 2047), (2047, 2047), (2048, 2047), (4094, 2047)])
def test_half_turn_homing(raw, present):
    bus = bus_of(angles={1: (raw - 2048) * COUNT})
    client = Client(bus)
    for address in (40, 55, 33):
        client.write(1, address, 0)
    client.write(1, 31, 0, 0)
    offset = client.number(1, 56) - 2047
    client.write(1, 31, *word(offset, 11))
    assert client.number(1, 56) == present


def test_raw_628_with_an_offset_of_904_reads_3820():
    bus = bus_of(angles={1: (628 - 2048) * COUNT})
    client = Client(bus)
    client.write(1, 31, *word(904))
    assert client.number(1, 56) == 3820


def test_phase_bit_4_counts_over_several_turns():
    bus = bus_of(angles={1: (628 - 2048) * COUNT})
    client = Client(bus)
    client.write(1, 31, *word(904))
    client.write(1, 18, 12 | 0x10)
    assert client.number(1, 56) == -276


def test_goals_lie_in_the_shifted_frame_and_within_the_limits(client, bus):
    client.write(1, 31, *word(-500, 11))
    assert client.number(1, 56) == 2548
    assert client.read(1, 40, 1) == b"\0"
    client.goal(1, 2600)
    assert client.read(1, 40, 1) == b"\1"  # a goal turns torque on
    bus.advance(1.0)
    assert abs(client.number(1, 56) - 2600) <= 4
    client.write(1, 11, *word(2580))
    bus.advance(1.0)
    assert abs(client.number(1, 56) - 2580) <= 8


def test_an_offset_that_is_written_moves_nothing(client, bus):
    client.goal(1, 2100)
    bus.advance(1.0)
    before = bus.seen(1).angle
    client.write(1, 31, *word(100))
    bus.advance(1.0)
    assert abs(bus.seen(1).angle - before) < 2.5 * COUNT
    assert client.number(1, 42) == client.number(1, 56)


def test_torque_that_is_switched_on_holds_where_the_shaft_is(client, bus):
    bus.hand(1, 0.4)
    bus.advance(0.1)
    bus.hand(1, None)
    client.write(1, 40, 1)
    bus.advance(1.0)
    assert bus.seen(1).angle == pytest.approx(0.4, abs=3 * COUNT)


def test_128_makes_here_the_middle():
    bus = bus_of(angles={1: 0.5})
    client = Client(bus)
    client.write(1, 40, 128)
    assert client.number(1, 56) == 2048
    assert client.read(1, 40, 1) == b"\0"


def test_another_mode_moves_nothing_and_says_so(client, bus):
    client.write(1, 33, 1)
    client.goal(1, 3000)
    bus.advance(0.5)
    assert client.number(1, 56) == 2048
    assert any("Operating_Mode" in line for line in bus.counts.said)


def test_a_supply_that_is_too_low_or_too_high_shows_in_every_answer():
    for volts, bit in ((3.5, 1), (15.0, 1), (12.0, 0)):
        bus = bus_of(supply=st.Supply(open_circuit_voltage=volts))
        bus.advance(0.1)
        assert bus.ask(feetech(1, 1)) == feetech(1, bit)
    assert Client(bus).read(1, 62, 1) == bytes([120])
