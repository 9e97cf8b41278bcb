"""The one loop over `step`: a servo advances to a time, and its log says by which motions and what has happened."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.events import crossings
from servotwin.models.engine.legs import legs, tick_legs
from servotwin.models.engine.legs.tick_legs import LEGS, SPRING_LEGS
from servotwin.models.engine.log import (
    ALL,
    BEGUN,
    IDLE,
    KEEPS,
    NO_READINGS,
    PAUSED,
    READ,
    READINGS,
    SHORT,
    Log,
    Readings,
    has_rows,
    is_full,
    motion_row,
    write_event,
    write_motion,
)
from servotwin.models.engine.memory import (
    SAME,
    Inputs,
    Memories,
    Memory,
    counted_anew,
    due,
    edge_of,
    in_force,
    instant,
    memory_at,
    origin_of,
    put_memory,
    resumed,
    silent_now,
    since,
    time_of,
)
from servotwin.models.engine.motions import motion
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.engine.motions.rodas import not_constant
from servotwin.models.engine.run.lowest import asked, followed
from servotwin.models.engine.step import (
    CHATTER,
    COMPLETED,
    DIVERGED,
    MOST_IDLE,
    anchored,
    at_pulses,
    pulse_width,
    source,
    step,
)
from servotwin.models.state.modes import RIGID, Mode, at_rest
from servotwin.models.state.records import record_reader
from servotwin.models.terms import control, duty, elastic, firmware, frame, play
from servotwin.models.terms.bridge import heeds_silence
from servotwin.models.terms.control import NOWHERE
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.frame import present as pulsed_chip
from servotwin.models.terms.heat import present as warms
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at
from servotwin.physics.pieces import Piece, piece_value

PLAIN = True  # the compiler takes it for False


class Plant(NamedTuple):
    """A servo and what hangs on it, without its program."""

    numbers: Numbers
    chip: Chip


plant_of = record_reader("plant_of", Plant)


def run(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, until: float, changed: bool, begins: bool,
        log: Log) -> tuple[Memory, int]:
    """Advance to a time since the start [s], from event to event; return the memory and a status.

    After a status other than `COMPLETED` and `PAUSED` the memory is that of before what went wrong.

    Parameters
    ----------
    numbers, chip, inputs
        Servo and load, and their inputs.
    memory : Memory
    until : float
        Not before the memory's time [s].
    changed : bool
        Whether the servo is another one than before.
    begins : bool
        False where the run was `PAUSED` and continues.
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
    return from_step_to_step(numbers, chip, inputs, memory, end, log, NO_READINGS)


def from_step_to_step(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, end: float, log: Log,
                      readings: Readings) -> tuple[Memory, int]:
    """Advance to a time since the memory's origin [s], as `run` does; by legs wherever these lead on under readings."""
    pulsed, origin = pulsed_chip(chip), origin_of(memory)
    m = motion.nothing(numbers, memory.u, memory.tau)
    trip = 0
    while memory.point.time < end:
        if has_rows(log.counts[KEEPS]) and is_full(log):
            return memory, PAUSED
        if due(memory):
            memory = counted_anew(memory)
            end = instant(pulsed, inputs, memory, end - (origin_of(memory) - origin))
            origin = origin_of(memory)
        if log.counts[KEEPS] == READINGS and firmware.present(inputs.firmware[0]) and not asked(memory.lowest):
            way = tick_legs.way_of(numbers, inputs, end - memory.point.time, readings.nearly)
            if way == LEGS:
                gone = tick_legs.go_stiff(numbers, inputs, memory, end, readings.times, log.counts[READ],
                                          readings.values)
                memory, log.counts[READ] = tick_legs.as_gone(memory, gone), gone.done
            if way == SPRING_LEGS:
                gone = tick_legs.go(numbers, inputs, memory, end, readings.times, log.counts[READ], readings.values)
                memory, log.counts[READ] = tick_legs.as_gone(memory, gone), gone.done
            if memory.point.time >= end or due(memory):
                continue
        before = memory
        if has_rows(log.counts[KEEPS]) and firmware.present(inputs.firmware[0]):
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
        if has_rows(log.counts[KEEPS]):
            _note(numbers, chip, inputs, before, trip, memory, m, event, log)
        if log.counts[KEEPS] == READINGS:
            if asked(memory.lowest) and memory.point.time > before.point.time:
                memory = memory._replace(lowest=followed(memory.lowest, m, share_of(numbers, inputs, memory), origin,
                                                         before.point.time, memory.point.time))
            write_readings(numbers, inputs, before, memory, m, end, log, readings)
        log.counts[SHORT] = log.counts[SHORT] + 1 if play.present(numbers.play) and is_short(
            before, memory, event) else 0
        if log.counts[SHORT] >= legs.MOST_SHORT:
            memory, held = calmed(numbers, chip, inputs, memory)
            if has_rows(log.counts[KEEPS]) and held != 0:
                write_event(log, time_of(memory), crossings.HELD, memory.point.y.q)
    if firmware.present(inputs.firmware[0]):
        controller.pause(inputs, controller.of(memory), time_of(memory))
    return memory, COMPLETED


