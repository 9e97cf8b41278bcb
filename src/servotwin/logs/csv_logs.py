"""Logs as CSV files with a JSON sidecar, in and out."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, OutputError, OutputExistsError, UnitError, UnknownNameError
from servotwin.logs import columns as names
from servotwin.logs.column_words import COMMAND, SAID, SHORT, Wanted, column_said, wanted_columns
from servotwin.logs.columns import (
    COMMANDS,
    SWITCH,
    TIME,
    Column,
    Guess,
    are_counts,
    clock_of,
    columns_of,
    dimension_of_signal,
    guess,
    is_increasing,
    range_of,
    si_unit_of,
    switch_value,
)
from servotwin.logs.formats import DROP, SPREAD, TORN, Layout, ReadColumn, Reading
from servotwin.logs.log import ANGLES, Log
from servotwin.logs.log_checks import check_said, checked_definition, defined_commands, is_defined
from servotwin.logs.mends import (
    Timed,
    checked_mends,
    say,
    sound,
    timed,
    without_text,
    without_thousands,
    without_torn,
)
from servotwin.logs.register_columns import RawRegisters, named_after_any, raw_registers, register_columns
from servotwin.logs.sidecar import FOLDER_FILE, Sidecar, json_bytes, sidecar_of, sidecar_path, sidecar_words
from servotwin.parameters import Servo, write_file
from servotwin.tables import TextTable, csv_text, read_table
from servotwin.tables.reading import ARRIVAL, MISSING, NUL
from servotwin.units.words import COUNTS, unit_shown, units_written

if TYPE_CHECKING:
    from servotwin.tables.reading import TextTable

# --- The step that an angle shows where nobody logged the command -----------------------------------------------------

_SHARE = 0.05  # of the rows, that are the begin and the end of a log
_LEAST = math.radians(5.0)
_STRAYS = 0.05  # of the way, by which noise may go back
_BEYOND = 0.25  # of the way: what a shaft overshoots


class Step(NamedTuple):
    """A step of the angle [rad]."""

    before: float
    after: float

    @property
    def command(self) -> str:
        """The time of the command by `--commanded`: the command came with the first row, or before it."""
        return f"{math.degrees(self.after):.4g}deg@0s"

    @property
    def words(self) -> str:
        """From where to where."""
        return f"from {math.degrees(self.before):.4g} to {math.degrees(self.after):.4g} deg"


def step_of(table: TextTable, made: Mapping[str, tuple[Column, str]]) -> Step | None:
    """Return the one step that the angle of a table shows; None where it has no angle, or another motion."""
    if "output_angle" not in made:
        return None
    column = made["output_angle"][0]
    try:
        return step_in(column.to_si(table.numbers(column.column, missing=math.nan), "output_angle"))
    except InputError:
        return None


def step_in(angle: NDArray[np.float64]) -> Step | None:
    """Return the one step of an angle, None where the motion is another one.

    Examples
    --------
    >>> step = step_in(np.radians(np.interp(np.arange(100.0), [0.0, 20.0, 60.0, 99.0], [0.0, 0.0, 90.0, 90.0])))
    >>> step.words, step.command
    ('from 0 to 90 deg', '90deg@0s')
    >>> step_in(np.sin(np.arange(100.0))) is None
    True
    """
    angle = angle[np.isfinite(angle)]
    few = max(3, int(_SHARE * len(angle)))
    if len(angle) < 4 * few:
        return None
    before, after = float(np.median(angle[:few])), float(np.median(angle[-few:]))
    way = after - before
    last = angle[-2 * few:]
    if abs(way) < _LEAST or abs(np.median(last[:few]) - after) > _STRAYS * abs(way):  # it moves on
        return None
    gone = (angle - before) / way  # 0 to 1
    arrived = int(np.argmax(gone >= 1.0 - _STRAYS)) if (gone >= 1.0 - _STRAYS).any() else len(gone) - 1
    back = float((np.maximum.accumulate(gone[:arrived + 1]) - gone[:arrived + 1]).max())
    settled = gone[arrived:]
    if back > _STRAYS or settled.min() < 1.0 - _BEYOND or settled.max() > 1.0 + _BEYOND:
        return None
    return Step(before, after)

# --- Which column of a table is which signal: as its name says, as the user says, or guessed and shown ----------------

NAMED, SIDECAR = "named", "sidecar"
NEEDS = (TIME, COMMAND, "angle")
"""Columns that make a table a log."""
_SHORT = {**{name: short for short, name in SHORT.items()}, TIME: TIME}
_DIMENSIONS = {names.PULSE: "time", names.COMMAND_ANGLE: "angle", names.ANGLE: "angle", names.TIME: "time",
               names.SOME_TIME: "time", names.FEEDBACK: "voltage", names.VOLTAGE: "voltage", names.SPEED: "speed",
               names.SUPPLY_CURRENT: "current", names.ARMATURE_CURRENT: "current"}
_SIGNALS = {names.PULSE: "pulse_width", names.COMMAND_ANGLE: "command_angle", names.ANGLE: "output_angle",
            names.TIME: TIME, names.SOME_TIME: TIME, names.FEEDBACK: "feedback_voltage"}
_OPTIONAL = (names.SUPPLY_CURRENT, names.ARMATURE_CURRENT, names.VOLTAGE, names.SPEED)
_COMMAND_OF = {"time": "pulse_width", "angle": "command_angle", "voltage": "command_voltage"}



class _Candidate(NamedTuple):
    column: str
    meaning: names.Meaning
    found: Guess | None

    @property
    def rank(self) -> int:
        """How well it is known: 2 by a unit in its name, 1 by its values, 0 hardly."""
        if self.found is None:
            return 0
        return 2 if self.found.why == names.UNIT_IN_NAME else 1


def is_known_name(column: str) -> bool:
    """Return whether a name says what its column is."""
    try:
        return bool(columns_of([column], "")) or names.meaning_of(column) is not None
    except InputError:  # nearly the name of a signal
        return True


def layout_of(table: TextTable, sidecar: Mapping[str, Column] | None, wanted: Mapping[str, Wanted], *,
              needs: Sequence[str] = NEEDS, unknown_step: bool = False, raw: RawRegisters | None = None) -> Layout:
    """Return which column of a table is which signal.

    Words of `wanted` count before the sidecar, that before raw registers and the names of `servotwin`; what these
    leave out is guessed from names, units and values: time, a command and an angle where they lack, currents, voltage
    and speed if there is one of each.

    Parameters
    ----------
    table : TextTable
    sidecar : mapping, optional
    wanted : mapping
    needs : sequence of str
        Columns that there have to be, of `NEEDS`.
    unknown_step : bool
        Whether a command that lacks may be the one step that the angle shows.
    raw : RawRegisters, optional
        By whose registers columns may be named.

    Raises
    ------
    InputError
        If time, command or angle cannot be found, or not without doubt: says how to say it.
    """
    made: dict[str, tuple[Column, str]] = {}
    if sidecar is not None:
        made = {signal: (replace(column, column=_in_header(table, signal, column.column)), SIDECAR)
                for signal, column in sidecar.items()}
    for one in wanted.values():
        signal, column = _said(table, one)
        for other in COMMANDS if signal in COMMANDS else (signal,):
            made.pop(other, None)
        made[signal] = (column, SAID)
    if sidecar is None:
        told = any(name in made for name in COMMANDS)
        counts = register_columns(table, raw, {column.column for column, _ in made.values()})
        for signal, held in counts.items():
            if signal not in made and not (told and signal in COMMANDS):
                made[signal] = held
        passed = named_after_any(table) if counts else frozenset()  # whose steps nobody guesses
        taken = {column.column for column, _ in made.values()}
        others = [name for name in table.header if name not in taken and name not in passed]
        told = any(name in made for name in COMMANDS)
        for signal, column in (_named(table, others, made) if table.has_header else {}).items():
            if signal not in made and not (told and signal in COMMANDS):
                made[signal] = (column, NAMED)
        if made.get(TIME, (None, ""))[1] == NAMED and made[TIME][0].column == TIME and not table.units and not (
                any(name in made for name in COMMANDS) and any(name in made for name in ANGLES)):
            del made[TIME]  # among foreign names it is one of them, and need not be in seconds
        _guess_rest(table, made, needs, passed, unknown_step=unknown_step)
    _check(table, made, needs)
    shown = tuple(ReadColumn(column.column, signal, "" if signal == SWITCH else unit_shown(
        column.unit, column.scale, column.offset), known)
        for signal, (column, known) in sorted(made.items(), key=lambda one: _place(table, one[1][0].column)))
    return Layout({signal: column for signal, (column, _) in made.items()}, shown)


def _place(table: TextTable, column: str) -> int:
    """Return where a column stands; what no file holds stands behind."""
    return table.header.index(column) if column in table.header else len(table.header)


def _named(table: TextTable, others: list[str], made: Mapping[str, object]) -> dict[str, Column]:
    found = {}
    for signal, column in columns_of(others, table.path, taken=made, says_more=names.meaning_of).items():
        below = table.units[table.header.index(column.column)] if table.units else ""
        meaning = names.meaning_of("time" if signal == TIME else signal, below) if below else None
        if meaning is not None and column.column == signal and meaning.dimension:
            if meaning.dimension != dimension_of_signal(signal):
                raise UnitError(f"{table.path}: unit of column {signal}", got=below,
                                allowed=units_written(dimension_of_signal(signal)))
            column = Column(column.column, meaning.unit)
        clock = clock_of(table.cells(column.column)[0]) if signal == TIME else ""
        found[signal] = Column(column.column, clock, from_first=True) if clock else column
    return found


def _in_header(table: TextTable, signal: str, name: str) -> str:
    own = table.name_of(name)
    if own is None and name.isdigit() and 1 <= int(name) <= len(table.header) - table.added:
        own = table.header[table.added + int(name) - 1]
    if own is None and signal in (TIME, COMMAND, *COMMANDS) and is_defined(name):
        return name
    if own is None:
        raise InputError(f"{table.path}: column of {signal}", got=name, allowed=", ".join(table.header))
    return own


def _said(table: TextTable, one: Wanted) -> tuple[str, Column]:
    """Return the signal and the column of words; a unit that they do not say is that of the name, or of the values."""
    own = _in_header(table, one.signal, one.column)
    if own not in table.header:
        signal, unit = checked_definition(f"{SAID} {one.signal}", one.signal, own)
        return signal, Column(own, unit)
    if one.signal == SWITCH and not one.unit:
        return SWITCH, Column(own, si_unit_of(SWITCH))
    if one.unit:
        signal, column = column_said(one, own)
        return signal, replace(column, from_first=is_since_1970(table, column)) if signal == TIME else column
    if table.has_header and (named := columns_of([own], table.path, says_more=names.meaning_of).get(one.signal)):
        return one.signal, named
    roles = {signal: role for role, signal in _SIGNALS.items() if role != names.SOME_TIME}
    role = names.COMMAND if one.signal == COMMAND else roles.get(one.signal, one.signal)
    meaning = names.meaning_of(own, _below(table, own)) if table.has_header else None
    found = _guessed(table, own, names.Meaning(role, *(meaning[1:] if meaning else ("", ""))))
    if found is None:
        raise _no_unit(table, one.signal, own, meaning)
    signal = _COMMAND_OF[found.dimension] if one.signal == COMMAND else one.signal
    return signal, Column(own, found.unit, from_first=found.from_first)


def is_since_1970(table: TextTable, column: Column) -> bool:
    """Return whether the times of a column count from 1970 or so, and not from a start."""
    if column.from_first:
        return True
    first = table.rows[0]
    k = table.header.index(column.column)
    value = table.number(first.line, column.column, first.cells[k] if k < len(first.cells) else "")
    return abs(column.scale * value) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(column.unit, 1.0) > 1e8


def _below(table: TextTable, column: str) -> str:
    return table.units[table.header.index(column)] if table.units else ""


def _guess_rest(table: TextTable, made: dict[str, tuple[Column, str]], needed: Sequence[str], passed: Container[str], *,
                unknown_step: bool) -> None:
    """Add what is not known yet and can be guessed, but of columns that are passed over."""
    taken = {column.column for column, _ in made.values()}
    found: list[tuple[str, names.Meaning]] = []
    for name in dict.fromkeys(table.header if table.has_header else ()):
        meaning = names.meaning_of(name, _below(table, name))
        if name not in taken and name not in passed and meaning is not None:
            table.cells(name)  # raises where the header has it twice
            found.append((name, meaning))
    needs = {TIME: TIME not in made, COMMAND: not any(name in made for name in COMMANDS),
             "angle": not any(name in made for name in ANGLES)}
    lacking = []
    for what, roles in ((TIME, (names.TIME, names.SOME_TIME)),
                        (COMMAND, (names.PULSE, names.COMMAND, names.COMMAND_ANGLE)),
                        ("angle", (names.ANGLE, names.FEEDBACK, COUNTS))):
        if needs[what] and what in needed:
            chosen = _chosen(table, what, _candidates(table, found, roles))
            if chosen is None and what == TIME and table.added:
                made[TIME] = Column(ARRIVAL, "clock", from_first=True), "guessed from the Serial Monitor's times"
                continue
            if chosen is None:
                lacking.append(what)
                continue
            signal = _signal_of(chosen)
            made[signal] = (_column(chosen), f"guessed from {chosen.found.why}" if chosen.found else "")
            found = [(name, meaning) for name, meaning in found if name != chosen.column]
    step = step_of(table, made) if lacking == [COMMAND] and unknown_step else None
    if step is not None:
        made["command_angle"] = Column(step.command, "deg"), f"guessed: an unknown step, {step.words}"
    elif lacking:
        raise _unknown(table, lacking, made)
    for role in _OPTIONAL:
        some = [one for one in _candidates(table, found, (role,)) if one.found is not None]
        if role not in made and len(some) == 1 and some[0].found is not None:
            made[role] = (_column(some[0]), f"guessed from {some[0].found.why}")


def _candidates(table: TextTable, found: Iterable[tuple[str, names.Meaning]], roles: tuple[str, ...],
                ) -> list[_Candidate]:
    made = []
    for name, meaning in found:
        increasing = meaning.role in (names.TIME, names.SOME_TIME) and is_increasing(table, name)
        if meaning.role == names.SOME_TIME and not increasing:
            continue
        if meaning.role == names.TIME and len(table.rows) > 1 and _stays(table.cells(name)):
            continue  # "min:0,max:180" for the scale of a plotter
        if meaning.role not in roles:
            continue
        made.append(_Candidate(name, meaning, _guessed(table, name, meaning)))
    if names.PULSE in roles:  # "us" may be the time, or the pulse
        made += [_Candidate(name, meaning._replace(role=names.PULSE), one) for name, meaning in found
                 if meaning.role == names.TIME and meaning.unit == "us" and not is_increasing(table, name)
                 and (one := guess(table, name, names.PULSE)) is not None]
    if names.TIME in roles:
        made = [one for one in made if is_increasing(table, one.column)] or made
        made = [one for one in made if one.meaning.role == names.TIME] or made
    return made


def _stays(cells: Sequence[str]) -> bool:
    return cells[0].lower() not in MISSING and len(set(cells)) == 1


def _guessed(table: TextTable, name: str, meaning: names.Meaning) -> Guess | None:
    """Return the unit of a column: by its name if that has one that fits, else by its values."""
    dimension = _DIMENSIONS.get(meaning.role, "")
    if meaning.role == names.COMMAND and meaning.dimension in _COMMAND_OF:
        dimension = meaning.dimension
    if meaning.unit:
        if meaning.dimension != dimension:
            return None
        known = Guess(meaning.unit, dimension, names.UNIT_IN_NAME)
        since = dimension == "time" and meaning.role in (names.TIME, names.SOME_TIME) and is_since_1970(
            table, Column(name, meaning.unit))
        return known._replace(from_first=since)
    return guess(table, name, meaning.role)


def _chosen(table: TextTable, what: str, candidates: list[_Candidate]) -> _Candidate | None:
    """Return the column that is known best; raise where two are known equally well, or its unit is not."""
    if not candidates:
        return None
    if what == "angle":  # the horn's angle before a potentiometer's voltage
        candidates = [one for one in candidates if one.meaning.role == names.ANGLE and one.found] or candidates
    best = [one for one in candidates if one.rank == max(other.rank for other in candidates)]
    if what == COMMAND:  # as among the names of servotwin
        order = list(COMMANDS)
        first = min((order.index(_signal_of(one)) for one in best if one.found is not None), default=0)
        best = [one for one in best if one.found is None or order.index(_signal_of(one)) == first]
    if len(best) > 1:
        said = f"{what}={best[0].column}" + (f":{best[0].found.unit}" if best[0].found else "")
        raise InputError(f"{table.path}: column of {'the ' * (what != TIME)}{what}", allowed=f'one, said by {SAID} '
                         f'"{said}"', got=" and ".join(one.column for one in best))
    if best[0].found is None:
        signal = COMMAND if best[0].meaning.role == names.COMMAND else _SIGNALS.get(best[0].meaning.role, ANGLES[0])
        raise _no_unit(table, signal, best[0].column, best[0].meaning)
    return best[0]


def _signal_of(one: _Candidate) -> str:
    if one.meaning.role == names.COMMAND and one.found is not None:
        return _COMMAND_OF[one.found.dimension]
    return _SIGNALS.get(one.meaning.role, one.meaning.role)


def _column(one: _Candidate) -> Column:
    if one.found is None:  # never: what has no unit is refused before
        raise UnitError(one.column)
    return Column(one.column, one.found.unit, from_first=one.found.from_first)


_A_COUNT = "0.3deg-90"  # an example of what one count is


def _no_unit(table: TextTable, signal: str, column: str, meaning: names.Meaning | None) -> InputError:
    """Return the error of a column whose unit is not known, or cannot be."""
    short = _SHORT.get(signal, signal)
    short = "command" if signal in (*COMMANDS, COMMAND) else short
    if short == "command":
        units = {"command_angle": "deg", "command_voltage": "V"}.get(signal, "us")
        others = {"command_angle": "deg or rad", "command_voltage": "V or mV", COMMAND: "us, ms, deg or rad"}
        example, more = units, others.get(signal, "us or ms, or a scale such as 4.88us")
    else:
        example, more = {TIME: ("ms", "s, ms or us"), "output_angle": ("deg", "deg or rad")}.get(
            signal, (si_unit_of(signal), units_written(dimension_of_signal(signal))))
    values = range_of(table, column)  # raises where they are no numbers
    if meaning is not None and COUNTS in (meaning.role, meaning.dimension):
        example = _A_COUNT if short == "angle" else f"0.3{example}"
        return InputError(f"{table.path}: column {column} holds counts ({values})",
                          allowed=f'{SAID} "{short}={column}:{example}", with what one of them is')
    said = f'{SAID} "{short}={column}:{example}"' if ":" not in column and "=" not in column else (
        f'{SAID} "{short}=\'{column}\':{example}"')
    if meaning is not None and meaning.unit:
        return UnitError(f"{table.path}: unit of column {column}", got=meaning.unit, allowed=f"{more}, said by {said}")
    return InputError(f"{table.path}: unit of column {column} is not known ({values})",
                      allowed=f"{more}, said by {said}")


def _unknown(table: TextTable, lacking: list[str], made: Mapping[str, tuple[Column, str]], *, sidecar: bool = False,
             ) -> InputError:
    """Return the error of a table without a time, a command or an angle that could be found."""
    taken = {column.column for column, _ in made.values()}
    free = [name for name in table.header if name not in taken]
    if TIME not in lacking:  # what grows with time is proposed last
        free.sort(key=lambda name: is_increasing(table, name))
    words = " ".join(f"{what}={name}:{_likely(table, what, name)}" for what, name in zip(
        lacking, [*free, *["COLUMN"] * len(lacking)], strict=False))
    usual = {TIME: "time_s", COMMAND: "pulse_width_us, command_angle_deg or command_voltage_V",
             "angle": "output_angle_deg or feedback_voltage_V"}
    text = {TIME: "time", COMMAND: "command", "angle": "measured angle"}
    nothing = " and no ".join(", no ".join(text[one] for one in some) for some in (lacking[:-1], lacking[-1:]) if some)
    what = f"no {nothing} among the columns{' of the sidecar' * sidecar}"
    got = ", ".join(table.header) if table.has_header else f"no header, {len(table.header)} columns"
    more = ["--rate 50Hz, where rows come at such a rate"] if TIME in lacking else []
    if COMMAND in lacking:
        step = step_of(table, made)
        more.append("--commanded 153deg@0s, a jump that was commanded" if step is None else
                    f"--commanded {step.command}, as the angle shows an unknown step {step.words}")
    return InputError(f"{table.path}: {what}", got=got, allowed=", or ".join(
        [*more, f"names such as {', '.join(usual[one] for one in lacking)}", f'{SAID} "{words}"'])
        + (", with what one of its counts is" if _A_COUNT in words else ""))


def _likely(table: TextTable, what: str, name: str) -> str:
    """Return the unit that a column would be in, were it a time, a command or an angle."""
    role = {TIME: names.TIME, COMMAND: names.COMMAND, "angle": names.ANGLE}[what]
    try:
        found = guess(table, name, role) if name in table.header else None
    except InputError:  # no numbers
        found = None
    if what == "angle" and found is None and are_counts(table, name):
        return _A_COUNT
    return {TIME: "s", COMMAND: "us", "angle": "deg"}[what] if found is None else found.unit


def _check(table: TextTable, made: Mapping[str, tuple[Column, str]], needs: Sequence[str]) -> None:
    lacking = [what for what, some in ((TIME, (TIME,)), (COMMAND, tuple(COMMANDS)), ("angle", ANGLES))
               if what in needs and not any(name in made for name in some)]
    if lacking:
        raise _unknown(table, lacking, made, sidecar=any(known == SIDECAR for _, known in made.values()) or not made)
    seen: dict[str, str] = {}
    for signal, (column, _) in made.items():
        if table.header.count(column.column) > 1:
            raise InputError(f"{table.path}: column", allowed="once",
                             got=f"{column.column} {table.header.count(column.column)} times")
        if seen.setdefault(column.column, signal) != signal and SAID in (made[signal][1], made[seen[column.column]][1]):
            raise InputError(f"{table.path}: column {column.column}", got=f"{seen[column.column]} and {signal}",
                             allowed="one of both")

# --- Lines that boards print when they start, in the middle of a log --------------------------------------------------

_ESP32 = re.compile(r"rst:0x[0-9a-f]+ \((\w+)\)", re.IGNORECASE)  # of the ROM's boot loader: RESET_REASON in rom/rtc.h
_BROWNOUT = "Brownout detector was triggered"  # of ESP-IDF and the Arduino core
_AVR = re.compile(r"\bMCUSR\s*[=:]?\s*(0x[0-9a-f]+|0b[01]+|\d+)", re.IGNORECASE)
_CAUSES = {"BROWN": "by its brown-out detector: its supply was too low", "POWERON": "by power that came on",
           "WDT": "by its watchdog", "SW": "by its program", "DEEPSLEEP": "after deep sleep", "EXT": "from outside"}
_MCUSR = (("power that came on", 1), ("its reset pin", 2), ("its brown-out detector: its supply was too low", 4),
          ("its watchdog", 8))
"""Bits PORF, EXTRF, BORF, WDRF of an ATmega328P's MCUSR (its sheet, MCU status register)."""


