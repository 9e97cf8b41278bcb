"""The servo as a hybrid automaton: its modes, what holds in each, and what ends each.

One automaton serves all models. What a model lacks has a neutral value (no supply limit: infinite; no deadband,
stop or friction: absent), so every law stands here once. A mode is a pair:

zone     without a bridge, how the armature voltage follows the error v_e = u − p q − b_o: saturated (±2), linear
         (±1), deadband (0); behind a switched bridge with u = ±V or 0 (off), which way the current flows
contact  how the shaft moves: without friction, sliding forward or backward, in the core of a smoothed friction,
         stuck, or resting on the lower or upper stop

All quantities are at the output shaft (a bare motor has N = 1).
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Plant(NamedTuple):
    """Everything that the automaton reads, as plain floats in SI."""

    J: float  # N² J_m + J_L
    b: float  # N² B_m + B_L
    K: float  # N k_a
    K_b: float  # N k_b
    R: float
    L: float  # 0: the current follows at once
    F_forward: float  # N F_ec1
    F_backward: float  # N F_ec2
    breakaway: float  # F_s / F_c
    kappa: float  # N k, slope of tanh (41); 0: true sticking
    coulomb: float  # dry friction of the load
    stiffness: float
    rest_angle: float
    gravity: float  # m g l
    hanging_angle: float
    gain: float  # A k_s
    p: float
    b_o: float
    half_deadband: float
    V_max: float
    lower: float
    upper: float
    restitution: float
    V: float  # V_oc behind a switched bridge; 0: there is none, and the voltage follows the error
    D_drive: float  # V_ce0 + V_br: no current flows where |s V − K_b w| is less
    R_drive: float  # R_a + r_c + R_b
    D_off: float  # the same two between drives
    R_off: float


class Mode(NamedTuple):
    """Zone of the voltage law and contact of the shaft."""

    zone: int
    contact: int


SATURATED_BACKWARD, LINEAR_BACKWARD, DEAD, LINEAR, SATURATED = -2, -1, 0, 1, 2
CONDUCTING, CURRENT_BACKWARD, NO_CURRENT, CURRENT_FORWARD = 3, 4, 5, 6  # conducting: without drops, either way
FREE, FORWARD, BACKWARD, CORE, STUCK, ON_LOWER, ON_UPPER = range(7)

# What can end a mode. A guard is at least zero as long as the mode lasts.
SPEED, CORE_FORWARD, CORE_BACKWARD, ZONE_UP, ZONE_DOWN, UPPER, LOWER, RELEASE_FORWARD, RELEASE_BACKWARD = range(9)
EVENT_NAMES = ("speed zero", "core left", "core left", "zone", "zone", "upper stop", "lower stop",
               "release forward", "release backward")

_SATURATED_TANH = 20.0  # tanh(20) is 1 to rounding: beyond it the smoothed friction is constant
_REST_SPEED = 1e-6  # rad/s: below this a rebound from a stop comes to rest
_REST_HEIGHT = 4e-15  # relative to the angle: a rebound this low is rounding
_TIE = 1e-13  # V


def at_rest(contact: int) -> bool:
    """Tell whether the shaft stands still in this contact."""
    return contact >= STUCK


def core_speed(plant: Plant) -> float:
    """Return the output speed [rad/s] beyond which the smoothed friction (41) is constant; 0 for true sticking."""
    return _SATURATED_TANH / plant.kappa if plant.kappa > 0.0 else 0.0


def zone_limits(plant: Plant, zone: int, u: float) -> tuple[float, float]:
    """Return the values of `zone_variable` [V] between which a zone lies."""
    if zone >= CONDUCTING:
        D, _ = bridge(plant, u)
        if zone == CURRENT_FORWARD:
            return D, math.inf
        if zone == CURRENT_BACKWARD:
            return -math.inf, -D
        return (-D, D) if zone == NO_CURRENT else (-math.inf, math.inf)
    e1 = plant.half_deadband
    e2 = e1 + plant.V_max / plant.gain
    if zone == SATURATED:
        return e2, math.inf
    if zone == SATURATED_BACKWARD:
        return -math.inf, -e2
    if zone == DEAD:
        return -e1, e1
    if e1 == 0.0:  # one linear zone: without a deadband nothing happens at v_e = 0
        return -e2, e2
    return (e1, e2) if zone == LINEAR else (-e2, -e1)


def zone_variable(plant: Plant, u: float, q: float, w: float) -> float:
    """Return what decides the zone [V]: the error v_e, or behind a bridge the voltage that drives the current."""
    if plant.V > 0.0:
        return u - plant.K_b * w
    return u - plant.p * q - plant.b_o


def zone_of(plant: Plant, u: float, du: float, q: float, w: float) -> int:
    """Return the zone of a state; on a boundary of the error, the one that it moves into."""
    x = zone_variable(plant, u, q, w)
    if plant.V > 0.0:
        D, _ = bridge(plant, u)
        if D == 0.0:
            return CONDUCTING
        if abs(x) <= D:
            return NO_CURRENT
        return CURRENT_FORWARD if x > 0.0 else CURRENT_BACKWARD
    rate = du - plant.p * w
    e = x
    if rate != 0.0:
        e += math.copysign(2.0 * _TIE * (1.0 + abs(x)), rate)
    size = abs(e)
    if size > plant.half_deadband + plant.V_max / plant.gain:
        return SATURATED if e > 0.0 else SATURATED_BACKWARD
    if plant.half_deadband == 0.0:
        return LINEAR
    if size <= plant.half_deadband:
        return DEAD
    return LINEAR if e > 0.0 else LINEAR_BACKWARD


def bridge(plant: Plant, u: float) -> tuple[float, float]:
    """Return the drop [V] and the resistance [Ω] of the circuit while the bridge drives, or between drives (u = 0)."""
    if u != 0.0:
        return plant.D_drive, plant.R_drive
    return plant.D_off, plant.R_off


def current(plant: Plant, zone: int, u: float, q: float, w: float) -> float:
    """Return the armature current [A] without inductance."""
    if zone < CONDUCTING:
        return (voltage(plant, zone, u - plant.p * q - plant.b_o) - plant.K_b * w) / plant.R
    if zone == NO_CURRENT:
        return 0.0
    D, R = bridge(plant, u)
    return (u - sign_of(zone) * D - plant.K_b * w) / R


def sign_of(zone: int) -> float:
    """Return the sign of the current in a zone behind a bridge; 0 where it does not matter."""
    return 1.0 if zone == CURRENT_FORWARD else -1.0 if zone == CURRENT_BACKWARD else 0.0


def voltage(plant: Plant, zone: int, error: float) -> float:
    """Return the armature voltage [V] of a zone at the error v_e [V]."""
    if zone == DEAD:
        return 0.0
    if zone == SATURATED or zone == SATURATED_BACKWARD:
        return math.copysign(plant.V_max, zone)
    return plant.gain * (error - zone * plant.half_deadband)


def in_linear_zone(zone: int) -> bool:
    """Tell whether the armature voltage follows the error in this zone."""
    return zone == LINEAR or zone == LINEAR_BACKWARD


def external_torque(plant: Plant, tau: float, q: float) -> float:
    """Return τ_ext [N m] against +q, given its part `tau` that depends on time alone."""
    torque = tau + plant.stiffness * (q - plant.rest_angle)
    if plant.gravity != 0.0:
        torque += plant.gravity * math.sin(q - plant.hanging_angle)
    return torque


def holding_bounds(plant: Plant) -> tuple[float, float]:
    """Return the torques [N m] that friction holds at rest, against a start backward and forward."""
    return (plant.breakaway * plant.F_backward + plant.coulomb, plant.breakaway * plant.F_forward + plant.coulomb)


def driving_torque(plant: Plant, zone: int, u: float, tau: float, q: float, i: float) -> float:
    """Return N k_a i − τ_ext [N m] at rest: what friction has to hold."""
    if plant.L == 0.0:
        i = current(plant, zone, u, q, 0.0)
    return plant.K * i - external_torque(plant, tau, q)


def has_friction(plant: Plant) -> bool:
    """Tell whether there is any friction other than viscous."""
    return plant.F_forward > 0.0 or plant.F_backward > 0.0 or plant.coulomb > 0.0


def contact_of(plant: Plant, zone: int, u: float, tau: float, q: float, w: float, i: float, smooth: bool) -> int:
    """Return the contact of a shaft at q with speed w; `smooth` keeps a smoothed friction in one piece."""
    if plant.kappa > 0.0:
        if not has_friction(plant):
            return FREE
        if smooth or abs(w) <= core_speed(plant):
            return CORE
        return FORWARD if w > 0.0 else BACKWARD
    if w == 0.0:
        return _contact_from_rest(plant, driving_torque(plant, zone, u, tau, q, i), q)
    return _sliding(plant, w > 0.0)


def _sliding(plant: Plant, forward: bool) -> int:
    if not has_friction(plant):
        return FREE
    return FORWARD if forward else BACKWARD


def _contact_from_rest(plant: Plant, torque: float, q: float) -> int:
    backward, forward = holding_bounds(plant)
    if torque > forward:
        return ON_UPPER if q >= plant.upper else _sliding(plant, True)
    if torque < -backward:
        return ON_LOWER if q <= plant.lower else _sliding(plant, False)
    return STUCK if has_friction(plant) else FREE


def friction_torque(plant: Plant, contact: int, w: float) -> float:
    """Return the friction [N m] against +q of a moving shaft, the load's own included."""
    if contact == FORWARD:
        return plant.F_forward + plant.coulomb
    if contact == BACKWARD:
        return -plant.F_backward - plant.coulomb
    if contact == CORE:
        x = math.tanh(plant.kappa * w)
        return ((plant.F_forward if w >= 0.0 else plant.F_backward) + plant.coulomb) * x
    return 0.0


