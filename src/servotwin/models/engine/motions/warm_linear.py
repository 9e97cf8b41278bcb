"""How a servo that warms up moves where its law is a straight line otherwise, with or without inductance.

At the temperatures of its start shaft and current are exponentials, which are known however fast one of them fades.
How far warming leads off them is small. It is followed at the five points of Radau's rule: the fast part by the rule,
which is stable however fast it is, the slow one by its exponential. A polynomial through the points says what is
between.

Coefficients: E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", 2nd edition, Springer 1996, section
IV.5 (Radau IIA).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.dynamics import coefficients, currents
from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.engine.motions import first_order
from servotwin.models.engine.motions.elementary import decay
from servotwin.models.state.modes import INSIDE, RIGID, Mode, Vector, at_rest, constant_current
from servotwin.models.terms import play
from servotwin.models.terms.heat import Heat, warming_rates
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.elementary import power
from servotwin.physics.motor import steady_armature_current
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, magnet_factor, winding_resistance

# --- The law of motor and current at the temperatures of a step's start, and what warming does to it first ------------

_APART = 4.0  # times: the fast rate is more than the slow one


class Rough(NamedTuple):
    """The effect of a fading current's heat on itself [A/s]: that much of the powers of e = e^(−fast t)."""

    by_t: float  # of t e [A/s²]
    by_0: float  # of 1
    by_1: float  # of e
    by_2: float
    by_3: float


_SMOOTH = Rough(0.0, 0.0, 0.0, 0.0, 0.0)


class Law(NamedTuple):
    """The law of motor and current at the temperatures of the start; rates are 0 of what does not move."""

    slow: float  # [1/s]
    fast: float
    apart: float  # 1/(fast − slow) [s]
    dw: float  # rates at the start, and what ẍ + damping ẋ of either is
    rw: float
    di: float
    ri: float
    c_s: float  # by which what drives the slow part grows with the warming of the start, and the fast one [1/s]
    c_f: float
    c_ff: float  # by the square of time, of the fast one
    of_i: float  # the slow part is w + of_i i
    of_w: float  # the fast one i + of_w w
    per_ampere: float  # [rad/s²/A]
    v: float  # of the loop [V]
    R: float  # of the loop [Ω]; inf: the current stays
    i: float  # the current that stays [A]
    L: float  # [H]; 0: the current has no inertia, or stays
    K_b: float
    copper: float  # of the winding [Ω]
    per_kelvin: float  # [Ω/K]
    field: float  # [1/K]
    F: float  # part of the current at the start that will fade fast [A]
    P: float  # rate of the rest [A/s]
    rough: Rough


