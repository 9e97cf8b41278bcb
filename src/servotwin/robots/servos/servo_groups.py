"""Which servos of a robot run together, and their simulators in one of MuJoCo's data."""

from __future__ import annotations

import ctypes
import math
import threading
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.datasheet.turning import is_pulsed
from servotwin.errors import InputError, UnknownNameError
from servotwin.models import Model
from servotwin.parameters.groups import Supply
from servotwin.robots.places import Places, load_mujoco
from servotwin.robots.servos.command_map import CommandMap, own_map, told
from servotwin.robots.servos.coupling import silence
from servotwin.robots.servos.joints_layout import (
    ARRAYS,
    ASK_NEW,
    ASK_RESET,
    BLOCK,
    BOOKS,
    DRIVE,
    GROUP,
    INSTANCE,
    KEPT,
    OF_EACH,
    RECORD,
    ROOM,
    ROW,
)
from servotwin.robots.servos.mount import Joint
from servotwin.simulation import VectorSimulator
from servotwin.simulation.lanes.c_entry import CEntry

# --- Unlike servos of one kind side by side: what differs among them, as numbers of each ------------------------------

OF_THE_BUS = ("supply.open_circuit_voltage", "supply.internal_resistance", "supply.current_limit")
"""Numbers of servos on a shared supply."""
_SHARE, _SHARES = "friction.load_friction", ("friction.load_friction_motor", "friction.load_friction_external")
_ABSENT = {  # numbers that say the same as nothing: those of files that change least
    "firmware.duty_slew": 1e5, "firmware.undervoltage": 0.5, "motor.motor_viscous_friction": 0.0,
    "motor.brush_drop_voltage": 0.0, "supply.bridge_drop_voltage": 0.0, "supply.bridge_drop_resistance": 0.0,
    **dict.fromkeys(_SHARES, 0.0),
}


def of_one_form(models: Sequence[Model]) -> list[Model]:
    """Return models in which load friction is written alike: one share as two equal ones, where others have two."""
    if not any(model.servo.get(name) is not None for model in models for name in _SHARES):
        return list(models)
    found = []
    for model in models:
        share = model.servo.get(_SHARE)
        found.append(model if share is None else type(model)(model.servo.replace(
            {_SHARE: None, **dict.fromkeys(_SHARES, float(share))})))  # type: ignore[arg-type]
    return found


def differing(models: Sequence[Model], names: Sequence[str]) -> dict[str, list[float | str]]:
    """Return what differs among models, of one form and kind, by name.

    Parameters
    ----------
    models : sequence of Model
    names : sequence of str
        Of the joints, for the words.

    Raises
    ------
    InputError
        If one has a number that another lacks, and no number says the same as none.
    """
    found: dict[str, list[float | str]] = {}
    first = models[0]
    for name in (*first.requires, *first.optional):
        values = [model.servo.get(name) for model in models]
        if all(value == values[0] for value in values):
            continue
        known = [_ABSENT.get(name) if value is None else value for value in values]
        usable = [value for value in known if isinstance(value, int | float | str)]
        if len(usable) < len(known):
            absent = next(joint for joint, value in zip(names, known, strict=True)
                          if not isinstance(value, int | float | str))
            raise InputError(f"{name} of servos side by side", got=f"none at joint {absent}",
                             allowed="a number of each servo, or of none: give it in its file")
        found[name] = usable
    return found


# --- Which servos of a robot run together, and their simulators in one of MuJoCo's data -------------------------------

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_GIVEN = ("angle", "speed", "goal", "load", "inertia", "reached", "after")


