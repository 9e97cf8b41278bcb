"""The words of `servotwin fit` and `servotwin validate`: names, bounds, priors, what is held out and left out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from servotwin.errors import InputError, ServotwinError, UnknownNameError
from servotwin.identification.fitting.checks import MENDED
from servotwin.identification.fitting.free import Space, nominal
from servotwin.identification.fitting.stopping import Within
from servotwin.identification.report.pictures import dimension_of_free
from servotwin.logs.mend_names import MENDS
from servotwin.studies.kinds import Distribution, Normal, Offset, Relative, Uniform
from servotwin.studies.words import distribution_of
from servotwin.units.quantities import number_and_unit, quantity

if TYPE_CHECKING:
    from servotwin.identification import Log
    from servotwin.models import Model
    from servotwin.parameters import Servo

Usual = TypeVar("Usual")

MODEL_NAMES = ("pulse", "pulse-inductive", "bounded", "digital")


def names(words: Sequence[str] | None) -> tuple[str, ...] | None:
    """Return names of an option that is repeated or has commas; None where it was not given.

    Examples
    --------
    >>> names(["a,b", "c"]), names([])
    (('a', 'b', 'c'), None)
    """
    if not words:
        return None
    return tuple(part.strip() for word in words for part in word.split(",") if part.strip())


def kinds(words: Sequence[str] | None) -> tuple[str, ...]:
    """Return the kinds of findings among the words of --mend, which may be joined; those of a reader are others.

    Examples
    --------
    >>> kinds(["wrap,not-followed", "torn"]), kinds(None)
    (('wrap', 'not followed'), ())
    """
    return tuple(name.replace("-", " ") for name in names(words) or () if name not in MENDS)


def reading_mends(words: Sequence[str] | None) -> tuple[str, ...]:
    """Return what a reader mends, among the words of --mend.

    Raises
    ------
    UnknownNameError
        If a word is neither that nor a kind of finding.

    Examples
    --------
    >>> reading_mends(["wrap,not-followed", "torn"])
    ('torn',)
    """
    findings = [name.replace(" ", "-") for name in MENDED]
    for name in names(words) or ():
        if name not in MENDS and name.replace(" ", "-") not in findings:
            raise UnknownNameError("kind of --mend", name, (*findings, *MENDS))
    return tuple(name for name in names(words) or () if name in MENDS)


def some_or_none(option: str, words: Sequence[str] | None, usual: Usual) -> tuple[str, ...] | Usual:
    """Return names, no name at all for the word "none", and the usual ones where the option was not given.

    Examples
    --------
    >>> some_or_none("--nuisance", ["none"], ("delay",)), some_or_none("--nuisance", None, ("delay",))
    ((), ('delay',))
    """
    found = names(words)
    if found is None:
        return usual
    if "none" in found and len(found) > 1:
        raise InputError(option, got=", ".join(found), allowed="names, or none alone")
    return () if "none" in found else found


def share(option: str, text: str) -> float:
    """Return a number between 0 and 1, or a percentage.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> share("--level", "95%"), share("--level", "0.9")
    (0.95, 0.9)
    """
    found = quantity(option, text, "number", bare=True) if _is_number(text) else math.nan
    if not 0.0 <= found < 1.0:
        raise InputError(option, got=text, allowed="a share from 0 to below 1, such as 0.25 or 25%")
    return found


def duration(option: str, text: str | None) -> Within:
    """Return the time that a fit may take, which begins now.

    Examples
    --------
    >>> duration("--within", "5 min").over, duration("--within", None).over
    (False, False)
    """
    return Within(None if text is None else quantity(option, text, "time", bare=True, positive=True))


def held_out(text: str | None) -> float | tuple[str, ...] | None:
    """Return what is held out: a share, or names of logs.

    Examples
    --------
    >>> held_out("25%"), held_out("step-1, step-2"), held_out(None)
    (0.25, ('step-1', 'step-2'), None)
    """
    if text is None:
        return None
    return share("--holdout", text) if _is_number(text) else names([text]) or ()


def _is_number(text: str) -> bool:
    found = number_and_unit(text)
    return found is not None and found[1] in ("", "%")


def bounds_of(words: Sequence[str], free: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return bounds (SI) by name, from words such as ``motor.armature_resistance=2ohm..5ohm``.

    Raises
    ------
    InputError
        If a word is none, a name is not searched, or the ends are not in order.

    Examples
    --------
    >>> bounds_of(["electronics.deadband=2..8us"], ["electronics.deadband"])
    {'electronics.deadband': (2e-06, 8e-06)}
    """
    found = {}
    for name, text in _assigned("--bounds", words, free).items():
        form = "LOWEST..HIGHEST, with units such as 2ohm..5ohm, or in SI"
        if ".." not in text:
            raise InputError(f"--bounds {name}", got=text, allowed=form)
        try:
            made = distribution_of(f"uniform:{text}", dimension_of_free(name))
        except ServotwinError as error:
            raise InputError(f"--bounds {name}", got=text, allowed=_allowed(error, form)) from None
        if not isinstance(made, Uniform):
            raise InputError(f"--bounds {name}", got=text, allowed=form)
        found[name] = (made.lower, made.upper)
    return found


