"""A servo as a delay, a slew rate, a lag and a deadband: its motion in closed form, for many logs at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.log import Log
from servotwin.units import is_finite

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
        What y is. For the feedback voltage, V stands for rad in every unit above.

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
    """Return which samples of a log count for a model that knows no servo without pulses, shape (n,)."""
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