class BootText(NamedTuple):
    """A line that a board printed when it started: which, what board, and why it was reset."""

    line: int
    board: str
    why: str


def boot_text(line: int, text: str) -> BootText | None:
    """Return what a line of text says of a reset; None where it says nothing.

    Examples
    --------
    >>> boot_text(7, "rst:0xf (RTCWDT_BROWN_OUT_RESET),boot:0x13").why
    'by its brown-out detector: its supply was too low'
    >>> boot_text(9, "MCUSR=0x04"), boot_text(1, "entry 0x400805f0")
    (BootText(line=9, board='AVR', why='by its brown-out detector: its supply was too low'), None)
    """
    if _BROWNOUT in text:
        return BootText(line, "ESP32", _CAUSES["BROWN"])
    if found := _ESP32.search(text):
        name = found[1].upper()
        why = next((words for part, words in _CAUSES.items() if part in name), f"({name})")
        return BootText(line, "ESP32", why)
    if found := _AVR.search(text):
        bits = int(found[1], 0) if found[1][:2].lower() in ("0x", "0b") else int(found[1])
        causes = [words for words, bit in _MCUSR if bits & bit]
        return BootText(line, "AVR", f"by {' and '.join(causes)}") if causes else None
    return None


def boot_remarks(table: TextTable, measured: Mapping[str, NDArray[np.float64]]) -> tuple[str, ...]:
    """Return a sentence on each reset that a board tells of behind a row of a table, with the supply just before.

    Parameters
    ----------
    table : TextTable
    measured : mapping of str to ndarray, shape (n,)
        Of its rows.
    """
    if not table.breaks:
        return ()
    lines = table.path.read_text(encoding=table.encoding, errors="replace").splitlines()
    places = np.array([row.line for row in table.rows])
    found: dict[int, BootText] = {}
    for at in table.breaks:
        text = boot_text(at, lines[at - 1]) if 0 < at <= len(lines) else None
        k = int(np.searchsorted(places, at)) - 1
        if text is None or k < 0 or not all(
                n in table.breaks or not lines[n - 1].strip() for n in range(int(places[k]) + 1, at)):
            continue  # behind a row of another log in this file
        if k not in found or text.why == _CAUSES["BROWN"]:
            found[k] = text
    return tuple(_words(text, {name: float(values[k]) for name, values in measured.items()})
                 for k, text in found.items())


