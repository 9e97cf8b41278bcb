"""Time stamps that lie off the beat of the others, and rows that are missing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.beat import Beat, beat_of
from servotwin.identification.fitting.suspicions.look import Finding, Look, Mask, said_times

_TELLS = 4.0  # times the noise, by which stamp and beat have to differ in angle
_WRONG_VOTES = 0.25  # of angles that differ so far, fit the beat better by chance at most, if the stamps are right
_CHANCE = 0.02  # of so many by chance: three of three are enough
_RUN = 2  # rows off in a row, in the mean
_FEWEST = 4  # rows on the beat
_SEEN = 6.0  # times the noise, that an unknown instant of a command has to matter
_NEAR = 10  # rows to either side
_USUAL = 0.8  # of their changes are at most usual
_SETTLED = 0.1  # s after a motion


def wrong_stamps(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs some of whose stamps lie off the beat, where the angles of all logs say that it is the stamps."""
    beats = [(one, beat) for one in looks if (beat := beat_of(one.log.time)) is not None and _single(beat.off)]
    votes = [_votes(one, beat) for one, beat in beats]
    tell = sum(vote.tell for vote in votes)
    if not tell:
        return []
    from scipy.special import bdtrc

    if bdtrc(sum(vote.beat for vote in votes) - 1, tell, _WRONG_VOTES) > _CHANCE:
        return []
    return [_restamped(one, beat) for (one, beat), vote in zip(beats, votes, strict=True) if 2 * vote.beat >= vote.tell]


def _single(off: Mask) -> bool:
    """Tell whether some rows are off, one or two at a time: longer runs are a clock whose beat changes."""
    begins = int(np.count_nonzero(np.diff(np.concatenate([[0], off.astype(int)])) > 0))
    return 0 < int(off.sum()) <= _RUN * begins


def _restamped(one: Look, beat: Beat) -> Finding:
    return Finding("stamps", one.log.name, (
        f"log {one.log.name!r}: {beat.off.sum()} of {len(one.time)} time stamps lie off the beat of the others, "
        f"{beat.period:.4g} s, by up to {np.abs(beat.place - one.log.time).max():.2g} s: "
        f"{said_times(one.log.time[beat.off])}; the angles fit the beat; mending \"stamps\" puts them on it"),
        replace(one.log, time=beat.place))


class _Votes(NamedTuple):
    """Rows whose angle tells stamp from beat, and those of them that fit the beat better."""

    tell: int
    beat: int


def _votes(one: Look, beat: Beat) -> _Votes:
    on = one.counts & ~beat.off
    rows = np.flatnonzero(one.counts & beat.off)
    if on.sum() < _FEWEST:
        return _Votes(0, 0)
    from scipy.interpolate import PchipInterpolator  # slow to load

    curve = PchipInterpolator(one.log.time[on], one.angle[on], extrapolate=False)
    by_stamp, by_beat = (np.abs(one.angle[rows] - curve(at[rows])) for at in (one.log.time, beat.place))
    tell = np.abs(by_stamp - by_beat) > _TELLS * one.noise  # nan, outside, is no
    return _Votes(int(tell.sum()), int((by_beat < by_stamp)[tell].sum()))


def missing_rows(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs in which a command changed while rows are missing: nobody knows when."""
    return [finding for one in looks for finding in _missing(one)]


def _missing(one: Look) -> list[Finding]:
    beat = beat_of(one.log.time)
    if beat is None or one.log.command_hold == "linear":
        return []
    steps = np.diff(beat.number)
    lost = int((steps - 1).sum())
    at = np.flatnonzero((steps > 1) & _matters(one, beat))
    if not len(at):
        return []
    windows = _left(one, at)
    stays = replace(one.log, left_out=(*one.log.left_out, *windows)) if _some_left(one, windows) else None
    return [Finding("rows", one.log.name, (
        f"log {one.log.name!r}: {lost} rows are missing, and the command changed meanwhile "
        f"{said_times(one.log.time[at])}: nobody knows when; mending \"rows\" leaves out the motions after"), stays)]


def _matters(one: Look, beat: Beat) -> Mask:
    """Tell for each step between rows whether the command's change in it, more than usual, would be seen if late."""
    change = np.abs(np.diff(one.asked))
    steps = np.diff(beat.number)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(np.where(steps == 1, change, 0.0), _NEAR), 2 * _NEAR + 1)
    usual = np.quantile(near, _USUAL, axis=1)  # of commands that change all the time, such as a sine
    late = (steps - 1) * beat.period
    return np.asarray(np.minimum(change - usual * steps, one.top_speed * late) > max(_SEEN * one.noise, 1e-9))


def _left(one: Look, at: NDArray[np.int64]) -> list[tuple[float, float]]:
    """Return the windows in which the motions after some rows take place [s]."""
    found: list[tuple[float, float]] = []
    for k in at.tolist():
        begin = float(one.log.time[k]) + 1e-9
        travel = abs(float(one.asked[k + 1] - one.angle[k])) if math.isfinite(one.angle[k]) else 0.0
        end = float(one.log.time[k + 1]) + travel / one.top_speed + _SETTLED
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found


def _some_left(one: Look, windows: Sequence[tuple[float, float]]) -> bool:
    """Tell whether half of what counts stays: else nothing is left to fit."""
    out = np.zeros(len(one.time), np.bool_)
    for start, stop in windows:
        out |= (one.log.time >= start) & (one.log.time < stop)
    return bool((one.counts & ~out).sum() > 0.5 * one.counts.sum())
