"""Friction that fades as the shaft speeds up, met by steps in time: heat, springs, play and regulators bring these."""

import numpy as np
import pytest

import servotwin as st

pytestmark = pytest.mark.long

FADES = {"gear.output_inertia": 1e-3, "friction.breakaway_ratio": 1.3, "supply.internal_resistance": 0.2,
         "friction.stribeck_speed": 10.0, "friction.stribeck_exponent": 1.5}
SHARES = {"friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1,
          "friction.load_friction_motor_stribeck": 0.04, "friction.load_friction_external_stribeck": 0.05,
          "friction.load_friction_motor_quad": 0.1, "friction.load_friction_external_quad": 0.2}
HEAT = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -1.5e-3}
LIMIT, PLAY = {"supply.current_limit": 1.2}, {"gear.backlash": 0.01}
SPRING = st.loads.Spring(0.4, rest_angle=1.0)
CASES = {"heat, regulator, spring": (SHARES | HEAT | LIMIT, SPRING), "heat, play": (HEAT | PLAY, None)}
LANES = 60


def drawn(seed):
    """Draw loaded servos of one make and commands with jumps."""
    rng = np.random.default_rng(seed)
    commands = []
    for _ in range(LANES):
        at = np.concatenate(([0.0], np.sort(rng.uniform(0.0, 1.0, 4))))
        commands.append(st.signals.samples(at, rng.uniform(0.8e-3, 2.3e-3, 5), unit="s"))
    return commands, {"load.inertia": rng.uniform(0.0, 5e-3, LANES), "load.torque": rng.uniform(-0.2, 0.2, LANES)}


@pytest.mark.parametrize("case", CASES)
def test_a_step_in_time_sees_friction_fade(servo, case):
    """A step that jumped over the speeds at which it fades was wrong by up to 3e-4 rad; play and heat never ended."""
    changes, spring = CASES[case]
    commands, parameters = drawn(5)
    still = st.loads.Recorded([0.0, 9.0], [0.0, 0.0])  # a torque that is told by time is for steps in time
    load = st.loads.Inertia(0.0) + st.loads.Constant(0.0) + still
    model = st.PulseServo(servo.replace(FADES | changes))
    angles = [st.simulate_many(
        model, commands, duration=1.0, load=load if spring is None else load + spring, parameters=parameters,
        output_times=np.linspace(0.05, 1.0, 20), accuracy=accuracy)["output_angle"] for accuracy in (1e-9, 1e-12)]
    errors = np.abs(angles[0] - angles[1]).max(axis=1)
    assert np.max(errors) < 1e-8  # what play's impacts make of it
    assert np.sum(errors > 1e-9) <= 0.02 * LANES
    if spring is not None:  # a torque through the gear that changed its sign within a step made it 1.1e-9 rad
        assert np.max(errors) < 1e-10


@pytest.mark.slow
def test_servos_on_a_bus_see_friction_fade(servo):
    """On a source without resistance servos know nothing of each other, though they are stepped together."""
    models = [st.PulseServo(servo.replace(FADES | SHARES | HEAT | {"supply.internal_resistance": 0.0}))] * 2
    commands, parameters = drawn(7)
    supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.0)
    for pair in range(4):
        loads = [SPRING + st.loads.Constant(parameters["load.torque"][2 * pair + k]) for k in range(2)]
        told = commands[2 * pair:2 * pair + 2]
        fleet = st.simulate_bus({str(k): (models[k], told[k], loads[k]) for k in range(2)}, supply=supply,
                                duration=1.0, output_step=0.05)
        for k in range(2):
            alone = st.simulate(models[k], told[k], load=loads[k], duration=1.0, output_step=0.05, accuracy=1e-12)
            np.testing.assert_allclose(fleet[str(k)]["output_angle"], alone["output_angle"], rtol=0, atol=1e-9)
