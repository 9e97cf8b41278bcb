"""Servos with one planted cause each, drawn from a seed; nothing here knows how causes are found.

A healthy servo is one of the catalog with its numbers off by up to a tenth and a load that it was made for. One cause
grows from its healthy number until the symptom shows, by measures of this file.
"""

from __future__ import annotations

import math
import random
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import servotwin as st
from servotwin.datasheet import thermal_masses
from servotwin.loads import Constant, Inertia, Load
from servotwin.models import Model, default_model, mid_travel
from servotwin.simulation.metrics import resolution

ANALOG = ("hitec-hs-422", "hitec-hs-755hb", "hitec-hs-485hb", "futaba-s3003", "towerpro-sg90", "hitec-hs-645mg",
          "futaba-s3305")
DIGITAL = ("towerpro-mg996r", "dsservo-ds3218", "jx-pdi-6221mg", "feetech-ft-2806")
BUS = ("feetech-sts3215-12v", "feetech-sts3215-7v4", "feetech-sts3250", "dynamixel-mx-28", "dynamixel-xl430-w250")
SYMPTOMS: dict[str, tuple[str, ...]] = {
    "buzzes": ("deadband", "gain", "play"),
    "sags": ("supply", "load", "friction"),
    "overshoots": ("gain", "load", "frame"),
    "gets warm": ("friction", "load", "supply"),
    "does not move": ("deadband", "friction", "supply"),
    "trips": ("register", "load"),
}
STEP, SMALL, AT, LATER = math.radians(60.0), math.radians(3.0), 0.1, 2.0
_CLEAR = 1.1  # times its threshold that a planted symptom is
_HEALTHY = 0.8
_NEAR = 0.25  # of an overshoot that a cause can make large before the shaft swings for ever
_LEVELS = 12


class Planted(NamedTuple):
    """A servo, its load, and what was planted in it."""

    symptom: str
    cause: str
    servo: Any
    load: Load
    words: str


class Base(NamedTuple):
    """A healthy servo, and its stall torque [N m] and reflected rotor inertia [kg m²] at the output."""

    servo: Any
    load: Load
    stall: float
    rotor: float


def base(rng: random.Random, names: tuple[str, ...]) -> Base:
    """Return a servo of the catalog with other numbers, and a light load."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        servo = st.load_servo(rng.choice(names))
        changes = {name: servo.get(name) * rng.uniform(0.9, 1.1) for name in (
            "motor.armature_resistance", "friction.coulomb_torque_forward", "motor.rotor_inertia")}
        if servo.potentiometer.feedback_gain is not None:  # a wiper has noise, of half a microsecond at most
            changes["potentiometer.noise"] = rng.uniform(0.1e-3, 0.4e-3)
        changes |= ({"electronics.minimum_drive_time": rng.uniform(0.3e-3, 1.2e-3)} if names is ANALOG else
                    {"firmware.minimum_duty": rng.uniform(0.0, 0.1)} if names is DIGITAL else {})
        changes["friction.coulomb_torque_backward"] = changes["friction.coulomb_torque_forward"]
        servo = servo.replace(changes)
    stall, rotor = stall_torque(servo), servo.motor.rotor_inertia * servo.gear.gear_reduction**2
    load = Constant(rng.choice((0.0, rng.uniform(0.0, 0.2))) * stall) + Inertia(rng.uniform(0.1, 2.0) * rotor)
    return Base(servo, load, stall, rotor)


def stall_torque(servo: Any) -> float:
    """Return the torque at standstill with all of the voltage [N m]."""
    voltage = servo.supply.open_circuit_voltage - (servo.supply.bridge_drop_voltage or 0.0)
    return float(servo.motor.torque_constant * servo.gear.gear_reduction * voltage / servo.motor.armature_resistance)


def grown(made: Base, symptom: str, cause: str, n: int) -> tuple[Any, Load, str] | None:
    """Return servo and load with a cause at level n; None where the servo has no such number."""
    servo, load, stall, rotor = made
    digital = servo.firmware.control_period is not None

    def changed(name: str, value: float, text: str) -> tuple[Any, Load, str]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return servo.replace({name: value}), load, f"{name} {servo.get(name) or 0.0:.4g} -> {value:.4g} ({text})"

    def deadband() -> Any:
        name = "firmware.deadband_angle" if digital else "electronics.deadband"
        now = servo.get(name)
        by = 1.6**n if symptom == "does not move" else 0.5**n
        return None if not now or now * by > 0.19 else changed(name, now * by, "deadband")

    def gain() -> Any:
        name = "firmware.proportional_gain" if digital else "electronics.stretcher_gain"
        return changed(name, servo.get(name) * 1.5**n, "gain")

    def play() -> Any:
        return None if n > 6 else changed("gear.backlash", math.radians(0.25) * 1.6**n, "play")

    def frame() -> Any:
        if digital:
            return changed("firmware.control_period", servo.firmware.control_period * 1.8**n, "tick")
        value = servo.electronics.frame_period * 1.25**n
        return None if value > 0.2 else changed("electronics.frame_period", value, "frame")

    def friction() -> Any:
        own = servo.friction.coulomb_torque_forward * 1.25**n
        if own * servo.gear.gear_reduction > 0.95 * stall:
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            more = servo.replace({"friction.coulomb_torque_forward": own, "friction.coulomb_torque_backward": own})
        return more, load, f"friction of {own * servo.gear.gear_reduction / stall:.0%} of the stall torque"

    def supply() -> Any:
        if symptom == "sags":
            value = 0.2 * servo.motor.armature_resistance * 1.5**n
            return None if value > 20.0 else changed("supply.internal_resistance", value, "supply")
        by = 1.08**n if symptom == "gets warm" else 0.8**n
        return changed("supply.open_circuit_voltage", servo.supply.open_circuit_voltage * by, "supply")

    def heavier() -> Any:
        if symptom == "overshoots":
            value = rotor * 1.5**(n + 1)
            return servo, load + Inertia(value), f"inertia of {value / rotor:.1f} times that of the rotor"
        torque = max(load.torque, 0.15 * stall) * 1.2**n
        heavy = load + Constant(torque - load.torque)
        return None if torque > 1.2 * stall else (servo, heavy, f"{torque / stall:.0%} of the stall torque")

    def register() -> Any:
        if servo.firmware.trip_current is None:
            return None
        return changed("firmware.trip_current", servo.firmware.trip_current * 0.75**n, "register")

    return {"deadband": deadband, "gain": gain, "play": play, "frame": frame, "friction": friction, "supply": supply,
            "load": heavier, "register": register}[cause]()


def shown(servo: Any, load: Load) -> dict[str, float]:
    """Return how strong each symptom is, 1 at its threshold."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = default_model(servo)
        middle = mid_travel(model)
        wide = st.signals.step(middle - STEP, middle, at=AT, unit="rad")
        small = st.signals.step(middle, middle + SMALL, at=LATER, unit="rad")
        large = run(model, wide, load)
        little = run(model, small, load)
    time = np.linspace(0.0, 6.0, 6001)
    angle, current = large.at("output_angle", time), large.at("armature_current", time)
    final = float(angle[-100:].mean())
    error, way = abs(middle - final), final - float(angle[100])
    moved = [way / STEP, float(np.mean(little.at("output_angle", time[-100:])) - little.at("output_angle", [LATER])[0])
             / SMALL]
    rest = large.rest
    swings = rest is not None and rest.swing > 0.0
    trips = any(event.kind.startswith("trips by") for event in large.events)
    return {
        "buzzes": 2.0 * (rest is not None and rest.restless),
        "sags": error / max(0.05 * STEP, 2.0 * float(resolution(model))) * (moved[0] >= 0.5 and not trips),
        "overshoots": 0.0 if swings or way <= 0.0 else (float(angle.max()) - final) / (0.1 * STEP),
        "gets warm": warmth(model, float(np.mean(current[3000:]**2)) * model.value("motor.armature_resistance")),
        "does not move": max((1.0 - each) / 0.5 for each in moved),
        "trips": 2.0 * trips,
    }


