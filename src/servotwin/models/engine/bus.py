"""Several servos on one source, from event to event of all of them in one queue.

As long as at most one motor is connected to the bus every servo moves on its own, by the laws of one alone. Where
several are, they move together until one of them, its chip or the source does something else.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine import crew as hands
from servotwin.models.engine import currents, shared_source, step, tape, together
from servotwin.models.engine.crew import Crew
from servotwin.models.engine.memory import (
    FRAMES,
    SAME,
    Inputs,
    Memory,
    Point,
    counted_anew,
    due,
    in_force,
    instant,
    resumed,
    since,
    time_of,
)
from servotwin.models.engine.modes import Mode, Vector
from servotwin.models.engine.step import CHATTER, COMPLETED, CROWDED, MOST_IDLE, STEP_TOO_SMALL
from servotwin.models.engine.tape import Tape
from servotwin.models.engine.together import APART, ENDED, TOGETHER, Together
from servotwin.models.terms import frame
from servotwin.models.terms.bridge import heeds_silence, terminal_voltage
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import sensed_voltage, wiper_at
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import piece_value

PAUSED = -1  # as a status: the tape is full
_SPAN = 16.0  # s: then times count anew
_LONGEST = 1.0  # s, of a common motion: it may be one of constant speed without an end


def through(source: Source, numbers: list[Numbers], chips: list[Chip], inputs: list[Inputs], memories: list[Memory],
            ends: list[float], joined: list[int], shared: Any, written: Tape) -> tuple[int, float]:
    """Go on to the ends of all servos by their clocks [s]; return a status, and when since the start.

    Memories, places among those that move together, and `shared`, a record of `together.Shared`, are kept up to date.
    """
    for j in range(len(memories)):
        ends[j] = instant(True, inputs[j], memories[j], ends[j])
    status, when = COMPLETED, time_of(memories[0])
    while status == COMPLETED and memories[0].point.time < ends[0]:
        for j in range(len(memories)):
            memories[j] = resumed(True, inputs[j], memories[j], False)
            while due(memories[j]):
                shift = FRAMES * memories[j].beat
                memories[j], ends[j] = counted_anew(memories[j]), ends[j] - shift
                if j == 0:
                    shared.begin, shared.end = shared.begin - shift, shared.end - shift
        last = ends[0] <= memories[0].point.time + _SPAN
        stops = [ends[j] if last else memories[j].point.time + _SPAN for j in range(len(memories))]
        crew = hands.crew_of(source, numbers, chips, inputs, memories, stops)
        for j in range(len(joined)):
            crew.joined[j] = joined[j]
        status, time = run(crew, shared, written)
        when = crew.origins[0] + time
        for j in range(len(joined)):
            memories[j], joined[j] = hands.memory_of_unit(crew, j), crew.joined[j]
    return status, when


def run(crew: Crew, shared: Any, written: Tape) -> tuple[int, float]:
    """Go on to the end of the run, or until the tape is full; return a status and when, by the clock of the bus [s].

    `shared` is a record of `together.Shared`, brought up to date.
    """
    time, until, idle = crew.clocks[0], crew.ends[0], 0
    group = _taken_up(crew, shared)
    for j in range(len(crew.clocks)):
        hands.plan_ahead(crew, j)
    status = COMPLETED
    while time < until:
        if tape.is_full(written, len(crew.clocks)):
            status = PAUSED
            break
        status = _act(crew, group, written, time)
        if status != COMPLETED:
            return status, time
        group, status = _go_on(crew, shared, group, written, time)
        if status != COMPLETED:
            return status, time
        following = _next_time(crew, shared, until)
        idle = idle + 1 if following == time else 0
        if idle > MOST_IDLE * len(crew.clocks):
            return CHATTER, time
        time = following
        status = _come(crew, shared, group, written, time)
        if status != COMPLETED:
            return status, time
    for j in range(len(crew.clocks)):
        hands.bring(crew, j, group, time, written)
        if status == COMPLETED:
            status = step.status_of(crew.points[j].y)
    return status, time


def _taken_up(crew: Crew, shared: Any) -> Together:
    """Return the common motion that those who have joined are in, or one of nobody."""
    units = [j for j in range(len(crew.joined)) if crew.joined[j] >= 0]
    for j in units:
        if crew.points[j].anchor_time == math.inf:  # it is told something else since
            shared.phase = APART
    if shared.phase != TOGETHER:
        none = [j for j in units if j < 0]
        points = [crew.points[j] for j in none]
        return together.nobody(none, [hands.member_now(crew, 0, p) for p in points], [p.y for p in points])
    members = [hands.member_now(crew, j, crew.points[j]) for j in units]
    starts = [crew.points[j].anchor for j in units]
    return together.resumed(crew.source, shared, units, members, starts, shared.begin)


def _next_time(crew: Crew, shared: Any, until: float) -> float:
    """Return when anything happens next, by the clock of the bus [s]."""
    following = min(shared.end, until) if shared.phase == TOGETHER else until
    for j in range(len(crew.clocks)):
        following = min(following, crew.arrivals[j] if hands.is_known(crew.arrivals[j]) else crew.due[j])
    return following


def _come(crew: Crew, shared: Any, group: Together, written: Tape, time: float) -> int:
    """Let all clocks show a time of the bus [s], and those arrive that have got somewhere; return a status."""
    for j in range(len(crew.clocks)):
        if hands.is_known(crew.arrivals[j]) and crew.arrivals[j] <= time:
            crew.clocks[j] = crew.ahead[j].time
            hands.move(crew, j, group, crew.ahead[j], crew.events[j], written)
        else:
            hands.set_clock(crew, j, time)
    if shared.phase != TOGETHER or shared.end > time:
        return COMPLETED
    states = group.starts.copy()
    mode = together.arrive(crew.source, shared, group, states)
    for k in range(len(states)):
        y, j = states[k], group.units[k]
        if step.status_of(y) != COMPLETED:
            return step.status_of(y)
        p, own, t = crew.points[j], k == shared.whose, crew.clocks[j]
        wiper = wiper_at(crew.numbers[j].sensor, p.wiper, y[0])
        point = Point(t, y, mode if own else group.members[k].mode, t, y, p.step, wiper)
        hands.move(crew, j, group, point, shared.kind if own else -1, written)
    return COMPLETED


# --- what chips and loads do ------------------------------------------------------------------------------------------


def _act(crew: Crew, group: Together, written: Tape, time: float) -> int:
    """Do what is due at a time of the bus [s]: first switch, then measure; return a status."""
    busy = False
    for j in range(len(crew.clocks)):
        if crew.due[j] <= time:
            busy = True
            if crew.switches[j] <= crew.clocks[j]:
                _switch(crew, j, group, written, time)
    if busy:
        for j in range(len(crew.clocks)):
            if crew.due[j] <= time and hands.edge(crew, j) <= crew.clocks[j]:
                _measure(crew, j, group, written, time)
                if crew.decided[j].number == frame.CROWDED:
                    return CROWDED
                hands.plan_ahead(crew, j)
    return COMPLETED


def _switch(crew: Crew, j: int, group: Together, written: Tape, time: float) -> None:
    """Let a servo's bridge and load do what they do now."""
    hands.bring(crew, j, group, time, written)
    now = crew.clocks[j]
    hands.hear(crew, j, frame.switched(crew.decided[j], now), written)
    if crew.tau_ends[j] <= now:
        before, inputs = crew.taus[j], crew.inputs[j]
        crew.taus[j], crew.tau_ends[j] = in_force(inputs.torque, crew.origins[j], now, inputs.constant_torque)
        if crew.taus[j] != before:
            hands.forget(crew, j)
    hands.plan_ahead(crew, j)


