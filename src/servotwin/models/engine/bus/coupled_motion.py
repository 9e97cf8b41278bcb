"""Servos whose motors are connected to one source at the same time: their common motion, and what ends it.

The functions take records of `bus_records.Mate`, of which the first `shared.members` move together.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.bus import coupled_step
from servotwin.models.engine.bus.bus_records import (
    Shared,
    mode_of,
    numbers_of,
    piece_of,
    put_mode,
    source_of,
    vector_of,
)
from servotwin.models.engine.bus.coupled_step import turns
from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.events import crossings
from servotwin.models.engine.memory import FIRST_STEP, FLAT, NOT_ASKED, Lowest, put_vector
from servotwin.models.engine.motions import stribeck
from servotwin.models.engine.motions.motion import LONG_STEP
from servotwin.models.engine.run.lowest import ROUNDS, lower
from servotwin.models.state.modes import BACKWARD, FORWARD, NO_CURRENT, RIGID, STUCK, Mode, Vector, sign_of
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import piece_rate, piece_value

_BELOW = -1e-13  # rounding is not an event
_BELOW_OF_SUM = -1e-10  # A: nor what the currents of all have gathered
_HALVINGS = 200
_NEAR, _TURNINGS = 1e-6, 24  # of the time between two looks: to tell whether a guard rises; halvings to where it turns
_MOST_SERIES = 1e6  # one after the other
_LOOKS = (0.25, 0.5, 0.75, 1.0)  # parts of a motion at which its guards are looked at
_SOURCE_GUARDS = 2
_PARTS = 8  # of a common motion: it is short beside what happens in it

# They move each on its own, in common, or a common motion has just ended.
APART, TOGETHER, ENDED = range(3)


def at_start(source: Source) -> Shared:
    """Return what servos on a source remember when none has moved yet."""
    return Shared(APART, coupled_step.FOLLOWING, 1, -1, -1, 0, coupled_step.BY_SERIES, 0, source.V, FIRST_STEP, 0.0,
                  0.0, math.inf, source, NOT_ASKED)


def begin(shared: Any, mates: Any, time: float, limit: float, same: bool) -> None:
    """Begin a common motion at `time`, to `limit` at the latest [s]; its length is below 0 if it cannot be followed.

    The `same` mates continue after an event of theirs that has already determined zones and source.
    """
    source, count = source_of(shared.source), shared.members
    _look_at_start(mates, count)
    if same and shared.jumped == 0:
        shared.voltage = coupled_step.bus_voltage(source, shared.state, mates, count)
    else:
        state, voltage = coupled_step.put_in_zones(source, mates, count, shared.voltage)
        shared.state, shared.voltage = state, voltage
        for k in range(count):
            _settle(mates[k], time, voltage)
    shared.begin, shared.phase, shared.how = time, TOGETHER, coupled_step.kind_of(mates, count)
    if shared.how == LONG_STEP:
        most = min(limit - time, _longest_step(shared, mates))
        shared.length = min(most, shared.step)
        following = _move(shared, mates)
        shared.step = max(shared.step, following) if shared.length == most else following
    else:
        longest = coupled_step.longest_series(mates, count)
        shared.length = min(limit - time, longest) if limit - time <= _MOST_SERIES * longest else -1.0
        _move(shared, mates)
    if shared.length >= 0.0:
        _find_end(source, shared, mates, limit)


def _longest_step(shared: Any, mates: Any) -> float:
    """Return the time [s] beyond which a common step would not see the friction of a mate fade."""
    longest = math.inf
    for k in range(shared.members):
        mate = mates[k]
        tau = piece_value(piece_of(mate.tau), shared.begin)
        longest = min(longest, stribeck.longest_step(numbers_of(mate.numbers), mode_of(mate.mode),
                                                     coupled_step.behind(mate, shared.voltage), tau,
                                                     vector_of(mate.start)))
    return longest


def resume(shared: Any, mates: Any) -> None:
    """Take up a common motion again, as it was."""
    _look_at_start(mates, shared.members)
    _move(shared, mates)


def _look_at_start(mates: Any, count: int) -> None:
    for k in range(count):
        put_vector(mates[k].y, vector_of(mates[k].start))


def _settle(mate: Any, time: float, voltage: float) -> None:
    mode, y = mode_of(mate.mode), vector_of(mate.start)
    put_mode(mate.mode, guards.settled(numbers_of(mate.numbers), mode.zone, coupled_step.behind(mate, voltage),
                                       piece_value(piece_of(mate.tau), time), y, mode.mesh, False))


def _move(shared: Any, mates: Any) -> float:
    """Work out the motion of mates in their modes for its length [s] or less; return the next step to try."""
    source, count = source_of(shared.source), shared.members
    if shared.how == LONG_STEP:
        step = coupled_step.joint_step(source, shared.state, mates, count, shared.begin, shared.length)
        shared.terms, shared.length = 0, step.length
        return step.following
    shared.terms = coupled_step.series(source, shared.state, mates, count, shared.begin, shared.length)
    for k in range(count):
        put_vector(mates[k].end, state_at(shared, mates[k], shared.length))
    return 0.0


def state_at(shared: Any, mate: Any, s: float) -> Vector:
    """Return the state of a mate at s [s] after the beginning."""
    start = vector_of(mate.start)
    if shared.how == LONG_STEP:
        if s >= shared.length:
            return vector_of(mate.end)
        return coupled_step.between(mate, s / shared.length) if s > 0.0 else start
    q = w = i = 0.0
    speed, current = mate.speed, mate.current
    for n in range(shared.terms - 1, -1, -1):
        x = speed[n]
        w = w * s + x
        q = q * s + x / (n + 1)
        i = i * s + current[n]
    q = start.q + q * s
    if mate.mode.mesh == RIGID:
        return Vector(q, w, i, start.T_w, start.T_h, q, w)
    y = Vector(q, w, i, start.T_w, start.T_h, start.q_m, start.w_m)
    return with_motor(numbers_of(mate.numbers).play, mate.mode.mesh, y)


# --- what ends it -----------------------------------------------------------------------------------------------------


def _find_end(source: Source, shared: Any, mates: Any, limit: float) -> None:
    """Find the first event of a mate or of the source."""
    first, whose, which = shared.length, -1, -1
    for j in range(shared.members):
        if shared.how != LONG_STEP and _is_calm(shared, mates[j]):
            continue
        kinds = _kinds(mates[j])
        for kind in range(guards.KINDS):
            if kinds >> kind & 1:
                s = _crossing(source, shared, mates, j, kind, first)
                if s < first or (s == first and which < 0):
                    first, whose, which = s, j, kind
    if source.I_max < math.inf:
        for kind in range(_SOURCE_GUARDS):
            s = _crossing(source, shared, mates, -1, kind, first)
            if s < first:
                first, whose, which = s, -1, kind
    shared.end = limit if first >= limit - shared.begin else shared.begin + first
    shared.whose, shared.kind = whose, which


def _is_calm(shared: Any, mate: Any) -> bool:
    """Tell by speed and current, and by how they change at both ends, that nothing ends a mate's mode."""
    mode, end, terms, length = mode_of(mate.mode), mate.end, shared.terms, shared.length
    if mode.mesh != RIGID or mode.zone == NO_CURRENT or mate.numbers.friction.varies > 0.0:
        return False
    sign = sign_of(mode.zone)
    if sign != 0.0 and not _keeps_its_sign(mate.current, terms, end.i, sign, length):
        return False
    if mode.contact == STUCK:
        return _holds(mate, terms, length)
    if mode.contact != FORWARD and mode.contact != BACKWARD:
        return False
    if not _keeps_its_sign(mate.speed, terms, end.w, 1.0 if mode.contact == FORWARD else -1.0, length):
        return False
    return bool(mate.numbers.stops.lower < end.q < mate.numbers.stops.upper)


