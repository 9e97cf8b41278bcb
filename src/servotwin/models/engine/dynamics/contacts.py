"""How the shafts move, stick, meet, part and rebound.

With play in the gear there are two bodies, motor and output. Inside the play each moves, sticks and rests on its own;
in contact they are one, as without play. The contact ends when the two, left to themselves, would draw apart.
"""

from __future__ import annotations

from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.dynamics.currents import drive_torque
from servotwin.models.state.modes import (
    BACKWARD,
    CORE,
    FORWARD,
    FREE,
    INSIDE,
    ON_BACKWARD,
    ON_FORWARD,
    STUCK,
    Mode,
    Vector,
    at_rest,
    moving,
    sign_of,
    slides,
)
from servotwin.models.terms import friction, play, shaft, source
from servotwin.models.terms.friction import NO_FRICTION, Friction, holding_friction, sliding_friction
from servotwin.models.terms.load import dry as has_dry_load
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.sensor import slack
from servotwin.models.terms.shaft import from_rest, sliding
from servotwin.physics.backlash import rebound_speed
from servotwin.physics.friction import smoothed_coulomb_torque
from servotwin.physics.load_friction import torque_on_gear

REST_SPEED = 1e-6  # rad/s: below this a rebound from a stop comes to rest
NEXT_TO_NOTHING = 1e-300  # N m: where a current is about to flow
REST_HEIGHT = 1e-12  # rad (of an angle above 1: relative): a rebound this low is none, a body this near to a stop on it
IN_FLOATS = {"NEXT_TO_NOTHING": 1e-30, "REST_HEIGHT": 2e-6}
CALLED = ("settled",)  # after events alone: with copies all that follows legs takes half as long again to compile


def has_friction(numbers: Numbers) -> bool:
    """Tell whether there is any friction other than viscous, or turning points count as much as if there were."""
    return friction.present(numbers.friction) or holds(numbers)


def holds(numbers: Numbers) -> bool:
    """Tell whether the output side may hold itself: by dry friction; a potentiometer with play marks its turns."""
    return has_dry_load(numbers.load) or numbers.play.bearing > 0.0 or slack(numbers.sensor)


def output_friction(numbers: Numbers) -> float:
    """Return the dry friction [N m] of the output side inside the play: of its bearing and of the load."""
    return numbers.play.bearing + numbers.load.coulomb


def motor_hold(numbers: Numbers, forward: bool, tau_m: float) -> float:
    """Return the torque [N m] up to which the motor alone holds itself against a start, inside the play."""
    return holding_friction(numbers.friction, forward, tau_m, 0.0) - numbers.play.bearing


def holding_bounds(numbers: Numbers, tau_m: float, tau_e: float) -> tuple[float, float]:
    """Return the torques [N m] that friction holds at rest, against a start backward and forward."""
    return (holding_friction(numbers.friction, False, tau_m, tau_e) + numbers.load.coulomb,
            holding_friction(numbers.friction, True, tau_m, tau_e) + numbers.load.coulomb)


def friction_torque(numbers: Numbers, contact: int, w: float, tau_m: float, tau_e: float) -> float:
    """Return the friction [N m] against +q of motor and output moving as one, the load's own included."""
    return joint_friction(numbers.friction, numbers.load.coulomb, contact, w, tau_m, tau_e)


def joint_friction(own: Friction, dry: float, contact: int, w: float, tau_m: float, tau_e: float) -> float:
    """Return the friction [N m] against +q of a gear and of a load with so much dry friction [N m]."""
    if contact == FORWARD:
        return sliding_friction(own, True, w, tau_m, tau_e) + dry
    if contact == BACKWARD:
        return -sliding_friction(own, False, w, tau_m, tau_e) - dry
    if contact == CORE:
        forward, backward = core_friction(own, dry)
        return smoothed_coulomb_torque(w, forward, backward, own.kappa)
    return 0.0


def core_friction(own: Friction, dry: float) -> tuple[float, float]:
    """Return the magnitudes [N m] forward and backward of a smoothed friction, that of a load included."""
    return own.F_forward + dry, own.F_backward + dry


