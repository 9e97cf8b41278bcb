"""A converter from voltage to counts, and the pulse that a program makes of a count."""

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


def supplied_count(gain: float, offset: float, highest: int, voltage: float, sag: float, command_share: float,
                   reference_share: float) -> int:
    """Return the count of a converter that hangs on a supply which has lost a part of its voltage.

    Parameters
    ----------
    gain, offset, highest
        Of the converter, as `counted` has them.
    voltage : float
        v, with the whole supply [V].
    sag : float
        x, the part of its voltage that the supply has lost [1].
    command_share : float
        s_v, how much of that the voltage loses too [1].
    reference_share : float
        s_r, how much of that the reference loses; s_r x < 1 [1].

    Examples
    --------
    >>> supplied_count(409.6, -0.82, 1023, 1.425, 0.01, 1.0, 0.0)
    577
    """
    return counted(gain / (1.0 - reference_share * sag), offset, highest, (1.0 - command_share * sag) * voltage)


def generated_steps(counts_per_step: int, count: int) -> int:
    """Return m = floor((count − 1)/counts_per_step) − 1, at least 0, of a counter that makes pulses.

    Examples
    --------
    >>> generated_steps(6, 582)
    95
    """
    return max(math.floor((count - 1) / counts_per_step) - 1, 0)


def generated_width(step: float, base: float, counts_per_step: int, count: int) -> float:
    """Return the width step m + base of the pulse for a count [s].

    Examples
    --------
    >>> round(1e6 * generated_width(16e-6, 6e-6, 6, 582))
    1526
    """
    return step * generated_steps(counts_per_step, count) + base
