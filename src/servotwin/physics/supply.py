"""The supply of one or more servos: the bus voltage that source, bridges and diodes agree upon.

Behind a bridge without inductance the current is a broken line over the bus voltage: it draws above one voltage,
returns below another, and is zero in between. So is the source: a battery has a resistance, a regulator gives no more
than its limit and takes nothing back. Where the two lines meet is the bus voltage.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.physics._typing import Real
from servotwin.physics.laws import array_form

Array: TypeAlias = NDArray[np.float64]


class Conduction(NamedTuple):
    """The bus voltages beyond which a bridge conducts, numbers or arrays [V]."""

    draws_above: Real
    returns_below: Real


def conduction(drive: float, back_emf: float, voltage_drop: float) -> Conduction:
    """Return the bus voltages above which a bridge draws current, and below which it returns some.

    Parameters
    ----------
    drive : float or array
        s: +1 or −1 while the bridge drives, 0 while it coasts [1].
    back_emf : float or array
        v_b = k_b q̇_m [V].
    voltage_drop : float or array
        D = V_ce0 + V_br [V].

    Returns
    -------
    Conduction
        s v_b + D and s v_b − D while it drives; inf and abs(v_b) − D while it coasts, for diodes only return [V].

    Notes
    -----
    A bridge that brakes is not on the bus at all; give it inf and −inf, or leave it out.

    Examples
    --------
    >>> float(conduction(-1.0, 2.0, 0.5).draws_above), float(conduction(0.0, -2.0, 0.5).returns_below)
    (-1.5, 1.5)
    """
    s, v_b, D = drive, back_emf, voltage_drop
    if s == 0.0:
        return Conduction(math.inf, abs(v_b) - D)
    return Conduction(s * v_b + D, s * v_b - D)


def bridge_supply_current(bus_voltage: float, draws_above: float, returns_below: float, resistance: float) -> float:
    """Return the current that a bridge draws from the bus, negative where it returns some.

    Parameters
    ----------
    bus_voltage : float or array
        V_bus [V].
    draws_above, returns_below : float or array
        As `conduction` has them [V].
    resistance : float or array
        R of its own circuit, without that of the source: R_a + r_c while it drives, R_a while it coasts [Ω].

    Returns
    -------
    float or array
        I = [max(V_bus − draws_above, 0) − max(returns_below − V_bus, 0)]/R, which is s i_a [A].

    Examples
    --------
    >>> [round(float(bridge_supply_current(V, 2.4, 1.6, 2.0)), 9) for V in (0.6, 2.0, 6.0)]
    [-0.5, 0.0, 1.8]
    """
    return (max(bus_voltage - draws_above, 0.0) - max(returns_below - bus_voltage, 0.0)) / resistance


def supply_current(armature_current: float, drive: float) -> float:
    """Return what a connected bridge draws from the supply.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    drive : float or array
        s: +1 or −1 while the bridge drives; 0 while it coasts, whose diodes only return [1].

    Returns
    -------
    float or array
        s i_a, or −abs(i_a); negative where current comes back. A bridge that brakes is not on the bus [A].

    Examples
    --------
    >>> supply_current(2.0, -1.0), supply_current(2.0, 0.0)
    (-2.0, -2.0)
    """
    return drive * armature_current if drive != 0.0 else -abs(armature_current)


def source_voltage(current: float, open_circuit_voltage: float, internal_resistance: float = 0.0, *,
                   regulated: bool = False) -> float:
    """Return the voltage of a source that gives a current below its limit.

    Parameters
    ----------
    current : float or array
        I = Σ s i over all that hangs on it, negative where current comes back [A].
    open_circuit_voltage : float or array
        V_oc [V].
    internal_resistance : float or array
        R_b [Ω].
    regulated : bool
        Whether the source is a regulator, which takes nothing back.

    Returns
    -------
    float or array
        V_oc − R_b I; of a regulator with I < 0 just V_oc [V].

    Notes
    -----
    At its limit a regulator has whatever voltage its load leaves it: `bus_voltage`.

    Examples
    --------
    >>> [float(source_voltage(i, 6.0, 0.5)) for i in (2.0, -2.0)], float(source_voltage(-2.0, 6.0, 0.5, regulated=True))
    ([5.0, 7.0], 6.0)
    """
    taken = max(current, 0.0) if regulated else current
    return open_circuit_voltage - internal_resistance * taken


def bus_voltage(draws_above: ArrayLike, returns_below: ArrayLike, resistance: ArrayLike, open_circuit_voltage: Real,
                internal_resistance: Real = 0.0, current_limit: Real | None = None) -> Real:
    """Return the voltage of a bus on which several bridges hang.

    Parameters
    ----------
    draws_above, returns_below : array_like, shape (..., n)
        Of each bridge, as `conduction` has them [V].
    resistance : array_like, shape (..., n)
        Of each bridge's own circuit, positive [Ω].
    open_circuit_voltage : float or array, shape (...)
        V_oc [V].
    internal_resistance : float or array, shape (...)
        R_b [Ω].
    current_limit : float or array, shape (...), optional
        I_max of a regulator; a battery without it [A].

    Returns
    -------
    float or array, shape (...)
        The V with V = V_oc − R_b Σ I_j(V), I_j as in `bridge_supply_current`. Of a regulator: V_oc where current would
        come back, and where more than I_max would flow the V with Σ I_j(V) = I_max, or 0 where that is below 0 [V].

    Notes
    -----
    Σ I_j grows with V, so there is one solution. It is linear between two of the voltages at which a bridge starts or
    stops to conduct, and is found by looking at these, without iteration.

    Examples
    --------
    Two stalled servos of 3 Ω and a drop of 0.4 V at a battery of 6 V and 0.5 Ω, then at a regulator of 1 A:

    >>> two = [0.4, 0.4], [-0.4, -0.4], [3.0, 3.0]
    >>> round(float(bus_voltage(*two, 6.0, 0.5)), 9), round(float(bus_voltage(*two, 6.0, 0.0, 1.0)), 9)
    (4.6, 1.9)
    """
    above, below, R = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64)
                                            for x in (draws_above, returns_below, resistance)))
    V_oc, R_b = np.asarray(open_circuit_voltage), np.asarray(internal_resistance)
    V: Real
    if current_limit is None:
        V = _meeting(above, below, R, 1.0, R_b, V_oc)[()]
        return V
    takes_back = _current(V_oc, above, below, R) < 0.0
    free = np.where(takes_back, V_oc, _meeting(above, below, R, 1.0, R_b, V_oc))
    bound = np.maximum(_meeting(above, below, R, 0.0, np.ones_like(R_b), np.asarray(current_limit)), 0.0)
    V = np.where(_current(free, above, below, R) > current_limit, bound, free)[()]
    return V


def _current(V: Array, above: Array, below: Array, R: Array) -> Array:
    """Return Σ I_j(V), shape (...)."""
    return np.asarray(np.sum(array_form(bridge_supply_current)(np.asarray(V)[..., None], above, below, R), axis=-1))


def _meeting(above: Array, below: Array, R: Array, a: float, b: Array, c: Array) -> Array:
    """Return the V with a V + b Σ I_j(V) = c, shape (...); some number where there is none."""
    corners = np.concatenate([above, below], axis=-1)
    corners = np.where(np.isfinite(corners), corners, 0.0)  # a corner more does no harm
    at_corners = np.sum(array_form(bridge_supply_current)(
        corners[..., None], above[..., None, :], below[..., None, :], R[..., None, :]), axis=-1)
    b, c = np.asarray(b)[..., None], np.asarray(c)[..., None]
    left = np.max(np.where(a * corners + b * at_corners <= c, corners, -np.inf), axis=-1, initial=-np.inf)[..., None]
    conducting = np.where(above <= left, above, np.where(below > left, below, np.nan))  # right of the corner `left`
    G = np.where(np.isnan(conducting), 0.0, 1.0 / R)
    slope = a + b[..., 0] * np.sum(G, axis=-1)
    level = c[..., 0] + b[..., 0] * np.sum(G * np.where(np.isnan(conducting), 0.0, conducting), axis=-1)
    return np.asarray(level / np.where(slope > 0.0, slope, 1.0))
