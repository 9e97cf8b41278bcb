"""Registers that logs did not record: sets of them and single ones, tried as whole lanes before any number is searched.

A register acts in full and at once: one that is wrong bends every number of a fit, and no slope leads to the right one.
So what may stand in registers is simulated as it is, many servos side by side, and the best is where a fit begins.
"""

from __future__ import annotations

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    GAIN,
    HUBER,
    Point,
    robust_deviation,
    with_loop_gain,
)
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.free import ANY_PARAMETER, Space
from servotwin.identification.fitting.search.stopping import Within
from servotwin.logs.bam_logs import writes_gain
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters import Servo
from servotwin.parameters.registers.held import as_robot_has_it, register_family_of, said_of, set_of_robot
from servotwin.parameters.registers.table import (
    SETS,
    VARIED,
    RegisterSet,
    Varied,
    family_label,
    known_registers,
    set_registers,
    written,
)

Array = NDArray[np.float64]
Lanes = Callable[[Sequence[int], Array], list[tuple[Array, Array]]]
"""Of some that are tried, each at a delay [s]: residuals [rad] and what more delay (scaled) adds, (n, servos) each."""
_LOGS = 4  # that are asked, those of the most motion first
_DELAY, _NEAR = 0.01, 1e-4  # s, of the first of these, and what changes nothing
_DELAYED = 3  # simulations of one servo, each at the delay that the one before it wants
_RESTS, _RESTED = 1.5, 0.3  # counts between samples, and s: a shaft that rests
_SECONDS, _MOST = 12.0, 40.0  # of a log, those of the most motion: at first, and in all
_MOST_DELAY = 0.3  # s
_ROUNDS = 3  # of all registers, one after the other
_FAR = 1.25  # step of a register at which the logs tell its value if they do
_FOLLOWS = (0.7, 0.85, 1.0, 1.2, 1.4)  # times a register, while another one has another value
_SAME = 1e-4  # of an error: a register that changes no more does nothing in these logs
_LOOKED = 8  # states elsewhere, of those that leave least on parts of the logs, that all of the logs judge
_BEGINNINGS = 4  # of sweeps, that continue from different values of the first register
_STARTS = 2  # further beginnings of a search
_FINER = (1.25, 1.1, 1.04)  # steps of a register about the best of its values, one round each
TAKEN = 0.5
"""Of the error: registers that leave less are taken."""
PROMISING = 1.5
"""Times the least error: what leaves more gets no delay of its own."""
ALIKE = 1.05
"""Times the least error: registers that leave less are said beside the best."""
_SMALL = 1.5  # encoder steps: an error that is no more is none of registers
_LEAST = 1e-6  # rad
_AS_GIVEN = RegisterSet("as given")


def as_logs_say(model: Model, logs: Sequence[Log]) -> tuple[Model, tuple[str, ...]]:
    """Return a model of the servo as the robot of its logs has it, and a line on what was assumed; none where nothing.

    A log's condition `robot` is LeRobot's `robot_type`, and its condition `joint` the servo's. Where logs are of
    several robots, nothing is assumed; where some are of a gripper, the other joints count.

    Parameters
    ----------
    model : Model
    logs : sequence of Log
    """
    robots = {str(log.conditions.get("robot", "")) for log in logs}
    joints = [str(log.conditions.get("joint", "")) for log in logs]
    if len(robots) != 1:
        return model, ()
    robot = robots.pop()
    joint = next((name for name in joints if "gripper" not in name.lower()), joints[0])
    servo = as_robot_has_it(model.servo, robot, joint)
    if servo is model.servo:
        return model, ()
    return type(model)(servo), (said_of(robot, set_of_robot(robot, joint)),)


def of_no_robot(logs: Sequence[Log]) -> list[Log]:
    """Return logs that do not say which robot they are of."""
    return [replace(log, conditions={name: value for name, value in log.conditions.items() if name != "robot"})
            for log in logs]


