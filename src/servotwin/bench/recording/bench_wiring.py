"""The wires between servo and board: from counts of the converter to volts and amperes, each number with its origin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from servotwin.bench.table_columns import LineFit, fit_line
from servotwin.bench.wire.frames import protocol
from servotwin.errors import InputError, UnknownNameError
from servotwin.parameters import Quantity, write_file
from servotwin.text import load_toml

# --- The wires between servo and board --------------------------------------------------------------------------------

FULL = 1024  # counts of the converter
_REFERENCE = {"external": 2.5, "supply": 5.0, "internal": 1.1}  # V; LM336Z-2.5, USB, ATmega328P's sheet
_UNITS = {"reference_voltage": "V", "tap_ratio": "V/V", "supply_ratio": "V/V", "shunt_gain": "V/A", "shunt_zero": "V"}
_KEYS = ("reference", "channels", *_UNITS)
_VALUE_KEYS = ("value", "unit", "origin", "source", "std")


def _assumed(value: float, unit: str, source: str) -> Quantity:
    return Quantity(value=value, unit=unit, origin="assumed", source=source)


_REFERENCE_VOLTAGE = _assumed(2.5, "V", "nominal, of an LM336Z-2.5 or TL431 at AREF")
_TAP_RATIO = _assumed(1.0, "V/V", "tap wired straight to A0")
_SUPPLY_RATIO = _assumed(4.0, "V/V", "divider of 30 kohm and 10 kohm, nominal")
_SHUNT_GAIN = _assumed(1.0, "V/A", "0.05 ohm and an amplifier of gain 20, nominal")
_SHUNT_ZERO = _assumed(0.0, "V", "no offset")


@dataclass(frozen=True, kw_only=True)
class Wiring:
    """The wires of the board, and by which numbers.

    Parameters
    ----------
    reference : {"external", "supply", "internal"}
        Of the converter.
    reference_voltage : Quantity
        [V]
    channels : tuple of str
        Those that are wired, of "tap", "shunt", "supply", "command".
    tap_ratio, supply_ratio : Quantity
        Volts at the potentiometer's tap, at the servo's supply, for one volt at the pin [V/V].
    shunt_gain, shunt_zero : Quantity
        Volts at the pin for one ampere [V/A], and without current [V].

    Raises
    ------
    InputError
        If a number is not positive, or a name is unknown.

    Examples
    --------
    >>> wiring = Wiring()
    >>> round(wiring.value("tap", 512), 4), round(wiring.value("supply", 600), 3)
    (1.2512, 5.864)
    """

    reference: str = "external"
    reference_voltage: Quantity = _REFERENCE_VOLTAGE
    channels: tuple[str, ...] = ("tap", "shunt", "supply")
    tap_ratio: Quantity = _TAP_RATIO
    supply_ratio: Quantity = _SUPPLY_RATIO
    shunt_gain: Quantity = _SHUNT_GAIN
    shunt_zero: Quantity = _SHUNT_ZERO

    def __post_init__(self) -> None:
        if self.reference not in _REFERENCE:
            raise UnknownNameError("reference of the converter", str(self.reference), _REFERENCE)
        for name in self.channels:
            if name not in protocol().words["channels"]:
                raise UnknownNameError("channel", str(name), protocol().words["channels"])
        if not self.channels:
            raise InputError("channels", got="none", allowed="at least one")
        for name, unit in _UNITS.items():
            value = getattr(self, name).value
            if not (isinstance(value, float) and math.isfinite(value) and (value > 0.0 or name == "shunt_zero")):
                raise InputError(f"wiring: {name}", got=value, allowed=f"a positive number [{unit}]")

    @property
    def mask(self) -> int:
        """The channels as the board takes them."""
        return sum(1 << protocol().words["channels"][name] for name in self.channels)

    @property
    def order(self) -> tuple[str, ...]:
        """The channels in the order in which the board reads them."""
        return tuple(sorted(self.channels, key=lambda name: protocol().words["channels"][name]))

    def pin_voltage(self, count: float) -> float:
        """Return the voltage in the middle of a count [V]."""
        return (count + 0.5) * _number(self.reference_voltage) / FULL

    def value(self, channel: str, count: float) -> float:
        """Return what a count of a channel means: volts at tap, supply and command, amperes at the shunt."""
        volts = self.pin_voltage(count)
        if channel == "shunt":
            return (volts - _number(self.shunt_zero)) / _number(self.shunt_gain)
        return volts * {"tap": _number(self.tap_ratio), "supply": _number(self.supply_ratio)}.get(channel, 1.0)

    def pin(self, channel: str, value: float) -> float:
        """Return the voltage at the pin for a value of a channel [V]; the inverse of `value` but for the rounding."""
        if channel == "shunt":
            return value * _number(self.shunt_gain) + _number(self.shunt_zero)
        return value / {"tap": _number(self.tap_ratio), "supply": _number(self.supply_ratio)}.get(channel, 1.0)

    def replace(self, **changes: Any) -> Wiring:
        """Return a wiring with other values."""
        return replace(self, **changes)

    def facts(self) -> dict[str, Any]:
        """Return all of it in plain words and numbers."""
        made: dict[str, Any] = {"reference": self.reference, "channels": list(self.channels)}
        for name in _UNITS:
            one = getattr(self, name)
            made[name] = {key: getattr(one, key) for key in _VALUE_KEYS if getattr(one, key) is not None}
        return made

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write it as a TOML file.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        import tomlkit

        text = tomlkit.document()
        text.add(tomlkit.comment("Wires of a servo's bench; servotwin bench calibrate writes what it measures here."))
        for key, value in self.facts().items():
            if isinstance(value, dict):
                table = tomlkit.inline_table()
                table.update(value)
                text[key] = table
            else:
                text[key] = value
        write_file(path, tomlkit.dumps(text).encode(), overwrite=overwrite)


def nominal_wiring(reference: str) -> Wiring:
    """Return the wiring of the guide with this reference of the converter.

    Examples
    --------
    >>> nominal_wiring("supply").reference_voltage.value
    5.0
    """
    if reference not in _REFERENCE:
        raise UnknownNameError("reference of the converter", str(reference), _REFERENCE)
    return Wiring(reference=reference, reference_voltage=_assumed(_REFERENCE[reference], "V", "nominal"))


def load_wiring(path: str | Path) -> Wiring:
    """Return the wiring that a file says; what it leaves out is as in `Wiring`.

    Raises
    ------
    InputError
        If it cannot be read, or says something wrong: names file and key.
    """
    path = Path(path)
    try:
        content = load_toml(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    made: dict[str, Any] = {}
    for key, value in content.items():
        if key not in _KEYS:
            raise InputError(f"{path}: {UnknownNameError('key', key, _KEYS)}")
        made[key] = _quantity(path, key, value) if key in _UNITS else tuple(value) if key == "channels" else value
    try:
        return replace(nominal_wiring(content.get("reference", "external")), **made)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _quantity(path: Path, key: str, value: object) -> Quantity:
    if isinstance(value, bool) or not isinstance(value, Mapping | int | float):
        raise InputError(f"{path}: {key}", got=value, allowed="a number, or { value, unit, origin, source, std }")
    said: dict[str, Any] = dict(value) if isinstance(value, Mapping) else {"value": value}
    wrong = [name for name in said if name not in _VALUE_KEYS]
    if wrong or not isinstance(said.get("value"), int | float):
        raise InputError(f"{path}: {key}", got=wrong[0] if wrong else said.get("value"),
                         allowed=", ".join(_VALUE_KEYS) if wrong else "a number as value")
    if said.setdefault("unit", _UNITS[key]) != _UNITS[key]:
        raise InputError(f"{path}: {key}: unit", got=said["unit"], allowed=_UNITS[key])
    said["value"] = float(said["value"])
    said.setdefault("origin", "assumed")
    try:
        return Quantity(**said)
    except (InputError, TypeError) as error:
        raise InputError(f"{path}: {key}: {error}") from None


def _number(quantity: Quantity) -> float:
    return float(quantity.value)  # type: ignore[arg-type]


SIGNALS = {"tap": "feedback_voltage_V", "shunt": "supply_current_A", "supply": "bus_voltage_V",
           "command": "command_pin_V"}
"""Column of a log for each channel; that of the command is no signal of a log."""


# --- Calibration of the wires by a multimeter: reference of the converter, divider, shunt, each with its error --------

FEWEST = 3  # points: a line, and how far they are off it
CHANNEL = {"reference": "command", "supply": "supply", "shunt": "shunt"}
"""Which channel each calibration reads; the reference is measured by a voltage at the pin of the command."""
UNIT = {"reference": "V", "supply": "V", "shunt": "A"}
_SURE = 3.0  # standard errors: a zero further away is reported


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A wiring with what was measured.

    Parameters
    ----------
    wiring : Wiring
    changed : tuple of str
        Its entries that are new.
    line : LineFit
        Through meter and counts.
    remarks : tuple of str
        Findings that are worth a look.
    """

    wiring: Wiring
    changed: tuple[str, ...]
    line: LineFit
    remarks: tuple[str, ...]


