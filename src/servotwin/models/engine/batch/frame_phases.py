"""How a tile of lanes moves through the phases of a window.

All lanes take the first arc of a phase together, without branches, so that a compiler can run them in vectors; so do
those that stop, or reach the edge of the dead zone, with what follows. A third arc is rare and goes lane by lane.

At an edge the pulse is looked up, measured and decided upon. A window then has the rest of the drive before, a rest
until the decision, the drive decided upon, and a rest.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.batch import (
    backlash_batch,
    braked_batch,
    inductive_batch,
    piecewise_batch,
    rk_batch,
    tiles,
)
from servotwin.models.engine.batch.tiles import BANDS, COILS, GAPS, ONE_FORMULA, STRIDES, More
from servotwin.models.engine.memory import SAME
from servotwin.models.engine.step import circuit
from servotwin.models.state.modes import Vector
from servotwin.models.terms import frame
from servotwin.models.terms.frame import Chip
from servotwin.physics import bridge, motor, potentiometer, supply
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats


# --- How a tile of lanes moves through the phases of a window ---------------------------------------------------------

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


# --- Windows ----------------------------------------------------------------------------------------------------------

def begin(listed: Floats, size: int, own: bool, tile: Any, plan: Any, before: Any) -> int:
    """Begin a window of every lane that has time left; return how many, and in `plan` which are at an edge.

    `listed` are the edges of lanes that bring their own; `own` is whether there are any. The clocks advance to the end
    of the window, and `before` has what they showed.
    """
    clock, count = tile.clock, tile.count
    for j in range(size):
        number, period, since, remaining = count.number[j], clock.period[j], clock.since[j], clock.remaining[j]
        rises = since >= clock.length[j] and remaining > 0.0
        plan.at_edge[j] = 1.0 if rises else 0.0
        count.number[j] = number + 1 if rises else number
        clock.edge[j] = number * period if rises else clock.edge[j]
        before.since[j] = 0.0 if rises else since
        clock.length[j] = period if rises else clock.length[j]
    if own:
        for j in range(size):
            if plan.at_edge[j] > 0.0 and count.edges[j] >= 0:
                _own_edge(listed, tile, j)
    alive = 0
    for j in range(size):
        since, length, remaining = before.since[j], clock.length[j], clock.remaining[j]
        gap = length - since
        slack = SAME * clock.period[j]
        last = remaining <= gap + slack
        inside = remaining < gap - slack  # the end of the call, not the edge, ends the window
        goes = remaining > 0.0
        plan.window[j] = (remaining if inside else gap) if goes else 0.0
        plan.last[j] = 1.0 if last else 0.0
        before.now[j] = clock.edge[j] + since
        before.remaining[j] = remaining
        clock.since[j] = (since + remaining if inside else length) if goes else since
        clock.remaining[j] = 0.0 if last else remaining - gap
        alive += 1 if goes else 0
    return alive


def _own_edge(listed: Floats, tile: Any, j: int) -> None:
    """Set the frame of a lane whose command brings its own edges."""
    clock, count = tile.clock, tile.count
    k = count.number[j] - 1
    at = count.first_edge[j] + k
    clock.edge[j] = listed[at]
    clock.length[j] = listed[at + 1] - listed[at] if k + 1 < count.edges[j] else math.inf


def commands(r: Floats, size: int, tile: Any, plan: Any) -> None:
    """Look up the width of every pulse whose piece is over or not constant, in the rows `r`."""
    clock, count = tile.clock, tile.count
    due = 0
    for j in range(size):
        due += 1 if plan.at_edge[j] > 0.0 and clock.piece_end[j] <= clock.edge[j] + SAME * clock.period[j] else 0
    if due == 0:
        return
    for j in range(size):
        now = clock.edge[j] + SAME * clock.period[j]
        if plan.at_edge[j] > 0.0 and clock.piece_end[j] <= now:
            i, last = count.piece[j], count.last_piece[j]
            while i < last and now >= r[i + 1, 0]:
                i += 1
            count.piece[j] = i
            if r[i, 2] != 0.0 or r[i, 3] != 0.0:
                tile.servo.width[j] = piece_value(
                    Piece(r[i, 0], r[i, 1], r[i, 2], r[i, 3], r[i, 4], r[i, 5], r[i, 6]), clock.edge[j])
            else:
                tile.servo.width[j] = r[i, 1]
                clock.piece_end[j] = r[i + 1, 0] if i < last else math.inf


def measure(size: int, form: int, tile: Any, plan: Any) -> None:
    """Set what the motor's voltage and the supply's sag add to the one-shot's measure."""
    if form == tiles.BANDS or tiles.has_more(form):
        for j in range(size):
            numbers, w = tiles.numbers_at(tile.own, j), tile.servo.w[j]
            y = Vector(0.0, w, tile.servo.i[j], tile.servo.T_w[j], tile.servo.T_h[j], 0.0,
                       tile.servo.w_m[j] if form == tiles.GAPS else w)
            _, v_m, V_bus = circuit(numbers, tile.servo.drive[j] * numbers.source.V, y)
            plan.v_m[j] = v_m
            plan.V_bus[j] = V_bus
        return
    for j in range(size):
        meter = tiles.meter_at(tile.meter, j)
        drive, w = tile.servo.drive[j], tile.servo.w[j]
        driven = drive != 0.0
        D = meter.D_drive if driven else meter.D_off
        R = meter.R_drive if driven else meter.R_off
        v_b = motor.back_emf(w, meter.K_b)
        x = drive * meter.V - v_b
        direction = math.copysign(1.0, x) if abs(x) > D else 0.0
        v = bridge.driving_voltage(drive * meter.V, direction, D)
        i = motor.steady_armature_current(v, w, R, meter.K_b) if direction != 0.0 else 0.0
        connected = driven or meter.coast > 0.0
        taken = supply.supply_current(i, drive) if connected else 0.0
        plan.v_m[j] = bridge.motor_voltage(i, v_b, meter.R, meter.V_br, v_b if connected else 0.0)
        plan.V_bus[j] = supply.source_voltage(taken, meter.V, meter.R_b) if taken != 0.0 else meter.V


