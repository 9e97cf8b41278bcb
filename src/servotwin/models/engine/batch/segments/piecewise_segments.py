"""A band: a range of speeds within which the acceleration is a straight line, for any law that is made of such.

With a regulator a source follows its resistance, gives its most, or has broken down; with load friction the share of
the torques has one sign or the other. Within a band a shaft slides on an arc, as in `linear_segments`; below all bands,
where static friction fades, it creeps. Everything here asks the laws of the general engine, so that a servo needs no
numbers but its own.
"""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.engine.batch.segments import linear_segments
from servotwin.models.engine.batch.segments.linear_segments import MOST_ARCS, Arc, Slid
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.coefficients import linear_coefficients
from servotwin.models.engine.dynamics.guards import CREEPS, SHARE, SPEED, ZONE_DOWN, ZONE_UP
from servotwin.models.engine.motions import stribeck
from servotwin.models.engine.motions.elementary import decay, fma
from servotwin.models.state.modes import BACKWARD, FORWARD, FREE, RIGID, Mode, Vector
from servotwin.models.terms.friction import creeping_speed, fades
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.motor import back_emf


class Starts(NamedTuple):
    """Which way a shaft at rest starts while driven forward, backward and not at all: −1, 0, +1."""

    forward: float
    backward: float
    off: float


class Band(NamedTuple):
    """An arc within a band and what ends it; of a shaft that creeps, what it would be without static friction."""

    arc: Arc
    ends_at: int  # a guard's number
    creeps: bool  # the speed is below all bands


def starts(numbers: Numbers, torque: float) -> Starts:
    """Return which way a shaft at rest starts under a constant external torque [N m]."""
    V = numbers.source.V
    return Starts(_start(numbers, V, torque), _start(numbers, -V, torque), _start(numbers, 0.0, torque))


def _start(numbers: Numbers, u: float, torque: float) -> float:
    zone = currents.zone_of(numbers, u, 0.0, 0.0, 0.0, 0.0)
    tau_m = currents.drive_torque(numbers, zone, u, _turning(0.0))
    backward, forward = contacts.holding_bounds(numbers, tau_m, -torque)
    return linear_segments.starting(forward, backward, tau_m - torque)


def start_of(begins: Starts, drive: float) -> float:
    """Return which way a shaft at rest starts: −1, 0, +1."""
    driven = begins.forward if drive > 0.0 else begins.backward
    return driven if drive != 0.0 else begins.off


def entered(numbers: Numbers, torque: float, u: float, forward: bool, w: float) -> tuple[int, int]:
    """Return the zone of the current and the sign of the share at a speed, under the voltage u behind the bridge."""
    zone = currents.zone_of(numbers, u, 0.0, 0.0, w, 0.0)
    return zone, contacts.share_sign(
        numbers, zone, FORWARD if forward else BACKWARD, RIGID, u, torque, _turning(w))


def band_at(numbers: Numbers, torque: float, u: float, forward: bool, zone: int, share: int, w: float) -> Band:
    """Return the band of a shaft that slides with the speed w, or starts from rest."""
    mode = mode_of(numbers, forward, zone, share)
    a, _, f, _, _, _, _, _, _ = linear_coefficients(numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (torque, 0.0), 0.0, w)
    rate = 2.0 * a
    pull = fma(-rate, w, f)
    rises = pull > 0.0
    low, high = currents.zone_limits(numbers, zone, u)
    edge = (u - low if rises else u - high) / back_emf(1.0, numbers.motor.K_b)
    ends_at = ZONE_DOWN if rises else ZONE_UP
    slow = creeping_speed(numbers.friction)
    slows, last = rises != forward, slow if forward else -slow
    if slows and (edge > last) == rises:
        edge, ends_at = last, CREEPS if slow > 0.0 else SPEED
    if share != 0:
        still = share * contacts.through_gear(numbers, RIGID, _torque(numbers, zone, u, 0.0), torque, _turning(0.0))
        slope = share * contacts.through_gear(
            numbers, RIGID, _torque(numbers, zone, u, 1.0), torque, _turning(1.0)) - still
        turn = -still / slope if slope != 0.0 else edge
        if slope * pull < 0.0 and (turn < edge if rises else turn > edge):
            edge, ends_at = max(turn, w) if rises else min(turn, w), SHARE
    arc = Arc(rate, 1.0 / rate if rate > 0.0 else 0.0, pull, edge, fma(-rate, edge, f))
    return Band(arc, ends_at, abs(w) < slow or (abs(w) == slow and slow > 0.0 and slows))


