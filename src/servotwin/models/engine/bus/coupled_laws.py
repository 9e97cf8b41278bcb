"""The law of a servo on a coupled leg: numbers of its mode, found when that changes, and those of its temperatures."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.bus.coupled_units import (
    Law,
    put_unit_law,
    put_unit_state,
    unit_mode,
    unit_numbers,
    unit_state,
)
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.events import guards
from servotwin.models.engine.legs import legs
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
    slides,
)
from servotwin.models.terms import bridge, heat, play, shaft
from servotwin.models.terms.friction import share_slopes, varying
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import ahead
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, magnet_factor, winding_resistance

_NEXT = REFERENCE_TEMPERATURE + 1.0  # K


def put_law_of(unit: Any) -> None:
    """Put into a servo's record its law in its mode, as it stands."""
    cold, mode, y = unit_numbers(unit.numbers), unit_mode(unit.mode), unit_state(unit.y)
    driven = unit.sign
    R = drop = R_slope = K_slope = K_b_slope = 0.0
    if mode.zone != NO_CURRENT:
        R = currents.resistance(cold, mode.zone, driven)
        drop = sign_of(mode.zone) * bridge.drop(cold.bridge, driven)
    if heat.present(cold.heat):
        R_slope = winding_resistance(_NEXT, cold.motor.R) - winding_resistance(REFERENCE_TEMPERATURE, cold.motor.R)
        field = magnet_factor(_NEXT, cold.heat.magnet) - magnet_factor(REFERENCE_TEMPERATURE, cold.heat.magnet)
        K_slope, K_b_slope = cold.motor.K * field, cold.motor.K_b * field
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
    press, press_torque, press_speed, pressed = pressing_of(cold, mode, unit.torque)
    put_unit_law(unit.law, Law(
        R, cold.motor.R, R_slope, cold.motor.K, cold.motor.K_b, K_slope, K_b_slope, drop, 1.0 / R if R > 0.0 else 0.0,
        1.0 if moves else 0.0, pull, per_torque, rate, 1.0 if apart else 0.0, output_pull, output_rate, low, high,
        ahead(cold.play, mode.mesh), pressed, press, press_torque, press_speed))
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


def pressing_of(numbers: Numbers, mode: Mode, tau: float) -> tuple[float, float, float, float]:
    """Return how motor and output press together that slide as one: by itself, per torque and per speed; and 1.

    That is `contacts.pressing_along` where friction is constant; nothing, and 0, where it varies or cannot end so.
    """
    if mode.mesh == INSIDE or not play.present(numbers.play) or mode.motor == STUCK or not slides(mode.contact):
        return 0.0, 0.0, 0.0, 0.0
    if varying(numbers.friction):
        return 0.0, 0.0, 0.0, 0.0
    way = 1.0 if mode.mesh == ON_FORWARD else -1.0
    idle = Mode(NO_CURRENT, mode.contact, mode.mesh, mode.motor, mode.share)
    own = numbers.shaft
    per_speed = shaft.motor_acceleration(own, 0.0, 1.0, 0.0) - shaft.output_acceleration(own, 1.0, 0.0, 0.0)
    return (contacts.pressing_along(numbers, idle, 0.0, tau, NOWHERE),
            way * shaft.motor_acceleration(own, 1.0, 0.0, 0.0), way * per_speed, 1.0)
