"""What a pulse servo's plant has beyond motor and shaft: the source, the gear, the sensor's play, the heat.

Each function gives fields of `terms.plant.Plant`; numbers may be columns, one per lane.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.parameters.groups import Relation
from servotwin.physics.thermal import REFERENCE_TEMPERATURE

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.base import Model

_SHARES = {"K_m": "motor", "K_e": "external", "K_ms": "motor_stribeck", "K_es": "external_stribeck",
           "K_mq": "motor_quad", "K_eq": "external_quad"}


def source_numbers(model: Model, coasts: Any) -> dict[str, Any]:
    """Return what drives the current through a switched bridge, and what it meets there."""
    R_a, R_b = model.value("motor.armature_resistance"), model.value_or("supply.internal_resistance", 0.0)
    r_c = model.value_or("supply.bridge_drop_resistance", 0.0)
    V_oc, V_ce0 = model.value("supply.open_circuit_voltage"), model.value_or("supply.bridge_drop_voltage", 0.0)
    V_br, I_max = model.value_or("motor.brush_drop_voltage", 0.0), model.value_or("supply.current_limit", math.inf)
    returns = R_b * coasts if np.all(np.isinf(I_max)) else 0.0  # a regulator keeps its voltage
    return {"V": V_oc, "D_drive": V_ce0 + V_br, "R_drive": R_a + r_c + R_b, "D_off": V_br + coasts * (V_oc + V_ce0),
            "R_off": R_a + returns, "R_b": R_b, "I_max": I_max}


def gear_numbers(model: Model, load: Load) -> dict[str, Any]:
    """Return what the friction of the gear follows, and the play.

    Raises
    ------
    ParameterError
        If there is play without inertia behind it.
    """
    share, static = (model.value_or(f"friction.load_friction{name}", 0.0) for name in ("", "_stribeck"))
    numbers: dict[str, Any] = {
        field: model.value_or(f"friction.load_friction_{name}", 0.0) for field, name in _SHARES.items()}
    numbers["K_m"], numbers["K_e"] = numbers["K_m"] + share, numbers["K_e"] + share
    numbers["K_ms"], numbers["K_es"] = numbers["K_ms"] + static, numbers["K_es"] + static
    w_s = model.value_or("friction.stribeck_speed", 0.0) / model.value("gear.gear_reduction")
    fades = (w_s > 0.0) & (np.asarray(model.value_or("friction.breakaway_ratio", 1.0)) > 1.0)
    varies = np.asarray(fades | np.any([np.asarray(x) != 0.0 for x in np.broadcast_arrays(*numbers.values())], axis=0))
    play = model.value_or("gear.backlash", 0.0)
    has_body = np.asarray((np.asarray(play) == 0.0) | (np.asarray(model.load_inertia(load)) > 0.0)).ravel()
    Relation("gear.backlash", has_body if has_body.size > 1 else bool(has_body[0]), np.broadcast_to(
        np.ravel(play), has_body.shape) if has_body.size > 1 else play,
        "play only with inertia behind it: gear.output_inertia, or a load that has some").check()
    return numbers | {"w_s": w_s, "alpha": model.value_or("friction.stribeck_exponent", 1.0),
                      "varies": np.where(varies, 1.0, 0.0) if varies.ndim else float(varies),
                      "half_play": 0.5 * play}


def thermal_numbers(model: Model) -> dict[str, Any]:
    """Return the two thermal masses; nothing where the servo does not give them."""
    C_w = model.value_or("thermal.winding_capacity", 0.0)
    T_amb = model.value_or("thermal.ambient", REFERENCE_TEMPERATURE)
    if model.servo.get("thermal.winding_capacity") is None:
        return {"T_amb": T_amb}
    return {"C_w": C_w, "C_h": model.value("thermal.housing_capacity"), "T_amb": T_amb,
            "G_wh": 1.0 / model.value("thermal.winding_to_housing"),
            "G_ha": 1.0 / model.value("thermal.housing_to_ambient"),
            "magnet": model.value_or("thermal.magnet_coefficient", 0.0)}


def sensor_numbers(model: Model) -> dict[str, Any]:
    """Return the play of the potentiometer, at whose ends turns of the shaft count."""
    return {"half_slack": 0.5 * model.value_or("potentiometer.backlash", 0.0)}
