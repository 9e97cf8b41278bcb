"""Legs of servos on one supply: their modes at its voltage, whether these surely last, and what ends them first.

How much a series bends within a leg is bounded by its coefficients: |x(t) − chord| ≤ h² max|ẍ|/8, and ẋ keeps its sign
where h |ẋ(0)| > h² max|ẍ|. So it is mostly enough to look at both ends of a leg; guards that may fall below zero on the
way are followed, as the general engine has them.

A guard is written in parts of the leg, Σ c_n xⁿ with x from 0 to 1, so that its value, its slope and a bound of how
much it bends are sums of coefficients.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.dynamics.currents import driven, part_on_bus
from servotwin.models.engine.events import crossings
from servotwin.models.engine.legs import coupled_units, legs
from servotwin.models.engine.legs.coupled_units import (
    follow,
    put_after,
    put_law_of,
    put_unit_mode,
    put_unit_numbers,
    put_unit_state,
    state_at,
    unit_mode,
    unit_numbers,
    unit_state,
    voltage_at,
)
from servotwin.models.engine.legs.legs import MOST_SHORT, SHORT
from servotwin.models.state.modes import (
    BACKWARD,
    FORWARD,
    INSIDE,
    NO_CURRENT,
    NOWHERE,
    STUCK,
    Vector,
    sign_of,
)
from servotwin.models.terms import bridge, duty, play
from servotwin.models.terms.friction import core_speed
from servotwin.models.terms.numbers import warm
from servotwin.physics.motor import back_emf

# --- Guards that look at places and speeds alone, along a coupled leg -------------------------------------------------
BY_PLACE = 1 << guards.SPEED | 1 << guards.MOTOR_SPEED | guards.MEETINGS | guards.STOPS
_STEPS = 100  # of a search, which takes four
_COURSE_INSTANT, _COURSE_ROUNDING = 1e-16, 1e-16  # s and units of a guard, within which a root is found
_NEAR = 1e-4  # of a leg: how well the time of a least value is found, whose square counts
_RISES = 50  # halvings of a leg, to see a guard that starts at zero rise


def first_below(unit: Any, kind: int, terms: int, length: float) -> float:
    """Return when a guard of a servo falls below zero along a leg [s]; inf: it does not."""
    bend, last = _put_course(unit, kind, terms, length)
    first = unit.course[0]
    if first < guards.BELOW:  # what another one did has ended this mode too
        return 0.0
    if last < guards.BELOW:
        return length * _course_crossing(unit.course, terms, 1.0, last, _COURSE_INSTANT / length)
    if min(first, last) >= 0.125 * bend or abs(unit.course[1]) >= bend:  # the chord bounds it, or it is monotone
        return math.inf
    lowest = _lowest(unit.course, terms)
    least = _value(unit.course, terms, lowest)
    if least >= guards.BELOW:
        return math.inf
    return length * _course_crossing(unit.course, terms, lowest, least, _COURSE_INSTANT / length)


def _put_course(unit: Any, kind: int, terms: int, length: float) -> tuple[float, float]:
    """Write a guard of a servo as a series in parts of a leg; return a bound of its second derivative, and its end."""
    y, law, mode, start = unit.y, unit.law, unit.mode, 0.0
    motor = output = 0.0  # what counts of the speed of what the motor turns, and of the output's alone
    angle = True
    if kind == guards.SPEED:
        way, angle = 1.0 if mode.contact == FORWARD else -1.0, False
        start = -core_speed(unit_numbers(unit.numbers).friction)
        if mode.mesh == INSIDE:
            output = way * law.apart
        else:
            motor = way * law.moves
    elif kind == guards.MOTOR_SPEED:
        motor, angle = law.moves if mode.motor == FORWARD else -law.moves, False
    elif kind == guards.MEET_FORWARD or kind == guards.MEET_BACKWARD:
        way = 1.0 if kind == guards.MEET_FORWARD else -1.0
        start = unit.numbers.play.half - way * (y.q_m - y.q)
        motor, output = -way * law.moves, way * law.apart
    else:
        way = 1.0 if kind == guards.UPPER else -1.0
        start = way * ((unit.numbers.stops.upper if kind == guards.UPPER else unit.numbers.stops.lower) - y.q)
        if mode.mesh == INSIDE:
            output = -way * law.apart
        else:
            motor = -way * law.moves
    return _in_parts(unit, angle, start, motor, output, terms, length)


def _in_parts(unit: Any, angle: bool, start: float, motor: float, output: float, terms: int,
              length: float) -> tuple[float, float]:
    """Write what begins so and turns with these parts of both speeds, or is them."""
    bend, power, lag = 0.0, 1.0, 1 if angle else 0
    unit.course[0] = start
    if not angle:
        unit.course[0] += _of_both(unit, motor, output, 0)
    end = unit.course[0]
    for n in range(1, terms + 1 + lag):
        power *= length
        c = _of_both(unit, motor, output, n - lag) * power
        if angle:
            c /= n
        unit.course[n] = c
        end += c
        bend += n * (n - 1) * abs(c)
    if not angle:
        unit.course[terms + 1] = 0.0
    return bend, end


def _of_both(unit: Any, motor: float, output: float, n: int) -> float:
    """Return a coefficient of so much of both speeds; of one that does not count it may be anything."""
    c = 0.0
    if motor != 0.0:
        c = motor * unit.speed[n]
    if output != 0.0:
        c += output * unit.output[n]
    return c


def _value(course: Any, terms: int, x: float) -> float:
    f = 0.0
    for n in range(terms + 1, -1, -1):
        f = f * x + course[n]
    return f


def _value_and_slope(course: Any, terms: int, x: float) -> tuple[float, float]:
    f = slope = 0.0
    for n in range(terms + 1, 0, -1):
        f = f * x + course[n]
        slope = slope * x + f
    return f * x + course[0], slope


def _slope_and_bend(course: Any, terms: int, x: float) -> tuple[float, float]:
    slope = bend = 0.0
    for n in range(terms + 1, 1, -1):
        slope = slope * x + n * course[n]
        bend = bend * x + slope
    return slope * x + course[1], bend


def _lowest(course: Any, terms: int) -> float:
    """Return where a guard is least that turns twice at most, 0 where that is at an end: where its slope rises."""
    a, slope, bend, b = 0.0, float(course[1]), 2.0 * float(course[2]), 1.0
    end, end_bend = _slope_and_bend(course, terms, 1.0)
    if slope >= 0.0 or end <= 0.0:
        if (slope < 0.0) != (end <= 0.0) or bend * end_bend >= 0.0 or (bend > 0.0) != (slope < 0.0):
            return 0.0
        x = _straight(course, terms, bend)
        between = _slope_and_bend(course, terms, x)[0]
        if (between < 0.0) == (slope < 0.0):
            return 0.0
        if slope < 0.0:
            b, end = x, between
        else:
            a, slope = x, between
    x = a + (b - a) * slope / (slope - end)
    for _ in range(_STEPS):
        slope, bend = _slope_and_bend(course, terms, x)
        if slope < 0.0:
            a = x
        else:
            b = x
        new = x - slope / bend if bend > 0.0 else 0.5 * (a + b)
        if not a < new < b:
            new = 0.5 * (a + b)
        if abs(new - x) <= _NEAR or b - a <= _NEAR:
            return new
        x = new
    return x


def _straight(course: Any, terms: int, bend: float) -> float:
    """Return where the second derivative of a guard, that begins so, gets another sign, by halves of a leg."""
    a, b = 0.0, 1.0
    for _ in range(_RISES):
        x = 0.5 * (a + b)
        if (_slope_and_bend(course, terms, x)[1] > 0.0) == (bend > 0.0):
            a = x
        else:
            b = x
    return b


def _course_crossing(course: Any, terms: int, b: float, f_b: float, instant: float) -> float:
    """Return where a guard falls below zero, between the beginning and where it is below, by Newton's method.

    Both in parts of a leg. Where a step would lead out of what is known to hold the root, half of that is taken.
    """
    a, f_a = 0.0, float(course[0])
    if f_a <= -guards.BELOW:  # it starts at zero, to rounding: look whether it rises before it falls
        for _ in range(_RISES):
            a = 0.5 * b
            f_a = _value(course, terms, a)
            if f_a > -guards.BELOW:
                break
            b, f_b = a, f_a
        if f_a <= -guards.BELOW or f_b > 0.0:
            return 0.0
    x = a + (b - a) * f_a / (f_a - f_b)
    for _ in range(_STEPS):
        f, slope = _value_and_slope(course, terms, x)
        if abs(f) <= _COURSE_ROUNDING:
            return x
        if f > 0.0:
            a = x
        else:
            b = x
        new = x - f / slope if slope < 0.0 else 0.5 * (a + b)
        if abs(new - x) <= instant:
            return min(max(new, a), b)
        if not a < new < b:
            new = 0.5 * (a + b)
        x = new
    return b


# --- Ends of modes on a coupled leg: guards along power series, and their roots ---------------------------------------
_HALVINGS = 200
_INSTANT, _ROUNDING = 1e-16, 1e-16  # s and units of a guard, within which a root is found


class Place(NamedTuple):
    """Where a servo is along a leg: how long after its beginning [s], the voltage in its circuit [V], its state."""

    s: float
    u: float
    y: Vector


def first_end(unit: Any, common: Any, doubtful: int, length: float, last: bool) -> tuple[int, float]:
    """Return which doubtful guard of a servo falls below zero first along a leg (−1: none), and when [s].

    Where it is the `last` instant it counts as well. A guard that looks at torques turns once at most, about where a
    parabola does.
    """
    found, first, kinds = -1, length, doubtful
    for kind in range(guards.KINDS):
        if (kinds & BY_PLACE) >> kind & 1:
            s = first_below(unit, kind, common.terms, length)
            if s < first or (s == first and found < 0 and last):
                found, first = kind, s
    kinds &= ~BY_PLACE
    if kinds == 0:
        return found, first
    end = first
    at_start = _place(unit, common, 0.0)
    at_end = _place(unit, common, end)
    for kind in range(guards.KINDS):
        if kinds >> kind & 1:
            s = _below(unit, common, kind, at_start, at_end)
            if s < first or (s == first and found < 0 and last):
                found, first = kind, s
    return found, first


def _below(unit: Any, common: Any, kind: int, at_start: Place, at_end: Place) -> float:
    """Return when a guard that looks at torques falls below zero between two places [s]; inf: it does not."""
    f, f_end, length = _guard(unit, kind, at_start), _guard(unit, kind, at_end), at_end.s
    if f < guards.BELOW:  # what another one did has ended this mode too
        return 0.0
    if f_end < guards.BELOW:
        return _crossing(unit, common, kind, 0.0, f, length, f_end)
    lowest = _place(unit, common, 0.5 * length)
    least = _guard(unit, kind, lowest)
    bend = f - 2.0 * least + f_end
    turn = 0.25 * (3.0 * f - 4.0 * least + f_end) / bend * length if bend > 0.0 else -1.0
    if least >= guards.BELOW and 0.0 < turn < length:
        lowest = _place(unit, common, turn)
        least = _guard(unit, kind, lowest)
    if least >= guards.BELOW:
        return math.inf
    return _crossing(unit, common, kind, 0.0, f, lowest.s, least)


def _place(unit: Any, common: Any, s: float) -> Place:
    """Return where a servo is at s [s] after the beginning of a leg."""
    y = state_at(unit, common.terms, s)
    return Place(s, unit.sign * voltage_at(common, s), y)


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
            place = _place(unit, common, a)
            f_a = _guard(unit, kind, place)
            if f_a > -guards.BELOW:
                break
            b, f_b = a, f_a
        if f_a <= -guards.BELOW or f_b > 0.0:
            return start
    new, f_new, old, f_old, part = b, f_b, a, f_a, f_a / (f_a - f_b)
    part = 1.0 - part
    for _ in range(_HALVINGS):
        s = new + part * (old - new)
        place = _place(unit, common, s)
        f = _guard(unit, kind, place)
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


# --- Legs of servos on one supply -------------------------------------------------------------------------------------

MOST_LEGS = 400  # to one instant; servos that need more are left to the general engine
_LEAST = 0.05  # of the open-circuit voltage: below, buses are left to the general engine
_SAME = 1e-14  # of that
_CLOSE = 1e-13  # A
_ZONES = 1 << guards.ZONE_UP | 1 << guards.ZONE_DOWN
_BY_TORQUE = 1 << guards.SHARE | 1 << guards.PART
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

    The guards of a mode in which something moves tell what another voltage of the bus has ended.
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
            law, w = unit.law, unit.y.w_m
            conducts, K_b, drop = law.conducts, law.K_b, law.drop
            if unit.anew != 0 or not law.low < unit.sign * V - back_emf(w, K_b) < law.high:
                conducts, K_b, drop = _put_zone(unit, V)
            if unit.sign != 0.0 and unit.mode.zone != NO_CURRENT:
                per_volt = unit.sign * conducts
                below += common.R_b * unit.sign * per_volt
                back += per_volt * (back_emf(w, K_b) + drop)
        before, V = V, (common.V + common.R_b * back) / below
        if abs(V - before) <= _SAME * common.V:
            break
    common.now = V
    return DONE if V >= _LEAST * common.V else LEFT


def _put_zone(unit: Any, V: float) -> tuple[float, float, float]:
    """Put a servo into the zone of its current; return one by the resistance of its driven loop, K_b, and the drop."""
    y = unit_state(unit.y)
    numbers = warm(unit_numbers(unit.numbers), y)
    zone = currents.zone_of(numbers, unit.sign * V, 0.0, y.q, y.w_m, 0.0)
    if zone != unit.mode.zone:
        unit.mode.zone, unit.anew = zone, max(unit.anew, ZONE)
    return 1.0 / numbers.bridge.R_drive, numbers.motor.K_b, sign_of(zone) * numbers.bridge.D_drive


def current_of(unit: Any, V: float, y: Vector) -> float:
    """Return the current of a servo [A] in a state, under a voltage of the bus [V]."""
    numbers = warm(unit_numbers(unit.numbers), y)
    return currents.current(numbers, unit.mode.zone, unit.sign * V, y.q, y.w_m)


def is_plain(units: Any, count: int, common: Any, V: float, at_end: bool) -> bool:
    """Tell whether the source follows its resistance, and diodes block, where servos are or at the end of a leg.

    States that are no longer finite are left to the general engine as well, which says so.
    """
    total = 0.0
    for k in range(count):
        unit = units[k]
        y = unit.after if at_end and unit.active != 0 else unit.y
        if not math.isfinite(y.q + y.w + y.T_w + y.q_m + y.w_m):
            return False
        if unit.open != 0 and abs(back_emf(y.w_m, unit.numbers.motor.K_b)) >= V:
            return False
        if common.I_max < math.inf and unit.sign != 0.0:
            total += unit.sign * current_of(unit, V, unit_state(y))
    if common.I_max == math.inf:
        return True
    return bool(-_CLOSE <= total <= common.I_max)


def go(units: Any, count: int, common: Any, time: float) -> float:
    """Advance all servos by a time [s], leg by leg; return how long they have: less where they are left."""
    left = time
    for _ in range(MOST_LEGS):
        if settle(units, count, common) == LEFT or not is_plain(units, count, common, common.now, False):
            return time - left
        moving = False
        for k in range(count):
            moving = moving or units[k].active != 0
        if not moving or not left > 0.0:
            return time
        length = min(left, coupled_units.longest(units, count))
        coupled_units.work_out(units, count, common, length)
        whose, kind, end = _ending(units, count, common, length)
        if whose < 0:
            if not is_plain(units, count, common, common.then, True):
                return time - left
            for k in range(count):
                units[k].short = 0 if units[k].active != 0 else units[k].short
            _arrive(units, count, common)
            if length == left:
                return time
            left -= length
            continue
        for k in range(count):
            if units[k].active != 0:
                put_after(units[k], common.terms, end)
        common.then = voltage_at(common, end)
        if not is_plain(units, count, common, common.then, True):
            return time - left
        _arrive(units, count, common)
        _cross(units[whose], kind, common.now, end, time)
        common.jumped = 1 if jumps(kind) and units[whose].sign != 0.0 else 0
        left -= end
    return time - left


def _ending(units: Any, count: int, common: Any, length: float) -> tuple[int, int, float]:
    """Return whose event ends a leg first (−1: nobody's), of which kind, and when [s]."""
    whose, kind, end = -1, -1, length
    for k in range(count):
        kinds = doubtful(units[k], common, length)
        if kinds != 0:
            found, s = first_end(units[k], common, kinds, end, whose < 0)
            if found >= 0:
                whose, kind, end = k, found, s
    return whose, kind, end


def _arrive(units: Any, count: int, common: Any) -> None:
    """Let servos be at the end of a leg."""
    for k in range(count):
        if units[k].active != 0:
            units[k].mesh = units[k].mode.mesh
            put_unit_state(units[k].y, unit_state(units[k].after))
            follow(units[k])
    common.now = common.then


def _cross(unit: Any, kind: int, V: float, end: float, time: float) -> None:
    """Let an event of a servo have happened, at the end of a leg."""
    numbers, mode, u = unit_numbers(unit.numbers), unit_mode(unit.mode), unit.sign * V
    mode, y = crossings.cross(numbers, mode, kind, u, unit.torque, unit_state(unit.y))
    unit.short = unit.short + 1 if end <= SHORT * time else 0
    if unit.short >= MOST_SHORT and play.present(numbers.play):
        _, mode, y = legs.together(warm(numbers, y), mode, u, unit.torque, y)
    unit.mesh = mode.mesh
    put_unit_mode(unit.mode, mode)
    put_unit_state(unit.y, y)
    put_law_of(unit)


def jumps(kind: int) -> bool:
    """Tell whether an event makes a speed jump, and with it the currents of all."""
    return kind == guards.UPPER or kind == guards.LOWER or kind == guards.MEET_FORWARD or kind == guards.MEET_BACKWARD


# --- whether a mode lasts ---------------------------------------------------------------------------------------------
def doubtful(unit: Any, common: Any, length: float) -> int:
    """Return which guards of a servo do not surely stay above zero along a leg, as a sum of 1 << kind."""
    law, mode, y, after, bend = unit.law, unit.mode, unit.y, unit.after, unit.bend
    constant = unit.sign == 0.0 or (common.now == common.then and common.bend == 0.0 and law.R_slope == 0.0)
    moves, apart, inside = law.moves > 0.0, law.apart > 0.0, mode.mesh == INSIDE
    if not moves and not apart and constant:
        return 0
    u0, u = unit.sign * common.now, unit.sign * common.then
    bend_x = abs(unit.sign) * common.bend + law.K_b * bend
    x0, x = u0 - law.K_b * y.w_m, u - (law.K_b + law.K_b_slope * (after.T_h - y.T_h)) * after.w_m
    kinds = 0 if _in_zone(law.low, law.high, x0, x, bend_x) else _ZONES
    if (apart or (moves and not inside)) and not unit.numbers.stops.lower < after.q < unit.numbers.stops.upper:
        kinds |= guards.STOPS
    if inside:
        if apart and not _keeps_way(mode.contact, unit.output, y.w, after.w, 0.0, length):
            kinds |= 1 << guards.SPEED | guards.STOPS
        if moves and not _keeps_way(mode.motor, unit.speed, y.w_m, after.w_m, bend, length):
            kinds |= 1 << guards.MOTOR_SPEED
        if not _within_play(unit, bend, length):
            kinds |= guards.MEETINGS
    elif moves and not _keeps_way(mode.contact, unit.speed, y.w, after.w, bend, length):
        kinds |= 1 << guards.SPEED | guards.STOPS
    if moves and unit.kinds & _BY_TORQUE:
        kinds |= _by_torque(unit, x0, x, bend_x)
    elif not moves and not constant:
        kinds |= _released(unit, u0, u, bend_x)
    return kinds & int(unit.kinds)


def _by_torque(unit: Any, x0: float, x: float, bend: float) -> int:
    """Return which may fall of the guards of a share, and of motor and output that press together.

    The voltage that drives the current is given, at both ends [V].
    """
    law, w, after, kinds = unit.law, unit.y.w_m, unit.after.w_m, 0
    heated = (1.0 + law.R_slope * law.conducts * (unit.after.T_w - unit.y.T_w)) / (
        1.0 + law.K_slope / law.K * (unit.after.T_h - unit.y.T_h))
    before = law.K * law.conducts * (x0 - law.drop)
    torque, off = law.K * law.conducts * (x - law.drop) / heated, 0.25 * law.K * law.conducts * bend
    if unit.mode.share != 0:
        least = abs(law.gear_torque) * off + 0.25 * abs(law.gear_speed) * unit.bend
        if not _above(law.gear + law.gear_torque * before + law.gear_speed * w,
                      law.gear + law.gear_torque * torque + law.gear_speed * after, least):
            kinds = 1 << guards.SHARE
    bends = law.conducts > 0.0 and law.press_forward != law.press_backward
    if bends and (torque * before <= 0.0 or min(abs(torque), abs(before)) <= off):
        return kinds | 1 << guards.PART  # there is a bend in how they press
    per_torque = law.press_forward if torque + before > 0.0 else law.press_backward
    least = 2.0 * abs(per_torque) * off + abs(law.press_speed) * unit.bend
    pressed = _above(law.press + per_torque * before + law.press_speed * w,
                     law.press + per_torque * torque + law.press_speed * after, least)
    return kinds if pressed else kinds | 1 << guards.PART


def _keeps_way(contact: int, speed: Any, w: float, after: float, bend: float, length: float) -> bool:
    """Tell whether a body surely stays on the way on which it slides: its speed is monotone, or far from zero."""
    way = 1.0 if contact == FORWARD else -1.0 if contact == BACKWARD else math.copysign(1.0, after)
    if not (way * after > 0.0 and way * w >= 0.0):
        return False
    if abs(speed[1]) * length > bend:
        return w != 0.0 or way * speed[1] > 0.0
    return min(abs(w), abs(after)) > 0.25 * bend


def _in_zone(low: float, high: float, x0: float, x: float, bend: float) -> bool:
    """Tell whether what drives the current surely stays in its zone [V]."""
    if low == -math.inf and high == math.inf:
        return True
    if not low < x < high:
        return False
    first = low + 0.25 * bend < x0 < high - 0.25 * bend and low + 0.25 * bend < x < high - 0.25 * bend
    return first or (low + guards.BELOW <= x0 <= high - guards.BELOW and abs(x - x0) > 2.0 * bend)


def _within_play(unit: Any, bend: float, length: float) -> bool:
    """Tell whether motor and output surely stay apart."""
    y, after, half = unit.y, unit.after, unit.numbers.play.half
    ahead = y.q_m - y.q
    most = length * max(max(y.w_m, after.w_m) + 0.125 * bend - min(y.w, after.w), 0.0)
    least = length * min(min(y.w_m, after.w_m) - 0.125 * bend - max(y.w, after.w), 0.0)
    return bool(ahead + most < half and ahead + least > -half)


def _released(unit: Any, u0: float, u: float, bend: float) -> int:
    """Return which guards may fall that keep what the motor turns at rest."""
    kinds, margin = int(unit.kinds) & _AT_REST, 2.0 * unit.law.K * unit.law.conducts * bend
    if kinds == 0:
        return 0
    mode, after = unit_mode(unit.mode), unit_state(unit.after)
    numbers = warm(unit_numbers(unit.numbers), after)
    for kind in range(guards.KINDS):
        if kinds >> kind & 1:
            first = guards.guard(numbers, mode, kind, u0, 0.0, unit.torque, 0.0, after, NOWHERE)[0]
            end = guards.guard(numbers, mode, kind, u, 0.0, unit.torque, 0.0, after, NOWHERE)[0]
            if _above(first, end, margin):
                kinds ^= 1 << kind
    return kinds


def _above(first: float, end: float, least: float) -> bool:
    """Tell whether what bends so little stays above zero: at both ends it is, and it is monotone or far from zero."""
    return first >= 0.0 and end > 0.0 and (min(first, end) > least or abs(end - first) > 4.0 * least)
