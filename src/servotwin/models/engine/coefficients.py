"""The coefficients of a mode's equation of motion, for the exact solutions of `first_order` and `second_order`."""

from __future__ import annotations

from servotwin.models.terms import armature, contact
from servotwin.models.terms.plant import CONDUCTING, Mode, Plant
from servotwin.physics import electronics, motor, potentiometer, shaft


def linear_coefficients(plant: Plant, mode: Mode, u: tuple[float, ...], tau: tuple[float, ...],
                        q: float, w: float) -> tuple[float, ...]:
    """Return (a, c, f0, f1, fs, Ω, φ, q0, w0) of the motion of a linear sliding mode without inductance.

    `u` is (value, slope, amplitude, frequency, phase) of the command at the start of the motion, `tau` (value,
    slope) of the external torque; see `second_order`.
    """
    per_volt = motor.electromagnetic_torque(armature.conductance(plant, mode.zone, u[0]), plant.K)
    damping = plant.b + per_volt * motor.back_emf(1.0, plant.K_b)
    stiffness = shaft.spring_torque(1.0, plant.stiffness)
    torque = -shaft.spring_torque(0.0, plant.stiffness, plant.rest_angle) - contact.friction_torque(
        plant, mode.contact, w, 0.0, 0.0) - tau[0]
    rate = -tau[1]
    sinusoid = 0.0
    if armature.in_linear_zone(mode.zone):
        gain = per_volt * electronics.proportional_voltage(1.0, plant.gain)
        stiffness += gain * potentiometer.feedback_voltage(1.0, plant.p)
        torque += per_volt * armature.voltage(plant, mode.zone, armature.error_of(plant, u[0], 0.0))
        rate += gain * u[1]
        sinusoid = gain * u[2]
    elif armature.constant_current(mode.zone):
        torque += motor.electromagnetic_torque(armature.current(plant, mode.zone, u[0], q, w), plant.K)
    elif mode.zone >= CONDUCTING:
        torque += per_volt * armature.loop(plant, mode.zone, u[0])[0]
    else:
        torque += per_volt * armature.voltage(plant, mode.zone, 0.0)
    return (0.5 * contact.accelerated(plant, damping), contact.accelerated(plant, stiffness),
            contact.accelerated(plant, torque), contact.accelerated(plant, rate),
            contact.accelerated(plant, sinusoid), u[3], u[4], q, w)


def speed_coefficients(plant: Plant, mode: Mode, u: tuple[float, ...], against: tuple[float, ...],
                       w: float, i: float) -> tuple[float, ...]:
    """Return the coefficients of the speed of a motor with inductance, without feedback or spring.

    From L di/dt = v − R i − K_b w and J ẇ = K i − b w − τ, where `against` is (value, slope) of all constant and
    external torque τ, and `u` as in `linear_coefficients`.
    """
    R, L, K_b = plant.R, plant.L, plant.K_b
    follows = armature.in_linear_zone(mode.zone)
    if mode.zone >= CONDUCTING:
        v, R = armature.loop(plant, mode.zone, u[0])
    else:
        v = armature.voltage(plant, mode.zone, armature.error_of(plant, u[0], 0.0))
    gain = electronics.proportional_voltage(1.0, plant.gain) if follows else 0.0
    # ẅ + (R/L + b/J) ẇ + … : rates of the current by a volt, an ampere and a radian per second
    rise = motor.armature_current_rate(1.0, 0.0, 0.0, R, L, K_b)
    fade = -motor.armature_current_rate(0.0, 1.0, 0.0, R, L, K_b)
    brake = -motor.armature_current_rate(0.0, 0.0, 1.0, R, L, K_b)
    per_ampere = contact.accelerated(plant, motor.electromagnetic_torque(1.0, plant.K))
    drag = contact.accelerated(plant, plant.b)
    held, held_more = contact.accelerated(plant, against[0]), contact.accelerated(plant, against[1])
    per_volt = per_ampere * rise
    return (0.5 * (fade + drag), fade * drag + per_ampere * brake, per_volt * v - fade * held - held_more,
            per_volt * gain * u[1] - fade * held_more, per_volt * gain * u[2], u[3], u[4], w,
            shaft.shaft_acceleration(motor.electromagnetic_torque(i, plant.K), w, 0.0, against[0], plant.b, plant.J))
