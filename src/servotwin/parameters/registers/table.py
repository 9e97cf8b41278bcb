"""What a table of registers is, and the one reader that makes a firmware group of raw values."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

from servotwin.errors import ParameterError, UnknownNameError
from servotwin.parameters.catalog import load_servo
from servotwin.parameters.firmware import Firmware
from servotwin.parameters.group import FRACTION
from servotwin.parameters.quantity import Quantity
from servotwin.parameters.registers.register import Register, is_read_only
from servotwin.parameters.servo import Servo, unit_of
from servotwin.units import is_finite

Raw = Mapping[str, int]
Value = float | str | None
_AS_WRITTEN = re.compile(r"(\w+) \((\d+)\) = (-?\d+)( assumed)?( given)?")  # in sources: P_Coefficient (21) = 32
_GUESS = "assumed"
_UNSURE = (0.5, 2.0)  # ends of the range over what an assumed register makes


@dataclass(frozen=True)
class Setting:
    """A number of the firmware, and how registers make it.

    Parameters
    ----------
    name : str
        Of the firmware group.
    value : callable
        From all raw values by name, and the servo, to the number (SI) or word; None: absent.
    registers : tuple of str
        Those it is made of; empty for what no register changes.
    said : str
        How it follows, for the source.
    origin : str
        One of `servotwin.parameters.ORIGINS`.
    factors : tuple of float
        Ends of the range over the value, where the law is not known for sure.
    bounds : tuple of float
        Ends of the range themselves (SI).
    """

    name: str
    value: Callable[[Raw, Servo], Value]
    registers: tuple[str, ...] = ()
    said: str = ""
    origin: str = "literature"
    factors: tuple[float, float] | None = None
    bounds: tuple[float, float] | None = None


@dataclass(frozen=True)
class Family:
    """The registers of a model of servo, and the numbers that follow from them.

    Parameters
    ----------
    label : str
        What people call servos of this family, such as ``"Feetech STS"``.
    model : str
        Of the family, such as ``"STS3250"``.
    registers : mapping of str to Register
    settings : tuple of Setting
    reference : str
        Where the registers are described; empty where no page was seen.
    count : float
        Angle of a count of positions [rad].
    middle : int
        Count at angle 0.
    current_sense : {"motor", "bus"}
        Whose current Present_Current is.
    assumed : frozenset of str
        Registers whose factory value no page prints.
    elsewhere : mapping of str to str
        Where single registers are described.
    masks : tuple of str
        Registers whose bits say whether a number acts, and not how large it is.
    sets : mapping of str to mapping
        Values that a program writes, by the name of the set.
    other_names : mapping of str to str
        Further names of registers.
    copied : mapping of str to str
        Register that power-up writes, and the one that it is copied from.
    pairs : tuple of pair of str
        Registers for the two ways of turning, of which the larger value counts.
    check : callable
        Raises ParameterError where raw values do not go together.
    served : frozenset of str
        Registers that act on a wire, or on power-up, though no number of the firmware follows from them.
    idle : frozenset of str
        Registers of which a wire only keeps what is written, though a number follows from them.
    refuses : bool
        Whether a servo refuses values that are not computed; else it keeps them.
    """

    label: str
    model: str
    registers: Mapping[str, Register]
    settings: tuple[Setting, ...]
    reference: str
    count: float
    middle: int
    current_sense: str = "motor"
    assumed: frozenset[str] = frozenset()
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    masks: tuple[str, ...] = ()
    sets: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    other_names: Mapping[str, str] = field(default_factory=dict)
    copied: Mapping[str, str] = field(default_factory=dict)
    pairs: tuple[tuple[str, str], ...] = ()
    check: Callable[[Raw], None] = lambda raw: None
    served: frozenset[str] = frozenset()
    idle: frozenset[str] = frozenset()
    refuses: bool = False

    def does(self, name: str) -> str:
        """Return what a write to a register does on a wire: acts, kept, read only; and what becomes of other values.

        Examples
        --------
        >>> from servotwin.parameters.registers.feetech import family_of
        >>> family = family_of(load_servo("feetech-sts3215-12v"))
        >>> [family.does(name) for name in ("P_Coefficient", "Goal_Time", "Present_Load")]
        ['acts', 'kept', 'read only']
        """
        one = self.registers[name]
        if is_read_only(name, one):
            return "read only"
        acts = name not in self.idle and (name in self.served or any(name in each.registers for each in self.settings))
        if not acts:
            return "kept"
        if not one.only:
            return "acts"
        return f"acts; others than {', '.join(map(str, one.only))} {'refused' if self.refuses else 'kept'}"

    def document(self, name: str) -> str:
        """Return where the factory value of a register is printed; empty where it is assumed."""
        if name in self.assumed:
            return ""
        return self.document(self.copied[name]) if name in self.copied else self.elsewhere.get(name, self.reference)


Given = Mapping[str, int] | str
"""Raw values by name, or the name of a set of them."""


def set_registers(family: Family, registers: Given, servo: str | Path | Servo, *, assumed: bool = False) -> Servo:
    """Return a servo whose firmware group follows from registers.

    What is given makes the numbers that depend on it. The other numbers stay as the servo has them; where it has none
    of this family, they follow from the factory's values.

    Parameters
    ----------
    family : Family
    registers : mapping of str to int, or str
        Raw values by name, or the name of one of the family's sets.
    servo : str, Path or Servo
        Catalog id, path of a servo file, or the servo itself.
    assumed : bool
        Whether it is only assumed that they hold these values.

    Raises
    ------
    UnknownNameError
        If there is no register, or no set, of this name: the nearest are suggested.
    ParameterError
        If a value is not whole or out of range, values do not go together, or the servo has the firmware of another
        family.

    Warns
    -----
    UserWarning
        If two registers differ that say the same for either way of turning, and one number stands for both.
    """
    base = servo if isinstance(servo, Servo) else load_servo(servo)
    given = read_registers(family, registers)
    own = _is_own(family, base)
    held = _held(family, base if own else None)
    held |= {name: _Value(value, assumed, not assumed) for name, value in given.items()}
    held |= {name: held[source] for name, source in family.copied.items() if source in given and name not in given}
    raw = {name: value.raw for name, value in held.items()}
    family.check(raw)
    _warn_of_pairs(family, given, raw)
    numbers: dict[str, Any] = {}
    quantities = dict(base.quantities)
    for setting in family.settings:
        stays = own or base.get(f"firmware.{setting.name}") is not None
        if not stays or any(name in given or family.copied.get(name) in given for name in setting.registers):
            quantity = _quantity(family, setting, held, base)
            numbers[setting.name] = None if quantity is None else quantity.value
            if quantity is not None:
                quantities[f"firmware.{setting.name}"] = quantity
    return replace(base, kind="bus", firmware=replace(base.firmware, **numbers), quantities=quantities)


def read_registers(family: Family, registers: Any) -> dict[str, int]:
    """Return raw values by the family's own names, each checked; those of a set by its name.

    Raises
    ------
    UnknownNameError, ParameterError
        As `set_registers` does.
    """
    if isinstance(registers, str):
        registers = _set_named(family, registers)
    if not isinstance(registers, Mapping):
        raise ParameterError(f"registers of {family.label}", got=registers, allowed="a mapping of names to raw values")
    found: dict[str, int] = {}
    for written, value in registers.items():
        name = family.other_names.get(str(written).strip(), str(written).strip())
        if name not in family.registers:
            raise UnknownNameError(f"register of {family.label}", str(written),
                                   (*family.registers, *family.other_names),
                                   allowed=f"the name of a register, such as {next(iter(family.registers))}")
        register = family.registers[name]
        what = f"register {name} ({register.address}) of {family.model if family.reference else family.label}"
        if not _is_whole(value) or not register.allows(int(value)):
            raise ParameterError(what, got=value, allowed=register.allowed)
        if found.setdefault(name, int(value)) != int(value):
            raise ParameterError(f"{what}, given by two names", got=value, allowed=f"one value, as {found[name]}")
    return found


def _set_named(family: Family, name: str) -> Mapping[str, int]:
    """Return the values of a set."""
    if name in family.sets:
        return family.sets[name]
    if name in family.registers or name in family.other_names:
        raise ParameterError(f"register {name} of {family.label}", got="no value",
                             allowed=f"a raw value, such as {name}={family.registers[name].factory}"
                             if name in family.registers else "a raw value")
    if not family.sets:
        raise ParameterError(f"set of registers of {family.label}", got=name,
                             allowed="raw values by name: this family has no named sets")
    raise UnknownNameError(f"set of registers of {family.label}", name, family.sets)


def on(bit: int, mask: str) -> Callable[[Raw], bool]:
    """Return a function that tells whether a bit of a register is set."""
    return lambda raw: bool(raw[mask] >> bit & 1)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Real) and is_finite(value) and float(value).is_integer()


def _of_firmware(servo: Servo) -> Iterator[str]:
    for name in servo.names():
        if name.startswith("firmware."):
            yield servo.source(name).source or ""


def _is_own(family: Family, servo: Servo) -> bool:
    """Return whether the servo has numbers of this family; raise if they are another's."""
    sources = list(_of_firmware(servo))
    other = next((text for text in sources if _family_of(text) not in ("", family.label)), None)
    if other is not None:
        raise ParameterError(f"registers of {family.label} for {servo.name!r}, which has those of {_family_of(other)}")
    return any(_family_of(text) for text in sources)


