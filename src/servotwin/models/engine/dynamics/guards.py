"""Guards that end a mode.

A guard is at least zero as long as its mode lasts.
"""

from __future__ import annotations

import math

from servotwin.models.engine.dynamics import contacts, currents, spring_contact
from servotwin.models.state.modes import (
    BACKWARD,
    CORE,
    FORWARD,
    FREE,
    INSIDE,
    LOOSE,
    ON_FORWARD,
    ON_LOWER,
    ON_UPPER,
    PUSH_BACKWARD,
    PUSH_FORWARD,
    STUCK,
    TRAIL_BACKWARD,
    TRAIL_FORWARD,
    Mode,
    Vector,
    at_rest,
    moving,
    slides,
)
from servotwin.models.terms import elastic, friction, heat, play, shaft
from servotwin.models.terms.friction import core_speed, creeping_speed, fades, varying
from servotwin.models.terms.load import external_torque, stiffness_at
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics import motor
from servotwin.physics.load_friction import torque_on_gear

# Guards that end a mode: first what a shaft and a zone of its own have, then what play adds.
SPEED, CORE_FORWARD, CORE_BACKWARD, ZONE_UP, ZONE_DOWN, UPPER, LOWER, RELEASE_FORWARD, RELEASE_BACKWARD = range(9)
MEET_FORWARD, MEET_BACKWARD, PART, PART_OUTPUT, PART_MOTOR = range(9, 14)
MOTOR_SPEED, MOTOR_RELEASE_FORWARD, MOTOR_RELEASE_BACKWARD, SHARE, CREEPS = range(14, 19)
KINDS = 19
BELOW = -1e-13  # a guard counts as crossed below this (V, rad, rad/s, N m): rounding is not an event
IN_FLOATS = {"BELOW": -1e-6}
KINKS = (SHARE, CREEPS)  # of a law: no event that anybody would see
IN_CLOSED_FORM = 1 << SHARE | 1 << CREEPS  # what a creep has looked at itself
_CORE = 1 << CORE_FORWARD | 1 << CORE_BACKWARD
_RELEASE = 1 << RELEASE_FORWARD | 1 << RELEASE_BACKWARD
STOPS = 1 << UPPER | 1 << LOWER
MEETINGS = 1 << MEET_FORWARD | 1 << MEET_BACKWARD
_MOTOR_RELEASE = 1 << MOTOR_RELEASE_FORWARD | 1 << MOTOR_RELEASE_BACKWARD
EVENT_NAMES = ("speed zero", "core left", "core left", "zone", "zone", "upper stop", "lower stop",
               "release forward", "release backward", "gear meets", "gear meets", "gear parts", "gear parts",
               "gear parts", "motor speed zero", "motor release", "motor release")


def settled(numbers: Numbers, zone: int, u: float, tau: float, y: Vector, mesh: int, smooth: bool) -> Mode:
    """Return the mode of a state in a zone; `smooth` keeps a smoothed friction in one piece."""
    if heat.present(numbers.heat):
        return _settled(warm(numbers, y), zone, u, tau, y, mesh, smooth)
    return _settled(numbers, zone, u, tau, y, mesh, smooth)


def _settled(numbers: Numbers, zone: int, u: float, tau: float, y: Vector, mesh: int, smooth: bool) -> Mode:
    if elastic.present(numbers.elastic):
        return spring_contact.settled(numbers, zone, u, tau, y, mesh)
    return contacts.settled(numbers, zone, u, tau, y, mesh, smooth)


def guards(numbers: Numbers, mode: Mode, u: float, smooth: bool) -> int:
    """Return what can end this mode, as a sum of 1 << kind."""
    zone, shaft = mode.zone, mode.contact
    kinds = 0
    if shaft == CORE:
        if not smooth:
            kinds |= _CORE
    elif shaft == STUCK:
        kinds |= _RELEASE
    elif shaft == ON_UPPER:
        kinds |= 1 << RELEASE_BACKWARD
    elif shaft == ON_LOWER:
        kinds |= 1 << RELEASE_FORWARD
    elif shaft != FREE:
        kinds |= 1 << SPEED
    kinds |= 1 << SHARE if mode.share != 0 else 0
    if fades(numbers.friction) and slides(geared(numbers, mode)):
        kinds |= 1 << CREEPS
    low, high = currents.zone_limits(numbers, zone, u)
    if high < math.inf:
        kinds |= 1 << ZONE_UP
    if low > -math.inf:
        kinds |= 1 << ZONE_DOWN
    if numbers.stops.upper < math.inf and (shaft == FREE or shaft == FORWARD or shaft == CORE):
        kinds |= 1 << UPPER
    if numbers.stops.lower > -math.inf and (shaft == FREE or shaft == BACKWARD or shaft == CORE):
        kinds |= 1 << LOWER
    if elastic.present(numbers.elastic):
        kinds |= _of_spring(numbers, mode)
    elif mode.mesh == INSIDE:
        kinds |= MEETINGS
        if mode.motor == STUCK:
            kinds |= _MOTOR_RELEASE
        elif mode.motor != FREE:
            kinds |= 1 << MOTOR_SPEED
    elif play.present(numbers.play) and mode.motor != STUCK:  # unless they are held together
        kinds |= 1 << PART_MOTOR | 1 << PART_OUTPUT if at_rest(shaft) else 1 << PART
    return kinds


