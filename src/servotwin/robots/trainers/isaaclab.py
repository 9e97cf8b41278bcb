"""Servos as actuators of Isaac Lab: `ServoActuatorCfg` among the actuators of an articulation."""

from __future__ import annotations

import math
from dataclasses import MISSING
from typing import Any

import torch
import warp as wp
from isaaclab.actuators import ActuatorBase, ActuatorBaseCfg
from isaaclab.utils.configclass import configclass

from servotwin.errors import InputError
from servotwin.robots.servos.command_map import CommandMap
from servotwin.robots.servos.mount import Joint, Mount
from servotwin.robots.trainers.joint_servos import JointServos, armature_of, varied

_FRICTION = ("friction", "dynamic_friction", "viscous_friction")
_NUMBERS = ("armature", "effort_limit", "velocity_limit", "actuator_effort_limit", "actuator_velocity_limit",
            *_FRICTION)  # of Isaac Lab's own actuators, in 2.3 and in 3


class _Own(float):
    """A number of a joint that is the servo's, beside those that a user gives."""


class _Kept:
    """A value that `configclass` leaves alone: in Isaac Lab 3 it sets all fields of dataclasses that it finds."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value: Any = value.value if isinstance(value, _Kept) else value


def _mount_of(kept: Any) -> Mount:
    servo = kept.value if isinstance(kept, _Kept) else kept
    return servo if isinstance(servo, Mount) else Mount(servo)


def _checked(name: str, tensor: Any, shape: tuple[int, ...]) -> torch.Tensor:
    """Return what `meet` was given, or say in a line what is wrong with it: Warp would take it as it is."""
    kind = getattr(tensor, "dtype", "no numbers")
    if kind != torch.float32 or tensor.shape != shape:
        raise InputError(f"{name} of joints with servos",
                         got=f"{type(tensor).__name__} of {kind}, shape {tuple(getattr(tensor, 'shape', ()))}",
                         allowed=f"float32 of PyTorch, shape {shape}: of Isaac Lab 3 .torch")
    found: torch.Tensor = tensor
    return found


class ServoActuator(ActuatorBase):
    """The servos of a `ServoActuatorCfg`, as Isaac Lab calls them.

    Position targets are what the servos are commanded. In each step of physics, before `write_data_to_sim`, `meet`
    takes the inertias and accelerations of the joints. The effort is held for the step and gives the joints the speeds
    that the servos gain in it: of first order.

    Raises
    ------
    InputError
        On bad input: a gear with play or a spring, no timestep, or a `compute` before `meet`.
    """

    def __init__(self, cfg: Any, *args: Any, **more: Any) -> None:
        if not isinstance(cfg.timestep, float) or not 0.0 < cfg.timestep < math.inf:
            raise InputError("timestep of a ServoActuatorCfg", got=cfg.timestep, allowed="a step of physics [s]")
        for gain in ("stiffness", "damping"):  # of the joint's drive, which are 0; of 3's classes only a PD takes them
            more.pop(gain, None)
        super().__init__(cfg, *args, **more)
        mount = _mount_of(cfg.servo)
        joints = [Joint(name, mount, k, k, k, -1, k) for k, name in enumerate(self.joint_names)]
        maps = [CommandMap(name, -math.inf, math.inf) for name in self.joint_names]
        self._servos = JointServos(joints, maps, self._num_envs, wp.get_device(str(self._device)),
                                   torch.initial_seed() % 2**32, "a ServoActuator",
                                   varied(cfg.vary.value, self.joint_names), moves_armature=False)
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

        Raises
        ------
        InputError
            If one of them is no tensor of float32 or of another shape, or if the first mass matrix shows that it has no
            armature on its diagonal although `armature_in_mass_matrix` says so.
        """
        acceleration = _checked("acceleration", acceleration, (
            self._num_envs, *getattr(acceleration, "shape", ())[-1:]))
        joints = acceleration.shape[1]
        size = max(joints, *getattr(mass_matrix, "shape", ())[-1:])
        mass_matrix = _checked("mass_matrix", mass_matrix, (self._num_envs, size, size))
        own = torch.arange(joints, device=acceleration.device)[self.joint_indices]
        base = mass_matrix.shape[-1] - joints
        if self._per_torque is None and self.cfg.armature_in_mass_matrix:  # once: a GPU would wait for the answer
            least = (mass_matrix[:, base + own, base + own] / self.armature).min().item()
            if least < 1.0 - 1e-3:  # inertias of bodies come on top of it, so that this shows
                raise InputError("armature_in_mass_matrix of a ServoActuatorCfg",
                                 got=f"True, and an inertia of {least:.3g} armatures in the mass matrix",
                                 allowed="False where the mass matrix is that of the bodies alone")
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
        if isinstance(env_ids, wp.array):  # of Isaac Lab 3
            env_ids = wp.to_torch(env_ids).long()
        mask[slice(None) if env_ids is None else env_ids] = True
        self._servos.reset(wp.from_torch(mask))


@configclass
class ServoActuatorCfg(ActuatorBaseCfg):
    """Servos at joints of an articulation.

    Rotor and gear are the joint's armature, and friction and ends are the servo's: `armature`, limits of the actuator
    and all friction are refused. Isaac Lab 3 takes it with `SimulationCfg.use_newton_actuators` off alone.

    Parameters
    ----------
    joint_names_expr : list of str
        Joints, as of every `ActuatorBaseCfg`.
    servo : Model or Mount
        The servo at each of these joints; `servo.value` returns it, and `vary.value` what varies.
    timestep : float
        Of physics [s]: `SimulationCfg.dt`.
    vary : mapping, optional
        Distributions of the servo's numbers that vary from environment to environment and from reset to reset, as of
        `sweep`; drawn by PyTorch's seed. Where rotors vary servos stay as drawn first: Isaac Lab 2.3 reads armatures
        once, and in 3 you write `ServoActuator.armature` to the joints.
    armature_in_mass_matrix : bool
        Whether the mass matrix that `meet` gets has the armature on its diagonal; assumed: it has. That of Newton has
        it since 1.8; that of PhysX compare with the one of a joint whose armature is 0.

    Raises
    ------
    InputError
        If a number is given that is the servo's, or `servo` is none.
    """

    class_type: type = ServoActuator
    servo: Any = MISSING
    timestep: Any = MISSING
    vary: Any = None
    armature_in_mass_matrix: bool = True
    stiffness: float | None = 0.0
    damping: float | None = 0.0
    joint_effort_limit: float | None = 1e9  # that of the joint's file would cut what the servo gives, in 3

    def __setattr__(self, name: str, value: Any) -> None:
        """Let rotor and friction be the servo's here: Isaac Lab 3 takes them before there is an actuator."""
        if name in _NUMBERS and value is not None and not isinstance(value, _Own):
            raise InputError(f"{name} of a ServoActuatorCfg", got=value,
                             allowed="none: rotor, gear, friction and ends are the servo's")
        unset = isinstance(value, type(MISSING))
        super().__setattr__(name, _Kept(value) if name in ("servo", "vary") and not unset else value)
        if name == "servo" and not unset:
            super().__setattr__("armature", _Own(armature_of(_mount_of(self.servo))))
            for friction in _FRICTION:
                super().__setattr__(friction, _Own(0.0))
