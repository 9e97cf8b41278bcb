"""A servo on its own runs for a stretch of time, and is looked at on the way: what shows follows from its log."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine.live.screen import LEFT as STEPS_LEFT
from servotwin.models.engine.live.screen import (
    NEXT,
    NO_LOW,
    TOO_LONG,
    Lines,
    Looks,
    Low,
    Said,
    Screen,
    Switch,
    is_before,
    note,
    said_by,
    switch_of,
    taken_up,
    told_of,
    write,
)
from servotwin.models.engine.log import ALL, BEGUN, EVENTS, KEEPS, LEFT, MOTIONS, PAUSED, Log, Row
from servotwin.models.engine.memory import FLAT, Inputs, Memories, Memory, memory_at, origin_of, time_of
from servotwin.models.engine.motions import motion
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.engine.observe import bus_voltage
from servotwin.models.engine.run.at import motion_of, row_at
from servotwin.models.engine.run.lowest import lowest_on, voltage_at
from servotwin.models.engine.run.run import as_now, mode_under, plant_of, run, told
from servotwin.models.engine.step import COMPLETED, at_pulses
from servotwin.models.terms import duty, firmware, source
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.frame import present as pulsed_chip
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import wiper_at
from servotwin.physics.pieces import piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.live.screen import Floats, Indices

AT_ONCE = 64  # steps between two looks at a log


class Stood(NamedTuple):
    """How a servo stood before a motion: its memory, and what showed of its chip or program."""

    memory: Memory
    said: Said


def go_on(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, changed: bool, was: Switch, low: Low,
          looks: Looks, lines: Lines, screen: Screen, log: Log) -> tuple[Memory, Switch, Low, int]:
    """Advance to `looks.until`; return the memory, how the bridge drives there, the supply's `low`, and a status.

    `changed` is whether the servo is another one than before, `was` how its bridge drove at the end of the stretch
    before, and `low` how low its supply was since the latest look. After a status that is not `COMPLETED` the memory is
    that of before what went wrong.
    """
    program, begins, status, k = firmware.present(inputs.firmware[0]), True, PAUSED, looks.next
    stood = Stood(memory, told_of(memory, program))
    log.counts[KEEPS], log.counts[BEGUN] = ALL, 0
    while status == PAUSED:
        most = min(AT_ONCE, screen.used[STEPS_LEFT]) if screen.used[STEPS_LEFT] > 0 else AT_ONCE
        log.counts[LEFT], log.counts[MOTIONS], log.counts[EVENTS] = most, 0, 0
        memory, status = run(numbers, chip, inputs, memory, looks.until, changed, begins, log)
        begins = False
        if screen.used[STEPS_LEFT] > 0:
            screen.used[STEPS_LEFT] -= most - max(log.counts[LEFT], 0)
            if screen.used[STEPS_LEFT] == 0 and status == PAUSED:
                status = TOO_LONG
        k, was, low = show(numbers, inputs, log.motions, log.counts[MOTIONS], log.numbers, stood, k, was, low, looks,
                           lines, screen, status == COMPLETED)
        for n in range(log.counts[EVENTS]):
            note(screen, log.events[n].time, log.events[n].kind)
        stood = Stood(memory, told_of(memory, program))
    screen.used[NEXT] = k
    return memory, was, low, status


def show(numbers: Numbers, inputs: Inputs, rows: Any, count: int, shared: Floats, stood: Stood, k: int, was: Switch,
         low: Low, looks: Looks, lines: Lines, screen: Screen, ends: bool) -> tuple[int, Switch, Low]:
    """Write what shows of motions; return the number of the next look, how the bridge drives at their end, and `low`.

    Parameters
    ----------
    numbers, inputs
        Of the servo.
    rows, count, shared
        Rows of a log, as many as there are, and its numbers.
    stood : Stood
        How it stood before them.
    k : int
        Number of the next look.
    was : Switch
        How its bridge drove before them.
    low : Low
        Of its supply before them.
    looks, lines, screen
    ends : bool
        Whether the last of them ends at `looks.until`.
    """
    if count == 0:
        return k, was, low
    falls = looks.switches == 1 and source.falls(numbers.source)
    program = firmware.present(inputs.firmware[0])
    row = row_at(rows, 0)
    m = motion_of(numbers, row, shared, inputs.accuracy)
    for n in range(count):
        before, m_before = row, m
        row = row_at(rows, n)
        m = motion_of(numbers, row, shared, inputs.accuracy)
        if row.end > row.start:
            now, start = switch_of(said_by(row)), row.origin + row.start
            if looks.switches == 1 and now != was and was.silent >= 0:
                if n == 0:
                    if falls:
                        taken_up(screen, low, _voltage_as_stood(numbers, stood))
                    _see_stood(screen, lines, inputs, numbers, stood)
                else:
                    if falls:
                        taken_up(screen, low, _voltage(before, m_before, before.origin + before.end))
                    m_before = _see(screen, lines, inputs, before, m_before, before.origin + before.end)
                m = _see(screen, lines, inputs, row, m, start)
                low = Low(_voltage(row, m, start), 0) if falls else low
                k = k if is_before(start, k / looks.rate, program) else k + 1
            was = now
            if falls and low.voltage == math.inf:
                low = Low(_voltage(row, m, start), 0)
            time, seen = k / looks.rate, start
            while time < looks.until and is_before(time, row.origin + row.end, program):
                if falls:
                    m, low = _lowered(screen, lines, inputs, row, m, seen, time, low)
                    voltage = _voltage(row, m, time)
                    taken_up(screen, low, voltage)
                    low, seen = Low(voltage, 0), time
                m = _see(screen, lines, inputs, row, m, time)
                k += 1
                time = k / looks.rate
            if falls:
                m, low = _lowered(screen, lines, inputs, row, m, seen, row.origin + row.end, low)
    if ends:
        time = k / looks.rate
        if falls and (looks.at_end == 1 or (time < looks.until and not program)):
            voltage = _voltage(row, m, row.origin + row.end)
            taken_up(screen, low, voltage)
            low = Low(voltage, 0)
        while time < looks.until and (looks.at_end == 1 or not program):  # next to the end
            m = _see(screen, lines, inputs, row, m, time)
            k += 1
            time = k / looks.rate
        if looks.at_end == 1:
            _see(screen, lines, inputs, row, m, looks.until)
    return k, was, low


def _voltage(row: Row, m: Motion, time: float) -> float:
    """Return the voltage of the supply at a time [s] of a motion."""
    m = motion.prepared(m)
    return voltage_at(m, _share(row, m), time - row.origin - m.t0)


def _share(row: Row, m: Motion) -> float:
    """Return how much of the supply's voltage there is at the bridge."""
    return duty.share_of(m.numbers.bridge, row.duty) if duty.present(m.numbers.bridge) else 1.0


