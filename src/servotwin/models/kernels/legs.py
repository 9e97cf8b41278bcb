"""A leg: a shaft that slides one way, with the same current path, under constant voltage and torque.

There its speed solves ẇ = f − λ w, so it moves monotonically towards f/λ. A leg is over when its time is, when the
shaft stops, or when the speed reaches the edge of the bridge's dead zone, where the current starts or stops. This
serves pulse servos without inductance, spring, pendulum and recorded torque; everything is divided by the inertia.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.kernels.elementary import decay, fma, log1p_and_rest
from servotwin.models.kernels.hybrid import Plant, holding_bounds

MOST_LEGS = 100  # in one phase; a servo that needs more is left to the general engine


class Shaft(NamedTuple):
    """What the legs of one servo read."""

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


class Leg(NamedTuple):
    """One leg, seen in the direction of motion (speed v ≥ 0)."""

    direction: float
    v: float  # at the start
    rate: float
    per_rate: float
    pull: float  # dv/dt at the start
    edge: float  # the speed at which the leg ends
    pull_there: float  # dv/dt there


def shaft_of(plant: Plant, torque: float) -> Shaft:
    """Return what the legs read of a plant with a bridge under a constant external torque [N m]."""
    J, b, K, K_b = plant.J, plant.b, plant.K, plant.K_b
    rate_drive = (b + K * K_b / plant.R_drive) / J
    rate_off = (b + K * K_b / plant.R_off) / J
    rate_free = b / J
    push = K * plant.V / (plant.R_drive * J)
    drag_drive = K * plant.D_drive / (plant.R_drive * J)
    forward = (plant.F_forward + plant.coulomb) / J
    backward = (plant.F_backward + plant.coulomb) / J
    pull = max(plant.K * (plant.V - plant.D_drive) / plant.R_drive, 0.0)
    return Shaft(
        rate_drive, rate_off, rate_free, _inverse(rate_drive), _inverse(rate_off), _inverse(rate_free), push,
        drag_drive, K * plant.D_off / (plant.R_off * J), plant.V / K_b, plant.D_drive / K_b, plant.D_off / K_b,
        forward, backward, torque / J, _start(plant, pull - torque), _start(plant, -pull - torque),
        _start(plant, -torque), plant.lower, plant.upper)


def _inverse(x: float) -> float:
    return 1.0 / x if x > 0.0 else 0.0


def _start(plant: Plant, torque: float) -> float:
    """Return which way a shaft at rest starts under a torque [N m]: −1, 0, +1."""
    backward, forward = holding_bounds(plant)
    if torque > forward:
        return 1.0
    if torque < -backward:
        return -1.0
    return 0.0


def start_of(shaft: Shaft, drive: float) -> float:
    """Return which way a shaft at rest starts: −1, 0, +1."""
    driven = shaft.start_forward if drive > 0.0 else shaft.start_backward
    return driven if drive != 0.0 else shaft.start_off


def leg_of(shaft: Shaft, drive: float, w: float) -> Leg:
    """Return the leg of a shaft with the speed w; at rest, the one in which it starts."""
    start = start_of(shaft, drive)
    forward = w > 0.0 or (w == 0.0 and start > 0.0)
    direction = 1.0 if forward else -1.0
    v = abs(w)
    off = drive == 0.0
    with_drive = drive * direction
    gap = shaft.gap_off if off else shaft.gap_drive
    v1 = with_drive * shaft.speed - gap  # below v1 the current pushes, beyond v2 it brakes
    v2 = with_drive * shaft.speed + gap
    resist = (shaft.friction_forward if forward else shaft.friction_backward) + shaft.against * direction
    coasting = -fma(shaft.rate_free, v, resist)
    below = v < v1 or (v == v1 and coasting < 0.0)  # on an edge, whereto it moves decides
    above = v > v2 or (v == v2 and coasting > 0.0)
    drag = shaft.drag_off if off else shaft.drag_drive
    rate_on = shaft.rate_off if off else shaft.rate_drive
    per_rate_on = shaft.per_rate_off if off else shaft.per_rate_drive
    flows = below or above
    rate = rate_on if flows else shaft.rate_free
    per_rate = per_rate_on if flows else shaft.per_rate_free
    f_on = fma(with_drive, shaft.push, (-drag if below else drag)) - resist
    f = f_on if flows else -resist
    pull = fma(-rate, v, f)
    up = v1 if below else (math.inf if above else v2)
    down = 0.0 if below else max(v2 if above else v1, 0.0)
    edge = up if pull > 0.0 else down
    return Leg(direction, v, rate, per_rate, pull, edge, fma(-rate, edge, f))


def reaches_edge(leg: Leg, v: float) -> bool:
    """Tell whether a leg that would have the speed v at the end of its time reaches its edge before."""
    if leg.pull > 0.0:
        return v >= leg.edge and leg.pull_there > 0.0
    return v <= leg.edge and leg.pull_there < 0.0


def way_to_edge(w: float, edge: float, pull_there: float, rate: float, per_rate: float) -> tuple[float, float]:
    """Return time [s] and angle [rad] of a leg that goes from the speed w to its edge, all of them with their signs."""
    y = (edge - w) / pull_there
    log, rest = log1p_and_rest(rate * y)
    if rate == 0.0:
        return y, y * fma(-0.5 * y, pull_there, edge)
    t = log * per_rate
    return t, fma(edge, t, -pull_there * (per_rate * per_rate) * rest)


def moves(shaft: Shaft, drive: float, w: float) -> bool:
    """Tell whether a shaft with the speed w is in motion, or starts."""
    return w != 0.0 or start_of(shaft, drive) != 0.0


def within_stops(shaft: Shaft, q: float) -> bool:
    """Tell whether an angle lies between the stops; false for nan too."""
    return shaft.lower < q < shaft.upper


def slide(shaft: Shaft, drive: float, q: float, w: float, time: float) -> tuple[float, float, float]:
    """Return angle and speed after `time` [s] under one drive (−1, 0, +1), and 1.0, or 0.0 where this gave up.

    It gives up at a stop and after too many legs.
    """
    legs = 0
    while moves(shaft, drive, w):
        leg = leg_of(shaft, drive, w)
        once, twice = decay(leg.rate, leg.per_rate, time)
        v = fma(leg.pull, once, leg.v)
        ends = reaches_edge(leg, v)
        if ends:
            edge = leg.direction * leg.edge
            t, turn = way_to_edge(w, edge, leg.direction * leg.pull_there, leg.rate, leg.per_rate)
            q, w, time = q + turn, edge, max(time - t, 0.0)
        else:
            q, w = fma(leg.direction, fma(leg.pull, twice, leg.v * time), q), leg.direction * v
        legs += 1
        if not within_stops(shaft, q) or legs > MOST_LEGS:
            return q, w, 0.0
        if not ends:
            break
    return q, w, 1.0
