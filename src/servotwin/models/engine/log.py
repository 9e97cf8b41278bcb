"""The log of a run: rows of motions and of events, written while it lasts, from which all signals follow.

Compiled, rows are numpy's records; in plain Python named tuples in lists.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from servotwin.models.engine.motions.motion import Motion
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.state.records import record_reader, record_writer
from servotwin.physics.pieces import Piece

PLAIN = True  # the compiler takes it for False
PAUSED = -1
"""As a status: the log is full, or the run has taken as many steps as it was to take."""
ALONE, SERIES, DENSE = range(3)
"""How a motion is known: by its own law, or by numbers of a common one, a series or a step."""
MOTIONS, EVENTS, NUMBERS, LEFT, IDLE, SHORT, BEGUN, KEEPS, READ = range(9)
"""Counters of a log: rows and numbers written, steps left, steps in no time one after the other, short ones between
two contacts; whether any motion was written, what it keeps, and how many readings were taken."""
COUNTS = 9
FEW, ALL, READINGS = range(3)
"""The parts of a log: events, as far as there is room; motions and events, with room for both; readings at given times
alone, for which there is always room."""
_AT_ONCE = 6  # events of one step at most


class Row(NamedTuple):
    """A motion of a servo between two times, and what holds with it; times from `origin` on [s]."""

    unit: int  # which servo
    how: int
    origin: float
    start: float
    end: float
    error: float  # the latest that the chip has decided on [s]
    wiper: float  # angle of the potentiometer at the start [rad]
    drive: float  # how the bridge drives: −1, 0 or +1
    silent: int  # 1 while pulses stay away from the bridge
    duty: float  # of a digital servo's bridge, or `terms.duty.OPEN`, `BRAKED`
    goal: float  # of its program [rad]
    reference: float  # [rad]
    trip: int  # which protection acts
    kind: int  # of motion; of a series how many terms
    mode: Mode
    u: Piece
    tau: Piece
    t0: float  # when the motion began; it may be before the row's start
    length: float
    next_step: float
    y: Vector  # where it began
    last: Vector  # of a step: where it ends
    first: int  # of a common motion: place of its first number
    returns: int  # of a common motion: 1 through diodes, against the bus alone


class Happened(NamedTuple):
    """Something that happened: when [s], at which output angle [rad], and what, a number of `events.kinds`."""

    time: float
    angle: float
    kind: int


class Log(NamedTuple):
    """Room for rows of motions and of events and for numbers of common motions, and `COUNTS` counts."""

    motions: Any
    events: Any
    numbers: Any
    counts: Any


class Readings(NamedTuple):
    """Given times [s], and what stands at them, shape (18, n).

    These are angle, speed, contact, drive, error, angle of the potentiometer, and what only few servos have: current,
    temperatures of winding and housing, angle and speed of the motor at the output shaft, place in the play and contact
    of the motor there, silence of the chip; duty, goal, reference and trip of a program. With `nearly`, a spring, a
    pendulum and friction that fades count in a digital servo as if their torques stayed within a tick.
    """

    times: Any
    values: Any
    nearly: bool


NO_READINGS = Readings(0.0, 0.0, False)
NO_ROWS = 0.0  # in the place of rows that a log does not keep
WITH_ROWS = ("ALL", "FEW")  # names of what a log with rows keeps


row_of = record_reader("row_of", Row)
put_row = record_writer("put_row", Row)


def has_rows(keeps: int) -> bool:
    """Tell whether a log has rows, by what it keeps."""
    return keeps == ALL or keeps == FEW


def is_full(log: Log) -> bool:
    """Count a step; tell whether it has to wait until the log has been read.

    A log that does not keep all is never full.
    """
    log.counts[LEFT] -= 1
    return bool(log.counts[LEFT] < 0 or (log.counts[KEEPS] == ALL and (
        log.counts[MOTIONS] >= len(log.motions) or log.counts[EVENTS] + _AT_ONCE > len(log.events))))


def write_motion(log: Log, row: Row) -> None:
    """Write a motion down."""
    n = log.counts[MOTIONS]
    if PLAIN:
        log.motions[n] = row
    else:
        put_row(log.motions[n], row)
    log.counts[MOTIONS], log.counts[BEGUN] = n + 1, 1


def write_event(log: Log, time: float, kind: int, angle: float) -> None:
    """Write an event down; where there is room for some, and no more, it is only counted."""
    n = log.counts[EVENTS]
    if n < len(log.events):
        if PLAIN:
            log.events[n] = Happened(time, angle, kind)
        else:
            row = log.events[n]
            row.time, row.angle, row.kind = time, angle, kind
    if len(log.events) > 0:
        log.counts[EVENTS] = n + 1


def motion_row(unit: int, origin: float, start: float, end: float, error: float, wiper: float, drive: float,
               silent: int, told: tuple[float, float, float, int], m: Motion) -> Row:
    """Return the row of a motion by its own law; `told` is what shows of a program."""
    now, goal, reference, trip = told
    return Row(unit, ALONE, origin, start, end, error, wiper, drive, silent, now, goal, reference, trip, m.kind, m.mode,
               m.u, m.tau, m.t0, m.length, m.next_step, m.start, m.end, 0, 0)
