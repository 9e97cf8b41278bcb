"""How the state moves within one mode: in closed form wherever the mode is linear, else one integrator step.

A motion starts at its anchor t0 and gives the state at any later time t0 + s until its `length` is over.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics.coefficients import (
    apart_coefficients,
    current_of,
    jacobian,
    rates_of,
)
from servotwin.models.engine.motions import (
    dormand_prince,
    first_order,
    rodas,
    second_order,
    stribeck,
    two_mass_series,
    warm_linear,
)
from servotwin.models.engine.motions.first_order import Course, both
from servotwin.models.engine.motions.rodas import Triple
from servotwin.models.state.modes import (
    INSIDE,
    NOWHERE,
    RIGID,
    Mode,
    Vector,
)
from servotwin.models.terms import elastic, play
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.elementary import expm1
from servotwin.physics.pieces import Piece, piece_rate, piece_value

# Kinds of motion. IMPOSSIBLE: no step is short enough for the tolerance.
(REST, FIRST_ORDER, SECOND_ORDER, WITH_CURRENT, HELD, SERIES, STEP, LONG_STEP, CREEP, APART, PAIR,
 WARMING, IMPOSSIBLE) = range(13)

_TURN = 2.0 * math.pi
_GONE = 2.0  # times that of what fades fast: most of it is over
_SETTLING, _FADING = 4.0, 3.0  # times in which a creep settles, or friction fades, that an interval may last
_NOTHING, _TIMES = 1e-15, 3.0  # A, what is left of a current; of 1/rate: an interval in which it fades
FINE = 1e-3  # error of one explicit step, relative to 1 + |state|: a part of the accuracy asked for
_ORIGIN = (0.0, 0.0, 0.0)
NO_STAGES = (_ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN)
NO_DENSE = (_ORIGIN, _ORIGIN, _ORIGIN)
NO_LONG_DENSE = (NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE)
ONLY_FOR = {"NO_STAGES": ("STEP",), "NO_DENSE": ("STEP",), "NO_LONG_DENSE": ("LONG_STEP", "PAIR", "WARMING")}
"""Kinds of motion that need this room: kernels without them have none, and less to copy."""
NO_COEFFICIENTS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Motion(NamedTuple):
    """The moving part, its start, and its law."""

    kind: int
    numbers: Numbers
    mode: Mode
    u: Piece
    tau: Piece
    t0: float
    start: Vector
    length: float
    coefficients: tuple[float, ...]  # second_order's; FIRST_ORDER's, APART's (λ, f twice); HELD (R/L, final i); SERIES
    against: tuple[float, ...]  # WITH_CURRENT: value and slope of all torque that does not depend on speed
    end: Vector  # of a step, as all that follows
    next_step: float  # length to try next [s]
    ends_by: int  # guard that is zero at the end; −1: none
    has_dense: bool
    stages: tuple[Triple, ...]
    dense: tuple[Triple, Triple, Triple]
    long_dense: tuple[Vector, ...]  # PAIR: the law


def nothing(numbers: Numbers, u: Piece, tau: Piece) -> Motion:
    """Return a motion that is none yet."""
    nowhere = Mode(0, 0, 0, 0, 0)
    return closed(IMPOSSIBLE, numbers, nowhere, u, tau, math.inf, NOWHERE, NO_COEFFICIENTS, (0.0, 0.0), 0.0)


def is_step(motion: Motion) -> bool:
    """Tell whether a motion is one step of an integrator, or a creep or a series, which end as one does."""
    return motion.kind == STEP or motion.kind == LONG_STEP or motion.kind == CREEP or motion.kind == PAIR or (
        motion.kind == WARMING)


def closed(kind: int, numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector,
           coefficients: tuple[float, ...], against: tuple[float, ...], step: float) -> Motion:
    """Return a motion without an end, by its coefficients."""
    return Motion(kind, numbers, mode, u, tau, t0, y, math.inf, coefficients, against, y, step, -1, False, NO_STAGES,
                  NO_DENSE, NO_LONG_DENSE)


def by_series(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, length: float,
              speed: tuple[float, ...], current: tuple[float, ...]) -> Motion:
    """Return a motion whose speed and current are given as powers of time."""
    return Motion(SERIES, numbers, mode, u, tau, t0, y, length, speed, current, y, 0.0, -1, False, NO_STAGES,
                  NO_DENSE, NO_LONG_DENSE)


def output_apart(numbers: Numbers, mode: Mode, u: Piece, tau: Piece) -> tuple[float, float]:
    """Return the law of an output that moves apart from the motor, (λ, f)."""
    if mode.mesh != INSIDE:
        return 0.0, 0.0
    apart = apart_coefficients(numbers, mode, u.value, tau.value)
    return apart.output_rate, apart.output_pull


def _warm_step(motion: Motion, s: float) -> warm_linear.Step:
    """Return the step of a servo that warms up, of a length s [s]."""
    law = warm_linear.law_of(motion.numbers, motion.mode, motion.u.value, motion.tau.value, motion.start)
    return warm_linear.step(law, motion.numbers.heat, motion.start, s)


def prepared(motion: Motion) -> Motion:
    """Return the motion ready to be evaluated between the ends of a step."""
    if motion.has_dense or not is_step(motion):
        return motion
    dense, long_dense, against = motion.dense, motion.long_dense, motion.against
    if motion.kind == WARMING:
        found = _warm_step(motion, motion.length)
        long_dense = found.dense
        against = output_apart(motion.numbers, motion.mode, motion.u, motion.tau)
    elif motion.kind == STEP:
        dense = rodas.dense_coefficients(motion.stages)
    elif motion.kind == LONG_STEP:
        long_dense = dormand_prince.dense(motion.numbers, motion.mode, motion.u, motion.tau, motion.t0, motion.start,
                                          motion.length)
    return Motion(motion.kind, motion.numbers, motion.mode, motion.u, motion.tau, motion.t0, motion.start,
                  motion.length, motion.coefficients, against, motion.end, motion.next_step, motion.ends_by,
                  True, motion.stages, dense, long_dense)


def state(motion: Motion, s: float) -> Vector:
    """Return the state at s after the anchor; a step that is looked at in between has to be `prepared`."""
    kind, start = motion.kind, motion.start
    if kind == REST:
        return start
    if kind == FIRST_ORDER:
        c = motion.coefficients
        q, w = first_order.propagate(2.0 * c[0], c[2], c[7], c[8], s)
        return moved(motion, q, w, start.i)
    if kind == SECOND_ORDER:
        q, w = second_order.propagate(motion.coefficients, s)
        return moved(motion, q, w, start.i)
    if kind == APART:
        c = motion.coefficients
        return both(Course(c[0], c[1], start.q, start.w), Course(c[2], c[3], start.q_m, start.w_m), start, s)
    if kind == WITH_CURRENT:
        w, dw, way = second_order.propagate_with_integral(motion.coefficients, s)
        against = motion.against[0] + motion.against[1] * s
        return moved(motion, start.q + way, w, current_of(motion.numbers, motion.mode, dw, w, against))
    if kind == HELD:
        rate, final = motion.coefficients[0], motion.coefficients[1]
        return moved(motion, start.q, start.w, start.i + (start.i - final) * expm1(-rate * s))
    if kind == SERIES:
        q = w = i = 0.0
        for n in range(len(motion.coefficients) - 1, -1, -1):
            w = w * s + motion.coefficients[n]
            q = q * s + motion.coefficients[n] / (n + 1)
        for n in range(len(motion.against) - 1, -1, -1):
            i = i * s + motion.against[n]
        return moved(motion, start.q + q * s, w, i)
    if motion.t0 + s >= motion.t0 + motion.length:  # the end, reached as a difference of two times
        return motion.end
    if s == 0.0:
        return start
    if elastic.present(motion.numbers.elastic) and kind == PAIR:
        return two_mass_series.propagate(motion.long_dense, start, s)
    if kind == WARMING:
        return warm_linear.state(motion.numbers, motion.mode, start, (motion.against[0], motion.against[1]),
                                 motion.long_dense, motion.length, s)
    if kind == CREEP:
        q, w = stribeck.at_time(motion.numbers, motion.mode, motion.u.value, motion.tau.value, start, motion.end,
                                motion.coefficients[0], s)
        return moved(motion, q, w, start.i)
    x = s / motion.length
    if kind == STEP:
        return rodas.interpolate(start, motion.end, motion.dense, x)
    if kind == LONG_STEP:
        return dormand_prince.interpolate(start, motion.long_dense, x)
    return start


def ended(motion: Motion, s: float) -> Vector:
    """Return the state at s after the anchor where a motion ends: what is only interpolated there is followed anew."""
    if motion.kind == LONG_STEP and 0.0 < s < motion.length and motion.next_step > 0.0:  # else what is given is all
        return dormand_prince.step(motion.numbers, motion.mode, motion.u, motion.tau, motion.t0, motion.start, s)[0]
    if motion.kind == STEP and 0.0 < s < motion.length:
        numbers, mode, u, tau, t0, y = motion.numbers, motion.mode, motion.u, motion.tau, motion.t0, motion.start
        return rodas.step(numbers, mode, u, tau, jacobian_at(numbers, mode, u, tau, t0, y), t0, y, s)[0]
    if motion.kind != WARMING or not s > 0.0:
        return state(motion, s)
    found = _warm_step(motion, s)
    return warm_linear.state(motion.numbers, motion.mode, motion.start, (motion.against[0], motion.against[1]),
                             found.dense, s, s)


def jacobian_at(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t: float, y: Vector) -> tuple[float, ...]:
    """Return how the rates of a state change with it and with time."""
    return jacobian(numbers, mode, piece_value(u, t), piece_rate(u, t), piece_rate(tau, t), y.q, y.w)


def moved(motion: Motion, q: float, w: float, i: float) -> Vector:
    """Return the state of one body, at rest inside the play the motor's own."""
    y, mesh = motion.start, motion.mode.mesh
    if mesh == INSIDE or elastic.present(motion.numbers.elastic):
        return Vector(q, w, i, y.T_w, y.T_h, y.q_m, y.w_m)
    q_m = q if mesh == RIGID else q + play.ahead(motion.numbers.play, mesh)
    return Vector(q, w, i, y.T_w, y.T_h, q_m, w)


