"""A controller on a port: the loop, and what is to be said of a run."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.control.controller import ANGLE, Controller
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Path, Reference
from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.control.ports import Port
    Array = NDArray[np.float64]


# --- Whether a loop is stable, seen before it runs --------------------------------------------------------------------

_AWAY = 1e-3  # rad and rad/s from rest, where no sign is about to change
_STEP = 1e-6  # of differences
_SLACK = 1e-6  # of poles on the unit circle


def closed_loop_poles(controller: Controller, servo: ServoInverse, *, lag: float = 0.0) -> Array:
    """Return the poles of a controller on the linear plant of a servo, from tick to tick, the largest first.

    Dry friction, bounds and deadbands of the servo do not count.

    Parameters
    ----------
    controller : Controller
        Gets the reference of one time.
    servo : ServoInverse
        Of the plant, numbers of one servo.
    lag : float
        From a command until it acts [s].

    Returns
    -------
    ndarray of complex
        Stable where all are within the unit circle.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Pid, inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> pid = Pid(period=1e-3, proportional_gain=5.0, integral_gain=9.0, filter_rate=1e3)
    >>> bool(abs(closed_loop_poles(pid, servo))[0] < 1.0)
    True
    """
    delayed = int(lag / controller.period)
    move = _plant(servo, controller.commands == ANGLE, controller.period, lag - delayed * controller.period)
    seen = Reference(_AWAY, _AWAY, _AWAY, 0.0)
    rest = controller.initial({"time": 0.0, "output_angle": 0.0}, seen)
    count = len(list(_leaves(rest)))

    def tick(z: Array) -> Array:
        """Return angle, speed, the commands that wait and the controller's state, one tick later."""
        q, waiting = z[:2], z[2:2 + delayed + 1]
        u, state = controller.step(_filled(rest, iter(z[3 + delayed:].tolist())), seen,
                                   {"time": 0.0, "output_angle": float(q[0])})
        line = np.append(waiting, u)  # the oldest first; the one before still holds for what is left of the lag
        return np.concatenate([move @ np.concatenate([q, line[:2]]), line[1:], list(_leaves(state))])

    z0 = np.concatenate([np.zeros(2 + delayed + 1), list(_leaves(rest))])
    columns = [(tick(z0 + _STEP * e) - tick(z0 - _STEP * e)) / (2.0 * _STEP) for e in np.eye(3 + delayed + count)]
    poles = np.linalg.eigvals(np.array(columns).T)
    return np.asarray(poles[np.argsort(-abs(poles))])


def check_stable(controller: Controller, servo: ServoInverse, *, lag: float = 0.0) -> None:
    """Say in one line, before it runs, that a loop is unstable, and which gain has the wrong sign.

    A controller that plans ahead, as a predictive one does, is not looked at.

    Parameters
    ----------
    controller : Controller
    servo : ServoInverse
        Of the plant.
    lag : float
        From a command until it acts [s].

    Raises
    ------
    InputError
        If a pole lies outside the unit circle.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Pid, inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> check_stable(Pid(period=1e-3, proportional_gain=-5.0, filter_rate=1e3), servo)
    Traceback (most recent call last):
    servotwin.errors.InputError: Pid(proportional_gain) makes the loop unstable: got -5.0, allowed: positive gains
    """
    if np.ndim(controller.ahead):
        return
    largest = float(abs(closed_loop_poles(controller, servo, lag=lag)[0]))
    if largest <= 1.0 + _SLACK:
        return
    for part in _parts(controller):
        for item in fields(part):
            value = getattr(part, item.name)
            if item.name.endswith(("gain", "bandwidth")) and np.any(np.asarray(value) < 0.0):
                raise InputError(f"{type(part).__name__}({item.name}) makes the loop unstable", got=value,
                                 allowed="positive gains")
    raise InputError(f"{type(controller).__name__} makes the loop unstable", got=f"a pole of {largest:.4g} a tick",
                     allowed="poles within 1: lower gains, or a shorter period or delay")


