"""Bring a chunk of lanes into the shape of the compiled kernels, and run it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import tiles
from servotwin.models.engine.records import columns_of, numbers_in, room, tiles_with
from servotwin.models.engine.tiles import Lanes, Outputs
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.friction import straight
from servotwin.models.terms.numbers import NEUTRAL, Numbers
from servotwin.physics.laws import array_form
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.lane_memory import RECORD, flat, records_of
from servotwin.simulation.lanes import FIELDS, MORE_FIELDS, SMALL_FIELDS, Floats, Raw, Work, empty_raw

Indices = NDArray[np.int64]
_straight = array_form(straight, __name__)
Mask = NDArray[np.bool_]

_SIDE = tuple(f"servotwin.models.engine.side_by_side:{name}" for name in ("start", "go_on", "advance", "refit"))
_BY_ARCS = {dtype: Recipe(f"side_by_side_{dtype}", _SIDE, vector=True, single=dtype == "float32",
                          never=("BANDS", "GAPS"))
            for dtype in ("float64", "float32")}
_ENTRIES = tuple(f"servotwin.models.engine.runs:{name}" for name in ("start", "go_on"))
ALL_RUNS = Recipe("runs", _ENTRIES)  # everything
_PLAY = "play"
_BOUND = ("friction.kappa", "heat", "motor.L")  # what lets no motion inside the play be in closed form
_GENERAL = (_PLAY, *_BOUND)  # what only lanes one by one have
_BANDED = ("friction.varies", "source.I_max")
_RARE = (*_BANDED, *_GENERAL, "sensor.half_slack")
_PENDULUM = "load.gravity"
_PLAYED = ("INSIDE", "ON_FORWARD", "ON_BACKWARD", "APART")  # with play alone
_NOT_IN_BANDS = (*_GENERAL, _PENDULUM, "load.stiffness", "follower", "sweep")
_BY_BANDS = {creeps: Recipe("by_bands" + "_and_creep" * creeps, _SIDE, vector=True, absent=(
    _NOT_IN_BANDS if creeps else (*_NOT_IN_BANDS, "friction.w_s")), never=("ONE_FORMULA", "ARCS", "GAPS", "CORE"))
    for creeps in (False, True)}
PLAIN_RUNS = Recipe(
    "plain_runs", _ENTRIES, absent=(*_RARE, _PENDULUM, "sweep"),
    never=("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", *_PLAYED, "CORE"))
PENDULUM_RUNS = Recipe(
    "pendulum_runs", _ENTRIES, absent=(*_RARE, "sweep"),
    never=("SERIES", "HELD", "WITH_CURRENT", *_PLAYED, "CORE"))
_NOT_IN_GAPS = (*_BOUND, "friction.varies", _PENDULUM, "load.stiffness", "follower", "sweep")
_BY_GAPS = Recipe("by_gaps", _SIDE, vector=True, absent=_NOT_IN_GAPS, never=("ONE_FORMULA", "ARCS", "BANDS", "CORE"))
GAP_RUNS = Recipe(
    "gap_runs", _ENTRIES, absent=_NOT_IN_GAPS,
    never=("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", "CREEP", "CORE"))
LOOK_SIDE_BY_SIDE = Recipe(
    "look_side_by_side", ("servotwin.models.engine.sights:side_by_side",),
    absent=(*_GENERAL, _PENDULUM, "load.stiffness"))
LOOK_ONE_BY_ONE = Recipe("look_one_by_one", ("servotwin.models.engine.sights:one_by_one",))
_ENDING = Recipe("ending", ("servotwin.models.engine.ending:look_at_lanes",), vector=True)
_ALL = (*FIELDS, *MORE_FIELDS)  # rows of what a run leaves behind
_SHARED = ("pieces", "edges", "accuracy")  # by all lanes
_TILED: dict[str, Any] = {"numbers": Numbers, "chips": Chip}
_SMALLEST = 2.0**-150  # what is not more is zero in float32
_ROOM = 2_000_000  # numbers that lanes one after the other leave behind at once


def run(work: Work) -> Raw:
    """Run all lanes of a chunk: side by side where that is possible, one after the other where not."""
    raw = empty_raw(work)
    lanes = lanes_of(work)
    for kind in kinds_of(work.numbers, work.chip or NO_CHIP, work.lanes, work.law == "pulse", work.dtype, swept(lanes),
                         work.torque.count > 0, bool(work.curve[0]), set(work.fields) <= set(FIELDS)):
        if isinstance(kind, OneByOne):
            run_one_by_one(work, lanes, kind.which, raw, kind.recipe)
        else:
            run_side_by_side(work, lanes, kind, raw)
    kernels(_ENDING).look_at_lanes(
        work.law == "pulse", lanes, _rows(work.torque.rows), _indices(work.torque.first), _indices(work.torque.count),
        float(work.duration), raw.final, raw.refused, raw.marks)
    failed = raw.status != 0
    raw.refused[failed], raw.marks[failed] = np.nan, 0
    return raw


def run_side_by_side(work: Work, lanes: Lanes, kind: SideBySide, raw: Raw) -> None:
    """Run some lanes side by side; finish those that are given up one by one."""
    which = kind.which
    rows = room(-(-len(which) // tiles.TILE), tiles.tile_type(kind.dtype, kind.form))
    plans = room(1, tiles.plan_type(kind.dtype))
    times = _own(work.times, np.float64)
    module = kernels(kind.recipe)
    module.start(some_of(lanes, which), kind.form, times[0] if len(times) else np.inf, rows)
    outputs = outputs_of(work, raw, kind.dtype)
    lost = module.go_on(lanes.pieces, lanes.edges, kind.form, kind.slack, which, float(work.duration), times,
                        outputs, rows, plans)
    for name, values in outputs._asdict().items():
        if name in raw.fields and values is not raw.fields[name]:
            with np.errstate(over="ignore"):
                raw.fields[name][which] = values[which]
    raw.final[which, 0], raw.final[which, 1] = (flat(rows, "servo", name)[:len(which)] for name in ("q", "w"))
    if lost:
        owed = flat(rows, "clock", "owed")[:len(which)]
        places = np.flatnonzero(owed > 0.0)
        gone = which[places]
        _finish(work, lanes, gone, owed[places], flat(rows, "count", "output")[places],
                records_of(rows, places, lanes.start[3:5, gone]), raw, kind.general)


def run_one_by_one(work: Work, lanes: Lanes, which: Indices, raw: Raw, recipe: Recipe = ALL_RUNS) -> None:
    """Run some lanes one after the other, in float64."""
    records = np.zeros(len(which), RECORD)
    kernels(recipe).start(lanes, which, records)
    _finish(work, lanes, which, np.full(len(which), float(work.duration)), np.zeros(len(which), np.int64), records,
            raw, recipe)


def _finish(work: Work, lanes: Lanes, which: Indices, durations: Floats, first: Indices, records: NDArray[Any],
            raw: Raw, recipe: Recipe) -> None:
    """Let lanes go on one after the other, for durations of their own [s], from outputs of their own on."""
    times = _own(work.times, np.float64)
    at_once = max(1, _ROOM // (len(_ALL) * max(len(times), 1)))
    for start in range(0, len(which), at_once):
        some = slice(start, start + at_once)
        part, own = which[some], _indices(first[some])
        found = np.zeros((len(part), len(_ALL), len(times)))
        status, ended = np.zeros(len(part), np.int64), np.zeros(len(part))
        kernels(recipe).go_on(
            lanes, np.array(work.curve, np.float64), _rows(work.torque.rows), _indices(work.torque.first),
            _indices(work.torque.count), part, _own(durations[some], np.float64), times, own, found, records[some],
            status, ended)
        bad = status != 0
        raw.status[part], raw.ended[part] = status, np.where(bad, ended, work.duration)
        y = records[some]["point"]["y"]
        raw.final[part] = y[:, [0, 1, 3, 4]]
        failed = bad[:, None] & (times >= ended[:, None])
        ahead = np.arange(len(times)) >= own[:, None]
        for k, name in enumerate(_ALL):
            if name in raw.fields:
                with np.errstate(over="ignore"):
                    own_part = np.where(failed, 0 if name in SMALL_FIELDS else np.nan, found[:, k])
                    raw.fields[name][part] = np.where(ahead, own_part, raw.fields[name][part])


class SideBySide(NamedTuple):
    """Lanes that run side by side in one form, whether some have a potentiometer with play, and whether some creep."""

    which: Indices
    form: int
    slack: bool
    dtype: str
    creeps: bool = False

    @property
    def recipe(self) -> Recipe:
        """Their kernels."""
        if self.form == tiles.GAPS:
            return _BY_GAPS
        return _BY_BANDS[self.creeps] if self.form == tiles.BANDS else _BY_ARCS[self.dtype]

    @property
    def general(self) -> Recipe:
        """The kernels of those that cannot go on side by side."""
        if self.form == tiles.GAPS:
            return GAP_RUNS
        return ALL_RUNS if self.form == tiles.BANDS or self.slack else PLAIN_RUNS


class OneByOne(NamedTuple):
    """Lanes that run one by one, by a form that leaves out what they lack."""

    which: Indices
    recipe: Recipe


def kinds_of(numbers: Numbers, chip: Chip, lanes: int, pulsed: bool, dtype: str, swept: Mask, recorded: Mask,
             curved: bool, gaps: bool) -> list[SideBySide | OneByOne]:
    """Return how lanes run, whose numbers are numbers or arrays (lanes,).

    `swept` is whose command has a chirp, `recorded` whose load is recorded over time, `curved` whether the
    potentiometers have a table, `gaps` whether lanes with play in the gear may run side by side.
    """
    bridge, own, swinging = numbers.bridge, numbers.friction, _differs(numbers, _PENDULUM)
    general = swept.any() and swept
    for name in _BOUND:
        general = _either(general, _differs(numbers, name))
    bound = _either(general, _either(swinging, recorded.any() and recorded))
    bound = _either(bound, numbers.load.stiffness != 0.0)
    played = _differs(numbers, _PLAY)
    loose = played & np.logical_not(_either(bound, own.varies != 0.0)) if pulsed else False
    rigid = np.logical_not(played)
    slack, banded = _differs(numbers, "sensor.half_slack"), False
    for name in _BANDED:
        banded = _either(banded, _differs(numbers, name))
    side: Any = False
    if pulsed and not curved:
        side = np.logical_not(bound) & (rigid | loose if gaps else rigid) & _is_simple(numbers)
    if dtype == "float32":  # what is not zero has to stay so
        for x in (*numbers_in(numbers), *numbers_in(chip)):
            fits = (x == 0.0) | (abs(x) > _SMALLEST)
            side = side if fits is True else side & fits
    braked = (bridge.off.D == 0.0) & (bridge.D_drive < numbers.source.V)
    banded = _either(banded, slack & np.logical_not(braked))
    rare = _either(_either(general, played), _either(banded, slack)) & np.logical_not(loose)
    found: list[SideBySide | OneByOne] = []
    for form, some in ((tiles.ONE_FORMULA, braked & np.logical_not(banded) & rigid),
                       (tiles.ARCS, np.logical_not(braked) & np.logical_not(banded) & rigid),
                       (tiles.BANDS, banded & rigid), (tiles.GAPS, loose)):
        which = _where(side, some, lanes)
        lagging = bool(np.any(np.broadcast_to(slack, lanes)[which])) if np.any(slack) else False
        creeping = form == tiles.BANDS and bool(np.any(np.broadcast_to(own.varies * own.w_s > 0.0, lanes)[which]))
        found.append(SideBySide(which, form, lagging, dtype if form < tiles.BANDS else "float64", creeping))
    found += [OneByOne(_where(some, np.logical_not(side), lanes), recipe) for recipe, some in (
        (PLAIN_RUNS, np.logical_not(_either(rare, swinging)) & np.logical_not(loose)),
        (PENDULUM_RUNS, swinging & np.logical_not(rare)), (GAP_RUNS, loose), (ALL_RUNS, rare))]
    return [kind for kind in found if len(kind.which)]


def _is_simple(numbers: Numbers) -> Any:
    """Tell which servos with a bridge have what tiles know, apart from what only lanes one by one have."""
    bridge, own = numbers.bridge, numbers.friction
    return ((numbers.sensor.step == 0.0) & (numbers.motor.K_b > 0.0) & (bridge.silence.coast == bridge.off.coast)
            & ((own.varies == 0.0) | _straight(own)))


def goes_together(numbers: Numbers, pulsed: bool) -> bool:
    """Tell whether all lanes take about as long, for none has a term that would let it run on its own."""
    return pulsed and not any(np.any(_differs(numbers, name)) for name in (*_GENERAL, _PENDULUM))


def _either(a: Any, b: Any) -> Any:
    """Return a | b, at once where one of them holds for none."""
    return b if a is False else a if b is False else a | b


def _where(a: Any, b: Any, lanes: int) -> Indices:
    both = np.logical_and(a, b)
    if both.ndim == 0:
        return np.arange(lanes if both else 0)
    return np.flatnonzero(np.broadcast_to(both, lanes))


def swept(lanes: Lanes) -> Mask:
    """Tell whose command has a chirp."""
    if not lanes.pieces[:, 6].any():
        return np.zeros(len(lanes.torque), np.bool_)
    before = np.concatenate([[0], np.cumsum(lanes.pieces[:, 6] != 0.0)])
    return np.asarray(before[lanes.piece_first + lanes.piece_count] > before[lanes.piece_first])


def _differs(numbers: Numbers, name: str) -> Any:
    """Tell which lanes have a term ("heat", told by its first number), or a number of one ("motor.L")."""
    room, _, field = name.partition(".")
    neutral, own = getattr(NEUTRAL, room), getattr(numbers, room)
    field = field or neutral._fields[0]
    return getattr(own, field) != getattr(neutral, field)


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
        _own(own, np.float64), _indices(work.edges.first), _indices(work.edges.count), work.accuracy)


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
    types = {name: np.dtype(np.int8 if name in SMALL_FIELDS else dtype) for name in FIELDS}
    arrays = {name: np.zeros((0, 0), kind) for name, kind in types.items()}
    for name in FIELDS:
        if name in raw.fields:
            own = raw.fields[name]
            arrays[name] = own if own.dtype == types[name] else np.zeros(own.shape, types[name])
    return Outputs(**arrays)
