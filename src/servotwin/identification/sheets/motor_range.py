"""The motor behind a sheet, as far as the sheet says, and the ranges that come from what it does not say.

Numbers that a sheet leaves open are assumed within a range: the drop of bridge and brushes, the efficiency of the gear
where no stall current is printed, the no-load current where that is not. The motor is solved for every combination of
their ends and some values between, for all voltages together and for each alone; the range of a parameter is from the
least to the greatest of these, as far as the gear stays possible. Every parameter is monotone in every assumption, so
that the ends are enough.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from servotwin.identification.sheets.sheet import Sheet, SheetPoint
from servotwin.physics import (
    SheetMotor,
    load_share,
    motor_from_sheet,
    sheet_efficiency,
    sheet_growth,
    stall_current_for,
)
from servotwin.physics.sheet import LEAST_EFFICIENCY

# --- The motor behind a sheet, as far as the sheet says, and the ranges that come from what it does not say -----------

# Of several the likelier first. V_d of bridge and brushes [V], η_g, and no-load over stall current ρ, which makes
# friction of 5 to 30 % of the torque
DROPS, EFFICIENCIES, CURRENT_RATIOS = (0.4, 0.2, 0.0), (0.8, 0.7, 0.9), (0.12, 0.04, 0.3)
# Where a stall current tells the efficiency some of them are impossible, and the border has to be found
FINE_DROPS = tuple(0.01 * n for n in range(40, -1, -5))
FINE_CURRENT_RATIOS = (0.12, 0.1, 0.08, 0.06, 0.04, *(0.01 * n for n in range(14, 31)))
# The same of Dynamixel's X series, whose pages print no current without load: 2 %, 0.5 to 10 %. So much makes the
# Coulomb friction that was identified: 0.5 % of an XC330, 0.7 % of an XC430, 1.2 % of an XM430-W210, 2.2 % of an
# XM430-W350, 4 % of a 2XL430 (ToddlerBot, toddlerbot/descriptions/default.yml, frictionloss; github.com/tjacobs/
# toddlerbot, 84e02d1), 0.6 % of the XM430-W350 of a ROBOTIS OP3 (github.com/google-deepmind/mujoco_menagerie,
# robotis_op3/op3.xml, 361161b). 10 % is the largest current at no torque of the first file: 0.088 A of an XC330
X_CURRENT_RATIOS = (0.02, 0.005, 0.1)
FINE_X_CURRENT_RATIOS = (0.02, 0.015, 0.01, 0.0075, 0.005, *(0.01 * n for n in range(3, 11)))
_MOST_STEPS = 50


@dataclass(frozen=True, kw_only=True)
class Range:
    """A value with its range.

    Parameters
    ----------
    value, lower, upper : float
    """

    value: float
    lower: float
    upper: float


@dataclass(frozen=True, kw_only=True)
class MotorRange:
    """The motor of a sheet, seen at the output shaft, with ranges.

    Parameters
    ----------
    resistance : Range
        R of the motor's circuit [ohm].
    output_torque_constant : Range
        K_out = N k_a [N m/A].
    gear_efficiency : Range
        η_g [1].
    no_load_current : Range
        I_0 at the nominal voltage [A].
    no_load_torque : Range
        K_out I_0, all friction of the unloaded servo [N m].
    coulomb_torque : Range
        τ_c = K_out I_0 (1 − μ_m), what of it does not grow with the torque through the gear [N m].
    drop_voltage : float
        V_d that the values belong to [V].
    efficiency_from_sheet, current_from_sheet : bool
        Whether a stall current gives the efficiency, and whether a no-load current is printed.
    possible : bool
        Whether any combination of what is assumed has a possible gear at every voltage.
    """

    resistance: Range
    output_torque_constant: Range
    gear_efficiency: Range
    no_load_current: Range
    no_load_torque: Range
    coulomb_torque: Range
    drop_voltage: float
    efficiency_from_sheet: bool
    current_from_sheet: bool
    possible: bool


@dataclass(frozen=True, kw_only=True)
class _Assumed:
    drop: float
    efficiency: float | None  # None: a stall current tells
    ratio: float | None  # None: a no-load current is printed


@dataclass(frozen=True, kw_only=True)
class _Solved:
    joint: SheetMotor
    alone: tuple[SheetMotor, ...]
    others: tuple[SheetMotor, ...]
    drop: float
    judged: tuple[SheetMotor, ...]  # those whose currents are printed, and not taken from another voltage

    @property
    def possible(self) -> bool:
        return self.joint.feasible and all(motor.feasible for motor in self.judged)

    @property
    def violation(self) -> float:
        return sum(abs(math.log(motor.gear_efficiency / min(max(motor.gear_efficiency, LEAST_EFFICIENCY), 1.0)))
                   for motor in (self.joint, *self.judged))


def motor_range(sheet: Sheet) -> MotorRange:
    """Return the motor that a sheet describes, with ranges.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553, no_load_current=0.285)
    >>> found = motor_range(Sheet(name="a", points=(point,))).resistance
    >>> round(found.value, 2), round(found.lower, 2), round(found.upper, 2)
    (3.04, 2.75, 3.72)
    """
    solved = [_solve(sheet, assumed) for assumed in _assumptions(sheet)]
    possible = [one for one in solved if one.possible]
    best = possible[0] if possible else min(solved, key=lambda one: one.violation)
    motors = [motor for one in possible or solved for motor in (one.joint, *one.alone, *one.others)
              if motor.feasible or not possible]

    def among(of: Callable[[SheetMotor], float]) -> Range:
        found = [of(motor) for motor in motors]
        return Range(value=of(best.joint), lower=min(found), upper=max(found))

    return MotorRange(
        resistance=among(lambda m: m.resistance), output_torque_constant=among(lambda m: m.output_torque_constant),
        gear_efficiency=among(lambda m: m.gear_efficiency), no_load_torque=among(_no_load_torque),
        no_load_current=among(lambda m: _no_load_torque(m) / m.output_torque_constant),
        coulomb_torque=among(lambda m: m.coulomb_torque), drop_voltage=best.drop,
        efficiency_from_sheet=stall_current_is_known(sheet),
        current_from_sheet=no_load_current_is_known(sheet), possible=bool(possible))


def _no_load_torque(motor: SheetMotor) -> float:
    return motor.coulomb_torque / (1.0 - load_share(min(motor.gear_efficiency, 1.0)))


def stall_current_is_known(sheet: Sheet) -> bool:
    """Return whether the main source prints a stall current at any voltage, be it one without torque and speed.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553, no_load_current=0.285)
    >>> stall_current_is_known(Sheet(name="a", points=(point,)))
    False
    """
    return any(point.stall_current is not None for point in sheet.own)


def no_load_current_is_known(sheet: Sheet) -> bool:
    """Return whether the main source prints a running current at any voltage."""
    return any(point.no_load_current is not None for point in sheet.own)


def current_ratios(sheet: Sheet) -> tuple[float, ...]:
    """Return what is assumed of the no-load over the stall current where none is printed, the likelier first.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=12.0, stall_torque=4.1, no_load_speed=4.817)
    >>> current_ratios(Sheet(name="a", points=(point,), modulation="bus", registers="dynamixel-x"))
    (0.02, 0.005, 0.1)
    """
    fine = stall_current_is_known(sheet)
    if sheet.registers == "dynamixel-x":
        return FINE_X_CURRENT_RATIOS if fine else X_CURRENT_RATIOS
    return FINE_CURRENT_RATIOS if fine else CURRENT_RATIOS


def completed(sheet: Sheet, drop: float, points: Sequence[SheetPoint]) -> tuple[SheetPoint, ...]:
    """Return points with the currents that are printed at another voltage only.

    The no-load current is taken as it is, for friction makes most of it; the stall current in proportion to V − V_d.

    Examples
    --------
    >>> one = SheetPoint(supply_voltage=4.8, stall_torque=1.0, no_load_speed=4.0)
    >>> two = SheetPoint(supply_voltage=6.0, stall_torque=1.2, no_load_speed=5.0, stall_current=2.0)
    >>> completed(Sheet(name="a", points=(one, two)), 0.0, (one,))[0].stall_current
    1.6
    """
    filled = []
    for point in points:
        I_0 = _nearest(sheet.own, point, "no_load_current")
        I_s = _nearest(sheet.own, point, "stall_current")
        new = point
        if point.stall_current is None and I_s is not None and I_s.stall_current is not None:
            new = replace(new, stall_current=I_s.stall_current * (point.supply_voltage - drop)
                          / (I_s.supply_voltage - drop))
        if point.no_load_current is None and I_0 is not None:
            new = replace(new, no_load_current=I_0.no_load_current)
        filled.append(new)
    return tuple(filled)


def _nearest(points: Sequence[SheetPoint], to: SheetPoint, name: str) -> SheetPoint | None:
    having = [point for point in points if getattr(point, name) is not None]
    return min(having, key=lambda p: abs(p.supply_voltage - to.supply_voltage)) if having else None


def _assumptions(sheet: Sheet) -> Iterator[_Assumed]:
    """Yield the combinations of what the sheet leaves open, the likelier ones first."""
    fine = stall_current_is_known(sheet)
    efficiencies = (None,) if fine else EFFICIENCIES
    ratios = (None,) if no_load_current_is_known(sheet) else current_ratios(sheet)
    # A lower drop is the smaller step away from what is likely: it goes before another current
    for ratio, efficiency, drop in itertools.product(ratios, efficiencies, FINE_DROPS if fine else DROPS):
        yield _Assumed(drop=drop, efficiency=efficiency, ratio=ratio)


def _solve(sheet: Sheet, assumed: _Assumed) -> _Solved:
    main = completed(sheet, assumed.drop, sheet.main)
    alone = tuple(_motor(point, assumed) for point in main)
    others = tuple(_motor(point, assumed) for point in completed(sheet, assumed.drop, sheet.others))
    joint = _together(main, alone, sheet, assumed) if len(main) > 1 else alone[0]
    judged = tuple(motor for motor, point in zip(alone, sheet.main, strict=True) if point.stall_current is not None)
    return _Solved(joint=joint, alone=alone, others=others, drop=assumed.drop, judged=judged)


def _motor(point: SheetPoint, assumed: _Assumed) -> SheetMotor:
    """Return the motor of one point alone."""
    T_s, w_0, U = float(point.stall_torque or 0.0), float(point.no_load_speed or 0.0), \
        point.supply_voltage - assumed.drop
    eta, I_0, I_s = assumed.efficiency or 1.0, point.no_load_current, point.stall_current
    if I_0 is None:
        rho = float(assumed.ratio or 0.0)
        I_0 = rho * (I_s if I_s is not None else T_s * w_0 / (eta * U * (1.0 - rho) ** 2))
    if I_s is not None and I_s <= I_0:  # figures of two voltages that do not fit; one alone is checked as it is read
        I_0 = 0.99 * I_s
    return motor_from_sheet(supply_voltage=point.supply_voltage, stall_torque=T_s, no_load_speed=w_0,
                            no_load_current=I_0, stall_current=I_s, drop_voltage=assumed.drop, gear_efficiency=eta)


def _together(points: Sequence[SheetPoint], alone: Sequence[SheetMotor], sheet: Sheet,
              assumed: _Assumed) -> SheetMotor:
    """Return the one motor that fits the figures of all voltages best: least squares of their logarithms."""
    import numpy as np
    from numpy.typing import NDArray

    V, T_s, w_0 = (np.array([getattr(point, name) for point in points]) for name in (
        "supply_voltage", "stall_torque", "no_load_speed"))
    U, U_n = V - assumed.drop, sheet.nominal.supply_voltage - assumed.drop
    stalled = [(point.supply_voltage - assumed.drop, point.stall_current) for point in sheet.own
               if point.stall_current is not None]
    U_s, I_s = np.array(stalled).reshape(-1, 2).T
    given = [point.no_load_current for point in points]

    def facts(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what R, K_out and η_g, in logarithms, fail to explain."""
        R, K, eta = math.exp(x[0]), math.exp(x[1]), math.exp(x[2]) if len(x) == 3 else float(assumed.efficiency or 1.0)
        I_0 = np.array([assumed.ratio * U_n / R if assumed.ratio is not None else i for i in given], dtype=np.float64)
        left = np.maximum(U - R * I_0, 1e-6 * U)  # a trial step may be too far
        return np.concatenate([np.log(left / (K * w_0)), np.log(eta * K * left / (R * T_s)),
                               np.log(U_s / (R * I_s))])

    names = ("resistance", "output_torque_constant", "gear_efficiency")[:3 if assumed.efficiency is None else 2]
    x = np.mean([[math.log(getattr(motor, name)) for name in names] for motor in alone], axis=0)
    r = facts(x)
    for _ in range(_MOST_STEPS):
        J = np.stack([(facts(x + h) - facts(x - h)) / 2e-6 for h in 1e-6 * np.eye(len(x))], axis=1)
        step = np.linalg.lstsq(J, -r, rcond=None)[0]
        while (new := facts(x + step)) @ new > r @ r and np.abs(step).max() > 1e-12:
            step = 0.5 * step
        if np.abs(step).max() <= 1e-12:
            break
        x, r = x + step, facts(x + step)
    eta = math.exp(x[2]) if len(x) == 3 else float(assumed.efficiency or 1.0)
    R, K = math.exp(x[0]), math.exp(x[1])
    of_nominal = next(i for i, point in zip(given, points, strict=True)
                      if point.supply_voltage == sheet.nominal.supply_voltage)
    I_0 = float(of_nominal or 0.0) if assumed.ratio is None else assumed.ratio * U_n / R
    return SheetMotor(resistance=R, output_torque_constant=K, stall_current=U_n / R, gear_efficiency=eta,
                      coulomb_torque=K * I_0 * (1.0 - load_share(min(eta, 1.0))))