def rates(plant: Plant, mode: Mode, u: float, tau: float, q: float, w: float, i: float) -> tuple[float, float]:
    """Return ẇ [rad/s²] and di/dt [A/s] (0 without inductance)."""
    di = 0.0
    if plant.L > 0.0:
        di = (voltage(plant, mode.zone, u - plant.p * q - plant.b_o) - plant.R * i - plant.K_b * w) / plant.L
    else:
        i = current(plant, mode.zone, u, q, w)
    if at_rest(mode.contact):
        return 0.0, di
    torque = plant.K * i - plant.b * w - friction_torque(plant, mode.contact, w) - external_torque(plant, tau, q)
    return torque / plant.J, di


def conductance(plant: Plant, zone: int, u: float) -> float:
    """Return by how much the current changes per volt in this zone [S]."""
    if zone < CONDUCTING:
        return 1.0 / plant.R
    if zone == NO_CURRENT:
        return 0.0
    _, R = bridge(plant, u)
    return 1.0 / R


def jacobian(plant: Plant, mode: Mode, u: float, du: float, dtau: float, q: float, w: float) -> tuple[float, ...]:
    """Return ∂ẇ/∂(q, w, i), ∂(di/dt)/∂(q, w, i), and the rates of ẇ and di/dt with time alone."""
    gain = plant.gain if in_linear_zone(mode.zone) else 0.0
    Eq = Ew = Ei = Eu = 0.0
    Fq = -plant.stiffness
    if plant.gravity != 0.0:
        Fq -= plant.gravity * math.cos(q - plant.hanging_angle)
    Fw = -plant.b
    Fi = Fu = 0.0
    if mode.contact == CORE:
        x = math.tanh(plant.kappa * w)
        F = (plant.F_forward if w >= 0.0 else plant.F_backward) + plant.coulomb
        Fw -= F * plant.kappa * (1.0 - x * x)
    if plant.L > 0.0:
        Eq, Ew, Ei, Eu = -gain * plant.p / plant.L, -plant.K_b / plant.L, -plant.R / plant.L, gain / plant.L
        Fi = plant.K
    else:
        per_volt = plant.K * conductance(plant, mode.zone, u)
        Fq -= per_volt * gain * plant.p
        Fw -= per_volt * plant.K_b
        Fu = per_volt * gain
    J = plant.J
    if at_rest(mode.contact):
        return 0.0, 0.0, 0.0, 0.0, 0.0, Ei, 0.0, Eu * du
    return Fq / J, Fw / J, Fi / J, Eq, Ew, Ei, (Fu * du - dtau) / J, Eu * du


