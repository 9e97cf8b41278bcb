"""Servos as actuators of Newton: `add_servos` to a builder, then each is a drive of Newton's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.command_map import CommandMap
from servotwin.robots.servos.mount import PASSIVE, Joint, Mount
from servotwin.robots.trainers.joint_servos import JointServos, armature_of, varied
from servotwin.robots.trainers.warp_drive import WarpDrive

try:
    import newton
    import warp as wp
    from newton.actuators import DriveBase
except ImportError as error:
    raise MissingExtraError(error.name or "newton", "newton") from None

from servotwin.robots.trainers import warp_kernels as kernels

if TYPE_CHECKING:
    from servotwin.models import Model

_FRICTION = dict(zip(("joint_damping", "joint_friction"), PASSIVE.values(), strict=True))
_TARGETS = ("joint_target_ke", "joint_target_kd")


class _Robot:
    """The servos of a robot, joint after joint; each is one of its own, whatever it has."""

    def __init__(self, names: list[str], mounts: list[Mount], vary: list[Any], seed: int) -> None:
        self.names, self.mounts, self.vary, self.seed = names, mounts, vary, seed


def add_servos(builder: Any, servos: Mapping[str, Model | Mount], *, joint_friction: str = "refuse",
               vary: Mapping[str, Any] | None = None, seed: int = 0) -> None:
    """Put servos at joints of a robot in one of Newton's builders, before it is replicated or finalized.

    Rotor and gear become the joints' armature, and targets of Newton's own solvers there are taken away. The model has
    one actuator for all of them, whose drive is a `DriveServo`.

    Parameters
    ----------
    builder : newton.ModelBuilder
    servos : mapping of str to Model or Mount
        By the label of the joint, or by its last part, behind a slash.
    joint_friction : {"refuse", "clear", "keep"}
        Of the joints themselves, as of `ServoDrive`.
    vary : mapping, optional
        Distributions of servos' numbers that vary from world to world and from reset to reset, as of `WarpDrive`; not
        the inertia of rotors.
    seed : int
        Of all noise, and of what varies.

    Raises
    ------
    InputError
        On bad input: there is no such joint, it has not one degree of freedom, or friction of its own.
    """
    if joint_friction not in ("refuse", "clear", "keep"):
        raise InputError("joint_friction", got=joint_friction, allowed="'refuse', 'clear' or 'keep'")
    if not isinstance(servos, Mapping) or not servos:
        raise InputError("servos of a robot", got=servos, allowed="a mapping of joints to models")
    if any(entry.drive_class is DriveServo for entry in builder.actuator_entries.values()):
        raise InputError("servos of a robot", got="a second time", allowed="all of a robot at once: its joints act on "
                         "each other")
    mounts = [given if isinstance(given, Mount) else Mount(given) for given in servos.values()]
    places = [_place(builder, name) for name in servos]
    robot = _Robot(list(servos), mounts, varied(vary, list(servos)), seed)
    armature = [armature_of(mount) for mount in mounts]
    for (field, word), (name, (_, dof)) in product(_FRICTION.items(), zip(servos, places, strict=True)):
        if joint_friction == "refuse" and getattr(builder, field)[dof] != 0.0:
            raise InputError(f"{word} of joint {name}", got=getattr(builder, field)[dof], allowed="0, for friction is "
                             "the servo's: joint_friction='clear' sets it so, 'keep' leaves it as the bearing's")
    for k, (position, dof) in enumerate(places):
        for field in (*_TARGETS, *(_FRICTION if joint_friction == "clear" else ())):
            getattr(builder, field)[dof] = 0.0
        builder.joint_armature[dof] = armature[k]
        builder.add_actuator(DriveServo, dof, pos_index=position, place=float(k), robot=robot)


def servos_in(solver: Any, servos: Mapping[str, Model | Mount], *, timestep: float, joint_friction: str = "refuse",
              vary: Mapping[str, Any] | None = None, seed: int = 0) -> WarpDrive:
    """Return servos at joints within a `SolverMuJoCo`, instead of drives of Newton's: gears may have play there.

    `WarpDrive.command` tells them where to go, by the names that its attribute `joints` has. No other actuator and no
    target may be at these joints.

    Parameters
    ----------
    solver : newton.solvers.SolverMuJoCo
        On MuJoCo Warp.
    servos : mapping of str to Model or Mount
        By the label of the joint in the first world, or by its last part, behind a slash.
    timestep : float
        Of each `solver.step` [s].
    joint_friction, vary, seed
        As of `WarpDrive`.

    Raises
    ------
    InputError
        On bad input: there is no such joint, or the solver runs on MuJoCo's own processor code.
    """
    if getattr(solver, "mjw_data", None) is None:
        raise InputError("solver of servos", got=type(solver).__name__, allowed="SolverMuJoCo on MuJoCo Warp")
    mujoco = load_mujoco()
    labels = {solver.model.joint_label[own]: mujoco.mj_id2name(solver.mj_model, mujoco.mjtObj.mjOBJ_JOINT, k)
              for k, own in enumerate(solver.mjc_jnt_to_newton_jnt.numpy()[0].tolist()) if own >= 0}
    found = {labels[_label(list(labels), name)]: servo for name, servo in servos.items()}
    drive = WarpDrive(solver.mj_model, found, solver.mjw_data.nworld, joint_friction=joint_friction, vary=vary,
                      timestep=timestep, device=str(solver.model.device), seed=seed)
    drive.attach(solver.mjw_model)
    return drive


def _label(labels: list[str], name: str) -> str:
    """Return the label that a name means: a whole one, or its last part."""
    found = [label for label in labels if label == name] or [
        label for label in labels if label.rsplit("/", 1)[-1] == name]
    if not found:
        raise UnknownNameError("joint", name, labels)
    if len(found) > 1:
        raise InputError(f"joint {name}", got=", ".join(found), allowed="the whole label of one")
    return found[0]


def _place(builder: Any, name: str) -> tuple[int, int]:
    """Return the places of a joint among positions and among velocities."""
    labels = list(builder.joint_label)
    k = labels.index(_label(labels, name))
    kind = newton.JointType(builder.joint_type[k])
    if kind not in (newton.JointType.REVOLUTE, newton.JointType.PRISMATIC):
        raise InputError(f"joint {name}", got=kind.name.lower(),
                         allowed="revolute or prismatic: one servo moves one degree of freedom")
    return int(builder.joint_q_start[k]), int(builder.joint_qd_start[k])


class DriveServo(DriveBase):
    """The servos of a robot in all worlds, as one of Newton's drives; made by `add_servos`.

    Position targets are what the servos are commanded. In each step, before `Actuator.step`, `meet` gives the drive the
    inertias and accelerations of the joints. The effort is held for the step and gives the joints the speeds that the
    servos gain in it: of first order. Clamping, and a solver's own friction at these joints, would come on top.

    Attributes
    ----------
    torque : warp.array, shape (worlds, joints)
        Of the servos in the latest step, at the joints [N m].

    Raises
    ------
    InputError
        If a gear has play or a spring, or the effort is asked for before `meet`.
    """

    SHARED_PARAMS: ClassVar[set[str]] = {"robot"}

    @dataclass
    class State(DriveBase.State):
        """Servos that begin anew in the next step; all else stays with the drive, for it is one step further."""

        fresh: Any = None

        def reset(self, mask: Any = None) -> None:
            """Let servos begin anew, at rest where their joints are: all of a world in which one is of the mask."""
            if mask is None:
                self.fresh.fill_(True)
            else:
                wp.copy(self.fresh, mask)

    def __init__(self, place: Any, robot: _Robot) -> None:
        self._place, self._robot = place, robot
        self._response: Any = None
        self._dof: Any = None

    @classmethod
    def resolve_arguments(cls, args: dict[str, Any]) -> dict[str, Any]:
        """Return the arguments that `add_servos` gives."""
        if "robot" not in args:
            raise InputError("DriveServo", got="add_actuator(DriveServo)", allowed="add_servos(builder, servos)")
        return {"place": args["place"], "robot": args["robot"]}

    def finalize(self, device: Any, num_actuators: int) -> None:
        """Lay the servos of all worlds out on the device."""
        robot, count = self._robot, len(self._robot.mounts)
        worlds = num_actuators // count
        order = self._place.numpy()
        if not np.array_equal(order, np.tile(np.arange(count), worlds)):
            raise InputError("actuators of servos", got="some of a robot's", allowed="those of whole robots, one after "
                             "the other: builder.replicate or add_world")
        own = [Joint(name, mount, k, k, k, -1, k)
               for k, (name, mount) in enumerate(zip(robot.names, robot.mounts, strict=True))]
        maps = [CommandMap(name, -math.inf, math.inf) for name in robot.names]
        self._device, self._count = device, count
        self._servos = JointServos(own, maps, worlds, device, robot.seed, "a robot", robot.vary)
        self._servos.check_rigid()
        if self._servos.rotors_vary:
            raise InputError("vary of a robot's servos", got="the inertia of rotors", allowed="all else: worlds of a "
                             "builder have one armature")
        self.torque = self._servos.torque
        with wp.ScopedDevice(device):
            self._angle, self._speed, self._goal, self._free, self._at_rest = (
                wp.zeros((worlds, count), dtype=float) for _ in range(5))
            self._per_torque = wp.zeros((worlds, count, count), dtype=float)
            self._anew = wp.zeros(worlds, dtype=wp.bool)

    def meet(self, model: Any, actuator: Any, state: Any, *, solver: Any = None, forces: Any = None) -> None:
        """Find the inertias that joints have at a state, and the accelerations that they have without the servos.

        Parameters
        ----------
        model : newton.Model
        actuator : newton.actuators.Actuator
            The one that has this drive.
        state : newton.State
        solver : newton.solvers.SolverMuJoCo, optional
            Accelerations are those of its last step less what the servos gave, with contacts and all else.
        forces : warp.array, shape (degrees of freedom,), optional
            Without a solver accelerations are those by gravity, by Coriolis forces, and by these [N m, N].
        """
        if self._response is None:
            self._lay_out(model, actuator)
        self._by_solver = solver is not None
        self._response.refresh(state)
        inverse, slots = self._response.inverse_blocks, self._articulation.shape[0]
        with wp.ScopedDevice(self._device):
            wp.launch(kernels.gather_inverse, dim=(slots, self._count), inputs=[
                inverse, self._articulation, self._local, self._count, self._per_torque])
            self._scratch.joint_q, self._scratch.joint_qd = state.joint_q, state.joint_qd
            newton.eval_fk(model, state.joint_q, state.joint_qd, self._scratch)
            newton.eval_inverse_dynamics_passive(model, self._scratch, gravity_force=self._gravity,
                                                 coriolis_force=self._coriolis)
            wp.launch(kernels.free_by_forces, dim=slots, inputs=[
                inverse, self._articulation, self._local, self._start, self._dofs, self._gravity, self._coriolis,
                forces, self._count, self._free])
            if solver is None:
                return
            if self._dof is None:
                self._dof = self._dofs_of(solver, actuator)
            wp.copy(self._at_rest, self._free)
            wp.launch(kernels.free_by_acceleration, dim=slots, inputs=[
                solver.mjw_data.qacc, self._dof, self._per_torque, self.torque, self._count, self._free])

    def _lay_out(self, model: Any, actuator: Any) -> None:
        """Find in which articulation each joint is, and where there."""
        joints, dofs = model.joint_qd_start.numpy(), actuator.indices.numpy().astype(int)
        starts = joints[model.articulation_start.numpy()[:model.articulation_count]]
        ends = joints[model.articulation_end.numpy()[:model.articulation_count]]
        tree = np.searchsorted(starts, dofs, side="right") - 1
        if (tree < 0).any() or (dofs >= ends[tree]).any():
            raise InputError("joints with servos", got="one in no articulation", allowed="joints of articulations")
        with wp.ScopedDevice(self._device):
            self._articulation, self._local, self._start, self._dofs = (
                wp.array(np.ascontiguousarray(one, np.int32), dtype=int)
                for one in (tree, dofs - starts[tree], starts, ends - starts))
            self._gravity, self._coriolis = (wp.zeros(model.joint_dof_count, dtype=float) for _ in range(2))
            self._scratch = model.state()
            self._response = newton.actuators.JointSpaceResponse(model)

    def _dofs_of(self, solver: Any, actuator: Any) -> Any:
        """Return the places of joints in `qacc` of MuJoCo Warp, world after world."""
        if getattr(solver, "mjw_data", None) is None:
            raise InputError("solver of servos", got=type(solver).__name__,
                             allowed="SolverMuJoCo on MuJoCo Warp; forces= takes what other solvers have")
        table, dofs = solver.mjc_dof_to_newton_dof.numpy(), actuator.indices.numpy().reshape(self._free.shape)
        return wp.array(np.array([[np.flatnonzero(row == dof)[0] for dof in own]
                                  for row, own in zip(table, dofs, strict=True)], np.int32), dtype=int)

    def compute(self, positions: Any, velocities: Any, target_pos: Any, target_vel: Any, feedforward: Any,
                pos_indices: Any, vel_indices: Any, target_pos_indices: Any, target_vel_indices: Any, forces: Any,
                state: Any, dt: float, device: Any = None, *, custom_inputs: Any = None) -> None:
        """Advance all servos by a step, and give the efforts [N m, N]."""
        if self._response is None:
            raise InputError("inertias of joints with servos", got="none", allowed="drive.meet(...) before each step")
        with wp.ScopedDevice(self._device):
            if state is not None:
                self._anew.zero_()
                wp.launch(kernels.any_of_world, dim=state.fresh.shape[0], inputs=[state.fresh, self._count, self._anew])
                self._servos.reset(self._anew)
                state.fresh.zero_()
                if self._by_solver:  # whose last step was before
                    wp.launch(kernels.take, dim=self._free.shape, inputs=[self._anew, self._at_rest, self._free])
            wp.launch(kernels.gather, dim=forces.shape[0], inputs=[
                positions, velocities, target_pos, pos_indices, vel_indices, target_pos_indices, self._count,
                self._angle, self._speed, self._goal])
            self._servos.begin(self._angle)
            self._servos.advance(dt, self._angle, self._speed, self._goal, self._free, self._per_torque,
                                 forces.reshape(self._free.shape))

    def parameters(self) -> dict[str, dict[str, Any]]:
        """Return the numbers of servos that vary, as they are now: arrays (worlds,) by joint and dotted name."""
        return self._servos.parameters()

    def is_stateful(self) -> bool:
        """Return True: servos have memories."""
        return True

    def is_graphable(self) -> bool:
        """Return whether a CUDA graph takes it in: on a GPU."""
        return not self._device.is_cpu

    def state(self, num_actuators: int, device: Any) -> DriveServo.State:
        """Return a state in which no servo begins anew."""
        return DriveServo.State(wp.zeros(num_actuators, dtype=wp.bool, device=device))

    def update_state(self, current_state: DriveServo.State, next_state: DriveServo.State) -> None:
        """Carry which servos begin anew over to the next state: none, after a step."""
        wp.copy(next_state.fresh, current_state.fresh)
