"""Random digital servos with commands and loads, over every option of the firmware, from one seed each.

Numbers are plausible for hobby servos. Where the firmware computes with floating angles, its thresholds are no whole
numbers of counts, so that rounding decides nothing; with whole counts they are.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

Group = dict[str, Any]
CENTRE, ONE_SHOT_SLOPE = 1.5e-3, 1.25e-3  # s, s/V


class Case(NamedTuple):
    """What `digital.run` takes."""

    values: dict[str, Group]
    command: Group
    load: Group
    duration: float


class Draw:
    """Random choices of one case."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, high + 1))

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def pick(self, *options: Any) -> Any:
        return options[self.whole(0, len(options) - 1)]

    def some(self, p: float, **options: Any) -> Group:
        """All of them or none."""
        return options if self.chance(p) else {}


def case(seed: int, linear: bool = False) -> Case:
    """One servo, what it is told and what hangs on it; `linear`: only what moves in closed form."""
    d = Draw(seed)
    V, R, K = d.between(5.0, 12.0), d.between(1.0, 6.0), d.between(0.3, 1.5)
    stall, duration, frame = K * V / R, d.between(0.3, 0.8), d.between(5e-3, 20e-3)
    N, J = d.between(100.0, 350.0), 10.0 ** d.between(-3.0, math.log10(2e-2))
    pulses = d.chance(0.5)
    kind = None if linear else d.pick("stribeck", "gear", "gears", "spring", "pendulum", "heat", None)
    rotor = d.between(0.3, 0.9)
    values: dict[str, Group] = {
        "motor": {"armature_resistance": R, "torque_constant": K / N, "back_emf_constant": K / N * d.pick(1.0, 1.02),
                  "rotor_inertia": rotor * J / N**2}
        | d.some(0.4, motor_viscous_friction=d.between(0.0, 0.02) * stall / 10.0 / N**2)
        | d.some(0.3, brush_drop_voltage=d.between(0.05, 0.4)),
        "gear": {"gear_reduction": N} | d.some(0.3, output_inertia=0.02 * J),
        "friction": _friction(d, stall / N, kind),
        "supply": _supply(d, V, V / R),
        "electronics": {"frame_period": frame},
        "firmware": _clock(d, frame),
    }
    values |= _stops(d) | _thermal(d, kind)
    if pulses or d.chance(0.4):
        values["potentiometer"] = _potentiometer(d)
        values["electronics"] |= {
            "one_shot_slope": ONE_SHOT_SLOPE, "pulse_width_min": 0.8e-3, "pulse_width_max": 2.2e-3,
            "one_shot_offset": CENTRE - ONE_SHOT_SLOPE * values["potentiometer"]["feedback_offset"]}
    firmware, T_c = values["firmware"], values["firmware"]["control_period"]
    firmware |= _angles(d) | {"command_kind": "pulse" if pulses else "goal"}
    whole = firmware.get("whole_counts") == "yes"
    firmware |= _gains(d, T_c) | _errors(d, firmware.get("angle_quantum"), whole)
    firmware |= _duties(d, firmware.get("duty_quantum"), V / R) | _profile(d, V / K) | _trips(d, kind, V, V / R)
    firmware |= _signals(d, pulses)
    if "deadband_angle" not in firmware and "potentiometer" in values:
        values["electronics"] |= d.some(0.3, deadband=d.between(1e-6, 8e-6))
    command = _pulses(d, values, duration, frame) if pulses else _goals(d, duration, T_c)
    load = _load(d, (1.0 - rotor) * J, stall, duration, kind)
    return Case(values, command, load, duration)


def _clock(d: Draw, frame: float) -> Group:
    T_c = d.between(0.3e-3, 3e-3)
    if d.chance(0.5):
        T_c = frame / math.ceil(frame / T_c)
    delay = d.pick(0.0, T_c, 2.0 * T_c, 3.0 * T_c, d.between(0.0, 3.0) * T_c)
    return {"control_period": T_c} | d.some(0.7, compute_delay=delay) | d.some(
        0.5, control_phase=d.between(0.0, d.pick(1.0, 4.0)) * T_c) | {"proportional_gain": d.between(3.0, 20.0)}


