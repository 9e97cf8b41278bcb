"""`ServoDrive`: servos at the joints of a MuJoCo model."""

from __future__ import annotations

import ctypes
import math
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServotwinError, SimulationError, UnknownNameError
from servotwin.models import Model
from servotwin.robots.crews import Berth, Instance, crews_of
from servotwin.robots.mount import Mount, joints_of
from servotwin.robots.places import Places, load_mujoco, places
from servotwin.robots.record import Record
from servotwin.robots.state import DriveState
from servotwin.simulation.compile.calls import joint_addresses
from servotwin.simulation.compile.joints_layout import (
    ARRAYS,
    ASK_NEW,
    ASK_RESET,
    BLOCK,
    DRIVE,
    FAILED,
    INSTANCE,
    MESSAGES,
    OF_EACH,
    RECORD,
    WELL,
)
from servotwin.simulation.status import Status

Array = NDArray[np.float64]
_MOST = 4096  # of MuJoCo's data at once
_FIRST_ROWS = 4096  # of a record
_SERIALS = 2**40  # ticks of servos in one of them
_SLEEPS = 1  # bit of MuJoCo's option to let bodies sleep, by its name below
_active: list[ServoDrive | None] = [None]
_CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
_STEP = ctypes.PYFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 4)  # with Python's lock: the callback is global
_ASK = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


