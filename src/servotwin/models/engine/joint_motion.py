"""How servos on one source move together: all linear, as power series exact to rounding; else by one explicit step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from servotwin.models.engine import contacts, dormand_prince
from servotwin.models.engine.dormand_prince import STAGES
from servotwin.models.engine.modes import (
    BACKWARD,
    FORWARD,
    INSIDE,
    NO_CURRENT,
    NOWHERE,
    RIGID,
    STUCK,
    Vector,
    at_rest,
    sign_of,
)
from servotwin.models.engine.motion import Motion
from servotwin.models.engine.rates import rates_of
from servotwin.models.engine.shared_source import (
    BROKEN_DOWN,
    FOLLOWING,
    KEEPING,
    LIMITED,
    Member,
    behind,
    bus_voltage,
)
from servotwin.models.terms import heat
from servotwin.models.terms.friction import varying
from servotwin.models.terms.load import external_torque, springy, swings
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import piece_value

_MOST_TERMS = 40
_LONGEST = 1.5  # of a series, in times of its fastest rate
_TOLERANCE = 1e-12  # error of one step, relative to 1 + |state|


def is_linear(member: Member) -> bool:
    """Tell whether a member moves by linear laws."""
    numbers, mode = member.numbers, member.mode
    return (not heat.present(numbers.heat) and not swings(numbers.load) and mode.mesh != INSIDE
            and (not varying(numbers.friction) or at_rest(mode.contact)))


def fastest_rate(members: Sequence[Member]) -> float:
    """Return the fastest rate [1/s] of linear members."""
    rate = 0.0
    for numbers, mode, _, _, _ in members:
        own, body, R = numbers.motor, numbers.shaft, numbers.bridge.R_drive
        one = body.b / body.J + math.sqrt(numbers.load.stiffness / body.J)
        if mode.zone != NO_CURRENT:
            one += R / own.L if own.L > 0.0 else own.K * own.K_b / (R * body.J)
            one += math.sqrt(own.K * own.K_b / (own.L * body.J)) if own.L > 0.0 else 0.0
        rate = max(rate, one)
    return rate


def longest_series(members: Sequence[Member]) -> float:
    """Return how long a series holds [s]."""
    rate = fastest_rate(members)
    return _LONGEST / rate if rate > 0.0 else math.inf


class Series(NamedTuple):
    """Coefficients of speed and current of a member in powers of time."""

    speed: tuple[float, ...]
    current: tuple[float, ...]


def series(source: Source, state: int, members: Sequence[Member], states: Sequence[Vector], time: float,
           length: float) -> list[Series]:
    """Return the motion of linear members from `time` on, for at most `length` [s]."""
    terms = [_linear(m, y, time) for m, y in zip(members, states, strict=True)]
    if all(t.L == 0.0 and t.stiffness == 0.0 and t.slope == 0.0 for t in terms):
        return _plain_series(source, state, members, terms, states, length)
    speeds = [[0.0 if at_rest(m.mode.contact) else y[1]] for m, y in zip(members, states, strict=True)]
    angles = [y[0] for y in states]
    currents = [[y[2]] if inductive(m.numbers.motor) else [] for m, y in zip(members, states, strict=True)]
    for n in range(_MOST_TERMS):
        V_n = _series_voltage(source, state, members, terms, speeds, currents, n)
        size = 0.0
        for j, (m, t) in enumerate(zip(members, terms, strict=True)):
            w = speeds[j][n]
            loop = m.sign * V_n - t.K_b * w - (t.drop if n == 0 else 0.0)
            if t.L == 0.0:
                i = loop * t.conductance
                currents[j].append(i)
            else:
                i = currents[j][n]
                currents[j].append(t.conducts * (loop - t.R * i) / (t.L * (n + 1)))
            against = t.against if n == 0 else t.slope if n == 1 else 0.0
            dw = t.moves * (t.K * i - t.b * w - against - t.stiffness * (angles[j] if n == 0 else speeds[j][n - 1] / n))
            speeds[j].append(dw / (t.J * (n + 1)))
            size = max(size, abs(speeds[j][-1]), abs(currents[j][-1]))
        if n > 2 and size * length ** (n + 1) < 1e-18:
            break
    return [Series(tuple(w), tuple(i)) for w, i in zip(speeds, currents, strict=True)]


def is_calm(member: Member, m: Motion, end: Vector, length: float) -> bool:
    """Tell by speed and current, and by how they change at both ends, that nothing ends a member's mode."""
    numbers, mode = member.numbers, member.mode
    if mode.mesh != RIGID or mode.zone == NO_CURRENT or varying(numbers.friction):
        return False
    sign = sign_of(mode.zone)
    if sign != 0.0 and not _keeps_its_sign(m.against, end[2], sign, length):
        return False
    if mode.contact == STUCK:
        i0, i1 = m.against[0], end[2]
        if springy(numbers.load) or m.tau.slope != 0.0 or m.tau.amplitude != 0.0 or _turns(m.against, length):
            return False
        against = external_torque(numbers.load, m.tau.value, end[0])
        low, high = contacts.holding_bounds(numbers, 0.0, 0.0)
        return -low < numbers.motor.K * min(i0, i1) - against and numbers.motor.K * max(i0, i1) - against < high
    if mode.contact != FORWARD and mode.contact != BACKWARD:
        return False
    if not _keeps_its_sign(m.coefficients, end[1], 1.0 if mode.contact == FORWARD else -1.0, length):
        return False
    return numbers.stops.lower < end[0] < numbers.stops.upper


