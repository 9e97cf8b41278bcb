"""Several servos on one wire, commanded and read at the same ticks."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from servotwin.bench.backends.backend import Backend
from servotwin.bench.bus.goals import Goals, goal_of
from servotwin.bench.bus.scan import wire_of
from servotwin.bench.bus.sdk_wire import BITS, PATIENCE, Answer, BusWire
from servotwin.bench.bus.servo import BusServo, opened
from servotwin.bench.bus.ticks import Ticks
from servotwin.bench.recording.experiment import Experiment
from servotwin.errors import BenchError, InputError

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

        Servos whose experiment has ended keep their last command. A servo is read first and told then, so that a
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
