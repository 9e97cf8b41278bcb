"""Metrics of lanes, from samples of many at once, with the meanings of `StepMetrics`.

Between two samples the angle is taken as the cubic through both angles and both speeds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.loads import Load
from servotwin.models import Model
from servotwin.models.columns import LaneServo
from servotwin.signals import Signal
from servotwin.simulation.lanes.inputs import lanes_of
from servotwin.simulation.lanes.many import simulate_lanes
from servotwin.simulation.metrics import resolution, tolerance
from servotwin.simulation.progress import HERE
from servotwin.simulation.remarks import columns
from servotwin.simulation.rest import AT_REST, LEAST_REST, look_period, looks_at, still_since, swing_of

# --- Metrics of lanes -------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]


class Metric(NamedTuple):
    """Dimension (of `servotwin.units`), meaning, the signals that it is made of, and whether it needs a step."""

    dimension: str
    meaning: str
    signals: tuple[str, ...]
    of_step: bool = True


_MOVES = ("output_angle", "output_speed")
_ARRIVES = (*_MOVES, "command_angle")
METRICS: dict[str, Metric] = {
    "overshoot": Metric("number", "beyond the final angle, as a fraction of the way", _ARRIVES),
    "rise_time": Metric("time", "from 10 % to 90 % of the way", _ARRIVES),
    "settling_time": Metric("time", "until the angle stays within 2 % of the way", _ARRIVES),
    "steady_error": Metric("angle", "commanded minus final angle", ("output_angle", "command_angle")),
    "rest_swing": Metric("angle", "of a shaft that does not come to rest, from end to end; 0 where it does",
                         ("output_angle", "command_angle"), of_step=False),
    "slew_rate": Metric("speed", "highest speed", ("output_speed",), of_step=False),
    "peak_current": Metric("current", "highest magnitude of the armature current", ("armature_current",),
                           of_step=False),
    "lowest_voltage": Metric("voltage", "least voltage of the supply", ("bus_voltage",), of_step=False),
    "rms_error": Metric("angle", "root of the mean square of commanded minus actual angle",
                        ("output_angle", "command_angle"), of_step=False),
    "peak_error": Metric("angle", "largest magnitude of commanded minus actual angle",
                         ("output_angle", "command_angle"), of_step=False),
}
"""By name; besides, ``end_`` and the name of a signal is that signal at the end of the run."""

OF_STEP = ("overshoot", "rise_time", "settling_time", "steady_error", "peak_current", "end_output_angle", "rest_swing")
OF_OTHERS = ("rms_error", "peak_error", "peak_current", "end_output_angle")
OF_ENDLESS = ("slew_rate", "peak_current", "end_output_speed", "end_output_angle")
_ENDS = "end_"
_AFTER = 1e-3 * np.array([0.02, 0.2, 0.5, 1.2])  # s: motors take some 10 ms to speed up


def step_time(command: Signal) -> float:
    """Return when a command steps, if it is a single step; nan otherwise [s]."""
    table = command.pieces.table
    changes = [piece.start for piece in table[1:] if piece.start >= 0.0]
    steady = not any(piece.slope or piece.amplitude for piece in table)
    plain = steady and command.edges is None and not command.silences
    return changes[0] if len(changes) == 1 and plain else math.nan


def checked_metrics(metrics: Sequence[str] | None, model: Model, command: Signal, duration: float) -> tuple[str, ...]:
    """Return the names of the metrics, those usual for the command unless given.

    Raises
    ------
    UnknownNameError, InputError
        If there is no such metric, or it is one of a step and the command is none.
    """
    start = step_time(command)
    if metrics is None:
        usual = OF_ENDLESS if model.endless else OF_STEP if start < duration else OF_OTHERS
        return tuple(name for name in usual if name != "rest_swing" or duration - start >= LEAST_REST)
    names = (metrics,) if isinstance(metrics, str) else tuple(dict.fromkeys(metrics))
    had = {name: set(metric.signals) <= set(model.available) for name, metric in METRICS.items()}
    known = (*(name for name in METRICS if had[name]), *(f"{_ENDS}{name}" for name in model.available))
    for name in names:
        if name not in known:
            raise UnknownNameError("metric", name, known)
        if name in METRICS and METRICS[name].of_step and not start < duration:
            raise InputError(name, got="a command that is not a single step within the run",
                             allowed="one made by signals.step; rms_error and peak_error take any")
    if not names:
        raise InputError("metrics", got="none", allowed="at least one of " + ", ".join(known))
    return names


def signals_of(metrics: Sequence[str]) -> tuple[str, ...]:
    """Return the signals that metrics are made of."""
    return tuple(dict.fromkeys(signal for name in metrics for signal in (
        METRICS[name].signals if name in METRICS else (name.removeprefix(_ENDS),))))


def decision_times(model: Model, command: Signal, duration: float) -> Array:
    """Return when the nominal chip begins to drive, at the end of each pulse [s]; none for a model without pulses."""
    chip = model.chip(command)
    if chip is None:
        return np.zeros(0)
    command = model.framed(command, duration)
    given = model.edges(command)
    edges = np.arange(math.ceil(duration / chip.frame_period)) * chip.frame_period if given is None else np.array(given)
    return np.asarray(edges + model.command(command)(edges))


def output_times(duration: float, step: float, start: float, decisions: Array) -> Array:
    """Return when the metrics look: every `step`, at the start of a step, shortly after each decision, at the end.

    A drive begins at a decision, and with it the current is highest.

    Examples
    --------
    >>> output_times(0.02, 0.01, 0.005, np.array([0.0015])).round(5).tolist()
    [0.0, 0.00152, 0.0017, 0.002, 0.0027, 0.005, 0.01, 0.02]
    """
    regular = np.arange(math.ceil(duration / step)) * step
    times = np.concatenate([regular, [start], (decisions[:, None] + _AFTER).ravel()])
    return np.append(np.unique(times[(times >= 0.0) & (times < duration)]), duration)


class Judged(NamedTuple):
    """The limits by which a shaft has arrived, and rests.

    Parameters
    ----------
    finest : float or ndarray, shape (n,)
        `simulation.metrics.resolution` of each lane [rad].
    still : float
        From when on neither command nor load change; inf where they do to the end [s].
    look : float
        How often a shaft is looked at to see whether it rests [s].
    """

    finest: float | Array = 0.0
    still: float = math.inf
    look: float = 1e-3


def lane_metrics(metrics: Sequence[str], times: Array, start: float, signals: Mapping[str, NDArray[Any]],
                 judged: Judged | None = None) -> dict[str, Array]:
    """Return each metric of all lanes, shape (n,), from their signals, each of shape (n, T).

    Examples
    --------
    >>> angle = {"output_angle": np.array([[0.0, 2.0]])}
    >>> lane_metrics(["end_output_angle"], np.array([0.0, 1.0]), np.nan, angle)["end_output_angle"].tolist()
    [2.0]
    """
    found: dict[str, Array] = {}
    judged = judged or Judged()
    of_response = {"overshoot", "rise_time", "settling_time"} & set(metrics)
    response = _response(times, start, signals) if of_response else {}
    arrived = _arrived(times, start, signals, judged) if of_response else np.True_
    swings = _swings(times, signals, judged) if {"rest_swing", "settling_time"} & set(metrics) else None
    for name in metrics:
        if name == "settling_time":
            found[name] = np.where(arrived & ~(np.asarray(swings) > 0.0), response[name], np.nan)
        elif name in response:
            found[name] = np.where(arrived, response[name], np.nan)
        elif name == "rest_swing" and swings is not None:
            found[name] = swings
        elif name == "steady_error":
            found[name] = signals["command_angle"][:, -1] - signals["output_angle"][:, -1]
        elif name == "lowest_voltage":
            found[name] = signals[name]  # of all instants
        elif name in ("slew_rate", "peak_current"):
            values = signals[METRICS[name].signals[0]]
            found[name] = np.maximum(values.max(axis=1), -values.min(axis=1))
        elif name in ("rms_error", "peak_error"):
            error = signals["command_angle"] - signals["output_angle"]
            found[name] = np.abs(error).max(axis=1) if name == "peak_error" else np.sqrt(
                np.trapezoid(error**2, times, axis=1) / times[-1])
        else:
            found[name] = signals[name.removeprefix(_ENDS)][:, -1].astype(np.float64)
    return found


def _arrived(times: Array, start: float, signals: Mapping[str, NDArray[Any]], judged: Judged) -> NDArray[np.bool_]:
    """Tell which lanes end where the step sends them."""
    if "command_angle" not in signals:
        return np.ones(len(signals["output_angle"]), dtype=bool)
    target, angle = signals["command_angle"][:, -1], signals["output_angle"]
    way = target - angle[:, int(np.searchsorted(times, start))]
    return np.asarray(np.abs(target - angle[:, -1]) <= tolerance(way, judged.finest))


def _swings(times: Array, signals: Mapping[str, NDArray[Any]], judged: Judged) -> Array:
    """Return the swing of each lane that does not come to rest [rad]; 0 where it does, nan where that is not seen."""
    angles = signals["output_angle"]
    if not times[-1] - judged.still >= LEAST_REST:
        return np.full(len(angles), np.nan)
    looks = looks_at(judged.still, float(times[-1]), judged.look)
    moves = np.ptp(angles[:, times >= 0.5 * (judged.still + times[-1])], axis=1) > 0.5 * AT_REST
    found = np.zeros(len(angles))
    for k in np.flatnonzero(moves).tolist():
        found[k] = swing_of(looks, np.interp(looks, times, angles[k])).swing
    return found


class _Way(NamedTuple):
    """Times [s] from the step on, how much of the way is done, speeds [rad/s], and the way [rad], shape (n,)."""

    t: Array
    y: Array
    speed: Array
    way: Array


def _response(times: Array, start: float, signals: Mapping[str, NDArray[Any]]) -> dict[str, Array]:
    """Return overshoot, rise time and settling time."""
    first = int(np.searchsorted(times, start))
    t = times[first:]
    angle, speed = (signals[name][:, first:] for name in _MOVES)
    way = angle[:, -1] - angle[:, 0]
    with np.errstate(all="ignore"):
        way = np.where(np.abs(way) > 1e-12, way, np.nan)
        y = (angle - angle[:, :1]) / way[:, None]
        done = _Way(t, y, speed, way)
        t10, t90 = (_crossing(done, np.argmax(y >= level, axis=1) - 1, np.full(len(y), level)) for level in (0.1, 0.9))
        outside = (y > 1.02) | (y < 0.98)
        last = len(t) - 1 - np.argmax(outside[:, ::-1], axis=1)
        edge = np.where(y[np.arange(len(y)), last] > 1.0, 1.02, 0.98)
        settled = np.where(outside.any(axis=1), _crossing(done, np.minimum(last, len(t) - 2), edge), t[0])
        over = np.maximum(_highest(done) - 1.0, 0.0)
    none = np.isnan(way)
    return {"overshoot": np.where(none, np.nan, np.where(over < 1e-12, 0.0, over)),
            "rise_time": np.where(none, np.nan, t90 - t10), "settling_time": np.where(none, np.nan, settled - t[0])}


def _interval(done: _Way, k: NDArray[np.intp]) -> tuple[Array, Array, Array, Array, Array]:
    """Return length, both values and both slopes (per interval) of the interval that begins at sample `k`."""
    rows, h = np.arange(len(done.y)), done.t[k + 1] - done.t[k]
    slope, slope_after = (h * done.speed[rows, n] / done.way for n in (k, k + 1))
    return h, done.y[rows, k], done.y[rows, k + 1], slope, slope_after


def _cubic(s: Array, a: Array, b: Array, da: Array, db: Array) -> Array:
    """Return the cubic from a to b with slopes da and db, at s from 0 to 1."""
    c, d = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
    return np.asarray(a + s * (da + s * (c + s * d)))


def _crossing(done: _Way, k: NDArray[np.intp], level: Array) -> Array:
    """Return when each lane passes a level within the interval that begins at sample `k`; at t[0] where k < 0."""
    t, n = done.t, np.maximum(k, 0)
    h, a, b, da, db = _interval(done, n)
    most = 3.0 * (b - a)  # within these slopes the cubic goes one way only (Fritsch and Carlson, 1980)
    da, db = (np.clip(d, np.minimum(most, 0.0), np.maximum(most, 0.0)) for d in (da, db))
    low, high, rising = np.zeros(len(a)), np.ones(len(a)), b > a
    for _ in range(45):
        s = 0.5 * (low + high)
        before = (_cubic(s, a, b, da, db) < level) == rising
        low, high = np.where(before, s, low), np.where(before, high, s)
    return np.where(k < 0, t[0], t[n] + h * 0.5 * (low + high))


def _highest(done: _Way) -> Array:
    """Return the highest value of each lane: a sample, or the top of the cubic where the speed changes sign."""
    top = np.argmax(done.y, axis=1)
    best = done.y[np.arange(len(top)), top]
    for k in (np.maximum(top - 1, 0), np.minimum(top, len(done.t) - 2)):
        _, a, b, da, db = _interval(done, k)
        c, d = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
        s = da / (np.sqrt(np.maximum(c * c - 3.0 * d * da, 0.0)) - c)  # the slope da + 2 c s + 3 d s² is 0
        turns = (da > 0.0) & (db < 0.0)
        best = np.where(turns, np.maximum(best, _cubic(s, a, b, da, db)), best)
    return np.asarray(best)


# --- The work of a chunk: simulate some lanes, keep their metrics -----------------------------------------------------

_AT_ONCE = 2**17  # numbers of one signal: they stay in a core's cache


@dataclass(frozen=True, eq=False)
class Job:
    """Common parts of all chunks of a study; picklable.

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
