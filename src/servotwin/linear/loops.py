"""A model where it is linear: its plant, in a loop with the voltage that its drive gives in the mean."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.errors import InputError, UnknownNameError
from servotwin.linear.plant import Plant, plant_of
from servotwin.models import DCMotor, GearedMotor, Model, PulseServo, PulseServoInductive

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.terms.numbers import Numbers

Array = NDArray[np.float64]
INPUT_UNITS = {"armature_voltage": "V", "command_voltage": "V", "pulse_width": "s", "command_angle": "rad"}
_INTEGRATOR = 1e-9  # of the fastest pole


class Row(NamedTuple):
    """How an output follows states and input."""

    of_state: Array
    of_input: float


class Loop(NamedTuple):
    """ẋ = A x + B u, with a row for each output; u is the input of this name."""

    input: str
    plant: Plant
    A: Array
    B: Array
    rows: dict[str, Row]


def loop_of(model: Model, load: Load, input: str | None, angle: float | None, frame_period: float | None) -> Loop:
    """Return the loop of a motor, a mean-voltage servo or the mean of a pulse servo: v_a = A k_s (v_c − p q)."""
    numbers = linear_numbers(model, load, frame_period)
    plant, name = plant_of(numbers, load, angle), input_name(model, input)
    p, gain = numbers.sensor.p, numbers.follower.gain
    told, feedback = input_gain(model, name) * gain, -gain * p * plant.angle
    rows = {each: Row(row.of_state + row.of_input * feedback, row.of_input * told)
            for each, row in _rows(model, plant, p).items()}
    return Loop(name, plant, plant.A + np.outer(plant.B, feedback), told * plant.B, rows)


def _rows(model: Model, plant: Plant, p: float) -> dict[str, Row]:
    """Return the outputs of a plant that an armature voltage drives."""
    N = 1.0 if isinstance(model, DCMotor) else model.value("gear.gear_reduction")
    rows = {"motor_angle": Row(N * plant.motor_angle, 0.0), "motor_speed": Row(N * plant.motor_speed, 0.0),
            "armature_current": Row(plant.current, plant.feedthrough)}
    if not isinstance(model, DCMotor):
        rows |= {"output_angle": Row(plant.angle, 0.0), "output_speed": Row(plant.angle @ plant.A, 0.0)}
    if "load_angle" in plant.states:
        rows["load_angle"] = Row(np.eye(len(plant.B))[plant.states.index("load_angle")], 0.0)
    if p > 0.0:
        rows["feedback_voltage"] = Row(p * plant.angle, 0.0)
    return rows


def slowest_decay(model: Model, load: Load) -> float:
    """Return by how much the slowest mode of the small-signal loop decays [1/s], an integrator apart."""
    poles = np.linalg.eigvals(loop_of(model, load, None, None, None).A)
    decay = -poles.real[np.abs(poles) > _INTEGRATOR * np.abs(poles).max()]
    return float(decay.min())


def is_motor(model: Model) -> bool:
    """Tell whether the model follows an armature voltage, and no command."""
    return isinstance(model, DCMotor | GearedMotor)


def input_name(model: Model, name: str | None) -> str:
    """Return the name, unless given the first of them; UnknownNameError unless it is a command that the model takes."""
    if name is None:
        return "armature_voltage" if is_motor(model) else "pulse_width"
    inputs = ("armature_voltage",) if is_motor(model) else ("command_voltage", "pulse_width", "command_angle")
    if model.endless:
        inputs = ("pulse_width",)
    if name not in inputs:
        raise UnknownNameError(f"input of {type(model).__name__}", name, inputs)
    return name


def linear_numbers(model: Model, load: Load, frame_period: float | None) -> Numbers:
    """Return the model's plant, with the mean gain of its pulses where it has any."""
    plant = model.pack(load)
    if isinstance(model, PulseServo | PulseServoInductive):
        return plant._replace(follower=plant.follower._replace(gain=model.mean_gain(frame_period)))
    return plant


def input_gain(model: Model, name: str) -> float:
    """Return the gain from a command to the voltage that the model compares with its feedback."""
    if is_motor(model):
        return 1.0
    zero, one = model.command_signal(name, np.array([0.0, 1.0]))  # the conversion is a straight line
    pulsed = isinstance(model, PulseServo | PulseServoInductive)  # they follow a width, which stands for a voltage
    return 1.0 / float(one - zero) / (model.value("electronics.one_shot_slope") if pulsed else 1.0)


def check_size(model: Model, name: str, mean: float, size: float) -> None:
    """Raise InputError if a sine of this input leaves the travel, or asks for pulses that the servo refuses."""
    if is_motor(model):
        return
    ends = np.array([model.command(signals.constant(value, unit=INPUT_UNITS[name])).table[0].value
                     for value in (mean - size, mean + size)])
    for signal, limits, what in (
            ("command_angle", ("stops.lower_angle", "stops.upper_angle"), "the travel"),
            ("pulse_width", ("electronics.pulse_width_min", "electronics.pulse_width_max"), "the pulses accepted")):
        reached = np.sort(model.command_signal(signal, ends))
        low, high = model.value_or(limits[0], -math.inf), model.value_or(limits[1], math.inf)
        if reached[0] < low - 1e-9 or reached[1] > high + 1e-9:
            raise InputError(
                f"amplitude {size:g} about {mean:g}", got=f"{signal} {reached[0]:.6g} to {reached[1]:.6g}",
                allowed=f"{low:.6g} to {high:.6g}, {what} of {model.servo.name} (SI)")
