"""A converter from voltage to counts."""

from __future__ import annotations

import math


def counted(gain: float, offset: float, highest: int, voltage: float) -> int:
    """Return the count of an analog-digital converter: floor(gain v + offset), kept within its range.

    Parameters
    ----------
    gain : float
        2^bits over the reference [1/V].
    offset : float
        Shift of the zero [counts].
    highest : int
        2^bits − 1
    voltage : float
        v [V].

    Examples
    --------
    >>> counted(409.6, -0.82, 1023, 1.425)
    582
    """
    return min(max(math.floor(gain * voltage + offset), 0), highest)
