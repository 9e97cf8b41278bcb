"""Digital servos in batches and in `VectorSimulator` are the servos of `simulate` and `Simulator`."""

import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError

from .digital_servos import COUNT, digital, feetech

pytestmark = pytest.mark.long

TIMES = np.sort(np.random.default_rng(0).uniform(0.0, 0.4, 80))
NAMES = ("output_angle", "output_speed", "duty", "goal_angle", "reference_angle", "trip", "drive", "armature_current",
         "armature_voltage", "bus_voltage", "supply_current", "motor_torque", "load_torque")
HUNGRY = {"internal_resistance": 0.3, "bridge_drop_voltage": 0.2, "bridge_drop_resistance": 0.1}
FREE = {"coulomb_torque_forward": 2e-4, "coulomb_torque_backward": 3e-4, "breakaway_ratio": 1.4}
STEP = st.signals.step(0.6, -0.3, at=0.1, unit="rad")
WAVE = st.signals.sine(mean=0.2, amplitude=0.7, frequency=3.0, unit="rad")
LOAD = st.loads.Inertia(2e-3) + st.loads.Constant(0.3)
SERVOS = {
    "plain": (digital({"proportional_gain": 6.0}), STEP, None),
    "P, I and D": (digital({"proportional_gain": 6.0, "integral_gain": 9.0, "derivative_gain": 0.05,
                            "integral_limit": 0.3, "anti_windup": 0.1, "compute_delay": 1.4e-3}), STEP, LOAD),
    "a held D": (digital({"proportional_gain": 6.0, "derivative_gain": 0.08, "derivative_ticks": 5.0,
                          "derivative_threshold": 2.0 * COUNT, "derivative_of": "measurement", "filter_weight": 0.8,
                          "deadband_angle": 3.0 * COUNT, "minimum_duty": 0.02, "compute_delay": 1e-3,
                          "duty_slew": 60.0, "angle_quantum": COUNT, "signal_timeout": 5.0}, friction=FREE), WAVE,
                 LOAD),
    "ticks that begin later": (digital({"proportional_gain": 6.0, "control_phase": 3e-4}), STEP, LOAD),
    "watched": (digital({"proportional_gain": 9.0, "derivative_gain": 0.03, "deadband_angle": 4.0 * COUNT,
                         "deadband_law": "gate", "angle_quantum": COUNT, "duty_quantum": 1e-3, "current_limit": 2.2,
                         "trip_current": 3.0, "trip_time": 0.05, "undervoltage": 8.0, "overload_duty": 0.7,
                         "overload_time": 0.05, "overload_output": 0.3}, friction=FREE,
                        supply={"internal_resistance": 0.4}), STEP, LOAD),
    "to the integer": (feetech(32, 1, 16, friction=FREE, speed_limit=3000 * COUNT, acceleration_limit=9000 * COUNT,
                               minimum_speed=50 * COUNT), WAVE, LOAD),
    "drops and sag": (digital({"proportional_gain": 9.0, "bus_latency": 3.2e-3, "current_limit": 1.5},
                              supply=HUNGRY, motor={"brush_drop_voltage": 0.2}), WAVE, LOAD),
    "a diode": (digital({"proportional_gain": 5.0, "off_state": "diode", "duty_slew": 40.0}, supply=HUNGRY), WAVE,
                LOAD),
    "slow chopping": (digital({"proportional_gain": 5.0, "off_state": "coast"}, supply=HUNGRY), WAVE, LOAD),
    "a stop": (digital({"proportional_gain": 8.0}, stops={"lower_angle": -1.0, "upper_angle": 0.4, "restitution": 0.3}),
               st.signals.constant(0.4, unit="rad"), st.loads.Constant(-0.6) + st.loads.Inertia(2e-3)),
    "a trip": (digital({"proportional_gain": 20.0, "trip_current": 2.0, "trip_time": 0.02, "undervoltage": 11.0,
                        "undervoltage_action": "reset", "restart_time": 0.03}, supply={"internal_resistance": 0.8}),
               WAVE, LOAD),
}


@pytest.mark.parametrize("name", SERVOS)
def test_a_lane_is_the_servo_alone(name):
    model, command, load = SERVOS[name]
    asked = {"duration": 0.4, "load": load, "output_times": TIMES, "initial": {"output_angle": 0.1}}
    one = st.simulate(model, command, **asked)
    lanes = st.simulate_many(model, command, outputs=NAMES, **asked, parameters={
        "motor.armature_resistance": [3.0, 3.1, 3.0]})
    for signal in NAMES:
        np.testing.assert_allclose(lanes[signal][0], one[signal], rtol=0.0, atol=2e-11, err_msg=signal)
        np.testing.assert_array_equal(lanes[signal][2], lanes[signal][0])
    assert np.abs(lanes["output_angle"][1] - one["output_angle"]).max() > 1e-6


