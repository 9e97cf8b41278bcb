"""A servo whose bus voltage is given: whether its motor is connected to the bus, by which sign, and its numbers there.

Its circuit has u = s V_bus, where s is the sign, or the duty of a bridge under PWM; its numbers are those of a stiff
source.
"""

from __future__ import annotations

import math

from servotwin.models.state.modes import Vector
from servotwin.models.terms import duty
from servotwin.models.terms import source as source_term
from servotwin.models.terms.bridge import Bridge, coasts
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.source import Source

_BLOCKS = 1e300  # V


def on_stiff_source(numbers: Numbers, returning: bool) -> Numbers:
    """Return a servo whose bus voltage is given: driven, or returning current through its diodes."""
    path, source = numbers.bridge, numbers.source
    if not returning:
        return driven(numbers, path.D_drive, path.R_drive - source.R_b)
    R = path.off.R if source_term.regulated(source) else path.off.R - source.R_b
    return driven(numbers, max(path.D_drive, 1e-300), R)  # a diode without drop still has a direction


def driven(numbers: Numbers, D: float, R: float) -> Numbers:
    """Return a servo whose bus voltage is given and drives it with so much drop [V] and resistance [Ω]."""
    path = numbers.bridge
    return numbers._replace(bridge=path._replace(D_drive=D, R_drive=R), source=Source(numbers.source.V, 0.0, math.inf))


def blocked(numbers: Numbers) -> Numbers:
    """Return a servo whose diodes block: no voltage of the bus drives a current in it, whatever its speed jumps to."""
    path = numbers.bridge
    return numbers._replace(bridge=path._replace(D_drive=_BLOCKS))


def is_connected(numbers: Numbers, drive: float, y: Vector) -> bool:
    """Tell whether a motor is connected to the bus: driven, or through the diodes of a bridge that coasts."""
    return drive != 0.0 or (coasts(numbers.bridge) and (y.i != 0.0 or y.w_m != 0.0))


def sign_on_bus(drive: float, y: Vector) -> float:
    """Return the sign of the bus voltage in a circuit, driven or (0) through the diodes of a coasting bridge."""
    if drive != 0.0:
        return drive
    # against the current, or against the one that the back-EMF would drive
    return -math.copysign(1.0, y.i) if y.i != 0.0 else math.copysign(1.0, y.w_m)


def part_on_bus(drive: float, path: Bridge, now: float, y: Vector) -> float:
    """Return which part of the bus voltage is in a circuit, with its sign; `now` is the duty of a bridge under PWM."""
    sign = sign_on_bus(drive, y)
    return sign * duty.share_of(path, now) if duty.present(path) else sign
