"""The trials: which logs, in which order, how much of the fit's own effort, and what is said in the end.

If a candidate were true, a fit without it would be off by the part of its effect that the numbers of the fit imitate.
How large it is follows from the part that they do not, which is what is left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.assumptions import assumptions
from servotwin.identification.fitting.checks import findings
from servotwin.identification.fitting.diagnosis.bench import (
    DEAR,
    Purse,
    Setting,
    Spent,
    Told,
    TrialBench,
    gain,
    teaching,
)
from servotwin.identification.fitting.diagnosis.drifts import (
    MOST_LEFT,
    changing_supply,
    dropped_samples,
    lost_pulses,
    warming,
)
from servotwin.identification.fitting.search.case import HUBER, Point, has_pulses, joined, robust_deviation
from servotwin.identification.fitting.search.free import LUMPED, nominal
from servotwin.identification.fitting.search.task import Task
from servotwin.identification.fitting.traces import Trace
from servotwin.identification.fitting.verdict import Cause, Verdict, shown
from servotwin.loads import Load
from servotwin.logs.log import Log
from servotwin.models import BoundedServo, DigitalServo, Model
from servotwin.parameters import Servo

# --- Candidates of which residuals tell the shape ---------------------------------------------------------------------

GAIN = "firmware.proportional_gain"
FACTORS = (0.4, 0.6, 0.8, 1.25, 1.6, 2.5)
"""Of P: what a register may be wrong by."""
_BENT = ("potentiometer.linearity_angle", "potentiometer.linearity_error")
_SHAPES_SIZES = (1.0, 1.4)  # times what the residuals tell: the fit has bent some of it away
_NODES = 9  # of a table
_ROUNDS = 8  # of a robust line
_STEPS = (1e-6, 0.02 / 4096.0, 1e-5)  # s: microseconds, counts of a PCA9685 at 50 Hz, tens of microseconds
_SERVO_WRITE = 544e-6, 1856e-6 / 180.0  # s: what Arduino's Servo makes of whole degrees, from 0 on
_DEGREE = np.radians(1.0)


def bent(bench: TrialBench) -> Sequence[Setting]:
    """Return settings with a potentiometer that reads as the residuals of what teaches say: a parabola, a cubic."""
    model = bench.setting.model
    gain = model.value_or("potentiometer.feedback_gain", 0.0)
    names = bench.old.space.names
    if "potentiometer.feedback_gain" in names:
        gain = float(bench.old.space.values(bench.point.shared[None, :len(names)])[0][
            names.index("potentiometer.feedback_gain")])
    if any(name not in model.optional or model.servo.get(name) is not None for name in _BENT) or not gain > 0.0 \
            or any(log.angle_name != "output_angle" for log in bench.setting.logs):
        return ()
    angles, residuals = (np.concatenate(some) for some in zip(*map(_taught, bench.cases, bench.base.residuals),
                                                              strict=True))
    middle, half = float(angles.mean()), 0.5 * float(np.ptp(angles))
    if not half > 0.0:
        return ()
    at = np.linspace(-1.0, 1.0, _NODES)
    found = []
    for power in (2, 3):
        c = _robust((angles - middle) / half, residuals, power)
        for size in _SHAPES_SIZES:
            error = size * gain * sum(c[k] * at**k for k in range(2, power + 1))
            table = {_BENT[0]: tuple((middle + half * at).tolist()), _BENT[1]: tuple(np.asarray(error).tolist())}
            found.append(replace(bench.setting, model=type(model)(model.servo.replace(table, source="a trial"))))
    return found


def _taught(case: object, residual: Array) -> tuple[Array, Array]:
    """Return measured angles and residuals of the samples that teach."""
    values: Array = case.values["output_angle"]  # type: ignore[attr-defined]
    keep = teaching(np.arange(len(residual), dtype=np.float64), alternate=False)
    return values[keep], residual[keep]


def _robust(x: Array, y: Array, power: int) -> Array:
    """Return the coefficients of a polynomial of which outliers and motions take little."""
    A = np.vander(x, power + 1, increasing=True)
    weight = np.ones(len(x))
    for _ in range(_ROUNDS):
        c = np.linalg.lstsq(A * weight[:, None], y * weight, rcond=None)[0]
        left = np.abs(y - A @ c)
        weight = np.sqrt(np.minimum(1.0, HUBER * robust_deviation(left) / np.maximum(left, 1e-12)))
    return np.asarray(c)


def rounded(bench: TrialBench) -> Sequence[Setting]:
    """Return settings whose commands are multiples of what generators and programs send."""
    found = []
    for step, start in (*((step, 0.0) for step in _STEPS), (_SERVO_WRITE[1], _SERVO_WRITE[0])):
        for floor in (False, True) if start else (False,):
            logs = tuple(_rounded(log, step, start, floor=floor) for log in bench.setting.logs)
            if any(a is not b for a, b in zip(logs, bench.setting.logs, strict=True)):
                found.append(replace(bench.setting, logs=logs))
    return found


def _rounded(log: Log, step: float, start: float, *, floor: bool) -> Log:
    if log.command_kind == "angle":
        step, start = _DEGREE * step / _STEPS[-1], 0.0
    elif log.command_kind != "pulse_width":
        return log
    counts = (log.command - start) / step
    command = start + step * (np.floor(counts + 1e-6) if floor else np.round(counts))
    return log if np.allclose(command, log.command, rtol=0.0, atol=1e-3 * step, equal_nan=True) else \
        replace(log, command=command)


def wrong_gain(bench: TrialBench) -> Sequence[Setting]:
    """Return settings in which P is another in all logs, by some factors."""
    return [setting for factor in FACTORS if (setting := with_gains(bench, [factor] * len(bench.cases))) is not None]


def with_gains(bench: TrialBench, factors: Sequence[float]) -> Setting | None:
    """Return the setting in which each log's P is so many times what it says; None where P is none, or searched."""
    model = bench.setting.model
    if not isinstance(model, DigitalServo) or GAIN in bench.old.space.names or not model.value_or(GAIN, 0.0) > 0.0:
        return None
    logs = tuple(replace(log, parameters={**log.parameters, GAIN: factor * log.parameters.get(GAIN, model.value(GAIN))})
                 if factor != 1.0 else log for log, factor in zip(bench.setting.logs, factors, strict=True))
    return replace(bench.setting, logs=logs)


