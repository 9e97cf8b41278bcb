"""The friction laws M1 to M6 one after the other on the same logs, and which of them the data pay for.

Each rung begins where simpler ones ended, the best two that no other one contains. It is searched as closely as a
choice asks for, by lanes that go nearly where there are any; only the one that is chosen is searched to its end, with
intervals. More terms always fit the logs that are fitted at least as well; whether they predict others better is what
decides. A supply or a bridge that gives way bends speeds and torques as friction does, so all laws up to the one that
was chosen are fitted once more with each; where one is chosen, so are the richer laws with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.fit import Fit, Ladder, Rung, begin_after
from servotwin.identification.fitting.identify import identify
from servotwin.identification.fitting.search.case import LogPart
from servotwin.identification.fitting.search.free import LUMPED, nominal, stated
from servotwin.identification.fitting.search.least_squares import Begin, Loss
from servotwin.identification.fitting.search.phases import widening
from servotwin.identification.fitting.search.stopping import Within
from servotwin.identification.fitting.traces import LogError, Trace, pooled
from servotwin.loads import Flexible, Load
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, PulseServo, PulseServoInductive
from servotwin.models.base import Model
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES

# --- Why one fit of a ladder is chosen over a simpler one, in words: by how much, and in what motion ------------------

Array = NDArray[np.float64]
_STANDS = 0.02  # of a log's largest speed: below, it stands
_WINDOW = 0.05  # s, over which that is determined: counts of an encoder are no speed
_LEAST = 0.02  # share of an error that is worth a word


def gained(simpler: Fit, chosen: Fit, name: str) -> str:
    """Return what a fit gains over a simpler one of the same logs, as half a sentence; empty where it gains nothing.

    Judged are the logs that were held out; all of them where there are none.

    Parameters
    ----------
    simpler, chosen : Fit
    name : str
        Of the simpler one.
    """
    before, after = (_squares(fit) for fit in (simpler, chosen))
    if not before or set(before) != set(after):
        return ""
    whole = _change(before.values(), after.values())
    if not whole < -_LEAST:
        return ""
    held = any(trace.held_out for trace in chosen.traces)
    told = f"{_percent(whole)} less off than {name} on logs that were {'held out' if held else 'fitted'}"
    states = {word: _change([x[k] for x in before.values()], [x[k] for x in after.values()])
              for k, word in enumerate(("where the shaft stands", "where it moves"))}
    parts = [f"{word} {_percent(x)} {'less' if x < 0.0 else 'more'}" for word, x in states.items() if abs(x) > _LEAST]
    motions: dict[str, list[str]] = {}
    for log, motion in {t.log.name: t.log.motion for t in chosen.traces if t.log.name in after}.items():
        motions.setdefault(motion, []).append(log)
    if len(motions) > 1:
        each = {motion: _change([before[x] for x in some], [after[x] for x in some])
                for motion, some in motions.items()}
        best = min(each, key=lambda motion: each[motion])
        if each[best] < -_LEAST:
            parts.append(f"most in {best}, {_percent(each[best])}")
    return told + (f" ({'; '.join(parts)})" if parts else "")


def _percent(change: float) -> str:
    return f"{100.0 * abs(change):.0f} %"


def _change(before: Iterable[Array], after: Iterable[Array]) -> float:
    """Return by which share the root mean square changes; of rows of sums of squares and counts."""
    roots = []
    for rows in (before, after):
        total = np.sum([np.atleast_2d(row).sum(axis=0) for row in rows], axis=0)
        roots.append(math.sqrt(total[0] / total[1]) if total[1] else math.nan)
    return roots[1] / roots[0] - 1.0 if roots[0] > 0.0 else 0.0


def _squares(fit: Fit) -> dict[str, Array]:
    """Return sum of squares and number of the judged samples that stand and that move, by log."""
    held = [trace for trace in fit.traces if trace.held_out] or list(fit.traces)
    return {trace.log.name: _of(trace) for trace in held if trace.signal == "output_angle" and len(trace.time) > 2}


def _of(trace: Trace) -> Array:
    ahead, behind = (np.interp(trace.time + side * _WINDOW, trace.time, trace.measured) for side in (0.5, -0.5))
    speed = np.abs(ahead - behind)
    stands = speed <= _STANDS * float(np.max(speed))
    squares: list[Sequence[float]] = []
    for some in (stands & trace.judged, ~stands & trace.judged):
        squares.append((float(np.sum(trace.residual[some] ** 2)), float(np.sum(some))))
    return np.array(squares)


# --- Which of several fits to the same logs the data pay for ----------------------------------------------------------

_FEWEST = 3  # held out logs, whose scatter is believed


def ladder_of(rungs: Sequence[Rung], select: str) -> Ladder:
    """Return fits to the same logs, the simplest first, with the one that is chosen.

    Parameters
    ----------
    rungs : sequence of Rung
    select : {"holdout", "criterion"}
        As of `friction_ladder`.
    """
    rungs = with_criterion(rungs)
    chosen, reason = choice_of(rungs, select)
    told = told_of(rungs, select)
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


def rung_of(name: str, fit: Fit) -> Rung:
    """Return a fit as one of several, under a name."""
    own = type(fit.model).__name__
    training = fit.training.total()[own]
    holdout = fit.holdout.total()[own] if fit.holdout else math.nan
    return Rung(name, fit, training, holdout, math.nan)


def with_criterion(rungs: Sequence[Rung]) -> list[Rung]:
    """Return rungs with their information criterion.

    All count the same residuals, as often as those of the rung that leaves least are independent: where each counted
    its own, one whose residuals remember longer would have fewer, and so seem to explain more of them.
    """
    least = min(rungs, key=lambda rung: rung.training)
    fitted = [trace for trace in least.fit.traces if not trace.held_out]
    # So many residuals stand for one that is independent, if each follows the one before it
    memory = widening([LogPart(trace.residual, trace.residual, trace.residual) for trace in fitted], Loss())
    samples = sum(len(trace.time) for trace in fitted) / memory
    return [replace(rung, criterion=samples * math.log(max(rung.training, 1e-300) ** 2)
                    + len(rung.fit.names) * math.log(max(samples, 1.0))) for rung in rungs]


class _Told(NamedTuple):
    """An error that the choice did not see, and which rungs were chosen without it."""

    error: float
    choices: tuple[str, ...]


def told_of(rungs: Sequence[Rung], select: str) -> _Told:
    """Return the error on logs that did not choose: those held out in two halves, each judged by the other's choice."""
    if _by_criterion(rungs, select):
        chosen, _ = choice_of(rungs, select)
        return _Told(next(rung.holdout for rung in rungs if rung.name == chosen), ())
    count = len(_errors(rungs[0]))
    if count < 2:
        return _Told(math.nan, ())
    halves = [range(k, count, 2) for k in range(2)]  # logs of one kind of motion lie side by side
    named = {rung.name: rung for rung in rungs}
    choices = tuple(choice_of(rungs, select, half)[0] for half in halves)
    told = [_errors(named[name])[k] for name, other in zip(choices, reversed(halves), strict=True) for k in other]
    return _Told(pooled(told), choices)