def law_of(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> Law:
    """Return the law of a mode from a state on, under a voltage behind the bridge [V] and an external torque [N m]."""
    now, zone = warm(numbers, y), mode.zone
    dy = rates_of(numbers, mode, u, tau, y)
    stays = constant_current(zone)
    v, R = (0.0, math.inf) if stays else currents.loop(now, zone, u)
    lags, turns = inductive(now.motor) and not stays, not at_rest(mode.motor if mode.mesh == INSIDE else mode.contact)
    L, K_b = now.motor.L, now.motor.K_b
    gain = coefficients.per_ampere(now, mode) if turns else 0.0
    drag = coefficients.drag(now, mode) if turns else 0.0
    own, magnet = numbers.motor.R, numbers.heat.magnet
    grows = winding_resistance(REFERENCE_TEMPERATURE + 1.0, own) - own
    field = magnet_factor(y.T_h, magnet)
    rises = (magnet_factor(y.T_h + 1.0, magnet) - field) / field
    slow, fast, apart, rw, ri, of_i, of_w = drag, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    dw, di = dy.w_m if turns else 0.0, dy.i
    if lags and not turns:
        fast = R / L
    elif lags:
        fade, brake = R / L, K_b / L
        half = 0.5 * (fade - drag)
        square = half * half - brake * gain
        root = math.sqrt(square) if square > 0.0 else 0.0
        of_i = gain / (half + root)
        of_w = brake / (half + root)
        slow, fast = drag + brake * of_i, fade - gain * of_w
        apart = 1.0 / (fast - slow) if fast > _APART * slow else 0.0
        rw = gain * di - drag * dw + (fade + drag) * dw
        ri = -fade * di - brake * dw + (fade + drag) * di
    elif not stays:
        slow = drag + gain * K_b / R
    F = c_w = c_i = c_ff = 0.0
    P = -K_b * dw / R
    rough = _SMOOTH
    if lags:
        F = (ri / fast - di) * apart if apart != 0.0 else -di / fast
        P, steady = (ri - di * slow) * apart, y.i - F
        warms, _ = warming_rates(numbers.heat, now.motor.R, steady, y.T_w, y.T_h)
        c_w = gain * rises * dy.T_h * steady
        c_i = -(grows * warms * steady + K_b * rises * dy.T_h * y.w_m) / L
        heats, fades = now.motor.R / numbers.heat.C_w, (numbers.heat.G_wh - grows * steady * steady) / numbers.heat.C_w
        c_ff = -grows / L * ((heats * steady * P - 0.5 * fades * warms) * steady + warms * P)
        rough = _rough(-grows / L * F, heats / fast, warms, steady, F)
    return Law(slow, fast, apart, dw, rw, di, ri, c_w + of_i * c_i, c_i + of_w * c_w, c_ff, of_i, of_w, gain, v, R,
               currents.flowing(now, zone, u, y.q, y.w_m, y.i), L if lags else 0.0, K_b, now.motor.R, grows, rises,
               F, P, rough)


def _rough(c: float, heats: float, warms: float, i: float, F: float) -> Rough:
    """Return what a fading current F [A] beside a steady one i does; a kelvin drives c F e, and i² warms by heats."""
    by, more = c * heats * i, c * heats * F
    return Rough(c * warms, by * (2.0 * i + 0.5 * F), 2.0 * by * (F - i) + 0.5 * more * F, -2.5 * by * F,
                 -0.5 * more * F)


def suits(law: Law) -> bool:
    """Tell whether a law can be followed: the rates of a shaft and a current that both move have to be apart."""
    return law.per_ampere == 0.0 or law.apart > 0.0


# --- How a servo that warms up moves where its law is a straight line otherwise, with or without inductance -----------

POINTS = 5
_TWO, _ALL = 2 * POINTS, 5 * POINTS
NODES = (0.05710419611451768, 0.2768430136381238, 0.5835904323689168, 0.8602401356562195, 1.0)
_PLACES = (199.88739542347736, -127.022853068795, 92.10283313613321, -64.16737549081559, 25.2)
_UP_TO = (
    0.07299886431790333, -0.02673533110794557, 0.018676929763984353, -0.01287910609330644, 0.005042839233882015,
    0.15377523147918246, 0.14621486784749352, -0.03644456890512809, 0.02123306311930472, -0.007935579902728777,
    0.14006304568480987, 0.29896712949128346, 0.16758507013524895, -0.03396910168661774, 0.010944288744192253,
    0.14489430810953477, 0.2765000687601592, 0.32579792291042103, 0.12875675325490976, -0.015708917378805327,
    0.14371356079122594, 0.28135601514946207, 0.31182652297574126, 0.22310390108357075, 0.04,
)
_LONGEST = 0.8  # of a step, times 1/slow
_RULE, _NINTH = 2e-11, 1.0 / 9.0  # error of the rule for e^x over 1, by x^9
_SEVENTH = 1.0 / 7.0
# Times the tolerance, by the 4th and 7th power of fast · time: what the rule may miss of a current within a step, and
# of what it leads to at the end
_SEEN, _STAYS = 30.0 / 3e-5, 3.0 / 2e-8
_USUAL = 1e-4  # by which warming changes a law within a step
_PART = 0.1  # of the time in which temperatures change: of a step
_PER_KELVIN = 0.1  # of an error of the temperature, to tell it as one of an angle
_MARGIN = 3.0
_NONE = 1e-200
IN_FLOATS = {"_NONE": 1e-30}
_STRAIGHT = 1e-4  # times 1/slow: a time in which the slow part is a straight line
_MOST, _LEAST, _LESS, _SIXTH = 60, 0.1, 0.85, 1.0 / 6.0  # tries of a step, and how much shorter the next one is
_BETWEEN = 6e-5  # of the change of a polynomial's highest power within a step: of its error between the points


class Faded(NamedTuple):
    """How far both parts have faded after a time: ∫ e^(−rate t) dt and its integral, slow, twice as fast, and fast."""

    once: float
    twice: float
    double_twice: float
    soon: float  # 0 of what does not move
    soon_twice: float


class Step(NamedTuple):
    """The error of a step relative to 1 + |state|, and what says how it goes."""

    error: float
    dense: tuple[Vector, Vector, Vector, Vector, Vector, Vector, Vector]


def length(law: Law, heat: Heat, y: Vector, limit: float, tolerance: float) -> float:
    """Return how long a step may be [s], so that the rule follows what is slow and what is left of the fast part."""
    rate = abs(_rate(law, heat, y))
    most: float = min(limit, _PART / rate) if rate > 0.0 else limit
    if law.slow > 0.0:
        most = min(most, min(_LONGEST, 0.5 * power(tolerance / (_RULE * _USUAL), _NINTH)) / law.slow)
    if law.fast == 0.0:
        return most
    F = abs(law.F)
    warms = law.copper * F * (F + 2.0 * abs(y.i - law.F)) / (heat.C_w * law.fast)
    part = abs(law.per_kelvin / law.copper) * warms
    squared = law.fast * law.fast
    left = part * (abs(law.P) / law.fast + part * F) + 6.0 * abs(law.c_ff) * (law.slow + rate) / (
        squared * squared)  # [A]
    ends = left * law.per_ampere / law.fast + part * warms
    if left > _NONE:
        most = min(most, math.sqrt(math.sqrt(_SEEN * tolerance / left)) / law.fast)
    if ends > _NONE:
        most = min(most, power(_STAYS * tolerance / ends, _SEVENTH) / law.fast)
    return most


def _rate(law: Law, heat: Heat, y: Vector) -> float:
    """Return about how fast temperatures tend to where they do [1/s]."""
    i = law.i if law.R == math.inf else y.i if law.L > 0.0 else law.v / law.R
    return (heat.G_wh + law.per_kelvin * i * i) / heat.C_w + (heat.G_wh + heat.G_ha) / heat.C_h


def fading(law: Law) -> float:
    """Return the part of the current at the start that will fade fast, with what lags behind steady warming [A]."""
    if law.fast == 0.0:
        return 0.0
    return law.F + law.c_f / (law.fast * law.fast * (1.0 - law.of_i * law.of_w))


def faded(slow: float, fast: float, s: float) -> Faded:
    """Return how far both parts have faded after s [s]."""
    per = 1.0 / slow if slow > 0.0 else 0.0
    once, twice = decay(slow, per, s)
    _, double_twice = decay(2.0 * slow, 0.5 * per, s)
    soon = soon_twice = 0.0
    if fast > 0.0:
        soon, soon_twice = decay(fast, 1.0 / fast, s)
    return Faded(once, twice, double_twice, soon, soon_twice)


def own_heat(slow: float, fast: float, F: float, P: float, i: float, x: Faded, s: float) -> tuple[float, float]:
    """Return by how much the square of the current changes in s [s] as it goes by itself, and its integral [A², A² s].

    Of the current i a part F fades fast, the rest begins with the rate P [A/s].
    """
    start = i - F
    now, so_far = P * x.once * (2.0 * start + P * x.once), 2.0 * start * P * x.twice
    if slow * s < _STRAIGHT:
        so_far += P * P * s * s * s * (1.0 / 3.0 - 0.25 * slow * s)
    else:
        so_far += 2.0 * P * P * (x.twice - x.double_twice) / slow
    if fast == 0.0:
        return now, so_far
    E_s, E_f = 1.0 - slow * x.once, 1.0 - fast * x.soon
    together = (slow * x.once + E_s * (fast * x.soon)) / (slow + fast)
    return (now + F * E_f * (2.0 * (start + P * x.once) + F * E_f),
            so_far + 2.0 * F * (start * x.soon + P * (together - E_f * x.once) / fast) + 0.5 * F * F * x.soon * (
                1.0 + E_f))


def straight(slow: float, fast: float, apart: float, dw: float, rw: float, di: float, ri: float, w: float, i: float,
             x: Faded, s: float) -> tuple[float, float, float]:
    """Return way, speed and current after s [s] at the temperatures of the start, by the numbers of a `Law`."""
    if fast == 0.0:
        return w * s + dw * x.twice, w + dw * x.once, i
    if apart == 0.0:
        return 0.0, 0.0, i + di * x.soon
    g, both, both_twice = ((fast * x.soon - slow * x.once) * apart, (x.once - x.soon) * apart,
                           (x.twice - x.soon_twice) * apart)
    return w * s + dw * both + rw * both_twice, w + dw * g + rw * both, i + di * g + ri * both


def ramp(slow: float, fast: float, c_s: float, c_f: float, c_ff: float, of_i: float, of_w: float, rough: Rough,
         x: Faded, s: float) -> tuple[float, float]:
    """Return what steady warming and a current that fades add to speed and current in s [s], by a `Law`'s numbers."""
    if fast == 0.0:
        return 0.0, 0.0
    e, per = 1.0 - fast * x.soon, 1.0 / (1.0 - of_i * of_w)
    f = c_f * x.soon_twice + c_ff * (s * s - 2.0 * x.soon_twice) / fast + s * e * (
        rough.by_1 + 0.5 * s * rough.by_t) + x.soon * (
        rough.by_0 + e * (rough.by_2 + 0.5 * (1.0 + e) * rough.by_3))
    z = c_s * x.twice
    if of_i != 0.0:
        E_s, gap = 1.0 - slow * x.once, fast - slow
        z += of_i * (
            rough.by_0 * x.once + rough.by_1 * (E_s - e) / gap + rough.by_2 * (E_s - e * e) / (gap + fast)
            + rough.by_3 * (E_s - e * e * e) / (gap + 2.0 * fast)
            + rough.by_t * (E_s - e * (1.0 + gap * s)) / (gap * gap))
    return (z - of_i * f) * per, (f - of_w * z) * per


def follow(law: Law, own: Heat, y: Vector, limit: float, tolerance: float) -> tuple[float, Step]:
    """Return a step that is accurate enough, at most `limit` [s] long, and how long it is; 0 where none is."""
    h = length(law, own, y, limit, tolerance)
    found = step(law, own, y, h)
    for _ in range(_MOST):
        size = found.error / (tolerance * (1.0 + abs(y.w_m)))
        if size <= 1.0:
            return h, found
        h *= max(_LEAST, _LESS * power(size, -_SIXTH)) if size < math.inf else _LEAST
        found = step(law, own, y, h)
    return 0.0, found


def step(law: Law, own: Heat, y: Vector, h: float) -> Step:
    """Follow motor, current and temperatures for a time h [s]."""
    at = [0.0] * _ALL  # speed and current so far known, the part of the speed that warming has made, `Rough`
    more = [0.0] * _ALL  # of speed, current, winding, housing, way
    soon = [0.0] * _TWO  # rate of the winding by what the current does by itself, and its integral
    fall = [0.0] * POINTS
    solver = [0.0] * _ALL
    F, rough = fading(law), law.rough
    for k in range(POINTS):
        t = NODES[k] * h
        x = faded(law.slow, law.fast, t)
        _, w, i = straight(law.slow, law.fast, law.apart, law.dw, law.rw, law.di, law.ri, y.w_m, y.i, x, t)
        more_w, more_i = ramp(law.slow, law.fast, law.c_s, law.c_f, law.c_ff, law.of_i, law.of_w, rough, x, t)
        at[k], at[POINTS + k], at[_TWO + k] = w + more_w, i + more_i, more_w
        e = 1.0 - law.fast * x.soon
        at[_TWO + POINTS + k] = rough.by_0 + e * (rough.by_1 + rough.by_t * t + e * (rough.by_2 + e * rough.by_3))
        fall[k] = 1.0 - law.slow * x.once
        now, so_far = own_heat(law.slow, law.fast, F, law.P, law.i, x, t)
        soon[k], soon[POINTS + k] = law.copper / own.C_w * now, law.copper / own.C_w * so_far
    if law.fast > 0.0:
        _factor(solver, law.fast * h)
    _heat(law, own, y, h, at, soon, more)
    _deviate(law, h, at, fall, solver, more)
    w, i = more[POINTS - 1], more[2 * POINTS - 1]
    _heat(law, own, y, h, at, soon, more)
    T = more[3 * POINTS - 1]
    _deviate(law, h, at, fall, solver, more)
    _heat(law, own, y, h, at, soon, more)
    warmer, housing = more[3 * POINTS - 1], more[4 * POINTS - 1]
    part = abs(law.per_kelvin * warmer / law.copper) + abs(law.field * housing)
    changed = max(abs(more[POINTS - 1] - w), abs(more[2 * POINTS - 1] - i))
    heats = _PER_KELVIN * abs(warmer - T) * (part + h * _rate(law, own, y))
    for k in range(POINTS):
        more[2 * POINTS + k] -= soon[POINTS + k]
    dense = _dense(law, law.copper / own.C_w, F, more)
    return Step(max(_MARGIN * max(part * changed, heats), _BETWEEN * _bend(dense)), dense)


def _bend(dense: tuple[Vector, ...]) -> float:
    """Return the largest coefficient of the highest power of time over the length of the step."""
    d0, d1, d2, d3, d4 = dense[0], dense[1], dense[2], dense[3], dense[4]
    return max(abs(d0.q + d1.q + d2.q + d3.q + d4.q), abs(d0.w + d1.w + d2.w + d3.w + d4.w),
               abs(d0.i + d1.i + d2.i + d3.i + d4.i), _PER_KELVIN * abs(d0.T_w + d1.T_w + d2.T_w + d3.T_w + d4.T_w))


def _heat(law: Law, own: Heat, y: Vector, h: float, at: Any, soon: Any, more: Any) -> None:
    """Set by how much winding and housing are warmer at the points, by what is known of speed and current."""
    rates = [0.0] * _TWO
    for k in range(POINTS):
        w, i = at[k] + more[k], at[POINTS + k] + more[POINTS + k]
        d, g = more[2 * POINTS + k], more[3 * POINTS + k]
        copper = law.per_kelvin * d
        if law.L == 0.0:
            i = law.i
            if law.R < math.inf:
                i = steady_armature_current(law.v, w, law.R + copper, law.K_b * (1.0 + law.field * g))
        dT_w, dT_h = warming_rates(own, law.copper + copper, i, y.T_w + d, y.T_h + g)
        rates[k], rates[POINTS + k] = dT_w - soon[k], dT_h
    for k in range(POINTS):
        d = g = 0.0
        for n in range(POINTS):
            d += _UP_TO[POINTS * k + n] * rates[n]
            g += _UP_TO[POINTS * k + n] * rates[POINTS + n]
        more[2 * POINTS + k], more[3 * POINTS + k] = soon[POINTS + k] + h * d, h * g


def _deviate(law: Law, h: float, at: Any, fall: Any, solver: Any, more: Any) -> None:
    """Set by how much speed and current deviate at the points, by what is known of the temperatures."""
    slow = [0.0] * POINTS
    fast = [0.0] * POINTS
    for k in range(POINTS):
        w, i = at[k] + more[k], at[POINTS + k] + more[POINTS + k]
        copper, field = law.per_kelvin * more[2 * POINTS + k], law.field * more[3 * POINTS + k]
        n_i = 0.0
        if law.L > 0.0:
            n_i = -(copper * i + law.K_b * field * w) / law.L - at[_TWO + POINTS + k]
            n_w = law.per_ampere * field * i
        elif law.R < math.inf:
            now = steady_armature_current(law.v, w, law.R + copper, law.K_b * (1.0 + field))
            n_w = law.per_ampere * ((1.0 + field) * now - steady_armature_current(law.v, w, law.R, law.K_b))
        else:
            n_w = law.per_ampere * field * law.i
        t = NODES[k] * h
        slow[k] = (n_w + law.of_i * n_i - law.c_s * t) / fall[k]
        fast[k] = n_i + law.of_w * n_w - (law.c_f + law.c_ff * t) * t
    turns, per = law.per_ampere > 0.0, 1.0 / (1.0 - law.of_i * law.of_w)
    for k in range(POINTS):
        z = f = 0.0
        for n in range(POINTS):
            z += _UP_TO[POINTS * k + n] * slow[n]
            f += _UP_TO[POINTS * k + n] * fast[n]
        more[k], more[POINTS + k] = h * fall[k] * z, h * f
    if law.fast > 0.0:
        _solve(solver, more)
    for k in range(POINTS):
        z, f = more[k] if turns else 0.0, more[POINTS + k] if law.fast > 0.0 else 0.0
        more[k], more[POINTS + k] = (z - law.of_i * f) * per, (f - law.of_w * z) * per
    for k in range(POINTS):
        way = 0.0
        for n in range(POINTS):
            way += _UP_TO[POINTS * k + n] * (more[n] + at[_TWO + n])
        more[4 * POINTS + k] = h * way


def _factor(solver: Any, x: float) -> None:
    """Set the triangular factors of 1 + x A."""
    for k in range(POINTS):
        for n in range(POINTS):
            solver[POINTS * k + n] = x * _UP_TO[POINTS * k + n] + (1.0 if k == n else 0.0)
    for m in range(POINTS):
        for k in range(m + 1, POINTS):
            part = solver[POINTS * k + m] / solver[POINTS * m + m]
            solver[POINTS * k + m] = part
            for n in range(m + 1, POINTS):
                solver[POINTS * k + n] -= part * solver[POINTS * m + n]


def _solve(solver: Any, more: Any) -> None:
    """Solve (1 + x A) z = f, for what stands where the current's deviations do."""
    for k in range(POINTS):
        for n in range(k):
            more[POINTS + k] -= solver[POINTS * k + n] * more[POINTS + n]
    for k in range(POINTS - 1, -1, -1):
        for n in range(k + 1, POINTS):
            more[POINTS + k] -= solver[POINTS * k + n] * more[POINTS + n]
        more[POINTS + k] /= solver[POINTS * k + k]


def _dense(law: Law, per_square: float, F: float,
           more: Any) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector, Vector]:
    """Return the deviations, each times its part of the polynomial through them and the start, and the law."""
    rough = law.rough
    return (_row(0, more, law.c_ff, rough.by_t), _row(1, more, rough.by_0, rough.by_1),
            _row(2, more, rough.by_2, rough.by_3), _row(3, more, law.i, 0.0), _row(4, more, 0.0, 0.0),
            Vector(law.slow, law.fast, law.apart, law.dw, law.rw, law.di, law.ri),
            Vector(per_square, law.c_s, law.c_f, law.of_i, law.of_w, F, law.P))


