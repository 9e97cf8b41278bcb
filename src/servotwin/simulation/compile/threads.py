"""Lanes as a text of one lane a thread: PTX for a GPU, and C of the same digits for a processor.

State is a column of reals and one of whole numbers for each thing that a lane remembers, so that neighbouring threads
read neighbouring words; the servo's numbers are tiles, read where they are needed. A text follows what its flags say,
and nothing else. Numbers have 64 bits, or 32 throughout; whole numbers have 32, but for seeds and what draws noise.
"""

from __future__ import annotations

import ctypes
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from servotwin.errors import InputError
from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.engine.memory import Inputs
from servotwin.models.engine.observe import Observed
from servotwin.models.engine.one_lane import Stand
from servotwin.models.engine.step import REFUSED
from servotwin.models.state.records import TILE, fields_of, record_of, rows_of
from servotwin.models.terms import control, frame
from servotwin.models.terms.control import WAITING, Firm
from servotwin.models.terms.dependence import FADING, ON_HEAT, PROGRAM, PWM
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Chip, Frame
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.wiring import Wiring
from servotwin.simulation.compile.building import alone, compiled, ran, tell
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.finding import SUFFIX, Compiler, compilers, flags, level
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.signatures import named
from servotwin.simulation.compile.standalone import Standalone
from servotwin.simulation.compile.storage import is_there, key_of, writable_folder
from servotwin.simulation.compile.text.kinds import FLOAT64, INT64, Array, Kind, Record, Tuple
from servotwin.simulation.compile.text.translate import part_of_header

# --- The memory of a lane ---------------------------------------------------------------------------------------------

PULSES_BY_ARCS, PULSES_BY_LEGS, TICKS = "pulses_by_arcs", "pulses_by_legs", "ticks"
"""Ways in which lanes go, a text each; by arcs those of which some may be left to legs."""
_STATE: dict[str, tuple[tuple[str, Any], ...]] = {
    PULSES_BY_ARCS: (("stand", Stand), ("now", Frame)), PULSES_BY_LEGS: (("stand", Stand), ("now", Frame)),
    TICKS: (("stand", Stand), ("firm", Firm))}


_MOVES = re.compile(r"stand\.y\.(q|w|q_m|w_m)$")
_COLD = re.compile(r"stand\.y\.(T_w|T_h)$")  # where nothing warms up these stay
RINGS = ("duties", "coming")
"""Rings of a program, with what waits there: they stay in memory, those of one lane beside those of the next."""


def columns(way: str) -> tuple[list[str], list[str]]:
    """Return the names of the reals and of the whole numbers that a lane remembers, in the order of their columns.

    Those in the rings of a program are not among them.
    """
    reals: list[str] = []
    wholes: list[str] = []
    for room, kind in _STATE[way]:
        for path, hint in _leaves(room, kind):
            (wholes if hint is int else reals).append(path)
    return reals, wholes


def _leaves(path: str, kind: Any) -> Iterator[tuple[str, Any]]:
    for name, hint in fields_of(kind):
        own = f"{path}.{identifier(name)}"
        if hasattr(hint, "_fields"):
            yield from _leaves(own, hint)
        elif name not in RINGS:
            yield own, hint


_ADDRESSES = ("numbers", "arcs", "chips", "programs", "wirings", "curve", "seeds", "bare", "command", "torque",
              "followed", "total", "angle", "speed", "inertia", "voltage", "torque_enable", "mask", "which", "hung",
              "fed", "draws", "variant", "reals", "wholes", "rings", "status", "seen", "left", "count")


@cache
def table_type(floats: bool) -> type[Any]:
    """Return the struct that a text is called with: addresses, on the device where it runs there."""
    order = ("lanes", "places", "variants", *_ADDRESSES[:4], "program_step", "wirings", "curve", "curve_rows",
             *_ADDRESSES[6:], "kind", "count_given")
    fields = [(name, ctypes.c_void_p if name in _ADDRESSES else ctypes.c_int64) for name in order]
    return type("Table", (ctypes.Structure,), {"_fields_": [*fields, ("duration", ctypes.c_float if floats
                                                                     else ctypes.c_double)]})


