"""A mode's equation of motion: its coefficients, for the exact solutions, and the rates of the state."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.engine.dynamics import contacts, currents, spring_contact
from servotwin.models.state.modes import (
    CONDUCTING,
    CORE,
    FORWARD,
    INSIDE,
    Mode,
    Vector,
    at_rest,
    constant_current,
    in_linear_zone,
)
from servotwin.models.terms import follower, heat, shaft
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.friction import share_slopes
from servotwin.models.terms.load import external_torque, springy, stiffness_at
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.shaft import accelerated, acceleration
from servotwin.physics import electronics, friction, motor, potentiometer
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.shaft import spring_torque

# --- The coefficients of a mode's equation of motion, for the exact solutions of `first_order` and `second_order` -----

def linear_coefficients(numbers: Numbers, mode: Mode, u: tuple[float, ...], tau: tuple[float, ...],
                        q: float, w: float) -> tuple[float, ...]:
    """Return (a, c, f0, f1, fs, Ω, φ, q0, w0) of the motion of a linear sliding mode without inductance.

    `u` is (value, slope, amplitude, frequency, phase) of the command at the start of the motion, `tau` (value,
    slope) of the external torque; see `second_order`.
    """
    stiffness = pull = 0.0
    if springy(numbers.load):
        stiffness = spring_torque(1.0, numbers.load.stiffness)
        pull = spring_torque(0.0, numbers.load.stiffness, numbers.load.rest_angle)
    of_motor, of_load = _taken(numbers, mode)
    on_gear = torque_on_gear(pull + tau[0], 0.0, numbers.shaft.b_out)
    torque = -pull - contacts.friction_torque(numbers, mode.contact, w, 0.0, 0.0) - tau[0] - of_load * on_gear
    rate = -tau[1] - of_load * torque_on_gear(tau[1], 0.0, numbers.shaft.b_out)
    stiffness += of_load * torque_on_gear(stiffness, 0.0, numbers.shaft.b_out)
    sinusoid = per_volt = 0.0
    if constant_current(mode.zone):
        i = currents.current(numbers, mode.zone, u[0], q, w)
        torque += (1.0 - of_motor) * motor.electromagnetic_torque(i, numbers.motor.K)
    elif mode.zone >= CONDUCTING:
        v, R = currents.loop(numbers, mode.zone, u[0])
        per_volt = (1.0 - of_motor) * currents.torque_per_volt(numbers, R)
        torque += per_volt * v
    elif in_linear_zone(mode.zone):
        per_volt = currents.torque_per_volt(numbers, numbers.motor.R)
        gain = per_volt * follower.voltage_slope(numbers.follower, 1.0)
        stiffness -= gain * electronics.feedback_error(0.0, potentiometer.feedback_voltage(1.0, numbers.sensor.p))
        torque += per_volt * currents.voltage(numbers, mode.zone, u[0], 0.0)
        rate += gain * electronics.feedback_error(u[1], 0.0)
        sinusoid = gain * electronics.feedback_error(u[2], 0.0)
    else:
        per_volt = currents.torque_per_volt(numbers, numbers.motor.R)
        torque += per_volt * follower.voltage(numbers.follower, mode.zone, 0.0)
    own = numbers.shaft
    damping = (own.b + of_load * torque_on_gear(0.0, 1.0, own.b_out)
               + per_volt * motor.back_emf(1.0, numbers.motor.K_b))
    a, f0 = 0.5 * accelerated(own, damping), accelerated(own, torque)
    if stiffness == 0.0 and rate == 0.0 and sinusoid == 0.0:
        return a, 0.0, f0, 0.0, 0.0, u[3], u[4], q, w
    return a, accelerated(own, stiffness), f0, accelerated(own, rate), accelerated(own, sinusoid), u[3], u[4], q, w


class Apart(NamedTuple):
    """The laws of two bodies inside the play, each ẇ = f − λ w; nothing of one at rest."""

    output_rate: float  # λ of the output [1/s]
    output_pull: float  # f of the output [rad/s²]
    motor_rate: float
    motor_pull: float


def apart_coefficients(numbers: Numbers, mode: Mode, u: float, tau: float) -> Apart:
    """Return the laws of motor and output inside the play, behind a bridge and under constant torques [N m]."""
    own, zone = numbers.shaft, mode.zone
    output_rate = output_pull = motor_rate = motor_pull = 0.0
    if not at_rest(mode.contact):
        output_rate = -shaft.output_acceleration(own, 1.0, 0.0, 0.0)
        output_pull = contacts.output_acceleration(numbers, mode.contact, external_torque(numbers.load, tau, 0.0), 0.0)
    if not at_rest(mode.motor):
        left = 1.0 - _taken(numbers, mode)[0]  # of the motor's torque, after what friction takes of it
        torque = motor.electromagnetic_torque(currents.current(numbers, zone, u, 0.0, 0.0), numbers.motor.K)
        drag = motor.back_emf(1.0, numbers.motor.K_b) * currents.torque_per_volt(
            numbers, currents.resistance(numbers, zone, u))
        motor_rate = -shaft.motor_acceleration(own, -left * drag, 1.0, 0.0)
        dry = contacts.motor_friction(numbers, mode.motor, 0.0, 0.0)
        motor_pull = shaft.motor_acceleration(own, left * torque, 0.0, dry)
    return Apart(output_rate, output_pull, motor_rate, motor_pull)


def speed_coefficients(numbers: Numbers, mode: Mode, u: tuple[float, ...], against: tuple[float, ...],
                       w: float, i: float) -> tuple[float, ...]:
    """Return the coefficients of the speed of a motor with inductance, without feedback or spring.

    From L di/dt = v − R i − K_b w and J ẇ = K i − b w − τ, where `against` is (value, slope) of all constant and
    external torque τ, and `u` as in `linear_coefficients`. The share of the torques that friction takes is a part of K,
    b and τ.
    """
    R, L, K_b = numbers.motor.R, numbers.motor.L, numbers.motor.K_b
    of_motor, of_load = _taken(numbers, mode)
    follows = in_linear_zone(mode.zone)
    if mode.zone >= CONDUCTING:
        v, R = currents.loop(numbers, mode.zone, u[0])
    else:
        v = currents.voltage(numbers, mode.zone, u[0], 0.0)
    gain = follower.voltage_slope(numbers.follower, 1.0) * electronics.feedback_error(1.0, 0.0) if follows else 0.0
    # ẅ + (R/L + b/J) ẇ + … : rates of the current by a volt, an ampere and a radian per second
    rise = motor.armature_current_rate(1.0, 0.0, 0.0, R, L, K_b)
    fade = -motor.armature_current_rate(0.0, 1.0, 0.0, R, L, K_b)
    brake = -motor.armature_current_rate(0.0, 0.0, 1.0, R, L, K_b)
    own = numbers.shaft
    by_ampere = per_ampere(numbers, mode)
    drag = accelerated(own, own.b + of_load * torque_on_gear(0.0, 1.0, own.b_out))
    held, held_more = accelerated(own, against[0]), accelerated(own, against[1])
    per_volt = by_ampere * rise
    return (0.5 * (fade + drag), fade * drag + by_ampere * brake, per_volt * v - fade * held - held_more,
            per_volt * gain * u[1] - fade * held_more, per_volt * gain * u[2], u[3], u[4], w,
            acceleration(own, (1.0 - of_motor) * motor.electromagnetic_torque(i, numbers.motor.K), w,
                         of_load * torque_on_gear(0.0, w, own.b_out), against[0]))


def against_of(numbers: Numbers, mode: Mode, w: float, tau: tuple[float, float]) -> tuple[float, float]:
    """Return value and slope of all torque against a shaft that slides [N m], but for what its speed adds.

    `tau` is (value, slope) of the external torque.
    """
    _, of_load = _taken(numbers, mode)
    dry = contacts.friction_torque(numbers, mode.contact, w, 0.0, 0.0)
    return (tau[0] + dry + of_load * torque_on_gear(tau[0], 0.0, numbers.shaft.b_out),
            tau[1] + of_load * torque_on_gear(tau[1], 0.0, numbers.shaft.b_out))


def current_of(numbers: Numbers, mode: Mode, dw: float, w: float, against: float) -> float:
    """Return the armature current [A] by which a shaft speeds up so, at a speed and against a torque [N m].

    The law is linear, so that the same holds of their rates of change.
    """
    own = numbers.shaft
    _, of_load = _taken(numbers, mode)
    drag = of_load * torque_on_gear(0.0, w, own.b_out)
    return (dw - acceleration(own, 0.0, w, drag, against)) / per_ampere(numbers, mode)


def per_ampere(numbers: Numbers, mode: Mode) -> float:
    """Return the acceleration of what the motor turns by an ampere [rad/s²/A], after what friction takes of it."""
    of_motor, _ = _taken(numbers, mode)
    torque = (1.0 - of_motor) * motor.electromagnetic_torque(1.0, numbers.motor.K)
    if mode.mesh != INSIDE:
        return accelerated(numbers.shaft, torque)
    return shaft.motor_acceleration(numbers.shaft, torque, 0.0, 0.0)


def drag(numbers: Numbers, mode: Mode) -> float:
    """Return by how much a speed slows down what the motor turns, the motor's own torque apart [1/s]."""
    own = numbers.shaft
    if mode.mesh == INSIDE:
        return -shaft.motor_acceleration(own, 0.0, 1.0, 0.0)
    return accelerated(own, own.b + _taken(numbers, mode)[1] * torque_on_gear(0.0, 1.0, own.b_out))


