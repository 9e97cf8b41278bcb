"""Which searched numbers the logs can hardly tell, before any search: the information of one Jacobian beside priors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from servotwin.identification.fitting.arrow import Loss, Prior
from servotwin.identification.fitting.case import Case
from servotwin.identification.fitting.free import nominal
from servotwin.identification.fitting.suspicions.look import rough_noise
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import rows_of

_FACTOR = 1.0  # standard error (scaled), a factor of e, beyond which a number without a prior is not told
_LEAST = 1e-9  # SI
_INERTIAS = ("output_inertia", "motor.rotor_inertia")


@dataclass(frozen=True)
class Foreseen:
    """A searched number of which the logs say less than what is known without them.

    Parameters
    ----------
    name : str
    alone : float
        Its standard error by the logs if all other numbers were known, relative to its value or to a typical one; inf
        where they say nothing.
    prior : float
        The same by its prior; inf where there is none.
    reason : str
        Why, where a simple cause is seen.
    """

    name: str
    alone: float
    prior: float
    reason: str = ""

    def __str__(self) -> str:
        """Return it as one line.

        Examples
        --------
        >>> print(Foreseen("output_inertia", 3.0, 0.2, "samples are 500 ms apart, the motor settles in 20 ms"))
        these logs hardly tell output_inertia (±300 % with all else known; prior ±20 %): samples are 500 ms apart, the \
motor settles in 20 ms
        """
        told = f"±{100.0 * self.alone:.3g} %" if self.alone < 10.0 else "not even"
        prior = f"; prior ±{100.0 * self.prior:.3g} %" if math.isfinite(self.prior) else ""
        why = f": {self.reason}" if self.reason else ""
        return f"these logs hardly tell {self.name} ({told} with all else known{prior}){why}"


def foreseen(task: Task) -> tuple[Foreseen, ...]:
    """Return which searched numbers the fitted logs can hardly tell, by the derivatives where the search begins.

    A number is told if the logs alone, with all other shared numbers known, leave a standard error below that of its
    prior, or below a factor of e where it has none. That is necessary, not enough: several numbers may still be told
    together only, which the fit says at its end. Noise is that which neighbouring samples show.
    """
    forecast = task.forecast
    noise, strict = forecast.noise, forecast.strict
    cases = [forecast.cases[k] for k in task.fitted]
    point = task.nominal()
    try:
        forecast.noise = {**noise, **{name: _noise(cases, name) for name in forecast.sensors}}
        forecast.strict = False
        with forecast.roughly():
            parts = forecast.at(point, cases=task.fitted)
        beliefs = [Prior(*forecast.own_belief(case)) for case in cases]
    finally:
        forecast.noise, forecast.strict = noise, strict
    if not all(np.isfinite(part.residual).all() and np.isfinite(part.shared).all() for part in parts):
        return ()
    rows = [rows_of(part, Loss(math.inf), own, point.own[k])
            for k, part, own in zip(task.fitted, parts, beliefs, strict=True)]
    information = sum((row.slope**2).sum(axis=0) for row in rows)
    found = []
    for k, p in enumerate(forecast.space.parameters):
        alone = 1.0 / math.sqrt(information[k]) if information[k] > 0.0 else math.inf
        prior = math.inf if p.scaled_prior is None else p.scaled_prior[1]
        if alone > min(prior, _FACTOR):
            found.append(Foreseen(p.name, alone, prior, _reason(task, cases, p.name)))
    return tuple(found)


def _noise(cases: list[Case], name: str) -> float:
    """Return the noise of a sensor that neighbours show, at least that of its counts (SI)."""
    values = [case.values[name] for case in cases if name in case.values and len(case.values[name])]
    if not values:
        return 1.0
    return max(float(np.median([rough_noise(each) for each in values])), _LEAST)


def _reason(task: Task, cases: list[Case], name: str) -> str:
    """Return a simple cause why a number cannot be told; nothing where none is seen."""
    if not any(case.log.changes.size for case in cases):
        return "the command never changes"
    servo = task.forecast.model.servo
    step = float(np.median([np.median(np.diff(case.log.time)) for case in cases]))
    J, R, K = (nominal(servo, one) for one in ("output_inertia", "motor.armature_resistance", "output_torque_constant"))
    if name in _INERTIAS and J and R and K and step > (settles := J * R / K**2):
        return f"samples are {1e3 * step:.3g} ms apart, the motor settles in {1e3 * settles:.2g} ms"
    return ""
