"""Regression: a run that stopped right at the end of a drive, within rounding, kept the angle of one step before."""

import math

import pytest

import servotwin as st

PENDULUM = st.loads.Pendulum(mass=0.05, length=0.1) + st.loads.Constant(0.2)


@pytest.mark.long(but="PulseServo")
@pytest.mark.parametrize("model", [st.PulseServo, st.PulseServoInductive])
def test_a_run_may_stop_wherever_its_bridge_switches(model):
    command = st.signals.step(60.0, 90.0, at=0.1, unit="deg")
    servo = st.load_servo("hitec-hs-755hb")
    whole = st.simulate(model(servo), command, duration=1.0, load=PENDULUM)
    switches = [event.time for event in whole.events if event.kind.startswith("drive")]
    ulp = [time + k * math.ulp(time) for time in switches for k in (-1, 0, 1)]
    sim = st.Simulator(model(servo), load=PENDULUM)
    state = sim.initial(command)
    for time in sorted(ulp):
        state = sim.advance(state, time, command)
        assert abs(state["output_angle"] - whole.at("output_angle", [time])[0]) < 1e-9
    assert len(switches) > 40
