"""A servo on its own goes on for a stretch of time, and is looked at on the way."""

from __future__ import annotations

from servotwin.models.engine import controller
from servotwin.models.engine.events import guards
from servotwin.models.engine.legs.legs import MOST_SHORT
from servotwin.models.engine.live.screen import (
    HELD,
    NEXT,
    REFUSED,
    SILENCE,
    TOO_LONG,
    TRIPS,
    Lines,
    Looks,
    Said,
    Screen,
    Switch,
    code_of,
    is_late,
    note,
    reached,
    see,
    see_before,
    switch_of,
    told_of,
    write,
)
from servotwin.models.engine.memory import Inputs, Memory, counted_anew, due, instant, origin_of, resumed, time_of
from servotwin.models.engine.motions import motion
from servotwin.models.engine.runs import as_now, calmed, is_short, mode_under, told
from servotwin.models.engine.step import CHATTER, COMPLETED, MOST_IDLE, pulse_width, step
from servotwin.models.terms import firmware, frame, play
from servotwin.models.terms.bridge import heeds_silence
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.chip import present as pulsed_chip
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.pieces import piece_value

PLAIN = True  # the compiler takes it for False


def go_on(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, changed: bool, was: Switch, looks: Looks,
          lines: Lines, screen: Screen) -> tuple[Memory, Switch, int]:
    """Go on to `looks.until`; return the memory, how the bridge drives there, and a status.

    `changed` is whether the servo is another one than before, `was` how its bridge drove at the end of the stretch
    before. After a status that is not `COMPLETED` the memory is that of before what went wrong.
    """
    program, pulsed = firmware.present(inputs.firmware[0]), pulsed_chip(chip)
    memory = resumed(pulsed, inputs, memory, changed)
    if program:
        controller.resume(inputs, memory)
    end = instant(pulsed, inputs, memory, looks.until - origin_of(memory))
    m = motion.nothing(numbers, memory.u, memory.tau)
    idle, short, k = 0, 0, looks.next
    wiper = memory.point.wiper
    shown = told_of(memory, program)
    while memory.point.time < end:
        if due(memory):
            memory = counted_anew(memory)
            end = instant(pulsed, inputs, memory, looks.until - origin_of(memory))
        before, wiper, said = memory, memory.point.wiper, shown
        memory, m, event, status = step(numbers, chip, inputs, before, m, end)
        if status != COMPLETED:
            return before, was, status
        idle = idle + 1 if memory.point.time == before.point.time else 0
        if idle > MOST_IDLE:
            return before, was, CHATTER
        if is_late(screen.used, 0):
            return before, was, TOO_LONG
        if PLAIN:
            screen.rows.tell(time_of(memory))
        shown = told_of(memory, program)
        _note_doings(chip, inputs, numbers, before, said, memory, shown, screen)
        if memory.point.time > before.point.time:
            now = switch_of(shown)
            if looks.switches == 1 and now != was and was.silent >= 0:
                start = time_of(before)
                see_before(screen, lines, inputs, numbers, before, said)
                m = see(screen, lines, inputs, memory, shown, m, wiper, start)
                k = k + 1 if k / looks.rate == start else k
            was = now
            time = k / looks.rate
            while time < looks.until and reached(inputs, memory, time, program):
                m = see(screen, lines, inputs, memory, shown, m, wiper, time)
                k += 1
                time = k / looks.rate
        if event >= 0 and event != guards.SHARE and event != guards.CREEPS:
            note(screen, time_of(memory), code_of(event, memory.point.mode))
        short = short + 1 if play.present(numbers.play) and is_short(before, memory, event) else 0
        if short >= MOST_SHORT:
            memory, held = calmed(numbers, chip, inputs, memory)
            if held > 0:
                note(screen, time_of(memory), HELD)
    if m.kind == motion.IMPOSSIBLE:  # it had arrived before
        screen.used[NEXT] = k
        return memory, was, COMPLETED
    time = k / looks.rate
    while time < looks.until and (looks.at_end == 1 or not program):  # next to the end
        m = see(screen, lines, inputs, memory, shown, m, wiper, time)
        k += 1
        time = k / looks.rate
    if looks.at_end == 1:
        see(screen, lines, inputs, memory, shown, m, wiper, looks.until)
    screen.used[NEXT] = k
    if program:
        controller.pause(inputs, memory)
    return memory, was, COMPLETED


def look(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, lines: Lines, screen: Screen) -> None:
    """Write a row of a servo as it stands, before anything happens at its time."""
    program = firmware.present(inputs.firmware[0])
    u, tau = told(numbers, pulsed_chip(chip), inputs, memory)
    mode, time, point = mode_under(as_now(numbers, inputs, memory), u, tau, memory), time_of(memory), memory.point
    write(screen, lines, inputs, told_of(memory, program), warm(as_now(numbers, inputs, memory), point.y), mode,
          piece_value(u, time), piece_value(tau, time), point.y, point.wiper, time)


def _note_doings(chip: Chip, inputs: Inputs, numbers: Numbers, before: Memory, said: Said, memory: Memory, told: Said,
                 screen: Screen) -> None:
    """Note what a chip or a program has done in a step that people are told of."""
    time = time_of(before)
    if heeds_silence(numbers.bridge) and told.silent != said.silent:
        note(screen, time, SILENCE + told.silent)
    if memory.chip.number > before.chip.number and pulsed_chip(chip) and not frame.accepted(
            chip, pulse_width(inputs, before)):
        note(screen, time, REFUSED)
    if told.trip != said.trip:
        note(screen, time, TRIPS + told.trip)
