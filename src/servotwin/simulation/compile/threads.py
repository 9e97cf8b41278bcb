"""Lanes as a text of one lane a thread: PTX for a GPU, and C of the same digits for a processor.

State is a column of reals and one of whole numbers for each thing that a lane remembers, so that neighbouring threads
read neighbouring words; the servo's numbers are tiles, read where they are needed. A text follows what its flags say,
and nothing else. Numbers have 64 bits, or 32 throughout; whole numbers have 32, but for seeds and what draws noise.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from string import Template
from typing import Any

import numpy as np

from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.engine.legs.lane_legs import Stand
from servotwin.models.engine.memory import Inputs
from servotwin.models.state.records import TILE, fields_of, record_of, rows_of
from servotwin.models.terms.control import Firm
from servotwin.models.terms.dependence import PROGRAM, PWM
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Chip, Frame
from servotwin.models.terms.numbers import Numbers
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.signatures import named
from servotwin.simulation.compile.standalone import Standalone
from servotwin.simulation.compile.text.kinds import FLOAT64, INT64, Array, Kind, Record, Tuple
from servotwin.simulation.compile.text.translate import part_of_header

# --- What a lane remembers --------------------------------------------------------------------------------------------

PULSES_BY_ARCS, PULSES_BY_LEGS, TICKS = "pulses_by_arcs", "pulses_by_legs", "ticks"
"""Ways in which lanes go, a text each; by arcs those of which some may be left to legs."""
_STATE: dict[str, tuple[tuple[str, Any], ...]] = {
    PULSES_BY_ARCS: (("stand", Stand), ("now", Frame)), PULSES_BY_LEGS: (("stand", Stand), ("now", Frame)),
    TICKS: (("stand", Stand), ("firm", Firm))}


def columns(way: str) -> tuple[list[str], list[str]]:
    """Return the names of the reals and of the whole numbers that a lane remembers, in the order of their columns."""
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
        elif hint in (int, float):
            yield own, hint
        else:
            yield from ((f"{own}[{k}]", float) for k in range(len(hint.__args__)))


_ADDRESSES = ("numbers", "arcs", "chips", "programs", "curve", "seeds", "command", "torque", "reals", "wholes", "status",
              "left", "count")


@cache
def table_type(floats: bool) -> type[Any]:
    """Return the struct that a text is called with: addresses, on the device where it runs there."""
    order = ("lanes", "numbers", "arcs", "chips", "programs", "program_step", "curve", "curve_rows", *_ADDRESSES[5:])
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
    int64_t lanes;
    const void *numbers, *arcs, *chips, *programs; /* tiles, and records of programs */
    int64_t program_step;                          /* from the program of a lane to the next one's: 0 where it is one */
    const real *curve;                             /* of the potentiometers */
    int64_t curve_rows;
    const int64_t *seeds;
    const real *command, *torque; /* as the servo follows it; beside the load [N m] */
    real *reals;                  /* a column each: what a lane remembers */
    int32_t *wholes;
    int32_t *status; /* of a lane: 0, or that of its failure */
    int32_t *left;   /* lanes that arcs leave to legs, and how many */
    int32_t *count;
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
        stand.y.q = stand.y.w = NAN;
    n = ANEW(n); /* addresses anew, too: kept since the loads they would take a register each, or two */
$stores
    of->status[lane] = status;
}
''')
_PULSES = Template('''    const array_double_2 curve = {(real *)(uintptr_t)of->curve, {of->curve_rows, 2}};
    const $gone gone = $entry($by, ($numbers *)(uintptr_t)of->numbers + tile, ($arcs *)(uintptr_t)of->arcs + tile,
        ($chips *)(uintptr_t)of->chips + tile, j, curve, of->seeds[lane], of->command[lane], of->torque[lane], &stand,
        &now, of->duration);
    const int32_t status = (int32_t)gone.status;
    if (status == -1) {
        of->left[NEXT(of->count)] = lane;
        return;
    }
    stand = gone.stand;
    now = gone.chip;''')
_TICKS = Template('''    real piece[7] = {0, of->command[lane], 0, 0, 0, 0, 0};
    $program *program = ($program *)(uintptr_t)of->programs + of->program_step * lane;
    const $inputs told = {
        .command = {piece, {1, 7}}, .torque = {NULL, {0, 7}}, .constant_torque = of->torque[lane],
        .period = program->T_f, .edges = {NULL, {0}},
        .curve = {(real *)(uintptr_t)of->curve, {of->curve_rows, 2}}, .seed = of->seeds[lane], .accuracy = 0,
        .firmware = {program, {1}}};
    const $gone gone = $entry(($numbers *)(uintptr_t)of->numbers + tile, j, &told, &firm, &stand, of->duration);
    const int32_t status = (int32_t)gone.f1;
    stand = gone.f0;''')
_AROUND = Template('''
#if defined(__NVPTX__)
#define NEXT(count) __nvvm_atom_add_gen_i((count), 1)
#else
#define NEXT(count) ((*(count))++)
#endif
$lane
#if defined(__NVPTX__)
/* The grid is that of all lanes, also for those in a list: a captured graph cannot ask how many they are. */
void servotwin_advance(const lane_table of) {
    const int32_t k = __nvvm_read_ptx_sreg_ctaid_x() * __nvvm_read_ptx_sreg_ntid_x() + __nvvm_read_ptx_sreg_tid_x();
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
    """

    way: str
    flags: int
    floats: bool

    @property
    def real(self) -> np.dtype[Any]:
        """The type of its numbers."""
        return np.dtype(np.float32 if self.floats else np.float64)

    @property
    def recipe(self) -> Recipe:
        """The kernels within it."""
        never = "BY_LEGS" if self.way == PULSES_BY_ARCS else "BY_ARCS"
        entry = "ticks" if self.way == TICKS else "pulses"
        return Recipe(f"lane_{self.way}", (f"servotwin.models.engine.legs.lane_legs:{entry}",), knows=self.flags,
                      always=PROGRAM | PWM if self.way == TICKS else 0, never=(never,), in_floats=self.floats)

    @property
    def text(self) -> str:
        """C99 for a processor and, by clang, for a GPU: there it includes nothing, and calls nothing."""
        return _printed(self)


