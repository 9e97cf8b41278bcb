"""Heat: two thermal masses, winding and housing, which copper and magnets follow."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.terms.dependence import ON_HEAT
from servotwin.models.terms.given import Given, either, is_given
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, copper_loss, heat_flow, warming_rate

READS = (
    "thermal.winding_capacity", "thermal.housing_capacity", "thermal.winding_to_housing",
    "thermal.housing_to_ambient", "thermal.ambient", "thermal.magnet_coefficient",
)
"""Optional numbers of a pulse servo."""


class Heat(NamedTuple):
    """Numbers of the two thermal masses."""

    C_w: float  # of the winding [J/K]; 0: temperatures stay
    C_h: float
    G_wh: float  # [W/K]
    G_ha: float
    T_amb: float
    magnet: float  # [1/K]


NO_HEAT = Heat(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ACTS = dict.fromkeys(("C_w", "C_h", "G_wh", "G_ha", "T_amb", "magnet"), ON_HEAT)
"""Where each number acts."""


def present(heat: Heat) -> bool:
    """Tell whether temperatures change."""
    return heat.C_w > 0.0


def depends(heat: Heat) -> int:
    """Return on what the acceleration depends through heat."""
    return ON_HEAT if heat.C_w > 0.0 else 0


def warming_rates(heat: Heat, R: float, i: float, T_w: float, T_h: float) -> tuple[float, float]:
    """Return the rates of the temperatures [K/s] of winding and housing under a current [A] through R [Ω]."""
    flow = heat_flow(T_w, T_h, heat.G_wh)
    return (warming_rate(copper_loss(i, R), flow, heat.C_w),
            warming_rate(flow, heat_flow(T_h, heat.T_amb, heat.G_ha), heat.C_h))


def pack(given: Given) -> Heat:
    """Return the two thermal masses; nothing but ambient temperature where the servo does not give them."""
    T_amb = either(given.thermal_ambient, REFERENCE_TEMPERATURE)
    if not is_given(given.thermal_winding_capacity):
        return Heat(0.0, 0.0, 0.0, 0.0, T_amb, 0.0)
    return Heat(given.thermal_winding_capacity, given.thermal_housing_capacity, 1.0 / given.thermal_winding_to_housing,
                1.0 / given.thermal_housing_to_ambient, T_amb, either(given.thermal_magnet_coefficient, 0.0))
