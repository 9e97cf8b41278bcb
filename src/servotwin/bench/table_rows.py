"""Which rows of a bench table do not fit the lines through it, and what would be wrong with them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.bench.table_columns import (
    BenchTable,
    LineFit,
    TableColumn,
    TableFit,
    bench_table,
    design,
    fit_line,
    table_fits,
)
from servotwin.bench.table_parameters import estimates, plus_minus, residual_pattern, with_measured
from servotwin.parameters import Quantity, Servo

# --- Do two instruments that read one thing agree? Found from the columns of a bench table alone ----------------------

AGREEMENT_LEVEL = 0.005
"""Chance that a table of instruments that agree is said to disagree: shared among all tests on it (Bonferroni)."""

_REFERENCES = (1.024, 1.1, 1.2, 1.25, 1.5, 1.8, 2.048, 2.5, 2.56, 3.0, 3.3, 4.096, 4.5, 5.0, 5.12, 10.0)  # V
_BITS = (8, 10, 12, 14, 16, 18, 20, 24)
_TOLERANCE = 0.01  # of a reference voltage
_ALIKE = math.log2(1.08)  # gains nearer than this, powers of two apart, are meant to be the same
_QUANTA = 1.5  # of both columns together: how far a point may lie off the line of two readings of one thing
_SHARE = 0.005  # of the range, where the last place of a reading is finer than the instrument
_LEAST_ROWS = 4
_FINE = 50.0  # quanta in the range of an unknown column; a coarse one lies on every line


@dataclass(frozen=True, kw_only=True)
class InstrumentPair:
    """Two columns that read one thing: second = gain·first + zero.

    The gain is compared with that of the other converter of the bench or, where there is none like it, with a
    converter of 2^k counts over a usual reference; of two columns of one quantity it is compared with 1. The zero is
    compared with 0 (with −½ to 0 counts for a converter, which may cut off or round). Each is a two-sided t-test with
    n − 2 degrees of freedom; the variance is that of the residuals, and at least that of rounding to the last place.

    Parameters
    ----------
    first, second : str
        Symbols of the columns.
    line : LineFit
        Of the second over the first.
    unit, gain_unit : str
        Of the second, and of the gain.
    same : bool
        Whether the points lie on the line within the resolution of both; else they do not read one thing.
    expected_gain : float or None
        None where the gain cannot be known.
    expected_from : str
        Where that comes from.
    gain_error, zero_error : float
        One standard error, in `gain_unit` and `unit`.
    gain_p, zero_p : float
        P-values, times the number of tests on the table.
    disagrees_in : tuple of str
        Of "gain", "zero".
    seen_from : float
        The smallest error of the zero that this table would show, in `unit`.
    without : int or None
        The row, from 0, that is left out here, where only without it the two read one thing.
    restored : tuple of float
        Values of the first column by the counts of the second, where they disagree.
    """

    first: str
    second: str
    line: LineFit
    unit: str
    gain_unit: str
    same: bool
    expected_gain: float | None = None
    expected_from: str = ""
    gain_error: float = math.nan
    zero_error: float = math.nan
    gain_p: float = 1.0
    zero_p: float = 1.0
    disagrees_in: tuple[str, ...] = ()
    seen_from: float = math.nan
    without: int | None = None
    restored: tuple[float, ...] = ()

    @property
    def words(self) -> str:
        """The finding in words."""
        gain = plus_minus(self.line.slope, self.gain_error if self.same else self.line.slope_error)
        zero = plus_minus(abs(self.line.intercept), self.zero_error if self.same else self.line.intercept_error)
        sign = "−" if self.line.intercept < 0.0 else "+"
        left = "" if self.without is None else f" (without row {self.without + 1}, which is off)"
        slope = f"{gain} {self.gain_unit}".strip()
        told = f"{self.second} = {slope} {self.first} {sign} {zero} {self.unit}{left}"
        worst = f"{self.line.max_residual:.2g} {self.unit}"
        if not self.same:
            why = f"residuals up to {worst}" if self.line.slope > 0.0 else "one rises where the other falls"
            return f"{told}: {why}, so the two columns do not read one thing"
        if not self.disagrees_in:
            return f"{told}: affine within {worst}; {self._agreement()}"
        wrong = []
        if "zero" in self.disagrees_in:
            wrong.append(f"the zero is off by {abs(self.line.intercept / self.zero_error):.0f} standard errors "
                         f"(p = {self.zero_p:.1g})")
        if "gain" in self.disagrees_in and self.expected_gain is not None:
            share = self.line.slope / (self.expected_gain or math.nan) - 1.0
            excess = f"{100.0 * abs(share):.1f} % {'above' if share > 0.0 else 'below'}"
            wrong.append(f"the gain is {excess} that of {self.expected_from}, {self.expected_gain:.5g} "
                         f"(p = {self.gain_p:.1g})")
        values = ", ".join(f"{value:.3f}" for value in self.restored)
        return (f"{told}: affine within {worst}, but {' and '.join(wrong)}: the two instruments disagree in "
                f"{' and '.join(self.disagrees_in)}"
                + (f"; {self.first} from {self.second} would be {values}" if values else ""))

    def _agreement(self) -> str:
        gain = "nothing to compare its gain with" if self.expected_gain is None else (
            f"its gain agrees with that of {self.expected_from}, {self.expected_gain:.5g}"
            + ("" if self.gain_p >= 1.0 else f" (p = {self.gain_p:.2g})"))
        return (f"{gain}; its zero agrees with 0 (an error from {self.seen_from:.2g} {self.unit} on would have been "
                "seen)")


class _Pair(NamedTuple):
    fit: TableFit
    gain_error: float
    zero_error: float
    without: int | None = None

    @property
    def is_converter(self) -> bool:
        return (self.fit.x_column.unit, self.fit.unit) == ("V", "counts")

    @property
    def freedom(self) -> float:
        return self.fit.x.size - 2.0


class _Test(NamedTuple):
    difference: float
    error: float
    freedom: float


def instrument_pairs(table: BenchTable) -> tuple[InstrumentPair, ...]:
    """Return every pair of columns that reads one thing, and whether the two agree.

    Pairs are the readings of one side, command or feedback; further columns of one quantity (`feedback_voltage_2_V`);
    and a column of volts or counts of unknown name that lies on a line over a known one within both resolutions.

    Parameters
    ----------
    table : BenchTable

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench.table_columns import bench_table
    >>> command, feedback = instrument_pairs(bench_table(st.load_dataset("urrea-kern-table-2").columns))
    >>> command.disagrees_in, feedback.disagrees_in
    ((), ('zero', 'gain'))
    """
    measured = [_mended(_pair(a, b)) for a, b in _candidates(table)]
    pairs = [pair for pair in measured if _same(pair)]
    gains = _expected_gains(pairs)
    tests = len(pairs) + sum(gain is not None for _, gain, _ in gains)
    judged = iter([_judged(pair, gain, origin, test, tests)
                   for pair, (origin, gain, test) in zip(pairs, gains, strict=True)])
    return tuple(next(judged) if _same(pair) else _described(pair, same=False) for pair in measured)


def _candidates(table: BenchTable) -> list[tuple[TableColumn, TableColumn]]:
    found: list[tuple[TableColumn, TableColumn]] = []
    for quantity in ("output_angle", "pulse_width"):
        first, *more = table.of(quantity) or (None,)
        found += [(first, column) for column in more if first is not None]
    for side in ("command", "feedback"):
        readings = (*table.of(f"{side}_voltage"), *table.of(f"{side}_count"))
        found += [(readings[0], column) for column in readings[1:]]
    electrical = [column for column in table.columns if column.unit in ("V", "counts")]
    for other in table.others:
        pairs = [sorted((known, other), key=lambda c: c.unit == "counts") for known in electrical
                 if known.values.size == other.values.size]
        near = [fit for x, y in pairs if _fine(fit := TableFit(x, y))]
        if near:
            best = min(near, key=lambda fit: fit.line.max_residual / float(np.ptp(fit.y)))
            found.append((best.x_column, best.y_column))
    return found


def _pair(first: TableColumn, second: TableColumn) -> _Pair:
    fit = TableFit(first, second)
    x = fit.x
    spread = float(((x - x.mean()) ** 2).sum())
    variance = max(sum(r * r for r in fit.line.residuals) / (x.size - 2), fit.rounding)
    return _Pair(fit, math.sqrt(variance / spread), math.sqrt(variance * (1.0 / x.size + x.mean() ** 2 / spread)))


def _mended(pair: _Pair) -> _Pair:
    """Return the pair without one row, where it reads one thing only then; a slip of the pen is no disagreement."""
    n = pair.fit.x.size
    if _same(pair) or n < _LEAST_ROWS + 1:
        return pair
    both = pair.fit.x_column, pair.fit.y_column
    rest = [_pair(*(replace(column, values=np.delete(column.values, row)) for column in both)) for row in range(n)]
    row = min(range(n), key=lambda k: rest[k].fit.line.max_residual)
    return rest[row]._replace(without=row) if _same(rest[row]) else pair


def _quanta(fit: TableFit) -> float:
    return fit.y_column.resolution + abs(fit.line.slope) * fit.x_column.resolution


def _same(pair: _Pair) -> bool:
    line, allowed = pair.fit.line, max(_QUANTA * _quanta(pair.fit), _SHARE * float(np.ptp(pair.fit.y)))
    return line.slope > 0.0 and line.max_residual <= allowed


def _fine(fit: TableFit) -> bool:
    """Say whether the numbers alone show that two columns read one thing."""
    quanta = _quanta(fit)
    return (fit.line.slope > 0.0 and float(np.ptp(fit.y)) > _FINE * quanta > 0.0
            and fit.line.max_residual <= _QUANTA * quanta)


def _expected_gains(pairs: list[_Pair]) -> list[tuple[str, float | None, _Test | None]]:
    """Return for every pair where its gain is known from, that gain, and the difference to be tested."""
    converters = [pair for pair in pairs if pair.is_converter]
    # The one whose gain is nearest to a usual converter's is what the others are compared with.
    trusted = min(converters, key=lambda pair: abs(_misfit(pair)), default=None)
    found: list[tuple[str, float | None, _Test | None]] = []
    for pair in pairs:
        slope = pair.fit.line.slope
        if pair.is_converter and trusted is not None:
            found.append(_of_converter(pair, trusted, alone=len(converters) == 1))
        elif pair.fit.x_column.unit == "counts":
            gain = 2.0 ** round(math.log2(slope))
            test = _Test(slope - gain, pair.gain_error, pair.freedom)
            found.append(("a power of two", gain, test) if _alike(slope, gain) else ("", None, None))
        else:
            found.append(("one scale", 1.0, _Test(slope - 1.0, pair.gain_error, pair.freedom)))
    return found


def _alike(slope: float, gain: float) -> bool:
    return abs(math.log2(slope / gain)) < _ALIKE


def _of_converter(pair: _Pair, trusted: _Pair, *, alone: bool) -> tuple[str, float | None, _Test | None]:
    slope = pair.fit.line.slope
    if pair is not trusted:
        times = 2.0 ** round(math.log2(slope / trusted.fit.line.slope))
        gain = trusted.fit.line.slope * times
        if _alike(slope, gain):
            a, b = pair.gain_error**2, (trusted.gain_error * times) ** 2
            # Welch and Satterthwaite: two variances, each with its own freedom
            parts = a**2 / pair.freedom + b**2 / trusted.freedom
            both = (a + b) ** 2 / parts if parts > 0.0 else pair.freedom
            symbol = trusted.fit.y_column.symbol
            return (symbol if times == 1.0 else f"{times:g} times {symbol}", gain,
                    _Test(slope - gain, math.sqrt(a + b), both))
    nominal = _nominal(pair)
    if nominal is None:
        return "", None, None
    bits, reference = nominal
    gain = 2.0**bits / reference
    beyond = max(abs(slope - gain) - _TOLERANCE * gain, 0.0)
    if not alone and pair is trusted and beyond > 0.0:
        return "", None, None  # of an unusual reference; the others are compared with this one
    return (f"{2**bits} counts over {reference:g} V", gain,
            _Test(math.copysign(beyond, slope - gain), pair.gain_error, pair.freedom))


def _nominal(pair: _Pair) -> tuple[int, float] | None:
    """Return bits and reference of the usual converter whose gain is nearest."""
    top = float(pair.fit.y.max())
    bits = next((bits for bits in _BITS if 2.0**bits > top), None)
    if bits is None:
        return None
    return bits, min(_REFERENCES, key=lambda volts: abs(math.log(2.0**bits / volts / pair.fit.line.slope)))


def _misfit(pair: _Pair) -> float:
    nominal = _nominal(pair)
    return math.inf if nominal is None else math.log(pair.fit.line.slope * nominal[1] / 2.0 ** nominal[0])


def _judged(pair: _Pair, gain: float | None, origin: str, test: _Test | None, tests: int) -> InstrumentPair:
    from scipy.special import stdtrit

    line, second = pair.fit.line, pair.fit.y_column
    low = -0.5 * second.resolution if pair.is_converter else 0.0
    off = max(line.intercept, 0.0) + min(line.intercept - low, 0.0)
    zero_p = min(tests * _p_value(_Test(off, pair.zero_error, pair.freedom)), 1.0)
    gain_p = 1.0 if test is None else min(tests * _p_value(test), 1.0)
    wrong = tuple(name for name, p in (("zero", zero_p), ("gain", gain_p)) if p < AGREEMENT_LEVEL)
    restored = second.values / (gain or line.slope) if wrong and pair.is_converter else np.empty(0)
    return replace(
        _described(pair, same=True), expected_gain=gain, expected_from=origin, gain_p=gain_p, zero_p=zero_p,
        gain_error=pair.gain_error, zero_error=pair.zero_error, disagrees_in=wrong, restored=tuple(restored.tolist()),
        seen_from=float(stdtrit(pair.freedom, 1.0 - 0.5 * AGREEMENT_LEVEL / tests)) * pair.zero_error)


def _described(pair: _Pair, *, same: bool) -> InstrumentPair:
    first, second = pair.fit.x_column, pair.fit.y_column
    return InstrumentPair(first=first.symbol, second=second.symbol, line=pair.fit.line, unit=second.unit, same=same,
                          gain_unit="" if second.unit == first.unit else f"{second.unit}/{first.unit}",
                          without=pair.without)


def _p_value(test: _Test) -> float:
    from scipy.special import stdtr

    if test.error == 0.0:
        return 1.0 if test.difference == 0.0 else 0.0
    return 2.0 * float(stdtr(test.freedom, -abs(test.difference) / test.error))


# --- Which rows of a bench table do not fit the lines through it, and what would be wrong with them -------------------

ROW_LEVEL = 0.05
"""Chance that a row of a table without errors is said to fit badly: shared among all rows and lines (Bonferroni)."""
_DOUBT = 0.1  # p-value of one residual from which on a step of the generator is thought of
_STEPS = (1, -1, 2, -2)
_LEAST_STEP = 4.0  # of the resolution of t_a: whole numbers have a smaller common divisor by chance
_MOST_STEP = 64.0  # µs: beyond it pulses were set to round numbers
_HALVED = 0.5  # of the largest residual: what a step has to bring it to
_LINES_ALIKE = 2  # that the same step has to help
_MILLI = 0.1  # V: smaller residuals are printed in mV


@dataclass(frozen=True, kw_only=True)
class RowFinding:
    """A row that lies off a line through all others, by a t-test of its leave-one-out residual.

    Parameters
    ----------
    row : int
        From 0.
    label : str
        Name of the row in messages.
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

