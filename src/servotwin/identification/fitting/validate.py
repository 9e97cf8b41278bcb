"""`validate`: how far a servo that is known is off logs, without fitting any parameter.

The motion of a servo says its numbers only relative to the voltage and to the loads that the logs state. If the supply
has a times the voltage that is said, a fit finds the torque constant 1/a and the resistances 1/a² times as large; if
all loads are b times as large, it finds inertia and friction 1/b and the resistances b times as large, for
J q'' = K/R (s V - K q') - tau_c holds with these as with the true ones. If the angle is c times what the shaft turns
through, it finds the gain of the potentiometer, the torque constant and friction 1/c times as large, inertia and
viscous friction 1/c².
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServoFileError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.checks import explained, first_looks
from servotwin.identification.fitting.comparison import trace_of, with_pulses_of
from servotwin.identification.fitting.fit import Validation
from servotwin.identification.fitting.registers import as_logs_say, register_search
from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    HUBER,
    NUISANCES,
    OFFSET_SCALE,
    SHARED,
    LogPart,
    Point,
    changes,
    gaps,
    has_pulses,
)
from servotwin.identification.fitting.search.clocks import first_offset
from servotwin.identification.fitting.search.forecast import Forecast, Running
from servotwin.identification.fitting.search.free import ANY_PARAMETER, Space
from servotwin.identification.fitting.search.least_squares import Begin, Loss, Prior, scatter_of
from servotwin.identification.fitting.search.task import Task
from servotwin.identification.fitting.traces import ErrorTable, Trace
from servotwin.logs.log import Log
from servotwin.models import MODELS, Model
from servotwin.models.engine.memory import ACCURACY
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.units import is_finite

# --- The rig of logs that are compared with a known servo -------------------------------------------------------------

_PERIOD = "electronics.frame_period"
DELAYS = (0.0, 0.02, 0.04, 0.06, 0.09)
"""Where a search for the delay may begin [s]."""
RIG = ("delay", "angle_offset")
"""Numbers of a rig: how late commands act, and where its angle is 0."""
_FEW = 6  # steps of a search that only has to show what they would leave
_ROUNDS = 3  # of noise and search
_MOST = 20  # steps of a search
_IN_STEP = 1e-4  # of a whole number: samples that come with the pulses


class RigTask(Task):
    """The search of a fit in which all stays but what is asked for of the rig."""

    asked: tuple[str, ...] = ()

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which shared numbers stay: those of the servo, and what is not asked for."""
        stays = [True] * len(self.forecast.space) + [name not in self.asked for name in self.forecast.extra]
        return np.asarray(super().held | np.array(stays))


def has_unknown_phase(log: Log, model: Model) -> bool:
    """Tell whether a log leaves open when its pulses come: samples and commands are not in step with the frames.

    Examples
    --------
    >>> import servotwin as st
    >>> model, time = st.PulseServo(st.load_servo("hitec-hs-755hb")), np.arange(20.0)
    >>> command = np.where(time > 4, 1.6e-3, 1.5e-3)
    >>> logs = [Log(name="a", time=step * time, command=command, command_kind="pulse_width",
    ...             measured={"output_angle": time}) for step in (0.02, 0.005, 0.0167)]
    >>> [has_unknown_phase(log, model) for log in logs]
    [False, False, True]
    """
    if not has_pulses(model) or not len(changes(log)):
        return False
    period = log.parameters.get(_PERIOD, model.value_or(_PERIOD, 0.0))
    if not period:
        return False
    step = float(np.median(np.diff(log.time)))
    ratio = max(step / period, period / step)
    return abs(ratio - round(ratio)) > _IN_STEP * ratio or len(gaps(log, period)) > 1


def with_known(forecast: Forecast, known: Mapping[str, float]) -> Point:
    """Return the point of the servo with what is known of the rig (SI), and no delay and no offset but those."""
    point, size = _task(forecast).nominal(), len(forecast.space)
    period = forecast.cases[0].period
    values = [known.get(name, period if name == "frame_period" else 0.0) / SHARED[name][0] for name in forecast.extra]
    return point._replace(shared=np.append(point.shared[:size], values))


