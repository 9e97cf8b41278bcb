"""`validate`: how far a servo that is known is off logs, without fitting any parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServoFileError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.arrow import Loss
from servotwin.identification.fitting.batches import Running
from servotwin.identification.fitting.findings import explained, first_looks
from servotwin.identification.fitting.fit import Trace
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.free import Space
from servotwin.identification.fitting.held_out import trace_of, with_pulses_of
from servotwin.identification.fitting.holdout import ErrorTable
from servotwin.identification.fitting.point import NUISANCES, SHARED, LogPart, Point
from servotwin.identification.fitting.registers import RegisterSearch, as_logs_say, register_search
from servotwin.identification.fitting.rig import RIG, fitted_rig, has_unknown_phase, likely_rig, with_known
from servotwin.identification.fitting.scatter import scatter_of
from servotwin.identification.fitting.task import HUBER
from servotwin.logs.log import Log
from servotwin.models import MODELS, Model
from servotwin.models.engine.memory import ACCURACY
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.units import is_finite

Array = NDArray[np.float64]
Progress = bool | Callable[[float, str], object]

_FINE = 1e-3  # rad, of an error: of less nobody asks
_FAR_LESS = 0.5  # of an error: what is said
_ANY = ("motor.armature_resistance", "motor.rotor_inertia", "motor.torque_constant", "gear.gear_reduction")


@dataclass(frozen=True, kw_only=True, eq=False)
class Validation:
    """How far a servo is off some logs.

    Parameters
    ----------
    servo : Servo
    model : Model
    errors : ErrorTable
        By log, of this one model.
    traces : tuple of Trace
        Every log beside the simulation.
    nuisance : mapping of str to float
        Delay [s], angle offset [rad] and sag [rad/V] that were used.
    fitted : tuple of str
        Which nuisances were fitted to these logs; the others come from the servo file's record of its fit, or are 0.
    noise : mapping of str to float
        How far the residuals of each sensor scatter, robust (SI).
    warnings : tuple of str
        What is probably wrong with the logs, a line each.
    registers : RegisterSearch, optional
        Of a bus servo: what stands in registers that logs did not record.
    """

    servo: Servo
    model: Model
    errors: ErrorTable = field(repr=False)
    traces: tuple[Trace, ...] = field(repr=False)
    nuisance: Mapping[str, float]
    fitted: tuple[str, ...]
    noise: Mapping[str, float]
    warnings: tuple[str, ...] = ()
    registers: RegisterSearch | None = field(default=None, repr=False)

    @property
    def total(self) -> float:
        """Rms error over all samples of all logs [rad, or V where feedback voltages were measured]."""
        return self.errors.total()[type(self.model).__name__]

    def report(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write an HTML page: errors, measured over simulated, residuals.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        from servotwin.identification.report.validation import write_validation

        return write_validation(self, Path(path), overwrite=overwrite)


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
        What is put right in the logs first, as of `identify`.
    nuisance : sequence of str
        What belongs to the rig and is fitted to these logs: as of `identify`. Where that is no nearer than no rig at
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
    free = list(load) or [next(name for name in _ANY if name not in taken)]
    return Space(model, free, load=load)


def _failures(forecast: Forecast, parts: Sequence[LogPart]) -> None:
    for case, part in zip(forecast.cases, parts, strict=True):
        if not np.isfinite(part.residual).all():
            raise InputError(f"log {case.log.name!r}", got="a simulation that does not reach its end",
                             allowed="a servo and a load that can be simulated")


def _noise(forecast: Forecast, parts: Sequence[LogPart]) -> dict[str, float]:
    """Return how far the residuals of each sensor scatter (SI)."""
    return {**forecast.noise, **scatter_of(forecast, parts, range(len(parts)))}

