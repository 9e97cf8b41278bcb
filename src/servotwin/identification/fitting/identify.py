"""`identify`: the parameters of a servo from its logs, with intervals, and with what the logs cannot say."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServotwinError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.arrow import Loss, Outcome
from servotwin.identification.fitting.assumptions import HINTED, WANTED, Assumption, freed, most_wanted, plausible
from servotwin.identification.fitting.batches import FIT_ACCURACY, Running
from servotwin.identification.fitting.begin import Begin
from servotwin.identification.fitting.clocks import ticking
from servotwin.identification.fitting.common_cause import common_cause
from servotwin.identification.fitting.comparison import BESIDE, ErrorTables, compare
from servotwin.identification.fitting.doubting import assumptions_at, doubts_of
from servotwin.identification.fitting.doubts import Doubts
from servotwin.identification.fitting.findings import BY_ITSELF, explained, first_looks, mended
from servotwin.identification.fitting.fit import Fit, Start, Trace
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.foreseen import Foreseen, foreseen
from servotwin.identification.fitting.frames import has_pulses
from servotwin.identification.fitting.free import Bounds, Priors, Space
from servotwin.identification.fitting.held_out import trace_of, with_pulses_of
from servotwin.identification.fitting.holdout import split
from servotwin.identification.fitting.judging import leaves_noise, with_verdict
from servotwin.identification.fitting.linearised import LINEARISED, hurried
from servotwin.identification.fitting.phases import settled
from servotwin.identification.fitting.point import NUISANCES, SHARED, Point
from servotwin.identification.fitting.record import identified_servo, stopped, with_record, with_what_logs_say
from servotwin.identification.fitting.registers import RegisterSearch, as_logs_say, register_search
from servotwin.identification.fitting.stopping import Course, Within
from servotwin.identification.fitting.task import HUBER, Task
from servotwin.identification.fitting.yielding import Dropped, Widened, Yielded, settle, widened, yielded
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters import Servo
from servotwin.simulation.progress import Crew
from servotwin.simulation.start import accuracy_of

Array = NDArray[np.float64]
_VALLEYS = 3  # that a fit goes on to, at most
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
        What is searched: dotted names of servo and load, and the lumped names `output_torque_constant` (motor and
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
        What of `findings(logs, model)` is put right in all logs before the fit: of "wrap", "stamps", "sign", "span",
        "rows" and "not followed". All that is found is said first among the warnings, mended or not; "wrap" and "sign"
        are mended unasked.
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
        True shows a bar with the time left; a callable is called with the share that is done and what goes on.
    diagnose : bool
        Where what is left is no noise, causes are tried: at most four times what the fit itself took. False leaves
        that out; the verdict stays.
    executor : optional
        Anything with the `submit` of `concurrent.futures`, such as a client of dask; threads on all cores unless
        given. It is not shut down. The fit does not depend on it, to the last bit.
    accuracy : float
        What angles of simulations may be off by where motions are integrated, not solved in closed form [rad], from
        1e-13 to 1e-4.
    within : float, optional
        Time that the fit may take [s]; then it stops.
    robot : optional
        Where `logs` are episodes of a whole robot: its MJCF file or model, "so101" or "unknown". `servo` is then that
        of all joints, or one by joint, and what comes back an `ArmFit`.
    of_robot
        What else `identify_arm` takes.

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
    """Tell whether another fit looked at the logs before, which goes on, and again at its end."""
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
    traces = _traces(forecast, point, held_out)
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
    """Return where the search ended and its doubts; where these saw a deeper valley, it goes on from there.

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


def _traces(forecast: Forecast, point: Point, held_out: Sequence[int]) -> tuple[Trace, ...]:
    """Return every log beside the simulation; a log that was held out starts as it was measured."""
    return tuple(trace_of(forecast, point, k, part, held_out=k in held_out)
                 for k, part in enumerate(forecast.at(point, derivatives=False)))


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
        warnings=(*task.remarks, *task.unsure, *checks.warnings_of((*dropped, *wide), tables),
                  *_explained(task, dropped)),
        doubt=doubt, ends=dict(reaching), scales={n: scales[n] for n in forecast.extra}, yielded=dropped, widened=wide,
        prior_share=doubts.prior_share, allowed=doubts.allowed, spans=doubts.spans, own=found.point.own,
        assumptions=doubts.systematic.numbers if doubts.systematic is not None else ())
