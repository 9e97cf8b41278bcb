"""CSV files of signals: one header line, the unit of each column in its name, angles in degrees."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import OutputError
from servotwin.parameters import write_file
from servotwin.tables.columns import csv_text

# SI unit -> (suffix of the column, unit in the file, dimension)
_COLUMNS = {
    "s": ("s", "s", "time"), "V": ("V", "V", "voltage"), "A": ("A", "A", "current"),
    "rad": ("deg", "deg", "angle"), "rad/s": ("deg_per_s", "deg/s", "speed"), "N m": ("Nm", "N m", "torque"),
    "K": ("K", "K", "temperature"), "1": ("", "1", "number"),
}
_ROWS = 200_000  # that are held as text at once
_OWN = dict.fromkeys(("pulse_width", "error_time"), ("us", "us", "time"))


def save_csv(path: str | Path, signals: Mapping[str, NDArray[np.float64]], si_units: Mapping[str, str], *,
             overwrite: bool = False) -> None:
    """Write signals of one length to a CSV file; a failure leaves what was there untouched.

    Raises
    ------
    OutputExistsError
        If the file exists and `overwrite` is false.
    OutputError
        If it cannot be written.
    """
    write_file(path, lambda file: write_csv(file, signals, si_units), overwrite=overwrite)


def write_csv(out: Path | TextIO, signals: Mapping[str, NDArray[np.float64]], si_units: Mapping[str, str]) -> None:
    """Write signals of one length to a file or a stream of text.

    Examples
    --------
    >>> import io
    >>> out = io.StringIO()
    >>> write_csv(out, {"output_angle": np.array([np.pi])}, {"output_angle": "rad"})
    >>> out.getvalue().split()
    ['output_angle_deg', '180']
    """
    shown = shown_columns(signals, si_units)
    head = csv_text({name: () for name in shown}).rstrip("\n")
    np.savetxt(out, np.column_stack(list(shown.values())), fmt="%.12g", delimiter=",", header=head, comments="",
               encoding="utf-8")


def shown_columns(signals: Mapping[str, NDArray[Any]], si_units: Mapping[str, str]) -> dict[str, NDArray[Any]]:
    """Return signals as columns of a file: in the units of people, which the names say.

    Examples
    --------
    >>> shown_columns({"output_angle": np.array([np.pi])}, {"output_angle": "rad"})
    {'output_angle_deg': array([180.])}
    """
    found = {}
    for name, values in signals.items():
        suffix, unit, dimension = _OWN.get(name) or _COLUMNS[si_units[name]]
        signless = np.asarray(units.from_si(values, unit, dimension)) + 0.0  # -0 becomes 0
        found[f"{name}_{suffix}" if suffix else name] = signless
    return found


def save_lanes(path: str | Path, time: NDArray[np.float64], signals: Mapping[str, NDArray[Any]],
               si_units: Mapping[str, str], of_lanes: Mapping[str, NDArray[Any]], *, what: str,
               overwrite: bool = False) -> None:
    """Write signals of many lanes, one row for each lane and time, as CSV or Parquet.

    Parameters
    ----------
    path : str or Path
        Ends in .csv or .parquet.
    time : ndarray, shape (T,)
    signals : mapping of str to ndarray, shape (B, T)
    si_units : mapping
        Of `time` and the signals.
    of_lanes : mapping of str to ndarray, shape (B,)
        Number or name of each lane, and what else differs from lane to lane.
    what : str
        Whose file it is, for errors.
    overwrite : bool

    Raises
    ------
    OutputExistsError
        If the file exists and `overwrite` is false.
    OutputError
        If it cannot be written, or its name ends otherwise.
    MissingExtraError
        If Parquet is asked for and pyarrow is not installed.
    """
    from servotwin.tables.columns import FORMATS, check_format, encoded

    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in FORMATS:
        raise OutputError(f"file of {what}", got=str(path), allowed="a name that ends in .csv or .parquet")
    check_format(ending)
    lanes, times = next(iter(signals.values())).shape

    def rows(first: int, last: int) -> dict[str, NDArray[Any]]:
        flat = {"time": np.tile(time, last - first), **{name: x[first:last].ravel() for name, x in signals.items()}}
        return {**{name: np.repeat(column[first:last], times) for name, column in of_lanes.items()},
                **shown_columns(flat, si_units)}

    def write(file: Path) -> None:
        if ending == "parquet":
            file.write_bytes(encoded(rows(0, lanes), ending))
            return
        step = max(1, _ROWS // times)
        with file.open("wb") as stream:
            for first in range(0, lanes, step):
                text = encoded(rows(first, min(first + step, lanes)), ending)
                stream.write(text if first == 0 else text[text.index(b"\n") + 1:])

    write_file(path, write, overwrite=overwrite)
