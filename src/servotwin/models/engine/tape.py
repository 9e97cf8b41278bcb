"""What a run of servos on a bus leaves behind: rows of numbers for motions and events, written while it goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.engine.joint_motion import ROOM, Dense
from servotwin.models.engine.memory import Point
from servotwin.models.engine.modes import Mode, Vector
from servotwin.models.engine.motion import Motion
from servotwin.models.engine.together import Together
from servotwin.models.terms.frame import Frame
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# How a motion is written down: by its own law, or the numbers of a common one, a series or a step.
ALONE, SERIES, DENSE = range(3)
# Events besides those of guards: how the bridge drives after it, silence, and a pulse that is not taken.
DRIVES, SILENCE, REFUSED = -10, -20, -30
ROW, EVENT = 42, 6  # numbers of a row
UNTIL, FIRST = 4, 24  # where a row of a motion has its end, and the place of its first number
_STEPS = 49  # numbers of a dense output
_MOST = 8  # rows of one servo between two looks at the room that is left


class Tape(NamedTuple):
    """Room for rows of motions, rows of events, and numbers of common motions; and how much of each is used."""

    motions: NDArray[np.float64]
    events: NDArray[np.float64]
    numbers: NDArray[np.float64]
    used: NDArray[np.int64]


class Track(NamedTuple):
    """The motion of a servo that moves on its own."""

    kind: int
    length: float
    end: Vector
    next_step: float


def track_of(m: Motion) -> Track:
    """Return what has to be known of a motion to have it again."""
    return Track(m.kind, m.length, m.end, m.next_step)


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


def write_alone(tape: Tape, unit: int, origin: float, before: Point, until: float, now: Frame, u: float, tau: Piece,
                track: Track) -> None:
    """Write down the motion of a servo on its own, from a point to a time by its own clock [s]."""
    _write(tape, unit, ALONE, origin, before, until, now, u, tau, track.kind, track.length, track.next_step, 0,
           0.0, before.anchor_time, track.end, before.anchor, before.mode)


def write_together(tape: Tape, unit: int, origin: float, before: Point, until: float, now: Frame, u: float, tau: Piece,
                   group: Together, j: int) -> None:
    """Write down the common motion of a servo, the j-th of those that move together."""
    first = tape.used[2]
    returns = 1.0 if group.members[j].returns else 0.0
    if group.terms > 0:
        for n in range(group.terms):
            tape.numbers[first + n] = group.speed[j * ROOM + n]
            tape.numbers[first + group.terms + n] = group.current[j * ROOM + n]
        tape.used[2] = first + 2 * group.terms
    else:
        _write_dense(tape, first, group.dense[j])
    _write(tape, unit, SERIES if group.terms > 0 else DENSE, origin, before, until, now, u, tau, group.terms,
           group.length, 0.0, first, returns, before.anchor_time, group.ends[j], group.starts[j], group.members[j].mode)


def _write_dense(tape: Tape, first: int, dense: Dense) -> None:
    for k in range(7):
        vector = dense[k]
        for n in range(7):
            tape.numbers[first + 7 * k + n] = vector[n]
    tape.used[2] = first + _STEPS


def _write(tape: Tape, unit: int, how: int, origin: float, before: Point, until: float, now: Frame, u: float,
           tau: Piece, kind: int, length: float, next_step: float, first: int, returns: float, anchor: float,
           end: Vector, start: Vector, mode: Mode) -> None:
    values = (1.0 * unit, 1.0 * how, origin, before.time, until, now.error, before.wiper, now.drive, 1.0 * now.silent,
              1.0 * mode.zone, 1.0 * mode.contact, 1.0 * mode.mesh, 1.0 * mode.motor, u,
              tau.start, tau.value, tau.slope, tau.amplitude, tau.frequency, tau.phase, tau.sweep,
              1.0 * kind, length, next_step, 1.0 * first, returns, anchor, before.step,
              end[0], end[1], end[2], end[3], end[4], end[5], end[6],
              start[0], start[1], start[2], start[3], start[4], start[5], start[6])
    n = tape.used[0]
    for k in range(len(values)):
        tape.motions[n, k] = values[k]
    tape.used[0] = n + 1
