"""The one step: a servo advances from event to event, to the next one or to a given time.

Runs of one servo, lanes of many and servos on a bus all are loops over it. The state is kept at the *anchor*, where
the present motion began, and everything is evaluated from there. So the result depends neither on the output times
nor on how a run is split.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin.models.engine import controller
from servotwin.models.engine.dynamics import currents, guards
from servotwin.models.engine.events import crossings, first_event
from servotwin.models.engine.memory import SAME, Inputs, Memory, Point, edge_of, in_force, origin_of, since
from servotwin.models.engine.motions import choice, motion
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.state.modes import CORE, UNIT, Vector
from servotwin.models.terms import bridge, duty, firmware, frame
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.frame import Chip, Frame
from servotwin.models.terms.frame import present as chip_present
from servotwin.models.terms.friction import smoothed
from servotwin.models.terms.load import swings
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import sensed_voltage, wiper_at
from servotwin.physics.pieces import Piece, piece_rate, piece_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

MOST_IDLE = 200  # events without time advancing
_MOST_OSCILLATIONS = 1e7  # within one motion

# How a step ends; the members of simulation.Status carry the same numbers.
COMPLETED, DIVERGED, STEP_TOO_SMALL, CHATTER, TOO_FAST, CROWDED, REFUSED = range(7)


def step(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, m: Motion,
         until: float) -> tuple[Memory, Motion, int, int]:
    """Advance to the next event, or to `until` at the latest, by the times of the memory [s].

    `m` is the motion of the step before, or `motion.nothing`. Return the memory, the motion on which it went, the
    event that ended it (−1: none), and a status.
    """
    frames, beat, point, now, u, u_end, tau, tau_end, _, firm = memory
    origin, t = frames * beat, point.time
    new = point.anchor_time == math.inf
    if t >= tau_end:
        tau, tau_end = in_force(inputs.torque, origin, t, inputs.constant_torque)
        new = True
    if firmware.present(inputs.firmware[0]):
        program = firm[0]
        before = program.duty
        controller.serve(numbers, inputs, program, frames, t, point.y, point.wiper, origin)
        u_end = controller.next_due(inputs.firmware[0], program, frames)
        numbers = duty.at_duty(numbers, program.duty)
        V = duty.voltage(numbers.source, program.duty)
        if new or program.duty != before or u.value != V:
            u, new = Piece(0.0, V, 0.0, 0.0, 0.0, 0.0, 0.0), True
    elif chip_present(chip):
        heeds, silent = bridge.heeds_silence(numbers.bridge), now.silent
        if frame.next_switch(now, heeds) <= t:
            now = frame.switched(now, t)
        edge = edge_of(inputs, memory, now.number)
        if edge <= t:
            met = at_pulses(numbers, now.silent) if heeds else numbers
            width = pulse_width(inputs, memory)
            now = measured(met, chip, inputs.curve, inputs.seed, now, t, point.y, point.wiper, width)
            if now.number == frame.CROWDED:
                return memory, m, -1, CROWDED
            edge = edge_of(inputs, memory, now.number)
        u_end = min(frame.next_switch(now, heeds), edge)
        if heeds:
            numbers = at_pulses(numbers, now.silent)
            new = new or silent != now.silent
        if new or u.value != now.drive * numbers.source.V:
            u, new = source(numbers, now), True
    elif t >= u_end:
        u, u_end = in_force(inputs.command, origin, t, 0.0)
        new = True
    local_u, local_tau = (since(u, origin), since(tau, origin)) if origin != 0.0 else (u, tau)
    if new:
        point = anchored(numbers, local_u, local_tau, t, point)
    point, m, event, status = onward(numbers, point, local_u, local_tau, m, new, min(u_end, tau_end), until,
                                       inputs.accuracy)
    return memory._replace(point=point, chip=now, u=u, u_end=u_end, tau=tau, tau_end=tau_end), m, event, status


def onward(numbers: Numbers, point: Point, u: Piece, tau: Piece, m: Motion, new: bool, limit: float,
           until: float, accuracy: float) -> tuple[Point, Motion, int, int]:
    """Advance, under inputs that stay until `limit` [s], to the next event or to `until`.

    `m` is the motion so far, which is taken up again if it is still the right one and the inputs are not `new`. Return
    the point, the motion, the event (−1: none) and a status.
    """
    if new or motion.is_step(m) or not (
            m.t0 == point.anchor_time and m.mode == point.mode and m.start == point.anchor):
        m = choice.begin(numbers, point.mode, u, tau, point.anchor_time, point.anchor, point.step,
                         limit - point.anchor_time, accuracy)
    if m.kind == motion.IMPOSSIBLE:
        return point, m, -1, STEP_TOO_SMALL
    point, event, status = follow(m, point, min(limit, until))
    return point, m, event, status


def pulse_width(inputs: Inputs, memory: Memory) -> float:
    """Return the width [s] of the pulse that begins now."""
    origin, t = origin_of(memory), memory.point.time
    piece, _ = in_force(inputs.command, origin, t + SAME * memory.beat, 0.0)
    return piece_value(since(piece, origin), t)


def anchored(numbers: Numbers, u: Piece, tau: Piece, time: float, point: Point) -> Point:
    """Return a point whose motion begins now, under inputs that are new."""
    y, v = point.y, piece_value(u, time)
    zone = currents.zone_of(warm(numbers, y), v, piece_rate(u, time), y.q, turning(numbers.elastic, y), y.i)
    mode = guards.settled(numbers, zone, v, piece_value(tau, time), y, point.mode.mesh, in_one_piece(numbers, u))
    return Point(time, y, mode, time, y, point.step, point.wiper)


def in_one_piece(numbers: Numbers, u: Piece) -> bool:
    """Tell whether a smoothed friction is integrated throughout: where no part of it would be linear."""
    return smoothed(numbers.friction) and (inductive(numbers.motor) or swings(numbers.load) or u.sweep != 0.0)


def follow(m: Motion, point: Point, horizon: float) -> tuple[Point, int, int]:
    """Follow a motion to its first event, its end or the horizon [s]; return also the event (−1: none) and a status."""
    t0, integrated = m.t0, motion.is_step(m)
    step_end = t0 + m.length
    if abs(step_end - horizon) <= 2.0 * UNIT * (abs(t0) + abs(horizon)):
        step_end = horizon
    end = min(horizon, step_end)
    if m.kind == motion.SECOND_ORDER or m.kind == motion.WITH_CURRENT:
        fine, settled = motion.scales(m)
        if min(end - t0, settled) > _MOST_OSCILLATIONS * fine:
            return point, -1, TOO_FAST
    if integrated and (point.time > t0 or end < step_end):
        m = motion.prepared(m)
    v = piece_value(m.u, point.time)
    kinds = guards.guards(m.numbers, m.mode, v, m.mode.contact == CORE and in_one_piece(m.numbers, m.u))
    if integrated:  # looked at as a whole, however a run is split
        if m.kind == motion.CREEP:
            kinds &= ~guards.IN_CLOSED_FORM
        elif guards.creeping(m.numbers, m.mode, m.start):
            kinds &= ~(1 << guards.CREEPS)
        s, kind, y = first_event.first_event(m, kinds, 0.0, m.length)
        if kind < 0 or s > end - t0:
            kind, y = -1, motion.state(m, m.length if end == step_end else end - t0)  # not a rounding before its end
    else:
        s, kind, y = first_event.first_event(m, kinds, point.time - t0, end - t0)
    if kind < 0:
        wiper = wiper_at(m.numbers.sensor, point.wiper, y.q)
        if integrated and end == step_end and m.ends_by >= 0:
            after, y = crossings.cross(m.numbers, m.mode, m.ends_by, piece_value(m.u, end), piece_value(m.tau, end), y)
            return Point(end, y, after, end, y, point.step, wiper), m.ends_by, status_of(y)
        if integrated and end == step_end:
            return Point(end, y, m.mode, end, y, m.next_step, wiper), -1, status_of(y)
        return Point(end, y, m.mode, t0, point.anchor, point.step, wiper), -1, status_of(y)
    t = min(max(t0 + s, point.time), end)
    if integrated:
        m = motion.prepared(m)
    y = motion.ended(m, s)
    wiper = wiper_at(m.numbers.sensor, point.wiper, y.q)
    after, y = crossings.cross(m.numbers, m.mode, kind, piece_value(m.u, t), piece_value(m.tau, t), y)
    return Point(t, y, after, t, y, point.step, wiper), kind, status_of(y)


def status_of(y: Vector) -> int:
    """Tell whether a state is finite, as a code."""
    q, w, i, T_w, T_h, q_m, w_m = y
    return COMPLETED if math.isfinite(q + w + i + T_w + T_h + q_m + w_m) else DIVERGED


def at_pulses(numbers: Numbers, silent: int) -> Numbers:
    """Return the numbers with the bridge as it is now: while no pulses come (1) it may be off in another way."""
    if silent == 0:
        return numbers
    return numbers._replace(bridge=bridge.off_now(numbers.bridge, silent))


def source(numbers: Numbers, now: Frame) -> Piece:
    """Return the voltage behind the bridge, the input of a servo that has one."""
    return Piece(0.0, now.drive * numbers.source.V, 0.0, 0.0, 0.0, 0.0, 0.0)


def circuit(numbers: Numbers, u: float, y: Vector) -> tuple[float, float, float]:
    """Return the current [A], the voltages at the motor's terminals and of the bus [V], for u [V] behind the bridge."""
    numbers = warm(numbers, y)
    w, i = turning(numbers.elastic, y), y.i
    zone = currents.zone_of(numbers, u, 0.0, y.q, w, i)
    i = currents.flowing(numbers, zone, u, y.q, w, i)
    V_bus = bridge.bus_voltage(numbers.bridge, numbers.source, numbers.motor, zone, u, w, i)
    return i, bridge.terminal_voltage(numbers.bridge, numbers.source, numbers.motor, u, w, i, V_bus), V_bus


def measured(numbers: Numbers, chip: Chip, curve: Sequence[Sequence[float]] | NDArray[np.float64], seed: int,
             now: Frame, time: float, y: Vector, wiper: float, t_in: float) -> Frame:
    """Return the frame state after the edge of a pulse of the width t_in that meets the servo in a state."""
    _, v_m, V_bus = circuit(numbers, now.drive * numbers.source.V, y)
    return frame.edge(chip, now, time, t_in, sensed_voltage(numbers.sensor, curve, wiper), v_m, V_bus, seed)
