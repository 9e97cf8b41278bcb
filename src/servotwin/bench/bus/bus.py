"""Several servos on one wire, commanded and read at the same ticks."""

from __future__ import annotations

import contextlib
import math
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from servotwin.bench.backends.board_backend import Backend
from servotwin.bench.backends.serial_port import SerialBackend
from servotwin.bench.bus.families import BusFamily, BusModel, chunks, count_of, decoded
from servotwin.bench.bus.scan import FoundServo, identified, wire_of
from servotwin.bench.bus.sdk_wire import BITS, PATIENCE, Answer, BusWire
from servotwin.bench.recording.experiment import Experiment
from servotwin.errors import BenchError, InputError

# --- A servo on a wire, as the recorder has it: its registers, what it was sent, what it said -------------------------

_ALERT = 128  # of a status byte of protocol 2


class BusServo:
    """Known facts of a servo.

    Parameters
    ----------
    id : int
    model : BusModel
    registers : mapping of str to int
        Raw values of all registers, as they were read.

    Raises
    ------
    BenchError
        If it is not set to control its angle.
    """

    def __init__(self, id: int, model: BusModel, registers: Mapping[str, int]) -> None:
        self.id, self.model, self.registers = id, model, dict(registers)
        self.limits = self.family.goals(self.registers)
        self.channels = self.family.columns(self.registers)
        first = self.family.block[0]
        self._places = [(self.family.registers[one.register], one.scale, one.offset,
                         self.family.registers[one.register].address - first) for one in self.channels]
        self.goal = registers.get("Goal_Position", self.family.middle)
        self.torque = bool(registers.get("Torque_Enable", 0))
        self.command = math.nan  # deg
        self.fresh()

    def fresh(self) -> None:
        """Forget what belongs to a run."""
        self.order: tuple[int, int] = (-1, -1)
        self.error, self.lost, self.tripped = 0, 0, False
        self.misses = 0  # since its last answer
        self._heard: float | None = None

    @property
    def family(self) -> BusFamily:
        """Of its model."""
        return self.model.family

    def told(self, goal: int) -> None:
        """Note a goal that was written [counts]."""
        self.goal = goal
        self.command = (goal - self.family.middle) * self.family.count

    def heard(self, answer: Answer | None, now: float) -> float:
        """Note whether it answered; return for how long it has not [s]."""
        self.misses = 0 if answer is not None else self.misses + 1
        if answer is not None or self._heard is None:
            self._heard = now
        return now - self._heard

    def values(self, data: Sequence[int]) -> list[float]:
        """Return the values of a block of its registers, in the units of its columns."""
        return [scale * register.decode(data[place:place + register.size]) + offset
                for register, scale, offset, place in self._places]

    def words(self, values: Mapping[str, int]) -> str:
        """Return what its status byte says, with registers that were read because of it."""
        bits = self.error
        if self.family.protocol == "dynamixel-2":
            bits = values.get("Hardware_Error_Status", 0) if self.error & _ALERT else 0
        said = [text for bit, text in self.family.errors.items() if bits & bit]
        if not said:
            return "no error any more" if not self.error else f"status {self.error}"
        off = "; it has switched its torque off" if values.get("Torque_Enable") == 0 and self.torque else ""
        return f"error: {', '.join(said)}{off}"

    def facts(self) -> dict[str, Any]:
        """Return what a sidecar says of it."""
        return {"servo_id": self.id, "model": self.model.name, "family": self.family.name,
                "registers": dict(self.registers),
                "columns": {one.column: {"register": one.register, "scale": one.scale, "offset": one.offset}
                            for one in self.channels},
                "columns_source": self.family.source}


def opened(wire: BusWire, protocol: str, servo: int) -> BusServo:
    """Return a servo with all its registers read.

    Raises
    ------
    BenchError
        If it does not answer, is of a model that is not known, or is not set to control its angle.
    """
    model = identified(wire, protocol, servo)
    memory: dict[int, int] = {}
    for address, size in chunks(model.family.registers):
        memory.update(enumerate(wire.read(servo, address, size).data, start=address))
    try:
        return BusServo(servo, model, decoded(model.family.registers, memory))
    except BenchError as error:
        raise BenchError(f"{error.what} at {wire.name}", error.problem) from None


