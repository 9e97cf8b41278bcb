"""The result of a simulation: named signals, events, metrics and energy, and the ways out to files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import MissingExtraError, OutputError, SimulationError
from servotwin.look import escape, number, table
from servotwin.models.columns import Samples
from servotwin.models.outputs import SIGNALS
from servotwin.parameters import write_file
from servotwin.simulation.engine import HELD
from servotwin.simulation.metrics import (
    Energy,
    Least,
    StepMetrics,
    energy_of,
    holding_error,
    least,
    mean_current,
    peak,
    step_metrics,
)
from servotwin.simulation.remarks import Remark, Sag, remarks_of, sag_of
from servotwin.simulation.rest import Rest, rest_of
from servotwin.simulation.start import Status
from servotwin.simulation.trajectory import Trajectory
from servotwin.tables.columns import csv_text

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal
    from servotwin.simulation.engine import Event


# --- CSV files of signals: one header line, the unit of each column in its name, angles in degrees --------------------

# SI unit -> (suffix of the column, unit in the file, dimension)
_COLUMNS = {
    "s": ("s", "s", "time"), "V": ("V", "V", "voltage"), "A": ("A", "A", "current"),
    "rad": ("deg", "deg", "angle"), "rad/s": ("deg_per_s", "deg/s", "speed"), "N m": ("Nm", "N m", "torque"),
    "K": ("K", "K", "temperature"), "1": ("", "1", "number"),
}
_ROWS = 200_000  # that are held as text at once
_OWN = dict.fromkeys(("pulse_width", "error_time"), ("us", "us", "time"))


def save_csv(path: str | Path, signals: Mapping[str, NDArray[np.float64]], si_units: Mapping[str, str], *,
             overwrite: bool = False) -> None:
    """Write signals of one length to a CSV file; a failure leaves what was there untouched.

    Raises
    ------
    OutputExistsError
        If the file exists and `overwrite` is false.
    OutputError
        If it cannot be written.
    """
    write_file(path, lambda file: write_csv(file, signals, si_units), overwrite=overwrite)


def write_csv(out: Path | TextIO, signals: Mapping[str, NDArray[np.float64]], si_units: Mapping[str, str]) -> None:
    """Write signals of one length to a file or a stream of text.

    Examples
    --------
    >>> import io
    >>> out = io.StringIO()
    >>> write_csv(out, {"output_angle": np.array([np.pi])}, {"output_angle": "rad"})
    >>> out.getvalue().split()
    ['output_angle_deg', '180']
    """
    shown = shown_columns(signals, si_units)
    head = csv_text({name: () for name in shown}).rstrip("\n")
    np.savetxt(out, np.column_stack(list(shown.values())), fmt="%.12g", delimiter=",", header=head, comments="",
               encoding="utf-8")


def shown_columns(signals: Mapping[str, NDArray[Any]], si_units: Mapping[str, str]) -> dict[str, NDArray[Any]]:
    """Return signals as columns of a file: in the units of people, which the names say.

    Examples
    --------
    >>> shown_columns({"output_angle": np.array([np.pi])}, {"output_angle": "rad"})
    {'output_angle_deg': array([180.])}
    """
    found = {}
    for name, values in signals.items():
        suffix, unit, dimension = _OWN.get(name) or _COLUMNS[si_units[name]]
        signless = np.asarray(units.from_si(values, unit, dimension)) + 0.0  # -0 becomes 0
        found[f"{name}_{suffix}" if suffix else name] = signless
    return found


def save_lanes(path: str | Path, time: NDArray[np.float64], signals: Mapping[str, NDArray[Any]],
               si_units: Mapping[str, str], of_lanes: Mapping[str, NDArray[Any]], *, what: str,
               overwrite: bool = False) -> None:
    """Write signals of many lanes, one row for each lane and time, as CSV or Parquet.

    Parameters
    ----------
    path : str or Path
        Ends in .csv or .parquet.
    time : ndarray, shape (T,)
    signals : mapping of str to ndarray, shape (B, T)
    si_units : mapping
        Of `time` and the signals.
    of_lanes : mapping of str to ndarray, shape (B,)
        Number or name of each lane, and what else differs from lane to lane.
    what : str
        Content of the file, for errors.
    overwrite : bool

    Raises
    ------
    OutputExistsError
        If the file exists and `overwrite` is false.
    OutputError
        If it cannot be written, or its name ends otherwise.
    MissingExtraError
        If Parquet is asked for and pyarrow is not installed.
    """
    from servotwin.tables.columns import FORMATS, check_format, encoded

    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in FORMATS:
        raise OutputError(f"file of {what}", got=str(path), allowed="a name that ends in .csv or .parquet")
    check_format(ending)
    lanes, times = next(iter(signals.values())).shape

    def rows(first: int, last: int) -> dict[str, NDArray[Any]]:
        flat = {"time": np.tile(time, last - first), **{name: x[first:last].ravel() for name, x in signals.items()}}
        return {**{name: np.repeat(column[first:last], times) for name, column in of_lanes.items()},
                **shown_columns(flat, si_units)}

    def write(file: Path) -> None:
        if ending == "parquet":
            file.write_bytes(encoded(rows(0, lanes), ending))
            return
        step = max(1, _ROWS // times)
        with file.open("wb") as stream:
            for first in range(0, lanes, step):
                text = encoded(rows(first, min(first + step, lanes)), ending)
                stream.write(text if first == 0 else text[text.index(b"\n") + 1:])

    write_file(path, write, overwrite=overwrite)


# --- The result of a simulation: named signals, events, metrics and energy, and the ways out to files -----------------

@dataclass(frozen=True)
class Stats:
    """How the solution was found: method, number of motions and of events.

    `held` is how often motor and output, that parted and met in no time, were kept together until the inputs changed.
    """

    method: str
    motions: int
    events: int
    held: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """The outcome of a simulation; signals are computed when they are asked for.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Output times [s].
    events : tuple of Event
        (time [s], kind, output angle [rad]) in order.
    status : Status
        How it ended; `cause` says it in words, `ended` when [s].

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> result = st.simulate(model, st.signals.step(0.0, 90.0, unit="deg"), duration=1.0, output_step=0.1)
    >>> result["output_angle"].shape, result.units["output_angle"], result.status.ok
    ((11,), 'rad', True)
    """

    model: Model
    command: Signal
    load: Load
    drive: Pieces = field(repr=False)
    time: NDArray[np.float64] = field(repr=False)
    trajectory: Trajectory = field(repr=False)
    events: tuple[Event, ...] = field(repr=False)
    status: Status
    ended: float
    cause: str

    def __repr__(self) -> str:
        return f"Result({self.model!r}, {self.ended:g} s, {self.status.name}, {len(self.time)} times)"

    def _repr_html_(self) -> str:
        """Return what the run came to, as notebooks show it."""
        angle, events = self.model.layout[0], len(self.events)
        rows = [["status", escape(f"{self.status.message}, {self.ended:g} s")],
                *(["remark", escape(remark.words)] for remark in self.remarks),
                [f"<code>{angle}</code> at the end", f"{number(float(self.at(angle, [self.ended])[0]))} rad"],
                ["solved", escape(f"{self.stats.method}, {self.stats.motions} motions, {events} events")],
                ["signals", ", ".join(f"<code>{name}</code>" for name in self.names)]]
        return table(["", ""], rows, caption=escape(repr(self.model)), text_columns=2)

    @property
    def _signals(self) -> tuple[str, ...]:
        return self.model.signals_with(self.load)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all signals, `time` first."""
        return ("time", *self._signals)

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of each signal."""
        return {"time": "s", **{name: SIGNALS[name].unit for name in self._signals}}

    @cached_property
    def _samples(self) -> Samples:
        return self.trajectory.at(self.time)

    @cached_property
    def _computed(self) -> dict[str, NDArray[np.float64]]:
        return {}

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a signal (SI), shape (n,); KeyError with the names that there are, if it is none of them."""
        if name not in self._computed:
            values = self._signal(name, self._samples)
            values.setflags(write=False)
            self._computed[name] = values
        return self._computed[name]

    def keep(self, name: str, values: NDArray[np.float64]) -> None:
        """Take the values of a signal (SI) at the output times as given; not to be written to afterwards."""
        self._computed[name] = values

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def _signal(self, name: str, samples: Samples) -> NDArray[np.float64]:
        values = np.array(self.model.output(name, samples, self.drive, self.load), dtype=np.float64)
        return np.where(samples.time > self.ended, np.nan, values) if not self.status.ok else values

    def at(self, name: str, time: ArrayLike) -> NDArray[np.float64]:
        """Return a signal (SI) of the continuous solution at any `time` [s], shape (m,)."""
        t = np.atleast_1d(np.asarray(time, dtype=np.float64))
        return self._signal(name, self.trajectory.at(t))

    def raise_if_failed(self) -> Result:
        """Return the result itself, or raise SimulationError if the run ended before its time."""
        if not self.status.ok:
            raise SimulationError(self.status.name, self.ended, self.cause)
        return self

    @cached_property
    def stats(self) -> Stats:
        """How the solution was found."""
        steps = self.trajectory.segments.integrated
        method = "closed form" if not steps.any() else "integrated" if steps.all() else "closed form and integrated"
        return Stats(method, len(steps), len(self.events), sum(event.kind == HELD for event in self.events))

    @cached_property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on a completed run, (kind, time [s]): refused pulses, a stop, a heavy load, no rest."""
        return remarks_of(self)

    @cached_property
    def sag(self) -> Sag | None:
        """How far the supply fell; None where it stayed as it is, or the model has none."""
        if self.trajectory.bus is not None:
            return self.trajectory.bus.sag
        if "bus_voltage" not in self._signals:
            return None
        return sag_of([self.trajectory], self._shown("bus_voltage"), self.model.servo.supply)

    def _shown(self, name: str) -> Callable[[Samples], NDArray[np.float64]]:
        return lambda samples: self.model.output(name, samples, self.drive, self.load)

    def least(self, name: str) -> Least:
        """Return the least value of a signal (SI) over the whole continuous solution, and when it came first [s]."""
        return least(self.trajectory, self._shown(name))

    @cached_property
    def rest(self) -> Rest | None:
        """The servo at the end, where command and load stand still; None where that is under half a second."""
        return rest_of(self)

    @cached_property
    def energy(self) -> Energy:
        """Energy balance over the whole run [J], from the continuous solution."""
        return energy_of(self.model, self.trajectory, self.drive, self.load)

    def peak(self, name: str) -> float:
        """Return the largest magnitude of a signal (SI) over the whole continuous solution."""
        return peak(self.trajectory, self._shown(name))

    def mean(self, name: str, since: float = 0.0) -> float:
        """Return the mean over time of a signal (SI), from `since` [s] to the end of the continuous solution."""
        part = self.trajectory.since(since)
        whole = part.integral(lambda samples: self.model.output(name, samples, self.drive, self.load)[None, :])
        return float(whole[0]) / (self.ended - since)

    @property
    def mean_current(self) -> float:
        """Mean current of the supply [A]; of a model without one, that of the motor regardless of its sign."""
        return mean_current(self)

    @property
    def holding_error(self) -> float:
        """Command less angle in the mean of the last tenth of a second; nan where the command moves there [rad]."""
        return holding_error(self)

    def step_metrics(self) -> StepMetrics:
        """Return rise, settling and arrival time, overshoot, steady error, slew rate and peak current of a step.

        Raises
        ------
        InputError
            If the command is no step, or the run did not reach its end.
        """
        return step_metrics(self)

    def to_dataframe(self) -> pd.DataFrame:
        """Return all signals (SI) as a pandas DataFrame, indexed by time [s]."""
        try:
            import pandas as pd
        except ImportError:
            raise MissingExtraError("pandas", "data") from None
        frame = pd.DataFrame({name: self[name] for name in self._signals},
                             index=pd.Index(self.time, name="time"))
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Return all signals (SI) as an xarray Dataset over the dimension `time`, with units."""
        try:
            import xarray as xr
        except ImportError:
            raise MissingExtraError("xarray", "data") from None
        data = {name: ("time", self[name], {"units": self.units[name], "long_name": SIGNALS[name].meaning})
                for name in self._signals}
        return xr.Dataset(data, coords={"time": ("time", self.time, {"units": "s"})},
                          attrs={"model": type(self.model).__name__, "servo": self.model.servo.name})

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write all signals to a CSV file, the unit of each in its column name.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        save_csv(path, {name: self[name] for name in self.names}, self.units, overwrite=overwrite)
