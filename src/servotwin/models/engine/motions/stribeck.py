"""Creep: how a shaft moves at speeds at which static friction fades, under constant voltage and torque.

There its acceleration depends on its speed alone, and in no straight line. So the time that it takes from one speed to
another is an integral over the speed, t = ∫ dw/ẇ, and the angle q = ∫ w dw/ẇ. It is taken panel by panel. A panel is
given by the straight line through two points of the law: along it the speed is a known exponential v(ϑ) of a time ϑ,
and t = ∫ (v̇/ẇ) dϑ, which is smooth from rest to the final speed, where both accelerations come to nothing together.
With ϑ in steps of √w it is smooth at rest too, for every exponent. A panel is cut where a torque or a share changes its
sign, and halved until two Gauss-Kronrod rules agree. Where a time is given, the panel that this straight line has given
misses it by little: what is left is the next panel, forth or back, and so on until nothing is.

Coefficients: R. Piessens et al., "QUADPACK", Springer 1983, rules of 21 points (qk21) and of 7.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics import contacts, currents, spring_contact
from servotwin.models.engine.dynamics.contacts import friction_torque
from servotwin.models.engine.dynamics.guards import (
    SHARE,
    SPEED,
    ZONE_DOWN,
    ZONE_UP,
    creeping,
    geared,
    geared_speed,
    turns_alone,
)
from servotwin.models.engine.motions.elementary import decay, exp, log1p
from servotwin.models.state.modes import BACKWARD, FORWARD, NOWHERE, Mode, Vector, moving, slides
from servotwin.models.terms import shaft
from servotwin.models.terms.elastic import behind
from servotwin.models.terms.friction import creeping_speed, fades, share, static_share
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.motor import back_emf

PLAIN = True  # the compiler takes it for False
_POINTS, _COUNT = 21, 24  # a multiple of what a processor takes at once: the last three count nothing
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
_CLOSE_POINTS, _CLOSE_COUNT = 7, 8  # of the rule for panels in which the speed changes little
_CLOSE_NODES = (
    0.01975436564598986, 0.11270166537925831, 0.2828781253265987, 0.5, 0.7171218746734013, 0.8872983346207417,
    0.9802456343540101, 0.5,
)
_CLOSE_WEIGHTS = (
    0.05232811301323363, 0.13424404493416672, 0.20069870738798111, 0.22545826932923707, 0.20069870738798111,
    0.13424404493416672, 0.05232811301323363, 0.0,
)
_CLOSE_FEWER = (0.0, 0.2777777777777778, 0.0, 0.4444444444444444, 0.0, 0.2777777777777778, 0.0, 0.0)
IN_ANY_ORDER = ("_between", "_close")  # functions whose sums a compiler may take side by side
_PANELS = 40  # on one way; one that needs more is for the integrator
_GUESSES = 3  # of the speed at which a panel ends, where the final speed is before
_NEAR = 1e-7  # of a speed: within that a law is a straight line
_STILL = 1e-20  # rad/s: slower than that every law is one; friction that grows with the load alone never quite stops
_CLOSE = 0.1  # of a speed: within that few points are enough
_LONG = 3.0  # of a panel, in times in which a straight law settles
_SHORT = 4e-16  # of a time
_LONGEST = 100.0  # s: of a creep
_INTO = 0.9  # of the speed at which friction begins to fade: up to there next to nothing of it has
_PART, _ROUNDING = 0.1, 2e-15  # of a tolerance: where two runs halve otherwise, they should not differ by more
IN_FLOATS = {"_NEAR": 1e-3, "_SHORT": 2.4e-7, "_ROUNDING": 1e-6}


class Crept(NamedTuple):
    """Where a creep has led after a time [s]: angle and speed, what ended it, and 1, or 0 where it cannot be found."""

    time: float
    q: float
    w: float
    ends_by: int  # a guard's number, or −1
    done: float


class _Course(NamedTuple):
    """Causes of a shaft's creep: torques of motor and load on the gear, each as its value at rest and its slope."""

    way: float  # −1 or +1
    m_0: float  # [N m]
    m_1: float  # [N m s/rad]
    e_0: float
    e_1: float
    against: float  # external torque [N m]


