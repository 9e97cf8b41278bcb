"""Angles that jump by a constant that no servo could turn so fast: a sensor that begins again after a turn."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.look import Finding, Look, aligned, said_times

TURN = 2.0 * math.pi
_TOO_FAST = 4.0  # times the speed without load: what no motion explains, whatever the sheet is worth
_NOISE = 6.0  # standard errors
_FEWEST = 3  # jumps, by which a modulus that nobody knows beforehand is told from outliers
_STAYS = 3  # samples on either side of a jump: an outlier comes back at once
_NEAR_TURN = 0.5  # rad, how far offsets of two logs of one rig may differ


def wraps(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs whose angle wraps, or lies a whole turn beside the others."""
    jumps = [_jumps(one) for one in looks]
    good = [one for one, found in zip(looks, jumps, strict=True) if found is None]
    found = [_unwrapped(one, good, *jump) for one, jump in zip(looks, jumps, strict=True) if jump is not None]
    return [*found, *_turned_logs(good)]


def _jumps(one: Look) -> tuple[float, NDArray[np.int64]] | None:
    """Return the modulus, and the samples at which the angle jumps; None where it does not."""
    seen = np.flatnonzero(np.isfinite(one.angle))
    time, angle = one.time[seen], one.angle[seen]
    steps = np.diff(angle)
    moves = one.top_speed * np.diff(time) + _NOISE * one.noise
    sizes = np.abs(steps)
    at = np.flatnonzero(sizes > _TOO_FAST * moves)
    if not len(at):
        return None
    turns = at[np.abs(sizes[at] - TURN) < np.minimum(_TOO_FAST * moves[at], 0.25 * TURN)]
    if len(turns) and np.subtract(*np.quantile(angle, (0.99, 0.01))) < TURN + _TOO_FAST * moves[turns].max():
        return TURN, seen[turns + 1]
    carried = 0.5 * (np.pad(steps, 1)[:-2] + np.pad(steps, 1)[2:])  # by the motion, meanwhile
    modulus = float(np.median(np.abs((steps - carried)[at])))
    alike = at[np.abs(sizes[at] - modulus) < np.minimum(_TOO_FAST * moves[at], 0.25 * modulus)]
    apart = np.diff(np.concatenate([[-_STAYS], at, [len(steps) + _STAYS]])) >= _STAYS
    stays = (apart[1:] & apart[:-1])[np.isin(at, alike)]
    one_range = np.ptp(angle) < modulus + float(_TOO_FAST * moves[alike].max(initial=0.0))
    if len(alike) < max(_FEWEST, math.ceil(0.8 * len(at))) or stays.sum() < max(_FEWEST, 0.5 * len(alike)) \
            or not one_range:
        return None
    return modulus, seen[alike + 1]


def _unwrapped(one: Look, good: Sequence[Look], modulus: float, at: NDArray[np.int64]) -> Finding:
    seen = np.isfinite(one.angle)
    before = np.maximum.accumulate(np.where(seen, np.arange(len(seen)), 0))
    turns = np.zeros(len(seen))
    turns[at] = -np.sign(one.angle[at] - one.angle[before[at - 1]])
    angle = aligned(one, one.angle + modulus * np.cumsum(turns), good, steps_of=modulus)
    size = "2π, a whole turn" if modulus == TURN else f"{modulus:.4g}, always the same"
    return Finding("wrap", one.log.name, (
        f"log {one.log.name!r}: the angle jumps by {size} (rad) {said_times(one.log.time[at])}, faster than "
        "any servo: a sensor that begins again there; mending \"wrap\" joins the pieces"), one.with_angle(angle))


def _turned_logs(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs that lie a whole turn or several beside the others."""
    gaps = [(one, one.gap()) for one in looks if one.counts.any()]
    if len(gaps) < 2:
        return []
    values = np.array([gap for _, gap in gaps])
    usual = float(np.median(values)) if len(values) > 2 else float(values[np.argmin(np.abs(values))])
    found = []
    for one, gap in gaps:
        turns = round((gap - usual) / TURN)
        if turns and abs(gap - usual - turns * TURN) < _NEAR_TURN:
            found.append(Finding("wrap", one.log.name, (
                f"log {one.log.name!r}: its angles lie {_turns(turns)} beside those of the other logs; mending "
                "\"wrap\" puts them there"), one.with_angle(one.angle - turns * TURN)))
    return found


def _turns(number: int) -> str:
    return "a whole turn" if abs(number) == 1 else f"{abs(number)} whole turns"