_EXPORTED = '''#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif'''
_TABLE = '''
typedef struct {
    int64_t lanes, places, variants; /* places of numbers: those of lanes, then of variants, which are the last */
    const void *numbers, *arcs, *chips, *programs; /* tiles, and records of programs */
    int64_t program_step;                          /* from the program of a lane to the next one's: 0 where it is one */
    const void *wirings;                           /* tiles: how commands are taken */
    const real *curve;                             /* of the potentiometers */
    int64_t curve_rows;
    const int64_t *seeds;
    real *bare;                   /* a column each: torque of the load, inertias without it, reduction, period */
    const real *command, *torque; /* that are told: of a kind; beside the load [N m]; none of it: as before */
    real *followed, *total;       /* what that comes to: as the servo follows it; with the load's [N m] */
    const real *angle, *speed, *inertia, *voltage; /* imposed, or where lanes begin; nan, or none of it: not */
    const uint8_t *torque_enable;        /* whether torque is on; none of it: as before */
    uint8_t *mask;                       /* lanes of which that is said; none of it: all */
    const void *which;                   /* numbers of lanes, of 32 or 64 bits */
    real *hung, *fed;                    /* inertias and voltages that were imposed; nan: none, -1: not possible */
    int32_t *draws, *variant;            /* how many variants a lane has had before, and which one it is */
    real *reals;                         /* a column each: what a lane remembers */
    int32_t *wholes;
    real *rings;     /* of programs, a lane after the other */
    int32_t *status; /* of a lane: 0, or that of its failure */
    real *seen;      /* a column each: signals, and the time since a lane began */
    int32_t *left;   /* lanes that arcs leave to legs, and how many */
    int32_t *count;
    int64_t kind;    /* of commands, or bits of numbers of lanes */
    int64_t count_given; /* how many those are */
    real duration;
} lane_table;
'''
_LANE = Template('''
INLINED void one(const lane_table *of, int32_t lane) {
    int64_t n = of->lanes;
    const int64_t tile = lane / $tile;
    const int32_t j = lane % $tile;
    real *reals = of->reals + lane;
    int32_t *wholes = of->wholes + lane;
    if (of->status[lane] != 0)
        return;
    $state
$loads
$call
    if (status != 0)
        stand.y.q = stand.y.w = stand.y.q_m = stand.y.w_m = NAN;
    n = ANEW(n); /* addresses anew, too: kept since the loads they would take a register each, or two */
$stores
    of->status[lane] = status;
}
''')
_PULSES = Template('''    const array_double_2 curve = {(real *)(uintptr_t)of->curve, {of->curve_rows, 2}};
    const $gone gone = $entry($by, ($numbers *)(uintptr_t)of->numbers + tile, ($arcs *)(uintptr_t)of->arcs + tile,
        ($chips *)(uintptr_t)of->chips + tile, j, curve, of->seeds[lane], of->followed[lane], of->total[lane], &stand,
        &now, of->duration);
    const int32_t status = (int32_t)gone.status;
    if (status == -1) {
        of->left[NEXT(of->count)] = lane;
        return;
    }
    stand = gone.stand;
    now = gone.chip;''')
_TICKS = Template('''    real piece[7] = {0, of->followed[lane], 0, 0, 0, 0, 0};
    $program *program = ($program *)(uintptr_t)of->programs + of->program_step * lane;
    firm.duties = of->rings + (int64_t)$room * lane;
    firm.coming = firm.duties + $room / 2;
    const $inputs told = {
        .command = {piece, {1, 7}}, .torque = {NULL, {0, 7}}, .constant_torque = of->total[lane],
        .period = program->T_f, .edges = {NULL, {0}},
        .curve = {(real *)(uintptr_t)of->curve, {of->curve_rows, 2}}, .seed = of->seeds[lane], .accuracy = 0,
        .firmware = {program, {1}}};
    /* The memory of the program stays where it is: in registers it would have no room. */
    const $gone gone = $entry(($numbers *)(uintptr_t)of->numbers + tile, j, &told, ANEW(&firm), &stand, of->duration);
    const int32_t status = (int32_t)gone.f1;
    stand = gone.f0;''')
