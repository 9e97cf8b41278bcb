"""What a log says without a fit: where the servo was asked to be, where its shaft was, and how fast it may be."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.frames import has_pulses
from servotwin.logs.log import Log
from servotwin.models import Model

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_AROUND = 5  # samples
_SIGMAS = 6.0
_NORMAL_D2 = 1.4826 / math.sqrt(6.0)  # of the median magnitude of second differences of white noise


@dataclass(frozen=True)
class Finding:
    """Something in a log that is probably not what the servo did.

    Parameters
    ----------
    kind : str
        "wrap", "stamps", "rows", "sign", "span", "not followed" or "pulses".
    log : str
        Name of the log.
    sentence : str
        What is seen, when, and what to do.
    mended : Log, optional
        The log with this, and the kinds before it in the list, put right; None where nobody can say how.

    Examples
    --------
    >>> Finding("sign", "run 1", "the angle turns against the command", None).kind
    'sign'
    """

    kind: str
    log: str
    sentence: str
    mended: Log | None


@dataclass(frozen=True)
class Look:
    """One log in angles.

    Parameters
    ----------
    log : Log
    model : Model
        With what the log says of its servo.
    time : ndarray, shape (n,)
        From the first sample on [s].
    asked : ndarray, shape (n,)
        Where an unloaded servo would stand under each command, within its stops [rad].
    drive : ndarray, shape (n,)
        The command as the model takes it: pulse width [s] or control voltage [V].
    angle : ndarray, shape (n,)
        Measured; nan where nothing was [rad].
    counts : ndarray of bool, shape (n,)
        Where the angle counts, and pulses come.
    smooth : ndarray of bool, shape (n,)
        Those of them that are no further from the ones around than a shaft goes meanwhile: no outliers.
    noise : float
        Of the angle, from second differences [rad].
    top_speed : float
        Without load, by the servo file [rad/s].
    """

    log: Log
    model: Model
    time: Array
    asked: Array
    drive: Array
    angle: Array
    counts: Mask
    smooth: Mask
    noise: float
    top_speed: float

    def with_angle(self, angle: Array) -> Log:
        """Return the log with another angle in place of its own [rad]."""
        name = self.log.angle_name
        values = angle * _gain(self.model) + _offset(self.model) if name == "feedback_voltage" else angle
        return replace(self.log, measured={**self.log.measured, name: values})

    def gap(self) -> float:
        """Return how far the measured angles lie from the commanded ones in the middle [rad]."""
        return float(np.median((self.angle - self.asked)[self.counts]))


def look(log: Log, model: Model) -> Look | None:
    """Return a log in angles; None where the model cannot follow its command, which is told elsewhere."""
    own = {name: value for name, value in log.parameters.items() if name in (*model.requires, *model.optional)}
    try:
        with warnings.catch_warnings():  # of two calibrations that differ: it was said of the servo itself
            warnings.simplefilter("ignore")
            here = type(model)(model.servo.replace(own)) if own else model
            made = log.signal(own.get("electronics.frame_period", getattr(here, "frame_period", None)))
            drives = here.command(replace(made, edges=None) if not has_pulses(here) else made)
            speed = _top_speed(here)
    except ServotwinError:
        return None
    time = log.time - log.time[0]
    _, first, where = np.unique(log.held, return_index=True, return_inverse=True)
    levels = drives(time[first])
    drive, asked = levels[where], np.asarray(here.start_angle(cast("Any", levels)))[where]
    name = log.angle_name
    values = log.measured[name]
    angle = (values - _offset(here)) / _gain(here) if name == "feedback_voltage" else values
    counts = log.used(name) & log.sent
    noise = rough_noise(angle[counts])
    smooth = counts.copy()
    smooth[counts] = _near_others(time[counts], angle[counts], speed, noise)
    return Look(log, here, time, asked, drive, np.asarray(angle), counts, smooth, noise, speed)


def _near_others(time: Array, angle: Array, speed: float, noise: float) -> Mask:
    """Tell which angles are no further from the median around them than a shaft goes between two samples."""
    if len(time) < _AROUND:
        return np.ones(len(time), np.bool_)
    around = np.median(sliding_window_view(np.pad(angle, _AROUND // 2, mode="edge"), _AROUND), axis=1)
    return np.asarray(np.abs(angle - around) <= speed * float(np.median(np.diff(time))) + _SIGMAS * noise)


def aligned(one: Look, angle: Array, others: Sequence[Look], *, steps_of: float = 0.0) -> Array:
    """Return a corrected angle, shifted so that it lies beside its commands as those of other logs do [rad].

    Parameters
    ----------
    one : Look
    angle : ndarray, shape (n,)
        Corrected, but for a constant [rad].
    others : sequence of Look
        Logs of the same rig that need no correction; without any, and no `steps_of`, nothing is shifted.
    steps_of : float
        Shift by multiples of this only [rad].
    """
    if not others and not steps_of:
        return angle
    usual = float(np.median([other.gap() for other in others])) if others else 0.0
    shift = usual - float(np.median((angle - one.asked)[one.counts]))
    return angle + (steps_of * round(shift / steps_of) if steps_of else shift)


def said_times(time: Array, most: int = 3) -> str:
    """Return how often something happens, and the first times.

    Examples
    --------
    >>> said_times(np.array([0.5, 1.25, 2.0, 7.0]))
    '4 times, at 0.5, 1.25, 2 s, ...'
    """
    first = ", ".join(f"{t:.4g}" for t in time[:most])
    count = "once" if len(time) == 1 else f"{len(time)} times"
    return f"{count}, at {first} s" + (", ..." if len(time) > most else "")


def rough_noise(values: Array) -> float:
    """Return the noise of an otherwise smooth signal, from the median of its second differences; at least its steps'.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> 0.009 < rough_noise(np.sin(np.linspace(0.0, 6.0, 500)) + 0.01 * rng.standard_normal(500)) < 0.011
    True
    """
    if len(values) < 4:
        return 0.0
    steps = np.abs(np.diff(values))
    step = float(steps[steps > 0.0].min(initial=math.inf))
    seen = _NORMAL_D2 * float(np.median(np.abs(np.diff(values, n=2))))
    return max(seen, step / math.sqrt(12.0) if math.isfinite(step) else 0.0)


def _gain(model: Model) -> float:
    return model.value_or("potentiometer.feedback_gain", 1.0)


def _offset(model: Model) -> float:
    return model.value_or("potentiometer.feedback_offset", 0.0)


def _top_speed(model: Model) -> float:
    gain: float = model.value("gear.gear_reduction") * model.value("motor.back_emf_constant")
    return float(model.value("supply.open_circuit_voltage") / gain)
