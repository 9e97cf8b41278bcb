"""How a block of lanes moves through the phases of a frame.

All lanes take the first leg of a phase together, without branches, so that a compiler can run them in vectors; so do
those that stop, or reach the edge of the dead zone, with what follows. A third leg is rare and goes lane by lane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.models.kernels import block_braked, legs
from servotwin.models.kernels import block_rows as at
from servotwin.models.kernels.elementary import decay, fma
from servotwin.models.kernels.legs import Shaft

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Indices, Numbers

_ONE_IN = 16  # one lane in so many is cheaper alone than all together


def phases(size: int, keep: bool, braked: bool, s: Numbers, n: Indices) -> None:
    """Move all lanes through the four phases; keep the state at the start of each where it is wanted."""
    if size <= at.FEW:
        for j in range(size):
            _lane(keep, braked, s, j)
        return
    if keep:
        _keep(at.Q1, at.W1, size, s)
        for j in range(size):
            s[at.TIME + j] = s[at.TIME1 + j]
            s[at.POWER + j] = s[at.DRIVE1 + j]
        _drive(size, braked, s)
        _keep(at.Q2, at.W2, size, s)
        for j in range(size):
            s[at.TIME + j] = s[at.TIME2 + j]
        _idle(size, braked, s)
        _keep(at.Q3, at.W3, size, s)
    else:
        _before(size, braked, s, n)
    for j in range(size):
        s[at.TIME + j] = s[at.TIME3 + j]
        s[at.POWER + j] = s[at.DRIVE3 + j]
    _drive(size, braked, s)
    if keep:
        _keep(at.Q4, at.W4, size, s)
    for j in range(size):
        s[at.TIME + j] = s[at.TIME4 + j]
    _idle(size, braked, s)


def _lane(keep: bool, braked: bool, s: Numbers, j: int) -> None:
    """Move one lane through the four phases, for blocks that are too small to go side by side."""
    for phase in range(4):
        if keep:
            s[at.Q1 + 2 * phase * at.BLOCK + j] = s[at.Q + j]
            s[at.W1 + 2 * phase * at.BLOCK + j] = s[at.W + j]
        time = s[at.TIME1 + phase * at.BLOCK + j]
        if time > 0.0:
            power = s[at.DRIVE1 + j] if phase == 0 else s[at.DRIVE3 + j]
            power = power if phase % 2 == 0 else 0.0
            w, start = s[at.W + j], s[at.START_OFF + j]
            if w != 0.0 or start != 0.0 or power != 0.0:
                s[at.TIME + j] = time
                s[at.POWER + j] = power
                _alone(braked, s, j)


def _alone(braked: bool, s: Numbers, j: int) -> None:
    """Move one lane through one phase."""
    if braked:
        block_braked.alone(s, j)
    else:
        _slide(s[at.POWER + j], s[at.TIME + j], s, j)


def _keep(angle: int, speed: int, size: int, s: Numbers) -> None:
    for j in range(size):
        s[angle + j] = s[at.Q + j]
        s[speed + j] = s[at.W + j]


def _before(size: int, braked: bool, s: Numbers, n: Indices) -> None:
    """Move all lanes to their decision: most have either a drive to finish or a rest before them, so both at once."""
    moving = 0
    both = 0
    for j in range(size):
        drive, rest, power = s[at.TIME1 + j], s[at.TIME2 + j], s[at.DRIVE1 + j]
        w, start = s[at.W + j], s[at.START_OFF + j]
        s[at.TIME + j] = drive if drive > 0.0 else rest
        s[at.POWER + j] = power if drive > 0.0 else 0.0
        moving += 1 if drive > 0.0 or (rest > 0.0 and (w != 0.0 or start != 0.0)) else 0
        both += 1 if min(drive, rest) > 0.0 else 0
    if moving > 0 and braked:
        block_braked.drive_or_rest(size, s)
    elif moving > 0:
        for j in range(size):
            _begin_leg(at.shaft_at(s, j), s[at.POWER + j], s, j)
        if _end_legs(size, s) > 0:
            for j in range(size):
                _begin_leg(at.shaft_at(s, j), s[at.POWER + j], s, j)
            _end_last_legs(size, s)
    if both > 0:
        both = 0
        for j in range(size):
            n[at.WHICH + both] = j
            drive, rest = s[at.TIME1 + j], s[at.TIME2 + j]
            both += 1 if min(drive, rest) > 0.0 else 0
        for k in range(both):
            j = n[at.WHICH + k]
            s[at.TIME + j] = s[at.TIME2 + j]
            s[at.POWER + j] = 0.0
            _alone(braked, s, j)


def _drive(size: int, braked: bool, s: Numbers) -> None:
    """Move all lanes through a drive."""
    moving = 0
    for j in range(size):
        time, power = s[at.TIME + j], s[at.POWER + j]
        moving += 1 if time > 0.0 and power != 0.0 else 0
    if moving > 0 and braked:
        block_braked.drive(size, s)
    elif moving > 0:
        for j in range(size):
            _begin_leg(at.driven_shaft_at(s, j), s[at.POWER + j], s, j)
        if _end_legs(size, s) > 0:
            for j in range(size):
                _begin_leg(at.driven_shaft_at(s, j), s[at.POWER + j], s, j)
            _end_last_legs(size, s)


def _idle(size: int, braked: bool, s: Numbers) -> None:
    """Move all lanes through a time without drive."""
    moving = 0
    for j in range(size):
        s[at.POWER + j] = 0.0
        time, w, start = s[at.TIME + j], s[at.W + j], s[at.START_OFF + j]
        moving += 1 if time > 0.0 and (w != 0.0 or start != 0.0) else 0
    if moving > 0 and braked:
        block_braked.rest(size, s)
    elif moving > 0:
        for j in range(size):
            _begin_leg(at.idle_shaft_at(s, j), 0.0, s, j)
        if _end_legs(size, s) > 0:
            for j in range(size):
                _begin_leg(at.idle_shaft_at(s, j), 0.0, s, j)
            _end_last_legs(size, s)


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


def _end_legs(size: int, s: Numbers) -> int:
    """Move all lanes to the end of their leg; return how many have another leg before them."""
    ending = 0
    for j in range(size):
        _end_leg(s, j)
    for j in range(size):
        ending += 1 if s[at.ENDS + j] > 0.0 else 0
    if ending == 0:
        return 0
    for j in range(size):
        t, turn = legs.way_to_edge(
            s[at.W + j], s[at.EDGE_SPEED + j], s[at.PULL_THERE + j], s[at.RATE + j], s[at.PER_RATE + j])
        s[at.WAY_TIME + j] = t
        s[at.WAY_ANGLE + j] = turn
    for j in range(size):
        _arrive(at.shaft_at(s, j), s, j)
    going = 0
    for j in range(size):
        going += 1 if s[at.TIME + j] > 0.0 else 0
    if going * _ONE_IN > size:
        return going
    if going > 0:
        for j in range(size):
            if s[at.TIME + j] > 0.0:
                _slide(s[at.POWER + j], s[at.TIME + j], s, j)
    return 0


def _end_last_legs(size: int, s: Numbers) -> None:
    """Move all lanes to the end of their second leg; those with a third go on alone."""
    ending = 0
    for j in range(size):
        _end_leg(s, j)
    for j in range(size):
        ending += 1 if s[at.ENDS + j] > 0.0 else 0
    if ending > 0:
        for j in range(size):
            if s[at.ENDS + j] > 0.0:
                _slide(s[at.POWER + j], s[at.TIME + j], s, j)


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
    inside = s[at.LOWER + j] < to < s[at.UPPER + j]
    s[at.ENDS + j] = 1.0 if ends else 0.0
    s[at.Q + j] = to if goes else q
    s[at.W + j] = after if goes else w
    s[at.LOST + j] = 1.0 if goes and not inside else s[at.LOST + j]


def _arrive(shaft: Shaft, s: Numbers, j: int) -> None:
    """Put a marked lane at the edge of its leg, with the time that it has left; no other has any."""
    ends = s[at.ENDS + j] > 0.0
    q = s[at.Q + j] + s[at.WAY_ANGLE + j]
    inside = legs.within_stops(shaft, q)
    left = max(s[at.TIME + j] - s[at.WAY_TIME + j], 0.0)
    edge = s[at.EDGE_SPEED + j]
    goes = ends and inside and legs.moves(shaft, s[at.POWER + j], edge)
    s[at.Q + j] = q if ends else s[at.Q + j]
    s[at.W + j] = edge if ends else s[at.W + j]
    s[at.TIME + j] = left if goes else 0.0
    s[at.LOST + j] = 1.0 if ends and not inside else s[at.LOST + j]


def _slide(drive: float, time: float, s: Numbers, j: int) -> None:
    """Move one lane through a time under one drive, in as many legs as it takes."""
    q, w, done = legs.slide(at.shaft_at(s, j), drive, s[at.Q + j], s[at.W + j], time)
    s[at.Q + j] = q
    s[at.W + j] = w
    s[at.LOST + j] = s[at.LOST + j] if done > 0.0 else 1.0
