"""The engine: from event to event, exactly where the mode is linear, with error control where it is not.

It drives the kernels and keeps what they leave behind: states to go on from, segments of motion, and events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from servotwin.errors import SimulationError
from servotwin.models.base import Place
from servotwin.models.kernels import frame, hybrid, walk
from servotwin.models.kernels.frame import Chip, Frame
from servotwin.models.kernels.motion import IMPOSSIBLE, Motion, is_step
from servotwin.models.kernels.plant import (
    CONDUCTING,
    CORE,
    LIMITED_BACKWARD,
    LIMITED_FORWARD,
    NO_CURRENT,
    Mode,
    Plant,
    at_rest,
)
from servotwin.models.kernels.walk import MOST_IDLE, Point
from servotwin.physics.pieces import Piece, Pieces, piece_value
from servotwin.simulation.status import Status


class Event(NamedTuple):
    """Something that happened: time [s], kind, and the output angle [rad] there."""

    time: float
    kind: str
    value: float


@dataclass(frozen=True)
class Plan:
    """What stays the same during a run.

    Parameters
    ----------
    plant : Plant
        The numbers of servo and load.
    command : Pieces
        What the plant follows [V]; of a pulse servo the width of the pulses [s].
    torque : Pieces
        The external torque that depends on time alone [N m].
    chip : Chip, optional
        The numbers of the frame logic, for a pulse servo.
    edges : tuple of float, optional
        When its frames start [s]; None: regularly.
    seed : int
        Of its noise.
    curve : tuple
        Angles [rad] and errors [V] of its potentiometer's linearity table.
    """

    plant: Plant
    command: Pieces
    torque: Pieces
    chip: Chip | None = None
    edges: tuple[float, ...] | None = None
    seed: int = 0
    curve: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())

    @property
    def period(self) -> float:
        """Of regular frames [s]; 0 where the edges are listed."""
        return self.chip.frame_period if self.chip is not None and self.edges is None else 0.0


@dataclass(frozen=True)
class State:
    """Everything that a servo remembers; picklable, comparable, and enough to go on from.

    Parameters
    ----------
    time : float
        [s]
    places : tuple of Place
        Which signals are states, and where the engine keeps them.
    point : Point
        All numbers of the state; mode of the present motion, where it began, and the step to try next.
    inputs : tuple of Piece
        The pieces of voltage and external torque in force since then.
    plant : Plant
        The numbers of servo and load by which it moves since then.
    frame : Frame
        What the chip of a pulse servo remembers: its drive and when that ends, what it has decided, its clock.
    """

    time: float
    places: tuple[Place, ...]
    point: Point
    inputs: tuple[Piece, Piece] | None = None
    plant: Plant | None = None
    frame: Frame = frame.AT_START

    @property
    def names(self) -> tuple[str, ...]:
        """Signal names of `values`."""
        return tuple(place.name for place in self.places)

    @property
    def values(self) -> tuple[float, ...]:
        """Angle [rad], speed [rad/s] and what else the servo remembers (SI)."""
        return tuple(place.factor * self.point.y[place.at] for place in self.places)

    def __getitem__(self, name: str) -> float:
        """Return one value by its signal name."""
        for place in self.places:
            if place.name == name:
                return place.factor * self.point.y[place.at]
        raise KeyError(f"{name!r} is no state; there are: {', '.join(self.names)}")


@dataclass(frozen=True)
class Segment:
    """A stretch of one motion between two times [s], and what holds with it.

    `error` is the latest that the chip has decided on [s], `wiper` the angle of the potentiometer at the start [rad],
    `drive` how a bridge drives: −1, 0 or +1.
    """

    start: float
    end: float
    motion: Motion
    error: float
    wiper: float
    drive: float

    @property
    def anchor(self) -> float:
        """When the motion began [s]; it may be before the segment's start."""
        return self.motion.t0


@dataclass
class Record:
    """What a run leaves behind: segments in order, and events; who is told how far it is [s]."""

    segments: list[Segment]
    events: list[Event]
    tell: Callable[[float], object] | None = None


