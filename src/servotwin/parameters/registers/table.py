"""Tables of registers, and the one reader that makes a firmware group of raw values."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from servotwin.errors import ParameterError, UnknownNameError
from servotwin.parameters.catalog import load_servo
from servotwin.parameters.groups import FRACTION, Firmware
from servotwin.parameters.servo import Quantity, Servo, unit_of
from servotwin.units import is_finite

# --- A register: where its bytes lie, and what may be written into it -------------------------------------------------

@dataclass(frozen=True)
class Register:
    """A register: where it stands, and what may be written into it.

    Parameters
    ----------
    address : int
    lower, upper : int
        Range of the raw value.
    factory : int
        Value when the servo is new, or after power-up.
    only : tuple of int
        The values that are computed, where they are not all of the range; empty: all.
    why : str
        Reason why the others are not computed.
    reading : bool
        Whether the servo writes it, as what it measured or was sent last: a new one holds nothing to speak of.
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
        """Allowed values, in words."""
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


# --- A model of servo within its family -------------------------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class RegisterModel:
    """Differences between models of a family.

    Parameters
    ----------
    name : str
        As its maker writes it, such as ``"XL330-M288"``.
    number : int
        That it answers with.
    document : str
        Where its registers are described: document and section. Empty where none was seen: all is assumed then.
    page : str
        Address of that page, for people.
    values : mapping of str to int
        Values of its registers when it is new, where they are not those of most of the family.
    ranges : mapping of str to tuple of int
        Lowest and highest value of registers, where these are not the family's.
    units : mapping of str to str
        Of a raw step of registers, where these are not the family's.
    lacks : frozenset of str
        Registers of the family that it does not have.
    elsewhere : mapping of str to str
        Document and section of single registers whose value the page does not print.
    assumed : frozenset of str
        Registers whose value no page that was seen prints.
    """

    name: str
    number: int
    document: str = ""
    page: str = ""
    values: Mapping[str, int] = field(default_factory=dict)
    ranges: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    lacks: frozenset[str] = frozenset()
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    assumed: frozenset[str] = frozenset()

    @property
    def series(self) -> str:
        """The first word of the name: XL330 of an XL330-M288."""
        return self.name.partition("-")[0]

    def registers(self, common: Mapping[str, Register]) -> dict[str, Register]:
        """Return the registers of the model, out of those of its family."""
        made = {}
        for name, register in common.items():
            if name in self.lacks:
                continue
            lower, upper = self.ranges.get(name, (register.lower, register.upper))
            made[name] = replace(register, factory=self.values.get(name, register.factory), lower=lower, upper=upper,
                                 unit=self.units.get(name, register.unit))
        return made

    def unseen(self, common: Mapping[str, Register]) -> frozenset[str]:
        """Return the registers whose value is assumed."""
        names = frozenset(self.registers(common))
        return self.assumed & names if self.document else names


M = TypeVar("M", bound=RegisterModel)


def model_for(models: Sequence[M], servo: Servo, number: int, common: Mapping[str, Register]) -> M:
    """Return the model that a servo is of, by its number, else by its name or title.

    Of a servo that tells its series alone, such as ``"xl330"``, it is the first of the series, and what differs within
    the series is assumed; of one that tells nothing the first of all, and everything is.

    Parameters
    ----------
    models : sequence of RegisterModel
    servo : Servo
    number : int
        Model_Number, 0 where it is not known.
    common : mapping of str to Register
        Registers of the family.
    """
    told = [model for model in models if number and model.number == number]
    text = re.sub(r"[\s_]+", "-", f"{servo.name}|{servo.title}".lower())  # "XM430 W210" is an XM430-W210
    named = [model for model in told or models if _told(model.name.partition("(")[0], text)]
    if named:
        return max(named, key=lambda model: len(model.name))
    alike = told or [model for model in models if _told(model.series, text)]
    return _any_of(alike, common) if alike else replace(models[0], document="", page="")


def _told(word: str, text: str) -> bool:
    return re.search(rf"(?<![a-z0-9]){re.escape(word.lower())}(?![0-9])", text) is not None


def _any_of(models: Sequence[M], common: Mapping[str, Register]) -> M:
    """Return the first of models, with what differs between them as assumed."""
    first, *others = models
    if not others:
        return first
    own = first.registers(common)
    differ = {name for other in others for name, register in other.registers(common).items()
              if name in own and register.factory != own[name].factory}
    name = first.name if len({model.series for model in models}) > 1 else first.series
    return replace(first, name=name, assumed=first.assumed | differ)


# --- Values that programs write into registers: sets with a name, and the registers that people change ----------------

LEROBOT, LEROBOT_GRIPPER, LEROBOT_ELBOW = "lerobot", "lerobot-gripper", "lerobot-elbow"
_ARM = {"Return_Delay_Time": 0, "Operating_Mode": 0, "P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32,
        "Maximum_Acceleration": 254, "Acceleration": 254}