_PREPARE = Template('''
INLINED void prepare(const lane_table *of, int32_t lane) {
    const int64_t tile = lane / $tile;
    $prepare(($numbers *)(uintptr_t)of->numbers + tile, ($arcs *)(uintptr_t)of->arcs + tile, lane % $tile);
}
''')
_FOR_ALL = Template('''
#if defined(__NVPTX__)
void servotwin_$entry(const lane_table of) {
    const int32_t k = THREAD;
    if (k < of.$many)
        $entry(&of, k);
}
#else
EXPORTED void servotwin_$entry(const lane_table *of, int64_t first, int64_t last) {
    for (int64_t k = first; k < last && k < of->$many; k++)
        $entry(of, (int32_t)k);
}
#endif
''')
_BESIDE = Template('''
#define FINITE(x) ((x) - (x) == 0)
INLINED void lose(const lane_table *of, int32_t lane) {
    const int64_t n = of->lanes;
    real *reals = of->reals + lane;
    if (of->status[lane] == 0)
        of->status[lane] = $refused;
$lose
}
INLINED void tell(const lane_table *of, int32_t lane) {
    const int64_t n = of->lanes;
    if (of->mask && !of->mask[lane])
        return;
    if (of->torque) {
        of->total[lane] = $load_torque + of->torque[lane];
        if (!FINITE(of->total[lane]))
            lose(of, lane);
    }
    if (of->command) {
        const int64_t tile = lane / $tile;
        const real followed =
            $follow(of->kind, ($wirings *)(uintptr_t)of->wirings + tile, lane % $tile, of->command[lane]);
        of->followed[lane] = followed;
        if (followed != followed)
            lose(of, lane);
    }
}
INLINED void begin(const lane_table *of, int32_t lane) {
    const int64_t n = of->lanes, tile = lane / $tile;
    const int32_t j = lane % $tile;
    real *reals = of->reals + lane;
    int32_t *wholes = of->wholes + lane;
    if (of->mask && !of->mask[lane])
        return;
    $wirings *wiring = ($wirings *)(uintptr_t)of->wirings + tile;
    const array_double_2 curve = {(real *)(uintptr_t)of->curve, {of->curve_rows, 2}};
    const real command = of->followed[lane];
    const $stand stand = $begin(($numbers *)(uintptr_t)of->numbers + tile, wiring, j, curve, command,
        of->angle ? of->angle[lane] : NAN);
    if (command != command || stand.y.q != stand.y.q || !FINITE(of->total[lane]) || of->fed[lane] < 0) {
        lose(of, lane);
        return;
    }
$begun
    of->status[lane] = 0;
}
INLINED void look(const lane_table *of, int32_t lane) {
    const int64_t n = of->lanes, tile = lane / $tile;
    const int32_t j = lane % $tile;
    real *reals = of->reals + lane, *seen = of->seen + lane;
    int32_t *wholes = of->wholes + lane;
    const array_double_2 curve = {(real *)(uintptr_t)of->curve, {of->curve_rows, 2}};
    $state
$loads
$rings    const $observed shown = $look(($numbers *)(uintptr_t)of->numbers + tile, j, curve,
        of->total[lane], $reduction, $memory);
    const int lost = of->status[lane] != 0;
$shown
}
INLINED void impose(const lane_table *of, int32_t lane) {
    const int64_t n = of->lanes, tile = lane / $tile;
    const int32_t j = lane % $tile;
    real *reals = of->reals + lane;
    int32_t *wholes = of->wholes + lane;
    if ((of->mask && !of->mask[lane]) || of->status[lane] != 0)
        return;
    $numbers *numbers = ($numbers *)(uintptr_t)of->numbers + tile;
    if (of->inertia && of->inertia[lane] == of->inertia[lane]) {
        if (of->inertia[lane] < 0 || !FINITE(of->inertia[lane])) {
            lose(of, lane);
            return;
        }
        of->hung[lane] = of->inertia[lane];
        $hang(numbers, j, $output_inertia, $motor_inertia, of->hung[lane]);
    }
    if (of->voltage && of->voltage[lane] == of->voltage[lane]) {
        of->fed[lane] = $feed(numbers, j, of->voltage[lane]) ? of->voltage[lane] : -1;
        if (of->fed[lane] < 0) {
            lose(of, lane);
            return;
        }
    }
    if (of->inertia || of->voltage) {
$prepared    }
$enable
    $stand stand = {0};
$stand_loads
    stand = $impose(numbers, j, &stand, of->angle ? of->angle[lane] : NAN, of->speed ? of->speed[lane] : NAN);
$stand_stores
}
INLINED void copy(real *tiles, int64_t size, int64_t from, int32_t lane) {
    real *to = tiles + lane / $tile * size + lane % $tile;
    tiles += from / $tile * size + from % $tile;
    for (; size > 0; size -= $tile, to += $tile, tiles += $tile)
        *to = *tiles;
}
INLINED void change(const lane_table *of, int32_t lane) {
    const int64_t n = of->lanes, tile = lane / $tile;
    const int32_t j = lane % $tile;
    if (of->mask && !of->mask[lane])
        return;
    const int64_t variant = $chosen(of->seeds[lane], ++of->draws[lane], of->variants);
    const int64_t from = of->places - of->variants + variant;
    of->variant[lane] = (int32_t)variant;
    const real load_torque = $load_torque;
    $numbers *numbers = ($numbers *)(uintptr_t)of->numbers + tile;
$copies
    for (int k = 0; k < $columns; k++)
        of->bare[k * of->places + lane] = of->bare[k * of->places + from];
    of->total[lane] += $load_torque - load_torque;
    if (of->hung[lane] == of->hung[lane])
        $hang(numbers, j, $output_inertia, $motor_inertia, of->hung[lane]);
    if (of->fed[lane] >= 0 && !$feed(numbers, j, of->fed[lane]))
        of->fed[lane] = -1;
$prepared}
INLINED void mark(const lane_table *of, int32_t k) {
    const int64_t lane = of->kind == 64 ? ((const int64_t *)of->which)[k] : ((const int32_t *)of->which)[k];
    if (0 <= lane && lane < of->lanes)
        of->mask[lane] = 1;
}
''')
BARE = ("load_torque", "output_inertia", "motor_inertia", "reduction", "period")
"""Columns of what lanes are beside their tiles: of the load, of the shaft without it, and of frames or ticks."""
_ENTRIES_BESIDE = ("tell", "begin", "impose", "change", "mark", "look")
SEEN = (*Observed._fields, "time")
"""Columns of what shows of lanes."""
_THREAD = '''
#if defined(__NVPTX__)
#define NEXT(count) __nvvm_atom_add_gen_i((count), 1)
#define THREAD (__nvvm_read_ptx_sreg_ctaid_x() * __nvvm_read_ptx_sreg_ntid_x() + __nvvm_read_ptx_sreg_tid_x())
#else
#define NEXT(count) ((*(count))++)
#endif
'''
_AROUND = Template('''
$lane
#if defined(__NVPTX__)
/* The grid is that of all lanes for those in a list: a captured graph cannot ask how many they are. */
void servotwin_advance(const lane_table of) {
    const int32_t k = THREAD;
    if (k < $many)
        one(&of, $kth);
}
#else
EXPORTED void servotwin_advance(const lane_table *lanes, int64_t first, int64_t last) {
    const lane_table of = *lanes;
    for (int64_t k = first; k < last && k < $many; k++)
        one(&of, (int32_t)$kth);
}
#endif
''')


