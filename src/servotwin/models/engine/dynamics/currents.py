"""Which way the current flows and how large it is: behind a bridge, or where the voltage follows the error.

A servo whose bus voltage is given has u = s V_bus in its circuit, where s is the sign, or the duty of a bridge under
PWM; its numbers are those of a stiff source.
"""

from __future__ import annotations

import math

from servotwin.models.state.modes import (
    CONDUCTING,
    NO_CURRENT,
    Vector,
    constant_current,
    in_linear_zone,
    limited,
    sign_of,
)
from servotwin.models.terms import bridge, duty, follower
from servotwin.models.terms import source as source_term
from servotwin.models.terms.bridge import Bridge, coasts
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import error_of, error_rate
from servotwin.models.terms.source import Source
from servotwin.physics import motor
from servotwin.physics.bridge import bridge_current

# --- Which way the current flows and how large it is ------------------------------------------------------------------

def by_current(numbers: Numbers, zone: int) -> bool:
    """Tell whether a zone behind a bridge lasts as long as its current does: where the current has inertia."""
    return inductive(numbers.motor) and not constant_current(zone)


def zone_limits(numbers: Numbers, zone: int, u: float) -> tuple[float, float]:
    """Return the values of `zone_variable` between which a zone lies."""
    if zone >= CONDUCTING:
        return bridge.zone_limits(numbers.bridge, numbers.source, by_current(numbers, zone), zone, u)
    return follower.zone_limits(numbers.follower, zone)


def zone_variable(numbers: Numbers, zone: int, u: float, q: float, w: float, i: float) -> float:
    """Return what a zone lasts by: the error v_e [V]; behind a bridge what drives the current [V], or itself [A]."""
    if source_term.present(numbers.source):
        return i if by_current(numbers, zone) else u - motor.back_emf(w, numbers.motor.K_b)
    return error_of(numbers.sensor, u, q)


def zone_rate(numbers: Numbers, zone: int, du: float, w: float, dw: float, di: float) -> float:
    """Return the rate of `zone_variable`, where the motor turns with w and the output at the same speed."""
    if source_term.present(numbers.source):
        return di if by_current(numbers, zone) else du - motor.back_emf(dw, numbers.motor.K_b)
    return error_rate(numbers.sensor, du, w)


def zone_of(numbers: Numbers, u: float, du: float, q: float, w: float, i: float) -> int:
    """Return the zone of a state; on a boundary of the error, the one that it moves into."""
    if source_term.present(numbers.source):
        x = u - motor.back_emf(w, numbers.motor.K_b)
        return bridge.zone_of(numbers.bridge, numbers.source, numbers.motor, u, x, i)
    return follower.zone_of(numbers.follower, error_of(numbers.sensor, u, q), error_rate(numbers.sensor, du, w))


def neighbour(numbers: Numbers, zone: int, up: bool) -> int:
    """Return the zone that follows on one that has ended, upwards or downwards."""
    step = 1 if up else -1
    return zone + step if zone >= CONDUCTING else follower.neighbour(numbers.follower, zone, step)


def loop(numbers: Numbers, zone: int, u: float) -> tuple[float, float]:
    """Return voltage [V], with its drop, and resistance [Ω] of the loop of a zone behind a bridge."""
    return bridge.loop(numbers.bridge, numbers.source, zone, u)


def resistance(numbers: Numbers, zone: int, u: float) -> float:
    """Return the resistance of the motor's circuit in a zone [Ω]; inf where the current stays."""
    if constant_current(zone):
        return math.inf
    return loop(numbers, zone, u)[1] if zone >= CONDUCTING else numbers.motor.R


def voltage(numbers: Numbers, zone: int, u: float, q: float) -> float:
    """Return the armature voltage [V] of a zone without bridge."""
    return follower.voltage(numbers.follower, zone, error_of(numbers.sensor, u, q))


def current(numbers: Numbers, zone: int, u: float, q: float, w: float) -> float:
    """Return the armature current [A] where it has no inertia."""
    if zone < CONDUCTING:
        v = voltage(numbers, zone, u, q)
        return motor.steady_armature_current(v, w, numbers.motor.R, numbers.motor.K_b)
    if zone == NO_CURRENT:
        return 0.0
    if limited(zone):
        return sign_of(zone) * numbers.source.I_max
    v, R = bridge.loop(numbers.bridge, numbers.source, zone, u)
    return motor.steady_armature_current(v, w, R, numbers.motor.K_b)


