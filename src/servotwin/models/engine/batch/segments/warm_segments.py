"""How a servo that warms up slides: leg by leg, each within one straight law of the speed, as in `bands`.

A leg ends with its time, where the speed reaches the end of the law, or before, where its error would be too large.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.batch.rk_steps import SMOOTH, STEEP, State, cooled, way_from_rest
from servotwin.models.engine.batch.segments import linear_segments, piecewise_segments
from servotwin.models.engine.batch.segments.linear_segments import Arc
from servotwin.models.engine.batch.segments.piecewise_segments import Band
from servotwin.models.engine.dynamics import coefficients, currents
from servotwin.models.engine.dynamics.guards import SPEED
from servotwin.models.engine.motions import warm_exponential
from servotwin.models.engine.motions.warm_exponential import Gone
from servotwin.models.terms import friction, heat, load
from servotwin.models.terms.numbers import Numbers, at_temperature
from servotwin.physics.backlash import play

MOST_LEGS = 200  # of a phase
LONGEST = 1.25  # times 1/λ: of a leg, so that the rule finds temperatures to rounding
MARGIN = 6.0  # that an error is less than its estimate times this
NEAR = 1e-3  # times 1/λ: from so near an end on it goes by three terms
UNKNOWN = -1  # zone
_SAME = 1e-14  # of a time
_NEXT_TO_REST = 0.01  # of the speed at the start of a leg


class Slid(NamedTuple):
    """Where a servo has slid: state, angle of the potentiometer, and 1, or 0 where it gave up."""

    state: State
    wiper: float
    done: float


class Landed(NamedTuple):
    """Where a leg has led: state, time [s], whether it met its end; 1, 0 if it is to be shorter, −1: not known."""

    state: State
    time: float
    met: bool
    good: float


def suits(numbers: Numbers) -> bool:
    """Tell whether a servo warms up and all else of its law is straight by pieces of the speed."""
    own = numbers.friction
    return (heat.present(numbers.heat) and load.depends(numbers.load) == 0 and not friction.fades(own)
            and (own.varies == 0.0 or friction.straight(own)))


def tolerance_of(numbers: Numbers, tolerance: float) -> float:
    """Return the error that a leg of a servo may have, of which strides may have `tolerance`."""
    return tolerance * (SMOOTH / STEEP) if numbers.friction.varies > 0.0 else tolerance


def go(numbers: Numbers, torque: float, u: float, zone: int, share: int, state: State, wiper: float, time: float,
       tolerance: float) -> Slid:
    """Return where a servo goes within a time [s], under a voltage behind the bridge and an external torque [N m].

    It begins with this zone of the current and sign of the share; in those of its state where the zone is `UNKNOWN`.
    """
    most = math.inf
    for _ in range(MOST_LEGS):
        if not time > 0.0:
            return Slid(state, wiper, 1.0)
        warm, way = at_temperature(numbers, state.T_w, state.T_h), 0.0
        if state.w == 0.0:
            way = way_from_rest(numbers, u, torque, state)
            if way == 0.0:
                state, done = rested(numbers, warm, torque, u, state, time, tolerance)
                return Slid(state, wiper, done)
        forward = state.w > 0.0 or way > 0.0
        if zone == UNKNOWN:
            zone, share = piecewise_segments.entered(warm, torque, u, forward, state.w)
        band = piecewise_segments.band_at(warm, torque, u, forward, zone, share, state.w)
        to = leg(numbers, warm, band, torque, u, forward, zone, share, state, min(time, most), time, tolerance)
        if to.good <= 0.0:
            most = to.time
            if to.good < 0.0 or not most > _SAME * time:
                return Slid(state, wiper, 0.0)
            continue
        most = math.inf
        state, time = to.state, max(time - to.time, 0.0)
        wiper = play(wiper, state.q, 2.0 * numbers.sensor.half_slack)
        if not numbers.stops.lower < state.q < numbers.stops.upper:
            return Slid(state, wiper, 0.0)
        if to.met:
            zone, share = beyond(band.ends_at, zone, share)
    return Slid(state, wiper, 0.0)


def beyond(ends_at: int, zone: int, share: int) -> tuple[int, int]:
    """Return zone and share behind the end of a leg."""
    return (UNKNOWN, 0) if ends_at == SPEED else piecewise_segments.beyond(ends_at, zone, share)


def leg(numbers: Numbers, warm: Numbers, band: Band, torque: float, u: float, forward: bool, zone: int, share: int,
        state: State, most: float, left: float, tolerance: float) -> Landed:
    """Return where one leg leads, of `most` [s] at most, with so much time left [s]."""
    arc, aim = band.arc, aimed(band.arc, state.w, most)
    x = warm_exponential.law_of(numbers, warm, zone, u, state.T_w, state.T_h, arc.rate, arc.pull, state.w,
                                coefficients.per_ampere(warm, piecewise_segments.mode_of(warm, forward, zone, share)))
    to = warm_exponential.going(x, numbers.heat, aim)
    if not MARGIN * to.error <= tolerance * (1.0 + abs(state.w)):
        return Landed(state, 0.5 * aim, False, 0.0)
    return landed(numbers, band, torque, u, zone, share, state, to, aim, left)


def aimed(arc: Arc, w: float, most: float) -> float:
    """Return the time [s] that a leg is followed for, `most` at most: until its end, if nothing were to warm."""
    ends = abs(arc.edge) < math.inf and arc.pull * arc.pull_there > 0.0
    time, _ = linear_segments.way_to_edge(w, arc.edge if ends else w, arc.pull_there if ends else 1.0, arc.rate,
                                          arc.per_rate)
    aim = min(most, time) if ends else most
    return min(aim, LONGEST * arc.per_rate) if arc.rate > 0.0 else aim


def landed(numbers: Numbers, band: Band, torque: float, u: float, zone: int, share: int, state: State, to: Gone,
           time: float, left: float) -> Landed:
    """Return the state at the end of a leg that has been followed for a time [s], with so much left [s]."""
    arc = band.arc
    after = State(state.q + to.way, to.w, state.T_w + to.warmer, state.T_h + to.housing)
    edge = 0.0
    if band.ends_at != SPEED and abs(arc.edge) < math.inf:
        edge = piecewise_segments.edge_speed(at_temperature(numbers, after.T_w, after.T_h), torque, u, zone, share,
                                             band.ends_at)
    elif band.ends_at != SPEED:
        return Landed(after, time, False, 1.0)
    gap = edge - to.w
    if arc.pull * to.dw <= 0.0:  # it turns back before its end, unless that is next to it
        turns = (gap > 0.0) != (arc.pull > 0.0) or abs(gap) < _NEXT_TO_REST * abs(edge - state.w)
        return Landed(after, time, False, -1.0 if turns else 1.0)
    beyond = gap / to.dw
    on = beyond * (1.0 + 0.5 * arc.rate * beyond)
    near = NEAR * (min(time, arc.per_rate) if arc.rate > 0.0 else time)
    if not abs(on) <= near:
        return Landed(after, time, False, 1.0) if on > 0.0 else Landed(state, time + on, False, 0.0)
    met = time + on <= left
    on = on if met else left - time
    bend = -arc.rate * to.dw
    way = on * (to.w + on * (0.5 * to.dw + on * bend / 6.0))
    w = edge if met else to.w + on * (to.dw + 0.5 * on * bend)
    T_w, T_h = after.T_w + on * to.warms, after.T_h + on * to.housing_warms
    return Landed(State(after.q + way, w, T_w, T_h), time + on, met, 1.0)


def rested(numbers: Numbers, warm: Numbers, torque: float, u: float, state: State, time: float,
           tolerance: float) -> tuple[State, float]:
    """Return the state of a shaft at rest after a time [s], and 1, or 0 where it is not known, as if it may start."""
    zone = currents.zone_of(warm, u, 0.0, 0.0, 0.0, 0.0)
    if u == 0.0:
        T_w, T_h = cooled(numbers, state.T_w, state.T_h, time)
        return State(state.q, 0.0, T_w, T_h), 1.0
    x = warm_exponential.law_of(numbers, warm, zone, u, state.T_w, state.T_h, 0.0, 0.0, 0.0, 0.0)
    to = warm_exponential.going(x, numbers.heat, time)
    after = State(state.q, 0.0, state.T_w + to.warmer, state.T_h + to.housing)
    good = MARGIN * to.error <= tolerance and way_from_rest(numbers, u, torque, after) == 0.0
    return after, 1.0 if good else 0.0


