"""Intervals: by the normal approximation where the cost is a parabola, by the profile of the cost where it is not.

A profile fixes one number, fits all others again, and asks where the cost has risen as much as chance allows (Venzon &
Moolgavkar 1988). Whether it is needed is seen from the cost at the two ends of the normal interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Outcome, Search
from servotwin.identification.fitting.point import Point
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty

Array = NDArray[np.float64]

_FAITHFUL = (0.7, 1.4)  # of the expected rise of the cost: standard errors right within about a sixth
_ROUNDS = 6  # of the search for an end


@dataclass(frozen=True)
class Ends:
    """Where the interval of one number ends, either way.

    Parameters
    ----------
    lower, upper : float
        In standard errors of the normal approximation, from the best value (lower is negative).
    method : str
        "normal" or "profile".
    """

    lower: float
    upper: float
    method: str


def ends(search: Search, best: Outcome, doubt: Uncertainty, which: Sequence[int], level: float, *,
         rows: Sequence[Rows] = (), tell: Callable[[int], None] = lambda done: None) -> dict[int, Ends]:
    """Return the ends of the intervals of some shared numbers.

    Parameters
    ----------
    search : Search
    best : Outcome
        Its end.
    doubt : Uncertainty
    which : sequence of int
        Numbers that are determined, and not held.
    level : float
        Such as 0.95.
    rows : sequence of Rows
        Of the fitted logs: how their own numbers follow.
    tell : callable, optional
        Is told how many are done.
    """
    reach = doubt.quantile(level)
    both = [(k, side) for k in which for side in (-1.0, 1.0)]
    points = [_moved(search, best, doubt, k, side * reach, rows) for k, side in both]
    rises = dict(zip(both, (cost - best.cost for cost in search.costs(points)), strict=True)) if both else {}
    found = {}
    for done, k in enumerate(which, start=1):
        expected = {side: _expected(doubt, k, reach) for side in (-1.0, 1.0)}
        inside = all(search.lower[k] <= best.point.shared[k] + side * reach * doubt.std[k] <= search.upper[k]
                     for side in (-1.0, 1.0))
        faithful = all(_FAITHFUL[0] <= rises[k, side] / expected[side] <= _FAITHFUL[1] for side in (-1.0, 1.0))
        if inside and faithful:
            found[k] = Ends(-reach, reach, "normal")
        else:
            low, high = (_end(search, best, doubt, k, side, reach, rows) for side in (-1.0, 1.0))
            found[k] = Ends(-low, high, "profile")
        tell(done)
    return found


def _expected(doubt: Uncertainty, k: int, reach: float) -> float:
    """Return by how much the cost rises at the end of a normal interval, if it is a parabola.

    The cost counts residuals as independent; what their correlation widens, it has to rise further.
    """
    return float(0.5 * (reach * doubt.std[k]) ** 2 / max(doubt.curvature[k, k], 1e-300))


def _moved(search: Search, best: Outcome, doubt: Uncertainty, k: int, steps: float, rows: Sequence[Rows]) -> Point:
    """Return the best point with one number moved by some standard errors, and all others where they then are best."""
    along = doubt.curvature[:, k] / max(doubt.curvature[k, k], 1e-300)
    shared = np.clip(best.point.shared + along * steps * doubt.std[k], search.lower, search.upper)
    own = list(best.point.own)
    for case, row in zip(search.cases, rows, strict=False):
        if row.follow is not None:
            own[case] = own[case] + row.follow @ (shared - best.point.shared)
    return Point(shared, tuple(own))


def _end(search: Search, best: Outcome, doubt: Uncertainty, k: int, side: float, reach: float,
         rows: Sequence[Rows]) -> float:
    """Return how far the profile of the cost reaches on one side, in standard errors; a bound ends it."""
    held = search.held.copy()
    held[k] = True
    inner = Search(search.forecast, search.loss, search.prior, search.lower, search.upper, search.cases, held)
    bound = search.upper[k] if side > 0.0 else search.lower[k]
    farthest = float(abs(bound - best.point.shared[k]) / max(doubt.std[k], 1e-300))
    wanted = _expected(doubt, k, reach)
    low, of_low, high, of_high = 0.0, 0.0, math.inf, math.inf
    at = float(min(reach, farthest))
    for _ in range(_ROUNDS):
        rise = inner.run(_moved(search, best, doubt, k, side * at, rows), most=3).cost - best.cost
        root = math.sqrt(max(rise, 0.0) / wanted)  # grows in proportion where the cost is a parabola
        if abs(root - 1.0) < 0.02:
            return at
        if root < 1.0:
            low, of_low = at, root
            if at >= farthest:
                return farthest
        else:
            high, of_high = at, root
        if math.isinf(high):
            at = min(at * (1.0 / root if root > 0.4 else 2.5), farthest)
        else:
            at = low + (high - low) * min(max((1.0 - of_low) / (of_high - of_low), 0.1), 0.9)
    return at