def guards(plant: Plant, mode: Mode, u: float, smooth: bool) -> int:
    """Return what can end this mode, as a sum of 1 << kind."""
    zone, contact = mode
    kinds = 0
    if contact == CORE:
        if not smooth:
            kinds |= 1 << CORE_FORWARD | 1 << CORE_BACKWARD
    elif contact == STUCK:
        kinds |= 1 << RELEASE_FORWARD | 1 << RELEASE_BACKWARD
    elif contact == ON_UPPER:
        kinds |= 1 << RELEASE_BACKWARD
    elif contact == ON_LOWER:
        kinds |= 1 << RELEASE_FORWARD
    elif contact != FREE:
        kinds |= 1 << SPEED
    low, high = zone_limits(plant, zone, u)
    if high < math.inf:
        kinds |= 1 << ZONE_UP
    if low > -math.inf:
        kinds |= 1 << ZONE_DOWN
    if plant.upper < math.inf and (contact == FREE or contact == FORWARD or contact == CORE):
        kinds |= 1 << UPPER
    if plant.lower > -math.inf and (contact == FREE or contact == BACKWARD or contact == CORE):
        kinds |= 1 << LOWER
    return kinds


def guard(plant: Plant, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float,
          q: float, w: float, i: float, dw: float, di: float) -> tuple[float, float]:
    """Return a guard and its time derivative; the mode ends when it falls below zero."""
    zone, contact = mode
    if kind == SPEED:
        sign = 1.0 if contact == FORWARD else -1.0
        return sign * w - core_speed(plant), sign * dw
    if kind == CORE_FORWARD:
        return core_speed(plant) - w, -dw
    if kind == CORE_BACKWARD:
        return core_speed(plant) + w, dw
    if kind == UPPER:
        return plant.upper - q, -w
    if kind == LOWER:
        return q - plant.lower, w
    rate = du - (plant.K_b * dw if plant.V > 0.0 else plant.p * w)
    if kind == ZONE_UP or kind == ZONE_DOWN:
        x = zone_variable(plant, u, q, w)
        low, high = zone_limits(plant, zone, u)
        return (high - x, -rate) if kind == ZONE_UP else (x - low, rate)
    torque = driving_torque(plant, zone, u, tau, q, i)
    if plant.L == 0.0:
        di = plant.gain * rate / plant.R if in_linear_zone(zone) else 0.0
    rate = plant.K * di - dtau
    backward, forward = holding_bounds(plant)
    if kind == RELEASE_FORWARD:
        return forward - torque, -rate
    return torque + backward, rate


