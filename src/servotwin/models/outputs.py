"""Output signals: what each one is, from states at many times, by the laws of `physics`.

Everything broadcasts: over n times, and over lanes and times (B, T) where numbers of the model are columns (B, 1).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.circuit import circuit_of
from servotwin.models.kernels import hybrid
from servotwin.physics import friction, gear, motor, potentiometer

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.base import Model
    from servotwin.models.kernels.hybrid import Plant
    from servotwin.models.samples import Samples
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]


class Output(NamedTuple):
    """Unit, meaning and computation of a signal."""

    unit: str
    meaning: str
    compute: Callable[[Model, Samples, Pieces, Load], Array]


def friction_of(plant: Plant, samples: Samples, net: Array) -> tuple[Array, Array]:
    """Return the friction torques of servo and load [N m], against +q; `net` is N k_a i − τ_ext [N m].

    At rest friction takes what it has to hold, shared by servo and load in proportion to what each can hold (the
    sharing is assumed: statics does not tell); what remains then is carried by a stop.
    """
    w = samples.speed
    if np.any(plant.kappa > 0.0):
        own = friction.smoothed_coulomb_torque(w, plant.F_forward, plant.F_backward, plant.kappa)
        return np.asarray(own), plant.coulomb * np.tanh(plant.kappa * w)
    forward, backward = samples.contact == hybrid.FORWARD, samples.contact == hybrid.BACKWARD
    own = np.where(forward, plant.F_forward, np.where(backward, -plant.F_backward, 0.0))
    of_load = np.where(forward, plant.coulomb, np.where(backward, -plant.coulomb, 0.0))
    low, high = hybrid.holding_bounds(plant)
    held = np.clip(net, -low, high)
    limit = np.where(held > 0.0, high, low)
    share = np.divide(plant.coulomb, limit, out=np.zeros_like(held), where=limit > 0.0)
    still = samples.contact >= hybrid.STUCK
    return np.where(still, held * (1.0 - share), own), np.where(still, held * share, of_load)


class Torques(NamedTuple):
    """The torques at the output shaft [N m] and its acceleration [rad/s²], each of shape (n,)."""

    motor: Array
    servo_friction: Array
    load_friction: Array
    external: Array
    acceleration: Array


def torques_of(model: Model, samples: Samples, drive: Pieces, load: Load) -> Torques:
    """Return all torques that act at the output shaft."""
    plant = model.pack(load)
    drive_torque = plant.K * circuit_of(model, plant, samples, drive).armature_current
    external = load.external_torque(samples.time, samples.angle)
    own, of_load = friction_of(plant, samples, drive_torque - external)
    acceleration = (drive_torque - plant.b * samples.speed - own - of_load - external) / plant.J
    still = samples.contact >= hybrid.STUCK
    return Torques(drive_torque, own, of_load, external, np.where(still, 0.0, acceleration))


def load_torque(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    """Return τ_L [N m], delivered to the load: J_L q̈ + B_L q̇ + its friction + τ_ext (physics, eq. 16 and 23)."""
    torques = torques_of(model, samples, drive, load)
    return (model.load_inertia(load) * torques.acceleration + load.viscous_friction * samples.speed
            + torques.load_friction + torques.external)


def _reduction(model: Model) -> float:
    return model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0


def _electrical(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        values: Array = getattr(circuit_of(model, model.pack(load), samples, drive), name)
        return values
    return compute


def _current(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    return circuit_of(model, model.pack(load), samples, drive).armature_current


def _motor_torque(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    return np.asarray(motor.electromagnetic_torque(
        _current(model, samples, drive, load), model.value("motor.torque_constant")))


def _feedback(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    plant = model.pack(load)
    return np.asarray(potentiometer.feedback_voltage(samples.angle, plant.p, plant.b_o))


def _commanded(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        return model.command_signal(name, drive(samples.time))
    return compute


# Signals that are a field of the samples as it is
FIELDS = {"output_angle": "angle", "output_speed": "speed", "error_time": "error", "drive": "drive"}


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
    "motor_angle": Output("rad", "motor shaft angle q_m", lambda model, samples, drive, load: np.asarray(
        gear.motor_from_output(samples.angle, _reduction(model)))),
    "motor_speed": Output("rad/s", "motor shaft speed", lambda model, samples, drive, load: np.asarray(
        gear.motor_from_output(samples.speed, _reduction(model)))),
    "motor_torque": Output("N m", "electromagnetic torque τ_o = k_a i_a", _motor_torque),
    "output_angle": Output("rad", "output shaft angle q", _sampled("output_angle")),
    "output_speed": Output("rad/s", "output shaft speed", _sampled("output_speed")),
    "load_torque": Output("N m", "torque τ_L delivered to the load", load_torque),
    "feedback_voltage": Output("V", "potentiometer voltage v_o", _feedback),
    "bus_voltage": Output("V", "voltage of the supply under load", _electrical("bus_voltage")),
    "supply_current": Output("A", "current that the supply gives", _electrical("supply_current")),
}
