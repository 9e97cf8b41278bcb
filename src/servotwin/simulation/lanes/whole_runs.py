"""Run a chunk of lanes through the compiled kernels, from start to end; and what lanes remember, as records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.lanes import Lanes, Outputs
from servotwin.models.engine.memory import NONE_YET, Memories, Memory
from servotwin.models.state.records import TILE, record_of, room
from servotwin.models.terms.control import Firm
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.lanes.forms import (
    ENDING,
    KERNELS,
    RUNS,
    TICKS,
    OneByOne,
    SideBySide,
    kinds_of,
    last_of,
    steps_of,
)
from servotwin.simulation.lanes.packed import (
    ALL_FIELDS,
    SMALL_FIELDS,
    Floats,
    Raw,
    Work,
    as_kernels_take,
    empty_raw,
    some_of,
)

# --- The memory of lanes, as records ----------------------------------------------------------------------------------

_RECORD, _FIRM = record_of(Memory), record_of(Firm)


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


def memories_of(tiles: NDArray[Any], places: Indices) -> Memories:
    """Return what the lanes at these places of tiles remember."""
    found = nothing_yet(len(places))
    kernels(TICKS).to_records(places, tiles, found)
    return found


# --- The state of a `VectorSimulator`'s lanes, to be kept -------------------------------------------------------------
Array = NDArray[np.float64]


class Common(NamedTuple):
    """The common memory of lanes on shared supplies.

    Each lane's bus and its place among those that move together there (−1: none), shape (lanes,); and a record of
    `models.engine.bus.bus_records.Shared` for each bus.
    """

    bus_of: NDArray[np.int64]
    joined: NDArray[np.int64]
    shared: Mapping[int, Any]


@dataclass(frozen=True, eq=False)
class VectorMemory:
    """Everything that the lanes of a `VectorSimulator` remember; picklable.

    Parameters
    ----------
    model : str
        Name of the model's class.
    records, firms : ndarray, shape (lanes,)
        Records of each lane: of `models.engine.memory.Memory`, and of `models.terms.control.Firm`.
    command, torque : ndarray, shape (lanes,)
        The command of each: width of the pulse [s] or control voltage [V]; external torque [N m].
    status, ended : ndarray, shape (lanes,)
        Code of its `Status`, and when it failed [s].
    work : ndarray, shape (lanes,)
        Of the speeds that were set [J].
    numbers : ndarray
        Tiles of `models.terms.numbers.Numbers`: what the lanes were. They are not restored; a lane that has others by
        then continues from where it stood.
    common : Common, optional
        Of lanes that share supplies.
    """

    model: str
    records: NDArray[Any]
    firms: NDArray[Any]
    command: Array
    torque: Array
    status: NDArray[np.int8]
    ended: Array
    work: Array
    numbers: NDArray[Any]
    common: Common | None = None

    def with_lanes(self, other: VectorMemory, which: Indices) -> VectorMemory:
        """Return this with some lanes as another memory has them."""
        found = replace(self, **{one.name: getattr(self, one.name).copy() for one in fields(self)
                                 if one.name not in ("model", "common")})
        for name in ("records", "firms", "command", "torque", "status", "ended", "work"):
            getattr(found, name)[which] = getattr(other, name)[which]
        into, own = (one.numbers.view(np.float64).reshape(len(one.numbers), -1, TILE) for one in (found, other))
        into[which // TILE, :, which % TILE] = own[which // TILE, :, which % TILE]
        return found


class Piece(NamedTuple):
    """Rows of bytes in memory, each so many bytes behind the one before."""

    address: int
    rows: int
    stride: int
    bytes: int


def piece_of(array: NDArray[Any]) -> Piece:
    """Return an array as one row."""
    return Piece(array.ctypes.data, 1, array.nbytes, array.nbytes)


# --- Run a chunk of lanes through the compiled kernels, from start to end ---------------------------------------------

Indices = NDArray[np.int64]
_ROOM = 2_000_000  # numbers that lanes one after the other leave behind at once
_NEVER = np.zeros(0)


def run(work: Work) -> Raw:
    """Run all lanes of a chunk: side by side where that is possible, one after the other where not."""
    raw, packed, asked = empty_raw(work), work.packed, work.asked
    lanes = packed.columns()
    for kind in kinds_of(packed, asked.dtype, asked.watched):
        raw.kernel[kind.which] = KERNELS.index(kind.recipe.name)
        if isinstance(kind, OneByOne):
            run_one_by_one(work, lanes, kind.which, raw, kind.recipe)
        else:
            run_side_by_side(work, lanes, kind, raw)
    if packed.law in ("digital", "voltage"):
        return raw
    kernels(ENDING).look_at_lanes(packed.law == "pulse", lanes, *packed.inputs[1:], float(asked.duration), raw.final,
                                  raw.refused, raw.marks)
    failed = raw.status != 0
    raw.refused[failed], raw.marks[failed] = np.nan, 0
    return raw


class Going(NamedTuple):
    """Lanes that run one by one: what the kernels are called with of `runs.go_on` after lanes, tables and torques."""

    which: Indices
    durations: Floats  # [s]
    times: Floats  # of outputs [s]
    first_output: Indices
    outputs: Floats
    memories: Memories
    status: Indices

    @classmethod
    def of(cls, which: Indices, memories: Memories, times: Floats = _NEVER) -> Going:
        """Return lanes for which it is not set yet how far they go."""
        count = len(which)
        return cls(which, np.zeros(count), times, np.zeros(count, np.int64),
                   np.zeros((count, len(ALL_FIELDS), len(times))), memories, np.zeros(count, np.int64))


def tiles_of(kind: SideBySide, lanes: Lanes, first_output: float) -> NDArray[Any]:
    """Return lanes in tiles as they start; `first_output` is when their first output is due [s]."""
    rows = room(-(-len(kind.which) // tiles.TILE), tiles.tile_type(kind.dtype, kind.form))
    kernels(kind.recipe).start(some_of(lanes, kind.which), kind.form, first_output, rows)
    return rows


def run_side_by_side(work: Work, lanes: Lanes, kind: SideBySide, raw: Raw) -> None:
    """Run some lanes side by side; finish those that are given up one by one."""
    which = kind.which
    times = as_kernels_take(work.asked.times)
    rows = tiles_of(kind, lanes, times[0] if len(times) else np.inf)
    outputs = outputs_of(work, raw, kind.dtype)
    lost = kernels(kind.recipe).go_on(
        lanes.pieces, lanes.edges, kind.form, kind.slack, which, float(work.asked.duration), times, outputs, rows,
        tiles.plan_room(kind.dtype, kind.form))
    for name, values in outputs._asdict().items():
        if name in raw.fields and values is not raw.fields[name]:
            with np.errstate(over="ignore"):
                raw.fields[name][which] = values[which]
    for k, name in enumerate(("q", "w", "T_w", "T_h") if tiles.has_more(kind.form) else ("q", "w")):
        raw.final[which, k] = flat(rows, "servo", name)[:len(which)]
    if lost:
        owed = flat(rows, "clock", "owed")[:len(which)]
        places = np.flatnonzero(owed > 0.0)
        _finish(work, lanes, which[places], owed[places], flat(rows, "count", "output")[places],
                memories_of(rows, places), raw, RUNS)


def run_one_by_one(work: Work, lanes: Lanes, which: Indices, raw: Raw, recipe: Recipe) -> None:
    """Run some lanes one after the other, in float64."""
    memories = nothing_yet(len(which))
    kernels(last_of(recipe)).start(lanes, which, memories)
    if work.asked.watched:
        memories.rows["lowest"] = NONE_YET
    durations = np.full(len(which), float(work.asked.duration))
    _finish(work, lanes, which, durations, np.zeros(len(which), np.int64), memories, raw, recipe)


def _finish(work: Work, lanes: Lanes, which: Indices, durations: Floats, first: Indices, memories: Memories,
            raw: Raw, recipe: Recipe) -> None:
    """Advance lanes one after the other, by durations of their own [s], from outputs of their own on."""
    times, inputs = as_kernels_take(work.asked.times), work.packed.inputs
    at_once = max(1, _ROOM // (len(ALL_FIELDS) * max(len(times), 1)))
    for start in range(0, len(which), at_once):
        some = slice(start, start + at_once)
        part, own, ended = which[some], first[some], np.zeros(len(which[some]))
        going = Going.of(part, taken(memories, some), times)
        going.durations[:], going.first_output[:] = durations[some], own
        for one, entry, more in steps_of(recipe, ended, work.asked.nearly):
            getattr(kernels(one), entry)(lanes, *inputs, *going, *more)
        bad, found = going.status != 0, going.outputs
        raw.status[part], raw.ended[part] = going.status, np.where(bad, ended, work.asked.duration)
        raw.lowest[part] = known_lowest(memories.rows[some]["lowest"])
        y = memories.rows[some]["point"]["y"]
        raw.final[part] = np.column_stack([y["q"], y["w"], y["T_w"], y["T_h"]])
        failed = bad[:, None] & (times >= ended[:, None])
        ahead = np.arange(len(times)) >= own[:, None]
        for k, name in enumerate(ALL_FIELDS):
            if name in raw.fields:
                with np.errstate(over="ignore"):
                    own_part = np.where(failed, 0 if name in SMALL_FIELDS else np.nan, found[:, k])
                    raw.fields[name][part] = np.where(ahead, own_part, raw.fields[name][part])


def known_lowest(lowest: NDArray[Any]) -> Floats:
    """Return least voltages [V] and when they came [s], shape (n, 2), from records; nan where nothing is known."""
    known = np.isfinite(lowest["voltage"])[:, None]
    return np.where(known, np.column_stack([lowest["voltage"], lowest["time"]]), np.nan)


def outputs_of(work: Work, raw: Raw, dtype: str) -> Outputs:
    """Return the arrays into which the kernels write: those of `raw`, or others of their type."""
    types = {name: np.dtype(np.int8 if name in SMALL_FIELDS else dtype) for name in Outputs._fields}
    arrays = {name: np.zeros((0, 0), kind) for name, kind in types.items()}
    for name in Outputs._fields:
        if name in raw.fields:
            own = raw.fields[name]
            arrays[name] = own if own.dtype == types[name] else np.zeros(own.shape, types[name])
    return Outputs(**arrays)
