"""Output signals: what each one is, from states at many times, by the array forms of what the engine observes.

Everything broadcasts: over n times, and over lanes and times (B, T) where numbers of the model are columns (B, 1).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from servotwin import physics
from servotwin.models.engine import observe
from servotwin.models.state.modes import FREE, RIGID, Mode, Vector
from servotwin.models.terms import duty
from servotwin.models.terms.bridge import heeds_silence, off_now
from servotwin.models.terms.numbers import at_temperature
from servotwin.physics.laws import array_form

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.columns import Samples
    from servotwin.models.engine.observe import Electrical, Torques
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]

_torques, _torques_of_two = (array_form(law, __name__) for law in (observe.torques, observe.torques_of_two))


class _Laws(NamedTuple):
    """Observed signals of the engine, as laws over numbers or over arrays."""

    electrical: Callable[..., Any]
    armature_current: Callable[..., Any]
    on_bus: Callable[..., Any]
    off_now: Callable[..., Any]
    at_temperature: Callable[..., Any]
    at_duty: Callable[..., Any]
    share_of: Callable[..., Any]
    on_share_of: Callable[..., Any]


_OF_NUMBERS = _Laws(observe.electrical, observe.armature_current, observe.on_bus, off_now, at_temperature, duty.at_duty,
              duty.share_of, duty.on_share_of)
_OVER_ARRAYS = _Laws(*(array_form(law, __name__) for law in _OF_NUMBERS))


def _laws(samples: Samples) -> _Laws:
    """Return the laws over arrays, which look for them in all that they are given; of one sample those over numbers."""
    return _OF_NUMBERS if _alone(samples) else _OVER_ARRAYS


def _alone(samples: Any) -> bool:
    """Tell whether samples are the numbers of a single one, which no annotation says."""
    return isinstance(samples.time, float)


def any_of(condition: Any) -> bool:
    """Tell whether something is so in any lane; of a number alone numpy takes a while to tell."""
    return condition if isinstance(condition, bool) else bool(np.any(condition))


class Shown(Protocol):
    """The demands of a signal on a model."""

    @property
    def requires(self) -> tuple[str, ...]:
        """Names of the parameters that it cannot do without."""

    def value(self, name: str) -> float:
        """Return a parameter, a number or a column of lanes."""

    def plant(self, load: Load) -> Numbers:
        """Return the numbers of servo and load."""

    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return angles and errors of the potentiometer's table."""

    def command_signal(self, name: str, drive: Array) -> Array:
        """Return the command as a voltage, an angle or a pulse width."""


class Output(NamedTuple):
    """Unit, meaning and computation of a signal."""

    unit: str
    meaning: str
    compute: Callable[[Shown, Samples, Pieces, Load], Array]


def warm_plant(model: Shown, samples: Samples, load: Load) -> Numbers:
    """Return the plant at the temperatures of the samples, and at their duty."""
    plant = model.plant(load)
    if any_of(plant.heat.C_w > 0.0):
        plant = cast("Numbers", _laws(samples).at_temperature(plant, samples.winding, samples.housing))
    return cast("Numbers", _laws(samples).at_duty(plant, samples.duty)) if _digital(plant) else plant


def electrical_of(plant: Numbers, samples: Samples, drive: Pieces) -> Electrical:
    """Return what happens electrically; each array broadcasts to shape (n,). `plant` is at their temperatures."""
    return _shown(plant, samples, _laws(samples).electrical(*_circuit(plant, samples, drive)))


def _shown(plant: Numbers, samples: Samples, found: Electrical) -> Electrical:
    """Return what happens electrically with voltage and current of the supply before the duty of the bridge."""
    if not _digital(plant):
        return found
    share = _laws(samples).share_of(plant.bridge, samples.duty)
    return found._replace(bus_voltage=found.bus_voltage / share, supply_current=found.supply_current * share)


def _digital(plant: Numbers) -> bool:
    return any_of(plant.bridge.pwm > 0.0)