def _words(text: BootText, last: Mapping[str, float]) -> str:
    seen = [f"{last[name]:.3g} {unit}" for name, unit in (("bus_voltage", "V"), ("supply_current", "A"))
            if math.isfinite(last.get(name, math.nan))]
    before = f"; just before: {', '.join(seen)}" if seen else ""
    return f"line {text.line}: the board ({text.board}) was reset {text.why}{before}"

# --- Logs as CSV files with a JSON sidecar, in and out ----------------------------------------------------------------

def read_csv_log(path: str | Path, *, sidecar: str | Path | None = None,
                 columns: str | Mapping[str, str] | None = None, mend: Sequence[str] = ()) -> Log:
    r"""Return the log in a CSV file.

    Columns are named after their signal, with the unit behind it (`time_s`, `pulse_width_us`, `output_angle_deg`) or
    in SI without one; the sidecar `<name>.json` beside the file, or `logs.json` in its folder, says the rest. A file
    that `Result.save` has written is a log too. Tables of other loggers are read where names, units and values tell
    what their columns are: `Log.reading` shows it.

    Parameters
    ----------
    path : str or Path
    sidecar : str or Path, optional
        A file in place of the folder's `logs.json`.
    columns : str or mapping, optional
        Which column is which signal in which unit, such as ``"time=t:ms angle=pos:deg-90"`` or
        ``{"angle": "pos:deg-90"}``; counts before the sidecar. A rate of rows stands for a time (``"time=50Hz"``), and
        a value or jumps for a command (``"command=0deg@0s,90deg@0.5s"``).
    mend : sequence of str
        Mends of what is not certain: names of `servotwin.logs.mends.MENDS`, such as "torn".

    Raises
    ------
    InputError
        If file or sidecar cannot be read, time, command or angle cannot be found from its columns, a value is no number
        or in a unit that cannot be, or time stands still or runs backwards: names file, line and column.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("time_s,pulse_width_us,output_angle_deg\n0,1500,0\n0.02,1600,\n0.04,1600,2.5\n")
    >>> log = read_csv_log(file)
    >>> log.name, log.used("output_angle").tolist()
    ('run', [True, False, True])
    """
    logs = logs_of(Path(path), sidecar=sidecar, columns=columns, mend=mend)
    if len(logs) > 1:
        raise InputError(str(path), got=f"{len(logs)} logs, as its clock begins again", allowed="read_logs, which "
                         "returns all of them")
    return logs[0]


