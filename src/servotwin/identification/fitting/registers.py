"""Registers that logs did not record: sets of them and single ones, tried as whole lanes before any number is searched.

A register acts in full and at once: one that is wrong bends every number of a fit, and no slope leads to the right one.
So what may stand in registers is simulated as it is, many servos side by side, and the best is where a fit begins.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.free import Space
from servotwin.identification.fitting.loop_gain import GAIN, with_loop_gain
from servotwin.identification.fitting.point import DELAY_SCALE, Point
from servotwin.identification.fitting.stopping import Within
from servotwin.logs.bam_actuators import writes_gain
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters import Servo
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.robots import as_robot_has_it, said_of, set_of_robot
from servotwin.parameters.registers.sets import SETS, VARIED, RegisterSet, Varied
from servotwin.parameters.registers.table import Family, family_label, known_registers, set_registers, written

Array = NDArray[np.float64]
_LOGS = 4  # that are asked, those of the most motion first
_DELAY, _NEAR = 0.01, 1e-4  # s, of the first of these, and what changes nothing
_DELAYED = 3  # simulations of one servo, each at the delay that the one before it wants
_PROMISING = 1.5  # times the least error: what is more gets no delay of its own
_RESTS, _RESTED = 1.5, 0.3  # counts between samples, and s: a shaft that rests
_SECONDS, _MOST = 12.0, 40.0  # of a log, those of the most motion: at first, and in all
_MOST_DELAY = 0.3  # s
_ROUNDS = 3  # of all registers, one after the other
_FAR = 1.25  # step of a register at which the logs tell its value if they do
_FOLLOWS = (0.7, 0.85, 1.0, 1.2, 1.4)  # times a register, while another one has another value
_SAME = 1e-4  # of an error: a register that changes no more does nothing in these logs
_LOOKED = 8  # states elsewhere, of those that leave least on parts of the logs, that all of the logs judge
_BEGINNINGS = 4  # of sweeps, that go on from different values of the first register
_STARTS = 2  # further beginnings of a search
_FINER = (1.25, 1.1, 1.04)  # steps of a register about the best of its values, one round each
TAKEN = 0.5
"""Of the error: registers that leave less are taken."""
ALIKE = 1.05
"""Times the least error: registers that leave less are said beside the best."""
_SMALL = 1.5  # encoder steps: an error that is no more is none of registers
_CLIP = 5.0  # times the median error of the best: a sample counts no more
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
    """What may stand in the registers, and how far the servo is off the logs then.

    Parameters
    ----------
    said : str
        What differs from the servo as it was given, in words.
    servo : Servo
    registers : mapping of str to int or None
        Raw values that differ; None: what they limit is unlimited.
    error : float
        Rms error of the angle at its best delay [rad].
    delay : float
        That delay [s].
    own_gain : bool
        Whether P is another than the logs say.
    """

    said: str
    servo: Servo = field(repr=False)
    registers: Mapping[str, int | None]
    error: float = math.nan
    delay: float = 0.0
    own_gain: bool = False


@dataclass(frozen=True)
class RegisterSearch:
    """What was found of registers that nobody recorded.

    Parameters
    ----------
    given : Tried
        The servo as it was given.
    best : tuple of Tried
        What leaves the least error, and what leaves hardly more, the best first.
    doubted : Tried, optional
        What would leave less than half of that with other values in registers that were given.
    moves : mapping of str to Varied
        Numbers of the program that follow from registers which nobody recorded and which the logs tell, with these.
    others : tuple of Tried
        What leaves little more with values that differ: where a search may begin too.
    """

    given: Tried
    best: tuple[Tried, ...]
    doubted: Tried | None = None
    moves: Mapping[str, Varied] = field(default_factory=dict)
    others: tuple[Tried, ...] = ()

    @property
    def taken(self) -> Tried | None:
        """What a fit begins from in place of the servo as it was given; None where that is good enough."""
        return self.best[0] if self.best and self.best[0].error < TAKEN * self.given.error else None

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be known of it, a line each."""
        said = []
        if self.taken is not None:
            also = [one.said for one in self.best[1:] if not {*one.registers} >= {*self.taken.registers}][:2]
            more = f" ({' and '.join(also)} would leave as little)" if also else ""
            said.append(f"registers that nobody recorded are not as the servo file has them: as if with "
                        f"{self.taken.said}, {_degrees(self.taken.error)} instead of {_degrees(self.given.error)} are "
                        f"left before anything is fitted{more}; read them back, or say them by --register")
        if self.doubted is not None:
            left = (self.taken or self.given).error
            said.append(f"the registers that were given are doubtful: as if with {self.doubted.said}, "
                        f"{_degrees(self.doubted.error)} instead of {_degrees(left)} are left; read them back")
        return tuple(said)


    @property
    def facts(self) -> dict[str, Any]:
        """What was found as plain data (SI)."""
        def of(one: Tried | None) -> dict[str, Any] | None:
            return None if one is None else {"registers": dict(one.registers), "error": one.error, "delay": one.delay}
        return {"given": of(self.given), "taken": of(self.taken), "best": [of(one) for one in self.best],
                "doubted": of(self.doubted)}


