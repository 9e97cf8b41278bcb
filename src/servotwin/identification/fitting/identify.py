"""`identify`: the parameters of a servo from its logs, with intervals, and with what the logs cannot say."""

from __future__ import annotations

import math
import time as clock
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, PlausibilityWarning, ServotwinError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.assumptions import (
    HINTED,
    WANTED,
    Assumption,
    Ends,
    ends,
    freed,
    most_wanted,
    plausible,
    systematic,
    with_assumptions,
)
from servotwin.identification.fitting.checks import BY_ITSELF, explained, first_looks, mended
from servotwin.identification.fitting.comparison import BESIDE, SLEW, compare, trace_of, with_pulses_of
from servotwin.identification.fitting.diagnosis import diagnose
from servotwin.identification.fitting.diagnosis.drifts import counted_stamps
from servotwin.identification.fitting.fit import (
    LINEARISED_TIMES,
    Fit,
    Start,
    identified_servo,
    split,
    stopped,
    with_record,
    with_what_logs_say,
)
from servotwin.identification.fitting.registers import RegisterSearch, as_logs_say, register_search
from servotwin.identification.fitting.residual_noise import SensorSeries, noise_of
from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    FINE,
    HUBER,
    NUISANCES,
    OFFSET_SCALE,
    SHARED,
    STEP,
    LogPart,
    Point,
    has_pulses,
)
from servotwin.identification.fitting.search.clocks import delay_range, phase_errors, ticking, unsure_commands
from servotwin.identification.fitting.search.forecast import FIT_ACCURACY, Forecast, Running
from servotwin.identification.fitting.search.free import Bounds, Priors, Space
from servotwin.identification.fitting.search.least_squares import Begin, Loss, Outcome, Search
from servotwin.identification.fitting.search.phases import credible, settled
from servotwin.identification.fitting.search.stopping import Course, Within
from servotwin.identification.fitting.search.task import Task
from servotwin.identification.fitting.traces import ErrorTables, Trace
from servotwin.identification.fitting.uncertainty import (
    Counts,
    Rows,
    Uncertainty,
    explain,
    simplest,
    uncertainty,
)
from servotwin.identification.fitting.validate import common_cause
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
from servotwin.identification.fitting.yielding import (
    Doubts,
    Dropped,
    Foreseen,
    Widened,
    Yielded,
    allowed,
    foreseen,
    prior_share,
    settle,
    sizes_at,
    vague,
    warnings_of,
    widened,
    with_remedies,
    yielded,
)
from servotwin.logs.columns import step_of
from servotwin.logs.log import ANGLES, Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters import Servo
from servotwin.simulation.progress import Crew
from servotwin.simulation.start import accuracy_of

# --- Instruments that count -------------------------------------------------------------------------------------------

def counts_of(forecast: Forecast, k: int) -> Counts | None:
    """Return which samples of a log share a reading; None where none of its instruments counts."""
    case = forecast.cases[k]
    steps = {name: step_of(values) for name, values in case.values.items()}
    if not any(steps.values()):
        return None
    reading, power = [], []
    first = 0
    for name, values in case.values.items():
        step = steps[name]
        same = np.append(False, np.abs(np.diff(values)) < 0.5 * step)
        found = first + np.cumsum(~same) - 1
        first = int(found[-1]) + 1
        reading.append(found)
        power.append(np.full(len(values), step**2 / 12.0 / case.sigma(name, forecast.noise) ** 2))
    names = forecast.names_of_own(case)
    belief = np.zeros(len(names))
    if "output_angle" in names and next(iter(case.values)) == "output_angle":
        place = names.index("output_angle")
        belief[place] = float(forecast.own_belief(case)[1][place]) * forecast.noise["output_angle"] / OFFSET_SCALE
    return Counts(np.concatenate(reading), np.concatenate(power), belief)


# --- The doubts of a fit: how certain its numbers are, and what the logs do not say of them ---------------------------

Told = Callable[[float, str], None]


def doubts_of(task: Task, found: Outcome, level: float, show: Told) -> Doubts:
    """Return covariance, ends of the intervals, what is not determined, and what is prior.

    Where lanes may go nearly they do: what counts is how the cost rises, and it rises alike.

    Parameters
    ----------
    task : Task
    found : Outcome
        Its end.
    level : float
        Of the intervals.
    show : callable
    """
    with task.forecast.roughly():
        return _doubts_of(task, found, level, show)


