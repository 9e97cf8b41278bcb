"""From event to event: how a servo gets from one instant to the next, and one servo's whole run without a record.

The state is kept at the *anchor*, where the present motion began, and everything is evaluated from there. So the
result depends neither on the output times nor on how a run is split.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.kernels import armature, events, frame, hybrid, motion
from servotwin.models.kernels.frame import Chip, Frame
from servotwin.models.kernels.motion import Motion
from servotwin.models.kernels.plant import Mode, Plant, Vector
from servotwin.physics.pieces import Piece, piece_rate, piece_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

FIRST_STEP = 1e-4  # s, the first that the integrator tries
MOST_IDLE = 200  # events without time going on
_MOST_OSCILLATIONS = 1e7  # within one motion

# How a walk ends; the members of simulation.Status carry the same numbers.
COMPLETED, DIVERGED, STEP_TOO_SMALL, CHATTER, TOO_FAST, CROWDED = range(6)


class Point(NamedTuple):
    """Where a servo stands, and where its present motion began."""

    time: float
    y: Vector
    mode: Mode
    anchor_time: float
    anchor: Vector
    step: float  # length that the integrator would try next
    wiper: float  # angle of the potentiometer, which may lag behind the shaft


def started(y: Vector, mesh: int) -> Point:
    """Return the point of a servo at t = 0, in no mode yet."""
    return Point(0.0, y, Mode(0, 0, mesh, 0), -1.0, y, FIRST_STEP, y[0])


def anchored(plant: Plant, u: Piece, tau: Piece, time: float, point: Point) -> Point:
    """Return a point whose motion begins now, under inputs that are new."""
    y, v = point.y, piece_value(u, time)
    zone = armature.zone_of(hybrid.warm(plant, y), v, piece_rate(u, time), y[0], y[6], y[2])
    mode = hybrid.settled(plant, zone, v, piece_value(tau, time), y, point.mode.mesh, in_one_piece(plant, u))
    return Point(time, y, mode, time, y, point.step, point.wiper)


def in_one_piece(plant: Plant, u: Piece) -> bool:
    """Tell whether a smoothed friction is integrated throughout: where no part of it would be linear."""
    return plant.kappa > 0.0 and (plant.L > 0.0 or plant.gravity != 0.0 or u.sweep != 0.0)


def motion_of(plant: Plant, point: Point, u: Piece, tau: Piece, limit: float) -> Motion:
    """Return the motion that a point is in; an integrator step ends at `limit` [s] at the latest."""
    return motion.begin(plant, point.mode, u, tau, point.anchor_time, point.anchor, point.step,
                        limit - point.anchor_time)


def follow(m: Motion, point: Point, horizon: float) -> tuple[Point, int, int]:
    """Follow a motion to its first event, its end or the horizon [s]; return also the event (−1: none) and a status."""
    t0 = m.t0
    step_end = t0 + m.length
    if abs(step_end - horizon) <= 4e-16 * abs(horizon):
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


def source(plant: Plant, chip_frame: Frame) -> Piece:
    """Return the voltage behind the bridge, the input of a plant with a bridge."""
    return Piece(0.0, chip_frame.drive * plant.V, 0.0, 0.0, 0.0, 0.0, 0.0)


def voltages(plant: Plant, chip: Chip, u: float, y: Vector) -> tuple[float, float]:
    """Return the voltages at the motor's terminals and of the bus [V], for the voltage u behind the bridge."""
    plant = hybrid.warm(plant, y)
    w, i, coasts = y[6], y[2], chip.coast > 0.0
    zone = armature.zone_of(plant, u, 0.0, y[0], w, i)
    if plant.L == 0.0:
        i = armature.current(plant, zone, u, y[0], w)
    V_bus = armature.bus_voltage(plant, zone, u, w, i, coasts)
    return armature.terminal_voltage(plant, chip.V_br, u, w, i, V_bus, coasts), V_bus


def measured(plant: Plant, chip: Chip, curve: Sequence[Sequence[float]] | NDArray[np.float64], chip_frame: Frame,
             point: Point, t_in: float, seed: int) -> Frame:
    """Return the frame state after the edge of a pulse of the width t_in that meets the servo at a point."""
    v_m, V_bus = voltages(plant, chip, chip_frame.drive * plant.V, point.y)
    v_o = frame.feedback_voltage(chip, curve, point.wiper)
    return frame.edge(chip, chip_frame, point.time, t_in, v_o, v_m, V_bus, seed)


