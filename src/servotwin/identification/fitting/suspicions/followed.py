"""Commands that the shaft did not follow: stretches in which it did as if it were not driven."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from servotwin.identification.fitting.suspicions.look import Array, Finding, Look, Mask

_BIN = 0.02  # s: a frame, and the bins that commands and speeds are averaged over
_AHEAD = 3  # bins, by which a speed is foretold
_PAST = 8  # bins before, whose commands may still act: delays up to 0.16 s
_FEWEST = 60  # bins
_SATURATES = (0.05, 0.1, 0.2, 0.5, 1.0)  # rad, errors at which the drive may be full; the best is taken
_ROUNDS = 10
_SETTLED = 0.01  # of the scale
_SIGMAS = 8.0
_FARTHER = 5.0  # times: of 624 healthy logs of the bench no habit was off by more than 4 times as much one way
_STRONG = 0.1  # of the speed without load: less drive says nothing
_HALF = 0.5
_SMALL = 0.1  # rad, a way on which friction and deadband may hold the shaft
_MOST = 0.6  # of a window's commands
_TOO_FAST = 2.0  # times the speed without load
_AROUND = 6  # bins
_LONG = 3  # bins in a row: an outlier gives one to either side
_STILL = 0.3  # s without motion, after a command that was to move
_DELAY = 0.1  # s, more than the delay of a servo and its bus
_LEAST = 0.2  # rad, a command that moves any servo
_SHARE = 0.3  # of the commanded span
_FOLLOWS = 0.5  # of the commanded span the shaft went through: else it is a soft servo that may stand still
_FORGOTTEN = 3.0  # times e: a twentieth is left of how far off it was
_MORE = 0.1  # s after an event, until the motion is as commanded


def not_followed(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs with stretches in which the shaft did not do what it was told, which are left out."""
    return [finding for one in looks for finding in _not_followed(one)]


def _not_followed(one: Look) -> list[Finding]:
    habit = _usual(one)
    windows = _joined([*(_against(one, habit) if habit else ()), *_standing(one)])
    if not windows:
        return []
    far = _joined([(start, _back(one, habit, stop)) for start, stop in windows]) if habit else windows
    # where nothing were left to fit, what follows stays; and all of it, if that is not enough
    mended = next((some for some in (far, windows) if _is_enough(one, some)), None)
    stays = None if mended is None else replace(one.log, left_out=(*one.log.left_out, *mended))
    said = ", ".join(f"{start:.4g} to {stop:.4g}" for start, stop in windows[:3])
    said += ", ..." if len(windows) > 3 else ""
    return [Finding("not followed", one.log.name, (
        f"log {one.log.name!r}: from {said} s the shaft does not follow its command, as if it got no pulses; look at "
        "wiring and supply; mending \"not followed\" leaves this out"), stays)]


def _is_enough(one: Look, windows: Sequence[tuple[float, float]]) -> bool:
    """Tell whether most of what counts lies outside some windows."""
    out = np.zeros(len(one.time), np.bool_)
    for start, stop in windows:
        out |= (one.log.time >= start) & (one.log.time < stop)
    return bool((one.counts & ~out).sum() > _HALF * one.counts.sum())


def _back(one: Look, habit: _Habit, stop: float) -> float:
    """Return when a shaft that was not driven until some time is where it would be if it had been [s].

    As long as the drive is full it goes as it would from anywhere, and stays as far off as it was. Once its commands
    are so near that the drive depends on where it is, that shrinks with the time that it takes to go so far at full
    speed.
    """
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    shrunk = 0.0
    for k in np.flatnonzero(time >= stop - one.log.start)[1:]:
        before = asked[(time > time[k] - _DELAY) & (time <= time[k])]
        if (np.abs(before - angle[k]) < habit.full_at).all():
            shrunk += (time[k] - time[k - 1]) * one.top_speed / habit.full_at
        if shrunk > _FORGOTTEN:
            return float(time[k] + one.log.start)
    return float(one.log.time[-1] + _BIN)


