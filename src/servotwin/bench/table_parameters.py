"""From the straight lines of a bench table to the parameters of the servo, each with its standard error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from servotwin.bench.table_columns import LineFit, TableFit
from servotwin.errors import InputError
from servotwin.parameters import Quantity, Servo, unit_of

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
