"""The lanes of one log at one point of a search, and what their signals say."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.free import Space
from servotwin.identification.fitting.point import DELAY_SCALE, OFFSET_SCALE, SAG_SCALE, SPEED_SCALE, LogPart, Point

if TYPE_CHECKING:
    from servotwin.identification.fitting.forecast import Forecast

Array = NDArray[np.float64]


class LogLanes:
    """The lanes of one log at one point: the nominal one, and one for each number that is varied."""

    def __init__(self, forecast: Forecast, k: int, at: int, point: Point, *, sides: int, step: float) -> None:
        self.forecast, self.case, self.at, self.sides = forecast, forecast.cases[k], at, sides
        p, names = len(forecast.space), forecast.names_of_own(self.case)
        self.names, own = names, dict(zip(names, point.own[k], strict=True))
        self.delay = forecast.nuisance_of(point.shared, "delay") + own.get("log_delay", 0.0) * DELAY_SCALE
        self.offset = forecast.nuisance_of(point.shared, "angle_offset")
        self.sag = forecast.nuisance_of(point.shared, "angle_sag")
        self.varied = [name for name in names if name != "log_delay"]
        numbers = p + len(self.varied)
        self.count = 1 + sides * numbers
        self.cost = self.count * self.case.log.duration
        self.x = np.repeat(point.shared[None, :p], self.count, axis=0)
        angle = own.get("output_angle", self.case.start[0] / OFFSET_SCALE) * OFFSET_SCALE - self.offset
        self.angle = np.full(self.count, angle)
        self.speed = np.full(self.count, own.get("output_speed", 0.0) * SPEED_SCALE)
        self.steps = _steps(forecast.space, point.shared[:p], numbers, sides, step)
        for side in range(sides):
            first = 1 + side * numbers
            self.x[np.arange(first, first + p), np.arange(p)] += self.steps[side, :p]
            for i, name in enumerate(self.varied):
                column, scale = (self.angle, OFFSET_SCALE) if name == "output_angle" else (self.speed, SPEED_SCALE)
                column[first + p + i] += self.steps[side, p + i] * scale
        self.signal = self.case.signal
        self.delayed = sides > 0 and ("delay" in forecast.extra or "log_delay" in names)
        self.needs_rate = self.delayed and any(name != "output_angle" for name in self.case.places)
        self.part: LogPart

    def fail(self) -> None:
        """Make a part that is nan."""
        m, own = self.case.count, len(self.names)
        width = self.forecast.size if self.sides else 0
        self.part = LogPart(np.full(m, np.nan), np.full((m, width), np.nan),
                         np.full((m, own if self.sides else 0), np.nan))

    def take(self, signals: dict[str, Array], early: Array, later: float) -> None:
        """Make the part of the log from the lanes' signals."""
        forecast, case, p = self.forecast, self.case, len(self.forecast.space)
        k = len(case.times)
        residuals, shared, own = [], [], []
        for name, place in case.places.items():
            values = signals[name][:, :k]
            speed = signals["output_speed"][0, :k]
            rate = speed
            if name == "output_angle":
                # Before the command of the first sample acts, the servo goes on as it began
                values = values + self.speed[:, None] * early + self.offset
                if "sag" in signals:
                    values = values + self.sag * signals["sag"][:, :k]
            elif later:
                rate = (signals[name][0, k:] - values[0]) / later
            sigma = forecast.noise[name]
            y = values[:, place] / sigma
            residuals.append(y[0] - case.values[name] / sigma)
            if not self.sides:
                continue
            of_delay = -rate[place] * DELAY_SCALE / sigma
            sloped = self._sloped(y).T
            # An angle that is read too high: the shaft's own start is as much lower
            of_offset = np.full(len(place), OFFSET_SCALE / sigma if name == "output_angle" else 0.0)
            extra = {"delay": of_delay, "angle_offset": of_offset}
            if "sag" in signals:
                there = signals["sag"][0, place] if name == "output_angle" else np.zeros(len(place))
                extra["angle_sag"] = there * (SAG_SCALE / sigma)
            starts = {which: sloped[:, p + i] for i, which in enumerate(self.varied)}
            if "output_angle" in starts:
                extra["angle_offset"] = of_offset - starts["output_angle"]
            shared.append(np.column_stack([sloped[:, :p], *(extra[n] for n in forecast.extra)]))
            columns = [starts[n] if n in starts else of_delay for n in self.names]
            own.append(np.column_stack(columns) if columns else np.zeros((len(place), 0)))
        residual = np.concatenate(residuals)
        if not self.sides:
            self.part = LogPart(residual, np.zeros((len(residual), 0)), np.zeros((len(residual), 0)))
            return
        self.part = LogPart(residual, np.concatenate(shared), np.concatenate(own))

    def _sloped(self, y: Array) -> Array:
        """Return the derivatives of the lanes' signals by every varied number, a row each."""
        n = self.steps.shape[1]
        if self.sides == 1:
            return np.asarray((y[1:] - y[0]) / self.steps[0][:, None])
        return np.asarray((y[1:1 + n] - y[1 + n:]) / (self.steps[0] - self.steps[1])[:, None])


def _steps(space: Space, x: Array, numbers: int, sides: int, step: float) -> Array:
    """Return the steps of all varied numbers, one row a side; none leaves the bounds of the search."""
    steps = np.full((sides, numbers), step)
    p = len(x)
    if sides == 1:
        steps[0, :p] = np.where(x + step > space.upper, -step, step)
    elif sides:
        steps[0, :p] = np.where(x + step > space.upper, 0.0, step)
        steps[1] = -step
        steps[1, :p] = np.where(x - step < space.lower, 0.0, -step)
    return steps
