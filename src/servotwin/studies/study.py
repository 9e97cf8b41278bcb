"""What a sweep found out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.simulation.remarks import KINDS, LaneRemark, of_columns
from servotwin.simulation.start import Status
from servotwin.studies.folder import Folder
from servotwin.studies.tornado import Tornado, bar_of, tornado_of, variance_share
from servotwin.units import is_finite

if TYPE_CHECKING:
    import pandas as pd

    from servotwin.studies.plan import Plan

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_MOST_NAMED = 100  # failures in a summary, and lanes of a kind of remark


class LaneFailure(NamedTuple):
    """A lane that ended before its time: its number, when [s], and why."""

    lane: int
    time: float
    cause: str


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """The outcome of a sweep.

    Parameters
    ----------
    plan : Plan
        What was run.
    table : mapping of str to ndarray, shape (lanes,)
        "lane", all that is drawn and every parameter that follows from it by dotted name (SI), every metric (SI; nan
        where a lane has none), "status" (name of a `Status`), "ended" [s], and for each kind of remark its time [s],
        nan in lanes of which it is not said: "pulses_refused", "ended_on_a_stop", "cannot_hold".
    moved : mapping of str to ndarray
        Each metric in the lanes of the tornado: the nominal lane, then each end of each parameter.
    """

    plan: Plan
    table: Mapping[str, NDArray[Any]]
    moved: Mapping[str, NDArray[np.float64]]

    def __repr__(self) -> str:
        return (f"Study({self.plan.job.model!r}, lanes={len(self)}, parameters={self.parameters}, "
                f"metrics={self.metrics}, failures={len(self.failures)}, remarks={len(self.remarks)})")

    def __len__(self) -> int:
        """Return the number of lanes."""
        return len(self.table["lane"])

    @property
    def parameters(self) -> tuple[str, ...]:
        """Dotted names of what is drawn."""
        return tuple(self.plan.columns)

    @property
    def followed(self) -> tuple[str, ...]:
        """Dotted names of parameters that follow from what is drawn, and so differ from lane to lane too."""
        return tuple(self.plan.followed)

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics."""
        return self.plan.job.metrics

    @property
    def definition(self) -> Mapping[str, Any]:
        """All that defines the study, as `study.json` holds it."""
        return self.plan.definition

    @property
    def failures(self) -> tuple[LaneFailure, ...]:
        """The lanes that ended before their time; they have no metrics."""
        status, ended = self.table["status"], self.table["ended"]
        return tuple(LaneFailure(int(k), float(ended[k]), Status[str(status[k])].message)
                     for k in np.flatnonzero(status != Status.COMPLETED.name))

    @cached_property
    def remarks(self) -> tuple[LaneRemark, ...]:
        """What is to be said of lanes that reached their end, (lane, kind, time [s]), as `Result.remarks`."""
        return of_columns(self.table)

    def remarked(self) -> dict[str, tuple[int, ...]]:
        """Return the lanes of each kind of remark that there is."""
        found: dict[str, list[int]] = {kind: [] for kind in KINDS}
        for remark in self.remarks:
            found[remark.kind].append(remark.lane)
        return {kind: tuple(lanes) for kind, lanes in found.items() if lanes}

    def quantiles(self, probabilities: Sequence[float] = QUANTILES) -> dict[str, dict[float, float]]:
        """Return quantiles of each metric by name and probability.

        The quantile of p is the smallest value of a lane that at least the share p of the lanes does not exceed; so it
        is one that a lane really has (definition 1 of Hyndman and Fan, 1996). Lanes without the metric do not count.

        Raises
        ------
        InputError
            If a probability is not between 0 and 1.
        """
        for p in probabilities:
            if not (is_finite(p) and 0.0 <= p <= 1.0):
                raise InputError("probability", got=p, allowed="a number from 0 to 1")
        found = {}
        for name in self.metrics:
            values = self.table[name][np.isfinite(self.table[name])]
            found[name] = {float(p): float(np.quantile(values, p, method="inverted_cdf")) if values.size else math.nan
                           for p in probabilities}
        return found

    def tornado(self, metric: str) -> Tornado:
        """Return how far each parameter alone moves a metric, and its share of the metric's variance.

        Raises
        ------
        UnknownNameError
            If the study has no such metric.
        """
        if metric not in self.metrics:
            raise UnknownNameError("metric of the study", metric, self.metrics)
        nominal, *rest = self.moved[metric].tolist()
        bars, first = [], 0
        for name, values in self.plan.ends.items():
            own = np.array(rest[first:first + len(values)])
            first += len(values)
            bars.append(bar_of(name, values, own, nominal, variance_share(self.table[name], self.table[metric])))
        lanes = int(np.isfinite(self.table[metric]).sum())
        return tornado_of(metric, nominal, bars, lanes)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the table as a pandas DataFrame, a row for each lane."""
        try:
            import pandas as pd
        except ImportError:
            raise MissingExtraError("pandas", "data") from None
        return pd.DataFrame(dict(self.table)).set_index("lane")

    def summary(self) -> dict[str, Any]:
        """Return quantiles, tornados, failures and remarks, ready for JSON; what is not finite is None."""
        quantiles = self.quantiles()
        found: dict[str, Any] = {
            "lanes": len(self), "failed": len(self.failures),
            "failures": [failure._asdict() for failure in self.failures[:_MOST_NAMED]],
            "remarks": {kind: {"lanes": len(lanes), "first": list(lanes[:_MOST_NAMED])}
                        for kind, lanes in self.remarked().items()},
            "metrics": {}}
        for name in self.metrics:
            tornado = self.tornado(name)
            found["metrics"][name] = {
                "lanes": int(np.isfinite(self.table[name]).sum()), "nominal": _plain(tornado.nominal),
                "quantiles": {f"{p:g}": _plain(value) for p, value in quantiles[name].items()},
                "tornado": [{key: _plain(value) for key, value in bar._asdict().items()} for bar in tornado.bars],
                "without_effect": list(tornado.still)}
        return found

    def save(self, directory: str | Path, *, file_format: str = "csv") -> None:
        """Write the folder that `sweep(directory=...)` writes.

        Raises
        ------
        OutputError
            If the folder is there and not empty, or cannot be written.
        """
        folder = Folder(directory, self.definition, file_format=file_format, resume=False)
        for k, columns in self.chunks():
            folder.write(k, columns)
        folder.write_summary(self.summary())

    def chunks(self) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
        """Return the table in chunks, each with its number."""
        size = self.plan.chunk
        for k in range(self.plan.chunks):
            yield k, {name: column[k * size:(k + 1) * size] for name, column in self.table.items()}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
