"""A controller: a plain function of measured signals, with its state in the hands of the one who calls it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from servotwin.control.reference import Reference
from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from servotwin.parameters import Servo


# --- A controller -----------------------------------------------------------------------------------------------------

Measured = Mapping[str, Any]
"""Signals of the sensors: `time` and signals by name (SI), numbers of one servo or arrays (n,) of joints."""

VOLTAGE, ANGLE = "armature_voltage", "command_angle"
"""Commands of a controller: the voltage of the motor [V], past the servo's own loop, or an angle [rad]."""


class Decision(NamedTuple):
    """The decision of a controller: a command [V or rad], and the state to continue from."""

    command: Any
    state: Any


@runtime_checkable
class Controller(Protocol):
    """A frozen object whose numbers are its own; its state pickles, compares, and is passed in and out.

    A controller has measured signals only, so that the same object runs on `Simulator`, on `ServoDrive` and on
    hardware. All of it is elementwise: numbers of one servo, or arrays (n,) of the joints of a robot.
    """

    @property
    def period(self) -> float:
        """Of its own ticks [s]."""

    @property
    def commands(self) -> str:
        """Kind of its commands: "armature_voltage" or "command_angle"."""

    @property
    def ahead(self) -> Any:
        """How far ahead it is given the reference: 0, a lead [s], or an array of them."""

    def initial(self, measured: Measured, reference: Reference) -> Any:
        """Return its state before the first tick."""

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return what to command from now until the next tick."""


@dataclass(frozen=True, kw_only=True)
class PlainCommand:
    """Sends the reference as it is, or a little ahead: what a program without a controller does.

    Parameters
    ----------
    period : float
        Positive [s].
    ahead : float
        By which the reference is sent early, against the lag of the servo [s].

    Examples
    --------
    >>> from servotwin.control import Reference
    >>> PlainCommand(period=0.02).step(None, Reference(0.5), {"time": 0.0})
    Decision(command=0.5, state=None)
    """

    period: float
    ahead: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)

    @property
    def commands(self) -> str:
        """An angle."""
        return ANGLE

    def initial(self, measured: Measured, reference: Reference) -> None:
        """Return nothing: it remembers nothing."""

    def step(self, state: None, reference: Reference, measured: Measured) -> Decision:
        """Return the angle of the reference."""
        return Decision(reference.angle, None)


def check_period(controller: Any) -> None:
    """Raise InputError unless the period of a controller is a positive number."""
    if not (is_finite(controller.period) and controller.period > 0.0):
        raise InputError(f"period of {type(controller).__name__}", got=controller.period,
                         allowed="a positive number of seconds")


def check_numbers(thing: Any, names: tuple[str, ...], *, positive: bool = False) -> None:
    """Raise InputError unless fields are finite numbers, or arrays of them; positive ones where that is asked for."""
    for name in names:
        try:
            value = np.asarray(getattr(thing, name), dtype=np.float64)
        except (TypeError, ValueError):
            value = np.full((), np.nan)
        if not (np.isfinite(value).all() and (not positive or (value > 0.0).all())):
            raise InputError(f"{name} of {type(thing).__name__}", got=getattr(thing, name),
                             allowed=f"a {'positive' if positive else 'finite'} number, or one for each joint (SI)")


def check_commands(controller: Any, commands: str, what: str) -> None:
    """Raise InputError unless a controller that another one stands on commands what that needs."""
    if getattr(controller, "commands", None) != commands:
        raise InputError(f"controller of {what}", got=getattr(controller, "commands", controller),
                         allowed=f"a controller that commands {commands}")


def clipped(value: Any, lower: Any, upper: Any) -> Any:
    """Return a number, or an array, within bounds.

    Examples
    --------
    >>> clipped(3.0, -1.0, 1.0)
    1.0
    """
    if isinstance(value, float) and isinstance(lower, float) and isinstance(upper, float):
        return min(max(value, lower), upper)  # much faster than an array of one
    return np.clip(value, lower, upper)


# --- Sensors of a controller: signals through converters, with their steps, noise and delay ---------------------------

_SAME = 1e-9  # s, as near as sums of steps come to a time


class Sensor(Protocol):
    """One converter: it looks at a signal and shows numbers by name."""

    @property
    def signal(self) -> str:
        """The signal that it looks at, by the name that it has in results."""

    @property
    def delay(self) -> float:
        """How old what it shows is, at least [s]."""

    def shown(self, value: Any, draw: Any) -> Mapping[str, Any]:
        """Return what it shows of a value (SI), with a draw of standard noise."""


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """An angle, or any other signal, in steps: an encoder, a bus that reports counts, a converter of a current.

    Parameters
    ----------
    count : float
        A step; 0: none (SI).
    signal : str
        Measured signal.
    shows : str, optional
        As what the controller sees it; the signal itself unless given.
    ratio : float or ndarray
        By which it is multiplied, such as 1/N for an encoder on the motor [1].
    noise : float
        Standard deviation before the step (SI).
    delay : float
        [s]

    Examples
    --------
    >>> Encoder(count=0.5).shown(1.3, 0.0)
    {'output_angle': 1.5}
    """

    count: float = 2.0 * math.pi / 4096.0
    signal: str = "output_angle"
    shows: str | None = None
    ratio: Any = 1.0
    noise: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        _check(self, ("count", "noise", "delay"))

    def shown(self, value: Any, draw: Any) -> dict[str, Any]:
        """Return the nearest step."""
        return {self.shows or self.signal: _stepped(self.ratio * value + self.noise * draw, self.count)}


@dataclass(frozen=True, kw_only=True)
class Tap:
    """A wire at the wiper of the potentiometer, and a converter: the angle by the controller's own calibration.

    Parameters
    ----------
    feedback_gain, feedback_offset : float
        p [V/rad] and b_o [V] as the controller believes; `Tap.of(servo)` takes those of a servo.
    bits : int
        Of the converter.
    reference_voltage : float
        At which it is full [V].
    noise : float
        Standard deviation [V].
    delay : float
        [s]

    Examples
    --------
    >>> import servotwin as st
    >>> tap = Tap.of(st.load_servo("hitec-hs-755hb"), bits=10, reference_voltage=2.5)
    >>> {name: round(value, 4) for name, value in tap.shown(1.0, 0.0).items()}
    {'feedback_voltage': 1.001, 'output_angle': 0.9846}
    """

    feedback_gain: float
    feedback_offset: float = 0.0
    bits: int = 10
    reference_voltage: float = 5.0
    noise: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        _check(self, ("noise", "delay"))
        if not self.feedback_gain or self.bits < 1 or not self.reference_voltage > 0.0:
            raise InputError("Tap", got=f"{self.feedback_gain} V/rad, {self.bits} bit, {self.reference_voltage} V",
                             allowed="a gain that is not 0, at least one bit, a positive voltage")

    @classmethod
    def of(cls, servo: Servo, *, bits: int = 10, reference_voltage: float = 5.0, noise: float = 0.0,
           delay: float = 0.0) -> Tap:
        """Return the tap of a controller that believes in the potentiometer of a servo."""
        p, b_o = servo.get("potentiometer.feedback_gain"), servo.get("potentiometer.feedback_offset")
        if not isinstance(p, float):
            raise InputError("Tap.of(servo)", got=f"{servo.name}, without potentiometer.feedback_gain",
                             allowed="a servo that gives it")
        return cls(feedback_gain=p, feedback_offset=float(b_o or 0.0), bits=bits,  # type: ignore[arg-type]
                   reference_voltage=reference_voltage, noise=noise, delay=delay)

    @property
    def signal(self) -> str:
        """The wiper's voltage."""
        return "feedback_voltage"

    def shown(self, value: Any, draw: Any) -> dict[str, Any]:
        """Return the voltage of the nearest count, and the angle that it stands for."""
        count = self.reference_voltage / 2**self.bits
        v_o = _stepped(clipped(value + self.noise * draw, 0.0, self.reference_voltage - count), count)
        return {"feedback_voltage": v_o, "output_angle": (v_o - self.feedback_offset) / self.feedback_gain}