def divide(size: int, full: bool, slack: bool, tile: Any, plan: Any) -> None:
    """Decide and divide the windows of all lanes.

    `full` where a chip has noise, a coupling or an RC stretcher, `slack` where potentiometers have play.
    """
    rising = 0
    for j in range(size):
        rising += 1 if plan.at_edge[j] > 0.0 else 0
    if rising == 0:
        for j in range(size):
            servo = tile.servo
            _divide(math.inf, servo.due[j], servo.sign[j], servo.duration[j], servo.decided[j], servo.silence[j],
                    tile, plan, j)
    else:
        for j in range(size):
            plan.sensed[j] = tile.servo.q[j]
        if slack:
            for j in range(size):
                plan.sensed[j] = tile.servo.wiper[j]
        if full:
            for j in range(size):
                _decide(tiles.chip_at(tile.chip, j), plan.v_m[j], plan.V_bus[j], plan.draw[j], tile, plan, j)
        else:
            for j in range(size):
                _decide(tiles.plain_chip_at(tile.chip, j), 0.0, 0.0, 0.0, tile, plan, j)


def _decide(chip: Chip, v_m: float, V_bus: float, draw: float, tile: Any, plan: Any, j: int) -> None:
    """Measure and decide where a pulse rises, and divide the window."""
    servo = tile.servo
    width, due = servo.width[j], servo.due[j]
    v_o = potentiometer.feedback_voltage(plan.sensed[j], tile.meter.p[j], tile.meter.b_o[j])
    new = frame.decide(chip, 0.0, width, v_o, v_m, V_bus, draw)
    valid = frame.accepted(chip, width) and plan.at_edge[j] != 0.0
    replaces = valid and new.time <= due
    _divide(new.time if valid and not replaces else math.inf, new.time if replaces else due,
            new.sign if replaces else servo.sign[j], new.duration if replaces else servo.duration[j],
            new.error if replaces else servo.decided[j], chip.timeout if valid else servo.silence[j], tile, plan, j)


