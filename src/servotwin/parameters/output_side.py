"""Numbers of motor and gear as the output shaft sees them, where only they matter: N and k_a act as their product."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from servotwin.parameters.servo import Servo

N = "gear.gear_reduction"


class OutputSide(NamedTuple):
    """A number at the output shaft.

    Parameters
    ----------
    members : tuple of str
        Dotted names of what stands for it at the motor shaft.
    power : int
        Of N that leads from there to the output.
    dimension : str
        Of `servotwin.units`.
    meaning : str
    """

    members: tuple[str, ...]
    power: int
    dimension: str
    meaning: str


OUTPUT_SIDE: dict[str, OutputSide] = {
    "output_torque_constant": OutputSide(
        ("motor.torque_constant", "motor.back_emf_constant"), 1, "torque per current", "K_out = N k_a, k_b equal"),
    "output_inertia": OutputSide(("motor.rotor_inertia",), 2, "inertia", "N² J_m"),
    "output_viscous_friction": OutputSide(("motor.motor_viscous_friction",), 2, "torque per speed", "N² B_m"),
    "output_coulomb_torque": OutputSide(
        ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward"), 1, "torque", "N F_c, both ways"),
    "output_coulomb_torque_forward": OutputSide(("friction.coulomb_torque_forward",), 1, "torque", "N F_ec1"),
    "output_coulomb_torque_backward": OutputSide(("friction.coulomb_torque_backward",), 1, "torque", "N F_ec2"),
    "output_stribeck_speed": OutputSide(("friction.stribeck_speed",), -1, "output speed", "v_s/N"),
}
"""By name. What moves at the output stays the same when N changes and these do not."""


def output_value(servo: Servo, name: str) -> float | None:
    """Return a number at the output shaft (SI), the mean where it has several members; None where one is missing.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(output_value(load_servo("hitec-hs-755hb"), "output_torque_constant"), 4)
    1.0396
    """
    side = OUTPUT_SIDE[name]
    found = [servo.get(member) for member in side.members]
    reduction = servo.get(N)
    if any(not isinstance(value, int | float) for value in (*found, reduction)):
        return None
    return float(np.mean(np.array(found, dtype=np.float64))) * float(reduction) ** side.power  # type: ignore[arg-type]


def motor_side(values: Mapping[str, Any], reduction: Any) -> dict[str, Any]:
    """Return the members (SI, dotted names) of numbers at the output shaft; numbers or arrays.

    Parameters
    ----------
    values : mapping
        By name in `OUTPUT_SIDE` (SI).
    reduction : float or array
        N [1].

    Examples
    --------
    >>> motor_side({"output_inertia": 8.0}, 2.0)
    {'motor.rotor_inertia': 2.0}
    """
    return {member: value / reduction**OUTPUT_SIDE[name].power
            for name, value in values.items() for member in OUTPUT_SIDE[name].members}
