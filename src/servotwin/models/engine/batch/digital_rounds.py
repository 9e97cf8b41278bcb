"""How digital servos go through a tick, all lanes of a tile in one formula.

Between two ticks the duty is constant, so that a shaft goes through one arc, or through two where it comes to rest in
between. What is near a limit is marked for a lane to decide alone.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.batch import digital_tiles
from servotwin.models.engine.batch.digital_tiles import (
    Body,
    body_at,
    firmware_at,
    path_at,
    piece_at,
    sensor_at,
    supply_at,
)
from servotwin.models.engine.batch.linear_segments import starting, way_to_edge
from servotwin.models.engine.memory import FRAMES, SAME
from servotwin.models.engine.motions.elementary import decay, fma
from servotwin.models.state.modes import CONDUCTING
from servotwin.models.terms import bridge, control, duty
from servotwin.models.terms.bridge import Bridge
from servotwin.models.terms.duty import OPEN
from servotwin.models.terms.shaft import accelerated
from servotwin.models.terms.source import Source
from servotwin.physics.firmware import counted, duty_of
from servotwin.physics.motor import back_emf, steady_armature_current
from servotwin.physics.pieces import piece_value
from servotwin.physics.potentiometer import feedback_voltage

_CLOSE = 0.99  # of a limit: so near to it a lane decides alone


class Arc(NamedTuple):
    """A stretch in which a shaft moves one way: from where it is to where it comes at the end of its time."""

    q: float
    w: float
    way: float
    rate: float
    pull: float
    ends: bool  # it comes to rest before


def any_senses(tile: Any, size: int) -> bool:
    """Tell whether a program looks at currents or voltages."""
    found = False
    for j in range(size):
        found = found or control.senses(firmware_at(tile.program, j))
    return found


def asked(tile: Any, size: int) -> tuple[int, int, int]:
    """Return how many lanes go on, of how many a command may have come, and of how many the goal moves."""
    going = news = following = 0
    for j in range(size):
        going += 1 if tile.clock.left[j] > 0.0 else 0
        news += 1 if tile.clock.tick[j] >= tile.clock.hears[j] else 0
        following += 1 if tile.clock.follows[j] > 0.0 else 0
    return going, news, following


def with_outputs(tile: Any, size: int) -> int:
    """Return how many lanes have outputs in this tick."""
    wanted = 0
    for j in range(size):
        wanted += 1 if is_wanted(tile, j) else 0
    return wanted


def is_wanted(tile: Any, j: int) -> bool:
    """Tell whether the next output of a lane lies in this tick; at its end only where the call ends too."""
    clock = tile.clock
    over = clock.last[j] > 0.0 and clock.left[j] <= 1.0 and clock.output[j] < math.inf
    return bool(clock.left[j] > 0.0 and tile.plan.lost[j] == 0.0 and (
        over or clock.output[j] < clock.tick[j] + 1.0 - SAME))


def follow(tile: Any, size: int) -> None:
    """Let the programs of all lanes whose goal moves take it."""
    loop, clock = tile.loop, tile.clock
    for j in range(size):
        firmware, piece = firmware_at(tile.program, j), piece_at(tile.piece, j)
        goal, written, heard = loop.goal[j], loop.written[j], loop.heard[j]
        time = (float(tile.place.frames[j]) + clock.tick[j]) * firmware.T_c + firmware.t_phi
        new = counted(piece_value(piece, time - firmware.latency), firmware.quantum)
        takes = clock.follows[j] > 0.0 and clock.left[j] > 0.0 and new != written
        loop.goal[j] = min(max(new, firmware.lower), firmware.upper) if takes else goal
        loop.written[j] = new if takes else written
        loop.heard[j] = time if takes else heard


def watch(tile: Any, size: int) -> None:
    """Mark the lanes in whose program no current and no voltage plays a part."""
    for j in range(size):
        firmware, body = firmware_at(tile.program, j), body_at(tile.body, j)
        d = tile.loop.coming[j] if tile.plan.delayed[j] > 0.0 else tile.loop.duty[j]
        source = supply_at(tile.supply, j)
        path, supply = duty.at(path_at(tile.path, j), body.motor, source, d)
        v, R = bridge.loop(path, supply, CONDUCTING, duty.voltage(supply, d))
        i = steady_armature_current(v, tile.loop.w[j], R, body.motor.K_b)
        V_bus = source.V - source.R_b * abs(d * i)
        calm = abs(i) < _CLOSE * firmware.trip_current and V_bus * _CLOSE > firmware.undervoltage and abs(d) <= 1.0
        tile.plan.usual[j] = 1.0 if calm else 0.0
        tile.plan.V_bus[j] = V_bus


def decide(tile: Any, size: int) -> int:
    """Let the programs of all lanes decide; return how many have to do so alone."""
    loop, plan, clock, frames = tile.loop, tile.plan, tile.clock, tile.place.frames
    for j in range(size):
        firmware, sensor, motor = firmware_at(tile.program, j), sensor_at(tile.sensor, j), body_at(tile.body, j).motor
        q = loop.q[j]
        angle = (feedback_voltage(q, sensor.p, sensor.b_o) - firmware.b_o) * firmware.per_volt
        y = control.filtered(firmware, loop.y[j], counted(angle if firmware.per_volt != 0.0 else q, firmware.quantum))
        z = control.beyond_zone(firmware, loop.goal[j], y)
        x = -y if firmware.of_measurement > 0.0 else z
        renews = loop.renewal[j] <= 1.0
        derives = renews and firmware.k_d != 0.0
        D = control.derivative(firmware, x - loop.x[j]) if derives else loop.D[j]
        u, w = control.limited(firmware, duty_of(firmware.k_p, z, firmware.delta) + D)
        d = control.within(firmware, w, firmware.duty_limit, loop.decided[j])
        voltage = abs(d * plan.V_bus[j] - back_emf(loop.w[j], motor.K_b))
        limited = firmware.I_m < math.inf and voltage > _CLOSE * firmware.I_m * (
            tile.path.R_drive[j] - tile.supply.R_b[j])
        usual = (plan.usual[j] > 0.0 and loop.calm[j] > 0.0 and plan.alone[j] == 0.0 and not limited
                 and abs(w) <= _CLOSE * firmware.overload_duty
                 and (frames[j] + clock.tick[j]) * firmware.T_c + firmware.t_phi - loop.heard[j] < (
                     firmware.timeout - firmware.T_c))
        goes = usual and clock.left[j] > 0.0
        plan.usual[j] = 1.0 if usual else 0.0
        plan.given[j] = d
        loop.resting[j] = (1.0 if control.rests(firmware, y - loop.y_then[j]) else 0.0) if goes and renews else (
            loop.resting[j])
        loop.y_then[j] = y if goes and renews else loop.y_then[j]
        loop.y[j] = y if goes else loop.y[j]
        loop.x[j] = x if goes and derives else loop.x[j]
        loop.D[j] = D if goes else loop.D[j]
        loop.excess[j] = u - w if goes else loop.excess[j]
        loop.decided[j] = d if goes else loop.decided[j]
        loop.age[j] = loop.age[j] + 1.0 if goes else loop.age[j]
        loop.renewal[j] = (firmware.m if renews else loop.renewal[j] - 1.0) if goes else loop.renewal[j]
    alone = 0
    for j in range(size):
        alone += 1 if plan.usual[j] == 0.0 else 0
    return alone


def move(tile: Any, size: int) -> int:
    """Put the duties on the bridges and move all lanes through the tick; return how many have a rest in it."""
    loop, plan, clock = tile.loop, tile.plan, tile.clock
    for j in range(size):
        coming, given, before, q, w = loop.coming[j], plan.given[j], loop.duty[j], loop.q[j], loop.w[j]
        goes, time = clock.left[j] > 0.0, tile.program.T_c[j]
        d = (coming if plan.delayed[j] > 0.0 else given) if goes else before
        loop.coming[j] = given if goes else coming
        loop.duty[j] = d
        body, path, supply = body_at(tile.body, j), path_at(tile.path, j), supply_at(tile.supply, j)
        arc = _arc(body, path, supply, d, q, w, time if goes else 0.0)
        moves = arc.way != 0.0 and not arc.ends and goes
        inside = body.lower < arc.q < body.upper
        blocked = d == OPEN and back_emf(max(abs(w), abs(arc.w)), body.motor.K_b) >= path.silence.D
        plan.q0[j], plan.w0[j] = q, w
        plan.way[j], plan.rate[j], plan.pull[j] = arc.way, arc.rate, arc.pull
        plan.ends[j] = 1.0 if arc.ends and goes else 0.0
        plan.lost[j] = 1.0 if (moves and not inside) or (blocked and goes) else 0.0
        loop.q[j] = arc.q if moves else q
        loop.w[j] = arc.w if moves else w
    ending = 0
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    return ending


def _arc(body: Body, path: Bridge, supply: Source, d: float, q: float, w: float, time: float) -> Arc:
    """Return how a shaft moves at a duty, from an angle and a speed on."""
    path, supply = duty.at(path, body.motor, supply, d)
    v, R = bridge.loop(path, supply, CONDUCTING, duty.voltage(supply, d))
    per_volt = 0.0 if d == OPEN else digital_tiles.torque_per_volt(body.motor, R)
    torque = per_volt * v - body.tau
    start = starting(body.hold_forward, body.hold_backward, torque)
    way = start if w == 0.0 else math.copysign(1.0, w)
    rate = digital_tiles.fading(body, per_volt)
    pull = accelerated(body.shaft, torque - (
        body.against_forward if way > 0.0 else body.against_backward))
    once, twice = decay(rate, 1.0 / rate if rate > 0.0 else 0.0, time)
    there = fma(-rate, w, pull)
    after = fma(there, once, w)
    ends = w * pull < 0.0 and w * after <= 0.0
    return Arc(fma(there, twice, fma(w, time, q)), after, way, rate, pull, ends)


def move_on(tile: Any, j: int) -> None:
    """Move a lane that comes to rest within the tick through all of it."""
    q, w, _ = seen(tile, j, tile.program.T_c[j])
    tile.loop.q[j], tile.loop.w[j] = q, w
    inside = tile.body.lower[j] < q < tile.body.upper[j]
    tile.plan.lost[j] = tile.plan.lost[j] if inside else 1.0


def seen(tile: Any, j: int, time: float) -> tuple[float, float, float]:
    """Return angle and speed of a lane after a part of its tick [s], and which way it moves."""
    plan, d = tile.plan, tile.loop.duty[j]
    body, path, supply = body_at(tile.body, j), path_at(tile.path, j), supply_at(tile.supply, j)
    q, w, rate, pull = plan.q0[j], plan.w0[j], plan.rate[j], plan.pull[j]
    if plan.way[j] == 0.0:
        return q, w, 0.0
    if plan.ends[j] > 0.0:
        t, turn = way_to_edge(w, 0.0, pull, rate, 1.0 / rate if rate > 0.0 else 0.0)
        if t < time:
            arc = _arc(body, path, supply, d, q + turn, 0.0, time - t)
            return (arc.q, arc.w, arc.way) if arc.way != 0.0 else (q + turn, 0.0, 0.0)
    arc = _arc(body, path, supply, d, q, w, time)
    return arc.q, arc.w, arc.way


def tick_over(tile: Any, size: int) -> None:
    """End a tick; a lane that is lost stays at its beginning."""
    loop, plan, clock = tile.loop, tile.plan, tile.clock
    for j in range(size):
        lost, goes = plan.lost[j] > 0.0, clock.left[j] > 0.0
        loop.q[j] = plan.q0[j] if lost else loop.q[j]
        loop.w[j] = plan.w0[j] if lost else loop.w[j]
        clock.last[j] = -1.0 if lost else clock.last[j]
        clock.left[j] = 0.0 if lost else max(clock.left[j] - 1.0, 0.0)
        clock.tick[j] += 1.0 if goes and not lost else 0.0
    late = 0
    for j in range(size):
        late += 1 if clock.tick[j] + tile.program.t_phi[j] / tile.program.T_c[j] >= FRAMES else 0
    if late > 0:
        for j in range(size):
            if clock.tick[j] + tile.program.t_phi[j] / tile.program.T_c[j] >= FRAMES:
                tile.place.frames[j] += FRAMES
                clock.tick[j] -= FRAMES
                clock.hears[j] -= FRAMES
                clock.output[j] -= FRAMES
