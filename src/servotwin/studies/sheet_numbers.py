"""The numbers of a sheet as the servo has them that was made of it, their spreads, and the motor that follows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from servotwin.parameters import Servo
from servotwin.parameters.output_side import N, output_value
from servotwin.parameters.sheet_table import ELSE, Figure, figure
from servotwin.physics import (
    load_share,
    no_load_current_of,
    sheet_resistance,
    sheet_stall_torque,
    sheet_torque_constant,
    stall_current_for,
)
from servotwin.physics.sheet import LEAST_EFFICIENCY
from servotwin.studies.joint import DIMENSIONS, TINY, Column, Coordinate, number
from servotwin.studies.kinds import Distribution, Normal, Uniform

# Assumed: how far servos of one kind, and what different sellers print of it, lie from the sheet where it says nothing
TOLERANCES = {"no_load_speed": 0.10, "stall_torque": 0.15, "no_load_current": 0.15}
EFFICIENCY_TOLERANCE = 0.1  # assumed, where the gear's efficiency is
_KEYS = {"no_load_speed": "speed_per_60deg", "stall_torque": "stall_torque", "no_load_current": "no_load_current",
         "stall_current": "stall_current"}
_MOTOR = ("motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant",
          "friction.coulomb_torque_forward", "friction.coulomb_torque_backward")
_SHARES = ("friction.load_friction_motor", "friction.load_friction_external")
_OTHER_SHARES = tuple(f"friction.load_friction{end}" for end in (
    "", "_stribeck", "_motor_stribeck", "_external_stribeck", "_motor_quad", "_external_quad"))
_VISCOUS, _DROP, _BRUSH, _BRIDGE = ("motor.motor_viscous_friction", "supply.bridge_drop_voltage",
                                    "motor.brush_drop_voltage", "supply.bridge_drop_resistance")


@dataclass(frozen=True, kw_only=True)
class SheetNumbers:
    """The sheet of a servo as its twin has it, and the motor of any other sheet.

    Parameters
    ----------
    servo : Servo
    voltage : float
        V of the sheet [V].
    left : float, optional
        1 − μ_m where the file's friction does not grow with the torque through the gear [1].
    coordinates : mapping of str to Coordinate
    covers : frozenset of str
        Parameters that follow.
    """

    servo: Servo
    voltage: float
    left: float | None
    coordinates: Mapping[str, Coordinate]
    covers: frozenset[str]

    def solved(self, drawn: Mapping[str, Column]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the parameters that N does not change, and the numbers at the output, from what is drawn (SI)."""
        w_0, T_s, I_0, eta, s = (drawn.get(name, self.coordinates[name].nominal) for name in (
            "sheet.no_load_speed", "sheet.stall_torque", "sheet.no_load_current", "sheet.gear_efficiency",
            "sheet.viscous_share"))
        V_d = sum(drawn.get(name, number(self.servo, name, 0.0)) for name in (_DROP, _BRUSH))
        I_s = stall_current_for(self.voltage, T_s, w_0, I_0, eta, V_d, s)
        R: Any = sheet_resistance(self.voltage, I_s, V_d)
        K_out: Any = sheet_torque_constant(self.voltage, w_0, I_0, R, V_d)
        mu = load_share(eta)
        friction = K_out * I_0 * (1.0 - mu if self.left is None else self.left)
        found = {"motor.armature_resistance": R - drawn.get(_BRIDGE, number(self.servo, _BRIDGE, 0.0))}
        if self.left is None:
            found |= dict.fromkeys(_SHARES, mu)
        return found, {"output_torque_constant": K_out, "output_coulomb_torque": (1.0 - s) * friction,
                       "output_viscous_friction": s * friction / w_0}


