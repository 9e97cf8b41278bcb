"""Plug-ins: what other packages add, by entry points of their `pyproject.toml`.

A group of entry points is `servotwin.` and one of `GROUPS`. A built-in part goes before a plug-in of the same name,
and a plug-in that cannot be loaded is left out; a warning says either in one line.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Container
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.metadata import EntryPoints

GROUPS = {
    "servos": "a package with servo files (.toml), which join the catalog by their names",
    "log_formats": "a `servotwin.logs.LogFormat`, by the name of the format",
    "bus_models": "a function that returns pairs of register model and `servotwin.bench.bus.BusFamily`",
    "commands": "a function that typer can make a command of, or a `typer.Typer`, by the name of the command",
}
"""The object of an entry point, by group."""


def loaded(group: str, built_in: Container[str] = (), use: Callable[[Any], Any] | None = None) -> dict[str, Any]:
    """Return what plug-ins add to a group, by name.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    built_in : container of str
        Names that plug-ins may not take.
    use : callable, optional
        Makes what is returned of what an entry point leads to; where it fails the plug-in cannot be loaded.

    Warns
    -----
    UserWarning
        Of each plug-in that has such a name or cannot be loaded.

    Examples
    --------
    >>> {*loaded("servos")} <= {*named()["servos"]}
    True
    """
    found = {}
    for point in _points(group):
        if point.name in built_in:
            leave_out(f"plug-in {point.name}", f"servotwin has {group.replace('_', ' ')} of that name itself")
            continue
        try:
            found[point.name] = point.load() if use is None else use(point.load())
        except (Exception, SystemExit) as error:  # it is not ours
            leave_out(f"plug-in {point.name} ({point.value})", error)
    return found


def leave_out(what: str, why: str | BaseException) -> None:
    """Warn in one line of something that a plug-in adds and that is not taken."""
    said = why if isinstance(why, str) else f"{type(why).__name__}: {' '.join(str(why).split())}"
    warnings.warn(f"{what} is left out: {said}", UserWarning, stacklevel=3)


def named() -> dict[str, list[str]]:
    """Return the names of all plug-ins that are installed by their groups, without loading one."""
    return {group: sorted(point.name for point in _points(group)) for group in GROUPS}


def _points(group: str) -> EntryPoints:
    from importlib.metadata import entry_points

    return entry_points(group=f"servotwin.{group}")
