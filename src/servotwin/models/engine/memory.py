"""The state of a servo between two calls, whole: where it stands, what its chip has decided, and its clock.

Times within it count from the beginning of a frame, a new one after so many, so that they keep their digits for days;
`frames` says which one that is. An instant within a billionth of a frame of an edge *is* the edge, so that twenty ticks
of a millisecond are a frame of twenty, however their sum is rounded.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.state.modes import INSIDE, ON_BACKWARD, RIGID, UNIT, Mode, Vector, one_body
from servotwin.models.state.records import record_reader, record_writer
from servotwin.models.terms import control, firmware, frame
from servotwin.models.terms.control import Firm, Programs
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Frame
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

ACCURACY = 1e-9  # rad, unless another is asked for
FIRST_STEP = 1e-4  # s, the first that the integrator tries
BEAT = 0.0625  # s, by which the clock counts where no pulses come regularly
FRAMES = 256  # after so many times count anew: not after each, for that would round all of them anew
FLAT = 1e-6  # V: a voltage counts as the least so near to it
SAME = 1e-9  # of a frame: so near to an edge it is the edge
IN_FLOATS = {"SAME": 1e-4, "FRAMES": 1}
_USUAL = 0.02  # s, a frame where edges are listed


class Point(NamedTuple):
    """Where a servo stands, and where its present motion began; times from the beginning of a frame [s]."""

    time: float
    y: Vector
    mode: Mode
    anchor_time: float  # inf: no motion has begun yet, or its inputs are no longer the same
    anchor: Vector
    step: float  # length that the integrator would try next
    wiper: float  # angle of the potentiometer, which may lag behind the shaft


class Lowest(NamedTuple):
    """The least voltage of a supply so far [V], and when it came within `FLAT` of that first [s since the start]."""

    voltage: float  # −inf: nobody asks
    level: float  # at that time
    time: float


class Memory(NamedTuple):
    """Everything that a servo remembers."""

    frames: int  # that have gone by where all times here count from
    beat: float  # s, of such a frame
    point: Point
    chip: Frame
    u: Piece  # what the servo follows, by the time since the start
    u_end: float
    tau: Piece  # torque of the load that depends on time alone
    tau_end: float
    lowest: Lowest  # voltage of its own supply
    firm: Programs  # one: what the program of a digital servo remembers; while it runs it is changed in place


class Memories(NamedTuple):
    """States of lanes: records of `Memory`, and beside them of `Firm`."""

    rows: Any
    firms: Any


class Inputs(NamedTuple):
    """Commands of a servo and the load on its shaft: tables of pieces, a row each; frames of pulses."""

    command: Sequence[Sequence[float]] | NDArray[np.float64]
    torque: Sequence[Sequence[float]] | NDArray[np.float64]  # no row: none
    constant_torque: float  # beside it
    period: float  # of regular frames [s]; 0: as listed
    edges: Sequence[float] | NDArray[np.float64]
    curve: Sequence[Sequence[float]] | NDArray[np.float64]  # of the potentiometer: angle and error
    seed: int
    accuracy: float  # of what is integrated [rad]
    firmware: Sequence[Firmware] | NDArray[np.record]  # one


NOTHING = Piece()
NOT_ASKED = Lowest(-math.inf, -math.inf, 0.0)
NONE_YET = Lowest(math.inf, math.inf, 0.0)
memory_of = record_reader("memory_of", Memory)
put_memory = record_writer("put_memory", Memory)
put_firm = record_writer("put_firm", Firm)
point_of = record_reader("point_of", Point)
put_point = record_writer("put_point", Point)
put_vector = record_writer("put_vector", Vector)


def started(y: Vector, mesh: int, firm: Programs) -> Memory:
    """Return the memory of a servo at t = 0, in no mode yet; `firm` is what its program remembers."""
    point = Point(0.0, y, Mode(0, 0, mesh, 0, 0), math.inf, y, FIRST_STEP, y.q)
    return Memory(0, BEAT, point, frame.AT_START, NOTHING, math.inf, NOTHING, math.inf, NOT_ASKED, firm)


def memory_at(memories: Memories, k: int) -> Memory:
    """Return what a lane remembers, with what its program does by reference."""
    return memory_of(memories.rows[k], memories.firms[k:k + 1])


def put_started(memories: Memories, k: int, y: Vector, mesh: int) -> None:
    """Let a lane remember what a servo does at t = 0, in no mode yet."""
    put_firm(memories.firms[k], control.AT_START)
    put_memory(memories.rows[k], started(y, mesh, memories.firms[k:k + 1]))


def origin_of(memory: Memory) -> float:
    """Return the instant from which the times of a memory count [s since the start]."""
    return memory.frames * memory.beat


def time_of(memory: Memory) -> float:
    """Return the time since the start [s]."""
    return origin_of(memory) + memory.point.time


def since(piece: Piece, origin: float) -> Piece:
    """Return a piece by the time since `origin` [s]."""
    return Piece(piece.start - origin, piece.value, piece.slope, piece.amplitude, piece.frequency, piece.phase,
                 piece.sweep)


def edge_of(inputs: Inputs, memory: Memory, k: int) -> float:
    """Return when frame k begins, by the times of a memory [s]; inf after the last."""
    if inputs.period > 0.0:
        return frame.edge_time(inputs.period, inputs.edges, k - memory.frames)
    return frame.edge_time(inputs.period, inputs.edges, k) - origin_of(memory)


def instant(pulsed: bool, inputs: Inputs, memory: Memory, time: float) -> float:
    """Return a time to which a memory shall go [s]: that of the edge where it is next to one."""
    if firmware.present(inputs.firmware[0]):
        T_c, shift = inputs.firmware[0].T_c, inputs.firmware[0].t_phi
        tick = round((time - shift) / T_c) * T_c + shift
        return tick if abs(time - tick) <= SAME * T_c else time
    if not pulsed:
        return time
    if inputs.period > 0.0:
        edge = round(time / inputs.period) * inputs.period
        return edge if abs(time - edge) <= SAME * inputs.period else time
    edge = edge_of(inputs, memory, next_frame(inputs, memory, time - SAME * _USUAL))
    return edge if abs(time - edge) <= SAME * _USUAL else time


def resumed(pulsed: bool, inputs: Inputs, memory: Memory, changed: bool) -> Memory:
    """Return a memory ready to continue under inputs that may be others than before.

    `changed` is whether the servo itself is another one.
    """
    beat = inputs.period if pulsed and inputs.period > 0.0 else BEAT
    if firmware.present(inputs.firmware[0]):
        beat = inputs.firmware[0].T_c
    if beat != memory.beat:  # its frames are others now
        origin = origin_of(memory)
        frames = int((origin + memory.point.time) / beat * (1.0 + 2.0 * UNIT))
        memory = shifted(memory, frames, beat, frames * beat - origin)
    origin, time = origin_of(memory), memory.point.time
    number = memory.chip.number
    if firmware.present(inputs.firmware[0]):
        u, u_end = memory.u, math.inf
    elif pulsed:
        number = next_frame(inputs, memory, time)
        u, u_end = memory.u, math.inf
    else:
        u, u_end = in_force(inputs.command, origin, time, 0.0)
    tau, tau_end = in_force(inputs.torque, origin, time, inputs.constant_torque)
    if changed or u != memory.u or tau != memory.tau:
        memory = forgotten(memory)
    return memory._replace(beat=beat, chip=frame.numbered(memory.chip, number, silent_now(memory)), u=u, u_end=u_end,
                           tau=tau, tau_end=tau_end)


def silent_now(memory: Memory) -> int:
    """Tell whether no pulses come, 1 or 0, before a servo continues; one that did not heed that may do so now."""
    if memory.point.anchor_time == math.inf:
        return 1 if memory.chip.clock <= memory.point.time else 0
    return memory.chip.silent


def with_bodies(memory: Memory, half_play: float, sprung: bool) -> Memory:
    """Return a memory in which no motion has begun, of a servo of two bodies, with play or a spring between, or one."""
    p = memory.point
    mesh = p.mode.mesh if half_play > 0.0 and RIGID < p.mode.mesh <= ON_BACKWARD else INSIDE
    y = p.y
    if not sprung:  # a spring may have been twisted beyond a play that is there now
        q_m = min(max(y.q_m, y.q - half_play), y.q + half_play)
        y = Vector(y.q, y.w, y.i, y.T_w, y.T_h, q_m, y.w_m)
    if half_play == 0.0 and not sprung:
        mesh, y = RIGID, one_body(y.q, y.w, y)
    mode = p.mode
    return forgotten(memory._replace(point=p._replace(y=y, mode=mode._replace(mesh=mesh))))


def due(memory: Memory) -> bool:
    """Tell whether times shall count anew."""
    return memory.point.time >= FRAMES * memory.beat


def counted_anew(memory: Memory) -> Memory:
    """Return the memory with times that count from later on."""
    return shifted(memory, memory.frames + FRAMES, memory.beat, FRAMES * memory.beat)


def shifted(memory: Memory, frames: int, beat: float, shift: float) -> Memory:
    """Return a memory whose times count from an instant that is later by `shift` [s]."""
    p = memory.point
    point = p._replace(time=p.time - shift, anchor_time=p.anchor_time - shift)
    return memory._replace(frames=frames, beat=beat, point=point, chip=frame.shifted(memory.chip, shift),
                           u_end=memory.u_end - shift, tau_end=memory.tau_end - shift)


def forgotten(memory: Memory) -> Memory:
    """Return a memory in which no motion has begun."""
    point = memory.point
    return memory._replace(point=point._replace(anchor_time=math.inf))


def next_frame(inputs: Inputs, memory: Memory, time: float) -> int:
    """Return the number of the first frame that begins at `time` [s] or after."""
    if inputs.period > 0.0:
        return memory.frames + math.ceil(time / inputs.period - SAME)
    low, high = 0, len(inputs.edges)
    while low < high:
        middle = (low + high) // 2
        if edge_of(inputs, memory, middle) < time:
            low = middle + 1
        else:
            high = middle
    return low


def in_force(table: Sequence[Sequence[float]] | NDArray[np.float64], origin: float, time: float,
             offset: float) -> tuple[Piece, float]:
    """Return the row of a table in force at `time` after `origin` [s], moved by `offset`, and when it ends."""
    if len(table) == 0:
        return Piece(0.0, offset, 0.0, 0.0, 0.0, 0.0, 0.0), math.inf
    low, high = 0, len(table)
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle][0] - origin <= time:
            low = middle
        else:
            high = middle
    row = table[low]
    return (Piece(row[0], row[1] + offset, row[2], row[3], row[4], row[5], row[6]),
            table[high][0] - origin if high < len(table) else math.inf)
