"""How lanes whose current has inertia go through a phase: in one leg all together; more legs each lane goes alone."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.batch.segments import inductive_segments, inductive_shares, linear_segments
from servotwin.models.engine.batch.segments.inductive_segments import Circuit, Course, Went
from servotwin.models.state.modes import NO_CURRENT, sign_of
from servotwin.models.terms.friction import shared
from servotwin.models.terms.numbers import Numbers


def phase(size: int, slack: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive; `slack` where potentiometers have play."""
    for j in range(size):
        _enter(tiles.numbers_at(tile.own, j), tile, plan, j)
    for j in range(size):
        if plan.time[j] > 0.0 and shared(tiles.numbers_at(tile.own, j).friction):
            _go_on_by_share(tile, plan, j)
            plan.time[j] = 0.0
    going = 0
    for j in range(size):
        going += 1 if plan.time[j] > 0.0 else 0
    if going == 0:
        return
    _choose(size, tile, plan)
    for j in range(size):
        after = inductive_segments.course(tiles.circuit_at(tile.circuit, j), plan.time[j])
        tile.coil.g[j] = after.g
        tile.coil.once[j] = after.once
        tile.coil.twice[j] = after.twice
    for j in range(size):
        _glide(tiles.numbers_at(tile.own, j), tiles.circuit_at(tile.circuit, j), tile, plan, j)
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
        if shared(tiles.numbers_at(tile.own, j).friction):
            _go_on_by_share(tile, plan, j)
        else:
            _go_on(tile, plan, j)


def seen(torque: float, drive: float, q: float, w: float, i: float, wiper: float, time: float, tile: Any,
         j: int) -> Went:
    """Return where a lane is so much time [s] after it has been there and so."""
    numbers = tiles.numbers_at(tile.own, j)
    if shared(numbers.friction):
        return inductive_shares.through(numbers, torque, drive, q, w, i, wiper, time)
    return inductive_segments.through(numbers, tiles.winding_at(tile.winding, j), torque, drive, q, w, i, wiper, time)


def _enter(numbers: Numbers, tile: Any, plan: Any, j: int) -> None:
    """Find zone and way that a lane begins in, and take away the time of one in which nothing moves or flows."""
    power, w, i = plan.power[j], tile.servo.w[j], tile.servo.i[j]
    zone, way = inductive_segments.entered(numbers, tile.hung.torque[j], power * numbers.source.V, w, i)
    moves = w != 0.0 or way != 0.0 or i != 0.0 or (power != 0.0 and zone != NO_CURRENT)
    plan.way[j] = way
    tile.count.zone[j] = zone
    plan.time[j] = plan.time[j] if moves else 0.0


def _choose(size: int, tile: Any, plan: Any) -> None:
    """Choose the circuit of every lane, in two loops: a compiler loses sight of more rows at once."""
    drive, off, own = tile.winding.drive, tile.winding.off, tile.circuit
    for j in range(size):
        drives = plan.power[j] != 0.0
        own.R[j] = drive.R[j] if drives else off.R[j]
        own.rate[j] = drive.rate[j] if drives else off.rate[j]
        own.per_rate[j] = drive.per_rate[j] if drives else off.per_rate[j]
        own.damping[j] = drive.damping[j] if drives else off.damping[j]
        own.product[j] = drive.product[j] if drives else off.product[j]
    for j in range(size):
        drives = plan.power[j] != 0.0
        own.slow[j] = drive.slow[j] if drives else off.slow[j]
        own.per_slow[j] = drive.per_slow[j] if drives else off.per_slow[j]
        own.fast[j] = drive.fast[j] if drives else off.fast[j]
        own.per_fast[j] = drive.per_fast[j] if drives else off.per_fast[j]
        own.apart[j] = drive.apart[j] if drives else off.apart[j]  # what follows it is for lanes alone


def _glide(numbers: Numbers, circuit: Circuit, tile: Any, plan: Any, j: int) -> None:
    """Move a lane to the end of its time if that lies in one leg; otherwise mark it."""
    after = Course(tile.coil.g[j], tile.coil.once[j], tile.coil.twice[j])
    time, way, zone, u = plan.time[j], plan.way[j], tile.count.zone[j], plan.power[j] * numbers.source.V
    torque, q, w, i = tile.hung.torque[j], tile.servo.q[j], tile.servo.w[j], tile.servo.i[j]
    rests = way == 0.0
    x = inductive_segments.held(numbers, circuit, torque, u, zone, i)
    held = inductive_segments.held_current(x, i, time)
    start = inductive_segments.flow(numbers, circuit, torque, u, zone, way, w, i)
    to = inductive_segments.slid(circuit, start, after, way, sign_of(zone), q, time)
    inside = tile.arc.lower[j] < to.q < tile.arc.upper[j]
    slides = zone != NO_CURRENT and circuit.apart > 0.0 and inside and not to.ends
    goes = not linear_segments.reaches_edge(x.arc, held) if rests else slides
    moves = time > 0.0
    plan.ends[j] = 1.0 if moves and not goes else 0.0
    tile.servo.q[j] = to.q if moves and goes and not rests else q
    tile.servo.w[j] = to.w if moves and goes and not rests else w
    tile.servo.i[j] = (held if rests else to.i) if moves and goes else i


def _go_on(tile: Any, plan: Any, j: int) -> None:
    """Move one lane to the end of its time, leg by leg."""
    _put(inductive_segments.onward(
        tiles.numbers_at(tile.own, j), tiles.winding_at(tile.winding, j), tile.hung.torque[j], plan.power[j],
        tile.count.zone[j], plan.way[j], tile.servo.q[j], tile.servo.w[j], tile.servo.i[j], tile.servo.wiper[j],
        plan.time[j]), tile, plan, j)


def _go_on_by_share(tile: Any, plan: Any, j: int) -> None:
    """Move one lane whose friction follows the torques to the end of its time, leg by leg."""
    servo = tile.servo
    _put(inductive_shares.onward(
        tiles.numbers_at(tile.own, j), tile.hung.torque[j], plan.power[j], tile.count.zone[j], plan.way[j], servo.q[j],
        servo.w[j], servo.i[j], servo.wiper[j], plan.time[j]), tile, plan, j)


def _put(to: Went, tile: Any, plan: Any, j: int) -> None:
    """Put a lane where it has gone; one that gave up is for the general way."""
    tile.servo.q[j] = to.q
    tile.servo.w[j] = to.w
    tile.servo.i[j] = to.i
    tile.servo.wiper[j] = to.wiper
    plan.lost[j] = plan.lost[j] if to.done > 0.0 else 1.0
