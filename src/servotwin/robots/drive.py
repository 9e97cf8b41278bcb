"""`ServoDrive`: servos at the joints of a MuJoCo model."""

from __future__ import annotations

import ctypes
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServotwinError, SimulationError, UnknownNameError
from servotwin.models import Model
from servotwin.robots.places import load_mujoco, places
from servotwin.robots.servos.command_map import CommandMap, told
from servotwin.robots.servos.joints_layout import BLOCK, FAILED, FOREIGN, INSTANCE, MESSAGES, RECORD, WELL
from servotwin.robots.servos.mount import Mount, heat_notes, joints_of, treat_friction, warm_mounts
from servotwin.robots.servos.record import TOO_FEW, Record, set_iterations
from servotwin.robots.servos.servo_groups import (
    Change,
    Harbour,
    Instance,
    arrays_of,
    buses_of,
    check_options,
    close_books,
    crews_of,
    goals_in,
    maps_of,
    put_into_model,
    put_numbers,
    words_of,
)
from servotwin.simulation import VectorSimulator
from servotwin.simulation.compile.calls import joint_addresses
from servotwin.simulation.start import Status

# --- The state of MuJoCo and the servos, to be kept -------------------------------------------------------------------

@dataclass(frozen=True, eq=False)
class DriveState:
    """The state of MuJoCo's data and of the servos in it; picklable.

    Parameters
    ----------
    engine : ndarray
        MuJoCo's state, `mjSTATE_INTEGRATION`.
    constraint : ndarray, shape (nv,)
        Forces of contacts and limits at the last step, which the servos meet in the next one.
    servos : ndarray
        Memory of the servos, and their commands.
    """

    engine: NDArray[np.float64]
    constraint: NDArray[np.float64]
    servos: NDArray[np.float64]


# --- `ServoDrive`: servos at the joints of a MuJoCo model -------------------------------------------------------------

Array = NDArray[np.float64]
_FIRST_ROWS = 4096  # of a record
_CODE, _CULPRIT = INSTANCE.index("code"), INSTANCE.index("culprit")
_active: list[ServoDrive | None] = [None]
_CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
_STEP = ctypes.PYFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 4)  # with Python's lock: the callback is global


