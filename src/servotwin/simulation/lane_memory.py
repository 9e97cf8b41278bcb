"""What servos that run side by side remember, as records that the general way goes on from, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.crossing import Counted, Held, Hour, Side, remembered, side_of
from servotwin.models.engine.memory import Memory
from servotwin.models.engine.records import TILE, columns_of, fields_of, mapped, put_columns, record_of
from servotwin.physics.laws import array_form

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

RECORD = record_of(Memory)
_remembered, _side_of = (array_form(law, __name__) for law in (remembered, side_of))
_GROUPS = {"servo": Held, "clock": Hour, "count": Counted}  # of a tile, in the order of `Side`


def flat(tiles: NDArray[Any], group: str, name: str) -> Any:
    """Return a copy of a number of all lanes in tiles, one after the other."""
    return tiles[group][name].ravel()


def put(tiles: NDArray[Any], group: str, name: str, places: Indices, values: Any) -> None:
    """Set a number of the lanes at these places of tiles."""
    tiles[group][name][places // TILE, places % TILE] = values


def records_of(tiles: NDArray[Any], places: Indices, temperatures: Floats) -> NDArray[Any]:
    """Return what the lanes at these places of tiles remember; temperatures (2, n) are constant there [K]."""
    records = np.zeros(len(places), RECORD)
    if len(places):
        side = Side(*(columns_of(kind, tiles[group], places) for group, kind in _GROUPS.items()))
        regular, half_slack = flat(tiles, "count", "edges")[places] < 0, flat(tiles, "hung", "half_slack")[places]
        _put_in(records, _remembered(mapped(_doubled, side), regular, half_slack, *temperatures))
        if "loose" in (tiles.dtype.names or ()):
            point = records["point"]
            for k, name in ((5, "q_m"), (6, "w_m")):
                point["y"][:, k] = flat(tiles, "loose", name)[places]
            point["mode"]["mesh"] = flat(tiles, "loose", "mesh")[places]
    return records


def put_records(tiles: NDArray[Any], places: Indices, records: NDArray[Any], period: Floats) -> None:
    """Put what lanes remember back into tiles; their frames are regular, of these periods from now on [s]."""
    if len(places):
        side = _side_of(_read_from(Memory, records), period)
        for group, values in zip(_GROUPS, side, strict=True):
            put_columns(tiles[group], places, values)


def _doubled(column: NDArray[Any]) -> NDArray[Any]:
    return column.astype(np.float64) if column.dtype == np.float32 else column


def _read_from(kind: type[Any], records: NDArray[Any]) -> Any:
    """Return the fields of records as a named tuple of columns, with those in it."""
    return kind(*(_read(hint, records[name]) for name, hint in fields_of(kind)))


def _read(hint: Any, field: NDArray[Any]) -> Any:
    if hasattr(hint, "_fields"):
        return _read_from(hint, field)
    return field if field.ndim == 1 else tuple(field.T)


def _put_in(records: NDArray[Any], values: Any) -> None:
    """Set the fields of records from a named tuple of columns and numbers, with those in it."""
    for name, value in zip(values._fields, values, strict=True):
        if hasattr(value, "_fields"):
            _put_in(records[name], value)
        elif isinstance(value, tuple):
            for k, column in enumerate(value):
                records[name][:, k] = column
        else:
            records[name] = value
