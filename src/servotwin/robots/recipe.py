"""What comes nearest to a servo among MuJoCo's own actuators: numbers for `<position>`, `<dcmotor>` and their joint."""

from __future__ import annotations

from dataclasses import dataclass

from servotwin import physics
from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models import BoundedServo, DigitalServo, Model
from servotwin.models.terms.friction import sliding_friction
from servotwin.physics.motor import back_emf, electromagnetic_torque, steady_armature_current
from servotwin.robots.mount import SERVOS

_NO_LOAD = 0.0


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A servo as a voltage that follows the angle's error, limited, behind a resistance: all that MuJoCo's have of it.

    What has no place in it: deadband, pulses and their frames, sticking that holds exactly, friction that depends on
    load or direction, play, sag, heat, firmware.

    Parameters
    ----------
    torque_constant, back_emf_constant : float
        Of the motor as seen at the output [N m/A], [V s/rad].
    resistance : float
        Of the winding [Ω].
    voltage_per_angle : float
        Voltage at the motor per error in the linear zone [V/rad].
    voltage_limit : float
        At full drive [V].
    armature : float
        Inertia of rotor and gear at the output [kg m²].
    friction_loss : float
        Mean sliding friction of both directions, without load [N m].
    viscous_friction : float
        [N m s/rad].
    """

    torque_constant: float
    back_emf_constant: float
    resistance: float
    voltage_per_angle: float
    voltage_limit: float
    armature: float
    friction_loss: float
    viscous_friction: float

    @property
    def stiffness(self) -> float:
        """K k_v/R: torque per error in the linear zone [N m/rad], the `kp` of both actuators."""
        i = steady_armature_current(self.voltage_per_angle, 0.0, self.resistance, self.back_emf_constant)
        return float(electromagnetic_torque(i, self.torque_constant))

    @property
    def damping(self) -> float:
        """K K_b/R: torque per speed [N m s/rad], the `kv` of both actuators."""
        i = steady_armature_current(back_emf(1.0, self.back_emf_constant), 0.0, self.resistance, self.back_emf_constant)
        return float(electromagnetic_torque(i, self.torque_constant))

    @property
    def stall_torque(self) -> float:
        """K V/R, the motor's at a standstill, of which friction takes its part [N m]."""
        i = steady_armature_current(self.voltage_limit, 0.0, self.resistance, self.back_emf_constant)
        return float(electromagnetic_torque(i, self.torque_constant))

    def joint(self) -> str:
        """Return attributes of `<joint>`."""
        return (f'armature="{self.armature:.6g}" frictionloss="{self.friction_loss:.6g}" '
                f'damping="{self.viscous_friction:.6g}"')

    def position(self, joint: str) -> str:
        """Return `<position>`: saturated by torque, so that back-EMF takes nothing of what there is at speed."""
        limit = f"{self.stall_torque:.9g}"
        return (f'<position joint="{joint}" kp="{self.stiffness:.9g}" kv="{self.damping:.9g}" '
                f'forcerange="-{limit} {limit}"/>')

    def dcmotor(self, joint: str) -> str:
        """Return `<dcmotor>`, from MuJoCo 3.12 on: saturated by voltage, as the servo is.

        Its controller adds back what back-EMF takes; kd = K K_b/R takes it away again.
        """
        return (f'<dcmotor joint="{joint}" motorconst="{self.torque_constant:.12g} {self.back_emf_constant:.12g}" '
                f'resistance="{self.resistance:.12g}" input="pos" '
                f'controller="{self.stiffness:.12g} 0 {self.damping:.12g} 0 0 {self.voltage_limit:.12g}"/>')


def recipe_of(model: Model) -> Recipe:
    """Return what comes nearest to a servo.

    Raises
    ------
    InputError
        If the model has no gain from error to voltage: a motor, or a servo of which too little is known.

    Examples
    --------
    >>> import servotwin as st
    >>> recipe = recipe_of(st.DigitalServo(st.load_servo("feetech-sts3215-12v")))
    >>> round(recipe.stiffness, 1), round(recipe.damping, 2), round(recipe.stall_torque, 1)
    (33.4, 1.23, 6.2)
    """
    if not isinstance(model, SERVOS):
        raise InputError("recipe", got=model, allowed=" or ".join(kind.__name__ for kind in SERVOS))
    if model.endless:
        raise InputError(f"recipe of {model.servo.name}", got="a servo that turns endlessly",
                         allowed="one that is told an angle")
    if isinstance(model, DigitalServo):
        V = model.value("supply.open_circuit_voltage")
        limit = model.value_or("firmware.duty_limit", 1.0) * model.value_or("firmware.torque_limit", 1.0)
        per_angle, most = model.value("firmware.proportional_gain") * V, limit * V
    else:
        try:
            mean = model if isinstance(model, BoundedServo) else BoundedServo(model.servo)
        except InputError as error:
            raise InputError(f"recipe of {model.servo.name}", got=type(model).__name__, allowed=str(error)) from None
        follower, sensor = mean.plant(Load()).follower, mean.plant(Load()).sensor
        per_angle = physics.proportional_voltage(physics.feedback_voltage(1.0, sensor.p), follower.gain)
        most = follower.V_max
    own = model.plant(Load())
    friction = 0.5 * sum(sliding_friction(own.friction, forward, _NO_LOAD, 0.0, 0.0) for forward in (True, False))
    return Recipe(torque_constant=own.motor.K, back_emf_constant=own.motor.K_b, resistance=own.motor.R,
                  voltage_per_angle=float(per_angle), voltage_limit=float(most), armature=own.shaft.J,
                  friction_loss=friction, viscous_friction=own.shaft.b)