def _row(k: int, more: Any, one: float, other: float) -> Vector:
    part = _PLACES[k]
    return Vector(part * more[4 * POINTS + k], part * more[k], part * more[POINTS + k], part * more[2 * POINTS + k],
                  part * more[3 * POINTS + k], one, other)


def state(numbers: Numbers, mode: Mode, y: Vector, output: tuple[float, float], dense: tuple[Vector, ...], h: float,
          s: float) -> Vector:
    """Return the state after s [s] of a step of a length h [s]; `output` is the law of one that moves apart."""
    d0, d1, d2, d3, d4 = dense[0], dense[1], dense[2], dense[3], dense[4]
    of, by, rough = dense[5], dense[6], Rough(d0.w_m, d1.q_m, d1.w_m, d2.q_m, d2.w_m)
    fades = faded(of.q, of.w, s)
    way, w, i = straight(of.q, of.w, of.i, of.T_w, of.T_h, of.q_m, of.w_m, y.w_m, y.i, fades, s)
    more_w, more_i = ramp(of.q, of.w, by.w, by.i, d0.q_m, by.T_w, by.T_h, rough, fades, s)
    w, i = w + more_w, i + more_i
    x = s / h
    b0, b1, b2, b3, b4 = x - NODES[0], x - NODES[1], x - NODES[2], x - NODES[3], x - NODES[4]
    low, high = x * b0 * b1, b3 * b4
    p0, p1, p2 = x * b1 * b2 * high, x * b0 * b2 * high, low * high
    p3, p4 = low * b2 * b4, low * b2 * b3
    way += p0 * d0.q + p1 * d1.q + p2 * d2.q + p3 * d3.q + p4 * d4.q
    w += p0 * d0.w + p1 * d1.w + p2 * d2.w + p3 * d3.w + p4 * d4.w
    i += p0 * d0.i + p1 * d1.i + p2 * d2.i + p3 * d3.i + p4 * d4.i
    _, heat = own_heat(of.q, of.w, by.q_m, by.w_m, d3.q_m, fades, s)
    T_w = y.T_w + by.q * heat + (p0 * d0.T_w + p1 * d1.T_w + p2 * d2.T_w + p3 * d3.T_w + p4 * d4.T_w)
    T_h = y.T_h + (p0 * d0.T_h + p1 * d1.T_h + p2 * d2.T_h + p3 * d3.T_h + p4 * d4.T_h)
    if mode.mesh == INSIDE:
        q, w_out = first_order.propagate(output[0], output[1], y.q, y.w, s)
        return Vector(q, w_out, i, T_w, T_h, y.q_m + way, w)
    if mode.mesh == RIGID:
        return Vector(y.q + way, w, i, T_w, T_h, y.q + way, w)
    return play.with_motor(numbers.play, mode.mesh, Vector(y.q + way, w, i, T_w, T_h, y.q_m, w))
