"""Legs of servos on one supply: their modes at its voltage, whether these surely last, and what ends them first.

How much a series bends within a leg is bounded by its coefficients: |x(t) − chord| ≤ h² max|ẍ|/8, and ẋ keeps its sign
where h |ẋ(0)| > h² max|ẍ|. So it is mostly enough to look at both ends of a leg; guards that may fall below zero on the
way are followed, as the general engine has them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.bus import coupled_series
from servotwin.models.engine.bus.coupled_series import place_at, put_after, put_law_of, state_at, voltage_at
from servotwin.models.engine.bus.coupled_units import (
    put_unit_mode,
    put_unit_numbers,
    put_unit_state,
    unit_mode,
    unit_numbers,
    unit_state,
)
from servotwin.models.engine.bus.shared_source import driven, part_on_bus
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.events import guards
from servotwin.models.engine.legs import legs
from servotwin.models.engine.legs.legs import MOST_SHORT, SHORT
from servotwin.models.state.modes import (
    BACKWARD,
    FORWARD,
    INSIDE,
    NO_CURRENT,
    NOWHERE,
    STUCK,
    Mode,
    Vector,
    sign_of,
)
from servotwin.models.terms import bridge, duty, play
from servotwin.models.terms.friction import share
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.motor import back_emf

MOST_LEGS = 400  # to one instant; servos that need more are left to the general engine
_LEAST = 0.05  # of the open-circuit voltage: below, buses are left to the general engine
_SAME = 1e-14  # of that
_HALVINGS = 200
_INSTANT, _ROUNDING = 1e-16, 1e-16  # s and units of a guard, within which a root is found
_CLOSE = 1e-13  # A

_ZONES = 1 << guards.ZONE_UP | 1 << guards.ZONE_DOWN
_BY_PLACE = 1 << guards.SPEED | 1 << guards.MOTOR_SPEED | guards.MEETINGS | guards.STOPS  # without torques
_AT_REST = ~(_ZONES | 1 << guards.SPEED | guards.MEETINGS | guards.STOPS)  # what ends rest of what the motor turns

DONE, LEFT = 1, 0
ZONE, DUTY = 1, 2  # why a mode has to be found anew


def put_duty(unit: Any, now: float) -> None:
    """Let a servo's bridge have a duty, or be open or braked."""
    given = unit_numbers(unit.given)
    numbers = duty.at_duty(given, now)
    drive = math.copysign(1.0, now) if duty.drives(now) else 0.0
    path = numbers.bridge
    put_unit_numbers(unit.numbers, driven(numbers, path.D_drive, path.R_drive - numbers.source.R_b))
    unit.duty, unit.anew = now, DUTY
    unit.sign = part_on_bus(drive, numbers.bridge, now, NOWHERE) if drive != 0.0 else 0.0
    unit.open = 1 if drive == 0.0 and bridge.coasts(numbers.bridge) else 0


def settle(units: Any, count: int, common: Any) -> int:
    """Find the modes of servos whose duties are others, and of all that these change; return `LEFT` or not.

    What another voltage of the bus has ended of a mode in which something moves, its guards tell.
    """
    changed = common.jumped != 0
    for k in range(count):
        changed = changed or units[k].anew != 0
    if not changed:
        return DONE
    before, common.jumped = common.now, 0
    if put_zones(units, count, common) == LEFT:
        return LEFT
    for k in range(count):
        unit = units[k]
        if unit.anew != 0 or (common.now != before and unit.sign != 0.0 and unit.law.moves == 0.0):
            _settle(unit, common.now)
    return DONE


def _settle(unit: Any, V: float) -> None:
    y, mode, u = unit_state(unit.y), unit_mode(unit.mode), unit.sign * V
    numbers = warm(unit_numbers(unit.numbers), y)
    if mode.mesh != INSIDE and mode.motor == STUCK and unit.anew != DUTY:
        mode = contacts.held(numbers, mode.zone, u, unit.torque, y, mode.mesh)
    else:
        mode = contacts.settled(numbers, mode.zone, u, unit.torque, y, mode.mesh, False)
    put_unit_mode(unit.mode, mode)
    put_law_of(unit)
    unit.anew = 0