def rates(motion: Motion, s: float, y: Vector) -> Vector:
    """Return the rates of the state at s, where it is y."""
    kind = motion.kind
    w, w_m = y.w, y.w_m
    if kind == REST:
        return NOWHERE
    if kind == FIRST_ORDER or kind == SECOND_ORDER:
        dw = second_order.acceleration(motion.coefficients, s, y.q, w)
        return Vector(w, dw, 0.0, 0.0, 0.0, w_m, dw)
    if kind == APART:
        c = motion.coefficients
        return Vector(w, c[1] - c[0] * w, 0.0, 0.0, 0.0, w_m, c[3] - c[2] * w_m)
    numbers = motion.numbers
    if kind == WITH_CURRENT:
        w, dw = second_order.propagate(motion.coefficients, s)
        ddw = second_order.acceleration(motion.coefficients, s, w, dw)
        return Vector(w, dw, current_of(numbers, motion.mode, ddw, dw, motion.against[1]), 0.0, 0.0, w_m, dw)
    if kind == HELD:
        return Vector(0.0, 0.0, motion.coefficients[0] * (motion.coefficients[1] - y.i), 0.0, 0.0, 0.0, 0.0)
    if is_step(motion):
        t = motion.t0 + s
        return rates_of(numbers, motion.mode, piece_value(motion.u, t), piece_value(motion.tau, t), y)
    return NOWHERE


