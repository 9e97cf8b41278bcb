"""Which model stands for a servo where none is named."""

from __future__ import annotations

import warnings

from servotwin.models.base import Model
from servotwin.models.bounded import BoundedServo
from servotwin.models.digital import DigitalServo
from servotwin.models.pulse import PulseServo
from servotwin.parameters import Servo

_FIRMWARE = ("firmware.control_period", "firmware.proportional_gain")
_CHIP = ("electronics.stretcher_gain", "electronics.one_shot_slope")


def default_class(servo: Servo) -> type[Model]:
    """Return the class of the model that stands for a servo where none is named.

    It follows the servo's `kind`: `PulseServo` for an analog servo, `DigitalServo` for a digital or bus servo, which is
    computed as an analog one where its file has no firmware. Where the file says nothing of a chip either it is
    `BoundedServo`.

    Parameters
    ----------
    servo : Servo

    Warns
    -----
    UserWarning
        If the model is another than the servo's kind asks for: it says which, and why.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> default_class(load_servo("hitec-hs-755hb")).__name__
    'PulseServo'
    """
    if servo.kind != "analog":
        absent = [name for name in _FIRMWARE if servo.get(name) is None]
        if not absent:
            return DigitalServo
        a = "a digital servo" if servo.kind == "digital" else "a bus servo"
        warnings.warn(f"{servo.name} is {a} whose file has no firmware ({', '.join(absent)} not given): computed as an "
                      "analog one", stacklevel=3)
    lacks = [name for name in _CHIP if servo.get(name) is None]
    turns = servo.get("potentiometer.fixed_angle") is not None  # which no mean-voltage servo follows
    if lacks and not turns and all(servo.get(name) is not None for name in BoundedServo.requires):
        warnings.warn(f"{servo.name} has no chip ({', '.join(lacks)} not given): computed as a bounded servo, with the "
                      "mean voltage of its pulses", stacklevel=3)
        return BoundedServo
    return PulseServo


def default_model(servo: Servo) -> Model:
    """Return the model that stands for a servo where none is named, of the class that `default_class` returns.

    Parameters
    ----------
    servo : Servo

    Raises
    ------
    MissingParameterError
        If the servo lacks what the model requires.

    Warns
    -----
    UserWarning
        As of `default_class`.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> default_model(load_servo("hitec-hs-755hb"))
    PulseServo('hitec-hs-755hb')
    """
    return default_class(servo)(servo)
