"""The law of a servo on a coupled leg: numbers of its mode, found when that changes, and those of its temperatures."""

from __future__ import annotations

from typing import Any, NamedTuple

from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.legs import legs
from servotwin.models.engine.legs.coupled_units import (
    Law,
    put_unit_law,
    put_unit_state,
    unit_mode,
    unit_numbers,
    unit_state,
)
from servotwin.models.state.modes import (
    FORWARD,
    INSIDE,
    NO_CURRENT,
    NOWHERE,
    ON_FORWARD,
    STUCK,
    Mode,
    at_rest,
    sign_of,
)
from servotwin.models.terms import bridge, heat, play, shaft
from servotwin.models.terms.friction import share, share_slopes
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import ahead
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, magnet_factor, warming_rate, winding_resistance

_NEXT = REFERENCE_TEMPERATURE + 1.0  # K


def put_law_of(unit: Any) -> None:
    """Put into a servo's record its law in its mode, as it stands."""
    cold, mode, y = unit_numbers(unit.numbers), unit_mode(unit.mode), unit_state(unit.y)
    driven = unit.sign
    R = drop = R_slope = K_slope = K_b_slope = per_heat = per_flow = 0.0
    if mode.zone != NO_CURRENT:
        R = currents.resistance(cold, mode.zone, driven)
        drop = sign_of(mode.zone) * bridge.drop(cold.bridge, driven)
    if heat.present(cold.heat):
        R_slope = winding_resistance(_NEXT, cold.motor.R) - winding_resistance(REFERENCE_TEMPERATURE, cold.motor.R)
        field = magnet_factor(_NEXT, cold.heat.magnet) - magnet_factor(REFERENCE_TEMPERATURE, cold.heat.magnet)
        K_slope, K_b_slope = cold.motor.K * field, cold.motor.K_b * field
        per_heat, per_flow = warming_rate(1.0, 0.0, cold.heat.C_w), warming_rate(1.0, 0.0, cold.heat.C_h)
    inside = mode.mesh == INSIDE
    moves = not at_rest(mode.motor if inside else mode.contact)
    pull = rate = per_torque = output_pull = output_rate = 0.0
    apart = inside and not at_rest(mode.contact)
    if moves or apart:
        still = legs.laws_of(cold, Mode(NO_CURRENT, mode.contact, mode.mesh, mode.motor, mode.share), 0.0,
                             unit.torque)
        pull, rate, per_torque = still.motor_pull, still.motor_rate, per_torque_of(cold, mode)
        output_pull, output_rate = still.output_pull, still.output_rate
    low, high = currents.zone_limits(cold, mode.zone, driven)
    pressing, gear = pressing_of(cold, mode, unit.torque), share_of(cold, mode, unit.torque)
    put_unit_law(unit.law, Law(
        R, cold.motor.R, R_slope, cold.motor.K, cold.motor.K_b, K_slope, K_b_slope, per_heat,
        per_flow, drop, 1.0 / R if R > 0.0 else 0.0,
        1.0 if moves else 0.0, pull, per_torque, rate, 1.0 if apart else 0.0, output_pull, output_rate, low, high,
        ahead(cold.play, mode.mesh), pressing.still, pressing.forward, pressing.backward, pressing.speed, gear.still,
        gear.forward, gear.speed))
    unit.kinds = guards.guards(cold, mode, driven, False)
    unit.active = 1 if moves or apart or heat.present(cold.heat) else 0
    if unit.active == 0:
        put_unit_state(unit.after, y)
    follow(unit)


def follow(unit: Any) -> None:
    """Let a servo's law follow its temperatures to where they are now."""
    law, cold, y = unit.law, unit.numbers, unit.y
    if law.R_slope == 0.0:
        return
    law.winding = winding_resistance(y.T_w, cold.motor.R)
    if law.R > 0.0:
        law.conducts = 1.0 / (law.R + (law.winding - cold.motor.R))
    field = magnet_factor(y.T_h, cold.heat.magnet)
    law.K, law.K_b = cold.motor.K * field, cold.motor.K_b * field


def per_torque_of(numbers: Numbers, mode: Mode) -> float:
    """Return the acceleration [rad/s²] of what the motor turns per torque of it [N m], less what friction takes."""
    inside, left = mode.mesh == INSIDE, 1.0
    if mode.share != 0:
        forward = (mode.motor if inside else mode.contact) == FORWARD
        left -= share_slopes(numbers.friction, forward, float(mode.share))[0]
    if inside:
        return shaft.motor_acceleration(numbers.shaft, left, 0.0, 0.0)
    return shaft.accelerated(numbers.shaft, left)


class Line(NamedTuple):
    """What depends on a motor's torque and on a speed by straight lines: without both, per torque and per speed."""

    still: float
    forward: float  # per torque forward
    backward: float
    speed: float


def pressing_of(numbers: Numbers, mode: Mode, tau: float) -> Line:
    """Return `contacts.pressing_along` of a mode: how motor and output press together that slide as one [rad/s²]."""
    if mode.mesh == INSIDE or not play.present(numbers.play) or mode.motor == STUCK or at_rest(mode.contact):
        return Line(0.0, 0.0, 0.0, 0.0)
    way, forward, own = 1.0 if mode.mesh == ON_FORWARD else -1.0, mode.contact == FORWARD, numbers.shaft
    idle = Mode(NO_CURRENT, mode.contact, mode.mesh, mode.motor, mode.share)
    more = 1.0 - share_slopes(numbers.friction, forward, 1.0)[0]
    less = 1.0 - share_slopes(numbers.friction, forward, -1.0)[0]
    per_speed = shaft.motor_acceleration(own, 0.0, 1.0, 0.0) - shaft.output_acceleration(own, 1.0, 0.0, 0.0)
    return Line(
        contacts.pressing_along(numbers, idle, 0.0, tau, NOWHERE), way * shaft.motor_acceleration(own, more, 0.0, 0.0),
        way * shaft.motor_acceleration(own, less, 0.0, 0.0), way * per_speed)


def share_of(numbers: Numbers, mode: Mode, tau: float) -> Line:
    """Return `contacts.through_gear` of a mode, with the sign that its share keeps [N m]."""
    if mode.share == 0:
        return Line(0.0, 0.0, 0.0, 0.0)
    sign, per_speed = float(mode.share), 0.0
    if mode.mesh != INSIDE:
        per_speed = share(numbers.friction, 0.0, torque_on_gear(0.0, 1.0, numbers.shaft.b_out))
    still = contacts.through_gear(numbers, mode.mesh, 0.0, tau, NOWHERE)
    per_torque = sign * share(numbers.friction, 1.0, 0.0)
    return Line(sign * still, per_torque, per_torque, sign * per_speed)
