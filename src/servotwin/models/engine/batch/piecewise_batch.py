"""How lanes of any law made of bands go through a phase: band by band, all lanes together."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.batch.segments import linear_segments, piecewise_segments
from servotwin.models.engine.dynamics.guards import SPEED
from servotwin.models.engine.motions.elementary import decay, fma
from servotwin.models.terms.numbers import Numbers

_ROUNDS = 3  # that all lanes take together
_ONE_IN = 16  # one lane in so many is cheaper alone than all together


def phase(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive; `slack` where potentiometers have play."""
    for j in range(size):
        _enter(tiles.numbers_at(tile.own, j), tile, plan, j)
    going = 0
    for j in range(size):
        going += 1 if plan.time[j] > 0.0 else 0
    for _ in range(_ROUNDS):
        if going * _ONE_IN > size:
            going = _round(size, slack, tile, plan)
    if going > 0:
        for j in range(size):
            if plan.time[j] > 0.0:
                _go_on(slack, tile, plan, j)


def alone(slack: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    _enter(tiles.numbers_at(tile.own, j), tile, plan, j)
    if plan.time[j] > 0.0:
        _go_on(slack, tile, plan, j)


def _enter(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Find the band that a lane begins in, and take away the time of one that does not move."""
    power, w = plan.power[j], tile.servo.w[j]
    start = linear_segments.start_of(tiles.arc_numbers_at(tile.arc, j), power)
    forward = w > 0.0 or (w == 0.0 and start > 0.0)
    zone, share = piecewise_segments.entered(numbers, tile.hung.torque[j], power * numbers.source.V, forward, w)
    plan.way[j] = 1.0 if forward else -1.0
    plan.start[j] = start
    tile.count.zone[j] = zone
    tile.count.share[j] = share
    plan.time[j] = plan.time[j] if w != 0.0 or start != 0.0 else 0.0


def _round(size: int, slack: bool, tile: Any, plan: Any) -> int:
    """Move all lanes to the end of their band or of their time; return how many have time left."""
    for j in range(size):
        _find(tiles.numbers_at(tile.own, j), tile, plan, j)
    creeping = 0
    for j in range(size):
        creeping += 1 if plan.creeps[j] > 0.0 else 0
    for j in range(size):
        _end_arc(tile, plan, j)
    if creeping > 0:
        for j in range(size):
            if plan.creeps[j] > 0.0:
                _creep(tiles.numbers_at(tile.own, j), tile, plan, j)
    if slack:
        for j in range(size):
            tiles.drag(tile, tile.servo.q[j], j)
    ending = 0
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    if ending == 0:
        return 0
    for j in range(size):
        t, turn = linear_segments.way_to_edge(
            tile.servo.w[j], plan.edge_speed[j], plan.pull_there[j], plan.rate[j], plan.per_rate[j])
        still = plan.creeps[j] > 0.0
        plan.way_time[j] = 0.0 if still else t
        plan.way_angle[j] = 0.0 if still else turn
    for j in range(size):
        _arrive(tile, plan, j)
    if slack:
        for j in range(size):
            tiles.drag(tile, tile.servo.q[j], j)
    going = 0
    for j in range(size):
        going += 1 if plan.time[j] > 0.0 else 0
    return going


def _end_arc(tile: Any, plan: Any, j: int) -> None:
    """Move a lane to the end of its time if that lies in one arc; otherwise mark it."""
    time, q, w, rate, per_rate, pull = (
        plan.time[j], tile.servo.q[j], tile.servo.w[j], plan.rate[j], plan.per_rate[j], plan.pull[j])
    arc = linear_segments.Arc(rate, per_rate, pull, plan.edge_speed[j], plan.pull_there[j])
    once, twice = decay(rate, per_rate, time)
    after = fma(pull, once, w)
    to = fma(pull, twice, fma(w, time, q))
    ends = time > 0.0 and linear_segments.reaches_edge(arc, after)
    goes = time > 0.0 and not ends
    inside = tile.arc.lower[j] < to < tile.arc.upper[j]
    plan.ends[j] = 1.0 if ends else 0.0
    tile.servo.q[j] = to if goes else q
    tile.servo.w[j] = after if goes else w
    plan.lost[j] = 1.0 if goes and not inside else plan.lost[j]


def _find(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Set the arc that a lane is in; one that creeps has no time for it."""
    band = piecewise_segments.band_at(numbers, tile.hung.torque[j], plan.power[j] * numbers.source.V, plan.way[j] > 0.0,
                                      tile.count.zone[j], tile.count.share[j], tile.servo.w[j])
    plan.edge_speed[j] = band.arc.edge
    plan.pull_there[j] = band.arc.pull_there
    plan.pull[j] = band.arc.pull
    plan.rate[j] = band.arc.rate
    plan.per_rate[j] = band.arc.per_rate
    tile.count.ends_at[j] = band.ends_at
    creeps = band.creeps and plan.time[j] > 0.0
    plan.creeps[j] = plan.time[j] if creeps else 0.0
    plan.time[j] = 0.0 if creeps else plan.time[j]


def _creep(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Let a lane creep, and mark it where it has time left: as at the edge of a band."""
    q, w, left, ends_at, done = piecewise_segments.leg(
        numbers, tile.hung.torque[j], plan.power[j] * numbers.source.V, plan.way[j] > 0.0, tile.count.zone[j],
        tile.count.share[j], tile.servo.q[j], tile.servo.w[j], plan.creeps[j], tile.hung.tolerance[j])
    tile.servo.q[j] = q
    tile.servo.w[j] = w
    tile.count.ends_at[j] = ends_at
    plan.edge_speed[j] = w
    plan.time[j] = left
    plan.ends[j] = 1.0 if left > 0.0 else 0.0
    plan.lost[j] = plan.lost[j] if done > 0.0 and tile.arc.lower[j] < q < tile.arc.upper[j] else 1.0


def _arrive(tile: Any, plan: Any, j: int) -> None:
    """Put a marked lane at the edge of its band, with the time that it has left; no other has any."""
    ends, at, start = plan.ends[j] > 0.0, tile.count.ends_at[j], plan.start[j]
    q = tile.servo.q[j] + plan.way_angle[j]
    inside = tile.arc.lower[j] < q < tile.arc.upper[j]
    left = max(plan.time[j] - plan.way_time[j], 0.0)
    stays = at == SPEED and start == 0.0
    zone, share = piecewise_segments.beyond(at, tile.count.zone[j], tile.count.share[j])
    tile.count.zone[j] = zone
    tile.count.share[j] = share
    way = 1.0 if start > 0.0 else -1.0
    plan.way[j] = way if at == SPEED else plan.way[j]
    tile.servo.q[j] = q if ends else tile.servo.q[j]
    tile.servo.w[j] = plan.edge_speed[j] if ends else tile.servo.w[j]
    plan.time[j] = left if ends and inside and not stays else 0.0
    plan.lost[j] = 1.0 if ends and not inside else plan.lost[j]


def _go_on(slack: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane to the end of its time, band by band."""
    q, w, turned, done = piecewise_segments.slide_on(
        tiles.numbers_at(tile.own, j), tile.hung.torque[j], plan.start[j], plan.power[j], plan.way[j] > 0.0,
        tile.count.zone[j], tile.count.share[j], tile.servo.q[j], tile.servo.w[j], plan.time[j],
        tile.hung.tolerance[j])
    tile.servo.q[j] = q
    tile.servo.w[j] = w
    plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0
    if slack:
        tiles.drag(tile, turned, j)
        tiles.drag(tile, q, j)