def _tried(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, m: Motion,
           until: float) -> tuple[Memory, Motion, int, int]:
    """Return `step`; of numbers beyond what a float holds Python raises where C has inf or nan."""
    try:
        return step(numbers, chip, inputs, memory, m, until)
    except (ArithmeticError, ValueError):
        return memory, m, -1, DIVERGED


def go_on(plants: Any, inputs: Inputs, memories: Memories, until: float, changed: bool, begins: bool, log: Log) -> int:
    """Advance the servo of a record whose memory is one, as `run` does; return a status."""
    plant = plant_of(plants[0])
    memory, status = run(plant.numbers, plant.chip, inputs, memory_at(memories, 0), until, changed, begins, log)
    put_memory(memories.rows[0], memory)
    return status


def _note(numbers: Numbers, chip: Chip, inputs: Inputs, before: Memory, trip: int, memory: Memory, m: Motion,
          event: int, log: Log) -> None:
    """Write down what a step has brought: what chip or program did, the motion, and the event that ended it."""
    start, angle, was, now = origin_of(memory) + before.point.time, before.point.y.q, before.chip, memory.chip
    if now.drive != was.drive:
        write_event(log, start, crossings.DRIVE_ENDS + int(now.drive), angle)
    if heeds_silence(numbers.bridge) and now.silent != was.silent:
        write_event(log, start, crossings.SILENCE_ENDS + now.silent, angle)
    if pulsed_chip(chip) and now.number > was.number and frame.may_refuse(chip) and not frame.accepted(
            chip, pulse_width(inputs, before)):
        write_event(log, start, crossings.REFUSED, angle)
    if firmware.present(inputs.firmware[0]) and memory.firm[0].trip != trip:
        write_event(log, start, crossings.TRIP_ENDS + memory.firm[0].trip, angle)
    if log.counts[KEEPS] == ALL and (time_of(memory) > start or log.counts[BEGUN] == 0):
        drive, told = now.drive, (0.0, 0.0, 0.0, 0)
        if firmware.present(inputs.firmware[0]):
            firm = memory.firm[0]
            drive = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
            told = control.told_by(firm)
        write_motion(log, motion_row(0, origin_of(memory), before.point.time, memory.point.time, now.error,
                                     before.point.wiper, drive, now.silent, told, m))
    kind = crossings.kind_of(event, memory.point.mode)
    if kind != crossings.NO_EVENT:
        write_event(log, time_of(memory), kind, memory.point.y.q)


