"""A bridge under PWM: a servo at a duty is one that is driven by a smaller source, through other drops and resistances.

A mean bridge is an ideal transformer. So at a duty d the plant is that of a servo whose source has d V_oc, d² R_b and
I_max/d, and everything that holds for a driven bridge holds for it.
"""

from __future__ import annotations

import math

from servotwin.models.terms.bridge import Bridge, Off, opened
from servotwin.models.terms.given import Given, either, place
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.source import Source
from servotwin.physics.pwm import averaged_drop, averaged_resistance, chopped_resistance

READS = (
    "motor.brush_drop_voltage", "supply.bridge_drop_voltage", "supply.bridge_drop_resistance", "firmware.off_state",
)
"""Optional numbers of a digital servo."""

BRAKE, DIODE, COAST = 1.0, 2.0, 3.0  # what the bridge does in the pauses of its PWM
OPEN, BRAKED = 2.0, 3.0  # stand in the place of a duty: torque is off
_BRAKE, _DIODE, _COAST = (place("firmware.off_state", word) for word in ("brake", "diode", "coast"))


def present(bridge: Bridge) -> bool:
    """Tell whether the bridge is switched many times a tick, by a duty."""
    return bridge.pwm > 0.0


def drives(duty: float) -> bool:
    """Tell whether the motor is driven at all: the duty is one, and not 0."""
    return duty != 0.0 and abs(duty) <= 1.0


def voltage(source: Source, duty: float) -> float:
    """Return the voltage [V] behind the bridge of numbers at a duty."""
    return math.copysign(source.V, duty) if drives(duty) else 0.0


def at(path: Bridge, motor: Motor, source: Source, duty: float) -> tuple[Bridge, Source]:
    """Return bridge and source as they are at a duty, or where the bridge is `OPEN` or `BRAKED`."""
    if not drives(duty):
        brakes = Off(path.V_br, motor.R, 0.0)
        off = path.off if duty == 0.0 else brakes if duty == BRAKED else path.silence
        return Bridge(path.D_drive, path.R_drive, off, path.silence, path.V_br, path.pwm, 0.0), source
    d, R_b = abs(duty), source.R_b
    V_ce0, r_c = path.D_drive - path.V_br, path.R_drive - motor.R - R_b
    one_way = 0.0 if path.pwm == BRAKE else 1.0
    if path.pwm == COAST:
        R = chopped_resistance(d, motor.R, r_c) + R_b
        return Bridge(path.D_drive, R, path.off, path.silence, path.V_br, path.pwm, one_way), source
    D, R = averaged_drop(d, V_ce0, path.V_br), averaged_resistance(d, motor.R, r_c, R_b)
    return (Bridge(D, R, path.off, path.silence, path.V_br, path.pwm, one_way),
            Source(d * source.V, d * d * R_b, source.I_max / d))


def at_duty(numbers: Numbers, duty: float) -> Numbers:
    """Return the numbers of a servo whose bridge has this duty, or is `OPEN` or `BRAKED`."""
    motor = numbers.motor
    bridge, source = at(numbers.bridge, motor, numbers.source, duty)
    R = motor.R / on_share_of(numbers.bridge, duty)  # of the mean current, which flows for a part of the time
    return Numbers(Motor(motor.K, motor.K_b, R, motor.L), bridge, source, numbers.follower, numbers.shaft,
                   numbers.friction, numbers.load, numbers.stops, numbers.play, numbers.sensor, numbers.heat,
                   numbers.elastic)


def share_of(bridge: Bridge, duty: float) -> float:
    """Return how much of the source's voltage, and of the motor's current at the source, there is at a duty."""
    return abs(duty) if drives(duty) and bridge.pwm != COAST else 1.0


def on_share_of(bridge: Bridge, duty: float) -> float:
    """Return for which part of the time the motor's current flows at all."""
    return abs(duty) if drives(duty) and bridge.pwm == COAST else 1.0


def pack(given: Given) -> Bridge:
    """Return the numbers of a digital servo's bridge, as at full duty."""
    pauses = either(given.firmware_off_state, _BRAKE)
    kind = DIODE if pauses == _DIODE else COAST if pauses == _COAST else BRAKE
    V_ce0, V_br = either(given.supply_bridge_drop_voltage, 0.0), either(given.motor_brush_drop_voltage, 0.0)
    R = given.motor_armature_resistance + either(given.supply_bridge_drop_resistance, 0.0) + either(
        given.supply_internal_resistance, 0.0)
    off = opened(given, 0.0 if kind == BRAKE else 1.0)
    return Bridge(V_ce0 + V_br, R, off, opened(given, 1.0), V_br, kind, 0.0)
