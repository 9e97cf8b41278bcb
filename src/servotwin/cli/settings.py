"""Changed parameters out of the words of `--set`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.errors import ParameterError

if TYPE_CHECKING:
    from servotwin.parameters.servo import Value


def settings(words: Sequence[str]) -> dict[str, Value]:
    """Return values by dotted name; whether they are physical is checked by `Servo.replace`.

    Parameters
    ----------
    words : sequence of str
        Such as ``"motor.armature_resistance=3.1"``; SI.

    Raises
    ------
    ParameterError
        If one has no name or no value, or a name comes twice.

    Examples
    --------
    >>> settings(["motor.armature_resistance=3.1", "electronics.off_state=coast"])
    {'motor.armature_resistance': 3.1, 'electronics.off_state': 'coast'}
    """
    values: dict[str, Value] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise ParameterError("--set", got=word, allowed="GROUP.NAME=VALUE, such as motor.armature_resistance=3.1")
        if name in values:
            raise ParameterError(f"--set {name}", got=f"{values[name]} and {text}", allowed="one value")
        values[name] = _value(text)
    return values


def _value(text: str) -> Value:
    try:
        return tuple(float(part) for part in text.split(",")) if "," in text else float(text)
    except ValueError:
        return text
