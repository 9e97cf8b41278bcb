"""How servos on one source move together: all linear, as power series exact to rounding; else by one explicit step."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine import contacts, dormand_prince
from servotwin.models.engine.dormand_prince import STAGES
from servotwin.models.engine.modes import INSIDE, NO_CURRENT, NOWHERE, Vector, at_rest, sign_of
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
from servotwin.models.terms.load import springy, swings
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import piece_value

ROOM = 42  # coefficients of a series at most
_LONGEST = 1.5  # of a series, in times of its fastest rate
_TOLERANCE = 1e-12  # error of one step, relative to 1 + |state|

Dense = tuple[Vector, Vector, Vector, Vector, Vector, Vector, Vector]
NO_DENSE: Dense = (NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE)


def is_linear(member: Member) -> bool:
    """Tell whether a member moves by linear laws."""
    return (not heat.present(member.numbers.heat) and not swings(member.numbers.load) and member.mode.mesh != INSIDE
            and (not varying(member.numbers.friction) or at_rest(member.mode.contact)))


def fastest_rate(members: list[Member]) -> float:
    """Return the fastest rate [1/s] of linear members."""
    rate = 0.0
    for j in range(len(members)):
        numbers, zone = members[j].numbers, members[j].mode.zone
        own, body, R = numbers.motor, numbers.shaft, numbers.bridge.R_drive
        one = body.b / body.J
        if springy(numbers.load):
            one += math.sqrt(numbers.load.stiffness / body.J)
        if zone != NO_CURRENT:
            if inductive(own):
                one += R / own.L + math.sqrt(own.K * own.K_b / (own.L * body.J))
            else:
                one += own.K * own.K_b / (R * body.J)
        rate = max(rate, one)
    return rate


def longest_series(members: list[Member]) -> float:
    """Return how long a series holds [s]."""
    rate = fastest_rate(members)
    return _LONGEST / rate if rate > 0.0 else math.inf


class Linear(NamedTuple):
    """The law of a linear member: L di/dt = s V − K_b w − drop − R i, J dw/dt = K i − b w − torques."""

    sign: float
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
    start: float  # its angle


def series(source: Source, state: int, members: list[Member], states: list[Vector], time: float, length: float,
           speed: list[float], current: list[float]) -> int:
    """Work out the motion of linear members from `time` on, for at most `length` [s]; return how many terms it has.

    The coefficients of each member's speed and current in powers of time have `ROOM` places in the lists.
    """
    laws = [_linear(members[j], states[j], time) for j in range(len(members))]
    plain = True
    for j in range(len(laws)):
        law, y = laws[j], states[j]
        plain = plain and law.L == 0.0 and law.stiffness == 0.0 and law.slope == 0.0
        speed[j * ROOM] = y[1] if law.moves > 0.0 else 0.0
        current[j * ROOM] = y[2]
    if plain:
        return _plain_series(source, state, laws, length, speed, current)
    return _general_series(source, state, laws, length, speed, current)


def _general_series(source: Source, state: int, laws: list[Linear], length: float, speed: list[float],
                    current: list[float]) -> int:
    terms, power = 1, length
    while terms < ROOM - 1:
        n = terms - 1
        V_n = _series_voltage(source, state, laws, speed, current, n)
        size = 0.0
        for j in range(len(laws)):
            t, at = laws[j], j * ROOM + n
            w = speed[at]
            loop = t.sign * V_n - t.K_b * w - (t.drop if n == 0 else 0.0)
            if t.L == 0.0:
                current[at] = loop * t.conductance
                current[at + 1] = 0.0
            else:
                current[at + 1] = t.conducts * (loop - t.R * current[at]) / (t.L * (n + 1))
            against = t.against if n == 0 else t.slope if n == 1 else 0.0
            angle = t.start if n == 0 else speed[at - 1] / n
            dw = t.moves * (t.K * current[at] - t.b * w - against - t.stiffness * angle)
            speed[at + 1] = dw / (t.J * (n + 1))
            size = max(size, abs(speed[at + 1]), abs(current[at] if t.L == 0.0 else current[at + 1]))
        terms += 1
        if n > 2 and size * power < 1e-18:
            break
        power *= length
    return terms


def _plain_series(source: Source, state: int, laws: list[Linear], length: float, speed: list[float],
                  current: list[float]) -> int:
    """Work out the same for members without inductance, spring and ramp of torque, of which there are most."""
    below, per_volt, given = _meeting(source, state, laws)
    first, terms, power = 1.0, 1, length
    while terms < ROOM - 1:
        n = terms - 1
        h = 0.0
        for j in range(len(laws)):
            t = laws[j]
            h += t.sign * (first * t.drop + t.K_b * speed[j * ROOM + n]) * t.conductance
        V = (first * given + per_volt * h) / below
        size = 0.0
        for j in range(len(laws)):
            t, at = laws[j], j * ROOM + n
            w = speed[at]
            i = (t.sign * V - t.K_b * w - first * t.drop) * t.conductance
            w = t.moves * (t.K * i - t.b * w - first * t.against) / (t.J * terms)
            current[at], current[at + 1], speed[at + 1] = i, 0.0, w
            size = max(size, abs(w), abs(i))
        first = 0.0
        terms += 1
        if n > 2 and size * power < 1e-18:
            break
        power *= length
    return terms


def _meeting(source: Source, state: int, laws: list[Linear]) -> tuple[float, float, float]:
    """Return what V_bus = (given + per_volt h) / below is made of, where h are the currents that back-EMFs drive."""
    g = 0.0
    for j in range(len(laws)):
        g += laws[j].conductance
    if state == LIMITED:
        return g, 1.0, source.I_max
    if state == KEEPING:
        return 1.0, 0.0, source.V
    if state == BROKEN_DOWN:
        return 1.0, 0.0, 0.0
    return 1.0 + source.R_b * g, source.R_b, source.V


def _linear(member: Member, y: Vector, time: float) -> Linear:
    numbers, mode, tau = member.numbers, member.mode, member.tau
    friction = contacts.friction_torque(numbers, mode.contact, y[1], 0.0, 0.0)
    against = piece_value(tau, time) - numbers.load.stiffness * numbers.load.rest_angle + friction
    conducts = 0.0 if mode.zone == NO_CURRENT else 1.0
    own, R = numbers.motor, numbers.bridge.R_drive
    return Linear(member.sign, own.K, own.K_b, R, own.L, numbers.shaft.J, numbers.shaft.b, numbers.load.stiffness,
                  sign_of(mode.zone) * numbers.bridge.D_drive, conducts / R, conducts,
                  0.0 if at_rest(mode.contact) else 1.0, against, tau.slope, y[0])


def _series_voltage(source: Source, state: int, laws: list[Linear], speed: list[float], current: list[float],
                    n: int) -> float:
    """Return the n-th coefficient of V_bus."""
    if state == BROKEN_DOWN:
        return 0.0
    first = 1.0 if n == 0 else 0.0
    if state == KEEPING:
        return first * source.V
    g = h = given = above = below = 0.0
    for j in range(len(laws)):
        t, w, i = laws[j], speed[j * ROOM + n], current[j * ROOM + n]
        back = first * t.drop + t.K_b * w
        if t.L == 0.0:
            g += t.conductance
            h += t.sign * back * t.conductance
        else:
            given += t.sign * i
            above += t.sign * t.conducts * (back + t.R * i) / t.L
            below += t.conducts / t.L
    if state == FOLLOWING:
        return (first * source.V + source.R_b * (h - given)) / (1.0 + source.R_b * g)
    return (first * source.I_max + h - given) / g if g > 0.0 else above / below


def series_value(coefficients: list[float], first: int, terms: int, s: float) -> float:
    """Return what a power series is at s [s]."""
    x = 0.0
    for n in range(terms - 1, -1, -1):
        x = x * s + coefficients[first + n]
    return x


def series_integral(coefficients: list[float], first: int, terms: int, s: float) -> float:
    """Return the integral of a power series from 0 to s [s]."""
    x = 0.0
    for n in range(terms - 1, -1, -1):
        x = x * s + coefficients[first + n] / (n + 1)
    return x * s


def turns(coefficients: list[float], first: int, terms: int, length: float) -> bool:
    """Tell whether a power series falls at one end and rises at the other."""
    slope = 0.0
    for n in range(terms - 1, 0, -1):
        slope = slope * length + n * coefficients[first + n]
    return slope * coefficients[first + 1] < 0.0


class Step(NamedTuple):
    """A step of all members: its length and the next to try [s]; the length is below 0 where none is short enough."""

    length: float
    following: float


def joint_rates(source: Source, state: int, members: list[Member], time: float, states: list[Vector],
                rates: list[Vector]) -> None:
    """Work out the rates of all members."""
    V = bus_voltage(source, state, members, states)
    for j in range(len(members)):
        member = members[j]
        rates[j] = rates_of(member.numbers, member.mode, behind(member, V), piece_value(member.tau, time), states[j])


def joint_step(source: Source, state: int, members: list[Member], states: list[Vector], time: float, step: float,
               dense: list[Dense], ends: list[Vector]) -> Step:
    """Work out one accepted step of at most `step` [s]: dense outputs and ends of all members."""
    count, h, factor = len(members), step, 1.0
    stages = [[NOWHERE for _ in range(16)] for _ in range(count)]
    at, rates = [NOWHERE for _ in range(count)], [NOWHERE for _ in range(count)]
    for _ in range(60):
        size = 0.0
        for k in range(STAGES):
            _stage(source, state, members, states, time, h, k, stages, at, rates)
        for j in range(count):
            ends[j] = dormand_prince.moved(states[j], stages[j], STAGES, h)
            error = dormand_prince.error_of(states[j], ends[j], stages[j], h)
            size = max(size, error if error == error else math.inf)
        size = min(size / _TOLERANCE, 1e12)
        factor = min(6.0, max(0.15, 0.9 * size**-0.125)) if size > 0.0 else 6.0
        if size <= 1.0:
            for k in range(STAGES, 16):
                _stage(source, state, members, states, time, h, k, stages, at, rates)
            for j in range(count):
                dense[j] = dormand_prince.dense_of(states[j], ends[j], stages[j], h)
            return Step(h, h * factor)
        h *= factor
    return Step(-1.0, step)


def _stage(source: Source, state: int, members: list[Member], states: list[Vector], time: float, h: float, k: int,
           stages: list[list[Vector]], at: list[Vector], rates: list[Vector]) -> None:
    """Work out the rates of all members in one stage of a step."""
    for j in range(len(members)):
        at[j] = dormand_prince.moved(states[j], stages[j], k, h)
    joint_rates(source, state, members, time + dormand_prince.FRACTIONS[k] * h, at, rates)
    for j in range(len(members)):
        stages[j][k] = rates[j]
