"""A data sheet: what a maker or a shop prints about a servo, at one or several supply voltages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.parameters import REGISTER_FAMILIES
from servotwin.parameters.sheet_table import check_voltages

MODULATIONS = ("analog", "digital", "bus", "")
ENDLESS = ("endless", "continuous")
"""What stands for the travel of a servo that turns without end."""
_USUAL_VOLTAGE = 6.0  # where makers print most
# What no servo has, from the smallest to the largest: a figure outside it is one in another unit
_PLAUSIBLE: dict[str, tuple[float, float, str]] = {
    **dict.fromkeys(("supply_voltage", "voltage_min", "voltage_max"), (1.0, 60.0, "V")),
    "stall_torque": (1e-4, 200.0, "N m"), "no_load_speed": (0.02, 300.0, "rad/s"),
    "no_load_current": (1e-4, 50.0, "A"), "stall_current": (1e-3, 200.0, "A"), "idle_current": (1e-7, 5.0, "A"),
    "deadband": (1e-8, 1e-3, "s"), "pulse_min": (1e-5, 0.01, "s"), "pulse_max": (1e-5, 0.01, "s"),
    "neutral_pulse": (1e-5, 0.01, "s"), "travel": (0.01, 500.0, "rad"), "stop_travel": (0.01, 500.0, "rad"),
    "angle_per_pulse": (1.0, 1e5, "rad/s"), "mass": (1e-4, 50.0, "kg"), "gear_reduction": (1.0, 1e5, "1"),
    "backlash": (1e-6, 0.5, "rad"),
}


@dataclass(frozen=True, kw_only=True)
class SheetPoint:
    """What is printed for one supply voltage; None is not printed.

    Parameters
    ----------
    supply_voltage : float
        [V].
    stall_torque : float, optional
        [N m].
    no_load_speed : float, optional
        60° in 0.23 s are 4.55 rad/s [rad/s].
    no_load_current : float, optional
        Running without load [A].
    stall_current : float, optional
        With the shaft held [A].
    idle_current : float, optional
        Standing without load [A].
    source : str
        Where it was read; that of the sheet unless given.

    Raises
    ------
    InputError
        If a figure is no number, or none that a servo has.

    Examples
    --------
    >>> SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553).complete
    True
    """

    supply_voltage: float
    stall_torque: float | None = None
    no_load_speed: float | None = None
    no_load_current: float | None = None
    stall_current: float | None = None
    idle_current: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        _check(self)
        if self.stall_current is not None and self.no_load_current is not None \
                and self.stall_current <= self.no_load_current:
            raise InputError(f"stall current at {self.supply_voltage:g} V", got=self.stall_current,
                             allowed=f"more than the no-load current {self.no_load_current:g} A")

    @property
    def complete(self) -> bool:
        """Whether it has torque and speed, without which no motor follows."""
        return self.stall_torque is not None and self.no_load_speed is not None


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """All that a sheet prints about one servo; None is not printed, and nothing is filled in here.

    Parameters
    ----------
    name : str
        Id of the servo, which is the name of its file too, such as ``"my-servo"``.
    points : tuple of SheetPoint
        One for each supply voltage, or several for one voltage out of several sources. The points whose source is that
        of the first one make the servo; those of other sources only widen its ranges.
    title : str
        For people; the name unless given.
    voltage_min, voltage_max : float, optional
        Supply voltages between which the maker lets it run [V].
    deadband : float, optional
        [s].
    pulse_min, pulse_max : float, optional
        Pulse widths between which the servo turns through `travel` [s].
    neutral_pulse : float, optional
        Pulse width of the middle position [s].
    travel : float, optional
        Angle between `pulse_min` and `pulse_max` [rad].
    angle_per_pulse : float, optional
        Angle per pulse width; it goes before `travel` [rad/s].
    stop_travel : float, optional
        Angle from stop to stop [rad].
    mass : float, optional
        [kg].
    gear_reduction : float, optional
        Motor turns per turn of the output [1].
    backlash : float, optional
        Total play at the output [rad].
    motor_type : str
        Such as ``"3-pole"`` or ``"coreless"``.
    modulation : {"analog", "digital", "bus", ""}
    continuous : bool
        Whether it turns without end; it then has no travel, no angle per pulse width and no stops.
    registers : {"feetech-sts", "dynamixel-x", "dynamixel-mx", "dynamixel-ax", ""}
        Of a bus servo, and only of one: whose registers it has; the firmware is the factory's.
    source : str
        Where the figures were read.
    sources : mapping of str to str
        Where single figures were read, by the names above.
    note : str
        For people; goes to the notes of the servo.

    Raises
    ------
    InputError
        If a figure is no number, none that a servo has, or does not fit another; if there is no voltage with both
        torque and speed.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553, no_load_current=0.285)
    >>> Sheet(name="my-servo", points=(point,), deadband=8e-6, source="the box").title
    'my-servo'
    """

    name: str
    points: tuple[SheetPoint, ...]
    title: str = ""
    voltage_min: float | None = None
    voltage_max: float | None = None
    deadband: float | None = None
    pulse_min: float | None = None
    pulse_max: float | None = None
    neutral_pulse: float | None = None
    travel: float | None = None
    angle_per_pulse: float | None = None
    stop_travel: float | None = None
    mass: float | None = None
    gear_reduction: float | None = None
    backlash: float | None = None
    motor_type: str = ""
    modulation: str = ""
    continuous: bool = False
    registers: str = ""
    source: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)
    note: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z0-9][\w.-]*", self.name):
            raise InputError("name of a servo", got=self.name,
                             allowed='a short id of letters, digits, "-", "_" and ".", such as "my-servo"')
        _check(self)
        if self.modulation not in MODULATIONS:
            raise InputError("modulation", got=self.modulation, allowed="analog, digital, bus, or nothing")
        if self.modulation == "bus" and self.registers not in REGISTER_FAMILIES:
            raise _no_family(self.registers)
        if self.modulation != "bus" and self.registers:
            raise InputError("registers", got=self.registers, allowed='nothing, for modulation is not "bus"')
        self._check_endless()
        check_voltages("voltage range", self.voltage_min, self.voltage_max)
        if (self.pulse_min is None) != (self.pulse_max is None) or not (self.pulse_min or 0.0) < (self.pulse_max or 1):
            raise InputError("pulse range", got=f"{self.pulse_min} to {self.pulse_max} s",
                             allowed="two pulse widths, the shorter one first")
        if self.neutral_pulse is not None and self.pulse_min is not None and self.pulse_max is not None \
                and not self.pulse_min < self.neutral_pulse < self.pulse_max:
            raise InputError("neutral pulse", got=self.neutral_pulse, allowed="one inside the pulse range [s]")
        object.__setattr__(self, "points", tuple(self.points))
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))
        object.__setattr__(self, "title", self.title or self.name)
        self._check_points()

    def _check_endless(self) -> None:
        if not self.continuous:
            return
        if self.modulation == "bus":
            raise InputError("continuous", got='modulation "bus"', allowed="analog or digital: the registers of a bus "
                             "servo say whether it turns without end")
        for name in ("travel", "angle_per_pulse", "stop_travel"):
            if getattr(self, name) is not None:
                raise InputError(f"{name.replace('_', ' ')} of a servo that turns without end", got=getattr(self, name),
                                 allowed="none")

    def _check_points(self) -> None:
        if self.main:
            return
        has = {name for point in self.points for name in ("stall_torque", "no_load_speed")
               if getattr(point, name) is not None}
        if not has:
            raise InputError(f"sheet of {self.name!r}", got="neither stall torque nor speed",
                             allowed="both, at one supply voltage at least")
        one = next(iter(has))
        raise InputError(f"sheet of {self.name!r}", got="torque and speed at different voltages" if len(has) == 2
                         else ("torque without speed" if one == "stall_torque" else "speed without torque"),
                         allowed="stall torque and speed at one and the same supply voltage")

    @property
    def own(self) -> tuple[SheetPoint, ...]:
        """All points of the first source, those without torque or speed too: their currents count."""
        return tuple(point for point in self.points if point.source == self.points[0].source)

    @property
    def main(self) -> tuple[SheetPoint, ...]:
        """The complete points of the first source, by rising voltage: they make the servo."""
        return tuple(sorted((point for point in self.own if point.complete), key=lambda point: point.supply_voltage))

    @property
    def others(self) -> tuple[SheetPoint, ...]:
        """The complete points of other sources: they widen its ranges."""
        return tuple(point for point in self.points if point.complete and point.source != self.points[0].source)

    @property
    def nominal(self) -> SheetPoint:
        """The point whose voltage becomes the supply of the servo: that nearest 6 V; of a bus servo the first one."""
        if self.modulation == "bus":
            return next(point for point in self.own if point.complete)
        return min(self.main, key=lambda point: abs(point.supply_voltage - _USUAL_VOLTAGE))

    def at(self, supply_voltage: float) -> Sheet:
        """Return the sheet without the points at other voltages.

        Raises
        ------
        InputError
            If no point with torque and speed has this voltage.
        """
        from dataclasses import replace

        kept = tuple(point for point in self.points if abs(point.supply_voltage - supply_voltage) < 1e-9)
        if not any(point.complete for point in kept):
            raise InputError("supply voltage", got=supply_voltage, allowed=", ".join(
                f"{point.supply_voltage:g}" for point in self.main) + " V, where the sheet has torque and speed")
        return replace(self, points=kept)

    def source_of(self, name: str) -> str:
        """Return where a figure was read."""
        return self.sources.get(name) or self.source or "data sheet"

    def source_at(self, point: SheetPoint) -> str:
        """Return where the figures of a point were read."""
        return point.source or self.source or "data sheet"


def _no_family(registers: str) -> InputError | UnknownNameError:
    """Return the error of a bus servo without registers, or with those of a family that has no table."""
    allowed = (f"{', '.join(REGISTER_FAMILIES)}; of another family (LX-16A, SCS, HTS) no table says what its registers "
               "do: modulation digital makes its motor, its gear and an assumed program that pulses command")
    if not registers:
        return InputError("registers of a bus servo", got="nothing", allowed=allowed)
    return UnknownNameError("family of registers", registers, REGISTER_FAMILIES, allowed=allowed)


def _check(given: SheetPoint | Sheet) -> None:
    at = f" at {given.supply_voltage:g} V" if isinstance(given, SheetPoint) and units.is_finite(
        given.supply_voltage) else ""
    for name, value in _figures(given):
        low, high, unit = _PLAUSIBLE[name]
        if not (units.is_finite(value) and low <= value <= high):
            raise InputError(name.replace("_", " ") + (at if name != "supply_voltage" else ""), got=value,
                             allowed=f"a number from {low:g} to {high:g} {unit}")
        object.__setattr__(given, name, float(value))


def _figures(given: SheetPoint | Sheet) -> Iterator[tuple[str, float]]:
    for f in fields(given):
        value = getattr(given, f.name)
        if f.name in _PLAUSIBLE and value is not None:
            yield f.name, value