def _keeps_its_sign(series: Sequence[float], end: float, sign: float, length: float) -> bool:
    leaves = sign * series[0] > 0.0 or (series[0] == 0.0 and sign * series[1] > 0.0)
    return leaves and sign * end > 0.0 and not _turns(series, length)


def _turns(series: Sequence[float], length: float) -> bool:
    """Tell whether a power series falls at one end and rises at the other."""
    slope = 0.0
    for n in range(len(series) - 1, 0, -1):
        slope = slope * length + n * series[n]
    return slope * series[1] < 0.0


def _plain_series(source: Source, state: int, members: Sequence[Member], terms: Sequence[_Linear],
                  states: Sequence[Vector], length: float) -> list[Series]:
    """Return the same for members without inductance, spring and ramp of torque, of which there are most."""
    rows = [(m.sign, t.K_b, t.conductance, t.moves * t.K / t.J, t.moves * t.b / t.J)
            for m, t in zip(members, terms, strict=True)]
    drops, against = [t.drop for t in terms], [t.moves * t.against / t.J for t in terms]
    now = [0.0 if at_rest(m.mode.contact) else y[1] for m, y in zip(members, states, strict=True)]
    speeds: list[list[float]] = [[w] for w in now]
    currents: list[list[float]] = [[] for _ in now]
    g = sum(row[2] for row in rows)
    given, per_volt = {FOLLOWING: (source.V, source.R_b), LIMITED: (source.I_max, 1.0),
                       KEEPING: (source.V, 0.0), BROKEN_DOWN: (0.0, 0.0)}[state]
    below = g if state == LIMITED else 1.0 + per_volt * g
    power = length
    for n in range(1, _MOST_TERMS):
        h = 0.0
        for (sign, K_b, G, _, _), w, drop in zip(rows, now, drops, strict=True):
            h += sign * (drop + K_b * w) * G
        V = (given + per_volt * h) / below
        size, following = 0.0, []
        for (sign, K_b, G, K, b), w, drop, f, speed, current in zip(
                rows, now, drops, against, speeds, currents, strict=True):
            i = (sign * V - K_b * w - drop) * G
            w = (K * i - b * w - f) / n
            current.append(i)
            speed.append(w)
            following.append(w)
            size = max(size, abs(w), abs(i))
        if n == 1:
            drops = against = [0.0] * len(rows)
            given = 0.0
        now = following
        if n > 3 and size * power < 1e-18:
            break
        power *= length
    return [Series(tuple(w), tuple(i)) for w, i in zip(speeds, currents, strict=True)]


class _Linear(NamedTuple):
    K: float
    K_b: float
    R: float
    L: float
    J: float
    b: float
    stiffness: float
    drop: float
    conductance: float  # 0 where no current flows
    conducts: float
    moves: float
    against: float
    slope: float