def _taken(numbers: Numbers, mode: Mode) -> tuple[float, float]:
    """Return what friction takes of the torques of motor and load while the share keeps its sign [1]."""
    if mode.share == 0:
        return 0.0, 0.0
    slides = mode.motor if mode.mesh == INSIDE else mode.contact
    return share_slopes(numbers.friction, slides == FORWARD, float(mode.share))


def fading_coefficients(numbers: Numbers, mode: Mode, u: float) -> tuple[float, float]:
    """Return the rate [1/s] at which the current of a shaft at rest goes to its final value [A], and that value."""
    v, R = currents.loop(numbers, mode.zone, u)
    L, K_b = numbers.motor.L, numbers.motor.K_b
    rate = -motor.armature_current_rate(0.0, 1.0, 0.0, R, L, K_b)
    return rate, motor.armature_current_rate(v, 0.0, 0.0, R, L, K_b) / rate


# --- The rates of the state in each mode, and how they depend on it ---------------------------------------------------

def rates_of(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> Vector:
    """Return the rate of every number of the state."""
    if heat.present(numbers.heat):
        return _rates(warm(numbers, y), mode, u, tau, y)
    return _rates(numbers, mode, u, tau, y)


def _rates(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> Vector:
    di = dT_w = dT_h = 0.0
    if inductive(numbers.motor):
        di = currents.current_rate(numbers, mode.zone, u, y.q, turning(numbers.elastic, y), y.i)
    if heat.present(numbers.heat):
        i = y.i if inductive(numbers.motor) else currents.current(
            numbers, mode.zone, u, y.q, turning(numbers.elastic, y))
        dT_w, dT_h = heat.warming_rates(numbers.heat, numbers.motor.R, i, y.T_w, y.T_h)
    dw, dw_m = spring_contact.accelerations(numbers, mode, u, tau, y)
    return Vector(y.w, dw, di, dT_w, dT_h, y.w_m, dw_m)


def jacobian(numbers: Numbers, mode: Mode, u: float, du: float, dtau: float, q: float, w: float) -> tuple[float, ...]:
    """Return ∂ẇ/∂(q, w, i), ∂(di/dt)/∂(q, w, i), and the rates of ẇ and di/dt with time alone, of a rigid gear."""
    vu = electronics.proportional_voltage(1.0, numbers.follower.gain) if in_linear_zone(mode.zone) else 0.0
    vq = -vu * potentiometer.feedback_voltage(1.0, numbers.sensor.p)
    Eq = Ew = Ei = Eu = 0.0
    Fq = -stiffness_at(numbers.load, q)
    Fw = -numbers.shaft.b
    Fi = Fu = 0.0
    if mode.contact == CORE:
        forward, backward = contacts.core_friction(numbers.friction, numbers.load.coulomb)
        Fw -= friction.smoothed_coulomb_slope(w, forward, backward, numbers.friction.kappa)
    if inductive(numbers.motor):  # current and torque are linear, so units give the coefficients
        R, L, K_b = numbers.motor.R, numbers.motor.L, numbers.motor.K_b
        Eq = motor.armature_current_rate(vq, 0.0, 0.0, R, L, K_b)
        Eu = motor.armature_current_rate(vu, 0.0, 0.0, R, L, K_b)
        Ew = motor.armature_current_rate(0.0, 0.0, 1.0, R, L, K_b)
        Ei = motor.armature_current_rate(0.0, 1.0, 0.0, R, L, K_b)
        Fi = motor.electromagnetic_torque(1.0, numbers.motor.K)
    else:
        per_volt = currents.torque_per_volt(numbers, currents.resistance(numbers, mode.zone, u))
        Fq += per_volt * vq
        Fw -= per_volt * motor.back_emf(1.0, numbers.motor.K_b)
        Fu = per_volt * vu
    if at_rest(mode.contact):
        return 0.0, 0.0, 0.0, 0.0, 0.0, Ei, 0.0, Eu * du
    body = numbers.shaft
    return (accelerated(body, Fq), accelerated(body, Fw), accelerated(body, Fi), Eq, Ew, Ei,
            accelerated(body, Fu * du - dtau), Eu * du)