# --- The text ---------------------------------------------------------------------------------------------------------

@dataclass(frozen=True)
class LaneText:
    """A text of lanes that go in one way.

    Parameters
    ----------
    way : str
        One of `PULSES_BY_ARCS`, `PULSES_BY_LEGS`, `TICKS`.
    flags : int
        All that it follows: flags of `terms.dependence`.
    floats : bool
        Whether numbers have 32 bits.
    beside : bool
        Whether it has all else than time: where lanes begin, and what is seen of them.
    """

    way: str
    flags: int
    floats: bool
    beside: bool = False

    @property
    def real(self) -> np.dtype[Any]:
        """The type of its numbers."""
        return np.dtype(np.float32 if self.floats else np.float64)

    @property
    def recipe(self) -> Recipe:
        """The kernels within it."""
        never = ("BY_LEGS" if self.way == PULSES_BY_ARCS else "BY_ARCS", *(
            () if self.flags & FADING else ("BY_CREEPS",)), *(() if self.flags & ON_HEAT else ("BY_SERIES",)))
        entries = tuple(f"servotwin.models.{'state.noise' if entry == 'chosen' else 'engine.one_lane'}:{entry}"
                        for entry in _signatures(self))
        return Recipe(f"lane_{self.way}{'_beside' if self.beside else ''}", entries, knows=self.flags,
                      always=PROGRAM | PWM if self.way == TICKS else 0, never=never, in_floats=self.floats)

    @property
    def text(self) -> str:
        """C99 for a processor and, by clang, for a GPU: there it includes nothing, and calls nothing."""
        return _printed(self)


