"""Seeded random servos with any subset of what a real one does, told to the reference in SI, to the package in words.

Ranges: priors of the 40 g class (docs/theory/pulse.md). Heat capacities, plays, shares of the load-dependent friction
and limits are assumed, and chosen so that each shows within a fraction of a second: tens of kelvin, plays that are
crossed at every reversal, limits below the stall current, stops within the commanded travel.
"""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import servotwin as st

TERMS = frozenset({"inductance", "limit", "stribeck", "m3", "m4", "m5", "m6", "backlash", "wiper", "stops", "table",
                   "quantisation", "heat", "coast", "spring", "pendulum", "coulomb"})
Values = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Command:
    """Pulse width [s] over time: "constant" and "step" (before, after, at), "ramp" (and over), "sine" (about before).

    A sine is before + amplitude sin(2π frequency t + phase).
    """

    kind: str
    before: float
    after: float = 0.0
    at: float = 0.0
    over: float = 1.0
    amplitude: float = 0.0
    frequency: float = 1.0

    def width(self, t: float) -> float:
        if self.kind == "sine":
            return self.before + self.amplitude * math.sin(2.0 * math.pi * self.frequency * t)
        if self.kind == "constant" or t < self.at:
            return self.before
        if self.kind == "step" or t >= self.at + self.over:
            return self.after
        return self.before + (self.after - self.before) / self.over * (t - self.at)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run. `values`: SI numbers of the servo by dotted name; what is absent is off.

    `load`: any of inertia, viscous_friction, torque, coulomb_torque, spring.stiffness, spring.rest_angle,
    pendulum.mass, pendulum.length, pendulum.hanging_angle. `initial`: states by signal name; a motor speed that is not
    named is that of the output, a motor angle the one that centres the play. `edges`: rising edges, where they are not
    those of `electronics.frame_period`. Inductance counts where `values` has it.
    """

    values: Values
    command: Command
    duration: float
    load: dict[str, float] = field(default_factory=dict)
    initial: dict[str, float] = field(default_factory=dict)
    edges: tuple[float, ...] | None = None

    @property
    def inductive(self) -> bool:
        return "motor.armature_inductance" in self.values

    def replace(self, **values: Any) -> Case:
        """Values by dotted name with "__" for the dot; None takes one away."""
        new = {name.replace("__", "."): x for name, x in values.items()}
        kept = {name: x for name, x in (self.values | new).items() if x is not None}
        return Case(values=kept, command=self.command, duration=self.duration, load=self.load, initial=self.initial,
                    edges=self.edges)


# --- the package's words ----------------------------------------------------------------------------------------------


def servo_of(case: Case) -> st.Servo:
    groups: dict[str, dict[str, Any]] = {}
    for name, value in case.values.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = value
    return st.servo_from_values("random", groups)


def load_of(case: Case) -> st.loads.Load:
    n = case.load
    load = st.loads.Load(inertia=n.get("inertia", 0.0), viscous_friction=n.get("viscous_friction", 0.0),
                         torque=n.get("torque", 0.0), coulomb_torque=n.get("coulomb_torque", 0.0))
    if "spring.stiffness" in n:
        load += st.loads.Spring(n["spring.stiffness"], n.get("spring.rest_angle", 0.0))
    if "pendulum.mass" in n:
        load += st.loads.Pendulum(n["pendulum.mass"], n["pendulum.length"],
                                  hanging_angle=n.get("pendulum.hanging_angle", 0.0))
    return load


def command_of(case: Case) -> st.signals.Signal:
    c = case.command
    if case.edges is not None:
        return st.signals.pulse_train(case.edges, [c.width(t) for t in case.edges], unit="s")
    if c.kind == "constant":
        return st.signals.constant(c.before, unit="s")
    if c.kind == "step":
        return st.signals.step(c.before, c.after, at=c.at, unit="s")
    if c.kind == "ramp":
        return st.signals.ramp(c.before, c.after, at=c.at, over=c.over, unit="s")
    return st.signals.sine(mean=c.before, amplitude=c.amplitude, frequency=c.frequency, unit="s")


# --- random cases -----------------------------------------------------------------------------------------------------


class _Dice:
    """Numbers of one seed."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 409])

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        return math.exp(self.between(math.log(low), math.log(high)))

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one_of(self, *options: Any) -> Any:
        return options[int(self.rng.integers(len(options)))]


