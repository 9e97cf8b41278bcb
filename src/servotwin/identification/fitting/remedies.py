"""What would tell apart what logs cannot: further sensors and known loads, tried in simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.point import Point
from servotwin.identification.fitting.words import Unidentifiable
from servotwin.loads import Inertia, Pendulum
from servotwin.logs.log import Log

Array = NDArray[np.float64]

_SENSORS = {"output_angle": "an encoder at the output", "feedback_voltage": "a potentiometer tap",
            "armature_current": "a motor current measurement", "supply_current": "a supply current measurement"}
_NOISE = 0.01  # of a sensor's largest value, assumed of a further one
_STEP = 1e-3  # of a searched number
_MOST = 6  # logs that are tried


def with_remedies(forecast: Forecast, point: Point, items: Sequence[Unidentifiable],
                  names: Sequence[str]) -> tuple[Unidentifiable, ...]:
    """Return what is not determined, each with what would determine it."""
    return tuple(replace(item, remedies=_remedies(forecast, point, item, names)) for item in items)


def _remedies(forecast: Forecast, point: Point, item: Unidentifiable, names: Sequence[str]) -> tuple[str, ...]:
    direction = np.zeros(len(names))
    for name, part in zip(item.parameters, item.direction, strict=True):
        direction[list(names).index(name)] = part
    direction /= np.linalg.norm(direction)
    some = range(0, len(forecast.cases), max(1, len(forecast.cases) // _MOST))
    logs = [forecast.cases[k].log for k in some]
    own = tuple(point.own[k] for k in some)
    here = Point(point.shared, own, tuple(point.frames[k] for k in some) if point.frames else ())
    found = [text for sensor, text in _SENSORS.items()
             if sensor not in forecast.sensors and sensor in forecast.model.available
             and _tells(forecast, [_measuring(log, sensor) for log in logs], sensor, here, direction)]
    sensor = forecast.sensors[0]
    inertia = _output_inertia(forecast)
    loads: dict[str, Inertia | Pendulum] = {"a known inertia at the horn": Inertia(inertia),
             "a known weight on an arm": Pendulum(mass=inertia / 0.1**2, length=0.1)}
    for text, load in loads.items():
        if not found and _tells(forecast, [replace(log, load=log.load + load) for log in logs], sensor, here,
                                direction):
            found.append(text)
    return tuple(found[:2]) or ((f"a known {item.parameters[0]}",) if len(item.parameters) > 1 else ())


def _output_inertia(forecast: Forecast) -> float:
    reduction = forecast.model.value("gear.gear_reduction")
    return float(reduction**2) * forecast.model.value("motor.rotor_inertia")


def _measuring(log: Log, sensor: str) -> Log:
    return replace(log, measured={**log.measured, sensor: np.zeros(len(log.time))})


def _tells(forecast: Forecast, logs: Sequence[Log], sensor: str, point: Point, direction: Array) -> bool:
    """Tell whether a signal of some logs would change visibly along a direction."""
    try:
        tried = Forecast(logs, forecast.model, forecast.space, forecast.nuisance, [sensor], forecast.running)
        tried.strict = False
        ends = [point._replace(shared=point.shared + side * _STEP * direction) for side in (1.0, -1.0)]
        ahead, behind = ([part.residual for part in parts] for parts in tried.at_all(ends))
    except InputError:
        return False
    change = np.concatenate([a - b for a, b in zip(ahead, behind, strict=True)]) / (2.0 * _STEP)
    values = np.concatenate(ahead)
    if not (np.isfinite(change).all() and np.isfinite(values).all()):
        return False
    noise = max(_NOISE * float(np.abs(values).max(initial=0.0)), 1e-12)
    return float(np.linalg.norm(change)) / noise > 2.0  # standard errors of half such a step
