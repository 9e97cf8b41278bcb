"""Recording from bus servos: what the peers on a pseudo-terminal do and are told is what rows and registers say."""

import itertools
import math
import random
import sys
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

import servotwin as st
from bench import bus_peers as peers
from servotwin.bench.backends import SerialBackend
from servotwin.bench.bus import MODELS, Bus, BusRig, columns_of, rig_of, scan, wire_of
from servotwin.bench.bus import families as tables
from servotwin.bench.bus.bus import BusServo, Goals, Ticks
from servotwin.bench.recording import About, Experiment, Hold, Limits, record, record_bus
from servotwin.errors import BenchError, InputError, MissingExtraError, UnknownNameError

pytest.importorskip("serial", reason="needs pyserial, of the extra bench")
pytest.importorskip("scservo_sdk", reason="needs feetech-servo-sdk, of the extra bench")
pytest.importorskip("dynamixel_sdk", reason="needs dynamixel-sdk, of the extra bench")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are of POSIX")

KINDS = [peers.STS, peers.X330, peers.XL430, peers.AX12]
NAMES = ["sts", "x330", "xl430", "ax12"]
ALL_KINDS = pytest.mark.parametrize("kind", KINDS, ids=NAMES)
DIALECTS = pytest.mark.parametrize("kind", peers.KINDS.values(), ids=peers.KINDS)
STILL = peers.Reading(angle=-0.5, speed=-2.0, duty=-0.25, current=-0.13, voltage=7.3, temperature=315.15)
BACK = peers.Reading(angle=0.7, speed=1.5, duty=0.5, current=0.26, voltage=8.1, temperature=299.15)


class Patient(Ticks):
    """Passes over no tick, however slow this machine is."""

    began = math.nan  # the latest of all runs

    def next(self):
        self._tick += 1
        if self._tick == 0:
            self.start = Patient.began = time.perf_counter()
        time.sleep(max(0.0, self.start + self._tick / self.rate - time.perf_counter()))
        return self._tick


@pytest.fixture(autouse=True)
def _patient(request, monkeypatch):
    if "real_ticks" not in request.fixturenames:
        monkeypatch.setattr("servotwin.bench.bus.bus.Ticks", Patient)


@pytest.fixture
def real_ticks():
    return Ticks


def run_of(*holds, **more):
    return Experiment(name="run", motion="step", kind="angle", holds=[Hold(*one) for one in holds], **more)


def rig_on(peer, servo=1, patience=0.3, **more):
    rig = BusRig(SerialBackend(peer.port, 1_000_000), peer.kind.protocol, servo, patience=patience, **more)
    rig.open()
    return rig


def bus_on(peer, patience=0.3, **more):
    bus = Bus(SerialBackend(peer.port, 1_000_000), peer.kind.protocol, list(peer.servos), patience=patience, **more)
    bus.open()
    return bus


def by_column(rig, rows):
    return dict(zip(rig.columns, np.array(rows).T, strict=True))


def written(peer, address, servo=1):
    return [data for _, one, at, data in peer.written if one == servo and at == address]


# --- who is there ---------------------------------------------------------------------------------------------------


@DIALECTS
def test_a_scan_finds_every_servo_with_its_model_and_writes_nothing(kind):
    with peers.Bus(kind, [1, 2, 17], peers.Ramp(3)) as peer:
        found = scan(peer.port, ids=[1, 2, 5, 17], patience=0.3)
    assert [(one.id, one.protocol, one.number) for one in found] == [
        (1, kind.protocol, kind.number), (2, kind.protocol, kind.number), (17, kind.protocol, kind.number)]
    assert all(one.model is MODELS[kind.protocol, kind.number] and one.baud == 1_000_000 for one in found)
    assert peer.written == []


def test_a_scan_of_a_wire_without_servos_finds_none():
    with peers.Bus(peers.STS, [], peers.Ramp(0)) as peer:
        assert scan(peer.port, bauds=[1_000_000], ids=range(4)) == []


