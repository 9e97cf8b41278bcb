"""The servo as a hybrid automaton: what holds in each mode, and what ends it.

`plant` has the modes and their numbers, `armature` and `contact` the laws of the two halves. Here they are joined: the
rates of the state, and the guards, each at least zero as long as its mode lasts.
"""

from __future__ import annotations

import math

from servotwin.models.terms import armature, contact, gear_friction
from servotwin.models.terms.plant import (
    BACKWARD,
    CORE,
    FORWARD,
    FREE,
    INSIDE,
    ON_BACKWARD,
    ON_FORWARD,
    ON_LOWER,
    ON_UPPER,
    STUCK,
    Mode,
    Plant,
    Vector,
    at_rest,
    at_temperature,
)
from servotwin.physics import electronics, friction, motor, potentiometer, shaft, thermal

# What can end a mode: first what a shaft and a zone of its own have, then what play adds.
SPEED, CORE_FORWARD, CORE_BACKWARD, ZONE_UP, ZONE_DOWN, UPPER, LOWER, RELEASE_FORWARD, RELEASE_BACKWARD = range(9)
MEET_FORWARD, MEET_BACKWARD, PART, PART_OUTPUT, PART_MOTOR = range(9, 14)
MOTOR_SPEED, MOTOR_RELEASE_FORWARD, MOTOR_RELEASE_BACKWARD = range(14, 17)
EVENT_NAMES = ("speed zero", "core left", "core left", "zone", "zone", "upper stop", "lower stop",
               "release forward", "release backward", "gear meets", "gear meets", "gear parts", "gear parts",
               "gear parts", "motor speed zero", "motor release", "motor release")


def warm(plant: Plant, y: Vector) -> Plant:
    """Return the plant at the temperatures of a state; the plant itself where they stay."""
    return at_temperature(plant, y[3], y[4]) if plant.C_w > 0.0 else plant


def settled(plant: Plant, zone: int, u: float, tau: float, y: Vector, mesh: int, smooth: bool) -> Mode:
    """Return the mode of a state in a zone; `smooth` keeps a smoothed friction in one piece."""
    return contact.settled(warm(plant, y), zone, u, tau, y, mesh, smooth)


def rates(plant: Plant, mode: Mode, u: float, tau: float, y: Vector) -> Vector:
    """Return the rate of every number of the state."""
    cold, plant = plant, warm(plant, y)
    w, i, w_m = y[1], y[2], y[6]
    di = dT_w = dT_h = 0.0
    if plant.L > 0.0:
        di = armature.current_rate(plant, mode.zone, u, y[0], w_m, i)
    else:
        i = armature.current(plant, mode.zone, u, y[0], w_m)
    if cold.C_w > 0.0:
        flow = thermal.heat_flow(y[3], y[4], cold.G_wh)
        dT_w = thermal.warming_rate(thermal.copper_loss(i, plant.R), flow, cold.C_w)
        dT_h = thermal.warming_rate(flow, thermal.heat_flow(y[4], cold.T_amb, cold.G_ha), cold.C_h)
    if mode.mesh == INSIDE:
        dw_m = contact.motor_acceleration(plant, mode.motor, motor.electromagnetic_torque(i, plant.K), w_m)
        dw = contact.output_acceleration(plant, mode.contact, contact.external_torque(plant, tau, y[0]), w)
        return w, dw, di, dT_w, dT_h, w_m, dw_m
    dw = contact.acceleration(plant, mode, u, tau, y)
    return w, dw, di, dT_w, dT_h, w, dw


def jacobian(plant: Plant, mode: Mode, u: float, du: float, dtau: float, q: float, w: float) -> tuple[float, ...]:
    """Return ∂ẇ/∂(q, w, i), ∂(di/dt)/∂(q, w, i), and the rates of ẇ and di/dt with time alone, of a rigid gear."""
    vu = electronics.proportional_voltage(1.0, plant.gain) if armature.in_linear_zone(mode.zone) else 0.0
    vq = -vu * potentiometer.feedback_voltage(1.0, plant.p)
    Eq = Ew = Ei = Eu = 0.0
    Fq = -shaft.spring_torque(1.0, plant.stiffness)
    if plant.gravity != 0.0:
        Fq -= shaft.pendulum_stiffness(q, plant.gravity, plant.hanging_angle)
    Fw = -plant.b
    Fi = Fu = 0.0
    if mode.contact == CORE:
        forward, backward = plant.F_forward + plant.coulomb, plant.F_backward + plant.coulomb
        Fw -= friction.smoothed_coulomb_slope(w, forward, backward, plant.kappa)
    if plant.L > 0.0:  # current and torque are linear, so units give the coefficients
        R, L, K_b = plant.R, plant.L, plant.K_b
        Eq = motor.armature_current_rate(vq, 0.0, 0.0, R, L, K_b)
        Eu = motor.armature_current_rate(vu, 0.0, 0.0, R, L, K_b)
        Ew = motor.armature_current_rate(0.0, 0.0, 1.0, R, L, K_b)
        Ei = motor.armature_current_rate(0.0, 1.0, 0.0, R, L, K_b)
        Fi = motor.electromagnetic_torque(1.0, plant.K)
    else:
        per_volt = motor.electromagnetic_torque(armature.conductance(plant, mode.zone, u), plant.K)
        Fq += per_volt * vq
        Fw -= per_volt * motor.back_emf(1.0, plant.K_b)
        Fu = per_volt * vu
    if at_rest(mode.contact):
        return 0.0, 0.0, 0.0, 0.0, 0.0, Ei, 0.0, Eu * du
    return (contact.accelerated(plant, Fq), contact.accelerated(plant, Fw), contact.accelerated(plant, Fi), Eq, Ew, Ei,
            contact.accelerated(plant, Fu * du - dtau), Eu * du)


