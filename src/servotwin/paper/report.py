"""The report of the paper: all its figures and tables, computed again."""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import secrets
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.errors import OutputError, OutputExistsError
from servotwin.look import FORMATS
from servotwin.paper.reproduction import PaperStudy, headline_numbers, run_study
from servotwin.parameters.output_file import undone
from servotwin.tables import csv_text

if TYPE_CHECKING:
    from servotwin.paper.page import RobotsPart

_PAGE = "report.html"
_ROBOTS = ("import pickle, sys; from servotwin.paper.page import robots_part; "
           "pickle.dump(robots_part(sys.argv[1:]), sys.stdout.buffer)")
_TABLES = ("table-2.csv", "fits.csv", "parameters.csv")


@dataclass(frozen=True, kw_only=True)
class PaperReport:
    """The written files.

    Parameters
    ----------
    folder : Path
    page : Path
        The report itself, one HTML file that needs no other.
    figures, data : tuple of Path
        Pictures, and CSV files.
    numbers : mapping
        Headline numbers, the unit in each name.
    left_out : str
        Extra that is missing for a part of the report, and that part; empty where none is.
    """

    folder: Path
    page: Path
    figures: tuple[Path, ...]
    data: tuple[Path, ...]
    numbers: Mapping[str, float]
    left_out: str = ""


def write_paper_report(out: Path, *, force: bool, formats: Sequence[str] = ("png",),
                       progress: Callable[[str, float], None] | None = None,
                       moving: Callable[[], AbstractContextManager[None]] = contextlib.nullcontext) -> PaperReport:
    """Compute and write the report of the paper into a folder.

    Everything is made in a folder of its own first and moved into place when it is complete, so nothing is ever
    half written. Files that are not of the report are left alone.

    Parameters
    ----------
    out : Path
        The folder; made if missing.
    force : bool
        Whether a report that is there already may be replaced.
    formats : sequence of str
        Of the files with pictures: "svg" and "pdf" beside "png", which the page itself shows.
    progress : callable, optional
        Called with words and the fraction that is done, 0 to 1.
    moving : callable
        Gives what the files are moved into place within: a command line lets interrupts wait there.

    Raises
    ------
    OutputExistsError
        If there is a report already and `force` is false; nothing is computed then.
    OutputError
        If the folder cannot be made or written, or a format is unknown.
    """
    tell = progress or _silent
    for name in formats:
        if name not in FORMATS:
            raise OutputError("format of a picture", got=name, allowed=", ".join(FORMATS))
    out = Path(out)
    _check_free(out, force)
    made = [path for path in (out, *out.parents) if not path.exists()]
    partial = out / f".partial-{secrets.token_hex(8)}"
    with undone(lambda: _remove_empty(made)), undone(lambda: shutil.rmtree(partial, ignore_errors=True)):
        _make(out)
        try:
            partial.mkdir(0o700)
            numbers, left_out = _write_all(partial, tuple(dict.fromkeys(("png", *formats))), tell)
            with moving():
                names = _move(partial, out)
        except OSError as error:
            raise OutputError(f"{out} cannot be written ({error.strerror})") from None
    tell("done", 1.0)
    return PaperReport(
        folder=out, page=out / _PAGE, numbers=numbers, left_out=left_out,
        figures=tuple(out / name for name in names if name.parts[0] == "figures"),
        data=tuple(out / name for name in names if name.parts[0] == "data"))


def _silent(words: str, fraction: float) -> None:
    """Tell nobody."""


def _check_free(out: Path, force: bool) -> None:
    """Raise if there is a report already."""
    if not force:
        there = [out / _PAGE, *(out / "data" / name for name in _TABLES)]
        there += [*out.glob("figures/figure-*"), *out.glob("data/figure-*")] if out.is_dir() else []
        for path in there:
            if path.exists():
                raise OutputExistsError(path)