def written(family: Family, servo: Servo) -> dict[str, int]:
    """Return the raw values of all registers of a servo of a family: what its numbers were made of, else the factory's.

    Examples
    --------
    >>> from servotwin.parameters.registers.feetech import family_of
    >>> servo = load_servo("feetech-sts3215-12v")
    >>> written(family_of(servo), servo)["P_Coefficient"]
    32
    """
    return {name: value.raw for name, value in _held(family, servo).items()}


def family_label(servo: Servo) -> str | None:
    """Return the label of the family whose registers a servo has; None of a servo without.

    Examples
    --------
    >>> family_label(load_servo("feetech-sts3215-12v"))
    'Feetech STS'
    """
    return next((label for text in _of_firmware(servo) if (label := _family_of(text))), None)


def _family_of(source: str) -> str:
    """Return the family that a source names; empty where it names none."""
    label, found, _ = source.partition(" firmware: ")
    return label if found else ""


def known_registers(family: Family, servo: Servo) -> frozenset[str]:
    """Return the registers of a servo of which somebody said what they hold: not the factory's, and not assumed.

    Examples
    --------
    >>> from servotwin.parameters.registers.feetech import family_of, feetech_sts
    >>> servo = feetech_sts({"P_Coefficient": 32}, servo="feetech-sts3215-12v")
    >>> sorted(known_registers(family_of(servo), servo))
    ['P_Coefficient']
    """
    held = _held(family, servo)
    own = {setting.name: setting for setting in family.settings}
    raw = {name: one.raw for name, one in held.items()}
    other = {name for key, setting in own.items() for name in setting.registers
             if _differs(servo.get(f"firmware.{key}"), setting.value(raw, servo))}  # a number that was set by itself
    return frozenset(other | {name for name, one in held.items() if not one.assumed and (
        one.given or one.raw != family.registers[name].factory)})


