"""What a servo on a bus is told at which tick of an experiment."""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import NamedTuple

from servotwin.bench.bus.families import BusFamily, count_of
from servotwin.bench.recording.experiment import Experiment
from servotwin.errors import InputError

_KIND = "angle"


class Order(NamedTuple):
    """What holds at a tick.

    Parameters
    ----------
    goal : int or None
        [counts]; None: torque off.
    number : tuple of int
        Of the order; a new one is to be written.
    """

    goal: int | None
    number: tuple[int, int]


class Goals:
    """An experiment in ticks and counts.

    Parameters
    ----------
    experiment : Experiment
    family : BusFamily
    limits : tuple of int
        Lowest and highest goal that the servo takes [counts].
    rate : float
        Of the ticks [Hz].

    Raises
    ------
    InputError
        If it commands no angles, or more than the servo takes.
    """

    def __init__(self, experiment: Experiment, family: BusFamily, limits: tuple[int, int], rate: float) -> None:
        if experiment.kind != _KIND:
            raise InputError(f"experiment {experiment.name!r}", got=f"commands of {experiment.kind}", allowed=_KIND)
        self._counts = [None if one.value is None else goal_of(family, limits, one.value) for one in experiment.holds]
        self._frames = [max(1, round((one.frame_period or experiment.frame_period) * rate)) for one in experiment.holds]
        lengths = [max(1, round(one.duration * rate)) for one in experiment.holds]
        self._starts = [0, *accumulate(lengths)]

    @property
    def ticks(self) -> int:
        """How many there are."""
        return self._starts[-1]

    def at(self, tick: int) -> Order:
        """Return what holds at a tick; behind the end the last goal stays."""
        hold = min(bisect_right(self._starts, tick), len(self._counts)) - 1
        return Order(self._counts[hold], (hold, (tick - self._starts[hold]) // self._frames[hold]))


def goal_of(family: BusFamily, limits: tuple[int, int], angle: float) -> int:
    """Return an angle [rad] as a goal [counts].

    Raises
    ------
    InputError
        If the servo does not take it.
    """
    goal = count_of(family, angle)
    if not limits[0] <= goal <= limits[1]:
        low, high = (round((count - family.middle) * family.count, 1) for count in limits)
        raise InputError("goal of the servo", got=f"{(goal - family.middle) * family.count:.1f} deg",
                         allowed=f"{low:g} to {high:g} deg, the limits in its registers")
    return goal
