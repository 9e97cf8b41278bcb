"""Digital servos whose every motion is ẇ = f − λ w go from tick to tick in one loop, without a motion being kept.

Between two ticks the duty is constant, so that speed and current change their laws only where the speed reaches a
level: zero, or where the drops hold the current. When is told outright. An end stop that is hit is left to the general
way, which goes on from the last tick. Arrays of the inputs are looked at only where they are needed: compiled code
counts who holds them, which takes longer than a tick.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import contacts, controller, first_order
from servotwin.models.engine.memory import FRAMES, SAME, Inputs, Memory, Point, origin_of
from servotwin.models.engine.modes import (
    BACKWARD,
    CONDUCTING,
    FORWARD,
    FREE,
    NO_CURRENT,
    RIGID,
    Mode,
    Vector,
    at_rest,
    one_body,
)
from servotwin.models.engine.motion import may_depend
from servotwin.models.terms import bridge, control, duty, sensor, shaft, source
from servotwin.models.terms.bridge import Bridge
from servotwin.models.terms.control import NOTHING_SENSED, NOWHERE
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import sensed_voltage
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.physics.motor import back_emf, electromagnetic_torque, steady_armature_current
from servotwin.physics.pieces import Piece
from servotwin.physics.potentiometer import feedback_voltage

if TYPE_CHECKING:
    from servotwin.models.engine.tiles import Floats

GLIDES, STEPS = 0, 1  # from tick to tick: in this loop, or from event to event
_MOST = 12  # changes of law within a tick
_GIVEN = Piece()  # what a servo follows that a program drives


class Body(NamedTuple):
    """What moves: motor and shaft, the friction that it slides against [N m], and between which stops."""

    motor: Motor
    shaft: Shaft
    dry: float  # 1: with dry friction
    against_forward: float  # of a shaft that slides forward; negative of one that slides backward
    against_backward: float
    hold_forward: float  # most that friction holds against a start
    hold_backward: float
    lower: float
    upper: float
    tau: float  # constant, external


class Way(NamedTuple):
    """How a shaft moves now: contact, zone of the current, and its law."""

    contact: int
    zone: int
    rate: float  # λ [1/s]
    pull: float  # f [rad/s²]


def possible(numbers: Numbers, inputs: Inputs) -> bool:
    """Tell whether a servo always moves so, end stops apart."""
    if source.regulated(numbers.source) or sensor.slack(numbers.sensor) or len(inputs.torque) > 0:
        return False
    return may_depend(numbers, _GIVEN) == 0


def way_of(numbers: Numbers, inputs: Inputs) -> int:
    """Return which way a servo goes from tick to tick."""
    return GLIDES if possible(numbers, inputs) else STEPS


def body_of(numbers: Numbers, tau: float) -> Body:
    """Return what moves, under a constant external torque [N m]."""
    backward, forward = contacts.holding_bounds(numbers, 0.0, -tau)
    return Body(numbers.motor, numbers.shaft, 1.0 if contacts.has_friction(numbers) else 0.0,
                contacts.friction_torque(numbers, FORWARD, 0.0, 0.0, 0.0),
                contacts.friction_torque(numbers, BACKWARD, 0.0, 0.0, 0.0), forward, backward, numbers.stops.lower,
                numbers.stops.upper, tau)


def go(numbers: Numbers, inputs: Inputs, memory: Memory, until: float, times: Floats, done: int,
       outputs: Floats) -> tuple[Memory, int]:
    """Go on from tick to tick, as far as this way leads and at most to `until` [s]; return how many outputs are done.

    The arguments are those of `runs.run`.
    """
    firmware, firm, frames, origin = inputs.firmware[0], controller.of(memory), memory.frames, origin_of(memory)
    point, slack, body = memory.point, SAME * inputs.firmware[0].T_c, body_of(numbers, inputs.constant_torque)
    p, b_o, seed = numbers.sensor.p, numbers.sensor.b_o, inputs.seed
    straight = numbers.sensor.step == 0.0 and len(inputs.curve) == 0
    measures, senses = firmware.per_volt != 0.0, control.senses(firmware)
    t, q, w, y = point.time, point.y.q, point.y.w, point.y
    last, gone = min(until, FRAMES * memory.beat), False
    while t < last:
        if controller.next_due(firmware, firm, frames) > t + slack:
            break  # in the middle of a motion
        controller.apply(firmware, firm, frames, t + slack)
        if controller.is_due(firmware, firm, frames, t + slack):
            if controller.has_news(firmware, firm, origin + t):
                controller.listen(inputs, firm, origin + t)
            angle = q
            if measures:
                v = feedback_voltage(q, p, b_o) if straight else sensed_voltage(numbers.sensor, inputs.curve, q)
                angle = controller.angle_of(firmware, firm, v, seed)
            sensed = controller.sensed_by(numbers, firm, y) if senses else NOTHING_SENSED
            controller.decide(firmware, firm, angle, sensed, origin + t)
            controller.apply(firmware, firm, frames, t + slack)
        end = controller.next_due(firmware, firm, frames)
        if end > until + slack:
            break
        end = min(end, until)
        path, supply = duty.at(numbers.bridge, numbers.motor, numbers.source, firm.duty)
        u = duty.voltage(supply, firm.duty)
        before_q, before_w, before_done = q, w, done
        way = _begun(body, path, supply, u, q, w)
        now, rounds = t, 0
        while now < end and rounds < _MOST:
            rounds += 1
            left, following = end - now, way
            if not at_rest(way.contact):
                left, following = _next(body, path, supply, u, w, way, end - now)
            while done < times.size and (times[done] - origin < min(now + left, end) - slack
                                         or now + left >= end >= until):
                s = max(0.0, min(times[done] - origin, end) - now)
                q_o, w_o = (q, w) if at_rest(way.contact) else first_order.propagate(way.rate, way.pull, q, w, s)
                show(outputs, done, q_o, w_o, y, way.contact, firm)
                done += 1
            if not at_rest(way.contact):
                q, w, following = _moved(body, path, supply, u, q, w, left, way, following)
                if not body.lower < q < body.upper:
                    rounds = _MOST + 1
            now = now + left if left < end - now else end
            way = following
        if rounds > _MOST or now < end:
            q, w, done = before_q, before_w, before_done
            gone = True
            break
        t, y = end, one_body(q, w, y)
    if t > point.time or gone:
        here = one_body(q, w, y)
        point = Point(t, here, Mode(0, 0, RIGID, 0, 0), math.inf, here, point.step, q)
        memory = Memory(frames, memory.beat, point, memory.chip, memory.u, memory.u_end, memory.tau, memory.tau_end,
                        memory.firm)
    return memory, done


def _begun(body: Body, path: Bridge, supply: Source, u: float, q: float, w: float) -> Way:
    """Return how a shaft moves from q and w on."""
    own = body.motor
    zone = bridge.zone_of(path, supply, own, u, u - back_emf(w, own.K_b), 0.0)
    if w != 0.0:
        return _law(body, path, supply, u, shaft.sliding(w > 0.0, body.dry > 0.0), zone)
    torque = 0.0
    if zone != NO_CURRENT:
        v, R = bridge.loop(path, supply, zone, u)
        torque = electromagnetic_torque(steady_armature_current(v, 0.0, R, own.K_b), own.K)
    contact = shaft.from_rest(torque - body.tau, body.hold_backward, body.hold_forward, q >= body.upper,
                              q <= body.lower, body.dry > 0.0)
    return _law(body, path, supply, u, contact, zone)


def _law(body: Body, path: Bridge, supply: Source, u: float, contact: int, zone: int) -> Way:
    """Return how a shaft moves in a contact and a zone of the current."""
    per_volt, torque = 0.0, -body.tau
    if contact == FORWARD:
        torque -= body.against_forward
    elif contact == BACKWARD:
        torque -= body.against_backward
    if zone != NO_CURRENT:
        v, R = bridge.loop(path, supply, zone, u)
        per_volt = torque_per_volt(body.motor, R)
        torque += per_volt * v
    return Way(contact, zone, fading(body, per_volt), shaft.accelerated(body.shaft, torque))


def torque_per_volt(own: Motor, R: float) -> float:
    """Return the torque [N m/V] that a voltage makes in a loop of so many ohms."""
    return electromagnetic_torque(steady_armature_current(1.0, 0.0, R, own.K_b), own.K)


def fading(body: Body, per_volt: float) -> float:
    """Return λ [1/s] of a shaft whose motor has so much torque per volt."""
    return shaft.accelerated(body.shaft, body.shaft.b + per_volt * back_emf(1.0, body.motor.K_b))


def _next(body: Body, path: Bridge, supply: Source, u: float, w: float, way: Way, left: float) -> tuple[float, Way]:
    """Return how long a shaft moves so, `left` [s] at most, and how it moves then."""
    rising = way.pull - way.rate * w > 0.0
    found, after = left, way
    if way.contact != FREE and w != 0.0 and rising == (w < 0.0):
        s = first_order.time_to(way.rate, way.pull, w, 0.0)
        if s < found:
            found, after = s, Way(FREE, way.zone, 0.0, 0.0)
    if way.zone != CONDUCTING:
        beyond = way.zone - 1 if rising else way.zone + 1  # the faster, the less drives the current
        edge = _edge_speed(path, supply, way.zone, beyond, u, body.motor.K_b)
        if math.isfinite(edge):
            s = first_order.time_to(way.rate, way.pull, w, edge)
            if s < found:
                found, after = s, _law(body, path, supply, u, way.contact, beyond)
    return found, after


def _moved(body: Body, path: Bridge, supply: Source, u: float, q: float, w: float, s: float, way: Way,
           following: Way) -> tuple[float, float, Way]:
    """Return angle and speed after s [s], exact at an edge, and how a shaft moves from there."""
    q, w = first_order.propagate(way.rate, way.pull, q, w, s)
    if following.zone != way.zone:
        return q, _edge_speed(path, supply, way.zone, following.zone, u, body.motor.K_b), following
    if following.contact != way.contact:
        return q, 0.0, _begun(body, path, supply, u, q, 0.0)
    return q, w, following


def _edge_speed(path: Bridge, supply: Source, zone: int, beyond: int, u: float, K_b: float) -> float:
    """Return the speed [rad/s] at which a zone of the current gives way to its neighbour."""
    low, high = bridge.zone_limits(path, supply, False, zone, u)
    return (u - (high if beyond > zone else low)) / back_emf(1.0, K_b)


def show(outputs: Floats, done: int, q: float, w: float, y: Vector, contact: int, firm: Any) -> None:
    """Put what shows of a servo into a column of the outputs, in the order of `runs.run`."""
    outputs[0, done], outputs[1, done], outputs[2, done] = q, w, contact
    outputs[3, done] = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
    outputs[4, done], outputs[5, done] = 0.0, q
    outputs[6, done], outputs[7, done], outputs[8, done], outputs[9, done], outputs[10, done] = y.i, y.T_w, y.T_h, q, w
    outputs[11, done], outputs[12, done], outputs[13, done] = RIGID, 0, 1
    outputs[14, done], outputs[16, done], outputs[17, done] = firm.duty, firm.r, firm.trip
    outputs[15, done] = firm.r if firm.goal == NOWHERE else firm.goal
