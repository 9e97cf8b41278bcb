"""From a data sheet to a motor: what torque, speed and currents of a servo say about its parameters.

All at the output shaft, R = R_a + r_c + R_b in series, V_d the drop of bridge and brushes:

    I_s = (V − V_d)/R,    ω_0 = (V − V_d − R I_0)/K_out,    T_s = η_g K_out (I_s − I_0)

The efficiency η_g of the gear acts as friction that grows with the torque through it, with the same share
μ = (1 − η_g)/(1 + η_g) for the torque of the motor and that of the load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from servotwin.errors import ParameterError
from servotwin.physics._typing import Real

LEAST_EFFICIENCY = 0.5  # below it the gear of no servo is, and a sheet that says so contradicts itself


@dataclass(frozen=True, kw_only=True)
class SheetMotor:
    """A sheet's figures of the motor, seen at the output shaft.

    Parameters
    ----------
    resistance : float
        R in the motor's circuit [ohm].
    output_torque_constant : float
        K_out = N k_a [N m/A].
    stall_current : float
        I_s [A].
    gear_efficiency : float
        η_g; from the sheet where it gives the stall current, else assumed.
    coulomb_torque : float
        τ_c = K_out I_0 (1 − μ_m) at the output [N m].
    """

    resistance: float
    output_torque_constant: float
    stall_current: float
    gear_efficiency: float
    coulomb_torque: float

    @property
    def feasible(self) -> bool:
        """Whether the efficiency is one that a gear train has, 0.5 to 1."""
        return LEAST_EFFICIENCY <= self.gear_efficiency <= 1.0


def motor_from_sheet(*, supply_voltage: float, stall_torque: float, no_load_speed: float, no_load_current: float,
                     stall_current: float | None = None, drop_voltage: float = 0.4,
                     gear_efficiency: float = 0.8) -> SheetMotor:
    """Return the motor that a sheet describes.

    With a stall current the efficiency of the gear follows; without one it is assumed, and the resistance solves
    x² − (2U + T_s ω_0/(η_g I_0)) x + U² = 0 with x = R I_0 and U = V − V_d (the smaller root).

    Parameters
    ----------
    supply_voltage : float
        V [V].
    stall_torque : float
        T_s [N m].
    no_load_speed : float
        ω_0 [rad/s].
    no_load_current : float
        I_0 [A].
    stall_current : float, optional
        I_s [A].
    drop_voltage : float
        V_d, assumed 0.4 (0 to 0.4) [V].
    gear_efficiency : float
        η_g, assumed 0.8 (0.7 to 0.9), used where no stall current is given [1].

    Raises
    ------
    ParameterError
        If a value is not positive, or the sheet contradicts itself.

    Examples
    --------
    >>> motor = motor_from_sheet(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=math.pi / 3 / 0.23,
    ...                          no_load_current=0.285)
    >>> round(motor.resistance, 2), round(motor.output_torque_constant, 2), round(motor.stall_current, 2)
    (3.04, 1.04, 1.84)
    """
    given = {"supply_voltage": supply_voltage, "stall_torque": stall_torque, "no_load_speed": no_load_speed,
             "no_load_current": no_load_current, "gear_efficiency": gear_efficiency}
    if stall_current is not None:
        given["stall_current"] = stall_current
    for name, value in given.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ParameterError(f"sheet {name}", got=value, allowed="a positive number")
    if not 0.0 <= drop_voltage < supply_voltage:
        raise ParameterError("sheet drop_voltage", got=drop_voltage, allowed="from 0 to below the supply voltage")
    U = supply_voltage - drop_voltage
    R: Any
    if stall_current is not None:
        if stall_current <= no_load_current:
            raise ParameterError("sheet stall_current", got=stall_current,
                                 allowed=f"more than the no-load current {no_load_current:g} A")
        R, eta = sheet_resistance(supply_voltage, stall_current, drop_voltage), math.nan
    else:
        gap = 0.5 * stall_torque * no_load_speed / (gear_efficiency * no_load_current)
        x = U * U / (U + gap + math.sqrt(gap) * math.sqrt(gap + 2.0 * U))  # one over the larger root, times U²
        R, eta = x / no_load_current, gear_efficiency
    K_out: Any = sheet_torque_constant(supply_voltage, no_load_speed, no_load_current, R, drop_voltage)
    if stall_current is not None:
        eta = stall_torque / (K_out * (stall_current - no_load_current))
    mu_m = load_share(min(eta, 1.0))
    return SheetMotor(resistance=R, output_torque_constant=K_out, stall_current=U / R, gear_efficiency=eta,
                      coulomb_torque=K_out * no_load_current * (1.0 - mu_m))


def sheet_resistance(supply_voltage: Real, stall_current: Real, drop_voltage: Real = 0.0) -> Real:
    """Return the resistance of the motor's circuit that a stall current says.

    Parameters
    ----------
    supply_voltage : float or array
        V [V].
    stall_current : float or array
        I_s [A].
    drop_voltage : float or array
        V_d [V].

    Returns
    -------
    float or array
        R = (V − V_d)/I_s [ohm].

    Examples
    --------
    >>> round(sheet_resistance(6.0, 1.8415, 0.4), 3)
    3.041
    """
    return (supply_voltage - drop_voltage) / stall_current


def sheet_torque_constant(supply_voltage: Real, no_load_speed: Real, no_load_current: Real, resistance: Real,
                          drop_voltage: Real = 0.0) -> Real:
    """Return the torque per current at the output that a speed without load says.

    Parameters
    ----------
    supply_voltage : float or array
        V [V].
    no_load_speed : float or array
        ω_0 [rad/s].
    no_load_current : float or array
        I_0 [A].
    resistance : float or array
        R [Ω].
    drop_voltage : float or array
        V_d [V].

    Returns
    -------
    float or array
        K_out = (V − V_d − R I_0)/ω_0 [N m/A].

    Examples
    --------
    >>> round(sheet_torque_constant(6.0, math.pi / 3 / 0.23, 0.285, 3.041, 0.4), 3)
    1.04
    """
    return (supply_voltage - drop_voltage - resistance * no_load_current) / no_load_speed


def sheet_stall_torque(output_torque_constant: Real, stall_current: Real, no_load_current: Real,
                       gear_efficiency: Real, viscous_share: Real = 0.0) -> Real:
    """Return the torque that a servo just cannot turn against.

    Parameters
    ----------
    output_torque_constant : float or array
        K_out [N m/A].
    stall_current : float or array
        I_s [A].
    no_load_current : float or array
        I_0 [A].
    gear_efficiency : float or array
        η_g [1].
    viscous_share : float or array
        s; that friction is not there at stall [1].

    Returns
    -------
    float or array
        T_s = η_g K_out (I_s − (1 − s) I_0) [N m].

    Examples
    --------
    >>> round(sheet_stall_torque(1.0396, 1.8415, 0.285, 0.8), 4)
    1.2945
    """
    return gear_efficiency * output_torque_constant * (stall_current - (1.0 - viscous_share) * no_load_current)


def no_load_current_of(supply_voltage: Real, resistance: Real, output_torque_constant: Real, coulomb_torque: Real,
                       viscous_friction: Real = 0.0, gear_share: Real = 1.0, drop_voltage: Real = 0.0) -> Real:
    """Return the current of a servo that turns without load, from its parameters.

    Parameters
    ----------
    supply_voltage : float or array
        V [V].
    resistance : float or array
        R [Ω].
    output_torque_constant : float or array
        K_out [N m/A].
    coulomb_torque : float or array
        τ_c at the output [N m].
    viscous_friction : float or array
        b = N² B_m at the output [N m s/rad].
    gear_share : float or array
        1 − μ_m, share of the motor's torque that the gear passes on [1].
    drop_voltage : float or array
        V_d [V].

    Returns
    -------
    float or array
        I_0 of K_out I_0 (1 − μ_m) = τ_c + b ω_0 and ω_0 = (V − V_d − R I_0)/K_out [A].

    Examples
    --------
    >>> round(no_load_current_of(6.0, 3.041, 1.0396, 0.26336, 0.0, 8.0 / 9.0, 0.4), 3)
    0.285
    """
    R, K, b, U = resistance, output_torque_constant, viscous_friction, supply_voltage - drop_voltage
    return (coulomb_torque + b * U / K) / (gear_share * K + b * R / K)


@overload
def load_share(gear_efficiency: float) -> float: ...
@overload
def load_share(gear_efficiency: Real) -> Real: ...
def load_share(gear_efficiency: Real) -> Real:
    """Return the friction per torque through the gear that makes an efficiency, equal for motor and load.

    It is its own inverse: of a share it returns the efficiency.

    Parameters
    ----------
    gear_efficiency : float or array
        η_g, above 0 and at most 1 [1].

    Returns
    -------
    float or array
        μ_m = μ_e = (1 − η_g)/(1 + η_g), which gives η_g = (1 − μ_m)/(1 + μ_e) [1].

    Examples
    --------
    >>> round(load_share(0.8), 4)
    0.1111
    """
    return (1.0 - gear_efficiency) / (1.0 + gear_efficiency)


def stall_torque(stall_current: Real, output_torque_constant: Real, coulomb_torque: Real,
                 load_friction_motor: Real = 0.0, load_friction_external: Real = 0.0) -> Real:
    """Return the torque against which a motor with a gear just still turns.

    Parameters
    ----------
    stall_current : float or array
        I_s = (V − V_d)/R, or what the source gives at most [A].
    output_torque_constant : float or array
        K_out = N k_a [N m/A].
    coulomb_torque : float or array
        τ_c = N F_c of a sliding gear, at the output [N m].
    load_friction_motor, load_friction_external : float or array
        K_m and K_e, both K_l for one share [1].

    Returns
    -------
    float or array
        T_s = ((1 − K_m) K_out I_s − τ_c)/(1 + K_e), the balance of motor, load and gear friction (M3, M5); 0 where
        friction holds the motor [N m].

    Notes
    -----
    With K_m = K_e = μ and τ_c = K_out I_0 (1 − μ) it is η_g K_out (I_s − I_0), as of `motor_from_sheet`.

    Examples
    --------
    >>> motor = motor_from_sheet(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=math.pi / 3 / 0.23,
    ...                          no_load_current=0.285)
    >>> mu = load_share(motor.gear_efficiency)
    >>> round(float(stall_torque(motor.stall_current, motor.output_torque_constant, motor.coulomb_torque, mu, mu)), 4)
    1.2945
    """
    K_m, K_e = load_friction_motor, load_friction_external
    T_s: Real = np.maximum(((1.0 - K_m) * output_torque_constant * stall_current - coulomb_torque) / (1.0 + K_e), 0.0)
    return T_s


def sheet_efficiency(supply_voltage: Real, stall_torque: Real, no_load_speed: Real, no_load_current: Real,
                     stall_current: Real, drop_voltage: Real = 0.4) -> Real:
    """Return the efficiency of the gear that four figures of a sheet imply together.

    Parameters
    ----------
    supply_voltage : float or array
        V [V].
    stall_torque : float or array
        T_s [N m].
    no_load_speed : float or array
        ω_0 [rad/s].
    no_load_current : float or array
        I_0, less than I_s [A].
    stall_current : float or array
        I_s [A].
    drop_voltage : float or array
        V_d [V].

    Returns
    -------
    float or array
        η_g = T_s ω_0 I_s/((V − V_d)(I_s − I_0)²); no gear has more than 1 [1].

    Notes
    -----
    It is least where nothing is lost at bridge and brushes (V_d = 0) and the motor idles without current (I_0 = 0):
    T_s ω_0/(V I_s), both ends of the speed-torque line over the power of the stalled motor.

    Examples
    --------
    >>> round(sheet_efficiency(6.0, 0.3432, math.pi / 3 / 0.15, 0.18, 0.8), 3)
    0.89
    """
    V, T_s, w_0, I_0, I_s, V_d = supply_voltage, stall_torque, no_load_speed, no_load_current, stall_current, \
        drop_voltage
    return T_s * w_0 * I_s / ((V - V_d) * (I_s - I_0) ** 2)


def stall_current_for(supply_voltage: Real, stall_torque: Real, no_load_speed: Real, no_load_current: Real,
                      gear_efficiency: Real = 1.0, drop_voltage: Real = 0.0, viscous_share: Real = 0.0) -> Real:
    """Return the stall current with which torque and speed have a given efficiency of the gear.

    Parameters
    ----------
    supply_voltage : float or array
        V [V].
    stall_torque : float or array
        T_s [N m].
    no_load_speed : float or array
        ω_0 [rad/s].
    no_load_current : float or array
        I_0 [A].
    gear_efficiency : float or array
        η_g; with 1 and no drop the result is the least current that can make the torque [1].
    drop_voltage : float or array
        V_d [V].
    viscous_share : float or array
        s [1].

    Returns
    -------
    float or array
        I_s, the root above I_0 of η_g (V − V_d)(I_s − I_0)(I_s − (1 − s) I_0) = T_s ω_0 I_s [A].

    Examples
    --------
    >>> round(stall_current_for(6.0, 0.3432, math.pi / 3 / 0.15, 0.18, 0.89, 0.4), 2)
    0.8
    """
    half = 0.5 * stall_torque * no_load_speed / (gear_efficiency * (supply_voltage - drop_voltage))
    I_0, s = no_load_current, viscous_share
    # with the middle m = half + (1 - s/2) I_0 of both roots, m² - (1 - s) I_0² without a difference of large numbers
    middle = half + (1.0 - 0.5 * s) * I_0
    return middle + (half * (half + (2.0 - s) * I_0) + (0.5 * s * I_0) ** 2) ** 0.5


def sheet_growth(lower_voltage: Real, upper_voltage: Real, drop_voltage: Real = 0.0,
                 current_ratio: Real = 0.0) -> Real:
    """Return by what factor stall torque and no-load speed grow from one supply voltage to a higher one.

    Parameters
    ----------
    lower_voltage, upper_voltage : float or array
        V_1 < V_2 [V].
    drop_voltage : float or array
        V_d [V].
    current_ratio : float or array
        ρ = I_0/I_s at the lower voltage, less than 1 [1].

    Returns
    -------
    float or array
        (V_2 − V_d − ρ (V_1 − V_d))/((1 − ρ)(V_1 − V_d)): what drop and friction take is the same at both voltages.
        Without them it is V_2/V_1, the least that a motor alone does [1].

    Examples
    --------
    >>> round(sheet_growth(4.8, 6.0), 3), round(sheet_growth(4.8, 6.0, 0.4, 0.2), 3)
    (1.25, 1.341)
    """
    U_1, U_2, rho = lower_voltage - drop_voltage, upper_voltage - drop_voltage, current_ratio
    return (U_2 - rho * U_1) / ((1.0 - rho) * U_1)