def _of_spring(numbers: Numbers, mode: Mode) -> int:
    """Return what else can end a mode of two bodies with a spring between them, as a sum of 1 << kind."""
    kinds = 0
    if not elastic.geared(numbers.elastic):
        return kinds
    if mode.motor == STUCK:
        kinds |= _MOTOR_RELEASE
    elif mode.motor != FREE:
        kinds |= 1 << MOTOR_SPEED
    if mode.mesh == LOOSE:
        kinds |= MEETINGS
    elif mode.mesh == PUSH_FORWARD or mode.mesh == PUSH_BACKWARD:
        kinds |= 1 << PART
    elif mode.mesh == TRAIL_FORWARD:
        kinds |= 1 << PART | 1 << MEET_FORWARD
    elif mode.mesh == TRAIL_BACKWARD:
        kinds |= 1 << PART | 1 << MEET_BACKWARD
    return kinds


def turns_alone(numbers: Numbers, mode: Mode) -> bool:
    """Tell whether the motor turns on its own, inside the play or before an elastic gear."""
    return mode.mesh == INSIDE or elastic.geared(numbers.elastic)


def geared(numbers: Numbers, mode: Mode) -> int:
    """Return the contact of the body that moves against the friction of the gear: the motor where it turns alone."""
    return mode.motor if turns_alone(numbers, mode) else mode.contact


def geared_speed(numbers: Numbers, mode: Mode, y: Vector) -> float:
    """Return the speed of what the gear's friction acts on; of rates, its acceleration."""
    return y.w_m if turns_alone(numbers, mode) else y.w


def creeping(numbers: Numbers, mode: Mode, y: Vector) -> bool:
    """Tell whether a body moves at speeds at which its friction fades."""
    if not fades(numbers.friction) or not slides(geared(numbers, mode)):
        return False
    return abs(geared_speed(numbers, mode, y)) <= creeping_speed(numbers.friction)


def guard(numbers: Numbers, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
          dy: Vector) -> tuple[float, float]:
    """Return a guard and its time derivative (nan where it is not known); the mode ends when it falls below zero."""
    q, w, dw = y.q, y.w, dy.w
    if kind == SPEED:
        sign = 1.0 if mode.contact == FORWARD else -1.0
        return sign * w - core_speed(numbers.friction), sign * dw
    if kind == CREEPS:
        sign = 1.0 if geared(numbers, mode) == FORWARD else -1.0
        return (sign * geared_speed(numbers, mode, y) - creeping_speed(numbers.friction),
                sign * geared_speed(numbers, mode, dy))
    if kind == CORE_FORWARD:
        return core_speed(numbers.friction) - w, -dw
    if kind == CORE_BACKWARD:
        return core_speed(numbers.friction) + w, dw
    if kind == UPPER:
        return numbers.stops.upper - q, -w
    if kind == LOWER:
        return q - numbers.stops.lower, w
    if play.present(numbers.play) and (kind == MEET_FORWARD or kind == MEET_BACKWARD or kind == MOTOR_SPEED):
        return _play_guard(numbers, mode, kind, u, tau, dtau, y, dy)
    if heat.present(numbers.heat):
        return _by_torque(warm(numbers, y), mode, kind, u, du, tau, dtau, y, dy)
    return _by_torque(numbers, mode, kind, u, du, tau, dtau, y, dy)