def _friction(d: Draw, stall: float, kind: str | None) -> Group:
    F = d.between(0.03, 0.2) * stall
    found = {"coulomb_torque_forward": F, "coulomb_torque_backward": F * d.pick(1.0, d.between(0.8, 1.25))}
    found |= d.some(0.5, breakaway_ratio=d.between(1.0, 1.6))
    if kind == "stribeck" or (kind in ("gear", "gears") and d.chance(0.5)):
        found |= {"stribeck_speed": d.between(2.0, 20.0), "breakaway_ratio": d.between(1.1, 1.8)}
        found |= d.some(0.4, stribeck_exponent=2.0)
    if kind == "gear":
        found |= {"load_friction": d.between(0.02, 0.2)} | d.some(0.5, load_friction_stribeck=d.between(0.0, 0.1))
    if kind == "gears":
        found |= {"load_friction_motor": d.between(0.02, 0.2), "load_friction_external": d.between(0.02, 0.2)}
        found |= d.some(0.5, load_friction_motor_stribeck=d.between(0.0, 0.1),
                        load_friction_external_stribeck=d.between(0.0, 0.1))
        share = d.between(0.0, 0.05)
        found |= d.some(0.4, load_friction_motor_quad=share, load_friction_external_quad=share)
    return found


def _supply(d: Draw, V: float, I_s: float) -> Group:
    return ({"open_circuit_voltage": V} | d.some(0.6, internal_resistance=d.between(0.05, 0.5))
            | d.some(0.5, bridge_drop_voltage=d.between(0.05, 0.4))
            | d.some(0.5, bridge_drop_resistance=d.between(0.05, 0.4))
            | d.some(0.2, current_limit=d.between(0.3, 1.2) * I_s))


def _stops(d: Draw) -> dict[str, Group]:
    if not d.chance(0.4):
        return {}
    stops = {"lower_angle": -d.between(0.3, 1.5), "upper_angle": d.between(0.3, 1.5)}
    return {"stops": stops | d.some(0.5, restitution=d.between(0.1, 0.6))}


def _thermal(d: Draw, kind: str | None) -> dict[str, Group]:
    if kind != "heat":
        return {}
    heat = {"winding_capacity": d.between(0.02, 0.4), "housing_capacity": d.between(0.02, 0.2),
            "winding_to_housing": d.between(0.2, 2.0), "housing_to_ambient": d.between(0.2, 3.0), "ambient": 295.0}
    return {"thermal": heat | d.some(0.5, magnet_coefficient=-1.5e-3)}


def _potentiometer(d: Draw) -> Group:
    found: Group = {"feedback_gain": 0.42, "feedback_offset": 1.2}
    found |= d.some(0.3, backlash=d.between(1e-3, 8e-3))
    return found | d.some(0.3, linearity_angle=(-1.3, -0.4, 0.5, 1.4), linearity_error=(4e-3, -6e-3, 5e-3, -3e-3))


def _angles(d: Draw) -> Group:
    quantum = d.pick(2.0 * math.pi / 4096.0, math.radians(200.0) / 4096.0, 2.0 * math.pi / 1024.0)
    found = d.some(0.75, angle_quantum=quantum) | d.some(0.4, filter_weight=d.between(0.1, 0.9))
    found |= d.some(0.4, duty_quantum=d.pick(1.0 / 1000.0, 1.0 / 885.0, 1.0 / 255.0))
    return found | (d.some(0.7, whole_counts="yes") if {"angle_quantum", "duty_quantum"} <= set(found) else {})


