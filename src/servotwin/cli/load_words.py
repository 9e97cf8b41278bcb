"""The load out of the words of `--load`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from servotwin import loads
from servotwin.cli.numbers import columns_in_si, numbers
from servotwin.errors import InputError, LoadError, UnknownNameError
from servotwin.loads import Load, Part
from servotwin.models import Model, mid_travel
from servotwin.units.quantities import quantity

FORMS = {
    "inertia": "KG_M2", "viscous": "NM_S_PER_RAD", "torque": "NM", "coulomb": "NM", "arm": "MASS:LENGTH",
    "pendulum": "KG:M[:HANGING_DEG]", "spring": "NM_PER_RAD[:REST_DEG]", "recorded": "FILE.csv",
}
_DIMENSIONS = {"inertia": "inertia", "viscous": "torque per speed", "torque": "torque", "coulomb": "torque"}
_NEXT = re.compile(r",(?=\s*[A-Za-z_]+\s*=)")  # a comma that begins another part
_TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}
_TORQUES = {"torque_Nm": 1.0, "torque_mNm": 1e-3, "torque": 1.0}


def load_from(words: Sequence[str], model: Model | None = None) -> Load:
    """Return the load that `--load` options describe; a free shaft without any.

    Parameters
    ----------
    words : sequence of str
        Such as ``"inertia=1e-3,torque=0.5kgf.cm"``; numbers without unit in SI, angles in degrees.
    model : Model, optional
        What carries it: where the arm of ``"arm=0.5kg:10cm"`` is horizontal is the middle of its travel.

    Raises
    ------
    LoadError
        If a part is malformed or out of range, or an arm has no servo that it hangs on.
    UnknownNameError
        If there is no such part.

    Examples
    --------
    >>> load = load_from(["inertia=1e-3,torque=0.1", "pendulum=0.1:0.12:90"])
    >>> load.inertia, load.torque, load.pendulum.length
    (0.001, 0.1, 0.12)
    """
    total = Load()
    for name, value in parts_of(words):
        try:
            total = total + (_arm(value, model) if name == "arm" else _MAKERS[name](value))
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
    return [Path(value) for name, value in parts_of(words) if name == "recorded"]


def described(words: Sequence[str]) -> str:
    """Return the load in words.

    Examples
    --------
    >>> described([])
    'none (free shaft)'
    """
    return ", ".join(f"{name} {value}" for name, value in parts_of(words)) or "none (free shaft)"


def parts_of(words: Sequence[str]) -> list[tuple[str, str]]:
    """Return name and value of each part.

    Raises
    ------
    LoadError, UnknownNameError
        If there is no value, or no such part.

    Examples
    --------
    >>> parts_of(["inertia=1e-3,arm=0.5kg:10cm"])
    [('inertia', '1e-3'), ('arm', '0.5kg:10cm')]
    """
    parts = []
    for text in (piece for word in words for piece in _NEXT.split(word)):
        name, equals, value = (text.partition("=")[k].strip() for k in range(3))
        if not equals or not value:
            raise LoadError("--load", got=text, allowed=" or ".join(f"{key}={form}" for key, form in FORMS.items()))
        if name not in FORMS:
            raise UnknownNameError("part of --load", name, FORMS)
        parts.append((name, value))
    return parts


def mass_on_arm(text: str) -> tuple[float, float]:
    """Return mass [kg] and length [m] of an arm.

    Examples
    --------
    >>> mass_on_arm("0.5kg:10cm")
    (0.5, 0.1)
    """
    mass, colon, length = text.partition(":")
    if not colon:
        raise LoadError("--load arm", got=text, allowed="MASS:LENGTH, such as 0.5kg:10cm")
    return (quantity("--load arm", mass, "mass", positive=True),
            quantity("--load arm", length, "length", positive=True))


def torque_of(text: str) -> float:
    """Return a torque [N m], bare or with a unit; the sign counts.

    Examples
    --------
    >>> torque_of("-0.1"), round(torque_of("1 kgf.cm"), 4)
    (-0.1, 0.0981)
    """
    return _with_unit("torque", text)


def _with_unit(name: str, text: str) -> float:
    """Return a number in SI, or one with a unit; the sign counts."""
    return quantity(f"--load {name}", text, _DIMENSIONS[name], bare=True)


def _single(make: Callable[[float], Part], name: str) -> Callable[[str], Part]:
    return lambda text: make(_with_unit(name, text))


def _arm(text: str, model: Model | None) -> Part:
    mass, length = mass_on_arm(text)
    if model is None:
        raise LoadError("--load arm", got=text, allowed="only where a servo carries it")
    return loads.Pendulum(mass=mass, length=length, hanging_angle=mid_travel(model) - 0.5 * math.pi)


def _pendulum(text: str) -> Part:
    mass, length, *hanging = numbers("--load pendulum", text, ("KG", "M", "HANGING_DEG"), required=2)
    return loads.Pendulum(mass=mass, length=length, hanging_angle=math.radians(hanging[0]) if hanging else 0.0)


def _spring(text: str) -> Part:
    stiffness, *rest = numbers("--load spring", text, ("NM_PER_RAD", "REST_DEG"), required=1)
    return loads.Spring(stiffness, math.radians(rest[0]) if rest else 0.0)


def _recorded(text: str) -> Part:
    time, torque = columns_in_si(Path(text), _TIMES, _TORQUES)
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
