"""Numbers and columns out of words and files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from servotwin import units
from servotwin.errors import InputError, UnitError
from servotwin.tables import read_table

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


def quantity(option: str, text: str, dimension: str, *, bare: str | None = None) -> float:
    """Return a number with its unit, in SI.

    Parameters
    ----------
    option, text : str
    dimension : str
        Of `servotwin.units`.
    bare : str, optional
        Unit of a number without one; else a unit is required.

    Raises
    ------
    InputError
        If it is no number, or its unit does not fit.

    Examples
    --------
    >>> quantity("--max-error", "180 deg", "angle"), quantity("--leave-out", "3", "time", bare="s")
    (3.141592653589793, 3.0)
    """
    match = _NUMBER.fullmatch(text)
    unit = (match[2] or bare) if match else None
    try:
        if match is not None and unit is not None:
            return units.to_si(float(match[1]), unit, dimension)
    except UnitError:
        pass
    raise InputError(option, got=text, allowed=("a number in SI, or " if bare else "") + "a number with a unit: "
                     + ", ".join(units.DIMENSIONS[dimension]))


def numbers(what: str, text: str, names: tuple[str, ...], *, required: int | None = None) -> list[float]:
    """Return the numbers of a text such as ``"0:180"``.

    Parameters
    ----------
    what : str
        What to call it in an error.
    text : str
        Numbers, with colons between them.
    names : tuple of str
        What each number is.
    required : int, optional
        How many must be there; all unless given.

    Raises
    ------
    InputError
        If there are too few or too many, or one is no number.

    Examples
    --------
    >>> numbers("--step", "0:180", ("BEFORE", "AFTER"))
    [0.0, 180.0]
    """
    least = len(names) if required is None else required
    form = ":".join(names[:least]) + "".join(f"[:{name}]" for name in names[least:])
    words = text.split(":")
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if not least <= len(values) <= len(names):
        raise InputError(what, got=text, allowed=f"{form}, with numbers" if len(names) > 1 else "a number")
    return values


def read_columns(path: Path, *wanted: Mapping[str, float]) -> list[list[float]]:
    r"""Return columns of a CSV file with a header, in SI.

    Parameters
    ----------
    path : Path
    *wanted : mapping of str to float
        For each column, the names that it may have, and the factor to SI of each.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, lacks a column, or has a value that is no number.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "torque.csv"
    >>> _ = file.write_text("time_s,torque_mNm\n0,0\n1,200\n")
    >>> read_columns(file, {"time_s": 1.0}, {"torque_Nm": 1.0, "torque_mNm": 1e-3})
    [[0.0, 1.0], [0.0, 0.2]]
    """
    known = {name for names in wanted for name in names}
    table = read_table(path, lambda name: name in known)
    table.check_lengths(shorter=True)
    columns = []
    for names in wanted:
        name = next((name for name in names if name in table.header), None)
        if name is None:
            raise InputError(f"{path}: columns", got=", ".join(table.header), allowed="one of " + ", ".join(names))
        columns.append([names[name] * value for value in table.numbers(name).tolist()])
    return columns
