"""Logs as CSV files with a JSON sidecar, in and out."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, OutputError, OutputExistsError, UnknownNameError
from servotwin.identification.logs.columns import (
    COMMANDS,
    SWITCH,
    TIME,
    Column,
    columns_of,
    lacking,
    switch_value,
)
from servotwin.identification.logs.json_file import write_json
from servotwin.identification.logs.log import ANGLES, Log
from servotwin.identification.logs.sidecar import FOLDER_FILE, Sidecar, sidecar_of, sidecar_path, sidecar_words
from servotwin.parameters import write_file
from servotwin.signals.csv_file import _read


class _Table(NamedTuple):
    """A CSV file: its header, and its rows with their line numbers."""

    path: Path
    header: list[str]
    lines: list[int]
    rows: list[list[str]]

    def cells(self, column: str) -> list[str]:
        """Return the cells of a column; a row that is too short has an empty one."""
        k = self.header.index(column)
        return [row[k].strip() if k < len(row) else "" for row in self.rows]

    def without(self, drop: NDArray[np.bool_]) -> _Table:
        """Return the table without some rows."""
        keep = np.flatnonzero(~drop).tolist()
        return self._replace(lines=[self.lines[k] for k in keep], rows=[self.rows[k] for k in keep])


def read_csv_log(path: str | Path, *, sidecar: str | Path | None = None) -> Log:
    r"""Return the log in a CSV file.

    Columns are named after their signal, with the unit behind it (`time_s`, `pulse_width_us`, `output_angle_deg`) or
    in SI without one; the sidecar `<name>.json` beside the file, or `logs.json` in its folder, says the rest. A file
    that `Result.save` has written is a log too.

    Parameters
    ----------
    path : str or Path
    sidecar : str or Path, optional
        A file in place of the folder's `logs.json`.

    Raises
    ------
    InputError
        If file or sidecar cannot be read, lacks a column, has a value that is no number or in a unit that cannot be, or
        time stands still or runs backwards: names file, line and column.

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
    table = _table(path)
    said = sidecar_of(path, None if sidecar is None else Path(sidecar))
    columns = dict(said.columns) if said.columns is not None else columns_of(table.header, path)
    _check_columns(table, columns)
    command = _command_of(table, columns, said)
    time, table = _times(table, columns[TIME], said.drop_repeated)
    measured = {name: column.to_si(_numbers(table, column, empty=math.nan), name) for name, column in columns.items()
                if name not in (TIME, SWITCH, *COMMANDS)}
    if not any(name in measured for name in ANGLES):
        raise lacking(path, "measured angle", table.header, ANGLES)
    values = columns[command].to_si(_numbers(table, columns[command]), command)
    switch = _switch(table, columns[SWITCH]) if SWITCH in columns else None
    given = {"name": path.stem, "source": str(path), **said.log}
    with in_file(path, str(given["name"])):
        return Log(time=time, command=values, command_kind=COMMANDS[command], measured=measured, torque_on=switch,
                   **given)


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
    columns = {TIME: log.time, command: log.command, **log.measured}
    rows = [[_cell(x) for x in values.tolist()] for values in columns.values()]
    if log.torque_on is not None:
        rows.append([str(int(x)) for x in log.torque_on.tolist()])
    header = [*columns, SWITCH][:len(rows)]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *zip(*rows, strict=True)])
    write_json(sidecar_path(path), sidecar_words(log), overwrite=overwrite)
    write_file(path, lambda file: file.write_text(text.getvalue(), encoding="utf-8"), overwrite=overwrite)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # writing says what is wrong with the name
        return False


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(value)


def _table(path: Path) -> _Table:
    try:
        header, rows = _read(path)
    except InputError as error:
        raise InputError(error.what, got=error.got, allowed=error.allowed) from None
    return _Table(path, header, list(rows), list(rows.values()))


def _check_columns(table: _Table, columns: dict[str, Column]) -> None:
    for name, column in columns.items():
        count = table.header.count(column.column)
        if count == 0:
            raise InputError(f"{table.path}: column of {name}", got=column.column, allowed=", ".join(table.header))
        if count > 1:
            raise InputError(f"{table.path}: column", got=f"{column.column} {count} times", allowed="once")
    if TIME not in columns:
        raise lacking(table.path, "time", table.header, (TIME,))


def _command_of(table: _Table, columns: dict[str, Column], said: Sidecar) -> str:
    """Return which column is the command: the one that the sidecar says, else the first of `COMMANDS`."""
    found = [name for name in COMMANDS if name in columns]
    if said.command is not None and said.command not in found:
        raise InputError(f"{table.path}: command", got=said.command, allowed=", ".join(found) or "a column of the file")
    if not found:
        raise lacking(table.path, "command", table.header, COMMANDS)
    return said.command or found[0]


def _times(table: _Table, column: Column, drop_repeated: bool) -> tuple[NDArray[np.float64], _Table]:
    """Return the times, and the table without the rows that are passed over."""
    raw = _since_first(table, column) if column.from_first else _numbers(table, column)
    time = column.to_si(raw, TIME)
    same = np.append(False, np.diff(time) == 0.0)
    if drop_repeated and same.any():
        table, time = table.without(same), time[~same]
    bad = np.flatnonzero(np.diff(time) <= 0.0)
    if bad.size:
        k = int(bad[0]) + 1
        stands = "stands still" if time[k] == time[k - 1] else "runs backwards"
        help_ = ' ("drop_repeated" of a sidecar passes such rows over)' if time[k] == time[k - 1] else ""
        raise InputError(f"{table.path}: line {table.lines[k]}, {column.column}: time {stands}",
                         got=f"{time[k]:.9g} s after {time[k - 1]:.9g} s in line {table.lines[k - 1]}",
                         allowed=f"increasing times{help_}")
    return time, table


def _since_first(table: _Table, column: Column) -> NDArray[np.float64]:
    """Return stamps less the first one, subtracted before they are rounded: nanoseconds since 1970 have 19 digits."""
    try:
        stamps = [Decimal(cell) for cell in table.cells(column.column)]
        return np.array([float(stamp - stamps[0]) for stamp in stamps])
    except (InvalidOperation, OverflowError):
        # not all are plain numbers: the ordinary way names the line
        values = _numbers(table, column)
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused with its line
            return np.asarray(values - values[0])


def _numbers(table: _Table, column: Column, *, empty: float | None = None) -> NDArray[np.float64]:
    """Return the numbers of a column as they stand there; `empty` is what an empty cell counts as."""
    values = []
    for line, cell in zip(table.lines, table.cells(column.column), strict=True):
        try:
            values.append(float(cell) if cell or empty is None else empty)
        except ValueError:
            raise InputError(f"{table.path}: line {line}, {column.column}", got=cell or "nothing",
                             allowed="a number") from None
    return np.array(values, dtype=np.float64)


def _switch(table: _Table, column: Column) -> NDArray[np.bool_]:
    values = []
    for line, cell in zip(table.lines, table.cells(column.column), strict=True):
        values.append(switch_value(cell))
        if math.isnan(values[-1]):
            raise InputError(f"{table.path}: line {line}, {column.column}", got=cell or "nothing",
                             allowed="1 or 0, true or false")
    return np.asarray(np.array(values) == 1.0)
