"""Simpler models beside a fit, fitted to the same logs: delay, slew and lag; Coulomb and viscous friction only."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import DELAY_SCALE, STEP, LogPart, Point, latency, widest
from servotwin.identification.fitting.search.forecast import Forecast, LogLanes
from servotwin.identification.fitting.search.free import LUMPED
from servotwin.identification.fitting.search.least_squares import Begin, Loss, by_sensor
from servotwin.identification.fitting.search.phases import PulseChoice, Scan, settled
from servotwin.identification.fitting.search.task import Task
from servotwin.identification.fitting.slew_lag import fit_slew_lag
from servotwin.identification.fitting.traces import ErrorTable, ErrorTables, LogError, Trace, log_error
from servotwin.logs.log import ANGLES, Log
from servotwin.models import Model
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES

# --- Logs that are judged and not fitted ------------------------------------------------------------------------------

Array = NDArray[np.float64]


def trace_of(forecast: Forecast, point: Point, k: int, part: LogPart, *, held_out: bool, whole: bool = False) -> Trace:
    """Return a log beside its simulation; where pulses have a phase, the second half of one that was not fitted judges.

    Parameters
    ----------
    forecast, point
    k : int
        Which log.
    part : LogPart
        Residuals and derivatives of the log at that point.
    held_out : bool
        Whether it was not fitted.
    whole : bool
        Whether all samples judge nevertheless.
    """
    case = forecast.cases[k]
    name = next(name for name in ANGLES if name in case.places)
    times, measured = case.times[case.places[name]], case.values[name]
    lanes = LogLanes(forecast, k, 0, point, sides=0, step=STEP, rates=False, noise=forecast.noise)
    sent = lanes.bundle()
    searched = forecast.space.columns(lanes.x)
    late = held_out and forecast.phased and not whole
    own = dict(zip(forecast.names_of_own(case), point.own[k], strict=True))
    return Trace(
        log=case.log, held_out=held_out, signal=name, time=case.log.time[0] + times, measured=measured,
        simulated=measured + by_sensor(forecast, k, part)[name],
        judged=np.asarray(times >= 0.5 * case.log.duration) if late else np.ones(len(times), np.bool_),
        command=forecast.command_at(point, k),
        delay=forecast.nuisance_of(point.shared, "delay") + float(own.get("log_delay", 0.0)) * DELAY_SCALE
        - forecast.lead_at(point, k),
        parameters={key: float(values[0]) for key, values in sent.columns.items()
                    if key not in searched and key not in LOAD_NAMES},
        initial={key: float(values[0]) for key, values in sent.initial.items()}, offset=lanes.offset)


def with_pulses_of(forecast: Forecast, loss: Loss, point: Point, held_out: Sequence[int],
                   fitted: Sequence[int] = ()) -> Point:
    """Return the point with the pulses that the first halves of some logs tell.

    Parameters
    ----------
    forecast, loss
    point : Point
        Where a search of other logs ended.
    held_out : sequence of int
        Logs that are judged.
    fitted : sequence of int
        Logs whose pulses were found: how long commands wait for these is where the search begins.
    """
    if not forecast.phased or not held_out:
        return point
    there = Scan(forecast, loss, point)
    waits = [now.first * DELAY_SCALE - now.frames.phase + latency(forecast.cases[k].log, now.frames)
             for k in fitted for now in (there.now(k),)]
    period = forecast.nuisance_of(point.shared, "frame_period")
    choices = {}
    for k in held_out:
        case = forecast.cases[k]
        frames = widest(case.log, period or case.period)
        usual = float(np.median(waits)) if waits else latency(case.log, frames)
        choices[k] = PulseChoice(frames, (frames.phase + usual - latency(case.log, frames)) / DELAY_SCALE)

    def first_half(k: int) -> NDArray[np.bool_]:
        case = forecast.cases[k]
        return np.concatenate([case.times[place] < 0.5 * case.log.duration for place in case.places.values()])

    begun = Scan(forecast, loss, there.moved(choices), mask=first_half)
    told = [k for k in held_out if first_half(k).any()]
    if not told:
        return begun.point
    there = Scan(forecast, loss, settled(begun, told), mask=first_half)  # to first order so far
    return there.moved({k: trials[0].choice for k, trials in there.best({k: [there.now(k)] for k in told}).items()})


# --- Simpler models beside a fit, fitted to the same logs -------------------------------------------------------------

BESIDE = ("slew", "M1")
SLEW = "delay + slew + lag"
M1 = "M1"
_BEYOND_M1 = ("breakaway_ratio", "stribeck_speed", "stribeck_exponent", "load_friction", "load_friction_stribeck",
              "load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
              "load_friction_external_stribeck", "load_friction_motor_quad", "load_friction_external_quad")
_VISCOUS = "motor.motor_viscous_friction"


def compare(task: Task, held_out: Sequence[int], traces: Sequence[Trace], servo: Servo,
            beside: tuple[str, ...], point: Point, tell: Callable[[], object] = lambda: None) -> ErrorTables:
    """Return the errors of the fitted servo, log by log, and of the models beside it.

    Parameters
    ----------
    task : Task
        Of the fit.
    held_out : sequence of int
        Logs that it has not seen.
    traces : sequence of Trace
        Of all logs.
    servo : Servo
        The fitted one, where the simpler models begin.
    beside : tuple of str
        Of `BESIDE`.
    point : Point
        Where the fit ended.
    tell : callable, optional
        Called after each step of theirs.
    """
    model, fitted = task.forecast.model, task.fitted
    own = type(model).__name__
    errors: dict[str, dict[int, LogError]] = {own: {k: t.error for k, t in enumerate(traces)}}
    slew: dict[int, Array] = {}
    if "slew" in beside:
        slew = _of_slew([trace.log for trace in traces], fitted, traces, task.loss.limit)
        if slew:
            errors[SLEW] = {k: _error(traces[k], residual) for k, residual in slew.items()}
    if "M1" in beside:
        simple = _of_m1(task, held_out, traces, type(model)(servo), point, tell)
        if simple:
            errors[M1] = simple
    models = tuple(errors)
    training, holdout = (ErrorTable(models if which else (), {m: tuple(errors[m][k] for k in which) for m in models})
                         for which in (fitted, held_out))
    return ErrorTables(training, holdout, slew)


def _error(trace: Trace, residual: Array) -> LogError:
    """Return the error of a model on a log from its residuals where it is judged; those that are nan do not count."""
    known = np.isfinite(residual)
    if not known.any():
        return log_error(trace.log, np.array([math.nan]))
    return log_error(trace.log, residual[known], trace.measured[trace.judged][known])


def _of_slew(logs: Sequence[Log], fitted: Sequence[int], traces: Sequence[Trace], loss: float) -> dict[int, Array]:
    """Return the residuals of delay, slew and lag where each log is judged; none where there is no such model."""
    try:
        simple = fit_slew_lag([logs[k] for k in fitted], loss="linear" if math.isinf(loss) else "huber")
    except InputError:  # logs of several kinds of command or signal, or too few samples: there is no such model
        return {}
    found = {}
    for k, trace in enumerate(traces):
        log = logs[k]
        if simple.signal != trace.signal or simple.command_kind != log.command_kind:
            return {}
        predicted = np.asarray(simple.predict(log))
        found[k] = np.asarray(predicted[log.rows_at(trace.time)] - trace.measured)[trace.judged]
    return found


def _of_m1(whole: Task, held_out: Sequence[int], traces: Sequence[Trace], model: Model, point: Point,
           tell: Callable[[], object]) -> dict[int, LogError]:
    """Return the errors of the servo with Coulomb and viscous friction; none where it is that already."""
    space, logs = whole.forecast.space, [trace.log for trace in traces]
    beyond = [f"friction.{name}" for name in _BEYOND_M1]
    free = [name for name in space.names if name not in beyond]
    coulomb = LUMPED["output_coulomb_torque"][0]
    more = [] if any(name in free for name in ("output_coulomb_torque", *coulomb)) else ["output_coulomb_torque"]
    more += [] if _VISCOUS in free else [_VISCOUS]
    given = [name for name in beyond if model.servo.get(name) is not None and name in model.optional]
    if not more and not given and len(free) == len(space.names):
        return {}
    plain = type(model)(model.servo.replace(dict.fromkeys(given)))
    believed = [name for k, name in enumerate(space.names) if whole.prior.weight[k] > 0.0]  # that did not yield
    simple = space.changed(plain, [*free, *more], believed=believed, at=point.shared)
    forecast = Forecast(logs, plain, simple, whole.forecast.nuisance, whole.forecast.sensors,
                        whole.forecast.running)
    forecast.goes_on_from(whole.forecast)
    task = Task(forecast, whole.loss, whole.fitted, whole.seed, Begin(), whole.noise)
    # When pulses come, and what else is of the rig, is so whatever the law of friction
    begin = point._replace(shared=np.concatenate([simple.start, point.shared[len(space):]]))
    found = task.nearby(begin, lambda share, text: (tell(), None)[1])
    errors = {}
    point = with_pulses_of(forecast, task.loss, found, held_out, task.fitted)
    for k, part in enumerate(forecast.at(point, derivatives=False)):
        residual = by_sensor(forecast, k, part)[traces[k].signal]
        errors[k] = _error(traces[k], residual[traces[k].judged])
    return errors
