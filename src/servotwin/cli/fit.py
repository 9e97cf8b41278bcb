"""`servotwin fit`: the parameters of a servo, from its logs or from a bench table."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import log
from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import usual, with_records
from servotwin.cli.shared_options import best_kept, end_if_stopped
from servotwin.cli.terminal import emit_json, patience, show
from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.cli.output_files import Target
    from servotwin.identification import Advice, Fit, Ladder, Log
    from servotwin.identification.fitting.search.stopping import Within
    from servotwin.models import Model


# --- `servotwin fit`: the parameters of a servo, from its logs or from a bench table ----------------------------------

_TABLES = (".csv", ".txt", ".tsv", ".dat")
_MOST_BYTES = 65536  # of a table that was written by hand
_LOGS, _SEARCH = log.PANEL, "What to search for, and how"


@dataclass(frozen=True, kw_only=True)
class _Sought:
    """The options that say what is searched for and how, as they were typed."""

    holdout: Annotated[str | None, typer.Option(
        metavar="SHARE|NAMES", help="Logs to predict rather than fit: a share of each kind of motion, such as "
        "0.25, or names with commas; 0 for none (default: a quarter of each kind with four logs or more).",
        rich_help_panel=_LOGS)] = None
    sensors: Annotated[Sequence[str], typer.Option(
        metavar="NAME", help="Measured signals to fit; repeatable or with commas (default: the angle and all "
        "currents).", rich_help_panel=_LOGS)] = ()
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="pulse, pulse-inductive, bounded or digital (default: the one that stands for the "
        "servo: pulse, or digital if its file says so; bounded if it has no chip).", rich_help_panel=_SEARCH)] = None
    free: Annotated[Sequence[str], typer.Option(
        metavar="NAME", help="Parameters to search for, repeatable or with commas: names of servo and load, and "
        "output_torque_constant, output_inertia, output_coulomb_torque.", rich_help_panel=_SEARCH)] = ()
    bounds: Annotated[Sequence[str], typer.Option(
        metavar="NAME=LOW..HIGH", help="Range to search, such as output_inertia=1e-3..1e-2; "
        "repeatable.", rich_help_panel=_SEARCH)] = ()
    prior: Annotated[Sequence[str], typer.Option(
        metavar="NAME=VALUE±STD", help="Prior knowledge, such as output_inertia=4e-3±30%; "
        "repeatable. The spreads in the servo file apply to the others.", rich_help_panel=_SEARCH)] = ()
    no_priors: Annotated[bool, typer.Option(
        "--no-priors", help="Ignore the spreads in the servo file.", rich_help_panel=_SEARCH)] = False
    nuisance: Annotated[Sequence[str], typer.Option(
        metavar="NAME", help="Effects of the rig to fit: delay, log_delay, frame_phase, frame_period, control_phase, "
        "angle_offset, angle_sag, initial_state, or none (default: delay, frame_phase, angle_offset, initial_state, "
        "and control_phase where pulses command a program).", rich_help_panel=_SEARCH)] = ()
    starts: Annotated[int, typer.Option(
        metavar="NUMBER", help="Number of searches; all but the first start at random.", rich_help_panel=_SEARCH)] = 3
    loss: Annotated[str, typer.Option(
        metavar="HOW", help="huber (large residuals count less) or squares.", rich_help_panel=_SEARCH)] = "huber"
    level: Annotated[str, typer.Option(
        metavar="SHARE", help="Level of the intervals.", rich_help_panel=_SEARCH)] = "0.95"
    intervals: Annotated[bool, typer.Option(
        "--intervals/--no-intervals", help="Compute intervals; faster without.", rich_help_panel=_SEARCH)] = True
    seed: Annotated[int, typer.Option(
        metavar="NUMBER", help="Seed for random starts and the choice of held-out logs.", rich_help_panel=_SEARCH)] = 0
    compare: Annotated[bool, typer.Option(
        "--compare/--no-compare", help="Also fit simpler models to the same logs.", rich_help_panel=_SEARCH)] = True
    diagnose: Annotated[bool, typer.Option(
        "--trials/--no-trials", help="Where what is left is not noise, try what may be the matter; takes up to "
        "four times as long as the fit itself.", rich_help_panel=_SEARCH)] = True
    within: Annotated[str | None, typer.Option(
        metavar="DURATION", help="Stop after this time, such as 90s or 5min, and keep the best so far, as Ctrl-C does.",
        rich_help_panel=_SEARCH)] = None
    accuracy: shared.AccuracyOption = 1e-7

    def begun(self, servo: str, logged: shared.LoggedServo) -> _Search:
        """Return where the search begins, and what is searched."""
        from servotwin.cli import fit_report
        from servotwin.identification.fitting.checks import usual_free

        nominal = shared.model_of(servo, self.model, logged.change, fit_report.MODEL_NAMES, logged.register,
                                  logged.supply)
        names = fit_report.names(self.free) or usual_free(nominal)
        fit_report.check_free(names, nominal)
        return _Search(nominal, names, fit_report.bounds_of(self.bounds, names),
                       fit_report.priors_of(self.prior, names, nominal, of_servo=not self.no_priors))

    def options(self, mend: Sequence[str]) -> dict[str, Any]:
        """Return the options of `identify` that words say."""
        from servotwin.cli import fit_report

        return {
            "holdout": fit_report.held_out(self.holdout), "mend": fit_report.kinds(mend),
            "sensors": fit_report.names(self.sensors),
            "nuisance": fit_report.some_or_none("--nuisance", self.nuisance, None),
            "level": fit_report.share("--level", self.level), "starts": self.starts, "loss": self.loss,
            "intervals": self.intervals, "seed": self.seed, "accuracy": self.accuracy, "diagnose": self.diagnose,
            "within": fit_report.duration("--within", self.within),
            "compare_with": ("slew", "M1") if self.compare else ()}


@dataclass(frozen=True, kw_only=True)
class _Laws:
    """The options that ask for several laws or structures, as they were typed."""

    ladder: Annotated[bool, typer.Option(
        "--ladder", help="Fit friction laws M1 to M6 and choose one by the held-out logs.",
        rich_help_panel=_SEARCH)] = False
    structures: Annotated[bool, typer.Option(
        "--structures", help="Fit analog and digital loops, braking and open bridges, and friction laws M1 to M6, and "
        "choose the simplest that predicts the held-out logs no worse.", rich_help_panel=_SEARCH)] = False
    spring: Annotated[Sequence[str], typer.Option(
        metavar="gear|arm", help="With --structures: try an elastic gear or arm too, which takes longer; repeatable.",
        rich_help_panel=_SEARCH)] = ()

    def check(self, model: Model) -> None:
        """Raise InputError if they contradict, or no law is open to a model."""
        from servotwin.models import BoundedServo

        if self.ladder and self.structures:
            raise InputError("--ladder", got="also --structures",
                             allowed="one of them: structures climb the ladder too")
        if self.spring and not self.structures:
            raise InputError("--spring", got="no --structures", allowed="both: a spring is one of the structures")
        if self.ladder and isinstance(model, BoundedServo):
            raise InputError("--ladder", got="a bounded servo", allowed="pulse, pulse-inductive or digital, which know "
                             "friction that grows with the load")

    def climber(self, search: _Search, *, asked: bool) -> Callable[..., Ladder] | None:
        """Return what fits several laws or structures; None where one fit is asked for."""
        from functools import partial

        from servotwin.cli import fit_report
        from servotwin.identification import compare_structures, friction_ladder

        servo, kind = search.model.servo, type(search.model)
        if self.structures:
            return partial(compare_structures, servo=servo, model=kind, free=search.free if asked else None,
                           springs=fit_report.names(self.spring) or ())
        return partial(friction_ladder, servo=servo, model=kind, free=search.free) if self.ladder else None


@usual("servo", "table", "free", "advise", "out", "report", "force", "json")
@with_records
def fit(
    *,
    logs: Annotated[list[Path] | None, typer.Argument(
        metavar="LOGS", help=log.LOGS_HELP)] = None,
    servo: Annotated[str | None, typer.Option(
        metavar="SERVO", help="Servo to start from, which also supplies the values that are not fitted: catalog id, or "
        "path of a servo file (.toml).", rich_help_panel=_LOGS)] = None,
    reading: log.Reading,
    logged: shared.LoggedServo,
    table: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Calibrate from a table instead of logs: readings of a bench, or weights with "
        "currents, speeds or sags, or voltages with speeds; or from records of lifts: 'lift{mass:g}.txt'.",
        rich_help_panel=_LOGS)] = None,
    arm: Annotated[str | None, typer.Option(
        metavar="LENGTH", help="With --table: the arm, or the radius of the drum, on which the weights hung, such as "
        "1cm.", rich_help_panel=_LOGS)] = None,
    sought: _Sought,
    laws: _Laws,
    advise: Annotated[bool, typer.Option(
        "--advise", help="Say which experiment to do next; without logs, which one to start with.",
        rich_help_panel=_SEARCH)] = False,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="Write the fitted servo.", rich_help_panel=shared.OUTPUT)] = None,
    report: Annotated[Path | None, typer.Option(
        metavar="FILE.html", help="Write a page with pictures.", rich_help_panel=shared.OUTPUT)] = None,
    scheduler: shared.SchedulerOption = None,
    ending: shared.Ending,
) -> None:
    """Find the parameters of a servo, with intervals."""
    force, as_json = ending.force, ending.as_json
    _check_words(logs, servo, table, report, scheduler, reading.raw, advise=advise, registers=bool(logged.register))
    if table is not None:
        from servotwin.cli.fit_report import calibrate_from

        calibrate_from(table, servo, out, change=logged.change, supply=logged.supply, arm=arm, columns=reading.columns,
                       force=force, as_json=as_json)
        return
    _check_no_table(logs, arm)
    targets = _targets(out, report, [*(logs or []), Path(servo or "")], force=force)
    search = sought.begun(servo or "", logged)
    if not logs:
        _show_advice(_first_advice(search), as_json=as_json)
        return
    laws.check(search.model)
    options = sought.options(reading.mend)
    given = reading.logs(logs, search.model, registers=bool(logged.register), force=force, quiet=as_json)
    found = _run(search, given, options, scheduler, laws.climber(search, asked=bool(sought.free)))
    files = _write(found, targets, force=force)
    if advise and not found.fit.interrupted and found.fit.doubt is not None:
        found = _Found(found.fit, found.ladder, _advice(found.fit))
    _report(found, files, as_json=as_json)
    end_if_stopped(found.fit, timed=sought.within is not None)


@dataclass(frozen=True)
class _Search:
    """Where a search begins, and what is searched."""

    model: Model
    free: tuple[str, ...]
    bounds: dict[str, tuple[float, float]]
    priors: dict[str, tuple[float, float]] | None


@dataclass(frozen=True)
class _Found:
    fit: Fit
    ladder: Ladder | None = None
    advice: Advice | None = None


def _check_words(logs: list[Path] | None, servo: str | None, table: Path | None, report: Path | None,
                 scheduler: str | None, raw: str | None, *, advise: bool, registers: bool) -> None:
    if table is not None:
        for given, what in ((bool(logs), "logs"), (report is not None, "--report"), (advise, "--advise"),
                            (scheduler is not None, "--scheduler"), (registers, "--register"),
                            (raw is not None, "--registers")):
            if given:
                raise InputError("--table", got=f"also {what}", allowed="a table alone; it is calibrated, not fitted")
        return
    if not logs and not advise:
        raise InputError("no logs; give files or folders, or --table FILE.csv, or --advise for where to begin")
    if servo is None:
        raise InputError("--servo is needed: an id of servotwin catalog list, or a servo file; servotwin catalog "
                         "from-sheet makes one from a data sheet")


def _check_no_table(logs: list[Path] | None, arm: str | None) -> None:
    """Raise where what is given as a log is a table of loads: it has no time, and has a door of its own."""
    from servotwin.bench import is_load_table

    if arm is not None:
        raise InputError("--arm", got="no --table", allowed="--table FILE.csv, a table of loads")
    for path in logs or ():
        table = False
        with contextlib.suppress(InputError, OSError):  # whoever reads it says so
            table = (path.suffix.lower() in _TABLES and path.is_file() and path.stat().st_size < _MOST_BYTES
                     and is_load_table(path))
        if table:
            raise InputError(f"{path}", got="a table of loads and no log", allowed=f"--table {path}")


def _targets(out: Path | None, report: Path | None, inputs: list[Path], *, force: bool) -> list[Target]:
    from servotwin.cli.output_files import Target, check_targets

    targets = []
    if out is not None:
        targets.append(Target(option="--out", path=out, endings=(".toml",)))
    if report is not None:
        targets.append(Target(option="--report", path=report, endings=(".html", ".htm")))
    check_targets(targets, force=force, inputs=inputs)
    return targets


def _run(search: _Search, logs: list[Log], options: dict[str, Any], scheduler: str | None,
         climbs: Callable[..., Ladder] | None) -> _Found:
    from servotwin.cli.sweep import executor_at
    from servotwin.identification import identify

    servo, kind = search.model.servo, type(search.model)
    with executor_at(scheduler) as executor, best_kept() as progress:
        options = {**options, "bounds": search.bounds, "priors": search.priors, "executor": executor,
                   "progress": progress}
        if climbs is not None:
            climbed = climbs(logs, **options)
            found = _Found(climbed.fit, climbed)
        else:
            found = _Found(identify(logs, servo, kind, search.free, **options))
    if found.fit.interrupted and found.fit.cost == float("inf"):  # before the first step: there is nothing to keep
        _check_time(options["within"])
        raise KeyboardInterrupt
    return found


def _check_time(within: Within) -> None:
    """Raise if it was too little for a first step, and no interrupt came.

    Raises
    ------
    InputError
    """
    from servotwin.cli.interrupts import noted

    if within.over and not noted():
        raise InputError("--within", got="a time in which nothing was found", allowed="a longer one")


def _first_advice(search: _Search) -> Advice:
    from servotwin.identification import advise

    with patience("simulating experiments"):
        return advise(search.model.servo, model=type(search.model), free=search.free, priors=search.priors,
                      sensors=_further(search.model))


def _advice(fit: Fit) -> Advice:
    from servotwin.identification import advise

    with patience("simulating experiments"):
        return advise(fit, sensors=[name for name in _further(fit.model) if name not in fit.noise])


def _further(model: Model) -> list[str]:
    """Return the sensor that is easiest to add, of those that the model has."""
    known: tuple[str, ...] = ("supply_current", "armature_current")
    return [name for name in known if name in model.available][:1]


def _write(found: _Found, targets: list[Target], *, force: bool) -> list[str]:
    from servotwin.cli.output_files import staged

    with patience("writing"), staged(targets, force=force) as drafts:
        for target, draft in zip(targets, drafts, strict=True):
            if target.option == "--out":
                found.fit.servo.save(draft)
            else:
                found.fit.report(draft, ladder=found.ladder)
    return [str(target.path) for target in targets]


def _show_advice(advice: Advice, *, as_json: bool) -> None:
    from servotwin.cli.fit_report import advice_facts, advice_table

    if as_json:
        emit_json({"advice": advice_facts(advice)})
        return
    show(*advice_table(advice))


def _report(found: _Found, files: list[str], *, as_json: bool) -> None:
    from servotwin.cli import fit_report
    from servotwin.logs.log import reading_facts

    if as_json:
        more: dict[str, Any] = {"reading": reading_facts([trace.log for trace in found.fit.traces])}
        if found.ladder is not None:
            more["ladder"] = fit_report.ladder_facts(found.ladder)
        if found.advice is not None:
            more["advice"] = fit_report.advice_facts(found.advice)
        emit_json({**fit_report.facts(found.fit, files), **more})
        return
    parts = [] if found.ladder is None else fit_report.ladder_table(found.ladder)
    parts += fit_report.sections(found.fit, files)
    if found.advice is not None:
        parts += ["", *fit_report.advice_table(found.advice)]
    show(*parts)