def _by_criterion(rungs: Sequence[Rung], select: str) -> bool:
    return select == "criterion" or any(math.isnan(rung.holdout) for rung in rungs)


def choice_of(rungs: Sequence[Rung], select: str, some: Sequence[int] | None = None) -> tuple[str, str]:
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


# --- The friction laws M1 to M6 one after the other on the same logs, and which of them the data pay for --------------

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
"""The part that gives way beside friction, and its searched numbers; the name of such a rung is "M4, soft supply"."""
_ON_THE_BUS = "soft supply"
_SOFT_SHARE = 0.2  # of the armature's resistance, where that of what gives way begins: nearer to 0 it may stay there
_STIFFER = 0.9  # of the armature's resistance, that then begins lower
_STARTS = 3  # searches of the first law, unless `starts` says
_NEARLY_AS_GOOD = 15.0  # of the criterion
_BASES = 2  # simpler laws at which one begins
_STRIBECK_SPEED = 0.2  # rad/s at the output, where Stribeck friction begins to fade


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
        Further parameters that are searched; friction terms among them are left to the ladder.
    rungs : sequence of str
        Of "M1" to "M6".
    select : {"holdout", "criterion"}
        "holdout": the simplest law whose error on the logs that were held out is within one standard error of the
        smallest; "criterion": the smallest information criterion. Without held out logs it is the latter.
    gives_way : bool, optional
        Whether the laws up to the one that is chosen are fitted once more with an internal resistance of the supply
        and once with one of the bridge, and where one of these is chosen the richer laws with it too: "M4, soft
        supply". Unless given, where all laws are tried. Parts that logs or `free` say already, or that the model does
        not read, are not tried; nor is a supply whose bus was measured.
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
    climb = _Climb(given, servo, type(plain), others, options, select, [])
    ordered = [name for name in RUNGS if name in rungs]
    wanted = len(ordered) == len(RUNGS) if gives_way is None else gives_way
    extras = may_give_way(plain, given, others) if wanted else ()
    with checks.shown(progress) as show:
        count, several = len(ordered) + len(extras) + 1, len(ordered) + len(extras) > 1
        ended = all(climb.fitted(name, _share(show, k, count, name), exactly=not several)
                    for k, name in enumerate(ordered))
        if ended and extras:
            upto = ordered.index(climb.best()) + 1
            ended = all(climb.fitted(f"{law}, {extra}", _share(show, k, count, f"{law}, {extra}"))
                        for k, extra in enumerate(extras, len(ordered)) for law in ordered[:upto])
            extra = _parts(climb.best())[1]
            if ended and extra:
                ended = all(climb.fitted(f"{law}, {extra}", _share(show, count - 2, count, f"{law}, {extra}"))
                            for law in ordered[upto:])
        if ended and several:
            climb.end(_share(show, count - 1, count, climb.best()))
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
    """The common options of all rungs, and those that were fitted."""

    logs: Sequence[Log]
    servo: Servo
    kind: type[Model]
    others: Sequence[str]
    options: dict[str, Any]
    select: str
    found: list[Rung]

    def fitted(self, name: str, tell: Any, *, exactly: bool = False) -> bool:
        """Fit a rung as closely as a choice asks for, or to its end, and tell whether that came to its end."""
        fitted = []
        bases: Sequence[Rung | None] = _bases(name, self.found) or [None]
        for base in bases:
            begin = Begin(self.options.get("starts", _STARTS)) if base is None else begin_after(base.fit)
            servo = _start(self.servo if base is None else base.fit.servo, name, self.servo)
            fit = self._fit(name, servo, begin._replace(exactly=exactly), tell, intervals=exactly)
            fitted.append(rung_of(name, fit))
            if fit.interrupted:
                break
        self.found.append(min(fitted, key=lambda rung: rung.training))
        return not fitted[-1].fit.interrupted

    def end(self, tell: Any) -> None:
        """Search what is chosen to its end, until what is chosen was."""
        self._back(tell)
        ended: set[str] = set()
        while (name := self.best()) not in ended:
            ended.add(name)
            place = next(k for k, rung in enumerate(self.found) if rung.name == name)
            rough = self.found[place].fit
            fit = self._fit(name, rough.servo, begin_after(rough), tell, intervals=True)
            self.found[place] = rung_of(name, fit)
            if fit.interrupted:
                break

    def _back(self, tell: Any) -> None:
        """Search laws within the chosen one that are nearly as good from its end: kinks may have held them."""
        several = self.ordered()
        chosen = next(rung for rung in several if rung.name == self.best())
        for rung in several:
            if not _contains(chosen.name, rung.name) or rung.criterion > chosen.criterion + _NEARLY_AS_GOOD:
                continue
            extra = _parts(chosen.name)[1]
            given = {EXTRAS[extra]: self.servo.get(EXTRAS[extra])} if extra and not _parts(rung.name)[1] else {}
            servo = _start(chosen.fit.servo.replace(given), rung.name, self.servo)
            fit = self._fit(rung.name, servo, begin_after(chosen.fit, exactly=False), tell, intervals=False)
            if fit.interrupted:
                break
            place = next(k for k, one in enumerate(self.found) if one.name == rung.name)
            self.found[place] = min(self.found[place], rung_of(rung.name, fit), key=lambda one: one.training)

    def _fit(self, name: str, servo: Servo, begin: Begin, tell: Any, *, intervals: bool) -> Fit:
        law, extra = _parts(name)
        names = [*self.others, *RUNGS[law], *([EXTRAS[extra]] if extra else [])]
        more = {**self.options, "starts": begin, "intervals": intervals and self.options.get("intervals", True)}
        if more.get("priors", "servo") == "servo":  # of the file: what a simpler law found is no belief of its own
            more["priors"] = stated(self.servo, names)
        return identify(self.logs, servo, self.kind, names, progress=tell, **more)

    def ordered(self) -> list[Rung]:
        """Return the rungs, the simplest first."""
        return with_criterion(sorted(self.found, key=_place))

    def best(self) -> str:
        """Return the name of the rung that is chosen as it stands."""
        return choice_of(self.ordered(), self.select)[0]


