"""The result of a sweep."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import __version__
from servotwin.errors import InputError, MissingExtraError, OutputError, UnknownNameError
from servotwin.parameters import write_file
from servotwin.parameters.output_file import undone
from servotwin.simulation.remarks import KINDS, LaneRemark, of_columns
from servotwin.simulation.start import Status
from servotwin.tables.columns import check_format, encoded, read_columns
from servotwin.units import is_finite

if TYPE_CHECKING:
    import pandas as pd

    from servotwin.studies.plan import Plan


# --- The folder of a study: what defines it, a file for each finished chunk, and what came out ------------------------

Column = NDArray[Any]

STUDY, SUMMARY = "study.json", "summary.json"
_FOLLOWING = ("parameters_sha256", "chunk")  # from all the others
_MOST_NAMED = 6  # of what differs
_LIBRARIES = ("numpy", "scipy")


class Folder:
    """A folder that belongs to one study.

    Parameters
    ----------
    path : str or Path
        Made where it is not there; its parent must be.
    definition : mapping
        All that defines the study, ready for JSON.
    file_format : str
        "csv" or "parquet".
    resume : bool
        Whether a folder with the same study is continued.

    Raises
    ------
    OutputError
        If it cannot be written, or holds anything and `resume` is false, or anything else than this study.
    """

    def __init__(self, path: str | Path, definition: Mapping[str, Any], *, file_format: str, resume: bool) -> None:
        check_format(file_format)
        self.path, self._format = Path(path), file_format
        own = {**definition, "servotwin": __version__, "format": file_format}
        new = not self.path.exists()
        with undone(self._remove_empty if new else lambda: None):
            self._make()
            if not self._empty():
                if not resume:
                    raise OutputError(f"{self.path} is not empty; resume=True (--resume) goes on with the study there")
                self._check_same(own)
                return
            versions = {"python": platform.python_version(), **{name: metadata.version(name) for name in _LIBRARIES}}
            fingerprint = hashlib.sha256(json.dumps(own, sort_keys=True).encode()).hexdigest()
            self._write(STUDY, _json({"sha256": fingerprint, "definition": own, "versions": versions}))

    def _remove_empty(self) -> None:
        with contextlib.suppress(OSError, ValueError):  # it has the study, or never was
            self.path.rmdir()

    def _make(self) -> None:
        if "\0" in str(self.path):
            raise OutputError(f"{str(self.path)!r} cannot be a folder (a path holds no NUL)")
        try:
            self.path.mkdir(exist_ok=True)
        except FileExistsError:
            raise OutputError(f"{self.path} is no folder") from None
        except OSError as error:
            reason = error.strerror if self.path.parent.exists() else f"no folder {self.path.parent}"
            raise OutputError(f"{self.path} cannot be made ({reason})") from None

    def _empty(self) -> bool:
        try:
            return not any(self.path.iterdir())
        except OSError as error:
            raise OutputError(f"{self.path} cannot be read ({error.strerror})") from None

    def _check_same(self, own: Mapping[str, Any]) -> None:
        file = self.path / STUDY
        try:
            theirs = _flat(dict(json.loads(file.read_text(encoding="utf-8"))["definition"]))
        except (OSError, ValueError, KeyError, TypeError):
            raise OutputError(f"{self.path} holds no study that could be gone on with ({STUDY} is missing or broken); "
                              "name another folder") from None
        ours = _flat(json.loads(json.dumps(own)))
        differ = [name for name in dict.fromkeys((*ours, *theirs)) if theirs.get(name) != ours.get(name)]
        if differ:
            said = [name for name in differ if name not in _FOLLOWING] or differ
            more = f"; {len(said) - _MOST_NAMED} more" if len(said) > _MOST_NAMED else ""
            raise OutputError(f"{file} is of another study: " + "; ".join(
                f"{name} is {_short(ours, name)} and was {_short(theirs, name)}" for name in said[:_MOST_NAMED]) + more
                + "; repeat it as it was, or name another folder")

    def _write(self, name: str, content: bytes) -> None:
        try:
            write_file(self.path / name, content, overwrite=True)
        except OutputError as error:
            raise OutputError(f"{error.what}; what is finished is kept, and resume=True (--resume) goes on") from None

    def _chunk(self, k: int) -> Path:
        return self.path / f"lanes-{k:05}.{self._format}"

    def has(self, k: int) -> bool:
        """Return whether a chunk is finished."""
        return self._chunk(k).exists()

    def write(self, k: int, columns: Mapping[str, Column]) -> None:
        """Write a chunk, whole or not at all.

        Raises
        ------
        OutputError
            If that fails; what is finished stays.
        """
        self._write(self._chunk(k).name, encoded(columns, self._format))

    def read(self, k: int, names: tuple[str, ...], lanes: int) -> dict[str, Column]:
        """Return the columns of a finished chunk.

        Raises
        ------
        InputError
            If the file is not what was written.
        """
        file = self._chunk(k)
        found = read_columns(file)
        if tuple(found) != names or len(found["lane"]) != lanes:
            raise InputError(f"{file} is not what the study wrote; delete it and go on with resume=True (--resume)")
        return {**found, "lane": found["lane"].astype(np.int64)}

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write what came out."""
        self._write(SUMMARY, _json(summary))


