"""Input shaping: a motion sent in parts, so timed that what each of them makes ring is cancelled by the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servotwin.control.reference import Path, Reference
from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True)
class InputShaper:
    """Impulses whose sum is 1, with which a motion is convolved: `shaper.of(trajectory)`.

    Parameters
    ----------
    times : tuple of float
        From 0 on [s].
    amplitudes : tuple of float
        Sum 1.

    Examples
    --------
    >>> from servotwin.control import quintic
    >>> shaper = zero_vibration(frequency=10.0)
    >>> move = quintic([0.0, 1.0], times=[0.0, 0.4])
    >>> shaper.amplitudes, round(shaper.of(move).duration, 3)
    ((0.5, 0.5), 0.714)
    """

    times: tuple[float, ...]
    amplitudes: tuple[float, ...]

    def __post_init__(self) -> None:
        if not (len(self.times) == len(self.amplitudes) > 0 and all(map(is_finite, self.times + self.amplitudes))
                and min(self.times) >= 0.0 and math.isclose(sum(self.amplitudes), 1.0, abs_tol=1e-9)):
            raise InputError("InputShaper", got=(self.times, self.amplitudes),
                             allowed="as many amplitudes, of sum 1, as times from 0 s on")

    def of(self, path: Path) -> Shaped:
        """Return a motion through the shaper."""
        return Shaped(path=path, shaper=self)


@dataclass(frozen=True, kw_only=True)
class Shaped:
    """A motion that went through a shaper: Σ A_i r(t − t_i).

    Parameters
    ----------
    path : Path
        Rests before and after.
    shaper : InputShaper
    """

    path: Path
    shaper: InputShaper

    @property
    def duration(self) -> float:
        """When the last part ends [s]."""
        return self.path.duration + max(self.shaper.times)

    def at(self, time: ArrayLike) -> Reference:
        """Return what is asked for at `time` [s]."""
        t = np.asarray(time, dtype=np.float64)
        parts = [[A * x for x in self.path.at(t - t_i)]
                 for t_i, A in zip(self.shaper.times, self.shaper.amplitudes, strict=True)]
        return Reference(*map(sum, zip(*parts, strict=True)))


def zero_vibration(*, frequency: float, damping_ratio: float = 0.0) -> InputShaper:
    """Return the two impulses after which a mode does not ring (ZV).

    Parameters
    ----------
    frequency : float
        Undamped, ω_n [rad/s].
    damping_ratio : float
        ζ, from 0 to less than 1.

    Notes
    -----
    Singer and Seering, Preshaping command inputs to reduce system vibration, J. Dyn. Sys. Meas. Control 112 (1990).

    Examples
    --------
    >>> zero_vibration(frequency=math.pi).times
    (0.0, 1.0)
    """
    return _binomial(frequency, damping_ratio, 1)


def zero_vibration_derivative(*, frequency: float, damping_ratio: float = 0.0) -> InputShaper:
    """Return the three impulses that also forgive a wrong frequency, to first order (ZVD).

    Parameters
    ----------
    frequency : float
        Undamped, ω_n [rad/s].
    damping_ratio : float
        ζ, from 0 to less than 1.

    Notes
    -----
    Singer and Seering 1990, as `zero_vibration`.

    Examples
    --------
    >>> zero_vibration_derivative(frequency=math.pi).amplitudes
    (0.25, 0.5, 0.25)
    """
    return _binomial(frequency, damping_ratio, 2)


def _binomial(frequency: float, damping_ratio: float, order: int) -> InputShaper:
    if not (is_finite(frequency) and frequency > 0.0):
        raise InputError("frequency of a shaper", got=frequency, allowed="a positive number [rad/s]")
    if not (is_finite(damping_ratio) and 0.0 <= damping_ratio < 1.0):
        raise InputError("damping_ratio of a shaper", got=damping_ratio, allowed="from 0 to less than 1")
    root = math.sqrt(1.0 - damping_ratio**2)
    half, K = math.pi / (frequency * root), math.exp(-damping_ratio * math.pi / root)
    shares = [math.comb(order, i) * K**i for i in range(order + 1)]
    return InputShaper(times=tuple(i * half for i in range(order + 1)),
                       amplitudes=tuple(share / sum(shares) for share in shares))