# --- A table that was read on the way up and on the way down: hysteresis, distinguished from noise --------------------

LEVEL = 0.05
"""Chance that a table without hysteresis is said to have one: shared among its lines."""


def both_ways(lines: Mapping[str, TableFit], servo: Servo) -> Iterator[str]:
    """Yield what a table that was read both ways says of hysteresis; nothing for one that was read one way.

    Parameters
    ----------
    lines : mapping of str to TableFit
    servo : Servo
        Its deadband is set beside the hysteresis of angle over pulse, where it gives one.
    """
    told = {name: fit for name, fit in lines.items() if fit.ways is not None and "q" in (
        fit.x_column.symbol, fit.y_column.symbol)}
    for name, fit in told.items():
        line = fit.line
        size, half = abs(line.hysteresis), line.wide(line.hysteresis_error)
        noise = math.sqrt(sum(r * r for r in line.residuals) / line.freedom)
        if line.hysteresis_p * len(told) < LEVEL:
            yield (f"{name} differs by {plus_minus(size, line.hysteresis_error)} {fit.unit} between the way up and the "
                   f"way down, {size - half:.3g} to {size + half:.3g} {fit.unit}: hysteresis, p = "
                   f"{line.hysteresis_p:.1g}; the noise beside it is {noise:.2g} {fit.unit}, and the line runs "
                   "between both ways" + _behind(name, line, servo))
        else:
            yield (f"{name} shows no hysteresis: both ways differ by {size:.2g} {fit.unit}, which noise of "
                   f"{noise:.2g} {fit.unit} does by itself (p = {line.hysteresis_p:.2g}); it is less than "
                   f"{size + half:.2g} {fit.unit}")


