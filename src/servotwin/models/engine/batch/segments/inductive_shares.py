"""The same as `coils` of a servo whose friction depends on the torques through its gear.

As long as the share of these keeps its sign, friction is a straight line in speed and current, and a leg the same two
exponentials with other numbers. The share is a sum of both: where it turns is found like where one of them is zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.batch.segments import inductive_segments, linear_segments, piecewise_segments
from servotwin.models.engine.batch.segments.inductive_segments import Circuit, Flow, Went
from servotwin.models.engine.batch.segments.linear_segments import MOST_ARCS
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.coefficients import against_of, speed_coefficients
from servotwin.models.engine.dynamics.guards import SPEED
from servotwin.models.engine.motions.elementary import fma
from servotwin.models.state.modes import (
    BACKWARD,
    FORWARD,
    FREE,
    NO_CURRENT,
    RIGID,
    Mode,
    Vector,
    sign_of,
)
from servotwin.models.terms import friction
from servotwin.models.terms.numbers import Numbers
from servotwin.physics import motor
from servotwin.physics.backlash import play
from servotwin.physics.load_friction import torque_on_gear

_NEAR = 4e-16  # relative, of a current that releases the shaft
CALLED = ("onward",)  # one lane: with copies it takes twice as long to compile


class Leg(NamedTuple):
    """Where a leg has led: angle, speed, current, the time left [s], and zone, way and share of the next one."""

    q: float
    w: float
    i: float
    left: float
    zone: int
    way: float
    share: int  # 0: as it is there


def through(numbers: Numbers, torque: float, drive: float, q: float, w: float, i: float, wiper: float,
            time: float) -> Went:
    """Return where a servo goes within `time` [s] under one drive (−1, 0, +1) and a constant external torque [N m]."""
    zone, way = inductive_segments.entered(numbers, torque, drive * numbers.source.V, w, i)
    return onward(numbers, torque, drive, zone, way, q, w, i, wiper, time)


def onward(numbers: Numbers, torque: float, drive: float, zone: int, way: float, q: float, w: float, i: float,
           wiper: float, time: float) -> Went:
    """Return the same for one whose zone and way are known. It gives up at a stop and after too many legs."""
    u, share = drive * numbers.source.V, 0
    for _ in range(MOST_ARCS):
        slides = way != 0.0
        if not slides:
            q, w, i, time, zone, way, share = _rest(numbers, torque, u, zone, q, i, time)
        else:
            share = share if share != 0 else _sign(numbers, torque, u, zone, way, w, i)
            q, w, i, time, zone, way, share = _slide(numbers, torque, u, zone, way, share, q, w, i, time)
        wiper = play(wiper, q, 2.0 * numbers.sensor.half_slack)
        if slides and not numbers.stops.lower < q < numbers.stops.upper:
            return Went(q, w, i, wiper, 0.0)
        if time == 0.0:
            return Went(q, w, i, wiper, 1.0)
    return Went(q, w, i, wiper, 0.0)


def _contact(way: float) -> int:
    return FORWARD if way > 0.0 else BACKWARD


def _state(w: float, i: float) -> Vector:
    return Vector(0.0, w, i, 0.0, 0.0, 0.0, w)


def _sign(numbers: Numbers, torque: float, u: float, zone: int, way: float, w: float, i: float) -> int:
    return contacts.share_sign(numbers, zone, _contact(way), RIGID, u, torque, _state(w, i))


def _rest(numbers: Numbers, torque: float, u: float, zone: int, q: float, i: float, time: float) -> Leg:
    """Return where the current of a shaft at rest goes, until it releases the shaft or is zero."""
    if zone == NO_CURRENT:
        return Leg(q, 0.0, 0.0, 0.0, zone, 0.0, 0)
    v, R = currents.loop(numbers, zone, u)
    L, K_b = numbers.motor.L, numbers.motor.K_b
    rate = -motor.armature_current_rate(0.0, 1.0, 0.0, R, L, K_b)
    x = inductive_segments.to_final(motor.armature_current_rate(v, i, 0.0, R, L, K_b),
                                    motor.armature_current_rate(v, 0.0, 0.0, R, L, K_b) / rate, rate, i, time)
    ends = sign_of(zone) * x < 0.0
    to = 0.0 if ends else x
    way = inductive_segments.way_from_rest(numbers, torque, to)
    if way == 0.0 and not ends:
        return Leg(q, 0.0, to, 0.0, zone, 0.0, 0)
    if way != 0.0:
        to = _release(numbers, torque, way, i, to)
    there = motor.armature_current_rate(v, to, 0.0, R, L, K_b)
    t, _ = linear_segments.way_to_edge(i, to, there, rate, 1.0 / rate) if to != i else (0.0, 0.0)
    left = max(time - t, 0.0)
    if way == 0.0:
        return Leg(q, 0.0, 0.0, left, currents.zone_of(numbers, u, 0.0, q, 0.0, 0.0), 0.0, 0)
    return Leg(q, 0.0, to, left, zone, way, 0)


def _release(numbers: Numbers, torque: float, way: float, i: float, to: float) -> float:
    """Return the current [A] on the way from one to another at which a shaft starts so, which it does at the other."""
    a, f_a, b, f_b = i, _hold(numbers, torque, way, i), to, _hold(numbers, torque, way, to)
    if not f_a > 0.0:
        return i
    for _ in range(100):
        x = (a * f_b - b * f_a) / (f_b - f_a)
        x = x if min(a, b) < x < max(a, b) else 0.5 * (a + b)
        f = _hold(numbers, torque, way, x)
        if f > 0.0:
            a, f_a, f_b = x, f, 0.5 * f_b
        else:
            b, f_b, f_a = x, f, 0.5 * f_a
        if f == 0.0 or abs(b - a) <= _NEAR * max(abs(a), abs(b)):
            break
    return b


def _hold(numbers: Numbers, torque: float, way: float, i: float) -> float:
    """Return what friction could hold [N m] beyond what a current [A] and a load push with."""
    tau_m = motor.electromagnetic_torque(i, numbers.motor.K)
    backward, forward = contacts.holding_bounds(numbers, tau_m, -torque)
    return forward - (tau_m - torque) if way > 0.0 else backward + (tau_m - torque)


def _slide(numbers: Numbers, torque: float, u: float, zone: int, way: float, share: int, q: float, w: float, i: float,
           time: float) -> Leg:
    if zone == NO_CURRENT:
        arc = piecewise_segments.leg(numbers, torque, u, way > 0.0, zone, share, q, w, time, 0.0)
        if arc.ends_at == SPEED:
            return Leg(arc.q, 0.0, 0.0, arc.left, zone, inductive_segments.way_from_rest(numbers, torque, 0.0), 0)
        zone, turned = piecewise_segments.beyond(arc.ends_at, zone, share)
        return Leg(arc.q, arc.w, 0.0, arc.left, zone, way, turned if turned != share else 0)
    mode = Mode(zone, _contact(way), RIGID, FREE, share)
    circuit, side = inductive_segments.circuit_of(numbers, u, mode), sign_of(zone)
    x = _flow(numbers, circuit, mode, torque, u, w, i)
    after, left = inductive_segments.response(circuit, time), 0.0
    g, dg, rg = (share * contacts.through_gear(numbers, RIGID, _torque(numbers, x.i), torque, _state(x.w, 0.0)),
                 share * _share(numbers, x.di, x.dw), share * _share(numbers, x.ri, x.rw))
    turn = inductive_segments.zero(circuit, after, g, dg, rg, time)
    turns, stops, fades = turn < math.inf, False, False
    if turns:
        time, left, after = turn, time - turn, inductive_segments.response(circuit, turn)
    stop = inductive_segments.zero(circuit, after, way * x.w, way * x.dw, way * x.rw, time)
    if stop < math.inf:
        turns, stops, left, time, after = False, True, left + (time - stop), stop, inductive_segments.response(circuit,
                                                                                                               stop)
    fade = inductive_segments.zero(circuit, after, side * x.i, side * x.di, side * x.ri,
                                   time) if side != 0.0 else math.inf
    if fade < math.inf:
        turns, stops, fades, left = False, False, True, left + (time - fade)
        time, after = fade, inductive_segments.response(circuit, fade)
    to = inductive_segments.slid(circuit, x, after, way, side, q, time)
    if fades:
        return Leg(to.q, to.w, 0.0, left, currents.zone_of(numbers, u, 0.0, q, to.w, 0.0), way, 0)
    if stops:
        return Leg(to.q, 0.0, to.i, left, zone, inductive_segments.way_from_rest(numbers, torque, to.i), 0)
    return Leg(to.q, to.w, to.i, left, zone, way, -share if turns else share)


def _flow(numbers: Numbers, circuit: Circuit, mode: Mode, torque: float, u: float, w: float, i: float) -> Flow:
    """Return speed and current at the start of a leg in which the shaft slides, and their rates."""
    v, _ = currents.loop(numbers, mode.zone, u)
    L, K_b, against = numbers.motor.L, numbers.motor.K_b, against_of(numbers, mode, w, (torque, 0.0))
    dw = _accelerated(numbers, mode, against, w, i)
    di = motor.armature_current_rate(v, i, w, circuit.R, L, K_b)
    ddi = motor.armature_current_rate(0.0, di, dw, circuit.R, L, K_b)
    ddw = _accelerated(numbers, mode, (0.0, 0.0), dw, di)
    return Flow(w, dw, fma(circuit.damping, dw, ddw), i, di, fma(circuit.damping, di, ddi))


def _accelerated(numbers: Numbers, mode: Mode, against: tuple[float, float], w: float, i: float) -> float:
    return speed_coefficients(numbers, mode, (0.0, 0.0, 0.0, 0.0, 0.0), against, w, i)[8]


def _torque(numbers: Numbers, i: float) -> float:
    return motor.electromagnetic_torque(i, numbers.motor.K)


def _share(numbers: Numbers, i: float, w: float) -> float:
    """Return what a current [A] and a speed [rad/s] add to the torque of a share [N m]."""
    return friction.share(numbers.friction, _torque(numbers, i), torque_on_gear(0.0, w, numbers.shaft.b_out))


