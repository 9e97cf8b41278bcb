"""How a tile of lanes moves through the phases of a window.

All lanes take the first arc of a phase together, without branches, so that a compiler can run them in vectors; so do
those that stop, or reach the edge of the dead zone, with what follows. A third arc is rare and goes lane by lane.
"""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import (
    backlash_batch,
    braked_batch,
    inductive_batch,
    piecewise_batch,
    rk_batch,
    tiles,
)
from servotwin.models.engine.batch.tiles import BANDS, COILS, GAPS, ONE_FORMULA, STRIDES, More


def phases(size: int, keep: bool, form: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through the four phases; keep the state at the start of each where it is wanted."""
    if size <= tiles.FEW:
        for j in range(size):
            _lane(keep, form, slack, tile, plan, j)
        return
    if keep:
        _keep(1, plan.q1, plan.w1, plan.wiper1, size, form, tile)
        for j in range(size):
            plan.time[j] = plan.time1[j]
            plan.power[j] = plan.drive1[j]
        _drive(size, form, slack, tile, plan)
        _keep(2, plan.q2, plan.w2, plan.wiper2, size, form, tile)
        for j in range(size):
            plan.time[j] = plan.time2[j]
        _idle(size, form, slack, tile, plan)
        _keep(3, plan.q3, plan.w3, plan.wiper3, size, form, tile)
    else:
        _before(size, form, slack, tile, plan)
    for j in range(size):
        plan.time[j] = plan.time3[j]
        plan.power[j] = plan.drive3[j]
    _drive(size, form, slack, tile, plan)
    if keep:
        _keep(4, plan.q4, plan.w4, plan.wiper4, size, form, tile)
    for j in range(size):
        plan.time[j] = plan.time4[j]
    _idle(size, form, slack, tile, plan)


def _lane(keep: bool, form: int, slack: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through the four phases, for tiles that are too small to go side by side."""
    for phase in range(4):
        q, w, start = tile.servo.q[j], tile.servo.w[j], tile.arc.start_off[j]
        time = plan.time1[j] if phase == 0 else plan.time2[j] if phase == 1 else plan.time3[j]
        power = plan.drive1[j] if phase == 0 else plan.drive3[j] if phase == 2 else 0.0
        time = time if phase < 3 else plan.time4[j]
        if keep:
            _keep_one(phase, q, w, tile.servo.wiper[j], plan, j)
        if keep and tiles.has_more(form):
            _keep_more(phase, tile, j)
        if time > 0.0 and (w != 0.0 or start != 0.0 or power != 0.0):
            plan.time[j] = time
            plan.power[j] = power
            _alone(form, slack, tile, plan, j)


def _keep_one(phase: int, q: float, w: float, wiper: float, plan: Any, j: int) -> None:
    if phase == 0:
        plan.q1[j] = q
        plan.w1[j] = w
        plan.wiper1[j] = wiper
    elif phase == 1:
        plan.q2[j] = q
        plan.w2[j] = w
        plan.wiper2[j] = wiper
    elif phase == 2:
        plan.q3[j] = q
        plan.w3[j] = w
        plan.wiper3[j] = wiper
    else:
        plan.q4[j] = q
        plan.w4[j] = w
        plan.wiper4[j] = wiper


def kept(phase: int, plan: Any, j: int) -> tuple[float, float, float]:
    """Return angle, speed and angle of the potentiometer at the start of a phase, where they were kept."""
    if phase == 0:
        return plan.q1[j], plan.w1[j], plan.wiper1[j]
    if phase == 1:
        return plan.q2[j], plan.w2[j], plan.wiper2[j]
    if phase == 2:
        return plan.q3[j], plan.w3[j], plan.wiper3[j]
    return plan.q4[j], plan.w4[j], plan.wiper4[j]


def more_kept(phase: int, tile: Any, j: int) -> More:
    """Return what few forms change besides, at the start of a phase."""
    if phase == 0:
        return tiles.more_at(tile.more_0, j)
    if phase == 1:
        return tiles.more_at(tile.more_1, j)
    return tiles.more_at(tile.more_2, j) if phase == 2 else tiles.more_at(tile.more_3, j)


def _keep_more(phase: int, tile: Any, j: int) -> None:
    more = tiles.more_at(tile.servo, j)
    if phase == 0:
        tiles.put_more(tile.more_0, j, more)
    elif phase == 1:
        tiles.put_more(tile.more_1, j, more)
    elif phase == 2:
        tiles.put_more(tile.more_2, j, more)
    else:
        tiles.put_more(tile.more_3, j, more)


def _alone(form: int, slack: bool, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through one phase."""
    if form == ONE_FORMULA:
        braked_batch.alone(slack, tile, plan, j)
    elif form == BANDS:
        piecewise_batch.alone(slack, tile, plan, j)
    elif form == STRIDES:
        rk_batch.alone(slack, tile, plan, j)
    elif form == COILS:
        inductive_batch.alone(tile, plan, j)
    elif form == GAPS:
        backlash_batch.alone(tile, plan, j)


def _keep(phase: int, angle: Any, speed: Any, wiper: Any, size: int, form: int, tile: Any) -> None:
    if tiles.has_more(form):
        for j in range(size):
            _keep_more(phase - 1, tile, j)
    for j in range(size):
        angle[j] = tile.servo.q[j]
        speed[j] = tile.servo.w[j]
        wiper[j] = tile.servo.wiper[j]


def _before(size: int, form: int, slack: bool, tile: Any, plan: Any) -> None:
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
    if moving > 0:
        if form == ONE_FORMULA:
            braked_batch.drive_or_rest(size, slack, tile, plan)
        else:
            _by_law(size, form, slack, tile, plan)
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
            _alone(form, slack, tile, plan, j)


def _drive(size: int, form: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a drive."""
    moving = 0
    for j in range(size):
        time, power = plan.time[j], plan.power[j]
        moving += 1 if time > 0.0 and power != 0.0 else 0
    if moving > 0:
        if form == ONE_FORMULA:
            braked_batch.drive(size, slack, tile, plan)
        else:
            _by_law(size, form, slack, tile, plan)


def _idle(size: int, form: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time without drive."""
    moving = 0
    for j in range(size):
        plan.power[j] = 0.0
        time, w, start = plan.time[j], tile.servo.w[j], tile.arc.start_off[j]
        moving += 1 if time > 0.0 and (w != 0.0 or start != 0.0) else 0
    if moving > 0:
        if form == ONE_FORMULA:
            braked_batch.rest(size, slack, tile, plan)
        else:
            _by_law(size, form, slack, tile, plan)


def _by_law(size: int, form: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a phase by a form that asks the law of each lane, whether it drives or not."""
    if form == BANDS:
        piecewise_batch.phase(size, slack, tile, plan)
    elif form == STRIDES:
        rk_batch.phase(size, slack, tile, plan)
    elif form == COILS:
        inductive_batch.phase(size, slack, tile, plan)
    elif form == GAPS:
        backlash_batch.phase(size, tile, plan)
