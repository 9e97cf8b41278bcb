"""Lanes whose friction fades with speed: each as `simulate` has it, however many there are and however time is cut."""

import numpy as np
import pytest

import servotwin as st

pytestmark = pytest.mark.long

LANES, DURATION = 24, 0.4
TIMES = np.linspace(0.02, DURATION, 20)
FADES = {"gear.output_inertia": 1e-3, "friction.breakaway_ratio": 1.3, "supply.internal_resistance": 0.2,
         "friction.stribeck_speed": 10.0}
SHARES = {"friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1,
          "friction.load_friction_motor_stribeck": 0.04, "friction.load_friction_external_stribeck": 0.05,
          "friction.load_friction_motor_quad": 0.1, "friction.load_friction_external_quad": 0.2}
LAWS = {"Stribeck": {}, "M6": SHARES, "M6, regulator": SHARES | {"supply.current_limit": 0.8}}
LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)


def drawn(seed=2):
    """Draw Stribeck speeds of a hundredth to ten times the motor's, exponents, loads and commands."""
    rng = np.random.default_rng(seed)
    commands = [st.signals.samples([0.0, 0.1, 0.25], rng.uniform(0.8e-3, 2.3e-3, 3), unit="s") for _ in range(LANES)]
    return commands, {
        "friction.stribeck_speed": 10.0 ** rng.uniform(0.0, 4.0, LANES),
        "friction.stribeck_exponent": np.resize([1.0, 1.5, 2.0, 0.8, 3.1], LANES),
        "load.inertia": rng.uniform(0.0, 5e-3, LANES), "load.torque": rng.uniform(-0.3, 0.3, LANES)}


def many(model, commands, parameters, **more):
    return st.simulate_many(model, commands, duration=DURATION, load=LOAD, parameters=parameters, output_times=TIMES,
                            **more).raise_if_failed()["output_angle"]


@pytest.mark.parametrize("law", LAWS)
def test_a_lane_is_a_servo_alone(servo, law):
    model, (commands, parameters) = st.PulseServo(servo.replace(FADES | LAWS[law])), drawn()
    angles = many(model, commands, parameters)
    for k in range(LANES):
        own = {name: float(x[k]) for name, x in parameters.items() if not name.startswith("load.")}
        load = st.loads.Inertia(parameters["load.inertia"][k]) + st.loads.Constant(parameters["load.torque"][k])
        alone = st.simulate(st.PulseServo(servo.replace(FADES | LAWS[law] | own)), commands[k], duration=DURATION,
                            load=load, output_times=TIMES)
        np.testing.assert_allclose(angles[k], alone["output_angle"], rtol=0.0, atol=1e-12)


def test_a_lane_knows_nothing_of_its_neighbours(servo):
    model, (commands, parameters) = st.PulseServo(servo.replace(FADES | SHARES)), drawn()
    whole = many(model, commands, parameters)
    np.testing.assert_array_equal(many(model, commands, parameters, chunk=5), whole)
    for k in (0, 7):
        np.testing.assert_array_equal(many(model, commands[k:k + 1], {n: x[k:k + 1] for n, x in parameters.items()}),
                                      whole[k:k + 1])


def test_calls_in_pieces_are_one_call(servo):
    """Cut at any time, creeps begin anew: they end where they did, to rounding."""
    model, (_, parameters) = st.PulseServo(servo.replace(FADES | SHARES)), drawn()
    angles = []
    for cuts in ([DURATION], np.append(np.sort(np.random.default_rng(4).uniform(0.0, DURATION, 37)), DURATION)):
        sims = st.VectorSimulator(model, LANES, load=LOAD, parameters=parameters)
        sims.reset(pulse_width=1.5e-3)
        t = 0.0
        for until in cuts:
            sims.advance(until - t, pulse_width=2.1e-3)
            t = until
        angles.append(sims["output_angle"].copy())
    np.testing.assert_allclose(*angles, rtol=0.0, atol=1e-12)


def test_energy_balances(servo):
    for speed, exponent in ((3.0, 0.8), (30.0, 2.0), (300.0, 1.0)):
        fades = FADES | {"friction.stribeck_speed": speed, "friction.stribeck_exponent": exponent}
        energy = st.simulate(st.PulseServo(servo.replace(fades)), st.signals.step(0.0, 60.0, at=0.05, unit="deg"),
                             load=st.loads.Constant(0.1), duration=0.4, output_times=[0.4]).energy
        turnover = abs(energy.supply) + energy.winding + energy.friction + abs(energy.load) + abs(energy.stored)
        assert abs(energy.residual) < 1e-10 * turnover
