"""Servos behind one supply between two events: power series in time for all of them at once, exact to rounding.

The circuits have the voltage of the bus in common. Of n-th coefficients, with e what speed, drops and warming take,

    R i = s V − e,   V = V_oc − R_b Σ s i,   so that   V (1 + R_b Σ s²/R) = V_oc + R_b Σ s e/R,

and each servo's speed, angle and temperatures follow from its own current. Resistance and magnets are straight lines in
the temperatures, so that products of series are all that warming adds.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.legs.coupled_units import TERMS, put_unit_state, unit_state
from servotwin.models.state.modes import INSIDE, Vector
from servotwin.physics.thermal import heat_flow

_LONGEST = 0.5  # of a series, in times of its fastest rate
_ROUNDING = 1e-16  # of a term
_INVERSES = (0.0, *(1.0 / n for n in range(1, TERMS + 1)))
_PER_KELVIN = 1e-2  # what a kelvin counts beside a radian per second; a float has 6e-14 of 300 K
_FEW = 3  # terms of temperatures at least


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
    below, back = 1.0, 0.0
    for k in range(count):
        unit = units[k]
        unit.draws = unit.sign * unit.law.conducts
        below += common.R_b * unit.sign * unit.draws
        unit.back = unit.law.drop
        if unit.active != 0:
            _begin(unit)
        back += unit.draws * unit.back
    per_volt, sag = common.V / below, common.R_b / below
    n, power, before, per_time, common.bend = 0, length, 1.0, 1.0 / length, 0.0
    while n < TERMS - 1:
        V = sag * back + (per_volt if n == 0 else 0.0)
        common.voltage[n] = V
        common.bend += n * (n - 1) * abs(V) * before
        size = 0.0 if n == 0 else abs(V) * per_time
        back, bends = 0.0, (n + 1) * n * power
        for k in range(count):
            unit = units[k]
            if unit.active != 0:
                size = max(size, _next(unit, n, V, power, bends))
                back += unit.draws * unit.back
        n += 1
        if size * power < _ROUNDING:
            break
        before, power = power, power * length
    common.terms = n
    for k in range(count):
        if units[k].active != 0:
            put_after(units[k], n, length)
    common.then = voltage_at(common, length)


def _begin(unit: Any) -> None:
    law, y = unit.law, unit.y
    unit.gain = law.per_torque * law.K
    unit.speed[0] = y.w_m if law.moves > 0.0 else 0.0
    unit.output[0], unit.winding[0], unit.housing[0] = y.w, y.T_w, y.T_h
    unit.bend, unit.hot, unit.mild, unit.warming, unit.field = 0.0, 0, 0, 0.0, 0.0
    unit.back += law.K_b * unit.speed[0]


def _next(unit: Any, n: int, V: float, power: float, bends: float) -> float:
    """Work out what follows on the n-th coefficient of the bus voltage; return how large it is.

    `power` is the (n + 1)-th of the duration, `bends` how often that counts of how much a speed bends.
    """
    law, over = unit.law, _INVERSES[n + 1]
    i, hot = unit.draws * V - unit.back * law.conducts, law.R_slope != 0.0 and unit.hot == n
    slowed = law.rate * unit.speed[n]
    if hot:
        unit.current[n] = i
        slowed -= law.per_torque * unit.field
    if n == 0:
        slowed -= law.pull
    dw: float = (unit.gain * i - slowed) * (law.moves * over)
    size = abs(dw)
    unit.speed[n + 1] = dw
    unit.bend += bends * size
    unit.back = law.K_b * dw
    if law.apart > 0.0:
        dv: float = ((law.output_pull if n == 0 else 0.0) - law.output_rate * unit.output[n]) * over
        unit.output[n + 1] = dv
        size = max(size, abs(dv))
    return max(size, _warm_up(unit, n, power)) if hot else size


def _warm_up(unit: Any, n: int, power: float) -> float:
    """Work out the next coefficients of a servo's temperatures; return how large they are.

    Also what warming adds to the next ones of its voltage and torque: products of series.
    """
    law, own = unit.law, unit.numbers.heat
    unit.fall[n] = law.winding * unit.current[n] + unit.warming
    loss = warming = field = back = 0.0
    for m in range(1, n + 1):
        loss += unit.current[m] * unit.fall[n - m]
        warming += unit.winding[n + 1 - m] * unit.current[m]
    loss += unit.current[0] * unit.fall[n]
    flow = heat_flow(unit.winding[n], unit.housing[n], own.G_wh)
    lost = heat_flow(unit.housing[n], own.T_amb if n == 0 else 0.0, own.G_ha)
    dT_w, dT_h = (loss - flow) * (law.per_heat * _INVERSES[n + 1]), (flow - lost) * (law.per_flow * _INVERSES[n + 1])
    unit.winding[n + 1], unit.housing[n + 1] = dT_w, dT_h
    size: float = _PER_KELVIN * max(abs(dT_w), abs(dT_h))
    if n < _FEW or size * power > _ROUNDING:
        unit.hot = n + 1
    if _PER_KELVIN * abs(dT_h) * power > _ROUNDING:
        unit.mild = n + 1
    for m in range(1, min(n + 1, unit.mild) + 1):
        field += unit.housing[m] * unit.current[n + 1 - m]
        back += unit.housing[m] * unit.speed[n + 1 - m]
    unit.warming = law.R_slope * (warming + dT_w * unit.current[0])
    unit.field = law.K_slope * field
    unit.back += unit.warming + law.K_b_slope * back
    return size


def put_after(unit: Any, terms: int, s: float) -> None:
    """Put where a servo is s [s] after the beginning of a leg into its record."""
    y, law, after = unit.y, unit.law, unit.after
    angle = w = 0.0
    if law.moves > 0.0:
        for n in range(terms, -1, -1):
            w = w * s + unit.speed[n]
            angle = angle * s + unit.speed[n] * _INVERSES[n + 1]
        angle *= s
    after.i, after.T_w, after.T_h = y.i, y.T_w, y.T_h
    if law.R_slope != 0.0:
        T_w = T_h = 0.0
        for n in range(unit.hot, 0, -1):
            T_w, T_h = (T_w + unit.winding[n]) * s, (T_h + unit.housing[n]) * s
        after.T_w, after.T_h = y.T_w + T_w, y.T_h + T_h
    if unit.mode.mesh != INSIDE:
        after.q, after.w = y.q + angle, w
        after.q_m, after.w_m = y.q + angle + law.ahead, w
        return
    way = v = 0.0
    if law.apart > 0.0:
        for n in range(terms, -1, -1):
            v = v * s + unit.output[n]
            way = way * s + unit.output[n] * _INVERSES[n + 1]
        way *= s
    after.q, after.w, after.q_m, after.w_m = y.q + way, v, y.q_m + angle, w


def state_at(unit: Any, terms: int, s: float) -> Vector:
    """Return the state of a servo s [s] after the beginning of a leg; that at its end is put back."""
    if unit.active == 0:
        return unit_state(unit.y)
    end = unit_state(unit.after)
    put_after(unit, terms, s)
    found = unit_state(unit.after)
    put_unit_state(unit.after, end)
    return found


def voltage_at(common: Any, s: float) -> float:
    """Return the voltage of the bus [V] at s [s] after the beginning of a leg."""
    V = 0.0
    for n in range(common.terms - 1, -1, -1):
        V = V * s + common.voltage[n]
    return V
