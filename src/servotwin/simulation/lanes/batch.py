"""The result of `simulate_many`: signals of all lanes, how each ended, and each lane as a result of its own."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex, overload

import numpy as np

from servotwin.errors import SimulationError, UnknownNameError
from servotwin.models.outputs import SIGNALS
from servotwin.simulation import frames, result
from servotwin.simulation.lanes.forms import KERNELS
from servotwin.simulation.remarks import LaneRemark
from servotwin.simulation.simulator import Simulator, simulated
from servotwin.simulation.start import Status

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from servotwin.simulation.lanes.inputs import LaneInputs
    from servotwin.simulation.result import Result


class Failure(NamedTuple):
    """A lane that ended before its time: its number, when [s], and why."""

    lane: int
    time: float
    cause: str


class BatchStats(NamedTuple):
    """How lanes ran: the name of the kernels of each, shape (B,), as `docs/theory/engine.md` has them.

    Where nothing is compiled the same text runs in plain Python, all lanes by the general kernels.
    """

    kernel: NDArray[np.str_]


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """The outcome of many simulations; a sequence of lanes, and a mapping of signals.

    Parameters
    ----------
    time : ndarray, shape (T,)
        Output times [s].
    status : ndarray of int8, shape (B,)
        How each lane ended: the code of a `Status`, 0 where it reached the end.
    failures : tuple of Failure
        (lane, time [s], cause) of those that did not; their signals are nan from there on.
    remarks : tuple of LaneRemark
        (lane, kind, time [s]) of what is to be said of those that did, as `Result.remarks`.
    duration : float
        [s]

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> batch = st.simulate_many(model, st.signals.step(0.0, 60.0, unit="deg"), duration=1.0,
    ...                          parameters={"load.inertia": [0.0, 1e-3, 2e-3]}, output_step=0.1)
    >>> batch["output_angle"].shape, len(batch), batch.ok
    ((3, 11), 3, True)
    >>> batch[2].step_metrics().rise_time > batch[0].step_metrics().rise_time
    True
    """

    time: NDArray[np.float64]
    status: NDArray[np.int8]
    failures: tuple[Failure, ...]
    remarks: tuple[LaneRemark, ...]
    duration: float
    signals: Mapping[str, NDArray[np.floating]]
    lanes: LaneInputs
    run_by: NDArray[np.int8]
    lowest: NDArray[np.float64]

    def __repr__(self) -> str:
        return (f"Batch({self.lanes.model!r}, lanes={len(self)}, times={len(self.time)}, "
                f"signals={tuple(self.signals)}, failures={len(self.failures)}, remarks={len(self.remarks)})")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the signals that were asked for, `time` first."""
        return ("time", *self.signals)

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of each signal."""
        return {"time": "s", **{name: SIGNALS[name].unit for name in self.signals}}

    @property
    def ok(self) -> bool:
        """Whether all lanes reached their end."""
        return not self.failures

    @property
    def stats(self) -> BatchStats:
        """How the lanes ran.

        Examples
        --------
        >>> import servotwin as st
        >>> batch = st.simulate_many(st.DigitalServo(st.load_servo("feetech-sts3215-12v")),
        ...                          st.signals.constant(20.0, unit="deg"), duration=0.1)
        >>> batch.stats.kernel.tolist()
        ['digital']
        """
        return BatchStats(np.array(KERNELS)[self.run_by])

    @property
    def lowest_voltage(self) -> NDArray[np.float64]:
        """The least voltage of each lane's supply [V], and when it came [s], shape (2, B).

        It is that of all instants, between outputs too; where it lies flat, to 1e-6 V, the time is that of its
        beginning. nan without `watch_supply`.
        """
        return self.lowest.T

    def __len__(self) -> int:
        """Return the number of lanes."""
        return len(self.status)

    def __iter__(self) -> Iterator[Result]:
        return (self._lane(lane) for lane in range(len(self)))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    @overload
    def __getitem__(self, item: str) -> NDArray[np.floating]: ...
    @overload
    def __getitem__(self, item: SupportsIndex) -> Result: ...
    def __getitem__(self, item: str | SupportsIndex) -> NDArray[np.floating] | Result:
        """Return a signal (SI) of all lanes, shape (B, T), or a lane as a `Result`.

        A lane is simulated again, alone, which gives its events, metrics, energy and all signals; the signals that
        were asked for are those of the batch.
        """
        if isinstance(item, str):
            if item == "time":
                return self.time
            if item not in self.signals:
                raise UnknownNameError("signal of the batch", item, self.names)
            return self.signals[item]
        lane = operator.index(item)
        if not -len(self) <= lane < len(self):
            raise IndexError(f"lane {lane}: the batch has {len(self)}")
        return self._lane(lane % len(self))

    def _lane(self, lane: int) -> Result:
        lanes = self.lanes
        simulator = Simulator(lanes.lane_model(lane), lanes.load(lane), int(lanes.seeds[lane]))
        result = simulated(simulator, lanes.commands[lanes.command_of[lane]], self.duration, self.time,
                           lanes.initial_of(lane))
        for name, values in self.signals.items():
            own = values[lane].astype(np.float64)
            own.setflags(write=False)
            result.keep(name, own)
        return result

    def raise_if_failed(self) -> Batch:
        """Return the batch itself, or raise SimulationError if a lane ended before its time; names the first."""
        if self.failures:
            lane, time, cause = self.failures[0]
            more = len(self.failures) - 1
            others = f" (and {more} more of {len(self)} lanes)" if more else ""
            raise SimulationError(Status.of_code(int(self.status[lane])).name, time, f"lane {lane}: {cause}{others}")
        return self

    def to_dataframe(self) -> pd.DataFrame:
        """Return all signals (SI) as a pandas DataFrame, a row for each lane and time.

        Values that differ between lanes are not in it; `to_xarray` has them as coordinates, and a file of `save` as
        columns.

        Examples
        --------
        >>> import servotwin as st
        >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
        >>> batch = st.simulate_many(model, st.signals.step(0.0, 60.0, unit="deg"), duration=1.0,
        ...                          parameters={"load.inertia": [0.0, 1e-3]}, output_step=0.5)
        >>> batch.to_dataframe().index.names, batch.to_dataframe().loc[1].shape
        (FrozenList(['lane', 'time']), (3, 1))
        """
        return frames.dataframe("lane", range(len(self)), self.time, self.signals, self.units)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write all signals to a CSV or Parquet file, a row for each lane and time.

        Columns are `lane`, what differs between lanes by its dotted name (SI), `time_s`, and the signals, the unit of
        each in its name. Times that a failed lane has not reached are nan.

        Parameters
        ----------
        path : str or Path
            Ends in .csv or .parquet; the latter needs pyarrow.
        overwrite : bool
            Whether a file that is there may be replaced.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        result.save_lanes(path, self.time, self.signals, self.units, {"lane": np.arange(len(self)), **self._varied},
                         what="a batch", overwrite=overwrite)

    def to_xarray(self) -> xr.Dataset:
        """Return all signals (SI) as an xarray Dataset over `lane` and `time`, with what differs between lanes."""
        return frames.dataset(
            "lane", range(len(self)), self.time, self.signals, more={"status": ("lane", self.status)},
            coords={name: ("lane", column) for name, column in self._varied.items()},
            attrs={"model": type(self.lanes.model).__name__, "servo": self.lanes.model.servo.name})

    @property
    def _varied(self) -> dict[str, NDArray[Any]]:
        """Values that differ between lanes, by dotted name."""
        return {**self.lanes.numbers, **self.lanes.words}
