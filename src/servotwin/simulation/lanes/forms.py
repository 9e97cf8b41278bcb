"""Which lanes run in which form: the fastest that can follow what their terms do, else the general one.

Nothing here names a term: what kernels leave out, and which numbers they cover, follows from what terms say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache, cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.batch import digital_batch, tiles
from servotwin.models.engine.demands import needed
from servotwin.models.engine.legs.coupled_units import Coupling, Unit
from servotwin.models.engine.log import COUNTS, WITH_ROWS
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.state.records import numbers_in, record_of
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
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.numbers import ACTS, APART, NOTHING, ROOMS, Numbers
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile import Recipe, is_plain
from servotwin.simulation.compile.text.unread import FROM_TICK_TO_TICK, IN_GENERAL, in_general, unread
from servotwin.simulation.lanes.packed import Packed, by_groups, swept

# --- The forms in which lanes run compiled ----------------------------------------------------------------------------

Parts = tuple[tuple[Recipe, tuple[str, ...]], ...]  # kernels, and entries of theirs
_SIDE = tuple(f"servotwin.models.engine.batch.side_by_side:{name}" for name in ("start", "go_on", "advance", "refit"))
_ENTRIES = tuple(f"servotwin.models.engine.run.runs:{name}" for name in ("start", "ready", "to_first_ticks", "go_on",
                                                                    "note_failures"))
_DIGITAL = PROGRAM | BEYOND | AT_COMMANDS | PWM | ONE_WAY
_EVERYWHERE = STRAIGHT | DRY | AT_STOPS | SHOWN


WORDS = {
    ON_I: "inductance", CURVED_Q: "a pendulum", ON_HEAT: "heat", PLAY: "play of the gear",
    SPRING: "a spring between two bodies",
    FADING: "friction that fades", BY_SHARE: "friction by torque", REGULATED: "a limit of current",
    SLACK: "play of the potentiometer", STEPS: "its steps", TABLE: "its table", DROPS: "drops and open bridges",
    PULSES: "pulses", PROGRAM: "a program", STEEP_W: "smoothed friction"}
"""Demands in sentences."""


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
"""Allowed demands of servos that move by plain laws."""
_LEFT_TO_EVENTS = AT_STOPS | SHOWN | PULSES | STEPS
CALM = Recipe("calm", ("servotwin.models.engine.batch.event_free:go",), knows=PLAIN & ~(
    _LEFT_TO_EVENTS | RECORDED | TABLE), leaves=_LEFT_TO_EVENTS)
"""Ticks of lanes in which nothing happens, three times faster; the others are for `RUNS`."""
_TICKS = _PLAIN & ~ON_Q | _DIGITAL
LEGS = _TICKS | PLAY | TWO_BODIES | BY_SHARE
"""Parts that legs follow exactly."""
_ALWAYS, _LEFT_TO_RUNS = PROGRAM | PWM, AT_STOPS | SHOWN | AT_COMMANDS
_BY_TICKS_ALONE = (
    # A spring, a pendulum and friction that fades count as if their torques stayed within a tick: where that is asked
    Recipe("legs", ("servotwin.models.engine.legs.tick_legs:go_stiff",), vector=True,
           knows=(LEGS | ON_Q | CURVED_Q | FADING) & ~_LEFT_TO_RUNS, leaves=_LEFT_TO_RUNS, always=_ALWAYS),
    Recipe("series", ("servotwin.models.engine.legs.coupled_ticks:alone",),  # warm windings, a supply with a limit
           knows=(LEGS & ~TABLE | ON_HEAT | REGULATED) & ~_LEFT_TO_RUNS, leaves=_LEFT_TO_RUNS, always=_ALWAYS))
"""Digital servos from tick to tick."""
RUNS = Recipe("runs", _ENTRIES, knows=~_DIGITAL, never=(*WITH_ROWS, *FROM_TICK_TO_TICK))
"""All lanes without a program, from step to step."""
DIGITAL = Recipe("digital", _ENTRIES, always=_ALWAYS, never=WITH_ROWS, parts=_BY_TICKS_ALONE)
"""All that have one: from tick to tick where that leads on, else from step to step."""
BY_TICKS = Recipe("by_ticks", ("servotwin.models.engine.batch.digital_batch:go_on",), vector=True,
                  knows=_TICKS & ~DROPS, always=_ALWAYS)
"""Digital servos from tick to tick, side by side; what is left of a call is for `DIGITAL`. Two to three times faster
for four servos of the catalog."""
# Not compiled for its own sake: what these call says which numbers are known where a program goes in one loop
_LEFT_BY_TICKS = _LEFT_TO_RUNS | BEYOND | ONE_WAY
_BY_TICKS = (replace(BY_TICKS, name="ticks_by_loops", knows=BY_TICKS.knows & ~_LEFT_BY_TICKS, leaves=_LEFT_BY_TICKS),
             tuple(f"servotwin.models.engine.batch.digital_batch:{name}" for name in (
                 "enter", "watch", "decide", "move", "move_on", "follow")))


# --- Lanes between calls ----------------------------------------------------------------------------------------------
LOOK = Recipe("look", tuple(f"servotwin.models.engine.batch.observe_batch:{name}" for name in ("side_by_side",
                                                                                               "one_by_one")))
"""Lanes of all forms: to look leaves out little where terms are absent."""
TICKS = Recipe("ticks", (
    *(f"servotwin.models.engine.cosim:{name}" for name in ("accept", "change", "follow")),
    *(f"servotwin.models.engine.cosim:{name}" for name in (
        "gather_lost", "to_records", "to_tiles", "forget_motions", "impose_on_tiles", "impose_on_records", "show_tiles",
        "show_records", "read_clocks", "take_status", "note_lost_buses", "break_up"))))
"""Lanes of all forms between two calls: what is imposed on them, and the way from tiles to records and back."""
ENDING = Recipe("ending", ("servotwin.models.engine.cosim:look_at_lanes",), vector=True, knows=~_DIGITAL)
_IN_DIGITAL = tuple((replace(part, entries=_ENTRIES, never=WITH_ROWS), part.entries) for part in DIGITAL.parts)
_PARTS = {BY_TICKS: (_BY_TICKS, *_IN_DIGITAL), DIGITAL: _IN_DIGITAL, RUNS: ()}


def last_of(recipe: Recipe) -> Recipe:
    """Return the kernels that finish every call of lanes of a form."""
    return DIGITAL if recipe == BY_TICKS else recipe


def steps_of(recipe: Recipe, ended: Any, nearly: bool = False) -> Iterator[tuple[Recipe, str, tuple[Any, ...]]]:
    """Return the kernels by which lanes of a form advance one after the other, each with its entry.

    All of them have the arguments of `runs.go_on` up to the status, and these. `nearly` is as readings have it.
    """
    counts, last = np.zeros(COUNTS, np.int64), last_of(recipe)
    if recipe != last:
        yield last, "to_first_ticks", (counts,)
        yield recipe, "go_on", (digital_batch.tile_room(),)
    yield last, "go_on", (nearly, ended, counts, np.zeros(2, record_of(Unit)), np.zeros(2, record_of(Coupling)))


def parts_of(recipe: Recipe) -> Parts:
    """Return the kernels by which lanes of a form may go, as `compile.unread` is asked of them.

    Those that say by themselves whether they do follow all numbers.
    """
    return _PARTS.get(recipe, ((recipe, ()),))


def side_by_side(form: int, dtype: str) -> Recipe:
    """Return the kernels of lanes that go side by side in a form."""
    return _BY_FORMULA[dtype] if form == tiles.ONE_FORMULA else _BY_FORM[form]


KERNELS = tuple(sorted((*(one.name for one in (RUNS, DIGITAL, BY_TICKS, *_BY_FORMULA.values(), *_BY_FORM.values())),
                        RUNS.name + IN_GENERAL)))
"""Names of all kernels in which lanes run."""


# --- Which lanes run in which form: the fastest that can follow what their terms do, else the general one -------------

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
_SMALLEST = 2.0**-150  # what is not more is zero in float32


class Terms:
    """Demands of lanes on their kernels, and their parts; each question is asked once."""

    def __init__(self, numbers: Numbers, chip: Chip, firmware: Firmware, swept: Any = False, inputs: Any = 0) -> None:
        self.numbers, self.chip = numbers, chip
        self._rooms: dict[str, Any] = numbers._asdict() | dict(zip(
            (name for name in ROOMS if name not in Numbers._fields), (chip, firmware), strict=True))
        self._known: dict[str, Any] = {}
        self._firmware, self._inputs = firmware, inputs
        self._wave: Any = Piece(sweep=swept if np.ndim(swept) else float(swept))

    @cached_property
    def demands(self) -> Any:
        """Demands of all lanes, or of each: flags of `terms.dependence`."""
        return (_said(may_depend, self.numbers, self._wave) | _said(needed, self.numbers, self.chip, self._firmware)
                | self._inputs)

    @cached_property
    def followed(self) -> int:
        """All that code has to follow which is right for each of the lanes: flags of `terms.dependence`."""
        asked = self.demands
        flags = _EVERYWHERE | int(np.bitwise_or.reduce(asked) if np.ndim(asked) else asked)
        if flags & PROGRAM:
            flags |= BEYOND | AT_COMMANDS | ONE_WAY
        for path, acts in ACTS.items():
            room = path.split(".")[0]
            if path not in APART and room in self._rooms and not acts & flags and np.any(self.have(path)):
                flags |= acts
        return flags

    def ask(self, flags: int) -> Any:
        """Tell which lanes ask for some of this."""
        return (self.demands & flags) != 0

    def have(self, path: str) -> Any:
        """Tell in which lanes a number of a term ("motor.L") is not what it is where the term is absent."""
        if path not in self._known:
            room, *fields = path.split(".")
            self._known[path] = reduce(getattr, fields, self._rooms[room]) != reduce(getattr, fields, NOTHING[room])
        return self._known[path]

    def have_any(self, paths: Iterable[str]) -> Any:
        """Tell which lanes have one of some numbers."""
        found: Any = False
        for path in paths:
            found = found | self.have(path)
        return found

    def fit(self, recipe: Recipe) -> Any:
        """Tell for which lanes kernels are made: for those whose numbers they cover, and all of whose terms."""
        return self.suit(recipe.knows) & self.known_to(parts_of(recipe))

    def known_to(self, parts: Parts) -> Any:
        """Tell in which lanes kernels, or what they call, cover all numbers."""
        return np.logical_not(self.have_any(_unknown(parts)))

    def suit(self, knows: int) -> Any:
        """Tell for which lanes kernels would be made that follow this, if they covered all numbers."""
        return (self.demands & ~knows) == 0


def _said(law: Callable[..., int], *given: Any) -> Any:
    """Return what a law says of one servo, or of each whose numbers are columns."""
    try:  # most columns do not matter to it
        return law(*given)
    except ValueError:  # an array is neither true nor false
        lanes = max(x.size for each in given for x in numbers_in(each) if isinstance(x, np.ndarray))
        return by_groups(law, lanes, *given)


@cache
def _unknown(parts: Parts) -> tuple[str, ...]:
    """Return the numbers that kernels do not cover, nor those by which they may go."""
    return tuple(dict.fromkeys(name for part in parts for name in unread(*part)))


class SideBySide(NamedTuple):
    """Lanes that run side by side in one form; whether some have a potentiometer with play."""

    which: Indices
    form: int
    slack: bool
    dtype: str

    @property
    def recipe(self) -> Recipe:
        """Their kernels."""
        return side_by_side(self.form, self.dtype)


class OneByOne(NamedTuple):
    """Lanes that run one by one, by a form that leaves out what they lack.

    Some may advance calmly, or all of them go quickly.
    """

    which: Indices
    recipe: Recipe
    calm: bool = False
    quick: bool = False


def kinds_of(packed: Packed, dtype: str, watched: bool = False) -> list[SideBySide | OneByOne]:
    """Return how lanes run; `dtype` is that of those that may be of either, all else as of `kinds_with`."""
    own, recorded = packed.lanes, packed.torque.count > 0
    return kinds_with(own.numbers, own.chips, packed.size, dtype, swept(own), recorded, packed.curve.size > 0,
                      own.firmware or NO_FIRMWARE, watched)


def kinds_with(numbers: Numbers, chip: Chip, lanes: int, dtype: str, sweeps: Mask, recorded: Mask,
               curved: bool, firmware: Firmware = NO_FIRMWARE,
               watched: bool = False) -> list[SideBySide | OneByOne]:
    """Return how lanes run, whose numbers are numbers or arrays (lanes,).

    `sweeps` is whose command has a chirp, `recorded` whose load is recorded over time, `curved` whether the
    potentiometers have a table. Supplies of lanes that are `watched` are followed from event to event.
    """
    inputs = recorded * RECORDED if recorded.any() else 0
    terms = Terms(numbers, chip, firmware, sweeps.any() and sweeps, inputs | TABLE * curved)
    left = np.ones(lanes, np.bool_)
    found: Iterator[SideBySide | OneByOne] = (
        _at_last(terms, left) if watched
        else _alone(terms, left) if np.any(terms.ask(SPRING | PWM)) else _of_analog(terms, left, dtype))
    return [kind for kind in found if len(kind.which)]


def _of_analog(terms: Terms, left: Mask, dtype: str) -> Iterator[SideBySide | OneByOne]:
    """Return how lanes run that are pulsed or follow a mean, of one body or with play; they are taken from `left`."""
    side = _stays(terms) if dtype == "float32" else True
    for form, (knows, made_for) in () if is_plain() else SIDES.items():
        own_type = dtype if form == tiles.ONE_FORMULA else "float64"
        asked: Any = terms.ask(made_for) if made_for else True
        which = _take(terms, left, side_by_side(form, own_type), terms.suit(knows) & asked & side)
        if len(which):
            yield _together(terms, form, own_type, which)
    if not is_plain() and np.any(left & terms.suit(CALM.knows)):
        yield OneByOne(_take(terms, left, RUNS, terms.fit(CALM)), RUNS, True)
    yield from _at_last(terms, left)


def _alone(terms: Terms, left: Mask) -> Iterator[OneByOne]:
    """Return how lanes run of which some have a spring between two bodies, or a program."""
    digital, sprung = np.any(terms.ask(PWM)), left & terms.ask(SPRING)
    left &= ~sprung
    yield from _at_last(terms, sprung)
    if digital and not is_plain():
        yield OneByOne(_take(terms, left, BY_TICKS), BY_TICKS, quick=True)
        yield OneByOne(_take(terms, left, DIGITAL, terms.suit(LEGS)), DIGITAL, quick=True)
    yield from _at_last(terms, left)


def _at_last(terms: Terms, left: Mask) -> Iterator[OneByOne]:
    """Return how those run that no faster form takes: none that its kernels do not cover either, as terms are now."""
    runs = DIGITAL if np.any(terms.ask(PROGRAM)) else RUNS
    if is_plain():  # a fast form has no worth there, nor to ask for it
        yield OneByOne(np.flatnonzero(left), runs)
        return
    yield OneByOne(_take(terms, left, runs), runs)
    yield OneByOne(np.flatnonzero(left), in_general(RUNS))


def _take(terms: Terms, left: Mask, recipe: Recipe, wanted: Any = True) -> Indices:
    """Return the lanes of those wanted for which kernels are made, which are not left then."""
    which = left & wanted
    if which.any():  # to look whether they fit takes a second
        which &= terms.fit(recipe)
        left &= ~which
    return np.flatnonzero(which)


def _stays(terms: Terms) -> Any:
    """Tell in which lanes what is not zero stays so in float32."""
    stays: Any = True
    for x in (*numbers_in(terms.numbers), *numbers_in(terms.chip)):
        stays = stays & ((x == 0.0) | (abs(x) > _SMALLEST))
    return stays


def _together(terms: Terms, form: int, dtype: str, which: Indices) -> SideBySide:
    """Return how some lanes run side by side, by what some of them have."""
    asked = terms.demands[which] if np.ndim(terms.demands) else terms.demands
    return SideBySide(which, form, bool(np.any((asked & SLACK) != 0)), dtype)


def goes_together(numbers: Numbers, pulsed: bool) -> bool:
    """Tell whether all lanes take about as long, for none has a term that would let it run on its own."""
    asked = Terms(numbers, NO_CHIP, NO_FIRMWARE).ask(STEEP_W | PLAY | STRIDING)
    return pulsed and not np.any(asked)
