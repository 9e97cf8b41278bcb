"""Bring a chunk of lanes into the shape of the compiled kernels, and run it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.kernels import block_rows
from servotwin.models.kernels.block_rows import Lanes, Outputs
from servotwin.models.kernels.frame import Chip
from servotwin.models.kernels.plant import Plant
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.lanes import FIELDS, MORE_FIELDS, SMALL_FIELDS, Floats, Raw, Work, empty_raw

_BLOCKS = {
    dtype: Recipe(f"blocks_{dtype}", ("servotwin.models.kernels.blocks:run",), vector=True, single=dtype == "float32")
    for dtype in ("float64", "float32")
}
_ENTRY = ("servotwin.models.kernels.runs:run_lanes",)
_RUNS = Recipe("runs", _ENTRY)  # everything
_RARE = {"varies": 0.0, "half_play": 0.0, "C_w": 0.0, "half_slack": 0.0, "L": 0.0, "gravity": 0.0, "kappa": 0.0,
         "I_max": np.inf}
_PLAIN_RUNS = Recipe(
    "plain_runs", _ENTRY, absent=(*_RARE.items(), ("sweep", 0.0)),
    never=("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", "INSIDE", "ON_FORWARD", "ON_BACKWARD", "CORE"))
_SWINGING = Recipe(
    "pendulum_runs", _ENTRY, absent=(*((name, x) for name, x in _RARE.items() if name != "gravity"), ("sweep", 0.0)),
    never=("SERIES", "HELD", "WITH_CURRENT", "INSIDE", "ON_FORWARD", "ON_BACKWARD", "CORE"))
_ENDING = Recipe("ending", ("servotwin.models.kernels.ending:look_at_lanes",), vector=True)
_ALL = (*FIELDS, *MORE_FIELDS)  # rows of what a run leaves behind
_SHARED = ("pieces", "edges")  # by all lanes
_ROOM = 2_000_000  # numbers that lanes one after the other leave behind at once


def run(work: Work) -> Raw:
    """Run all lanes of a chunk: side by side where that is possible, one after the other where not."""
    raw = empty_raw(work)
    lanes = lanes_of(work)
    times = _own(work.times, np.float64)
    rare, swinging = has_rare_terms(work, lanes)
    side, braked = side_by_side(work, lanes, rare | swinging)
    given_up = np.ones(work.lanes, np.int8)
    for kind in (True, False):
        which = side & (braked == kind)
        if which.all():
            _run_blocks(work, lanes, kind, times, outputs_of(work, raw, given_up))
        elif which.any():
            _run_some(work, lanes, kind, np.flatnonzero(which), times, raw, given_up)
    for recipe, some in ((_PLAIN_RUNS, ~(rare | swinging)), (_SWINGING, swinging & ~rare), (_RUNS, rare)):
        rest = np.flatnonzero(some & (given_up != 0))
        if len(rest):
            run_one_by_one(work, lanes, rest, times, raw, recipe)
    kernels(_ENDING).look_at_lanes(
        work.law == "pulse", lanes, _rows(work.torque.rows), _indices(work.torque.first), _indices(work.torque.count),
        float(work.duration), raw.final, raw.refused, raw.marks)
    failed = raw.status != 0
    raw.refused[failed], raw.marks[failed] = np.nan, 0
    return raw


def _run_blocks(work: Work, lanes: Lanes, braked: bool, times: Floats, outputs: Outputs) -> None:
    if len(lanes.torque):
        room = np.zeros(block_rows.NUMBERS, work.dtype)
        kernels(_BLOCKS[work.dtype]).run(lanes, braked, float(work.duration), times, outputs, room,
                                         np.zeros(block_rows.TIMES), np.zeros(block_rows.INTEGERS, np.int64))


def _run_some(work: Work, lanes: Lanes, braked: bool, which: NDArray[np.int64], times: Floats, raw: Raw,
              given_up: NDArray[np.int8]) -> None:
    """Run only some lanes side by side."""
    part = Raw({name: np.zeros((len(which), len(times)), values.dtype) for name, values in raw.fields.items()},
               raw.status, raw.ended, np.zeros((len(which), raw.final.shape[1])), raw.refused, raw.marks)
    marks = np.zeros(len(which), np.int8)
    columns: Any = (x if name in _SHARED else np.ascontiguousarray(x[..., which])
                    for name, x in zip(Lanes._fields, lanes, strict=True))
    _run_blocks(work, Lanes(*columns), braked, times, outputs_of(work, part, marks))
    for name, values in part.fields.items():
        raw.fields[name][which] = values
    raw.final[which, :2] = part.final[:, :2]
    given_up[which] = marks


def run_one_by_one(work: Work, lanes: Lanes, which: NDArray[np.int64], times: Floats, raw: Raw,
              recipe: Recipe = _RUNS) -> None:
    """Run some lanes one after the other, in float64."""
    at_once = max(1, _ROOM // (len(_ALL) * max(len(times), 1)))
    for start in range(0, len(which), at_once):
        part = which[start:start + at_once]
        room = np.zeros((len(part), len(_ALL), len(times)))
        status, ended = np.zeros(len(part), np.int64), np.zeros(len(part))
        final = np.zeros((len(part), raw.final.shape[1]))
        kernels(recipe).run_lanes(
            lanes, np.array(work.curve, np.float64), _rows(work.torque.rows),
            _indices(work.torque.first), _indices(work.torque.count), part, float(work.duration), times, room,
            final, status, ended)
        raw.status[part], raw.ended[part], raw.final[part] = status, ended, final
        failed = (status != 0)[:, None] & (times >= ended[:, None])
        for k, name in enumerate(_ALL):
            if name in raw.fields:
                with np.errstate(over="ignore"):
                    raw.fields[name][part] = np.where(failed, 0 if name in SMALL_FIELDS else np.nan, room[:, k])


def side_by_side(work: Work, lanes: Lanes, rare: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which lanes have nothing that takes the general way, and which of these brake without a dead zone."""
    if work.law != "pulse":
        return np.zeros(work.lanes, np.bool_), np.zeros(work.lanes, np.bool_)
    plant, chip = Plant(*lanes.plants), Chip(*lanes.chips)
    if work.dtype == "float32":  # what is not zero has to stay so
        kept = [((x == 0.0) | (abs(x.astype(np.float32)) > 0.0)).all(axis=0) for x in (lanes.plants, lanes.chips)]
    else:
        kept = [np.ones(work.lanes, np.bool_)]
    side = np.logical_and.reduce([~rare, plant.stiffness == 0.0, chip.step == 0.0,
                                  plant.K_b > 0.0, work.torque.count == 0, *kept])
    side &= not work.curve[0]
    return np.asarray(side), np.asarray((plant.D_off == 0.0) & (plant.D_drive < plant.V))


