"""`servotwin log`: reads a log, mends it, and says what it holds, without a servo and without a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, usual, with_records
from servotwin.cli.terminal import emit_json, patience, show, table
from servotwin.errors import InputError, OutputError, one_line
from servotwin.logs.formats import FORMATS, LOG_FORMATS, MENDS

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.cli.output_files import Target
    from servotwin.identification import Log
    from servotwin.identification.survey.survey import Survey
    from servotwin.models import Model


# --- Logs read for a command ------------------------------------------------------------------------------------------

_MOST_REMARKS = 5
_QUIET = ("named", "sidecar")  # someone said so before

PANEL = shared.LOGS
LOGS_HELP = f"Log files or folders: {', '.join(each.what for each in LOG_FORMATS.values())}."


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The options that say how logs are read, as they were typed."""

    file_format: Annotated[str, typer.Option(
        "--format", metavar="FORMAT", help=f"Format of the logs: {', '.join(FORMATS)}.", rich_help_panel=PANEL)
        ] = "auto"
    columns: Annotated[Sequence[str], typer.Option(
        metavar="SIGNAL=COLUMN:UNIT", help='What the columns of a table mean: "time=t:ms angle=pos:deg-90"; kept in '
        "the sidecar. Other columns are recognised by name or guessed, and shown.", rich_help_panel=PANEL)] = ()
    joint: Annotated[Sequence[str], typer.Option(
        metavar="NAME[:UNIT]", help="Joints of a LeRobot dataset to read, and their unit; repeatable or with commas, "
        "*:deg for all.", rich_help_panel=PANEL)] = ()
    raw: Annotated[str | None, typer.Option(
        "--registers", metavar="FAMILY|MODEL", help="Whose registers the columns of a table are named after and hold "
        "raw: feetech-sts, dynamixel-x, -mx, -ax, -xl320, or a model such as XM430-W350 (default: those of the servo, "
        "where the numbers cannot be degrees).", rich_help_panel=PANEL)] = None
    rate: Annotated[str | None, typer.Option(
        metavar="RATE", help="Rows per second of tables without times, such as 50Hz.", rich_help_panel=PANEL)] = None
    commanded: Annotated[str | None, typer.Option(
        metavar="VALUE[@TIME]", help="What was commanded in tables without a command: 153deg@0s, or jumps such as "
        "1500us@0s,1700us@0.5s.", rich_help_panel=PANEL)] = None
    leave_out: Annotated[Sequence[str], typer.Option(
        "--leave-out", metavar="START..STOP", help="Time window that says nothing about the servo, in all logs or "
        "in one: LOG=START..STOP; repeatable.", rich_help_panel=PANEL)] = ()
    mend: Annotated[Sequence[str], typer.Option(
        metavar="KIND", help="What to put right in the logs first, of what is said to be wrong with them: wrap, "
        f"stamps, sign, span, rows, not-followed; and in their files {', '.join(MENDS)}; repeatable or with commas.",
        rich_help_panel=PANEL)] = ()

    @property
    def said(self) -> str | None:
        """The words of `--columns`, with those of `--rate` and `--commanded` among them."""
        return columns_said(self.columns, self.rate, self.commanded)

    def logs(self, paths: Sequence[Path], model: Model, *, registers: bool, force: bool = False, quiet: bool = False
             ) -> list[Log]:
        """Return the logs of files and folders, with commands that count from the middle of the servo's travel.

        Guesses, words and findings on columns are shown, unless `quiet`; words and findings are written into sidecars.
        Where the user says the registers of the servo (`registers`), those that a dataset's robot has are not assumed.
        Columns that are named after registers hold those of the family or model `raw`, else of the servo.

        Raises
        ------
        InputError
            If one cannot be read, a window is none, the servo cannot follow a command, or a sidecar says otherwise and
            `force` is false.
        """
        from servotwin.cli import fit_report
        from servotwin.identification import read_logs
        from servotwin.identification.fitting.registers import of_no_robot
        from servotwin.identification.fitting.suspicions.followed import centred

        windows, said = fit_report.left_out(self.leave_out), self.said
        mends = fit_report.reading_mends(self.mend)
        with patience("reading"):
            given = [(path, read_logs(path, self.file_format, columns=said, joints=",".join(self.joint) or None,
                                      mend=mends, registers=self.raw or model.servo)) for path in paths]
            logs = fit_report.without([log for _, some in given for log in some], windows)
        found = centred(logs, model)
        parts = _parts(logs)
        lines = list(found.sentences)
        rest = iter(found.logs)
        for path, some in given:
            option = "--columns" if said is not None else "--registers" if self.raw is not None else ""
            lines += _kept(some, list(islice(rest, len(some))), path, said=option, force=force)
        if (parts or lines) and not quiet:
            show(*parts, *lines, "")
        for line in lines if quiet else ():
            typer.echo(one_line(line), err=True)
        return of_no_robot(found.logs) if registers else list(found.logs)