@dataclass(frozen=True)
class Crew:
    """Servos of one model, or of one kind on shared supplies.

    Parameters
    ----------
    model : Model
        Of the first of them.
    which : ndarray of int64
        Their numbers among all.
    parameters : mapping
        Parameters that differ among them.
    bus : list of tuple (Supply, lanes)
    watched : bool
        Whether the least voltages of supplies are kept.
    """

    model: Model
    which: Indices
    parameters: Mapping[str, Any] = field(default_factory=dict)
    bus: Sequence[tuple[Supply, list[int]]] = ()
    watched: bool = False

    def simulator(self) -> VectorSimulator:
        """Return a simulator of them."""
        return VectorSimulator(self.model, len(self.which), parameters=self.parameters, bus=list(self.bus) or None,
                               threads=1, watch_supply=self.watched)

    def changed(self, change: Change) -> Crew:
        """Return them with other numbers."""
        numbers, (own, columns) = dict(self.parameters), self.part(change)
        for name, column in columns.items():
            whole = np.full(len(self.which), numbers.get(name, self.model.servo.get(name)), object)
            whole[own] = column
            numbers[name] = np.array(whole.tolist())
        return replace(self, parameters=numbers, bus=self._on(change.bus) or self.bus)

    def part(self, change: Change) -> tuple[Indices, dict[str, NDArray[Any]]]:
        """Return lanes of which numbers change, and their columns."""
        own = np.flatnonzero(np.isin(self.which, change.which))
        at = [change.which.index(k) for k in self.which[own].tolist()]
        return own, {name: column[at] for name, column in change.columns.items()} if at else {}

    def _on(self, bus: Sequence[tuple[Supply, list[int]]]) -> list[tuple[Supply, list[int]]]:
        places = {k: n for n, k in enumerate(self.which.tolist())}
        return [(supply, [places[k] for k in own]) for supply, own in bus] if self.bus else []


class Change(NamedTuple):
    """Other numbers of servos: of `which` of all, columns by dotted name; supplies with the servos on each, if any."""

    which: list[int]
    columns: Mapping[str, NDArray[Any]]
    bus: Sequence[tuple[Supply, list[int]]]


def crews_of(joints: Sequence[Joint], bus: Any, watched: bool) -> list[Crew]:
    """Return all servos as crews, whose supplies may be watched.

    Raises
    ------
    InputError
        If `bus` is no supply, names a joint without a servo or one twice, or has servos of several kinds.
    """
    buses = buses_of(joints, bus)
    shared = [k for _, own in buses for k in own]
    crews = [_sharing(joints, buses)] if buses else []
    alone = [k for k in range(len(joints)) if k not in shared]
    while alone:
        first = joints[alone[0]].mount.model
        own = [k for k in alone if _alike(joints[k].mount.model, first)]
        crews.append(Crew(first, np.array(own)))
        alone = [k for k in alone if k not in own]
    return [replace(crew, watched=watched) for crew in crews]


def _alike(a: Model, b: Model) -> bool:
    return a is b or (type(a) is type(b) and a.servo == b.servo)


def buses_of(joints: Sequence[Joint], bus: Any) -> list[tuple[Supply, list[int]]]:
    """Return supplies with the numbers of the servos on each."""
    if bus is None:
        return []
    names = [joint.name for joint in joints]
    given = [(bus, names)] if isinstance(bus, Supply) else bus
    if not isinstance(given, Sequence) or not all(isinstance(one, Sequence) and len(one) == 2 for one in given):
        raise InputError("bus", got=bus, allowed="a Supply that all servos share, or a list of (Supply, joints)")
    found, seen = list[tuple[Supply, list[int]]](), set[str]()
    for supply, some in given:
        for name in some:
            if name not in names:
                raise UnknownNameError("joint with a servo", name, names)
            if name in seen:
                raise InputError(f"bus of joint {name}", got="two", allowed="one supply at most")
            seen.add(name)
        found.append((supply, [names.index(name) for name in some]))
    return found


def _sharing(joints: Sequence[Joint], buses: list[tuple[Supply, list[int]]]) -> Crew:
    """Return the servos on buses, which have to be of one kind, with what differs among them."""
    which = [k for _, own in buses for k in own]
    models = [joints[k].mount.model for k in which]
    first = models[0]
    for k, model in zip(which, models, strict=True):
        if type(model) is not type(first):
            raise InputError(f"servo of joint {joints[k].name} on a bus", got=type(model).__name__,
                             allowed=f"{type(first).__name__}, as joint {joints[which[0]].name}: servos on shared "
                             "supplies are of one kind")
    alike = of_one_form(models)
    parameters = {name: values for name, values in differing(alike, [joints[k].name for k in which]).items()
                  if name not in OF_THE_BUS}
    places = {k: n for n, k in enumerate(which)}
    return Crew(alike[0], np.array(which), parameters, [(supply, [places[k] for k in own]) for supply, own in buses])


