"""A servo: its parameter groups, and for every number where it comes from."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.errors import ParameterError, PlausibilityWarning, UnknownNameError
from servotwin.look import escape, number, table
from servotwin.parameters.groups import (
    GROUPS,
    Electronics,
    Firmware,
    Friction,
    Gear,
    Group,
    Motor,
    Potentiometer,
    Stops,
    Supply,
    Thermal,
)
from servotwin.text import fault_of
from servotwin.units import DIMENSIONS, factor, si_unit

if TYPE_CHECKING:
    from servotwin.parameters.groups import Plausible


# --- A parameter with what is known about it: where it comes from, and how sure it is ---------------------------------

SET_BY_USER = "set by the user"
_SET = "set by "
ORIGINS = ("measured", "identified", "datasheet", "literature", "assumed")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A value in SI with unit, origin, source and spread.

    Parameters
    ----------
    value : float, tuple of float or str
    unit : str
        SI unit; empty for words.
    origin : str
        One of measured, identified, datasheet, literature, assumed.
    source : str, optional
        Where it was read; only what is assumed may lack it.
    std : float, optional
        Standard error, in `unit`.
    lower, upper : float, optional
        Range, in `unit`.

    Raises
    ------
    ParameterError
        If the origin is unknown, a source is missing, or the spread does not fit the value.

    Examples
    --------
    >>> Quantity(value=3.04, unit="ohm", origin="assumed", lower=2.75, upper=3.7).spread
    '2.75 to 3.7'
    """

    value: float | tuple[float, ...] | str
    unit: str
    origin: str
    source: str | None = None
    std: float | None = None
    lower: float | None = None
    upper: float | None = None

    def __post_init__(self) -> None:
        if self.origin not in ORIGINS:
            raise ParameterError("origin", got=self.origin, allowed=", ".join(ORIGINS))
        if not self.source and self.origin != "assumed":
            raise ParameterError(f"source of a value that is {self.origin}", got="none",
                                 allowed="a source; only what is assumed may lack it")
        for name in ("std", "lower", "upper"):
            bound = getattr(self, name)
            if bound is not None and not math.isfinite(bound):
                raise ParameterError(name, got=bound, allowed="a finite number")
        if self.std is not None and (self.std < 0.0 or self.lower is not None or self.upper is not None):
            raise ParameterError("std", got=self.std, allowed="at least 0, and either std or lower and upper")
        if isinstance(self.value, float):
            slack = 1e-12 * abs(self.value)
            if self.lower is not None and self.lower > self.value + slack:
                raise ParameterError("lower", got=self.lower, allowed=f"at most the value {self.value!r}")
            if self.upper is not None and self.upper < self.value - slack:
                raise ParameterError("upper", got=self.upper, allowed=f"at least the value {self.value!r}")

    @property
    def was_set(self) -> bool:
        """Whether a person set it, by `Servo.replace` or `--set`, rather than a file assumed it."""
        return self.origin == "assumed" and self.source is not None and self.source.startswith(_SET)

    @property
    def spread(self) -> str:
        """The spread in words; empty where none is given."""
        if self.std is not None:
            return f"± {self.std:.4g}"
        if self.lower is not None and self.upper is not None:
            return f"{self.lower:z.4g} to {self.upper:z.4g}"
        if self.lower is not None or self.upper is not None:
            return f"from {self.lower:z.4g}" if self.lower is not None else f"up to {self.upper:z.4g}"
        return ""


# --- Numbers of motor and gear as the output shaft sees them, where only they matter ----------------------------------

N = "gear.gear_reduction"


class OutputSide(NamedTuple):
    """A number at the output shaft.

    Parameters
    ----------
    members : tuple of str
        Dotted names of what stands for it at the motor shaft.
    power : int
        Of N that leads from there to the output.
    dimension : str
        Of `servotwin.units`.
    meaning : str
    """

    members: tuple[str, ...]
    power: int
    dimension: str
    meaning: str


