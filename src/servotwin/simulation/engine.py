"""A run of one servo: what it is made of, what it leaves behind, and the way to the engine's loop, compiled or plain.

Compiled, a state is the bytes of the engine's records, and named tuples are made of these when they are asked for.
"""

from __future__ import annotations

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import SimulationError
from servotwin.models.base import Place
from servotwin.models.engine.events import crossings
from servotwin.models.engine.log import ALL, COUNTS, EVENTS, FEW, KEEPS, LEFT, MOTIONS, PAUSED, Happened, Log, Row
from servotwin.models.engine.memory import ACCURACY, Inputs, Memories, Memory, time_of
from servotwin.models.engine.run import run as engine_run
from servotwin.models.engine.run.run import Plant
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import Mode
from servotwin.models.state.records import fields_of, record_of
from servotwin.models.terms import control, duty, firmware
from servotwin.models.terms.control import Firm
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Pieces
from servotwin.simulation.compile import Recipe, is_compiled, is_plain, kernels
from servotwin.simulation.start import Status

ONE = Recipe("one", ("servotwin.models.engine.run.run:go_on", "servotwin.models.engine.run.at:at",
                     "servotwin.models.engine.run.at:resolution", "servotwin.models.engine.live.stretch:shown"),
             never=("READINGS",))
"""One servo by the one loop, and its signals at any times; kernels take hardly longer for what a servo lacks."""
ROOM, STEPS = 4096, 4096  # rows of a log, and steps between two looks at the log, at progress and at interrupts
_MEMORY, _FIRM, _ROW, _HAPPENED = (record_of(kind) for kind in (Memory, Firm, Row, Happened))


class Event(NamedTuple):
    """Something that happened: time [s], kind, and the output angle [rad] there."""

    time: float
    kind: str
    value: float


@dataclass(frozen=True)
class Plan:
    """The constant part of a run.

    Parameters
    ----------
    numbers : Numbers
        The numbers of servo and load.
    command : Pieces
        Signal that the plant follows [V]; of a pulse servo the width of the pulses [s].
    torque : Pieces
        The external torque that depends on time alone [N m].
    chip : Chip, optional
        The numbers of the frame logic, for a pulse servo.
    edges : tuple of float, optional
        When its frames start [s]; None: regularly.
    seed : int
        Of its noise.
    curve : tuple
        Rows of angle [rad] and error [V] of its potentiometer's linearity table.
    external_torque : float
        Constant, beside the load's [N m].
    accuracy : float
        Of what is integrated [rad].
    firmware : Firmware, optional
        The numbers of its program, for a digital servo.
    """

    numbers: Numbers
    command: Pieces
    torque: Pieces
    chip: Chip = NO_CHIP
    edges: tuple[float, ...] | None = None
    seed: int = 0
    curve: tuple[tuple[float, float], ...] = ()
    external_torque: float = 0.0
    accuracy: float = ACCURACY
    firmware: Firmware = NO_FIRMWARE

    @property
    def digital(self) -> bool:
        """Whether a program decides on the drive."""
        return firmware.present(self.firmware)

    @property
    def pulsed(self) -> bool:
        """Whether the command comes in pulses."""
        return self.chip.frame_period > 0.0

    @cached_property
    def inputs(self) -> Inputs:
        """The commands of the servo, as a step reads them."""
        period = (self.firmware.T_f if self.digital else self.chip.frame_period) if self.edges is None else 0.0
        return Inputs(self.command.table, self.torque.table, self.external_torque, period, self.edges or (),
                      self.curve, self.seed, self.accuracy, (self.firmware,))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "compiled"}

    @cached_property
    def plant(self) -> NDArray[Any]:
        """Servo and load as kernels read them: a record of one."""
        return np.array([(self.numbers, self.chip)], record_of(Plant))

    @cached_property
    def compiled(self) -> Compiled:
        """The run of this plan in compiled code."""
        return Compiled(self)