def priors_of(words: Sequence[str], free: Sequence[str], model: Model, *, of_servo: bool,
              ) -> dict[str, tuple[float, float]] | None:
    """Return means and standard deviations (SI) by name: what the servo's file states, then what the words say.

    Parameters
    ----------
    words : sequence of str
        Such as ``motor.armature_resistance=3ohm±0.3ohm``, or ``=10%`` about the servo's own value.
    free : sequence of str
    model : Model
    of_servo : bool
        Whether the spreads of the servo's file count.

    Raises
    ------
    InputError
        If a word is none, or a name is not searched.
    """
    stated = {p.name: p.prior for p in Space(model, free, priors="servo").parameters} if of_servo else {}
    found = {name: prior for name, prior in stated.items() if prior is not None}
    for name, text in _assigned("--prior", words, free).items():
        found[name] = _prior(name, text, model.servo)
    return found or None


def _prior(name: str, text: str, servo: Servo) -> tuple[float, float]:
    form = "VALUE±STANDARD_DEVIATION, with units such as 3ohm±0.3ohm or 3ohm±10%, or ±10% about the servo's value"
    try:
        made = distribution_of(f"normal:{text}", dimension_of_free(name))
    except ServotwinError as error:
        raise InputError(f"--prior {name}", got=text, allowed=_allowed(error, form)) from None
    value = nominal(servo, name)
    if isinstance(made, Relative | Offset) and value is None:
        raise InputError(f"--prior {name}", got=text, allowed="a value too: the servo has none")
    mean, std = _moments(made, value or 0.0)
    if not std > 0.0:
        raise InputError(f"--prior {name}", got=text, allowed=form)
    return mean, std


def _moments(law: Distribution, value: float) -> tuple[float, float]:
    """Return mean and standard deviation of a normal law, which may be one about a value."""
    if isinstance(law, Relative) and isinstance(law.factor, Normal):
        return value * law.factor.mean, abs(value) * law.factor.std
    if isinstance(law, Offset) and isinstance(law.added, Normal):
        return value + law.added.mean, law.added.std
    return (law.mean, law.std) if isinstance(law, Normal) else (math.nan, math.nan)


def _assigned(option: str, words: Sequence[str], free: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise InputError(option, got=word, allowed="NAME=..., such as motor.armature_resistance=2ohm..5ohm"
                             if option == "--bounds" else "NAME=..., such as motor.armature_resistance=3ohm±10%")
        if name in found:
            raise InputError(f"{option} {name}", got=f"{found[name]} and {text}", allowed="one of both")
        if name not in free:
            raise InputError(f"{option} {name}", got="a name that is not searched", allowed=", ".join(free))
        found[name] = text
    return found


def _allowed(error: ServotwinError, form: str) -> str:
    """Return the units that are allowed where one was wrong, else the form."""
    known = getattr(error, "allowed", None)
    return f"one of the units {known}" if type(error).__name__ == "UnitError" and known else form


def check_free(free: Sequence[str], model: Model) -> None:
    """Raise if a searched name is unknown, so that nothing else is said about it first.

    Raises
    ------
    InputError
    """
    Space(model, tuple(free), priors=None)


def left_out(words: Sequence[str]) -> list[tuple[str | None, float, float]]:
    """Return windows of time [s], each of one log or, where it names none, of all.

    Raises
    ------
    InputError
        If a word is no window.

    Examples
    --------
    >>> left_out(["3..4.5", "run-2=100ms..200ms"])
    [(None, 3.0, 4.5), ('run-2', 0.1, 0.2)]
    """
    found = []
    for word in words:
        name, equals, text = word.rpartition("=")
        ends = text.split("..")
        if len(ends) != 2 or (equals and not name):
            raise InputError("--leave-out", got=word, allowed="START..STOP or LOG=START..STOP, such as 3s..4.5s")
        start, stop = (quantity("--leave-out", end, "time", bare=True) for end in ends)
        if not start < stop:
            raise InputError("--leave-out", got=word, allowed="START..STOP, the earlier one first")
        found.append((name.strip() or None, start, stop))
    return found


def without(logs: Sequence[Log], windows: Sequence[tuple[str | None, float, float]]) -> list[Log]:
    """Return logs with windows left out.

    Raises
    ------
    InputError
        If a window names a log that there is not, or nothing is left of one.
    """
    known = [log.name for log in logs]
    for name, *_ in windows:
        if name is not None and name not in known:
            raise UnknownNameError("log of --leave-out", name, known)
    return [replace(log, left_out=(*log.left_out, *((start, stop) for name, start, stop in windows
                                                    if name in (None, log.name)))) if windows else log
            for log in logs]


def limits_of(words: Sequence[str], angle: bool) -> Mapping[str | None, float]:
    """Return the largest error that is allowed (SI), by kind of motion; None stands for every kind.

    Examples
    --------
    >>> limits_of(["3 deg", "prbs=0.1 rad"], True)["prbs"]
    0.1
    """
    found: dict[str | None, float] = {}
    for word in words:
        name, _, text = word.rpartition("=")
        value = quantity("--max-error", text, "angle" if angle else "voltage")
        if not value > 0.0:
            raise InputError("--max-error", got=word, allowed="a positive number with a unit, such as 3deg")
        found[name.strip() or None] = value
    return found
