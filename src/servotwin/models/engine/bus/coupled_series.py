"""Servos behind one supply between two events: power series in time for all of them at once, exact to rounding.

The circuits have the voltage of the bus in common. Of n-th coefficients, with e what speed, drops and warming take,

    R i = s V − e,   V = V_oc − R_b Σ s i,   so that   V (1 + R_b Σ s²/R) = V_oc + R_b Σ s e/R,

and each servo's speed, angle and temperatures follow from its own current. Resistance and magnets are straight lines in
the temperatures, so that products of series are all that warming adds.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.bus.coupled_units import (
    TERMS,
    Law,
    put_unit_law,
    put_unit_state,
    unit_mode,
    unit_numbers,
    unit_state,
)
from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.legs import legs
from servotwin.models.state.modes import FORWARD, INSIDE, NO_CURRENT, Mode, Vector, at_rest, sign_of
from servotwin.models.terms import bridge, heat, shaft
from servotwin.models.terms.friction import share_slopes
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.play import ahead
from servotwin.physics.thermal import heat_flow, magnet_factor, warming_rate, winding_resistance

_LONGEST = 0.5  # of a series, in times of its fastest rate
_ROUNDING = 1e-17  # of a term
_INVERSES = (0.0, *(1.0 / n for n in range(1, TERMS + 1)))
_PER_KELVIN = 1e-2  # what a kelvin counts beside a radian per second


def put_law_of(unit: Any) -> None:
    """Put into a servo's record its law in its mode, as it stands."""
    cold, mode, y = unit_numbers(unit.numbers), unit_mode(unit.mode), unit_state(unit.y)
    numbers, driven = warm(cold, y), unit.sign
    R = winding = drop = conducts = R_slope = K_slope = K_b_slope = 0.0
    winding = numbers.motor.R
    if mode.zone != NO_CURRENT:
        R = currents.resistance(numbers, mode.zone, driven)
        drop = sign_of(mode.zone) * bridge.drop(numbers.bridge, driven)
        conducts = 1.0 / R
    if heat.present(cold.heat):
        R_slope = winding_resistance(y.T_w + 1.0, cold.motor.R) - winding_resistance(y.T_w, cold.motor.R)
        field = magnet_factor(y.T_h + 1.0, cold.heat.magnet) - magnet_factor(y.T_h, cold.heat.magnet)
        K_slope, K_b_slope = cold.motor.K * field, cold.motor.K_b * field
    inside = mode.mesh == INSIDE
    moves = not at_rest(mode.motor if inside else mode.contact)
    pull = rate = per_torque = output_pull = output_rate = 0.0
    apart = inside and not at_rest(mode.contact)
    if moves or apart:
        still = legs.laws_of(numbers, Mode(NO_CURRENT, mode.contact, mode.mesh, mode.motor, mode.share), 0.0,
                             unit.torque)
        pull, rate, per_torque = still.motor_pull, still.motor_rate, per_torque_of(numbers, mode)
        output_pull, output_rate = still.output_pull, still.output_rate
    put_unit_law(unit.law, Law(
        R, winding, R_slope, numbers.motor.K, numbers.motor.K_b, K_slope, K_b_slope, drop, conducts,
        1.0 if moves else 0.0, pull, per_torque, rate, 1.0 if apart else 0.0, output_pull, output_rate))
    unit.active = 1 if moves or apart or heat.present(cold.heat) else 0


def per_torque_of(numbers: Numbers, mode: Mode) -> float:
    """Return the acceleration [rad/s²] of what the motor turns per torque of it [N m], less what friction takes."""
    inside, left = mode.mesh == INSIDE, 1.0
    if mode.share != 0:
        forward = (mode.motor if inside else mode.contact) == FORWARD
        left -= share_slopes(numbers.friction, forward, float(mode.share))[0]
    if inside:
        return shaft.motor_acceleration(numbers.shaft, left, 0.0, 0.0)
    return shaft.accelerated(numbers.shaft, left)


def longest(units: Any, count: int) -> float:
    """Return how long a series of all holds [s]."""
    rate = 0.0
    for k in range(count):
        law = units[k].law
        own = law.moves * (law.rate + law.K * law.K_b * law.per_torque * law.conducts)
        rate = max(rate, own, law.apart * law.output_rate)
    return _LONGEST / rate if rate > 0.0 else math.inf


def work_out(units: Any, count: int, common: Any, length: float) -> None:
    """Work out the series of all servos for a time [s], and where they are at its end."""
    below = 1.0
    for k in range(count):
        unit = units[k]
        below += common.R_b * unit.sign * unit.sign * unit.law.conducts
        if unit.active != 0:
            unit.speed[0] = unit.y.w_m if unit.law.moves > 0.0 else 0.0
            unit.output[0], unit.winding[0], unit.housing[0] = unit.y.w, unit.y.T_w, unit.y.T_h
            unit.bend = 0.0
    n, power, common.bend = 0, length, 0.0
    while n < TERMS - 1:
        V = common.V if n == 0 else 0.0
        back = 0.0
        for k in range(count):
            unit = units[k]
            if unit.active != 0 or n == 0:
                unit.back[n] = _back(unit, n)
                back += unit.sign * unit.back[n] * unit.law.conducts
        V = (V + common.R_b * back) / below
        common.voltage[n] = V
        common.bend += n * (n - 1) * abs(V) * power / length
        size = 0.0 if n == 0 else abs(V)
        for k in range(count):
            unit = units[k]
            if unit.active != 0 or n == 0:
                unit.current[n] = (unit.sign * V - unit.back[n]) * unit.law.conducts
            if unit.active != 0:
                size = max(size, _next(unit, n))
                unit.bend += (n + 1) * n * abs(unit.speed[n + 1]) * power
        n += 1
        if size * power < _ROUNDING:
            break
        power *= length
    common.terms = n
    for k in range(count):
        unit = units[k]
        if unit.active != 0:
            put_unit_state(unit.after, state_at(unit, n, length))
    common.then = voltage_at(common, length)


