"""The rates of the state in each mode, and how they depend on it."""

from __future__ import annotations

from servotwin.models.engine.dynamics import contacts, currents, spring_contact
from servotwin.models.state.modes import CORE, Mode, Vector, at_rest, in_linear_zone
from servotwin.models.terms import heat
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.load import stiffness_at
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.shaft import accelerated
from servotwin.physics import electronics, friction, motor, potentiometer


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
