"""Transfer functions of the models where they are linear, as named python-control systems."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.errors import InputError, LoadError, UnknownNameError
from servotwin.loads import as_load
from servotwin.models import DCMotor, DigitalServo, GearedMotor, Model, PulseServo, PulseServoInductive
from servotwin.models.terms import elastic
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.shaft import pendulum_stiffness
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Mapping

    import control

    from servotwin.loads import Load, Part


# --- The plant behind the drive, dry friction and play apart, as matrices of a linear system --------------------------

Complex = NDArray[np.complex128]


class Plant(NamedTuple):
    """Motor, gear and load: ẋ = A x + B v_a, with rows that give signals of x.

    Parameters
    ----------
    states : tuple of str
        Signal names of x; of the motor at the output shaft.
    A : ndarray, shape (n, n)
    B : ndarray, shape (n,)
        For the armature voltage v_a [V].
    angle : ndarray, shape (n,)
        Row of the output angle q [rad].
    motor_angle, motor_speed : ndarray, shape (n,)
        Rows of the motor's angle [rad] and speed [rad/s], at the output shaft.
    current : ndarray, shape (n,)
        Row of the armature current i [A].
    feedthrough : float
        Of v_a to the current: 1/R where there is no inductance [A/V].
    """

    states: tuple[str, ...]
    A: Array
    B: Array
    angle: Array
    motor_angle: Array
    motor_speed: Array
    current: Array
    feedthrough: float

    def response(self, omega: Array) -> Complex:
        """Return P(jω), output angle per armature voltage [rad/V], in the shape of `omega`."""
        s = 1j * np.asarray(omega, dtype=np.float64)[..., np.newaxis, np.newaxis] * np.eye(len(self.B))
        found: Complex = np.linalg.solve(s - self.A, self.B[:, np.newaxis])[..., 0] @ self.angle
        return found


def plant_of(numbers: Numbers, load: Load, angle: float | None = None) -> Plant:
    """Return the plant of packed numbers; pendulums count by their stiffness at `angle`, or where they hang.

    Raises
    ------
    InputError
        If the angle is not finite.
    LoadError
        If several pendulums do not hang the same way, and no angle is given.
    """
    if angle is not None and not is_finite(angle):
        raise InputError("angle", got=angle, allowed="a finite number [rad]")
    if angle is None and len({pendulum.hanging_angle for pendulum in load.pendulums}) > 1:
        raise LoadError("load", got="pendulums with several hanging angles", allowed="one hanging angle, or an angle "
                        "about which to linearise")
    shaft, twist, own = numbers.shaft, numbers.elastic, numbers.load
    k = own.stiffness + _pendulum(own.gravity, own.hanging_angle, angle)
    if not elastic.present(twist):
        return _assembled(numbers, ("output_angle", "output_speed"), np.array([shaft.J]), np.array([[shaft.b]]),
                          np.array([[k]]), output=0)
    if elastic.geared(twist):
        names = ("motor_angle", "output_angle", "motor_speed", "output_speed")
        J, b = (shaft.J - shaft.J_out, shaft.J_out), (shaft.b - shaft.b_out, shaft.b_out)
        stiffness, output = (0.0, k), 1
    else:
        names = ("output_angle", "load_angle", "output_speed", "load_speed")
        J, b = (shaft.J, twist.J), (shaft.b, twist.b)
        stiffness, output = (k, _pendulum(twist.gravity, twist.hanging_angle, angle)), 0
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return _assembled(numbers, names, np.array(J), np.diag(b) + twist.c * between,
                      np.diag(stiffness) + twist.k * between, output=output)


def _pendulum(gravity: float, hanging_angle: float, angle: float | None) -> float:
    """Return the stiffness of a pendulum [N m/rad] at an angle, or where it hangs."""
    return pendulum_stiffness(hanging_angle if angle is None else angle, gravity, hanging_angle) if gravity else 0.0


def _assembled(numbers: Numbers, names: tuple[str, ...], J: Array, b: Array, k: Array, *, output: int) -> Plant:
    """Return the plant of bodies J q̈ + b q̇ + k q = (K i, 0): the motor drives the first of them."""
    motor, bodies = numbers.motor, len(J)
    K, K_b, R = motor.K, motor.K_b, motor.R
    rows, fast = np.eye(2 * bodies), inductive(motor)
    turned, first = rows[0], rows[bodies]  # angle and speed of the motor
    A = np.block([[np.zeros((bodies, bodies)), np.eye(bodies)], [-k / J[:, None], -b / J[:, None]]])
    push = first * K / J[0]  # of the current
    angle = rows[output]
    if not fast:  # R i = v_a − K_b q̇_m
        return Plant(names, A - np.outer(push, K_b / R * first), push / R, angle, turned, first, -K_b / R * first,
                     1.0 / R)
    A = np.block([[A, push[:, None]], [-K_b / motor.L * first[None, :], np.array([[-R / motor.L]])]])
    grown = 2 * bodies + 1
    return Plant((*names, "armature_current"), A, np.eye(grown)[-1] / motor.L, np.append(angle, 0.0),
                 np.append(turned, 0.0), np.append(first, 0.0), np.eye(grown)[-1], 0.0)


# --- A model where it is linear: its plant, in a loop with the voltage that its drive gives in the mean ---------------

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


# --- Transfer functions of the models where they are linear, as named python-control systems --------------------------

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


# --- State-space systems of the models where they are linear, as named python-control systems -------------------------

def state_space(model: Model, load: Load | Part | None = None, *, input: str | None = None,
                angle: float | None = None, frame_period: float | None = None) -> control.StateSpace:
    """Return the linear system of `transfer_function` with its states, and with all of its outputs.

    Parameters
    ----------
    model : Model
        A motor, a mean-voltage servo or a pulse servo, whose loop has the gain of the mean of its pulses.
    load : Load, optional
        Inertia, viscous friction, springs and elastic arms count, and pendulums by their stiffness.
    input : str, optional
        `armature_voltage` [V] of a motor; `command_voltage` [V], `pulse_width` [s] or `command_angle` [rad] of a
        servo. Unless given: `armature_voltage`, `pulse_width`.
    angle : float, optional
        About which a pendulum moves; where it hangs unless given [rad].
    frame_period : float, optional
        T_f of a pulse servo [s]; the servo's own unless given.

    Returns
    -------
    control.StateSpace
        States are deviations, named by their signals: angles and speeds, of the motor at the output shaft, and the
        current of a model with inductance. Outputs are those that `transfer_function` has.

    Raises
    ------
    UnknownNameError, LoadError, InputError
        As `transfer_function` does.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> system = state_space(model, st.loads.Inertia(1e-3), input="command_angle")
    >>> system.state_labels, system.output_labels[-1]
    (['output_angle', 'output_speed'], 'feedback_voltage')
    """
    import control

    check_model(model, frame_period)
    if isinstance(model, PulseServo | PulseServoInductive):
        model.check_mean("the state space", ("motor.brush_drop_voltage",))
    loop = loop_of(model, as_load(load), input, angle, frame_period)
    rows = loop.rows
    system: Any = control.StateSpace(
        loop.A, loop.B[:, np.newaxis], np.array([row.of_state for row in rows.values()]),
        np.array([[row.of_input] for row in rows.values()]), states=list(loop.plant.states), inputs=[loop.input],
        outputs=list(rows), name=type(model).__name__)
    return system