def _plant(servo: ServoInverse, looped: bool, period: float, late: float) -> Array:
    """Return how angle and speed follow themselves, the last command for `late` [s], and the new one until the tick."""
    from scipy.linalg import expm  # slow to load

    J, gain = servo.total_inertia, 1.0 / servo.volts_per_torque
    k = servo.volts_per_error if looped else 0.0
    unit = servo.volts_per_error if looped else 1.0
    A = np.array([[0.0, 1.0, 0.0], [-gain * k / J, -servo.damping / J, gain * unit / J], [0.0, 0.0, 0.0]])
    first, second = expm(A * np.array([late, period - late])[:, None, None])
    of_last = second[:2, :2] @ first[:2, 2:]
    return np.hstack([second[:2, :2] @ first[:2, :2], of_last, second[:2, 2:]])


def _leaves(state: Any) -> Iterator[float]:
    """Go through the numbers of a state, nested as it is."""
    if isinstance(state, tuple):
        for part in state:
            yield from _leaves(part)
    elif state is not None:
        yield float(state)


def _filled(state: Any, numbers: Iterator[float]) -> Any:
    """Return a state of the same nesting with other numbers."""
    if isinstance(state, tuple):
        parts = [_filled(part, numbers) for part in state]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    return None if state is None else next(numbers)


def _parts(controller: Any) -> Iterator[Any]:
    """Go through a controller and those that it stands on."""
    if is_dataclass(controller):
        yield controller
        for item in fields(controller):
            value = getattr(controller, item.name)
            if isinstance(value, Controller):
                yield from _parts(value)


# --- A controller on a port: the loop, and what is to be said of a run ------------------------------------------------

OUTPUT_STEP = 1e-3  # s, at which true signals are looked at
_NOTHING = 1e-9  # V, what a braked bridge has by rounding


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlRun:
    """The record of a controller.

    Parameters
    ----------
    path : Path
        The path that it was to follow.
    time : ndarray, shape (n,)
        Of its ticks [s].
    command : ndarray, shape (n,) or (n, joints)
        [V] or [rad].
    measured : mapping of str to ndarray
        Measured signals, a row for each tick (SI).
    true_time : ndarray, shape (m,)
        At which the true signals are known [s].
    true : mapping of str to ndarray
        True signals by name (SI), of one servo a `Result`; empty on hardware.
    """

    path: Path
    time: Array = field(repr=False)
    command: Array = field(repr=False)
    measured: Mapping[str, Array] = field(repr=False)
    true_time: Array = field(repr=False)
    true: Mapping[str, Any] = field(repr=False)

    @cached_property
    def reference(self) -> Reference:
        """The reference at the ticks."""
        return self.path.at(self.time)

    def error(self, signal: str = "output_angle") -> Array:
        """Return reference less signal at `true_time`; on hardware, less what was measured at the ticks [rad].

        Parameters
        ----------
        signal : str
            `load_angle` of a body behind a spring.
        """
        if not self.true:
            return np.asarray(self.reference.angle - self.measured[signal])
        return np.asarray(self.path.at(self.true_time).angle - self.true[signal])

    def rms_error(self, signal: str = "output_angle", since: float = 0.0) -> Any:
        """Return the root mean square of the error from a time on, a number or one for each joint [rad]."""
        error = self.error(signal)[(self.true_time if self.true else self.time) >= since]
        return _plain(np.sqrt(np.mean(error**2, axis=0)))

    def largest_error(self, signal: str = "output_angle", since: float = 0.0) -> Any:
        """Return the largest magnitude of the error from a time on, a number or one for each joint [rad]."""
        error = self.error(signal)[(self.true_time if self.true else self.time) >= since]
        return _plain(np.abs(error).max(axis=0))

    @property
    def effort(self) -> Any:
        """Root mean square of the armature voltage; nan on hardware [V]."""
        return _plain(np.sqrt(np.mean(self.true["armature_voltage"]**2, axis=0))) if self.true else math.nan

    @property
    def energy(self) -> float:
        """Taken from the supply, a result's exactly, else the sum over joints of V_bus i; nan where unknown [J]."""
        if hasattr(self.true, "energy"):
            return float(self.true.energy.supply)
        if not {"bus_voltage", "supply_current"} <= set(self.true):
            return math.nan
        power = self.true["bus_voltage"] * self.true["supply_current"]
        return float(np.trapezoid(power, self.true_time, axis=0).sum())

    @property
    def chatter(self) -> Any:
        """How far the command has gone up and down, per second [V/s or rad/s]."""
        return _plain(np.abs(np.diff(self.command, axis=0)).sum(axis=0) / self.path.duration)

    @property
    def reversals(self) -> Any:
        """How often per second the armature voltage has changed its sign; nan on hardware [1/s]."""
        if not self.true:
            return math.nan
        v = np.asarray(self.true["armature_voltage"])
        signs = np.where(np.abs(v) > _NOTHING, np.sign(v), 0.0)
        count = [np.count_nonzero(np.diff(column[column != 0.0])) for column in np.atleast_2d(signs.T)]
        return _plain(np.array(count if signs.ndim > 1 else count[0]) / self.path.duration)


