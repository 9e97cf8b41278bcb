"""Seeded random pulse-level servos, loads and commands, told twice: to the package in words, to the reference in SI.

Ranges: priors of servos of the 40 g class and of their chips (docs/theory/pulse.md); those of β, c_s, R_b, r_c, the
timeout and the jitter of a pulse train are assumed, wide. Every option is on by chance, so that all meet all.
Specifications are plain dicts as in `cases`. A command's unit is "us", "deg" or "V"; one in "us" may have a
``"frame_period"``, and there is one more kind,
``{"kind": "pulse_train", "unit": "us", "edges": [...], "widths": [...]}``. `initial` holds what the start overrides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .cases import COMMANDS, Spec, _uniform, command_signal, random_command, random_load, random_servo
from .pulse import Chip, PulseRun, Shaft, Signal, solve_pulse

Groups = dict[str, dict[str, Any]]

UNITS = ("us", "deg", "V")
GRAVITY = 9.80665


@dataclass(frozen=True, kw_only=True)
class PulseCase:
    """One random run."""

    servo: Groups
    load: Spec
    command: Spec
    initial: dict[str, float]
    duration: float
    shaft: Shaft
    chip: Chip
    width: Signal  # pulse width [s] over time
    edges: tuple[float, ...] | None
    start: float  # pulse width just before t = 0 [s]

    def solve(self, times: Any, **options: Any) -> PulseRun:
        """Reference solution at `times`; `options` go to `solve_pulse`."""
        y0 = self.initial.get("output_angle"), self.initial.get("output_speed", 0.0)
        return solve_pulse(self.shaft, self.chip, self.width, self.duration, times, edges=self.edges, start=self.start,
                           y0=y0, **options)

    def spread(self, times: Any, size: float, seeds: tuple[int, ...] = (0, 1)) -> float:
        """Largest change of the angle when each frame's one-shot is ±`size` [s] longer, the signs random."""
        exact = self.solve(times).q
        worst = 0.0
        for seed in seeds:
            signs = np.random.default_rng(seed).choice([-1.0, 1.0], 20_000)
            moved = self.solve(times, shifts=lambda frame, signs=signs: size * float(signs[frame])).q
            worst = max(worst, float(np.max(np.abs(moved - exact))))
        return worst


def _chance(rng: np.random.Generator, share: float) -> bool:
    return bool(rng.random() < share)


def random_electronics(rng: np.random.Generator, groups: Groups) -> dict[str, Any]:
    """Chip of a servo whose potentiometer is given; the middle of 180° of travel is near 1.5 ms."""
    pot, slope = groups["potentiometer"], 1.0 / _uniform(rng, 700.0, 1000.0)
    middle = pot["feedback_gain"] * 0.5 * math.pi + pot["feedback_offset"]
    kind, gain, offset = rng.random(), _uniform(rng, 60.0, 200.0), 1.5e-3 - slope * middle + _uniform(rng, -1e-4, 1e-4)
    longest = offset + slope * (2.0 * middle - pot["feedback_offset"])  # pulse of 180°
    period = (0.02 if kind < 0.4 else 0.016384 if kind < 0.5 else _uniform(rng, 0.003, 0.02) if kind < 0.92
              else longest * _uniform(rng, 1.01, 1.1))  # the last: a decision may fall due after the next edge
    chip: dict[str, Any] = {
        "frame_period": period, "one_shot_slope": slope, "stretcher_gain": gain if _chance(rng, 0.2) else max(
            gain * period / 0.02, 8.0),
        "one_shot_offset": offset,
        "deadband": 0.0 if _chance(rng, 0.1) else _uniform(rng, 4e-6, 1e-5),
        "off_state": str(rng.choice(["brake", "coast"])),
        "voltage_to_pulse_gain": 1.09e-3 * _uniform(rng, 0.9, 1.1), "command_pulse_offset": _uniform(rng, -5e-5, 2e-5),
    }
    options: dict[str, Callable[[], float]] = {
        "minimum_drive_time": lambda: _uniform(rng, 0.0, 5e-4),
        "stretcher_time_constant": lambda: _uniform(rng, 0.015, 0.025),
        "back_emf_injection": lambda: _uniform(rng, -0.004, 0.01),
        "supply_coupling": lambda: _uniform(rng, -0.005, 0.01),
        "pulse_timeout": lambda: period * _uniform(rng, 0.6, 4.0),
        "pulse_width_min": lambda: _uniform(rng, 3e-4, 1e-3),
        "pulse_width_max": lambda: _uniform(rng, 2.0e-3, 2.7e-3),
    }
    chip |= {name: make() for name, make in options.items() if _chance(rng, 0.4)}
    return chip


