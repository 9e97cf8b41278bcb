"""Contacts near balance: teeth, stops and friction of bus servos come to rest, and events do not follow without end.

`python -m simulation.test_contact_chatter 0 500`, in tests/, searches these seeds and prints the runs that crowd.
"""

import signal
import sys
from collections import Counter
from typing import Any

import numpy as np
import pytest

import servotwin as st
from leg_cases import SERVOS, written
from models.digital_servos import digital

DURATION, EVERY = 0.4, 0.02  # s
CROWD, AT_ONCE, SHORT = 16, 3, 1e-4  # events within a short time [s], as of a shaft that bounces; at one instant
WORK = 20.0  # s of this process: a run takes 0.1


def case(seed: int) -> tuple[str, dict[str, Any], st.loads.Load, st.signals.Signal]:
    """Return a servo with a load that its friction just holds, or nothing at all, and goals at random."""
    rng = np.random.default_rng((seed, 11))
    name = list(SERVOS)[seed % 4]
    dry = SERVOS[name].gear.gear_reduction * SERVOS[name].friction.coulomb_torque_forward
    held = rng.choice([0.0, 0.06 * dry, dry, 0.94 * dry, 0.3, 0.03 * dry, 0.33 * dry])
    torque = float(held * (1.0 + rng.choice([0, 1, -1]) * 10.0 ** rng.uniform(-9, -1)) * rng.choice([-1, 1]))
    inertia, size = float(10.0 ** rng.uniform(-6, -2)), 10.0 ** rng.uniform(-3, 0)
    load = st.loads.Inertia(inertia) + st.loads.Constant(torque)
    load += st.loads.Coulomb(float(rng.choice([0, 0.06 * dry, 0.05])))
    load += st.loads.Viscous(float(rng.choice([0, 0, 0.01])))
    changes = {}
    if rng.random() < 0.3:
        changes["gear.backlash"] = float(10.0 ** rng.uniform(-5, -1.2))
    if rng.random() < 0.3:
        changes["friction.bearing_coulomb_torque"] = 0.0
    if rng.random() < 0.3:
        changes |= {"stops.lower_angle": -0.2 * size, "stops.upper_angle": 0.2 * size,
                    "stops.restitution": float(rng.choice([0, 0.4, 0.9]))}
    if rng.random() < 0.2:
        changes["friction.breakaway_ratio"] = float(rng.uniform(1, 1.6))
    if rng.random() < 0.2:
        changes["supply.internal_resistance"] = 0.3
    if rng.random() < 0.2:
        changes["motor.brush_drop_voltage"] = 0.2
    if rng.random() < 0.2:
        changes["firmware.off_state"] = str(rng.choice(["diode", "coast"]))
    at = np.arange(0.0, DURATION, EVERY)
    goals = size * rng.uniform(-1.0, 1.0, len(at))
    return name, changes, load, written(at, np.clip(goals, -0.2 * size, 0.2 * size) if (
        "stops.lower_angle" in changes) else goals)


class EndlessError(Exception):
    """A run that takes far longer than any should."""


def run(model: st.DigitalServo, command: st.signals.Signal, load: st.loads.Load, duration: float,
        work: float = WORK) -> st.Result:
    """Return a run; one without end raises."""
    def stop(*_: object) -> None:
        raise EndlessError

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, work)
    try:
        return st.simulate(model, command, duration=duration, load=load, initial={"output_angle": 0.0},
                           output_times=[duration])
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def most(result: st.Result, within: float) -> int:
    """Return how many events follow each other within a time, at most."""
    times = np.array([event.time for event in result.events])
    return int(max((np.searchsorted(times, times + within, "right") - np.arange(len(times))), default=0))


def crowded(seed: int) -> str:
    """Return what is wrong with a run; nothing where its contacts come to rest, but for rebounds from stops."""
    name, changes, load, command = case(seed)
    model = st.DigitalServo(SERVOS[name].replace(changes))
    try:
        result = run(model, command, load, DURATION)
    except EndlessError:
        return "without end"
    if not result.status.ok:
        return f"{result.status} at {result.ended} s"
    count = Counter(event.kind for event in result.events)
    if changes.get("stops.restitution"):
        return "" if len(result.events) < 2000 else f"{len(result.events)} events: {dict(count)}"
    if most(result, 1e-12) > AT_ONCE or most(result, SHORT) > CROWD:
        return f"{most(result, 1e-12)} at once, {most(result, SHORT)} in {SHORT} s: {dict(count)}"
    return ""


@pytest.mark.long(but="10")
@pytest.mark.parametrize("seed", range(40))
def test_contacts_come_to_rest(seed):
    assert not crowded(seed)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(1, 15))
def test_many_contacts_come_to_rest(block):
    assert not {seed: wrong for seed in range(40 * block, 40 * block + 40) if (wrong := crowded(seed))}


# --- on a stop --------------------------------------------------------------------------------------------------------


def test_a_motor_that_cannot_lift_its_output_off_a_stop_comes_to_rest_against_it():
    """It throws the output up, less each time, and by less than an angle can tell; then both have to rest."""
    stops = {"lower_angle": -0.001, "upper_angle": 1.0}
    model = digital({"proportional_gain": 6.0}, gear={"backlash": 0.02, "output_inertia": 1e-6}, stops=stops)
    load = st.loads.Inertia(1e-4) + st.loads.Constant(3.0)
    result = run(model, st.signals.constant(0.01, unit="rad"), load, 0.05, work=0.5)
    assert result["output_speed"][-1] == 0.0
    assert len(result.events) < 300


@pytest.mark.parametrize(("name", "torque", "goal"), [("12 V", 2.0, 0.02), ("7.4 V", 2.5, 0.1)])
def test_a_catalog_servo_comes_to_rest_against_what_it_cannot_lift(name, torque, goal):
    model = st.DigitalServo(SERVOS[name].replace({"stops.lower_angle": -0.001, "stops.upper_angle": 1.0}))
    load = st.loads.Inertia(1e-3) + st.loads.Constant(torque)
    assert run(model, st.signals.constant(goal, unit="rad"), load, 0.4).status.ok


if __name__ == "__main__":
    for seed in range(*map(int, sys.argv[1:])):
        if wrong := crowded(seed):
            sys.stdout.write(f"{seed} {case(seed)[:3]}: {wrong}\n")
