"""Plug-ins: what other packages add, by entry points of their `pyproject.toml`.

A group of entry points is `servotwin.` and one of `GROUPS`. What is built in goes before a plug-in of the same name,
and a plug-in that cannot be loaded is left out; a warning says either in one line.
"""

from __future__ import annotations

import warnings
from collections.abc import Container, Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUPS = {
    "servos": "a package with servo files (.toml), which join the catalog by their names",
    "log_formats": "a `servotwin.logs.LogFormat`, by the name of the format",
    "bus_models": "a function that returns pairs of register model and `servotwin.bench.bus.BusFamily`",
    "commands": "a function that typer can make a command of, or a `typer.Typer`, by the name of the command",
}
"""What an entry point of each group leads to."""


def loaded(group: str, built_in: Container[str] = ()) -> dict[str, Any]:
    """Return what plug-ins add to a group, by name.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    built_in : container of str
        Names that plug-ins may not take.

    Warns
    -----
    UserWarning
        Of each plug-in that has such a name or cannot be loaded.

    Examples
    --------
    >>> loaded("servos") if not _points("servos") else {}
    {}
    """
    return {name: found for name, found in _each(group) if _is_free(group, name, built_in)}


def _each(group: str) -> Iterator[tuple[str, Any]]:
    for point in _points(group):
        found = _loaded(point)
        if found is not None:
            yield point.name, found


@cache
def _points(group: str) -> tuple[EntryPoint, ...]:
    from importlib.metadata import entry_points

    return tuple(entry_points(group=f"servotwin.{group}"))


@cache
def _loaded(point: EntryPoint) -> Any:
    """Return what an entry point leads to; None, after a warning, where that fails in whatever way."""
    try:
        return point.load()
    except Exception as error:  # it is not ours
        said = " ".join(str(error).split())
        warnings.warn(f"plug-in {point.name} ({point.value}) is left out: {type(error).__name__}: {said}", UserWarning,
                      stacklevel=5)
        return None


@cache
def _warned(text: str) -> None:
    warnings.warn(text, UserWarning, stacklevel=6)


def _is_free(group: str, name: str, built_in: Container[str]) -> bool:
    if name in built_in:
        _warned(f"plug-in {name} is left out: servotwin has {group.replace('_', ' ')} of that name itself")
        return False
    return True
