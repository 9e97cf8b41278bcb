"""The recorder: an experiment on a rig becomes a log, row by row, and the servo is limp at the end whatever happens."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol, TypeVar

from servotwin.bench.recording.experiment import Experiment, Limits
from servotwin.errors import BenchError, OutputError, OutputExistsError
from servotwin.logs.sidecar import FORMAT, sidecar_path, write_json

if TYPE_CHECKING:
    from servotwin.bench.bus import Bus

# --- Limits of a servo on a bench, checked before anything moves ------------------------------------------------------

_WINDOW = 0.25  # s over which the current is averaged: a start draws the stall current for some tens of ms


class CurrentGuard:
    """Watches the supply current of a run.

    Parameters
    ----------
    limit : float
        [A]

    Examples
    --------
    >>> guard = CurrentGuard(1.0)
    >>> for k in range(300):
    ...     guard.look(k * 1e-3, 0.9)
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._seen: deque[tuple[float, float]] = deque()
        self._sum = 0.0

    def look(self, time: float, current: float) -> None:
        """Take one value [s, A]; nan is no value.

        Raises
        ------
        BenchError
            If the mean over the last 0.25 s is above the limit.
        """
        if current != current:
            return
        self._seen.append((time, current))
        self._sum += current
        while self._seen[0][0] < time - _WINDOW:
            self._sum -= self._seen.popleft()[1]
        full = time - self._seen[0][0] > 0.9 * _WINDOW
        if full and self._sum / len(self._seen) > self._limit:
            raise BenchError("supply current", f"{self._sum / len(self._seen):.3g} A in the mean of {_WINDOW:g} s, "
                                               f"above the limit of {self._limit:g} A")

# --- Sources of a recorder: a bench with its wires, whatever they are -------------------------------------------------

class Rig(Protocol):
    """A servo on a wire, with what measures it.

    It is safe to leave: `limp` may be called at any time, from any error, and never raises.
    """

    @property
    def kind(self) -> str:
        """The commands of an experiment for it: "pulse_width" or "angle"."""

    @property
    def columns(self) -> Sequence[str]:
        """Columns of its rows, named as those of a log: `time_s`, `pulse_width_us`, `feedback_voltage_V` and more."""

    def open(self) -> object:
        """Take the wire and look who is there; the servo is limp.

        Raises
        ------
        BenchError
            If nobody answers.
        """

    def facts(self) -> Mapping[str, Any]:
        """Return what the sidecar of a log says of it, in plain JSON: firmware, wiring, calibration, registers."""

    def approach(self, value: float) -> None:
        """Go to a command (SI) and wait until the servo stands, at most some seconds."""

    def run(self, experiment: Experiment) -> Iterator[Sequence[float]]:
        """Command an experiment and yield rows as they come, nan where nothing was measured; ends with it.

        The first row's time is 0 or close to it: the instant of the first command. Leaving the iterator early (its
        `close`) leaves the servo with the last command; the recorder calls `limp`.

        Raises
        ------
        BenchError
            If the wire is cut or does not answer.
        """

    def limp(self) -> None:
        """Let the servo go: no pulses, torque off. Never raises; where nobody hears, the bench does it by itself."""

    def close(self) -> None:
        """Give back the wire; the servo is limp then."""

# --- The recorder -----------------------------------------------------------------------------------------------------

Watch = Callable[[Mapping[str, float]], None]
T = TypeVar("T")
_CURRENTS = ("supply_current_A", "armature_current_A")  # a motor's is not the supply's, but where there is no other
_FRAME_PERIOD, _VOLTAGE = "electronics.frame_period", "supply.open_circuit_voltage"