class Berth:
    """A crew in one of MuJoCo's data: its simulator, and the words by which compiled code advances it."""

    def __init__(self, crew: Crew) -> None:
        self.crew, self.sims = crew, crew.simulator()
        self.kind = "pulse_width" if is_pulsed(crew.model) else "command_angle"
        count = len(crew.which)
        self.entry: CEntry = self.sims.c_entry()
        self._arrays = {name: np.zeros(count) for name in _GIVEN}
        self._status, own = np.zeros(count, np.int8), self._arrays
        self.tick = self.entry.tick(
            0.0, **{self.kind: own["goal"]}, external_torque=own["load"], set_output_angle=own["angle"],
            set_output_speed=own["speed"], set_load_inertia=own["inertia"], output_angle=own["reached"],
            output_speed=own["after"], armature_current=np.zeros(count), status=self._status)
        self._look = type(self.tick).armature_current.offset
        self.words = np.zeros(len(GROUP), np.int64)
        at = ctypes.addressof(self.tick)
        values = {"advance": self.entry.address, "tick": at, "duration": at + type(self.tick).duration.offset,
                  "look": at + self._look, "lanes": count, "which": crew.which.ctypes.data,
                  **{name: array.ctypes.data for name, array in own.items()}, "status": self._status.ctypes.data,
                  "seen": self.entry.seen.ctypes.data}
        self.words[:] = [values.get(name, 0) for name in GROUP]
        self.refresh()

    def refresh(self) -> None:
        """Find the memories where they are after numbers of the servos have changed."""
        self.pieces = self.entry.memory()
        self._pieces = np.array(self.pieces, np.int64)
        self.words[[GROUP.index("pieces"), GROUP.index("count")]] = self._pieces.ctypes.data, len(self.pieces)

    def change(self, change: Change) -> None:
        """Take other numbers of the servos.

        Raises
        ------
        InputError
            Or one of its kinds, if one is not possible; names the lane.
        """
        after, (own, columns) = self.crew.changed(change), self.crew.part(change)
        bus = list(after.bus) if change.bus and after.bus else None
        if columns or bus is not None:
            self.sims.set(parameters=columns or None, lanes=own if bus is None else None, bus=bus)
            self.crew = after
            self.refresh()

    @property
    def size(self) -> int:
        """Words that the memories of the crew take."""
        return sum(piece.rows * (-(-piece.bytes // 8)) for piece in self.pieces)

    def reset(self, angle: Array, goal: Array) -> None:
        """Let the servos begin anew, at rest at these angles [rad] under these commands."""
        own = goal[self.crew.which]
        goals = {"pulse_width": own} if self.kind == "pulse_width" else {"command_angle": own}
        self.sims.reset(output_angle=angle[self.crew.which], **goals)


class Instance:
    """All servos of a robot in one of MuJoCo's data.

    Parameters
    ----------
    address : int
        Of the data.
    crews : sequence of Crew
    joints : sequence of Joint
    dofs : int
        Of the model.
    head : int
        Words of a block before the memories.
    """

    def __init__(self, address: int, crews: Sequence[Crew], joints: Sequence[Joint], dofs: int, head: int,
                 serial: int) -> None:
        count = len(joints)
        self.address, self._joints = address, joints
        self.berths = [Berth(crew) for crew in crews]
        self.size = sum(berth.size for berth in self.berths)
        self.block = np.zeros(head + 2 * self.size)
        self.record_words = np.zeros(len(RECORD), np.int64)
        self.rows = np.zeros((0, 0))
        self.books = np.zeros(len(BOOKS) + count + 2 * dofs)
        behind = (2 * count + 1) * dofs + count * count
        self._room = np.zeros(behind + len(ROOM) * count)
        for i, joint in enumerate(joints):
            self._room[i * dofs + joint.speed_at] = 1.0
        self.room = self._room[behind:].reshape(len(ROOM), count)
        self.room[-1] = np.nan
        self._groups = np.array([berth.words.ctypes.data for berth in self.berths], np.int64)
        self.words = np.zeros(len(INSTANCE), np.int64)
        values = {"data": address, "block": self.block.ctypes.data, "room": self._room.ctypes.data,
                  "record": self.record_words.ctypes.data,
                  "groups": self._groups.ctypes.data, "count": len(self.berths), "serial": serial,
                  "books": self.books.ctypes.data}
        self.words[:] = [values.get(name, 0) for name in INSTANCE]
        self._begin = [berth.sims.save() for berth in self.berths]
        self._start = self._fresh()
        if self._start is not None:
            fresh, angles = self._start
            at = INSTANCE.index("fresh")
            self.words[at:at + 3] = fresh.ctypes.data, angles.ctypes.data, len(angles)

    def _fresh(self) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
        """Return what servos at rest remember, and which of these words are angles of which servo.

        None where that is not all: where the command counts too, or what is remembered is more than the angle.
        """
        count = len(self._joints)
        first, other = (self._within(size * np.arange(1.0, count + 1.0)) for size in (1e-3, 2e-3))
        words = [self._rested(angle, self._goals(goal))
                 for angle, goal in ((first, first), (first, other), (other, first))]
        differ = np.flatnonzero(words[0] != words[2])
        numbers = [some.view(np.float64)[differ] for some in (words[0], words[2])]
        servo = np.array([int(np.argmin(np.abs(first - value))) for value in numbers[0]], np.int64)
        told = np.array_equal(numbers[0], first[servo]) and np.array_equal(numbers[1], other[servo])
        if not np.array_equal(words[0], words[1]) or not told or len(np.unique(first)) < count:
            return None
        return words[0], np.ascontiguousarray(np.stack([differ, servo], axis=1))

    def _within(self, angle: Array) -> Array:
        """Return angles moved into the servos' travel and commands."""
        low, high = np.full(len(angle), -np.inf), np.full(len(angle), np.inf)
        for berth in self.berths:
            which = berth.crew.which
            told_angles = [] if berth.crew.model.endless else [berth.entry.commands(berth.kind)]
            for ends in (berth.entry.travel(), *told_angles):
                low[which], high[which] = np.maximum(low[which], ends[0]), np.minimum(high[which], ends[1])
        inside = np.where(np.isfinite(low), low, 0.0) + angle
        return np.asarray(np.minimum(inside, high))

    def _goals(self, angle: Array) -> Array:
        """Return commands that differ as angles do: the angles, or near what stops a servo that turns endlessly."""
        rest = np.array([told(joint.mount).rest for joint in self._joints])
        return np.where(np.isnan(rest), angle, rest + 1e-6 * angle)

    def _rested(self, angle: Array, goal: Array) -> NDArray[np.int64]:
        """Return the words of what servos remember that rest at these angles [rad] under these commands."""
        self.room[ROOM.index("angle")], self.room[ROOM.index("goal")] = angle, goal
        self.reset()
        return self.remembered()

    def remembered(self) -> NDArray[np.int64]:
        """Return the words of what servos remember now."""
        found = []
        for piece in (piece for berth in self.berths for piece in berth.pieces):
            for row in range(piece.rows):
                given = ctypes.string_at(piece.address + row * piece.stride, piece.bytes)
                found.append(np.frombuffer(given.ljust(8 * (-(-piece.bytes // 8)), b"\0"), np.int64))
        return np.concatenate(found)

    def reset(self) -> None:
        """Let all servos begin anew where compiled code has seen them."""
        angle, goal = self.room[ROOM.index("angle")], self.room[ROOM.index("goal")]
        for berth, begin in zip(self.berths, self._begin, strict=True):
            berth.sims.restore(begin)  # noise begins anew too
            berth.reset(angle, goal)
        self.record_words[RECORD.index("used")] = 0

    def change(self, change: Change) -> None:
        """Take other numbers of servos, which begin anew.

        Raises
        ------
        InputError
            If one is not possible, or needs more memory than there is.
        """
        for k, (berth, begin) in enumerate(zip(self.berths, self._begin, strict=True)):
            berth.change(change)
            berth.sims.restore(begin)  # noise begins anew too
            self._begin[k] = berth.sims.save()
        if sum(berth.size for berth in self.berths) != self.size:
            raise InputError("numbers of servos", got="some by which they remember more, as with play that they have"
                             " not had", allowed="a new ServoDrive for these")
        at = INSTANCE.index("fresh")
        self.words[at:at + 3], self._start = 0, None  # what they remember at rest is found when they begin

    def keep(self, row: int, capacity: int) -> None:
        """Keep rows of so many numbers of what shows, as many as there were and up to `capacity`; 0: none."""
        rows = np.zeros((capacity, max(row, 1)))
        used = int(self.record_words[RECORD.index("used")]) if row else 0
        rows[:used] = self.rows[:used] if used else 0.0
        self.rows = rows
        self.record_words[:] = [row, capacity, used, rows.ctypes.data]


# --- The servos in each of MuJoCo's data, and what compiled code asks Python about them -------------------------------

_MOST = 4096  # of MuJoCo's data at once
_FIRST_ROWS = 4096  # of a record
_SERIALS = 2**40  # ticks of servos in one of them
_ASK = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


def goals_in(block: NDArray[np.float64], servos: int) -> NDArray[np.float64]:
    """Return where a block has goals, and whether they were given: a view, shape (2, servos)."""
    first = len(BLOCK) + OF_EACH.index("goal") * servos
    return block[first:first + 2 * servos].reshape(2, servos)


class Harbour:
    """Servos by the addresses of MuJoCo's data that they are in.

    Parameters
    ----------
    joints : sequence of Joint
    crews : sequence of Crew
    dofs : int
        Of the model.

    Attributes
    ----------
    first : Instance
        Servos that are in no data yet.
    table : ndarray of int64
        How many there are, then addresses of data and of words, for compiled code.
    asked : ctypes function
        Function that compiled code calls.
    error : Exception or None
        Exception that could not be raised there.
    """

    def __init__(self, joints: Sequence[Joint], crews: Sequence[Crew], dofs: int) -> None:
        self._joints, self._crews, self._dofs = joints, crews, dofs
        self.head = len(BLOCK) + len(OF_EACH) * len(joints) + dofs
        self.first = Instance(0, crews, joints, dofs, self.head, 0)
        self._spare: Instance | None = self.first
        self._found: dict[int, Instance] = {}
        self._known: dict[int, weakref.finalize[Any, Any]] = {}
        self._lock, self._made = threading.RLock(), 0
        self.table = np.zeros(1 + 2 * _MOST, np.int64)
        self.asked = _ASK(self._ask)
        self.error: Exception | None = None

    def of(self, data: Any) -> Instance:
        """Return the servos in some data, new ones where another had its place in memory before."""
        address = int(data._address)
        if address not in self._known:
            with self._lock:
                instance = self._found.get(address) or self._new(address)
                goals_in(instance.block, len(self._joints))[:] = 0.0
                self._known[address] = weakref.finalize(data, self._forget, address)
                self._known[address].atexit = False
        return self._found[address]

    def change(self, change: Change) -> None:
        """Take other numbers of servos, in all data.

        Raises
        ------
        InputError
            If one is not possible.
        """
        with self._lock:
            for instance in {id(one): one for one in (self.first, *self._found.values())}.values():
                instance.change(change)
            self._crews = [berth.crew for berth in self.first.berths]

    def known(self, data: Any) -> Instance | None:
        """Return the servos in some data that was asked for before."""
        address = getattr(data, "_address", None)
        return self._found[address] if address in self._known else None

    def _ask(self, what: int, first: int, second: int) -> int:
        """Answer compiled code, in whatever thread it runs; an error is kept until it can be raised."""
        try:
            with self._lock:
                if what == ASK_NEW:
                    return int((self._found.get(second) or self._new(second)).words.ctypes.data)
                instance = self._found[first]
                if what == ASK_RESET:
                    instance.reset()
                else:
                    words = dict(zip(RECORD, instance.record_words.tolist(), strict=True))
                    instance.keep(words["row"], 2 * max(words["capacity"], _FIRST_ROWS // 2))
                return 1
        except Exception as error:
            self.error = error
            return 0

    def _new(self, address: int) -> Instance:
        count = len(self._found)
        if count == _MOST:
            raise InputError("data with servos", got=count + 1, allowed=f"up to {_MOST} at once: make a new ServoDrive")
        instance, self._spare = self._spare, None
        if instance is None:
            instance = Instance(address, self._crews, self._joints, self._dofs, self.head, 0)
        self._made += 1
        instance.address = address
        instance.words[INSTANCE.index("data")] = address
        instance.words[INSTANCE.index("serial")] = self._made * _SERIALS
        self._found[address] = instance
        self.table[1 + 2 * count:3 + 2 * count] = address, instance.words.ctypes.data
        self.table[0] = count + 1
        return instance

    def _forget(self, address: int) -> None:
        """Give up the servos in data that is no more."""
        with self._lock:
            self._known.pop(address, None)
            if self._found.pop(address, None) is None:
                return
            count = len(self._found)
            rows = self.table[1:].reshape(-1, 2)
            k = int(np.argmax(rows[:count + 1, 0] == address))
            rows[k] = rows[count]
            self.table[0] = count


# --- Servos at the joints of a model for compiled code, and the model's part of them ----------------------------------

Arrays = dict[str, NDArray[Any]]


def longest_tick(joints: Sequence[Joint]) -> tuple[float, str]:
    """Return the shortest frame of all servos [s], inf where none has frames, and the joint of its servo."""
    return min((float(joint.mount.model.value_or("electronics.frame_period", math.inf)), joint.name)
               for joint in joints)


def check_options(mujoco: Any, model: Any, joints: Sequence[Joint]) -> None:
    """Raise InputError where MuJoCo's options do not go with the servos."""
    longest, who = longest_tick(joints)
    if model.opt.timestep > longest:
        raise InputError("timestep of the model", got=float(model.opt.timestep),
                         allowed=f"at most a frame of the servo at joint {who}, {longest:g} s")
    if model.opt.enableflags & int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0)):
        raise InputError("option sleep of the model", got="enabled", allowed="disabled: servos do not sleep")


def maps_of(model: Any, joints: Sequence[Joint], controls: Mapping[str, CommandMap] | None) -> list[CommandMap]:
    """Return what the control of each joint's actuator asks of it: what it means itself unless another map is given.

    Raises
    ------
    UnknownNameError, InputError
        If a joint has no servo or no actuator, what is given is no map, or a control range is no angle.
    """
    given, names = dict(controls or {}), [joint.name for joint in joints]
    for name, one in given.items():
        if name not in names:
            raise UnknownNameError("joint with a servo", name, names)
        if not isinstance(one, CommandMap):
            raise InputError(f"control of joint {name}", got=one, allowed="a CommandMap")
        if joints[names.index(name)].actuator < 0:
            raise InputError(f"control of joint {name}", got=str(one), allowed="nothing: it has no actuator")
    return [given.get(joint.name) or own_map(model, joint) for joint in joints]


def arrays_of(joints: Sequence[Joint], berths: Sequence[Berth], maps: Sequence[CommandMap]) -> Arrays:
    """Return the arrays of `joints_layout.ARRAYS`, for all servos."""
    arrays: Arrays = {name: np.zeros(len(joints), np.int64 if name.endswith("_at") else np.float64) for name in ARRAYS}
    for k, (joint, one) in enumerate(zip(joints, maps, strict=True)):
        how = told(joint.mount)
        own = {"angle_at": joint.angle_at, "speed_at": joint.speed_at, "command_at": joint.command_at,
               "gain": joint.mount.gain, "zero": joint.mount.zero, "control_scale": one.scale,
               "control_offset": one.offset, "control_low": one.low, "control_high": one.high, "told_gain": how.gain,
               "told_zero": how.zero, "rest": how.rest}
        for name, value in own.items():
            arrays[name][k] = value
    put_numbers(arrays, berths)
    return arrays


def put_numbers(arrays: Arrays, berths: Sequence[Berth]) -> None:
    """Put what follows from the numbers of servos into the arrays of all."""
    for berth in berths:
        which = berth.crew.which
        arrays["lower"][which], arrays["upper"][which] = berth.entry.travel()
        arrays["low"][which], arrays["high"][which] = berth.entry.commands(berth.kind)
        arrays["armature"][which] = berth.entry.own_inertia() / arrays["gain"][which] ** 2


def put_into_model(mujoco: Any, model: Any, joints: Sequence[Joint], armature: NDArray[np.float64]) -> None:
    """Put rotors and gears into MuJoCo's model, and silence the actuators that servos replace."""
    for joint, own in zip(joints, armature.tolist(), strict=True):
        model.dof_armature[joint.speed_at] = own
        if joint.actuator >= 0:
            silence(model, joint.actuator)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def words_of(model: Any, joints: Sequence[Joint], arrays: Arrays, at: Places, more: Mapping[str, int],
             asked: Any) -> NDArray[np.int64]:
    """Return the words of `joints_layout.DRIVE`, of which `more` has some; `asked` is what compiled code may call."""
    own = [joint.actuator for joint in joints if joint.actuator >= 0]
    values = {
        "servos": len(joints), "dofs": model.nv, "coordinates": model.nq, "wide": int(at.wide), "bodies": model.nbody,
        "timestep": at.timestep, "integrator": at.integrator, **at.data, **at.functions, "slot": at.slot,
        "others": int(len(model.actuator_trntype) > len(own)),
        **{name: array.ctypes.data for name, array in arrays.items()},
        "longest": int(np.float64(longest_tick(joints)[0]).view(np.int64)),
        "ask": ctypes.cast(asked, ctypes.c_void_p).value or 0, **more}
    return np.array([values[name] for name in DRIVE], np.int64)


# --- The energies of the last row of a record: its tick ends where MuJoCo's data stand now ----------------------------

_SAME = 1e-6  # of a tick: within it one instant is another
_WORK = KEPT.index("joint_work")
_COPIED = ("qpos", "qvel", "mocap_pos", "mocap_quat")


def close_books(model: Any, data: Any, instance: Instance, speed_at: Sequence[int], rows: NDArray[np.float64]) -> None:
    """Complete the last row; compiled code has completed the others, each at the beginning of the next tick.

    Parameters
    ----------
    model, data : MjModel, MjData
    instance : Instance
    speed_at : sequence of int
        Places of the joints in qvel.
    rows : ndarray, shape (n, numbers)
        Of the record, changed in place. Where the data have gone elsewhere since, the last row stays nan.
    """
    if not len(rows):
        return
    books = dict(zip(BOOKS, instance.books.tolist(), strict=False))
    n, dofs = len(speed_at), int(model.nv)
    works, speed, force = np.split(instance.books[len(BOOKS):], [n, n + dofs])
    if books["kept"] and abs(data.time - rows[-1, 0]) <= _SAME * books["tick"]:
        mean = 0.5 * (speed + data.qvel) * books["tick"]
        energy, balanced = _energies(model, data)
        torque = rows[-1, _of_each(rows, n, KEPT.index("joint_torque"))]
        rows[-1, _of_each(rows, n, _WORK)] = works + torque * mean[list(speed_at)]
        nowhere = max(books["nowhere"], balanced - books["first"] - books["work"] - float(force @ mean))
        rows[-1, 1:len(ROW)] = energy, nowhere
    if model.nmocap:
        rows[:, ROW.index("energy_from_nowhere")] = math.nan


def _of_each(rows: NDArray[np.float64], servos: int, signal: int) -> NDArray[np.int64]:
    """Return the columns of a signal of all servos."""
    return np.asarray(len(ROW) + signal + (rows.shape[1] - len(ROW)) // servos * np.arange(servos))


def _energies(model: Any, data: Any) -> tuple[float, float]:
    """Return kinetic and potential energy [J] of a state, and what of it counts in the balance of compiled code."""
    mujoco = load_mujoco()
    scratch = mujoco.MjData(model)
    for name in _COPIED:
        getattr(scratch, name)[:] = getattr(data, name)
    mujoco.mj_fwdPosition(model, scratch)
    mujoco.mj_fwdVelocity(model, scratch)
    mujoco.mj_energyPos(model, scratch)
    mujoco.mj_energyVel(model, scratch)
    energy = float(scratch.energy.sum())
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        return energy, energy
    power = float((scratch.qfrc_spring - scratch.qfrc_bias) @ scratch.qvel)
    return energy, energy + 0.5 * model.opt.timestep * power
