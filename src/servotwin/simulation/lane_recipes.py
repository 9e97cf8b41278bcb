"""The forms in which lanes run compiled: what each can follow of what a servo asks for, and what it leaves to others.

Nothing here names a term: what kernels leave out, and which numbers they know, follows from what terms say.
"""

from __future__ import annotations

from servotwin.models.engine import tiles
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
    SPRING,
    STEEP_W,
    STEPS,
    STRAIGHT,
    TABLE,
    TWO_BODIES,
)
from servotwin.simulation.compile import Recipe

_SIDE = tuple(f"servotwin.models.engine.side_by_side:{name}" for name in ("start", "go_on", "advance", "refit"))
_ENTRIES = tuple(f"servotwin.models.engine.runs:{name}" for name in ("start", "go_on"))
_DIGITAL = PROGRAM | BEYOND | AT_COMMANDS | PWM | ONE_WAY
_MEAN = FOLLOWS | STEEP_W  # servos without pulses
_NOT_DIGITAL = _MEAN | PULSES | ON_I
_EVERYWHERE = STRAIGHT | DRY | AT_STOPS | SHOWN

# --- Lanes side by side -----------------------------------------------------------------------------------------------

BANDED = BY_SHARE | FADING | REGULATED
STRIDING = ON_HEAT | CURVED_Q | ON_Q
_BRAKED, _ARCS = STRAIGHT | DRY | PULSES | SLACK, STRAIGHT | DRY | PULSES | DROPS
_ANY_BRIDGE = _BRAKED | _ARCS
SIDES = (
    (tiles.ONE_FORMULA, _BRAKED, 0), (tiles.ARCS, _ARCS, 0), (tiles.BANDS, _ANY_BRIDGE | BANDED, BANDED | SLACK),
    (tiles.STRIDES, _ANY_BRIDGE | STRIDING, STRIDING), (tiles.STRIDES, _ANY_BRIDGE | STRIDING | BANDED, STRIDING),
    (tiles.COILS, _ANY_BRIDGE | ON_I, ON_I), (tiles.GAPS, _ANY_BRIDGE | REGULATED | PLAY | TWO_BODIES, PLAY))
"""Forms of going side by side, the fastest first: what each follows, and what of this its lanes have to ask for."""
_FORMS = ("ONE_FORMULA", "ARCS", "BANDS", "STRIDES", "COILS", "GAPS")


def _side(name: str, forms: tuple[str, ...], knows: int, single: bool = False) -> Recipe:
    """Return the recipe of lanes that go side by side in some forms."""
    return Recipe(name, _SIDE, vector=True, single=single, knows=knows, leaves=AT_STOPS | SHOWN,
                  never=tuple(form for form in _FORMS if form not in forms))


_BY_ARCS = {dtype: _side(f"side_by_side_{dtype}", ("ONE_FORMULA", "ARCS"), _ANY_BRIDGE, dtype == "float32")
            for dtype in ("float64", "float32")}
_BY_BANDS = {creeps: _side("by_bands" + "_and_creep" * creeps, ("BANDS",),
                           _ANY_BRIDGE | (BANDED if creeps else BANDED & ~FADING)) for creeps in (False, True)}
_BY_STRIDES = {banded: _side("by_strides" + "_in_bands" * banded, ("STRIDES",),
                             _ANY_BRIDGE | STRIDING | BANDED * banded) for banded in (False, True)}
_BY_COILS = _side("by_coils", ("COILS",), _ANY_BRIDGE | ON_I)
_BY_GAPS = _side("by_gaps", ("GAPS",), _ANY_BRIDGE | REGULATED | PLAY | TWO_BODIES)

# --- Lanes one by one -------------------------------------------------------------------------------------------------

