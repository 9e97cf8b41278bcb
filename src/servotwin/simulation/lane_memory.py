"""What lanes remember, as records: made, picked out, put back, and taken from tiles that run side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.crossing import Counted, Held, Hour, Side, remembered, side_of
from servotwin.models.engine.memory import Memories, Memory
from servotwin.models.engine.records import TILE, columns_of, fields_of, mapped, put_columns, record_of
from servotwin.models.terms.control import ABSENT, Firm
from servotwin.physics.laws import array_form

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_RECORD, _FIRM = record_of(Memory), record_of(Firm)
_remembered, _side_of = (array_form(law, __name__) for law in (remembered, side_of))
_GROUPS = {"servo": Held, "clock": Hour, "count": Counted}  # of a tile, in the order of `Side`


def nothing_yet(count: int) -> Memories:
    """Return room for what so many lanes remember."""
    return Memories(np.zeros(count, _RECORD), np.zeros(count, _FIRM))


def taken(memories: Memories, which: Any) -> Memories:
    """Return what some lanes remember, by their numbers or as a slice."""
    return Memories(*(array[which] for array in memories))


def put_back(memories: Memories, which: Any, some: Memories) -> None:
    """Let some lanes remember something else."""
    for array, values in zip(memories, some, strict=True):
        array[which] = values


def copied(memories: Memories) -> Memories:
    """Return the same, to be kept."""
    return Memories(*(array.copy() for array in memories))


def flat(tiles: NDArray[Any], group: str, name: str) -> Any:
    """Return a copy of a number of all lanes in tiles, one after the other."""
    return tiles[group][name].ravel()


def put(tiles: NDArray[Any], group: str, name: str, places: Indices, values: Any) -> None:
    """Set a number of the lanes at these places of tiles."""
    tiles[group][name][places // TILE, places % TILE] = values


def memories_of(tiles: NDArray[Any], places: Indices) -> Memories:
    """Return what the lanes at these places of tiles remember."""
    found = nothing_yet(len(places))
    if len(places):
        side = Side(*(columns_of(kind, tiles[group], places) for group, kind in _GROUPS.items()))
        regular, half_slack = flat(tiles, "count", "edges")[places] < 0, flat(tiles, "hung", "half_slack")[places]
        _put_in(found.rows, _remembered(mapped(_doubled, side), regular, half_slack, ABSENT))
    return found


def put_memories(tiles: NDArray[Any], places: Indices, memories: Memories, period: Floats) -> None:
    """Put what lanes remember back into tiles; their frames are regular, of these periods from now on [s]."""
    if len(places):
        side = _side_of(_read_from(Memory, memories.rows), period)
        for group, values in zip(_GROUPS, side, strict=True):
            put_columns(tiles[group], places, values)


def _doubled(column: NDArray[Any]) -> NDArray[Any]:
    return column.astype(np.float64) if column.dtype == np.float32 else column


def _read_from(kind: type[Any], records: NDArray[Any]) -> Any:
    """Return the fields of records as a named tuple of columns, with those in it."""
    names = records.dtype.names or ()
    return kind(*(_read(hint, records[name]) if name in names else ABSENT for name, hint in fields_of(kind)))


def _read(hint: Any, field: NDArray[Any]) -> Any:
    if hasattr(hint, "_fields"):
        return _read_from(hint, field)
    return field if field.ndim == 1 else tuple(field.T)


def _put_in(records: NDArray[Any], values: Any) -> None:
    """Set the fields of records from a named tuple of columns and numbers, with those in it."""
    for name, value in zip(values._fields, values, strict=True):
        if name not in (records.dtype.names or ()):
            continue
        if hasattr(value, "_fields"):
            _put_in(records[name], value)
        elif isinstance(value, tuple):
            for k, column in enumerate(value):
                records[name][:, k] = column
        else:
            records[name] = value