def test_a_scan_asks_at_the_next_speed_where_nobody_answers():
    with peers.Bus(peers.X330, [3], peers.Ramp(1)) as peer:
        peer.servos[3].silent = True
        speeds = []

        def connect(port, baud):
            speeds.append(baud)
            peer.servos[3].silent = baud != 57_600
            return SerialBackend(port, baud)

        found = scan(peer.port, ids=[], bauds=[1_000_000, 57_600, 115_200], connect=connect)
    assert [(one.id, one.baud) for one in found] == [(3, 57_600)]
    assert speeds == [1_000_000, 57_600]


def test_a_model_that_is_not_known_is_found_and_not_recorded():
    with peers.Bus(peers.X330, [1], peers.Ramp(1)) as peer:
        peer.servos[1].put(0, (9999).to_bytes(2, "little"))
        found = scan(peer.port, ids=[])
        assert (found[0].number, found[0].model) == (9999, None)
        with pytest.raises(BenchError, match="model number 9999"):
            rig_on(peer)


# --- registers ------------------------------------------------------------------------------------------------------


GAINS = [
    (peers.STS, st.feetech_sts, "feetech-sts3215-7v4", {"P_Coefficient": (21, 1)}),
    (peers.X330, st.dynamixel_x, "dynamixel-xl330-m288", {"Position_P_Gain": (84, 2)}),
    (peers.XL430, st.dynamixel_x, "dynamixel-xl430-w250", {"Position_P_Gain": (84, 2)}),
    (peers.AX12, st.dynamixel_ax, "dynamixel-ax-12a",
     {"CW_Compliance_Slope": (28, 1), "CCW_Compliance_Slope": (29, 1)}),
]


@pytest.mark.parametrize(("kind", "setter", "servo", "gains"), GAINS, ids=NAMES)
def test_all_registers_come_as_the_servo_has_them_and_make_its_firmware(kind, setter, servo, gains):
    with peers.Bus(kind, [4], peers.Ramp(1)) as peer:
        for address, size in gains.values():
            peer.servos[4].put(address, (64).to_bytes(size, "little"))
        memory = bytes(peer.servos[4].memory)
        rig = rig_on(peer, 4)
        facts = rig.facts()
        rig.close()
    raw, table = facts["registers"], MODELS[kind.protocol, kind.number].family.registers
    assert set(raw) == set(table)
    assert (raw["ID"], raw["Model_Number"]) == (4, kind.number)
    for name, register in table.items():
        if register.sign_bit is None and not register.signed and not name.startswith("Present"):
            there = memory[register.address:register.address + register.size]
            assert raw[name] == int.from_bytes(there, "little"), name
    gained = setter(raw, servo=servo).firmware.proportional_gain
    assert gained == pytest.approx(setter(dict.fromkeys(gains, 64), servo=servo).firmware.proportional_gain)
    assert gained != pytest.approx(setter({}, servo=servo).firmware.proportional_gain)


