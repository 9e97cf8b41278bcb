"""Commands from a CSV file: a time column and one command column, each with its unit in its name."""

from __future__ import annotations

import csv
from pathlib import Path

from servotwin.errors import CommandError
from servotwin.signals.shapes import samples
from servotwin.signals.signal import Signal

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
    r"""Read a command from a CSV file with a header.

    Parameters
    ----------
    path : str or Path
        File with a column `time_s` (or `time_ms`, `time`) and one of `pulse_width_us`, `command_angle_deg`,
        `command_voltage_V`, … Names without a unit are SI.
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
    header, rows = _read(Path(path))
    twice = [name for name in (*_TIMES, *_COLUMNS) if header.count(name) > 1]
    if twice:
        raise CommandError(f"{path}: column", got=f"{twice[0]} {header.count(twice[0])} times", allowed="once")
    time_name = next((name for name in _TIMES if name in header), None)
    if time_name is None:
        raise CommandError(f"{path}: columns", got=", ".join(header), allowed="a time column: " + ", ".join(_TIMES))
    found = [name for name in header if name in _COLUMNS]
    if column is not None and column not in found:
        raise CommandError(f"{path}: column", got=column, allowed=", ".join(found or _COLUMNS))
    if column is None and len(found) != 1:
        raise CommandError(f"{path}: command columns", got=", ".join(found) or ", ".join(header),
                           allowed=("one of them, chosen by column=" if found else "one of " + ", ".join(_COLUMNS)))
    name = column or found[0]
    time = [_TIMES[time_name] * v for v in _numbers(path, header, rows, time_name)]
    value = _numbers(path, header, rows, name)
    try:
        return samples(time, value, unit=_COLUMNS[name], hold=hold, frame_period=frame_period)
    except CommandError as error:
        raise CommandError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None


def _read(path: Path) -> tuple[list[str], dict[int, list[str]]]:
    """Return the header, and the rows that are not empty by their line number."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            filled = ((reader.line_num, row) for row in reader if any(cell.strip() for cell in row))
            rows = dict(filled)  # read here, where the file is open
    except FileNotFoundError:
        raise CommandError(f"{path}: no such file") from None
    except OSError as error:
        raise CommandError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, csv.Error) as error:  # not UTF-8, a NUL in the path, an endless cell
        raise CommandError(f"{path}: not readable as CSV ({error})") from None
    if not rows:
        raise CommandError(f"{path}", got="an empty file", allowed="a header and at least one row")
    if len(rows) == 1:
        raise CommandError(f"{path}", got="a header without rows", allowed="at least one row")
    header = [cell.strip() for cell in rows.pop(min(rows))]
    for line, row in rows.items():
        if any(cell.strip() for cell in row[len(header):]):  # decimal commas would be read as other columns
            raise CommandError(f"{path}: line {line}", got=f"{len(row)} cells", allowed=f"{len(header)}, as the header")
    return header, rows


def _numbers(path: str | Path, header: list[str], rows: dict[int, list[str]], name: str) -> list[float]:
    k = header.index(name)
    values = []
    for line, row in rows.items():
        try:
            values.append(float(row[k]))
        except (IndexError, ValueError):
            got = row[k] if k < len(row) else "nothing"
            raise CommandError(f"{path}: line {line}, {name}", got=got, allowed="a number") from None
    return values
