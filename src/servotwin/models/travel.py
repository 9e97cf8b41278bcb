"""Where the travel of a servo has its middle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin import signals
from servotwin.errors import InputError
from servotwin.models.digital import DigitalServo

if TYPE_CHECKING:
    from servotwin.models.base import Model

_NEUTRAL = 1500.0  # us


def mid_travel(model: Model) -> float:
    """Return the angle in the middle of a servo's travel.

    Parameters
    ----------
    model : Model
        Of a servo; a motor has no travel.

    Returns
    -------
    float
        Half-way between the end stops; where the servo lacks one, the angle of a pulse of 1500 us, and on a bus that
        of the goal 0, the middle of its counts [rad].

    Raises
    ------
    InputError
        If the model is that of a motor.

    Examples
    --------
    >>> import math, servotwin as st
    >>> round(math.degrees(mid_travel(st.PulseServo(st.load_servo("hitec-hs-755hb")))), 9)
    90.0
    """
    if "command_angle" not in model.signals:
        raise InputError(f"middle of the travel of {type(model).__name__}",
                         allowed="a model of a servo, not of a motor")
    lower, upper = model.servo.stops.lower_angle, model.servo.stops.upper_angle
    if lower is not None and upper is not None:
        return 0.5 * (lower + upper)
    if isinstance(model, DigitalServo) and model.takes_goals:
        return float(model.start_angle(0.0))
    return float(model.start_angle(model.command(signals.constant(_NEUTRAL, unit="us")).table[0].value))