def guards(plant: Plant, mode: Mode, u: float, smooth: bool) -> int:
    """Return what can end this mode, as a sum of 1 << kind."""
    zone, shaft = mode.zone, mode.contact
    kinds = 0
    if shaft == CORE:
        if not smooth:
            kinds |= 1 << CORE_FORWARD | 1 << CORE_BACKWARD
    elif shaft == STUCK:
        kinds |= 1 << RELEASE_FORWARD | 1 << RELEASE_BACKWARD
    elif shaft == ON_UPPER:
        kinds |= 1 << RELEASE_BACKWARD
    elif shaft == ON_LOWER:
        kinds |= 1 << RELEASE_FORWARD
    elif shaft != FREE:
        kinds |= 1 << SPEED
    low, high = armature.zone_limits(plant, zone, u)
    if high < math.inf:
        kinds |= 1 << ZONE_UP
    if low > -math.inf:
        kinds |= 1 << ZONE_DOWN
    if plant.upper < math.inf and (shaft == FREE or shaft == FORWARD or shaft == CORE):
        kinds |= 1 << UPPER
    if plant.lower > -math.inf and (shaft == FREE or shaft == BACKWARD or shaft == CORE):
        kinds |= 1 << LOWER
    if mode.mesh == INSIDE:
        kinds |= 1 << MEET_FORWARD | 1 << MEET_BACKWARD
        if mode.motor == STUCK:
            kinds |= 1 << MOTOR_RELEASE_FORWARD | 1 << MOTOR_RELEASE_BACKWARD
        elif mode.motor != FREE:
            kinds |= 1 << MOTOR_SPEED
    elif plant.half_play > 0.0:
        kinds |= 1 << PART_MOTOR | 1 << PART_OUTPUT if at_rest(shaft) else 1 << PART
    return kinds


def guard(plant: Plant, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
          dy: Vector) -> tuple[float, float]:
    """Return a guard and its time derivative (nan where it is not known); the mode ends when it falls below zero."""
    zone, shaft = mode.zone, mode.contact
    q, w, dw = y[0], y[1], dy[1]
    if kind == SPEED:
        sign = 1.0 if shaft == FORWARD else -1.0
        return sign * w - contact.core_speed(plant), sign * dw
    if kind == CORE_FORWARD:
        return contact.core_speed(plant) - w, -dw
    if kind == CORE_BACKWARD:
        return contact.core_speed(plant) + w, dw
    if kind == UPPER:
        return plant.upper - q, -w
    if kind == LOWER:
        return q - plant.lower, w
    plant = warm(plant, y)
    if kind == ZONE_UP or kind == ZONE_DOWN:
        x = armature.zone_variable(plant, zone, u, q, y[6], y[2])
        rate = armature.zone_rate(plant, zone, du, y[6], dy[6], dy[2])
        low, high = armature.zone_limits(plant, zone, u)
        return (high - x, -rate) if kind == ZONE_UP else (x - low, rate)
    if plant.half_play > 0.0 and kind >= MEET_FORWARD:
        return _play_guard(plant, mode, kind, u, tau, dtau, y, dy)
    return _release_guard(plant, mode, kind, u, du, tau, dtau, y, dy)


def _release_guard(plant: Plant, mode: Mode, kind: int, u: float, du: float, tau: float, dtau: float, y: Vector,
                   dy: Vector) -> tuple[float, float]:
    torque, against = 0.0, contact.external_torque(plant, tau, y[0])
    di = dy[2]
    if mode.mesh == INSIDE:
        di = 0.0
        backward = forward = plant.coulomb
    else:
        torque = contact.drive_torque(plant, mode.zone, u, y)
        backward, forward = contact.holding_bounds(plant, torque, -against)
        if plant.L == 0.0:
            di = armature.current_slope(plant, mode.zone, du)
    rate = motor.electromagnetic_torque(di, plant.K) - dtau if plant.varies == 0.0 else math.nan
    if kind == RELEASE_FORWARD:
        return forward - (torque - against), -rate
    return torque - against + backward, rate