def _behind(name: str, line: LineFit, servo: Servo) -> str:
    """Return what a hysteresis of angle over pulse is made of: a dial cannot tell which."""
    if name != "q(t_a)":
        return ""
    width = servo.electronics.deadband
    known = "" if width is None else (f"; the deadband of the servo, {1e6 * width:.3g} µs, is worth "
                                      f"{abs(line.slope) * 1e6 * width:.2g} ° of it at most")
    return (f"{known}. Play of the gear, deadband and friction make it together and a dial cannot tell them apart: no "
            "parameter is set; push the horn by hand both ways for the play, and step the pulse by 1 µs for the "
            "deadband")


def ways_facts(fit: TableFit) -> dict[str, float] | None:
    """Return the hysteresis of a line as plain data, None where the table was read one way."""
    if fit.ways is None:
        return None
    line = fit.line
    half = line.wide(line.hysteresis_error)
    return {"value": line.hysteresis, "std": line.hysteresis_error, "lower": line.hysteresis - half,
            "upper": line.hysteresis + half, "p": line.hysteresis_p,
            "noise": float(np.sqrt(np.sum(np.square(line.residuals)) / line.freedom))}

# --- Calibration of a servo from a bench table ------------------------------------------------------------------------

CURVED = 0.05
"""P-value of the F-test of a parabola below which a line counts as visibly curved."""
_ROUNDING = 1e-9  # of the ordinate: numbers without noise bend by less
_MOVED = 0.01  # of pulse_to_voltage_gain: from here on what was computed with the old one is named


