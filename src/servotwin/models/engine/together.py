"""Servos whose motors are connected to one source at the same time: their common motion, and what ends it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine import contacts, dormand_prince, guards, joint_motion, shared_source
from servotwin.models.engine.joint_motion import NO_DENSE, ROOM, Dense, turns
from servotwin.models.engine.memory import FIRST_STEP
from servotwin.models.engine.modes import (
    BACKWARD,
    FORWARD,
    NO_CURRENT,
    RIGID,
    STUCK,
    Mode,
    Vector,
    sign_of,
)
from servotwin.models.engine.records import record_writer
from servotwin.models.engine.shared_source import Member
from servotwin.models.terms.friction import varying
from servotwin.models.terms.load import external_torque, springy
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import piece_rate, piece_value

_BELOW = -1e-13  # rounding is not an event
_BELOW_OF_SUM = -1e-10  # A: nor what the currents of all have gathered
_HALVINGS = 200
_LOOKS = (0.25, 0.5, 0.75, 1.0)  # parts of a motion at which its guards are looked at
_SOURCE_GUARDS = 2

# Of what servos on one source remember: they move each on its own, in common, or a common motion has just ended.
APART, TOGETHER, ENDED = range(3)


class Shared(NamedTuple):
    """What servos on one source remember besides what each does; times by the clock of the first of them [s]."""

    phase: int
    state: int  # what the source does
    jumped: int  # 1: the common motion has ended with a jump, so that zones have to be found anew
    whose: int  # event will end it, by number among those that move together; −1: the source's, or none
    kind: int
    voltage: float  # of the bus when it was worked out last
    step: float  # the next to try
    begin: float  # of the common motion
    length: float
    end: float


put_shared = record_writer("put_shared", Shared)


def at_start(source: Source) -> Shared:
    """Return what servos on a source remember when none has moved yet."""
    return Shared(APART, shared_source.FOLLOWING, 1, -1, -1, source.V, FIRST_STEP, 0.0, 0.0, math.inf)


class Together(NamedTuple):
    """A common motion: who moves, from where, and how."""

    units: list[int]
    members: list[Member]
    starts: list[Vector]
    ends: list[Vector]
    speed: list[float]  # coefficients of power series, `ROOM` for each
    current: list[float]
    dense: list[Dense]
    terms: int  # of the series; 0: it is a step
    begin: float  # by the clock of the bus [s]
    length: float


def begin(source: Source, shared: Any, units: list[int], members: list[Member], states: list[Vector], time: float,
          limit: float, same: bool) -> Together:
    """Return a common motion from `time` on, to `limit` at the latest [s].

    Its length is below 0 if no step is possible. The `same` members go on after an event of theirs that has already
    told zones and source. `shared` is kept up to date.
    """
    if same and shared.jumped == 0:
        shared.voltage = shared_source.bus_voltage(source, shared.state, members, states)
    else:
        state, voltage = shared_source.put_in_zones(source, members, states, shared.voltage)
        shared.state, shared.voltage = state, voltage
        for j in range(len(members)):
            members[j] = _settled(members[j], states[j], time, voltage)
    linear = _all_linear(members)
    tried = min(limit - time, joint_motion.longest_series(members) if linear else shared.step)
    group, following = moving(source, shared.state, units, members, states, time, tried, linear)
    if not linear:
        shared.step = max(shared.step, following) if group.length == limit - time else following
    shared.phase, shared.begin, shared.length = TOGETHER, time, group.length
    if group.length >= 0.0:
        _find_end(source, shared, group, limit)
    return group


def resumed(source: Source, shared: Any, units: list[int], members: list[Member], states: list[Vector],
            time: float) -> Together:
    """Return a common motion that began in these states, as it was."""
    group, _ = moving(source, shared.state, units, members, states, time, shared.length, _all_linear(members))
    return group


def nobody(units: list[int], members: list[Member], states: list[Vector]) -> Together:
    """Return a common motion of nobody; the lists are empty."""
    return Together(units, members, states, states, [0.0 for _ in range(0)], [0.0 for _ in range(0)],
                    [NO_DENSE for _ in range(0)], 0, 0.0, 0.0)


def _all_linear(members: list[Member]) -> bool:
    for j in range(len(members)):
        if not joint_motion.is_linear(members[j]):
            return False
    return True


def _settled(member: Member, y: Vector, time: float, voltage: float) -> Member:
    u = shared_source.behind(member, voltage)
    mode = guards.settled(member.numbers, member.mode.zone, u, piece_value(member.tau, time), y, member.mode.mesh,
                          False)
    return Member(member.numbers, mode, member.sign, member.tau, member.returns)


def moving(source: Source, state: int, units: list[int], members: list[Member], states: list[Vector], time: float,
           tried: float, linear: bool) -> tuple[Together, float]:
    """Return the motion of members in their modes for as long as was `tried` [s] or less, and the next step to try."""
    count = len(members)
    ends, dense = states.copy(), [NO_DENSE for _ in range(0)]
    if linear:
        speed, current = [0.0 for _ in range(count * ROOM)], [0.0 for _ in range(count * ROOM)]
        terms = joint_motion.series(source, state, members, states, time, tried, speed, current)
        group = Together(units, members, states, ends, speed, current, dense, terms, time, tried)
        for j in range(count):
            ends[j] = state_at(group, j, tried)
        return group, 0.0
    none = [0.0 for _ in range(0)]
    dense = [NO_DENSE for _ in range(count)]
    step = joint_motion.joint_step(source, state, members, states, time, tried, dense, ends)
    return Together(units, members, states, ends, none, none, dense, 0, time, step.length), step.following


def state_at(group: Together, j: int, s: float) -> Vector:
    """Return the state of a member at s [s] after the beginning."""
    start = group.starts[j]
    if group.terms == 0:
        if s >= group.length:
            return group.ends[j]
        return dormand_prince.interpolate(start, group.dense[j], s / group.length) if s > 0.0 else start
    q = w = i = 0.0
    for n in range(j * ROOM + group.terms - 1, j * ROOM - 1, -1):
        x = group.speed[n]
        w = w * s + x
        q = q * s + x / (n - j * ROOM + 1)
        i = i * s + group.current[n]
    q = start[0] + q * s
    member = group.members[j]
    if member.mode.mesh == RIGID:
        return (q, w, i, start[3], start[4], q, w)
    return with_motor(member.numbers.play, member.mode.mesh, (q, w, i, start[3], start[4], start[5], start[6]))


# --- what ends it -----------------------------------------------------------------------------------------------------


def _find_end(source: Source, shared: Any, group: Together, limit: float) -> None:
    """Find the first event of a member or of the source."""
    first, whose, which = group.length, -1, -1
    for j in range(len(group.members)):
        if group.terms > 0 and _is_calm(group, j):
            continue
        kinds = _kinds(group.members[j])
        for kind in range(guards.MOTOR_RELEASE_BACKWARD + 1):
            if kinds >> kind & 1:
                s = _crossing(source, shared.state, group, j, kind, first)
                if s < first or (s == first and which < 0):
                    first, whose, which = s, j, kind
    if source.I_max < math.inf:
        for kind in range(_SOURCE_GUARDS):
            s = _crossing(source, shared.state, group, -1, kind, first)
            if s < first:
                first, whose, which = s, -1, kind
    shared.end = limit if first >= limit - group.begin else group.begin + first
    shared.whose, shared.kind = whose, which


def _is_calm(group: Together, j: int) -> bool:
    """Tell by speed and current, and by how they change at both ends, that nothing ends a member's mode."""
    member, end = group.members[j], group.ends[j]
    numbers, mode = member.numbers, member.mode
    if mode.mesh != RIGID or mode.zone == NO_CURRENT or varying(numbers.friction):
        return False
    first, terms, length = j * ROOM, group.terms, group.length
    sign = sign_of(mode.zone)
    if sign != 0.0 and not _keeps_its_sign(group.current, first, terms, end[2], sign, length):
        return False
    if mode.contact == STUCK:
        i0, i1 = group.current[first], end[2]
        if (springy(numbers.load) or member.tau.slope != 0.0 or member.tau.amplitude != 0.0
                or turns(group.current, first, terms, length)):
            return False
        against = external_torque(numbers.load, member.tau.value, end[0])
        low, high = contacts.holding_bounds(numbers, 0.0, 0.0)
        return -low < numbers.motor.K * min(i0, i1) - against and numbers.motor.K * max(i0, i1) - against < high
    if mode.contact != FORWARD and mode.contact != BACKWARD:
        return False
    if not _keeps_its_sign(group.speed, first, terms, end[1], 1.0 if mode.contact == FORWARD else -1.0, length):
        return False
    return numbers.stops.lower < end[0] < numbers.stops.upper