def _play_guard(plant: Plant, mode: Mode, kind: int, u: float, tau: float, dtau: float, y: Vector,
                dy: Vector) -> tuple[float, float]:
    if kind == MEET_FORWARD:
        return plant.half_play - (y[5] - y[0]), y[1] - y[6]
    if kind == MEET_BACKWARD:
        return plant.half_play + (y[5] - y[0]), y[6] - y[1]
    if kind == PART:
        return contact.pressing(plant, mode, u, tau, y), math.nan
    if kind == MOTOR_SPEED:
        sign = 1.0 if mode.motor == FORWARD else -1.0
        return sign * y[6], sign * dy[6]
    pushes = mode.mesh == ON_FORWARD
    if kind == PART_OUTPUT:  # it starts away from the motor
        against = contact.external_torque(plant, tau, y[0])
        if mode.contact == (ON_UPPER if pushes else ON_LOWER):
            return math.inf, 0.0
        return plant.coulomb + (against if pushes else -against), dtau if pushes else -dtau
    torque, rate = contact.drive_torque(plant, mode.zone, u, y), motor.electromagnetic_torque(dy[2], plant.K)
    if kind == MOTOR_RELEASE_FORWARD or (kind == PART_MOTOR and not pushes):
        return gear_friction.holding_friction(plant, True, torque, 0.0) - torque, -rate
    return gear_friction.holding_friction(plant, False, torque, 0.0) + torque, rate


def cross(plant: Plant, mode: Mode, kind: int, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state just after the guard `kind` of `mode` has reached zero."""
    plant = warm(plant, y)
    zone, shaft, mesh, motor = mode
    if kind == ZONE_UP or kind == ZONE_DOWN:
        if armature.by_current(plant, zone):
            y = _with_current_at_edge(plant, zone, kind, u, y)
            return Mode(armature.zone_of(plant, u, 0.0, y[0], y[6], y[2]), shaft, mesh, motor), y
        return Mode(armature.neighbour(plant, zone, kind == ZONE_UP), shaft, mesh, motor), y
    if kind == SPEED and plant.kappa > 0.0:
        return Mode(zone, CORE, mesh, motor), y
    if kind == CORE_FORWARD or kind == CORE_BACKWARD:
        return Mode(zone, FORWARD if kind == CORE_FORWARD else BACKWARD, mesh, motor), y
    if kind == UPPER or kind == LOWER:
        return contact.rebound(plant, mode, kind == UPPER, u, tau, y)
    if kind == RELEASE_FORWARD or kind == RELEASE_BACKWARD:
        if kind == RELEASE_FORWARD and y[0] >= plant.upper:
            return Mode(zone, ON_UPPER, mesh, motor), y
        if kind == RELEASE_BACKWARD and y[0] <= plant.lower:
            return Mode(zone, ON_LOWER, mesh, motor), y
        shaft = FORWARD if kind == RELEASE_FORWARD else BACKWARD
        dry = contact.holds(plant) if mesh == INSIDE else contact.has_friction(plant)
        return Mode(zone, shaft if dry else FREE, mesh, motor), y
    if kind == MOTOR_RELEASE_FORWARD or kind == MOTOR_RELEASE_BACKWARD:
        return Mode(zone, shaft, mesh, FORWARD if kind == MOTOR_RELEASE_FORWARD else BACKWARD), y
    if plant.half_play > 0.0 and (kind == PART or kind == PART_OUTPUT or kind == PART_MOTOR):
        return contact.apart(plant, zone, u, tau, y), y
    q, w, i, T_w, T_h, q_m, w_m = y
    if plant.half_play > 0.0 and (kind == MEET_FORWARD or kind == MEET_BACKWARD):
        y = contact.met(plant, kind == MEET_FORWARD, y)
        mesh = ON_FORWARD if kind == MEET_FORWARD else ON_BACKWARD
        if plant.V > 0.0:
            zone = armature.zone_of(plant, u, 0.0, q, y[6], i)
        upper = shaft == ON_UPPER and y[1] > 0.0
        if upper or (shaft == ON_LOWER and y[1] < 0.0):  # the output rests on a stop: both hit it at once
            return contact.rebound(plant, Mode(zone, shaft, mesh, motor), upper, u, tau, y)
    elif kind == MOTOR_SPEED:
        y = (q, w, i, T_w, T_h, q_m, 0.0)
    else:
        y = (q, 0.0, i, T_w, T_h, q_m, w_m if mesh == INSIDE else 0.0)
    return contact.settled(plant, zone, u, tau, y, mesh, False), y


def _with_current_at_edge(plant: Plant, zone: int, kind: int, u: float, y: Vector) -> Vector:
    """Return the state with the current where a zone of the current ends."""
    low, high = armature.zone_limits(plant, zone, u)
    i = high if kind == ZONE_UP else low
    return (y[0], y[1], 0.0 if i == 0.0 else i, y[3], y[4], y[5], y[6])
