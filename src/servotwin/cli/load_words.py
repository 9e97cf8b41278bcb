"""The load out of the words of `--load`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from servotwin import loads
from servotwin.cli.numbers import numbers, read_columns
from servotwin.errors import InputError, LoadError, UnknownNameError
from servotwin.loads import Load, Part

FORMS = {
    "inertia": "KG_M2", "viscous": "NM_S_PER_RAD", "torque": "NM", "coulomb": "NM",
    "pendulum": "KG:M[:HANGING_DEG]", "spring": "NM_PER_RAD[:REST_DEG]", "recorded": "FILE.csv",
}
_NEXT = re.compile(r",(?=\s*[A-Za-z_]+\s*=)")  # a comma that begins another part
_TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}
_TORQUES = {"torque_Nm": 1.0, "torque_mNm": 1e-3, "torque": 1.0}


def load_from(words: Sequence[str]) -> Load:
    """Return the load that `--load` options describe; a free shaft without any.

    Parameters
    ----------
    words : sequence of str
        Such as ``"inertia=1e-3,viscous=1e-4"``; numbers in SI, angles in degrees.

    Raises
    ------
    LoadError
        If a part is malformed or out of range.
    UnknownNameError
        If there is no such part.

    Examples
    --------
    >>> load = load_from(["inertia=1e-3,torque=0.1", "pendulum=0.1:0.12:90"])
    >>> load.inertia, load.torque, load.pendulum.length
    (0.001, 0.1, 0.12)
    """
    total = Load()
    for name, value in _parts(words):
        try:
            total = total + _MAKERS[name](value)
        except InputError as error:
            what = error.what if error.what == f"--load {name}" else f"--load {name}: {error.what}"
            raise LoadError(what, got=error.got, allowed=error.allowed) from None
    return total


def recorded_files(words: Sequence[str]) -> list[Path]:
    """Return the files that `--load` options read.

    Examples
    --------
    >>> [path.name for path in recorded_files(["inertia=1,recorded=torque.csv"])]
    ['torque.csv']
    """
    return [Path(value) for name, value in _parts(words) if name == "recorded"]


def described(words: Sequence[str]) -> str:
    """Return the load in words.

    Examples
    --------
    >>> described([])
    'none (free shaft)'
    """
    return ", ".join(f"{name} {value}" for name, value in _parts(words)) or "none (free shaft)"


def _parts(words: Sequence[str]) -> list[tuple[str, str]]:
    parts = []
    for text in (piece for word in words for piece in _NEXT.split(word)):
        name, equals, value = (text.partition("=")[k].strip() for k in range(3))
        if not equals or not value:
            raise LoadError("--load", got=text, allowed=" or ".join(f"{key}={form}" for key, form in FORMS.items()))
        if name not in FORMS:
            raise UnknownNameError("part of --load", name, FORMS)
        parts.append((name, value))
    return parts


def _single(make: Callable[[float], Part], name: str) -> Callable[[str], Part]:
    return lambda text: make(numbers(f"--load {name}", text, (FORMS[name],))[0])


def _pendulum(text: str) -> Part:
    mass, length, *hanging = numbers("--load pendulum", text, ("KG", "M", "HANGING_DEG"), required=2)
    return loads.Pendulum(mass=mass, length=length, hanging_angle=math.radians(hanging[0]) if hanging else 0.0)


def _spring(text: str) -> Part:
    stiffness, *rest = numbers("--load spring", text, ("NM_PER_RAD", "REST_DEG"), required=1)
    return loads.Spring(stiffness, math.radians(rest[0]) if rest else 0.0)


def _recorded(text: str) -> Part:
    time, torque = read_columns(Path(text), _TIMES, _TORQUES)
    return loads.Recorded(time, torque)


_MAKERS: dict[str, Callable[[str], Part]] = {
    "inertia": _single(loads.Inertia, "inertia"),
    "viscous": _single(loads.Viscous, "viscous"),
    "torque": _single(loads.Constant, "torque"),
    "coulomb": _single(loads.Coulomb, "coulomb"),
    "pendulum": _pendulum,
    "spring": _spring,
    "recorded": _recorded,
}
