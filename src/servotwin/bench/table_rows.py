"""Which rows of a bench table do not fit the lines through it, and what would be wrong with them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.fits import TableFit, design, fit_line
from servotwin.bench.table_columns import BenchTable, TableColumn

ROW_LEVEL = 0.05
"""Chance that a row of a table without errors is said to fit badly: shared among all rows and lines (Bonferroni)."""

_DOUBT = 0.1  # p-value of one residual from which on a step of the generator is thought of
_STEPS = (1, -1, 2, -2)
_LEAST_STEP = 4.0  # of the resolution of t_a: whole numbers have a smaller common divisor by chance
_MOST_STEP = 64.0  # µs: beyond it pulses were set to round numbers
_HALVED = 0.5  # of the largest residual: what a step has to bring it to
_LINES_ALIKE = 2  # that the same step has to help
_MILLI = 0.1  # V: smaller residuals are told in mV


@dataclass(frozen=True, kw_only=True)
class RowFinding:
    """A row that lies off a line through all others, by a t-test of its leave-one-out residual.

    Parameters
    ----------
    row : int
        From 0.
    label : str
        What to call it.
    line : str
        Name of the line on which it is farthest off.
    residual : float
        On the line through all rows, in the unit of the ordinate.
    t_value : float
        Residual over its standard error, by the line through the other rows; n − 3 degrees of freedom.
    p_value : float
        Two-sided, times the number of rows and lines.
    certain : bool
        Whether `p_value` is below 0.05; else it is a hint, given where the same step of the generator explains the
        residuals of two lines.
    column : str
        Symbol of the column that all lines that it is off have in common, and no line that it is on; empty where
        there is none.
    better : float or None
        The value of that column which the other rows ask for.
    steps : int
        How many steps of the pulse generator `better` is away; 0 where it is none.
    largest, largest_after : float
        Largest residual of the line, with the row as it is and with `better`.
    words : str
    """

    row: int
    label: str
    line: str
    residual: float
    t_value: float
    p_value: float
    certain: bool
    column: str = ""
    better: float | None = None
    steps: int = 0
    largest: float = math.nan
    largest_after: float = math.nan
    words: str = ""


def generator_step(widths: TableColumn) -> float | None:
    """Return the step that all pulse widths of a table are whole multiples apart [µs]; None where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> t_a = np.array([646.0, 1078.0, 1526.0, 1974.0, 2438.0])
    >>> generator_step(TableColumn(name="t_a_us", quantity="pulse_width", symbol="t_a", unit="µs", values=t_a))
    16.0
    """
    place = widths.resolution
    if place < 1e-3:
        return None
    whole = np.unique(np.round(widths.values / place)).astype(np.int64)
    step = reduce(math.gcd, np.diff(whole).tolist(), 0)
    return step * place if step >= _LEAST_STEP and step * place <= _MOST_STEP else None


class _Tested(NamedTuple):
    """A line; and for each row the t-value of its residual by the line through the others, and its p-value."""

    fit: TableFit
    t: NDArray[np.float64]
    p: NDArray[np.float64]


def row_findings(table: BenchTable, lines: Mapping[str, TableFit]) -> tuple[RowFinding, ...]:
    """Return the rows that fit badly, and the row that a step of the generator would make fit.

    Parameters
    ----------
    table : BenchTable
    lines : mapping
        The straight lines through it, by name.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import calibrate_table
    >>> hint, = calibrate_table(st.load_dataset("urrea-kern-table-2").columns).rows
    >>> hint.label, hint.line, hint.better, hint.certain
    ('row 3 (q = 90 °)', 'V_o(t_a)', 1542.0, False)
    """
    tested = [_tested(fit) for fit in lines.values()]
    found = []
    for row in range(table.rows if tested else 0):
        one = min(tested, key=lambda each: each.p[row])
        if table.rows * len(tested) * one.p[row] < ROW_LEVEL:
            found.append(_certain(_found(table, tested, one, row), tested, one.fit))
    if not any(finding.steps for finding in found):
        hint = _hint(table, tested)
        found += [] if hint is None or any(finding.row == hint.row for finding in found) else [hint]
    return tuple(found)


def smallest_p_value(lines: Mapping[str, TableFit]) -> float:
    """Return the p-value of the worst row, corrected for all rows and lines."""
    p = np.array([_tested(fit).p for fit in lines.values()])
    return min(1.0, p.size * float(p.min()))


def _tested(fit: TableFit) -> _Tested:
    from scipy.special import stdtr

    x, r = fit.x, np.asarray(fit.line.residuals)
    columns = np.linalg.qr(design((x - x.mean()) / np.ptp(x), fit.ways))[0]
    free = np.maximum(1.0 - (columns**2).sum(axis=1), 1e-12)
    freedom = fit.line.freedom - 1
    variance = np.maximum(((r**2).sum() - r**2 / free) / freedom, fit.rounding)
    scale = 1e-12 * float(np.abs(fit.y).max())
    t = r / np.sqrt(np.maximum(variance * free, scale**2))
    return _Tested(fit, t, 2.0 * stdtr(freedom, -np.abs(t)))


def _found(table: BenchTable, tested: Sequence[_Tested], one: _Tested, row: int) -> RowFinding:
    """Return what the line on which a row is farthest off says of it."""
    p = min(1.0, table.rows * len(tested) * float(one.p[row]))
    return RowFinding(row=row, label=table.label(row), line=one.fit.name, residual=one.fit.line.residuals[row],
                      t_value=float(one.t[row]), p_value=p, certain=p < ROW_LEVEL)


def _changed(fit: TableFit, column: TableColumn, row: int, value: float) -> float:
    """Return the largest residual with another value in a row."""
    x, y = fit.x.copy(), fit.y.copy()
    (x if fit.x_column is column else y)[row] = value
    return fit_line(x, y, ways=fit.ways).max_residual


def _certain(found: RowFinding, tested: Sequence[_Tested], fit: TableFit) -> RowFinding:
    """Return a finding with words, and with the column that just the lines which it is off have in common, if one."""
    row = found.row
    words = (f"{found.label} fits badly: {_off(fit, found.residual)} (leave-one-out t = {found.t_value:.1f}, "
             f"p = {found.p_value:.1g} for all rows and lines)")
    off = {one.fit.name for one in tested if one.p[row] < ROW_LEVEL / one.p.size}
    columns = {column for one in tested for column in (one.fit.x_column, one.fit.y_column)}
    common = [column for column in columns if {one.fit.name for one in tested if one.fit.has(column)} == off]
    if len(common) != 1 or len(off) < 2:
        return replace(found, words=words)
    column = common[0]
    better, best = _asked(tested, column, row)
    now, step = float(column.values[row]), generator_step(column) if column.quantity == "pulse_width" else None
    steps = 0 if step is None else round((better - now) / step)
    if step is not None and 0 < abs(steps) <= max(_STEPS):
        better = now + steps * step
    else:
        steps = 0
    words += (f"; the lines without {column.symbol} do not show it, so {column.symbol} is wrong there: "
              f"{now:.5g} {column.unit}, where the other rows ask for {better:.5g} {column.unit}")
    return replace(found, column=column.symbol, better=better, steps=steps, words=words,
                   largest=best.line.max_residual, largest_after=_changed(best, column, row, better))


def _asked(tested: Sequence[_Tested], column: TableColumn, row: int) -> tuple[float, TableFit]:
    """Return the value that the other rows ask for in a column, by the line that they lie on best, and that line."""
    rests = [(fit_line(*(np.delete(values, row) for values in (one.fit.x, one.fit.y)),
                       ways=None if one.fit.ways is None else np.delete(one.fit.ways, row)), one.fit)
             for one in tested if one.fit.has(column)]
    rest, best = min(rests, key=lambda pair: pair[0].max_residual / float(np.ptp(pair[1].y)))
    x, y = float(best.x[row]), float(best.y[row])
    return (y - rest.intercept) / rest.slope if best.x_column is column else rest(x), best


def _hint(table: BenchTable, tested: Sequence[_Tested]) -> RowFinding | None:
    """Return the row whose pulse width, a step or two away, at least halves the largest residual of two lines.

    One line alone would do so in a third of all tables without errors, and the lines without it must not show the row.
    """
    column = table.first("pulse_width")
    step = None if column is None else generator_step(column)
    if column is None or step is None:
        return None
    helped: dict[tuple[int, int], list[tuple[float, _Tested]]] = {}
    for one in tested:
        row = int(np.argmin(one.p))
        if not one.fit.has(column) or one.p[row] > _DOUBT:
            continue
        for steps in _STEPS:
            after = _changed(one.fit, column, row, column.values[row] + steps * step)
            if after < _HALVED * one.fit.line.max_residual:
                helped.setdefault((row, steps), []).append((after, one))
    without = [one for one in tested if not one.fit.has(column)]
    alike = {key: by_line for key, by_line in helped.items() if len(by_line) >= _LINES_ALIKE
             and not any(one.p[key[0]] < _DOUBT / table.rows for one in without)}
    if not alike:
        return None
    row, steps = max(alike, key=lambda key: len(alike[key]))
    after, one = min(alike[row, steps], key=lambda pair: pair[0] / pair[1].fit.line.max_residual)
    found = replace(_found(table, tested, one, row), certain=False, column=column.symbol, steps=steps,
                    better=float(column.values[row]) + steps * step, largest=one.fit.line.max_residual,
                    largest_after=after)
    more = [other.fit.name for _, other in alike[row, steps] if other is not one]
    return replace(found, words=_hint_words(found, one.fit, step, float(one.p[row]), more))


def _hint_words(found: RowFinding, fit: TableFit, step: float, single_p: float, more: list[str]) -> str:
    scale, unit = _shown(fit)
    return (f"{found.label}: {_off(fit, found.residual)} (leave-one-out t = {found.t_value:.1f}, p = {single_p:.2g}; "
            f"{found.p_value:.2g} for all rows and lines: no proof). With {found.column} = {found.better:.5g} µs, "
            f"{'one step' if abs(found.steps) == 1 else 'two steps'} of {step:g} µs of the generator "
            f"{'more' if found.steps > 0 else 'less'}, the largest residual of {fit.name} would fall from "
            f"{scale * found.largest:.1f} to {scale * found.largest_after:.1f} {unit}, and that of "
            f"{' and '.join(more)} to less than half: its {found.column} may be of another frame")


def _off(fit: TableFit, residual: float) -> str:
    scale, unit = _shown(fit)
    return f"{abs(scale * residual):.3g} {unit} {'above' if residual > 0.0 else 'below'} the line {fit.name}"


def _shown(fit: TableFit) -> tuple[float, str]:
    return (1e3, "mV") if fit.unit == "V" and fit.line.max_residual < _MILLI else (1.0, fit.unit)