def logs_of(path: Path, *, sidecar: str | Path | None, columns: str | Mapping[str, str] | None,
            mend: Sequence[str] = (), unknown_step: bool = False, registers: str | Servo | None = None) -> list[Log]:
    """Return the logs of a table: one, or where its clock begins again and that is mended as many as there are."""
    mends = checked_mends(mend)
    table, layout, said = read_log_table(path, mends, wanted_columns(columns), sidecar=sidecar,
                                         unknown_step=unknown_step, registers=registers)
    if said.drop_repeated and SPREAD not in mends:
        mends = tuple(dict.fromkeys((*mends, DROP)))
    parts = timed(table, layout.columns[TIME], mends)
    return [_log(path, part, layout, said, f" ({k})" if len(parts) > 1 else "") for k, part in enumerate(parts, 1)]


class LogTable(NamedTuple):
    """The table of a log without rows that are none, which of its columns is what, and its sidecar."""

    table: TextTable
    layout: Layout
    sidecar: Sidecar


def read_log_table(path: Path, mends: Sequence[str], wanted: Mapping[str, Wanted], *,
                   sidecar: str | Path | None = None, needs: Sequence[str] = NEEDS,
                   unknown_step: bool = False, registers: str | Servo | None = None) -> LogTable:
    """Read a table as that of a log.

    Parameters
    ----------
    path : Path
    mends : sequence of str
        Mends of what is not certain.
    wanted : mapping
        Columns as the user says them.
    sidecar : str or Path, optional
        A file in place of the folder's `logs.json`.
    needs : sequence of str
        Columns that there have to be: "time", "command", "angle".
    unknown_step : bool
        Whether a command that lacks may be the one step that the angle shows.
    registers : str or Servo, optional
        A family, a model or a servo, by whose registers columns may be named.

    Raises
    ------
    InputError
        As `read_csv_log` does.
    """
    asked = {one.column for one in wanted.values()}
    try:
        table = read_table(path, lambda name: name in asked or is_known_name(name), unended=False, serial=True,
                           damaged=TORN in mends, grouped=True)
    except InputError as error:
        if error.got != NUL:
            raise
        raise InputError(error.what, error.got, f"{error.allowed}; {say(TORN, mends)}") from None
    said = sidecar_of(path, None if sidecar is None else Path(sidecar))
    table = without_thousands(without_text(table), mends)
    layout = layout_of(sound(table), said.columns, wanted, needs=needs, unknown_step=unknown_step,
                       raw=raw_registers(registers))
    table = without_torn(table, layout, mends)
    check_said(table, layout)
    return LogTable(table, layout, said)


