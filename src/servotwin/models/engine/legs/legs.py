"""Legs: how a servo moves under constant inputs where each of its bodies moves by ẇ = f − λ w.

Behind a bridge, without inductance, heat, spring, pendulum and friction that fades, motor and output move so: as one
body, or inside the play of the gear as two. All that ends a leg is computed in closed form, by the laws of the general
engine. A leg is a handful of numbers; no motion is kept.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.dynamics.coefficients import Apart, apart_coefficients, linear_coefficients
from servotwin.models.engine.events import crossings
from servotwin.models.engine.events.first_event import first_end
from servotwin.models.engine.motions import first_order
from servotwin.models.engine.motions.first_order import Course, both
from servotwin.models.state.modes import INSIDE, ON_BACKWARD, ON_FORWARD, Mode, Vector, at_rest
from servotwin.models.terms import play
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.sensor import wiper_at

MOST_LEGS = 4000  # under one drive: an output that comes to rest between motor and stop needs hundreds
MOST_SHORT = 8  # legs within next to no time: then motor and output stay together
SHORT, _AT_END = 1e-9, 1e-6  # of a time, of the play
IN_FLOATS = {"SHORT": 1e-4}


class Gone(NamedTuple):
    """Where a servo has gone: state, mode, potentiometer [rad]; 1, or 0 where it gave up."""

    y: Vector
    mode: Mode
    wiper: float
    done: float


class Ending(NamedTuple):
    """When a leg ends [s], by which guard (−1: with its time), and the state at the end of that time."""

    time: float
    kind: int
    after: Vector


def mode_from(numbers: Numbers, torque: float, u: float, y: Vector, mesh: int) -> Mode:
    """Return the mode in which a servo continues, under a voltage behind the bridge and an external torque [N m]."""
    zone = currents.zone_of(numbers, u, 0.0, y.q, y.w_m, 0.0)
    return contacts.settled(numbers, zone, u, torque, y, mesh, False)


def stands(mode: Mode) -> bool:
    """Tell whether nothing moves."""
    return at_rest(mode.contact) and (mode.mesh != INSIDE or at_rest(mode.motor))


def laws_of(numbers: Numbers, mode: Mode, u: float, torque: float) -> Apart:
    """Return the laws of output and motor, the same of both where they are in contact."""
    if mode.mesh == INSIDE:
        return apart_coefficients(numbers, mode, u, torque)
    a, _, f, _, _, _, _, _, _ = linear_coefficients(numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (torque, 0.0), 0.0, 0.0)
    return Apart(2.0 * a, f, 2.0 * a, f)


def moved(numbers: Numbers, mode: Mode, laws: Apart, y: Vector, s: float) -> Vector:
    """Return the state s [s] after y."""
    if mode.mesh == INSIDE:
        return both(Course(laws.output_rate, laws.output_pull, y.q, y.w),
                    Course(laws.motor_rate, laws.motor_pull, y.q_m, y.w_m), y, s)
    q, w = first_order.propagate(laws.output_rate, laws.output_pull, y.q, y.w, s)
    return with_motor(numbers.play, mode.mesh, Vector(q, w, y.i, y.T_w, y.T_h, y.q_m, y.w_m))


def ending(numbers: Numbers, mode: Mode, laws: Apart, u: float, torque: float, y: Vector, time: float) -> Ending:
    """Return how a leg from y ends within a time [s]."""
    after = moved(numbers, mode, laws, y, time)
    kinds = guards.guards(numbers, mode, u, False)
    s, kind = first_end(numbers, mode, kinds, u, torque, laws, y, after, 0.0, time)
    return Ending(s, kind, after)


def go(numbers: Numbers, torque: float, u: float, y: Vector, mode: Mode, wiper: float, time: float) -> Gone:
    """Return where a servo goes within a time [s], under a voltage behind the bridge and an external torque [N m]."""
    short = 0
    for _ in range(MOST_LEGS):
        if stands(mode) or not time > 0.0:
            return Gone(y, mode, wiper, 1.0)
        laws = laws_of(numbers, mode, u, torque)
        end = ending(numbers, mode, laws, u, torque, y, time)
        if end.kind < 0:
            wiper = wiper_at(numbers.sensor, wiper, end.after.q)
            return Gone(end.after, mode, wiper, 1.0 if math.isfinite(end.after.q + end.after.q_m) else 0.0)
        y = moved(numbers, mode, laws, y, end.time)
        wiper = wiper_at(numbers.sensor, wiper, y.q)
        mode, y = crossings.cross(numbers, mode, end.kind, u, torque, y)
        short = short + 1 if end.time <= SHORT * time else 0
        if short >= MOST_SHORT and play.present(numbers.play):
            _, mode, y = together(numbers, mode, u, torque, y)
        time -= end.time
    return Gone(y, mode, wiper, 0.0)


def together(numbers: Numbers, mode: Mode, u: float, torque: float, y: Vector) -> tuple[int, Mode, Vector]:
    """Return 1, mode and state of motor and output as one body, if they are at an end of the play; else 0."""
    ahead, half = y.q_m - y.q, numbers.play.half
    if mode.mesh == INSIDE and not abs(abs(ahead) - half) <= _AT_END * half:
        return 0, mode, y
    mesh = mode.mesh
    if mesh == INSIDE:
        y = play.met(numbers.play, numbers.shaft, ahead > 0.0, y)
        mesh = ON_FORWARD if ahead > 0.0 else ON_BACKWARD
    return 1, contacts.held(numbers, currents.zone_of(numbers, u, 0.0, y.q, y.w_m, y.i), u, torque, y, mesh), y