def edge_speed(numbers: Numbers, torque: float, u: float, zone: int, share: int, ends_at: int) -> float:
    """Return the speed at which a band ends so, for which the numbers of a servo may have changed since it began."""
    if ends_at == SPEED:
        return 0.0
    if ends_at == SHARE:
        still = contacts.through_gear(numbers, RIGID, _torque(numbers, zone, u, 0.0), torque, _turning(0.0))
        return still / (still - contacts.through_gear(
            numbers, RIGID, _torque(numbers, zone, u, 1.0), torque, _turning(1.0)))
    low, high = currents.zone_limits(numbers, zone, u)
    return (u - low if ends_at == ZONE_DOWN else u - high) / back_emf(1.0, numbers.motor.K_b)


def mode_of(numbers: Numbers, forward: bool, zone: int, share: int) -> Mode:
    """Return the mode of a shaft that slides."""
    return Mode(zone, FREE if not contacts.has_friction(numbers) else FORWARD if forward else BACKWARD, RIGID, FREE,
                share)


def beyond(ends_at: int, zone: int, share: int) -> tuple[int, int]:
    """Return zone and share behind the end of a band."""
    step = 1 if ends_at == ZONE_UP else -1 if ends_at == ZONE_DOWN else 0
    return zone + step, -share if ends_at == SHARE else share


def slide(numbers: Numbers, torque: float, begins: Starts, drive: float, q: float, w: float, time: float,
          tolerance: float) -> Slid:
    """Return where a shaft slides to within `time` [s] under one drive (−1, 0, +1)."""
    start = start_of(begins, drive)
    if w == 0.0 and start == 0.0:
        return Slid(q, w, q, 1.0)
    forward = w > 0.0 or (w == 0.0 and start > 0.0)
    zone, share = entered(numbers, torque, drive * numbers.source.V, forward, w)
    return slide_on(numbers, torque, start, drive, forward, zone, share, q, w, time, tolerance)


def slide_on(numbers: Numbers, torque: float, start: float, drive: float, forward: bool, zone: int, share: int,
             q: float, w: float, time: float, tolerance: float) -> Slid:
    """Return the same for a shaft in a known band that moves or starts."""
    u, turned = drive * numbers.source.V, q
    for _ in range(MOST_ARCS):
        q, w, time, ends_at, done = leg(numbers, torque, u, forward, zone, share, q, w, time, tolerance)
        if done == 0.0 or not numbers.stops.lower < q < numbers.stops.upper:
            return Slid(q, w, turned, 0.0)
        if ends_at == SPEED:
            turned, forward = q, start > 0.0
        if time == 0.0 or (ends_at == SPEED and start == 0.0):
            return Slid(q, w, turned, 1.0)
        zone, share = beyond(ends_at, zone, share)
    return Slid(q, w, turned, 0.0)


class Leg(NamedTuple):
    """Where an arc or a creep has led: angle, speed, time left [s], what ended it or −1, and 1, or 0 if it gave up."""

    q: float
    w: float
    left: float
    ends_at: int
    done: float


def leg(numbers: Numbers, torque: float, u: float, forward: bool, zone: int, share: int, q: float, w: float,
        time: float, tolerance: float) -> Leg:
    """Return where a shaft slides to within its band, or creeps to, in `time` [s] at most."""
    if fades(numbers.friction):
        mode, y = mode_of(numbers, forward, zone, share), Vector(q, w, 0.0, 0.0, 0.0, q, w)
        if stribeck.creeps(numbers, mode, u, torque, y):
            crept = stribeck.creep(numbers, mode, u, torque, y, time, tolerance)
            return Leg(crept.q, crept.w, max(time - crept.time, 0.0), crept.ends_by, crept.done)
    arc, ends_at, _ = band_at(numbers, torque, u, forward, zone, share, w)
    once, twice = decay(arc.rate, arc.per_rate, time)
    after = fma(arc.pull, once, w)
    if not linear_segments.reaches_edge(arc, after):
        return Leg(fma(arc.pull, twice, fma(w, time, q)), after, 0.0, -1, 1.0)
    t, way = linear_segments.way_to_edge(w, arc.edge, arc.pull_there, arc.rate, arc.per_rate)
    return Leg(q + way, arc.edge, max(time - t, 0.0), ends_at, 1.0)


def _torque(numbers: Numbers, zone: int, u: float, w: float) -> float:
    return currents.drive_torque(numbers, zone, u, _turning(w))


def _turning(w: float) -> Vector:
    """Return the state of a shaft at the angle 0 with a speed."""
    return Vector(0.0, w, 0.0, 0.0, 0.0, 0.0, w)