OUTPUT_SIDE: dict[str, OutputSide] = {
    "output_torque_constant": OutputSide(
        ("motor.torque_constant", "motor.back_emf_constant"), 1, "torque per current", "K_out = N k_a, k_b equal"),
    "output_inertia": OutputSide(("motor.rotor_inertia",), 2, "inertia", "N² J_m"),
    "output_viscous_friction": OutputSide(("motor.motor_viscous_friction",), 2, "torque per speed", "N² B_m"),
    "output_coulomb_torque": OutputSide(
        ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward"), 1, "torque", "N F_c, both ways"),
    "output_coulomb_torque_forward": OutputSide(("friction.coulomb_torque_forward",), 1, "torque", "N F_ec1"),
    "output_coulomb_torque_backward": OutputSide(("friction.coulomb_torque_backward",), 1, "torque", "N F_ec2"),
    "output_stribeck_speed": OutputSide(("friction.stribeck_speed",), -1, "output speed", "v_s/N"),
}
"""By name. The motion of the output stays the same when N changes and these do not."""


def output_value(servo: Servo, name: str) -> float | None:
    """Return a number at the output shaft (SI), the mean where it has several members; None where one is missing.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(output_value(load_servo("hitec-hs-755hb"), "output_torque_constant"), 4)
    1.0396
    """
    side = OUTPUT_SIDE[name]
    found = [servo.get(member) for member in side.members]
    reduction = servo.get(N)
    if any(not isinstance(value, int | float) for value in (*found, reduction)):
        return None
    return float(np.mean(np.array(found, dtype=np.float64))) * float(reduction) ** side.power  # type: ignore[arg-type]


def motor_side(values: Mapping[str, Any], reduction: Any) -> dict[str, Any]:
    """Return the members (SI, dotted names) of numbers at the output shaft; numbers or arrays.

    Parameters
    ----------
    values : mapping
        By name in `OUTPUT_SIDE` (SI).
    reduction : float or array
        N [1].

    Examples
    --------
    >>> motor_side({"output_inertia": 8.0}, 2.0)
    {'motor.rotor_inertia': 2.0}
    """
    return {member: value / reduction**OUTPUT_SIDE[name].power
            for name, value in values.items() for member in OUTPUT_SIDE[name].members}


# --- Whether the numbers of a servo lie where those of servos do ------------------------------------------------------

AT_OUTPUT = {member: side.power for side in OUTPUT_SIDE.values() for member in side.members}
"""Parameters whose range holds at the output shaft, and the power of the reduction N that leads there.

Behind a reduction of 1 a servo file may give its motor as the output shaft sees it.
"""

_SMALLEST = 1e-5  # of the high end: what is smaller in another unit is hardly meant
_CELSIUS = 273.15


def plausible_range(name: str, reduction: float | None = None) -> Plausible | None:
    """Return between which numbers (SI) a parameter is plausible; None of a word.

    Parameters
    ----------
    name : str
        Dotted.
    reduction : float, optional
        Of the servo's gear; unless given, the range of a parameter of `AT_OUTPUT` is that at the output shaft [1].

    Examples
    --------
    >>> plausible_range("electronics.deadband")[:2], plausible_range("motor.torque_constant", 300.0)[1]
    ((1e-07, 0.0005), 0.1)
    """
    group, _, key = name.partition(".")
    found: Plausible | None = GROUPS[group].__dataclass_fields__[key].metadata["plausible"]
    if found is None or reduction is None or name not in AT_OUTPUT:
        return found
    by = reduction ** AT_OUTPUT[name]
    return found._replace(low=found.low / by, high=found.high / by)


def oddity(servo: Servo, name: str, unit: str | None = None) -> str | None:
    """Return in one line what is odd about a value of a servo, and which unit was probably meant; None of another.

    0 is never odd: it says that an effect is off.

    Parameters
    ----------
    servo : Servo
    name : str
        Dotted; of a parameter that the servo gives.
    unit : str, optional
        In which it was given; the SI unit unless given.

    Examples
    --------
    >>> from servotwin.parameters.servo import servo_from_values
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     servo = servo_from_values("mine", {"electronics": {"deadband": 8.0}})
    >>> oddity(servo, "electronics.deadband")
    'mine: electronics.deadband of 8 s is not plausible (1e-07 to 0.0005 s): 8 us?'
    """
    reduction = servo.gear.gear_reduction
    found, value = plausible_range(name, reduction), servo.get(name)
    if found is None or value is None or isinstance(value, str):
        return None
    values = value if isinstance(value, tuple) else (value,)
    odd = next((one for one in values if one != 0.0 and not found.low <= one <= found.high), None)
    if odd is None:
        return None
    group, _, key = name.partition(".")
    dimension = str(GROUPS[group].__dataclass_fields__[key].metadata["dimension"])
    given = si_unit(dimension) if unit is None else unit
    number, by = odd / factor(given, dimension), factor(given, dimension)
    behind = f" behind a reduction of {reduction:g}" if name in AT_OUTPUT and reduction is not None else ""
    meant = _meant(number, given, dimension, found)
    shown = "" if given == "1" else f" {given}"
    return (f"{servo.name}: {name} of {number:.6g}{shown} is not plausible ({found.low / by:.4g} to "
            f"{found.high / by:.4g}{shown}{behind})" + (f": {number:.6g} {meant}?" if meant else ""))


def warn_of(servo: Servo, names: Iterable[str], unit: Callable[[str], str | None] = lambda name: None, *,
            stacklevel: int = 3) -> None:
    """Warn of each value that is not plausible.

    Parameters
    ----------
    servo : Servo
    names : iterable of str
        Dotted; those that the servo does not give are passed over.
    unit : callable
        Says in which unit one was given; None: in SI.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    for name in names:
        text = oddity(servo, name, unit(name))
        if text is not None:
            warnings.warn(text, PlausibilityWarning, stacklevel=stacklevel)


def _meant(number: float, given: str, dimension: str, within: Plausible) -> str:
    """Return the first other unit in which a number is plausible; empty where there is none."""
    if dimension == "temperature":
        return "deg C" if within.low <= number + _CELSIUS <= within.high else ""
    least = _SMALLEST * max(abs(within.low), within.high)
    return next((unit for unit, by in DIMENSIONS[dimension].items() if unit not in (given, "%")
                 and within.low <= number * by <= within.high and abs(number) * by >= least), "")


# --- A servo: its parameter groups, and for every number where it comes from ------------------------------------------

Value = float | tuple[float, ...] | str
KINDS = ("analog", "digital", "bus")
USUAL_NAMES = {  # what people call it -> its name
    "voltage": "supply.open_circuit_voltage", "supply_voltage": "supply.open_circuit_voltage",
    "resistance": "motor.armature_resistance", "inductance": "motor.armature_inductance",
    "inertia": "motor.rotor_inertia", "viscous_friction": "motor.motor_viscous_friction",
    "ratio": "gear.gear_reduction", "gear_ratio": "gear.gear_reduction", "reduction": "gear.gear_reduction",
    "play": "gear.backlash", "coulomb_torque": "friction.coulomb_torque_forward",
    "dead_band": "electronics.deadband", "frame": "electronics.frame_period", "gain": "electronics.stretcher_gain"}
PLACES = {f"{group}.{f.name}": (group, f.name) for group, kind in GROUPS.items() for f in fields(kind)}


@dataclass(frozen=True, kw_only=True, repr=False)
class Servo:
    """All that is known of one servo; made by `load_servo` or `servo_from_values`.

    Parameters
    ----------
    name : str
        Short id, such as ``"hitec-hs-755hb"``; not empty, and like the title without control or bidirectional
        characters, of at most 200 characters.
    title : str
        For people.
    kind : {"analog", "digital", "bus"}
        Controller of the bridge: an analog chip, or a microcontroller that listens to pulses or to packets on a bus.
    motor, gear, friction, electronics, potentiometer, firmware, supply, stops, thermal : Group
        Always there; a field that is None is absent. Plain numbers in SI.
    quantities : mapping of str to Quantity
        Every given value by its dotted name, with unit, origin, source and spread; a value without one is assumed.
    notes : str
    sheet, fit : mapping
        Facts of the data sheet, and the record of a fit, as the servo file holds them.

    Raises
    ------
    ParameterError
        If the name is empty or no text, name or title hold what no reader sees or are too long, the kind is none of the
        three, or a servo that turns without end has stops.

    Examples
    --------
    >>> servo = servo_from_values("mine", {"motor": {"armature_resistance": 3.0}})
    >>> servo.motor.armature_resistance, servo.motor.torque_constant
    (3.0, None)
    >>> servo.replace({"motor.armature_resistance": 3.1}).motor.armature_resistance
    3.1
    """

    name: str
    title: str = ""
    kind: str = "analog"
    motor: Motor = field(default_factory=Motor)
    gear: Gear = field(default_factory=Gear)
    friction: Friction = field(default_factory=Friction)
    electronics: Electronics = field(default_factory=Electronics)
    potentiometer: Potentiometer = field(default_factory=Potentiometer)
    firmware: Firmware = field(default_factory=Firmware)
    supply: Supply = field(default_factory=Supply)
    stops: Stops = field(default_factory=Stops)
    thermal: Thermal = field(default_factory=Thermal)
    quantities: Mapping[str, Quantity] = field(default_factory=dict, repr=False)
    notes: str = field(default="", repr=False)
    sheet: Mapping[str, Any] = field(default_factory=dict, repr=False)
    fit: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ParameterError("name of a servo", got=self.name, allowed='a short id, such as "my-servo"')
        for what, text in (("name", self.name), ("title", self.title)):
            if fault := fault_of(text):
                raise ParameterError(f"{what} of a servo", got=text, allowed=fault)
        if self.kind not in KINDS:
            raise ParameterError(f"kind of {self.name!r}", got=self.kind, allowed=", ".join(KINDS))
        self._check_endless()
        object.__setattr__(self, "quantities", {name: self._quantity(name) for name in self.names()})
        for name in ("quantities", "sheet", "fit"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def _check_endless(self) -> None:
        stops = [name for name in self.names() if name.startswith("stops.")]
        if stops and self.potentiometer.fixed_angle is not None:
            raise ParameterError("potentiometer.fixed_angle", got=f"{stops[0]} beside it",
                                 allowed="one of the two: a servo that turns without end has no stops (stops=none, or "
                                 "Servo.continuous, takes them away)")

    def _quantity(self, name: str) -> Quantity:
        group, key = check_name(name)
        value = getattr(getattr(self, group), key)
        known = self.quantities.get(name)
        if known is not None and known.value == value:
            return known
        return Quantity(value=value, unit=unit_of(name), origin="assumed")

    def __repr__(self) -> str:
        return f"Servo({self.name!r}, kind={self.kind!r}, {len(self.names())} values)"

    def _repr_html_(self) -> str:
        """Return all values with unit, origin and source, as notebooks show them."""
        known = {name: self.quantities[name] for name in self.names()}
        rows = [[f"<code>{escape(name)}</code>", _shown(each.value), escape(each.unit), escape(each.origin),
                 escape(each.source or "")] for name, each in known.items()]
        return table(["parameter", "value", "unit", "origin", "source"], rows, caption=escape(self.title or self.name))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by plain mappings."""
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        return _rebuild, ({k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in state.items()},)

    def __hash__(self) -> int:
        return hash((self.name, tuple(getattr(self, group) for group in GROUPS)))

    def names(self) -> tuple[str, ...]:
        """Return the dotted names of all values that are given, in the order of the groups."""
        return tuple(name for name, (group, key) in PLACES.items() if getattr(getattr(self, group), key) is not None)

    def get(self, name: str) -> Value | None:
        """Return a value (SI) by its dotted name, None where it is absent.

        Raises
        ------
        UnknownNameError
            If no parameter has this name; the nearest one is suggested.
        """
        group, key = check_name(name)
        value: Value | None = getattr(getattr(self, group), key)
        return value

    def source(self, name: str) -> Quantity:
        """Return a given value with unit, origin, source and spread.

        Raises
        ------
        UnknownNameError
            If no parameter has this name.
        ParameterError
            If this servo does not give it.
        """
        if self.get(name) is None:
            raise ParameterError(f"{name} is not given by servo {self.name!r}")
        return self.quantities[name]

    def replace(self, values: Mapping[str, Value | None], *, source: str = SET_BY_USER) -> Servo:
        """Return a servo with some values replaced; their origin becomes assumed.

        Parameters
        ----------
        values : mapping
            Dotted name to SI number; None takes a value away.
        source : str
            Source of the values; one that begins with "set by" is listed under `set` in summaries.

        Raises
        ------
        ParameterError, UnknownNameError
            If a value is not physical, or a name unknown.

        Warns
        -----
        UserWarning
            Of each new value that is not plausible.
        """
        made = self._with(values, source)
        warn_of(made, [name for name in values if made.get(name) != self.get(name)])
        return made

    def _with(self, values: Mapping[str, Value | None], source: str = SET_BY_USER) -> Servo:
        changed: dict[str, dict[str, Value | None]] = {}
        for name, value in values.items():
            group, key = check_name(name)
            changed.setdefault(group, {})[key] = value
        groups = {group: replace(getattr(self, group), **new) for group, new in changed.items()}
        quantities = dict(self.quantities)
        for name in values:
            group, key = check_name(name)
            value = getattr(groups[group], key)
            if value is not None:
                quantities[name] = _replaced(name, value, source)
        return replace(self, quantities=quantities, **groups)

    def continuous(self, fixed_angle: float) -> Servo:
        """Return the servo rebuilt to turn without end: its potentiometer off the shaft, its stops taken away.

        Parameters
        ----------
        fixed_angle : float
            Where the potentiometer stands; the pulse of this angle is then the neutral one [rad].

        Raises
        ------
        ParameterError
            If the angle is not finite.

        Examples
        --------
        >>> from servotwin.parameters import load_servo
        >>> wheel = load_servo("hitec-hs-755hb").continuous(1.5)
        >>> wheel.potentiometer.fixed_angle, wheel.stops.upper_angle
        (1.5, None)
        """
        stops = {name: None for name in self.names() if name.startswith("stops.")}
        return self.replace({"potentiometer.fixed_angle": fixed_angle, **stops})

    def with_checked(self, values: Mapping[str, Value | None]) -> Servo:
        """Return what `replace` does, faster where numbers stand for numbers; all values were checked before.

        Nothing is warned of: what a search tries is nobody's word.
        """
        if not all(isinstance(value, float) and name in self.quantities for name, value in values.items()):
            return self._with(values)
        made = object.__new__(Servo)
        made.__dict__.update(self.__dict__)
        for name, value in values.items():
            group, key = check_name(name)
            if made.__dict__[group] is self.__dict__[group]:
                made.__dict__[group] = object.__new__(GROUPS[group])
                made.__dict__[group].__dict__.update(self.__dict__[group].__dict__)
            made.__dict__[group].__dict__[key] = value
        changed = {name: _replaced(name, value, SET_BY_USER) for name, value in values.items() if value is not None}
        made.__dict__["quantities"] = MappingProxyType({**self.quantities, **changed})
        return made

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a servo file that `load_servo` reads back as an equal servo.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        from servotwin.parameters.servo_file import write_servo_file

        write_servo_file(self, Path(path), overwrite=overwrite)


def servo_from_values(name: str, values: Mapping[str, Mapping[str, Value]], *, title: str = "",
                      kind: str = "analog") -> Servo:
    """Return a servo from plain SI numbers by group; every value counts as assumed.

    Parameters
    ----------
    name : str
    values : mapping
        Such as ``{"motor": {"armature_resistance": 3.0}}``; groups may be partial or absent.
    title : str
        For people.
    kind : {"analog", "digital", "bus"}

    Raises
    ------
    ParameterError, UnknownNameError
        If a value is not physical, or a name unknown.

    Warns
    -----
    UserWarning
        Of each value that is not plausible.

    Examples
    --------
    >>> servo_from_values("mine", {"gear": {"gear_reduction": 280.0}}).source("gear.gear_reduction").origin
    'assumed'
    """
    groups: dict[str, Group] = {}
    for group, entries in values.items():
        if group not in GROUPS:
            raise UnknownNameError("parameter group", str(group), GROUPS)
        if not isinstance(entries, Mapping):
            raise ParameterError(group, got=entries, allowed="a mapping of names to values")
        for key in entries:
            check_name(f"{group}.{key}")
        groups[group] = GROUPS[group](**entries)
    made = Servo(name=name, title=title, kind=kind, **groups)  # type: ignore[arg-type]
    warn_of(made, made.names())
    return made


def check_name(name: str) -> tuple[str, str]:
    """Return group and field of a dotted name.

    Raises
    ------
    UnknownNameError
        If no parameter has this name; the nearest one is suggested.

    Examples
    --------
    >>> check_name("motor.rotor_inertia")
    ('motor', 'rotor_inertia')
    """
    place = PLACES.get(name)
    if place is None:
        group, _, key = str(name).partition(".")
        meant = USUAL_NAMES.get(key or group)
        if group in GROUPS:
            near = [n for n in PLACES if n.startswith(f"{group}.")]
            raise UnknownNameError("parameter", name, near, meant=meant if meant in near else None)
        raise UnknownNameError("parameter", name, PLACES, meant=meant,
                               allowed=f"GROUP.NAME, with a group of {', '.join(GROUPS)}")
    return place


def dimension_of(name: str) -> str:
    """Return what a parameter measures, in the words of `servotwin.units`; "word" for words.

    Examples
    --------
    >>> dimension_of("motor.rotor_inertia")
    'inertia'
    """
    group, key = check_name(name)
    return str(GROUPS[group].__dataclass_fields__[key].metadata["dimension"])


def unit_of(name: str) -> str:
    """Return the SI unit of a parameter; empty for words.

    Examples
    --------
    >>> unit_of("motor.rotor_inertia")
    'kg m2'
    """
    dimension = dimension_of(name)
    return "" if dimension == "word" else si_unit(dimension)


def _replaced(name: str, value: Value, source: str) -> Quantity:
    return Quantity(value=value, unit=unit_of(name), origin="assumed", source=source)


def _shown(value: Value) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(number, value))
    return escape(value) if isinstance(value, str) else number(value)


def _rebuild(state: dict[str, Any]) -> Servo:
    return Servo(**state)
