"""The words of `servotwin fit` and `servotwin validate`: names, bounds, priors, what is held out and left out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from servotwin.cli.summary import names as dotted
from servotwin.cli.summary import was_set
from servotwin.cli.terminal import emit_json, pairs, renderable, show, table
from servotwin.errors import InputError, ServotwinError, UnknownNameError
from servotwin.identification.fitting.checks import MENDED
from servotwin.identification.fitting.search.free import Space, nominal
from servotwin.identification.fitting.search.stopping import Within
from servotwin.identification.fitting.traces import LogError, fit_percent
from servotwin.identification.report import page
from servotwin.identification.report.pictures import dimension_of_free, nominal_of, tables_of
from servotwin.logs.formats import MENDS
from servotwin.look.plain_data import facts_of
from servotwin.studies.kinds import Distribution, Normal, Offset, Relative, Uniform, distribution_of
from servotwin.units.quantities import number_and_unit, quantity

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.bench import LoadCalibration, TableCalibration
    from servotwin.bench.load_columns import LiftRecord
    from servotwin.identification import Advice, Fit, Ladder, Log
    from servotwin.identification.fitting.traces import ErrorTable
    from servotwin.models import Model
    from servotwin.parameters import Quantity, Servo


# --- A fit in tables, and as facts for JSON ---------------------------------------------------------------------------

_MOST_EXPERIMENTS = 8


def sections(fit: Fit, files: Sequence[str]) -> list[RenderableType]:
    """Return what is printed of a fit."""
    held = sum(trace.held_out for trace in fit.traces)
    head = f"{fit.servo.title or fit.servo.name} ({fit.servo.name}), {type(fit.model).__name__}, " \
           f"{len(fit.traces)} logs, {held} of them held out, {fit.seconds:.1f} s"
    parts: list[RenderableType] = [head, *_verdict(fit)]
    if fit.interrupted:
        parts.append(f"INTERRUPTED: the best so far; not known are {', '.join(fit.unknown)}")
    parts += ["", renderable(page.estimates(fit)), ""]
    if fit.register_values:
        rows = [(one.name, f"{one.value:.3g}", one.interval) for one in fit.register_values]
        parts += [table(("register", "raw value", f"{100.0 * fit.level:g} % interval"), rows), ""]
    parts += [f"- {item}" for item in fit.unidentifiable]
    parts += ["- no delay is seen: it ended at 0" if name == "delay" and fit.estimates[name] == 0.0
              else f"- {name} ended at a bound of the search" for name in fit.at_bound]
    parts += [f"- {line}" for line in fit.allowing]
    parts += [""] if fit.unidentifiable or fit.at_bound or fit.allowing else []
    parts.append(renderable(page.errors(tables_of(fit), fit.traces, "motion")))
    said = [text for text in fit.warnings if (fit.verdict is None or text != fit.verdict.sentence)
            and not (fit.interrupted and text.startswith("stopped: the best"))]
    if said:
        parts += ["", *[f"! {text}" for text in said]]
    given = was_set(fit.model)
    if given or files:
        parts += ["", pairs([*([("set", dotted(given))] if given else []), *_written(files)])]
    return parts


def _verdict(fit: Fit) -> list[RenderableType]:
    """Return the verdict, and the causes that explain it, in two lines or a table."""
    if fit.verdict is None:
        return []
    mark = "" if fit.verdict.holds else "! "
    return [f"{mark}{fit.verdict.sentence}", *(part for each in page.causes(fit) for part in ("", renderable(each)))]


def written(files: Sequence[str]) -> RenderableType:
    """Return the names of files that were written."""
    return pairs(_written(files))


def _written(files: Sequence[str]) -> list[tuple[str, str]]:
    return [("written", name) for name in files]


def facts(fit: Fit, files: Sequence[str]) -> dict[str, Any]:
    """Return a fit as plain data for JSON, in SI."""
    found = fit.intervals()
    estimates = {name: {
        "value": fit.estimates[name], "unit": fit.units[name], "lower": float(found[name].lower),
        "upper": float(found[name].upper), "method": found[name].method, "prior_share": fit.prior_share.get(name),
        "before": nominal_of(fit, name)}
        for name in fit.names}
    registers = None if fit.registers is None else {**fit.registers.facts, "values": fit.register_values}
    moved = {} if fit.verdict is None else {
        name: {"half_widths": widths, "by": by} for name, (widths, by) in fit.verdict.moved.items()}
    return facts_of({
        "servo": fit.servo.name, "model": type(fit.model).__name__, "logs": len(fit.traces),
        "held_out": [trace.log.name for trace in fit.traces if trace.held_out], "level": fit.level,
        "estimates": estimates, "covariance": {"names": fit.names, "rows": fit.covariance},
        "undetermined": fit.unidentifiable, "registers": registers, "foreseen": fit.foreseen,
        "assumptions": fit.assumptions, "at_bound": fit.at_bound, "yielded": fit.yielded, "widened": fit.widened,
        "errors": {which.replace(" ", "_"): error_facts(held) for which, held in tables_of(fit).items()},
        "noise": fit.noise, "warnings": fit.warnings, "verdict": fit.verdict, "moved": moved, "starts": fit.starts,
        "data": fit.servo.fit.get("data"), "seconds": fit.seconds, "interrupted": fit.interrupted,
        "unknown": fit.unknown, "set": was_set(fit.model), "files": files,
    }, _shown())


def _shown() -> dict[type, str]:
    """Return what is shown of the parts of a fit."""
    from servotwin.identification.fitting.advise import Advice, Experiment
    from servotwin.identification.fitting.fit import Ladder, Rung, Start
    from servotwin.identification.fitting.residual_noise import CrossCorrelation
    from servotwin.identification.fitting.uncertainty import Unidentifiable
    from servotwin.identification.fitting.verdict import Verdict
    from servotwin.identification.fitting.yielding import Foreseen, Widened, Yielded

    return {
        Verdict: "sentence holds ratio noise autocorrelation odds outliers word rival command_lag "
                 "cross_correlation=command causes",
        CrossCorrelation: "lag value band",
        Unidentifiable: "parameters direction combinations remedies words=str",
        Foreseen: "name alone prior reason words=str",
        Yielded: "parameter=name unit file file_std logs logs_std logs_lower logs_upper apart of_file others words=str",
        Widened: "parameter=name unit file file_std logs apart std of_file words=str",
        Start: "cost converged",
        LogError: "log motion conditions rms largest samples fit_percent",
        Ladder: "chosen reason error choices rungs",
        Rung: "name training holdout criterion overfits estimates=fit.estimates",
        Advice: "now alone widest experiments",
        Experiment: "motion load voltage sensors widths alone widest"}


def error_facts(held: ErrorTable) -> dict[str, Any]:
    """Return errors as plain data (SI): in all, by every label, and of each log."""
    return facts_of({
        "all": held.total(), "by": {label: held.by(label) for label in held.labels()},
        "fit_percent": held.total(fit_percent), "logs": {model: held.errors[model] for model in held.models}}, _shown())


def ladder_table(ladder: Ladder) -> list[RenderableType]:
    """Return the rungs of a friction ladder, and which one is chosen."""
    return [renderable(page.rungs(ladder)), *page.chosen(ladder), ""]


def ladder_facts(ladder: Ladder) -> dict[str, Any]:
    """Return a friction ladder as plain data."""
    return facts_of(ladder, _shown())


def advice_table(advice: Advice) -> list[RenderableType]:
    """Return the next experiments, the best first, with the predicted half width of the worst-known parameters."""
    worst = sorted(advice.now, key=lambda name: -advice.now[name])[:3]
    rows: list[tuple[str, ...]] = [("as it is now", *_widths(advice.now, worst))]
    rows += [(str(experiment), *_widths(experiment.widths, worst))
             for experiment in advice.experiments[:_MOST_EXPERIMENTS]]
    if any(_width(advice.alone[name]) != _width(advice.now[name]) for name in advice.now):
        rows.insert(1, ("as it is now, by logs alone, without priors", *_widths(advice.alone, worst)))
        best = advice.experiments[0]
        rows.insert(3, ("the same, by logs alone, without priors", *_widths(best.alone, worst)))
    return ["next experiments, and how surely what is known worst would be known with them (half a 95 % interval)",
            table(("experiment", *worst, "widest"), rows), str(advice)]


def _widths(widths: Mapping[str, float], names: Sequence[str]) -> tuple[str, ...]:
    return (*(_width(widths[name]) for name in names), _width(max(widths.values())))


def advice_facts(advice: Advice) -> dict[str, Any]:
    """Return advice as plain data; widths are relative."""
    return facts_of(advice, _shown())


def _width(share: float) -> str:
    if share > 10.0:
        return "unknown"
    return f"±{100.0 * share:.2g} %" if share < 1.0 else f"±{100.0 * share:.0f} %"


# --- `servotwin fit --table` ------------------------------------------------------------------------------------------

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
        Meaning of the columns of records.
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
    from servotwin.cli.output_files import Target, check_targets
    from servotwin.cli.shared_options import servo_of

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
    parameters = [] if not found.parameters else [parameter_table(found.parameters), ""]
    show(f"{found.source}: {found.table.rows} rows, " + ", ".join(c.name for c in found.table.columns), "",
         _lines(found), "", *parameters, *[f"- {text}" for text in found.findings()], *written)


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
    from servotwin.bench.table_parameters import plus_minus

    rows = []
    for name, fit in found.lines.items():
        line = fit.line
        rows.append((name, f"{plus_minus(line.slope, line.slope_error)} {fit.slope_unit}",
                     f"{plus_minus(line.intercept, line.intercept_error)} {fit.unit}",
                     f"{line.max_residual:.3g} {fit.unit}",
                     f"p = {fit.curvature.p_value:.2g}" + (", curved" if name in found.curved else "")))
    return table(("line", "slope", "at 0", "largest residual", "parabola"), rows)


def parameter_table(parameters: Mapping[str, Quantity]) -> RenderableType:
    """Return what a table sets of a servo, with errors and where each comes from."""
    rows = [(name, *_values(one), one.unit, (one.source or "").rpartition("least squares: ")[2])
            for name, one in parameters.items()]
    return table(("parameter", "value", "standard error", "unit", "from"), rows)


def _values(one: Quantity) -> tuple[str, str]:
    return f"{one.value:z.6g}", "" if one.std is None else f"{one.std:.2g}"


# --- The words of `servotwin fit` and `servotwin validate` ------------------------------------------------------------

Usual = TypeVar("Usual")

MODEL_NAMES = ("pulse", "pulse-inductive", "bounded", "digital")


def names(words: Sequence[str] | None) -> tuple[str, ...] | None:
    """Return names of an option that is repeated or has commas; None where it was not given.

    Examples
    --------
    >>> names(["a,b", "c"]), names([])
    (('a', 'b', 'c'), None)
    """
    if not words:
        return None
    return tuple(part.strip() for word in words for part in word.split(",") if part.strip())


def kinds(words: Sequence[str] | None) -> tuple[str, ...]:
    """Return the kinds of findings among the words of --mend, which may be joined; those of a reader are others.

    Examples
    --------
    >>> kinds(["wrap,not-followed", "torn"]), kinds(None)
    (('wrap', 'not followed'), ())
    """
    return tuple(name.replace("-", " ") for name in names(words) or () if name not in MENDS)


def reading_mends(words: Sequence[str] | None) -> tuple[str, ...]:
    """Return what a reader mends, among the words of --mend.

    Raises
    ------
    UnknownNameError
        If a word is neither that nor a kind of finding.

    Examples
    --------
    >>> reading_mends(["wrap,not-followed", "torn"])
    ('torn',)
    """
    findings = [name.replace(" ", "-") for name in MENDED]
    for name in names(words) or ():
        if name not in MENDS and name.replace(" ", "-") not in findings:
            raise UnknownNameError("kind of --mend", name, (*findings, *MENDS))
    return tuple(name for name in names(words) or () if name in MENDS)


def some_or_none(option: str, words: Sequence[str] | None, usual: Usual) -> tuple[str, ...] | Usual:
    """Return names, no name at all for the word "none", and the usual ones where the option was not given.

    Examples
    --------
    >>> some_or_none("--nuisance", ["none"], ("delay",)), some_or_none("--nuisance", None, ("delay",))
    ((), ('delay',))
    """
    found = names(words)
    if found is None:
        return usual
    if "none" in found and len(found) > 1:
        raise InputError(option, got=", ".join(found), allowed="names, or none alone")
    return () if "none" in found else found


def share(option: str, text: str) -> float:
    """Return a number between 0 and 1, or a percentage.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> share("--level", "95%"), share("--level", "0.9")
    (0.95, 0.9)
    """
    found = quantity(option, text, "number", bare=True) if _is_number(text) else math.nan
    if not 0.0 <= found < 1.0:
        raise InputError(option, got=text, allowed="a share from 0 to below 1, such as 0.25 or 25%")
    return found


def duration(option: str, text: str | None) -> Within:
    """Return the time that a fit may take, which begins now.

    Examples
    --------
    >>> duration("--within", "5 min").over, duration("--within", None).over
    (False, False)
    """
    return Within(None if text is None else quantity(option, text, "time", bare=True, positive=True))


def held_out(text: str | None) -> float | tuple[str, ...] | None:
    """Return what is held out: a share, or names of logs.

    Examples
    --------
    >>> held_out("25%"), held_out("step-1, step-2"), held_out(None)
    (0.25, ('step-1', 'step-2'), None)
    """
    if text is None:
        return None
    return share("--holdout", text) if _is_number(text) else names([text]) or ()


def _is_number(text: str) -> bool:
    found = number_and_unit(text)
    return found is not None and found[1] in ("", "%")


def bounds_of(words: Sequence[str], free: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return bounds (SI) by name, from words such as ``motor.armature_resistance=2ohm..5ohm``.

    Raises
    ------
    InputError
        If a word is none, a name is not searched, or the ends are not in order.

    Examples
    --------
    >>> bounds_of(["electronics.deadband=2..8us"], ["electronics.deadband"])
    {'electronics.deadband': (2e-06, 8e-06)}
    """
    found = {}
    for name, text in _assigned("--bounds", words, free).items():
        form = "LOWEST..HIGHEST, with units such as 2ohm..5ohm, or in SI"
        if ".." not in text:
            raise InputError(f"--bounds {name}", got=text, allowed=form)
        try:
            made = distribution_of(f"uniform:{text}", dimension_of_free(name))
        except ServotwinError as error:
            raise InputError(f"--bounds {name}", got=text, allowed=_allowed(error, form)) from None
        if not isinstance(made, Uniform):
            raise InputError(f"--bounds {name}", got=text, allowed=form)
        found[name] = (made.lower, made.upper)
    return found