def _lowered(screen: Screen, lines: Lines, inputs: Inputs, row: Row, m: Motion, start: float, end: float,
             low: Low) -> tuple[Motion, Low]:
    """Return a motion and the least voltage after it has advanced between two times [s]; a row of it is written."""
    if not end > start:
        return m, low
    m, begun = motion.prepared(m), row.origin + m.t0
    voltage, age = lowest_on(m, _share(row, m), start - begun, end - begun, low.voltage)
    if not voltage < low.voltage - FLAT or screen.used[0] >= len(screen.rows) - 1:
        return m, low
    m = _see(screen, lines, inputs, row, m, begun + age)
    screen.used[0] -= 1
    return m, Low(voltage, 1)


def shown(plants: Any, inputs: Inputs, memories: Memories, rows: Any, shared: Floats, was: Switch, looks: Looks,
          lines: Lines, found: Any, used: Indices) -> None:
    """Write what shows of all motions of a servo since it stood as its memory says; `found` has room for rows."""
    plant, memory = plant_of(plants[0]), memory_at(memories, 0)
    stood = Stood(memory, told_of(memory, firmware.present(inputs.firmware[0])))
    show(plant.numbers, inputs, rows, len(rows), shared, stood, looks.next, was, NO_LOW, looks, lines,
         Screen(found, found, used), True)


def look(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, lines: Lines, screen: Screen) -> None:
    """Write a row of a servo as it stands, before anything happens at its time."""
    program = firmware.present(inputs.firmware[0])
    u, tau = told(numbers, pulsed_chip(chip), inputs, memory)
    mode, time, point = mode_under(as_now(numbers, inputs, memory), u, tau, memory), time_of(memory), memory.point
    write(screen, lines, inputs, told_of(memory, program), warm(as_now(numbers, inputs, memory), point.y), mode,
          piece_value(u, time), piece_value(tau, time), point.y, point.wiper, time)


def _see(screen: Screen, lines: Lines, inputs: Inputs, row: Row, m: Motion, time: float) -> Motion:
    """Write a row of a time [s] on a motion; return the motion, prepared for it."""
    if screen.used[0] >= len(screen.rows):
        return m
    local = time - row.origin
    age = local - m.t0
    if motion.is_step(m) and 0.0 < age < m.length:
        m = motion.prepared(m)
    y = motion.state(m, age)
    write(screen, lines, inputs, said_by(row), warm(m.numbers, y), m.mode, piece_value(m.u, local),
          piece_value(m.tau, local), y, wiper_at(m.numbers.sensor, row.wiper, y.q), time)
    return m


def _voltage_as_stood(numbers: Numbers, stood: Stood) -> float:
    """Return the voltage of the supply as a servo stood before its bridge switches."""
    memory, said = stood.memory, stood.said
    y, u = memory.point.y, piece_value(memory.u, time_of(memory))
    if duty.present(numbers.bridge):
        now = warm(duty.at_duty(numbers, said.duty), y)
        share = duty.share_of(numbers.bridge, said.duty)
    else:
        now, share = warm(at_pulses(numbers, said.silent), y), 1.0
    return bus_voltage(now, u, y.q, turning(now.elastic, y), y.i) / share


def _see_stood(screen: Screen, lines: Lines, inputs: Inputs, numbers: Numbers, stood: Stood) -> None:
    """Write a row of a servo as it stood before its bridge switches."""
    if screen.used[0] >= len(screen.rows):
        return
    memory, said = stood.memory, stood.said
    point = memory.point
    time = origin_of(memory) + point.time
    now = duty.at_duty(numbers, said.duty) if duty.present(numbers.bridge) else at_pulses(numbers, said.silent)
    write(screen, lines, inputs, said, warm(now, point.y), point.mode, piece_value(memory.u, time),
          piece_value(memory.tau, time), point.y, point.wiper, time)
