"""How a tile of lanes moves through the phases of a window.

All lanes take the first arc of a phase together, without branches, so that a compiler can run them in vectors; so do
those that stop, or reach the edge of the dead zone, with what follows. A third arc is rare and goes lane by lane.
"""

from __future__ import annotations

from typing import Any

from servotwin.models.engine import arcs, tiles
from servotwin.models.engine import braked as one_formula
from servotwin.models.engine.arcs import ArcNumbers
from servotwin.models.engine.elementary import decay, fma

_ONE_IN = 16  # one lane in so many is cheaper alone than all together


def phases(size: int, keep: bool, braked: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through the four phases; keep the state at the start of each where it is wanted."""
    if size <= tiles.FEW:
        for j in range(size):
            _lane(keep, braked, tile, plan, j)
        return
    if keep:
        _keep(plan.q1, plan.w1, size, tile)
        for j in range(size):
            plan.time[j] = plan.time1[j]
            plan.power[j] = plan.drive1[j]
        _drive(size, braked, tile, plan)
        _keep(plan.q2, plan.w2, size, tile)
        for j in range(size):
            plan.time[j] = plan.time2[j]
        _idle(size, braked, tile, plan)
        _keep(plan.q3, plan.w3, size, tile)
    else:
        _before(size, braked, tile, plan)
    for j in range(size):
        plan.time[j] = plan.time3[j]
        plan.power[j] = plan.drive3[j]
    _drive(size, braked, tile, plan)
    if keep:
        _keep(plan.q4, plan.w4, size, tile)
    for j in range(size):
        plan.time[j] = plan.time4[j]
    _idle(size, braked, tile, plan)


def _lane(keep: bool, braked: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through the four phases, for tiles that are too small to go side by side."""
    for phase in range(4):
        q, w, start = tile.servo.q[j], tile.servo.w[j], tile.arc.start_off[j]
        time = plan.time1[j] if phase == 0 else plan.time2[j] if phase == 1 else plan.time3[j]
        power = plan.drive1[j] if phase == 0 else plan.drive3[j] if phase == 2 else 0.0
        time = time if phase < 3 else plan.time4[j]
        if keep:
            _keep_one(phase, q, w, plan, j)
        if time > 0.0 and (w != 0.0 or start != 0.0 or power != 0.0):
            plan.time[j] = time
            plan.power[j] = power
            _alone(braked, tile, plan, j)


def _keep_one(phase: int, q: float, w: float, plan: Any, j: int) -> None:
    if phase == 0:
        plan.q1[j] = q
        plan.w1[j] = w
    elif phase == 1:
        plan.q2[j] = q
        plan.w2[j] = w
    elif phase == 2:
        plan.q3[j] = q
        plan.w3[j] = w
    else:
        plan.q4[j] = q
        plan.w4[j] = w


def _alone(braked: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through one phase."""
    if braked:
        one_formula.alone(tile, plan, j)
    else:
        _slide(plan.power[j], plan.time[j], tile, plan, j)


def _keep(angle: Any, speed: Any, size: int, tile: Any) -> None:
    for j in range(size):
        angle[j] = tile.servo.q[j]
        speed[j] = tile.servo.w[j]


def _before(size: int, braked: bool, tile: Any, plan: Any) -> None:
    """Move all lanes to their decision: most have either a drive to finish or a rest before them, so both at once."""
    moving = 0
    both = 0
    for j in range(size):
        drive, rest, power = plan.time1[j], plan.time2[j], plan.drive1[j]
        w, start = tile.servo.w[j], tile.arc.start_off[j]
        plan.time[j] = drive if drive > 0.0 else rest
        plan.power[j] = power if drive > 0.0 else 0.0
        moving += 1 if drive > 0.0 or (rest > 0.0 and (w != 0.0 or start != 0.0)) else 0
        both += 1 if min(drive, rest) > 0.0 else 0
    if moving > 0 and braked:
        one_formula.drive_or_rest(size, tile, plan)
    elif moving > 0:
        for j in range(size):
            _begin_arc(tiles.arc_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
        if _end_arcs(size, tile, plan) > 0:
            for j in range(size):
                _begin_arc(tiles.arc_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
            _end_last_arcs(size, tile, plan)
    if both > 0:
        both = 0
        for j in range(size):
            tile.count.which[both] = j
            drive, rest = plan.time1[j], plan.time2[j]
            both += 1 if min(drive, rest) > 0.0 else 0
        for k in range(both):
            j = tile.count.which[k]
            plan.time[j] = plan.time2[j]
            plan.power[j] = 0.0
            _alone(braked, tile, plan, j)


def _drive(size: int, braked: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a drive."""
    moving = 0
    for j in range(size):
        time, power = plan.time[j], plan.power[j]
        moving += 1 if time > 0.0 and power != 0.0 else 0
    if moving > 0 and braked:
        one_formula.drive(size, tile, plan)
    elif moving > 0:
        for j in range(size):
            _begin_arc(tiles.driven_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
        if _end_arcs(size, tile, plan) > 0:
            for j in range(size):
                _begin_arc(tiles.driven_numbers_at(tile.arc, j), plan.power[j], tile, plan, j)
            _end_last_arcs(size, tile, plan)


def _idle(size: int, braked: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time without drive."""
    moving = 0
    for j in range(size):
        plan.power[j] = 0.0
        time, w, start = plan.time[j], tile.servo.w[j], tile.arc.start_off[j]
        moving += 1 if time > 0.0 and (w != 0.0 or start != 0.0) else 0
    if moving > 0 and braked:
        one_formula.rest(size, tile, plan)
    elif moving > 0:
        for j in range(size):
            _begin_arc(tiles.idle_numbers_at(tile.arc, j), 0.0, tile, plan, j)
        if _end_arcs(size, tile, plan) > 0:
            for j in range(size):
                _begin_arc(tiles.idle_numbers_at(tile.arc, j), 0.0, tile, plan, j)
            _end_last_arcs(size, tile, plan)


def _begin_arc(numbers: ArcNumbers, drive: float, tile: Any, plan: Any, j: int) -> None:
    """Set the arc that a lane is in, and no time where it does not move."""
    w = tile.servo.w[j]
    arc = arcs.arc_of(numbers, drive, w)
    plan.edge_speed[j] = arc.edge
    plan.pull_there[j] = arc.pull_there
    plan.pull[j] = arc.pull
    plan.rate[j] = arc.rate
    plan.per_rate[j] = arc.per_rate
    plan.time[j] = plan.time[j] if arcs.moves(numbers, drive, w) else 0.0


def _end_arcs(size: int, tile: Any, plan: Any) -> int:
    """Move all lanes to the end of their arc; return how many have another arc before them."""
    ending = 0
    for j in range(size):
        _end_arc(tile, plan, j)
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    if ending == 0:
        return 0
    for j in range(size):
        t, turn = arcs.way_to_edge(
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
                _slide(plan.power[j], plan.time[j], tile, plan, j)
    return 0


def _end_last_arcs(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes to the end of their second arc; those with a third go on alone."""
    ending = 0
    for j in range(size):
        _end_arc(tile, plan, j)
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    if ending > 0:
        for j in range(size):
            if plan.ends[j] > 0.0:
                _slide(plan.power[j], plan.time[j], tile, plan, j)


def _end_arc(tile: Any, plan: Any, j: int) -> None:
    """Move a lane to the end of its time if that lies in one arc; otherwise mark it."""
    time, q, w, rate, per_rate, pull = (
        plan.time[j], tile.servo.q[j], tile.servo.w[j], plan.rate[j], plan.per_rate[j], plan.pull[j])
    arc = arcs.Arc(rate, per_rate, pull, plan.edge_speed[j], plan.pull_there[j])
    once, twice = decay(rate, per_rate, time)
    after = fma(pull, once, w)
    to = fma(pull, twice, fma(w, time, q))
    ends = time > 0.0 and arcs.reaches_edge(arc, after)
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
    inside = arcs.within_stops(numbers, q)
    left = max(plan.time[j] - plan.way_time[j], 0.0)
    edge = plan.edge_speed[j]
    goes = ends and inside and arcs.moves(numbers, plan.power[j], edge)
    tile.servo.q[j] = q if ends else tile.servo.q[j]
    tile.servo.w[j] = edge if ends else tile.servo.w[j]
    plan.time[j] = left if goes else 0.0
    plan.lost[j] = 1.0 if ends and not inside else plan.lost[j]


def _slide(drive: float, time: float, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time under one drive, in as many arcs as it takes."""
    q, w, done = arcs.slide(tiles.arc_numbers_at(tile.arc, j), drive, tile.servo.q[j], tile.servo.w[j], time)
    tile.servo.q[j] = q
    tile.servo.w[j] = w
    plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0
