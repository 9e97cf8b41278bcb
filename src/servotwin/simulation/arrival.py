"""When a shaft has arrived where a step sends it: how near, measured by the step and by what the servo resolves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive
from servotwin.physics.electronics import control_voltage_from_pulse
from servotwin.physics.potentiometer import angle_from_voltage

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.physics._typing import Real

_SHARE = 0.05  # of the step
_STEPS = 2.0  # deadbands or counts, whichever is wider
_NEAR = math.radians(1.0)  # a degree, as far as the step is long enough


def resolution(model: Model) -> Any:
    """Return within which angle a servo does not tell two apart: its deadband, of full width, or its count [rad].

    Of a model whose numbers are columns of lanes it is one.
    """
    if isinstance(model, DigitalServo):
        firmware = model.firmware()
        return np.maximum(firmware.quantum, 2.0 * firmware.h)
    p = model.value_or("potentiometer.feedback_gain", 0.0)
    if isinstance(model, BoundedServo):
        return angle_from_voltage(model.value_or("electronics.voltage_deadband", 0.0), p)
    if isinstance(model, PulseServo | PulseServoInductive):
        width = model.value_or("electronics.deadband", 0.0)
        return angle_from_voltage(control_voltage_from_pulse(width, model.value("electronics.one_shot_slope")), p)
    return 0.0


def tolerance(way: Real, finest: Real) -> Real:
    """Return how far from its target [rad] a shaft may end that has arrived.

    Parameters
    ----------
    way : float or array
        From where it stood to the target [rad].
    finest : float or array
        `resolution` of the servo [rad].

    Returns
    -------
    float or array
        5 % of the way, or two deadbands or counts where those are more.

    Examples
    --------
    >>> float(tolerance(-1.0, 0.001)), float(tolerance(0.01, 0.001))
    (0.05, 0.002)
    """
    return np.maximum(_SHARE * np.abs(way), _STEPS * finest)


def arrival_band(way: float, finest: float) -> float:
    """Return how near its target [rad] a shaft counts as being there: within 1°, or the tolerance of a small step.

    It is never more than half of the way. Parameters are those of `tolerance`.

    Examples
    --------
    >>> [round(math.degrees(arrival_band(math.radians(way), 0.0)), 3) for way in (90.0, 20.0, 3.0)]
    [1.0, 1.0, 0.15]
    """
    return float(min(_NEAR, tolerance(way, finest), 0.5 * abs(way)))
