"""Commands that count from an end of the travel, as `servo.write(90)` does: zero and sign, found before a fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.survey.motion import motion_of
from servotwin.logs.column_words import SAID
from servotwin.models.standing import mid_travel
from servotwin.models.terms.wiring import TRAVEL_SLACK
from servotwin.units.words import unit_shown

if TYPE_CHECKING:
    from servotwin.logs.columns import Column
    from servotwin.logs.log import Log
    from servotwin.logs.reading import Reading
    from servotwin.models import Model

Array = NDArray[np.float64]

_CENTRES = (90.0, 135.0)  # deg: of servo.write, and of servos of 270 degrees
_CLEAR = 0.6  # correlation
_NEAR = 10.0  # deg: further from it no sketch counts


class Centred(NamedTuple):
    """Logs whose commands count from the middle of the travel, and what was found of those that did not."""

    logs: tuple[Log, ...]
    sentences: tuple[str, ...]
    turned: tuple[Log, ...]


def centred(logs: Sequence[Log], model: Model) -> Centred:
    """Return logs with zero and sign of servo.write put right.

    Only commands that the servo could not follow as they are, and can about its middle, are taken for such.

    Raises
    ------
    InputError
        If the servo cannot follow a command, whatever its zero: names file, row and degrees.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.logs import Log
    >>> time = 0.02 * np.arange(200.0)
    >>> command = np.radians(np.where(time % 2.0 < 1.0, 90.0, 150.0))
    >>> log = Log(name="a", time=time, command=command, command_kind="angle", measured={"output_angle": command})
    >>> centred([log], st.BoundedServo(st.load_servo("towerpro-mg996r"))).sentences[0].split(":")[1]
    ' commands of 90 to 150 deg count from an end of the travel, as servo.write does'
    """
    low, high = model.value_or("stops.lower_angle", -math.inf), model.value_or("stops.upper_angle", math.inf)
    made, turned, said = [], [], dict[str, list[str]]()
    for log in logs:
        if log.command_kind != "angle" or _inside(log.held, low, high):
            made.append(log)
            continue
        found = _about_the_middle(log, model, low, high)
        made.append(found.log)
        said.setdefault(found.sentence, []).append(repr(log.name))
        turned.append(found.log)
    sentences = tuple(f"log {names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {sentence}"
                      for sentence, names in said.items())
    return Centred(tuple(made), sentences, tuple(turned))


class _Found(NamedTuple):
    log: Log
    sentence: str


def _inside(angle: Array, low: float, high: float) -> bool:
    return bool(angle.min() >= low - TRAVEL_SLACK and angle.max() <= high + TRAVEL_SLACK)


def _about_the_middle(log: Log, model: Model, low: float, high: float) -> _Found:
    middle = mid_travel(model)
    own = float(np.degrees(log.held.min())), float(np.degrees(log.held.max()))
    for centre in _CENTRES:
        shift = middle - math.radians(centre)
        if own[0] >= -1e-6 and own[1] <= 2.0 * centre + 1e-6 and _inside(log.held + shift, low, high):
            break
    else:
        raise _refused(log, model, low, high)
    sign, offset, words = _angle(log, math.radians(centre), middle)
    measured = dict(log.measured)
    if log.angle_name == "output_angle":
        measured["output_angle"] = sign * measured["output_angle"] + offset
    at = "" if middle == 0.0 else f" ({math.degrees(middle):.4g} deg of the servo)"
    what = f"commands of {own[0]:.4g} to {own[1]:.4g} deg count" if own[1] > own[0] else (
        f"a command of {own[0]:.4g} deg counts")
    sentence = (f"{what} from an end of the travel, as servo.write does: {centre:g} deg is taken for its "
                f"middle{at}{words}")
    moved = replace(log, command=log.command + shift, measured=measured, reading=_reading(log, shift, sign, offset))
    return _Found(moved, sentence)


def _angle(log: Log, centre: float, middle: float) -> tuple[float, float, str]:  # sign, offset [rad], words
    """Return how the measured angle becomes one about the middle: its sign, and where it stands at the centre."""
    motion = motion_of(log)
    if log.angle_name != "output_angle" or not abs(motion.correlation) > _CLEAR:
        return 1.0, 0.0, "; the angle stays as it is: it does not tell its zero"
    sign = math.copysign(1.0, motion.gain)
    there = math.degrees(motion.gain * (centre - motion.zero))  # what it measures at the centre
    known = (0.0, math.degrees(centre), math.degrees(middle))
    near = min(known, key=lambda one: abs(one - there))
    there = near if abs(near - there) < _NEAR else round(there, 1)
    turned = ", and counts against the command" if sign < 0.0 else ""
    return sign, middle - sign * math.radians(there), f"; the angle is {there:g} deg there{turned}"


def _reading(log: Log, shift: float, sign: float, offset: float) -> Reading | None:
    """Return how the log was read, with what a sidecar has to say of zero and sign."""
    if log.reading is None:
        return None
    layout = dict(log.reading.layout)
    for name, change in (("command_angle", (1.0, shift)), ("output_angle", (sign, offset))):
        if name in layout:
            layout[name] = _moved(layout[name], *change)
    columns = tuple(replace(one, unit=unit_shown(here.unit, here.scale, here.offset), known=SAID) if (
        here := layout.get(one.signal)) is not None and here != log.reading.layout[one.signal] else one
        for one in log.reading.columns)
    return replace(log.reading, layout=layout, columns=columns)


def _moved(column: Column, sign: float, offset: float) -> Column:
    more = math.degrees(offset) if column.unit == "deg" else offset
    return replace(column, scale=sign * column.scale, offset=round(sign * column.offset + more, 9) + 0.0)


def _refused(log: Log, model: Model, low: float, high: float) -> InputError:
    """Return the error of a log whose commands the servo cannot follow: where they leave the travel by most."""
    middle = mid_travel(model)
    own = np.degrees(log.held)
    centre = next((one for one in _CENTRES if own.min() >= -1e-6 and own.max() <= 2.0 * one + 1e-6
                   and own.max() > math.degrees(high)), None)
    shift = 0.0 if centre is None else middle - math.radians(centre)
    k = int(np.argmax(np.maximum(low - log.held - shift, log.held + shift - high)))
    counted = "" if centre is None else f", which is {math.degrees(log.held[k] + shift):.4g} deg about its middle"
    file = f"log {log.name!r}" if log.reading is None else log.reading.file
    return InputError(f"{file}: row {k + 1} ({log.time[k]:.4g} s), command", got=f"{own[k]:.4g} deg{counted}",
                      allowed=f"{math.degrees(low):.4g} to {math.degrees(high):.4g} deg, the travel of "
                      f'{model.servo.name}; --columns "command=COLUMN:deg-90" moves the zero of a command')