def _back(unit: Any, n: int) -> float:
    """Return the n-th coefficient of K_b w + drop + (R − R(0)) i of a servo, whose current has one less."""
    law = unit.law
    back: float = law.K_b * unit.speed[n] if law.moves > 0.0 else 0.0
    if n == 0:
        back += law.drop
        return back
    if law.R_slope != 0.0:
        warming = 0.0
        for m in range(1, n + 1):
            warming += law.R_slope * unit.winding[m] * unit.current[n - m]
            back += law.K_b_slope * unit.housing[m] * unit.speed[n - m] * law.moves
        back += warming
    return back


def _next(unit: Any, n: int) -> float:
    """Work out what follows on the n-th current of a servo; return how large it is."""
    law, over = unit.law, _INVERSES[n + 1]
    first = 1.0 if n == 0 else 0.0
    torque: float = law.K * unit.current[n]
    more = 0.0
    if law.R_slope != 0.0:
        for m in range(1, n + 1):
            torque += law.K_slope * unit.housing[m] * unit.current[n - m]
        more = _warm_up(unit, n)
    dw = law.moves * (first * law.pull + law.per_torque * torque - law.rate * unit.speed[n]) * over
    dv = law.apart * (first * law.output_pull - law.output_rate * unit.output[n]) * over
    unit.speed[n + 1], unit.output[n + 1] = dw, dv
    size: float = max(abs(dw), abs(dv), more)
    return size


def _warm_up(unit: Any, n: int) -> float:
    """Work out the next coefficients of a servo's temperatures; return how large they are."""
    law, own = unit.law, unit.numbers.heat
    square, half = 0.0, (n + 1) // 2
    for m in range(half):
        square += unit.current[m] * unit.current[n - m]
    square += square
    if n == 2 * half:
        square += unit.current[half] * unit.current[half]
    unit.square[n] = square
    loss = law.winding * square
    for m in range(1, n + 1):
        loss += law.R_slope * unit.winding[m] * unit.square[n - m]
    flow = heat_flow(unit.winding[n], unit.housing[n], own.G_wh)
    lost = heat_flow(unit.housing[n], own.T_amb if n == 0 else 0.0, own.G_ha)
    dT_w = warming_rate(loss, flow, own.C_w) * _INVERSES[n + 1]
    dT_h = warming_rate(flow, lost, own.C_h) * _INVERSES[n + 1]
    unit.winding[n + 1], unit.housing[n + 1] = dT_w, dT_h
    return _PER_KELVIN * max(abs(dT_w), abs(dT_h))


def state_at(unit: Any, terms: int, s: float) -> Vector:
    """Return the state of a servo at s [s] after the beginning of a leg."""
    at = place_at(unit, terms, s)
    if unit.law.R_slope == 0.0:
        return at
    T_w = T_h = 0.0
    for n in range(terms, 0, -1):
        T_w, T_h = (T_w + unit.winding[n]) * s, (T_h + unit.housing[n]) * s
    return Vector(at.q, at.w, at.i, at.T_w + T_w, at.T_h + T_h, at.q_m, at.w_m)


def place_at(unit: Any, terms: int, s: float) -> Vector:
    """Return the same with the temperatures of the beginning."""
    y, law = unit.y, unit.law
    if unit.active == 0:
        return unit_state(y)
    angle = w = 0.0
    if law.moves > 0.0:
        for n in range(terms, -1, -1):
            w = w * s + unit.speed[n]
            angle = angle * s + unit.speed[n] * _INVERSES[n + 1]
        angle *= s
    if unit.mode.mesh != INSIDE:
        return Vector(y.q + angle, w, y.i, y.T_w, y.T_h,
                      y.q + angle + ahead(unit_numbers(unit.numbers).play, unit.mode.mesh), w)
    way = v = 0.0
    if law.apart > 0.0:
        for n in range(terms, -1, -1):
            v = v * s + unit.output[n]
            way = way * s + unit.output[n] * _INVERSES[n + 1]
        way *= s
    return Vector(y.q + way, v, y.i, y.T_w, y.T_h, y.q_m + angle, w)


def voltage_at(common: Any, s: float) -> float:
    """Return the voltage of the bus [V] at s [s] after the beginning of a leg."""
    V = 0.0
    for n in range(common.terms - 1, -1, -1):
        V = V * s + common.voltage[n]
    return V