def assumptions_at(task: Task, found: Outcome) -> tuple[Assumption, ...]:
    """Return what a servo file leaves out or assumes, and what the logs say of it where a search ended."""
    with task.forecast.roughly():
        return systematic(task, found.point, *_straight(task, found)[:3]).numbers


class _Straight(NamedTuple):
    """The problem made straight at a point: what logs say there, and the covariance of the shared numbers.

    Numbers that are not determined have flags, and directions in which nothing is known.
    """

    parts: list[LogPart]
    rows: list[Rows]
    doubt: Uncertainty
    information: Array
    flags: NDArray[np.bool_]
    directions: Array


def _straight(task: Task, found: Outcome) -> _Straight:
    forecast = task.forecast
    parts = forecast.at(found.point, central=True, cases=task.fitted)
    rows = task.rows(found.point, parts, counts=partial(counts_of, forecast))
    stuck = task.at_bound(found) | task.held
    doubt = uncertainty(rows, task.prior, stuck)
    information = _information(task, found, parts)
    flags, directions = vague(information, doubt.inflation, sizes_at(task, found), ~task.held)
    directions = simplest(directions)
    if flags.any():
        doubt = uncertainty(rows, task.prior, stuck, directions)
    return _Straight(parts, rows, doubt, information, flags, directions)


def _doubts_of(task: Task, found: Outcome, level: float, show: Told) -> Doubts:
    forecast = task.forecast
    parts, rows, doubt, information, flags, directions = _straight(task, found)
    stuck = task.at_bound(found) | task.held
    names = (*forecast.space.names, *forecast.extra)
    shares = [*forecast.space.shares(found.point.shared), *([math.nan] * len(forecast.extra))]
    open_ = explain(names, shares, flags, directions)
    which = [k for k in range(len(names)) if not flags[k] and not stuck[k]]
    search = Search(forecast, task.loss, task.prior, task.lower, task.upper, task.fitted, held=stuck)
    found = replace(found, cost=search.costs([found.point])[0]) if forecast.nearly else found
    count = max(len(which), 1)
    seen: list[Outcome] = []
    reaching = ends(search, found, doubt, which, level, rows=rows, deeper=seen.append,
                    tell=lambda done: show(0.76 + 0.18 * done / count, "intervals"))
    more = systematic(task, found.point, parts, rows, doubt)
    return Doubts(doubt, with_assumptions(reaching, doubt, level, more),
                  with_remedies(forecast, found.point, open_, names),
                  prior_share(names, doubt, reaching, flags, directions, task.prior.weight),
                  allowed(task, found, rows, directions, information, flags, doubt, reaching, level),
                  _spans(task, found, parts, rows, doubt, level),
                  min(seen, key=lambda there: there.cost, default=None), more)


def _spans(task: Task, found: Outcome, parts: Sequence[LogPart], rows: Sequence[Rows], doubt: Uncertainty,
           level: float) -> dict[str, tuple[float, float]]:
    """Return the range of the delay (SI) where each log's pulses say when they take effect."""
    if not task.held.any():
        return {}
    reach = doubt.quantile(1.0 - (1.0 - level) / len(task.fitted))  # all of the logs have to hold
    errors = phase_errors(task.forecast, task.fitted, parts, rows, task.loss, doubt)
    scan = task.scan(found.point)
    pulses = credible(scan, task.fitted)
    task.unsure = unsure_commands(scan, pulses)
    return {"delay": delay_range(scan, pulses, [
        reach * error + task.stamps_off.get(k, 0.0) for k, error in zip(task.fitted, errors, strict=True)])}


def _information(task: Task, found: Outcome, central: Sequence[LogPart]) -> Array:
    """Return what the logs say of the shared numbers, from differences so fine that what has no effect has none."""
    jagged = task.forecast.step > STEP  # then fine differences are those of steps, not of what moves the shaft
    parts = central if jagged else task.forecast.at(found.point, step=FINE, cases=task.fitted)
    rows = task.rows(found.point, parts)
    return np.asarray(np.sum([(r.slope * r.inside[:, None]).T @ r.slope for r in rows], axis=0))


# --- The last stage of a fit: its verdict, and where that is bad the trials of what may be the matter -----------------

