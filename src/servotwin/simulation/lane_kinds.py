"""Which lanes run in which form: the fastest that can follow what their terms do, else the general one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import tiles
from servotwin.models.engine.motion import may_depend
from servotwin.models.engine.records import numbers_in
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.numbers import NEUTRAL, Numbers
from servotwin.physics.pieces import Piece
from servotwin.simulation import lane_recipes as recipes
from servotwin.simulation.compile import Recipe, is_plain
from servotwin.simulation.compile.unread import in_general, told, unread
from servotwin.simulation.lane_groups import by_groups

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_SMALLEST = 2.0**-150  # what is not more is zero in float32
_NOTHING: dict[str, Any] = {**NEUTRAL._asdict(), "chip": NO_CHIP, "firmware": NO_FIRMWARE}


class Terms:
    """What lanes have, each question asked once."""

    def __init__(self, numbers: Numbers, chip: Chip, firmware: Firmware, swept: Any) -> None:
        self.numbers, self.chip = numbers, chip
        self._rooms: dict[str, Any] = {**numbers._asdict(), "chip": chip, "firmware": firmware}
        self._known: dict[str, Any] = {"sweep": swept}

    @cached_property
    def _depends(self) -> Any:
        """On what the acceleration may depend, of all lanes or each."""
        swept = self._known["sweep"]
        wave: Any = Piece(sweep=swept if np.ndim(swept) else float(swept))
        try:  # most columns do not matter to it
            return may_depend(self.numbers, wave)
        except ValueError:  # an array is neither true nor false
            lanes = max(len(x) for x in (*numbers_in(self.numbers), swept) if isinstance(x, np.ndarray))
            return by_groups(may_depend, lanes, self.numbers, wave)

    def have(self, name: str) -> Any:
        """Tell which lanes have a term ("heat", told by its first number), or a number of one ("motor.L")."""
        if name not in self._known:
            room, *fields = name.split(".")
            own, nothing = self._rooms[room], _NOTHING[room]
            for field in fields or nothing._fields[:1]:
                own, nothing = getattr(own, field), getattr(nothing, field)
            self._known[name] = own != nothing
        return self._known[name]

    def have_any(self, names: Iterable[str]) -> Any:
        """Tell which lanes have one of some terms or numbers."""
        found: Any = False
        for name in names:
            found = _either(found, self.have(name))
        return found

    def fit(self, recipe: Recipe) -> Any:
        """Tell for which lanes kernels are made: for those with nothing that they leave out, do not know or follow."""
        suited = self.suit(recipe)
        return _without(suited, self.have_any(_unknown(recipe))) if np.any(suited) else suited  # to look takes a second

    def suit(self, recipe: Recipe) -> Any:
        """Tell for which lanes kernels would be made, if they knew all numbers of the terms that they have."""
        return _without((self._depends & ~recipe.knows) == 0, self.have_any(recipe.absent))


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
        if self.form == tiles.GAPS:
            return recipes.GAP_RUNS
        plain = self.form in (tiles.ONE_FORMULA, tiles.ARCS) and not self.slack
        return recipes.PLAIN_RUNS if plain else recipes.ALL_RUNS


class OneByOne(NamedTuple):
    """Lanes that run one by one, by a form that leaves out what they lack."""

    which: Indices
    recipe: Recipe


def kinds_of(numbers: Numbers, chip: Chip, lanes: int, pulsed: bool, dtype: str, swept: Mask, recorded: Mask,
             curved: bool, firmware: Firmware = NO_FIRMWARE) -> list[SideBySide | OneByOne]:
    """Return how lanes run, whose numbers are numbers or arrays (lanes,).

    `swept` is whose command has a chirp, `recorded` whose load is recorded over time, `curved` whether the
    potentiometers have a table.
    """
    terms = Terms(numbers, chip, firmware, swept.any() and swept)
    recording = recorded.any() and recorded
    if _any(terms.have("elastic")) or _any(numbers.bridge.pwm > 0.0):
        return _alone(terms, recording, lanes)
    found: list[SideBySide | OneByOne] = []
    left: Any = True
    if pulsed and not curved and not is_plain():
        side = _may_go_side_by_side(terms, recording, dtype)
        for form, wanted, of_bands in _forms(terms):
            own_type = dtype if form in (tiles.ONE_FORMULA, tiles.ARCS) else "float64"
            which = _and(side, wanted, left)
            if _any(which):
                which = _and(which, terms.fit(recipes.side_by_side(form, own_type, True, of_bands)))
                left = _without(left, which)
                found.append(_together(terms, form, own_type, _indices(which, lanes)))
    loose = pulsed and _without(terms.have("play"), recording)
    for recipe, wanted in ((recipes.PLAIN_RUNS, True), (recipes.PENDULUM_RUNS, True), (recipes.GAP_RUNS, loose)):
        which = _and(left, wanted, not is_plain())
        if _any(which):
            which = _and(which, terms.fit(recipe))
            left = _without(left, which)
            found.append(OneByOne(_indices(which, lanes), recipe))
    return [kind for kind in (*found, *_at_last(terms, left, recipes.ALL_RUNS, lanes)) if len(kind.which)]


def _alone(terms: Terms, recording: Any, lanes: int) -> list[SideBySide | OneByOne]:
    """Return how lanes run of which some have a spring between two bodies, or a program."""
    digital = _any(terms.numbers.bridge.pwm > 0.0)
    sprung, left = terms.have("elastic"), _not(terms.have("elastic"))
    found = [*_at_last(terms, sprung, recipes.ELASTIC_RUNS[digital], lanes)]
    which = _without(left, recording) if digital and not is_plain() else False
    if _any(which):
        which = _and(which, terms.fit(recipes.PLAIN_DIGITAL))
        left = _without(left, which)
        found.append(OneByOne(_indices(which, lanes), recipes.PLAIN_DIGITAL))
    found += _at_last(terms, left, recipes.ALL_DIGITAL if digital else recipes.ALL_RUNS, lanes)
    return [kind for kind in found if len(kind.which)]


def _at_last(terms: Terms, left: Any, recipe: Recipe, lanes: int) -> Iterator[OneByOne]:
    """Return how those run that no faster form takes: none that its kernels do not know either, as terms are now."""
    if is_plain():  # a fast form has no worth, nor to ask for it
        yield OneByOne(_indices(left, lanes), told(recipe))
    elif _any(left):
        which = _and(left, terms.fit(recipe))
        yield OneByOne(_indices(which, lanes), recipe)
        yield OneByOne(_indices(_without(left, which), lanes), in_general(recipe))


def _may_go_side_by_side(terms: Terms, recording: Any, dtype: str) -> Any:
    """Tell which pulse servos may go side by side, if there is a form for their terms."""
    numbers, bridge = terms.numbers, terms.numbers.bridge
    side = (_without(True, recording) & (numbers.sensor.step == 0.0) & (numbers.motor.K_b > 0.0)
            & (bridge.silence.coast == bridge.off.coast))
    if dtype == "float32":  # what is not zero has to stay so
        for x in (*numbers_in(numbers), *numbers_in(terms.chip)):
            fits = (x == 0.0) | (abs(x) > _SMALLEST)
            side = side if fits is True else side & fits
    return side


def _forms(terms: Terms) -> list[tuple[int, Any, bool]]:
    """Return the forms of going side by side, for which lanes each is if it knows their terms, and if in bands."""
    bridge = terms.numbers.bridge
    banded, striding = terms.have_any(recipes.BANDED), terms.have_any(recipes.STRIDING)
    braked = (bridge.off.D == 0.0) & (bridge.D_drive < terms.numbers.source.V)
    by_bands = _either(banded, terms.have("sensor.half_slack") & _not(braked))
    return [(tiles.ONE_FORMULA, _without(braked, by_bands), False),
            (tiles.ARCS, _without(True, braked, by_bands), False), (tiles.BANDS, by_bands, True),
            (tiles.STRIDES, _without(striding, banded), False), (tiles.STRIDES, _and(striding, banded), True),
            (tiles.COILS, terms.have("motor.L"), False), (tiles.GAPS, terms.have("play"), False)]


def _together(terms: Terms, form: int, dtype: str, which: Indices) -> SideBySide:
    """Return how some lanes run side by side, by what some of them have."""
    own = terms.numbers.friction

    def some(flag: Any) -> bool:
        return _any(flag[which] if np.ndim(flag) else flag)

    return SideBySide(which, form, some(terms.have("sensor.half_slack")), dtype,
                      form == tiles.BANDS and some(own.varies * own.w_s > 0.0),
                      form == tiles.STRIDES and some(terms.have_any(recipes.BANDED)))


def goes_together(numbers: Numbers, pulsed: bool) -> bool:
    """Tell whether all lanes take about as long, for none has a term that would let it run on its own."""
    terms = Terms(numbers, NO_CHIP, NO_FIRMWARE, False)
    return pulsed and not _any(terms.have_any(("friction.kappa", "play", *recipes.STRIDING)))


def looking(recipe: Recipe) -> Recipe:
    """Return how lanes are looked at that run one by one in this way."""
    digital = "firmware.T_c" in recipe.present
    look = (recipes.LOOK_ELASTIC[digital] if "elastic.k" in recipe.present else recipes.LOOK_DIGITAL if digital
            else recipes.LOOK_ONE_BY_ONE)
    return told(look) if recipe.absent == told(recipe).absent else look


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
