"""The electrical half of the automaton: which way the current flows, how large it is, and what the source gives.

Without a bridge the armature voltage follows the error v_e = u − p q − b_o: saturated, linear, or zero in the
deadband. Behind a switched bridge u is s V, or 0 between drives, and the zone is the direction of the current.
"""

from __future__ import annotations

import math

from servotwin.models.terms.plant import (
    CONDUCTING,
    CURRENT_BACKWARD,
    CURRENT_FORWARD,
    DEAD,
    LIMITED_BACKWARD,
    LIMITED_FORWARD,
    LINEAR,
    LINEAR_BACKWARD,
    NO_CURRENT,
    SATURATED,
    SATURATED_BACKWARD,
    SHORT_BACKWARD,
    SHORT_FORWARD,
    Plant,
)
from servotwin.physics import bridge, electronics, motor, potentiometer, supply

_TIE = 1e-13  # V


def drop(plant: Plant, u: float) -> float:
    """Return the voltage [V] that has to be exceeded for a current to flow, driven or between drives (u = 0)."""
    return plant.D_drive if u != 0.0 else plant.D_off


def loop(plant: Plant, zone: int, u: float) -> tuple[float, float]:
    """Return voltage [V], with its drop, and resistance [Ω] of the loop through which the current of a zone flows."""
    sign = sign_of(zone)
    if u == 0.0:
        return bridge.driving_voltage(0.0, sign, plant.D_off), plant.R_off
    if zone == SHORT_FORWARD or zone == SHORT_BACKWARD:
        return bridge.driving_voltage(0.0, sign, plant.D_drive), plant.R_drive - plant.R_b
    R = plant.R_drive
    if plant.I_max < math.inf and sign * u < 0.0:  # returned past a regulator
        R -= plant.R_b
    return bridge.driving_voltage(u, sign, plant.D_drive), R


def error_of(plant: Plant, u: float, q: float) -> float:
    """Return the error v_e [V] of a servo without bridge."""
    return electronics.feedback_error(u, potentiometer.feedback_voltage(q, plant.p, plant.b_o))


def sign_of(zone: int) -> float:
    """Return the sign of the current in a zone behind a bridge; 0 where it does not matter."""
    if zone > NO_CURRENT:
        return 1.0
    return -1.0 if CONDUCTING < zone < NO_CURRENT else 0.0


def limited(zone: int) -> bool:
    """Tell whether the source gives its most, so that the current stays."""
    return zone == LIMITED_FORWARD or zone == LIMITED_BACKWARD


def constant_current(zone: int) -> bool:
    """Tell whether the current of a zone behind a bridge does not change with the speed."""
    return zone == NO_CURRENT or limited(zone)


def in_linear_zone(zone: int) -> bool:
    """Tell whether the armature voltage follows the error in this zone."""
    return zone == LINEAR or zone == LINEAR_BACKWARD


def by_current(plant: Plant, zone: int) -> bool:
    """Tell whether a zone behind a bridge lasts as long as its current does: where the current has inertia."""
    return plant.L > 0.0 and not constant_current(zone)


def zone_limits(plant: Plant, zone: int, u: float) -> tuple[float, float]:
    """Return the values of `zone_variable` between which a zone lies."""
    if zone >= CONDUCTING:
        return _bridge_limits(plant, zone, u)
    e1 = plant.half_deadband
    e2 = saturating_error(plant)
    if zone == SATURATED:
        return e2, math.inf
    if zone == SATURATED_BACKWARD:
        return -math.inf, -e2
    if zone == DEAD:
        return -e1, e1
    if e1 == 0.0:  # one linear zone: without a deadband nothing happens at v_e = 0
        return -e2, e2
    return (e1, e2) if zone == LINEAR else (-e2, -e1)


def saturating_error(plant: Plant) -> float:
    """Return the error v_e [V] at which the voltage reaches its limit."""
    return plant.half_deadband + plant.V_max / electronics.proportional_voltage(1.0, plant.gain)


