"""A band: a range of speeds within which the acceleration is a straight line, for any law that is made of such.

With a regulator a source follows its resistance, gives its most, or has broken down; with load friction the share of
the torques has one sign or the other. Within a band a shaft slides on an arc, as in `arcs`; everything here asks the
laws of the general engine, so that a servo needs no numbers but its own.
"""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.engine import arcs, contacts, currents
from servotwin.models.engine.arcs import MOST_ARCS, Arc, Slid
from servotwin.models.engine.coefficients import linear_coefficients
from servotwin.models.engine.elementary import decay, fma
from servotwin.models.engine.modes import BACKWARD, FORWARD, FREE, RIGID, Mode, Vector
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.motor import back_emf

# At what an arc ends.
STOP, ZONE_ABOVE, ZONE_BELOW, TURN = 0, 1, 2, 3


class Starts(NamedTuple):
    """Which way a shaft at rest starts while driven forward, backward and not at all: −1, 0, +1."""

    forward: float
    backward: float
    off: float


class Band(NamedTuple):
    """An arc within a band, what ends it, and the band's zone of the current and sign of the share."""

    arc: Arc
    ends_at: int
    zone: int
    share: int


def starts(numbers: Numbers, torque: float) -> Starts:
    """Return which way a shaft at rest starts under a constant external torque [N m]."""
    V = numbers.source.V
    return Starts(_start(numbers, V, torque), _start(numbers, -V, torque), _start(numbers, 0.0, torque))


def _start(numbers: Numbers, u: float, torque: float) -> float:
    zone = currents.zone_of(numbers, u, 0.0, 0.0, 0.0, 0.0)
    tau_m = currents.drive_torque(numbers, zone, u, _turning(0.0))
    backward, forward = contacts.holding_bounds(numbers, tau_m, -torque)
    return arcs.starting(forward, backward, tau_m - torque)


def start_of(begins: Starts, drive: float) -> float:
    """Return which way a shaft at rest starts: −1, 0, +1."""
    driven = begins.forward if drive > 0.0 else begins.backward
    return driven if drive != 0.0 else begins.off


def entered(numbers: Numbers, torque: float, u: float, forward: bool, w: float) -> tuple[int, int]:
    """Return the zone of the current and the sign of the share at a speed, under the voltage u behind the bridge."""
    zone = currents.zone_of(numbers, u, 0.0, 0.0, w, 0.0)
    return zone, contacts.share_sign(numbers, zone, FORWARD if forward else BACKWARD, u, torque, _turning(w))


def band_at(numbers: Numbers, torque: float, u: float, forward: bool, zone: int, share: int, w: float) -> Band:
    """Return the band of a shaft that slides with the speed w, or starts from rest."""
    contact = FREE if not contacts.has_friction(numbers) else FORWARD if forward else BACKWARD
    mode = Mode(zone, contact, RIGID, FREE, share)
    a, _, f, _, _, _, _, _, _ = linear_coefficients(
        numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (torque, 0.0), 0.0, w)
    rate = 2.0 * a
    pull = fma(-rate, w, f)
    rises = pull > 0.0
    low, high = currents.zone_limits(numbers, zone, u)
    per_speed = back_emf(1.0, numbers.motor.K_b)
    edge = (u - low if rises else u - high) / per_speed
    ends_at = ZONE_BELOW if rises else ZONE_ABOVE
    if rises != forward and (edge > 0.0) == rises:
        edge, ends_at = 0.0, STOP
    if share != 0:
        still = share * contacts.through_gear(numbers, _torque(numbers, zone, u, 0.0), torque, _turning(0.0))
        slope = share * contacts.through_gear(numbers, _torque(numbers, zone, u, 1.0), torque, _turning(1.0)) - still
        turn = -still / slope if slope != 0.0 else edge
        if slope * pull < 0.0 and (turn < edge if rises else turn > edge):
            edge, ends_at = max(turn, w) if rises else min(turn, w), TURN
    return Band(Arc(rate, 1.0 / rate if rate > 0.0 else 0.0, pull, edge, fma(-rate, edge, f)), ends_at, zone, share)


def beyond(ends_at: int, zone: int, share: int) -> tuple[int, int]:
    """Return zone and share behind the end of a band."""
    step = 1 if ends_at == ZONE_ABOVE else -1 if ends_at == ZONE_BELOW else 0
    return zone + step, -share if ends_at == TURN else share


def slide(numbers: Numbers, torque: float, begins: Starts, drive: float, q: float, w: float, time: float) -> Slid:
    """Return where a shaft slides to within `time` [s] under one drive (−1, 0, +1)."""
    start = start_of(begins, drive)
    if w == 0.0 and start == 0.0:
        return Slid(q, w, q, 1.0)
    forward = w > 0.0 or (w == 0.0 and start > 0.0)
    zone, share = entered(numbers, torque, drive * numbers.source.V, forward, w)
    return slide_on(numbers, torque, start, drive, forward, zone, share, q, w, time)


def slide_on(numbers: Numbers, torque: float, start: float, drive: float, forward: bool, zone: int, share: int,
             q: float, w: float, time: float) -> Slid:
    """Return the same for a shaft in a known band that moves or starts."""
    u, turned = drive * numbers.source.V, q
    for _ in range(MOST_ARCS):
        arc, ends_at, _, _ = band_at(numbers, torque, u, forward, zone, share, w)
        once, twice = decay(arc.rate, arc.per_rate, time)
        after = fma(arc.pull, once, w)
        ends = arcs.reaches_edge(arc, after)
        if ends:
            t, way = arcs.way_to_edge(w, arc.edge, arc.pull_there, arc.rate, arc.per_rate)
            q, w, time = q + way, arc.edge, max(time - t, 0.0)
        else:
            q, w = fma(arc.pull, twice, fma(w, time, q)), after
        if not numbers.stops.lower < q < numbers.stops.upper:
            return Slid(q, w, turned, 0.0)
        if ends and ends_at == STOP:
            turned, forward = q, start > 0.0
        if not ends or (w == 0.0 and ends_at == STOP and start == 0.0):
            return Slid(q, w, turned, 1.0)
        zone, share = beyond(ends_at, zone, share)
    return Slid(q, w, turned, 0.0)


def _torque(numbers: Numbers, zone: int, u: float, w: float) -> float:
    return currents.drive_torque(numbers, zone, u, _turning(w))


def _turning(w: float) -> Vector:
    """Return the state of a shaft at the angle 0 with a speed."""
    return 0.0, w, 0.0, 0.0, 0.0, 0.0, w