def run(plan: Plan, state: State, until: float, record: Record | None = None) -> State:
    """Return the state at `until` [s], and add what happened to `record`.

    Raises
    ------
    SimulationError
        If the run cannot go on; it carries status, time and cause.
    """
    plant = plan.plant
    point = state.point
    inputs = state.inputs if plant == state.plant else None
    chip_frame = state.frame
    motion: Motion | None = None
    idle = 0
    while point.time < until:
        before = point.time
        try:
            if plan.chip is None:
                u, u_end = plan.command.at(before)
            else:
                chip_frame = _after_chip(plan, plan.chip, chip_frame, point, record)
                u = walk.source(plant, chip_frame)
                u_end = min(frame.next_switch(chip_frame),
                            frame.edge_time(plan.period, plan.edges or (), chip_frame.number))
            tau, tau_end = plan.torque.at(before)
            limit = min(u_end, tau_end)
            if (u, tau) != inputs:
                inputs, motion = (u, tau), None
                point = walk.anchored(plant, u, tau, before, point)
            if motion is None or is_step(motion):
                motion = walk.motion_of(plant, point, u, tau, limit)
            if motion.kind == IMPOSSIBLE:
                raise failure(Status.STEP_TOO_SMALL, before)
            wiper = point.wiper
            point, kind, status = walk.follow(motion, point, min(until, limit))
        except ArithmeticError:  # numbers beyond what a float holds
            raise failure(Status.DIVERGED, before) from None
        if status != walk.COMPLETED:
            raise failure(Status.of_code(status), before)
        idle = idle + 1 if point.time == before else 0
        if idle > MOST_IDLE:
            raise failure(Status.CHATTER, before)
        if record is not None:
            if point.time > before or not record.segments:
                record.segments.append(Segment(before, point.time, motion, chip_frame.error, wiper,
                                               chip_frame.drive))
            if record.tell is not None:
                record.tell(point.time)
            if kind >= 0:
                record.events.append(Event(point.time, event_name(kind, point.mode), point.y[0]))
        if kind >= 0:
            motion = None
    return State(time=point.time, places=state.places, point=point, inputs=inputs, plant=plant, frame=chip_frame)


def failure(status: Status, time: float) -> SimulationError:
    """Return the error of a run that ended at `time` [s]."""
    return SimulationError(status.name, time, status.message)


def _after_chip(plan: Plan, chip: Chip, now: Frame, point: Point, record: Record | None) -> Frame:
    """Return the frame state after all that the chip does at the time of a point."""
    time = point.time
    now = switched(now, time, point.y[0], record)
    if frame.edge_time(plan.period, plan.edges or (), now.number) <= time:
        t_in = piece_value(plan.command.at(time)[0], time)
        if record is not None and not frame.accepted(chip, t_in):
            record.events.append(Event(time, "pulse refused", point.y[0]))
        now = walk.measured(plan.plant, chip, plan.curve, now, point, t_in, plan.seed)
        if now.number == frame.CROWDED:
            raise failure(Status.CROWDED, time)
    return now


def switched(now: Frame, time: float, angle: float, record: Record | None) -> Frame:
    """Return the frame state after all that switches at `time` [s], where the shaft is at `angle` [rad]."""
    if frame.next_switch(now) > time:
        return now
    after = frame.switched(now, time)
    if record is not None and after.drive != now.drive:
        record.events.append(Event(time, _DRIVES[int(after.drive)], angle))
    return after


_DRIVES = {1: "drive forward", -1: "drive backward", 0: "drive ends"}


def event_name(kind: int, after: Mode) -> str:
    """Return what to call an event after which this mode holds."""
    if kind == hybrid.SPEED and at_rest(after.contact):
        return "stick"
    if kind == hybrid.SPEED and after.contact != CORE:
        return "reversal"
    if after.zone >= CONDUCTING and kind in (hybrid.ZONE_UP, hybrid.ZONE_DOWN):
        if after.zone in (LIMITED_BACKWARD, LIMITED_FORWARD):
            return "current limited"
        return "current stops" if after.zone == NO_CURRENT else "current starts"
    return hybrid.EVENT_NAMES[kind]