_FLOATS, _TABLE_OF = Array(FLOAT64, 1), Array(FLOAT64, 2)


def _tile(kind: Any) -> Record:
    return Record(rows_of(kind, np.float64))


def _signature(way: str) -> tuple[Kind, ...]:
    if way == TICKS:
        told = {"command": _TABLE_OF, "torque": _TABLE_OF, "edges": _FLOATS, "curve": _TABLE_OF, "seed": INT64,
                "firmware": Array(Record(record_of(Firmware)), 1)}
        inputs = Tuple(tuple(told.get(name, FLOAT64) for name in Inputs._fields), "Inputs", Inputs._fields)
        return _tile(Numbers), INT64, inputs, Record(record_of(Firm)), named(Stand), FLOAT64
    return (INT64, _tile(Numbers), _tile(ArcNumbers), _tile(Chip), INT64, _TABLE_OF, INT64, FLOAT64, FLOAT64,
            named(Stand), named(Frame), FLOAT64)


@cache
def _printed(own: LaneText) -> str:
    text = Standalone({}, floats=own.floats)
    entry, kinds = own.recipe.entries[0].split(":")[1], _signature(own.way)
    name = text.add(own.recipe, {entry: kinds})[entry]
    types = text.types
    words = {"tile": TILE, "entry": name, "gone": text.result_of(entry), "by": int(own.way == PULSES_BY_LEGS)}
    if own.way == TICKS:
        words |= {"numbers": types.record(kinds[0]), "inputs": types.of(kinds[2]), "program": types.record(
            Record(record_of(Firmware)))}
        call, state = _TICKS, f"{types.of(named(Stand))} stand; {types.record(kinds[3])} firm;"
    else:
        words |= {"numbers": types.record(kinds[1]), "arcs": types.record(kinds[2]), "chips": types.record(kinds[3])}
        call, state = _PULSES, f"{types.of(named(Stand))} stand; {types.of(named(Frame))} now;"
    reals, wholes = columns(own.way)
    places = [(path, f"reals[{k} * n]") for k, path in enumerate(reals)] + [
        (path, f"wholes[{k} * n]") for k, path in enumerate(wholes)]
    lane = _LANE.substitute(words, state=state, call=call.substitute(words),
                            loads="\n".join(f"    {path} = {place};" for path, place in places),
                            stores="\n".join(f"    {place} = {path};" for path, place in places))
    by_list = own.way == PULSES_BY_LEGS
    many, kth = ("(of.left ? *of.count : of.lanes)", "(of.left ? of.left[k] : k)") if by_list else ("of.lanes", "k")
    real = f"typedef {'float' if own.floats else 'double'} real;\n"
    return "\n".join([part_of_header("device.h"), _EXPORTED, text.narrow, real + _TABLE, _AROUND.substitute(lane=lane, many=many, kth=kth)])
