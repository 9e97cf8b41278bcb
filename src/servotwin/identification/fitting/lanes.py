"""The lanes of one log at one point of a search, and what their signals say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.batches import Bundle
from servotwin.identification.fitting.case import (
    DELAY_SCALE,
    LATER,
    OFFSET_SCALE,
    PERIOD_SCALE,
    SAG_SCALE,
    SPEED_SCALE,
    STEP,
    LogPart,
    Point,
    signal,
)
from servotwin.simulation.lanes.inputs import LOAD_NAMES

if TYPE_CHECKING:
    from servotwin.identification.fitting.forecast import Forecast

Array = NDArray[np.float64]

_VOLTAGE = "supply.open_circuit_voltage"
_NOISE = "potentiometer.noise"
_PLAY, _TEETH = "gear.backlash", "gear.gear_reduction"
_TICK, _PHASE = "firmware.control_period", "firmware.control_phase"
_DELAYS = ("log_delay", "frame_phase")  # a log's own: what they change follows from the speed, without a lane


class LogLanes:
    """The lanes of one log at one point: the nominal one, and one for each number that is varied."""

    def __init__(self, forecast: Forecast, k: int, at: int, point: Point, *, sides: int, step: float,
                 rates: bool, noise: Mapping[str, float], nearly: bool = False) -> None:
        self.nearly = nearly
        self.forecast, self.case, self.at, self.sides, self.noise = forecast, forecast.cases[k], at, sides, noise
        p, names = len(forecast.space), forecast.names_of_own(self.case)
        self.names, own = names, dict(zip(names, point.own[k], strict=True))
        self.delay = forecast.nuisance_of(point.shared, "delay") + own.get("log_delay", 0.0) * DELAY_SCALE
        self.offset = forecast.nuisance_of(point.shared, "angle_offset")
        self.sag = forecast.nuisance_of(point.shared, "angle_sag")
        self.varied = [name for name in names if name not in _DELAYS]
        self.shaped = [name for name in forecast.extra if name == "frame_period"]
        numbers = p + len(self.varied) + len(self.shaped)
        self.count = 1 + sides * numbers
        self.cost = self.count * self.case.log.duration
        self.x = np.repeat(point.shared[None, :p], self.count, axis=0)
        angle = own.get("output_angle", self.case.start[0] / OFFSET_SCALE) * OFFSET_SCALE - self.offset
        self.angle = np.full(self.count, angle)
        self.speed = np.full(self.count, own.get("output_speed", 0.0) * SPEED_SCALE)
        self.tick = np.full(self.count, own.get("control_phase", 0.0))
        columns = {"output_angle": (self.angle, OFFSET_SCALE), "output_speed": (self.speed, SPEED_SCALE),
                   "control_phase": (self.tick, 1.0)}
        self.steps = np.zeros((sides, numbers))
        if sides:
            own_lower, own_upper = self._room(own)
            open_ = np.full(len(self.shaped), np.inf)
            self.steps = _steps(
                np.concatenate([point.shared[:p], [own[name] for name in self.varied], np.zeros(len(open_))]),
                np.concatenate([forecast.space.lower, own_lower, -open_]),
                np.concatenate([forecast.space.upper, own_upper, open_]), sides, step)
            if self.shaped:  # a period that is much longer would have other pulses carry the commands
                self.steps[:, -1] = np.clip(self.steps[:, -1], -STEP, STEP)
        for side in range(sides):
            first = 1 + side * numbers
            self.x[np.arange(first, first + p), np.arange(p)] += self.steps[side, :p]
            for i, name in enumerate(self.varied):
                column, scale = columns[name]
                column[first + p + i] += self.steps[side, p + i] * scale
        self.signals = [self.case.signal] * self.count
        self.begins = 0.0  # from when on ticks are counted, where they go with the pulses [s]
        if forecast.phased:
            self._send_pulses(k, point, own["frame_phase"] * DELAY_SCALE, numbers)
        delayed = sides > 0 and ("delay" in forecast.extra or any(name in names for name in _DELAYS))
        needs_rate = (delayed or rates) and any(name != "output_angle" for name in self.case.places)
        self.later = LATER if needs_rate else 0.0
        self.times = self.case.times - self.delay
        self.part: LogPart

    def _room(self, own: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the ends of the log's own numbers that are varied: no shaft starts beyond a stop."""
        forecast, log = self.forecast, self.case.log
        columns = forecast.space.columns(self.x[:1])
        lower, upper = np.full(len(self.varied), -np.inf), np.full(len(self.varied), np.inf)
        for end, name, none in ((lower, "stops.lower_angle", -np.inf), (upper, "stops.upper_angle", np.inf)):
            stop = log.parameters.get(name, forecast.model.value_or(name, none))
            at = float(columns[name][0]) if name in columns else stop
            end[[one == "output_angle" for one in self.varied]] = (at + self.offset) / OFFSET_SCALE
        return lower, upper

    def _send_pulses(self, k: int, point: Point, first: float, numbers: int) -> None:
        """Give every lane its pulses; those of one whose period is varied come a little later one by one."""
        forecast, log = self.forecast, self.case.log
        frames, lead = forecast.frames_of(point, k), forecast.lead_at(point, k)
        self.delay -= lead
        self.begins = first + lead + frames.tick
        period = forecast.nuisance_of(point.shared, "frame_period") or frames.period
        self.signals = [forecast.command_at(point, k)] * self.count
        for side in range(self.sides if self.shaped else 0):
            longer = period + self.steps[side, numbers - 1] * PERIOD_SCALE
            self.signals[(1 + side) * numbers] = signal(log, frames, first, longer, lead)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the signals that are asked for."""
        measured = [name for name in self.forecast.sensors if name in self.case.places]
        bus = ["bus_voltage"] if "angle_sag" in self.forecast.extra else []
        return tuple(dict.fromkeys([*measured, "output_speed", *bus]))

    def bundle(self) -> Bundle:
        """Return what is simulated."""
        forecast, log = self.forecast, self.case.log
        read = (*forecast.model.requires, *forecast.model.optional)
        own = {name: np.full(self.count, value) for name, value in log.parameters.items()
               if name in LOAD_NAMES or name in read}
        if _NOISE in forecast.model.optional and forecast.model.servo.get(_NOISE):
            own[_NOISE] = np.zeros(self.count)
        columns = {**forecast.space.columns(self.x), **own}
        if _PHASE in forecast.model.optional:
            columns |= self._ticks(columns)
        asked = np.maximum(np.concatenate([self.times, self.times + self.later]) if self.later else self.times, 0.0)
        starts = "initial_state" in forecast.nuisance
        return Bundle(times=asked, duration=max(float(asked.max()), log.duration), load=log.load, signals=self.signals,
                      columns=columns,
                      initial=self._start(columns) if starts else {})

    def _start(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Return where every lane starts (SI), the motor within the gear's play where the log tells."""
        start, model = {"output_angle": self.angle, "output_speed": self.speed}, self.forecast.model
        play = columns.get(_PLAY, np.full(self.count, model.value_or(_PLAY, 0.0)))
        known = any(case.leans for case in self.forecast.cases)  # lanes that run together say the same of their starts
        if known and np.any(play) and any(place.name == "motor_angle" for place in model.states):
            start["motor_angle"] = model.value_or(_TEETH, 1.0) * (self.angle + self.case.leans * 0.5 * play)
        return start

    def _ticks(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Return when the first tick of each lane is [s]; pulses that come later move it by as much.

        A command acts from the first tick on that follows its pulse.
        """
        model, tick = self.forecast.model, columns.get(_TICK, self.forecast.model.value_or(_TICK, 0.0))
        if "control_phase" in self.names:
            phase = np.clip(self.tick, 0.0, 1.0) * tick
        elif self.forecast.phased:
            phase = np.full(self.count, columns.get(_PHASE, model.value_or(_PHASE, 0.0)))
        else:
            return {}
        return {_PHASE: np.mod(phase + self.begins, tick)}

    def _fail(self) -> None:
        """Make a part that is nan."""
        m, own = self.case.count, len(self.names)
        width = self.forecast.size if self.sides else 0
        self.part = LogPart(np.full(m, np.nan), np.full((m, width), np.nan),
                            np.full((m, own if self.sides else 0), np.nan), np.full(m, np.nan))

    def take(self, signals: dict[str, Array] | None) -> None:
        """Make the part of the log from the lanes' signals at the times of the bundle; nan where there are none."""
        if signals is None:
            self._fail()
            return
        self._make(signals if "bus_voltage" not in self.outputs else {**signals, "sag": self._sag(signals)})

    def _sag(self, signals: dict[str, Array]) -> Array:
        """Return by how much the bus lies above the voltage without current [V], shape (n, T)."""
        open_circuit = self.forecast.space.columns(self.x).get(_VOLTAGE)
        if open_circuit is None:
            open_circuit = np.full(self.count, self.case.log.parameters.get(
                _VOLTAGE, self.forecast.model.value(_VOLTAGE)))
        return np.asarray(signals["bus_voltage"] - open_circuit[:, None])

    def _make(self, signals: dict[str, Array]) -> None:
        early = np.minimum(self.times, 0.0)
        forecast, case, p = self.forecast, self.case, len(self.forecast.space)
        k = len(case.times)
        residuals, shared, own, delayed = [], [], [], []
        for name, place in case.places.items():
            values = signals[name][:, :k]
            speed = signals["output_speed"][0, :k]
            rate = speed
            if name == "output_angle":
                # Before the command of the first sample acts, the servo goes on as it began
                values = values + self.speed[:, None] * early + self.offset
                if "sag" in signals:
                    values = values + self.sag * signals["sag"][:, :k]
            elif self.later:
                rate = (signals[name][0, k:] - values[0]) / self.later
            sigma = case.sigma(name, self.noise)
            y = values[:, place] / sigma
            residuals.append(y[0] - case.values[name] / sigma)
            of_delay = -rate[place] * DELAY_SCALE / sigma
            delayed.append(of_delay)
            if not self.sides:
                continue
            sloped = self._sloped(y).T
            # An angle that is read too high: the shaft's own start is as much lower
            of_offset = np.full(len(place), OFFSET_SCALE / sigma if name == "output_angle" else 0.0)
            extra = {"delay": of_delay, "angle_offset": of_offset}
            if "sag" in signals:
                there = signals["sag"][0, place] if name == "output_angle" else np.zeros(len(place))
                extra["angle_sag"] = there * (SAG_SCALE / sigma)
            extra |= {which: sloped[:, p + len(self.varied) + i] for i, which in enumerate(self.shaped)}
            starts = {which: sloped[:, p + i] for i, which in enumerate(self.varied)}
            if "output_angle" in starts:
                extra["angle_offset"] = of_offset - starts["output_angle"]
            shared.append(np.column_stack([sloped[:, :p], *(extra[n] for n in forecast.extra)]))
            columns = [starts[n] if n in starts else of_delay for n in self.names]
            own.append(np.column_stack(columns) if columns else np.zeros((len(place), 0)))
        residual, later_by = np.concatenate(residuals), np.concatenate(delayed)
        nothing = np.zeros((len(residual), 0))
        self.part = LogPart(residual, np.concatenate(shared) if self.sides else nothing,
                            np.concatenate(own) if self.sides else nothing, later_by)

    def _sloped(self, y: Array) -> Array:
        """Return the derivatives of the lanes' signals by every varied number, a row each."""
        n = self.steps.shape[1]
        if self.sides == 1:
            return np.asarray((y[1:] - y[0]) / self.steps[0][:, None])
        return np.asarray((y[1:1 + n] - y[1 + n:]) / (self.steps[0] - self.steps[1])[:, None])


def _steps(x: Array, lower: Array, upper: Array, sides: int, step: float) -> Array:
    """Return the steps of all varied numbers, one row a side; none leaves its bounds."""
    steps = np.full((sides, len(x)), step)
    if sides == 1:
        steps[0] = np.where(x + step > upper, -step, step)
    elif sides:
        steps[0] = np.where(x + step > upper, 0.0, step)
        steps[1] = np.where(x - step < lower, 0.0, -step)
    return steps
