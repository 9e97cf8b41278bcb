"""One step of the explicit Runge-Kutta method of order 8 by Dormand and Prince, for the whole state of a servo.

With an embedded error estimate of orders 5 and 3 and a dense output of order 7. It takes long steps where motions are
smooth, and asks for nothing but the rates.

Coefficients: E. Hairer, S. P. Nørsett, G. Wanner, "Solving Ordinary Differential Equations I", 2nd edition, Springer
1993, section II.10 (DOP853).
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece, piece_value

STAGES = 12
NUMBERS = 7 * 16  # of the rates of all stages, those of the dense output included: one stage after the other
# Per stage: fraction of the step, and where the stages before it that enter begin; of these, number and weight.
FRACTIONS = (
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25,
    0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0, 1.0, 0.1, 0.2, 0.7777777777777778,
)
FIRST = (0, 0, 1, 3, 5, 8, 11, 15, 20, 26, 33, 41, 50, 58, 66, 74, 82)
WHICH = (
    0, 0, 1, 0, 2, 0, 2, 3, 0, 3, 4, 0, 3, 4, 5, 0, 3, 4, 5, 6, 0, 3, 4, 5, 6, 7, 0, 3, 4, 5, 6, 7, 8, 0, 3, 4, 5,
    6, 7, 8, 9, 0, 3, 4, 5, 6, 7, 8, 9, 10, 0, 5, 6, 7, 8, 9, 10, 11, 0, 6, 7, 8, 9, 10, 11, 12, 0, 5, 6, 7, 10, 11,
    12, 13, 0, 5, 6, 7, 8, 12, 13, 14,
)
_PLACES = tuple(7 * j for j in WHICH)
WEIGHTS = (
    0.05260015195876773, 0.0197250569845379, 0.0591751709536137, 0.02958758547680685, 0.08876275643042054,
    0.2413651341592667, -0.8845494793282861, 0.924834003261792, 0.037037037037037035, 0.17082860872947386,
    0.12546768756682242, 0.037109375, 0.17025221101954405, 0.06021653898045596, -0.017578125, 0.03709200011850479,
    0.17038392571223998, 0.10726203044637328, -0.015319437748624402, 0.008273789163814023, 0.6241109587160757,
    -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894, -43.48988418106996,
    0.47766253643826434, -2.4881146199716677, -0.590290826836843, 21.230051448181193, 15.279233632882423,
    -33.28821096898486, -0.020331201708508627, -0.9371424300859873, 5.186372428844064, 1.0914373489967295,
    -8.149787010746927, -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196,
    2.273310147516538, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996,
    -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636, 0.054293734116568765,
    4.450312892752409, 1.8915178993145003, -5.801203960010585, 0.3111643669578199, -0.1521609496625161,
    0.20136540080403034, 0.04471061572777259, 0.056167502283047954, 0.25350021021662483, -0.2462390374708025,
    -0.12419142326381637, 0.15329179827876568, 0.00820105229563469, 0.007567897660545699, -0.008298,
    0.03183464816350214, 0.028300909672366776, 0.053541988307438566, -0.05492374857139099, -0.00010834732869724932,
    0.0003825710908356584, -0.00034046500868740456, 0.1413124436746325, -0.42889630158379194, -4.697621415361164,
    7.683421196062599, 4.06898981839711, 0.3567271874552811, -0.0013990241651590145, 2.9475147891527724,
    -9.15095847217987,
)
ERROR_5 = (
    0.01312004499419488, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
    -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
)
ERROR_3 = (
    -0.18980075407240762, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082,
)
# Of the dense output, four rows of sixteen.
_DENSE = (
    -8.428938276109013, 0.0, 0.0, 0.0, 0.0, 0.5667149535193777, -3.0689499459498917, 2.38466765651207,
    2.117034582445028, -0.871391583777973, 2.2404374302607883, 0.6315787787694688, -0.08899033645133331,
    18.148505520854727, -9.194632392478356, -4.436036387594894, 10.427508642579134, 0.0, 0.0, 0.0, 0.0,
    242.28349177525817, 165.20045171727028, -374.5467547226902, -22.113666853125306, 7.733432668472264,
    -30.674084731089398, -9.332130526430229, 15.697238121770845, -31.139403219565178, -9.35292435884448,
    35.81684148639408, 19.985053242002433, 0.0, 0.0, 0.0, 0.0, -387.0373087493518, -189.17813819516758,
    527.8081592054236, -11.57390253995963, 6.8812326946963, -1.0006050966910838, 0.7777137798053443,
    -2.778205752353508, -60.19669523126412, 84.32040550667716, 11.99229113618279, -25.69393346270375, 0.0, 0.0, 0.0,
    0.0, -154.18974869023643, -231.5293791760455, 357.6391179106141, 93.40532418362432, -37.45832313645163,
    104.0996495089623, 29.8402934266605, -43.53345659001114, 96.32455395918828, -39.17726167561544,
    -149.72683625798564,
)


def step(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t: float, y: Vector, h: float) -> tuple[Vector, float]:
    """Return the state after a step of `h` [s], and its error relative to 1 + |state|."""
    ks = [0.0] * NUMBERS
    for j in range(STAGES):
        at = t + FRACTIONS[j] * h
        put_rates(ks, j, rates_of(numbers, mode, piece_value(u, at), piece_value(tau, at), moved(y, ks, j, h)))
    after = moved(y, ks, STAGES, h)
    return after, error_of(y, after, ks, h)


def put_rates(ks: Any, stage: int, rates: Vector) -> None:
    """Note the rates of a stage."""
    k = 7 * stage
    ks[k], ks[k + 1], ks[k + 2], ks[k + 3], ks[k + 4], ks[k + 5], ks[k + 6] = rates


def error_of(y: Vector, after: Vector, ks: Any, h: float) -> float:
    """Return the error of a step relative to 1 + |state|."""
    sum_5 = sum_3 = 0.0
    before, behind = y[:], after[:]
    for n in range(7):
        e5 = e3 = 0.0
        at = n
        for j in range(STAGES):
            k = ks[at]
            at += 7
            e5 += ERROR_5[j] * k
            e3 += ERROR_3[j] * k
        scale = 1.0 + max(abs(before[n]), abs(behind[n]))
        sum_5 += (e5 / scale) ** 2
        sum_3 += (e3 / scale) ** 2
    return h * sum_5 / math.sqrt(sum_5 + 0.01 * sum_3) if sum_5 != 0.0 else 0.0


def dense(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, t: float, y: Vector, h: float) -> tuple[Vector, ...]:
    """Return the seven vectors of the dense output of a step."""
    ks = [0.0] * NUMBERS
    after = y
    for j in range(16):
        at = moved(y, ks, j, h)
        if j == STAGES:
            after = at
        time = t + FRACTIONS[j] * h
        put_rates(ks, j, rates_of(numbers, mode, piece_value(u, time), piece_value(tau, time), at))
    return dense_of(y, after, ks, h)


def dense_of(y: Vector, after: Vector, ks: Any, h: float) -> tuple[Vector, ...]:
    """Return the same from the rates of all sixteen stages."""
    way, left, right = _difference(y, after), rates_in(ks, 0), rates_in(ks, STAGES)
    first = _sum(way, left, -1.0, h, left, 0.0)
    second = _sum(way, left, 2.0, -h, right, -h)
    return (way, first, second, _row(ks, 0, h), _row(ks, 16, h), _row(ks, 32, h), _row(ks, 48, h))


def interpolate(y: Vector, vectors: tuple[Vector, ...], x: float) -> Vector:
    """Return the state at the fraction x of a step that began at y."""
    z = 1.0 - x
    f0, f1, f2, f3, f4, f5, f6 = vectors
    return Vector(
        y.q + x * (f0.q + z * (f1.q + x * (f2.q + z * (f3.q + x * (f4.q + z * (f5.q + x * f6.q)))))),
        y.w + x * (f0.w + z * (f1.w + x * (f2.w + z * (f3.w + x * (f4.w + z * (f5.w + x * f6.w)))))),
        y.i + x * (f0.i + z * (f1.i + x * (f2.i + z * (f3.i + x * (f4.i + z * (f5.i + x * f6.i)))))),
        y.T_w + x * (f0.T_w + z * (f1.T_w + x * (f2.T_w + z * (f3.T_w + x * (f4.T_w + z * (f5.T_w + x * f6.T_w)))))),
        y.T_h + x * (f0.T_h + z * (f1.T_h + x * (f2.T_h + z * (f3.T_h + x * (f4.T_h + z * (f5.T_h + x * f6.T_h)))))),
        y.q_m + x * (f0.q_m + z * (f1.q_m + x * (f2.q_m + z * (f3.q_m + x * (f4.q_m + z * (f5.q_m + x * f6.q_m)))))),
        y.w_m + x * (f0.w_m + z * (f1.w_m + x * (f2.w_m + z * (f3.w_m + x * (f4.w_m + z * (f5.w_m + x * f6.w_m)))))),
    )


def rates_in(ks: Any, stage: int) -> Vector:
    """Return the rates of a stage."""
    k = 7 * stage
    return Vector(ks[k], ks[k + 1], ks[k + 2], ks[k + 3], ks[k + 4], ks[k + 5], ks[k + 6])


def moved(y: Vector, ks: Any, stage: int, h: float) -> Vector:
    """Return the state from which a stage takes its rates."""
    a = b = c = d = e = f = g = 0.0
    for n in range(FIRST[stage], FIRST[stage + 1]):
        k, weight = _PLACES[n], WEIGHTS[n]
        a += weight * ks[k]
        b += weight * ks[k + 1]
        c += weight * ks[k + 2]
        d += weight * ks[k + 3]
        e += weight * ks[k + 4]
        f += weight * ks[k + 5]
        g += weight * ks[k + 6]
    q, w, i, T_w, T_h, q_m, w_m = y
    return Vector(q + h * a, w + h * b, i + h * c, T_w + h * d, T_h + h * e, q_m + h * f, w_m + h * g)


def _row(ks: Any, at: int, h: float) -> Vector:
    a = b = c = d = e = f = g = 0.0
    for n in range(16):
        k, weight = 7 * n, h * _DENSE[at + n]
        a += weight * ks[k]
        b += weight * ks[k + 1]
        c += weight * ks[k + 2]
        d += weight * ks[k + 3]
        e += weight * ks[k + 4]
        f += weight * ks[k + 5]
        g += weight * ks[k + 6]
    return Vector(a, b, c, d, e, f, g)


def _difference(x: Vector, y: Vector) -> Vector:
    return Vector(y.q - x.q, y.w - x.w, y.i - x.i, y.T_w - x.T_w, y.T_h - x.T_h, y.q_m - x.q_m, y.w_m - x.w_m)


def _sum(x: Vector, y: Vector, a: float, b: float, z: Vector, c: float) -> Vector:
    return Vector(a * x.q + b * y.q + c * z.q, a * x.w + b * y.w + c * z.w, a * x.i + b * y.i + c * z.i,
            a * x.T_w + b * y.T_w + c * z.T_w, a * x.T_h + b * y.T_h + c * z.T_h, a * x.q_m + b * y.q_m + c * z.q_m,
            a * x.w_m + b * y.w_m + c * z.w_m)