class RegisterValue(NamedTuple):
    """A register whose number a fit has searched: its raw value, and the interval of that (nan: none)."""

    name: str
    value: float
    lower: float
    upper: float


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


class _State(NamedTuple):
    """A set, and the registers that are varied beside it: raw values by their name, None for unlimited."""

    first: str
    varied: tuple[tuple[str, int | None], ...] = ()

    def having(self, name: str, value: int | None) -> _State:
        return self._replace(varied=(*((n, v) for n, v in self.varied if n != name), (name, value)))


class _Bench:
    """Whole lanes of a servo with other registers beside some logs."""

    def __init__(self, model: Model, logs: Sequence[Log], family: Family, within: Within) -> None:
        self.model, self.family, self.within = model, family, within
        self.varied = {one.name: one for one in VARIED[family.label]}
        self.sets = {one.name: one for one in (_AS_GIVEN, *SETS.get(family.label, ()))}
        self.raw = written(family, model.servo)
        self.logs = tuple(replace(log, conditions={}) for log in (with_loop_gain(log, model) for log in logs))
        self.gains = any(GAIN in log.parameters for log in self.logs)
        self._seen: dict[_State, Tried] = {}
        self._least = math.inf

    def tried(self, states: Iterable[_State]) -> list[Tried]:
        """Return what is left with some registers, each set of them simulated once."""
        asked = [*dict.fromkeys(states)]
        new = [state for state in asked if state not in self._seen]
        if new and self.within.over:
            raise TimeoutError
        made = [(state, one) for state in new if (one := self._made(state)) is not None]
        groups: dict[tuple[str, ...], list[tuple[_State, Tried]]] = {}
        for state, one in made:
            groups.setdefault(_form(one.servo), []).append((state, one))
        for group in groups.values():
            for (state, _), known in zip(group, self._judged([one for _, one in group]), strict=True):
                self._seen[state] = known
        return [self._seen[state] for state in asked if state in self._seen]

    def ranked(self, states: Iterable[_State]) -> list[_State]:
        """Return states by what is left with them, the least first; as they are where none can be simulated."""
        asked = [*states]
        self.tried(asked)
        known = [state for state in asked if state in self._seen]
        return sorted(known, key=lambda state: self._seen[state].error) or asked

    def seen(self, free: Sequence[Varied]) -> list[Tried]:
        """Return all that was simulated in which no other registers differ than some, and those of sets."""
        names = {one.name for one in free}
        return [one for state, one in self._seen.items() if names >= {name for name, _ in state.varied}]

    def _made(self, state: _State) -> Tried | None:
        """Return the servo with these registers; None where it cannot have them."""
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
                servo = set_registers(self.family, given, self.model.servo, assumed=True)
            if numbers:
                servo = servo.replace(numbers, source="assumed: no value of a register says so")
        except ServotwinError:
            return None
        changed = {name: value for name, value in registers.items() if value != self.raw.get(name)}
        changed |= {one.registers[0]: None for one in self.varied.values()
                    if one.number in numbers and numbers[one.number] is None}
        own = any(name in registers for one in self.varied.values() if one.number == GAIN for name in one.registers)
        return Tried(_words(changed, self.varied.values()), servo, changed, own_gain=own)

    def _judged(self, some: Sequence[Tried]) -> list[Tried]:
        """Return servos of one form with the error that each leaves, at its best delay."""
        base = some[0].servo
        names = sorted({name for one in some for name in _numbers(one.servo)
                        if one.servo.get(name) != base.get(name)} | ({GAIN} if self.gains else set()))
        copies = []
        for k, one in enumerate(some):
            own = {name: float(one.servo.get(name)) for name in names}  # type: ignore[arg-type]
            for log in self.logs:
                said = {GAIN: log.parameters[GAIN]} if GAIN in log.parameters and not one.own_gain else {}
                copies.append(replace(log, name=f"{log.name} {k}", parameters={**log.parameters, **own, **said}))
        model = type(self.model)(base)
        forecast = Forecast(copies, model, Space(model, [_any_of(model, copies)]), ("initial_state", "log_delay"),
                            ("output_angle",))
        forecast.strict, forecast.nearly = False, forecast.bent
        n = len(self.logs)
        where = [forecast.names_of_own(case).index("log_delay") for case in forecast.cases]
        starts = [forecast.own_start(case) for case in forecast.cases]
        found = [*some]
        asked, delays = [*range(len(some))], np.full(len(some), _DELAY)
        for _ in range(_DELAYED):
            for i, start in enumerate(starts):
                start[where[i]] = delays[i // n] / DELAY_SCALE
            parts = forecast.at(Point(forecast.space.start, tuple(start.copy() for start in starts)),
                                derivatives=False, cases=[i for k in asked for i in range(k * n, (k + 1) * n)])
            later, hoped = delays.copy(), np.full(len(some), math.inf)
            for j, k in enumerate(asked):
                r, g = (np.concatenate([getattr(part, name) for part in parts[j * n:(j + 1) * n]])
                        for name in ("residual", "later"))
                error = _rms(r)
                if not error >= found[k].error:
                    found[k] = replace(found[k], error=error, delay=float(delays[k]))
                more = _later(r, g)
                later[k] = min(max(float(delays[k]) + more * DELAY_SCALE, 0.0), _MOST_DELAY)
                hoped[k] = min(error, _rms(r + more * g))
            self._least = min([self._least, *(one.error for one in found)])
            delays = later
            asked = [k for k in asked if hoped[k] < _PROMISING * self._least and abs(later[k] - found[k].delay) > _NEAR]
            if not asked:
                break
        return found


def _rms(residual: Array) -> float:
    return math.sqrt(float(np.mean(residual**2))) if np.isfinite(residual).all() else math.inf


def _later(residual: Array, later: Array) -> float:
    """Return by how much more delay (scaled) fits best to first order, errors of most samples counting."""
    if not np.isfinite(residual).all():
        return 0.0
    step, size = 0.0, 1.4826 * float(np.median(np.abs(residual))) or 1.0
    for _ in range(4):
        left = np.abs(residual + later * step)
        weight = np.minimum(1.0, 1.345 * size / np.maximum(left, 1e-12))
        power = float(weight @ later**2)
        if power <= 0.0:
            return 0.0
        step = -float(weight @ (later * residual)) / power
    return step


def _numbers(servo: Servo) -> list[str]:
    return [name for name in servo.names() if name.startswith("firmware.")
            and isinstance(servo.get(name), int | float)]


def _form(servo: Servo) -> tuple[str, ...]:
    """Return what lanes of one call share: which numbers of the program there are, and its words."""
    return tuple(name if isinstance(servo.get(name), int | float) else f"{name}={servo.get(name)}"
                 for name in servo.names() if name.startswith("firmware."))


def _any_of(model: Model, logs: Sequence[Log]) -> str:
    taken = {name for log in logs for name in log.parameters}
    return next(name for name in ("motor.armature_resistance", "motor.rotor_inertia", "motor.torque_constant",
                                  "gear.gear_reduction") if name not in taken)


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
    label = family_label(model.servo)
    if not isinstance(model, DigitalServo) or not model.takes_goals or label is None or label not in VARIED:
        return None
    family = register_family_of(model.servo)
    seen = [log for log in logs if log.angle_name == "output_angle" and log.command_kind == "angle"]
    seen = [_busiest(log, family.count, _MOST) for log in
            sorted(seen, key=lambda log: -float(np.nanstd(log.measured["output_angle"])))[:_LOGS]]
    if not seen:
        return None
    known = known_registers(family, model.servo) | _recorded(seen, VARIED[label])
    bench = _Bench(model, seen, family, within)
    some = [_busiest(log, family.count, _SECONDS) for log in seen]
    first = bench if all(a is b for a, b in zip(some, seen, strict=True)) else _Bench(model, some, family, within)
    given = bench.tried([_State(_AS_GIVEN.name)])
    if not given or not math.isfinite(given[0].error):
        return None
    if given[0].error <= _SMALL * family.count:
        return RegisterSearch(given[0], ())
    found = _searched(first, bench, known)
    doubted = None
    if known and found.best[0].error > 2.0 * _SMALL * family.count:
        other = _searched(first, bench, frozenset()).best[0]
        doubted = other if other.error < TAKEN * min(given[0].error, found.best[0].error) else None
    return RegisterSearch(given[0], found.best, doubted, found.moves, found.others)


def _busiest(log: Log, count: float, seconds: float) -> Log:
    """Return the part of a log in which its command goes furthest, from rest on; all of one that is short.

    In motion nobody knows where the profile of the program stands.
    """
    if log.duration <= seconds:
        return log
    time, q = log.time, log.measured["output_angle"]
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(log.held)))])
    moved = (np.abs(np.diff(q, prepend=q[:1])) > _RESTS * count) | (np.diff(way, prepend=0.0) > 0.0)
    last_moved = np.maximum.accumulate(np.where(moved, time, time[0]))
    ends = np.searchsorted(time, time + seconds, side="right") - 1
    rests = (time - last_moved >= _RESTED) & (time <= time[-1] - seconds)
    rests[0] = True
    first = int(np.argmax(np.where(rests, way[ends] - way, -1.0)))
    return log.part(float(time[first]), float(time[ends[first]]))


