"""A servo as a delay, a slew rate, a lag and a deadband: its motion in closed form, for many logs at once.

ArduPilot's simulated servo is of this kind.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import robust_deviation
from servotwin.logs.log import ANGLES, Log
from servotwin.units import is_finite

# --- A servo as a delay, a slew rate, a lag and a deadband ------------------------------------------------------------

Array = NDArray[np.float64]
NUMBERS = ("delay", "slew_up", "slew_down", "lag", "offset", "deadband", "gain")
POSITIVE = ("slew_up", "slew_down", "lag")


@dataclass(frozen=True, kw_only=True)
class SlewLag:
    """A first-order lag with a limited rate behind a delay, for an angle y [rad].

    dy/dt = clip(e/lag, −slew_down, slew_up), where e is gain·command(t − delay) + offset − y less half the deadband,
    and 0 inside the deadband.

    Parameters
    ----------
    delay : float
        At least 0 [s].
    slew_up, slew_down : float
        Greatest speed towards larger and smaller angles, positive [rad/s].
    lag : float
        Positive [s].
    gain : float
        Angle for each unit of the command [rad/rad, rad/s or rad/V].
    offset : float
        Angle at the command 0 [rad].
    deadband : float
        Full width, at least 0: an error up to half of it moves nothing [rad].
    command_kind : {"angle", "pulse_width", "voltage"}
        Of the logs that it follows.
    signal : {"output_angle", "feedback_voltage"}
        Signal y. For the feedback voltage, V stands for rad in every unit above.

    Raises
    ------
    InputError
        If a number is out of its range.

    Examples
    --------
    >>> log = Log(name="step", time=[0.0, 0.1, 0.2, 0.3], command=[1.0] * 4, command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.0, 0.5, 1.0]})
    >>> SlewLag(delay=0.1, slew_up=5.0, slew_down=5.0, lag=1e-3).predict(log).round(3).tolist()
    [0.0, 0.0, 0.5, 0.998]
    """

    delay: float
    slew_up: float
    slew_down: float
    lag: float
    gain: float = 1.0
    offset: float = 0.0
    deadband: float = 0.0
    command_kind: str = "angle"
    signal: str = "output_angle"

    def __post_init__(self) -> None:
        for name in NUMBERS:
            value = getattr(self, name)
            least = {"delay": 0.0, "deadband": 0.0}.get(name, -math.inf)
            positive = name in POSITIVE
            if not is_finite(value) or value < least or (positive and value <= 0.0):
                allowed = "a positive number" if positive else "a number" + (" of at least 0" if least == 0.0 else "")
                raise InputError(name, got=value, allowed=f"{allowed} (SI)")

    def predict(self, log: Log, start_angle: float | None = None) -> Array:
        """Return the angle at the times of a log, shape (n,) [rad].

        The command is held from sample to sample, also where no pulses are sent. Until that of the first sample
        arrives, the shaft stands.

        Parameters
        ----------
        log : Log
        start_angle : float, optional
            At the first sample [rad]; the first one that was measured unless given.

        Raises
        ------
        InputError
            If the log has another kind of command, or there is no angle to start from.
        """
        if log.command_kind != self.command_kind:
            raise InputError(f"log {log.name!r}: command_kind", got=log.command_kind, allowed=self.command_kind)
        start = first_angle(log, self.signal) if start_angle is None else float(start_angle)
        course = Courses([Course.of(log, np.ones(len(log), np.bool_), start)])
        angle: Array = course.angles(LagNumbers(*(np.array([[getattr(self, name)]]) for name in NUMBERS)))[0][0]
        return angle

    def rms(self, log: Log) -> float:
        """Return the error of `predict` over the samples that count, up to the first one without pulses [rad].

        Raises
        ------
        InputError
            As for `predict`, or if no sample counts.
        """
        used = usable(log, self.signal)
        if not used.any():
            raise InputError(f"log {log.name!r}: {self.signal}", got="no value that counts",
                             allowed="values before the pulses stay away")
        error = self.predict(log)[used] - log.measured[self.signal][used]
        return float(np.sqrt(np.mean(error**2)))


def usable(log: Log, signal: str) -> NDArray[np.bool_]:
    """Return which samples of a log count for a model that has no servo without pulses, shape (n,)."""
    if signal not in log.measured:
        return np.zeros(len(log), np.bool_)
    used = log.used(signal)
    if log.sent.all():
        return used
    return used & (np.arange(len(log)) < int(np.argmin(log.sent)))


def first_angle(log: Log, signal: str) -> float:
    """Return the first measured angle of a log [rad]."""
    used = log.used(signal) if signal in log.measured else np.zeros(len(log), np.bool_)
    if not used.any():
        raise InputError(f"log {log.name!r}: {signal}", got="no value", allowed="a first value, or start_angle")
    return float(log.measured[signal][np.argmax(used)])


class LagNumbers(NamedTuple):
    """The numbers of some models, each a column (C, 1), in the order of `NUMBERS`."""

    delay: Array
    slew_up: Array
    slew_down: Array
    lag: Array
    offset: Array
    deadband: Array
    gain: Array


class Course(NamedTuple):
    """One log: when the command changed, to what, where the shaft began, and at which times its angle is wanted."""

    events: Array
    commands: Array
    start: float
    times: Array

    @classmethod
    def of(cls, log: Log, wanted: NDArray[np.bool_], start: float) -> Course:
        """Return the course of a log whose angle is wanted at some of its samples."""
        time = log.time - log.time[0]
        changed = np.append(True, log.held[1:] != log.held[:-1])
        return cls(time[changed], log.held[changed], start, time[wanted])


class Courses:
    """All logs side by side; logs with fewer changes of the command end with changes that take no time."""

    def __init__(self, courses: Sequence[Course]) -> None:
        most = max(len(course.events) for course in courses)
        self.events = np.array([_padded(course.events, most) for course in courses])
        self.commands = np.array([_padded(course.commands, most) for course in courses])
        self.spans = np.diff(self.events, axis=1)
        self.start = np.array([course.start for course in courses])
        self.times = [course.times for course in courses]
        self.log_of = np.repeat(np.arange(len(courses)), [len(times) for times in self.times])
        self.time = np.concatenate(self.times)

    def angles(self, numbers: LagNumbers) -> tuple[Array, Array]:
        """Return angle and speed at all wanted times, shape (C, N); the delay is that of the first model."""
        return self.angles_of([numbers])[0]

    def angles_of(self, several: Sequence[LagNumbers]) -> list[tuple[Array, Array]]:
        """Return the same of several sets of models, each with a delay of its own: in one go through the changes."""
        every = LagNumbers(*(np.concatenate(columns) for columns in zip(*several, strict=True)))
        found, there, first = [], self._at_changes(every), 0
        for numbers in several:
            last = first + len(numbers.lag)
            found.append(self._between(there[:, first:last], numbers))
            first = last
        return found

    def _between(self, there: Array, numbers: LagNumbers) -> tuple[Array, Array]:
        delay = float(numbers.delay[0, 0])
        place = np.concatenate([np.searchsorted(events, times - delay, side="right") - 1
                                for events, times in zip(self.events, self.times, strict=True)])
        before, place = place < 0, np.maximum(place, 0)
        since = np.where(before, 0.0, self.time - delay - self.events[self.log_of, place])
        target = numbers.gain * self.commands[self.log_of, place] + numbers.offset
        angle, speed = _advance(there[place, :, self.log_of].T, target, since, numbers)
        return angle, np.where(before, 0.0, speed)

    def _at_changes(self, numbers: LagNumbers) -> Array:
        """Return the angles where the commands change, shape (K, C, L); the delay shifts them all alike."""
        found = np.empty((self.events.shape[1], len(numbers.lag), len(self.start)))
        found[0] = self.start
        targets = numbers.gain * self.commands.T[:, None, :] + numbers.offset
        for k, span in enumerate(self.spans.T):
            size, left, way, _ = _left(targets[k] - found[k], span, numbers)
            np.add(found[k], np.copysign(size - left, way), out=found[k + 1])
        return found


def _padded(values: Array, most: int) -> Array:
    return np.append(values, np.full(most - len(values), values[-1]))


def _advance(angle: Array, target: Array, span: Array, numbers: LagNumbers) -> tuple[Array, Array]:
    """Return angle and speed after a span of time under a constant target: first at the slew rate, then by the lag."""
    size, left, way, rate = _left(target - angle, span, numbers)
    return angle + np.copysign(size - left, way), np.copysign(np.minimum(rate, left / numbers.lag), way)


def _left(error: Array, span: Array, numbers: LagNumbers) -> tuple[Array, Array, Array, Array]:
    """Return how far it was, how far it still is after a span of time, the way there, and the rate on it."""
    half = 0.5 * numbers.deadband
    way = error - np.minimum(np.maximum(error, -half), half)
    rate = np.where(way > 0.0, numbers.slew_up, numbers.slew_down)
    size = np.abs(way)
    slewing = np.minimum(np.maximum(size / rate - numbers.lag, 0.0), span)
    return size, (size - rate * slewing) * np.exp((slewing - span) / numbers.lag), way, rate


# --- The model without physics that every servo model has to beat -----------------------------------------------------

Loss = Literal["linear", "soft_l1", "huber"]
LOSSES = get_args(Loss)
_STEP = 1e-6  # of a searched number, for derivatives
_LEAST_LAG, _MOST_LAG, _MOST_DELAY = 1e-4, 5.0, 0.5  # s
_DELAYS = (0.0, 0.02, 0.04, 0.06, 0.09, 0.13, 0.2, 0.3)  # s, of the starts
_LAGS = (0.01, 0.04, 0.15)  # s
_SLEWS = (0.7, 1.0, 1.4)  # of what the logs show
_STARTS, _MOST = 4, 60  # searches, steps of each
_ROUGHLY, _CLOSELY = 1e-3, 3e-6  # of the cost: less is an end, of several starts and of the best


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
        1.5 * robust_deviation(fitted.residual(x)), 1e-9)
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

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the residuals: by copies that differ a little, by the delay from the speed."""
        copies = np.repeat(x[None, :], len(x), axis=0)
        step = np.where(x + _STEP > self.upper, -_STEP, _STEP)[1:]
        copies[np.arange(1, len(x)), np.arange(1, len(x))] += step
        angle, speed = self.courses.angles(self.numbers(copies))
        return np.column_stack([-speed[0] * self.scale["delay"], ((angle[1:] - angle[0]) / step[:, None]).T])

    def solve(self, starts: Sequence[Array], loss: Loss, scale: float, gain: float) -> Array:
        """Return where the best of the searches from some starts ends."""
        from scipy.optimize import least_squares

        inside = [np.clip(start, self.lower + 1e-9, self.upper - 1e-9) for start in starts]
        ends = [least_squares(self.residual, start, self.slopes, (self.lower, self.upper), loss=loss, f_scale=scale,
                              ftol=gain, max_nfev=_MOST) for start in inside]
        best: Array = min(ends, key=lambda end: float(end.cost)).x
        return best

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
