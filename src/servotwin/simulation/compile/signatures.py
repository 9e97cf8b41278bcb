"""Arguments of the entries of kernels: one table."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from types import FunctionType
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.lanes import Lanes, Outputs
from servotwin.models.engine.log import Happened, Log, Row
from servotwin.models.engine.memory import Inputs, Memories, Memory
from servotwin.models.engine.run.run import Plant
from servotwin.models.state.records import record_of, rows_of
from servotwin.models.terms.control import Firm
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.given import Given
from servotwin.models.terms.numbers import Numbers
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.text.kinds import (
    BOOL,
    FLOAT32,
    FLOAT64,
    INT8,
    INT64,
    Array,
    Kind,
    Record,
    TranslationError,
    Tuple,
)

Signature = tuple[str, tuple[Kind, ...]]
_FLOATS, _TABLE, _CUBE = (Array(FLOAT64, dimensions) for dimensions in (1, 2, 3))
_INDICES, _SMALLS, _SMALL_TABLE = Array(INT64, 1), Array(INT8, 1), Array(INT8, 2)
FORMS = ("ONE_FORMULA", "BANDS", "STRIDES", "COILS", "GAPS")
"""Names of the ways in which tiles go through phases, in `models.engine.batch.tiles`."""


def _records(dtype: np.dtype[Any]) -> Array:
    return Array(Record(dtype), 1)


def _tuple(kind: Any, default: Kind, **fields: Kind) -> Tuple:
    return Tuple(tuple(fields.get(name, default) for name in kind._fields), kind.__name__, kind._fields)


_NUMBERS, _ROWS = _records(rows_of(Numbers, np.float64)), _records(record_of(Memory))
_MEMORIES = _tuple(Memories, _ROWS, firms=_records(record_of(Firm)))
_LANES = _tuple(
    Lanes, _INDICES, numbers=_NUMBERS, chips=_records(rows_of(Chip, np.float64)), start=_TABLE, torque=_FLOATS,
    pieces=_TABLE, edges=_FLOATS, accuracy=FLOAT64, firmware=_records(record_of(Firmware)))
_RECORDED = (_TABLE, _INDICES, _INDICES)  # rows of torques, where those of a lane begin, and how many there are


def _outputs(real: Kind) -> Tuple:
    return _tuple(Outputs, Array(real, 2), contact=_SMALL_TABLE, drive=_SMALL_TABLE, mesh=_SMALL_TABLE)


_GOING = (_LANES, _TABLE, *_RECORDED, _INDICES, _FLOATS, _FLOATS, _INDICES, _CUBE, _MEMORIES, _INDICES)
_LOG_ROWS, _PLANTS = _records(record_of(Row)), _records(record_of(Plant))
_INPUTS = _tuple(Inputs, _TABLE, constant_torque=FLOAT64, period=FLOAT64, edges=_FLOATS, seed=INT64, accuracy=FLOAT64,
                 firmware=_records(record_of(Firmware)))
_LOG = _tuple(Log, _FLOATS, motions=_LOG_ROWS, events=_records(record_of(Happened)), counts=_INDICES)
_SIGNATURES: Mapping[str, tuple[Kind, ...]] = {
    "run:go_on": (_PLANTS, _INPUTS, _MEMORIES, FLOAT64, BOOL, BOOL, _LOG),
    "at:at": (_PLANTS, FLOAT64, _LOG_ROWS, _FLOATS, _INDICES, _FLOATS, BOOL, _TABLE),
    "at:resolution": (_PLANTS, FLOAT64, _LOG_ROWS, _FLOATS, _TABLE),
    "runs:start": (_LANES, _INDICES, _MEMORIES),
    "runs:to_first_ticks": (*_GOING, _INDICES),
    "runs:ready": (_INDICES, _SMALLS, _FLOATS, _INDICES, _FLOATS, _INDICES),
    "runs:note_failures": (_INDICES, _INDICES, _FLOATS, _ROWS, _SMALLS, _FLOATS),
    "event_free:go": (_LANES, _INDICES, _FLOATS, _SMALLS, _ROWS, _INDICES),
    "cosim:look_at_lanes": (BOOL, _LANES, *_RECORDED, FLOAT64, _TABLE, _FLOATS, _SMALLS),
    "observe_batch:one_by_one": (_LANES, _TABLE, *_RECORDED, _INDICES, _MEMORIES, _TABLE),
    "cosim:accept": (_FLOATS, _INDICES, _TABLE, _CUBE, _NUMBERS, _FLOATS, _FLOATS, _INDICES, _FLOATS),
    "cosim:change": (_INDICES, _TABLE, _INDICES, _NUMBERS, _FLOATS, _FLOATS, BOOL, _FLOATS, _FLOATS, _NUMBERS),
    "cosim:follow": (_INDICES, _TABLE, *(_FLOATS,) * 5, _TABLE, _FLOATS),
    "cosim:forget_motions": (_ROWS,),
    "cosim:impose_on_records": (_INDICES, _TABLE, _NUMBERS, _INDICES, _INDICES, _FLOATS, _ROWS),
    "cosim:show_records": (_INDICES, _ROWS, _TABLE),
    "cosim:read_clocks": (_INDICES, _SMALLS, _FLOATS, _ROWS, _FLOATS),
    "cosim:take_status": (_INDICES, _SMALLS, _INDICES),
    "cosim:note_lost_buses": (_INDICES, _INDICES, _ROWS, _SMALLS, _FLOATS),
}


@cache
def _of_ticks() -> Mapping[str, tuple[Kind, ...]]:
    """Return what entries are called with that let digital servos go from tick to tick together."""
    from servotwin.models.engine.batch import digital_batch
    from servotwin.models.engine.legs.coupled_units import Coupling, Unit

    return {"digital_batch:go_on": (*_GOING, _records(digital_batch.TILE_TYPE)),
            "runs:go_on": (*_GOING, BOOL, _FLOATS, _INDICES, _records(record_of(Unit)), _records(record_of(Coupling)))}


@cache
def _of_buses() -> Mapping[str, tuple[Kind, ...]]:
    """Return what entries are called with that move servos on a bus."""
    from servotwin.models.engine.bus.bus_batch import Buses
    from servotwin.models.engine.bus.bus_records import Mate, Seat, Shared, Tape
    from servotwin.models.engine.lanes import Tables
    from servotwin.models.engine.legs.coupled_units import Coupling, Unit

    tables = _tuple(Tables, _INDICES, torques=_TABLE, curves=_TABLE)
    shared, room = _records(record_of(Shared)), (_records(record_of(Seat)), _records(record_of(Mate)))
    units = (_records(record_of(Unit)), _records(record_of(Coupling)))
    own = (_LANES, tables, _tuple(Buses, _INDICES, memories=_MEMORIES, shared=shared, ended=_FLOATS))
    tape = _tuple(Tape, _FLOATS, motions=_LOG_ROWS, events=_TABLE, used=_INDICES)
    return {"bus_batch:go_on": (*own, INT64, INT64, FLOAT64, FLOAT64, *room, *units, tape),
            "bus_batch:look": (*own, *room, _TABLE),
            "bus_batch:voltages": (_LANES, shared, room[1], _TABLE, _FLOATS),
            "cosim:break_up": (_INDICES, shared, _ROWS)}


@cache
def _of_the_bench() -> Mapping[str, tuple[Kind, ...]]:
    """Return what entries are called with that advance servos at a bench that is looked at."""
    from servotwin.models.engine.bus.bus_records import Mate, Seat, Shared, Tape
    from servotwin.models.engine.lanes import Tables
    from servotwin.models.engine.live.posts import Circuit, Post, Sender, Told, Weights
    from servotwin.models.engine.live.screen import Lines, Looks, Switch

    posts, sender, programs = _records(record_of(Post)), _records(record_of(Sender)), _records(record_of(Firmware))
    told = _tuple(Told, _TABLE, edges=_FLOATS)
    tables = _tuple(Tables, _INDICES, torques=_TABLE, curves=_TABLE)
    bus = (_LANES, tables, _records(record_of(Shared)), _records(record_of(Seat)), _records(record_of(Mate)),
           _tuple(Tape, _FLOATS, motions=_LOG_ROWS, events=_TABLE, used=_INDICES))
    going = (FLOAT64, FLOAT64, INT64, _CUBE, _CUBE, _CUBE, _INDICES)
    return {"stretch:shown": (_PLANTS, _INPUTS, _MEMORIES, _LOG_ROWS, _FLOATS, named(Switch), named(Looks),
                              named(Lines), _TABLE, _INDICES),
            "bench:make": (posts, programs, INT64, INT64, _records(record_of(Given)), _records(record_of(Weights))),
            "bench:begin": (posts, INT64, told, _MEMORIES), "bench:change": (posts, INT64, _MEMORIES),
            "bench:heed": (posts, INT64, told, _records(record_of(Circuit)), FLOAT64, FLOAT64),
            "bench:begin_at": (posts, INT64, told, _MEMORIES, FLOAT64),
            "bench:take": (posts, INT64, INT64, INT64, _FLOATS, _FLOATS, _FLOATS, FLOAT64, _TABLE, _FLOATS),
            "bench:count": (FLOAT64, FLOAT64, INT64, FLOAT64),
            "bench:draw": (INT64, INT64, FLOAT64, FLOAT64),
            "bench:look": (posts, INT64, told, programs, _MEMORIES, _CUBE, _INDICES),
            "bench:tune": (sender, FLOAT64), "bench:snapped": (sender, FLOAT64), "bench:next_edge": (sender,),
            "bench:advance": (posts, told, programs, _MEMORIES, sender, _LOG, *going),
            "bench:advance_together": (posts, told, programs, _MEMORIES, sender, *bus, *going),
            "together:advance": (posts, _MEMORIES, *bus[:-1], named(Looks), bus[-1], _CUBE, _CUBE, _INDICES)}


_OF_BENCH = ("make", "begin", "begin_at", "heed", "change", "take", "count", "draw", "look", "tune", "snapped",
             "next_edge", "advance", "advance_together")
_ELSEWHERE: Mapping[str, Callable[[], Mapping[str, tuple[Kind, ...]]]] = {  # where kinds take more than lanes have
    "digital_batch:go_on": _of_ticks, "runs:go_on": _of_ticks, **{f"bench:{name}": _of_the_bench for name in _OF_BENCH},
    "stretch:shown": _of_the_bench, "together:advance": _of_the_bench,
    "bus_batch:go_on": _of_buses, "bus_batch:look": _of_buses, "bus_batch:voltages": _of_buses,
    "cosim:break_up": _of_buses}


def _on_tiles(rows: Array, plans: Array, real: Kind) -> dict[str, tuple[Kind, ...]]:
    """Return what entries are called with that go over tiles."""
    return {
        "side_by_side:start": (_LANES, INT64, FLOAT64, rows),
        "side_by_side:go_on": (_TABLE, _FLOATS, INT64, BOOL, _INDICES, FLOAT64, _FLOATS, _outputs(real), rows, plans),
        "side_by_side:advance": (_INDICES, INT64, BOOL, INT64, INT64, FLOAT64, _FLOATS, _FLOATS, BOOL, rows, plans),
        "side_by_side:refit": (_LANES, INT64, _INDICES, _INDICES, rows),
        "observe_batch:side_by_side": (_LANES, _TABLE, _INDICES, rows, _TABLE),
        "cosim:gather_lost": (_INDICES, _SMALLS, _FLOATS, _TABLE, rows, *(_INDICES,) * 3, _FLOATS, _MEMORIES),
        "cosim:to_records": (_INDICES, rows, _MEMORIES),
        "cosim:to_tiles": (_INDICES, _INDICES, _MEMORIES, _FLOATS, rows),
        "cosim:impose_on_tiles": (_INDICES, _TABLE, _NUMBERS, _INDICES, _INDICES, _FLOATS, rows),
        "cosim:show_tiles": (_INDICES, rows, _TABLE),
    }


def signatures(recipe: Recipe) -> list[Signature]:
    """Return the entries of a recipe, each with all kinds of arguments that it is called with.

    Raises
    ------
    TranslationError
        If nothing says what an entry is called with.
    """
    return [(entry.split(":")[1], kinds) for entry in recipe.entries for kinds in _kinds_of(entry, recipe)]


def _kinds_of(entry: str, recipe: Recipe) -> Iterator[tuple[Kind, ...]]:
    name = entry.rpartition(".")[2]
    if name in _SIGNATURES or name in _ELSEWHERE:
        yield (_SIGNATURES if name in _SIGNATURES else _ELSEWHERE[name]())[name]
        return
    known = False
    for real, form in _tiles_of(recipe):
        rows, plans = _records(tiles.tile_type(real, form)), _records(tiles.plan_type(real, form))
        own = _on_tiles(rows, plans, FLOAT32 if real == "float32" else FLOAT64)
        if name in own:
            known = True
            yield own[name]
    if not known:
        module, function = entry.split(":")
        yield annotated(getattr(import_module(module), function))


def _tiles_of(recipe: Recipe) -> list[tuple[str, int]]:
    """Return numbers and forms of the tiles that a recipe has to do with, those of one layout once."""
    forms = [getattr(tiles, name) for name in FORMS if name not in recipe.never]
    both = len(forms) == len(FORMS)  # a recipe that looks at the tiles of all others
    kinds = [(real, form) for real in (("float64", "float32") if both else ("float32" if recipe.single else "float64",))
             for form in forms if real == "float64" or form == tiles.ONE_FORMULA]
    return list({tiles.tile_type(*kind): kind for kind in kinds}.values())


def annotated(function: FunctionType) -> tuple[Kind, ...]:
    """Return what a function of numbers, of named tuples of numbers, and of arrays of one dimension is called with.

    Raises
    ------
    TranslationError
        If an argument is anything else.
    """
    hints = get_type_hints(inspect.unwrap(function))
    names: Sequence[str] = list(inspect.signature(function).parameters)
    return tuple(_hinted(function.__name__, name, hints.get(name)) for name in names)


def _hinted(function: str, name: str, hint: Any) -> Kind:
    numbers: dict[Any, Kind] = {float: FLOAT64, int: INT64, bool: BOOL, NDArray[np.float64]: _FLOATS,
                                NDArray[np.int64]: _INDICES}
    if hint in numbers:
        return numbers[hint]
    if hasattr(hint, "_fields"):
        return named(hint, function)
    raise TranslationError(function, name, "an entry with records, or arrays of several dimensions, has a line in "
                                           "`signatures`")


def named(kind: Any, function: str = "") -> Tuple:
    """Return the kind of a named tuple of numbers, and of those in it."""
    return _named(function, kind)


@cache
def _named(function: str, kind: Any) -> Tuple:
    hints = get_type_hints(kind)
    return Tuple(tuple(_hinted(function, name, hints[name]) for name in kind._fields), kind.__name__, kind._fields)
