"""Columns to files and back: CSV, which anything reads, or Parquet, which is smaller and faster."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError
from servotwin.text import checked_name

Column = NDArray[Any]

FORMATS = ("csv", "parquet")


def check_format(name: str) -> None:
    """Raise unless it is a format that can be written here.

    Raises
    ------
    InputError, MissingExtraError
    """
    if name not in FORMATS:
        raise InputError("format", got=name, allowed=", ".join(FORMATS))
    if name == "parquet":
        _arrow()


def encoded(columns: Mapping[str, Column], file_format: str) -> bytes:
    """Return columns of one length as the contents of a file; numbers come back to the last bit.

    Examples
    --------
    >>> encoded({"lane": np.array([0]), "overshoot": np.array([0.1])}, "csv").decode().splitlines()
    ['lane,overshoot', '0,0.1']
    """
    if file_format == "parquet":
        arrow, file = _arrow(), io.BytesIO()
        import pyarrow.parquet

        pyarrow.parquet.write_table(arrow.table({name: arrow.array(x) for name, x in columns.items()}), file)
        return file.getvalue()
    return csv_text({name: (column + 0.0 if column.dtype.kind == "f" else column).tolist()
                     for name, column in columns.items()}).encode()


def csv_text(columns: Mapping[str, Iterable[object]], *, digits: int | None = None) -> str:
    """Return columns as the text of a CSV file; shorter ones end in empty cells.

    Parameters
    ----------
    columns : mapping of str to iterable
        Words and numbers.
    digits : int, optional
        Of each float; as many as bring it back to the last bit unless given.

    Examples
    --------
    >>> csv_text({"servo": ["a, b", "c"], "torque_Nm": [1.0 / 3.0]}, digits=3).splitlines()
    ['servo,torque_Nm', '"a, b",0.333', 'c,']
    """
    rows = zip_longest(*columns.values(), fillvalue="")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows if digits is None else (
        [f"{cell:.{digits}g}" if isinstance(cell, float) else cell for cell in row] for row in rows))
    return text.getvalue()


def read_columns(path: str | Path) -> dict[str, Column]:
    """Return the columns of a CSV or Parquet file: numbers where all are numbers, words otherwise.

    Parameters
    ----------
    path : str or Path
        Its ending says which of the two it is: .csv or .parquet.

    Raises
    ------
    InputError
        If it cannot be read, or has no rows.
    """
    file = Path(path)
    try:
        if file.suffix.lower() == ".parquet":
            found = _parquet(file)
        else:
            found = _csv(file)
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "not a table of columns"
        raise InputError(f"{path} cannot be read ({reason})") from None
    if not found or not len(next(iter(found.values()))):
        raise InputError(str(path), got="no rows", allowed="a header and at least one row")
    for k, name in enumerate(found, 1):
        checked_name(f"{path}: name of column {k}", name, math.inf)
    return found


def _csv(file: Path) -> dict[str, Column]:
    with file.open(newline="", encoding="utf-8-sig") as stream:
        header, *rows = [row for row in csv.reader(stream) if row] or [[]]
    if len(set(header)) < len(header) or any(len(row) != len(header) for row in rows):
        raise ValueError("a name twice, or rows of different lengths")
    return {name.strip(): _column([row[k] for row in rows]) for k, name in enumerate(header)}


def _column(words: list[str]) -> Column:
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        return np.array(words, dtype=np.str_)


def _parquet(file: Path) -> dict[str, Column]:
    _arrow()
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(file)
    found = {}
    for name in table.column_names:
        values = table[name].to_numpy()
        found[name] = values.astype(np.str_) if values.dtype.kind == "O" else values.astype(np.float64)
    return found


def _arrow() -> Any:
    try:
        import pyarrow
    except ImportError:
        raise MissingExtraError("pyarrow", "sweep") from None
    return pyarrow
