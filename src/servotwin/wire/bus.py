"""`Bus`: twins behind the IDs of a wire, fed with bytes and led on in simulated time."""

from __future__ import annotations

import bisect
import random
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, SimulationError, UnknownNameError
from servotwin.loads import as_load
from servotwin.models import DigitalServo, Model
from servotwin.parameters import Servo, load_servo
from servotwin.parameters.groups import Supply
from servotwin.parameters.registers.dynamixel_x import family_of as family_of_x
from servotwin.parameters.registers.feetech import family_of as family_of_sts
from servotwin.parameters.registers.table import family_label
from servotwin.text import load_toml
from servotwin.wire.device import ready
from servotwin.wire.dynamixel_talk import DynamixelTalk
from servotwin.wire.feetech_talk import FeetechTalk
from servotwin.wire.sts import Sts
from servotwin.wire.talk import BITS, Talk
from servotwin.wire.traffic import Traffic
from servotwin.wire.twins import Crew, Seen
from servotwin.wire.x_servo import X

if TYPE_CHECKING:
    from servotwin.wire.service import Service


# --- Faults of a wire -------------------------------------------------------------------------------------------------

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


# --- `Bus`: twins behind the IDs of a wire, fed with bytes and led on in simulated time -------------------------------

_MOST_ID = {"feetech": 253, "dynamixel-2": 252}
_STALE = 0.02  # s without a byte after which an unfinished packet is forgotten (assumed)
_NEAR = 0.03  # share by which the client's rate may be off (assumed)
_LOCKS = ("keep", "drop")
_ROUNDING = 1e-12  # s


@dataclass
class Counts:
    """The traffic of a bus so far.

    Parameters
    ----------
    packets, answers, bad : int
        Packets that came whole, packets that went out, packets with a bad checksum.
    stale : int
        Packets that were never finished.
    """

    packets: int = 0
    answers: int = 0
    bad: int = 0
    stale: int = 0
    said: list[str] = field(default_factory=list)


