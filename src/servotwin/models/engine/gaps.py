"""How a servo with play in its gear goes on under constant inputs, leg by leg: as one body, or as two inside the play.

Behind a bridge, without inductance, heat, spring and friction that varies, each body moves by a law of first order, and
all that ends a leg is told in closed form. Everything here asks the laws of the general engine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine import contacts, currents, first_order, guards
from servotwin.models.engine.coefficients import Apart, apart_coefficients, linear_coefficients
from servotwin.models.engine.courses import Course, both
from servotwin.models.engine.modes import INSIDE, Mode, Vector, at_rest, moving
from servotwin.models.engine.outright import first_end
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.sensor import wiper_at

MOST_LEGS = 400  # in one phase; a servo that needs more is left to the general engine


class Gone(NamedTuple):
    """Where a servo has gone: state, mode and potentiometer [rad]; 1, or 0 where it gave up."""

    y: Vector
    mode: Mode
    wiper: float
    done: float


def go(numbers: Numbers, torque: float, drive: float, y: Vector, mesh: int, wiper: float, time: float) -> Gone:
    """Return where a servo goes within `time` [s] under one drive (−1, 0, +1) and a constant external torque [N m]."""
    u = drive * numbers.source.V
    mode = contacts.settled(numbers, currents.zone_of(numbers, u, 0.0, y.q, y.w_m, 0.0), u, torque, y, mesh, False)
    for _ in range(MOST_LEGS):
        still = at_rest(mode.contact) and (mode.mesh != INSIDE or at_rest(mode.motor))
        if still or not time > 0.0:
            return Gone(y, mode, wiper, 1.0)
        laws = laws_of(numbers, mode, u, torque, y)
        after = moved(numbers, mode, laws, y, time)
        s, kind = first_end(numbers, mode, guards.guards(numbers, mode, u, False), u, torque, laws, y, after, 0.0, time)
        y = after if kind < 0 else moved(numbers, mode, laws, y, s)
        wiper = wiper_at(numbers.sensor, wiper, y.q)
        if kind < 0:
            return Gone(y, mode, wiper, 1.0 if math.isfinite(y.q + y.q_m) else 0.0)
        mode, y = guards.cross(numbers, mode, kind, u, torque, y)
        time -= s
    return Gone(y, mode, wiper, 0.0)


def laws_of(numbers: Numbers, mode: Mode, u: float, torque: float, y: Vector) -> Apart:
    """Return the laws of output and motor, the same of both where they are in contact."""
    if mode.mesh == INSIDE:
        return apart_coefficients(numbers, mode, u, torque)
    a, _, f, _, _, _, _, _, _ = linear_coefficients(
        numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (torque, 0.0), y.q, y.w)
    return Apart(2.0 * a, f, 2.0 * a, f)


def moved(numbers: Numbers, mode: Mode, laws: Apart, y: Vector, s: float) -> Vector:
    """Return the state s [s] after y."""
    if mode.mesh == INSIDE:
        return both(Course(laws.output_rate, laws.output_pull, y.q, y.w),
                    Course(laws.motor_rate, laws.motor_pull, y.q_m, y.w_m), y, s)
    q, w = first_order.propagate(laws.output_rate, laws.output_pull, y.q, y.w, s)
    return with_motor(numbers.play, mode.mesh, moving(y, q, w, y.w_m))
