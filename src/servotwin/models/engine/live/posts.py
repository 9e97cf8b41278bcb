"""Servos at a bench as kernels keep them: how each is made, the pulses that it hears, and where it begins."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.loads.load import STANDARD_GRAVITY
from servotwin.models.engine.live import screen
from servotwin.models.engine.live.screen import NO_LOW, USED, Lines, Low, Said, Switch
from servotwin.models.engine.memory import Inputs, Memories, in_force, memory_at, put_memory, put_started, with_bodies
from servotwin.models.state.modes import INSIDE, RIGID, Vector
from servotwin.models.state.noise import uniform
from servotwin.models.state.records import record_reader, record_writer
from servotwin.models.terms import firmware, frame, packing, play, wiring
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware, takes_goals
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.given import Given, Hung, either, inertia_on, is_given
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import stands
from servotwin.physics.converter import generated_width, supplied_count
from servotwin.physics.pieces import piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.live.screen import Floats


# --- The transmitter of pulses: a frame clock whose rate may change, and frames that get lost -------------------------

_SAME = 1e-9  # of a frame: instants that are nearer are one


class Sender(NamedTuple):
    """A frame clock: of its frames `passed` have begun since `base`, and `number` in all."""

    rate: float  # of frames [Hz]
    lost: float  # share of the frames that are not sent
    seed: int  # of which these are
    base: float  # [s]
    passed: int
    number: int
    time: float  # that the bench has come to [s]


def next_edge(sender: Any) -> float:
    """Return when the next frame begins [s]."""
    edge: float = sender.base + sender.passed / sender.rate
    return edge


def snapped(sender: Any, time: float) -> float:
    """Return a time, or that of the edge right next to it: what is a billionth of a frame away is the edge [s]."""
    edge: float = sender.base + round((time - sender.base) * sender.rate) / sender.rate
    return edge if abs(time - edge) * sender.rate <= _SAME and edge >= next_edge(sender) else time


def tune(sender: Any, rate: float) -> None:
    """Take another rate [Hz] from the next edge on: the frame that has begun stays as it is."""
    sender.base, sender.passed, sender.rate = next_edge(sender), 0, rate


def is_lost(sender: Any) -> bool:
    """Tell whether the next frame gets lost; that is the same whatever came before."""
    if sender.lost == 0.0 or sender.lost == 1.0:
        return bool(sender.lost == 1.0)
    return bool(uniform(sender.seed, sender.number) < sender.lost)


def pass_edge(sender: Any) -> None:
    """Let the next frame begin."""
    sender.passed, sender.number = sender.passed + 1, sender.number + 1


# --- Servos at a bench as kernels keep them ---------------------------------------------------------------------------
UNITS = ("us", "deg", "V")
"""Units of commands."""
_SI = (1e-6, math.pi / 180.0, 1.0)
NEVER = 1e9  # s: when the pulse begins that stands for those before the first
NONE_BEFORE = Switch(0.0, 0.0, -1)
NOTHING_SAID = Said(0.0, 0.0, -1, 0.0, 0.0, 0.0, 0)


class Follow(NamedTuple):
    """How a servo follows a kind of command: by a straight line, if it takes it."""

    gain: float
    offset: float


class Post(NamedTuple):
    """A servo at a bench."""

    numbers: Numbers
    chip: Chip
    lines: Lines
    width: Follow  # in the order of `UNITS`
    angle: Follow
    voltage: Follow
    said: Said  # what showed of chip or program at the end of the latest stretch, on a shared supply
    was: Switch  # how its bridge drove at the end of the latest stretch
    low: Low  # of its supply since the latest look, of the first on a shared one
    lowest: float  # where it may begin [rad]
    highest: float
    torque: float  # of its load, constant [N m]
    push: float  # by hand, beside it [N m]
    sent: float  # width of the next pulse, where a control circuit makes it; 0: as the command says [s]
    accuracy: float  # of what is integrated [rad]
    seed: int  # of its noise
    pulsed: int  # 1: it hears a pulse a frame; 0: the command as it is
    changed: int  # 1: its numbers are others than in the latest stretch
    command_first: int  # its rows in the table of commands
    command_count: int
    curve_first: int  # in that of potentiometers
    curve_count: int
    heard: int  # rows of its train of pulses
    zone: int  # its mode before its bridge switches, on a shared supply
    contact: int
    mesh: int
    motor: int
    share: int
    row: int  # of its present motion in the log, on a shared supply


class Circuit(NamedTuple):
    """A control circuit: its converter, the generator of its pulses, and how much of the supply's sag both feel."""

    gain: float  # of the converter [1/V]
    offset: float  # [counts]
    step: float  # of the generator [s]
    base: float  # [s]
    command_share: float  # [1]
    reference_share: float  # [1]
    highest: int  # count
    counts_per_step: int


