"""Which motion begins in a mode: in closed form wherever that is linear, else one integrator step.

Friction that fades with speed is a magnitude of several torques through the gear: K_m τ_m − K_e τ_e, and while any
static friction is left K_ms τ_m − K_es τ_e, and τ_e or τ_m + τ_e for what is quadratic in them. Where one of them
changes its sign, rates have a kink, or jump. A step that leads across is less accurate than its error says, and so is
what is interpolated within it.
"""

from __future__ import annotations

from servotwin.models.engine.dynamics import currents, spring_contact
from servotwin.models.engine.dynamics.coefficients import (
    against_of,
    apart_coefficients,
    fading_coefficients,
    linear_coefficients,
    speed_coefficients,
)
from servotwin.models.engine.dynamics.guards import creeping, geared
from servotwin.models.engine.motions import dormand_prince, rodas, stribeck, two_mass_series, warm_linear
from servotwin.models.engine.motions.motion import (
    APART,
    CREEP,
    FINE,
    FIRST_ORDER,
    HELD,
    IMPOSSIBLE,
    LONG_STEP,
    NO_COEFFICIENTS,
    NO_DENSE,
    NO_LONG_DENSE,
    NO_STAGES,
    PAIR,
    REST,
    SECOND_ORDER,
    STEP,
    WARMING,
    WITH_CURRENT,
    Motion,
    closed,
    jacobian_at,
    moved,
    output_apart,
    period,
)
from servotwin.models.engine.motions.rodas import not_constant
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
    RIGID,
    Mode,
    Vector,
    at_rest,
    constant_current,
    in_linear_zone,
    slides,
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
from servotwin.models.terms.friction import Friction, fades, share, static_share
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.elementary import power
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.pieces import Piece, piece_value

# --- Kinks of friction that fades: a step by time ends where one is ---------------------------------------------------

_CLOSE = 1e-6  # of a step: a kink that close to one of its ends is at that end
_NOTHING = 1e-12  # of the torques: less than that has no sign
IN_FLOATS = {"_CLOSE": 1e-3, "_NOTHING": 1e-5}


def part_before(numbers: Numbers, mode: Mode, u: tuple[float, float], tau: tuple[float, float], before: Vector,
                after: Vector) -> float:
    """Return the part of a step by time after which there is a kink; 1 where there is none.

    `u` and `tau` are the inputs at both ends.
    """
    if not fades(numbers.friction) or not slides(geared(numbers, mode)):
        return 1.0
    own = numbers.friction
    m_0, e_0 = _through_gear(numbers, mode, u[0], tau[0], before)
    m_1, e_1 = _through_gear(numbers, mode, u[1], tau[1], after)
    none = _NOTHING * (abs(m_0) + abs(e_0) + abs(m_1) + abs(e_1))
    part = _part(share(own, m_0, e_0), share(own, m_1, e_1), none)
    if creeping(numbers, mode, before) or creeping(numbers, mode, after):
        part = min(part, _part(static_share(own, m_0, e_0), static_share(own, m_1, e_1), none))
        if _is_quadratic(own):
            part = min(part, _part(e_0, e_1, none), _part(m_0 + e_0, m_1 + e_1, none))
    return part


def _is_quadratic(friction: Friction) -> bool:
    return friction.K_mq > 0.0 or friction.K_eq > 0.0


def _part(begin: float, end: float, none: float) -> float:
    """Return the part of a step after which a torque changes its sign that goes from one value to another."""
    if not ((begin < -none and end > none) or (end < -none and begin > none)):
        return 1.0
    part = begin / (begin - end)
    return part if _CLOSE < part < 1.0 - _CLOSE else 1.0


