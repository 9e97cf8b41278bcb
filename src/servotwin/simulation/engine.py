"""The engine: from event to event, exactly where the mode is linear, with error control where it is not.

It drives the kernels and keeps what they leave behind: states to go on from, segments of motion, and events.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from servotwin.errors import SimulationError
from servotwin.models.base import Place
from servotwin.models.engine import controller
from servotwin.models.engine.events import kinds
from servotwin.models.engine.legs.legs import MOST_SHORT
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
from servotwin.models.engine.motions import motion
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.engine.runs import calmed, is_short
from servotwin.models.engine.step import COMPLETED, MOST_IDLE, pulse_width, step
from servotwin.models.state.modes import Mode
from servotwin.models.terms import control, duty, firmware, frame
from servotwin.models.terms.bridge import heeds_silence
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
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
        Rows of angle [rad] and error [V] of its potentiometer's linearity table.
    external_torque : float
        Constant, beside the load's [N m].
    accuracy : float
        Of what is integrated [rad].
    firmware : Firmware, optional
        The numbers of its program, for a digital servo.
    """

    numbers: Numbers
    command: Pieces
    torque: Pieces
    chip: Chip = NO_CHIP
    edges: tuple[float, ...] | None = None
    seed: int = 0
    curve: tuple[tuple[float, float], ...] = ()
    external_torque: float = 0.0
    accuracy: float = ACCURACY
    firmware: Firmware = NO_FIRMWARE

    @property
    def digital(self) -> bool:
        """Whether a program decides on the drive."""
        return firmware.present(self.firmware)

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
        period = (self.firmware.T_f if self.digital else self.chip.frame_period) if self.edges is None else 0.0
        return Inputs(self.command.table, self.torque.table, self.external_torque, period, self.edges or (),
                      self.curve, self.seed, self.accuracy, (self.firmware,))


@dataclass(frozen=True, repr=False)
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

    def __repr__(self) -> str:
        values = (f"{name}={value:.6g}" for name, value in zip(self.names, self.values, strict=True))
        return f"State(time={self.time:g}, {', '.join(values)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Signal names of `values`."""
        return tuple(place.name for place in self.places)

    @property
    def values(self) -> tuple[float, ...]:
        """Angle [rad], speed [rad/s] and what else the servo remembers (SI)."""
        return tuple(place.factor * getattr(self.memory.point.y, place.at) for place in self.places)

    def __getitem__(self, name: str) -> float:
        """Return one value by its signal name."""
        for place in self.places:
            if place.name == name:
                value: float = place.factor * getattr(self.memory.point.y, place.at)
                return value
        raise KeyError(f"{name!r} is no state; there are: {', '.join(self.names)}; signals that follow from these: "
                       "Simulator.observe(state, name, command)")


class Segment(NamedTuple):
    """A stretch of one motion between two times [s], and what holds with it.

    `error` is the latest that the chip has decided on [s], `wiper` the angle of the potentiometer at the start [rad],
    `drive` how a bridge drives: −1, 0 or +1, `silent` whether pulses stay away from it, 1 or 0, `origin` the instant
    from which the times of the motion count [s]. Of a digital servo `duty` is
    that of its bridge, or `terms.duty.OPEN`, `BRAKED`; `goal` and `reference` are angles [rad], `trip` tells which.
    """

    start: float
    end: float
    motion: Motion
    error: float
    wiper: float
    drive: float
    silent: int = 0
    origin: float = 0.0
    duty: float = 0.0
    goal: float = 0.0
    reference: float = 0.0
    trip: int = 0

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
    if plan.digital:
        memory = memory._replace(firm=(control.thawed(memory.firm[0]),))
        controller.resume(inputs, memory)
    end = instant(plan.pulsed, inputs, memory, until - origin_of(memory))
    m = motion.nothing(numbers, memory.u, memory.tau)
    idle = short = 0
    while memory.point.time < end:
        if due(memory):
            memory = counted_anew(memory)
            end = instant(plan.pulsed, inputs, memory, until - origin_of(memory))
        before, trip = memory, memory.firm[0].trip if plan.digital else 0
        try:
            memory, m, event, status = step(numbers, chip, inputs, before, m, end)
        except (ArithmeticError, ValueError):  # numbers beyond what a float holds
            raise failure(Status.DIVERGED, time_of(before)) from None
        if status != COMPLETED:
            raise failure(Status.of_code(status), time_of(before))
        idle = idle + 1 if memory.point.time == before.point.time else 0
        if idle > MOST_IDLE:
            raise failure(Status.CHATTER, time_of(before))
        if record is not None:
            _keep(record, plan, before, trip, memory, m, event)
        short = short + 1 if numbers.play.half > 0.0 and is_short(before, memory, event) else 0
        if short >= MOST_SHORT:
            memory, held = calmed(numbers, chip, inputs, memory)
            if record is not None and held:
                record.events.append(Event(time_of(memory), HELD, memory.point.y.q))
    if plan.digital:
        controller.pause(inputs, memory)
        memory = memory._replace(firm=(control.frozen(memory.firm[0]),))
    return State(until, state.places, memory, numbers, state.changes)


