"""Warnings of what is possible but odd: one line each, once, from wherever it is run."""

import warnings

import numpy as np
import pytest

import servotwin as st

SERVO = st.load_servo("hitec-hs-755hb")
IMPOSSIBLE = st.load_servo("feetech-ft-7235")
STEP = st.signals.step(0.0, 30.0, at=0.01, unit="deg")
LATE = st.signals.step(0.0, 30.0, at=2.0, unit="deg")
STRONG = SERVO.replace({"supply.open_circuit_voltage": 12.1})
CASES = {
    "impossible sheet": (
        IMPOSSIBLE, STEP, r"its data sheet contradicts itself \(impossible: efficiency 1.45 at 8.4 V\)"),
    "too much supply": (STRONG, STEP, "a supply of 12.1 V is more than twice the 6 V of its data sheet"),
    "late": (SERVO, LATE, "the first change of the command comes at 2 s, when the run of 0.05 s is over"),
    "late pulses": (SERVO, st.signals.pulse_train([1.0, 1.02], [1500.0, 1500.0]), "the first pulse of the command"),
}
RUNS = {
    "simulate": lambda servo, command: st.simulate(st.PulseServo(servo), command, duration=0.05),
    "simulate_many": lambda servo, command: st.simulate_many(
        st.PulseServo(servo), command, duration=0.05, parameters={"load.torque": [0.0, 0.1]}, chunk=1)[1].energy,
    "sweep": lambda servo, command: st.sweep(
        st.PulseServo(servo), command, duration=0.05, lanes=8, chunk=2, vary={"load.torque": "uniform:0..0.1"}),
    "simulate_bus": lambda servo, command: st.simulate_bus(
        {"one": (st.PulseServo(servo), command)}, duration=0.05,
        supply=st.Supply(open_circuit_voltage=servo.supply.open_circuit_voltage)),
}


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("case", CASES)
def test_each_is_warned_of_once(case, run):
    servo, command, text = CASES[case]
    with pytest.warns(UserWarning, match=text) as caught:
        RUNS[run](servo, command)
    assert len(caught) == 1
    assert caught[0].filename == __file__


@pytest.mark.parametrize("servo", [SERVO, SERVO.replace({"supply.open_circuit_voltage": 12.0}),
                                   st.servo_from_values("bare", {})], ids=["usual", "twice", "no sheet"])
def test_what_is_not_odd_is_not_warned_of(servo, recwarn):
    warnings.simplefilter("always")
    model = st.BoundedServo(SERVO if servo.name == "bare" else servo)
    for command in (STEP, st.signals.constant(30.0, unit="deg"), st.signals.ramp(0.0, 30.0, over=1.0, unit="deg"),
                    st.signals.sine(mean=30.0, amplitude=5.0, frequency=1.0, unit="deg")):
        st.simulate(model, command, duration=0.05)
    assert not recwarn.list


def test_of_many_lanes_the_first_is_named(recwarn):
    commands = [STEP, LATE, st.signals.step(0.0, 1.0, at=3.0, unit="deg")]
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        st.simulate_many(st.PulseServo(SERVO), commands, duration=0.05,
                         parameters={"supply.open_circuit_voltage": [6.0, 20.0, 15.0]})
    said = [str(one.message) for one in recwarn.list]
    assert len(said) == 2
    assert "a supply of 20 V" in said[0]
    assert said[1].startswith("the first change of command 1 (and those of 1 more) comes at 2 s")


TIME = np.arange(0.0, 2.0, 0.02)
SINE = 1500.0 + 400.0 * np.sin(5.0 * TIME)
TIME_BASES = {
    "as it is": (TIME, SINE, None),
    "milliseconds read as seconds": (1e3 * TIME, SINE, "its samples come 20 s apart"),
    "seconds read as milliseconds": (1e-3 * TIME, SINE, "within 1.98 ms, faster than any servo"),
    "the travel within 0.2 ms": ([0.0, 1e-4, 2e-4], [600.0, 1500.0, 2400.0], "within 0.2 ms"),
    "a step made of samples": ([0.0, 1e-4, 2e-4], [600.0, 2400.0, 2400.0], None),
    "two samples": ([0.0, 60.0], [1500.0, 1600.0], None),
    "a sample a second": (np.arange(30.0), np.tile([1500.0, 1600.0], 15), None),
}


@pytest.mark.parametrize("case", TIME_BASES)
def test_a_time_base_a_thousand_times_off_is_warned_of(case, tmp_path, recwarn):
    time, width, text = TIME_BASES[case]
    warnings.simplefilter("always")
    st.signals.samples(time, width, unit="us")
    st.signals.samples(time, 0.1 * np.asarray(width) - 150.0, unit="deg", hold="linear")
    assert len(recwarn.list) == (0 if text is None else 2)
    assert all(text in str(one.message) for one in recwarn.list)
    if len(time) > 2:
        file = tmp_path / "log.csv"
        rows = (f"{t:.9g},{w:.9g},{k % 7}" for k, (t, w) in enumerate(zip(time, width, strict=True)))
        file.write_text("\n".join(["time_s,pulse_width_us,output_angle_deg", *rows]) + "\n")
        recwarn.clear()
        st.read_logs(file)[0].signal()
        assert [str(one.message).partition(":")[0] for one in recwarn.list] == ([] if text is None else ["log 'log'"])
