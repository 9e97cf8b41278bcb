"""The supply and the armatures that hang on it: V_bus and the currents, in one of four zones of the source.

Zones: "line" V_oc − R_b I; "return" V_oc (a regulator takes nothing back); "limit" I = I_max; "floor" V_bus = 0.
I is the sum of s i over the driven armatures and of −|i| over the coasting ones. Without inductance currents follow
V_bus at once; with it they are states, and what "limit" holds is the rate of I.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from scipy.optimize import brentq

from .drivetrain_laws import Plant, sgn

SURFACE = 2e-10  # A: so near to the limit the sum of the currents counts as being on it


@dataclass(frozen=True)
class Source:
    """Battery, or with a limit a regulator."""

    V_oc: float
    R_b: float = 0.0
    I_max: float = math.inf


class Armature(NamedTuple):
    """One servo's armature at one instant; `z` is the sign of its current, 0 where none flows."""

    P: Plant
    drive: int
    z: int
    R_a: float
    emf: float
    i: float  # the state, where there is inductance

    def response(self, V_bus: float) -> float:
        """Current, or with inductance its rate, at this bus voltage; the sign of the current stays."""
        if not self.z:
            return 0.0
        loop = self.P.loop(self.drive, V_bus, self.R_a)
        x = loop.source - self.emf - self.z * loop.lost
        return (x - loop.R * self.i) / self.P.L if self.P.L else x / loop.R

    def share(self) -> int:
        """Current drawn from the supply per armature current."""
        return self.drive if self.drive else -self.z if self.P.coasts else 0

    def excess(self, V_bus: float) -> float:
        """How far the voltage that drives a current exceeds what it would lose; below 0 none starts [V]."""
        loop = self.P.loop(self.drive, V_bus, self.R_a)
        return abs(loop.source - self.emf) - loop.lost

    def starts(self, V_bus: float) -> int:
        """Sign of the current that this bus voltage makes flow from 0."""
        loop = self.P.loop(self.drive, V_bus, self.R_a)
        return sgn(loop.source - self.emf) if self.excess(V_bus) > 0.0 else 0

    def terminal(self, V_bus: float, i: float) -> float:
        """Motor terminal voltage v_m."""
        if self.drive and self.z:
            return self.drive * V_bus - self.z * self.P.V_ce0 - self.P.r_c * i
        if not self.drive and not self.P.coasts:
            return 0.0
        return -self.z * (V_bus + self.P.V_ce0) if self.z else self.emf


def _sums(armatures: Sequence[Armature]) -> tuple[float, float]:
    """I, or with inductance dI/dt, as slope · V_bus + offset."""
    offset = sum(a.share() * a.response(0.0) for a in armatures)
    return sum(a.share() * a.response(1.0) for a in armatures) - offset, offset


def total(armatures: Sequence[Armature], V_bus: float) -> float:
    """Supply current I [A]."""
    return sum(a.share() * (a.i if a.P.L else a.response(V_bus)) for a in armatures)


def bus_voltage(source: Source, zone: str, armatures: Sequence[Armature]) -> float:
    """V_bus in this zone, the signs of the currents as they are."""
    if zone == "return":
        return source.V_oc
    if zone == "floor":
        return 0.0
    inductive = armatures[0].P.L > 0.0
    if zone == "line" and inductive:
        return source.V_oc - source.R_b * total(armatures, 0.0)
    slope, offset = _sums(armatures)
    if zone == "line":
        return (source.V_oc - source.R_b * offset) / (1.0 + source.R_b * slope)
    return ((0.0 if inductive else source.I_max) - offset) / slope


def decide(source: Source, armatures: Sequence[Armature]) -> tuple[str, list[int]]:
    """Zone of the source and signs of the currents at this instant."""
    if armatures[0].P.L:
        return _decide_inductive(source, armatures)
    return _decide_algebraic(source, armatures)


def _decide_algebraic(source: Source, armatures: Sequence[Armature]) -> tuple[str, list[int]]:
    def demand(V: float) -> float:  # grows with V, so every crossing below is the only one
        return total([a._replace(z=a.starts(V)) for a in armatures], V)

    def root(f, low: float, high: float) -> float:  # type: ignore[no-untyped-def]
        return low if low == high else float(brentq(f, low, high, xtol=1e-15, rtol=8.9e-16))

    limited, V, zone = math.isfinite(source.I_max), source.V_oc, "line"
    drop = source.R_b * demand(source.V_oc)
    if limited and demand(source.V_oc) < 0.0:
        zone = "return"
    else:
        V = root(lambda V: V - source.V_oc + source.R_b * demand(V), *sorted((source.V_oc, source.V_oc - drop)))
        if demand(V) > source.I_max:
            zone, V = "floor", 0.0
            if demand(0.0) < source.I_max:
                zone = "limit"
                V = root(lambda V: demand(V) - source.I_max, 0.0, source.V_oc)
    return zone, [a.starts(V) for a in armatures]


def _decide_inductive(source: Source, armatures: Sequence[Armature]) -> tuple[str, list[int]]:
    V, zone, seen = source.V_oc, "line", None
    flowing = [a._replace(z=sgn(a.i)) for a in armatures]
    for _ in range(2 * len(armatures) + 4):
        zone = _inductive_zone(source, flowing)
        V = bus_voltage(source, zone, flowing)
        signs = [sgn(a.i) or a.starts(V) for a in flowing]
        if (zone, signs) == seen:
            return zone, signs
        seen = (zone, signs)
        flowing = [a._replace(z=z) for a, z in zip(flowing, signs, strict=True)]
    raise RuntimeError(f"currents and bus voltage do not agree: {flowing}")


def _inductive_zone(source: Source, armatures: Sequence[Armature]) -> str:
    if math.isinf(source.I_max):
        return "line"
    now = total(armatures, 0.0)
    if now < source.I_max - SURFACE:
        return "line" if now >= 0.0 else "return"
    slope, offset = _sums(armatures)
    if now > source.I_max + SURFACE or offset > 0.0:  # too much already, or growing even without a voltage
        return "floor"
    return "limit" if slope * (source.V_oc - source.R_b * source.I_max) + offset > 0.0 else "line"


def settled_currents(source: Source, armatures: Sequence[Armature]) -> list[float]:
    """Current states, moved by less than SURFACE so that a sum which is on the limit is exactly on it."""
    currents = [a.i for a in armatures]
    over = total(armatures, 0.0) - source.I_max if armatures[0].P.L else math.inf
    if abs(over) <= SURFACE:
        n = max(range(len(currents)), key=lambda n: armatures[n].share() * currents[n])
        currents[n] -= armatures[n].share() * over
    return currents


def guards(source: Source, zone: str, armatures: Sequence[Armature], V_bus: float) -> list[float]:
    """Positive as long as the source stays in its zone; 1e-14 of each is a negligible voltage or current."""
    if math.isinf(source.I_max):
        return []
    if zone == "limit":
        return [0.1 * V_bus, 0.1 * (source.V_oc - source.R_b * source.I_max - V_bus)]
    now = total(armatures, V_bus)
    near = 1e-4 if armatures[0].P.L else 1.0  # well within SURFACE
    if zone == "return":
        return [-now]
    return [near * (now - source.I_max)] if zone == "floor" else [now, near * (source.I_max - now)]