def flowing(numbers: Numbers, zone: int, u: float, q: float, w: float, i: float) -> float:
    """Return the armature current [A]: the state i where it has inertia."""
    return i if inductive(numbers.motor) else current(numbers, zone, u, q, w)


def current_rate(numbers: Numbers, zone: int, u: float, q: float, w: float, i: float) -> float:
    """Return di/dt [A/s] of a current with inertia."""
    if zone < CONDUCTING:
        v = voltage(numbers, zone, u, q)
        return motor.armature_current_rate(v, i, w, numbers.motor.R, numbers.motor.L, numbers.motor.K_b)
    if constant_current(zone):
        return 0.0
    v, R = bridge.loop(numbers.bridge, numbers.source, zone, u)
    return motor.armature_current_rate(v, i, w, R, numbers.motor.L, numbers.motor.K_b)


def torque_per_volt(numbers: Numbers, R: float) -> float:
    """Return by how much the motor's torque changes per volt [N m/V] in a loop of R [Ω]."""
    return motor.electromagnetic_torque(motor.steady_armature_current(1.0, 0.0, R, numbers.motor.K_b), numbers.motor.K)


def current_slope(numbers: Numbers, zone: int, du: float) -> float:
    """Return di/dt [A/s] at a standstill of a current without inertia, where the command changes by du [V/s]."""
    if not in_linear_zone(zone):
        return 0.0
    own = numbers.motor
    return motor.steady_armature_current(follower.voltage_slope(numbers.follower, du), 0.0, own.R, own.K_b)


def drive_torque(numbers: Numbers, zone: int, u: float, y: Vector) -> float:
    """Return the motor's torque N k_a i [N m]."""
    i = y.i if inductive(numbers.motor) else current(numbers, zone, u, y.q, turning(numbers.elastic, y))
    return motor.electromagnetic_torque(i, numbers.motor.K)


def stall_current(numbers: Numbers, V: float) -> float:
    """Return the current [A] of full drive forward at a standstill, from a source of V [V]."""
    if source_term.present(numbers.source):
        i = bridge_current(V, 0.0, numbers.bridge.D_drive, numbers.bridge.R_drive)
        return min(i, numbers.source.I_max)
    return motor.steady_armature_current(numbers.follower.V_max, 0.0, numbers.motor.R, numbers.motor.K_b)


# --- A servo whose bus voltage is given -------------------------------------------------------------------------------

_BLOCKS = 1e300  # V


def on_stiff_source(numbers: Numbers, returning: bool) -> Numbers:
    """Return a servo whose bus voltage is given: driven, or returning current through its diodes."""
    path, source = numbers.bridge, numbers.source
    if not returning:
        return driven(numbers, path.D_drive, path.R_drive - source.R_b)
    R = path.off.R if source_term.regulated(source) else path.off.R - source.R_b
    return driven(numbers, max(path.D_drive, 1e-300), R)  # a diode without drop still has a direction


def driven(numbers: Numbers, D: float, R: float) -> Numbers:
    """Return a servo whose bus voltage is given and drives it with so much drop [V] and resistance [Ω]."""
    path = numbers.bridge
    return numbers._replace(bridge=path._replace(D_drive=D, R_drive=R), source=Source(numbers.source.V, 0.0, math.inf))


def blocked(numbers: Numbers) -> Numbers:
    """Return a servo whose diodes block: no voltage of the bus drives a current in it, whatever its speed jumps to."""
    path = numbers.bridge
    return numbers._replace(bridge=path._replace(D_drive=_BLOCKS))


def is_connected(numbers: Numbers, drive: float, y: Vector) -> bool:
    """Tell whether a motor is connected to the bus: driven, or through the diodes of a bridge that coasts."""
    return drive != 0.0 or (coasts(numbers.bridge) and (y.i != 0.0 or y.w_m != 0.0))


def sign_on_bus(drive: float, y: Vector) -> float:
    """Return the sign of the bus voltage in a circuit, driven or (0) through the diodes of a coasting bridge."""
    if drive != 0.0:
        return drive
    # against the current, or against the one that the back-EMF would drive
    return -math.copysign(1.0, y.i) if y.i != 0.0 else math.copysign(1.0, y.w_m)


def part_on_bus(drive: float, path: Bridge, now: float, y: Vector) -> float:
    """Return which part of the bus voltage is in a circuit, with its sign; `now` is the duty of a bridge under PWM."""
    sign = sign_on_bus(drive, y)
    return sign * duty.share_of(path, now) if duty.present(path) else sign
