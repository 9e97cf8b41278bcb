"""How braked lanes go through a phase: slide, stop, and start again, by one formula without branches.

It serves servos whose bridge brakes and whose brushes drop nothing, so that between drives the current always flows.
While driving it takes for granted that the current flows the way of the drive, and that no stop is near; a lane for
which this does not hold, before or after, is marked and goes through the phase arc by arc.
"""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.batch.segments import linear_segments
from servotwin.models.engine.motions.elementary import fading, fma, log


def drive_or_rest(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive; `slack` where potentiometers have play."""
    for j in range(size):
        _drive_or_rest(tile, plan, j)
    _end(size, slack, tile, plan)


def drive(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a drive; the power of a lane without one is 0 and its time too."""
    for j in range(size):
        numbers, power = tile.arc, plan.power[j]
        forward, backward = numbers.start_forward[j], numbers.start_backward[j]
        start = forward if power > 0.0 else backward
        _move(power, numbers.rate_drive[j], numbers.per_rate_drive[j], start, tile, plan, j)
    _end(size, slack, tile, plan)


def rest(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time without drive."""
    for j in range(size):
        _move(0.0, tile.arc.rate_off[j], tile.arc.per_rate_off[j], tile.arc.start_off[j], tile, plan, j)
    _end(size, slack, tile, plan)


def alone(slack: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    _drive_or_rest(tile, plan, j)
    if plan.ends[j] > 0.0:
        _arc_by_arc(tile, plan, j)
    if slack:
        tiles.drag(tile, plan.turned[j], j)
        tiles.drag(tile, tile.servo.q[j], j)


def _drive_or_rest(tile: Any, plan: Any, j: int) -> None:
    power = plan.power[j]
    off = power == 0.0
    rate, per_rate, rate_off, per_rate_off = (
        tile.arc.rate_drive[j], tile.arc.per_rate_drive[j], tile.arc.rate_off[j], tile.arc.per_rate_off[j])
    forward, backward, start_off = tile.arc.start_forward[j], tile.arc.start_backward[j], tile.arc.start_off[j]
    start = forward if power > 0.0 else backward
    _move(power, rate_off if off else rate, per_rate_off if off else per_rate, start_off if off else start, tile, plan,
          j)


def _move(power: float, rate: float, per_rate: float, start: float, tile: Any, plan: Any, j: int) -> None:
    """Slide to the end, or stop on the way and continue from rest: w + λ (q − q0) − f t is constant while it slides."""
    time, q, w = plan.time[j], tile.servo.q[j], tile.servo.w[j]
    forward, backward = tile.arc.friction_forward[j], tile.arc.friction_backward[j]
    lower, upper = tile.arc.lower[j], tile.arc.upper[j]
    top = tile.arc.speed[j] - tile.arc.gap_drive[j]
    free = fma(power, tile.arc.push[j] - tile.arc.drag_drive[j], -tile.arc.against[j])
    f = free - (forward if w > 0.0 else -backward)
    settled = f * per_rate
    turns = w * settled < 0.0
    until = per_rate * log(1.0 - w / settled if turns else 1.0)
    stops = turns and until <= time
    at_stop = fma(settled, until, fma(w, per_rate, q)) if stops else q
    g = free - (forward if start > 0.0 else -backward)
    rests = stops or w == 0.0
    begin = 0.0 if rests else w
    pull = (g if start != 0.0 else 0.0) if rests else fma(-rate, w, f)
    once, twice = fading(rate, per_rate, time - until if stops else time)
    to = fma(pull, twice, fma(begin, time, at_stop))
    after = fma(pull, once, begin)
    outside = max(at_stop, to) >= upper or min(at_stop, to) <= lower or power * w > top or power * after > top
    good = not outside and to == to
    moves = time > 0.0 and (w != 0.0 or start != 0.0)
    goes = moves and good
    plan.turned[j] = at_stop if goes else q
    tile.servo.q[j] = to if goes else q
    tile.servo.w[j] = after if goes else w
    plan.ends[j] = 1.0 if moves and not good else 0.0


def _end(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move the marked lanes arc by arc, and the potentiometers with all of them."""
    marked = 0
    for j in range(size):
        marked += 1 if plan.ends[j] > 0.0 else 0
    if marked > 0:
        for j in range(size):
            if plan.ends[j] > 0.0:
                _arc_by_arc(tile, plan, j)
    if slack:
        for j in range(size):
            tiles.drag(tile, plan.turned[j], j)
            tiles.drag(tile, tile.servo.q[j], j)


def _arc_by_arc(tile: Any, plan: Any, j: int) -> None:
    numbers = tiles.arc_numbers_at(tile.arc, j)
    q, w, turned, done = linear_segments.slide(numbers, plan.power[j], tile.servo.q[j], tile.servo.w[j], plan.time[j])
    tile.servo.q[j] = q
    tile.servo.w[j] = w
    plan.turned[j] = turned
    plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0