def _circuit(plant: Numbers, samples: Samples, drive: Pieces) -> tuple[Numbers, Any, Any, Any, Any]:
    """Return what the electrical side is asked with; fields that do not count are not looked at."""
    i = samples.current if any_of(plant.motor.L > 0.0) else 0.0
    if not any_of(plant.source.V > 0.0):
        u = drive(samples.time)
        return plant, float(u) if _alone(samples) else u, samples.angle, samples.speed, i
    if not _digital(plant) and any_of(heeds_silence(plant.bridge)):
        plant = plant._replace(bridge=_laws(samples).off_now(plant.bridge, samples.silent))
    shared = getattr(samples, "bus", None)
    if shared is not None:
        share = _laws(samples).share_of(plant.bridge, samples.duty) if _digital(plant) else 1.0
        plant = _laws(samples).on_bus(plant, shared * share)
    w = motor_speed_of(plant, samples)
    return plant, samples.drive * plant.source.V, 0.0, w, i


def _apart(plant: Numbers) -> bool:
    """Tell whether the motor may turn otherwise than the output: in a gear with play, or in an elastic one."""
    return any_of(plant.play.half != 0.0) or (any_of(plant.elastic.k != 0.0) and not any_of(plant.elastic.J != 0.0))


def motor_speed_of(plant: Numbers, samples: Samples) -> Array:
    """Return the speed of the motor at the output shaft [rad/s]."""
    return samples.motor_speed if _apart(plant) else samples.speed


