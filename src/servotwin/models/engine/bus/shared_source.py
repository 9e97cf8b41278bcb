"""Several servos on one source: who takes part, which way the currents flow, and the bus voltage that they leave.

A servo takes part, as a mate of the others, while its bridge connects the motor to the bus: with the sign of the drive,
or through the diodes of a coasting bridge against the sign of its current. Its numbers are then those of a stiff
source, and u = s V_bus, where s is the sign, or the duty of a bridge under PWM: an ideal transformer, which takes s i.
The functions take the first `count` records of `bus_records.Mate`, each as it stands at its `y`.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.bus.bus_records import numbers_of, vector_of
from servotwin.models.engine.dynamics import currents
from servotwin.models.state.modes import NO_CURRENT, sign_of
from servotwin.models.terms.numbers import warm
from servotwin.models.terms.source import Source
from servotwin.physics import bridge, motor, supply

_EDGE = 1e-8  # of a limit: so near to it the sum of currents counts as being there

# What the source does: it follows its resistance, gives its most, has broken down, or takes nothing back.
FOLLOWING, LIMITED, BROKEN_DOWN, KEEPING = range(4)


def _loop(mate: Any) -> tuple[float, float, float]:
    """Return resistance [Ω], voltage drop [V] and K_b of the circuit of a mate."""
    if mate.numbers.heat.C_w > 0.0:
        now = warm(numbers_of(mate.numbers), vector_of(mate.y))
        return now.bridge.R_drive, now.bridge.D_drive, now.motor.K_b
    return mate.numbers.bridge.R_drive, mate.numbers.bridge.D_drive, mate.numbers.motor.K_b


def _demand(mates: Any, count: int) -> tuple[float, float, float]:
    """Return g, h and I_B of the current Σ s i = g V − h + I_B that the mates take at the bus voltage V."""
    g = h = given = 0.0
    for k in range(count):
        mate = mates[k]
        if mate.numbers.motor.L > 0.0:
            given += mate.sign * mate.y.i
        elif mate.mode.zone != NO_CURRENT:
            R, D, K_b = _loop(mate)
            g += mate.sign * motor.steady_armature_current(mate.sign, 0.0, R, K_b)
            v = bridge.driving_voltage(0.0, sign_of(mate.mode.zone), D)
            h -= mate.sign * motor.steady_armature_current(v, mate.y.w_m, R, K_b)
    return g, h, given


def bus_voltage(source: Source, state: int, mates: Any, count: int) -> float:
    """Return V_bus [V] for a state of the source."""
    if state == BROKEN_DOWN:
        return 0.0
    if state == KEEPING:
        return source.V
    g, h, given = _demand(mates, count)
    if state == FOLLOWING:
        free = supply.source_voltage(given - h, source.V, source.R_b)
        return free / (1.0 - supply.source_voltage(g, 0.0, source.R_b))
    if g > 0.0:
        return (source.I_max + h - given) / g
    above = below = 0.0  # the currents have inertia: their sum has to stay
    for k in range(count):
        mate = mates[k]
        if mate.mode.zone != NO_CURRENT:
            R, D, K_b = _loop(mate)
            v, L = bridge.driving_voltage(0.0, sign_of(mate.mode.zone), D), mate.numbers.motor.L
            above -= mate.sign * motor.armature_current_rate(v, mate.y.i, mate.y.w_m, R, L, K_b)
            below += mate.sign * motor.armature_current_rate(mate.sign, 0.0, 0.0, R, L, K_b)
    return above / below


def drawn(V_bus: float, mates: Any, count: int) -> float:
    """Return the current Σ s i [A] that the source gives."""
    g, h, given = _demand(mates, count)
    return g * V_bus - h + given


def source_state(source: Source, mates: Any, count: int) -> int:
    """Return what the source does for mates in these zones and states."""
    if source.I_max == math.inf:
        return FOLLOWING
    V = bus_voltage(source, FOLLOWING, mates, count)
    total = drawn(V, mates, count)
    if total < 0.0:
        return KEEPING
    g, _, _ = _demand(mates, count)
    edge = _EDGE if g == 0.0 else 0.0  # the sum of currents with inertia is at the limit but for rounding
    if total < source.I_max * (1.0 - edge):
        return FOLLOWING
    if g == 0.0 and total > source.I_max * (1.0 + edge):
        return BROKEN_DOWN
    V = bus_voltage(source, LIMITED, mates, count)
    if V < 0.0:
        return BROKEN_DOWN
    return LIMITED if V <= supply.source_voltage(source.I_max, source.V, source.R_b) else FOLLOWING


def source_guards(source: Source, state: int, V_bus: float, total: float) -> tuple[float, float]:
    """Return two numbers that are at least zero as long as the source does the same."""
    if source.I_max == math.inf:
        return 1.0, 1.0
    if state == FOLLOWING:
        return source.I_max - total, total
    if state == LIMITED:
        return supply.source_voltage(source.I_max, source.V, source.R_b) - V_bus, V_bus
    if state == KEEPING:
        return -total, 1.0
    return total - source.I_max, 1.0


def put_in_zones(source: Source, mates: Any, count: int, V_bus: float) -> tuple[int, float]:
    """Put the mates into the zones of their currents; return what the source does, and V_bus; from a guess of V_bus.

    The bus sags the more of them conduct, and the fewer conduct the more it sags: a few rounds settle it.
    """
    state = FOLLOWING
    for _ in range(20 + 4 * count):
        for k in range(count):
            mate = mates[k]
            mate.mode.zone = _zone(mate, V_bus)
        state = source_state(source, mates, count)
        before, V_bus = V_bus, bus_voltage(source, state, mates, count)
        if abs(V_bus - before) <= 1e-14 * source.V:
            break
    return state, V_bus


def _zone(mate: Any, V_bus: float) -> int:
    y = vector_of(mate.y)
    numbers = warm(numbers_of(mate.numbers), y)
    return let_through(mate, currents.zone_of(numbers, behind(mate, V_bus), 0.0, y.q, y.w_m, y.i))


def let_through(mate: Any, zone: int) -> int:
    """Return the zone of a mate: diodes block what the bus would drive."""
    return NO_CURRENT if mate.returns > 0 and sign_of(zone) * mate.sign > 0.0 else zone


def after(state: int, guard: int) -> int:
    """Return what the source does after one of its guards has fallen below zero."""
    if state == FOLLOWING:
        return KEEPING if guard == 1 else LIMITED
    if state == LIMITED:
        return BROKEN_DOWN if guard == 1 else FOLLOWING
    return FOLLOWING if state == KEEPING else LIMITED


def behind(mate: Any, V_bus: float) -> float:
    """Return the voltage in a mate's circuit [V]; a bus without any is still connected."""
    sign: float = mate.sign
    return sign * (V_bus if V_bus != 0.0 else 5e-324)