def sheet_numbers(servo: Servo) -> SheetNumbers | None:
    """Return the sheet of a servo whose motor is as a sheet made it; None of any other.

    It is, as long as the file has a table [sheet] with torque, speed and voltage, and states a range of resistance,
    constants and friction. A fit states standard errors, and a number that was set states nothing.

    Raises
    ------
    InputError
        If a figure of the table cannot be read.

    Examples
    --------
    >>> import servotwin as st
    >>> found = sheet_numbers(st.load_servo("hitec-hs-485hb"))
    >>> {name: round(one.nominal, 3) for name, one in found.coordinates.items()}["sheet.gear_efficiency"]
    0.996
    """
    printed = dict(_figures(servo, servo.sheet, ("supply_voltage", "stall_torque", "speed_per_60deg")))
    if len(printed) < 3 or not _as_made(servo):
        return None
    V, plain = printed["supply_voltage"].value, servo.get(_SHARES[0]) is None
    twin = _twin(servo, V, printed["stall_torque"].value)
    if twin is None:
        return None
    spreads = {**{name: _tolerance(servo, name, getattr(twin, name)) for name in TOLERANCES},
               "gear_efficiency": _efficiency(servo, twin.gear_efficiency, plain=plain),
               "viscous_share": _viscous(servo, twin.viscous_share, twin.no_load_speed / twin.friction)}
    coordinates = {f"sheet.{name}": Coordinate(
        dimension=DIMENSIONS[f"sheet.{name}"], lower=0.0 if name == "viscous_share" else TINY,
        upper=math.inf if name in TOLERANCES else 1.0, nominal=getattr(twin, name), spread=spread)
        for name, spread in spreads.items()}
    return SheetNumbers(servo=servo, voltage=V, left=twin.left if plain else None, coordinates=coordinates,
                        covers=frozenset((*_MOTOR, _VISCOUS, *(() if plain else _SHARES))))


class _Twin(NamedTuple):
    """What the servo of the file has at the sheet's voltage; friction [N m] and what of it no load changes [1]."""

    no_load_speed: float
    stall_torque: float
    no_load_current: float
    gear_efficiency: float
    viscous_share: float
    friction: float
    left: float


def _twin(servo: Servo, V: float, printed_torque: float) -> _Twin | None:
    """Return the sheet of the file's own motor: that of which `SheetNumbers.solved` makes it again."""
    K_out, tau = output_value(servo, "output_torque_constant"), output_value(servo, "output_coulomb_torque")
    if not K_out or not tau:
        return None
    b, V_d = output_value(servo, "output_viscous_friction") or 0.0, sum(number(servo, x, 0.0) for x in (_DROP, _BRUSH))
    R, mu = number(servo, _MOTOR[0]) + number(servo, _BRIDGE, 0.0), servo.get(_SHARES[0])
    printed = [] if isinstance(mu, float) else _anywhere(servo, "no_load_current")
    I_s: Any = (V - V_d) / R
    I_0: Any = printed[0].value if printed else no_load_current_of(
        V, R, K_out, tau, b, 1.0 - mu if isinstance(mu, float) else 1.0, V_d)
    w_0 = (V - V_d - R * I_0) / K_out
    if not (0.0 < I_0 < I_s and w_0 > 0.0):
        return None
    friction = tau + b * w_0
    s = b * w_0 / friction
    if isinstance(mu, float):
        eta = load_share(mu)
    else:  # the file's friction does not tell; the torque of the sheet does
        eta = printed_torque / float(sheet_stall_torque(K_out, I_s, I_0, 1.0, s))
        eta = min(max(eta, LEAST_EFFICIENCY), 1.0)
    T_s = float(sheet_stall_torque(K_out, I_s, I_0, eta, s))
    return _Twin(w_0, T_s, I_0, eta, s, friction, friction / (K_out * I_0))


def _figures(servo: Servo, table: Mapping[str, Any], keys: tuple[str, ...]) -> Iterator[tuple[str, Figure]]:
    for key in keys:
        found = figure(servo.name, key, table[key]) if key in table else None
        if found is not None:
            yield key, found


def _rows(servo: Servo) -> list[Mapping[str, Any]]:
    rows = servo.sheet.get(ELSE, [])
    return [row for row in rows if isinstance(row, Mapping)] if isinstance(rows, list) else []


