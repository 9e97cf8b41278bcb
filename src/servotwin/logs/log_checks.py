"""Conditions on a log; every failure is one line that names the log and the column."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError, UnitError, UnknownNameError
from servotwin.logs.column_words import SAID
from servotwin.logs.columns import COMMANDS, TIME, UNITS, Column, dimension_of_signal, si_unit_of
from servotwin.parameters import GROUPS
from servotwin.parameters.groups import AT_LEAST_ONE, FRACTION, NOT_NEGATIVE, POSITIVE
from servotwin.parameters.servo import check_name, unit_of
from servotwin.text import LONGEST_FILE_NAME, checked_name
from servotwin.units import from_si, is_finite, is_masked
from servotwin.units.words import unit_word

if TYPE_CHECKING:
    from collections.abc import Iterator

    from servotwin.logs.formats import Layout
    from servotwin.tables import TextTable

# --- Conditions on a log; every failure is one line that names the log and the column ---------------------------------

FEWEST = 3  # samples
_Kind = TypeVar("_Kind", bound=np.generic)
_LARGEST_EDGES = 10_000_000
# signal or kind of command -> (SI unit, largest magnitude that a servo's log can hold, what was probably meant)
LIMITS = {
    **dict.fromkeys(("output_angle", "load_angle", "command_angle", "angle"), ("rad", 100.0, "degrees or counts?")),
    "pulse_width": ("s", 0.1, "microseconds?"),
    **dict.fromkeys(("voltage", "command_voltage", "feedback_voltage", "bus_voltage", "armature_voltage"),
                    ("V", 1e3, "millivolts or counts?")),
    **dict.fromkeys(("armature_current", "supply_current"), ("A", 100.0, "milliamperes?")),
}
_COMMANDS = ("pulse_width", "command_angle", "command_voltage")
_RANGES = {POSITIVE: (np.nextafter(0.0, 1.0), np.inf), NOT_NEGATIVE: (0.0, np.inf), AT_LEAST_ONE: (1.0, np.inf),
           FRACTION: (0.0, 1.0)}


def texts(name: object, motion: object, source: object) -> str:
    """Return how errors call a log."""
    if not isinstance(name, str) or not name:
        raise InputError("name of a log", got=name, allowed='a text, such as "run 1"')
    for key, value in (("motion", motion), ("source", source)):
        if not isinstance(value, str):
            raise InputError(f"log {name!r}: {key}", got=value, allowed="a text")
    checked_name("name of a log", name, LONGEST_FILE_NAME)
    checked_name(f"log {name!r}: motion", str(motion))
    return f"log {name!r}"


def choice(what: str, value: object, allowed: tuple[str, ...]) -> None:
    """Raise unless it is one of a few words."""
    if value not in allowed:
        raise InputError(what, got=value, allowed=", ".join(allowed))


def too_few(where: str, got: int) -> InputError:
    """Return the error of a log that is too short."""
    return InputError(where, got=f"{got} sample{'s' * (got != 1)}", allowed=f"at least {FEWEST} samples")


def times(where: str, time: object) -> NDArray[np.float64]:
    """Return the times; they increase, and there are at least three."""
    t = _numbers(f"{where}: time", time)
    if t.size < FEWEST:
        raise too_few(where, t.size)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise InputError(f"{where}: time of sample {bad[0]}", got=float(t[bad[0]]), allowed="a finite number [s]")
    bad = np.flatnonzero(np.diff(t) <= 0.0)
    if bad.size:
        k = int(bad[0]) + 1
        stands = "stands still" if t[k] == t[k - 1] else "runs backwards"
        raise InputError(f"{where}: time {stands} at sample {k}", got=f"{t[k]:.9g} s after {t[k - 1]:.9g} s",
                         allowed="increasing times")
    return frozen(t)


def command(where: str, values: object, kind: str, hold: str, n: int) -> NDArray[np.float64]:
    """Return the command; it is finite or, of pulses and angles that are held, nan; a pulse width is positive."""
    y = _column(f"{where}: command", values, n)
    silent = np.isnan(y)
    if n and silent.all():
        raise InputError(f"{where}: command", got="no value in any sample", allowed="at least one value")
    bad = np.flatnonzero(~np.isfinite(y) & ~(silent & (kind != "voltage") & (hold == "previous")))
    if bad.size:
        why = "a finite number" + ("" if not silent[bad[0]] else "; only pulses and angles may have nan, for no pulses"
                                   if kind == "voltage" else '; nan means no pulses only with command_hold "previous"')
        raise InputError(f"{where}: command of sample {bad[0]}", got=float(y[bad[0]]), allowed=why)
    y[silent] = np.nan  # one and the same for hashes, whatever nan was given
    if kind == "pulse_width" and (y <= 0.0).any():
        k = int(np.argmax(y <= 0.0))
        raise InputError(f"{where}: pulse width of sample {k}", got=f"{y[k]:g} s",
                         allowed="a positive width, or nan where no pulse is sent")
    _plausible(f"{where}: command ({kind})", y, kind)
    return frozen(y)


def measured(where: str, columns: object, n: int, angles: tuple[str, ...]) -> dict[str, NDArray[np.float64]]:
    """Return what was measured; one signal tells the angle, and no value is infinite."""
    if not isinstance(columns, Mapping):
        raise InputError(f"{where}: measured", got=type(columns).__name__, allowed="a mapping of names to arrays")
    made = {}
    for name, values in columns.items():
        if name not in UNITS:
            raise UnknownNameError(f"signal of {where}", str(name), UNITS)
        if name in _COMMANDS:
            raise InputError(f"{where}: measured signals", got=name, allowed="no command, which belongs in `command`")
        y = _column(f"{where}: {name}", values, n)
        bad = np.flatnonzero(np.isinf(y))
        if bad.size:
            raise InputError(f"{where}: {name} of sample {bad[0]}", got=float(y[bad[0]]),
                             allowed="a finite number, or nan where nothing was measured")
        _plausible(f"{where}: {name}", y, name)
        made[name] = frozen(y)
    if not any(name in made for name in angles):
        raise InputError(f"{where}: measured signals", got=", ".join(made) or "none",
                         allowed=f"among them {' or '.join(angles)}")
    return made


def not_measured(log: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """Return the error of a signal that a log does not have."""
    return UnknownNameError(f"measured signal of log {log!r}", name, known)


def switch(where: str, values: object, n: int) -> NDArray[np.bool_]:
    """Return an array of true and false, which may be given as 1 and 0."""
    y = _column(f"{where}: torque_on", values, n)
    bad = np.flatnonzero((y != 0.0) & (y != 1.0))
    if bad.size:
        raise InputError(f"{where}: torque_on of sample {bad[0]}", got=float(y[bad[0]]), allowed="true or false")
    return frozen(np.asarray(y == 1.0))


def parameters(where: str, values: object) -> dict[str, float]:
    """Return the servo parameters of a log; their names are known, and each is a number within its range."""
    made = {}
    for name, value in _mapping(f"{where}: parameters", values).items():
        group, key = check_name(name)
        rule = GROUPS[group].__dataclass_fields__[key].metadata["rule"]
        if isinstance(rule, tuple) or rule == "table":
            raise InputError(f"{where}: parameters, {name}", got=value, allowed="the name of a number")
        low, high = _RANGES.get(rule, (-np.inf, np.inf))
        if not is_finite(value) or not low <= float(value) <= high:
            raise InputError(f"{where}: parameters, {name}", got=value, allowed=f"{rule} [{unit_of(name)}]")
        made[name] = float(value)
    return made


def conditions(where: str, values: object) -> dict[str, float | str]:
    """Return the labels of a log: texts and finite numbers."""
    made: dict[str, float | str] = {}
    for name, value in _mapping(f"{where}: conditions", values).items():
        if not isinstance(name, str) or not (isinstance(value, str) or is_finite(value)):
            raise InputError(f"{where}: conditions, {name}", got=value, allowed="a text or a finite number")
        for text in (name, value):
            if isinstance(text, str):
                checked_name(f"{where}: conditions, {name}", text)
        made[name] = value if isinstance(value, str) else float(value)
    return made


def windows(where: str, values: object) -> tuple[tuple[float, float], ...]:
    """Return the windows of time that are left out; each starts before it stops."""
    made = []
    if not isinstance(values, list | tuple):
        raise InputError(f"{where}: left_out", got=values, allowed="a list of windows [start, stop]")
    for window in values:
        if (not isinstance(window, list | tuple) or len(window) != 2 or not all(is_finite(x) for x in window)
                or not window[0] < window[1]):
            raise InputError(f"{where}: left_out", got=window, allowed="windows [start, stop] with start < stop [s]")
        made.append((float(window[0]), float(window[1])))
    return tuple(made)


def frame_edges(time: NDArray[np.float64], sent: NDArray[np.bool_], period: object) -> NDArray[np.float64]:
    """Return regular frame edges [s], counted from the first sample, without those while no pulses are sent."""
    if not is_finite(period) or not period > 0.0:
        raise InputError("frame_period", got=period, allowed="a positive number [s]")
    since = time - time[0]
    count = np.floor(since[-1] / period * (1.0 + 1e-12)) + 1.0
    if not count <= _LARGEST_EDGES:
        raise InputError("frame_period", got=period, allowed=f"at most {_LARGEST_EDGES} frames in a log")
    edges = np.arange(int(count)) * float(period)
    # a sample that is a rounding later than the edge still decides it
    latest = np.searchsorted(since, edges + 1e-9 * period, side="right") - 1
    return np.asarray(edges[sent[latest]])


def _mapping(what: str, values: object) -> Mapping[str, Any]:
    if not isinstance(values, Mapping):
        raise InputError(what, got=values, allowed="a mapping of names to values")
    return values


def _numbers(what: str, values: object) -> NDArray[np.float64]:
    try:
        y = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(what, got="values that are no numbers", allowed="an array of numbers") from None
    if is_masked(values):  # what a mask hides would count
        raise InputError(what, got="a masked array", allowed="numbers, nan where nothing was measured")
    if y.ndim != 1:
        raise InputError(what, got=f"an array of shape {y.shape}", allowed="an array with one dimension")
    return y


def _column(what: str, values: object, n: int) -> NDArray[np.float64]:
    y = _numbers(what, values)
    if y.size != n:
        raise InputError(what, got=f"{y.size} values", allowed=f"{n}, as many as times")
    return y


def largest_of(name: str) -> float:
    """Return the largest magnitude (SI) that a servo's log can hold of a signal or kind of command."""
    return LIMITS.get(name, ("", np.inf, ""))[1]


