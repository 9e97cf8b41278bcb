"""Reference solution of the pulse-level servo: every piece between two events by its Taylor series.

The reading of the specification is in `Chip.drive_time` (stretcher), `Shaft.bridge` (bridge), `_Walker.measure`
(one-shot), `_Walker.tick` (frame) and `_Walker.missing` (sticking). Noise is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .pulse_series import ORDER, Motion, first_zero, reach, series, value
from .pulse_servo import Chip, Shaft

Array = NDArray[np.float64]
Signal = Callable[[float], float]

REST_SPEED = 1e-6  # below it, after the impact, the shaft rests on its stop
MAX_PIECES = 200_000


@dataclass(frozen=True)
class Decision:
    """What one frame says: from `at` on, drive with `sign` for `length` seconds."""

    at: float
    sign: int
    length: float
    error: float


@dataclass(frozen=True)
class Piece:
    """One logged piece: from (t, q, w) to (t_end, q_end, w_end) with one direction (0 at rest) and drive."""

    t: float
    q: float
    w: float
    t_end: float
    q_end: float
    w_end: float
    direction: int
    drive: int


@dataclass(frozen=True, kw_only=True)
class PulseRun:
    """Arrays at the asked times, each the value just after what happens there; events; the sensitive margins."""

    q: Array
    w: Array
    drive: NDArray[np.int64]
    error: Array
    events: tuple[tuple[float, str], ...]
    pieces: tuple[Piece, ...]
    frames: tuple[tuple[float, float, float], ...]  # (t_k, t_in, T_os) of the valid ones
    margin: float  # smallest ||e| − w/2| of all frames

    def near_event(self, times: Array, distance: float = 1e-7) -> NDArray[np.bool_]:
        """Whether a time is so near to an event that rounding decides on which side it lies."""
        at = np.array(sorted({t for t, _ in self.events}))
        if not at.size:
            return np.zeros(times.shape, dtype=bool)
        n = np.clip(np.searchsorted(at, times), 1, max(at.size - 1, 1))
        nearest = np.minimum(np.abs(times - at[np.minimum(n, at.size - 1)]), np.abs(times - at[n - 1]))
        return np.asarray(nearest < distance)


@dataclass
class _Walker:
    """State of one run; `direction` is 0 at rest, `zone` the sign of the current while the shaft moves."""

    shaft: Shaft
    chip: Chip
    command: Signal
    edges: Sequence[float] | None
    end: float
    times: Array
    q: float
    w: float
    order: int
    max_step: float
    shifts: Callable[[int], float]
    t: float = 0.0
    direction: int = 0
    zone: int = 0
    drive: int = 0
    drive_end: float = math.inf
    clock: float = -math.inf
    frame: int = 0
    knot: int = 0
    error: float = 0.0
    margin: float = math.inf
    done: int = 0
    pending: list[Decision] = field(default_factory=list)
    out: list[tuple[float, float, int, float]] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)
    pieces: list[Piece] = field(default_factory=list)
    frames: list[tuple[float, float, float]] = field(default_factory=list)

    # --- frame -----------------------------------------------------------------------------------------------------

    def next_edge(self) -> float:
        if self.edges is None:
            return self.frame * self.chip.period
        return self.edges[self.frame] if self.frame < len(self.edges) else math.inf

    def next_knot(self) -> float:
        return self.shaft.knots[self.knot] if self.knot < len(self.shaft.knots) else math.inf

    def horizon(self) -> float:
        """The next instant at which something is due, whatever the shaft does."""
        decision = self.pending[0].at if self.pending else math.inf
        off = min(self.drive_end, self.clock) if self.drive else math.inf
        return min(self.end, decision, off, self.next_edge(), self.next_knot())

    def tick(self) -> None:
        """What is due now: the end of the drive, then decisions, then the measurement of an edge."""
        was = self.drive
        if self.drive and self.t >= min(self.drive_end, self.clock):
            self.drive = 0
            self.note("drive_end")
        while self.pending and self.pending[0].at <= self.t:
            decision = self.pending.pop(0)
            self.error, self.drive_end = decision.error, decision.at + decision.length
            runs = decision.length > 0.0 and decision.at < self.clock
            self.drive = decision.sign if runs else 0
            self.note("decision")
        while self.next_knot() <= self.t:
            self.knot += 1
        while self.next_edge() <= self.t:
            self.measure(self.next_edge())
            self.frame += 1
        if was != self.drive:
            self.change_bridge()

    def measure(self, edge: float) -> None:
        """One-shot against command; a pulse outside the accepted widths decides nothing and restarts no clock."""
        chip, t_in = self.chip, self.command(edge)
        self.note("edge")
        if not chip.shortest <= t_in <= chip.longest:
            return
        self.clock = edge + chip.timeout
        sag = self.shaft.bus(self.drive, self.w) - self.shaft.V_oc
        v = chip.p * self.q + chip.b_o + chip.beta * self.shaft.terminal(self.drive, self.w) + chip.c_s * sag
        T_os = max(0.0, chip.T_0 + chip.slope * v) + self.shifts(self.frame)
        e = t_in - T_os
        u = abs(e) - 0.5 * chip.deadband
        self.margin = min(self.margin, abs(u))
        new = Decision(edge + max(t_in, T_os), (e > 0) - (e < 0), chip.drive_time(u), e)
        # Each drive ends at the next frame's decision: one that would come after it never drives.
        self.pending = [old for old in self.pending if old.at < new.at] + [new]
        self.frames.append((edge, t_in, T_os))

    def note(self, kind: str) -> None:
        self.events.append((self.t, kind))

    # --- at rest ---------------------------------------------------------------------------------------------------

    def missing(self) -> list[tuple[int, float]]:
        """(direction, torque missing to a start that way) for each direction that no stop blocks."""
        S = self.shaft
        torque = S.K * S.current(self.drive, 0.0) - S.external(self.t, self.q)
        out: list[tuple[int, float]] = []
        if self.q < S.upper:
            out.append((1, S.breakaway * S.forward + S.coulomb - torque))
        if self.q > S.lower:
            out.append((-1, S.breakaway * S.backward + S.coulomb + torque))
        return out

    def released(self) -> int:
        """0 if the shaft stays at rest now, else the direction in which it starts."""
        return next((d for d, lack in self.missing() if lack < 0.0), 0)

    def rest(self, until: float) -> None:
        """Only a torque that changes with time can release the shaft before something else happens."""
        slope, best, way = self.shaft.torque_slope(self.t), until, 0
        for d, lack in self.missing():
            fall = -d * slope  # growth of the torque that pushes in direction d
            if fall > 0.0 and self.t + lack / fall < best:
                best, way = self.t + lack / fall, d
        start = (self.t, self.q, 0.0)
        self.record_until(best, lambda x: (self.q, 0.0))
        self.t = best
        self.pieces.append(Piece(*start, self.t, self.q, 0.0, 0, self.drive))
        if way:
            self.start(way)

    def start(self, direction: int) -> None:
        self.direction = direction
        self.note("release")
        self.pick_zone()

    # --- in motion -------------------------------------------------------------------------------------------------

    def levels(self) -> tuple[float, float]:
        """Speeds below and above which current flows, forward and backward; equal where nothing is lost."""
        source, lost, _ = self.shaft.bridge(self.drive)
        return (source - lost) / self.shaft.K_b, (source + lost) / self.shaft.K_b

    def motion(self, zone: int) -> Motion:
        """Right side with the current's sign as given (0: none; 2: either, for nothing is lost)."""
        S = self.shaft
        source, lost, R = S.bridge(self.drive)
        flow, feedback = (0.0, 0.0) if zone == 0 else (S.K * source / R, S.K * S.K_b / R)
        if abs(zone) == 1:
            flow -= zone * S.K * lost / R
        dry = self.direction * ((S.forward if self.direction > 0 else S.backward) + S.coulomb)
        return Motion(
            constant=(flow - dry - S.torque(self.t)) / S.J, slope=S.torque_slope(self.t) / S.J,
            drag=(feedback + S.B) / S.J, stiffness=S.stiffness / S.J, rest=S.rest, gravity=S.gravity / S.J,
            hanging=S.hanging,
        )

    def pick_zone(self) -> None:
        """Zone of the current; on the very edge the acceleration, the same on both sides, says where the speed goes."""
        low, high = self.levels()
        if low == high:
            self.zone = 2
            return
        self.zone = 1 if self.w < low else -1 if self.w > high else 0
        if self.w in (low, high):
            _, W = series(self.motion(0), self.q, self.w, order=3)
            tendency = next((a for a in W[1:] if abs(a) > 1e-10), 0.0)
            self.zone = 1 if self.w == low and tendency < 0.0 else -1 if self.w == high and tendency > 0.0 else 0

    def guards(self, Q: list[float], W: list[float]) -> list[tuple[str, list[float]]]:
        """Polynomials that are positive inside the piece."""
        d, S = self.direction, self.shaft
        out = [("speed", [d * a for a in W])]
        if d > 0 and math.isfinite(S.upper):
            out.append(("stop", [S.upper - self.q, *(-a for a in Q[1:])]))
        if d < 0 and math.isfinite(S.lower):
            out.append(("stop", [self.q - S.lower, *Q[1:]]))
        low, high = self.levels()
        if self.zone in (0, -1):
            level = low if self.zone == 0 else high
            out.append(("fall", [self.w - level, *W[1:]]))
        if self.zone in (0, 1):
            level = high if self.zone == 0 else low
            out.append(("rise", [level - self.w, *(-a for a in W[1:])]))
        return out

    def slide(self, until: float) -> None:
        """One step of the series: up to its reach, an event of the shaft, or what is due."""
        m = self.motion(self.zone)
        Q, W = series(m, self.q, self.w, self.order)
        h = min(reach(Q, W, m.drag), self.max_step)
        last = self.t + h >= until
        h = until - self.t if last else h
        name, x = "", h
        for guard, a in self.guards(Q, W):
            zero = first_zero(a, h)
            if zero < x or (zero == x and guard == "stop"):
                name, x = guard, zero
        stop = until if last and not name else self.t + x
        start = (self.t, self.q, self.w)
        self.record_until(stop, lambda t: (value(Q, t - start[0]), value(W, t - start[0])))
        self.t, self.q, self.w = stop, value(Q, x), value(W, x)
        direction = self.direction
        if name:
            self.change(name)
        self.pieces.append(Piece(*start, self.t, value(Q, x), value(W, x), direction, self.drive))

    def change(self, name: str) -> None:
        if name == "stop":
            self.hit()
        elif name == "speed":
            before, self.w = self.direction, 0.0
            self.direction = self.released()
            self.note("reversal" if self.direction == -before else "stick" if self.direction == 0 else "touch")
            if self.direction:
                self.pick_zone()
        else:
            low, high = self.levels()
            self.w = low if (name == "fall") == (self.zone == 0) else high
            self.zone += -1 if name == "rise" else 1
            self.note("current")

    def hit(self) -> None:
        """Speed times −restitution; below REST_SPEED the shaft rests, unless it is pushed away from the stop."""
        self.q = self.shaft.upper if self.direction > 0 else self.shaft.lower
        self.w *= -self.shaft.restitution
        self.note("stop")
        if abs(self.w) >= REST_SPEED:
            self.direction = -self.direction
            self.pick_zone()
            return
        self.w, self.direction = 0.0, 0
        leaving = self.released()
        if leaving:
            self.start(leaving)

    def change_bridge(self) -> None:
        if self.direction:
            self.pick_zone()

    # --- run -------------------------------------------------------------------------------------------------------

    def record_until(self, until: float, state: Callable[[float], tuple[float, float]]) -> None:
        while self.done < self.times.size and self.times[self.done] < until:
            self.out.append((*state(float(self.times[self.done])), self.drive, self.error))
            self.done += 1

    def run(self) -> None:
        self.direction = (self.w > 0) - (self.w < 0)
        while True:
            self.tick()
            if not self.direction and (way := self.released()):
                self.start(way)
            elif self.direction and self.t == 0.0:
                self.pick_zone()
            if self.t >= self.end:
                break
            until = self.horizon()
            while self.t < until:
                if self.direction:
                    self.slide(until)
                else:
                    self.rest(until)
                if len(self.pieces) > MAX_PIECES:
                    raise RuntimeError(f"more than {MAX_PIECES} pieces by t = {self.t}")
        self.record_until(math.inf, lambda t: (self.q, self.w))


