"""What can end a mode, and what comes after it.

A guard is at least zero as long as its mode lasts.
"""

from __future__ import annotations

import math

from servotwin.models.engine import contacts, currents
from servotwin.models.engine.modes import (
    BACKWARD,
    CORE,
    FORWARD,
    FREE,
    INSIDE,
    ON_BACKWARD,
    ON_FORWARD,
    ON_LOWER,
    ON_UPPER,
    STUCK,
    Mode,
    Vector,
    at_rest,
    slides,
)
from servotwin.models.terms import play, source
from servotwin.models.terms.friction import core_speed, creeping_speed, fades, holding_friction, smoothed, varying
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics import motor

# What can end a mode: first what a shaft and a zone of its own have, then what play adds.
SPEED, CORE_FORWARD, CORE_BACKWARD, ZONE_UP, ZONE_DOWN, UPPER, LOWER, RELEASE_FORWARD, RELEASE_BACKWARD = range(9)
MEET_FORWARD, MEET_BACKWARD, PART, PART_OUTPUT, PART_MOTOR = range(9, 14)
MOTOR_SPEED, MOTOR_RELEASE_FORWARD, MOTOR_RELEASE_BACKWARD, SHARE, CREEPS = range(14, 19)
KINDS = 19
BELOW = -1e-13  # a guard counts as crossed below this (V, rad, rad/s, N m): rounding is not an event
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
    return contacts.settled(warm(numbers, y), zone, u, tau, y, mesh, smooth)


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
    if fades(numbers.friction) and slides(geared(mode)):
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
    if mode.mesh == INSIDE:
        kinds |= MEETINGS
        if mode.motor == STUCK:
            kinds |= _MOTOR_RELEASE
        elif mode.motor != FREE:
            kinds |= 1 << MOTOR_SPEED
    elif play.present(numbers.play):
        kinds |= 1 << PART_MOTOR | 1 << PART_OUTPUT if at_rest(shaft) else 1 << PART
    return kinds


def geared(mode: Mode) -> int:
    """Return the contact of the body that moves against the friction of the gear: inside the play the motor."""
    return mode.motor if mode.mesh == INSIDE else mode.contact


def creeping(numbers: Numbers, mode: Mode, y: Vector) -> bool:
    """Tell whether a body moves at speeds at which its friction fades."""
    if not fades(numbers.friction) or not slides(geared(mode)):
        return False
    return abs(y[6] if mode.mesh == INSIDE else y[1]) <= creeping_speed(numbers.friction)


def guard(numbers: Numbers, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
          dy: Vector) -> tuple[float, float]:
    """Return a guard and its time derivative (nan where it is not known); the mode ends when it falls below zero."""
    zone, shaft = mode.zone, mode.contact
    q, w, dw = y[0], y[1], dy[1]
    if kind == SPEED:
        sign = 1.0 if shaft == FORWARD else -1.0
        return sign * w - core_speed(numbers.friction), sign * dw
    if kind == CREEPS:
        sign = 1.0 if geared(mode) == FORWARD else -1.0
        by = 6 if mode.mesh == INSIDE else 1
        return sign * y[by] - creeping_speed(numbers.friction), sign * dy[by]
    if kind == CORE_FORWARD:
        return core_speed(numbers.friction) - w, -dw
    if kind == CORE_BACKWARD:
        return core_speed(numbers.friction) + w, dw
    if kind == UPPER:
        return numbers.stops.upper - q, -w
    if kind == LOWER:
        return q - numbers.stops.lower, w
    numbers = warm(numbers, y)
    if kind == ZONE_UP or kind == ZONE_DOWN:
        x = currents.zone_variable(numbers, zone, u, q, y[6], y[2])
        rate = currents.zone_rate(numbers, zone, du, y[6], dy[6], dy[2])
        low, high = currents.zone_limits(numbers, zone, u)
        return (high - x, -rate) if kind == ZONE_UP else (x - low, rate)
    if kind == SHARE:
        tau_m = currents.drive_torque(numbers, zone, u, y)
        return mode.share * contacts.through_gear(numbers, tau_m, tau, y), math.nan
    if play.present(numbers.play) and kind >= MEET_FORWARD:
        return _play_guard(numbers, mode, kind, u, tau, dtau, y, dy)
    return _release_guard(numbers, mode, kind, u, du, tau, dtau, y, dy)