def run_loop(port: Port, controller: Controller, path: Path, duration: float | None = None, *,
             check: bool = True) -> ControlRun:
    """Let a controller follow a path from its start, at rest, and return what happened.

    At each tick it measures, decides, and sends what holds until the next one.

    Parameters
    ----------
    port : Port
        Begins anew.
    controller : Controller
        Commands what the port takes.
    path : Path
        A trajectory.
    duration : float, optional
        That of the path unless given [s].
    check : bool
        Whether to look at stability first, where the port has a nominal servo.

    Raises
    ------
    InputError
        If the port does not take what the controller commands, no sensor shows what the controller looks at, or the
        loop would be unstable.

    Warns
    -----
    UserWarning
        If the controller is faster than the frames of the port, so that some of its commands are lost.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import PlainCommand, SimulatedServo, quintic
    >>> port = SimulatedServo(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> run = run_loop(port, PlainCommand(period=0.02), quintic([0.5, 1.5], times=[0.0, 1.0]))
    >>> round(57.29578 * run.rms_error(), 1)
    5.9
    """
    if controller.commands != port.takes:
        raise InputError(f"command of {type(controller).__name__}", got=controller.commands,
                         allowed=f"{port.takes}, which {type(port).__name__} takes")
    duration = path.duration if duration is None else duration
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")
    if controller.period < port.frame * (1.0 - 1e-9):
        warnings.warn(f"{type(controller).__name__}: its period of {1e3 * controller.period:g} ms is shorter than the "
                      f"frame of {1e3 * port.frame:g} ms: only the last command before each is heard", stacklevel=2)
    if check and port.nominal is not None:
        check_stable(controller, port.nominal, lag=port.lag)
    ticks = np.arange(math.ceil(duration / controller.period * (1.0 - 1e-12)), dtype=np.float64) * controller.period
    asked = _rows(path.at(np.add.outer(ticks, np.asarray(controller.ahead, dtype=np.float64))))
    port.start(_plain(np.asarray(path.at(0.0).angle)))
    try:
        commands, seen = _ticks(port, controller, ticks.tolist(), asked)
    except KeyError as error:
        raise InputError(f"sensors of {type(port).__name__}", got=f"none that shows {error.args[0]!r}",
                         allowed=f"those that {type(controller).__name__} looks at") from None
    port.wait(duration)
    true_time = np.linspace(0.0, duration, round(duration / OUTPUT_STEP) + 1)
    measured = {name: np.array([row[name] for row in seen]) for name in seen[0]}
    return ControlRun(path=path, time=ticks, command=np.array(commands), measured=measured, true_time=true_time,
                      true=port.record(true_time))


def _ticks(port: Port, controller: Controller, ticks: list[float],
           asked: list[Reference]) -> tuple[list[Any], list[Mapping[str, Any]]]:
    """Return commands and measurements of all ticks."""
    commands: list[Any] = []
    seen: list[Mapping[str, Any]] = []
    state = None
    for time, reference in zip(ticks, asked, strict=True):
        port.wait(time)
        measured = port.measure()
        if not seen:
            state = controller.initial(measured, reference)
        command, state = controller.step(state, reference, measured)
        port.send(command)
        commands.append(command)
        seen.append(measured)
    return commands, seen


def _rows(reference: Reference) -> list[Reference]:
    """Return what is asked for tick by tick; plain numbers where it is one of them."""
    columns = [column.tolist() if np.ndim(column) == 1 else list(column) for column in reference]
    return [Reference(*row) for row in zip(*columns, strict=True)]


def _plain(value: Any) -> Any:
    return value if np.ndim(value) else float(value)