class ServoDrive:
    """Servos at joints of a MuJoCo model: each turns its command and what it meets into torque, as the real one does.

    A joint's angle is `zero + direction · ratio · servo's angle` (`Mount`). Rotor and gear become the joint's armature.
    An actuator that the model has at the joint gives its `ctrl` as the servo's command, an angle [rad] or place [m] of
    the joint, and no force of its own any more; where there is none, `command` says where to go.

    Parameters
    ----------
    model : MjModel or MjSpec
        It is changed: armature of these joints, and gains of their actuators. A spec is compiled, with room in
        `userdata` for what servos remember, so that MuJoCo's own states hold them.
    servos : mapping of str to Model or Mount
        By the name of the joint, a hinge or a slide.
    bus : Supply or sequence of tuple (Supply, joints), optional
        Supplies that servos share.
    joint_friction : str
        What to do with damping and friction loss that these joints have themselves: "refuse", "clear" or "keep".

    Attributes
    ----------
    model : MjModel
    joints : tuple of str
        Names of the joints, in the order of all arrays.

    Raises
    ------
    InputError
        Or one of its kinds, on bad input.
    MissingExtraError
        If MuJoCo is not installed.

    Examples
    --------
    >>> import mujoco
    >>> import servotwin as st
    >>> arm = '''<mujoco><worldbody><body><joint name="elbow" axis="0 1 0"/>
    ...   <geom type="capsule" fromto="0 0 0 0.1 0 0" size=".01" mass=".05"/></body></worldbody></mujoco>'''
    >>> drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(arm),
    ...                              {"elbow": st.PulseServo(st.load_servo("hitec-hs-755hb"))})
    >>> data = mujoco.MjData(drive.model)
    >>> drive.command(data, {"elbow": 0.5})
    >>> drive.step(data, 400)
    >>> round(float(data.qpos[0]), 1)
    0.5
    """

    def __init__(self, model: Any, servos: Mapping[str, Model | Mount], *, bus: Any = None,
                 joint_friction: str = "refuse") -> None:
        mujoco = load_mujoco()
        self._places = places()
        if not isinstance(servos, Mapping) or not servos:
            raise InputError("servos of a ServoDrive", got=servos, allowed="a mapping of joints to models")
        spec = model if isinstance(model, mujoco.MjSpec) else None
        if spec is None and not isinstance(model, mujoco.MjModel):
            raise InputError("model of a ServoDrive", got=type(model).__name__, allowed="an MjModel or MjSpec")
        self.model = spec.compile() if spec is not None else model
        self._joints = joints_of(self.model, dict(servos), joint_friction)
        self.joints = tuple(joint.name for joint in self._joints)
        self._crews = crews_of(self._joints, bus)
        self._instances: dict[int, Instance] = {}
        self._lock, self._error, self._made = threading.Lock(), None, 0
        first = Instance(0, self._crews, self._joints, self.model.nv, self._head, 0)
        self._spare: Instance | None = first
        self._size = first.size
        self._kept_at = -1
        if spec is not None:
            self._kept_at = spec.nuserdata if spec.nuserdata > 0 else 0
            spec.nuserdata = self._kept_at + self._head + 2 * self._size
            self.model = spec.compile()
            if joint_friction == "clear":
                joints_of(self.model, dict(servos), joint_friction)
        self._arrays = self._numbers(first.berths)
        self._check(mujoco)
        self._put_into_model(mujoco)
        self._table = np.zeros(1 + 2 * _MOST, np.int64)
        self._asked = _ASK(self._ask)
        self._control, step = joint_addresses()
        self._step = _STEP(step)
        self._words = self._drive_words(self._places)
        self._at = self._words.ctypes.data

    @property
    def _head(self) -> int:
        """Words of a block before the memories."""
        return len(BLOCK) + len(OF_EACH) * len(self._joints) + int(self.model.nv)

    # --- what compiled code reads -------------------------------------------------------------------------------------

    def _numbers(self, berths: list[Berth]) -> dict[str, NDArray[Any]]:
        """Return the arrays of `joints_layout.ARRAYS`, for all servos."""
        joints, count = self._joints, len(self._joints)
        arrays: dict[str, NDArray[Any]] = {name: np.zeros(count, np.int64 if name.endswith("_at") else np.float64)
                                           for name in ARRAYS}
        arrays["angle_at"][:] = [joint.angle_at for joint in joints]
        arrays["speed_at"][:] = [joint.speed_at for joint in joints]
        arrays["command_at"][:] = [joint.command_at for joint in joints]
        arrays["gain"][:] = [joint.mount.gain for joint in joints]
        arrays["zero"][:] = [joint.mount.zero for joint in joints]
        for berth in berths:
            which = berth.crew.which
            arrays["lower"][which], arrays["upper"][which] = berth.entry.travel()
            arrays["low"][which], arrays["high"][which] = berth.entry.commands("command_angle")
            arrays["armature"][which] = berth.entry.own_inertia() / arrays["gain"][which] ** 2
        for k, joint in enumerate(joints):
            if joint.actuator >= 0 and self.model.actuator_ctrllimited[joint.command_at]:
                ends = np.sort((self.model.actuator_ctrlrange[joint.command_at] - joint.mount.zero) / joint.mount.gain)
                arrays["low"][k] = min(max(arrays["low"][k], ends[0]), arrays["high"][k])
                arrays["high"][k] = max(min(arrays["high"][k], ends[1]), arrays["low"][k])
        return arrays

    def _check(self, mujoco: Any) -> None:
        """Raise InputError where MuJoCo's options or joints do not go with the servos."""
        longest, who = self._longest()
        if self.model.opt.timestep > longest:
            raise InputError("timestep of the model", got=float(self.model.opt.timestep),
                             allowed=f"at most a frame of the servo at joint {who}, {longest:g} s")
        if self.model.opt.enableflags & getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0):
            raise InputError("option sleep of the model", got="enabled", allowed="disabled: servos do not sleep")

    def _longest(self) -> tuple[float, str]:
        """Return the shortest frame of all servos [s], and the joint of its servo; inf where none has frames."""
        frames = [(float(joint.mount.model.value_or("electronics.frame_period", math.inf)), joint.name)
                  for joint in self._joints]
        return min(frames)

    def _put_into_model(self, mujoco: Any) -> None:
        """Let MuJoCo know of rotors and gears, and silence the actuators that servos replace."""
        model = self.model
        for joint, armature in zip(self._joints, self._arrays["armature"].tolist(), strict=True):
            model.dof_armature[joint.speed_at] = armature
            if joint.actuator >= 0:
                for field in ("gaintype", "biastype", "gainprm", "biasprm", "armature", "damping", "dampingpoly"):
                    if hasattr(model, f"actuator_{field}"):
                        getattr(model, f"actuator_{field}")[joint.actuator] = 0
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def _drive_words(self, at: Places) -> NDArray[np.int64]:
        model = self.model
        own = [joint.actuator for joint in self._joints if joint.actuator >= 0]
        count = model.nactuator if hasattr(model, "nactuator") else model.nu
        values = {
            "servos": len(self._joints), "dofs": model.nv, "coordinates": model.nq, "wide": int(at.wide),
            "bodies": model.nbody, "timestep": at.timestep, "integrator": at.integrator, **at.data, **at.functions,
            "slot": at.slot, "own": self._control, "others": int(count > len(own)),
            **{name: array.ctypes.data for name, array in self._arrays.items()},
            "longest": int(np.float64(self._longest()[0]).view(np.int64)), "kept_at": self._kept_at,
            "memory": self._size, "instances": self._table.ctypes.data,
            "ask": ctypes.cast(self._asked, ctypes.c_void_p).value or 0}
        assert_known(values)
        return np.array([values[name] for name in DRIVE], np.int64)

    # --- what compiled code asks --------------------------------------------------------------------------------------

    def _ask(self, what: int, first: int, second: int) -> int:
        """Answer compiled code, from whatever thread it runs in; an error is kept until somebody can be told."""
        try:
            with self._lock:
                if what == ASK_NEW:
                    return self._new(second).words.ctypes.data
                instance = self._instances[first]
                if what == ASK_RESET:
                    instance.reset()
                else:
                    words = dict(zip(RECORD, instance.record_words.tolist(), strict=True))
                    instance.keep(words["row"], 2 * max(words["capacity"], _FIRST_ROWS // 2))
                return 1
        except Exception as error:
            self._error = error
            return 0

    def _new(self, address: int) -> Instance:
        known = self._instances.get(address)
        if known is not None:
            return known
        if len(self._instances) == _MOST:
            raise InputError("data with servos", got=_MOST + 1, allowed=f"up to {_MOST} at once: make a new ServoDrive")
        instance, self._spare = self._spare, None
        self._made += 1
        if instance is None:
            instance = Instance(address, self._crews, self._joints, self.model.nv, self._head, 0)
        instance.words[INSTANCE.index("data")] = address
        instance.words[INSTANCE.index("serial")] = self._made * _SERIALS
        instance.address = address
        k = len(self._instances)
        self._instances[address] = instance
        self._table[1 + 2 * k:3 + 2 * k] = address, instance.words.ctypes.data
        self._table[0] = k + 1
        return instance

    def _of(self, data: Any) -> Instance:
        """Return the servos in some data."""
        mujoco = load_mujoco()
        if not isinstance(data, mujoco.MjData):
            raise InputError("data", got=type(data).__name__, allowed="an MjData of the drive's model")
        if data.model is not self.model and (data.model.nq, data.model.nv) != (self.model.nq, self.model.nv):
            raise InputError("data", got="an MjData of another model", allowed="one of the drive's model")
        found = self._instances.get(data._address)
        if found is None:
            with self._lock:
                found = self._new(data._address)
        return found

    # --- going on -----------------------------------------------------------------------------------------------------

    def step(self, data: Any, steps: int = 1) -> None:
        """Let MuJoCo go on by a step, or several, with the servos.

        Raises
        ------
        InputError
            If another drive or another control callback is active.
        SimulationError
            If a servo or MuJoCo cannot go on.
        """
        if _active[0] is not self:
            self._activate()
        code = self._step(self._at, self.model._address, data._address, steps)
        if code != WELL or self._error is not None:
            self._raise(data, int(code))
        instance = self._instances.get(data._address)
        if instance is not None and instance.words[_CODE] != WELL:
            self.check(data)

    def callback(self) -> Any:
        """Return MuJoCo's control callback with these servos: `mujoco.set_mjcb_control(drive.callback())`.

        It is compiled, and serves the viewer, `mujoco.rollout` and everything else that steps. It is one for the whole
        process: other models have no servos meanwhile; `mujoco.set_mjcb_control(None)` ends it. What goes wrong is
        kept for `check`.

        Raises
        ------
        InputError
            If another drive is active.
        """
        self._activate()
        return _CALLBACK(self._control)

    def _activate(self) -> None:
        """Let this drive's servos be those of the callback."""
        slot = ctypes.c_int64.from_address(self._places.slot).value
        if slot != 0 and _active[0] is not self:
            who = "another drive's" if slot == self._control else "one that is not this drive's"
            raise InputError("MuJoCo's control callback", got=who, allowed="none while this drive steps: it is one for "
                             "the whole process; mujoco.set_mjcb_control(None) ends it")
        _CALLBACK(self._control)(None, self._at)
        _active[0] = self

    def check(self, data: Any) -> None:
        """Raise what went wrong in a callback, once.

        Raises
        ------
        SimulationError
            If a servo or MuJoCo could not go on; names the joint.
        """
        self._raise(data, WELL)

    def _raise(self, data: Any, code: int) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error if isinstance(error, ServotwinError) else ServotwinError(f"servos: {error}") from error
        instance = self._of(data)
        own, culprit = (int(instance.words[INSTANCE.index(name)]) for name in ("code", "culprit"))
        instance.words[INSTANCE.index("code")] = WELL
        if own != WELL:
            cause = MESSAGES[own]
            if own == FAILED:
                cause += f": {self._cause(instance, culprit)}"
            raise SimulationError("SERVO", float(data.time), f"joint {self.joints[culprit]}: {cause}")
        if code != WELL:
            raise SimulationError("MUJOCO", float(data.time), MESSAGES[code])

    def _cause(self, instance: Instance, servo: int) -> str:
        for berth in instance.berths:
            for lane in np.flatnonzero(berth.crew.which == servo).tolist():
                status = int(berth.sims.status[lane])
                return Status.of_code(status).message if status else "its command or load was refused"
        return "unknown"

    # --- commands -----------------------------------------------------------------------------------------------------

    def command(self, data: Any, goals: Mapping[str, float]) -> None:
        """Tell servos where to go, of joints with and without an actuator.

        Parameters
        ----------
        goals : mapping of str to float
            Angle [rad] or place [m] by joint; others keep theirs.

        Raises
        ------
        InputError
            If a joint has no servo, or a goal is no finite number.
        """
        command = self._of(data).command
        for name, goal in goals.items():
            k = self._number(name)
            if not math.isfinite(goal):
                raise InputError(f"goal of joint {name}", got=goal, allowed="a finite number of rad, or m of a slide")
            command[k] = goal
            if self._joints[k].command_at >= 0:
                data.ctrl[self._joints[k].command_at] = goal

    def _number(self, name: str) -> int:
        if name not in self.joints:
            raise UnknownNameError("joint with a servo", name, self.joints)
        return self.joints.index(name)

    # --- what shows ---------------------------------------------------------------------------------------------------

    def torque(self, data: Any) -> Array:
        """Return the mean torque [N m], or force [N], that each joint has got from its servo over the last tick."""
        return self._block(data)[len(BLOCK):len(BLOCK) + len(self._joints)].copy()

    def _block(self, data: Any) -> Array:
        if self._kept_at >= 0:
            return np.asarray(data.userdata[self._kept_at:])
        return self._of(data).block

    def record(self, data: Any) -> None:
        """Keep from now on what shows of all servos at the end of each tick, for `result`."""
        instance = self._of(data)
        instance.keep(Record.width(len(self._joints)), _FIRST_ROWS)
        instance.record_words[RECORD.index("used")] = 0

    def result(self, data: Any) -> Record:
        """Return what was kept since `record`, or since the servos began anew.

        Raises
        ------
        InputError
            If nothing is kept.
        """
        instance = self._of(data)
        words = dict(zip(RECORD, instance.record_words.tolist(), strict=True))
        if not words["row"]:
            raise InputError("result of servos", got="no record", allowed="drive.record(data) before the run")
        return Record(self.joints, {joint.name: joint.mount for joint in self._joints},
                      instance.rows[:words["used"]].copy())

    # --- memory -------------------------------------------------------------------------------------------------------

    def save(self, data: Any) -> DriveState:
        """Return the state of MuJoCo and of the servos; picklable."""
        mujoco = load_mujoco()
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, data, state, kind)
        instance = self._of(data)
        return DriveState(state, data.qfrc_constraint.copy(), instance.block.copy(), instance.command.copy())

    def restore(self, data: Any, state: DriveState) -> None:
        """Go back to what was saved, in this data or another of the model.

        Raises
        ------
        InputError
            If it is the state of another model or drive.
        """
        mujoco = load_mujoco()
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        instance = self._of(data)
        if not isinstance(state, DriveState) or state.engine.size != mujoco.mj_stateSize(self.model, kind) or (
                state.servos.size != instance.block.size):
            raise InputError("restore(state)", got=type(state).__name__, allowed="what save() of this drive has returned")
        mujoco.mj_setState(self.model, data, state.engine, kind)
        data.qfrc_constraint[:] = state.constraint
        instance.block[:] = state.servos
        instance.command[:] = state.command
        block = self._block(data)
        block[BLOCK.index("serial")], block[BLOCK.index("restored")] = -1.0, 1.0


_CODE = INSTANCE.index("code")


def assert_known(values: Mapping[str, int]) -> None:
    """Raise if a word of a drive is missing."""
    missing = [name for name in DRIVE if name not in values]
    if missing:
        raise ServotwinError(f"words of a drive are missing: {', '.join(missing)}")

