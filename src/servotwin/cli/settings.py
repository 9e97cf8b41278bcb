"""Changed parameters out of the words of `--set`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.errors import ParameterError

if TYPE_CHECKING:
    from servotwin.parameters.servo import Value


def settings(words: Sequence[str]) -> dict[str, Value]:
    """Return values (SI) by dotted name; whether they are physical is checked by `Servo.replace`.

    Parameters
    ----------
    words : sequence of str
        Such as ``"motor.armature_resistance=3.1ohm"``; a number without unit is in SI.

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
    """
    values: dict[str, Value] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise ParameterError("--set", got=word, allowed="GROUP.NAME=VALUE, such as supply.open_circuit_voltage=5V")
        if name in values:
            raise ParameterError(f"--set {name}", got=f"{values[name]} and {text}", allowed="one value")
        values[name] = _value(name, text)
    return values


def _value(name: str, text: str) -> Value:
    from servotwin.parameters import dimension_of
    from servotwin.units.quantities import quantity

    dimension = dimension_of(name)
    if dimension == "word":
        return text
    found = tuple(quantity(f"--set {name}", part, dimension, bare=True) for part in text.split(","))
    return found if len(found) > 1 else found[0]