def _measure(crew: Crew, j: int, group: Together, written: Tape, time: float) -> None:
    """Let a servo's chip measure at the edge of a pulse."""
    chip, inputs, now, origin = crew.chips[j], crew.inputs[j], crew.clocks[j], crew.origins[j]
    piece, _ = in_force(inputs.command, origin, now + SAME * crew.beats[j], 0.0)
    t_in = piece_value(since(piece, origin), now)
    here = hands.at_clock(crew, j, group, time)
    if not frame.accepted(chip, t_in):
        tape.write_event(written, j, origin + now, tape.REFUSED, Mode(0, 0, 0, 0), here.y[0])
    v_m, V_bus = 0.0, chip.V_oc
    if chip.beta != 0.0 or chip.c_s != 0.0:
        v_m, V_bus = _voltages(crew, j, group, here.y, time)
    v_o = sensed_voltage(crew.numbers[j].sensor, inputs.curve, here.wiper)
    before = crew.decided[j]
    after = frame.edge(chip, before, now, t_in, v_o, v_m, V_bus, inputs.seed)
    if after.silent != before.silent and heeds_silence(crew.numbers[j].bridge):
        hands.bring(crew, j, group, time, written)
    hands.hear(crew, j, after, written)


def _voltages(crew: Crew, j: int, group: Together, y: Vector, time: float) -> tuple[float, float]:
    """Return the voltages at a servo's motor and of the bus [V]."""
    own, drive = hands.numbers_now(crew, j), crew.decided[j].drive
    connected = [k for k in range(len(crew.clocks)) if hands.is_connected(crew, k)]
    if len(connected) == 0 or (len(connected) == 1 and connected[0] == j):
        return step.voltages(own, drive * own.source.V, y)
    if len(connected) == 1:
        k = connected[0]
        numbers = hands.numbers_now(crew, k)
        u = crew.decided[k].drive * numbers.source.V
        V_bus = step.voltages(numbers, u, hands.at_clock(crew, k, group, time).y)[1]
    else:
        points = [hands.at_clock(crew, k, group, time) for k in connected]
        members = [hands.member_now(crew, connected[n], points[n]) for n in range(len(connected))]
        V_bus = shared_source.put_in_zones(crew.source, members, [p.y for p in points], crew.source.V)[1]
    stiff = warm(shared_source.on_stiff_source(own, False), y)
    u = drive * V_bus
    zone = currents.zone_of(stiff, u, 0.0, y[0], y[6], y[2])
    i = y[2] if inductive(stiff.motor) else currents.current(stiff, zone, u, y[0], y[6])
    return terminal_voltage(stiff.bridge, stiff.source, stiff.motor, u, y[6], i, V_bus), V_bus