def _keeps_its_sign(series: list[float], first: int, terms: int, end: float, sign: float, length: float) -> bool:
    leaves = sign * series[first] > 0.0 or (series[first] == 0.0 and sign * series[first + 1] > 0.0)
    return leaves and sign * end > 0.0 and not turns(series, first, terms, length)


def _kinds(member: Member) -> int:
    """Return which guards can end the mode of a member, as a sum of 1 << kind."""
    kinds = guards.guards(member.numbers, member.mode, member.sign, False)
    if member.returns and member.mode.zone == NO_CURRENT:  # its diodes block the other way
        kinds &= ~(1 << (guards.ZONE_UP if member.sign > 0.0 else guards.ZONE_DOWN))
    return kinds


def _crossing(source: Source, state: int, group: Together, j: int, kind: int, length: float) -> float:
    """Return when a guard falls below zero, at most `length` [s]; inf where it does not."""
    a, f_a = 0.0, _guard(source, state, group, j, kind, 0.0)
    below = _BELOW if j >= 0 else _BELOW_OF_SUM
    if f_a < below:  # what another member did has ended this mode too
        return 0.0
    b, f_b, falls = 0.0, 0.0, False
    for fraction in _LOOKS:
        b = fraction * length
        f_b = _guard(source, state, group, j, kind, b)
        falls = f_b < below
        if falls:
            break
    if not falls:
        return math.inf
    if f_a <= 0.0:  # it starts at zero, to rounding: look whether it rises before it falls
        half = 0.5
        for _ in range(1, 50):
            f_a = _guard(source, state, group, j, kind, b * half)
            if f_a > 0.0:
                a = b * half
                break
            half *= 0.5
        if f_a <= 0.0:
            return 0.0
    for _ in range(_HALVINGS):
        if b - a <= 2e-16 * (group.begin + b) or f_b == 0.0:
            break
        for s in (b - f_b * (b - a) / (f_b - f_a), 0.5 * (a + b)):
            if a < s < b:
                f = _guard(source, state, group, j, kind, s)
                if f > 0.0:
                    a, f_a = s, f
                else:
                    b, f_b = s, f
    return b