def own_gains(bench: TrialBench) -> Setting | None:
    """Return the setting in which some logs have another P, each log the one by which it is nearest; None if none has.

    Each log is asked on what teaches, with the other numbers as they are.
    """
    factors = (1.0, *FACTORS)
    settings = [with_gains(bench, [factor] * len(bench.cases)) for factor in factors]
    costs = []
    for setting in settings:
        if setting is None:
            return None
        try:
            costs.append(_costs(bench, setting))
        except ServotwinError:
            costs.append(np.full(len(bench.cases), np.inf))
    best = [factors[k] for k in np.argmin(costs, axis=0)]
    return None if len(set(best)) < 2 else with_gains(bench, best)


def _costs(bench: TrialBench, setting: Setting) -> Array:
    """Return the cost of what teaches, log by log."""
    forecast = bench.forecast(setting)
    parts = forecast.at(bench.start(forecast, setting, bench.base.point), derivatives=False)
    costs = np.array([bench.task.loss.cost(part.residual) for part in parts])
    return np.where(np.isfinite(costs), costs, np.inf)


# --- The table of what may be the matter ------------------------------------------------------------------------------

_EXACT, _OFF = 2e-3, 0.12  # of a clock: as good as any, and more than any is off
_VOLTAGE = "supply.open_circuit_voltage"


@dataclass(frozen=True)
class Candidate:
    """Something that may be the matter.

    Parameters
    ----------
    name : str
    words : str
        Statement of the cause, before the gain.
    remedy : str
    settings : callable
        Returns the settings from which it is tried; none where it makes no sense.
    """

    name: str
    words: str
    remedy: str
    settings: Callable[[TrialBench], Sequence[Setting]]


