"""What is wrong with a wire: bytes that are lost or bent, late answers, an echo, servos that are not there."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, UnknownNameError
from servotwin.text import load_toml

if TYPE_CHECKING:
    from servotwin.wire.bus import Bus

KINDS = {
    "lost": "a byte of an answer is lost, by `rate` of the answers",
    "bent": "a bit of an answer is another, by `rate`",
    "late": "an answer comes `seconds` later, by `rate`",
    "echo": "what is written comes back",
    "absent": "the servo of `id` does not answer",
    "duplicate": "the servo of `id` answers to the ID `to` too",
    "firmware": "the servo of `id` tells `version`, such as [3, 9]",
    "overload": "the status of the servo of `id` has its overload bit",
    "brown-out": "the servo of `id`, or all, begin anew at `at`",
    "unplugged": "the wire is cut",
}


@dataclass(frozen=True)
class Fault:
    """Something that is wrong.

    Parameters
    ----------
    kind : str
        One of `servotwin.wire.KINDS`.
    at, until : float
        When it begins and ends [s of simulated time].
    id : int, optional
    rate : float
        Share of the answers.
    seconds : float
        How late [s].
    to : int, optional
    version : tuple of int
    """

    kind: str
    at: float = 0.0
    until: float = float("inf")
    id: int | None = None
    rate: float = 1.0
    seconds: float = 0.05
    to: int | None = None
    version: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in KINDS:
            raise UnknownNameError("fault", str(self.kind), KINDS)
        for name in ("at", "until", "rate", "seconds"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise InputError(f"{name} of the fault {self.kind!r}", got=value, allowed="a number")
        for name, given in (("id", self.id), ("to", self.to), *(("version", part) for part in self.version)):
            if given is not None and type(given) is not int:
                raise InputError(f"{name} of the fault {self.kind!r}", got=given, allowed="a whole number")
        for name, bad, allowed in (
                ("rate", not 0.0 <= self.rate <= 1.0, "0 to 1"),
                ("seconds", not 0.0 <= self.seconds <= 60.0, "0 to 60"),
                ("until", not self.until >= self.at >= 0.0, "not before `at`, which is at least 0"),
                ("id", self.id is None and self.kind in ("absent", "duplicate", "firmware", "overload"), "an ID"),
                ("to", self.to is None and self.kind == "duplicate", "an ID"),
                ("version", not self.version and self.kind == "firmware", "numbers, such as [3, 9]")):
            if bad:
                raise InputError(f"{name} of the fault {self.kind!r}", got=getattr(self, name), allowed=allowed)


class Faults:
    """All faults of a bus; drawn from a seed, so that every run has the same.

    Parameters
    ----------
    faults : sequence of Fault
    seed : int
    """

    def __init__(self, faults: Sequence[Fault] = (), seed: int = 0) -> None:
        self.all = list(faults)
        self._random = random.Random(seed)
        self._running: list[Fault] = []
        self._done: set[int] = set()
        self.absent: set[int] = set()
        self.echo = self.unplugged = False
        self._undo: dict[int, Any] = {}

    def add(self, kind: str, **numbers: Any) -> Fault:
        """Add a fault, which begins now unless `at` says when; return it."""
        made = Fault(kind, **numbers)
        self.all.append(made)
        return made

    def remove(self, fault: Fault) -> None:
        """End a fault."""
        self.all = [one for one in self.all if one is not fault]

    def at(self, time: float, bus: Bus) -> None:
        """Let begin and end what does by a time [s]."""
        if not self.all and not self._running:
            return
        running = [one for one in self.all if one.at <= time < one.until]
        for one in self._running:
            if not any(one is other for other in running):
                self._end(one, bus)
        for one in running:
            if not any(one is other for other in self._running):
                self._begin(one, bus)
        self._running = running
        self.absent = {one.id for one in running if one.kind == "absent" and one.id is not None}
        self.echo = any(one.kind == "echo" for one in running)
        self.unplugged = any(one.kind == "unplugged" for one in running)

    def _begin(self, one: Fault, bus: Bus) -> None:
        if one.kind == "brown-out":
            bus.power_cycle(one.id)
        elif one.kind in ("duplicate", "firmware", "overload"):
            assert_id(one, bus)
            device = bus.device(one.id or 0)
            if one.kind == "duplicate":
                device.alias = one.to
            elif one.kind == "overload":
                device.forced |= 32
            else:
                self._undo[id(one)] = device.version
                device.version = one.version

    def _end(self, one: Fault, bus: Bus) -> None:
        if one.kind not in ("duplicate", "firmware", "overload"):
            return
        device = bus.device(one.id or 0)
        if one.kind == "duplicate":
            device.alias = None
        elif one.kind == "overload":
            device.forced &= ~32
        else:
            device.version = self._undo.pop(id(one))

    def on_answer(self, data: bytes) -> list[tuple[float, bytes]]:
        """Return what becomes of an answer: pieces, and how late each is [s]."""
        late = 0.0
        for one in self._running:
            if one.kind not in ("lost", "bent", "late") or self._random.random() >= one.rate:
                continue
            if one.kind == "late":
                late += one.seconds
                continue
            place = self._random.randrange(len(data)) if data else 0
            if one.kind == "lost":
                data = data[:place] + data[place + 1:]
            elif data:
                bent = bytearray(data)
                bent[place] ^= 1 << self._random.randrange(8)
                data = bytes(bent)
        return [(late, data)]


def assert_id(one: Fault, bus: Bus) -> None:
    """Raise InputError where a fault names a servo that there is not."""
    if one.id not in bus.ids:
        raise InputError(f"id of the fault {one.kind!r}", got=one.id, allowed=f"one of {list(bus.ids)}")


def read_faults(path: str | Path, seed: int = 0) -> Faults:
    """Return the faults of a file: a table `[[fault]]` for each.

    Raises
    ------
    InputError
        Or one of its kinds, if there is something in it that is no fault.
    """
    try:
        found = load_toml(Path(path).read_text("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"{path}", got=str(error), allowed="a TOML file of [[fault]] tables") from None
    made, names = list[Fault](), tuple(Fault.__dataclass_fields__)
    tables = found.get("fault", [])
    if set(found) - {"fault"} or not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
        raise InputError(f"{path}", got=", ".join(found) or "nothing", allowed="[[fault]] tables")
    for one in tables:
        unknown = next((name for name in one if name not in names), None)
        if unknown is not None:
            raise UnknownNameError(f"{path}: key of a fault", unknown, names)
        if "kind" not in one:
            raise InputError(f"{path}: a fault", got=one, allowed="a kind")
        version = one.get("version", [])
        if not isinstance(version, list):
            raise InputError(f"{path}: version of the fault {one['kind']!r}", got=version, allowed="such as [3, 9]")
        made.append(Fault(**{**one, "version": tuple(version)}))
    return Faults(made, seed)
