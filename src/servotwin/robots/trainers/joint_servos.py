"""Servos at joints in many worlds, as an engine meets them that solves for the joints itself: a lane for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.models.terms.elastic import Elastic
from servotwin.models.terms.play import Play
from servotwin.robots.servos.command_map import CommandMap, told
from servotwin.robots.servos.mount import Joint, Mount
from servotwin.simulation import VectorSimulator
from servotwin.simulation.lanes.vector import numbers_of
from servotwin.simulation.lanes.vector_gpu import KINDS
from servotwin.studies.plan import drawn_parameters

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.studies import Distribution

    Vary = Mapping[str, Distribution | str]


VARIANTS = 1024  # servos of each kind that varies, of which one is drawn for a joint; assumed


class _Crew:
    """Servos of one model: a lane for each of its joints in each world, world after world."""

    kind: str  # of its commands
    ends: NDArray[np.float64]  # of each lane: of its travel [rad] and of its commands, which floats may be beyond
    variants: NDArray[np.float64] | None = None  # of each servo that varies: these, and its own inertia [kg m²]
    redraws = False  # a world that begins anew has others of these servos
    places: Any  # of its joints among all
    lanes: dict[str, Any]  # arrays of what lanes are given
    before: Any = None  # what lanes remembered before the last step
    hold: Any  # commands to stay where lanes begin
    mask: Any
    variant: Any  # which of the variants each lane is
    drawn: Any  # these

    def __init__(self, model: Model, which: list[int], worlds: int, device: str, seed: int, vary: Vary) -> None:
        self.which, self._here = which, device == "cpu"
        more: Any = {} if self._here else {"dtype": "float32", "device": device}
        self.columns = drawn_parameters(vary, model, VARIANTS, seed) if vary else None
        self.sims: Any = VectorSimulator(model, worlds * len(which), seed=seed, variants=self.columns, **more)

    def look(self, mount: Mount) -> NDArray[np.float64]:
        """Find the ends of lanes and of variants; return those of lanes with their own inertia [kg m²], (5, lanes)."""
        self.kind = told(mount).kind

        def seen(numbers: Any) -> NDArray[np.float64]:
            return np.array([*numbers.travel(), *numbers.command_ends(self.kind), numbers.own_inertia()])

        found = seen(self.sims._numbers)
        self.ends = found[:4]
        if self.columns is not None:
            self.variants = seen(self.sims._variants.numbers)
            self.redraws = True
        return found

    def numbers_of_variants(self, wp: Any) -> Any:
        """Return which of its variants each lane is, as an array of Warp, in place on a GPU."""
        variant = self.sims.variant
        return wp.array(variant.astype(np.int32), dtype=int) if self._here else wp.from_dlpack(variant)

    def draw(self, worlds: Any, stream: Any, wp: Any, kernels: Any) -> None:
        """Let servos of worlds of a mask be other ones."""
        if self._here:
            lanes = np.flatnonzero(np.repeat(worlds.numpy(), len(self.which)))
            self.sims._draw(lanes)
            self.ends = self.variants[:4, self.sims.variant] if self.variants is not None else self.ends
            self.variant.assign(self.sims.variant)
            return
        wp.launch(kernels.spread, dim=self.mask.shape, inputs=[worlds, len(self.which), self.mask])
        self.sims._on(stream)
        self.sims._draw(self.mask)

    def advance(self, duration: float, stream: Any, wp: Any) -> Any:
        """Advance by a step [s] from where the joints are; return the speeds after it, as an array of Warp."""
        angle, speed, inertia, against, command = (
            array.numpy() if self._here else array for array in self.lanes.values())
        if self._here:
            angle, command = self._within(angle, command, slice(None))
        more = {} if self._here else {"stream": stream}
        self.sims.set(output_angle=angle, output_speed=speed, load_inertia=inertia, **more)
        self.sims.advance(duration, external_torque=against, **{self.kind: command})
        speed = self.sims["output_speed"]
        return wp.array(speed, dtype=float) if self._here else wp.from_dlpack(speed)

    def rewind(self, again: Any, wp: Any, kernels: Any) -> None:
        """Let worlds whose time has not passed since stand as before the last step."""
        if self._here:
            lanes = np.flatnonzero(np.repeat(again.numpy(), len(self.which)))
            if lanes.size:
                self.sims.restore(self.before, lanes=lanes)
            return
        for name, column, before in self._columns(wp):
            each = column.size // self.mask.size if name == "rings" else 0
            wp.launch(kernels.take_back, dim=column.size, inputs=[
                again, len(self.which), self.mask.size, each, before, column])

    def keep(self, wp: Any) -> None:
        """Keep how lanes stand before a step."""
        if self._here:
            self.before = self.sims.save()
            return
        for _, column, before in self._columns(wp):
            wp.copy(before, column)

    def _columns(self, wp: Any) -> Iterator[tuple[str, Any, Any]]:
        """Yield name, array and numbers before the last step of all that lanes remember on a GPU."""
        now = {name: wp.from_dlpack(column).flatten() for name, column in self.sims.columns().items() if column.nbytes}
        self.before = self.before or {name: wp.clone(column) for name, column in now.items()}
        return ((name, column, self.before[name]) for name, column in now.items())

    def begin(self, stream: Any) -> None:
        """Put those of the mask to rest."""
        if not self._here:
            self.sims._on(stream)
            self.sims._begin(self.mask, self.lanes["angle"], self.hold, KINDS[self.kind])
            return
        which = np.flatnonzero(self.mask.numpy())
        if not which.size:
            return
        angle, command = self._within(self.lanes["angle"].numpy()[which], self.hold.numpy()[which], which)
        self.sims._begin(which, angle, **{self.kind: command})

    def _within(self, angle: Any, command: Any, which: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        lower, upper, low, high = self.ends[:, which]
        return np.clip(angle.astype(np.float64), lower, upper), np.clip(command.astype(np.float64), low, high)


class JointServos:
    """Servos at joints in many worlds, on the device of Warp.

    In a step a servo meets the inertia 1/(M⁻¹)ᵢᵢ and the acceleration that its joint would have without it, with other
    servos' torques as they were a step before. The torques let the joints gain the speeds that the servos gain.

    Parameters
    ----------
    own : sequence of Joint
        Joints with their servos, in the order of all that follows.
    maps : sequence of CommandMap
        Of their controls.
    worlds : int
    device : warp.Device
    seed : int
        Of all noise.
    name : str
        Of what they belong to, for words.
    vary : sequence of mapping, optional
        Of each joint: distributions of numbers that vary from world to world, by their dotted names, as of `sweep`. A
        world that begins anew has other servos.
    moves_armature : bool
        Whether the engine takes another `armature` with them; where it does not and rotors vary, servos stay as they
        were drawn first.

    Attributes
    ----------
    torque : warp.array, shape (worlds, joints)
        Of the servos in the latest step, at the joints [N m].
    rotors_vary : bool
    """

    def __init__(self, own: Sequence[Joint], maps: Sequence[CommandMap], worlds: int, device: Any, seed: int,
                 name: str, vary: Sequence[Vary] | None = None, moves_armature: bool = True) -> None:
        self._wp, self._kernels = load_warp()
        self.names, self.worlds, self._device, self._name = [joint.name for joint in own], worlds, device, name
        groups = dict[Any, list[int]]()
        varied = [{}] * len(own) if vary is None else vary
        for k, (joint, one) in enumerate(zip(own, varied, strict=True)):
            groups.setdefault((joint.mount.model, tuple(sorted(one.items()))), []).append(k)
        self._crews = []
        for (of, _), which in groups.items():
            self._crews.append(_Crew(of, which, worlds, str(device), seed, varied[which[0]]))
            seed += worlds * len(which)  # each lane has its own
        self._table, self._has_actuator = self._numbers(own, maps), [joint.command_at >= 0 for joint in own]
        self.rotors_vary = False
        for crew in self._crews:
            if crew.variants is not None and np.ptp(crew.variants[4]) > 0.0:
                self.rotors_vary, crew.redraws = True, moves_armature
        self._lay_out(own)

    def _numbers(self, own: Sequence[Joint], maps: Sequence[CommandMap]) -> NDArray[np.float64]:
        """Return of each joint in each world: gain, zero, stops, own inertia, control and its map, command and ends."""
        found = np.zeros((self.worlds, len(own), 13))
        for crew in self._crews:
            lower, upper, low, high, inertia = (
                column.reshape(self.worlds, -1).T for column in crew.look(own[crew.which[0]].mount))
            for n, k in enumerate(crew.which):
                mount, one, how = own[k].mount, maps[k], told(own[k].mount)
                found[:, k] = np.stack(np.broadcast_arrays(
                    mount.gain, mount.zero, lower[n], upper[n], inertia[n], one.low, one.high, one.scale, one.offset,
                    how.gain, how.zero, low[n], high[n]), axis=1)
        return found

    @property
    def armature(self) -> NDArray[np.float64]:
        """Inertia of rotor and gear at each joint, or of the output wheel alone with play or a spring [kg m²].

        Shape (worlds, joints).
        """
        if any(crew.redraws for crew in self._crews):
            self._table = self._numbers_of.numpy().astype(np.float64)
        return np.asarray(self._table[:, :, 4] / self._table[:, :, 0] ** 2)

    def put_armature(self, into: Any) -> None:
        """Put it into an array of Warp, shape (worlds, degrees of freedom)."""
        self._wp.launch(self._kernels.put_armature, dim=self._numbers_of.shape[:2], device=self._device, inputs=[
            self._numbers_of, self.speed_at, into])

    def parameters(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Return the numbers that vary, as they are now: arrays (worlds,) by joint and dotted name."""
        found = dict[str, dict[str, NDArray[Any]]]()
        for crew in self._crews:
            if crew.columns is not None:
                variant = crew.variant.numpy().reshape(self.worlds, -1)
                for n, k in enumerate(crew.which):
                    found[self.names[k]] = {name: values[variant[:, n]] for name, values in crew.columns.items()}
        return {name: found[name] for name in self.names if name in found}

    def check_rigid(self) -> None:
        """Raise InputError where a gear has play or a spring, for accelerations that are a step old."""
        for crew in self._crews:
            for kind, part, word in ((Play, "half", "play"), (Elastic, "k", "an elastic gear")):
                if (getattr(crew.sims._numbers.now(kind), part) > 0.0).any():
                    raise InputError(f"servo of joint {self.names[crew.which[0]]} of {self._name}", got=word,
                                     allowed="a rigid gear (gear.backlash = 0): with accelerations of the last step "
                                             "its teeth do not come to rest; WarpDrive and ServoDrive have them")

    def _lay_out(self, own: Sequence[Joint]) -> None:
        wp, count, worlds = self._wp, len(own), self.worlds
        with wp.ScopedDevice(self._device):
            def whole(values: list[int]) -> Any:
                return wp.array(np.array(values, np.int32), dtype=int)

            self._numbers_of = wp.array(self._table.astype(np.float32), dtype=float)
            self._angle_at = whole([joint.angle_at for joint in own])
            self.speed_at = whole([joint.speed_at for joint in own])
            self._command_at = whole([joint.command_at for joint in own])
            self._fresh = wp.zeros(worlds, dtype=wp.bool)
            self.torque, self._met, self._wanted = (wp.zeros((worlds, count), dtype=float) for _ in range(3))
            self._rest = wp.array(np.array([told(joint.mount).rest for joint in own], np.float32), dtype=float)
            for crew in self._crews:
                crew.places = whole(crew.which)
                crew.mask = wp.zeros(worlds * len(crew.which), dtype=wp.uint8)
                crew.lanes = {name: wp.zeros(worlds * len(crew.which), dtype=float)
                              for name in ("angle", "speed", "inertia", "against", "command")}
                crew.hold = wp.zeros_like(crew.lanes["command"])
                if crew.variants is not None:
                    crew.drawn = wp.array(np.ascontiguousarray(crew.variants.T, np.float32), dtype=float)
                    crew.variant = crew.numbers_of_variants(wp)
                crew.keep(wp)  # a captured graph cannot ask for memory
            self._begin_anew(wp.full(worlds, True, dtype=wp.bool))

    @property
    def _stream(self) -> Any:
        return None if self._device.is_cpu else self._wp.get_stream(self._device)

    def reset(self, worlds: Any = None) -> None:
        """Let servos begin anew in the next step, at rest where their joints are, in worlds of a mask or in all.

        Those that vary are other ones from now on.

        Raises
        ------
        InputError
            If it is no mask of worlds.
        """
        wp = self._wp
        with wp.ScopedDevice(self._device):
            mask = np.ones(self.worlds, np.bool_) if worlds is None else worlds
            if not isinstance(mask, wp.array):
                mask = np.asarray(mask)
            if mask.shape != (self.worlds,) or mask.dtype not in (np.bool_, wp.bool):
                raise InputError(f"worlds of {self._name}", got=f"an array of shape {mask.shape}",
                                 allowed=f"a mask of bool, shape ({self.worlds},)")
            mask = mask if isinstance(mask, wp.array) else wp.array(mask, dtype=wp.bool)
            self._begin_anew(mask)
            for crew in self._crews:
                if crew.redraws:
                    crew.draw(mask, self._stream, wp, self._kernels)
                    wp.launch(self._kernels.take_variant, dim=(self.worlds, len(crew.which)), inputs=[
                        crew.places, len(crew.which), crew.variant, crew.drawn, self._numbers_of])

    def _begin_anew(self, mask: Any) -> None:
        for crew in self._crews:
            self._wp.launch(self._kernels.begin_anew, dim=(self.worlds, len(crew.which)), inputs=[
                mask, crew.places, len(crew.which), self._fresh, self.torque, crew.lanes["command"]])

    def begin(self, angle: Any, again: Any = None) -> None:
        """Let servos begin that are to, where joints are, and those of some worlds stand as before the last step.

        Parameters
        ----------
        angle : warp.array, shape (worlds, coordinates)
        again : warp.array of bool, shape (worlds,), optional
            Worlds in which the last step counts no more.
        """
        wp, kernels = self._wp, self._kernels
        for crew in self._crews:
            if again is not None:
                crew.rewind(again, wp, kernels)
            wp.launch(kernels.place, dim=(self.worlds, len(crew.which)), inputs=[
                angle, self._fresh, crew.places, self._angle_at, self._numbers_of, self._rest, len(crew.which),
                crew.lanes["angle"], crew.lanes["command"], crew.hold, crew.mask])
            crew.begin(self._stream)
            if again is not None:
                crew.keep(wp)
        self._fresh.zero_()

    def advance(self, duration: float, angle: Any, speed: Any, control: Any, free: Any, per_torque: Any,
                into: Any) -> None:
        """Advance all servos by a step [s], and put torques that give the joints their speeds in place.

        Parameters
        ----------
        duration : float
        angle, speed, control : warp.array, shape (worlds, ...)
            Of joints and their commands, of which the joints have places.
        free : warp.array, shape (worlds, ...)
            Accelerations without these servos, in places of speeds.
        per_torque : warp.array, shape (worlds, joints, joints)
            Acceleration of each under one newton metre at one of them: the block of M⁻¹. Factored in place.
        into : warp.array, shape (worlds, ...)
            Torques, in places of speeds.
        """
        wp, kernels, count = self._wp, self._kernels, len(self.names)
        for crew in self._crews:
            wp.launch(kernels.meet, dim=(self.worlds, len(crew.which)), inputs=[
                angle, speed, control, free, per_torque, self.torque, crew.places, self._angle_at, self.speed_at,
                self._command_at, self._numbers_of, len(crew.which), count],
                outputs=[self._met, *crew.lanes.values()])
        for crew in self._crews:
            after = crew.advance(duration, self._stream, wp)
            wp.launch(kernels.find_lack, dim=(self.worlds, len(crew.which)), inputs=[
                speed, free, per_torque, self._met, crew.places, self.speed_at, self._numbers_of, len(crew.which),
                duration, after], outputs=[self.torque, self._wanted])
        wp.launch(kernels.push, dim=self.worlds, inputs=[per_torque, self.speed_at, count, self._wanted, into])

    def command(self, places: Mapping[str, Any]) -> None:
        """Tell joints without an actuator where to go [rad, m]: a number each, or an array (worlds,), of Warp in place.

        Raises
        ------
        InputError
            If one has none, or has an actuator, whose `ctrl` says so; or a place is not finite.
        """
        for name, values in places.items():
            k = self.names.index(name) if name in self.names else -1
            if k < 0 or self._has_actuator[k]:
                raise InputError(f"command of joint {name}", allowed="joints with a servo and without an actuator")
            crew = next(crew for crew in self._crews if k in crew.which)
            if not isinstance(values, self._wp.array):
                checked = numbers_of(f"command of joint {name}", values, np.arange(self.worlds))
                values = self._wp.array(checked.astype(np.float32), dtype=float, device=self._device)
            if values.shape != (self.worlds,) or values.dtype is not self._wp.float32:
                raise InputError(f"command of joint {name}", got=f"an array of {values.dtype.__name__}, shape "
                                 f"{values.shape}", allowed=f"one of float32, shape ({self.worlds},)")
            self._wp.launch(self._kernels.command, dim=self.worlds, device=self._device, inputs=[
                values, k, crew.which.index(k), len(crew.which), self._numbers_of, crew.lanes["command"]])