def settled(numbers: Numbers, zone: int, u: float, tau: float, y: Vector, mesh: int, smooth: bool) -> Mode:
    """Return the mode of a state in a zone; `smooth` keeps a smoothed friction in one piece."""
    w = y.w
    if play.present(numbers.play) and mesh == INSIDE:
        return apart(numbers, zone, u, tau, y)
    if friction.smoothed(numbers.friction):
        if not has_friction(numbers):
            return Mode(zone, FREE, mesh, FREE, 0)
        if smooth or abs(w) <= friction.core_speed(numbers.friction):
            return Mode(zone, CORE, mesh, FREE, 0)
        return Mode(zone, FORWARD if w > 0.0 else BACKWARD, mesh, FREE, 0)
    mode = as_one(numbers, zone, u, tau, y, mesh)
    if play.present(numbers.play) and pressing(numbers, mode, u, tau, y) < 0.0:
        return apart(numbers, zone, u, tau, y)
    return mode


def as_one(numbers: Numbers, zone: int, u: float, tau: float, y: Vector, mesh: int) -> Mode:
    """Return the mode of motor and output as one body, with true sticking, whether or not they press together."""
    q, w = y.q, y.w
    if w == 0.0:
        torque = drive_torque(numbers, zone, u, y)
        against = external_torque(numbers.load, tau, q)
        backward, forward = holding_bounds(numbers, torque, -against)
        contact = from_rest(torque - against, backward, forward, numbers.stops.upper - q <= REST_HEIGHT,
                            q - numbers.stops.lower <= REST_HEIGHT, has_friction(numbers))
    else:
        contact = sliding(w > 0.0, has_friction(numbers))
    return Mode(zone, contact, mesh, FREE, share_sign(numbers, zone, contact, mesh, u, tau, y))


def held(numbers: Numbers, zone: int, u: float, tau: float, y: Vector, mesh: int) -> Mode:
    """Return the mode of motor and output that stay together until the inputs change, whether or not they press."""
    mode = as_one(numbers, zone, u, tau, y, mesh)
    return Mode(zone, mode.contact, mesh, STUCK, mode.share)


def share_sign(numbers: Numbers, zone: int, contact: int, mesh: int, u: float, tau: float, y: Vector) -> int:
    """Return the sign of what the torques through a gear add to its friction before its magnitude is taken.

    `contact` is that of the body that slides against the gear: inside the play, of the motor.
    """
    if not slides(contact) or not friction.shared(numbers.friction):
        return 0
    torque = drive_torque(numbers, zone, u, y)
    tau_m = torque if torque != 0.0 else sign_of(zone) * NEXT_TO_NOTHING
    return 1 if through_gear(numbers, mesh, tau_m, tau, y) >= 0.0 else -1


def through_gear(numbers: Numbers, mesh: int, tau_m: float, tau: float, y: Vector) -> float:
    """Return the torque through the gear [N m] whose magnitude adds to friction that slides: inside, the motor's."""
    if mesh == INSIDE:
        return friction.share(numbers.friction, tau_m, 0.0)
    against = external_torque(numbers.load, tau, y.q)
    return friction.share(numbers.friction, tau_m, torque_on_gear(against, y.w, numbers.shaft.b_out))


def apart(numbers: Numbers, zone: int, u: float, tau: float, y: Vector) -> Mode:
    """Return the mode of two bodies inside the play."""
    torque, against = drive_torque(numbers, zone, u, y), external_torque(numbers.load, tau, y.q)
    held, dry = holds(numbers), friction.present(numbers.friction)
    contact, motor = sliding(y.w > 0.0, held), sliding(y.w_m > 0.0, dry)
    if y.w == 0.0:
        hold = output_friction(numbers)
        contact = from_rest(-against, hold, hold, numbers.stops.upper - y.q <= REST_HEIGHT,
                            y.q - numbers.stops.lower <= REST_HEIGHT, held)
    if y.w_m == 0.0:
        motor = from_rest(torque, motor_hold(numbers, False, torque), motor_hold(numbers, True, torque), False, False,
                          dry)
    return Mode(zone, contact, INSIDE, motor, share_sign(numbers, zone, motor, INSIDE, u, tau, y))


def motor_acceleration(numbers: Numbers, motor: int, torque: float, w: float) -> float:
    """Return the acceleration [rad/s²] of the motor alone, inside the play."""
    if at_rest(motor):
        return 0.0
    dry = motor_friction(numbers, motor, w, torque)
    return shaft.motor_acceleration(numbers.shaft, torque, w, dry)


def motor_friction(numbers: Numbers, motor: int, w: float, torque: float) -> float:
    """Return the friction [N m] against +q of the motor alone, inside the play, that has a torque [N m]."""
    return joint_friction(numbers.friction, -numbers.play.bearing, motor, w, torque, 0.0)