def _json(content: Mapping[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def _short(content: Mapping[str, Any], name: str) -> str:
    """Return a value as a line has room for it."""
    text = json.dumps(content[name]) if name in content else "not given"
    return text if len(text) <= 60 else f"{text[:40]} ..."


def _flat(content: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Return nested mappings as one, with dotted names."""
    found: dict[str, Any] = {}
    for name, value in content.items():
        found |= _flat(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
    return found


# --- Which parameter matters: the reach of each one alone, and its share of the variance of all -----------------------

_MOST_CLASSES = 32
_LEAST_LANES = 8  # fewer have no share
_LEAST_REACH = 0.01  # of the farthest bar


class Bar(NamedTuple):
    """The effect of one parameter on a metric.

    Parameters
    ----------
    name : str
        Dotted.
    low, high : float or str
        Its values at the ends of the bar (SI): the 5 % and the 95 % value, or of a choice the two options that
        move the metric farthest.
    at_low, at_high : float
        The metric there, while all other parameters are nominal (SI).
    reach : float
        How far the metric moves between these two and the nominal servo (SI); nan where it has no value there.
    share : float
        Share of the variance of the metric over all lanes that this parameter explains alone: 0 to 1, or nan where
        the metric does not vary or too few lanes have it.
    """

    name: str
    low: float | str
    high: float | str
    at_low: float
    at_high: float
    reach: float
    share: float


@dataclass(frozen=True)
class Tornado:
    """The parameters of a study that move a metric, those that move it farthest first.

    Parameters
    ----------
    metric : str
    nominal : float
        The metric while all parameters are nominal (SI).
    bars : tuple of Bar
    still : tuple of str
        Names of what is drawn and does not move it: alone less than a hundredth of what the first bar does, and its
        share of the variance no more than chance makes.
    """

    metric: str
    nominal: float
    bars: tuple[Bar, ...]
    still: tuple[str, ...] = ()


def bar_of(name: str, values: tuple[Any, ...], metric: NDArray[np.float64], nominal: float, share: float) -> Bar:
    """Return the bar of a parameter from the metric at each of its values, and at the nominal servo.

    Examples
    --------
    >>> bar_of("motor.torque_constant", (1.0, 2.0), np.array([0.3, 0.1]), 0.15, 0.5).reach
    0.2
    """
    ends = [0, len(values) - 1]
    if len(values) > 2 and np.isfinite(metric).any():
        ends = sorted([int(np.nanargmin(metric)), int(np.nanargmax(metric))])
    low, high = ends
    reach = float(np.ptp([metric[low], metric[high], nominal]))
    return Bar(name, values[low], values[high], float(metric[low]), float(metric[high]), reach, share)


def tornado_of(metric: str, nominal: float, bars: list[Bar], lanes: int) -> Tornado:
    """Return the tornado of a metric that so many lanes have; what does not move it is only named.

    A bar without a value at one of its ends moves the metric, out of existence.

    Examples
    --------
    >>> found = [Bar("load.inertia", 0.0, 1.0, 0.2, 0.3, 0.1, 0.9), Bar("load.torque", 0.0, 0.5, 0.2, 0.2, 0.0, 0.0)]
    >>> tornado_of("rise_time", 0.2, found, 100).still
    ('load.torque',)
    """
    known = [bar.reach for bar in bars if not math.isnan(bar.reach)]
    least, chance = _LEAST_REACH * max(known, default=0.0), chance_share(lanes)
    moving = [bar for bar in bars if math.isnan(bar.reach) or bar.reach > least or bar.share > chance]
    return Tornado(metric, nominal, sorted_bars(moving), tuple(sorted(
        bar.name for bar in bars if bar not in moving)))


def chance_share(lanes: int) -> float:
    """Return what the share of a parameter without effect exceeds by chance in about one of a thousand.

    Three standard deviations: sorted into c classes, the part between them of n independent values is, as a share of
    the whole, that of a beta distribution with c − 1 and n − c degrees of freedom.

    Examples
    --------
    >>> round(chance_share(2000), 3)
    0.012
    """
    if lanes < _LEAST_LANES:
        return math.inf
    classes = _classes(lanes)
    return 3.0 * math.sqrt(2.0 * (classes - 1.0) / (lanes - classes)) / math.sqrt(lanes - 1.0)


def _classes(lanes: int) -> int:
    return min(int(math.sqrt(lanes)), _MOST_CLASSES)


def sorted_bars(bars: list[Bar]) -> tuple[Bar, ...]:
    """Return bars, the one that reaches farthest first; those that do not move the metric last, by their share."""
    def rank(bar: Bar) -> tuple[float, float, str]:
        reach, share = (0.0 if math.isnan(x) else x for x in (bar.reach, bar.share))
        return -reach, -share, bar.name

    return tuple(sorted(bars, key=rank))


def variance_share(values: NDArray[Any], metric: NDArray[np.float64]) -> float:
    """Return the share of a metric's variance that one parameter explains alone (first-order index of Sobol).

    The lanes are sorted into classes by the parameter, one for each value where there are few and of equal size
    otherwise; the share is the variance of the means of the classes over the whole one (correlation ratio), corrected
    for the number of classes (Kelley, 1935), which takes the place of the noise that few lanes make.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers or words.
    metric : ndarray, shape (n,)
        Lanes in which it is nan do not count.

    Returns
    -------
    float
        0 to 1; nan where the metric does not vary, or fewer than 8 lanes have it.

    Examples
    --------
    >>> x = np.linspace(0.0, 1.0, 10000)
    >>> round(variance_share(x, 3.0 * x), 2), round(variance_share(x, (x - 0.5)**2), 2)
    (1.0, 1.0)
    """
    if values.shape != metric.shape:
        raise InputError("metric", got=metric.shape, allowed=f"one number for each of {values.shape[0]} values")
    good = np.isfinite(metric)
    x, y = values[good], metric[good]
    if len(y) < _LEAST_LANES or not np.ptp(y) > 1e-12 * np.max(np.abs(y)):
        return math.nan
    count = _classes(len(y))
    options, of = np.unique(x, return_inverse=True)
    if len(options) > count:
        place = np.empty(len(x), dtype=np.int64)
        place[np.argsort(x, kind="stable")] = np.arange(len(x))
        of = place * count // len(x)
    sizes = np.bincount(of)
    if len(sizes) < 2:
        return 0.0
    y = y - y.mean()
    between = float(np.sum(np.bincount(of, weights=y)**2 / sizes) / np.sum(y**2))
    return max(0.0, 1.0 - (1.0 - between) * (len(y) - 1) / (len(y) - len(sizes)))


# --- The result of a sweep --------------------------------------------------------------------------------------------

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_MOST_WARNED = 100  # failures in a summary, and lanes of a kind of remark


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
        Plan that was run.
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
        """Remarks on lanes that reached their end, (lane, kind, time [s]), as `Result.remarks`."""
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
            "failures": [failure._asdict() for failure in self.failures[:_MOST_WARNED]],
            "remarks": {kind: {"lanes": len(lanes), "first": list(lanes[:_MOST_WARNED])}
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
