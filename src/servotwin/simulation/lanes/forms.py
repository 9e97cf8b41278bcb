"""Which lanes run in which form: the fastest that can follow what their terms do, else the general one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache, cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.demands import needed
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.state.records import numbers_in
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.dependence import PLAY, PWM, RECORDED, SLACK, SPRING, STEEP_W, TABLE
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.rooms import NOTHING, ROOMS
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile import Recipe, is_plain
from servotwin.simulation.compile.unread import in_general, unread
from servotwin.simulation.lanes import form_recipes as recipes
from servotwin.simulation.lanes.divided import by_groups
from servotwin.simulation.lanes.packed import Packed, swept

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_SMALLEST = 2.0**-150  # what is not more is zero in float32


class Terms:
    """What lanes ask of whoever follows them, and what they have; each question is asked once."""

    def __init__(self, numbers: Numbers, chip: Chip, firmware: Firmware, swept: Any = False, inputs: Any = 0) -> None:
        self.numbers, self.chip = numbers, chip
        self._rooms: dict[str, Any] = numbers._asdict() | dict(zip(
            (name for name in ROOMS if name not in Numbers._fields), (chip, firmware), strict=True))
        self._known: dict[str, Any] = {}
        self._firmware, self._inputs = firmware, inputs
        self._wave: Any = Piece(sweep=swept if np.ndim(swept) else float(swept))

    @cached_property
    def demands(self) -> Any:
        """What all lanes, or each, ask for: flags of `terms.dependence`."""
        return (_said(may_depend, self.numbers, self._wave) | _said(needed, self.numbers, self.chip, self._firmware)
                | self._inputs)

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
        """Tell for which lanes kernels are made: for those whose numbers they know, and all of whose terms."""
        return self.suit(recipe.knows) & self.known_to(recipes.parts_of(recipe))

    def known_to(self, parts: recipes.Parts) -> Any:
        """Tell in which lanes kernels, or what they call, know all numbers."""
        return np.logical_not(self.have_any(_unknown(parts)))

    def suit(self, knows: int) -> Any:
        """Tell for which lanes kernels would be made that follow this, if they knew all numbers."""
        return (self.demands & ~knows) == 0


def _said(law: Callable[..., int], *given: Any) -> Any:
    """Return what a law says of one servo, or of each whose numbers are columns."""
    try:  # most columns do not matter to it
        return law(*given)
    except ValueError:  # an array is neither true nor false
        lanes = max(x.size for each in given for x in numbers_in(each) if isinstance(x, np.ndarray))
        return by_groups(law, lanes, *given)


@cache
def _unknown(parts: recipes.Parts) -> tuple[str, ...]:
    """Return the numbers that kernels do not know, nor those by which they may go."""
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
        return recipes.side_by_side(self.form, self.dtype)


class OneByOne(NamedTuple):
    """Lanes that run one by one, by a form that leaves out what they lack.

    Some may go on calmly, or all of them go quickly.
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
    for form, (knows, made_for) in () if is_plain() else recipes.SIDES.items():
        own_type = dtype if form == tiles.ONE_FORMULA else "float64"
        asked: Any = terms.ask(made_for) if made_for else True
        which = _take(terms, left, recipes.side_by_side(form, own_type), terms.suit(knows) & asked & side)
        if len(which):
            yield _together(terms, form, own_type, which)
    if not is_plain() and np.any(left & terms.suit(recipes.CALM.knows)):
        yield OneByOne(_take(terms, left, recipes.ALL_RUNS, terms.fit(recipes.CALM)), recipes.ALL_RUNS, True)
    yield from _at_last(terms, left)


def _alone(terms: Terms, left: Mask) -> Iterator[OneByOne]:
    """Return how lanes run of which some have a spring between two bodies, or a program."""
    digital, sprung = np.any(terms.ask(PWM)), left & terms.ask(SPRING)
    left &= ~sprung
    yield from _at_last(terms, sprung)
    if digital and not is_plain():
        yield OneByOne(_take(terms, left, recipes.BY_TICKS), recipes.BY_TICKS, quick=True)
        yield OneByOne(_take(terms, left, recipes.ALL_RUNS, terms.suit(recipes.LEGS)), recipes.ALL_RUNS, quick=True)
    yield from _at_last(terms, left)


def _at_last(terms: Terms, left: Mask) -> Iterator[OneByOne]:
    """Return how those run that no faster form takes: none that its kernels do not know either, as terms are now."""
    if is_plain():  # a fast form has no worth there, nor to ask for it
        yield OneByOne(np.flatnonzero(left), recipes.ALL_RUNS)
        return
    known = terms.known_to(recipes.parts_of(recipes.ALL_RUNS)) if np.any(left & terms.ask(PWM)) else True
    yield OneByOne(_take(terms, left, recipes.ALL_RUNS, known), recipes.ALL_RUNS)
    yield OneByOne(np.flatnonzero(left), in_general(recipes.ALL_RUNS))


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
    asked = Terms(numbers, NO_CHIP, NO_FIRMWARE).ask(STEEP_W | PLAY | recipes.STRIDING)
    return pulsed and not np.any(asked)