def _linear(member: Member, y: Vector, time: float) -> _Linear:
    numbers, mode, _, tau, _ = member
    friction = contacts.friction_torque(numbers, mode.contact, y[1], 0.0, 0.0)
    against = piece_value(tau, time) - numbers.load.stiffness * numbers.load.rest_angle + friction
    conducts = 0.0 if mode.zone == NO_CURRENT else 1.0
    own, R = numbers.motor, numbers.bridge.R_drive
    return _Linear(own.K, own.K_b, R, own.L, numbers.shaft.J, numbers.shaft.b, numbers.load.stiffness,
                   sign_of(mode.zone) * numbers.bridge.D_drive, conducts / R, conducts,
                   0.0 if at_rest(mode.contact) else 1.0, against, tau.slope)


def _series_voltage(source: Source, state: int, members: Sequence[Member], terms: Sequence[_Linear],
                    speeds: Sequence[Sequence[float]], currents: Sequence[Sequence[float]], n: int) -> float:
    """Return the n-th coefficient of V_bus."""
    if state == BROKEN_DOWN:
        return 0.0
    first = 1.0 if n == 0 else 0.0
    if state == KEEPING:
        return first * source.V
    g = h = given = above = below = 0.0
    for m, t, w, i in zip(members, terms, speeds, currents, strict=True):
        back = first * t.drop + t.K_b * w[n]
        if t.L == 0.0:
            g += t.conductance
            h += m.sign * back * t.conductance
        else:
            given += m.sign * i[n]
            above += m.sign * t.conducts * (back + t.R * i[n]) / t.L
            below += t.conducts / t.L
    if state == FOLLOWING:
        return (first * source.V + source.R_b * (h - given)) / (1.0 + source.R_b * g)
    return (first * source.I_max + h - given) / g if g > 0.0 else above / below


def joint_rates(source: Source, state: int, members: Sequence[Member], time: float,
                states: Sequence[Vector]) -> list[Vector]:
    """Return the rates of all members."""
    V = bus_voltage(source, state, members, states)
    return [rates_of(m.numbers, m.mode, behind(m, V), piece_value(m.tau, time), y)
            for m, y in zip(members, states, strict=True)]


def joint_step(source: Source, state: int, members: Sequence[Member], states: Sequence[Vector], time: float,
               step: float) -> tuple[float, float, list[tuple[Vector, ...]], list[Vector]]:
    """Return the length of one accepted step of at most `step` [s], the next to try, dense outputs and ends.

    The length is 0 where none is short enough.
    """
    count, h = len(members), step
    for _ in range(60):
        ks = [[NOWHERE] * 16 for _ in range(count)]
        for j in range(STAGES):
            at = [dormand_prince.moved(y, k, j, h) for y, k in zip(states, ks, strict=True)]
            for k, rate in zip(ks, joint_rates(source, state, members, time + dormand_prince.FRACTIONS[j] * h, at),
                               strict=True):
                k[j] = rate
        ends = [dormand_prince.moved(y, k, STAGES, h) for y, k in zip(states, ks, strict=True)]
        errors = [dormand_prince.error_of(y, end, k, h) for y, end, k in zip(states, ends, ks, strict=True)]
        size = max(e if e == e else math.inf for e in errors) / _TOLERANCE
        size = min(size, 1e12)
        factor = min(6.0, max(0.15, 0.9 * size**-0.125)) if size > 0.0 else 6.0
        if size <= 1.0:
            break
        h *= factor
    if size > 1.0:
        return 0.0, 0.0, [], list(states)
    for j in range(STAGES, 16):
        at = [dormand_prince.moved(y, k, j, h) for y, k in zip(states, ks, strict=True)]
        for k, rate in zip(ks, joint_rates(source, state, members, time + dormand_prince.FRACTIONS[j] * h, at),
                           strict=True):
            k[j] = rate
    dense = [dormand_prince.dense_of(y, end, k, h) for y, end, k in zip(states, ends, ks, strict=True)]
    return h, h * factor, dense, ends
