"""Legs of two bodies with a spring between them, under a constant voltage and torque: a power series each.

A leg that surely lasts for all of its time is one series; any other goes from event to event, by the general engine.
"""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.engine import step
from servotwin.models.engine.dynamics import currents, guards, spring_contact
from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.engine.legs.legs import Gone
from servotwin.models.engine.memory import Point
from servotwin.models.engine.motions import motion, two_mass_series
from servotwin.models.engine.step import COMPLETED, MOST_IDLE
from servotwin.models.state.modes import NOWHERE, Mode, Vector
from servotwin.models.terms import elastic
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece


class Law(NamedTuple):
    """The law of two bodies, as in `two_mass_series`; in which mode, driven or not, at which resistance; how long."""

    A: tuple[Vector, ...]
    mode: Mode
    driven: bool
    R: float
    longest: float


_NOTHING = (NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE)
NO_LAW = Law(_NOTHING, Mode(0, 0, 0, 0, 0), False, 0.0, 0.0)


def mode_from(numbers: Numbers, torque: float, u: float, y: Vector, mesh: int) -> Mode:
    """Return the mode in which a servo continues, under a voltage behind the bridge and an external torque [N m]."""
    zone = currents.zone_of(numbers, u, 0.0, y.q, turning(numbers.elastic, y), y.i)
    return spring_contact.settled(numbers, zone, u, torque, y, mesh)


def law_of(known: Law, numbers: Numbers, mode: Mode, u: float, tau: float) -> Law:
    """Return the law in a mode: where it is the known one with another voltage, with what that alone changes."""
    driven = u != 0.0
    R = numbers.bridge.R_drive if driven else numbers.bridge.off.R
    if mode == known.mode and driven == known.driven and R == known.R:
        A = known.A
        return Law((A[0], A[1], A[2], rates_of(numbers, mode, u, tau, NOWHERE), A[4], A[5], A[6]), mode, driven, R,
                   known.longest)
    A = two_mass_series.law(numbers, mode, u, tau)
    return Law(A, mode, driven, R, min(two_mass_series.longest(A), elastic.longest_step(numbers.elastic,
                                                                                        numbers.shaft)))


def go(numbers: Numbers, law: Law, torque: float, u: float, y: Vector, mode: Mode, time: float,
       accuracy: float) -> Gone:
    """Return where a servo goes within a time [s], as `legs.go` has it."""
    if time <= law.longest:
        after = two_mass_series.propagate(law.A, y, time)
        if not _ends(numbers, mode, law.A, torque, u, y, after):
            return Gone(after, mode, after.q, 1.0)
    return _by_steps(numbers, torque, u, y, mode, time, accuracy)


def _ends(numbers: Numbers, mode: Mode, A: tuple[Vector, ...], torque: float, u: float, y: Vector,
          after: Vector) -> bool:
    """Tell whether a mode may end on the way between two states, on which a guard turns once at most."""
    kinds = guards.guards(numbers, mode, u, False)
    rates, rates_after = two_mass_series.rates(A, y), two_mass_series.rates(A, after)
    for kind in range(guards.KINDS):
        if not kinds >> kind & 1:
            continue
        value, slope = guards.guard(numbers, mode, kind, u, 0.0, torque, 0.0, after, rates_after)
        if value < guards.BELOW:
            return True
        if slope > 0.0 and guards.guard(numbers, mode, kind, u, 0.0, torque, 0.0, y, rates)[1] < 0.0:
            return True
    return False


def _by_steps(numbers: Numbers, torque: float, u: float, y: Vector, mode: Mode, time: float, accuracy: float) -> Gone:
    voltage, against = Piece(0.0, u, 0.0, 0.0, 0.0, 0.0, 0.0), Piece(0.0, torque, 0.0, 0.0, 0.0, 0.0, 0.0)
    point, m, idle = Point(0.0, y, mode, 0.0, y, time, y.q), motion.nothing(numbers, voltage, against), 0
    while point.time < time:
        before = point.time
        point, m, _, status = step.onward(numbers, point, voltage, against, m, before == 0.0, time, time, accuracy)
        idle = idle + 1 if point.time == before else 0
        if status != COMPLETED or idle > MOST_IDLE:
            return Gone(y, mode, y.q, 0.0)
    return Gone(point.y, point.mode, point.y.q, 1.0)