def test_an_offset_below_zero_is_read_as_such():
    with peers.Bus(peers.STS, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        assert rig.facts()["registers"]["Homing_Offset"] == -5  # 0x0805: bit 11 is the sign
        rig.close()


TABLES = {"sts": tables.STS, "x330": tables.X330, "x": tables.X, "x without current": tables.X_WITHOUT_CURRENT,
          "mx": tables.MX, "ax": tables.AX}


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_no_two_registers_overlap(table):
    spans = sorted((one.address, one.address + one.size) for one in table.values())
    assert all(before[1] <= after[0] for before, after in itertools.pairwise(spans))


@given(some.sampled_from([one for table in TABLES.values() for one in table.values()]), some.data())
def test_a_value_survives_its_bytes(register, data):
    most = (1 << (8 * register.size - bool(register.signed))) - 1
    if register.sign_bit is not None:
        most = (1 << register.sign_bit) - 1
    least = -most if register.sign_bit is not None else -most - 1 if register.signed else 0
    value = data.draw(some.integers(least, most))
    assert register.decode(register.encode(value)) == value


# --- rows -----------------------------------------------------------------------------------------------------------


@ALL_KINDS
@pytest.mark.parametrize("reading", [STILL, BACK], ids=["negative", "positive"])
def test_a_row_says_in_its_units_what_the_servo_feels_to_half_a_count(kind, reading):
    with peers.Bus(kind, [1], peers.Fixed(reading)) as peer:
        rig = rig_on(peer)
        rows = by_column(rig, list(rig.run(run_of((0.05, reading.angle)))))
        rig.close()
    truth = {"output_angle_deg": ("angle", math.degrees(1.0)), "output_speed_deg_per_s": ("speed", math.degrees(1.0)),
             "duty": ("duty", 1.0), "bus_voltage_V": ("voltage", 1.0), "housing_temperature_K": ("temperature", 1.0)}
    truth["supply_current_A" if kind is peers.X330 else "armature_current_A"] = ("current", 1.0)
    if kind is peers.AX12:
        truth["present_load"] = truth.pop("duty")
    compared = 0
    for column, (name, factor) in truth.items():
        if name in kind.outputs and column in rows:
            half = 0.5 * kind.outputs[name][2] * factor
            assert rows[column] == pytest.approx(getattr(reading, name) * factor, abs=half * 1.0001), column
            compared += 1
    assert compared == len(kind.outputs)
    assert set(rows["torque_on"]) == {1.0}


def test_a_speed_in_coarse_steps_is_read_as_the_servo_is_set():
    values = {"Phase": 0, "Max_Position_Limit": 4095}
    family = MODELS["feetech", 777].family
    assert family.columns(values)[1].scale == pytest.approx(50.0 * family.columns({"Phase": 12})[1].scale)


@DIALECTS
def test_a_row_has_the_angle_of_its_time(kind):
    with peers.Bus(kind, [1], peers.Ramp(1, speed=4.0)) as peer:
        rig = rig_on(peer)
        rig.approach(0.0)
        peer.servos[1].truth.clear()
        rows = by_column(rig, list(rig.run(run_of((0.05, 0.0), (0.2, 1.0), (0.3, -1.0)))))
        rig.close()
        truth = peer.servos[1].truth
    times = np.array([one[0] for one in truth])
    angles = np.degrees([one[1].angle for one in truth])
    at = rows["time_s"] + Patient.began  # peer and bench have one clock
    offsets = np.array([min(times - t, key=abs) for t in at])
    assert np.median(np.abs(offsets)) < 2e-3  # a question and an answer here last well under a millisecond
    assert np.all(np.diff(rows["time_s"]) > 0.0)
    then = np.interp(at, times, angles)
    count = math.degrees(kind.outputs["angle"][2])
    assert np.median(np.abs(rows["output_angle_deg"] - then)) < count
    assert rows["output_angle_deg"].min() < -10.0 < 20.0 < rows["output_angle_deg"].max()


# --- orders ---------------------------------------------------------------------------------------------------------


@DIALECTS
def test_goals_reach_the_servo_in_counts_and_repeat_every_frame(kind):
    address, _, unit, sign = kind.goal
    with peers.Bus(kind, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        rig.approach(0.0)
        peer.written.clear()
        rows = by_column(rig, list(rig.run(run_of((0.1, 0.3), (0.1, -0.4), frame_period=0.05))))
        counts = [peers.number_of(data, sign) - kind.middle for data in written(peer, address)]
        rig.close()
    assert counts == [round(0.3 / unit)] * 2 + [round(-0.4 / unit)] * 2
    assert rows["command_angle_deg"] == pytest.approx(np.degrees(np.repeat(counts[1:3], 10) * unit), abs=1e-9)
    assert len(rows["time_s"]) == 20


@DIALECTS
def test_a_hold_without_a_value_is_torque_off_and_comes_back_to_the_new_goal(kind):
    with peers.Bus(kind, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        rig.approach(0.0)
        peer.written.clear()
        rows = by_column(rig, list(rig.run(run_of((0.05, 0.0), (0.1, None), (0.05, 0.2)))))
        order = [(at, data) for _, _, at, data in peer.written]
        rig.close()
    assert rows["torque_on"].tolist() == [1.0] * 5 + [0.0] * 10 + [1.0] * 5
    switched = [k for k, (at, _) in enumerate(order) if at == kind.torque_at]
    assert [order[k][1] for k in switched] == [b"\x00", b"\x01"]
    before = order[switched[1] - 1]
    assert before[0] == kind.goal[0]  # it knows where to go before it may
    assert peers.number_of(before[1], kind.goal[3]) - kind.middle == round(0.2 / kind.goal[2])
    assert not np.isnan(rows["command_angle_deg"]).any()


@DIALECTS
def test_a_servo_goes_to_its_first_angle_slowly_and_from_where_it_is(kind):
    with peers.Bus(kind, [1], peers.Ramp(1, speed=50.0)) as peer:
        peer.servos[1].plant.angle[0] = -0.2
        rig = rig_on(peer)
        peer.written.clear()
        rig.approach(0.2)
        goals = [(peers.number_of(data, kind.goal[3]) - kind.middle) * kind.goal[2]
                 for data in written(peer, kind.goal[0])]
        assert peer.servos[1].torque
        angle = peer.servos[1].plant.angle[0]
        rig.close()
    assert goals[0] == pytest.approx(-0.2, abs=kind.goal[2])
    assert max(np.abs(np.diff(goals))) < math.radians(60.0) / 50.0 + 2.0 * kind.goal[2]
    assert angle == pytest.approx(0.2, abs=kind.goal[2])


def test_experiments_become_ticks():
    family = MODELS["feetech", 777].family
    plan = Goals(run_of((0.1, 0.0), (0.001, 1.0), (0.05, None), frame_period=0.02), family, (0, 4095), 100.0)
    assert plan.ticks == 10 + 1 + 5
    assert [plan.at(k).goal for k in (0, 9, 10, 11, 15, 99)] == [2048, 2048, 2700, None, None, None]
    assert len({plan.at(k).number for k in range(10)}) == 5


# --- cables and other trouble -----------------------------------------------------------------------------------------


@DIALECTS
def test_limp_is_torque_off(kind):
    with peers.Bus(kind, [1, 2], peers.Ramp(2)) as peer:
        bus = bus_on(peer)
        bus.approach({1: 0.1, 2: -0.1})
        assert all(one.torque for one in peer.servos.values())
        bus.limp()
        assert not any(one.torque for one in peer.servos.values())
        bus.close()


@DIALECTS
def test_a_cable_that_is_pulled_ends_the_run_in_one_line_and_keeps_the_rows(kind):
    with peers.Bus(kind, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        rows = []
        with pytest.raises(BenchError) as error:  # noqa: PT012
            for row in rig.run(run_of((5.0, 0.0))):
                rows.append(row)
                if len(rows) == 20:
                    peer.cut()
        rig.limp()  # nobody hears, and nothing is raised
        rig.close()
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"port {peer.port}:")
    assert len(rows) == 20
    assert not any(math.isnan(x) for row in rows for x in row)


@DIALECTS
def test_a_servo_that_falls_silent_ends_the_run_and_the_others_go_limp(kind):
    with peers.Bus(kind, [1, 2], peers.Ramp(2)) as peer:
        bus = bus_on(peer, patience=0.02)
        rows = []
        began = math.nan
        with pytest.raises(BenchError, match=r"servo 2 .*has not answered for 0\.5 s"):  # noqa: PT012
            for row in bus.run({1: run_of((5.0, 0.0)), 2: run_of((5.0, 0.0))}):
                rows.append(row)
                if len(rows) == 10:
                    peer.servos[2].silent, began = True, time.perf_counter()
        assert time.perf_counter() - began < 5.0
        missed = sum(any(map(math.isnan, row[1])) for row in rows)
        assert missed <= 0.1 * len(rows)  # one that is silent harms no other; 20 ms are short on a machine that is busy
        bus.limp()
        assert not any(one.torque for one in peer.servos.values())
        bus.close()


@DIALECTS
def test_an_answer_that_comes_late_is_none_to_the_next_question(kind):
    def late(frame):
        time.sleep(0.06)
        return frame

    with peers.Bus(kind, [1], peers.Fixed(STILL)) as peer:
        peer.harm = late
        rig = rig_on(peer, patience=0.04)
        peer.harm = lambda frame: frame
        memory = bytes(peer.servos[1].memory)
        rig.close()
    known = MODELS[kind.protocol, kind.number].family.registers
    assert rig.facts()["registers"] == tables.decoded(known, dict(enumerate(memory)))


@DIALECTS
@pytest.mark.parametrize("harm", ["lost", "flipped"])
def test_damaged_answers_are_gaps_and_never_rows(kind, harm):
    draw = random.Random(1)

    def hurt(frame):
        if draw.random() > 0.1:
            return frame
        place = draw.randrange(len(frame))
        return frame[:place] + frame[place + 1:] if harm == "lost" else (
            frame[:place] + bytes([frame[place] ^ 1 << draw.randrange(8)]) + frame[place + 1:])

    with peers.Bus(kind, [1], peers.Fixed(STILL)) as peer:
        rig = rig_on(peer, rate=200.0, patience=0.05)
        list(rig.run(run_of((0.01, 0.0))))  # torque is on
        peer.harm = hurt
        rows = by_column(rig, list(rig.run(run_of((0.4, 0.0), frame_period=0.05))))
        peer.harm = lambda frame: frame
        rig.close()
        facts = rig.facts()
    angle = rows["output_angle_deg"]
    gaps = np.isnan(angle)
    assert angle[~gaps] == pytest.approx(math.degrees(STILL.angle), abs=math.degrees(kind.outputs["angle"][2]))
    assert facts["lost_answers"] == gaps.sum()
    assert (~gaps).sum() > 0.5 * gaps.size
    assert gaps.any()
    assert np.all(np.diff(rows["time_s"]) > 0.0)
    assert not np.isnan(rows["time_s"]).any()
    assert not np.isnan(rows["torque_on"]).any()


@pytest.mark.parametrize("protocol", peers.KINDS)
def test_a_wire_full_of_noise_is_an_error_in_one_line(protocol):
    draw = random.Random(0)
    kind = peers.KINDS[protocol]
    head = {"dynamixel-2": b"\xff\xff\xfd\x00"}.get(protocol, b"\xff\xff")
    with peers.Bus(kind, [1], peers.Ramp(1)) as peer:
        wire = wire_of(protocol, SerialBackend(peer.port, 1_000_000))
        wire.open()
        for length in (0, 9, 60):
            peer.harm = lambda frame, length=length: b"".join(
                head + bytes([1, length % 7]) + draw.randbytes(length) for _ in range(2))
            with pytest.raises(BenchError, match="does not answer") as error:
                wire.read(1, 0, 2)
            assert "\n" not in str(error.value)
        peer.harm = lambda frame: frame
        assert wire.read(1, kind.number_at, 2).data == kind.number.to_bytes(2, "little")
        wire.close()


def test_stuffed_bytes_are_taken_out_of_an_answer():
    backwards = STILL._replace(current=-0.001, speed=-3 * 0.229 * peers.RPM)  # FF FF, then FD FF FF FF
    with peers.Bus(peers.X330, [1], peers.Fixed(backwards)) as peer:
        rig = rig_on(peer)
        rows = by_column(rig, list(rig.run(run_of((0.05, 0.0)))))
        rig.close()
    assert rows["supply_current_A"] == pytest.approx(-0.001)
    assert rows["output_speed_deg_per_s"] == pytest.approx(-3 * 0.229 * 6.0)


EVENTS = [(peers.STS, 32, b"", "error: overload"), (peers.STS, 4, b"", "error: heat"),
          (peers.X330, 128, b"\x20", "error: overload"), (peers.X330, 128, b"\x05", "error: voltage, heat"),
          (peers.AX12, 36, b"", "error: heat, overload")]


@pytest.mark.parametrize(("kind", "status", "hardware", "said"), EVENTS)
def test_an_error_that_a_servo_tells_is_noted_with_its_time(kind, status, hardware, said):
    with peers.Bus(kind, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        rows = []
        for row in rig.run(run_of((0.3, 0.0))):
            rows.append(row)
            if len(rows) == 10:
                peer.servos[1].put(70 if hardware else 0, hardware)
                peer.servos[1].error = status
            if len(rows) == 20:
                peer.servos[1].error = 0
        events = rig.facts()["events"]
        rig.close()
    assert [event["what"] for event in events] == [said, "no error any more"]
    assert events[0]["time_s"] == pytest.approx(rows[10][0], abs=1e-3)
    assert not any(math.isnan(x) for row in rows for x in row)


def test_torque_that_a_servo_takes_itself_stays_off_and_is_said():
    with peers.Bus(peers.X330, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        rows = []
        for row in rig.run(run_of((0.3, 0.0))):
            rows.append(row)
            if len(rows) == 10:
                peer.servos[1].put(70, b"\x20")
                peer.servos[1].put(64, b"\x00")
                peer.servos[1].error = 128
        assert not peer.servos[1].torque
        events = rig.facts()["events"]
        peer.servos[1].error = 0
        rig.close()
    assert events[0]["what"] == "error: overload; it has switched its torque off"
    assert [row[-1] for row in rows] == [1.0] * 10 + [0.0] * 20


def test_a_servo_that_acknowledges_nothing_is_told_all_the_same():
    with peers.Bus(peers.STS, [1], peers.Ramp(1)) as peer:
        peer.harm = lambda frame: b"" if len(frame) == 6 else frame
        rig = rig_on(peer, patience=0.1)
        rig.approach(0.1)
        assert peer.servos[1].torque
        rig.close()
        assert not peer.servos[1].torque


# --- several at once ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [peers.STS, peers.X330], ids=["sts", "x330"])
def test_six_servos_each_get_their_own_experiment_and_rows(kind):
    ids = [1, 2, 3, 4, 5, 9]
    with peers.Bus(kind, ids, peers.Ramp(6, speed=20.0)) as peer:
        bus = bus_on(peer)
        bus.approach(dict.fromkeys(ids, 0.0))
        ends = {one: 0.1 * k - 0.2 for k, one in enumerate(ids)}
        rows = list(bus.run({one: run_of((0.1, 0.0), (0.4 if one != 9 else 0.2, end)) for one, end in ends.items()}))
        assert columns_of(bus, 1)[:3] == ("time_s", "command_angle_deg", "output_angle_deg")
        bus.close()
    for one, end in ends.items():
        own = np.array([row[one] for row in rows if one in row])
        assert len(own) + bus.late >= (50 if one != 9 else 30) > len(own) - 1
        assert np.all(np.diff(own[:, 0]) > 0.0)
        assert own[-1, 2] == pytest.approx(math.degrees(end), abs=0.1)
        assert own[-1, 1] == pytest.approx(math.degrees(end), abs=0.1)


def test_ticks_do_not_drift_and_those_that_were_missed_are_counted(real_ticks):
    with peers.Bus(peers.STS, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer, rate=200.0)
        times = []
        for row in rig.run(run_of((1.0, 0.0))):
            times.append(row[0])
            if len(times) == 50:
                time.sleep(0.0525)  # whoever takes the rows is slow once
        late = rig.facts()["late_ticks"]
        rig.close()
    assert late >= 9  # whole ones of 52.5 ms, the one in which it was slow apart
    assert len(times) + late == 200
    phase = np.array(times) * 200.0 % 1.0
    assert np.median(np.minimum(phase, 1.0 - phase)) < 0.3


# --- from a servo to a log --------------------------------------------------------------------------------------------


def test_a_recorded_log_is_read_with_its_registers(tmp_path):
    limits = Limits(kind="angle", low=-1.0, high=1.0, voltage=7.4, current=1.0)
    with peers.Bus(peers.STS, [5], peers.Ramp(1)) as peer:
        rig = rig_of(peer.port, scan(peer.port, ids=[5], patience=0.3)[0])
        rig.open()
        record(rig, run_of((0.1, 0.0), (0.2, 0.5), (0.05, None)), tmp_path / "run.csv", limits=limits,
               about=About(servo="sts"))
        rig.close()
        assert not peer.servos[5].torque
    log, = st.read_logs(tmp_path / "run.csv")
    assert log.command_kind == "angle"
    assert set(log.measured) == {"output_angle", "output_speed", "duty", "armature_current", "bus_voltage",
                                 "housing_temperature"}
    assert log.command[-6] == pytest.approx(0.5, abs=1e-3)
    assert log.torque_on.sum() == 30
    assert '"P_Coefficient": 32' in (tmp_path / "run.json").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), [(peers.STS, "feetech-sts3215-7v4"), (peers.X330, "dynamixel-xl330-m288")],
                         ids=["sts", "x330"])
def test_six_recorded_servos_do_what_their_model_does_with_these_commands(kind, name):
    ids, step = range(1, 7), 0.01
    with peers.Bus(kind, ids, peers.Fleet(name, 6, step)) as peer:
        bus = bus_on(peer, rate=1.0 / step)
        ends = {one: 0.15 * one for one in ids}
        rows = list(bus.run({one: run_of((0.1, 0.0), (0.4, end), (0.3, -end)) for one, end in ends.items()}))
        bus.close()
    model = st.DigitalServo(st.load_servo(name))
    # the first tick of the plant comes with the first question; what a row commands is heard after it
    times = 1e-3 + step * np.arange(1, len(rows) + 1)
    for one in (1, 6):
        own = np.radians(np.array([row[one][1:3] for row in rows]))
        command = st.signals.samples(np.r_[0.0, times], np.r_[0.0, own[:, 0]], unit="rad", hold="previous")
        again = st.simulate(model, command, duration=float(times[-1]), output_times=times)["output_angle"]
        assert own[:, 1] == pytest.approx(again, abs=1.01 * peers.TURN)
        assert np.ptp(own[:, 1]) > 0.9 * ends[one]


# --- bad input ------------------------------------------------------------------------------------------------------


def test_what_cannot_be_is_refused_in_one_line():
    with peers.Bus(peers.STS, [1], peers.Ramp(1)) as peer:
        for rate in (0.0, 2000.0, math.nan, "fast"):
            with pytest.raises(InputError, match="rate"):
                rig_on(peer, rate=rate)
        with pytest.raises(InputError, match="each once"):
            Bus(SerialBackend(peer.port, 1), "feetech", [1, 1])
        with pytest.raises(UnknownNameError, match="feetech"):
            Bus(SerialBackend(peer.port, 1), "feetec", [1])
        with pytest.raises(InputError, match=r"at most \d+ Hz for 1 servos at 57600"):
            rig_on(peer, rate=300.0, baud=57_600)
        with pytest.raises(BenchError, match=r"servo 8 .*does not answer"):
            rig_on(peer, 8, patience=0.02)
        with pytest.raises(InputError, match="ids"):
            scan(peer.port, ids=[300])
        rig = rig_on(peer)
        with pytest.raises(InputError, match="pulse_width"):
            next(rig.run(Experiment(name="a", motion="a", kind="pulse_width", holds=[Hold(1.0, 1.5e-3)])))
        with pytest.raises(InputError, match=r"-180 to 179\.9 deg"):
            rig.approach(4.0)
        rig.close()


WHEELS = [(peers.STS, 33, 1), (peers.X330, 11, 1), (peers.AX12, 8, 0)]


@pytest.mark.parametrize(("kind", "address", "value"), WHEELS)
def test_a_wheel_is_refused(kind, address, value):
    with peers.Bus(kind, [1], peers.Ramp(1)) as peer:
        peer.servos[1].put(address, value.to_bytes(2 if kind is peers.AX12 else 1, "little"))
        with pytest.raises(BenchError, match="not set to control its angle"):
            rig_on(peer)


TURNS = [(777, {"Max_Position_Limit": 0}, -5000), (1200, {"Operating_Mode": 4}, -5000)]


@pytest.mark.parametrize(("number", "values", "count"), TURNS)
def test_a_servo_that_turns_without_end_has_counts_below_zero(number, values, count):
    model = next(one for one in MODELS.values() if one.number == number)
    servo = BusServo(1, model, values)
    assert servo.limits[0] <= count
    register = model.family.registers["Present_Position"]
    at = register.address - model.family.block[0]
    data = bytes(at) + register.encode(count) + bytes(model.family.block[1] - at - register.size)
    assert servo.values(data)[0] == pytest.approx((count - 2048) * 360.0 / 4096.0)


def test_a_port_that_is_missing_or_taken_is_one_line():
    with pytest.raises(BenchError, match="no such port"):
        scan("/dev/no-such-port")
    with peers.Bus(peers.STS, [1], peers.Ramp(1)) as peer:
        rig = rig_on(peer)
        with pytest.raises(BenchError, match="another program has it"):
            scan(peer.port)
        rig.close()


@pytest.mark.parametrize(("module", "package", "protocol"), [
    ("scservo_sdk", "feetech-servo-sdk", "feetech"), ("dynamixel_sdk", "dynamixel-sdk", "dynamixel-2")])
def test_a_missing_package_is_named(monkeypatch, module, package, protocol):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"{package} .*servotwin\[bench\]"):
        wire_of(protocol, SerialBackend("x", 1))


def test_servos_that_are_recorded_together_have_a_log_each(tmp_path):
    readings = peers.Fixed(STILL, BACK)
    with peers.Bus(peers.STS, [3, 5], readings) as peer:
        bus = bus_on(peer)
        paths = {3: tmp_path / "run_3.csv", 5: tmp_path / "run_5.csv"}
        about = {one: About(servo=f"servo {one}") for one in paths}
        limits = Limits(kind="angle", low=-1.0, high=1.0, voltage=7.4, current=1.0)
        found = record_bus(bus, run_of((0.3, 0.2)), paths, limits=limits, about=about)
        bus.close()
    assert [log.name for log in st.read_logs(tmp_path)] == ["run_3", "run_5"]
    assert {one: log.rows for one, log in found.items()} == dict.fromkeys(paths, 30)
    for path, seen in zip(paths.values(), (STILL, BACK), strict=True):
        log, = st.read_logs(path)
        assert log.measured["output_angle"][3] == pytest.approx(seen.angle, abs=2e-3)
        assert log.measured["bus_voltage"][3] == pytest.approx(seen.voltage, abs=0.06)


def test_the_current_of_the_motor_ends_a_run_where_no_other_is_measured(tmp_path):
    strong = STILL._replace(current=-1.6)
    with peers.Bus(peers.STS, [1], peers.Fixed(strong)) as peer:
        rig = rig_on(peer)
        limits = Limits(kind="angle", low=-1.0, high=1.0, voltage=7.4, current=1.0)
        with pytest.raises(BenchError, match=r"limit of 1 A; \d+ rows are kept"):
            record(rig, run_of((2.0, 0.2)), tmp_path / "run.csv", limits=limits, about=About(servo="strong"))
        rig.close()
    assert len(st.read_logs(tmp_path / "run.csv")[0]) < 60