# --- Faults and gaps of a sheet, in words that name the printed figures -----------------------------------------------

_SLIGHT = 0.4  # growth with the voltage to this power, of motors 1 and of most sheets 0.8, is remarkable
_STEEP_DROP, _STEEP_RATIO = 0.4, 0.35  # what makes torque and speed grow fastest
_SAME = 0.04  # relative: figures of two sources that only differ in rounding
_USUAL_SCATTER = 2.05  # twice the scatter 1.43 of the rule of mass
_KGF_CM = 0.0980665  # N m
_STRONGEST = 3.3539  # N m, the largest stall torque of the catalog (FT-7235)
_STRONG = 3.86  # times what is usual for its mass: that of the same servo, and no other of the catalog comes near
_WEAK = 1.43**3  # three times the scatter of the rule of mass
_NUMBERS = {"stall_torque": "torque", "no_load_speed": "speed", "no_load_current": "running current",
            "stall_current": "stall current"}


@dataclass(frozen=True, kw_only=True)
class Contradiction:
    """Printed figures of which at least one is wrong.

    Parameters
    ----------
    flag : str
        In a few words.
    text : str
        One or two sentences that name the figures, and what they could be.
    """

    flag: str
    text: str


def sheet_contradictions(sheet: Sheet) -> tuple[Contradiction, ...]:
    """Return what in a sheet cannot all be true.

    Torque and speed have to grow with the voltage, and the gear has to pass between 50 and 100 % of the motor's power,
    whatever is assumed where the sheet is silent.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=2.5, no_load_speed=math.pi / 3 / 0.11,
    ...                    no_load_current=0.1, stall_current=2.1)
    >>> sheet_contradictions(Sheet(name="a", points=(point,)))[0].flag
    'impossible: efficiency 2.08 at 6 V'
    """
    found = [*_growth(sheet), *(one for point in sheet.main for one in _efficiency(sheet, point))]
    if not found and not motor_range(sheet).possible:
        used = sorted(point.supply_voltage for point in sheet.own
                      if point.complete or (point.stall_current, point.no_load_current) != (None, None))
        voltages = " and ".join(f"{voltage:g} V" for voltage in used)
        found.append(Contradiction(flag="impossible: the voltages do not fit together", text=(
            f"torque, speed and currents at {voltages} are each possible, but not of one and the same motor and gear: "
            "one of these voltages, or a figure beside it, is wrong.")))
    return tuple(found)


