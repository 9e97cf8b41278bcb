"""Working records of digital servos on one supply that go from tick to tick: one a servo, and one for the supply.

The circuits have the voltage of the bus in common. Of n-th coefficients, with e what speed, drops and warming take,

    R i = s V − e,   V = V_oc − R_b Σ s i,   so that   V (1 + R_b Σ s²/R) = V_oc + R_b Σ s e/R,

and each servo's speed, angle and temperatures follow from its own current. Resistance and magnets are straight lines in
the temperatures, so that products of series are all that warming adds.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.legs import legs
from servotwin.models.state.modes import (
    FORWARD,
    INSIDE,
    NO_CURRENT,
    NOWHERE,
    ON_FORWARD,
    STUCK,
    Mode,
    Vector,
    at_rest,
    sign_of,
)
from servotwin.models.state.records import record_reader, record_writer
from servotwin.models.terms import bridge, heat, play, shaft
from servotwin.models.terms.friction import share, share_slopes
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import ahead
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, heat_flow, magnet_factor, warming_rate, winding_resistance

# --- Working records of digital servos on one supply that go from tick to tick ----------------------------------------

TERMS = 24  # of a power series at most


if TYPE_CHECKING:
    Coefficients = list[float]
    Course = list[float]
else:
    Coefficients = tuple[(float,) * TERMS]
    Course = tuple[(float,) * (TERMS + 2)]


class Law(NamedTuple):
    """The law of a servo in a mode, at the temperatures at which a leg begins; all but four numbers stay with these.

    R i = s V − K_b w − drop; of what the motor turns ẇ = pull + per_torque K i − rate w; inside the play the output has
    ẇ = output_pull − output_rate w.
    """

    R: float  # of the loop of a cold winding [Ω]
    winding: float  # of the winding [Ω]
    R_slope: float  # by how much both grow per kelvin of the winding; 0: temperatures stay
    K: float
    K_b: float
    K_slope: float  # of K per kelvin of the housing
    K_b_slope: float
    per_heat: float  # by how much the winding warms per joule [K/J], and the housing
    per_flow: float
    drop: float
    conducts: float  # one by that of the loop; 0: no current flows
    moves: float  # 1: what the motor turns moves
    pull: float
    per_torque: float
    rate: float
    apart: float  # 1: the output moves alone
    output_pull: float
    output_rate: float
    low: float  # between which what drives the current lies [V]
    high: float
    ahead: float  # by which angle the motor is ahead of the output where they touch [rad]
    press: float  # how motor and output press together at rest, without torque [rad/s²]
    press_forward: float  # more of it per torque of the motor [N m], forward or backward
    press_backward: float
    press_speed: float
    gear: float  # the same of what the torques through the gear add to its friction, with the sign that lasts [N m]
    gear_torque: float
    gear_speed: float


class Unit(NamedTuple):
    """A servo; times by its own clock [s]. Fields that legs look at stand first."""

    active: int  # 1: it moves, or gets warm
    kinds: int  # of guards that can end its mode
    sign: float  # which part of the bus voltage is in its circuit, with its sign; 0: none
    draws: float  # from the bus, of a volt in its circuit [A]
    gain: float  # acceleration per ampere [rad/s²/A]
    back: float  # the last coefficient of the voltage that speed, drops and warming take, but for s V
    bend: float  # h² max|ẅ| of what the motor turns
    field: float  # what warming magnets add to the next current's torque
    warming: float  # what warming adds to the voltage along the winding
    hot: int  # coefficients of temperatures that count
    mild: int  # of the housing's alone
    open: int  # 1: diodes lead back to the supply
    anew: int  # 1: another duty than when its mode was found
    short: int  # legs in a row that took no time
    law: Law
    mode: Mode
    mesh: int  # of the mode in which it came to its state: what is found there under another voltage may not hold
    y: Vector
    after: Vector  # the state at the end of a leg
    speed: Coefficients
    output: Coefficients
    current: Coefficients
    fall: Coefficients  # of the voltage along the winding
    winding: Coefficients  # temperature [K]
    housing: Coefficients
    course: Course  # of a guard, in parts of a leg
    place: int  # where its memory stands among those of all
    lane: int  # where its numbers do
    duty: float  # nan: not found out yet
    torque: float  # of its load, the external one [N m]
    time: float
    due: float  # when its program does something next
    last: float  # how far it may go
    slack: float  # within which two instants are one
    frames: int
    origin: float
    tick: float  # how long one lasts
    numbers: Numbers  # at its duty, as on a stiff source
    given: Numbers


class Coupling(NamedTuple):
    """The common part of servos along a leg."""

    V: float  # of the supply without current
    R_b: float
    I_max: float
    voltage: Coefficients  # of the bus
    terms: int  # of all series
    now: float  # the voltage of the bus where the servos are
    then: float  # and at the end of the leg
    bend: float  # h² max|V̈|
    jumped: int  # 1: a speed has jumped, and with it the currents of all


unit_numbers = record_reader("unit_numbers", Numbers)
put_unit_numbers = record_writer("put_unit_numbers", Numbers)
unit_mode = record_reader("unit_mode", Mode)
put_unit_mode = record_writer("put_unit_mode", Mode)
unit_state = record_reader("unit_state", Vector)
put_unit_state = record_writer("put_unit_state", Vector)
put_unit_law = record_writer("put_unit_law", Law)


# --- The law of a servo on a coupled leg ------------------------------------------------------------------------------

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
    """A value linear in a motor's torque and in a speed: without both, per torque and per speed."""

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


# --- Servos behind one supply between two events ----------------------------------------------------------------------

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
