"""How braked lanes go through a phase: slide, stop, and start again, by one formula without branches.

It serves servos whose bridge brakes and whose brushes drop nothing, so that between drives the current always flows.
While driving it takes for granted that the current flows the way of the drive, and that no stop is near; a lane for
which this does not hold, before or after, is marked and goes through the phase leg by leg.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.models.kernels import block_rows as at
from servotwin.models.kernels import legs
from servotwin.models.kernels.elementary import fading, fma, log

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Numbers


def drive_or_rest(size: int, s: Numbers) -> None:
    """Move all lanes through a time with or without drive."""
    for j in range(size):
        _drive_or_rest(s, j)
    _alone(size, s)


def drive(size: int, s: Numbers) -> None:
    """Move all lanes through a drive; the power of a lane without one is 0 and its time too."""
    for j in range(size):
        power, forward, backward = s[at.POWER + j], s[at.START_FORWARD + j], s[at.START_BACKWARD + j]
        _move(power, s[at.RATE_DRIVE + j], s[at.PER_RATE_DRIVE + j], forward if power > 0.0 else backward, s, j)
    _alone(size, s)


def rest(size: int, s: Numbers) -> None:
    """Move all lanes through a time without drive."""
    for j in range(size):
        _move(0.0, s[at.RATE_OFF + j], s[at.PER_RATE_OFF + j], s[at.START_OFF + j], s, j)
    _alone(size, s)


def alone(s: Numbers, j: int) -> None:
    """Move one lane through a time with or without drive."""
    _drive_or_rest(s, j)
    if s[at.ENDS + j] > 0.0:
        _leg_by_leg(s, j)


def _drive_or_rest(s: Numbers, j: int) -> None:
    power = s[at.POWER + j]
    off = power == 0.0
    rate, per_rate, rate_off, per_rate_off = (
        s[at.RATE_DRIVE + j], s[at.PER_RATE_DRIVE + j], s[at.RATE_OFF + j], s[at.PER_RATE_OFF + j])
    forward, backward, start_off = s[at.START_FORWARD + j], s[at.START_BACKWARD + j], s[at.START_OFF + j]
    start = forward if power > 0.0 else backward
    _move(power, rate_off if off else rate, per_rate_off if off else per_rate, start_off if off else start, s, j)


def _move(power: float, rate: float, per_rate: float, start: float, s: Numbers, j: int) -> None:
    """Slide to the end, or stop on the way and go on from rest: w + λ (q − q0) − f t is constant while it slides."""
    time, q, w = s[at.TIME + j], s[at.Q + j], s[at.W + j]
    forward, backward = s[at.FRICTION_FORWARD + j], s[at.FRICTION_BACKWARD + j]
    lower, upper = s[at.LOWER + j], s[at.UPPER + j]
    top = s[at.SPEED + j] - s[at.GAP_DRIVE + j]
    free = fma(power, s[at.PUSH + j] - s[at.DRAG_DRIVE + j], -s[at.AGAINST + j])
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
    s[at.Q + j] = to if goes else q
    s[at.W + j] = after if goes else w
    s[at.ENDS + j] = 1.0 if moves and not good else 0.0


def _alone(size: int, s: Numbers) -> None:
    """Move the marked lanes leg by leg."""
    marked = 0
    for j in range(size):
        marked += 1 if s[at.ENDS + j] > 0.0 else 0
    if marked > 0:
        for j in range(size):
            if s[at.ENDS + j] > 0.0:
                _leg_by_leg(s, j)


def _leg_by_leg(s: Numbers, j: int) -> None:
    q, w, done = legs.slide(at.shaft_at(s, j), s[at.POWER + j], s[at.Q + j], s[at.W + j], s[at.TIME + j])
    s[at.Q + j] = q
    s[at.W + j] = w
    s[at.LOST + j] = s[at.LOST + j] if done > 0.0 else 1.0
