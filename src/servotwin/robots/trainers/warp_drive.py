"""`WarpDrive`: servos at the joints of a MuJoCo model in all worlds of MuJoCo Warp."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError
from servotwin.models.terms.elastic import Elastic
from servotwin.models.terms.play import Play
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.command_map import CommandMap, told
from servotwin.robots.servos.coupling import FORCES
from servotwin.robots.servos.mount import PASSIVE, Joint, Mount, joints_of, treat_friction
from servotwin.robots.servos.servo_groups import check_options, maps_of, put_into_model
from servotwin.simulation import VectorSimulator
from servotwin.simulation.lanes.vector import numbers_of

if TYPE_CHECKING:
    from servotwin.models import Model


_WEIGHTS = ("dof_invweight0", "body_invweight0", "tendon_invweight0")  # of the model at rest, in its constraints


class _Crew:
    """Servos of one model: a lane for each of its joints in each world, world after world."""

    kind: str  # of its commands
    ends: tuple[float, float, float, float]  # of its travel [rad] and of its commands, which floats may be beyond
    places: Any  # of its joints among all
    lanes: dict[str, Any]  # arrays of what lanes are given
    before: Any = None  # what lanes remembered before the last step
    hold: Any  # commands to stay where lanes begin
    mask: Any

    def __init__(self, model: Model, which: list[int], worlds: int, device: str, seed: int) -> None:
        self.which, self._here = which, device == "cpu"
        lanes = worlds * len(which)
        self.sims: Any = VectorSimulator(model, lanes, seed=seed) if self._here else VectorSimulator(
            model, lanes, seed=seed, dtype="float32", device=device)

    def advance(self, timestep: float, stream: Any) -> Any:
        """Advance by a step from where the joints are; return the speeds after it."""
        angle, speed, inertia, against, command = (
            array.numpy() if self._here else array for array in self.lanes.values())
        if self._here:
            angle, command = self._within(angle, command)
        more = {} if self._here else {"stream": stream}
        self.sims.set(output_angle=angle, output_speed=speed, load_inertia=inertia, **more)
        self.sims.advance(timestep, external_torque=against, **{self.kind: command})
        return self.sims["output_speed"]

    def rewind(self, again: Any, wp: Any, kernels: Any) -> None:
        """Let worlds whose time has not passed since stand as before the last step."""
        if self._here:
            lanes = np.flatnonzero(np.repeat(again.numpy(), len(self.which)))
            if lanes.size:
                self.sims.restore(self.before, lanes=lanes)
            return
        for name, column, before in self._columns(wp):
            each = column.size // self.mask.size if name == "rings" else 0
            back = kernels.take_reals_back if column.dtype is wp.float32 else kernels.take_wholes_back
            wp.launch(back, dim=column.size, inputs=[again, len(self.which), self.mask.size, each, before, column])

    def keep(self, wp: Any) -> None:
        """Keep how lanes stand before a step."""
        if self._here:
            self.before = self.sims.save()
            return
        for _, column, before in self._columns(wp):
            wp.copy(before, column)

    def _columns(self, wp: Any) -> Iterator[tuple[str, Any, Any]]:
        """Yield the name of each array that lanes remember on a GPU, the array, and its numbers before the last step."""
        now = {name: wp.from_dlpack(column).flatten() for name, column in self.sims.columns().items()}
        self.before = self.before or {name: wp.clone(column) for name, column in now.items()}
        return ((name, column, self.before[name]) for name, column in now.items())

    def begin(self, stream: Any) -> None:
        """Put those of the mask to rest."""
        if not self._here:
            self.sims.reset(output_angle=self.lanes["angle"], lanes=self.mask, stream=stream,
                            **{self.kind: self.hold})
            return
        which = np.flatnonzero(self.mask.numpy())
        if not which.size:
            return
        angle, command = self._within(self.lanes["angle"].numpy()[which], self.hold.numpy()[which])
        self.sims.reset(output_angle=angle, lanes=which, **{self.kind: command})

    def _within(self, angle: Any, command: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        lower, upper, low, high = self.ends
        return np.clip(angle.astype(np.float64), lower, upper), np.clip(command.astype(np.float64), low, high)


class WarpDrive:
    """Servos at joints of a MuJoCo model, in each world of MuJoCo Warp, on its device.

    A joint's angle is `zero + direction · ratio · servo's angle` (`Mount`). Rotor and gear become the joint's armature;
    an actuator at the joint gives its `ctrl` as the servo's command and no force of its own any more, as for
    `ServoDrive`. In each step a servo meets the inertia 1/(M⁻¹)ᵢᵢ and the acceleration that its joint would have
    without it, by contacts and other servos as they were a step before; the torques that let the joints gain the
    speeds that the servos gain are in `qfrc_applied` for the step, where nobody else may put any for these joints. That
    is of first order in the step. Where `forward` is called too, servos advance once in a step all the same: a world
    whose time has not passed begins the step anew. A servo whose gear has play or a spring is refused.

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
    device : str, optional
        "cpu" or "cuda:0", ...; that on which Warp is unless given.
    seed : int
        Of all noise.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints, in the order of `torque`.
    servos : mapping of str to Model or Mount
        As given.
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
                 device: str | None = None, seed: int = 0) -> None:
        mujoco, (self._wp, self._mjw, self._kernels) = load_mujoco(), _load_warp()
        if not isinstance(model, mujoco.MjModel):
            raise InputError("model of a WarpDrive", got=type(model).__name__, allowed="an MjModel")
        if not isinstance(servos, Mapping) or not servos:
            raise InputError("servos of a WarpDrive", got=servos, allowed="a mapping of joints to models")
        if isinstance(worlds, bool) or not isinstance(worlds, int) or worlds < 1:
            raise InputError("worlds", got=worlds, allowed="a whole number, at least 1")
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise InputError("integrator of the model", got="RK4", allowed="Euler, implicit or implicitfast")
        own = joints_of(model, servos)
        check_options(mujoco, model, own)
        maps = maps_of(model, own, controls)
        treat_friction(model, own, joint_friction)
        self._model, self.servos = model, dict(servos)
        self.joints, self.worlds = tuple(joint.name for joint in own), worlds
        self._device = self._wp.get_device(device)
        self._timestep = float(model.opt.timestep)
        groups = dict[Any, list[int]]()
        for k, joint in enumerate(own):
            groups.setdefault(joint.mount.model, []).append(k)
        self._crews = []
        for of, which in groups.items():
            self._crews.append(_Crew(of, which, worlds, str(self._device), seed))
            seed += worlds * len(which)  # each lane has its own
        numbers = self._numbers(own, maps)
        put_into_model(mujoco, model, own, numbers[:, 4] / numbers[:, 0] ** 2)
        self._lay_out(own, numbers, int(model.nv))

    @staticmethod
    def _check_gears(name: str, numbers: Any) -> None:
        for kind, part, word in ((Play, "half", "play"), (Elastic, "k", "an elastic gear")):
            if getattr(numbers.now(kind), part)[0] > 0.0:
                raise InputError(f"servo of joint {name} of a WarpDrive", got=word,
                                 allowed="a rigid gear (gear.backlash = 0): contacts of teeth and of the robot, each "
                                         "a step late, would not come to rest; ServoDrive has them")

    def _numbers(self, own: list[Joint], maps: list[CommandMap]) -> NDArray[np.float64]:
        """Return a row for each joint: gain, zero, stops, own inertia, control and its map, command and its ends."""
        found = np.zeros((len(own), 13))
        for crew in self._crews:
            numbers = crew.sims._numbers
            lower, upper = numbers.travel()
            self._check_gears(own[crew.which[0]].name, numbers)
            for k in crew.which:
                mount, one, how = own[k].mount, maps[k], told(own[k].mount)
                low, high = numbers.command_ends(how.kind)
                found[k] = (mount.gain, mount.zero, lower[0], upper[0], numbers.own_inertia()[0], one.low, one.high,
                            one.scale, one.offset, how.gain, how.zero, low[0], high[0])
                crew.kind, crew.ends = how.kind, (lower[0], upper[0], low[0], high[0])
        return found

    def _lay_out(self, own: list[Joint], numbers: NDArray[np.float64], nv: int) -> None:
        wp, count, worlds = self._wp, len(own), self.worlds
        with wp.ScopedDevice(self._device):
            def whole(values: list[int]) -> Any:
                return wp.array(np.array(values, np.int32), dtype=int)

            self._numbers_of = wp.array(numbers.astype(np.float32), dtype=float)
            self._angle_at = whole([joint.angle_at for joint in own])
            self._speed_at = whole([joint.speed_at for joint in own])
            self._command_at = whole([joint.command_at for joint in own])
            self._fresh, self._again = (wp.zeros(worlds, dtype=wp.bool) for _ in range(2))
            self._time = wp.full(worlds, math.nan, dtype=float)
            self.torque, self._met, self._wanted = (wp.zeros((worlds, count), dtype=float) for _ in range(3))
            self._per_torque = wp.zeros((worlds, count, count), dtype=float)
            self._forces, self._free, self._solved = (wp.zeros((worlds, nv), dtype=float) for _ in range(3))
            self._rest = wp.array(np.array([told(joint.mount).rest for joint in own], np.float32), dtype=float)
            self._table, self._has_actuator = numbers, [joint.command_at >= 0 for joint in own]
            ones = np.zeros((count, worlds, nv), np.float32)
            for k, joint in enumerate(own):
                ones[k, :, joint.speed_at] = 1.0
            self._ones = [wp.array(one, dtype=float) for one in ones]
            for crew in self._crews:
                crew.places = whole(crew.which)
                crew.mask = wp.zeros(worlds * len(crew.which), dtype=wp.uint8)
                crew.lanes = {name: wp.zeros(worlds * len(crew.which), dtype=float)
                              for name in ("angle", "speed", "inertia", "against", "command")}
                crew.hold = wp.zeros_like(crew.lanes["command"])
                crew.keep(wp)  # a captured graph cannot ask for memory
        self.reset()
        self._changed = [joint.speed_at for joint in own], [joint.actuator for joint in own if joint.actuator >= 0]

    @property
    def _stream(self) -> Any:
        return None if self._device.is_cpu else self._wp.get_stream(self._device)

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
            for crew in self._crews:
                crew.rewind(self._again, wp, kernels)
                wp.launch(kernels.place, dim=(worlds, len(crew.which)), inputs=[
                    data.qpos, self._fresh, crew.places, self._angle_at, self._numbers_of, self._rest,
                    len(crew.which), crew.lanes["angle"], crew.lanes["command"], crew.hold, crew.mask])
                crew.begin(self._stream)
                crew.keep(wp)
            self._fresh.zero_()
            wp.launch(kernels.take_away, dim=(worlds, count), inputs=[self._speed_at, data.qfrc_applied])
            wp.launch(kernels.free_forces, dim=self._forces.shape, inputs=[
                data.qfrc_passive, data.qfrc_bias, data.qfrc_applied, data.qfrc_constraint, data.qfrc_actuator],
                outputs=[self._forces])
            mjw.xfrc_accumulate(model, data, self._forces)
            mjw.factor_m(model, data)
            mjw.solve_m(model, data, self._free, self._forces)
            for k in range(count):
                mjw.solve_m(model, data, self._solved, self._ones[k])
                wp.launch(kernels.keep_row, dim=(worlds, count), inputs=[self._solved, self._speed_at, k],
                          outputs=[self._per_torque])
            for crew in self._crews:
                self._meet(crew, data)
                after = crew.advance(self._timestep, self._stream)
                speed = wp.array(after, dtype=float) if self._device.is_cpu else wp.from_dlpack(after)
                wp.launch(kernels.find_lack, dim=(worlds, len(crew.which)), inputs=[
                    data.qvel, self._free, self._per_torque, self._met, crew.places, self._speed_at, self._numbers_of,
                    len(crew.which), self._timestep, speed], outputs=[self.torque, self._wanted])
            wp.launch(kernels.push, dim=worlds, inputs=[self._per_torque, self._speed_at, count, self._wanted,
                                                        data.qfrc_applied])

    def _meet(self, crew: Any, data: Any) -> None:
        self._wp.launch(self._kernels.meet, dim=(self.worlds, len(crew.which)), inputs=[
            data.qpos, data.qvel, data.ctrl, self._free, self._per_torque, self.torque, crew.places, self._angle_at,
            self._speed_at, self._command_at, self._numbers_of, len(crew.which), len(self.joints)],
            outputs=[self._met, *crew.lanes.values()])

    def reset(self, worlds: Any = None) -> None:
        """Put servos to rest where the next step finds their joints, with the command to stay there.

        Parameters
        ----------
        worlds : warp.array or array of bool, shape (worlds,), optional
            Which, as `mujoco_warp.reset_data` takes it; all unless given.

        Raises
        ------
        InputError
            If it is no such mask.
        """
        wp = self._wp
        with wp.ScopedDevice(self._device):
            mask = np.ones(self.worlds, np.bool_) if worlds is None else worlds
            if not isinstance(mask, wp.array):
                mask = np.asarray(mask)
            if mask.shape != (self.worlds,) or mask.dtype not in (np.bool_, wp.bool):
                raise InputError("worlds of a WarpDrive", got=f"an array of shape {mask.shape}",
                                 allowed=f"a mask of bool, shape ({self.worlds},)")
            mask = mask if isinstance(mask, wp.array) else wp.array(mask, dtype=wp.bool)
            for crew in self._crews:
                wp.launch(self._kernels.begin_anew, dim=(self.worlds, len(crew.which)), inputs=[
                    mask, crew.places, len(crew.which), self._fresh, self.torque, crew.lanes["command"]])

    def command(self, places: Mapping[str, Any]) -> None:
        """Tell joints without an actuator where to go [rad, m], a number or an array (worlds,) each.

        Raises
        ------
        InputError
            If one has none, or has an actuator, whose `ctrl` says so; or a place is not finite.
        """
        for name, values in places.items():
            k = self.joints.index(name) if name in self.joints else -1
            if k < 0 or self._has_actuator[k]:
                raise InputError(f"command of joint {name}", allowed="joints with a servo and without an actuator")
            crew = next(crew for crew in self._crews if k in crew.which)
            gain, zero, low, high = self._table[k, [9, 10, 11, 12]]
            place = numbers_of(f"command of joint {name}", values, np.arange(self.worlds))
            column = np.clip((place - zero) / gain, low, high)
            lanes = crew.lanes["command"].numpy().reshape(self.worlds, -1).copy()
            lanes[:, crew.which.index(k)] = column
            crew.lanes["command"].assign(lanes.ravel())


def _load_warp() -> tuple[Any, Any, Any]:
    try:
        import mujoco_warp
        import warp
    except ImportError as error:
        raise MissingExtraError(error.name or "mujoco_warp", "warp") from None
    from servotwin.robots.trainers import warp_kernels

    return warp, mujoco_warp, warp_kernels
