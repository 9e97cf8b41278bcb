"""The one step: a servo goes on from event to event, to the next one or to a given time.

Runs of one servo, lanes of many and servos on a bus all are loops over it. The state is kept at the *anchor*, where
the present motion began, and everything is evaluated from there. So the result depends neither on the output times
nor on how a run is split.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine import events, hybrid, motion
from servotwin.models.engine.memory import SAME, Inputs, Memory, Point, edge_of, in_force, origin_of, since
from servotwin.models.engine.motion import Motion
from servotwin.models.terms import armature, frame
from servotwin.models.terms.frame import Chip, Frame
from servotwin.models.terms.plant import Plant, Vector
from servotwin.physics.pieces import Piece, piece_rate, piece_value

MOST_IDLE = 200  # events without time going on
_MOST_OSCILLATIONS = 1e7  # within one motion

# How a step ends; the members of simulation.Status carry the same numbers.
COMPLETED, DIVERGED, STEP_TOO_SMALL, CHATTER, TOO_FAST, CROWDED = range(6)


class Stepped(NamedTuple):
    """What a step leaves: the memory, the motion on which it went, the event that ended it (−1: none), a status."""

    memory: Memory
    motion: Motion
    event: int
    status: int


def step(plant: Plant, chip: Chip, inputs: Inputs, memory: Memory, m: Motion, until: float) -> Stepped:
    """Go on to the next event, or to `until` at the latest, by the times of the memory [s].

    `m` is the motion of the step before, or `motion.nothing`.
    """
    frames, beat, point, now, u, u_end, tau, tau_end = memory
    origin, t = origin_of(memory), point.time
    new = point.anchor_time == math.inf
    if t >= tau_end:
        tau, tau_end = in_force(inputs.torque, origin, t, inputs.constant_torque)
        new = True
    if chip.frame_period > 0.0:
        if frame.next_switch(now) <= t:
            now = frame.switched(now, t)
        if edge_of(inputs, memory, now.number) <= t:
            now = measured(plant, chip, inputs, now, point, pulse_width(inputs, memory))
            if now.number == frame.CROWDED:
                return Stepped(memory, m, -1, CROWDED)
        u_end = min(frame.next_switch(now), edge_of(inputs, memory, now.number))
        if new or u.value != now.drive * plant.V:
            u, new = source(plant, now), True
    elif t >= u_end:
        u, u_end = in_force(inputs.command, origin, t, 0.0)
        new = True
    local_u, local_tau = since(u, origin), since(tau, origin)
    if new:
        point = anchored(plant, local_u, local_tau, t, point)
        m = motion.nothing(plant, local_u, local_tau)
    point, m, event, status = onward(plant, point, local_u, local_tau, m, min(u_end, tau_end), until)
    return Stepped(Memory(frames, beat, point, now, u, u_end, tau, tau_end), m, event, status)


def onward(plant: Plant, point: Point, u: Piece, tau: Piece, m: Motion, limit: float,
           until: float) -> tuple[Point, Motion, int, int]:
    """Go on, under inputs that stay until `limit` [s], to the next event or to `until`.

    `m` is the motion so far, which is taken up again if it is still the right one. Return the point, the motion, the
    event (−1: none) and a status.
    """
    if motion.is_step(m) or m.t0 != point.anchor_time or m.mode != point.mode:
        m = motion.begin(plant, point.mode, u, tau, point.anchor_time, point.anchor, point.step,
                         limit - point.anchor_time)
    if m.kind == motion.IMPOSSIBLE:
        return point, m, -1, STEP_TOO_SMALL
    point, event, status = follow(m, point, min(limit, until))
    return point, m, event, status


def pulse_width(inputs: Inputs, memory: Memory) -> float:
    """Return the width [s] of the pulse that begins now."""
    origin, t = origin_of(memory), memory.point.time
    piece, _ = in_force(inputs.command, origin, t + SAME * memory.beat, 0.0)
    return piece_value(since(piece, origin), t)


def anchored(plant: Plant, u: Piece, tau: Piece, time: float, point: Point) -> Point:
    """Return a point whose motion begins now, under inputs that are new."""
    y, v = point.y, piece_value(u, time)
    zone = armature.zone_of(hybrid.warm(plant, y), v, piece_rate(u, time), y[0], y[6], y[2])
    mode = hybrid.settled(plant, zone, v, piece_value(tau, time), y, point.mode.mesh, in_one_piece(plant, u))
    return Point(time, y, mode, time, y, point.step, point.wiper)


def in_one_piece(plant: Plant, u: Piece) -> bool:
    """Tell whether a smoothed friction is integrated throughout: where no part of it would be linear."""
    return plant.kappa > 0.0 and (plant.L > 0.0 or plant.gravity != 0.0 or u.sweep != 0.0)


def follow(m: Motion, point: Point, horizon: float) -> tuple[Point, int, int]:
    """Follow a motion to its first event, its end or the horizon [s]; return also the event (−1: none) and a status."""
    t0 = m.t0
    step_end = t0 + m.length
    if abs(step_end - horizon) <= 4e-16 * (abs(t0) + abs(horizon)):
        step_end = horizon
    end = min(horizon, step_end)
    if m.kind == motion.SECOND_ORDER or m.kind == motion.WITH_CURRENT:
        fine, settled = motion.scales(m)
        if min(end - t0, settled) > _MOST_OSCILLATIONS * fine:
            return point, -1, TOO_FAST
    if motion.is_step(m) and (point.time > t0 or end < step_end):
        m = motion.prepared(m)
    v = piece_value(m.u, point.time)
    kinds = hybrid.guards(m.plant, m.mode, v, in_one_piece(m.plant, m.u))
    if motion.is_step(m):  # looked at as a whole, however a run is split
        s, kind = events.first_event(m, kinds, 0.0, m.length)
        kind = kind if s <= end - t0 else -1
    else:
        s, kind = events.first_event(m, kinds, point.time - t0, end - t0)
    if kind < 0:
        y = motion.state(m, end - t0)
        wiper = frame.wiper_at(m.plant.half_slack, point.wiper, y[0])
        if motion.is_step(m) and end == step_end:
            return Point(end, y, m.mode, end, y, m.next_step, wiper), -1, status_of(y)
        return Point(end, y, m.mode, t0, point.anchor, point.step, wiper), -1, status_of(y)
    t = min(max(t0 + s, point.time), end)
    before = motion.state(motion.prepared(m), s)
    wiper = frame.wiper_at(m.plant.half_slack, point.wiper, before[0])
    after, y = hybrid.cross(m.plant, m.mode, kind, piece_value(m.u, t), piece_value(m.tau, t), before)
    return Point(t, y, after, t, y, point.step, wiper), kind, status_of(y)


def status_of(y: Vector) -> int:
    """Tell whether a state is finite, as a code."""
    total = y[0] + y[1] + y[2] + y[3] + y[4] + y[5] + y[6]
    return COMPLETED if math.isfinite(total) else DIVERGED


def source(plant: Plant, now: Frame) -> Piece:
    """Return the voltage behind the bridge, the input of a plant with a bridge."""
    return Piece(0.0, now.drive * plant.V, 0.0, 0.0, 0.0, 0.0, 0.0)


def voltages(plant: Plant, chip: Chip, u: float, y: Vector) -> tuple[float, float]:
    """Return the voltages at the motor's terminals and of the bus [V], for the voltage u behind the bridge."""
    plant = hybrid.warm(plant, y)
    w, i, coasts = y[6], y[2], chip.coast > 0.0
    zone = armature.zone_of(plant, u, 0.0, y[0], w, i)
    if plant.L == 0.0:
        i = armature.current(plant, zone, u, y[0], w)
    V_bus = armature.bus_voltage(plant, zone, u, w, i, coasts)
    return armature.terminal_voltage(plant, chip.V_br, u, w, i, V_bus, coasts), V_bus


def measured(plant: Plant, chip: Chip, inputs: Inputs, now: Frame, point: Point, t_in: float) -> Frame:
    """Return the frame state after the edge of a pulse of the width t_in that meets the servo at a point."""
    v_m, V_bus = voltages(plant, chip, now.drive * plant.V, point.y)
    v_o = frame.feedback_voltage(chip, inputs.curve, point.wiper)
    return frame.edge(chip, now, point.time, t_in, v_o, v_m, V_bus, inputs.seed)