def _holds(mate: Any, terms: int, length: float) -> bool:
    """Tell that a mate stays stuck."""
    i0, i1 = mate.current[0], mate.end.i
    if (mate.numbers.load.stiffness != 0.0 or mate.tau.slope != 0.0 or mate.tau.amplitude != 0.0
            or turns(mate.current, terms, length)):
        return False
    numbers = numbers_of(mate.numbers)
    against = external_torque(numbers.load, mate.tau.value, mate.end.q)
    low, high = contacts.holding_bounds(numbers, 0.0, 0.0)
    return bool(-low < numbers.motor.K * min(i0, i1) - against and numbers.motor.K * max(i0, i1) - against < high)


def _keeps_its_sign(series: Any, terms: int, end: float, sign: float, length: float) -> bool:
    leaves = sign * series[0] > 0.0 or (series[0] == 0.0 and sign * series[1] > 0.0)
    return leaves and sign * end > 0.0 and not turns(series, terms, length)


def _kinds(mate: Any) -> int:
    """Return which guards can end the mode of a mate, as a sum of 1 << kind."""
    numbers, mode = numbers_of(mate.numbers), mode_of(mate.mode)
    kinds = guards.guards(numbers, mode, mate.sign, False)
    if guards.creeping(numbers, mode, vector_of(mate.start)):
        kinds &= ~(1 << guards.CREEPS)
    if mate.returns > 0 and mode.zone == NO_CURRENT:  # its diodes block the other way
        kinds &= ~(1 << (guards.ZONE_UP if mate.sign > 0.0 else guards.ZONE_DOWN))
    return kinds


