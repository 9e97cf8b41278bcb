"""An arc: a stretch with one law. A shaft slides one way, by the same current path, under constant voltage and torque.

There its speed solves ẇ = f − λ w, so it moves monotonically towards f/λ. An arc is over when its time is, when the
shaft stops, or when the speed reaches the edge of the bridge's dead zone, where the current starts or stops. This
serves pulse servos without inductance, spring, pendulum and recorded torque; everything is divided by the inertia.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics.contacts import holding_bounds
from servotwin.models.engine.motions.elementary import decay, fma, log1p_and_rest
from servotwin.models.terms.friction import coulomb
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import accelerated
from servotwin.physics import bridge, friction, motor
from servotwin.physics.shaft import shaft_acceleration

MOST_ARCS = 100  # in one phase; a servo that needs more is left to the general engine


class ArcNumbers(NamedTuple):
    """Numbers of one servo that its arcs read."""

    rate_drive: float  # λ = (b + K K_b/R)/J while driving with current [1/s]
    rate_off: float  # while off with current
    rate_free: float  # b/J: without current
    per_rate_drive: float  # 1/λ; 0 where λ is
    per_rate_off: float
    per_rate_free: float
    push: float  # K V/(R_drive J), acceleration by the full voltage [rad/s²]
    drag_drive: float  # K D/(R J) [rad/s²]
    drag_off: float
    speed: float  # V/K_b [rad/s]
    gap_drive: float  # D/K_b [rad/s]
    gap_off: float
    friction_forward: float  # [rad/s²]
    friction_backward: float
    against: float  # τ_ext/J [rad/s²]
    start_forward: float  # which way a shaft at rest starts while driven forward: −1, 0, +1
    start_backward: float
    start_off: float
    lower: float
    upper: float
    inertia: float
    pull: float  # of full drive on a shaft at rest [N m]
    hold_forward: float  # most that friction holds against a start [N m]
    hold_backward: float


class Loading(NamedTuple):
    """A constant external torque for the arcs of a servo."""

    against: float  # τ_ext/J [rad/s²]
    start_forward: float  # which way a shaft at rest starts while driven forward: −1, 0, +1
    start_backward: float
    start_off: float


class Arc(NamedTuple):
    """One arc: ẇ = pull − rate (w − start speed)."""

    rate: float
    per_rate: float
    pull: float  # ẇ at the start [rad/s²]
    edge: float  # the speed at which the arc ends [rad/s]
    pull_there: float  # ẇ there


def arc_numbers(numbers: Numbers, torque: float) -> ArcNumbers:
    """Return what the arcs read of a servo with a bridge under a constant external torque [N m]."""
    own, path, V = numbers.shaft, numbers.bridge, numbers.source.V
    emf = motor.back_emf(1.0, numbers.motor.K_b)
    rate_drive = accelerated(own, own.b + _torque(numbers, emf, path.R_drive))
    rate_off = accelerated(own, own.b + _torque(numbers, emf, path.off.R))
    rate_free = accelerated(own, own.b)
    forward = accelerated(own, coulomb(numbers.friction, True) + numbers.load.coulomb)
    backward = accelerated(own, coulomb(numbers.friction, False) + numbers.load.coulomb)
    push = _torque(numbers, bridge.driving_voltage(V, 0.0, 0.0), path.R_drive)
    drag = _torque(numbers, bridge.driving_voltage(0.0, -1.0, path.D_drive), path.R_drive)
    drag_off = _torque(numbers, bridge.driving_voltage(0.0, -1.0, path.off.D), path.off.R)
    pull = max(_torque(numbers, bridge.driving_voltage(V, 1.0, path.D_drive), path.R_drive), 0.0)
    hold_backward, hold_forward = holding_bounds(numbers, 0.0, 0.0)
    load = loading(own.J, pull, hold_forward, hold_backward, torque)
    return ArcNumbers(
        rate_drive, rate_off, rate_free, _inverse(rate_drive), _inverse(rate_off), _inverse(rate_free),
        accelerated(own, push), accelerated(own, drag), accelerated(own, drag_off), V / emf, path.D_drive / emf,
        path.off.D / emf, forward, backward, load.against, load.start_forward, load.start_backward, load.start_off,
        numbers.stops.lower, numbers.stops.upper, own.J, pull, hold_forward, hold_backward)


def loading(inertia: float, pull: float, hold_forward: float, hold_backward: float, torque: float) -> Loading:
    """Return what a constant external torque [N m] does to a shaft."""
    return Loading(
        shaft_acceleration(torque, 0.0, 0.0, 0.0, 0.0, inertia), starting(hold_forward, hold_backward, pull - torque),
        starting(hold_forward, hold_backward, -pull - torque), starting(hold_forward, hold_backward, -torque))


def under(numbers: ArcNumbers, torque: float) -> ArcNumbers:
    """Return the same under another constant external torque [N m]."""
    load = loading(numbers.inertia, numbers.pull, numbers.hold_forward, numbers.hold_backward, torque)
    return numbers._replace(against=load.against, start_forward=load.start_forward,
                            start_backward=load.start_backward, start_off=load.start_off)


def _torque(numbers: Numbers, voltage: float, R: float) -> float:
    """Return the motor's torque [N m] by a voltage [V] at a standstill, in a circuit of R [Ω]."""
    i = motor.steady_armature_current(voltage, 0.0, R, numbers.motor.K_b)
    return motor.electromagnetic_torque(i, numbers.motor.K)


