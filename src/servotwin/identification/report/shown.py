"""The numbers of a fit as people read them: each with its unit, and to the digits that its interval allows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from servotwin import units
from servotwin.identification.fitting.free import LUMPED, nominal
from servotwin.identification.fitting.holdout import fit_percent
from servotwin.look import figure_in, label_of, readable, unit_for
from servotwin.studies import dimension_of

if TYPE_CHECKING:
    from servotwin.identification.fitting.fit import Fit, Interval, Trace
    from servotwin.identification.fitting.holdout import ErrorTable

_LUMPED = {"output_torque_constant": "torque per current", "output_inertia": "inertia",
           "output_coulomb_torque": "torque"}
_NUISANCE = {"delay": "time", "angle_offset": "angle", "angle_sag": "angle", "frame_period": "time"}
_PER = {"angle_sag": "/V"}  # after the unit of the dimension
_SENSOR = {"output_angle": "angle", "feedback_voltage": "voltage", "armature_current": "current",
           "supply_current": "current"}
MODELS = {"BoundedServo": "bounded servo", "PulseServo": "pulse servo", "PulseServoInductive": "inductive pulse servo",
          "M1": "M1: Coulomb, viscous"}
"""Names of the columns of an error table, in words; others are words already."""


@dataclass(frozen=True)
class Line:
    """One estimate in words.

    Parameters
    ----------
    name : str
    value, lower, upper, sheet : str
        Numbers in the unit, "–" where there is none; `sheet` is what the servo said before.
    unit : str
        As it is printed.
    method : str
        How the interval was found: "normal", "profile", "linearised", "at bound", "undetermined"
        or "not sought".
    nuisance : bool
        Whether it belongs to the rig and not to the servo.
    prior : str
        How much of the interval is prior: a share, "–" where there is no interval, or "dropped".
    """

    name: str
    value: str
    lower: str
    upper: str
    sheet: str
    unit: str
    method: str
    nuisance: bool
    prior: str = "–"

    @property
    def interval(self) -> str:
        """Both ends, or why there are none.

        Examples
        --------
        >>> Line("delay", "20.1", "19.8", "20.4", "–", "ms", "normal", True).interval
        '19.8 to 20.4'
        """
        return self.method if self.lower == "–" or self.upper == "–" else f"{self.lower} to {self.upper}"


def dimension_of_free(name: str) -> str:
    """Return the dimension (of `servotwin.units`) of a searched name or a nuisance.

    Examples
    --------
    >>> dimension_of_free("output_inertia"), dimension_of_free("delay"), dimension_of_free("motor.armature_resistance")
    ('inertia', 'time', 'resistance')
    """
    if name in LUMPED:
        return _LUMPED[name]
    return _NUISANCE[name] if name in _NUISANCE else dimension_of(name)


def estimate_lines(fit: Fit) -> tuple[Line, ...]:
    """Return all estimates in words, in the order of the fit."""
    found = fit.intervals()
    return tuple(_line(fit, name, found[name]) for name in fit.names)


def _line(fit: Fit, name: str, interval: Interval) -> Line:
    dimension, value = dimension_of_free(name), fit.estimates[name]
    sheet = nominal_of(fit, name)
    unit = unit_for(value or sheet or 0.0, dimension)
    method = "not sought" if fit.doubt is None and interval.method == "undetermined" else interval.method
    within = 0.5 * (interval.upper - interval.lower)
    shown, lower, upper = (figure_in(float(x), unit, dimension, within=float(within))
                           for x in (value, interval.lower, interval.upper))
    said = "–" if sheet is None else figure_in(sheet, unit, dimension)
    return Line(name, shown, lower, upper, said, label_of(unit) + _PER.get(name, ""), method, name in _NUISANCE,
                _prior(fit, name))


def _prior(fit: Fit, name: str) -> str:
    """Return in words how much of what is known of a number is prior."""
    if any(one.name == name for one in fit.yielded):
        return "dropped"
    share = fit.prior_share.get(name, math.nan)
    return f"{100.0 * share:.0f} %" if math.isfinite(share) else "–"


def nominal_of(fit: Fit, name: str) -> float | None:
    """Return what the servo said of a searched parameter before the fit (SI); None where it said nothing."""
    if name in _NUISANCE:
        return None
    if name.startswith("load."):
        return next((p.start for p in fit.space.parameters if p.name == name), None)
    return nominal(fit.space.servo, name)


def rig_text(name: str, value: float) -> str:
    """Return a nuisance that all logs share, in words.

    Examples
    --------
    >>> rig_text("angle_offset", 0.0174532925), rig_text("delay", 0.02)
    ('angle offset 1°', 'delay 20 ms')
    """
    return f"{name.replace('_', ' ')} {readable(value, _NUISANCE[name])}{_PER.get(name, '')}"


def sensor_shown(name: str) -> tuple[float, str]:
    """Return by what a sensor's values (SI) are multiplied to be shown, and the unit.

    Examples
    --------
    >>> sensor_shown("feedback_voltage"), sensor_shown("output_angle")[1]
    ((1.0, 'V'), '°')
    """
    dimension = sensor_dimension(name)
    unit = "deg" if dimension == "angle" else units.si_unit(dimension)
    return 1.0 / units.factor(unit, dimension), label_of(unit)


def sensor_dimension(name: str) -> str:
    """Return the dimension (of `servotwin.units`) of a measured signal."""
    return _SENSOR[name]


def error_unit(name: str) -> tuple[float, str]:
    """Return by what errors of a sensor (SI) are multiplied to be shown, and the unit.

    Examples
    --------
    >>> error_unit("feedback_voltage")
    (1000.0, 'mV')
    """
    factor, unit = sensor_shown(name)
    return (factor, unit) if unit == "°" else (1e3 * factor, f"m{unit}")


def error_shown(traces: Iterable[Trace]) -> tuple[float, str]:
    """Return by what errors of these logs are multiplied to be shown, and the unit."""
    names = {trace.signal for trace in traces}
    return error_unit(names.pop()) if len(names) == 1 else (1.0, "rad or V")


class ErrorRow(NamedTuple):
    """Rms errors (SI) and fits [%] of the logs with one value of a label, by model; `which` logs, as "held out"."""

    value: str
    which: str
    errors: Mapping[str, float]
    fits: Mapping[str, float]


def tables_of(fit: Fit) -> dict[str, ErrorTable]:
    """Return the error tables of a fit that hold any log, with what to call their logs."""
    both = {"held out": fit.holdout, "fitted": fit.training}
    return {which: table for which, table in both.items() if table}


def error_rows(tables: Mapping[str, ErrorTable], label: str) -> list[ErrorRow]:
    """Return the rms errors by the values of a label, those of one value next to each other."""
    rows = []
    found = {which: (table.by(label), table.by(label, fit_percent)) for which, table in tables.items()}
    for value in dict.fromkeys(key for by, _ in found.values() for key in by):
        rows += [ErrorRow(value, which, by[value], fits[value]) for which, (by, fits) in found.items() if value in by]
    return rows


def percent(value: float) -> str:
    """Return a fit in per cent, to where it differs from 100; "–" where it is not known.

    Examples
    --------
    >>> percent(98.123), percent(99.9912), percent(-310.2), percent(float("nan"))
    ('98.1', '99.991', '-310', '–')
    """
    if not math.isfinite(value):
        return "–"
    digits = 1 if value < 99.0 else min(2 - math.floor(math.log10(max(100.0 - value, 1e-6))), 6)
    return f"{value:.{digits}f}" if value > -100.0 else f"{value:.0f}"


def share_text(value: float) -> str:
    """Return a share in per cent.

    Examples
    --------
    >>> share_text(0.0312), share_text(float("nan")), share_text(12.0)
    ('3.1 %', '–', '1200 %')
    """
    if not math.isfinite(value):
        return "–"
    return f"{100.0 * value:.2g} %" if abs(value) < 1.0 else f"{100.0 * value:.0f} %"
