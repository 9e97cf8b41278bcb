"""What comes nearest to a servo among MuJoCo's own actuators: numbers for `<position>`, `<dcmotor>` and their joint.

A servo stands off its goal by more where it has come up under a load than where it has come down: friction holds it. A
spring k_p beside a friction loss F does so too, and under the load τ it is as far off as the servo if

    k_p e_up = τ + F,    k_p e_down = τ − F    ⇒    k_p = 2τ/(e_up + e_down),    F = τ (e_up − e_down)/(e_up + e_down)

The force that it lifts with is then F more than what the servo lifts. Both hold at this load: friction of gears grows
with it, and F does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from servotwin import physics
from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models import BoundedServo, DigitalServo, Model
from servotwin.models.terms.friction import sliding_friction
from servotwin.physics.motor import back_emf, electromagnetic_torque, steady_armature_current
from servotwin.robots.mount import SERVOS
from servotwin.robots.recipe_twin import Droops, droops_of_twin, inertia_under, lift_of_twin
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.robots.recipe_error import RecipeError

STICKS = "0.9999 0.9999 0.001"
"""`solimpfriction` of a joint with which MuJoCo's friction loss all but holds; as it is by default, it creeps."""
SHARE = 0.3  # of what a servo lifts: the load that a recipe is for unless another is given
_NO_LOAD = 0.0
_LIGHTEST = 0.02  # of what a servo lifts
_LEAST = 0.1  # of the droop that the linear zone has without friction: what stands nearer has an integral


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A servo as a torque that follows the angle's error and is limited, beside a friction loss: all that MuJoCo has.

    What it does not say is in `lacks`, and how far it is off its servo in `error`.

    Parameters
    ----------
    model : Model
        Of the servo.
    load : float
        Torque under which it stands as the servo does [N m].
    lift : float
        What the servo lifts, from rest [N m].
    droops : Droops
        Of the servo under that load [rad].
    torque_constant, back_emf_constant : float
        Of the motor as seen at the output [N m/A], [V s/rad].
    resistance : float
        Of the winding [Ω].
    voltage_limit : float
        At the motor at full drive, behind the bridge [V].
    stiffness : float
        Torque per error, the `kp` of both actuators [N m/rad].
    damping : float
        Torque per speed, the `kv` of both: what back-EMF and the program's derivative take [N m s/rad].
    armature : float
        Inertia of rotor and gear at the output [kg m²].
    friction_loss : float
        [N m].
    viscous_friction : float
        [N m s/rad].
    """

    model: Model
    load: float
    lift: float
    droops: Droops
    torque_constant: float
    back_emf_constant: float
    resistance: float
    voltage_limit: float
    stiffness: float
    damping: float
    armature: float
    friction_loss: float
    viscous_friction: float

    @property
    def most_torque(self) -> float:
        """What the motor gives at most: what the servo lifts, and friction [N m]."""
        return self.lift + self.friction_loss

    def joint(self) -> str:
        """Return attributes of `<joint>`: `actuatorfrcrange` is what limits a `<dcmotor>`."""
        most = f"{self.most_torque:.6g}"
        return (f'armature="{self.armature:.6g}" frictionloss="{self.friction_loss:.6g}" '
                f'damping="{self.viscous_friction:.6g}" solimpfriction="{STICKS}" actuatorfrcrange="-{most} {most}"')

    def position(self, joint: str) -> str:
        """Return `<position>`: saturated by torque, so that back-EMF takes nothing of what there is at speed."""
        limit = f"{self.most_torque:.9g}"
        return (f'<position joint="{joint}" kp="{self.stiffness:.9g}" kv="{self.damping:.9g}" '
                f'forcerange="-{limit} {limit}"/>')

    def dcmotor(self, joint: str) -> str:
        """Return `<dcmotor>`, from MuJoCo 3.12 on: saturated by voltage, as the servo is, and by the joint's range.

        Its controller adds back what back-EMF takes; kd = kv takes it away again. Where the friction of the recipe is
        more than the servo's in motion, the voltage is as much more: what it lifts, and how fast it turns, stay.
        """
        most = max(self.voltage_limit, self.most_torque * self.resistance / self.torque_constant)
        return (f'<dcmotor joint="{joint}" motorconst="{self.torque_constant:.12g} {self.back_emf_constant:.12g}" '
                f'resistance="{self.resistance:.12g}" input="pos" '
                f'controller="{self.stiffness:.12g} 0 {self.damping:.12g} 0 0 {most:.12g}"/>')

    @cached_property
    def error(self) -> RecipeError:
        """How far both actuators are off the servo, by running them in MuJoCo; `print` shows it."""
        from servotwin.robots.recipe_error import error_of

        return error_of(self)

    @property
    def lacks(self) -> tuple[str, ...]:
        """What of the servo has no place in it."""
        has = {name for name in self.model.servo.names() if self.model.servo.get(name)}
        return tuple(words for words, names in _LACKS if any(name in has for name in names))


_LACKS = (
    ("friction that grows with the load, which changes lift and droop away from the load of the recipe",
     ("friction.load_friction_motor", "friction.load_friction_external")),
    ("the dead zone in which the servo does nothing",
     ("firmware.deadband_angle", "electronics.deadband", "electronics.voltage_deadband")),
    ("pulses and their frames, ticks and whole counts",
     ("electronics.frame_period", "firmware.control_period", "firmware.angle_quantum")),
    ("limits of speed and acceleration in the program", ("firmware.speed_limit", "firmware.acceleration_limit")),
    ("the integral of the error", ("firmware.integral_gain",)),
    ("protections that trip", ("firmware.overload_duty", "firmware.trip_current", "firmware.trip_temperature")),
    ("play and an elastic gear", ("gear.backlash", "gear.stiffness")),
    ("sag of the supply", ("supply.internal_resistance",)),
    ("heat", ("motor.armature_resistance",)),
)


def recipe_of(model: Model, *, load: float | None = None) -> Recipe:
    """Return what comes nearest to a servo.

    Parameters
    ----------
    model : AveragedServo, BoundedServo, PulseServo, PulseServoInductive or DigitalServo
    load : float, optional
        Torque [N m] that it has to hold, under which it is to stand off its goal as the servo does; 0.3 of what it
        lifts unless given.

    Raises
    ------
    InputError
        If the model has no gain from error to voltage (a motor, or a servo of which too little is known), the load is
        no number of at least 2 % of what it lifts, or the servo does not hold it.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.feetech_sts({"P_Coefficient": 16, "D_Coefficient": 32}, servo="feetech-sts3215-12v")
    >>> recipe = recipe_of(st.DigitalServo(servo), load=0.85)
    >>> round(recipe.stiffness), round(recipe.friction_loss, 1), round(recipe.most_torque, 1)
    (13, 0.7, 3.6)
    """
    plant = _plant(model)
    lift = lift_of_twin(model)
    load = SHARE * lift if load is None else load
    if not is_finite(load) or not load >= _LIGHTEST * lift:
        raise InputError(f"load of a recipe of {model.servo.name}", got=load, allowed=f"at least {_LIGHTEST * lift:.3g}"
                         f" N m, {_LIGHTEST:.0%} of what it lifts: below it friction hides what the load does")
    droops = droops_of_twin(model, load, inertia_under(load))
    whole = droops.up + droops.down
    if whole > _LEAST * 2.0 * load / plant.stiffness:
        stiffness, friction = 2.0 * load / whole, max(load * (droops.up - droops.down) / whole, 0.0)
    else:  # an integral takes the error away
        stiffness, friction = plant.stiffness, plant.friction
    own = model.plant(Load())
    return Recipe(
        model=model, load=load, lift=lift, droops=droops, torque_constant=own.motor.K, back_emf_constant=own.motor.K_b,
        resistance=own.motor.R, voltage_limit=plant.voltage_limit, stiffness=stiffness, damping=plant.damping,
        armature=own.shaft.J, friction_loss=friction, viscous_friction=own.shaft.b)


@dataclass(frozen=True, kw_only=True)
class _Linear:
    """A servo in its linear zone at the output: torque per error [N m/rad] and speed [N m s/rad], friction [N m]."""

    stiffness: float
    damping: float
    voltage_limit: float
    friction: float


def _plant(model: Model) -> _Linear:
    """Return what a servo is in its linear zone."""
    if not isinstance(model, SERVOS):
        raise InputError("recipe", got=model, allowed=" or ".join(kind.__name__ for kind in SERVOS))
    if model.endless:
        raise InputError(f"recipe of {model.servo.name}", got="a servo that turns endlessly",
                         allowed="one that is told an angle")
    per_speed = 0.0
    if isinstance(model, DigitalServo):
        V = model.driving_voltage
        per_angle, most = model.value("firmware.proportional_gain") * V, model.most_duty * V
        per_speed = model.value_or("firmware.derivative_gain", 0.0) * V
    else:
        try:
            mean = model if isinstance(model, BoundedServo) else BoundedServo(model.servo)
        except InputError as error:
            raise InputError(f"recipe of {model.servo.name}", got=type(model).__name__, allowed=str(error)) from None
        follower, sensor = mean.plant(Load()).follower, mean.plant(Load()).sensor
        per_angle = physics.proportional_voltage(physics.feedback_voltage(1.0, sensor.p), follower.gain)
        most = follower.V_max
    own = model.plant(Load())

    def torque(v: float) -> float:
        return float(electromagnetic_torque(steady_armature_current(v, 0.0, own.motor.R, own.motor.K_b), own.motor.K))

    friction = 0.5 * sum(sliding_friction(own.friction, forward, _NO_LOAD, 0.0, 0.0) for forward in (True, False))
    return _Linear(stiffness=torque(float(per_angle)), damping=torque(back_emf(1.0, own.motor.K_b) + per_speed),
                   voltage_limit=float(most), friction=friction)
