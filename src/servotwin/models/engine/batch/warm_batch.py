"""How lanes that warm up go through a phase: the first leg all together, those with more before them alone."""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.batch import rk_steps, tiles
from servotwin.models.engine.batch.rk_steps import State
from servotwin.models.engine.batch.segments import piecewise_segments, warm_segments
from servotwin.models.engine.batch.segments.linear_segments import Arc
from servotwin.models.engine.batch.segments.piecewise_segments import Band
from servotwin.models.engine.dynamics import coefficients
from servotwin.models.engine.motions import warm_exponential
from servotwin.models.engine.motions.warm_exponential import Gone, Law
from servotwin.models.state.records import reader, writer
from servotwin.models.terms.numbers import Numbers, at_temperature

law_at = reader("law_at", Law)
put_law = writer("put_law", Law)
gone_at = reader("gone_at", Gone)
put_gone = writer("put_gone", Gone)


def first_leg(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes that can go by legs through the first one, and take away the time that it takes."""
    for j in range(size):
        _begin(tiles.numbers_at(tile.own, j), tile, plan, j)
    for j in range(size):
        put_gone(plan.gone, j, warm_exponential.going(law_at(plan.law, j), tiles.numbers_at(tile.own, j).heat,
                                                      plan.way_time[j]))
    for j in range(size):
        _land(tiles.numbers_at(tile.own, j), tile, plan, j)


def _begin(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Set law and length of the first leg of a lane; one that has to go in another way has none."""
    state, torque, u, time = _state(tile, j), tile.hung.torque[j], plan.power[j] * numbers.source.V, plan.time[j]
    warm = at_temperature(numbers, state.T_w, state.T_h)
    start = rk_steps.way_from_rest(numbers, u, torque, state)
    forward = state.w > 0.0 or (state.w == 0.0 and start > 0.0)
    zone, share = piecewise_segments.entered(warm, torque, u, forward, state.w)
    band = piecewise_segments.band_at(warm, torque, u, forward, zone, share, state.w)
    moves = state.w != 0.0 or start != 0.0
    put_law(plan.law, j, warm_exponential.law_of(
        numbers, warm, zone, u, state.T_w, state.T_h, band.arc.rate, band.arc.pull, state.w,
        coefficients.per_ampere(warm, piecewise_segments.mode_of(warm, forward, zone, share))))
    plan.rate[j], plan.per_rate[j], plan.pull[j] = band.arc.rate, band.arc.per_rate, band.arc.pull
    plan.edge_speed[j], plan.pull_there[j] = band.arc.edge, band.arc.pull_there
    tile.count.zone[j], tile.count.share[j], tile.count.ends_at[j] = zone, share, band.ends_at
    aim = warm_segments.aimed(band.arc, state.w, time)
    plan.way_time[j] = aim if time > 0.0 and moves and not band.creeps and warm_segments.suits(numbers) else 0.0


def _land(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Put a lane to the end of its first leg, if that has gone well."""
    state, to, aim, time = _state(tile, j), gone_at(plan.gone, j), plan.way_time[j], plan.time[j]
    arc = Arc(plan.rate[j], plan.per_rate[j], plan.pull[j], plan.edge_speed[j], plan.pull_there[j])
    end = warm_segments.landed(numbers, Band(arc, tile.count.ends_at[j], False), tile.hung.torque[j],
                               plan.power[j] * numbers.source.V, tile.count.zone[j], tile.count.share[j], state, to,
                               aim,
                               time)
    tolerance = warm_segments.tolerance_of(numbers, tile.hung.tolerance[j])
    near = warm_segments.MARGIN * to.error <= tolerance * (1.0 + abs(state.w))
    after = end.state
    inside = numbers.stops.lower < after.q < numbers.stops.upper
    taken = aim > 0.0 and near and end.good > 0.0 and inside and math.isfinite(after.w)
    tile.servo.q[j] = after.q if taken else state.q
    tile.servo.w[j] = after.w if taken else state.w
    tile.servo.T_w[j] = after.T_w if taken else state.T_w
    tile.servo.T_h[j] = after.T_h if taken else state.T_h
    plan.time[j] = max(time - end.time, 0.0) if taken else time
    zone, share = tile.count.zone[j], tile.count.share[j]
    next_zone, next_share = warm_segments.beyond(tile.count.ends_at[j], zone, share)
    tile.count.zone[j] = warm_segments.UNKNOWN if not taken else next_zone if end.met else zone
    tile.count.share[j] = next_share if end.met else share


def _state(tile: Any, j: int) -> State:
    return State(tile.servo.q[j], tile.servo.w[j], tile.servo.T_w[j], tile.servo.T_h[j])
