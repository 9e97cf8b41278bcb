"""What the page as one file says, and the bounds of what servos can be told there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models import DigitalServo
from servotwin.models.base import PULSE_RANGE, TRAVEL_SLACK
from servotwin.web.alone.posts import follow_of, pulsed

if TYPE_CHECKING:
    from servotwin.models import Model

ONLY_WITH_SERVER = "only with the server: servotwin web"
WORDS = {
    "alone": "This bench computes here, without a server. Only with one (servotwin web): fits, other numbers of a servo, "
             "registers, mystery servos, logs and tables.",
    "only_with_server": ONLY_WITH_SERVER,
    "stands": "the bench stands: ",
    "repeating": "action: got 'while the bench is being repeated', allowed: a moment later",
    "no_single_frame": "single frame: got 'a bench that is being repeated', allowed: one that stands",
    "new_beginning": "bench: got {got}, allowed: a new beginning",
    "speed": "speed: got {got}, allowed: a number from 1e-06 to 10, or unpaced",
    "unknown_servo": "unknown servo {got}",
    "unknown_lesson": "unknown lesson {got}",
    "no_such_model": "unknown model {got}",
    "no_such_command": "command of {id}: allowed: none of this unit",
    "no_torque_switch": "torque: got {got}, allowed: nothing: no servo here has such a switch",
    "too_many_actions": "record of the bench: got '100000 actions', allowed: no more: start it anew",
}
"""Messages by their names; {got} is what was given."""


def bounds_of(model: Model) -> dict[str, list[dict[str, Any]]]:
    """Return between what commands may be, by their units; a unit that is missing is none that the model takes."""
    return {unit: _bounds(model, unit) for unit in ("us", "deg", "V") if follow_of(model, unit).gain != 0.0}


def _bounds(model: Model, unit: str) -> list[dict[str, Any]]:
    found = []
    name = model.servo.name
    if unit == "deg":
        goals = isinstance(model, DigitalServo)
        for which, low, high in ((("the goals", "firmware.lower_goal", "firmware.upper_goal"),) if goals else ()) + (
                ("the travel", "stops.lower_angle", "stops.upper_angle"),):
            ends = model.value_or(low, -math.inf), model.value_or(high, math.inf)
            if max(map(math.isfinite, ends)):
                shown = " to ".join(f"{math.degrees(end):.6g}" for end in ends)
                found.append(_bound("command", ends[0] - TRAVEL_SLACK, ends[1] + TRAVEL_SLACK, 180.0 / math.pi,
                                    f"angle command: got '{{got}} deg', allowed: {shown} deg, {which} of {name}"))
    if pulsed(model):
        period = model.frame_period  # type: ignore[attr-defined]
        found.append(_bound("pulse", 0.0, period, 1e6, "pulse width: got '{got} us', allowed: more than 0 us and less "
                            f"than a frame of {1e6 * period:.6g} us", open_=True))
    elif unit == "us":
        ends = tuple(model.value_or(f"electronics.pulse_width_{end}", usual)
                     for end, usual in zip(("min", "max"), PULSE_RANGE, strict=True))
        shown = " to ".join(f"{1e6 * end:.6g}" for end in ends)
        found.append(_bound("command", *ends, 1e6, "pulse width: got '{got} us', allowed: "
                            f"{shown} us, the pulses that {name} accepts"))
    return found


def _bound(of: str, low: float, high: float, factor: float, words: str, open_: bool = False) -> dict[str, Any]:
    ends = {"low": low if math.isfinite(low) else -1e300, "high": high if math.isfinite(high) else 1e300}
    return {"of": of, **ends, "open": open_, "factor": factor, "words": words}
