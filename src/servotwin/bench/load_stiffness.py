"""From how far loads pull a servo off its goal to the gain of its loop, by the servo's own simulation at rest."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING

import numpy as np

from servotwin.bench.table_parameters import Estimate
from servotwin.datasheet.holding import changed, hold
from servotwin.models import DigitalServo, PulseServo, default_model

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from servotwin.bench.load_lines import LoadLine
    from servotwin.models import Model
    from servotwin.parameters import Servo

_FURTHEST = 8.0  # times the gain of the servo, either way
_STEP = 1.2  # of the gain, for its derivative
_VAGUE = 0.5  # of a gain: a larger standard error tells nothing
_MOST_LOADS = 6  # that are simulated: those of the table, or so many of them


def gain_of_sag(servo: Servo, sag: LoadLine) -> tuple[str, Estimate] | str:
    """Return the gain with which a servo gives way to loads as a table says; a sentence where none does.

    Deadband, friction and frame of the servo are kept: they are what the first sag is made of.

    Parameters
    ----------
    servo : Servo
    sag : LoadLine
        Angle error over load.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            model = default_model(servo)
        except ValueError as error:
            return f"the gain of the loop stays: {error}"
    name = "firmware.proportional_gain" if isinstance(model, DigitalServo) else "electronics.stretcher_gain"
    now = model.servo.get(name)
    if not isinstance(model, DigitalServo | PulseServo) or not isinstance(now, float) or not now > 0.0:
        return f"the gain of the loop stays: {type(model).__name__} of this servo has none that a sag could tell"
    loads = np.unique(sag.x.values[sag.rows])
    if loads.size > _MOST_LOADS:
        loads = np.quantile(loads, np.linspace(0.0, 1.0, _MOST_LOADS))
    wanted = sag.line.slope

    def off(log_gain: float) -> float:
        return math.log(_compliance(changed(model, {name: math.exp(log_gain)}), loads) / wanted)

    middle = math.log(now)
    found = _root(off, middle, math.log(_FURTHEST))
    if found is None:
        own = _compliance(model, loads)
        does = "" if math.isnan(own) else f"; with its {now:.4g} the servo does by {math.degrees(own):.3g}"
        return (f"{name} stays: no value from {now / _FURTHEST:.3g} to {now * _FURTHEST:.3g} gives way by "
                f"{math.degrees(wanted):.3g} ° per N m{does}")
    rate = (off(found + math.log(_STEP)) - off(found - math.log(_STEP))) / (2.0 * math.log(_STEP))
    if not math.isfinite(rate) or rate == 0.0:
        return f"{name} stays: loads of this size do not tell it"
    gain = math.exp(found)
    spread = gain * sag.line.slope_error / wanted / abs(rate)
    if spread > _VAGUE * gain:
        return (f"{name} stays: the table tells it to {100.0 * spread / gain:.0f} % only, {gain:.3g} ± {spread:.2g}; "
                "more or larger loads would tell it")
    return name, Estimate(gain, spread, "sag over load, by simulating the servo at rest; deadband, friction and frame "
                                       "of the servo")


def _compliance(model: Model, loads: NDArray[np.float64]) -> float:
    """Return how much a servo gives way per torque [rad/(N m)]; nan where it does not stand."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        errors = [hold(model, load).error for load in loads.tolist()]
    slope = float(np.polyfit(loads, errors, 1)[0]) if np.isfinite(errors).all() else math.nan
    return slope if slope > 0.0 else math.nan


def _root(off: Callable[[float], float], middle: float, furthest: float) -> float | None:
    """Return where a falling function is 0, walking from the middle outwards; None where it is not within reach."""
    from scipy.optimize import brentq

    low = off(middle)
    if math.isnan(low):
        return None
    at, step = middle, math.copysign(math.log(1.6), low)
    while abs(at + step - middle) <= furthest + 1e-9:
        after = off(at + step)
        if math.isnan(after):
            return None
        if (after > 0.0) != (low > 0.0):
            return float(brentq(off, min(at, at + step), max(at, at + step), xtol=1e-2))
        at += step
    return None