def state_and_rates(motion: Motion, s: float) -> tuple[Vector, Vector]:
    """Return the state at s after the anchor and its rates; with inductance both are found by one solution."""
    if motion.kind == WITH_CURRENT:
        numbers, against = motion.numbers, motion.against
        w, dw, way = second_order.propagate_with_integral(motion.coefficients, s)
        ddw = second_order.acceleration(motion.coefficients, s, w, dw)
        i = current_of(numbers, motion.mode, dw, w, against[0] + against[1] * s)
        y = moved(motion, motion.start.q + way, w, i)
        return y, Vector(w, dw, current_of(numbers, motion.mode, ddw, dw, against[1]), 0.0, 0.0, y.w_m, dw)
    y = state(motion, s)
    return y, rates(motion, s, y)


def scales(motion: Motion) -> tuple[float, float]:
    """Return the time in which the free motion changes, and the time after which it has settled [s]."""
    if motion.kind == REST:
        return math.inf, 0.0
    if motion.kind == HELD:
        return 1.0 / motion.coefficients[0], 40.0 / motion.coefficients[0]
    if motion.kind == SERIES or is_step(motion):  # the error control keeps it short beside what happens in it
        return motion.length, math.inf
    if motion.kind == APART:
        one, other = motion.coefficients[0], motion.coefficients[2]
        slow, fast = min(one, other), max(one, other)
        return (1.0 / fast, 40.0 / (slow if slow > 0.0 else fast)) if fast > 0.0 else (math.inf, 0.0)
    a, c = motion.coefficients[0], motion.coefficients[1]
    rate = 2.0 * a + math.sqrt(abs(c))
    if rate == 0.0:
        return math.inf, 0.0
    if a * a >= c:
        return 1.0 / rate, 40.0 / rate
    return 1.0 / rate, 45.0 / a if a > 0.0 else math.inf