def _gains(d: Draw, T_c: float) -> Group:
    found = d.some(0.6, derivative_gain=d.between(0.01, 0.25), derivative_of=d.pick("error", "measurement"))
    found |= d.some(0.6, derivative_ticks=float(d.whole(1, max(1, int(20e-3 / T_c)))))
    found |= d.some(0.5, integral_gain=d.between(2.0, 60.0))
    return found


def _errors(d: Draw, quantum: float | None, whole: bool) -> Group:
    """Thresholds of angle: whole counts where it counts, else nothing near to them."""
    count = quantum or 1.5e-3

    def counts(low: int, high: int) -> float:
        return count * (d.whole(low, high) + (0.0 if whole else d.between(0.2, 0.8)))

    found = d.some(0.5, deadband_angle=counts(0, 6)) | d.some(0.4, deadband_law=d.pick("gate", "subtract"))
    found |= d.some(0.4, derivative_threshold=counts(1, 4)) | d.some(0.4, anti_windup=d.between(0.02, 0.5))
    return found | d.some(0.4, integral_at_rest="yes", rest_travel=counts(1, 6))


def _duties(d: Draw, quantum: float | None, I_s: float) -> Group:
    def duty(low: float, high: float) -> float:
        x = d.between(low, high)
        return quantum * round(x / quantum) if quantum else x

    found = d.some(0.3, minimum_duty=duty(0.01, 0.1)) | d.some(0.3, torque_limit=duty(0.4, 1.0))
    found |= d.some(0.3, duty_limit=duty(0.5, 1.0)) | d.some(0.25, duty_slew=d.between(5.0, 100.0))
    found |= d.some(0.5, integral_limit=duty(0.05, 0.3))
    found |= d.some(0.3, current_limit=d.between(0.2, 0.8) * I_s, current_sense=d.pick("motor", "bus"))
    return found | d.some(0.8, off_state=d.pick("brake", "diode", "coast"))


def _profile(d: Draw, fastest: float) -> Group:
    if not d.chance(0.45):
        return {}
    found = d.some(0.8, speed_limit=d.between(0.1, 1.2) * fastest)
    found |= d.some(0.7, acceleration_limit=d.between(3.0, 40.0) * fastest)
    found |= d.some(0.5, minimum_speed=d.between(0.005, 0.05) * fastest)
    found |= d.some(0.4, velocity_feedforward=d.between(0.2, 1.0) / fastest)
    return found | d.some(0.3, acceleration_feedforward=d.between(0.005, 0.03) / fastest)


def _trips(d: Draw, kind: str | None, V: float, I_s: float) -> Group:
    found = d.some(0.3, overload_duty=d.between(0.15, 0.6), overload_time=d.between(0.02, 0.2),
                   stall_travel=d.between(0.02, 0.2), overload_output=d.pick(0.0, d.between(0.05, 0.15)))
    found |= d.some(0.3, overload_latches="yes") if found else {}
    found |= d.some(0.25, trip_current=d.between(0.1, 0.6) * I_s, trip_time=d.between(0.0, 0.05))
    found |= d.some(0.2, undervoltage=d.between(0.85, 0.99) * V)
    if "undervoltage" in found:
        found |= {"undervoltage_action": d.pick("reset", "stop")} | d.some(0.7, restart_time=d.between(0.005, 0.1))
    if kind == "heat":
        found |= d.some(0.7, trip_temperature=295.0 + d.pick(d.between(0.05, 1.0), d.between(5.05, 7.0)))
    return found


def _signals(d: Draw, pulses: bool) -> Group:
    found = d.some(0.3, signal_timeout=d.between(0.03, 0.2), signal_loss=d.pick("hold", "limp", "failsafe"),
                   failsafe_angle=d.between(-0.5, 0.5))
    found |= d.some(0.25, soft_start_duty=d.between(0.1, 0.5), soft_start_time=d.between(0.02, 0.2))
    found |= d.some(0.3, lower_goal=-d.between(0.2, 1.0), upper_goal=d.between(0.2, 1.0))
    if pulses:
        return found | d.some(0.5, pulse_resolution=d.pick(1e-6, 0.5e-6, 2.3e-6))
    return found | d.some(0.5, bus_latency=d.between(0.0, 5e-3))


