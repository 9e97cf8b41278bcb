"""Servos as actuators of mjlab: `ServoActuatorCfg` among the actuators of an entity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, MissingExtraError
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.mount import Mount, joints_of, treat_friction
from servotwin.robots.trainers.warp_drive import WarpDrive

try:
    import torch
    import warp as wp
    from mjlab.actuator import Actuator, ActuatorCfg, ActuatorCmd
    from mjlab.actuator.actuator import TransmissionType
    from mjlab.utils.spec import create_motor_actuator
except ImportError as error:
    raise MissingExtraError(error.name or "mjlab", "mjlab") from None

if TYPE_CHECKING:
    from servotwin.models import Model

_NUMBERS = ("armature", "frictionloss", "viscous_damping")  # of mjlab's own actuators


@dataclass(kw_only=True)
class ServoActuatorCfg(ActuatorCfg):
    """Servos at joints of an entity, in all worlds of a scene.

    Position targets of the entity are what the servos are commanded, after mjlab's own delay where that is set. Rotor
    and gear are the joint's armature, and friction is the servo's: `armature`, `frictionloss` and `viscous_damping` are
    refused. All servos of a scene are those of one `WarpDrive`. On a GPU, mjlab captures graphs when the simulation is
    made, before entities are initialized: an environment captures them anew, other programs call
    `Simulation.create_graph`.

    Parameters
    ----------
    target_names_expr : tuple of str
        Joints, as of every `ActuatorCfg`; its delay too.
    servo : Model or Mount
        The servo at each of these joints.
    joint_friction : {"refuse", "clear", "keep"}
        Of the joints themselves, as of `ServoDrive`.
    vary : mapping, optional
        Distributions of the servo's numbers that vary from world to world and from reset to reset, as of `sweep`; drawn
        by PyTorch's seed. `ServoActuator.drive.parameters` returns them.

    Raises
    ------
    InputError
        On bad input.
    MissingExtraError
        If mjlab is not installed.
    """

    servo: Model | Mount
    joint_friction: str = "refuse"
    vary: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        """Check."""
        given = [name for name in _NUMBERS if getattr(self, name) is not None]
        if given:
            raise InputError(f"{given[0]} of a ServoActuatorCfg", got=getattr(self, given[0]),
                             allowed="none: rotor, gear and friction are the servo's")
        if self.transmission_type != TransmissionType.JOINT:
            raise InputError("transmission_type of a ServoActuatorCfg", got=self.transmission_type.value,
                             allowed="joint: a servo sits at a joint")
        super().__post_init__()

    def build(self, entity: Any, target_ids: list[int], target_names: list[str]) -> ServoActuator:
        """Return the actuator of an entity's joints."""
        return ServoActuator(self, entity, target_ids, target_names)


class ServoActuator(Actuator[ServoActuatorCfg]):
    """The servos of a `ServoActuatorCfg`, as mjlab calls them."""

    @property
    def drive(self) -> WarpDrive:
        """All servos of the scene."""
        found: WarpDrive = self._model.callback.control.__self__
        return found

    @property
    def torque(self) -> torch.Tensor:
        """Of these servos in the latest step, shape (worlds, joints) [N m]."""
        found: torch.Tensor = wp.to_torch(self.drive.torque)[:, self._places]
        return found

    def edit_spec(self, spec: Any, target_names: list[str]) -> None:
        """Put an actuator at each joint, whose control is the servo's command; the drive takes its force away."""
        for name in target_names:
            actuator = create_motor_actuator(spec, name, effort_limit=1.0)
            actuator.forcelimited = actuator.ctrllimited = False
            self._mjs_actuators.append(actuator)

    def initialize(self, mj_model: Any, model: Any, data: Any, device: str) -> None:
        """Put the servos beside those that the scene has already."""
        super().initialize(mj_model, model, data, device)
        bridge, model = model, model.struct  # mjlab's bridge to tensors stands before it
        mujoco, own = load_mujoco(), {}
        for actuator in self._global_ctrl_ids.tolist():
            joint = int(mj_model.actuator_trnid[actuator, 0])
            own[mujoco.mj_id2name(mj_model, mujoco.mjtObj.mjOBJ_JOINT, joint)] = self.cfg.servo
        treat_friction(mj_model, joints_of(mj_model, own), self.cfg.joint_friction)
        others = getattr(model.callback.control, "__self__", None)
        if model.callback.control and not isinstance(others, WarpDrive):
            raise InputError("callback.control of the scene's model", got="a function of another program",
                             allowed="none: servos advance there")
        servos = (others.servos if others else {}) | own
        vary = (others.vary if others else {}) | dict.fromkeys(own, self.cfg.vary or {})
        drive = WarpDrive(mj_model, servos, data.nworld, joint_friction="keep", vary=vary, device=device,
                          seed=torch.initial_seed() % 2**32)
        drive.attach(model)
        bridge.clear_cache()
        self._model, self._places = model, [drive.joints.index(name) for name in own]

    def compute(self, cmd: ActuatorCmd) -> torch.Tensor:
        """Return the commands of the servos: the position targets [rad, m]."""
        return cmd.position_target

    def reset(self, env_ids: torch.Tensor | slice | None = None) -> None:
        """Put servos of some worlds to rest where the next step finds their joints."""
        super().reset(env_ids)
        drive = self.drive
        mask = torch.zeros(drive.worlds, dtype=torch.bool, device=self._target_ids.device)
        mask[slice(None) if env_ids is None else env_ids] = True
        drive.reset(wp.from_torch(mask))