@dataclass(frozen=True, kw_only=True, eq=False)
class TableCalibration:
    """A servo by a bench table.

    Parameters
    ----------
    source : str
        Where the table was read.
    table : BenchTable
        Its columns, and the names that were ignored.
    lines : mapping of str to TableFit
        Every straight line that the columns allow, in °, µs, V and counts, by name such as ``"V_o(q)"``.
    parameters : mapping of str to Quantity
        Numbers of the servo that follow, by dotted name, in SI; `std` is one standard error.
    instruments : tuple of InstrumentPair
        Columns that read one thing, and whether they agree.
    rows : tuple of RowFinding
        Rows that fit badly, or would fit with a step more of the generator.
    remarks : tuple of str
        Further remarks on the table.
    servo : Servo
        The given one with `parameters` in place; one that holds nothing else where none was given.
    """

    source: str
    table: BenchTable = field(repr=False)
    lines: Mapping[str, TableFit] = field(repr=False)
    parameters: Mapping[str, Quantity] = field(repr=False)
    instruments: tuple[InstrumentPair, ...] = field(repr=False)
    rows: tuple[RowFinding, ...] = field(repr=False)
    remarks: tuple[str, ...] = field(repr=False)
    servo: Servo = field(repr=False)

    @property
    def disagreements(self) -> tuple[InstrumentPair, ...]:
        """The instruments that disagree in gain or zero."""
        return tuple(pair for pair in self.instruments if pair.disagrees_in)

    @property
    def curved(self) -> tuple[str, ...]:
        """Names of the lines that are visibly curved."""
        return tuple(name for name, fit in self.lines.items() if fit.curvature.p_value < CURVED
                     and fit.curvature.sagitta > _ROUNDING * np.abs(fit.y).max())

    def findings(self) -> tuple[str, ...]:
        """Return all that is worth a sentence: curvature, instruments, rows, remarks."""
        return (*both_ways(self.lines, self.servo),
                *(_curvature(fit, len(self.lines)) for name, fit in self.lines.items() if name in self.curved),
                *(pair.words for pair in self.instruments), *(row.words for row in self.rows), *self.remarks)


