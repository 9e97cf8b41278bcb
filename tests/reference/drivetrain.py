"""Slow, fine reference of the pulse-level servo with everything on: inductance, limit, play, friction M1-M6, heat.

Between two events every servo on the bus keeps its mode (`Mode`, zone of the source); DOP853 integrates that smooth
system, its dense output is scanned for the first guard that turns negative, and there the mode is decided anew from
the laws. What the clock does (edges, decisions, ends of drive) is known beforehand and met exactly. Noise is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

from . import drivetrain_circuit as circuit
from .drivetrain_cases import Case
from .drivetrain_circuit import Armature, Source
from .drivetrain_frame import Frames, make_chip, make_potentiometer
from .drivetrain_laws import Plant, make_plant
from .drivetrain_motion import T_H, T_W, I, Mode, Q, V, W, X, decide, guards, happen, joined, motion
from .recorded import recorded

Array = NDArray[np.float64]

SIZE = 14  # of the state: seven of the motion, then the energies
ENERGIES = ("supply", "winding", "bridge", "brush", "converter", "friction", "load")
TOL = 1e-14  # a guard below -TOL is an event
CROWD = 60  # events at one instant that no run needs


@dataclass(frozen=True, kw_only=True)
class Trace:
    """Arrays at the asked times, each the value just after what happens there."""

    times: Array
    output_angle: Array
    output_speed: Array
    motor_angle: Array  # motor shaft
    motor_speed: Array
    armature_current: Array
    winding_temperature: Array
    housing_temperature: Array
    drive: Array
    wiper_angle: Array
    bus_voltage: Array
    error_time: Array
    events: tuple[tuple[float, str], ...]
    energy: dict[str, float]  # by the end of the run [J]; stored: kinetic and magnetic, gained
    margin: float  # smallest ||e| - w/2| of all frames [s]
    tie: float  # smallest distance of a measurement from a change of its count [V]

    def near_event(self, times: Array, distance: float = 1e-7) -> NDArray[np.bool_]:
        """Whether a time is so near to an event that rounding decides on which side it lies."""
        at = np.array([t for t, _ in self.events])
        return np.array([bool(at.size and np.min(np.abs(at - t)) < distance) for t in times])


class Found(NamedTuple):
    """The first event of a step: when, which servo (-1: the source), its name."""

    t: float
    servo: int
    name: str


@dataclass
class _Unit:
    """One servo on the bus as time goes by."""

    P: Plant
    frames: Frames
    wiper: float
    stored: float = 0.0
    impacts: float = 0.0
    mode: Mode = field(default_factory=Mode)
    events: list[tuple[float, str]] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def armature(self, y: Sequence[float]) -> Armature:
        R_a, _, K_b = self.P.electric(y[T_W], y[T_H])
        return Armature(self.P, self.mode.drive, self.mode.z, R_a, K_b * y[V], y[I])

    def current(self, a: Armature, V_bus: float) -> float:
        return a.i if self.P.L else a.response(V_bus)

    def motor_torque(self, y: Sequence[float], a: Armature, V_bus: float) -> float:
        return self.P.electric(y[T_W], y[T_H])[1] * self.current(a, V_bus)

    def rates(self, y: Sequence[float], a: Armature, V_bus: float) -> list[float]:
        P = self.P
        R_a, K, K_b = P.electric(y[T_W], y[T_H])
        i = self.current(a, V_bus)
        go = motion(P, self.mode, y, K * i)
        lost = i * i * R_a
        out = ((y[T_W] - y[T_H]) / P.R_wh, (y[T_H] - P.ambient) / P.R_ha) if P.hot else (lost, lost)
        warm = ((lost - out[0]) / P.C_w, (out[0] - out[1]) / P.C_h) if P.hot else (0.0, 0.0)
        bridge = abs(i) * P.V_ce0 * (a.drive != 0 or P.coasts) + P.r_c * i * i * abs(a.drive)
        return [
            y[W], go.output, a.response(V_bus) if P.L else 0.0, y[V], go.motor, *warm,
            V_bus * a.share() * i, lost, bridge, abs(i) * P.V_br, (K_b - K) * i * y[V], go.friction, go.load,
        ]

    def guards(self, y: Sequence[float], a: Armature, V_bus: float) -> list[tuple[str, float]]:
        i = self.current(a, V_bus)
        electric = a.z * i if a.z else -0.1 * a.excess(V_bus)
        return [("current", electric), *guards(self.P, self.mode, y, self.motor_torque(y, a, V_bus))]

    def row(self, y: Sequence[float], a: Armature, V_bus: float) -> tuple[float, ...]:
        x, v = (y[Q] + 0.5 * self.mode.flank * self.P.play, y[W]) if joined(self.P, self.mode) else (y[X], y[V])
        return (y[Q], y[W], self.P.N * x, self.P.N * v, self.current(a, V_bus), y[T_W], y[T_H], self.mode.drive,
                self.frames.pot.wiper(self.wiper, y[Q]), V_bus, self.frames.error)

    def energy(self, y: Sequence[float]) -> float:
        """Kinetic and magnetic [J]."""
        return 0.5 * (self.P.J_L * y[W] ** 2 + self.P.J_m * y[V] ** 2 + self.P.L * y[I] ** 2)


@dataclass
class _Run:
    """All servos on one bus."""

    units: list[_Unit]
    source: Source
    times: Array
    end: float
    y: list[float]
    rtol: float
    atol: float
    max_step: float
    samples: int
    t: float = 0.0
    zone: str = "line"
    done: int = 0
    crowd: tuple[float, int] = (-1.0, 0)

    # --- the smooth system -----------------------------------------------------------------------------------------

    def parts(self, y: Sequence[float]) -> list[list[float]]:
        return [list(y[SIZE * n:SIZE * (n + 1)]) for n in range(len(self.units))]

    def circuit(self, parts: list[list[float]]) -> tuple[list[Armature], float]:
        armatures = [u.armature(y) for u, y in zip(self.units, parts, strict=True)]
        return armatures, circuit.bus_voltage(self.source, self.zone, armatures)

    def rates(self, t: float, y: Array) -> list[float]:
        parts = self.parts(y.tolist())
        armatures, V_bus = self.circuit(parts)
        return [x for u, p, a in zip(self.units, parts, armatures, strict=True) for x in u.rates(p, a, V_bus)]

    def guards(self, y: Sequence[float]) -> list[tuple[int, str, float]]:
        parts = self.parts(y)
        armatures, V_bus = self.circuit(parts)
        out = []
        for n, u in enumerate(self.units):
            out += [(n, *named) for named in u.guards(parts[n], armatures[n], V_bus)]
        # Last, so that a current that ends, and the sum of the currents with it, ends as a current.
        return out + [(-1, "supply", x) for x in circuit.guards(self.source, self.zone, armatures, V_bus)]

    # --- events ----------------------------------------------------------------------------------------------------

    def find(self, state: Callable[[float], Array], t_0: float, t_1: float, first: bool) -> Found | None:
        """First guard that turns negative within a step; what follows an event at once is looked for from near it."""
        early = [10.0**-k for k in range(6, 1, -1)] if first else []
        fractions = early + [k / self.samples for k in range(1, self.samples)]
        low = t_0
        for high in [*(t_0 + (t_1 - t_0) * x for x in fractions), t_1]:
            found = self.earliest(state, low, high)
            while found:  # where a speed comes to 0 an angle is at its extreme, perhaps beyond a stop
                sooner = self.earliest(state, low, found.t, found)
                if not sooner or sooner.t >= found.t:
                    return found
                found = sooner
            low = high
        return None

    def earliest(self, state: Callable[[float], Array], low: float, high: float, but: Found | None = None,
                 ) -> Found | None:
        """Of the guards that are negative at `high` the one that turned so first; `but` is known already."""
        found = [Found(self.cross(state, n, low, high), servo, name)
                 for n, (servo, name, x) in enumerate(self.guards(state(high).tolist()))
                 if x < -TOL and (but is None or (servo, name) != (but.servo, but.name))]
        return min(found, key=lambda x: x.t) if found else None

    def cross(self, state: Callable[[float], Array], n: int, low: float, high: float) -> float:
        """Time just after a guard has turned negative, however it does."""
        def value(t: float) -> float:
            return self.guards(state(t).tolist())[n][2] + TOL

        if value(low) < 0.0:
            return low
        t = float(brentq(value, low, high, xtol=1e-18, rtol=8.9e-16))
        ulp = math.ulp(t)
        while t < high and value(t) >= 0.0:
            t, ulp = min(t + ulp, high), 2.0 * ulp
        return t

    def act(self, found: Found) -> None:
        """What the event does, then everything decided anew."""
        at, count = self.crowd
        self.crowd = (self.t, 1) if self.t > at + 1e-13 else (at, count + 1)
        if count > CROWD * len(self.units):
            raise RuntimeError(f"events without end at t = {self.t}: {found.name}")
        parts, name = self.parts(self.y), found.name
        if found.servo >= 0:
            u, y = self.units[found.servo], parts[found.servo]
            if name == "current":
                y[I] = 0.0
            u.impacts += happen(u.P, u.mode, y, name)
        self.settle(parts)
        for n, u in enumerate(self.units):
            if n == found.servo or found.servo < 0:
                u.events.append((self.t, _word(name, u.mode)))

    def settle(self, parts: list[list[float]]) -> None:
        """Zone, currents, contacts and directions from the laws at this instant."""
        armatures = [u.armature(y) for u, y in zip(self.units, parts, strict=True)]
        for y, i in zip(parts, circuit.settled_currents(self.source, armatures), strict=True):
            y[I] = i
        armatures = [u.armature(y) for u, y in zip(self.units, parts, strict=True)]
        self.zone, signs = circuit.decide(self.source, armatures)
        for u, z in zip(self.units, signs, strict=True):
            u.mode.z = z
        armatures, V_bus = self.circuit(parts)
        for u, y, a in zip(self.units, parts, armatures, strict=True):
            was = u.mode.flank
            decide(u.P, u.mode, y, u.motor_torque(y, a, V_bus))
            if was and not u.mode.flank:
                u.events.append((self.t, "part"))
        self.y = [x for y in parts for x in y]

    def arrive(self, t: float, y: Sequence[float]) -> None:
        """Take over a state; two bodies that are one are put exactly together, the wipers follow."""
        self.t, parts = t, self.parts(y)
        for u, p in zip(self.units, parts, strict=True):
            if joined(u.P, u.mode):
                p[X], p[V] = p[Q] + 0.5 * u.mode.flank * u.P.play, p[W]
            u.wiper = u.frames.pot.wiper(u.wiper, p[Q])
        self.y = [x for p in parts for x in p]

    # --- clock -----------------------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Ends of drives and decisions of all servos, then what the edges measure."""
        for u in self.units:
            u.events += [(self.t, name) for name in u.frames.switch(self.t)]
            u.mode.drive = u.frames.drive
        self.settle(self.parts(self.y))
        parts = self.parts(self.y)
        armatures, V_bus = self.circuit(parts)
        for u, a in zip(self.units, armatures, strict=True):
            while u.frames.next_edge() <= self.t:
                u.frames.measure(u.wiper, a.terminal(V_bus, u.current(a, V_bus)), V_bus - self.source.V_oc)
                u.events.append((self.t, "edge"))

    def advance(self, until: float) -> None:
        """Up to the next thing that the clock knows."""
        while self.t < until:
            now = next(((n, name) for n, name, x in self.guards(self.y) if x < -TOL), None)
            if now:
                self.act(Found(self.t, *now))
                continue
            solver = DOP853(self.rates, self.t, np.array(self.y), until, max_step=self.max_step, rtol=self.rtol,
                            atol=self.atol)
            while solver.status == "running":
                first = solver.t == self.t
                solver.step()
                if solver.status == "failed":
                    raise RuntimeError(f"no step at t = {solver.t}")
                dense = solver.dense_output()
                found = self.find(dense, solver.t_old, solver.t, first)
                self.record(found.t if found else solver.t, dense)
                if found:
                    self.arrive(found.t, dense(found.t).tolist())
                    self.act(found)
                    break
            else:
                self.arrive(until, solver.y.tolist())

    def record(self, until: float, state: Callable[[float], Array]) -> None:
        while self.done < self.times.size and self.times[self.done] < until:
            self.note(state(float(self.times[self.done])).tolist())

    def note(self, y: Sequence[float]) -> None:
        parts = self.parts(y)
        armatures, V_bus = self.circuit(parts)
        for u, p, a in zip(self.units, parts, armatures, strict=True):
            u.rows.append(u.row(p, a, V_bus))
        self.done += 1

    def run(self) -> None:
        for u, y in zip(self.units, self.parts(self.y), strict=True):
            u.stored = u.energy(y)
        while True:
            self.tick()
            if self.t >= self.end:
                break
            self.advance(min(self.end, *(u.frames.horizon() for u in self.units)))
        while self.done < self.times.size:
            self.note(self.y)

    def trace(self, n: int) -> Trace:
        u, y = self.units[n], self.parts(self.y)[n]
        energy = dict(zip(ENERGIES, y[-len(ENERGIES):], strict=True))
        energy |= {"stops": u.impacts, "stored": u.energy(y) - u.stored}
        columns = np.array(u.rows).reshape(-1, 11).T
        names = ("output_angle", "output_speed", "motor_angle", "motor_speed", "armature_current",
                 "winding_temperature", "housing_temperature", "drive", "wiper_angle", "bus_voltage", "error_time")
        return Trace(times=self.times, events=tuple(u.events), energy=energy, margin=u.frames.margin,
                     tie=u.frames.tie, **dict(zip(names, columns, strict=True)))


