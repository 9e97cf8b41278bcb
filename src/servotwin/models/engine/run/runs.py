"""Servos one after the other, each from step to step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller
from servotwin.models.engine.lanes import ARRIVED, UNDERWAY, chip_of, inputs_of, numbers_of
from servotwin.models.engine.log import IDLE, KEEPS, NO_ROWS, READ, READINGS, SHORT, Log, Readings
from servotwin.models.engine.memory import (
    Inputs,
    Memory,
    instant,
    memory_at,
    put_memory,
    put_started,
    put_vector,
    resumed,
    time_of,
)
from servotwin.models.engine.run.run import from_step_to_step
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import INSIDE, LOST, RIGID, Vector
from servotwin.models.terms import firmware, play
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.chip import present as pulsed_chip
from servotwin.models.terms.numbers import Numbers

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories


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
          status: Indices, ended: Floats, counts: Indices) -> None:
    """Let the lanes named in `which`, whose memories are given, go on for durations of their own [s].

    `outputs` has the shape (n, 18, T), a table of `Readings` for each, and gets what stands at `times` from the one
    numbered `first_output` on; `counts` are those of a log. A lane whose status is `UNDERWAY` may be in the middle of a
    tick, one that has `ARRIVED` stays.
    """
    for k in range(which.size):
        lane = which[k]
        if status[k] == ARRIVED:
            row = memories.rows[k]
            status[k], ended[k] = COMPLETED, row.frames * row.beat + row.point.time
            continue
        inputs = inputs_of(lanes, curve, torques[torque_first[lane]:torque_first[lane] + torque_count[lane]], lane)
        memory, how = run(numbers_of(lanes, lane), chip_of(lanes, lane), inputs, memory_at(memories, k),
                          durations[k], status[k] == UNDERWAY, Readings(times, outputs[k]), first_output[k], counts)
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
                   memories: Memories, status: Indices, counts: Indices) -> None:
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
                          Readings(times[:seen], outputs[k]), 0, counts)
        if how == COMPLETED:
            put_memory(memories.rows[k], memory)
            durations[k], first_output[k] = durations[k] - phase, seen


def note_failures(lanes: Indices, how: Indices, at: Floats, records: Any, status: Any, ended: Floats) -> None:
    """Note which lanes have failed, and when; they are nan from there on."""
    for k in range(lanes.size):
        if how[k] != COMPLETED:
            status[lanes[k]], ended[lanes[k]] = how[k], at[k]
            put_vector(records[k].point.y, LOST)


def run(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, duration: float, underway: bool,
        readings: Readings, done: int, counts: Indices) -> tuple[Memory, int]:
    """Go on for a duration [s]; return the memory, of before what went wrong, and a status.

    `underway` is whether a program knows its next tick and pulse. Readings are taken from the one numbered `done` on.
    """
    pulsed = pulsed_chip(chip)
    memory = resumed(pulsed, inputs, memory, False)
    if firmware.present(inputs.firmware[0]) and not underway:
        controller.resume(inputs, memory)
    counts[KEEPS], counts[IDLE], counts[SHORT], counts[READ] = READINGS, 0, 0, done
    end = instant(pulsed, inputs, memory, memory.point.time + duration)
    return from_step_to_step(numbers, chip, inputs, memory, end, Log(NO_ROWS, NO_ROWS, NO_ROWS, counts), readings)