def run(model: Model, command: Any, load: Load) -> Any:
    """Return six seconds."""
    return st.simulate(model, command, duration=6.0, load=load, output_times=[6.0])


def warmth(model: Model, heat: float) -> float:
    """Return how warm ten minutes of a heat [W] make a servo, 1 at 51 °C of its housing, or 100 °C of its winding."""
    masses = thermal_masses(model.servo)
    if masses is None:
        return 0.0
    now = st.physics.Temperatures(masses.ambient, masses.ambient)
    after = masses.after(600.0, heat, now)
    return max((after.housing - masses.ambient) / (324.15 - masses.ambient),
               (after.winding - masses.ambient) / (373.15 - masses.ambient))


def healthy(made: Base) -> bool:
    """Tell whether a servo shows no symptom, with some distance."""
    return max(shown(made.servo, made.load).values()) < _HEALTHY


def drawn(rng: random.Random, symptom: str, cause: str) -> Planted:
    """Return a servo in which a cause alone makes a symptom."""
    kinds = (BUS,) if symptom == "trips" else (ANALOG, DIGITAL, BUS)
    while True:
        made = base(rng, rng.choice(kinds))
        if grown(made, symptom, cause, 1) is None:
            continue
        begins = shown(made.servo, made.load)
        if max(begins.values()) >= _HEALTHY or (symptom == "overshoots" and begins[symptom] < _NEAR):
            continue
        for n in range(1, _LEVELS):
            more = grown(made, symptom, cause, n)
            if more is None:
                break
            try:
                strength = shown(more[0], more[1])
            except st.errors.ServotwinError:
                break
            if strength[symptom] >= _CLEAR:
                name = f"{made.servo.name}: {more[2]}; load {more[1].torque / made.stall:.0%} of stall, "
                return Planted(symptom, cause, more[0], more[1], name + f"inertia {more[1].inertia / made.rotor:.1f}")


def sound(rng: random.Random) -> Base:
    """Return a healthy servo."""
    while True:
        made = base(rng, rng.choice((ANALOG, DIGITAL, BUS)))
        if healthy(made):
            return made


def first_fifteen(seed: int) -> list[tuple[str, str]]:
    """Return symptom and cause of 15 servos: each cause of the four symptoms that every servo may have, and three."""
    del seed
    return [(symptom, cause) for symptom in ("buzzes", "sags", "overshoots", "gets warm") for cause in SYMPTOMS[symptom]
            ] + [("does not move", "deadband"), ("does not move", "supply"), ("trips", "register")]


def other_fifteen(seed: int) -> list[tuple[str, str]]:
    """Return symptom and cause of 15 servos, three of each of five symptoms, causes drawn."""
    rng = random.Random(seed)
    kinds = [*rng.sample(list(SYMPTOMS), 5)]
    return [(symptom, rng.choice(SYMPTOMS[symptom])) for symptom in kinds for _ in range(3)]


Draw = Callable[[int], list[tuple[str, str]]]


def planted(seed: int, draw: Draw) -> list[Planted]:
    """Return the servos of a seed."""
    return [drawn(random.Random(f"{seed} {k}"), symptom, cause) for k, (symptom, cause) in enumerate(draw(seed))]