def share_along(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    """Return the guard of a share at a state, and the speed [rad/s] at which it is zero if all else stays constant."""
    if mode.share == 0:
        return 0.0, 0.0
    now = guard(numbers, mode, SHARE, u, 0.0, tau, 0.0, y, y)[0]
    still = (y[0], 0.0, y[2], y[3], y[4], y[5], 0.0)
    first = guard(numbers, mode, SHARE, u, 0.0, tau, 0.0, still, still)[0]
    return now, first * y[1] / (first - now) if now != first else 0.0


def _release_guard(numbers: Numbers, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
                   dy: Vector) -> tuple[float, float]:
    torque, against = 0.0, external_torque(numbers.load, tau, y[0])
    di = dy[2]
    if mode.mesh == INSIDE:
        di = 0.0
        backward = forward = numbers.load.coulomb
    else:
        torque = currents.drive_torque(numbers, mode.zone, u, y)
        backward, forward = contacts.holding_bounds(numbers, torque, -against)
        if not inductive(numbers.motor):
            di = currents.current_slope(numbers, mode.zone, du)
    rate = motor.electromagnetic_torque(di, numbers.motor.K) - dtau if not varying(numbers.friction) else math.nan
    if kind == RELEASE_FORWARD:
        return forward - (torque - against), -rate
    return torque - against + backward, rate


def _play_guard(numbers: Numbers, mode: Mode, kind: int, u: float, tau: float, dtau: float, y: Vector,
                dy: Vector) -> tuple[float, float]:
    if kind == MEET_FORWARD:
        return numbers.play.half - (y[5] - y[0]), y[1] - y[6]
    if kind == MEET_BACKWARD:
        return numbers.play.half + (y[5] - y[0]), y[6] - y[1]
    if kind == PART:
        return contacts.pressing(numbers, mode, u, tau, y), math.nan
    if kind == MOTOR_SPEED:
        sign = 1.0 if mode.motor == FORWARD else -1.0
        return sign * y[6], sign * dy[6]
    pushes = mode.mesh == ON_FORWARD
    if kind == PART_OUTPUT:  # it starts away from the motor
        against = external_torque(numbers.load, tau, y[0])
        if mode.contact == (ON_UPPER if pushes else ON_LOWER):
            return math.inf, 0.0
        return numbers.load.coulomb + (against if pushes else -against), dtau if pushes else -dtau
    torque = currents.drive_torque(numbers, mode.zone, u, y)
    rate = motor.electromagnetic_torque(dy[2], numbers.motor.K)
    if kind == MOTOR_RELEASE_FORWARD or (kind == PART_MOTOR and not pushes):
        return holding_friction(numbers.friction, True, torque, 0.0) - torque, -rate
    return holding_friction(numbers.friction, False, torque, 0.0) + torque, rate


def cross(numbers: Numbers, mode: Mode, kind: int, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state just after the guard `kind` of `mode` has reached zero."""
    numbers = warm(numbers, y)
    zone, shaft, mesh, motor, share = mode
    if kind == ZONE_UP or kind == ZONE_DOWN:
        if currents.by_current(numbers, zone):
            y = _with_current_at_edge(numbers, zone, kind, u, y)
            return Mode(currents.zone_of(numbers, u, 0.0, y[0], y[6], y[2]), shaft, mesh, motor, share), y
        return Mode(currents.neighbour(numbers, zone, kind == ZONE_UP), shaft, mesh, motor, share), y
    if kind == SHARE:
        return Mode(zone, shaft, mesh, motor, -share), y
    if kind == CREEPS:
        slow = creeping_speed(numbers.friction)
        w = slow if geared(mode) == FORWARD else -slow
        return mode, (y[0], y[1] if mesh == INSIDE else w, y[2], y[3], y[4], y[5], w)
    if kind == SPEED and smoothed(numbers.friction):
        return Mode(zone, CORE, mesh, motor, 0), y
    if kind == CORE_FORWARD or kind == CORE_BACKWARD:
        return Mode(zone, FORWARD if kind == CORE_FORWARD else BACKWARD, mesh, motor, 0), y
    if kind == UPPER or kind == LOWER:
        return contacts.rebound(numbers, mode, kind == UPPER, u, tau, y)
    if kind == RELEASE_FORWARD or kind == RELEASE_BACKWARD:
        if kind == RELEASE_FORWARD and y[0] >= numbers.stops.upper:
            return Mode(zone, ON_UPPER, mesh, motor, 0), y
        if kind == RELEASE_BACKWARD and y[0] <= numbers.stops.lower:
            return Mode(zone, ON_LOWER, mesh, motor, 0), y
        shaft = FORWARD if kind == RELEASE_FORWARD else BACKWARD
        dry = contacts.holds(numbers) if mesh == INSIDE else contacts.has_friction(numbers)
        shaft = shaft if dry else FREE
        share = 0 if mesh == INSIDE else contacts.share_sign(numbers, zone, shaft, u, tau, y)
        return Mode(zone, shaft, mesh, motor, share), y
    if kind == MOTOR_RELEASE_FORWARD or kind == MOTOR_RELEASE_BACKWARD:
        return Mode(zone, shaft, mesh, FORWARD if kind == MOTOR_RELEASE_FORWARD else BACKWARD, 0), y
    if play.present(numbers.play) and (kind == PART or kind == PART_OUTPUT or kind == PART_MOTOR):
        return contacts.apart(numbers, zone, u, tau, y), y
    q, w, i, T_w, T_h, q_m, w_m = y
    if play.present(numbers.play) and (kind == MEET_FORWARD or kind == MEET_BACKWARD):
        y = play.met(numbers.play, numbers.shaft, kind == MEET_FORWARD, y)
        mesh = ON_FORWARD if kind == MEET_FORWARD else ON_BACKWARD
        upper = q >= numbers.stops.upper and y[1] > 0.0
        hits = upper or (q <= numbers.stops.lower and y[1] < 0.0)
        if hits and w != 0.0:  # it goes to and fro between motor and stop without any way to go: in the end both stand
            y = (q, 0.0, i, T_w, T_h, y[5], 0.0)
        if source.present(numbers.source):
            zone = currents.zone_of(numbers, u, 0.0, q, y[6], i)
        if hits and w == 0.0:  # it rests on a stop: both hit it at once
            return contacts.rebound(numbers, Mode(zone, shaft, mesh, motor, 0), upper, u, tau, y)
    elif kind == MOTOR_SPEED:
        y = (q, w, i, T_w, T_h, q_m, 0.0)
    else:
        y = (q, 0.0, i, T_w, T_h, q_m, w_m if mesh == INSIDE else 0.0)
    return contacts.settled(numbers, zone, u, tau, y, mesh, False), y


def _with_current_at_edge(numbers: Numbers, zone: int, kind: int, u: float, y: Vector) -> Vector:
    """Return the state with the current where a zone of the current ends."""
    low, high = currents.zone_limits(numbers, zone, u)
    i = high if kind == ZONE_UP else low
    return (y[0], y[1], 0.0 if i == 0.0 else i, y[3], y[4], y[5], y[6])