class _Panel(NamedTuple):
    """A range of speeds, and how a shaft would go through it if its law were a straight line."""

    span: float  # that time [s]; 0 where it stays as fast as it is
    rate: float  # 1/s, at least 0: the law is computed from the end at which it speeds up or slows down more
    anchor: float  # this end [rad/s]
    pull: float  # how the speed leaves it, as time goes forth or back [rad/s²]
    other: float  # the other end
    there: float  # the one that is reached
    way: float  # the angle that it would turn [rad]
    arrives: bool
    straight: bool  # the law is a straight line, to rounding


class _Line(NamedTuple):
    """The inputs of a panel's nodes."""

    anchor: float
    pull: float
    rate: float
    per_rate: float
    law: float  # of the straight line at the anchor, signed as the shaft speeds up [rad/s²]
    begin: float  # roots of the speeds at the ends
    step: float
    size: float


class _Between(NamedTuple):
    """Time [s] and angle [rad] through a panel, and an error; inf where it cannot be found."""

    time: float
    way: float
    error: float


class _Went(NamedTuple):
    """Where the way on has led: time [s], angle [rad], speed, whether to the bound; 1, or 0 where it is not found."""

    time: float
    way: float
    speed: float
    arrived: bool
    done: float


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
    most = max(_most_gain(numbers, mode, u, tau, y, 0.0), _most_gain(numbers, mode, u, tau, y, fast))
    return 2.0 * slow / most if most > 0.0 else math.inf


def part_before(numbers: Numbers, mode: Mode, before: Vector, after: Vector) -> float:
    """Return the part of a step by time after which friction begins to fade; 1 where it leads no further.

    The part of a step beyond would not be seen, and spoils what lies before.
    """
    if not fades(numbers.friction) or not slides(geared(numbers, mode)) or creeping(numbers, mode, before):
        return 1.0
    way = 1.0 if geared(numbers, mode) == FORWARD else -1.0
    w, w_after = way * geared_speed(numbers, mode, before), way * geared_speed(numbers, mode, after)
    slow = creeping_speed(numbers.friction)
    return 1.0 if w_after >= _INTO * slow else (w - 0.5 * (1.0 + _INTO) * slow) / (w - w_after)


def _most_gain(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector, w: float) -> float:
    """Return the magnitude of the acceleration [rad/s²] that a body sliding in the gear has at a speed."""
    inside = turns_alone(numbers, mode)
    at = moving(y, y.q, y.w if inside else w, y.w_m if behind(numbers.elastic) else w)
    output, motor = spring_contact.accelerations(warm(numbers, at), mode, u, tau, at)
    return abs(motor if inside else output)


def creep(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector, limit: float, tolerance: float) -> Crept:
    """Return where a shaft creeps to: to where its law changes, or within `limit` [s]; or a part of that way."""
    q, w = y.q, y.w
    course = _course(numbers, mode, u, tau, 1.0 if w > 0.0 or (w == 0.0 and mode.contact == FORWARD) else -1.0)
    dw = _acceleration(numbers, course, w)
    there, ends_by = _next_change(numbers, mode, u, course, w, w == 0.0 or dw * course.way > 0.0)
    if there == w or (there < w) == (dw > 0.0):
        return Crept(0.0, q, w, ends_by, 1.0)
    went = _onward(numbers, course, abs(w), course.way * dw, abs(there), min(limit, _LONGEST),
                   max(_PART * tolerance, _ROUNDING))
    return Crept(went.time, q + course.way * went.way, there if went.arrived else course.way * went.speed,
                 ends_by if went.arrived else -1, went.done)


