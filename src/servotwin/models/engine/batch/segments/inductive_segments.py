"""How a shaft and a current with inertia move together: the law of one servo whose armature has inductance.

As long as the shaft slides one way and the current stays in its zone, both obey linear equations, and each is a sum of
two exponentials or of a swing; a shaft at rest has the current alone. Such a stretch is a leg. Everything here asks the
laws of the general engine, so that a servo needs no numbers but its own and the rates of its two circuits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.batch.segments import linear_segments, piecewise_segments
from servotwin.models.engine.batch.segments.linear_segments import MOST_ARCS, Arc
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.coefficients import speed_coefficients
from servotwin.models.engine.dynamics.guards import SPEED
from servotwin.models.engine.motions import second_order
from servotwin.models.engine.motions.elementary import fading, fma, log
from servotwin.models.state.modes import BACKWARD, CONDUCTING, FORWARD, FREE, NO_CURRENT, RIGID, STUCK, Mode, sign_of
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import acceleration
from servotwin.physics import motor
from servotwin.physics.backlash import play

BELOW = -1e-13  # A, rad/s: less below zero is rounding
_SETTLED = 40.0  # e^-40 of a current is less than rounding
_NEAR = 1e-7  # a step of Halley's that is so short beside the time is the last


class Circuit(NamedTuple):
    """A loop through the winding, and the rates of a shaft and a current in it."""

    R: float
    rate: float  # R/L, of the current of a shaft at rest [1/s]
    per_rate: float
    damping: float  # R/L + b/J, the sum of the two rates of a shaft that slides
    product: float  # of these two
    slow: float
    per_slow: float
    fast: float
    per_fast: float
    apart: float  # 1/(fast − slow) [s]; 0: they are close, or shaft and current swing
    square: float  # of half the difference [1/s²], below 0 where they swing
    root: float  # of its magnitude


class Winding(NamedTuple):
    """The circuits of a servo that drives, and that does not."""

    drive: Circuit
    off: Circuit


class Course(NamedTuple):
    """The response g of speed and current to a rate, and its integrals G1 and G2, as in `second_order`."""

    g: float
    once: float
    twice: float


class Held(NamedTuple):
    """How the current of a shaft at rest changes, up to where the leg ends, and what it tends to [A]."""

    arc: Arc
    final: float


class Flow(NamedTuple):
    """Speed and current at the start of a leg, their rates, and ẍ + damping ẋ of both, which is constant."""

    w: float
    dw: float
    rw: float
    i: float
    di: float
    ri: float


class Slid(NamedTuple):
    """Angle, speed and current after a time, and whether the leg may have ended before."""

    q: float
    w: float
    i: float
    ends: bool


class Leg(NamedTuple):
    """Where a leg has led: angle, speed, current, the time left [s], and zone and way of the next one."""

    q: float
    w: float
    i: float
    left: float
    zone: int
    way: float


class Went(NamedTuple):
    """Where a servo has gone: angle, speed, current, angle of the potentiometer, and 1, or 0 where it gave up."""

    q: float
    w: float
    i: float
    wiper: float
    done: float


def winding(numbers: Numbers) -> Winding:
    """Return the circuits of a servo behind a bridge."""
    mode = Mode(CONDUCTING, FORWARD, RIGID, FREE, 0)
    return Winding(circuit_of(numbers, numbers.source.V, mode), circuit_of(numbers, 0.0, mode))


def circuit_of(numbers: Numbers, u: float, mode: Mode) -> Circuit:
    """Return the circuit of a mode in which the shaft slides, under a voltage behind the bridge [V]."""
    a, c, _, _, _, _, _, _, _ = speed_coefficients(numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0), 0.0, 0.0)
    _, R = currents.loop(numbers, CONDUCTING, u)
    rate = -motor.armature_current_rate(0.0, 1.0, 0.0, R, numbers.motor.L, numbers.motor.K_b)
    d = a * a - c
    root = math.sqrt(abs(d))
    fast = a + root if d > 0.0 else a
    slow = c / fast
    return Circuit(R, rate, 1.0 / rate, 2.0 * a, c, slow, 1.0 / slow, fast, 1.0 / fast,
                   0.5 / root if d > second_order.FAR * a * a else 0.0, d, root)


# --- a leg that does not end ------------------------------------------------------------------------------------------


def entered(numbers: Numbers, torque: float, u: float, w: float, i: float) -> tuple[int, float]:
    """Return the zone of the current and the way of the shaft (−1, 0, +1) under a voltage u [V] and a torque [N m]."""
    way = way_from_rest(numbers, torque, i)
    return (currents.zone_of(numbers, u, 0.0, 0.0, w, i), way if w == 0.0 else math.copysign(1.0, w))


def way_from_rest(numbers: Numbers, torque: float, i: float) -> float:
    """Return which way a shaft at rest starts under a current [A] and an external torque [N m]: −1, 0, +1."""
    tau_m = motor.electromagnetic_torque(i, numbers.motor.K)
    backward, forward = contacts.holding_bounds(numbers, tau_m, -torque)
    return linear_segments.starting(forward, backward, tau_m - torque)


def contact_of(numbers: Numbers, torque: float, w: float, i: float) -> int:
    """Return the contact of a shaft with a speed [rad/s] under a current [A] and an external torque [N m]."""
    if not contacts.has_friction(numbers):
        return FREE
    way = w if w != 0.0 else way_from_rest(numbers, torque, i)
    return STUCK if way == 0.0 else FORWARD if way > 0.0 else BACKWARD


def held(numbers: Numbers, circuit: Circuit, torque: float, u: float, zone: int, i: float) -> Held:
    """Return how the current of a shaft at rest changes until its torque releases the shaft, or its zone ends."""
    v, _ = currents.loop(numbers, zone, u)
    L, K_b, flows = numbers.motor.L, numbers.motor.K_b, zone != NO_CURRENT
    di = motor.armature_current_rate(v, i, 0.0, circuit.R, L, K_b) if flows else 0.0
    backward, forward = contacts.holding_bounds(numbers, 0.0, 0.0)
    edge = ((forward if di > 0.0 else -backward) + torque) / motor.electromagnetic_torque(1.0, numbers.motor.K)
    side = sign_of(zone)
    edge = min(edge, 0.0) if di > 0.0 and side < 0.0 else max(edge, 0.0) if di < 0.0 and side > 0.0 else edge
    there = motor.armature_current_rate(v, edge, 0.0, circuit.R, L, K_b)
    final = motor.armature_current_rate(v, 0.0, 0.0, circuit.R, L, K_b) * circuit.per_rate if flows else i
    return Held(Arc(circuit.rate, circuit.per_rate, di, edge, there), final)


def held_current(x: Held, i: float, time: float) -> float:
    """Return the current [A] of a shaft at rest after a time; in the end it is what it tends to."""
    once, _ = fading(x.arc.rate, x.arc.per_rate, time)
    return x.final if x.arc.rate * time > _SETTLED else fma(x.arc.pull, once, i)


def to_final(di: float, final: float, rate: float, i: float, time: float) -> float:
    """Return the same of one that begins with the rate di [A/s]."""
    return held_current(Held(Arc(rate, 1.0 / rate, di, 0.0, 0.0), final), i, time)


def flow(numbers: Numbers, circuit: Circuit, torque: float, u: float, zone: int, way: float, w: float,
         i: float) -> Flow:
    """Return speed and current at the start of a leg in which the shaft slides, and their rates."""
    v, _ = currents.loop(numbers, zone, u)
    K, L, K_b = numbers.motor.K, numbers.motor.L, numbers.motor.K_b
    dry = contacts.friction_torque(numbers, FORWARD if way > 0.0 else BACKWARD, 0.0, 0.0, 0.0)
    di = motor.armature_current_rate(v, i, w, circuit.R, L, K_b)
    dw = acceleration(numbers.shaft, motor.electromagnetic_torque(i, K), w, dry, torque)
    ddi = motor.armature_current_rate(0.0, di, dw, circuit.R, L, K_b)
    ddw = acceleration(numbers.shaft, motor.electromagnetic_torque(di, K), dw, 0.0, 0.0)
    return Flow(w, dw, fma(circuit.damping, dw, ddw), i, di, fma(circuit.damping, di, ddi))


def course(circuit: Circuit, s: float) -> Course:
    """Return the responses after a time s [s] in a circuit whose rates are far apart."""
    slow, slow_twice = fading(circuit.slow, circuit.per_slow, s)
    fast, fast_twice = fading(circuit.fast, circuit.per_fast, s)
    return Course(fma(circuit.fast, fast, -circuit.slow * slow) * circuit.apart, (slow - fast) * circuit.apart,
                  (slow_twice - fast_twice) * circuit.apart)


def slid(circuit: Circuit, x: Flow, after: Course, way: float, side: float, q: float, time: float) -> Slid:
    """Return angle, speed and current after a time; `side` is the sign that the current keeps, 0: it keeps none."""
    w = fma(x.rw, after.once, fma(x.dw, after.g, x.w))
    i = fma(x.ri, after.once, fma(x.di, after.g, x.i))
    to = fma(x.rw, after.twice, fma(x.dw, after.once, fma(x.w, time, q)))
    stops = _falls(circuit, after, way * x.dw, way * x.rw, way * w)
    fades = _falls(circuit, after, side * x.di, side * x.ri, side * i)
    return Slid(to, 0.0 if way * w < 0.0 else w, 0.0 if side * i < 0.0 else i, stops or fades)


def _falls(circuit: Circuit, after: Course, dx: float, r: float, end: float) -> bool:
    """Tell whether x ≥ 0 with the rate dx may fall below zero before its `end`, where its rate has one zero at most."""
    return end < BELOW or (dx < 0.0 and _rate(circuit, after, dx, r) > 0.0)


def _rate(circuit: Circuit, after: Course, dx: float, r: float) -> float:
    return fma(r, after.g, dx * (1.0 - fma(circuit.product, after.once, circuit.damping * after.g)))


# --- one lane, leg by leg ---------------------------------------------------------------------------------------------


def through(numbers: Numbers, own: Winding, torque: float, drive: float, q: float, w: float, i: float, wiper: float,
            time: float) -> Went:
    """Return where a servo goes within `time` [s] under one drive (−1, 0, +1) and a constant external torque [N m]."""
    zone, way = entered(numbers, torque, drive * numbers.source.V, w, i)
    return onward(numbers, own, torque, drive, zone, way, q, w, i, wiper, time)


def onward(numbers: Numbers, own: Winding, torque: float, drive: float, zone: int, way: float, q: float, w: float,
           i: float, wiper: float, time: float) -> Went:
    """Return the same for one whose zone and way are known. It gives up at a stop and after too many legs."""
    u = drive * numbers.source.V
    circuit = own.drive if drive != 0.0 else own.off
    for _ in range(MOST_ARCS):
        slides = way != 0.0
        q, w, i, time, zone, way = leg(numbers, circuit, torque, u, zone, way, q, w, i, time)
        wiper = play(wiper, q, 2.0 * numbers.sensor.half_slack)
        if slides and not numbers.stops.lower < q < numbers.stops.upper:
            return Went(q, w, i, wiper, 0.0)
        if time == 0.0:
            return Went(q, w, i, wiper, 1.0)
    return Went(q, w, i, wiper, 0.0)


def leg(numbers: Numbers, circuit: Circuit, torque: float, u: float, zone: int, way: float, q: float, w: float,
        i: float, time: float) -> Leg:
    """Return where a servo goes within `time` [s] at most, to the end of its leg."""
    if way == 0.0:
        return _rest(numbers, circuit, torque, u, zone, q, i, time)
    if zone == NO_CURRENT:
        to = piecewise_segments.leg(numbers, torque, u, way > 0.0, zone, 0, q, w, time, 0.0)
        if to.ends_at == SPEED:
            return Leg(to.q, 0.0, 0.0, to.left, zone, way_from_rest(numbers, torque, 0.0))
        return Leg(to.q, to.w, 0.0, to.left, piecewise_segments.beyond(to.ends_at, zone, 0)[0], way)
    return _slide(numbers, circuit, torque, u, zone, way, q, w, i, time)


def _rest(numbers: Numbers, circuit: Circuit, torque: float, u: float, zone: int, q: float, i: float,
          time: float) -> Leg:
    x = held(numbers, circuit, torque, u, zone, i)
    arc, after = x.arc, held_current(x, i, time)
    if not linear_segments.reaches_edge(arc, after):
        return Leg(q, 0.0, after, 0.0, zone, 0.0)
    t, _ = linear_segments.way_to_edge(i, arc.edge, arc.pull_there, arc.rate, arc.per_rate)
    left = max(time - t, 0.0)
    if arc.edge == 0.0 and sign_of(zone) * arc.pull < 0.0:
        return Leg(q, 0.0, 0.0, left, currents.zone_of(numbers, u, 0.0, q, 0.0, 0.0), 0.0)
    return Leg(q, 0.0, arc.edge, left, zone, 1.0 if arc.pull > 0.0 else -1.0)


def _slide(numbers: Numbers, circuit: Circuit, torque: float, u: float, zone: int, way: float, q: float, w: float,
           i: float, time: float) -> Leg:
    x, side, after = flow(numbers, circuit, torque, u, zone, way, w, i), sign_of(zone), response(circuit, time)
    to = slid(circuit, x, after, way, side, q, time)
    if not to.ends and circuit.apart > 0.0:
        return Leg(to.q, to.w, to.i, 0.0, zone, way)
    stop = zero(circuit, after, way * x.w, way * x.dw, way * x.rw, time)
    if stop < math.inf:
        time, after, left = stop, response(circuit, stop), time - stop
    else:
        left = 0.0
    fade = zero(circuit, after, side * x.i, side * x.di, side * x.ri, time) if side != 0.0 else math.inf
    if fade < math.inf:
        to = slid(circuit, x, response(circuit, fade), way, side, q, fade)
        zone = currents.zone_of(numbers, u, 0.0, q, to.w, 0.0)
        return Leg(to.q, to.w, 0.0, left + (time - fade), zone, way)
    if stop < math.inf:
        to = slid(circuit, x, after, way, side, q, stop)
        return Leg(to.q, 0.0, to.i, left, zone, way_from_rest(numbers, torque, to.i))
    return Leg(to.q, to.w, to.i, 0.0, zone, way)


def response(circuit: Circuit, s: float) -> Course:
    """Return the responses after a time s [s] in any circuit."""
    if circuit.apart > 0.0:
        return course(circuit, s)
    _, g, once, twice, _ = second_order.response_of_near_roots(
        0.5 * circuit.damping, circuit.product, circuit.square, circuit.root, s)
    return Course(g, once, twice)


def zero(circuit: Circuit, after: Course, x: float, dx: float, r: float, until: float) -> float:
    """Return when x ≥ 0 with the rate dx first falls below zero; inf where it does not by `until` [s].

    `after` is the response then. Between the zeros of its rate x is monotone; rates far apart leave one at most.
    """
    if circuit.apart > 0.0:
        end = fma(r, after.once, fma(dx, after.g, x))
        if not _falls(circuit, after, dx, r, end):
            return math.inf
        if x > 0.0 and end < BELOW:
            return _root(circuit, x, dx, r, 0.0, until)
    zero, spacing = second_order.first_zero_of(
        0.5 * circuit.damping, circuit.square, circuit.root, dx, r - circuit.damping * dx)
    left, right = 0.0, min(zero, until)
    for _ in range(MOST_ARCS):
        value, _ = _value(circuit, x, dx, r, right)
        if value < BELOW:
            return _root(circuit, x, dx, r, left, right)
        if right >= until:
            return math.inf
        left, right = right, min(right + spacing, until)
    return math.inf


def _value(circuit: Circuit, x: float, dx: float, r: float, s: float) -> tuple[float, float]:
    after = response(circuit, s)
    return fma(r, after.once, fma(dx, after.g, x)), _rate(circuit, after, dx, r)


def _root(circuit: Circuit, x: float, dx: float, r: float, a: float, b: float) -> float:
    """Return where x falls through zero between a and b [s], once, to rounding: by Halley's steps in brackets."""
    s, last, pull = _guess(circuit, x, dx, r), math.inf, fma(circuit.product, x, r)
    s = s if a < s < b else 0.5 * (a + b)
    for _ in range(200):
        value, rate = _value(circuit, x, dx, r, s)
        a, b = (s, b) if value > 0.0 else (a, s)
        bend = pull - circuit.damping * rate - circuit.product * value
        new = s - value * rate / (rate * rate - 0.5 * value * bend) if rate < 0.0 else a
        if abs(new - s) <= _NEAR * s or b - a <= 4e-16 * b:
            return min(max(new, a), b)
        s = new if a < new < b and abs(value) < 0.5 * last else 0.5 * (a + b)
        last = abs(value)
    return s


def _guess(circuit: Circuit, x: float, dx: float, r: float) -> float:
    """Return about when x is zero: by its slow exponential after the fast one has faded, before that by a parabola."""
    of_slow = (dx - r * circuit.per_slow) * circuit.apart
    ratio = -of_slow / fma(r, circuit.per_slow * circuit.per_fast, x)
    late = circuit.per_slow * log(ratio) if ratio > 1.0 else 0.0
    if late > circuit.per_fast:
        return late
    square = dx * dx - 2.0 * x * (r - circuit.damping * dx)
    early = 2.0 * x / (math.sqrt(square) - dx) if square > 0.0 else circuit.per_fast
    return min(early, circuit.per_fast)