def put_zones(units: Any, count: int, common: Any) -> int:
    """Put servos into the zones of their currents, at a voltage of the bus that these leave; return `LEFT` or not.

    The bus sags the more of them conduct, and the fewer conduct the more it sags: a few rounds settle it.
    """
    V = common.now
    for _ in range(20 + 4 * count):
        below, back = 1.0, 0.0
        for k in range(count):
            unit = units[k]
            if unit.sign == 0.0 and unit.anew == 0:
                continue
            y = unit_state(unit.y)
            numbers = warm(unit_numbers(unit.numbers), y)
            zone = currents.zone_of(numbers, unit.sign * V, 0.0, y.q, y.w_m, 0.0)
            if zone != unit.mode.zone:
                unit.mode.zone, unit.anew = zone, max(unit.anew, ZONE)
            if unit.sign != 0.0 and zone != NO_CURRENT:
                per_volt = unit.sign / numbers.bridge.R_drive
                below += common.R_b * unit.sign * per_volt
                back += per_volt * (back_emf(y.w_m, numbers.motor.K_b) + sign_of(zone) * numbers.bridge.D_drive)
        before, V = V, (common.V + common.R_b * back) / below
        if abs(V - before) <= _SAME * common.V:
            break
    common.now = V
    return DONE if V >= _LEAST * common.V else LEFT


def current_of(unit: Any, V: float, y: Vector) -> float:
    """Return the current of a servo [A] in a state, under a voltage of the bus [V]."""
    numbers = warm(unit_numbers(unit.numbers), y)
    return currents.current(numbers, unit.mode.zone, unit.sign * V, y.q, y.w_m)


def is_plain(units: Any, count: int, common: Any, V: float, at_end: bool) -> bool:
    """Tell whether the source follows its resistance, and diodes block, where servos are or at the end of a leg."""
    total = 0.0
    for k in range(count):
        unit = units[k]
        y = unit_state(unit.after) if at_end and unit.active != 0 else unit_state(unit.y)
        if unit.open != 0 and abs(back_emf(y.w_m, unit.numbers.motor.K_b)) >= V:
            return False
        if common.I_max < math.inf and unit.sign != 0.0:
            total += unit.sign * current_of(unit, V, y)
    if common.I_max == math.inf:
        return True
    return bool(-_CLOSE <= total <= common.I_max)


def go(units: Any, count: int, common: Any, time: float) -> float:
    """Let all servos go on for a time [s], leg by leg; return how long they have: less where they are left."""
    left, longest = time, 0.0
    for _ in range(MOST_LEGS):
        if settle(units, count, common) == LEFT or not is_plain(units, count, common, common.now, False):
            return time - left
        moving = False
        for k in range(count):
            if units[k].law.R_slope != 0.0:
                put_law_of(units[k])  # at the temperatures that there are now
            moving = moving or units[k].active != 0
        if not moving or not left > 0.0:
            return time
        longest = coupled_series.longest(units, count)
        length = min(left, longest)
        coupled_series.work_out(units, count, common, length)
        whose, kind, end = -1, -1, length
        for k in range(count):
            kinds = doubtful(units[k], common, length)
            if kinds != 0:
                found, s = first_end(units[k], common, kinds, end, whose < 0)
                if found >= 0:
                    whose, kind, end = k, found, s
        if whose < 0:
            if not is_plain(units, count, common, common.then, True):
                return time - left
            for k in range(count):
                if units[k].active != 0:
                    units[k].short = 0
                    put_unit_state(units[k].y, unit_state(units[k].after))
            common.now = common.then
            if length == left:
                return time
            left -= length
            continue
        for k in range(count):
            if units[k].active != 0:
                put_after(units[k], state_at(units[k], common.terms, end))
        common.then = voltage_at(common, end)
        if not is_plain(units, count, common, common.then, True):
            return time - left
        for k in range(count):
            if units[k].active != 0:
                put_unit_state(units[k].y, unit_state(units[k].after))
        common.now = common.then
        _cross(units[whose], kind, common.now, end, time)
        common.jumped = 1 if jumps(kind) and units[whose].sign != 0.0 else 0
        left -= end
    return time - left


