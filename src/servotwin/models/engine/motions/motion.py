"""How the state moves within one mode: in closed form wherever the mode is linear, else one integrator step.

A motion starts at its anchor t0 and gives the state at any later time t0 + s until its `length` is over.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics.coefficients import (
    against_of,
    apart_coefficients,
    current_of,
    fading_coefficients,
    linear_coefficients,
    speed_coefficients,
)
from servotwin.models.engine.dynamics.rates import jacobian, rates_of
from servotwin.models.engine.events.guards import creeping
from servotwin.models.engine.motions import (
    dormand_prince,
    first_order,
    rodas,
    second_order,
    stribeck,
    two_mass_series,
    warm_linear,
)
from servotwin.models.engine.motions.relative_motion import Course, both
from servotwin.models.engine.motions.rodas import Triple, not_constant
from servotwin.models.state.modes import (
    BACKWARD,
    CONDUCTING,
    CORE,
    CURRENT_BACKWARD,
    CURRENT_FORWARD,
    FORWARD,
    FREE,
    INSIDE,
    LINEAR,
    NO_CURRENT,
    NOWHERE,
    RIGID,
    Mode,
    Vector,
    at_rest,
    constant_current,
    in_linear_zone,
)
from servotwin.models.terms import elastic, follower, friction, heat, load, motor, play, sensor, source
from servotwin.models.terms.dependence import (
    BY_SHARE,
    CURVED_Q,
    CURVED_T,
    CURVED_W,
    FADING,
    ON_HEAT,
    ON_I,
    ON_Q,
    STEEP_W,
    TWO_BODIES,
)
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece, piece_rate, piece_value

# Kinds of motion. IMPOSSIBLE: no step is short enough for the tolerance.
(REST, FIRST_ORDER, SECOND_ORDER, WITH_CURRENT, HELD, SERIES, STEP, LONG_STEP, CREEP, APART, PAIR,
 WARMING, IMPOSSIBLE) = range(13)

_WITH_HEAT = ON_HEAT | ON_I | BY_SHARE | TWO_BODIES | FADING  # what a servo that is followed as it warms may ask for
_TURN = 2.0 * math.pi
_GONE = 2.0  # times that of what fades fast: most of it is over
# Error of one implicit step, relative to 1 + |state|, and of an explicit one: parts of the accuracy asked for
_TOLERANCE, FINE = 0.3, 1e-3
_ORIGIN = (0.0, 0.0, 0.0)
_NO_STAGES = (_ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN)
_NO_DENSE = (_ORIGIN, _ORIGIN, _ORIGIN)
_NO_LONG_DENSE = (NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE)
_NO_COEFFICIENTS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Motion(NamedTuple):
    """What moves, from where, and how."""

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
    return _closed(IMPOSSIBLE, numbers, nowhere, u, tau, math.inf, NOWHERE, _NO_COEFFICIENTS, (0.0, 0.0), 0.0)


def is_step(motion: Motion) -> bool:
    """Tell whether a motion is one step of an integrator, or a creep or a series, which end as one does."""
    return motion.kind == STEP or motion.kind == LONG_STEP or motion.kind == CREEP or motion.kind == PAIR or (
        motion.kind == WARMING)


def begin(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
          limit: float, accuracy: float) -> Motion:
    """Return the motion from y at t0 [s]: exact, or one step of at most `limit` [s] that is accurate enough [rad]."""
    still = at_rest(mode.contact) and (
        (mode.mesh != INSIDE and not elastic.present(numbers.elastic)) or at_rest(mode.motor))
    on, behind = dependence(numbers, mode, u, still), source.present(numbers.source)
    if still and not on & ON_HEAT and (not on & ON_I or constant_current(mode.zone)):
        return _closed(REST, numbers, mode, u, tau, t0, y, _NO_COEFFICIENTS, (0.0, 0.0), step)
    if on & ~BY_SHARE == TWO_BODIES and behind and not not_constant(tau):
        output_rate, output_pull, motor_rate, motor_pull = apart_coefficients(numbers, mode, u.value, tau.value)
        laws = (output_rate, output_pull, motor_rate, motor_pull, 0.0, 0.0, 0.0, 0.0, 0.0)
        return _closed(APART, numbers, mode, u, tau, t0, y, laws, (0.0, 0.0), step)
    if two_mass_series.linear(numbers, on, u, tau):
        return _pair(numbers, mode, u, tau, t0, y, step, limit)
    if heat.present(numbers.heat) and behind and not on & ~_WITH_HEAT and not not_constant(tau) and not elastic.present(
            numbers.elastic) and not (on & FADING and creeping(numbers, mode, y)):
        m = _warming(numbers, mode, u, tau, t0, y, step, limit, accuracy)
        if m.kind == WARMING:
            return m
    if on & (ON_HEAT | CURVED_W | TWO_BODIES) or (behind and (on & CURVED_Q or (on & ON_I and on & ON_Q))):
        return _long_step(numbers, mode, u, tau, t0, y, step, limit, accuracy)
    if on & FADING:
        steady = not (on & (ON_Q | ON_I | CURVED_T) or not_constant(tau))
        if not steady or stribeck.creeps(numbers, mode, u.value, tau.value, y):
            if steady:
                m = _creep(numbers, mode, u, tau, t0, y, step, limit, accuracy)
                if m.kind == CREEP:
                    return m
            return _long_step(numbers, mode, u, tau, t0, y, step, limit, accuracy)
    if on & ON_I and still and mode.zone >= CONDUCTING:
        rate, final = fading_coefficients(numbers, mode, u.value)
        return _closed(HELD, numbers, mode, u, tau, t0, y, (rate, final, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0),
                       step)
    if on & (CURVED_Q | STEEP_W | CURVED_T) or (on & ON_I and (still or (not behind and on & ON_Q))):
        return _integrated(numbers, mode, u, tau, t0, y, step, limit, accuracy)
    follows = in_linear_zone(mode.zone)
    wave = (u.value + u.slope * (t0 - u.start), u.slope, 0.0, 0.0, 0.0)
    if follows:
        wave = (wave[0], u.slope, u.amplitude, u.frequency, u.phase + u.frequency * (t0 - u.start))
    torque = (tau.value + tau.slope * (t0 - tau.start), tau.slope)
    if on & ON_I and not constant_current(mode.zone):
        against = against_of(numbers, mode, y.w, torque)
        coefficients = speed_coefficients(numbers, mode, wave, against, y.w, y.i)
        return _closed(WITH_CURRENT, numbers, mode, u, tau, t0, y, coefficients, against, step)
    coefficients = linear_coefficients(numbers, mode, wave, torque, y.q, y.w)
    _, c, _, f1, fs, _, _, _, _ = coefficients
    kind = FIRST_ORDER if c == 0.0 and f1 == 0.0 and fs == 0.0 else SECOND_ORDER
    return _closed(kind, numbers, mode, u, tau, t0, y, coefficients, (0.0, 0.0), step)


def dependence(numbers: Numbers, mode: Mode, u: Piece, still: bool) -> int:
    """Return on what the acceleration depends in a mode, as the terms have it; `still` where nothing moves."""
    alone = mode.mesh == INSIDE or elastic.geared(numbers.elastic)  # it is the motor that moves against the gear
    return (motor.depends(numbers.motor) | heat.depends(numbers.heat) | load.depends(numbers.load)
            | friction.depends(numbers.friction, mode.motor if alone else mode.contact)
            | play.depends(mode.mesh, still)
            | elastic.depends(numbers.elastic, still) | sensor.depends(numbers.sensor, numbers.source)
            | follower.depends(mode.zone, u))


def may_depend(numbers: Numbers, u: Piece) -> int:
    """Return on what the acceleration may depend while a servo moves, whichever way it slides and wherever it is."""
    forward, backward = (CORE, CORE) if friction.smoothed(numbers.friction) else (FORWARD, BACKWARD)
    mesh = INSIDE if play.present(numbers.play) else RIGID
    return (dependence(numbers, Mode(LINEAR, forward, mesh, FREE, 0), u, False)
            | dependence(numbers, Mode(CURRENT_FORWARD, forward, mesh, FREE, 0), u, False)
            | dependence(numbers, Mode(CURRENT_BACKWARD, backward, mesh, FREE, 0), u, False)
            | dependence(numbers, Mode(NO_CURRENT, backward, mesh, FREE, 0), u, False))


def _closed(kind: int, numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector,
            coefficients: tuple[float, ...], against: tuple[float, ...], step: float) -> Motion:
    return Motion(kind, numbers, mode, u, tau, t0, y, math.inf, coefficients, against, y, step, -1, False, _NO_STAGES,
                  _NO_DENSE, _NO_LONG_DENSE)


def by_series(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, length: float,
              speed: tuple[float, ...], current: tuple[float, ...]) -> Motion:
    """Return a motion whose speed and current are given as powers of time."""
    return Motion(SERIES, numbers, mode, u, tau, t0, y, length, speed, current, y, 0.0, -1, False, _NO_STAGES,
                  _NO_DENSE, _NO_LONG_DENSE)


def by_step(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, length: float,
            dense: tuple[Vector, ...], end: Vector) -> Motion:
    """Return a motion whose dense output is given."""
    return Motion(LONG_STEP, numbers, mode, u, tau, t0, y, length, _NO_COEFFICIENTS, (0.0, 0.0), end, 0.0, -1, True,
                  _NO_STAGES, _NO_DENSE, dense)


def _integrated(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
                limit: float, accuracy: float) -> Motion:
    jac = jacobian(numbers, mode, piece_value(u, t0), piece_rate(u, t0), piece_rate(tau, t0), y.q, y.w)
    h = min(step, limit)
    h = min(h, period(u, tau, t0, t0 + h) / 6.0)
    for _ in range(60):
        y1, error, stages = rodas.step(numbers, mode, u, tau, jac, t0, y, h)
        size = max(abs(error[0]) / (1.0 + abs(y1.q)), abs(error[1]) / (1.0 + abs(y1.w)),
                   abs(error[2]) / (1.0 + abs(y1.i))) / (_TOLERANCE * accuracy)
        if not size < 1e6:
            size = 1e6
        factor = min(5.0, max(0.1, 0.85 * size**-0.2)) if size > 0.0 else 5.0
        if size <= 1.0:
            return Motion(STEP, numbers, mode, u, tau, t0, y, h, _NO_COEFFICIENTS, (0.0, 0.0), y1, h * factor, -1,
                          False,
                          stages, _NO_DENSE, _NO_LONG_DENSE)
        h *= factor
        if t0 + h == t0:
            break
    return _closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, _NO_COEFFICIENTS, (0.0, 0.0), step)


def _long_step(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
               limit: float, accuracy: float) -> Motion:
    most = min(limit, stribeck.longest_step(numbers, mode, piece_value(u, t0), piece_value(tau, t0), y))
    h = min(step, most)
    h = min(h, period(u, tau, t0, t0 + h) / 3.0)
    if elastic.present(numbers.elastic):
        h = min(h, elastic.longest_step(numbers.elastic, numbers.shaft))
    for _ in range(60):
        y1, error = dormand_prince.step(numbers, mode, u, tau, t0, y, h)
        size = error / (FINE * accuracy)
        if not size < 1e12:
            size = 1e12
        factor = min(6.0, max(0.15, 0.9 * size**-0.125)) if size > 0.0 else 6.0
        part = stribeck.part_before(numbers, mode, y, y1) if size <= 1.0 else factor
        if part == 1.0:
            following = max(step, h * factor) if h == most else h * factor  # a step that was cut short tells little
            return Motion(LONG_STEP, numbers, mode, u, tau, t0, y, h, _NO_COEFFICIENTS, (0.0, 0.0), y1, following,
                          -1, False, _NO_STAGES, _NO_DENSE, _NO_LONG_DENSE)
        h *= part
        most = h if size <= 1.0 else most
        if t0 + h == t0:
            break
    return _closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, _NO_COEFFICIENTS, (0.0, 0.0), step)


def _creep(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float, limit: float,
           accuracy: float) -> Motion:
    """Return a creep, or a motion that is none where its end cannot be told."""
    time, q, w, ends_by, done = stribeck.creep(numbers, mode, u.value, tau.value, y, limit, FINE * accuracy)
    none = _closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, _NO_COEFFICIENTS, (0.0, 0.0), step)
    if done == 0.0 or (t0 + time == t0 and ends_by < 0):
        return none
    tolerance = (FINE * accuracy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Motion(CREEP, numbers, mode, u, tau, t0, y, time, tolerance, (0.0, 0.0),
                  _moved(none, q, w, 0.0), step, ends_by, True, _NO_STAGES, _NO_DENSE, _NO_LONG_DENSE)


def _warming(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float, limit: float,
             accuracy: float) -> Motion:
    """Return a step of a servo that warms up, or a motion that is none where its rates are not apart."""
    law = warm_linear.law_of(numbers, mode, u.value, tau.value, y)
    none = _closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, _NO_COEFFICIENTS, (0.0, 0.0), step)
    if not warm_linear.suits(law):
        return none
    h, found = warm_linear.follow(law, numbers.heat, y, limit, FINE * accuracy)
    if t0 + h == t0:
        return none
    output = _output_apart(numbers, mode, u, tau)
    end = warm_linear.state(numbers, mode, y, output, found.dense, h, h)
    following = min(step, 0.2 / law.fast) if law.fast > 0.0 else step
    return Motion(WARMING, numbers, mode, u, tau, t0, y, h, _NO_COEFFICIENTS, output, end, following, -1, True,
                  _NO_STAGES, _NO_DENSE, found.dense)


def _output_apart(numbers: Numbers, mode: Mode, u: Piece, tau: Piece) -> tuple[float, float]:
    """Return the law of an output that moves apart from the motor, (λ, f)."""
    if mode.mesh != INSIDE:
        return 0.0, 0.0
    apart = apart_coefficients(numbers, mode, u.value, tau.value)
    return apart.output_rate, apart.output_pull


def _warm_step(motion: Motion, s: float) -> warm_linear.Step:
    """Return the step of a servo that warms up, of a length s [s]."""
    law = warm_linear.law_of(motion.numbers, motion.mode, motion.u.value, motion.tau.value, motion.start)
    return warm_linear.step(law, motion.numbers.heat, motion.start, s)


def _pair(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
          limit: float) -> Motion:
    """Return the series of two bodies, as long as it holds."""
    law = two_mass_series.law(numbers, mode, u.value, tau.value)
    h = min(limit, two_mass_series.longest(law), elastic.longest_step(numbers.elastic, numbers.shaft))
    return Motion(PAIR, numbers, mode, u, tau, t0, y, h, _NO_COEFFICIENTS, (0.0, 0.0), two_mass_series.propagate(law,
                                                                                                                 y,
                                                                                                                 h),
                                                                                                                 step,
                  -1, True, _NO_STAGES, _NO_DENSE, law)


def prepared(motion: Motion) -> Motion:
    """Return the motion ready to be evaluated between the ends of a step."""
    if motion.has_dense or not is_step(motion):
        return motion
    dense, long_dense, against = motion.dense, motion.long_dense, motion.against
    if motion.kind == WARMING:
        found = _warm_step(motion, motion.length)
        long_dense = found.dense
        against = _output_apart(motion.numbers, motion.mode, motion.u, motion.tau)
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
        return _moved(motion, q, w, start.i)
    if kind == SECOND_ORDER:
        q, w = second_order.propagate(motion.coefficients, s)
        return _moved(motion, q, w, start.i)
    if kind == APART:
        c = motion.coefficients
        return both(Course(c[0], c[1], start.q, start.w), Course(c[2], c[3], start.q_m, start.w_m), start, s)
    if kind == WITH_CURRENT:
        w, dw, way = second_order.propagate_with_integral(motion.coefficients, s)
        against = motion.against[0] + motion.against[1] * s
        return _moved(motion, start.q + way, w, current_of(motion.numbers, motion.mode, dw, w, against))
    if kind == HELD:
        rate, final = motion.coefficients[0], motion.coefficients[1]
        return _moved(motion, start.q, start.w, start.i + (start.i - final) * math.expm1(-rate * s))
    if kind == SERIES:
        q = w = i = 0.0
        for n in range(len(motion.coefficients) - 1, -1, -1):
            w = w * s + motion.coefficients[n]
            q = q * s + motion.coefficients[n] / (n + 1)
        for n in range(len(motion.against) - 1, -1, -1):
            i = i * s + motion.against[n]
        return _moved(motion, start.q + q * s, w, i)
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
        return _moved(motion, q, w, start.i)
    x = s / motion.length
    if kind == STEP:
        return rodas.interpolate(start, motion.end, motion.dense, x)
    if kind == LONG_STEP:
        return dormand_prince.interpolate(start, motion.long_dense, x)
    return start


def ended(motion: Motion, s: float) -> Vector:
    """Return the state at s after the anchor where a motion ends: what is only interpolated there is followed anew."""
    if motion.kind != WARMING or not s > 0.0:
        return state(motion, s)
    found = _warm_step(motion, s)
    return warm_linear.state(motion.numbers, motion.mode, motion.start, (motion.against[0], motion.against[1]),
                             found.dense, s, s)


def _moved(motion: Motion, q: float, w: float, i: float) -> Vector:
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
        y = _moved(motion, motion.start.q + way, w, i)
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
