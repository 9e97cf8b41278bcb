"""Why a servo buzzes: how it drives at rest, and which single number would stop that."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from servotwin import signals
from servotwin.datasheet.conditions import changed
from servotwin.errors import InputError
from servotwin.loads import Coulomb, as_load
from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive, mid_travel
from servotwin.physics.gear import output_torque
from servotwin.simulation.metrics import resolution
from servotwin.simulation.rest import rest_of
from servotwin.simulation.simulator import simulate

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.signals import Signal
    from servotwin.simulation import Rest, Result

_STEP = math.radians(10.0)
_AT, _DURATION = 0.1, 3.0  # s
_DOUBLINGS, _HALVINGS = 12, 3
_FIRST = 1.0 / 64.0  # of the servo's own friction, with which the search begins
_WIDEST = math.radians(10.0)  # of a deadband, half width


class Remedy(NamedTuple):
    """A number that would bring a servo to rest, all others as they are.

    Parameters
    ----------
    name : str
        Of the parameter; "load.coulomb_torque" is friction at the output shaft, beside that of the servo.
    now, needed : float
        As it is, and the least change of it that was found to do, within 9 % (SI).
    """

    name: str
    now: float
    needed: float


@dataclass(frozen=True, kw_only=True)
class Buzz:
    """How a servo drives at rest.

    Parameters
    ----------
    rest : Rest, optional
        None where command or load do not stand still for half a second.
    remedies : tuple of Remedy
        Deadband, friction and gain, each that does; empty where the servo is quiet.
    """

    rest: Rest | None
    remedies: tuple[Remedy, ...]


def buzz(model: Model, load: Load | Part | None = None, command: Signal | None = None, *,
         duration: float = _DURATION) -> Buzz:
    """Return how often and with what current a servo drives at rest, and which number would stop it.

    What stops it is found by simulation: a number is changed by factors of two until the servo is quiet, and then
    bisected.

    Parameters
    ----------
    model : PulseServo, PulseServoInductive, BoundedServo or DigitalServo
    load : Load, optional
        Nothing unless given.
    command : Signal, optional
        A step of 10° to the middle of the travel unless given.
    duration : float
        Of the run [s].

    Raises
    ------
    InputError
        If the model is another, or turns without end.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb").replace(
    ...     {"electronics.stretcher_gain": 1000.0, "electronics.off_state": "coast"})
    >>> found = buzz(st.PulseServo(servo))
    >>> found.rest.swing > 0.0, found.remedies[0].name
    (True, 'electronics.deadband')
    """
    if not isinstance(model, PulseServo | PulseServoInductive | BoundedServo | DigitalServo) or model.endless:
        raise InputError("model that may buzz", got=model, allowed="a servo that holds an angle behind a bridge")
    middle = mid_travel(model)
    told = command or signals.step(middle - _STEP, middle, at=_AT, unit="rad")
    hung = as_load(load)

    def run(one: Model, friction: float = 0.0) -> Result:
        return simulate(one, told, duration=duration, load=hung + Coulomb(friction), output_times=[duration])

    def rest(one: Model, friction: float = 0.0) -> Rest | None:
        return rest_of(run(one, friction), with_current=False)

    found = run(model).rest
    if found is None or not found.restless:
        return Buzz(rest=found, remedies=())
    return Buzz(rest=found, remedies=tuple(remedy for remedy in (
        _deadband(model, rest), _friction(model, rest), _gain(model, rest)) if remedy is not None))


def _deadband(model: Model, rest: Callable[..., Rest | None]) -> Remedy | None:
    name = ("firmware.deadband_angle" if isinstance(model, DigitalServo) else "electronics.voltage_deadband" if
            isinstance(model, BoundedServo) else "electronics.deadband")
    now, finest = model.value_or(name, 0.0), float(resolution(model))
    if isinstance(model, DigitalServo):
        now = float(model.firmware().h)
        first, most = max(now, 0.5 * finest), _WIDEST
    elif now > 0.0:
        first, most = now, now * _WIDEST / (0.5 * finest)
    else:
        return None
    return _remedy(name, now, first, most, lambda value: rest(changed(model, {name: value})))


def _friction(model: Model, rest: Callable[..., Rest | None]) -> Remedy | None:
    own = float(output_torque(model.value("friction.coulomb_torque_forward"), model.value("gear.gear_reduction")))
    if not own > 0.0:
        return None

    def quiet(value: float) -> bool:
        return _quiet(rest(model, value))

    first = _FIRST * own
    for _ in range(_DOUBLINGS if quiet(first) else 0):
        if not quiet(0.5 * first):
            return _remedy("load.coulomb_torque", 0.0, 0.5 * first, first, lambda value: rest(model, value))
        first *= 0.5
    return _remedy("load.coulomb_torque", 0.0, first, own, lambda value: rest(model, value))


def _gain(model: Model, rest: Callable[..., Rest | None]) -> Remedy | None:
    name = ("firmware.proportional_gain" if isinstance(model, DigitalServo) else "electronics.bridge_gain" if
            isinstance(model, BoundedServo) else "electronics.stretcher_gain")
    now = model.value(name)
    found = _remedy(name, now, 1.0, 2.0**_DOUBLINGS, lambda factor: rest(changed(model, {name: now / factor})))
    return None if found is None else found._replace(needed=now / found.needed)


def _quiet(found: Rest | None) -> bool:
    return found is not None and not found.restless and not found.moves_on


def _remedy(name: str, now: float, first: float, most: float, at: Callable[[float], Rest | None]) -> Remedy | None:
    """Return the least value beyond `first`, which does not do, and up to `most`, at which a servo is quiet."""
    low, high = first, 2.0 * first
    while not _quiet(at(high)):
        low, high = high, 2.0 * high
        if low >= most:
            return None
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if _quiet(at(middle)) else (middle, high)
    return Remedy(name, now, high)
