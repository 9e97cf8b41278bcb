"""The memory of a servo: bytes by address, and the registers that lie in them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from servotwin.parameters.registers.register import Register, is_read_only
from servotwin.parameters.registers.table import Family

_MANY = 8  # bytes of a write: what more have touched is looked up each time


class ControlTable:
    """Registers as bytes, what is stored beside what is there now.

    Parameters
    ----------
    family : Family
    size : int
        Bytes.
    values : mapping of str to int
        What the registers hold at power-up; the others 0.
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
