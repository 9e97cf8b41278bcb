"""The converters of the bench: a voltage becomes a whole number of counts."""

from __future__ import annotations

import math
from dataclasses import dataclass

from servotwin.errors import InputError
from servotwin.physics.converter import counted


@dataclass(frozen=True, kw_only=True)
class Converter:
    """An analog-digital converter: count = floor(2^bits v / reference + offset), kept within its range.

    Parameters
    ----------
    bits : int
        Number of bits, 1 to 24.
    reference : float
        Voltage of the full range, positive [V].
    offset : float
        Shift of the zero; half a count more turns cutting into rounding [counts].

    Raises
    ------
    InputError
        If a value is out of its range.

    Examples
    --------
    >>> Converter(bits=10, reference=2.5).count(1.25)
    512
    """

    bits: int = 10
    reference: float = 2.5
    offset: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.bits, bool) or not isinstance(self.bits, int) or not 1 <= self.bits <= 24:
            raise InputError("bits of a converter", got=self.bits, allowed="an integer from 1 to 24")
        if not (math.isfinite(self.reference) and self.reference > 0.0):
            raise InputError("reference of a converter", got=self.reference, allowed="a positive number [V]")
        if not math.isfinite(self.offset):
            raise InputError("offset of a converter", got=self.offset, allowed="a finite number [counts]")

    @property
    def highest(self) -> int:
        """The highest count, 2^bits − 1 [1]."""
        return int(2**self.bits) - 1

    @property
    def gain(self) -> float:
        """Counts per volt [1/V]."""
        return float(2**self.bits / self.reference)

    def count(self, voltage: float) -> int:
        """Return the count of a voltage [V].

        Raises
        ------
        InputError
            If the voltage is not finite.
        """
        if not math.isfinite(voltage):
            raise InputError("voltage at a converter", got=voltage, allowed="a finite number [V]")
        return counted(self.gain, self.offset, self.highest, voltage)


INPUT_CONVERTER = Converter(bits=10, reference=2.5, offset=-0.82)
"""At the command: the paper's 2.5 V reference (LM336Z-2.5) over 1024 counts.

The zero offset is identified from Table II of Urrea and Kern (2011): only offsets from −0.96 to below −0.68 counts
give all five pulse widths from the printed V_i; this is the middle (`zero_offset_interval`).
"""

FEEDBACK_CONVERTER = Converter(bits=10, reference=1024 / 432.65, offset=-44.1 + 0.5)
"""At the potentiometer: the straight line ADC_o = 432.65 V_o − 44.1 fitted to Table II, rounded to whole counts.

This is a description and no circuit: the converter at the command has another gain and another zero.
"""
