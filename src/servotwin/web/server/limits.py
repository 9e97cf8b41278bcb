"""How much one visitor may ask for."""

from __future__ import annotations

MOST_VISITORS = 8
MOST_WATCHERS = 40
LONGEST_MESSAGE = 1_000_000  # bytes: the text of a scene
LONGEST_UPLOAD = 20_000_000  # bytes


class Allowance:
    """So many things a second, and so many at once.

    Parameters
    ----------
    rate : float
        [1/s]
    burst : float
        At once.

    Examples
    --------
    >>> allowance = Allowance(rate=10.0, burst=2.0)
    >>> [allowance.take(now) for now in (0.0, 0.0, 0.0, 0.1)]
    [True, True, False, True]
    """

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._left, self._at = burst, 0.0

    def take(self, now: float) -> bool:
        """Return whether one more is allowed at a time on the wall [s]."""
        self._left = min(self._burst, self._left + self._rate * max(now - self._at, 0.0))
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
