"""Reference solution of the bounded servo: pieces between events, integrated by DOP853, events polished to rounding.

While the shaft moves, a piece has one direction of motion and one zone of the drive (saturated, linear, deadband);
while it rests, nothing is integrated and the torque margin is watched. The reading of the specification is in
`rest_limits` (sticking), `zones` (drive) and `_Walker.hit` (stops).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

from .plant import Plant, Signal, Trajectory, segments, zero_error_angle

Array = NDArray[np.float64]
Guard = tuple[str, Callable[[float, Array], float]]

REST_SPEED = 1e-6  # below it, after the impact, the shaft rests on its stop
SCAN = 5e-4  # grid of the search for a release
MAX_EVENTS = 100_000
SAMPLES = np.array([1e-4, 0.01, 0.1, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True)
class Zone:
    """Interval of v_e on which va = gain (v_e − zero) + constant."""

    name: str
    lo: float
    hi: float
    gain: float
    zero: float
    constant: float


def zones(plant: Plant) -> list[Zone]:
    """Zones in rising order of v_e; without a deadband the two linear ones are one."""
    half, g, top = 0.5 * plant.w_v, plant.A_ks, plant.V_max
    edge = half + top / g if g > 0 else math.inf
    middle = [Zone("linear", -edge, edge, g, 0.0, 0.0)]
    if half > 0:
        middle = [
            Zone("linear", -edge, -half, g, -half, 0.0),
            Zone("deadband", -half, half, 0.0, 0.0, 0.0),
            Zone("linear", half, edge, g, half, 0.0),
        ]
    if math.isinf(edge):
        return middle
    return [Zone("saturation", -math.inf, -edge, 0.0, 0.0, -top), *middle,
            Zone("saturation", edge, math.inf, 0.0, 0.0, top)]


def armature_voltage(plant: Plant, v_e: float) -> float:
    """clip(A ks v_d, ±V_max), v_d the error outside a deadband of full width w_v."""
    half = 0.5 * plant.w_v
    v_d = 0.0 if abs(v_e) <= half else v_e - math.copysign(half, v_e)
    return min(max(plant.A_ks * v_d, -plant.V_max), plant.V_max)


def motor_shaft_torque(plant: Plant, v_c: float, t: float, q: float) -> float:
    """τ_a = k_a i_a − τ_ext/N at speed 0."""
    v_a = armature_voltage(plant, v_c - (plant.p * q + plant.b_o))
    return plant.k_a * v_a / plant.R - plant.load.external(t, q) / plant.N


def rest_limits(plant: Plant) -> tuple[float, float]:
    """(r F2, r F1), each widened by the load's own friction as the motor shaft feels it."""
    own = plant.load.coulomb / plant.N
    return plant.r * plant.F2 + own, plant.r * plant.F1 + own