def output_acceleration(numbers: Numbers, contact: int, against: float, w: float) -> float:
    """Return the acceleration [rad/s²] of the output side alone, inside the play."""
    if at_rest(contact):
        return 0.0
    dry = joint_friction(NO_FRICTION, output_friction(numbers), contact, w, 0.0, 0.0)
    return shaft.output_acceleration(numbers.shaft, w, dry, against)


def pressing(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> float:
    """Return how motor and output in contact would close in [rad/s²] if each continued alone; below 0 they part."""
    w = y.w
    if w != 0.0:
        return pressing_along(numbers, mode, u, tau, y)
    alone = apart(numbers, mode.zone, u, tau, moving(y, y.q, 0.0, 0.0))
    return _closing(numbers, mode, alone.motor, alone.contact, u, tau, y)


def pressing_along(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> float:
    """Return the same of bodies that slide.

    A mode that ends where the speed is zero keeps its law there, or it would end by its parting first.
    """
    forward = mode.contact == FORWARD if slides(mode.contact) else y.w > 0.0
    return _closing(numbers, mode, sliding(forward, friction.present(numbers.friction)),
                    sliding(forward, holds(numbers)), u, tau, y)


def _closing(numbers: Numbers, mode: Mode, motor: int, contact: int, u: float, tau: float, y: Vector) -> float:
    torque, against = drive_torque(numbers, mode.zone, u, y), external_torque(numbers.load, tau, y.q)
    gain = motor_acceleration(numbers, motor, torque, y.w) - output_acceleration(numbers, contact, against, y.w)
    return gain if mode.mesh == ON_FORWARD else -gain


def rebound(numbers: Numbers, mode: Mode, upper: bool, u: float, tau: float, y: Vector) -> tuple[Mode, Vector]:
    """Return mode and state after the output has hit a stop; with it the motor, unless it only follows.

    Where both are about to rest there and touch they rest together: the motor would come back to the output for ever.
    """
    q = numbers.stops.upper if upper else numbers.stops.lower
    w = rebound_speed(y.w, numbers.stops.restitution)
    pushes = mode.mesh == (ON_FORWARD if upper else ON_BACKWARD)
    rests = mode.mesh != INSIDE and abs(w) < REST_SPEED and abs(y.w_m) < REST_SPEED
    together = not play.present(numbers.play) or pushes or rests
    mesh = mode.mesh if together else INSIDE
    after = moving(y, q, w, y.w_m)
    if together:
        after = with_motor(numbers.play, mesh, after)
    zone = mode.zone
    if source.present(numbers.source):  # the current goes with the speed
        zone = currents.zone_of(numbers, u, 0.0, q, after.w_m, y.i)
    if mesh == INSIDE:
        back = output_acceleration(numbers, sliding(w > 0.0, holds(numbers)), external_torque(numbers.load, tau, q), w)
    else:
        back = acceleration(numbers, Mode(zone, sliding(w > 0.0, has_friction(numbers)), mesh, FREE, 0), u, tau, after)
    low = back * w < 0.0 and 0.5 * w * w < abs(back) * REST_HEIGHT * max(abs(q), 1.0)
    if abs(w) < REST_SPEED or low:
        after = moving(after, q, 0.0, after.w_m if mesh == INSIDE else 0.0)
        if source.present(numbers.source):
            zone = currents.zone_of(numbers, u, 0.0, q, after.w_m, y.i)
    return settled(numbers, zone, u, tau, after, mesh, False), after


def acceleration(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> float:
    """Return ẇ [rad/s²] of motor and output moving as one."""
    if at_rest(mode.contact):
        return 0.0
    q, w = y.q, y.w
    torque, against = drive_torque(numbers, mode.zone, u, y), external_torque(numbers.load, tau, q)
    dry = joint_friction(numbers.friction, numbers.load.coulomb, mode.contact, w, torque,
                         torque_on_gear(against, w, numbers.shaft.b_out))
    return shaft.acceleration(numbers.shaft, torque, w, dry, against)


def accelerations(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    """Return ẇ [rad/s²] of the output side and of the motor, which inside the play are two bodies."""
    if mode.mesh != INSIDE:
        dw = acceleration(numbers, mode, u, tau, y)
        return dw, dw
    torque, against = drive_torque(numbers, mode.zone, u, y), external_torque(numbers.load, tau, y.q)
    return (output_acceleration(numbers, mode.contact, against, y.w),
            motor_acceleration(numbers, mode.motor, torque, y.w_m))