def sheet_flags(sheet: Sheet) -> tuple[str, ...]:
    """Return the warnings for the use of this sheet, each in a few words.

    Examples
    --------
    >>> sheet_flags(Sheet(name="a", points=(SheetPoint(supply_voltage=6.0, stall_torque=0.4, no_load_speed=5.5),)))[0]
    'no current given'
    """
    return tuple(dict.fromkeys([*(found.flag for found in sheet_contradictions(sheet)), *_currents(sheet),
                                *_slow_growth(sheet), *_disagreements(sheet), *_mass(sheet), *_silent(sheet)]))


def shown_point(point: SheetPoint) -> str:
    """Return torque, speed and stall current of a point as a sheet prints them.

    Examples
    --------
    >>> shown_point(SheetPoint(supply_voltage=6.0, stall_torque=0.4, no_load_speed=math.pi / 3 / 0.19))
    '0.4 N m and 0.19 s/60°'
    """
    text = f"{point.stall_torque:.4g} N m and {seconds(float(point.no_load_speed or 1.0)):.3g} s/60°"
    return text + (f" from {point.stall_current:.3g} A" if point.stall_current is not None else "")


def seconds(speed: float) -> float:
    """Return the time for 60° [s] at a speed [rad/s].

    Examples
    --------
    >>> round(seconds(math.pi), 9)
    0.333333333
    """
    return math.pi / 3.0 / speed


