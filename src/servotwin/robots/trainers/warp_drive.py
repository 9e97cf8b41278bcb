"""`WarpDrive`: servos at the joints of a MuJoCo model in all worlds of MuJoCo Warp."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.errors import InputError, MissingExtraError
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.command_map import CommandMap
from servotwin.robots.servos.coupling import FORCES
from servotwin.robots.servos.mount import PASSIVE, Mount, joints_of, treat_friction
from servotwin.robots.servos.record import LEAST, set_iterations
from servotwin.robots.servos.servo_groups import check_options, maps_of, put_into_model
from servotwin.robots.trainers.joint_servos import JointServos, load_warp, varied
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.models import Model


_WEIGHTS = ("dof_invweight0", "body_invweight0", "tendon_invweight0")  # of the model at rest, in its constraints


class WarpDrive:
    """Servos at joints of a MuJoCo model, in each world of MuJoCo Warp, on its device.

    A joint's angle is `zero + direction · ratio · servo's angle` (`Mount`). Rotor and gear become the joint's armature;
    an actuator at the joint gives its `ctrl` as the servo's command and no force of its own any more, as for
    `ServoDrive`. In each step a servo meets the inertia 1/(M⁻¹)ᵢᵢ and the acceleration that its joint would have
    without it, by contacts and other servos as they were a step before; the torques that let the joints gain the
    speeds that the servos gain are in `qfrc_applied` for the step, where nobody else may put any for these joints. That
    is of first order in the step. Where `forward` is called too, servos advance once in a step all the same: a world
    whose time has not passed begins the step anew. Where a gear has play or a spring the joint has the inertia of its
    output wheel alone, and the solver's iterations are raised to 10 and 20 as by `ServoDrive`.

    Parameters
    ----------
    model : MjModel
        It is changed: armature of these joints, and gains of their actuators.
    servos : mapping of str to Model or Mount
        By the name of the joint.
    worlds : int
        Number of worlds: `nworld` of the data.
    controls, joint_friction
        As of `ServoDrive`.
    vary : mapping, optional
        Distributions of servos' numbers that vary from world to world, by their dotted names and in the words of
        `sweep`, for all servos; or a mapping of joints to such mappings. `st.distributions.stated(servo)` has those of
        a servo file. A world whose servos are reset has others from then on; `parameters` returns them.
    timestep : float, optional
        Of a step [s]; that of the model unless given.
    device : str, optional
        "cpu" or "cuda:0", ...; that on which Warp is unless given.
    seed : int
        Of all noise, and of what varies.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints, in the order of `torque`.
    servos, vary : mapping
        As given, by joint.
    torque : warp.array, shape (worlds, joints)
        Of the servos in the latest step, at the joints [N m].

    Raises
    ------
    InputError
        Or one of its kinds, on bad input.
    MissingExtraError
        If MuJoCo Warp is not installed.
    """

    def __init__(self, model: Any, servos: Mapping[str, Model | Mount], worlds: int = 1, *,
                 controls: Mapping[str, CommandMap] | None = None, joint_friction: str = "refuse",
                 vary: Mapping[str, Any] | None = None, timestep: float | None = None, device: str | None = None,
                 seed: int = 0) -> None:
        mujoco, (self._wp, self._mjw, self._kernels) = load_mujoco(), _load_warp()
        if not isinstance(model, mujoco.MjModel):
            raise InputError("model of a WarpDrive", got=type(model).__name__, allowed="an MjModel")
        if not isinstance(servos, Mapping) or not servos:
            raise InputError("servos of a WarpDrive", got=servos, allowed="a mapping of joints to models")
        if isinstance(worlds, bool) or not isinstance(worlds, int) or worlds < 1:
            raise InputError("worlds", got=worlds, allowed="a whole number, at least 1")
        if timestep is not None and not (is_finite(timestep) and timestep > 0.0):
            raise InputError("timestep", got=timestep, allowed="a positive number of seconds")
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise InputError("integrator of the model", got="RK4", allowed="Euler, implicit or implicitfast")
        own = joints_of(model, servos)
        check_options(mujoco, model, own)
        maps = maps_of(model, own, controls)
        treat_friction(model, own, joint_friction)
        self._model, self.servos = model, dict(servos)
        self.joints, self.worlds = tuple(joint.name for joint in own), worlds
        self._device = self._wp.get_device(device)
        self._timestep = float(model.opt.timestep if timestep is None else timestep)
        self.vary = dict(zip(self.joints, varied(vary, self.joints), strict=True))
        self._servos = JointServos(own, maps, worlds, self._device, seed, "a WarpDrive", list(self.vary.values()))
        self.torque = self._servos.torque
        set_iterations(model, own, "raised")
        put_into_model(mujoco, model, own, np.median(self._servos.armature, axis=0))
        self._armature: Any = None  # of the attached model, where rotors vary
        self._changed = [joint.speed_at for joint in own], [joint.actuator for joint in own if joint.actuator >= 0]
        count, nv = len(own), int(model.nv)
        with self._wp.ScopedDevice(self._device):
            zeros = self._wp.zeros
            self._again, self._time = zeros(worlds, dtype=self._wp.bool), self._wp.full(worlds, math.nan, dtype=float)
            self._per_torque = zeros((worlds, count, count), dtype=float)
            self._forces, self._free, self._solved = (zeros((worlds, nv), dtype=float) for _ in range(3))
            ones = np.zeros((count, worlds, nv), np.float32)
            for k, joint in enumerate(own):
                ones[k, :, joint.speed_at] = 1.0
            self._ones = [self._wp.array(one, dtype=float) for one in ones]

    def attach(self, model: Any) -> None:
        """Let MuJoCo Warp's model call the servos in each step, before a CUDA graph of a step is captured.

        All changes of the MjModel are made in this one too, which may have been put before it was changed.
        """
        dofs, actuators = self._changed
        for field in ("dof_armature", *PASSIVE):
            self._carry(model, field, dofs)
        for field in FORCES:
            self._carry(model, f"actuator_{field}", actuators)
        for field in _WEIGHTS:
            self._carry(model, field, slice(None))
        for name in LEAST:
            setattr(model.opt, name, max(getattr(model.opt, name), getattr(self._model.opt, name)))
        if self._servos.rotors_vary:
            whole = np.broadcast_to(model.dof_armature.numpy(), (self.worlds, model.nv)).copy()
            whole[:, dofs] = self._servos.armature
            model.dof_armature = self._wp.array(whole.astype(np.float32), dtype=float, device=self._device)
            self._armature = model.dof_armature
        model.callback.control = self.control

    def _carry(self, model: Any, field: str, places: Any) -> None:
        array = getattr(model, field, None)
        if array is None or not array.size or not hasattr(self._model, field):
            return
        values, own = array.numpy(), getattr(self._model, field)
        rows = own[places].reshape(own[places].shape[:1] + values.shape[array.ndim:])
        values[(..., places) + (slice(None),) * (values.ndim - array.ndim)] = rows
        array.assign(values)

    def control(self, model: Any, data: Any) -> None:
        """Let all servos advance by a step, and put their torques into the data: what `attach` lets the model call."""
        wp, mjw, kernels = self._wp, self._mjw, self._kernels
        worlds, count = self.worlds, len(self.joints)
        if (data.nworld, model.nv) != (worlds, self._forces.shape[1]):
            raise InputError("data of a WarpDrive", got=f"{data.nworld} worlds of {model.nv} degrees of freedom",
                             allowed=f"{worlds} of {self._forces.shape[1]}")
        with wp.ScopedDevice(self._device):
            wp.launch(kernels.compare, dim=worlds, inputs=[data.time, self._time, self._again])
            self._servos.begin(data.qpos, self._again)
            wp.launch(kernels.take_away, dim=(worlds, count), inputs=[self._servos.speed_at, data.qfrc_applied])
            wp.launch(kernels.free_forces, dim=self._forces.shape, inputs=[
                data.qfrc_passive, data.qfrc_bias, data.qfrc_applied, data.qfrc_constraint, data.qfrc_actuator],
                outputs=[self._forces])
            mjw.xfrc_accumulate(model, data, self._forces)
            mjw.factor_m(model, data)
            mjw.solve_m(model, data, self._free, self._forces)
            for k in range(count):
                mjw.solve_m(model, data, self._solved, self._ones[k])
                wp.launch(kernels.keep_row, dim=(worlds, count), inputs=[self._solved, self._servos.speed_at, k],
                          outputs=[self._per_torque])
            self._servos.advance(self._timestep, data.qpos, data.qvel, data.ctrl, self._free, self._per_torque,
                                 data.qfrc_applied)

    def reset(self, worlds: Any = None) -> None:
        """Put servos to rest where the next step finds their joints, with the command to stay there.

        Where they vary they are other ones, with other armatures.

        Parameters
        ----------
        worlds : warp.array or array of bool, shape (worlds,), optional
            Which, as `mujoco_warp.reset_data` takes it; all unless given.

        Raises
        ------
        InputError
            If it is no such mask.
        """
        self._servos.reset(worlds)
        if self._armature is not None:
            self._servos.put_armature(self._armature)

    def parameters(self) -> dict[str, dict[str, Any]]:
        """Return the numbers of servos that vary, as they are now: arrays (worlds,) by joint and dotted name."""
        return self._servos.parameters()

    def command(self, places: Mapping[str, Any]) -> None:
        """Tell joints without an actuator where to go [rad, m]: a number each, or an array (worlds,), of Warp in place.

        Raises
        ------
        InputError
            If one has none, or has an actuator, whose `ctrl` says so; or a place is not finite.
        """
        self._servos.command(places)


def _load_warp() -> tuple[Any, Any, Any]:
    warp, kernels = load_warp()
    try:
        import mujoco_warp
    except ImportError as error:
        raise MissingExtraError(error.name or "mujoco_warp", "warp") from None
    return warp, mujoco_warp, kernels
