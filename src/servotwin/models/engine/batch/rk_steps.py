"""A stride: one step of the integrator for one body with nothing but angle, speed and temperatures in motion.

It serves servos that are warm, or carry a pendulum or a spring, under any friction that sticks. Time is what a stride
goes by; the last one before a standstill goes by the speed instead and so ends exactly there: dq/dw = w/ẇ, dt/dw = 1/ẇ.
Where static friction fades as a power of the speed it goes by the root of it, by which even that is smooth.
Any other end of a law, a zone of the current or the sign of a share, leaves the acceleration continuous, so that the
instant is found to enough digits by trying again. Everything here asks the laws of the general engine.

Every loop over the slots is innermost and goes over all of them, busy or not, so that a compiler can run it in vectors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from servotwin.models.engine.batch.segments import linear_segments
from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.engine.motions.dormand_prince import (
    ERROR_3,
    ERROR_5,
    FIRST,
    FRACTIONS,
    STAGES,
    WEIGHTS,
    WHICH,
)
from servotwin.models.engine.motions.elementary import fma, log
from servotwin.models.state.modes import BACKWARD, FORWARD, FREE, RIGID, STUCK, Mode, Vector
from servotwin.models.state.records import made, reader, rows_of, tile_of, writer
from servotwin.models.terms import heat
from servotwin.models.terms.friction import creeping_speed, fades
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.stops import Stops
from servotwin.physics.thermal import two_mass_temperatures

# --- A stride ---------------------------------------------------------------------------------------------------------

# Error of a stride, parts of the accuracy asked for: where friction does not vary, and where it bends and fades
SMOOTH, STEEP = 0.1, 1e-4
MOST_TRIES = 60  # of a stride; one that needs more is for the general engine
SPEED_TURNS = 0.25  # relative: a stride goes by the speed where the acceleration changes by less until rest
BEFORE = 0.98  # of the time to a standstill that is only guessed
_NEAR = 1e-4  # relative: a guard other than the speed that has come so near to zero is zero: nothing jumps there
_SAME_TIME = 1e-12  # s
_SHORTEST, _LONGEST = 0.15, 6.0  # factors from stride to stride
_NOT_ALL = 0.99  # of a stride: where it is tried again up to its turning point, that is not its end
_STRETCH = 1.25  # a stride is made so much longer, rather than leave a short one
_WATCHED = (guards.SPEED, guards.ZONE_UP, guards.ZONE_DOWN, guards.SHARE, guards.RELEASE_FORWARD,
            guards.RELEASE_BACKWARD)  # what may end a law


class State(NamedTuple):
    """Angle, speed, and temperatures of winding and housing."""

    q: float
    w: float
    T_w: float
    T_h: float


class Aim(NamedTuple):
    """How far a stride is to go: by time [s], or by the speed [rad/s] or its root, from a value on by a difference."""

    reach: float  # 1 by the speed
    origin: float
    rise: float  # 0: by time


class Met(NamedTuple):
    """The guard that has fallen below zero first in a stride, −1 if none has, with its values before and after."""

    kind: int
    was: float
    now: float


class Judged(NamedTuple):
    """The end of a stride."""

    taken: bool  # else it is tried again
    aim: Aim  # the next one, where it is known already
    known: bool
    length: float  # that the next one by time might have [s]
    span: float  # that the next one by the speed might have
    crossed: int  # the guard that has come to zero; −1: none
    good: bool  # else the general engine takes the servo over


def vector_of(state: State) -> Vector:
    """Return a state as the general engine has it."""
    return Vector(state.q, state.w, 0.0, state.T_w, state.T_h, state.q, state.w)


def way_from_rest(numbers: Numbers, u: float, tau: float, state: State) -> float:
    """Return which way a shaft at rest starts under a voltage behind the bridge and its load: −1, 0, +1."""
    y = Vector(state.q, 0.0, 0.0, state.T_w, state.T_h, state.q, 0.0)
    numbers = warm(numbers, y)
    tau_m = currents.drive_torque(numbers, currents.zone_of(numbers, u, 0.0, state.q, 0.0, 0.0), u, y)
    against = external_torque(numbers.load, tau, state.q)
    backward, forward = contacts.holding_bounds(numbers, tau_m, -against)
    return linear_segments.starting(forward, backward, tau_m - against)


def entered(numbers: Numbers, u: float, tau: float, state: State) -> Mode:
    """Return the mode in which a shaft begins."""
    y = vector_of(state)
    zone = currents.zone_of(warm(numbers, y), u, 0.0, state.q, state.w, 0.0)
    return guards.settled(numbers, zone, u, tau, y, RIGID, False)


def cooled(numbers: Numbers, T_w: float, T_h: float, time: float) -> tuple[float, float]:
    """Return the temperatures [K] of a servo without current after a time [s]."""
    if not heat.present(numbers.heat):
        return T_w, T_h
    own = numbers.heat
    after: tuple[Any, Any] = two_mass_temperatures(
        time, 0.0, T_w, T_h, winding_capacity=own.C_w, housing_capacity=own.C_h, winding_to_housing=1.0 / own.G_wh,
        housing_to_ambient=1.0 / own.G_ha, ambient=own.T_amb)
    return float(after[0]), float(after[1])


def acceleration(numbers: Numbers, mode: Mode, u: float, tau: float, state: State, w: float) -> float:
    """Return the acceleration [rad/s²] at a state, with a speed of its own."""
    y = Vector(state.q, w, 0.0, state.T_w, state.T_h, state.q, w)
    return contacts.acceleration(warm(numbers, y), mode, u, tau, y)


def aimed(numbers: Numbers, mode: Mode, u: float, tau: float, state: State, length: float, left: float,
          span: float) -> Aim:
    """Return how far to go: by the speed to a near standstill or out of one, else by time, up to short of a far one.

    By time it is to be `length` at most, by the root of the speed `span`.
    """
    way = 1.0 if mode.contact == FORWARD else -1.0 if mode.contact == BACKWARD else 0.0
    w = way * state.w
    now = way * acceleration(numbers, mode, u, tau, state, state.w)
    last = way * acceleration(numbers, mode, u, tau, state, 0.0)
    stops = now < 0.0 and last < 0.0 and w > 0.0
    bend = now / last - 1.0 if stops else 0.0  # ẇ goes from `now` to `last` in about a straight line over the speed
    straight = -w / last if stops else math.inf
    near = abs(bend) < SPEED_TURNS
    until = straight * (1.0 - bend * (0.5 - bend / 3.0) if near else log(1.0 + bend) / (bend if bend != 0.0 else 1.0))
    free = left if left <= _STRETCH * length else length
    gain = now * min(length, left)
    curved = fades(numbers.friction)
    creeps = curved and way != 0.0 and w < creeping_speed(numbers.friction)
    origin = math.sqrt(max(w, 0.0)) if curved else w
    if stops and (near or creeps) and until <= left:
        return Aim(1.0, origin, -min(origin, span))
    if creeps and gain > w:
        return Aim(1.0, origin, min(math.sqrt(w + gain) - origin, span))
    return Aim(BEFORE * until if until <= min(free, left) else free, 0.0, 0.0)


def first_span(numbers: Numbers) -> float:
    """Return by how much the root of the speed may advance at first [√(rad/s)]."""
    return 0.5 * math.sqrt(creeping_speed(numbers.friction)) if fades(numbers.friction) else math.inf


def factor_of(size: float) -> float:
    """Return how much longer than a stride with this error over its tolerance the next one may be."""
    if size > 0.0:
        return min(max(0.9 / math.sqrt(math.sqrt(math.sqrt(size))), _SHORTEST), _LONGEST)
    return _LONGEST


def judged(stops: Stops, after: State, aim: Aim, time: float, left: float, length: float, span: float, size: float,
           factor: float, met: Met) -> Judged:
    """Judge a stride that has taken a `time` [s], by its error over the tolerance (`size`) and what it has met."""
    by_speed = aim.rise != 0.0
    if not (size <= 1.0 and math.isfinite(after.q + after.w + time)):
        less = factor if factor < 1.0 else _SHORTEST
        if by_speed:
            return Judged(False, Aim(1.0, aim.origin, less * aim.rise), True, length, less * abs(aim.rise), -1, True)
        return Judged(False, Aim(less * aim.reach, 0.0, 0.0), True, less * aim.reach, span, -1, True)
    if not stops.lower < after.q < stops.upper:
        return Judged(False, aim, True, length, span, -1, False)
    if by_speed and time > left + _SAME_TIME:
        return Judged(False, Aim(left, 0.0, 0.0), True, length, span, -1, True)
    span = max(span, abs(aim.rise) * factor)
    if by_speed and aim.origin + aim.rise == 0.0 and not met.now < guards.BELOW:  # else another law begins before
        return Judged(True, aim, False, length, span, guards.SPEED, True)
    cut = by_speed or aim.reach >= left or aim.reach < length  # a stride that was cut short tells little
    grown = max(length, time * factor) if cut else time * factor
    kind, was, now = met
    if kind < 0:
        return Judged(True, aim, False, grown, span, -1, True)
    if by_speed:
        return Judged(False, Aim(min(length, left), 0.0, 0.0), True, length, span, -1, True)
    reach = max(aim.reach * was / (was - now), 0.5 * _SAME_TIME)
    if kind == guards.SPEED:
        return Judged(False, Aim(BEFORE * reach, 0.0, 0.0), True, length, span, -1, True)
    if abs(now) <= _NEAR * was or aim.reach < _SAME_TIME:
        return Judged(True, aim, False, grown, span, kind, True)
    return Judged(False, Aim(reach, 0.0, 0.0), True, length, span, -1, True)


def first_met(numbers: Numbers, mode: Mode, u: float, tau: float, before: State, after: State, sought: bool,
              gain: float, time: float) -> Met:
    """Return the guard that falls below zero first within a stride; where one is `sought`, or is as good as there.

    By time the speed is to gain so much over the stride if its acceleration stays, in a `time` [s]; else `gain` is 0.
    """
    kinds = guards.guards(numbers, mode, u, False)
    y, y1 = vector_of(before), vector_of(after)
    found, was, now, first = -1, 0.0, 0.0, math.inf
    for kind in _WATCHED:
        if kinds >> kind & 1:
            b = guards.guard(numbers, mode, kind, u, 0.0, tau, 0.0, y1, y1)[0]
            if b < guards.BELOW or (sought and kind != guards.SPEED):
                a = max(guards.guard(numbers, mode, kind, u, 0.0, tau, 0.0, y, y)[0], 0.0)
                if (b < guards.BELOW or b < _NEAR * a) and a / (a - b) < first:
                    found, was, now, first = kind, a, b, a / (a - b)
    if found < 0 and gain != 0.0 and kinds != 0:
        late = time * acceleration(numbers, mode, u, tau, after, after.w)
        if gain * late < 0.0:
            return _dipped(numbers, mode, kinds, u, tau, before, after, gain, late, time)
    return Met(found, was, now)


def calm(numbers: Numbers, mode: Mode, u: float, tau: float, after: State, gain: float) -> bool:
    """Tell that a sliding shaft has met nothing in a stride by time: what `judged` and `first_met` would find.

    Its speed was to gain so much over the stride. Where this is not found, they have to look.
    """
    warmed = warm(numbers, vector_of(after))
    low, high = currents.zone_limits(warmed, mode.zone, u)
    x = currents.zone_variable(warmed, mode.zone, u, after.q, after.w, 0.0)
    way = 1.0 if mode.contact == FORWARD else -1.0 if mode.contact == BACKWARD else 0.0
    nearest = min(way * after.w, x - low, high - x, after.q - numbers.stops.lower, numbers.stops.upper - after.q)
    late = acceleration(numbers, mode, u, tau, after, after.w)
    return mode.share == 0 and 0.0 < nearest < math.inf and gain * late >= 0.0


def _dipped(numbers: Numbers, mode: Mode, kinds: int, u: float, tau: float, before: State, after: State, gain: float,
            late: float, time: float) -> Met:
    """Return the guard that may have been below zero where the speed has turned back within a stride.

    Met is such that the stride is tried again up to there, to see whether it has.
    """
    x = turning_point(after.w - before.w, gain, late)
    w = _cubic(x, before.w, after.w, gain, late)
    q = _cubic(x, before.q, after.q, time * before.w, time * after.w)
    T_w, T_h = before.T_w + x * (after.T_w - before.T_w), before.T_h + x * (after.T_h - before.T_h)
    y, y1, there = vector_of(before), vector_of(after), vector_of(State(q, w, T_w, T_h))
    doubt = (x * (1.0 - x)) ** 2  # of the cubic, parts of how far the speed turns back
    x = min(x, _NOT_ALL)
    for kind in _WATCHED:
        if kinds >> kind & 1:
            b = guards.guard(numbers, mode, kind, u, 0.0, tau, 0.0, there, there)[0]
            ends = max(guards.guard(numbers, mode, kind, u, 0.0, tau, 0.0, y, y)[0],
                       guards.guard(numbers, mode, kind, u, 0.0, tau, 0.0, y1, y1)[0])
            if b < doubt * (ends - b):
                return Met(kind, 1.0, 1.0 - 1.0 / x)
    return Met(-1, 0.0, 0.0)


def turning_point(rise: float, early: float, late: float) -> float:
    """Return where a cubic over 0 to 1 turns that rises by so much, with slopes of opposite signs at its ends."""
    way = 1.0 if late > 0.0 else -1.0
    half, curve = 3.0 * rise - 2.0 * early - late, 3.0 * (early + late - 2.0 * rise)
    return early / (-half - way * math.sqrt(half * half - curve * early))


def _cubic(x: float, begin: float, end: float, early: float, late: float) -> float:
    """Return a cubic over 0 to 1 by its values and slopes at the ends."""
    z = 1.0 - x
    return z * z * (begin * (1.0 + 2.0 * x) + early * x) + x * x * (end * (1.0 + 2.0 * z) - late * z)


def rests(mode: Mode) -> bool:
    """Tell whether a shaft is held by friction."""
    return mode.contact == STUCK


def stays(numbers: Numbers, mode: Mode, u: float) -> bool:
    """Tell whether nothing but cooling will happen to a shaft: it is held, and no current warms it."""
    return rests(mode) and (u == 0.0 or not heat.present(numbers.heat))


def free_mode(zone: int, contact: int, share: int) -> Mode:
    """Return the mode of one body."""
    return Mode(zone, contact, RIGID, FREE, share)


# --- Slots ------------------------------------------------------------------------------------------------------------

SLOTS = 8
_WIDTH = 5  # what advances in a stride: a state, and its time
NOBODY = -1


class Reached(NamedTuple):
    """A state, and the time that a stride has taken to it [s]."""

    q: float
    w: float
    T_w: float
    T_h: float
    t: float


class Stride(NamedTuple):
    """The steps that a lane tries."""

    u: float  # voltage behind the bridge [V]
    tau: float  # constant external torque [N m]
    left: float  # time left of the phase [s]
    length: float  # that a stride by time might have [s]
    reach: float  # of the aim, as `strides.Aim` has it
    origin: float
    rise: float
    span: float
    curved: float  # 1: strides by the speed go by its root
    tolerance: float
    at_stage: float  # the speed or its root
    error: float  # over the tolerance
    factor: float  # how much longer the next one may be
    quiet: float  # 1: it has led to the end of the phase, and nothing has happened on the way


class Busy(NamedTuple):
    """The lane in a slot, and its mode."""

    lane: int  # in its tile, or NOBODY
    zone: int
    contact: int
    share: int
    tries: int  # of this stride: its aim is known
    idle: int  # strides in which no time has passed


@cache
def slots_type() -> np.dtype[Any]:
    """Return the type of the slots."""
    real = np.float64
    return tile_of({
        "own": rows_of(Numbers, real, SLOTS), "before": rows_of(State, real, SLOTS),
        "after": rows_of(Reached, real, SLOTS), "stride": rows_of(Stride, real, SLOTS),
        "busy": rows_of(Busy, np.int64, SLOTS), "pace": np.dtype((real, (_WIDTH * STAGES, SLOTS))),
        "errors": np.dtype((real, (2 * _WIDTH, SLOTS)))}, SLOTS)


numbers_in = reader("numbers_in", Numbers)
put_numbers_in = writer("put_numbers_in", Numbers)
before_in = reader("before_in", State)
put_before_in = writer("put_before_in", State)


def mode_in(busy: Any, j: int) -> Mode:
    """Return the mode of the lane in a slot."""
    return free_mode(busy.zone[j], busy.contact[j], busy.share[j])


def _sum(rows: Iterable[tuple[float, int]]) -> str:
    """Return the text of a sum of paces, by weight and row."""
    total = ""
    for weight, k in rows:
        if weight != 0.0:
            total = f"fma({weight!r}, pace[{k}, j], {total})" if total else f"{weight!r} * pace[{k}, j]"
    return total or "0.0"


def _gathering(stage: int) -> str:
    """Return the text that sets the states from which a stage takes its rates, all written out: it goes in vectors."""
    own = range(FIRST[stage], FIRST[stage + 1])
    sums = {name: _sum((WEIGHTS[n], _WIDTH * WHICH[n] + c) for n in own) for c, name in enumerate(Reached._fields)}
    at = f"fma({FRACTIONS[stage]!r}, rise, stride.origin[j])" if stage < STAGES else "stride.origin[j] + rise"
    return f"""
    if stage == {stage}:
        for j in range({SLOTS}):
            reach, rise = stride.reach[j], stride.rise[j]
            at = {at}
            by_speed = at * at if stride.curved[j] > 0.0 else at
            by_time = fma(reach, {sums["w"]}, before.w[j])
            stride.at_stage[j] = at
            to.q[j] = fma(reach, {sums["q"]}, before.q[j])
            to.w[j] = by_time if rise == 0.0 else -by_speed if slots.busy.contact[j] == {BACKWARD} else by_speed
            to.T_w[j] = fma(reach, {sums["T_w"]}, before.T_w[j])
            to.T_h[j] = fma(reach, {sums["T_h"]}, before.T_h[j])
            to.t[j] = reach * ({sums["t"]})
