"""Bridge, motor winding and source at a constant duty: the mean current by zones of the speed, in each a straight line.

The winding obeys δ V − K w = R j + z D with the sense z of the current j, the share δ of the bus on it, drops D and
resistance R. A slow bridge ("coast") is fully on for |d| of the time, at which the mean counts |d| j.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .digital_plant import Plant

INF = math.inf


class Zone(NamedTuple):
    """Between two speeds [rad/s] the mean current i = a + b w [A] and the bus voltage V = v + u w [V]."""

    low: float
    high: float
    a: float
    b: float
    v: float
    u: float
    share: float  # supply current over mean current
    on: float  # mean current over the current while the bridge is on
    drop: float  # of the bridge [V]
    ohm: float  # of the bridge, to the square of the mean current [Ohm]

    def current(self, w: float) -> float:
        return self.a + self.b * w

    def bus(self, w: float) -> float:
        return self.v + self.u * w

    def mirrored(self) -> Zone:
        """The same for a servo seen from behind."""
        return self._replace(low=-self.high, high=-self.low, a=-self.a, u=-self.u, share=-self.share)


class Bridge(NamedTuple):
    """What the bridge does: "brake", "diode" or "coast" at a duty, or "open"."""

    kind: str
    duty: float = 0.0

    @property
    def opened(self) -> bool:
        return self.kind == "open" or (self.duty == 0.0 and self.kind != "brake")

    def zones(self, P: Plant, R_a: float, K_b: float) -> tuple[Zone, ...]:
        """All zones, from the lowest speed to the highest."""
        if self.opened:
            found = _open(P, R_a, K_b)
        elif self.duty < 0.0:
            found = [zone.mirrored() for zone in reversed(_driven(self.kind, -self.duty, P, R_a, K_b))]
        else:
            found = _driven(self.kind, self.duty, P, R_a, K_b)
        return tuple(zone for zone in found if zone.low < zone.high)


def _open(P: Plant, R_a: float, K: float) -> list[Zone]:
    """Nothing flows but what the diodes let through to the supply; a regulator takes it and stays where it is."""
    R_b = 0.0 if P.I_max is not None else P.R_b
    E, R = P.V_oc + P.V_ce0 + P.V_br, R_a + R_b
    back = Zone(-INF, -E / K, -E / R, -K / R, P.V_oc - R_b * E / R, -R_b * K / R, -1.0, 1.0, P.V_ce0, 0.0)
    return [back, Zone(-E / K, E / K, 0.0, 0.0, P.V_oc, 0.0, 0.0, 1.0, 0.0, 0.0), back.mirrored()]


def _driven(kind: str, d: float, P: Plant, R_a: float, K: float) -> list[Zone]:
    """Zones at d >= 0."""
    slow = kind == "coast"
    on, delta = (d, 1.0) if slow else (1.0, d)
    D, R = delta * P.V_ce0 + P.V_br, R_a + delta * P.r_c
    common = (on * delta, on, delta * P.V_ce0, delta * P.r_c / on)

    def line(low: float, high: float, z: int, R_b: float) -> Zone:
        S = R + on * delta**2 * R_b  # j = (δ V_oc − K w − z D)/S
        a, b, r = (delta * P.V_oc - z * D) / S, -K / S, R_b * on * delta
        return Zone(low, high, on * a, on * b, P.V_oc - r * a, -r * b, *_shares(common))

    start, back = (delta * P.V_oc - D) / K, (delta * P.V_oc + D) / K
    zones = _limited(P, K, D, R, delta, on, common) if P.I_max is not None and delta else []
    zones.append(line(zones[-1].high if zones else -INF, start, 1, P.R_b))
    one_way = kind != "brake"
    zones.append(Zone(start, INF if one_way else back, 0.0, 0.0, P.V_oc, 0.0, *_shares(common)))
    if not one_way:
        zones.append(line(back, INF, -1, 0.0 if P.I_max is not None else P.R_b))
    return zones


def _shares(common: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Share of the supply, of time, drop and resistance of the bridge, to the mean current."""
    supply, on, drop, ohm = common
    return supply / on, on, drop, ohm


def _limited(P: Plant, K: float, D: float, R: float, delta: float, on: float,
             common: tuple[float, float, float, float]) -> list[Zone]:
    """A regulator at its limit, and beyond it with a bus of 0 V where plugging asks for more."""
    j = (P.I_max or 0.0) / (on * delta)
    floor, limit = (-D - R * j) / K, (delta * P.V_oc - D - (R + on * delta**2 * P.R_b) * j) / K
    return [Zone(-INF, floor, -on * D / R, -on * K / R, 0.0, 0.0, *_shares(common)),
            Zone(floor, limit, on * j, 0.0, (D + R * j) / delta, K / delta, *_shares(common))]