class Told(NamedTuple):
    """Commands of servos at a bench: a table of pieces, one of potentiometers, and edges of pulses [s]."""

    commands: Floats  # the first rows are for trains, as many for each servo as there are edges
    curves: Floats
    edges: Floats


numbers_of = record_reader("numbers_of", Numbers)
chip_of = record_reader("chip_of", Chip)
lines_of = record_reader("lines_of", Lines)
was_of = record_reader("was_of", Switch)
low_of = record_reader("low_of", Low)
said_of = record_reader("said_of", Said)
put_said = record_writer("put_said", Said)
put_was = record_writer("put_was", Switch)
put_low = record_writer("put_low", Low)
put_numbers = record_writer("put_numbers", Numbers)
put_chip = record_writer("put_chip", Chip)
put_lines = record_writer("put_lines", Lines)
put_follow = record_writer("put_follow", Follow)


def take(post: Any, unit: int, shape: int, given: Floats, time: Floats, value: Floats, start: float, table: Floats,
         ends: Floats) -> int:
    """Put a command from a time on [s] into a table as a servo follows it; return how many pieces there are.

    `ends` gets its lowest and highest value, the same of what the servo follows (SI), and of the first two their
    pieces, and when these start [s].
    """
    follow = post.width if unit == 0 else post.angle if unit == 1 else post.voltage
    count = screen.shaped(shape, given, time, value, table)
    screen.scaled(table, count, _SI[unit], 0.0)
    low, high, lowest, highest = screen.extremes(table, count)
    ends[0], ends[1], ends[4], ends[5] = low, high, 1.0 * lowest, 1.0 * highest
    screen.scaled(table, count, follow.gain, follow.offset)
    ends[2], ends[3], _, _ = screen.extremes(table, count)
    for n in range(count):
        table[n, 0] += start
    ends[6], ends[7] = table[lowest, 0], table[highest, 0]
    return count


def train_of(told: Told, servos: int, k: int) -> tuple[int, int]:
    """Return where the train of a servo begins among commands and edges, and where it ends."""
    room = len(told.edges) // servos
    return k * room, (k + 1) * room


def asked(post: Any, told: Told, time: float) -> float:
    """Return what a command asks for at a time [s]."""
    rows = told.commands[post.command_first:post.command_first + post.command_count]
    piece, _ = in_force(rows, 0.0, time, 0.0)
    return piece_value(piece, time)


def next_width(post: Any, told: Told, edge: float) -> float:
    """Return the command of a servo at an edge [s]: the width that a circuit sends, or what its command asks for."""
    return float(post.sent) if post.sent > 0.0 else asked(post, told, edge)


def heed(post: Any, told: Told, circuit: Any, time: float, sag: float) -> float:
    """Let a control circuit read the command at a time [s]; return the width of the pulses that follow [s].

    The supply has lost a part `sag` of its voltage.
    """
    voltage = post.lines.per_volt * asked(post, told, time) + post.lines.volts
    count = supplied_count(circuit.gain, circuit.offset, circuit.highest, voltage, sag, circuit.command_share,
                           circuit.reference_share)
    post.sent = generated_width(circuit.step, circuit.base, circuit.counts_per_step, count)
    return float(post.sent)


def begin(posts: Any, k: int, told: Told, memories: Memories) -> None:
    """Let a servo stand, without drive, where its first command asks for."""
    post = posts[k]
    first = next_width(post, told, 0.0)
    at, _ = train_of(told, len(posts), k)
    _put_pulse(told, at, NEVER, first)
    post.heard = 1
    _stand(posts, k, memories, min(max(post.lines.per_angle * first + post.lines.angle, post.lowest), post.highest))