_OUTLIERS = 0.005  # of the samples: then they are reported
_FINEST = 1e-9  # SI: the accuracy below which no simulation goes
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
        Called with the share done, and the work in progress.
    slew : mapping of int to ndarray
        Residuals of delay, slew and lag where each log is judged (SI); none where there is no such model beside.
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
        # Errors that a number of the model tells of samples that it was not fitted to are no noise
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
    (parts,) = task.forecast.at_all([point], derivatives=True, cases=task.fitted, leading=True)
    return task.rows(point, parts)


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


# --- Intervals of a fit that was stopped ------------------------------------------------------------------------------


LINEARISED = ("intervals (those here are of the problem made straight at the best so far, "
              f"{LINEARISED_TIMES:g} times as wide)")
"""Unknown numbers, where there are such."""


def hurried(task: Task, found: Outcome, level: float) -> tuple[Outcome, Doubts]:
    """Return where a fit was stopped, in the noise that it leaves there, and what is known of its numbers by then.

    The problem counts as straight there. How far its end is, and how it bends, is not known: intervals reach to either
    side of where a whole step would lead, and are three times as wide.
    """
    forecast, nothing = task.forecast, Doubts()
    try:
        task.measure(found.point)
        parts = forecast.at(found.point, central=True, cases=task.fitted)
        rows = task.rows(found.point, parts, counts=partial(counts_of, forecast))
        stuck = task.at_bound(found) | task.held
        doubt = uncertainty(rows, task.prior, stuck)
        flags, directions = vague(doubt.information, doubt.inflation, sizes_at(task, found), ~task.held)
        if flags.any():
            doubt = uncertainty(rows, task.prior, stuck, simplest(directions))
    except (ServotwinError, np.linalg.LinAlgError, ValueError, ArithmeticError):
        return found, nothing  # nothing is there to make straight
    slope = (found.point.shared - task.prior.mean) * task.prior.weight**2 + np.sum(
        [r.slope.T @ r.score for r in rows], axis=0)
    ahead, std = np.abs(doubt.curvature @ slope), doubt.std
    reaching = {k: Ends(-reach, reach, "linearised") for k in np.flatnonzero(~flags & ~stuck).tolist()
                if std[k] > 0.0 and math.isfinite(
                    reach := LINEARISED_TIMES * (doubt.quantile(level, k) + ahead[k] / std[k]))}
    spans = _pulses(task, found)
    reaching = {k: reach for k, reach in reaching.items() if not (spans and k == _delay(task))}
    return found, replace(nothing, doubt=doubt, ends=reaching, spans=spans) if reaching else nothing


def _delay(task: Task) -> int:
    """Return the place of the delay among the shared numbers; -1 where it is none."""
    extra = task.forecast.extra
    return len(task.forecast.space) + extra.index("delay") if "delay" in extra else -1


def _pulses(task: Task, found: Outcome) -> dict[str, tuple[float, float]]:
    """Return the range of the delay (SI) where pulses do not show yet which of them carries a command: a frame."""
    k = _delay(task)
    if k < 0 or not task.forecast.phased:
        return {}
    delay = float(found.point.shared[k]) * DELAY_SCALE
    return {"delay": (max(delay - task.period, 0.0), delay + task.period)}


# --- `identify` -------------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
_VALLEYS = 3  # to which a fit continues, at most
_FREED = 3  # numbers that the file leaves out
_VOLTAGE = "supply.open_circuit_voltage"
Progress = bool | Callable[[float, str], object]
NUISANCE = ("delay", "frame_phase", "angle_offset", "initial_state")


def usual_nuisance(model: Model) -> tuple[str, ...]:
    """Return the nuisances of a fit that names none: when ticks come is one of a program that pulses command."""
    ticks = isinstance(model, DigitalServo) and has_pulses(model)
    return (*NUISANCE, "control_phase") if ticks else NUISANCE


