"""What a run of servos on a bus leaves behind: rows of numbers for motions and events, written while it goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine.bus.bus_records import DENSE as _DENSE
from servotwin.models.engine.bus.bus_records import ROOM, drive_of, mode_of, piece_of, vector_of
from servotwin.models.engine.log import ALONE, DENSE, SERIES, Row, put_row
from servotwin.models.engine.memory import since
from servotwin.models.engine.motions.motion import LONG_STEP
from servotwin.models.state.modes import Mode
from servotwin.models.terms import duty
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

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
        for n in range(_DENSE):
            tape.numbers[first + n] = mate.dense[n]
        tape.used[2], how = first + _DENSE, DENSE
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
