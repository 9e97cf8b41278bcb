"""Calibration of a servo from a bench table: lines, parameters with errors, instruments and rows that do not fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from servotwin.bench.both_ways import both_ways
from servotwin.bench.fits import TableFit, table_fits
from servotwin.bench.instruments import InstrumentPair, instrument_pairs
from servotwin.bench.table_columns import BenchTable, bench_table
from servotwin.bench.table_parameters import estimates, with_measured
from servotwin.bench.table_rows import RowFinding, row_findings, smallest_p_value
from servotwin.bench.table_words import plus_minus, residual_pattern
from servotwin.parameters import Quantity, Servo

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