class Bus:
    """Servos on a wire: Feetech's STS and SMS, or Dynamixel's X with protocol 2.0.

    The twins stand on one supply and advance together, compiled. A packet sees the state of its arrival; an answer is
    through after the servo's return delay and the time of its bytes. The same bytes at the same times give the same
    bytes, in every run.

    Parameters
    ----------
    servos : mapping of int to DigitalServo, Servo or str
        By ID: models, servos, or catalog ids. All of one maker.
    supply : Supply, optional
        That all share; without one an ideal source for all servos of one voltage.
    angles : mapping of int to float, optional
        Where shafts rest at first [rad]; count 2048 is 0.
    loads : mapping of int to Load, optional
        Loads on the shafts.
    lock : {"keep", "drop"}
        Sources disagree on a register of the EEPROM that is written while Lock is 1: "keep" takes the value until
        power-off, "drop" passes it over. Feetech only.
    firmware : tuple of int, optional
        Version that the servos tell, 3.10 unless given; of Dynamixel's one number, 45.
    faults : Faults, optional
        Faults of the wire and its servos.
    seed : int
        Of all noise, of the twins and of the faults.

    Raises
    ------
    InputError
        Or one of its kinds, on bad input.

    Examples
    --------
    >>> import servotwin as st
    >>> bus = st.wire.Bus({1: "feetech-sts3215-12v"})
    >>> bus.write(bytes.fromhex("ffff010201fb"))  # ping
    >>> bus.advance(1e-3).hex()
    'ffff010200fc'
    """

    def __init__(self, servos: Mapping[int, Model | Servo | str], *, supply: Supply | None = None,
                 angles: Mapping[int, float] | None = None, loads: Mapping[int, Any] | None = None, lock: str = "keep",
                 firmware: tuple[int, ...] | None = None, faults: Faults | None = None, seed: int = 0,
                 body: Callable[..., Any] = Crew) -> None:
        if not isinstance(servos, Mapping) or not servos:
            raise InputError("servos of a Bus", got=servos, allowed="a mapping of IDs to servos")
        if lock not in _LOCKS:
            raise InputError("lock", got=lock, allowed=" or ".join(f'"{one}"' for one in _LOCKS))
        models = {id: _model(id, servo) for id, servo in servos.items()}
        self.protocol = _protocol(models)
        _check_ids(models, self.protocol)
        for what, given in (("angles", angles), ("loads", loads)):
            unknown = [id for id in given or {} if id not in models]
            if unknown:
                raise InputError(f"{what} of a Bus", got=unknown, allowed=f"IDs out of {sorted(models)}")
        self.counts, self.lock = Counts(), threading.RLock()
        self.time = 0.0
        self.rate: float | None = None  # bit/s at which the client talks; None: every servo hears it
        self.devices = self._devices(models, lock, firmware)
        of = (family_of_sts if self.protocol == "feetech" else family_of_x)
        made = ready(list(models.values()), [of(model.servo) for model in models.values()])
        self.crew = body(made, _supplies(made, supply), [float((angles or {}).get(id, 0.0)) for id in models],
                         [as_load((loads or {}).get(id)) for id in models], seed, self.say)
        self.ids = tuple(models)
        for id, device in zip(models, self.devices, strict=True):
            device.crew, device.clock = self.crew, self._now
            device.put_stored({"ID": id})
            device.power_up()
        self._talk: Talk[Any] = FeetechTalk() if self.protocol == "feetech" else DynamixelTalk()
        self.faults = faults if faults is not None else Faults(seed=seed)
        self._buffer, self._fed = bytearray(), 0.0
        self._out: list[tuple[float, int, bytes]] = []
        self._number = 0
        self._service: Service | None = None
        self._traffic: Traffic | None = None

    def _devices(self, models: Mapping[int, DigitalServo], lock: str, firmware: tuple[int, ...] | None) -> list[Any]:
        if self.protocol == "feetech":
            version = (3, 10) if firmware is None else firmware
            if len(version) != 2 or not all(0 <= one <= 255 for one in version):
                raise InputError("firmware", got=firmware, allowed="two numbers of 0 to 255, such as (3, 10)")
            return [Sts(k, model, self.say, firmware=(version[0], version[1]), lock=lock)
                    for k, model in enumerate(models.values())]
        number = 45 if firmware is None else firmware[0]
        return [X(k, model, self.say, firmware=number) for k, model in enumerate(models.values())]

    def _now(self) -> float:
        return self.time

    def __repr__(self) -> str:
        return f"Bus({self.protocol}, IDs {', '.join(str(one.id) for one in self.devices)})"

    def say(self, text: str) -> None:
        """Note a line on what is not computed; `counts.said` has the last ones."""
        self.counts.said = [*self.counts.said[-99:], text]

    # --- bytes --------------------------------------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        """Take bytes that arrive now."""
        if not data or self.faults.unplugged:
            return
        if self._buffer and self.time - self._fed > _STALE:
            self._buffer.clear()
            self.counts.stale += 1
        if self.faults.echo:
            self._send(self.time, bytes(data))
        self._fed = self.time
        self._buffer += data
        packets, bad = self._talk.split(self._buffer)
        self.counts.bad += bad
        for packet in packets:
            self.counts.packets += 1
            if self._traffic is not None:
                self._traffic.heard(packet)
            listening = [one for one in self.devices if self._hears(one)]
            if not listening:
                continue
            replies = self._talk.replies(packet, listening, BITS / (self.rate or self._rate(listening)))
            if self.faults.all:
                for reply in replies:
                    self.counts.answers += 1
                    for late, part in self.faults.on_answer(reply.data):
                        self._send(self.time + reply.after + late, part)
            else:
                self.counts.answers += len(replies)
                for reply in replies:
                    self._send(self.time + reply.after, reply.data)

    def _hears(self, one: Any) -> bool:
        if self.faults.absent and one.id in self.faults.absent:
            return False
        return self.rate is None or (one.baud is not None and abs(one.baud - self.rate) <= _NEAR * self.rate)

    @staticmethod
    def _rate(listening: Sequence[Any]) -> float:
        return float(next((one.baud for one in listening if one.baud), 1_000_000))

    def _send(self, time: float, data: bytes) -> None:
        self._number += 1
        bisect.insort(self._out, (time, self._number, data))

    # --- time ---------------------------------------------------------------------------------------------------------

    def advance(self, duration: float) -> bytes:
        """Advance by a time [s]; return the bytes that have come out of the wire since.

        Raises
        ------
        InputError
            If the time is none.
        SimulationError
            If a servo cannot continue.
        """
        if not 0.0 <= duration < 1e6:
            raise InputError("advance(duration)", got=duration, allowed="a number of seconds, at least 0")
        self.faults.at(self.time + duration, self)
        self.crew.advance(duration)
        self.time += duration
        if (failure := self.crew.failed()) is not None:
            raise SimulationError("SERVO", self.time, failure)
        return self._arrived() if self._out else b""

    def _arrived(self) -> bytes:
        count = bisect.bisect_right(self._out, self.time + _ROUNDING, key=lambda one: one[0])
        if not count:
            return b""
        made = b"".join(data for _, _, data in self._out[:count])
        del self._out[:count]
        return b"" if self.faults.unplugged else made

    @property
    def due(self) -> float | None:
        """When the next answer is through [s of simulated time]; None: none waits."""
        return self._out[0][0] if self._out else None

    def due_within(self, span: float) -> float | None:
        """Return when the last of those answers is through that are, within a span [s], after the next one."""
        if not self._out:
            return None
        last = self._out[0][0] + span
        return max(time for time, _, _ in self._out if time <= last)

    def ask(self, data: bytes, patience: float = 0.05) -> bytes:
        """Send bytes, advance until nothing is left to be answered, at most for a time [s]; return what came."""
        self.write(data)
        end, found = self.time + patience, self.advance(0.0)
        while self.due is not None and self.due <= end:
            found += self.advance(max(self.due - self.time, 0.0))
        return found

    # --- servos -------------------------------------------------------------------------------------------------------

    def device(self, id: int) -> Any:
        """Return the servo that had an ID when the bus was made."""
        if id not in self.ids:
            raise InputError("ID", got=id, allowed=" or ".join(str(one) for one in self.ids))
        return self.devices[self.ids.index(id)]

    def seen(self, id: int) -> Seen:
        """Return what shows of the twin behind an ID, in SI: the truth beside what the registers say."""
        with self.lock:
            return self.crew.seen(self.device(id).lane)  # type: ignore[no-any-return]

    def registers(self, id: int) -> dict[str, int]:
        """Return what all registers of a servo hold, by name."""
        device = self.device(id)
        with self.lock:
            device.read(0, 147)
            return device.table.values()  # type: ignore[no-any-return]

    def hand(self, id: int, angle: float | None) -> None:
        """Hold a limp servo's shaft at an angle [rad], as a hand does; None lets go."""
        with self.lock:
            self.crew.hand(self.device(id).lane, angle)

    def power_cycle(self, id: int | None = None) -> None:
        """Take the supply from a servo, or from all, and give it back: what is not stored is lost."""
        with self.lock:
            for device in self.devices if id is None else [self.device(id)]:
                device.power_up()
            self._buffer.clear()

    def kept(self) -> dict[str, dict[str, int]]:
        """Return what outlives power-off, by ID at the beginning and register."""
        return {str(id): device.table.kept() for id, device in zip(self.ids, self.devices, strict=True)}

    @property
    def to_keep(self) -> bool:
        """Whether something stored has changed since this was set to False."""
        return any(device.changed for device in self.devices)

    @to_keep.setter
    def to_keep(self, changed: bool) -> None:
        for device in self.devices:
            device.changed = changed

    def take_kept(self, kept: Mapping[str, Mapping[str, int]]) -> None:
        """Put back what `kept` returned, and switch the servos on anew."""
        for id, device in zip(self.ids, self.devices, strict=True):
            if str(id) in kept:
                device.put_stored(kept[str(id)])
        self.power_cycle()

    def record(self, folder: str | Path) -> Traffic:
        """Write logs of all servos from now on, a row where a program asks for a position, and the truth beside.

        Returns
        -------
        Traffic
            Its `close` ends them.
        """
        self._traffic = Traffic(folder, self)
        return self._traffic

    # --- a port of it -------------------------------------------------------------------------------------------------

    def open(self, **options: Any) -> str:
        """Serve the bus at a pseudo-terminal in wall-clock time, in a thread, and return the port's name.

        Parameters
        ----------
        **options
            Of `servotwin.wire.Service`: `tcp`, `link`.
        """
        from servotwin.wire.service import Service

        if self._service is None:
            self._service = Service(self, **options)
            self._service.start()
        return self._service.port

    @property
    def service(self) -> Service | None:
        """The server of the port, with its `timing`; None while it is not open."""
        return self._service

    def close(self) -> None:
        """End the port."""
        if self._service is not None:
            service, self._service = self._service, None
            service.stop()

    def __enter__(self) -> Bus:
        """Return the bus."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the port."""
        self.close()


