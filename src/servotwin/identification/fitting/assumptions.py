"""Numbers that a servo file leaves out or only assumes: how far their ranges move a fit's numbers.

Each such number is a nuisance with a uniform law over its range. A lane of each log, with that number moved, gives its
derivative S beside that of the fitted numbers, J. Where the cost is a parabola the fitted numbers follow it by
-(JᵀJ)⁻¹ JᵀS, and what they cannot imitate says how large it is: the Schur complement of the joint normal matrix. So
nothing is searched. A number that the logs want elsewhere than the file has it is for a search to find (`freed`).

A profile fixes one number, fits all others again, and asks where the cost has risen as much as chance allows (Venzon &
Moolgavkar 1988). Whether it is needed is seen from the cost at the two ends of the normal interval, and beyond.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.search.case import STEP, Case, LogPart, Point, command_of, has_pulses
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.free import nominal
from servotwin.identification.fitting.search.least_squares import Ask, Outcome, Prior, Search, together
from servotwin.identification.fitting.search.task import Task
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty
from servotwin.models import DigitalServo
from servotwin.parameters import Servo

# --- Servos that logs, priors and bounds allow together ---------------------------------------------------------------

# Near the best point the logs' cost is a parabola; along directions that they do not determine it is flat, and there a
# prior counts, if there is one, or else any point within the bounds as much as any other. A number at a bound is drawn
# from the part of its law on this side of it. The whole is a normal law, without limits in some directions, cut off by
# the bounds: sampled along its axes in turn (Gibbs sampling of a truncated normal law; Geweke 1991).

Array = NDArray[np.float64]

_SWEEPS = 40  # through all axes
_FLAT = 1e-6  # of the precision that the bounds alone would give: nothing is known
_OPEN = math.log(20.0)  # how far a logarithm goes down where its bound is 0: as far as usual bounds
_LEAST = 1e-12


@dataclass(frozen=True, eq=False)
class Allowed:
    """A normal law about the best point, cut off by bounds, of all shared numbers of a fit.

    Parameters
    ----------
    best : ndarray, shape (p,)
        Scaled numbers at the end of the search.
    shift : ndarray, shape (p,)
        From there to where the cost would be least without bounds.
    axes : ndarray, shape (p, p)
        Directions along which the law is independent, a column each.
    precision : ndarray, shape (p,)
        Inverse of the variance along each of them, in its lengths; 0 where nothing is known.
    lower, upper : ndarray, shape (p,)
        Bounds of the scaled numbers.
    by_logarithm : ndarray of bool, shape (p,)
        Numbers, searched as they are, that move in proportion: they appear in products with others.
    by_value : ndarray of bool, shape (p,)
        Numbers, searched by their logarithm, that move as they are: they appear in sums.
    open : ndarray, shape (p, q)
        Directions that the logs do not determine.
    reach : ndarray, shape (2, q)
        How far the logs allow to go along each of them, back and forth.
    stretch : ndarray, shape (2, p)
        How many times wider than the normal law each number's own law is, below the best value and above it.
    """

    best: Array
    shift: Array
    axes: Array
    precision: Array
    lower: Array
    upper: Array
    by_logarithm: NDArray[np.bool_]
    by_value: NDArray[np.bool_]
    open: Array
    reach: Array
    stretch: Array

    def draw(self, number: int, rng: np.random.Generator) -> Array:
        """Return points, shape (number, p).

        Examples
        --------
        >>> nothing = np.zeros((1, 0)), np.zeros((2, 0))
        >>> one = Allowed(np.zeros(1), np.zeros(1), np.eye(1), np.zeros(1), np.array([-1.0]), np.array([3.0]),
        ...               np.array([False]), np.array([False]), *nothing, np.ones((2, 1)))
        >>> drawn = one.draw(2000, np.random.default_rng(0))
        >>> round(float(drawn.mean()), 1), bool(drawn.min() > -1.0)
        (1.0, True)
        """
        axes = self.axes / self._scale[:, None]
        back = np.linalg.inv(axes)
        limits = np.vstack([np.eye(len(axes)), np.linalg.pinv(self.directions)])
        ends = np.concatenate([self.box, self.reach], axis=1)
        y = np.zeros((number, len(axes)))
        for sweep in range(_SWEEPS):
            cut = False
            for k in np.argsort(-self.precision):
                middle = (self.shift / self._scale - y) @ back[k]
                cut |= move(y, axes[:, k], float(self.precision[k]), middle, limits, ends, rng)
            if sweep == 0 and not cut:  # the axes are independent where nothing is cut off
                break
        y *= np.where(y < 0.0, self.stretch[0], self.stretch[1])
        return np.clip(self.points(y), self.lower, self.upper)

    def points(self, y: Array) -> Array:
        """Return scaled numbers at steps from the best point on the scale of the drawing; shape (n, p)."""
        grown = self.best * np.exp(np.where(self.by_logarithm, y, 0.0))
        added = self.best + np.log1p(np.where(self.by_value, np.maximum(y, _LEAST - 1.0), 0.0))
        return np.asarray(np.where(self.by_logarithm, grown, np.where(self.by_value, added, self.best + y)))

    @property
    def _scale(self) -> Array:
        """Scaled numbers to a step."""
        return np.where(self.by_logarithm, self.best, 1.0)

    @property
    def directions(self) -> Array:
        """Undetermined directions in steps."""
        return np.asarray(self.open / self._scale[:, None])

    @property
    def box(self) -> Array:
        """Bounds as steps from the best point on the scale of the drawing, shape (2, p)."""
        ends = np.array([self.lower - self.best, self.upper - self.best])
        ends[:, self.by_value] = np.expm1(ends[:, self.by_value])
        for k in np.flatnonzero(self.by_logarithm):
            ratios = sorted((self.lower[k] / self.best[k], self.upper[k] / self.best[k]))
            ends[:, k] = [math.log(ratios[0]) if ratios[0] > 0.0 else -_OPEN, math.log(ratios[1])]
        return np.asarray([np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)])


def move(y: Array, axis: Array, precision: float, middle: Array, limits: Array, ends: Array,
          rng: np.random.Generator) -> bool:
    """Move all points along one axis to where the law about `middle` allows; return whether limits cut it off."""
    change = limits @ axis
    counts = np.abs(change) > _LEAST
    room = (ends[:, None, counts] - (y @ limits[counts].T)) / change[counts]
    low, high = room.min(axis=0).max(axis=1), room.max(axis=0).min(axis=1)
    low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    width = float((high - low).max())
    uniform = rng.random(len(y))
    if precision * width**2 < _FLAT or not math.isfinite(precision):
        y += (low + uniform * (high - low))[:, None] * axis
        return True
    std = 1.0 / math.sqrt(precision)
    a, b = (low - middle) / std, (high - middle) / std
    step = middle + std * _truncated(a, b, uniform)
    y += np.clip(step, low, high)[:, None] * axis
    return bool((a > -4.0).any() or (b < 4.0).any())


def _truncated(a: Array, b: Array, uniform: Array) -> Array:
    """Return quantiles of the standard normal law between a and b."""
    from scipy.special import log_ndtr, ndtri_exp

    flip = a > 0.0  # the lower tail keeps its digits
    low, high = np.where(flip, -b, a), np.where(flip, -a, b)
    with np.errstate(divide="ignore"):
        level = np.logaddexp(np.log1p(-uniform) + log_ndtr(low), np.log(uniform) + log_ndtr(high))
    found = ndtri_exp(np.minimum(level, 0.0))
    return np.asarray(np.where(flip, -found, found))


# --- Intervals --------------------------------------------------------------------------------------------------------

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
        Called with how many are done, after each step.
    deeper : callable, optional
        Called with points that cost clearly less than the end of the search: it lies in another valley.
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

    Beyond a kink the parabola says nothing.
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


# --- Numbers that a servo file leaves out or only assumes -------------------------------------------------------------

WANTED = 3.5
"""Standard errors from what the file says, beyond which the logs want a number elsewhere: as of priors."""
HINTED = 1.5
"""The same where what is left is no noise, and widens standard errors by as much: then a search has to tell."""
CLOCK, ROUNDED = "clock", "rounded commands"
"""Numbers that are no parameters of a servo."""
_STEP, _WIDE = 0.05, 0.1  # of a range: over which a number is looked at, as much again after it; among kinks
_CHAINS, _END_SWEEPS = 200, 16  # of the sampling of the law of what is left out: its moments to a tenth
_OHMS = 1.0  # of a supply, assumed: four fresh alkaline AA cells have 0.6 to 1.2 (Energizer E91: 0.15 to 0.3 each)
_VISCOUS = 0.1  # of K²/R: the servos of github.com/Rhoban/bam (M3 files; XL330, XL-320, STS3215, MX) have up to 0.098
_BREAKAWAY = 2.0  # assumed, as in the catalog: no source
_SPEEDS = (0.1, 0.3)  # rad/s at the output, assumed: 1/e of the excess; laws between are about mixtures of both
_MICROSECOND = 1e-6  # s: `writeMicroseconds` of Arduino's Servo, and whoever sends whole microseconds
_CLOCK = 0.015  # assumed: ceramic resonators are within 0.5 %, calibrated RC oscillators (ATmega328P) within 1
_FARTHEST = 1.5  # of a range, assumed: a number that a search takes farther stands for something else
_BRAKES = "motor.motor_viscous_friction"
_LIKE_BRAKES = {"output_torque_constant", "motor.torque_constant", "motor.back_emf_constant",
                "motor.armature_resistance"}
"""The numbers of K²/R: where all of it is known, an angle tells viscous friction."""
_NEUTRAL = {"friction.breakaway_ratio": 1.0}
_UNTOLD = 0.25  # of a range: a uniform law has 0.29
_NOTHING = 1e-9  # of the precision of a range: the logs do not tell


@dataclass(frozen=True)
class Assumption:
    """A number that the servo file leaves out or assumes.

    Parameters
    ----------
    name : str
        Dotted, or `CLOCK` or `ROUNDED`.
    words : str
    unit : str
        SI.
    assumed, lower, upper : float
        Value that the file assumes, and the range (SI).
    source : str
        Of the range.
    beside : mapping of str to float
        Other numbers of the servo that go with it (SI).
    told : bool
        Whether logs can tell it; else its whole range counts.
    mean, std : float
        Of its law within the range, with what the logs say (SI).
    wanted : float
        By how many standard errors the logs want it off what is assumed, the others being as assumed; negative where
        they want it outside the range.
    moves : mapping of str to float
        By how much each fitted number moves (scaled) when it goes through its range.
    """

    name: str
    words: str
    unit: str
    assumed: float
    lower: float
    upper: float
    source: str
    beside: Mapping[str, float] = field(default_factory=dict)
    told: bool = True
    mean: float = math.nan
    std: float = math.nan
    wanted: float = 0.0
    moves: Mapping[str, float] = field(default_factory=dict)

    @property
    def width(self) -> float:
        """Of its range (SI)."""
        return self.upper - self.lower

    def __str__(self) -> str:
        told = self.std < _UNTOLD * self.width
        said = f"the logs say {self.mean:z.3g} ± {self.std:.2g}" if told else "the logs do not tell"
        return f"{self.words} {self.lower:z.3g} to {self.upper:z.3g}{self.unit_shown} ({said})"

    @property
    def unit_shown(self) -> str:
        """The unit after a number; nothing of a plain one."""
        return f" {self.unit}" if self.unit != "1" else ""


class Systematic(NamedTuple):
    """Effects of left-out numbers on the fitted ones (scaled): where their mean would be, and its covariance."""

    numbers: tuple[Assumption, ...]
    shift: Array
    covariance: Array


def assumptions(forecast: Forecast, point: Point) -> list[Assumption]:
    """Return what the servo's file leaves out or assumes, and the logs do not say: each with its range.

    A number with an origin other than "assumed" is given, and so is one that a person set.
    """
    servo, space = forecast.model.servo, forecast.space
    reduction = nominal(servo, "gear.gear_reduction") or 1.0
    values = {p.name: float(p.value(point.shared[k])) for k, p in enumerate(space.parameters)}

    def of(name: str) -> float:
        found = values.get(name, nominal(servo, name))
        return float(found) if found else 0.0

    gain, resistance = of("output_torque_constant"), of("motor.armature_resistance")
    damping = gain**2 / resistance / reduction**2 if resistance > 0.0 else 0.0
    rows: list[tuple[str, str, str, float, str, dict[str, float]]] = [
            ("supply.internal_resistance", "resistance of the supply", "ohm", _OHMS,
             "assumed: up to four fresh alkaline AA cells", {}),
            (_BRAKES, "viscous friction of the motor", "N m s/rad", _VISCOUS * damping,
             "up to a tenth of K²/R, as servos of github.com/Rhoban/bam have", {})]
    if servo.get("friction.stribeck_speed") is None:
        rows += [("friction.breakaway_ratio", f"static over Coulomb friction, fading over {speed:g} rad/s,", "1",
                  _BREAKAWAY, "assumed, as in the catalog", {"friction.stribeck_speed": speed * reduction})
                 for speed in _SPEEDS]
    found = []
    for name, words, unit, end, source, more in rows:
        read = (*forecast.model.requires, *forecast.model.optional)
        if any(one not in read or one in space.names or any(one in case.log.parameters for case in forecast.cases)
               for one in (name, *more)) or _given(servo, name):
            continue
        value = float(servo.get(name) or _NEUTRAL.get(name, 0.0))  # type: ignore[arg-type]
        quantity = servo.quantities.get(name)
        low = value if quantity is None or quantity.lower is None else min(quantity.lower, value)
        high = end if quantity is None or quantity.upper is None else max(quantity.upper, end)
        if high > value and (not more or value == _NEUTRAL[name]):
            # To an angle it is K²/R, but for kinks where the current of a motor that is driven begins
            told = name != _BRAKES or not _LIKE_BRAKES & {*space.names} or any(
                "current" in sensor for sensor in forecast.sensors)
            found.append(Assumption(name, words, unit, value, low, high, source, more, told))
    if has_pulses(forecast.model) and any(_rounded(case, forecast) is not case for case in forecast.cases):
        found.append(Assumption(ROUNDED, "commands rounded to whole microseconds, a share of", "1", 0.0, 0.0, 1.0,
                                "Arduino's writeMicroseconds, and others"))
    period = forecast.nuisance_of(point.shared, "frame_period")
    if period:
        off = period / forecast.cases[0].period - 1.0
        off = math.copysign(min(abs(off), _CLOCK), off)
        if off:
            found.append(Assumption(CLOCK, "stamps too far apart, by a share of", "1", 0.0, min(off, 0.0),
                                    max(off, 0.0), "assumed: 1.5 % at most, and so that pulses may have their usual "
                                    "period"))
    return found


def _given(servo: Servo, name: str) -> bool:
    """Tell whether a file gives a number, rather than assuming it; what a person sets is given."""
    quantity = servo.quantities.get(name)
    return quantity is not None and (quantity.origin != "assumed" or quantity.was_set)


def _rounded(case: Case, forecast: Forecast) -> Case:
    """Return a log whose pulses are whole microseconds; itself where they are."""
    log = case.log
    if log.command_kind != "pulse_width":
        return case
    command = _MICROSECOND * np.round(log.command / _MICROSECOND)
    if np.allclose(command, log.command, rtol=0.0, atol=1e-3 * _MICROSECOND, equal_nan=True):
        return case
    log = replace(log, command=command)
    return replace(case, log=log, signal=command_of(log, forecast.model, {}))


def systematic(task: Task, point: Point, parts: Sequence[LogPart], rows: Sequence[Rows],
               doubt: Uncertainty) -> Systematic:
    """Return what left-out numbers do to the fitted ones.

    Parameters
    ----------
    task : Task
    point : Point
        Where its search ended.
    parts, rows
        Of its fitted logs there, with what is believed of their own numbers.
    doubt : Uncertainty
    """
    p, prior = len(point.shared), task.prior
    names = (*task.forecast.space.names, *task.forecast.extra)
    known = _Known(task, point, parts, rows, doubt)
    effects = [(one, effect) for one in assumptions(task.forecast, point) if (effect := known.effect(one)) is not None]
    if not effects:
        return Systematic((), np.zeros(p), np.zeros((p, p)))
    asked = [one for one, _ in effects]
    A = np.column_stack([effect.move for _, effect in effects])
    information, gradient = np.zeros((len(asked), len(asked))), np.zeros(len(asked))
    for k, r in enumerate(rows):
        first, second = (np.column_stack([each[k] for each in some])
                         for some in zip(*((effect.first, effect.second) for _, effect in effects), strict=True))
        information += 0.5 * ((first * r.inside[:, None]).T @ second + (second * r.inside[:, None]).T @ first)
        gradient += 0.5 * (first + second).T @ r.score
    hidden = [not one.told for one in asked]
    information[hidden], information[:, hidden], gradient[hidden] = 0.0, 0.0, 0.0
    information += A.T @ (prior.weight[:, None] ** 2 * A)  # what is believed of the fitted numbers tells of it
    gradient += A.T @ (prior.weight**2 * (point.shared - prior.mean))
    values, vectors = np.linalg.eigh(information)
    law = _Law((vectors * np.maximum(values, 0.0)) @ vectors.T / doubt.inflation**2, -gradient / doubt.inflation**2)
    box = np.array([[(one.lower - one.assumed) / one.width, (one.upper - one.assumed) / one.width] for one in asked]).T
    drawn = _drawn(law, box)
    mean, covariance = drawn.mean(axis=0), np.atleast_2d(np.cov(drawn.T))
    if CLOCK in (one.name for one in asked) and "frame_period" in names:  # pulses are as far apart as stamps say
        j, k = [one.name for one in asked].index(CLOCK), names.index("frame_period")
        A[k, j] -= point.shared[k] * asked[j].width
    numbers = tuple(replace(
        one, mean=one.assumed + one.width * float(mean[j]), std=one.width * math.sqrt(float(covariance[j, j])),
        wanted=_way(one) * _gain(float(law.wanted[j]), float(law.precision[j, j])),
        moves={name: float(A[k, j]) for k, name in enumerate(names) if A[k, j]}) for j, one in enumerate(asked))
    return Systematic(numbers, A @ mean, A @ covariance @ A.T)


class _Law(NamedTuple):
    """A normal law of left-out numbers, in units of their ranges: its precision, and that times its mean."""

    precision: Array
    wanted: Array


class _Effect(NamedTuple):
    """Effects of a number on its way through its range: how the fitted ones follow, and what they do not imitate.

    That is the change of residuals, and of beliefs about the logs' own numbers, over one step and over the next.
    """

    move: Array
    first: list[Array]
    second: list[Array]


def _gain(wanted: float, precision: float) -> float:
    """Return the root of twice what a number gains alone about within its range; negative towards its other side."""
    far = min(abs(wanted) / max(precision, _NOTHING), _FARTHEST)
    return math.copysign(math.sqrt(max(2.0 * abs(wanted) * far - precision * far**2, 0.0)), wanted)


def _way(one: Assumption) -> float:
    """Return to which side of what is assumed a range reaches farther."""
    return 1.0 if one.upper - one.assumed >= one.assumed - one.lower else -1.0


@dataclass(frozen=True)
class _Known:
    """Knowledge where a search ended, as of `systematic`."""

    task: Task
    point: Point
    parts: Sequence[LogPart]
    rows: Sequence[Rows]
    doubt: Uncertainty

    def effect(self, one: Assumption) -> _Effect | None:
        """Return the effect of a number; None where it has none, or cannot be simulated.

        All others follow as the derivatives say, and once more as the residuals there want: a kink within a small
        difference looks like something that no number can imitate, and hides what one can.
        """
        exact = one.name == ROUNDED
        step = _way(one) * (1.0 if exact else _STEP if self.task.forecast.step <= STEP else _WIDE)
        move, own = np.zeros(len(self.point.shared)), [np.zeros(part.own.shape[1]) for part in self.parts]
        first: list[Array] = []
        try:
            for _ in range(1 if exact else 2):
                changes = self._changes(one, step, move, own)
                if not all(np.isfinite(d).all() for d in changes) or not (first or any(d.any() for d in changes)):
                    return None
                move, first = self._follow([d / step for d in changes], move, own)
            if exact:
                return _Effect(move, first, first)
            changes = self._changes(one, 2.0 * step, move, own)
        except ServotwinError:
            return None
        if not all(np.isfinite(d).all() for d in changes):
            return None
        return _Effect(move, first, [np.concatenate([d / step - before[:len(d)], before[len(d):]])
                                     for d, before in zip(changes, first, strict=True)])

    def _changes(self, one: Assumption, step: float, move: Array, own: Sequence[Array]) -> list[Array]:
        """Return by how much residuals change with a number so far through its range, and all others along."""
        task, forecast = self.task, self.task.forecast
        moved = list(self.point.own)
        for k, values in zip(task.fitted, own, strict=True):
            moved[k] = moved[k] + step * values
        there = self.point._replace(
            shared=np.clip(self.point.shared + step * move, task.lower, task.upper), own=tuple(moved))
        other, at = _changed(forecast, there, one, step * one.width)
        before = other.work
        found = other.at(at, derivatives=False, cases=task.fitted)
        forecast.work += other.work - before
        return [new.residual - old.residual for new, old in zip(found, self.parts, strict=True)]

    def _follow(self, changes: Sequence[Array], move: Array, own: list[Array]) -> tuple[Array, list[Array]]:
        """Return how the shared numbers follow changes for a range, and what is left; own numbers move in place."""
        pull, left = self.task.prior.weight**2 * move, []
        for k, (d, part, belief, r) in enumerate(zip(changes, self.parts, self.task.beliefs, self.rows, strict=True)):
            m, weight = len(d), belief.weight
            if len(own[k]):
                weighted = part.own * r.inside[:m, None]
                H = weighted.T @ part.own + np.diag(weight**2)
                H += 1e-12 * np.eye(len(H)) * max(H.max(), 1.0)
                follow = -np.linalg.solve(H, weighted.T @ d + weight**2 * own[k])
                own[k] = own[k] + follow
                left.append(np.concatenate([d + part.own @ follow, weight * own[k]]))
            else:
                left.append(d)
            pull = pull + (r.slope * r.inside[:, None]).T @ left[k]
        change = -self.doubt.curvature @ pull
        for k, r in enumerate(self.rows):
            left[k] = left[k] + r.slope @ change
            if r.follow is not None:
                own[k] = own[k] + r.follow @ change
        return move + change, left


def _changed(forecast: Forecast, point: Point, one: Assumption, way: float) -> tuple[Forecast, Point]:
    """Return a forecast in which a number is so far off what is assumed (SI), and where the point stands there."""
    if one.name == ROUNDED:
        return forecast.with_cases([_rounded(case, forecast) for case in forecast.cases]), point
    if one.name == CLOCK:
        return _slowed(forecast, point, 1.0 + way)
    changed = {one.name: one.assumed + way, **one.beside}
    cases = [replace(case, log=replace(case.log, parameters={**case.log.parameters, **changed}),
                     key=(*case.key, *changed)) for case in forecast.cases]
    other = forecast.with_cases(cases)
    if one.beside and isinstance(forecast.model, DigitalServo):  # friction that fades has no closed form
        other.bent = other.nearly = True
    return other, point


def _slowed(forecast: Forecast, point: Point, factor: float) -> tuple[Forecast, Point]:
    """Return logs whose stamps were too far apart by a factor, pulses included."""
    cases = []
    for case in forecast.cases:
        log = replace(case.log, time=case.log.time[0] + (case.log.time - case.log.time[0]) / factor)
        cases.append(replace(case, log=log, signal=command_of(log, forecast.model, {}), times=case.times / factor))
    shared, own = point.shared.copy(), []
    shared[len(forecast.space) + forecast.extra.index("frame_period")] /= factor
    for case, values in zip(forecast.cases, point.own, strict=True):
        own.append(values / np.where([name == "frame_phase" for name in forecast.names_of_own(case)], factor, 1.0))
    frames = tuple(f._replace(phase=f.phase / factor, period=f.period / factor) for f in point.frames)
    return forecast.with_cases(cases), point._replace(shared=shared, own=tuple(own), frames=frames)


def _drawn(law: _Law, box: Array) -> Array:
    """Return draws from a normal law that is cut off by a box, shape (2, d): along its own axes in turn (Geweke 1991).

    Examples
    --------
    >>> drawn = _drawn(_Law(np.diag([1e4, 0.0]), np.array([1e4 * 0.3, 0.0])), np.array([[0.0, 0.0], [1.0, 1.0]]))
    >>> [round(float(x), 2) for x in (*drawn.mean(axis=0), *drawn.std(axis=0))]
    [0.3, 0.5, 0.01, 0.29]
    """
    rng = np.random.default_rng(0)
    values, vectors = np.linalg.eigh(law.precision)
    directions = [*zip(np.maximum(values, 0.0), vectors.T, strict=True),
                  *zip(np.diag(law.precision), np.eye(len(values)), strict=True)]
    axes = [(float(value), v, float(law.wanted @ v)) for value, v in directions]
    found = np.repeat(box.mean(axis=0)[None], _CHAINS, axis=0)
    for _ in range(_END_SWEEPS):
        for value, v, pull in axes:
            middle = (pull - found @ law.precision @ v) / max(value, _NOTHING)
            move(found, v, value, middle, np.eye(len(v)), box, rng)
    return found


def with_assumptions(ends: Mapping[int, Ends], doubt: Uncertainty, level: float, more: Systematic) -> dict[int, Ends]:
    """Return ends of intervals that hold for what is left out too.

    An interval holds those of the file as it stands, and those of a number whose mean and variance are those with what
    is left out.
    """
    found = {}
    for k, one in ends.items():
        std, reach = float(doubt.std[k]), doubt.quantile(level, k)
        if not std > 0.0:
            found[k] = one
            continue
        middle, wider = more.shift[k] / std, reach**2 * more.covariance[k, k] / std**2
        found[k] = replace(one, lower=min(one.lower, middle - math.hypot(one.lower, math.sqrt(wider))),
                           upper=max(one.upper, middle + math.hypot(one.upper, math.sqrt(wider))))
    return found


def most_wanted(numbers: Sequence[Assumption], least: float) -> Assumption | None:
    """Return the number of a servo that logs want most off what its file assumes; None where none is so far off."""
    wanted = [one for one in numbers if one.name not in (CLOCK, ROUNDED) and one.wanted > least]
    return max(wanted, key=lambda one: one.wanted, default=None)


def plausible(task: Task, point: Point, one: Assumption) -> bool:
    """Tell whether a number that was searched too ended about within its range."""
    k = task.forecast.space.names.index(one.name)
    value = float(task.forecast.space.parameters[k].value(point.shared[k]))
    return abs(value - one.assumed) <= _FARTHEST * one.width


def freed(task: Task, point: Point, one: Assumption) -> tuple[Task, Point]:
    """Return a search in which a number is searched too, and where it begins: where the logs want it, to first order.

    Raises
    ------
    ServotwinError
        If that cannot be.
    """
    old, x = task.forecast, point.shared
    n = len(old.space)
    more = {one.name: one.assumed + max(one.mean - one.assumed, 0.1 * one.width), **one.beside}
    space = old.space.changed(old.model, (*old.space.names, *more))
    forecast = Forecast([case.log for case in old.cases], old.model, space, old.nuisance, old.sensors)
    prior = Prior(*(np.insert(values, n, np.zeros(len(more))) for values in (task.prior.mean, task.prior.weight)))
    other = task.like(forecast, prior)
    share = (more[one.name] - one.assumed) / one.width
    moved = x + share * np.array([one.moves.get(name, 0.0) for name in (*old.space.names, *old.extra)])
    begin = [p.scaled(min(max(more[p.name], p.lower), p.upper)) for p in space.parameters[n:]]
    return other, point._replace(shared=np.clip(np.insert(moved, n, begin), other.lower, other.upper))
