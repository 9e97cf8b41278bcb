"""Fits of the bench's logs, judged by what is true of the bench: intervals that hold it, verdicts that name it."""

from __future__ import annotations

import math
import time as clock
import warnings
from typing import Any, NamedTuple

import numpy as np

import servotwin as st

from . import bus_rig, rig, rig_catalog
from . import rig_draws as draws
from .rig_defects import WAKING, between, with_defect
from .rig_logs import log_of, servo_of

FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain", "electronics.deadband")
NAMES = (*FREE, "delay", "angle_offset")
RIGHT = {  # names of causes that are right for a defect
    "load friction": ("load friction",), "play": ("play",), "coast": ("coast",), "wrong t_min": ("minimum drive time",),
    "digital P servo": ("digital",), "lost pulses": ("lost pulses",), "5 % wrong stamps": ("stamps",),
    "stamps fast": ("stamps", "frame period"), "reversed sign": ("sign",), "wrapped angle": ("wrap",),
    "two servos": ("two servos",), "wrong voltage": ("voltage",), "wrong load": ("load",),
    "dropped samples": ("dropped samples", "stamps"), "bent potentiometer": ("bent potentiometer",),
    "falling supply": ("supply that changes",), "dropping supply": ("supply that changes",),
    "warming": ("warming", "supply that changes"), "rounded commands": ("rounded commands",),
    "wrong P register": ("P register",), "mixed P register": ("P register",),
    "counted stamps": ("stamps", "frame period"), "counted stamps of a bus servo": ("stamps",),
}
SAID = {  # what names a defect in the sentence or the warnings, before anything is tried
    "reversed sign": "turns against the command", "wrapped angle": "wrap", "outliers 5 %": "lie far off alone",
    "5 % wrong stamps": "stamp", "dropped samples": "missing",
}


AT_HOME = {  # names of causes that are right for a defect of a servo of the catalog, and what names it without a trial
    "bent potentiometer": ("bent potentiometer",), "falling supply": ("supply that changes",),
    "dropping supply": ("supply that changes",), "lost pulses": ("lost pulses",), "dropped rows": ("dropped samples",),
    "another supply in some logs": ("supply that changes", "voltage", "two servos"),
    "rounded commands": ("rounded commands",), "play": ("play",), "growing play": ("play",),
    "play at the potentiometer": ("play at the potentiometer",), "directed friction": ("directed friction",),
    "coast": ("coast",), "warming": ("warming",), "load friction": ("load friction",),
    "digital P servo": ("digital",), "two servos": ("two servos",)}
AT_HOME_SAID = {
    "late stamps": ("stamps",), "angle times 1.1": ("the angle is scaled by 1.1",),
    "degrees": ("degrees", "check the unit of the angle"), "reversed sign": ("turns against the command",),
    "wrapped angle": ("the angle jumps by",), "outliers": ("lie far off alone",),
    "frame 20.48 ms": ("pulses come every 20.4",)}
OF_BUS = {  # defects of a bus servo: by which factors P is larger than its file says, log by log
    "wrong P register": lambda factor: (factor,) * 4, "mixed P register": lambda factor: (1.0, factor, 1.0, factor),
    "counted stamps of a bus servo": lambda factor: (1.0,) * 4}


class Judged(NamedTuple):
    """One fit: which intervals hold the truth, which have no ends, residuals [rad] and time on the processors [s]."""

    held: dict[str, bool]
    endless: dict[str, str]  # name -> why
    off: dict[str, float]  # of the truth, in half widths
    rms: float
    seconds: float
    half: dict[str, float]  # widths (SI)
    holds: bool  # what its verdict says


class Seen(NamedTuple):
    """What a fit says of a bench."""

    sentence: str
    holds: bool
    causes: tuple[str, ...]
    warnings: tuple[str, ...]
    seconds: float
    ratio: float = 1.0  # of what is left, in noise


def truths_of(truth: draws.Truth) -> dict[str, float]:
    """Return what a fit should find (SI)."""
    s = truth.servo
    return dict(zip(NAMES, (s.R, s.K, s.J, s.forward, s.gain, s.deadband, truth.delay, truth.angle_offset),
                    strict=True))


def logs_of(found: list[draws.Run]) -> list[st.Log]:
    """Return the logs of a bench."""
    return [log_of(run.said, run.load, f"{k + 1} {run.motion}", run.motion) for k, run in enumerate(found)]