def _growth(sheet: Sheet) -> Iterator[Contradiction]:
    """Yield what falls, or grows faster than a motor's torque and speed can, from one voltage to the next."""
    for name, words, unit in (("stall_torque", "stall torque", "N m"), ("no_load_speed", "speed", "°/s")):
        own = sorted((p for p in sheet.points if getattr(p, name) is not None and p.source == sheet.points[0].source),
                     key=lambda p: p.supply_voltage)
        for one, two in pairwise(own):
            if two.supply_voltage == one.supply_voltage:
                continue
            low, high = (getattr(p, name) * (math.degrees(1.0) if unit == "°/s" else 1.0) for p in (one, two))
            most = sheet_growth(one.supply_voltage, two.supply_voltage, min(_STEEP_DROP, one.supply_voltage / 4),
                                _STEEP_RATIO)
            said = (f"the {words} is {low:.4g} {unit} at {one.supply_voltage:g} V and {high:.4g} {unit} at "
                    f"{two.supply_voltage:g} V")
            motor = f"that of a motor grows x{two.supply_voltage / one.supply_voltage:.2f} to x{most:.2f}"
            if high <= low:
                yield Contradiction(flag=f"impossible: {words} does not grow with voltage", text=(
                    f"{said}, but it has to grow with the voltage ({motor}): one of the two is wrong, or they stand in "
                    "each other's place."))
            elif high > low * most * 1.02:
                yield Contradiction(flag=f"impossible: {words} grows x{high / low:.2f} with voltage", text=(
                    f"{said}, which is x{high / low:.2f}, but {motor}: one of the two is wrong."))


