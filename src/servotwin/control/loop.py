"""A controller on a port: the loop, and what is to be said of a run."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.control.reference import Path, Reference
from servotwin.control.stability import check_stable
from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.control.controller import Controller
    from servotwin.control.ports import Port

    Array = NDArray[np.float64]

OUTPUT_STEP = 1e-3  # s, at which true signals are looked at
_NOTHING = 1e-9  # V, what a braked bridge has by rounding


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlRun:
    """What a controller has done.

    Parameters
    ----------
    path : Path
        What it was told to follow.
    time : ndarray, shape (n,)
        Of its ticks [s].
    command : ndarray, shape (n,) or (n, joints)
        [V] or [rad].
    measured : mapping of str to ndarray
        What it saw, a row for each tick (SI).
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
        """What was asked for at the ticks."""
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
        Whether to look at stability first, where the port knows its servo.

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
