"""From the lines of a table of loads to the parameters of a servo, by steady motion at full drive.

All at the output shaft, U = V − V_d, R with bridge and source, α = 1 − K_m and γ = 1 + K_e of the gear's load friction:

    α K i = τ_c + b w + γ τ,        U − R i = K w

so that current and speed are straight lines over the load, with the intercepts I_0, w_0 and the slopes s, −c.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.load_lines import CURRENT, SPEED, VOLTAGE, LoadLines
from servotwin.bench.table_parameters import Estimate
from servotwin.parameters import Servo
from servotwin.parameters.output_side import output_value
from servotwin.physics import load_share

_K, _R, _TAU, _MU = "K", "R", "tau_c", "mu"
VOLTAGE_HOW = "speed over voltage"
_SQRT_12 = math.sqrt(12.0)  # width of a range over its standard deviation
_K_A, _K_B = "motor.torque_constant", "motor.back_emf_constant"
_FRICTION = ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward")


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """What a servo is at its output shaft, as far as a table needs it (SI)."""

    N: float
    V: float
    V_d: float
    R: float
    R_more: float  # of bridge and source
    K: float
    tau_c: float
    b: float
    K_m: float
    K_e: float

    @property
    def efficiency(self) -> float:
        """Of the gear that lifts [1]."""
        return (1.0 - self.K_m) / (1.0 + self.K_e)


# what a table cannot tell: field of the circuit -> parameters whose spreads enter, and the power of N
_KEPT = {"V_d": ("supply.bridge_drop_voltage", "motor.brush_drop_voltage"), "tau_c": _FRICTION[:1],
         "b": ("motor.motor_viscous_friction",), "K_m": ("friction.load_friction_motor", "friction.load_friction"),
         "K_e": ("friction.load_friction_external",), "R": ("motor.armature_resistance",), "K": (_K_A,)}
_POWERS = {"tau_c": 1, "b": 2, "K": 1}


class Solved(NamedTuple):
    """Numbers at the output shaft with their standard errors, and what was kept of the servo to find them."""

    values: dict[str, float]
    errors: dict[str, float]
    kept: tuple[str, ...]
    how: str


def circuit_of(servo: Servo, voltage: float | None = None) -> Circuit | None:
    """Return what a servo is at its output shaft; None where its file lacks motor, gear or supply."""
    def value(name: str) -> float:
        found = servo.get(name)
        return float(found) if isinstance(found, int | float) else 0.0

    K, tau_c = (output_value(servo, f"output_{name}") for name in ("torque_constant", "coulomb_torque_forward"))
    R, V = servo.motor.armature_resistance, voltage or servo.supply.open_circuit_voltage
    if K is None or R is None or V is None:
        return None
    one = value("friction.load_friction")
    return Circuit(
        N=value("gear.gear_reduction"), V=V,
        V_d=value("supply.bridge_drop_voltage") + value("motor.brush_drop_voltage"),
        R=R + value("supply.internal_resistance") + value("supply.bridge_drop_resistance"),
        R_more=value("supply.internal_resistance") + value("supply.bridge_drop_resistance"), K=K, tau_c=tau_c or 0.0,
        b=output_value(servo, "output_viscous_friction") or 0.0, K_m=one or value("friction.load_friction_motor"),
        K_e=one or value("friction.load_friction_external"))


def solved(lines: LoadLines, servo: Servo, circuit: Circuit) -> Solved | None:
    """Return the numbers of a servo that make the lines of a table, as many as they tell."""
    found = lines.lines
    names: tuple[str, ...]
    kept: tuple[str, ...]
    law: Law
    if CURRENT in found and SPEED in found:
        names, law, kept, how = (CURRENT, SPEED), _of_both, ("V_d", "b"), "current and speed over load"
    elif CURRENT in found:
        names, law, kept, how = (CURRENT,), _of_current, ("b", "K_m", "K_e"), "current over load"
        if found[CURRENT].line.slope * circuit.K >= 1.0:  # at most 1 with the torque constant as it is
            law, kept = _share_of_current, ("b", "K")
    elif SPEED in found:
        names, law, how = (SPEED,), _of_speed, "speed over load"
        kept = ("V_d", "tau_c", "b", "K_m", "K_e")
    elif VOLTAGE in found:
        names, law, kept, how = (VOLTAGE,), _of_voltage, ("V_d", "R", "b", "K_m"), VOLTAGE_HOW
    else:
        return None
    measured, covariance = _measured(lines, names)
    return _spread(law, measured, covariance, servo, circuit, kept, how)


Law = Callable[[Sequence[float], Circuit], dict[str, float]]


def _share_of_current(m: Sequence[float], of: Circuit) -> dict[str, float]:
    i_0, s = m
    w_0 = max((of.V - of.V_d - of.R * i_0) / of.K, 0.0)
    fall = of.R * s / of.K  # c, as U - R i = K w has it
    mu = (s * of.K - 1.0 + of.b * fall) / (1.0 + s * of.K)
    return {_TAU: (1.0 - mu) * of.K * i_0 - of.b * w_0, _MU: mu}


def _of_current(m: Sequence[float], of: Circuit) -> dict[str, float]:
    i_0, s = m
    alpha, gamma = 1.0 - of.K_m, 1.0 + of.K_e
    fall = of.R * gamma / (alpha * of.K**2 + of.R * of.b)  # c of the servo as it is: matters where b does
    K = (gamma - of.b * fall) / (alpha * s)
    speed = (of.V - of.V_d - of.R * i_0) / of.K
    return {_K: K, _TAU: alpha * K * i_0 - of.b * max(speed, 0.0)}


def _of_speed(m: Sequence[float], of: Circuit) -> dict[str, float]:
    w_0, c = m[0], -m[1]
    alpha, gamma = 1.0 - of.K_m, 1.0 + of.K_e
    left = gamma / c - of.b
    K = (of.V - of.V_d) * left / (w_0 * gamma / c + of.tau_c)
    return {_K: K, _R: alpha * K**2 / left}


def _of_both(m: Sequence[float], of: Circuit) -> dict[str, float]:
    i_0, s, w_0, c = m[0], m[1], m[2], -m[3]
    K = (of.V - of.V_d) / (w_0 + c * i_0 / s)
    mu = (s * K - 1.0 + of.b * c) / (1.0 + s * K)
    return {_K: K, _R: K * c / s, _TAU: (1.0 - mu) * K * i_0 - of.b * w_0, _MU: mu}


def _of_voltage(m: Sequence[float], of: Circuit) -> dict[str, float]:
    v_0, g = -m[0] / m[1], m[1]
    alpha = 1.0 - of.K_m
    K = (1.0 + math.sqrt(max(1.0 - 4.0 * g * g * of.R * of.b / alpha, 0.0))) / (2.0 * g)
    return {_K: K, _TAU: (v_0 - of.V_d) * alpha * K / of.R}


def _measured(lines: LoadLines, names: Sequence[str]) -> tuple[list[float], NDArray[np.float64]]:
    """Return intercepts and slopes, and their covariance."""
    values, covariance = [], np.zeros((2 * len(names), 2 * len(names)))
    for k, name in enumerate(names):
        line = lines.lines[name].line
        values += [line.intercept, line.slope]
        covariance[2 * k:2 * k + 2, 2 * k:2 * k + 2] = [[line.intercept_error**2, line.covariance],
                                                       [line.covariance, line.slope_error**2]]
    return values, covariance


def _spread(law: Law, measured: list[float], covariance: NDArray[np.float64],
            servo: Servo, circuit: Circuit, kept: Sequence[str], how: str) -> Solved:
    """Return what a law finds, with the errors of the lines and those of what it kept of the servo."""
    values = law(measured, circuit)
    steps = np.sqrt(np.diag(covariance)) * 1e-4 + 1e-9 * np.abs(measured)
    rates = np.zeros((len(values), len(measured)))
    for k, step in enumerate(steps.tolist()):
        ends = [law([*measured[:k], measured[k] + sign * step, *measured[k + 1:]], circuit) for sign in (1.0, -1.0)]
        rates[:, k] = [(ends[0][name] - ends[1][name]) / (2.0 * step) for name in values]
    variances = np.einsum("ij,jk,ik->i", rates, covariance, rates)
    for name in kept:
        own = _spread_of(servo, name, circuit)
        if own > 0.0:
            step = 1e-3 * own
            both = ("K_m", "K_e") if name == "K_m" and servo.friction.load_friction is not None else (name,)
            after = law(measured, replace(circuit, **{each: getattr(circuit, each) + step for each in both}))
            variances += np.array([(after[key] - values[key]) / step * own for key in values]) ** 2
    errors = dict(zip(values, np.sqrt(variances).tolist(), strict=True))
    return Solved(values, errors, tuple(kept), how)


def _spread_of(servo: Servo, field: str, circuit: Circuit) -> float:
    """Return the standard deviation of what a servo file gives with a range, at the output shaft."""
    total = 0.0
    for name in _KEPT[field]:
        if servo.get(name) is None:
            continue
        known = servo.source(name)
        if known.std is not None:
            total += known.std**2
        elif known.lower is not None and known.upper is not None:
            total += ((known.upper - known.lower) / _SQRT_12) ** 2
    return math.sqrt(total) * circuit.N ** _POWERS.get(field, 0)


def estimates_of(found: Solved, servo: Servo, circuit: Circuit) -> tuple[dict[str, Estimate], list[str]]:
    """Return the parameters of the servo file that take the numbers, and what could not be taken."""
    values, errors = dict(found.values), found.errors
    made: dict[str, Estimate] = {}
    notes: list[str] = []

    def take(name: str, key: str, what: str) -> None:
        made[name] = Estimate(values[key] / circuit.N, errors[key] / circuit.N, f"{found.how}: {what}")

    if _K in values:
        take(_K_A, _K, "K_out over gear_reduction")
        take(_K_B, _K, "equal to torque_constant")
    if _R in values:
        _take_resistance(values[_R], errors[_R], found.how, circuit, made, notes)
    if _TAU in values:
        if found.how == VOLTAGE_HOW and values[_TAU] < 0.0:
            notes.append("the friction stays: the shaft turns from a voltage on that is below the drop of the servo, "
                         f"{circuit.V_d:.3g} V")
        else:
            values[_TAU] = max(values[_TAU], 0.0)
            both = servo.get(_FRICTION[0]) == servo.get(_FRICTION[1])
            for name in _FRICTION if both else _FRICTION[:1]:
                take(name, _TAU, "K_out I_0 (1 - mu_m) over gear_reduction")
    if _MU in values:
        _take_share(values[_MU], errors[_MU], found.how, servo, made, notes)
    return made, notes


def _take_resistance(R: float, error: float, how: str, circuit: Circuit, made: dict[str, Estimate],
                     notes: list[str]) -> None:
    own = R - circuit.R_more
    if own <= 0.0:
        notes.append(f"armature_resistance stays: the table says {R:.3g} ohm in all, and bridge and source of the "
                     f"servo have {circuit.R_more:.3g} ohm")
        return
    made["motor.armature_resistance"] = Estimate(own, error, f"{how}: R, less that of bridge and source")


def _take_share(mu: float, error: float, how: str, servo: Servo, made: dict[str, Estimate], notes: list[str]) -> None:
    """Put the gear's efficiency into load friction, of one share or of two as the servo has it."""
    if mu < 0.0:
        notes.append(f"the gear would have an efficiency of {load_share(max(mu, -0.9)):.3g}, more than 1: load "
                     "friction stays; is the arm right, and the supply voltage?" if mu < -2.0 * error else
                     "the gear loses nothing that the table could tell: load friction stays")
        return
    two = ("friction.load_friction_motor", "friction.load_friction_external")
    names = two if any(servo.get(name) is not None for name in two) else ("friction.load_friction",)
    for name in names:
        made[name] = Estimate(mu, error, f"{how}: (1 - eta_g)/(1 + eta_g)")


def efficiency_of(found: Mapping[str, float], circuit: Circuit) -> float:
    """Return the efficiency of the gear: of the table where it tells it, else of the servo."""
    return float(load_share(found[_MU])) if _MU in found else circuit.efficiency