def _bridge_limits(plant: Plant, zone: int, u: float) -> tuple[float, float]:
    D, I_max = drop(plant, u), plant.I_max
    if zone == CONDUCTING:
        return -math.inf, math.inf
    if zone == NO_CURRENT:
        return -D, D
    # A regulator's most, in the direction of the drive: from x1 on it gives that, from x2 on the bus has broken down.
    x1 = bridge.needed_voltage(I_max, 0.0, D, plant.R_drive)
    x2 = bridge.needed_voltage(I_max, 0.0, D, plant.R_drive - plant.R_b) + abs(u)
    if by_current(plant, zone):
        D, x1, x2 = 0.0, I_max, I_max
    forward, backward = (x1 if u > 0.0 else math.inf), (x1 if u < 0.0 else math.inf)
    if zone == CURRENT_FORWARD:
        return D, forward
    if zone == CURRENT_BACKWARD:
        return -backward, -D
    if zone == LIMITED_FORWARD:
        return x1, x2
    if zone == LIMITED_BACKWARD:
        return -x2, -x1
    return (x2, math.inf) if zone == SHORT_FORWARD else (-math.inf, -x2)


def zone_variable(plant: Plant, zone: int, u: float, q: float, w: float, i: float) -> float:
    """Return what a zone lasts by: the error v_e [V]; behind a bridge what drives the current [V], or itself [A]."""
    if plant.V > 0.0:
        return i if by_current(plant, zone) else u - motor.back_emf(w, plant.K_b)
    return error_of(plant, u, q)


def zone_rate(plant: Plant, zone: int, du: float, w: float, dw: float, di: float) -> float:
    """Return the rate of `zone_variable`, where the motor turns with w and the output at the same speed."""
    if plant.V > 0.0:
        return di if by_current(plant, zone) else du - motor.back_emf(dw, plant.K_b)
    return error_rate(plant, du, w)


def error_rate(plant: Plant, du: float, w: float) -> float:
    """Return the rate of `error_of` [V/s] at an output speed [rad/s]."""
    return electronics.feedback_error(du, potentiometer.feedback_voltage(w, plant.p))


def zone_of(plant: Plant, u: float, du: float, q: float, w: float, i: float) -> int:
    """Return the zone of a state; on a boundary of the error, the one that it moves into."""
    if plant.V > 0.0:
        return _bridge_zone(plant, u, u - motor.back_emf(w, plant.K_b), i)
    x = error_of(plant, u, q)
    rate = error_rate(plant, du, w)
    e = x
    if rate != 0.0:
        e += math.copysign(2.0 * _TIE * (1.0 + abs(x)), rate)
    size = abs(e)
    if size > saturating_error(plant):
        return SATURATED if e > 0.0 else SATURATED_BACKWARD
    if plant.half_deadband == 0.0:
        return LINEAR
    if size <= plant.half_deadband:
        return DEAD
    return LINEAR if e > 0.0 else LINEAR_BACKWARD


def _bridge_zone(plant: Plant, u: float, x: float, i: float) -> int:
    D = drop(plant, u)
    if D == 0.0 and plant.I_max == math.inf:
        return CONDUCTING
    if plant.L > 0.0 and i != 0.0:
        forward = i > 0.0
    elif abs(x) <= D:
        return NO_CURRENT
    else:
        forward = x > 0.0
    zone = CURRENT_FORWARD if forward else CURRENT_BACKWARD
    step = 1 if forward else -1
    if plant.I_max == math.inf or u * step <= 0.0:
        return zone
    if plant.L > 0.0:
        if abs(i) < plant.I_max:
            return zone
        if abs(i) > plant.I_max:
            return zone + 2 * step
    most = bridge.needed_voltage(plant.I_max, 0.0, D, plant.R_drive)
    zone += step if abs(x) > most else 0
    short = bridge.needed_voltage(plant.I_max, 0.0, D, plant.R_drive - plant.R_b) + abs(u)
    return zone + (step if abs(x) > short else 0)


def neighbour(plant: Plant, zone: int, up: bool) -> int:
    """Return the zone that follows on one that has ended, upwards or downwards."""
    step = 1 if up else -1
    if zone >= CONDUCTING or plant.half_deadband > 0.0:
        return zone + step
    return 2 * step if zone == LINEAR else LINEAR


