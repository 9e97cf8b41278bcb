"""CSV files of signals: one header line, the unit of each column in its name, angles in degrees."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.parameters import write_file

# SI unit -> (suffix of the column, unit in the file, dimension)
_COLUMNS = {
    "s": ("s", "s", "time"), "V": ("V", "V", "voltage"), "A": ("A", "A", "current"),
    "rad": ("deg", "deg", "angle"), "rad/s": ("deg_per_s", "deg/s", "speed"), "N m": ("Nm", "N m", "torque"),
    "K": ("K", "K", "temperature"), "1": ("", "1", "number"),
}
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
    names, columns = [], []
    for name, values in signals.items():
        suffix, unit, dimension = _OWN.get(name) or _COLUMNS[si_units[name]]
        names.append(f"{name}_{suffix}" if suffix else name)
        columns.append(np.asarray(units.from_si(values, unit, dimension)))
    table = np.column_stack(columns) + 0.0  # -0 becomes 0
    write_file(path, lambda file: np.savetxt(file, table, fmt="%.12g", delimiter=",", header=",".join(names),
                                             comments="", encoding="utf-8"), overwrite=overwrite)