def fitted(truth: draws.Truth, found: list[draws.Run], *, given: bool = True, **more: Any) -> st.Fit:
    """Fit logs from a servo file that is 10 to 30 % off, without priors.

    What files leave out is given as the bench has it, or left out.
    """
    file, none = draws.file_of(truth), rig.Servo()
    if not given:
        file = file._replace(R_b=none.R_b, B=none.B, breakaway=none.breakaway, stribeck=none.stribeck)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return st.identify(logs_of(found), servo_of(file, given=given),
                           **{"free": FREE, "priors": None, "compare_with": (), **more})


def judged(condition: str, seed: int, **more: Any) -> Judged:
    """Fit the logs of one bench, and look where the truth lies; as if that were known, with `given`."""
    truth = draws.random_truth(seed)
    if condition == draws.LEFT_OUT:
        truth, more = draws.with_left_out(truth), {"given": False, **more}
    found = draws.taken(truth, condition)
    if condition == draws.LEFT_OUT and more["given"]:  # what was sent too
        found = [run._replace(said=run.said._replace(command=1e-6 * np.round(run.said.command / 1e-6)))
                 for run in found]
    began = clock.process_time()
    fit = fitted(truth, found, **more)
    spent = clock.process_time() - began
    held, endless, off, half = {}, {}, {}, {}
    for name, value in truths_of(truth).items():
        lower, upper, method = fit.intervals()[name]
        if math.isnan(lower) or math.isnan(upper):
            endless[name] = method
            continue
        held[name] = bool(lower <= value <= upper)
        half[name] = 0.5 * (upper - lower)
        off[name] = (value - 0.5 * (lower + upper)) / max(half[name], 1e-300)
    rms = np.sqrt(np.mean(np.concatenate([t.simulated - t.measured for t in fit.traces if not t.held_out]) ** 2))
    return Judged(held, endless, off, float(rms), spent, half, fit.verdict.holds)


def seen(name: str, strength: float, seed: int, **more: Any) -> Seen:
    """Fit the logs of a bench with a defect, and return what is said of it."""
    if name in OF_BUS:
        factor = (1.2 * 2.5 ** strength) ** (1.0 if seed % 2 else -1.0)
        servo = bus_rig.truth(seed)
        late = {"waking": between(*WAKING, strength)} if name.startswith("counted stamps") else {}
        logs, file = bus_rig.logs(servo, seed, OF_BUS[name](factor), **late), bus_rig.file_of(servo, seed)
        began = clock.process_time()
        fit = st.identify(logs, file, st.DigitalServo,
                          **{"free": bus_rig.FREE, "priors": None, "compare_with": (), **more})
    else:
        truth = draws.random_truth(seed)
        found = with_defect(truth, name, strength)
        began = clock.process_time()
        fit = fitted(truth, found, **more)
    verdict = fit.verdict
    return Seen(verdict.sentence, verdict.holds, tuple(cause.name for cause in verdict.causes), tuple(fit.warnings),
                clock.process_time() - began, verdict.ratio)


def seen_at_home(servo: str, name: str, seed: int, **more: Any) -> Seen:
    """Fit the logs of a servo of the catalog by default arguments, and return what is said of them."""
    began = clock.process_time()
    try:
        this = rig_catalog.bench(servo, seed)
        logs = rig_catalog.DEFECTS[name](this)
        began = clock.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = st.identify(logs, this.file, **more)
    except st.errors.InputError as refused:
        return Seen(str(refused), False, (), (), clock.process_time() - began)
    return Seen(fit.verdict.sentence, fit.verdict.holds, tuple(cause.name for cause in fit.verdict.causes),
                tuple(fit.warnings), clock.process_time() - began, fit.verdict.ratio)


def first_at_home(name: str, found: Seen) -> bool:
    """Tell whether what is wrong is the first that a fit names; of nothing, that it accuses no log."""
    said = (found.sentence, *found.warnings)
    if name == "none":
        return found.holds and not any(line.startswith("log ") for line in found.warnings)
    if name in AT_HOME_SAID:
        return any(words in line for words in AT_HOME_SAID[name] for line in said)
    return found.causes[:1] != () and found.causes[0] in AT_HOME[name]


def place(name: str, found: Seen) -> int | None:
    """Return the place of the true cause, 0 the first; None where it is not named.

    What is said without a trial stands before all causes that are tried.
    """
    if name in SAID and any(SAID[name] in line for line in (found.sentence, *found.warnings)):
        return 0
    return next((k for k, cause in enumerate(found.causes) if cause in RIGHT.get(name, ())), None)
