"""Records of servos on a bus: a record for each, and one for each that moves with others.

For a compiler these are numpy's records, in plain Python objects of the same names (`records.object_of`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine.log import ALONE, SERIES, Row, put_row
from servotwin.models.engine.log import DENSE as BY_STEP
from servotwin.models.engine.memory import Lowest, Point, since
from servotwin.models.engine.motions.dormand_prince import NUMBERS
from servotwin.models.engine.motions.motion import LONG_STEP
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.state.records import record_reader, record_writer
from servotwin.models.terms import duty
from servotwin.models.terms.frame import Chip, Frame
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


# --- Records of servos on a bus ---------------------------------------------------------------------------------------

ROOM = 42  # coefficients of a series at most
DENSE = 49  # numbers of the dense output of a step


if TYPE_CHECKING:
    Coefficients = list[float]
    Numerals = list[float]
    Stages = list[float]
else:
    Coefficients = tuple[(float,) * ROOM]
    Numerals = tuple[(float,) * DENSE]
    Stages = tuple[(float,) * NUMBERS]


class Track(NamedTuple):
    """The motion of a servo that moves on its own, as far as it has to be known to have it again."""

    kind: int
    length: float
    end: Vector
    next_step: float


class Shown(NamedTuple):
    """Signals of a program."""

    duty: float  # of the bridge, or `OPEN`, `BRAKED`
    goal: float
    reference: float
    trip: int


class Seat(NamedTuple):
    """A servo on a bus; times by its own clock [s] unless said."""

    place: int  # where its memory stands among those of all
    lane: int  # where its numbers do
    numbers: Numbers
    chip: Chip
    point: Point
    decided: Frame  # what its chip remembers
    shown: Shown  # of a program, which remembers more elsewhere
    u: Piece  # what it follows, as in `Memory`
    u_end: float
    tau: Piece
    tau_end: float
    frames: int  # where its clock counts from, as in `Memory`
    beat: float
    origin: float
    period: float  # of its frames; 0: as listed
    accuracy: float  # of what is integrated [rad]
    clock: float  # its time now
    before: float  # the same, while it is looked at ahead of it
    late: float  # by how much its clock is ahead of that of the bus
    until: float  # when it has gone far enough
    end: float  # when the run is over: then, or before
    switch: float  # when bridge or load change next
    edge: float  # when its next frame begins
    limit: float  # when anything is to be done next
    due: float  # the same by the clock of the bus
    arrival: float  # when it has its next point, left alone, by the clock of the bus; nan: not found out
    ahead: Point
    event: int  # that it has there; −1: none
    track: Track
    joined: int  # its place among those that move together; −1: none


class Linear(NamedTuple):
    """The law of a linear mate: L di/dt = s V − K_b w − drop − R i, J dw/dt = K i − b w − torques."""

    sign: float  # or duty
    K: float
    K_b: float
    R: float
    L: float
    J: float
    b: float
    stiffness: float
    drop: float
    conductance: float  # 0 where no current flows
    conducts: float
    moves: float
    against: float
    slope: float
    start: float  # its angle


class Mate(NamedTuple):
    """A servo whose motor is connected to the bus; times by the clock of the bus [s]."""

    unit: int
    numbers: Numbers  # as on a stiff source
    mode: Mode
    sign: float  # of the bus voltage in its circuit
    returns: int  # 1: through diodes, against the bus alone
    tau: Piece
    start: Vector  # where the common motion began
    end: Vector  # where it ends when nothing happens
    y: Vector  # where it is looked at
    speed: Coefficients  # of power series
    current: Coefficients
    law: Linear  # of the series
    stages: Stages  # of a step: the rates of all
    dense: Numerals  # of a step


class Shared(NamedTuple):
    """The common state of servos on one source, besides that of each; times by the clock of the first of them [s]."""

    phase: int
    state: int  # what the source does
    jumped: int  # 1: the common motion has ended with a jump, so that zones have to be found anew
    whose: int  # event will end it, by number among those that move together; −1: the source's, or none
    kind: int
    members: int  # how many move together
    how: int  # by series, or by a step: BY_SERIES or LONG_STEP
    terms: int  # of the series
    voltage: float  # of the bus when it was worked out last
    step: float  # the next to try
    begin: float  # of the common motion
    length: float
    end: float
    source: Source
    lowest: Lowest  # voltage of the source, by the time since the start


numbers_of = record_reader("numbers_of", Numbers)
put_numbers = record_writer("put_numbers", Numbers)
chip_of = record_reader("chip_of", Chip)
put_chip = record_writer("put_chip", Chip)
point_of = record_reader("point_of", Point)
put_point = record_writer("put_point", Point)
decided_of = record_reader("decided_of", Frame)
put_decided = record_writer("put_decided", Frame)
piece_of = record_reader("piece_of", Piece)
put_piece = record_writer("put_piece", Piece)
vector_of = record_reader("vector_of", Vector)
mode_of = record_reader("mode_of", Mode)
put_mode = record_writer("put_mode", Mode)
put_law = record_writer("put_law", Linear)
put_track = record_writer("put_track", Track)
put_shared = record_writer("put_shared", Shared)
source_of = record_reader("source_of", Source)
lowest_of = record_reader("lowest_of", Lowest)
put_lowest = record_writer("put_lowest", Lowest)


def drive_of(seat: Any) -> float:
    """Return how the bridge drives: −1, 0 or +1."""
    if duty.present(seat.numbers.bridge):
        return math.copysign(1.0, seat.shown.duty) if duty.drives(seat.shown.duty) else 0.0
    drive: float = seat.decided.drive
    return drive


# --- The tape of a run of servos on a bus -----------------------------------------------------------------------------

PLAIN = True  # the compiler takes it for False
# Events besides those of guards: how the bridge drives after it, silence, a pulse that is not taken, a trip.
DRIVES, SILENCE, REFUSED, TRIPS = -10, -20, -30, -50
EVENT = 6  # numbers of a row
_MOST = 8  # rows of one servo between two looks at the room that is left


class Tape(NamedTuple):
    """Room for rows of motions, rows of events, and numbers of common motions; and how much of each is used."""

    motions: Any  # records of `log.Row`
    events: NDArray[np.float64]
    numbers: NDArray[np.float64]
    used: NDArray[np.int64]


def runs(tape: Tape) -> bool:
    """Tell whether anything is written."""
    return tape.used.size > 0


def is_full(tape: Tape, servos: int) -> bool:
    """Tell whether there may be too little room for what so many servos do at once."""
    if not runs(tape):
        return False
    most = _MOST * servos
    return bool(tape.used[0] + most > len(tape.motions) or tape.used[1] + most > len(tape.events)
                or tape.used[2] + 2 * most * ROOM > len(tape.numbers))


def write_event(tape: Tape, unit: int, time: float, kind: int, mode: Mode, angle: float) -> None:
    """Write down an event, after which a mode holds."""
    if not runs(tape):
        return
    n = tape.used[1]
    values = (1.0 * unit, time, 1.0 * kind, 1.0 * mode.zone, 1.0 * mode.contact, angle)
    for k in range(EVENT):
        tape.events[n, k] = values[k]
    tape.used[1] = n + 1


def write_alone(tape: Tape, unit: int, seat: Any, until: float) -> None:
    """Write down the motion of a servo on its own, from its point to a time by its own clock [s]."""
    track = seat.track
    _write(tape, unit, ALONE, seat, until, mode_of(seat.point.mode), track.kind, track.length, track.next_step, 0, 0,
           seat.point.anchor_time, track.end, seat.point.anchor)


def write_together(tape: Tape, unit: int, seat: Any, until: float, shared: Any, mate: Any) -> None:
    """Write down the common motion of a servo, from its point to a time by its own clock [s]."""
    first, terms, how = tape.used[2], shared.terms, SERIES
    if shared.how != LONG_STEP:
        for n in range(terms):
            tape.numbers[first + n] = mate.speed[n]
            tape.numbers[first + terms + n] = mate.current[n]
        tape.used[2] = first + 2 * terms
    else:
        for n in range(DENSE):
            tape.numbers[first + n] = mate.dense[n]
        tape.used[2], how = first + DENSE, BY_STEP
    _write(tape, unit, how, seat, until, mode_of(mate.mode), terms, shared.length, 0.0,
           first, mate.returns, seat.point.anchor_time, mate.end, mate.start)


def _write(tape: Tape, unit: int, how: int, seat: Any, until: float, mode: Mode, kind: int, length: float,
           next_step: float, first: int, returns: int, t0: float, end: Any, start: Any) -> None:
    now, point, shown, drive, path = seat.decided, seat.point, seat.shown, drive_of(seat), seat.numbers.bridge
    u = seat.numbers.source.V * drive * (duty.share_of(path, shown.duty) if duty.present(seat.numbers.bridge) else 1.0)
    row = Row(unit, how, seat.origin, point.time, until, now.error, point.wiper, drive, now.silent, shown.duty,
              shown.goal, shown.reference, shown.trip, kind, mode, Piece(0.0, u, 0.0, 0.0, 0.0, 0.0, 0.0),
              since(piece_of(seat.tau), seat.origin), t0, length, next_step, vector_of(start), vector_of(end), first,
              returns)
    n = tape.used[0]
    if PLAIN:
        tape.motions[n] = row
    else:
        put_row(tape.motions[n], row)
    tape.used[0] = n + 1