def _basic(d: _Dice) -> Values:
    """Motor, gear, Coulomb friction and supply."""
    N, R, K, J = d.between(150.0, 400.0), d.between(2.0, 7.0), d.between(0.4, 1.2), d.log(1e-3, 2e-2)
    V_oc, V_ce0, V_br = d.between(4.8, 6.6), d.one_of(0.0, d.between(0.05, 0.4)), d.one_of(0.0, d.between(0.1, 0.4))
    tau_c = d.between(0.05, 0.2) * K * (V_oc - V_ce0 - V_br) / R
    v: Values = {
        "motor.armature_resistance": R, "motor.torque_constant": K / N,
        "motor.back_emf_constant": K / N * d.one_of(1.0, d.between(0.95, 1.05)), "motor.rotor_inertia": J / N**2,
        "motor.motor_viscous_friction": d.between(0.0, 0.1) * K**2 / R / N**2, "gear.gear_reduction": N,
        "friction.coulomb_torque_forward": tau_c / N,
        "friction.coulomb_torque_backward": tau_c / N * d.between(0.7, 1.4),
        "supply.open_circuit_voltage": V_oc,
    }
    if V_br:
        v["motor.brush_drop_voltage"] = V_br
    if V_ce0:
        v["supply.bridge_drop_voltage"] = V_ce0
    if d.chance(0.5):
        v["supply.internal_resistance"] = d.between(0.05, 0.5)
    if d.chance(0.4):
        v["supply.bridge_drop_resistance"] = d.between(0.02, 0.3)
    if d.chance(0.3):
        v["friction.breakaway_ratio"] = d.between(1.05, 1.5)
    return v


def _chip(d: _Dice, v: Values, coast: bool) -> None:
    p, slope, period = d.between(0.38, 0.48), 1.0 / d.between(700.0, 1000.0), d.one_of(0.02, d.between(0.005, 0.02))
    b_o = d.between(0.4, 0.7)
    v.update({
        "potentiometer.feedback_gain": p, "potentiometer.feedback_offset": b_o,
        "electronics.frame_period": period, "electronics.one_shot_slope": slope,
        "electronics.one_shot_offset": 1.5e-3 - slope * (p * 0.5 * math.pi + b_o) + d.between(-1e-4, 1e-4),
        "electronics.stretcher_gain": max(d.between(60.0, 200.0) * period / 0.02, 8.0),
        "electronics.deadband": d.between(4e-6, 1e-5), "electronics.off_state": "coast" if coast else "brake",
    })
    options = {"minimum_drive_time": (0.0, 5e-4), "stretcher_time_constant": (0.015, 0.025),
               "back_emf_injection": (-0.003, 0.005), "supply_coupling": (-0.004, 0.006)}
    for name, limits in options.items():
        value = d.between(*limits)
        if d.chance(0.35):
            v[f"electronics.{name}"] = value


def _friction(d: _Dice, v: Values, terms: Set[str]) -> None:
    if "stribeck" in terms:
        v["friction.breakaway_ratio"] = d.between(1.1, 1.6)
        v["friction.stribeck_speed"] = d.between(0.2, 2.0) * v["gear.gear_reduction"]
        exponent = d.one_of(None, 1.0, 2.0, d.between(1.0, 2.0))
        if exponent:
            v["friction.stribeck_exponent"] = exponent
    law = max((t for t in terms if t in ("m3", "m4", "m5", "m6")), default="")
    shares = {"": {}, "m3": {"load_friction": 0.3}, "m4": {"load_friction": 0.3, "load_friction_stribeck": 0.15}}.get(
        law, {"load_friction_motor": 0.3, "load_friction_external": 0.3, "load_friction_motor_stribeck": 0.15,
              "load_friction_external_stribeck": 0.15})
    if law == "m6":
        shares |= {"load_friction_motor_quad": 0.4, "load_friction_external_quad": 0.4}
    v.update({f"friction.{name}": d.between(0.2, 1.0) * most for name, most in shares.items()})


def _width(v: Values, q: float) -> float:
    """Pulse width that asks for q, table and steps left out."""
    return v["electronics.one_shot_offset"] + v["electronics.one_shot_slope"] * (
        v["potentiometer.feedback_gain"] * q + v["potentiometer.feedback_offset"])


def _command(d: _Dice, v: Values, terms: Set[str]) -> tuple[Command, float, float]:
    """Command, and the lowest and highest angle that it asks for."""
    a, b = d.between(0.3, 1.4), d.between(1.5, 2.8)
    if d.chance(0.5):
        a, b = b, a
    kind = "sine" if d.chance(0.6 if terms & {"backlash", "wiper"} else 0.2) else d.one_of(
        "constant", "step", "step", "ramp")
    if kind == "sine":
        middle, size = 0.5 * (a + b), d.between(0.1, 0.5)
        rate = v["electronics.one_shot_slope"] * v["potentiometer.feedback_gain"]
        frequency = d.log(2.0, 8.0)
        return (Command(kind=kind, before=_width(v, middle), amplitude=rate * size, frequency=frequency),
                middle - size, middle + size)
    command = Command(kind=kind, before=_width(v, a), after=_width(v, b), at=d.between(0.0, 0.06),
                      over=d.between(0.05, 0.3))
    return command, min(a, b), max(a, b)


