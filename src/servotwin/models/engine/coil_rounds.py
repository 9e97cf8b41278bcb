"""How lanes whose current has inertia go through a phase: all lanes together, leg by leg."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine import arcs, coils, tiles
from servotwin.models.engine.coils import Circuit
from servotwin.models.engine.modes import NO_CURRENT, sign_of
from servotwin.models.terms.numbers import Numbers


def begin(size: int, tile: Any) -> None:
    """Keep the currents of all lanes as they are before a window."""
    for j in range(size):
        tile.coil.before[j] = tile.coil.i[j]


def keep_one(phase: int, tile: Any, j: int) -> None:
    """Keep the current of a lane at the start of a phase."""
    if phase == 0:
        tile.coil.i1[j] = tile.coil.i[j]
    elif phase == 1:
        tile.coil.i2[j] = tile.coil.i[j]
    elif phase == 2:
        tile.coil.i3[j] = tile.coil.i[j]
    else:
        tile.coil.i4[j] = tile.coil.i[j]


def kept(phase: int, tile: Any, j: int) -> float:
    """Return the current of a lane at the start of a phase, where it was kept."""
    rows = tile.coil
    i: float = rows.i1[j] if phase == 0 else rows.i2[j] if phase == 1 else rows.i3[j] if phase == 2 else rows.i4[j]
    return i


def phase(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive; `slack` where potentiometers have play."""
    for j in range(size):
        _enter(tiles.numbers_at(tile.own, j), tile, plan, j)
    going = 0
    for j in range(size):
        going += 1 if plan.time[j] > 0.0 else 0
    if going == 0:
        return
    for j in range(size):
        _glide(tiles.numbers_at(tile.own, j), _circuit_at(tile, plan, j), tile, plan, j)
    if slack:
        for j in range(size):
            tiles.drag(tile, tile.servo.q[j], j)
    ending = 0
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    if ending > 0:
        for j in range(size):
            if plan.ends[j] > 0.0:
                _go_on(tile, plan, j)


def alone(tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    _enter(tiles.numbers_at(tile.own, j), tile, plan, j)
    if plan.time[j] > 0.0:
        _go_on(tile, plan, j)


def _enter(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Find zone and way that a lane begins in, and take away the time of one in which nothing moves or flows."""
    power, w, i = plan.power[j], tile.servo.w[j], tile.coil.i[j]
    zone, way = coils.entered(numbers, tile.hung.torque[j], power * numbers.source.V, w, i)
    moves = w != 0.0 or way != 0.0 or i != 0.0 or (power != 0.0 and zone != NO_CURRENT)
    plan.way[j] = way
    tile.count.zone[j] = zone
    plan.time[j] = plan.time[j] if moves else 0.0


def _circuit_at(tile: Any, plan: Any, j: int) -> Circuit:
    """Return the circuit of a lane, chosen number by number: so all lanes can choose at once."""
    own, drives = tiles.winding_at(tile.winding, j), plan.power[j] != 0.0
    return Circuit(
        own.drive.R if drives else own.off.R, own.drive.rate if drives else own.off.rate,
        own.drive.per_rate if drives else own.off.per_rate, own.drive.damping if drives else own.off.damping,
        own.drive.product if drives else own.off.product, own.drive.slow if drives else own.off.slow,
        own.drive.per_slow if drives else own.off.per_slow, own.drive.fast if drives else own.off.fast,
        own.drive.per_fast if drives else own.off.per_fast, own.drive.apart if drives else own.off.apart)


def _glide(numbers: Numbers, circuit: Circuit, tile: Any, plan: Any, j: int) -> None:
    """Move a lane to the end of its time if that lies in one leg; otherwise mark it."""
    time, way, zone, u = plan.time[j], plan.way[j], tile.count.zone[j], plan.power[j] * numbers.source.V
    torque, q, w, i = tile.hung.torque[j], tile.servo.q[j], tile.servo.w[j], tile.coil.i[j]
    rests = way == 0.0
    arc = coils.held_arc(numbers, circuit, torque, u, zone, i)
    held = coils.held_current(circuit, arc, i, time)
    x = coils.flow(numbers, circuit, torque, u, zone, way, w, i)
    to = coils.slid(circuit, x, coils.course(circuit, time), way, sign_of(zone), q, time)
    inside = tile.arc.lower[j] < to.q < tile.arc.upper[j]
    slides = zone != NO_CURRENT and circuit.apart > 0.0 and inside and not to.ends
    goes = not arcs.reaches_edge(arc, held) if rests else slides
    moves = time > 0.0
    plan.ends[j] = 1.0 if moves and not goes else 0.0
    tile.servo.q[j] = to.q if moves and goes and not rests else q
    tile.servo.w[j] = to.w if moves and goes and not rests else w
    tile.coil.i[j] = (held if rests else to.i) if moves and goes else i


def _go_on(tile: Any, plan: Any, j: int) -> None:
    """Move one lane to the end of its time, leg by leg."""
    q, w, i, wiper, done = coils.onward(
        tiles.numbers_at(tile.own, j), tiles.winding_at(tile.winding, j), tile.hung.torque[j], plan.power[j],
        tile.count.zone[j], plan.way[j], tile.servo.q[j], tile.servo.w[j], tile.coil.i[j], tile.servo.wiper[j],
        plan.time[j])
    tile.servo.q[j] = q
    tile.servo.w[j] = w
    tile.coil.i[j] = i
    tile.servo.wiper[j] = wiper
    plan.lost[j] = plan.lost[j] if done > 0.0 else 1.0