def numbers(values: Sequence[Mapping[str, float]], fixed: Mapping[str, float | str] | None = None, *,
            price: float = 1.0) -> Callable[[TrialBench], Sequence[Setting]]:
    """Return settings that search numbers of the servo which it leaves out, from several values (SI).

    Numbers that the servo gives already, other than the value that changes nothing, or that are searched already, are
    not tried.
    """
    def settings(bench: TrialBench) -> Sequence[Setting]:
        old = bench.setting.model
        if any(name not in (*old.requires, *old.optional) or name in bench.old.space.names
               or _matters(old.servo, name) for start in values for name in start):
            return ()
        given = dict(fixed or {})
        return [Setting(bench.setting.logs, type(old)(old.servo.replace({**given, **start}, source="a trial")),
                        start, price=price) for start in values]
    return settings


_NEUTRAL: dict[str, float] = {"friction.breakaway_ratio": 1.0}


def _matters(servo: Servo, name: str) -> bool:
    value = servo.get(name)
    return value is not None and value != _NEUTRAL.get(name, 0.0)


def scaled(name: str, factors: Sequence[float]) -> Callable[[TrialBench], Sequence[Setting]]:
    """Return settings that search a number which the servo gives, from several shares of it."""
    def settings(bench: TrialBench) -> Sequence[Setting]:
        old = bench.setting.model
        value = nominal(old.servo, name)
        if not value or name in bench.old.space.names:
            return ()
        logs = tuple(replace(log, parameters={k: v for k, v in log.parameters.items() if k != name})
                     for log in bench.setting.logs)
        said = {log.parameters.get(name, value) for log in bench.setting.logs}
        if len(said) > 1:
            return ()
        there = said.pop()
        return [Setting(logs, type(old)(old.servo.replace({name: there}, source="a trial")), {name: factor * there})
                for factor in factors]
    return settings


def turned(bench: TrialBench) -> Sequence[Setting]:
    """Return the setting in which the bridge opens between pulses where it brakes, and the other way round."""
    old = bench.setting.model
    if "electronics.off_state" not in old.optional:
        return ()
    other = "brake" if old.servo.get("electronics.off_state") == "coast" else "coast"
    return [Setting(bench.setting.logs, type(old)(old.servo.replace({"electronics.off_state": other},
                                                                    source="a trial")), afresh=True)]


def directed(bench: TrialBench) -> Sequence[Setting]:
    """Return the setting in which Coulomb friction is another one each way."""
    old, names = bench.setting.model, bench.old.space.names
    forward, backward = LUMPED["output_coulomb_torque"][0]
    if "output_coulomb_torque" in names:
        there = dict(zip(names, bench.old.space.values(bench.point.shared[None, :len(names)])[0], strict=True))
        each = there["output_coulomb_torque"] / float(nominal(old.servo, "gear.gear_reduction") or 1.0)
    elif forward not in names and backward not in names:
        each = float(nominal(old.servo, forward) or 0.0)
    else:
        return ()
    if each <= 0.0:
        return ()
    return [Setting(bench.setting.logs, old, {forward: each, backward: each}, ("output_coulomb_torque",))]


def heavier(bench: TrialBench) -> Sequence[Setting]:
    """Return settings in which all loads are some shares of what the logs say."""
    if not any(log.load != Load() for log in bench.setting.logs) or any(
            name.startswith("load.") for name in bench.old.space.names):
        return ()
    return [Setting(tuple(replace(log, load=_times(log.load, factor)) for log in bench.setting.logs),
                    bench.setting.model) for factor in (0.7, 0.83, 1.2, 1.4)]


def _times(load: Load, factor: float) -> Load:
    """Return a load with inertia, torque and masses a share larger."""
    pendulums = tuple(replace(p, mass=factor * p.mass, inertia=None if p.inertia is None else factor * p.inertia)
                      for p in load.pendulums)
    return replace(load, inertia=factor * load.inertia, torque=factor * load.torque, pendulums=pendulums)


