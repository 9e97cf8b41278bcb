"""From the straight lines of a bench table to the parameters of the servo, each with its standard error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from servotwin.bench.fits import TableFit
from servotwin.errors import InputError
from servotwin.parameters import Quantity, Servo, unit_of

_P, _B_O = "potentiometer.feedback_gain", "potentiometer.feedback_offset"
_TITLES = {"V_o": "feedback voltage", "q": "output angle", "t_a": "pulse width", "V_i": "command voltage"}
_DEG = math.pi / 180.0
_MICRO = 1e-6


class Estimate(NamedTuple):
    """A value in SI, its standard error, and how it was found."""

    value: float
    error: float
    how: str

    def quantity(self, name: str, source: str) -> Quantity:
        """Return it as a measured parameter."""
        return Quantity(value=self.value, unit=unit_of(name), origin="measured", std=self.error,
                        source=f"{source}, least squares: {self.how}")


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
    found: dict[str, Estimate] = {}
    if (fit := lines.get("V_o(q)")) is not None:
        found[_P] = Estimate(fit.line.slope / _DEG, fit.line.slope_error / _DEG, "V_o over q")
        found[_B_O] = Estimate(fit.line.intercept, fit.line.intercept_error, "V_o over q")
    if (fit := lines.get("t_a(V_i)")) is not None:
        found["electronics.voltage_to_pulse_gain"] = Estimate(
            _MICRO * fit.line.slope, _MICRO * fit.line.slope_error, "t_a over V_i")
        found["electronics.command_pulse_offset"] = Estimate(
            _MICRO * fit.line.intercept, _MICRO * fit.line.intercept_error, "t_a over V_i")
    found |= _of_voltages(lines)
    if "V_o(t_a)" not in lines and "V_o(V_i)" not in lines and servo is not None:
        found |= _of_angles(lines, servo)
    return found


def _check_signs(lines: Mapping[str, TableFit]) -> None:
    for name in ("V_o(q)", "q(t_a)", "V_o(t_a)", "t_a(V_i)", "q(V_i)", "V_o(V_i)"):
        if name in lines and not lines[name].line.slope > 0.0:
            fit = lines[name]
            over = f"{_TITLES[name.partition('(')[0]]} over {_TITLES[name.partition('(')[2][:-1]]}"
            raise InputError(f"{over}, {fit.ordinate} over {fit.abscissa}",
                             got=f"a slope of {fit.line.slope:.4g} {fit.slope_unit}",
                             allowed="a rising line (count angles the other way round where they fall)")


def _of_voltages(lines: Mapping[str, TableFit]) -> dict[str, Estimate]:
    found: dict[str, Estimate] = {}
    if (fit := lines.get("V_o(t_a)")) is not None:
        s_r, b_t = fit.line.slope / _MICRO, fit.line.intercept
        error_s, error_b, covariance = fit.line.slope_error / _MICRO, fit.line.intercept_error, \
            fit.line.covariance / _MICRO
        found["electronics.pulse_to_voltage_gain"] = Estimate(s_r, error_s, "V_o over t_a")
        found["electronics.one_shot_slope"] = Estimate(1.0 / s_r, error_s / s_r**2, "1/s_r of V_o over t_a")
        variance = (error_b**2 + (b_t / s_r * error_s) ** 2 - 2.0 * b_t / s_r * covariance) / s_r**2
        found["electronics.one_shot_offset"] = Estimate(-b_t / s_r, math.sqrt(variance), "-b_t/s_r of V_o over t_a")
    if (fit := lines.get("V_o(V_i)")) is not None:
        found["electronics.command_offset"] = Estimate(fit.line.intercept, fit.line.intercept_error, "V_o over V_i")
    return found


def _of_angles(lines: Mapping[str, TableFit], servo: Servo) -> dict[str, Estimate]:
    """Return the same with v_o = p q + b_o of a servo; its errors enter as those of the table's own do."""
    p, b_o = servo.get(_P), servo.get(_B_O)
    if not isinstance(p, float) or not isinstance(b_o, float):
        return {}
    error_p, error_b = (servo.source(name).std or 0.0 for name in (_P, _B_O))
    found: dict[str, Estimate] = {}
    if (fit := lines.get("q(t_a)")) is not None:
        a, c = fit.line.slope * _DEG / _MICRO, fit.line.intercept * _DEG
        error_a, error_c, both = fit.line.slope_error * _DEG / _MICRO, fit.line.intercept_error * _DEG, \
            fit.line.covariance * _DEG**2 / _MICRO
        how = f"q over t_a with feedback_gain {p:.5g} V/rad of the servo"
        slope = 1.0 / (p * a)
        found["electronics.pulse_to_voltage_gain"] = Estimate(p * a, math.hypot(p * error_a, a * error_p), how)
        found["electronics.one_shot_slope"] = Estimate(slope, slope * math.hypot(error_a / a, error_p / p), how)
        # T_0 = −c/a − b_o/(p a)
        of_a, of_c, of_p, of_b = c / a**2 + b_o * slope / a, -1.0 / a, b_o * slope / p, -slope
        variance = ((of_a * error_a) ** 2 + (of_c * error_c) ** 2 + 2.0 * of_a * of_c * both
                    + (of_p * error_p) ** 2 + (of_b * error_b) ** 2)
        found["electronics.one_shot_offset"] = Estimate(-c / a - b_o * slope, math.sqrt(variance), how)
    if (fit := lines.get("q(V_i)")) is not None:
        c, error_c = fit.line.intercept * _DEG, fit.line.intercept_error * _DEG
        found["electronics.command_offset"] = Estimate(
            p * c + b_o, math.sqrt((p * error_c) ** 2 + (c * error_p) ** 2 + error_b**2),
            f"q over V_i with feedback_gain {p:.5g} V/rad of the servo")
    return found
