"""A servo alone, as a program in C has it: told one pulse or goal at a time, it goes on, and tells of itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.events import kinds
from servotwin.models.engine.legs.legs import MOST_SHORT
from servotwin.models.engine.memory import (
    SAME,
    Inputs,
    Memories,
    Memory,
    Point,
    counted_anew,
    due,
    edge_of,
    instant,
    memory_at,
    origin_of,
    put_firm,
    put_memory,
    resumed,
    started,
    time_of,
)
from servotwin.models.engine.motions import motion
from servotwin.models.engine.observe import Observed, observed, told_by
from servotwin.models.engine.runs import as_now, calmed, is_short, mode_under, told
from servotwin.models.engine.step import CHATTER, COMPLETED, MOST_IDLE, pulse_width, step
from servotwin.models.state.modes import INSIDE, RIGID, Vector, at_rest
from servotwin.models.terms import control, duty, elastic, firmware, frame, play
from servotwin.models.terms.bridge import heeds_silence
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.chip import present as pulsed_chip
from servotwin.models.terms.heat import present as warms
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.wiring import Wiring, possible, rest_angle
from servotwin.physics.pieces import piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.batch.tiles import Floats, Indices

READY, NOT_FINITE, NOT_POSSIBLE, BEFORE = 0, -1, -2, -3  # what a call is answered, beside the codes of a step


class Alone(NamedTuple):
    """What a servo is, its program and its table apart."""

    plant: Numbers
    chip: Chip
    wiring: Wiring
    reduction: float  # motor turns per output turn
    torque: float  # of the load, constant [N m]
    ambient: float  # temperature at the start [K], also where nothing gets warm
    accuracy: float  # of what is integrated [rad]


class Seen(NamedTuple):
    """Signals of a servo by their names (SI), as they are at the end of a call."""

    output_angle: float
    output_speed: float
    shown: Observed


class Happened(NamedTuple):
    """Something that happened: when [s], at which output angle [rad], and what, a number of `events.kinds`."""

    time: float
    angle: float
    kind: int


def start(servo: Alone, curve: Floats, memories: Memories, command: float) -> int:
    """Put a servo to rest where it has no error under a pulse [s] or a goal [rad]; return whether it takes that."""
    if not possible(servo.wiring, command):
        return NOT_POSSIBLE
    q, T = rest_angle(servo.wiring, curve, followed(servo.wiring, command)), servo.ambient
    if duty.present(servo.plant.bridge):
        put_firm(memories.firms[0], control.AT_START)
    mesh = INSIDE if play.present(servo.plant.play) else RIGID
    put_memory(memories.rows[0], started(Vector(q, 0.0, 0.0, T, T, q, 0.0), mesh, memories.firms[0:1]))
    return READY


def followed(wiring: Wiring, command: float) -> float:
    """Return what the engine follows of a pulse [s] or a goal [rad]."""
    return wiring.gain * command + wiring.offset


def answer(servo: Alone, command: float, torque: float) -> int:
    """Return what a call with this command [s, rad] and torque [N m] is answered: `READY`, or what is wrong with it."""
    if not torque - torque == 0.0:
        return NOT_FINITE
    return READY if possible(servo.wiring, command) else NOT_POSSIBLE


def advance(servo: Alone, inputs: Inputs, memories: Memories, until: float, command: float, rows: Any,
            used: Indices) -> int:
    """Go on to a time [s]; return a status, and leave the memory as it was unless that is `READY`.

    What happens is put into `rows`, as far as there is room, and counted in `used`.
    """
    memory = memory_at(memories, 0)
    if not until - until == 0.0:
        return NOT_FINITE
    status = answer(servo, command, inputs.constant_torque)
    if status != READY:
        return status
    if until < time_of(memory) - SAME * memory.beat:  # of which the instant of an edge may be off
        return BEFORE
    memory, status = run(servo.plant, servo.chip, inputs, memory, until, rows, used)
    if status == COMPLETED:
        put_memory(memories.rows[0], memory)
    return status


def run(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, until: float, rows: Any,
        used: Indices) -> tuple[Memory, int]:
    """Go on to a time since the start [s], from event to event; return the memory and a status."""
    pulsed = pulsed_chip(chip)
    memory = resumed(pulsed, inputs, memory, False)
    if firmware.present(inputs.firmware[0]):
        controller.resume(inputs, memory)
    end = instant(pulsed, inputs, memory, until - origin_of(memory))
    if stands(numbers, chip, inputs, memory, end):
        return memory_then(memory, end), COMPLETED
    m = motion.nothing(numbers, memory.u, memory.tau)
    idle = short = trip = 0
    while memory.point.time < end:
        if due(memory):
            memory = counted_anew(memory)
            end = instant(pulsed, inputs, memory, until - origin_of(memory))
        before = memory
        if firmware.present(inputs.firmware[0]):
            trip = memory.firm[0].trip
        memory, m, event, status = step(numbers, chip, inputs, before, m, end)
        if status != COMPLETED:
            return memory, status
        idle = idle + 1 if memory.point.time == before.point.time else 0
        if idle > MOST_IDLE:
            return memory, CHATTER
        if len(rows) > 0:
            _note(numbers, chip, inputs, before, trip, memory, event, rows, used)
        short = short + 1 if play.present(numbers.play) and is_short(before, memory, event) else 0
        if short >= MOST_SHORT:
            memory, held = calmed(numbers, chip, inputs, memory)
            if held != 0:
                _write(rows, used, time_of(memory), kinds.HELD, memory.point.y.q)
    if firmware.present(inputs.firmware[0]):
        controller.pause(inputs, memory)
    return memory, COMPLETED


def stands(numbers: Numbers, chip: Chip, inputs: Inputs, memory: Memory, end: float) -> bool:
    """Tell whether a servo stands still until `end`, and nothing is decided before: then time alone goes on."""
    point, now = memory.point, memory.chip
    if not at_rest(point.mode.contact) or point.mode.mesh != RIGID or point.anchor_time == math.inf:
        return False
    if inductive(numbers.motor) or warms(numbers.heat) or elastic.present(numbers.elastic) or (
            firmware.present(inputs.firmware[0])):
        return False
    if pulsed_chip(chip) and (frame.next_switch(now, heeds_silence(numbers.bridge)) < end
                              or edge_of(inputs, memory, now.number) < end):
        return False
    return memory.u_end >= end and memory.tau_end >= end and not due(memory)


def memory_then(memory: Memory, time: float) -> Memory:
    """Return the memory of a servo that has stood still until a time [s]."""
    p = memory.point
    point = Point(time, p.y, p.mode, p.anchor_time, p.anchor, p.step, p.wiper)
    return Memory(memory.frames, memory.beat, point, memory.chip, memory.u, memory.u_end, memory.tau, memory.tau_end,
                  memory.firm)


def _note(numbers: Numbers, chip: Chip, inputs: Inputs, before: Memory, trip: int, memory: Memory, event: int,
          rows: Any, used: Indices) -> None:
    """Write down what a step has brought: what its chip or program did, and the event that ended it."""
    start, angle, was, now = origin_of(memory) + before.point.time, before.point.y.q, before.chip, memory.chip
    if now.drive != was.drive:
        _write(rows, used, start, kinds.DRIVE_ENDS + int(now.drive), angle)
    if heeds_silence(numbers.bridge) and now.silent != was.silent:
        _write(rows, used, start, kinds.SILENCE_ENDS + now.silent, angle)
    if pulsed_chip(chip) and now.number > was.number and not frame.accepted(chip, pulse_width(inputs, before)):
        _write(rows, used, start, kinds.REFUSED, angle)
    if firmware.present(inputs.firmware[0]) and memory.firm[0].trip != trip:
        _write(rows, used, start, kinds.TRIP_ENDS + memory.firm[0].trip, angle)
    kind = kinds.kind_of(event, memory.point.mode)
    if kind != kinds.NO_EVENT:
        _write(rows, used, time_of(memory), kind, memory.point.y.q)


def _write(rows: Any, used: Indices, time: float, kind: int, angle: float) -> None:
    if used[0] < len(rows):
        row = rows[used[0]]
        row.time, row.angle, row.kind = time, angle, kind
    used[0] += 1


def observe(servo: Alone, inputs: Inputs, memories: Memories) -> Seen:
    """Return all signals of a servo as it stands, under what it is told now."""
    memory = memory_at(memories, 0)
    point, now, time = memory.point, memory.chip, time_of(memory)
    u, tau = told(servo.plant, pulsed_chip(servo.chip), inputs, memory)
    numbers = as_now(servo.plant, inputs, memory)
    mode = mode_under(numbers, u, tau, memory)
    shown = observed(warm(numbers, point.y), inputs.curve, mode, piece_value(u, time), piece_value(tau, time), point.y,
                     point.wiper, now.drive, now.error)
    if duty.present(numbers.bridge):
        shown = told_by(numbers.bridge, memory.firm[0], shown)
    return Seen(point.y.q, point.y.w, at_motor(shown, servo.reduction))


def at_motor(shown: Observed, N: float) -> Observed:
    """Return the same signals with those of the motor at its own shaft."""
    return Observed(
        shown.armature_voltage, shown.armature_current, shown.bus_voltage, shown.supply_current,
        shown.motor_torque / N, shown.load_torque, N * shown.motor_angle, N * shown.motor_speed, shown.load_angle,
        shown.feedback_voltage, shown.error_time, shown.drive, shown.winding_temperature, shown.housing_temperature,
        shown.duty, shown.goal_angle, shown.reference_angle, shown.trip)
