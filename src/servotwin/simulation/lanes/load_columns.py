"""Loads of many lanes: their numbers by dotted name, one by one and as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import LoadError
from servotwin.loads import Flexible, Load, Pendulum, Spring
from servotwin.models.columns import LanePieces

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Kind = TypeVar("Kind")

_PARTS: dict[str, type[Pendulum] | type[Spring] | type[Flexible]] = {
    "pendulum": Pendulum, "spring": Spring, "flexible": Flexible}
_OWN = ("inertia", "viscous_friction", "torque", "coulomb_torque")

LOAD_NAMES = (*(f"load.{name}" for name in _OWN),
              *(f"load.{part}.{f.name}" for part, kind in _PARTS.items() for f in fields(kind)))


def check_number(name: str, values: Any) -> None:
    """Raise LoadError if a number of a load, or one lane's of a column, is out of its range."""
    _, *part, key = name.split(".")
    kind = _PARTS[part[0]] if part else Load
    good, allowed = np.isfinite(values), "a finite number"
    if key in getattr(kind, "positive", ()):
        good, allowed = good & (np.asarray(values) > 0.0), "a finite positive number"
    if key in kind.not_negative:
        good, allowed = good & (np.asarray(values) >= 0.0), "a finite number of at least 0"
    if np.all(good):
        return
    if np.ndim(values) == 0:
        raise LoadError(name, got=float(values), allowed=allowed)
    lane = int(np.argmin(good))
    raise LoadError(f"{name} of lane {lane}", got=float(values[lane]), allowed=allowed)


def with_numbers(load: Load, numbers: Mapping[str, float]) -> Load:
    """Return a load with some numbers replaced, by dotted name.

    Raises
    ------
    LoadError
        If a name is that of a pendulum, a spring or a flexible body, and the load has not exactly one.

    Examples
    --------
    >>> with_numbers(Load(inertia=1e-3), {"load.torque": 0.1}).torque
    0.1
    """
    own = {name.split(".")[1]: value for name, value in numbers.items() if name.count(".") == 1}
    changed: dict[str, Any] = dict(own)
    for part in _PARTS:
        new = {name.split(".")[2]: value for name, value in numbers.items() if name.startswith(f"load.{part}.")}
        if new:
            changed[f"{part}s"] = (replace(getattr(load, part), **new),)
    return replace(load, **changed) if changed else load


def structure(load: Load) -> tuple[object, ...]:
    """Return what two loads must share to stand in one column: their parts, and which numbers these have."""
    return (len(load.springs), tuple(p.inertia is None for p in load.pendulums),
            tuple(body.inertia is None for body in load.flexibles))


def column_load(loads: Sequence[Load], load_of: Indices, numbers: Mapping[str, Array]) -> Load:
    """Return the loads of many lanes as one, whose numbers are columns (B, 1) where lanes differ.

    Parameters
    ----------
    loads : sequence of Load
        Of one structure.
    load_of : ndarray of int, shape (B,)
    numbers : mapping
        Columns (B, 1) by dotted name that stand for the loads' own.
    """
    def column(name: str, items: Sequence[Any]) -> Any:
        if name in numbers:
            return numbers[name]
        values = [getattr(item, name.rpartition(".")[2]) for item in items]
        if values[0] is None or all(value == values[0] for value in values):
            return values[0]
        return np.array(values, dtype=np.float64)[load_of, None]

    def parts(kind: Any, part: str) -> tuple[Any, ...]:
        return tuple(_unchecked(kind, {f.name: column(f"load.{part}.{f.name}", items) for f in fields(kind)})
                     for items in zip(*(getattr(load, f"{part}s") for load in loads), strict=True))

    own = {name: column(f"load.{name}", loads) for name in _OWN}
    load = _unchecked(Load, own | {f"{part}s": parts(kind, part) for part, kind in _PARTS.items()} | {"recorded": ()})
    recorded = recorded_torque(loads, load_of)
    load.__dict__["torque_pieces"] = recorded.scaled(1.0, load.torque)  # stands for the cached property
    return load


def recorded_torque(loads: Sequence[Load], load_of: Indices) -> LanePieces:
    """Return the recorded torque of each lane; a load without one has a single piece that is 0."""
    tables = [np.zeros((1, 7)) if load.recorded_pieces is None else np.array(load.recorded_pieces.table)
              for load in loads]
    count = np.array([len(table) for table in tables])
    first = np.cumsum(count) - count
    return LanePieces(np.concatenate(tables), first[load_of], count[load_of])


def _unchecked(kind: type[Kind], numbers: Mapping[str, Any]) -> Kind:
    """Return a load or part whose numbers are columns, which were checked before."""
    item = object.__new__(kind)
    for name, value in numbers.items():
        object.__setattr__(item, name, value)
    return item