"""


gather = made("gather", f"""def gather(slots, stage):
    to, before, pace, stride = slots.after, slots.before, slots.pace, slots.stride
{"".join(_gathering(stage) for stage in range(STAGES + 1))}""", {"fma": fma})


def step(slots: Any) -> None:
    """Let the lanes in all slots take a stride, and measure its error."""
    for j in range(SLOTS):
        _aim(numbers_in(slots.own, j), slots, j)
    for stage in range(STAGES + 1):
        gather(slots, stage)
        if stage < STAGES:
            for j in range(SLOTS):
                _pace(numbers_in(slots.own, j), slots, _WIDTH * stage, j)
    for j in range(SLOTS):
        measure(slots, j)
    for j in range(SLOTS):
        _weigh(before_in(slots.before, j), slots, j)
    for j in range(SLOTS):
        _listen(numbers_in(slots.own, j), slots, j)


def _pace(numbers: Numbers, slots: Any, k: int, j: int) -> None:
    """Set the rates of the lane in a slot, by time or by speed, in the rows from k on."""
    at, stride, pace = slots.after, slots.stride, slots.pace
    q, w = at.q[j], at.w[j]
    y = Vector(q, w, 0.0, at.T_w[j], at.T_h[j], q, w)
    dq, dw, _, dT_w, dT_h, _, _ = rates_of(numbers, mode_in(slots.busy, j), stride.u[j], stride.tau[j], y)
    rise, steep = stride.rise[j], 2.0 * stride.at_stage[j] if stride.curved[j] > 0.0 else 1.0
    per = rise * steep / dw if rise != 0.0 and dw != 0.0 else 1.0
    per = -per if slots.busy.contact[j] == BACKWARD and rise != 0.0 else per
    pace[k, j] = dq * per
    pace[k + 1, j] = dw * per
    pace[k + 2, j] = dT_w * per
    pace[k + 3, j] = dT_h * per
    pace[k + 4, j] = per


def _aim(numbers: Numbers, slots: Any, j: int) -> None:
    """Set how far the lane in a slot is to go, where that is not known."""
    stride, known = slots.stride, slots.busy.tries[j] > 0
    reach, origin, rise = stride.reach[j], stride.origin[j], stride.rise[j]
    aim = aimed(numbers, mode_in(slots.busy, j), stride.u[j], stride.tau[j], before_in(slots.before, j),
                         stride.length[j], stride.left[j], stride.span[j])
    stride.reach[j] = reach if known else aim.reach
    stride.origin[j] = origin if known else aim.origin
    stride.rise[j] = rise if known else aim.rise


def _measuring() -> Callable[[Any, int], None]:
    """Return the function that sums up the errors of orders 5 and 3 of the lane in a slot."""
    lines = [f"    slots.errors[{_WIDTH * m + c}, j] = {_sum((row[k], _WIDTH * k + c) for k in range(STAGES))}\n"
             for m, row in enumerate((ERROR_5, ERROR_3)) for c in range(_WIDTH)]
    return made("measure", f"def measure(slots, j):\n    pace = slots.pace\n{''.join(lines)}", {"fma": fma})


measure = _measuring()


def _weigh(before: State, slots: Any, j: int) -> None:
    """Set the error of a stride over its tolerance, relative to 1 + |state|, as `dormand_prince.error_of` has it."""
    after, error, stride = slots.after, slots.errors, slots.stride
    q, w = 1.0 + max(abs(before.q), abs(after.q[j])), 1.0 + max(abs(before.w), abs(after.w[j]))
    T_w, T_h = 1.0 + max(abs(before.T_w), abs(after.T_w[j])), 1.0 + max(abs(before.T_h), abs(after.T_h[j]))
    e_5 = _squares(error[0, j] / q, error[1, j] / w, error[2, j] / T_w, error[3, j] / T_h, error[4, j])
    e_3 = _squares(error[5, j] / q, error[6, j] / w, error[7, j] / T_w, error[8, j] / T_h, error[9, j])
    total = math.sqrt(e_5 + 0.01 * e_3)
    size = abs(stride.reach[j]) * e_5 / (total * stride.tolerance[j]) if e_5 != 0.0 else 0.0
    stride.error[j] = size
    stride.factor[j] = factor_of(size)


def _listen(numbers: Numbers, slots: Any, j: int) -> None:
    """Mark a lane whose stride is good and has led to the end of its phase without anything to look at."""
    to, stride = slots.after, slots.stride
    after = State(to.q[j], to.w[j], to.T_w[j], to.T_h[j])
    gain = stride.reach[j] * slots.pace[1, j]
    settles = calm(numbers, mode_in(slots.busy, j), stride.u[j], stride.tau[j], after, gain)
    good = stride.rise[j] == 0.0 and stride.error[j] <= 1.0 and slots.busy.tries[j] == 0
    stride.quiet[j] = 1.0 if settles and good and stride.reach[j] >= stride.left[j] else 0.0


def _squares(a: float, b: float, c: float, d: float, e: float) -> float:
    return a * a + b * b + c * c + d * d + e * e
