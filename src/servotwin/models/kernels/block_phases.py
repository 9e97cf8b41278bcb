"""How a block of lanes moves through the phases of a frame.

All lanes take the first leg of a phase together, without branches, so that a compiler can run them in vectors. Those
that stop or reach the edge of the dead zone on the way are listed and go on side by side, the last few one by one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.models.kernels import block_rows as at
from servotwin.models.kernels import legs
from servotwin.models.kernels.elementary import decay, fma
from servotwin.models.kernels.legs import Shaft

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Indices, Numbers


def phases(size: int, keep: bool, s: Numbers, n: Indices) -> None:
    """Move all lanes through the four phases; keep the state at the start of each where it is wanted."""
    if keep:
        _keep(at.Q1, at.W1, size, s)
        for j in range(size):
            s[at.TIME + j] = s[at.TIME1 + j]
            s[at.POWER + j] = s[at.DRIVE1 + j]
        _drive(size, s, n)
        _keep(at.Q2, at.W2, size, s)
        for j in range(size):
            s[at.TIME + j] = s[at.TIME2 + j]
        _idle(size, s, n)
        _keep(at.Q3, at.W3, size, s)
    else:
        _before(size, s, n)
    for j in range(size):
        s[at.TIME + j] = s[at.TIME3 + j]
        s[at.POWER + j] = s[at.DRIVE3 + j]
    _drive(size, s, n)
    if keep:
        _keep(at.Q4, at.W4, size, s)
    for j in range(size):
        s[at.TIME + j] = s[at.TIME4 + j]
    _idle(size, s, n)


def _keep(angle: int, speed: int, size: int, s: Numbers) -> None:
    for j in range(size):
        s[angle + j] = s[at.Q + j]
        s[speed + j] = s[at.W + j]


def _before(size: int, s: Numbers, n: Indices) -> None:
    """Move all lanes to their decision: most have either a drive to finish or a rest before them, so both at once."""
    moving = 0
    both = 0
    for j in range(size):
        drive, rest = s[at.TIME1 + j], s[at.TIME2 + j]
        s[at.TIME + j] = drive if drive > 0.0 else rest
        s[at.POWER + j] = s[at.DRIVE1 + j] if drive > 0.0 else 0.0
        moving += 1 if drive > 0.0 or (rest > 0.0 and legs.moves(at.idle_shaft_at(s, j), 0.0, s[at.W + j])) else 0
        both += 1 if drive > 0.0 and rest > 0.0 else 0
    if moving > 0:
        for j in range(size):
            _begin_leg(at.shaft_at(s, j), s[at.POWER + j], s, j)
        for j in range(size):
            _end_leg(s, j)
        _finish(size, s, n)
    if both > 0:
        for j in range(size):
            s[at.TIME + j] = s[at.TIME2 + j]
            s[at.POWER + j] = 0.0
            s[at.ENDS + j] = 1.0 if s[at.TIME1 + j] > 0.0 and s[at.TIME2 + j] > 0.0 else 0.0
        _later_legs(_list(size, s, n), s, n)


def _drive(size: int, s: Numbers, n: Indices) -> None:
    """Move all lanes through a drive."""
    moving = 0
    for j in range(size):
        moving += 1 if s[at.TIME + j] > 0.0 and s[at.POWER + j] != 0.0 else 0
    if moving > 0:
        _driven_legs(size, s)
        _finish(size, s, n)


def _finish(size: int, s: Numbers, n: Indices) -> None:
    """Take the marked lanes through their further legs."""
    count = _count(at.ENDS, size, s)
    if count > 0:
        _later_legs(_to_edges(count, size, s, n), s, n)


def _driven_legs(size: int, s: Numbers) -> None:
    for j in range(size):
        _begin_leg(at.driven_shaft_at(s, j), s[at.POWER + j], s, j)
    for j in range(size):
        _end_leg(s, j)


def _idle(size: int, s: Numbers, n: Indices) -> None:
    """Move all lanes through a time without drive."""
    moving = 0
    for j in range(size):
        s[at.POWER + j] = 0.0
        start = s[at.SHAFT + 17 * at.BLOCK + j]
        moving += 1 if s[at.TIME + j] > 0.0 and (s[at.W + j] != 0.0 or start != 0.0) else 0
    if moving > 0:
        _idle_legs(size, s)
        _finish(size, s, n)


def _idle_legs(size: int, s: Numbers) -> None:
    for j in range(size):
        _begin_leg(at.idle_shaft_at(s, j), 0.0, s, j)
    for j in range(size):
        _end_leg(s, j)


def _begin_leg(shaft: Shaft, drive: float, s: Numbers, j: int) -> None:
    """Set the leg that a lane is in, and no time where it does not move."""
    w = s[at.W + j]
    leg = legs.leg_of(shaft, drive, w)
    s[at.EDGE_SPEED + j] = leg.edge
    s[at.PULL_THERE + j] = leg.pull_there
    s[at.PULL + j] = leg.pull
    s[at.RATE + j] = leg.rate
    s[at.PER_RATE + j] = leg.per_rate
    s[at.TIME + j] = s[at.TIME + j] if legs.moves(shaft, drive, w) else 0.0


def _end_leg(s: Numbers, j: int) -> None:
    """Move a lane to the end of its time if that lies in one leg; otherwise mark it."""
    time, q, w, rate, per_rate, pull = (
        s[at.TIME + j], s[at.Q + j], s[at.W + j], s[at.RATE + j], s[at.PER_RATE + j], s[at.PULL + j])
    leg = legs.Leg(rate, per_rate, pull, s[at.EDGE_SPEED + j], s[at.PULL_THERE + j])
    once, twice = decay(rate, per_rate, time)
    after = fma(pull, once, w)
    to = fma(pull, twice, fma(w, time, q))
    ends = time > 0.0 and legs.reaches_edge(leg, after)
    goes = time > 0.0 and not ends
    inside = s[at.SHAFT + 18 * at.BLOCK + j] < to < s[at.SHAFT + 19 * at.BLOCK + j]
    s[at.ENDS + j] = 1.0 if ends else 0.0
    s[at.Q + j] = to if goes else q
    s[at.W + j] = after if goes else w
    s[at.LOST + j] = 1.0 if goes and not inside else s[at.LOST + j]


def _count(row: int, size: int, s: Numbers) -> int:
    """Return how many numbers of a row are above zero."""
    count = 0
    for j in range(size):
        count += 1 if s[row + j] > 0.0 else 0
    return count


def _to_edges(count: int, size: int, s: Numbers, n: Indices) -> int:
    """Take the marked lanes to the edge of their leg; list those that go on from there, and return how many."""
    if 4 * count > size:
        for j in range(size):
            t, turn = legs.way_to_edge(
                s[at.W + j], s[at.EDGE_SPEED + j], s[at.PULL_THERE + j], s[at.RATE + j], s[at.PER_RATE + j])
            s[at.D + j] = t
            s[at.E + j] = turn
        for j in range(size):
            _arrive(s[at.D + j], s[at.E + j], s, j)
    else:
        _list(size, s, n)
        for i in range(count):
            j = n[at.WHICH + i]
            s[at.A + i] = s[at.W + j]
            s[at.B + i] = s[at.EDGE_SPEED + j]
            s[at.C + i] = s[at.PULL_THERE + j]
            s[at.D + i] = s[at.RATE + j]
            s[at.E + i] = s[at.PER_RATE + j]
        for i in range(_padded(count)):
            t, turn = legs.way_to_edge(s[at.A + i], s[at.B + i], s[at.C + i], s[at.D + i], s[at.E + i])
            s[at.D + i] = t
            s[at.E + i] = turn
        moving = 0
        for i in range(count):
            j = n[at.WHICH + i]
            _arrive(s[at.D + i], s[at.E + i], s, j)
            n[at.WHICH + moving] = j
            moving += 1 if s[at.ENDS + j] != 0.0 else 0
        return moving
    return _list(size, s, n)


def _padded(count: int) -> int:
    """Return how many lanes go side by side in full vectors; what the last ones hold does not matter."""
    return (count + at.VECTOR - 1) // at.VECTOR * at.VECTOR if count > at.FEW else count


def _arrive(t: float, turn: float, s: Numbers, j: int) -> None:
    """Put a marked lane at the edge of its leg, and leave it marked if it goes on from there."""
    shaft = at.shaft_at(s, j)
    ends = s[at.ENDS + j] != 0.0
    q = s[at.Q + j] + turn if ends else s[at.Q + j]
    w = s[at.EDGE_SPEED + j] if ends else s[at.W + j]
    left = max(s[at.TIME + j] - t, 0.0)
    inside = legs.within_stops(shaft, q)
    goes = ends and inside and left > 0.0 and legs.moves(shaft, s[at.POWER + j], w)
    s[at.Q + j] = q
    s[at.W + j] = w
    s[at.TIME + j] = left
    s[at.LOST + j] = 1.0 if ends and not inside else s[at.LOST + j]
    s[at.ENDS + j] = 1.0 if goes else 0.0


def _list(size: int, s: Numbers, n: Indices) -> int:
    """List the marked lanes, and return how many there are."""
    count = 0
    for j in range(size):
        n[at.WHICH + count] = j
        count += 1 if s[at.ENDS + j] != 0.0 else 0
    return count


def _later_legs(count: int, s: Numbers, n: Indices) -> None:
    """Move the listed lanes to the end of their time: a few one by one, more side by side."""
    if count > at.FEW:
        for i in range(count):
            _gather(n[at.WHICH + i], i, s)
        moving = count
        rounds = 0
        while moving > at.FEW and rounds < legs.MOST_LEGS:
            _next_legs(_padded(count), s)
            moving = _count(at.C, count, s)
            rounds += 1
        for i in range(count):
            j = n[at.WHICH + i]
            s[at.Q + j] = s[at.B + i]
            s[at.W + j] = s[at.A + i]
            s[at.TIME + j] = s[at.C + i]
            s[at.LOST + j] = s[at.E + i]
    for i in range(count):
        j = n[at.WHICH + i]
        if s[at.TIME + j] > 0.0 and s[at.LOST + j] == 0.0:
            q, w, done = legs.slide(at.shaft_at(s, j), s[at.POWER + j], s[at.Q + j], s[at.W + j], s[at.TIME + j])
            s[at.Q + j] = q
            s[at.W + j] = w
            s[at.LOST + j] = s[at.LOST + j] if done > 0.0 else 1.0


def _gather(j: int, i: int, s: Numbers) -> None:
    """Put what the further legs of lane j read into column i."""
    drive = s[at.POWER + j]
    shaft = at.shaft_at(s, j)
    off = drive == 0.0
    s[at.A + i] = s[at.W + j]
    s[at.B + i] = s[at.Q + j]
    s[at.C + i] = s[at.TIME + j]
    s[at.D + i] = drive
    s[at.E + i] = s[at.LOST + j]
    s[at.G + i] = shaft.rate_off if off else shaft.rate_drive
    s[at.G + at.BLOCK + i] = shaft.rate_free
    s[at.G + 2 * at.BLOCK + i] = shaft.per_rate_off if off else shaft.per_rate_drive
    s[at.G + 3 * at.BLOCK + i] = shaft.per_rate_free
    s[at.G + 4 * at.BLOCK + i] = shaft.push
    s[at.G + 5 * at.BLOCK + i] = shaft.drag_off if off else shaft.drag_drive
    s[at.G + 6 * at.BLOCK + i] = shaft.speed
    s[at.G + 7 * at.BLOCK + i] = shaft.gap_off if off else shaft.gap_drive
    s[at.G + 8 * at.BLOCK + i] = shaft.friction_forward
    s[at.G + 9 * at.BLOCK + i] = shaft.friction_backward
    s[at.G + 10 * at.BLOCK + i] = shaft.against
    s[at.G + 11 * at.BLOCK + i] = legs.start_of(shaft, drive)
    s[at.G + 12 * at.BLOCK + i] = shaft.lower
    s[at.G + 13 * at.BLOCK + i] = shaft.upper


def _next_legs(count: int, s: Numbers) -> None:
    """Move the gathered lanes through one more leg; what time they have left stands in its place."""
    for i in range(count):
        shaft = at.gathered_shaft_at(s, i)
        w, q, time, drive, lost = s[at.A + i], s[at.B + i], s[at.C + i], s[at.D + i], s[at.E + i]
        leg = legs.leg_of(shaft, drive, w)
        once, twice = decay(leg.rate, leg.per_rate, time)
        after = fma(leg.pull, once, w)
        ends = legs.reaches_edge(leg, after)
        t, turn = legs.way_to_edge(w, leg.edge, leg.pull_there, leg.rate, leg.per_rate)
        to = q + turn if ends else fma(leg.pull, twice, fma(w, time, q))
        active = time > 0.0 and legs.moves(shaft, drive, w)
        q = to if active else q
        w = (leg.edge if ends else after) if active else w
        left = max(time - t, 0.0) if ends else 0.0
        lost = lost if legs.within_stops(shaft, q) else 1.0
        goes = active and lost == 0.0 and legs.moves(shaft, drive, w)
        s[at.A + i] = w
        s[at.B + i] = q
        s[at.C + i] = left if goes else 0.0
        s[at.E + i] = lost
