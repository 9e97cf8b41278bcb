"""Several servos on one source, from event to event of all of them in one queue.

As long as at most one motor is connected to the bus every servo moves on its own, by the laws of one alone. Where
several are, they form a group that moves together until one of them, its chip or the source does something else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from servotwin.models.engine import currents, motion, shared_source, step
from servotwin.models.engine.memory import Point
from servotwin.models.engine.modes import Vector
from servotwin.models.engine.motion import Motion
from servotwin.models.engine.step import MOST_IDLE
from servotwin.models.terms import frame
from servotwin.models.terms.bridge import coasts, heeds_silence, terminal_voltage
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.frame import Frame
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import warm
from servotwin.models.terms.sensor import sensed_voltage, wiper_at
from servotwin.physics.pieces import Piece, piece_value
from servotwin.simulation.bus_group import Connected, Group
from servotwin.simulation.engine import Event, Plan, Record, Segment, event_name, failure, keep_switch
from servotwin.simulation.status import Status

Told = tuple[float, bool, Piece]  # drive, silence and torque


@dataclass
class Unit:
    """A servo on the bus: what it is told, where it stands, and what it does next when left alone."""

    plan: Plan
    chip: Chip
    point: Point
    record: Record = field(default_factory=lambda: Record([], []))
    frame: Frame = frame.AT_START
    tau: Piece = field(default_factory=Piece)
    tau_end: float = -math.inf
    inputs: Told | None = None  # of the present motion
    motion: Motion | None = None
    arrival: tuple[Point, int] | None = None  # when left alone: its next point, and the event there (−1: none)

    switch: float = -math.inf  # when drive or load change next, as far as is known [s]
    limit: float = -math.inf  # when its chip or its load do something next [s]

    def __post_init__(self) -> None:
        self.heeds_silence = heeds_silence(self.plan.numbers.bridge)
        self._listen()

    def _listen(self) -> None:
        """Take the numbers as they are with pulses or without: alone, and on a given bus voltage."""
        self.numbers = step.at_pulses(self.plan.numbers, self.frame.silent) if self.heeds_silence else self.plan.numbers
        self.stiff = {returning: shared_source.on_stiff_source(self.numbers, returning) for returning in (False, True)}

    def hear(self, now: Frame, time: float) -> None:
        """Take another state of the chip, from `time` [s] on."""
        before, self.frame = self.frame, now
        keep_switch(self.record, before, now, time, self.point.y[0], self.heeds_silence)
        if self.heeds_silence and now.silent != before.silent:
            self._listen()

    def plan_ahead(self) -> None:
        """Find out when chip and load do something next."""
        self.switch = min(frame.next_switch(self.frame, self.heeds_silence), self.tau_end)
        self.limit = min(self.switch, self.edge)

    @property
    def edge(self) -> float:
        """When its next frame begins [s]."""
        return frame.edge_time(self.plan.inputs.period, self.plan.inputs.edges, self.frame.number)

    @property
    def connected(self) -> bool:
        """Whether the motor is connected to the bus, or may become so by itself."""
        y = self.point.y
        return self.frame.drive != 0.0 or (coasts(self.numbers.bridge) and (y[2] != 0.0 or y[6] != 0.0))

    def at(self, time: float) -> Point:
        """Return where it stands at `time` [s], on its present motion."""
        if self.motion is None or time <= self.point.time:
            return self.point
        self.motion = motion.prepared(self.motion)
        y = motion.state(self.motion, time - self.motion.t0)
        wiper = wiper_at(self.plan.numbers.sensor, self.point.wiper, y[0])
        _, _, mode, anchor_time, anchor, step, _ = self.point
        return Point(time, y, mode, anchor_time, anchor, step, wiper)

    def move(self, point: Point, kind: int = -1) -> None:
        """Go on the present motion to a point, where an event may be."""
        if self.motion is not None and point.time > self.point.time:
            self.record.segments.append(
                Segment(self.point.time, point.time, self.motion, self.frame.error, self.point.wiper, self.frame.drive,
                        self.frame.silent))
        if kind >= 0:
            self.record.events.append(Event(point.time, event_name(kind, point.mode), point.y[0]))
            self.motion = None
        self.point, self.arrival = point, None

    def told(self) -> Told:
        """Return by what its motion is determined besides its state."""
        return self.frame.drive, self.heeds_silence and self.frame.silent > 0, self.tau

    def alone(self, until: float) -> None:
        """Find out what it does next when no other motor is connected to the bus."""
        numbers, time = self.numbers, self.point.time
        new, self.inputs = self.told() != self.inputs, self.told()
        u = step.source(numbers, self.frame)
        m = motion.nothing(numbers, u, self.tau) if self.motion is None else self.motion
        if new:
            self.point = step.anchored(numbers, u, self.tau, time, self.point)
        point, self.motion, kind, status = step.onward(numbers, self.point, u, self.tau, m, new, self.limit,
                                                        until, self.plan.accuracy)
        if status != step.COMPLETED:
            raise failure(Status.of_code(status), time)
        self.arrival = (point, kind)


class Bus:
    """Units on one source, and what they do together."""

    def __init__(self, units: Sequence[Unit], group: Group) -> None:
        self.units = list(units)
        self._group = group
        self._in_group: list[Unit] = []
        self._before: list[tuple[int, object]] = []  # the group that has just ended by an event of its own

    def run(self, until: float) -> None:
        """Run all servos from t = 0 to `until` [s].

        Raises
        ------
        SimulationError
            If the run cannot go on.
        """
        time, idle = 0.0, 0
        while time < until:
            self._act(time)
            self._go_on(time, until)
            following = min(self._group.end, until)
            for unit in self.units:
                following = min(following, unit.arrival[0].time if unit.arrival is not None else unit.limit)
            idle = idle + 1 if following == time else 0
            if idle > MOST_IDLE * len(self.units):
                raise failure(Status.CHATTER, time)
            time = following
            for unit in self.units:
                if unit.arrival is not None and unit.arrival[0].time <= time:
                    unit.move(*unit.arrival)
            if self._group.end <= time:
                for unit, (point, kind) in zip(self._in_group, self._group.arrivals(), strict=True):
                    if step.status_of(point.y) != step.COMPLETED:
                        raise failure(Status.DIVERGED, time)
                    unit.move(point, kind)
                self._before = [(id(unit), unit.inputs) for unit in self._in_group]
                self._leave()
        for unit in self.units:
            unit.move(unit.at(until))

    def _leave(self) -> None:
        """Let the members of the group stand where they are, without a motion."""
        for unit in self._in_group:
            unit.motion, unit.inputs = None, None
        self._in_group = []
        self._group.end = math.inf

    def _act(self, time: float) -> None:
        """Do what chips and loads do at `time` [s]: first switch, then measure."""
        due = [unit for unit in self.units if unit.limit <= time]
        for unit in due:
            if unit.switch <= time:
                unit.move(unit.at(time))
                unit.hear(frame.switched(unit.frame, time), time)
                if unit.tau_end <= time:
                    unit.tau, unit.tau_end = unit.plan.torque.at(time)
                unit.plan_ahead()
        for unit in due:
            if unit.edge <= time:
                self._measure(unit, time)
                unit.plan_ahead()

    def _measure(self, unit: Unit, time: float) -> None:
        plan, chip, here = unit.plan, unit.chip, unit.at(time)
        t_in = piece_value(plan.command.at(time)[0], time)
        if not frame.accepted(chip, t_in):
            unit.record.events.append(Event(time, "pulse refused", here.y[0]))
        v_m, V_bus = self._voltages(unit, here.y, time)
        v_o = sensed_voltage(plan.numbers.sensor, plan.curve, here.wiper)
        now = frame.edge(chip, unit.frame, time, t_in, v_o, v_m, V_bus, plan.seed)
        if unit.heeds_silence and now.silent != unit.frame.silent:
            unit.move(here)
        unit.hear(now, time)
        if unit.frame.number == frame.CROWDED:
            raise failure(Status.CROWDED, time)

    def _voltages(self, unit: Unit, y: Vector, time: float) -> tuple[float, float]:
        """Return the voltages at the unit's motor and of the bus [V]."""
        numbers, drive = unit.numbers, unit.frame.drive
        connected = [other for other in self.units if other.connected]
        if not [other for other in connected if other is not unit]:
            return step.voltages(numbers, drive * numbers.source.V, y)
        if len(connected) == 1:
            other = connected[0]
            u = other.frame.drive * other.numbers.source.V
            V_bus = step.voltages(other.numbers, u, other.at(time).y)[1]
        else:
            V_bus = self._group.voltage_of([_connection(other, time) for other in connected])
        stiff = warm(unit.stiff[False], y)
        u = drive * V_bus
        zone = currents.zone_of(stiff, u, 0.0, y[0], y[6], y[2])
        i = y[2] if inductive(stiff.motor) else currents.current(stiff, zone, u, y[0], y[6])
        return terminal_voltage(stiff.bridge, stiff.source, stiff.motor, u, y[6], i, V_bus), V_bus

    def _go_on(self, time: float, until: float) -> None:
        """Take up motions where there are none, or no longer the right ones."""
        connected = [unit for unit in self.units if unit.connected]
        members = connected if len(connected) > 1 else []
        kept = [*map(id, members)] == [*map(id, self._in_group)] and all(
            unit.inputs == unit.told() for unit in members)
        if not kept:
            for unit in (*self._in_group, *members):
                unit.move(unit.at(time))
            self._leave()
            if members:
                self._in_group = members
                switch = min(unit.switch for unit in members)
                same = [(id(unit), unit.told()) for unit in members] == self._before
                points, motions = self._group.begin(
                    [_connection(unit, time) for unit in members], time, min(switch, until), same)
                for unit, point, m in zip(members, points, motions, strict=True):
                    unit.point, unit.motion, unit.arrival = point, m, None
                    unit.inputs = unit.told()
        self._before = []
        for unit in self.units:
            if unit.arrival is None and unit not in members:
                unit.alone(until)


def _connection(unit: Unit, time: float) -> Connected:
    """Return how a unit is connected to the bus."""
    return Connected(unit.stiff[unit.frame.drive == 0.0], unit.at(time), unit.frame.drive, unit.tau)
