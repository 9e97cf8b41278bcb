"""Named tuples as columns: a tile holds many of them, each field a row of lanes, in plain code and compiled."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import cache
from types import SimpleNamespace
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

TILE = 128  # lanes that go together; what they work with fits into the nearest caches

_LINE = 64  # bytes

Kind = TypeVar("Kind", bound=tuple[Any, ...])


def fields_of(kind: Any) -> tuple[tuple[str, Any], ...]:
    """Return names and types of the fields of a named tuple."""
    return _fields_of(kind)


@cache
def _fields_of(kind: Hashable) -> tuple[tuple[str, Any], ...]:
    return tuple(get_type_hints(kind).items())


def tile_of(fields: dict[str, Any], lanes: int = TILE) -> np.dtype[Any]:
    """Return the type of a tile: a row of numbers, one for each of its lanes, for each name, or a tile in it."""
    return np.dtype((np.record, [(name, kind) if isinstance(kind, np.dtype) and (kind.names or kind.shape)
                                 else (name, kind, (lanes,)) for name, kind in fields.items()]))


def room(count: int, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return so many tiles, not filled, each row at the beginning of a cache line."""
    bytes_ = np.empty(count * kind.itemsize + _LINE, np.uint8)
    start = -bytes_.ctypes.data % _LINE
    return bytes_[start:start + count * kind.itemsize].view(kind)


def rows_of(kind: type[Any], number: Any, lanes: int = TILE) -> np.dtype[Any]:
    """Return the type of a tile that holds named tuples of numbers, with those in it."""
    key: Any = kind
    return _rows_of(key, np.dtype(number), lanes)


@cache
def _rows_of(kind: Any, number: Hashable, lanes: int) -> np.dtype[Any]:
    return tile_of({name: _rows_of(hint, number, lanes) if hasattr(hint, "_fields") else number
                    for name, hint in fields_of(kind)}, lanes)


def reader(name: str, kind: type[Kind]) -> Callable[[Any, int], Kind]:
    """Return the function `name(tile, j)` that reads a named tuple with those in it; a compiler gets it as text."""
    kinds: dict[str, type[Any]] = {}
    return made(name, f"def {name}(tile, j):\n    return {_row(kind, 'tile', kinds)}\n", kinds)


def _row(kind: Any, place: str, kinds: dict[str, type[Any]]) -> str:
    kinds[kind.__name__] = kind
    parts = (_row(hint, f"{place}.{field}", kinds) if hasattr(hint, "_fields") else f"{place}.{field}[j]"
             for field, hint in fields_of(kind))
    return f"{kind.__name__}({', '.join(parts)})"


def writer(name: str, kind: type[Kind]) -> Callable[[Any, int, Kind], None]:
    """Return the function `name(tile, j, values)` that puts a named tuple into a tile."""
    return made(name, f"def {name}(tile, j, values):\n{''.join(_filling(kind, 'tile', 'values'))}", {})


def _filling(kind: Any, to: str, of: str) -> Iterator[str]:
    for field, hint in fields_of(kind):
        if hasattr(hint, "_fields"):
            yield from _filling(hint, f"{to}.{field}", f"{of}.{field}")
        else:
            yield f"    {to}.{field}[j] = {of}.{field}\n"


def mapped(change: Callable[[Any], Any], values: Any) -> Any:
    """Return a named tuple, and those in it, with every number changed."""
    if hasattr(values, "_fields"):
        return type(values)(*(mapped(change, x) for x in values))
    return change(values)


