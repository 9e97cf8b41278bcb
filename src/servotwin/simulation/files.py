"""CSV files of signals: one header line, the unit of each column in its name, angles in degrees."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import OutputError, OutputExistsError

# SI unit -> (suffix of the column, unit in the file, dimension)
_COLUMNS = {
    "s": ("s", "s", "time"), "V": ("V", "V", "voltage"), "A": ("A", "A", "current"),
    "rad": ("deg", "deg", "angle"), "rad/s": ("deg_per_s", "deg/s", "speed"), "N m": ("Nm", "N m", "torque"),
}
_OWN = {"pulse_width": ("us", "us", "time")}


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
        names.append(f"{name}_{suffix}")
        columns.append(np.asarray(units.from_si(values, unit, dimension)))
    target = Path(path)
    if target.exists() and not overwrite:
        raise OutputExistsError(target)
    try:
        handle, partial = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".partial")
    except OSError as error:
        raise OutputError(f"{target} cannot be written ({error.strerror})") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            np.savetxt(file, np.column_stack(columns), fmt="%.12g", delimiter=",", header=",".join(names), comments="")
        os.replace(partial, target)
        target.chmod(0o666 & ~_umask())
    except OSError as error:
        Path(partial).unlink(missing_ok=True)
        raise OutputError(f"{target} cannot be written ({error.strerror})") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
