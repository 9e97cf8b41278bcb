"""Results as data: what `--json` writes of dataclasses, named tuples and arrays."""

from __future__ import annotations

import dataclasses
import enum
import os
from collections.abc import Mapping
from operator import attrgetter
from typing import Any

import numpy as np

Shown = Mapping[type, str]
"""By class, what is shown, in order, with spaces between: an attribute, or `name=attribute`, such as `K=line.slope`."""


def plain(found: Any, shown: Shown | None = None) -> Any:
    """Return a result as JSON has it: objects by their attributes, arrays and other sequences as lists.

    Parameters
    ----------
    found : object
        Numbers, words, arrays, dataclasses, named tuples, and mappings and sequences of them; complex numbers become
        pairs, paths their text. Of a subclass what is shown of its base is shown.
    shown : mapping of type to str
        Attributes that are shown of objects of a class; all fields of others. ``str`` in the place of an attribute is
        the object in words.

    Raises
    ------
    TypeError
        If it is something else.

    Examples
    --------
    >>> @dataclasses.dataclass
    ... class Cause:
    ...     name: str
    ...     values: np.ndarray
    >>> plain([Cause("sag", np.array([1.0, 2.0]))])
    [{'name': 'sag', 'values': [1.0, 2.0]}]
    >>> plain(Cause("sag", np.ones(2)), {Cause: "cause=name"})
    {'cause': 'sag'}
    """
    words = next((shown[kind] for kind in type(found).__mro__ if kind in shown), None) if shown else None
    if words is not None:
        return {name: plain(str(found) if of == "str" else attrgetter(of)(found), shown)
                for name, of in map(_pair, words.split())}
    if found is None or (isinstance(found, str | bool | int | float) and not isinstance(found, enum.Enum)):
        return found
    if isinstance(found, enum.Enum):
        return plain(found.value, shown)
    if isinstance(found, complex):
        return [found.real, found.imag]
    if isinstance(found, np.ndarray | np.generic):
        return plain(found.tolist(), shown)
    if dataclasses.is_dataclass(found) and not isinstance(found, type):
        return {field.name: plain(getattr(found, field.name), shown) for field in dataclasses.fields(found)}
    if isinstance(found, tuple) and hasattr(found, "_asdict"):
        return {name: plain(value, shown) for name, value in found._asdict().items()}
    if isinstance(found, Mapping):
        return {name: plain(value, shown) for name, value in found.items()}
    if isinstance(found, list | tuple | set | frozenset):
        return [plain(value, shown) for value in (sorted(found) if isinstance(found, set | frozenset) else found)]
    if isinstance(found, os.PathLike):
        return os.fspath(found)
    raise TypeError(f"{type(found).__name__} is no data")


def facts_of(found: Any, shown: Shown | None = None) -> dict[str, Any]:
    """Return an object or a mapping as JSON has it (see `plain`)."""
    return dict(plain(found, shown))


def _pair(word: str) -> tuple[str, str]:
    name, equals, of = word.partition("=")
    return name, of if equals else name