ALL_RUNS = Recipe("runs", _ENTRIES)  # they take hardly longer for what others lack
_PLAIN = _EVERYWHERE | DROPS | SILENCE | FREE_RUNNING | STEPS | TABLE | ON_Q
_CALM = "servotwin.models.engine.calm:go"
PLAIN_RUNS = Recipe("plain_runs", (*_ENTRIES, _CALM), knows=_PLAIN | CURVED_Q | PULSES | FOLLOWS | RECORDED)
GAP_RUNS = Recipe("gap_runs", _ENTRIES, knows=(
    _EVERYWHERE | DROPS | SILENCE | FREE_RUNNING | STEPS | TABLE | SLACK | PULSES | REGULATED | PLAY | TWO_BODIES))
_LEFT_TO_EVENTS = AT_STOPS | SHOWN | PULSES | STEPS
CALM = PLAIN_RUNS.knows & ~(_LEFT_TO_EVENTS | CURVED_Q | RECORDED | TABLE)
"""What lanes of those kernels may ask for that go on calmly, as far as that leads."""
# Not compiled for their own sake: what these call says which numbers are known where lanes go on calmly, and where a
# program goes in one loop
_CALMLY = (Recipe("calm", (_CALM,), knows=CALM, leaves=_LEFT_TO_EVENTS), ())
ALL_DIGITAL = Recipe("digital_runs", _ENTRIES, knows=~(_NOT_DIGITAL | SPRING), always=PROGRAM | PWM)
PLAIN_DIGITAL = Recipe("plain_digital_runs", _ENTRIES, knows=_PLAIN | _DIGITAL, always=PROGRAM | PWM)
_LEFT_BY_LOOPS = AT_STOPS | SHOWN | AT_COMMANDS
_LOOPED = (PLAIN_DIGITAL.knows & ~(_LEFT_BY_LOOPS | ON_Q))
_GLIDING = (Recipe("gliding", _ENTRIES, knows=_LOOPED, leaves=_LEFT_BY_LOOPS, always=PROGRAM | PWM),
            ("servotwin.models.engine.glides:go",))
_LEFT_BY_TICKS = _LEFT_BY_LOOPS | BEYOND | ONE_WAY
_TICKS = tuple(f"servotwin.models.engine.{name}" for name in (
    "loop_tiles:enter", "loop_rounds:watch", "loop_rounds:decide", "loop_rounds:move", "loop_rounds:move_on",
    "loop_rounds:follow"))
_TICKING = (Recipe("ticking", ("servotwin.models.engine.loops:go_on",), vector=True, knows=_LOOPED & ~_LEFT_BY_TICKS,
                   leaves=_LEFT_BY_TICKS, always=PROGRAM | PWM), _TICKS)
BY_TICKS = Recipe("by_ticks", ("servotwin.models.engine.loops:go_on",), vector=True, knows=PLAIN_DIGITAL.knows,
                  always=PROGRAM | PWM)

# --- What shows of lanes ----------------------------------------------------------------------------------------------

LOOK = Recipe("look", tuple(f"servotwin.models.engine.sights:{name}" for name in ("side_by_side", "one_by_one")))
"""Lanes of all forms: to look leaves out little where terms are absent."""
ENDING = Recipe("ending", ("servotwin.models.engine.ending:look_at_lanes",), vector=True, knows=~_DIGITAL)
_PARTS = {PLAIN_RUNS: ((PLAIN_RUNS, ()), _CALMLY), PLAIN_DIGITAL: ((PLAIN_DIGITAL, ()), _GLIDING, _TICKING),
          ALL_DIGITAL: ((ALL_DIGITAL, ()), _GLIDING)}


def parts_of(recipe: Recipe) -> tuple[tuple[Recipe, tuple[str, ...]], ...]:
    """Return the kernels by which lanes of a form may go, as `compile.unread` is asked of them.

    Those that say by themselves whether they do follow all numbers.
    """
    return _PARTS.get(recipe, ((recipe, ()),))


def side_by_side(form: int, dtype: str, creeps: bool, banded: bool) -> Recipe:
    """Return the kernels of lanes that go side by side in a form; whether some creep, or stride in bands."""
    if form == tiles.BANDS:
        return _BY_BANDS[creeps]
    if form == tiles.STRIDES:
        return _BY_STRIDES[banded]
    return _BY_COILS if form == tiles.COILS else _BY_GAPS if form == tiles.GAPS else _BY_ARCS[dtype]
