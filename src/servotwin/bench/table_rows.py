"""Which rows of a bench table do not fit the lines through it, and what would be wrong with them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.fits import LineFit, TableFit, fit_line
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
    if not lines:
        return ()
    columns = {column.name: column for column in table.columns}
    values = {name: _t_values(fit, columns) for name, fit in lines.items()}
    single = {name: _p_values(t, t.size - 3) for name, t in values.items()}
    tests = table.rows * len(lines)
    found = []
    for row in range(table.rows):
        name = min(lines, key=lambda key: single[key][row])
        if tests * single[name][row] < ROW_LEVEL:
            off = {key for key in lines if single[key][row] < ROW_LEVEL / table.rows}
            found.append(_certain(table, lines, row, name, float(values[name][row]), tests * single[name][row],
                                  _common(lines, off, columns)))
    if not any(finding.steps for finding in found):
        hint = _hint(table, lines, values, single)
        found += [] if hint is None or any(finding.row == hint.row for finding in found) else [hint]
    return tuple(found)


def smallest_p_value(table: BenchTable, lines: Mapping[str, TableFit]) -> float:
    """Return the p-value of the worst row, corrected for all rows and lines."""
    columns = {column.name: column for column in table.columns}
    single = [_p_values(_t_values(fit, columns), table.rows - 3).min() for fit in lines.values()]
    return min(1.0, table.rows * len(lines) * float(min(single, default=1.0)))


def _t_values(fit: TableFit, columns: Mapping[str, TableColumn]) -> NDArray[np.float64]:
    """Return residuals over their standard errors by the line through the other rows, shape (n,)."""
    x, r = np.asarray(fit.x), np.asarray(fit.line.residuals)
    leverage = 1.0 / x.size + (x - x.mean()) ** 2 / ((x - x.mean()) ** 2).sum()
    rounding = (columns[fit.ordinate].resolution**2
                + (fit.line.slope * columns[fit.abscissa].resolution) ** 2) / 12.0
    free = np.maximum(1.0 - leverage, 1e-12)
    # Points may lie on a line by chance, closer than they were read.
    variance = np.maximum(((r**2).sum() - r**2 / free) / (x.size - 3), rounding)
    scale = 1e-12 * float(np.abs(fit.y).max())
    return np.asarray(r / np.sqrt(np.maximum(variance * free, scale**2)), dtype=np.float64)


def _p_values(t: NDArray[np.float64], freedom: int) -> NDArray[np.float64]:
    from scipy.special import stdtr

    return np.asarray(2.0 * stdtr(freedom, -np.abs(t)), dtype=np.float64)


def _common(lines: Mapping[str, TableFit], off: set[str], columns: Mapping[str, TableColumn]) -> str:
    """Return the column that just those lines have in common; empty where there is none or several."""
    found = [name for name in columns
             if any(_uses(fit, name) for fit in lines.values())
             and {key for key, fit in lines.items() if _uses(fit, name)} == off]
    return found[0] if len(found) == 1 and len(off) > 1 else ""


def _uses(fit: TableFit, column: str) -> bool:
    return column in (fit.abscissa, fit.ordinate)


def _without(fit: TableFit, row: int) -> LineFit:
    return fit_line(np.delete(fit.x, row), np.delete(fit.y, row))


def _changed(fit: TableFit, column: str, row: int, value: float) -> float:
    """Return the largest residual with another value in a row."""
    x, y = np.array(fit.x), np.array(fit.y)
    (x if fit.abscissa == column else y)[row] = value
    return fit_line(x, y).max_residual


def _certain(table: BenchTable, lines: Mapping[str, TableFit], row: int, name: str, t: float, p: float,
             column: str) -> RowFinding:
    fit = lines[name]
    symbols = {c.name: c for c in table.columns}
    label = table.label(row)
    residual = fit.line.residuals[row]
    words = f"{label} fits badly: {_off(fit, residual)} (leave-one-out t = {t:.1f}, p = {p:.1g} for all rows and lines)"
    if not column:
        return RowFinding(row=row, label=label, line=name, residual=residual, t_value=t, p_value=p, certain=True,
                          words=words)
    best = min((fit for fit in lines.values() if _uses(fit, column)),
               key=lambda fit: _without(fit, row).max_residual / float(np.ptp(fit.y)))
    rest = _without(best, row)
    better = (best.y[row] - rest.intercept) / rest.slope if best.abscissa == column else rest(best.x[row])
    steps = 0
    key = symbols[column]
    step = generator_step(key) if key.quantity == "pulse_width" else None
    if step is not None and 0 < abs(round((better - best.x[row]) / step)) <= max(_STEPS):
        steps = round((better - _value(best, column, row)) / step)
        better = _value(best, column, row) + steps * step
    after = _changed(best, column, row, better)
    words += (f"; the lines without {key.symbol} do not show it, so {key.symbol} is wrong there: "
              f"{_value(best, column, row):.5g} {key.unit}, where the other rows ask for {better:.5g} {key.unit}")
    return RowFinding(row=row, label=label, line=name, residual=residual, t_value=t, p_value=p, certain=True,
                      column=key.symbol, better=better, steps=steps, largest=best.line.max_residual,
                      largest_after=after, words=words)


def _value(fit: TableFit, column: str, row: int) -> float:
    return fit.x[row] if fit.abscissa == column else fit.y[row]


def _hint(table: BenchTable, lines: Mapping[str, TableFit], values: Mapping[str, NDArray[np.float64]],
          single: Mapping[str, NDArray[np.float64]]) -> RowFinding | None:
    """Return the row whose pulse width, a step or two away, at least halves the largest residual of two lines.

    One line alone would do so in a third of all tables without errors, and the lines without it must not show the row.
    """
    widths = table.of("pulse_width")
    step = generator_step(widths[0]) if widths else None
    if step is None:
        return None
    column = widths[0].name
    found: dict[tuple[int, int], dict[str, float]] = {}
    for name, fit in lines.items():
        row = int(np.argmin(single[name]))
        if not _uses(fit, column) or single[name][row] > _DOUBT:
            continue
        for steps in _STEPS:
            after = _changed(fit, column, row, _value(fit, column, row) + steps * step)
            if after < _HALVED * fit.line.max_residual:
                found.setdefault((row, steps), {})[name] = after
    alike = {key: by_line for key, by_line in found.items() if len(by_line) >= _LINES_ALIKE and not any(
        single[name][key[0]] < _DOUBT / table.rows for name, fit in lines.items() if not _uses(fit, column))}
    if not alike:
        return None
    row, steps = max(alike, key=lambda key: len(alike[key]))
    by_line = alike[row, steps]
    name = min(by_line, key=lambda key: by_line[key] / lines[key].line.max_residual)
    fit, single_p = lines[name], float(single[name][row])
    finding = RowFinding(
        row=row, label=table.label(row), line=name, residual=fit.line.residuals[row], t_value=float(values[name][row]),
        p_value=min(1.0, table.rows * len(lines) * single_p), certain=False, column=widths[0].symbol,
        better=_value(fit, column, row) + steps * step, steps=steps, largest=fit.line.max_residual,
        largest_after=by_line[name])
    return replace(finding, words=_hint_words(finding, fit, step, single_p, [key for key in by_line if key != name]))


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
