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
from servotwin.models.engine import contacts
from servotwin.models.engine.modes import INSIDE, STUCK
from servotwin.models.terms.friction import NO_FRICTION
from servotwin.models.terms.numbers import at_temperature
from servotwin.physics.laws import array_form

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.base import Model
    from servotwin.models.samples import Samples
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]

_friction_torque, _holding_bounds, _at_temperature = (
    array_form(law, __name__) for law in (contacts.friction_torque, contacts.holding_bounds, at_temperature))


class Output(NamedTuple):
    """Unit, meaning and computation of a signal."""

    unit: str
    meaning: str
    compute: Callable[[Model, Samples, Pieces, Load], Array]


def warm_plant(model: Model, samples: Samples, load: Load) -> Numbers:
    """Return the plant at the temperatures of the samples."""
    plant = model.plant(load)
    if not np.any(plant.heat.C_w > 0.0):
        return plant
    return cast("Numbers", _at_temperature(plant, samples.winding, samples.housing))


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
    current = circuit_of(model, plant, samples, drive).armature_current
    tau = np.asarray(physics.electromagnetic_torque(current, plant.motor.K))
    external = load.external_torque(samples.time, samples.angle)
    w, contact_of = samples.speed, samples.contact
    on_gear = np.asarray(physics.torque_on_gear(external, w, plant.shaft.b_out))
    own, of_load = _friction_of(plant, contact_of, w, tau, on_gear, tau - external)
    acceleration = physics.shaft_acceleration(tau, w, own + of_load, external, plant.shaft.b, plant.shaft.J)
    if np.any(plant.play.half):
        inside = samples.mesh == INSIDE
        gear, dry = _without_dry_load(plant), plant._replace(friction=NO_FRICTION)
        own_inside, _ = _friction_of(gear, samples.motor, samples.motor_speed, tau, np.zeros_like(tau), tau)
        _, load_inside = _friction_of(dry, contact_of, w, np.zeros_like(tau), -external, -external)
        own, of_load = np.where(inside, own_inside, own), np.where(inside, load_inside, of_load)
        alone = physics.shaft_acceleration(0.0, w, of_load, external, plant.shaft.b_out, plant.shaft.J_out)
        acceleration = np.where(inside, alone, acceleration)
    return Torques(tau, own, of_load, external, np.where(contact_of >= STUCK, 0.0, acceleration))


def _friction_of(plant: Numbers, contact_of: Any, w: Array, tau_m: Array, tau_e: Array,
                 net: Array) -> tuple[Array, Array]:
    """Return the friction torques of servo and load [N m], against +q, where `net` is what they have to hold at rest.

    At rest friction takes what it has to hold, shared by servo and load in proportion to what each can hold (the
    sharing is assumed: statics does not tell); what remains then is carried by a stop.
    """
    sliding = _friction_torque(plant, contact_of, w, tau_m, tau_e)
    own = _friction_torque(_without_dry_load(plant), contact_of, w, tau_m, tau_e)
    low, high = _holding_bounds(plant, tau_m, tau_e)
    held = np.clip(net, -low, high)
    limit = np.where(held > 0.0, high, low)
    share = np.divide(plant.load.coulomb, limit, out=np.zeros_like(held), where=limit > 0.0)
    still = contact_of >= STUCK
    return np.where(still, held * (1.0 - share), own), np.where(still, held * share, sliding - own)


def _without_dry_load(plant: Numbers) -> Numbers:
    return plant._replace(load=plant.load._replace(coulomb=0.0))


def load_torque(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    """Return τ_L [N m], delivered to the load."""
    torques = torques_of(model, samples, drive, load)
    return np.asarray(physics.load_torque(torques.acceleration, samples.speed, torques.load_friction, torques.external,
                                          load.viscous_friction, model.load_inertia(load)))


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
    k_a = plant.motor.K / _reduction(model)
    return np.asarray(physics.electromagnetic_torque(
        circuit_of(model, plant, samples, drive).armature_current, k_a))


def _feedback(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
    sensor, (angles, errors) = model.plant(load).sensor, model.curve()
    if not angles and not np.any(sensor.step) and not np.any(sensor.half_slack):
        return np.asarray(physics.feedback_voltage(samples.angle, sensor.p, sensor.b_o))
    count = sensor.step if np.any(sensor.step) else None
    return np.asarray(physics.sensed_voltage(
        samples.wiper, sensor.p, sensor.b_o, angles or (0.0,), errors or (0.0,), count))


def _of_motor(name: str) -> Callable[[Model, Samples, Pieces, Load], Array]:
    """Angle or speed of the motor: that of the output but inside the play of a gear."""
    def compute(model: Model, samples: Samples, drive: Pieces, load: Load) -> Array:
        play = np.any(model.plant(load).play.half)
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