def fitted_rig(forecast: Forecast, start: Point, asked: Sequence[str], show: Callable[[float, str], None]) -> Point:
    """Return the point of the servo with the rig that the logs say, pulses coming alike for all of them.

    Parameters
    ----------
    forecast : Forecast
        Its searched numbers all stay.
    start : Point
        Where the search begins.
    asked : sequence of str
        Searched parameters.
    show : callable
        Called with the share that is done, and the work in progress.
    """
    task = _task(forecast)
    task.asked = tuple(asked)
    task.lower, task.upper = np.minimum(task.lower, start.shared), np.maximum(task.upper, start.shared)
    found = _searched(task, start, show)
    return found if "initial_state" in asked else _as_measured(forecast, found, start)


def likely_rig(forecast: Forecast) -> Point:
    """Return the point of the servo with delay and angle offset as the logs say, near enough to tell what they leave.

    Parameters
    ----------
    forecast : Forecast
        With both as nuisances and pulses without a phase; its searched numbers all stay.
    """
    task, start = _task(forecast), with_known(forecast, {})
    task.asked = RIG
    forecast.strict = False
    few = task.few()
    found = _likely(task, start, few)
    forecast.noise = {**forecast.noise, **scatter_of(forecast, forecast.at(found, derivatives=False, cases=few), few)}
    return _as_measured(forecast, task._search(few).run(found, most=_FEW).point, start)


def _task(forecast: Forecast) -> RigTask:
    task = RigTask(forecast, Loss(HUBER), list(range(len(forecast.cases))), 0, Begin(), None)
    task.prior = Prior(np.zeros(forecast.size), np.zeros(forecast.size))
    return task


def _searched(task: RigTask, there: Point, show: Callable[[float, str], None]) -> Point:
    """Return where a search ends in which pulses come alike for all logs, from the likeliest delay and offset."""
    task.forecast.own_phases = "delay" not in task.forecast.extra
    found = _likely(task, there)
    for k in range(_ROUNDS):
        show(k / _ROUNDS, "fitting " + ", ".join(task.asked))
        task.measure(found)
        found = task._search(task.fitted).run(found, most=_MOST).point
    return found


def _likely(task: RigTask, there: Point, cases: Sequence[int] | None = None) -> Point:
    """Return the point from which the search begins: of some usual delays, with and without the offset that is seen."""
    size, extra = len(task.forecast.space), task.forecast.extra
    tried = [there]
    for delay in DELAYS if "delay" in task.asked else (None,):
        for offset in {None, first_offset(task.forecast, task.fitted)} if "angle_offset" in task.asked else (None,):
            shared = there.shared.copy()
            if delay is not None:
                shared[size + extra.index("delay")] = delay / DELAY_SCALE
            if offset is not None:
                shared[size + extra.index("angle_offset")] = offset / OFFSET_SCALE
            tried.append(there._replace(shared=shared))
    sizes = [sum(float(np.abs(part.residual).sum()) for part in parts)
             for parts in task.forecast.at_all(tried, cases=cases)]
    return tried[int(np.argmin([one if math.isfinite(one) else math.inf for one in sizes]))]


def _as_measured(forecast: Forecast, point: Point, start: Point) -> Point:
    """Return a point whose logs begin where they were measured, though they keep their own delays and pulses."""
    own = []
    for case, found, first in zip(forecast.cases, point.own, start.own, strict=True):
        keeps = [name in ("log_delay", "frame_phase") for name in forecast.names_of_own(case)]
        own.append(np.where(keeps, found, first))
    return point._replace(own=tuple(own))


# --- `validate`: how far a servo that is known is off logs, without fitting any parameter -----------------------------

Array = NDArray[np.float64]
Progress = bool | Callable[[float, str], object]
_FINE = 1e-3  # rad, of an error: of less nobody asks
_FAR_LESS = 0.5  # of an error: what is said


