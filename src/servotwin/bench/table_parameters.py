"""From the straight lines of a bench table to the parameters of the servo, each with its standard error."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.bench.table_columns import LineFit, TableFit
from servotwin.datasheet.holding import changed, hold
from servotwin.errors import InputError
from servotwin.models import DigitalServo, PulseServo, default_model
from servotwin.parameters import Quantity, Servo, unit_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from servotwin.bench.load_lines import LoadLine
    from servotwin.models import Model


# --- Numbers of a calibration in words --------------------------------------------------------------------------------

def plus_minus(value: float, error: float) -> str:
    """Return a value with its standard error in units of the last place, two digits of it.

    Examples
    --------
    >>> plus_minus(432.648, 0.841), plus_minus(0.0073244, 0.0000394), plus_minus(-44.13, 1.14), plus_minus(1234.5, 56.0)
    ('432.65(84)', '0.007324(39)', '-44.1(1.1)', '1234(56)')
    """
    if not (math.isfinite(error) and error > 0.0):
        return f"{value:.6g}"
    places = max(1 - math.floor(math.log10(error)), 0)
    shown = f"{error:.{places}f}"
    return f"{value:.{places}f}({shown if float(shown) >= 1.0 else shown.partition('.')[2].lstrip('0')})"


def residual_pattern(x: Sequence[float], residuals: Sequence[float]) -> str:
    """Return what the signs of residuals do along x.

    Examples
    --------
    >>> residual_pattern([0.0, 1.0, 2.0, 3.0, 4.0], [-0.98, 0.64, 0.64, 0.65, -0.95])
    'the ends lie below the line and the middle above it'
    >>> residual_pattern([0.0, 1.0, 2.0, 3.0], [0.1, -0.1, 0.1, -0.1])
    'above and below the line in turn'
    """
    ordered = [r for _, r in sorted(zip(x, residuals, strict=True))]
    least = 1e-9 * max(abs(r) for r in ordered)
    signs = [math.copysign(1.0, r) for r in ordered if abs(r) > least]
    if not signs:
        return "all on the line"
    runs = 1 + sum(a != b for a, b in pairwise(signs))
    if runs == 3:
        ends, middle = ("below", "above") if signs[0] < 0.0 else ("above", "below")
        return f"the ends lie {ends} the line and the middle {middle} it"
    if runs == len(signs):
        return "above and below the line in turn"
    return f"{runs} runs of one sign among {len(signs)} points: no pattern"


# --- From the straight lines of a bench table to the parameters of the servo, each with its standard error ------------

_P, _B_O = "potentiometer.feedback_gain", "potentiometer.feedback_offset"
_TITLES = {"V_o": "feedback voltage", "q": "output angle", "t_a": "pulse width", "V_i": "command voltage"}
_SI = {"°": math.pi / 180.0, "µs": 1e-6}  # units of a table that are not SI


class Estimate(NamedTuple):
    """A value in SI, its standard error, and how it was found."""

    value: float
    error: float
    how: str

    def quantity(self, name: str, source: str) -> Quantity:
        """Return it as a measured parameter."""
        return Quantity(value=self.value, unit=unit_of(name), origin="measured", std=self.error,
                        source=f"{source}, least squares: {self.how}")


def with_measured(servo: Servo, found: Mapping[str, Quantity]) -> Servo:
    """Return a servo with measured parameters in place, by dotted name, in SI."""
    values = servo.replace({name: quantity.value for name, quantity in found.items()})
    return replace(values, quantities={**values.quantities, **found})


def estimates(lines: Mapping[str, TableFit], servo: Servo | None) -> dict[str, Estimate]:
    """Return the parameters that the lines determine, by dotted name, in SI.

    Without feedback voltages, angles take their place where the servo gives its potentiometer: v_o = p q + b_o.

    Parameters
    ----------
    lines : mapping
        By name, such as ``"V_o(q)"``, in °, µs and V.
    servo : Servo or None
        Read for its potentiometer where the table has no feedback voltage.

    Raises
    ------
    InputError
        If a line falls that must rise.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import table_fits
    >>> found = estimates(table_fits(st.load_dataset("urrea-kern-table-2").columns), None)
    >>> round(found["potentiometer.feedback_gain"].value, 4), round(found["electronics.one_shot_offset"].error, 7)
    (0.4197, 1.29e-05)
    """
    _check_signs(lines)
    in_si = {name: fit.line.scaled(_SI.get(fit.x_column.unit, 1.0), _SI.get(fit.unit, 1.0))
             for name, fit in lines.items()}
    found: dict[str, Estimate] = {}
    if (line := in_si.get("V_o(q)")) is not None:
        found |= _of_line(line, _P, _B_O, "V_o over q")
    if (line := in_si.get("t_a(V_i)")) is not None:
        found |= _of_line(line, "electronics.voltage_to_pulse_gain", "electronics.command_pulse_offset", "t_a over V_i")
    read, more = "V_o", ""
    if "V_o(t_a)" not in lines and "V_o(V_i)" not in lines and servo is not None:
        p, b_o = servo.get(_P), servo.get(_B_O)
        if isinstance(p, float) and isinstance(b_o, float):
            error_p, error_b = (servo.source(name).std or 0.0 for name in (_P, _B_O))
            in_si |= {name.replace("q", "V_o"): _voltage(in_si[name], p, error_p, b_o, error_b)
                      for name in ("q(t_a)", "q(V_i)") if name in in_si}
            read, more = "q", f" with feedback_gain {p:.5g} V/rad of the servo"
    return found | _of_voltages(in_si, f"{read} over t_a{more}", f"{read} over V_i{more}")


def _check_signs(lines: Mapping[str, TableFit]) -> None:
    for fit in lines.values():
        what = [_TITLES.get(column.symbol) for column in (fit.x_column, fit.y_column)]
        if None not in what and not fit.line.slope > 0.0:
            raise InputError(f"{what[1]} over {what[0]}, {fit.y_column.name} over {fit.x_column.name}",
                             got=f"a slope of {fit.line.slope:.4g} {fit.slope_unit}",
                             allowed="a rising line (count angles the other way round where they fall)")


def _of_line(line: LineFit, gain: str, offset: str, how: str) -> dict[str, Estimate]:
    return {gain: Estimate(line.slope, line.slope_error, how),
            offset: Estimate(line.intercept, line.intercept_error, how)}


def _voltage(angle: LineFit, p: float, error_p: float, b_o: float, error_b: float) -> LineFit:
    """Return the line of v_o = p q + b_o for one of q; the errors of p and b_o enter as its own do."""
    a, c = angle.slope, angle.intercept
    return LineFit(
        slope=p * a, intercept=p * c + b_o, slope_error=math.hypot(p * angle.slope_error, a * error_p),
        intercept_error=math.sqrt((p * angle.intercept_error) ** 2 + (c * error_p) ** 2 + error_b**2),
        covariance=p**2 * angle.covariance + a * c * error_p**2, residuals=(), freedom=angle.freedom)


def _of_voltages(lines: Mapping[str, LineFit], over_t_a: str, over_v_i: str) -> dict[str, Estimate]:
    found: dict[str, Estimate] = {}
    if (line := lines.get("V_o(t_a)")) is not None:
        s_r, b_t, error_s = line.slope, line.intercept, line.slope_error
        variance = (line.intercept_error**2 + (b_t / s_r * error_s) ** 2 - 2.0 * b_t / s_r * line.covariance) / s_r**2
        found |= {
            "electronics.pulse_to_voltage_gain": Estimate(s_r, error_s, over_t_a),
            "electronics.one_shot_slope": Estimate(1.0 / s_r, error_s / s_r**2, f"1/s_r of {over_t_a}"),
            "electronics.one_shot_offset": Estimate(-b_t / s_r, math.sqrt(variance), f"-b_t/s_r of {over_t_a}")}
    if (line := lines.get("V_o(V_i)")) is not None:
        found["electronics.command_offset"] = Estimate(line.intercept, line.intercept_error, over_v_i)
    return found


# --- From how far loads pull a servo off its goal to the gain of its loop, by the servo's own simulation at -----------

_FURTHEST = 8.0  # times the gain of the servo, either way
_STEP = 1.2  # of the gain, for its derivative
_VAGUE = 0.5  # of a gain: a larger standard error tells nothing
_MOST_LOADS = 6  # that are simulated: those of the table, or so many of them


def gain_of_sag(servo: Servo, sag: LoadLine) -> tuple[str, Estimate] | str:
    """Return the gain with which a servo gives way to loads as a table says; a sentence where none does.

    Deadband, friction and frame of the servo are kept: they are what the first sag is made of.

    Parameters
    ----------
    servo : Servo
    sag : LoadLine
        Angle error over load.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            model = default_model(servo)
        except ValueError as error:
            return f"the gain of the loop stays: {error}"
    name = "firmware.proportional_gain" if isinstance(model, DigitalServo) else "electronics.stretcher_gain"
    now = model.servo.get(name)
    if not isinstance(model, DigitalServo | PulseServo) or not isinstance(now, float) or not now > 0.0:
        return f"the gain of the loop stays: {type(model).__name__} of this servo has none that a sag could tell"
    loads = np.unique(sag.x.values[sag.rows])
    if loads.size > _MOST_LOADS:
        loads = np.quantile(loads, np.linspace(0.0, 1.0, _MOST_LOADS))
    wanted = sag.line.slope

    def off(log_gain: float) -> float:
        return math.log(_compliance(changed(model, {name: math.exp(log_gain)}), loads) / wanted)

    middle = math.log(now)
    found = _root(off, middle, math.log(_FURTHEST))
    if found is None:
        own = _compliance(model, loads)
        does = "" if math.isnan(own) else f"; with its {now:.4g} the servo does by {math.degrees(own):.3g}"
        return (f"{name} stays: no value from {now / _FURTHEST:.3g} to {now * _FURTHEST:.3g} gives way by "
                f"{math.degrees(wanted):.3g} ° per N m{does}")
    rate = (off(found + math.log(_STEP)) - off(found - math.log(_STEP))) / (2.0 * math.log(_STEP))
    if not math.isfinite(rate) or rate == 0.0:
        return f"{name} stays: loads of this size do not tell it"
    gain = math.exp(found)
    spread = gain * sag.line.slope_error / wanted / abs(rate)
    if spread > _VAGUE * gain:
        return (f"{name} stays: the table tells it to {100.0 * spread / gain:.0f} % only, {gain:.3g} ± {spread:.2g}; "
                "more or larger loads would tell it")
    return name, Estimate(gain, spread, "sag over load, by simulating the servo at rest; deadband, friction and frame "
                                       "of the servo")


def _compliance(model: Model, loads: NDArray[np.float64]) -> float:
    """Return how much a servo gives way per torque [rad/(N m)]; nan where it does not stand."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        errors = [hold(model, load).error for load in loads.tolist()]
    slope = float(np.polyfit(loads, errors, 1)[0]) if np.isfinite(errors).all() else math.nan
    return slope if slope > 0.0 else math.nan


def _root(off: Callable[[float], float], middle: float, furthest: float) -> float | None:
    """Return where a falling function is 0, walking from the middle outwards; None where it is not within reach."""
    from scipy.optimize import brentq

    low = off(middle)
    if math.isnan(low):
        return None
    at, step = middle, math.copysign(math.log(1.6), low)
    while abs(at + step - middle) <= furthest + 1e-9:
        after = off(at + step)
        if math.isnan(after):
            return None
        if (after > 0.0) != (low > 0.0):
            return float(brentq(off, min(at, at + step), max(at, at + step), xtol=1e-2))
        at += step
    return None