class State:
    """Everything that a servo remembers; picklable, comparable, and enough to continue from.

    Parameters
    ----------
    time : float
        [s]
    places : tuple of Place
        Which signals are states, and where the engine keeps them.
    memory : Memory or bytes
        All numbers of the state, its clock, and what the chip of a pulse servo has decided.
    numbers : Numbers
        The numbers of servo and load by which it moves since its motion began.
    changes : tuple
        (name, value) of the numbers that are others than the simulator's.
    """

    __slots__ = ("_held", "changes", "numbers", "places", "time")

    def __init__(self, time: float, places: tuple[Place, ...], memory: Memory | bytes, numbers: Numbers | None = None,
                 changes: tuple[tuple[str, object], ...] = ()) -> None:
        self.time, self.places, self.numbers, self.changes = time, places, numbers, changes
        self._held = memory

    def __repr__(self) -> str:
        values = (f"{name}={value:.6g}" for name, value in zip(self.names, self.values, strict=True))
        return f"State(time={self.time:g}, {', '.join(values)})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, State):
            return NotImplemented
        return (self.time, self.places, self.memory, self.numbers, self.changes) == (
            other.time, other.places, other.memory, other.numbers, other.changes)

    def __hash__(self) -> int:
        return hash((self.time, self.memory.point, self.changes))

    def __reduce__(self) -> tuple[type[State], tuple[Any, ...]]:
        return State, (self.time, self.places, self.memory, self.numbers, self.changes)

    @property
    def memory(self) -> Memory:
        """The memory of the engine."""
        if isinstance(self._held, bytes):
            self._held = _memory_in(self._held)
        return self._held

    @property
    def records(self) -> bytes:
        """The same as records of `Memory` and `Firm`, one after the other."""
        return self._held if isinstance(self._held, bytes) else _bytes_of(self._held)

    def with_memory(self, memory: Memory, *, places: tuple[Place, ...] | None = None,
                    changes: tuple[tuple[str, object], ...] | None = None) -> State:
        """Return a state that remembers something else, of a servo that may have other states and numbers."""
        return State(self.time, places or self.places, memory, self.numbers,
                     self.changes if changes is None else changes)

    @property
    def names(self) -> tuple[str, ...]:
        """Signal names of `values`."""
        return tuple(place.name for place in self.places)

    @property
    def values(self) -> tuple[float, ...]:
        """Angle [rad], speed [rad/s] and what else the servo remembers (SI)."""
        return tuple(place.factor * getattr(self.memory.point.y, place.at) for place in self.places)

    def __getitem__(self, name: str) -> float:
        """Return one value by its signal name."""
        for place in self.places:
            if place.name == name:
                value: float = place.factor * getattr(self.memory.point.y, place.at)
                return value
        raise KeyError(f"{name!r} is no state; there are: {', '.join(self.names)}; signals that follow from these: "
                       "Simulator.observe(state, name, command)")


def _bytes_of(memory: Memory) -> bytes:
    return np.array([tuple(memory)[:-1]], _MEMORY).tobytes() + np.array([tuple(memory.firm[0])], _FIRM).tobytes()


def _memory_in(held: bytes) -> Memory:
    firm = named(Firm, np.frombuffer(held, _FIRM, 1, _MEMORY.itemsize).tolist()[0])
    memory: Memory = named(Memory, (*np.frombuffer(held, _MEMORY, 1).tolist()[0], (firm,)))
    return memory


def named(kind: Any, values: Any) -> Any:
    """Return a record's values as the named tuple that it is of, with those in it."""
    return kind(*(named(hint, value) if hasattr(hint, "_fields")
                  else tuple(value.tolist()) if isinstance(value, np.ndarray) else value
                  for (_, hint), value in zip(fields_of(kind), values, strict=True)))


class Part(NamedTuple):
    """Rows of motions of a servo whose numbers stayed the same: records of `Row`, or in plain Python a list."""

    plan: Plan
    rows: Any