def like_digital(bench: TrialBench) -> Sequence[Setting]:
    """Return settings of a servo without pulses and deadband that multiplies its error by a gain."""
    old = bench.setting.model
    if isinstance(old, BoundedServo | DigitalServo):
        return ()
    servo, names = old.servo, bench.old.space.names
    there = dict(zip(names, bench.old.space.values(bench.point.shared[None, :len(names)])[0], strict=True))
    gain = there.get("electronics.stretcher_gain", servo.get("electronics.stretcher_gain") or 0.0)
    slope = there.get("electronics.one_shot_slope", servo.get("electronics.one_shot_slope") or 0.0)
    if not (isinstance(gain, float) and gain > 0.0 and isinstance(slope, float) and slope > 0.0):
        return ()
    loss = float(servo.get("supply.bridge_drop_voltage") or 0.0)  # type: ignore[arg-type]
    mean = (old.value(_VOLTAGE) - loss) * gain / (old.value_or("electronics.frame_period", 0.02) / slope)
    plain = servo.replace({"electronics.comparator_gain": 1.0, "electronics.bridge_gain": mean,
                           "electronics.voltage_deadband": 0.0}, source="a trial")
    model: Model = BoundedServo(plain)
    read = (*model.requires, *model.optional, *LUMPED)
    lost = tuple(name for name in names if name not in read and not name.startswith("load."))
    nuisance = tuple(dict.fromkeys(name for name in (*bench.old.nuisance, "delay", "log_delay")
                                   if name not in ("frame_phase", "frame_period", "control_phase", "angle_sag")))
    return [Setting(bench.setting.logs, model, {"electronics.bridge_gain": factor * mean}, lost, nuisance)
            for factor in (0.3, 1.0, 3.0)]


def clocks(more: Sequence[str]) -> Callable[[TrialBench], Sequence[Setting]]:
    """Return the setting with further nuisances of pulses."""
    def settings(bench: TrialBench) -> Sequence[Setting]:
        nuisance = tuple(dict.fromkeys((*bench.old.nuisance, *more)))
        if set(more) <= set(bench.old.nuisance) or not has_pulses(bench.setting.model):
            return ()
        return [replace(bench.setting, nuisance=nuisance)]
    return settings


def stretched(bench: TrialBench) -> Sequence[Setting]:
    """Return the setting whose samples are as far apart as pulses, or a whole multiple, where they nearly are."""
    period = bench.cases[0].period
    if not period:
        return ()
    step = float(np.median([np.median(np.diff(log.time)) for log in bench.setting.logs]))
    ratio = step / period if step > period else period / step
    off = ratio / round(ratio) if step > period else round(ratio) / ratio
    if not _EXACT < abs(off - 1.0) < _OFF:
        return ()
    logs = tuple(replace(log, time=log.time[0] + (log.time - log.time[0]) / off) for log in bench.setting.logs)
    nuisance = tuple(name for name in bench.old.nuisance if name != "frame_period")
    return [replace(bench.setting, logs=logs, nuisance=nuisance, afresh=True)]


def backlash(bench: TrialBench) -> Sequence[Setting]:
    """Return settings with play between motor and output, whose own inertia is a small share."""
    inertia = nominal(bench.setting.model.servo, "output_inertia")
    if not inertia:
        return ()
    own = {} if bench.setting.model.servo.get("gear.output_inertia") else {"gear.output_inertia": 0.05 * inertia}
    return [replace(one, afresh=True)  # the fit has bent inertia and friction
            for one in numbers(({"gear.backlash": 0.006}, {"gear.backlash": 0.02}), own, price=3.0)(bench)]


