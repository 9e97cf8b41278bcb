"""The law of motor and current at the temperatures of a step's start, and what warming does to it first."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.dynamics import coefficients, currents
from servotwin.models.engine.dynamics.rates import rates_of
from servotwin.models.state.modes import INSIDE, Mode, Vector, at_rest, constant_current
from servotwin.models.terms.heat import warming_rates
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, magnet_factor, winding_resistance

_APART = 4.0  # times: the fast rate is more than the slow one


class Rough(NamedTuple):
    """What a fading current does to itself by its heat [A/s]: that much of the powers of e = e^(−fast t)."""

    by_t: float  # of t e [A/s²]
    by_0: float  # of 1
    by_1: float  # of e
    by_2: float
    by_3: float


_SMOOTH = Rough(0.0, 0.0, 0.0, 0.0, 0.0)


class Law(NamedTuple):
    """What motor and current go by at the temperatures of the start; rates are 0 of what does not move."""

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