def _make(out: Path) -> None:
    """Make the folder."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "a file is in its place" if isinstance(error, FileExistsError) else error.strerror
        raise OutputError(f"{out} cannot be made as a folder ({reason})") from None


def _remove_empty(folders: Sequence[Path]) -> None:
    """Remove folders that were made and stayed empty."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def _write_all(folder: Path, formats: Sequence[str],
               tell: Callable[[str, float], None]) -> tuple[dict[str, float], str]:
    """Write everything; return headline numbers, and what is left out."""
    from servotwin.paper import figures
    from servotwin.paper.page import page, vibration_pictures

    with _robots_aside(formats) as robots_part:
        study = run_study(tell)
        pictures = (*figures.pictures(study, lambda done: tell("drawing", 0.35 + 0.2 * done)),
                    *vibration_pictures(study))
        drawings = []
        for k, picture in enumerate(pictures):
            tell(f"writing {picture.name}", 0.55 + 0.3 * k / len(pictures))
            drawings.append(picture.drawn(formats))
        tell("waiting for robots that do short tasks", 0.88)
        robots = robots_part()
    drawings += robots.drawings
    (folder / "figures").mkdir()
    (folder / "data").mkdir()
    for drawn in drawings:
        for name, content in drawn.files.items():
            (folder / "figures" / f"{drawn.name}.{name}").write_bytes(content)
        if drawn.columns:
            _write_csv(folder / "data" / f"{drawn.name}.csv", drawn.columns)
    _write_tables(folder / "data", study)
    tell("writing the page", 0.92)
    (folder / _PAGE).write_text(page(study, robots, drawings), encoding="utf-8", newline="\n")
    left_out = f"figures 28 to 30 are left out: {robots.left_out}" if robots.left_out else ""
    return headline_numbers(study) | dict(robots.headline), left_out


@contextlib.contextmanager
def _robots_aside(formats: Sequence[str]) -> Iterator[Callable[[], RobotsPart]]:
    """Let the robots do their tasks in a process of their own; what is given waits for it.

    Where there can be no such process, or it does not come to its end, they do them here.
    """
    command, process = [sys.executable, "-c", _ROBOTS, *formats], None
    with contextlib.suppress(OSError):
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        yield lambda: _robots_of(process, formats)
    finally:
        if process is not None:
            with process:  # which waits for its end
                process.kill()


def _robots_of(process: subprocess.Popen[bytes] | None, formats: Sequence[str]) -> RobotsPart:
    if process is not None:
        content, _ = process.communicate()
        if process.returncode == 0:
            part: RobotsPart = pickle.loads(content)
            return part
    from servotwin.paper.page import robots_part

    return robots_part(formats)


def _move(partial: Path, out: Path) -> list[Path]:
    """Move every file into place, the page last, and return their names; pictures of an older report go."""
    names = sorted(path.relative_to(partial) for path in partial.rglob("*") if path.is_file())
    names.sort(key=lambda name: name == Path(_PAGE))
    for folder in ("figures", "data"):
        (out / folder).mkdir(exist_ok=True)
    for name in names:
        os.replace(partial / name, out / name)
    for path in out.glob("figures/figure-*"):
        if path.suffix[1:] in FORMATS and path.relative_to(out) not in names:
            path.unlink()
    return names


def _write_csv(path: Path, columns: Mapping[str, Sequence[float] | Sequence[str]]) -> None:
    path.write_bytes(csv_text(columns, digits=9).encode())


def _write_tables(folder: Path, study: PaperStudy) -> None:
    columns: dict[str, Sequence[float]] = {f"measured_{name}": c.tolist() for name, c in study.table.items()}
    for model, one in study.on_bench.items():
        readings = [row.reading for row in one.rows]
        columns |= {
            f"{model}_q_deg": [math.degrees(r.output_angle) for r in readings],
            f"{model}_standing_band_deg": [math.degrees(row.standing_band) for row in one.rows],
            f"{model}_ADC_i": [float(r.command_count) for r in readings],
            f"{model}_t_a_us": [1e6 * r.pulse_width for r in readings],
            f"{model}_f_Hz": [r.pulse_rate for r in readings],
            f"{model}_V_o_V": [r.feedback_voltage for r in readings],
            f"{model}_ADC_o": [float(r.feedback_count) for r in readings]}
    _write_csv(folder / "table-2.csv", columns)
    fits = study.fits.values()
    _write_csv(folder / "fits.csv", {
        "fit": [fit.name for fit in fits], "slope": [fit.line.slope for fit in fits],
        "slope_error": [fit.line.slope_error for fit in fits], "slope_unit": [fit.slope_unit for fit in fits],
        "offset": [fit.line.intercept for fit in fits], "offset_error": [fit.line.intercept_error for fit in fits],
        "largest_residual": [fit.line.max_residual for fit in fits], "unit": [fit.unit for fit in fits],
        "parabola_F": [fit.curvature.f_value for fit in fits], "parabola_p": [fit.curvature.p_value for fit in fits]})
    names = study.servo.names()
    sources = [study.servo.source(name) for name in names]
    _write_csv(folder / "parameters.csv", {
        "parameter": list(names), "value": [str(q.value) for q in sources], "unit": [q.unit for q in sources],
        "origin": [q.origin for q in sources], "source": [q.source or "" for q in sources],
        **{key: ["" if getattr(q, key) is None else f"{getattr(q, key):.9g}" for q in sources]
           for key in ("std", "lower", "upper")}})
