"""Other commands for the ticks of all logs at once, judged by where all numbers would go with them.

Ticks that take wrong commands bend what all logs share, so that the right ones would not fit better with that, and
where those of several logs are wrong, one log alone cannot be right either. So each log says to first order what each
of its choices costs as the shared numbers move, a parabola, and the cheapest choices of all logs are sought together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Loss, NormalEquations, Prior, block, safe
from servotwin.identification.fitting.phases import PulseChoice, Scan
from servotwin.identification.fitting.point import LogPart, Point

Array = NDArray[np.float64]

_RANDOM, _ALIKE = 24, 8  # choices that descents begin with: random ones, and ticks alike in all logs
_TRIED = 3  # ends that are looked at closely
_GAINS = 0.5  # of the cost: less is not worth a look


class Parabolas(NamedTuple):
    """What choices, along the first axis, cost as the shared numbers move; a log's own go to where they fit best.

    Parameters
    ----------
    level : ndarray, shape (n,)
    slope : ndarray, shape (n, p)
    curvature : ndarray, shape (n, p, p)
    """

    level: Array
    slope: Array
    curvature: Array

    def least(self) -> Array:
        """Return the least cost of each [shape (n,)]."""
        p = self.slope.shape[1]
        hair = 1e-10 * np.trace(self.curvature, axis1=1, axis2=2)[:, None, None] * np.eye(p)
        steps = np.linalg.solve(self.curvature + hair, self.slope[..., None])[..., 0]
        return np.asarray(self.level - 0.5 * np.sum(self.slope * steps, axis=1))

    def plus(self, other: Parabolas) -> Parabolas:
        """Return the sums."""
        return Parabolas(*(a + b for a, b in zip(self, other, strict=True)))

    def less(self, other: Parabolas) -> Parabolas:
        """Return the differences."""
        return Parabolas(*(a - b for a, b in zip(self, other, strict=True)))

    def at(self, k: int) -> Parabolas:
        """Return one of them alone."""
        return Parabolas(*(a[k:k + 1] for a in self))


def giving_way(scan: Scan, prior: Prior, held: NDArray[np.bool_], cases: Sequence[int]) -> list[Point]:
    """Return points with other ticks that would fit better, to first order, the best first.

    Parameters
    ----------
    scan : Scan
        Where a search stands.
    prior : Prior
        About the shared numbers.
    held : ndarray of bool, shape (p,)
        Shared numbers that stay.
    cases : sequence of int
        Logs that count.
    """
    choices = {k: [scan.now(k), *scan.ticking(k)] for k in cases}
    if all(len(some) == 1 for some in choices.values()):
        return []
    parabolas = _parabolas(scan, choices, ~held)
    off = ((scan.point.shared - prior.mean) * prior.weight**2)[~held]
    about = Parabolas(np.zeros(1), off[None], np.diag(prior.weight[~held]**2)[None])
    now = dict.fromkeys(cases, 0)
    stands = _cost(parabolas, about, now)
    ends = {tuple(end.values()): cost for end, cost in (
        _descent(parabolas, about, start) for start in [now, *_starts(scan, choices)])}
    best = sorted((cost, end) for end, cost in ends.items() if cost < stands - _GAINS)[:_TRIED]
    return [scan.moved({k: choices[k][which] for k, which in zip(cases, end, strict=True)}) for _, end in best]


def _parabolas(scan: Scan, choices: Mapping[int, Sequence[PulseChoice]],
               moves: NDArray[np.bool_]) -> dict[int, Parabolas]:
    """Return what each choice of each log costs, with slopes and weights of residuals as where the search stands."""
    now = scan.forecast.at(scan.point, cases=list(choices))
    parts = scan.parts(choices)
    found = {}
    for j, (k, some) in enumerate(choices.items()):
        own = Prior(*scan.forecast.own_belief(scan.forecast.cases[k]))
        weight = scan.loss.weight(now[j].residual)
        each = [_parabola(now[j]._replace(residual=part.residual), weight, own, scan.moved({k: one}).own[k], moves)
                for one, part in zip(some, parts[k], strict=True)]
        found[k] = Parabolas(*map(np.stack, zip(*each, strict=True)))
    return found


def _parabola(part: LogPart, weight: Array, own: Prior, at: Array, moves: NDArray[np.bool_]) -> Parabolas:
    """Return what one choice costs."""
    shared = part.shared[:, moves]
    if not (np.isfinite(part.residual).all() and np.isfinite(shared).all() and np.isfinite(part.own).all()):
        return Parabolas(np.array(1e12), np.zeros(shared.shape[1]), np.eye(shared.shape[1]))
    root = np.sqrt(weight)
    weighed = LogPart(part.residual * root, shared * root[:, None], part.own * root[:, None])
    b = block(weighed, Loss(), own, at)
    g, H = NormalEquations((b,), b.g_s, b.H_ss).reduced()
    level = Loss().cost(weighed.residual) + own.cost(at)
    if b.g_o.size:
        level -= 0.5 * float(b.g_o @ np.linalg.solve(safe(b.H_oo), b.g_o))
    return Parabolas(np.asarray(level), g, H)


def _starts(scan: Scan, choices: Mapping[int, Sequence[PulseChoice]]) -> list[dict[int, int]]:
    """Return where descents begin."""
    rng = np.random.default_rng(0)
    random = [{k: int(rng.integers(len(some))) for k, some in choices.items()} for _ in range(_RANDOM)]
    alike = []
    for share in (np.arange(_ALIKE) + 0.5) / _ALIKE:
        alike.append({k: int(np.argmin([abs(np.mod(one.frames.tick / scan.ticks[k].period - share + 0.5, 1.0) - 0.5)
                                        for one in some])) for k, some in choices.items()})
    return [*random, *alike]


def _cost(parabolas: Mapping[int, Parabolas], about: Parabolas, chosen: Mapping[int, int]) -> float:
    return float(_sum(parabolas, about, chosen).least()[0])


def _sum(parabolas: Mapping[int, Parabolas], about: Parabolas, chosen: Mapping[int, int]) -> Parabolas:
    several = [about, *(parabolas[k].at(which) for k, which in chosen.items())]
    return Parabolas(*(np.sum(parts, axis=0) for parts in zip(*several, strict=True)))


def _descent(parabolas: Mapping[int, Parabolas], about: Parabolas,
             start: Mapping[int, int]) -> tuple[dict[int, int], float]:
    """Return the choices to which changes of one log at a time lead, and what they cost."""
    chosen, cost = dict(start), _cost(parabolas, about, start)
    while True:
        before, total = cost, _sum(parabolas, about, chosen)  # anew each time: rounding does not add up
        for k, mine in parabolas.items():
            others = total.less(mine.at(chosen[k]))
            costs = mine.plus(others).least()
            best = int(np.argmin(costs))
            if costs[best] < cost:
                chosen[k], cost, total = best, float(costs[best]), others.plus(mine.at(best))
        if not cost < before - 1e-9 * abs(before):
            return chosen, cost
