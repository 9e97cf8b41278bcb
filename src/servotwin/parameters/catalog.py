"""The catalog: servo files that come with the package, and how a servo is found."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin import plugins
from servotwin.errors import ServotwinError, UnknownNameError
from servotwin.parameters.servo import Servo
from servotwin.parameters.servo_file import read_servo_file
from servotwin.tables import read_columns

# --- Published data that come with the package, each column with its unit ---------------------------------------------

_UNITS = ("deg", "V", "us", "Hz")  # a column's name ends in its unit; a count has none


@dataclass(frozen=True, eq=False)
class Dataset:
    """A table of published data.

    Parameters
    ----------
    name : str
    columns : dict of str to ndarray, shape (n,)
        In the unit that the name of the column ends in.
    units : dict of str to str
        "1" for counts.
    source : str
        Content of the table, and where it was published.
    """

    name: str
    columns: dict[str, NDArray[np.float64]] = field(repr=False)
    units: dict[str, str] = field(repr=False)
    source: str = field(repr=False)


def _folder() -> Path:
    return Path(str(resources.files("servotwin.parameters"))) / "datasets"


def dataset_names() -> tuple[str, ...]:
    """Return the names of all data sets, sorted.

    Examples
    --------
    >>> dataset_names()
    ('urrea-kern-table-1', 'urrea-kern-table-2')
    """
    return tuple(sorted(path.stem for path in _folder().glob("*.csv")))


def load_dataset(name: str) -> Dataset:
    """Return a data set by its name.

    Raises
    ------
    UnknownNameError
        If there is none of this name.

    Examples
    --------
    >>> load_dataset("urrea-kern-table-2").columns["t_a_us"].tolist()
    [646.0, 1078.0, 1526.0, 1974.0, 2438.0]
    """
    if name not in dataset_names():
        raise UnknownNameError("data set", name, dataset_names())
    columns = read_columns(_folder() / f"{name}.csv")
    units = {key: next((u for u in _UNITS if key.endswith(f"_{u}")), "1") for key in columns}
    return Dataset(name, columns, units, (_folder() / "SOURCE.md").read_text(encoding="utf-8"))





# --- The catalog: servo files that come with the package, and how a servo is found ------------------------------------

@cache
def _servo_files() -> dict[str, Path]:
    """Return the servo files of the catalog by id: those of the package, and of plug-ins."""
    found = {path.stem: path for path in _own_files().glob("*.toml")}
    for files in plugins.loaded("servos", use=lambda package: sorted(
            Path(str(resources.files(package))).glob("*.toml"))).values():
        for path in files:
            if path.stem in found:
                plugins.leave_out(str(path), f"the catalog has {path.stem} already")
            elif _is_readable(path):
                found[path.stem] = path
    return found


def _own_files() -> Path:
    return Path(str(resources.files("servotwin.parameters"))) / "catalog"


def _is_readable(path: Path) -> bool:
    """Return whether a file of a plug-in is a servo's: a broken one must not end what lists the catalog."""
    try:
        with warnings.catch_warnings(action="ignore"):
            read_servo_file(path)
    except ServotwinError as error:
        plugins.leave_out(str(path), error)
        return False
    return True


def catalog_names() -> tuple[str, ...]:
    """Return the ids of all servos in the catalog, sorted: those of the package, and of plug-ins.

    Examples
    --------
    >>> "hitec-hs-755hb" in catalog_names()
    True
    """
    return tuple(sorted(_servo_files()))


def load_servo(name: str | Path) -> Servo:
    """Return a servo of the catalog by its id, or one from a file.

    Parameters
    ----------
    name : str or Path
        An id such as ``"hitec-hs-755hb"``, or the path of a servo file: what ends in ``.toml``, holds a path
        separator, or is no id but a file that exists.

    Raises
    ------
    UnknownNameError
        If it is no id of the catalog; the nearest five are suggested.
    ServoFileError
        If the file cannot be read or holds something wrong.

    Warns
    -----
    UserWarning
        Of each value of a file that is not plausible.

    Examples
    --------
    >>> load_servo("hitec-hs-755hb").title
    'Hitec HS-755HB'
    """
    text = os.fspath(name)
    if isinstance(name, Path) or text.endswith(".toml") or os.sep in text or "/" in text:
        return read_servo_file(Path(name))
    if text not in catalog_names():
        if os.path.isfile(text):
            return read_servo_file(Path(text))
        raise UnknownNameError("servo", text, catalog_names(),
                               allowed="an id that `servotwin catalog list` shows, or a servo file")
    path = _servo_files()[text]
    return read_servo_file(path, name=f"catalog/{text}.toml" if path.parent == _own_files() else None)
