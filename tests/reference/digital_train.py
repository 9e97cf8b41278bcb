"""Motor and output of the digital servo with play between them, from event to event in closed form.

Between two events each body obeys w' = a − λ w: the contacts, friction with the torques through the gear (M5 without a
Stribeck speed) and impacts are those of `drivetrain_motion`, bridge and source those of `digital_circuit`. Loads are
constant, viscous and dry; nothing is warm. It stands where `digital_motion.Shaft` does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from .digital_circuit import Bridge, Zone
from .digital_closed import Slide
from .digital_motion import ENERGIES, NODES, WEIGHTS
from .digital_plant import Plant, make_plant
from .drivetrain_laws import make_plant as make_laws
from .drivetrain_motion import Mode, Q, V, W, X, decide, guards, happen, joined, motion

Array = NDArray[np.float64]
TOL = 1e-14  # a guard below −TOL is an event
CROWD = 60  # events at one instant that no run needs
EARLY, EVEN = tuple(10.0**-k for k in range(6, 1, -1)), tuple(k / 16 for k in range(2, 17))
WORDS = {"flank": "gear meets", "part": "gear parts", "motor_speed": "motor speed zero",
         "motor_release": "motor release"}
FAST = 8.0  # rad/s: the second speed at which a straight law is asked


class Meeting(NamedTuple):
    """Output and motor where the teeth meet: speeds before, the common one after, and what it took [J]."""

    time: float
    output: float
    motor: float
    after: float
    lost: float


class Train:
    """State of both bodies as time goes by."""

    def __init__(self, values: Mapping[str, Mapping[str, Any]], load: Mapping[str, Any], angle: float,
                 bridge: Bridge) -> None:
        gear = {name: x for name, x in values["gear"].items() if name != "backlash"}
        flat = {f"{group}.{name}": x for group, fields in values.items() for name, x in fields.items()}
        self.P: Plant = make_plant({**values, "gear": gear}, load)
        self.laws = make_laws({"electronics.off_state": "brake", **flat}, load)
        if len(self.P.torque) > 1 or self.P.torque[0].slope or self.P.hot or self.P.w_s or self.P.stiffness or (
                self.P.gravity) or values.get("potentiometer", {}).get("backlash"):
            raise ValueError("motor and output with play take constant loads, friction without heat or Stribeck, and a "
                             "potentiometer without play")
        self.piece, self.mode = self.P.torque[0], Mode()
        self.y = [angle, 0.0, 0.0, angle, 0.0, self.P.ambient, self.P.ambient]
        self.t, self.T_w, self.T_h, self.impacts = 0.0, self.P.ambient, self.P.ambient, 0.0
        self.energy: Array = np.zeros(len(ENERGIES))
        self.events: list[tuple[float, str]] = []
        self.meetings: list[Meeting] = []
        self.crowd = (-1.0, 0)
        self.switch(bridge)

    # What the servo asks -------------------------------------------------------------------------------------------

    @property
    def q(self) -> float:
        return self.y[Q]

    @property
    def w(self) -> float:
        return self.y[W]

    @property
    def motor_speed(self) -> float:
        """At the output: what the motor's voltage follows."""
        return self.y[V]

    @property
    def wiper(self) -> float:
        return self.y[Q]

    def switch(self, bridge: Bridge) -> None:
        """Put the bridge to another duty."""
        self.zones = bridge.zones(self.P, self.P.R_a, self.P.K_b)
        self._settle()

    def now(self) -> tuple[float, float]:
        """Reported current and bus voltage."""
        zone = self.zone
        return zone.current(self.y[V]) / zone.on, zone.bus(self.y[V])

    def electric(self) -> tuple[float, float, float]:
        return self.P.electric(self.T_w, self.T_h)

    def kinetic(self) -> float:
        """Energy of the motion [J]."""
        return 0.5 * (self.laws.J_L * self.y[W] ** 2 + self.laws.J_m * self.y[V] ** 2)

    # Laws ----------------------------------------------------------------------------------------------------------

    def _torque(self, v: float) -> float:
        return self.P.K * self.zone.current(v)

    def _settle(self) -> None:
        """Contact, directions and the zone of the current at this instant."""
        v, flank = self.y[V], self.mode.flank
        inside = [zone for zone in self.zones if zone.low <= v <= zone.high]
        self.zone: Zone = inside[0]
        decide(self.laws, self.mode, self.y, self._torque(self.y[V]))
        if len(inside) > 1 and motion(self.laws, self.mode, self.y, self._torque(v)).motor > 0.0:
            self.zone = inside[-1]
        if flank and not self.mode.flank:
            self.events.append((self.t, "gear parts at once"))

    def _law(self, y: list[float]) -> tuple[Slide, Slide]:
        """Output and motor from a state on."""
        def rates(speed: float) -> tuple[float, float]:
            at = [y[Q], speed, 0.0, y[X], speed, 0.0, 0.0]
            found = motion(self.laws, self.mode, at, self._torque(speed))
            return found.output, found.motor

        still, fast = rates(0.0), rates(FAST)
        out, motor = ((a, (a - b) / FAST) for a, b in zip(still, fast, strict=True))
        one = Slide(y[Q], y[W], *out, 0.0)
        if joined(self.laws, self.mode):
            return one, one
        return one, Slide(y[X], y[V], *motor, 0.0)

    def _state(self, slides: tuple[Slide, Slide], s: float) -> list[float]:
        q, w = slides[0].at(s) if self.mode.d else (slides[0].q, 0.0)
        if joined(self.laws, self.mode):
            x, v = q + 0.5 * self.mode.flank * self.laws.play, w
        else:
            x, v = slides[1].at(s) if self.mode.d_m else (slides[1].q, 0.0)
        return [q, w, 0.0, x, v, self.T_w, self.T_h]

    def _guards(self, y: list[float]) -> list[tuple[str, float]]:
        v, (low, high) = y[V], self.zone[:2]
        borders = [x for x, border in ((v - low, low), (high - v, high)) if border]  # one at 0 is passed as speed zero
        return [*(("current", x) for x in borders), *guards(self.laws, self.mode, y, self._torque(v))]

    # Time ----------------------------------------------------------------------------------------------------------

    def advance(self, until: float) -> None:
        """Go on to an instant."""
        self._settle()
        while self.t < until:
            name = next((name for name, x in self._guards(self.y) if x < -TOL), None)
            if name is not None:
                self._act(name)
                continue
            slides, span = self._law(self.y), until - self.t
            found = self._find(slides, span)
            s, name = found or (span, None)
            self._account(slides, s)
            self.y, self.t = self._state(slides, s), until if name is None else self.t + s
            if name is not None:
                self._act(name)

    def _find(self, slides: tuple[Slide, Slide], span: float) -> tuple[float, str] | None:
        """First guard that turns negative, and when."""
        low = 0.0
        for high in (x * span for x in (*EARLY, *EVEN)):
            found = self._earliest(slides, low, high, None)
            while found:
                sooner = self._earliest(slides, low, found[0], found[1])
                if not sooner or sooner[0] >= found[0]:
                    return found
                found = sooner
            low = high
        return None

    def _earliest(self, slides: tuple[Slide, Slide], low: float, high: float, but: str | None,
                  ) -> tuple[float, str] | None:
        found = [(self._cross(slides, n, low, high), name)
                 for n, (name, x) in enumerate(self._guards(self._state(slides, high))) if x < -TOL and name != but]
        return min(found) if found else None

    def _cross(self, slides: tuple[Slide, Slide], n: int, low: float, high: float) -> float:
        """Time just after a guard has turned negative."""
        def value(s: float) -> float:
            return self._guards(self._state(slides, s))[n][1] + TOL

        if value(low) < 0.0:
            return low
        s = float(brentq(value, low, high, xtol=1e-18, rtol=8.9e-16))
        ulp = math.ulp(s)
        while s < high and value(s) >= 0.0:
            s, ulp = min(s + ulp, high), 2.0 * ulp
        return s

    def _act(self, name: str) -> None:
        at, count = self.crowd
        self.crowd = (self.t, 1) if self.t > at + 1e-13 else (at, count + 1)
        if count > CROWD:
            raise RuntimeError(f"events without end at t = {self.t}: {name}")
        w, v, freely = self.y[W], self.y[V], not joined(self.laws, self.mode) and not self.laws.behind
        lost = happen(self.laws, self.mode, self.y, name)
        self.impacts += lost
        if name == "flank":
            self.meetings.append(Meeting(self.t, w, v, self.y[W], lost))
        self._settle()
        self.events.append((self.t, self._word(name, freely)))

    def _word(self, name: str, freely: bool) -> str:
        """Name of an event by what came of it; whether nothing had held the output, whose law goes on then."""
        if name == "speed" and freely:
            return "turns"
        if name == "speed":
            return "reversal" if self.mode.d else "stick"
        if name == "current":
            return "current starts" if self.zone.b else "current stops"
        return WORDS.get(name, name)

    def _account(self, slides: tuple[Slide, Slide], length: float) -> None:
        """Add up what the powers are along a stretch."""
        for x, weight in zip(NODES, WEIGHTS, strict=True):
            y = self._state(slides, 0.5 * length * (1.0 + float(x)))
            self.energy += 0.5 * length * weight * self._powers(y)

    def _powers(self, y: list[float]) -> Array:
        P, v, zone = self.P, y[V], self.zone
        i, go = zone.current(v), motion(self.laws, self.mode, y, self._torque(v))
        return np.array([
            zone.bus(v) * zone.share * i, P.R_a * i * i / zone.on, zone.drop * abs(i) + zone.ohm * i * i,
            P.V_br * abs(i), (P.K_b - P.K) * i * v, go.friction, go.load])
