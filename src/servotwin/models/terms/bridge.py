"""The switched bridge: the path of the current, its drops, and the zones of the current while it drives or does not.

Behind it u is s V, or 0 between drives; the zone is the direction of the current.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.state.modes import (
    CONDUCTING,
    CURRENT_BACKWARD,
    CURRENT_FORWARD,
    LIMITED_BACKWARD,
    LIMITED_FORWARD,
    NO_CURRENT,
    SHORT_BACKWARD,
    SHORT_FORWARD,
    limited,
    sign_of,
)
from servotwin.models.terms.dependence import DROPS, ONE_WAY, PULSES, PWM, SHOWN, SILENCE, STRAIGHT
from servotwin.models.terms.given import Given, either, is_given, place
from servotwin.models.terms.motor import Motor, inductive
from servotwin.models.terms.source import Source, loaded_voltage, regulated
from servotwin.physics.bridge import bridge_voltage, driving_voltage, motor_voltage, needed_voltage
from servotwin.physics.motor import back_emf
from servotwin.physics.supply import supply_current

READS = (
    "motor.brush_drop_voltage", "electronics.off_state", "electronics.silence_state", "supply.bridge_drop_voltage",
    "supply.bridge_drop_resistance",
)
"""Optional numbers of a pulse servo."""
_COAST, _SILENT_COAST = place("electronics.off_state", "coast"), place("electronics.silence_state", "coast")


class Off(NamedTuple):
    """A bridge that does not drive: braked or open."""

    D: float  # no current flows where |K_b w| is less [V]
    R: float
    coast: float  # 1: it is open; 0: it brakes


class Bridge(NamedTuple):
    """Numbers of the bridge and of the brushes behind it."""

    D_drive: float  # V_ce0 + V_br: no current flows where |s V − K_b w| is less
    R_drive: float  # R_a + r_c + R_b
    off: Off  # as it is between drives
    silence: Off  # as it is while no pulses come
    V_br: float
    pwm: float = 0.0  # `duty.BRAKE` … `duty.COAST` of one that is switched many times a tick; 0: it drives or does not
    one_way: float = 0.0  # 1: the current flows in the sense of the drive alone


NO_BRIDGE = Bridge(0.0, 0.0, Off(0.0, 0.0, 0.0), Off(0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
ACTS = {"D_drive": STRAIGHT, "R_drive": STRAIGHT, "off.R": STRAIGHT, "off.coast": SHOWN | PULSES, "silence.R": STRAIGHT,
        "silence.coast": SHOWN | PULSES, "V_br": SHOWN | PULSES, "pwm": PWM, "one_way": ONE_WAY}
"""Where each number acts; whether a bridge is open shows of its voltages, which pulses are compared with."""


def needs(bridge: Bridge, source: Source) -> int:
    """Return what there is to be followed of the bridge."""
    brakes = bridge.off.D == 0.0 and (bridge.D_drive == 0.0 if bridge.pwm > 0.0 else bridge.D_drive < source.V)
    return ((0 if brakes else DROPS) | (SILENCE if heeds_silence(bridge) else 0) | (PWM if bridge.pwm > 0.0 else 0)
            | (ONE_WAY if bridge.one_way > 0.0 else 0))


def coasts(bridge: Bridge) -> bool:
    """Tell whether the bridge is open where it does not drive."""
    return bridge.off.coast > 0.0


def heeds_silence(bridge: Bridge) -> bool:
    """Tell whether the bridge is off in another way while no pulses come."""
    return bridge.silence.coast != bridge.off.coast


def off_now(bridge: Bridge, silent: int) -> Bridge:
    """Return the bridge as it is off now: between drives, or (1) while no pulses come."""
    off = bridge.silence if silent != 0 else bridge.off
    return Bridge(bridge.D_drive, bridge.R_drive, off, off, bridge.V_br, bridge.pwm, bridge.one_way)


def drop(bridge: Bridge, u: float) -> float:
    """Return the voltage [V] that has to be exceeded for a current to flow, driven or between drives (u = 0)."""
    return bridge.D_drive if u != 0.0 else bridge.off.D


def loop(bridge: Bridge, source: Source, zone: int, u: float) -> tuple[float, float]:
    """Return voltage [V], with its drop, and resistance [Ω] of the loop through which the current of a zone flows."""
    sign = sign_of(zone)
    if u == 0.0:
        return driving_voltage(0.0, sign, bridge.off.D), bridge.off.R
    if zone == SHORT_FORWARD or zone == SHORT_BACKWARD:
        return driving_voltage(0.0, sign, bridge.D_drive), bridge.R_drive - source.R_b
    R = bridge.R_drive
    if sign * u < 0.0 and regulated(source):  # returned past a regulator
        R -= source.R_b
    return driving_voltage(u, sign, bridge.D_drive), R


def zone_limits(bridge: Bridge, source: Source, by_current: bool, zone: int, u: float) -> tuple[float, float]:
    """Return between what a zone lies: voltages that drive the current [V], or `by_current` currents [A]."""
    if zone == CONDUCTING:
        return -math.inf, math.inf
    D, I_max = drop(bridge, u), source.I_max
    if zone == NO_CURRENT:
        if bridge.one_way > 0.0 and u != 0.0:
            return (-math.inf, D) if u > 0.0 else (-D, math.inf)
        return -D, D
    if I_max == math.inf:
        edge = 0.0 if by_current else D
        return (edge, math.inf) if zone == CURRENT_FORWARD else (-math.inf, -edge)
    # A regulator's most, in the direction of the drive: from x1 on it gives that, from x2 on the bus has broken down.
    x1 = needed_voltage(I_max, 0.0, D, bridge.R_drive)
    x2 = needed_voltage(I_max, 0.0, D, bridge.R_drive - source.R_b) + abs(u)
    if by_current:
        D, x1, x2 = 0.0, I_max, I_max
    forward, backward = (x1 if u > 0.0 else math.inf), (x1 if u < 0.0 else math.inf)
    if zone == CURRENT_FORWARD:
        return D, forward
    if zone == CURRENT_BACKWARD:
        return -backward, -D
    if zone == LIMITED_FORWARD:
        return x1, x2
    if zone == LIMITED_BACKWARD:
        return -x2, -x1
    return (x2, math.inf) if zone == SHORT_FORWARD else (-math.inf, -x2)


def zone_of(bridge: Bridge, source: Source, motor: Motor, u: float, x: float, i: float) -> int:
    """Return the zone of a current i [A], where x [V] drives it."""
    D = drop(bridge, u)
    if D == 0.0 and source.I_max == math.inf and not bridge.one_way > 0.0:
        return CONDUCTING
    if motor.L > 0.0 and i != 0.0:
        forward = i > 0.0
    elif abs(x) <= D:
        return NO_CURRENT
    else:
        forward = x > 0.0
        if bridge.one_way > 0.0 and u * x < 0.0:
            return NO_CURRENT
    zone = CURRENT_FORWARD if forward else CURRENT_BACKWARD
    step = 1 if forward else -1
    if source.I_max == math.inf or u * step <= 0.0:
        return zone
    if inductive(motor):
        if abs(i) < source.I_max:
            return zone
        if abs(i) > source.I_max:
            return zone + 2 * step
    most = needed_voltage(source.I_max, 0.0, D, bridge.R_drive)
    zone += step if abs(x) > most else 0
    short = needed_voltage(source.I_max, 0.0, D, bridge.R_drive - source.R_b) + abs(u)
    return zone + (step if abs(x) > short else 0)


def bus_voltage(bridge: Bridge, source: Source, motor: Motor, zone: int, u: float, w: float, i: float) -> float:
    """Return what is left of the source's voltage [V] under this servo's current."""
    if i == 0.0 or not (u != 0.0 or coasts(bridge)):
        return source.V
    if zone == SHORT_FORWARD or zone == SHORT_BACKWARD:
        return 0.0
    if limited(zone):
        drops = sign_of(zone) * bridge.D_drive
        return abs(needed_voltage(i, back_emf(w, motor.K_b), drops, bridge.R_drive - source.R_b))
    return loaded_voltage(source, supply_current(i, direction(u)))


def direction(u: float) -> float:
    """Return how the bridge drives: −1, 0 or +1."""
    return math.copysign(1.0, u) if u != 0.0 else 0.0


def terminal_voltage(bridge: Bridge, source: Source, motor: Motor, u: float, w: float, i: float, V_bus: float) -> float:
    """Return the voltage v_m [V] at the motor's terminals."""
    open_ = coasts(bridge)
    if motor.L == 0.0 or i == 0.0:
        v_b = back_emf(w, motor.K_b)
        return motor_voltage(i, v_b, motor.R, bridge.V_br, v_b if u != 0.0 or open_ else 0.0)
    if u == 0.0 and not open_:
        return 0.0
    drive = direction(u) if u != 0.0 else -math.copysign(1.0, i)
    V_ce0, r_c = drops(bridge, source, motor, u)
    return bridge_voltage(i, V_bus, drive, V_ce0, r_c)


