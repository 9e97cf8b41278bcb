"""The pulses of a log: when they come, and which command each of them carries.

A generator sends a pulse every frame; a command acts from the next pulse on. A log tells when commands were given, on a
clock of its own, and nothing of the pulses. Their phase is therefore two things: a time, in which the motion is smooth,
and an assignment of commands to pulses, which jumps wherever a command and the edge of a pulse pass each other.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.point import Frames
from servotwin.logs.log import KINDS, Log
from servotwin.models import BoundedServo, DigitalServo, Model
from servotwin.signals.shapes import held_pulses, sampled

if TYPE_CHECKING:
    from servotwin.signals import Signal

Array = NDArray[np.float64]

_EDGE = 1e-9  # of a frame: a command so close to an edge is at it
_NARROW = 1e-6  # s: stamps do not tell commands apart that are nearer


class Gap(NamedTuple):
    """Phases from `low` to `high` [s] for which every pulse carries the same command; high − low is at most a frame."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """The phase that is farthest from both ends [s]."""
        return 0.5 * (self.low + self.high)

    @property
    def width(self) -> float:
        """How far apart its ends are [s]."""
        return self.high - self.low


def has_pulses(model: Model) -> bool:
    """Tell whether commands reach a model as pulses: not the mean voltage of the bounded servo, nor goals on a bus."""
    return not isinstance(model, BoundedServo) and not (isinstance(model, DigitalServo) and model.takes_goals)


def changes(log: Log) -> Array:
    """Return when the command changes by a jump, or pulses begin or end, from the first sample [s].

    Examples
    --------
    >>> log = Log(name="a", time=[1.0, 1.1, 1.2], command=[0.0, 0.5, 0.5], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.1, 0.5]})
    >>> [round(float(t), 3) for t in changes(log)]
    [0.1]
    """
    if log.command_hold != "previous":
        return np.zeros(0)
    return np.asarray(log.time[log.changes] - log.time[0])


def gaps(log: Log, period: float) -> tuple[Gap, ...]:
    """Return the phases between which the assignment of commands to pulses jumps, in the order of their low ends.

    Examples
    --------
    >>> log = Log(name="a", time=[0.0, 0.1, 0.205, 0.3], command=[0.0, 0.5, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.1, 0.5, 1.0]})
    >>> [(round(gap.low, 4), round(gap.high, 4)) for gap in gaps(log, 0.02)]
    [(0.0, 0.005), (0.005, 0.02)]
    """
    return between(changes(log), period)


def between(times: Array, period: float) -> tuple[Gap, ...]:
    """Return the phases of a beat at which none of some times lies, in the order of their low ends."""
    residues = np.sort(np.mod(times, period))
    residues[residues > period * (1.0 - _EDGE)] = 0.0
    residues = np.unique(residues)
    if not len(residues):
        return (Gap(0.0, period),)
    ends = np.append(residues[1:], residues[0] + period)
    wide = ends - residues > min(_NARROW, 0.5 * float((ends - residues).max()))
    return tuple(Gap(float(low), float(high)) for low, high in zip(residues[wide], ends[wide], strict=True))


def widest(log: Log, period: float) -> Frames:
    """Return the frames in which commands are farthest from the edges of pulses."""
    return Frames(max(gaps(log, period), key=lambda gap: gap.width).middle, period)


def gap_of(log: Log, frames: Frames) -> Gap:
    """Return how far the phase of some frames could go with the same assignment [s].

    The low end is in it; the high end is the first phase at which a command comes a pulse earlier.
    """
    residues = np.mod(changes(log), frames.period)
    if not len(residues):
        return Gap(frames.phase - 0.5 * frames.period, frames.phase + 0.5 * frames.period)
    back = np.mod(frames.phase - residues + _EDGE * frames.period, frames.period)
    ahead = np.mod(residues - frames.phase - _EDGE * frames.period, frames.period)
    return Gap(frames.phase - float(back.min()), frames.phase + float(ahead.min()))


def latency(log: Log, frames: Frames) -> float:
    """Return how long a command waits in the mean for its pulse, if pulses come at phase + k · period [s]."""
    times = changes(log)
    if not len(times):
        return 0.0
    k = np.ceil((times - frames.phase) / frames.period - _EDGE)
    return float(np.mean(frames.phase + k * frames.period - times))


def near_edges(log: Log, one: Frames, other: Frames) -> Array:
    """Return when the commands were given that two assignments put into different pulses [s, on the log's clock]."""
    times = changes(log)
    which, also = (np.ceil((times - frames.phase) / frames.period - _EDGE) for frames in (one, other))
    shift = np.median(also - which) if len(times) else 0.0
    return np.asarray(times[also - which != shift] + log.time[0])


def signal(log: Log, frames: Frames, first: float, period: float, lead: float = 0.0) -> Signal:
    """Return the command of a log as pulses: the edges at first + k · period, k from −∞ on, carry those of `frames`.

    Its t = 0 is the first sample, or by `lead` earlier [s], later where that is negative, from when on it is the first
    command. A command that is
    linear between samples is read at the edges themselves.
    """
    least = math.ceil(-(first + lead) / period - _EDGE)
    k = np.arange(least, least + max(math.ceil((log.duration + lead) / period), 0) + 2)
    edges = np.maximum(first + lead + k * period, 0.0)
    time = log.time - log.time[0]
    asked = frames.phase + k * frames.period
    latest = np.maximum(np.searchsorted(time, asked + _EDGE * frames.period, side="right") - 1, 0)
    unit = KINDS[log.command_kind]
    if log.command_hold == "previous":
        # Half a frame early, so that an edge that moves a little carries the same
        return held_pulses(edges - 0.5 * period, log.held[latest], edges[log.sent[latest]], unit=unit,
                           initial=float(log.held[0]))
    made = sampled(time + lead, log.held, unit=unit, hold=log.command_hold)
    return replace(made, initial=float(log.held[0]), edges=tuple(edges[log.sent[latest]].tolist()))