def may_give_way(model: Model, logs: Sequence[Log], free: Sequence[str]) -> tuple[str, ...]:
    """Return what may give way and is worth a trial: the model reads it, and how much it does is unknown.

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


def _share(show: Any, k: int, count: int, name: str) -> Any:
    return lambda share, text: show((k + share) / count, f"{name}: {text}")


def _bases(name: str, before: Sequence[Rung]) -> list[Rung]:
    """Return the simpler rungs at which one begins: the best two that no other one contains which it contains."""
    inner = [rung for rung in before if _contains(name, rung.name) and math.isfinite(rung.fit.cost)]
    largest = [rung for rung in inner if not any(_contains(other.name, rung.name) for other in inner)]
    return sorted(largest, key=lambda rung: rung.training)[:_BASES]


def _contains(name: str, other: str) -> bool:
    """Tell whether a rung is another one with more terms.

    M5 and M6 contain M3 and M4 too: there motor and load outside count alike.
    """
    (law, extra), (inner, given) = _parts(name), _parts(other)
    alike = {"M5": ("M3", "M4"), "M6": ("M3", "M4")}.get(law, ())
    return name != other and given in ("", extra) and (inner in alike or set(RUNGS[inner]) <= set(RUNGS[law]))


def _start(base: Servo, name: str, servo: Servo) -> Servo:
    """Return where a rung begins that continues from another one, or from the servo itself: its further terms small."""
    law, extra = _parts(name)
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


# --- Structures of a servo one after the other on the same logs -------------------------------------------------------

# The kind of loop and the bridge are compared first, with Coulomb and viscous friction; an elastic gear or arm where
# they are asked for, and the friction laws M2 to M6 with what gives way, follow on what these leave. A structure with
# fewer parts is simpler, and the simplest that predicts no worse is chosen.

KINDS = ("analog", "digital")
BRIDGES: dict[str, tuple[str, ...]] = {"analog": ("brake", "coast"), "digital": ("brake", "diode")}
"""States of a bridge that does not drive, by the kind of servo; the simplest first."""

SPRINGS: dict[str, tuple[str, ...]] = {
    "gear": ("gear.stiffness", "gear.damping"), "arm": ("load.flexible.stiffness", "load.flexible.damping")}
"""Parts that may give way, and their searched numbers beside all else."""

_FIRST_LAW = "M1"
_STIFFNESS, _DAMPING = 100.0, 0.05  # N m/rad, N m s/rad, where a search begins: guesses for small gears
_TICK, _FRAME = 1e-3, 0.02  # s, where nothing is known: a guess, and the usual transmitter
_STEPS = ("electronics.one_shot_slope", "potentiometer.feedback_gain")


class Structure(NamedTuple):
    """A kind of loop, what its bridge does while it does not drive, and what gives way.

    Parameters
    ----------
    kind : {"analog", "digital"}
    bridge : str
        Of `BRIDGES`.
    spring : str
        Of `SPRINGS`; nothing gives way unless given.
    """

    kind: str
    bridge: str
    spring: str = ""

    def named(self, law: str) -> str:
        """Return how a table calls it with a friction law."""
        return ", ".join((self.kind, self.bridge, *([f"elastic {self.spring}"] if self.spring else []), law))


def compare_structures(logs: Sequence[Log], servo: Servo, model: type[Model] | None = None,
                       free: Sequence[str] | None = None, *, kinds: Sequence[str] = KINDS,
                       bridges: Sequence[str] | None = None, springs: Sequence[str] = (),
                       rungs: Sequence[str] = tuple(RUNGS), select: str = "holdout", gives_way: bool | None = None,
                       progress: Any = False, **options: Any) -> Ladder:
    """Fit structures of a servo to the same logs, and choose the simplest that predicts no worse.

    Parameters
    ----------
    logs : sequence of Log
    servo : Servo
        Where a chip or a firmware is not given it follows from the other: the gain that makes the mean voltages equal,
        and the same dead zone.
    model : type of Model, optional
        The analog class: `PulseServo` unless given.
    free : sequence of str, optional
        Searched parameters of every structure that reads them; the usual ones of each unless given. Friction is left
        to the laws.
    kinds : sequence of str
        Of "analog" and "digital"; a servo on a bus takes no pulses and is digital alone.
    bridges : sequence of str, optional
        Of "brake", "coast" (analog) and "diode" (digital); all unless given.
    springs : sequence of str
        Of "gear" (elastic, with inertia behind it) and "arm" (all inertia of the load, and its pendulum, behind a
        spring), tried on the chosen loop and bridge. They take far longer than rigid ones.
    rungs : sequence of str
        Friction laws of the chosen loop, bridge and spring, "M1" among them or not: of `RUNGS`.
    select : {"holdout", "criterion"}
        As of `friction_ladder`.
    gives_way : bool, optional
        As of `friction_ladder`, on the best law.
    progress : bool or callable
        As of `identify`, over all structures.
    **options
        Of `identify`; bounds and priors count where a structure searches their number.

    Returns
    -------
    Ladder
        Its rungs are called such as "digital, diode, M1". A structure whose search ends where a log cannot be simulated
        is none of them.

    Raises
    ------
    InputError
        If a kind, bridge, spring, law or way to select is unknown, nothing is left to compare, a load has no inertia
        for a spring, or as `identify` does.
    """
    laws = checks.checked_words("rungs", rungs, tuple(RUNGS))
    checks.checked_words("select", [select], ("holdout", "criterion"))
    given = checks.checked_logs(logs)
    some = _structures(servo, kinds, bridges)
    elastic = checks.checked_words("springs", springs, tuple(SPRINGS))
    logs_of = {spring: [replace(log, load=as_arm(log.load)) for log in given] if spring == "arm" else given
               for spring in ("", *elastic)}
    options = {"compare_with": (), **options, "diagnose": False}  # the comparison is the trial
    options["within"] = Within(options.get("within"))
    found: dict[Structure, Rung] = {}
    with checks.shown(progress) as show:
        further = [law for law in laws if law != _FIRST_LAW]
        before, count = len(some) + len(elastic), len(some) + len(elastic) + len(further)

        def all_fitted(first: int, structures: Sequence[Structure], start: Servo) -> bool:
            """Fit structures, and tell whether that came to its end."""
            for k, one in enumerate(structures, first):
                fit = _fitted(logs_of[one.spring], as_structure(start, one), one, model, free, options,
                              _part(show, k, count, one.named(_FIRST_LAW)))
                if math.isfinite(fit.cost):
                    found[one] = rung_of(one.named(_FIRST_LAW), fit)
                if fit.interrupted:
                    return False
            return True

        ended = all_fitted(0, some, servo)
        if not found:
            raise InputError("structures", got="none that could be simulated to the end of the logs",
                             allowed="a servo whose parameters can follow the logs; see its values and bounds")
        if ended and elastic:
            rigid = _best(found, select)
            ended = all_fitted(len(some), [rigid._replace(spring=spring) for spring in elastic], found[rigid].fit.servo)
        if not ended or not further:
            return ladder_of(tuple(found.values()), select)
        best = _best(found, select)
        fit = found[best].fit
        if gives_way is None:
            gives_way = len(laws) == len(RUNGS)
        climbed = _climbed(logs_of[best.spring], fit, further, {**options, "gives_way": gives_way},
                           lambda share, text: show((before + share * len(further)) / count, text))
    laws_of_best = [rung_of(best.named(rung.name), rung.fit) for rung in climbed.rungs]
    return ladder_of((*found.values(), *laws_of_best), select)


def as_structure(servo: Servo, structure: Structure) -> Servo:
    """Return a servo with chip or firmware of a structure, where it has none made of the other, bridge and spring.

    Parameters
    ----------
    servo : Servo
    structure : Structure

    Raises
    ------
    InputError
        If the servo gives neither chip nor firmware, or no scale from pulses to angles.

    Examples
    --------
    >>> import servotwin as st
    >>> digital = as_structure(st.load_servo("hitec-hs-755hb"), Structure("digital", "diode"))
    >>> digital.firmware.off_state, round(digital.firmware.proportional_gain, 3)
    ('diode', 3.423)
    """
    made: dict[str, Any]
    if structure.kind == "analog":
        made = {"electronics.off_state": structure.bridge}
        if servo.get("electronics.stretcher_gain") is None:
            per_angle, period = _scale(servo), _number(servo, "electronics.frame_period", _FRAME)
            made |= {"electronics.stretcher_gain": _required(servo, "firmware.proportional_gain") * period / per_angle}
            if servo.get("electronics.deadband") is None:
                made["electronics.deadband"] = 2.0 * per_angle * _number(servo, "firmware.deadband_angle", 0.0)
    else:
        made = {"firmware.off_state": structure.bridge}
        if servo.get("firmware.proportional_gain") is None:
            per_angle, period = _scale(servo), _number(servo, "electronics.frame_period", _FRAME)
            made["firmware.proportional_gain"] = _required(servo, "electronics.stretcher_gain") * per_angle / period
        if servo.get("firmware.control_period") is None:
            made["firmware.control_period"] = _TICK
    if structure.spring == "gear" and servo.get("gear.stiffness") is None:
        made |= {"gear.stiffness": _STIFFNESS, "gear.damping": _DAMPING}
    return servo.replace(made, source=f"a trial of a structure: {structure.kind}, {structure.bridge}")


def as_arm(load: Load) -> Load:
    """Return a load all inertia of which, with its pendulum, is behind a spring.

    Raises
    ------
    InputError
        If the load has no inertia, several pendulums, or something behind a spring already.

    Examples
    --------
    >>> import servotwin as st
    >>> as_arm(st.loads.Inertia(0.01) + st.loads.Constant(0.2)).flexible.moment_of_inertia
    0.01
    """
    if load.flexibles or len(load.pendulums) > 1 or not load.total_inertia > 0.0:
        raise InputError("structures: arm", got=f"a load of {load!r}", allowed="inertia, or one pendulum, on the shaft")
    weight = {key: getattr(load.pendulums[0], key) for key in ("mass", "length", "hanging_angle", "gravity")
              } if load.pendulums else {}
    body = Flexible(stiffness=_STIFFNESS, damping=_DAMPING, inertia=load.total_inertia, **weight)
    return replace(load, inertia=0.0, pendulums=(), flexibles=(body,))


def _structures(servo: Servo, kinds: Sequence[str], bridges: Sequence[str] | None) -> list[Structure]:
    every = tuple(dict.fromkeys(word for words in BRIDGES.values() for word in words))
    wanted = checks.checked_words("kinds", kinds, KINDS)
    words = every if bridges is None else checks.checked_words("bridges", bridges, every)
    on_bus = servo.get("firmware.command_kind") == "goal"
    found = [Structure(kind, word) for kind in KINDS if kind in wanted and not (on_bus and kind == "analog")
             for word in BRIDGES[kind] if word in words]
    if not found:
        raise InputError("structures", got=f"kinds {', '.join(wanted)} with bridges {', '.join(words)}"
                         + (", of a servo on a bus" if on_bus else ""),
                         allowed="; ".join(f"{kind}: {', '.join(some)}" for kind, some in BRIDGES.items()))
    return found


def _fitted(logs: Sequence[Log], servo: Servo, structure: Structure, analog: type[Model] | None,
            free: Sequence[str] | None, options: dict[str, Any], tell: Any) -> Fit:
    """Return the fit of a structure with Coulomb and viscous friction."""
    kind = DigitalServo if structure.kind == "digital" else _analog_class(analog)
    plain = checks.checked_servo(servo, kind)
    read = (*plain.requires, *plain.optional, *LUMPED, *LOAD_NAMES)
    names = [*(checks.usual_free(plain, logs) if free is None else [name for name in free if name in read]),
             *SPRINGS.get(structure.spring, ())]
    some = (*names, *RUNGS[_FIRST_LAW])
    own: dict[str, Any] = {
        key: {name: value for name, value in options[key].items() if name in some}
        for key in ("bounds", "priors") if isinstance(options.get(key), Mapping)}
    if structure.kind == "analog" and options.get("nuisance") is not None:
        own["nuisance"] = [name for name in options["nuisance"] if name != "control_phase"]
    return friction_ladder(logs, servo, kind, names, rungs=(_FIRST_LAW,), progress=tell, **{**options, **own}).fit


def _analog_class(analog: type[Model] | None) -> type[Model]:
    return analog if analog in (PulseServo, PulseServoInductive) else PulseServo


def _best(found: dict[Structure, Rung], select: str) -> Structure:
    chosen = ladder_of(tuple(found.values()), select).chosen
    return next(one for one, rung in found.items() if rung.name == chosen)


def _climbed(logs: Sequence[Log], fit: Fit, laws: Sequence[str], options: dict[str, Any],
             tell: Callable[[float, str], None]) -> Ladder:
    """Return further friction laws on the best loop and bridge, from where its fit ended."""
    names = [name for name in fit.space.names if name not in RUNGS[_FIRST_LAW]]
    bounds = {name: span for name, span in (options.get("bounds") or {}).items() if name in fit.space.names}
    priors = {p.name: p.prior for p in fit.space.parameters if p.prior is not None}  # its own end is no further one
    return friction_ladder(logs, fit.servo, type(fit.model), names, rungs=laws, progress=tell,
                           **{**options, "starts": 1, "bounds": bounds, "priors": priors})


def _part(show: Any, k: int, count: int, name: str) -> Any:
    return lambda share, text: show((k + share) / count, f"{name}: {text}")


def _number(servo: Servo, name: str, default: float) -> float:
    value = servo.get(name)
    return float(value) if isinstance(value, int | float) else default


def _required(servo: Servo, name: str) -> float:
    value = servo.get(name)
    if not isinstance(value, int | float):
        raise InputError(f"structures of {servo.name}", got=f"no {name}", allowed="a servo with a chip or a firmware")
    return float(value)


def _scale(servo: Servo) -> float:
    """Return s_µ, the pulse width of an angle [s/rad]."""
    slope, gain = (_required(servo, name) for name in _STEPS)
    return slope * gain