class Readings:
    """Signals of sensors over time, each as old as its delay, with noise that is drawn once for all of them.

    Parameters
    ----------
    sensors : sequence of Sensor
    seed : int
        Of the noise.
    servos : int, optional
        How many servos each sensor looks at, where values are arrays (n,); values are numbers unless given.

    Examples
    --------
    >>> late = Readings([Encoder(count=0.0, delay=0.1)], seed=0)
    >>> [late.at(t, lambda name: 10.0 * t)["output_angle"] for t in (0.0, 0.1, 0.2)]
    [0.0, 0.0, 1.0]
    """

    def __init__(self, sensors: Sequence[Sensor], seed: int, servos: int | None = None) -> None:
        self._sensors, self._servos, self._draws = tuple(sensors), servos, np.random.default_rng(seed)
        self._seen: list[deque[tuple[float, Mapping[str, Any]]]] = [deque() for _ in self._sensors]

    def at(self, time: float, true: Callable[[str], Any]) -> Measured:
        """Return what all show at a time [s], not before the last one, and that time; `true` gives a signal by name."""
        found: dict[str, Any] = {"time": time}
        for sensor, seen in zip(self._sensors, self._seen, strict=True):
            draw = self._draws.standard_normal(self._servos) if getattr(sensor, "noise", 0.0) else 0.0
            seen.append((time, sensor.shown(true(sensor.signal), draw)))
            while len(seen) > 1 and seen[1][0] <= time - sensor.delay + _SAME:
                seen.popleft()
            found.update(seen[0][1])
        return found


def _stepped(value: Any, count: float) -> Any:
    if count == 0.0:
        return value
    return count * (math.floor(value / count + 0.5) if isinstance(value, float) else np.floor(value / count + 0.5))


def _check(sensor: Any, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(sensor, name)
        if not (is_finite(value) and value >= 0.0):
            raise InputError(f"{name} of {type(sensor).__name__}", got=value, allowed="a number of at least 0 (SI)")
