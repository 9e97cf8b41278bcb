"""What a model says that logs should show, and how that changes with every searched number.

All copies of a servo that differ a little in one number run beside the nominal one, in one batch: the Jacobian costs
little more than a simulation, and it is that of the same exact solution.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.batches import Batch, Done, Running, batches, simulated
from servotwin.identification.fitting.case import (
    DELAY_SCALE,
    MOST_DELAY,
    NUISANCES,
    OFFSET_SCALE,
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
from servotwin.identification.fitting.free import Space
from servotwin.identification.fitting.lanes import LogLanes
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters.servo import output_value
from servotwin.signals import Signal

Array = NDArray[np.float64]

_PERIOD = "electronics.frame_period"
_PHASE = "firmware.control_phase"
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
        Who simulates, and how closely; threads of this process unless given.
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
        if "control_phase" in nuisance and _PHASE not in model.optional:
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
