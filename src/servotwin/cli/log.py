"""`servotwin log`: reads a log, mends it, and says what it holds, without a servo and without a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import log_reading
from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, patience, show
from servotwin.logs.mend_names import MENDS

if TYPE_CHECKING:
    from servotwin.cli.outputs import Target
    from servotwin.identification import Log
    from servotwin.identification.survey.survey import Survey

HELP = "Read a log, mend it, and say what it holds and lacks: clock, gaps, noise, counts, lag; no servo, no fit."
EPILOG = ("Example: servotwin log run.csv --mend torn,reset --out mended.csv --plot run.png\n\n"
          'Example: servotwin log lift0.txt --columns "1:ms 2:deg 3:A" --commanded 153deg@0s')


def log(
    files: Annotated[list[Path], typer.Argument(metavar="FILES", help=log_reading.HELP)],
    file_format: log_reading.FormatOption = "auto",
    columns: log_reading.ColumnsOption = None,
    joint: log_reading.JointOption = None,
    registers: log_reading.RegistersOption = None,
    rate: log_reading.RateOption = None,
    commanded: log_reading.CommandedOption = None,
    mend: Annotated[list[str] | None, typer.Option(
        metavar="KIND", help="What to mend of what is not certain: " + "; ".join(
            f"{name} {what}" for name, what in MENDS.items()) + "; repeatable or with commas.",
        rich_help_panel=log_reading.PANEL)] = None,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Write the mended log, in SI, and its sidecar.",
        rich_help_panel=shared.OUTPUT)] = None,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw it: .png, .svg or .pdf.", rich_help_panel=shared.OUTPUT)] = None,
    force: Annotated[bool, typer.Option(
        "--force", help="Replace existing files.", rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Say what a log holds and lacks."""
    from servotwin.cli.log_words import sections
    from servotwin.identification import read_logs
    from servotwin.identification.survey.survey import survey_of

    said, mends = log_reading.columns_said(columns, rate, commanded), _mends(mend)
    if out is not None or plot is not None:
        _check(files, out, plot, 1, force=force)
    with patience("reading"):
        logs = [one for path in files for one in read_logs(
            path, file_format, columns=said, joints=",".join(joint) if joint else None, mend=mends, unknown_step=True,
            registers=registers)]
        targets = _check(files, out, plot, len(logs), force=force)
        found = [survey_of(one) for one in logs]
    written = _write(found, targets, force=force)
    if as_json:
        emit_json({"logs": [one.facts for one in found], "files": written})
        return
    for k, one in enumerate(found):
        last = k == len(found) - 1
        show(*sections(one, written if last else ()), *([] if last else [""]))


def _mends(words: list[str] | None) -> tuple[str, ...]:
    """Return what the reader mends.

    Raises
    ------
    InputError
        If something is to be mended that only shows beside a servo.
    """
    from servotwin.cli.fit_words import kinds, reading_mends
    from servotwin.errors import InputError

    mends = reading_mends(words)
    if others := kinds(words):
        raise InputError("--mend", got=", ".join(others), allowed=f"{', '.join(MENDS)}; {others[0]} shows beside a "
                         "servo: servotwin fit and servotwin validate mend it")
    return mends


def _check(files: Sequence[Path], out: Path | None, plot: Path | None, count: int, *, force: bool) -> list[Target]:
    """Return the files that are written, one of each kind for each log; none of them is there, or is read."""
    from servotwin.cli.outputs import Target, check_targets
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
    from servotwin.cli.outputs import staged
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