def _by_torque(numbers: Numbers, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
               dy: Vector) -> tuple[float, float]:
    """Return a guard that depends on currents and torques."""
    zone, q = mode.zone, y.q
    if kind == ZONE_UP or kind == ZONE_DOWN:
        w_m, dw_m = elastic.turning(numbers.elastic, y), elastic.turning(numbers.elastic, dy)
        x = currents.zone_variable(numbers, zone, u, q, w_m, y.i)
        rate = currents.zone_rate(numbers, zone, du, w_m, dw_m, dy.i)
        low, high = currents.zone_limits(numbers, zone, u)
        return (high - x, -rate) if kind == ZONE_UP else (x - low, rate)
    if kind == SHARE:
        tau_m = currents.drive_torque(numbers, zone, u, y)
        if elastic.present(numbers.elastic):
            return mode.share * spring_contact.through_gear(numbers, mode.mesh, tau_m, tau, y), _share_rate(
                numbers, mode, u, du, dtau, y, dy)
        return (mode.share * contacts.through_gear(numbers, mode.mesh, tau_m, tau, y),
                _share_slope(numbers, mode, dtau, y, dy))
    if elastic.present(numbers.elastic):
        return _spring_guard(numbers, mode, kind, u, du, tau, dtau, y, dy)
    if play.present(numbers.play) and kind >= MEET_FORWARD:
        return _play_guard(numbers, mode, kind, u, tau, dtau, y, dy)
    return _release_guard(numbers, mode, kind, u, du, tau, dtau, y, dy)


def _share_rate(numbers: Numbers, mode: Mode, u: float, du: float, dtau: float, y: Vector, dy: Vector) -> float:
    """Return the rate of the guard of a share through a gear with a spring; nan where it is not known."""
    di = dy.i
    if not inductive(numbers.motor):
        R = currents.resistance(numbers, mode.zone, u)
        di = motor.steady_armature_current(du, elastic.turning(numbers.elastic, dy), R, numbers.motor.K_b)
    slope = spring_contact.torque_slope(numbers, mode.mesh, y, dy)
    tau_e = -slope
    if elastic.behind(numbers.elastic):
        against = dtau + slope + stiffness_at(numbers.load, y.q) * y.w
        tau_e = torque_on_gear(against, dy.w, numbers.shaft.b_out)
    return mode.share * friction.share(numbers.friction, motor.electromagnetic_torque(di, numbers.motor.K), tau_e)


def _share_slope(numbers: Numbers, mode: Mode, dtau: float, y: Vector, dy: Vector) -> float:
    """Return the rate of the guard of a share where the current has inertia; nan where it has none.

    There the share goes with the speed, and one way where that does.
    """
    if not inductive(numbers.motor):
        return math.nan
    against = dtau + stiffness_at(numbers.load, y.q) * y.w
    on_gear = torque_on_gear(against, dy.w, numbers.shaft.b_out) if mode.mesh != INSIDE else 0.0
    return mode.share * friction.share(numbers.friction, motor.electromagnetic_torque(dy.i, numbers.motor.K), on_gear)