def _efficiency(sheet: Sheet, point: SheetPoint) -> Iterator[Contradiction]:
    """Yield that no gear is as good, or as poor, as the figures of one voltage ask for; what is assumed may help."""
    I_s = point.stall_current
    if I_s is None:
        return
    filled = completed(sheet, 0.0, (point,))[0].no_load_current
    ratios = [ratio * I_s for ratio in (0.0, *current_ratios(sheet))]
    currents = [point.no_load_current] if point.no_load_current is not None else (
        ratios if filled is None else [0.0, min(filled, 0.9 * I_s)])
    found = [_Needed(float(sheet_efficiency(point.supply_voltage, float(point.stall_torque or 0.0), float(
        point.no_load_speed or 0.0), I_0, I_s, drop)), I_0, drop) for drop in FINE_DROPS for I_0 in currents]
    least, most = min(found), max(found)
    if least.efficiency > 1.0:
        yield _too_good(point, least, most.efficiency if point.no_load_current is not None else None)
    elif most.efficiency < LEAST_EFFICIENCY:
        yield _too_poor(point, least.efficiency, most)


class _Needed(NamedTuple):
    efficiency: float
    no_load_current: float
    drop: float


def _too_good(point: SheetPoint, least: _Needed, most: float | None) -> Contradiction:
    eta, I_0, drop = least
    V, T_s, w_0 = point.supply_voltage, float(point.stall_torque or 0.0), float(point.no_load_speed or 0.0)
    need = stall_current_for(V, T_s, w_0, I_0, 1.0, drop)
    reach = f"{100 * eta:.0f} %" + (f" (up to {100 * most:.0f} %)" if most and most > 1.01 * eta else " or more")
    return Contradiction(flag=f"impossible: efficiency {eta:.2f} at {V:g} V", text=(
        f"{shown_point(point)} at {V:g} V would need a gear of {reach} efficiency: torque, speed or stall current "
        f"is wrong. With this current and speed the torque is at most {_down(T_s / eta)} N m, with this current and "
        f"torque 60° take at least {_up(seconds(w_0 / eta))} s, and this torque and speed need at least "
        f"{_up(float(need))} A."))


