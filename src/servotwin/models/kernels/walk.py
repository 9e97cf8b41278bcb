"""From event to event: how a servo gets from one instant to the next, and one servo's whole run without a record.

The state is kept at the *anchor*, where the present motion began, and everything is evaluated from there. So the
result depends neither on the output times nor on how a run is split.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.kernels import events, frame, hybrid, motion
from servotwin.models.kernels.frame import Chip, Frame
from servotwin.models.kernels.hybrid import Mode, Plant
from servotwin.models.kernels.motion import Motion
from servotwin.models.kernels.rodas import Vector
from servotwin.physics.pieces import Piece, piece_rate, piece_value

if TYPE_CHECKING:
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
    y: Vector  # angle, speed, current
    mode: Mode
    anchor_time: float
    anchor: Vector
    step: float  # length that the integrator would try next


def anchored(plant: Plant, u: Piece, tau: Piece, time: float, y: Vector, step: float) -> Point:
    """Return a point whose motion begins now, under inputs that are new."""
    q, w, i = y
    v = piece_value(u, time)
    zone = hybrid.zone_of(plant, v, piece_rate(u, time), q, w)
    contact = hybrid.contact_of(plant, zone, v, piece_value(tau, time), q, w, i, in_one_piece(plant, u))
    return Point(time, y, Mode(zone, contact), time, y, step)


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
    v = piece_value(m.u, point.time)
    kinds = hybrid.guards(m.plant, m.mode, v, in_one_piece(m.plant, m.u))
    s, kind = events.first_event(m, kinds, point.time - t0, end - t0)
    if kind < 0:
        y = motion.state(m, end - t0)
        if m.kind == motion.STEP and end == step_end:
            return Point(end, y, m.mode, end, y, m.next_step), -1, _status(y)
        return Point(end, y, m.mode, t0, point.anchor, point.step), -1, _status(y)
    t = min(max(t0 + s, point.time), end)
    q, w, i = motion.state(m, s)
    after, q, w = hybrid.cross(m.plant, m.mode, kind, piece_value(m.u, t), piece_value(m.tau, t), q, w, i)
    y = (q, w, i)
    return Point(t, y, after, t, y, point.step), kind, _status(y)


def _status(y: Vector) -> int:
    q, w, i = y
    return COMPLETED if math.isfinite(q) and math.isfinite(w) and math.isfinite(i) else DIVERGED


def source(plant: Plant, chip_frame: Frame) -> Piece:
    """Return the voltage behind the bridge, the input of a plant with a bridge."""
    return Piece(0.0, chip_frame.drive * plant.V, 0.0, 0.0, 0.0, 0.0, 0.0)


def measured(plant: Plant, chip: Chip, chip_frame: Frame, time: float, t_in: float, y: Vector, seed: int) -> Frame:
    """Return the frame state after the edge of a pulse of the width t_in that meets the shaft at y."""
    q, w, _ = y
    u = chip_frame.drive * plant.V
    i = hybrid.current(plant, hybrid.zone_of(plant, u, 0.0, q, w), u, q, w)
    return frame.edge(chip, chip_frame, time, t_in, q, plant.K_b * w, i, seed)


def walk(pulsed: bool, plant: Plant, chip: Chip, command: NDArray[np.float64], torque: NDArray[np.float64],
         constant_torque: float, period: float, edges: NDArray[np.float64], q: float, w: float, seed: int,
         duration: float, times: NDArray[np.float64], outputs: NDArray[np.float64]) -> tuple[int, float]:
    """Run one servo from t = 0 to `duration` [s]; return a status and when it ended [s].

    `command` and `torque` are tables of pieces, one a row (no row: no torque). Frames start at `edges` [s], or every
    `period` where that is not 0. What stands at `times` goes into `outputs`, shape (5, n): angle, speed, contact,
    drive and error; it is left as it was after a failure.
    """
    y = (q, w, 0.0)
    now = frame.AT_START
    k_command = k_torque = done = idle = 0
    u, tau = _row(command, 0, 0.0), _row(torque, -1, constant_torque)
    u_end, tau_end = _end(command, 0), -math.inf
    if pulsed:
        u = source(plant, now)
    m = motion.nothing(plant, u, tau)
    point = Point(0.0, y, m.mode, -1.0, y, FIRST_STEP)
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
                now = measured(plant, chip, now, t, t_in, point.y, seed)
                if now.number == frame.CROWDED:
                    return CROWDED, t
            u_end = min(frame.next_switch(now), frame.edge_time(period, edges, now.number))
            if new or u.value != now.drive * plant.V:
                u, new = source(plant, now), True
        limit = min(u_end, tau_end)
        if new:
            point = anchored(plant, u, tau, t, point.y, point.step)
        if new or m.kind == motion.STEP or m.t0 != point.anchor_time or m.mode != point.mode:
            m = motion_of(plant, point, u, tau, limit)
        if m.kind == motion.IMPOSSIBLE:
            return STEP_TOO_SMALL, t
        point, _, status = follow(m, point, min(limit, duration))
        if status != COMPLETED:
            return status, t
        idle = idle + 1 if point.time == t else 0
        if idle > MOST_IDLE:
            return CHATTER, t
        while done < times.size and (times[done] < point.time or (point.time >= duration and times[done] <= duration)):
            if m.kind == motion.STEP:
                m = motion.prepared(m)
            y = motion.state(m, times[done] - m.t0)
            outputs[0, done], outputs[1, done], outputs[2, done] = y[0], y[1], m.mode.contact
            outputs[3, done], outputs[4, done] = now.drive, now.error
            done += 1
    return COMPLETED, duration


def _row(table: NDArray[np.float64], k: int, offset: float) -> Piece:
    """Return a row of a table as a piece, moved by `offset`; the offset alone where there is no such row."""
    if k < 0 or k >= table.shape[0]:
        return Piece(0.0, offset, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Piece(table[k, 0], table[k, 1] + offset, table[k, 2], table[k, 3], table[k, 4], table[k, 5], table[k, 6])


def _end(table: NDArray[np.float64], k: int) -> float:
    """Return when the row after the k-th of a table takes over [s]."""
    return table[k + 1, 0] if k + 1 < table.shape[0] else math.inf