def begin_at(posts: Any, k: int, told: Told, memories: Memories, angle: float) -> None:
    """Let a servo stand at an angle [rad], without drive, whatever its first command asks for."""
    begin(posts, k, told, memories)
    _stand(posts, k, memories, angle)


def _stand(posts: Any, k: int, memories: Memories, angle: float) -> None:
    post = posts[k]
    warm = post.numbers.heat.T_amb
    put_started(memories, k, Vector(angle, 0.0, 0.0, warm, warm, angle, 0.0),
                INSIDE if play.present(numbers_of(post.numbers).play) else RIGID)
    put_was(post.was, NONE_BEFORE)
    put_low(post.low, NO_LOW)
    put_said(post.said, NOTHING_SAID)
    post.changed = 1


def change(posts: Any, k: int, memories: Memories) -> None:
    """Let a servo continue with the numbers that its record has by now."""
    post = posts[k]
    memory = with_bodies(memory_at(memories, k), post.numbers.play.half, post.numbers.elastic.k > 0.0)
    put_memory(memories.rows[k], memory)
    post.changed = 1


def hear(sender: Any, posts: Any, told: Told, pulses: Any, used: Any, until: float) -> None:
    """Let all servos hear the pulses of the frames that begin before a time [s], which are written down.

    A pulse is edge and width [s], width 0 of one that is lost.
    """
    fresh = True
    edge = next_edge(sender)
    while edge < until:
        lost = is_lost(sender)
        for k in range(len(posts)):
            if posts[k].pulsed == 1:
                width = next_width(posts[k], told, edge)
                if not lost:
                    _take(posts[k], told, train_of(told, len(posts), k)[0], edge, width, fresh)
                n = used[USED * k + 2]
                if n < len(pulses[k]):
                    pulses[k][n, 0], pulses[k][n, 1] = edge, 0.0 if lost else width
                    used[USED * k + 2] = n + 1
        fresh = fresh and lost
        pass_edge(sender)
        edge = next_edge(sender)


def _take(post: Any, told: Told, at: int, edge: float, width: float, fresh: bool) -> None:
    """Put a pulse behind those of a stretch; the first of it comes behind the latest of the stretch before."""
    if fresh:
        last = at + post.heard - 1
        post.heard = 0
        if told.edges[last] < edge:
            _put_pulse(told, at, told.edges[last], told.commands[last, 1])
            post.heard = 1
    _put_pulse(told, at + post.heard, edge, width)
    post.heard += 1


def _put_pulse(told: Told, n: int, edge: float, width: float) -> None:
    told.commands[n, 0], told.commands[n, 1], told.edges[n] = edge, width, edge
    for place in range(2, 7):
        told.commands[n, place] = 0.0


def pieces_of(post: Any, k: int, servos: int, told: Told) -> tuple[int, int]:
    """Return where the pieces that a servo follows begin in the table, and how many there are."""
    if post.pulsed == 1:
        return train_of(told, servos, k)[0], post.heard
    return post.command_first, post.command_count


def inputs_of(post: Any, k: int, servos: int, told: Told, programs: Any) -> Inputs:
    """Return the present inputs of a servo."""
    curve = told.curves[post.curve_first:post.curve_first + post.curve_count]
    first, count = pieces_of(post, k, servos, told)
    at = train_of(told, servos, k)[0]
    edges = told.edges[at:at + (post.heard if post.pulsed == 1 else 0)]
    return Inputs(told.commands[first:first + count], told.curves[0:0], post.torque + post.push, 0.0, edges, curve,
                  post.seed, post.accuracy, programs[k:k + 1])


# --- A servo at a bench, made of what is given of it and of what hangs on its shaft -----------------------------------
AVERAGED, BOUNDED, PULSED, DIGITAL = range(4)
FAMILIES = {"AveragedServo": AVERAGED, "AveragedServoInductive": AVERAGED, "BoundedServo": BOUNDED,
            "PulseServo": PULSED, "PulseServoInductive": PULSED, "DigitalServo": DIGITAL}
"""Which models are made alike."""
MADE, NO_INERTIA = 0, 1  # how it ends
_NONE = Follow(0.0, 0.0)