def identify(
    logs: Sequence[Log] | str | Path, servo: Servo, model: type[Model] | None = None,
    free: Sequence[str] | None = None, nuisance: Sequence[str] | None = None, priors: Priors | str | None = "servo",
    *, mend: Sequence[str] = (), bounds: Bounds | None = None, holdout: float | Sequence[str] | None = None,
    sensors: Sequence[str] | None = None,
    starts: int | Begin = 3, loss: str = "huber", noise: Mapping[str, float] | None = None, level: float = 0.95,
    intervals: bool = True, compare_with: Sequence[str] = ("slew", "M1"), seed: int = 0, progress: Progress = False,
    diagnose: bool = True, executor: Any = None, accuracy: float = FIT_ACCURACY, within: float | Within | None = None,
    robot: Any = None, **of_robot: Any,
) -> Fit:
    """Fit parameters of a servo to logs.

    Multi-start bounded nonlinear least squares on the exact engine, with robust loss; the Jacobian comes from copies of
    the servo that differ a little, run in one batch. The result is the same for the same arguments. Registers of a bus
    servo that nobody recorded are tried first; those that leave less than half of the error are taken, and said
    (`Fit.registers`).

    Parameters
    ----------
    logs : sequence of Log, or path
        A path is read by `read_logs`.
    servo : Servo
        Gives what is not searched, and where the search begins.
    model : type of Model, optional
        `PulseServo`, `PulseServoInductive`, `BoundedServo` or `DigitalServo`; the one that stands for the servo
        (`models.default_class`) unless given.
    free : sequence of str, optional
        Searched parameters: dotted names of servo and load, and the lumped names `output_torque_constant` (motor and
        back-EMF constant times the gear reduction), `output_inertia`, `output_coulomb_torque`.
    nuisance : sequence of str, optional
        Of "delay" (the command acts so much later), "log_delay" (what each log adds to it), "frame_phase" (when the
        pulses of each log come; of models with pulses), "frame_period" (how far apart they are in all logs; added
        where pulses drift), "angle_offset" (measured less true angle), "angle_sag" (the measured angle moves with the
        bus voltage), "control_phase" (when each log's servo ticks; of a `DigitalServo`) and "initial_state" (each
        log's start; else the servo stands where its first command says). Unless given: delay, frame_phase,
        angle_offset and initial_state, and control_phase where pulses command a program.
    priors : "servo", mapping or None
        Normal beliefs, mean and standard deviation by name (SI); "servo" takes the spread that the servo file states.
    mend : sequence of str
        Findings of `findings(logs, model)` that are put right in all logs before the fit: of "wrap", "stamps",
        "sign", "span", "rows" and "not followed". All that is found is said first among the warnings, mended or not;
        "wrap" and "sign" are mended unasked.
    bounds : mapping, optional
        Lowest and highest value by name (SI); random starts fill them. Wide ones unless given.
    holdout : float or sequence of str, optional
        Share of logs of each kind of motion, or names, that are not fitted but predicted; a fourth of each kind with
        four logs or more unless given; 0: none.
    sensors : sequence of str, optional
        Measured signals that are fitted; the angle and all currents unless given.
    starts : int or Begin
        How many searches: one from the servo's values, the others from random ones. Or where another fit ended.
    loss : {"huber", "squares"}
        Huber: residuals of more than 1.345 times the noise count in proportion, not squared.
    noise : mapping, optional
        Standard deviation of what each sensor's residuals scatter (SI); estimated unless given. "time": that of the
        times of single pulses, ticks and samples [s]; what moves counts as less sure, by how far it goes meanwhile.
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
        True shows a bar with the time left; a callable is called with the share that is done and the work in progress.
    diagnose : bool
        Where what is left is no noise, causes are tried: at most four times what the fit itself took. False leaves
        that out; the verdict stays.
    executor : optional
        Anything with the `submit` of `concurrent.futures`, such as a client of dask; threads on all cores unless
        given. It is not shut down. The fit does not depend on it, to the last bit.
    accuracy : float
        Error that angles of simulations may have where motions are integrated, not solved in closed form [rad], from
        1e-13 to 1e-4.
    within : float, optional
        Time that the fit may take [s]; then it stops.
    robot, of_robot
        Of whole robots; to be removed in 0.2: `identify_arm` takes their episodes, and returns an `ArmFit`.

    Returns
    -------
    Fit
        After a stop (Ctrl-C, a KeyboardInterrupt out of `progress`, or the end of `within`) the best so far; its
        `unknown` says what was left out.

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
    if robot is not None:
        from servotwin.identification.arms import identify_arm

        warnings.warn("identify(robot=...) goes in 0.2; servotwin.identification.identify_arm(logs, robot, servos) is "
                      "the same", FutureWarning, stacklevel=2)
        found: Any = identify_arm(logs, robot, servo, level=level, intervals=intervals, diagnose=diagnose,
                                  within=within, progress=progress, **of_robot)
        return found  # type: ignore[no-any-return]
    if of_robot:
        raise InputError("identify", got=", ".join(of_robot), allowed="with robot= only")
    began, limit = clock.monotonic(), Within(within)
    read = checks.checked_logs(logs)
    plain = checks.checked_servo(servo, model)
    plain, assumed = as_logs_say(plain, read)
    before = _seen_before(starts, mend)
    given, noticed = (mended(read, plain, BY_ITSELF).logs, ()) if before else \
        first_looks(read, plain, mend, BY_ITSELF)
    registers = None if before else register_search(plain, given, limit)
    if registers is not None and registers.taken is not None:
        plain = type(plain)(registers.taken.servo)
    usual = checks.usual_free(plain, read) if free is None else ()
    if usual and registers is not None and registers.taken is not None:
        usual = tuple(dict.fromkeys((*usual, *registers.moves)))
    names = usual if free is None else checks.checked_list("free", free)
    beside = checks.checked_words("compare_with", compare_with, BESIDE)
    level, seed = checks.checked_level(level), checks.checked_count("seed", seed, least=0)
    seen = checks.checked_sensors(given, sensors, plain)
    space = Space(plain, names, bounds=bounds, priors=priors, load=checks.shared_load(given, names))
    fitted, held_out = split(given, holdout, seed)
    trials = checks.checked_flag("diagnose", diagnose)
    course = Course(limit, intervals=intervals, beside=len(beside), trials=trials)
    running = Running(Crew(executor), accuracy_of(accuracy), course.look)
    rig = usual_nuisance(plain) if nuisance is None else checks.checked_words("nuisance", nuisance, NUISANCES)
    forecast = Forecast(given, plain, space, rig, seen, running)
    checks.check_fitted(given, fitted, seen, len(names) + len(rig))
    begin = starts if isinstance(starts, Begin) else Begin(
        checks.checked_count("starts", starts, least=1), others=_beginnings(registers, names))
    task = Task(forecast, Loss(checks.checked_loss(loss, HUBER)), fitted, seed, begin,
                checks.checked_noise(noise, seen))
    task.doubted = registers is not None and registers.doubted is not None
    with running.crew, course.watching(), checks.shown(progress) as show, explained(noticed):
        course.show = show
        fit = _run(task, held_out, beside, level, course, intervals=intervals, trials=trials)
        course.ended()
    found = () if registers is None else registers.sentences
    fit = replace(fit, warnings=(*found, *assumed, *noticed, *fit.warnings), registers=registers,
                  seconds=clock.monotonic() - began)
    return with_record(fit, read, fitted, mend)


def _beginnings(registers: RegisterSearch | None, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Return searched numbers of registers (SI) with which further searches begin."""
    if registers is None or registers.taken is None:
        return ()
    found = [{name: float(value) for name in registers.moves if name in names
              and isinstance(value := one.servo.get(name), int | float)} for one in registers.others]
    return tuple(values for values in found if values)


