"""`identify`: the parameters of a servo from its logs, with intervals, and with what the logs cannot say."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting import checks
from servotwin.identification.fitting.arrow import Loss, Outcome, Prior, Search
from servotwin.identification.fitting.comparison import BESIDE, compare
from servotwin.identification.fitting.fit import Fit, Start, Trace
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.free import Bounds, Priors, Space
from servotwin.identification.fitting.holdout import split
from servotwin.identification.fitting.intervals import Ends, ends
from servotwin.identification.fitting.point import FINE, NUISANCES, SHARED, Point
from servotwin.identification.fitting.record import identified_servo, with_record, with_what_logs_say
from servotwin.identification.fitting.remedies import with_remedies
from servotwin.identification.fitting.task import HUBER, Task, by_sensor
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, rows_of, uncertainty
from servotwin.identification.fitting.words import Unidentifiable, explain, vague_directions
from servotwin.identification.logs.log import Log
from servotwin.models import Model
from servotwin.parameters import Servo

Array = NDArray[np.float64]
Progress = bool | Callable[[float, str], object]

NUISANCE = ("delay", "angle_offset", "initial_state")


def identify(
    logs: Sequence[Log] | str | Path, servo: Servo, model: type[Model] | None = None,
    free: Sequence[str] | None = None, nuisance: Sequence[str] = NUISANCE, priors: Priors | str | None = "servo",
    *, bounds: Bounds | None = None, holdout: float | Sequence[str] | None = None, sensors: Sequence[str] | None = None,
    starts: int = 3, loss: str = "huber", noise: Mapping[str, float] | None = None, level: float = 0.95,
    intervals: bool = True, compare_with: Sequence[str] = ("slew", "M1"), seed: int = 0, progress: Progress = False,
) -> Fit:
    """Fit parameters of a servo to logs.

    Multi-start bounded nonlinear least squares on the exact engine, with robust loss; the Jacobian comes from copies of
    the servo that differ a little, run in one batch. The result is the same for the same arguments.

    Parameters
    ----------
    logs : sequence of Log, or path
        A path is read by `read_logs`.
    servo : Servo
        Gives what is not searched, and where the search begins.
    model : type of Model, optional
        `PulseServo`, `PulseServoInductive` or `BoundedServo`; the one that stands for the servo
        (`models.default_class`) unless given.
    free : sequence of str, optional
        What is searched: dotted names of servo and load, and the lumped names `output_torque_constant` (motor and
        back-EMF constant times the gear reduction), `output_inertia`, `output_coulomb_torque`.
    nuisance : sequence of str
        Of "delay" (the command acts so much later), "log_delay" (what each log adds to it), "angle_offset" (measured
        less true angle), "angle_sag" (the measured angle moves with the bus voltage) and "initial_state" (each log's
        start; else the servo stands where its first command says).
    priors : "servo", mapping or None
        Normal beliefs, mean and standard deviation by name (SI); "servo" takes the spread that the servo file states.
    bounds : mapping, optional
        Lowest and highest value by name (SI); random starts fill them. Wide ones unless given.
    holdout : float or sequence of str, optional
        Share of logs of each kind of motion, or names, that are not fitted but predicted; a fourth of each kind with
        four logs or more unless given; 0: none.
    sensors : sequence of str, optional
        Measured signals that are fitted; the angle and all currents unless given.
    starts : int
        How many searches: one from the servo's values, the others from random ones.
    loss : {"huber", "squares"}
        Huber: residuals of more than 1.345 times the noise count in proportion, not squared.
    noise : mapping, optional
        Standard deviation of what each sensor's residuals scatter (SI); estimated unless given.
    level : float
        Of the intervals.
    intervals : bool
        False leaves them out, which is faster.
    compare_with : sequence of str
        Simpler models that are fitted to the same logs and stand beside: "slew" (delay, slew limit and lag), "M1"
        (this model with Coulomb and viscous friction only).
    seed : int
        Of random starts and of what is held out.
    progress : bool or callable
        True shows a bar with the time left; a callable is called with the share that is done and what goes on.

    Returns
    -------
    Fit
        After an interrupt (Ctrl-C, or a KeyboardInterrupt out of `progress`) the best so far, without intervals.

    Raises
    ------
    InputError
        On bad input: no log that moves, a name that is unknown or not read, a log that contradicts the servo.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = st.Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...              measured={"output_angle": run["output_angle"]})
    >>> fit = st.identify([log], servo.replace({"motor.rotor_inertia": 5e-8}), free=["motor.rotor_inertia"],
    ...                   nuisance=(), priors=None, starts=1, compare_with=())
    >>> abs(fit.servo.motor.rotor_inertia / servo.motor.rotor_inertia - 1.0) < 1e-3
    True
    """
    began = clock.monotonic()
    given = checks.checked_logs(logs)
    plain = checks.checked_servo(servo, model)
    checks.check_speeds(given, plain)
    names = checks.usual_free(plain) if free is None else checks.checked_list("free", free)
    beside = checks.checked_words("compare_with", compare_with, BESIDE)
    level, seed = checks.checked_level(level), checks.checked_count("seed", seed, least=0)
    seen = checks.checked_sensors(given, sensors, plain)
    space = Space(plain, names, bounds=bounds, priors=priors, load=checks.shared_load(given, names))
    fitted, held_out = split(given, holdout, seed)
    forecast = Forecast(given, plain, space, checks.checked_words("nuisance", nuisance, NUISANCES), seen)
    checks.check_fitted(given, fitted, seen, len(names) + len(nuisance))
    task = Task(forecast, Loss(checks.checked_loss(loss, HUBER)), fitted, seed,
                checks.checked_count("starts", starts, least=1), checks.checked_noise(noise, seen))
    with checks.shown(progress) as show:
        fit = _run(task, held_out, beside, level, show, intervals=intervals)
    return with_record(replace(fit, seconds=clock.monotonic() - began), given, fitted)


def _run(task: Task, held_out: Sequence[int], beside: tuple[str, ...], level: float, show: Callable[[float, str], None],
         *, intervals: bool) -> Fit:
    """Search, doubt, and compare; an interrupt ends the stage that it meets and leaves the others out."""
    forecast, interrupted = task.forecast, False
    try:
        found, ended = task.search(lambda share, text: show(0.75 * share, text))
    except KeyboardInterrupt:
        found, ended, interrupted = task.best_so_far(), [], True
    doubt = None
    reaching: dict[int, Ends] = {}
    vague: tuple[Unidentifiable, ...] = ()
    try:
        if intervals and not interrupted:
            show(0.76, "intervals")
            doubt, reaching, vague = _doubts(task, found, level, show)
    except KeyboardInterrupt:
        interrupted = True
    traces = _traces(forecast, found.point, held_out)
    final = identified_servo(forecast.model.servo, forecast.space, found.point.shared, doubt, reaching, level)
    final = with_what_logs_say(final, [forecast.cases[k].log for k in task.fitted], forecast.space.names)
    try:
        show(0.95, "errors")
        tables = compare(task, held_out, traces, final, () if interrupted else beside,
                         lambda: show(0.95, "errors of simpler models"))
    except KeyboardInterrupt:
        interrupted, tables = True, compare(task, held_out, traces, final, ())
    fit = _fit(task, found, doubt, reaching, vague, task.at_bound(found), final, traces, tables, ended)
    return replace(fit, level=level, interrupted=interrupted)


def _doubts(task: Task, found: Outcome, level: float, show: Callable[[float, str], None],
            ) -> tuple[Uncertainty, dict[int, Ends], tuple[Unidentifiable, ...]]:
    """Return covariance, ends of the intervals, and what is not determined."""
    forecast = task.forecast
    parts = forecast.at(found.point, central=True, cases=task.fitted)
    beliefs = [Prior(*forecast.own_belief(forecast.cases[k])) for k in task.fitted]
    rows: list[Rows] = [rows_of(part, task.loss, own, found.point.own[k])
                        for k, part, own in zip(task.fitted, parts, beliefs, strict=True)]
    stuck = task.at_bound(found)
    x, searched = found.point.shared, forecast.space.parameters
    sizes = np.maximum(np.abs(x), 1.0)
    sizes[:len(searched)][[p.logarithmic for p in searched]] = 1.0
    doubt = uncertainty(rows, task.prior, stuck)
    flags, directions = vague_directions(_information(task, found, beliefs), doubt.inflation, sizes)
    if flags.any():
        doubt = uncertainty(rows, task.prior, stuck, directions)
    names = (*forecast.space.names, *forecast.extra)
    shares = [*forecast.space.shares(found.point.shared), *([math.nan] * len(forecast.extra))]
    vague = explain(names, shares, flags, directions)
    which = [k for k in range(len(names)) if not flags[k] and not stuck[k]]
    search = Search(forecast, task.loss, task.prior, task.lower, task.upper, task.fitted, held=stuck)
    count = max(len(which), 1)
    reaching = ends(search, found, doubt, which, level, rows=rows,
                    tell=lambda done: show(0.76 + 0.18 * done / count, "intervals"))
    return doubt, reaching, with_remedies(forecast, found.point, vague, names)


def _information(task: Task, found: Outcome, beliefs: Sequence[Prior]) -> Array:
    """Return what the logs say of the shared numbers, from differences so fine that what has no effect has none."""
    parts = task.forecast.at(found.point, step=FINE, cases=task.fitted)
    rows = [rows_of(part, task.loss, own, found.point.own[k])
            for k, part, own in zip(task.fitted, parts, beliefs, strict=True)]
    return np.asarray(np.sum([(r.slope * r.inside[:, None]).T @ r.slope for r in rows], axis=0))


def _traces(forecast: Forecast, point: Point, held_out: Sequence[int]) -> tuple[Trace, ...]:
    """Return every log beside the simulation; a log that was held out starts as it was measured."""
    traces = []
    for k, part in enumerate(forecast.at(point, derivatives=False)):
        case = forecast.cases[k]
        residuals = by_sensor(forecast, k, part)
        name = next(name for name in case.places if name in ("output_angle", "feedback_voltage"))
        measured = case.values[name]
        traces.append(Trace(case.log, k in set(held_out), name, case.log.time[0] + case.times[case.places[name]],
                            measured, measured + residuals[name]))
    return tuple(traces)


def _fit(task: Task, found: Outcome, doubt: Uncertainty | None, reaching: Mapping[int, Ends],
         vague: tuple[Unidentifiable, ...], stuck: NDArray[np.bool_], servo: Servo, traces: tuple[Trace, ...],
         tables: Any, ended: Sequence[Outcome]) -> Fit:
    forecast, space = task.forecast, task.forecast.space
    names = (*space.names, *forecast.extra)
    scales = {name: scale for name, (scale, _) in SHARED.items()}
    x = found.point.shared
    slopes = np.concatenate([space.slopes(x), [scales[name] for name in forecast.extra]])
    values = np.concatenate([space.values(x[None, :len(space)])[0],
                             x[len(space):] * [scales[name] for name in forecast.extra]])
    covariance = np.full((len(names), len(names)), np.nan)
    if doubt is not None:
        known = np.ix_(list(reaching), list(reaching))
        covariance[known] = (doubt.covariance * np.outer(slopes, slopes))[known]
    units = {p.name: p.unit for p in space.parameters} | {name: unit for name, (_, unit) in SHARED.items()}
    return Fit(
        servo=servo, model=type(forecast.model)(servo), names=names,
        estimates={name: float(value) for name, value in zip(names, values, strict=True)},
        units={name: units[name] for name in names}, covariance=covariance, unidentifiable=vague,
        at_bound=tuple(name for name, at in zip(names, stuck, strict=True) if at),
        holdout=tables.holdout, training=tables.training, traces=traces,
        starts=tuple(Start(outcome.cost, outcome.converged) for outcome in ended), noise=dict(forecast.noise),
        cost=found.cost, warnings=checks.warnings_of(task.prior, found.point, doubt, space, tables), space=space,
        best=x, doubt=doubt, ends=dict(reaching), scales={n: scales[n] for n in forecast.extra})
