"""Creep: how a shaft moves at speeds at which static friction fades, under constant voltage and torque.

There its acceleration depends on its speed alone, and in no straight line. So the time that it takes from one speed to
another is an integral over the speed, t = ∫ dw/ẇ, and the angle q = ∫ w dw/ẇ. With w = ±σ² what is integrated is smooth
down to rest, where the speed leaves as √t would. The integral is cut where a torque or a share changes its sign, and
in halves until two Gauss-Kronrod rules agree.

Coefficients: R. Piessens et al., "QUADPACK", Springer 1983, rule of 21 points (qk21).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine import contacts, currents, twist
from servotwin.models.engine.contacts import friction_torque
from servotwin.models.engine.guards import SHARE, SPEED, ZONE_DOWN, ZONE_UP, creeping, geared, geared_speed, turns_alone
from servotwin.models.engine.modes import BACKWARD, FORWARD, NOWHERE, Mode, Vector, moving, slides
from servotwin.models.terms import shaft
from servotwin.models.terms.elastic import behind
from servotwin.models.terms.friction import creeping_speed, fades, share, static_share
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.motor import back_emf

_COUNT = 24  # a multiple of what a processor takes at once: the last three count nothing
_NODES = (
    0.002171418487095955, 0.013046735741414128, 0.03492125432214588, 0.06746831665550773, 0.10959113670679155,
    0.16029521585048778, 0.21862143266569767, 0.2833023029353764, 0.35280356864926987, 0.4255628305091844, 0.5,
    0.5744371694908156, 0.6471964313507301, 0.7166976970646236, 0.7813785673343023, 0.8397047841495122,
    0.8904088632932085, 0.9325316833444923, 0.9650787456778541, 0.9869532642585859, 0.997828581512904, 0.5, 0.5, 0.5,
)
_WEIGHTS = (
    0.005847319433685937, 0.016279081153982362, 0.027377948287175997, 0.03751983740545998, 0.0465627272918488,
    0.05469357940114882, 0.06174598813103292, 0.06735460865573667, 0.07138796928853004, 0.07386955245066924,
    0.07472277700145845, 0.07386955245066924, 0.07138796928853004, 0.06735460865573667, 0.06174598813103292,
    0.05469357940114882, 0.0465627272918488, 0.03751983740545998, 0.027377948287175997, 0.016279081153982362,
    0.005847319433685937, 0.0, 0.0, 0.0,
)
_FEWER = (  # those of the rule of 10 points among them
    0.0, 0.03333567215434407, 0.0, 0.0747256745752903, 0.0, 0.10954318125799102, 0.0, 0.13463335965499817, 0.0,
    0.14776211235737644, 0.0, 0.14776211235737644, 0.0, 0.13463335965499817, 0.0, 0.10954318125799102, 0.0,
    0.0747256745752903, 0.0, 0.03333567215434407, 0.0, 0.0, 0.0, 0.0,
)
IN_ANY_ORDER = ("_between",)  # functions whose sums a compiler may take side by side
_HALVINGS = 12  # of a range of speeds; one that needs more is for the integrator
_ROUNDS = 40
_INTO = 0.9  # of the speed at which friction begins to fade: up to there next to nothing of it has
_PART, _ROUNDING = 0.01, 2e-15  # of a tolerance: where two runs halve otherwise, they should not differ by more


class Crept(NamedTuple):
    """Where a creep has led after a time [s]: angle and speed, what ended it, and 1, or 0 where it cannot be told."""

    time: float
    q: float
    w: float
    ends_by: int  # a guard's number, or −1
    done: float


class _Course(NamedTuple):
    """What a shaft creeps by: torques of motor and load on the gear, each as its value at rest and its slope."""

    way: float  # −1 or +1
    m_0: float  # [N m]
    m_1: float  # [N m s/rad]
    e_0: float
    e_1: float
    against: float  # external torque [N m]


class _Between(NamedTuple):
    """Time [s] and angle [rad] between two speeds, and the relative error of the time; negative where none is."""

    time: float
    way: float
    error: float


def creeps(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> bool:
    """Tell whether a shaft that slides does so at a speed at which static friction fades."""
    slow = creeping_speed(numbers.friction)
    if abs(y.w) != slow:
        return abs(y.w) < slow
    return contacts.acceleration(numbers, mode, u, tau, y) * y.w < 0.0


def longest_step(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> float:
    """Return the time [s] beyond which a step by time would not see static friction fade; inf where it does not."""
    if not creeping(numbers, mode, y):
        return math.inf
    slow = creeping_speed(numbers.friction)
    fast = slow if geared(numbers, mode) == FORWARD else -slow
    most = max(_gain(numbers, mode, u, tau, y, 0.0), _gain(numbers, mode, u, tau, y, fast))
    return 2.0 * slow / most if most > 0.0 else math.inf


def part_before(numbers: Numbers, mode: Mode, before: Vector, after: Vector) -> float:
    """Return the part of a step by time after which friction begins to fade; 1 where it leads no further.

    What of a step lies beyond would not be seen, and spoils what lies before.
    """
    if not fades(numbers.friction) or not slides(geared(numbers, mode)) or creeping(numbers, mode, before):
        return 1.0
    way = 1.0 if geared(numbers, mode) == FORWARD else -1.0
    w, w_after = way * geared_speed(numbers, mode, before), way * geared_speed(numbers, mode, after)
    slow = creeping_speed(numbers.friction)
    return 1.0 if w_after >= _INTO * slow else (w - 0.5 * (1.0 + _INTO) * slow) / (w - w_after)


def _gain(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector, w: float) -> float:
    """Return the magnitude of the acceleration [rad/s²] that a body sliding in the gear has at a speed."""
    inside = turns_alone(numbers, mode)
    at = moving(y, y.q, y.w if inside else w, y.w_m if behind(numbers.elastic) else w)
    output, motor = twist.accelerations(warm(numbers, at), mode, u, tau, at)
    return abs(motor if inside else output)


def creep(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector, limit: float, tolerance: float) -> Crept:
    """Return where a shaft creeps to: to where its law changes, or within `limit` [s]; with a relative error."""
    q, w = y.q, y.w
    course = _course(numbers, mode, u, tau, 1.0 if w > 0.0 or (w == 0.0 and mode.contact == FORWARD) else -1.0)
    dw = _acceleration(numbers, course, w)
    there, ends_by = _next_change(numbers, mode, u, course, w, w == 0.0 or dw * course.way > 0.0)
    begin, end = math.sqrt(abs(w)), math.sqrt(abs(there))
    if there == w or (there < w) == (dw > 0.0):
        return Crept(0.0, q, w, ends_by, 1.0)
    tolerance = max(_PART * tolerance, _ROUNDING)
    for _ in range(_HALVINGS):
        found = _between(numbers, course, begin, end)
        size = 1.0 + abs(dw) * found.time + abs(found.way)
        if found.error >= 0.0 and found.error * size <= tolerance:
            if found.time <= limit:
                return Crept(found.time, q + found.way, there, ends_by, 1.0)
            return _within(numbers, course, q, begin, end, found.time, limit)
        end, ends_by = 0.5 * (begin + end), -1
        there = course.way * end * end
    return Crept(0.0, q, w, -1, 0.0)


def at_time(numbers: Numbers, mode: Mode, u: float, tau: float, start: Vector, end: Vector, length: float,
            s: float) -> tuple[float, float]:
    """Return angle and speed at s within a creep of a length [s] from one state to another."""
    course = _course(numbers, mode, u, tau, 1.0 if start.w + end.w > 0.0 else -1.0)
    there = _within(numbers, course, start.q, math.sqrt(abs(start.w)), math.sqrt(abs(end.w)), length, s)
    return there.q, there.w


def _course(numbers: Numbers, mode: Mode, u: float, tau: float, way: float) -> _Course:
    against = external_torque(numbers.load, tau, 0.0)
    m_0 = currents.drive_torque(numbers, mode.zone, u, NOWHERE)
    m_1 = currents.drive_torque(numbers, mode.zone, u, Vector(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    e_0, e_1 = torque_on_gear(against, 0.0, numbers.shaft.b_out), torque_on_gear(against, 1.0, numbers.shaft.b_out)
    return _Course(way, m_0, m_1 - m_0, e_0, e_1 - e_0, against)


def _next_change(numbers: Numbers, mode: Mode, u: float, course: _Course, w: float, away: bool) -> tuple[float, int]:
    """Return the next speed at which the law changes, on the way from rest or (not `away`) to it, and its guard."""
    own, (way, m_0, m_1, e_0, e_1, _) = numbers.friction, course
    end, ends_by = (way * creeping_speed(own), -1) if away else (0.0, SPEED)
    rises = away == (way > 0.0)
    low, high = currents.zone_limits(numbers, mode.zone, u)
    edge = (u - low if rises else u - high) / back_emf(1.0, numbers.motor.K_b)
    if _nearer(edge, w, end) or edge == w or (edge < w) == rises:  # a zone without width is left at once
        end, ends_by = edge, ZONE_DOWN if rises else ZONE_UP
    at = _root(share(own, m_0, e_0), share(own, m_1, e_1))
    if _nearer(at, w, end):
        end, ends_by = at, SHARE
    for at in (_root(static_share(own, m_0, e_0), static_share(own, m_1, e_1)), _root(e_0, e_1),
               _root(m_0 + e_0, m_1 + e_1), way * own.w_s):
        if _nearer(at, w, end):
            end, ends_by = at, -1
    return end, ends_by


def _nearer(at: float, w: float, end: float) -> bool:
    """Tell whether a speed lies between two others."""
    return w < at < end or end < at < w


def _root(at_rest: float, slope: float) -> float:
    """Return where a straight line is zero; nan where it is level."""
    return -at_rest / slope if slope != 0.0 else math.nan


def _acceleration(numbers: Numbers, course: _Course, w: float) -> float:
    """Return ẇ [rad/s²] on a course at a speed."""
    tau_m, tau_e = course.m_0 + course.m_1 * w, course.e_0 + course.e_1 * w
    contact = FORWARD if course.way > 0.0 else BACKWARD
    return shaft.acceleration(numbers.shaft, tau_m, w, friction_torque(numbers, contact, w, tau_m, tau_e),
                              course.against)


def _between(numbers: Numbers, course: _Course, begin: float, end: float) -> _Between:
    """Integrate over σ from `begin` to `end`."""
    span, way = end - begin, course.way
    time = fewer = turned = 0.0
    onward = 0
    for n in range(_COUNT):
        sigma = begin + span * _NODES[n]
        w = way * sigma * sigma
        dw = way * _acceleration(numbers, course, w)
        onward += 1 if dw * span > 0.0 else 0
        f = 2.0 * sigma / dw if dw != 0.0 else 0.0
        time += _WEIGHTS[n] * f
        fewer += _FEWER[n] * f
        turned += _WEIGHTS[n] * f * w
    apart = abs(time - fewer) / abs(time) if time != 0.0 else math.inf
    error = apart * math.sqrt(apart) if onward == _COUNT and apart < 1e-3 else -1.0
    return _Between(time * span, turned * span, error)


def _within(numbers: Numbers, course: _Course, q: float, begin: float, end: float, length: float,
            time: float) -> Crept:
    """Return where a creep from one σ to another, which would take a length [s], has led after a time [s]."""
    low, high = begin, end
    part = begin * begin + (end * end - begin * begin) * (time / length)
    sigma = math.sqrt(max(part, 0.0))
    found = _between(numbers, course, begin, sigma)
    for _ in range(_ROUNDS):
        miss = found.time - time
        if abs(miss) <= 4e-16 * time:
            break
        if miss > 0.0:
            high = sigma
        else:
            low = sigma
        dw = course.way * _acceleration(numbers, course, course.way * sigma * sigma)
        better = sigma - miss * dw / (2.0 * sigma) if sigma > 0.0 else 0.5 * (low + high)
        if not min(low, high) < better < max(low, high):
            better = 0.5 * (low + high)
        if better == sigma or better == low or better == high:
            break
        sigma = better
        found = _between(numbers, course, begin, sigma)
    return Crept(time, q + found.way, course.way * sigma * sigma, -1, 1.0)
