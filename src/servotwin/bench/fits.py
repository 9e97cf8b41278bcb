"""Straight lines through the columns of a bench table, with standard errors, and a test for curvature."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.bench.table_columns import BenchTable, TableColumn, bench_table
from servotwin.errors import InputError

_LEAST_WAY = 2  # rows of each way whose way is known, below which no row is put to one by what it reads


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
    beyond; of the first row no one knows where the shaft came from. If the other rows show hysteresis, such a row that
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
    if at.all() or min(np.sum(ways[~at] < 0.0), np.sum(ways[~at] > 0.0)) < _LEAST_WAY:
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
        What `bench_table` gives, or takes. The paper's Table II has q(V_i), q(t_a), V_o(q), V_o(V_i), V_o(t_a),
        t_a(V_i), ADC_i(V_i) and ADC_o(V_o).

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
