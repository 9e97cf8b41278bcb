"""The source behind a switched bridge: a battery with its resistance, or a regulator that gives so much at most."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.terms.dependence import FOLLOWS, REGULATED, STRAIGHT
from servotwin.models.terms.given import Given, either
from servotwin.physics.supply import source_voltage

READS = ("supply.internal_resistance", "supply.current_limit")
"""Optional numbers of a pulse servo."""


class Source(NamedTuple):
    """Numbers of the source."""

    V: float  # V_oc; 0: there is no bridge, and the voltage follows the error
    R_b: float
    I_max: float  # most that a regulator gives; inf: a battery


NO_SOURCE = Source(0.0, 0.0, math.inf)
ACTS = {"V": STRAIGHT, "R_b": STRAIGHT, "I_max": REGULATED}
"""Where each number acts."""


def present(source: Source) -> bool:
    """Tell whether the motor hangs behind a switched bridge."""
    return source.V > 0.0


def regulated(source: Source) -> bool:
    """Tell whether the source gives so much at most."""
    return source.I_max < math.inf


def falls(source: Source) -> bool:
    """Tell whether the source's voltage may fall."""
    return present(source) and (source.R_b > 0.0 or regulated(source))


def needs(source: Source) -> int:
    """Return what there is to be followed of the source, or of what stands in its place."""
    return (0 if source.V > 0.0 else FOLLOWS) | (REGULATED if source.I_max < math.inf else 0)


def loaded_voltage(source: Source, taken: float) -> float:
    """Return what is left of the voltage [V] under a current [A]."""
    return source_voltage(taken, source.V, source.R_b, regulated=source.I_max < math.inf)


def pack(given: Given) -> Source:
    """Return the numbers of a servo's source."""
    return Source(given.supply_open_circuit_voltage, either(given.supply_internal_resistance, 0.0),
                  either(given.supply_current_limit, math.inf))