def _divide(second: float, due: float, sign: float, duration: float, decided: float, silence: float, tile: Any,
            plan: Any, j: int) -> None:
    """Divide the window of a lane with this decision before it, and say what is so after it.

    A `second` decision [s] that has to wait, or already does, is for the general way.
    """
    servo = tile.servo
    window, drive, left = plan.window[j], servo.drive[j], servo.left[j]
    decides = due <= window and window > 0.0
    end1 = max(min(min(min(left, silence), due), window), 0.0)
    end2 = min(due, window)
    end3 = max(min(min(due + duration, silence), window), end2) if decides else end2
    plan.decides[j] = 1.0 if decides else 0.0
    plan.end1[j] = end1
    plan.end2[j] = end2
    plan.end3[j] = end3
    plan.time1[j] = end1
    plan.time2[j] = end2 - end1
    plan.time3[j] = end3 - end2
    plan.time4[j] = window - end3
    plan.drive1[j] = drive
    plan.drive3[j] = sign if decides else 0.0
    plan.lost[j] = 1.0 if window > 0.0 and min(second, servo.later_due[j]) < math.inf else 0.0
    plan.q_before[j] = servo.q[j]
    plan.wiper_before[j] = servo.wiper[j]
    plan.w_before[j] = servo.w[j]
    plan.left_before[j] = left
    plan.silence_before[j] = servo.silence[j]
    plan.error_before[j] = servo.error[j]
    plan.due_before[j] = servo.due[j]
    plan.sign_before[j] = servo.sign[j]
    plan.duration_before[j] = servo.duration[j]
    plan.decided_before[j] = servo.decided[j]
    still = (due + duration if decides else left) - window
    goes_on = (sign if decides else drive) if still > 0.0 and silence >= window else 0.0
    servo.drive[j] = goes_on
    servo.left[j] = still if goes_on != 0.0 else 0.0
    servo.silence[j] = silence - window
    servo.error[j] = decided if decides else servo.error[j]
    servo.due[j] = math.inf if decides else due - window
    servo.sign[j] = sign
    servo.duration[j] = duration
    servo.decided[j] = decided


def give_up(size: int, form: int, tile: Any, plan: Any, before: Any) -> int:
    """Put lanes that cannot continue side by side back to where the window began; return how many there are."""
    servo, clock, count = tile.servo, tile.clock, tile.count
    lost = 0
    for j in range(size):
        lost += 1 if plan.lost[j] > 0.0 else 0
    if lost > 0:
        for j in range(size):
            if plan.lost[j] > 0.0:
                servo.q[j], servo.w[j], servo.drive[j] = plan.q_before[j], plan.w_before[j], plan.drive1[j]
                servo.wiper[j] = plan.wiper_before[j]
                if tiles.has_more(form):
                    tiles.put_more(servo, j, tiles.more_at(tile.more_before, j))
                servo.left[j], servo.silence[j] = plan.left_before[j], plan.silence_before[j]
                servo.error[j], servo.due[j] = plan.error_before[j], plan.due_before[j]
                servo.sign[j], servo.duration[j] = plan.sign_before[j], plan.duration_before[j]
                servo.decided[j] = plan.decided_before[j]
                clock.since[j], clock.owed[j], clock.remaining[j] = before.since[j], before.remaining[j], 0.0
                if plan.at_edge[j] > 0.0:  # the edge is still before it
                    count.number[j] -= 1
                    clock.length[j] = 0.0
    return lost
