"""How servos on one source move together: all linear, as power series exact to rounding; else by one explicit step.

The functions take the first `count` records of `bus_records.Mate`, whose motions begin at their `start`.

A servo takes part, as a mate of the others, while its bridge connects the motor to the bus: with the sign of the drive,
or through the diodes of a coasting bridge against the sign of its current. Its numbers are then those of a stiff
source, and u = s V_bus, where s is the sign, or the duty of a bridge under PWM: an ideal transformer, which takes s i.
The functions take the first `count` records of `bus_records.Mate`, each as it stands at its `y`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.bus.bus_records import ROOM, Linear, mode_of, numbers_of, piece_of, put_law, vector_of
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.engine.memory import put_vector
from servotwin.models.engine.motions import dormand_prince, stribeck
from servotwin.models.engine.motions.dormand_prince import STAGES, rates_in
from servotwin.models.engine.motions.motion import LONG_STEP
from servotwin.models.state.modes import INSIDE, NO_CURRENT, Vector, at_rest, sign_of
from servotwin.models.terms.numbers import warm
from servotwin.models.terms.source import Source
from servotwin.physics import bridge, motor, supply
from servotwin.physics.elementary import power
from servotwin.physics.pieces import piece_value

# --- Several servos on one source -------------------------------------------------------------------------------------

_EDGE = 1e-8  # of a limit: so near to it the sum of currents counts as being there
# Regimes of the source: it follows its resistance, gives its most, has broken down, or takes nothing back.
FOLLOWING, LIMITED, BROKEN_DOWN, KEEPING = range(4)


def _loop(mate: Any) -> tuple[float, float, float]:
    """Return resistance [Ω], voltage drop [V] and K_b of the circuit of a mate."""
    if mate.numbers.heat.C_w > 0.0:
        now = warm(numbers_of(mate.numbers), vector_of(mate.y))
        return now.bridge.R_drive, now.bridge.D_drive, now.motor.K_b
    return mate.numbers.bridge.R_drive, mate.numbers.bridge.D_drive, mate.numbers.motor.K_b


def _demand(mates: Any, count: int) -> tuple[float, float, float]:
    """Return g, h and I_B of the current Σ s i = g V − h + I_B that the mates take at the bus voltage V."""
    g = h = given = 0.0
    for k in range(count):
        mate = mates[k]
        if mate.numbers.motor.L > 0.0:
            given += mate.sign * mate.y.i
        elif mate.mode.zone != NO_CURRENT:
            R, D, K_b = _loop(mate)
            g += mate.sign * motor.steady_armature_current(mate.sign, 0.0, R, K_b)
            v = bridge.driving_voltage(0.0, sign_of(mate.mode.zone), D)
            h -= mate.sign * motor.steady_armature_current(v, mate.y.w_m, R, K_b)
    return g, h, given


def bus_voltage(source: Source, state: int, mates: Any, count: int) -> float:
    """Return V_bus [V] for a state of the source."""
    if state == BROKEN_DOWN:
        return 0.0
    if state == KEEPING:
        return source.V
    g, h, given = _demand(mates, count)
    if state == FOLLOWING:
        free = supply.source_voltage(given - h, source.V, source.R_b)
        return free / (1.0 - supply.source_voltage(g, 0.0, source.R_b))
    if g > 0.0:
        return (source.I_max + h - given) / g
    above = below = 0.0  # the currents have inertia: their sum has to stay
    for k in range(count):
        mate = mates[k]
        if mate.mode.zone != NO_CURRENT:
            R, D, K_b = _loop(mate)
            v, L = bridge.driving_voltage(0.0, sign_of(mate.mode.zone), D), mate.numbers.motor.L
            above -= mate.sign * motor.armature_current_rate(v, mate.y.i, mate.y.w_m, R, L, K_b)
            below += mate.sign * motor.armature_current_rate(mate.sign, 0.0, 0.0, R, L, K_b)
    return above / below


def drawn(V_bus: float, mates: Any, count: int) -> float:
    """Return the current Σ s i [A] that the source gives."""
    g, h, given = _demand(mates, count)
    return g * V_bus - h + given


def source_state(source: Source, mates: Any, count: int) -> int:
    """Return what the source does for mates in these zones and states."""
    if source.I_max == math.inf:
        return FOLLOWING
    V = bus_voltage(source, FOLLOWING, mates, count)
    total = drawn(V, mates, count)
    if total < 0.0:
        return KEEPING
    g, _, _ = _demand(mates, count)
    edge = _EDGE if g == 0.0 else 0.0  # the sum of currents with inertia is at the limit but for rounding
    if total < source.I_max * (1.0 - edge):
        return FOLLOWING
    if g == 0.0 and total > source.I_max * (1.0 + edge):
        return BROKEN_DOWN
    V = bus_voltage(source, LIMITED, mates, count)
    if V < 0.0:
        return BROKEN_DOWN
    return LIMITED if V <= supply.source_voltage(source.I_max, source.V, source.R_b) else FOLLOWING


def source_guards(source: Source, state: int, V_bus: float, total: float) -> tuple[float, float]:
    """Return two numbers that are at least zero as long as the source does the same."""
    if source.I_max == math.inf:
        return 1.0, 1.0
    if state == FOLLOWING:
        return source.I_max - total, total
    if state == LIMITED:
        return supply.source_voltage(source.I_max, source.V, source.R_b) - V_bus, V_bus
    if state == KEEPING:
        return -total, 1.0
    return total - source.I_max, 1.0


def put_in_zones(source: Source, mates: Any, count: int, V_bus: float) -> tuple[int, float]:
    """Put the mates into the zones of their currents; return what the source does, and V_bus; from a guess of V_bus.

    The bus sags the more of them conduct, and the fewer conduct the more it sags: a few rounds settle it.
    """
    state = FOLLOWING
    for _ in range(20 + 4 * count):
        for k in range(count):
            mate = mates[k]
            mate.mode.zone = _zone(mate, V_bus)
        state = source_state(source, mates, count)
        before, V_bus = V_bus, bus_voltage(source, state, mates, count)
        if abs(V_bus - before) <= 1e-14 * source.V:
            break
    return state, V_bus


def _zone(mate: Any, V_bus: float) -> int:
    y = vector_of(mate.y)
    numbers = warm(numbers_of(mate.numbers), y)
    return let_through(mate, currents.zone_of(numbers, behind(mate, V_bus), 0.0, y.q, y.w_m, y.i))


def let_through(mate: Any, zone: int) -> int:
    """Return the zone of a mate: diodes block what the bus would drive."""
    return NO_CURRENT if mate.returns > 0 and sign_of(zone) * mate.sign > 0.0 else zone


def after(state: int, guard: int) -> int:
    """Return what the source does after one of its guards has fallen below zero."""
    if state == FOLLOWING:
        return KEEPING if guard == 1 else LIMITED
    if state == LIMITED:
        return BROKEN_DOWN if guard == 1 else FOLLOWING
    return FOLLOWING if state == KEEPING else LIMITED


def behind(mate: Any, V_bus: float) -> float:
    """Return the voltage in a mate's circuit [V]; a bus without any is still connected."""
    sign: float = mate.sign
    return sign * (V_bus if V_bus != 0.0 else 5e-324)


