"""The columns of anyone's bench table: which quantity each one is, in which unit, and whether it can be true."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.bench.dial_names import dial_columns
from servotwin.errors import InputError
from servotwin.tables import read_table


class _Quantity(NamedTuple):
    symbol: str  # the paper's
    title: str
    unit: str  # of the table
    lower: float
    upper: float  # beyond these the unit of the column cannot be right


QUANTITIES: dict[str, _Quantity] = {
    "output_angle": _Quantity("q", "output angle", "°", -3600.0, 3600.0),
    "command_voltage": _Quantity("V_i", "command voltage", "V", -60.0, 60.0),
    "command_count": _Quantity("ADC_i", "command count", "counts", 0.0, 2.0**24),
    "pulse_width": _Quantity("t_a", "pulse width", "µs", 50.0, 20000.0),
    "pulse_rate": _Quantity("f", "pulse rate", "Hz", 1.0, 2000.0),
    "feedback_voltage": _Quantity("V_o", "feedback voltage", "V", -60.0, 60.0),
    "feedback_count": _Quantity("ADC_o", "feedback count", "counts", 0.0, 2.0**24),
}
_DEG = 180.0 / math.pi
# unit of the table -> what the name of a column ends in, and the factor; without a unit it is in SI
_ENDS = {"°": {"_deg": 1.0, "_rad": _DEG, "": _DEG}, "V": {"_V": 1.0, "_mV": 1e-3, "": 1.0},
         "µs": {"_us": 1.0, "_ms": 1e3, "_s": 1e6, "": 1e6}, "Hz": {"_Hz": 1.0, "": 1.0}, "counts": {"": 1.0}}
_NAMES = {f"{name}{end}": (quantity, factor) for quantity, known in QUANTITIES.items()
          for name in (quantity, known.symbol) for end, factor in _ENDS[known.unit].items()}
_NUMBER = re.compile(r"_(\d+)(?=(?:_[A-Za-z]+)?$)")  # the 2 of feedback_voltage_2_V: another instrument
_LEAST_ROWS = 4
_LEAST_BOTH, _LEAST_WAY = 6, 3  # rows of a table that was read both ways, and of each


@dataclass(frozen=True, kw_only=True, eq=False)
class TableColumn:
    """A column that was understood.

    Parameters
    ----------
    name : str
        In the table.
    quantity : str
        Such as ``"feedback_voltage"``; empty for one that only its numbers may explain.
    symbol : str
        For names of lines, such as ``"V_o"``; a second one of the same quantity is ``"V_o 2"``.
    unit : str
        Of the values: °, µs, V, counts or Hz.
    values : ndarray, shape (n,)
    """

    name: str
    quantity: str
    symbol: str
    unit: str
    values: NDArray[np.float64] = field(repr=False)

    @property
    def resolution(self) -> float:
        """The last decimal place that the values use, in their unit; 0 where they use all.

        At most 0.01 V, or 1 of another unit: values that were set may be round, however finely they are read.
        """
        return last_place(self.values, 2 if self.unit == "V" else 0)


def last_place(values: NDArray[np.float64], first: int = 0) -> float:
    """Return the last decimal place that numbers use, from the place `first` behind the point on; 0 where they use all.

    Examples
    --------
    >>> last_place(np.array([230.0, 405.0])), last_place(np.array([0.25, 0.1]))
    (1.0, 0.01)
    """
    size = float(np.abs(values).max())
    for k in range(first, 10):
        if np.all(np.abs(np.round(values, k) - values) <= 1e-12 * size):
            return 10.0**-k
    return 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchTable:
    """The columns of a bench table, checked.

    Parameters
    ----------
    source : str
        Where it was read.
    columns : tuple of TableColumn
        What each one says is known, by its name.
    others : tuple of TableColumn
        Numbers under an unknown name.
    ignored : tuple of str
        All unknown names.
    told_ways : ndarray, optional
        Which way each row was read, where the table's columns say so.
    """

    source: str
    columns: tuple[TableColumn, ...]
    others: tuple[TableColumn, ...] = ()
    ignored: tuple[str, ...] = ()
    told_ways: NDArray[np.float64] | None = None

    @cached_property
    def ways(self) -> NDArray[np.float64] | None:
        """Which way each row was read, −½ up and ½ down, by the command or pulse of the row before; None for one way.

        The first row counts as one of the way that follows, one with the value of the row before as one of its way.
        Rows that turn back after less than three each were read in no order, and are of one way.
        """
        if self.told_ways is not None:
            return self.told_ways
        if self.dialled is None or self.rows < _LEAST_BOTH:
            return None
        steps = np.sign(np.diff(self.dialled.values))
        moved = np.flatnonzero(steps)
        steps = steps[moved[np.maximum(np.searchsorted(moved, np.arange(steps.size), side="right") - 1, 0)]]
        ways = -0.5 * np.concatenate([steps[:1], steps])
        turns = int((np.diff(ways) != 0.0).sum())
        both = min((ways < 0.0).sum(), (ways > 0.0).sum()) >= _LEAST_WAY
        return ways if both and 3 * turns <= self.rows else None

    @property
    def dialled(self) -> TableColumn | None:
        """The pulse or command that was set in each row; None where there is none."""
        return self.first("pulse_width") or self.first("command_voltage") or self.first("command_count")

    @property
    def at_turns(self) -> NDArray[np.bool_]:
        """Rows whose way no order tells: those of the first value, and those whose value stands twice at a turn."""
        found = np.zeros(self.rows, dtype=np.bool_)
        if self.dialled is None or self.ways is None:
            return found
        runs = np.concatenate([[0], np.cumsum(np.diff(self.dialled.values) != 0.0)])  # of equal values
        found[runs == 0] = True
        for run in np.flatnonzero(np.bincount(runs) > 1):
            rows = np.flatnonzero(runs == run)
            found[rows] |= len(set(self.ways[rows[0]:rows[-1] + 2])) > 1
        return found

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return int(self.columns[0].values.size)

    def of(self, quantity: str) -> tuple[TableColumn, ...]:
        """Return all columns of a quantity."""
        return tuple(column for column in self.columns if column.quantity == quantity)

    def first(self, quantity: str) -> TableColumn | None:
        """Return the column of a quantity that lines go through; None where there is none."""
        return next((column for column in self.columns if column.quantity == quantity), None)

    def label(self, row: int) -> str:
        """Return how to call a row, counted from 0.

        Examples
        --------
        >>> table = bench_table({"q_deg": [0, 45, 90, 135], "t_a_us": [646, 1078, 1526, 1974]})
        >>> table.label(2)
        'row 3 (q = 90 °)'
        """
        key = self.first("output_angle") or self.columns[0]
        return f"row {row + 1} ({key.symbol} = {key.values[row]:g} {key.unit})"


def bench_table(table: str | Path | Mapping[str, ArrayLike], *, source: str | None = None) -> BenchTable:
    """Return the columns of a table that a calibration can use.

    Parameters
    ----------
    table : str, Path or mapping
        A CSV file with a header, or columns of equal length by name.
    source : str, optional
        Where it comes from; the path unless given.

    Raises
    ------
    InputError
        If the file cannot be read, a column is not usable, or there are too few columns or rows.

    Examples
    --------
    >>> table = bench_table({"q_deg": [0, 45, 90, 135], "t_a_us": [646, 1078, 1526, 1974], "who": ["me"] * 4})
    >>> [column.symbol for column in table.columns], table.ignored
    (['q', 't_a'], ('who',))
    """
    where = "table" if isinstance(table, Mapping) else str(table)
    found, units = (_given(table), {}) if isinstance(table, Mapping) else _of_file(Path(table))
    ways = None
    if len({_NAMES[_NUMBER.sub("", name)][0] for name in found if _NUMBER.sub("", name) in _NAMES}) < 2 and (
            dial := dial_columns(found, units)) is not None:
        found, ways = dial
    known = [name for name in found if _NUMBER.sub("", name) in _NAMES]
    ignored = tuple(name for name in found if name not in known)
    columns: list[TableColumn] = []
    for name in known:
        values = found[name]
        if isinstance(values, InputError):
            raise values
        columns.append(_column(where, name, values, columns))
    if len({column.quantity for column in columns} - {"pulse_rate"}) < 2:
        wanted = ", ".join(("output_angle_deg", "pulse_width_us", "command_voltage_V", "command_count",
                            "feedback_voltage_V", "feedback_count"))
        raise InputError(f"{where}: columns", got=", ".join(found) or "none",
                         allowed=f"at least two of {wanted} (with commas between columns)")
    others = tuple(column for name in ignored if (column := _other(name, found[name])) is not None)
    return BenchTable(source=source or ("a table without a name" if isinstance(table, Mapping) else where),
                      columns=tuple(columns), others=others, ignored=ignored, told_ways=ways)


def _given(table: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64] | InputError]:
    found: dict[str, NDArray[np.float64] | InputError] = {}
    for name, given in table.items():
        try:
            values = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            found[str(name)] = InputError(f"table: column {name}", got=given, allowed="numbers")
            continue
        if values.ndim != 1:
            raise InputError(f"table: column {name}", got=f"shape {values.shape}", allowed="one dimension")
        found[str(name)] = values
    sizes = {name: values.size for name, values in found.items() if not isinstance(values, InputError)}
    if len(set(sizes.values())) > 1:
        raise InputError("table: lengths of the columns", allowed="all equal",
                         got=", ".join(f"{name} {size}" for name, size in sizes.items()))
    return found


def _of_file(path: Path) -> tuple[dict[str, NDArray[np.float64] | InputError], dict[str, str]]:
    """Return the columns of a file, and the units that a line below the header says of them."""
    table = read_table(path, lambda name: _NUMBER.sub("", name) in _NAMES)
    table.check_lengths(shorter=True)
    twice = [name for name in table.header if name and table.header.count(name) > 1]
    if twice:
        raise InputError(f"{path}: column", got=f"{twice[0]} {table.header.count(twice[0])} times",
                         allowed=f"once; another instrument is {twice[0]}_2, its number in front of the unit")
    found: dict[str, NDArray[np.float64] | InputError] = {}
    for name in filter(None, table.header):
        try:
            values = table.numbers(name)
        except InputError as error:
            found[name] = error
            continue
        bad = np.flatnonzero(~np.isfinite(values))
        found[name] = values if not bad.size else InputError(
            f"{path}: line {table.rows[bad[0]].line}, {name}", got=float(values[bad[0]]), allowed="a finite number")
    return found, dict(zip(table.header, table.units, strict=False))


def _column(where: str, name: str, given: NDArray[np.float64], before: list[TableColumn]) -> TableColumn:
    quantity, factor = _NAMES[_NUMBER.sub("", name)]
    known = QUANTITIES[quantity]
    what = f"{where}: column {name}"
    if given.size < _LEAST_ROWS:
        raise InputError(f"{where}: rows", got=int(given.size), allowed=f"at least {_LEAST_ROWS}")
    if not np.isfinite(given).all():
        row = int(np.argmin(np.isfinite(given)))
        raise InputError(f"{what}, row {row + 1}", got=float(given[row]), allowed="a finite number")
    values = factor * given
    outside = (values < known.lower) | (values > known.upper)
    if outside.any():
        row = int(np.argmax(outside))
        raise InputError(f"{what}, row {row + 1}", got=float(given[row]),
                         allowed=f"{known.lower / factor:g} to {known.upper / factor:g}; is the unit right?")
    if np.ptp(values) == 0.0 and quantity != "pulse_rate":
        raise InputError(what, got=f"{given[0]:g} in all rows", allowed="values that differ")
    number = 1 + sum(column.quantity == quantity for column in before)
    return TableColumn(name=name, quantity=quantity, unit=known.unit, values=values,
                       symbol=known.symbol if number == 1 else f"{known.symbol} {number}")


def _other(name: str, values: NDArray[np.float64] | InputError) -> TableColumn | None:
    """Return a column of volts or counts under an unknown name, None for anything else."""
    if isinstance(values, InputError) or values.size < _LEAST_ROWS or not np.isfinite(values).all():
        return None
    if np.ptp(values) == 0.0:
        return None
    for end, factor in _ENDS["V"].items():
        if end and name.endswith(end):
            return TableColumn(name=name, quantity="", symbol=name, unit="V", values=factor * values)
    if np.all(values >= 0.0) and np.all(values == np.round(values)):
        return TableColumn(name=name, quantity="", symbol=name, unit="counts", values=values)
    return None