def priors_of(words: Sequence[str], free: Sequence[str], model: Model, *, of_servo: bool,
              ) -> dict[str, tuple[float, float]] | None:
    """Return means and standard deviations (SI) by name: what the servo's file states, then what the words say.

    Parameters
    ----------
    words : sequence of str
        Such as ``motor.armature_resistance=3ohm±0.3ohm``, or ``=10%`` about the servo's own value.
    free : sequence of str
    model : Model
    of_servo : bool
        Whether the spreads of the servo's file count.

    Raises
    ------
    InputError
        If a word is none, or a name is not searched.
    """
    stated = {p.name: p.prior for p in Space(model, free, priors="servo").parameters} if of_servo else {}
    found = {name: prior for name, prior in stated.items() if prior is not None}
    for name, text in _assigned("--prior", words, free).items():
        found[name] = _prior(name, text, model.servo)
    return found or None


def _prior(name: str, text: str, servo: Servo) -> tuple[float, float]:
    form = "VALUE±STANDARD_DEVIATION, with units such as 3ohm±0.3ohm or 3ohm±10%, or ±10% about the servo's value"
    try:
        made = distribution_of(f"normal:{text}", dimension_of_free(name))
    except ServotwinError as error:
        raise InputError(f"--prior {name}", got=text, allowed=_allowed(error, form)) from None
    value = nominal(servo, name)
    if isinstance(made, Relative | Offset) and value is None:
        raise InputError(f"--prior {name}", got=text, allowed="a value too: the servo has none")
    mean, std = _moments(made, value or 0.0)
    if not std > 0.0:
        raise InputError(f"--prior {name}", got=text, allowed=form)
    return mean, std


