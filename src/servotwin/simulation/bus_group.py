"""Servos whose motors are connected to one bus at the same time: their common motion, and what ends it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from servotwin.models.engine import guards, joint_motion, motion, shared_source
from servotwin.models.engine.memory import FIRST_STEP, Point
from servotwin.models.engine.modes import NO_CURRENT, Vector
from servotwin.models.engine.motion import Motion
from servotwin.models.engine.shared_source import Member
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import Piece, piece_rate, piece_value
from servotwin.simulation.engine import failure
from servotwin.simulation.status import Status

_BELOW = -1e-13  # rounding is not an event
_BELOW_OF_SUM = -1e-10  # A: nor what the currents of all have gathered
_HALVINGS = 200
_LOOKS = (0.25, 0.5, 0.75, 1.0)  # parts of a motion at which its guards are looked at
_JUMPS = (guards.UPPER, guards.LOWER, guards.MEET_FORWARD, guards.MEET_BACKWARD, guards.SPEED)  # signs may turn


class Connected(NamedTuple):
    """A servo on the bus: its numbers on a stiff source, where it stands, how its bridge drives, and its load."""

    numbers: Numbers
    point: Point
    drive: float
    tau: Piece


class Group:
    """The servos whose motors are connected to the bus.

    Parameters
    ----------
    source : Source

    Attributes
    ----------
    end : float
        When the common motion ends [s]; inf where there is none.
    """

    def __init__(self, source: Source) -> None:
        self.end = math.inf
        self._source = source
        self._state = shared_source.FOLLOWING
        self._voltage = source.V
        self._members: list[Member] = []
        self._points: list[Point] = []
        self._motions: list[Motion] = []
        self._ends: list[Vector] = []
        self._whose = (-1, -1)
        self._step = FIRST_STEP
        self._jumped = True

    def voltage_of(self, connected: Sequence[Connected]) -> float:
        """Return V_bus [V] under all their currents."""
        return self._zoned(connected)[2]

    def _zoned(self, connected: Sequence[Connected]) -> tuple[list[Member], int, float]:
        members = [shared_source.member_of(one.numbers, one.point.mode, one.drive, one.tau, one.point.y)
                   for one in connected]
        return shared_source.zoned(self._source, members, [one.point.y for one in connected], self._voltage)

    def begin(self, connected: Sequence[Connected], time: float, limit: float,
              same: bool) -> tuple[list[Point], list[Motion]]:
        """Begin a common motion at `time` [s] that ends at `limit` [s] at the latest; return points and motions.

        `same` members go on after an event of theirs that has already told zones and source.
        """
        states = [one.point.y for one in connected]
        if same and not self._jumped:
            self._members = [shared_source.member_of(one.numbers, one.point.mode, one.drive, one.tau, one.point.y)
                             for one in connected]
            self._voltage = shared_source.bus_voltage(self._source, self._state, self._members, states)
        else:
            members, self._state, self._voltage = self._zoned(connected)
            self._members = [self._settled(m, y, time) for m, y in zip(members, states, strict=True)]
        self._points = [Point(time, one.point.y, m.mode, time, one.point.y, one.point.step, one.point.wiper)
                        for one, m in zip(connected, self._members, strict=True)]
        if all(map(joint_motion.is_linear, self._members)):
            length = min(limit - time, joint_motion.longest_series(self._members))
            self._motions = self._by_series(states, time, length)
        else:
            length, self._motions = self._by_step(states, time, limit - time)
        self._find_end(time, length)
        return self._points, self._motions

    def _settled(self, member: Member, y: Vector, time: float) -> Member:
        mode = member.mode
        u = shared_source.behind(member, self._voltage)
        mode = guards.settled(member.numbers, mode.zone, u, piece_value(member.tau, time), y, mode.mesh, False)
        return Member(member.numbers, mode, member.sign, member.tau, member.returns)

    def _by_series(self, states: Sequence[Vector], time: float, length: float) -> list[Motion]:
        series = joint_motion.series(self._source, self._state, self._members, states, time, length)
        return [motion.by_series(m.numbers, m.mode, Piece(value=m.sign * self._voltage), m.tau, time, y, length,
                                 one.speed, one.current)
                for m, y, one in zip(self._members, states, series, strict=True)]

    def _by_step(self, states: Sequence[Vector], time: float, limit: float) -> tuple[float, list[Motion]]:
        tried = min(self._step, limit)
        length, following, dense, ends = joint_motion.joint_step(
            self._source, self._state, self._members, states, time, tried)
        if length == 0.0:
            raise failure(Status.STEP_TOO_SMALL, time)
        self._step = max(self._step, following) if length == limit else following
        return length, [
            motion.by_step(m.numbers, m.mode, Piece(value=m.sign * self._voltage), m.tau, time, y, length, vectors, end)
            for m, y, vectors, end in zip(self._members, states, dense, ends, strict=True)]

    # --- what ends it ----------------------------------------------------------------------------------------------

    def _find_end(self, time: float, length: float) -> None:
        """Find the first event of a member or of the source within `length` [s]."""
        first, whose = length, (-1, -1)
        ends = self._ends = [motion.state(m, length) for m in self._motions]
        for j, (member, m) in enumerate(zip(self._members, self._motions, strict=True)):
            if m.kind == motion.SERIES and joint_motion.is_calm(member, m, ends[j], length):
                continue
            for kind in self._kinds(member):
                s = self._crossing(j, kind, time, first)
                if s < first or (s == first and whose == (-1, -1)):
                    first, whose = s, (j, kind)
        if self._source.I_max < math.inf:
            for kind in range(2):
                s = self._crossing(-1, kind, time, first)
                if s < first:
                    first, whose = s, (-1, kind)
        self.end, self._whose = time + first, whose

    @staticmethod
    def _kinds(member: Member) -> list[int]:
        """Return which guards can end the mode of a member."""
        kinds = guards.guards(member.numbers, member.mode, member.sign, False)
        if member.returns and member.mode.zone == NO_CURRENT:  # its diodes block the other way
            kinds &= ~(1 << (guards.ZONE_UP if member.sign > 0.0 else guards.ZONE_DOWN))
        return [kind for kind in range(guards.KINDS) if kinds >> kind & 1]

    def _crossing(self, j: int, kind: int, time: float, length: float) -> float:
        """Return when a guard falls below zero, at most `length` [s]; inf where it does not."""
        a, f_a = 0.0, self._guard(j, kind, time, 0.0)
        below = _BELOW if j >= 0 else _BELOW_OF_SUM
        if f_a < below:  # what another member did has ended this mode too
            return 0.0
        for fraction in _LOOKS:
            b = fraction * length
            f_b = self._guard(j, kind, time, b)
            if f_b < below:
                break
        else:
            return math.inf
        if f_a <= 0.0:  # it starts at zero, to rounding: look whether it rises before it falls
            for k in range(1, 50):
                s = b * 0.5**k
                f_a = self._guard(j, kind, time, s)
                if f_a > 0.0:
                    a = s
                    break
            else:
                return 0.0
        for _ in range(_HALVINGS):
            if b - a <= 2e-16 * (time + b) or f_b == 0.0:
                break
            secant = b - f_b * (b - a) / (f_b - f_a)
            for s in (secant, 0.5 * (a + b)):
                if a < s < b:
                    f = self._guard(j, kind, time, s)
                    if f > 0.0:
                        a, f_a = s, f
                    else:
                        b, f_b = s, f
        return b

    def _guard(self, j: int, kind: int, time: float, s: float) -> float:
        states = [motion.state(m, s) for m in self._motions]
        V = shared_source.bus_voltage(self._source, self._state, self._members, states)
        if j < 0:
            total = shared_source.drawn(self._source, V, self._members, states)
            return shared_source.source_guards(self._source, self._state, V, total)[kind]
        member, t = self._members[j], time + s
        u = shared_source.behind(member, V)
        return guards.guard(member.numbers, member.mode, kind, u, 0.0, piece_value(member.tau, t),
                            piece_rate(member.tau, t), states[j], states[j])[0]

    def arrivals(self) -> list[tuple[Point, int]]:
        """Return where all members stand when the common motion ends, and whose event it was."""
        time, (whose, kind) = self.end, self._whose
        found: list[tuple[Point, int]] = []
        self._jumped = whose >= 0 and kind in _JUMPS
        if whose == -1 and kind >= 0:
            self._state = shared_source.after(self._state, kind)
        states = self._ends if kind < 0 else [motion.state(m, time - m.t0) for m in self._motions]
        V = shared_source.bus_voltage(self._source, self._state, self._members, states)
        for j, (member, point, y) in enumerate(zip(self._members, self._points, states, strict=True)):
            mode, event = point.mode, -1
            wiper = wiper_at(member.numbers.sensor, point.wiper, y[0])
            if j == whose:
                mode, y = guards.cross(member.numbers, mode, kind, shared_source.behind(member, V),
                                       piece_value(member.tau, time), y)
                mode = mode._replace(zone=shared_source.let_through(member, mode.zone))
                event = kind
            found.append((Point(time, y, mode, time, y, point.step, wiper), event))
        self._voltage = V
        return found