def _kept(read: Sequence[Log], found: Sequence[Log], path: Path, *, said: str, force: bool) -> list[str]:
    """Write what was said or found of columns into sidecars, and return what to say of it."""
    from servotwin.identification import keep_columns

    what = said or "this"
    try:
        return [f"written  {file}, which keeps {what}" for file in keep_columns(
            found, path if path.is_dir() else None, overwrite=force, instead_of=read)]
    except InputError as error:
        if said and not isinstance(error, OutputError):  # one that cannot be written is no contradiction
            raise
        return [f"{what} is not kept: {error}"]


def columns_said(columns: Sequence[str] | None, rate: str | None, commanded: str | None) -> str | None:
    """Return the words of `--columns`, with those of `--rate` and `--commanded` among them.

    Raises
    ------
    InputError
        If a rate or a command is none.

    Examples
    --------
    >>> columns_said(["angle=1:deg"], "50Hz", "153deg@0s")
    'angle=1:deg time=50Hz command=153deg@0s'
    """
    from servotwin.logs.column_words import with_signals
    from servotwin.logs.log_checks import checked_definition

    words = [] if not columns else [with_signals("--columns", " ".join(columns))]
    for option, signal, text in (("--rate", "time", rate), ("--commanded", "command", commanded)):
        if text is not None:
            checked_definition(option, signal, text)
            words.append(f"{signal}={text}")
    return " ".join(words) or None


def _parts(logs: Sequence[Log]) -> list[RenderableType]:
    """Return a table of the columns that were guessed or said just now, and what was passed over."""
    from servotwin.logs.log import read_alike

    groups = read_alike(logs)
    shown = [some for some in groups if some[0].reading is not None
             and any(one.known not in _QUIET for one in some[0].reading.columns)]
    rows = [(_file(some), one.column, one.signal, one.unit, one.known) for some in shown if some[0].reading is not None
            for one in some[0].reading.columns]
    parts: list[RenderableType] = []
    if rows:
        many = len(groups) > 1
        names = ("file", "column", "signal", "unit", "known")
        parts.append(table(names if many else names[1:], [row if many else row[1:] for row in rows]))
    unread = dict.fromkeys(name for some in shown if some[0].reading is not None for name in some[0].reading.unread)
    if unread:
        parts.append(f"not read: {', '.join(unread)}")
    remarks = list(dict.fromkeys(f"{log.reading.file}: {remark}" for log in logs if log.reading is not None
                                 for remark in log.reading.remarks))
    more = [f"... and {len(remarks) - _MOST_REMARKS} more"] if len(remarks) > _MOST_REMARKS else []
    return [*parts, *remarks[:_MOST_REMARKS], *more]


def _file(some: Sequence[Log]) -> str:
    name = some[0].name
    return name if len(some) == 1 else f"{name} and {len(some) - 1} more"


# --- `servotwin log`: reads a log, mends it, and says what it holds, without a servo and without a fit ----------------

HELP = "Read a log, mend it, and say what it holds and lacks: clock, gaps, noise, counts, lag; no servo, no fit."
EPILOG = ("Example: servotwin log run.csv --mend torn,reset --out mended.csv --plot run.png\n\n"
          'Example: servotwin log lift0.txt --columns "1:ms 2:deg 3:A" --commanded 153deg@0s')


