"""Bridge and winding of a digital servo at a bus voltage that others share: what it draws, and where its current ends.

The averaged bridge is an ideal transformer: the winding sees d V_bus, the supply gives d i, and of the drops and the
resistance of the bridge the share |d| counts. `drivetrain_circuit` finds the voltage that all of them leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from . import drivetrain_circuit as circuit
from .digital_circuit import Bridge
from .drivetrain_circuit import Source
from .drivetrain_laws import Plant, sgn


class Winding(NamedTuple):
    """One servo at one instant: the loop d V_bus − emf = R j + z D around its winding; without a duty it is open."""

    P: Plant
    duty: float
    opened: bool
    one_way: bool
    z: int  # sign of the current, 0 where none flows
    R_a: float
    R: float
    lost: float  # D; where the bridge is open the bus voltage comes on top of it
    emf: float
    i: float = 0.0  # no state: the inductance is left out

    def loss(self, V_bus: float) -> float:
        """Voltage lost whatever the current."""
        return self.lost + V_bus if self.opened else self.lost

    def response(self, V_bus: float) -> float:
        """Current at this bus voltage; its sign stays."""
        return (self.duty * V_bus - self.emf - self.z * self.loss(V_bus)) / self.R if self.z else 0.0

    def share(self) -> float:
        """Current drawn from the supply per current of the winding."""
        return float(-self.z) if self.opened else self.duty

    def excess(self, V_bus: float) -> float:
        """How far the voltage that drives a current exceeds what it would lose; below 0 none starts [V]."""
        push = self.duty * V_bus - self.emf
        return (push * sgn(self.duty) if self.one_way else abs(push)) - self.loss(V_bus)

    def starts(self, V_bus: float) -> int:
        """Sign of the current that this bus voltage makes flow from 0."""
        return sgn(self.duty * V_bus - self.emf) if self.excess(V_bus) > 0.0 else 0

    def guard(self, V_bus: float) -> float:
        """Positive as long as the sign of the current stays."""
        return self.z * self.response(V_bus) if self.z else -0.1 * self.excess(V_bus)

    def powers(self, V_bus: float) -> tuple[float, float, float, float]:
        """Of the supply, winding, bridge and brushes [W]."""
        P, i = self.P, self.response(V_bus)
        part, ohm = (1.0, 0.0) if self.opened else (abs(self.duty), abs(self.duty) * P.r_c)
        return (V_bus * self.share() * i, self.R_a * i * i, part * P.V_ce0 * abs(i) + ohm * i * i, P.V_br * abs(i))


def winding(P: Plant, bridge: Bridge, z: int, R_a: float, emf: float) -> Winding:
    """Driven, braked or open."""
    if bridge.opened:
        return Winding(P, 0.0, True, False, z, R_a, R_a, P.V_ce0 + P.V_br, emf)
    share = abs(bridge.duty)
    return Winding(P, bridge.duty, False, bridge.kind == "diode", z, R_a, R_a + share * P.r_c,
                   share * P.V_ce0 + P.V_br, emf)


def bus_voltage(source: Source, zone: str, windings: Sequence[Winding]) -> float:
    """V_bus [V]."""
    return circuit.bus_voltage(source, zone, windings)  # type: ignore[arg-type]


def guards(source: Source, zone: str, windings: Sequence[Winding], V_bus: float) -> list[float]:
    """Positive as long as the source stays in its zone."""
    return circuit.guards(source, zone, windings, V_bus)  # type: ignore[arg-type]


def decide(source: Source, zone: str, windings: Sequence[Winding]) -> tuple[str, list[int]]:
    """Zone of the source and signs of the currents; what was goes on where it still holds, for there is one answer."""
    if zone == "line":
        V_bus = bus_voltage(source, zone, windings)
        signs = [one.starts(V_bus) for one in windings]
        if signs == [one.z for one in windings] and min(
                guards(source, zone, windings, V_bus), default=0.0) >= 0.0:
            return zone, signs
    return circuit.decide(source, windings)  # type: ignore[arg-type]
