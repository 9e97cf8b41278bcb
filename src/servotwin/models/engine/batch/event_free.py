"""Ticks in which nothing happens: a servo that is surely still in its mode at the end goes there at once.

For servos whose voltage follows the error, of one body without terms of their own: their motion is `second_order`'s. On
its way the acceleration h fulfils ḧ + 2a ḣ + c h = 0, so that |ḣ| ≤ √(ḣ₀² + c h₀²) and speed and angle stay near where
they are. A lane that might leave its mode goes from event to event, as everything else does.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.coefficients import linear_coefficients
from servotwin.models.engine.lanes import numbers_of
from servotwin.models.engine.memory import BEAT, FRAMES, point_of
from servotwin.models.engine.motions import first_order, second_order
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import RIGID, Mode, Vector, at_rest
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import error_of

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes


def go(lanes: Lanes, which: Indices, duration: Floats, status: Any, rows: Any, done: Indices) -> int:
    """Advance those by a time [s] that are through it without an event, and mark them; return how many are left."""
    left = 0
    for k in range(which.size):
        done[k] = 0
        lane, time = which[k], rows[k].point.time + duration[0]
        if status[lane] != COMPLETED or time >= FRAMES * BEAT or rows[k].beat != BEAT:
            left += 1
            continue
        y, numbers = point_of(rows[k].point).y, numbers_of(lanes, lane)
        q, w, still = after(numbers, lanes.pieces[lanes.piece_first[lane], 1], lanes.torque[lane], y.q, y.w,
                            duration[0])
        if not still:
            left += 1
            continue
        done[k] = 1
        point = rows[k].point
        point.time, point.anchor_time, point.wiper = time, math.inf, q
        point.y.q, point.y.w, point.y.q_m, point.y.w_m = q, w, q, w
    return left


def after(numbers: Numbers, u: float, tau: float, q: float, w: float, time: float) -> tuple[float, float, bool]:
    """Return angle and speed after a time [s] under constant inputs, and whether the mode lasts so long."""
    zone = currents.zone_of(numbers, u, 0.0, q, w, 0.0)
    mode = contacts.settled(numbers, zone, u, tau, Vector(q, w, 0.0, 0.0, 0.0, q, w), RIGID, False)
    if at_rest(mode.contact):
        return q, w, True
    coefficients = linear_coefficients(numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (tau, 0.0), q, w)
    if not lasts(numbers, mode, u, coefficients, time):
        return q, w, False
    a, c, f, _, _, _, _, _, _ = coefficients
    if c == 0.0:
        q, w = first_order.propagate(2.0 * a, f, q, w, time)
    else:
        q, w = second_order.propagate(coefficients, time)
    return q, w, True


def lasts(numbers: Numbers, mode: Mode, u: float, coefficients: tuple[float, ...], time: float) -> bool:
    """Tell whether speed, error and angle surely stay within their mode for a time [s]."""
    a, c, _, _, _, _, _, q, w = coefficients
    h = second_order.acceleration(coefficients, 0.0, q, w)
    dh = -2.0 * a * h - c * w
    change = time * (abs(h) + time * math.sqrt(dh * dh + c * h * h))  # of the speed, at most
    way = time * (abs(w) + change)
    if not (a >= 0.0 and c >= 0.0 and abs(w) > change):
        return False
    low, high = currents.zone_limits(numbers, mode.zone, u)
    error, other = error_of(numbers.sensor, u, q), abs(numbers.sensor.p) * way
    return (low + other < error < high - other
            and numbers.stops.lower + way < q < numbers.stops.upper - way)
