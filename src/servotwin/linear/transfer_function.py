"""Transfer functions of the models where they are linear, as named python-control systems."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.errors import LoadError, UnknownNameError
from servotwin.loads import as_load
from servotwin.models import DCMotor, GearedMotor
from servotwin.models.kernels.plant import Plant
from servotwin.physics.pieces import constant_pieces
from servotwin.signals import Signal

if TYPE_CHECKING:
    from collections.abc import Mapping

    import control
    from numpy.typing import NDArray

    from servotwin.loads import Load, Part
    from servotwin.models import Model

_INPUT_UNITS = {"armature_voltage": "V", "command_voltage": "V", "pulse_width": "s"}


def transfer_function(model: Model, *, input: str | None = None, output: str | None = None,
                      load: Load | Part | None = None) -> control.TransferFunction:
    """Return the transfer function from a command to a signal, dry friction apart.

    For the motors this is (15) and (22) of the paper. For a servo it is the small-signal response where the bridge
    neither saturates nor rests in the deadband: the motor of (22) in the loop of (38).

    Parameters
    ----------
    model : Model
    input : str, optional
        `armature_voltage` [V] for motors; `command_voltage` [V], `pulse_width` [s] or `command_angle` [rad] for
        servos. Unless given: `armature_voltage`, `pulse_width`.
    output : str, optional
        `motor_angle`, `motor_speed`, `armature_current`, and behind a gear `output_angle`, `output_speed`; for
        servos `feedback_voltage` too. Unless given: the angle of the model's own state.
    load : Load, optional
        Inertia, viscous friction and springs count; a pendulum counts by its stiffness m g l where it hangs.

    Returns
    -------
    control.TransferFunction
        With the signal names as `input_labels` and `output_labels`; SI.

    Raises
    ------
    UnknownNameError
        If the model has no such input or output.
    LoadError
        If the load holds several pendulums that do not hang the same way.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.servo_from_values("ideal", {"motor": {
    ...     "armature_resistance": 2.0, "armature_inductance": 0.5, "torque_constant": 0.1, "back_emf_constant": 0.1,
    ...     "rotor_inertia": 0.02, "motor_viscous_friction": 0.2}})
    >>> float(transfer_function(st.DCMotor(servo)).dcgain())
    inf
    """
    import control

    load = as_load(load)
    plant = model.pack(load)
    motor = isinstance(model, DCMotor | GearedMotor)
    inputs = ("armature_voltage",) if motor else ("command_voltage", "pulse_width", "command_angle")
    name_in = input or ("armature_voltage" if motor else "pulse_width")
    if name_in not in inputs:
        raise UnknownNameError(f"input of {type(model).__name__}", name_in, inputs)
    outputs = _numerators(model, plant, _stiffness(plant, load))
    name_out = output or model.layout[0]
    if name_out not in outputs:
        raise UnknownNameError(f"output of {type(model).__name__}", name_out, tuple(outputs))
    numerator = _input_gain(model, plant, name_in) * plant.gain * outputs[name_out]
    system: Any = control.TransferFunction(
        np.trim_zeros(numerator, "f"), np.trim_zeros(_denominator(plant, _stiffness(plant, load)), "f"),
        inputs=[name_in], outputs=[name_out], name=type(model).__name__)
    return system


def _stiffness(plant: Plant, load: Load) -> float:
    if len({p.hanging_angle for p in load.pendulums}) > 1:
        raise LoadError("load", got="pendulums with several hanging angles", allowed="one hanging angle")
    return plant.stiffness + plant.gravity


def _denominator(plant: Plant, stiffness: float) -> NDArray[np.float64]:
    # (L s + R)(J s² + b s + k) + K K_b s + K A k_s p
    electrical = np.array([plant.L, plant.R])
    mechanical = np.array([plant.J, plant.b, stiffness])
    loop = np.array([plant.K * plant.K_b, plant.K * plant.gain * plant.p])
    return np.polyadd(np.polymul(electrical, mechanical), loop)


def _numerators(model: Model, plant: Plant, stiffness: float) -> Mapping[str, NDArray[np.float64]]:
    angle = np.array([plant.K])
    speed = np.array([plant.K, 0.0])
    current = np.array([plant.J, plant.b, stiffness])
    N = 1.0 if isinstance(model, DCMotor) else model.value("gear.gear_reduction")
    numerators = {"motor_angle": N * angle, "motor_speed": N * speed, "armature_current": current}
    if not isinstance(model, DCMotor):
        numerators |= {"output_angle": angle, "output_speed": speed}
    if plant.p > 0.0:
        numerators["feedback_voltage"] = plant.p * angle
    return numerators


def _input_gain(model: Model, plant: Plant, name: str) -> float:
    """Return the gain from a command to the voltage that the model follows."""
    if name == "command_angle":
        return plant.p
    unit = _INPUT_UNITS[name]
    ends = []
    for value in (1e-3, 2e-3):  # the conversion is a straight line
        signal = Signal(pieces=constant_pieces(value), unit=unit, initial=value)
        ends.append(model.command(signal).table[0].value)
    return (ends[1] - ends[0]) / 1e-3