@dataclass(frozen=True, kw_only=True)
class About:
    """The origin of a log.

    Parameters
    ----------
    servo : str
        Which one: maker and type, and which piece of it.
    licence : str
        Under which the log may be used.
    author : str
    note : str
    load : mapping, optional
        Load on the shaft, in the words of a sidecar: ``{"inertia": 1e-3}``.
    """

    servo: str
    licence: str = "not said"
    author: str = ""
    note: str = ""
    load: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Recorded:
    """The end of a run.

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
           watch: Watch | None = None, overwrite: bool = False) -> Recorded:
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
    log = _Log(Path(path), tuple(rig.columns), experiment, limits, about, rig.facts, watch)
    with _recording([log], rig.limp, overwrite=overwrite):
        rig.approach(experiment.holds[0].value or 0.0)
        log.begin(overwrite=overwrite)
        with _closed(rig.run(experiment)) as run:
            for row in run:
                log.add(row)
    return log.recorded


def record_bus(bus: Bus, experiment: Experiment, paths: Mapping[int, str | Path], *, limits: Limits,
               about: Mapping[int, About], watch: Watch | None = None, overwrite: bool = False) -> dict[int, Recorded]:
    """Run an experiment on several servos of a bus at once, and write a log of each.

    Parameters
    ----------
    bus : Bus
        Open.
    experiment : Experiment
        Of angles; all servos do the same.
    paths, about : mapping of int to path, About
        By the servo's id; those that are there take part.
    limits, watch, overwrite
        As of `record`; `watch` sees the rows of the first servo.

    Raises
    ------
    InputError, OutputExistsError, OutputError, BenchError
        As `record`.
    """
    from servotwin.bench.bus import columns_of

    logs = {one: _Log(Path(path), columns_of(bus, one), experiment, limits, about[one], partial(bus.facts, one),
                      watch if one == next(iter(paths)) else None) for one, path in paths.items()}
    with _recording(logs.values(), bus.limp, overwrite=overwrite):
        bus.approach(dict.fromkeys(logs, experiment.holds[0].value or 0.0))
        for log in logs.values():
            log.begin(overwrite=overwrite)
        with _closed(bus.run(dict.fromkeys(logs, experiment))) as run:
            for rows in run:
                for one, log in logs.items():
                    log.add(rows[one])
    return {one: log.recorded for one, log in logs.items()}


def watched_current(columns: Sequence[str]) -> str | None:
    """Return the column whose mean the current limit holds for, None where no current is measured.

    Examples
    --------
    >>> watched_current(["time_s", "armature_current_A"]), watched_current(["time_s"])
    ('armature_current_A', None)
    """
    return next((name for name in _CURRENTS if name in columns), None)


class _Log:
    """A log that is being written."""

    def __init__(self, path: Path, columns: Sequence[str], experiment: Experiment, limits: Limits, about: About,
                 facts: Callable[[], Mapping[str, Any]], watch: Watch | None) -> None:
        limits.check(experiment)
        self.path, self.columns, self._experiment = path, tuple(columns), experiment
        self._facts, self._watch = facts, watch
        self._said = _sidecar(path.stem, facts(), experiment, limits, about)
        self._guard, watched = CurrentGuard(limits.current), watched_current(self.columns)
        self._current = None if watched is None else self.columns.index(watched)
        self._file: IO[str] | None = None
        self._rows, self._last = 0, 0.0

    @property
    def recorded(self) -> Recorded:
        """Its values so far."""
        return Recorded(self.path, self._rows, self._last)

    def begin(self, *, overwrite: bool) -> None:
        """Make the files; each line goes to the system at once."""
        try:
            self._file = self.path.open("w" if overwrite else "x", encoding="utf-8", newline="", buffering=1)
            self._file.write(",".join(self.columns) + "\n")
        except FileExistsError:
            raise OutputExistsError(self.path) from None
        except OSError as error:
            raise OutputError(f"{self.path} cannot be written ({error.strerror})") from None
        write_json(sidecar_path(self.path), self._said, overwrite=True)

    def add(self, row: Sequence[float]) -> None:
        """Write a row, and look at it."""
        try:
            if self._file is not None:
                self._file.write(",".join(map(_cell, row)) + "\n")
        except OSError as error:
            raise OutputError(f"{self.path} cannot be written ({error.strerror})") from None
        self._rows, self._last = self._rows + 1, row[0]
        if self._current is not None:
            self._guard.look(row[0], abs(row[self._current]))
        if self._watch is not None:
            self._watch(dict(zip(self.columns, row, strict=True)))

    def end(self) -> None:
        """Close the file and say in the sidecar what there is."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.close()
            one = self._experiment
            self._said["recorded"] |= {**self._facts(), "rows": self._rows, "seconds": self._last,
                                       "complete": self._last >= one.duration - 2.0 * one.frame_period}
            write_json(sidecar_path(self.path), self._said, overwrite=True)


@contextlib.contextmanager
def _recording(logs: Collection[_Log], limp: Callable[[], None], *, overwrite: bool) -> Iterator[None]:
    """Check that the files may be made; let the servo go at the end, and close them, whatever happens."""
    for log in logs:
        _check(log.path, overwrite=overwrite)
    try:
        yield
    except BenchError as error:
        kept = [f"{log.recorded.rows} rows are kept in {log.path}" for log in logs if log.recorded.rows]
        raise BenchError(error.what, "; ".join([error.problem, *kept])) from None
    finally:
        limp()
        for log in logs:
            log.end()


@contextlib.contextmanager
def _closed(run: Iterator[T]) -> Iterator[Iterator[T]]:
    """Leave a run when it is left."""
    try:
        yield run
    finally:
        close = getattr(run, "close", None)
        if close is not None:
            close()


def _sidecar(name: str, facts: Mapping[str, Any], experiment: Experiment, limits: Limits,
             about: About) -> dict[str, Any]:
    parameters = {_VOLTAGE: limits.voltage}
    if experiment.kind == "pulse_width":
        parameters[_FRAME_PERIOD] = experiment.frame_period
    said = {
        "format": FORMAT, "name": name, "motion": experiment.motion,
        "conditions": {**experiment.conditions, "voltage_V": limits.voltage}, "load": dict(about.load),
        "parameters": parameters,
        "recorded": {
            "servo": about.servo, "author": about.author, "licence": about.licence, "note": about.note,
            "date": datetime.now(UTC).isoformat(timespec="seconds"), "complete": False,
            "limits": {"low": limits.low, "high": limits.high, "voltage_V": limits.voltage,
                       "current_A": limits.current}, **facts}}
    return {key: value for key, value in said.items() if value}


def _check(path: Path, *, overwrite: bool) -> None:
    if path.suffix != ".csv":
        raise OutputError(f"{path}", got=path.suffix or "no ending", allowed="a name that ends in .csv")
    for file in (path, sidecar_path(path)):
        if file.exists() and not overwrite:
            raise OutputExistsError(file)


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(value)
