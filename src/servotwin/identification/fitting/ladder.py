"""The friction laws M1 to M6 one after the other on the same logs, and which of them the data pay for.

Each rung begins where a simpler one ended. More terms always fit the logs that are fitted at least as well; whether
they predict others better is what decides. A supply or a bridge that gives way bends speeds and torques as friction
does, so the law that was chosen is fitted once more with each; where one is chosen, so are the richer laws with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.fit import Fit
from servotwin.identification.fitting.free import nominal
from servotwin.identification.fitting.gains import gained
from servotwin.identification.fitting.holdout import LogError, pooled
from servotwin.identification.fitting.identify import identify
from servotwin.identification.fitting.stopping import Within
from servotwin.logs.log import Log
from servotwin.models.base import Model
from servotwin.parameters import Servo

_BASE = ("output_coulomb_torque", "motor.motor_viscous_friction")
_STRIBECK = ("friction.breakaway_ratio", "friction.stribeck_speed")
_DIRECTED = ("friction.load_friction_motor", "friction.load_friction_external")
_DIRECTED_STRIBECK = ("friction.load_friction_motor_stribeck", "friction.load_friction_external_stribeck")
_QUAD = ("friction.load_friction_motor_quad", "friction.load_friction_external_quad")

RUNGS: dict[str, tuple[str, ...]] = {
    "M1": _BASE,
    "M2": (*_BASE, *_STRIBECK),
    "M3": (*_BASE, "friction.load_friction"),
    "M4": (*_BASE, *_STRIBECK, "friction.load_friction", "friction.load_friction_stribeck"),
    "M5": (*_BASE, *_STRIBECK, *_DIRECTED, *_DIRECTED_STRIBECK),
    "M6": (*_BASE, *_STRIBECK, *_DIRECTED, *_DIRECTED_STRIBECK, *_QUAD),
}
"""Searched friction parameters of each law (Duclusaud et al. 2025)."""

_TERMS = tuple(dict.fromkeys(name for names in RUNGS.values() for name in names if name.startswith("friction.")))
_FIRST = {  # where a term begins that the rung before does not have: little of it, so that the search is near there
    "friction.breakaway_ratio": 1.1, "friction.load_friction": 0.05, "friction.load_friction_stribeck": 0.05,
    "friction.load_friction_motor": 0.05, "friction.load_friction_external": 0.05,
    "friction.load_friction_motor_stribeck": 0.05, "friction.load_friction_external_stribeck": 0.05,
    "friction.load_friction_motor_quad": 0.01, "friction.load_friction_external_quad": 0.01,
}
_ALIKE = {"friction.load_friction": _DIRECTED, "friction.load_friction_stribeck": _DIRECTED_STRIBECK}
EXTRAS: dict[str, str] = {
    "soft supply": "supply.internal_resistance", "soft bridge": "supply.bridge_drop_resistance"}
"""What gives way beside friction, and what is searched of it; the name of such a rung is "M4, soft supply"."""

_ON_THE_BUS = "soft supply"
_SOFT_SHARE = 0.2  # of the armature's resistance, where that of what gives way begins: nearer to 0 it may stay there
_STIFFER = 0.9  # of the armature's resistance, that then begins lower
_FEWEST = 3  # held out logs, whose scatter is believed
_STRIBECK_SPEED = 0.2  # rad/s at the output, where Stribeck friction begins to fade


@dataclass(frozen=True)
class Rung:
    """One friction law, or one structure.

    Parameters
    ----------
    name : str
        "M1" to "M6", or such as "digital, diode, M1".
    fit : Fit
    training, holdout : float
        Rms error over all samples [rad]; nan without logs that were held out.
    criterion : float
        Bayesian information criterion of the fitted logs, with their residuals counted as often as they are
        independent; smaller is better.
    """

    name: str
    fit: Fit
    training: float
    holdout: float
    criterion: float

    @property
    def overfits(self) -> bool:
        """Whether it is much better on the logs that it was fitted to than on others."""
        return self.holdout > 1.3 * self.training


@dataclass(frozen=True)
class Ladder:
    """All rungs, and the one that is chosen.

    Parameters
    ----------
    rungs : tuple of Rung
    chosen : str
    reason : str
    error : float
        Rms error on logs that had no say in the choice [rad], smaller ones being luck: the logs that were held out are
        halved, each half chooses a rung, and the other half tells its error. Where the criterion chose, that of all
        logs that were held out; nan with fewer than two.
    choices : tuple of str
        The rungs that the halves chose: two that differ are a close call.
    """

    rungs: tuple[Rung, ...]
    chosen: str
    reason: str
    error: float = math.nan
    choices: tuple[str, ...] = ()

    @property
    def fit(self) -> Fit:
        """That of the chosen rung."""
        return self[self.chosen].fit

    def __getitem__(self, name: str) -> Rung:
        for rung in self.rungs:
            if rung.name == name:
                return rung
        raise InputError("rung", got=name, allowed=", ".join(rung.name for rung in self.rungs))


def friction_ladder(logs: Sequence[Log], servo: Servo, model: type[Model] | None = None,
                    free: Sequence[str] | None = None, *, rungs: Sequence[str] = tuple(RUNGS),
                    select: str = "holdout", gives_way: bool | None = None, progress: Any = False,
                    **options: Any) -> Ladder:
    """Fit friction laws of growing complexity, and choose one.

    Parameters
    ----------
    logs : sequence of Log
    servo : Servo
    model : type of Model, optional
        One that reads load friction: `PulseServo`, `PulseServoInductive` or `DigitalServo`; for `BoundedServo` only
        "M1" makes sense. The one that stands for the servo (`models.default_class`) unless given.
    free : sequence of str, optional
        What else is searched; friction terms in it are left to the ladder.
    rungs : sequence of str
        Of "M1" to "M6".
    select : {"holdout", "criterion"}
        "holdout": the simplest law whose error on the logs that were held out is within one standard error of the
        smallest; "criterion": the smallest information criterion. Without held out logs it is the latter.
    gives_way : bool, optional
        Whether the law that is chosen is fitted once more with an internal resistance of the supply and once with one
        of the bridge, and where one of these is chosen the richer laws with it too: "M4, soft supply". Unless given,
        where all laws are tried. What logs or `free` say already, or the model does not read, is not tried; nor is a
        supply whose bus was measured.
    progress : bool or callable
        As of `identify`, over all rungs.
    **options
        Of `identify`.

    Raises
    ------
    InputError
        If a rung or a way to select is unknown, or as `identify` does.
    """
    for name in rungs:
        if name not in RUNGS:
            raise InputError("rungs", got=name, allowed=", ".join(RUNGS))
    if not rungs or select not in ("holdout", "criterion"):
        raise InputError("ladder", got=f"rungs {list(rungs)}, select {select!r}",
                         allowed='at least one rung; "holdout" or "criterion"')
    given = checks.checked_logs(logs)
    plain = checks.checked_servo(servo, model)
    others = [name for name in (free or checks.usual_free(plain, given))
              if name not in _TERMS and name not in _BASE and not name.startswith("friction.")]
    options = {"compare_with": (), **options, "diagnose": False}  # the ladder is the trial
    options["within"] = Within(options.get("within"))
    climb = _Climb(given, servo, type(plain), others, options, [])
    ordered = [name for name in RUNGS if name in rungs]
    wanted = len(ordered) == len(RUNGS) if gives_way is None else gives_way
    extras = may_give_way(plain, given, others) if wanted else ()
    with checks.shown(progress) as show:
        count = len(ordered) + len(extras)
        ended = all(climb.fitted(name, _share(show, k, count, name)) for k, name in enumerate(ordered))
        if ended and extras:
            law = _choice(climb.ordered(), select)[0]
            ended = all(climb.fitted(name, _share(show, k, count, name))
                        for k, name in enumerate((f"{law}, {extra}" for extra in extras), len(ordered)))
            extra = _parts(_choice(climb.ordered(), select)[0])[1]
            if ended and extra:
                all(climb.fitted(name, _share(show, count - 1, count, name))
                    for name in (f"{richer}, {extra}" for richer in ordered[ordered.index(law) + 1:]))
    return ladder_of(climb.ordered(), select)


def _parts(name: str) -> tuple[str, str]:
    """Return the law and what gives way of a rung; the latter empty where nothing does."""
    law, _, extra = name.partition(", ")
    return law, extra


def _place(rung: Rung) -> tuple[int, int]:
    """Return where a rung stands: what gives way stands behind its law."""
    law, extra = _parts(rung.name)
    return list(RUNGS).index(law), ["", *EXTRAS].index(extra)


class _Climb(NamedTuple):
    """What all rungs have in common, and those that were fitted."""

    logs: Sequence[Log]
    servo: Servo
    kind: type[Model]
    others: Sequence[str]
    options: dict[str, Any]
    found: list[Rung]

    def fitted(self, name: str, tell: Any) -> bool:
        """Fit a rung, and tell whether that came to its end."""
        law, extra = _parts(name)
        more = {**self.options, **({"starts": 1} if self.found else {})}  # it begins at what a simpler law found
        names = [*self.others, *RUNGS[law], *([EXTRAS[extra]] if extra else [])]
        fit = identify(self.logs, _start(self.servo, name, self.found), self.kind, names, progress=tell, **more)
        self.found.append(rung_of(name, fit))
        return not fit.interrupted

    def ordered(self) -> list[Rung]:
        """Return the rungs, the simplest first."""
        return sorted(self.found, key=_place)


def may_give_way(model: Model, logs: Sequence[Log], free: Sequence[str]) -> tuple[str, ...]:
    """Return what may give way and is worth a trial: the model reads it, and nobody knows how much it does.

    A bus that was measured says how far its supply gives way; that is not left to the angles then.

    Parameters
    ----------
    model : Model
    logs : sequence of Log
    free : sequence of str
    """
    return tuple(extra for extra, name in EXTRAS.items() if name in (*model.requires, *model.optional)
                 and name not in free and not any(name in log.parameters for log in logs)
                 and not (extra == _ON_THE_BUS and any("bus_voltage" in log.measured for log in logs)))


def ladder_of(rungs: Sequence[Rung], select: str) -> Ladder:
    """Return fits to the same logs, the simplest first, with the one that is chosen.

    Parameters
    ----------
    rungs : sequence of Rung
    select : {"holdout", "criterion"}
        As of `friction_ladder`.
    """
    chosen, reason = _choice(rungs, select)
    told = _told(rungs, select)
    before = _simpler(rungs, chosen)
    if before is not None:
        words = gained(before.fit, next(rung for rung in rungs if rung.name == chosen).fit, before.name)
        reason += f"; {words}" if words else ""
    return Ladder(tuple(rungs), chosen, reason, told.error, told.choices)


def _simpler(rungs: Sequence[Rung], chosen: str) -> Rung | None:
    """Return the best of the rungs with fewer parameters than the one that is chosen; None where there is none."""
    own = len(next(rung for rung in rungs if rung.name == chosen).fit.names)
    fewer = [rung for rung in rungs if len(rung.fit.names) < own]
    return min(fewer, key=lambda rung: rung.training if math.isnan(rung.holdout) else rung.holdout, default=None)


def _share(show: Any, k: int, count: int, name: str) -> Any:
    return lambda share, text: show((k + share) / count, f"{name}: {text}")


def _start(servo: Servo, name: str, before: Sequence[Rung]) -> Servo:
    """Return where a rung begins: at the best simpler one that it contains, its further terms small.

    M5 and M6 contain M3 and M4 too: there motor and load outside count alike.
    """
    law, extra = _parts(name)
    alike = {"M5": ("M1", "M2", "M3", "M4", "M5"), "M6": tuple(RUNGS)}.get(law, ())

    def within(rung: Rung) -> bool:
        other, given = _parts(rung.name)
        inside = other in alike or set(RUNGS[other]) <= set(RUNGS[law])
        return inside and math.isfinite(rung.fit.cost) and given in ("", extra)

    inner = [rung for rung in before if within(rung)]
    base = min(inner, key=lambda rung: rung.training).fit.servo if inner else servo
    values: dict[str, Any] = {}
    for share, both in _ALIKE.items():
        if base.get(share) is not None and share not in RUNGS[law]:
            values |= {term: base.get(share) for term in both if term in RUNGS[law]}
    values |= {term: None for term in _TERMS if base.get(term) is not None and term not in RUNGS[law]}
    reduction = float(nominal(servo, "gear.gear_reduction") or 1.0)
    own = {**_FIRST, "friction.stribeck_speed": _STRIBECK_SPEED * reduction}
    values |= {term: own[term] for term in RUNGS[law]
               if term in own and not base.get(term) and not values.get(term)}
    if base.get("friction.breakaway_ratio") == 1.0 and "friction.breakaway_ratio" in RUNGS[law]:
        values["friction.breakaway_ratio"] = own["friction.breakaway_ratio"]
    if extra and not base.get(EXTRAS[extra]):
        R_a = float(nominal(base, "motor.armature_resistance") or 1.0)
        values |= {EXTRAS[extra]: _SOFT_SHARE * R_a, "motor.armature_resistance": _STIFFER * R_a}
    return base.replace(values, source="where a rung of the friction ladder begins")


def rung_of(name: str, fit: Fit) -> Rung:
    """Return a fit as one of several, under a name."""
    own = type(fit.model).__name__
    training = fit.training.total()[own]
    holdout = fit.holdout.total()[own] if fit.holdout else math.nan
    inflation = fit.doubt.inflation if fit.doubt is not None else 1.0
    samples = sum(e.samples for e in fit.training.errors[own]) / max(inflation, 1.0)**2
    criterion = samples * math.log(max(training, 1e-300) ** 2) + len(fit.names) * math.log(max(samples, 1.0))
    return Rung(name, fit, training, holdout, criterion)


class _Told(NamedTuple):
    """An error that the choice did not see, and which rungs were chosen without it."""

    error: float
    choices: tuple[str, ...]


def _told(rungs: Sequence[Rung], select: str) -> _Told:
    """Return the error on logs that did not choose: those held out in two halves, each told by the other's choice."""
    if _by_criterion(rungs, select):
        chosen, _ = _choice(rungs, select)
        return _Told(next(rung.holdout for rung in rungs if rung.name == chosen), ())
    count = len(_errors(rungs[0]))
    if count < 2:
        return _Told(math.nan, ())
    halves = [range(k, count, 2) for k in range(2)]  # logs of one kind of motion lie side by side
    named = {rung.name: rung for rung in rungs}
    choices = tuple(_choice(rungs, select, half)[0] for half in halves)
    told = [_errors(named[name])[k] for name, other in zip(choices, reversed(halves), strict=True) for k in other]
    return _Told(pooled(told), choices)


