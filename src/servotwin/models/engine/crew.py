"""Servos on one source while they go on: what they are, where each stands, and what it does when left alone.

Each has a clock of its own, by which its frames come; the bus has that of the first. The end of a run, or of a
servo's present inputs, is the same instant by both clocks, however their difference is rounded.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine import motion, shared_source, step, tape, together
from servotwin.models.engine.memory import Inputs, Memory, Point, since
from servotwin.models.engine.modes import Mode
from servotwin.models.engine.shared_source import Member
from servotwin.models.engine.tape import Tape, Track
from servotwin.models.engine.together import Together
from servotwin.models.terms import frame
from servotwin.models.terms.bridge import coasts, heeds_silence
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.frame import Frame
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import Piece

_UNKNOWN = math.nan


class Crew(NamedTuple):
    """Servos on one source; lists have an entry for each."""

    source: Source
    numbers: list[Numbers]
    chips: list[Chip]
    inputs: list[Inputs]
    frames: list[int]  # where its clock counts from, as in `Memory`
    beats: list[float]
    origins: list[float]
    points: list[Point]
    decided: list[Frame]  # what its chip remembers
    taus: list[Piece]
    tau_ends: list[float]
    clocks: list[float]  # its time now
    late: list[float]  # by how much its clock is ahead of that of the bus
    ends: list[float]  # when the run is over, by its clock
    switches: list[float]  # when bridge or load change next, by its clock
    limits: list[float]  # when anything is to be done next, by its clock
    due: list[float]  # the same by the clock of the bus
    arrivals: list[float]  # when it has its next point, left alone, by the clock of the bus; nan: not found out
    ahead: list[Point]
    events: list[int]  # that it has there; −1: none
    tracks: list[Track]
    joined: list[int]  # its place among those that move together; −1: none


def crew_of(source: Source, numbers: list[Numbers], chips: list[Chip], inputs: list[Inputs], memories: list[Memory],
            ends: list[float]) -> Crew:
    """Return servos that stand where their memories say, for a run to `ends` by their clocks [s]."""
    count = len(numbers)
    points = [memories[j].point for j in range(count)]
    first = points[0].time
    return Crew(
        source, numbers, chips, inputs, [memories[j].frames for j in range(count)],
        [memories[j].beat for j in range(count)], [memories[j].frames * memories[j].beat for j in range(count)],
        points, [memories[j].chip for j in range(count)], [memories[j].tau for j in range(count)],
        [memories[j].tau_end for j in range(count)], [points[j].time for j in range(count)],
        [points[j].time - first for j in range(count)], ends, [0.0 for _ in range(count)],
        [0.0 for _ in range(count)], [0.0 for _ in range(count)], [_UNKNOWN for _ in range(count)],
        [points[j] for j in range(count)], [-1 for _ in range(count)],
        [Track(motion.REST, math.inf, points[j].y, 0.0) for j in range(count)], [-1 for _ in range(count)])


def memory_of_unit(crew: Crew, j: int) -> Memory:
    """Return what a servo remembers."""
    u = step.source(crew.numbers[j], crew.decided[j])
    return Memory(crew.frames[j], crew.beats[j], crew.points[j], crew.decided[j], u, math.inf, crew.taus[j],
                  crew.tau_ends[j])


def is_known(arrival: float) -> bool:
    """Tell whether it is known when a servo has its next point."""
    return arrival == arrival


def numbers_now(crew: Crew, j: int) -> Numbers:
    """Return the numbers of a servo with its bridge as it is now."""
    return step.at_pulses(crew.numbers[j], crew.decided[j].silent)


def is_connected(crew: Crew, j: int) -> bool:
    """Tell whether a motor is connected to the bus, or may become so by itself."""
    if crew.decided[j].drive != 0.0:
        return True
    y = crew.points[j].y
    return (y[2] != 0.0 or y[6] != 0.0) and coasts(numbers_now(crew, j).bridge)


def tau_of(crew: Crew, j: int) -> Piece:
    """Return the torque of a servo's load that depends on time alone, by its clock."""
    return since(crew.taus[j], crew.origins[j]) if crew.origins[j] != 0.0 else crew.taus[j]


def by_bus(crew: Crew, j: int, time: float) -> float:
    """Return when it is this time by a servo's clock, by that of the bus, the end of the run at the latest [s]."""
    until = crew.ends[0]
    return until if time >= crew.ends[j] else min(time - crew.late[j], until)


def set_clock(crew: Crew, j: int, time: float) -> None:
    """Set a servo's clock to a time of the bus [s]."""
    if time >= crew.ends[0]:
        crew.clocks[j] = crew.ends[j]
    elif crew.due[j] <= time:
        crew.clocks[j] = max(crew.clocks[j], crew.limits[j])
    else:
        crew.clocks[j] = time + crew.late[j]


def edge(crew: Crew, j: int) -> float:
    """Return when its next frame begins, by its clock [s]."""
    inputs, number = crew.inputs[j], crew.decided[j].number
    if inputs.period > 0.0:
        return frame.edge_time(inputs.period, inputs.edges, number - crew.frames[j])
    return frame.edge_time(inputs.period, inputs.edges, number) - crew.origins[j]


