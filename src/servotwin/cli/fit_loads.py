"""What a table of weights with currents, speeds or sags says of a servo, in words and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.cli.terminal import pairs, show, table

if TYPE_CHECKING:
    from servotwin.bench import LoadCalibration
    from servotwin.bench.lift_records import LiftRecord
    from servotwin.parameters import Servo


def calibrate_of_loads(path: Path, servo: Servo | None, arm: str | None, columns: Sequence[str]
                       ) -> tuple[LoadCalibration, tuple[LiftRecord, ...]]:
    """Return what a table, or the records that a pattern names, say of a servo.

    Raises
    ------
    InputError
        If table, record or arm is not usable.
    """
    from servotwin.bench import calibrate_loads, is_pattern, lifts
    from servotwin.bench.lift_records import length_of
    from servotwin.errors import InputError

    length = length_of(arm)
    if not is_pattern(path):
        if columns:
            raise InputError("--columns", got="a table of loads", allowed="units in the names of its columns, such as "
                             "mass_g")
        return calibrate_loads(path, servo, arm=length), ()
    found = lifts(path, columns=" ".join(columns) or None, arm=length)
    return calibrate_loads(found.table, servo), found.records


def show_loads(found: LoadCalibration, records: Sequence[LiftRecord], out: Path | None) -> None:
    """Show figures with their intervals, what is set of the servo, and all that is worth a sentence."""
    from servotwin.bench.load_calibration import figure_words, record_words
    from servotwin.cli.fit_table import parameter_table

    names = ", ".join(column.name for column in found.table.columns)
    parts: list[Any] = [f"{found.source}: {found.table.rows} rows, {names}", ""]
    if records:
        parts += [table(("file", "load", "speed", "current", "dead time"), [record_words(one) for one in records]), ""]
    parts += [table(("", "value", "95 %", "unit", "line"), [figure_words(one) for one in found.figures]), ""]
    if found.parameters:
        parts += [parameter_table(found.parameters), ""]
    parts += [f"- {text}" for text in found.findings()]
    if out is not None:
        parts += ["", pairs([("written", str(out))])]
    show(*parts)


def load_facts(found: LoadCalibration, records: Sequence[LiftRecord] = (), out: Path | None = None) -> dict[str, Any]:
    """Return the same as plain data for JSON, in SI.

    Examples
    --------
    >>> from servotwin.bench import calibrate_loads
    >>> facts = load_facts(calibrate_loads({"torque_Nm": [0.1, 0.2, 0.3], "current_mA": [300, 401, 499]}))
    >>> list(facts["figures"])
    ['no-load current', 'current per torque', 'torque per current', 'heaviest load']
    """
    lines = {name: (one, one.line) for name, one in found.lines.lines.items()}
    flat = found.lines.flat
    return {
        "source": found.source, "servo": found.servo.name, "rows": found.table.rows,
        "columns": [column.name for column in found.table.columns], "ignored_columns": list(found.table.ignored),
        "arm": found.table.arm,
        "figures": {one.name: {"value": one.value, "std": one.error, "lower": one.lower, "upper": one.upper,
                               "unit": one.unit, "line": one.line} for one in found.figures},
        "lines": {name: {
            "abscissa": one.x.name, "ordinate": one.y.name, "slope": line.slope, "slope_error": line.slope_error,
            "intercept": line.intercept, "intercept_error": line.intercept_error, "covariance": line.covariance,
            "freedom": line.freedom, "rows": [int(row) + 1 for row in one.rows],
            "residuals": list(line.residuals)} for name, (one, line) in lines.items()},
        "sheet": [{"name": one.name, "voltage": one.voltage, "printed": one.printed, "measured": one.measured,
                   "share": one.share, "lower": one.lower, "upper": one.upper} for one in found.shares],
        "flat_top": None if flat is None else {"current": flat.current, "load": flat.load,
                                               "rows": [row + 1 for row in flat.rows]},
        "stands_from": found.lines.stalled,
        "records": [one._asdict() for one in records],
        "parameters": {name: {"value": one.value, "std": one.std, "unit": one.unit, "source": one.source}
                       for name, one in found.parameters.items()},
        "findings": list(found.findings()), "files": [] if out is None else [str(out)],
    }
