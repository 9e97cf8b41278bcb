"""A servo as the page's kernel takes it: its record, computed by the same models as everywhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from servotwin import signals
from servotwin.errors import ServotwinError
from servotwin.models import DigitalServo
from servotwin.models.base import KINDS
from servotwin.models.engine.live.posts import NONE_BEFORE, Follow, Post
from servotwin.models.engine.live.screen import Lines
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.state.records import put_fields, record_of
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.chip import NO_CHIP
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.signals.signal import KINDS as KINDS_OF_UNITS
from servotwin.units import factor

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model

_POSSIBLE = {"us": tuple(range(100, 5000, 50)), "deg": tuple(range(-360, 361, 5)),
             "V": tuple(0.1 * k for k in range(-60, 61))}  # commands, of which every servo takes some


def lines_of(model: Model) -> Lines:
    """Return how what a model follows stands for commands.

    Examples
    --------
    >>> import servotwin as st
    >>> lines = lines_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> lines.per_width, lines.width, lines.reduction
    (1.0, 0.0, 320.0)
    """
    both = [_line(model, name) for name in KINDS]
    reduction = model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0
    return Lines(*(number for line in both for number in line), reduction)


def _line(model: Model, name: str) -> tuple[float, float]:
    """Return slope and value at 0 of a command over what the model follows; 0 where it has none."""
    if name not in model.available:
        return 0.0, 0.0
    at = model.command_signal(name, np.array([0.0, 1.0]))
    return float(at[1] - at[0]), float(at[0])


def pulsed(model: Model) -> bool:
    """Tell whether a model hears pulses."""
    return isinstance(model, SwitchedServo) and not (isinstance(model, DigitalServo) and model.takes_goals)


def post_of(model: Model, load: Load, seed: int = 0) -> Post:
    """Return a servo at a bench, which has been told nothing yet."""
    ends = [model.start_angle(drive) for drive in _extremes(model)]
    return Post(
        numbers=model.pack(load), chip=model.chip() or NO_CHIP, lines=lines_of(model), width=follow_of(model, "us"),
        angle=follow_of(model, "deg"), voltage=follow_of(model, "V"), was=NONE_BEFORE,
        lowest=min(ends), highest=max(ends), torque=load.torque, push=0.0, accuracy=ACCURACY, seed=seed,
        pulsed=int(pulsed(model)), changed=1, command_first=0, command_count=0, curve_first=0, curve_count=0, heard=0)


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
    far = 1e6  # rad
    gain, offset = lines_of(model).per_angle, lines_of(model).angle
    return ((-far - offset) / gain, (far - offset) / gain) if gain else (-math.inf, math.inf)


def packed_post(model: Model, load: Load) -> bytes:
    """Return the record of a servo, and behind it that of its program."""
    post, program = np.zeros(1, record_of(Post)), np.zeros(1, record_of(Firmware))
    put_fields(post[0], post_of(model, load))
    put_fields(program[0], model.firmware() or NO_FIRMWARE)
    return post.tobytes() + program.tobytes()