def calibrate_table(table: str | Path | Mapping[str, ArrayLike], servo: Servo | None = None, *,
                    source: str | None = None) -> TableCalibration:
    """Return what a bench table says about pulse, potentiometer and the instruments that read them.

    Columns are `output_angle_deg`, `pulse_width_us`, `command_voltage_V`, `command_count`, `feedback_voltage_V`,
    `feedback_count`, `pulse_rate_Hz` (or in SI without a unit), or those of the paper's Table II: q_deg, t_a_us, V_i_V,
    ADC_i, V_o_V, ADC_o, f_Hz. At least two of them; a second instrument is `feedback_voltage_2_V`.

    Parameters
    ----------
    table : str, Path or mapping
        A CSV file, or columns of equal length by name; at least 4 rows.
    servo : Servo, optional
        Takes the values. Its potentiometer is read where the table has no feedback voltage.
    source : str, optional
        Where the table comes from; the path unless given.

    Raises
    ------
    InputError
        If the table cannot be read, a column is not usable, or a line falls that must rise.

    Examples
    --------
    >>> import servotwin as st
    >>> found = calibrate_table(st.load_dataset("urrea-kern-table-2").columns, source="Table II")
    >>> p = found.parameters["potentiometer.feedback_gain"]
    >>> f"{p.value:.4f} ± {p.std:.4f} {p.unit}", found.curved, [pair.second for pair in found.disagreements]
    ('0.4197 ± 0.0023 V/rad', ('q(t_a)',), ['ADC_o'])
    """
    read = bench_table(table, source=source)
    lines = table_fits(read)
    found = {name: one.quantity(name, read.source) for name, one in estimates(lines, servo).items()}
    instruments, rows = instrument_pairs(read), row_findings(read, lines)
    return TableCalibration(
        source=read.source, table=read, lines=lines, parameters=found, instruments=instruments, rows=rows,
        servo=with_measured(servo or Servo(name="bench-table"), found),
        remarks=tuple(_remarks(read, lines, found, instruments, rows, servo)))