def _moments(law: Distribution, value: float) -> tuple[float, float]:
    """Return mean and standard deviation of a normal law, which may be one about a value."""
    if isinstance(law, Relative) and isinstance(law.factor, Normal):
        return value * law.factor.mean, abs(value) * law.factor.std
    if isinstance(law, Offset) and isinstance(law.added, Normal):
        return value + law.added.mean, law.added.std
    return (law.mean, law.std) if isinstance(law, Normal) else (math.nan, math.nan)


def _assigned(option: str, words: Sequence[str], free: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise InputError(option, got=word, allowed="NAME=..., such as motor.armature_resistance=2ohm..5ohm"
                             if option == "--bounds" else "NAME=..., such as motor.armature_resistance=3ohm±10%")
        if name in found:
            raise InputError(f"{option} {name}", got=f"{found[name]} and {text}", allowed="one of both")
        if name not in free:
            raise InputError(f"{option} {name}", got="a name that is not searched", allowed=", ".join(free))
        found[name] = text
    return found


def _allowed(error: ServotwinError, form: str) -> str:
    """Return the units that are allowed where one was wrong, else the form."""
    known = getattr(error, "allowed", None)
    return f"one of the units {known}" if type(error).__name__ == "UnitError" and known else form


def check_free(free: Sequence[str], model: Model) -> None:
    """Raise if a searched name is unknown, so that nothing else is said about it first.

    Raises
    ------
    InputError
    """
    Space(model, tuple(free), priors=None)


def left_out(words: Sequence[str]) -> list[tuple[str | None, float, float]]:
    """Return windows of time [s], each of one log or, where it names none, of all.

    Raises
    ------
    InputError
        If a word is no window.

    Examples
    --------
    >>> left_out(["3..4.5", "run-2=100ms..200ms"])
    [(None, 3.0, 4.5), ('run-2', 0.1, 0.2)]
    """
    found = []
    for word in words:
        name, equals, text = word.rpartition("=")
        ends = text.split("..")
        if len(ends) != 2 or (equals and not name):
            raise InputError("--leave-out", got=word, allowed="START..STOP or LOG=START..STOP, such as 3s..4.5s")
        start, stop = (quantity("--leave-out", end, "time", bare=True) for end in ends)
        if not start < stop:
            raise InputError("--leave-out", got=word, allowed="START..STOP, the earlier one first")
        found.append((name.strip() or None, start, stop))
    return found


def without(logs: Sequence[Log], windows: Sequence[tuple[str | None, float, float]]) -> list[Log]:
    """Return logs with windows left out.

    Raises
    ------
    InputError
        If a window names a log that there is not, or nothing is left of one.
    """
    known = [log.name for log in logs]
    for name, *_ in windows:
        if name is not None and name not in known:
            raise UnknownNameError("log of --leave-out", name, known)
    return [replace(log, left_out=(*log.left_out, *((start, stop) for name, start, stop in windows
                                                    if name in (None, log.name)))) if windows else log
            for log in logs]


def limits_of(words: Sequence[str], angle: bool) -> Mapping[str | None, float]:
    """Return the largest error that is allowed (SI), by kind of motion; None stands for every kind.

    Examples
    --------
    >>> limits_of(["3 deg", "prbs=0.1 rad"], True)["prbs"]
    0.1
    """
    found: dict[str | None, float] = {}
    for word in words:
        name, _, text = word.rpartition("=")
        value = quantity("--max-error", text, "angle" if angle else "voltage")
        if not value > 0.0:
            raise InputError("--max-error", got=word, allowed="a positive number with a unit, such as 3deg")
        found[name.strip() or None] = value
    return found


def calibrate_of_loads(path: Path, servo: Servo | None, arm: str | None, columns: Sequence[str]
                       ) -> tuple[LoadCalibration, tuple[LiftRecord, ...]]:
    """Return what a table, or the records that a pattern names, say of a servo.

    Raises
    ------
    InputError
        If table, record or arm is not usable.
    """
    from servotwin.bench import calibrate_loads, is_pattern, lifts
    from servotwin.bench.load_columns import length_of

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
