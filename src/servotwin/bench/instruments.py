"""Do two instruments that read one thing agree? Found from the columns of a bench table alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from servotwin.bench.table_columns import BenchTable, LineFit, TableColumn, TableFit
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
    wrong = tuple(name for name, p in (("zero", zero_p), ("gain", gain_p)) if p < LEVEL)
    restored = second.values / (gain or line.slope) if wrong and pair.is_converter else np.empty(0)
    return replace(
        _described(pair, same=True), expected_gain=gain, expected_from=origin, gain_p=gain_p, zero_p=zero_p,
        gain_error=pair.gain_error, zero_error=pair.zero_error, disagrees_in=wrong, restored=tuple(restored.tolist()),
        seen_from=float(stdtrit(pair.freedom, 1.0 - 0.5 * LEVEL / tests)) * pair.zero_error)


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
