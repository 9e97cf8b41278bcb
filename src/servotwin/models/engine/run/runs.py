"""Servos one after the other, each from step to step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller
from servotwin.models.engine.lanes import ARRIVED, UNDERWAY, Tables, Told, chip_of, inputs_of, numbers_of
from servotwin.models.engine.legs import coupled_ticks, tick_legs
from servotwin.models.engine.legs.coupled_units import put_unit_numbers
from servotwin.models.engine.legs.tick_legs import POWER_SERIES, STEPS
from servotwin.models.engine.log import IDLE, KEEPS, NO_ROWS, READ, READINGS, SHORT, Log, Readings
from servotwin.models.engine.memory import (
    Inputs,
    Memory,
    counted_anew,
    due,
    instant,
    memory_at,
    origin_of,
    put_memory,
    put_started,
    put_vector,
    resumed,
    time_of,
)
from servotwin.models.engine.run.lowest import asked
from servotwin.models.engine.run.run import from_step_to_step
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import INSIDE, LOST, RIGID, Vector
from servotwin.models.terms import firmware, play
from servotwin.models.terms.frame import present as pulsed_chip
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
          status: Indices, nearly: bool, ended: Floats, counts: Indices, units: Any, common: Any) -> None:
    """Advance the lanes named in `which`, whose memories are given, by durations of their own [s].

    `outputs` has the shape (n, 18, T), a table of `Readings` for each, and gets what stands at `times` from the one
    numbered `first_output` on, `nearly` as those have it; `counts` are those of a log, and `units` and `common` room
    for a servo that goes by power series. A lane whose status is `UNDERWAY` may be in the middle of a tick, one that
    has `ARRIVED` stays.
    """
    told = Told(lanes, Tables(torques, torque_first, torque_count, curve, torque_first, torque_count))
    for k in range(which.size):
        lane = which[k]
        if status[k] == ARRIVED:
            row = memories.rows[k]
            status[k], ended[k] = COMPLETED, row.frames * row.beat + row.point.time
            continue
        inputs = inputs_of(lanes, curve, torques[torque_first[lane]:torque_first[lane] + torque_count[lane]], lane)
        numbers, readings = numbers_of(lanes, lane), Readings(times, outputs[k], nearly)
        memory, end = ready_to(inputs, memory_at(memories, k), pulsed_chip(chip_of(lanes, lane)), durations[k],
                               status[k] == UNDERWAY)
        counts[READ] = first_output[k]
        if way_of(numbers, inputs, memory, durations[k], nearly) == POWER_SERIES:
            units[0].place, units[0].lane = k, lane
            memory, end = by_series(told, numbers, inputs, memory, memories.firms, end, readings, counts, units, common)
        log = log_of(counts)
        memory, how = from_step_to_step(numbers, chip_of(lanes, lane), inputs, memory, end, log, readings)
        status[k] = how
        ended[k] = time_of(memory)
        if how == COMPLETED:
            put_memory(memories.rows[k], memory)


def ready(lanes: Indices, lane_status: Any, now: Floats, done: Indices, durations: Floats, status: Indices) -> int:
    """Make all lanes ready to advance by the time in `now` [s], but for those that have failed or are `done` (1).

    Return how many advance.
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
    """Advance digital servos that begin before their first tick to it: from there on they go side by side.

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
        memory, end = ready_to(inputs, memory_at(memories, k), False, phase, False)
        counts[READ], log = 0, log_of(counts)
        memory, how = from_step_to_step(numbers_of(lanes, lane), chip_of(lanes, lane), inputs, memory, end, log,
                                        Readings(times[:seen], outputs[k], False))
        if how == COMPLETED:
            put_memory(memories.rows[k], memory)
            durations[k], first_output[k] = durations[k] - phase, seen


def note_failures(lanes: Indices, how: Indices, at: Floats, records: Any, status: Any, ended: Floats) -> None:
    """Note which lanes have failed, and when; they are nan from there on."""
    for k in range(lanes.size):
        if how[k] != COMPLETED:
            status[lanes[k]], ended[lanes[k]] = how[k], at[k]
            put_vector(records[k].point.y, LOST)


def ready_to(inputs: Inputs, memory: Memory, pulsed: bool, duration: float, underway: bool) -> tuple[Memory, float]:
    """Return a memory that can advance by a duration [s], and to when by its own clock [s].

    `underway` is whether a program has its next tick and pulse.
    """
    memory = resumed(pulsed, inputs, memory, False)
    if firmware.present(inputs.firmware[0]) and not underway:
        controller.resume(inputs, memory)
    return memory, instant(pulsed, inputs, memory, memory.point.time + duration)


def log_of(counts: Indices) -> Log:
    """Return a log that keeps readings alone."""
    counts[KEEPS], counts[IDLE], counts[SHORT] = READINGS, 0, 0
    return Log(NO_ROWS, NO_ROWS, NO_ROWS, counts)


def way_of(numbers: Numbers, inputs: Inputs, memory: Memory, left: float, nearly: bool) -> int:
    """Return which way a servo goes for the time that is left [s]; power series tell no least voltage."""
    if not firmware.present(inputs.firmware[0]) or asked(memory.lowest):
        return STEPS
    way = tick_legs.way_of(numbers, inputs, left, nearly)
    return coupled_ticks.way_of(numbers, inputs, left) if way == STEPS else way


def by_series(told: Told, numbers: Numbers, inputs: Inputs, memory: Memory, firms: Any, end: float, readings: Readings,
              counts: Indices, units: Any, common: Any) -> tuple[Memory, float]:
    """Advance by power series as far as these lead; return the memory, and the end [s] by its clock."""
    put_unit_numbers(units[0].given, numbers)
    coupled_ticks.put_source(common[0], numbers.source)
    goes = True
    while goes:
        if due(memory):
            later = counted_anew(memory)
            end = instant(False, inputs, later, end - (origin_of(later) - origin_of(memory)))
            memory = later
        gone = coupled_ticks.alone(told, inputs, memory, firms, end, readings.times, counts[READ], readings.values,
                                   units, common)
        memory, counts[READ] = tick_legs.as_gone(memory, gone), gone.done
        goes = gone.anew and gone.time < end and due(memory)
    return memory, end