def plan_ahead(crew: Crew, j: int) -> None:
    """Find out when chip and load do something next."""
    switch = frame.next_switch(crew.decided[j], heeds_silence(crew.numbers[j].bridge))
    crew.switches[j] = min(switch, crew.tau_ends[j])
    crew.limits[j] = min(crew.switches[j], edge(crew, j))
    crew.due[j] = by_bus(crew, j, crew.limits[j])


def forget(crew: Crew, j: int) -> None:
    """Let the motion of a servo begin anew."""
    p = crew.points[j]
    crew.points[j] = Point(p.time, p.y, p.mode, math.inf, p.anchor, p.step, p.wiper)
    crew.arrivals[j] = _UNKNOWN


def alone(crew: Crew, j: int) -> int:
    """Find out what a servo does next when no other motor is connected to the bus; return a status."""
    numbers, tau, point = numbers_now(crew, j), tau_of(crew, j), crew.points[j]
    u = step.source(numbers, crew.decided[j])
    if point.anchor_time == math.inf:
        point = step.anchored(numbers, u, tau, point.time, point)
        crew.points[j] = point
    after, m, event, status = step.onward(
        numbers, point, u, tau, motion.nothing(numbers, u, tau), True, crew.limits[j], crew.ends[j])
    crew.ahead[j], crew.events[j], crew.tracks[j] = after, event, tape.track_of(m)
    crew.arrivals[j] = by_bus(crew, j, after.time)
    return status


def at_clock(crew: Crew, j: int, group: Together, time: float) -> Point:
    """Return where a servo stands now, which is `time` by the clock of the bus [s]."""
    p, numbers, t = crew.points[j], crew.numbers[j], crew.clocks[j]
    if t <= p.time:
        return p
    if crew.joined[j] >= 0:
        y = together.state_at(group, crew.joined[j], time - group.begin)
    else:
        numbers = numbers_now(crew, j)
        u = step.source(numbers, crew.decided[j])
        m = motion.prepared(motion.begin(numbers, p.mode, u, tau_of(crew, j), p.anchor_time, p.anchor, p.step,
                                         crew.limits[j] - p.anchor_time))
        y = motion.state(m, t - m.t0)
    return Point(t, y, p.mode, p.anchor_time, p.anchor, p.step, wiper_at(numbers.sensor, p.wiper, y[0]))


def move(crew: Crew, j: int, group: Together, point: Point, event: int, written: Tape) -> None:
    """Let a servo go on its present motion to a point, where an event may be."""
    before = crew.points[j]
    if tape.runs(written) and point.time > before.time:
        u, tau, origin, now = crew.numbers[j].source.V * crew.decided[j].drive, tau_of(crew, j), crew.origins[j], (
            crew.decided[j])
        if crew.joined[j] >= 0:
            tape.write_together(written, j, origin, before, point.time, now, u, tau, group, crew.joined[j])
        else:
            tape.write_alone(written, j, origin, before, point.time, now, u, tau, crew.tracks[j])
    if event >= 0:
        tape.write_event(written, j, crew.origins[j] + point.time, event, point.mode, point.y[0])
    crew.points[j], crew.arrivals[j] = point, _UNKNOWN


def bring(crew: Crew, j: int, group: Together, time: float, written: Tape) -> None:
    """Let a servo go on its present motion to where it stands now."""
    move(crew, j, group, at_clock(crew, j, group, time), -1, written)


def hear(crew: Crew, j: int, now: Frame, written: Tape) -> None:
    """Take another state of a servo's chip from now on."""
    before, angle, time = crew.decided[j], crew.points[j].y[0], crew.origins[j] + crew.clocks[j]
    heeds = heeds_silence(crew.numbers[j].bridge)
    crew.decided[j] = now
    nothing = Mode(0, 0, 0, 0)
    if now.drive != before.drive:
        tape.write_event(written, j, time, tape.DRIVES + int(now.drive), nothing, angle)
    if heeds and now.silent != before.silent:
        tape.write_event(written, j, time, tape.SILENCE + now.silent, nothing, angle)
    if now.drive != before.drive or (heeds and now.silent != before.silent):
        forget(crew, j)


def member_now(crew: Crew, j: int, point: Point) -> Member:
    """Return a servo that is connected to the bus and stands at a point, by the clock of the bus."""
    drive = crew.decided[j].drive
    stiff = shared_source.on_stiff_source(numbers_now(crew, j), drive == 0.0)
    tau = since(crew.taus[j], crew.origins[j] + crew.late[j])
    return shared_source.member_of(stiff, point.mode, drive, tau, point.y)


def bus_voltage(crew: Crew) -> float:
    """Return V_bus [V] under all the currents of servos that stand where their points say."""
    units = [j for j in range(len(crew.points)) if is_connected(crew, j)]
    members, states = [member_now(crew, j, crew.points[j]) for j in units], [crew.points[j].y for j in units]
    return shared_source.put_in_zones(crew.source, members, states, crew.source.V)[1]
