"""The table [sheet] of a servo file: the figures that a maker prints, each with unit and source."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from servotwin import units
from servotwin.errors import InputError, ServotwinError

ELSE = "also_at"
"""Key of the rows with figures at other voltages and of other sources."""

# key of the file -> name, dimension, unit; a speed is printed as the time for 60 degrees
POINT = {"supply_voltage": ("supply_voltage", "voltage", "V"), "stall_torque": ("stall_torque", "torque", "N m"),
         "speed_per_60deg": ("no_load_speed", "time", "s"), "no_load_current": ("no_load_current", "current", "A"),
         "stall_current": ("stall_current", "current", "A"), "idle_current": ("idle_current", "current", "A")}
WHOLE = {"voltage_min": ("voltage_min", "voltage", "V"), "voltage_max": ("voltage_max", "voltage", "V"),
         "deadband": ("deadband", "time", "us"), "pulse_min": ("pulse_min", "time", "us"),
         "pulse_max": ("pulse_max", "time", "us"), "neutral_pulse": ("neutral_pulse", "time", "us"),
         "travel": ("travel", "angle", "deg"), "travel_per_400us": ("angle_per_pulse", "angle", "deg"),
         "stop_travel": ("stop_travel", "angle", "deg"), "backlash": ("backlash", "angle", "deg"),
         "gear_reduction": ("gear_reduction", "number", "1"), "mass": ("mass", "mass", "g")}
_SPREADS = ("std", "lower", "upper")
_TWO = "two positive voltages, the lower one first"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A printed figure in SI; a speed as such, and not as the time for 60 degrees.

    Parameters
    ----------
    value : float
    source : str
    std, lower, upper : float, optional
        How far servos of this kind scatter about it, where the file says so.
    """

    value: float
    source: str
    std: float | None = None
    lower: float | None = None
    upper: float | None = None


def printed(key: str, value: float) -> float:
    """Return a value (SI) as sheets print it, still in SI; for speeds it is its own inverse.

    Examples
    --------
    >>> round(printed("speed_per_60deg", printed("speed_per_60deg", 4.0)), 12)
    4.0
    """
    return math.pi / 3.0 / value if key == "speed_per_60deg" else value * 400e-6 if key == "travel_per_400us" else value


def figure(servo: str, key: str, entry: Any) -> Figure | None:
    """Return a figure of a table [sheet]; None where it is assumed, written by hand for what is not printed.

    Parameters
    ----------
    servo : str
        Name of the servo, for errors.
    key : str
        One of `POINT` and `WHOLE`.
    entry : mapping
        With value, unit and source; std, or lower and upper, are the spread of the figure.

    Raises
    ------
    InputError
        If it is no figure, or its spread does not fit it.

    Examples
    --------
    >>> found = figure("mine", "speed_per_60deg", {"value": 0.23, "unit": "s", "source": "the box"})
    >>> round(found.value, 3)
    4.553
    """
    _, dimension, unit = {**POINT, **WHOLE}[key]
    if isinstance(entry, Mapping) and str(entry.get("source", "")).startswith("assumed"):
        return None
    try:
        value = units.to_si(float(entry["value"]), str(entry["unit"]), dimension)
        spread = {name: units.to_si(float(entry[name]), str(entry["unit"]), dimension)
                  for name in _SPREADS if name in entry}
        if not math.isfinite(value):
            raise ValueError
    except (KeyError, TypeError, ValueError, ServotwinError):
        raise InputError(f"[sheet] {key} of {servo!r}", got=entry,
                         allowed=f'{{ value = ..., unit = "{unit}", source = "..." }}') from None
    _check_spread(f"[sheet] {key} of {servo!r}", value, spread)
    source = str(entry.get("source", ""))
    if key == "speed_per_60deg" and value > 0.0:
        speed = printed(key, value)
        std = speed * spread["std"] / value if "std" in spread else None
        ends = {new: printed(key, spread[old]) for new, old in (("lower", "upper"), ("upper", "lower"))
                if old in spread}
        return Figure(value=speed, source=source, std=std, **ends)
    by = 400e-6 if key == "travel_per_400us" else 1.0
    return Figure(value=value / by, source=source, **{name: x / by for name, x in spread.items()})


def voltage_range(servo: str, table: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the lowest and the highest supply voltage that a maker states for operation [V]; None where not stated.

    Raises
    ------
    InputError
        If the table has one end only, or one that is no voltage, or the low one is above the high one.

    Examples
    --------
    >>> volts = {"voltage_min": {"value": 4.8, "unit": "V"}, "voltage_max": {"value": 7200, "unit": "mV"}}
    >>> voltage_range("mine", volts)
    (4.8, 7.2)
    """
    low, high = (figure(servo, key, table[key]) if key in table else None for key in ("voltage_min", "voltage_max"))
    check_voltages(f"[sheet] voltage_min and voltage_max of {servo!r}", None if low is None else low.value,
                   None if high is None else high.value)
    return None if low is None or high is None else (low.value, high.value)


def check_voltages(what: str, low: float | None, high: float | None) -> None:
    """Raise an InputError if these are not the two ends of a range of voltages [V], or None both."""
    if low is None or high is None:
        if low is not high:
            raise InputError(what, got="one end alone", allowed=_TWO)
    elif not 0.0 < low <= high:
        raise InputError(what, got=f"{low:g} to {high:g} V", allowed=_TWO)


def _check_spread(what: str, value: float, spread: Mapping[str, float]) -> None:
    std, lower, upper = (spread.get(name) for name in _SPREADS)
    if std is not None and (not 0.0 <= std < math.inf or lower is not None or upper is not None):
        raise InputError(f"{what}: std", got=std, allowed="at least 0, and either std or lower and upper")
    if lower is not None and not 0.0 < lower <= value:
        raise InputError(f"{what}: lower", got=lower, allowed=f"positive and at most the value {value!r} (SI)")
    if upper is not None and not value <= upper < math.inf:
        raise InputError(f"{what}: upper", got=upper, allowed=f"at least the value {value!r} (SI)")