def _recorded(logs: Sequence[Log], varied: Sequence[Varied]) -> frozenset[str]:
    """Return registers of which logs say what they hold: that of P where all name its gain."""
    if all(GAIN in log.parameters or ("gain" in log.conditions and writes_gain(log.conditions.get("motor", "")))
           for log in logs):
        return frozenset(name for one in varied if one.number == GAIN for name in one.registers)
    return frozenset()


class _Found(NamedTuple):
    """What leaves the least error, and hardly more; the numbers that the logs tell; and where else they may be."""

    best: tuple[Tried, ...]
    moves: Mapping[str, Varied]
    others: tuple[Tried, ...]


def _searched(first: _Bench, bench: _Bench, known: frozenset[str]) -> _Found:
    """Return what stands in registers that are not known; `first` has parts of the logs, on which the search begins.

    Sets are tried first, then single registers and pairs, then one register after the other from the best for each
    value of the first one, which hides what all others do.
    """
    free = [one for one in bench.varied.values() if not known & {*one.registers}]
    stays = {one.number for one in bench.varied.values() if one not in free}
    sets = [_State(one.name) for one in bench.sets.values() if not known & {*one.registers}
            and not stays & {*one.numbers}]
    states = [*sets, *(sets[0].having(one.name, value) for one in free for value in _values(one)),
              *(sets[0].having(one.name, a).having(other.name, b)
                for one, other in pairwise(free) for a in _values(one) for b in _values(other))]
    groups: dict[int | None, _State] = {}
    for state in first.ranked(states):
        groups.setdefault(_value_of(first, state, free[0]) if free else None, state)
    best = bench.ranked(_swept(first, [*groups.values()][:_BEGINNINGS], free))[0]
    for _ in range(_ROUNDS):
        best = _refined(bench, _swept(bench, [best], free)[0], free)
        moves = [one for one in free if _tells(bench, best, one)]
        others = first.ranked(_elsewhere(first, best, moves))[:_LOOKED]
        better = bench.ranked([best, *others])[0]
        if better == best:
            break
        best = better
    least = bench.tried([best])[0]
    near = {tuple(one.registers.items()): one for one in bench.seen(free) if one.error <= ALIKE * least.error}
    far: list[Tried] = []
    for one in bench.tried(bench.ranked(others)):
        if one.error < _PROMISING * least.error and all(
                abs(one.error - each.error) > _SAME * least.error and _apart(one.servo, each.servo, moves)
                for each in (least, *far)):
            far.append(one)
    simple = sorted(near.values(), key=lambda one: (len(one.registers), one.error))
    return _Found(tuple(simple), {one.number: one for one in moves}, tuple(far[:_STARTS]))


