"""Signals of a servo as it stands: its electrical side, and the torques at its output shaft.

The numbers are those of this instant: at the temperatures of winding and housing, and with the bridge as it is off now.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine.dynamics import currents, spring_contact
from servotwin.models.engine.dynamics.contacts import joint_friction
from servotwin.models.state.modes import INSIDE, Mode, Vector, at_rest
from servotwin.models.terms import bridge, duty, elastic, shaft, source
from servotwin.models.terms.bridge import Bridge, Off
from servotwin.models.terms.control import NOWHERE
from servotwin.models.terms.friction import NO_FRICTION, Friction, holding_friction
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import sensed_voltage
from servotwin.models.terms.source import Source
from servotwin.physics.bridge import bridge_loss, brush_loss
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.motor import electromagnetic_torque, magnetic_energy
from servotwin.physics.shaft import kinetic_energy, load_torque, pendulum_torque, spring_energy, stretch_beyond_play
from servotwin.physics.supply import supply_current

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

_NO_VOLTAGE = 5e-324  # V: a bus without any is still connected
IN_FLOATS = {"_NO_VOLTAGE": 1.2e-38}
_EDGE = 1e-6  # of a limit: what float32 rounds


class Electrical(NamedTuple):
    """Voltages [V], currents [A] and powers [W]; of bus and supply nan where the voltage follows the error."""

    armature_voltage: float
    armature_current: float
    bus_voltage: float
    supply_current: float
    supply_power: float
    bridge_power: float
    brush_power: float


class Torques(NamedTuple):
    """The torques at the output shaft [N m], friction against +q, its acceleration [rad/s²], and what they take."""

    motor: float
    servo_friction: float
    load_friction: float
    external: float
    acceleration: float
    load: float  # that it gets, its inertia included
    gear_loss: float  # power that friction in motor and gear takes [W]
    load_power: float  # that damping, friction and external torque of the load take [W]


class Observed(NamedTuple):
    """Output signals of a servo by their names (SI), those of the motor as they are at the output shaft."""

    armature_voltage: float
    armature_current: float
    bus_voltage: float
    supply_current: float
    motor_torque: float
    load_torque: float
    motor_angle: float
    motor_speed: float
    load_angle: float  # of the body behind an elastic shaft, else of the output
    feedback_voltage: float
    error_time: float
    drive: float
    winding_temperature: float
    housing_temperature: float
    duty: float  # of a digital servo, as all that follows
    goal_angle: float
    reference_angle: float
    trip: float


def electrical(numbers: Numbers, u: float, q: float, w: float, i: float) -> Electrical:
    """Return what happens electrically where the motor turns with w [rad/s]; i [A] counts where it has inertia.

    u [V] is what the servo follows, or ±V_oc or 0 behind a bridge.
    """
    i = _within_limit(numbers.source, i)
    zone = currents.zone_of(numbers, u, 0.0, q, w, i)
    i = currents.flowing(numbers, zone, u, q, w, i)
    if not source.present(numbers.source):
        v = currents.voltage(numbers, zone, u, q)
        return Electrical(v, i, math.nan, math.nan, v * i, 0.0, 0.0)
    path, supply, motor = numbers.bridge, numbers.source, numbers.motor
    V_bus = bridge.bus_voltage(path, supply, motor, zone, u, w, i)
    v = bridge.terminal_voltage(path, supply, motor, u, w, i, V_bus)
    at_brushes = brush_loss(i, path.V_br)
    if u == 0.0 and not bridge.coasts(path):  # a motor that is braked is not on the bus
        return Electrical(v, i, V_bus, 0.0, 0.0, 0.0, at_brushes)
    drawn = supply_current(i, bridge.direction(u))
    V_ce0, r_c = bridge.drops(path, supply, motor, u)
    return Electrical(v, i, V_bus, drawn, V_bus * drawn, bridge_loss(i, V_ce0, r_c), at_brushes)


def bus_voltage(numbers: Numbers, u: float, q: float, w: float, i: float) -> float:
    """Return the voltage of the bus [V] alone; inf where the servo has none."""
    if not source.present(numbers.source):
        return math.inf
    i = _within_limit(numbers.source, i)
    zone = currents.zone_of(numbers, u, 0.0, q, w, i)
    i = currents.flowing(numbers, zone, u, q, w, i)
    return bridge.bus_voltage(numbers.bridge, numbers.source, numbers.motor, zone, u, w, i)


def armature_current(numbers: Numbers, u: float, q: float, w: float, i: float) -> float:
    """Return the armature current [A] alone."""
    i = _within_limit(numbers.source, i)
    return currents.flowing(numbers, currents.zone_of(numbers, u, 0.0, q, w, i), u, q, w, i)


def _within_limit(supply: Source, i: float) -> float:
    """Return a current, at the limit of a regulator but for rounding just there."""
    if source.regulated(supply) and abs(abs(i) - supply.I_max) <= _EDGE * supply.I_max:
        return math.copysign(supply.I_max, i)
    return i


def torques(numbers: Numbers, mode: Mode, w: float, w_motor: float, i: float, external: float) -> Torques:
    """Return all torques at the output shaft under a current [A] and an external torque against +q [N m]."""
    own, dry, bearing, acceleration = numbers.shaft, numbers.load.coulomb, 0.0, 0.0
    tau = electromagnetic_torque(i, numbers.motor.K)
    if mode.mesh == INSIDE:
        behind = numbers.play.bearing
        servo, _ = _friction(numbers.friction, -behind, 0.0, mode.motor, w_motor, tau, 0.0, tau)
        bearing, of_load = _friction(NO_FRICTION, behind, dry, mode.contact, w, 0.0, -external, -external)
        if not at_rest(mode.contact):
            acceleration = shaft.output_acceleration(own, w, bearing + of_load, external)
    else:
        on_gear = torque_on_gear(external, w, own.b_out)
        servo, of_load = _friction(numbers.friction, 0.0, dry, mode.contact, w, tau, on_gear, tau - external)
        if not at_rest(mode.contact):
            acceleration = shaft.acceleration(own, tau, w, servo + of_load, external)
    return Torques(tau, servo, of_load, external, acceleration,
                   load_torque(acceleration, w, of_load, external, own.b_out, own.J_out),
                   ((own.b - own.b_out) * w_motor + servo) * w_motor + bearing * w,
                   (own.b_out * w + of_load + external) * w)


def torques_of_two(numbers: Numbers, mode: Mode, y: Vector, i: float, external: float) -> Torques:
    """Return the same where a spring stands between two bodies; its damper counts as gear, or as load behind it."""
    own, spring, dry, acceleration = numbers.shaft, numbers.elastic, numbers.load.coulomb, 0.0
    tau, w, w_motor = electromagnetic_torque(i, numbers.motor.K), y.w, elastic.turning(numbers.elastic, y)
    ahead, rate = elastic.ahead(spring, y.q, y.q_m), elastic.ahead(spring, y.w, y.w_m)
    between = elastic.torque_at(spring, mode.mesh, ahead, rate)
    taken, lost = elastic.damper_loss(spring, between, ahead, rate), 0.0
    if elastic.behind(spring):
        against = external + between
        servo, of_load = _friction(numbers.friction, 0.0, dry, mode.contact, w, tau,
                                   torque_on_gear(against, w, own.b_out), tau - against)
        if not at_rest(mode.contact):
            acceleration = shaft.acceleration(own, tau, w, servo + of_load, against)
        lost = taken + (spring.b * y.w_m + pendulum_torque(y.q_m, spring.gravity, spring.hanging_angle)) * y.w_m
        taken = 0.0
    else:
        against = external
        servo, _ = _friction(numbers.friction, 0.0, 0.0, mode.motor, w_motor, tau, -between, tau - between)
        _, of_load = _friction(NO_FRICTION, 0.0, dry, mode.contact, w, 0.0, between - external, between - external)
        if not at_rest(mode.contact):
            acceleration = shaft.output_acceleration(own, w, of_load, external - between)
    return Torques(tau, servo, of_load, external, acceleration,
                   load_torque(acceleration, w, of_load, against, own.b_out, own.J_out),
                   ((own.b - own.b_out) * w_motor + servo) * w_motor + taken,
                   (own.b_out * w + of_load + external) * w + lost)


def stored_energy(numbers: Numbers, y: Vector) -> float:
    """Return the energy [J] in moving masses, in a spring between them, and in the magnetic field."""
    own, (_, w, i, _, _, _, w_motor) = numbers.shaft, y
    if elastic.present(numbers.elastic):
        spring = numbers.elastic
        first, second = (own.J, spring.J) if elastic.behind(spring) else (own.J_out, own.J - own.J_out)
        return (kinetic_energy(w, first) + kinetic_energy(w_motor, second) + magnetic_energy(i, numbers.motor.L)
                + spring_energy(stretch_beyond_play(spring_contact.twist(numbers, y), spring.half), spring.k))
    return (kinetic_energy(w, own.J_out) + kinetic_energy(w_motor, own.J - own.J_out)
            + magnetic_energy(i, numbers.motor.L))


def _friction(gear: Friction, more: float, dry: float, contact: int, w: float, tau_m: float, tau_e: float,
              net: float) -> tuple[float, float]:
    """Return the friction of servo and load [N m], against +q, where `net` is what they have to hold at rest.

    That of the servo is its gear's and `more`, that of the load is `dry`.

    At rest friction takes what it has to hold, shared by servo and load in proportion to what each can hold (the
    sharing is assumed: statics does not tell); what remains then is carried by a stop.
    """
    if at_rest(contact):
        low = holding_friction(gear, False, tau_m, tau_e) + more + dry
        high = holding_friction(gear, True, tau_m, tau_e) + more + dry
        held = min(max(net, -low), high)
        limit = high if held > 0.0 else low
        share = dry / limit if limit > 0.0 else 0.0
        return held * (1.0 - share), held * share
    own = joint_friction(gear, more, contact, w, tau_m, tau_e)
    return own, joint_friction(gear, more + dry, contact, w, tau_m, tau_e) - own


def observed(numbers: Numbers, curve: Sequence[Sequence[float]] | NDArray[np.float64], mode: Mode, u: float, tau: float,
             y: Vector, wiper: float, drive: float, error: float) -> Observed:
    """Return all signals of a servo, whose numbers are those of this instant."""
    q, w, i, T_w, T_h, other, w_other = y
    q_motor, w_motor = (q, w) if elastic.behind(numbers.elastic) else (other, w_other)
    circuit = electrical(numbers, u, q, w_motor, i)
    against = external_torque(numbers.load, tau, q)
    if elastic.present(numbers.elastic):
        shaft = torques_of_two(numbers, mode, y, circuit.armature_current, against)
    else:
        shaft = torques(numbers, mode, w, w_motor, circuit.armature_current, against)
    return Observed(circuit.armature_voltage, circuit.armature_current, circuit.bus_voltage, circuit.supply_current,
                    shaft.motor, shaft.load, q_motor, w_motor, other if elastic.behind(numbers.elastic) else q,
                    sensed_voltage(numbers.sensor, curve, wiper), error, drive, T_w, T_h, 0.0, 0.0, 0.0, 0.0)


def told_by(path: Bridge, firm: Any, shown: Observed) -> Observed:
    """Return all signals of a digital servo: those of its plant at its duty, and what its program tells."""
    share, now = duty.share_of(path, firm.duty), firm.duty if abs(firm.duty) <= 1.0 else 0.0
    goal = firm.r if firm.goal == NOWHERE else firm.goal
    return Observed(
        shown.armature_voltage, shown.armature_current / duty.on_share_of(path, firm.duty), shown.bus_voltage / share,
        shown.supply_current * share, shown.motor_torque, shown.load_torque, shown.motor_angle, shown.motor_speed,
        shown.load_angle, shown.feedback_voltage, 0.0, bridge.direction(now), shown.winding_temperature,
        shown.housing_temperature, now, goal, firm.r, float(firm.trip))


def at_motor(shown: Observed, N: float) -> Observed:
    """Return the same signals with those of the motor at its own shaft."""
    return Observed(
        shown.armature_voltage, shown.armature_current, shown.bus_voltage, shown.supply_current,
        shown.motor_torque / N, shown.load_torque, N * shown.motor_angle, N * shown.motor_speed, shown.load_angle,
        shown.feedback_voltage, shown.error_time, shown.drive, shown.winding_temperature, shown.housing_temperature,
        shown.duty, shown.goal_angle, shown.reference_angle, shown.trip)


def on_bus(numbers: Numbers, V_bus: float) -> Numbers:
    """Return a servo on a bus whose voltage is known; that of its source is then left out."""
    path, supply = numbers.bridge, numbers.source
    path = Bridge(path.D_drive, path.R_drive - supply.R_b, _off_on_bus(path.off, supply, V_bus),
                  _off_on_bus(path.silence, supply, V_bus), path.V_br, path.pwm, path.one_way)
    return Numbers(
        numbers.motor, path, Source(max(V_bus, _NO_VOLTAGE), 0.0, math.inf), numbers.follower, numbers.shaft,
        numbers.friction, numbers.load, numbers.stops, numbers.play, numbers.sensor, numbers.heat, numbers.elastic)


def _off_on_bus(off: Off, supply: Source, V_bus: float) -> Off:
    if off.coast == 0.0:
        return off
    return Off(off.D - supply.V + V_bus, off.R if source.regulated(supply) else off.R - supply.R_b, off.coast)