def _cross(unit: Any, kind: int, V: float, end: float, time: float) -> None:
    """Let an event of a servo have happened, at the end of a leg."""
    numbers, mode, u = unit_numbers(unit.numbers), unit_mode(unit.mode), unit.sign * V
    mode, y = guards.cross(numbers, mode, kind, u, unit.torque, unit_state(unit.y))
    unit.short = unit.short + 1 if end <= SHORT * time else 0
    if unit.short >= MOST_SHORT and play.present(numbers.play):
        _, mode, y = legs.together(warm(numbers, y), mode, u, unit.torque, y)
    put_unit_mode(unit.mode, mode)
    put_unit_state(unit.y, y)
    put_law_of(unit)


def jumps(kind: int) -> bool:
    """Tell whether an event makes a speed jump, and with it the currents of all."""
    return kind == guards.UPPER or kind == guards.LOWER or kind == guards.MEET_FORWARD or kind == guards.MEET_BACKWARD


# --- whether a mode lasts ---------------------------------------------------------------------------------------------


def doubtful(unit: Any, common: Any, length: float) -> int:
    """Return which guards of a servo do not surely stay above zero along a leg, as a sum of 1 << kind."""
    constant = unit.sign == 0.0 or (
        common.now == common.then and common.bend == 0.0 and unit.law.R_slope == 0.0)
    if unit.active == 0 and constant:
        return 0
    mode, y = unit_mode(unit.mode), unit_state(unit.y)
    after = unit_state(unit.after) if unit.active != 0 else y
    numbers, law = warm(unit_numbers(unit.numbers), after), unit.law
    u0, u, moves, apart = unit.sign * common.now, unit.sign * common.then, law.moves > 0.0, law.apart > 0.0
    bend = unit.bend
    bend_x = abs(unit.sign) * common.bend + law.K_b * bend
    kinds = 0 if _in_zone(numbers, mode.zone, u0, u, y, after, bend_x) else _ZONES
    inside = mode.mesh == INSIDE
    if (apart or (moves and not inside)) and not numbers.stops.lower < after.q < numbers.stops.upper:
        kinds |= guards.STOPS
    if inside:
        if apart and not _keeps_way(mode.contact, unit.output, y.w, after.w, 0.0, length):
            kinds |= 1 << guards.SPEED | guards.STOPS
        if moves and not _keeps_way(mode.motor, unit.speed, y.w_m, after.w_m, bend, length):
            kinds |= 1 << guards.MOTOR_SPEED
        if not _within_play(numbers, y, after, bend, length):
            kinds |= guards.MEETINGS
    elif moves and not _keeps_way(mode.contact, unit.speed, y.w, after.w, bend, length):
        kinds |= 1 << guards.SPEED | guards.STOPS
    if not moves and not constant:
        kinds |= _released(unit, numbers, mode, u0, u, after, bend_x)
    if not moves or (mode.share == 0 and not play.present(numbers.play)):
        return kinds
    return kinds | _parted(unit, numbers, mode, u0, u, y, after, bend_x)


def _keeps_way(contact: int, speed: Any, w: float, after: float, bend: float, length: float) -> bool:
    """Tell whether a body surely goes on the way on which it slides: its speed is monotone, or far from zero."""
    way = 1.0 if contact == FORWARD else -1.0 if contact == BACKWARD else math.copysign(1.0, after)
    if not (way * after > 0.0 and way * w >= 0.0):
        return False
    if abs(speed[1]) * length > bend:
        return w != 0.0 or way * speed[1] > 0.0
    return min(abs(w), abs(after)) > 0.25 * bend