def _supplies(models: Sequence[DigitalServo], supply: Supply | None) -> list[tuple[Supply, list[int]]]:
    """Return supplies with the places of the servos on each: the one that is given, else one a voltage."""
    if supply is not None:
        return [(supply, list(range(len(models))))]
    found: dict[float, list[int]] = {}
    for k, model in enumerate(models):
        found.setdefault(model.servo.supply.open_circuit_voltage or 12.0, []).append(k)
    return [(Supply(open_circuit_voltage=volts), places) for volts, places in found.items()]


def _model(id: Any, given: Any) -> DigitalServo:
    if isinstance(given, str):
        given = load_servo(given)
    if isinstance(given, Servo):
        if family_label(given) is None:
            raise InputError(f"servo {given.name} of ID {id}", got="no registers",
                             allowed="a bus servo: Feetech STS or Dynamixel X")
        given = DigitalServo(given)
    if not isinstance(given, DigitalServo):
        raise InputError(f"servo of ID {id}", got=given, allowed="a DigitalServo with registers, a Servo or its id")
    return given


def _protocol(models: Mapping[int, DigitalServo]) -> str:
    labels = {id: family_label(model.servo) for id, model in models.items()}
    known = {"Feetech STS": "feetech", "Dynamixel X": "dynamixel-2"}
    for id, label in labels.items():
        if label not in known:
            raise InputError(f"servo {models[id].servo.name} of ID {id}", got=label or "no registers",
                             allowed=" or ".join(known))
    if len(set(labels.values())) > 1:
        raise InputError("servos of a Bus", got=" and ".join(sorted(str(one) for one in set(labels.values()))),
                         allowed="one maker's on a wire")
    return known[str(next(iter(labels.values())))]


def _check_ids(models: Mapping[int, DigitalServo], protocol: str) -> None:
    most = _MOST_ID[protocol]
    for id in models:
        if isinstance(id, bool) or not isinstance(id, int) or not 0 <= id <= most:
            raise InputError("ID of a servo", got=id, allowed=f"a whole number from 0 to {most}")