def validate(logs: Sequence[Log] | str | Path, servo: Servo, model: type[Model] | None = None, *,
             mend: Sequence[str] = (), nuisance: Sequence[str] = (), sensors: Sequence[str] | None = None,
             progress: Progress = False) -> Validation:
    """Run a servo against logs, and return how far it is off.

    Of logs of an SO-100 or SO-101 (datasets of LeRobot) a servo with the factory's registers is taken with those that
    LeRobot writes, and a warning says so. Registers of a bus servo that would leave less than half of the error are
    named (`Validation.registers`), and so are a delay and a zero of the rig; neither changes the errors. Every log
    starts at the angle and speed that it shows. Delay and angle offset are those that the servo file's [fit] recorded,
    where it has any. When pulses come is unknown where the samples of a log are not in step with the frames, and where
    the file's fit or `nuisance` say so: then the first half of each log tells it. The errors are those of the second
    half where the fit or `nuisance` say so, else of all samples.

    Parameters
    ----------
    logs : sequence of Log, or path
    servo : Servo
    model : type of Model, optional
        `PulseServo`, `PulseServoInductive`, `BoundedServo` or `DigitalServo`; that of the servo file's [fit] unless
        given, else the one that stands for the servo (`models.default_class`).
    mend : sequence of str
        Findings that are put right in the logs first, as of `identify`.
    nuisance : sequence of str
        Parameters of the rig that are fitted to these logs: as of `identify`. Where that is no nearer than no rig at
        all, there is none.
    sensors : sequence of str, optional
        Measured signals that are compared; the angle and all currents unless given. The errors are those of the angle.
    progress : bool or callable
        As of `identify`.

    Raises
    ------
    InputError
        On bad input, as `identify` does.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...           measured={"output_angle": run["output_angle"]})
    >>> validate([log], servo).total < 1e-6
    True
    """
    plain = checks.checked_servo(servo, recorded_model(servo) if model is None else model)
    read = checks.checked_logs(logs)
    plain, assumed = as_logs_say(plain, read)
    given, noticed = first_looks(read, plain, mend)
    registers = register_search(plain, given)
    seen = checks.checked_sensors(given, sensors, plain)
    for name in nuisance:
        if name not in NUISANCES:
            raise InputError("nuisance", got=name, allowed=", ".join(NUISANCES))
    known = recorded_nuisance(servo)
    used = [name for name in NUISANCES if name in known or name in nuisance or name in _always(plain, given)]
    forecast = Forecast(given, plain, _space(plain, given), used, seen, Running(accuracy=ACCURACY))
    whole = "frame_phase" not in (*nuisance, *servo.fit)
    with explained(noticed), checks.shown(progress) as show:
        show(0.0, "simulating")
        point, parts = _placed(forecast, known, nuisance, show, whole=whole)
        traces = _traces(forecast, point, parts, whole=whole)
        rig = () if nuisance or known else _of_rig(given, plain, seen, _total(traces))
    own = type(plain).__name__
    return Validation(
        servo=plain.servo, model=plain, traces=traces, fitted=tuple(name for name in NUISANCES if name in nuisance),
        errors=ErrorTable((own,), {own: tuple(trace.error for trace in traces)}),
        nuisance={name: forecast.nuisance_of(point.shared, name) for name in forecast.extra},
        noise=_noise(forecast, parts), registers=registers,
        warnings=(*(() if registers is None else registers.sentences), *assumed, *noticed, *rig))


def _of_rig(logs: Sequence[Log], model: Model, sensors: Sequence[str], left: float) -> tuple[str, ...]:
    """Return a sentence on a delay and an angle offset with which far less would be left; none where they would not."""
    if "output_angle" not in sensors or left < _FINE:
        return ()
    forecast = Forecast(logs, model, _space(model, logs), (*RIG, "initial_state"), sensors)
    with forecast.roughly():
        point = likely_rig(forecast)
        parts = forecast.at(point, derivatives=False)
    error = _total(_traces(forecast, point, parts, whole=True))
    if not error < _FAR_LESS * left:
        return ()
    delay, offset = (forecast.nuisance_of(point.shared, name) for name in RIG)
    said = f"a delay of {1e3 * delay:.3g} ms and a zero of {math.degrees(offset):.3g} deg"
    return (f"{said} would leave {math.degrees(error):.3g} deg instead of {math.degrees(left):.3g}: of the rig, as it "
            f"seems, and not of the servo; {','.join(RIG)} as nuisances (--nuisance) fit them",)


def _always(model: Model, logs: Sequence[Log]) -> tuple[str, ...]:
    """Return the nuisances that are used unasked: each log's start, and when pulses come and which ticks take them.

    A servo file's fit says it, and pulses come at any time where samples are not in step with the frames.
    """
    found = [name for name in ("frame_phase", "control_phase") if name in model.servo.fit]
    if any(has_unknown_phase(log, model) for log in logs):
        found.append("frame_phase")
    return ("initial_state", *found)


