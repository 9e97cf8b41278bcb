"""Forecasts of logs by a model, and how they change with every searched number.

All copies of a servo that differ a little in one number run beside the nominal one, in one batch: the Jacobian costs
little more than a simulation, and it is that of the same exact solution.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    LATER,
    MOST_DELAY,
    NUISANCES,
    OFFSET_SCALE,
    PERIOD_SCALE,
    SAG_SCALE,
    SHARED,
    SPEED_SCALE,
    STEP,
    WIDE,
    Case,
    Frames,
    LogPart,
    Point,
    case_like,
    gaps,
    make_case,
    signal,
    widest,
)
from servotwin.identification.fitting.search.free import Space
from servotwin.loads import Load
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters.servo import output_value
from servotwin.signals import Signal
from servotwin.simulation.lanes.inputs import LOAD_NAMES, lanes_of
from servotwin.simulation.lanes.many import simulate_lanes
from servotwin.simulation.progress import HERE, Crew

# --- The simulations of a fit: lanes of several logs in as few calls as pay, wherever a crew does them ----------------

# Lanes are simulated together though their logs were sampled at other times and last as long as others: all are looked
# at whenever one of them is, and run as long as the longest. No lane feels that, to the last bit.

Array = NDArray[np.float64]

FIT_ACCURACY = 1e-7  # rad
_LOOK = 1e-3  # s of simulation: about what it costs to look at a lane once
_CALL = 6e-3  # s: what a call costs besides its lanes
_WORTH = 4.0  # calls: less is not handed to another worker
_WORTH_AWAY = 20.0  # the same, where what goes to a worker and comes back is copied


@dataclass(frozen=True)
class Running:
    """The executor of simulations, and their accuracy.

    Parameters
    ----------
    crew : Crew
    accuracy : float
        Of motions that are integrated [rad].
    look : callable
        Called before each simulation; may raise KeyboardInterrupt.
    """

    crew: Crew = field(default_factory=Crew)
    accuracy: float = FIT_ACCURACY
    look: Callable[[], None] = lambda: None


@dataclass(frozen=True, eq=False)
class Bundle:
    """Lanes that are looked at together; picklable.

    Parameters
    ----------
    times : ndarray, shape (T,)
        When they are looked at, in any order [s].
    duration : float
        [s]
    load : Load
        Of all of them.
    signals : sequence of Signal, length n
    columns : mapping of str to ndarray, shape (n,)
        Numbers of servo and load by dotted name (SI).
    initial : mapping of str to ndarray, shape (n,)
    """

    times: Array
    duration: float
    load: Load
    signals: Sequence[Signal]
    columns: dict[str, Array]
    initial: dict[str, Array]

    @property
    def lanes(self) -> int:
        """How many there are."""
        return len(self.signals)

    @cached_property
    def key(self) -> bytes:
        """The common key of bundles with the same times."""
        return self.times.tobytes()

    @property
    def cost(self) -> float:
        """Its price, in seconds of one lane of which nothing is looked at."""
        return self.lanes * (self.duration + _LOOK * len(self.times))


@dataclass(frozen=True, eq=False)
class Batch:
    """Bundles of one call, and what they share; picklable.

    Parameters
    ----------
    model : Model
    outputs : tuple of str
    accuracy : float
        [rad]
    strict : bool
        Whether bad input is raised; otherwise the bundle that has it fails.
    bundles : tuple of Bundle
        All with the same names of columns and of initial values.
    nearly : bool
        As of `simulate_lanes`.
    """

    model: Model
    outputs: tuple[str, ...]
    accuracy: float
    strict: bool
    bundles: tuple[Bundle, ...]
    nearly: bool = False


Done = list[dict[str, Array] | None]
"""The result of a batch: signals of each bundle, (n, T) each, None where it failed."""


def simulated(batch: Batch) -> Done:
    """Simulate a batch.

    Raises
    ------
    InputError
        If a lane is nothing that can be simulated, and the batch is strict.
    """
    try:
        return [*_simulated(batch)]
    except InputError:
        if batch.strict:
            raise
        alone = [replace(batch, bundles=(bundle,)) for bundle in batch.bundles]
        return [None] if len(alone) == 1 else [one for some in alone for one in simulated(some)]


def _simulated(batch: Batch) -> list[dict[str, Array]]:
    bundles = batch.bundles
    several = {bundle.key: bundle.times for bundle in bundles}
    times, where = np.unique(np.concatenate([*several.values()]), return_inverse=True)
    ends = np.cumsum([len(some) for some in several.values()])
    places = dict(zip(several, np.split(where, ends[:-1]), strict=True))
    counts = [bundle.lanes for bundle in bundles]
    columns, initial = ({name: np.concatenate([getattr(bundle, which)[name] for bundle in bundles])
                         for name in getattr(bundles[0], which)} for which in ("columns", "initial"))
    lanes = lanes_of(batch.model, [signal for bundle in bundles for signal in bundle.signals],
                     [bundle.load for bundle, count in zip(bundles, counts, strict=True) for _ in range(count)],
                     columns, initial or None, np.zeros(sum(counts), np.int64))
    made = simulate_lanes(lanes, duration=max(bundle.duration for bundle in bundles), output_times=times,
                          outputs=batch.outputs, executor=HERE, accuracy=batch.accuracy, nearly=batch.nearly)
    found, lane = [], 0
    for bundle, count in zip(bundles, counts, strict=True):
        rows, at = slice(lane, lane + count), places[bundle.key]
        found.append({name: np.asarray(made[name][rows, at], np.float64) for name in batch.outputs})
        lane += count
    return found


def batches(bundles: Sequence[Bundle], pace: float, crew: Crew) -> list[list[int]]:
    """Return which bundles go into which call: as few calls as keep all workers busy, the longest first.

    Parameters
    ----------
    bundles : sequence of Bundle
        That may be simulated together.
    pace : float
        How long a second of one lane takes, about [s].
    crew : Crew
    """
    seconds = [bundle.cost * pace for bundle in bundles]
    share = max(sum(seconds) / (2 * crew.workers), _CALL * (_WORTH if crew.is_here else _WORTH_AWAY))
    calls: list[_Call] = []
    for k in sorted(range(len(bundles)), key=lambda k: (-bundles[k].duration, bundles[k].key)):
        alone = not calls or calls[-1].seconds + 0.5 * seconds[k] > share
        vain = 0.0 if alone else calls[-1].in_vain(bundles[k]) * pace
        if alone or vain > (_CALL + calls[-1].vain) / len(calls[-1].which):  # more than each of these costs beside
            calls.append(_Call(bundles[k].duration))
            vain = 0.0
        calls[-1].add(k, bundles[k], seconds[k], vain)
    return [call.which for call in sorted(calls, key=lambda call: -call.seconds)]


class _Call:
    """Bundles that go into one call, the longest first."""

    def __init__(self, duration: float) -> None:
        self.which: list[int] = []
        self.seconds = self.vain = 0.0
        self._duration, self._lanes, self._looks = duration, 0, dict[bytes, int]()
        self._all_looks = 0

    def in_vain(self, bundle: Bundle) -> float:
        """Return what one more bundle, and the others for its sake, would do that nobody asks for [s of one lane]."""
        own = self._looks.get(bundle.key, 0)
        idle = self._duration - bundle.duration + _LOOK * (self._all_looks - own)
        return bundle.lanes * idle + (0.0 if own else self._lanes * _LOOK * len(bundle.times))

    def add(self, k: int, bundle: Bundle, seconds: float, vain: float) -> None:
        """Take one more, which does so much in vain [s]."""
        self.which.append(k)
        self.seconds += seconds
        self.vain += vain
        self._lanes += bundle.lanes
        if bundle.key not in self._looks:
            self._looks[bundle.key] = len(bundle.times)
            self._all_looks += len(bundle.times)


# --- The lanes of one log at one point of a search, and what their signals say ----------------------------------------

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
                # Before the command of the first sample acts, the servo continues as it began
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


# --- Forecasts of logs by a model, and how they change with every searched number -------------------------------------

_PERIOD = "electronics.frame_period"
_CONTROL_PHASE = "firmware.control_phase"
_STRIBECK = "friction.stribeck_speed"
_ANY_TICK = (0.5, 12.0**-0.5)  # of a tick: mean and standard deviation of what may be anywhere in it
_BEFORE = 5  # pulses: by then a servo hunts as it will
_HOLDS = 0.5  # of the friction that a servo file says: what it surely holds without drives
_HELD = 1e-6  # of its scale: how far a number moves that stays
_KEPT = 500  # commands
_TOLD = 4  # points
_PACE, _TICKING, _BENT = 2e-5, 1e-4, 6e-4
"""s that a second of one lane takes, about: in closed form, of a program, and of one whose motion is integrated.

