"""A register: where its bytes lie, and what may be written into it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Register:
    """A register: where it stands, and what may be written into it.

    Parameters
    ----------
    address : int
    lower, upper : int
        Range of the raw value.
    factory : int
        What it holds when the servo is new, or after power-up.
    only : tuple of int
        The values that are computed, where they are not all of the range; empty: all.
    why : str
        What to say of the others.
    reading : bool
        Whether the servo writes it, as what it measured or was told last: a new one holds nothing to speak of.
    size : int
        Bytes, the low one first: 1, 2 or 4.
    sign_bit : int, optional
        Bit that says minus, the other bits the magnitude.
    signed : bool
        Whether it is a two's complement.
    stored : bool
        Whether it outlives power-off (EEPROM), and is not set anew at power-up (RAM).
    unit : str
        Of a raw step.
    """

    address: int
    lower: int
    upper: int
    factory: int
    only: tuple[int, ...] = ()
    why: str = ""
    reading: bool = False
    size: int = 1
    sign_bit: int | None = None
    signed: bool = False
    stored: bool = False
    unit: str = ""

    def decode(self, data: Sequence[int]) -> int:
        """Return the number that the register's bytes mean.

        Examples
        --------
        >>> Register(60, -1000, 1000, 0, size=2, sign_bit=10).decode([0x64, 0x04])
        -100
        """
        raw = int.from_bytes(bytes(data[:self.size]), "little", signed=self.signed)
        if self.sign_bit is not None and raw >> self.sign_bit & 1:
            return -(raw & ((1 << self.sign_bit) - 1))
        return raw

    def encode(self, value: int) -> bytes:
        """Return a number as the register's bytes.

        Examples
        --------
        >>> Register(42, -32767, 32767, 0, size=2, sign_bit=15).encode(-5).hex()
        '0580'
        """
        if self.sign_bit is not None and value < 0:
            value = -value | 1 << self.sign_bit
        return value.to_bytes(self.size, "little", signed=self.signed)

    def allows(self, value: int) -> bool:
        """Return whether a raw value is in its range, and computed."""
        return value in self.only if self.only else self.lower <= value <= self.upper

    @property
    def allowed(self) -> str:
        """What may be written, in words."""
        values = " or ".join(str(value) for value in self.only) or f"a whole number from {self.lower} to {self.upper}"
        return f"{values}; {self.why}" if self.why else values


def laid(registers: Mapping[str, Register], *, sizes: Mapping[int, str], signs: Mapping[str, int | None] | None = None,
         stored: Sequence[range] = (), units: Mapping[str, str] | None = None) -> dict[str, Register]:
    """Return registers with how their bytes lie.

    Parameters
    ----------
    registers : mapping of str to Register
    sizes : mapping of int to str
        Names, with blanks between, of those of so many bytes; the others have one.
    signs : mapping of str to int or None
        Bit of the sign by name, None for two's complement.
    stored : sequence of range
        Addresses that outlive power-off.
    units : mapping of str to str
        Names, with blanks between, by unit.
    """
    size_of = {name: size for size, names in sizes.items() for name in names.split()}
    unit_of = {name: unit for unit, names in (units or {}).items() for name in names.split()}
    signs = signs or {}
    return {name: replace(one, size=size_of.get(name, 1), sign_bit=signs.get(name),
                          signed=name in signs and signs[name] is None,
                          stored=any(one.address in some for some in stored), unit=unit_of.get(name, ""))
            for name, one in registers.items()}


def is_read_only(name: str, one: Register) -> bool:
    """Return whether a register is the servo's own to write: goals are not, though the servo may change them too."""
    told = name.startswith("Goal_") and name != "Goal_Position_2"
    return (one.reading and not told) or name in ("Model_Number", "Registered_Instruction")
