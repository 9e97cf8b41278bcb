"""Bounded nonlinear least squares whose normal matrix is an arrow: a few shared numbers, and a few of each log alone.

Levenberg-Marquardt after Moré (1978) with bounds by projection. The numbers of each log are eliminated first (Schur
complement), so that memory and time grow with the number of logs and not with its cube; no library in use here does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.search.case import STEP, LogPart, Point, robust_deviation
from servotwin.identification.fitting.search.forecast import Forecast

# --- How far residuals scatter, measured so that a few outliers change it little --------------------------------------

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOVING = 0.05  # of the fastest change of a simulated signal
_SHARE = 0.3  # of the rms, that the noise is at least
_FEWEST = 20  # values of a part, below which its median says too little
_LEAST = 1e-9  # SI


class _Piece(NamedTuple):
    """Residuals of one sensor in one log, and where its simulated signal changes."""

    residual: Array
    moving: Mask


def scatter_of(forecast: Forecast, parts: Sequence[LogPart], cases: Sequence[int]) -> dict[str, float]:
    """Return the noise of each sensor (SI): the median magnitude of its residuals, as of a normal law.

    Where a servo mostly stands still, the median of all would call every motion an outlier: so it is at least a share
    of the rms. That in turn is put together from medians where the simulated signal moves and where it stands, so that
    true outliers do not count. A sensor whose noise is not finite keeps the noise that it has.
    """
    gathered: dict[str, list[_Piece]] = {}
    for k, part in zip(cases, parts, strict=True):
        case = forecast.cases[k]
        for name, residual in by_sensor(forecast, k, part).items():
            gathered.setdefault(name, []).append(_Piece(residual, moving(
                case.times[case.places[name]], case.values[name] + residual)))
    found = {}
    for name, pieces in gathered.items():
        residual = np.concatenate([piece.residual for piece in pieces])
        found[name] = max(scatter(residual, np.concatenate([piece.moving for piece in pieces])), _LEAST) \
            if np.isfinite(residual).all() else forecast.noise[name]
    return found


def scatter(residual: Array, moves: Mask) -> float:
    """Return the robust standard deviation of residuals, at least a share of the robust rms of both parts.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> white, moves = rng.standard_normal(1000), np.arange(1000) < 200
    >>> outliers = np.where(rng.random(1000) < 0.05, 1000.0, white)
    >>> 0.9 < scatter(white, moves) < 1.15, 0.9 < scatter(outliers, moves) < 1.3
    (True, True)
    >>> 0.3 * 4.0 < scatter(np.where(moves, 10.0, 0.1) * white, moves) < 0.3 * 5.0
    True
    """
    parts = [part for part in (residual[moves], residual[~moves]) if len(part) >= _FEWEST] or [residual]
    squares = sum(len(part) * robust_deviation(part) ** 2 for part in parts)
    return max(robust_deviation(residual), _SHARE * math.sqrt(squares / sum(map(len, parts))))


def moving(time: Array, simulated: Array) -> Mask:
    """Tell where a simulated signal, which has no noise, changes visibly."""
    if len(time) < 2:
        return np.zeros(len(time), np.bool_)
    rate = np.abs(np.gradient(simulated, time))
    return np.asarray(rate > _MOVING * float(rate.max()))


def by_sensor(forecast: Forecast, k: int, part: LogPart) -> dict[str, Array]:
    """Return the residuals of a log by sensor (SI)."""
    found, first = {}, 0
    for name, place in forecast.cases[k].places.items():
        found[name] = part.residual[first:first + len(place)] * forecast.cases[k].sigma(name, forecast.noise)
        first += len(place)
    return found


# --- Bounded nonlinear least squares whose normal matrix is an arrow --------------------------------------------------

_LEAST_STEP = 1e-7  # of a searched number
_PATIENCE = 6  # small gains one after the other
_LEAST_GAIN = 1e-3  # of the cost, half a sum of squares in units of noise: a twentieth of a standard error
_KINK = 0.3  # the same where the cost has kinks: less than one of these is deep


@dataclass(frozen=True)
class Loss:
    """How large residuals count: squared, or beyond `limit` times the noise only in proportion (Huber 1964).

    Parameters
    ----------
    limit : float
        inf for plain least squares.
    """

    limit: float = math.inf

    def cost(self, residual: Array) -> float:
        """Return half the sum of squares, or what stands for it."""
        a = np.abs(residual)
        beyond = a > self.limit
        if not beyond.any():
            return 0.5 * float(residual @ residual)
        return float(0.5 * (a[~beyond] ** 2).sum() + (self.limit * (a[beyond] - 0.5 * self.limit)).sum())

    def weight(self, residual: Array) -> Array:
        """Return the weight of each squared residual."""
        return np.asarray(np.minimum(1.0, self.limit / np.maximum(np.abs(residual), 1e-300)))

    def linear_step(self, residual: Array, slopes: Array, ridge: Array, rounds: int = 3) -> tuple[Array, float]:
        """Return the step of numbers in which residuals are linear, and the cost after it, by reweighted least squares.

        Parameters
        ----------
        residual : ndarray, shape (n,)
            Before the step.
        slopes : ndarray, shape (n, p)
        ridge : ndarray, shape (p,)
            One over the variance of each number about 0.
        rounds : int
            Of weights.
        """
        step: Array = np.zeros(slopes.shape[1])
        for _ in range(rounds):
            weighted = slopes * self.weight(residual + slopes @ step)[:, None]
            step = np.asarray(-np.linalg.solve(weighted.T @ slopes + np.diag(ridge), weighted.T @ residual))
        return step, self.cost(residual + slopes @ step)


@dataclass(frozen=True)
class Prior:
    """Normal beliefs about some numbers: mean, and one over the standard deviation (0: none)."""

    mean: Array
    weight: Array

    def cost(self, numbers: Array) -> float:
        """Return half the sum of squares."""
        return 0.5 * float((((numbers - self.mean) * self.weight) ** 2).sum())


class Block(NamedTuple):
    """Normal equations of one log: gradient g and matrix H, of the shared numbers (s) and of its own (o)."""

    g_s: Array
    g_o: Array
    H_ss: Array
    H_so: Array
    H_oo: Array


class NormalEquations(NamedTuple):
    """The normal equations of all logs; priors included in the shared ones."""

    blocks: tuple[Block, ...]
    g: Array
    H: Array

    def reduced(self) -> tuple[Array, Array]:
        """Return gradient and matrix of the shared numbers, with each log's own eliminated."""
        g, H = self.g.copy(), self.H.copy()
        for b in self.blocks:
            if b.g_o.size:
                part = np.linalg.solve(safe(b.H_oo), np.column_stack([b.H_so.T, b.g_o]))
                H -= b.H_so @ part[:, :-1]
                g -= b.H_so @ part[:, -1]
        return g, H


