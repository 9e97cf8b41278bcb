"""The coefficients of a mode's equation of motion, for the exact solutions of `first_order` and `second_order`."""

from __future__ import annotations

from servotwin.models.kernels import armature, contact
from servotwin.models.kernels.plant import CONDUCTING, Mode, Plant


def linear_coefficients(plant: Plant, mode: Mode, u: tuple[float, ...], tau: tuple[float, ...],
                        q: float, w: float) -> tuple[float, ...]:
    """Return (a, c, f0, f1, fs, Ω, φ, q0, w0) of the motion of a linear sliding mode without inductance.

    `u` is (value, slope, amplitude, frequency, phase) of the command at the start of the motion, `tau` (value,
    slope) of the external torque; see `second_order`.
    """
    per_volt = plant.K * armature.conductance(plant, mode.zone, u[0])
    damping = plant.b + per_volt * plant.K_b
    stiffness = plant.stiffness
    torque = plant.stiffness * plant.rest_angle - contact.friction_torque(plant, mode.contact, w, 0.0, 0.0) - tau[0]
    rate = -tau[1]
    sinusoid = 0.0
    if armature.in_linear_zone(mode.zone):
        gain = per_volt * plant.gain
        stiffness += gain * plant.p
        torque += gain * (u[0] - plant.b_o - mode.zone * plant.half_deadband)
        rate += gain * u[1]
        sinusoid = gain * u[2]
    elif armature.constant_current(mode.zone):
        torque += plant.K * armature.current(plant, mode.zone, u[0], q, w)
    elif mode.zone >= CONDUCTING:
        torque += per_volt * armature.loop(plant, mode.zone, u[0])[0]
    else:
        torque += per_volt * armature.voltage(plant, mode.zone, 0.0)
    J = plant.J
    return (0.5 * damping / J, stiffness / J, torque / J, rate / J, sinusoid / J, u[3], u[4], q, w)


def speed_coefficients(plant: Plant, mode: Mode, u: tuple[float, ...], against: tuple[float, ...],
                       w: float, i: float) -> tuple[float, ...]:
    """Return the coefficients of the speed of a motor with inductance, without feedback or spring.

    From L di/dt = v − R i − K_b w and J ẇ = K i − b w − τ, where `against` is (value, slope) of all constant and
    external torque τ, and `u` as in `linear_coefficients`.
    """
    J, b, K, R, L = plant.J, plant.b, plant.K, plant.R, plant.L
    per_volt = K / (L * J)
    follows = armature.in_linear_zone(mode.zone)
    if mode.zone >= CONDUCTING:
        v, R = armature.loop(plant, mode.zone, u[0])
    else:
        v = armature.voltage(plant, mode.zone, u[0] - plant.b_o)
    dv, wave = (plant.gain * u[1], plant.gain * u[2]) if follows else (0.0, 0.0)
    f0 = per_volt * v - R / (L * J) * against[0] - against[1] / J
    f1 = per_volt * dv - R / (L * J) * against[1]
    return (0.5 * (R / L + b / J), (R * b + K * plant.K_b) / (L * J), f0, f1, per_volt * wave, u[3], u[4], w,
            (K * i - b * w - against[0]) / J)