def _seen_before(starts: int | Begin, mend: Sequence[str]) -> bool:
    """Tell whether another fit looked at the logs before, which is continued, and again at its end."""
    return isinstance(starts, Begin) and bool(starts.own) and not starts.exactly and not mend


def _run(task: Task, held_out: Sequence[int], beside: tuple[str, ...], level: float, course: Course, *,
         intervals: bool, trials: bool) -> Fit:
    """Search, doubt, and compare; a stop ends the stage that it meets, and those that come after it are left out."""
    ended: list[Outcome] = []
    missing: list[str] = []
    hardly: tuple[Foreseen, ...] = ()
    try:
        hardly = () if task.begin.own else foreseen(task)
        found, ended = task.search(lambda share, text: course(0.7 * share, text))
    except KeyboardInterrupt:
        found, missing = task.best_so_far(), ["whether the search would end elsewhere", "what is left"]
    found, left, doubts = _doubted(task, found, level, course, missing, intervals=intervals)
    forecast = task.forecast  # which may have more numbers than it began with
    dropped, wide = yielded(task, found, left, doubts), widened(task, found, left)
    with task.nearly(found.point):
        point = with_pulses_of(forecast, task.loss, found.point, held_out, task.fitted)
    traces = tuple(trace_of(forecast, point, k, part, held_out=k in held_out)
                   for k, part in enumerate(forecast.at(point, derivatives=False)))
    final = identified_servo(forecast.model.servo, forecast.space, found.point.shared, doubts, level,
                             [one.name for one in dropped])
    final = with_what_logs_say(final, [forecast.cases[k].log for k in task.fitted], forecast.space.names)
    tables = _compared(task, held_out, traces, final, beside, found.point, course, missing)
    fit = _fit(task, found, doubts, dropped, wide, final, traces, tables, ended)
    middles = {name: 0.5 * (low + high) for name, (low, high) in doubts.spans.items()}
    fit = replace(fit, foreseen=hardly, warnings=(*(str(one) for one in hardly if one.name not in fit.undetermined),
                                                  *fit.warnings))
    fit = replace(fit, level=level, phased=forecast.phased, ticked=forecast.ticked,
                  estimates={**fit.estimates, **middles})
    if "what is left" in missing or not task.begin.exactly:
        return stopped(fit, missing)
    try:
        return stopped(with_verdict(task, found.point, fit, course, tables.slew,
                                    trials=trials and not missing), missing)
    except KeyboardInterrupt:
        return stopped(with_verdict(task, found.point, fit, course, tables.slew, trials=False),
                       ["what may be the matter"])