class Weights(NamedTuple):
    """The load on a shaft at a bench (SI); `torque` pushes towards smaller angles."""

    inertia: float
    viscous_friction: float
    torque: float
    coulomb_torque: float
    mass: float  # at the end of an arm
    arm: float  # length of it
    hanging_angle: float


given_in = record_reader("given_in", Given)
weights_in = record_reader("weights_in", Weights)
put_program = record_writer("put_program", Firmware)


def make(post: Any, program: Any, family: int, given: Given, weights: Weights) -> int:
    """Make a servo; return `MADE`, or what forbids it: then it is what it was."""
    hung = hung_of(weights)
    if (given.gear_backlash > 0.0 or given.gear_stiffness > 0.0) and not inertia_on(given, hung) > 0.0:
        return NO_INERTIA
    if family == PULSED:
        put_numbers(post.numbers, packing.pulsed(given, hung, 0.0))
    elif family == DIGITAL:
        put_numbers(post.numbers, packing.digital(given, hung, 0.0))
    elif family == BOUNDED:
        put_numbers(post.numbers, packing.bounded(given, hung))
    else:
        put_numbers(post.numbers, packing.averaged(given, hung))
    post.pulsed = 1 if family == PULSED or (family == DIGITAL and not takes_goals(given)) else 0
    put_chip(post.chip, frame.pack(given, math.nan) if family == PULSED else NO_CHIP)
    put_program(program, firmware.pack(given, math.nan) if family == DIGITAL else NO_FIRMWARE)
    _tell(post, family, given)
    post.torque = weights.torque
    return MADE


def hung_of(weights: Weights) -> Hung:
    """Return a load as servos are made of it."""
    return Hung(weights.inertia + weights.mass * weights.arm * weights.arm, weights.viscous_friction,
                weights.coulomb_torque, 0.0, 0.0, weights.mass * STANDARD_GRAVITY * weights.arm, weights.hanging_angle,
                0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _tell(post: Any, family: int, given: Given) -> None:
    """Note how a servo follows commands, and where it may begin."""
    angle, width, voltage = _NONE, _NONE, _NONE
    has_gain = is_given(given.electronics_voltage_to_pulse_gain)
    post.lowest, post.highest = -math.inf, math.inf
    if family == DIGITAL and takes_goals(given):
        angle = Follow(1.0, 0.0)
    elif family == DIGITAL or family == PULSED:
        told = family == PULSED or (is_given(given.electronics_one_shot_slope)
                                    and is_given(given.potentiometer_feedback_gain))
        width = Follow(1.0, 0.0) if told else _NONE
        if told and not stands(given):
            angle = _line(wiring.pulse_of_angle(given))
            voltage = _line(wiring.pulse_of_voltage(given)) if has_gain else _NONE
    else:
        averaged = family == AVERAGED
        angle = _line(wiring.feedback_line(given))
        width = _line(wiring.averaged_by_pulse(given) if averaged else wiring.bounded_by_pulse(given))
        if has_gain:
            voltage = _line(wiring.averaged_by_voltage(given) if averaged else wiring.bounded_by_voltage(given))
    if family != AVERAGED:
        post.lowest = either(given.stops_lower_angle, -math.inf)
        post.highest = either(given.stops_upper_angle, math.inf)
    if family == DIGITAL:
        post.lowest = max(post.lowest, either(given.firmware_lower_goal, -math.inf))
        post.highest = min(post.highest, either(given.firmware_upper_goal, math.inf))
    put_follow(post.width, width)
    put_follow(post.angle, angle)
    put_follow(post.voltage, voltage)
    put_lines(post.lines, Lines(_slope(voltage), _start(voltage), _slope(angle), _start(angle), _slope(width),
                                _start(width), either(given.gear_gear_reduction, 1.0)))


def _line(gain_and_offset: tuple[float, float]) -> Follow:
    return Follow(gain_and_offset[0], gain_and_offset[1])


def _slope(line: Follow) -> float:
    """Return by how much a command changes with what the servo follows; 0 where it takes none."""
    return 1.0 / line.gain if line.gain != 0.0 else 0.0


def _start(line: Follow) -> float:
    """Return the command where what the servo follows is 0."""
    return -line.offset / line.gain if line.gain != 0.0 else 0.0