def _curvature(fit: TableFit, lines: int) -> str:
    test = fit.curvature
    return (f"{fit.name} is visibly curved: a parabola fits better with p = {test.p_value:.2g} (of {lines} straight "
            f"lines {CURVED * lines:.1g} would look so by chance) and bends by {test.sagitta:.2g} {fit.unit}; "
            f"{residual_pattern(fit.x.tolist(), fit.line.residuals)}")


def _remarks(table: BenchTable, lines: Mapping[str, TableFit], found: Mapping[str, Quantity],
             instruments: tuple[InstrumentPair, ...], rows: tuple[RowFinding, ...], servo: Servo | None) -> list[str]:
    remarks = ["rows that fit badly are left in all lines" if any(row.certain for row in rows) else
               f"no row is certain to fit badly: the worst has p = {smallest_p_value(lines):.2g} for all rows and "
               "lines", *_by_counts(lines, instruments), *_turned(table, lines)]
    if (rates := table.first("pulse_rate")) is not None:
        rate = float(np.mean(rates.values))
        remarks.append(f"the pulses came at {rate:.5g} Hz, a frame of {1e3 / rate:.3g} ms; that belongs to the "
                       "transmitter, so the servo's frame_period stays")
    if "electronics.one_shot_slope" not in found and "q(t_a)" in lines:
        line = lines["q(t_a)"].line
        remarks.append(f"the pulse turns {plus_minus(line.slope, line.slope_error)} °/µs; one_shot_slope needs the "
                       "feedback voltage too, or a servo with feedback_gain and feedback_offset")
    if not found:
        remarks.append("no parameter of a servo follows from these columns alone")
    remarks += _left_behind(found, servo)
    if table.ignored:
        remarks.append("not used, for their names are unknown: " + ", ".join(table.ignored))
    return remarks