# --- How servos on one source move together ---------------------------------------------------------------------------

BY_SERIES = -1  # how mates move: beside LONG_STEP, which a recipe may leave out
_LONGEST = 1.5  # of a series, in times of its fastest rate
_TOLERANCE = 1e-12  # error of one step, relative to 1 + |state|
_SIZE = 7  # of a state


def kind_of(mates: Any, count: int) -> int:
    """Return how mates move: by series where the laws of all are linear, else by a step."""
    for k in range(count):
        mate = mates[k]
        if mate.numbers.heat.C_w > 0.0 or mate.numbers.load.gravity != 0.0 or mate.mode.mesh == INSIDE or (
                mate.numbers.friction.varies > 0.0 and not at_rest(mate.mode.contact)):
            return LONG_STEP
    return BY_SERIES


def fastest_rate(mates: Any, count: int) -> float:
    """Return the fastest rate [1/s] of linear mates."""
    rate = 0.0
    for k in range(count):
        numbers = numbers_of(mates[k].numbers)
        own, body, R = numbers.motor, numbers.shaft, numbers.bridge.R_drive
        one = body.b / body.J
        if numbers.load.stiffness > 0.0:
            one += math.sqrt(numbers.load.stiffness / body.J)
        if mates[k].mode.zone != NO_CURRENT:
            if own.L > 0.0:
                one += R / own.L + math.sqrt(own.K * own.K_b / (own.L * body.J))
            else:
                one += own.K * own.K_b / (R * body.J)
        rate = max(rate, one)
    return rate