def walk(pulsed: bool, plant: Plant, chip: Chip, curve: NDArray[np.float64], command: NDArray[np.float64],
         torque: NDArray[np.float64], constant_torque: float, period: float, edges: NDArray[np.float64], start: Point,
         seed: int, duration: float, times: NDArray[np.float64], outputs: NDArray[np.float64],
         final: NDArray[np.float64]) -> tuple[int, float]:
    """Run one servo from t = 0 to `duration` [s]; return a status and when it ended [s].

    `command` and `torque` are tables of pieces, one a row (no row: no torque). Frames start at `edges` [s], or every
    `period` where that is not 0. What stands at `times` goes into `outputs`, shape (13, n): angle, speed, contact,
    drive, error, and what only few servos have: current, temperatures of winding and housing, angle and speed of the
    motor at the output shaft, angle of the potentiometer, place in the play and contact of the motor there. Angle,
    speed and temperatures at the end go into `final`. Both are left as they were after a failure.
    """
    point = start
    now = frame.AT_START
    k_command = k_torque = done = idle = 0
    u, tau = _row(command, 0, 0.0), _row(torque, -1, constant_torque)
    u_end, tau_end = _end(command, 0), -math.inf
    if pulsed:
        u = source(plant, now)
    m = motion.nothing(plant, u, tau)
    while point.time < duration:
        t = point.time
        new = point.anchor_time < 0.0
        if t >= tau_end:
            while t >= _end(torque, k_torque):
                k_torque += 1
            tau, tau_end, new = _row(torque, k_torque, constant_torque), _end(torque, k_torque), True
        if not pulsed and (new or t >= u_end):
            while t >= _end(command, k_command):
                k_command += 1
            u, u_end, new = _row(command, k_command, 0.0), _end(command, k_command), True
        if pulsed:
            if frame.next_switch(now) <= t:
                now = frame.switched(now, t)
            if frame.edge_time(period, edges, now.number) <= t:
                while t >= _end(command, k_command):
                    k_command += 1
                t_in = piece_value(_row(command, k_command, 0.0), t)
                now = measured(plant, chip, curve, now, point, t_in, seed)
                if now.number == frame.CROWDED:
                    return CROWDED, t
            u_end = min(frame.next_switch(now), frame.edge_time(period, edges, now.number))
            if new or u.value != now.drive * plant.V:
                u, new = source(plant, now), True
        limit = min(u_end, tau_end)
        if new:
            point = anchored(plant, u, tau, t, point)
        if new or motion.is_step(m) or m.t0 != point.anchor_time or m.mode != point.mode:
            m = motion_of(plant, point, u, tau, limit)
        if m.kind == motion.IMPOSSIBLE:
            return STEP_TOO_SMALL, t
        wiper = point.wiper
        point, _, status = follow(m, point, min(limit, duration))
        if status != COMPLETED:
            return status, t
        idle = idle + 1 if point.time == t else 0
        if idle > MOST_IDLE:
            return CHATTER, t
        while done < times.size and (times[done] < point.time or (point.time >= duration and times[done] <= duration)):
            m = motion.prepared(m)
            y = motion.state(m, times[done] - m.t0)
            outputs[0, done], outputs[1, done], outputs[2, done] = y[0], y[1], m.mode.contact
            outputs[3, done], outputs[4, done] = now.drive, now.error
            for k in range(5):
                outputs[5 + k, done] = y[2 + k]
            outputs[10, done] = frame.wiper_at(plant.half_slack, wiper, y[0])
            outputs[11, done], outputs[12, done] = m.mode.mesh, m.mode.motor
            done += 1
    final[0], final[1], final[2], final[3] = point.y[0], point.y[1], point.y[3], point.y[4]
    return COMPLETED, duration


def _row(table: NDArray[np.float64], k: int, offset: float) -> Piece:
    """Return a row of a table as a piece, moved by `offset`; the offset alone where there is no such row."""
    if k < 0 or k >= table.shape[0]:
        return Piece(0.0, offset, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Piece(table[k, 0], table[k, 1] + offset, table[k, 2], table[k, 3], table[k, 4], table[k, 5], table[k, 6])


def _end(table: NDArray[np.float64], k: int) -> float:
    """Return when the row after the k-th of a table takes over [s]."""
    return table[k + 1, 0] if k + 1 < table.shape[0] else math.inf
