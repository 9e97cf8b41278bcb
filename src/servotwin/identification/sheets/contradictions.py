"""What is wrong with a sheet, and what it lacks, in words that name the printed figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from servotwin.identification.sheets.motor_range import (
    FINE_DROPS,
    completed,
    current_ratios,
    motor_range,
    no_load_current_is_known,
    stall_current_is_known,
)
from servotwin.identification.sheets.sheet import Sheet, SheetPoint
from servotwin.physics import sheet_efficiency, sheet_growth, stall_current_for
from servotwin.physics.sheet import LEAST_EFFICIENCY

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
    """Return what someone who uses this sheet should know, each in a few words.

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