def _in_zone(numbers: Numbers, zone: int, u0: float, u: float, y: Vector, after: Vector, bend: float) -> bool:
    """Tell whether the current surely stays in its zone."""
    low, high = currents.zone_limits(numbers, zone, u)
    if low == -math.inf and high == math.inf:
        return True
    x0, x = u0 - back_emf(y.w_m, numbers.motor.K_b), u - back_emf(after.w_m, numbers.motor.K_b)
    if not low < x < high:
        return False
    first = low + 0.25 * bend < x0 < high - 0.25 * bend and low + 0.25 * bend < x < high - 0.25 * bend
    return first or (low + guards.BELOW <= x0 <= high - guards.BELOW and abs(x - x0) > 2.0 * bend)


def _within_play(numbers: Numbers, y: Vector, after: Vector, bend: float, length: float) -> bool:
    """Tell whether motor and output surely stay apart."""
    ahead, half = y.q_m - y.q, numbers.play.half
    most = length * max(max(y.w_m, after.w_m) + 0.125 * bend - min(y.w, after.w), 0.0)
    least = length * min(min(y.w_m, after.w_m) - 0.125 * bend - max(y.w, after.w), 0.0)
    return ahead + most < half and ahead + least > -half


def _released(unit: Any, numbers: Numbers, mode: Mode, u0: float, u: float, after: Vector, bend: float) -> int:
    """Return which guards may fall that keep what the motor turns at rest."""
    kinds, margin = guards.guards(numbers, mode, u, False) & _AT_REST, 2.0 * unit.law.K * unit.law.conducts * bend
    for kind in range(guards.KINDS):
        if kinds >> kind & 1:
            first = guards.guard(numbers, mode, kind, u0, 0.0, unit.torque, 0.0, after, NOWHERE)[0]
            end = guards.guard(numbers, mode, kind, u, 0.0, unit.torque, 0.0, after, NOWHERE)[0]
            if _above(first, end, margin):
                kinds ^= 1 << kind
    return kinds


def _parted(unit: Any, numbers: Numbers, mode: Mode, u0: float, u: float, y: Vector, after: Vector,
            bend: float) -> int:
    """Return which may fall of the guards of a share, and of motor and output that press together."""
    body, tau, kinds = numbers.shaft, unit.torque, 0
    torque, before = currents.drive_torque(numbers, mode.zone, u, after), currents.drive_torque(
        numbers, mode.zone, u0, y)
    off = 0.25 * unit.law.K * unit.law.conducts * bend
    if mode.share != 0:
        least = abs(share(numbers.friction, off, 0.0)) + abs(
            share(numbers.friction, 0.0, 0.25 * body.b_out * unit.bend))
        if not _above(mode.share * contacts.through_gear(numbers, mode.mesh, before, tau, y),
                      mode.share * contacts.through_gear(numbers, mode.mesh, torque, tau, after), least):
            kinds = 1 << guards.SHARE
    if mode.mesh == INSIDE or not play.present(numbers.play) or mode.motor == STUCK:
        return kinds
    if torque * before <= 0.0 or min(abs(torque), abs(before)) <= off:
        return kinds | 1 << guards.PART  # there is a bend in how they press
    inertia = body.J - body.J_out
    least = 2.0 * off / inertia + unit.bend * (abs(body.b - body.b_out) / inertia + body.b_out / body.J_out)
    pressed = _above(contacts.pressing_along(numbers, mode, u0, tau, y),
                     contacts.pressing_along(numbers, mode, u, tau, after), least)
    return kinds if pressed else kinds | 1 << guards.PART


def _above(first: float, end: float, least: float) -> bool:
    """Tell whether what bends so little stays above zero: at both ends it is, and it is monotone or far from zero."""
    return first >= 0.0 and end > 0.0 and (min(first, end) > least or abs(end - first) > 4.0 * least)


# --- what ends a mode -------------------------------------------------------------------------------------------------


