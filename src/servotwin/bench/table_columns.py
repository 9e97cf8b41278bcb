"""The columns of anyone's bench table: which quantity each one is, in which unit, and whether it can be true."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError
from servotwin.logs.columns import meaning_of, words_and_unit
from servotwin.tables import read_table

# --- Columns of a dial under names of one's own -----------------------------------------------------------------------

Values = NDArray[np.float64] | InputError
_UP = frozenset("up rising auf hin increasing ascending".split())
_DOWN = frozenset("down falling ab zurueck rueck decreasing descending back".split())
_OURS = {("pulse", "us"): "pulse_width_us", ("pulse", "ms"): "pulse_width_ms", ("pulse", "s"): "pulse_width_s",
         ("angle", "deg"): "output_angle_deg", ("angle", "rad"): "output_angle_rad",
         ("feedback", "V"): "feedback_voltage_V", ("feedback", "mV"): "feedback_voltage_mV"}


class Dial(NamedTuple):
    """Columns under our names, and which way each row was read where two columns say so, −½ up and ½ down."""

    columns: dict[str, Values]
    ways: NDArray[np.float64] | None


def dial_columns(given: Mapping[str, Values], units: Mapping[str, str]) -> Dial | None:
    """Return columns under the names of a bench table, with a row for each way where they hold both.

    Parameters
    ----------
    given : mapping of str to ndarray or InputError
    units : mapping of str to str
        Of columns that have one below the header.

    Raises
    ------
    InputError
        If two columns mean the same.

    Examples
    --------
    >>> x = np.array([1.0, 2.0])
    >>> dial = dial_columns({"pulse [us]": x, "angle_up_deg": x, "angle_down_deg": x + 1.0}, {})
    >>> dial.columns["output_angle_deg"].tolist(), dial.ways.tolist()
    ([1.0, 2.0, 3.0, 2.0], [-0.5, -0.5, 0.5, 0.5])
    """
    ours: dict[tuple[str, str], str] = {}
    for column in given:
        named = _named(column, units.get(column, ""))
        if named is None:
            continue
        if named in ours:
            raise InputError(f"columns {ours[named]} and {column}", got="both the same", allowed="one, or the words up "
                             "and down in their names")
        ours[named] = column
    names = tuple(dict.fromkeys(name for name, _ in ours))
    if len(names) < 2:
        return None
    two = [name for name in names if {(name, "up"), (name, "down")} <= ours.keys()]
    if not two:
        return Dial({name: given[column] for (name, _), column in ours.items()}, None)
    once = [name for name, way in ours if not way]
    order = _order(given[ours[once[0], ""]]) if once else None
    columns: dict[str, Values] = {}
    for name in (name for name in names if name in two or (name, "") in ours):
        up, down = (given[ours[name, way if name in two else ""]] for way in ("up", "down"))
        columns[name] = _stacked(up, down, order)
    sizes = {values.size for values in columns.values() if not isinstance(values, InputError)}
    half = max(sizes, default=0) // 2
    return Dial(columns, np.repeat([-0.5, 0.5], half))


def _named(column: str, below: str) -> tuple[str, str] | None:
    """Return our name of a column, and "up" or "down" where it is of one way."""
    words, _ = words_and_unit(column, below)
    meant = meaning_of(column, below)
    if meant is None or (meant.role, meant.unit) not in _OURS:
        return None
    return _OURS[meant.role, meant.unit], "up" if words & _UP else "down" if words & _DOWN else ""


def _order(values: Values) -> NDArray[np.intp] | None:
    return None if isinstance(values, InputError) else np.argsort(values, kind="stable")


def _stacked(up: Values, down: Values, order: NDArray[np.intp] | None) -> Values:
    """Return the rows of the way up and, from the top on, those of the way down."""
    if isinstance(up, InputError):
        return up
    if isinstance(down, InputError):
        return down
    return np.concatenate([up, down[::-1]]) if order is None else np.concatenate([up[order], down[order][::-1]])

# --- The columns of anyone's bench table ------------------------------------------------------------------------------

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
        Columns whose names are known.
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

# --- Straight lines through the columns of a bench table, with standard errors, and a test for curvature --------------

_FITS_LEAST_WAY = 2  # rows of each way whose way is known, below which no row is put to one by what it reads


@dataclass(frozen=True, kw_only=True)
class LineFit:
    """A least-squares line y = slope x + intercept through n points.

    Parameters
    ----------
    slope, intercept : float
        In the units of y per x, and of y.
    slope_error, intercept_error : float
        One standard error of each.
    covariance : float
        Of slope and intercept, in the product of their units.
    residuals : tuple of float, length n
        y − (slope x + intercept), less half of the hysteresis on the side where the point lies.
    freedom : int
        Degrees of freedom: points less what was fitted to them.
    hysteresis : float
        How much larger y is on the way down than on the way up at one x, in its unit; 0 where `ways` were not given.
    hysteresis_error : float
        Its standard error.

    Examples
    --------
    >>> line = fit_line([0.0, 1.0, 2.0], [1.0, 3.0, 5.0])
    >>> round(line.slope, 9), round(line.intercept, 9), round(float(line(3.0)), 9)
    (2.0, 1.0, 7.0)
    """

    slope: float
    intercept: float
    slope_error: float
    intercept_error: float
    covariance: float
    residuals: tuple[float, ...]
    freedom: int = 0
    hysteresis: float = 0.0
    hysteresis_error: float = 0.0

    @property
    def max_residual(self) -> float:
        """The largest magnitude of a residual."""
        return max(abs(r) for r in self.residuals)

    def scaled(self, x: float, y: float) -> LineFit:
        """Return the same line where abscissas are `x` and ordinates `y` times as large numbers."""
        return LineFit(slope=self.slope * y / x, intercept=self.intercept * y, slope_error=self.slope_error * y / x,
                       intercept_error=self.intercept_error * y, covariance=self.covariance * y**2 / x,
                       residuals=tuple(r * y for r in self.residuals), freedom=self.freedom,
                       hysteresis=self.hysteresis * y, hysteresis_error=self.hysteresis_error * y)

    def wide(self, error: float, level: float = 0.95) -> float:
        """Return half of the interval of a number with this standard error, by Student's t."""
        return wide(error, self.freedom, level)

    @property
    def hysteresis_p(self) -> float:
        """Chance of such a hysteresis, or a larger one, where there is none but noise; 1 where none was looked for."""
        from scipy.special import stdtr

        if self.hysteresis == 0.0 or self.freedom < 1:
            return 1.0
        t = abs(self.hysteresis) / self.hysteresis_error if self.hysteresis_error > 0.0 else math.inf
        return 2.0 * float(stdtr(self.freedom, -t))

    @overload
    def __call__(self, x: float) -> float: ...
    @overload
    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def __call__(self, x: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
        """Return the line at x, any shape."""
        return self.slope * x + self.intercept


@dataclass(frozen=True, kw_only=True)
class CurvatureTest:
    """Does a parabola fit better than a line? F-test of the quadratic term.

    Parameters
    ----------
    quadratic, quadratic_error : float
        Coefficient of x² about the mean of x, and its standard error.
    f_value : float
        (quadratic/quadratic_error)², with 1 and n − 3 degrees of freedom.
    p_value : float
        Probability of such an f_value or a larger one on a straight line with normal errors.
    sagitta : float
        Largest distance of the parabola from its chord over the range of x, in the unit of y.

    Examples
    --------
    >>> x = np.arange(5.0)
    >>> test = curvature_test(x, x**2 + np.array([0.01, -0.01, 0.0, 0.01, -0.01]))
    >>> round(test.quadratic, 2), test.p_value < 0.001
    (1.0, True)
    """

    quadratic: float
    quadratic_error: float
    f_value: float
    p_value: float
    sagitta: float


@dataclass(frozen=True, eq=False)
class TableFit:
    """The straight line of one column of a bench table over another, in the table's units.

    Parameters
    ----------
    x_column, y_column : TableColumn
    ways : ndarray, shape (n,), optional
        −½ for rows that were read on the way up, ½ for those on the way down; None where all are of one way.
    """

    x_column: TableColumn = field(repr=False)
    y_column: TableColumn = field(repr=False)
    ways: NDArray[np.float64] | None = field(default=None, repr=False)

    @cached_property
    def line(self) -> LineFit:
        """The line; where the table was read both ways, between both."""
        return fit_line(self.x, self.y, ways=self.ways)

    @cached_property
    def curvature(self) -> CurvatureTest:
        """Whether a parabola fits better."""
        return curvature_test(self.x, self.y, ways=self.ways)

    @property
    def name(self) -> str:
        """Such as ``"q(V_i)"``."""
        return f"{self.y_column.symbol}({self.x_column.symbol})"

    @property
    def unit(self) -> str:
        """Unit of intercept and residuals."""
        return self.y_column.unit

    @property
    def slope_unit(self) -> str:
        """Unit of the slope."""
        return f"{self.unit}/{self.x_column.unit.replace('counts', 'count')}"

    @property
    def x(self) -> NDArray[np.float64]:
        """Abscissas of the points, shape (n,)."""
        return self.x_column.values

    @property
    def y(self) -> NDArray[np.float64]:
        """Ordinates of the points, shape (n,)."""
        return self.y_column.values

    @property
    def rounding(self) -> float:
        """Variance of a point from the last places of both columns: a few may lie on a line by chance."""
        return (self.y_column.resolution**2 + (self.line.slope * self.x_column.resolution) ** 2) / 12.0

    def has(self, column: TableColumn) -> bool:
        """Return whether it is a line through this column."""
        return column is self.x_column or column is self.y_column


def fit_line(x: ArrayLike, y: ArrayLike, *, weights: ArrayLike | None = None, ways: ArrayLike | None = None,
             least_variance: float = 0.0) -> LineFit:
    """Return the least-squares line through points.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        At least 3 points, not all at one x; 4 with `ways`.
    weights : array_like, shape (n,), optional
        Inverse variances of y but for a factor; all 1 unless given.
    ways : array_like, shape (n,), optional
        −½ and ½, on which way each was read: the difference of both ways is fitted with the line.
    least_variance : float
        That a y of weight 1 has at least, such as that of its last digit.

    Raises
    ------
    InputError
        If there are too few points, they are not finite, or all have the same x.
    """
    a, b = _points(x, y, 3 if ways is None else 4)
    w = np.ones(a.size) if weights is None else np.asarray(weights, dtype=np.float64)
    a_mean = float((w * a).sum() / w.sum())
    basis = design(a - a_mean, ways)
    inverse = np.linalg.inv((basis.T * w) @ basis)
    rise = b - b[0]  # so that equal ones have no slope at all
    slope, middle, *rest = (inverse @ (basis.T @ (w * rise))).tolist()
    residuals = rise - basis @ np.array([slope, middle, *rest])
    freedom = a.size - basis.shape[1]
    cov = inverse * max(float((w * residuals**2).sum()) / freedom, least_variance)
    return LineFit(
        slope=slope, intercept=float(b[0]) + middle - slope * a_mean, slope_error=math.sqrt(cov[0, 0]),
        intercept_error=math.sqrt(max(cov[1, 1] - 2.0 * a_mean * cov[0, 1] + a_mean**2 * cov[0, 0], 0.0)),
        covariance=float(cov[0, 1] - a_mean * cov[0, 0]), residuals=tuple(residuals.tolist()), freedom=freedom,
        hysteresis=rest[0] if rest else 0.0, hysteresis_error=math.sqrt(cov[2, 2]) if rest else 0.0)


def design(x: NDArray[np.float64], ways: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return what a line is a sum of at each point: x, 1 and, where both ways are given, the way."""
    columns = [x, np.ones(x.size), *([] if ways is None else [np.asarray(ways, dtype=np.float64)])]
    return np.stack(columns, axis=1)


def wide(error: float, freedom: int, level: float = 0.95) -> float:
    """Return half of the interval of a number with a standard error from so many degrees of freedom.

    Examples
    --------
    >>> round(wide(1.0, 3), 3), round(wide(1.0, 1000), 2)
    (3.182, 1.96)
    """
    from scipy.special import stdtrit

    return error * float(stdtrit(freedom, 0.5 * (1.0 + level)))


def curvature_test(x: ArrayLike, y: ArrayLike, *, ways: ArrayLike | None = None) -> CurvatureTest:
    """Return the F-test of a quadratic term beside a line.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        At least 4 points, at 3 or more different x.
    ways : array_like, shape (n,), optional
        As of `fit_line`.

    Raises
    ------
    InputError
        If there are too few points, or they are not finite.
    """
    from scipy.special import stdtr

    a, b = _points(x, y, 4 if ways is None else 5)
    if np.unique(a).size < 3:
        raise InputError("points of a parabola", got=f"{np.unique(a).size} different x", allowed="at least 3")
    scale = float(np.ptp(a)) / 2.0
    u = (a - a.mean()) / scale  # well conditioned, whatever the units
    basis = np.column_stack([u**2, design(u, ways)])
    inverse = np.linalg.inv(basis.T @ basis)
    solution = inverse @ basis.T @ b
    free = a.size - basis.shape[1]
    variance = float(((b - basis @ solution) ** 2).sum()) / free
    error = math.sqrt(variance * float(inverse[0, 0]))
    t = float(solution[0]) / error if error > 0.0 else math.inf
    return CurvatureTest(
        quadratic=float(solution[0]) / scale**2, quadratic_error=error / scale**2, f_value=t * t,
        p_value=2.0 * float(stdtr(free, -abs(t))), sagitta=abs(float(solution[0])))


_SHOWN = 0.01  # p-value of a hysteresis from which on it tells the way of a row, so low that noise rarely does; assumed
_OFF = 3.0  # times the noise: so far a row lies off the line of one way that it is of the other; assumed


def settled_ways(table: BenchTable) -> NDArray[np.float64] | None:
    """Return which way each row was read, as `BenchTable.ways`, but at turning points by what was read there.

    A value that stands twice where the ways turn may have been read twice on one way, or again after the shaft had gone
    beyond; of the first row it is unknown where the shaft came from. If the other rows show hysteresis, such a row that
    lies off the line of its way by three times their noise, and nearer to that of the other way, is of the other.

    Examples
    --------
    >>> x = np.array([1.0, 2.0, 3.0, 4.0, 4.0, 3.0, 2.0, 1.0])
    >>> for last in (39.0, 41.0):  # held at the top, or come back from beyond
    ...     y = np.array([9.0, 19.1, 28.9, 39.0, last, 31.0, 21.1, 10.9])
    ...     settled_ways(bench_table({"t_a_us": 100.0 * x, "q_deg": y}))[4].tolist()
    -0.5
    0.5
    """
    x, y = table.dialled, _reading(table, "output_angle") or _reading(table, "feedback")
    if table.ways is None or x is None or y is None:
        return table.ways
    at, ways = table.at_turns, table.ways.copy()
    if at.all() or min(np.sum(ways[~at] < 0.0), np.sum(ways[~at] > 0.0)) < _FITS_LEAST_WAY:
        return ways
    line = fit_line(x.values[~at], y.values[~at], ways=ways[~at])
    off = y.values[at] - line(x.values[at])
    own, other = (np.abs(off - way * line.hysteresis) for way in (ways[at], -ways[at]))
    noise = math.sqrt(sum(r * r for r in line.residuals) / line.freedom)
    ways[at] *= np.where((line.hysteresis_p < _SHOWN) & (own > _OFF * noise) & (other < own), -1.0, 1.0)
    return ways


# ordinate and abscissa of each line; a count stands for its voltage where the table has none
_LINES = (("output_angle", "command"), ("output_angle", "pulse_width"), ("feedback", "output_angle"),
          ("feedback", "command"), ("feedback", "pulse_width"), ("pulse_width", "command"))


def table_fits(table: BenchTable | Mapping[str, ArrayLike]) -> dict[str, TableFit]:
    """Return every straight line that the columns of a table allow, in its units, by name.

    Parameters
    ----------
    table : BenchTable or mapping
        Table of `bench_table`, or the mapping that it takes. The paper's Table II has q(V_i), q(t_a), V_o(q), V_o(V_i),
        V_o(t_a), t_a(V_i), ADC_i(V_i) and ADC_o(V_o).

    Raises
    ------
    InputError
        If the columns are not usable, or allow no line.

    Examples
    --------
    >>> import servotwin as st
    >>> fits = table_fits(st.load_dataset("urrea-kern-table-2").columns)
    >>> round(fits["q(V_i)"].line.slope, 2), round(fits["q(V_i)"].line.slope_error, 2)
    (109.77, 0.69)
    """
    read = table if isinstance(table, BenchTable) else bench_table(table)
    pairs = [(_reading(read, abscissa), _reading(read, ordinate)) for ordinate, abscissa in _LINES]
    for side in ("command", "feedback"):
        pairs.append((read.first(f"{side}_voltage"), read.first(f"{side}_count")))
    ways = settled_ways(read)
    fits = [TableFit(x, y, ways) for x, y in pairs if x is not None and y is not None]
    if not fits:
        raise InputError("lines of the table", got=", ".join(column.name for column in read.columns),
                         allowed="two columns of different quantities")
    return {fit.name: fit for fit in fits}


def _reading(table: BenchTable, what: str) -> TableColumn | None:
    """Return the column of a quantity, or the voltage of a side and, where there is none, its count."""
    return table.first(what) or table.first(f"{what}_voltage") or table.first(f"{what}_count")


def _points(x: ArrayLike, y: ArrayLike, least: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if a.ndim != 1 or a.shape != b.shape or a.size < least:
        raise InputError("points of a fit", got=f"shapes {a.shape} and {b.shape}",
                         allowed=f"two arrays of one length, at least {least}")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InputError("points of a fit", got="values that are not finite", allowed="finite numbers")
    if np.ptp(a) == 0.0:
        raise InputError("points of a fit", got="one x for all", allowed="at least two different x")
    return a, b
