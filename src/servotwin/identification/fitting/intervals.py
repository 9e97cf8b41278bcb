"""Intervals: by the normal approximation where the cost is a parabola, by the profile of the cost where it is not.

A profile fixes one number, fits all others again, and asks where the cost has risen as much as chance allows (Venzon &
Moolgavkar 1988). Whether it is needed is seen from the cost at the two ends of the normal interval, and beyond.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Ask, Outcome, Search, together
from servotwin.identification.fitting.point import STEP, LogPart, Point
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty

Array = NDArray[np.float64]

_FAITHFUL = (0.7, 1.4)  # of the expected rise of the cost: standard errors right within about a sixth
_FAR = (2.0, 4.0)  # times as far as the ends: between them the cost of a number alone rises too,
_RISES, _HIGH = 1.5, 50.0  # by more than this factor, or it is flat behind a cliff; unless it is so much above the ends
_STAYS = 0.01  # of the root of the rise: farther out the cost is the same
_DEEPER = 2.0  # of the cost: less than that is what a search leaves
_ROUNDS, _FEW_ROUNDS = 9, 4  # of the search for an end; of one among kinks
_NEARLY, _ROUGHLY = 0.02, 0.15  # of the distance to an end; among kinks
_CLOSELY = 0.01  # of the rise that is sought: what a step of a profile's search has to gain
_FARTHER = (3.0, 6.0)  # times as far as the ends, where kinks are small beside the rise
_BOWL = (0.05, 4.0)  # of the expected rise between these points: a parabola under the kinks
_FAR_OFF = 0.7  # of a searched number: farther out no cost is a parabola
_DEEPEST = 16.0  # times the expected rise: where the search fell into a deeper kink, that is no parabola


@dataclass(frozen=True)
class Ends:
    """Where the interval of one number ends, either way.

    Parameters
    ----------
    lower, upper : float
        In standard errors of the normal approximation, from the best value (lower is negative).
    method : str
        "normal", "profile" or "linearised".
    prior : float
        Of a profile: which part of the rise of the cost at its ends is that of the priors; else nan.
    """

    lower: float
    upper: float
    method: str
    prior: float = math.nan


def ends(search: Search, best: Outcome, doubt: Uncertainty, which: Sequence[int], level: float, *,
         rows: Sequence[Rows] = (), tell: Callable[[int], None] = lambda done: None,
         deeper: Callable[[Outcome], None] = lambda there: None) -> dict[int, Ends]:
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
        Is told how many are done, after each step.
    deeper : callable, optional
        Is told of points that cost clearly less than the end of the search: it lies in another valley.
    """
    reaches = {k: doubt.quantile(level, k) for k in which}
    exact = {k: Ends(-reaches[k], reaches[k], "normal") for k in which if not doubt.std[k] > 0.0}  # residuals are 0
    kinked = search.forecast.step > STEP
    found: dict[int, Ends] = exact | (_over_kinks(search, best, doubt, {
        k: reach for k, reach in reaches.items() if k not in exact and _FARTHER[1] * reach * doubt.std[k] < _FAR_OFF
        and _inside(search, best, doubt, k, _FARTHER[1] * reach)}, rows) if kinked else {})
    every, which = which, [k for k in which if k not in found]
    both = [(k, side) for k in which for side in (-1.0, 1.0)]
    points = [moved(search, best, doubt, k, side * reaches[k], rows) for k, side in both]
    rises = _rises(search, best, both, points)
    faithful = [k for k in which if _inside(search, best, doubt, k, reaches[k]) and all(
        _FAITHFUL[0] <= rises[k, side] / _expected(doubt, k, reaches[k]) <= _FAITHFUL[1] for side in (-1.0, 1.0))]
    beyond = [(k, far * side) for k in faithful for far in _FAR for side in (-1.0, 1.0)]
    farther = _rises(search, best, beyond, [
        begins(search, best, doubt, k, far * reaches[k], rows)[1] for k, far in beyond])
    for k in faithful:
        high = _HIGH * _expected(doubt, k, reaches[k])
        if not any(farther[k, _FAR[1] * side] < _RISES * farther[k, _FAR[0] * side] < high for side in (-1.0, 1.0)):
            found[k] = Ends(-reaches[k], reaches[k], "normal")
            tell(len(found))
    bent = [k for k in which if k not in found]
    profiles = [_end(search, best, doubt, k, side, reaches[k], rows, lambda: tell(len(found)), deeper, rises[k, side])
                for k in bent for side in (-1.0, 1.0)]
    reached = together(search.forecast, search.cases, profiles)
    for k, (low, of_low), (high, of_high) in zip(bent, reached[::2], reached[1::2], strict=True):
        share = (low * of_low + high * of_high) / max(low + high, 1e-300)
        if kinked:  # the first deep kink ends a profile, but says nothing of what lies behind it
            low, high = (max(one, min(reaches[k], _room(search, best, doubt, k, side)))
                         for one, side in ((low, -1.0), (high, 1.0)))
        found[k] = Ends(-low, high, "profile", min(max(share, 0.0), 1.0))
        tell(len(found))
    return {k: found[k] for k in every}


