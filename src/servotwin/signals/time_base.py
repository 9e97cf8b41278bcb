"""Times that are probably a thousand times too long or too short."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_FEWEST = 3  # samples, to tell a rhythm
_SLOW = 10.0  # s between samples: 20 ms would be 20 s
_WIDEST = 0.02  # s
_FAST = {"angle": 1000.0, "pulse_width": 0.6}  # rad/s, s/s: a hundred times what servos follow


def warn_of_time_base(time: NDArray[np.float64], value: NDArray[np.float64], kind: str, what: str, *,
                      stacklevel: int = 3) -> None:
    """Warn if samples come too far apart, or move too fast, for their times to be what they say.

    Parameters
    ----------
    time, value : ndarray, shape (n,)
        In SI, times increasing.
    kind : {"angle", "pulse_width", "voltage"}
    what : str
        Whose samples these are.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    if time.size < _FEWEST:
        return
    apart = float(np.median(np.diff(time)))
    if apart >= _SLOW:
        warnings.warn(f"{what}: its samples come {apart:g} s apart; were the times given in milliseconds?",
                      stacklevel=stacklevel)
    steps = np.abs(np.diff(value))
    span = float(time[-1] - time[0])
    if kind == "pulse_width" and value.max() > _WIDEST:
        return  # its unit is another one
    if kind in _FAST and np.count_nonzero(steps) > 1 and steps.sum() > _FAST[kind] * span:
        warnings.warn(f"{what}: its {time.size} samples go to and fro within {1e3 * span:g} ms, faster than any servo; "
                      "were the times given in seconds and read as milliseconds?", stacklevel=stacklevel)