def torques_of(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Torques:
    """Return all torques that act at the output shaft; each array broadcasts to shape (n,)."""
    plant, w = warm_plant(model, samples, load), samples.speed
    i = _laws(samples).armature_current(*_circuit(plant, samples, drive))
    external = load.external_torque(samples.time, samples.angle)
    mode: Any = Mode(0, cast("Any", samples.contact), RIGID, FREE, 0)
    if not any_of(plant.play.half != 0.0) and not any_of(plant.elastic.k != 0.0):
        return cast("Torques", _torques(plant, mode, w, w, i, external))
    mode = mode._replace(mesh=samples.mesh, motor=samples.motor)
    if any_of(plant.elastic.k != 0.0):
        y: Any = (samples.angle, w, 0.0, 0.0, 0.0, samples.motor_angle, samples.motor_speed)
        return cast("Torques", _torques_of_two(plant, mode, Vector(*y), i, external))
    return cast("Torques", _torques(plant, mode, w, samples.motor_speed, i, external))


def _load_torque(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
    return cast("Array", torques_of(model, samples, drive, load).load)


def _reduction(model: Shown) -> float:
    return model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0


def _electrical_signal(name: str) -> Callable[[Shown, Samples, Pieces, Load], Array]:
    def compute(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
        plant, u, q, w, i = _circuit(warm_plant(model, samples, load), samples, drive)
        values = getattr(_shown(plant, samples, _laws(samples).electrical(plant, u, q, w, i)), name)
        if _alone(samples):
            return values  # type: ignore[no-any-return]
        return np.broadcast_to(values, np.broadcast_shapes(np.shape(values), np.shape(w)))
    return compute


def _current(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
    plant = warm_plant(model, samples, load)
    current: Array = _laws(samples).armature_current(*_circuit(plant, samples, drive))
    return current / _laws(samples).on_share_of(plant.bridge, samples.duty) if _digital(plant) else current


def _motor_torque(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
    plant = warm_plant(model, samples, load)
    k_a = plant.motor.K / _reduction(model)
    i = _laws(samples).armature_current(*_circuit(plant, samples, drive))
    return np.asarray(physics.electromagnetic_torque(i, k_a))


def _feedback(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
    sensor, (angles, errors) = model.plant(load).sensor, model.curve()
    if not angles and not any_of(sensor.step != 0.0) and not any_of(sensor.half_slack != 0.0):
        return np.asarray(physics.feedback_voltage(samples.angle, sensor.p, sensor.b_o))
    count = sensor.step if any_of(sensor.step != 0.0) else None
    return np.asarray(physics.sensed_voltage(
        samples.wiper, sensor.p, sensor.b_o, angles or (0.0,), errors or (0.0,), count))


def _of_motor(name: str) -> Callable[[Shown, Samples, Pieces, Load], Array]:
    """Angle or speed of the motor: that of the output but in a gear with play or an elastic one."""
    def compute(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
        values: Array = getattr(samples, f"motor_{name}" if _apart(model.plant(load)) else name)
        return np.asarray(physics.motor_from_output(values, _reduction(model)))
    return compute


def _load_angle(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
    """Angle of the body behind an elastic shaft; that of the output where there is none."""
    return samples.motor_angle if any_of(model.plant(load).elastic.J != 0.0) else samples.angle


def _commanded(name: str) -> Callable[[Shown, Samples, Pieces, Load], Array]:
    def compute(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
        return model.command_signal(name, drive(samples.time))
    return compute


# Signals that are a field of the samples as it is
FIELDS = {"output_angle": "angle", "output_speed": "speed", "error_time": "error", "drive": "drive",
          "goal_angle": "goal", "reference_angle": "reference", "trip": "trip", "winding_temperature": "winding",
          "housing_temperature": "housing"}


def _sampled(name: str) -> Callable[[Shown, Samples, Pieces, Load], Array]:
    def compute(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
        values: Array = getattr(samples, FIELDS[name])
        return values
    return compute


def _duty(model: Shown, samples: Samples, drive: Pieces, load: Load) -> Array:
    d = cast("Array", samples.duty)
    return np.where(np.abs(d) <= 1.0, d, 0.0)


PLAIN = ("armature_voltage", "armature_current", "motor_torque", "bus_voltage", "supply_current", "feedback_voltage")
"""Signals that do not ask for the mode, and are the same to the last bit of samples that are numbers, not arrays."""

SIGNALS: dict[str, Output] = {
    "command_voltage": Output("V", "voltage command v_i", _commanded("command_voltage")),
    "command_angle": Output("rad", "angle that the command asks for", _commanded("command_angle")),
    "pulse_width": Output("s", "pulse width t_a of the command", _commanded("pulse_width")),
    "error_time": Output("s", "error e that the chip has decided on last", _sampled("error_time")),
    "drive": Output("1", "how the bridge drives: -1, 0 or +1", _sampled("drive")),
    "duty": Output("1", "duty of the bridge, 0 where torque is off", _duty),
    "goal_angle": Output("rad", "angle that the servo goes to; its own before it has a goal", _sampled("goal_angle")),
    "reference_angle": Output("rad", "angle that its profile asks for now", _sampled("reference_angle")),
    "trip": Output("1", "which protection acts: 0 none, 1 overload, 2 current, 3 heat, 4 undervoltage",
                   _sampled("trip")),
    "armature_voltage": Output("V", "voltage v_a at the motor", _electrical_signal("armature_voltage")),
    "armature_current": Output("A", "current i_a through the motor", _current),
    "motor_angle": Output("rad", "motor shaft angle q_m", _of_motor("angle")),
    "motor_speed": Output("rad/s", "motor shaft speed", _of_motor("speed")),
    "motor_torque": Output("N m", "electromagnetic torque τ_o = k_a i_a", _motor_torque),
    "output_angle": Output("rad", "output shaft angle q", _sampled("output_angle")),
    "output_speed": Output("rad/s", "output shaft speed", _sampled("output_speed")),
    "load_angle": Output("rad", "angle of the load behind an elastic shaft", _load_angle),
    "load_torque": Output("N m", "torque τ_L delivered to the load", _load_torque),
    "feedback_voltage": Output("V", "potentiometer voltage v_o", _feedback),
    "bus_voltage": Output("V", "voltage of the supply under load", _electrical_signal("bus_voltage")),
    "supply_current": Output("A", "current that the supply gives", _electrical_signal("supply_current")),
    "winding_temperature": Output("K", "temperature of the winding", _sampled("winding_temperature")),
    "housing_temperature": Output("K", "temperature of the housing", _sampled("housing_temperature")),
}