# --- A clock that ticks at a fixed rate and does not drift ------------------------------------------------------------

class Ticks:
    """Instants that lie whole periods behind the first; those that are missed are counted and passed over.

    Parameters
    ----------
    rate : float
        [Hz]
    clock, sleep : callable
        Of the host unless given [s].

    Examples
    --------
    >>> now = [0.0]
    >>> ticks = Ticks(100.0, clock=lambda: now[0], sleep=lambda t: now.__setitem__(0, now[0] + t))
    >>> [ticks.next(), ticks.next()], round(now[0], 3)
    ([0, 1], 0.01)
    >>> now[0] = 0.0345  # something took long
    >>> ticks.next(), ticks.late
    (3, 1)
    """

    def __init__(self, rate: float, *, clock: Callable[[], float] = time.perf_counter,
                 sleep: Callable[[float], None] = time.sleep) -> None:
        self.rate = rate
        self.late = 0
        self.start = 0.0
        self._clock, self._sleep = clock, sleep
        self._tick = -1

    def next(self) -> int:
        """Wait for the next tick that has not passed and return its number; the first is now, and 0."""
        if self._tick < 0:
            self.start = self._clock()
        self._tick += 1
        missed = int((self._clock() - self.start) * self.rate) - self._tick
        if missed > 0:
            self.late += missed
            self._tick += missed
        wait = self.start + self._tick / self.rate - self._clock()
        if wait > 0.0:
            self._sleep(wait)
        return self._tick


# --- Goals of a servo on a bus at the ticks of an experiment ----------------------------------------------------------

_KIND = "angle"


class Order(NamedTuple):
    """The state at a tick.

    Parameters
    ----------
    goal : int or None
        [counts]; None: torque off.
    number : tuple of int
        Of the order; a new one is to be written.
    """

    goal: int | None
    number: tuple[int, int]


