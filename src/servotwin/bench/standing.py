"""How a shaft stands that was commanded to stand still: where, how far it swings, how often."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from servotwin.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from servotwin.simulation import Result

_LOOK = 1e-4  # s between two looks at the solution: short beside the drives that make a shaft swing
_LEAST = math.radians(0.05)  # rad; an eighth of half the deadband of the paper's servo
_PART = 0.25  # of the largest swing: what is smaller does not count beside it


@dataclass(frozen=True, kw_only=True)
class Standing:
    """The motion of a shaft over a stretch of time, seen every 0.1 ms.

    Parameters
    ----------
    mean : float
        Mean output angle [rad].
    swing : float
        Highest less lowest output angle, creep included [rad].
    frequency : float
        Swings there and back per second, the small ones between large ones apart; a shaft that creeps one way has
        none [Hz].
    current : float
        Root of the mean square of the armature current [A].
    lowest_bus : float
        Lowest voltage of the supply; nan where the model has none [V].
    """

    mean: float
    swing: float
    frequency: float
    current: float
    lowest_bus: float


def standing(result: Result, start: float, end: float | None = None, *, least: float | None = None) -> Standing:
    """Return how the shaft of a run stands from `start` to `end`.

    Parameters
    ----------
    result : Result
        Of a servo.
    start, end : float
        [s]; to the end of the run unless given.
    least : float, optional
        Least swing that counts, positive; a quarter of the largest way there and back, but not less than 0.05°,
        unless given [rad].

    Raises
    ------
    InputError
        If the stretch is not within the run, or `least` is not positive.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> still = standing(st.simulate(model, st.signals.constant(90.0, unit="deg"), duration=0.1), 0.05)
    >>> still.swing, still.frequency, still.current
    (0.0, 0.0, 0.0)
    """
    last = result.ended if end is None else end
    if not (math.isfinite(start) and 0.0 <= start < last <= result.ended):
        raise InputError("stretch of time", got=f"{start!r} to {last!r} s", allowed=f"from 0 to {result.ended:g} s")
    if least is not None and not (math.isfinite(least) and least > 0.0):
        raise InputError("least swing", got=least, allowed="a positive angle [rad]")
    times = np.linspace(start, last, math.ceil((last - start) / _LOOK) + 1)
    looked = replace(result, time=times)  # one state for all signals
    angle, current = looked["output_angle"], looked["armature_current"]
    bus = looked["bus_voltage"] if "bus_voltage" in result.names else np.array([math.nan])
    if least is None:
        least = max(_PART * _largest(angle), _LEAST)
    return Standing(mean=float(angle.mean()), swing=float(np.ptp(angle)), lowest_bus=float(bus.min()),
                    frequency=0.5 * len(turning_points(angle.tolist(), least)) / (last - start),
                    current=float(np.sqrt(np.mean(current**2))))


def turning_points(values: Iterable[float], least: float) -> list[float]:
    """Return the values at which others turn back by more than `least`.

    Examples
    --------
    >>> turning_points([0.0, 1.0, 0.9, 2.0, 1.0, 1.2, 3.0], 0.5)
    [2.0, 1.0]
    """
    lowest, highest, way, turns = math.inf, -math.inf, 0, []
    for value in values:
        if way >= 0:
            highest = max(highest, value)
        if way <= 0:
            lowest = min(lowest, value)
        if way >= 0 and highest - value > least:
            turns += [highest] if way > 0 else []
            way, lowest = -1, value
        elif way <= 0 and value - lowest > least:
            turns += [lowest] if way < 0 else []
            way, highest = 1, value
    return turns


def _largest(values: NDArray[np.float64]) -> float:
    """Return the largest way up that is also gone down again, before or after, or the other way round."""
    lowest, highest = np.minimum.accumulate, np.maximum.accumulate
    low = np.maximum(lowest(values), lowest(values[::-1])[::-1])  # of what lies before and what lies after
    high = np.minimum(highest(values), highest(values[::-1])[::-1])
    return float(max((values - low).max(), (high - values).max()))