def share_along(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    """Return the guard of a share at a state, and the speed [rad/s] at which it is zero if all else stays constant.

    The speed is that of the body that slides against the gear.
    """
    if mode.share == 0:
        return 0.0, 0.0
    now = guard(numbers, mode, SHARE, u, 0.0, tau, 0.0, y, y)[0]
    still = moving(y, y.q, 0.0, 0.0)
    first = guard(numbers, mode, SHARE, u, 0.0, tau, 0.0, still, still)[0]
    return now, first * y.w_m / (first - now) if now != first else 0.0


def _release_guard(numbers: Numbers, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
                   dy: Vector) -> tuple[float, float]:
    torque, against = 0.0, external_torque(numbers.load, tau, y.q)
    di = dy.i
    if mode.mesh == INSIDE:
        di = 0.0
        backward = forward = contacts.output_friction(numbers)
    else:
        torque = currents.drive_torque(numbers, mode.zone, u, y)
        backward, forward = contacts.holding_bounds(numbers, torque, -against)
        if not inductive(numbers.motor):
            di = currents.current_slope(numbers, mode.zone, du)
    rate = motor.electromagnetic_torque(di, numbers.motor.K) - dtau if not varying(numbers.friction) else math.nan
    if kind == RELEASE_FORWARD:
        return forward - (torque - against), -rate
    return torque - against + backward, rate


def _spring_guard(numbers: Numbers, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
                  dy: Vector) -> tuple[float, float]:
    mesh, slope = mode.mesh, spring_contact.torque_slope(numbers, mode.mesh, y, dy)
    if kind == MOTOR_SPEED:
        sign = 1.0 if mode.motor == FORWARD else -1.0
        return sign * y.w_m, sign * dy.w_m
    if kind == MEET_FORWARD or kind == MEET_BACKWARD or kind == PART:
        return _meeting(numbers, mesh, kind, y, dy)
    di = dy.i if inductive(numbers.motor) else currents.current_slope(numbers, mode.zone, du)
    rate = motor.electromagnetic_torque(di, numbers.motor.K) - slope
    if kind == MOTOR_RELEASE_FORWARD or kind == MOTOR_RELEASE_BACKWARD:
        net, backward, forward = spring_contact.at_motor(numbers, mode.zone, mesh, u, y)
    else:
        net, backward, forward = spring_contact.at_output(numbers, mode.zone, mesh, u, tau, y)
        rate = slope - dtau if elastic.geared(numbers.elastic) else rate - dtau
    rate = math.nan if varying(numbers.friction) else rate
    if kind == MOTOR_RELEASE_FORWARD or kind == RELEASE_FORWARD:
        return forward - net, -rate
    return net + backward, rate


def _meeting(numbers: Numbers, mesh: int, kind: int, y: Vector, dy: Vector) -> tuple[float, float]:
    """Return the guard of a spring behind play that begins or ceases to push, and its rate."""
    half, ahead, rate = numbers.elastic.half, spring_contact.twist(numbers, y), spring_contact.twist_rate(numbers, y)
    if mesh == LOOSE:
        return (half - ahead, -rate) if kind == MEET_FORWARD else (half + ahead, rate)
    forward = mesh == PUSH_FORWARD or mesh == TRAIL_FORWARD
    if kind == PART and (mesh == TRAIL_FORWARD or mesh == TRAIL_BACKWARD):  # it comes back into the play
        return (ahead - half, rate) if forward else (-ahead - half, -rate)
    value, slope = spring_contact.push(numbers, forward, y), spring_contact.torque_slope(numbers, PUSH_FORWARD, y, dy)
    slope = slope if forward else -slope
    return (value, slope) if kind == PART else (-value, -slope)


def _play_guard(numbers: Numbers, mode: Mode, kind: int, u: float, tau: float, dtau: float, y: Vector,
                dy: Vector) -> tuple[float, float]:
    if kind == MEET_FORWARD:
        return numbers.play.half - (y.q_m - y.q), y.w - y.w_m
    if kind == MEET_BACKWARD:
        return numbers.play.half + (y.q_m - y.q), y.w_m - y.w
    if kind == PART:
        return contacts.pressing(numbers, mode, u, tau, y), _pressing_rate(numbers, mode, u, dtau, y, dy)
    if kind == MOTOR_SPEED:
        sign = 1.0 if mode.motor == FORWARD else -1.0
        return sign * y.w_m, sign * dy.w_m
    pushes = mode.mesh == ON_FORWARD
    if kind == PART_OUTPUT:  # it starts away from the motor
        against = external_torque(numbers.load, tau, y.q)
        if mode.contact == (ON_UPPER if pushes else ON_LOWER):
            return math.inf, 0.0
        return contacts.output_friction(numbers) + (against if pushes else -against), dtau if pushes else -dtau
    torque = currents.drive_torque(numbers, mode.zone, u, y)
    rate = motor.electromagnetic_torque(dy.i, numbers.motor.K)
    if kind == MOTOR_RELEASE_FORWARD or (kind == PART_MOTOR and not pushes):
        return contacts.motor_hold(numbers, True, torque) - torque, -rate
    return contacts.motor_hold(numbers, False, torque) + torque, rate


def _pressing_rate(numbers: Numbers, mode: Mode, u: float, dtau: float, y: Vector, dy: Vector) -> float:
    """Return the rate of `contacts.pressing` where the current has inertia; nan where it has none.

    There it goes with the speed, and one way where that does. The part of fading friction is left out.
    """
    if not inductive(numbers.motor) or y.w == 0.0:
        return math.nan
    torque, more = currents.drive_torque(numbers, mode.zone, u, y), motor.electromagnetic_torque(dy.i, numbers.motor.K)
    taken, _ = friction.share_slopes(numbers.friction, y.w > 0.0, 1.0 if torque > 0.0 else -1.0)
    gain = (shaft.motor_acceleration(numbers.shaft, (1.0 - taken) * more, dy.w, 0.0)
            - shaft.output_acceleration(numbers.shaft, dy.w, 0.0, dtau + stiffness_at(numbers.load, y.q) * y.w))
    return gain if mode.mesh == ON_FORWARD else -gain
