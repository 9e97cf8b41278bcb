"""Stamps that count the turns of a loop: k/30 s says nothing of turns that were late."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.fit import Trace
from servotwin.identification.fitting.verdict import Cause, shown

Array = NDArray[np.float64]

_EVEN = 1e-3  # of a turn: stamps of a clock are not as even
_PARTS = 4  # of a log
_FEWEST, _NEEDED = 20, 4  # samples of a part that moves, and such parts
_MOVES = 0.3  # of the largest speed
_MOST = 0.1  # of a turn, in any part: what a model lacks is more somewhere, in slow motions first
_WITHIN = 2.0  # standard deviations: how late a turn may be
_NORMAL = 1.4826  # standard deviation over median magnitude of a normal law


def counts_turns(times: Sequence[Array]) -> bool:
    """Tell whether all stamps [s] count the turns of a loop, as those of datasets do (k/30 s): no clock is as even.

    Examples
    --------
    >>> counts_turns([np.arange(90) / 30.0]), counts_turns([np.array([0.0, 0.0333, 0.0669, 0.1])])
    (True, False)
    """
    return all(float(np.ptp(steps)) <= _EVEN * float(np.median(steps)) for steps in map(np.diff, times))


def counted_stamps(traces: Sequence[Trace], sensor: str, noise: float) -> Cause | None:
    """Return stamps that count turns as a cause, where late turns leave as much, in no motion more.

    Parameters
    ----------
    traces : sequence of Trace
        Of the fitted logs.
    sensor : str
        The angle's name.
    noise : float
        Of the sensor (SI).
    """
    steps = [float(np.median(np.diff(trace.log.time))) for trace in traces]
    if not counts_turns([trace.log.time for trace in traces]):
        return None
    speeds = [np.gradient(trace.simulated, trace.time) for trace in traces]
    late = [value for trace, speed in zip(traces, speeds, strict=True)
            for left, fast in zip(*(np.array_split(one, _PARTS) for one in (trace.residual, speed)), strict=True)
            if (value := _lateness(left, fast, noise)) is not None]
    if len(late) < _NEEDED or max(late) > _MOST * min(steps):
        return None
    sigma = float(np.sqrt(np.mean(np.square(late))))
    every = np.concatenate([trace.residual for trace in traces])
    beyond = np.maximum(np.abs(every) - _WITHIN * sigma * np.abs(np.concatenate(speeds)), 0.0)
    before, after = (float(np.sqrt(np.mean(one**2))) for one in (every, beyond))
    remedy = "have the logger stamp each row when it is measured"
    return Cause("stamps", (
        f"stamps that count turns, one every {1e3 * max(steps):.3g} ms, and say nothing of late ones: turns off by "
        f"{1e3 * sigma:.2g} ms leave as much, in fast and slow motions; beyond twice that the error is "
        f"{shown(after, sensor)} instead of {shown(before, sensor)} ({remedy})"), before, after, remedy)


def _lateness(residual: Array, speed: Array, noise: float) -> float | None:
    """Return by how much times would be off that leave these residuals [s]; None where too little moves."""
    moves = np.abs(speed) > max(_MOVES * float(np.abs(speed).max()), 1e-12)
    if moves.sum() < _FEWEST:
        return None
    off = _NORMAL * float(np.median(np.abs(residual[moves] / speed[moves])))
    return math.sqrt(max(off**2 - (noise / float(np.median(np.abs(speed[moves]))))**2, 0.0))
