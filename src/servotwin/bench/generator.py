"""The bench's pulse generator: a count of the converter becomes the width of a pulse."""

from __future__ import annotations

import math
from dataclasses import dataclass

from servotwin.errors import InputError
from servotwin.physics.converter import generated_steps, generated_width


@dataclass(frozen=True, kw_only=True)
class PulseGenerator:
    """A counter that makes t_a = step m + base, with m = floor((count − 1)/counts_per_step) − 1.

    All of it is inferred from the five rows of Table II; the paper does not describe its generator.

    Parameters
    ----------
    step : float
        Resolution of the pulse width [s].
    base : float
        Width at m = 0 [s].
    counts_per_step : int
        Counts of the converter for one step [1].
    steps_per_frame : int
        Steps from one rising edge to the next [1].

    Raises
    ------
    InputError
        If a value is not positive.

    Examples
    --------
    >>> generator = PulseGenerator()
    >>> [round(1e6 * generator.width(count)) for count in (250, 411, 582, 748, 920)]
    [646, 1078, 1526, 1974, 2438]
    >>> round(generator.pulse_rate, 3)
    61.035
    """

    step: float = 16e-6
    base: float = 6e-6
    counts_per_step: int = 6
    steps_per_frame: int = 1024

    def __post_init__(self) -> None:
        for name in ("step", "base", "counts_per_step", "steps_per_frame"):
            value = getattr(self, name)
            if isinstance(value, bool) or not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} of the pulse generator", got=value, allowed="a positive number")

    @property
    def frame_period(self) -> float:
        """Time between rising edges [s]."""
        return self.steps_per_frame * self.step

    @property
    def pulse_rate(self) -> float:
        """Pulses per second f [Hz]."""
        return 1.0 / self.frame_period

    def steps(self, count: int) -> int:
        """Return m, at least 0 (assumed: Table II has no count that low)."""
        return generated_steps(self.counts_per_step, count)

    def width(self, count: int) -> float:
        """Return the pulse width t_a for a count of the converter [s]."""
        return generated_width(self.step, self.base, self.counts_per_step, count)

    def counts(self, width: float) -> tuple[int, int]:
        """Return the first and the last count that give this pulse width [s].

        Raises
        ------
        InputError
            If the generator does not make this width.

        Examples
        --------
        >>> PulseGenerator().counts(1526e-6)
        (577, 582)
        """
        m = round((width - self.base) / self.step)
        if m < 0 or abs(self.step * m + self.base - width) > 1e-3 * self.step:
            raise InputError("pulse width", got=width,
                             allowed=f"{self.base:g} s and whole steps of {self.step:g} s more")
        first = self.counts_per_step * (m + 1) + 1
        return first, first + self.counts_per_step - 1
