"""What another simulator decides of a servo, as changes of its numbers and of where it stands."""

from __future__ import annotations

import math

from servotwin.models.engine.memory import Point
from servotwin.models.engine.observe import on_bus
from servotwin.models.state.modes import INSIDE, RIGID, Mode, Vector
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source, regulated


def possible(given: float, followed: float, low: float, high: float, least: float, most: float) -> bool:
    """Tell whether a servo takes a command, as it is given and as the engine follows it.

    The one may be from `low` to `high`, the other lies between `least` and `most`; nan is not possible.
    """
    return low <= given <= high and least < followed < most


def with_load_inertia(given: Shaft, J_L: float, load_total: float) -> Shaft:
    """Return a shaft with another inertia J_L [kg m²] in the place of its load's, `load_total`."""
    J_out = J_L + (given.J_out - load_total)
    return Shaft(given.J + (J_out - given.J_out), given.b, J_out, given.b_out)


def on_known_bus(given: Numbers, V: float, V_oc: float, pulsed: bool) -> Numbers:
    """Return a servo on a bus of V [V] instead of a source of V_oc; without pulses that limits its mean voltage."""
    if pulsed:
        return on_bus(given, V)
    own = given.follower
    return given._replace(follower=own._replace(V_max=max(own.V_max + V - V_oc, 0.0)))


def runs_otherwise(before: Source, V: float, drop: float, pulsed: bool) -> bool:
    """Tell whether a servo may have to run in another way on a bus of V [V]; `drop` [V] is its bridge's."""
    return pulsed and ((before.V > drop) != (V > drop) or regulated(before))


def impulse_work(shaft: Shaft, alone: bool, before: float, after: float) -> float:
    """Return the kinetic energy [J] that a speed gives which is set [rad/s], to the output `alone` or to motor too."""
    J = shaft.J_out if alone else shaft.J
    return 0.5 * J * (after * after - before * before)


def placed(point: Point, angle: float, speed: float, sets_angle: bool, sets_speed: bool, half_play: float,
           half_slack: float, sprung: bool) -> Point:
    """Return a point with another angle [rad] or speed [rad/s] of the output, from which a new motion begins.

    Motor and potentiometer go along as far as their play. Where the speed is set too, the shaft is one that another
    simulator moves: the motor goes along so that the play stays as it is, or teeth that have met within a tick would be
    apart again. What is at the other end of a spring (`sprung`) goes along so that the twist stays, and keeps its
    speed.
    """
    q, w, i, T_w, T_h, q_motor, w_motor = point.y
    wiper, play = point.wiper, half_play > 0.0
    if sets_angle:
        q_motor = behind(q_motor, q, angle, half_play, sprung or sets_speed) if sprung or play else angle
        q, wiper = angle, carried(wiper, angle, half_slack)
    if sets_speed:
        w = speed
        w_motor = w_motor if play or sprung else speed
    y = Vector(q, w, i, T_w, T_h, q_motor, w_motor)
    mode = Mode(point.mode.zone, point.mode.contact, INSIDE if play else RIGID, point.mode.motor,
                point.mode.share)
    return Point(point.time, y, mode, math.inf, y, point.step, wiper)


def behind(follows: float, before: float, angle: float, half_play: float, together: bool) -> float:
    """Return the angle [rad] of what is behind a gear whose output is put from an angle to another one."""
    return follows + (angle - before) if together else carried(follows, angle, half_play)


def carried(follows: float, angle: float, half_play: float) -> float:
    """Return an angle [rad] that goes along with another one as far as the play between them."""
    return min(max(follows, angle - half_play), angle + half_play)
