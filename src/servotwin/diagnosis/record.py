"""What a symptom is looked for in: a run, or a log, as target, angle and a few numbers of the end."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.simulation.rest import LEAST_REST, swing_of

if TYPE_CHECKING:
    from servotwin.logs import Log
    from servotwin.models import Model
    from servotwin.simulation import Rest
    from servotwin.simulation.watched_run import WatchedRun

Array = NDArray[np.float64]

SIGNALS = ("command_angle", "output_angle", "armature_current")
LOOK = 2e-3  # s between two looks at a run
_MEAN = 0.1  # s over which an angle at the end of a stretch is averaged
_ALIKE = 0.3  # correlation of neighbouring samples of a shaft that swings, at least
_TRIPS = "trips by "  # begins the events of a protection


class Hold(NamedTuple):
    """A stretch in which the target stands still for half a second or more.

    Parameters
    ----------
    way : float
        From the target before to this one; 0 of the first [rad].
    before, final : float
        Angle at the end of what was before, and at its own end [rad].
    target : float
        [rad].
    highest : float
        How far beyond `final` the shaft went, in the sense of the way [rad].
    """

    way: float
    before: float
    final: float
    target: float
    highest: float


class Record(NamedTuple):
    """A run or a log.

    Parameters
    ----------
    holds : tuple of Hold
    finest : float
        Angle that the servo is not asked to tell from another: its deadband of full width, but none wider than usual,
        or its count [rad].
    rest : Rest, optional
        Of a run, how the servo drives at its end; None where command or load move there.
    swing : float
        From end to end, of a shaft that does not come to rest; nan where that cannot be told [rad].
    heat : float
        Mean of i² R in the second half; nan where no current was measured [W].
    tripped : float
        Share of the time since a protection has acted first; 0 where none has; nan of a log [1].
    trip : str
        By what.
    """

    holds: tuple[Hold, ...]
    finest: float
    rest: Rest | None
    swing: float
    heat: float
    tripped: float
    trip: str = ""


def of_run(run: WatchedRun, finest: float) -> Record:
    """Return what a run shows that was looked at at times of `looked_at`, of a servo that tells so much apart [rad]."""
    end = run.ended
    time = looked_at(end)
    target, angle = run.at("command_angle", time), run.at("output_angle", time)
    rest, current = run.rest, run.at("armature_current", time[time >= 0.5 * end])
    first = next((event for event in run.events if event.kind.startswith(_TRIPS)), None)
    return Record(
        holds=holds_of(time, target, angle), finest=finest, rest=rest,
        swing=math.nan if rest is None else rest.swing,
        heat=float(np.mean(current**2)) * run.model.value("motor.armature_resistance"),
        tripped=0.0 if first is None else (end - first.time) / end,
        trip="" if first is None else first.kind.removeprefix(_TRIPS))


def looked_at(duration: float) -> Array:
    """Return when a run is looked at [s]."""
    return np.arange(0.0, duration, LOOK)


def of_log(log: Log, model: Model, target: Array, finest: float) -> Record:
    """Return what a log shows; `target` is the angle that each of its commands asks `model` for [rad]."""
    time, angle = log.time - log.start, angle_of(log, model)
    there = np.isfinite(angle)
    time, target, angle = time[there], target[there], angle[there]
    holds, swing = stretches(time, target), math.nan
    if holds and holds[-1][1] == len(time):
        last = slice(*holds[-1])
        swing = swing_of(time[last], angle[last]).swing if not _is_noise(angle[last]) else 0.0
    heat = math.nan
    if "armature_current" in log.measured:
        current = log.measured["armature_current"][log.time >= log.start + 0.5 * log.duration]
        heat = float(np.nanmean(current**2)) * model.value("motor.armature_resistance")
    return Record(holds_of(time, target, angle), finest, None, swing, heat, math.nan)


def _is_noise(angle: Array) -> bool:
    """Tell whether neighbouring samples of a shaft that is held say nothing of each other, unlike those of a swing.

    Examples
    --------
    >>> t = np.arange(0.0, 2.0, 0.02)
    >>> _is_noise(np.sin(50.0 * t)), _is_noise(np.random.default_rng(0).normal(size=100))
    (False, True)
    """
    late = angle[len(angle) // 2:]  # what comes before may still be on its way, and the rest creep
    place = np.arange(len(late))
    off = late - np.polyval(np.polyfit(place, late, 2), place)
    power = float(off @ off)
    return power > 0.0 and float(off[1:] @ off[:-1]) < _ALIKE * power


def angle_of(log: Log, model: Model) -> Array:
    """Return the angle that a log measured, nan where it did not [rad]."""
    name = log.angle_name
    values = np.where(log.used(name), log.measured[name], np.nan)
    if name == "output_angle":
        return values
    return np.asarray((values - model.value("potentiometer.feedback_offset"))
                      / model.value("potentiometer.feedback_gain"))


def stretches(time: Array, target: Array) -> list[tuple[int, int]]:
    """Return first and one past the last sample of each stretch in which a target stands still for half a second.

    Examples
    --------
    >>> stretches(np.array([0.0, 0.2, 0.3, 0.6, 0.9]), np.array([0.0, 0.0, 1.0, 1.0, 1.0]))
    [(2, 5)]
    """
    bounds = [0, *(np.flatnonzero(np.diff(target) != 0.0) + 1).tolist(), len(time)]
    return [(a, b) for a, b in pairwise(bounds)
            if b - a >= 2 and time[b - 1] - time[a] >= LEAST_REST]


def holds_of(time: Array, target: Array, angle: Array) -> tuple[Hold, ...]:
    """Return the stretches in which a target [rad] stands still, and where the shaft was there."""
    found: list[Hold] = []
    for a, b in stretches(time, target):
        final = float(angle[a:b][time[a:b] >= time[b - 1] - _MEAN].mean())
        before, from_target = (found[-1].final, found[-1].target) if found else (float(angle[0]), float(target[0]))
        way = float(target[a]) - from_target
        highest = max(0.0, float((math.copysign(1.0, way) * (angle[a:b] - final)).max()))
        found.append(Hold(way, before, final, float(target[a]), highest))
    return tuple(found)
