"""Heat: winding and housing as two thermal masses, and what their temperatures do to resistance and magnet.

The current heats the winding, the winding heats the housing, and the housing the air:

    C_w Ṫ_w = P − (T_w − T_h)/R_wh,    C_h Ṫ_h = (T_w − T_h)/R_wh − (T_h − T_amb)/R_ha,    P = i² R_a(T_w)
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.physics._typing import Real
from servotwin.physics.elementary import exp

COPPER_COEFFICIENT = 0.00385
"""Relative change of the resistance of copper, at the reference temperature [1/K]."""

REFERENCE_TEMPERATURE = 298.15
"""Temperature for which resistances and magnets are given, 25 °C [K]."""


class Temperatures(NamedTuple):
    """Temperatures of the two masses, numbers or arrays [K]."""

    winding: Real
    housing: Real


class ThermalTimes(NamedTuple):
    """The two time constants of the two masses, numbers or arrays [s]."""

    fast: Real
    slow: Real


def winding_resistance(winding_temperature: float, armature_resistance: float) -> float:
    """Return the resistance of a copper winding at its temperature.

    Parameters
    ----------
    winding_temperature : float or array
        T_w [K].
    armature_resistance : float or array
        R_ref, at 25 °C [Ω].

    Returns
    -------
    float or array
        R_a = R_ref (1 + 0.00385 (T_w − 298.15 K)) [Ω].

    Notes
    -----
    IEC 60028 has 0.00393/K at 20 °C, which is 0.00385/K at 25 °C: 1/(234.5 + 25).

    Examples
    --------
    >>> round(float(winding_resistance(398.15, 3.0)), 9)
    4.155
    """
    return armature_resistance * (1.0 + COPPER_COEFFICIENT * (winding_temperature - REFERENCE_TEMPERATURE))


def magnet_factor(housing_temperature: float, magnet_coefficient: float) -> float:
    """Return by what factor both motor constants change with the temperature of the magnets.

    Parameters
    ----------
    housing_temperature : float or array
        T_h; the magnets sit in the housing [K].
    magnet_coefficient : float or array
        Relative change per kelvin, negative in real magnets: about −0.001 to −0.002 [1/K].

    Returns
    -------
    float or array
        1 + c (T_h − 298.15 K), for k_a and k_b alike [1].

    Examples
    --------
    >>> round(float(magnet_factor(348.15, -0.002)), 9)
    0.9
    """
    return 1.0 + magnet_coefficient * (housing_temperature - REFERENCE_TEMPERATURE)


def copper_loss(armature_current: float, armature_resistance: float) -> float:
    """Return the heat that a current makes in the winding.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    armature_resistance : float or array
        R_a at the winding's temperature [Ω].

    Returns
    -------
    float or array
        P = R_a i_a² [W].

    Examples
    --------
    >>> copper_loss(2.0, 3.0)
    12.0
    """
    return armature_resistance * armature_current * armature_current


def heat_flow(temperature: float, other_temperature: float, conductance: float) -> float:
    """Return the heat that goes from one body to another.

    Parameters
    ----------
    temperature, other_temperature : float or array
        T_1 and T_2 [K].
    conductance : float or array
        G = 1/R_12 [W/K].

    Returns
    -------
    float or array
        G (T_1 − T_2), positive from the first to the second [W].

    Examples
    --------
    >>> heat_flow(310.0, 300.0, 0.125)
    1.25
    """
    return (temperature - other_temperature) * conductance


def warming_rate(power_in: float, power_out: float, capacity: float) -> float:
    """Return how fast a body gets warmer.

    Parameters
    ----------
    power_in, power_out : float or array
        Heat that it gets and gives [W].
    capacity : float or array
        C, positive [J/K].

    Returns
    -------
    float or array
        Ṫ = (P_in − P_out)/C [K/s].

    Examples
    --------
    >>> warming_rate(12.0, 2.0, 5.0)
    2.0
    """
    return (power_in - power_out) / capacity


def thermal_time_constants(*, winding_capacity: float, housing_capacity: float, winding_to_housing: float,
                           housing_to_ambient: float) -> ThermalTimes:
    """Return the two time constants with which winding and housing warm up.

    Parameters
    ----------
    winding_capacity, housing_capacity : float or array
        C_w and C_h, positive [J/K].
    winding_to_housing, housing_to_ambient : float or array
        R_wh and R_ha, positive [K/W].

    Returns
    -------
    ThermalTimes
        The inverses of the roots of s² + (a + b + c) s + a c = 0 with a = 1/(C_w R_wh), b = 1/(C_h R_wh) and
        c = 1/(C_h R_ha), both real, and never equal [s].

    Notes
    -----
    For a winding that is light beside its housing they are about C_w R_wh and C_h R_ha.

    Examples
    --------
    >>> times = thermal_time_constants(winding_capacity=2.0, housing_capacity=30.0, winding_to_housing=8.0,
    ...                                housing_to_ambient=16.0)
    >>> round(float(times.fast), 2), round(float(times.slow), 1)
    (14.97, 513.0)
    """
    a, b, c = 1.0 / (winding_capacity * winding_to_housing), 1.0 / (housing_capacity * winding_to_housing), \
        1.0 / (housing_capacity * housing_to_ambient)
    fast = 0.5 * (a + b + c + math.sqrt((a - b - c) ** 2 + 4.0 * a * b))
    return ThermalTimes(1.0 / fast, fast / (a * c))


def steady_temperatures(power: float, *, winding_to_housing: float, housing_to_ambient: float,
                        ambient: float = REFERENCE_TEMPERATURE) -> Temperatures:
    """Return the temperatures to which a constant power leads in the end.

    Parameters
    ----------
    power : float or array
        P [W].
    winding_to_housing, housing_to_ambient : float or array
        R_wh and R_ha [K/W].
    ambient : float or array
        T_amb, 25 °C unless given [K].

    Returns
    -------
    Temperatures
        T_h = T_amb + R_ha P and T_w = T_h + R_wh P [K].

    Examples
    --------
    >>> steady_temperatures(2.0, winding_to_housing=8.0, housing_to_ambient=16.0, ambient=300.0)
    Temperatures(winding=348.0, housing=332.0)
    """
    T_h = ambient + housing_to_ambient * power
    return Temperatures(T_h + winding_to_housing * power, T_h)


def two_mass_temperatures(
    time: float, power: float, winding_start: float = REFERENCE_TEMPERATURE,
    housing_start: float = REFERENCE_TEMPERATURE,
    *, winding_capacity: float, housing_capacity: float, winding_to_housing: float, housing_to_ambient: float,
    ambient: float = REFERENCE_TEMPERATURE,
) -> Temperatures:
    """Return the temperatures of winding and housing under a constant power, in closed form.

    Parameters
    ----------
    time : float or array
        t, since the start [s].
    power : float or array
        P; it does not follow the resistance here [W].
    winding_start, housing_start : float or array
        T_w and T_h at t = 0 [K].
    winding_capacity, housing_capacity : float or array
        C_w and C_h, positive [J/K].
    winding_to_housing, housing_to_ambient : float or array
        R_wh and R_ha, positive [K/W].
    ambient : float or array
        T_amb, 25 °C unless given [K].

    Returns
    -------
    Temperatures
        T(t) = T_∞ + exp(A t)(T(0) − T_∞), with exp(A t) = [(A + l_1) e^(−l_2 t) − (A + l_2) e^(−l_1 t)]/(l_1 − l_2)
        for the rates l_1 > l_2 [K].

    Examples
    --------
    >>> masses = {"winding_capacity": 2.0, "housing_capacity": 30.0, "winding_to_housing": 8.0,
    ...           "housing_to_ambient": 16.0}
    >>> warm = two_mass_temperatures(60.0, 2.0, **masses)
    >>> round(float(warm.winding), 2), round(float(warm.housing), 2)
    (315.63, 300.84)
    """
    a, b = 1.0 / (winding_capacity * winding_to_housing), 1.0 / (housing_capacity * winding_to_housing)
    c = 1.0 / (housing_capacity * housing_to_ambient)
    end = steady_temperatures(power, winding_to_housing=winding_to_housing, housing_to_ambient=housing_to_ambient,
                              ambient=ambient)
    y_w, y_h = winding_start - end.winding, housing_start - end.housing
    gap = math.sqrt((a - b - c) ** 2 + 4.0 * a * b)
    l_1 = 0.5 * (a + b + c + gap)
    l_2 = a * c / l_1
    e_1, e_2 = exp(-l_1 * time), exp(-l_2 * time)
    share, rest = (e_2 - e_1) / gap, (l_1 * e_2 - l_2 * e_1) / gap
    T_w = end.winding + rest * y_w + share * (-a * y_w + a * y_h)
    T_h = end.housing + rest * y_h + share * (b * y_w - (b + c) * y_h)
    return Temperatures(T_w, T_h)