def _too_poor(point: SheetPoint, least: float, most: _Needed) -> Contradiction:
    eta, I_0, drop = most
    V, T_s, w_0 = point.supply_voltage, float(point.stall_torque or 0.0), float(point.no_load_speed or 0.0)
    need = stall_current_for(V, T_s, w_0, I_0, LEAST_EFFICIENCY, drop)
    return Contradiction(flag=f"impossible: efficiency {eta:.2f} at {V:g} V", text=(
        f"{shown_point(point)} at {V:g} V would mean that the gear passes {100 * least:.0f} to {100 * eta:.0f} % "
        f"of the motor's torque, less than half: torque or speed is too small, or the stall current too large (or a "
        f"clutch slips). With this current and speed the torque is at least {_up(T_s * LEAST_EFFICIENCY / eta)} N m, "
        f"and this torque and speed need at most {_down(float(need))} A."))


def _up(x: float) -> str:
    """Return two digits, not less than it is."""
    digits = 10.0 ** (math.floor(math.log10(x)) - 1)
    return f"{math.ceil(x / digits - 1e-9) * digits:.2g}"


def _down(x: float) -> str:
    """Return two digits, not more than it is."""
    digits = 10.0 ** (math.floor(math.log10(x)) - 1)
    return f"{math.floor(x / digits + 1e-9) * digits:.2g}"


def _currents(sheet: Sheet) -> Iterator[str]:
    stall, running = stall_current_is_known(sheet), no_load_current_is_known(sheet)
    if not stall and not running:
        yield "no current given"
    elif not stall:
        yield "stall current not given"
    elif not running:
        yield "running current not given"


