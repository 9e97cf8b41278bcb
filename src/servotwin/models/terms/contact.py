"""The mechanical half of the automaton: how the shafts move, stick, meet, part and rebound.

With play in the gear there are two bodies, motor and output. Inside the play each moves, sticks and rests on its own;
in contact they are one, as without play. The contact ends when the two, left to themselves, would draw apart.
"""

from __future__ import annotations

import math

from servotwin.models.terms import armature, gear_friction
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
)
from servotwin.physics import backlash, friction, load_friction, motor, shaft

_SATURATED_TANH = 20.0  # tanh(20) is 1 to rounding: beyond it the smoothed friction is constant
_REST_SPEED = 1e-6  # rad/s: below this a rebound from a stop comes to rest
_LAST_IMPACT = 1e-12  # rad/s: an impact of motor and output this slow is the last one of many
_TOO_FAR = 1e12  # rad
_REST_HEIGHT = 4e-15  # relative to the angle: a rebound this low is rounding


def core_speed(plant: Plant) -> float:
    """Return the output speed [rad/s] beyond which the smoothed friction (41) is constant; 0 for true sticking."""
    return _SATURATED_TANH / plant.kappa if plant.kappa > 0.0 else 0.0


def external_torque(plant: Plant, tau: float, q: float) -> float:
    """Return τ_ext [N m] against +q, given its part `tau` that depends on time alone."""
    torque = tau + shaft.spring_torque(q, plant.stiffness, plant.rest_angle)
    if plant.gravity != 0.0:
        if not abs(q) < _TOO_FAR:  # a trial step may be far too long
            return math.nan
        torque += shaft.pendulum_torque(q, plant.gravity, plant.hanging_angle)
    return torque


def drive_torque(plant: Plant, zone: int, u: float, y: Vector) -> float:
    """Return the motor's torque N k_a i [N m]."""
    i = y[2] if plant.L > 0.0 else armature.current(plant, zone, u, y[0], y[6])
    return motor.electromagnetic_torque(i, plant.K)


def has_friction(plant: Plant) -> bool:
    """Tell whether there is any friction other than viscous, or turning points count as much as if there were."""
    return gear_friction.has_gear_friction(plant) or holds(plant)


def holds(plant: Plant) -> bool:
    """Tell whether the output side may hold itself: by dry friction; a potentiometer with play marks its turns."""
    return plant.coulomb > 0.0 or plant.half_slack > 0.0


def holding_bounds(plant: Plant, tau_m: float, tau_e: float) -> tuple[float, float]:
    """Return the torques [N m] that friction holds at rest, against a start backward and forward."""
    return (gear_friction.holding_friction(plant, False, tau_m, tau_e) + plant.coulomb,
            gear_friction.holding_friction(plant, True, tau_m, tau_e) + plant.coulomb)


def friction_torque(plant: Plant, contact: int, w: float, tau_m: float, tau_e: float) -> float:
    """Return the friction [N m] against +q of motor and output moving as one, the load's own included."""
    if contact == FORWARD:
        return gear_friction.sliding_friction(plant, True, w, tau_m, tau_e) + plant.coulomb
    if contact == BACKWARD:
        return -gear_friction.sliding_friction(plant, False, w, tau_m, tau_e) - plant.coulomb
    if contact == CORE:
        forward, backward = plant.F_forward + plant.coulomb, plant.F_backward + plant.coulomb
        return friction.smoothed_coulomb_torque(w, forward, backward, plant.kappa)
    return 0.0


def settled(plant: Plant, zone: int, u: float, tau: float, y: Vector, mesh: int, smooth: bool) -> Mode:
    """Return the mode of a state in a zone; `smooth` keeps a smoothed friction in one piece."""
    q, w = y[0], y[1]
    if plant.half_play > 0.0 and mesh == INSIDE:
        return apart(plant, zone, u, tau, y)
    if plant.kappa > 0.0:
        if not has_friction(plant):
            return Mode(zone, FREE, mesh, FREE)
        if smooth or abs(w) <= core_speed(plant):
            return Mode(zone, CORE, mesh, FREE)
        return Mode(zone, FORWARD if w > 0.0 else BACKWARD, mesh, FREE)
    if w == 0.0:
        torque = drive_torque(plant, zone, u, y)
        against = external_torque(plant, tau, q)
        backward, forward = holding_bounds(plant, torque, -against)
        contact = _from_rest(torque - against, backward, forward, q >= plant.upper, q <= plant.lower,
                             has_friction(plant))
    else:
        contact = _sliding(w > 0.0, has_friction(plant))
    mode = Mode(zone, contact, mesh, FREE)
    if plant.half_play > 0.0 and pressing(plant, mode, u, tau, y) < 0.0:
        return apart(plant, zone, u, tau, y)
    return mode


def apart(plant: Plant, zone: int, u: float, tau: float, y: Vector) -> Mode:
    """Return the mode of two bodies inside the play."""
    torque, against = drive_torque(plant, zone, u, y), external_torque(plant, tau, y[0])
    held, dry = holds(plant), gear_friction.has_gear_friction(plant)
    contact, motor = _sliding(y[1] > 0.0, held), _sliding(y[6] > 0.0, dry)
    if y[1] == 0.0:
        contact = _from_rest(-against, plant.coulomb, plant.coulomb, y[0] >= plant.upper, y[0] <= plant.lower, held)
    if y[6] == 0.0:
        motor = _from_rest(torque, gear_friction.holding_friction(plant, False, torque, 0.0),
                           gear_friction.holding_friction(plant, True, torque, 0.0), False, False, dry)
    return Mode(zone, contact, INSIDE, motor)


