"""A load in words and numbers, as a sidecar holds it, under the names that a load's fields have everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from servotwin.errors import LoadError, UnknownNameError
from servotwin.loads import Flexible, Load, Pendulum, Recorded, Spring
from servotwin.loads.parts import STANDARD_GRAVITY
from servotwin.units import is_finite

_PARTS: dict[str, tuple[str, Any]] = {"pendulum": ("pendulums", Pendulum), "spring": ("springs", Spring),
                                      "recorded": ("recorded", Recorded), "flexible": ("flexibles", Flexible)}
_NUMBERS = ("inertia", "viscous_friction", "torque", "coulomb_torque")


@dataclass(frozen=True)
class Drum:
    """A weight that the shaft winds up.

    Parameters
    ----------
    mass, radius : float
        [kg], [m]
    inertia : float
        Of the drum [kg m²].
    """

    mass: float
    radius: float
    inertia: float = 0.0


def load_from_words(content: object) -> Load:
    """Return the load that a mapping describes, in SI.

    Parameters
    ----------
    content : mapping
        `inertia`, `viscous_friction`, `torque`, `coulomb_torque` and the parts `pendulum`, `spring`, `recorded`,
        `flexible`; each part a mapping of its fields, or a list of such; and `drum`, a weight that the shaft winds up.

    Raises
    ------
    LoadError, UnknownNameError
        If it is none, has an unknown name, or a part lacks a number.

    Examples
    --------
    >>> load_from_words({"inertia": 1e-3, "pendulum": {"mass": 0.5, "length": 0.1}}).pendulum.mass
    0.5
    """
    if not isinstance(content, Mapping):
        raise LoadError("load", got=content, allowed='a mapping, such as {"inertia": 0.001}')
    given: dict[str, Any] = {}
    drum = Load()
    for name, value in content.items():
        if name in _NUMBERS:
            given[name] = value
        elif name == "drum":
            drum = _drum(value)
        elif name in _PARTS:
            key, kind = _PARTS[name]
            given[key] = tuple(_part(f"load.{name}", kind, each) for each in
                               (value if isinstance(value, list) else [value]))
        else:
            raise UnknownNameError("name in a load", name, (*_NUMBERS, *_PARTS, "drum"))
    return Load(**given) + drum


def _drum(content: object) -> Load:
    """Return the load of a weight on a drum: its torque, and what turns with the shaft."""
    drum = _part("load.drum", Drum, content)
    for name, value in (("mass", drum.mass), ("radius", drum.radius), ("inertia", drum.inertia)):
        if not is_finite(value) or value < 0.0:
            raise LoadError(f"load.drum: {name}", got=value, allowed="a number, 0 or more")
    return Load(torque=drum.mass * STANDARD_GRAVITY * drum.radius, inertia=drum.mass * drum.radius**2 + drum.inertia)


def words_of_load(load: Load) -> dict[str, Any]:
    """Return what `load_from_words` makes the same load of; what is 0 or absent is left out.

    Examples
    --------
    >>> from servotwin.loads import Inertia, Spring
    >>> words_of_load(Inertia(1e-3) + Spring(2.0))
    {'inertia': 0.001, 'spring': {'stiffness': 2.0, 'rest_angle': 0.0}}
    """
    words: dict[str, Any] = {name: getattr(load, name) for name in _NUMBERS if getattr(load, name) != 0.0}
    for name, (key, kind) in _PARTS.items():
        parts = [{f.name: _plain(getattr(part, f.name)) for f in fields(kind) if getattr(part, f.name) is not None}
                 for part in getattr(load, key)]
        if parts:
            words[name] = parts[0] if len(parts) == 1 else parts
    return words


def _part(what: str, kind: Any, content: object) -> Any:
    if not isinstance(content, Mapping):
        raise LoadError(what, got=content, allowed="a mapping of its fields")
    names = [f.name for f in fields(kind)]
    for name in content:
        if name not in names:
            raise UnknownNameError(f"name in {what}", name, names)
    lacking = [f.name for f in fields(kind) if f.default is MISSING and f.name not in content]
    if lacking:
        raise LoadError(what, got=", ".join(content) or "nothing", allowed=f"also {', '.join(lacking)}")
    return kind(**content)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