def _placed(forecast: Forecast, known: Mapping[str, float], nuisance: Sequence[str],
            show: Callable[[float, str], None], *, whole: bool) -> tuple[Point, list[LogPart]]:
    """Return where the servo stands: as known, or with the nuisances that are fitted if these bring it nearer.

    Where pulses have a phase, the first half of each log tells it.
    """
    everything = range(len(forecast.cases))
    start, nothing = with_known(forecast, known), with_known(forecast, {})
    before = forecast.at(start, derivatives=False)
    _failures(forecast, before)
    forecast.noise, forecast.strict = _noise(forecast, before), False  # on the way, what no servo does counts as failed
    tried = [with_pulses_of(forecast, Loss(HUBER), start, everything)]
    if nuisance:
        found = fitted_rig(forecast, start, nuisance, show)
        tried = [with_pulses_of(forecast, Loss(HUBER), found, everything, everything), *tried,
                 with_pulses_of(forecast, Loss(HUBER), nothing, everything), nothing]
    every = forecast.at_all(tried)
    best = min(range(len(tried)), key=lambda k: _total(_traces(forecast, tried[k], every[k], whole=whole)))
    _failures(forecast, every[best])
    return tried[best], every[best]


def _traces(forecast: Forecast, point: Point, parts: Sequence[LogPart], *, whole: bool) -> tuple[Trace, ...]:
    return tuple(trace_of(forecast, point, k, part, held_out=True, whole=whole) for k, part in enumerate(parts))


def _total(traces: Sequence[Trace]) -> float:
    """Return the rms error over all samples that judge; inf where a simulation failed."""
    every = np.concatenate([trace.residual[trace.judged] for trace in traces])
    return float(np.sqrt(np.mean(every**2))) if np.isfinite(every).all() else math.inf


def recorded_model(servo: Any) -> type[Model] | None:
    """Return the model that a servo file's [fit] names; None where there is none."""
    name = servo.fit.get("model") if isinstance(servo, Servo) else None
    return next((kind for kind in MODELS.values() if kind.__name__ == name), None)


def recorded_nuisance(servo: Servo) -> dict[str, float]:
    """Return the delay [s], angle offset [rad] and sag [rad/V] that a servo file's [fit] recorded.

    Raises
    ------
    ServoFileError
        If they are no numbers.
    """
    found = _recorded(servo, "nuisance")
    return {name: found[name] for name in SHARED if name in found}


def _recorded(servo: Servo, key: str) -> dict[str, float]:
    table = servo.fit.get(key, {})
    values = dict(table) if isinstance(table, Mapping) else {key: table}
    for name, value in values.items():
        if not is_finite(value):
            raise ServoFileError(servo.name, "not a number", table="fit", key=f"{key}.{name}", got=value,
                                 allowed="a finite number (SI)")
    return {name: float(value) for name, value in values.items()}


def _space(model: Model, logs: Sequence[Log]) -> Space:
    """Return searched numbers that all stay: those of the load that the fit found, or any one."""
    load = {name: value for name, value in _recorded(model.servo, "load").items() if name in LOAD_NAMES}
    taken = {name for log in logs for name in log.parameters}
    free = list(load) or [next(name for name in ANY_PARAMETER if name not in taken)]
    return Space(model, free, load=load)


def _failures(forecast: Forecast, parts: Sequence[LogPart]) -> None:
    for case, part in zip(forecast.cases, parts, strict=True):
        if not np.isfinite(part.residual).all():
            raise InputError(f"log {case.log.name!r}", got="a simulation that does not reach its end",
                             allowed="a servo and a load that can be simulated")


def _noise(forecast: Forecast, parts: Sequence[LogPart]) -> dict[str, float]:
    """Return how far the residuals of each sensor scatter (SI)."""
    return {**forecast.noise, **scatter_of(forecast, parts, range(len(parts)))}


# --- Common cause -----------------------------------------------------------------------------------------------------

_TORQUE = ("output_torque_constant", "motor.torque_constant", "motor.back_emf_constant")
_RESISTANCE = ("motor.armature_resistance", "supply.internal_resistance", "supply.bridge_drop_resistance")
_MECHANICAL = ("output_inertia", "motor.rotor_inertia", "gear.output_inertia", "output_coulomb_torque",
               "friction.coulomb_torque_forward", "friction.coulomb_torque_backward", "motor.motor_viscous_friction")