def _plausible(what: str, values: NDArray[np.float64], name: str) -> None:
    """Raise if a value is too large for its unit."""
    unit, limit, meant = LIMITS.get(name, ("", np.inf, ""))
    largest = values[np.argmax(np.abs(np.nan_to_num(values)))]
    if abs(largest) > limit:
        raise InputError(what, got=f"{largest:g} {unit}", allowed=f"at most {limit:g} {unit} in magnitude: {meant}")


def frozen(values: NDArray[_Kind]) -> NDArray[_Kind]:
    """Return an array to which nobody writes any more."""
    values.setflags(write=False)
    return values

# --- Columns that no file holds ---------------------------------------------------------------------------------------

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_VALUE = re.compile(rf"\s*({_NUMBER})\s*([^\W\d_]+)\s*(?:@\s*({_NUMBER})\s*([^\W\d_]+)\s*)?")
_KINDS = {dimension_of_signal(name): name for name in COMMANDS}
_HERTZ = {"Hz": 1.0, "hz": 1.0, "kHz": 1e3}


def is_defined(text: str) -> bool:
    """Tell whether words define a column.

    Examples
    --------
    >>> [is_defined(text) for text in ("50Hz", "153deg@0s", "angle", "A0", "2")]
    [True, True, False, False, False]
    """
    return all(match is not None and (match[2] in _HERTZ or unit_word(match[2]) is not None)
               for match in map(_VALUE.fullmatch, text.split(",")))