def entries(own: LaneText) -> tuple[str, ...]:
    """Return the names of a text's functions, which are kernels on a GPU."""
    if own.beside:
        return tuple(f"servotwin_{entry}" for entry in _ENTRIES_BESIDE)
    return ("servotwin_advance", "servotwin_prepare") if own.way == PULSES_BY_ARCS else ("servotwin_advance",)


_FLOATS, _TABLE_OF = Array(FLOAT64, 1), Array(FLOAT64, 2)


def _tile(kind: Any) -> Record:
    return Record(rows_of(kind, np.float64))


def _signatures(own: LaneText) -> dict[str, tuple[Kind, ...]]:
    """Return what the entries of a text are called with, the one that advances a lane, or looks at it, first."""
    numbers, arcs, wirings, stand, chip = _tile(Numbers), _tile(ArcNumbers), _tile(Wiring), named(Stand), named(Frame)
    firm = Record(record_of(Firm))
    if own.beside:
        always: dict[str, tuple[Kind, ...]] = {"follow": (INT64, wirings, INT64, FLOAT64)}
        always |= {"begin": (numbers, wirings, INT64, _TABLE_OF, FLOAT64, FLOAT64)}
        always |= {"impose": (numbers, INT64, stand, FLOAT64, FLOAT64), "hang": (numbers, INT64, *[FLOAT64] * 3)}
        always |= {"prepare": (numbers, arcs, INT64)} if own.way == PULSES_BY_ARCS else {}
        always |= {"chosen": (INT64, INT64, INT64), "feed": (numbers, INT64, FLOAT64)}
        looks = ("look_at_ticks", firm) if own.way == TICKS else ("look_at_pulses", chip)
        return {looks[0]: (numbers, INT64, _TABLE_OF, FLOAT64, FLOAT64, stand, looks[1])} | always
    if own.way == TICKS:
        told: dict[str, Kind] = {"command": _TABLE_OF, "torque": _TABLE_OF, "edges": _FLOATS, "curve": _TABLE_OF,
                                 "seed": INT64, "firmware": Array(Record(record_of(Firmware)), 1)}
        inputs = Tuple(tuple(told.get(name, FLOAT64) for name in Inputs._fields), "Inputs", Inputs._fields)
        return {"ticks": (numbers, INT64, inputs, firm, stand, FLOAT64)}
    pulses: dict[str, tuple[Kind, ...]] = {"pulses": (
        INT64, numbers, arcs, _tile(Chip), INT64, _TABLE_OF, INT64, FLOAT64, FLOAT64, stand, chip, FLOAT64)}
    return pulses | ({"prepare": (numbers, arcs, INT64)} if own.way == PULSES_BY_ARCS else {})


_RINGS = re.compile(rf"\b(float|double) ({'|'.join(RINGS)})\[{WAITING}\];")


def _kernels(own: LaneText, signatures: Mapping[str, tuple[Kind, ...]]) -> tuple[Standalone, dict[str, str]]:
    """Return the kernels of a text, and the names of its entries; numbers that act in nothing have no place.

    A struct whose address is taken is in the memory of the thread, with all that it has.
    """
    acting, idle = set[tuple[str, str]](), set[tuple[str, str]]()
    for path, name, field in _numbers_of(Numbers, ""):
        (idle if path in own.recipe.absent else acting).add((name, field))
    missed = set[tuple[str, str]]()
    while True:
        text = Standalone({}, floats=own.floats, unstored=frozenset(idle - acting - missed))
        names = text.add(own.recipe, signatures)
        if not text.types.missed:
            return text, names
        missed |= text.types.missed


def _numbers_of(kind: Any, path: str) -> Iterator[tuple[str, str, str]]:
    """Return the numbers of a servo: the path of each, and the names of its tuple and of itself in that."""
    for name, hint in fields_of(kind):
        if hasattr(hint, "_fields"):
            yield from _numbers_of(hint, f"{path}{name}.")
        else:
            yield path + name, kind.__name__, name


