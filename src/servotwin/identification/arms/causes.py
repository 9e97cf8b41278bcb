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
from servotwin.identification.arms.rows import Mask, Noise
from servotwin.identification.arms.search import ArmSearch
from servotwin.identification.fitting.arrow import Loss, Prior

Array = NDArray[np.float64]
GAIN = "firmware.proportional_gain"
_LEAST_GAIN = 12.0  # of the cost
_LEAST_SHARE = 0.03  # of the cost
_APART = 0.12  # of a logarithm
_STEPS = 5
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
        start = other.start.copy()
        for k, one in enumerate(other.names):
            if one in numbers.names:
                start[k] = x[numbers.names.index(one)]
        search = ArmSearch(JointLanes(plant, other, links), episodes, used, noise, loss, Prior(other.start, weight),
                           np.zeros(len(other), np.bool_))
        ended = search.run(start, most=_STEPS)
        gain = here - search.costs(ended[None])[0]
        sentence = words(other, ended, loose)
        if sentence and gain > max(_LEAST_GAIN, _LEAST_SHARE * here):
            found.append(ArmCause(name, sentence, gain))
    return tuple(sorted(found, key=lambda one: -one.gain))


def _lets_go(candidate: str, name: str) -> bool:
    return {"proportional gain": name.endswith(GAIN), "supply": name == VOLTAGE,
            "masses": name.startswith("mass.")}[candidate]


def _gain_words(numbers: Numbers, x: Array, loose: Sequence[int]) -> str:
    ratios = {numbers.names[k].removesuffix(GAIN).removesuffix(": "): math.exp(x[k] - numbers.start[k]) for k in loose}
    if all(abs(math.log(ratio)) < _APART for ratio in ratios.values()):
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