def safe(H: Array) -> Array:
    """Return a matrix with a hair on its diagonal: a number that a log says nothing about stays where it is."""
    return np.asarray(H + np.diag(np.maximum(1e-12 * np.diag(H), 1e-12)))


def block(part: LogPart, loss: Loss, own: Prior | None = None, at: Array | None = None) -> Block:
    """Return the normal equations of one log, with the beliefs about its own numbers.

    Examples
    --------
    >>> one = LogPart(np.array([1.0, 2.0]), np.array([[1.0], [1.0]]), np.zeros((2, 0)))
    >>> block(one, Loss()).g_s.tolist()
    [3.0]
    """
    weight = loss.weight(part.residual)
    shared, alone = part.shared * weight[:, None], part.own * weight[:, None]
    g_o, H_oo = alone.T @ part.residual, alone.T @ part.own
    if own is not None and at is not None:
        g_o, H_oo = g_o + (at - own.mean) * own.weight**2, H_oo + np.diag(own.weight**2)
    return Block(shared.T @ part.residual, g_o, shared.T @ part.shared, shared.T @ part.own, H_oo)


@dataclass(frozen=True)
class Outcome:
    """Where a search ended: the best point, its cost, and whether it converged there."""

    point: Point
    cost: float
    converged: bool
    steps: int