def at_time(numbers: Numbers, mode: Mode, u: float, tau: float, start: Vector, end: Vector, tolerance: float,
            s: float) -> tuple[float, float]:
    """Return angle and speed at s within a creep from one state to another."""
    course = _course(numbers, mode, u, tau, 1.0 if start.w + end.w > 0.0 else -1.0)
    gain = _gain(numbers, course, abs(start.w))
    went = _onward(numbers, course, abs(start.w), gain, abs(end.w), s, max(_PART * tolerance, _ROUNDING))
    left = s - went.time  # none but by rounding: it is nearly as fast at its end for long
    return start.q + course.way * (went.way + went.speed * left), course.way * went.speed


def _onward(numbers: Numbers, course: _Course, begin: float, gain: float, bound: float, limit: float,
            tolerance: float) -> _Went:
    """Creep from a speed until another is reached, or for a time: panel by panel, back where one has led too far."""
    x, left, way, longest = begin, limit, 0.0, limit
    for _ in range(_PANELS):
        sense = 1.0 if left > 0.0 else -1.0
        panel = _panel(numbers, course, x, bound if left > 0.0 else begin, sense, gain, min(abs(left), longest))
        if panel.span == 0.0:  # it stays as fast as it is
            return _Went(limit, way + x * left, x, False, 1.0)
        time, turned, error = _through(numbers, course, panel, x, gain)
        after = left - sense * time
        if error <= tolerance:
            if panel.arrives and sense > 0.0 and after >= 0.0:
                return _Went(limit - after, way + turned, panel.there, True, 1.0)
            if abs(after) <= _SHORT * limit:
                return _Went(limit, way + sense * turned, panel.there, False, 1.0)
        gained = _gain(numbers, course, panel.there)
        if error <= tolerance and (gained * gain > 0.0 or panel.straight):
            x, gain, left, way, longest = panel.there, gained, after, way + sense * turned, 4.0 * longest
        else:
            longest = 0.5 * panel.span
    return _Went(limit - left, way, x, False, 1.0 if 0.0 <= left < limit else 0.0)


def _through(numbers: Numbers, course: _Course, panel: _Panel, x: float, gain: float) -> _Between:
    """Return time and angle through a panel that begins at a speed, and what may be wrong by then [rad, rad/s]."""
    if panel.straight:
        return _Between(panel.span, panel.way, 0.0)
    sign, change = 1.0 if gain > 0.0 else -1.0, abs(panel.there - x)
    if change <= _CLOSE * min(x, numbers.friction.w_s):
        time, way, error = _close(numbers, course, panel, sign)
    else:
        time, way, error = _between(numbers, course, panel, sign)
    return _Between(time, way, error * (max(abs(gain), abs(panel.pull)) + change))


def _panel(numbers: Numbers, course: _Course, x: float, bound: float, sense: float, gain: float,
           span: float) -> _Panel:
    """Return the panel through which a shaft would go in a time if its law were a straight line by two points of it."""
    most, on = abs(bound - x), 1.0 if bound > x else -1.0
    way = on * sense
    v, near = way * gain, max(_NEAR * min(x, numbers.friction.w_s), _STILL)
    if not v > 0.0 or most == 0.0:
        return _Panel(0.0, 0.0, x, 0.0, x, x, 0.0, False, False)
    reach = min(max(v * span, _NEAR * numbers.friction.w_s), most)
    growth = (way * _gain(numbers, course, x + on * reach) - v) / reach
    for _ in range(_GUESSES):
        if v + growth * reach > 0.0:
            break
        reach = min(max(-v / growth, _NEAR * numbers.friction.w_s), most)
        growth = (way * _gain(numbers, course, x + on * reach) - v) / reach
    if growth > 0.0:
        return _speeding(x, bound, on, v, growth, span, near)
    rate = -growth
    per_rate = 1.0 / rate if rate > 0.0 else 0.0
    once, twice = decay(rate, per_rate, span)
    straight = v * once <= near
    if not straight and rate * span > _LONG:
        span = _LONG * per_rate
        once, twice = decay(rate, per_rate, span)
    arrives = v * once >= most
    if arrives and v > rate * most:
        span = _time_for(most / (v - rate * most), rate, per_rate)
        twice = decay(rate, per_rate, span)[1]
    there = bound if arrives else x + on * v * once
    return _Panel(span, rate, x, on * v, there, there, x * span + on * v * twice, arrives, straight)