def _joined(windows: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    for start, stop in sorted(windows):
        if found and start <= found[-1][1]:
            found[-1] = found[-1][0], max(stop, found[-1][1])
        else:
            found.append((start, stop))
    return found


# ---------------------------------------------------------------- against the drive, told from the log's own habits

@dataclass(frozen=True)
class _Habit:
    """How the speed of a log follows from speed, angle and commands before: residuals of a robust line."""

    time: Array
    residual: Array
    drive: Array  # what the commands give to the speed
    arrived: Array  # what they would give to a shaft that is where it is afterwards: little, if it has arrived
    possible: Mask  # no speed around that only an outlier has
    scale: float
    full_at: float  # of an error, from which on the drive is full [rad]


def _usual(one: Look) -> _Habit | None:
    """Return the habit that explains most of a log's speeds; None of a log that is too short for one."""
    habits = [habit for error in _SATURATES if (habit := _habit(one, error)) is not None]
    return min(habits, key=lambda habit: habit.scale, default=None)


def _against(one: Look, best: _Habit) -> Iterator[tuple[float, float]]:
    """Give the windows in which the speed lacks more than all that the commands give to it.

    A shaft that gets no drive lacks just that, one on which an earlier command still acts twice as much. And it lacks
    far more, at once and in all, than the habit ever says too little: no missing pulse makes a shaft faster, so that is
    how far off a habit is.
    """
    full = float(np.quantile(np.abs(best.drive), 0.9))
    if full < _STRONG * one.top_speed or not best.scale > 0.0:
        return
    strong = np.minimum(np.abs(best.drive), np.sign(best.drive) * best.arrived) > _HALF * full
    lack = -best.residual * np.sign(best.drive)
    found = strong & best.possible & (lack > np.maximum(np.abs(best.drive), _SIGMAS * best.scale))
    unsure = max((_size(-lack[first:last + 1]) for first, last in _runs((lack < 0.0) & best.possible)), default=0.0)
    for first, last in _runs(lack > _HALF * np.abs(best.drive)):
        here = slice(first, last + 1)
        if last - first + 1 >= _LONG and found[here].any() and _size(lack[here]) > _FARTHER * unsure:
            begin = best.time[first] - _AHEAD * _BIN
            if _arrives(one, float(begin), float(best.time[last])):
                continue
            yield float(begin + one.log.start), float(best.time[last] + _MORE + one.log.start)


def _size(off: Array) -> float:
    """Return the largest of some speeds times their sum: how far off they are, at once and in all."""
    return float(off.max() * off.sum())


def _arrives(one: Look, begin: float, end: float) -> bool:
    """Tell whether the shaft goes to its command in a window, or has no way to go: a habit of few motions is unsure."""
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    start, stop = np.interp((begin, end), time, angle)
    goals = asked[(time >= begin - _DELAY) & (time <= end)]
    nearer = np.abs(goals - stop) < _HALF * np.abs(goals - start)
    small = np.abs(goals - start) < _SMALL
    return bool(len(goals) and (small | nearer).mean() > _MOST)


def _habit(one: Look, error: float) -> _Habit | None:
    time, angle = one.time[one.smooth], one.angle[one.smooth]
    if len(time) < _FEWEST or time[-1] - time[0] < _FEWEST * _BIN:
        return None
    grid = np.arange(time[0], time[-1] + 1e-9, _BIN)
    q = np.interp(grid, time, angle)
    speed = np.gradient(q, _BIN)
    asked = _binned(one, grid)
    k = np.arange(_PAST, len(grid) - _AHEAD - 1)
    past = k[:, None] + _AHEAD - np.arange(_AHEAD + _PAST)
    drives, arrived = (np.clip((asked[past] - q[at]) / error, -1.0, 1.0)
                       for at in (np.minimum(past, k[:, None]), k[:, None] + _AHEAD))
    known = np.column_stack([np.ones(len(k)), speed[k], speed[k - 1], np.sin(q[k]), np.cos(q[k]), drives])
    y = speed[k + _AHEAD]
    weight, residual, scale = np.ones(len(k)), y, math.inf
    little = 1e-6 * len(k) * np.eye(known.shape[1])  # commands of neighbouring bins may be the same
    for _ in range(_ROUNDS):
        counted = known * (weight**2)[:, None]
        line = np.linalg.solve(counted.T @ known + little, counted.T @ y)  # a decomposition of so many rows is slow
        residual, before = y - known @ line, scale
        scale = 1.4826 * float(np.median(np.abs(residual)))
        if abs(scale - before) < _SETTLED * scale:
            break
        weight = np.sqrt(np.minimum(1.0, 1.345 * scale / np.maximum(np.abs(residual), 1e-12)))
    gains = line[-drives.shape[1]:]
    around = np.pad(np.abs(speed), _AROUND, mode="edge")[k[:, None] + _AHEAD + np.arange(2 * _AROUND + 1)]
    possible = (around < _TOO_FAST * one.top_speed).all(axis=1)
    return _Habit(grid[k + _AHEAD], residual, drives @ gains, arrived @ gains, possible, scale, error)


def _binned(one: Look, grid: Array) -> Array:
    """Return the commanded angle in the mean of each bin before a time [rad]."""
    fine = grid[:, None] - _BIN * (np.arange(4) + 0.5) / 4.0
    at = np.searchsorted(one.time, fine, side="right") - 1
    return np.asarray(one.asked[np.maximum(at, 0)].mean(axis=1))


def _runs(mask: Mask) -> Iterator[tuple[int, int]]:
    """Give first and last place of each stretch that is true."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    yield from zip(np.flatnonzero(edges > 0).tolist(), (np.flatnonzero(edges < 0) - 1).tolist(), strict=True)


# -------------------------------------------------------------------------- standing still under large commands

def _standing(one: Look) -> Iterator[tuple[float, float]]:
    """Give the windows in which the shaft stands while commands change by what moves it at other times."""
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    if len(time) < 4:
        return
    large = max(_LEAST, _SHARE * float(np.ptp(asked)))
    if np.ptp(angle) < _FOLLOWS * np.ptp(asked):
        return
    rest = max(6.0 * one.noise, 0.01)
    first = 0
    while first < len(time) - 1:
        last = _stands_until(angle, first, rest)
        if time[last] - time[first] > _STILL + _DELAY:
            here = np.flatnonzero((time >= time[first]) & (time <= time[last] - _DELAY))
            off = np.abs(asked[here] - asked[first]) > large
            if off.any() and _lasting(time[here], off):
                yield (float(time[here][np.argmax(off)] + one.log.start),
                       float(time[last] + _MORE + one.log.start))
        first = max(last, first + 1)


def _stands_until(angle: Array, first: int, rest: float) -> int:
    """Return the last sample up to which the angle stays where it is at the first."""
    away = np.flatnonzero(np.abs(angle[first:] - angle[first]) > rest)
    return first + int(away[0]) - 1 if len(away) else len(angle) - 1


def _lasting(time: Array, off: Mask) -> bool:
    """Tell whether a command stayed away for so long that a servo would have moved."""
    return any(time[last] - time[first] >= _STILL - _DELAY for first, last in _runs(off))
