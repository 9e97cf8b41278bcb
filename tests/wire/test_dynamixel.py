"""What XL330 and XL430 do with packets and registers of protocol 2.0."""

import math

import pytest

import servotwin as st
from wire_talk import COUNT, crc, dynamixel, word

XL330, XL430 = "dynamixel-xl330-m288", "dynamixel-xl430-w250"


def long(value):
    return (value & 0xFFFFFFFF).to_bytes(4, "little")


def answers(data):
    """Return (id, error, data) of all status packets."""
    found = []
    while data:
        assert data[:4] == b"\xff\xff\xfd\0", data.hex()
        size = 7 + int.from_bytes(data[5:7], "little")
        whole, data = data[:size], data[size:]
        assert crc(whole[:-2]) == int.from_bytes(whole[-2:], "little")
        assert whole[7] == 0x55
        found.append((whole[4], whole[8], whole[9:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")))
    return found


@pytest.fixture
def bus():
    return st.wire.Bus({1: XL430, 2: XL430, 3: XL330, 4: XL330})


def ask(bus, id, code, *data, patience=0.1):
    return answers(bus.ask(dynamixel(id, code, *data), patience))


def read(bus, id, address, count):
    (_, error, data), = ask(bus, id, 2, *word(address), *word(count))
    return error or int.from_bytes(data, "little", signed=count == 4)


def write(bus, id, address, data):
    (_, error, _), = ask(bus, id, 3, *word(address), *data)
    return error


def test_ping(bus):
    assert ask(bus, 1, 1) == [(1, 0, bytes([*word(1060), 45]))]
    assert ask(bus, 3, 1) == [(3, 0, bytes([*word(1200), 45]))]
    assert [one[0] for one in ask(bus, 0xFE, 1)] == [1, 2, 3, 4]


def test_each_voltage_has_a_supply(bus):
    assert (read(bus, 1, 144, 2), read(bus, 3, 144, 2)) == (111, 50)


def test_koch_as_lerobot_has_it(bus):
    for id in (1, 2, 3, 4):
        assert write(bus, id, 64, [0]) == 0
        assert write(bus, id, 11, [4]) == 0
        assert write(bus, id, 20, long(0)) == 0
        assert write(bus, id, 48, long(4095)) == write(bus, id, 52, long(0)) == 0
    ids = (1, 2, 3, 4)
    found = ask(bus, 0xFE, 0x82, *word(132), *word(4), *ids)
    assert [one[:2] for one in found] == [(id, 0) for id in ids]
    for id, _, data in found:
        assert write(bus, id, 20, long(2047 - int.from_bytes(data, "little", signed=True))) == 0
        assert read(bus, id, 132, 4) == 2047
        assert write(bus, id, 9, [0]) == 0
        assert write(bus, id, 64, [1]) == 0
    goal = [byte for id in ids for byte in (id, *long(2300))]
    assert ask(bus, 0xFE, 0x83, *word(116), *word(4), *goal) == []
    bus.advance(2.0)
    for _, _, data in ask(bus, 0xFE, 0x82, *word(132), *word(4), *ids):
        assert int.from_bytes(data, "little") == pytest.approx(2300, abs=60)


def test_gains_act(bus):
    def moved(id, gain):
        write(bus, id, 84, word(gain))
        write(bus, id, 64, [1])
        write(bus, id, 116, long(2060))
        bus.advance(1e-2)
        return abs(read(bus, id, 124, 2))

    assert 0 < moved(3, 100) < moved(4, 800)


def test_errors(bus):
    assert write(bus, 3, 64, [1]) == 0
    assert write(bus, 3, 20, long(5)) == 7  # EEPROM, torque on
    assert write(bus, 3, 132, long(5)) == 7  # read only
    assert write(bus, 3, 116, long(5000)) == 6  # beyond Max_Position_Limit
    assert write(bus, 3, 116, bytes(2)) == 5  # half a register
    assert write(bus, 3, 64, [9]) == 4
    assert write(bus, 3, 64, [0]) == 0
    assert write(bus, 3, 11, [0]) == 4  # current alone is not computed: refused
    assert bus.counts.said
    assert ask(bus, 3, 0x20)[0][1] == 2
    assert ask(bus, 3, 2, *word(650), *word(30))[0][1] == 7


def test_status_level_and_return_delay(bus):
    write(bus, 3, 9, [0])
    write(bus, 3, 68, [1])
    assert ask(bus, 3, 3, *word(64), 1) == []
    assert read(bus, 3, 64, 1) == 1
    write_zero = dynamixel(3, 3, *word(68), 0)
    assert bus.ask(write_zero) == b""
    assert ask(bus, 3, 2, *word(64), *word(1)) == []
    assert len(ask(bus, 3, 1)) == 1


def test_reg_write_and_action(bus):
    assert ask(bus, 3, 4, *word(65), 1) == [(3, 0, b"")]
    assert read(bus, 3, 69, 1) == 1
    assert read(bus, 3, 65, 1) == 0
    assert ask(bus, 0xFE, 5) == []
    assert read(bus, 3, 65, 1) == 1


def test_bulk(bus):
    found = ask(bus, 0xFE, 0x92, 1, *word(0), *word(2), 3, *word(132), *word(4))
    assert found == [(1, 0, bytes(word(1060))), (3, 0, long(2048))]
    assert ask(bus, 0xFE, 0x93, 1, *word(65), *word(1), 1, 3, *word(84), *word(2), *word(123)) == []
    assert (read(bus, 1, 65, 1), read(bus, 3, 84, 2)) == (1, 123)


@pytest.mark.parametrize("bulk", [False, True])
def test_fast_reads_are_one_packet(bus, bulk):
    data = [x for id in (1, 3) for x in (id, *word(132), *word(4))] if bulk else [*word(132), *word(4), 1, 3]
    whole = bus.ask(dynamixel(0xFE, 0x9A if bulk else 0x8A, *data))
    assert whole[:8] == bytes([0xFF, 0xFF, 0xFD, 0, 0xFE, *word(17), 0x55])
    assert len(whole) == 7 + 17
    for end in (16, 24):
        assert crc(whole[:end - 2]) == int.from_bytes(whole[end - 2:end], "little")
    assert (whole[8:14], whole[16:22]) == (bytes([0, 1]) + long(2048), bytes([0, 3]) + long(2048))


def test_reverse_and_offset(bus):
    write(bus, 3, 20, long(100))
    assert read(bus, 3, 132, 4) == 2148
    write(bus, 3, 10, [1])
    write(bus, 3, 64, [1])
    write(bus, 3, 116, long(2400))
    bus.advance(1.5)
    assert read(bus, 3, 132, 4) == pytest.approx(2400, abs=25)
    assert bus.seen(3).angle < -200 * COUNT


def test_profile(bus):
    write(bus, 3, 112, long(20))
    write(bus, 3, 64, [1])
    write(bus, 3, 116, long(3000))
    bus.advance(0.5)
    assert bus.seen(3).speed == pytest.approx(20 * 0.229 * math.pi / 30, rel=0.05)
    assert read(bus, 3, 122, 1) == 1
    write(bus, 3, 112, long(0))
    bus.advance(1.5)
    assert read(bus, 3, 122, 1) == 0


def test_current_mode_holds_the_current(bus):
    write(bus, 3, 11, [5])
    write(bus, 3, 102, word(100))
    write(bus, 3, 64, [1])
    write(bus, 3, 116, long(3500))
    most = 0.0
    for _ in range(60):
        bus.advance(2e-3)
        most = max(most, abs(bus.seen(3).supply_current))
    assert 0.05 < most < 0.16  # free it takes 0.6 A


def test_indirect_addresses(bus):
    write(bus, 3, 168, [*word(132), *word(133), *word(65)])
    (_, _, data), = ask(bus, 3, 2, *word(208), *word(3))
    assert data == bytes([*word(2048), 0])
    assert write(bus, 3, 210, [1]) == 0
    assert read(bus, 3, 65, 1) == 1


def test_reboot_and_reset(bus):
    write(bus, 3, 84, word(123))
    write(bus, 3, 31, [60])
    ask(bus, 3, 8)
    assert (read(bus, 3, 84, 2), read(bus, 3, 31, 1)) == (400, 60)
    assert ask(bus, 3, 6, 1) == [(3, 0, b"")]
    assert read(bus, 3, 31, 1) == 70
    bus.rate = 1_000_000
    assert ask(bus, 3, 1) == []  # its rate is the factory's again, 57600
