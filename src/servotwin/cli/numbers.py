"""Numbers and columns out of words and files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from servotwin.errors import InputError
from servotwin.tables import read_table


def numbers(what: str, text: str, names: tuple[str, ...], *, required: int | None = None,
            alone: str = "numbers alone") -> list[float]:
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
    alone : str
        What is allowed where several numbers are asked for, such as where their unit is said.

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
        raise InputError(what, got=text, allowed=f"{form}, {alone}" if len(names) > 1 else "a number alone")
    return values


def columns_in_si(path: Path, *wanted: Mapping[str, float]) -> list[list[float]]:
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
    >>> columns_in_si(file, {"time_s": 1.0}, {"torque_Nm": 1.0, "torque_mNm": 1e-3})
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
