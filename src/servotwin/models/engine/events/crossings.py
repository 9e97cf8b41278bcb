"""The mode after the end of another, and what events are called."""

from __future__ import annotations

import math

from servotwin.models.engine.dynamics import contacts, currents, guards, spring_contact
from servotwin.models.engine.dynamics.guards import (
    CORE_BACKWARD,
    CORE_FORWARD,
    CREEPS,
    LOWER,
    MEET_BACKWARD,
    MEET_FORWARD,
    MOTOR_RELEASE_BACKWARD,
    MOTOR_RELEASE_FORWARD,
    MOTOR_SPEED,
    PART,
    PART_MOTOR,
    PART_OUTPUT,
    RELEASE_BACKWARD,
    RELEASE_FORWARD,
    SHARE,
    SPEED,
    UPPER,
    ZONE_DOWN,
    ZONE_UP,
    geared,
    turns_alone,
)
from servotwin.models.state.modes import (
    BACKWARD,
    CONDUCTING,
    CORE,
    FORWARD,
    FREE,
    INSIDE,
    LIMITED_BACKWARD,
    LIMITED_FORWARD,
    LOOSE,
    NO_CURRENT,
    ON_BACKWARD,
    ON_FORWARD,
    ON_LOWER,
    ON_UPPER,
    PUSH_BACKWARD,
    PUSH_FORWARD,
    TRAIL_BACKWARD,
    TRAIL_FORWARD,
    Mode,
    Vector,
    at_rest,
    moving,
)
from servotwin.models.terms import elastic, heat, play, source
from servotwin.models.terms.friction import creeping_speed, smoothed
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.stops import Stops

# --- The mode after the end of another: how it continues, and where a guard has reached zero --------------------------

