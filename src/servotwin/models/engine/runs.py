"""Servos one after the other, each from step to step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller
from servotwin.models.engine.batch.tiles import chip_of, numbers_of
from servotwin.models.engine.bus.bus_records import put_vector
from servotwin.models.engine.legs import legs, tick_legs
from servotwin.models.engine.legs.legs import MOST_SHORT, SHORT
from servotwin.models.engine.legs.tick_legs import LEGS
from servotwin.models.engine.lowest import asked, followed
from servotwin.models.engine.memory import (
    SAME,
    Inputs,
    Memory,
    counted_anew,
    due,
    in_force,
    instant,
    memory_at,
    origin_of,
    put_memory,
    put_started,
    resumed,
    silent_now,
    since,
    time_of,
)
from servotwin.models.engine.motions import motion
from servotwin.models.engine.step import CHATTER, COMPLETED, MOST_IDLE, anchored, at_pulses, source, step
from servotwin.models.state.modes import INSIDE, LOST, RIGID, Mode, Vector
from servotwin.models.terms import duty, firmware, play
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.chip import present as pulsed_chip
from servotwin.models.terms.control import NOWHERE
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.batch.tiles import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories

# Status of a lane that has gone on in this call already, side by side with others or by legs: for all of it, or not yet
ARRIVED, UNDERWAY = -2, -1


def start(lanes: Lanes, which: Indices, memories: Memories) -> None:
    """Put the lanes named in `which` into records, as they start."""
    for k in range(which.size):
        lane, y = which[k], lanes.start
        numbers = numbers_of(lanes, lane)
        put_started(
            memories, k, Vector(y[0, lane], y[1, lane], y[2, lane], y[3, lane], y[4, lane], y[5, lane], y[6, lane]),
            INSIDE if play.present(numbers.play) else RIGID)


def go_on(lanes: Lanes, curve: Floats, torques: Floats, torque_first: Indices, torque_count: Indices,
          which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats, memories: Memories,
          status: Indices, ended: Floats) -> None:
    """Let the lanes named in `which`, whose memories are given, go on for durations of their own [s].

    `outputs` has the shape (n, 18, T), as in `run`, and gets what stands at `times` from the one numbered
    `first_output` on. A lane whose status is `UNDERWAY` may be in the middle of a tick, one that has `ARRIVED` stays.
    """
    for k in range(which.size):
        lane = which[k]
        if status[k] == ARRIVED:
            row = memories.rows[k]
            status[k], ended[k] = COMPLETED, row.frames * row.beat + row.point.time
            continue
        inputs = inputs_of(lanes, curve, torques[torque_first[lane]:torque_first[lane] + torque_count[lane]], lane)
        memory, how = run(numbers_of(lanes, lane), chip_of(lanes, lane), inputs, memory_at(memories, k),
                          durations[k], status[k] == UNDERWAY, times, first_output[k], outputs[k])
        status[k] = how
        ended[k] = time_of(memory)
        if how == COMPLETED:
            put_memory(memories.rows[k], memory)


def ready(lanes: Indices, lane_status: Any, now: Floats, done: Indices, durations: Floats, status: Indices) -> int:
    """Let all lanes be about to go on for the time in `now` [s], but for those that have failed or are `done` (1).

    Return how many go on.
    """
    left = 0
    for k in range(lanes.size):
        goes = lane_status[lanes[k]] == COMPLETED and done[k] == 0
        durations[k], status[k] = now[0], COMPLETED if goes else ARRIVED
        left += 1 if goes else 0
    return left


def to_first_ticks(lanes: Lanes, curve: Floats, torques: Floats, torque_first: Indices, torque_count: Indices,
                   which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats,
                   memories: Memories, status: Indices) -> None:
    """Let digital servos that begin before their first tick go on to it: from there on they go side by side.

    The arguments are those of `go_on`. Durations and outputs that are left are noted; a lane that fails stays.
    """
    for k in range(which.size):
        lane, row = which[k], memories.rows[k]
        phase = lanes.firmware[lane].t_phi
        if status[k] == ARRIVED or not 0.0 < phase < durations[k] or first_output[k] != 0:
            continue
        if row.point.time != 0.0 or row.frames != 0:
            continue
        seen = 0
        while seen < times.size and times[seen] < phase:
            seen += 1
        inputs = inputs_of(lanes, curve, torques[torque_first[lane]:torque_first[lane] + torque_count[lane]], lane)
        memory, how = run(numbers_of(lanes, lane), chip_of(lanes, lane), inputs, memory_at(memories, k), phase, False,
                          times[:seen], 0, outputs[k])
        if how == COMPLETED:
            put_memory(memories.rows[k], memory)
            durations[k], first_output[k] = durations[k] - phase, seen


def note_failures(lanes: Indices, how: Indices, at: Floats, records: Any, status: Any, ended: Floats) -> None:
    """Note which lanes have failed, and when; they are nan from there on."""
    for k in range(lanes.size):
        if how[k] != COMPLETED:
            status[lanes[k]], ended[lanes[k]] = how[k], at[k]
            put_vector(records[k].point.y, LOST)


def inputs_of(lanes: Lanes, curve: Floats, torque: Floats, lane: int) -> Inputs:
    """Return what a lane is told, and what hangs on its shaft with a recorded torque."""
    first, last = lanes.piece_first[lane], lanes.piece_first[lane] + lanes.piece_count[lane]
    own = lanes.edge_count[lane]
    edges = lanes.edges[lanes.edge_first[lane]:lanes.edge_first[lane] + max(own, 0)]
    place = min(lane, len(lanes.firmware) - 1)  # one stands for all where none has a program
    program = lanes.firmware[place:place + 1]
    regular = program[0].T_f if firmware.present(program[0]) else chip_of(lanes, lane).frame_period
    period = 0.0 if own >= 0 else regular
    return Inputs(lanes.pieces[first:last], torque, lanes.torque[lane], period, edges, curve, lanes.seeds[lane],
                  lanes.accuracy, program)


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
    return event >= 0 and memory.point.time - before.point.time <= SHORT * memory.beat


def run(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, duration: float, underway: bool,
        times: Floats, done: int, outputs: Floats) -> tuple[Memory, int]:
    """Go on for a duration [s]; return the memory, of before what went wrong, and a status.

    `underway` is whether a program knows its next tick and pulse.
    What stands at `times` [s], from the one numbered `done` on, goes into `outputs`, shape (18, n): angle, speed,
    contact, drive, error, angle of the potentiometer, and what only few servos have: current, temperatures of winding
    and housing, angle and speed of the motor at the output shaft, place in the play and contact of the motor there,
    silence of the chip; duty, goal, reference and trip of a program.
    """
    pulsed = pulsed_chip(chip)
    memory = resumed(pulsed, inputs, memory, False)
    if firmware.present(inputs.firmware[0]) and not underway:
        controller.resume(inputs, memory)
    until = instant(pulsed, inputs, memory, memory.point.time + duration)
    if firmware.present(inputs.firmware[0]) and not asked(memory.lowest) and tick_legs.way_of(
            numbers, inputs, until - memory.point.time, False) == LEGS:
        gone = tick_legs.go(numbers, inputs, memory, until, times, done, outputs)
        memory, done = tick_legs.as_gone(memory, gone), gone.done
        if gone.time >= until:
            controller.pause(inputs, memory)
            return memory, COMPLETED
    return _run_on(numbers, chip, inputs, memory, until, times, done, outputs)


def _run_on(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, until: float, times: Floats, done: int,
            outputs: Floats) -> tuple[Memory, int]:
    """Go on to a time [s] from event to event, and by legs wherever these lead on; see `run`."""
    pulsed, origin = pulsed_chip(chip), origin_of(memory)
    m = motion.nothing(numbers, memory.u, memory.tau)
    idle = short = 0
    while memory.point.time < until:
        if due(memory):
            memory = counted_anew(memory)
            until = instant(pulsed, inputs, memory, until - (origin_of(memory) - origin))
            origin = origin_of(memory)
        if firmware.present(inputs.firmware[0]) and not asked(memory.lowest) and tick_legs.way_of(
                numbers, inputs, until - memory.point.time, False) == LEGS:
            gone = tick_legs.go(numbers, inputs, memory, until, times, done, outputs)
            memory, done = tick_legs.as_gone(memory, gone), gone.done
            if memory.point.time >= until or due(memory):
                continue
        t, wiper = memory.point.time, memory.point.wiper
        after, m, event, status = step(numbers, chip, inputs, memory, m, until)
        if status != COMPLETED:
            return memory, status
        short = short + 1 if play.present(numbers.play) and is_short(memory, after, event) else 0
        memory = after
        if asked(memory.lowest) and memory.point.time > t:
            memory = memory._replace(lowest=followed(memory.lowest, m, share_of(numbers, inputs, memory), origin, t,
                                                     memory.point.time))
        if short >= MOST_SHORT:
            memory, _ = calmed(numbers, chip, inputs, memory)
        idle = idle + 1 if memory.point.time == t else 0
        if idle > MOST_IDLE:
            return memory, CHATTER
        shown = memory.point.time - (SAME * memory.beat if firmware.present(inputs.firmware[0]) else 0.0)
        while done < times.size and (times[done] - origin < shown or memory.point.time >= until):
            m = motion.prepared(m)
            y = motion.state(m, min(times[done] - origin, until) - m.t0)
            outputs[0, done], outputs[1, done], outputs[2, done] = y.q, y.w, m.mode.contact
            outputs[3, done], outputs[4, done] = memory.chip.drive, memory.chip.error
            outputs[5, done] = wiper_at(numbers.sensor, wiper, y.q)
            outputs[6, done], outputs[7, done], outputs[8, done] = y.i, y.T_w, y.T_h
            outputs[9, done], outputs[10, done] = y.q_m, y.w_m
            outputs[11, done], outputs[12, done], outputs[13, done] = m.mode.mesh, m.mode.motor, memory.chip.silent
            if firmware.present(inputs.firmware[0]):
                firm = memory.firm[0]
                outputs[3, done] = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
                outputs[14, done], outputs[16, done], outputs[17, done] = firm.duty, firm.r, firm.trip
                outputs[15, done] = firm.r if firm.goal == NOWHERE else firm.goal
            done += 1
    if firmware.present(inputs.firmware[0]):
        controller.pause(inputs, memory)
    return memory, COMPLETED