def fine_scales(m: Motion) -> tuple[float, float]:
    """Return `scales`; of a creep, which may be long, the time in which its speed would change at most.

    Of a step of a servo that warms up, those of the current that fades, as long as anything is left of it.
    """
    fine, settled = scales(m)
    if m.kind == WARMING:
        m = prepared(m)
        fast, left = m.long_dense[5].w, abs(m.long_dense[6].q_m) / _NOTHING
        return (_TIMES / fast, math.log(left) / fast) if fast > 0.0 and left > 1.0 else (fine, settled)
    if m.kind != CREEP:
        return fine, settled
    most = max(abs(rates(m, 0.0, m.start).w), abs(rates(m, m.length, m.end).w))
    change = abs(m.end.w - m.start.w)
    change = min(_SETTLING * change, _FADING * m.numbers.friction.w_s)
    fine = min(fine, change / most) if change > 0.0 else fine
    return fine, 10.0 * fine


def periodic(u: Piece, tau: Piece) -> bool:
    """Tell whether either of two inputs oscillates."""
    return u.amplitude != 0.0 or tau.amplitude != 0.0


def period(u: Piece, tau: Piece, t0: float, t1: float) -> float:
    """Return the shortest period [s] of two inputs between two times; inf where neither oscillates."""
    fastest = max(_frequency(u, t0, t1), _frequency(tau, t0, t1))
    return _TURN / fastest if fastest > 0.0 else math.inf


def _frequency(piece: Piece, t0: float, t1: float) -> float:
    if piece.amplitude == 0.0:
        return 0.0
    return max(abs(piece.frequency + piece.sweep * (t0 - piece.start)),
               abs(piece.frequency + piece.sweep * (t1 - piece.start)))


def monotone_until(motion: Motion, s: float, s1: float) -> float:
    """Return the end of an interval from s on, at most s1, in which the speed is monotone and inputs are simple."""
    kind = motion.kind
    if kind == WARMING and motion.mode.mesh == INSIDE:  # the distance of two bodies turns more often
        fast = motion.long_dense[5].w
        return _GONE / fast if fast * s < _GONE < fast * s1 else s1
    if kind == HELD or is_step(motion) or s1 - s <= 0.0:
        return s1
    if kind == REST or periodic(motion.u, motion.tau):
        if not periodic(motion.u, motion.tau) or not s1 < math.inf:
            return s1
        fine, settled = scales(motion)
        width = period(motion.u, motion.tau, motion.t0 + s, motion.t0 + s1) / 12.0
        if kind != REST and s < settled:
            width = min(width, 0.5 * fine)
        return s + width if s + width < s1 else s1
    # Between the zeros of the acceleration, which are known.
    a, c, f0, f1, _, _, _, q0, w0 = motion.coefficients
    dw = f0 - c * q0 - 2.0 * a * w0
    zero, spacing = second_order.first_zero(a, c, dw, f1 - c * w0 - 2.0 * a * dw)
    if zero <= s and spacing < math.inf:
        zero += math.floor((s - zero) / spacing) * spacing
        if zero <= s:
            zero += spacing
    settled = 45.0 / a if a > 0.0 else math.inf  # the free motion is below rounding from here on
    return zero if s < zero < min(s1, settled) else s1