def test_a_call_that_begins_before_the_first_tick_lasts_as_long_as_it_says():
    model = digital({"proportional_gain": 6.0, "control_phase": 3e-4})
    sims, one = st.VectorSimulator(model, lanes=2), st.Simulator(model)
    sims.reset(command_angle=0.5)
    state = one.initial(st.signals.constant(0.5, unit="rad"))
    sims.advance(6.9e-3, command_angle=0.9)
    command = st.signals.constant(0.9, unit="rad")
    state = one.advance(state, 6.9e-3, command)
    assert one.observe(state, "output_speed", command) > 0.1
    for signal in ("output_angle", "output_speed"):
        np.testing.assert_allclose(sims[signal], one.observe(state, signal, command), rtol=0.0, atol=1e-11)


def test_lanes_cut_at_random_ticks_are_simulators():
    model = digital({
        "proportional_gain": 6.0, "derivative_gain": 0.02, "compute_delay": 2.3e-3, "bus_latency": 4.2e-3,
        "angle_quantum": COUNT, "trip_current": 2.5, "trip_time": 0.1, "speed_limit": 5.0})
    sims, ones = st.VectorSimulator(model, lanes=3, seed=3), [st.Simulator(model, seed=3 + k) for k in range(3)]
    sims.reset(command_angle=0.5)
    commands = [st.signals.constant(0.5, unit="rad")] * 3
    states, rng = [one.initial(command) for one, command in zip(ones, commands, strict=True)], np.random.default_rng(1)
    for k in range(150):
        duration, torque = float(rng.uniform(0.0, 4e-3)), float(rng.uniform(-0.3, 0.3))
        goals = rng.uniform(0.0, 2.0, 3)
        if k % 31 == 7:
            sims.set(torque_enable=k % 62 != 7)
            states = [one.changed(s, torque_enable=k % 62 != 7) for one, s in zip(ones, states, strict=True)]
        if k == 60:
            sims.set(parameters={"firmware.proportional_gain": 9.0})
            states = [one.changed(s, parameters={"firmware.proportional_gain": 9.0})
                      for one, s in zip(ones, states, strict=True)]
        if k == 100:
            memory = pickle.loads(pickle.dumps(sims.save()))
            sims.advance(0.05, command_angle=0.1)
            sims.restore(memory)
        sims.advance(duration, command_angle=goals, external_torque=torque)
        commands = [st.signals.constant(goal, unit="rad") for goal in goals]
        states = [one.advance(s, s.time + duration, command, external_torque=torque)
                  for one, s, command in zip(ones, states, commands, strict=True)]
        for signal in ("output_angle", "duty", "goal_angle", "reference_angle", "trip", "armature_current"):
            alone = [one.observe(s, signal, command, external_torque=torque)
                     for one, s, command in zip(ones, states, commands, strict=True)]
            np.testing.assert_allclose(sims[signal], alone, rtol=0.0, atol=1e-9, err_msg=f"{signal} at {k}")


def test_torque_is_switched_lane_by_lane_and_a_reset_switches_it_on():
    sims = st.VectorSimulator(digital({"proportional_gain": 6.0}), lanes=3, load=st.loads.Constant(0.5))
    sims.reset(command_angle=0.2)
    sims.set(torque_enable=[True, False, True])
    sims.advance(0.2)
    assert sims["output_angle"][1] < sims["output_angle"][0] - 0.1
    assert sims["output_angle"][0] == sims["output_angle"][2]
    sims.reset(output_angle=0.2, lanes=[1])
    sims.advance(0.2)
    assert abs(sims["output_angle"][1] - 0.2) < 0.1
    with pytest.raises(InputError, match="torque_enable: got 1, allowed: True or False"):
        sims.set(torque_enable=1)


def test_a_bus_voltage_that_is_imposed_is_that_of_a_stiff_supply():
    firmware = {"proportional_gain": 6.0, "current_limit": 1.5}
    sims = st.VectorSimulator(digital(firmware, supply=HUNGRY), lanes=2, load=LOAD)
    stiff = digital(firmware, supply={**HUNGRY, "internal_resistance": 0.0, "open_circuit_voltage": 9.5})
    alone = st.VectorSimulator(stiff, lanes=1, load=LOAD)
    for some in (sims, alone):
        some.reset(command_angle=0.0)
    sims.set(bus_voltage=9.5, lanes=[1])
    for _ in range(40):
        for some in (sims, alone):
            some.advance(2e-3, command_angle=0.8)
    assert sims["output_angle"][1] == pytest.approx(alone["output_angle"][0], abs=1e-12)
    assert sims["bus_voltage"][1] == pytest.approx(9.5)
    assert abs(sims["output_angle"][0] - sims["output_angle"][1]) > 1e-3


def test_goals_outside_are_refused_lane_by_lane():
    sims = st.VectorSimulator(digital({"proportional_gain": 6.0, "lower_goal": -1.0, "upper_goal": 1.0}), lanes=2)
    with pytest.raises(st.errors.CommandError, match=r"lane 1.*the goals of test"):
        sims.advance(1e-3, command_angle=[0.5, 1.5])