@dataclass(frozen=True)
class Tried:
    """A candidate set of registers, and how far the servo is off the logs with it.

    Parameters
    ----------
    said : str
        Differences from the servo as it was given, in words.
    servos : tuple of Servo
        With them.
    registers : mapping of str to int or None
        Raw values that differ; None: what they limit is unlimited.
    error : float
        Rms error of the angle at its best delay [rad]; the geometric mean of those of several servos.
    delay : float
        That delay [s].
    own_gain : bool
        Whether P is another than the logs say.
    errors : tuple of float
        Of each servo [rad].
    """

    said: str
    servos: tuple[Servo, ...] = field(repr=False)
    registers: Mapping[str, int | None]
    error: float = math.nan
    delay: float = 0.0
    own_gain: bool = False
    errors: tuple[float, ...] = ()

    @property
    def servo(self) -> Servo:
        """The servo, or the first of several."""
        return self.servos[0]


class OddJoint(NamedTuple):
    """A joint of a robot whose servo has other registers than the others: raw values, and rms errors [rad]."""

    servo: Servo
    registers: Mapping[str, int]
    error: float
    with_those_of_others: float


@dataclass(frozen=True)
class RegisterSearch:
    """The result of a search for registers that no log records.

    Parameters
    ----------
    given : Tried
        The servo as it was given.
    best : tuple of Tried
        Candidate with the least error, and those with hardly more, the best first.
    doubted : Tried, optional
        Candidate that would leave less than half of that, by other values in registers that were given.
    moves : mapping of str to Varied
        Numbers of the program that follow from registers which nobody recorded and which the logs tell, with these.
    others : tuple of Tried
        Candidates with little more error and values that differ: where a search may begin too.
    joints : mapping of str to OddJoint
        Of a robot.
    """

    given: Tried
    best: tuple[Tried, ...]
    doubted: Tried | None = None
    moves: Mapping[str, Varied] = field(default_factory=dict)
    others: tuple[Tried, ...] = ()
    joints: Mapping[str, OddJoint] = field(default_factory=dict)

    @property
    def taken(self) -> Tried | None:
        """The start of a fit in place of the servo as it was given; None where that is good enough."""
        return self.best[0] if self.best and self.best[0].error < TAKEN * self.given.error else None

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on it, a line each."""
        said = []
        if self.taken is not None:
            also = [one.said for one in self.best[1:] if not {*one.registers} >= {*self.taken.registers}][:2]
            more = f" ({' and '.join(also)} would leave as little)" if also else ""
            said.append(f"registers that nobody recorded are not as the servo file has them: as if with "
                        f"{self.taken.said}, {_degrees(self.taken.error)} instead of {_degrees(self.given.error)} are "
                        f"left before anything is fitted{more}; read them back, or say them by --register (another "
                        "supply or servo than said may look like it)")
        said += [f"the servo of {joint} has other registers than the others: as if with {_words(one.registers, ())}, "
                 f"{_degrees(one.error)} instead of {_degrees(one.with_those_of_others)} are left of it before "
                 "anything is fitted; read them back" for joint, one in self.joints.items()]
        if self.doubted is not None:
            left = (self.taken or self.given).error
            said.append(f"the registers that were given are doubtful: as if with {self.doubted.said}, "
                        f"{_degrees(self.doubted.error)} instead of {_degrees(left)} are left; read them back")
        return tuple(said)

    @property
    def facts(self) -> dict[str, Any]:
        """The result as plain data (SI)."""
        def of(one: Tried | None) -> dict[str, Any] | None:
            return None if one is None else {"registers": dict(one.registers), "error": one.error, "delay": one.delay}
        joints = {joint: {"registers": dict(one.registers), "error": one.error,
                          "with_those_of_others": one.with_those_of_others} for joint, one in self.joints.items()}
        return {"given": of(self.given), "taken": of(self.taken), "best": [of(one) for one in self.best],
                "doubted": of(self.doubted), **({"joints": joints} if joints else {})}


class RegisterValue(NamedTuple):
    """A register whose number a fit has searched: its raw value, and the interval of that (nan: none)."""

    name: str
    value: float
    lower: float
    upper: float

    @property
    def interval(self) -> str:
        """The interval in words; a dash where there is none, as of a number at its bound."""
        return f"{self.lower:.3g} to {self.upper:.3g}" if self.lower == self.lower else "–"


def register_values(servo: Servo, moves: Mapping[str, Varied], values: Mapping[str, float],
                    spans: Mapping[str, tuple[float, float]]) -> tuple[RegisterValue, ...]:
    """Return which raw values of registers numbers of a servo's program stand for.

    Parameters
    ----------
    servo : Servo
    moves : mapping of str to Varied
        Numbers that were searched, with the registers that they follow from in proportion.
    values, spans : mapping by name
        Of these numbers, and the ends of their intervals (SI).
    """
    family = register_family_of(servo)
    raw = written(family, servo)
    found = []
    for number, one in moves.items():
        setting = next(each for each in family.settings if f"firmware.{each.name}" == number)
        step = setting.value({**raw, **dict.fromkeys(one.registers, 1)}, servo)
        if number in values and isinstance(step, float) and step > 0.0:
            low, high = spans.get(number, (math.nan, math.nan))
            found.append(RegisterValue(one.registers[0], values[number] / step, low / step, high / step))
    return tuple(found)


def _degrees(error: float) -> str:
    return f"{math.degrees(error):.3g} deg"


class State(NamedTuple):
    """A set, and the registers that are varied beside it: raw values by their name, None for unlimited."""

    first: str
    varied: tuple[tuple[str, int | None], ...] = ()

    @property
    def choices(self) -> int:
        """How much of it differs from the servo as it was given: a set as a whole, and registers beside."""
        return len(self.varied) + (self.first != _AS_GIVEN.name)

    def having(self, name: str, value: int | None) -> State:
        """Return a state in which one register has another value."""
        return self._replace(varied=(*((n, v) for n, v in self.varied if n != name), (name, value)))


class Bench(ABC):
    """Whole lanes of servos of one family with other registers, the same in all of them, beside what was recorded.

    Parameters
    ----------
    servos : sequence of Servo
    moved : ndarray of bool, optional
        Which of them moved; all unless given. The errors of others say nothing.
    within : Within, optional
        The time that it may take; then `tried` raises TimeoutError.

    Attributes
    ----------
    rounds : int
        How often the best is refined, and looked for elsewhere, beyond the values that are tried first.
    """

    rounds = _ROUNDS

    def __init__(self, servos: Sequence[Servo], moved: NDArray[np.bool_] | None = None,
                 within: Within | None = None) -> None:
        self.within = within or Within()
        self.moved = np.ones(len(servos), np.bool_) if moved is None else moved
        self.servos, self.families = tuple(servos), tuple(register_family_of(servo) for servo in servos)
        label = self.families[0].label
        self.varied = {one.name: one for one in VARIED[label]}
        self.sets = {one.name: one for one in (_AS_GIVEN, *SETS.get(label, ()))}
        self.raw = [written(family, servo) for family, servo in zip(self.families, self.servos, strict=True)]
        self._like = [self.servos.index(servo) for servo in self.servos]
        self._seen: dict[State, Tried] = {}
        self._least = math.inf

    @abstractmethod
    def lanes(self, some: Sequence[Tried]) -> Lanes:
        """Return what simulates servos of one form."""

    def tried(self, states: Iterable[State]) -> list[Tried]:
        """Return what is left with some registers, each set of them simulated once."""
        asked = [*dict.fromkeys(states)]
        new = [state for state in asked if state not in self._seen]
        if new and self.within.over:
            raise TimeoutError
        made = [(state, one) for state in new if (one := self._made(state)) is not None]
        groups: dict[tuple[tuple[str, ...], ...], list[tuple[State, Tried]]] = {}
        for state, one in made:
            groups.setdefault(tuple(_form(servo) for servo in one.servos), []).append((state, one))
        for group in groups.values():
            for (state, _), known in zip(group, self._judged([one for _, one in group]), strict=True):
                self._seen[state] = known
        return [self._seen[state] for state in asked if state in self._seen]

    def ranked(self, states: Iterable[State]) -> list[State]:
        """Return states by what is left with them, the least first; as they are where none can be simulated."""
        asked = [*states]
        self.tried(asked)
        known = [state for state in asked if state in self._seen]
        return sorted(known, key=lambda state: self._seen[state].error) or asked

    def seen(self, free: Sequence[Varied]) -> dict[State, Tried]:
        """Return all that was simulated in which no other registers differ than some, and those of sets."""
        names = {one.name for one in free}
        return {state: one for state, one in self._seen.items() if names >= {name for name, _ in state.varied}}

    def simplest(self, seen: Mapping[State, Tried]) -> list[State]:
        """Return the states that leave hardly more than the least error, those that change fewest registers first."""
        least = min(one.error for one in seen.values())
        near = [state for state, one in seen.items() if one.error <= ALIKE * least]
        return sorted(near, key=lambda state: (len(seen[state].registers), seen[state].error))

    def _made(self, state: State) -> Tried | None:
        """Return the servos with these registers; None where one cannot have them."""
        first = self.sets[state.first]
        registers: dict[str, int | None] = dict(first.registers)
        numbers = dict(first.numbers)
        for name, value in state.varied:
            one = self.varied[name]
            registers |= dict.fromkeys(one.registers, value)
            numbers.pop(one.number, None)
            if value is None:
                numbers[one.number] = None
        given = {name: value for name, value in registers.items() if value is not None}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of ways of turning that differ: both get one value
                made = {k: set_registers(self.families[k], given, self.servos[k], assumed=True) if given
                        else self.servos[k] for k in dict.fromkeys(self._like)}
            if numbers:
                made = {k: servo.replace(numbers, source="assumed: no value of a register says so")
                        for k, servo in made.items()}
        except ServotwinError:
            return None
        changed = {name: value for name, value in registers.items()
                   if any(value != raw.get(name) for raw in self.raw)}
        changed |= {one.registers[0]: None for one in self.varied.values()
                    if one.number in numbers and numbers[one.number] is None}
        own = any(name in registers for one in self.varied.values() if one.number == GAIN for name in one.registers)
        return Tried(_words(changed, self.varied.values()), tuple(made[k] for k in self._like), changed, own_gain=own)

    def _judged(self, some: Sequence[Tried]) -> list[Tried]:
        """Return servos of one form with the error that each leaves, at its best delay."""
        lanes, found = self.lanes(some), [*some]
        asked, delays = [*range(len(some))], np.full(len(some), _DELAY)
        for _ in range(_DELAYED):
            later, hoped = delays.copy(), np.full(len(some), math.inf)
            for k, (r, g) in zip(asked, lanes(asked, delays[asked]), strict=True):
                errors = _rms(r)
                error = _mean(errors[self.moved])
                if not error >= found[k].error:
                    found[k] = replace(found[k], error=error, errors=tuple(errors.tolist()), delay=float(delays[k]))
                more = _later(r.ravel(), g.ravel())
                later[k] = min(max(float(delays[k]) + more * DELAY_SCALE, 0.0), _MOST_DELAY)
                hoped[k] = min(error, _mean(_rms(r + more * g)[self.moved]))
            self._least = min([self._least, *(one.error for one in found)])
            delays = later
            asked = [k for k in asked if hoped[k] < PROMISING * self._least and abs(later[k] - found[k].delay) > _NEAR]
            if not asked:
                break
        return found


class _LogBench(Bench):
    """Lanes of one servo beside some logs."""

    def __init__(self, model: Model, logs: Sequence[Log], within: Within) -> None:
        super().__init__([model.servo], within=within)
        self.kind = type(model)
        self.logs = tuple(replace(log, conditions={}) for log in (with_loop_gain(log, model) for log in logs))
        self.gains = any(GAIN in log.parameters for log in self.logs)

    def lanes(self, some: Sequence[Tried]) -> Lanes:
        """Return what simulates servos of one form, in all logs."""
        base, names = some[0].servo, numbers_apart([one.servo for one in some])
        names = [*dict.fromkeys([*names, *([GAIN] if self.gains else [])])]
        copies = []
        for k, one in enumerate(some):
            own = {name: float(one.servo.get(name)) for name in names}  # type: ignore[arg-type]
            for log in self.logs:
                said = {GAIN: log.parameters[GAIN]} if GAIN in log.parameters and not one.own_gain else {}
                copies.append(replace(log, name=f"{log.name} {k}", parameters={**log.parameters, **own, **said}))
        model = self.kind(base)
        taken = {name for log in copies for name in log.parameters}
        unused = next(name for name in ANY_PARAMETER if name not in taken)
        forecast = Forecast(copies, model, Space(model, [unused]), ("initial_state", "log_delay"), ("output_angle",))
        forecast.strict, forecast.nearly = False, forecast.bent
        n = len(self.logs)
        where = [forecast.names_of_own(case).index("log_delay") for case in forecast.cases]
        starts = [forecast.own_start(case) for case in forecast.cases]

        def run(which: Sequence[int], delays: Array) -> list[tuple[Array, Array]]:
            cases = [i for k in which for i in range(k * n, (k + 1) * n)]
            for i, delay in zip(cases, np.repeat(delays, n).tolist(), strict=True):
                starts[i][where[i]] = delay / DELAY_SCALE
            parts = forecast.at(Point(forecast.space.start, tuple(start.copy() for start in starts)),
                                derivatives=False, cases=cases)
            r, g = ([np.concatenate([getattr(part, name) for part in parts[j:j + n]])[:, None]
                     for j in range(0, len(cases), n)] for name in ("residual", "later"))
            return [*zip(r, g, strict=True)]

        return run


def _rms(residual: Array) -> Array:
    """Return the rms of each column; inf where a lane failed."""
    return np.where(np.isfinite(residual).all(axis=0), np.sqrt(np.mean(residual**2, axis=0)), math.inf)


def _mean(errors: Array) -> float:
    """Return the geometric mean of the errors of servos: one that something holds counts as one, however far off."""
    return float(np.exp(np.mean(np.log(np.hypot(errors, _LEAST)))))


def _later(residual: Array, later: Array) -> float:
    """Return by how much more delay (scaled) fits best to first order, errors of most samples counting."""
    if not np.isfinite(residual).all():
        return 0.0
    step, size = 0.0, robust_deviation(residual) or 1.0
    for _ in range(4):
        left = np.abs(residual + later * step)
        weight = np.minimum(1.0, HUBER * size / np.maximum(left, 1e-12))
        power = float(weight @ later**2)
        if power <= 0.0:
            return 0.0
        step = -float(weight @ (later * residual)) / power
    return step


def numbers_apart(servos: Sequence[Servo]) -> list[str]:
    """Return the numbers of the program that differ among servos of one form."""
    return sorted({name for servo in servos for name in servo.names() if name.startswith("firmware.")
                   and isinstance(servo.get(name), int | float) and servo.get(name) != servos[0].get(name)})


def _form(servo: Servo) -> tuple[str, ...]:
    """Return what lanes of one call share: which numbers of the program there are, and its words."""
    return tuple(name if isinstance(servo.get(name), int | float) else f"{name}={servo.get(name)}"
                 for name in servo.names() if name.startswith("firmware."))


def _words(changed: Mapping[str, int | None], varied: Iterable[Varied]) -> str:
    """Return registers with their values."""
    said = {}
    for name, value in changed.items():
        one = next((v for v in varied if name in v.registers), None)
        said[f"no limit of {one.name}" if value is None and one is not None else f"{name} {value}"] = True
    return ", ".join(said) or "the registers as the servo has them"


def register_search(model: Model, logs: Sequence[Log], within: Within | None = None) -> RegisterSearch | None:
    """Return what stands in the registers of a bus servo that logs did not record; None where nothing can be said.

    That is so of servos without registers, of logs without an angle, and where time is over.

    Parameters
    ----------
    model : Model
        A `DigitalServo` that takes goals, whose numbers follow from registers; of others there is nothing.
    logs : sequence of Log
        Those without an angle are left out.
    within : Within, optional
        The time that it may take.
    """
    try:
        return _register_search(model, logs, within or Within())
    except TimeoutError:
        return None


def _register_search(model: Model, logs: Sequence[Log], within: Within) -> RegisterSearch | None:
    if not has_registers([model]):
        return None
    count = register_family_of(model.servo).count
    seen = [log for log in logs if log.angle_name == "output_angle" and log.command_kind == "angle"]
    seen = [_part(log, count, _MOST) for log in
            sorted(seen, key=lambda log: -float(np.nanstd(log.measured["output_angle"])))[:_LOGS]]
    if not seen:
        return None
    bench = _LogBench(model, seen, within)
    some = [_part(log, count, _SECONDS) for log in seen]
    first = bench if all(a is b for a, b in zip(some, seen, strict=True)) else _LogBench(model, some, within)
    return searched(first, bench, _recorded(seen, tuple(bench.varied.values())))


def _part(log: Log, count: float, seconds: float) -> Log:
    span = busiest(log.time, log.held[:, None], log.measured["output_angle"][:, None], _RESTS * count, seconds)
    return log if span is None else log.part(*span)


def has_registers(models: Sequence[Model]) -> bool:
    """Tell whether servos follow goals by registers of one family that people change."""
    labels = {family_label(model.servo) for model in models}
    return len(labels) == 1 and labels <= {*VARIED} and all(
        isinstance(model, DigitalServo) and model.takes_goals for model in models)


def searched(first: Bench, bench: Bench, recorded: frozenset[str] = frozenset(),
             names: Sequence[str] = ()) -> RegisterSearch | None:
    """Return what stands in registers; None where servos as they were given cannot be simulated.

    Those that somebody said for a servo, or that were recorded, are held, and doubted where others would leave less
    than half.

    Parameters
    ----------
    first, bench : Bench
        On parts of what was recorded, where the search begins, and on all of it.
    recorded : frozenset of str
    names : sequence of str
        Of the servos, where single ones may have registers of their own.
    """
    known = recorded.union(*(known_registers(family, servo)
                             for family, servo in zip(bench.families, bench.servos, strict=True)))
    count = bench.families[0].count
    given = bench.tried([State(_AS_GIVEN.name)])
    if not given or not math.isfinite(given[0].error):
        return None
    if given[0].error <= _SMALL * count:
        return RegisterSearch(given[0], ())
    found = _searched(first, bench, known)
    search = RegisterSearch(given[0], found.best, None, found.moves, found.others)
    if names:
        state = found.state if search.taken is not None else State(_AS_GIVEN.name)
        search = replace(search, joints=_odd_joints(bench, state, known, names))
    doubted = None
    if known and found.best[0].error > 2.0 * _SMALL * count:
        other = _searched(first, bench, frozenset()).best[0]
        doubted = other if other.error < TAKEN * min(given[0].error, found.best[0].error) else None
    return replace(search, doubted=doubted)


def _odd_joints(bench: Bench, state: State, known: frozenset[str], names: Sequence[str]) -> dict[str, OddJoint]:
    """Return servos that are clearly less off with another value in one register than all others have it.

    That is less than half of what is left, and of what it leaves of the others: a value that does all of them good
    makes up for wrong numbers that they share.
    """
    here = bench.tried([state])[0]
    free = [one for one in bench.varied.values() if not known & {*one.registers}]
    near = [one for one in bench.tried([state.having(one.name, value) for one in free for value in one.values])
            if [_form(servo) for servo in one.servos] == [_form(servo) for servo in here.servos]]
    found, moved = {}, np.flatnonzero(bench.moved)
    for k in moved.tolist() if len(moved) > 1 else ():
        odd = min(near, key=lambda one: one.errors[k], default=here)
        left = dict(zip(moved.tolist(), np.array(odd.errors)[moved] / np.array(here.errors)[moved], strict=True))
        if left.pop(k) < TAKEN * min(_mean(np.array([*left.values()])), 1.0):
            usual, own = (written(bench.families[k], one.servos[k]) for one in (here, odd))
            found[names[k]] = OddJoint(odd.servos[k], {register: value for register, value in own.items()
                                                   if value != usual[register]}, odd.errors[k], here.errors[k])
    return found


def busiest(time: Array, goals: Array, angles: Array, still: float,
            seconds: float = _SECONDS) -> tuple[float, float] | None:
    """Return start and end of the part in which goals go furthest, from rest on [s]; None of what is short.

    In motion it is unknown where the profile of the program stands.

    Parameters
    ----------
    time : ndarray, shape (n,)
    goals, angles : ndarray, shape (n, servos)
        [rad]
    still : float
        By how much a shaft that rests may move between samples [rad].
    seconds : float
        Of the part.
    """
    if time[-1] - time[0] <= seconds:
        return None
    ways = np.abs(np.diff(goals, axis=0)).sum(axis=1)
    way = np.concatenate([[0.0], np.cumsum(ways)])
    steps = np.abs(np.diff(angles, axis=0, prepend=angles[:1])).max(axis=1)
    moved = (steps > still) | (np.diff(way, prepend=0.0) > 0.0)
    last_moved = np.maximum.accumulate(np.where(moved, time, time[0]))
    ends = np.searchsorted(time, time + seconds, side="right") - 1
    rests = (time - last_moved >= _RESTED) & (time <= time[-1] - seconds)
    rests[0] = True
    first = int(np.argmax(np.where(rests, way[ends] - way, -1.0)))
    return float(time[first]), float(time[ends[first]])


def _recorded(logs: Sequence[Log], varied: Sequence[Varied]) -> frozenset[str]:
    """Return registers of which logs say what they hold: that of P where all name its gain."""
    if all(GAIN in log.parameters or ("gain" in log.conditions and writes_gain(log.conditions.get("motor", "")))
           for log in logs):
        return frozenset(name for one in varied if one.number == GAIN for name in one.registers)
    return frozenset()


class _Found(NamedTuple):
    """The sets with the least error, or hardly more; the numbers that the logs tell; and where else they may be."""

    best: tuple[Tried, ...]
    moves: Mapping[str, Varied]
    others: tuple[Tried, ...]
    state: State


def _searched(first: Bench, bench: Bench, known: frozenset[str]) -> _Found:
    """Return what stands in registers that are not known; `first` has parts of the logs, on which the search begins.

    Sets are tried first, then single registers and pairs, then one register after the other from the best for each
    value of the first one, which hides what all others do.
    """
    free = [one for one in bench.varied.values() if not known & {*one.registers}]
    stays = {one.number for one in bench.varied.values() if one not in free}
    sets = [State(one.name) for one in bench.sets.values() if not known & {*one.registers}
            and not stays & {*one.numbers}]
    states = [*sets, *(sets[0].having(one.name, value) for one in free for value in _values(one)),
              *(sets[0].having(one.name, a).having(other.name, b)
                for one, other in pairwise(free) for a in _values(one) for b in _values(other))]
    groups: dict[int | None, State] = {}
    for state in first.ranked(states):
        groups.setdefault(_value_of(first, state, free[0]) if free else None, state)
    best = bench.ranked(_swept(first, [*groups.values()][:_BEGINNINGS], free))[0]
    moves, others = list[Varied](), list[State]()
    for _ in range(bench.rounds):
        best = _refined(bench, _swept(bench, [best], free)[0], free)
        moves = [one for one in free if _tells(bench, best, one)]
        others = first.ranked(_elsewhere(first, best, moves))[:_LOOKED]
        better = bench.ranked([best, *others])[0]
        if better == best:
            break
        best = better
    least, seen = bench.tried([best])[0], bench.seen(free)
    near = bench.simplest(seen)
    far: list[Tried] = []
    for one in bench.tried(bench.ranked(others)):
        if one.error < PROMISING * least.error and all(
                abs(one.error - each.error) > _SAME * least.error and _apart(one.servo, each.servo, moves)
                for each in (least, *far)):
            far.append(one)
    simple: dict[tuple[Any, ...], Tried] = {}
    for state in near:
        simple.setdefault(tuple(sorted(seen[state].registers.items())), seen[state])
    return _Found(tuple(simple.values()), {one.number: one for one in moves}, tuple(far[:_STARTS]), near[0])


def _swept(bench: Bench, states: Sequence[State], free: Sequence[Varied]) -> list[State]:
    """Return states with one register after the other at the best of its values."""
    for one in free:
        several = [[state, *(state.having(one.name, value) for value in _values(one))] for state in states]
        bench.tried([each for some in several for each in some])
        states = [bench.ranked(some)[0] for some in several]
    return [*states]


def _refined(bench: Bench, state: State, free: Sequence[Varied]) -> State:
    """Return a state with registers at the best values about those that they have: all that gain, or the best one."""
    for step in _FINER:
        near = []
        for one in free:
            now = _value_of(bench, state, one)
            if now:
                values = {max(round(now * step), now + 1), min(round(now / step), now - 1)}
                near.append((one, [state.having(one.name, value) for value in sorted(values) if value > 0]))
        bench.tried([each for _, some in near for each in some])
        better, together = [], state
        for one, some in near:
            best = bench.ranked([state, *some])[0]
            if best != state:
                better.append(best)
                together = together.having(one.name, _value_of(bench, best, one))
        state = bench.ranked([state, together, *better])[0]
    return state


def _tells(bench: Bench, state: State, one: Varied) -> bool:
    """Tell whether the error grows where a register has a value somewhat larger, or smaller."""
    now = _value_of(bench, state, one)
    if not now:
        return False
    here, *near = bench.tried([state, *(state.having(one.name, round(now * f)) for f in (_FAR, 1.0 / _FAR))])
    return max((each.error for each in near), default=0.0) > ALIKE * here.error


def _elsewhere(bench: Bench, best: State, moves: Sequence[Varied]) -> list[State]:
    """Return states with another value of one register, which others follow: the logs may hardly tell them apart."""
    found = [(one, best.having(one.name, value)) for one in moves for value in one.values]
    for other in moves:
        several = [[there.having(other.name, max(round(now * share), 1)) for share in _FOLLOWS]
                   if one is not other and (now := _value_of(bench, there, other)) else [there] for one, there in found]
        bench.tried([each for some in several for each in some])
        found = [(one, bench.ranked(some)[0]) for (one, _), some in zip(found, several, strict=True)]
    return [state for _, state in found if bench.tried([state])]


def _apart(one: Servo, other: Servo, moves: Sequence[Varied]) -> bool:
    """Tell whether numbers of two programs differ by as much as a search might not go by itself."""
    pairs = [(float(one.get(v.number) or 0.0), float(other.get(v.number) or 0.0)) for v in moves]  # type: ignore[arg-type]
    return any(abs(a - b) > (_FAR - 1.0) * max(a, b) for a, b in pairs)


def _values(one: Varied) -> tuple[int | None, ...]:
    return (*one.values, None) if one.none else one.values


def _value_of(bench: Bench, state: State, one: Varied) -> int | None:
    """Return what a register holds in a state; None: nothing limits its number."""
    if one.name in dict(state.varied):
        return dict(state.varied)[one.name]
    first = bench.sets[state.first]
    if one.number in first.numbers:
        return None
    return first.registers.get(one.registers[0], bench.raw[0][one.registers[0]])
