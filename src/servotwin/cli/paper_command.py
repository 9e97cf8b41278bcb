"""`servotwin paper`: the report that reproduces the paper."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from servotwin.cli.terminal import emit_json, pairs, show
from servotwin.errors import OutputError


def paper(
    out: Annotated[str, typer.Option(metavar="FOLDER", help="Folder for the report.")] = "paper-report",
    force: Annotated[bool, typer.Option("--force", help="Replace an existing report.")] = False,
    formats: Annotated[str, typer.Option(metavar="NAMES", help="Formats of the pictures: png,svg,pdf.")] = "png",
    as_json: Annotated[bool, typer.Option("--json", help="Print paths and headline numbers as JSON.")] = False,
) -> None:
    """Reproduce the paper's figures and tables in a report."""
    from servotwin.cli.interrupts import held
    from servotwin.paper import write_paper_report

    if not out.strip():
        raise OutputError("--out", got=out, allowed="the name of a folder")
    with _progress() as progress:
        report = write_paper_report(Path(out), force=force, formats=[name.strip() for name in formats.split(",")],
                                    progress=progress, moving=held)
    if as_json:
        emit_json({
            "folder": str(report.folder), "report": str(report.page),
            "figures": [str(path) for path in report.figures], "data": [str(path) for path in report.data],
            "numbers": dict(report.numbers), "left_out": report.left_out})
        return
    numbers = [(name, f"{value:.5g}") for name, value in report.numbers.items()]
    if report.left_out:
        warnings.warn(report.left_out, stacklevel=2)
    show(pairs([("report", str(report.page)),
                ("figures", f"{len(report.figures)} files in {report.folder / 'figures'}"),
                ("data", f"{len(report.data)} files in {report.folder / 'data'}")]),
         "headline numbers", pairs(numbers))


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """Show progress on standard error: a bar on a terminal, else a line for each part."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield _lines()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn(),
               TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda words, fraction: bar.update(task, description=words, completed=fraction)


def _lines() -> Callable[[str, float], None]:
    told: set[str] = set()

    def tell(words: str, fraction: float) -> None:
        if words not in told:
            told.add(words)
            typer.echo(f"{100.0 * fraction:3.0f} % {words}", err=True)

    return tell