def _doubted(task: Task, found: Outcome, level: float, course: Course, missing: list[str], *,
             intervals: bool) -> tuple[Outcome, tuple[Dropped, ...], Doubts]:
    """Return where the fit ends without the priors that the logs contradict, those priors, and its doubts."""
    left: tuple[Dropped, ...] = ()
    doubts, prior = Doubts(), task.prior
    if not missing:
        try:
            found, left = settle(task, found, lambda share, text: course(0.7 + 0.06 * share, text))
        except KeyboardInterrupt:
            task.prior = prior
            missing.append("whether priors hold")
    else:
        missing.append("whether priors hold")
    if missing:
        missing += ["intervals"] if intervals else []
    elif intervals:
        try:
            course(0.76, "intervals")
            found, doubts = _with_doubts(task, found, level, course)
            found, doubts = _with_what_logs_want(task, found, doubts, level, course)
        except KeyboardInterrupt:
            missing.append("intervals")
    if "intervals" in missing:
        found, doubts = hurried(task, found, level)
        missing[missing.index("intervals")] = "intervals" if doubts.doubt is None else LINEARISED
    return found, left, doubts


def _compared(task: Task, held_out: Sequence[int], traces: tuple[Trace, ...], final: Servo, beside: tuple[str, ...],
              point: Point, course: Course, missing: list[str]) -> ErrorTables:
    """Return errors, beside those of simpler models if nothing has stopped the fit."""
    if not missing:
        try:
            course(0.95, "errors")
            return compare(task, held_out, traces, final, beside, point,
                           lambda: course(0.95, "errors of simpler models"))
        except KeyboardInterrupt:
            pass
    missing += ["simpler models"] if beside else []
    missing.append("what may be the matter")
    return compare(task, held_out, traces, final, (), point)


def _with_doubts(task: Task, found: Outcome, level: float,
                 show: Callable[[float, str], None]) -> tuple[Outcome, Doubts]:
    """Return where the search ended and its doubts; where these saw a deeper valley, it continues from there.

    One at whose bottom more numbers stand at a bound is none of a servo: logs that no servo can follow have such.
    """
    doubts = doubts_of(task, found, level, show)
    for _ in range(_VALLEYS):
        if doubts.deeper is None:
            break
        show(0.76, "a deeper valley")
        noise, bounds = task.forecast.noise, task.at_bound(found)
        other = task.again(ticking(task, doubts.deeper.point, show, 0.76), lambda share, text: show(0.76, text))
        if np.count_nonzero(task.at_bound(other)) > np.count_nonzero(bounds):
            task.forecast.noise = noise
            break
        found, doubts = other, doubts_of(task, other, level, show)
    return found, doubts


