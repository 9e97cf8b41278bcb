"""The recorder: an experiment on a rig becomes a log, row by row, and the servo is limp at the end whatever happens."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from servotwin.bench.recording.experiment import Experiment
from servotwin.bench.recording.limits import CurrentGuard, Limits
from servotwin.bench.recording.rig import Rig
from servotwin.errors import BenchError, OutputError, OutputExistsError
from servotwin.logs.json_file import write_json
from servotwin.logs.sidecar import FORMAT, sidecar_path

_CURRENT = "supply_current_A"
_FRAME_PERIOD, _VOLTAGE = "electronics.frame_period", "supply.open_circuit_voltage"


@dataclass(frozen=True, kw_only=True)
class About:
    """What a log says of where it comes from.

    Parameters
    ----------
    servo : str
        Which one: maker and type, and which piece of it.
    licence : str
        Under which the log may be used.
    author : str
    note : str
    load : mapping, optional
        What hangs on the shaft, in the words of a sidecar: ``{"inertia": 1e-3}``.
    """

    servo: str
    licence: str = "not said"
    author: str = ""
    note: str = ""
    load: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Recorded:
    """What a run left.

    Parameters
    ----------
    path : Path
        The CSV file; its sidecar is beside it.
    rows : int
    duration : float
        Time of the last row [s].
    """

    path: Path
    rows: int
    duration: float


def record(rig: Rig, experiment: Experiment, path: str | Path, *, limits: Limits, about: About,
           watch: Callable[[Mapping[str, float]], None] | None = None, overwrite: bool = False) -> Recorded:
    """Run an experiment and write its log as it comes.

    Every row is on its way to the disk before the next one is asked for: what is cut off is what was not measured yet,
    and at most one torn line, which readers pass over. The servo is limp afterwards, also after an error or Ctrl-C.

    Parameters
    ----------
    rig : Rig
        Open.
    experiment : Experiment
    path : str or Path
        Ends in .csv; the sidecar gets the same name with .json.
    limits : Limits
    about : About
    watch : callable, optional
        Called with each row, by column; what it raises ends the run.
    overwrite : bool
        Replace files that are there.

    Raises
    ------
    InputError
        If the experiment goes beyond the limits, or the rig cannot do it.
    OutputExistsError, OutputError
        If a file is there, or cannot be written.
    BenchError
        If the wire is cut or the current is too large; says how many rows are kept.
    """
    path = Path(path)
    limits.check(experiment)
    _check(path, overwrite=overwrite)
    about_it = _sidecar(rig, experiment, limits, about)
    columns = tuple(rig.columns)
    guard, rows, last = CurrentGuard(limits.current), 0, 0.0
    try:
        rig.approach(experiment.holds[0].value or 0.0)
        with _file(path, overwrite=overwrite) as file:
            write_json(sidecar_path(path), about_it, overwrite=True)
            file.write(",".join(columns) + "\n")
            run = rig.run(experiment)
            try:
                for row in run:
                    file.write(",".join(map(_cell, row)) + "\n")
                    rows, last = rows + 1, row[0]
                    if _CURRENT in columns:
                        guard.look(row[0], row[columns.index(_CURRENT)])
                    if watch is not None:
                        watch(dict(zip(columns, row, strict=True)))
            finally:
                _close(run)
    except BenchError as error:
        kept = f"; {rows} rows are kept in {path}" if rows else ""
        raise BenchError(error.what, f"{error.problem}{kept}") from None
    finally:
        rig.limp()
        if rows:
            about_it["recorded"] |= {**rig.facts(), "rows": rows, "seconds": last,
                                     "complete": last >= experiment.duration - 2.0 * experiment.frame_period}
            write_json(sidecar_path(path), about_it, overwrite=True)
    return Recorded(path, rows, last)


def _sidecar(rig: Rig, experiment: Experiment, limits: Limits, about: About) -> dict[str, Any]:
    parameters = {_VOLTAGE: limits.voltage}
    if experiment.kind == "pulse_width":
        parameters[_FRAME_PERIOD] = experiment.frame_period
    said = {
        "format": FORMAT, "name": experiment.name, "motion": experiment.motion, "source": f"bench, {about.servo}",
        "conditions": {**experiment.conditions, "voltage_V": limits.voltage}, "load": dict(about.load),
        "parameters": parameters,
        "recorded": {
            "servo": about.servo, "author": about.author, "licence": about.licence, "note": about.note,
            "date": datetime.now(UTC).isoformat(timespec="seconds"), "complete": False,
            "limits": {"low": limits.low, "high": limits.high, "voltage_V": limits.voltage,
                       "current_A": limits.current}, **rig.facts()}}
    return {key: value for key, value in said.items() if value}


def _check(path: Path, *, overwrite: bool) -> None:
    if path.suffix != ".csv":
        raise OutputError(f"{path}", got=path.suffix or "no ending", allowed="a name that ends in .csv")
    for file in (path, sidecar_path(path)):
        if file.exists() and not overwrite:
            raise OutputExistsError(file)


@contextlib.contextmanager
def _file(path: Path, *, overwrite: bool) -> Iterator[IO[str]]:
    """Open the log so that each line goes to the system at once."""
    try:
        with path.open("w" if overwrite else "x", encoding="utf-8", newline="", buffering=1) as file:
            yield file
    except FileExistsError:
        raise OutputExistsError(path) from None
    except BenchError:
        raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror})") from None


def _close(run: Iterator[Sequence[float]]) -> None:
    close = getattr(run, "close", None)
    if close is not None:
        close()


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(value)
