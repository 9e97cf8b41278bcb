"""How lanes whose current may stop go through a phase: arc by arc, all lanes together.

Most are done after one arc or two; the few that have more before them go on lane by lane.
"""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import linear_segments, tiles
from servotwin.models.engine.batch.linear_segments import ArcNumbers
from servotwin.models.engine.motions.elementary import decay, fma

_ONE_IN = 16  # one lane in so many is cheaper alone than all together


def drive_or_rest(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive."""
    for j in range(size):
        _begin_arc(tiles.arc_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
    if _end_arcs(size, tile, plan) > 0:
        for j in range(size):
            _begin_arc(tiles.arc_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
        _end_last_arcs(size, tile, plan)


def drive(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes through a drive; the power of a lane without one is 0 and its time too."""
    for j in range(size):
        _begin_arc(tiles.driven_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
    if _end_arcs(size, tile, plan) > 0:
        for j in range(size):
            _begin_arc(tiles.driven_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
        _end_last_arcs(size, tile, plan)


def rest(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes through a time without drive."""
    for j in range(size):
        _begin_arc(tiles.idle_numbers_at(tile.arc, j), 0.0, tile, plan, j)
    if _end_arcs(size, tile, plan) > 0:
        for j in range(size):
            _begin_arc(tiles.idle_numbers_at(tile.arc, j), 0.0, tile, plan, j)
        _end_last_arcs(size, tile, plan)


def alone(tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    numbers = tiles.arc_numbers_at(tile.arc, j)
    q, w, _, done = linear_segments.slide(numbers, plan.power[j], tile.servo.q[j], tile.servo.w[j], plan.time[j])
    tile.servo.q[j] = q
    tile.servo.w[j] = w
    plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0


def _begin_arc(numbers: ArcNumbers, drive: float, tile: Any, plan: Any, j: int) -> None:
    """Set the arc that a lane is in, and no time where it does not move."""
    w = tile.servo.w[j]
    arc = linear_segments.arc_of(numbers, drive, w)
    plan.edge_speed[j] = arc.edge
    plan.pull_there[j] = arc.pull_there
    plan.pull[j] = arc.pull
    plan.rate[j] = arc.rate
    plan.per_rate[j] = arc.per_rate
    plan.time[j] = plan.time[j] if linear_segments.moves(numbers, drive, w) else 0.0


def _end_arcs(size: int, tile: Any, plan: Any) -> int:
    """Move all lanes to the end of their arc; return how many have another arc before them."""
    ending = 0
    for j in range(size):
        end_arc(tile, plan, j)
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    if ending == 0:
        return 0
    for j in range(size):
        t, turn = linear_segments.way_to_edge(
            tile.servo.w[j], plan.edge_speed[j], plan.pull_there[j], plan.rate[j], plan.per_rate[j])
        plan.way_time[j] = t
        plan.way_angle[j] = turn
    for j in range(size):
        _arrive(tiles.arc_numbers_at(tile.arc, j), tile, plan, j)
    going = 0
    for j in range(size):
        going += 1 if plan.time[j] > 0.0 else 0
    if going * _ONE_IN > size:
        return going
    if going > 0:
        for j in range(size):
            if plan.time[j] > 0.0:
                alone(tile, plan, j)
    return 0


def _end_last_arcs(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes to the end of their second arc; those with a third go on alone."""
    ending = 0
    for j in range(size):
        end_arc(tile, plan, j)
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    if ending > 0:
        for j in range(size):
            if plan.ends[j] > 0.0:
                alone(tile, plan, j)


def end_arc(tile: Any, plan: Any, j: int) -> None:
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


def _arrive(numbers: ArcNumbers, tile: Any, plan: Any, j: int) -> None:
    """Put a marked lane at the edge of its arc, with the time that it has left; no other has any."""
    ends = plan.ends[j] > 0.0
    q = tile.servo.q[j] + plan.way_angle[j]
    inside = linear_segments.within_stops(numbers, q)
    left = max(plan.time[j] - plan.way_time[j], 0.0)
    edge = plan.edge_speed[j]
    goes = ends and inside and linear_segments.moves(numbers, plan.power[j], edge)
    tile.servo.q[j] = q if ends else tile.servo.q[j]
    tile.servo.w[j] = edge if ends else tile.servo.w[j]
    plan.time[j] = left if goes else 0.0
    plan.lost[j] = 1.0 if ends and not inside else plan.lost[j]
