"""Signals of a servo at a bench, rows of all its signals and events, and the shapes of commands that it is given."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine.events import crossings
from servotwin.models.engine.log import Row
from servotwin.models.engine.memory import FLAT, Inputs, Memory, in_force
from servotwin.models.engine.observe import Observed, observed, told_by
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms import duty
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece, piece_range, piece_value

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    Floats = NDArray[np.float64]
    Indices = NDArray[np.int64]


# --- Signals of a servo at a bench ------------------------------------------------------------------------------------

USED, NEXT, LEFT = 5, 3, 4
"""Numbers of what is used: rows, events, pulses, which look is next, and how many steps are left; 0: as it takes."""
TOO_LONG = -2  # as a status: no steps are left
COMMANDS = ("command_voltage", "command_angle", "pulse_width")
COLUMNS = ("time", *Observed._fields, "output_angle", "output_speed", *COMMANDS)
"""Columns of a row, before those of a servo are picked (SI)."""
WIDTH = len(COLUMNS)
_ANGLE, _SPEED, _TORQUE = (COLUMNS.index(name) for name in ("motor_angle", "motor_speed", "motor_torque"))
_OUTPUT = COLUMNS.index("output_angle")
_LATE = 1e-12  # of an instant: so much before a tick it is the tick
SHOWN = {code: name for code, name in enumerate(crossings.NAMES) if name != "zone" and not crossings.is_usual(code)}
"""Names of events that do not come with every pulse, by their numbers."""


class Lines(NamedTuple):
    """How what a servo follows stands for commands: straight lines, and the reduction of its gear."""

    per_volt: float  # command_voltage = per_volt x + volts
    volts: float
    per_angle: float  # command_angle
    angle: float
    per_width: float  # pulse_width
    width: float
    reduction: float  # of the motor's shaft


class Switch(NamedTuple):
    """How a bridge drives: −1, 0 or +1; what it does without torque, else 0; whether pulses stay away, 1 or 0."""

    drive: float
    off: float
    silent: int


class Screen(NamedTuple):
    """Room for what shows: rows of `COLUMNS`, events (time, code); how much is used, and at `NEXT` what comes."""

    rows: Any
    events: Any
    used: Indices


class Looks(NamedTuple):
    """When to look: at k/rate for k from `next` on, as long as that is before `until` [s]."""

    next: int
    rate: float
    until: float
    at_end: int  # 1: at `until`, too
    switches: int  # 1: just before and just after a bridge switches, too


class Low(NamedTuple):
    """The least voltage of a supply since the latest look [V], and whether a row of it stands behind those used (1)."""

    voltage: float
    pending: int


NO_LOW = Low(math.inf, 0)


def first_look(start: float, rate: float) -> int:
    """Return the number of the first look after a time [s]."""
    k = math.floor(start * rate) + 1
    return k + 1 if k / rate <= start else k


class Said(NamedTuple):
    """Signals of a chip or a program, by the names of their states."""

    drive: float
    error: float
    silent: int
    duty: float
    goal: float
    r: float
    trip: int


def told_of(memory: Memory, program: bool) -> Said:
    """Return what shows of a chip or a program now; it may change in place."""
    chip = memory.chip
    if not program:
        return Said(chip.drive, chip.error, chip.silent, 0.0, 0.0, 0.0, 0)
    firm = memory.firm[0]
    drive = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
    return Said(drive, chip.error, chip.silent, firm.duty, firm.goal, firm.r, firm.trip)


def said_by(row: Row) -> Said:
    """Return what showed of a chip or a program in a motion."""
    return Said(row.drive, row.error, row.silent, row.duty, row.goal, row.reference, row.trip)


def switch_of(told: Said) -> Switch:
    """Return how a bridge drives now."""
    return Switch(told.drive, told.duty if abs(told.duty) > 1.0 else 0.0, told.silent)


def write(screen: Screen, lines: Lines, inputs: Inputs, told: Said, numbers: Numbers, mode: Mode, u: float, tau: float,
          y: Vector, wiper: float, time: float) -> None:
    """Write a row of a servo that stands at y, whose numbers are those of this instant."""
    n = screen.used[0]
    shown = observed(numbers, inputs.curve, mode, u, tau, y, wiper, told.drive, told.error)
    if duty.present(numbers.bridge):
        shown = told_by(numbers.bridge, told, shown)
    piece, _ = in_force(inputs.command, 0.0, time, 0.0)
    put_row(screen.rows, n, time, shown, y, lines, piece_value(piece, time))
    screen.used[0] = n + 1


def put_row(rows: Any, n: int, time: float, shown: Observed, y: Vector, lines: Lines, command: float) -> None:
    """Fill a row."""
    rows[n, 0] = time
    for k in range(len(shown)):
        rows[n, 1 + k] = shown[k]
    rows[n, _ANGLE] *= lines.reduction
    rows[n, _SPEED] *= lines.reduction
    rows[n, _TORQUE] /= lines.reduction
    rows[n, _OUTPUT], rows[n, _OUTPUT + 1] = y.q, y.w
    rows[n, _OUTPUT + 2] = lines.per_volt * command + lines.volts
    rows[n, _OUTPUT + 3] = lines.per_angle * command + lines.angle
    rows[n, _OUTPUT + 4] = lines.per_width * command + lines.width


def note(screen: Screen, time: float, code: int) -> None:
    """Write an event down, unless it comes with every pulse."""
    n = screen.used[1]
    if n < len(screen.events) and not crossings.is_usual(code):
        screen.events[n, 0], screen.events[n, 1] = time, 1.0 * code
        screen.used[1] = n + 1


def taken_up(screen: Screen, low: Low, voltage: float) -> None:
    """Count the row of the least voltage where it lies below another one, too, that comes next [V]."""
    if low.pending > 0 and low.voltage < voltage - FLAT and screen.used[0] < len(screen.rows) - 1:
        screen.used[0] += 1


def is_before(time: float, end: float, program: bool) -> bool:
    """Tell whether a time comes before the end of a motion [s]; that of a program's is the tick that is next to it."""
    return time * (1.0 + _LATE) < end if program else time < end


