"""A servo alone, as a program in C has it: made of what is given of it, it advances, and gives its signals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.engine.demands import demanded
from servotwin.models.engine.log import Log
from servotwin.models.engine.memory import (
    SAME,
    Inputs,
    Memories,
    memory_at,
    put_firm,
    put_memory,
    started,
    time_of,
)
from servotwin.models.engine.observe import Observed, at_motor, observed, told_by
from servotwin.models.engine.run.run import as_now, mode_under, run, told
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import INSIDE, RIGID, Vector
from servotwin.models.terms import control, duty, firmware, frame, packing, play, wiring
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.frame import present as pulsed_chip
from servotwin.models.terms.given import Given, Hung
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.wiring import Wiring, followed, possible, rest_angle
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats


# --- A servo alone, as a program in C has it --------------------------------------------------------------------------

READY, NOT_FINITE, NOT_POSSIBLE, BEFORE = 0, -1, -2, -3  # what a call is answered, beside the codes of a step


class Alone(NamedTuple):
    """The numbers of a servo, its program and its table apart."""

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


def answer(servo: Alone, command: float, torque: float) -> int:
    """Return what a call with this command [s, rad] and torque [N m] is answered: `READY`, or what is wrong with it."""
    if not torque - torque == 0.0:
        return NOT_FINITE
    return READY if possible(servo.wiring, command) else NOT_POSSIBLE


def advance(servo: Alone, inputs: Inputs, memories: Memories, until: float, command: float, log: Log) -> int:
    """Advance to a time [s]; return a status, and leave the memory as it was unless that is `READY`.

    Events are written into the log, as far as that has room for them, and counted.
    """
    memory = memory_at(memories, 0)
    if not until - until == 0.0:
        return NOT_FINITE
    status = answer(servo, command, inputs.constant_torque)
    if status != READY:
        return status
    if until < time_of(memory) - SAME * memory.beat:  # of which the instant of an edge may be off
        return BEFORE
    memory, status = run(servo.plant, servo.chip, inputs, memory, until, False, True, log)
    if status == COMPLETED:
        put_memory(memories.rows[0], memory)
    return status


def observe(servo: Alone, inputs: Inputs, memories: Memories) -> Seen:
    """Return all signals of a servo as it stands, under its present inputs."""
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


# --- A servo alone, made of what is given of it and of what hangs on its shaft ----------------------------------------

def asks(servo: Alone, own: Firmware) -> int:
    """Return all that a servo asks of the code that follows it: flags of `terms.dependence`."""
    return demanded(servo.plant, servo.chip, own, Piece())


def pulsed(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return an analog servo behind its bridge; `error` is that of its table where its feedback stands [V]."""
    numbers = packing.pulsed(given, hung, error)
    return Alone(numbers, frame.pack(given, math.nan), wiring.pulsed(given, math.nan), given.gear_gear_reduction,
                 torque, numbers.heat.T_amb, accuracy)


def digital(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return a digital servo behind its bridge, without its program."""
    numbers = packing.digital(given, hung, error)
    return Alone(numbers, NO_CHIP, wiring.digital(given, math.nan), given.gear_gear_reduction, torque,
                 numbers.heat.T_amb, accuracy)


def bounded(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return a servo whose voltage follows the error between its bounds."""
    numbers = packing.bounded(given, hung)
    return Alone(numbers, NO_CHIP, wiring.bounded(given), given.gear_gear_reduction, torque, numbers.heat.T_amb,
                 accuracy)


def averaged(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return a servo whose voltage follows the error without bound."""
    numbers = packing.averaged(given, hung)
    return Alone(numbers, NO_CHIP, wiring.averaged(given), given.gear_gear_reduction, torque, numbers.heat.T_amb,
                 accuracy)


def program(given: Given) -> Firmware:
    """Return the program of a digital servo."""
    return firmware.pack(given, math.nan)
