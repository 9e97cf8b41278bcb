"""How lanes that have to be integrated go through a phase: stride by stride, so many together as there are slots.

A lane that is through makes room for the next one. A lane depends on itself alone: it takes the same strides
whoever its neighbours are.
"""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import rk_steps, tiles, warm_batch
from servotwin.models.engine.batch.rk_steps import (
    NOBODY,
    SLOTS,
    State,
    before_in,
    mode_in,
    numbers_in,
    put_before_in,
    put_numbers_in,
    step,
)
from servotwin.models.engine.batch.segments import warm_segments
from servotwin.models.engine.batch.tiles import More
from servotwin.models.engine.events import crossings
from servotwin.models.terms import heat
from servotwin.models.terms.friction import fades
from servotwin.models.terms.numbers import Numbers

_SHORTEST = 1e-15  # s: time that is none any more
CALLED = ("alone", "_alone_by_legs")  # one lane: with copies its strides take twice as long to compile


def phase(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive; `slack` where potentiometers have play."""
    for j in range(size):
        _look(tiles.numbers_at(tile.own, j), tile, plan, j)
    for j in range(size):
        _cool(tiles.numbers_at(tile.own, j), tile, plan, j)
    _by_legs(size, slack, tile, plan)
    waiting = 0
    for j in range(size):
        tile.count.which[waiting] = j
        waiting += 1 if plan.time[j] > 0.0 else 0
    if waiting > 0:
        _run(waiting, slack, tile, plan)


def alone(slack: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    numbers = tiles.numbers_at(tile.own, j)
    _look(numbers, tile, plan, j)
    _cool(numbers, tile, plan, j)
    if plan.time[j] > 0.0:
        _alone_by_legs(numbers, warm_segments.UNKNOWN, tile, plan, j)
    if plan.time[j] > 0.0:
        tile.count.which[0] = j
        _run(1, slack, tile, plan)


def seen(slack: bool, power: float, time: float, q: float, w: float, wiper: float, more: More, tile: Any, plan: Any,
         j: int) -> tuple[State, float, float]:
    """Return the state, and the angle of the potentiometer, so much time [s] after a lane has been there and so.

    The third is 1, or 0 where they cannot be determined.
    """
    servo, after, q_after, w_after = tile.servo, tiles.more_at(tile.servo, j), tile.servo.q[j], tile.servo.w[j]
    wiper_after, lost = servo.wiper[j], plan.lost[j]
    servo.q[j], servo.w[j], servo.wiper[j] = q, w, wiper
    tiles.put_more(servo, j, more)
    plan.time[j], plan.power[j] = time, power
    if time > 0.0:
        alone(slack, tile, plan, j)
    state, wiper = _state(tile, j), servo.wiper[j]
    done = 1.0 if plan.lost[j] == lost else 0.0
    servo.q[j], servo.w[j], servo.wiper[j], plan.lost[j] = q_after, w_after, wiper_after, lost
    tiles.put_more(servo, j, after)
    return state, wiper, done


def _look(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Find which way a lane starts from rest: one that stands still, and is not heated, has nothing but to cool."""
    u, w = plan.power[j] * numbers.source.V, tile.servo.w[j]
    start = rk_steps.way_from_rest(numbers, u, tile.hung.torque[j], _state(tile, j))
    plan.ends[j] = 1.0 if w == 0.0 and start == 0.0 and (u == 0.0 or not heat.present(numbers.heat)) else 0.0


def _cool(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Let a lane that rests go through its time."""
    rests, time, T_w, T_h = plan.ends[j] > 0.0, plan.time[j], tile.servo.T_w[j], tile.servo.T_h[j]
    cool_w, cool_h = rk_steps.cooled(numbers, T_w, T_h, max(time, 0.0))
    tile.servo.T_w[j] = cool_w if rests else T_w
    tile.servo.T_h[j] = cool_h if rests else T_h
    plan.time[j] = 0.0 if rests else time


def _by_legs(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Let all lanes go through their time by legs whose legs tell it."""
    going = 0
    for j in range(size):
        going += 1 if plan.time[j] > 0.0 and warm_segments.suits(tiles.numbers_at(tile.own, j)) else 0
    if going == 0:
        return
    warm_batch.first_leg(size, tile, plan)
    if slack:
        for j in range(size):
            tiles.drag(tile, tile.servo.q[j], j)
    for j in range(size):
        _look(tiles.numbers_at(tile.own, j), tile, plan, j)
    for j in range(size):
        _cool(tiles.numbers_at(tile.own, j), tile, plan, j)
    for j in range(size):
        if plan.time[j] > 0.0:
            _alone_by_legs(tiles.numbers_at(tile.own, j), tile.count.zone[j], tile, plan, j)


def _alone_by_legs(numbers: Numbers, zone: int, tile: Any, plan: Any, j: int) -> None:
    """Let a lane go through its time by legs, where these tell it."""
    if not warm_segments.suits(numbers):
        return
    servo = tile.servo
    to = warm_segments.go(numbers, tile.hung.torque[j], plan.power[j] * numbers.source.V, zone, tile.count.share[j],
                          _state(tile, j), servo.wiper[j], plan.time[j],
                          warm_segments.tolerance_of(numbers, tile.hung.tolerance[j]))
    if to.done > 0.0:
        servo.q[j], servo.w[j], servo.T_w[j], servo.T_h[j] = to.state.q, to.state.w, to.state.T_w, to.state.T_h
        servo.wiper[j] = to.wiper
        plan.time[j] = 0.0


def _run(waiting: int, slack: bool, tile: Any, plan: Any) -> None:
    """Let the lanes of a list pass through the slots."""
    slots = plan.slots
    following = busy = 0
    for k in range(SLOTS):
        if following < waiting:
            _enter(tile, plan, slots, k, tile.count.which[following])
            following += 1
            busy += 1
        else:
            _idle(slots, k)
    while busy > 0:
        step(slots)
        for k in range(SLOTS):
            if slots.busy.lane[k] != NOBODY and not _goes_on(slack, tile, plan, slots, k):
                if following < waiting:
                    _enter(tile, plan, slots, k, tile.count.which[following])
                    following += 1
                else:
                    slots.busy.lane[k] = NOBODY
                    busy -= 1


def _enter(tile: Any, plan: Any, slots: Any, k: int, j: int) -> None:
    """Put a lane into a slot."""
    numbers, state, stride = tiles.numbers_at(tile.own, j), _state(tile, j), slots.stride
    put_numbers_in(slots.own, k, numbers)
    put_before_in(slots.before, k, state)
    stride.u[k], stride.tau[k] = plan.power[j] * numbers.source.V, tile.hung.torque[j]
    stride.left[k], stride.length[k], stride.tolerance[k] = plan.time[j], tile.servo.step[j], tile.hung.tolerance[j]
    stride.reach[k], stride.origin[k], stride.rise[k] = 0.0, 0.0, 0.0
    stride.span[k], stride.curved[k] = rk_steps.first_span(numbers), 1.0 if fades(numbers.friction) else 0.0
    mode = rk_steps.entered(numbers, stride.u[k], stride.tau[k], state)
    slots.busy.lane[k], slots.busy.tries[k], slots.busy.idle[k] = j, 0, 0
    _put_mode(slots.busy, k, mode)


def _idle(slots: Any, k: int) -> None:
    """Leave a slot empty: what was in it last continues without effect."""
    slots.busy.lane[k], slots.busy.tries[k] = NOBODY, 1
    slots.stride.reach[k] = slots.stride.rise[k] = 0.0


def _put_mode(busy: Any, k: int, mode: Any) -> None:
    busy.zone[k], busy.contact[k], busy.share[k] = mode.zone, mode.contact, mode.share


def _goes_on(slack: bool, tile: Any, plan: Any, slots: Any, k: int) -> bool:
    """Judge the stride of the lane in a slot; tell whether it has further to go."""
    stride, busy, after, j = slots.stride, slots.busy, slots.after, slots.busy.lane[k]
    to, time = State(after.q[k], after.w[k], after.T_w[k], after.T_h[k]), after.t[k]
    if stride.quiet[k] > 0.0:
        _leave(to, max(stride.length[k], time * stride.factor[k]), slack, tile, j)
        return False
    numbers, mode, u, tau = numbers_in(slots.own, k), mode_in(busy, k), stride.u[k], stride.tau[k]
    aim = rk_steps.Aim(stride.reach[k], stride.origin[k], stride.rise[k])
    gain = aim.reach * slots.pace[1, k] if aim.rise == 0.0 else 0.0
    met = rk_steps.first_met(numbers, mode, u, tau, before_in(slots.before, k), to, busy.tries[k] > 0, gain, time)
    found = rk_steps.judged(numbers.stops, to, aim, time, stride.left[k], stride.length[k], stride.span[k],
                            stride.error[k], stride.factor[k], met)
    busy.tries[k] = busy.tries[k] + 1 if found.known else 0
    if not found.good or max(busy.tries[k], busy.idle[k]) > rk_steps.MOST_TRIES:
        plan.lost[j] = 1.0
        return False
    stride.length[k], stride.span[k] = found.length, found.span
    stride.reach[k], stride.origin[k], stride.rise[k] = found.aim.reach, found.aim.origin, found.aim.rise
    if not found.taken:
        return True
    left = max(stride.left[k] - time, 0.0)
    left = left if left > _SHORTEST else 0.0
    busy.idle[k] = busy.idle[k] + 1 if left == stride.left[k] else 0
    stride.left[k] = left
    if found.crossed >= 0:
        if slack:
            tiles.drag(tile, to.q, j)
        mode, y = crossings.cross(numbers, mode, found.crossed, u, tau, rk_steps.vector_of(to))
        to = State(y.q, y.w, y.T_w, y.T_h)
        _put_mode(busy, k, mode)
    put_before_in(slots.before, k, to)
    if left > 0.0 and not rk_steps.stays(numbers, mode, u):
        return True
    if left > 0.0:  # it stands still
        T_w, T_h = rk_steps.cooled(numbers, to.T_w, to.T_h, left)
        to = State(to.q, to.w, T_w, T_h)
    _leave(to, stride.length[k], slack, tile, j)
    return False


def _leave(state: State, length: float, slack: bool, tile: Any, j: int) -> None:
    """Put a lane back into its tile."""
    servo = tile.servo
    servo.q[j], servo.w[j], servo.T_w[j], servo.T_h[j] = state.q, state.w, state.T_w, state.T_h
    servo.step[j] = length
    if slack:
        tiles.drag(tile, state.q, j)


def _state(tile: Any, j: int) -> State:
    return State(tile.servo.q[j], tile.servo.w[j], tile.servo.T_w[j], tile.servo.T_h[j])