def _by_criterion(rungs: Sequence[Rung], select: str) -> bool:
    return select == "criterion" or any(math.isnan(rung.holdout) for rung in rungs)


def _choice(rungs: Sequence[Rung], select: str, some: Sequence[int] | None = None) -> tuple[str, str]:
    """Return the rung that some of the held out logs choose, or all, and why."""
    if _by_criterion(rungs, select):
        best = min(rungs, key=lambda rung: rung.criterion)
        return best.name, "smallest information criterion"
    best = min(rungs, key=lambda rung: pooled(_errors(rung, some)))
    for rung in rungs:  # from the simplest on
        worse, doubt = _difference(rung, best, some)
        if worse <= doubt:
            reason = "smallest error on logs that were held out" if rung is best else (
                f"simplest within one standard error of {best.name}, the smallest error on logs that were held out")
            return rung.name, reason
    return best.name, "smallest error on logs that were held out"


def _difference(rung: Rung, best: Rung, some: Sequence[int] | None) -> tuple[float, float]:
    """Return by how much a rung's mean square error of held out logs is above the best, and its standard error.

    Two logs do not say how logs scatter; with so few it is the standard error of a mean square of their samples.
    """
    theirs = _errors(best, some)
    gaps = np.array([a.rms**2 - b.rms**2 for a, b in zip(_errors(rung, some), theirs, strict=True)])
    if len(gaps) < _FEWEST:
        return float(gaps.mean()), pooled(theirs) ** 2 * math.sqrt(2.0 / sum(e.samples for e in theirs))
    return float(gaps.mean()), float(gaps.std(ddof=1) / math.sqrt(len(gaps)))


def _errors(rung: Rung, some: Sequence[int] | None = None) -> tuple[LogError, ...]:
    errors = rung.fit.holdout.errors[type(rung.fit.model).__name__]
    return errors if some is None else tuple(errors[k] for k in some)
