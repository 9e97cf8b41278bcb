"""The last stage of a fit: its verdict, and where that is bad the trials of what may be the matter."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import PlausibilityWarning
from servotwin.identification.fitting.arrow import Prior
from servotwin.identification.fitting.assumptions import WANTED
from servotwin.identification.fitting.comparison import SLEW
from servotwin.identification.fitting.diagnosis import diagnose
from servotwin.identification.fitting.diagnosis.counted import counted_stamps
from servotwin.identification.fitting.fit import Fit, Trace
from servotwin.identification.fitting.held_out import trace_of
from servotwin.identification.fitting.noise import SensorSeries, noise_of
from servotwin.identification.fitting.point import Point
from servotwin.identification.fitting.stopping import Course
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import Rows, rows_of
from servotwin.identification.fitting.verdict import (
    UNHELD,
    Cause,
    Rival,
    Verdict,
    against,
    intervals_said,
    judge,
    rival,
    shown,
)
from servotwin.logs.log import ANGLES

Array = NDArray[np.float64]

_OUTLIERS = 0.005  # of the samples: then they are told
_FINEST = 1e-9  # SI: what no simulation is told to be nearer
_EFFORT = 3.0  # times that of the fit, for all trials: the verdict itself and their start are not counted


def with_verdict(task: Task, point: Point, fit: Fit, course: Course, slew: Mapping[int, Array], *,
                 trials: bool) -> Fit:
    """Return a fit with its verdict, and with the causes that explain a bad one.

    Parameters
    ----------
    task : Task
    point : Point
        Where it ended.
    fit : Fit
    course : Course
        Told the share done, and what goes on.
    slew : mapping of int to ndarray
        What delay, slew and lag leave where each log is judged (SI); none where there is no such model beside.
    trials : bool
        Whether causes are tried.
    """
    effort = task.forecast.work
    fitted = [trace for trace in fit.traces if not trace.held_out]
    sensors = {trace.signal for trace in fitted}
    if len(sensors) != 1:
        return fit
    sensor = sensors.pop()
    verdict = judge([_series(trace) for trace in fitted], sensor, _rows(task, point), len(fit.names),
                    max(task.forecast.running.accuracy, _FINEST))
    verdict = against(replace(verdict, noise={**verdict.noise, **_others(task)}),
                      _rival(fit.traces, slew, verdict.noise[sensor]), sensor)
    causes: tuple[Cause, ...] = ()
    try:
        if trials:
            causes = _outliers(verdict, fitted, sensor)
        if trials and (verdict.undecided or not verdict.holds):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PlausibilityWarning)  # what a trial tries is nobody's word
                found = diagnose(task, point, fit.traces, verdict, sensor, _EFFORT * effort, _half_widths(fit),
                                 lambda share, text: course(0.96 + 0.04 * share, text))
            causes, verdict = (*causes, *found.causes), replace(verdict, moved=found.moved)
            if not causes and not verdict.holds and (counted := counted_stamps(fitted, sensor, verdict.noise[sensor])):
                causes = (counted,)
    except KeyboardInterrupt:
        trials, fit = False, replace(fit, warnings=("stopped: not all causes were tried", *fit.warnings))
    if verdict.undecided and any(cause.name != "outliers" for cause in causes):
        # What a number of the model tells of samples that it was not fitted to is no noise
        verdict = replace(verdict, holds=False, sentence=f"residuals are {verdict.ratio:.2g} times the noise of "
                          f"{shown(verdict.noise[sensor], sensor)} that neighbours show, and follow a better model: "
                          f"this one lacks something; {UNHELD}")
    said = intervals_said(verdict.moved, sought=bool(fit.ends))
    verdict = replace(verdict, sentence=verdict.sentence.replace(UNHELD, said))
    verdict = replace(verdict, causes=causes, sentence=_with_causes(verdict, causes, tried=trials))
    if not verdict.holds or verdict.undecided:
        return replace(fit, verdict=verdict, warnings=(verdict.sentence, *fit.warnings))
    wanted = [f"the logs want {one.words} {one.mean:.2g} ± {one.std:.1g}{one.unit_shown} where {one.assumed:z.3g} is "
              f"assumed ({one.wanted:.2g} standard errors): intervals allow for it"
              for one in fit.assumptions if one.wanted > WANTED]
    return replace(fit, verdict=verdict, warnings=(*fit.warnings, *wanted))


def leaves_noise(task: Task, point: Point) -> bool:
    """Tell whether what a point leaves of its fitted logs is noise of one sensor, without trials."""
    parts = task.forecast.at(point, derivatives=False, cases=task.fitted)
    fitted = [trace_of(task.forecast, point, k, part, held_out=False)
              for k, part in zip(task.fitted, parts, strict=True)]
    sensors = {trace.signal for trace in fitted}
    if len(sensors) != 1:
        return False
    verdict = judge([_series(trace) for trace in fitted], sensors.pop(), _rows(task, point), task.forecast.size,
                    max(task.forecast.running.accuracy, _FINEST))
    return verdict.holds and not verdict.undecided


def _rival(traces: Sequence[Trace], slew: Mapping[int, Array], noise: float) -> Rival | None:
    """Return how delay, slew and lag stand beside the fit: on the logs that were held out, else on those fitted."""
    held_out = any(trace.held_out for trace in traces)
    judged = {k: trace for k, trace in enumerate(traces) if trace.held_out is held_out and k in slew}
    if not judged:
        return None
    pairs = []
    for k, trace in judged.items():
        known = np.isfinite(slew[k])
        pairs.append((trace.residual[trace.judged][known], slew[k][known]))
    step = float(np.median(np.concatenate([np.diff(trace.time) for trace in judged.values()])))
    return rival(SLEW, pairs, step, noise, held_out=held_out)


def _half_widths(fit: Fit) -> dict[str, float]:
    """Return the half widths of the intervals by name, on the scale of the search."""
    if fit.doubt is None:
        return {}
    return {fit.names[k]: 0.5 * (ends.upper - ends.lower) * float(fit.doubt.std[k]) for k, ends in fit.ends.items()
            if fit.names[k] not in fit.spans}


def _with_causes(verdict: Verdict, causes: Sequence[Cause], *, tried: bool) -> str:
    if verdict.holds or not tried:
        return verdict.sentence
    if not causes:
        return f"{verdict.sentence}; none of the causes that were tried explains it"
    return f"{verdict.sentence}; what explains most is {causes[0].sentence}"


def _outliers(verdict: Verdict, traces: Sequence[Trace], sensor: str) -> tuple[Cause, ...]:
    """Return samples that lie far off alone as a cause, without any trial."""
    if verdict.outliers < _OUTLIERS:
        return ()
    every = np.concatenate([trace.residual for trace in traces])
    before = float(np.sqrt(np.mean(every**2)))
    after = verdict.ratio * verdict.noise[sensor]
    if after >= before:
        return ()  # they are the least of what is left
    return (Cause("outliers", f"outliers: {100.0 * verdict.outliers:.2g} % of the samples lie far off alone; without "
                  f"them the error is {shown(after, sensor)} instead of {shown(before, sensor)} (look for a loose "
                  "contact of the sensor; loss \"huber\" bears them)", before, after, "leave these samples out"),)


def _rows(task: Task, point: Point) -> list[Rows]:
    """Return what each fitted log says of the shared numbers."""
    forecast = task.forecast
    (parts,) = forecast.at_all([point], derivatives=True, cases=task.fitted, leading=True)
    return [rows_of(part, task.loss, Prior(*forecast.own_belief(forecast.cases[k])), point.own[k])
            for k, part in zip(task.fitted, parts, strict=True)]


def _others(task: Task) -> dict[str, float]:
    """Return the noise of sensors that are no angles, as far as neighbours show it (SI)."""
    found = {}
    for name in task.forecast.sensors:
        if name in ANGLES:
            continue
        cases = [case for case in (task.forecast.cases[k] for k in task.fitted) if name in case.places]
        flat = [SensorSeries(case.log, case.times[case.places[name]] + case.log.start, case.values[name],
                             np.zeros(len(case.values[name]))) for case in cases]
        if flat:
            found[name] = noise_of(flat).size
    return found


def _series(trace: Trace) -> SensorSeries:
    return SensorSeries(trace.log, trace.time, trace.measured, trace.simulated)
