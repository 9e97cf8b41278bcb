"""`servotwin bench record` with one servo at a board, or several on a bus."""

from __future__ import annotations

import contextlib
import math
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from servotwin.errors import BenchError, OutputError, OutputExistsError, UnknownNameError

if TYPE_CHECKING:
    from servotwin.bench.bus import Bus
    from servotwin.bench.recording import About, AnalogRig, Experiment, Limits, Recorded
    from servotwin.bench.recording.recorder import Watch as Watching


# --- A plot in the terminal while a log is recorded -------------------------------------------------------------------

_SHOWN = 6.0  # s of the run
_PAUSE = 0.2  # s between two pictures
_ROWS = 14
_COMMANDS = ("pulse_width_us", "command_angle_deg")
_ANSWERS = ("output_angle_deg", "feedback_voltage_V")
_NUMBERS = ("supply_current_A", "armature_current_A", "bus_voltage_V", "housing_temperature_K")

Watch = Callable[[Mapping[str, float]], None]


@contextlib.contextmanager
def live_plot(name: str) -> Iterator[Watch]:
    """Give a function that takes rows and shows the last seconds of command and answer; elsewhere it does nothing."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda row: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console(stderr=True)
    rows: deque[Mapping[str, float]] = deque()
    last = 0.0
    with Live(console=console, auto_refresh=False, transient=True) as live:

        def watch(row: Mapping[str, float]) -> None:
            nonlocal last
            rows.append(row)
            while rows[0]["time_s"] < row["time_s"] - _SHOWN:
                rows.popleft()
            if time.monotonic() - last > _PAUSE:
                last = time.monotonic()
                live.update(Text.from_ansi(picture(name, list(rows), min(console.width, 100))), refresh=True)

        yield watch


def picture(name: str, rows: list[Mapping[str, float]], width: int) -> str:
    """Return command and answer over time as text.

    Examples
    --------
    >>> rows = [{"time_s": 0.1 * k, "pulse_width_us": 1500.0, "feedback_voltage_V": 1.0 + k} for k in range(9)]
    >>> "feedback_voltage_V" in picture("step", rows, 60)
    True
    """
    import plotext

    plotext.clear_figure()
    plotext.theme("clear")
    plotext.plotsize(width, _ROWS)
    command = next((one for one in _COMMANDS if one in rows[0]), None)
    answer = next((one for one in _ANSWERS if one in rows[0]), None)
    for column, side in ((command, "left"), (answer, "right")):
        points = [(row["time_s"], row[column]) for row in rows if column and not math.isnan(row[column])]
        if points and column:
            plotext.plot(*map(list, zip(*points, strict=True)), label=column, yside=side, marker="braille",
                         color="blue" if side == "left" else "orange")
    numbers = [f"{column} {found[-1]:.3g}" for column in _NUMBERS
               if (found := [row[column] for row in rows if column in row and not math.isnan(row[column])])]
    plotext.title("   ".join([f"{name}, {rows[-1]['time_s']:.1f} s", *numbers]))
    plotext.xlabel("time_s")
    return str(plotext.build())


# --- `servotwin bench record` with one servo at a board, or several on a bus ------------------------------------------

_BUSES = ("feetech", "dynamixel")
_LOOK, _END = 0.1, 1023  # s over which the supply is read; the last count
_ALIKE = 0.05  # of the voltage: divider and meter of 1 % each, and rounding; assumed


def bus_of(family: str, port: str, ids: Sequence[int], baud: int | None, period: float) -> Bus:
    """Return the bus with the servos of these numbers, or with the only one that answers."""
    from servotwin.bench.backends import SerialBackend
    from servotwin.bench.bus import BAUDS, IDS, Bus, scan
    from servotwin.cli.terminal import patience

    if family not in _BUSES:
        raise UnknownNameError("bus", family, _BUSES)
    with patience("looking for servos"):
        found = [one for one in scan(port, bauds=BAUDS if baud is None else [baud], ids=ids or IDS)
                 if one.protocol.startswith(family) and (not ids or one.id in ids)]
    missing = [str(one) for one in ids if one not in [servo.id for servo in found]]
    if not found or missing or (not ids and len(found) > 1):
        names = ", ".join(f"{one.id} ({one.model.name if one.model else one.number})" for one in found)
        raise BenchError(f"port {port}", f"no answer from servo {', '.join(missing)}" if missing
                         else f"{names}; --id says which" if names else "no servo answers (power, wiring, --baud?)")
    first = found[0]
    return Bus(SerialBackend(port, first.baud), first.protocol, [one.id for one in found], rate=1.0 / period,
               baud=first.baud)


@dataclass(frozen=True)
class Files:
    """Where logs go, and what they say of themselves."""

    out: Path
    limits: Limits
    about: About
    force: bool

    def path(self, one: Experiment, servo: int | None = None) -> Path:
        """Return the log of an experiment, and of one of several servos."""
        return self.out / f"{one.name}{'' if servo is None else f'_{servo}'}.csv"

    def check(self, made: Sequence[Experiment], ids: Sequence[int]) -> None:
        """See that nothing is there yet."""
        if self.out.exists() and not self.out.is_dir():
            raise OutputError(f"--out {self.out} is no folder")
        for path in (self.path(one, servo) for one in made for servo in (ids if len(ids) > 1 else [None])):
            if path.exists() and not self.force:
                raise OutputExistsError(path)

    @contextlib.contextmanager
    def made(self) -> Iterator[None]:
        """Make the folder, and take it away again if nothing came into it."""
        new = [folder for folder in (self.out, *self.out.parents) if not folder.exists()]
        try:
            self.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"--out {self.out} cannot be made ({error.strerror})") from None
        try:
            yield
        finally:
            with contextlib.suppress(OSError):  # one that is not empty stays
                for folder in new:
                    folder.rmdir()


class Job(Protocol):
    """A bench that is recorded from."""

    def open(self) -> str:
        """Take the wire; return what is to be said of it, mostly nothing."""

    def limp(self) -> None:
        """Let all servos go."""

    def close(self) -> None:
        """Give the wire back."""

    def facts(self) -> Mapping[str, Any]:
        """Return what is known of the bench."""

    def record(self, one: Experiment, watch: Watching) -> list[Recorded]:
        """Run an experiment; return its logs."""


class OneServo:
    """A rig."""

    def __init__(self, rig: AnalogRig, files: Files) -> None:
        self._rig, self._files = rig, files
        self.limp, self.close, self.facts = rig.limp, rig.close, rig.facts

    def open(self) -> str:
        """Take the wire."""
        self._rig.open()
        return _unwatched(self._rig.columns) or self._otherwise()

    def _otherwise(self) -> str:
        """Return what the wires say otherwise than the user: of the supply, or of the largest current they can show."""
        import statistics

        wiring, limits = self._rig.wiring, self._files.limits
        most = wiring.value("shunt", _END)
        if "shunt" in wiring.channels and limits.current >= most:
            return f"--current-limit {limits.current:g} A cannot end a run: the shunt's channel ends at {most:.3g} A"
        if "supply" in wiring.channels:
            seen = wiring.value("supply", statistics.fmean(self._rig.measure(_LOOK)["supply"]))
            if abs(seen - limits.voltage) > _ALIKE * limits.voltage:
                return (f"the supply reads {seen:.2f} V, and --voltage says {limits.voltage:g} V, which the logs will "
                        "say too")
        return ""

    def record(self, one: Experiment, watch: Watching) -> list[Recorded]:
        """Run an experiment."""
        from servotwin.bench.recording import record

        files = self._files
        return [record(self._rig, one, files.path(one), limits=files.limits, about=files.about, watch=watch,
                       overwrite=files.force)]


class SeveralServos:
    """Servos on a bus."""

    def __init__(self, bus: Bus, files: Files) -> None:
        self._bus, self._files = bus, files
        self.limp, self.close = bus.limp, bus.close

    def open(self) -> str:
        """Take the wire."""
        from servotwin.bench.bus import columns_of

        self._bus.open()
        return next(filter(None, (_unwatched(columns_of(self._bus, one)) for one in self._bus.ids)), "")

    def facts(self) -> Mapping[str, Any]:
        """Return what is known of each servo and its wire."""
        return {str(one): self._bus.facts(one) for one in self._bus.ids}

    def record(self, one: Experiment, watch: Watching) -> list[Recorded]:
        """Run an experiment."""
        from servotwin.bench.recording import record_bus

        files, ids = self._files, self._bus.ids
        paths = {servo: files.path(one, servo if len(ids) > 1 else None) for servo in ids}
        about = {servo: replace(files.about, servo=f"{files.about.servo}, id {servo}") for servo in ids}
        return list(record_bus(self._bus, one, paths, limits=files.limits, about=about, watch=watch,
                               overwrite=files.force).values())


def _unwatched(columns: Sequence[str]) -> str:
    from servotwin.bench.recording import watched_current

    return "" if watched_current(columns) else "no current is measured here: --current-limit cannot end a run"


def recorded(job: Job, made: Sequence[Experiment]) -> list[Recorded]:
    """Record all; Ctrl-C ends the one under way, whose rows are kept, and lets the servo go."""
    from servotwin.cli.interrupts import finishing
    from servotwin.parameters.output_file import undone

    found: list[Recorded] = []
    with contextlib.closing(job), undone(job.limp), finishing() as check:
        remark = job.open()
        if remark:
            warnings.warn(remark, stacklevel=2)
        for one in made:
            with live_plot(one.name) as watch:

                def look(row: Any, watch: Any = watch) -> None:
                    check()
                    watch(row)

                found += job.record(one, look)
            check()
    return found
