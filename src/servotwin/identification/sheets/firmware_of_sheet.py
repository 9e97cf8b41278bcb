"""The firmware of a digital RC servo: no sheet says any of it, so it is assumed, with wide ranges."""

from __future__ import annotations

import math
from collections.abc import Iterator

from servotwin.identification.sheets.motor_range import Range
from servotwin.identification.sheets.sheet import Sheet
from servotwin.parameters import Quantity, unit_of

_GUESS = "no source: guess for digital servos"
_TURN = 200.0 * math.pi / 180.0  # rad, that the converter of the potentiometer covers
_HALF_DEADBAND = Range(value=1e-6, lower=5e-7, upper=2e-6)  # s
_SIGNAL_TIMEOUT = Range(value=0.2, lower=0.05, upper=1.0)  # s


def digital_firmware(sheet: Sheet, rate: float, said: str) -> Iterator[tuple[str, Quantity]]:
    """Yield the numbers of the group `firmware` by dotted name.

    Parameters
    ----------
    sheet : Sheet
    rate : float
        Angle per pulse width [rad/s].
    said : str
        Where that comes from.
    """
    for name, value, source in (
            ("control_period", Range(value=1e-3, lower=3e-4, upper=3e-3), _GUESS),
            ("compute_delay", Range(value=0.0, lower=0.0, upper=1e-3), _GUESS),
            ("angle_quantum", Range(value=_TURN / 4096, lower=_TURN / 16384, upper=_TURN / 1024),
             f"{_GUESS}: 200 degrees in 12 bits, 14 to 10"),
            ("filter_weight", Range(value=0.2, lower=0.05, upper=0.5), _GUESS),
            _deadband(sheet, rate, said),
            ("proportional_gain", Range(value=8.0, lower=3.0, upper=20.0), _GUESS),
            ("derivative_gain", Range(value=0.05, lower=0.0, upper=0.3), _GUESS),
            ("minimum_duty", Range(value=0.03, lower=0.0, upper=0.1), _GUESS),
            ("signal_timeout", _SIGNAL_TIMEOUT, _GUESS)):
        yield f"firmware.{name}", Quantity(
            value=_six(value.value), lower=_six(value.lower), upper=_six(value.upper), origin="assumed", source=source,
            unit=unit_of(f"firmware.{name}"))
    yield "firmware.signal_loss", Quantity(value="limp", unit="", origin="assumed",
                                           source="no source: most go limp, some hold or fail safe")


def _deadband(sheet: Sheet, rate: float, said: str) -> tuple[str, Range, str]:
    """Return the half width of the dead zone; a sheet may print the full one or the half, and does not say which."""
    w = sheet.deadband
    half = _HALF_DEADBAND if w is None else Range(value=0.5 * w, lower=0.5 * w, upper=w)
    source = f"{_GUESS}: 1 us (0.5 to 2)" if w is None else f"half of the deadband, {sheet.source_of('deadband')}"
    return ("deadband_angle", Range(value=half.value * rate, lower=half.lower * rate, upper=half.upper * rate),
            f"{source}; times {said}")


def _six(x: float) -> float:
    """Return six digits: a guess has no more."""
    return float(f"{x:.6g}")
