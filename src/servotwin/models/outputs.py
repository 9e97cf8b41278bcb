"""Output signals: what each one is, from states at many times, by the laws of `physics`.

Everything broadcasts: over n times, and over lanes and times (B, T) where numbers of the model are columns (B, 1).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin import physics
from servotwin.models.circuit import circuit_of
from servotwin.models.kernels.plant import BACKWARD, FORWARD, INSIDE, STUCK, at_temperature

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.base import Model
    from servotwin.models.kernels.plant import Plant
    from servotwin.models.samples import Samples
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]


class Output(NamedTuple):
    """Unit, meaning and computation of a signal."""

    unit: str
    meaning: str
    compute: Callable[[Model, Samples, Pieces, Load], Array]


def warm_plant(model: Model, samples: Samples, load: Load) -> Plant:
    """Return the plant at the temperatures of the samples."""
    plant = model.plant(load)
    if not np.any(plant.C_w > 0.0):
        return plant
    T_w, T_h = cast("Any", samples.winding), cast("Any", samples.housing)
    return at_temperature(plant, T_w, T_h)


class Torques(NamedTuple):
    """The torques at the output shaft [N m] and its acceleration [rad/s²], each of shape (n,)."""

    motor: Array
    servo_friction: Array
    load_friction: Array
    external: Array
    acceleration: Array


def torques_of(model: Model, samples: Samples, drive: Pieces, load: Load) -> Torques:
    """Return all torques that act at the output shaft."""
    plant = warm_plant(model, samples, load)
    drive_torque = plant.K * circuit_of(model, plant, samples, drive).armature_current
    external = load.external_torque(samples.time, samples.angle)
    still = samples.contact >= STUCK
    if not np.any(plant.half_play):
        own, of_load = friction_of(plant, samples, drive_torque, external)
        acceleration = (drive_torque - plant.b * samples.speed - own - of_load - external) / plant.J
        return Torques(drive_torque, own, of_load, external, np.where(still, 0.0, acceleration))
    inside = samples.mesh == INSIDE
    own, of_load = friction_of(plant, samples, drive_torque, external)
    own_inside = _sliding_or_held(samples.motor, gear_budgets(plant, samples.motor_speed, drive_torque, 0.0),
                                  drive_torque)
    load_inside = _sliding_or_held(samples.contact, (plant.coulomb, plant.coulomb), -external)
    own, of_load = np.where(inside, own_inside, own), np.where(inside, load_inside, of_load)
    together = (drive_torque - plant.b * samples.speed - own - of_load - external) / plant.J
    alone = (-external - plant.b_out * samples.speed - of_load) / np.where(plant.J_out > 0.0, plant.J_out, 1.0)
    return Torques(drive_torque, own, of_load, external, np.where(still, 0.0, np.where(inside, alone, together)))


def gear_budgets(plant: Plant, speed: Array, motor_torque: Array, external: Array | float) -> tuple[Array, Array]:
    """Return the gear's friction backward and forward [N m]; `external` is what acts on the gear towards +q [N m]."""
    at_rest = np.asarray(speed) == 0.0
    if not np.any(plant.varies):
        r = np.where(at_rest, plant.breakaway, 1.0)
        return plant.F_backward * r, plant.F_forward * r
    w_s = np.where(np.asarray(plant.w_s) > 0.0, plant.w_s, 1e-300)  # static friction ends at once
    backward, forward = (np.asarray(physics.gear_friction_budget(
        speed, motor_torque, external, coulomb_torque=F, breakaway_ratio=plant.breakaway, stribeck_speed=w_s,
        stribeck_exponent=plant.alpha, load_friction_motor=plant.K_m, load_friction_external=plant.K_e,
        load_friction_motor_stribeck=plant.K_ms, load_friction_external_stribeck=plant.K_es,
        load_friction_motor_quad=plant.K_mq, load_friction_external_quad=plant.K_eq))
        for F in (plant.F_backward, plant.F_forward))
    return backward, forward


def _sliding_or_held(contact: Any, budgets: tuple[Any, Any], net: Array) -> Array:
    """Return the friction against +q of a body with these budgets, on which `net` acts [N m]."""
    backward, forward = budgets
    sliding = np.where(contact == FORWARD, forward, np.where(contact == BACKWARD, -backward, 0.0))
    return np.where(contact >= STUCK, np.clip(net, -backward, forward), sliding)