@cache
def _printed(own: LaneText) -> str:
    signatures = _signatures(own)
    text, names = _kernels(own, signatures)
    (entry, kinds), *_ = signatures.items()
    types, by_ticks = text.types, own.way == TICKS
    reals, wholes = columns(own.way)
    places = [(path, f"{name}[{k} * n]") for name, paths in (("reals", reals), ("wholes", wholes))
              for k, path in enumerate(paths)
              if path != "stand.y.i" and (own.flags & ON_HEAT or not _COLD.match(path))]  # no current has inertia
    stand, firm = types.of(named(Stand)), types.record(Record(record_of(Firm)))
    words = {
        "tile": TILE, "refused": REFUSED, "by": int(own.way == PULSES_BY_LEGS), "room": 2 * WAITING, "stand": stand,
        "entry": names[entry], "gone": text.result_of(entry), "numbers": types.record(_tile(Numbers)),
        "state": f"{stand} stand = {{0}}; " + (f"{firm} firm;" if by_ticks else f"{types.of(named(Frame))} now;"),
        "loads": _lines(f"{path} = {place};" for path, place in places),
        "stores": _lines(f"{place} = {path};" for path, place in places),
        "lose": _lines(f"    {place} = NAN;" for path, place in places if _MOVES.match(path))}
    if own.beside:
        words |= {"arcs": types.record(_tile(ArcNumbers)), "wirings": types.record(_tile(Wiring)), **(
            {"program": types.record(Record(record_of(Firmware)))} if by_ticks else
            {"chips": types.record(_tile(Chip))})}
        around = _beside(words, names, places, by_ticks)
    else:
        around = _advancing(own, words, names, text, kinds)
    kernels = _RINGS.sub(r"\1 *\2;", text.narrowed())
    real = f"typedef {'float' if own.floats else 'double'} real;\n"
    return "\n".join([part_of_header("device.h"), _EXPORTED, kernels, real + _TABLE + _THREAD, around])


def _advancing(own: LaneText, words: dict[str, Any], names: Mapping[str, str], text: Standalone,
               kinds: tuple[Kind, ...]) -> str:
    """Return the functions that let lanes advance, around the kernels."""
    types, prepare = text.types, ""
    if own.way == TICKS:
        words = words | {"inputs": types.of(kinds[2]), "program": types.record(Record(record_of(Firmware)))}
    else:
        words = words | {"arcs": types.record(_tile(ArcNumbers)), "chips": types.record(_tile(Chip))}
    if own.way == PULSES_BY_ARCS:
        prepare = _PREPARE.substitute(words, prepare=names["prepare"])
        prepare += _FOR_ALL.substitute(entry="prepare", many="lanes")
    lane = _LANE.substitute(words, call=(_TICKS if own.way == TICKS else _PULSES).substitute(words))
    many, kth = ("(of.left ? *of.count : of.lanes)", "(of.left ? of.left[k] : k)") if words["by"] else ("of.lanes", "k")
    return _AROUND.substitute(lane=lane + prepare, many=many, kth=kth)


def _beside(words: dict[str, Any], names: Mapping[str, str], places: Sequence[tuple[str, str]], by_ticks: bool) -> str:
    """Return the functions that let lanes begin, and look at them; noise continues where it was."""
    begun = dict(_numbers_in("firm", control.AT_START)) if by_ticks else dict(_numbers_in("now", frame.AT_START))
    kept = ("firm.draws", "now.draws")
    bare = {name: f"of->bare[{k} * of->places + lane]" for k, name in enumerate(BARE)}
    time = f"stand.frames * {bare['period']} + stand.time"
    shown = [f"shown.{identifier(name)}" for name in Observed._fields]
    prepared = "" if "prepare" not in names else (
        f"        {names['prepare']}(numbers, ({words['arcs']} *)(uintptr_t)of->arcs + tile, j);\n")
    tiles = {"numbers": words["numbers"], "wirings": words["wirings"]} | ({} if by_ticks else {"chips": words["chips"]})
    copies = [f"copy((real *)(uintptr_t)of->{name}, sizeof({kind}) / sizeof(real), from, lane);"
              for name, kind in tiles.items()]
    if by_ticks:
        program = f"({words['program']} *)(uintptr_t)of->programs"
        copies.append(f"({program})[lane] = ({program})[from];")
    return _BESIDE.substitute(
        words, **bare, **{entry: names[entry] for entry in ("follow", "begin", "impose", "hang",
        "chosen", "feed")}, prepared=prepared, copies=_lines(copies), columns=len(BARE),
        look=words["entry"], observed=words["gone"],
        memory="&stand, &firm" if by_ticks else "&stand, &now",
        rings=f"    firm.duties = of->rings + {2 * WAITING}LL * lane, firm.coming = firm.duties + {WAITING};\n"
        if by_ticks else "",
        begun=_lines(f"{place} = {begun.get(path, path)};" for path, place in places if path not in kept),
        enable="" if not by_ticks else (
            f"    if (of->torque_enable)\n        {dict(places)['firm.torque']} = of->torque_enable[lane] != 0;"),
        stand_loads=_lines(f"{path} = {place};" for path, place in places if path.startswith("stand.")),
        stand_stores=_lines(f"{place} = {path};" for path, place in places if path.startswith("stand.")),
        shown=_lines(f"seen[{k} * n] = lost ? NAN : {value};" for k, value in enumerate((*shown, time)))
    ) + "".join(_FOR_ALL.substitute(entry=entry, many="count_given" if entry == "mark" else "lanes")
                for entry in _ENTRIES_BESIDE)