class Goals:
    """An experiment in ticks and counts.

    Parameters
    ----------
    experiment : Experiment
    family : BusFamily
    limits : tuple of int
        Lowest and highest goal that the servo takes [counts].
    rate : float
        Of the ticks [Hz].

    Raises
    ------
    InputError
        If it commands no angles, or more than the servo takes.
    """

    def __init__(self, experiment: Experiment, family: BusFamily, limits: tuple[int, int], rate: float) -> None:
        if experiment.kind != _KIND:
            raise InputError(f"experiment {experiment.name!r}", got=f"commands of {experiment.kind}", allowed=_KIND)
        self._counts = [None if one.value is None else goal_of(family, limits, one.value) for one in experiment.holds]
        self._frames = [max(1, round((one.frame_period or experiment.frame_period) * rate)) for one in experiment.holds]
        lengths = [max(1, round(one.duration * rate)) for one in experiment.holds]
        self._starts = [0, *accumulate(lengths)]

    @property
    def ticks(self) -> int:
        """How many there are."""
        return self._starts[-1]

    def at(self, tick: int) -> Order:
        """Return what holds at a tick; behind the end the last goal stays."""
        hold = min(bisect_right(self._starts, tick), len(self._counts)) - 1
        return Order(self._counts[hold], (hold, (tick - self._starts[hold]) // self._frames[hold]))


def goal_of(family: BusFamily, limits: tuple[int, int], angle: float) -> int:
    """Return an angle [rad] as a goal [counts].

    Raises
    ------
    InputError
        If the servo does not take it.
    """
    goal = count_of(family, angle)
    if not limits[0] <= goal <= limits[1]:
        low, high = (round((count - family.middle) * family.count, 1) for count in limits)
        raise InputError("goal of the servo", got=f"{(goal - family.middle) * family.count:.1f} deg",
                         allowed=f"{low:g} to {high:g} deg, the limits in its registers")
    return goal


# --- Several servos on one wire, commanded and read at the same ticks -------------------------------------------------

_MOST_RATE = 1000.0  # Hz
_SILENCE, _MISSES = 0.5, 5  # s and questions without an answer after which a servo counts as gone
_TRIES = 3
_APPROACH = math.radians(60.0)  # rad/s, assumed: slow enough for a hand to get away
_APPROACH_RATE, _SETTLE, _STILL, _STILL_COUNTS = 50.0, 5.0, 0.2, 1  # Hz, s, s, counts


class BusEvent(NamedTuple):
    """Something that happened in a run.

    Parameters
    ----------
    time : float
        From the run's start [s].
    servo : int
    what : str
    """

    time: float
    servo: int
    what: str


class Bus:
    """Servos that are recorded together: one request and one answer each at every tick.

    Parameters
    ----------
    backend : Backend
    protocol : {"feetech", "dynamixel-2", "dynamixel-1"}
    ids : sequence of int
        Of the servos.
    rate : float
        Rows in a second [Hz].
    baud : int
        Speed of the wire, for how long packets last; that of the backend is its own matter [bit/s].
    patience : float
        How long an answer may be late beyond its time on the wire; rows wait for so long for one that is lost [s].

    Raises
    ------
    InputError
        If the rate is not possible, or an id comes twice.
    """

    def __init__(self, backend: Backend, protocol: str, ids: Sequence[int], *, rate: float = 100.0,
                 baud: int = 1_000_000, patience: float = PATIENCE) -> None:
        if not (isinstance(rate, int | float) and 0.0 < rate <= _MOST_RATE):
            raise InputError("rate", got=rate, allowed=f"more than 0 and at most {_MOST_RATE:g} Hz")
        if not ids or len(set(ids)) != len(ids):
            raise InputError("ids of servos", got=list(ids), allowed="at least one, each once")
        self.protocol, self.rate, self.baud = protocol, float(rate), baud
        self.wire: BusWire = wire_of(protocol, backend, baud=baud, patience=patience)
        self.ids = tuple(ids)
        self.servos: dict[int, BusServo] = {}
        self.events: list[BusEvent] = []
        self.late = 0

    def open(self) -> None:
        """Take the wire, read all registers of all servos, and let them go limp.

        Raises
        ------
        BenchError
            If the wire is not there, a servo does not answer, or is of a model that is not known.
        InputError
            If rows cannot come so fast on this wire.
        """
        self.wire.open()
        try:
            self.servos = {one: opened(self.wire, self.protocol, one) for one in self.ids}
            self._check_rate()
            for servo in self.servos.values():
                self._torque(servo, on=False)
        except BaseException:
            self.close()
            raise

    def facts(self, servo: int) -> dict[str, Any]:
        """Return what the sidecar of a servo's log says, in plain JSON."""
        one = self.servos[servo]
        return {"rig": "bus", "port": self.wire.name, "protocol": self.protocol, "baud": self.baud,
                "rate_Hz": self.rate, **one.facts(), "late_ticks": self.late, "lost_answers": one.lost,
                "events": [{"time_s": round(event.time, 4), "what": event.what} for event in self.events
                           if event.servo == servo]}

    def approach(self, angles: Mapping[int, float]) -> None:
        """Let servos go to angles [rad] slowly and wait until they stand, at most 5 s after the way there.

        Raises
        ------
        BenchError
            If one does not answer.
        InputError
            If one does not take its angle.
        """
        ends = {one: goal_of(self.servos[one].family, self.servos[one].limits, angle) for one, angle in angles.items()}
        starts = {one: self._hold(self.servos[one]) for one in ends}
        step = {one: _APPROACH / math.radians(self.servos[one].family.count) / _APPROACH_RATE for one in ends}
        ticks = Ticks(_APPROACH_RATE)
        way = max((math.ceil(abs(ends[one] - starts[one]) / step[one]) for one in ends), default=0)
        while (k := ticks.next()) <= way:
            self._write_goals({one: _towards(starts[one], ends[one], k * step[one]) for one in ends})
        self._write_goals(ends)
        self._settle(tuple(ends))

    def run(self, experiments: Mapping[int, Experiment]) -> Iterator[dict[int, tuple[float, ...]]]:
        """Command an experiment for each servo and yield a row for each at every tick.

        Servos whose experiment has ended keep their last command. A servo is read first and commanded then, so that a
        command comes up to a tick's traffic after the row that has it, always by the same time.

        Raises
        ------
        BenchError
            If the wire is cut or a servo is gone.
        InputError
            If a servo does not take what an experiment commands.
        """
        plans = {one: Goals(experiment, self.servos[one].family, self.servos[one].limits, self.rate)
                 for one, experiment in experiments.items()}
        self.events, self.late = [], 0
        for one in plans:
            self.servos[one].fresh()
            self._hold(self.servos[one])
        ticks, last = Ticks(self.rate), max(plan.ticks for plan in plans.values())
        while (k := ticks.next()) < last:
            self.late = ticks.late
            asked = time.perf_counter()
            answers = self._ask(tuple(plans))
            self._tell(plans, k, ticks.start)
            yield {one: self._row(self.servos[one], answers.get(one), asked, ticks.start)
                   for one, plan in plans.items() if k < plan.ticks}

    def limp(self) -> None:
        """Switch all torque off, several times; never raises."""
        if not self.servos:
            return
        for servo in self.servos.values():
            servo.torque = False
        register = next(iter(self.servos.values())).family.registers["Torque_Enable"]
        for _ in range(_TRIES):
            with contextlib.suppress(Exception):
                self.wire.write_all(register.address, dict.fromkeys(self.servos, register.encode(0)))
        for one in self.servos:
            with contextlib.suppress(Exception):
                self.wire.write(one, register.address, register.encode(0))

    def close(self) -> None:
        """Let the servos go and give the wire back."""
        self.limp()
        with contextlib.suppress(Exception):
            self.wire.close()

    # --- one tick -----------------------------------------------------------------------------------------------------

    def _ask(self, ids: Sequence[int]) -> dict[int, Answer]:
        address, size = self.servos[ids[0]].family.block
        answers = self.wire.read_all(ids, address, size)
        now = time.perf_counter()
        for one in ids:
            silence = self.servos[one].heard(answers.get(one), now)
            if silence <= _SILENCE or self.servos[one].misses < _MISSES:
                continue
            raise BenchError(f"servo {one} at {self.wire.name}", f"it has not answered for {_SILENCE:g} s")
        return answers

    def _tell(self, plans: Mapping[int, Goals], tick: int, start: float) -> None:
        goals: dict[int, int] = {}
        for one, plan in plans.items():
            servo, order = self.servos[one], plan.at(tick)
            if order.number == servo.order:
                continue
            servo.order = order.number
            if order.goal is not None:
                goals[one] = order.goal
            elif servo.torque:
                self._torque(servo, on=False)
        self._write_goals(goals)
        for one in goals:
            if not self.servos[one].torque and not self.servos[one].tripped:
                self._torque(self.servos[one], on=True)
                self._write_goals({one: goals[one]})  # some forget their goal when torque comes

    def _row(self, servo: BusServo, answer: Answer | None, asked: float, start: float) -> tuple[float, ...]:
        if answer is None:
            servo.lost += 1
            return (asked - start, servo.command, *[math.nan] * len(servo.channels), float(servo.torque))
        if answer.error != servo.error:
            self._note(servo, answer, start)
        return (answer.middle - start, servo.command, *servo.values(answer.data), float(servo.torque))

    def _note(self, servo: BusServo, answer: Answer, start: float) -> None:
        """Write down what an error is, and look whether it took the torque."""
        servo.error = answer.error
        values = {}
        for name in ("Hardware_Error_Status", "Torque_Enable"):
            register = servo.family.registers.get(name)
            if register is not None:
                with contextlib.suppress(BenchError):
                    values[name] = register.decode(self.wire.read(servo.id, register.address, register.size).data)
        self.events.append(BusEvent(answer.middle - start, servo.id, servo.words(values)))
        if servo.torque and values.get("Torque_Enable") == 0:
            servo.torque, servo.tripped = False, True

    # --- orders -------------------------------------------------------------------------------------------------------

    def _write_goals(self, goals: Mapping[int, int]) -> None:
        if not goals:
            return
        register = self.servos[next(iter(goals))].family.registers["Goal_Position"]
        self.wire.write_all(register.address, {one: register.encode(goal) for one, goal in goals.items()})
        for one, goal in goals.items():
            self.servos[one].told(goal)

    def _torque(self, servo: BusServo, *, on: bool) -> None:
        register = servo.family.registers["Torque_Enable"]
        self.wire.write(servo.id, register.address, register.encode(int(on)))
        servo.torque = on

    def _position(self, servo: BusServo) -> int:
        register = servo.family.registers["Present_Position"]
        return register.decode(self.wire.read(servo.id, register.address, register.size).data)

    def _hold(self, servo: BusServo) -> int:
        """Switch a servo's torque on where it is, so that it does not jump; return its goal [counts]."""
        if not servo.torque:
            goal = min(max(self._position(servo), servo.limits[0]), servo.limits[1])
            self._write_goals({servo.id: goal})
            self._torque(servo, on=True)
            self._write_goals({servo.id: goal})
            return goal
        return servo.goal

    def _settle(self, ids: Sequence[int]) -> None:
        end, since = time.perf_counter() + _SETTLE, time.perf_counter()
        places = {one: self._position(self.servos[one]) for one in ids}
        while (now := time.perf_counter()) < end and now - since < _STILL:
            time.sleep(1.0 / _APPROACH_RATE)
            seen = {one: self._position(self.servos[one]) for one in ids}
            if any(abs(seen[one] - places[one]) > _STILL_COUNTS for one in ids):
                places, since = seen, now

    def _check_rate(self) -> None:
        """Refuse a rate at which the bytes alone take longer than a tick."""
        first = next(iter(self.servos.values()))
        count, extra = len(self.servos), 11 if self.protocol == "dynamixel-2" else 6
        size, goal = first.family.block[1], first.family.registers["Goal_Position"].size
        bytes_a_tick = 2 * (extra + 2) + count * (extra + size + 1 + 1 + goal)
        least = bytes_a_tick * BITS / self.baud
        if least * self.rate > 1.0:
            raise InputError("rate", got=f"{self.rate:g} Hz", allowed=f"at most {math.floor(1.0 / least)} Hz for "
                             f"{count} servos at {self.baud} bit/s")


def _towards(start: int, end: int, way: float) -> int:
    return round(start + math.copysign(min(way, abs(end - start)), end - start))


# --- A servo on a bus as a rig: what the recorder records from --------------------------------------------------------

class BusRig:
    """A Feetech or Dynamixel servo on its wire.

    Parameters
    ----------
    backend : Backend
    protocol : {"feetech", "dynamixel-2", "dynamixel-1"}
    id : int
        Of the servo.
    rate : float
        Rows in a second [Hz].
    baud : int
        Speed of the wire [bit/s].
    patience : float
        How long an answer may be late beyond its time on the wire; rows wait for so long for one that is lost [s].

    Raises
    ------
    InputError
        If the rate is not possible.
    """

    kind = "angle"

    def __init__(self, backend: Backend, protocol: str, id: int, *, rate: float = 100.0,
                 baud: int = 1_000_000, patience: float = PATIENCE) -> None:
        self.bus = Bus(backend, protocol, [id], rate=rate, baud=baud, patience=patience)
        self.id = id

    @property
    def columns(self) -> Sequence[str]:
        """Of its rows; what is measured depends on the model, which is known once it is open."""
        return columns_of(self.bus, self.id)

    def open(self) -> None:
        """Take the wire and read all registers; the servo is limp."""
        self.bus.open()

    def facts(self) -> Mapping[str, Any]:
        """Return model, registers, what the columns are made of, and what happened in the last run."""
        return self.bus.facts(self.id)

    def approach(self, value: float) -> None:
        """Go to an angle [rad] slowly and wait until the servo stands."""
        self.bus.approach({self.id: value})

    def run(self, experiment: Experiment) -> Iterator[Sequence[float]]:
        """Command an experiment and yield rows as they come."""
        for rows in self.bus.run({self.id: experiment}):
            yield rows[self.id]

    def limp(self) -> None:
        """Switch the torque off; never raises."""
        self.bus.limp()

    def close(self) -> None:
        """Switch the torque off and give the wire back."""
        self.bus.close()


def columns_of(bus: Bus, servo: int) -> tuple[str, ...]:
    """Return the columns of a servo's rows."""
    return ("time_s", "command_angle_deg", *(one.column for one in bus.servos[servo].channels), "torque_on")


def rig_of(port: str, found: FoundServo, *, rate: float = 100.0) -> BusRig:
    """Return the rig of a servo that `scan` has found on a port."""
    return BusRig(SerialBackend(port, found.baud), found.protocol, found.id, rate=rate, baud=found.baud)
