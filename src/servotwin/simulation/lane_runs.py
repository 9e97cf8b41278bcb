"""Bring a chunk of lanes into the shape of the compiled kernels, and run it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import loop_tiles, tiles
from servotwin.models.engine.memory import Memories
from servotwin.models.engine.records import columns_of, numbers_in, record_of, room, tiles_with
from servotwin.models.engine.tiles import Lanes, Outputs
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.friction import straight
from servotwin.models.terms.numbers import NEUTRAL, Numbers
from servotwin.physics.laws import array_form
from servotwin.simulation.compile import Recipe, is_plain, kernels
from servotwin.simulation.first_ticks import to_first_ticks
from servotwin.simulation.lane_memory import flat, memories_of, nothing_yet, taken
from servotwin.simulation.lanes import ALL_FIELDS, SMALL_FIELDS, Floats, Raw, Work, empty_raw

Indices = NDArray[np.int64]
_straight = array_form(straight, __name__)
Mask = NDArray[np.bool_]

_SIDE = tuple(f"servotwin.models.engine.side_by_side:{name}" for name in ("start", "go_on", "advance", "refit"))
_ENTRIES = tuple(f"servotwin.models.engine.runs:{name}" for name in ("start", "go_on"))
_PROGRAM = ("firmware", "bridge.pwm", "bridge.one_way")  # what only digital servos have
_APART = (*_PROGRAM, "elastic")  # what has kernels of its own, one lane after the other
ALL_RUNS = Recipe("runs", _ENTRIES, absent=_APART)  # everything else
_FORMS = ("ONE_FORMULA", "ARCS", "BANDS", "STRIDES", "COILS", "GAPS")
_PENDULUM, _COIL, _PLAY = "load.gravity", "motor.L", "play"
_BANDED = ("friction.varies", "source.I_max")
_STRIDING = ("heat", _PENDULUM, "load.stiffness")
_PLAYED = ("INSIDE", "ON_FORWARD", "ON_BACKWARD", "APART")  # with play alone
_NO_SIDE = ("friction.kappa", "follower", "sweep", *_APART)  # what no lanes side by side have
_NOT_IN_STRIDES = (*_NO_SIDE, _PLAY, _COIL)
_NOT_IN_BANDS = (*_NOT_IN_STRIDES, *_STRIDING)
_NOT_IN_GAPS = (*_NO_SIDE, _COIL, *_STRIDING, "friction.varies")
_RARE = (*_BANDED, "friction.kappa", _PLAY, "heat", _COIL, "sensor.half_slack")
_DIGITAL = ("firmware.T_c", "bridge.pwm")  # what each of them has
_NO_DIGITAL = ("friction.kappa", "follower", "chip", _COIL)  # what no digital servo has
_SPRUNG, _NOT_SPRUNG = "elastic.k", ("friction.kappa", "follower", _PLAY)  # what springs have, and what not


def _side(name: str, forms: tuple[str, ...], absent: tuple[str, ...] = _APART, never: tuple[str, ...] = (),
          single: bool = False) -> Recipe:
    """Return the recipe of lanes that go side by side in some forms."""
    return Recipe(name, _SIDE, vector=True, single=single, absent=absent,
                  never=(*(form for form in _FORMS if form not in forms), *never))


_BY_ARCS = {dtype: _side(f"side_by_side_{dtype}", ("ONE_FORMULA", "ARCS"), single=dtype == "float32")
            for dtype in ("float64", "float32")}
_BY_BANDS = {creeps: _side("by_bands" + "_and_creep" * creeps, ("BANDS",), (
    _NOT_IN_BANDS if creeps else (*_NOT_IN_BANDS, "friction.w_s")), ("CORE", *_PLAYED)) for creeps in (False, True)}
_BY_STRIDES = {banded: _side("by_strides" + "_in_bands" * banded, ("STRIDES",), (
    _NOT_IN_STRIDES if banded else (*_NOT_IN_STRIDES, *_BANDED)), ("CORE", *_PLAYED)) for banded in (False, True)}
_BY_COILS = _side("by_coils", ("COILS",), (*_NO_SIDE, _PLAY, *_STRIDING, *_BANDED), (
    "CORE", *_PLAYED, "LINEAR", "LINEAR_BACKWARD", "LIMITED_FORWARD", "LIMITED_BACKWARD", "SHORT_FORWARD",
    "SHORT_BACKWARD"))
_BY_GAPS = _side("by_gaps", ("GAPS",), _NOT_IN_GAPS, ("CORE",))
_NOT_PLAIN = ("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", *_PLAYED, "CORE")
PLAIN_RUNS = Recipe(
    "plain_runs", _ENTRIES, absent=(*_RARE, _PENDULUM, "sweep", *_APART), never=_NOT_PLAIN)
CALM = Recipe("calm", ("servotwin.models.engine.calm:go",), absent=PLAIN_RUNS.absent, never=PLAIN_RUNS.never)
PENDULUM_RUNS = Recipe(
    "pendulum_runs", _ENTRIES, absent=(*_RARE, "sweep", *_APART),
    never=("SERIES", "HELD", "WITH_CURRENT", *_PLAYED, "CORE"))
GAP_RUNS = Recipe(
    "gap_runs", _ENTRIES, absent=_NOT_IN_GAPS,
    never=("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", "CREEP", "CORE"))
LOOK_SIDE_BY_SIDE = Recipe("look_side_by_side", ("servotwin.models.engine.sights:side_by_side",), absent=(
    "friction.kappa", "follower", *_APART))
LOOK_ONE_BY_ONE = Recipe("look_one_by_one", ("servotwin.models.engine.sights:one_by_one",), absent=_APART)
LOOK_DIGITAL = Recipe("look_digital", LOOK_ONE_BY_ONE.entries, absent=(*_NO_DIGITAL, "elastic"), present=_DIGITAL)
ALL_DIGITAL = Recipe("digital_runs", _ENTRIES, absent=(*_NO_DIGITAL, "elastic"), present=_DIGITAL)
PLAIN_DIGITAL = Recipe("plain_digital_runs", _ENTRIES, absent=(*_RARE, _PENDULUM, *_NO_DIGITAL, "elastic"),
                       never=_NOT_PLAIN, present=_DIGITAL)

BY_TICKS = Recipe("by_ticks", ("servotwin.models.engine.loops:go_on",), vector=True, absent=PLAIN_DIGITAL.absent,
                  never=PLAIN_DIGITAL.never, present=_DIGITAL)


def _sprung(name: str, entries: tuple[str, ...]) -> dict[bool, Recipe]:
    """Return the recipes of servos with a spring between two bodies, analog and digital."""
    return {digital: Recipe(name + "_digital" * digital, entries, never=("APART", "CREEP", "CORE"), absent=(
        *(_NO_DIGITAL if digital else _PROGRAM), *_NOT_SPRUNG), present=(*(_DIGITAL if digital else ()), _SPRUNG))
        for digital in (False, True)}


ELASTIC_RUNS = _sprung("elastic_runs", _ENTRIES)
LOOK_ELASTIC = _sprung("look_elastic", LOOK_ONE_BY_ONE.entries)
_ENDING = Recipe("ending", ("servotwin.models.engine.ending:look_at_lanes",), vector=True, absent=_PROGRAM)
_SHARED = ("pieces", "edges", "accuracy", "firmware")  # by all lanes, or by all that run side by side
_TILED: dict[str, Any] = {"numbers": Numbers, "chips": Chip}
_SMALLEST = 2.0**-150  # what is not more is zero in float32
_ROOM = 2_000_000  # numbers that lanes one after the other leave behind at once


def run(work: Work) -> Raw:
    """Run all lanes of a chunk: side by side where that is possible, one after the other where not."""
    raw = empty_raw(work)
    lanes = lanes_of(work)
    for kind in kinds_of(work.numbers, work.chip or NO_CHIP, work.lanes, work.law == "pulse", work.dtype, swept(lanes),
                         work.torque.count > 0, bool(work.curve)):
        if isinstance(kind, OneByOne):
            run_one_by_one(work, lanes, kind.which, raw, kind.recipe)
        else:
            run_side_by_side(work, lanes, kind, raw)
    if work.law == "digital":
        return raw
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
    plans = tiles.plan_room(kind.dtype, kind.form)
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
    kernels(recipe).start(lanes, which, memories)
    _finish(work, lanes, which, np.full(len(which), float(work.duration)), np.zeros(len(which), np.int64), memories,
            raw, recipe)


def _finish(work: Work, lanes: Lanes, which: Indices, durations: Floats, first: Indices, memories: Memories,
            raw: Raw, recipe: Recipe) -> None:
    """Let lanes go on one after the other, for durations of their own [s], from outputs of their own on."""
    times = _own(work.times, np.float64)
    at_once = max(1, _ROOM // (len(ALL_FIELDS) * max(len(times), 1)))
    for start in range(0, len(which), at_once):
        some = slice(start, start + at_once)
        part, own = which[some], _indices(first[some])
        found = np.zeros((len(part), len(ALL_FIELDS), len(times)))
        status, ended = np.zeros(len(part), np.int64), np.zeros(len(part))
        go_on(recipe, lanes, np.array(work.curve, np.float64).reshape(-1, 2), _rows(work.torque.rows),
              _indices(work.torque.first), _indices(work.torque.count), part, durations[some].copy(), times, own.copy(),
              found, taken(memories, some), status, ended)
        bad = status != 0
        raw.status[part], raw.ended[part] = status, np.where(bad, ended, work.duration)
        y = memories.rows[some]["point"]["y"]
        raw.final[part] = y[:, [0, 1, 3, 4]]
        failed = bad[:, None] & (times >= ended[:, None])
        ahead = np.arange(len(times)) >= own[:, None]
        for k, name in enumerate(ALL_FIELDS):
            if name in raw.fields:
                with np.errstate(over="ignore"):
                    own_part = np.where(failed, 0 if name in SMALL_FIELDS else np.nan, found[:, k])
                    raw.fields[name][part] = np.where(ahead, own_part, raw.fields[name][part])


def go_on(recipe: Recipe, *arguments: Any) -> None:
    """Let lanes go on as `runs.go_on` does, digital servos from tick to tick together as far as that leads."""
    *shared, ended = arguments
    if recipe == PLAIN_DIGITAL and not is_plain():
        to_first_ticks(kernels(recipe), *shared)
        kernels(BY_TICKS).go_on(*shared, loop_tiles.tile_room())
    kernels(recipe).go_on(*shared, ended)


class SideBySide(NamedTuple):
    """Lanes that run side by side in one form.

    Whether some have a potentiometer with play, whether some creep, and, where they go by strides, whether they have
    what makes bands.
    """

    which: Indices
    form: int
    slack: bool
    dtype: str
    creeps: bool = False
    banded: bool = False

    @property
    def recipe(self) -> Recipe:
        """Their kernels."""
        if self.form == tiles.BANDS:
            return _BY_BANDS[self.creeps]
        if self.form == tiles.STRIDES:
            return _BY_STRIDES[self.banded]
        return _BY_COILS if self.form == tiles.COILS else _BY_GAPS if self.form == tiles.GAPS else _BY_ARCS[self.dtype]

    @property
    def general(self) -> Recipe:
        """The kernels of those that cannot go on side by side."""
        if self.form == tiles.GAPS:
            return GAP_RUNS
        return PLAIN_RUNS if self.form in (tiles.ONE_FORMULA, tiles.ARCS) and not self.slack else ALL_RUNS


class OneByOne(NamedTuple):
    """Lanes that run one by one, by a form that leaves out what they lack."""

    which: Indices
    recipe: Recipe


def kinds_of(numbers: Numbers, chip: Chip, lanes: int, pulsed: bool, dtype: str, swept: Mask, recorded: Mask,
             curved: bool) -> list[SideBySide | OneByOne]:
    """Return how lanes run, whose numbers are numbers or arrays (lanes,).

    `swept` is whose command has a chirp, `recorded` whose load is recorded over time, `curved` whether the
    potentiometers have a table.
    """
    bridge, own = numbers.bridge, numbers.friction
    sprung, digital = _differs(numbers, "elastic"), bool(np.any(bridge.pwm > 0.0))
    if np.any(sprung) or digital:
        rigid = np.logical_not(sprung)
        rare = _either(_any_differs(numbers, (*_RARE, _PENDULUM)), recorded.any() and recorded)
        some = [OneByOne(_where(sprung, True, lanes), ELASTIC_RUNS[digital])]
        if digital:
            some.append(OneByOne(_where(rigid, _without(True, rare), lanes), PLAIN_DIGITAL))
        some.append(OneByOne(_where(rigid, rare if digital else True, lanes), ALL_DIGITAL if digital else ALL_RUNS))
        return [kind for kind in some if len(kind.which)]
    slack, swinging = _differs(numbers, "sensor.half_slack"), _differs(numbers, _PENDULUM)
    waving = swept.any() and swept
    alone = _either(_either(waving, recorded.any() and recorded), _differs(numbers, "friction.kappa"))
    banded, striding = _any_differs(numbers, _BANDED), _any_differs(numbers, _STRIDING)
    coiled, played = _differs(numbers, _COIL), _differs(numbers, _PLAY)
    braked = (bridge.off.D == 0.0) & (bridge.D_drive < numbers.source.V)
    by_bands = _either(banded, slack & np.logical_not(braked))
    loose = _without(played, alone, striding, coiled, own.varies != 0.0) if pulsed else False
    side: Any = False
    if pulsed and not curved and not is_plain():  # without a compiler a tile has no worth
        side = (_without(True, alone) & (numbers.sensor.step == 0.0) & (numbers.motor.K_b > 0.0)
                & (bridge.silence.coast == bridge.off.coast) & ((own.varies == 0.0) | _straight(own)))
    if dtype == "float32":  # what is not zero has to stay so
        for x in (*numbers_in(numbers), *numbers_in(chip)):
            fits = (x == 0.0) | (abs(x) > _SMALLEST)
            side = side if fits is True else side & fits
    plain = _without(True, by_bands, striding, coiled, played)
    forms: list[tuple[int, Any]] = [
        (tiles.ONE_FORMULA, braked & plain), (tiles.ARCS, np.logical_not(braked) & plain),
        (tiles.BANDS, _without(by_bands, striding, coiled, played)),
        (tiles.STRIDES, _without(striding, banded, coiled, played)),
        (tiles.STRIDES, _without(striding & banded, coiled, played)),
        (tiles.COILS, _without(coiled, banded, striding, played)), (tiles.GAPS, loose)]
    found: list[SideBySide | OneByOne] = []
    gone: Any = False
    for form, some in forms:
        which = _where(side, some, lanes)
        gone = _either(gone, some)
        lagging = bool(np.any(np.broadcast_to(slack, lanes)[which])) if np.any(slack) else False
        creeping = form == tiles.BANDS and bool(np.any(np.broadcast_to(own.varies * own.w_s > 0.0, lanes)[which]))
        in_bands = form == tiles.STRIDES and bool(np.any(np.broadcast_to(banded, lanes)[which]))
        own_type = dtype if form in (tiles.ONE_FORMULA, tiles.ARCS) else "float64"
        found.append(SideBySide(which, form, lagging, own_type, creeping, in_bands))
    one_by_one = np.logical_not(side & gone)
    rare = _without(_either(_any_differs(numbers, _RARE), waving), loose)
    found += [OneByOne(_where(some, one_by_one, lanes), recipe) for recipe, some in (
        (PLAIN_RUNS, _without(True, rare, swinging, loose)), (PENDULUM_RUNS, _without(swinging, rare)),
        (GAP_RUNS, loose), (ALL_RUNS, rare))]
    return [kind for kind in found if len(kind.which)]


def looking(recipe: Recipe) -> Recipe:
    """Return how lanes are looked at that run one by one in this way."""
    for digital, own in ELASTIC_RUNS.items():
        if recipe == own:
            return LOOK_ELASTIC[digital]
    return LOOK_DIGITAL if recipe in (PLAIN_DIGITAL, ALL_DIGITAL) else LOOK_ONE_BY_ONE


def _without(some: Any, *others: Any) -> Any:
    """Return `some` but for those that one of the others holds for."""
    for other in others:
        some = some if other is False else np.logical_and(some, np.logical_not(other))
    return some


def goes_together(numbers: Numbers, pulsed: bool) -> bool:
    """Tell whether all lanes take about as long, for none has a term that would let it run on its own."""
    return pulsed and not np.any(_any_differs(numbers, ("friction.kappa", _PLAY, *_STRIDING)))


def _any_differs(numbers: Numbers, names: tuple[str, ...]) -> Any:
    """Tell which lanes have one of some terms or numbers."""
    found: Any = False
    for name in names:
        found = _either(found, _differs(numbers, name))
    return found


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