def _swept(bench: _Bench, states: Sequence[_State], free: Sequence[Varied]) -> list[_State]:
    """Return states with one register after the other at the best of its values."""
    for one in free:
        several = [[state, *(state.having(one.name, value) for value in _values(one))] for state in states]
        bench.tried([each for some in several for each in some])
        states = [bench.ranked(some)[0] for some in several]
    return [*states]


def _refined(bench: _Bench, state: _State, free: Sequence[Varied]) -> _State:
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


def _tells(bench: _Bench, state: _State, one: Varied) -> bool:
    """Tell whether the error grows where a register has a value somewhat larger, or smaller."""
    now = _value_of(bench, state, one)
    if not now:
        return False
    here, *near = bench.tried([state, *(state.having(one.name, round(now * f)) for f in (_FAR, 1.0 / _FAR))])
    return max((each.error for each in near), default=0.0) > ALIKE * here.error


def _elsewhere(bench: _Bench, best: _State, moves: Sequence[Varied]) -> list[_State]:
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


def _value_of(bench: _Bench, state: _State, one: Varied) -> int | None:
    """Return what a register holds in a state; None: nothing limits its number."""
    if one.name in dict(state.varied):
        return dict(state.varied)[one.name]
    first = bench.sets[state.first]
    if one.number in first.numbers:
        return None
    return first.registers.get(one.registers[0], bench.raw[one.registers[0]])
