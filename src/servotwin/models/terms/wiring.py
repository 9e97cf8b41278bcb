"""How a servo is commanded: what the engine follows of a command, which ones it takes, and where it rests under one.

The engine of a servo without pulses follows a control voltage [V], that of others the width of a pulse [s], or a goal
on a bus [rad].
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.terms.firmware import takes_goals
from servotwin.models.terms.frame import FRAME
from servotwin.models.terms.given import Given, either, is_given
from servotwin.models.terms.sensor import angle_at, stands
from servotwin.physics.electronics import (
    control_voltage_from_paper_pulse,
    control_voltage_from_pulse,
    control_voltage_from_voltage,
    pulse_width_from_feedback,
    pulse_width_from_voltage,
)
from servotwin.physics.potentiometer import angle_from_voltage, feedback_voltage

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

PULSE_RANGE = (3e-4, 2.7e-3)  # s, of what chips accept where the servo does not say; no source
TRAVEL_SLACK = 1e-9  # rad: so far beyond a stop a command may be, for rounding
_SHORTEST, _LONGEST = PULSE_RANGE
Line = tuple[float, float]
"""Gain and offset of a law that is a straight line."""


class Wiring(NamedTuple):
    """How a servo takes pulses [s], or goals [rad]."""

    gain: float  # of what the engine follows, per pulse or goal
    offset: float
    low: float  # pulses or goals that it takes, bounds included
    high: float
    least: float  # between these lies what the engine follows, bounds excluded
    most: float
    per_angle: float  # pulse, or goal, whose zero error is at an angle
    at_zero: float
    T_0: float  # the one-shot whose length stands for the feedback; 0 and 1 where a voltage or an angle does
    slope: float
    p: float  # the potentiometer's line; 1 and 0 of an encoder, whose angle stands for its voltage
    b_o: float
    endless: float  # 1: the shaft turns without end, and starts at 0
    lower_goal: float
    upper_goal: float
    lower: float  # between the stops
    upper: float


def feedback_line(given: Given) -> Line:
    """Return how the feedback voltage [V] follows the angle [rad]."""
    p, b_o = given.potentiometer_feedback_gain, either(given.potentiometer_feedback_offset, 0.0)
    return feedback_voltage(1.0, p), feedback_voltage(0.0, p, b_o)


def pulse_of_angle(given: Given) -> Line:
    """Return how the width of a pulse [s] follows the angle [rad] that it stands for, by the one-shot."""
    slope, T_0 = given.electronics_one_shot_slope, either(given.electronics_one_shot_offset, 0.0)
    p, b_o = feedback_line(given)
    return pulse_width_from_feedback(p, slope), pulse_width_from_feedback(b_o, slope, T_0)


def pulse_of_voltage(given: Given) -> Line:
    """Return how the width of a pulse [s] follows a command voltage [V]."""
    k_p1, t_0 = given.electronics_voltage_to_pulse_gain, either(given.electronics_command_pulse_offset, 0.0)
    return pulse_width_from_voltage(1.0, k_p1), pulse_width_from_voltage(0.0, k_p1, t_0)


class Calibration(NamedTuple):
    """How the command chain of a bounded servo measures pulses and voltages."""

    slope: float
    k_p2: float
    t_0: float
    T_0: float
    b_i: float


def calibration(given: Given) -> Calibration:
    """Return the calibration of a bounded servo; what it does not give follows from what it gives."""
    slope, k_p2 = given.electronics_one_shot_slope, given.electronics_pulse_to_voltage_gain
    if not is_given(slope):
        slope = 1.0 / k_p2
    k_p2 = either(k_p2, 1.0 / slope)
    t_0 = either(given.electronics_command_pulse_offset, 0.0)
    T_0, b_i = given.electronics_one_shot_offset, given.electronics_command_offset
    if not is_given(T_0) and not is_given(b_i):
        return Calibration(slope, k_p2, t_0, 0.0, 0.0)
    T_0 = either(T_0, slope * (k_p2 * t_0 - b_i))
    return Calibration(slope, k_p2, t_0, T_0, either(b_i, k_p2 * t_0 - T_0 / slope))


def bounded_by_pulse(given: Given) -> Line:
    """Return how the control voltage [V] of a bounded servo follows the width of a pulse [s]."""
    own = calibration(given)
    return (control_voltage_from_pulse(1.0, own.slope), control_voltage_from_pulse(0.0, own.slope, own.T_0))


def bounded_by_voltage(given: Given) -> Line:
    """Return how the control voltage [V] of a bounded servo follows a command voltage [V]."""
    own, k_p1 = calibration(given), given.electronics_voltage_to_pulse_gain
    return (control_voltage_from_voltage(1.0, k_p1, own.k_p2),
            control_voltage_from_voltage(0.0, k_p1, own.k_p2, own.b_i))


def averaged_by_pulse(given: Given) -> Line:
    """Return how the control voltage [V] of an averaged servo follows the width of a pulse [s]."""
    k_p2, b_i = given.electronics_pulse_to_voltage_gain, either(given.electronics_command_offset, 0.0)
    return (control_voltage_from_paper_pulse(1.0, k_p2), control_voltage_from_paper_pulse(
        0.0, k_p2, either(given.electronics_command_pulse_offset, 0.0), b_i))


def averaged_by_voltage(given: Given) -> Line:
    """Return how the control voltage [V] of an averaged servo follows a command voltage [V]."""
    k_p1, k_p2 = given.electronics_voltage_to_pulse_gain, given.electronics_pulse_to_voltage_gain
    return (control_voltage_from_voltage(1.0, k_p1, k_p2),
            control_voltage_from_voltage(0.0, k_p1, k_p2, either(given.electronics_command_offset, 0.0)))


def averaged(given: Given) -> Wiring:
    """Return how an averaged servo is commanded."""
    return _by_voltage(given, averaged_by_pulse(given), -math.inf, math.inf)


def bounded(given: Given) -> Wiring:
    """Return how a bounded servo is commanded."""
    return _by_voltage(given, bounded_by_pulse(given), either(given.stops_lower_angle, -math.inf),
                       either(given.stops_upper_angle, math.inf))


def _by_voltage(given: Given, line: Line, lower: float, upper: float) -> Wiring:
    (gain, offset), (p, b_o) = line, feedback_line(given)
    return Wiring(
        gain, offset, either(given.electronics_pulse_width_min, _SHORTEST),
        either(given.electronics_pulse_width_max, _LONGEST), -math.inf, math.inf, p / gain, (b_o - offset) / gain,
        0.0, 1.0, p, b_o, 0.0, -math.inf, math.inf, lower, upper)


def pulsed(given: Given, period: float) -> Wiring:
    """Return how a servo is commanded by pulses in frames of so many seconds; nan: as the servo says."""
    per_angle, at_zero = pulse_of_angle(given)
    p, b_o = feedback_line(given)
    return Wiring(
        1.0, 0.0, -math.inf, math.inf, 0.0, either(period, either(given.electronics_frame_period, FRAME)), per_angle,
        at_zero, either(given.electronics_one_shot_offset, 0.0), given.electronics_one_shot_slope, p, b_o,
        1.0 if stands(given) else 0.0, either(given.firmware_lower_goal, -math.inf),
        either(given.firmware_upper_goal, math.inf), either(given.stops_lower_angle, -math.inf),
        either(given.stops_upper_angle, math.inf))


def digital(given: Given, period: float) -> Wiring:
    """Return how a digital servo is commanded: by pulses, or by goals on a bus."""
    if not takes_goals(given):
        return pulsed(given, period)
    least, most = either(given.firmware_lower_goal, -math.inf), either(given.firmware_upper_goal, math.inf)
    lower, upper = either(given.stops_lower_angle, -math.inf), either(given.stops_upper_angle, math.inf)
    return Wiring(1.0, 0.0, max(least, lower) - TRAVEL_SLACK, min(most, upper) + TRAVEL_SLACK, -math.inf, math.inf,
                  1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0 if stands(given) else 0.0, least, most, lower, upper)


def followed(wiring: Wiring, command: float) -> float:
    """Return what the engine follows of a pulse [s] or a goal [rad]."""
    return wiring.gain * command + wiring.offset


def possible(wiring: Wiring, command: float) -> bool:
    """Tell whether a servo takes a pulse [s] or a goal [rad]; it does not take nan."""
    return wiring.low <= command <= wiring.high and wiring.least < followed(wiring, command) < wiring.most


def rest_angle(wiring: Wiring, curve: Sequence[Sequence[float]] | NDArray[np.float64], under: float) -> float:
    """Return the angle without error under what the engine follows, within goals and stops [rad]."""
    if wiring.endless > 0.0:
        return 0.0
    v_o = control_voltage_from_pulse(under, wiring.slope, wiring.T_0)
    q = angle_from_voltage(v_o, wiring.p, wiring.b_o)
    if len(curve) > 0:
        q = angle_at(wiring.p, wiring.b_o, curve, feedback_voltage(q, wiring.p, wiring.b_o))
    return min(max(min(max(q, wiring.lower_goal), wiring.upper_goal), wiring.lower), wiring.upper)