def has_rare_terms(work: Work, lanes: Lanes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which lanes have a term that the plain run leaves out, and which have a pendulum."""
    plant = Plant(*lanes.plants)
    terms = [getattr(plant, name) != value for name, value in _RARE.items() if name != "gravity"]
    if lanes.pieces[:, 6].any():
        swept = np.concatenate([[0], np.cumsum(lanes.pieces[:, 6] != 0.0)])
        terms.append(swept[lanes.piece_first + lanes.piece_count] > swept[lanes.piece_first])
    return np.asarray(np.logical_or.reduce(terms)), np.asarray(plant.gravity != 0.0)


def lanes_of(work: Work) -> Lanes:
    """Return the numbers of all lanes as the kernels read them."""
    own = np.asarray(work.edges.rows, np.float64).reshape(-1)
    return Lanes(
        _columns(work.plant, work.lanes), _columns(work.chip or Chip(*([0.0] * len(Chip._fields))), work.lanes),
        _own(work.start, np.float64), _column(work.constant_torque, work.lanes), _indices(work.seeds),
        _rows(work.command.rows), _indices(work.command.first), _indices(work.command.count),
        _own(own, np.float64), _indices(work.edges.first), _indices(work.edges.count))


def _columns(numbers: tuple[Any, ...], lanes: int) -> Floats:
    columns = np.empty((len(numbers), lanes))
    for row, values in zip(columns, numbers, strict=True):
        row[:] = values
    return columns


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


def outputs_of(work: Work, raw: Raw, given_up: NDArray[np.int8]) -> Outputs:
    """Return the arrays into which the kernels write."""
    none = {name: np.zeros((0, 0), np.int8 if name in SMALL_FIELDS else work.dtype) for name in FIELDS}
    angle, speed, contact, drive, error = ({**none, **raw.fields}[name] for name in FIELDS)
    return Outputs(angle, speed, contact, drive, error, given_up, raw.final)
