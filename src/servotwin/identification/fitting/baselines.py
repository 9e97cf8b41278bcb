"""The model without physics that every servo model has to beat: a delay, a slew rate, a lag, and a deadband.

ArduPilot's simulated servo is of this kind.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.side_by_side import solved
from servotwin.identification.fitting.slew_lag import (
    NUMBERS,
    POSITIVE,
    Course,
    Courses,
    LagNumbers,
    SlewLag,
    first_angle,
    usable,
)
from servotwin.logs.log import ANGLES, Log
from servotwin.units import is_finite

Array = NDArray[np.float64]

Loss = Literal["linear", "soft_l1", "huber"]
LOSSES = get_args(Loss)
_STEP = 1e-6  # of a searched number, for derivatives
_LEAST_LAG, _MOST_LAG, _MOST_DELAY = 1e-4, 5.0, 0.5  # s
_DELAYS = (0.0, 0.02, 0.04, 0.06, 0.09, 0.13, 0.2, 0.3)  # s, of the starts
_LAGS = (0.01, 0.04, 0.15)  # s
_SLEWS = (0.7, 1.0, 1.4)  # of what the logs show
_STARTS = 4
_ROUGHLY, _CLOSELY = 1e-2, 3e-6  # of the cost: less is an end, of several starts and of the best


def fit_slew_lag(logs: Sequence[Log], *, loss: Loss = "linear", loss_scale: float | None = None) -> SlewLag:
    """Return the delay, slew rates, lag, deadband, gain and offset that follow some logs best.

    Least squares from several starts, the same ones each time. The gain is searched unless commands are angles and
    angles were measured, where it is 1. Logs without an angle are followed by their feedback voltage.

    Parameters
    ----------
    logs : sequence of Log
        With one kind of command. Samples that do not count, and all from the first one without pulses on, are left
        out.
    loss : {"linear", "soft_l1", "huber"}
        Of the squared error: the last two let outliers count less.
    loss_scale : float, optional
        Error from which they do so [rad]; 1.5 times the spread that the errors have about the least squares unless
        given.

    Returns
    -------
    SlewLag

    Raises
    ------
    InputError
        If there is no log, kinds of commands differ, some logs have an angle and others only a voltage, nothing
        moves, or the loss is unknown.

    Examples
    --------
    >>> time = np.arange(0.0, 2.0, 0.02)
    >>> truth = SlewLag(delay=0.05, slew_up=4.0, slew_down=5.0, lag=0.03)
    >>> log = Log(name="square", time=time, command=np.sign(np.sin(4.0 * time)), command_kind="angle",
    ...           measured={"output_angle": np.zeros_like(time)})
    >>> from dataclasses import replace
    >>> seen = replace(log, measured={"output_angle": truth.predict(log)})
    >>> fit = fit_slew_lag([seen])
    >>> round(fit.delay, 4), round(fit.slew_down, 3)
    (0.05, 5.0)
    """
    if loss not in LOSSES:
        raise InputError("loss", got=loss, allowed=", ".join(LOSSES))
    if loss_scale is not None and not (is_finite(loss_scale) and loss_scale > 0.0):
        raise InputError("loss_scale", got=loss_scale, allowed="a positive number (SI)")
    kind, signal = _kind(logs), _signal(logs)
    fitted = _Fitted(logs, signal, gain=kind != "angle" or signal != "output_angle")
    x = fitted.solve(fitted.starts(), "linear", 1.0, _ROUGHLY)
    spread = 1.0 if loss == "linear" else loss_scale or max(
        1.4826 * 1.5 * float(np.median(np.abs(fitted.residual(x)))), 1e-9)
    x = fitted.solve([x], loss, spread, _CLOSELY)
    values = {name: float(value.item()) for name, value in fitted.numbers(x[None, :])._asdict().items()}
    return SlewLag(**values, command_kind=kind, signal=signal)


def _kind(logs: Sequence[Log]) -> str:
    if isinstance(logs, Log) or not isinstance(logs, Sequence) or not all(isinstance(log, Log) for log in logs):
        raise InputError("logs", got=type(logs).__name__, allowed="a list of logs")
    kinds = {log.command_kind: log.name for log in reversed(logs)}
    if len(kinds) != 1:
        raise InputError("logs", got=", ".join(f"{name!r} with {kind}" for kind, name in kinds.items()) or "none",
                         allowed="at least one log, all with one kind of command")
    return next(iter(kinds))


def _signal(logs: Sequence[Log]) -> str:
    """Return what all logs measured: their angle, or else their feedback voltage."""
    for signal in ANGLES:
        if all(signal in log.measured for log in logs) and any(usable(log, signal).any() for log in logs):
            return signal
    without = next((log.name for log in logs if "output_angle" not in log.measured), logs[0].name)
    raise InputError(f"log {without!r}", got="nothing that all logs measured while the torque was on",
                     allowed="output_angle in all logs, or feedback_voltage in all")


class _Fitted:
    """The logs of a fit, and the numbers that are searched: x, scaled, logarithms where these have to be positive."""

    def __init__(self, logs: Sequence[Log], signal: str, *, gain: bool) -> None:
        seen = [(log, usable(log, signal)) for log in logs]
        seen = [(log, used) for log, used in seen if used.any()]
        self.measured = np.concatenate([log.measured[signal][used] for log, used in seen])
        self.range = float(np.ptp(self.measured))
        commands = np.concatenate([log.held[used] for log, used in seen])
        self.free = NUMBERS if gain else NUMBERS[:-1]
        if len(self.measured) < len(self.free):
            raise InputError("logs", got=f"{len(self.measured)} values that count",
                             allowed=f"at least {len(self.free)}, one for each number that is searched")
        self.slews = _slews(seen, signal)
        self.courses = Courses([Course.of(log, used, first_angle(log, signal)) for log, used in seen])
        if gain and np.ptp(commands) == 0.0:
            raise InputError("logs", got="one command only", allowed="commands that differ, for they tell the gain")
        unit = self.range / float(np.ptp(commands)) if gain else 1.0
        self.scale = {"delay": 0.05, "offset": self.range, "deadband": 0.1 * self.range, "gain": unit}
        self.lower = np.array([_bounds(name, self)[0] for name in self.free])
        self.upper = np.array([_bounds(name, self)[1] for name in self.free])

    def numbers(self, x: Array) -> LagNumbers:
        """Return the numbers (SI) of points x, shape (C, p)."""
        made = {name: np.exp(x[:, k:k + 1]) if name in POSITIVE else self.scale[name] * x[:, k:k + 1]
                for k, name in enumerate(self.free)}
        return LagNumbers(**{"gain": np.ones((len(x), 1)), **made})

    def residual(self, x: Array) -> Array:
        """Return modelled less measured angles."""
        residual: Array = self.courses.angles(self.numbers(x[None, :]))[0][0] - self.measured
        return residual

    def seen(self, points: Sequence[Array]) -> list[tuple[Array, Array]]:
        """Return residuals and derivatives at points: by copies that differ a little, by the delay from the speed."""
        several, steps = [], []
        for x in points:
            copies = np.repeat(x[None, :], len(x), axis=0)
            step = np.where(x + _STEP > self.upper, -_STEP, _STEP)
            copies[np.arange(1, len(x)), np.arange(1, len(x))] += step[1:]
            several.append(copies)
            steps.append(step)
        found = []
        numbers = [self.numbers(copies) for copies in several]
        for (angle, speed), step in zip(self.courses.angles_of(numbers), steps, strict=True):
            columns = (angle[1:] - angle[0]) / step[1:, None]
            found.append((angle[0] - self.measured, np.column_stack([-speed[0] * self.scale["delay"], columns.T])))
        return found

    def solve(self, starts: Sequence[Array], loss: Loss, scale: float, gain: float) -> Array:
        """Return where the best of the searches from some starts ends."""
        inside = [np.clip(start, self.lower + 1e-9, self.upper - 1e-9) for start in starts]
        ends = solved(inside, self.lower, self.upper, self.seen, loss, scale, gain)
        return min(ends, key=lambda end: end[0])[1]

    def starts(self) -> list[Array]:
        """Return the best of a grid over delay, lag and slew rates; gain and offset by a straight line."""
        found: list[tuple[float, Array]] = []
        grids = []
        for delay in _DELAYS:
            gain, offset = self._line(delay)
            points = [[delay / self.scale["delay"], math.log(self.slews[0] * slew), math.log(self.slews[1] * slew),
                       math.log(lag), offset / self.scale["offset"], 0.1, gain / self.scale["gain"]][:len(self.free)]
                      for lag in _LAGS for slew in _SLEWS]
            grids.append(np.array(points))
        for grid, (angle, _) in zip(grids, self.courses.angles_of([*map(self.numbers, grids)]), strict=True):
            costs = np.abs(angle - self.measured).mean(axis=1)
            k = int(np.argmin(costs))
            found.append((float(costs[k]), grid[k]))
        return [x for _, x in sorted(found, key=lambda each: each[0])[:_STARTS]]

    def _line(self, delay: float) -> tuple[float, float]:
        """Return gain and offset of the straight line through measured angles over commands, a delay and lag later."""
        courses = self.courses
        place = np.concatenate([np.searchsorted(events, times - delay - 0.1, side="right") - 1
                                for events, times in zip(courses.events, courses.times, strict=True)])
        command = courses.commands[courses.log_of, np.maximum(place, 0)]
        if "gain" not in self.free:
            return 1.0, float(np.median(self.measured - command))
        if np.ptp(command) == 0.0:
            return self.scale["gain"], float(np.mean(self.measured) - self.scale["gain"] * command[0])
        centre = float(command.mean())
        gain = float(np.sum((command - centre) * self.measured) / np.sum((command - centre)**2))
        return gain, float(self.measured.mean()) - gain * centre


def _bounds(name: str, fitted: _Fitted) -> tuple[float, float]:
    """Return bounds of a searched number (scaled)."""
    if name == "delay":
        most = min(_MOST_DELAY, 0.5 * float(fitted.courses.time.max()))
        return 0.0, most / fitted.scale["delay"]
    if name == "lag":
        return math.log(_LEAST_LAG), math.log(_MOST_LAG)
    if name in POSITIVE:
        seen = fitted.slews[0 if name == "slew_up" else 1]
        return math.log(0.02 * seen), math.log(50.0 * seen)
    return (0.0, 10.0) if name == "deadband" else (-math.inf, math.inf)


def _slews(seen: Sequence[tuple[Log, NDArray[np.bool_]]], signal: str) -> tuple[float, float]:
    """Return how fast the shaft went up and down: of the fastest twentieth of the samples."""
    rates = np.concatenate([np.diff(log.measured[signal][used]) / np.diff(log.time[used]) for log, used in seen])
    ends = [float(np.quantile(side, 0.95)) if len(side) else 0.0 for side in (rates[rates > 0.0], -rates[rates < 0.0])]
    most = max(ends)
    if most == 0.0:
        raise InputError("logs", got="a shaft that never moves", allowed="logs with motion")
    return max(ends[0], 0.1 * most), max(ends[1], 0.1 * most)
