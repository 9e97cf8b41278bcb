"""End stops: where the travel ends, and what an impact leaves of the speed."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.terms.dependence import AT_STOPS
from servotwin.models.terms.given import Given, either

READS = ("stops.lower_angle", "stops.upper_angle", "stops.restitution")
"""Optional numbers of a pulse servo."""


class Stops(NamedTuple):
    """Numbers of the end stops."""

    lower: float
    upper: float
    restitution: float


NO_STOPS = Stops(-math.inf, math.inf, 0.0)
ACTS = {"restitution": AT_STOPS}
"""Where each number acts; the angles say when the shaft gets there."""


def pack(given: Given) -> Stops:
    """Return the numbers of a servo's stops."""
    return Stops(either(given.stops_lower_angle, -math.inf), either(given.stops_upper_angle, math.inf),
                 either(given.stops_restitution, 0.0))
