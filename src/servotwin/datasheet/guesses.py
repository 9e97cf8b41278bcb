"""Ranges of what rests on guesses: the same figure of the servo with its guesses at the ends of their ranges.

A guess is a parameter that is assumed within a range; what a person set is none. The servo is computed again with all
that makes it give way more at the softer end, with all of it at the stiffer end, and with the lightest and the heaviest
rotor; a figure's range goes from the least to the greatest of these and its own value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

from servotwin.datasheet.conditions import changed

if TYPE_CHECKING:
    from servotwin.models import Model

# Which end of its range lets a servo give way more, or creep up less
_SOFTER = {
    "electronics.stretcher_gain": "lower", "electronics.bridge_gain": "lower",
    "electronics.minimum_drive_time": "lower", "electronics.deadband": "upper",
    "electronics.voltage_deadband": "upper", "firmware.proportional_gain": "lower",
    "firmware.deadband_angle": "upper", "firmware.minimum_duty": "lower"}
_OTHER_END = {"lower": "upper", "upper": "lower"}
_ROTOR = "motor.rotor_inertia"


class Span(NamedTuple):
    """From the least to the greatest that guesses make of a figure; inf where one of them makes it never.

    Parameters
    ----------
    lower, upper : float
    """

    lower: float
    upper: float


def guesses(model: Model, *, rotor: bool = False) -> tuple[str, ...]:
    """Return the dotted names of the guesses behind what a servo does when it stands; with its rotor, when it moves.

    Examples
    --------
    >>> import servotwin as st
    >>> guesses(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    ('electronics.stretcher_gain', 'electronics.minimum_drive_time')
    """
    read = {*model.requires, *model.optional}
    return tuple(name for name in (*_SOFTER, *((_ROTOR,) if rotor else ())) if name in read and _ends(model, name))


def variants(model: Model, *, rotor: bool = False) -> tuple[Model, ...]:
    """Return the servo at the ends of its guesses: the softer and the stiffer one, and those of its rotor.

    Parameters
    ----------
    model : Model
    rotor : bool
        Whether the rotor matters too, as in motion.
    """
    found = guesses(model, rotor=rotor)
    standing = [name for name in found if name != _ROTOR]
    changes = [{name: _ends(model, name)[_SOFTER[name] if soft else _OTHER_END[_SOFTER[name]]] for name in standing}
               for soft in (True, False)] if standing else []
    if _ROTOR in found:
        changes += [{_ROTOR: end} for end in _ends(model, _ROTOR).values()]
    return tuple(changed(model, dict(change)) for change in changes)


def spans(value: Mapping[str, float], others: Iterable[Mapping[str, float]]) -> dict[str, Span]:
    """Return the range of each figure that is a number and not the same for all.

    Parameters
    ----------
    value : mapping of str to float
        Of the servo as it is.
    others : iterable of mapping
        Of its variants; nan where one of them never gets there.

    Examples
    --------
    >>> spans({"a": 2.0, "b": 1.0}, [{"a": 1.0, "b": 1.0}, {"a": math.nan, "b": 1.0}])
    {'a': Span(lower=1.0, upper=inf)}
    """
    rest, found = list(others), {}
    for name, own in value.items():
        seen = [own, *(math.inf if math.isnan(other[name]) else other[name] for other in rest)]
        if not math.isnan(own) and min(seen) < max(seen):
            found[name] = Span(min(seen), max(seen))
    return found


def spanned(model: Model, figures: Callable[[Model], Mapping[str, float]], *, rotor: bool = False) -> dict[str, Span]:
    """Return the ranges of the figures that a function computes of a model."""
    return spans(figures(model), map(figures, variants(model, rotor=rotor)))


def _ends(model: Model, name: str) -> dict[str, float]:
    """Return the ends of the range of a guess; empty where it is none."""
    if model.servo.get(name) is None:
        return {}
    known = model.servo.source(name)
    if known.origin != "assumed" or known.was_set or known.lower is None or known.upper is None \
            or not known.lower < known.upper:
        return {}
    return {"lower": known.lower, "upper": known.upper}
