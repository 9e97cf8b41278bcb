"""What would explain more of a robot's episodes: a gain that is not the registers', another supply, other masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.arm_fit import ArmCause
from servotwin.identification.arms.copies import Copies
from servotwin.identification.arms.numbers import GAIN, VOLTAGE, Numbers
from servotwin.identification.arms.problem import Problem
from servotwin.identification.arms.rows import Noise, residuals
from servotwin.identification.arms.search import ArmSearch
from servotwin.identification.fitting.arrow import Prior

Array = NDArray[np.float64]
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

    Of single joints the first stage knows what others ask of them by smoothed measurements only: heavier links explain
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