TABLE: tuple[Candidate, ...] = (
    Candidate("frame phase", "pulses that come at other times than the log's samples", 'nuisance "frame_phase"',
              clocks(("frame_phase",))),
    Candidate("frame period", "pulses of another period", 'nuisance "frame_period"',
              clocks(("frame_phase", "frame_period"))),
    Candidate("stamps", "stamps that run at another rate: samples and pulses would be in step", "check the clock that "
              "stamps the samples, or the sampling rate", stretched),
    Candidate("rounded commands", "commands that were rounded on their way", "record what is sent, or send more finely",
              rounded),
    Candidate("P register", "another gain of the loop than registers or logs say", "read the register for P back, or "
              "search firmware.proportional_gain", wrong_gain),
    Candidate("bent potentiometer", "a potentiometer that is not linear", "measure some angles by hand, and give "
              "potentiometer.linearity_angle and linearity_error", bent),
    Candidate("minimum drive time", "a minimum drive time of the chip", "search electronics.minimum_drive_time",
              numbers(({"electronics.minimum_drive_time": 2e-4}, {"electronics.minimum_drive_time": 8e-4}))),
    Candidate("coast", "a bridge that opens between pulses where the file brakes, or brakes where it opens",
              "turn electronics.off_state", turned),
    Candidate("directed friction", "friction that differs by direction",
              "search friction.coulomb_torque_forward and friction.coulomb_torque_backward", directed),
    Candidate("viscous friction", "viscous friction", "search motor.motor_viscous_friction",
              numbers(({"motor.motor_viscous_friction": 1e-7}, {"motor.motor_viscous_friction": 1e-6}))),
    Candidate("voltage", "another supply voltage", f"measure the voltage, or search {_VOLTAGE}",
              scaled(_VOLTAGE, (0.8, 0.9, 1.1, 1.25))),
    Candidate("load", "another load than the logs say", "weigh the load and measure its arm", heavier),
    Candidate("breakaway", "friction that holds more at rest than in motion", "search friction.breakaway_ratio",
              numbers(({"friction.breakaway_ratio": 1.3}, {"friction.breakaway_ratio": 1.8}))),
    Candidate("digital", "acts like a digital servo: a drive in proportion to the error, without pulses",
              "model BoundedServo without a deadband", like_digital),
    Candidate("play at the potentiometer", "play between output and potentiometer", "search potentiometer.backlash",
              numbers(({"potentiometer.backlash": 0.006}, {"potentiometer.backlash": 0.02}), price=3.0)),
    Candidate("load friction", "friction that grows with the load", "search friction.load_friction, or climb the "
              "friction ladder", numbers(({"friction.load_friction": 0.08}, {"friction.load_friction": 0.25}),
                                         price=10.0)),
    Candidate("play", "play in the gear", "search gear.backlash, with gear.output_inertia above 0", backlash),
)
"""The candidates, the cheap first; of candidates that gain alike the earlier one is named first."""


def possible(candidate: Candidate, bench: TrialBench) -> Sequence[Setting]:
    """Return the settings of a candidate; none where the servo does not allow it."""
    try:
        return candidate.settings(bench)
    except ServotwinError:
        return ()


def mended_logs(bench: TrialBench, mended: Mapping[str, Log]) -> Sequence[Setting]:
    """Return the setting with the logs that a finding has mended."""
    logs = tuple(mended.get(log.name, log) for log in bench.setting.logs)
    if all(a is b for a, b in zip(logs, bench.setting.logs, strict=True)):
        return ()
    return [replace(bench.setting, logs=logs, afresh=True)]


# --- Two servos, or one before and after something happened, among the logs -------------------------------------------

_SERVOS_LOGS = 8  # among which two groups are sought