def tiles_with(kind: type[Any], values: Any, count: int) -> NDArray[Any]:
    """Return tiles of so many lanes that hold a named tuple of numbers and columns; lanes beyond them mean nothing."""
    tiles = room(-(-count // TILE), rows_of(kind, np.float64))
    column = np.zeros(len(tiles) * TILE)

    def put(into: Any, part: Any) -> None:
        for name, x in zip(part._fields, part, strict=True):
            if hasattr(x, "_fields"):
                put(into[name], x)
            elif isinstance(x, np.ndarray):
                column[:count] = x
                into[name] = column.reshape(-1, TILE)
            else:
                into[name] = x

    put(tiles, values)
    return tiles


def fill(tiles: NDArray[Any], values: Any) -> None:
    """Give all lanes of tiles the numbers of a named tuple, with those in it."""
    for name, x in zip(values._fields, values, strict=True):
        if hasattr(x, "_fields"):
            fill(tiles[name], x)
        else:
            tiles[name] = x


def columns_of(kind: type[Kind], tiles: NDArray[Any], which: Any) -> Kind:
    """Return the numbers of some lanes of tiles, by their numbers or as a slice, as a named tuple of arrays."""
    if isinstance(which, slice):
        return kind(*(columns_of(hint, tiles[name], which) if hasattr(hint, "_fields") else tiles[name].ravel()[which]
                      for name, hint in fields_of(kind)))
    return kind(*(columns_of(hint, tiles[name], which) if hasattr(hint, "_fields")
                  else tiles[name][which // TILE, which % TILE] for name, hint in fields_of(kind)))


def numbers_in(values: Any) -> Iterator[Any]:
    """Return all numbers of a named tuple and of those in it."""
    for x in values:
        if hasattr(x, "_fields"):
            yield from numbers_in(x)
        else:
            yield x


def put_columns(tiles: NDArray[Any], places: Any, values: Any) -> None:
    """Set the numbers of the lanes at these places of tiles from a named tuple of arrays."""
    for name, x in zip(values._fields, values, strict=True):
        if hasattr(x, "_fields"):
            put_columns(tiles[name], places, x)
        else:
            tiles[name][places // TILE, places % TILE] = x


def record_of(kind: type[Any]) -> np.dtype[Any]:
    """Return the type of a record that holds a named tuple, with those in it; sequences stand elsewhere."""
    key: Any = kind
    return _record_of(key)


@cache
def _record_of(kind: Hashable) -> np.dtype[Any]:
    return np.dtype((np.record, [(name, *_field(hint)) for name, hint in fields_of(kind)
                                 if get_origin(hint) is not Sequence]))


def _field(hint: Any) -> tuple[Any, ...]:
    if hasattr(hint, "_fields"):
        return (record_of(hint),)
    if hint is int:
        return (np.int64,)
    return (np.float64,) if hint is float else (np.float64, (len(get_args(hint)),))


def object_of(kind: type[Any]) -> Any:
    """Return what plain Python has for such a record: an object with the same names, quicker to get at."""
    return SimpleNamespace(**{name: _nothing(hint) for name, hint in fields_of(kind)})


def _nothing(hint: Any) -> Any:
    if hasattr(hint, "_fields"):
        return object_of(hint)
    return 0 if hint is int else 0.0 if hint is float else [0.0] * len(get_args(hint))


def put_fields(record: Any, values: Any) -> None:
    """Put a named tuple into a record of numpy's; sequences stand elsewhere."""
    for (name, _), value in zip(fields_of(type(values)), values, strict=True):
        if hasattr(value, "_fields"):
            put_fields(record[name], value)
        elif name in (record.dtype.names or ()):
            record[name] = value


def record_reader(name: str, kind: type[Kind]) -> Callable[..., Kind]:
    """Return the function `name(record)` that reads a named tuple with those in it; a compiler gets it as text.

    A sequence of the named tuple has to be given beside the record.
    """
    kinds: dict[str, type[Any]] = {}
    given = "".join(f", {field}" for field, hint in fields_of(kind) if get_origin(hint) is Sequence)
    return made(name, f"def {name}(record{given}):\n    return {_reading(kind, 'record', kinds)}\n", kinds)


def _reading(kind: Any, place: str, kinds: dict[str, type[Any]]) -> str:
    kinds[kind.__name__] = kind
    parts = []
    for field, hint in fields_of(kind):
        at = f"{place}.{field}"
        if get_origin(hint) is Sequence:
            at = field
        elif hasattr(hint, "_fields"):
            at = _reading(hint, at, kinds)
        elif hint not in (int, float):
            at = "(" + ", ".join(f"{at}[{k}]" for k in range(len(get_args(hint)))) + ")"
        parts.append(at)
    return f"{kind.__name__}({', '.join(parts)})"


def record_writer(name: str, kind: type[Kind]) -> Callable[[Any, Kind], None]:
    """Return the function `name(record, values)` that puts a named tuple into a record."""
    return made(name, f"def {name}(record, values):\n{''.join(_writing(kind, 'record', 'values'))}", {})


def _writing(kind: Any, to: str, of: str) -> Iterator[str]:
    for field, hint in fields_of(kind):
        if get_origin(hint) is Sequence:
            continue  # it stands elsewhere
        if hasattr(hint, "_fields"):
            yield from _writing(hint, f"{to}.{field}", f"{of}.{field}")
        elif hint in (int, float):
            yield f"    {to}.{field} = {of}.{field}\n"
        else:
            yield from (f"    {to}.{field}[{k}] = {of}.{field}[{k}]\n" for k in range(len(get_args(hint))))


def made(name: str, text: str, kinds: Mapping[str, Any]) -> Callable[..., Any]:
    """Return a function given as text, with what it names; a compiler gets it as such."""
    space: dict[str, Any] = dict(kinds)
    exec(text, space)
    function: Any = space[name]
    function.__module__, function.text, function.kinds = __name__, text, kinds
    made: Callable[..., Any] = function
    return made
