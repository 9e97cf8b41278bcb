"""`Simulator.observe` takes plain numbers where it can: the same to the last bit as a result's arrays."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.models.engine.run.run import mode_of
from servotwin.models.outputs import PLAIN
from servotwin.simulation.simulator import _sample

ANALOG = "hitec-hs-755hb"
HEAT = {"thermal.winding_capacity": 5.0, "thermal.housing_capacity": 60.0, "thermal.winding_resistance": 4.0,
        "thermal.housing_resistance": 6.0}
CASES = {
    "plain": (st.PulseServo, {}),
    "coast": (st.PulseServo, {"electronics.off_state": "coast", "motor.brush_drop_voltage": 0.2}),
    "silence": (st.PulseServo, {"electronics.silence_state": "coast", "electronics.pulse_timeout": 0.03}),
    "regulator": (st.PulseServo, {"supply.internal_resistance": 0.3, "supply.current_limit": 1.0}),
    "inductive": (st.PulseServoInductive, {"motor.armature_inductance": 5e-4, "supply.internal_resistance": 0.1}),
    "play": (st.PulseServo, {"gear.backlash": 0.01, "potentiometer.backlash": 0.004}),
    "table": (st.PulseServo, {"potentiometer.linearity_angle": (0.0, 3.0), "potentiometer.linearity_error": (0.0, 0.02),
                              "potentiometer.quantisation": 2.4e-3}),
    "digital": (st.DigitalServo, {"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0,
                                  "supply.internal_resistance": 0.2}),
    "bounded": (st.BoundedServo, {}),
}


@pytest.mark.parametrize("case", CASES)
def test_numbers_give_the_same_bits_as_arrays(case):
    fidelity, changes = CASES[case]
    model = fidelity(st.load_servo(ANALOG).replace(changes))
    sim = st.Simulator(model, load=st.loads.Constant(0.1) + st.loads.Inertia(1e-4))
    command = st.signals.samples([0.0, 0.1, 0.3, 0.5], [900.0, 2100.0, 1200.0, 1800.0], unit="us", hold="previous")
    state, random, compared = sim.initial(command), np.random.default_rng(3), 0
    for time in np.sort(random.uniform(0.0, 0.7, 60)):
        state = sim.advance(state, float(time), command)
        plan = sim.plan(command)
        arrays = _sample(plan, state, mode_of(plan.numbers, plan.chip, plan.inputs, state.memory))
        for name in set(PLAIN) & set(model.available):
            expected = float(model.output(name, arrays, plan.command, sim.load)[0])
            found = sim.observe(state, name, command)
            assert found == expected or math.isnan(found) == math.isnan(expected) is True, (name, time)
            compared += 1
    assert compared >= 60 * 3


def test_a_signal_after_the_end_of_a_run_is_that_of_the_result():
    model = st.PulseServo(st.load_servo(ANALOG))
    command = st.signals.step(0.0, 60.0, at=0.02, unit="deg")
    sim = st.Simulator(model)
    state = sim.advance(sim.initial(command), 0.0711, command)
    result = st.simulate(model, command, duration=0.0711, output_times=[0.0711])
    for name in PLAIN:
        assert sim.observe(state, name, command) == pytest.approx(result[name][0], rel=1e-9, abs=1e-12), name