def _log(path: Path, part: Timed, layout: Layout, said: Sidecar, suffix: str) -> Log:
    table, of = part.table, layout.columns
    command = _command_of(table, of, said)
    measured = {name: column.to_si(table.numbers(column.column, missing=math.nan), name)
                for name, column in of.items() if name not in (TIME, SWITCH, *COMMANDS)}
    if is_defined(of[command].column):
        values = defined_commands(command, of[command].column, part.time)
    else:
        missing = None if COMMANDS[command] == "voltage" else math.nan  # no pulses
        values = of[command].to_si(table.numbers(of[command].column, missing=missing), command)
        if command == "pulse_width":
            values = np.where(values == 0.0, math.nan, values)  # a pulse without a width is none
    switch = _switch(table, of[SWITCH]) if SWITCH in of else None
    used = {column.column for column in layout.shown}
    reading = Reading(file=str(path), columns=layout.shown, remarks=(
        *table.remarks, *_silences(values), *boot_remarks(table, measured)),
                      layout=of, unread=tuple(name for name in table.header if name and name not in used))
    given = {"name": path.stem, "source": str(path), **said.log}
    given["name"] = f"{given['name']}{suffix}"
    with in_file(path, str(given["name"])):
        return Log(time=part.time, command=values, command_kind=COMMANDS[command], measured=measured, torque_on=switch,
                   reading=reading, **given)


