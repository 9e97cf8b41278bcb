"""Gaussian draws by counting: any draw of any seed at once, the same in plain Python and compiled.

The hash is O'Neill's PCG-RXS-M-XS with 32 bits (M. E. O'Neill, HMC-CS-2014-0905, 2014). Its products stay below 2^62,
so that signed 64-bit integers hold them.
"""

from __future__ import annotations

import math

from servotwin.physics.elementary import cos, log, power

_MASK = 0xFFFFFFFF
_UNIT = 2.3283064365386963e-10  # 2^-32
_TURN = 6.283185307179586


def scrambled(n: int) -> int:
    """Return a hash of the lowest 32 bits of n, one-to-one within 32 bits.

    Examples
    --------
    >>> scrambled(0), scrambled(1)
    (129708002, 2831084092)
    """
    state = ((n & _MASK) * 747796405 + 2891336453) & _MASK
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & _MASK
    return (word >> 22) ^ word


def gaussian(seed: int, frame: int) -> float:
    """Return the draw of a frame: mean 0, variance 1, independent of all other frames and seeds.

    Parameters
    ----------
    seed : int
        Of 64 bits.
    frame : int
        ≥ 0

    Examples
    --------
    >>> gaussian(1, 0) == gaussian(1, 0), gaussian(1, 0) == gaussian(1, 1)
    (True, False)
    """
    a = scrambled(frame + scrambled(seed + scrambled(seed >> 32)))
    b = scrambled(a ^ 0x5BD1E995)
    radius = math.sqrt(-2.0 * log((a + 0.5) * _UNIT))
    return radius * cos(_TURN * ((b + 0.5) * _UNIT))


def uniform(seed: int, number: int) -> float:
    """Return a draw from 0 to 1, both excluded, by its number, independent of those of `gaussian`.

    Examples
    --------
    >>> uniform(1, 0) == uniform(1, 0), 0.0 < uniform(1, 1) < 1.0
    (True, True)
    """
    a = scrambled(number + scrambled(seed + scrambled(seed >> 32)))
    return (scrambled(a ^ 0x2545F491) + 0.5) * _UNIT


def chosen(seed: int, number: int, count: int) -> int:
    """Return which of so many is drawn by its number, 0 the first, independent of `gaussian` and `uniform`.

    Examples
    --------
    >>> [chosen(7, number, 100) for number in range(4)]
    [22, 1, 98, 98]
    """
    a = scrambled(number + scrambled(seed + scrambled(seed >> 32)))
    return scrambled(a ^ 0x27D4EB2F) % count


def drawn(seed: int, number: int, low: float, high: float) -> float:
    """Return a draw from low to high, both positive, evenly over their logarithm.

    Examples
    --------
    >>> 2.0 < drawn(7, 0, 2.0, 8.0) < 8.0
    True
    """
    return low * power(high / low, uniform(seed, number))
