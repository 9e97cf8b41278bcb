"""Legs of a servo that warms up: power series in time, exact to rounding, and what ends a leg found along them.

With d and g how much warmer winding and housing are than where a leg begins, ρ what a kelvin adds to the resistance and
φ to the magnets, λ the rate of what the motor turns there and k its acceleration by an ampere,

    R i = v − K_b (1 + φ g) w − ρ d i,   ẇ = f − λ w + k ((1 + φ g) i − i₀(w)),   C_w ḋ = (R_w + ρ d) i² − flow,

where i₀ is the current at the temperatures of the beginning. Products of series are all that warming adds. A leg lasts
as long as the fastest of its rates at most, within which a speed goes one way, and two dozen terms are all that numbers
can hold. The output inside the play moves in closed form, whatever the temperatures are.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.dynamics import coefficients, currents, guards
from servotwin.models.engine.dynamics.coefficients import Apart
from servotwin.models.engine.events import crossings
from servotwin.models.engine.legs import legs
from servotwin.models.engine.legs.legs import MOST_LEGS, MOST_SHORT, SHORT, Gone
from servotwin.models.engine.motions import first_order, warm_exponential
from servotwin.models.engine.motions.first_order import Course, alike
from servotwin.models.engine.motions.warm_exponential import Law
from servotwin.models.state.modes import CONDUCTING, INSIDE, Mode, Vector, at_rest
from servotwin.models.terms import friction, heat, play
from servotwin.models.terms.heat import Heat
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.sensor import wiper_at
from servotwin.physics.motor import steady_armature_current
from servotwin.physics.thermal import heat_flow, warming_rate

TERMS = 24  # of a series at most
IN_FLOATS = {"TERMS": 12, "_ROUNDING": 1e-9, "_INSTANT": 1e-7}
_ROUNDING = 1e-16  # rad/s of a speed: what a term may be
_PER_KELVIN = 1e-2  # what a kelvin counts beside a radian per second
_FEW = 3  # terms at least: one may be nothing by chance
_INVERSES = (0.0, *(1.0 / n for n in range(1, TERMS + 1)))
_LONGEST = 1.0  # of a leg, in times of its fastest rate
_NEAR = 1e-3  # of a leg: nearer to its beginning it is not cut
_TRIES, _RISES, _INSTANT = 100, 50, 1e-15  # of a search; an instant in parts of a leg
_GUARD, _SLOPE, _TORQUE = range(3)  # of what a root is searched


class Leg(NamedTuple):
    """A leg: its servo, cold, what acts on it, its mode and laws, where it begins, how long it is, terms of series."""

    numbers: Numbers
    torque: float
    u: float
    mode: Mode
    laws: Apart
    y: Vector
    time: float
    terms: int


class Ending(NamedTuple):
    """When a leg ends, in parts of it, by which guard (−1: with its time), and the state there."""

    part: float
    kind: int
    y: Vector


def go(numbers: Numbers, torque: float, u: float, y: Vector, mesh: int, wiper: float, time: float) -> Gone:
    """Return where a servo goes within a time [s], under a voltage behind the bridge and an external torque [N m].

    Its numbers are those of a cold one; `mesh` is how motor and output touched so far.
    """
    speed = [0.0] * TERMS  # coefficients by parts of a leg, as all that follow
    winding = [0.0] * TERMS
    housing = [0.0] * TERMS
    current = [0.0] * TERMS
    fall = [0.0] * TERMS  # of the voltage along the winding
    mode, short = legs.mode_from(warm(numbers, y), torque, u, y, mesh), 0
    for _ in range(MOST_LEGS):
        now, turns = warm(numbers, y), not at_rest(mode.motor if mode.mesh == INSIDE else mode.contact)
        laws = Apart(0.0, 0.0, 0.0, 0.0)
        if turns or not legs.stands(mode):
            laws = legs.laws_of(now, mode, u, torque)
        w, gain = (y.w_m, coefficients.per_ampere(now, mode)) if turns else (0.0, 0.0)
        law = warm_exponential.law_of(numbers, now, mode.zone, u, y.T_w, y.T_h, laws.motor_rate,
                                      laws.motor_pull - laws.motor_rate * w, w, gain)
        length = min(time, longest(law, laws, numbers.heat, mode, y))
        terms = put_series(law, numbers.heat, length, speed, winding, housing, current, fall)
        leg = Leg(numbers, torque, u, mode, laws, y, length, terms)
        end = _ending(leg, speed, winding, housing)
        y = end.y
        wiper = wiper_at(numbers.sensor, wiper, y.q)
        gone = end.part * length
        if end.kind >= 0:
            mode, y = crossings.cross(numbers, mode, end.kind, u, torque, y)
            short = short + 1 if gone <= SHORT * time else 0
            if short >= MOST_SHORT and play.present(numbers.play):
                _, mode, y = legs.together(warm(numbers, y), mode, u, torque, y)
        if not math.isfinite(y.q + y.q_m + y.T_w + y.T_h):
            return Gone(y, mode, wiper, 0.0)
        time -= gone
        if not time > 0.0:
            return Gone(y, mode, wiper, 1.0)
    return Gone(y, mode, wiper, 0.0)


def longest(law: Law, laws: Apart, own: Heat, mode: Mode, y: Vector) -> float:
    """Return how long a leg may be [s]: neither a speed nor a temperature goes far, nor two speeds twice alike."""
    rate, i = max(law.rate, laws.output_rate), law.v / law.R + law.i
    if heat.present(own):
        rate = max(rate, (own.G_wh + law.per_kelvin * i * i) / own.C_w, (own.G_wh + own.G_ha) / own.C_h)
    most = _LONGEST / rate if rate > 0.0 else math.inf
    if mode.mesh == INSIDE:
        same = alike(Course(laws.output_rate, laws.output_pull, y.q, y.w),
                     Course(laws.motor_rate, laws.motor_pull, y.q_m, y.w_m))
        most = same if _NEAR * most < same < most else most
    return most


def put_series(x: Law, own: Heat, time: float, speed: Any, winding: Any, housing: Any, current: Any, fall: Any) -> int:
    """Write the series of a leg of a time [s]; return the number of the last coefficient."""
    per_winding = warming_rate(time, 0.0, own.C_w) if heat.present(own) else 0.0
    per_housing = warming_rate(time, 0.0, own.C_h) if heat.present(own) else 0.0
    speed[0], winding[0], housing[0] = x.w, 0.0, 0.0
    n = 0
    while n < TERMS - 1:
        copper = field = more = loss = 0.0
        for m in range(1, n + 1):
            copper += winding[m] * current[n - m]
            field += housing[m] * speed[n - m]
            more += housing[m] * current[n - m]
        copper *= x.per_kelvin
        less = steady_armature_current(-copper, x.field * field, x.R, x.K_b)  # by warming alone
        now = 1.0 if n == 0 else 0.0
        current[n] = less + steady_armature_current(now * x.v, speed[n], x.R, x.K_b) + now * x.i
        fall[n] = x.copper * current[n] + copper
        for m in range(n + 1):
            loss += current[m] * fall[n - m]
        flow = heat_flow(winding[n] + now * x.T_w, housing[n] + now * x.T_h, own.G_wh)
        lost = heat_flow(housing[n] + now * x.T_h, now * own.T_amb, own.G_ha)
        dw = (x.pull if n == 0 else -x.rate * speed[n]) + x.per_ampere * (less + x.field * more)
        n += 1
        speed[n] = dw * time * _INVERSES[n]
        winding[n], housing[n] = (loss - flow) * per_winding * _INVERSES[n], (flow - lost) * per_housing * _INVERSES[n]
        size = max(abs(speed[n]), _PER_KELVIN * max(abs(winding[n]), abs(housing[n])))
        if n >= _FEW and size < _ROUNDING:
            break
    return n


def state_at(leg: Leg, speed: Any, winding: Any, housing: Any, x: float) -> Vector:
    """Return the state after a part x of a leg."""
    y, w, way, T_w, T_h = leg.y, 0.0, 0.0, 0.0, 0.0
    for n in range(leg.terms, -1, -1):
        w, way = w * x + speed[n], way * x + speed[n] * _INVERSES[n + 1]
        T_w, T_h = T_w * x + winding[n], T_h * x + housing[n]
    way *= x * leg.time
    if leg.mode.mesh == INSIDE:
        q, v = first_order.propagate(leg.laws.output_rate, leg.laws.output_pull, y.q, y.w, x * leg.time)
        return Vector(q, v, y.i, y.T_w + T_w, y.T_h + T_h, y.q_m + way, w)
    return with_motor(leg.numbers.play, leg.mode.mesh,
                      Vector(y.q + way, w, y.i, y.T_w + T_w, y.T_h + T_h, y.q_m, y.w_m))


def _ending(leg: Leg, speed: Any, winding: Any, housing: Any) -> Ending:
    """Return how a leg ends: what falls below zero at its end has done so on the way, some also where it turns."""
    kinds = guards.guards(leg.numbers, leg.mode, leg.u, False)
    end, found, y = 1.0, -1, state_at(leg, speed, winding, housing, 1.0)
    for kind in range(guards.KINDS):
        if not kinds >> kind & 1:
            continue
        b, f_b = end, _value(leg, _GUARD, kind, y)
        if f_b >= guards.BELOW:
            what, a, c = _turning(leg, kind, y, end)
            if what == _GUARD:
                continue
            b = _root(leg, speed, winding, housing, what, kind, 0.0, a, end, c)
            f_b = _value(leg, _GUARD, kind, state_at(leg, speed, winding, housing, b))
            if f_b >= guards.BELOW:
                continue
        s = _root(leg, speed, winding, housing, _GUARD, kind, 0.0, _value(leg, _GUARD, kind, leg.y), b, f_b)
        if s < end or found < 0:
            end, found, y = s, kind, state_at(leg, speed, winding, housing, s)
    return Ending(end, found, y)


def _turning(leg: Leg, kind: int, y: Vector, end: float) -> tuple[int, float, float]:
    """Return which root a guard that stays above zero at an end has to be looked at, with both values of that.

    It is `_GUARD` where there is none: as speeds go one way, a distance turns once at most, and is no less than where
    its tangents meet; how motor and output press has a bend where the torque of the motor turns.
    """
    if (guards.STOPS | guards.MEETINGS) >> kind & 1:
        a, c = _value(leg, _SLOPE, kind, leg.y), _value(leg, _SLOPE, kind, y)
        if a < 0.0 < c:
            f, g, time = _value(leg, _GUARD, kind, leg.y), _value(leg, _GUARD, kind, y), end * leg.time
            if f + a * (g - f - c * time) / (a - c) < guards.BELOW:
                return _SLOPE, a, c
    elif kind == guards.PART and leg.mode.zone == CONDUCTING and friction.shared(leg.numbers.friction):
        a, c = _value(leg, _TORQUE, kind, leg.y), _value(leg, _TORQUE, kind, y)
        if a * c < 0.0:
            return _TORQUE, a, c
    return _GUARD, 0.0, 0.0


def _value(leg: Leg, what: int, kind: int, y: Vector) -> float:
    """Return a guard in a state, by which its distance changes [rad/s], or the torque of the motor."""
    if what == _SLOPE:
        if guards.STOPS >> kind & 1:
            return -y.w if kind == guards.UPPER else y.w
        return y.w - y.w_m if kind == guards.MEET_FORWARD else y.w_m - y.w
    if what == _TORQUE:
        return currents.drive_torque(warm(leg.numbers, y), leg.mode.zone, leg.u, y)
    return guards.guard(leg.numbers, leg.mode, kind, leg.u, 0.0, leg.torque, 0.0, y, y)[0]


def _root(leg: Leg, speed: Any, winding: Any, housing: Any, what: int, kind: int, a: float, f_a: float, b: float,
          f_b: float) -> float:
    """Return where something is zero between two parts of a leg, on the side of the second where that is not sharp.

    A guard is below zero at the second. By inverse parabolas where they are sure to lead on, else by halves
    (Chandrupatla 1997).
    """
    if what == _GUARD and f_a <= 0.0:
        if f_a < guards.BELOW:  # what another one did has ended this mode too
            return a
        start = a
        for _ in range(_RISES):  # it starts at zero, to rounding: look whether it rises before it falls
            a = start + 0.5 * (b - start)
            f_a = _value(leg, what, kind, state_at(leg, speed, winding, housing, a))
            if f_a > 0.0:
                break
            b, f_b = a, f_a
        if f_a <= 0.0:
            return start
    new, f_new, old, f_old = b, f_b, a, f_a
    part = f_b / (f_b - f_a)
    for _ in range(_TRIES):
        s = new + part * (old - new)
        f = _value(leg, what, kind, state_at(leg, speed, winding, housing, s))
        if f == 0.0:
            return s
        if (f > 0.0) == (f_new > 0.0):
            third, f_third = new, f_new
        else:
            third, f_third, old, f_old = old, f_old, new, f_new
        new, f_new = s, f
        least = _INSTANT / abs(old - new)
        if least > 0.5:
            break
        xi, phi, part = (new - old) / (third - old), (f_new - f_old) / (f_third - f_old), 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            part = (f_new / (f_old - f_new) * f_third / (f_old - f_third)
                    + (third - new) / (old - new) * f_new / (f_third - f_new) * f_old / (f_third - f_old))
        part = min(max(part, least), 1.0 - least)
    return new if (f_new > 0.0) == (f_b > 0.0) else old