def random_pulse_servo(rng: np.random.Generator) -> Groups:
    """Groups of a pulse-level servo of the "40 g" or "9 g" class."""
    groups: Groups = {name: dict(values) for name, values in random_servo(rng, stops=_chance(rng, 0.35)).items()}
    groups["friction"].pop("zero_crossing_slope")
    supply = groups["supply"]
    if _chance(rng, 0.3):
        supply["bridge_drop_voltage"] = 0.0
    if _chance(rng, 0.5):
        supply["internal_resistance"] = _uniform(rng, 0.05, 0.5)
    if _chance(rng, 0.4):
        supply["bridge_drop_resistance"] = _uniform(rng, 0.02, 0.3)
    if _chance(rng, 0.5):
        groups["motor"]["brush_drop_voltage"] = _uniform(rng, 0.1, 0.45)
    groups["electronics"] = random_electronics(rng, groups)
    return groups


def _width_of(groups: Groups, unit: str) -> Callable[[float], float]:
    """Pulse width [s] of a command value in its unit."""
    el, pot = groups["electronics"], groups["potentiometer"]
    if unit == "us":
        return lambda x: 1e-6 * x
    if unit == "V":
        return lambda x: el["voltage_to_pulse_gain"] * x + el["command_pulse_offset"]
    return lambda x: el["one_shot_offset"] + el["one_shot_slope"] * (
        pot["feedback_gain"] * math.radians(x) + pot["feedback_offset"])


def _range_of(groups: Groups, unit: str) -> tuple[float, float]:
    """Command values of 0° and 180°."""
    if unit == "deg":
        stops = groups.get("stops", {"lower_angle": 0.0, "upper_angle": math.pi})
        return max(math.degrees(stops["lower_angle"]), 0.0), min(math.degrees(stops["upper_angle"]), 180.0)
    low, high = (_width_of(groups, "deg")(x) for x in (0.0, 180.0))
    if unit == "us":
        return 1e6 * low, 1e6 * high
    el = groups["electronics"]
    gain, offset = el["voltage_to_pulse_gain"], el["command_pulse_offset"]
    return (low - offset) / gain, (high - offset) / gain


def random_train(rng: np.random.Generator, low: float, high: float, period: float, duration: float) -> Spec:
    """Pulses with jitter, gaps and, at times, an early end; widths wander, jump, or leave the accepted range."""
    jitter = 0.0 if _chance(rng, 0.3) else 0.06 * period
    edges = _uniform(rng, -1.5, 1.5) * period + period * np.arange(math.ceil(duration / period) + 3)
    edges = edges + rng.uniform(-jitter, jitter, edges.size)
    keep = rng.random(edges.size) > (0.0 if _chance(rng, 0.4) else 0.25)
    if _chance(rng, 0.3):
        keep &= edges < _uniform(rng, 0.3, 1.0) * duration
    keep[:2] = True
    edges = edges[keep]
    steps = rng.normal(0.0, 0.02, edges.size) + (rng.random(edges.size) < 0.1) * rng.normal(0.0, 0.4, edges.size)
    widths = np.clip(_uniform(rng, low, high) + (high - low) * np.cumsum(steps), low, high)
    widths = np.where(rng.random(edges.size) < 0.03, rng.choice([200.0, 2900.0]), widths)
    widths = np.minimum(widths, np.append(0.8e6 * np.diff(edges), math.inf))
    return {"kind": "pulse_train", "unit": "us", "edges": edges.tolist(), "widths": widths.tolist()}


def random_pulse_command(rng: np.random.Generator, groups: Groups, duration: float) -> Spec:
    """Command in any unit, or a pulse train."""
    if _chance(rng, 0.3):
        return random_train(rng, *_range_of(groups, "us"), groups["electronics"]["frame_period"], duration)
    unit = str(rng.choice(UNITS))
    spec = random_command(rng, *_range_of(groups, unit), str(rng.choice(COMMANDS))) | {"unit": unit}
    if unit == "us" and _chance(rng, 0.3):
        spec["frame_period"] = max(groups["electronics"]["frame_period"] * _uniform(rng, 0.7, 1.4),
                                   1.01e-6 * _range_of(groups, "us")[1])  # a pulse is shorter than its frame
    return spec


def pulse_widths(groups: Groups, spec: Spec) -> tuple[Signal, float, tuple[float, ...] | None]:
    """Meaning of a command: pulse width over time, the width just before t = 0, its own edges [s]."""
    width = _width_of(groups, spec["unit"])
    if spec["kind"] == "pulse_train":
        edges, widths = tuple(spec["edges"]), tuple(width(x) for x in spec["widths"])
        at = dict(zip(edges, widths, strict=True))
        before = [n for n, t in enumerate(edges) if t < 0.0]
        return lambda t: at[t], widths[before[-1] if before else 0], edges
    signal, _ = command_signal(spec)
    return lambda t: width(signal(t)), width(signal(math.nextafter(0.0, -1.0))), None


