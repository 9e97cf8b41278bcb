"""Do two instruments that read one thing agree? Found from the columns of a bench table alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from servotwin.bench.fits import LineFit, fit_line
from servotwin.bench.table_columns import BenchTable, TableColumn
from servotwin.bench.table_words import plus_minus

LEVEL = 0.005
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
        What the first column would be by the counts of the second, where they disagree.
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
            wrong.append(f"the gain is {self._excess()} that of {self.expected_from}, {self.expected_gain:.5g} "
                         f"(p = {self.gain_p:.1g})")
        values = ", ".join(f"{value:.3f}" for value in self.restored)
        return (f"{told}: affine within {worst}, but {' and '.join(wrong)}: the two instruments disagree in "
                f"{' and '.join(self.disagrees_in)}"
                + (f"; {self.first} from {self.second} would be {values}" if values else ""))

    def _excess(self) -> str:
        share = self.line.slope / (self.expected_gain or math.nan) - 1.0
        return f"{100.0 * abs(share):.1f} % {'above' if share > 0.0 else 'below'}"

    def _agreement(self) -> str:
        gain = "nothing to compare its gain with" if self.expected_gain is None else (
            f"its gain agrees with that of {self.expected_from}, {self.expected_gain:.5g}"
            + ("" if self.gain_p >= 1.0 else f" (p = {self.gain_p:.2g})"))
        return (f"{gain}; its zero agrees with 0 (an error from {self.seen_from:.2g} {self.unit} on would have been "
                "seen)")


class _Pair(NamedTuple):
    first: TableColumn
    second: TableColumn
    line: LineFit
    spread: float  # of a point, at least that of rounding
    gain_error: float
    zero_error: float
    without: int | None = None


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
        near = [pair for known in electrical if known.values.size == other.values.size
                and _fine(pair := _pair(*sorted((known, other), key=lambda c: c.unit == "counts")))]
        if near:
            best = min(near, key=lambda pair: pair.line.max_residual / float(np.ptp(pair.second.values)))
            found.append((best.first, best.second))
    return found


def _pair(first: TableColumn, second: TableColumn) -> _Pair:
    line = fit_line(first.values, second.values)
    rounding = (second.resolution**2 + (line.slope * first.resolution) ** 2) / 12.0
    variance = sum(r * r for r in line.residuals) / (first.values.size - 2)
    # At least the rounding: a few points may lie on a line by chance.
    ratio = math.sqrt(max(rounding / variance, 1.0)) if variance > 0.0 else math.nan
    if math.isnan(ratio):
        x = first.values
        spread = float(((x - x.mean()) ** 2).sum())
        slope = math.sqrt(rounding / spread)
        return _Pair(first, second, line, math.sqrt(rounding), slope,
                     math.sqrt(rounding / x.size + (slope * float(x.mean())) ** 2))
    return _Pair(first, second, line, math.sqrt(variance) * ratio, line.slope_error * ratio,
                 line.intercept_error * ratio)


def _mended(pair: _Pair) -> _Pair:
    """Return the pair without one row, where it reads one thing only then; a slip of the pen is no disagreement."""
    n = pair.first.values.size
    if _same(pair) or n < _LEAST_ROWS + 1:
        return pair
    rest = [_pair(*(replace(column, values=np.delete(column.values, row)) for column in (pair.first, pair.second)))
            for row in range(n)]
    row = min(range(n), key=lambda k: rest[k].line.max_residual)
    return rest[row]._replace(without=row) if _same(rest[row]) else pair


def _quanta(pair: _Pair) -> float:
    return pair.second.resolution + abs(pair.line.slope) * pair.first.resolution


def _same(pair: _Pair) -> bool:
    allowed = max(_QUANTA * _quanta(pair), _SHARE * float(np.ptp(pair.second.values)))
    return pair.line.slope > 0.0 and pair.line.max_residual <= allowed


def _fine(pair: _Pair) -> bool:
    """Say whether the numbers alone show that two columns read one thing."""
    quanta, span = _quanta(pair), float(np.ptp(pair.second.values))
    return (pair.line.slope > 0.0 and span > _FINE * quanta > 0.0
            and pair.line.max_residual <= _QUANTA * quanta)


def _is_converter(pair: _Pair) -> bool:
    return pair.second.unit == "counts" and pair.first.unit == "V"


def _expected_gains(pairs: list[_Pair]) -> list[tuple[str, float | None, _Test | None]]:
    """Return for every pair where its gain is known from, that gain, and the difference to be tested."""
    converters = [pair for pair in pairs if _is_converter(pair)]
    # The one whose gain is nearest to a usual converter's is what the others are compared with.
    trusted = min(converters, key=lambda pair: abs(_misfit(pair)), default=None)
    found: list[tuple[str, float | None, _Test | None]] = []
    for pair in pairs:
        freedom = pair.first.values.size - 2.0
        if _is_converter(pair) and trusted is not None:
            found.append(_of_converter(pair, trusted, alone=len(converters) == 1))
        elif pair.first.unit == "counts":
            gain = 2.0 ** round(math.log2(pair.line.slope))
            alike = abs(math.log2(pair.line.slope / gain)) < _ALIKE
            test = _Test(pair.line.slope - gain, pair.gain_error, freedom)
            found.append(("a power of two", gain, test) if alike else ("", None, None))
        else:
            found.append(("one scale", 1.0, _Test(pair.line.slope - 1.0, pair.gain_error, freedom)))
    return found


def _of_converter(pair: _Pair, trusted: _Pair, *, alone: bool) -> tuple[str, float | None, _Test | None]:
    freedom = pair.first.values.size - 2.0
    if pair is not trusted:
        steps = round(math.log2(pair.line.slope / trusted.line.slope))
        gain = trusted.line.slope * 2.0**steps
        if abs(math.log2(pair.line.slope / gain)) < _ALIKE:
            other = trusted.gain_error * 2.0**steps
            a, b = pair.gain_error**2, other**2
            # Welch and Satterthwaite: two variances, each with its own freedom
            parts = a**2 / freedom + b**2 / (trusted.first.values.size - 2.0)
            both = (a + b) ** 2 / parts if parts > 0.0 else freedom
            name = trusted.second.symbol if steps == 0 else f"{2.0**steps:g} times {trusted.second.symbol}"
            return name, gain, _Test(pair.line.slope - gain, math.sqrt(a + b), both)
    nominal = _nominal(pair)
    if nominal is None:
        return "", None, None
    bits, reference = nominal
    gain = 2.0**bits / reference
    difference = pair.line.slope - gain
    beyond = max(abs(difference) - _TOLERANCE * gain, 0.0)
    name = f"{2**bits} counts over {reference:g} V"
    if not alone and pair is trusted and beyond > 0.0:
        return "", None, None  # of an unusual reference; the others are compared with this one
    return name, gain, _Test(math.copysign(beyond, difference), pair.gain_error, freedom)


def _nominal(pair: _Pair) -> tuple[int, float] | None:
    """Return bits and reference of the usual converter whose gain is nearest."""
    top = float(pair.second.values.max())
    bits = next((bits for bits in _BITS if 2.0**bits > top), None)
    if bits is None:
        return None
    reference = min(_REFERENCES, key=lambda volts: abs(math.log(2.0**bits / volts / pair.line.slope)))
    return bits, reference


def _misfit(pair: _Pair) -> float:
    nominal = _nominal(pair)
    return math.inf if nominal is None else math.log(pair.line.slope * nominal[1] / 2.0 ** nominal[0])


def _judged(pair: _Pair, gain: float | None, origin: str, test: _Test | None, tests: int) -> InstrumentPair:
    from scipy.special import stdtrit

    n = pair.first.values.size
    low = -0.5 * pair.second.resolution if _is_converter(pair) else 0.0
    zero = pair.line.intercept
    off = max(zero, 0.0) + min(zero - low, 0.0)
    zero_p = min(tests * _p_value(_Test(off, pair.zero_error, n - 2.0)), 1.0)
    gain_p = 1.0 if test is None else min(tests * _p_value(test), 1.0)
    wrong = tuple(name for name, p in (("zero", zero_p), ("gain", gain_p)) if p < LEVEL)
    scale = gain or pair.line.slope
    restored = tuple((pair.second.values / scale).tolist()) if wrong and _is_converter(pair) else ()
    least = float(stdtrit(n - 2.0, 1.0 - 0.5 * LEVEL / tests)) * pair.zero_error
    return replace(
        _described(pair, same=True), expected_gain=gain, expected_from=origin, gain_p=gain_p, zero_p=zero_p,
        gain_error=pair.gain_error, zero_error=pair.zero_error, disagrees_in=wrong,
        seen_from=least, restored=restored)


def _described(pair: _Pair, *, same: bool) -> InstrumentPair:
    unit = pair.second.unit
    return InstrumentPair(first=pair.first.symbol, second=pair.second.symbol, line=pair.line, unit=unit,
                          gain_unit="" if unit == pair.first.unit else f"{unit}/{pair.first.unit}", same=same,
                          without=pair.without)


def _p_value(test: _Test) -> float:
    from scipy.special import stdtr

    if test.error == 0.0:
        return 1.0 if test.difference == 0.0 else 0.0
    return 2.0 * float(stdtr(test.freedom, -abs(test.difference) / test.error))
