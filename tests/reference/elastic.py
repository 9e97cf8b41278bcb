"""Independent reference of two bodies with a spring between them, written from the specification: slow and plain.

The spring is the gear's, between motor and output, or that of a shaft, between the output and what hangs behind it.
The bridge drives by a schedule that is given. Between events every body keeps its way of moving, the spring its way of
acting and the current its sign; DOP853 integrates, its dense output is scanned for the first condition that fails, and
there all of it is decided anew from the laws.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

Array = NDArray[np.float64]
_SCAN = np.linspace(0.0, 1.0, 17)[1:]
_TINY = 1e-13
_PUSHES = {"parts": 2, "meets 1": 1, "meets -1": -1}  # with play, which begins in its middle


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Everything at the output shaft: body 1 has the motor, body 2 is behind the spring."""

    J1: float
    J2: float
    B1: float = 0.0  # of the motor
    B2: float = 0.0
    k: float
    c: float = 0.0
    play: float = 0.0
    at_gear: bool = True  # what the load says, and the stops, belong to body 2; else to body 1, with the motor
    K: float = 1.0  # torque per ampere
    K_b: float = 1.0
    R: float = 3.0
    R_off: float = 3.0  # braked
    V: float = 6.0
    drop: float = 0.0
    forward: float = 0.0  # Coulomb friction of the gear
    backward: float = 0.0
    breakaway: float = 1.0
    share: float = 0.0  # of the torques through the gear (M3)
    dry: float = 0.0  # Coulomb friction of the load
    torque: float = 0.0
    gravity: float = 0.0
    hanging: float = 0.0
    spring: float = 0.0
    rest: float = 0.0
    weight: float = 0.0  # m g l of a body behind the shaft
    weight_hanging: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    restitution: float = 0.0


class Ways(NamedTuple):
    """How things are now: bodies slide (+1, −1), stand (0) or lean on a stop (2, −2); what pushes; sign of current."""

    one: int
    two: int
    push: int  # 0: the spring acts as it is without play; ±1: it pushes so; 2: it does not act
    current: int


class Trace(NamedTuple):
    """States (q1, w1, q2, w2) at the asked times, shape (n, 4), and what happened when."""

    states: Array
    events: list[tuple[float, str]]


