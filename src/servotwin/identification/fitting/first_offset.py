"""Where the searches for an offset and a delay begin: how far measured angles lie from commanded ones, and how late."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from servotwin.identification.fitting.case import Case
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.point import DELAY_SCALE, Point
from servotwin.models import DigitalServo, Model

if TYPE_CHECKING:
    from servotwin.identification.fitting.task import Task

_OF_GOALS = (0.001, 0.002, 0.005, 0.01)  # s: a bus carries a goal sooner than pulses do
DELAYS = (0.02, 0.0, 0.04, 0.06, 0.09)  # s, where the search for it begins, and some others
_NEAR = 0.3  # rad, an offset that the search finds by itself
_LOOKS = 25  # of each log


def first_offset(forecast: Forecast, fitted: Sequence[int]) -> float:
    """Return how far the measured angles lie from the commanded ones in the middle; 0 where that is near [rad]."""
    if "angle_offset" not in forecast.extra:
        return 0.0
    gaps: list[float] = []
    for case in (forecast.cases[k] for k in fitted):
        place = case.places.get("output_angle", np.zeros(0, np.int64))
        model = _model_of(forecast, case)
        drive = model.command(case.signal)
        some = np.arange(0, len(place), max(1, len(place) // _LOOKS))
        asked = np.asarray(model.start_angle(cast("Any", drive(case.times[place[some]]))))
        gaps += (case.values["output_angle"][some] - asked).tolist() if len(some) else []
    middle = float(np.median(gaps)) if gaps else 0.0
    return middle if abs(middle) > _NEAR else 0.0


def at_likely_delay(task: Task, point: Point) -> Point:
    """Return the point with the delay of which the residuals are smallest, of some usual ones, if none is known."""
    forecast = task.forecast
    if "delay" not in forecast.extra or "delay" in task.begin.shared:
        return point
    place, tried = len(forecast.space) + forecast.extra.index("delay"), []
    goals = isinstance(forecast.model, DigitalServo) and forecast.model.takes_goals
    for delay in (*DELAYS, *(_OF_GOALS if goals else ())):
        shared = point.shared.copy()
        shared[place] = delay / DELAY_SCALE
        tried.append(point._replace(shared=shared))
    found = forecast.at_all(tried, cases=task.few())
    sizes = [sum(float(np.abs(part.residual).sum()) for part in parts) for parts in found]
    return tried[int(np.argmin([size if math.isfinite(size) else math.inf for size in sizes]))]


def _model_of(forecast: Forecast, case: Case) -> Model:
    """Return the model with what a log says of its servo."""
    model = forecast.model
    own = {name: value for name, value in case.log.parameters.items() if name in (*model.requires, *model.optional)}
    if not own:
        return model
    with warnings.catch_warnings():  # of two calibrations that differ: it was said of the servo itself
        warnings.simplefilter("ignore")
        return type(model)(model.servo.replace(own))
