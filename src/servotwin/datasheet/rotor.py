"""The rotor beside the sheet: how long a servo takes to speed up, and whether that can be true."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.parameters import printed_points
from servotwin.parameters.output_side import output_value

if TYPE_CHECKING:
    from servotwin.parameters import Servo


def time_constant_of(servo: Servo) -> float | None:
    """Return the mechanical time constant τ_m = J R/K_out² [s], of rotor and circuit; None where a number is missing.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(time_constant_of(load_servo("hitec-hs-755hb")), 4)
    0.0169
    """
    K_out, J = output_value(servo, "output_torque_constant"), output_value(servo, "output_inertia")
    R_a, supply = servo.motor.armature_resistance, servo.supply
    if K_out is None or J is None or R_a is None:
        return None
    R = R_a + (supply.bridge_drop_resistance or 0.0) + (supply.internal_resistance or 0.0)
    return J * R / K_out**2


def slow_rotor(servo: Servo) -> str | None:
    """Return that a rotor takes longer to speed up than the sheet prints for 60°, in words; None where it does not.

    The time is that of the voltage nearest the servo's own.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> heavy = load_servo("hitec-hs-755hb").replace({"motor.rotor_inertia": 2e-6})
    >>> slow_rotor(heavy)
    'rotor: time constant 441.2 ms, longer than the 230 ms that are printed for 60 deg'
    """
    tau, own = time_constant_of(servo), servo.supply.open_circuit_voltage
    printed = [point for point in printed_points(servo) if point.time_60 and point.supply_voltage is not None]
    if tau is None or own is None or not printed:
        return None
    time_60 = float(min(printed, key=lambda point: abs(float(point.supply_voltage or 0.0) - own)).time_60 or 0.0)
    if tau <= time_60:
        return None
    return (f"rotor: time constant {1e3 * tau:.4g} ms, longer than the {1e3 * time_60:.3g} ms that are printed for "
            "60 deg")
