"""The one loop over `step`: a servo goes on to a time, and its log says by which motions and what has happened."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.events import kinds
from servotwin.models.engine.legs.legs import MOST_SHORT
from servotwin.models.engine.log import (
    ALL,
    BEGUN,
    IDLE,
    KEEPS,
    PAUSED,
    SHORT,
    Log,
    is_full,
    motion_row,
    write_event,
    write_motion,
)
from servotwin.models.engine.memory import (
    Inputs,
    Memories,
    Memory,
    counted_anew,
    due,
    edge_of,
    instant,
    memory_at,
    origin_of,
    put_memory,
    resumed,
    time_of,
)
from servotwin.models.engine.motions import motion
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.engine.motions.rodas import not_constant
from servotwin.models.engine.runs import calmed, is_short
from servotwin.models.engine.step import CHATTER, COMPLETED, DIVERGED, MOST_IDLE, pulse_width, step
from servotwin.models.state.modes import RIGID, at_rest
from servotwin.models.state.records import record_reader
from servotwin.models.terms import control, duty, elastic, firmware, frame, play
from servotwin.models.terms.bridge import heeds_silence
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.chip import present as pulsed_chip
from servotwin.models.terms.heat import present as warms
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers

PLAIN = True  # the compiler takes it for False


class Plant(NamedTuple):
    """A servo and what hangs on it, without its program."""

    numbers: Numbers
    chip: Chip


plant_of = record_reader("plant_of", Plant)


def run(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, until: float, changed: bool, begins: bool,
        log: Log) -> tuple[Memory, int]:
    """Go on to a time since the start [s], from event to event; return the memory and a status.

    After a status other than `COMPLETED` and `PAUSED` the memory is that of before what went wrong.

    Parameters
    ----------
    numbers, chip, inputs
        Servo and load, and what they are told.
    memory : Memory
    until : float
        Not before the memory's time [s].
    changed : bool
        Whether the servo is another one than before.
    begins : bool
        False where the run was `PAUSED` and goes on.
    log : Log
        Motions and events are written into it as far as it has room for any.
    """
    pulsed = pulsed_chip(chip)
    if begins:
        memory = resumed(pulsed, inputs, memory, changed)
        if firmware.present(inputs.firmware[0]):
            controller.resume(inputs, memory)
        log.counts[IDLE], log.counts[SHORT] = 0, 0
    end = instant(pulsed, inputs, memory, until - origin_of(memory))
    if log.counts[KEEPS] != ALL and stands(numbers, chip, inputs, memory, end):
        return memory_then(memory, end), COMPLETED
    m = motion.nothing(numbers, memory.u, memory.tau)
    trip = 0
    while memory.point.time < end:
        if is_full(log):
            return memory, PAUSED
        if due(memory):
            memory = counted_anew(memory)
            end = instant(pulsed, inputs, memory, until - origin_of(memory))
        before = memory
        if firmware.present(inputs.firmware[0]):
            trip = memory.firm[0].trip
        if PLAIN:
            memory, m, event, status = _tried(numbers, chip, inputs, before, m, end)
        else:
            memory, m, event, status = step(numbers, chip, inputs, before, m, end)
        if status != COMPLETED:
            return before, status
        log.counts[IDLE] = log.counts[IDLE] + 1 if memory.point.time == before.point.time else 0
        if log.counts[IDLE] > MOST_IDLE:
            return before, CHATTER
        _note(numbers, chip, inputs, before, trip, memory, m, event, log)
        log.counts[SHORT] = log.counts[SHORT] + 1 if play.present(numbers.play) and is_short(
            before, memory, event) else 0
        if log.counts[SHORT] >= MOST_SHORT:
            memory, held = calmed(numbers, chip, inputs, memory)
            if held != 0:
                write_event(log, time_of(memory), kinds.HELD, memory.point.y.q)
    if firmware.present(inputs.firmware[0]):
        controller.pause(inputs, memory)
    return memory, COMPLETED


def _tried(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, m: Motion,
           until: float) -> tuple[Memory, Motion, int, int]:
    """Return `step`; of numbers beyond what a float holds Python raises where C has inf or nan."""
    try:
        return step(numbers, chip, inputs, memory, m, until)
    except (ArithmeticError, ValueError):
        return memory, m, -1, DIVERGED


def go_on(plants: Any, inputs: Inputs, memories: Memories, until: float, changed: bool, begins: bool, log: Log) -> int:
    """Let the servo of a record go on whose memory is one, as `run` does; return a status."""
    plant = plant_of(plants[0])
    memory, status = run(plant.numbers, plant.chip, inputs, memory_at(memories, 0), until, changed, begins, log)
    put_memory(memories.rows[0], memory)
    return status


def _note(numbers: Numbers, chip: Chip, inputs: Inputs, before: Memory, trip: int, memory: Memory, m: Motion,
          event: int, log: Log) -> None:
    """Write down what a step has brought: what chip or program did, the motion, and the event that ended it."""
    start, angle, was, now = origin_of(memory) + before.point.time, before.point.y.q, before.chip, memory.chip
    if now.drive != was.drive:
        write_event(log, start, kinds.DRIVE_ENDS + int(now.drive), angle)
    if heeds_silence(numbers.bridge) and now.silent != was.silent:
        write_event(log, start, kinds.SILENCE_ENDS + now.silent, angle)
    if pulsed_chip(chip) and now.number > was.number and frame.may_refuse(chip) and not frame.accepted(
            chip, pulse_width(inputs, before)):
        write_event(log, start, kinds.REFUSED, angle)
    if firmware.present(inputs.firmware[0]) and memory.firm[0].trip != trip:
        write_event(log, start, kinds.TRIP_ENDS + memory.firm[0].trip, angle)
    if log.counts[KEEPS] == ALL and (time_of(memory) > start or log.counts[BEGUN] == 0):
        drive, told = now.drive, (0.0, 0.0, 0.0, 0)
        if firmware.present(inputs.firmware[0]):
            firm = memory.firm[0]
            drive = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
            told = control.told_by(firm)
        write_motion(log, motion_row(0, origin_of(memory), before.point.time, memory.point.time, now.error,
                                     before.point.wiper, drive, now.silent, told, m))
    kind = kinds.kind_of(event, memory.point.mode)
    if kind != kinds.NO_EVENT:
        write_event(log, time_of(memory), kind, memory.point.y.q)


def stands(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, end: float) -> bool:
    """Tell whether a servo stands still until `end`, and nothing is decided before: then time alone goes on."""
    point, now = memory.point, memory.chip
    if not at_rest(point.mode.contact) or point.mode.mesh != RIGID or point.anchor_time == math.inf:
        return False
    if inductive(numbers.motor) or warms(numbers.heat) or elastic.present(numbers.elastic) or (
            firmware.present(inputs.firmware[0])):
        return False
    if pulsed_chip(chip) and (frame.next_switch(now, heeds_silence(numbers.bridge)) < end
                              or edge_of(inputs, memory, now.number) < end):
        return False
    if not_constant(memory.u) or not_constant(memory.tau):
        return False
    return memory.u_end >= end and memory.tau_end >= end and not due(memory)


def memory_then(memory: Memory, time: float) -> Memory:
    """Return the memory of a servo that has stood still until a time [s]."""
    point = memory.point
    return memory._replace(point=point._replace(time=time))