def longest_series(mates: Any, count: int) -> float:
    """Return how long a series holds [s]."""
    rate = fastest_rate(mates, count)
    return _LONGEST / rate if rate > 0.0 else math.inf


def series(source: Source, state: int, mates: Any, count: int, time: float, length: float) -> int:
    """Work out the motion of linear mates from `time` on, for at most `length` [s]; return how many terms it has.

    Its coefficients are those of speed and current in powers of time.
    """
    plain = True
    for k in range(count):
        mate = mates[k]
        put_law(mate.law, _linear(mate, time))
        law = mate.law
        plain = plain and law.L == 0.0 and law.stiffness == 0.0 and law.slope == 0.0
        mate.speed[0] = mate.start.w if law.moves > 0.0 else 0.0
        mate.current[0] = mate.start.i
    if plain:
        return _plain_series(source, state, mates, count, length)
    return _general_series(source, state, mates, count, length)


def _general_series(source: Source, state: int, mates: Any, count: int, length: float) -> int:
    terms, power = 1, length
    while terms < ROOM - 1:
        n = terms - 1
        V_n = _series_voltage(source, state, mates, count, n)
        size = 0.0
        for k in range(count):
            mate = mates[k]
            t = mate.law
            w, i = mate.speed[n], mate.current[n]
            loop = t.sign * V_n - t.K_b * w - (t.drop if n == 0 else 0.0)
            if t.L == 0.0:
                i = loop * t.conductance
                mate.current[n] = i
            after = t.conducts * (loop - t.R * i) / (t.L * (n + 1)) if t.L > 0.0 else 0.0
            against = t.against if n == 0 else t.slope if n == 1 else 0.0
            angle = t.start if n == 0 else mate.speed[n - 1] / n
            dw = t.moves * (t.K * i - t.b * w - against - t.stiffness * angle) / (t.J * (n + 1))
            mate.current[n + 1], mate.speed[n + 1] = after, dw
            size = max(size, abs(dw), abs(after if t.L > 0.0 else i))
        terms += 1
        if n > 2 and size * power < 1e-18:
            break
        power *= length
    return terms


def _plain_series(source: Source, state: int, mates: Any, count: int, length: float) -> int:
    """Work out the same for mates without inductance, spring and ramp of torque, of which there are most."""
    below, per_volt, given = _meeting(source, state, mates, count)
    first, terms, power = 1.0, 1, length
    while terms < ROOM - 1:
        n = terms - 1
        h = 0.0
        for k in range(count):
            t = mates[k].law
            h += t.sign * (first * t.drop + t.K_b * mates[k].speed[n]) * t.conductance
        V = (first * given + per_volt * h) / below
        size = 0.0
        for k in range(count):
            mate = mates[k]
            t = mate.law
            w = mate.speed[n]
            i = (t.sign * V - t.K_b * w - first * t.drop) * t.conductance
            w = t.moves * (t.K * i - t.b * w - first * t.against) / (t.J * terms)
            mate.current[n], mate.current[terms], mate.speed[terms] = i, 0.0, w
            size = max(size, abs(w), abs(i))
        first = 0.0
        terms += 1
        if n > 2 and size * power < 1e-18:
            break
        power *= length
    return terms


def _meeting(source: Source, state: int, mates: Any, count: int) -> tuple[float, float, float]:
    """Return what V_bus = (given + per_volt h) / below is made of, where h are the currents that back-EMFs drive."""
    g = 0.0
    for k in range(count):
        t = mates[k].law
        g += t.sign * t.sign * t.conductance
    if state == LIMITED:
        return g, 1.0, source.I_max
    if state == KEEPING:
        return 1.0, 0.0, source.V
    if state == BROKEN_DOWN:
        return 1.0, 0.0, 0.0
    return 1.0 + source.R_b * g, source.R_b, source.V


def _linear(mate: Any, time: float) -> Linear:
    numbers, mode, tau, y = numbers_of(mate.numbers), mode_of(mate.mode), piece_of(mate.tau), mate.start
    friction = contacts.friction_torque(numbers, mode.contact, y.w, 0.0, 0.0)
    against = piece_value(tau, time) - numbers.load.stiffness * numbers.load.rest_angle + friction
    conducts = 0.0 if mode.zone == NO_CURRENT else 1.0
    own, R = numbers.motor, numbers.bridge.R_drive
    return Linear(mate.sign, own.K, own.K_b, R, own.L, numbers.shaft.J, numbers.shaft.b, numbers.load.stiffness,
                  sign_of(mode.zone) * numbers.bridge.D_drive, conducts / R, conducts,
                  0.0 if at_rest(mode.contact) else 1.0, against, tau.slope, y.q)


