"""Whether a loop is stable, seen before it runs: the poles of controller and sampled plant, tick by tick."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.control.controller import ANGLE, Controller
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Reference
from servotwin.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_AWAY = 1e-3  # rad and rad/s from rest, where no sign is about to change
_STEP = 1e-6  # of differences
_SLACK = 1e-6  # of poles on the unit circle


def closed_loop_poles(controller: Controller, servo: ServoInverse, *, lag: float = 0.0) -> Array:
    """Return the poles of a controller on the linear plant of a servo, from tick to tick, the largest first.

    Dry friction, bounds and deadbands of the servo do not count.

    Parameters
    ----------
    controller : Controller
        Told the reference of one time.
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
