"""Two bodies with a spring between them: how they move, stick, meet and rebound.

An elastic gear has the motor before its spring and the output behind it, an elastic shaft motor and output before it
and the load behind it. With play in an elastic gear the spring acts beyond the play alone, and only as it pushes: it
pushes, it is loose inside the play, or it trails behind an output that runs away faster than the damper lets it follow.
"""

from __future__ import annotations

from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.contacts import NEXT_TO_NOTHING, REST_HEIGHT, REST_SPEED
from servotwin.models.engine.dynamics.currents import drive_torque
from servotwin.models.state.modes import (
    BEHIND,
    FORWARD,
    FREE,
    LOOSE,
    ON_BACKWARD,
    PUSH_BACKWARD,
    PUSH_FORWARD,
    SPRUNG,
    TRAIL_BACKWARD,
    TRAIL_FORWARD,
    Mode,
    Vector,
    at_rest,
    moving,
    sign_of,
    slides,
)
from servotwin.models.terms import elastic, friction, shaft
from servotwin.models.terms.friction import holding_friction, sliding_against
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import from_rest, sliding
from servotwin.physics.backlash import rebound_speed
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.shaft import pendulum_torque, shaft_acceleration, twist_torque


def twist(numbers: Numbers, y: Vector) -> float:
    """Return by how much the first body is ahead of the second [rad]."""
    return elastic.ahead(numbers.elastic, y.q, y.q_m)


def twist_rate(numbers: Numbers, y: Vector) -> float:
    """Return by how much the first body is faster than the second [rad/s]; of the state's rates, how this changes."""
    return elastic.ahead(numbers.elastic, y.w, y.w_m)


def torque(numbers: Numbers, mesh: int, y: Vector) -> float:
    """Return the torque between the bodies [N m], which pushes the second one forward."""
    return elastic.torque_at(numbers.elastic, mesh, twist(numbers, y), twist_rate(numbers, y))


def torque_slope(numbers: Numbers, mesh: int, y: Vector, dy: Vector) -> float:
    """Return how fast that torque changes [N m/s]."""
    if mesh == LOOSE or mesh >= TRAIL_FORWARD:
        return 0.0
    return twist_torque(twist_rate(numbers, y), twist_rate(numbers, dy), numbers.elastic.k, numbers.elastic.c)


def push(numbers: Numbers, forward: bool, y: Vector) -> float:
    """Return the torque [N m] that the spring would have at an end of the play; it pushes that way where positive."""
    value = torque(numbers, PUSH_FORWARD if forward else PUSH_BACKWARD, y)
    return value if forward else -value


def mesh_of(numbers: Numbers, y: Vector) -> int:
    """Return how the spring acts in a state, whatever was before."""
    if elastic.behind(numbers.elastic):
        return BEHIND
    half, ahead = numbers.elastic.half, twist(numbers, y)
    if half == 0.0:
        return SPRUNG
    if ahead > half:
        return PUSH_FORWARD if push(numbers, True, y) > 0.0 else TRAIL_FORWARD
    if ahead < -half:
        return PUSH_BACKWARD if push(numbers, False, y) > 0.0 else TRAIL_BACKWARD
    return LOOSE


def on_gear(numbers: Numbers, mesh: int, tau: float, y: Vector) -> float:
    """Return the torque that the gear feels from its output side [N m], positive in +q."""
    between = torque(numbers, mesh, y)
    if elastic.behind(numbers.elastic):
        return torque_on_gear(external_torque(numbers.load, tau, y.q) + between, y.w, numbers.shaft.b_out)
    return -between


def through_gear(numbers: Numbers, mesh: int, tau_m: float, tau: float, y: Vector) -> float:
    """Return the torque through the gear [N m] whose magnitude adds to sliding friction."""
    return friction.share(numbers.friction, tau_m, on_gear(numbers, mesh, tau, y))


