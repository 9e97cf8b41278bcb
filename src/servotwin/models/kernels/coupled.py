"""Several servos on one source: the bus voltage that all their currents leave, and how they move under it.

A servo takes part while its bridge connects the motor to the bus: with the sign of the drive, or through the diodes of
a coasting bridge against the sign of its current. Its plant is then that of a stiff source, and u = s V_bus. Where all
members are linear their motion is a power series, exact to rounding; else one step of the explicit method for all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from servotwin.models.kernels import armature, contact, dormand_prince, hybrid
from servotwin.models.kernels.dormand_prince import STAGES
from servotwin.models.kernels.motion import Motion
from servotwin.models.kernels.plant import (
    BACKWARD,
    FORWARD,
    INSIDE,
    NO_CURRENT,
    NOWHERE,
    RIGID,
    STUCK,
    Mode,
    Plant,
    Vector,
    at_rest,
)
from servotwin.physics.pieces import Piece, piece_value

_MOST_TERMS = 40
_LONGEST = 1.5  # of a series, in times of its fastest rate
_EDGE = 1e-10
_TOLERANCE = 1e-12  # error of one step, relative to 1 + |state|

# What the source does: it follows its resistance, gives its most, has broken down, or takes nothing back.
FOLLOWING, LIMITED, BROKEN_DOWN, KEEPING = range(4)


class Source(NamedTuple):
    """What the servos hang on."""

    V: float  # V_oc
    R_b: float
    I_max: float  # inf: a battery


class Member(NamedTuple):
    """A servo whose motor is connected to the bus."""

    plant: Plant  # as on a stiff source
    mode: Mode
    sign: float  # of the bus voltage in its circuit
    tau: Piece
    returns: bool  # through diodes, against the bus alone


def on_stiff_source(plant: Plant, returning: bool) -> Plant:
    """Return the plant of a servo whose bus voltage is given: driven, or returning current through its diodes."""
    R_drive = plant.R_off - plant.R_b if returning and plant.I_max == math.inf else plant.R_drive - plant.R_b
    if returning and plant.I_max < math.inf:
        R_drive = plant.R_off
    D = max(plant.D_drive, 1e-300) if returning else plant.D_drive  # a diode without drop still has a direction
    return plant._replace(R_drive=R_drive, R_b=0.0, I_max=math.inf, D_drive=D)


def member_of(plant: Plant, mode: Mode, drive: float, tau: Piece, y: Vector,
              stiff: Plant | None = None) -> Member:
    """Return a servo as a member, driven or (0) returning current through the diodes of a coasting bridge."""
    sign = drive
    if sign == 0.0:  # against the current, or against the one that the back-EMF would drive
        sign = -math.copysign(1.0, y[2]) if y[2] != 0.0 else math.copysign(1.0, y[6])
    return Member(stiff or on_stiff_source(plant, drive == 0.0), mode, sign, tau, drive == 0.0)


def _demand(members: Sequence[Member], states: Sequence[Vector]) -> tuple[float, float, float]:
    """Return g, h and I_B of the current Σ s i = g V − h + I_B that the members take at the bus voltage V."""
    g = h = given = 0.0
    for (plant, mode, sign, _, _), y in zip(members, states, strict=True):
        warm = hybrid.warm(plant, y)
        if plant.L > 0.0:
            given += sign * y[2]
        elif mode.zone != NO_CURRENT:
            g += 1.0 / warm.R_drive
            h += sign * (armature.sign_of(mode.zone) * warm.D_drive + warm.K_b * y[6]) / warm.R_drive
    return g, h, given


def bus_voltage(source: Source, state: int, members: Sequence[Member], states: Sequence[Vector]) -> float:
    """Return V_bus [V] for a state of the source."""
    if state == BROKEN_DOWN:
        return 0.0
    if state == KEEPING:
        return source.V
    g, h, given = _demand(members, states)
    if state == FOLLOWING:
        return (source.V + source.R_b * (h - given)) / (1.0 + source.R_b * g)
    if g > 0.0:
        return (source.I_max + h - given) / g
    above = below = 0.0  # the currents have inertia: their sum has to stay
    for (plant, mode, sign, _, _), y in zip(members, states, strict=True):
        if mode.zone != NO_CURRENT:
            warm = hybrid.warm(plant, y)
            drop = armature.sign_of(mode.zone) * warm.D_drive
            above += sign * (drop + warm.R_drive * y[2] + warm.K_b * y[6]) / plant.L
            below += 1.0 / plant.L
    return above / below


def drawn(source: Source, V_bus: float, members: Sequence[Member], states: Sequence[Vector]) -> float:
    """Return the current Σ s i [A] that the source gives."""
    g, h, given = _demand(members, states)
    return g * V_bus - h + given


def source_state(source: Source, members: Sequence[Member], states: Sequence[Vector]) -> int:
    """Return what the source does for members in these zones and states."""
    if source.I_max == math.inf:
        return FOLLOWING
    V = bus_voltage(source, FOLLOWING, members, states)
    total = drawn(source, V, members, states)
    if total < 0.0:
        return KEEPING
    g, _, _ = _demand(members, states)
    edge = _EDGE if g == 0.0 else 0.0  # the sum of currents with inertia is at the limit but for rounding
    if total < source.I_max * (1.0 - edge):
        return FOLLOWING
    if g == 0.0 and total > source.I_max * (1.0 + edge):
        return BROKEN_DOWN
    V = bus_voltage(source, LIMITED, members, states)
    if V < 0.0:
        return BROKEN_DOWN
    return LIMITED if V <= source.V - source.R_b * source.I_max else FOLLOWING


def source_guards(source: Source, state: int, V_bus: float, total: float) -> tuple[float, float]:
    """Return two numbers that are at least zero as long as the source does the same."""
    if source.I_max == math.inf:
        return 1.0, 1.0
    if state == FOLLOWING:
        return source.I_max - total, total
    if state == LIMITED:
        return source.V - source.R_b * source.I_max - V_bus, V_bus
    if state == KEEPING:
        return -total, 1.0
    return total - source.I_max, 1.0


def zoned(source: Source, members: Sequence[Member], states: Sequence[Vector],
          V_bus: float) -> tuple[list[Member], int, float]:
    """Return the members in the zones of their currents, what the source does, and V_bus; from a guess of V_bus.

    The bus sags the more of them conduct, and the fewer conduct the more it sags: a few rounds settle it.
    """
    now, state = list(members), FOLLOWING
    for _ in range(20 + 4 * len(now)):
        now = [_in_zone(m, _zone(m, y, V_bus)) for m, y in zip(now, states, strict=True)]
        state = source_state(source, now, states)
        before, V_bus = V_bus, bus_voltage(source, state, now, states)
        if abs(V_bus - before) <= 1e-14 * source.V:
            break
    return now, state, V_bus


def _zone(member: Member, y: Vector, V_bus: float) -> int:
    return let_through(member, armature.zone_of(
        hybrid.warm(member.plant, y), behind(member, V_bus), 0.0, y[0], y[6], y[2]))


def _in_zone(member: Member, zone: int) -> Member:
    plant, (_, shaft, mesh, motor), sign, tau, returns = member
    return Member(plant, Mode(zone, shaft, mesh, motor), sign, tau, returns)


def let_through(member: Member, zone: int) -> int:
    """Return the zone of a member: diodes block what the bus would drive."""
    return NO_CURRENT if member.returns and armature.sign_of(zone) * member.sign > 0.0 else zone


def after(state: int, guard: int) -> int:
    """Return what the source does after one of its guards has fallen below zero."""
    if state == FOLLOWING:
        return KEEPING if guard == 1 else LIMITED
    if state == LIMITED:
        return BROKEN_DOWN if guard == 1 else FOLLOWING
    return FOLLOWING if state == KEEPING else LIMITED


def behind(member: Member, V_bus: float) -> float:
    """Return the voltage in a member's circuit [V]; a bus without any is still connected."""
    return member.sign * (V_bus or 5e-324)