def _load(d: _Dice, v: Values, terms: Set[str]) -> dict[str, float]:
    N, R = v["gear.gear_reduction"], v["motor.armature_resistance"]
    K, J = N * v["motor.torque_constant"], N**2 * v["motor.rotor_inertia"]
    stall = K * v["supply.open_circuit_voltage"] / R
    load: dict[str, float] = {}
    if "backlash" in terms:
        v["gear.output_inertia"] = J * d.between(0.02, 0.2)
    if d.chance(0.6):
        load["inertia"] = J * d.log(0.1, 2.0)
    if d.chance(0.3):
        load["viscous_friction"] = d.log(0.01, 0.3) * K**2 / R
    if d.chance(0.5 if terms & {"m3", "m4", "m5", "m6"} else 0.3):
        load["torque"] = d.between(-0.3, 0.3) * stall
    if "coulomb" in terms:
        load["coulomb_torque"] = d.log(0.02, 0.15) * stall
    if "spring" in terms:
        load |= {"spring.stiffness": d.log(0.05, 0.3) * stall, "spring.rest_angle": d.between(0.0, 2.5)}
    if "pendulum" in terms:
        length = d.between(0.05, 0.2)
        weight = min(d.between(0.05, 0.35) * stall, 9.8 * 3.0 * J / length)
        load |= {"pendulum.mass": weight / 9.8 / length, "pendulum.length": length,
                 "pendulum.hanging_angle": d.between(-1.6, 3.0)}
    return load


def _effects(d: _Dice, v: Values, terms: Set[str], low: float, high: float, start: float) -> None:
    """What has no relation to the others: each a few values."""
    R = v["motor.armature_resistance"]
    if "inductance" in terms:
        v["motor.armature_inductance"] = R / d.log(1.5e3, 1.5e4)
    if "limit" in terms:
        v["supply.current_limit"] = d.between(0.3, 0.8) * v["supply.open_circuit_voltage"] / R
    if "backlash" in terms:
        v["gear.backlash"] = d.log(0.005, 0.05)
        sides = [v[f"friction.coulomb_torque_{way}"] * v["gear.gear_reduction"] for way in ("forward", "backward")]
        share = d.one_of(None, 0.0, 1.0, d.between(0.01, 0.3))  # of the friction that is behind the play
        if share is not None:
            v["friction.bearing_coulomb_torque"] = share * min(sides)
    if "wiper" in terms:
        v["potentiometer.backlash"] = d.log(0.005, 0.03)
    if "table" in terms:
        angles = np.linspace(-0.6, 3.8, 6) + d.rng.uniform(-0.2, 0.2, 6)
        v["potentiometer.linearity_angle"] = tuple(angles.tolist())
        v["potentiometer.linearity_error"] = tuple(d.rng.uniform(-0.02, 0.02, 6).tolist())
    if "quantisation" in terms:
        v["potentiometer.quantisation"] = d.between(1e-3, 4e-3)
    if "stops" in terms:
        reach = d.between(0.15, 0.6)  # most moves would go farther
        v.update({"stops.lower_angle": start - max(reach * (start - low), 0.03) - 0.02,
                  "stops.upper_angle": start + max(reach * (high - start), 0.03) + 0.02})
        if d.chance(0.7):
            v["stops.restitution"] = d.between(0.1, 0.7)
    if "heat" in terms:
        power = 0.3 * v["supply.open_circuit_voltage"] ** 2 / R
        v.update({"thermal.winding_capacity": power * d.between(0.0008, 0.003),
                  "thermal.housing_capacity": power * d.between(0.003, 0.02),
                  "thermal.winding_to_housing": d.between(1.0, 10.0),
                  "thermal.housing_to_ambient": d.between(3.0, 30.0), "thermal.ambient": d.between(285.0, 310.0),
                  "thermal.magnet_coefficient": d.between(-2e-3, -1e-3)})


def random_case(seed: int, terms: Set[str] = frozenset()) -> Case:
    """A realistic servo of the 40 g class with exactly these `terms` (of TERMS) on; of several laws m3-m6 the last."""
    if not terms <= TERMS:
        raise ValueError(f"unknown terms {sorted(terms - TERMS)}; known: {sorted(TERMS)}")
    d = _Dice(seed)
    duration = round(d.between(0.3, 0.5), 3)
    v = _basic(d)
    _chip(d, v, "coast" in terms)
    _friction(d, v, terms)
    command, low, high = _command(d, v, terms)
    load = _load(d, v, terms)
    middle, rises = 0.5 * (low + high), command.before <= command.after
    start = middle if command.kind == "sine" else low if rises else high
    initial = {}
    if command.kind == "constant":  # towards where it already is nothing would move
        initial["output_angle"] = start = middle + d.between(-0.1, 0.1)
    _effects(d, v, terms, low, high, start)
    return Case(values=v, command=command, duration=duration, load=load, initial=initial)