@dataclass
class _Walker:
    """State of one run; `direction` is 0 at rest."""

    plant: Plant
    signal: Signal
    times: Array
    q: float
    w: float
    rtol: float
    max_step: float
    t: float = 0.0
    inside: float = 0.0  # last instant of the segment: the inputs' left limit is taken there
    direction: int = 0
    zone: int = 0
    stalled: int = 0
    done: int = 0
    out_q: list[float] = field(default_factory=list)
    out_w: list[float] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.zones = zones(self.plant)

    def v_e(self, t: float, q: float) -> float:
        return self.signal(min(t, self.inside)) - (self.plant.p * q + self.plant.b_o)

    def torque(self, t: float, q: float) -> float:
        t = min(t, self.inside)
        return motor_shaft_torque(self.plant, self.signal(t), t, q)

    def note(self, kind: str) -> None:
        self.events.append((self.t, kind))
        if len(self.events) > MAX_EVENTS:
            raise RuntimeError(f"more than {MAX_EVENTS} events by t = {self.t}")

    # --- at rest ---------------------------------------------------------------------------------------------------

    def margins(self) -> list[tuple[int, Callable[[float], float]]]:
        """(direction of release, torque that is missing to it) for each direction that no stop blocks."""
        back, forth = rest_limits(self.plant)
        out: list[tuple[int, Callable[[float], float]]] = []
        if self.q < self.plant.upper:
            out.append((1, lambda t: forth - self.torque(t, self.q)))
        if self.q > self.plant.lower:
            out.append((-1, lambda t: back + self.torque(t, self.q)))
        return out

    def release_direction(self) -> int:
        """0 if the shaft stays at rest now, else the direction in which it starts."""
        return next((d for d, margin in self.margins() if margin(self.t) < 0.0), 0)

    def rest(self, end: float) -> None:
        found = [(when, d) for d, margin in self.margins() if (when := first_below_zero(margin, self.t, end)) < end]
        until, direction = min(found, default=(end, 0))
        self.record_rest(until, last=direction == 0)
        self.t = until
        if direction:
            self.start(direction)

    def start(self, direction: int) -> None:
        on_stop = self.q in (self.plant.lower, self.plant.upper)
        self.direction = direction
        self.pick_zone()
        self.note(("stop_release" if on_stop else "release") + ("_forward" if direction > 0 else "_backward"))

    # --- in motion -------------------------------------------------------------------------------------------------

    def pick_zone(self) -> None:
        e = self.v_e(self.t, self.q)
        self.zone = next(n for n, z in enumerate(self.zones) if z.lo <= e <= z.hi)

    def right_side(self) -> Callable[[float, Array], Array]:
        P, z, d, inside = self.plant, self.zones[self.zone], self.direction, self.inside
        friction = d * (P.N * (P.F1 if d > 0 else P.F2) + P.load.coulomb)
        drive, drag = P.N * P.k_a / P.R, P.N**2 * P.k_a * P.k_b / P.R + P.B
        signal, external, J, p, b_o = self.signal, P.load.external, P.J, P.p, P.b_o

        def f(t: float, y: Array) -> Array:
            q, w = float(y[0]), float(y[1])
            t = min(t, inside)
            v_a = z.constant
            if z.gain:
                v_a += z.gain * (signal(t) - (p * q + b_o) - z.zero)
            return np.array([w, (drive * v_a - drag * w - friction - external(t, q)) / J])

        return f

    def guards(self) -> list[Guard]:
        """Functions that are positive inside the piece."""
        P, z, d = self.plant, self.zones[self.zone], self.direction
        out: list[Guard] = []
        if self.stalled < 4:  # several pieces of no length in a row: rounding at a tangency, so take one step
            out.append(("speed", lambda t, y: d * y[1]))
        if d > 0 and math.isfinite(P.upper):
            out.append(("stop", lambda t, y: P.upper - y[0]))
        if d < 0 and math.isfinite(P.lower):
            out.append(("stop", lambda t, y: y[0] - P.lower))
        if self.stalled < 2:
            if math.isfinite(z.lo):
                out.append(("down", lambda t, y: self.v_e(t, y[0]) - z.lo))
            if math.isfinite(z.hi):
                out.append(("up", lambda t, y: z.hi - self.v_e(t, y[0])))
        return out

    def slide(self, end: float) -> None:
        """One piece: until an event or the end of the segment."""
        f = self.right_side()
        y = np.array([self.q, self.w])
        solver = DOP853(f, self.t, y, end, rtol=self.rtol, atol=1e-14, max_step=self.max_step)
        t0, y0 = self.t, y
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise RuntimeError(f"integration failed at t = {t0}: {message}")
            event = first_event(self.guards(), solver, f, t0, y0)
            t1 = solver.t if event is None else event[0]
            self.record(f, t0, y0, t1)
            if event is not None:
                t1, y1, name = event
                self.stalled = self.stalled + 1 if t1 == self.t else 0
                self.t, (self.q, self.w) = t1, map(float, y1)
                self.change(name)
                return
            self.stalled = 0
            t0, y0 = solver.t, solver.y.copy()
        self.t, (self.q, self.w) = end, map(float, y0)

    def change(self, name: str) -> None:
        if name in ("up", "down"):
            self.zone += 1 if name == "up" else -1
            self.note(self.zones[self.zone].name)
        elif name == "stop":
            self.hit()
        else:
            before, self.w = self.direction, 0.0
            self.direction = self.release_direction()
            self.note("reversal" if self.direction == -before else "stick" if self.direction == 0 else "touch")
            if self.direction:
                self.pick_zone()

    def hit(self) -> None:
        """Speed times −restitution; below REST_SPEED the shaft rests, unless it is pushed away from the stop."""
        self.q = self.plant.upper if self.direction > 0 else self.plant.lower
        self.w *= -self.plant.restitution
        self.note("stop_hit")
        if abs(self.w) >= REST_SPEED:
            self.direction = -self.direction
            return
        self.w = 0.0
        self.note("stop_rest")
        self.direction = 0
        leaving = self.release_direction()
        if leaving:
            self.start(leaving)

    # --- output ----------------------------------------------------------------------------------------------------

    def record_rest(self, until: float, last: bool) -> None:
        stop = int(np.searchsorted(self.times, until, side="right" if last else "left"))
        count = max(stop - self.done, 0)
        self.out_q += [self.q] * count
        self.out_w += [0.0] * count
        self.done += count

    def record(self, f: Callable[[float, Array], Array], t0: float, y0: Array, t1: float) -> None:
        while self.done < self.times.size and self.times[self.done] <= t1:
            y = flow(f, t0, y0, float(self.times[self.done]))
            self.out_q.append(float(y[0]))
            self.out_w.append(float(y[1]))
            self.done += 1


