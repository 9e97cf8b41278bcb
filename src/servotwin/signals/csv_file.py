"""Commands from a CSV file: a time column and one command column, each with its unit in its name."""

from __future__ import annotations

import math
from pathlib import Path

from servotwin.errors import CommandError, InputError
from servotwin.signals.shapes import samples
from servotwin.signals.signal import Signal, kind_of
from servotwin.tables import TextTable, read_table

# column of the file -> unit of the signal; a name without suffix is in SI
_COLUMNS = {
    "pulse_width_us": "us", "pulse_width_ms": "ms", "pulse_width_s": "s", "pulse_width": "s",
    "command_angle_deg": "deg", "command_angle_rad": "rad", "command_angle": "rad",
    "command_voltage_V": "V", "command_voltage_mV": "mV", "command_voltage": "V",
    "armature_voltage_V": "V", "armature_voltage": "V",
}
_TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}


def from_csv(path: str | Path, *, column: str | None = None, hold: str = "previous",
             frame_period: float | None = None) -> Signal:
    r"""Read a command from a CSV file with a header, whatever separates its cells.

    Parameters
    ----------
    path : str or Path
        File with a column `time_s` (or `time_ms`, `time`) and one of `pulse_width_us`, `command_angle_deg`,
        `command_voltage_V`, … Names without a unit are SI. Where a cell of pulses or angles is empty or says nan,
        no pulses are sent until the next one with a value.
    column : str, optional
        Which column to take, where the file has several commands.
    hold : {"previous", "linear"}
    frame_period : float, optional
        [s]

    Raises
    ------
    CommandError
        If the file cannot be read, is empty, lacks a column or has it twice, or has a value that is no number.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "pulses.csv"
    >>> _ = file.write_text("time_s,pulse_width_us\n0,1500\n0.5,1600\n")
    >>> round(1e6 * float(from_csv(file)(0.6)))
    1600
    """
    table = _table(Path(path))
    time_name = next((name for name in _TIMES if name in table.header), None)
    if time_name is None:
        raise CommandError(f"{path}: columns", got=", ".join(table.header),
                           allowed="a time column: " + ", ".join(_TIMES))
    found = [name for name in table.header if name in _COLUMNS]
    if column is not None and column not in found:
        raise CommandError(f"{path}: column", got=column, allowed=", ".join(found or _COLUMNS))
    if column is None and len(found) != 1:
        raise CommandError(f"{path}: command columns", got=", ".join(found) or ", ".join(table.header),
                           allowed=("one of them, chosen by column=" if found else "one of " + ", ".join(_COLUMNS)))
    name = column or found[0]
    try:
        _check_whole(table, name)
        time = table.numbers(time_name).tolist()
        silent = kind_of(_COLUMNS[name]) != "voltage"
        value = table.numbers(name, missing=math.nan if silent else None).tolist()
    except InputError as error:
        raise CommandError(error.what, got=error.got, allowed=error.allowed) from None
    try:
        return samples([_TIMES[time_name] * t for t in time], value, unit=_COLUMNS[name], hold=hold,
                       frame_period=frame_period)
    except CommandError as error:
        raise CommandError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None


def _check_whole(table: TextTable, name: str) -> None:
    """Raise where a row ends before the command: cut off, it says nothing of pulses."""
    at = table.header.index(name)
    cut = next((row for row in table.rows if len(row.cells) <= at), None)
    if cut is not None:
        raise InputError(f"{table.path}: line {cut.line}, {name}", got="nothing", allowed="a number")


def _table(path: Path) -> TextTable:
    known = {*_TIMES, *_COLUMNS}
    try:
        table = read_table(path, lambda name: name in known)
        table.check_lengths(shorter=True)
        for name in known.intersection(table.header):
            table.cells(name)  # raises where the header has it twice
    except InputError as error:
        raise CommandError(error.what, got=error.got, allowed=error.allowed) from None
    return table
