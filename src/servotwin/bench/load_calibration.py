"""A servo from a table of loads, currents, speeds, sags or voltages, as they are measured at home.

All at the output shaft, U = V − V_d, R with bridge and source, α = 1 − K_m and γ = 1 + K_e of the gear's load friction:

    α K i = τ_c + b w + γ τ,        U − R i = K w

so that current and speed are straight lines over the load, with the intercepts I_0, w_0 and the slopes s, −c.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.bench.load_columns import LiftRecord, LoadTable, load_table
from servotwin.bench.load_lines import CURRENT, SAG, SPEED, VOLTAGE, LoadLine, LoadLines, load_lines
from servotwin.bench.table_columns import LineFit, curvature_test, fit_line, wide
from servotwin.bench.table_parameters import Estimate, gain_of_sag, plus_minus, residual_pattern, with_measured
from servotwin.parameters import Quantity, Servo, printed_points
from servotwin.parameters.servo import output_value
from servotwin.physics import load_share
from servotwin.physics.sheet import LEAST_EFFICIENCY

# --- The lines of a table of loads in numbers with intervals, and beside the servo's sheet ----------------------------

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

# --- From the lines of a table of loads to the parameters of a servo, by steady motion at full drive ------------------

_K, _R, _TAU, _MU = "K", "R", "tau_c", "mu"
VOLTAGE_HOW = "speed over voltage"
_SQRT_12 = math.sqrt(12.0)  # width of a range over its standard deviation
_K_A, _K_B = "motor.torque_constant", "motor.back_emf_constant"
_FRICTION = ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward")


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """A servo at its output shaft, as far as a table needs it (SI)."""

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

# --- Sentences on a servo by a table of loads -------------------------------------------------------------------------

_KGF_CM = 0.0980665  # N m
_CURVED = 0.05
_WEAK = 0.6  # of a printed torque: from here down the supply is asked about
_SHOWN = {"A": (1e3, "mA"), "rad/s": (180.0 / math.pi, "°/s"), "rad": (180.0 / math.pi, "°"),
          "rad/(N m)": (180.0 / math.pi, "°/(N m)")}


def shown(value: float, unit: str) -> tuple[float, str]:
    """Return a number in the unit that people read, from SI.

    Examples
    --------
    >>> shown(0.45, "A"), shown(0.5, "N m")
    ((450.0, 'mA'), (0.5, 'N m'))
    """
    factor, name = _SHOWN.get(unit, (1.0, unit))
    return factor * value, name


def torque_words(torque: float) -> str:
    """Return a torque in both units that people have.

    Examples
    --------
    >>> torque_words(0.0441)
    '0.0441 N m (0.45 kgf cm)'
    """
    return f"{torque:.3g} N m ({torque / _KGF_CM:.3g} kgf cm)"


def sheet_words(shares: Sequence[SheetShare], found: LoadLines, voltage: float | None) -> Iterator[str]:
    """Yield how much of its sheet a servo has, figure by figure; of several printed ones the rest in brackets.

    The first is that of the nearest voltage, where somebody said at which the table was made; else the kindest.
    """
    def off(one: SheetShare) -> float:
        if voltage is not None and one.voltage is not None:
            return abs(one.voltage - voltage)
        return abs(math.log(one.share)) if one.share > 0.0 else math.inf

    for name in dict.fromkeys(one.name for one in shares):
        rows = [one for one in shares if one.name == name]
        first = min(rows, key=off)
        also = [f"{100.0 * one.share:.3g} % of {_printed(one)}" for one in rows if one is not first]
        more = f" ({', '.join(also)})" if also else ""
        if name == HEAVIEST:
            sure = found.flat is not None or found.stalled is not None
            yield (f"your servo has {100.0 * first.share:.3g} % of what its sheet says"
                   f"{'' if sure else ', if it stalls there'}: the heaviest load, {torque_words(first.measured)}, "
                   f"beside a stall torque of {_printed(first)}{more}")
            continue
        measured = f"{first.name} {_number(first, first.measured)}"
        yield (f"your servo has {100.0 * first.share:.3g} % ({100.0 * first.lower:.3g} to {100.0 * first.upper:.3g} %) "
               f"of what its sheet says: {measured} beside {_printed(first)}{more}")


def _printed(one: SheetShare) -> str:
    at = "" if one.voltage is None else f" at {one.voltage:g} V"
    return f"{_number(one, one.printed)}{at}"


def _number(one: SheetShare, value: float) -> str:
    if one.name in (STALL_TORQUE, HEAVIEST):
        return torque_words(value)
    number, unit = shown(value, "rad/s" if one.name == "no-load speed" else "A")
    return f"{number:.3g} {unit}"


def line_words(found: LoadLines) -> Iterator[str]:
    """Yield which lines are curved, so that a straight one says less than its interval."""
    for name, one in found.lines.items():
        x, y = one.x.values[one.rows], one.y.values[one.rows]
        if x.size < 5 or len(set(x.tolist())) < 3:
            continue
        test = curvature_test(x, y)
        if test.p_value * len(found.lines) < _CURVED and test.sagitta > max(one.y.step, 1e-9 * abs(float(y.max()))) \
                and not one.y.timed:
            sag, unit = shown(test.sagitta, {CURRENT: "A", SAG: "rad"}.get(name, "rad/s"))
            yield (f"{name} is visibly curved: a parabola fits better with p = {test.p_value:.2g} and bends by "
                   f"{sag:.2g} {unit}; {residual_pattern(x.tolist(), one.line.residuals)}. Numbers beyond the rows are "
                   "then off by more than their intervals")


def supply_words(table: LoadTable, found: LoadLines, shares: Sequence[SheetShare], circuit: Circuit | None
                 ) -> Iterator[str]:
    """Yield the question whether the supply limits the current, where it may."""
    if found.flat is not None:
        load, current = torque_words(found.flat.load), f"{1e3 * found.flat.current:.4g} mA"
        yield (f"from {load} on the current stays at {current}, and these rows are in no line: does the supply give no "
               f"more? Then say --set supply.current_limit={1e3 * found.flat.current:.4g}mA, which belongs to the "
               "bench; if the servo stands there, it is the stall current")
    elif found.stalled is None and CURRENT in found.lines and SPEED not in found.lines and table.current is not None:
        weak = [one for one in shares if one.name == HEAVIEST and one.share < _WEAK]
        most = float(table.current.values.max())
        if weak and circuit is not None:
            yield (f"if the servo stalls at its heaviest load, either the supply gives no more than {1e3 * most:.4g} "
                   f"mA (does it? then --set supply.current_limit={1e3 * most:.4g}mA), or the sheet is wrong and the "
                   f"motor's circuit has {(circuit.V - circuit.V_d) / most:.3g} ohm at {circuit.V:g} V and not "
                   f"{circuit.R:.3g}: a table of load and current cannot tell, a stronger supply can")
    if found.stalled is not None:
        yield f"the shaft stood still from {torque_words(found.stalled)} on; these rows are in no line"


def told_words(found: LoadLines, solved: Solved | None, circuit: Circuit | None) -> Iterator[str]:
    """Yield what the table fixes of the servo, with what is kept, and what it cannot tell."""
    if solved is not None and circuit is not None:
        yield from _told(found, solved, circuit)
    if SAG in found.lines:
        yield ("a sag tells how stiff the loop is where the shaft stands, not what moves it: torque constant and "
               "resistance are not told; lift the weights and read the current or the speed for these")


def _told(found: LoadLines, solved: Solved, circuit: Circuit) -> Iterator[str]:
    values = solved.values
    if CURRENT in found.lines and SPEED in found.lines:
        eta = efficiency_of(values, circuit)
        yield (f"at {circuit.V:g} V and with the drop of {circuit.V_d:.3g} V kept from the servo, speed tells the "
               f"torque constant, {plus_minus(values['K'], solved.errors['K'])} N m/A at the output, and current the "
               f"efficiency of the gear, {eta:.3g}, and the friction; rotor, gains and deadband are not told")
    elif CURRENT in found.lines:
        yield from _told_by_current(found, solved, circuit)
    elif SPEED in found.lines:
        yield (f"at {circuit.V:g} V (another: --set supply.open_circuit_voltage=5V) weights and speeds tell torque "
               f"constant and resistance; kept from the servo are the drop, {circuit.V_d:.3g} V, the friction, "
               f"{circuit.tau_c:.3g} N m, and the efficiency of the gear, {circuit.efficiency:.3g}, which a column of "
               "current would tell; resistance counts bridge, wires and supply")
    elif VOLTAGE in found.lines:
        line = found.lines[VOLTAGE].line
        yield (f"the drop of bridge and brushes and the friction are told as a sum, V_d + R I_0 = "
               f"{-line.intercept / line.slope:.3g} V: with V_d {circuit.V_d:.3g} V and R {circuit.R:.3g} ohm of the "
               "servo the rest is friction; a current without load tells them apart; resistance and gear efficiency "
               "are not told")


def _told_by_current(found: LoadLines, solved: Solved, circuit: Circuit) -> Iterator[str]:
    line = found.lines[CURRENT].line
    product = plus_minus(1.0 / line.slope, line.slope_error / line.slope**2)
    rest = ("a column of speed tells them apart; resistance, drop and supply are not told, nor friction apart from "
            "what it draws without load")
    if "K" in solved.values:
        yield (f"weights and currents tell torque constant times gear efficiency, {product} N m/A: more than the "
               f"torque constant {circuit.K:.3g} N m/A of the servo, which therefore grows, and its speed falls with "
               f"it; the efficiency {circuit.efficiency:.3g} of the servo is kept; {rest}")
        return
    eta = efficiency_of(solved.values, circuit)
    poor = f", less than a gear has ({LEAST_EFFICIENCY:g}): its speed, or the arm, is not what was said" \
        if eta < LEAST_EFFICIENCY else ""
    yield (f"weights and currents tell torque constant times gear efficiency, {product} N m/A, not each: the torque "
           f"constant {circuit.K:.3g} N m/A of the servo, which rests on its speed, is kept, and the efficiency is "
           f"then {eta:.2g}{poor}; {rest}")


def figure_words(one: LoadFigure) -> tuple[str, str, str, str, str]:
    """Return name, value, interval, unit and line of a figure, as a row of a table."""
    value, unit = shown(one.value, one.unit)
    (lower, _), (upper, _) = shown(one.lower, one.unit), shown(one.upper, one.unit)
    interval = "" if one.error == 0.0 else f"{lower:z.4g} to {upper:z.4g}"
    more = f"  ({one.value / _KGF_CM:.3g} kgf cm)" if one.unit == "N m" else ""
    return one.name, f"{value:.4g}", interval, unit + more, one.line


def record_words(one: LiftRecord) -> tuple[str, str, str, str, str]:
    """Return what the record of a lift says, as a row of a table."""
    current = "" if math.isnan(one.current) else f"{1e3 * one.current:.4g} mA"
    return (Path(one.file).name, f"{one.load:g}", f"{math.degrees(one.speed):.4g} °/s", current,
            f"{1e3 * one.dead_time:.3g} ms")

# --- A servo from a table of loads, currents, speeds, sags or voltages, as they are measured at home ------------------

_SUPPLY, _SOURCE = "supply.open_circuit_voltage", "supply.internal_resistance"


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCalibration:
    """A servo by a table of loads.

    Parameters
    ----------
    source : str
    table : LoadTable
    lines : LoadLines
    figures : tuple of LoadFigure
        No-load current and speed, torque per current, stall torque, sag per torque and so on, with intervals.
    shares : tuple of SheetShare
        Measured figures over those that the servo's sheet prints.
    parameters : mapping of str to Quantity
        Numbers of the servo that follow, by dotted name, in SI; `std` is one standard error.
    servo : Servo
        The given one with `parameters` in place; an empty one where none was given.
    words : tuple of str
    """

    source: str
    table: LoadTable = field(repr=False)
    lines: LoadLines = field(repr=False)
    figures: tuple[LoadFigure, ...] = field(repr=False)
    shares: tuple[SheetShare, ...] = field(repr=False)
    parameters: Mapping[str, Quantity] = field(repr=False)
    servo: Servo = field(repr=False)
    words: tuple[str, ...] = field(repr=False)

    def findings(self) -> tuple[str, ...]:
        """Return all that is worth a sentence: the sheet, what is determined and what not, the supply, curvature."""
        return self.words

    def figure(self, name: str) -> LoadFigure:
        """Return a figure by its name, such as "stall torque"."""
        return next(one for one in self.figures if one.name == name)


def calibrate_loads(table: str | Path | LoadTable | Mapping[str, ArrayLike], servo: Servo | None = None, *,
                    arm: float | None = None, source: str | None = None) -> LoadCalibration:
    """Return what a table of loads and currents, speeds or sags, or of voltages and speeds, says about a servo.

    Parameters
    ----------
    table : str, Path, LoadTable or mapping
        As `load_table` reads it; at least 3 rows.
    servo : Servo, optional
        Takes the values; its sheet, supply and what the table cannot tell are read.
    arm : float, optional
        On which the weights hung [m].
    source : str, optional
        Where the table comes from; the path unless given.

    Raises
    ------
    InputError
        If the table cannot be read, a column is not usable, or a line falls that must rise.

    Examples
    --------
    >>> import servotwin as st
    >>> found = calibrate_loads({"mass_g": [100, 200, 320, 400, 450], "current_mA": [230, 300, 370, 405, 450]},
    ...                         st.load_servo("towerpro-mg90s"), arm=0.01)
    >>> figure = found.figure("torque per current")
    >>> f"{figure.value:.4f} ({figure.lower:.3f} to {figure.upper:.3f}) {figure.unit}"
    '0.1625 (0.142 to 0.190) N m/A'
    """
    read = table if isinstance(table, LoadTable) else load_table(table, arm=arm, source=source)
    found = load_lines(read)
    figures = figures_of(read, found)
    shares = shares_of(figures, servo)
    made: dict[str, Estimate] = {}
    notes: list[str] = []
    numbers, circuit = None, None
    if servo is not None:
        made, told = _supply(read, servo)
        servo = with_measured(servo, {name: one.quantity(name, read.source) for name, one in made.items()})
        circuit = circuit_of(servo)
        numbers = None if circuit is None else solved(found, servo, circuit)
        notes += told
        if numbers is not None and circuit is not None:
            more, why = estimates_of(numbers, servo, circuit)
            made |= more
            notes += why
        if SAG in found.lines:
            notes += _stiffness(servo, found.lines[SAG], made)
    said = servo is not None and servo.supply.open_circuit_voltage is not None and (
        _SUPPLY in made or servo.source(_SUPPLY).was_set)
    words = [*sheet_words(shares, found, servo.supply.open_circuit_voltage if servo is not None and said else None),
             *_words(read, found, shares, numbers, circuit, notes, given=servo is not None)]
    parameters = {name: one.quantity(name, read.source) for name, one in made.items()}
    return LoadCalibration(source=read.source, table=read, lines=found, figures=figures, shares=shares,
                           parameters=parameters, words=tuple(words),
                           servo=with_measured(servo or Servo(name="bench-table"), parameters))


def _stiffness(servo: Servo, sag: LoadLine, made: dict[str, Estimate]) -> list[str]:
    gain = gain_of_sag(servo, sag)
    if isinstance(gain, str):
        return [gain]
    made[gain[0]] = gain[1]
    return []


def _supply(table: LoadTable, servo: Servo) -> tuple[dict[str, Estimate], list[str]]:
    """Return the voltage of the supply, where a table of loads has it, and its resistance, where it falls."""
    if table.torque is None or table.voltage is None:
        return {}, []
    volts = table.voltage.values
    fallen = float(volts.max() - volts.min())
    if table.current is not None and fallen > table.voltage.step:
        line = fit_line(table.current.values, volts, least_variance=table.voltage.step**2 / 12.0)
        if line.slope < 0.0 and line.wide(line.slope_error) < -line.slope:
            return ({_SUPPLY: Estimate(line.intercept, line.intercept_error, "supply voltage over current, at 0 A"),
                     _SOURCE: Estimate(-line.slope, line.slope_error, "supply voltage over current")},
                    [f"the supply falls by {fallen:.3g} V under load: it has {-line.slope:.3g} ohm"])
    error = max(float(volts.std()), table.voltage.step) / math.sqrt(volts.size)
    told = [] if fallen <= 0.02 * float(volts.mean()) else [
        f"the supply voltage varies by {fallen:.3g} V, and its mean is used: without a current what it loses counts as "
        "resistance of the motor"]
    return {_SUPPLY: Estimate(float(volts.mean()), error, "mean supply voltage")}, told


def _words(table: LoadTable, found: LoadLines, shares: tuple[SheetShare, ...], numbers: Solved | None,
           circuit: Circuit | None, notes: list[str], *, given: bool) -> list[str]:
    words = [*told_words(found, numbers, circuit),
             *supply_words(table, found, shares, circuit), *notes, *line_words(found), *table.remarks]
    if not given:
        words.append("no parameter is set: give the servo that takes them by --servo")
    elif circuit is None:
        words.append("no parameter of the motor is set: the servo lacks motor, gear or supply")
    words.append("intervals are those of the scatter about the lines: what scale, multimeter and arm are off by in "
                 "common is not in them")
    if table.ignored:
        words.append("not used, for their names are unknown: " + ", ".join(table.ignored))
    return words