def _crossing(source: Source, shared: Any, mates: Any, j: int, kind: int, length: float) -> float:
    """Return when a guard falls below zero, at most `length` [s]; inf where it does not."""
    a, f_a = 0.0, _guard(source, shared, mates, j, kind, 0.0)
    below = _BELOW if j >= 0 else _BELOW_OF_SUM
    if f_a < below:  # what another one did has ended this mode too
        return 0.0
    b, f_b, falls, before = 0.0, 0.0, False, f_a
    for fraction in _LOOKS:
        first, b = b, fraction * length
        f_b = _guard(source, shared, mates, j, kind, b)
        falls = f_b < below
        if not falls:
            low = _lowest(source, shared, mates, j, kind, first, before, b, f_b)
            f_low = _guard(source, shared, mates, j, kind, low) if low > first else f_b
            falls = f_low < below
            if falls:
                b, f_b = low, f_low
        if falls:
            break
        before = f_b
    if not falls:
        return math.inf
    if f_a <= 0.0:  # it starts at zero, to rounding: look whether it rises before it falls
        half = 0.5
        for _ in range(1, 50):
            f_a = _guard(source, shared, mates, j, kind, b * half)
            if f_a > 0.0:
                a = b * half
                break
            half *= 0.5
        if f_a <= 0.0:
            return 0.0
    for _ in range(_HALVINGS):
        if b - a <= 2e-16 * (shared.begin + b) or f_b == 0.0:
            break
        for s in (b - f_b * (b - a) / (f_b - f_a), 0.5 * (a + b)):
            if a < s < b:
                f = _guard(source, shared, mates, j, kind, s)
                if f > 0.0:
                    a, f_a = s, f
                else:
                    b, f_b = s, f
    return b


def _lowest(source: Source, shared: Any, mates: Any, j: int, kind: int, a: float, f_a: float, b: float,
            f_b: float) -> float:
    """Return where in [a, b] a guard is lowest that falls at a and rises at b; a where it does not turn so."""
    step = _NEAR * (b - a)
    after = _guard(source, shared, mates, j, kind, a + step)
    if after >= f_a:
        return a
    before = _guard(source, shared, mates, j, kind, b - step)
    if before >= f_b:
        return a
    low, high = a, b
    for _ in range(_TURNINGS):
        middle = 0.5 * (low + high)
        here = _guard(source, shared, mates, j, kind, middle)
        after = _guard(source, shared, mates, j, kind, middle + step)
        if after < here:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _guard(source: Source, shared: Any, mates: Any, j: int, kind: int, s: float) -> float:
    """Return a guard of a mate, or (j < 0) of the source."""
    if j < 0:
        look(shared, mates, s)
        V = coupled_step.bus_voltage(source, shared.state, mates, shared.members)
        total = coupled_step.drawn(V, mates, shared.members)
        guard, other = coupled_step.source_guards(source, shared.state, V, total)
        return guard if kind == 0 else other
    mate, u, t = mates[j], 0.0, shared.begin + s
    if kind == guards.SPEED or kind == guards.UPPER or kind == guards.LOWER:
        put_vector(mate.y, state_at(shared, mate, s))
    else:
        look(shared, mates, s)
        u = coupled_step.behind(mate, coupled_step.bus_voltage(source, shared.state, mates, shared.members))
    tau, y = piece_of(mate.tau), vector_of(mate.y)
    return guards.guard(numbers_of(mate.numbers), mode_of(mate.mode), kind, u, 0.0, piece_value(tau, t),
                        piece_rate(tau, t), y, y)[0]