class ServoDrive:
    """Servos at joints of a MuJoCo model: each turns its command and what it meets into torque, as the real one does.

    A joint's angle is `zero + direction · ratio · servo's angle` (`Mount`). Rotor and gear become the joint's armature.
    An actuator that the model has at the joint gives its `ctrl` as the servo's command, an angle [rad] or place [m] of
    the joint, and no force of its own any more; where there is none, `command` says where to go. A servo that turns
    endlessly (`potentiometer.fixed_angle`) takes a pulse width [s] instead, by `ctrl` or `command`, and on a bus its
    goal as the number that it is; direction and ratio of its mount say nothing of these.

    Parameters
    ----------
    model : MjModel or MjSpec
        It is changed: armature of these joints, and gains of their actuators. A spec is compiled, with room in
        `userdata` for what servos remember, so that MuJoCo's own states hold them.
    servos : mapping of str to Model or Mount
        By the name of the joint, a hinge or a slide.
    bus : Supply or sequence of tuple (Supply, joints), optional
        Supplies that servos share.
    controls : mapping of str to CommandMap, optional
        By joint: what the control of its actuator asks for. Unless given, that of a position actuator keeps its
        meaning; of any other it is the angle [rad] or place [m] itself, and a control range is refused.
    joint_friction : str
        Treatment of damping and friction loss that these joints have themselves: "refuse", "clear" or "keep".
    solver : str
        "raised": where a servo has play or an elastic gear, MuJoCo's solver iterates at least 10 times, and 20 in its
        line search, which costs nothing where it converges earlier. "given": as the model says.

    assume_heat : bool
        Whether servos whose files have no thermal numbers get warm by ones that their mass lets assume; `check` and the
        notes of a record say so. Without, they stay cold, and their temperatures are nan.
    watch_supply : bool
        Whether `lowest_voltage` is kept: servos go from event to event then, which takes a little longer.

    Attributes
    ----------
    model : MjModel
    joints : tuple of str
        Names of the joints, in the order of all arrays.
    watches : bool
        Whether least voltages of supplies are kept.
    maps : dict of str to CommandMap
        Maps from controls of actuators to commands of the servos, by joint; `print` shows one.

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
                 controls: Mapping[str, CommandMap] | None = None, joint_friction: str = "refuse",
                 solver: str = "raised", assume_heat: bool = True, watch_supply: bool = False) -> None:
        mujoco, self._places = load_mujoco(), places()
        if not isinstance(servos, Mapping) or not servos:
            raise InputError("servos of a ServoDrive", got=servos, allowed="a mapping of joints to models")
        spec = model if isinstance(model, mujoco.MjSpec) else None
        if spec is None and not isinstance(model, mujoco.MjModel):
            raise InputError("model of a ServoDrive", got=type(model).__name__, allowed="an MjModel or MjSpec")
        self.model = spec.compile() if spec is not None else model
        self._joints = joints_of(self.model, servos)
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        self._slides = tuple(one.name for one in self._joints if self.model.jnt_type[one.number] == slide)
        self._said: tuple[str, ...] = ()
        if assume_heat:
            mounts = warm_mounts(servos, assume_heat=True, shared=bus is not None)
            self._said = heat_notes(servos, mounts)
            self._joints = [replace(joint, mount=mounts[joint.name]) for joint in self._joints]
        self.joints = tuple(joint.name for joint in self._joints)
        self._told = [told(joint.mount) for joint in self._joints]
        check_options(mujoco, self.model, self._joints)
        maps = maps_of(self.model, self._joints, controls)
        self.maps = {one.joint: one for one, joint in zip(maps, self._joints, strict=True) if joint.actuator >= 0}
        crews = crews_of(self._joints, bus, bool(watch_supply))
        treat_friction(self.model, self._joints, joint_friction)
        self.watches = bool(watch_supply)
        self._harbour = Harbour(self._joints, crews, int(self.model.nv))
        self._kept_at, first = -1, self._harbour.first
        if spec is not None:  # with room for what the servos remember, so that MuJoCo's states hold it
            self._kept_at = max(int(spec.nuserdata), 0)
            spec.nuserdata = self._kept_at + self._harbour.head + 2 * first.size
            self.model = spec.compile()
            treat_friction(self.model, self._joints, joint_friction)
        self._arrays = arrays_of(self._joints, first.berths, maps)
        put_into_model(mujoco, self.model, self._joints, self._arrays["armature"])
        self._solver_note = set_iterations(self.model, self._joints, solver)
        self._control, step = joint_addresses()
        self._step = _STEP(step)
        self._words = words_of(self.model, self._joints, self._arrays, self._places, {
            "own": self._control, "kept_at": self._kept_at, "memory": first.size,
            "instances": self._harbour.table.ctypes.data}, self._harbour.asked)
        self._at = self._words.ctypes.data

    def _of(self, data: Any) -> Instance:
        """Return the servos in some data."""
        if not isinstance(data, load_mujoco().MjData):
            raise InputError("data", got=type(data).__name__, allowed="an MjData of the drive's model")
        if (data.model.nq, data.model.nv) != (self.model.nq, self.model.nv):
            raise InputError("data", got="an MjData of another model", allowed="one of the drive's model")
        return self._harbour.of(data)

    # --- advancing ----------------------------------------------------------------------------------------------------

    def step(self, data: Any, steps: int = 1) -> None:
        """Advance MuJoCo by a step, or several, with the servos.

        Raises
        ------
        InputError
            If the data is of another model, or another drive or another control callback is active.
        SimulationError
            If a servo or MuJoCo cannot continue.
        """
        if type(steps) is not int or steps < 0:
            raise InputError("step(steps)", got=steps, allowed="a whole number, at least 0")
        instance = self._harbour.known(data) or self._of(data)
        if _active[0] is not self:
            self._activate()
        code = self._step(self._at, self.model._address, data._address, steps)
        if code != WELL or self._harbour.error is not None or instance.words[_CODE] != WELL:
            self._raise(data, int(code))

    def callback(self) -> Any:
        """Return MuJoCo's control callback with these servos: `mujoco.set_mjcb_control(drive.callback())`.

        It is compiled, and serves the viewer, `mujoco.rollout` and everything else that steps. It is one for the whole
        process: other models have no servos meanwhile; `mujoco.set_mjcb_control(None)` ends it. Errors are kept for
        `check`.

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
        if slot != 0 and (slot != self._control or _active[0] is not self):
            who = "another drive's" if slot == self._control else "one that is not this drive's"
            raise InputError("MuJoCo's control callback", got=who, allowed="none while this drive steps: it is one for "
                             "the whole process; mujoco.set_mjcb_control(None) ends it")
        _CALLBACK(self._control)(None, self._at)
        _active[0] = self

    def raise_failure(self, data: Any) -> None:
        """Raise what went wrong in a callback, once.

        Raises
        ------
        SimulationError
            If a servo or MuJoCo could not continue; names the joint.
        """
        self._raise(data, WELL)

    def check(self, data: Any) -> tuple[str, ...]:
        """Raise what went wrong in a callback, once; return what is to be known of the model and its record.

        Returns
        -------
        tuple of str
            Sentences: iterations of MuJoCo's solver that were raised, or are too few with `solver="given"`, which is
            a warning too; temperatures that are assumed or not known; energy that appears from nowhere and commands
            that were clipped, while a record is kept.

        Raises
        ------
        SimulationError
            If a servo or MuJoCo could not continue; names the joint.
        """
        self.raise_failure(data)
        if self._solver_note and self._solver_note.kind == TOO_FEW:
            warnings.warn(self._solver_note.words, stacklevel=2)
        if self._of(data).record_words[RECORD.index("row")]:
            return self.result(data).notes
        return (*((self._solver_note.words,) if self._solver_note else ()), *self._said)

    def __reduce__(self) -> NoReturn:
        """Refuse to be pickled or copied: its servos belong to MuJoCo's data of this process."""
        raise InputError("pickling or copying of a ServoDrive", allowed="its states, what save(data) returns; a drive "
                         "is made anew from a model and servos")

    def _raise(self, data: Any, code: int) -> None:
        error, self._harbour.error = self._harbour.error, None
        if error is not None:
            raise error if isinstance(error, ServotwinError) else ServotwinError(f"servos: {error}") from error
        instance = self._of(data)
        own, culprit = int(instance.words[_CODE]), int(instance.words[_CULPRIT])
        instance.words[_CODE] = WELL
        if own != WELL:
            cause = MESSAGES[own]
            if own == FAILED:
                cause += f": {self._cause(instance, culprit)}"
            raise SimulationError("SERVO", float(data.time), f"joint {self.joints[culprit]}: {cause}")
        if code == FOREIGN:
            self._activate()
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
        """Tell servos where to go, of joints with and without an actuator; before that they hold where they begin.

        Those that turn endlessly take their speed from a pulse width; before that they get the one at which they stand.

        Parameters
        ----------
        goals : mapping of str to float
            Angle [rad] or place [m] by joint, pulse width [s] where its servo turns endlessly; others keep theirs.

        Raises
        ------
        InputError
            If a joint has no servo, a goal is no finite number, or a pulse no width that fits into a frame.
        """
        told = goals_in(self._block(data), len(self._joints))
        for name, goal in goals.items():
            if name not in self.joints:
                raise UnknownNameError("joint with a servo", name, self.joints)
            k = self.joints.index(name)
            self._told[k].check(name, goal, self._joints[k].mount.model.value_or("electronics.frame_period", 0.02))
            told[:, k] = goal, 1.0
            if self._joints[k].command_at >= 0:
                scale, offset = self._arrays["control_scale"][k], self._arrays["control_offset"][k]
                data.ctrl[self._joints[k].command_at] = (goal - offset) / scale

    # --- what shows ---------------------------------------------------------------------------------------------------

    def torque(self, data: Any) -> Array:
        """Return the mean torque [N m], or force [N], that each joint has got from its servo over the last tick."""
        return self._block(data)[len(BLOCK):len(BLOCK) + len(self._joints)].copy()

    def _block(self, data: Any) -> Array:
        instance = self._of(data)
        return np.asarray(data.userdata[self._kept_at:]) if self._kept_at >= 0 else instance.block

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
        rows = instance.rows[:words["used"]].copy()
        close_books(self.model, data, instance, [joint.speed_at for joint in self._joints], rows)
        return Record(self.joints, {joint.name: joint.mount for joint in self._joints}, rows, self._solver_note,
                      self._said, self._slides)

    def look(self, data: Any, name: str) -> Array:
        """Return a signal (SI) of all servos as they stand after the last tick, in the order of `joints`.

        nan where a servo has no such signal. Cheaper than a record where only the present counts.
        """
        found = np.full(len(self._joints), math.nan)
        for berth in self._of(data).berths:
            if name in (*berth.sims.signals, "time"):
                found[berth.crew.which] = berth.sims[name]
        return found

    def lowest_voltage(self, data: Any) -> Array:
        """Return the least voltage of each servo's supply since `watch`, or since they began [V], and when [s].

        Shape (2, n), in the order of `joints`, the time by MuJoCo's clock. It is that of all instants within ticks;
        nan without `watch_supply`.
        """
        found = np.full((2, len(self._joints)), math.nan)
        for berth in self._of(data).berths:
            voltage, when = berth.sims.lowest_voltage
            found[:, berth.crew.which] = voltage, when + (float(data.time) - berth.sims.time)
        return found

    def watch(self, data: Any) -> None:
        """Look for the least voltages of supplies from now on; raise InputError without `watch_supply`."""
        for berth in self._of(data).berths:
            berth.sims.watch()
        self.changed(data)

    def simulators(self, data: Any) -> tuple[VectorSimulator, ...]:
        """Return the simulators of the servos in some data, one for each crew: their lanes are in `crew_joints`.

        Torque and numbers may be set in them between steps; `changed` has to follow.
        """
        return tuple(berth.sims for berth in self._of(data).berths)

    def crew_joints(self, data: Any) -> tuple[tuple[str, ...], ...]:
        """Return the joints of the lanes of each of `simulators`."""
        return tuple(tuple(self.joints[k] for k in berth.crew.which.tolist()) for berth in self._of(data).berths)

    def changed(self, data: Any) -> None:
        """Take up what was set in `simulators` since the last step; without it a step may continue from before."""
        instance, block = self._of(data), self._block(data)
        for berth in instance.berths:
            berth.refresh()
        first = self._harbour.head + instance.size * (1 - int(block[BLOCK.index("half")]))
        block[first:first + instance.size] = instance.remembered().view(np.float64)

    def set(self, *, parameters: Mapping[str, Any] | None = None, joints: Sequence[str] | None = None,
            bus: Any = None) -> None:
        """Give servos other numbers, in all data, and the model their rotors; each data is to begin anew after it.

        So robots get servos that differ from episode to episode, in a third of the time of a new drive: after it comes
        `mujoco.mj_resetData(model, data)` or the like, and `reset(data)`. After an error a drive is to be made anew.

        Parameters
        ----------
        parameters : mapping of str to number or array, optional
            By dotted name (SI), such as "motor.torque_constant": one for all of `joints`, or one for each.
        joints : sequence of str, optional
            All unless given.
        bus : Supply or sequence of tuple (Supply, joints), optional
            Supplies in place of those that servos share, each with the same joints as before.

        Raises
        ------
        InputError
            Or one of its kinds, if a joint has no servo, a number is not possible or makes servos remember more, or
            servos have no supply in common.

        Examples
        --------
        >>> import mujoco
        >>> import servotwin as st
        >>> model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><body><joint name="elbow"/><geom size=".05"/>'
        ...                                        "</body></worldbody></mujoco>")
        >>> drive = ServoDrive(model, {"elbow": st.PulseServo(st.load_servo("hitec-hs-755hb"))})
        >>> before = model.dof_armature[0]
        >>> drive.set(parameters={"motor.rotor_inertia": 2e-6})
        >>> bool(model.dof_armature[0] > before)
        True
        """
        names = self.joints if joints is None else tuple(joints)
        for name in names:
            if name not in self.joints:
                raise UnknownNameError("joint with a servo", name, self.joints)
        if not isinstance(parameters or {}, Mapping):
            raise InputError("parameters", got=parameters, allowed="a mapping of names to numbers or arrays (SI)")
        if bus is not None and not any(berth.crew.bus for berth in self._harbour.first.berths):
            raise InputError("set(bus=...)", got="servos that share none", allowed="those of ServoDrive(..., bus=...)")
        columns = {}
        for name, value in (parameters or {}).items():
            column = np.asarray(value)
            if column.shape not in ((), (len(names),)):
                raise InputError(name, got=f"an array of shape {column.shape}",
                                 allowed=f"a number, or an array ({len(names)},)")
            columns[name] = np.broadcast_to(column, (len(names),))
        self._harbour.change(Change([self.joints.index(name) for name in names], columns,
                                    buses_of(self._joints, bus)))
        put_numbers(self._arrays, self._harbour.first.berths)
        put_into_model(load_mujoco(), self.model, self._joints, self._arrays["armature"])

    def reset(self, data: Any) -> None:
        """Let the servos begin anew at the next step, at rest where their joints are then, as if time had gone back.

        They keep their commands.
        """
        block = self._block(data)
        goals = goals_in(block, len(self._joints))
        kept = goals.copy()
        block[:] = 0.0
        goals[:] = kept

    # --- memory -------------------------------------------------------------------------------------------------------

    def save(self, data: Any) -> DriveState:
        """Return the state of MuJoCo and of the servos; picklable."""
        mujoco = load_mujoco()
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, data, state, kind)
        instance = self._of(data)
        return DriveState(state, data.qfrc_constraint.copy(), instance.block.copy())

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
        sizes = mujoco.mj_stateSize(self.model, kind), instance.block.size
        if not isinstance(state, DriveState) or (state.engine.size, state.servos.size) != sizes:
            raise InputError("restore(state)", got=type(state).__name__,
                             allowed="what save() of this drive has returned")
        mujoco.mj_setState(self.model, data, state.engine, kind)
        data.qfrc_constraint[:] = state.constraint
        instance.block[:] = state.servos
        block = self._block(data)
        block[BLOCK.index("serial")], block[BLOCK.index("restored")] = -1.0, 1.0
