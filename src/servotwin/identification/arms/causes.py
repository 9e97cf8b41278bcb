"""What would explain more of a robot's episodes: a gain that is not the registers', another supply, other masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.arm_fit import ArmCause
from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.lanes import JointLanes
from servotwin.identification.arms.numbers import GAIN, VOLTAGE, Numbers
from servotwin.identification.arms.rows import Mask, Noise, residuals
from servotwin.identification.arms.search import ArmSearch
from servotwin.identification.fitting.arrow import Loss, Prior

Array = NDArray[np.float64]
_LEAST_GAIN = 8.0  # of the cost
_LEAST_SHARE = 0.008  # of the cost
_APART = 0.12  # of a logarithm
_STEPS = 8
_CLEARLY = 0.85  # of how far a joint is off
_GAINS = (0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0)  # times the registers'
_FREE_STD = 1.5  # of the logarithm of what a candidate lets go


def causes_of(plant: Any, numbers: Numbers, links: Sequence[int], episodes: Sequence[Episode], used: Sequence[Mask],
              noise: Noise, x: Array, make: Callable[[Sequence[str]], Numbers]) -> tuple[ArmCause, ...]:
    """Return what makes the first stage fit better where it is let go, the best first.

    Parameters
    ----------
    plant, numbers, links, episodes, used, noise
        Of the fit.
    x : ndarray
        Where the first stage ended.
    make : callable
        Returns numbers with the gains of some joints searched too.
    """
    def problem(own: Numbers, weight: Array) -> ArmSearch:
        return ArmSearch(JointLanes(plant, own, links), episodes, used, noise, Loss(1.345), Prior(own.start, weight),
                         np.zeros(len(own), np.bool_))

    here = problem(numbers, numbers.weight).costs(x[None])[0]
    found = []
    for name, words in (("proportional gain", _gain_words), ("supply", _supply_words), ("masses", _mass_words)):
        own, start = numbers, x
        if name == "proportional gain":
            odd = _odd_gains(problem(numbers, numbers.weight), make)
            if not odd:
                continue
            own = make(list(odd))
            start = own.start.copy()
            start[[own.names.index(f"gain.{joint}") for joint in odd]] = np.log([*odd.values()])
        loose, weight = [k for k, one in enumerate(own.names) if _lets_go(name, one)], own.weight.copy()
        if not loose:
            continue
        weight[loose] = 1.0 / _FREE_STD if name != "masses" else 0.0
        search = problem(own, weight)
        ended = search.run(start, most=_STEPS)
        gain = here - search.costs(ended[None])[0]
        sentence = words(own, ended, loose)
        if sentence and gain > max(_LEAST_GAIN, _LEAST_SHARE * here):
            joints = tuple(own.names[k].removeprefix("gain.") for k in loose) if own is not numbers else ()
            found.append(ArmCause(name, sentence, gain, joints))
    return tuple(sorted(found, key=lambda one: -one.gain))


def _odd_gains(search: ArmSearch, make: Callable[[Sequence[str]], Numbers]) -> dict[str, float]:
    """Return the joints that are clearly less off with another gain than their registers say, and with which.

    In the first stage a joint's gain changes nothing of the others, so that all are tried at once; the other numbers
    are those of the files, which a wrong gain has not bent.
    """
    known = search.simulated.numbers
    if any(mount.model.servo.get(GAIN) is None or GAIN in group.space.names
           for mount in known.mounts.values() for group in known.groups):
        return {}
    own = make(list(known.joints))
    points = np.repeat(own.start[None], len(_GAINS), axis=0)
    points[:, [own.names.index(f"gain.{joint}") for joint in known.joints]] += np.log(_GAINS)[:, None]
    lanes = JointLanes(search.simulated.plant, own, search.simulated.links)
    off = _off(ArmSearch(lanes, search.episodes, search.used, search.noise, search.loss,
                         Prior(own.start, own.weight), np.zeros(len(own), np.bool_)), points)
    best = np.argmin(off, axis=0)
    return {joint: _GAINS[k] for j, (joint, k) in enumerate(zip(known.joints, best.tolist(), strict=True))
            if off[k, j] < _CLEARLY * off[_GAINS.index(1.0), j]}


def _off(search: ArmSearch, points: Array) -> Array:
    """Return the mean distance of each joint from its measured place at several points, shape (points, joints) [rad].

    Not in units of noise: what a wrong gain leaves looks like noise, of the clock too, which all joints share.
    """
    total = np.zeros((len(points), len(search.simulated.numbers.joints)))
    for episode, used in zip(search.episodes, search.used, strict=True):
        total += np.abs(residuals(search.simulated, episode, points) * used).sum(axis=1)
    return np.asarray(total / sum(used.sum(axis=0) for used in search.used))


def _lets_go(candidate: str, name: str) -> bool:
    return {"proportional gain": name.startswith("gain."), "supply": name == VOLTAGE,
            "masses": name.startswith("mass.")}[candidate]


def _gain_words(numbers: Numbers, x: Array, loose: Sequence[int]) -> str:
    ratios = {numbers.names[k].removeprefix("gain."): math.exp(x[k]) for k in loose}
    if all(abs(math.log(ratio)) < 2.0 * _APART for ratio in ratios.values()):
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
