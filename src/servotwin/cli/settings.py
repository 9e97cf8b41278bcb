"""Changed parameters out of the words of `--set`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.errors import ParameterError

if TYPE_CHECKING:
    from servotwin.parameters.servo import Value


_AWAY = "none"  # takes a value, or all of a group, away


def settings(words: Sequence[str]) -> dict[str, Value | None]:
    """Return values (SI) by dotted name, None for what is taken away; `Servo.replace` checks whether they are physical.

    Parameters
    ----------
    words : sequence of str
        Such as ``"motor.armature_resistance=3.1ohm"``; a number without unit is in SI. ``"stops.upper_angle=none"``
        takes a value away, ``"stops=none"`` all of its group.

    Raises
    ------
    ParameterError
        If one has no name or no value, or a name comes twice.
    UnknownNameError
        If no parameter has this name.
    InputError
        If a number is none, or its unit measures something else.

    Examples
    --------
    >>> settings(["motor.armature_resistance=3.1", "electronics.deadband=8us", "electronics.off_state=coast"])
    {'motor.armature_resistance': 3.1, 'electronics.deadband': 8e-06, 'electronics.off_state': 'coast'}
    >>> settings(["stops=none"])
    {'stops.lower_angle': None, 'stops.upper_angle': None, 'stops.restitution': None}
    """
    values: dict[str, Value | None] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise ParameterError("--set", got=word, allowed="GROUP.NAME=VALUE, such as supply.open_circuit_voltage=5V, "
                                 "or GROUP=none")
        for each in _names(name, text):
            if each in values:
                got = _AWAY if values[each] is None else values[each]
                raise ParameterError(f"--set {each}", got=f"{got} and {text}", allowed="one value")
            values[each] = _value(each, text)
    return values


def _names(name: str, text: str) -> tuple[str, ...]:
    """Return the parameters that a name means: itself, or where a group is taken away all of it."""
    from dataclasses import fields

    from servotwin.parameters import GROUPS

    if text.lower() != _AWAY or name not in GROUPS:
        return (name,)
    return tuple(f"{name}.{f.name}" for f in fields(GROUPS[name]))


def _value(name: str, text: str) -> Value | None:
    from servotwin.parameters import dimension_of
    from servotwin.units.quantities import quantity

    dimension = dimension_of(name)
    if text.lower() == _AWAY:
        return None
    if dimension == "word":
        return text
    found = tuple(quantity(f"--set {name}", part, dimension, bare=True) for part in text.split(","))
    return found if len(found) > 1 else found[0]