LEROBOT_SETS: Mapping[str, Mapping[str, int]] = {
    LEROBOT: _ARM,
    LEROBOT_GRIPPER: {**_ARM, "Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25}}
"""Registers that LeRobot writes into the servos of an SO-100 or SO-101 follower on connecting, the gripper apart.

Source: github.com/huggingface/lerobot, robots/so_follower/so_follower.py, configure; motors/feetech/feetech.py,
configure_motors.
"""
LEROBOT_X_SETS: Mapping[str, Mapping[str, int]] = {
    LEROBOT_ELBOW: {"Position_P_Gain": 1500, "Position_I_Gain": 0, "Position_D_Gain": 600}}
"""Registers that LeRobot writes into the elbow of a Koch or an OMX follower; the other joints keep the factory's gains.

Source: github.com/huggingface/lerobot, robots/koch_follower/koch_follower.py and robots/omx_follower/omx_follower.py,
configure.
"""

_NO_PROFILE: Mapping[str, float | None] = {"firmware.acceleration_limit": None, "firmware.speed_limit": None}


class RegisterSet(NamedTuple):
    """Candidate sets of registers that no log records.

    Parameters
    ----------
    name : str
        In words.
    registers : mapping of str to int
        Raw values; the others are as the servo has them.
    numbers : mapping of str to float or None
        Numbers of the servo that no value of a register makes (SI).
    """

    name: str
    registers: Mapping[str, int] = {}
    numbers: Mapping[str, float | None] = {}


class Varied(NamedTuple):
    """A register that people change, or several that get one value.

    Parameters
    ----------
    name : str
        In words.
    registers : tuple of str
    number : str
        Which number of the servo follows from them.
    values : tuple of int
        Raw values that are tried, in order.
    none : bool
        Whether that number may be absent although no value of the registers says so.
    """

    name: str
    registers: tuple[str, ...]
    number: str
    values: tuple[int, ...]
    none: bool = False


SETS: Mapping[str, tuple[RegisterSet, ...]] = {
    "Feetech STS": (
        RegisterSet("LeRobot's", _ARM), RegisterSet("LeRobot's with D 0", {**_ARM, "D_Coefficient": 0}),
        RegisterSet("no profile", {}, _NO_PROFILE), RegisterSet("D 0", {"D_Coefficient": 0}),
        RegisterSet("D 0 and no profile", {"D_Coefficient": 0}, _NO_PROFILE),
        RegisterSet("a program that sets the duty (mode 2)", {
            "D_Coefficient": 0, "Minimum_Startup_Force": 0, "CW_Dead_Zone": 0, "CCW_Dead_Zone": 0}, _NO_PROFILE)),
    "Dynamixel X": (RegisterSet("LeRobot's elbow of a Koch or OMX", LEROBOT_X_SETS[LEROBOT_ELBOW]),)}
"""By the label of the family."""

_GAIN, _DAMPING = "firmware.proportional_gain", "firmware.derivative_gain"
_ACCELERATION, _SPEED = "firmware.acceleration_limit", "firmware.speed_limit"
_TORQUE = "firmware.torque_limit"
_SMALL = (8, 12, 16, 24, 32, 48, 64)
VARIED: Mapping[str, tuple[Varied, ...]] = {
    "Feetech STS": (
        Varied("acceleration", ("Acceleration", "Maximum_Acceleration"), _ACCELERATION,
               (10, 20, 50, 100, 150, 254), none=True),
        Varied("P", ("P_Coefficient",), _GAIN, _SMALL),
        Varied("D", ("D_Coefficient",), _DAMPING, (0, 16, 32, 64)),
        Varied("speed", ("Maximum_Velocity_Limit",), _SPEED, (10, 20, 40, 68, 100, 160, 254)),
        Varied("torque", ("Max_Torque_Limit", "Torque_Limit"), _TORQUE, (150, 250, 400, 500, 700, 1000))),
    "Dynamixel X": (
        Varied("P", ("Position_P_Gain",), _GAIN, (100, 200, 400, 640, 800, 1500)),
        Varied("D", ("Position_D_Gain",), _DAMPING, (0, 300, 600, 1200, 4000)),
        Varied("acceleration", ("Profile_Acceleration",), _ACCELERATION, (0, 5, 10, 20, 50, 100, 200)),
        Varied("speed", ("Profile_Velocity",), _SPEED, (0, 20, 50, 100, 200, 400))),
    "Dynamixel MX": (
        Varied("P", ("P_Gain",), _GAIN, _SMALL), Varied("D", ("D_Gain",), _DAMPING, (0, 8, 32, 100)),
        Varied("acceleration", ("Goal_Acceleration",), _ACCELERATION, (0, 10, 20, 50, 100, 200)),
        Varied("speed", ("Moving_Speed",), _SPEED, (0, 50, 100, 200, 400, 800))),
    "Dynamixel AX": (
        Varied("slope", ("CW_Compliance_Slope", "CCW_Compliance_Slope"), _GAIN, (4, 8, 16, 32, 64, 128)),
        Varied("speed", ("Moving_Speed",), _SPEED, (0, 50, 100, 200, 400, 800))),
    "Dynamixel XL320": (
        Varied("P", ("P_Gain",), _GAIN, _SMALL), Varied("D", ("D_Gain",), _DAMPING, (0, 8, 32, 100)),
        Varied("speed", ("Moving_Speed",), _SPEED, (0, 50, 100, 200, 400, 800)))}
"""Registers that people and programs change, by the label of the family; the values are where a search begins."""


# --- Tables of registers, and the one reader that makes a firmware group of raw values --------------------------------

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
        Usual name of servos of this family, such as ``"Feetech STS"``.
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
        The current that Present_Current measures.
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

    A given register makes the numbers that depend on it. The other numbers stay as the servo has them; where it has
    none of this family, they follow from the factory's values.

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
    """The value of a register, whether it is assumed, and whether it was given."""

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