HELD = kinds.NAMES[kinds.HELD]
"""What an event is called after which motor and output, that parted and met in no time, stay together for a while."""


def failure(status: Status, time: float) -> SimulationError:
    """Return the error of a run that ended at `time` [s]."""
    return SimulationError(status.name, time, status.message)


def _keep(record: Record, plan: Plan, before: Memory, trip: int, memory: Memory, m: Motion, event: int) -> None:
    """Add a step to a record: its chip's doings, its motion, its event."""
    origin, point, was = origin_of(memory), memory.point, before.point
    start, now, angle = origin + was.time, origin + point.time, was.y.q
    if memory.chip is not before.chip:
        keep_switch(record, before.chip, memory.chip, start, angle, plan.heeds_silence)
        if (plan.refuses and memory.chip.number > before.chip.number
                and not frame.accepted(plan.chip, pulse_width(plan.inputs, before))):
            record.events.append(Event(start, kinds.NAMES[kinds.REFUSED], angle))
    if plan.digital and memory.firm[0].trip != trip:
        record.events.append(Event(start, TRIPS[memory.firm[0].trip], angle))
    if now > start or not record.segments:
        drive = sign_of(memory.firm[0].duty) if plan.digital else memory.chip.drive
        record.segments.append(Segment(start, now, m, memory.chip.error, was.wiper, drive,
                                       memory.chip.silent, origin, *told_by(plan, memory)))
    if record.tell is not None:
        record.tell(now)
    if kinds.kind_of(event, point.mode) != kinds.NO_EVENT:
        record.events.append(Event(now, event_name(event, point.mode), point.y.q))


def keep_switch(record: Record, before: Frame, after: Frame, time: float, angle: float, heeds: bool) -> None:
    """Add to a record that the bridge has switched at `time` [s], where the shaft is at `angle` [rad]."""
    if after.drive != before.drive:
        record.events.append(Event(time, kinds.NAMES[kinds.DRIVE_ENDS + int(after.drive)], angle))
    if heeds and after.silent != before.silent:
        record.events.append(Event(time, kinds.NAMES[kinds.SILENCE_ENDS + after.silent], angle))


def sign_of(now: float) -> float:
    """Return how a bridge drives at a duty: −1, 0 or +1."""
    return math.copysign(1.0, now) if duty.drives(now) else 0.0


def told_by(plan: Plan, memory: Memory) -> tuple[float, float, float, int]:
    """Return what shows of a program: its duty, or `OPEN`, `BRAKED`; goal and reference [rad]; its trip."""
    if not plan.digital:
        return 0.0, 0.0, 0.0, 0
    return control.told_by(memory.firm[0])


TRIPS = kinds.NAMES[kinds.TRIP_ENDS:]


def event_name(kind: int, after: Mode) -> str:
    """Return what to call an event after which this mode holds."""
    return kinds.NAMES[kinds.kind_of(kind, after)]