def checked_definition(what: str, signal: str, text: str) -> tuple[str, str]:
    """Return the signal that words define, and the unit of its numbers.

    Raises
    ------
    InputError
        If they define no time and no command.

    Examples
    --------
    >>> checked_definition("--commanded", "command", "153deg@0s")
    ('command_angle', 'deg')
    >>> checked_definition("--rate", "time", "50Hz")
    ('time', 's')
    """
    if signal == TIME:
        rate_of(what, text)
        return TIME, si_unit_of(TIME)
    found = {_part(what, part)[1] for part in text.split(",")}
    known = {unit_word(unit) for unit in found}
    unit, dimension = next(iter(known)) or ("", "")
    if len(known) > 1 or dimension not in _KINDS:
        raise UnitError(what, got=text, allowed="one unit: us, ms (pulse width), deg, rad (angle) or V, mV (voltage)")
    if signal in COMMANDS and signal != _KINDS[dimension]:
        raise UnitError(what, got=text, allowed=f"a value in {si_unit_of(signal)}")
    times = [_part(what, part)[2] for part in text.split(",")]
    if times[0] > 0.0:
        raise InputError(what, got=text, allowed="what was commanded at the start of the log too, such as "
                         f"0{unit}@0s,{text}")
    if any(later <= time for time, later in pairwise(times)):
        raise InputError(what, got=text, allowed="jumps in the order of their times, such as 0deg@0s,90deg@0.5s")
    return _KINDS[dimension], unit


def rate_of(what: str, text: str) -> float:
    """Return the rows per second that words say [Hz].

    Raises
    ------
    InputError
        If they say none.
    """
    match = _VALUE.fullmatch(text)
    if match is None or match[2] not in _HERTZ or match[3] or not 0.0 < float(match[1]) < 1e7:
        raise InputError(what, got=text, allowed="a rate of rows, such as 50Hz")
    return float(match[1]) * _HERTZ[match[2]]


