"""The work of a chunk: simulate some lanes, keep their metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.loads import Load
from servotwin.models import Model
from servotwin.models.columns import LaneServo
from servotwin.signals import Signal
from servotwin.simulation.lanes.inputs import lanes_of
from servotwin.simulation.lanes.many import simulate_lanes
from servotwin.simulation.metrics import resolution
from servotwin.simulation.progress import HERE
from servotwin.simulation.remarks import columns
from servotwin.simulation.rest import look_period, still_since
from servotwin.studies.metrics import Judged, lane_metrics, signals_of

_AT_ONCE = 2**17  # numbers of one signal: they stay in a core's cache


@dataclass(frozen=True, eq=False)
class Job:
    """What all chunks of a study share; picklable.

    Parameters
    ----------
    model : Model
    command : Signal
    load : Load
    duration : float
        [s]
    times : ndarray, shape (T,)
        When the metrics look [s].
    start : float
        When the command steps [s]; nan if it does not.
    metrics : tuple of str
    """

    model: Model
    command: Signal
    load: Load
    duration: float
    times: NDArray[np.float64]
    start: float
    metrics: tuple[str, ...]

    @property
    def block(self) -> int:
        """How many lanes are simulated together."""
        return max(1, _AT_ONCE // len(self.times))


def run_chunk(job: Job, parameters: Mapping[str, NDArray[Any]], seeds: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    """Return the metrics of some lanes, their status (a code of `Status`), end [s] and remarks, each (n,).

    A lane that ends early has no metrics: they are nan.
    """
    batch = simulate_lanes(
        lanes_of(job.model, job.command, job.load, parameters, None, seeds), duration=job.duration,
        output_times=job.times, outputs=signals_of(job.metrics), executor=HERE, chunk=job.block,
        watched="lowest_voltage" in job.metrics)
    ended = np.full(len(batch), job.duration)
    for failure in batch.failures:
        ended[failure.lane] = failure.time
    signals = {**batch.signals, "lowest_voltage": batch.lowest_voltage[0]}
    found = lane_metrics(job.metrics, job.times, job.start, signals, Judged(
        finest=_finest(job.model, parameters), still=still_since(job.command, job.load, job.duration),
        look=look_period(job.model)))
    return {**{name: np.where(batch.status == 0, column, np.nan) for name, column in found.items()},
            "status": np.asarray(batch.status), "ended": ended, **columns(batch.remarks, len(batch))}


def _finest(model: Model, parameters: Mapping[str, NDArray[Any]]) -> NDArray[np.float64] | float:
    """Return the resolution of each lane [rad], or that of all."""
    own = {name: np.asarray(column, dtype=np.float64)[:, None] for name, column in parameters.items()
           if not name.startswith("load.") and np.asarray(column).dtype.kind in "fiu"}
    found = resolution(model.over(LaneServo(model.servo, own)))
    return np.asarray(found, dtype=np.float64)[:, 0] if np.ndim(found) else float(found)