def write_readings(numbers: Numbers, inputs: Inputs, before: Memory, memory: Memory, m: Motion, end: float, log: Log,
           readings: Readings) -> None:
    """Write down what stands at the given times that a motion reaches."""
    origin, done, values = origin_of(memory), log.counts[READ], readings.values
    shown = memory.point.time - (SAME * memory.beat if firmware.present(inputs.firmware[0]) else 0.0)
    while done < readings.times.size and (readings.times[done] - origin < shown or memory.point.time >= end):
        m = motion.prepared(m)
        y = motion.state(m, min(readings.times[done] - origin, end) - m.t0)
        values[0, done], values[1, done], values[2, done] = y.q, y.w, m.mode.contact
        values[3, done], values[4, done] = memory.chip.drive, memory.chip.error
        values[5, done] = wiper_at(numbers.sensor, before.point.wiper, y.q)
        values[6, done], values[7, done], values[8, done] = y.i, y.T_w, y.T_h
        values[9, done], values[10, done] = y.q_m, y.w_m
        values[11, done], values[12, done], values[13, done] = m.mode.mesh, m.mode.motor, memory.chip.silent
        if firmware.present(inputs.firmware[0]):
            firm = memory.firm[0]
            values[3, done] = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
            values[14, done], values[16, done], values[17, done] = firm.duty, firm.r, firm.trip
            values[15, done] = firm.r if firm.goal == NOWHERE else firm.goal
        done += 1
    log.counts[READ] = done


def stands(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, end: float) -> bool:
    """Tell whether a servo stands still until `end`, and nothing is decided before: then time alone advances."""
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


def mode_of(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory) -> Mode:
    """Return the mode of a servo as it stands, under its present inputs."""
    u, tau = told(numbers, pulsed_chip(chip), inputs, memory)
    return mode_under(as_now(numbers, inputs, memory), u, tau, memory)


def as_now(numbers: Numbers, inputs: Inputs, memory: Memory) -> Numbers:
    """Return the numbers of a servo with its bridge as it is now."""
    if firmware.present(inputs.firmware[0]):
        return duty.at_duty(numbers, memory.firm[0].duty)
    return at_pulses(numbers, silent_now(memory))


def share_of(numbers: Numbers, inputs: Inputs, memory: Memory) -> float:
    """Return how much of the supply's voltage there is at the bridge of a servo as it is now."""
    return duty.share_of(numbers.bridge, memory.firm[0].duty) if firmware.present(inputs.firmware[0]) else 1.0


def told(numbers: Numbers, pulsed: bool, inputs: Inputs, memory: Memory) -> tuple[Piece, Piece]:
    """Return what a servo follows as it stands, and the torque of its load that depends on time alone."""
    origin, time = origin_of(memory), memory.point.time
    tau, _ = in_force(inputs.torque, origin, time, inputs.constant_torque)
    if firmware.present(inputs.firmware[0]):
        V = duty.voltage(duty.at_duty(numbers, memory.firm[0].duty).source, memory.firm[0].duty)
        return Piece(0.0, V, 0.0, 0.0, 0.0, 0.0, 0.0), tau
    if pulsed:
        return source(numbers, memory.chip), tau
    u, _ = in_force(inputs.command, origin, time, 0.0)
    return u, tau


def mode_under(numbers: Numbers, u: Piece, tau: Piece, memory: Memory) -> Mode:
    """Return the mode of a servo whose numbers are those with pulses or without, as it is now."""
    origin, point = origin_of(memory), memory.point
    if point.anchor_time < math.inf and u == memory.u and tau == memory.tau:
        return point.mode
    return anchored(numbers, since(u, origin), since(tau, origin), point.time, point).mode


def calmed(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory) -> tuple[Memory, int]:
    """Return the memory of a servo whose motor and output, that part and meet in no time, stay together; 1, or 0: not.

    They do so until the inputs change.
    """
    point, origin, now = memory.point, origin_of(memory), as_now(numbers, inputs, memory)
    u, tau = told(numbers, pulsed_chip(chip), inputs, memory)
    held, mode, y = legs.together(now, point.mode, piece_value(since(u, origin), point.time),
                                  piece_value(since(tau, origin), point.time), point.y)
    if held == 0:
        return memory, 0
    return memory._replace(point=point._replace(y=y, mode=mode, anchor_time=point.time, anchor=y)), 1


def is_short(before: Memory, memory: Memory, event: int) -> bool:
    """Tell whether an event came next to no time after the one before."""
    return event >= 0 and memory.point.time - before.point.time <= legs.SHORT * memory.beat