# --- The shapes of commands that a bench can be given, as rows of pieces ----------------------------------------------

FIELDS: dict[str, tuple[str, ...]] = {
    "hold": ("value",),
    "step": ("low", "high", "period"),
    "sine": ("mean", "amplitude", "frequency"),
    "sweep": ("mean", "amplitude", "start_frequency", "end_frequency", "duration"),
    "staircase": ("low", "high", "steps", "dwell"),
    "recorded": ("time", "value", "hold"),
}
"""Numbers of each shape, beside its `unit`."""
PERIODS = 1000  # of a step that repeats: then it stays
_HOLD, _STEP, _SINE, _SWEEP, _STAIRCASE, RECORDED = range(6)
_TURN = 2.0 * math.pi


def shaped(shape: int, given: Floats, time: Floats, value: Floats, table: Floats) -> int:
    """Put the pieces of a shape that begins at 0 into a table; return how many there are.

    Parameters
    ----------
    shape : int
        Its place in `FIELDS`.
    given : ndarray
        Its numbers in the order of its fields; of a record 1 for straight lines between samples, 0 for steps.
    time, value : ndarray, shape (n,)
        Of a record; times count from the first.
    table : ndarray, shape (m, 7)
    """
    if shape == _HOLD or (shape == _STEP and given[2] == 0.0):
        _put(table, 0, Piece(0.0, given[0] if shape == _HOLD else given[1], 0.0, 0.0, 0.0, 0.0, 0.0))
        return 1
    if shape == _STEP:
        count = 0
        for half in range(2 * PERIODS + 1):
            count = _held(table, count, 0.5 * given[2] * half, given[0] if half % 2 == 0 else given[1])
        return count
    if shape == _SINE:
        _put(table, 0, Piece(0.0, given[0], 0.0, given[1], _TURN * given[2], 0.0, 0.0))
        return 1
    if shape == _SWEEP:
        first, last, duration = _TURN * given[2], _TURN * given[3], given[4]
        _put(table, 0, Piece(0.0, given[0], 0.0, given[1], first, 0.0, (last - first) / duration))
        _put(table, 1, Piece(duration, given[0], 0.0, given[1], last, 0.5 * (first + last) * duration % _TURN, 0.0))
        return 2
    if shape == _STAIRCASE:
        return _staircase(given[0], given[1], round(given[2]), given[3], table)
    return _recorded(given[0] == 1.0, time, value, table)


def _staircase(low: float, high: float, steps: int, dwell: float, table: Floats) -> int:
    count = 0
    for k in range(2 * steps + 1):
        n = min(k, 2 * steps - k)
        count = _held(table, count, dwell * k, high if n == steps else low + n * ((high - low) / steps))
    return count


def _recorded(lines: bool, time: Floats, value: Floats, table: Floats) -> int:
    count = 0
    for k in range(len(time)):
        if not lines:
            count = _held(table, count, time[k] - time[0], value[k])
            continue
        slope = 0.0
        if k + 1 < len(time):
            slope = (value[k + 1] - value[k]) / (time[k + 1] - time[0] - (time[k] - time[0]))
        _put(table, k, Piece(time[k] - time[0], value[k], slope, 0.0, 0.0, 0.0, 0.0))
        count = k + 1
    return count


def _held(table: Floats, count: int, time: float, value: float) -> int:
    """Put a value that holds from a time on behind others, if it is another one; return how many there are then."""
    if count > 0 and table[count - 1, 1] == value:
        return count
    _put(table, count, Piece(time, value, 0.0, 0.0, 0.0, 0.0, 0.0))
    return count + 1


def _put(table: Floats, n: int, piece: Piece) -> None:
    for k in range(len(piece)):
        table[n, k] = piece[k]


def scaled(table: Floats, count: int, gain: float, offset: float) -> None:
    """Let pieces be gain · y + offset."""
    for n in range(count):
        table[n, 1] = gain * table[n, 1] + offset
        table[n, 2] *= gain
        table[n, 3] *= gain


def extremes(table: Floats, count: int) -> tuple[float, float, int, int]:
    """Return the lowest and the highest value until the last piece starts, and in which pieces these are.

    A sinusoid counts with its whole amplitude.
    """
    low, high, lowest, highest = math.inf, -math.inf, 0, 0
    for n in range(count):
        row = table[n]
        end = table[min(n + 1, count - 1), 0]
        least, most = piece_range(Piece(row[0], row[1], row[2], row[3], row[4], row[5], row[6]), end)
        if least < low:
            low, lowest = least, n
        if most > high:
            high, highest = most, n
    return low, high, lowest, highest