# --- motions ----------------------------------------------------------------------------------------------------------


def _go_on(crew: Crew, shared: Any, group: Together, written: Tape, time: float) -> tuple[Together, int]:
    """Take up motions where there are none, or no longer the right ones; return the common one, and a status."""
    status, kept, before = COMPLETED, True, False
    units = [j for j in range(len(crew.clocks)) if hands.is_connected(crew, j)]
    if len(units) < 2:
        units = [j for j in units if j < 0]
    place = 0
    for j in range(len(crew.clocks)):
        member = place < len(units) and units[place] == j
        place += 1 if member else 0
        kept = kept and member == (crew.joined[j] >= 0) and not (member and crew.points[j].anchor_time == math.inf)
        before = before or crew.joined[j] >= 0
    if (len(units) > 0 or before) and not (kept and shared.phase == TOGETHER):
        group = _regroup(crew, shared, group, units, kept and shared.phase == ENDED, written, time)
        if len(units) > 0 and group.length < 0.0:
            return group, STEP_TOO_SMALL
    for j in range(len(crew.clocks)):
        if crew.joined[j] < 0 and not hands.is_known(crew.arrivals[j]):
            how = hands.alone(crew, j)
            status = how if how != COMPLETED else status
    return group, status


def _regroup(crew: Crew, shared: Any, group: Together, units: list[int], same: bool, written: Tape,
             time: float) -> Together:
    """Let those who have joined leave, and others or the same move together from now on."""
    for j in range(len(crew.clocks)):
        if crew.joined[j] >= 0:
            hands.bring(crew, j, group, time, written)
            crew.joined[j] = -1
            if not same:
                hands.forget(crew, j)
    shared.phase = APART
    if len(units) == 0:
        return group
    limit = time + _LONGEST
    for j in units:
        hands.bring(crew, j, group, time, written)
        limit = min(limit, crew.switches[j] - crew.late[j])
    members = [hands.member_now(crew, j, crew.points[j]) for j in units]
    states = [crew.points[j].y for j in units]
    group = together.begin(crew.source, shared, units, members, states, time, max(limit, time), same)
    for k in range(len(units)):
        j, y = units[k], states[k]
        p, t = crew.points[j], crew.clocks[j]
        crew.points[j] = Point(t, y, group.members[k].mode, t, y, p.step, p.wiper)
        crew.joined[j], crew.arrivals[j] = k, math.nan
    return group