def drops(bridge: Bridge, source: Source, motor: Motor, u: float) -> tuple[float, float]:
    """Return V_ce0 [V] and r_c [Ω] of what conducts: transistors while the bridge drives, diodes while it coasts."""
    if u == 0.0:
        return max(bridge.off.D - bridge.V_br - source.V, 0.0), 0.0
    return max(bridge.D_drive - bridge.V_br, 0.0), max(bridge.R_drive - motor.R - source.R_b, 0.0)


def pack(given: Given) -> Bridge:
    """Return the numbers of an analog servo's bridge; without pulses it is off as between drives unless stated."""
    coast = 1.0 if given.electronics_off_state == _COAST else 0.0
    silence = given.electronics_silence_state
    silent_coast = coast if not is_given(silence) else 1.0 if silence == _SILENT_COAST else 0.0
    V_ce0, V_br = either(given.supply_bridge_drop_voltage, 0.0), either(given.motor_brush_drop_voltage, 0.0)
    R = given.motor_armature_resistance + either(given.supply_bridge_drop_resistance, 0.0) + either(
        given.supply_internal_resistance, 0.0)
    return Bridge(V_ce0 + V_br, R, opened(given, coast), opened(given, silent_coast), V_br, 0.0, 0.0)


def opened(given: Given, opens: float) -> Off:
    """Return a bridge that does not drive: open (1), or braked (0)."""
    R_b, V_br = either(given.supply_internal_resistance, 0.0), either(given.motor_brush_drop_voltage, 0.0)
    battery = either(given.supply_current_limit, math.inf) == math.inf  # a regulator keeps its voltage
    V = given.supply_open_circuit_voltage + either(given.supply_bridge_drop_voltage, 0.0)
    return Off(V_br + opens * V, given.motor_armature_resistance + (R_b * opens if battery else 0.0), opens)
