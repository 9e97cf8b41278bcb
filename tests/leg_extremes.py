"""Digital servos with numbers far beyond what is sold: wide play, shares near 1, drops over the supply, tiny bodies."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

import servotwin as st

N = 300.0


class Extreme(NamedTuple):
    """A servo, its load, and what it is told for so long."""

    model: st.DigitalServo | st.PulseServo
    load: st.loads.Load
    command: st.signals.Signal
    duration: float


class Draw:
    """Random numbers of one servo."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng((seed, 9))

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def wide(self, low: float, high: float) -> float:
        """Return a number with every order of magnitude as likely."""
        return float(10.0 ** self.rng.uniform(math.log10(low), math.log10(high)))

    def some(self, p: float, **options: Any) -> dict[str, Any]:
        return options if self.rng.random() < p else {}

    def pick(self, *options: Any) -> Any:
        return options[int(self.rng.integers(len(options)))]


def extreme(seed: int) -> Extreme:
    """Return one of them, the same for the same seed."""
    d = Draw(seed)
    V, R, K, T_c = d.between(3.0, 15.0), d.wide(0.3, 20.0), d.wide(0.1, 3.0), d.wide(0.3e-3, 20e-3)
    stall = K * V / R
    F = d.wide(1e-4, 2.0) * stall / N
    groups: dict[str, dict[str, Any]] = {
        "motor": {"armature_resistance": R, "torque_constant": K / N, "back_emf_constant": K / N,
                  "rotor_inertia": d.wide(1e-7, 0.1) / N**2,
                  "motor_viscous_friction": d.pick(0.0, d.wide(1e-6, 1.0) / N**2)}
        | d.some(0.3, brush_drop_voltage=d.between(0.0, 1.2) * V),
        "gear": {"gear_reduction": N, "output_inertia": 1e-7} | d.some(0.75, backlash=d.wide(1e-5, math.radians(5.0))),
        "friction": {"coulomb_torque_forward": F, "coulomb_torque_backward": F * d.pick(1.0, d.wide(0.2, 5.0)),
                     "breakaway_ratio": d.pick(1.0, d.between(1.0, 3.0))} | _shares(d) | _bearing(d, F),
        "supply": {"open_circuit_voltage": V} | d.some(0.6, bridge_drop_voltage=d.pick(0.999, d.between(0.0, 1.0)) * V)
        | d.some(0.4, bridge_drop_resistance=d.wide(1e-3, 3.0) * R)
        | d.some(0.5, internal_resistance=d.wide(1e-3, 3.0)),
        "firmware": _firmware(d, T_c, V / R)}
    if d.rng.random() < 0.4:
        groups["stops"] = {"lower_angle": -d.wide(1e-3, 1.0), "upper_angle": d.wide(1e-3, 1.0),
                           "restitution": d.pick(0.0, d.between(0.0, 0.9))}
    load = st.loads.Inertia(d.wide(1e-7, 1.0)) + st.loads.Constant(d.pick(0.0, 1.0, -1.0) * d.wide(1e-3, 2.0) * stall)
    load += st.loads.Viscous(d.pick(0.0, d.wide(1e-6, 1.0))) + st.loads.Coulomb(d.pick(0.0, d.wide(1e-4, 1.0) * stall))
    duration = min(40.0 * T_c, 0.15)
    return Extreme(st.DigitalServo(st.servo_from_values("extreme", groups, kind="bus")), load,
                   _goals(d, groups.get("stops", {}), duration), duration)


def pressed(seed: int, analog: bool = False) -> Extreme:
    """Return a servo as sold, with play and a stop that rebounds, whose load presses it onto that stop."""
    d = Draw(seed)
    groups = {"gear.backlash": d.wide(5e-4, 0.03), "gear.output_inertia": d.wide(3e-6, 3e-4),
              "stops.lower_angle": -1.0, "stops.upper_angle": 1.0,
              "stops.restitution": d.pick(0.0, d.between(0.1, 0.95)),
              "supply.internal_resistance": d.pick(0.0, d.between(0.02, 0.4))}
    groups |= d.some(0.5, **{"supply.current_limit": d.between(0.3, 2.0)})
    groups |= d.some(0.3, **{"friction.load_friction": d.between(0.0, 0.3)})
    load = st.loads.Inertia(d.wide(3e-5, 3e-3)) + st.loads.Constant(d.pick(-1.0, 1.0) * d.wide(0.1, 20.0))
    goals = d.rng.uniform(-0.9, 0.9, 2)
    if analog:
        pulses = st.signals.samples([0.0, 0.1], 1500.0 + 600.0 * goals, unit="us", hold="previous")
        return Extreme(st.PulseServo(st.load_servo("hitec-hs-755hb").replace(groups)), load, pulses, 0.3)
    told = st.signals.samples([0.0, 0.1], goals, unit="rad", hold="previous")
    return Extreme(st.DigitalServo(st.load_servo("dynamixel-xl330-m288").replace(groups)), load, told, 0.3)


def _shares(d: Draw) -> dict[str, Any]:
    """Load friction, often nearly all of the torque."""
    near = 1.0 - d.wide(1e-6, 0.5)
    return d.pick({}, {"load_friction": d.pick(near, d.between(0.0, 0.9))}, {
        "load_friction_motor": d.pick(near, d.between(0.0, 0.9)),
        "load_friction_external": d.pick(near, d.between(0.0, 3.0))})


def _bearing(d: Draw, F: float) -> dict[str, Any]:
    return d.pick({}, {"bearing_coulomb_torque": 0.0}, {"bearing_coulomb_torque": d.between(0.0, 0.19) * N * F})


def _firmware(d: Draw, T_c: float, stall_current: float) -> dict[str, Any]:
    found = {"control_period": T_c, "command_kind": "goal", "proportional_gain": d.wide(0.5, 100.0),
             "compute_delay": d.pick(0.0, 1.0, 0.4, 1.7) * T_c, "off_state": d.pick("brake", "diode", "coast")}
    found |= d.some(0.5, angle_quantum=d.wide(1e-5, 1e-2)) | d.some(0.4, minimum_duty=d.between(0.0, 0.3))
    found |= d.some(0.4, derivative_gain=d.wide(1e-3, 1.0), derivative_ticks=float(d.pick(1, 5)))
    found |= d.some(0.3, integral_gain=d.wide(1.0, 1e3), integral_limit=d.between(0.0, 0.5))
    found |= d.some(0.3, speed_limit=d.wide(0.1, 20.0), acceleration_limit=d.wide(1.0, 1e3))
    found |= d.some(0.3, trip_current=d.wide(0.01, 1.0) * stall_current, trip_time=d.pick(0.0, 5.0) * T_c)
    return found | d.some(0.3, overload_duty=d.between(0.0, 0.9), overload_time=5.0 * T_c,
                          overload_output=d.pick(0.0, 0.1), stall_travel=0.05)


def _goals(d: Draw, stops: dict[str, float], duration: float) -> st.signals.Signal:
    at = np.arange(0.0, duration, max(duration / 5.0, 1e-3))
    goals = np.clip(d.rng.uniform(-1.0, 1.0, len(at)) * d.wide(1e-3, 1.0), stops.get("lower_angle", -3.0),
                    stops.get("upper_angle", 3.0))
    return st.signals.samples(at, goals, unit="rad", hold="previous")
