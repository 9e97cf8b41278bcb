"""The rig of logs that are compared with a known servo: delay, offsets, and when pulses come; never the servo."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Loss, Prior
from servotwin.identification.fitting.begin import Begin
from servotwin.identification.fitting.first_offset import first_offset
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.frames import changes, gaps, has_pulses
from servotwin.identification.fitting.point import DELAY_SCALE, OFFSET_SCALE, SHARED, Point
from servotwin.identification.fitting.scatter import scatter_of
from servotwin.identification.fitting.task import HUBER, Task
from servotwin.logs.log import Log
from servotwin.models import Model

Array = NDArray[np.float64]

_PERIOD = "electronics.frame_period"
DELAYS = (0.0, 0.02, 0.04, 0.06, 0.09)
"""Where a search for the delay may begin [s]."""
RIG = ("delay", "angle_offset")
"""What a rig has that a servo has not: how late commands act, and where its angle is 0."""
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
        Whose searched numbers all stay.
    start : Point
        Where the search begins.
    asked : sequence of str
        What is searched.
    show : callable
        Told the share that is done, and what goes on.
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
