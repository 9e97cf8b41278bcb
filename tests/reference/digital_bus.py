"""Independent reference of digital servos on one supply: all of them one system, from event to event.

Every servo has its program, ticks and duties of its own (`digital_firmware`), and motor and output with play between
them (`drivetrain_motion`); the bus voltage joins them (`digital_bus_circuit`). What the clocks do is known beforehand
and met exactly: at one instant all new duties, loads and commands, then all ticks, then samples. Between two events
`digital_bus_flow` moves them. Potentiometers and slow bridges ("coast") are left out.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from . import digital_bus_circuit as circuit
from .digital_bus_circuit import Winding
from .digital_bus_flow import Integrated, Parts, Straight, straight
from .digital_circuit import Bridge
from .digital_command import Commands
from .digital_firmware import Firmware, Sensed, Tick
from .digital_train import WORDS, Meeting
from .drivetrain_circuit import Source
from .drivetrain_laws import Plant, make_plant
from .drivetrain_motion import T_H, T_W, Mode, Q, V, W, X, decide, guards, happen, joined, motion

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Any]]
ENERGIES = ("supply", "winding", "bridge", "brush", "converter", "friction", "load")
TOL = 1e-14  # a guard below −TOL is an event
SAME = 1e-12  # s: instants this near are one
CROWD = 60  # events at one instant that no run needs
EARLY, EVEN = tuple(10.0**-k for k in range(6, 1, -1)), tuple(k / 10 for k in range(1, 11))
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
NEAR_EDGE = 1e-6  # counts: so near to its edge a measured angle is noted


class One(NamedTuple):
    """A servo, what it is told and what hangs on it.

    `goals` are (start [s], goal [rad]); `torques` (start, τ_ext [N m]), positive towards −q; `off` the stretches
    (start, end) without torque.
    """

    values: Values
    goals: Sequence[tuple[float, float]]
    inertia: float
    torques: Sequence[tuple[float, float]] = ((0.0, 0.0),)
    angle: float = 0.0
    off: Sequence[tuple[float, float]] = ()
    viscous: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Trace:
    """Of one servo: arrays at the asked times, each just after what happens there, a row per tick, events."""

    output_angle: Array
    output_speed: Array
    motor_angle: Array  # at the output: q_m/N
    motor_speed: Array
    current: Array
    supply_current: Array
    winding_temperature: Array
    housing_temperature: Array
    ticks: tuple[Tick, ...]
    events: tuple[tuple[float, str], ...]
    meetings: tuple[Meeting, ...]
    edges: tuple[tuple[float, float], ...]  # when a measured angle was near an edge of its count, and how near [counts]
    energy: dict[str, float]  # by the end of the run [J]; kinetic: gained


@dataclass(frozen=True, kw_only=True)
class Traces:
    """Of all on the bus."""

    times: Array
    bus_voltage: Array
    servos: tuple[Trace, ...]
    zones: tuple[tuple[float, str], ...]  # of the source, as they began


@dataclass
class Unit:
    """One servo as time goes by."""

    one: One
    P: Plant
    firmware: Firmware
    y: list[float]
    bridge: Bridge = field(default_factory=lambda: Bridge("open"))
    mode: Mode = field(default_factory=Mode)
    ticks: list[Tick] = field(default_factory=list)
    duties: deque[tuple[float, Bridge]] = field(default_factory=deque)
    events: list[tuple[float, str]] = field(default_factory=list)
    meetings: list[Meeting] = field(default_factory=list)
    edges: list[tuple[float, float]] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)
    energy: Array = field(default_factory=lambda: np.zeros(len(ENERGIES)))
    impacts: float = 0.0
    started: float = 0.0

    def __post_init__(self) -> None:
        f = self.one.values["firmware"]
        self.T_c, self.phase = float(f["control_period"]), float(f.get("control_phase", 0.0))
        self.delay, self.quantum = float(f.get("compute_delay", 0.0)), f.get("angle_quantum")
        self.torques = deque(self.one.torques)

    def tick_time(self) -> float:
        return self.phase + len(self.ticks) * self.T_c

    def next(self) -> float:
        """The next instant that the clock knows."""
        waits = [self.tick_time()]
        waits += [self.duties[0][0]] if self.duties else []
        waits += [self.torques[0][0]] if self.torques else []
        return min(waits)

    def change(self, t: float) -> None:
        """New duties and loads that are due."""
        while self.duties and self.duties[0][0] <= t + SAME:
            self.bridge = self.duties.popleft()[1]
        while self.torques and self.torques[0][0] <= t + SAME:
            self.P = replace(self.P, torque=self.torques.popleft()[1])

    def tick(self, winding: Winding, bus: float) -> None:
        t, y, f = self.tick_time(), self.y, self.firmware
        R_a, _, K_b = self.P.electric(y[T_W], y[T_H])
        f.least_tie = math.inf
        torque = not any(start <= t + SAME < end for start, end in self.one.off)
        sensed = Sensed(y[Q], y[V], winding.response(bus), bus, y[T_H], R_a + self.P.r_c, K_b)
        row, bridge = f.tick(t, sensed, torque)
        if f.least_tie < NEAR_EDGE:
            self.edges.append((t, f.least_tie))
        self.ticks.append(row)
        self.duties.append((t + self.delay, bridge))

    def winding(self, y: Sequence[float]) -> Winding:
        R_a, _, K_b = self.P.electric(y[T_W], y[T_H])
        return circuit.winding(self.P, self.bridge, self.mode.z, R_a, K_b * y[V])

    def torque(self, y: Sequence[float], winding: Winding, volts: float) -> float:
        """Of the motor, at the output."""
        return self.P.electric(y[T_W], y[T_H])[1] * winding.response(volts)

    def kinetic(self) -> float:
        return 0.5 * (self.P.J_L * self.y[W] ** 2 + self.P.J_m * self.y[V] ** 2)

    def powers(self, y: Sequence[float], winding: Winding, volts: float) -> Array:
        _, K, K_b = self.P.electric(y[T_W], y[T_H])
        i = winding.response(volts)
        go = motion(self.P, self.mode, y, K * i)
        return np.array([*winding.powers(volts), (K_b - K) * i * y[V], go.friction, go.load])

    def act(self, t: float, name: str) -> None:
        """What an event of its own does."""
        y, w, v = self.y, self.y[W], self.y[V]
        lost = happen(self.P, self.mode, y, name)
        self.impacts += lost
        if name == "flank":
            self.meetings.append(Meeting(t, w, v, y[W], lost))

    def word(self, name: str, freely: bool) -> str:
        """Name of an event by what came of it; `freely`: nothing held the output."""
        if name == "speed":
            return "turns" if freely else "reversal" if self.mode.d else "stick"
        if name == "current":
            return "current starts" if self.mode.z else "current stops"
        return WORDS.get(name, name)


class _Run:
    """All servos on one bus as time goes by."""

    def __init__(self, units: list[Unit], source: Source) -> None:
        self.units, self.source, self.zone, self.t = units, source, "line", 0.0
        self.flow = Straight if all(straight(unit.P) for unit in units) else Integrated
        self.zones, self.crowd, self.volts = [(0.0, "line")], (-1.0, 0), list[tuple[float, float]]()

    # The laws at one instant -------------------------------------------------------------------------------------

    def parts(self) -> Parts:
        return [unit.y for unit in self.units]

    def circuit(self, parts: Parts) -> tuple[list[Winding], float]:
        windings = [unit.winding(y) for unit, y in zip(self.units, parts, strict=True)]
        return windings, circuit.bus_voltage(self.source, self.zone, windings)

    def guards(self, parts: Parts) -> list[tuple[int, str, float]]:
        """What ends the modes, by servo and name; −1: the source."""
        windings, volts = self.circuit(parts)
        out: list[tuple[int, str, float]] = []
        for n, (unit, y, one) in enumerate(zip(self.units, parts, windings, strict=True)):
            out.append((n, "current", one.guard(volts)))
            out += [(n, *named) for named in guards(unit.P, unit.mode, y, unit.torque(y, one, volts))]
        return out + [(-1, "supply", x) for x in circuit.guards(self.source, self.zone, windings, volts)]

    def settle(self) -> None:
        """Zone, currents, contacts and directions from the laws."""
        before = self.zone
        self.zone, signs = circuit.decide(self.source, before, [unit.winding(unit.y) for unit in self.units])
        if self.zone != before:
            self.zones.append((self.t, self.zone))
        for unit, z in zip(self.units, signs, strict=True):
            unit.mode.z = z
        windings, volts = self.circuit(self.parts())
        for unit, one in zip(self.units, windings, strict=True):
            was = unit.mode.flank
            decide(unit.P, unit.mode, unit.y, unit.torque(unit.y, one, volts))
            if was and not unit.mode.flank:
                unit.events.append((self.t, "gear parts at once"))

    # Time --------------------------------------------------------------------------------------------------------

    def happen(self) -> None:
        """Do all that the clocks bring at this instant."""
        for unit in self.units:
            unit.change(self.t)
        self.settle()
        windings, volts = self.circuit(self.parts())
        for unit, one in zip(self.units, windings, strict=True):
            if unit.tick_time() <= self.t + SAME:
                unit.tick(one, volts)
        if any(unit.duties and unit.duties[0][0] <= self.t + SAME for unit in self.units):
            for unit in self.units:
                unit.change(self.t)
            self.settle()

    def advance(self, until: float) -> None:
        """Go on to an instant."""
        while self.t < until:
            now = next(((n, name) for n, name, x in self.guards(self.parts()) if x < -TOL), None)
            if now:
                self._act(*now)
                continue
            flow = self.flow(self.source, self.zone, self.units, [[*y] for y in self.parts()])
            span = min(until - self.t, flow.longest)
            found = self._find(flow, span)
            s = found[0] if found else span
            self._account(flow, s)
            for unit, y in zip(self.units, flow.at(s), strict=True):
                unit.y = y
            self.t = until if not found and span == until - self.t else self.t + s
            if found:
                self._act(*found[1:])

    def _find(self, flow: Straight | Integrated, span: float) -> tuple[float, int, str] | None:
        """First guard that turns negative: when, of which servo, its name."""
        low = 0.0
        for high in (x * span for x in (*EARLY, *EVEN)):
            found = self._earliest(flow, low, high, None)
            while found:
                sooner = self._earliest(flow, low, found[0], found[1:])
                if not sooner or sooner[0] >= found[0]:
                    return found
                found = sooner
            low = high
        return None

    def _earliest(self, flow: Straight | Integrated, low: float, high: float, but: tuple[int, str] | None,
                  ) -> tuple[float, int, str] | None:
        found = [(self._cross(flow, k, low, high), n, name)
                 for k, (n, name, x) in enumerate(self.guards(flow.at(high))) if x < -TOL and (n, name) != but]
        return min(found) if found else None

    def _cross(self, flow: Straight | Integrated, k: int, low: float, high: float) -> float:
        """Time just after a guard has turned negative."""
        def value(s: float) -> float:
            return self.guards(flow.at(s))[k][2] + TOL

        if value(low) < 0.0:
            return low
        s = float(brentq(value, low, high, xtol=1e-18, rtol=8.9e-16))
        ulp = math.ulp(s)
        while s < high and value(s) >= 0.0:
            s, ulp = min(s + ulp, high), 2.0 * ulp
        return s

    def _act(self, n: int, name: str) -> None:
        at, count = self.crowd
        self.crowd = (self.t, 1) if self.t > at + 1e-13 else (at, count + 1)
        if count > CROWD * len(self.units):
            raise RuntimeError(f"events without end at t = {self.t}: servo {n}, {name}")
        if n < 0:
            self.settle()
            return
        unit = self.units[n]
        freely = not joined(unit.P, unit.mode) and not unit.P.behind
        unit.act(self.t, name)
        self.settle()
        unit.events.append((self.t, unit.word(name, freely)))

    def _account(self, flow: Straight | Integrated, length: float) -> None:
        """Add up what the powers are along a stretch."""
        for x, weight in zip(NODES, WEIGHTS, strict=True):
            parts = flow.at(0.5 * length * (1.0 + float(x)))
            windings, volts = self.circuit(parts)
            for unit, y, one in zip(self.units, parts, windings, strict=True):
                unit.energy += 0.5 * length * weight * unit.powers(y, one, volts)

    def note(self) -> None:
        """Take a sample."""
        windings, volts = self.circuit(self.parts())
        self.volts.append((self.t, volts))
        for unit, one in zip(self.units, windings, strict=True):
            y, i = unit.y, one.response(volts)
            unit.rows.append((y[Q], y[W], y[X], y[V], i, one.share() * i, y[T_W], y[T_H]))


def run(ones: Sequence[One], source: Source, duration: float, times: Sequence[float] | Array) -> Traces:
    """Motion of servos that rest at t = 0, with their play in the middle, on one supply.

    Parameters
    ----------
    ones : sequence of One
        What they say of their own supply does not count, but for the drops of the bridge.
    source : Source
    duration : float
        End of the run [s].
    times : array, shape (n,)
        Rising, up to `duration` [s].
    """
    one_run, waiting = _Run([_unit(one) for one in ones], source), deque(float(t) for t in times)
    for unit in one_run.units:
        unit.started = unit.kinetic()
    one_run.happen()
    while True:
        while waiting and waiting[0] <= one_run.t + SAME:
            one_run.note()
            waiting.popleft()
        if one_run.t >= duration - SAME:
            break
        until = min(float(duration), *(unit.next() for unit in one_run.units), *list(waiting)[:1])
        one_run.advance(until)
        one_run.happen()
    return Traces(times=np.asarray(times, dtype=float), bus_voltage=np.array([x for _, x in one_run.volts]),
                  servos=tuple(_trace(unit) for unit in one_run.units), zones=tuple(one_run.zones))


def _unit(one: One) -> Unit:
    flat = {f"{group}.{name}": x for group, fields in one.values.items() for name, x in fields.items()}
    P = make_plant({"electronics.off_state": "brake", **flat},
                   {"inertia": one.inertia, "viscous_friction": one.viscous, "torque": one.torques[0][1]})
    if one.values.get("potentiometer") or one.values["firmware"].get("off_state", "brake") == "coast":
        raise ValueError("this reference knows no potentiometer and no slow bridge")
    pieces = [(t, goal, 0.0) for t, goal in one.goals]
    commands = Commands(one.values, {"kind": "goal", "pieces": pieces}, SAME)
    y = [one.angle, 0.0, 0.0, one.angle, 0.0, P.ambient, P.ambient]
    return Unit(one, P, Firmware(one.values, commands, 0), y)


def _trace(unit: Unit) -> Trace:
    q, w, x, v, i, supply, T_w, T_h = np.array(unit.rows).reshape(-1, 8).T
    energy = dict(zip(ENERGIES, unit.energy.tolist(), strict=True))
    return Trace(
        output_angle=q, output_speed=w, motor_angle=x, motor_speed=v, current=i, supply_current=supply,
        winding_temperature=T_w, housing_temperature=T_h, ticks=tuple(unit.ticks), events=tuple(unit.events),
        meetings=tuple(unit.meetings), edges=tuple(unit.edges),
        energy=energy | {"stops": unit.impacts, "kinetic": unit.kinetic() - unit.started})
