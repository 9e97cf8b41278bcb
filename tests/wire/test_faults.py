"""What is wrong with a wire, on purpose."""

import pytest

import servotwin as st
from servotwin.wire import Fault, Faults, read_faults
from wire_talk import STS, Client, feetech, word

PING = feetech(1, 1)


def bus_of(*faults, count=2, seed=0):
    return st.wire.Bus({k: STS for k in range(1, count + 1)}, faults=Faults(faults, seed))


def share(bus, good):
    return sum(bus.ask(PING) == good for _ in range(400)) / 400


def test_lost_and_bent_bytes_and_late_answers():
    lost, bent = bus_of(Fault("lost", rate=0.25)), bus_of(Fault("bent", rate=0.25))
    for bus in (lost, bent):
        bus.advance(0.0)
    assert share(lost, feetech(1, 0)) == pytest.approx(0.75, abs=0.06)
    assert share(bent, feetech(1, 0)) == pytest.approx(0.75, abs=0.06)
    late = bus_of(Fault("late", seconds=0.2))
    late.advance(0.0)
    late.write(PING)
    assert late.due - late.time == pytest.approx(0.2 + 6e-5)


def test_the_same_faults_in_every_run():
    def run():
        bus = bus_of(Fault("bent", rate=0.5), seed=4)
        bus.advance(0.0)
        return b"".join(bus.ask(PING) for _ in range(100))

    assert run() == run()


def test_echo_absent_and_unplugged():
    bus = bus_of(Fault("echo", until=1.0), Fault("absent", id=1, at=1.0, until=2.0),
                 Fault("unplugged", at=2.0, until=3.0))
    bus.advance(0.1)
    assert bus.ask(PING) == PING + feetech(1, 0)
    bus.advance(1.0)
    assert bus.ask(PING) == b""
    assert bus.ask(feetech(2, 1)) == feetech(2, 0)
    bus.advance(1.0)
    assert bus.ask(feetech(2, 1)) == b""
    bus.advance(1.0)
    assert bus.ask(PING) == feetech(1, 0)


def test_duplicate_ids_spoil_each_others_answers():
    bus = bus_of(Fault("duplicate", id=2, to=1))
    bus.advance(0.0)
    assert bus.ask(PING) == bytes(a & b for a, b in zip(feetech(1, 0), feetech(2, 0), strict=True))


def test_unlike_firmware_and_overload():
    bus = bus_of(Fault("firmware", id=2, version=(3, 9)), Fault("overload", id=1, until=1.0))
    bus.advance(0.0)
    client = Client(bus)
    assert (client.read(1, 0, 2), client.read(2, 0, 2)) == (bytes([3, 10]), bytes([3, 9]))
    assert bus.ask(PING) == feetech(1, 32)
    bus.advance(1.0)
    assert bus.ask(PING) == feetech(1, 0)


def test_a_brown_out_loses_what_is_not_stored():
    bus = bus_of(Fault("brown-out", id=1, at=1.0))
    client = Client(bus)
    client.write(1, 42, *word(2100))
    client.write(1, 21, 20)
    bus.advance(1.5)
    assert (client.read(1, 40, 1), client.read(1, 21, 1)) == (b"\0", b"\x20")


def test_a_call_and_a_file(tmp_path):
    bus = bus_of()
    fault = bus.faults.add("absent", id=1)
    bus.advance(0.01)
    assert bus.ask(PING) == b""
    bus.faults.remove(fault)
    bus.advance(0.01)
    assert bus.ask(PING) == feetech(1, 0)
    (tmp_path / "faults.toml").write_text("[[fault]]\nkind = 'late'\nrate = 0.5\nseconds = 0.1\n", "utf-8")
    assert read_faults(tmp_path / "faults.toml").all == [Fault("late", rate=0.5, seconds=0.1)]


@pytest.mark.parametrize("numbers", [
    {"kind": "lost", "rate": 2.0}, {"kind": "late", "seconds": -1.0}, {"kind": "absent"}, {"kind": "none"},
    {"kind": "duplicate", "id": 1}, {"kind": "firmware", "id": 1}, {"kind": "lost", "at": 2.0, "until": 1.0}])
def test_bad_faults(numbers):
    with pytest.raises(st.errors.InputError):
        Fault(**numbers)


def test_a_fault_of_nobody():
    with pytest.raises(st.errors.InputError):
        bus_of(Fault("overload", id=7)).advance(0.1)


def test_traffic_is_a_log_with_the_truth_beside(tmp_path):
    bus = bus_of()
    logs, client = bus.record(tmp_path / "logs"), Client(bus)
    for k in range(60):
        bus.ask(feetech(0xFE, 0x82, 56, 15, 1, 2))
        client.write(1, 42, *word(2048 + 10 * k))
        bus.advance(0.02)
    logs.close()
    with pytest.raises(st.errors.InputError):
        bus.record(tmp_path / "logs")
    told, = st.read_logs(tmp_path / "logs" / "1.csv")
    true, = st.read_logs(tmp_path / "logs" / "truth" / "1.csv")
    assert len(told.time) == 60
    assert abs(told.measured["output_angle"] - true.measured["output_angle"]).max() < 1e-3
    assert told.measured["output_angle"].max() > 0.5
