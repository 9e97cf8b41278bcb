"""The inverse servo: which torque, voltage or command goes with a motion. These are a controller's own numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from dataclasses import replace as replaced
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import physics
from servotwin.control.controller import ANGLE, VOLTAGE, Controller, Decision, Measured, check_commands, check_numbers
from servotwin.control.reference import Reference
from servotwin.errors import InputError
from servotwin.loads import as_load
from servotwin.models import BoundedServo, DigitalServo, Model, PulseServo, PulseServoInductive

if TYPE_CHECKING:
    from servotwin.loads import Load, Part


# --- The inverse servo: which torque, voltage or command goes with a motion. These are a controller's own -------------

FRICTION_SLOPE = 10.0  # s/rad at the motor, where the servo gives none; assumed, as in the catalog


@dataclass(frozen=True, kw_only=True)
class ServoInverse:
    """A controller's model of a servo and its load, at the output shaft: equation (40), solved any way round.

    Numbers of one servo, or arrays (n,) of joints. `inverse_of` takes them from a model; those of another servo, or
    some of them replaced, are a controller that believes something wrong.

    Parameters
    ----------
    resistance : float
        R of winding and bridge [Ω].
    torque_constant, back_emf_constant : float
        K = N k_a [N m/A] and K_b = N k_b [V s/rad].
    inertia, viscous_friction : float
        J = N² J_m [kg m²] and b = N² B_m [N m s/rad].
    coulomb_torque_forward, coulomb_torque_backward : float
        N F_ec1, N F_ec2 [N m].
    friction_slope : float
        N k of (41) [s/rad].
    motor_share, external_share : float
        K_m and K_e of friction that grows with the torques through the gear [1].
    load_inertia, load_viscous_friction : float
        J_L [kg m²] and B_L [N m s/rad].
    voltage_limit : float
        The most voltage that the bridge gives [V].
    volts_per_error : float
        Of the servo's own loop, A k_s p or what its pulses or its program come to; nan of a motor [V/rad].
    half_deadband : float
        h of that loop [rad].
    profile_acceleration : float
        a of a profile before that loop, which lags by what it takes to brake; inf without one [rad/s²].

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Reference
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> v = servo.voltage(Reference(0.0, speed=2.0))
    >>> f"{v:.3f} V, {servo.command_angle(v, 1.0) - 1.0:.3f} rad"
    '2.849 V, 0.156 rad'
    >>> bool(servo.replace(resistance=1.1 * servo.resistance).voltage(Reference(0.0, speed=2.0)) > v)
    True
    """

    resistance: Any
    torque_constant: Any
    back_emf_constant: Any
    inertia: Any
    viscous_friction: Any = 0.0
    coulomb_torque_forward: Any = 0.0
    coulomb_torque_backward: Any = 0.0
    friction_slope: Any = FRICTION_SLOPE
    motor_share: Any = 0.0
    external_share: Any = 0.0
    load_inertia: Any = 0.0
    load_viscous_friction: Any = 0.0
    voltage_limit: Any
    volts_per_error: Any = math.nan
    half_deadband: Any = 0.0
    profile_acceleration: Any = math.inf

    def __post_init__(self) -> None:
        names = tuple(field.name for field in fields(self))
        positive = ("resistance", "torque_constant", "inertia", "friction_slope", "voltage_limit")
        check_numbers(self, positive, positive=True)
        may_be_absent = ("volts_per_error", "profile_acceleration")
        check_numbers(self, tuple(name for name in names if name not in (*positive, *may_be_absent)))
        if not np.all(np.asarray(self.motor_share) < 1.0):
            raise InputError("motor_share of ServoInverse", got=self.motor_share, allowed="less than 1")

    def replace(self, **numbers: Any) -> ServoInverse:
        """Return it with other numbers, by the names of its parameters."""
        return replaced(self, **numbers)

    @property
    def frictionless(self) -> ServoInverse:
        """It without dry friction: the linear plant."""
        return self.replace(coulomb_torque_forward=0.0, coulomb_torque_backward=0.0, motor_share=0.0,
                            external_share=0.0)

    @property
    def volts_per_torque(self) -> Any:
        """R/K [V/(N m)]."""
        return self.resistance / self.torque_constant

    @property
    def total_inertia(self) -> Any:
        """J + J_L [kg m²]."""
        return self.inertia + self.load_inertia

    @property
    def damping(self) -> Any:
        """The damping of the shaft with a shorted winding: b + B_L + K K_b/R [N m s/rad]."""
        return (self.viscous_friction + self.load_viscous_friction
                + self.torque_constant * self.back_emf_constant / self.resistance)

    def load_torque(self, armature_voltage: Any, motion: Reference) -> Any:
        """Return τ_L that the servo exerts on its load, of a voltage [V] and a motion: (40) as it is, at the shaft.

        τ_L = (K/R) (v_a − K_b q̇) − J q̈ − b q̇ − f(q̇); what the load takes for its own inertia is in it [N m].
        """
        return physics.driven_spindle_torque(
            motion.speed, motion.acceleration, armature_voltage, armature_resistance=self.resistance,
            torque_constant=self.torque_constant, back_emf_constant=self.back_emf_constant, rotor_inertia=self.inertia,
            motor_viscous_friction=self.viscous_friction, gear_reduction=1.0,
            coulomb_torque_forward=self.coulomb_torque_forward, coulomb_torque_backward=self.coulomb_torque_backward,
            zero_crossing_slope=self.friction_slope)

    def voltage(self, motion: Reference, external_torque: Any = 0.0) -> Any:
        """Return the armature voltage that a motion takes, against an external torque beside the believed load [V].

        v_a = (R/K) ((J + J_L) q̈ + (b + B_L) q̇ + τ_ext + f) + K_b q̇, with f of `friction`. A positive torque pushes
        towards −q [N m].
        """
        qd, tau = motion.speed, external_torque + self.load_viscous_friction * motion.speed
        moved = self.total_inertia * motion.acceleration + self.viscous_friction * qd + tau
        return self.volts_per_torque * (moved + self.friction(qd, moved, tau)) + self.back_emf_constant * qd

    def friction(self, speed: Any, moved: Any, external_torque: Any) -> Any:
        """Return dry friction against a motion that takes the torque `moved` besides [N m].

        f = s (F + abs(K_m τ_m + K_e τ)), s = tanh(N k q̇), of which the motor's τ_m = moved + f is one part itself.
        """
        s, K_m = np.tanh(self.friction_slope * speed), self.motor_share
        dry = physics.smoothed_coulomb_torque(speed, self.coulomb_torque_forward, self.coulomb_torque_backward,
                                              self.friction_slope)
        through = K_m * (moved + dry) + self.external_share * external_torque
        return dry + s * np.abs(through) / (1.0 - K_m * s * np.sign(through))

    def command_angle(self, armature_voltage: Any, angle: Any, speed: Any = 0.0) -> Any:
        """Return the angle to ask for so that the servo's own loop, at this angle [rad], gives this voltage [V].

        q + v_a/(A k_s p) + h sgn(v_a): (40) solved for v_i with (38), around the deadband; and the way q̇²/2a by which
        a profile that moves at a speed [rad/s] stays behind its goal [rad].
        """
        behind = 0.5 * speed * abs(speed) / self.profile_acceleration
        return (angle + armature_voltage / self.volts_per_error
                + self.half_deadband * np.sign(armature_voltage) + behind)


def inverse_of(model: Model, load: Load | Part | None = None) -> ServoInverse:
    """Return the inverse of a model for a controller, with the inertia and damping of a load.

    Gravity, springs and recorded torques of the load are what `LoadModel` computes.

    Parameters
    ----------
    model : Model
        Any; the motors have no loop of their own.
    load : Load, optional

    Raises
    ------
    InputError
        If it is no model, or the bridge of a pulse servo coasts between drives.

    Examples
    --------
    >>> import servotwin as st
    >>> round(inverse_of(st.BoundedServo(st.load_servo("hitec-hs-755hb"))).volts_per_error, 2)
    19.17
    """
    if not isinstance(model, Model):
        raise InputError("inverse_of(model)", got=model, allowed="a model of a servo, such as PulseServo(...)")
    weight = as_load(load)
    N = model.value_or("gear.gear_reduction", 1.0)
    R = model.value("motor.armature_resistance") + model.value_or("supply.bridge_drop_resistance", 0.0)
    plant = model.plant(weight)
    lost = model.value_or("supply.bridge_drop_voltage", 0.0) + model.value_or("motor.brush_drop_voltage", 0.0)
    gain, half = _own_loop(model, R)
    return ServoInverse(
        resistance=R, torque_constant=N * model.value("motor.torque_constant"),
        back_emf_constant=N * model.value("motor.back_emf_constant"),
        inertia=N**2 * model.value("motor.rotor_inertia"),
        viscous_friction=N**2 * model.value("motor.motor_viscous_friction"),
        coulomb_torque_forward=plant.friction.F_forward, coulomb_torque_backward=plant.friction.F_backward,
        friction_slope=N * (model.value_or("friction.zero_crossing_slope", FRICTION_SLOPE) or FRICTION_SLOPE),
        motor_share=plant.friction.K_m, external_share=plant.friction.K_e, load_inertia=plant.shaft.J_out,
        load_viscous_friction=weight.viscous_friction,
        voltage_limit=model.value_or("supply.open_circuit_voltage", math.inf) - lost
        if model.servo.get("supply.open_circuit_voltage") is not None else _ENOUGH,
        volts_per_error=gain, half_deadband=half,
        profile_acceleration=model.value_or("firmware.acceleration_limit", math.inf))


_ENOUGH = 1e3  # V, of a model without a supply


def _own_loop(model: Model, R: float) -> tuple[float, float]:
    """Return volts per error [V/rad] and half the deadband [rad] of the loop inside a servo; nan and 0 of a motor."""
    p = model.value_or("potentiometer.feedback_gain", math.nan)
    if isinstance(model, DigitalServo):
        V = model.value("supply.open_circuit_voltage") - model.value_or("supply.bridge_drop_voltage", 0.0)
        return model.value("firmware.proportional_gain") * V, float(model.firmware().h)
    if isinstance(model, PulseServo | PulseServoInductive):
        model.check_mean("the inverse servo")
        behind = R / model.value("motor.armature_resistance")  # the mean voltage is given behind R_a alone
        s_mu = model.value("electronics.one_shot_slope") * p
        return behind * model.mean_gain() * p, 0.5 * model.value_or("electronics.deadband", 0.0) / s_mu
    if model.servo.get("electronics.bridge_gain") is None or "electronics.bridge_gain" not in model.requires:
        return math.nan, 0.0
    gain = model.value("electronics.bridge_gain") * model.value("electronics.comparator_gain")
    w_v = model.value_or("electronics.voltage_deadband", 0.0) if isinstance(model, BoundedServo) else 0.0
    return gain * p, 0.5 * w_v / p


@dataclass(frozen=True)
class LoadModel:
    """The external torque of a load as a function of the motion, for controllers that take one.

    Parameters
    ----------
    load : Load
        Of which constant torques, springs and pendulums count; inertia and damping are the inverse's.

    Examples
    --------
    >>> import servotwin as st
    >>> arm = LoadModel(st.loads.Pendulum(mass=0.1, length=0.12))
    >>> f"{arm(1.570796, 0.0, 0.0):.5f} N m"
    '0.11768 N m'
    """

    load: Load | Part

    def __call__(self, angle: Any, speed: Any, acceleration: Any) -> Any:
        """Return τ_ext at an angle [rad]; speed [rad/s] and acceleration [rad/s²] do not count [N m]."""
        load = as_load(self.load)
        amplitude, hanging = load.gravity
        stiffness, rest = load.elasticity
        return load.torque + stiffness * (angle - rest) + amplitude * np.sin(angle - hanging)


def joined(inverses: Sequence[ServoInverse]) -> ServoInverse:
    """Return the inverses of n servos as one, whose numbers are arrays (n,), for the joints of a robot.

    Examples
    --------
    >>> import servotwin as st
    >>> one = inverse_of(st.BoundedServo(st.load_servo("hitec-hs-755hb")))
    >>> joined([one, one]).inertia.shape
    (2,)
    """
    if not inverses:
        raise InputError("joined(inverses)", got="none", allowed="at least one")
    return ServoInverse(**{field.name: np.array([getattr(one, field.name) for one in inverses], dtype=np.float64)
                           for field in fields(ServoInverse)})


# --- How a voltage gets into a servo that takes angles only -----------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class AheadOfServo:
    """Asks for the reference plus what a voltage needs of error: the loop inside the servo stays the feedback.

    command_angle = q_r + v_a/(A k_s p) + h sgn(v_a). On the way, the servo's own loop then has the error that it takes
    to move; a controller behind it that measures nothing needs no sensor.

    Parameters
    ----------
    controller : Controller
        Commands a voltage.
    inverse : ServoInverse
        Of which the servo's own loop counts.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Feedforward, Reference, inverse_of
    >>> inverse = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> ahead = AheadOfServo(controller=Feedforward(period=0.02, inverse=inverse), inverse=inverse)
    >>> f"{ahead.step(None, Reference(0.5, speed=2.0), {}).command:.3f} rad"
    '0.656 rad'
    """

    controller: Controller
    inverse: ServoInverse

    def __post_init__(self) -> None:
        check_commands(self.controller, VOLTAGE, type(self).__name__)

    @property
    def period(self) -> float:
        """That of the controller [s]."""
        return self.controller.period

    @property
    def commands(self) -> str:
        """An angle."""
        return ANGLE

    @property
    def ahead(self) -> Any:
        """That of the controller [s]."""
        return self.controller.ahead

    def initial(self, measured: Measured, reference: Reference) -> Any:
        """Return the state of the controller."""
        return self.controller.initial(measured, reference)

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return the angle to ask for."""
        v, state = self.controller.step(state, reference, measured)
        return Decision(self.inverse.command_angle(v, reference.angle, reference.speed), state)


@dataclass(frozen=True, kw_only=True)
class ThroughServo(AheadOfServo):
    """Asks for the measured angle plus what a voltage needs of error: the loop inside the servo is taken out.

    command_angle = q + v_a/(A k_s p) + h sgn(v_a). The servo becomes a source of voltage, as far as the measurement is
    not late: what the shaft moves until the next tick, its own loop takes off. A profile in the servo spoils it.

    Parameters
    ----------
    controller : Controller
        Commands a voltage.
    inverse : ServoInverse
        Of which the servo's own loop counts.
    """

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return the angle to ask for."""
        v, state = self.controller.step(state, reference, measured)
        return Decision(self.inverse.command_angle(v, measured["output_angle"]), state)
