"""`servotwin fit --table`: what a table of a bench or of loads gives, in words, as JSON, and as a servo file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.cli.terminal import emit_json, pairs, show, table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.console import RenderableType

    from servotwin.bench import TableCalibration
    from servotwin.parameters import Quantity


def calibrate_from(path: Path, servo: str | None, out: Path | None, *, change: Sequence[str] = (),
                   supply: str | None = None, arm: str | None = None, columns: Sequence[str] = (), force: bool = False,
                   as_json: bool = False) -> None:
    """Calibrate from a table, show what was found, and write the servo.

    Parameters
    ----------
    path : Path
        The table, a CSV file; or a pattern of the records of lifts, such as ``lift{mass:g}.txt``.
    servo : str or None
        Id in the catalog or path of a servo file, which takes the values.
    out : Path or None
        Where the servo is written, a .toml.
    change : sequence of str
        Words of `--set`.
    supply : str or None
        Words of `--supply`.
    arm : str or None
        On which weights hung, or the radius of the drum, such as "1cm".
    columns : sequence of str
        What the columns of records are.
    force : bool
        Replace it where it exists.
    as_json : bool
        Print JSON, values in SI.

    Raises
    ------
    InputError
        If table, servo or output is not usable.
    """
    from servotwin.bench import calibrate_table, is_load_table, is_pattern
    from servotwin.cli.fit_loads import calibrate_of_loads, load_facts, show_loads
    from servotwin.cli.model_words import servo_of
    from servotwin.cli.outputs import Target, check_targets
    from servotwin.errors import InputError

    if out is not None:
        check_targets([Target(option="--out", path=out, endings=(".toml",))], force=force,
                      inputs=[path, *([] if servo is None else [Path(servo)])])
    if (change or supply) and servo is None:
        raise InputError("--set" if change else "--supply", got="no --servo", allowed="both")
    loaded = None if servo is None else servo_of(servo, list(change), [], supply)
    if is_pattern(path) or is_load_table(path):
        loads, records = calibrate_of_loads(path, loaded, arm, columns)
        if out is not None:
            loads.servo.save(out, overwrite=force)
        if as_json:
            emit_json(load_facts(loads, records, out))
        else:
            show_loads(loads, records, out)
        return
    for option, given in (("--arm", arm), ("--columns", columns)):
        if given:
            raise InputError(option, got="a table without loads", allowed="a table of loads, or a pattern of records")
    found = calibrate_table(path, loaded)
    if out is not None:
        found.servo.save(out, overwrite=force)
    if as_json:
        emit_json(calibration_facts(found, out))
        return
    show_table_calibration(found, out)


def show_table_calibration(found: TableCalibration, out: Path | None) -> None:
    """Show what a table says, and where the servo is, if it was written."""
    written = [] if out is None else ["", pairs([("written", str(out))])]
    show(f"{found.source}: {found.table.rows} rows, " + ", ".join(c.name for c in found.table.columns), "",
         _lines(found), "", *_parameters(found), *[f"- {text}" for text in found.findings()], *written)


def calibration_facts(found: TableCalibration, out: Path | None = None) -> dict[str, Any]:
    """Return a calibration as plain data for JSON: lines in the table's units, parameters in SI.

    Examples
    --------
    >>> from servotwin.bench import calibrate_table
    >>> facts = calibration_facts(calibrate_table({"q_deg": [0, 45, 90, 135], "V_o_V": [0.590, 0.912, 1.253, 1.572]}))
    >>> list(facts["parameters"])
    ['potentiometer.feedback_gain', 'potentiometer.feedback_offset']
    """
    from servotwin.bench.table_rows import ways_facts

    return {
        "source": found.source, "servo": found.servo.name, "rows": found.table.rows,
        "columns": [column.name for column in found.table.columns], "ignored_columns": list(found.table.ignored),
        "lines": {name: {
            "abscissa": fit.x_column.name, "ordinate": fit.y_column.name, "slope": fit.line.slope,
            "slope_error": fit.line.slope_error, "slope_unit": fit.slope_unit, "intercept": fit.line.intercept,
            "intercept_error": fit.line.intercept_error, "covariance": fit.line.covariance, "unit": fit.unit,
            "residuals": list(fit.line.residuals), "largest_residual": fit.line.max_residual,
            "curvature_F": fit.curvature.f_value, "curvature_p": fit.curvature.p_value,
            "sagitta": fit.curvature.sagitta, "curved": name in found.curved,
            "hysteresis": ways_facts(fit)} for name, fit in found.lines.items()},
        "parameters": {name: {"value": one.value, "std": one.std, "unit": one.unit, "source": one.source}
                       for name, one in found.parameters.items()},
        "instruments": [{
            "first": pair.first, "second": pair.second, "gain": pair.line.slope, "gain_error": pair.gain_error,
            "zero": pair.line.intercept, "zero_error": pair.zero_error, "same": pair.same,
            "expected_gain": pair.expected_gain, "expected_from": pair.expected_from, "gain_p": pair.gain_p,
            "zero_p": pair.zero_p, "disagrees_in": list(pair.disagrees_in), "words": pair.words}
            for pair in found.instruments],
        "rows_off": [{"row": one.row + 1, "line": one.line, "residual": one.residual, "t": one.t_value,
                      "p": one.p_value, "certain": one.certain, "column": one.column, "better": one.better,
                      "words": one.words} for one in found.rows],
        "findings": list(found.findings()), "files": [] if out is None else [str(out)],
    }


def _lines(found: TableCalibration) -> Any:
    from servotwin.bench.table_words import plus_minus

    rows = []
    for name, fit in found.lines.items():
        line = fit.line
        rows.append((name, f"{plus_minus(line.slope, line.slope_error)} {fit.slope_unit}",
                     f"{plus_minus(line.intercept, line.intercept_error)} {fit.unit}",
                     f"{line.max_residual:.3g} {fit.unit}",
                     f"p = {fit.curvature.p_value:.2g}" + (", curved" if name in found.curved else "")))
    return table(("line", "slope", "at 0", "largest residual", "parabola"), rows)


def _parameters(found: TableCalibration) -> list[Any]:
    if not found.parameters:
        return []
    return [parameter_table(found.parameters), ""]


def parameter_table(parameters: Mapping[str, Quantity]) -> RenderableType:
    """Return what a table sets of a servo, with errors and where each comes from."""
    rows = [(name, *_values(one), one.unit, (one.source or "").rpartition("least squares: ")[2])
            for name, one in parameters.items()]
    return table(("parameter", "value", "standard error", "unit", "from"), rows)


def _values(one: Quantity) -> tuple[str, str]:
    return f"{one.value:z.6g}", "" if one.std is None else f"{one.std:.2g}"
