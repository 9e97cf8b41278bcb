"""One step of Rodas5P for q̇ = w, ẇ = F(t, q, w, i), di/dt = E(t, q, w, i).

A Rosenbrock method of order 5 with an embedded error estimate and a dense output of order 4, L-stable and stiffly
accurate: it follows a steep tanh with the steps that the slow motion asks for.

Coefficients: G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the
Julia Differential Equations package", BIT Numerical Mathematics 63, 27 (2023).
"""

from __future__ import annotations

from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece, piece_value

Triple = tuple[float, float, float]  # angle, speed, current

GAMMA = 0.21193756319429014
# Per stage: fraction of the step and weight of the time derivative.
FRACTIONS = (
    0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0,
)
WEIGHTS = (
    0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0.0, 0.0,
    0.0,
)
# Weights of the stages before, stage after stage: one, two, … seven numbers.
A = (
    3.0, 2.849394379747939, 0.45842242204463923, -6.954028509809101, 2.489845061869568, -10.358996098473584,
    2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641, -7.502846399306121,
    2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, -7.502846399306121,
    2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, -7.502846399306121,
    2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, 1.0,
)
C = (
    -14.155112264123755, -17.97296035885952, -2.859693295451294, 147.12150275711716, -1.41221402718213,
    71.68940251302358, 165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306,
    24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471,
    30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
    -28.087943162872662, 37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047,
    -40.06618937091002, -54.66780262877968, -9.48861652309627,
)
# Three rows of eight, one after the other.
DENSE = (
    25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
    1.1241088310450404, 0.4272876194431874, -0.17202221070155493, -9.91568850695171, -0.9689944594115154,
    3.0438037242978453, -24.495224566215796, 20.176138334709044, 15.98066361424651, -6.789040303419874,
    -6.710236069923372, 11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643,
    -52.072871366152654, -59.78993625266729, -0.15582684282751913, 4.883087185713722,
)


def step(numbers: Numbers, mode: Mode, u: Piece, tau: Piece, jac: tuple[float, ...], t: float, y: Vector,
         h: float) -> tuple[Vector, Triple, tuple[Triple, ...]]:
    """Return the state after a step of `h` [s], its error estimate, and the stages for the dense output.

    The gear has to be rigid, and temperatures stay.

    Parameters
    ----------
    numbers, mode, u, tau
        Numbers and mode of the plant, its input, and the external torque.
    jac : tuple
        ∂F/∂(q, w, i), ∂E/∂(q, w, i), ∂F/∂t, ∂E/∂t at the start.
    t, y, h
        Start [s], state there, length [s].
    """
    q, w, i, T_w, T_h, _, _ = y
    Fq, Fw, Fi, Eq, Ew, Ei, Ft, Et = jac
    # (1/(γ h) − J) k = r, by elimination of the angle and of the current
    g = 1.0 / (GAMMA * h)
    e = g - Ei
    Ewq = Ew + Eq / g
    pivot = 1.0 / (g - Fw - Fq / g - Fi * Ewq / e)
    inv_h = 1.0 / h
    follows_u, follows_tau = not_constant(u), not_constant(tau)
    u_now, tau_now = u.value, tau.value
    qs, ws, cs = q, w, i
    ks = [(0.0, 0.0, 0.0)] * 8
    at = 0
    for j in range(8):
        qs, ws, cs = q, w, i
        rq = rw = ri = 0.0
        for m in range(j):
            kq, kw, ki = ks[m]
            a, c = A[at], C[at]
            at += 1
            qs += a * kq
            ws += a * kw
            cs += a * ki
            rq += c * kq
            rw += c * kw
            ri += c * ki
        if follows_u:
            u_now = piece_value(u, t + FRACTIONS[j] * h)
        if follows_tau:
            tau_now = piece_value(tau, t + FRACTIONS[j] * h)
        dy = rates_of(numbers, mode, u_now, tau_now, Vector(qs, ws, cs, T_w, T_h, qs, ws))
        hd = h * WEIGHTS[j]
        rq = rq * inv_h + ws
        rw = rw * inv_h + dy.w + hd * Ft
        ri = ri * inv_h + dy.i + hd * Et
        kw = (rw + Fq * rq / g + Fi * (ri + Eq * rq / g) / e) * pivot
        ks[j] = ((rq + kw) / g, kw, (ri + Eq * (rq + kw) / g + Ew * kw) / e)
    error = ks[7]
    q, w = qs + error[0], ws + error[1]
    return (Vector(q, w, cs + error[2], T_w, T_h, q, w), error,
            (ks[0], ks[1], ks[2], ks[3], ks[4], ks[5], ks[6], ks[7]))


def not_constant(piece: Piece) -> bool:
    """Tell whether a piece changes with time."""
    return piece.slope != 0.0 or piece.amplitude != 0.0


def dense_coefficients(ks: tuple[Triple, ...]) -> tuple[Triple, Triple, Triple]:
    """Return the three vectors of the dense output from the stages of a step."""
    return _weighted(0, ks), _weighted(8, ks), _weighted(16, ks)


def _weighted(row: int, ks: tuple[Triple, ...]) -> Triple:
    q = w = i = 0.0
    for j in range(8):
        h = DENSE[row + j]
        kq, kw, ki = ks[j]
        q += h * kq
        w += h * kw
        i += h * ki
    return q, w, i


def interpolate(y0: Vector, y1: Vector, dense: tuple[Triple, Triple, Triple], x: float) -> Vector:
    """Return the state at the fraction x of the step from y0 to y1."""
    z = 1.0 - x
    d1, d2, d3 = dense
    q = z * y0.q + x * (y1.q + z * (d1[0] + x * (d2[0] + x * d3[0])))
    w = z * y0.w + x * (y1.w + z * (d1[1] + x * (d2[1] + x * d3[1])))
    i = z * y0.i + x * (y1.i + z * (d1[2] + x * (d2[2] + x * d3[2])))
    return Vector(q, w, i, y0.T_w, y0.T_h, q, w)