def make_shaft(groups: Groups, load: Spec) -> Shaft:
    """Reference shaft of a servo's groups and a load; an absent group or value is off."""
    motor, N, friction = groups["motor"], groups["gear"]["gear_reduction"], groups.get("friction", {})
    supply, stops = groups["supply"], groups.get("stops", {})

    def of(kind: str, key: str) -> float:
        return float(load.get(kind, {}).get(key, 0.0))

    m, length, constant = of("pendulum", "mass"), of("pendulum", "length"), of("constant", "torque")
    record = load.get("recorded", {"time": [0.0], "torque": [0.0]})
    return Shaft(
        J=N**2 * motor["rotor_inertia"] + of("inertia", "inertia") + m * length**2,
        B=N**2 * motor.get("motor_viscous_friction", 0.0) + of("viscous", "viscous_friction"),
        K=N * motor["torque_constant"], K_b=N * motor["back_emf_constant"],
        forward=N * friction.get("coulomb_torque_forward", 0.0),
        backward=N * friction.get("coulomb_torque_backward", 0.0),
        breakaway=friction.get("breakaway_ratio", 1.0), coulomb=of("coulomb", "torque"),
        R_a=motor["armature_resistance"], R_b=supply.get("internal_resistance", 0.0),
        r_c=supply.get("bridge_drop_resistance", 0.0), V_oc=supply["open_circuit_voltage"],
        V_ce0=supply.get("bridge_drop_voltage", 0.0), V_br=motor.get("brush_drop_voltage", 0.0),
        coasts=groups["electronics"]["off_state"] == "coast",
        stiffness=of("spring", "stiffness"), rest=of("spring", "rest_angle"),
        gravity=m * GRAVITY * length, hanging=of("pendulum", "hanging_angle"),
        knots=tuple(record["time"]), torques=tuple(constant + x for x in record["torque"]),
        lower=stops.get("lower_angle", -math.inf), upper=stops.get("upper_angle", math.inf),
        restitution=stops.get("restitution", 0.0),
    )


def make_chip(groups: Groups, frame_period: float | None = None) -> Chip:
    """Reference chip of a servo's groups; the command's frame period, where it has one, goes first."""
    el, pot = groups["electronics"], groups["potentiometer"]
    return Chip(
        T_0=el.get("one_shot_offset", 0.0), slope=el["one_shot_slope"], p=pot["feedback_gain"],
        b_o=pot.get("feedback_offset", 0.0), beta=el.get("back_emf_injection", 0.0), c_s=el.get("supply_coupling", 0.0),
        deadband=el.get("deadband", 0.0), gain=el["stretcher_gain"], t_min=el.get("minimum_drive_time", 0.0),
        tau_s=el.get("stretcher_time_constant"), timeout=el.get("pulse_timeout", math.inf),
        shortest=el.get("pulse_width_min", 0.0), longest=el.get("pulse_width_max", math.inf),
        period=frame_period or el.get("frame_period", 0.02),
    )


def random_start(rng: np.random.Generator, groups: Groups, chip: Chip, angle: float) -> dict[str, float]:
    """Start angle and speed, at times; the stops move so that the start is between them."""
    initial: dict[str, float] = {}
    knife_edge = chip.deadband == 0.0  # at zero error rounding would decide whether it drives
    crowded = chip.period < chip.T_0 + chip.slope * (chip.p * 4.5 + chip.b_o)  # a one-shot longer than a frame
    if crowded:
        initial["output_angle"] = angle = _uniform(rng, 2.5, 4.5)
    elif _chance(rng, 0.25) or knife_edge:
        low = -2.5 if _chance(rng, 0.2) else 0.2  # far below 0° the one-shot has no width left
        initial["output_angle"] = angle = _uniform(rng, low, 1.5)
    if not crowded and _chance(rng, 0.25):
        motor, N = groups["motor"], groups["gear"]["gear_reduction"]
        idle = groups["supply"]["open_circuit_voltage"] / (N * motor["back_emf_constant"])
        initial["output_speed"] = _uniform(rng, -2.5, 2.5) * idle  # beyond 1 the motor feeds the supply
    if "stops" in groups:
        stops = groups["stops"]
        stops["lower_angle"] = min(stops["lower_angle"], angle - 0.05)
        stops["upper_angle"] = max(stops["upper_angle"], angle + 0.05)
    return initial


def random_pulse_case(seed: int, load: str | None = None) -> PulseCase:
    """One random case; `load` fixes the load's kind."""
    rng = np.random.default_rng([seed, 77])
    duration = round(_uniform(rng, 0.3, 1.0), 3)
    groups = random_pulse_servo(rng)
    spec = random_load(rng, groups, load)
    command = random_pulse_command(rng, groups, duration)
    width, start, edges = pulse_widths(groups, command)
    chip = make_chip(groups, command.get("frame_period"))
    initial = random_start(rng, groups, chip, chip.zero_error_angle(start))
    return PulseCase(
        servo=groups, load=spec, command=command, initial=initial, duration=duration, shaft=make_shaft(groups, spec),
        chip=chip, width=width, edges=edges, start=start,
    )
