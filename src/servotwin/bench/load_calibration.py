"""A servo from a table of loads, currents, speeds, sags or voltages, as they are measured at home."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from numpy.typing import ArrayLike

from servotwin.bench.fits import fit_line
from servotwin.bench.load_columns import LoadTable, load_table
from servotwin.bench.load_figures import LoadFigure, SheetShare, figures_of, shares_of
from servotwin.bench.load_lines import SAG, LoadLine, LoadLines, load_lines
from servotwin.bench.load_parameters import Circuit, Solved, circuit_of, estimates_of, solved
from servotwin.bench.load_words import line_words, sheet_words, supply_words, told_words
from servotwin.bench.table_parameters import Estimate, with_measured
from servotwin.parameters import Quantity, Servo

_SUPPLY, _SOURCE = "supply.open_circuit_voltage", "supply.internal_resistance"


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCalibration:
    """What a table of loads says about a servo.

    Parameters
    ----------
    source : str
    table : LoadTable
    lines : LoadLines
    figures : tuple of LoadFigure
        No-load current and speed, torque per current, stall torque, sag per torque and so on, with intervals.
    shares : tuple of SheetShare
        What is measured over what the servo's sheet prints.
    parameters : mapping of str to Quantity
        What follows for the servo, by dotted name, in SI; `std` is one standard error.
    servo : Servo
        The given one with `parameters` in place; an empty one where none was given.
    words : tuple of str
    """

    source: str
    table: LoadTable = field(repr=False)
    lines: LoadLines = field(repr=False)
    figures: tuple[LoadFigure, ...] = field(repr=False)
    shares: tuple[SheetShare, ...] = field(repr=False)
    parameters: Mapping[str, Quantity] = field(repr=False)
    servo: Servo = field(repr=False)
    words: tuple[str, ...] = field(repr=False)

    def findings(self) -> tuple[str, ...]:
        """Return all that is worth a sentence: the sheet, what is told and what not, the supply, curvature."""
        return self.words

    def figure(self, name: str) -> LoadFigure:
        """Return a figure by its name, such as "stall torque"."""
        return next(one for one in self.figures if one.name == name)


def calibrate_loads(table: str | Path | LoadTable | Mapping[str, ArrayLike], servo: Servo | None = None, *,
                    arm: float | None = None, source: str | None = None) -> LoadCalibration:
    """Return what a table of loads and currents, speeds or sags, or of voltages and speeds, says about a servo.

    Parameters
    ----------
    table : str, Path, LoadTable or mapping
        As `load_table` reads it; at least 3 rows.
    servo : Servo, optional
        Takes the values; its sheet, supply and what the table cannot tell are read.
    arm : float, optional
        On which the weights hung [m].
    source : str, optional
        Where the table comes from; the path unless given.

    Raises
    ------
    InputError
        If the table cannot be read, a column is not usable, or a line falls that must rise.

    Examples
    --------
    >>> import servotwin as st
    >>> found = calibrate_loads({"mass_g": [100, 200, 320, 400, 450], "current_mA": [230, 300, 370, 405, 450]},
    ...                         st.load_servo("towerpro-mg90s"), arm=0.01)
    >>> figure = found.figure("torque per current")
    >>> f"{figure.value:.4f} ({figure.lower:.3f} to {figure.upper:.3f}) {figure.unit}"
    '0.1625 (0.142 to 0.190) N m/A'
    """
    read = table if isinstance(table, LoadTable) else load_table(table, arm=arm, source=source)
    found = load_lines(read)
    figures = figures_of(read, found)
    shares = shares_of(figures, servo)
    made: dict[str, Estimate] = {}
    notes: list[str] = []
    numbers, circuit = None, None
    if servo is not None:
        made, told = _supply(read, servo)
        servo = with_measured(servo, {name: one.quantity(name, read.source) for name, one in made.items()})
        circuit = circuit_of(servo)
        numbers = None if circuit is None else solved(found, servo, circuit)
        notes += told
        if numbers is not None and circuit is not None:
            more, why = estimates_of(numbers, servo, circuit)
            made |= more
            notes += why
        if SAG in found.lines:
            notes += _stiffness(servo, found.lines[SAG], made)
    said = servo is not None and servo.supply.open_circuit_voltage is not None and (
        _SUPPLY in made or servo.source(_SUPPLY).was_set)
    words = [*sheet_words(shares, found, servo.supply.open_circuit_voltage if servo is not None and said else None),
             *_words(read, found, shares, numbers, circuit, notes, given=servo is not None)]
    parameters = {name: one.quantity(name, read.source) for name, one in made.items()}
    return LoadCalibration(source=read.source, table=read, lines=found, figures=figures, shares=shares,
                           parameters=parameters, words=tuple(words),
                           servo=with_measured(servo or Servo(name="bench-table"), parameters))


def _stiffness(servo: Servo, sag: LoadLine, made: dict[str, Estimate]) -> list[str]:
    from servotwin.bench.load_stiffness import gain_of_sag

    gain = gain_of_sag(servo, sag)
    if isinstance(gain, str):
        return [gain]
    made[gain[0]] = gain[1]
    return []


def _supply(table: LoadTable, servo: Servo) -> tuple[dict[str, Estimate], list[str]]:
    """Return the voltage of the supply, where a table of loads has it, and its resistance, where it falls."""
    if table.torque is None or table.voltage is None:
        return {}, []
    volts = table.voltage.values
    fallen = float(volts.max() - volts.min())
    if table.current is not None and fallen > table.voltage.step:
        line = fit_line(table.current.values, volts, least_variance=table.voltage.step**2 / 12.0)
        if line.slope < 0.0 and line.wide(line.slope_error) < -line.slope:
            return ({_SUPPLY: Estimate(line.intercept, line.intercept_error, "supply voltage over current, at 0 A"),
                     _SOURCE: Estimate(-line.slope, line.slope_error, "supply voltage over current")},
                    [f"the supply falls by {fallen:.3g} V under load: it has {-line.slope:.3g} ohm"])
    error = max(float(volts.std()), table.voltage.step) / math.sqrt(volts.size)
    told = [] if fallen <= 0.02 * float(volts.mean()) else [
        f"the supply voltage varies by {fallen:.3g} V, and its mean is used: without a current what it loses counts as "
        "resistance of the motor"]
    return {_SUPPLY: Estimate(float(volts.mean()), error, "mean supply voltage")}, told


def _words(table: LoadTable, found: LoadLines, shares: tuple[SheetShare, ...], numbers: Solved | None,
           circuit: Circuit | None, notes: list[str], *, given: bool) -> list[str]:
    words = [*told_words(found, numbers, circuit),
             *supply_words(table, found, shares, circuit), *notes, *line_words(found), *table.remarks]
    if not given:
        words.append("no parameter is set: give the servo that takes them by --servo")
    elif circuit is None:
        words.append("no parameter of the motor is set: the servo lacks motor, gear or supply")
    words.append("intervals are those of the scatter about the lines: what scale, multimeter and arm are off by in "
                 "common is not in them")
    if table.ignored:
        words.append("not used, for their names are unknown: " + ", ".join(table.ignored))
    return words