Tell = Callable[[int, Outcome], None]


class Ask(NamedTuple):
    """The next question of a search: the logs at a point, perhaps with derivatives."""

    point: Point
    derivatives: bool


Steps = Generator[Ask, list[LogPart], Outcome]
Found = TypeVar("Found")


def together(forecast: Forecast, cases: Sequence[int], searches: Sequence[Generator[Ask, list[LogPart], Found]],
             noises: Sequence[Mapping[str, float]] | None = None) -> list[Found]:
    """Run searches side by side, and return their ends: what all need next is simulated in one batch.

    Each takes the steps that it would take alone, to the last bit.

    Parameters
    ----------
    forecast : Forecast
    cases : sequence of int
        The logs that count for all of them.
    searches : sequence of generator
        As of `Search.steps`, or longer ways of such steps.
    noises : sequence of mapping, optional
        The noise of each search; that of the forecast unless given.
    """
    asks: dict[int, Ask] = {}
    ended: dict[int, Found] = {}

    def go_on(k: int, parts: list[LogPart] | None) -> None:
        try:
            asks[k] = next(searches[k]) if parts is None else searches[k].send(parts)
        except StopIteration as end:
            asks.pop(k, None)
            ended[k] = end.value

    for k in range(len(searches)):
        go_on(k, None)
    while asks:
        now = list(asks)
        found = forecast.at_all([asks[k].point for k in now], derivatives=[asks[k].derivatives for k in now],
                                cases=cases, noises=None if noises is None else [noises[k] for k in now], leading=True)
        for k, parts in zip(now, found, strict=True):
            go_on(k, parts)
    return [ended[k] for k in range(len(searches))]


