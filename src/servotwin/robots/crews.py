"""Which servos of a robot run together, and their simulators in one of MuJoCo's data."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.datasheet.turning import is_pulsed
from servotwin.errors import InputError, UnknownNameError
from servotwin.models import Model
from servotwin.parameters.groups import Supply
from servotwin.robots.joints_layout import BOOKS, GROUP, INSTANCE, RECORD, ROOM
from servotwin.robots.mount import Joint
from servotwin.robots.told import told
from servotwin.robots.unlike import OF_THE_BUS, differing, of_one_form
from servotwin.simulation import VectorSimulator
from servotwin.simulation.lanes.c_entry import CEntry

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
        What differs among them.
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


def crews_of(joints: Sequence[Joint], bus: Any, watched: bool) -> list[Crew]:
    """Return all servos as crews, whose supplies may be watched.

    Raises
    ------
    InputError
        If `bus` is no supply, names a joint without a servo or one twice, or has servos of several kinds.
    """
    buses = _buses(joints, bus)
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


def _buses(joints: Sequence[Joint], bus: Any) -> list[tuple[Supply, list[int]]]:
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
    """A crew in one of MuJoCo's data: its simulator, and the words by which compiled code lets it go on."""

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
        self.pieces = self.entry.memory()
        self._pieces = np.array(self.pieces, np.int64)
        self.words = np.zeros(len(GROUP), np.int64)
        at = ctypes.addressof(self.tick)
        values = {"advance": self.entry.address, "tick": at, "duration": at + type(self.tick).duration.offset,
                  "look": at + self._look, "lanes": count, "which": crew.which.ctypes.data,
                  **{name: array.ctypes.data for name, array in own.items()}, "status": self._status.ctypes.data,
                  "seen": self.entry.seen.ctypes.data, "pieces": self._pieces.ctypes.data, "count": len(self.pieces)}
        self.words[:] = [values[name] for name in GROUP]

    def refresh(self) -> None:
        """Find the memories where they are after numbers of the servos have changed."""
        self.pieces = self.entry.memory()
        self._pieces[:] = self.pieces

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

    def keep(self, row: int, capacity: int) -> None:
        """Keep rows of so many numbers of what shows, as many as there were and up to `capacity`; 0: none."""
        rows = np.zeros((capacity, max(row, 1)))
        used = int(self.record_words[RECORD.index("used")]) if row else 0
        rows[:used] = self.rows[:used] if used else 0.0
        self.rows = rows
        self.record_words[:] = [row, capacity, used, rows.ctypes.data]


