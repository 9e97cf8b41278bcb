"""Several servos on one source: who takes part, which way the currents flow, and the bus voltage that they leave.

A servo takes part while its bridge connects the motor to the bus: with the sign of the drive, or through the diodes of
a coasting bridge against the sign of its current. Its numbers are then those of a stiff source, and u = s V_bus.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from servotwin.models.engine import currents
from servotwin.models.engine.modes import NO_CURRENT, Mode, Vector, sign_of
from servotwin.models.terms import source as source_term
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.source import Source
from servotwin.physics import bridge, motor, supply
from servotwin.physics.pieces import Piece

_EDGE = 1e-8  # of a limit: so near to it the sum of currents counts as being there

# What the source does: it follows its resistance, gives its most, has broken down, or takes nothing back.
FOLLOWING, LIMITED, BROKEN_DOWN, KEEPING = range(4)


class Member(NamedTuple):
    """A servo whose motor is connected to the bus."""

    numbers: Numbers  # as on a stiff source
    mode: Mode
    sign: float  # of the bus voltage in its circuit
    tau: Piece
    returns: bool  # through diodes, against the bus alone


def on_stiff_source(numbers: Numbers, returning: bool) -> Numbers:
    """Return a servo whose bus voltage is given: driven, or returning current through its diodes."""
    bridge, R_b, regulated = numbers.bridge, numbers.source.R_b, source_term.regulated(numbers.source)
    R_drive = bridge.off.R - R_b if returning and not regulated else bridge.R_drive - R_b
    if returning and regulated:
        R_drive = bridge.off.R
    D = max(bridge.D_drive, 1e-300) if returning else bridge.D_drive  # a diode without drop still has a direction
    return numbers._replace(bridge=bridge._replace(R_drive=R_drive, D_drive=D),
                            source=numbers.source._replace(R_b=0.0, I_max=math.inf))


def member_of(stiff: Numbers, mode: Mode, drive: float, tau: Piece, y: Vector) -> Member:
    """Return a servo as a member, driven or (0) returning current through the diodes of a coasting bridge."""
    sign = drive
    if sign == 0.0:  # against the current, or against the one that the back-EMF would drive
        sign = -math.copysign(1.0, y[2]) if y[2] != 0.0 else math.copysign(1.0, y[6])
    return Member(stiff, mode, sign, tau, drive == 0.0)


def _demand(members: Sequence[Member], states: Sequence[Vector]) -> tuple[float, float, float]:
    """Return g, h and I_B of the current Σ s i = g V − h + I_B that the members take at the bus voltage V."""
    g = h = given = 0.0
    for (numbers, mode, sign, _, _), y in zip(members, states, strict=True):
        now = warm(numbers, y)
        if inductive(numbers.motor):
            given += sign * y[2]
        elif mode.zone != NO_CURRENT:
            g += motor.steady_armature_current(1.0, 0.0, now.bridge.R_drive, now.motor.K_b)
            v = bridge.driving_voltage(0.0, sign_of(mode.zone), now.bridge.D_drive)
            h -= sign * motor.steady_armature_current(v, y[6], now.bridge.R_drive, now.motor.K_b)
    return g, h, given


def bus_voltage(source: Source, state: int, members: Sequence[Member], states: Sequence[Vector]) -> float:
    """Return V_bus [V] for a state of the source."""
    if state == BROKEN_DOWN:
        return 0.0
    if state == KEEPING:
        return source.V
    g, h, given = _demand(members, states)
    if state == FOLLOWING:
        free = supply.source_voltage(given - h, source.V, source.R_b)
        return free / (1.0 - supply.source_voltage(g, 0.0, source.R_b))
    if g > 0.0:
        return (source.I_max + h - given) / g
    above = below = 0.0  # the currents have inertia: their sum has to stay
    for (numbers, mode, sign, _, _), y in zip(members, states, strict=True):
        if mode.zone != NO_CURRENT:
            now = warm(numbers, y)
            v = bridge.driving_voltage(0.0, sign_of(mode.zone), now.bridge.D_drive)
            R, L, K_b = now.bridge.R_drive, now.motor.L, now.motor.K_b
            above -= sign * motor.armature_current_rate(v, y[2], y[6], R, L, K_b)
            below += motor.armature_current_rate(1.0, 0.0, 0.0, R, L, K_b)
    return above / below


def drawn(source: Source, V_bus: float, members: Sequence[Member], states: Sequence[Vector]) -> float:
    """Return the current Σ s i [A] that the source gives."""
    g, h, given = _demand(members, states)
    return g * V_bus - h + given


def source_state(source: Source, members: Sequence[Member], states: Sequence[Vector]) -> int:
    """Return what the source does for members in these zones and states."""
    if source.I_max == math.inf:
        return FOLLOWING
    V = bus_voltage(source, FOLLOWING, members, states)
    total = drawn(source, V, members, states)
    if total < 0.0:
        return KEEPING
    g, _, _ = _demand(members, states)
    edge = _EDGE if g == 0.0 else 0.0  # the sum of currents with inertia is at the limit but for rounding
    if total < source.I_max * (1.0 - edge):
        return FOLLOWING
    if g == 0.0 and total > source.I_max * (1.0 + edge):
        return BROKEN_DOWN
    V = bus_voltage(source, LIMITED, members, states)
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


def zoned(source: Source, members: Sequence[Member], states: Sequence[Vector],
          V_bus: float) -> tuple[list[Member], int, float]:
    """Return the members in the zones of their currents, what the source does, and V_bus; from a guess of V_bus.

    The bus sags the more of them conduct, and the fewer conduct the more it sags: a few rounds settle it.
    """
    now, state = list(members), FOLLOWING
    for _ in range(20 + 4 * len(now)):
        now = [_in_zone(m, _zone(m, y, V_bus)) for m, y in zip(now, states, strict=True)]
        state = source_state(source, now, states)
        before, V_bus = V_bus, bus_voltage(source, state, now, states)
        if abs(V_bus - before) <= 1e-14 * source.V:
            break
    return now, state, V_bus


def _zone(member: Member, y: Vector, V_bus: float) -> int:
    return let_through(member, currents.zone_of(
        warm(member.numbers, y), behind(member, V_bus), 0.0, y[0], y[6], y[2]))


def _in_zone(member: Member, zone: int) -> Member:
    numbers, (_, shaft, mesh, motor, share), sign, tau, returns = member
    return Member(numbers, Mode(zone, shaft, mesh, motor, share), sign, tau, returns)


def let_through(member: Member, zone: int) -> int:
    """Return the zone of a member: diodes block what the bus would drive."""
    return NO_CURRENT if member.returns and sign_of(zone) * member.sign > 0.0 else zone


def after(state: int, guard: int) -> int:
    """Return what the source does after one of its guards has fallen below zero."""
    if state == FOLLOWING:
        return KEEPING if guard == 1 else LIMITED
    if state == LIMITED:
        return BROKEN_DOWN if guard == 1 else FOLLOWING
    return FOLLOWING if state == KEEPING else LIMITED


def behind(member: Member, V_bus: float) -> float:
    """Return the voltage in a member's circuit [V]; a bus without any is still connected."""
    return member.sign * (V_bus or 5e-324)
