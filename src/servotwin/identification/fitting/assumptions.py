"""What a servo file leaves out or only assumes: by how much its ranges, as far as the logs allow, move a fit's numbers.

Each such number is a nuisance with a uniform law over its range. One lane a log, with that number moved a little, gives
its derivative S beside that of the fitted numbers, J. Where the cost is a parabola the fitted numbers follow it by
-(JᵀJ)⁻¹ JᵀS, and what they cannot imitate says how large it is: the Schur complement of the joint normal matrix. So
nothing is searched. A number that the logs want elsewhere than the file has it is for a search to find (`freed`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.arrow import Prior, Search
from servotwin.identification.fitting.case import Case, command_of
from servotwin.identification.fitting.draws import move
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.frames import has_pulses
from servotwin.identification.fitting.free import Space, nominal
from servotwin.identification.fitting.intervals import Ends
from servotwin.identification.fitting.point import STEP, LogPart, Point
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, rows_of
from servotwin.models import DigitalServo
from servotwin.parameters import Servo

Array = NDArray[np.float64]

WANTED = 3.5
"""Standard errors from what the file says, beyond which the logs want a number elsewhere: as of priors."""
CLOCK, ROUNDED = "clock", "rounded commands"
"""What is no parameter of a servo."""
_SHARE, _WIDE = 1e-3, 0.1  # of a range: the difference that is a derivative; among kinks
_FAR, _REACH = 0.1, 2.0  # of a range; standard errors: how far off the cost is looked at, at most
_CHAINS, _SWEEPS = 200, 16  # of the sampling of the law of what is left out: its moments to a tenth
_OHMS = 1.0  # of a supply, assumed: four fresh alkaline AA cells have 0.6 to 1.2 (Energizer E91: 0.15 to 0.3 each)
_VISCOUS = 0.1  # of K²/R: the servos of github.com/Rhoban/bam (M3 files; XL330, XL-320, STS3215, MX) have up to 0.098
_BREAKAWAY = 2.0  # assumed, as in the catalog: no source
_SPEEDS = (0.1, 0.3)  # rad/s at the output, assumed: 1/e of the excess; laws between are about mixtures of both
_MICROSECOND = 1e-6  # s: `writeMicroseconds` of Arduino's Servo, and whoever sends whole microseconds
_CLOCK = 0.015  # assumed: ceramic resonators are within 0.5 %, calibrated RC oscillators (ATmega328P) within 1
_FARTHEST = 1.5  # of a range, assumed: a number that a search takes farther stands for something else
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
        What the file assumes, and the range (SI).
    source : str
        Of the range.
    beside : mapping of str to float
        Other numbers of the servo that go with it (SI).
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
    """What left-out numbers do to the fitted ones (scaled): where their mean would be, and its covariance."""

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
            ("motor.motor_viscous_friction", "viscous friction of the motor", "N m s/rad", _VISCOUS * damping,
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
            found.append(Assumption(name, words, unit, value, low, high, source, more))
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


def systematic(task: Task, point: Point, parts: Sequence[LogPart], beliefs: Sequence[Prior], rows: Sequence[Rows],
               doubt: Uncertainty) -> Systematic:
    """Return what left-out numbers do to the fitted ones.

    Parameters
    ----------
    task : Task
    point : Point
        Where its search ended.
    parts, beliefs, rows
        Of its fitted logs there, with what is believed of their own numbers.
    doubt : Uncertainty
    """
    forecast, p = task.forecast, len(point.shared)
    names = (*forecast.space.names, *forecast.extra)
    asked, columns = [], []
    for one in assumptions(forecast, point):
        found = _columns(forecast, point, task.fitted, one, parts)
        if found is not None:
            asked.append(one)
            columns.append(found)
    if not asked:
        return Systematic((), np.zeros(p), np.zeros((p, p)))
    sides = [_rows(task, point, parts, beliefs, [of[side] for of in columns]) for side in range(len(columns[0]))]
    d = len(asked)
    information, across, gradient = np.zeros((d, d)), np.zeros((p, d)), np.zeros(d)
    for r, one_side, other_side in zip(rows, sides[0], sides[-1], strict=True):
        first, last, inside = one_side.slope, other_side.slope, r.inside[:, None]  # no kink is in both, if there are any
        information += 0.5 * ((first * inside).T @ last + (last * inside).T @ first)
        across += (r.slope * inside).T @ (0.5 * (first + last))
        gradient += (0.5 * (first + last)).T @ r.score
    A = -doubt.curvature @ across
    pull = np.sum([r.slope.T @ r.score for r in rows], axis=0) + task.prior.weight**2 * (
        point.shared - task.prior.mean)
    values, vectors = np.linalg.eigh(information + across.T @ A)
    law = _checked(task, point, asked, A, rows, sides[0],
                   _Law((vectors * np.maximum(values, 0.0)) @ vectors.T, -(gradient + A.T @ pull)))
    law = _Law(law.precision / doubt.inflation**2, law.wanted / doubt.inflation**2)
    box = np.array([[(one.lower - one.assumed) / one.width, (one.upper - one.assumed) / one.width] for one in asked]).T
    drawn = _drawn(law, box)
    mean, covariance = drawn.mean(axis=0), np.atleast_2d(np.cov(drawn.T))
    if CLOCK in (one.name for one in asked) and "frame_period" in names:  # pulses are as far apart as stamps say
        j, k = [one.name for one in asked].index(CLOCK), names.index("frame_period")
        A[k, j] -= point.shared[k] * asked[j].width
    numbers = tuple(replace(
        one, mean=one.assumed + one.width * float(mean[j]), std=one.width * math.sqrt(float(covariance[j, j])),
        wanted=float(law.wanted[j] * _way(one) / math.sqrt(max(law.precision[j, j], _NOTHING))),
        moves={name: float(A[k, j]) for k, name in enumerate(names) if A[k, j]}) for j, one in enumerate(asked))
    return Systematic(numbers, A @ mean, A @ covariance @ A.T)


class _Law(NamedTuple):
    """A normal law of left-out numbers, in units of their ranges: its precision, and that times its mean."""

    precision: Array
    wanted: Array


def _way(one: Assumption) -> float:
    """Return to which side of what is assumed a range reaches farther."""
    return 1.0 if one.upper - one.assumed >= one.assumed - one.lower else -1.0


def _checked(task: Task, point: Point, asked: Sequence[Assumption], A: Array, rows: Sequence[Rows],
             more: Sequence[Rows], law: _Law) -> _Law:
    """Return the law with no more precision than the cost itself has where all others move along.

    A kink within a difference looks like something that no other number can imitate.
    """
    forecast, precision, wanted = task.forecast, law.precision.copy(), law.wanted.copy()
    least = Search(forecast, task.loss, task.prior, task.lower, task.upper, task.fitted).costs([point])[0]
    for j, one in enumerate(asked):
        if one.name == ROUNDED or not precision[j, j] > 1.0:  # exact, or as good as unknown
            continue
        step = _way(one) * min(_FAR, _REACH / math.sqrt(precision[j, j]))
        rises = []
        for far in (step, 2.0 * step):
            own = list(point.own)
            for case, r, s in zip(task.fitted, rows, more, strict=True):
                if r.follow is not None and s.follow is not None:
                    own[case] = own[case] + far * (r.follow @ A[:, j] + s.follow[:, j])
            there = point._replace(shared=np.clip(point.shared + far * A[:, j], task.lower, task.upper), own=tuple(own))
            other, at = _changed(forecast, there, one, far * one.width)
            before = other.work
            rises.append(Search(other, task.loss, task.prior, task.lower, task.upper, task.fitted).costs([at])[0]
                         - least)
            forecast.work += other.work - before
        bends = (rises[1] - 2.0 * rises[0]) / step**2
        if bends < precision[j, j]:
            shrink = math.sqrt(max(bends, 0.0) / precision[j, j])
            precision[j], precision[:, j] = precision[j] * shrink, precision[:, j] * shrink
            wanted[j] = (rises[1] - 4.0 * rises[0]) / (2.0 * step)
    return _Law(precision, wanted)


def _columns(forecast: Forecast, point: Point, cases: Sequence[int], one: Assumption,
             parts: Sequence[LogPart]) -> list[list[Array]] | None:
    """Return by how much a number moves the residuals of each log, for its whole range; twice among kinks.

    None where that does nothing, or cannot be simulated.
    """
    kinked = forecast.step > STEP
    share = 1.0 if one.name == ROUNDED else _WIDE if kinked else _SHARE
    way = share * one.width * _way(one)
    steps = (1, 2) if kinked and one.name != ROUNDED else (1,)
    there = [[part.residual for part in parts]]
    try:
        for step in steps:
            other, at = _changed(forecast, point, one, step * way)
            before = other.work
            there.append([part.residual for part in other.at(at, derivatives=False, cases=cases)])
            forecast.work += other.work - before
    except ServotwinError:
        return None
    found = [[(b - a) * one.width / way for a, b in zip(before, after, strict=True)]
             for before, after in pairwise(there)]
    if not all(np.isfinite(d).all() for some in found for d in some) or not any(d.any() for d in found[0]):
        return None
    return found * 2 if kinked and len(found) == 1 else found


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


def _rows(task: Task, point: Point, parts: Sequence[LogPart], beliefs: Sequence[Prior],
          columns: Sequence[Sequence[Array]]) -> list[Rows]:
    """Return what logs say of left-out numbers, with the part that each log's own numbers can imitate taken away."""
    return [rows_of(part._replace(shared=np.column_stack([of[k] for of in columns])), task.loss, own,
                    point.own[task.fitted[k]]) for k, (part, own) in enumerate(zip(parts, beliefs, strict=True))]


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
    axes = [(float(value), v, float(law.wanted @ v)) for value, v in zip(np.maximum(values, 0.0), vectors.T, strict=True)]
    axes += [(float(law.precision[j, j]), v, float(law.wanted[j])) for j, v in enumerate(np.eye(len(values)))]
    found = np.repeat(box.mean(axis=0)[None], _CHAINS, axis=0)
    for _ in range(_SWEEPS):
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


def most_wanted(numbers: Sequence[Assumption]) -> Assumption | None:
    """Return the number of a servo that the logs want most off what its file assumes; None where none is wanted."""
    wanted = [one for one in numbers if one.name not in (CLOCK, ROUNDED) and one.wanted > WANTED]
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
    known = old.space.parameters
    space = Space(old.model, (*old.space.names, *more),
                  bounds={p.name: (p.lower, p.upper) for p in known if p.bounded} or None,
                  priors={p.name: p.prior for p in known if p.prior is not None} or None,
                  load={p.name: p.start for p in known if p.name.startswith("load.")})
    forecast = Forecast([case.log for case in old.cases], old.model, space, old.nuisance, old.sensors)
    prior = Prior(*(np.insert(values, n, np.zeros(len(more))) for values in (task.prior.mean, task.prior.weight)))
    other = task.like(forecast, prior)
    share = (more[one.name] - one.assumed) / one.width
    moved = x + share * np.array([one.moves.get(name, 0.0) for name in (*old.space.names, *old.extra)])
    begin = [p.scaled(min(max(more[p.name], p.lower), p.upper)) for p in space.parameters[n:]]
    return other, point._replace(shared=np.clip(np.insert(moved, n, begin), other.lower, other.upper))
