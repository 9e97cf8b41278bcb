"""A servo behind an ID: registers that speak for a twin. The common part of both makers' servos."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import ClassVar

from servotwin.models import DigitalServo
from servotwin.parameters.registers.table import Family, Register, is_read_only, written
from servotwin.wire.twins import Crew, Seen

# --- The memory of a servo: bytes by address, and the registers that lie in them --------------------------------------

_MANY = 8  # bytes of a write: what more have touched is looked up each time


class ControlTable:
    """Registers as bytes, what is stored beside what is there now.

    Parameters
    ----------
    family : Family
    size : int
        Bytes.
    values : mapping of str to int
        Values of the registers at power-up; the others 0.
    """

    def __init__(self, family: Family, size: int, values: Mapping[str, int]) -> None:
        self.family, self.size = family, size
        self.registers: Mapping[str, Register] = family.registers
        self.bytes = bytearray(size)
        self.read_only = bytearray(size)
        self.eeprom = bytearray(size)
        self.named: list[tuple[str, ...]] = [() for _ in range(size)]
        for name, one in self.registers.items():
            places = range(one.address, one.address + one.size)
            for place in places:
                self.named[place] = (*self.named[place], name)
                self.read_only[place] |= is_read_only(name, one)
                self.eeprom[place] |= one.stored
        self._touched: dict[tuple[int, int], tuple[str, ...]] = {}
        for name, value in values.items():
            self[name] = value
        self.stored = bytearray(self.bytes)

    def __getitem__(self, name: str) -> int:
        """Return what a register holds."""
        one, memory = self.registers[name], self.bytes
        at = one.address
        if one.size == 1:
            return memory[at]
        if one.size == 2 and not one.signed:  # what a goal in every cycle asks for
            raw, sign = memory[at] | memory[at + 1] << 8, one.sign_bit
            return raw if sign is None or not raw >> sign & 1 else -(raw & ((1 << sign) - 1))
        return one.decode(memory[at:at + one.size])

    def __setitem__(self, name: str, value: int) -> None:
        """Put a value into a register; what does not fit is held at the nearest that does."""
        one = self.registers[name]
        bits = 8 * one.size
        if one.sign_bit is not None:
            most, least = (1 << one.sign_bit) - 1, 1 - (1 << one.sign_bit)
        elif one.signed:
            most, least = (1 << bits - 1) - 1, -(1 << bits - 1)
        else:
            most, least = (1 << bits) - 1, 0
        self.bytes[one.address:one.address + one.size] = one.encode(min(max(value, least), most))

    def get(self, name: str, otherwise: int = 0) -> int:
        """Return what a register holds, or something else where the model has none."""
        return self[name] if name in self.registers else otherwise

    def touched(self, address: int, count: int) -> tuple[str, ...]:
        """Return the registers that have one of some bytes, each once."""
        found = self._touched.get((address, count))
        if found is None:
            names = (name for some in self.named[address:address + count] for name in some)
            found = tuple(dict.fromkeys(names))
            if count <= _MANY:
                self._touched[address, count] = found
        return found

    def values(self) -> dict[str, int]:
        """Return what all registers hold."""
        return {name: self[name] for name in self.registers}

    def kept(self) -> dict[str, int]:
        """Return what outlives power-off, by name."""
        return {name: one.decode(self.stored[one.address:one.address + one.size])
                for name, one in self.registers.items() if one.stored and not one.reading}

    def keep(self, places: Iterable[int]) -> bool:
        """Let bytes of the EEPROM outlive power-off as they are; return whether one is another than before."""
        changed = False
        for place in places:
            if self.eeprom[place] and self.stored[place] != self.bytes[place]:
                self.stored[place] = self.bytes[place]
                changed = True
        return changed


# --- A servo behind an ID: registers that speak for a twin. The common part of both makers' servos --------------------

COUNT = 2.0 * math.pi / 4096.0  # rad
MIDDLE, TURN = 2048, 4096  # count at angle 0, counts a turn
LANDED = 1e-9  # rad between reference and goal: rounding
FAR = 1e4  # rad: no limit of goals; the bus keeps to those of the registers itself
_ABSENT: Mapping[str, float] = {  # numbers that say the same as nothing
    "speed_limit": 1e6, "acceleration_limit": 1e9, "trip_current": 1e6, "trip_temperature": 1e6, "undervoltage": 1e-3,
    "current_limit": 1e6, "overload_duty": 1e6, "duty_slew": 1e5, "integral_limit": 1e6}
_OWN = ("lower_goal", "upper_goal", "command_kind", "signal_timeout", "angle_quantum", "whole_counts")
# what the bus itself does, or what never changes


class Device:
    """A servo on the wire.

    Parameters
    ----------
    lane : int
        Its twin in the crew.
    model : DigitalServo
    family : Family
    say : callable
        Called with what is not computed, a line each time.
    version : tuple of int
        Of the firmware.
    """

    SIZE: ClassVar[int]
    BAUDS: ClassVar[Mapping[int, int]]

    def __init__(self, lane: int, model: DigitalServo, family: Family, say: Callable[[str], None],
                 version: tuple[int, ...]) -> None:
        self.lane, self.servo, self.family, self._version = lane, model.servo, family, version
        self.table = ControlTable(family, self.SIZE, {
            **{name: one.factory for name, one in family.registers.items() if not one.reading},
            **{name: value for name, value in written(family, model.servo).items()
               if not family.registers[name].reading},
            **self.fixed()})
        self.changed = False  # whether what is stored is another than when it was kept
        self.waiting: bytes | None = None  # what a REG WRITE left
        self.crew: Crew
        self.clock: Callable[[], float] = float  # s of simulated time
        self.powered_at = 0.0
        self.alias: int | None = None  # an ID beside its own, as a fault
        self.forced = 0  # bits of the status, as a fault
        self._say = say
        self._said = set[str]()
        self._id_at = family.registers["ID"].address
        self._settings = {name: tuple(one for one in family.settings if name in one.registers and one.name not in _OWN)
                          for name in family.registers}

    def fixed(self) -> dict[str, int]:
        """Return what the registers hold that are as they are: model and firmware."""
        raise NotImplementedError

    @property
    def version(self) -> tuple[int, ...]:
        """Of its firmware, as it tells it."""
        return self._version

    @version.setter
    def version(self, version: tuple[int, ...]) -> None:
        self._version = version
        for name, value in self.fixed().items():
            self.table[name] = value

    # --- what the bus asks --------------------------------------------------------------------------------------------

    @property
    def id(self) -> int:
        """Its number on the wire."""
        return self.table.bytes[self._id_at]

    def is_called(self, id: int) -> bool:
        """Return whether it answers to an ID."""
        return id in (self.id, self.alias)

    @property
    def baud(self) -> int | None:
        """Speed at which it listens [bit/s]; None: one that there is not."""
        return self.BAUDS.get(self.table["Baud_Rate"])

    @property
    def delay(self) -> float:
        """Time before an answer [s]."""
        return self.table["Return_Delay_Time"] * 2e-6

    @property
    def seen(self) -> Seen:
        """Signals of the twin."""
        return self.crew.seen(self.lane)

    @property
    def raw(self) -> int:
        """Count of the encoder, over several turns."""
        return math.floor(self.seen.angle / COUNT + 0.5) + MIDDLE

    # --- registers and twin -------------------------------------------------------------------------------------------

    def note(self, text: str) -> None:
        """Say something once."""
        if text not in self._said:
            self._said.add(text)
            self._say(f"servo {self.id}: {text}")

    def tune(self, *names: str) -> None:
        """Let the twin continue with what these registers hold."""
        made = {one.name: one for name in names for one in self._settings[name]}
        if not made:
            return
        raw, numbers = self.table.values(), dict[str, float | str]()
        for setting in made.values():
            value = setting.value(raw, self.servo)
            if value is None:
                if setting.name not in _ABSENT:
                    continue
                value = _ABSENT[setting.name]
            numbers[f"firmware.{setting.name}"] = value
        if numbers:
            self.crew.change(self.lane, numbers)

    def power_up(self) -> None:
        """Begin as after power-off: what is stored, and the RAM as it is then."""
        table = self.table
        for place in range(table.size):
            table.bytes[place] = table.stored[place] if table.eeprom[place] else 0
        for name, one in table.registers.items():
            if not one.stored and not one.reading:
                table[name] = one.factory
        for name, value in self.fixed().items():
            table[name] = value
        for name, source in self.family.copied.items():
            table[name] = table[source]
        self.waiting, self.powered_at = None, self.clock()
        self.begin()
        self.crew.restart(self.lane)
        self.tune(*table.registers)

    def begin(self) -> None:
        """Set what only this maker's servos have at power-up."""

    def put_stored(self, values: Mapping[str, int]) -> None:
        """Put what was kept into the EEPROM, before power-up."""
        table = self.table
        for name, value in values.items():
            if name in table.registers and table.registers[name].stored and not table.registers[name].reading:
                table[name] = value
                one = table.registers[name]
                table.keep(range(one.address, one.address + one.size))
        self.changed = False


def ready(models: Sequence[DigitalServo], families: Sequence[Family]) -> list[DigitalServo]:
    """Return models as they run behind a bus: with a number for every limit that a register may set later."""
    names = {one.name for family in families for one in family.settings if one.registers}
    made = list[DigitalServo]()
    for model, family in zip(models, families, strict=True):
        servo, changes = model.servo, dict[str, float | str]()
        for name, value in _ABSENT.items():
            has_it = any(other.servo.get(f"firmware.{name}") is not None for other in models)
            if (name in names or has_it) and servo.get(f"firmware.{name}") is None:
                changes[f"firmware.{name}"] = value
        if "current_limit" in names and servo.get("firmware.current_sense") is None:
            law = next((one.value for one in family.settings if one.name == "current_sense"), None)
            changes["firmware.current_sense"] = "motor" if law is None else str(law({"Operating_Mode": 5}, servo))
        changes |= {"firmware.lower_goal": -FAR, "firmware.upper_goal": FAR}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # limits that stand for none are beyond any servo's
            made.append(type(model)(servo.replace({**changes, "firmware.signal_timeout": None})))
    return made