def _speeding(x: float, bound: float, on: float, v: float, rate: float, span: float, near: float) -> _Panel:
    """Return the same where the acceleration grows on the way: computed from the end of the panel."""
    most, per_rate = abs(bound - x), 1.0 / rate
    gone = v * exp(rate * span) * decay(rate, per_rate, span)[0]
    arrives = gone >= most
    if arrives:
        gone, span = most, _time_for(most / v, rate, per_rate)
    there = bound if arrives else x + on * gone
    v += rate * gone
    way = there * span - on * v * decay(rate, per_rate, span)[1]
    return _Panel(span, rate, there, -on * v, x, there, way, arrives, gone <= near)


def _time_for(y: float, rate: float, per_rate: float) -> float:
    """Return ln(1 + λ y)/λ [s]."""
    return log1p(rate * y) * per_rate if rate > 0.0 else y


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
               _root(m_0 + e_0, m_1 + e_1)):
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


def _gain(numbers: Numbers, course: _Course, x: float) -> float:
    """Return by how much a shaft speeds up that is so fast [rad/s²]."""
    return course.way * _acceleration(numbers, course, course.way * x)


def _between(numbers: Numbers, course: _Course, panel: _Panel, sign: float) -> _Between:
    """Integrate over a panel, in which the shaft speeds up (1) or slows down (−1)."""
    line = _line(panel, sign)
    time = fewer = turned = 0.0
    onward = 0
    for n in range(_POINTS if PLAIN else _COUNT):
        f, x = _node(numbers, course, line, _NODES[n])
        onward += 1 if f > 0.0 else 0
        time += _WEIGHTS[n] * f
        fewer += _FEWER[n] * f
        turned += _WEIGHTS[n] * f * x
    return _summed(line, time, fewer, turned, onward == (_POINTS if PLAIN else _COUNT))


def _close(numbers: Numbers, course: _Course, panel: _Panel, sign: float) -> _Between:
    """Integrate over a panel in which the speed changes little."""
    line = _line(panel, sign)
    time = fewer = turned = 0.0
    onward = 0
    for n in range(_CLOSE_POINTS if PLAIN else _CLOSE_COUNT):
        f, x = _node(numbers, course, line, _CLOSE_NODES[n])
        onward += 1 if f > 0.0 else 0
        time += _CLOSE_WEIGHTS[n] * f
        fewer += _CLOSE_FEWER[n] * f
        turned += _CLOSE_WEIGHTS[n] * f * x
    return _summed(line, time, fewer, turned, onward == (_CLOSE_POINTS if PLAIN else _CLOSE_COUNT))


def _line(panel: _Panel, sign: float) -> _Line:
    """Return what nodes of a panel are computed by."""
    begin, end, rate = math.sqrt(panel.anchor), math.sqrt(panel.other), panel.rate
    return _Line(panel.anchor, panel.pull, rate, 1.0 / rate if rate > 0.0 else 0.0, sign * abs(panel.pull), begin,
                 end - begin, panel.span / (begin + end))


def _node(numbers: Numbers, course: _Course, line: _Line, part: float) -> tuple[float, float]:
    """Return how much longer than on a straight line a shaft takes at a part of a panel, and its speed there."""
    root = line.begin + line.step * part
    once, _ = decay(line.rate, line.per_rate, line.size * part * (line.begin + root))
    x = line.anchor + line.pull * once
    gain = _gain(numbers, course, x)
    return (root * (line.law - line.law * (line.rate * once)) / gain if gain != 0.0 else 0.0), x


def _summed(line: _Line, time: float, fewer: float, turned: float, onward: bool) -> _Between:
    """Return time and angle from the sums over the nodes of a panel."""
    apart, size = abs(time - fewer) / abs(time) if time != 0.0 else math.inf, 2.0 * line.size
    error = apart * math.sqrt(apart) * abs(time) * size if onward and apart < 1e-3 else math.inf
    return _Between(time * size, turned * size, error)
