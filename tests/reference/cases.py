"""Seeded random servos, loads and commands, told twice: to the package in words, to the reference in SI.

Ranges: priors for the 40 g class; those of the 9 g class, of L, k, B_m, the breakaway ratio and the loads are
assumed, chosen to be wide.

Specifications are plain dicts, so this module needs nothing of the package:

- servo: ``{"motor": {...}, "gear": {...}, ...}`` for ``servo_from_values``;
- load: ``{"inertia": {"inertia": J}, "viscous": {"viscous_friction": B}, "constant": {"torque": T},
  "coulomb": {"torque": T}, "pendulum": {"mass", "length", "hanging_angle"}, "spring": {"stiffness", "rest_angle"},
  "recorded": {"time", "torque"}}``, any subset, their sum; empty: free shaft;
- command, always in volts (``command_voltage``): ``{"kind": ..., "unit": "V", ...}`` with the keys of `command_signal`.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .plant import Load, Plant, Signal, no_torque

Groups = dict[str, dict[str, float]]
Spec = dict[str, Any]

DURATION = 1.0
GRAVITY = 9.80665
LOADS = ("free", "inertia", "viscous", "constant", "coulomb", "pendulum", "spring", "recorded", "mixture")
COMMANDS = ("step", "ramp", "sine", "chirp", "prbs", "samples")


@dataclass(frozen=True, kw_only=True)
class Case:
    """One random run; iterates as (servo, load, command, plant, v_c, breaks)."""

    servo: Groups
    load: Spec
    command: Spec
    plant: Plant
    v_c: Signal
    breaks: tuple[float, ...]

    def __iter__(self) -> Any:
        return iter((self.servo, self.load, self.command, self.plant, self.v_c, self.breaks))


def _log(rng: np.random.Generator, lo: float, hi: float) -> float:
    return float(math.exp(rng.uniform(math.log(lo), math.log(hi))))


def _uniform(rng: np.random.Generator, lo: float, hi: float) -> float:
    return float(rng.uniform(lo, hi))


def random_servo(rng: np.random.Generator, size: str | None = None, stops: bool | None = None) -> Groups:
    """Groups of a servo of the "40 g" or "9 g" class; `stops` asks for end stops, else by chance."""
    size = size or str(rng.choice(["40 g", "9 g"]))
    big = size == "40 g"
    N = _uniform(rng, 150.0, 400.0)
    R = _uniform(rng, 2.0, 7.0) if big else _uniform(rng, 4.0, 12.0)
    K_out = _uniform(rng, 0.4, 1.2) if big else _uniform(rng, 0.1, 0.4)
    J = _log(rng, 1e-3, 2e-2) if big else _log(rng, 1e-4, 2e-3)
    V_oc, V_ce0 = _uniform(rng, 4.8, 6.6), _uniform(rng, 0.0, 0.4)
    tau_c = _uniform(rng, 0.05, 0.3) * K_out * (V_oc - V_ce0) / R
    s_r, p, T_f = _uniform(rng, 700.0, 1000.0), _uniform(rng, 0.38, 0.48), _uniform(rng, 0.015, 0.02)
    k_p1 = 1.09e-3 * _uniform(rng, 0.9, 1.1)
    comparator = _uniform(rng, 1.0, 10.0)
    gain = (V_oc - V_ce0) * _uniform(rng, 60.0, 200.0) / (T_f * s_r)
    w_v = 0.0 if rng.random() < 0.15 else s_r * _uniform(rng, 4e-6, 1e-5)
    groups: Groups = {
        "motor": {
            "armature_resistance": R, "armature_inductance": R / _log(rng, 1.5e3, 4e4), "torque_constant": K_out / N,
            "back_emf_constant": K_out / N * (1.0 if rng.random() < 0.5 else _uniform(rng, 0.95, 1.05)),
            "rotor_inertia": J / N**2, "motor_viscous_friction": _uniform(rng, 0.0, 0.1) * K_out**2 / R / N**2,
        },
        "gear": {"gear_reduction": N},
        "friction": {
            "coulomb_torque_forward": tau_c / N,
            "coulomb_torque_backward": tau_c / N * (1.0 if rng.random() < 0.3 else _uniform(rng, 0.7, 1.4)),
            "zero_crossing_slope": _log(rng, 0.1, 30.0),
            "breakaway_ratio": 1.0 if rng.random() < 0.4 else _uniform(rng, 1.0, 1.6),
        },
        "electronics": {
            "bridge_gain": gain / comparator, "comparator_gain": comparator, "voltage_to_pulse_gain": k_p1,
            "pulse_to_voltage_gain": s_r, "command_offset": _uniform(rng, -0.1, 0.2), "voltage_deadband": w_v,
        },
        "potentiometer": {"feedback_gain": p, "feedback_offset": _uniform(rng, 0.4, 0.7)},
        "supply": {"open_circuit_voltage": V_oc, "bridge_drop_voltage": V_ce0},
    }
    if stops if stops is not None else rng.random() < 0.3:
        groups["stops"] = {
            "lower_angle": _uniform(rng, -0.3, 0.2), "upper_angle": _uniform(rng, 1.6, 3.4),
            "restitution": 0.0 if rng.random() < 0.4 else _uniform(rng, 0.1, 0.7),
        }
    return groups


def _recorded(rng: np.random.Generator, size: float) -> Spec:
    count = int(rng.integers(6, 20))
    inner = np.sort(rng.uniform(0.02, DURATION, count))
    time = np.concatenate([[0.0], inner, [2.0 * DURATION]])
    return {"time": time.tolist(), "torque": rng.uniform(-size, size, count + 2).tolist()}


def random_load(rng: np.random.Generator, groups: Groups, kind: str | None = None) -> Spec:
    """Load of a kind of LOADS, scaled to the servo: torques up to 40 % of stall, inertia up to three times its own."""
    motor, N = groups["motor"], groups["gear"]["gear_reduction"]
    K, R = N * motor["torque_constant"], motor["armature_resistance"]
    stall = K * (groups["supply"]["open_circuit_voltage"] - groups["supply"]["bridge_drop_voltage"]) / R
    J = N**2 * motor["rotor_inertia"]
    kind = kind or str(rng.choice(LOADS))
    if kind == "free":
        return {}
    if kind == "mixture":
        kinds = rng.choice(LOADS[1:-1], size=int(rng.integers(2, 5)), replace=False)
        return {k: v for each in kinds for k, v in random_load(rng, groups, str(each)).items()}
    if kind == "pendulum":
        length = _uniform(rng, 0.03, 0.2)
        mass = min(_uniform(rng, 0.02, 0.4) * stall / GRAVITY, 3.0 * J / length) / length
        return {kind: {"mass": mass, "length": length, "hanging_angle": _uniform(rng, -1.6, 3.0)}}
    if kind == "recorded":
        return {kind: _recorded(rng, 0.4 * stall)}
    made: dict[str, dict[str, float]] = {
        "inertia": {"inertia": J * _log(rng, 0.05, 3.0)},
        "viscous": {"viscous_friction": _log(rng, 0.01, 0.5) * K**2 / R},
        "constant": {"torque": _uniform(rng, -0.4, 0.4) * stall},
        "coulomb": {"torque": _log(rng, 0.02, 0.2) * stall},
        "spring": {"stiffness": _log(rng, 0.02, 0.3) * stall, "rest_angle": _uniform(rng, 0.0, 2.5)},
    }
    return {kind: made[kind]}


def random_command(rng: np.random.Generator, low: float, high: float, kind: str | None = None) -> Spec:
    """Command of a kind of COMMANDS that stays within [low, high] volts."""
    kind = kind or str(rng.choice(COMMANDS))
    a, b = _uniform(rng, low, high), _uniform(rng, low, high)
    if rng.random() < 0.25:  # small moves are where deadband and sticking show
        b = min(max(a + _uniform(rng, -0.05, 0.05) * (high - low), low), high)
    spec: Spec = {"kind": kind, "unit": "V"}
    if kind == "step":
        return spec | {"before": a, "after": b, "at": 0.0 if rng.random() < 0.3 else _uniform(rng, 0.01, 0.3)}
    if kind == "ramp":
        at = _uniform(rng, 0.0, 0.3)
        return spec | {"before": a, "after": b, "at": at, "duration": _uniform(rng, 0.05, 0.9)}
    if kind in ("sine", "chirp"):
        spec |= {"mean": 0.5 * (a + b), "amplitude": 0.5 * abs(b - a)}
        if kind == "sine":
            return spec | {"frequency": _log(rng, 0.3, 6.0)}
        return spec | {"start_frequency": _log(rng, 0.2, 1.0), "stop_frequency": _log(rng, 2.0, 8.0),
                       "duration": 2.0 * DURATION}
    if kind == "prbs":
        interval = _uniform(rng, 0.04, 0.2)
        count = math.ceil(DURATION / interval) + 1
        return spec | {"low": min(a, b), "high": max(a, b), "interval": interval,
                       "bits": [int(x) for x in rng.integers(0, 2, count)]}
    count = int(rng.integers(8, 30))
    time = np.concatenate([[0.0], np.sort(rng.uniform(0.02, DURATION, count - 2)), [2.0 * DURATION]])
    walk = np.clip(a + np.cumsum(rng.normal(0.0, 0.1 * (high - low), count)), low, high)
    return spec | {"time": time.tolist(), "value": walk.tolist(), "hold": str(rng.choice(["previous", "linear"]))}


def _table(time: list[float], value: list[float], hold: str) -> Signal:
    """Right-continuous samples; the first value before the first time, the last one after the last."""

    def signal(t: float) -> float:
        n = bisect.bisect_right(time, t) - 1
        if n < 0:
            return value[0]
        if hold == "previous" or n == len(time) - 1:
            return value[n]
        return value[n] + (value[n + 1] - value[n]) * (t - time[n]) / (time[n + 1] - time[n])

    return signal


def command_signal(spec: Spec) -> tuple[Signal, tuple[float, ...]]:
    """Meaning of a command: v_i(t) for all t, right-continuous, and the times of its jumps and kinks.

    step: before, after, at. ramp: before until at, linear over duration, then after. sine: mean + amplitude
    sin(2π frequency t). chirp: the same with the phase 2π (f0 t + (f1 − f0) t²/(2 duration)). Sine and chirp stand at
    mean before 0. prbs: low or high by bits, one per interval. samples: time, value, hold "previous" or "linear".
    """
    kind = spec["kind"]
    if kind == "step":
        before, after, at = spec["before"], spec["after"], spec["at"]
        return (lambda t: after if t >= at else before), (at,)
    if kind == "ramp":
        knots = [spec["at"], spec["at"] + spec["duration"]]
        return _table(knots, [spec["before"], spec["after"]], "linear"), tuple(knots)
    if kind in ("sine", "chirp"):
        mean, amplitude = spec["mean"], spec["amplitude"]
        f0 = spec["frequency"] if kind == "sine" else spec["start_frequency"]
        rate = 0.0 if kind == "sine" else (spec["stop_frequency"] - f0) / (2.0 * spec["duration"])
        return (lambda t: mean + amplitude * math.sin(2.0 * math.pi * t * (f0 + rate * t)) if t > 0 else mean), (0.0,)
    if kind == "prbs":
        time = [n * spec["interval"] for n in range(len(spec["bits"]))]
        return _table(time, [spec["high"] if b else spec["low"] for b in spec["bits"]], "previous"), tuple(time)
    return _table(spec["time"], spec["value"], spec["hold"]), tuple(spec["time"])


def make_load(spec: Spec) -> Load:
    """Reference load of a load specification; a pendulum is a point mass (inertia m l²)."""
    def of(kind: str, key: str) -> float:
        return float(spec.get(kind, {}).get(key, 0.0))

    m, length = of("pendulum", "mass"), of("pendulum", "length")
    constant, tau, breaks = of("constant", "torque"), no_torque, ()
    if "recorded" in spec:
        breaks = tuple(spec["recorded"]["time"])
        recorded = _table(spec["recorded"]["time"], spec["recorded"]["torque"], "linear")

        def tau(t: float) -> float:
            return constant + recorded(t)
    elif constant:
        def tau(t: float) -> float:
            return constant
    return Load(
        J_L=of("inertia", "inertia") + m * length**2, B_L=of("viscous", "viscous_friction"), tau=tau, tau_breaks=breaks,
        pendulum=m * GRAVITY * length, hanging=of("pendulum", "hanging_angle"),
        stiffness=of("spring", "stiffness"), rest=of("spring", "rest_angle"), coulomb=of("coulomb", "torque"),
    )


def make_plant(groups: Groups, load: Load) -> Plant:
    """Reference plant of a servo's groups; an absent group or value is off."""
    motor, friction, el = groups["motor"], groups.get("friction", {}), groups.get("electronics", {})
    pot, supply, stops = groups.get("potentiometer", {}), groups.get("supply", {}), groups.get("stops", {})
    return Plant(
        R=motor["armature_resistance"], L=motor.get("armature_inductance", 0.0), k_a=motor["torque_constant"],
        k_b=motor["back_emf_constant"], J_m=motor["rotor_inertia"], B_m=motor.get("motor_viscous_friction", 0.0),
        N=groups["gear"]["gear_reduction"],
        F1=friction.get("coulomb_torque_forward", 0.0), F2=friction.get("coulomb_torque_backward", 0.0),
        k=friction.get("zero_crossing_slope", 0.0), r=friction.get("breakaway_ratio", 1.0),
        A_ks=el.get("bridge_gain", 0.0) * el.get("comparator_gain", 1.0),
        p=pot.get("feedback_gain", 0.0), b_o=pot.get("feedback_offset", 0.0), w_v=el.get("voltage_deadband", 0.0),
        V_max=supply.get("open_circuit_voltage", math.inf) - supply.get("bridge_drop_voltage", 0.0),
        lower=stops.get("lower_angle", -math.inf), upper=stops.get("upper_angle", math.inf),
        restitution=stops.get("restitution", 0.0), load=load,
    )


