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

from servotwin.bench.instruments import InstrumentPair, instrument_pairs
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
from servotwin.bench.table_parameters import estimates, with_measured
from servotwin.bench.table_words import plus_minus, residual_pattern
from servotwin.parameters import Quantity, Servo

# --- Which rows of a bench table do not fit the lines through it, and what would be wrong with them -------------------

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

# --- A table that was read on the way up and on the way down: hysteresis, told apart from noise -----------------------

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
    """What a bench table says about a servo.

    Parameters
    ----------
    source : str
        Where the table was read.
    table : BenchTable
        Its columns, and the names that were ignored.
    lines : mapping of str to TableFit
        Every straight line that the columns allow, in °, µs, V and counts, by name such as ``"V_o(q)"``.
    parameters : mapping of str to Quantity
        What follows for the servo, by dotted name, in SI; `std` is one standard error.
    instruments : tuple of InstrumentPair
        Columns that read one thing, and whether they agree.
    rows : tuple of RowFinding
        Rows that fit badly, or would fit with a step more of the generator.
    remarks : tuple of str
        What else is to be known.
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