def _slow_growth(sheet: Sheet) -> Iterator[str]:
    for name in ("stall_torque", "no_load_speed"):
        for one, two in pairwise(sheet.main):
            low, high = getattr(one, name), getattr(two, name)
            if low < high < low * (two.supply_voltage / one.supply_voltage) ** _SLIGHT:
                yield (f"{_NUMBERS[name]} grows only x{high / low:.2f} from {one.supply_voltage:g} to "
                       f"{two.supply_voltage:g} V")


def _disagreements(sheet: Sheet) -> Iterator[str]:
    found: dict[str, float] = {}
    for other in sheet.points:
        for own in sheet.points:
            if own.source != sheet.points[0].source or other.source == own.source \
                    or own.supply_voltage != other.supply_voltage:
                continue
            for name, words in _NUMBERS.items():
                a, b = getattr(own, name), getattr(other, name)
                if a is not None and b is not None and abs(math.log(b / a)) > _SAME:
                    found[words] = max(found.get(words, 0.0), abs(math.log(b / a)))
    if found:
        yield "sources disagree: " + ", ".join(f"{words} x{math.exp(log):.2f}" for words, log in found.items())


def _mass(sheet: Sheet) -> Iterator[str]:
    point = sheet.nominal
    if sheet.mass is None or not 5.5 <= point.supply_voltage <= 6.5:
        return  # the rule is one of 6 V
    ratio = float(point.stall_torque or 0.0) / usual_torque(sheet.mass)
    if not 1.0 / _USUAL_SCATTER <= ratio <= _USUAL_SCATTER:
        yield f"torque x{ratio:.2g} of what is usual for its mass"


def usual_torque(mass: float) -> float:
    """Return the stall torque of analog servos at 6 V [N m] by their mass [kg]; two of three are within a factor 1.43.

    From a list of 2464 servos: 0.0173 N m (m/g)^0.94.

    Examples
    --------
    >>> round(usual_torque(0.045), 2)
    0.62
    """
    return float(0.0173 * (1000.0 * mass) ** 0.94)


def torque_question(sheet: Sheet) -> str | None:
    """Return a question where newton metres were probably said for kilogram-force centimetres; None where not.

    It is asked where no stall current tells, and the torque is more than any servo of the catalog has for its mass, or
    at all where no mass is given, while the same number of kgf cm would be usual.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=13.0, no_load_speed=4.5)
    >>> print(torque_question(Sheet(name="a", points=(point,), mass=0.045)))
    13 N m, or 13 kgf cm = 1.27 N m? For 45 g about 0.62 N m are usual
    """
    torque = float(sheet.nominal.stall_torque or 0.0)
    if stall_current_is_known(sheet):
        return None
    if sheet.mass is None:
        unlikely, usual = torque > _STRONGEST, f"the strongest servo of the catalog has {_STRONGEST:.3g} N m"
    else:
        common = usual_torque(sheet.mass)
        unlikely = torque > _STRONG * common and common / _WEAK < torque * _KGF_CM < common * _WEAK
        usual = f"for {1000.0 * sheet.mass:.3g} g about {common:.2g} N m are usual"
    if not unlikely:
        return None
    return f"{torque:.4g} N m, or {torque:.4g} kgf cm = {torque * _KGF_CM:.3g} N m? {usual[0].upper()}{usual[1:]}"


def _silent(sheet: Sheet) -> Sequence[str]:
    missing = [] if sheet.modulation == "bus" else [words for words, there in (
        ("deadband", sheet.deadband is not None), ("pulse range", sheet.pulse_min is not None),
        ("travel", any(x is not None for x in (sheet.travel, sheet.angle_per_pulse))))
        if not there and not (sheet.continuous and words != "deadband")]
    said = [f"{', '.join(missing)} not given"] if missing else []
    if len({point.supply_voltage for point in sheet.main}) == 1:
        said.append("one voltage only")
    return [sheet.modulation, *said] if sheet.modulation in ("digital", "bus") else said