def first_end(unit: Any, common: Any, doubtful: int, length: float, last: bool) -> tuple[int, float]:
    """Return which doubtful guard of a servo falls below zero first along a leg (−1: none), and when [s].

    Where it is the `last` instant it counts as well. A guard turns once at most, about where a parabola does.
    """
    kinds = doubtful & guards.guards(unit_numbers(unit.numbers), unit_mode(unit.mode), unit.sign * common.now, False)
    if kinds == 0:
        return -1, length
    at_start, at_end = _place(unit, common, kinds, 0.0), _place(unit, common, kinds, length)
    middle = at_start
    found, first = -1, length
    for kind in range(guards.KINDS):
        if not kinds >> kind & 1:
            continue
        s, f, f_end = math.inf, _guard(unit, kind, at_start), _guard(unit, kind, at_end)
        if f < guards.BELOW:  # what another one did has ended this mode too
            s = 0.0
        elif f_end < guards.BELOW:
            s = _crossing(unit, common, kind, 0.0, f, length, f_end)
        else:
            middle = middle if middle.s > 0.0 else _place(unit, common, kinds, 0.5 * length)
            f_middle = _guard(unit, kind, middle)
            bend = f - 2.0 * f_middle + f_end
            turn = 0.25 * (3.0 * f - 4.0 * f_middle + f_end) / bend * length if bend > 0.0 else -1.0
            lowest = middle
            if f_middle >= guards.BELOW and 0.0 < turn < length:
                lowest = _place(unit, common, kinds, turn)
                f_middle = _guard(unit, kind, lowest)
            if f_middle < guards.BELOW:
                s = _crossing(unit, common, kind, 0.0, f, lowest.s, f_middle)
        if s < first or (s == first and found < 0 and last):
            found, first = kind, s
    return found, first


class Place(NamedTuple):
    """Where a servo is along a leg: how long after its beginning [s], the voltage in its circuit [V], its state."""

    s: float
    u: float
    y: Vector


def _place(unit: Any, common: Any, kinds: int, s: float) -> Place:
    """Return where a servo is at s [s] after the beginning of a leg, as far as guards of these kinds look at it."""
    if kinds & ~_BY_PLACE == 0:
        return Place(s, 1.0, place_at(unit, common.terms, s))
    return Place(s, unit.sign * voltage_at(common, s), state_at(unit, common.terms, s))


def _guard(unit: Any, kind: int, place: Place) -> float:
    """Return a guard of a servo somewhere along a leg."""
    return guards.guard(unit_numbers(unit.numbers), unit_mode(unit.mode), kind, place.u, 0.0, unit.torque, 0.0,
                        place.y, place.y)[0]


def _crossing(unit: Any, common: Any, kind: int, a: float, f_a: float, b: float, f_b: float) -> float:
    """Return when a guard falls below zero, between two times [s] at which it is at least zero, to rounding, and below.

    By inverse parabolas where they are sure to lead on, else by halves (Chandrupatla 1997).
    """
    if f_a <= -guards.BELOW:  # it starts at zero, to rounding: look whether it rises before it falls
        start = a
        for _ in range(50):
            a = start + 0.5 * (b - start)
            f_a = _guard(unit, kind, _place(unit, common, 1 << kind, a))
            if f_a > -guards.BELOW:
                break
            b, f_b = a, f_a
        if f_a <= -guards.BELOW or f_b > 0.0:
            return start
    new, f_new, old, f_old, part = b, f_b, a, f_a, f_a / (f_a - f_b)
    part = 1.0 - part
    for _ in range(_HALVINGS):
        s = new + part * (old - new)
        f = _guard(unit, kind, _place(unit, common, 1 << kind, s))
        if (f > 0.0) == (f_new > 0.0):
            third, f_third = new, f_new
        else:
            third, f_third = old, f_old
            old, f_old = new, f_new
        new, f_new = s, f
        least = _INSTANT / abs(old - new)
        if abs(f) <= _ROUNDING:
            return s
        if least > 0.5:
            break
        xi, phi = (new - old) / (third - old), (f_new - f_old) / (f_third - f_old)
        part = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            part = (f_new / (f_old - f_new) * f_third / (f_old - f_third)
                    + (third - new) / (old - new) * f_new / (f_third - f_new) * f_old / (f_third - f_old))
        part = min(max(part, least), 1.0 - least)
    return new if f_new <= 0.0 else old
