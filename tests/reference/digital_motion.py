"""The shaft of the digital servo between two instants: sliding, at rest or on a stop, at a constant duty.

A linear plant moves in closed form from zone to zone of the current; the rest is integrated by DOP853, whose steps see
kinks of the laws by their error alone, while speed zero, a stop and a start from rest are met exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

from .digital_circuit import Bridge, Zone
from .digital_closed import Slide
from .digital_plant import REST, Plant

Array = NDArray[np.float64]
ENERGIES = ("supply", "winding", "bridge", "brush", "converter", "friction", "load")
CROWD = 200  # events between two instants that no run needs
LATER = 1e-12  # s past the instant at which a sloping torque equals friction, where the force is not yet above rounding
GUARDS = 2  # that end a motion; what follows them are kinks
CLEAR = 1e-11  # from here on the sign of a kink is known
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


def sgn(x: float) -> int:
    return (x > 0.0) - (x < 0.0)


@dataclass
class Shaft:
    """State of motor, gear and load as time goes by."""

    P: Plant
    q: float
    bridge: Bridge
    t: float = 0.0
    w: float = 0.0
    T_w: float = 0.0
    T_h: float = 0.0
    energy: Array = field(default_factory=lambda: np.zeros(len(ENERGIES)))
    impacts: float = 0.0
    wiper: float = 0.0
    play: float = 0.0
    events: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.T_w = self.T_h = self.P.ambient
        self.wiper = self.q
        self.piece = self.P.torque[0]
        self.switch(self.bridge)

    def switch(self, bridge: Bridge) -> None:
        """Put the bridge to another duty."""
        self.bridge = bridge
        self._zones = bridge.zones(self.P, self.P.R_a, self.P.K_b)

    def zone(self, w: float, T_w: float, T_h: float, towards: int = 0) -> Zone:
        """Where a speed is; on a border the zone that lies towards a side."""
        R_a, _, K_b = self.P.electric(T_w, T_h)
        zones = self.bridge.zones(self.P, R_a, K_b) if self.P.hot else self._zones
        inside = [zone for zone in zones if zone.low <= w <= zone.high]
        return inside[-1] if towards > 0 else inside[0]

    def now(self) -> tuple[float, float]:
        """Reported current and bus voltage."""
        zone = self.zone(self.w, self.T_w, self.T_h)
        return zone.current(self.w) / zone.on, zone.bus(self.w)

    @property
    def motor_speed(self) -> float:
        """At the output: what the motor's voltage follows."""
        return self.w

    def electric(self) -> tuple[float, float, float]:
        """R_a, K and K_b as they are now."""
        return self.P.electric(self.T_w, self.T_h)

    def advance(self, until: float) -> None:
        """Go on to an instant."""
        for _ in range(CROWD):
            if self.t >= until:
                return
            side = sgn(self.w) or self._start()
            if self.P.linear:
                self._closed(side, until) if side else self._wait(until)
            else:
                self._steps(side, until)
        raise RuntimeError(f"{CROWD} events between two instants, up to {until} s")

    # At rest -------------------------------------------------------------------------------------------------------

    def _slack(self, t: float, T_w: float, T_h: float) -> tuple[float, float]:
        """How far from starting backward and forward; a stop takes any push into it."""
        K = self.P.electric(T_w, T_h)[1]
        tau_m = K * self.zone(0.0, T_w, T_h).current(0.0)
        back, on = self.P.slack(tau_m, self.P.external(self.piece, t, self.q))
        return (math.inf if self.q <= self.P.lower else back, math.inf if self.q >= self.P.upper else on)

    def _start(self) -> int:
        """Towards where a resting shaft starts now; 0: it rests."""
        back, on = self._slack(self.t, self.T_w, self.T_h)
        return -1 if back < 0.0 else 1 if on < 0.0 else 0

    def _wait(self, until: float) -> None:
        """Rest to an instant or until a sloping torque pulls the shaft off, which then slides."""
        slope, ends = self.piece.slope, [until]
        back, on = self._slack(self.t, self.T_w, self.T_h)
        side = -1 if slope > 0.0 else 1
        left = back if slope > 0.0 else on
        if slope and math.isfinite(left):
            ends.append(self.t + max(left, 0.0) / abs(slope) + LATER)
        end = min(ends)
        self.energy += (end - self.t) * self._powers(0.0, self.T_w, self.T_h, 0.0, 0)
        self.t = end
        if end < until:
            self.events.append((end, "start"))
            self._closed(side, until)

    # Power ---------------------------------------------------------------------------------------------------------

    def _powers(self, w: float, T_w: float, T_h: float, tau_ext: float, side: int) -> Array:
        """Of what `ENERGIES` names [W]."""
        P = self.P
        R_a, K, K_b = P.electric(T_w, T_h)
        zone = self.zone(w, T_w, T_h, side)
        i = zone.current(w)
        dry = P.budget(side, K * i, -tau_ext - P.B_load * w, P.fading(side * w)) if side else 0.0
        return np.array([
            zone.bus(w) * zone.share * i, R_a * i * i / zone.on, zone.drop * abs(i) + zone.ohm * i * i,
            P.V_br * abs(i), (K_b - K) * i * w, P.B_gear * w * w + side * dry * w, (tau_ext + P.B_load * w) * w,
        ])

    def kinetic(self) -> float:
        """Energy of the motion [J]."""
        return 0.5 * self.P.J * self.w**2

    def _arrive(self, side: int, at_stop: bool) -> None:
        """Take what happens at the end of a slide: an impact or speed zero."""
        self._carry()
        if at_stop:
            before = self.kinetic()
            self.q = self.P.upper if side > 0 else self.P.lower
            self.w *= -self.P.restitution
            if abs(self.w) < REST:
                self.w = 0.0
            self.impacts += before - self.kinetic()
            self.events.append((self.t, "stop"))
        else:
            self.w = 0.0
            self.events.append((self.t, "zero"))

    def _carry(self) -> None:
        """The wiper follows with its play; an angle moves one way between two calls."""
        self.wiper = min(max(self.wiper, self.q - 0.5 * self.play), self.q + 0.5 * self.play)

    # Linear plants -------------------------------------------------------------------------------------------------

    def _slide(self, side: int) -> tuple[Slide, Zone]:
        """Law from now on; a border of zones is left towards where the speed goes."""
        P = self.P
        tau, slope = self.piece.at(self.t), self.piece.slope
        dry = P.budget(side, 0.0, 0.0, 0.0)

        def law(zone: Zone) -> Slide:
            return Slide(self.q, self.w, (P.K * zone.a - tau - side * dry) / P.J,
                         (P.B_gear + P.B_load - P.K * zone.b) / P.J, -slope / P.J)

        zone = self.zone(self.w, 0.0, 0.0, side if self.w == 0.0 else 0)
        slide = law(zone)
        push = slide.a - slide.rate * slide.w or slide.c
        better = self.zone(self.w, 0.0, 0.0, sgn(push))
        return (slide, zone) if better is zone else (law(better), better)

    def _closed(self, side: int, until: float) -> None:
        """Slide to an instant, a border of zones, speed zero or a stop, whichever comes first."""
        slide, zone = self._slide(side)
        low, high = (max(zone.low, 0.0), zone.high) if side > 0 else (zone.low, min(zone.high, 0.0))
        span = until - self.t
        cut = slide.first(low, high, span)
        length = span if cut is None else cut
        q, w = slide.at(length)
        stop = self.P.upper if side > 0 else self.P.lower
        at_stop = side * (q - stop) >= 0.0
        if at_stop:
            length = slide.reaches(stop, length)
            q, w = slide.at(length)
        elif cut is not None:
            w = min((low, high), key=lambda bound: abs(bound - w))
        self._account(slide, length, side)
        self.t = until if length == span else self.t + length
        self.q, self.w = q, w
        if at_stop or (cut is not None and w == 0.0):
            self._arrive(side, at_stop)
        self._carry()

    def _account(self, slide: Slide, length: float, side: int) -> None:
        for x, weight in zip(NODES, WEIGHTS, strict=True):
            t = 0.5 * length * (1.0 + float(x))
            w = slide.at(t)[1]
            self.energy += 0.5 * length * weight * self._powers(w, 0.0, 0.0, self.piece.at(self.t + t), side)

    # All other plants ----------------------------------------------------------------------------------------------

    def _rates(self, side: int) -> Callable[[float, Array], Array]:
        P = self.P

        def rates(t: float, y: Array) -> Array:
            q, w, T_w, T_h = (float(x) for x in y[:4])
            tau = P.external(self.piece, t, q)
            powers = self._powers(w, T_w, T_h, tau, side)
            force = 0.0
            if side:
                K = P.electric(T_w, T_h)[1]
                tau_m, tau_e = K * self.zone(w, T_w, T_h, side).current(w), -tau - P.B_load * w
                dry = P.budget(side, tau_m, tau_e, P.fading(side * w))
                force = tau_m + tau_e - P.B_gear * w - side * dry
            through, out = (T_w - T_h) / P.R_wh, (T_h - P.ambient) / P.R_ha
            warm = ((powers[1] - through) / P.C_w, (through - out) / P.C_h) if P.hot else (0.0, 0.0)
            return np.array([w if side else 0.0, force / P.J, *warm, *powers])

        return rates

    def _guards(self, side: int, t: float, y: Array) -> tuple[float, ...]:
        """The first below 0 ends this motion: slack at rest, else speed and room to the stop ahead."""
        if not side:
            return self._slack(t, float(y[2]), float(y[3]))
        room = self.P.upper - y[0] if side > 0 else y[0] - self.P.lower
        return (side * float(y[1]), float(room))

    def _steps(self, side: int, until: float) -> None:
        """Integrate to an instant or the end of this motion."""
        rates = self._rates(side)
        y = np.array([self.q, self.w, self.T_w, self.T_h, *self.energy])
        if not side and not self.P.hot and not self.piece.slope:
            y, t, ended = y + (until - self.t) * rates(self.t, y), until, None
        else:
            t, y, ended = self._integrate(side, rates, y, until)
        self.t, self.energy = t, y[4:]
        self.q, self.w, self.T_w, self.T_h = (float(x) for x in y[:4])
        if ended is not None and side:
            self._arrive(side, ended == 1)
        elif ended is not None:
            self.events.append((t, "start"))
            self._steps(1 if ended else -1, until)
        self._carry()

    def _kinks(self, side: int, t: float, y: Array) -> tuple[float, ...]:
        """What changes its sign where a law has a kink: borders of the current's zones, torques in the gear."""
        P = self.P
        q, w, T_w, T_h = (float(x) for x in y[:4])
        R_a, K, K_b = P.electric(T_w, T_h)
        zones = self.bridge.zones(P, R_a, K_b) if P.hot else self._zones
        borders = tuple(w - zone.high for zone in zones[:-1])
        if not side or not any(P.shares):
            return borders
        K_m, K_e, K_ms, K_es = P.shares[:4]
        tau_m = K * self.zone(w, T_w, T_h).current(w)
        tau_e = -P.external(self.piece, t, q) - P.B_load * w
        return (*borders, K_m * tau_m - K_e * tau_e, K_ms * tau_m - K_es * tau_e, tau_m, tau_e, abs(tau_m) - abs(tau_e))

    def _integrate(self, side: int, rates: Callable[[float, Array], Array], y: Array,
                   until: float) -> tuple[float, Array, int | None]:
        """Time and state at an instant, or at the end of this motion and the number of the guard that ends it.

        A step that would pass a kink ends at it, and another begins there.
        """
        t, signs = self.t, [0] * 20
        solver = _solver(rates, t, y, until)
        while solver.status == "running":
            _step(solver)
            found = self._first(side, rates, (t, y), solver, signs)
            t, y, k = found or (solver.t, solver.y, None)
            if k is not None and k < GUARDS:
                return t, y, k
            if k is not None and t < until:
                signs, solver = [0] * 20, _solver(rates, t, y, until)
        return until, y, None

    def _first(self, side: int, rates: Callable[[float, Array], Array], start: tuple[float, Array], solver: Any,
               signs: list[int]) -> tuple[float, Array, int] | None:
        """First guard or kink within a step, with its time and the state there; learns the signs of kinks."""
        dense = solver.dense_output()
        for bracket in pairwise(float(x) for x in np.linspace(start[0], solver.t, 9)):
            at, y = bracket[1], dense(bracket[1])
            passed = [(k, 1) for k, x in enumerate(self._guards(side, at, y)) if x < -1e-15]
            for k, x in enumerate(self._kinks(side, at, y)):
                if abs(x) > CLEAR:
                    passed += [(k + GUARDS, signs[k])] if signs[k] * x < 0.0 else []
                    signs[k] = signs[k] or sgn(x)
            if passed:
                found = [(*self._root(side, k, sign, rates, start, dense, bracket), k) for k, sign in passed]
                return min(found, key=lambda end: end[0])
        return None

    def _root(self, side: int, k: int, sign: int, rates: Callable[[float, Array], Array], start: tuple[float, Array],
              dense: Callable[[float], Array], bracket: tuple[float, float]) -> tuple[float, Array]:
        """First time at which a guard or kink is 0: on the dense output, then by steps that end there."""
        (t, y), (low, high) = start, bracket

        def value(at: float, state: Array) -> float:
            guards = self._guards(side, at, state)
            return sign * (guards[k] if k < GUARDS else self._kinks(side, at, state)[k - GUARDS])

        def guard(at: float) -> float:
            return value(at, dense(at))

        if guard(low) <= 0.0:  # a start from rest that is at rest again within the bracket
            inside = (low + (high - low) * 0.5**power for power in range(1, 40))
            low = next((at for at in inside if guard(at) > 0.0), low)
        root = low if guard(low) <= 0.0 else float(brentq(guard, low, high, xtol=1e-16, rtol=1e-15))
        slope = (guard(high) - guard(root)) / (high - root)
        for _ in range(3):
            if root <= t:
                return t, y
            end = _run(rates, t, y, root)
            move = value(root, end) / slope
            if abs(move) < 1e-15 or not math.isfinite(move):
                break
            root -= move
        return root, _run(rates, t, y, root) if root > t else y


def _solver(rates: Callable[[float, Array], Array], t: float, y: Array, until: float) -> Any:
    scipy_solver: Any = DOP853
    return scipy_solver(rates, t, y, until, rtol=1e-13, atol=1e-14, first_step=min(until - t, 2e-4))


def _run(rates: Callable[[float, Array], Array], t: float, y: Array, until: float) -> Array:
    solver = _solver(rates, t, y, until)
    while solver.status == "running":
        _step(solver)
    return np.asarray(solver.y)


def _step(solver: Any) -> None:
    message = solver.step()
    if solver.status == "failed":
        raise RuntimeError(f"at {solver.t} s: {message}")
