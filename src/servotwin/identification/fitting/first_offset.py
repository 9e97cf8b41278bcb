"""How far measured angles lie from commanded ones: where the search for their offset begins."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from servotwin.identification.fitting.case import Case
from servotwin.identification.fitting.forecast import Forecast
from servotwin.models import Model

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


def _model_of(forecast: Forecast, case: Case) -> Model:
    """Return the model with what a log says of its servo."""
    model = forecast.model
    own = {name: value for name, value in case.log.parameters.items() if name in (*model.requires, *model.optional)}
    if not own:
        return model
    with warnings.catch_warnings():  # of two calibrations that differ: it was said of the servo itself
        warnings.simplefilter("ignore")
        return type(model)(model.servo.replace(own))