def _silences(command: NDArray[np.float64]) -> tuple[str, ...]:
    """Return what is said of a command that is missing at times: a logger may have meant that it did not change."""
    count = int(np.isnan(command).sum())
    return (f"{count} of {command.size} samples have no command: no pulses were sent there",) if count else ()


@contextmanager
def in_file(path: object, name: str) -> Iterator[None]:
    """Let the errors of a log name the file that it comes from."""
    try:
        yield
    except UnknownNameError as error:
        raise InputError(f"{path}: {error}") from None
    except InputError as error:
        what = error.what.removeprefix(f"log {name!r}: ")
        raise InputError(f"{path}: {what}", got=error.got, allowed=error.allowed) from None


def write_log(log: Log, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a log as a CSV file in SI and its sidecar; `read_csv_log` reads the same log back, bit for bit.

    Parameters
    ----------
    log : Log
    path : str or Path
        Ends in .csv; the sidecar gets the same name with .json.
    overwrite : bool
        Replace files that are there.

    Raises
    ------
    OutputExistsError, OutputError
        If one of the two files exists and `overwrite` is false, or it cannot be written.
    """
    path = Path(path)
    if path.suffix != ".csv" or sidecar_path(path).name == FOLDER_FILE:
        raise OutputError(f"{path} cannot be written (the name of a log ends in .csv, and is not logs.csv)")
    for file in (path, sidecar_path(path)):
        if not overwrite and _exists(file):
            raise OutputExistsError(file)
    content, sidecar = log_bytes(log)
    write_file(sidecar_path(path), sidecar, overwrite=overwrite)
    write_file(path, content, overwrite=overwrite)


def log_bytes(log: Log) -> tuple[bytes, bytes]:
    """Return a log as the contents of a CSV file and of its sidecar."""
    command = next(name for name, kind in COMMANDS.items() if kind == log.command_kind)
    columns: dict[str, list[object]] = {
        name: ["" if math.isnan(x) else x for x in values.tolist()]
        for name, values in {TIME: log.time, command: log.command, **log.measured}.items()}
    if log.torque_on is not None:
        columns[SWITCH] = [int(x) for x in log.torque_on.tolist()]
    return csv_text(columns).encode(), json_bytes(sidecar_words(log))


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # writing says what is wrong with the name
        return False


def _command_of(table: TextTable, columns: Mapping[str, Column], said: Sidecar) -> str:
    """Return which column is the command: the one that the sidecar says, else the first of `COMMANDS`."""
    found = [name for name in COMMANDS if name in columns]
    if said.command is not None and said.command not in found:
        raise InputError(f"{table.path}: command", got=said.command, allowed=", ".join(found) or "a column of the file")
    return said.command or found[0]


def _switch(table: TextTable, column: Column) -> NDArray[np.bool_]:
    values = []
    for row, cell in zip(table.rows, table.cells(column.column), strict=True):
        values.append(switch_value(cell))
        if math.isnan(values[-1]):
            raise InputError(f"{table.path}: line {row.line}, {column.column}", got=cell or "nothing",
                             allowed="1 or 0, true or false")
    return np.asarray(np.array(values) == 1.0)