def _word(name: str, m: Mode) -> str:
    """Name of an event by what came of it."""
    if name == "speed":
        return "reversal" if m.d else "stick"
    if name == "motor_speed":
        return "motor_reversal" if m.d_m else "motor_stick"
    return name


def _unit(case: Case, shifts: Callable[[int], float]) -> tuple[_Unit, list[float]]:
    v, given = case.values, case.initial
    P, chip, pot = make_plant(v, case.load), make_chip(v), make_potentiometer(v)
    start = pot.angle((case.command.before - chip.T_0) / chip.slope)
    q, w = given.get("output_angle", start), given.get("output_speed", 0.0)
    x, motor = given.get("motor_angle", P.N * q) / P.N, given.get("motor_speed", P.N * w) / P.N
    if not P.lower <= q <= P.upper or abs(x - q) > 0.5 * P.play + 1e-15 or (motor != w and not P.play):
        raise ValueError(f"start at {q} with the motor at {x}: outside the stops, or of the play")
    temperatures = (given.get("winding_temperature", P.ambient), given.get("housing_temperature", P.ambient))
    y = [q, w, given.get("armature_current", 0.0), x, motor, *temperatures, *[0.0] * len(ENERGIES)]
    return _Unit(P, Frames(chip, pot, case.command.width, case.edges, shifts), q), y