def cross(numbers: Numbers, mode: Mode, kind: int, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state just after the guard `kind` of `mode` has reached zero."""
    if heat.present(numbers.heat):
        return _crossed(warm(numbers, y), mode, kind, u, tau, y)
    return _crossed(numbers, mode, kind, u, tau, y)


def _crossed(numbers: Numbers, mode: Mode, kind: int, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    zone, shaft, mesh, motor, share = mode
    if kind == ZONE_UP or kind == ZONE_DOWN:
        if currents.by_current(numbers, zone):
            y = _with_current_at_edge(numbers, zone, kind, u, y)
            w_m = elastic.turning(numbers.elastic, y)
            return Mode(currents.zone_of(numbers, u, 0.0, y.q, w_m, y.i), shaft, mesh, motor, share), y
        zone = currents.neighbour(numbers, zone, kind == ZONE_UP)
        if share != 0 and not elastic.present(numbers.elastic):
            share = contacts.share_sign(numbers, zone, geared(numbers, mode), mesh, u, tau, y)
        return Mode(zone, shaft, mesh, motor, share), y
    if kind == SHARE:
        return Mode(zone, shaft, mesh, motor, -share), y
    if kind == CREEPS:
        slow = creeping_speed(numbers.friction)
        w = slow if geared(numbers, mode) == FORWARD else -slow
        after = moving(y, y.q, y.w if turns_alone(numbers, mode) else w,
                       y.w_m if elastic.behind(numbers.elastic) else w)
        return mode, after
    if elastic.present(numbers.elastic):
        return _cross_spring(numbers, mode, kind, u, tau, y)
    if kind == SPEED and smoothed(numbers.friction):
        return Mode(zone, CORE, mesh, motor, 0), y
    if kind == CORE_FORWARD or kind == CORE_BACKWARD:
        return Mode(zone, FORWARD if kind == CORE_FORWARD else BACKWARD, mesh, motor, 0), y
    if kind == UPPER or kind == LOWER:
        return contacts.rebound(numbers, mode, kind == UPPER, u, tau, y)
    if kind == RELEASE_FORWARD or kind == RELEASE_BACKWARD:
        if kind == RELEASE_FORWARD and y.q >= numbers.stops.upper:
            return Mode(zone, ON_UPPER, mesh, motor, 0), y
        if kind == RELEASE_BACKWARD and y.q <= numbers.stops.lower:
            return Mode(zone, ON_LOWER, mesh, motor, 0), y
        shaft = FORWARD if kind == RELEASE_FORWARD else BACKWARD
        dry = contacts.holds(numbers) if mesh == INSIDE else contacts.has_friction(numbers)
        shaft = shaft if dry else FREE
        share = share if mesh == INSIDE else contacts.share_sign(numbers, zone, shaft, mesh, u, tau, y)
        return Mode(zone, shaft, mesh, motor, share), y
    if kind == MOTOR_RELEASE_FORWARD or kind == MOTOR_RELEASE_BACKWARD:
        motor = FORWARD if kind == MOTOR_RELEASE_FORWARD else BACKWARD
        return Mode(zone, shaft, mesh, motor, contacts.share_sign(numbers, zone, motor, mesh, u, tau, y)), y
    if play.present(numbers.play) and (kind == PART or kind == PART_OUTPUT or kind == PART_MOTOR):
        return contacts.apart(numbers, zone, u, tau, y), y
    q, w, i = y.q, y.w, y.i
    if play.present(numbers.play) and (kind == MEET_FORWARD or kind == MEET_BACKWARD):
        forward = kind == MEET_FORWARD
        y = play.met(numbers.play, numbers.shaft, forward, y)
        mesh = ON_FORWARD if forward else ON_BACKWARD
        stop = stop_ahead(numbers.stops, forward, q, y.w)
        if stop < math.inf and w != 0.0:  # it goes to and fro between motor and stop: in the end both stand
            y = play.with_motor(numbers.play, mesh, moving(y, stop, 0.0, 0.0))
        if source.present(numbers.source):
            zone = currents.zone_of(numbers, u, 0.0, q, y.w_m, i)
        if stop < math.inf and w == 0.0:  # it rests on a stop: both hit it at once
            return contacts.rebound(numbers, Mode(zone, shaft, mesh, motor, 0), forward, u, tau, y)
    elif kind == MOTOR_SPEED:
        y = moving(y, q, w, 0.0)
    else:
        y = moving(y, q, 0.0, y.w_m if mesh == INSIDE else 0.0)
    return contacts.settled(numbers, zone, u, tau, y, mesh, False), y


def stop_ahead(stops: Stops, forward: bool, q: float, w: float) -> float:
    """Return the stop to which a motor brings an output [rad, rad/s] without any way to go; inf: it does not.

    An output that has come from there goes to and fro between both, each time with less speed and no way at all, until
    in no time both rest.
    """
    stop, ahead = (stops.upper, w) if forward else (stops.lower, -w)
    return stop if ahead > 0.0 and abs(stop - q) <= contacts.REST_HEIGHT * max(abs(q), 1.0) else math.inf


def _cross_spring(numbers: Numbers, mode: Mode, kind: int, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state of two bodies with a spring between them after a guard has reached zero."""
    zone, contact, mesh, motor, _ = mode
    if kind == UPPER or kind == LOWER:
        return spring_contact.rebound(numbers, mode, kind == UPPER, u, tau, y)
    if kind == RELEASE_FORWARD or kind == RELEASE_BACKWARD:
        forward = kind == RELEASE_FORWARD
        contact = FREE if not spring_contact.is_dry(numbers) else FORWARD if forward else BACKWARD
        if forward and y.q >= numbers.stops.upper:
            contact = ON_UPPER
        if not forward and y.q <= numbers.stops.lower:
            contact = ON_LOWER
        return spring_contact.with_share(numbers, Mode(zone, contact, mesh, motor, 0), u, tau, y), y
    if kind == MOTOR_RELEASE_FORWARD or kind == MOTOR_RELEASE_BACKWARD:
        motor = FORWARD if kind == MOTOR_RELEASE_FORWARD else BACKWARD
        return spring_contact.with_share(numbers, Mode(zone, contact, mesh, motor, 0), u, tau, y), y
    if kind == MOTOR_SPEED:
        y = moving(y, y.q, y.w, 0.0)
    elif kind == SPEED:
        y = moving(y, y.q, 0.0, y.w_m)
    elif kind == MEET_FORWARD or kind == MEET_BACKWARD:
        mesh = PUSH_FORWARD if kind == MEET_FORWARD else PUSH_BACKWARD
    elif mesh == PUSH_FORWARD and spring_contact.twist_rate(numbers, y) < 0.0 and numbers.elastic.c > 0.0:
        mesh = TRAIL_FORWARD
    elif mesh == PUSH_BACKWARD and spring_contact.twist_rate(numbers, y) > 0.0 and numbers.elastic.c > 0.0:
        mesh = TRAIL_BACKWARD
    else:
        mesh = LOOSE
    return spring_contact.settled(numbers, zone, u, tau, y, mesh), y


def _with_current_at_edge(numbers: Numbers, zone: int, kind: int, u: float, y: Vector) -> Vector:
    """Return the state with the current where a zone of the current ends."""
    low, high = currents.zone_limits(numbers, zone, u)
    i = high if kind == ZONE_UP else low
    return Vector(y.q, y.w, 0.0 if i == 0.0 else i, y.T_w, y.T_h, y.q_m, y.w_m)


# --- Names of events: by a number in compiled code, by words everywhere else ------------------------------------------

NAMES = (
    *guards.EVENT_NAMES, "stick", "reversal", "current limited", "current stops", "current starts", "gear held",
    "drive backward", "drive ends", "drive forward", "silence ends", "silence begins", "pulse refused", "trip ends",
    "trips by overload", "trips by current", "trips by heat", "trips by undervoltage")
"""By their numbers; of several of one name the first is used."""
_FIRST = tuple(guards.EVENT_NAMES.index(name) for name in guards.EVENT_NAMES)
STICK, REVERSAL, LIMITED, STOPS, STARTS, HELD = range(len(guards.EVENT_NAMES), len(guards.EVENT_NAMES) + 6)
DRIVE_ENDS, SILENCE_ENDS, REFUSED, TRIP_ENDS = HELD + 2, HELD + 4, HELD + 6, HELD + 7
"""Beside `DRIVE_ENDS` stand both drives, behind `SILENCE_ENDS` that it begins, behind `TRIP_ENDS` the trips."""
NO_EVENT, _ZONE = -1, guards.EVENT_NAMES.index("zone")


def is_usual(kind: int) -> bool:
    """Tell whether an event comes with every pulse: of a bridge's drive, or of the zone of its current."""
    return kind == _ZONE or LIMITED <= kind <= STARTS or DRIVE_ENDS - 1 <= kind <= DRIVE_ENDS + 1


def kind_of(ended_by: int, after: Mode) -> int:
    """Return the number of an event that ends a mode (a guard) and after which another one holds.

    It is `NO_EVENT` for what nobody would see.
    """
    if ended_by < 0 or ended_by == guards.SHARE or ended_by == guards.CREEPS:
        return NO_EVENT
    if ended_by == guards.SPEED and at_rest(after.contact):
        return STICK
    if ended_by == guards.SPEED and after.contact != CORE:
        return REVERSAL
    if after.zone >= CONDUCTING and (ended_by == guards.ZONE_UP or ended_by == guards.ZONE_DOWN):
        if after.zone == LIMITED_BACKWARD or after.zone == LIMITED_FORWARD:
            return LIMITED
        return STOPS if after.zone == NO_CURRENT else STARTS
    return _FIRST[ended_by]
