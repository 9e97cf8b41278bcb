"""What would explain more of a robot's episodes: a gain that is not the registers', another supply, other masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.arm_fit import ArmCause
from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.lanes import JointLanes
from servotwin.identification.arms.numbers import VOLTAGE, Numbers
from servotwin.identification.arms.rows import Mask, Noise, residuals, whitened
from servotwin.identification.arms.search import ArmSearch
from servotwin.identification.fitting.arrow import Loss, Prior

Array = NDArray[np.float64]
GAIN = "firmware.proportional_gain"
_LEAST_GAIN = 8.0  # of the cost
_LEAST_SHARE = 0.008  # of the cost
_APART = 0.12  # of a logarithm
_STEPS = 8
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
        Returns numbers with more of them searched, by their names.
    """
    loss = Loss(1.345)
    own = ArmSearch(JointLanes(plant, numbers, links), episodes, used, noise, loss,
                    Prior(numbers.start, numbers.weight), np.zeros(len(numbers), np.bool_))
    here = own.costs(x[None])[0]
    found = []
    for name, words in (("proportional gain", _gain_words), ("supply", _supply_words), ("masses", _mass_words)):
        other = make([GAIN]) if name == "proportional gain" else numbers
        weight = other.weight.copy()
        loose = [k for k, one in enumerate(other.names) if _lets_go(name, one)]
        if not loose:
            continue
        weight[loose] = 1.0 / _FREE_STD if name != "masses" else 0.0
        search = ArmSearch(JointLanes(plant, other, links), episodes, used, noise, loss, Prior(other.start, weight),
                           np.zeros(len(other), np.bool_))
        start = _best_gains(search, loose) if name == "proportional gain" else x.copy()
        ended = search.run(start, most=_STEPS)
        gain = here - search.costs(ended[None])[0]
        sentence = words(other, ended, loose)
        if sentence and gain > max(_LEAST_GAIN, _LEAST_SHARE * here):
            found.append(ArmCause(name, sentence, gain))
    return tuple(sorted(found, key=lambda one: -one.gain))


def _best_gains(search: ArmSearch, loose: Sequence[int]) -> Array:
    """Return where a search of gains begins: of some, those under which the joints of each group are least off."""
    numbers = search.simulated.numbers
    points = np.repeat(numbers.start[None], len(_GAINS), axis=0)
    points[:, loose] += np.log(_GAINS)[:, None]
    off = _off(search, points)
    start = numbers.start.copy()
    for group in numbers.groups:
        own = [k for k in loose if len(numbers.groups) == 1 or numbers.names[k].startswith(f"{group.name}: ")]
        start[own] += math.log(_GAINS[int(np.argmin(off[:, list(group.joints)].sum(axis=1)))])
    return start


def _off(search: ArmSearch, points: Array) -> Array:
    """Return how far each joint is off at several points, in units of noise, shape (points, joints)."""
    total = np.zeros((len(points), len(search.simulated.numbers.joints)))
    for episode, used in zip(search.episodes, search.used, strict=True):
        for k, residual in enumerate(residuals(search.simulated, episode, points)):
            total[k] += np.abs(whitened(residual, episode, search.noise, used)).sum(axis=0)
    return total


def _lets_go(candidate: str, name: str) -> bool:
    return {"proportional gain": name.endswith(GAIN), "supply": name == VOLTAGE,
            "masses": name.startswith("mass.")}[candidate]


def _gain_words(numbers: Numbers, x: Array, loose: Sequence[int]) -> str:
    ratios = {numbers.names[k].removesuffix(GAIN).removesuffix(": "): math.exp(x[k] - numbers.start[k]) for k in loose}
    if all(abs(math.log(ratio)) < 2.0 * _APART for ratio in ratios.values()):
        return ""
    said = ", ".join(f"{ratio:.2g} times" + (f" ({name})" if name else "") for name, ratio in ratios.items())
    return (f"the proportional gain of the servos looks like {said} what their registers say: a P register other than "
            f"assumed{_registers(numbers, ratios)}")


def _registers(numbers: Numbers, ratios: Mapping[str, float]) -> str:
    assumed = next(iter(numbers.mounts.values())).model.servo.source(GAIN).source or ""
    word = assumed.partition(") = ")[2].split(" ")[0].rstrip(";,") if "P_Coefficient" in assumed else ""
    if not word.isdigit():
        return ""
    return f", about {round(int(word) * next(iter(ratios.values())))} in the place of {word}"


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