def current(plant: Plant, zone: int, u: float, q: float, w: float) -> float:
    """Return the armature current [A] where it has no inertia."""
    if zone < CONDUCTING:
        v = voltage(plant, zone, error_of(plant, u, q))
        return motor.steady_armature_current(v, w, plant.R, plant.K_b)
    if zone == NO_CURRENT:
        return 0.0
    if limited(zone):
        return sign_of(zone) * plant.I_max
    v, R = loop(plant, zone, u)
    return motor.steady_armature_current(v, w, R, plant.K_b)


def current_rate(plant: Plant, zone: int, u: float, q: float, w: float, i: float) -> float:
    """Return di/dt [A/s] of a current with inertia."""
    if zone < CONDUCTING:
        v = voltage(plant, zone, error_of(plant, u, q))
        return motor.armature_current_rate(v, i, w, plant.R, plant.L, plant.K_b)
    if constant_current(zone):
        return 0.0
    v, R = loop(plant, zone, u)
    return motor.armature_current_rate(v, i, w, R, plant.L, plant.K_b)


def voltage(plant: Plant, zone: int, error: float) -> float:
    """Return the armature voltage [V] of a zone without bridge at the error v_e [V]."""
    if zone == DEAD:
        return 0.0
    if zone == SATURATED or zone == SATURATED_BACKWARD:
        return math.copysign(plant.V_max, zone)
    return electronics.proportional_voltage(
        electronics.error_beyond_deadband(error, zone, 2.0 * plant.half_deadband), plant.gain)


def conductance(plant: Plant, zone: int, u: float) -> float:
    """Return by how much the current changes per volt in this zone [S]."""
    if zone < CONDUCTING:
        return motor.steady_armature_current(1.0, 0.0, plant.R, plant.K_b)
    if constant_current(zone):
        return 0.0
    _, R = loop(plant, zone, u)
    return motor.steady_armature_current(1.0, 0.0, R, plant.K_b)


def current_slope(plant: Plant, zone: int, du: float) -> float:
    """Return di/dt [A/s] at a standstill of a current without inertia, where the command changes by du [V/s]."""
    if not in_linear_zone(zone):
        return 0.0
    return conductance(plant, zone, 0.0) * electronics.proportional_voltage(du, plant.gain)


def bus_voltage(plant: Plant, zone: int, u: float, w: float, i: float, coasts: bool) -> float:
    """Return what is left of the source's voltage [V] under this servo's current."""
    if i == 0.0 or not (u != 0.0 or coasts):
        return plant.V
    if zone == SHORT_FORWARD or zone == SHORT_BACKWARD:
        return 0.0
    if limited(zone):
        drops = sign_of(zone) * plant.D_drive
        return abs(bridge.needed_voltage(i, motor.back_emf(w, plant.K_b), drops, plant.R_drive - plant.R_b))
    taken = supply.supply_current(i, _direction(u))
    return supply.source_voltage(taken, plant.V, plant.R_b, regulated=plant.I_max < math.inf)


def _direction(u: float) -> float:
    """Return how the bridge drives: −1, 0 or +1."""
    return math.copysign(1.0, u) if u != 0.0 else 0.0


def terminal_voltage(plant: Plant, V_br: float, u: float, w: float, i: float, V_bus: float, coasts: bool) -> float:
    """Return the voltage v_m [V] at the motor's terminals."""
    if plant.L == 0.0 or i == 0.0:
        v_b = motor.back_emf(w, plant.K_b)
        return bridge.motor_voltage(i, v_b, plant.R, V_br, v_b if u != 0.0 or coasts else 0.0)
    if u == 0.0 and not coasts:
        return 0.0
    drive = _direction(u) if u != 0.0 else -math.copysign(1.0, i)
    return bridge.bridge_voltage(i, V_bus, drive, *bridge_drops(plant, V_br, u))


def bridge_drops(plant: Plant, V_br: float, u: float) -> tuple[float, float]:
    """Return V_ce0 [V] and r_c [Ω] of what conducts: transistors while the bridge drives, diodes while it coasts."""
    if u == 0.0:
        return plant.D_off - V_br - plant.V, 0.0
    return plant.D_drive - V_br, plant.R_drive - plant.R - plant.R_b
