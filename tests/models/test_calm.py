"""Ticks without an event, gone through at once: where the general way goes, and only where nothing happens."""

import numpy as np
import pytest

import servotwin as st
from servotwin.models.engine.batch import event_free

WORN = {"electronics.voltage_deadband": 0.1, "stops.lower_angle": 0.2, "stops.upper_angle": 1.6,
        "stops.restitution": 0.4}


@pytest.mark.parametrize("changes", [{}, WORN], ids=["plain", "deadband and stops"])
@pytest.mark.parametrize("load", [st.loads.Inertia(1e-3), st.loads.Inertia(2e-4) + st.loads.Viscous(0.02),
                                  st.loads.Coulomb(0.1)], ids=["inertia", "viscous", "dry"])
def test_it_is_the_general_way_where_nothing_happens(changes, load):
    """Random states and commands, ticks of a millisecond: those that are called calm have no event, and end alike."""
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(changes))
    load = load + st.loads.Viscous(0.0)  # a sum of parts
    numbers, rng, found = model.plant(load), np.random.default_rng(1), 0
    for _ in range(400):
        q, w, goal = rng.uniform(0.25, 1.55), rng.choice([0.0, 1.0]) * rng.normal(0.0, 2.0), rng.uniform(0.25, 1.55)
        goal = q + rng.choice([0.0, 0.02, 1.0]) * (goal - q)
        command, torque, time = st.signals.constant(goal, unit="rad"), rng.uniform(-0.4, 0.4), 1e-3
        u = model.command(command).rows[0][1]
        angle, speed, lasts = event_free.after(numbers, u, torque, q, w, time)
        if not lasts:
            continue
        found += 1
        sim = st.Simulator(model, load=load + st.loads.Constant(torque))
        state = sim.advance(sim.initial(command, initial={"output_angle": q, "output_speed": w}), time, command)
        assert (angle, speed) == pytest.approx((state["output_angle"], state["output_speed"]), rel=1e-13, abs=1e-14)
        whole = st.simulate(model, command, duration=time, load=load + st.loads.Constant(torque),
                            initial={"output_angle": q, "output_speed": w}) if found % 40 == 0 else None
        assert whole is None or not whole.events
    assert found > 200


@pytest.mark.parametrize("dt", [1e-3, 5e-3, 0.05])
def test_lanes_that_are_pushed_about_go_as_simulators_do(dt):
    """What is calm and what is not, tick after tick, in the lanes of a `VectorSimulator`."""
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(WORN))
    sims, load = st.VectorSimulator(model, 3, load=st.loads.Inertia(1e-3)), st.loads.Inertia(1e-3)
    goals, rng = [0.3, 0.9, 1.5], np.random.default_rng(5)
    sims.reset(command_angle=goals)
    single = st.Simulator(model, load=load)
    states = [single.initial(st.signals.constant(goal, unit="rad")) for goal in goals]
    for k in range(60):
        if k % 12 == 0:
            goals = rng.uniform(0.25, 1.55, 3)
        push = float(rng.uniform(-0.3, 0.3))
        sims.advance(dt, command_angle=goals, external_torque=push)
        states = [single.advance(state, (k + 1) * dt, st.signals.constant(goal, unit="rad"), external_torque=push)
                  for state, goal in zip(states, goals, strict=True)]
        np.testing.assert_allclose(sims["output_angle"], [state["output_angle"] for state in states], atol=1e-11)
        np.testing.assert_allclose(sims["output_speed"], [state["output_speed"] for state in states], atol=1e-9)