def cross(plant: Plant, mode: Mode, kind: int, u: float, tau: float,
          q: float, w: float, i: float) -> tuple[Mode, float, float]:
    """Return the mode, angle and speed just after the guard `kind` of `mode` has reached zero."""
    zone, contact = mode
    if kind == ZONE_UP or kind == ZONE_DOWN:
        return Mode(_neighbour(plant, zone, kind), contact), q, w
    if kind == SPEED and plant.kappa > 0.0:
        return Mode(zone, CORE), q, w
    if kind == SPEED:
        return Mode(zone, _contact_from_rest(plant, driving_torque(plant, zone, u, tau, q, i), q)), q, 0.0
    if kind == CORE_FORWARD:
        return Mode(zone, FORWARD), q, w
    if kind == CORE_BACKWARD:
        return Mode(zone, BACKWARD), q, w
    if kind == UPPER or kind == LOWER:
        return _rebound(plant, zone, kind, u, tau, w, i)
    return Mode(zone, _sliding(plant, kind == RELEASE_FORWARD)), q, 0.0


def _rebound(plant: Plant, zone: int, kind: int, u: float, tau: float, w: float,
             i: float) -> tuple[Mode, float, float]:
    q = plant.upper if kind == UPPER else plant.lower
    w = -plant.restitution * w
    if plant.V > 0.0:  # the current goes with the speed
        zone = zone_of(plant, u, 0.0, q, w)
    back, _ = rates(plant, Mode(zone, _sliding(plant, w > 0.0)), u, tau, q, w, i)
    low = back * w < 0.0 and 0.5 * w * w < abs(back) * _REST_HEIGHT * max(abs(q), 1.0)
    if abs(w) < _REST_SPEED or low:
        torque = driving_torque(plant, zone, u, tau, q, i)
        return Mode(zone, _contact_from_rest(plant, torque, q)), q, 0.0
    return Mode(zone, _sliding(plant, w > 0.0)), q, w


def _neighbour(plant: Plant, zone: int, kind: int) -> int:
    step = 1 if kind == ZONE_UP else -1
    if zone >= CONDUCTING or plant.half_deadband > 0.0:
        return zone + step
    if zone == LINEAR:
        return 2 * step
    return LINEAR