class _Run:
    def __init__(self, pair: Pair, drive: int) -> None:
        self.p, self.drive = pair, drive

    # --- laws ---------------------------------------------------------------------------------------------------------

    def volts(self, y: Array) -> float:
        return self.drive * self.p.V - self.p.K_b * float(y[1])

    def motor(self, y: Array, ways: Ways) -> float:
        x = self.volts(y)
        if self.drive == 0:
            return self.p.K * x / self.p.R_off
        return self.p.K * (x - ways.current * self.p.drop) / self.p.R if ways.current else 0.0

    def between(self, y: Array, push: int) -> float:
        if push == 2:
            return 0.0
        return self.p.k * float(y[0] - y[2] - 0.5 * push * self.p.play) + self.p.c * float(y[1] - y[3])

    def outside(self, q: float) -> float:
        p = self.p
        return p.torque + p.spring * (q - p.rest) + p.gravity * math.sin(q - p.hanging)

    def nets(self, y: Array, ways: Ways) -> tuple[float, float, float]:
        """Return the torques on both bodies without friction and damping, and what the gear feels of its load."""
        motor, spring, p = self.motor(y, ways), self.between(y, ways.push), self.p
        if p.at_gear:
            return motor - spring, spring - self.outside(float(y[2])), -spring
        against = self.outside(float(y[0]))
        felt = -against - spring
        return motor - spring - against, spring - p.weight * math.sin(float(y[2]) - p.weight_hanging), felt

    def budgets(self, y: Array, ways: Ways, static: bool) -> tuple[float, float, float]:
        """Return what friction takes of body 1 forward and backward, and of body 2 either way."""
        p = self.p
        more = p.share * abs(self.motor(y, ways) - self.nets(y, ways)[2])
        factor = p.breakaway if static else 1.0
        dry = 0.0 if p.at_gear else p.dry
        return p.forward * factor + more + dry, p.backward * factor + more + dry, p.dry if p.at_gear else 0.0

    def rates(self, y: Array, ways: Ways) -> Array:
        p = self.p
        one, two, _ = self.nets(y, ways)
        forward, backward, dry = self.budgets(y, ways, static=False)
        dw1 = (one - p.B1 * y[1] - (forward if ways.one > 0 else -backward)) / p.J1 if ways.one in (1, -1) else 0.0
        dw2 = (two - p.B2 * y[3] - ways.two * dry) / p.J2 if ways.two in (1, -1) else 0.0
        return np.array([y[1], dw1, y[3], dw2])

    # --- decisions ----------------------------------------------------------------------------------------------------

    def decide(self, y: Array, before: Ways | None, freed: tuple[int, int] = (0, 0)) -> Ways:
        p = self.p
        push, current = 2 if p.play else 0, self.flows(y)
        if before is not None:
            push, current = before.push, before.current
        ways = Ways(1, 1, push, current)
        one, two, _ = self.nets(y, ways)
        forward, backward, dry = self.budgets(y, ways, static=True)
        return Ways(self.way(float(y[0]), float(y[1]), one, forward, backward, freed[0], stops=not p.at_gear),
                    self.way(float(y[2]), float(y[3]), two, dry, dry, freed[1], stops=p.at_gear), push, current)

    def flows(self, y: Array) -> int:
        """Return the sign of the current; without a drop it is one law either way."""
        x, drop = self.volts(y), self.p.drop
        return 0 if not self.drive else 1 if x > drop or drop == 0.0 else -1 if x < -drop else 0

    def way(self, q: float, w: float, net: float, forward: float, backward: float, freed: int, *, stops: bool) -> int:
        if w != 0.0:
            return 1 if w > 0.0 else -1
        side = freed or (1 if net > forward else -1 if net < -backward else 0)
        if stops and side > 0 and q >= self.p.upper - _TINY:
            return 2
        if stops and side < 0 and q <= self.p.lower + _TINY:
            return -2
        return side

    def conditions(self, ways: Ways) -> list[tuple[str, Callable[[Array], float]]]:
        """Return what holds, at least zero, as long as these ways last."""
        p, found = self.p, []
        for at, name, way in ((1, "one", ways.one), (3, "two", ways.two)):
            if way in (1, -1):
                stopped = (at == 3) == p.at_gear
                dry = bool(stopped and p.dry) or (at == 1 and bool(p.forward or p.backward or p.share))
                if dry:
                    found.append((f"{name} stops", lambda y, at=at, way=way: way * float(y[at])))
                if stopped and (way > 0 or not dry):
                    found.append(("upper", lambda y, at=at: p.upper - float(y[at - 1])))
                if stopped and (way < 0 or not dry):
                    found.append(("lower", lambda y, at=at: float(y[at - 1]) - p.lower))
                continue
            body = 0 if at == 1 else 1
            if way in (0, -2):
                found.append((f"{name} starts forward", lambda y, body=body: self.left(y, ways, body, 1)))
            if way in (0, 2):
                found.append((f"{name} starts backward", lambda y, body=body: self.left(y, ways, body, -1)))
        if ways.push in (1, -1):
            found.append(("parts", lambda y: ways.push * self.between(y, ways.push)))
        if ways.push == 2:
            for side in (1, -1):
                found.append((f"meets {side}", lambda y, side=side: max(
                    0.5 * p.play - side * float(y[0] - y[2]), -side * self.between(y, side))))
        if self.drive and p.drop:
            if ways.current:
                found.append(("current", lambda y: ways.current * self.volts(y) - p.drop))
            else:
                found += [("current", lambda y, s=s: p.drop - s * self.volts(y)) for s in (1, -1)]
        if p.share and ways.one in (1, -1):
            sign = 0.0

            def turns(y: Array) -> float:
                nonlocal sign
                value = self.motor(y, ways) - self.nets(y, ways)[2]
                sign = sign or math.copysign(1.0, value)
                return sign * value
            found.append(("share turns", turns))
        return found

    def left(self, y: Array, ways: Ways, body: int, side: int) -> float:
        """Return how much more friction could hold of a body that stands."""
        net = self.nets(y, ways)[body]
        forward, backward, dry = self.budgets(y, ways, static=True)
        most = dry if body else forward if side > 0 else backward
        return most - side * net