def solve_pulse(
    shaft: Shaft, chip: Chip, command: Signal, t_end: float, times: Sequence[float] | Array, *,
    edges: Sequence[float] | None = None, start: float | None = None, y0: tuple[float | None, float] = (None, 0.0),
    order: int = ORDER, max_step: float = math.inf, shifts: Callable[[int], float] = lambda frame: 0.0,
) -> PulseRun:
    """Run the servo.

    `command` is the pulse width over time; `edges` the rising edges where the command has its own; `start` the pulse
    width just before t = 0, whose zero-error angle is the start unless y0 names an angle. `shifts` moves the one-shot
    of a frame: a measure of how sensitive the run is.
    """
    q = y0[0] if y0[0] is not None else chip.zero_error_angle(command(0.0) if start is None else start)
    if not shaft.lower <= q <= shaft.upper:
        raise ValueError(f"start angle {q} lies outside the stops {shaft.lower}, {shaft.upper}")
    kept = None if edges is None else [t for t in edges if t >= 0.0]
    asked = np.asarray(times, dtype=float)
    walker = _Walker(shaft, chip, command, kept, t_end, asked, q, y0[1], order, max_step, shifts)
    walker.run()
    q_w_s_e = walker.out
    return PulseRun(
        q=np.array([x[0] for x in q_w_s_e]), w=np.array([x[1] for x in q_w_s_e]),
        drive=np.array([x[2] for x in q_w_s_e], dtype=np.int64), error=np.array([x[3] for x in q_w_s_e]),
        events=tuple(walker.events), pieces=tuple(walker.pieces), frames=tuple(walker.frames), margin=walker.margin,
    )