def varied(vary: Mapping[str, Any] | None, joints: Sequence[str]) -> list[Vary]:
    """Return what varies at each joint, where that is given for all of them, or for some by their names.

    Raises
    ------
    InputError
        If it is no mapping, or a name is none of a joint with a servo.
    """
    if not isinstance(vary or {}, Mapping):
        raise InputError("vary", got=type(vary).__name__, allowed="a mapping of dotted names to distributions, or of "
                         "joints to such mappings")
    given = vary or {}
    if not any(isinstance(one, Mapping) for one in given.values()):
        return [given] * len(joints)
    for name, one in given.items():
        if name not in joints:
            raise UnknownNameError("joint with a servo", name, list(joints))
        if not isinstance(one, Mapping):
            raise InputError(f"vary of joint {name}", got=one, allowed="a mapping of dotted names to distributions")
    return [given.get(name, {}) for name in joints]


def armature_of(mount: Mount) -> float:
    """Return the inertia of rotor and gear at the joint of a mount [kg m²]."""
    return float(VectorSimulator(mount.model, 1)._numbers.own_inertia()[0]) / mount.gain ** 2


def load_warp() -> tuple[Any, Any]:
    """Return Warp and the kernels.

    Raises
    ------
    MissingExtraError
        If Warp is not installed.
    """
    try:
        import warp
    except ImportError:
        raise MissingExtraError("warp", "warp") from None
    from servotwin.robots.trainers import warp_kernels

    return warp, warp_kernels
