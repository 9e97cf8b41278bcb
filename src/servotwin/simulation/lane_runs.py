"""Bring a chunk of lanes into the shape of the compiled kernels, and run it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import tiles
from servotwin.models.engine.memory import Memories
from servotwin.models.engine.records import columns_of, record_of, room, tiles_with
from servotwin.models.engine.tiles import Lanes, Outputs
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.numbers import Numbers
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.lane_kinds import OneByOne, SideBySide, kinds_of
from servotwin.simulation.lane_memory import flat, memories_of, nothing_yet, taken
from servotwin.simulation.lane_recipes import ALL_RUNS, ENDING, last_of, steps_of
from servotwin.simulation.lanes import ALL_FIELDS, SMALL_FIELDS, Floats, Raw, Work, empty_raw

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_SHARED = ("pieces", "edges", "accuracy", "firmware")  # by all lanes, or by all that run side by side
_TILED: dict[str, Any] = {"numbers": Numbers, "chips": Chip}
_ROOM = 2_000_000  # numbers that lanes one after the other leave behind at once
_NEVER = np.zeros(0)


def run(work: Work) -> Raw:
    """Run all lanes of a chunk: side by side where that is possible, one after the other where not."""
    raw = empty_raw(work)
    lanes = lanes_of(work)
    for kind in kinds_of(work.numbers, work.chip or NO_CHIP, work.lanes, work.dtype, swept(lanes),
                         work.torque.count > 0, bool(work.curve), work.firmware or NO_FIRMWARE):
        if isinstance(kind, OneByOne):
            run_one_by_one(work, lanes, kind.which, raw, kind.recipe)
        else:
            run_side_by_side(work, lanes, kind, raw)
    if work.law == "digital":
        return raw
    kernels(ENDING).look_at_lanes(
        work.law == "pulse", lanes, _rows(work.torque.rows), _indices(work.torque.first), _indices(work.torque.count),
        float(work.duration), raw.final, raw.refused, raw.marks)
    failed = raw.status != 0
    raw.refused[failed], raw.marks[failed] = np.nan, 0
    return raw


class Going(NamedTuple):
    """Lanes that go on one by one: what the kernels are called with of `runs.go_on` after lanes, tables and torques."""

    which: Indices
    durations: Floats  # [s]
    times: Floats  # of outputs [s]
    first_output: Indices
    outputs: Floats
    memories: Memories
    status: Indices

    @classmethod
    def of(cls, which: Indices, memories: Memories, times: Floats = _NEVER) -> Going:
        """Return lanes that are not told yet how far they go."""
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
    times = _own(work.times, np.float64)
    rows = tiles_of(kind, lanes, times[0] if len(times) else np.inf)
    outputs = outputs_of(work, raw, kind.dtype)
    lost = kernels(kind.recipe).go_on(
        lanes.pieces, lanes.edges, kind.form, kind.slack, which, float(work.duration), times, outputs, rows,
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
                memories_of(rows, places), raw, kind.general)


def run_one_by_one(work: Work, lanes: Lanes, which: Indices, raw: Raw, recipe: Recipe = ALL_RUNS) -> None:
    """Run some lanes one after the other, in float64."""
    memories = nothing_yet(len(which))
    kernels(last_of(recipe)).start(lanes, which, memories)
    _finish(work, lanes, which, np.full(len(which), float(work.duration)), np.zeros(len(which), np.int64), memories,
            raw, recipe)


def _finish(work: Work, lanes: Lanes, which: Indices, durations: Floats, first: Indices, memories: Memories,
            raw: Raw, recipe: Recipe) -> None:
    """Let lanes go on one after the other, for durations of their own [s], from outputs of their own on."""
    times = _own(work.times, np.float64)
    at_once = max(1, _ROOM // (len(ALL_FIELDS) * max(len(times), 1)))
    for start in range(0, len(which), at_once):
        some = slice(start, start + at_once)
        part, own, ended = which[some], first[some], np.zeros(len(which[some]))
        going = Going.of(part, taken(memories, some), times)
        going.durations[:], going.first_output[:] = durations[some], own
        for one, entry, more in steps_of(recipe, ended):
            getattr(kernels(one), entry)(
                lanes, np.array(work.curve, np.float64).reshape(-1, 2), _rows(work.torque.rows),
                _indices(work.torque.first), _indices(work.torque.count), *going, *more)
        bad, found = going.status != 0, going.outputs
        raw.status[part], raw.ended[part] = going.status, np.where(bad, ended, work.duration)
        y = memories.rows[some]["point"]["y"]
        raw.final[part] = np.column_stack([y["q"], y["w"], y["T_w"], y["T_h"]])
        failed = bad[:, None] & (times >= ended[:, None])
        ahead = np.arange(len(times)) >= own[:, None]
        for k, name in enumerate(ALL_FIELDS):
            if name in raw.fields:
                with np.errstate(over="ignore"):
                    own_part = np.where(failed, 0 if name in SMALL_FIELDS else np.nan, found[:, k])
                    raw.fields[name][part] = np.where(ahead, own_part, raw.fields[name][part])


def swept(lanes: Lanes) -> Mask:
    """Tell whose command has a chirp."""
    if not lanes.pieces[:, 6].any():
        return np.zeros(len(lanes.torque), np.bool_)
    before = np.concatenate([[0], np.cumsum(lanes.pieces[:, 6] != 0.0)])
    return np.asarray(before[lanes.piece_first + lanes.piece_count] > before[lanes.piece_first])


def some_of(lanes: Lanes, which: Indices) -> Lanes:
    """Return the numbers of some lanes."""
    if len(which) == len(lanes.torque):
        return lanes
    records = {name: tiles_with(kind, columns_of(kind, getattr(lanes, name), which), len(which))
               for name, kind in _TILED.items()}
    columns: Any = (records[name] if name in records else x if name in _SHARED else np.ascontiguousarray(x[..., which])
                    for name, x in zip(Lanes._fields, lanes, strict=True))
    return Lanes(*columns)


def lanes_of(work: Work) -> Lanes:
    """Return the numbers of all lanes as the kernels read them."""
    own = np.asarray(work.edges.rows, np.float64).reshape(-1)
    return Lanes(
        tiles_with(Numbers, work.numbers, work.lanes), tiles_with(Chip, work.chip or NO_CHIP, work.lanes),
        _own(work.start, np.float64), _column(work.constant_torque, work.lanes), _indices(work.seeds),
        _rows(work.command.rows), _indices(work.command.first), _indices(work.command.count),
        _own(own, np.float64), _indices(work.edges.first), _indices(work.edges.count), work.accuracy,
        programs_of(work.firmware, work.lanes))


def programs_of(firmware: Firmware | None, lanes: int) -> NDArray[Any]:
    """Return a record of the program of each lane, whose numbers are numbers or columns; one where there is none."""
    records = np.zeros(1 if firmware is None else lanes, record_of(Firmware))
    for name, values in zip(Firmware._fields, firmware or NO_FIRMWARE, strict=True):
        records[name] = values
    return records


def _column(values: Any, lanes: int) -> Floats:
    column = np.empty(lanes)
    column[:] = values
    return column


def _rows(rows: Floats) -> Floats:
    return _own(rows, np.float64).reshape(-1, 7)


def _indices(values: NDArray[np.int64]) -> NDArray[np.int64]:
    return _own(values, np.int64)


def _own(values: Any, kind: Any) -> NDArray[Any]:
    """Return an array of one layout, so that the kernels are compiled for no other."""
    return np.require(values, kind, ("C_CONTIGUOUS", "WRITEABLE"))


def outputs_of(work: Work, raw: Raw, dtype: str) -> Outputs:
    """Return the arrays into which the kernels write: those of `raw`, or others of their type."""
    types = {name: np.dtype(np.int8 if name in SMALL_FIELDS else dtype) for name in Outputs._fields}
    arrays = {name: np.zeros((0, 0), kind) for name, kind in types.items()}
    for name in Outputs._fields:
        if name in raw.fields:
            own = raw.fields[name]
            arrays[name] = own if own.dtype == types[name] else np.zeros(own.shape, types[name])
    return Outputs(**arrays)