def _rises(search: Search, best: Outcome, which: Sequence[tuple[int, float]],
           points: Sequence[Point]) -> dict[tuple[int, float], float]:
    """Return by how much some points cost more than the best, by what they stand for."""
    costs = search.costs(points) if points else []
    return {one: cost - best.cost for one, cost in zip(which, costs, strict=True)}


def _inside(search: Search, best: Outcome, doubt: Uncertainty, k: int, reach: float) -> bool:
    """Tell whether all is within the bounds that is within some standard errors."""
    return all(search.lower[k] <= best.point.shared[k] + side * reach * doubt.std[k] <= search.upper[k]
               for side in (-1.0, 1.0))


def _room(search: Search, best: Outcome, doubt: Uncertainty, k: int, side: float) -> float:
    """Return how far off the bound on one side is [standard errors]."""
    bound = search.upper[k] if side > 0.0 else search.lower[k]
    return float(abs(bound - best.point.shared[k]) / max(doubt.std[k], 1e-300))


def _over_kinks(search: Search, best: Outcome, doubt: Uncertainty, reaches: Mapping[int, float],
                rows: Sequence[Rows]) -> dict[int, Ends]:
    """Return ends where the cost is a parabola with kinks in it, as that of a program that samples.

    The search ended in one of the deepest kinks near the bottom. Which one is chance, as far as the parabola rises no
    higher than that kink is deep: the ends are as much wider. Both are seen from points far out.
    """
    both = [(k, far * side) for k in reaches for far in _FARTHER for side in (-1.0, 1.0)]
    costs = search.costs([moved(search, best, doubt, k, far * reaches[k], rows) for k, far in both])
    rises = {one: cost - best.cost for one, cost in zip(both, costs, strict=True)}
    found = {}
    for k, reach in reaches.items():
        expected = _expected(doubt, k, reach)
        near, far = (0.5 * (rises[k, -one] + rises[k, one]) / expected for one in _FARTHER)
        a, b = (one**2 for one in _FARTHER)
        slope = (far - near) / (b - a)
        dip = max(near - a * slope, 0.0)
        if _BOWL[0] <= slope <= _BOWL[1] and dip <= _DEEPEST:
            wide = reach * math.sqrt((1.0 + dip) / slope)
            found[k] = Ends(-wide, wide, "normal")
    return found


