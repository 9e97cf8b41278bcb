"""What stands between a quantity of the bench and a pin of the board: gain, offset and noise of each channel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.bench.converter import Converter
    from servotwin.bench.recording.wiring import Wiring


@dataclass(frozen=True, kw_only=True)
class FrontEnd:
    """A stage before a pin: v = gain x + offset, and noise.

    Parameters
    ----------
    gain : float
        Of a voltage [V/V], of the supply current [V/A].
    offset : float
        [V]
    noise : float
        One standard deviation of each conversion's own noise, at the pin [V].

    Raises
    ------
    InputError
        If a number is not finite, or the noise negative.

    Examples
    --------
    >>> FrontEnd(gain=0.25).voltage(6.0)
    1.5
    """

    gain: float = 1.0
    offset: float = 0.0
    noise: float = 0.0

    def __post_init__(self) -> None:
        for name in ("gain", "offset", "noise"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(f"{name} of a front end", got=value, allowed="a finite number")
        if self.noise < 0.0:
            raise InputError("noise of a front end", got=self.noise, allowed="0 or more [V]")

    def voltage(self, value: float) -> float:
        """Return the voltage at the pin, noise apart [V]."""
        return self.gain * value + self.offset


def front_ends(wiring: Wiring, *, noise: float = 0.0) -> dict[str, FrontEnd]:
    """Return the stages that a wiring stands for, those of channels that are not wired too.

    Parameters
    ----------
    wiring : Wiring
    noise : float
        Of each of them [V].

    Examples
    --------
    >>> from servotwin.bench.recording.wiring import Wiring
    >>> front_ends(Wiring())["supply"].voltage(6.0)
    1.5
    """
    return {name: FrontEnd(gain=wiring.pin(name, 1.0) - wiring.pin(name, 0.0), offset=wiring.pin(name, 0.0),
                           noise=noise)
            for name in CHANNELS}


def seen_by(converter: Converter, *, reference: float = 2.5, noise: float = 0.0) -> FrontEnd:
    """Return the stage with which the board's converter counts as another one does.

    Parameters
    ----------
    converter : Converter
        Such as the two of the paper's bench, whose gains and zeros differ.
    reference : float
        Of the board's converter [V].
    noise : float
        [V]

    Examples
    --------
    >>> from servotwin.bench.converter import INPUT_CONVERTER
    >>> pin = seen_by(INPUT_CONVERTER).voltage(1.425)
    >>> int(1024 * pin / 2.5), INPUT_CONVERTER.count(1.425)
    (582, 582)
    """
    volt = reference / 1024.0
    return FrontEnd(gain=converter.gain * volt, offset=converter.offset * volt, noise=noise)


def checked(given: Mapping[str, FrontEnd] | None) -> dict[str, FrontEnd]:
    """Return a stage for each channel, one that changes nothing where none is given."""
    made = dict(given or {})
    for name, stage in made.items():
        if name not in CHANNELS or not isinstance(stage, FrontEnd):
            raise InputError("front ends", got=f"{name}: {stage!r}", allowed=f"a FrontEnd for {', '.join(CHANNELS)}")
    return {name: made.get(name, FrontEnd()) for name in CHANNELS}


CHANNELS = ("tap", "shunt", "supply", "command")
"""Of the board, in the order of its pins A0 to A3."""
