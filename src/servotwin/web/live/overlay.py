"""A measured log over its twin: the servo under the log's own command, and what is left between them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.identification.fitting.fit import Validation
from servotwin.identification.fitting.traces import Trace
from servotwin.identification.fitting.validate import validate
from servotwin.identification.report.pictures import rig_text, sensor_shown
from servotwin.loads import Load
from servotwin.logs import Log

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.models import Model
    from servotwin.parameters import Servo

RIG = ("delay", "frame_phase", "angle_offset")
"""Numbers of a log's rig, not of its servo."""
_FRAME_PERIOD = "electronics.frame_period"
_ALIKE, _TINY = 1.02, 1e-6  # times the error, and rad or V beside: what is no better
STRETCHES = 500  # of a picture: of each, the extremes are shown


def of_the_bench(log: Log, model: type[Model], servo: Servo, load: Load, frame_rate: float) -> Log:
    """Return a log with what hangs on the shaft and how often pulses come as on the bench, where it says neither.

    Parameters
    ----------
    log : Log
    model : type of Model
    servo : Servo
    load : Load
    frame_rate : float
        [Hz]

    Examples
    --------
    >>> import servotwin as st
    >>> log = Log(name="a", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0]})
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> of_the_bench(log, st.PulseServo, servo, st.loads.Inertia(1e-3), 100.0).parameters["electronics.frame_period"]
    0.01
    """
    made = model(servo)
    known = dict(log.parameters)
    if _FRAME_PERIOD in (*made.requires, *made.optional):
        known.setdefault(_FRAME_PERIOD, 1.0 / frame_rate)
    return replace(log, parameters=known, load=load if log.load == Load() else log.load)


def compared(log: Log, servo: Servo, model: type[Model], *, fit_rig: bool) -> dict[str, Any]:
    """Return a log over the servo as a page draws it.

    Parameters
    ----------
    log : Log
        As `of_the_bench` returns it.
    servo : Servo
    model : type of Model
    fit_rig : bool
        Whether delay, phase of the pulses and zero of the angle are fitted to the log first.

    Raises
    ------
    InputError
        If the model does not follow such a log.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...           measured={"output_angle": run["output_angle"]})
    >>> found = compared(log, servo, st.PulseServo, fit_rig=False)
    >>> found["rms"] < 1e-6, found["unit"], found["model"]
    (True, '°', 'PulseServo')
    """
    found = _best(log, servo, model) if fit_rig else validate([log], servo, model)
    facts = trace_facts(found.traces[0])
    return {**facts, "servo": servo.title or servo.name, "model": type(found.model).__name__,
            "rig": [rig_text(name, value) for name, value in found.nuisance.items()],
            "rig_fitted": bool(found.fitted),
            "warnings": list(found.warnings)}


def _best(log: Log, servo: Servo, model: type[Model]) -> Validation:
    """Return the servo beside a log with the rig of which it is off least, of some: a search may end in a ditch."""
    tried = [validate([log], servo, model, nuisance=rig) for rig in (RIG, ("angle_offset",), ())]
    least = min(_late(one) for one in tried)
    return [one for one in tried if _late(one) <= _ALIKE * least + _TINY][-1]  # the simplest of equals


def _late(found: Validation) -> float:
    """Return the rms error in the second half, which no rig was fitted to where pulses have a phase (SI)."""
    trace, = found.traces
    late = trace.time - trace.log.start >= 0.5 * trace.log.duration
    return float(np.sqrt(np.mean(trace.residual[late]**2))) if late.any() else trace.error.rms


def trace_facts(trace: Trace) -> dict[str, Any]:
    """Return a log beside its simulation as plain values: thinned to what shows, and how far it is off.

    Times count from the first sample [s]; angles are in degrees, voltages in volts.
    """
    factor, unit = sensor_shown(trace.signal)
    time = trace.time - trace.log.start
    residual = -trace.residual  # measured less simulated: what the twin lacks
    judged = np.flatnonzero(trace.judged)
    worst = judged[int(np.argmax(np.abs(residual[judged])))]
    some = shown(trace.measured, trace.simulated, residual)
    return {
        "log": trace.log.name, "signal": trace.signal, "unit": unit,
        "time": _numbers(time[some]), "measured": _numbers(factor * trace.measured[some]),
        "simulated": _numbers(factor * trace.simulated[some]), "residual": _numbers(factor * residual[some]),
        "rms": factor * trace.error.rms, "worst": factor * float(residual[worst]), "worst_at": float(time[worst]),
        "samples": len(judged), "judged_from": float(time[judged[0]]), "duration": trace.log.duration}


def shown(*signals: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the samples of which a picture is drawn: all, or the extremes of each signal in each of 500 stretches.

    Examples
    --------
    >>> shown(np.zeros(3)).tolist(), bool(77777 in shown(np.eye(1, 100000, 77777)[0]))
    ([0, 1, 2], True)
    """
    n = len(signals[0])
    if n <= STRETCHES * (2 * len(signals) + 1):
        return np.arange(n)
    ends = np.linspace(0, n, STRETCHES + 1).astype(np.int64)
    picked = {0, n - 1}
    for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        for signal in signals:
            part = signal[a:b]
            picked |= {a, a + int(np.argmin(part)), a + int(np.argmax(part))}
    return np.array(sorted(picked), dtype=np.int64)


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    """Return numbers as they are sent: to six digits."""
    return [float(f"{x:.6g}") if math.isfinite(x) else None for x in values.tolist()]
