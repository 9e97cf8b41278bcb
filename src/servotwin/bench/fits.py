"""Straight lines through the paper's table, with standard errors, and a test for curvature."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError


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
        y − (slope x + intercept).

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

    @property
    def max_residual(self) -> float:
        """The largest magnitude of a residual."""
        return max(abs(r) for r in self.residuals)

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


@dataclass(frozen=True, kw_only=True)
class TableFit:
    """A named fit of one column of a bench table over another.

    Parameters
    ----------
    name : str
        Such as ``"q(V_i)"``.
    abscissa, ordinate : str
        Columns of the table.
    slope_unit, unit : str
        Of the slope, and of intercept and residuals.
    line : LineFit
    curvature : CurvatureTest
    x, y : tuple of float
        The points.
    """

    name: str
    abscissa: str
    ordinate: str
    slope_unit: str
    unit: str
    line: LineFit
    curvature: CurvatureTest
    x: tuple[float, ...] = field(repr=False)
    y: tuple[float, ...] = field(repr=False)


def fit_line(x: ArrayLike, y: ArrayLike) -> LineFit:
    """Return the least-squares line through points.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        At least 3 points, not all at one x.

    Raises
    ------
    InputError
        If there are too few points, they are not finite, or all have the same x.
    """
    a, b = _points(x, y, 3)
    a_mean = float(a.mean())
    spread = float(((a - a_mean) ** 2).sum())
    slope = float(((a - a_mean) * (b - b.mean())).sum()) / spread
    intercept = float(b.mean()) - slope * a_mean
    residuals = b - slope * a - intercept
    variance = float((residuals**2).sum()) / (a.size - 2)
    return LineFit(
        slope=slope, intercept=intercept, slope_error=math.sqrt(variance / spread),
        intercept_error=math.sqrt(variance * (1.0 / a.size + a_mean**2 / spread)),
        covariance=-a_mean * variance / spread, residuals=tuple(residuals.tolist()))


def curvature_test(x: ArrayLike, y: ArrayLike) -> CurvatureTest:
    """Return the F-test of a quadratic term beside a line.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        At least 4 points, at 3 or more different x.

    Raises
    ------
    InputError
        If there are too few points, or they are not finite.
    """
    from scipy.special import stdtr

    a, b = _points(x, y, 4)
    if np.unique(a).size < 3:
        raise InputError("points of a parabola", got=f"{np.unique(a).size} different x", allowed="at least 3")
    scale = float(np.ptp(a)) / 2.0
    u = (a - a.mean()) / scale  # well conditioned, whatever the units
    basis = np.vander(u, 3)
    inverse = np.linalg.inv(basis.T @ basis)
    solution = inverse @ basis.T @ b
    free = a.size - 3
    variance = float(((b - basis @ solution) ** 2).sum()) / free
    error = math.sqrt(variance * float(inverse[0, 0]))
    t = float(solution[0]) / error if error > 0.0 else math.inf
    return CurvatureTest(
        quadratic=float(solution[0]) / scale**2, quadratic_error=error / scale**2, f_value=t * t,
        p_value=2.0 * float(stdtr(free, -abs(t))), sagitta=abs(float(solution[0])))


# name, abscissa, ordinate, unit of the slope, unit of the ordinate
_FITS = (
    ("q(V_i)", "V_i_V", "q_deg", "°/V", "°"),
    ("q(t_a)", "t_a_us", "q_deg", "°/µs", "°"),
    ("V_o(q)", "q_deg", "V_o_V", "V/°", "V"),
    ("V_o(V_i)", "V_i_V", "V_o_V", "V/V", "V"),
    ("V_o(t_a)", "t_a_us", "V_o_V", "V/µs", "V"),
    ("t_a(V_i)", "V_i_V", "t_a_us", "µs/V", "µs"),
    ("ADC_i(V_i)", "V_i_V", "ADC_i", "counts/V", "counts"),
    ("ADC_o(V_o)", "V_o_V", "ADC_o", "counts/V", "counts"),
)


def table_fits(columns: Mapping[str, ArrayLike]) -> dict[str, TableFit]:
    """Return the straight lines through the paper's Table II, in the table's own units.

    Parameters
    ----------
    columns : mapping
        The columns q_deg, V_i_V, ADC_i, t_a_us, V_o_V, ADC_o of equal length.

    Returns
    -------
    dict
        By name: q(V_i), q(t_a), V_o(q), V_o(V_i), V_o(t_a), t_a(V_i), ADC_i(V_i), ADC_o(V_o).

    Raises
    ------
    InputError
        If a column is missing or not usable.

    Examples
    --------
    >>> import servotwin as st
    >>> fits = table_fits(st.load_dataset("urrea-kern-table-2").columns)
    >>> round(fits["q(V_i)"].line.slope, 2), round(fits["q(V_i)"].line.slope_error, 2)
    (109.77, 0.69)
    """
    fits = {}
    for name, abscissa, ordinate, slope_unit, unit in _FITS:
        for column in (abscissa, ordinate):
            if column not in columns:
                raise InputError("columns of the table", got=", ".join(columns), allowed=f"a column {column}")
        fits[name] = table_fit(name, columns, abscissa, ordinate, slope_unit=slope_unit, unit=unit)
    return fits


def table_fit(name: str, columns: Mapping[str, ArrayLike], abscissa: str, ordinate: str, *, slope_unit: str,
              unit: str) -> TableFit:
    """Return the straight line of one column over another.

    Parameters
    ----------
    name : str
        Of the fit.
    columns : mapping
        Has both columns, of one length, at least 4.
    abscissa, ordinate : str
        Names of the columns.
    slope_unit, unit : str
        Of the slope, and of the ordinate.

    Raises
    ------
    InputError
        If a column is not usable.

    Examples
    --------
    >>> columns = {"V_i_V": [1.0, 2.0, 3.0, 4.0], "q_deg": [10.0, 20.0, 30.5, 40.0]}
    >>> fit = table_fit("q(V_i)", columns, "V_i_V", "q_deg", slope_unit="°/V", unit="°")
    >>> f"{fit.line.slope:.2f} ± {fit.line.slope_error:.2f} {fit.slope_unit}"
    '10.05 ± 0.13 °/V'
    """
    x, y = _points(columns[abscissa], columns[ordinate], 4)
    return TableFit(name=name, abscissa=abscissa, ordinate=ordinate, slope_unit=slope_unit, unit=unit,
                    line=fit_line(x, y), curvature=curvature_test(x, y),
                    x=tuple(x.tolist()), y=tuple(y.tolist()))


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
