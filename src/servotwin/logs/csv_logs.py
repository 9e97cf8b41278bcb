"""Logs as CSV files with a JSON sidecar, in and out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, OutputError, OutputExistsError, UnknownNameError
from servotwin.logs.column_words import wanted_columns
from servotwin.logs.columns import COMMANDS, SWITCH, TIME, Column, switch_value
from servotwin.logs.json_file import write_json
from servotwin.logs.layout import is_known_name, layout_of
from servotwin.logs.log import Log
from servotwin.logs.reading import Reading
from servotwin.logs.sidecar import FOLDER_FILE, Sidecar, sidecar_of, sidecar_path, sidecar_words
from servotwin.logs.stamps import CLOCKS, stamps_of
from servotwin.parameters import write_file
from servotwin.tables import TextTable, csv_text, read_table


def read_csv_log(path: str | Path, *, sidecar: str | Path | None = None,
                 columns: str | Mapping[str, str] | None = None) -> Log:
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
        ``{"angle": "pos:deg-90"}``; counts before the sidecar.

    Raises
    ------
    InputError
        If file or sidecar cannot be read, time, command or angle cannot be told from its columns, a value is no number
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
    path = Path(path)
    wanted = wanted_columns(columns)
    asked = {one.column for one in wanted.values()}
    table = read_table(path, lambda name: name in asked or is_known_name(name), unended=False)
    said = sidecar_of(path, None if sidecar is None else Path(sidecar))
    table.check_lengths()
    layout = layout_of(table, said.columns, wanted)
    of = layout.columns
    command = _command_of(table, of, said)
    time, table = _times(table, of[TIME], said.drop_repeated)
    measured = {name: column.to_si(table.numbers(column.column, missing=math.nan), name)
                for name, column in of.items() if name not in (TIME, SWITCH, *COMMANDS)}
    missing = None if COMMANDS[command] == "voltage" else math.nan  # no pulses
    values = of[command].to_si(table.numbers(of[command].column, missing=missing), command)
    switch = _switch(table, of[SWITCH]) if SWITCH in of else None
    used = {column.column for column in layout.shown}
    reading = Reading(file=str(path), columns=layout.shown, remarks=(*table.remarks, *_silences(values)),
                      layout=of, unread=tuple(name for name in table.header if name and name not in used))
    given = {"name": path.stem, "source": str(path), **said.log}
    with in_file(path, str(given["name"])):
        return Log(time=time, command=values, command_kind=COMMANDS[command], measured=measured, torque_on=switch,
                   reading=reading, **given)


def _silences(command: NDArray[np.float64]) -> tuple[str, ...]:
    """Return what is said of a command that is missing at times: a logger may have meant that it did not change."""
    count = int(np.isnan(command).sum())
    return (f"{count} of {command.size} samples have no command: no pulses were sent there",) if count else ()


def logs_of(path: Path, *, sidecar: str | Path | None, columns: str | Mapping[str, str] | None) -> list[Log]:
    """Return the log of a table, alone in a list."""
    return [read_csv_log(path, sidecar=sidecar, columns=columns)]


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
    command = next(name for name, kind in COMMANDS.items() if kind == log.command_kind)
    columns: dict[str, list[object]] = {
        name: ["" if math.isnan(x) else x for x in values.tolist()]
        for name, values in {TIME: log.time, command: log.command, **log.measured}.items()}
    if log.torque_on is not None:
        columns[SWITCH] = [int(x) for x in log.torque_on.tolist()]
    write_json(sidecar_path(path), sidecar_words(log), overwrite=overwrite)
    write_file(path, csv_text(columns).encode(), overwrite=overwrite)


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


def _times(table: TextTable, column: Column, drop_repeated: bool) -> tuple[NDArray[np.float64], TextTable]:
    """Return the times, and the table without the rows that are passed over."""
    time = _seconds(table, column)
    same = np.append(False, np.diff(time) == 0.0)
    if drop_repeated and same.any():
        table, time = table.without(same), time[~same]
    bad = np.flatnonzero(np.diff(time) <= 0.0)
    if bad.size:
        k = int(bad[0]) + 1
        stands = "stands still" if time[k] == time[k - 1] else "runs backwards"
        help_ = ' ("drop_repeated" of a sidecar passes such rows over)' if time[k] == time[k - 1] else ""
        raise InputError(f"{table.path}: line {table.rows[k].line}, {column.column}: time {stands}",
                         got=f"{time[k]:.9g} s after {time[k - 1]:.9g} s in line {table.rows[k - 1].line}",
                         allowed=f"increasing times{help_}")
    return time, table


def _seconds(table: TextTable, column: Column) -> NDArray[np.float64]:
    """Return the times of all rows as the file has them [s]."""
    if column.unit in CLOCKS:
        stamps = stamps_of(table, column.column)
        if stamps is None or stamps.unit != column.unit:
            raise InputError(f"{table.path}: line {table.rows[0].line}, {column.column}",
                             got=table.cells(column.column)[0] or "nothing", allowed=CLOCKS[column.unit])
        return stamps.time
    raw = _since_first(table, column) if column.from_first else table.numbers(column.column)
    return column.to_si(raw, TIME)


def _since_first(table: TextTable, column: Column) -> NDArray[np.float64]:
    """Return stamps less the first one, subtracted before they are rounded: nanoseconds since 1970 have 19 digits."""
    cells = table.cells(column.column)
    try:
        stamps = [Decimal(cell.replace(",", ".", 1) if table.decimal == "," else cell) for cell in cells]
        return np.array([float(stamp - stamps[0]) for stamp in stamps])
    except (InvalidOperation, OverflowError):
        # not all are plain numbers: the ordinary way names the line
        values = table.numbers(column.column)
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused with its line
            return np.asarray(values - values[0])


def _switch(table: TextTable, column: Column) -> NDArray[np.bool_]:
    values = []
    for row, cell in zip(table.rows, table.cells(column.column), strict=True):
        values.append(switch_value(cell))
        if math.isnan(values[-1]):
            raise InputError(f"{table.path}: line {row.line}, {column.column}", got=cell or "nothing",
                             allowed="1 or 0, true or false")
    return np.asarray(np.array(values) == 1.0)
