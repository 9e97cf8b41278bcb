"""The engine: from event to event, exactly where the mode is linear, with error control where it is not.

It drives the kernels and keeps what they leave behind: states to go on from, segments of motion, and events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from servotwin.errors import SimulationError
from servotwin.models.base import Place
from servotwin.models.engine import guards, motion
from servotwin.models.engine.memory import (
    ACCURACY,
    Inputs,
    Memory,
    counted_anew,
    due,
    instant,
    origin_of,
    resumed,
    time_of,
)
from servotwin.models.engine.modes import (
    CONDUCTING,
    CORE,
    LIMITED_BACKWARD,
    LIMITED_FORWARD,
    NO_CURRENT,
    Mode,
    at_rest,
)
from servotwin.models.engine.motion import Motion
from servotwin.models.engine.step import COMPLETED, MOST_IDLE, pulse_width, step
from servotwin.models.terms import frame
from servotwin.models.terms.bridge import heeds_silence
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.frame import Frame
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Pieces
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
    numbers : Numbers
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
    external_torque : float
        Constant, beside the load's [N m].
    accuracy : float
        Of what is integrated [rad].
    """

    numbers: Numbers
    command: Pieces
    torque: Pieces
    chip: Chip = NO_CHIP
    edges: tuple[float, ...] | None = None
    seed: int = 0
    curve: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    external_torque: float = 0.0
    accuracy: float = ACCURACY

    @property
    def pulsed(self) -> bool:
        """Whether the command comes in pulses."""
        return self.chip.frame_period > 0.0

    @cached_property
    def refuses(self) -> bool:
        """Whether some pulse may be shorter or longer than the chip takes."""
        shortest, longest = self.command.extremes
        return not (self.chip.shortest <= shortest and longest <= self.chip.longest)

    @cached_property
    def heeds_silence(self) -> bool:
        """Whether its bridge is off in another way while no pulses come."""
        return heeds_silence(self.numbers.bridge)

    @cached_property
    def inputs(self) -> Inputs:
        """What the servo is told, as a step reads it."""
        period = self.chip.frame_period if self.edges is None else 0.0
        return Inputs(self.command.table, self.torque.table, self.external_torque, period, self.edges or (),
                      self.curve, self.seed, self.accuracy)


@dataclass(frozen=True)
class State:
    """Everything that a servo remembers; picklable, comparable, and enough to go on from.

    Parameters
    ----------
    time : float
        [s]
    places : tuple of Place
        Which signals are states, and where the engine keeps them.
    memory : Memory
        All numbers of the state, its clock, and what the chip of a pulse servo has decided.
    numbers : Numbers
        The numbers of servo and load by which it moves since its motion began.
    changes : tuple
        (name, value) of the numbers that are others than the simulator's.
    """

    time: float
    places: tuple[Place, ...]
    memory: Memory
    numbers: Numbers | None = None
    changes: tuple[tuple[str, object], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Signal names of `values`."""
        return tuple(place.name for place in self.places)

    @property
    def values(self) -> tuple[float, ...]:
        """Angle [rad], speed [rad/s] and what else the servo remembers (SI)."""
        return tuple(place.factor * self.memory.point.y[place.at] for place in self.places)

    def __getitem__(self, name: str) -> float:
        """Return one value by its signal name."""
        for place in self.places:
            if place.name == name:
                return place.factor * self.memory.point.y[place.at]
        raise KeyError(f"{name!r} is no state; there are: {', '.join(self.names)}")


class Segment(NamedTuple):
    """A stretch of one motion between two times [s], and what holds with it.

    `error` is the latest that the chip has decided on [s], `wiper` the angle of the potentiometer at the start [rad],
    `drive` how a bridge drives: −1, 0 or +1, `silent` whether pulses stay away from it, 1 or 0, `origin` the instant
    from which the times of the motion count [s].
    """

    start: float
    end: float
    motion: Motion
    error: float
    wiper: float
    drive: float
    silent: int = 0
    origin: float = 0.0

    @property
    def anchor(self) -> float:
        """When the motion began [s]; it may be before the segment's start."""
        return self.origin + self.motion.t0


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
    numbers, chip, inputs = plan.numbers, plan.chip, plan.inputs
    memory = resumed(plan.pulsed, inputs, state.memory, numbers != state.numbers)
    end = instant(plan.pulsed, inputs, memory, until - origin_of(memory))
    m = motion.nothing(numbers, memory.u, memory.tau)
    idle = 0
    while memory.point.time < end:
        if due(memory):
            memory = counted_anew(memory)
            end = instant(plan.pulsed, inputs, memory, until - origin_of(memory))
        before = memory
        try:
            memory, m, event, status = step(numbers, chip, inputs, before, m, end)
        except ArithmeticError:  # numbers beyond what a float holds
            raise failure(Status.DIVERGED, time_of(before)) from None
        if status != COMPLETED:
            raise failure(Status.of_code(status), time_of(before))
        idle = idle + 1 if memory.point.time == before.point.time else 0
        if idle > MOST_IDLE:
            raise failure(Status.CHATTER, time_of(before))
        if record is not None:
            _keep(record, plan, before, memory, m, event)
    return State(until, state.places, memory, numbers, state.changes)


def failure(status: Status, time: float) -> SimulationError:
    """Return the error of a run that ended at `time` [s]."""
    return SimulationError(status.name, time, status.message)


def _keep(record: Record, plan: Plan, before: Memory, memory: Memory, m: Motion, event: int) -> None:
    """Add a step to a record: its chip's doings, its motion, its event."""
    origin, point, was = origin_of(memory), memory.point, before.point
    start, now, angle = origin + was.time, origin + point.time, was.y[0]
    if memory.chip is not before.chip:
        keep_switch(record, before.chip, memory.chip, start, angle, plan.heeds_silence)
        if (plan.refuses and memory.chip.number > before.chip.number
                and not frame.accepted(plan.chip, pulse_width(plan.inputs, before))):
            record.events.append(Event(start, "pulse refused", angle))
    if now > start or not record.segments:
        record.segments.append(Segment(start, now, m, memory.chip.error, was.wiper, memory.chip.drive,
                                       memory.chip.silent, origin))
    if record.tell is not None:
        record.tell(now)
    if event >= 0 and event not in guards.KINKS:
        record.events.append(Event(now, event_name(event, point.mode), point.y[0]))


def keep_switch(record: Record, before: Frame, after: Frame, time: float, angle: float, heeds: bool) -> None:
    """Add to a record that the bridge has switched at `time` [s], where the shaft is at `angle` [rad]."""
    if after.drive != before.drive:
        record.events.append(Event(time, _DRIVES[int(after.drive)], angle))
    if heeds and after.silent != before.silent:
        record.events.append(Event(time, "silence begins" if after.silent else "silence ends", angle))


_DRIVES = {1: "drive forward", -1: "drive backward", 0: "drive ends"}


def event_name(kind: int, after: Mode) -> str:
    """Return what to call an event after which this mode holds."""
    if kind == guards.SPEED and at_rest(after.contact):
        return "stick"
    if kind == guards.SPEED and after.contact != CORE:
        return "reversal"
    if after.zone >= CONDUCTING and kind in (guards.ZONE_UP, guards.ZONE_DOWN):
        if after.zone in (LIMITED_BACKWARD, LIMITED_FORWARD):
            return "current limited"
        return "current stops" if after.zone == NO_CURRENT else "current starts"
    return guards.EVENT_NAMES[kind]