def moved(search: Search, best: Outcome, doubt: Uncertainty, k: int, steps: float, rows: Sequence[Rows]) -> Point:
    """Return the best point with one number moved by some standard errors, and all others where they then are best."""
    along = doubt.curvature[:, k] / max(doubt.curvature[k, k], 1e-300)
    shared = np.clip(best.point.shared + along * steps * doubt.std[k], search.lower, search.upper)
    own = list(best.point.own)
    for case, row in zip(search.cases, rows, strict=False):
        if row.follow is not None:
            own[case] = own[case] + row.follow @ (shared - best.point.shared)
    return best.point._replace(shared=shared, own=tuple(own))


def begins(search: Search, best: Outcome, doubt: Uncertainty, k: int, steps: float, rows: Sequence[Rows],
           ) -> tuple[Point, Point]:
    """Return two points with one number moved far: all others where the parabola wants them, and where they are.

    Beyond a kink the parabola knows nothing.
    """
    shared = best.point.shared.copy()
    shared[k] = np.clip(shared[k] + steps * doubt.std[k], search.lower[k], search.upper[k])
    return moved(search, best, doubt, k, steps, rows), best.point._replace(shared=shared)


def _expected(doubt: Uncertainty, k: int, reach: float) -> float:
    """Return by how much the cost rises at the end of a normal interval, if it is a parabola.

    The cost counts residuals as independent; what their correlation widens, it has to rise further.
    """
    return float(0.5 * (reach * doubt.std[k]) ** 2 / max(doubt.curvature[k, k], 1e-300))


def _end(search: Search, best: Outcome, doubt: Uncertainty, k: int, side: float, reach: float,
         rows: Sequence[Rows], tell: Callable[[], None], deeper: Callable[[Outcome], None],
         rise: float) -> Generator[Ask, list[LogPart], tuple[float, float]]:
    """Return how far a profile of the cost reaches on one side [standard errors], and the share of the priors in that.

    A bound ends it. It begins where the rise of the cost at its reach says, all others moved along.
    """
    held = search.held.copy()
    held[k] = True
    inner = Search(search.forecast, search.loss, search.prior, search.lower, search.upper, search.cases, held)
    farthest = _room(search, best, doubt, k, side)
    wanted = _expected(doubt, k, reach)
    low, of_low, high, of_high = 0.0, 0.0, math.inf, math.inf
    first = min(max(wanted / max(rise, 1e-300), 1.0), _FAR[0] ** 2) if math.isfinite(rise) else 1.0
    at, share = float(min(reach * math.sqrt(first), farthest)), 0.0
    kinked = search.forecast.step > STEP
    for _ in range(_FEW_ROUNDS if kinked else _ROUNDS):
        starts, costs = begins(search, best, doubt, k, side * at, rows), [0.0]
        if at > reach:
            costs = []
            for start in starts:
                costs.append(inner.cost_of(start, (yield Ask(start, False))))
        there = yield from inner.steps(starts[int(np.argmin(costs))], most=1 if kinked else 3, tell=lambda *_: tell(),
                                       least_gain=_CLOSELY * wanted)
        rise = there.cost - best.cost
        if rise < -_DEEPER:
            deeper(there)
        of_priors = search.prior.cost(there.point.shared) - search.prior.cost(best.point.shared)
        share = of_priors / max(rise, wanted)
        root = math.sqrt(max(rise, 0.0) / wanted)  # grows in proportion where the cost is a parabola
        if abs(root - 1.0) < (_ROUGHLY if kinked else _NEARLY):
            break
        stays = at > low > 0.0 and abs(root - of_low) < _STAYS
        if root < 1.0:
            low, of_low = at, root
            if at >= farthest:
                break
        else:
            high, of_high = at, root
        if math.isinf(high):
            flat = stays or (root < 0.4 and at > reach)  # perhaps the logs allow all that there is on this side
            at = farthest if flat else min(at * (1.0 / root if root > 0.4 else 2.5), farthest)
        elif high > 10.0 * max(low, 0.1):
            at = math.sqrt(max(low, 0.1) * high)
        else:
            at = low + (high - low) * min(max((1.0 - of_low) / (of_high - of_low), 0.1), 0.9)
    return at, share
