"""The forms in which lanes run compiled: what each can follow of what a servo asks for, and what it leaves to others.

Nothing here names a term: what kernels leave out, and which numbers they know, follows from what terms say.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from servotwin.models.engine.batch import digital_tiles, tiles
from servotwin.models.engine.legs.coupled_units import Coupling, Unit
from servotwin.models.engine.log import COUNTS, WITH_ROWS
from servotwin.models.state.records import record_of
from servotwin.models.terms.dependence import (
    AT_COMMANDS,
    AT_STOPS,
    BEYOND,
    BY_SHARE,
    CURVED_Q,
    DROPS,
    DRY,
    FADING,
    FOLLOWS,
    FREE_RUNNING,
    ON_HEAT,
    ON_I,
    ON_Q,
    ONE_WAY,
    PLAY,
    PROGRAM,
    PULSES,
    PWM,
    RECORDED,
    REGULATED,
    SHOWN,
    SILENCE,
    SLACK,
    STEPS,
    STRAIGHT,
    TABLE,
    TWO_BODIES,
)
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.unread import IN_GENERAL

Parts = tuple[tuple[Recipe, tuple[str, ...]], ...]  # kernels, and entries of theirs
_SIDE = tuple(f"servotwin.models.engine.batch.side_by_side:{name}" for name in ("start", "go_on", "advance", "refit"))
_ENTRIES = tuple(f"servotwin.models.engine.run.runs:{name}" for name in ("start", "ready", "to_first_ticks", "go_on",
                                                                    "note_failures"))
_DIGITAL = PROGRAM | BEYOND | AT_COMMANDS | PWM | ONE_WAY
_EVERYWHERE = STRAIGHT | DRY | AT_STOPS | SHOWN

# --- Lanes side by side -----------------------------------------------------------------------------------------------

BANDED = BY_SHARE | FADING | REGULATED
STRIDING = ON_HEAT | CURVED_Q | ON_Q
_BRAKED = STRAIGHT | DRY | PULSES | SLACK
_ANY_BRIDGE = _BRAKED | DROPS
SIDES = {
    tiles.ONE_FORMULA: (_BRAKED, 0),
    tiles.BANDS: (_ANY_BRIDGE | BANDED, BANDED | DROPS),
    tiles.STRIDES: (_ANY_BRIDGE | STRIDING | BANDED, STRIDING),
    tiles.COILS: (_ANY_BRIDGE | ON_I | BY_SHARE, ON_I),
    tiles.GAPS: (_ANY_BRIDGE | REGULATED | BY_SHARE | PLAY | TWO_BODIES | ON_HEAT, PLAY)}
"""Forms of going side by side, the fastest first: what each follows, and what of this its lanes have to ask for."""
_FORMS = ("ONE_FORMULA", "BANDS", "STRIDES", "COILS", "GAPS")


def _side(name: str, form: str, single: bool = False) -> Recipe:
    """Return the recipe of lanes that go side by side in a form."""
    return Recipe(name, _SIDE, vector=True, single=single, knows=SIDES[getattr(tiles, form)][0],
                  leaves=AT_STOPS | SHOWN, never=tuple(other for other in _FORMS if other != form))


_BY_FORMULA = {dtype: _side(f"side_by_side_{dtype}", "ONE_FORMULA", dtype == "float32")
               for dtype in ("float64", "float32")}
_BY_FORM = {getattr(tiles, form): _side(f"by_{form.lower()}", form) for form in _FORMS[1:]}

# --- Lanes one by one -------------------------------------------------------------------------------------------------

_PLAIN = _EVERYWHERE | DROPS | SILENCE | FREE_RUNNING | STEPS | TABLE | ON_Q
PLAIN = _PLAIN | PULSES | FOLLOWS | RECORDED
"""What servos may ask for that move by plain laws."""
_LEFT_TO_EVENTS = AT_STOPS | SHOWN | PULSES | STEPS
CALM = Recipe("calm", ("servotwin.models.engine.batch.event_free:go",), knows=PLAIN & ~(
    _LEFT_TO_EVENTS | RECORDED | TABLE), leaves=_LEFT_TO_EVENTS)
"""Ticks of lanes in which nothing happens, three times faster; the others are for `ALL_RUNS`."""
_TICKS = _PLAIN & ~ON_Q | _DIGITAL
LEGS = _TICKS | PLAY | TWO_BODIES | BY_SHARE
"""What legs follow exactly."""
_ALWAYS, _LEFT_TO_RUNS = PROGRAM | PWM, AT_STOPS | SHOWN | AT_COMMANDS
_BY_TICKS_ALONE = (
    # A spring, a pendulum and friction that fades count as if their torques stayed within a tick: where that is asked
    Recipe("legs", ("servotwin.models.engine.legs.tick_legs:go_stiff",), vector=True,
           knows=(LEGS | ON_Q | CURVED_Q | FADING) & ~_LEFT_TO_RUNS, leaves=_LEFT_TO_RUNS, always=_ALWAYS),
    Recipe("series", ("servotwin.models.engine.legs.coupled_ticks:alone",),  # warm windings, a supply with a limit
           knows=(LEGS & ~TABLE | ON_HEAT | REGULATED) & ~_LEFT_TO_RUNS, leaves=_LEFT_TO_RUNS, always=_ALWAYS))
"""Digital servos from tick to tick."""
ALL_RUNS = Recipe("runs", _ENTRIES, never=WITH_ROWS, parts=_BY_TICKS_ALONE)
"""All lanes: digital ones from tick to tick where that leads on, else from step to step."""
BY_TICKS = Recipe("by_ticks", ("servotwin.models.engine.batch.digital_batch:go_on",), vector=True,
                  knows=_TICKS & ~DROPS, always=_ALWAYS)
"""Digital servos from tick to tick, side by side; what is left of a call is for `ALL_RUNS`. Two to three times faster
for four servos of the catalog."""
# Not compiled for its own sake: what these call says which numbers are known where a program goes in one loop
_LEFT_BY_TICKS = _LEFT_TO_RUNS | BEYOND | ONE_WAY
_BY_TICKS = (replace(BY_TICKS, name="ticks_by_loops", knows=BY_TICKS.knows & ~_LEFT_BY_TICKS, leaves=_LEFT_BY_TICKS),
             tuple(f"servotwin.models.engine.{name}" for name in (
                 "batch.digital_tiles:enter", "batch.digital_rounds:watch", "batch.digital_rounds:decide",
                 "batch.digital_rounds:move",
                 "batch.digital_rounds:move_on", "batch.digital_rounds:follow")))

# --- Lanes between calls ----------------------------------------------------------------------------------------------

LOOK = Recipe("look", tuple(f"servotwin.models.engine.batch.observe_batch:{name}" for name in ("side_by_side",
                                                                                               "one_by_one")))
"""Lanes of all forms: to look leaves out little where terms are absent."""
TICKS = Recipe("ticks", (
    *(f"servotwin.models.engine.cosim.cosim_calls:{name}" for name in ("accept", "change", "follow")),
    *(f"servotwin.models.engine.cosim.cosim_lanes:{name}" for name in (
        "gather_lost", "to_records", "to_tiles", "forget_motions", "impose_on_tiles", "impose_on_records", "show_tiles",
        "show_records", "read_clocks", "take_status", "note_lost_buses", "break_up"))))
"""Lanes of all forms between two calls: what is imposed on them, and the way from tiles to records and back."""
ENDING = Recipe("ending", ("servotwin.models.engine.cosim.final_checks:look_at_lanes",), vector=True, knows=~_DIGITAL)
_IN_RUNS = tuple((replace(part, entries=_ENTRIES, never=WITH_ROWS), part.entries) for part in ALL_RUNS.parts)
_PARTS = {BY_TICKS: (_BY_TICKS, *_IN_RUNS), ALL_RUNS: _IN_RUNS}


def last_of(recipe: Recipe) -> Recipe:
    """Return the kernels that finish every call of lanes of a form."""
    return ALL_RUNS if recipe == BY_TICKS else recipe


def steps_of(recipe: Recipe, ended: Any, nearly: bool = False) -> Iterator[tuple[Recipe, str, tuple[Any, ...]]]:
    """Return the kernels by which lanes of a form go on one after the other, each with its entry.

    All of them have the arguments of `runs.go_on` up to the status, and these. `nearly` is as readings have it.
    """
    counts, last = np.zeros(COUNTS, np.int64), last_of(recipe)
    if recipe != last:
        yield last, "to_first_ticks", (counts,)
        yield recipe, "go_on", (digital_tiles.tile_room(),)
    yield last, "go_on", (nearly, ended, counts, np.zeros(2, record_of(Unit)), np.zeros(2, record_of(Coupling)))


def parts_of(recipe: Recipe) -> Parts:
    """Return the kernels by which lanes of a form may go, as `compile.unread` is asked of them.

    Those that say by themselves whether they do follow all numbers.
    """
    return _PARTS.get(recipe, ((recipe, ()),))


def side_by_side(form: int, dtype: str) -> Recipe:
    """Return the kernels of lanes that go side by side in a form."""
    return _BY_FORMULA[dtype] if form == tiles.ONE_FORMULA else _BY_FORM[form]


KERNELS = tuple(sorted((*(one.name for one in (ALL_RUNS, BY_TICKS, *_BY_FORMULA.values(), *_BY_FORM.values())),
                        ALL_RUNS.name + IN_GENERAL)))
"""Names of all kernels in which lanes run."""