def _inverse(x: float) -> float:
    return 1.0 / x if x > 0.0 else 0.0


def starting(forward: float, backward: float, torque: float) -> float:
    """Return which way a shaft at rest starts under a torque [N m]: −1, 0, +1."""
    if friction.sticks(torque, forward, backward):
        return 0.0
    return 1.0 if torque > 0.0 else -1.0


def start_of(numbers: ArcNumbers, drive: float) -> float:
    """Return which way a shaft at rest starts: −1, 0, +1."""
    driven = numbers.start_forward if drive > 0.0 else numbers.start_backward
    return driven if drive != 0.0 else numbers.start_off


def arc_of(numbers: ArcNumbers, drive: float, w: float) -> Arc:
    """Return the arc of a shaft with the speed w; at rest, the one in which it starts."""
    forward = w > 0.0 or (w == 0.0 and start_of(numbers, drive) > 0.0)
    off = drive == 0.0
    gap = numbers.gap_off if off else numbers.gap_drive
    balance = drive * numbers.speed
    low, high = balance - gap, balance + gap  # below `low` the current pushes forward, above `high` backward
    load = (numbers.friction_forward if forward else -numbers.friction_backward) + numbers.against
    coasting = -fma(numbers.rate_free, w, load)
    below = w < low or (w == low and coasting < 0.0)  # on an edge, whereto it moves decides
    above = w > high or (w == high and coasting > 0.0)
    drag = numbers.drag_off if off else numbers.drag_drive
    flows = below or above
    rate = (numbers.rate_off if off else numbers.rate_drive) if flows else numbers.rate_free
    per_rate = (numbers.per_rate_off if off else numbers.per_rate_drive) if flows else numbers.per_rate_free
    push = fma(drive, numbers.push, -drag if below else drag)
    f = (push if flows else 0.0) - load
    pull = fma(-rate, w, f)
    up = low if below else (math.inf if above else high)
    down = high if above else (-math.inf if below else low)
    edge = (up if forward else min(up, 0.0)) if pull > 0.0 else (max(down, 0.0) if forward else down)
    return Arc(rate, per_rate, pull, edge, fma(-rate, edge, f))


def reaches_edge(arc: Arc, w: float) -> bool:
    """Tell whether a arc that would have the speed w at the end of its time reaches its edge before."""
    if arc.pull > 0.0:
        return w >= arc.edge and arc.pull_there > 0.0
    return w <= arc.edge and arc.pull_there < 0.0


def way_to_edge(w: float, edge: float, pull_there: float, rate: float, per_rate: float) -> tuple[float, float]:
    """Return time [s] and angle [rad] of a arc that goes from the speed w to its edge, all of them with their signs."""
    y = (edge - w) / pull_there
    log, rest = log1p_and_rest(rate * y)
    if rate == 0.0:
        return y, y * fma(-0.5 * y, pull_there, edge)
    t = log * per_rate
    return t, fma(edge, t, -pull_there * (per_rate * per_rate) * rest)


def moves(numbers: ArcNumbers, drive: float, w: float) -> bool:
    """Tell whether a shaft with the speed w is in motion, or starts."""
    return w != 0.0 or start_of(numbers, drive) != 0.0


def within_stops(numbers: ArcNumbers, q: float) -> bool:
    """Tell whether an angle lies between the stops; false for nan too."""
    return numbers.lower < q < numbers.upper


class Slid(NamedTuple):
    """Where a slide has led: angle, speed, the angle at which it stopped or began, and 1, or 0 where it gave up."""

    q: float
    w: float
    turned: float
    done: float


def slide(numbers: ArcNumbers, drive: float, q: float, w: float, time: float) -> Slid:
    """Return where a shaft slides to within `time` [s] under one drive (−1, 0, +1).

    It gives up at a stop and after too many arcs.
    """
    arcs, turned = 0, q
    while moves(numbers, drive, w):
        arc = arc_of(numbers, drive, w)
        once, twice = decay(arc.rate, arc.per_rate, time)
        after = fma(arc.pull, once, w)
        ends = reaches_edge(arc, after)
        if ends:
            t, turn = way_to_edge(w, arc.edge, arc.pull_there, arc.rate, arc.per_rate)
            q, w, time = q + turn, arc.edge, max(time - t, 0.0)
            turned = q if w == 0.0 else turned
        else:
            q, w = fma(arc.pull, twice, fma(w, time, q)), after
        arcs += 1
        if not within_stops(numbers, q) or arcs > MOST_ARCS:
            return Slid(q, w, turned, 0.0)
        if not ends:
            break
    return Slid(q, w, turned, 1.0)