@usual("columns", "rate", "out", "plot", "force", "json")
@with_records
def log(
    *,
    files: Annotated[list[Path], typer.Argument(metavar="FILES", help=LOGS_HELP)],
    reading: Annotated[Reading, {
        "leave_out": LEFT_OUT, "mend": "What to mend of what is not certain: " + "; ".join(
            f"{name} {what}" for name, what in MENDS.items()) + "; repeatable or with commas."}],
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Write the mended log, in SI, and its sidecar.",
        rich_help_panel=shared.OUTPUT)] = None,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw it: .png, .svg or .pdf.", rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Say what a log holds and lacks."""
    from servotwin.cli.log_words import sections
    from servotwin.identification import read_logs
    from servotwin.identification.survey.survey import survey_of

    said, mends, force = reading.said, _mends(reading.mend), ending.force
    if out is not None or plot is not None:
        _check(files, out, plot, 1, force=force)
    with patience("reading"):
        logs = [one for path in files for one in read_logs(
            path, reading.file_format, columns=said, joints=",".join(reading.joint) or None, mend=mends,
            unknown_step=True, registers=reading.raw)]
        targets = _check(files, out, plot, len(logs), force=force)
        found = [survey_of(one) for one in logs]
    written = _write(found, targets, force=force)
    if ending.as_json:
        emit_json({"logs": [one.facts for one in found], "files": written})
        return
    for k, one in enumerate(found):
        last = k == len(found) - 1
        show(*sections(one, written if last else ()), *([] if last else [""]))


def _mends(words: Sequence[str]) -> tuple[str, ...]:
    """Return what the reader mends.

    Raises
    ------
    InputError
        If something is to be mended that only shows beside a servo.
    """
    from servotwin.cli.fit_report import kinds, reading_mends

    mends = reading_mends(words)
    if others := kinds(words):
        raise InputError("--mend", got=", ".join(others), allowed=f"{', '.join(MENDS)}; {others[0]} shows beside a "
                         "servo: servotwin fit and servotwin validate mend it")
    return mends


def _check(files: Sequence[Path], out: Path | None, plot: Path | None, count: int, *, force: bool) -> list[Target]:
    """Return the files that are written, one of each kind for each log; none of them is there, or is read."""
    from servotwin.cli.output_files import Target, check_targets
    from servotwin.logs.sidecar import sidecar_path

    targets = []
    for k in range(count):
        if out is not None:
            file = _numbered(out, k, count)
            targets += [Target(option="--out", path=file, endings=(".csv",)),
                        Target(option="--out, its sidecar", path=sidecar_path(file), endings=(".json",))]
        if plot is not None:
            targets.append(Target(option="--plot", path=_numbered(plot, k, count), endings=(".png", ".svg", ".pdf")))
    inputs = [*files, *(sidecar_path(file) for file in files if sidecar_path(file).is_file())]
    check_targets(targets, force=force, inputs=inputs)
    return targets


def _numbered(path: Path, k: int, count: int) -> Path:
    """Return the name of the k-th of several files."""
    return path if count == 1 else path.with_name(f"{path.stem}-{k + 1}{path.suffix}")


def _write(found: Sequence[Survey], targets: Sequence[Target], *, force: bool) -> list[str]:
    from servotwin.cli.output_files import staged
    from servotwin.logs.csv_logs import log_bytes

    with patience("writing"), staged(targets, force=force) as drafts:
        each = len(targets) // len(found)
        for k, one in enumerate(found):
            own = list(zip(targets, drafts, strict=True))[k * each:(k + 1) * each]
            content, sidecar = log_bytes(_with_source(one.log)) if each > 1 else (b"", b"")
            for target, draft in own:
                if target.option == "--plot":
                    _draw(one, draft)
                else:
                    draft.write_bytes(content if target.option == "--out" else sidecar)
    return [str(target.path) for target in targets]


def _with_source(log: Log) -> Log:
    """Return a log whose source says what was mended in it."""
    remarks = () if log.reading is None else log.reading.remarks
    return replace(log, source=f"{log.source} ({'; '.join(remarks)})") if remarks else log


def _draw(found: Survey, draft: Path) -> None:
    from servotwin import plotting

    plotting.save(plotting.log_over_time(found.log, [(gap.at, gap.length) for gap in found.clock.gaps]), draft,
                  overwrite=True)