def staying(x: Array, g: Array, lower: Array, upper: Array, held: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which numbers x, shape (p,), are held, or at a bound over which the cost with the gradient g falls."""
    return np.asarray(held | ((x <= lower) & (g > 0.0)) | ((x >= upper) & (g < 0.0)))


def bounded_step(x: Array, g: Array, H: Array, lower: Array, upper: Array, held: NDArray[np.bool_]) -> Array:
    """Return the change of numbers that solves H·change = −g; a number that would cross its bound goes to it.

    The others are solved for again then. All are on the scale of the search, which has no unit.

    Parameters
    ----------
    x, lower, upper : ndarray, shape (p,)
        The numbers, and their bounds.
    g : ndarray, shape (p,)
        Gradient of the cost.
    H : ndarray, shape (p, p)
        Damped matrix of the normal equations; it may be singular.
    held : ndarray of bool, shape (p,)
        Numbers that stay.
    """
    stays, change = staying(x, g, lower, upper, held), np.zeros(len(x))
    for _ in range(len(x) + 1):
        moves = ~stays
        if not moves.any():
            break
        of_fixed = H[np.ix_(moves, stays)] @ change[stays]
        change[moves] = -np.linalg.lstsq(H[np.ix_(moves, moves)], g[moves] + of_fixed, rcond=1e-14)[0]
        over = moves & ((x + change < lower) | (x + change > upper))
        if not over.any():
            break
        change[over] = np.clip(x + change, lower, upper)[over] - x[over]
        stays = stays | over
    return change


class Search:
    """A least-squares problem over a forecast.

    Parameters
    ----------
    forecast : Forecast
    loss : Loss
    prior : Prior
    lower, upper : ndarray, shape (p,)
        Bounds of the shared numbers.
    cases : sequence of int, optional
        Which logs count; all unless given.
    held : ndarray of bool, shape (p,), optional
        Shared numbers that stay where they are.
    """

    def __init__(self, forecast: Forecast, loss: Loss, prior: Prior, lower: Array, upper: Array,
                 cases: Sequence[int] | None = None, held: NDArray[np.bool_] | None = None) -> None:
        self.forecast, self.loss, self.prior = forecast, loss, prior
        self.lower, self.upper = lower, upper
        self.cases = tuple(range(len(forecast.cases)) if cases is None else cases)
        beliefs = [forecast.own_belief(forecast.cases[k]) for k in self.cases]
        self.own = [Prior(mean, weight) for mean, weight in beliefs]
        self.own_reach = [forecast.own_reach(forecast.cases[k]) for k in self.cases]
        self.held = np.zeros(forecast.size, np.bool_) if held is None else held
        kinked = forecast.step > STEP
        self.least_gain = _KINK if kinked else _LEAST_GAIN
        self.least_fall = _KINK if kinked else 0.0  # of a damped step, below which another one is a matter of kinks
        self.least_step = _LEAST_STEP * forecast.step / STEP  # what differences over wider steps do not see

    def cost_of(self, point: Point, parts: Sequence[LogPart]) -> float:
        """Return the cost of a point; inf where a simulation failed."""
        total = sum(self.loss.cost(part.residual) for part in parts) + self.prior.cost(point.shared)
        total += sum(own.cost(point.own[k]) for k, own in zip(self.cases, self.own, strict=True))
        return total if math.isfinite(total) else math.inf

    def costs(self, points: Sequence[Point]) -> list[float]:
        """Return the costs of several points, run in one batch."""
        return [self.cost_of(point, parts)
                for point, parts in zip(points, self.forecast.at_all(points, cases=self.cases), strict=True)]

    def normal(self, point: Point, parts: Sequence[LogPart]) -> NormalEquations:
        """Return the normal equations at a point."""
        blocks = tuple(block(part, self.loss, own, point.own[k])
                       for k, part, own in zip(self.cases, parts, self.own, strict=True))
        off = (point.shared - self.prior.mean) * self.prior.weight**2
        g = off + np.sum([b.g_s for b in blocks], axis=0)
        H = np.diag(self.prior.weight**2) + np.sum([b.H_ss for b in blocks], axis=0)
        return NormalEquations(blocks, g, H)

    def run(self, start: Point, *, most: int = 60, tell: Tell | None = None,
            least_gain: float | None = None) -> Outcome:
        """Search from a point; the best so far is reported after each step."""
        return together(self.forecast, self.cases, [self.steps(start, most=most, tell=tell, least_gain=least_gain)])[0]

    def steps(self, start: Point, *, most: int = 60, tell: Tell | None = None, least_gain: float | None = None,
              least_share: float = 0.0) -> Steps:
        """Search from a point step by step, asking for what the logs say; `least_share` is that of the first cost."""
        point = start._replace(shared=np.clip(start.shared, self.lower, self.upper))
        parts = yield Ask(point, True)
        best = Outcome(point, self.cost_of(point, parts), False, 0)
        if not math.isfinite(best.cost):
            return best
        least_gain = max(self.least_gain if least_gain is None else least_gain, least_share * best.cost)
        damping, small = 1e-3, 0
        scale = np.zeros(self.forecast.size)
        for k in range(1, most + 1):
            if not all(np.isfinite(part.shared).all() and np.isfinite(part.own).all() for part in parts):
                return best  # beside it is what no servo is: there is no slope to follow
            normal = self.normal(best.point, parts)
            # A gain is also small where the damping is high: what counts is what a whole step promises
            if self._promise(best.point, normal) < least_gain:
                return Outcome(best.point, best.cost, True, k)
            scale = np.maximum(0.5 * scale, np.diag(normal.H))
            while True:
                trial, step = self._step(best.point, normal, damping, scale)
                if step < self.least_step or self._falls(best.point, trial, normal) < self.least_fall:
                    return Outcome(best.point, best.cost, True, k)
                parts_there = yield Ask(trial, False)
                cost = self.cost_of(trial, parts_there)
                if cost <= best.cost:
                    break
                damping = max(damping, 1e-6) * 6.0
                if damping > 1e9:
                    return Outcome(best.point, best.cost, True, k)
            damping = max(damping / 8.0, 1e-9)
            small = small + 1 if best.cost - cost < least_gain else 0
            best = Outcome(trial, cost, False, k)
            if tell is not None:
                tell(k, best)
            if small > _PATIENCE or k == most:
                return best
            parts = yield Ask(trial, True)
        return best

    def _promise(self, point: Point, normal: NormalEquations) -> float:
        """Return by how much the cost would fall in a whole step, if it were a parabola."""
        g, H = normal.reduced()
        moves = ~staying(point.shared, g, self.lower, self.upper, self.held)
        gain = 0.5 * float(g[moves] @ np.linalg.lstsq(H[np.ix_(moves, moves)], g[moves], rcond=1e-14)[0])
        for b in normal.blocks:
            if b.g_o.size:
                gain += 0.5 * float(b.g_o @ np.linalg.solve(safe(b.H_oo), b.g_o))
        return gain

    def _falls(self, point: Point, trial: Point, normal: NormalEquations) -> float:
        """Return by how much the cost would fall on the way to a trial at most, if it were a parabola."""
        fall = -float(normal.g @ (trial.shared - point.shared))
        return fall - sum(float(b.g_o @ (trial.own[k] - point.own[k]))
                          for k, b in zip(self.cases, normal.blocks, strict=True))

    def _step(self, point: Point, normal: NormalEquations, damping: float, scale: Array) -> tuple[Point, float]:
        """Return the next point, and the largest change of a number."""
        blocks = tuple(b._replace(H_oo=b.H_oo + damping * np.diag(np.diag(b.H_oo))) for b in normal.blocks)
        damped = NormalEquations(blocks, normal.g, normal.H + damping * np.diag(scale))
        g, H = damped.reduced()
        change = bounded_step(point.shared, g, H, self.lower, self.upper, self.held)
        own = list(point.own)
        largest = float(np.abs(change).max(initial=0.0))
        for k, b, belief, reach in zip(self.cases, damped.blocks, self.own, self.own_reach, strict=True):
            if b.g_o.size:
                step = -np.linalg.solve(safe(b.H_oo), b.g_o + b.H_so.T @ change)
                step = np.clip(point.own[k] + step, belief.mean - reach, belief.mean + reach) - point.own[k]
                own[k] = point.own[k] + step
                largest = max(largest, float(np.abs(step).max()))
        return point._replace(shared=point.shared + change, own=tuple(own)), largest


# --- How a search begins ----------------------------------------------------------------------------------------------

class Begin(NamedTuple):
    """Where a search begins, beside the values of its servo, and how closely it ends.

    Parameters
    ----------
    searches : int
        How many searches: one from the servo's values, the others from random ones.
    shared : mapping of str to float
        Numbers of the rig that all logs share (SI), as another fit found them; what is usual unless given.
    own : tuple of ndarray
        Each log's own numbers (scaled), as another fit found them; what was measured unless given.
    others : tuple of mapping of str to float
        Searched numbers (SI) with which further searches begin, the others being as the servo has them; where there
        are none, the further searches begin at random.
    exactly : bool
        False ends the search where lanes that go nearly lead, if there are any; errors are of the engine either way.
        Such a fit is one of several to choose from: it has no verdict.
    """

    searches: int = 1
    shared: Mapping[str, float] = {}
    own: tuple[Array, ...] = ()
    exactly: bool = True
    others: tuple[Mapping[str, float], ...] = ()
