"""Registers out of the words of `--register`."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from servotwin.errors import ParameterError

if TYPE_CHECKING:
    from servotwin.parameters import Servo

_WHOLE = re.compile(r"[+-]?\d+|0[xX][0-9a-fA-F]+")
_FORM = "NAME=VALUE, such as P_Coefficient=16, or the name of a set, such as lerobot"


class Registers(NamedTuple):
    """What words say: names of sets, and single values, which go before them.

    Parameters
    ----------
    sets : tuple of str
    values : dict of str to int
    """

    sets: tuple[str, ...]
    values: dict[str, int]


def registers(words: Sequence[str]) -> Registers:
    """Return sets and raw values by name; whether there are such registers is checked when they are set.

    Parameters
    ----------
    words : sequence of str
        Such as ``"P_Coefficient=16"`` or ``"lerobot"``; several in one word are divided by commas.

    Raises
    ------
    ParameterError
        If one has no name or no whole number, or a name comes twice.

    Examples
    --------
    >>> registers(["lerobot,P_Coefficient=32", "ID=0x03"])
    Registers(sets=('lerobot',), values={'P_Coefficient': 32, 'ID': 3})
    """
    sets: dict[str, None] = {}
    found: dict[str, int] = {}
    for word in (part for each in words for part in each.split(",")):
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not name or bool(equals) is not bool(text):
            raise ParameterError("--register", got=word, allowed=_FORM)
        if not equals:
            sets[name] = None
            continue
        if _WHOLE.fullmatch(text) is None:
            raise ParameterError(f"--register {name}", got=text, allowed="a whole number, as it is written into it")
        if name in found:
            raise ParameterError(f"--register {name}", got=f"{found[name]} and {text}", allowed="one value")
        found[name] = int(text, 0) if "x" in text.lower() else int(text)
    return Registers(tuple(sets), found)


def with_registers(servo: Servo, words: Sequence[str]) -> Servo:
    """Return a servo with the registers of its own family that `--register` sets.

    Raises
    ------
    ParameterError
        If the servo has no registers, or a value is not one of theirs.
    UnknownNameError
        If there is no register, or no set, of a name.

    Examples
    --------
    >>> import servotwin as st
    >>> softer = with_registers(st.load_servo("feetech-sts3215-12v"), ["P_Coefficient=16"])
    >>> round(softer.firmware.proportional_gain, 3)
    2.608
    """
    from servotwin.parameters import REGISTER_FAMILIES

    if not words:
        return servo
    given, family = registers(words), servo.sheet.get("registers")
    if family not in REGISTER_FAMILIES:
        raise ParameterError(f"--register for {servo.name}", got=", ".join((*given.sets, *given.values)),
                             allowed="a servo with registers, whose file says registers = "
                             + " or ".join(f'"{name}"' for name in REGISTER_FAMILIES)
                             + " under [sheet]; --set firmware.NAME=VALUE changes any servo")
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        for name in given.sets:
            servo = REGISTER_FAMILIES[family](name, servo=servo)
        return REGISTER_FAMILIES[family](given.values, servo=servo) if given.values else servo