@recorded
def simulate_bus(
    cases: Sequence[Case], source: Source, times: Sequence[float] | Array, *, rtol: float = 1e-12, atol: float = 1e-14,
    max_step: float = 2e-3, samples: int = 8, shifts: Callable[[int], float] = lambda frame: 0.0,
) -> list[Trace]:
    """Servos on one supply, each with its own frames and load; those with and without inductance do not mix.

    `source` takes the place of their own supplies (the bridges' drops stay theirs); the longest duration counts.
    """
    made = [_unit(case, shifts) for case in cases]
    if len({u.P.L > 0.0 for u, _ in made}) > 1:
        raise ValueError("servos with and without inductance on one bus")
    run = _Run([u for u, _ in made], source, np.asarray(times, dtype=float), max(c.duration for c in cases),
               [x for _, y in made for x in y], rtol, atol, max_step, samples)
    run.run()
    return [run.trace(n) for n in range(len(made))]


def source_of(case: Case) -> Source:
    """The supply that a servo brings along."""
    v = case.values
    return Source(v["supply.open_circuit_voltage"], v.get("supply.internal_resistance", 0.0),
                  v.get("supply.current_limit", math.inf))


def simulate_case(case: Case, times: Sequence[float] | Array, **options: float | Callable[[int], float]) -> Trace:
    """One servo on its own supply; `options` as in `simulate_bus`."""
    return simulate_bus([case], source_of(case), times, **options)[0]  # type: ignore[arg-type]


def spread(case: Case, times: Sequence[float] | Array, size: float, seed: int = 0) -> float:
    """Largest change of the angle when each frame's one-shot is ±`size` [s] longer, the signs random."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], 20_000)
    moved = simulate_case(case, times, shifts=lambda frame: size * float(signs[frame]))
    return float(np.max(np.abs(moved.output_angle - simulate_case(case, times).output_angle), initial=0.0))
