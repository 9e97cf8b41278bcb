"""Legs of a servo whose static friction fades as it speeds up: in closed form beyond that, a creep below.

A creep is an integral over the speed (`motions.stribeck`), on which the angle goes one way. Motor and output are one
body here: with play between them the motor alone may creep, for which there is no such integral.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics import guards
from servotwin.models.engine.dynamics.coefficients import Apart, linear_coefficients
from servotwin.models.engine.events import crossings
from servotwin.models.engine.legs import legs
from servotwin.models.engine.legs.legs import MOST_LEGS, MOST_SHORT, SHORT, Gone
from servotwin.models.engine.motions import stribeck
from servotwin.models.state.modes import INSIDE, UNIT, Mode, Vector, one_body
from servotwin.models.terms import play
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at

TOLERANCE = 1e-12  # rad, rad/s: of a creep, as of one at the accuracy that is usual
_TRIES = 200  # of the time at which a creep meets a stop
IN_FLOATS = {"TOLERANCE": 1e-6}


class Crept(NamedTuple):
    """Where a creep has led after a time [s], which guard ended it (−1: none); 1, or 0 where that is not found."""

    time: float
    y: Vector
    kind: int
    done: float


def go(numbers: Numbers, torque: float, u: float, y: Vector, mode: Mode, wiper: float, time: float) -> Gone:
    """Return where a servo goes within a time [s], as `legs.go` has it; with play in its gear no friction may fade."""
    short = 0
    for _ in range(MOST_LEGS):
        if legs.stands(mode) or not time > 0.0:
            return Gone(y, mode, wiper, 1.0 if math.isfinite(y.q) else 0.0)
        if stribeck.creeps(numbers, mode, u, torque, y):
            gone, y, kind, done = crept(numbers, mode, u, torque, y, time)
            if done == 0.0:
                return Gone(y, mode, wiper, 0.0)
        else:
            inside = mode.mesh == INSIDE
            laws = legs.laws_of(numbers, mode, u, torque) if inside else laws_of(numbers, mode, u, torque, y.w)
            end = legs.ending(numbers, mode, laws, u, torque, y, time)
            gone, kind = min(end.time, time), end.kind
            y = end.after if kind < 0 else legs.moved(numbers, mode, laws, y, end.time)
        wiper = wiper_at(numbers.sensor, wiper, y.q)
        if kind >= 0:
            mode, y = crossings.cross(numbers, mode, kind, u, torque, y)
        short = short + 1 if gone <= SHORT * time else 0
        if short >= MOST_SHORT and play.present(numbers.play):
            _, mode, y = legs.together(numbers, mode, u, torque, y)
        time -= gone
    return Gone(y, mode, wiper, 0.0)


def laws_of(numbers: Numbers, mode: Mode, u: float, torque: float, w: float) -> Apart:
    """Return the laws of a shaft that slides faster than it creeps, with the speed w."""
    a, _, f, _, _, _, _, _, _ = linear_coefficients(numbers, mode, (u, 0.0, 0.0, 0.0, 0.0), (torque, 0.0), 0.0, w)
    return Apart(2.0 * a, f, 2.0 * a, f)


def crept(numbers: Numbers, mode: Mode, u: float, torque: float, y: Vector, time: float) -> Crept:
    """Return where a shaft creeps to within a time [s]: to where its law changes, to a stop, or a part of the way."""
    end = stribeck.creep(numbers, mode, u, torque, y, time, TOLERANCE)
    after, stops = one_body(end.q, end.w, y), numbers.stops
    kind = guards.UPPER if stops.upper - end.q < guards.BELOW else (
        guards.LOWER if end.q - stops.lower < guards.BELOW else -1)
    if kind < 0 or end.done == 0.0:
        return Crept(end.time, after, end.ends_by, end.done)
    return _to(numbers, mode, u, torque, y, after, end.time, kind)


def _to(numbers: Numbers, mode: Mode, u: float, torque: float, y: Vector, after: Vector, time: float,
        kind: int) -> Crept:
    """Return where a creep that goes beyond a stop within a time [s] meets it."""
    stop = numbers.stops.upper if kind == guards.UPPER else numbers.stops.lower
    a, b, s, at = 0.0, time, time, after
    for _ in range(_TRIES):
        guess = s - (at.q - stop) / at.w if at.w != 0.0 else a
        s = guess if a < guess < b else 0.5 * (a + b)
        q, w = stribeck.at_time(numbers, mode, u, torque, y, after, TOLERANCE, s)
        at = one_body(q, w, y)
        if q == stop:
            break
        a, b = (a, s) if (q > stop) == (kind == guards.UPPER) else (s, b)
        if b - a <= UNIT * b or abs(q - stop) <= UNIT * abs(stop):
            break
    return Crept(s, at, kind, 1.0)