def _guard(source: Source, state: int, group: Together, j: int, kind: int, s: float) -> float:
    """Return a guard of a member, or (j < 0) of the source."""
    if j >= 0 and (kind == guards.SPEED or kind == guards.UPPER or kind == guards.LOWER):
        y = state_at(group, j, s)
        return guards.guard(group.members[j].numbers, group.members[j].mode, kind, 0.0, 0.0, 0.0, 0.0, y, y)[0]
    states = states_at(group, s)
    V = shared_source.bus_voltage(source, state, group.members, states)
    if j < 0:
        total = shared_source.drawn(source, V, group.members, states)
        guard, other = shared_source.source_guards(source, state, V, total)
        return guard if kind == 0 else other
    member, t, y = group.members[j], group.begin + s, states[j]
    return guards.guard(member.numbers, member.mode, kind, shared_source.behind(member, V), 0.0,
                        piece_value(member.tau, t), piece_rate(member.tau, t), y, y)[0]


def states_at(group: Together, s: float) -> list[Vector]:
    """Return the states of all members at s [s] after the beginning."""
    return [state_at(group, j, s) for j in range(len(group.members))]


def arrive(source: Source, shared: Any, group: Together, states: list[Vector]) -> Mode:
    """Take the members to the end of their common motion; return the mode of the one whose event it was.

    `states` get where they stand then.
    """
    whose, kind = shared.whose, shared.kind
    s = shared.end - group.begin
    for j in range(len(states)):
        states[j] = group.ends[j] if kind < 0 else state_at(group, j, s)
    if whose < 0 and kind >= 0:
        shared.state = shared_source.after(shared.state, kind)
    V = shared_source.bus_voltage(source, shared.state, group.members, states)
    shared.jumped = 1 if whose >= 0 and jumps(kind) else 0
    shared.voltage, shared.phase = V, ENDED
    if whose < 0:
        return Mode(0, 0, 0, 0)
    member = group.members[whose]
    mode, states[whose] = guards.cross(member.numbers, member.mode, kind, shared_source.behind(member, V),
                                       piece_value(member.tau, shared.end), states[whose])
    return Mode(shared_source.let_through(member, mode.zone), mode.contact, mode.mesh, mode.motor)


def jumps(kind: int) -> bool:
    """Tell whether an event may turn the signs of speeds and currents."""
    return (kind == guards.UPPER or kind == guards.LOWER or kind == guards.MEET_FORWARD or kind == guards.MEET_BACKWARD
            or kind == guards.SPEED)


