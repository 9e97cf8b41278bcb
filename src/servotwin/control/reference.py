"""What is asked of a shaft over time: angle, speed, acceleration and jerk, as piecewise polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from servotwin.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_ORDERS = 4  # angle, speed, acceleration, jerk


class Reference(NamedTuple):
    """Where a shaft should be: numbers of one servo, or arrays (n,) of joints.

    Parameters
    ----------
    angle, speed, acceleration, jerk : float or ndarray
        [rad], [rad/s], [rad/s²], [rad/s³]

    Examples
    --------
    >>> Reference(0.5)
    Reference(angle=0.5, speed=0.0, acceleration=0.0, jerk=0.0)
    """

    angle: Any
    speed: Any = 0.0
    acceleration: Any = 0.0
    jerk: Any = 0.0


class Path(Protocol):
    """What a controller can be told to follow: a `Trajectory`, or one that went through a shaper."""

    @property
    def duration(self) -> float:
        """When it ends [s]."""

    def at(self, time: ArrayLike) -> Reference:
        """Return what is asked for at `time` [s], any shape; of joints the arrays have one axis more, the last."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A piecewise polynomial from 0 to its end, which rests before and after.

    Parameters
    ----------
    breaks : array_like, shape (m + 1,)
        Increasing, from 0 [s].
    coefficients : array_like, shape (k, m) or (k, m, n)
        Of each piece, the highest power of (t − start) first, of one servo or of n joints [rad/s^power].

    Examples
    --------
    >>> ramp = Trajectory([0.0, 2.0], [[0.5], [1.0]])
    >>> ramp.duration, ramp.at(1.0).angle, ramp.at(3.0)
    (2.0, 1.5, Reference(angle=2.0, speed=0.0, acceleration=0.0, jerk=0.0))
    """

    breaks: ArrayLike
    coefficients: ArrayLike

    def __post_init__(self) -> None:
        breaks, c = np.asarray(self.breaks, dtype=np.float64), np.asarray(self.coefficients, dtype=np.float64)
        if breaks.ndim != 1 or c.ndim not in (2, 3) or c.shape[1] != len(breaks) - 1 or not c.shape[1]:
            raise InputError("trajectory", got=f"{breaks.shape} breaks and coefficients of shape {c.shape}",
                             allowed="(m + 1,) and (k, m) or (k, m, n)")
        increasing = breaks[0] == 0.0 and (np.diff(breaks) > 0.0).all() and np.isfinite(breaks).all()
        if not (increasing and np.isfinite(c).all()):
            raise InputError("trajectory", got="times or numbers that it cannot follow",
                             allowed="finite numbers, and times that increase from 0 [s]")
        object.__setattr__(self, "breaks", breaks)
        object.__setattr__(self, "coefficients", c)
        object.__setattr__(self, "_derivatives", _derivatives(c))

    @property
    def duration(self) -> float:
        """When it ends [s]."""
        return float(np.asarray(self.breaks)[-1])

    def at(self, time: ArrayLike) -> Reference:
        """Return what is asked for at `time` [s], any shape; of joints the arrays have one axis more, the last."""
        breaks, t = np.asarray(self.breaks), np.asarray(time, dtype=np.float64)
        inside = np.clip(t, 0.0, breaks[-1])
        k = np.clip(np.searchsorted(breaks, inside, side="right") - 1, 0, len(breaks) - 2)
        s, moves = inside - breaks[k], (t >= 0.0) & (t <= breaks[-1])
        tables: tuple[NDArray[np.float64], ...] = self._derivatives  # type: ignore[attr-defined]
        if tables[0].ndim == 3:
            s, moves = s[..., None], moves[..., None]
        values = [_horner(table[:, k], s) for table in tables]
        rates = [np.where(moves, rate, 0.0) for rate in values[1:]]
        return Reference(*(x if x.ndim else float(x) for x in (values[0], *rates)))


def _derivatives(c: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the coefficients of angle, speed, acceleration and jerk."""
    tables = [c]
    for _ in range(_ORDERS - 1):
        c = tables[-1]
        powers = np.arange(len(c) - 1, 0, -1.0).reshape(-1, *[1] * (c.ndim - 1))
        tables.append(c[:-1] * powers if len(c) > 1 else np.zeros_like(c))
    return tuple(tables)


def _horner(table: NDArray[np.float64], s: NDArray[np.float64]) -> NDArray[np.float64]:
    value: NDArray[np.float64] = table[0] + 0.0 * s
    for row in table[1:]:
        value = value * s + row
    return value