@dataclass
class RunLog:
    """The log of a run: rows of its motions, by the numbers that the servo had, and events in order.

    Parameters
    ----------
    tell : callable, optional
        Is given the time [s] that the run has come to, now and then.
    """

    tell: Callable[[float], object] | None = None
    parts: list[Part] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    @cached_property
    def room(self) -> Log:
        """Room for compiled code to write into."""
        return _log(np.empty(ROOM, _ROW), np.empty(ROOM, _HAPPENED))

    @cached_property
    def lists(self) -> Log:
        """Room for the same in plain Python."""
        log = Log([None] * ROOM, [None] * ROOM, [], [0] * COUNTS)
        log.counts[KEEPS] = ALL
        return log

    def read(self, plan: Plan, log: Log) -> None:
        """Take over what a log has, and empty it."""
        motions, events = int(log.counts[MOTIONS]), int(log.counts[EVENTS])
        if motions:
            self.parts.append(Part(plan, log.motions[:motions].copy()))
        if events:
            found = log.events[:events]
            self.events += (Event(time, crossings.NAMES[kind], angle)
                            for time, angle, kind in (found if isinstance(found, list) else found.tolist()))
        log.counts[MOTIONS] = log.counts[EVENTS] = 0


def _log(motions: NDArray[Any], events: NDArray[Any]) -> Log:
    counts = np.zeros(COUNTS, np.int64)
    counts[KEEPS] = ALL if len(motions) else FEW
    return Log(motions, events, np.zeros(0), counts)


def run(plan: Plan, state: State, until: float, record: RunLog | None = None) -> State:
    """Return the state at `until` [s], and add what happened to `record`.

    Raises
    ------
    SimulationError
        If the run cannot continue; it carries status, time and cause.
    """
    own = kernels_of_one()
    memory, status = _plainly(plan, state, until, record) if own is None else plan.compiled.run(state, until, record)
    if status != COMPLETED:
        raise failure(Status.of_code(status), time_of(_memory_in(memory) if isinstance(memory, bytes) else memory))
    return State(until, state.places, memory, plan.numbers, state.changes)


def _plainly(plan: Plan, state: State, until: float, record: RunLog | None) -> tuple[Memory, int]:
    """Run in plain Python; return the memory and a status."""
    memory, status, begins = state.memory, PAUSED, True
    if plan.digital:
        memory = memory._replace(firm=(control.thawed(memory.firm[0]),))
    log = Log([], [], [], [0] * COUNTS) if record is None else record.lists
    while status == PAUSED:
        log.counts[LEFT] = STEPS
        memory, status = engine_run.run(plan.numbers, plan.chip, plan.inputs, memory, until,
                                        plan.numbers != state.numbers, begins, log)
        begins = False
        if record is not None:
            record.read(plan, log)
            if record.tell is not None:
                record.tell(time_of(memory))
    if plan.digital:
        memory = memory._replace(firm=(control.frozen(memory.firm[0]),))
    return memory, status


class Compiled:
    """The run of a plan in compiled code: its arguments stand as words, and one memory is what they work on."""

    def __init__(self, plan: Plan) -> None:
        self._plan, self._lock = plan, threading.Lock()
        self._held = bytearray(_MEMORY.itemsize + _FIRM.itemsize)
        self._view = memoryview(self._held)
        whole = np.frombuffer(self._held, np.uint8)
        self._memories = Memories(whole[:_MEMORY.itemsize].view(_MEMORY), whole[_MEMORY.itemsize:].view(_FIRM))
        self.inputs = _inputs_of(plan)
        self._function = kernels(ONE).go_on.functions[0]
        self._short = self._words(_log(np.empty(0, _ROW), np.empty(0, _HAPPENED)))

    def stood(self, state: State) -> Memories:
        """Return what a servo remembers as records."""
        held = np.frombuffer(bytearray(state.records), np.uint8)
        return Memories(held[:_MEMORY.itemsize].view(_MEMORY), held[_MEMORY.itemsize:].view(_FIRM))

    def _words(self, log: Log) -> _Words:
        words = self._function.words((self._plan.plant, self.inputs, self._memories, 0.0, False, True, log))
        place = self._function.size - _LOG_WORDS - 3
        return _Words(words, words.view(np.float64), place, words.ctypes.data, log)

    def run(self, state: State, until: float, record: RunLog | None) -> tuple[bytes, int]:
        """Return what the servo remembers at a time [s], and a status; read a log whenever it waits."""
        words, floats, place, address, log = self._short if record is None else self._words(record.room)
        with self._lock:
            self._view[:] = state.records
            floats[place] = until
            words[place + 1] = not (state.numbers is self._plan.numbers or state.numbers == self._plan.numbers)
            words[place + 2] = True
            status = PAUSED
            while status == PAUSED:
                log.counts[LEFT] = STEPS
                status = self._function.call(address)
                words[place + 2] = False
                if record is not None:
                    record.read(self._plan, log)
                    if record.tell is not None:
                        record.tell(time_of(_memory_in(bytes(self._view))))
            return bytes(self._view), status