def _through_gear(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    """Return the torques of motor and load on the gear [N m], in +q."""
    numbers = warm(numbers, y)
    tau_m = currents.drive_torque(numbers, mode.zone, u, y)
    if elastic.present(numbers.elastic):
        return tau_m, spring_contact.on_gear(numbers, mode.mesh, tau, y)
    if mode.mesh == INSIDE:
        return tau_m, 0.0
    return tau_m, torque_on_gear(external_torque(numbers.load, tau, y.q), y.w, numbers.shaft.b_out)


# --- Which motion begins in a mode: in closed form wherever that is linear, else one integrator step ------------------

_WITH_HEAT = ON_HEAT | ON_I | BY_SHARE | TWO_BODIES | FADING  # what may be asked of a step beside the straight law
_TOLERANCE = 0.3  # error of one implicit step, relative to 1 + |state|: a part of the accuracy asked for


def begin(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
          limit: float, accuracy: float) -> Motion:
    """Return the motion from y at t0 [s]: exact, or one step of at most `limit` [s] that is accurate enough [rad]."""
    still = at_rest(mode.contact) and (
        (mode.mesh != INSIDE and not elastic.present(numbers.elastic)) or at_rest(mode.motor))
    on, behind = dependence(numbers, mode, u, still), source.present(numbers.source)
    if still and not on & ON_HEAT and (not on & ON_I or constant_current(mode.zone)):
        return closed(REST, numbers, mode, u, tau, t0, y, NO_COEFFICIENTS, (0.0, 0.0), step)
    if on & TWO_BODIES and on & ~BY_SHARE == TWO_BODIES and behind and not not_constant(tau):
        output_rate, output_pull, motor_rate, motor_pull = apart_coefficients(numbers, mode, u.value, tau.value)
        laws = (output_rate, output_pull, motor_rate, motor_pull, 0.0, 0.0, 0.0, 0.0, 0.0)
        return closed(APART, numbers, mode, u, tau, t0, y, laws, (0.0, 0.0), step)
    if elastic.present(numbers.elastic) and two_mass_series.linear(numbers, on, u, tau):
        return _pair(numbers, mode, u, tau, t0, y, step, limit)
    # Without inductance nothing is stiff: explicit steps are as long, and longer where a small winding warms fast
    if (heat.present(numbers.heat) and motor.inductive(numbers.motor) and behind and not on & ~_WITH_HEAT
            and not not_constant(tau) and not elastic.present(numbers.elastic)
            and not (on & FADING and creeping(numbers, mode, y))):
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
        return closed(HELD, numbers, mode, u, tau, t0, y, (rate, final, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0),
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
        return closed(WITH_CURRENT, numbers, mode, u, tau, t0, y, coefficients, against, step)
    coefficients = linear_coefficients(numbers, mode, wave, torque, y.q, y.w)
    _, c, _, f1, fs, _, _, _, _ = coefficients
    kind = FIRST_ORDER if c == 0.0 and f1 == 0.0 and fs == 0.0 else SECOND_ORDER
    return closed(kind, numbers, mode, u, tau, t0, y, coefficients, (0.0, 0.0), step)


def dependence(numbers: Numbers, mode: Mode, u: Piece, still: bool) -> int:
    """Return on what the acceleration depends in a mode, as the terms have it; `still` where nothing moves."""
    return (motor.depends(numbers.motor) | heat.depends(numbers.heat) | load.depends(numbers.load)
            # where the two move apart it is the motor that moves against the gear
            | friction.depends(numbers.friction, mode.motor if mode.mesh == INSIDE or elastic.geared(numbers.elastic)
                               else mode.contact)
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


def _integrated(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
                limit: float, accuracy: float) -> Motion:
    jac = jacobian_at(numbers, mode, u, tau, t0, y)
    h = min(step, limit)
    h = min(h, period(u, tau, t0, t0 + h) / 6.0)
    for _ in range(60):
        y1, error, stages = rodas.step(numbers, mode, u, tau, jac, t0, y, h)
        size = max(abs(error[0]) / (1.0 + abs(y1.q)), abs(error[1]) / (1.0 + abs(y1.w)),
                   abs(error[2]) / (1.0 + abs(y1.i))) / (_TOLERANCE * accuracy)
        if not size < 1e6:
            size = 1e6
        factor = min(5.0, max(0.1, 0.85 * power(size, -0.2))) if size > 0.0 else 5.0
        if size <= 1.0:
            return Motion(STEP, numbers, mode, u, tau, t0, y, h, NO_COEFFICIENTS, (0.0, 0.0), y1, h * factor, -1,
                          False, stages, NO_DENSE, NO_LONG_DENSE)
        h *= factor
        if t0 + h == t0:
            break
    return closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, NO_COEFFICIENTS, (0.0, 0.0), step)


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
        factor = min(6.0, max(0.15, 0.9 * power(size, -0.125))) if size > 0.0 else 6.0
        part = factor if size > 1.0 else min(
            stribeck.part_before(numbers, mode, y, y1),
            part_before(numbers, mode, (piece_value(u, t0), piece_value(u, t0 + h)),
                              (piece_value(tau, t0), piece_value(tau, t0 + h)), y, y1))
        if size <= 1.0 and (part == 1.0 or t0 + h * part == t0):
            following = max(step, h * factor) if h == most else h * factor  # a step that was cut short tells little
            return Motion(LONG_STEP, numbers, mode, u, tau, t0, y, h, NO_COEFFICIENTS, (0.0, 0.0), y1, following,
                          -1, False, NO_STAGES, NO_DENSE, NO_LONG_DENSE)
        h *= part
        most = h if size <= 1.0 else most
        if t0 + h == t0:
            break
    return closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, NO_COEFFICIENTS, (0.0, 0.0), step)


def _creep(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float, limit: float,
           accuracy: float) -> Motion:
    """Return a creep, or a motion that is none where its end cannot be determined."""
    time, q, w, ends_by, done = stribeck.creep(numbers, mode, u.value, tau.value, y, limit, FINE * accuracy)
    none = closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, NO_COEFFICIENTS, (0.0, 0.0), step)
    if done == 0.0 or (t0 + time == t0 and ends_by < 0):
        return none
    tolerance = (FINE * accuracy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Motion(CREEP, numbers, mode, u, tau, t0, y, time, tolerance, (0.0, 0.0),
                  moved(none, q, w, 0.0), step, ends_by, True, NO_STAGES, NO_DENSE, NO_LONG_DENSE)


def _warming(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float, limit: float,
             accuracy: float) -> Motion:
    """Return a step of a servo that warms up, or a motion that is none where its rates are not apart."""
    law = warm_linear.law_of(numbers, mode, u.value, tau.value, y)
    none = closed(IMPOSSIBLE, numbers, mode, u, tau, t0, y, NO_COEFFICIENTS, (0.0, 0.0), step)
    if not warm_linear.suits(law):
        return none
    h, found = warm_linear.follow(law, numbers.heat, y, limit, FINE * accuracy)
    if t0 + h == t0:
        return none
    output = output_apart(numbers, mode, u, tau)
    end = warm_linear.state(numbers, mode, y, output, found.dense, h, h)
    following = min(step, 0.2 / law.fast) if law.fast > 0.0 else step
    return Motion(WARMING, numbers, mode, u, tau, t0, y, h, NO_COEFFICIENTS, output, end, following, -1, True,
                  NO_STAGES, NO_DENSE, found.dense)


def _pair(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t0: float, y: Vector, step: float,
          limit: float) -> Motion:
    """Return the series of two bodies, as long as it holds."""
    law = two_mass_series.law(numbers, mode, u.value, tau.value)
    h = min(limit, two_mass_series.longest(law), elastic.longest_step(numbers.elastic, numbers.shaft))
    return Motion(PAIR, numbers, mode, u, tau, t0, y, h, NO_COEFFICIENTS, (0.0, 0.0),
                  two_mass_series.propagate(law, y, h), step, -1, True, NO_STAGES, NO_DENSE, law)
