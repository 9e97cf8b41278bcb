"""Heat: two thermal masses, winding and housing, which copper and magnets follow."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.terms.dependence import ON_HEAT
from servotwin.models.terms.given import Given
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, copper_loss, heat_flow, warming_rate

READS = (
    "thermal.winding_capacity", "thermal.housing_capacity", "thermal.winding_to_housing",
    "thermal.housing_to_ambient", "thermal.ambient", "thermal.magnet_coefficient",
)
"""What may be given of a pulse servo."""


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


def pack(model: Given) -> Heat:
    """Return the two thermal masses; nothing but ambient temperature where the servo does not give them."""
    T_amb = model.value_or("thermal.ambient", REFERENCE_TEMPERATURE)
    if model.servo.get("thermal.winding_capacity") is None:
        return NO_HEAT._replace(T_amb=T_amb)
    return Heat(C_w=model.value_or("thermal.winding_capacity", 0.0), C_h=model.value("thermal.housing_capacity"),
                G_wh=1.0 / model.value("thermal.winding_to_housing"),
                G_ha=1.0 / model.value("thermal.housing_to_ambient"), T_amb=T_amb,
                magnet=model.value_or("thermal.magnet_coefficient", 0.0))