class _Words(NamedTuple):
    """Arguments of a call, where among them time, change and beginning stand, and the log that it writes."""

    words: NDArray[np.int64]
    floats: NDArray[np.float64]
    place: int
    address: int
    log: Log


_LOG_WORDS = 8  # address and length of four arrays


def _inputs_of(plan: Plan) -> Inputs:
    """Return the inputs of a servo as arrays."""
    told = plan.inputs
    table = np.array(plan.curve, np.float64).reshape(-1, 2)
    return Inputs(plan.command.rows, plan.torque.rows, told.constant_torque, told.period,
                  np.array(told.edges, np.float64), table, in_64_bits(told.seed), told.accuracy,
                  np.array([tuple(plan.firmware)], record_of(Firmware)))


def in_64_bits(seed: int) -> int:
    """Return a seed that gives the same noise, which takes the lowest 64 bits alone."""
    return (seed + 2**63) % 2**64 - 2**63


def kernels_of_one() -> Any:
    """Return the kernels of one servo; None where it runs in plain Python."""
    return kernels_beside(ONE)


def kernels_beside(recipe: Recipe) -> Any:
    """Return the kernels of a recipe; None where it runs in plain Python.

    Where there are none yet another process makes them, and they are taken by whoever begins later.
    """
    if is_plain():
        return None
    own = _beside.setdefault(recipe.name, _Kernels())
    if not own.found and time.monotonic() >= own.look:
        if is_compiled(recipe):
            own.found = kernels(recipe)
        elif not own.look:
            _make_beside(recipe)
        own.look = time.monotonic() + _LOOKS
    return own.found


@dataclass
class _Kernels:
    """The kernels of a recipe, once there are any, and when to look for them next [s]."""

    found: Any = None
    look: float = 0.0


_LOOKS = 0.5
_beside: dict[str, _Kernels] = {}


def _make_beside(recipe: Recipe) -> None:
    """Let another process make the kernels of a recipe."""
    text = ("from servotwin.simulation.compile import kernels; from servotwin.simulation.recipes import all_recipes; "
            f"kernels(next(each for each in all_recipes() if each.name == {recipe.name!r}))")
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    threading.Thread(target=subprocess.run, args=([sys.executable, "-c", text],),
                     kwargs={**quiet, "check": False, "start_new_session": True}, daemon=True).start()


HELD = crossings.NAMES[crossings.HELD]
"""Name of an event after which motor and output, that parted and met in no time, stay together for a while."""


def failure(status: Status, time: float) -> SimulationError:
    """Return the error of a run that ended at `time` [s]."""
    return SimulationError(status.name, time, status.message)


def sign_of(now: float) -> float:
    """Return how a bridge drives at a duty: −1, 0 or +1."""
    return math.copysign(1.0, now) if duty.drives(now) else 0.0


def told_by(plan: Plan, memory: Memory) -> tuple[float, float, float, int]:
    """Return what shows of a program: its duty, or `OPEN`, `BRAKED`; goal and reference [rad]; its trip."""
    if not plan.digital:
        return 0.0, 0.0, 0.0, 0
    return control.told_by(memory.firm[0])


TRIPS = crossings.NAMES[crossings.TRIP_ENDS:]


def event_name(kind: int, after: Mode) -> str:
    """Return what to call an event after which this mode holds."""
    return crossings.NAMES[crossings.kind_of(kind, after)]