def _with_what_logs_want(task: Task, found: Outcome, doubts: Doubts, level: float,
                         show: Callable[[float, str], None]) -> tuple[Outcome, Doubts]:
    """Return where a search ends that has found numbers which the file leaves out too, where the logs want them so.

    A model that lacks something else takes any further number: they stay only if what is left is noise.
    """
    other, there, said, kept = task, found, list[Assumption](), None
    numbers = doubts.systematic.numbers if doubts.systematic is not None else ()
    noise = most_wanted(numbers, HINTED) is None or leaves_noise(task, found.point)
    while len(said) < _FREED and (most := most_wanted(numbers, WANTED if noise else HINTED)) is not None:
        show(0.9, most.words)
        try:
            nearer, start = freed(other, there.point, most)
            reached = nearer.ran(start, show, 0.9)
            if nearer.forecast.phased:  # pulses made up for it too
                reached = nearer.ran(settled(nearer.scan(reached.point), nearer.fitted), show, 0.9)
        except ServotwinError:
            break
        if not other.pays(there.point, nearer, reached.point, 0.5 * WANTED**2):
            break
        nearer.measure(reached.point)
        other, there = nearer, nearer.again(reached.point, lambda share, text: show(0.9, text))
        said.append(most)
        noise = leaves_noise(other, there.point)
        if noise and all(plausible(other, there.point, one) for one in said):
            kept = other, there, tuple(said)
        numbers = assumptions_at(other, there)
    if kept is None:
        return found, doubts
    task.become(kept[0], _said_of(kept[0], kept[1].point, kept[2]))
    return kept[1], doubts_of(task, kept[1], level, show)


def _said_of(task: Task, point: Point, numbers: Sequence[Assumption]) -> str:
    values = {p.name: float(p.value(point.shared[k])) for k, p in enumerate(task.forecast.space.parameters)}
    return "the logs want " + " and ".join(
        f"{one.name} of {values[one.name]:.3g}{one.unit_shown} where the servo file assumes {one.assumed:z.3g} "
        f"({one.wanted:.2g} standard errors)" for one in numbers) + ": searched too"


def _explained(task: Task, dropped: Sequence[Yielded]) -> tuple[str, ...]:
    """Return one voltage or one load that would explain all contradictions, in words; nothing without one."""
    model = task.forecast.model
    said = {task.forecast.cases[k].log.parameters.get(_VOLTAGE, model.value(_VOLTAGE)) for k in task.fitted}
    if len(said) > 1:
        return ()
    cause = common_cause(dropped, voltage=said.pop(), drop_voltage=model.value_or("supply.bridge_drop_voltage", 0.0))
    return () if cause is None else (cause,)


def _fit(task: Task, found: Outcome, doubts: Doubts, dropped: tuple[Yielded, ...], wide: tuple[Widened, ...],
         servo: Servo, traces: tuple[Trace, ...], tables: Any, ended: Sequence[Outcome]) -> Fit:
    doubt, reaching, stuck = doubts.doubt, doubts.ends, task.at_bound(found)
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
        more = doubts.systematic.covariance if doubts.systematic is not None else 0.0
        covariance[known] = ((doubt.covariance + more) * np.outer(slopes, slopes))[known]
    units = {p.name: p.unit for p in space.parameters} | {name: unit for name, (_, unit) in SHARED.items()}
    return Fit(
        servo=servo, model=type(forecast.model)(servo), names=names,
        estimates={name: float(value) for name, value in zip(names, values, strict=True)},
        units={name: units[name] for name in names}, covariance=covariance, unidentifiable=doubts.unidentifiable,
        at_bound=tuple(name for name, at in zip(names, stuck, strict=True) if at),
        holdout=tables.holdout, training=tables.training, traces=traces,
        starts=tuple(Start(outcome.cost, outcome.converged) for outcome in ended),
        noise={name: forecast.noise[name] for name in forecast.sensors}, cost=found.cost, space=space, best=x,
        warnings=(*task.remarks, *task.unsure, *warnings_of((*dropped, *wide), tables),
                  *_explained(task, dropped)),
        doubt=doubt, ends=dict(reaching), scales={n: scales[n] for n in forecast.extra}, yielded=dropped, widened=wide,
        prior_share=doubts.prior_share, allowed=doubts.allowed, spans=doubts.spans, own=found.point.own,
        assumptions=doubts.systematic.numbers if doubts.systematic is not None else ())
