"""Between what a page may tell a servo commands, by the names of the parameters that say so."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models import DigitalServo
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.frame import FRAME
from servotwin.models.terms.wiring import PULSE_RANGE, TRAVEL_SLACK

if TYPE_CHECKING:
    from servotwin.models import Model

_DEGREES = 180.0 / math.pi


def bounds_of(model: Model) -> dict[str, list[dict[str, Any]]]:
    """Return the bounds of commands by their units; a unit that is missing is none that the model takes.

    A bound is of what is commanded, or of the pulse that follows from it (SI). Its ends are numbers, or names of
    parameters with a number for where there is none. Its words may tell both ends, what was got, and the servo's name.

    Examples
    --------
    >>> import servotwin as st
    >>> sorted(bounds_of(st.DigitalServo(st.load_servo("feetech-sts3215-12v"))))
    ['deg']
    """
    goals = isinstance(model, DigitalServo) and model.takes_goals
    found: dict[str, list[dict[str, Any]]] = {}
    if not goals and ("pulse_width" in model.available):
        found["us"] = [*_positive(), *_pulses(model, accepted=not isinstance(model, SwitchedServo))]
    if "command_angle" in model.available:
        digital = isinstance(model, DigitalServo)
        found["deg"] = [*(_angles("the goals", "firmware.lower_goal", "firmware.upper_goal") if digital else ()),
                        *_angles("the travel", "stops.lower_angle", "stops.upper_angle"),
                        *(() if goals else _pulses(model, accepted=False))]
    if not goals and "command_voltage" in model.available:
        found["V"] = [*_pulses(model, accepted=False)]
    return found


def _positive() -> list[dict[str, Any]]:
    return [{"of": "command", "low": 0.0, "open": True, "factor": 1.0,
             "words": "pulse width: got {got}, allowed: a positive width [s]"}]


def _angles(which: str, low: str, high: str) -> list[dict[str, Any]]:
    return [{"of": "command", "low": [low], "high": [high], "slack": TRAVEL_SLACK, "factor": _DEGREES,
             "words": f"angle command: got '{{got}} deg', allowed: {{low}} to {{high}} deg, {which} of {{name}}"}]


def _pulses(model: Model, *, accepted: bool) -> list[dict[str, Any]]:
    if accepted:
        return [{"of": "command", "low": ["electronics.pulse_width_min", PULSE_RANGE[0]],
                 "high": ["electronics.pulse_width_max", PULSE_RANGE[1]], "factor": 1e6,
                 "words": "pulse width, piece {piece} of the command (from {start} s on): got '{got} us', allowed: "
                          "{low} to {high} us, the pulses that {name} accepts"}]
    if not isinstance(model, SwitchedServo):
        return []
    return [{"of": "pulse", "low": 0.0, "high": ["electronics.frame_period", FRAME], "open": True, "factor": 1e6,
             "words": "pulse width: got '{got} us', allowed: more than 0 us and less than a frame of {high} us"}]
