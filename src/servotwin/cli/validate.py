"""`servotwin validate`: how far a servo is off logs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import log
from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import usual, with_records
from servotwin.cli.terminal import emit_json, patience, renderable, show
from servotwin.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.cli.output_files import Target
    from servotwin.identification import Log
    from servotwin.identification.fitting.fit import Validation
    from servotwin.models import Model
    from servotwin.parameters import Servo

_EXCEEDED = 1  # exit code
_MOST_LOGS = 30


@usual("model", "columns", "set", "supply", "max-error", "report", "force", "json")
@with_records
def validate(
    *,
    servo: shared.ServoArgument,
    logs: Annotated[list[Path], typer.Argument(
        metavar="LOGS", help=log.LOGS_HELP)],
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="pulse, pulse-inductive, bounded or digital (default: the model of the file's fit, else "
        "that of the servo's kind).")]
    = None,
    reading: Annotated[log.Reading, {
        "leave_out": "Time window to ignore, in all logs, or in one: LOG=START..STOP; repeatable."}],
    logged: shared.LoggedServo,
    nuisance: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help="Effects of the rig to fit to these logs: delay, log_delay, frame_phase, "
        "frame_period, control_phase, angle_offset, angle_sag, initial_state; repeatable or with commas (default: "
        "none; the others are as recorded by the fit in the servo file).")] = None,
    sensors: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help="Measured signals to compare; repeatable or with commas.")] = None,
    max_error: Annotated[list[str] | None, typer.Option(
        "--max-error", metavar="ERROR", help="Exit with code 1 if the rms error of a kind of motion is larger, such as "
        "3deg, or prbs=8deg for one kind; repeatable.")] = None,
    report: Annotated[Path | None, typer.Option(
        metavar="FILE.html", help="Write a page with pictures.", rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Compare a servo with logs, and say how far it is off."""
    from servotwin.cli.shared_options import servo_of

    targets = _targets(report, [Path(servo), *logs], force=ending.force)
    changed = servo_of(servo, logged.change, logged.register, logged.supply)
    found = _run(changed, model, nuisance, sensors, reading.mend, lambda nominal: reading.logs(
        logs, nominal, registers=bool(logged.register), force=ending.force, quiet=ending.as_json))
    limits = _limits(found, max_error or [])
    files = _write(found, targets, force=ending.force)
    above = exceeded(found, limits)
    _report(found, above, limits, files, as_json=ending.as_json)
    if above:
        raise typer.Exit(_EXCEEDED)


def _targets(report: Path | None, inputs: list[Path], *, force: bool) -> list[Target]:
    from servotwin.cli.output_files import Target, check_targets

    targets = [] if report is None else [Target(option="--report", path=report, endings=(".html", ".htm"))]
    check_targets(targets, force=force, inputs=inputs)
    return targets


def _run(servo: Servo, model: str | None, nuisance: list[str] | None, sensors: list[str] | None,
         mend: Sequence[str], read: Callable[[Model], list[Log]]) -> Validation:
    from servotwin.cli import fit_report
    from servotwin.cli.shared_options import class_of
    from servotwin.identification.fitting.checks import checked_servo
    from servotwin.identification.fitting.validate import recorded_model
    from servotwin.identification.fitting.validate import validate as run

    kind = None if model is None else class_of(model, fit_report.MODEL_NAMES)
    fitted = fit_report.some_or_none("--nuisance", nuisance, ())
    nominal = checked_servo(servo, recorded_model(servo) if kind is None else kind)
    return run(read(nominal), servo, kind, mend=fit_report.kinds(mend), nuisance=fitted,
               sensors=fit_report.names(sensors), progress=True)


def _limits(found: Validation, words: list[str]) -> Mapping[str | None, float]:
    from servotwin.cli import fit_report

    signals = {trace.signal for trace in found.traces}
    if words and len(signals) > 1:
        raise InputError("--max-error", got="logs with angles and logs with feedback voltages", allowed="one kind")
    limits = fit_report.limits_of(words, angle="output_angle" in signals)
    motions = list(found.errors.by("motion"))
    for motion in limits:
        if motion is not None and motion not in motions:
            raise UnknownNameError("motion of --max-error", motion, motions)
    return limits


def exceeded(found: Validation, limits: Mapping[str | None, float]) -> dict[str, float]:
    """Return the rms errors (SI), by kind of motion, that are above their limit."""
    own = found.errors.models[0]
    above = {}
    for motion, errors in found.errors.by("motion").items():
        limit = limits.get(motion, limits.get(None, math.inf))
        if not errors[own] <= limit:  # what is no number is above it too
            above[motion] = errors[own]
    return above


def _write(found: Validation, targets: list[Target], *, force: bool) -> list[str]:
    from servotwin.cli.output_files import staged

    if targets:
        with patience("writing"), staged(targets, force=force) as drafts:
            found.report(drafts[0])
    return [str(target.path) for target in targets]


def _report(found: Validation, above: Mapping[str, float], limits: Mapping[str | None, float], files: list[str], *,
            as_json: bool) -> None:
    from servotwin.cli import fit_report
    from servotwin.logs.log import reading_facts

    if as_json:
        emit_json({
            "servo": found.servo.name, "model": type(found.model).__name__, "logs": len(found.traces),
            "reading": reading_facts([trace.log for trace in found.traces]),
            "nuisance": dict(found.nuisance), "fitted": list(found.fitted),
            "errors": fit_report.error_facts(found.errors), "noise": dict(found.noise),
            "warnings": list(found.warnings),
            "registers": None if found.registers is None else found.registers.facts,
            "max_error": {motion or "all": limit for motion, limit in limits.items()}, "above": dict(above),
            "files": files})
        return
    show(*_sections(found, above, limits, files))


def _sections(found: Validation, above: Mapping[str, float], limits: Mapping[str | None, float],
              files: list[str]) -> list[RenderableType]:
    from servotwin.cli import fit_report
    from servotwin.identification.report import page
    from servotwin.identification.report.pictures import error_shown, rig_text

    tables = {"": found.errors}
    rig = [rig_text(name, value) + (" (fitted)" if name in found.fitted else "")
           for name, value in found.nuisance.items()]
    parts: list[RenderableType] = [
        f"{found.servo.title or found.servo.name} ({found.servo.name}), {type(found.model).__name__}, "
        f"{len(found.traces)} logs" + (f"; {', '.join(rig)}" if rig else "")]
    for label in found.errors.labels():
        parts += ["", renderable(page.errors(tables, found.traces, label))]
    parts += ["", renderable(page.logs(tables, found.traces, _MOST_LOGS))]
    parts += ["", *[f"! {text}" for text in found.warnings]] if found.warnings else []
    factor, unit = error_shown(found.traces)
    parts += [""] if above else []
    for motion, error in above.items():
        limit = limits.get(motion, limits.get(None, math.inf))
        parts += [f"! {motion}: {error * factor:.3g} {unit} is above {limit * factor:.3g} {unit}"]
    return [*parts, "", fit_report.written(files)] if files else parts
