"""A servo as the page's kernel takes it: its record, computed by the same models as everywhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin import signals
from servotwin.errors import ServotwinError
from servotwin.models import DigitalServo
from servotwin.models.engine.live.posts import NONE_BEFORE, NOTHING_SAID, Follow, Post
from servotwin.models.engine.live.screen import NO_LOW
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.frame import NO_CHIP
from servotwin.signals.signal import KINDS as KINDS_OF_UNITS
from servotwin.units import factor
from servotwin.web.live.station import lines_of

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model

_POSSIBLE = {"us": tuple(range(100, 5000, 50)), "deg": tuple(range(-360, 361, 5)),
             "V": tuple(0.1 * k for k in range(-60, 61))}  # commands, of which every servo takes some


def pulsed(model: Model) -> bool:
    """Tell whether a model hears pulses."""
    return isinstance(model, SwitchedServo) and not (isinstance(model, DigitalServo) and model.takes_goals)


def post_of(model: Model, load: Load, seed: int = 0) -> Post:
    """Return a servo at a bench, which has been told nothing yet."""
    ends = [angle if abs(angle) < 1e299 else math.copysign(math.inf, angle)
            for angle in map(model.start_angle, _extremes(model))]
    return Post(
        numbers=model.pack(load), chip=model.chip() or NO_CHIP, lines=lines_of(model), width=follow_of(model, "us"),
        angle=follow_of(model, "deg"), voltage=follow_of(model, "V"), was=NONE_BEFORE, low=NO_LOW,
        lowest=min(ends), highest=max(ends), torque=load.torque, push=0.0, sent=0.0, accuracy=ACCURACY, seed=seed,
        pulsed=int(pulsed(model)), changed=1, command_first=0, command_count=0, curve_first=0, curve_count=0, heard=0,
        said=NOTHING_SAID, zone=0, contact=0, mesh=0, motor=0, share=0, row=0)


def follow_of(model: Model, unit: str) -> Follow:
    """Return how a model follows commands in a unit: a straight line through two that it takes."""
    found = []
    for value in _POSSIBLE[unit]:
        try:
            found.append((value, model.command(signals.constant(value, unit=unit)).table[0].value))
        except ServotwinError:
            continue
    if len(found) < 2:
        return Follow(0.0, 0.0)
    (x, y), (x_other, y_other) = found[0], found[-1]
    si = factor(unit, KINDS_OF_UNITS[unit][1])
    gain = (y_other - y) / (x_other - x) / si
    return Follow(gain, y - gain * si * x)


def _extremes(model: Model) -> tuple[float, float]:
    """Return what a model follows where it asks for angles far beyond all stops."""
    far = 1e300  # rad
    gain, offset = lines_of(model).per_angle, lines_of(model).angle
    return ((-far - offset) / gain, (far - offset) / gain) if gain else (-math.inf, math.inf)
