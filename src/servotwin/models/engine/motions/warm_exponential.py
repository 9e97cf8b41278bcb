"""Heating: how one body moves while the current that turns it warms the winding, and law and current follow.

At the temperatures of its start a body moves by ẇ = f − λ w, which is solved exactly. How far warming leads off that is
small: it is found from the temperatures at Gauss's five points, these from the speeds there, and both once more, with
an error estimated by what the second time has changed. Of a body that no current turns temperatures alone change.

Coefficients: E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", 2nd edition, Springer 1996, section
IV.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.motions.elementary import decay, fma
from servotwin.models.state.modes import constant_current
from servotwin.models.state.records import made
from servotwin.models.terms.heat import Heat, warming_rates
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.motor import steady_armature_current
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, magnet_factor, winding_resistance

NODES = (0.046910077030668004, 0.23076534494715845, 0.5, 0.7692346550528415, 0.953089922969332)
WEIGHTS = (0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324, 0.11846344252809454)
_UP_TO = (
    (0.05923172126404727, -0.019570364359076036, 0.011254400818642955, -0.005593793660812185, 0.0015881129678659985),
    (0.12815100567004528, 0.11965716762484162, -0.0245921146196422, 0.010318280670683357, -0.002768994398769603),
    (0.1137762880042246, 0.2600046516806415, 0.14222222222222222, -0.020690316430958283, 0.004687154523869941),
    (0.12123243692686414, 0.22899605457899988, 0.30903655906408667, 0.11965716762484162, -0.009687563141950739),
    (0.11687532956022854, 0.24490812891049543, 0.2731900436258015, 0.25888469960875926, 0.05923172126404727),
)
_PER_KELVIN = 0.1  # of an error of the temperature, to tell it as one of an angle
_FIFTH = 4e-13  # error of the rule for e^x over 1, by x^10


class Law(NamedTuple):
    """The law of a body at the temperatures of the start."""

    rate: float  # λ ≥ 0 [1/s]
    per_rate: float  # 1/λ [s]; 0 for λ = 0
    pull: float  # ẇ at the start [rad/s²]
    w: float  # speed there [rad/s]
    per_ampere: float  # ẇ by an ampere [rad/s²/A]; 0 of a body that no current turns
    v: float  # of the loop [V]
    R: float  # of the loop [Ω]; inf: the current stays
    i: float  # the current that stays [A]
    K_b: float
    copper: float  # of the winding [Ω]
    per_kelvin: float  # by which that grows [Ω/K]
    field: float  # by which the magnets grow [1/K]
    T_w: float  # [K]
    T_h: float


class Node(NamedTuple):
    """The acceleration that a state adds, beside the law at the start, and the rates of its temperatures."""

    more: float  # [rad/s²]
    warms: float  # [K/s]
    housing: float


class Gone(NamedTuple):
    """Where a body has gone: its way and speed, by how much winding and housing are warmer, and the rates there."""

    way: float  # [rad]
    w: float  # [rad/s]
    warmer: float  # [K]
    housing: float
    dw: float
    warms: float  # rates [K/s]
    housing_warms: float
    error: float  # relative to 1 + |state|


def law_of(cold: Numbers, warm: Numbers, zone: int, u: float, T_w: float, T_h: float, rate: float, pull: float,
           w: float, per_ampere: float) -> Law:
    """Return the law of a body by its linear one at its temperatures [K], under a voltage behind the bridge [V]."""
    stays = constant_current(zone)
    v, R = (0.0, math.inf) if stays else currents.loop(warm, zone, u)
    i = currents.current(warm, zone, u, 0.0, 0.0) if stays else 0.0
    own = cold.motor.R
    grows = winding_resistance(REFERENCE_TEMPERATURE + 1.0, own) - own
    magnet = cold.heat.magnet
    field = (magnet_factor(T_h + 1.0, magnet) - magnet_factor(T_h, magnet)) / magnet_factor(T_h, magnet)
    return Law(rate, 1.0 / rate if rate > 0.0 else 0.0, pull, w, per_ampere, v, R, i, warm.motor.K_b, warm.motor.R,
               grows, field, T_w, T_h)


def _at(x: Law, own: Heat, w: float, d: float, g: float) -> Node:
    """Return what happens at a speed where winding and housing are warmer by d and g [K]."""
    field, more = fma(x.field, g, 1.0), x.per_kelvin * d
    i = steady_armature_current(x.v, w, x.R + more, x.K_b * field) + x.i
    at_start = steady_armature_current(x.v, w, x.R, x.K_b) + x.i
    dT_w, dT_h = warming_rates(own, x.copper + more, i, x.T_w + d, x.T_h + g)
    return Node(x.per_ampere * fma(field, i, -at_start), dT_w, dT_h)


def _sum(weights: Sequence[float], name: str) -> str:
    text = ""
    for k, weight in enumerate(weights):
        text = f"fma({weight!r}, {name.format(k)}, {text})" if text else f"{weight!r} * {name.format(k)}"
    return text


def _going() -> Callable[[Law, Heat, float], Any]:
    """Return the function that follows a body for a time, all written out: it goes in vectors."""
    points = range(len(NODES))

    def each(line: str) -> str:
        return "".join("    " + line.format(k=k, c=repr(NODES[k])) + "\n" for k in points)

    def sums(line: str, name: str) -> str:
        return "".join("    " + line.format(k=k, sum=_sum(_UP_TO[k], name)) + "\n" for k in points)

    def at(d: str, g: str) -> str:
        return each(f"n{{k}} = at(x, own, w{{k}}, {d}, {g})")

    whole = {name: _sum(WEIGHTS, name) for name in ("n{}.warms", "n{}.housing", "z{}", "y{}")}
    return made("going", f'''def going(x, own, h):
{each("o{k}, _ = decay(x.rate, x.per_rate, {c} * h)")}{each("e{k} = fma(-x.rate, o{k}, 1.0)")}\
{each("v{k} = fma(x.pull, o{k}, x.w)")}{each("w{k} = v{k}")}\
{at("0.0", "0.0")}{sums("d{k} = h * ({sum})", "n{}.warms")}{sums("g{k} = h * ({sum})", "n{}.housing")}\
{at("d{k}", "g{k}")}{each("z{k} = n{k}.more / e{k}")}{sums("y{k} = e{k} * h * ({sum})", "z{}")}\
    once, twice = decay(x.rate, x.per_rate, h)
    fall = h * fma(-x.rate, once, 1.0)
    before, way = fall * ({whole["z{}"]}), {whole["y{}"]}
{each("w{k} = v{k} + y{k}")}{at("d{k}", "g{k}")}\
    warmer = {whole["n{}.warms"]}
{sums("d{k} = h * ({sum})", "n{}.warms")}{sums("g{k} = h * ({sum})", "n{}.housing")}\
{at("d{k}", "g{k}")}{each("z{k} = n{k}.more / e{k}")}{sums("y{k} = e{k} * h * ({sum})", "z{}")}\
    w, after = fma(x.pull, once, x.w), fall * ({whole["z{}"]})
    on = {whole["y{}"]}
{each("w{k} = v{k} + y{k}")}{at("d{k}", "g{k}")}\
    d, g = h * ({whole["n{}.warms"]}), h * ({whole["n{}.housing"]})
    end = at(x, own, w + after, d, g)
    return ended(x, own, Gone(fma(h, on, fma(x.pull, twice, x.w * h)), w + after, d, g,
        fma(-x.rate, fma(x.pull, once, after), x.pull) + end.more, end.warms, end.housing, 0.0),
        h, after - before, h * (on - way), d - h * warmer)
''', {"at": _at, "decay": decay, "fma": fma, "Gone": Gone, "ended": _ended})


def _ended(x: Law, own: Heat, to: Gone, h: float, speed: float, way: float, heat: float) -> Gone:
    """Return where a body has gone with its error, by what the second time has changed in speed, way and heat."""
    part = abs(x.per_kelvin * to.warmer / x.copper) + abs(x.field * to.housing)  # that the law has changed by
    bend = 4.0 * x.rate * x.rate * h * h
    rule = _FIFTH * bend * bend * bend * bend * bend * (abs(x.w) + abs(x.pull) * h)
    i = x.v / x.R + x.i
    tends = h * ((own.G_wh + x.per_kelvin * i * i) / own.C_w + (own.G_wh + own.G_ha) / own.C_h)
    error = max(part * (max(abs(speed), abs(way)) + rule), _PER_KELVIN * abs(heat) * (part + tends))
    return Gone(to.way, to.w, to.warmer, to.housing, to.dw, to.warms, to.housing_warms, error)


going = _going()