def flow(f: Callable[[float, Array], Array], t0: float, y0: Array, t: float) -> Array:
    """State at t inside a step that DOP853 accepted from t0: the same formula with a smaller step."""
    if t <= t0:
        return y0
    solver = DOP853(f, t0, y0, t, first_step=t - t0, rtol=1e-12, atol=1e-14)
    while solver.status == "running":
        solver.step()
    return np.asarray(solver.y)


def first_event(
    guards: list[Guard], solver: DOP853, f: Callable[[float, Array], Array], t0: float, y0: Array
) -> tuple[float, Array, str] | None:
    """Earliest zero of a guard within the last step, polished on integrations from the start of the step."""
    dense = solver.dense_output()
    ts = t0 + SAMPLES * (solver.t - t0)
    ys = dense(ts).T
    best: tuple[float, Array, str] | None = None
    for name, g in guards:
        values = np.array([g(t0, y0), *(g(t, y) for t, y in zip(ts, ys, strict=True))])
        bracket = _bracket(np.concatenate([[t0], ts]), values, lambda t, g=g: g(t, dense(t)))
        if bracket is None:
            continue
        lo, hi = bracket
        when = _polish(lambda t, g=g: float(g(t, flow(f, t0, y0, t))), lo, hi)
        if best is None or when < best[0]:
            best = when, flow(f, t0, y0, when), name
    return best


def _bracket(ts: Array, values: Array, g: Callable[[float], float]) -> tuple[float, float] | None:
    """Interval with the first change to negative; a dip between two samples is looked for where one can be."""
    for n in range(1, ts.size):
        if values[n] < 0.0:
            return float(ts[n - 1]), float(ts[n])
        if 1 < n < ts.size - 1 and values[n] < values[n - 1] and values[n] < values[n + 1]:
            low = minimize_scalar(g, bounds=(ts[n - 1], ts[n + 1]), method="bounded", options={"xatol": 1e-12})
            if low.fun < 0.0:
                return float(ts[n - 1]), float(low.x)
    return None


def _polish(g: Callable[[float], float], lo: float, hi: float) -> float:
    g_lo = g(lo)
    if g_lo <= 0.0:
        return lo
    return hi if g(hi) >= 0.0 else float(brentq(g, lo, hi, xtol=1e-16, rtol=8.9e-16))


def first_below_zero(margin: Callable[[float], float], a: float, b: float) -> float:
    """First time in [a, b] at which a continuous margin, not negative at a, turns negative; inf if it does not."""
    count = max(16, math.ceil((b - a) / SCAN))
    ts = np.linspace(a, b, count + 1)
    values = np.array([margin(float(t)) for t in ts])
    if np.all(values == values[0]):
        return math.inf
    bracket = _bracket(ts, values, margin)
    return math.inf if bracket is None else _polish(margin, *bracket)


def solve_bounded(
    plant: Plant, v_c: Signal, t_end: float, times: Sequence[float] | Array, y0: Sequence[float] | None = None,
    breaks: Sequence[float] = (), rtol: float = 1e-12, max_step: float = 2e-3,
) -> Trajectory:
    """Run from y0 = (q, w), else from rest at the zero-error angle; `times` sorted, within [0, t_end]."""
    q, w = (zero_error_angle(plant, v_c), 0.0) if y0 is None else map(float, y0)
    if not plant.lower <= q <= plant.upper:
        raise ValueError(f"start angle {q} lies outside the stops {plant.lower}, {plant.upper}")
    walker = _Walker(plant, v_c, np.asarray(times, dtype=float), q, w, rtol, max_step)
    walker.direction = int(np.sign(w))
    for a, b in segments(t_end, [*breaks, *plant.load.tau_breaks]):
        walker.t, walker.inside, walker.stalled = a, math.nextafter(b, -math.inf), 0
        if walker.direction:
            walker.pick_zone()
        elif direction := walker.release_direction():
            walker.start(direction)
        while walker.t < b:
            if walker.direction:
                walker.slide(b)
            else:
                walker.rest(b)
    return Trajectory(q=np.array(walker.out_q), w=np.array(walker.out_w), events=tuple(walker.events))
