"""What Table II says about the converter at the command."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from servotwin.bench.generator import PulseGenerator
from servotwin.errors import InputError


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