def calibrated(wiring: Wiring, what: str, meter: Sequence[float], counts: Sequence[float]) -> Calibration:
    """Return the wiring that a meter's values and the mean counts at the same time say.

    Parameters
    ----------
    wiring : Wiring
    what : {"reference", "supply", "shunt"}
    meter : sequence of float
        Values that the meter showed, at least three, not all alike [V or A].
    counts : sequence of float
        Mean counts of the converter.

    Raises
    ------
    UnknownNameError, InputError
        If there is no such calibration, or its points do not make a line that rises.

    Examples
    --------
    >>> found = calibrated(Wiring(), "supply", [4.8, 6.0, 7.4], [490.6, 613.5, 756.8])
    >>> found.changed, round(found.wiring.supply_ratio.value, 3), found.wiring.supply_ratio.origin
    (('supply_ratio',), 4.0, 'measured')
    """
    if what not in CHANNEL:
        raise UnknownNameError("calibration", what, CHANNEL)
    x, y = np.asarray(meter, dtype=np.float64), np.asarray(counts, dtype=np.float64)
    if len(x) != len(y) or len(x) < FEWEST or not (np.isfinite(x).all() and np.isfinite(y).all()) or not np.ptp(x):
        raise InputError(f"calibration of {what}", got=f"{len(x)} values of the meter",
                         allowed=f"at least {FEWEST} finite ones, not all alike")
    if (y >= FULL - 1).any():
        raise InputError(f"calibration of {what}", got="a count at the end of the converter", allowed="smaller values")
    volts = (y + 0.5) / FULL * (1.0 if what == "reference" else wiring.reference_voltage.value)
    # Both read with an error; the meter's is stated by its maker, the counts' by the line: counts are what scatters
    line = fit_line(x, volts)
    if line.slope <= 0.0:
        raise InputError(f"calibration of {what}", got="counts that fall while the meter rises", allowed="a line up")
    changes, remarks = _changes(what, line)
    return Calibration(wiring=wiring.replace(**changes), changed=tuple(changes), line=line, remarks=remarks)


def _changes(what: str, line: LineFit) -> tuple[dict[str, Quantity], tuple[str, ...]]:
    inverse, error = 1.0 / line.slope, line.slope_error / line.slope**2
    off = abs(line.intercept) > _SURE * line.intercept_error > 0.0
    if what == "shunt":
        return {"shunt_gain": _measured(line.slope, "V/A", line.slope_error),
                "shunt_zero": _measured(line.intercept, "V", line.intercept_error)}, ()
    remark = (f"the line does not go through zero: {line.intercept * inverse:+.3g} V, by more than {_SURE:g} standard "
              "errors; look for a loose ground or a loaded divider",) if off else ()
    if what == "supply":
        return {"supply_ratio": _measured(inverse, "V/V", error)}, remark
    return {"reference_voltage": _measured(inverse, "V", error)}, remark


def _measured(value: float, unit: str, std: float) -> Quantity:
    day = datetime.now(UTC).date().isoformat()
    return Quantity(value=value, unit=unit, origin="measured", std=std,
                    source=f"servotwin bench calibrate, {day}; the meter's own error apart")