def defined_times(text: str, count: int) -> NDArray[np.float64]:
    """Return the times of rows at a rate [s].

    Examples
    --------
    >>> defined_times("50Hz", 3).tolist()
    [0.0, 0.02, 0.04]
    """
    return np.asarray(np.arange(count) / rate_of("rate", text))


def defined_commands(signal: str, text: str, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the commands that words say, in SI; times of jumps count from the first row.

    Examples
    --------
    >>> defined_commands("pulse_width", "1500us@0s,1600us@0.05s", np.array([5.0, 5.02, 5.06])).tolist()
    [0.0015, 0.0015, 0.0016]
    """
    parts = [_part("command", part) for part in text.split(",")]
    at = np.array([time_ for _, _, time_ in parts])
    values = units.to_si(np.array([value for value, _, _ in parts]), (unit_word(parts[0][1]) or ("",))[0],
                         dimension_of_signal(signal))
    which = np.searchsorted(at, time - time[0] + 1e-9, side="right") - 1
    return np.asarray(np.asarray(values)[np.maximum(which, 0)])


def _part(what: str, text: str) -> tuple[float, str, float]:
    """Return value, unit and time [s] of one jump; without a time it came before the first row."""
    match = _VALUE.fullmatch(text)
    unit = None if match is None else unit_word(match[2])
    when = None if match is None or match[4] is None else unit_word(match[4])
    if match is None or unit is None or (match[4] is not None and (when is None or when[1] != "time")):
        raise InputError(what, got=text, allowed="a value with its unit, such as 153deg, or jumps such as "
                         "0deg@0s,153deg@0.5s")
    seconds = 0.0 if when is None else float(match[3]) * float(units.factor(when[0], "time"))
    return float(match[1]), match[2], seconds

# --- Rows whose numbers no log of a servo can hold, among others that do ----------------------------------------------

PULSES = (200e-6, 4e-3)  # s: servos take 500 to 2500 us, those of helicopters half of it
_PEAKS = ("armature_current", "supply_current")  # milliamperes that count as amperes are too large at peaks alone
_MOST = 0.2  # of the rows: with more it is the unit that is wrong


def impossible(table: TextTable, layout: Layout) -> NDArray[np.bool_]:
    """Return which rows hold such a number; a column that has many has another unit, and is refused as a whole."""
    found = np.zeros(len(table.rows), np.bool_)
    for name, column in _bounded(layout):
        beyond = _beyond(table, name, column)
        if name == "pulse_width" and (beyond[1:] & beyond[:-1]).any():
            continue  # such pulses were sent: what is torn stands alone
        if beyond.mean() <= _MOST:
            found |= beyond
    return found


def check_said(table: TextTable, layout: Layout) -> None:
    """Raise if a column that was said to hold pulses holds none that a servo takes: names the column and its values."""
    column = layout.columns.get("pulse_width")
    if column is None or not any(one.column == column.column and one.known == SAID for one in layout.shown):
        return
    values = column.to_si(table.numbers(column.column, missing=np.nan), "pulse_width")
    longest = float(np.nanmax(values, initial=-np.inf))
    if 0.0 < longest < PULSES[0]:
        raise InputError(f"{table.path}: pulses of {column.column}", got=f"{1e6 * longest:.4g} us at most",
                         allowed=f"{1e6 * PULSES[0]:g} us or more: milliseconds, degrees or ticks?")


def refuse(one: TextTable, layout: Layout) -> None:
    """Raise what is impossible in a table of one row: names file, line and column."""
    for name, column in _bounded(layout):
        if _beyond(one, name, column)[0]:
            unit = "us" if column.unit == "ns" else column.unit
            low, high = (from_si(value, unit, dimension_of_signal(name)) for value in _range(name))
            raise InputError(f"{one.path}: line {one.rows[0].line}, {column.column}",
                             got=one.cells(column.column)[0],
                             allowed=f"{low:.6g} to {high:.6g} {unit}, as in the other rows")


def _bounded(layout: Layout) -> Iterator[tuple[str, Column]]:
    """Give the columns whose numbers have bounds that a wrong unit does not pass at times."""
    for name, column in layout.columns.items():
        if name not in _PEAKS and not is_defined(column.column) and name in UNITS and np.isfinite(largest_of(name)):
            yield name, column


def _range(name: str) -> tuple[float, float]:
    return PULSES if name == "pulse_width" else (-largest_of(name), largest_of(name))


def _beyond(table: TextTable, name: str, column: Column) -> NDArray[np.bool_]:
    values = column.to_si(table.numbers(column.column, missing=np.nan), name)
    low, high = _range(name)
    beyond = (values < low) | (values > high)
    return beyond & (values > 0.0) if name == "pulse_width" else beyond
