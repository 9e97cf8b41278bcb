"""From a data sheet to a motor: what torque, speed and currents of a servo say about its parameters.

All at the output shaft, R = R_a + r_c + R_b in series, V_d the drop of bridge and brushes:

    I_s = (V − V_d)/R,    ω_0 = (V − V_d − R I_0)/K_out,    T_s = η_g K_out (I_s − I_0)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from servotwin.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class SheetMotor:
    """What a sheet says about the motor, seen at the output shaft.

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
        return 0.5 <= self.gear_efficiency <= 1.0


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
        I_0, running without load [A].
    stall_current : float, optional
        I_s [A].
    drop_voltage : float
        V_d, assumed 0.4 (0 to 0.4) [V].
    gear_efficiency : float
        η_g, assumed 0.8 (0.7 to 0.9), used where no stall current is given.

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
    if stall_current is not None:
        if stall_current <= no_load_current:
            raise ParameterError("sheet stall_current", got=stall_current,
                                 allowed=f"more than the no-load current {no_load_current:g} A")
        R, eta = U / stall_current, math.nan
    else:
        gap = 0.5 * stall_torque * no_load_speed / (gear_efficiency * no_load_current)
        x = U * U / (U + gap + math.sqrt(gap) * math.sqrt(gap + 2.0 * U))  # one over the larger root, times U²
        R, eta = x / no_load_current, gear_efficiency
    K_out = (U - R * no_load_current) / no_load_speed
    if stall_current is not None:
        eta = stall_torque / (K_out * (stall_current - no_load_current))
    mu_m = (1.0 - eta) / (1.0 + eta) if eta < 1.0 else 0.0
    return SheetMotor(resistance=R, output_torque_constant=K_out, stall_current=U / R, gear_efficiency=eta,
                      coulomb_torque=K_out * no_load_current * (1.0 - mu_m))
