"""Transfer functions of the models where they are linear, as named python-control systems."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.errors import InputError, LoadError, UnknownNameError
from servotwin.linear.loops import input_gain, input_name, linear_numbers, loop_of
from servotwin.loads import as_load
from servotwin.models import DCMotor, DigitalServo, Model, PulseServo, PulseServoInductive
from servotwin.models.terms import elastic
from servotwin.models.terms.numbers import Numbers

if TYPE_CHECKING:
    from collections.abc import Mapping

    import control
    from numpy.typing import NDArray

    from servotwin.loads import Load, Part
_ROUNDING = 1e-12  # of the largest coefficient


def transfer_function(model: Model, *, input: str | None = None, output: str | None = None,
                      load: Load | Part | None = None,
                      frame_period: float | None = None) -> control.TransferFunction:
    """Return the transfer function from a command to a signal, dry friction apart.

    For the motors this is (15) and (22) of the paper. For a servo it is the small-signal response where the bridge
    neither saturates nor rests in the deadband: the motor of (22) in the loop of (38). A pulse servo's loop has the
    gain that its pulses have in the mean, A k_s = (V_oc − V_ce0) K/(T_f s_r), and no delay: the burst of voltage
    comes right behind the edge that asks for it. Frames are then taken to be short beside the motion: up to 0.4 of
    the bandwidth the gain is right within a few per cent, above it is not. `frequency_response` simulates the pulses.
    A servo that turns without end has no loop: its pulse width sets a speed, and its angle is the integral of that.

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
    frame_period : float, optional
        T_f of a pulse servo [s]; the servo's own unless given.

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
    InputError
        If the bridge of a pulse servo coasts between drives, which leaves no mean voltage that follows the error; if
        `frame_period` is not positive, or given for a model without frames.

    Warns
    -----
    UserWarning
        Names what a pulse servo has that its mean leaves out: a minimum drive time, an RC stretcher, a back-EMF
        injection, or a brush drop, which frees a slow motor of the brake.

    See Also
    --------
    frequency_response : the response to sines of a finite size, simulated.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.servo_from_values("ideal", {"motor": {
    ...     "armature_resistance": 2.0, "armature_inductance": 0.5, "torque_constant": 0.1, "back_emf_constant": 0.1,
    ...     "rotor_inertia": 0.02, "motor_viscous_friction": 0.2}})
    >>> float(transfer_function(st.DCMotor(servo)).dcgain())
    inf
    >>> loop = transfer_function(st.PulseServo(st.load_servo("hitec-hs-755hb")), input="command_angle")
    >>> round(float(np.real(loop.dcgain())), 9)
    1.0
    """
    import control

    load = as_load(load)
    check_model(model, frame_period)
    if isinstance(model, PulseServo | PulseServoInductive):
        model.check_mean("the transfer function", ("motor.brush_drop_voltage",))
    plant = linear_numbers(model, load, frame_period)
    if elastic.present(plant.elastic):
        return _of_matrices(model, load, input, output, frame_period)
    name_in = input_name(model, input)
    outputs = _numerators(model, plant, _stiffness(plant, load))
    name_out = output or model.layout[0]
    if name_out not in outputs:
        raise UnknownNameError(f"output of {type(model).__name__}", name_out, tuple(outputs))
    numerator = input_gain(model, name_in) * plant.follower.gain * outputs[name_out]
    system: Any = control.TransferFunction(
        np.trim_zeros(numerator, "f"), np.trim_zeros(_denominator(plant, _stiffness(plant, load)), "f"),
        inputs=[name_in], outputs=[name_out], name=type(model).__name__)
    return system


def _of_matrices(model: Model, load: Load, input: str | None, output: str | None,
                 frame_period: float | None) -> control.TransferFunction:
    """Return the transfer function of two bodies with a spring between them, from the matrices of its states."""
    import control
    from scipy.signal import ss2tf

    loop = loop_of(model, load, input, None, frame_period)
    name = output or model.layout[0]
    if name not in loop.rows:
        raise UnknownNameError(f"output of {type(model).__name__}", name, tuple(loop.rows))
    row = loop.rows[name]
    numerator, denominator = ss2tf(loop.A, loop.B[:, np.newaxis], row.of_state[np.newaxis, :], [[row.of_input]])
    small = np.abs(numerator[0]) <= _ROUNDING * np.abs(numerator[0]).max()
    system: Any = control.TransferFunction(
        np.trim_zeros(np.where(small, 0.0, numerator[0]), "f"), denominator, inputs=[loop.input], outputs=[name],
        name=type(model).__name__)
    return system


def check_model(model: Model, frame_period: float | None, *, linear: bool = True) -> None:
    """Raise InputError unless it is a model, and one with frames where a frame period is given.

    Where it has to be `linear`, ticks and counts are refused too.
    """
    if not isinstance(model, Model):
        raise InputError("model", got=model, allowed="a model of a servo, such as PulseServo(load_servo(...))")
    if linear and isinstance(model, DigitalServo):
        raise InputError("model of a linear system", got=model,
                         allowed="a motor, a mean-voltage servo or a pulse servo: ticks and counts have no transfer "
                         "function")
    if frame_period is not None and not isinstance(model, PulseServo | PulseServoInductive):
        raise InputError(f"frame_period of {type(model).__name__}", got=frame_period,
                         allowed="none: only the pulse servos have frames")


def _stiffness(plant: Numbers, load: Load) -> float:
    if len({p.hanging_angle for p in load.pendulums}) > 1:
        raise LoadError("load", got="pendulums with several hanging angles", allowed="one hanging angle")
    return plant.load.stiffness + plant.load.gravity


def _denominator(plant: Numbers, stiffness: float) -> NDArray[np.float64]:
    # (L s + R)(J s² + b s + k) + K K_b s + K A k_s p
    electrical = np.array([plant.motor.L, plant.motor.R])
    mechanical = np.array([plant.shaft.J, plant.shaft.b, stiffness])
    loop = np.array([plant.motor.K * plant.motor.K_b, plant.motor.K * plant.follower.gain * plant.sensor.p])
    return np.polyadd(np.polymul(electrical, mechanical), loop)


def _numerators(model: Model, plant: Numbers, stiffness: float) -> Mapping[str, NDArray[np.float64]]:
    angle = np.array([plant.motor.K])
    speed = np.array([plant.motor.K, 0.0])
    current = np.array([plant.shaft.J, plant.shaft.b, stiffness])
    N = 1.0 if isinstance(model, DCMotor) else model.value("gear.gear_reduction")
    numerators = {"motor_angle": N * angle, "motor_speed": N * speed, "armature_current": current}
    if not isinstance(model, DCMotor):
        numerators |= {"output_angle": angle, "output_speed": speed}
    if plant.sensor.p > 0.0:
        numerators["feedback_voltage"] = plant.sensor.p * angle
    return numerators