def two_servos(bench: TrialBench) -> Told | None:
    """Return what two sets of numbers gain over one, for the two groups of logs that differ most."""
    if len(bench.task.fitted) < 4:
        return None
    every = bench.task.fitted
    spread = [every[i * len(every) // min(len(every), _SERVOS_LOGS)] for i in range(min(len(every), _SERVOS_LOGS))]
    bench = TrialBench(bench.task, bench.whole, spread, bench.purse, bench.noise)
    logs = bench.setting.logs
    one, other = _groups(bench)
    residuals: list[Array] = [np.zeros(0)] * len(logs)
    for group in (one, other):
        there = bench.apart(group)
        for k in group:
            residuals[k] = there[k]
    if not all(np.isfinite(r).all() for r in residuals):
        return None
    named = ", ".join(logs[k].name for k in min(one, other, key=len))
    return Told("two servos", f"two servos among the logs, or one that changed: {named} and the others, fitted apart",
                "fit these logs apart", gain(bench.base.residuals, residuals, bench.noise))


def mixed_gains(bench: TrialBench) -> Told | None:
    """Return what another P in some of the logs gains."""
    said = [log.parameters.get(GAIN) for log in bench.setting.logs]
    setting = own_gains(bench)
    if setting is None:
        return None
    trial = bench.searched(setting, bench.base.point)
    if not all(np.isfinite(r).all() for r in trial.residuals):
        return None
    usual = bench.setting.model.value_or(GAIN, 0.0)
    other = [log.name for log, before in zip(setting.logs, said, strict=True)
             if log.parameters.get(GAIN, usual) != (usual if before is None else before)]
    return Told("P register", f"another gain of the loop in some logs than they say: {', '.join(other)}", "read the "
                "register for P back before each run", gain(bench.base.residuals, trial.residuals, bench.noise))


def _groups(bench: TrialBench) -> tuple[list[int], list[int]]:
    """Return the two groups, of two logs at least, whose own one-step estimates explain most."""
    forecast, point = bench.base.forecast, bench.base.point
    search = bench.search(forecast)
    parts = forecast.at(point)
    pieces = []
    for rows in bench.task_of(forecast).rows(point, parts):
        pieces.append((rows.slope.T @ rows.slope, rows.slope.T @ rows.score))
    size = len(pieces[0][1])
    hold = np.diag(np.where(search.held, 1e12, 1.0))

    def explained(group: tuple[int, ...] | list[int]) -> float:
        H = sum((pieces[k][0] for k in group), np.zeros((size, size))) + hold
        g = sum((pieces[k][1] for k in group), np.zeros(size))
        return float(g @ np.linalg.solve(H, g))

    everything = range(len(pieces))
    splits = [(list(group), [k for k in everything if k not in group])
              for count in range(2, len(pieces) // 2 + 1) for group in combinations(everything, count)]
    return max(splits, key=lambda split: explained(split[0]) + explained(split[1]))


# --- Holds ------------------------------------------------------------------------------------------------------------
Array = NDArray[np.float64]
_IMITATED = 0.05  # of an effect: with less of it left nothing says how large it is
_LIKELY = 0.2  # of what is left: what a candidate explains that is asked alone
_SIZES = ("minimum drive time", "coast", "viscous friction", "breakaway", "play at the potentiometer", "load friction",
          "play", "bent potentiometer")  # what the shape of an effect is known of


def moved(bench: TrialBench, half: Mapping[str, float], named: str = "") -> dict[str, tuple[float, str]]:
    """Return by how many half widths of its interval each number would be off, and by what, if that were missing.

    Every candidate is as large as what is left lets it be; one that is named, or explains what is left, counts alone.

    Parameters
    ----------
    bench : TrialBench
    half : mapping of str to float
        Half widths of the intervals, on the scale of the search.
    named : str
        The cause that a trial found.
    """
    known = {one.name for one in assumptions(bench.task.forecast, bench.whole)}  # intervals allow for these already
    settings = [(one.name, several[0]) for one in TABLE if one.name in _SIZES and (several := possible(one, bench))
                and (one.name == named or not set(several[0].values) <= known)]
    r, J = _slopes(bench)
    names = (*bench.old.space.names, *bench.old.extra)
    asked = {k: name for k, name in enumerate(names) if half.get(name, 0.0) > 0.0}
    effects = [one for name, setting in settings if (one := _effect(bench, name, setting, r, J)) is not None]
    likely = ([one for one in effects if one.candidate == named]
              or [one for one in effects if one.share >= _LIKELY] or effects)
    found = {}
    for k, name in asked.items() if likely else ():
        worst = max(likely, key=lambda one: abs(one.shift[k]))
        found[name] = float(abs(worst.shift[k])) / half[name], worst.candidate
    return found


class _Effect(NamedTuple):
    """By how much a candidate would move the numbers of a fit (scaled), and which share of what is left it explains."""

    candidate: str
    shift: Array
    share: float


def _effect(bench: TrialBench, name: str, setting: Setting, r: Array, J: Array) -> _Effect | None:
    """Return what a candidate would do; None if that cannot be determined."""
    try:
        d = _residuals(bench, setting) - r
    except ServotwinError:
        return None
    if len(d) != len(r) or not np.isfinite(d).all() or not float(r @ r) > 0.0:
        return None
    x: Array = np.asarray(np.linalg.lstsq(J, d, rcond=1e-10)[0])
    e = d - J @ x
    power = float(e @ e)
    if power <= _IMITATED**2 * float(d @ d):
        return None
    size = -float(e @ r) / power
    share = size**2 * power / float(r @ r) if size > 0.0 else 0.0
    times = size if share >= _LIKELY else math.sqrt(float(r @ r) / power)
    return _Effect(name, np.asarray(x * times), share)


def _slopes(bench: TrialBench) -> tuple[Array, Array]:
    """Return residuals and derivatives of all logs at the base, also where nothing teaches."""
    forecast = bench.base.forecast
    seen, forecast.seen = forecast.seen, None
    parts = forecast.at(bench.base.point)
    forecast.seen = seen
    return np.concatenate([part.residual for part in parts]), joined(parts)


def _residuals(bench: TrialBench, setting: Setting) -> Array:
    """Return the residuals of all logs with a setting at its start, in the noise of the base.

    Raises
    ------
    InputError
        If the model cannot follow the logs so.
    """
    forecast = bench.forecast(setting)
    forecast.noise, forecast.seen = dict(bench.base.forecast.noise), None
    parts = forecast.at(bench.start(forecast, setting, bench.base.point), derivatives=False)
    return np.concatenate([part.residual for part in parts])


# --- The trials -------------------------------------------------------------------------------------------------------
Try = Callable[[TrialBench], Told | None]
_LOGS = 4  # that are tried
_EXPLAINED = 1.2  # times the sensor's noise: then nothing else is tried
_ALIKE = 1.05  # times the least error: then the simpler is named first
_MOST = 5  # causes that are reported
_SHARES = 2.0  # of what is left for a group: what one trial may take
_KINDS = {"stamps": ("stamps", "stamps that run at another rate than the servo", 'mend=("stamps",)'),
          "rows": ("dropped samples", "rows that are missing", 'mend=("rows",)'),
          "not followed": ("not followed", "commands that the servo did not follow", 'mend=("not followed",)')}
_SPECIAL: dict[str, Try] = {
    "mixed P register": mixed_gains, "supply that changes": changing_supply, "warming": warming,
    "two servos": two_servos}
"""Candidates that are tried in ways of their own."""
_EVENTS: dict[str, Try] = {"dropped samples": dropped_samples, "lost pulses": lost_pulses}
"""Those that explain a part of whatever is missing: tried where nothing else explains what they would have to."""


class Diagnosis(NamedTuple):
    """Causes, the best first; by how many half widths what may be missing would move each number, and what that is."""

    causes: tuple[Cause, ...]
    moved: Mapping[str, tuple[float, str]]


def diagnose(task: Task, point: Point, traces: Sequence[Trace], verdict: Verdict, sensor: str, budget: float,
             half: Mapping[str, float], tell: Callable[[float, str], None]) -> Diagnosis:
    """Return what explains the residuals of a fit, the best first; nothing that gains no more than chance.

    Beside it, what may be missing would do to the intervals.

    Parameters
    ----------
    task : Task
    point : Point
        Where the fit ended.
    traces : sequence of Trace
        Of all logs.
    verdict : Verdict
    sensor : str
        The angle's name.
    budget : float
        Limit of simulation, in seconds of one lane of closed form.
    half : mapping of str to float
        Half widths of the intervals, on the scale of the search.
    tell : callable
        Called with the share done, and what is tried.
    """
    noise = verdict.noise[sensor]
    purse = Purse(budget)
    try:
        bench = TrialBench(task, point, _chosen(task, traces), purse, noise)
    except (Spent, ServotwinError):
        return Diagnosis((), {})
    found: list[tuple[Cause, int]] = []
    groups = _ordered(bench, traces)
    count, k, left = sum(map(len, groups)), 0, purse.left
    for group in groups:
        if group is groups[-1] and any(cause.after < MOST_LEFT * cause.before for cause, _ in found):
            break
        # No group can use up what the next one needs, and no trial what those after it need
        allowed = left if group is groups[-1] else 0.5 * left
        for waiting, (name, try_it) in zip(range(len(group), 0, -1), group, strict=True):
            purse.left = given = min(_SHARES / waiting, 1.0) * allowed
            tell(max(k / count, min(1.0 - left / budget, 1.0)), f"trying: {name}")
            told = _told(bench, try_it)
            k += 1
            if told is not None and told.gain.counts:
                found.append((_cause(told, sensor), k))
                if told.gain.after < _EXPLAINED * noise:
                    return _diagnosis(bench, found, half)
            left, allowed = left - given + purse.left, allowed - given + purse.left
    return _diagnosis(bench, found, half)


def _diagnosis(bench: TrialBench, found: Sequence[tuple[Cause, int]], half: Mapping[str, float]) -> Diagnosis:
    causes = _ranked(found)
    try:
        return Diagnosis(causes, moved(bench, half, causes[0].name if causes else ""))
    except (ServotwinError, np.linalg.LinAlgError):
        return Diagnosis(causes, {})


def _told(bench: TrialBench, try_it: Try) -> Told | None:
    """Return what a candidate gains; None of one that cannot be tried, or not to its end."""
    try:
        return try_it(bench)
    except (Spent, ServotwinError, np.linalg.LinAlgError):
        return None


def _ordered(bench: TrialBench, traces: Sequence[Trace]) -> list[list[tuple[str, Try]]]:
    """Return all candidates with what tries them: what checks suggest and is cheap, what is dear, changes, events."""
    cheap: list[tuple[str, Try]] = []
    dear: list[tuple[str, Try]] = []
    for candidate in (*_of_findings(bench, traces), *TABLE):
        settings = possible(candidate, bench)
        if settings:
            (dear if settings[0].price > DEAR else cheap).append(
                (candidate.name, partial(_tried, candidate=candidate, settings=settings)))
    return [cheap, dear, list(_SPECIAL.items()), list(_EVENTS.items())]


def _chosen(task: Task, traces: Sequence[Trace]) -> list[int]:
    """Return the logs that are tried: of every kind of motion the one that is furthest off, then others."""
    fitted = sorted(task.fitted, key=lambda k: -float(np.mean(traces[k].residual**2)))
    first: dict[str, int] = {}
    for k in fitted:
        first.setdefault(traces[k].log.motion, k)
    chosen = list(first.values())[:_LOGS]
    return sorted([*chosen, *(k for k in fitted if k not in chosen)][:_LOGS])


def _of_findings(bench: TrialBench, traces: Sequence[Trace]) -> list[Candidate]:
    """Return the candidates that the checks of the logs suggest."""
    seen = findings([trace.log for trace in traces], bench.setting.model)
    made = []
    for kind, (name, words, remedy) in _KINDS.items():
        mended = {one.log: one.mended for one in seen if one.kind == kind and one.mended is not None}
        if mended:
            made.append(Candidate(name, words, remedy, partial(mended_logs, mended=mended)))
    return made


def _tried(bench: TrialBench, candidate: Candidate, settings: Sequence[Setting]) -> Told | None:
    """Return what a candidate gains, searched from the most promising of its settings; None if none promises enough."""
    promising = _promising(bench, settings)
    if not any(map(bench.may_gain, settings)) and not any(map(bench.gains_soon, promising)):
        return None
    trials = [bench.searched(setting, bench.base.point) for setting in promising]
    try:
        trials += [bench.afresh(setting) for setting in promising if setting.afresh]
    except Spent:
        pass  # what was searched from the fit counts
    good = [trial for trial in trials if all(np.isfinite(r).all() for r in trial.residuals)]
    if not good:
        return None
    gained = gain(bench.base.residuals, min(good, key=bench.left).residuals, bench.noise)
    return Told(candidate.name, candidate.words, candidate.remedy, gained)


def _promising(bench: TrialBench, settings: Sequence[Setting]) -> Sequence[Setting]:
    if len(settings) < 2:
        return settings
    costs = [bench.promise(setting) for setting in settings]
    return [settings[int(np.argmin(costs))]] if np.isfinite(costs).any() else []


def _cause(told: Told, sensor: str) -> Cause:
    sentence = (f"{told.words}: on parts of the logs that the trial did not see the error falls from "
                f"{shown(told.gain.before, sensor)} to {shown(told.gain.after, sensor)} ({told.remedy})")
    return Cause(told.name, sentence, told.gain.before, told.gain.after, told.remedy)


def _ranked(found: Sequence[tuple[Cause, int]]) -> tuple[Cause, ...]:
    """Return causes by the share of the error that they leave; of those alike the earlier of the table first."""
    left = sorted(found, key=lambda one: -one[0].gain)
    ranked: list[Cause] = []
    while left:
        least = 1.0 - left[0][0].gain
        alike = [one for one in left if 1.0 - one[0].gain <= _ALIKE * least]
        ranked += [cause for cause, _ in sorted(alike, key=lambda one: one[1])]
        left = [one for one in left if one not in alike]
    return tuple(ranked[:_MOST])