def _sliding(forward: bool, dry: bool) -> int:
    if not dry:
        return FREE
    return FORWARD if forward else BACKWARD


def _from_rest(torque: float, backward: float, forward: float, at_upper: bool, at_lower: bool, dry: bool) -> int:
    if not friction.sticks(torque, forward, backward):
        if torque > 0.0:
            return ON_UPPER if at_upper else _sliding(True, dry)
        return ON_LOWER if at_lower else _sliding(False, dry)
    if dry:
        return STUCK
    if at_upper and torque >= 0.0:
        return ON_UPPER
    return ON_LOWER if at_lower and torque <= 0.0 else FREE


def motor_acceleration(plant: Plant, motor: int, torque: float, w: float) -> float:
    """Return the acceleration [rad/s²] of the motor alone, inside the play."""
    if at_rest(motor):
        return 0.0
    dry = 0.0
    if motor == FORWARD or motor == BACKWARD:
        dry = gear_friction.sliding_friction(plant, motor == FORWARD, w, torque, 0.0)
    return shaft.shaft_acceleration(
        torque, w, dry if motor == FORWARD else -dry, 0.0, plant.b - plant.b_out, plant.J - plant.J_out)


def output_acceleration(plant: Plant, contact: int, against: float, w: float) -> float:
    """Return the acceleration [rad/s²] of the output side alone, inside the play."""
    if at_rest(contact):
        return 0.0
    dry = plant.coulomb if contact == FORWARD else -plant.coulomb if contact == BACKWARD else 0.0
    return shaft.shaft_acceleration(0.0, w, dry, against, plant.b_out, plant.J_out)


def pressing(plant: Plant, mode: Mode, u: float, tau: float, y: Vector) -> float:
    """Return how motor and output in contact would close in [rad/s²] if each went on alone; below 0 they part."""
    torque, against = drive_torque(plant, mode.zone, u, y), external_torque(plant, tau, y[0])
    w = y[1]
    if w == 0.0:
        alone = apart(plant, mode.zone, u, tau, (y[0], 0.0, y[2], y[3], y[4], y[5], 0.0))
        motor, contact = alone.motor, alone.contact
    else:
        motor = _sliding(w > 0.0, gear_friction.has_gear_friction(plant))
        contact = _sliding(w > 0.0, holds(plant))
    gain = motor_acceleration(plant, motor, torque, w) - output_acceleration(plant, contact, against, w)
    return gain if mode.mesh == ON_FORWARD else -gain


def met(plant: Plant, forward: bool, y: Vector) -> Vector:
    """Return the state after motor and output have met at an end of the play: one speed, momentum kept."""
    w = backlash.impact_speed(plant.J - plant.J_out, y[6], plant.J_out, y[1])
    if abs(w) < _LAST_IMPACT:
        w = 0.0
    return with_motor(plant, ON_FORWARD if forward else ON_BACKWARD, (y[0], w, y[2], y[3], y[4], y[5], w))


def with_motor(plant: Plant, mesh: int, y: Vector) -> Vector:
    """Return a state of one body with the motor where the play has it."""
    q, w, i, T_w, T_h, _, _ = y
    play = plant.half_play if mesh == ON_FORWARD else -plant.half_play if mesh == ON_BACKWARD else 0.0
    return (q, w, i, T_w, T_h, q + play, w)


def rebound(plant: Plant, mode: Mode, upper: bool, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state after the output has hit a stop; with it the motor, unless it only follows."""
    q = plant.upper if upper else plant.lower
    w = backlash.rebound_speed(y[1], plant.restitution)
    pushes = mode.mesh == (ON_FORWARD if upper else ON_BACKWARD)
    together = plant.half_play == 0.0 or pushes
    mesh = mode.mesh if together else INSIDE
    after: Vector = (q, w, y[2], y[3], y[4], y[5], y[6])
    if together:
        after = with_motor(plant, mesh, after)
    zone = mode.zone
    if plant.V > 0.0:  # the current goes with the speed
        zone = armature.zone_of(plant, u, 0.0, q, after[6], y[2])
    if mesh == INSIDE:
        back = output_acceleration(plant, _sliding(w > 0.0, holds(plant)), external_torque(plant, tau, q), w)
    else:
        back = acceleration(plant, Mode(zone, _sliding(w > 0.0, has_friction(plant)), mesh, FREE), u, tau, after)
    low = back * w < 0.0 and 0.5 * w * w < abs(back) * _REST_HEIGHT * max(abs(q), 1.0)
    if abs(w) < _REST_SPEED or low:
        after = (q, 0.0, y[2], y[3], y[4], after[5], after[6] if mesh == INSIDE else 0.0)
        if plant.V > 0.0:
            zone = armature.zone_of(plant, u, 0.0, q, after[6], y[2])
    return settled(plant, zone, u, tau, after, mesh, False), after


def acceleration(plant: Plant, mode: Mode, u: float, tau: float, y: Vector) -> float:
    """Return ẇ [rad/s²] of motor and output moving as one."""
    if at_rest(mode.contact):
        return 0.0
    q, w = y[0], y[1]
    torque, against = drive_torque(plant, mode.zone, u, y), external_torque(plant, tau, q)
    dry = friction_torque(plant, mode.contact, w, torque, load_friction.torque_on_gear(against, w, plant.b_out))
    return shaft.shaft_acceleration(torque, w, dry, against, plant.b, plant.J)


def accelerated(plant: Plant, torque: float) -> float:
    """Return ẇ [rad/s²] of motor and output as one by a torque alone."""
    return shaft.shaft_acceleration(torque, 0.0, 0.0, 0.0, 0.0, plant.J)
