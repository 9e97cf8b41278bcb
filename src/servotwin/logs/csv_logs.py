"""Logs as CSV files with a JSON sidecar, in and out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, OutputError, OutputExistsError, UnknownNameError
from servotwin.logs.boot_texts import boot_remarks
from servotwin.logs.clock import Timed, timed
from servotwin.logs.column_words import Wanted, wanted_columns
from servotwin.logs.columns import COMMANDS, SWITCH, TIME, Column, switch_value
from servotwin.logs.defined import defined_commands, is_defined
from servotwin.logs.impossible import check_said
from servotwin.logs.json_file import json_bytes
from servotwin.logs.layout import NEEDS, Layout, is_known_name, layout_of
from servotwin.logs.log import Log
from servotwin.logs.mend_names import DROP, SPREAD, TORN
from servotwin.logs.mends import checked_mends, say, sound, without_text, without_thousands, without_torn
from servotwin.logs.reading import Reading
from servotwin.logs.register_columns import raw_registers
from servotwin.logs.sidecar import FOLDER_FILE, Sidecar, sidecar_of, sidecar_path, sidecar_words
from servotwin.parameters import Servo, write_file
from servotwin.tables import TextTable, csv_text, read_table
from servotwin.tables.text import NUL


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
        What to put right of what is not certain: names of `servotwin.logs.mends.MENDS`, such as "torn".

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
        What is mended of what is not certain.
    wanted : mapping
        What the user says of columns.
    sidecar : str or Path, optional
        A file in place of the folder's `logs.json`.
    needs : sequence of str
        What there has to be: "time", "command", "angle".
    unknown_step : bool
        Whether a command that lacks may be the one step that the angle shows.
    registers : str or Servo, optional
        Whose registers columns may be named after: a family, a model, or a servo.

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
