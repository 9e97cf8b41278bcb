"""Candidates of which residuals tell the shape: a bent potentiometer, rounded commands, a wrong register for P."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.diagnosis.bench import Setting, TrialBench
from servotwin.identification.fitting.diagnosis.gain import teaching
from servotwin.logs.log import Log
from servotwin.models import DigitalServo

Array = NDArray[np.float64]

GAIN = "firmware.proportional_gain"
FACTORS = (0.4, 0.6, 0.8, 1.25, 1.6, 2.5)
"""Of P: what a register may be wrong by."""
_BENT = ("potentiometer.linearity_angle", "potentiometer.linearity_error")
_SIZES = (1.0, 1.4)  # times what the residuals tell: the fit has bent some of it away
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
        for size in _SIZES:
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
        weight = np.sqrt(np.minimum(1.0, 1.345 * 1.4826 * float(np.median(left)) / np.maximum(left, 1e-12)))
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
