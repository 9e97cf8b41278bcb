"""Pulse servos side by side: a tile of lanes goes from window to window, each through up to four phases.

A lane that hits a stop, has two decisions waiting or needs too many arcs stays where the window began, and what is
left of the call is for `runs`. A lane never depends on its neighbours.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.batch import backlash_batch, frame_phases, inductive_batch, rk_batch, rk_steps, tiles
from servotwin.models.engine.batch.segments import inductive_segments, linear_segments, piecewise_segments
from servotwin.models.state.modes import BACKWARD, FORWARD, FREE, RIGID, STUCK, Vector
from servotwin.models.state.noise import gaussian

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes, Outputs


def go_on(pieces: Floats, listed: Floats, form: int, slack: bool, which: Indices, duration: float, times: Floats,
          outputs: Outputs, tile_rows: Any, plans: Any) -> int:
    """Advance all lanes by a duration [s], all of them in one form; return how many were given up.

    `tile_rows` are the tiles with the lanes `which`, and `plans` has room for one.
    """
    lost = 0
    for k in range(len(tile_rows)):
        first = k * tiles.TILE
        lost += _go_on(pieces, listed, form, slack, which[first:first + tiles.TILE], duration, times, outputs,
                       tile_rows[k], plans[0].of, plans[0].clock)
    return lost


def start(lanes: Lanes, form: int, first_output: float, tile_rows: Any) -> None:
    """Put all lanes into tiles, as they start; `first_output` is when their first output is due [s]."""
    total = lanes.torque.size
    for k in range(len(tile_rows)):
        first = k * tiles.TILE
        tiles.start(lanes, form, first, min(tiles.TILE, total - first), first_output, tile_rows[k])


def refit(lanes: Lanes, form: int, which: Indices, places: Indices, tile_rows: Any) -> None:
    """Take the numbers of the lanes `which` anew, which stand at these places of the tiles."""
    for k in range(which.size):
        tiles.set_numbers(lanes, form, which[k], 1, tile_rows[places[k] // tiles.TILE], places[k] % tiles.TILE)


def advance(which: Indices, form: int, slack: bool, first: int, last: int, duration: float, widths: Floats,
            torques: Floats, loads_change: bool, tile_rows: Any, plans: Any) -> int:
    """Advance the lanes `which` of the tiles from `first` to before `last` under constant pulses [s] and torques.

    The torques [N m] are read where `loads_change`. Return how many lanes were given up.
    """
    lost = 0
    for k in range(first, last):
        lost += _advance(which[k * tiles.TILE:(k + 1) * tiles.TILE], form, slack, duration, widths, torques,
                         loads_change, tile_rows[k], plans[0].of, plans[0].clock)
    return lost


def _advance(which: Indices, form: int, slack: bool, duration: float, widths: Floats, torques: Floats,
             loads_change: bool, tile: Any, plan: Any, before: Any) -> int:
    size = which.size
    for j in range(size):
        tile.servo.width[j] = widths[which[j]]
        tile.clock.remaining[j] = duration
    if loads_change:
        _hang(which, form, torques, tile)
    full, noisy = _needs_all(size, tile)
    lost = 0
    while frame_phases.begin(widths, size, False, tile, plan, before) > 0:
        _through(size, full, noisy, form, slack, False, tile, plan)
        lost += frame_phases.give_up(size, form, tile, plan, before)
    return lost


def _go_on(pieces: Floats, listed: Floats, form: int, slack: bool, which: Indices, duration: float, times: Floats,
           outputs: Outputs, tile: Any, plan: Any, before: Any) -> int:
    size = which.size
    own = False
    for j in range(size):
        own = own or tile.count.edges[j] >= 0
        tile.clock.remaining[j] = duration
    full, noisy = _needs_all(size, tile)
    lost = 0
    while frame_phases.begin(listed, size, own, tile, plan, before) > 0:
        frame_phases.commands(pieces, size, tile, plan)
        wanted = _wanted(size, tile, plan, before)
        _through(size, full, noisy, form, slack, wanted > 0, tile, plan)
        if wanted > 0:
            _write(which, form, slack, times, outputs, tile, plan, before)
        lost += frame_phases.give_up(size, form, tile, plan, before)
    return lost


def _through(size: int, full: bool, noisy: bool, form: int, slack: bool, keep: bool, tile: Any, plan: Any) -> None:
    """Go through a window that has begun."""
    if noisy:
        for j in range(size):
            plan.draw[j] = gaussian(tile.count.seed[j], tile.count.first_draw[j] + tile.count.number[j] - 1)
    elif full:
        for j in range(size):
            plan.draw[j] = 0.0
    if full:
        frame_phases.measure(size, form, tile, plan)
    frame_phases.divide(size, full, slack, tile, plan)
    if tiles.has_more(form):
        for j in range(size):
            tiles.put_more(tile.more_before, j, tiles.more_at(tile.servo, j))
    frame_phases.phases(size, keep, form, slack, tile, plan)


def _needs_all(size: int, tile: Any) -> tuple[bool, bool]:
    """Tell whether a chip has noise, a coupling or an RC stretcher, and whether one has noise."""
    chip = tile.chip
    full = noisy = False
    for j in range(size):
        noisy = noisy or chip.noise[j] != 0.0
        full = full or chip.beta[j] != 0.0 or chip.c_s[j] != 0.0 or chip.tau_s[j] != 0.0
    return full or noisy, noisy


def _hang(which: Indices, form: int, torques: Floats, tile: Any) -> None:
    """Hang constant external torques [N m] on the shafts of a tile."""
    numbers = tile.arc
    if form == tiles.BANDS:
        for j in range(which.size):
            tiles.hang(tiles.numbers_at(tile.own, j), torques[which[j]], tile, j)
        return
    if tiles.has_more(form):
        for j in range(which.size):
            tile.hung.torque[j] = torques[which[j]]
        return
    for j in range(which.size):
        load = linear_segments.loading(numbers.inertia[j], numbers.pull[j], numbers.hold_forward[j],
                                       numbers.hold_backward[j],
                                       torques[which[j]])
        numbers.against[j] = load.against
        numbers.start_forward[j] = load.start_forward
        numbers.start_backward[j] = load.start_backward
        numbers.start_off[j] = load.start_off


def _wanted(size: int, tile: Any, plan: Any, before: Any) -> int:
    """Return how many lanes have outputs in this window."""
    wanted = 0
    for j in range(size):
        wanted += 1 if _is_wanted(tile, plan, before, j) else 0
    return wanted


def _is_wanted(tile: Any, plan: Any, before: Any, j: int) -> bool:
    """Tell whether the next output of a lane lies in this window; at its end only where the call ends too."""
    x = tile.clock.output[j] - before.now[j]
    return bool(plan.window[j] > 0.0 and (x < plan.window[j] or (plan.last[j] > 0.0 and x < math.inf)))


def _write(which: Indices, form: int, slack: bool, times: Floats, outputs: Outputs, tile: Any, plan: Any,
           before: Any) -> None:
    """Write the outputs of this window, each from the arc that holds it."""
    for j in range(which.size):
        first, due = tile.count.output[j], tile.clock.output[j]
        while plan.lost[j] == 0.0 and _is_wanted(tile, plan, before, j):
            o = tile.count.output[j]
            x = tile.clock.output[j] - before.now[j]
            plan.time[j] = min(max(x, 0.0), plan.window[j])
            _write_one(which[j], o, j, form, slack, outputs, tile, plan)
            tile.count.output[j] = o + 1
            tile.clock.output[j] = times[o + 1] if o + 1 < times.size else math.inf
        if plan.lost[j] > 0.0:  # whoever takes it over writes them all
            tile.count.output[j], tile.clock.output[j] = first, due


def _write_one(lane: int, o: int, j: int, form: int, slack: bool, outputs: Outputs, tile: Any, plan: Any) -> None:
    """Write one output; a lane of which it cannot be determined is given up."""
    x = plan.time[j]
    phase = _phase_at(x, plan, j)
    after = plan.end1[j] if phase == 1 else plan.end2[j] if phase == 2 else plan.end3[j]
    x -= after if phase > 0 else 0.0
    drive = plan.drive1[j] if phase == 0 else plan.drive3[j] if phase == 2 else 0.0
    q, w, wiper = frame_phases.kept(phase, plan, j)
    if tiles.has_more(form):
        own, torque, more = tiles.numbers_at(tile.own, j), tile.hung.torque[j], frame_phases.more_kept(phase, tile, j)
        i, T_w, T_h, q_m, w_m, mesh, _ = more
        done = 1.0
        if form == tiles.COILS:
            q, w, i, wiper, done = inductive_batch.seen(torque, drive, q, w, i, wiper, x, tile, j)
            contact = inductive_segments.contact_of(own, torque, w, i)
        elif form == tiles.GAPS:
            gone = backlash_batch.gone(own, torque, drive, Vector(q, w, 0.0, T_w, T_h, q_m, w_m), int(mesh), wiper, x,
                                       tile.hung.tolerance[j])
            T_w, T_h = gone.y.T_w, gone.y.T_h
            q, w, wiper, contact = gone.y.q, gone.y.w, gone.wiper, gone.mode.contact
            q_m, w_m, mesh, done = gone.y.q_m, gone.y.w_m, float(gone.mode.mesh), gone.done
        elif form == tiles.STRIDES:
            to, wiper, done = rk_batch.seen(slack, drive, x, q, w, wiper, more, tile, plan, j)
            q, w, T_w, T_h = to.q, to.w, to.T_w, to.T_h
            start = rk_steps.way_from_rest(own, drive * own.source.V, torque, to)
            contact = contact_of(tile.hung.dry[j] > 0.0, start, w)
        else:
            contact = FREE
        plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0
        if mesh == RIGID:
            q_m, w_m = q, w
        _write_more(lane, o, i, T_w, T_h, q_m, w_m, int(mesh), outputs)
    else:
        numbers = tiles.arc_numbers_at(tile.arc, j)
        if form == tiles.BANDS:
            begins = piecewise_segments.Starts(numbers.start_forward, numbers.start_backward, numbers.start_off)
            q, w, turned, done = piecewise_segments.slide(
                tiles.numbers_at(tile.own, j), tile.hung.torque[j], begins, drive, q, w, x, tile.hung.tolerance[j])
            plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0
        else:
            q, w, turned, _ = linear_segments.slide(numbers, drive, q, w, x)
        wiper = tiles.dragged(tile.hung.half_slack[j], wiper, turned, q)
        contact = contact_of(tile.hung.dry[j] > 0.0, linear_segments.start_of(numbers, drive), w)
        _write_more(lane, o, 0.0, tile.servo.T_w[j], tile.servo.T_h[j], q, w, RIGID, outputs)
    if outputs.wiper.size > 0:
        outputs.wiper[lane, o] = wiper if slack else q
    if outputs.angle.size > 0:
        outputs.angle[lane, o] = q
    if outputs.speed.size > 0:
        outputs.speed[lane, o] = w
    if outputs.contact.size > 0:
        outputs.contact[lane, o] = contact
    if outputs.drive.size > 0:
        outputs.drive[lane, o] = 1 if drive > 0.0 else (-1 if drive < 0.0 else 0)
    if outputs.error.size > 0:
        outputs.error[lane, o] = plan.error_before[j] if phase < 2 else tile.servo.error[j]


def _write_more(lane: int, o: int, i: float, T_w: float, T_h: float, q_m: float, w_m: float, mesh: int,
                outputs: Outputs) -> None:
    if outputs.current.size > 0:
        outputs.current[lane, o] = i
    if outputs.winding.size > 0:
        outputs.winding[lane, o] = T_w
    if outputs.housing.size > 0:
        outputs.housing[lane, o] = T_h
    if outputs.motor_angle.size > 0:
        outputs.motor_angle[lane, o] = q_m
    if outputs.motor_speed.size > 0:
        outputs.motor_speed[lane, o] = w_m
    if outputs.mesh.size > 0:
        outputs.mesh[lane, o] = mesh


def _phase_at(x: float, plan: Any, j: int) -> int:
    """Return the phase that holds an instant of a window; what happens at its very end is not yet so."""
    end = plan.window[j]
    if plan.decides[j] > 0.0 and plan.end2[j] <= x and plan.end2[j] < end:
        return 3 if plan.end3[j] <= x and plan.end3[j] < end else 2
    return 1 if plan.end1[j] <= x and plan.end1[j] < end else 0


def contact_of(dry: bool, start: float, w: float) -> int:
    """Return the contact of a shaft that has this speed [rad/s], and starts that way from rest: −1, 0, +1."""
    if not dry:
        return FREE
    way = w if w != 0.0 else start
    if way == 0.0:
        return STUCK
    return FORWARD if way > 0.0 else BACKWARD