def share_sign(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> int:
    """Return the sign of what the torques through a gear add to its friction before its magnitude is taken."""
    body = mode.motor if elastic.geared(numbers.elastic) else mode.contact
    if not slides(body) or not friction.shared(numbers.friction):
        return 0
    torque = drive_torque(numbers, mode.zone, u, y)
    tau_m = torque if torque != 0.0 else sign_of(mode.zone) * NEXT_TO_NOTHING
    return 1 if through_gear(numbers, mode.mesh, tau_m, tau, y) >= 0.0 else -1


def with_share(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> Mode:
    """Return a mode with the share that its friction has."""
    return Mode(mode.zone, mode.contact, mode.mesh, mode.motor, share_sign(numbers, mode, u, tau, y))


def at_output(numbers: Numbers, zone: int, mesh: int, u: float, tau: float, y: Vector) -> tuple[float, float, float]:
    """Return the torque that drives the output's body [N m], and what friction holds of it backward and forward."""
    between, against = torque(numbers, mesh, y), external_torque(numbers.load, tau, y.q)
    if elastic.behind(numbers.elastic):
        driving = drive_torque(numbers, zone, u, y)
        against += between
        backward, forward = contacts.holding_bounds(numbers, driving, -against)
        return driving - against, backward, forward
    return between - against, numbers.load.coulomb, numbers.load.coulomb


def at_motor(numbers: Numbers, zone: int, mesh: int, u: float, y: Vector) -> tuple[float, float, float]:
    """Return the torque that drives the motor of an elastic gear [N m], and what friction holds of it either way."""
    driving, between = drive_torque(numbers, zone, u, y), torque(numbers, mesh, y)
    return (driving - between, holding_friction(numbers.friction, False, driving, -between),
            holding_friction(numbers.friction, True, driving, -between))


def is_dry(numbers: Numbers) -> bool:
    """Tell whether the output's body has friction that may hold it."""
    return contacts.has_friction(numbers) if elastic.behind(numbers.elastic) else contacts.holds(numbers)


def settled(numbers: Numbers, zone: int, u: float, tau: float, y: Vector, mesh: int) -> Mode:
    """Return the mode of a state in a zone."""
    if mesh <= ON_BACKWARD:  # not known yet
        mesh = mesh_of(numbers, y)
    dry, motor = is_dry(numbers), FREE
    contact = sliding(y.w > 0.0, dry)
    if y.w == 0.0:
        net, backward, forward = at_output(numbers, zone, mesh, u, tau, y)
        contact = from_rest(net, backward, forward, y.q >= numbers.stops.upper, y.q <= numbers.stops.lower, dry)
    if elastic.geared(numbers.elastic):
        motor = sliding(y.w_m > 0.0, friction.present(numbers.friction))
        if y.w_m == 0.0:
            net, backward, forward = at_motor(numbers, zone, mesh, u, y)
            motor = from_rest(net, backward, forward, False, False, friction.present(numbers.friction))
    return with_share(numbers, Mode(zone, contact, mesh, motor, 0), u, tau, y)


def accelerations(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    """Return ẇ [rad/s²] of the output, and of the motor or of what hangs behind an elastic shaft."""
    if elastic.present(numbers.elastic):
        return _of_two(numbers, mode, u, tau, y)
    return contacts.accelerations(numbers, mode, u, tau, y)


def _of_two(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    driving, against = drive_torque(numbers, mode.zone, u, y), external_torque(numbers.load, tau, y.q)
    between = torque(numbers, mode.mesh, y)
    if elastic.behind(numbers.elastic):
        return (_shaft_acceleration(numbers, mode, driving, against + between, y.w),
                behind_acceleration(numbers, between, y))
    return (contacts.output_acceleration(numbers, mode.contact, against - between, y.w),
            _motor_acceleration(numbers, mode, driving, between, y.w_m))


def behind_acceleration(numbers: Numbers, between: float, y: Vector) -> float:
    """Return ẇ [rad/s²] of the body behind an elastic shaft."""
    own = numbers.elastic
    weight = pendulum_torque(y.q_m, own.gravity, own.hanging_angle) if own.gravity != 0.0 else 0.0
    return shaft_acceleration(between, y.w_m, 0.0, weight, own.b, own.J)


def _shaft_acceleration(numbers: Numbers, mode: Mode, driving: float, against: float, w: float) -> float:
    if at_rest(mode.contact):
        return 0.0
    dry = 0.0
    if slides(mode.contact):
        tau_e = torque_on_gear(against, w, numbers.shaft.b_out)
        dry = _dry(numbers, mode.contact, mode.share, w, driving, tau_e, numbers.load.coulomb)
    return shaft.acceleration(numbers.shaft, driving, w, dry, against)


def _motor_acceleration(numbers: Numbers, mode: Mode, driving: float, between: float, w: float) -> float:
    if at_rest(mode.motor):
        return 0.0
    dry = 0.0
    if slides(mode.motor):
        dry = _dry(numbers, mode.motor, mode.share, w, driving, -between, 0.0)
    return shaft.motor_acceleration(numbers.shaft, driving - between, w, dry)


def _dry(numbers: Numbers, contact: int, share: int, w: float, tau_m: float, tau_e: float, more: float) -> float:
    """Return the friction [N m] against +q of a body that slides against the gear, and `more` of a load."""
    forward = contact == FORWARD
    dry = sliding_against(numbers.friction, forward, share, w, tau_m, tau_e) + more
    return dry if forward else -dry


def rebound(numbers: Numbers, mode: Mode, upper: bool, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state after the output has hit a stop; what is at the other end of the spring continues."""
    q = numbers.stops.upper if upper else numbers.stops.lower
    w = rebound_speed(y.w, numbers.stops.restitution)
    after = moving(y, q, w, y.w_m)
    leaving = Mode(zone_now(numbers, mode.zone, u, after), sliding(w > 0.0, is_dry(numbers)), mode.mesh, mode.motor, 0)
    back = accelerations(numbers, leaving, u, tau, after)[0]
    low = back * w < 0.0 and 0.5 * w * w < abs(back) * REST_HEIGHT * max(abs(q), 1.0)
    if abs(w) < REST_SPEED or low:
        after = moving(y, q, 0.0, y.w_m)
    return settled(numbers, zone_now(numbers, mode.zone, u, after), u, tau, after, mode.mesh), after


def zone_now(numbers: Numbers, zone: int, u: float, y: Vector) -> int:
    """Return the zone after the output's speed has jumped, with which that of a motor on the same shaft goes."""
    if elastic.geared(numbers.elastic):
        return zone
    return currents.zone_of(numbers, u, 0.0, y.q, y.w, y.i)
