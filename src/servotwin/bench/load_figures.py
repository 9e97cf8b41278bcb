"""What the lines of a table of loads say in numbers with intervals, and beside the servo's sheet."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from servotwin.bench.fits import LineFit, wide
from servotwin.bench.load_columns import LoadTable
from servotwin.bench.load_lines import CURRENT, SAG, SPEED, VOLTAGE, LoadLines
from servotwin.parameters import Servo, printed_points

LEVEL = 0.95
NO_LOAD_CURRENT, TORQUE_PER_CURRENT, CURRENT_PER_TORQUE = "no-load current", "torque per current", "current per torque"
NO_LOAD_SPEED, STALL_TORQUE, HEAVIEST = "no-load speed", "stall torque", "heaviest load"
COMPLIANCE, FIRST_SAG, BACK_EMF, FIRST_TURN = (
    "sag per torque", "sag without load", "voltage per speed", "voltage of the first turn")
_SIXTY = math.pi / 3.0


@dataclass(frozen=True, kw_only=True)
class LoadFigure:
    """A number that a table says, in SI.

    Parameters
    ----------
    name : str
    value, error : float
        And its standard error, 0 where it has none.
    lower, upper : float
        Interval of 95 %, by Student's t.
    unit : str
    line : str
        Of which it comes.
    """

    name: str
    value: float
    error: float
    lower: float
    upper: float
    unit: str
    line: str


@dataclass(frozen=True, kw_only=True)
class SheetShare:
    """A measured figure over what the sheet prints.

    Parameters
    ----------
    name : str
    voltage : float or None
        That it is printed for [V].
    printed, measured : float
        In SI; speeds in rad/s.
    share, lower, upper : float
        Measured over printed, with its interval.
    """

    name: str
    voltage: float | None
    printed: float
    measured: float
    share: float
    lower: float
    upper: float


def figures_of(table: LoadTable, found: LoadLines) -> tuple[LoadFigure, ...]:
    """Return the figures of all lines, in the order in which people ask for them.

    Examples
    --------
    >>> from servotwin.bench.load_columns import load_table
    >>> from servotwin.bench.load_lines import load_lines
    >>> table = load_table({"mass_g": [100, 200, 320, 400, 450], "current_mA": [230, 300, 370, 405, 450]}, arm=0.01)
    >>> [(figure.name, round(figure.value, 4)) for figure in figures_of(table, load_lines(table))][1:3]
    [('current per torque', 6.155), ('torque per current', 0.1625)]
    """
    made: list[LoadFigure] = []
    lines = found.lines
    if CURRENT in lines:
        line = lines[CURRENT].line
        made += [_intercept(NO_LOAD_CURRENT, line, "A", CURRENT), _slope(CURRENT_PER_TORQUE, line, "A/(N m)", CURRENT),
                 _inverse(TORQUE_PER_CURRENT, line, "N m/A", CURRENT)]
    if SPEED in lines:
        line = lines[SPEED].line
        made += [_intercept(NO_LOAD_SPEED, line, "rad/s", SPEED), _crossing(STALL_TORQUE, line, "N m", SPEED)]
    if SAG in lines:
        line = lines[SAG].line
        made.append(_slope(COMPLIANCE, line, "rad/(N m)", SAG))
        if not table.relative:
            made.append(_intercept(FIRST_SAG, line, "rad", SAG))
    if VOLTAGE in lines:
        line = lines[VOLTAGE].line
        made += [_inverse(BACK_EMF, line, "V s/rad", VOLTAGE), _crossing(FIRST_TURN, line, "V", VOLTAGE)]
    if table.torque is not None:
        most = float(table.torque.values.max())
        made.append(LoadFigure(name=HEAVIEST, value=most, error=0.0, lower=most, upper=most, unit="N m", line=""))
    return tuple(made)


def _figure(name: str, value: float, error: float, line: LineFit, unit: str, of: str) -> LoadFigure:
    half = wide(error, line.freedom, LEVEL)
    return LoadFigure(name=name, value=value, error=error, lower=value - half, upper=value + half, unit=unit, line=of)


def _slope(name: str, line: LineFit, unit: str, of: str) -> LoadFigure:
    return _figure(name, line.slope, line.slope_error, line, unit, of)


def _intercept(name: str, line: LineFit, unit: str, of: str) -> LoadFigure:
    return _figure(name, line.intercept, line.intercept_error, line, unit, of)


def _inverse(name: str, line: LineFit, unit: str, of: str) -> LoadFigure:
    """Return one over a slope; the ends of its interval are those of the slope, inf where that reaches 0."""
    half = wide(line.slope_error, line.freedom, LEVEL)
    ends = [1.0 / end if end > 0.0 else math.inf for end in (line.slope + half, line.slope - half)]
    return LoadFigure(name=name, value=1.0 / line.slope, error=line.slope_error / line.slope**2, lower=ends[0],
                      upper=ends[1], unit=unit, line=of)


def _crossing(name: str, line: LineFit, unit: str, of: str) -> LoadFigure:
    """Return where a line is 0, with its interval by Fieller's theorem, which holds for few points too."""
    a, s = line.intercept, line.slope
    at = -a / s
    variance = line.intercept_error**2 + at**2 * line.slope_error**2 + 2.0 * at * line.covariance
    error = math.sqrt(max(variance, 0.0)) / abs(s)
    t = wide(1.0, line.freedom, LEVEL)
    # all x with (a + s x)² <= t² (va + 2 x cov + x² vs)
    p, q = s**2 - (t * line.slope_error) ** 2, a * s - t**2 * line.covariance
    r = a**2 - (t * line.intercept_error) ** 2
    inside = q * q - p * r
    if p <= 0.0 or inside < 0.0:
        return LoadFigure(name=name, value=at, error=error, lower=-math.inf, upper=math.inf, unit=unit, line=of)
    ends = sorted(((-q - math.sqrt(inside)) / p, (-q + math.sqrt(inside)) / p))
    return LoadFigure(name=name, value=at, error=error, lower=ends[0], upper=ends[1], unit=unit, line=of)


def shares_of(figures: tuple[LoadFigure, ...], servo: Servo | None) -> tuple[SheetShare, ...]:
    """Return the measured figures over those that the servo's sheet prints, at each of its voltages."""
    return () if servo is None else tuple(_shares({figure.name: figure for figure in figures}, servo))


def _shares(figures: dict[str, LoadFigure], servo: Servo) -> Iterator[SheetShare]:
    torque = figures.get(STALL_TORQUE) or figures.get(HEAVIEST) if COMPLIANCE not in figures else None
    for point in printed_points(servo):
        speed = None if point.time_60 is None else _SIXTY / point.time_60
        for figure, printed in ((torque, point.stall_torque), (figures.get(NO_LOAD_SPEED), speed),
                                (figures.get(NO_LOAD_CURRENT), point.no_load_current)):
            if figure is not None and printed is not None and printed > 0.0:
                yield SheetShare(name=figure.name, voltage=point.supply_voltage, printed=printed,
                                 measured=figure.value, share=figure.value / printed, lower=figure.lower / printed,
                                 upper=figure.upper / printed)
