"""What a maker prints of a servo: the [sheet] of its file as numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from servotwin import units
from servotwin.errors import ServotwinError
from servotwin.parameters.sheet_table import ELSE, POINT, WHOLE, voltage_range

if TYPE_CHECKING:
    from servotwin.parameters.servo import Servo

_FIGURES = {**POINT, **WHOLE}


@dataclass(frozen=True, kw_only=True)
class PrintedPoint:
    """What is printed for one supply voltage; None is not printed.

    Parameters
    ----------
    supply_voltage : float, optional
        [V].
    stall_torque : float, optional
        [N m].
    time_60 : float, optional
        Time for 60 degrees without load [s].
    no_load_current, stall_current : float, optional
        [A].
    """

    supply_voltage: float | None
    stall_torque: float | None
    time_60: float | None
    no_load_current: float | None
    stall_current: float | None


def printed_fact(table: Mapping[str, Any], key: str) -> float | None:
    """Return a figure of a table of a sheet (SI) by its key in the file, such as "mass"; None where it is not one.

    Unlike `sheet_table.figure`, which computes with it, this shows what is there: a person's own [sheet] may hold
    anything.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> printed_fact(load_servo("towerpro-mg996r").sheet, "mass")
    0.055
    """
    entry = table.get(key)
    if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
        return None
    try:
        value = units.to_si(entry["value"], str(entry.get("unit")), _FIGURES[key][1])
    except ServotwinError:
        return None
    return value if math.isfinite(value) else None


def printed_points(servo: Servo) -> tuple[PrintedPoint, ...]:
    """Return what is printed at each voltage, the sheet's main one first; a voltage may come from several sources.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [point.stall_torque for point in printed_points(load_servo("emax-es08a"))]
    [0.177, 0.147]
    """
    others = servo.sheet.get(ELSE)
    tables = [servo.sheet, *(others if isinstance(others, list) else [])]
    return tuple(_point(table) for table in tables if isinstance(table, Mapping))


def operating_voltages(servo: Servo) -> tuple[float, float] | None:
    """Return the lowest and the highest supply voltage that the maker states for operation; None where not stated [V].

    Raises
    ------
    InputError
        As of `sheet_table.voltage_range`; files are checked when they are read.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [operating_voltages(load_servo(name)) for name in ("towerpro-mg996r", "gobilda-2000-135")]
    [(4.8, 7.2), None]
    """
    return voltage_range(servo.name, servo.sheet)


def sheet_voltages(servo: Servo) -> tuple[float, float] | None:
    """Return the lowest and the highest supply voltage of a sheet; None where it has none [V].

    Those that the maker states for operation, else those that figures are printed for.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [sheet_voltages(load_servo(name)) for name in ("towerpro-mg996r", "gobilda-2000-135")]
    [(4.8, 7.2), (4.8, 7.4)]
    """
    printed = [point.supply_voltage for point in printed_points(servo) if point.supply_voltage]
    return operating_voltages(servo) or ((min(printed), max(printed)) if printed else None)


def printed_flags(servo: Servo) -> tuple[str, ...]:
    """Return what the [sheet] says of itself: what it lacks, and where it contradicts itself.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> printed_flags(servo_from_values("mine", {}))
    ()
    """
    found = servo.sheet.get("flags")
    return tuple(flag for flag in found if isinstance(flag, str)) if isinstance(found, list) else ()


def _point(table: Mapping[str, Any]) -> PrintedPoint:
    return PrintedPoint(
        supply_voltage=printed_fact(table, "supply_voltage"),
        stall_torque=printed_fact(table, "stall_torque"),
        time_60=printed_fact(table, "speed_per_60deg"),
        no_load_current=printed_fact(table, "no_load_current"),
        stall_current=printed_fact(table, "stall_current"))