def _lines(lines: Iterable[str]) -> str:
    return "\n".join(f"    {line}" for line in lines)


def _numbers_in(path: str, values: Any) -> Iterator[tuple[str, str]]:
    """Return the numbers of a named tuple as C has them, by their paths; rings apart."""
    for name, value in zip(values._fields, values, strict=True):
        own = f"{path}.{identifier(name)}"
        if hasattr(value, "_fields"):
            yield from _numbers_in(own, value)
        elif name not in RINGS:
            yield own, str(value) if isinstance(value, int) else repr(value).replace("inf", "INFINITY")


# --- Libraries of a text for this processor, and PTX of it for a GPU --------------------------------------------------

@cache
def library(own: LaneText) -> ctypes.CDLL:
    """Return the library of a text, made by the compiler at hand where the cache has none.

    Raises
    ------
    InputError
        If no compiler makes one.
    """
    return ctypes.CDLL(str(_kept(own, SUFFIX, lambda compiler, path: compiled(own.recipe, own.text, compiler, path))))


def ptx(own: LaneText) -> str:
    """Return the PTX of a text, made by clang or zig where the cache has none.

    Raises
    ------
    InputError
        If there is neither, or one without this target.
    """
    return _kept(own, ".ptx", lambda compiler, path: _as_ptx(own, compiler, path)).read_text(encoding="utf-8")


def _kept(own: LaneText, end: str, make: Callable[[Compiler, Path], str | None]) -> Path:
    """Return the file that a compiler makes of a text, from the cache where it is there."""
    folder, problems = writable_folder(), []
    for compiler in compilers():
        key = key_of(own.text, compiler.identity, *compiler.command, *flags(False, level()), *_NVPTX, *_FOR_PTX)
        path = folder / f"{own.recipe.name}-{key}{end}"
        try:
            with alone(path):
                problem = None if is_there(path) else make(compiler, path)
        except OSError as error:
            problem = str(error)
        if problem is None:
            return path
        problems.append(f"{Path(compiler.command[0]).name}: {problem}")
    raise InputError("lanes one a thread", "; ".join(problems) or "no C compiler",
                     "clang or zig for a GPU, any C compiler for this processor")


_NVPTX = ("-march=sm_80", "-Xclang", "-target-feature", "-Xclang", "+ptx70")  # Ampere and later, drivers from 2020 on
_FOR_PTX = ("-std=gnu99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-ffreestanding", "-w")


def _as_ptx(own: LaneText, compiler: Compiler, path: Path) -> str | None:
    """Compile a text to PTX aside, and put that in its place; return what is wrong, if anything.

    C has no word for a kernel, so the calling convention is put into the intermediate text.
    """
    tell()
    zig = "ziglang" in compiler.command
    target = ("-target", "nvptx64-cuda-none") if zig else ("--target=nvptx64-nvidia-cuda",)
    with tempfile.TemporaryDirectory(prefix=".making-", dir=path.parent, ignore_cleanup_errors=True) as aside:
        source, middle, made, said = (Path(aside) / name for name in ("lanes.c", "lanes.ll", "lanes.ptx", "said.txt"))
        source.write_text(own.text, encoding="utf-8")
        for before, after, more in ((source, middle, ("-emit-llvm",)), (middle, made, ())):
            command = [*compiler.command, *target, *_NVPTX, *_FOR_PTX, "-S", *more, str(before), "-o", str(after)]
            problem = ran(command, compiler.environment(path.parent), said, after)
            if problem is not None:
                return problem
            if more:
                text = middle.read_text(encoding="utf-8")
                middle.write_text(_KERNEL.sub("define ptx_kernel void @servotwin", text), encoding="utf-8")
        os.replace(made, path)
    return None


_KERNEL = re.compile(r"define (?:dso_local )?void @servotwin")
