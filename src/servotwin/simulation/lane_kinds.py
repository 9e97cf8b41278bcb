"""Which lanes run in which form: the fastest that can follow what their terms do, else the general one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache, cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import tiles
from servotwin.models.engine.demands import needed
from servotwin.models.engine.motion import may_depend
from servotwin.models.engine.records import numbers_in
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.dependence import FADING, PLAY, PWM, RECORDED, SLACK, SPRING, STEEP_W, TABLE
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.rooms import NOTHING, ROOMS
from servotwin.physics.pieces import Piece
from servotwin.simulation import lane_recipes as recipes
from servotwin.simulation.compile import Recipe, is_plain
from servotwin.simulation.compile.unread import in_general, unread
from servotwin.simulation.lane_groups import by_groups
from servotwin.simulation.lanes import Packed, swept

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
            found = _either(found, self.have(path))
        return found

    def fit(self, recipe: Recipe) -> Any:
        """Tell for which lanes kernels are made: for those whose numbers they know, and all of whose terms."""
        suited = self.suit(recipe.knows)
        return _without(suited, self.have_any(_unknown(recipe))) if np.any(suited) else suited  # to look takes a second

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
def _unknown(recipe: Recipe) -> tuple[str, ...]:
    """Return the numbers that kernels do not know, nor those by which they may go."""
    return tuple(dict.fromkeys(name for part in recipes.parts_of(recipe) for name in unread(*part)))


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
        return recipes.side_by_side(self.form, self.dtype, self.creeps, self.banded)

    @property
    def general(self) -> Recipe:
        """The kernels of those that cannot go on side by side."""
        plain = self.form in (tiles.ONE_FORMULA, tiles.ARCS) and not self.slack
        return recipes.PLAIN_RUNS if plain else recipes.ALL_RUNS


class OneByOne(NamedTuple):
    """Lanes that run one by one, by a form that leaves out what they lack; whether some may go on calmly."""

    which: Indices
    recipe: Recipe
    calm: bool = False


def kinds_of(packed: Packed, dtype: str) -> list[SideBySide | OneByOne]:
    """Return how lanes run; `dtype` is that of those that may be of either."""
    own, recorded = packed.lanes, packed.torque.count > 0
    return kinds_with(own.numbers, own.chips, packed.size, dtype, swept(own), recorded, packed.curve.size > 0,
                      own.firmware or NO_FIRMWARE)


def kinds_with(numbers: Numbers, chip: Chip, lanes: int, dtype: str, sweeps: Mask, recorded: Mask,
               curved: bool, firmware: Firmware = NO_FIRMWARE) -> list[SideBySide | OneByOne]:
    """Return how lanes run, whose numbers are numbers or arrays (lanes,).

    `sweeps` is whose command has a chirp, `recorded` whose load is recorded over time, `curved` whether the
    potentiometers have a table.
    """
    inputs = recorded * RECORDED if recorded.any() else 0
    terms = Terms(numbers, chip, firmware, sweeps.any() and sweeps, inputs | TABLE * curved)
    if _any(terms.ask(SPRING | PWM)):
        return _alone(terms, lanes)
    found: list[SideBySide | OneByOne] = []
    left: Any = not is_plain()
    side = _stays(terms) if dtype == "float32" else True
    for form, knows, made_for in recipes.SIDES:
        own_type = dtype if form in (tiles.ONE_FORMULA, tiles.ARCS) else "float64"
        which = _and(terms.suit(knows), not made_for or terms.ask(made_for), side, left)
        if _any(which):
            which = _and(which, terms.fit(recipes.side_by_side(form, own_type, True, True)))
            left = _without(left, which)
            found.append(_together(terms, form, own_type, _indices(which, lanes)))
    for wanted, calm in ((terms.suit(recipes.CALM), True), (True, False)):
        which = _and(left, wanted)
        if _any(which):
            which = _and(which, terms.fit(recipes.PLAIN_RUNS))
            left = _without(left, which)
            found.append(OneByOne(_indices(which, lanes), recipes.PLAIN_RUNS, calm))
    left = True if is_plain() else left
    return [kind for kind in (*found, *_at_last(terms, left, recipes.ALL_RUNS, lanes)) if len(kind.which)]


def _alone(terms: Terms, lanes: int) -> list[SideBySide | OneByOne]:
    """Return how lanes run of which some have a spring between two bodies, or a program."""
    digital, sprung = _any(terms.ask(PWM)), terms.ask(SPRING)
    found, left = [*_at_last(terms, sprung, recipes.ALL_RUNS, lanes)], _not(sprung)
    for recipe in (recipes.BY_TICKS, recipes.BY_LEGS) if digital and not is_plain() else ():
        if _any(left):
            which = _and(left, terms.fit(recipe))
            left = _without(left, which)
            found.append(OneByOne(_indices(which, lanes), recipe))
    found += _at_last(terms, left, recipes.ALL_DIGITAL if digital else recipes.ALL_RUNS, lanes)
    return [kind for kind in found if len(kind.which)]


def _at_last(terms: Terms, left: Any, recipe: Recipe, lanes: int) -> Iterator[OneByOne]:
    """Return how those run that no faster form takes: none that its kernels do not know either, as terms are now."""
    if is_plain():  # a fast form has no worth, nor to ask for it
        yield OneByOne(_indices(left, lanes), recipe)
    elif _any(left):
        which = _and(left, terms.fit(recipe))
        yield OneByOne(_indices(which, lanes), recipe)
        yield OneByOne(_indices(_without(left, which), lanes), in_general(recipe))


def _stays(terms: Terms) -> Any:
    """Tell in which lanes what is not zero stays so in float32."""
    stays: Any = True
    for x in (*numbers_in(terms.numbers), *numbers_in(terms.chip)):
        fits = (x == 0.0) | (abs(x) > _SMALLEST)
        stays = stays if fits is True else stays & fits
    return stays


def _together(terms: Terms, form: int, dtype: str, which: Indices) -> SideBySide:
    """Return how some lanes run side by side, by what some of them have."""
    asked = terms.demands[which] if np.ndim(terms.demands) else terms.demands

    def some(flags: int) -> bool:
        return _any((asked & flags) != 0)

    return SideBySide(which, form, some(SLACK), dtype, form == tiles.BANDS and some(FADING),
                      form == tiles.STRIDES and some(recipes.BANDED))


def goes_together(numbers: Numbers, pulsed: bool) -> bool:
    """Tell whether all lanes take about as long, for none has a term that would let it run on its own."""
    asked = Terms(numbers, NO_CHIP, NO_FIRMWARE).ask(STEEP_W | PLAY | recipes.STRIDING)
    return pulsed and not _any(asked)


def _without(some: Any, *others: Any) -> Any:
    """Return `some` but for those that one of the others holds for."""
    for other in others:
        some = some if other is False else _and(some, _not(other))
    return some


def _not(some: Any) -> Any:
    return np.logical_not(some) if np.ndim(some) else not some


def _and(*parts: Any) -> Any:
    """Return those for which everything holds."""
    found: Any = True
    for part in parts:
        found = part if found is True else found if part is True else found & part
    return found


def _either(a: Any, b: Any) -> Any:
    """Return a | b, at once where one of them holds for none."""
    return b if a is False else a if b is False else a | b


def _any(some: Any) -> bool:
    """Tell whether something holds for any lane."""
    return bool(some.any() if np.ndim(some) else some)


def _indices(some: Any, lanes: int) -> Indices:
    """Return the lanes that something holds for."""
    return np.flatnonzero(some) if np.ndim(some) else np.arange(lanes if some else 0)
