"""What is said of a completed run: by its physics, the same for a lane as alone, and in sweeps and fleets."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.remarks import BELOW_CHIP, CANNOT_HOLD, HELD_BACK, ON_STOP, REFUSED, Remark

DURATION = 1.5
OF_SUPPLY = {HELD_BACK, BELOW_CHIP}
SERVO = st.load_servo("hitec-hs-755hb")
PULSES, MEAN = st.PulseServo(SERVO), st.BoundedServo(SERVO)
STEP = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
HOLD = st.signals.constant(60.0, unit="deg")
END, FROM_START = DURATION, 0.0
PERIOD = PULSES.frame_period
OUT_OF_RANGE = st.signals.step(1500.0, 2950.0, at=0.5, unit="us")
FREE = SERVO.replace({"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0})


def full_drive(servo):
    """Return torque at a standstill under full drive, and what friction adds or takes [N m] (physics.md, 3 and 5)."""
    value = lambda name: float(servo.get(name) or 0.0)  # noqa: E731
    N, drop = value("gear.gear_reduction"), value("supply.bridge_drop_voltage") + value("motor.brush_drop_voltage")
    R = value("motor.armature_resistance") + value("supply.bridge_drop_resistance") + value(
        "supply.internal_resistance")
    torque = N * value("motor.torque_constant") * (value("supply.open_circuit_voltage") - drop) / R
    return torque, N * value("friction.coulomb_torque_forward") * float(servo.get("friction.breakaway_ratio") or 1.0)


TORQUE, FRICTION = full_drive(SERVO)
LIFTS, FALLS = 0.97 * (TORQUE - FRICTION), 1.3 * (TORQUE + FRICTION)
CASES = {
    "free": (PULSES, STEP, None, {}),
    "free, mean": (MEAN, STEP, None, {}),
    "just lifted": (PULSES, STEP, st.loads.Constant(LIFTS), {}),
    "just not lifted": (PULSES, STEP, st.loads.Constant(1.03 * (TORQUE - FRICTION)), {CANNOT_HOLD: END}),
    "just not lifted, mean": (MEAN, STEP, st.loads.Constant(1.03 * (TORQUE - FRICTION)), {CANNOT_HOLD: END}),
    "pushed back to the stop": (PULSES, STEP, st.loads.Constant(FALLS), {ON_STOP: END, CANNOT_HOLD: END}),
    "pushed back to the stop, mean": (MEAN, HOLD, st.loads.Constant(FALLS), {ON_STOP: END, CANNOT_HOLD: END}),
    "pushed back downwards": (
        PULSES, HOLD, st.loads.Constant(-FALLS), {ON_STOP: END, CANNOT_HOLD: END}),
    "heavy arm sags": (PULSES, HOLD, st.loads.Pendulum(mass=3.0, length=0.1), {CANNOT_HOLD: END}),
    "arm beyond its peak": (  # it is held where it stands, and could not be where it was sent
        PULSES, st.signals.step(0.0, 90.0, at=0.1, unit="deg"), st.loads.Pendulum(mass=2.3, length=0.1),
        {CANNOT_HOLD: END}),
    "stiff spring": (PULSES, STEP, st.loads.Spring(5.0), {CANNOT_HOLD: END}),
    "stuck by the load's friction": (PULSES, STEP, st.loads.Coulomb(1.2 * TORQUE), {CANNOT_HOLD: END}),
    "not there yet": (PULSES, STEP, st.loads.Inertia(1.0), {}),
    "load that helps": (PULSES, STEP, st.loads.Constant(-0.5), {}),
    "jammed beyond the stop": (PULSES, st.signals.step(1500.0, 2650.0, at=0.1, unit="us"), None, {ON_STOP: END}),
    "sent to the stop": (PULSES, st.signals.step(0.0, 195.0, at=0.1, unit="deg"), st.loads.Constant(-0.5), {}),
    "refused from a step on": (PULSES, OUT_OF_RANGE, None, {REFUSED: 25 * PERIOD}),
    "all refused, and it falls": (
        PULSES, st.signals.constant(2950.0, unit="us"), st.loads.Constant(1.0), {REFUSED: FROM_START}),
    "refused for a while": (
        PULSES, st.signals.samples([0.0, 0.5, 0.8], [1500.0, 2950.0, 1500.0], unit="us"), None, {}),
    "own edges, the last two refused": (
        PULSES, st.signals.pulse_train([0.0, 0.4, 0.9, 1.2], [1500.0, 1600.0, 2950.0, 100.0]), None, {REFUSED: 0.9}),
    "no pulse within the run": (PULSES, st.signals.pulse_train([0.0, 0.02], [1500.0, 1500.0]), None, {}),
    "motor": (st.GearedMotor(SERVO), st.signals.constant(6.0, unit="V"), st.loads.Constant(FALLS), {}),
    "averaged": (st.AveragedServo(SERVO), STEP, st.loads.Constant(FALLS), {}),
    "weak supply": (
        st.PulseServo(SERVO.replace({"supply.current_limit": 0.5})), STEP, st.loads.Constant(0.8),
        {ON_STOP: END, CANNOT_HOLD: END}),
    "weak battery": (
        st.PulseServo(SERVO.replace({"supply.internal_resistance": 3.0})), STEP, st.loads.Constant(LIFTS),
        {ON_STOP: END, CANNOT_HOLD: END}),
    "warm": (
        st.PulseServo(FREE.replace({
            "thermal.winding_capacity": 0.2, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 40.0,
            "thermal.housing_to_ambient": 16.0})),
        STEP, st.loads.Constant(0.97 * TORQUE), {ON_STOP: END, CANNOT_HOLD: END}),
    "cold": (st.PulseServo(FREE), STEP, st.loads.Constant(0.9 * TORQUE), {}),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_said_of_a_run(case):
    model, command, load, expected = CASES[case]
    result = st.simulate(model, command, load=load, duration=DURATION, output_times=[DURATION])
    assert result.status.ok
    found = dict(result.remarks)
    assert (HELD_BACK in found) == case.startswith("weak")
    assert {kind: time for kind, time in found.items() if kind not in OF_SUPPLY} == pytest.approx(expected)
    assert all(f"{remark.time:g} s" in remark.words for remark in result.remarks if not remark.numbers)


@pytest.mark.long(but="BoundedServo('hitec-hs-755hb')-float64")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("model", [PULSES, MEAN], ids=repr)
def test_a_lane_has_the_remarks_of_the_run_alone(model, dtype):
    own = [(command, load) for other, command, load, _ in CASES.values() if other is model]
    commands, loads = [list(items) for items in zip(*own, strict=True)]
    batch = st.simulate_many(model, commands, load=loads, duration=DURATION, output_times=[0.3], dtype=dtype, chunk=3)
    alone = [st.simulate(model, command, load=load, duration=DURATION) for command, load in own]
    assert batch.remarks == tuple((lane, *remark) for lane, result in enumerate(alone) for remark in result.remarks)
    assert batch[len(own) - 1].remarks == alone[-1].remarks
    assert len(batch.remarks) > 2


@pytest.mark.long(but="weak battery")
@pytest.mark.parametrize("case", ["weak supply", "weak battery", "warm", "cold"])
def test_a_lane_of_a_rare_servo_has_the_remarks_of_the_run_alone(case):
    model, command, load, expected = CASES[case]
    batch = st.simulate_many(model, command, load=load, duration=DURATION, output_times=[DURATION])
    assert {remark.kind: remark.time for remark in batch.remarks} == pytest.approx(expected)


def test_a_run_that_failed_has_no_remarks():
    load = st.loads.Spring(1e12)  # swings too fast to be followed
    result = st.simulate(MEAN, HOLD, load=load, duration=DURATION)
    batch = st.simulate_many(MEAN, [HOLD, HOLD], load=[load, st.loads.Constant(FALLS)], duration=DURATION)
    assert not result.status.ok
    assert result.remarks == ()
    assert {remark.lane for remark in batch.remarks} == {1}


def test_a_servo_on_a_bus_is_judged_by_the_voltage_that_the_others_leave():
    battery = st.Supply(open_circuit_voltage=6.0, internal_resistance=1.5)
    weak = st.PulseServo(SERVO.replace({"supply.internal_resistance": 1.5}))
    load = st.loads.Constant(0.85 * (full_drive(weak.servo)[0] - FRICTION))
    alone = st.simulate_bus({"a": (PULSES, STEP, load)}, supply=battery, duration=DURATION)
    stalled = {name: (PULSES, STEP, st.loads.Constant(FALLS)) for name in ("b", "c")}
    together = st.simulate_bus({"a": (PULSES, STEP, load), **stalled}, supply=battery, duration=DURATION)
    assert {kind for _, kind, _ in alone.remarks} <= OF_SUPPLY  # the battery's 1.5 ohm
    assert ("a", CANNOT_HOLD, DURATION) in together.remarks
    assert together["a"].remarks[0] == Remark(CANNOT_HOLD, DURATION)
    assert {remark.kind for remark in together["a"].remarks} - OF_SUPPLY == {CANNOT_HOLD}


def test_a_study_says_it_of_its_lanes_whatever_the_chunks(tmp_path):
    def study(chunk, **more):
        return st.sweep(PULSES, STEP, duration=0.8, lanes=64, seed=2, chunk=chunk,
                        vary={"load.torque": f"uniform:0..{2.0 * TORQUE}"}, **more)

    whole, parts = study(64), study(16, directory=tmp_path / "study")
    torque = whole.table["load.torque"]
    said = np.isfinite(whole.table["cannot_hold"])
    assert said[torque > TORQUE].all()
    assert not said[torque < TORQUE - FRICTION].any()
    assert whole.remarks == parts.remarks
    (tmp_path / "study" / "lanes-00002.csv").unlink()
    again = study(16, directory=tmp_path / "study", resume=True)
    assert again.remarks == whole.remarks
    found = whole.summary()["remarks"][CANNOT_HOLD]
    assert found["lanes"] == said.sum() == len(found["first"])
    assert math.isnan(whole.table["pulses_refused"][0])
