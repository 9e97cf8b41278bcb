"""The result of a robot's fit: servos, supply, links, zeros and latency, and how far it is from the real one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.rows import (
    GAIN,
    RESISTANCE,
    VOLTAGE,
    Copies,
    LeftOut,
    Noise,
    Numbers,
    parts_of,
    residuals,
)
from servotwin.identification.arms.search import ArmSearch, Problem
from servotwin.identification.fitting.checks import checked_level
from servotwin.identification.fitting.registers import RegisterSearch
from servotwin.identification.fitting.search.case import HUBER, LogPart
from servotwin.identification.fitting.search.least_squares import Loss, Prior
from servotwin.identification.fitting.traces import Interval
from servotwin.identification.fitting.uncertainty import (
    Rows,
    Uncertainty,
    Unidentifiable,
    explain,
    rows_of,
    simplest,
    uncertainty,
    vague_directions,
)
from servotwin.parameters import Servo, Supply
from servotwin.robots import RobotValidation

# --- The result of a robot's fit --------------------------------------------------------------------------------------

Array = NDArray[np.float64]
BELIEFS = "by beliefs"
HALF = 0.5  # of what is known of a number


class ArmCause(NamedTuple):
    """A further cause: its name, a sentence, by how much the cost of the first stage falls, its joints."""

    name: str
    sentence: str
    gain: float
    joints: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmFit:
    """The outcome of `identify` with a robot.

    Parameters
    ----------
    model : MjModel
        Of the robot, with the masses that were found.
    servos : mapping of str to Servo
        Fitted, by joint.
    supply : Supply, optional
        That all share.
    masses : mapping of str to float
        How many times as heavy as in the robot's file the links are.
    zeros : mapping of str to float
        By how much joints of the robot are ahead of what was measured [rad]
    latency : float
        Between the reading of positions and when the goal of the same row acts [s]
    names : tuple of str
    estimates : mapping of str to float
        Values of all names (SI); masses as factors.
    units : mapping of str to str
    unidentifiable : tuple of Unidentifiable
        Numbers that the episodes cannot tell apart, in words.
    at_bound : tuple of str
    training, before : RobotValidation
        Errors of the fitted robot and of that before the fit on the episodes that were fitted.
    holdout, before_holdout : RobotValidation, optional
        The same on episodes that were not; None where there was one only.
    noise : mapping of str to float
        Standard deviation of the positions of each joint [rad], and of the stamps, `clock` [s]
    left_out : tuple of LeftOut
    causes : tuple of ArmCause
        Causes that would explain more, the best first.
    warnings : tuple of str
    prior_share : mapping of str to float
        How much of what is known of each number is belief, from 0 to 1. Empty without intervals.
    stages : mapping of str to float
        CPU seconds that each stage took.
    interrupted : bool
        Whether it was stopped before its end.
    unknown : tuple of str
        Results that are not known because of that.
    registers : RegisterSearch, optional
        Of bus servos of one family: what stands in registers that nobody recorded.
    """

    model: Any = field(repr=False)
    servos: Mapping[str, Servo]
    supply: Supply | None
    masses: Mapping[str, float]
    zeros: Mapping[str, float]
    latency: float
    names: tuple[str, ...]
    estimates: Mapping[str, float]
    units: Mapping[str, str]
    unidentifiable: tuple[Unidentifiable, ...]
    at_bound: tuple[str, ...]
    training: RobotValidation = field(repr=False)
    before: RobotValidation = field(repr=False)
    holdout: RobotValidation | None = field(repr=False)
    before_holdout: RobotValidation | None = field(repr=False)
    noise: Mapping[str, float]
    left_out: tuple[LeftOut, ...]
    causes: tuple[ArmCause, ...]
    warnings: tuple[str, ...]
    numbers: Numbers = field(repr=False)
    best: Array = field(repr=False)
    doubt: Uncertainty | None = field(repr=False)
    prior_share: Mapping[str, float] = field(default_factory=dict)
    stages: Mapping[str, float] = field(default_factory=dict)
    level: float = 0.95
    interrupted: bool = False
    unknown: tuple[str, ...] = ()
    registers: RegisterSearch | None = field(default=None, repr=False)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names that the episodes alone do not determine."""
        return tuple(dict.fromkeys(name for item in self.unidentifiable for name in item.parameters))

    def intervals(self, level: float | None = None) -> dict[str, Interval]:
        """Return the interval of every name (SI).

        Beliefs count in all of them: how far masses, servos and the supply may be off what files say. Their method is
        "normal" of what the episodes tell, "by beliefs" where most of it is belief, "at bound", or "not sought".

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        wanted = self.level if level is None else checked_level(level)
        return {name: self._interval(k, name, wanted) for k, name in enumerate(self.names)}

    def _interval(self, k: int, name: str, level: float) -> Interval:
        if self.doubt is None:
            return Interval(math.nan, math.nan, "not sought")
        if name in self.at_bound:
            return Interval(math.nan, math.nan, "at bound")
        doubt = self.doubt
        told = name not in self.undetermined and self.prior_share[name] < HALF
        reach = doubt.quantile(level, k) * float(doubt.std[k])
        ends = [self.numbers.value(k, float(np.clip(self.best[k] + side * reach, self.numbers.lower[k],
                                                    self.numbers.upper[k]))) for side in (-1.0, 1.0)]
        return Interval(ends[0], ends[1], "normal" if told else BELIEFS)

    @property
    def sentence(self) -> str:
        """How far the simulated robot is from the real one."""
        judged, before, where = (self.training, self.before, "fitted") if (
            self.holdout is None or self.before_holdout is None) else (self.holdout, self.before_holdout, "unseen")
        return (f"the simulated joints are {math.degrees(judged.rms()):.2f} deg rms off the measured ones on {where} "
                f"episodes, {math.degrees(before.rms()):.2f} deg before the fit")

    def __str__(self) -> str:
        """Return the sentence, causes, a line for each estimate, and what the episodes cannot say."""
        lines = []
        for name, (lower, upper, method) in self.intervals().items():
            spread = f"{lower:z.4g} to {upper:z.4g} ({method})" if lower == lower else method
            lines.append(f"{name} = {self.estimates[name]:z.4g} {self.units[name]}, {100 * self.level:g} %: {spread}")
        return "\n".join((self.sentence, *(cause.sentence for cause in self.causes), *lines,
                          *map(str, self.unidentifiable), *map(str, self.left_out), *self.warnings))

    def facts(self) -> dict[str, Any]:
        """Return all of it as plain numbers in SI units."""
        def told(found: RobotValidation | None) -> dict[str, Any] | None:
            return None if found is None else {
                "rms": found.rms(), "joints": {joint: kinds["all"].rms for joint, kinds in
                                               found.errors["servos"].items()}}

        return {
            "sentence": self.sentence, "latency": self.latency, "estimates": dict(self.estimates),
            "units": dict(self.units), "masses": dict(self.masses), "zeros": dict(self.zeros),
            "intervals": {name: {"lower": one.lower, "upper": one.upper, "method": one.method}
                          for name, one in self.intervals().items()},
            "supply": None if self.supply is None else {"open_circuit_voltage": self.supply.open_circuit_voltage,
                                                        "internal_resistance": self.supply.internal_resistance},
            "undetermined": [str(item) for item in self.unidentifiable], "at_bound": list(self.at_bound),
            "fitted": told(self.training), "unseen": told(self.holdout), "before": told(self.before),
            "before_unseen": told(self.before_holdout), "noise": dict(self.noise),
            "left_out": [window._asdict() for window in self.left_out],
            "causes": [cause._asdict() for cause in self.causes], "warnings": list(self.warnings),
            "interrupted": self.interrupted, "unknown": list(self.unknown),
            "registers": None if self.registers is None else self.registers.facts, "cpu_seconds": dict(self.stages)}

    def report(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write an HTML page.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        from servotwin.identification.report.page import write_arm_report

        return write_arm_report(self, Path(path), overwrite=overwrite)


# --- Causes that would explain more of a robot's episodes -------------------------------------------------------------

_LEAST_GAIN = 8.0  # of the cost
_LEAST_SHARE = 0.008  # of the cost
_APART = 0.12  # of a logarithm
_STEPS = 8
_CLEARLY = 0.85  # of how far a joint is off
_GAINS = (0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0)  # times the registers'
_GAIN, _SUPPLY, _MASSES = "proportional gain", "supply", "masses"
_FREE_STD = {_GAIN: 1.5, _SUPPLY: 1.5, _MASSES: 0.5}  # of the logarithm of what a candidate lets go


def causes_of(what: Problem, noise: Noise, x: Array, make: Callable[[Sequence[str]], Numbers]) -> tuple[ArmCause, ...]:
    """Return what makes the first stage fit better where it is let go, the best first.

    Parameters
    ----------
    what : Problem
    noise : Noise
    x : ndarray
        Where the first stage ended.
    make : callable
        Returns numbers with the gains of some joints searched too.
    """
    here = what.search(what.lanes(), noise).costs(x[None])[0]
    found = []
    for name in _WORDS:
        own, start = what, x
        if name == _GAIN:
            odd = _odd_gains(what, make)
            if not odd:
                continue
            own = what._replace(numbers=make(list(odd)))
            start = own.numbers.start.copy()
            start[[own.numbers.names.index(f"gain.{joint}") for joint in odd]] = np.log([*odd.values()])
        if not _loose(name, own.numbers):
            continue
        search = _let_go(name, own, own.lanes(), noise)
        found += _named(name, own, search, search.run(start, most=_STEPS), here)
    return tuple(sorted(found, key=lambda one: -one.gain))


def confirmed(causes: Sequence[ArmCause], what: Problem, arm: Copies, noise: Noise, x: Array,
              slopes: Sequence[Array]) -> tuple[ArmCause, ...]:
    """Return causes that make the whole robot fit better too, in its numbers; gains have been searched anyway.

    Of single joints the first stage has what others ask of them by smoothed measurements only: heavier links explain
    some of what that lacks.

    Parameters
    ----------
    causes : sequence of ArmCause
        Of the first stage.
    what : Problem
    arm : Copies
        The whole robot.
    noise : Noise
    x : ndarray
        Where the second stage ended.
    slopes : sequence of ndarray
        Its derivatives there.
    """
    found: list[ArmCause] = []
    here = what.search(arm, noise).costs(x[None])[0]
    for cause in causes:
        if cause.joints:
            found.append(cause)
            continue
        search = _let_go(cause.name, what, arm, noise)
        found += _named(cause.name, what, search, search.along(x, slopes, most=_STEPS), here)
    return tuple(found)


def _let_go(name: str, what: Problem, simulated: Copies, noise: Noise) -> ArmSearch:
    """Return a search in which hardly anything is believed of what a cause is of."""
    weight = what.numbers.weight.copy()
    weight[_loose(name, what.numbers)] = 1.0 / _FREE_STD[name]
    return what.search(simulated, noise, Prior(what.numbers.start, weight))


def _named(name: str, what: Problem, search: ArmSearch, ended: Array, here: float) -> list[ArmCause]:
    """Return a cause if the cost, which was `here`, is clearly less where a search without its belief ended."""
    loose = _loose(name, what.numbers)
    sentence = _WORDS[name](what.numbers, ended, loose)
    gain = here - search.costs(ended[None])[0] if sentence else 0.0
    if gain <= max(_LEAST_GAIN, _LEAST_SHARE * here):
        return []
    joints = tuple(_other_gains(what.numbers, ended, loose)) if name == _GAIN else ()
    return [ArmCause(name, sentence, gain, joints)]


def _odd_gains(what: Problem, make: Callable[[Sequence[str]], Numbers]) -> dict[str, float]:
    """Return the joints that are clearly less off with another gain than their registers say, and with which.

    In the first stage a joint's gain changes nothing of the others, so that all are tried at once; the other numbers
    are those of the files, which a wrong gain has not bent.
    """
    known = what.numbers
    if any(mount.model.servo.get(GAIN) is None or GAIN in group.space.names
           for mount in known.mounts.values() for group in known.groups):
        return {}
    own = make(list(known.joints))
    points = np.repeat(own.start[None], len(_GAINS), axis=0)
    points[:, [own.names.index(f"gain.{joint}") for joint in known.joints]] += np.log(_GAINS)[:, None]
    off = _off(what._replace(numbers=own), points)
    best = np.argmin(off, axis=0)
    return {joint: _GAINS[k] for j, (joint, k) in enumerate(zip(known.joints, best.tolist(), strict=True))
            if off[k, j] < _CLEARLY * off[_GAINS.index(1.0), j]}


def _off(what: Problem, points: Array) -> Array:
    """Return the mean distance of each joint from its measured place at several points, shape (points, joints) [rad].

    Not in units of noise: what a wrong gain leaves looks like noise, of the clock too, which all joints share.
    """
    lanes, total = what.lanes(), np.zeros((len(points), len(what.numbers.joints)))
    for episode, used in zip(what.episodes, what.used, strict=True):
        total += np.abs(residuals(lanes, episode, points) * used).sum(axis=1)
    return np.asarray(total / sum(used.sum(axis=0) for used in what.used))


def _loose(name: str, numbers: Numbers) -> list[int]:
    """Return the numbers that a cause is of."""
    begin = {_GAIN: "gain.", _SUPPLY: VOLTAGE, _MASSES: "mass."}[name]
    return [k for k, one in enumerate(numbers.names) if one.startswith(begin)]


def _other_gains(numbers: Numbers, x: Array, loose: Sequence[int]) -> dict[str, float]:
    """Return the joints whose gain ended clearly elsewhere than their registers say, and how many times that is."""
    return {numbers.names[k].removeprefix("gain."): math.exp(x[k]) for k in loose if abs(x[k]) >= 2.0 * _APART}


def _gain_words(numbers: Numbers, x: Array, loose: Sequence[int]) -> str:
    ratios = _other_gains(numbers, x, loose)
    if not ratios:
        return ""
    said = ", ".join(f"{ratio:.2g} times ({joint}{_register(numbers, joint, ratio)})"
                     for joint, ratio in ratios.items())
    return (f"the proportional gain looks like {said} what the registers of the servo say: a P register other than "
            "assumed")


def _register(numbers: Numbers, joint: str, ratio: float) -> str:
    assumed = numbers.mounts[joint].model.servo.source(GAIN).source or ""
    word = assumed.partition(") = ")[2].split(" ")[0].rstrip(";,")
    return f", about {round(int(word) * ratio)} in the place of {word}" if word.isdigit() else ""


def _supply_words(numbers: Numbers, x: Array, loose: Sequence[int]) -> str:
    k = loose[0]
    if abs(x[k] - numbers.start[k]) < _APART:
        return ""
    return (f"the supply looks like {numbers.value(k, float(x[k])):.3g} V in the place of "
            f"{numbers.value(k, float(numbers.start[k])):.3g} V")


def _mass_words(numbers: Numbers, x: Array, loose: Sequence[int]) -> str:
    k = max(loose, key=lambda one: abs(x[one]))
    if abs(x[k]) < 2.0 * _APART:
        return ""
    return (f"link {numbers.names[k].removeprefix('mass.')} looks {math.exp(x[k]):.2g} times as heavy as in the "
            "robot's file: a payload, or another part")


_WORDS: dict[str, Callable[[Numbers, Array, Sequence[int]], str]] = {
    _GAIN: _gain_words, _SUPPLY: _supply_words, _MASSES: _mass_words}


# --- How surely the numbers of a robot are known ----------------------------------------------------------------------

_BOTH = 2.0  # times the variance of half a difference: that of a single simulation


class Doubts(NamedTuple):
    """Uncertainty of the numbers, how much of what is known of each is belief, and what the episodes cannot say."""

    all: Uncertainty
    shares: dict[str, float]
    unidentifiable: tuple[Unidentifiable, ...]


def doubts_of(what: Problem, x: Array, noise: Noise, found: Sequence[Array], slopes: Sequence[Array],
              shakes: Sequence[Array]) -> Doubts:
    """Return what residuals and derivatives at a point say of the numbers.

    Parameters
    ----------
    what : Problem
    x : ndarray, shape (numbers,)
    noise : Noise
    found : sequence of ndarray, shape (n, joints)
        Residuals [rad].
    slopes, shakes : sequence of ndarray, shape (n, joints, numbers)
        Derivatives, and by how much a simulation is off them [rad]: half of what steps to either side differ by.
    """
    numbers, loss, nothing = what.numbers, Loss(HUBER), Prior(np.zeros(0), np.zeros(0))
    rows: list[Rows] = [rows_of(part, loss, nothing, np.zeros(0)) for episode, residual, slope, used in zip(
        what.episodes, found, slopes, what.used, strict=True)
        for part in parts_of(episode, residual, slope, noise, used)]
    stuck = what.at_bound(x)
    prior = what.prior
    beliefs = uncertainty(rows, prior, stuck)
    rough = [part for episode, residual, shake, used in zip(what.episodes, found, shakes, what.used, strict=True)
             for part in parts_of(episode, residual, shake, noise, used)]
    beliefs = replace(beliefs, covariance=beliefs.covariance + shaken(rows, rough, beliefs.curvature))
    known = np.array([numbers.weight[k] if name in (VOLTAGE, RESISTANCE) else 0.0
                      for k, name in enumerate(numbers.names)])
    moves = ~stuck
    information = (beliefs.information + np.diag(known**2))[np.ix_(moves, moves)]
    flags, directions = np.zeros(len(x), np.bool_), np.zeros((len(x), 0))
    flags[moves], some = vague_directions(information, beliefs.inflation, _sizes(what)[moves])
    directions = np.zeros((len(x), some.shape[1]))
    directions[moves] = some
    if some.shape[1]:
        directions = simplest(directions)
    belief = np.array([one.belief for one in numbers.all])
    prior_share = dict(zip(numbers.names, np.clip((beliefs.std / belief)**2, 0.0, 1.0).tolist(), strict=True))
    shares = [1.0 if one.logarithmic else math.nan for one in numbers.all]
    named = {str(one): one for one in explain(numbers.names, shares, flags, directions)}  # several of the same members
    return Doubts(beliefs, prior_share, tuple(named.values()))


def shaken(rows: Sequence[Rows], shakes: Sequence[LogPart], curvature: Array) -> Array:
    """Return the covariance that the roughness of simulations adds, shape (numbers, numbers).

    Servos that stick and slip end a hair elsewhere for the smallest change, over many samples, and residuals at the
    best point have that too. Each derivative shows a draw of it, halved: what its two sides differ by.

    Parameters
    ----------
    rows : sequence of Rows
        Rows of each part on the numbers.
    shakes : sequence of LogPart
        Its draws in the place of derivatives, in units of noise; those of 0 are none.
    curvature : ndarray, shape (numbers, numbers)
        Inverse curvature of the cost.
    """
    g = np.sum([(r.slope * r.inside[:, None]).T @ part.shared for r, part in zip(rows, shakes, strict=True)], axis=0)
    drawn = np.any([np.abs(part.shared).any(axis=0) for part in shakes], axis=0)
    off = curvature @ g[:, drawn]
    return np.asarray(_BOTH * off @ off.T / max(off.shape[1], 1))


def _sizes(what: Problem) -> Array:
    """Return what counts as the whole of a number, on its scale: what is believed of it, or 1."""
    weight = what.numbers.weight
    return np.where(weight > 0.0, 1.0 / np.maximum(weight, 1e-300), 1.0)
