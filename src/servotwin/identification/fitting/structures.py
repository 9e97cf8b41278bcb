"""Structures of a servo one after the other on the same logs: analog or digital, its bridge, its spring, its friction.

The kind of loop and the bridge are compared first, with Coulomb and viscous friction; an elastic gear or arm where they
are asked for, and the friction laws M2 to M6 with what gives way, follow on what these leave. A structure with
fewer parts is simpler, and the simplest that predicts no worse is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from servotwin.errors import InputError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.fit import Fit
from servotwin.identification.fitting.free import LUMPED
from servotwin.identification.fitting.ladder import RUNGS, Ladder, Rung, friction_ladder, ladder_of, rung_of
from servotwin.identification.fitting.stopping import Within
from servotwin.loads import Flexible, Load
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model, PulseServo, PulseServoInductive
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES

KINDS = ("analog", "digital")
BRIDGES: dict[str, tuple[str, ...]] = {"analog": ("brake", "coast"), "digital": ("brake", "diode")}
"""What a bridge may do while it does not drive, by the kind of servo; the simplest first."""

SPRINGS: dict[str, tuple[str, ...]] = {
    "gear": ("gear.stiffness", "gear.damping"), "arm": ("load.flexible.stiffness", "load.flexible.damping")}
"""What may give way, and what is searched of it beside all else."""

_BASE = "M1"
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
        What is searched of every structure that reads it; the usual parameters of each unless given. Friction is left
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
        further = [law for law in laws if law != _BASE]
        before, count = len(some) + len(elastic), len(some) + len(elastic) + len(further)

        def all_fitted(first: int, structures: Sequence[Structure], start: Servo) -> bool:
            """Fit structures, and tell whether that came to its end."""
            for k, one in enumerate(structures, first):
                fit = _fitted(logs_of[one.spring], as_structure(start, one), one, model, free, options,
                              _part(show, k, count, one.named(_BASE)))
                if math.isfinite(fit.cost):
                    found[one] = rung_of(one.named(_BASE), fit)
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
    some = (*names, *RUNGS[_BASE])
    own: dict[str, Any] = {
        key: {name: value for name, value in options[key].items() if name in some}
        for key in ("bounds", "priors") if isinstance(options.get(key), Mapping)}
    if structure.kind == "analog" and options.get("nuisance") is not None:
        own["nuisance"] = [name for name in options["nuisance"] if name != "control_phase"]
    return friction_ladder(logs, servo, kind, names, rungs=(_BASE,), progress=tell, **{**options, **own}).fit


def _analog_class(analog: type[Model] | None) -> type[Model]:
    return analog if analog in (PulseServo, PulseServoInductive) else PulseServo


def _best(found: dict[Structure, Rung], select: str) -> Structure:
    chosen = ladder_of(tuple(found.values()), select).chosen
    return next(one for one, rung in found.items() if rung.name == chosen)


def _climbed(logs: Sequence[Log], fit: Fit, laws: Sequence[str], options: dict[str, Any],
             tell: Callable[[float, str], None]) -> Ladder:
    """Return further friction laws on the best loop and bridge, from where its fit ended."""
    names = [name for name in fit.space.names if name not in RUNGS[_BASE]]
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
