"""How a servo sits at a joint of a robot: where its zero is, which way it turns, and through what ratio."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from servotwin.datasheet.holding import changed, supply_values
from servotwin.datasheet.warming import thermal_masses
from servotwin.errors import InputError, UnknownNameError
from servotwin.models import AveragedServo, BoundedServo, DigitalServo, Model, PulseServo, PulseServoInductive
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.coupling import actuators_at_joints, couplings_of, tendon_actuators
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters.groups import Supply

SERVOS = (AveragedServo, BoundedServo, PulseServo, PulseServoInductive, DigitalServo)
PASSIVE = {"dof_damping": "damping", "dof_frictionloss": "friction loss"}


@dataclass(frozen=True)
class Mount:
    """A servo at a joint: angle of the joint = `zero` + `direction` · `ratio` · angle of the servo.

    Parameters
    ----------
    model : AveragedServo, BoundedServo, PulseServo, PulseServoInductive or DigitalServo
    zero : float
        Of the joint where the servo's angle is 0: angle of a hinge [rad], place of a slide [m].
    direction : int
        1, or −1 where the joint turns the other way.
    ratio : float
        Of a hinge: turns of the joint per turn of the servo; of a slide: radius of the pinion [m/rad].

    Raises
    ------
    InputError
        If the model is none of these, or a number is not possible.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> Mount(servo, zero=-1.57, direction=-1).direction
    -1
    """

    model: Model
    zero: float = 0.0
    direction: int = 1
    ratio: float = 1.0

    def __post_init__(self) -> None:
        """Check."""
        if not isinstance(self.model, SERVOS):
            raise InputError("servo of a joint", got=self.model, allowed=" or ".join(kind.__name__ for kind in SERVOS))
        if not is_finite(self.zero):
            raise InputError("zero of a servo", got=self.zero, allowed="a finite number of rad (hinge) or m (slide)")
        if self.direction not in (1, -1):
            raise InputError("direction of a servo", got=self.direction, allowed="1 or -1")
        if not is_finite(self.ratio) or not self.ratio > 0.0:
            raise InputError("ratio of a servo", got=self.ratio,
                             allowed="a positive number: turns of a hinge per turn, or m/rad of a slide")

    @property
    def gain(self) -> float:
        """Of the joint per angle of the servo, with its sign."""
        return self.direction * self.ratio


@dataclass(frozen=True)
class Joint:
    """A joint that a servo moves.

    Parameters
    ----------
    name : str
    number : int
        Of the joint in its model.
    angle_at, speed_at : int
        Its places in qpos and qvel.
    actuator, command_at : int
        Number of the actuator that gives its control as the command, and where in `ctrl`; −1 where there is none.
    """

    name: str
    mount: Mount
    number: int
    angle_at: int
    speed_at: int
    actuator: int
    command_at: int


def joints_of(model: Any, servos: Mapping[str, Any]) -> list[Joint]:
    """Return the joints of an MjModel that servos move, checked.

    Raises
    ------
    InputError
        If a joint is not there, is neither hinge nor slide, follows another, or several actuators move it.
    """
    mujoco, couplings = load_mujoco(), couplings_of(model)
    known = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, k) or "" for k in range(model.njnt)]
    found = []
    for name, given in servos.items():
        mount = given if isinstance(given, Mount) else Mount(given)
        if name not in known:
            _refuse(mujoco, model, name, known)
        if name in couplings:
            raise InputError(f"servo of joint {name}", got="one of its own",
                             allowed=f"none: {couplings[name].words}")
        number = known.index(name)
        kind = mujoco.mjtJoint(model.jnt_type[number])
        if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            raise InputError(f"joint {name}", got=f"a {kind.name.removeprefix('mjJNT_').lower()} joint",
                             allowed="a hinge or a slide: one servo moves one degree of freedom")
        dof = int(model.jnt_dofadr[number])
        actuator, command_at = _actuator(mujoco, model, name, number)
        found.append(Joint(name, mount, number, int(model.jnt_qposadr[number]), dof, actuator, command_at))
    return found


def _refuse(mujoco: Any, model: Any, name: str, known: list[str]) -> None:
    """Raise InputError for what is not a joint, and say what it is instead."""
    tendon = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name)
    if tendon >= 0:
        raise InputError(f"joint {name}", got="a tendon", allowed="a hinge or a slide: a servo sits at a joint")
    raise UnknownNameError("joint", name, [one for one in known if one])


def _actuator(mujoco: Any, model: Any, name: str, joint: int) -> tuple[int, int]:
    """Return the one actuator at a joint, and the place of its control; −1 where there is none."""
    own = [k for k in actuators_at_joints(model) if model.actuator_trnid[k, 0] == joint]
    pulling = tendon_actuators(model, joint)
    if pulling:
        raise InputError(f"actuators of joint {name}", got=f"{', '.join(pulling)} at a tendon of it",
                         allowed="none beside the servo: leave it out of the model")
    if len(own) > 1:
        names = ", ".join(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or str(k) for k in own)
        raise InputError(f"actuators of joint {name}", got=names, allowed="one, whose control commands the servo")
    if not own:
        return -1, -1
    return own[0], int(model.actuator_ctrladr[own[0]]) if hasattr(model, "actuator_ctrladr") else own[0]


def treat_friction(model: Any, joints: list[Joint], friction: str) -> None:
    """Refuse, clear or keep what the joints have of friction themselves.

    Raises
    ------
    InputError
        If `friction` is none of these words, or a joint has some that is refused; names it.
    """
    if friction not in ("refuse", "clear", "keep"):
        raise InputError("joint_friction", got=friction, allowed="'refuse', 'clear' or 'keep'")
    dofs = [joint.speed_at for joint in joints]
    if friction == "clear":
        for field in PASSIVE:
            getattr(model, field)[dofs] = 0.0
    if friction != "refuse":
        return
    for field, word in PASSIVE.items():
        own = [f"{joint.name} {getattr(model, field)[joint.speed_at]:g}" for joint in joints
               if (getattr(model, field)[joint.speed_at] != 0.0).any()]
        if own:
            raise InputError(f"{word} of joints with servos", got=", ".join(own), allowed="0, for friction is the "
                             "servo's: joint_friction='clear' sets it so, 'keep' leaves it as the bearing's")



def with_heat(model: Model) -> Model:
    """Return a model whose winding and housing get warm, with thermal masses assumed by its mass if it has none.

    A servo of which the mass is not known either stays as it is, and so does a model without temperatures.

    Examples
    --------
    >>> import servotwin as st
    >>> "winding_temperature" in with_heat(st.PulseServo(st.load_servo("hitec-hs-755hb"))).available
    True
    """
    masses = thermal_masses(model.servo)
    if masses is None or not masses.assumed or "thermal.winding_capacity" not in model.optional:
        return model
    return changed(model, {f"thermal.{name}": getattr(masses, name) for name in _NUMBERS})


def warm_mounts(servos: Mapping[str, Model | Mount], *, assume_heat: bool, shared: bool) -> dict[str, Mount]:
    """Return mounts of servos, with thermal numbers by their mass where that is asked for and possible."""
    if not isinstance(servos, Mapping) or not servos:
        raise InputError("servos of a robot", got=servos, allowed="a mapping of joints to models")
    found = {name: given if isinstance(given, Mount) else Mount(given) for name, given in servos.items()}
    if not assume_heat:
        return found
    warm: dict[int, Model] = {id(mount.model): with_heat(mount.model) for mount in found.values()}
    known = [model.servo.thermal.winding_capacity is not None for model in warm.values()]
    if shared and not all(known):  # servos on a shared supply all have thermal masses, or none
        return found
    return {name: replace(mount, model=warm[id(mount.model)]) for name, mount in found.items()}


def heat_notes(given: Mapping[str, Model | Mount], mounts: Mapping[str, Mount]) -> tuple[str, ...]:
    """Return sentences on thermal numbers that mounts have and their servos were given without, and on none at all."""
    assumed, unknown = [], []
    for joint, mount in mounts.items():
        servo = given[joint]
        own = servo.model if isinstance(servo, Mount) else servo
        if mount.model is not own:
            assumed.append(joint)
        elif "thermal.winding_capacity" in own.optional and "winding_temperature" not in own.available:
            unknown.append(joint)
    said = []
    if assumed:
        said.append(f"thermal numbers of {', '.join(assumed)} are assumed by the servo's mass")
    if unknown:
        said.append(f"temperatures of {', '.join(unknown)} are not known: the servo has no thermal numbers, and no "
                    "mass either, or shares its supply with such a one")
    return tuple(said)


def supplied(model: Model, supply: Supply | None) -> Model:
    """Return a model on a supply that it shares with others, as if it were alone on it; as it is on its own one.

    Raises
    ------
    InputError
        If the supply has no voltage, or one that is not for this servo.
    """
    if isinstance(model, AveragedServo):  # its law has no supply, but the servo has
        model = BoundedServo(model.servo)
    if supply is None:
        return model
    return changed(model, supply_values(model.servo, supply))

_NUMBERS = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient", "ambient",
            "magnet_coefficient")