def friction_of(plant: Plant, samples: Samples, drive: Array, external: Array) -> tuple[Array, Array]:
    """Return the friction torques of servo and load [N m], against +q, of motor and output as one body.

    At rest friction takes what it has to hold, shared by servo and load in proportion to what each can hold (the
    sharing is assumed: statics does not tell); what remains then is carried by a stop.
    """
    w = samples.speed
    if np.any(plant.kappa > 0.0):
        own = physics.smoothed_coulomb_torque(w, plant.F_forward, plant.F_backward, plant.kappa)
        return np.asarray(own), plant.coulomb * np.tanh(plant.kappa * w)
    low, high = gear_budgets(plant, w, drive, -external - plant.b_out * w)
    both = _sliding_or_held(samples.contact, (low + plant.coulomb, high + plant.coulomb), drive - external)
    limit = np.where(both > 0.0, high, low) + plant.coulomb
    share = np.divide(plant.coulomb, limit, out=np.zeros_like(both), where=limit > 0.0)
    return both * (1.0 - share), both * share


def load_torque(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    """Return τ_L [N m], delivered to the load: J_L q̈ + B_L q̇ + its friction + τ_ext (physics, eq. 16 and 23)."""
    torques = torques_of(model, samples, drive, load)
    return (model.load_inertia(load) * torques.acceleration + load.viscous_friction * samples.speed
            + torques.load_friction + torques.external)


def _reduction(model: Model) -> float:
    return model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0


def _electrical(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        values: Array = getattr(circuit_of(model, warm_plant(model, samples, load), samples, drive), name)
        return values
    return compute


def _current(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    return circuit_of(model, warm_plant(model, samples, load), samples, drive).armature_current


def _motor_torque(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    plant = warm_plant(model, samples, load)
    k_a = plant.K / _reduction(model)
    return np.asarray(physics.electromagnetic_torque(
        circuit_of(model, plant, samples, drive).armature_current, k_a))


def _feedback(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    plant, (angles, errors) = model.plant(load), model.curve()
    count: Any = model.value_or("potentiometer.quantisation", 0.0) if np.any(plant.V > 0.0) else 0.0
    if not angles and not np.any(count) and not np.any(plant.half_slack):
        return np.asarray(physics.feedback_voltage(samples.angle, plant.p, plant.b_o))
    return np.asarray(physics.sensed_voltage(
        samples.wiper, plant.p, plant.b_o, angles or (0.0,), errors or (0.0,), count if np.any(count) else None))


def _of_motor(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    """Angle or speed of the motor: that of the output but inside the play of a gear."""
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        play = np.any(model.plant(load).half_play)
        values: Array = getattr(samples, f"motor_{name}" if play else name)
        return np.asarray(physics.motor_from_output(values, _reduction(model)))
    return compute


def _commanded(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        return model.command_signal(name, drive(samples.time))
    return compute


# Signals that are a field of the samples as it is
FIELDS = {"output_angle": "angle", "output_speed": "speed", "error_time": "error", "drive": "drive",
          "winding_temperature": "winding", "housing_temperature": "housing"}


def _sampled(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        values: Array = getattr(samples, FIELDS[name])
        return values
    return compute


SIGNALS: dict[str, Output] = {
    "command_voltage": Output("V", "voltage command v_i", _commanded("command_voltage")),
    "command_angle": Output("rad", "angle that the command asks for", _commanded("command_angle")),
    "pulse_width": Output("s", "pulse width t_a of the command", _commanded("pulse_width")),
    "error_time": Output("s", "error e that the chip has decided on last", _sampled("error_time")),
    "drive": Output("1", "how the bridge drives: -1, 0 or +1", _sampled("drive")),
    "armature_voltage": Output("V", "voltage v_a at the motor", _electrical("armature_voltage")),
    "armature_current": Output("A", "current i_a through the motor", _electrical("armature_current")),
    "motor_angle": Output("rad", "motor shaft angle q_m", _of_motor("angle")),
    "motor_speed": Output("rad/s", "motor shaft speed", _of_motor("speed")),
    "motor_torque": Output("N m", "electromagnetic torque τ_o = k_a i_a", _motor_torque),
    "output_angle": Output("rad", "output shaft angle q", _sampled("output_angle")),
    "output_speed": Output("rad/s", "output shaft speed", _sampled("output_speed")),
    "load_torque": Output("N m", "torque τ_L delivered to the load", load_torque),
    "feedback_voltage": Output("V", "potentiometer voltage v_o", _feedback),
    "bus_voltage": Output("V", "voltage of the supply under load", _electrical("bus_voltage")),
    "supply_current": Output("A", "current that the supply gives", _electrical("supply_current")),
    "winding_temperature": Output("K", "temperature of the winding", _sampled("winding_temperature")),
    "housing_temperature": Output("K", "temperature of the housing", _sampled("housing_temperature")),
}