def _anywhere(servo: Servo, name: str) -> list[Figure]:
    """Return a figure wherever the table has it, that at the sheet's own voltage first."""
    return [found for table in (servo.sheet, *_rows(servo)) for _, found in _figures(servo, table, (_KEYS[name],))]


def _at_same_voltage(servo: Servo, name: str) -> Iterator[Figure]:
    """Yield what other sources print at the sheet's own voltage."""
    own = dict(_figures(servo, servo.sheet, ("supply_voltage",)))["supply_voltage"].value
    for row in _rows(servo):
        found = dict(_figures(servo, row, ("supply_voltage", _KEYS[name])))
        if len(found) == 2 and found["supply_voltage"].value == own:
            yield found[_KEYS[name]]


def _as_made(servo: Servo) -> bool:
    """Return whether the motor is as a sheet made it: with ranges, alike both ways, of one load friction at most."""
    if any(servo.get(name) is None for name in (*_MOTOR, N)):
        return False
    made = all(q.lower is not None and q.origin in ("datasheet", "assumed") for q in map(servo.source, _MOTOR))
    shares = [servo.get(name) for name in _SHARES]
    return (made and number(servo, _MOTOR[1]) == number(servo, _MOTOR[2])
            and number(servo, _MOTOR[3]) == number(servo, _MOTOR[4]) and shares[0] == shares[1]
            and all(servo.get(name) is None for name in _OTHER_SHARES))


def _tolerance(servo: Servo, name: str, nominal: float) -> Distribution:
    """Return the spread of a printed number: that which the table states, or the assumed one, other sources within."""
    figures = _anywhere(servo, name)
    own = figures[0] if figures else None
    if own is not None and own.std:
        return Normal(nominal, nominal * own.std / own.value)
    if own is not None and (own.lower is not None or own.upper is not None):
        low, high = (own.value if end is None else end for end in (own.lower, own.upper))
        if low < high:
            return Uniform(nominal * low / own.value, nominal * high / own.value)
    ends = [1.0 - TOLERANCES[name], 1.0 + TOLERANCES[name]]
    if own is None:  # assumed within a range, which is that of the friction
        quantity, value = servo.source(_MOTOR[3]), number(servo, _MOTOR[3])
        ends += [end / value for end in (quantity.lower, quantity.upper) if end is not None]
    else:
        ends += [other.value / own.value for other in _at_same_voltage(servo, name)]
    return Uniform(nominal * min(ends), nominal * max(ends))


def _efficiency(servo: Servo, eta: float, *, plain: bool) -> Distribution | None:
    """Return the spread of the efficiency: that of the file's load friction, or the assumed one."""
    if plain:
        if _anywhere(servo, "stall_current"):  # which tells it
            return None
        return Uniform(max(eta - EFFICIENCY_TOLERANCE, LEAST_EFFICIENCY), min(eta + EFFICIENCY_TOLERANCE, 1.0))
    quantity = servo.source(_SHARES[0])
    if quantity.std:
        slope = 2.0 / (1.0 + number(servo, _SHARES[0])) ** 2
        return Normal(eta, slope * quantity.std)
    ends = sorted(load_share(end) for end in (quantity.lower, quantity.upper) if end is not None)
    ends = sorted((*ends, eta))
    return Uniform(ends[0], ends[-1]) if ends[0] < ends[-1] else None


def _viscous(servo: Servo, nominal: float, per_friction: float) -> Distribution | None:
    """Return the spread of the viscous share of the friction: that of the file's viscous friction."""
    if servo.get(_VISCOUS) is None:
        return None
    quantity, factor = servo.source(_VISCOUS), number(servo, N) ** 2 * per_friction
    if quantity.std:
        return Normal(nominal, factor * quantity.std)
    low, high = (number(servo, _VISCOUS) if end is None else end for end in (quantity.lower, quantity.upper))
    return Uniform(factor * low, factor * high) if low < high else None
