"""Published data that come with the package, each column with its unit."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import UnknownNameError
from servotwin.tables import read_columns

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
        What it is and where it was published.
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