def _differs(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return abs(one - other) > 1e-9 * max(abs(one), abs(other))
    return bool((one or None) != (other or None))


class _Value(NamedTuple):
    """What a register holds, whether that is assumed, and whether somebody gave it."""

    raw: int
    assumed: bool = False
    given: bool = False


def _held(family: Family, servo: Servo | None) -> dict[str, _Value]:
    """Return what the registers of a servo hold: what its numbers were made of, else the factory's.

    The sources of its numbers say what they were made of, so that one register may follow another in later calls.
    Numbers that were replaced since have another source, and name none.
    """
    held = {name: _Value(register.factory, not family.document(name)) for name, register in family.registers.items()}
    texts = () if servo is None else (text for text in _of_firmware(servo) if _family_of(text))
    return held | {name: _Value(int(value), bool(assumed), bool(given)) for text in texts
                   for name, _, value, assumed, given in _AS_WRITTEN.findall(text) if name in held}


def _warn_of_pairs(family: Family, given: Iterable[str], raw: Raw) -> None:
    for one, two in family.pairs:
        if raw[one] != raw[two] and (one in given or two in given):
            warnings.warn(f"registers {one} = {raw[one]} and {two} = {raw[two]} of {family.label} differ by the way of "
                          f"turning: computed with {max(raw[one], raw[two])} for both", stacklevel=4)


def _quantity(family: Family, setting: Setting, held: Mapping[str, _Value], servo: Servo) -> Quantity | None:
    value = setting.value({name: one.raw for name, one in held.items()}, servo)
    if value is None:
        return None
    named = ", ".join(f"{name} ({family.registers[name].address}) = {held[name].raw}"
                      + " assumed" * held[name].assumed + " given" * _is_worth_saying(family, name, held[name])
                      for name in setting.registers)
    unsure = any(held[name].assumed for name in setting.registers
                 if name not in family.masks or set(setting.registers) <= set(family.masks))
    origin = _GUESS if unsure else setting.origin
    documents = dict.fromkeys(_document(family, name, held[name]) for name in setting.registers) or {
        "" if origin == _GUESS else family.reference: None}
    parts = [f"register{'s' if len(setting.registers) > 1 else ''} {named}" if named else "", setting.said, *documents]
    return Quantity(value=value, unit=unit_of(f"firmware.{setting.name}"), origin=origin,
                    source=f"{family.label} firmware: " + "; ".join(part for part in parts if part),
                    **_spread(setting, value, unsure=unsure))


def _is_worth_saying(family: Family, name: str, value: _Value) -> bool:
    """Tell whether a source says that a value was given: else nobody could tell it from the factory's."""
    return value.given and value.raw == family.registers[name].factory


def _document(family: Family, name: str, value: _Value) -> str:
    """Return where the factory value of a register is printed, or, of another value, where the register is."""
    return family.document(name) if value.raw == family.registers[name].factory else family.reference


def _spread(setting: Setting, value: float | str, *, unsure: bool) -> dict[str, float]:
    if setting.bounds is not None:
        return {"lower": setting.bounds[0], "upper": setting.bounds[1]}
    factors = setting.factors or _UNSURE
    if not (unsure or setting.origin == _GUESS) or not isinstance(value, float) or value == 0.0:
        return {}
    low, high = sorted(factor * value for factor in factors)
    rule = next(f.metadata["rule"] for f in fields(Firmware) if f.name == setting.name)
    return {"lower": low, "upper": min(high, 1.0) if rule == FRACTION else high}