def _series_voltage(source: Source, state: int, mates: Any, count: int, n: int) -> float:
    """Return the n-th coefficient of V_bus."""
    if state == BROKEN_DOWN:
        return 0.0
    first = 1.0 if n == 0 else 0.0
    if state == KEEPING:
        return first * source.V
    g = h = given = above = below = 0.0
    for k in range(count):
        t, w, i = mates[k].law, mates[k].speed[n], mates[k].current[n]
        back = first * t.drop + t.K_b * w
        if t.L == 0.0:
            g += t.sign * t.sign * t.conductance
            h += t.sign * back * t.conductance
        else:
            given += t.sign * i
            above += t.sign * t.conducts * (back + t.R * i) / t.L
            below += t.sign * t.sign * t.conducts / t.L
    if state == FOLLOWING:
        return (first * source.V + source.R_b * (h - given)) / (1.0 + source.R_b * g)
    return (first * source.I_max + h - given) / g if g > 0.0 else above / below


def turns(coefficients: Any, terms: int, length: float) -> bool:
    """Tell whether a power series falls at one end and rises at the other."""
    slope = 0.0
    for n in range(terms - 1, 0, -1):
        slope = slope * length + n * coefficients[n]
    return bool(slope * coefficients[1] < 0.0)


class Step(NamedTuple):
    """A step of all mates: its length and the next to try [s]; the length is below 0 where none is short enough."""

    length: float
    following: float


def joint_step(source: Source, state: int, mates: Any, count: int, time: float, step: float) -> Step:
    """Work out one accepted step of at most `step` [s]: dense outputs and ends of all mates."""
    h, factor, short = step, 1.0, False
    for _ in range(60):
        size, part = 0.0, 1.0
        for k in range(STAGES):
            _stage(source, state, mates, count, time, h, k)
        for j in range(count):
            start, stages = vector_of(mates[j].start), mates[j].stages
            end = dormand_prince.moved(start, stages, STAGES, h)
            put_vector(mates[j].end, end)
            error = dormand_prince.error_of(start, end, stages, h)
            size = max(size, error if error == error else math.inf)
            part = min(part, stribeck.part_before(numbers_of(mates[j].numbers), mode_of(mates[j].mode), start, end))
        size = min(size / _TOLERANCE, 1e12)
        factor = min(6.0, max(0.15, 0.9 * power(size, -0.125))) if size > 0.0 else 6.0
        if size <= 1.0 and part == 1.0:
            for k in range(STAGES, 16):
                _stage(source, state, mates, count, time, h, k)
            for j in range(count):
                _put_dense(mates[j], h)
            return Step(h, max(step, h * factor) if short else h * factor)
        short = size <= 1.0
        h *= part if short else factor
    return Step(-1.0, step)


def _stage(source: Source, state: int, mates: Any, count: int, time: float, h: float, k: int) -> None:
    """Work out the rates of all mates in one stage of a step."""
    for j in range(count):
        put_vector(mates[j].y, dormand_prince.moved(vector_of(mates[j].start), mates[j].stages, k, h))
    V, t = bus_voltage(source, state, mates, count), time + dormand_prince.FRACTIONS[k] * h
    for j in range(count):
        mate = mates[j]
        dormand_prince.put_rates(mate.stages, k, rates_of(
            numbers_of(mate.numbers), mode_of(mate.mode), behind(mate, V), piece_value(piece_of(mate.tau), t),
            vector_of(mate.y)))


def _put_dense(mate: Any, h: float) -> None:
    vectors = dormand_prince.dense_of(vector_of(mate.start), vector_of(mate.end), mate.stages, h)
    for k in range(_SIZE):
        dormand_prince.put_rates(mate.dense, k, vectors[k])


def between(mate: Any, x: float) -> Vector:
    """Return the state of a mate at the fraction x of a step."""
    d = mate.dense
    return dormand_prince.interpolate(vector_of(mate.start), (
        rates_in(d, 0), rates_in(d, 1), rates_in(d, 2), rates_in(d, 3), rates_in(d, 4), rates_in(d, 5),
        rates_in(d, 6)), x)
