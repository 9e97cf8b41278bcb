"""The nearest of MuJoCo's own actuators to a servo: numbers for `<position>`, `<dcmotor>` and their joint.

A servo stands off its goal by more where it has come up under a load than where it has come down: friction holds it. A
spring k_p beside a friction loss F does so too, and under the load τ it is as far off as the servo if

    k_p e_up = τ + F,    k_p e_down = τ − F    ⇒    k_p = 2τ/(e_up + e_down),    F = τ (e_up − e_down)/(e_up + e_down)

The force that it lifts with is then F more than what the servo lifts. Both hold at this load: friction of gears grows
with it, and F does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import loads, physics, signals
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.holding import changed
from servotwin.datasheet.warming import GRAVITY
from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models import AveragedServo, BoundedServo, DigitalServo, Model, mid_travel
from servotwin.models.terms.friction import sliding_friction
from servotwin.physics.motor import back_emf, electromagnetic_torque, steady_armature_current
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.mount import SERVOS
from servotwin.simulation.simulator import simulate
from servotwin.units import is_finite

# --- Behaviour that a recipe of MuJoCo's actuators has to copy: what it lifts, and how far a load ---------------------

WAY, REST, RAMP, SETTLE = math.radians(60.0), 0.3, 1.6, 1.4  # rad, s: a goal stands, comes slowly, and stands
LAST = 20  # of 0.01 s, over which what pulses do to a shaft that stands is averaged
_ARM = 0.1  # m
_GONE = ("stops.lower_angle", "stops.upper_angle", "potentiometer.noise")


class Droops(NamedTuple):
    """Commanded less actual angle under a load that pulls down, where the shaft has come up, and down, slowly [rad]."""

    up: float
    down: float


def without_ends(model: Model) -> Model:
    """Return a model without stops, which would hold what the servo does not, and without noise."""
    return changed(model, {name: None for name in _GONE if model.servo.get(name) is not None})


def eased(time: Array, way: float) -> Array:
    """Return a goal [rad] that goes half a way below 0 to half a way above, slowly, and stands there."""
    return np.asarray(-0.5 * way * np.cos(math.pi * np.clip((time - REST) / RAMP, 0.0, 1.0)))


def inertia_under(torque: float) -> float:
    """Return the inertia of a mass on an arm of 0.1 m whose weight makes a torque [kg m²]."""
    return torque * _ARM / GRAVITY


def lift_of_twin(model: Model) -> float:
    """Return the most torque that a servo lifts from rest, as `curves` has it [N m]."""
    drive = FullDrive(BoundedServo(model.servo) if isinstance(model, AveragedServo) else model)
    return float(min(drive.stall_torque, drive.starting_torque))


def droops_of_twin(model: Model, torque: float, inertia: float) -> Droops:
    """Return where a servo stands under a torque [N m] with an inertia [kg m²] at its goal.

    Raises
    ------
    InputError
        If it does not hold so much for as long as that takes.
    """
    free, middle, time = without_ends(model), mid_travel(model), np.arange(0.0, REST + RAMP + SETTLE, 0.01)
    found = []
    for way in (WAY, -WAY):
        goal = middle + 0.5 * way
        result = simulate(free, signals.samples(time, middle + eased(time, way), unit="rad", hold="linear"),
                          duration=REST + RAMP + SETTLE, output_step=0.01,
                          load=loads.Constant(torque) + loads.Inertia(inertia))
        trips = [remark.kind for remark in result.remarks if remark.kind.startswith("tripped")]
        last = result["output_angle"][-LAST:]
        if trips or not result.status.ok or abs(goal - last[-1]) > 0.75 * WAY:
            raise InputError(f"load of a recipe of {model.servo.name}", got=f"{torque:.3g} N m, under which it "
                             f"{'is ' + trips[0] if trips else 'does not come up'}", allowed="less [N m]")
        found.append(goal - float(last.mean()))
    return Droops(*found)


# --- How far a recipe of MuJoCo's actuators is off its servo: both do the same, MuJoCo's and the twin by --------------

Array = NDArray[np.float64]
_STEP, _SWING, _FREQUENCY = math.radians(30.0), math.radians(20.0), 0.5  # rad, rad, Hz
_LONG = 2.0  # s, of each
_LOOK = 0.01  # s
_TIMESTEP = 0.001  # s, of MuJoCo
_HALVINGS = 8
_RAISED = math.radians(5.0)  # that a servo has to raise what it lifts by
_FROM = math.radians(60.0)  # rad below a goal: full drive


class Actuator(NamedTuple):
    """The behaviour of one of MuJoCo's actuators by a recipe.

    Parameters
    ----------
    lift : float
        Most torque that it lifts from rest [N m].
    droops, droops_at_half : Droops
        Under the load of the recipe and under half of it [rad].
    step_rms, sine_rms : float
        Its angle less the servo's under that load, after a step of 30° and through a sine of ±20° at 0.5 Hz [rad].
    """

    lift: float
    droops: Droops
    droops_at_half: Droops
    step_rms: float
    sine_rms: float


@dataclass(frozen=True, kw_only=True)
class RecipeError:
    """Both actuators of a recipe beside the servo.

    Parameters
    ----------
    load : float
        [N m]
    lift : float
        Of the servo [N m].
    droops, droops_at_half : Droops
        Of the servo under the load and under half of it [rad].
    position, dcmotor : Actuator
    lacks : tuple of str
    """

    load: float
    lift: float
    droops: Droops
    droops_at_half: Droops
    position: Actuator
    dcmotor: Actuator
    lacks: tuple[str, ...]

    def __str__(self) -> str:
        """Return a table, and what the recipe lacks."""
        rows = [("", "servo", "<position>", "<dcmotor>"), ("lift", *(
            f"{value:.3g} N m" for value in (self.lift, self.position.lift, self.dcmotor.lift)))]
        for torque, name in ((self.load, "droops"), (0.5 * self.load, "droops_at_half")):
            for way in Droops._fields:
                rows.append((f"stands off, come {way}, {torque:.3g} N m", *(
                    f"{math.degrees(getattr(getattr(one, name), way)):.2f} deg"
                    for one in (self, self.position, self.dcmotor))))
        for name, words in (("step_rms", "off after a step of 30 deg, rms"), ("sine_rms", "off in a sine, rms")):
            rows.append((words, "", *(
                f"{math.degrees(getattr(one, name)):.2f} deg" for one in (self.position, self.dcmotor))))
        return "\n".join([f"{a:<36}{b:>12}{c:>12}{d:>12}".rstrip() for a, b, c, d in rows]
                         + [f"lacks {words}" for words in self.lacks])


def error_of(recipe: Recipe) -> RecipeError:
    """Return how far both actuators are off the servo."""
    half = droops_of_twin(recipe.model, 0.5 * recipe.load, inertia_under(0.5 * recipe.load))
    moves: list[tuple[Array, Goals]] = [(_twin(recipe, goals), goals) for goals in (_step_goals, _sine_goals)]
    found = [_done(recipe, text("joint"), moves) for text in (recipe.position, recipe.dcmotor)]
    return RecipeError(load=recipe.load, lift=recipe.lift, droops=recipe.droops, droops_at_half=half, position=found[0],
                       dcmotor=found[1], lacks=recipe.lacks)


Goals = Callable[[Array], Array]


def _step_goals(time: Array) -> Array:
    return np.where(time < REST, 0.0, _STEP)


def _sine_goals(time: Array) -> Array:
    return np.where(time < REST, 0.0, _SWING * np.sin(2.0 * math.pi * _FREQUENCY * (time - REST)))


def _twin(recipe: Recipe, goals: Goals) -> Array:
    """Return the angles of the servo about mid-travel under the load of the recipe."""
    middle, time = mid_travel(recipe.model), np.arange(0.0, REST + _LONG + _TIMESTEP, _TIMESTEP)
    command = signals.samples(time, middle + goals(time), unit="rad", hold="previous")
    result = simulate(without_ends(recipe.model), command, duration=REST + _LONG, output_step=_LOOK,
                      load=loads.Constant(recipe.load) + loads.Inertia(inertia_under(recipe.load)))
    if not result.status.ok:
        raise InputError(f"error of a recipe of {recipe.model.servo.name}", got=result.status.message, allowed="a run")
    return np.asarray(result["output_angle"] - middle)


def _done(recipe: Recipe, actuator: str, moves: Sequence[tuple[Array, Goals]]) -> Actuator:
    off = [float(np.sqrt(np.mean((_followed(recipe, actuator, recipe.load, goals, REST + _LONG) - twin)**2)))
           for twin, goals in moves]
    return Actuator(_lifted(recipe, actuator), _droops(recipe, actuator, recipe.load),
                    _droops(recipe, actuator, 0.5 * recipe.load), *off)


def arm_of(recipe: Recipe, actuator: str, inertia: float, *, joint: str | None = None) -> Any:
    """Return an MjModel of a joint `joint` with an actuator of a recipe and an inertia [kg m²], without gravity."""
    return load_mujoco().MjModel.from_xml_string(
        f'<mujoco><option timestep="{_TIMESTEP}" integrator="implicitfast" gravity="0 0 0"/><worldbody><body>'
        f'<joint name="joint" axis="0 0 1" {joint or recipe.joint()}/><inertial pos="0 0 0" mass="1" '
        f'diaginertia="{inertia:.9g} {inertia:.9g} {inertia:.9g}"/></body></worldbody>'
        f"<actuator>{actuator}</actuator></mujoco>")


def _followed(recipe: Recipe, actuator: str, torque: float, goals: Goals, duration: float, start: float = 0.0) -> Array:
    """Return the angles of a joint under a torque that pulls down, at times that are 0.01 s apart [rad]."""
    mujoco = load_mujoco()
    model = arm_of(recipe, actuator, inertia_under(torque))
    data, every = mujoco.MjData(model), round(_LOOK / _TIMESTEP)
    data.qpos[0], data.qfrc_applied[0] = start, -torque
    angles = [start]
    table = goals(np.asarray(_TIMESTEP * np.arange(round(duration / _TIMESTEP)) + 1e-9, np.float64))
    for k, goal in enumerate(table.tolist(), 1):
        data.ctrl[0] = goal
        mujoco.mj_step(model, data)
        if k % every == 0:
            angles.append(float(data.qpos[0]))
    return np.array(angles)


def _droops(recipe: Recipe, actuator: str, torque: float) -> Droops:
    """Return where the joint stands off after a goal that comes slowly, as that of `droops_of_twin`."""
    found = []
    for way in (WAY, -WAY):
        last = _followed(recipe, actuator, torque, partial(eased, way=way), REST + RAMP + SETTLE, -0.5 * way)[-LAST:]
        found.append(0.5 * way - float(last.mean()))
    return Droops(*found)


def _lifted(recipe: Recipe, actuator: str) -> float:
    """Return the most torque that is raised from rest by full drive, by halving [N m]."""
    low, high = 0.0, 2.0 * recipe.most_torque
    for _ in range(_HALVINGS):
        half = 0.5 * (low + high)
        risen = _followed(recipe, actuator, half, lambda time: np.full(len(time), _FROM), 0.5)[-1] > _RAISED
        low, high = (half, high) if risen else (low, half)
    return 0.5 * (low + high)


# --- The nearest of MuJoCo's own actuators to a servo -----------------------------------------------------------------

STICKS = "0.9999 0.9999 0.001"
"""`solimpfriction` of a joint with which MuJoCo's friction loss all but holds; as it is by default, it creeps."""
SHARE = 0.3  # of what a servo lifts: the load that a recipe is for unless another is given
_NO_LOAD = 0.0
_LIGHTEST = 0.02  # of what a servo lifts
_LEAST = 0.1  # of the droop that the linear zone has without friction: what stands nearer has an integral


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A servo as a torque that follows the angle's error and is limited, beside a friction loss: all that MuJoCo has.

    Its gaps are in `lacks`, and how far it is off its servo in `error`.

    Parameters
    ----------
    model : Model
        Of the servo.
    load : float
        Torque under which it stands as the servo does [N m].
    lift : float
        Torque that the servo lifts, from rest [N m].
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
        """The most that the motor gives: what the servo lifts, and friction [N m]."""
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
        return error_of(self)

    @property
    def lacks(self) -> tuple[str, ...]:
        """Parts of the servo that have no place in it."""
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