_SQUARED = ("output_inertia", "motor.rotor_inertia", "gear.output_inertia", "motor.motor_viscous_friction")
_GAIN = "potentiometer.feedback_gain"  # which an angle's scale alone may explain
_POWERS: Mapping[str, Mapping[str, float]] = {  # of a factor of voltage, load or angle, in what a fit finds
    "voltage": {**dict.fromkeys(_TORQUE, -1.0), **dict.fromkeys(_RESISTANCE, -2.0)},
    "load": {**dict.fromkeys(_RESISTANCE, 1.0), **dict.fromkeys(_MECHANICAL, -1.0)},
    "angle": {_GAIN: -1.0, **dict.fromkeys(_TORQUE, -1.0), **dict.fromkeys(_MECHANICAL, -1.0),
              **dict.fromkeys(_SQUARED, -2.0)},
}
_FEWEST = 2
_APART = 3.5  # standard errors, beyond which something is still contradicted
_NUMBERS = {2: "both", 3: "all three", 4: "all four", 5: "all five"}


class Contradicted(Protocol):
    """A number by logs, and by a file (SI)."""

    @property
    def name(self) -> str: ...  # noqa: D102 - as of `Yielded`
    @property
    def file(self) -> float: ...  # noqa: D102
    @property
    def file_std(self) -> float: ...  # noqa: D102
    @property
    def logs(self) -> float: ...  # noqa: D102
    @property
    def logs_std(self) -> float: ...  # noqa: D102


class Agreeing(NamedTuple):
    """A number of which logs and file do not contradict each other; as `Contradicted`."""

    name: str
    file: float
    file_std: float
    logs: float
    logs_std: float


class _Scale(NamedTuple):
    """The factor that explains everything best, and the largest contradiction that is left [standard errors]."""

    factor: float
    left: float


def common_cause(contradicted: Sequence[Contradicted], agreeing: Sequence[Contradicted] = (), *, voltage: float,
                 drop_voltage: float = 0.0) -> str | None:
    """Return one sentence on the voltage or the scale that would explain all contradictions; None without one.

    Parameters
    ----------
    contradicted : sequence of Contradicted
        At least two, or the gain of the potentiometer, which a scale of the angle explains as well.
    agreeing : sequence of Contradicted
        Numbers that must not be contradicted by it.
    voltage, drop_voltage : float
        That are said of the supply, and the drop of the bridge [V].

    Examples
    --------
    >>> items = [Agreeing("motor.armature_resistance", 3.0, 0.1, 4.15, 0.05),
    ...          Agreeing("output_torque_constant", 1.0, 0.01, 1.176, 0.01)]
    >>> print(common_cause(items, voltage=6.0))
    a supply of 5.1 V instead of 6 V would explain both: measure it, or search for supply.open_circuit_voltage
    """
    known = [one for one in contradicted if _usable(one)]
    fewest = 1 if any(one.name == _GAIN for one in known) else _FEWEST
    if len(known) < max(fewest, len(contradicted)):
        return None
    others = [one for one in agreeing if _usable(one)]
    found = {cause: _scale(known, others, powers) for cause, powers in _POWERS.items()
             if all(one.name in powers for one in known) and (cause != "angle" or fewest == 1)}
    good = {cause: scale for cause, scale in found.items() if scale.left < _APART}
    if not good:
        return None
    cause = min(good, key=lambda name: good[name].left)
    factor, many = good[cause].factor, _NUMBERS.get(len(known), f"all {len(known)}")
    if cause == "voltage":
        supply = drop_voltage + factor * (voltage - drop_voltage)
        return (f"a supply of {supply:.2g} V instead of {voltage:g} V would explain {many}: measure it, or search for "
                "supply.open_circuit_voltage")
    if cause == "angle":
        return (f"or the angle is scaled by {factor:.3g}, and torque constant, friction and inertia with it: check "
                "what its sensor counts")
    return (f"loads {factor:.2g} times as large as the logs say would explain {many}: check them, or search for one, "
            "such as load.inertia")


def _usable(one: Contradicted) -> bool:
    return min(one.file, one.logs) > 0.0 and all(math.isfinite(x) for x in (one.file_std, one.logs_std))


def _scale(known: Sequence[Contradicted], others: Sequence[Contradicted], powers: Mapping[str, float]) -> _Scale:
    """Return the factor by least squares of logarithms, and how far the worst number is off with it."""
    items = [*known, *others]
    power = np.array([powers.get(one.name, 0.0) for one in items])
    off = np.array([math.log(one.logs / one.file) for one in items])
    std = np.array([math.hypot(one.file_std / one.file, one.logs_std / one.logs) for one in items])
    std = np.maximum(std, 1e-6)
    x = float(np.sum(power * off / std**2) / np.sum(power**2 / std**2))
    return _Scale(math.exp(x), float(np.max(np.abs(off - power * x) / std)))
