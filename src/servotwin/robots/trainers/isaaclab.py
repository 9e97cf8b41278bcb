"""Servos as actuators of Isaac Lab: `ServoActuatorCfg` among the actuators of an articulation."""

from __future__ import annotations

import math
from dataclasses import MISSING
from typing import Any

import torch
import warp as wp
from isaaclab.actuators import ActuatorBase, ActuatorBaseCfg
from isaaclab.utils import configclass

from servotwin.errors import InputError
from servotwin.robots.servos.command_map import CommandMap
from servotwin.robots.servos.mount import Joint, Mount
from servotwin.robots.trainers.joint_servos import JointServos, armature_of, varied

_FRICTION = ("friction", "dynamic_friction", "viscous_friction")
_NUMBERS = ("armature", "effort_limit", "velocity_limit", *_FRICTION)  # of Isaac Lab's own actuators


class ServoActuator(ActuatorBase):
    """The servos of a `ServoActuatorCfg`, as Isaac Lab calls them.

    Position targets are what the servos are commanded. In each step of physics, before `write_data_to_sim`, `meet`
    takes the inertias and accelerations of the joints. The effort is held for the step and gives the joints the speeds
    that the servos gain in it: of first order.

    Raises
    ------
    InputError
        On bad input: a gear with play or a spring, no timestep, numbers that are the servo's, or a `compute` before
        `meet`.
    """

    def __init__(self, cfg: Any, *args: Any, **more: Any) -> None:
        given = [name for name in _NUMBERS if getattr(cfg, name, None) is not None]
        if given:
            raise InputError(f"{given[0]} of a ServoActuatorCfg", got=getattr(cfg, given[0]),
                             allowed="none: rotor, gear, friction and ends are the servo's")
        if not isinstance(cfg.timestep, float) or not 0.0 < cfg.timestep < math.inf:
            raise InputError("timestep of a ServoActuatorCfg", got=cfg.timestep, allowed="a step of physics [s]")
        mount = cfg.servo if isinstance(cfg.servo, Mount) else Mount(cfg.servo)
        cfg.armature, cfg.stiffness, cfg.damping = armature_of(mount), 0.0, 0.0
        for name in _FRICTION:
            if hasattr(cfg, name):
                setattr(cfg, name, 0.0)
        super().__init__(cfg, *args, **more)
        joints = [Joint(name, mount, k, k, k, -1, k) for k, name in enumerate(self.joint_names)]
        maps = [CommandMap(name, -math.inf, math.inf) for name in self.joint_names]
        self._servos = JointServos(joints, maps, self._num_envs, wp.get_device(str(self._device)),
                                   torch.initial_seed() % 2**32, "a ServoActuator",
                                   varied(cfg.vary, self.joint_names), moves_armature=False)
        self._servos.check_rigid()
        self.armature = torch.as_tensor(self._servos.armature, dtype=torch.float32, device=self._device)
        self.torque = wp.to_torch(self._servos.torque)  # of the servos in the latest step
        self._per_torque: Any = None

    def meet(self, mass_matrix: torch.Tensor, acceleration: torch.Tensor) -> None:
        """Take the inertias that joints have now, and the accelerations that they had in the last step.

        Parameters
        ----------
        mass_matrix : torch.Tensor, shape (environments, n, n)
            Of the articulation, of which the last rows are those of its joints, behind those of a free base.
        acceleration : torch.Tensor, shape (environments, joints)
            Of all joints of the articulation [rad/s²].
        """
        joints = acceleration.shape[1]
        own = torch.arange(joints, device=acceleration.device)[self.joint_indices]
        base = mass_matrix.shape[-1] - joints
        if not self.cfg.armature_in_mass_matrix:
            mass_matrix = mass_matrix.clone()
            mass_matrix[:, base + own, base + own] += self.armature
        inverse = torch.linalg.inv(mass_matrix)
        self._per_torque = inverse[:, base + own][:, :, base + own].contiguous()
        given = torch.bmm(self._per_torque, self.torque.unsqueeze(-1)).squeeze(-1)
        self._free = (acceleration[:, own] - given).contiguous()

    def compute(self, control_action: Any, joint_pos: torch.Tensor, joint_vel: torch.Tensor) -> Any:
        """Advance all servos by a step, and give the efforts [N m, N]."""
        if self._per_torque is None:
            raise InputError("inertias of joints with servos", got="none", allowed="meet(...) before each step")
        angle, speed, goal = (wp.from_torch(one.contiguous()) for one in (
            joint_pos, joint_vel, control_action.joint_positions))
        self._servos.begin(angle)
        self._servos.advance(self.cfg.timestep, angle, speed, goal, wp.from_torch(self._free),
                             wp.from_torch(self._per_torque), wp.from_torch(self.computed_effort))
        self.applied_effort[:] = self.computed_effort
        control_action.joint_positions = control_action.joint_velocities = None
        control_action.joint_efforts = self.applied_effort
        return control_action

    def parameters(self) -> dict[str, dict[str, Any]]:
        """Return the numbers of servos that vary, as they are now: arrays (environments,) by joint and dotted name."""
        return self._servos.parameters()

    def reset(self, env_ids: Any) -> None:
        """Let servos of some environments begin anew, at rest where the next step finds their joints."""
        mask = torch.zeros(self._num_envs, dtype=torch.bool, device=self.torque.device)
        mask[slice(None) if env_ids is None else env_ids] = True
        self._servos.reset(wp.from_torch(mask))


@configclass
class ServoActuatorCfg(ActuatorBaseCfg):
    """Servos at joints of an articulation.

    Rotor and gear are the joint's armature, and friction and ends are the servo's: `armature`, the limits and all
    friction are refused.

    Parameters
    ----------
    joint_names_expr : list of str
        Joints, as of every `ActuatorBaseCfg`.
    servo : Model or Mount
        The servo at each of these joints.
    timestep : float
        Of physics [s]: `SimulationCfg.dt`.
    vary : mapping, optional
        Distributions of the servo's numbers that vary from environment to environment and from reset to reset, as of
        `sweep`; drawn by PyTorch's seed. Where rotors vary servos stay as drawn first: armatures are read once.
    armature_in_mass_matrix : bool
        Whether the mass matrix that `meet` gets has the armature on its diagonal; assumed: it has. Compare it with that
        of a joint whose armature is 0.
    """

    class_type: type = ServoActuator
    servo: Any = MISSING
    timestep: Any = MISSING
    vary: Any = None
    armature_in_mass_matrix: bool = True
    stiffness: float | None = None
    damping: float | None = None