They are not measured, for which lanes go into one call must not depend on how busy a computer is: a lane that runs for
longer than it is looked at may differ in its last bits."""
_FINEST = 1e-11  # rad, unless a finer accuracy is asked for
_POTENTIOMETER = ("potentiometer.feedback_gain", "potentiometer.feedback_offset")


class Forecast:
    """The simulation of all logs at a point of the search.

    Parameters
    ----------
    logs : sequence of Log
    model : Model
    space : Space
    nuisance : sequence of str
        Of "delay" (one for all logs), "log_delay" (what each log adds to it), "frame_phase" (when each log's pulses
        come), "frame_period" (of all), "control_phase" (when the program of each log's servo ticks), "angle_offset"
        (measured less true angle), "angle_sag" (how far the measured angle moves with the bus voltage) and
        "initial_state" (of each log).
    sensors : sequence of str
        Names of measured signals that are compared.
    running : Running, optional
        Executor and accuracy; threads of this process unless given.
    original : Case, optional
        One of which all logs are copies with other commands or times; its pulses come when a point says.

    Raises
    ------
    InputError
        If a nuisance is unknown, the model cannot follow a log, or a log sets what is searched.
    """

    def __init__(self, logs: Sequence[Log], model: Model, space: Space, nuisance: Sequence[str],
                 sensors: Sequence[str], running: Running | None = None, original: Case | None = None) -> None:
        for name in nuisance:
            if name not in NUISANCES:
                raise InputError("nuisance", got=name, allowed=", ".join(NUISANCES))
        self.model, self.space, self.nuisance = model, space, tuple(nuisance)
        self.sensors, self.running = tuple(sensors), running or Running()
        if "angle_sag" in nuisance and ("bus_voltage" not in model.available
                                        or not model.value_or("supply.internal_resistance", 0.0) > 0.0):
            raise InputError("nuisance: angle_sag", got=f"{model!r} whose bus voltage stays",
                             allowed="a pulse servo with supply.internal_resistance")
        if "control_phase" in nuisance and _CONTROL_PHASE not in model.optional:
            raise InputError("nuisance: control_phase", got=f"{model!r} without ticks", allowed="a DigitalServo")
        self.noise = dict.fromkeys(self.sensors, 1.0)
        self.step = WIDE if isinstance(model, DigitalServo) else STEP  # of the differences that are derivatives
        delayed = any(name in nuisance for name in ("delay", "log_delay", "frame_phase"))
        signals: dict[tuple[Any, ...], Signal] = {}
        self.cases = tuple(
            make_case(log, model, space, self.sensors, delayed=delayed, signals=signals) if original is None
            else case_like(original, log, model) for log in logs)
        self.strict = True
        fades = _STRIBECK in space.names or model.value_or(_STRIBECK, 0.0) > 0.0
        bent = fades or any(log.load.pendulums or log.load.springs for log in logs)
        self.bent = bent and isinstance(model, DigitalServo)  # so that motion is integrated, as there is no closed form
        self.nearly = False  # whether torques of springs and pendulums count by their middle of each tick instead
        self._told: dict[tuple[Any, ...], tuple[list[LogPart], float]] = {}  # what logs said last, and its work
        self._commands: dict[tuple[Any, ...], Signal] = {}  # points of a search often differ in other numbers only
        self.work = 0.0  # seconds of one lane that were simulated
        self.phased = "frame_phase" in nuisance and _PERIOD not in space.names and all(c.period for c in self.cases)
        self.extra = tuple(name for name in SHARED if name in nuisance and (name != "frame_period" or self.phased))
        self.ticked = self.phased and "control_phase" in nuisance  # whether ticks find which commands they take
        self.own_phases = "delay" not in self.extra  # whether each log's pulses come when they want
        self.held = False  # whether servos had held their first command for long when their log began
        self.frames = tuple(widest(case.log, case.period) for case in self.cases) if (
            self.phased and original is None) else ()
        if "frame_period" in self.extra and len({case.period for case in self.cases}) > 1:
            raise InputError("nuisance: frame_period", got="logs with several frame periods", allowed="one in all logs")

    @property
    def size(self) -> int:
        """Number of shared numbers."""
        return len(self.space) + len(self.extra)

    def goes_on_from(self, other: Forecast) -> None:
        """Take over where the search of another forecast stands: noise, what it found out of clocks, who simulates."""
        self.noise, self.strict, self.held = dict(other.noise), other.strict, other.held
        self.running, self.nearly = other.running, other.nearly and self.bent
        if self.phased and other.phased:
            self.own_phases = other.own_phases

    @contextmanager
    def roughly(self) -> Generator[None]:
        """Let lanes go nearly for a while, where there are any that may."""
        before, self.nearly = self.nearly, self.bent
        try:
            yield
        finally:
            self.nearly = before

    def with_cases(self, cases: Sequence[Case]) -> Forecast:
        """Return the same forecast of cases that differ a little, as many: in commands, times or parameters of logs."""
        other = copy.copy(self)
        other.cases, other._told, other._commands = tuple(cases), {}, {}
        return other

    def names_of_own(self, case: Case) -> tuple[str, ...]:
        """Return which numbers a log has for itself."""
        names = []
        if "initial_state" in self.nuisance:
            names += ["output_angle", "output_speed"] if case.moving else ["output_angle"]
        if self.phased:  # which holds a delay of the log's own too; the phase of its ticks beside is no more than
            return (*names, "frame_phase")  # which commands they take
        names += ["control_phase"] if "control_phase" in self.nuisance else []
        return (*names, "log_delay") if "log_delay" in self.nuisance else tuple(names)

    def own_start(self, case: Case) -> Array:
        """Return a log's own numbers as measured."""
        first = {"output_angle": case.start[0] / OFFSET_SCALE, "output_speed": case.start[1] / SPEED_SCALE,
                 "log_delay": 0.0, "frame_phase": 0.0, "control_phase": _ANY_TICK[0]}
        if self.phased and len(gaps(case.log, case.period)) > 1:
            first["frame_phase"] = widest(case.log, case.period).phase / DELAY_SCALE
        return np.array([first[name] for name in self.names_of_own(case)])

    def own_belief(self, case: Case) -> tuple[Array, Array]:
        """Return mean and one over the standard deviation of a log's own numbers (scaled).

        The start is believed to be where it was measured, within what the first samples scatter; a log's own delay to
        be within half a frame or a sample, and the phase of its ticks to be anywhere.
        """
        # The start angle is that of when the first command acts: a shaft in motion is elsewhere by then. And what a
        # potentiometer reads is no angle while its gain is searched
        unsure = case.moving or (case.log.angle_name == "feedback_voltage"
                                 and any(name in self.space.names for name in _POTENTIOMETER)) or self.lead(case) > 0.0
        spread = {"output_angle": math.inf if unsure else case.scatter / OFFSET_SCALE, "output_speed": math.inf,
                  "log_delay": 0.5 * float(np.median(np.diff(case.log.time))) / DELAY_SCALE,
                  "frame_phase": math.inf if self.own_phases else _HELD, "control_phase": _ANY_TICK[1]}
        return self.own_start(case), np.array([1.0 / spread[name] for name in self.names_of_own(case)])

    def own_reach(self, case: Case) -> Array:
        """Return how far a log's own numbers may go from where they begin (scaled): pulses as far as delays."""
        reach = {"frame_phase": MOST_DELAY / DELAY_SCALE}
        return np.array([reach.get(name, math.inf) for name in self.names_of_own(case)])

    def frames_of(self, point: Point, k: int) -> Frames:
        """Return which commands the pulses of a log carry at a point; the period is that of the point where it has one.

        Raises
        ------
        IndexError
            If pulses have no phase here.
        """
        return point.frames[k] if point.frames else self.frames[k]

    def command_at(self, point: Point, k: int) -> Signal:
        """Return the command of a log with its pulses as they come at a point; its t = 0 is the first sample."""
        case = self.cases[k]
        if not self.phased:
            return case.signal
        first = self.first_pulse(point, k)
        frames = self.frames_of(point, k)
        period = self.nuisance_of(point.shared, "frame_period") or frames.period
        sent = (k, frames, first, period, self.lead_at(point, k))
        if sent not in self._commands:
            if len(self._commands) >= _KEPT:
                self._commands.clear()
            self._commands[sent] = signal(case.log, *sent[1:])
        return self._commands[sent]

    def lead(self, case: Case) -> float:
        """Return how long before the first sample the simulation of a log begins [s]."""
        return _BEFORE * case.period if self.held and self.hunts(case) else 0.0

    def first_pulse(self, point: Point, k: int) -> float:
        """Return when the pulse comes at a point that stands for the phase of a log's frames [s]."""
        return float(point.own[k][self.names_of_own(self.cases[k]).index("frame_phase")]) * DELAY_SCALE

    def lead_at(self, point: Point, k: int) -> float:
        """Return how long before the first sample the simulation of a log begins at a point [s].

        That is with its first pulse, before or after the sample, so that all that follows moves with it; earlier where
        the servo had held its command.
        """
        lead = self.lead(self.cases[k])
        if not self.phased:
            return lead
        frames = self.frames_of(point, k)
        begins = -self.first_pulse(point, k) - math.ceil(-frames.phase / frames.period) * frames.period
        return max(lead, begins) if lead > 0.0 else begins

    def hunts(self, case: Case) -> bool:
        """Tell whether the servo could not rest at the start of a log without drives, but begins there at rest."""
        log, servo = case.log, self.model.servo
        if not self.phased or case.moving or log.load.recorded or not log.sent.all():
            return False
        if case.times[0] >= _BEFORE * case.period:  # the log tells what was before
            return False
        q = case.start[0]
        pull = log.load.torque + sum(s.stiffness * (q - s.rest_angle) for s in log.load.springs) + sum(
            p.mass * p.gravity * p.length * math.sin(q - p.hanging_angle) for p in log.load.pendulums)
        friction = output_value(servo, "output_coulomb_torque") or 0.0
        return abs(pull) > _HOLDS * friction

    def nuisance_of(self, shared: Array, name: str) -> float:
        """Return delay, angle offset, sag or frame period (SI) of a point; 0 where it is none of its numbers."""
        if name not in self.extra:
            return 0.0
        return float(shared[len(self.space) + self.extra.index(name)]) * SHARED[name][0]

    def at(self, point: Point, *, derivatives: bool = True, central: bool = False,
           step: float | None = None, cases: Sequence[int] | None = None) -> list[LogPart]:
        """Return what the logs say at a point, log by log; nan where a simulation failed.

        Derivatives are forward differences over `step`, that of the forecast unless given, or central ones at twice
        the lanes.
        """
        return self.at_all([point], derivatives=derivatives, central=central, step=step, cases=cases)[0]

    def _asked(self, point: Point, *which: Any) -> tuple[Any, ...]:
        """Return what is the same where logs say the same."""
        own = tuple(np.asarray(own).tobytes() for own in point.own)
        return (point.shared.tobytes(), own, point.frames, which, self.held, self.nearly, self.strict,
                tuple(self.noise.items()))

    def at_all(self, points: Sequence[Point], *, derivatives: bool | Sequence[bool] = False, central: bool = False,
               step: float | None = None, cases: Sequence[int] | None = None, rates: bool = False,
               noises: Sequence[Mapping[str, float]] | None = None, leading: bool = False,
               each: Sequence[Sequence[int]] | None = None) -> list[list[LogPart]]:
        """Return what the logs say at several points, in one batch; for each point, log by log.

        `derivatives` may differ from point to point, and so may the noise; `rates` gives what a delay changes without
        derivatives, for all signals. Derivatives that are `leading` a search, no more, are those of lanes that go
        nearly where there are any: residuals are of the engine itself. `each` names the logs of each point.
        """
        which, step = range(len(self.cases)) if cases is None else cases, self.step if step is None else step
        self.running.look()
        sloped = [derivatives] * len(points) if isinstance(derivatives, bool) else derivatives
        usual = len(points) == 1 and each is None and noises is None and step == self.step and not (central or rates)
        same = self._asked(points[0], tuple(which), sloped[0], leading) if usual else ()
        if usual and same in self._told:  # a search often begins where another one ended
            known, work = self._told[same]
            self.work += work
            return [list(known)]
        before = self.work
        asked = [set(some) for some in each] if each is not None else [set(which)] * len(points)
        both = leading and self.bent and not self.nearly  # the nominal lane one way, those beside it another

        def lanes_of(*, nearly: bool, beside: bool) -> list[LogLanes]:
            none = both and not beside
            return [LogLanes(self, k, at, point, sides=0 if none else (1 + central) * sloped[at], step=step,
                             rates=rates, noise=self.noise if noises is None else noises[at], nearly=nearly)
                    for k in which for at, point in enumerate(points) if (sloped[at] or not beside) and k in asked[at]]

        lanes, slopes = lanes_of(nearly=self.nearly, beside=False), lanes_of(nearly=True, beside=True) if both else []
        self.work += sum(lane.cost for lane in (*lanes, *slopes))
        self._simulate([*lanes, *slopes], step if any(sloped) else STEP)
        found: list[list[LogPart]] = [[] for _ in points]
        waiting = iter(slopes)  # in the same order
        for lane in lanes:
            there = next(waiting).part if both and sloped[lane.at] else lane.part
            found[lane.at].append(lane.part._replace(shared=there.shared, own=there.own))
        if usual:
            while len(self._told) >= _TOLD:
                self._told.pop(next(iter(self._told)))
            self._told[same] = found[0], self.work - before
        return found

    def _simulate(self, lanes: Sequence[LogLanes], step: float) -> None:
        """Simulate lanes, in as few calls as pay, and make the part of each log at each point."""
        # Noise of a simulation counts over the step of a difference: of finer ones it has to be as much smaller
        accuracy = min(self.running.accuracy, max(self.running.accuracy * step / STEP, _FINEST))
        kinds: dict[tuple[Any, ...], list[int]] = {}
        for k, lane in enumerate(lanes):
            kinds.setdefault((lane.nearly, lane.case.key), []).append(k)
        bundles = [lane.bundle() for lane in lanes]
        calls = [[some[i] for i in call] for some in kinds.values()
                 for call in batches([bundles[k] for k in some], self._pace(nearly=lanes[some[0]].nearly),
                                     self.running.crew)]
        work = [Batch(self.model, lanes[call[0]].outputs, accuracy, self.strict, tuple(bundles[k] for k in call),
                      lanes[call[0]].nearly)
                for call in calls]
        with closing(self._done(work)) as running:
            for call, done in zip(calls, running, strict=True):
                self.running.look()
                for k, signals in zip(call, done, strict=True):
                    lanes[k].take(signals)

    def _pace(self, *, nearly: bool) -> float:
        """Return how long a second of one lane takes, about [s]."""
        if not isinstance(self.model, DigitalServo):
            return _PACE
        return _BENT if self.bent and not nearly else _TICKING

    def _done(self, work: Sequence[Batch]) -> Generator[Done]:
        """Return what comes of each batch; a single one is simulated here and now, unless others are to do it."""
        crew = self.running.crew
        if crew.is_here and (len(work) == 1 or crew.workers == 1):
            yield from map(simulated, work)
            return
        with closing(crew.done(simulated, ((batch,) for batch in work))) as running:
            yield from running
