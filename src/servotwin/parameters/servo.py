"""A servo: its parameter groups, and for every number where it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from servotwin.errors import ParameterError, UnknownNameError
from servotwin.look import escape, number, table
from servotwin.parameters.firmware import Firmware
from servotwin.parameters.group import Group
from servotwin.parameters.groups import (
    GROUPS,
    Electronics,
    Friction,
    Gear,
    Motor,
    Potentiometer,
    Stops,
    Supply,
    Thermal,
)
from servotwin.parameters.plausible import warn_of
from servotwin.parameters.quantity import SET_BY_USER, Quantity
from servotwin.text import fault_of
from servotwin.units import si_unit

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
        What decides the bridge: an analog chip, or a microcontroller that listens to pulses or to packets on a bus.
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
            Who says so; what begins with "set by" is listed under `set` in summaries.

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