def solve(pair: Pair, schedule: Sequence[tuple[float, int]], start: Sequence[float], times: Array) -> Trace:
    """Return the states at increasing times, under drives that begin at the times of the schedule."""
    y, found, events = np.array(start, dtype=float), np.zeros((len(times), 4)), []
    bounds = [*(t for t, _ in schedule[1:]), float(times[-1])]
    before: Ways | None = None
    found[times <= schedule[0][0]] = y
    for (t, drive), end in zip(schedule, bounds, strict=True):
        run, now, freed = _Run(pair, drive), t, (0, 0)
        before = before and before._replace(current=run.flows(y))
        while now < end:
            ways = run.decide(y, before, freed)
            now, y, freed = _leg(run, ways, now, end, y, times, found, events)
            before = ways if now >= end else _after(run, ways, events[-1][1], y)
    return Trace(found, events)


def _leg(run: _Run, ways: Ways, start: float, end: float, y: Array, times: Array, found: Array,
         events: list[tuple[float, str]]) -> tuple[float, Array, tuple[int, int]]:
    """Go on in these ways to their end; fill in the states at the times on the way."""
    solver = DOP853(lambda _, x: run.rates(x, ways), start, y, end, rtol=1e-12, atol=1e-14, max_step=5e-4)
    conditions = run.conditions(ways)
    while solver.status == "running":
        solver.step()
        dense, a = solver.dense_output(), solver.t_old
        first, kind = math.inf, ""
        for name, holds in conditions:
            low = a
            for b in a + (solver.t - a) * _SCAN:
                if holds(dense(b)) < -_TINY:
                    value = holds(dense(low))
                    at = low if value <= 0.0 else brentq(
                        lambda s, holds=holds, dense=dense: holds(dense(s)), low, b, xtol=1e-16)
                    if at < first:
                        first, kind = at, name
                    break
                low = b
        stop = min(first, solver.t)
        inside = (times > a) & (times <= stop)
        found[inside] = np.array([dense(t) for t in times[inside]]).reshape(-1, 4)
        if kind:
            events.append((first, kind))
            return first, *_happen(run, kind, np.array(dense(first)))
    return end, solver.y, (0, 0)


def _after(run: _Run, ways: Ways, kind: str, y: Array) -> Ways:
    """Return the ways with what an event says of spring and current."""
    if kind in _PUSHES:
        return ways._replace(push=_PUSHES[kind])
    if kind == "current":
        return ways._replace(current=0 if ways.current else 1 if run.volts(y) > 0.0 else -1)
    return ways._replace(current=run.flows(y)) if kind in ("upper", "lower") else ways


def _happen(run: _Run, kind: str, y: Array) -> tuple[Array, tuple[int, int]]:
    """Return the state after an event, and which body has just been freed, and which way."""
    if kind.endswith("stops"):
        y[1 if kind.startswith("one") else 3] = 0.0
    elif kind in ("upper", "lower"):
        at = 3 if run.p.at_gear else 1
        y[at - 1] = run.p.upper if kind == "upper" else run.p.lower
        y[at] *= -run.p.restitution
        if abs(y[at]) < 1e-6:
            y[at] = 0.0
    elif "starts" in kind:
        side = 1 if kind.endswith("forward") else -1
        return y, (side, 0) if kind.startswith("one") else (0, side)
    return y, (0, 0)