def _turned(table: BenchTable, lines: Mapping[str, TableFit]) -> list[str]:
    """Name the rows at turning points that are of the other way than their order says."""
    ways = next(iter(lines.values())).ways
    if ways is None or table.ways is None:
        return []
    return [f"{table.label(row)}, where the ways turn, counts as read on the way "
            f"{'down' if ways[row] > 0.0 else 'up'}: it lies on the line of that way"
            for row in np.flatnonzero(ways != table.ways).tolist()]


def _by_counts(lines: Mapping[str, TableFit], instruments: tuple[InstrumentPair, ...]) -> list[str]:
    """Return what the potentiometer would be by the counts, where they disagree with the voltmeter."""
    pair = next((one for one in instruments if (one.first, one.second) == ("V_o", "ADC_o") and one.disagrees_in), None)
    if pair is None or pair.expected_gain is None or "V_o(q)" not in lines:
        return []
    line = lines["V_o(q)"].line
    gain = np.degrees(line.slope * pair.line.slope / pair.expected_gain)
    offset = pair.line(line.intercept) / pair.expected_gain
    return [f"the parameters are those of the voltages; by the counts feedback_gain would be {gain:.4f} V/rad instead "
            f"of {np.degrees(line.slope):.4f}, and feedback_offset {offset:.4f} V instead of {line.intercept:.4f}"]


def _left_behind(found: Mapping[str, Quantity], servo: Servo | None) -> list[str]:
    """Name what was computed with another pulse_to_voltage_gain and stays as it is."""
    name = "electronics.pulse_to_voltage_gain"
    before = None if servo is None else servo.get(name)
    if servo is None or name not in found or not isinstance(before, float):
        return []
    change = float(found[name].value) / before - 1.0  # type: ignore[arg-type]
    stale = [key for key in ("electronics.voltage_deadband", "electronics.bridge_gain") if servo.get(key) is not None]
    if abs(change) < _MOVED or not stale:
        return []
    return [f"pulse_to_voltage_gain changed by {100.0 * change:+.1f} %; {' and '.join(stale)}, which go with it, "
            "stay as they are"]
