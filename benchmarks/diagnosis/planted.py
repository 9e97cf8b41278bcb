"""Servos that suffer from one planted cause, and healthy ones, drawn from a seed: what `diagnose` says of them.

    python benchmarks/diagnosis/planted.py SEED

A servo of the catalog gets numbers off by up to 15 % and a load that it carries in health. One number of one cause is
then changed by a random factor; the pair is kept where the symptom shows with it and none shows without, by measures of
this file, which knows symptoms and causes by their names alone, not how causes are found or ranked. Three servos of
each of five symptoms, "trips" and "does not move" being one of them, and ten healthy ones.
"""

from __future__ import annotations

import math
import random
import sys
import time
import warnings
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

import servotwin as st
from servotwin.datasheet import thermal_masses
from servotwin.loads import Constant, Inertia, Load, Pendulum
from servotwin.models import DigitalServo, PulseServo, default_model, mid_travel

WIDE, SMALL, AT, DURATION = math.radians(60.0), math.radians(3.0), 0.2, 7.0
CAUSES = {
    "buzzes": ("deadband", "gain", "play", "frame rate"),
    "sags": ("supply", "load", "friction", "gain", "deadband", "register"),
    "overshoots": ("gain", "load", "frame rate"),
    "gets warm": ("friction", "load", "supply"),
    "stops": ("deadband", "friction", "supply", "register", "load"),
}
STOPS = ("trips", "does not move")
TRIES = 300  # of servos, until a cause counts as one that does not make a symptom
SHOWS, HEALTHY = 1.1, 0.8  # times its threshold that a symptom is with the cause at least, and without it at most


class Case(NamedTuple):
    """A servo under a load; in words, what was planted."""

    servo: Any
    load: Load
    stall: float
    rotor: float
    words: str


