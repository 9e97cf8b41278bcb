"""The potentiometer: gain, offset, table, steps and play; on the shaft, or off it where a servo turns without end."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.terms.dependence import FOLLOWS, ON_Q, PROGRAM, PULSES, SLACK, STEPS
from servotwin.models.terms.given import Given, either, is_given
from servotwin.models.terms.source import Source
from servotwin.physics.backlash import play
from servotwin.physics.electronics import feedback_error
from servotwin.physics.potentiometer import HALVINGS, angle_from_voltage, error_between, feedback_voltage, quantised

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

READS = (
    "potentiometer.feedback_offset", "potentiometer.backlash", "potentiometer.quantisation",
    "potentiometer.linearity_angle", "potentiometer.linearity_error", "potentiometer.fixed_angle",
)
"""Optional numbers of a pulse servo."""


class Sensor(NamedTuple):
    """Numbers of the potentiometer; its table, one for all lanes, is an input."""

    p: float
    b_o: float
    half_slack: float  # half of the play between output and potentiometer
    step: float  # V from one step to the next; 0: none


NO_SENSOR = Sensor(0.0, 0.0, 0.0, 0.0)
ACTS = {"p": ON_Q | FOLLOWS | PULSES | PROGRAM, "b_o": FOLLOWS | PULSES | PROGRAM, "half_slack": SLACK, "step": STEPS}
"""Where each number acts."""


def slack(sensor: Sensor) -> bool:
    """Tell whether there is play between output and potentiometer."""
    return sensor.half_slack > 0.0


def depends(sensor: Sensor, source: Source) -> int:
    """Return on what the acceleration depends through the potentiometer: a bridge does not follow it."""
    return ON_Q if sensor.p != 0.0 and source.V == 0.0 else 0


def needs(sensor: Sensor) -> int:
    """Return what else there is to be followed of the potentiometer."""
    return (SLACK if sensor.half_slack > 0.0 else 0) | (STEPS if sensor.step > 0.0 else 0)


def error_of(sensor: Sensor, u: float, q: float) -> float:
    """Return the error v_e [V] of a servo that follows the voltage u [V]."""
    return feedback_error(u, feedback_voltage(q, sensor.p, sensor.b_o))


def error_rate(sensor: Sensor, du: float, w: float) -> float:
    """Return the rate of `error_of` [V/s] at an output speed [rad/s]."""
    return feedback_error(du, feedback_voltage(w, sensor.p))


def sensed_voltage(sensor: Sensor, curve: Sequence[Sequence[float]] | NDArray[np.float64], q: float) -> float:
    """Return v_o [V] of the potentiometer with its wiper at q; `curve` has rows of its linearity, angle and error."""
    v_o = feedback_voltage(q, sensor.p, sensor.b_o)
    if len(curve) > 0:
        v_o += _interpolated(curve, q)
    if sensor.step > 0.0:
        v_o = quantised(v_o, sensor.step)
    return v_o


def table_of(curve: tuple[Sequence[float], Sequence[float]]) -> tuple[tuple[float, float], ...]:
    """Return angles and errors of a linearity table as its rows."""
    return tuple(zip(*curve, strict=True))


def _interpolated(curve: Sequence[Sequence[float]] | NDArray[np.float64], q: float) -> float:
    if q <= curve[0][0]:
        return curve[0][1]
    for k in range(1, len(curve)):
        if q < curve[k][0]:
            return error_between(q, curve[k - 1][0], curve[k - 1][1], curve[k][0], curve[k][1])
    return curve[len(curve) - 1][1]


def angle_at(p: float, b_o: float, curve: Sequence[Sequence[float]] | NDArray[np.float64], v_o: float) -> float:
    """Return the angle [rad] at which a potentiometer with a table gives v_o [V], quantisation apart, by bisection.

    Where its errors fall faster than p rises it is one of several, at which the voltage rises.
    """
    ideal, most, least = angle_from_voltage(v_o, p, b_o), curve[0][1], curve[0][1]
    for k in range(1, len(curve)):
        most, least = max(most, curve[k][1]), min(least, curve[k][1])
    low, high = ideal - most / p, ideal - least / p
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if middle + _interpolated(curve, middle) / p <= ideal:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def wiper_at(sensor: Sensor, wiper: float, q: float) -> float:
    """Return where a potentiometer with play stands after the shaft has gone one way to q."""
    return play(wiper, q, 2.0 * sensor.half_slack) if sensor.half_slack > 0.0 else q


def pack(given: Given) -> Sensor:
    """Return the numbers of a servo's potentiometer, without what pulses alone show of it."""
    return Sensor(given.potentiometer_feedback_gain, either(given.potentiometer_feedback_offset, 0.0), 0.0, 0.0)


def stands(given: Given) -> bool:
    """Tell whether the feedback stands still, whatever the shaft does."""
    return is_given(given.potentiometer_fixed_angle)


def is_encoder(given: Given) -> bool:
    """Tell whether the angle is counted, by no voltage."""
    return not is_given(given.potentiometer_feedback_gain)


def pack_standing(given: Given, error: float) -> Sensor:
    """Return the numbers of a feedback that stands: one voltage at every angle, with its table's error, in its steps.

    An encoder has no voltage; its angle [rad] stands for one.
    """
    angle = given.potentiometer_fixed_angle
    if is_encoder(given):
        return Sensor(0.0, angle, 0.0, 0.0)
    v_o = feedback_voltage(angle, given.potentiometer_feedback_gain,
                           either(given.potentiometer_feedback_offset, 0.0)) + error
    step = given.potentiometer_quantisation
    return Sensor(0.0, quantised(v_o, step) if is_given(step) else v_o, 0.0, 0.0)


def pack_pulsed(given: Given, error: float) -> Sensor:
    """Return all numbers of a servo's potentiometer; `error` is that of its table at the angle where it stands [V]."""
    if stands(given):
        return pack_standing(given, error)
    return Sensor(given.potentiometer_feedback_gain, either(given.potentiometer_feedback_offset, 0.0),
                  0.5 * either(given.potentiometer_backlash, 0.0), either(given.potentiometer_quantisation, 0.0))


def pack_counted(given: Given, error: float) -> Sensor:
    """Return all numbers of the potentiometer, or the encoder, of a digital servo."""
    return NO_SENSOR if is_encoder(given) and not stands(given) else pack_pulsed(given, error)