def _angle_to_voltage(groups: Groups, angle: float) -> float:
    el, pot = groups["electronics"], groups["potentiometer"]
    k_p = el["voltage_to_pulse_gain"] * el["pulse_to_voltage_gain"]
    return (pot["feedback_gain"] * angle + pot["feedback_offset"] - el["command_offset"]) / k_p


def _start_inside_stops(groups: Groups, v_start: float) -> None:
    """Move a stop that the start angle would lie beyond: the start is at rest within the stops."""
    stops = groups.get("stops")
    if stops:
        el, pot = groups["electronics"], groups["potentiometer"]
        k_p = el["voltage_to_pulse_gain"] * el["pulse_to_voltage_gain"]
        q = (k_p * v_start + el["command_offset"] - pot["feedback_offset"]) / pot["feedback_gain"]
        stops["lower_angle"] = min(stops["lower_angle"], q - 0.05)
        stops["upper_angle"] = max(stops["upper_angle"], q + 0.05)


def random_case(
    rng: np.random.Generator, *, size: str | None = None, load: str | None = None, command: str | None = None,
    stops: bool | None = None,
) -> Case:
    """One random case; the keywords fix the servo's class, the load's kind, the command's kind, the stops."""
    groups = random_servo(rng, size, stops)
    load_spec = random_load(rng, groups, load)
    spec = random_command(rng, _angle_to_voltage(groups, 0.0), _angle_to_voltage(groups, math.pi), command)
    v_i, breaks = command_signal(spec)
    _start_inside_stops(groups, v_i(math.nextafter(0.0, -1.0)))
    k_p = groups["electronics"]["voltage_to_pulse_gain"] * groups["electronics"]["pulse_to_voltage_gain"]
    b_i = groups["electronics"]["command_offset"]
    return Case(
        servo=groups, load=load_spec, command=spec, plant=make_plant(groups, make_load(load_spec)),
        v_c=lambda t: k_p * v_i(t) + b_i, breaks=breaks,
    )