def look(shared: Any, mates: Any, s: float) -> None:
    """Put all mates where they are at s [s] after the beginning."""
    for k in range(shared.members):
        put_vector(mates[k].y, state_at(shared, mates[k], s))


def lowest_between(lowest: Lowest, shared: Any, mates: Any, origin: float, a: float, b: float) -> Lowest:
    """Return the least voltage of the bus after a common motion has advanced, from a to b [s] after its beginning.

    Its times are those since `origin` [s].
    """
    step, here, slack = (b - a) / _PARTS, _voltage_at(shared, mates, a), 0.0
    before, least, at = here, here, a
    for n in range(1, _PARTS + 1):
        before, here = here, _voltage_at(shared, mates, a + n * step)
        slack = max(slack, abs(here - before))
        if here < least:
            least, at = here, a + n * step
    if least - slack < lowest.voltage:
        low, high = max(at - step, a), min(at + step, b)
        for _ in range(ROUNDS):
            third = (high - low) / 3.0
            one = _voltage_at(shared, mates, low + third)
            other = _voltage_at(shared, mates, high - third)
            if one < other:
                high -= third
            else:
                low += third
        other = _voltage_at(shared, mates, 0.5 * (low + high))
        if other < least:
            least, at = other, 0.5 * (low + high)
    if not least < lowest.level - FLAT:
        return lower(lowest, least, origin + at)
    low, high = a, at
    for _ in range(ROUNDS):  # to when it has fallen so far
        middle = 0.5 * (low + high)
        if _voltage_at(shared, mates, middle) <= least + FLAT:
            high = middle
        else:
            low = middle
    return Lowest(least, least, origin + high)


def _voltage_at(shared: Any, mates: Any, s: float) -> float:
    """Return V_bus [V] at s [s] after the beginning."""
    look(shared, mates, s)
    return coupled_step.bus_voltage(source_of(shared.source), shared.state, mates, shared.members)


def arrive(shared: Any, mates: Any) -> Mode:
    """Take the mates to the end of their common motion; return the mode of the one whose event it was."""
    source, count, whose, kind = source_of(shared.source), shared.members, shared.whose, shared.kind
    if kind < 0:
        for k in range(count):
            put_vector(mates[k].y, vector_of(mates[k].end))
    else:
        look(shared, mates, shared.end - shared.begin)
    if whose < 0 and kind >= 0:
        shared.state = coupled_step.after(shared.state, kind)
    V = coupled_step.bus_voltage(source, shared.state, mates, count)
    shared.jumped = 1 if whose >= 0 and jumps(kind) else 0
    shared.voltage, shared.phase = V, ENDED
    if whose < 0:
        return mode_of(mates[0].mode)
    mate = mates[whose]
    numbers = numbers_of(mate.numbers)
    if mate.returns > 0 and mate.mode.zone == NO_CURRENT:  # teeth that meet would part by a torque that there is not
        numbers = currents.blocked(numbers)
    mode, y = crossings.cross(numbers, mode_of(mate.mode), kind, coupled_step.behind(mate, V),
                           piece_value(piece_of(mate.tau), shared.end), vector_of(mate.y))
    put_vector(mate.y, y)
    return Mode(coupled_step.let_through(mate, mode.zone), mode.contact, mode.mesh, mode.motor, mode.share)


def jumps(kind: int) -> bool:
    """Tell whether an event may turn the signs of speeds and currents."""
    return (kind == guards.UPPER or kind == guards.LOWER or kind == guards.MEET_FORWARD or kind == guards.MEET_BACKWARD
            or kind == guards.SPEED)
