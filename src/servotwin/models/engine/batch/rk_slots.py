"""Slots: so many lanes take a stride together, by the explicit Runge-Kutta method of order 8 by Dormand and Prince.

Every loop over the slots is innermost and goes over all of them, busy or not, so that a compiler can run it in vectors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from servotwin.models.engine.batch import rk_steps
from servotwin.models.engine.batch.rk_steps import State
from servotwin.models.engine.dynamics.rates import rates_of
from servotwin.models.engine.motions.dormand_prince import (
    ERROR_3,
    ERROR_5,
    FIRST,
    FRACTIONS,
    STAGES,
    WEIGHTS,
    WHICH,
)
from servotwin.models.engine.motions.elementary import fma
from servotwin.models.state.modes import BACKWARD, Mode, Vector
from servotwin.models.state.records import made, reader, rows_of, tile_of, writer
from servotwin.models.terms.numbers import Numbers

SLOTS = 8
_WIDTH = 5  # what goes on in a stride: a state, and its time
NOBODY = -1


class Reached(NamedTuple):
    """A state, and the time that a stride has taken to it [s]."""

    q: float
    w: float
    T_w: float
    T_h: float
    t: float


class Stride(NamedTuple):
    """What a lane tries."""

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
    """Who is in a slot, and in which mode."""

    lane: int  # in its tile, or NOBODY
    zone: int
    contact: int
    share: int
    tries: int  # of this stride: its aim is known
    idle: int  # strides in which no time has gone on


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
    return rk_steps.free_mode(busy.zone[j], busy.contact[j], busy.share[j])


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
    aim = rk_steps.aimed(numbers, mode_in(slots.busy, j), stride.u[j], stride.tau[j], before_in(slots.before, j),
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
    stride.factor[j] = rk_steps.factor_of(size)


def _listen(numbers: Numbers, slots: Any, j: int) -> None:
    """Mark a lane whose stride is good and has led to the end of its phase without anything to look at."""
    to, stride = slots.after, slots.stride
    after = State(to.q[j], to.w[j], to.T_w[j], to.T_h[j])
    gain = stride.reach[j] * slots.pace[1, j]
    calm = rk_steps.calm(numbers, mode_in(slots.busy, j), stride.u[j], stride.tau[j], after, gain)
    good = stride.rise[j] == 0.0 and stride.error[j] <= 1.0 and slots.busy.tries[j] == 0
    stride.quiet[j] = 1.0 if calm and good and stride.reach[j] >= stride.left[j] else 0.0


def _squares(a: float, b: float, c: float, d: float, e: float) -> float:
    return a * a + b * b + c * c + d * d + e * e