def is_linear(member: Member) -> bool:
    """Tell whether a member moves by linear laws."""
    plant, mode = member.plant, member.mode
    return (plant.C_w == 0.0 and plant.gravity == 0.0 and mode.mesh != INSIDE
            and (plant.varies == 0.0 or at_rest(mode.contact)))


def fastest_rate(members: Sequence[Member]) -> float:
    """Return the fastest rate [1/s] of linear members."""
    rate = 0.0
    for plant, mode, _, _, _ in members:
        one = plant.b / plant.J + math.sqrt(plant.stiffness / plant.J)
        if mode.zone != NO_CURRENT:
            one += plant.R_drive / plant.L if plant.L > 0.0 else plant.K * plant.K_b / (plant.R_drive * plant.J)
            one += math.sqrt(plant.K * plant.K_b / (plant.L * plant.J)) if plant.L > 0.0 else 0.0
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
    currents = [[y[2]] if m.plant.L > 0.0 else [] for m, y in zip(members, states, strict=True)]
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
    plant, mode = member.plant, member.mode
    if mode.mesh != RIGID or mode.zone == NO_CURRENT or plant.varies > 0.0:
        return False
    sign = armature.sign_of(mode.zone)
    if sign != 0.0 and not _keeps_its_sign(m.against, end[2], sign, length):
        return False
    if mode.contact == STUCK:
        i0, i1 = m.against[0], end[2]
        if plant.stiffness != 0.0 or m.tau.slope != 0.0 or m.tau.amplitude != 0.0 or _turns(m.against, length):
            return False
        against = contact.external_torque(plant, m.tau.value, end[0])
        low, high = contact.holding_bounds(plant, 0.0, 0.0)
        return -low < plant.K * min(i0, i1) - against and plant.K * max(i0, i1) - against < high
    if mode.contact != FORWARD and mode.contact != BACKWARD:
        return False
    if not _keeps_its_sign(m.coefficients, end[1], 1.0 if mode.contact == FORWARD else -1.0, length):
        return False
    return plant.lower < end[0] < plant.upper


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
    plant, mode, _, tau, _ = member
    friction = contact.friction_torque(plant, mode.contact, y[1], 0.0, 0.0)
    against = piece_value(tau, time) - plant.stiffness * plant.rest_angle + friction
    conducts = 0.0 if mode.zone == NO_CURRENT else 1.0
    return _Linear(plant.K, plant.K_b, plant.R_drive, plant.L, plant.J, plant.b, plant.stiffness,
                   armature.sign_of(mode.zone) * plant.D_drive, conducts / plant.R_drive, conducts,
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
    return [hybrid.rates(m.plant, m.mode, behind(m, V), piece_value(m.tau, time), y)
            for m, y in zip(members, states, strict=True)]


def joint_step(source: Source, state: int, members: Sequence[Member], states: Sequence[Vector], time: float,
               step: float) -> tuple[float, float, list[tuple[Vector, ...]], list[Vector]]:
    """Return the length of one accepted step of at most `step` [s], the next to try, dense outputs and ends."""
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
    for j in range(STAGES, 16):
        at = [dormand_prince.moved(y, k, j, h) for y, k in zip(states, ks, strict=True)]
        for k, rate in zip(ks, joint_rates(source, state, members, time + dormand_prince.FRACTIONS[j] * h, at),
                           strict=True):
            k[j] = rate
    dense = [dormand_prince.dense_of(y, end, k, h) for y, end, k in zip(states, ends, ks, strict=True)]
    return h, h * factor, dense, ends
