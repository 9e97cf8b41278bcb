"""How a command gets to a simulated servo: as a voltage, a duty, a pulse or a goal on a bus, in steps and bounds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin import physics
from servotwin.control.controller import ANGLE, VOLTAGE
from servotwin.errors import InputError
from servotwin.models import DCMotor, DigitalServo, GearedMotor, Model
from servotwin.models.switched import SwitchedServo

if TYPE_CHECKING:
    from servotwin.parameters import Servo


@dataclass(frozen=True, kw_only=True)
class Wire:
    """What is sent for a command.

    Parameters
    ----------
    takes : str
        "armature_voltage" or "command_angle".
    unit : str
        Of what is sent, as signals have it.
    carried : callable
        What is sent for a command, the nearest that the wire can carry (SI).
    at_rest : callable
        What is sent to a servo that rests at an angle (SI).
    frame, lag : float
        How often a new command can matter, and how long it needs besides until it acts [s].
    """

    takes: str
    unit: str
    carried: Callable[[float], float]
    at_rest: Callable[[float], float]
    frame: float = 0.0
    lag: float = 0.0


def wire_of(model: Model, believed: Servo, resolution: float) -> Wire:
    """Return how commands get to a model; pulses have steps of `resolution` [s] and the calibration of a servo."""
    if isinstance(model, DCMotor | GearedMotor):
        V = model.servo.get("supply.open_circuit_voltage")
        most = V if isinstance(V, float) else math.inf
        return Wire(takes=VOLTAGE, unit="V", carried=lambda v: _within(v, -most, most), at_rest=lambda q: 0.0)
    if isinstance(model, DigitalServo) and model.takes_goals:
        tick, late = model.value("firmware.control_period"), model.value_or("firmware.compute_delay", 0.0)
        if "potentiometer.fixed_angle" in model.servo.names():
            return _duties(model, tick, late)
        lower, upper = _travel(model, "firmware.lower_goal", "firmware.upper_goal")
        return Wire(takes=ANGLE, unit="rad", carried=lambda q: _within(q, lower, upper),
                    at_rest=lambda q: _within(q, lower, upper), frame=tick, lag=late)
    if isinstance(model, SwitchedServo):
        return _pulses(model, believed, resolution)
    lower, upper = _travel(model)
    return Wire(takes=ANGLE, unit="rad", carried=lambda q: _within(q, lower, upper), at_rest=lambda q: q)


def _duties(model: DigitalServo, tick: float, late: float) -> Wire:
    """Return the wire to a bridge whose goals are duties, `bare_bridge`: v = d (V_oc − V_ce0)."""
    V = model.value("supply.open_circuit_voltage") - model.value_or("supply.bridge_drop_voltage", 0.0)
    return Wire(takes=VOLTAGE, unit="rad", carried=lambda v: _within(v / V, -1.0, 1.0), at_rest=lambda q: 0.0,
                frame=tick, lag=late)


def _pulses(model: SwitchedServo, believed: Servo, resolution: float) -> Wire:
    """Return the wire that carries pulses, of the width that stands for an angle: T_0 + (p q + b_o)/s_r."""
    def number(name: str, default: float | None = None) -> float:
        value = believed.get(name)
        if isinstance(value, float):
            return value
        if default is None:
            raise InputError(f"pulses for {believed.name}", got=f"no {name}", allowed="a servo that gives it")
        return default

    slope, T_0 = number("electronics.one_shot_slope"), number("electronics.one_shot_offset", 0.0)
    p, b_o = number("potentiometer.feedback_gain"), number("potentiometer.feedback_offset", 0.0)
    frame = model.frame_period
    shortest = max(model.value_or("electronics.pulse_width_min", 0.0), resolution, 1e-9)
    longest = min(model.value_or("electronics.pulse_width_max", math.inf), 0.999 * frame)

    def width(q: float) -> float:
        t = physics.pulse_width_from_feedback(physics.feedback_voltage(q, p, b_o), slope, T_0)
        return _within(resolution * round(t / resolution) if resolution > 0.0 else t, shortest, longest)

    return Wire(takes=ANGLE, unit="s", carried=width, at_rest=width, frame=frame,
                lag=model.value_or("firmware.compute_delay", 0.0))


def _travel(model: Model, *goals: str) -> tuple[float, float]:
    names = [("stops.lower_angle", "stops.upper_angle"), goals] if goals else [("stops.lower_angle",
                                                                               "stops.upper_angle")]
    given = [(model.value_or(low, -math.inf), model.value_or(high, math.inf)) for low, high in names]
    return max(low for low, _ in given), min(high for _, high in given)


def _within(value: float, lower: float, upper: float) -> float:
    return min(max(value, lower), upper)
