"""The bench's pulse generator: a count of the converter becomes the width of a pulse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from servotwin.errors import InputError
from servotwin.physics.converter import generated_steps, generated_width

# --- The bench's pulse generator: a count of the converter becomes the width of a pulse -------------------------------

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


# --- Table II: the converter at the command ---------------------------------------------------------------------------

class Interval(NamedTuple):
    """All values from `lower` on and below `upper`; empty where `upper` is not above `lower`."""

    lower: float
    upper: float

    @property
    def middle(self) -> float:
        """The value half way."""
        return 0.5 * (self.lower + self.upper)

    @property
    def empty(self) -> bool:
        """Whether there is no such value."""
        return not self.lower < self.upper


def zero_offset_interval(command_voltages: Sequence[float], pulse_widths: Sequence[float], *,
                         gain: float = 1024 / 2.5, generator: PulseGenerator | None = None) -> Interval:
    """Return the zero offsets of a converter for which each voltage gives its pulse width.

    Parameters
    ----------
    command_voltages : sequence of float, length n
        V_i [V].
    pulse_widths : sequence of float, length n
        t_a, each one that the generator makes [s].
    gain : float
        Counts per volt [1/V].
    generator : PulseGenerator, optional
        The bench's unless given.

    Returns
    -------
    Interval
        [counts]; empty if no offset does it.

    Raises
    ------
    InputError
        If the lengths differ, or the generator does not make one of the widths.

    Examples
    --------
    >>> volts = [0.609, 1.002, 1.425, 1.827, 2.246]
    >>> widths = [646e-6, 1078e-6, 1526e-6, 1974e-6, 2438e-6]
    >>> [round(limit, 6) for limit in zero_offset_interval(volts, widths)]
    [-0.9616, -0.68]
    """
    if len(command_voltages) != len(pulse_widths) or not command_voltages:
        raise InputError("command voltages and pulse widths",
                         got=f"{len(command_voltages)} and {len(pulse_widths)}", allowed="as many of each, at least 1")
    make = generator or PulseGenerator()
    # floor(gain v + c) lies from first to last: first ≤ gain v + c < last + 1
    spans = [(make.counts(width), gain * volt) for volt, width in zip(command_voltages, pulse_widths, strict=True)]
    return Interval(max(first - exact for (first, _), exact in spans),
                    min(last + 1 - exact for (_, last), exact in spans))


def command_voltage_interval(count: int, *, gain: float = 1024 / 2.5, offset: float = 0.0) -> Interval:
    """Return the voltages that a converter turns into this count [V].

    Examples
    --------
    >>> [round(limit, 4) for limit in command_voltage_interval(582)]
    [1.4209, 1.4233]
    """
    return Interval((count - offset) / gain, (count + 1 - offset) / gain)