def _path(d: Draw, duration: float) -> Any:
    """Wanted angle over time [rad]."""
    size, mean = d.between(0.02, 1.1), d.between(-0.3, 0.3)
    shape, at, rate = d.pick("step", "steps", "sine", "ramp"), d.between(0.05, 0.2), d.between(1.0, 12.0)
    levels = [d.between(-size, size) for _ in range(6)]
    if shape == "sine":
        return lambda t: mean + 0.5 * size * math.sin(2.0 * math.pi * rate * t)
    if shape == "ramp":
        return lambda t: size * min(t / duration, 1.0) * 1.3
    return lambda t: 0.0 if t < at else levels[int((t - at) / 0.12) % 6 if shape == "steps" else 0]


def _pulses(d: Draw, values: dict[str, Group], duration: float, frame: float) -> Group:
    """One a frame; some runs lose a stretch of them, or have some that are out of bounds."""
    path, phase = _path(d, duration), d.pick(0.0, d.between(0.0, 1.0) * frame)
    slope = values["potentiometer"]["feedback_gain"] * ONE_SHOT_SLOPE
    edges = [phase + k * frame for k in range(int((duration - phase) / frame))]
    widths = [CENTRE + slope * path(t) for t in edges]
    if d.chance(0.3):
        odd = d.whole(2, 9)
        widths = [2.6e-3 if k % odd == 1 else width for k, width in enumerate(widths)]
    if d.chance(0.4):
        gap, length = d.between(0.0, 0.6) * duration, d.between(0.05, 0.4) * duration
        kept = [k for k, t in enumerate(edges) if not gap <= t < gap + length]
        edges, widths = [edges[k] for k in kept], [widths[k] for k in kept]
    return {"kind": "pulse", "edges": edges, "widths": widths}


def _goals(d: Draw, duration: float, T_c: float) -> Group:
    """Steps written now and then, at ticks or not, or a slope."""
    if d.chance(0.25):
        turn, rate = d.between(0.2, 0.5) * duration, d.between(-2.0, 2.0)
        return {"kind": "goal", "pieces": [(0.0, 0.0, rate), (turn, rate * turn, 0.0),
                                           (1.5 * turn, d.between(-0.8, 0.8), d.between(-1.0, 1.0))]}
    path, every = _path(d, duration), d.pick(10.0 * T_c, d.between(5e-3, 30e-3))
    times = [k * every for k in range(int(duration / every) + 1)]
    pieces = [(t, path(t), 0.0) for t in times]
    return {"kind": "goal", "pieces": [p for k, p in enumerate(pieces) if k == 0 or p[1] != pieces[k - 1][1]]}


def _load(d: Draw, inertia: float, stall: float, duration: float, kind: str | None) -> Group:
    torque: Any = d.pick(0.0, d.between(-0.5, 0.5) * stall, d.between(-0.2, 0.2) * stall)
    if d.chance(0.4):
        times = [0.0, *sorted(d.between(0.05, 1.0) * duration for _ in range(d.whole(1, 4)))]
        slope = d.pick(0.0, 1.0)
        torque = [(t, d.between(-0.4, 0.4) * stall, slope * d.between(-0.6, 0.6) * stall / duration) for t in times]
    load: Group = {"inertia": inertia, "torque": torque} | d.some(0.5, viscous_friction=d.between(0.0, 0.02) * stall)
    if kind == "spring":
        load |= {"stiffness": d.between(0.05, 0.5) * stall, "rest": d.between(-0.4, 0.4)}
    if kind == "pendulum":
        length = d.between(0.05, 0.15)
        load |= {"pendulum": {"mass": d.between(0.05, 0.3) * stall / length / 9.80665, "length": length,
                              "gravity": 9.80665}}
    return load