def quietly(make: Any, *given: Any) -> Any:
    """Return what a function makes, without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make(*given)


def base(rng: random.Random) -> Case:
    """Return a servo of the catalog with numbers of its own, under a load."""
    while True:
        servo = st.load_servo(rng.choice(st.catalog_names()))
        model = quietly(default_model, servo)
        if isinstance(model, PulseServo | DigitalServo) and not model.endless:
            break
    changed = {}
    for name in ("motor.armature_resistance", "motor.rotor_inertia", "electronics.stretcher_gain",
                 "electronics.deadband", "firmware.proportional_gain"):
        if servo.get(name):
            changed[name] = servo.get(name) * rng.uniform(0.85, 1.15)
    rubs = rng.uniform(0.85, 1.15)
    for name in ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward"):
        changed[name] = servo.get(name) * rubs
    if servo.get("potentiometer.feedback_gain"):
        changed["potentiometer.noise"] = rng.uniform(0.0, 0.3e-3)
    servo = quietly(servo.replace, changed)
    ratio = servo.gear.gear_reduction
    volts = servo.supply.open_circuit_voltage - (servo.supply.bridge_drop_voltage or 0.0)
    stall = servo.motor.torque_constant * ratio * volts / servo.motor.armature_resistance
    rotor = servo.motor.rotor_inertia * ratio**2
    load = Load() + Inertia(rng.uniform(0.05, 2.0) * rotor)
    kind = rng.random()
    if kind < 0.4:
        load = load + Constant(rng.uniform(0.0, 0.25) * stall)
    elif kind < 0.6:
        length = rng.uniform(0.03, 0.1)
        load = load + Pendulum(mass=rng.uniform(0.02, 0.2) * stall / (9.80665 * length), length=length)
    return Case(servo, load, stall, rotor, servo.name)


def planted(rng: random.Random, made: Case, symptom: str, cause: str) -> Case | None:
    """Return a servo with one number of a cause changed; None where it has none."""
    servo = made.servo
    digital = servo.get("firmware.control_period") is not None

    def by(low: float, high: float) -> float:
        return 10.0**rng.uniform(low, high)

    def put(name: str, factor: float, value: float | None = None) -> Case | None:
        now = servo.get(name)
        if value is None and not now:
            return None
        value = now * factor if value is None else value
        return made._replace(servo=quietly(servo.replace, {name: value}),
                             words=f"{made.words}: {name} {now or 0.0:.4g} -> {value:.4g}")

    def hung(more: Load, words: str) -> Case:
        return made._replace(load=made.load + more, words=f"{made.words}: {words}")

    if cause == "deadband":
        return put("firmware.deadband_angle" if digital else "electronics.deadband",
                   by(-2.0, -0.3) if symptom == "buzzes" else by(0.5, 1.8))
    if cause == "gain":
        return put("firmware.proportional_gain" if digital else "electronics.stretcher_gain",
                   by(-1.5, -0.3) if symptom == "sags" else by(0.3, 1.5))
    if cause == "play":
        return put("gear.backlash", 1.0, math.radians(rng.uniform(1.0, 5.0)))
    if cause == "frame rate":
        name = rng.choice(("firmware.control_period", "firmware.compute_delay")) if digital else (
            "electronics.frame_period")
        if name.endswith("delay"):
            return put(name, 1.0, servo.firmware.control_period * rng.uniform(1.0, 10.0))
        return put(name, by(0.3, 1.5) if digital else by(0.1, 0.7))
    if cause == "supply":
        if symptom == "sags":
            return put("supply.internal_resistance", 1.0, servo.motor.armature_resistance * by(-0.7, 1.0))
        return put("supply.open_circuit_voltage",
                   rng.uniform(1.1, 1.6) if symptom == "gets warm" else rng.uniform(0.2, 0.8))
    if cause == "friction":
        factor = by(0.3, 1.5)
        names = ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward")
        return made._replace(
            servo=quietly(servo.replace, {name: servo.get(name) * factor for name in names}),
            words=f"{made.words}: friction x {factor:.3g}")
    if cause == "register":
        name = rng.choice(("firmware.torque_limit", "firmware.duty_limit", "firmware.trip_current") if
                          symptom == "stops" else ("firmware.torque_limit", "firmware.duty_limit"))
        return None if not servo.get(name) else put(name, by(-1.3, -0.1))
    if symptom == "overshoots":
        inertia = made.rotor * by(0.3, 2.0)
        return hung(Inertia(inertia), f"inertia + {inertia / made.rotor:.3g} rotors")
    torque = made.stall * rng.uniform(0.2, 1.2)
    return hung(Constant(torque), f"torque + {torque / made.stall:.2f} of stall")


def shown(case: Case) -> dict[str, float] | None:
    """Return how strong each symptom is, 1 at its threshold; None of a servo that cannot be run."""
    try:
        return quietly(_shown, case)
    except (st.errors.ServotwinError, ArithmeticError, ValueError):
        return None


def _shown(case: Case) -> dict[str, float]:
    model = default_model(case.servo)
    middle, clock = mid_travel(model), np.arange(0.0, DURATION, 1e-3)
    digital = isinstance(model, DigitalServo)
    drive = "duty" if digital else "drive"
    batch = st.simulate_many(
        model, [st.signals.step(middle - WIDE, middle, at=AT, unit="rad"),
                st.signals.step(middle, middle + SMALL, at=2.0, unit="rad")],
        duration=DURATION, load=case.load, output_times=clock, seeds=0,
        outputs=("output_angle", "armature_current", drive, *(("trip",) if digital else ()))).raise_if_failed()
    angle, driven = batch["output_angle"][0], np.abs(batch[drive][0])
    little = batch["output_angle"][1]
    late = clock >= DURATION - 1.0
    final = float(angle[late].mean())
    trips = bool(digital and (batch["trip"] != 0.0).any())
    missing = max(1.0 - (final - angle[100]) / WIDE, 1.0 - (little[late].mean() - little[1900]) / SMALL)
    swings, buzz = swinging(angle[late]), drives_on(case, model, angle[late], driven)
    off = abs(middle - final) / max(math.radians(1.0), 0.05 * WIDE)
    heat = float(np.mean(batch["armature_current"][0][len(clock) // 2:]**2)) * case.servo.motor.armature_resistance
    return {
        "buzzes": 2.0 * (swings or buzz),
        "sags": 0.0 if trips or missing > 0.5 else off,
        "overshoots": 0.0 if swings or buzz or trips or off > 1.0 else (float(angle.max()) - final) / (0.1 * WIDE),
        "gets warm": warmth(model, heat),
        "does not move": missing / 0.5,
        "trips": 2.0 * trips,
    }


def swinging(angle: np.ndarray, least: float = math.radians(1.0 / 6.0)) -> bool:
    """Tell whether a shaft goes to and fro by a sixth of a degree or more, several times, without getting smaller."""
    around = angle - np.median(angle)
    if np.ptp(around) < least:
        return False
    side, turns = 0.0, 0
    for value in around:
        if abs(value) > 0.25 * np.ptp(around) and value * side <= 0.0:
            side, turns = value, turns + 1
    half = len(angle) // 2
    return turns >= 3 and np.ptp(angle[half:]) > 0.8 * np.ptp(angle[:half])


def drives_on(case: Case, model: Any, angle: np.ndarray, driven: np.ndarray) -> bool:
    """Tell whether a bridge drives five times a second or more, while friction would hold the shaft where it stands."""
    rubs = case.servo.gear.gear_reduction * min(case.servo.friction.coulomb_torque_forward,
                                                case.servo.friction.coulomb_torque_backward)
    pulls = abs(case.load.torque + sum(each.gravity_torque * math.sin(float(angle[-1]) - each.hanging_angle)
                                       for each in case.load.pendulums))
    if np.ptp(angle) > math.radians(0.1) or pulls > 0.9 * rubs:
        return False
    last, before = driven[-1000:], driven[-3500:-2500]
    starts = int(np.count_nonzero((last[1:] > 0.0) & (last[:-1] == 0.0)))
    always = not isinstance(model, PulseServo) and bool((last > 0.0).all())
    return (starts >= 5 or always) and last.mean() >= 0.95 * before.mean()


def warmth(model: Any, heat: float) -> float:
    """Return how warm ten minutes of a heat [W] make a servo: 1 at 51 deg C of its housing, or 100 of its winding."""
    masses = thermal_masses(model.servo)
    if masses is None:
        return 0.0
    after = masses.after(600.0, heat, st.physics.Temperatures(masses.ambient, masses.ambient))
    return max((after.housing - masses.ambient) / (324.15 - masses.ambient),
               (after.winding - masses.ambient) / (373.15 - masses.ambient))


def healthy(case: Case) -> bool:
    """Tell whether no symptom shows, with some distance."""
    found = shown(case)
    return found is not None and max(found.values()) <= HEALTHY


def ill(rng: random.Random, symptom: str, cause: str) -> Case | None:
    """Return a servo that is healthy but for one cause, which makes a symptom; None where that hardly ever does."""
    wanted = STOPS if symptom == "stops" else (symptom,)
    for _ in range(TRIES):
        made = base(rng)
        case = planted(rng, made, symptom, cause)
        found = None if case is None else shown(case)
        if found is not None and max(found[name] for name in wanted) >= SHOWS and healthy(made):
            return case
    return None


def sample(seed: int) -> tuple[list[tuple[str, str, Case]], list[Case]]:
    """Return 15 servos with symptom and planted cause, and ten healthy ones."""
    rng = random.Random(f"planted causes {seed}")
    rows: list[tuple[str, str, Any]] = []
    for symptom, causes in CAUSES.items():
        order = rng.sample(causes, len(causes))  # one that is given up has another servo of the next
        drawn = ((symptom, cause, ill(rng, symptom, cause)) for cause in (*order, *order))
        rows += list(islice((row for row in drawn if row[2] is not None), 3))
    sound: list[Case] = []
    while len(sound) < 10:
        made = base(rng)
        sound += [made] if healthy(made) else []
    return rows, sound


def main(seed: int) -> None:
    rows, sound = sample(seed)
    right = quiet = 0
    for symptom, cause, case in rows:
        began = time.process_time()
        found = quietly(lambda one: st.diagnose(one.servo, load=one.load), case).findings
        took = time.process_time() - began
        wanted = STOPS if symptom == "stops" else (symptom,)
        named = [each for each in found if each.symptom.name in wanted]
        first = named[0].causes[0].cause if named and named[0].causes else "-"
        right += first == cause
        others = ", ".join(f"{each.symptom.name}: {'/'.join(one.cause for one in each.causes)}" for each in found)
        print(f"{'right' if first == cause else 'WRONG'}  {symptom:10s} {cause:10s} {took:5.1f} s  {case.words}; "
              f"says {others or 'nothing'}", flush=True)
    for case in sound:
        began = time.process_time()
        found = quietly(lambda one: st.diagnose(one.servo, load=one.load), case).findings
        quiet += not found
        print(f"{'right' if not found else 'WRONG'}  healthy    {time.process_time() - began:16.1f} s  {case.words}; "
              f"says {', '.join(each.symptom.name for each in found) or 'nothing'}", flush=True)
    print(f"seed {seed}: cause first in {right} of {len(rows)}, nothing found in {quiet} of {len(sound)} healthy")


if __name__ == "__main__":
    main(int(sys.argv[1]))
