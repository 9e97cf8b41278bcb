"""The step that an angle shows where nobody logged the command."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.columns import Column
from servotwin.tables import TextTable

_SHARE = 0.05  # of the rows, that are the begin and the end of a log
_LEAST = math.radians(5.0)
_STRAYS = 0.05  # of the way, by which noise may go back
_BEYOND = 0.25  # of the way: what a shaft overshoots


class Step(NamedTuple):
    """A step of the angle [rad]."""

    before: float
    after: float

    @property
    def command(self) -> str:
        """What `--commanded` says of it: the command came with the first row, or before it."""
        return f"{math.degrees(self.after):.4g}deg@0s"

    @property
    def words(self) -> str:
        """From where to where."""
        return f"from {math.degrees(self.before):.4g} to {math.degrees(self.after):.4g} deg"


def step_of(table: TextTable, made: Mapping[str, tuple[Column, str]]) -> Step | None:
    """Return the one step that the angle of a table shows; None where it has no angle, or another motion."""
    if "output_angle" not in made:
        return None
    column = made["output_angle"][0]
    try:
        return step_in(column.to_si(table.numbers(column.column, missing=math.nan), "output_angle"))
    except InputError:
        return None


def step_in(angle: NDArray[np.float64]) -> Step | None:
    """Return the one step of an angle, None where the motion is another one.

    Examples
    --------
    >>> step = step_in(np.radians(np.interp(np.arange(100.0), [0.0, 20.0, 60.0, 99.0], [0.0, 0.0, 90.0, 90.0])))
    >>> step.words, step.command
    ('from 0 to 90 deg', '90deg@0s')
    >>> step_in(np.sin(np.arange(100.0))) is None
    True
    """
    angle = angle[np.isfinite(angle)]
    few = max(3, int(_SHARE * len(angle)))
    if len(angle) < 4 * few:
        return None
    before, after = float(np.median(angle[:few])), float(np.median(angle[-few:]))
    way = after - before
    last = angle[-2 * few:]
    if abs(way) < _LEAST or abs(np.median(last[:few]) - after) > _STRAYS * abs(way):  # it moves on
        return None
    gone = (angle - before) / way  # 0 to 1
    arrived = int(np.argmax(gone >= 1.0 - _STRAYS)) if (gone >= 1.0 - _STRAYS).any() else len(gone) - 1
    back = float((np.maximum.accumulate(gone[:arrived + 1]) - gone[:arrived + 1]).max())
    settled = gone[arrived:]
    if back > _STRAYS or settled.min() < 1.0 - _BEYOND or settled.max() > 1.0 + _BEYOND:
        return None
    return Step(before, after)
