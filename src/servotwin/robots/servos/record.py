"""Signals of a robot's servos at the end of each tick, as `simulate` names them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.models.engine.observe import Observed
from servotwin.models.outputs import SIGNALS
from servotwin.robots.servos.command_map import Told, told
from servotwin.robots.servos.joints_layout import KEPT, ROW
from servotwin.robots.servos.mount import Joint, Mount
from servotwin.simulation import result
from servotwin.simulation.lanes.vector import AT_MOTOR
from servotwin.simulation.remarks import NOT_AT_REST, TRIPS, Remark
from servotwin.simulation.rest import LEAST_REST, look_period, looks_at, swing_of

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import xarray as xr


# --- How often MuJoCo's solver iterates where motor and output of a servo move apart ----------------------------------

# There the joint's armature is the output's alone, a few g cm², so that what touches the ground is nearly massless. A
# solver that is stopped before it has converged then gives it contact forces that do work: energy from nowhere.

LEAST = {"iterations": 10, "ls_iterations": 20}
"""Of MuJoCo's `opt`. A solver that converges earlier stops earlier; on legs of servos with play 3 and 5 suffice."""
_CHOICES = ("raised", "given")
_LOOSE = ("gear.backlash", "gear.stiffness")


RAISED, TOO_FEW = "solver iterations raised", "few solver iterations"


class SolverNote(NamedTuple):
    """A remark on a model's solver: kind of the remark, `RAISED` or `TOO_FEW`, and a sentence."""

    kind: str
    words: str


def set_iterations(model: Any, joints: Sequence[Joint], solver: str) -> SolverNote | None:
    """Raise the iterations of a model's solver to `LEAST` if a servo has play or an elastic gear.

    Parameters
    ----------
    model : MjModel
    joints : sequence of Joint
    solver : str
        "raised", or "given": leave them as they are.

    Returns
    -------
    SolverNote or None
        Setting that was raised, or that is low and was left; None if neither.

    Raises
    ------
    InputError
        If `solver` is neither.
    """
    if solver not in _CHOICES:
        raise InputError("solver", got=solver, allowed="'raised' or 'given'")
    loose = [joint.name for joint in joints if any(joint.mount.model.value_or(name, 0.0) > 0.0 for name in _LOOSE)]
    low = {name: int(getattr(model.opt, name)) for name, least in LEAST.items() if getattr(model.opt, name) < least}
    if not loose or not low:
        return None
    where = f"joint {loose[0]}" + (f" and {len(loose) - 1} more" if len(loose) > 1 else "")
    if solver == "given":
        found = " and ".join(f"{name} = {given} (at least {LEAST[name]} is safe)" for name, given in low.items())
        return SolverNote(TOO_FEW, f"{found} of MuJoCo's solver may let energy appear from nowhere at {where}, with "
                                   "play or an elastic gear")
    for name in low:
        setattr(model.opt, name, LEAST[name])
    found = " and ".join(f"{name} from {given} to {LEAST[name]}" for name, given in low.items())
    return SolverNote(RAISED, f"MuJoCo's solver was raised, {found}, for {where} with play or an elastic gear")


# --- Signals of a robot's servos --------------------------------------------------------------------------------------

Array = NDArray[np.float64]
_COLUMNS = (*KEPT, *Observed._fields)
_OF_JOINT = {"joint_angle": ("rad", "m"), "joint_command": ("rad", "m"), "joint_torque": ("N m", "N"),
             "joint_work": ("J", "J")}
_SHOWN = {"rad": (math.degrees(1.0), "deg"), "m": (1e3, "mm"), "s": (1e6, "us")}
CLIPPED = "commands clipped"
_ROUNDING = 1e-6  # of a command: what clips it by less tells nothing
FROM_NOWHERE = "energy from nowhere"
NOT_KNOWN = f"{FROM_NOWHERE} not known"
_POSSIBLE = "its solver may not converge, its step be too long, or shapes overlap where it begins"
_NOTICED = 0.01  # of the largest energy: what may appear from nowhere; steps alone make 0.004 of it


class Clipped(NamedTuple):
    """Commands that a servo got otherwise than they were given, at an end of its control, its travel or its program.

    Parameters
    ----------
    ticks : int
        In how many of all.
    time : float
        Of the first [s].
    asked, given : float
        The command that was changed most, and what became of it [rad, m, or s of a pulse].
    """

    ticks: int
    time: float
    asked: float
    given: float


@dataclass(frozen=True, eq=False)
class ServoRecord(Mapping[str, Array]):
    """Signals of one servo: signals (SI) by name, shape (n,), as those of a `Result`.

    Beside those of its model there are `joint_angle` and `joint_command`, the angle [rad] or place [m] of the joint and
    what was asked of it (a pulse width [s] where its servo turns endlessly), and `joint_torque`, the mean torque [N m]
    or force [N] that the joint has got in the tick, and `joint_work`, the work [J] that the servo has done at it since
    the record began.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Ends of the ticks [s].
    mount : Mount
    columns : ndarray, shape (n, signals)
    still : float
        From when on no servo of the robot gets another command [s].
    """

    time: Array
    mount: Mount
    columns: Array
    still: float = 0.0

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all signals, `time` first."""
        available = self.mount.model.available
        names = (self._told.kind if name == "command_angle" else name for name in _COLUMNS)
        return ("time", *(name for name in names if name in available), *_OF_JOINT)

    @cached_property
    def _told(self) -> Told:
        return told(self.mount)

    def unit(self, name: str, *, slides: bool = False) -> str:
        """Return the SI unit of a signal."""
        if name == "joint_command" and self._told.unit:
            return self._told.unit
        if name in _OF_JOINT:
            return _OF_JOINT[name][slides]
        return "s" if name == "time" else SIGNALS[name].unit

    def __getitem__(self, name: str) -> Array:
        """Return a signal; KeyError with the names that there are, if it is none of them."""
        if name not in self.names:
            raise UnknownNameError(f"signal of {type(self.mount.model).__name__} at a joint", name, self.names)
        if name == "time":
            return self.time
        mount = self.mount
        if name == "joint_angle":
            return np.asarray(mount.zero + mount.gain * self.columns[:, _COLUMNS.index("output_angle")])
        commands = self.columns[:, _COLUMNS.index("command_angle")]
        if name == "joint_command":
            return np.asarray(self._told.zero + self._told.gain * commands)
        values = commands if name == "pulse_width" else self.columns[:, _COLUMNS.index(name)]
        if name in AT_MOTOR:
            return np.asarray(AT_MOTOR[name](values, mount.model.value("gear.gear_reduction")))
        return values

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def peak(self, name: str) -> float:
        """Return the largest magnitude of a signal among the ends of the ticks; nan where there is none."""
        return float(np.abs(self[name]).max()) if len(self.time) else math.nan

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """First trip by each protection, and that it does not come to rest, (kind, time [s])."""
        return (*self.trips, *self._no_rest())

    @property
    def trips(self) -> tuple[Remark, ...]:
        """First trip by each protection, (kind, time [s])."""
        if "trip" not in self.names:
            return ()
        trips = self["trip"]
        found = [(float(self.time[np.argmax(trips == k)]), kind)
                 for k, kind in enumerate(TRIPS, 1) if (trips == k).any()]
        return tuple(Remark(f"tripped by {kind}", time) for time, kind in sorted(found))

    def _no_rest(self) -> tuple[Remark, ...]:
        model, time = self.mount.model, self.time
        if model.endless or not (len(time) and time[-1] - self.still >= LEAST_REST):
            return ()
        looks = looks_at(self.still, float(time[-1]), look_period(model))
        swing = swing_of(looks, np.interp(looks, time, self["output_angle"]))
        return (Remark(NOT_AT_REST, float(time[-1]), **swing._asdict()),) if swing.swing > 0.0 else ()

    @property
    def clipped(self) -> Clipped | None:
        """Commands beyond their ends, and their fate; None if all were followed as they were given."""
        asked, given = (self.columns[:, _COLUMNS.index(name)] for name in ("asked", "command_angle"))
        off = np.abs(asked - given)
        changed = np.flatnonzero(off > _ROUNDING * (np.abs(given) + (0.0 if self._told.unit == "s" else 1.0)))
        if not len(changed):
            return None
        most = int(np.argmax(off))
        at_joint = (self._told.zero + self._told.gain * float(values[most]) for values in (asked, given))
        return Clipped(len(changed), float(self.time[changed[0]]), *at_joint)

    def to_dataframe(self) -> pd.DataFrame:
        """Return all signals (SI) as a pandas DataFrame, indexed by time [s]."""
        try:
            import pandas as pd
        except ImportError:
            raise MissingExtraError("pandas", "data") from None
        return pd.DataFrame({name: self[name] for name in self.names[1:]}, index=pd.Index(self.time, name="time"))


class Record(Mapping[str, ServoRecord]):
    """Signals of all servos of a robot, by the names of their joints.

    Parameters
    ----------
    joints : tuple of str
    mounts : mapping of str to Mount
    rows : ndarray, shape (n, numbers)
        Ends of the ticks [s], which are its `time`, energies, then what is kept of each servo.
    solver_note : SolverNote, optional
        Change of MuJoCo's solver.
    said : tuple of str
        Sentences on what was assumed of the servos.
    slides : tuple of str
        Joints that are slides, and no hinges.

    Attributes
    ----------
    energy : ndarray, shape (n,)
        Kinetic and potential energy of the model at these times, as MuJoCo counts them [J].
    energy_from_nowhere : ndarray, shape (n,)
        The most so far by which it has exceeded what it was when the record began and the work of servos, other
        actuators and applied forces since, but for what a semi-implicit step borrows of gravity [J]. Contacts and
        limits can only take; a solver that has not converged lets them give. Where bodies are moved as mocap it cannot
        be determined and is nan. State that is set by hand counts.
    cause : str
        Why energy comes from nowhere, in words; empty until somebody has found out, as `run_motion` does.

    Examples
    --------
    >>> import mujoco
    >>> import servotwin as st
    >>> arm = '''<mujoco><worldbody><body><joint name="elbow" axis="0 1 0"/>
    ...   <geom type="capsule" fromto="0 0 0 0.1 0 0" size=".01" mass=".05"/></body></worldbody></mujoco>'''
    >>> drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(arm),
    ...                              {"elbow": st.PulseServo(st.load_servo("hitec-hs-755hb"))})
    >>> data = mujoco.MjData(drive.model)
    >>> drive.record(data)
    >>> drive.command(data, {"elbow": 0.5})
    >>> drive.step(data, 100)
    >>> result = drive.result(data)
    >>> result["elbow"]["armature_current"].shape, bool(result["elbow"].peak("supply_current") > 0.5)
    ((100,), True)
    """

    def __init__(self, joints: tuple[str, ...], mounts: Mapping[str, Mount], rows: Array,
                 solver_note: SolverNote | None = None, said: tuple[str, ...] = (),
                 slides: tuple[str, ...] = ()) -> None:
        self.time, self.energy, self.energy_from_nowhere = (rows[:, k].copy() for k in range(len(ROW)))
        self._solver_note, self._said, self._slides = solver_note, said, slides
        self.cause = ""
        width, first = len(_COLUMNS), len(ROW)
        parts = [rows[:, first + width * k:first + width * (k + 1)] for k in range(len(joints))]
        changes = [np.flatnonzero(np.diff(part[:, _COLUMNS.index("command_angle")])) for part in parts]
        last = max((int(one[-1]) + 1 for one in changes if one.size), default=0)
        still = float(self.time[last]) if len(self.time) else 0.0
        self._servos = {name: ServoRecord(self.time, mounts[name], part, still)
                        for name, part in zip(joints, parts, strict=True)}

    @staticmethod
    def width(servos: int) -> int:
        """Return how many numbers a row has."""
        return len(ROW) + len(_COLUMNS) * servos

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Return what holds of the whole robot, (kind, time [s]).

        "solver iterations raised" or "few solver iterations" of MuJoCo, "energy from nowhere" or "energy from nowhere
        not known", "commands clipped" of each joint where they were.
        """
        found = [Remark(CLIPPED, servo.clipped.time) for servo in self._servos.values() if servo.clipped]
        if self._solver_note and len(self.time):
            found.append(Remark(self._solver_note.kind, float(self.time[0])))
        noticed = np.flatnonzero(self.energy_from_nowhere > _NOTICED * self._largest)
        if len(noticed):
            found.append(Remark(FROM_NOWHERE, float(self.time[noticed[0]])))
        if len(self.time) > 1 and np.isnan(self.energy_from_nowhere).all():
            found.append(Remark(NOT_KNOWN, float(self.time[0])))
        return tuple(found)

    @property
    def _largest(self) -> float:
        """The largest energy [J], from 0 or, since the height of that is anybody's choice, from the lowest."""
        known = self.energy[np.isfinite(self.energy)]
        return float(max(np.abs(known).max(), np.ptp(known))) if len(known) else math.nan

    @property
    def notes(self) -> tuple[str, ...]:
        """The same as sentences, and what was assumed of the servos."""
        found = [*([self._solver_note.words] if self._solver_note else []), *self._said]
        for time in (remark.time for remark in self.remarks if remark.kind == FROM_NOWHERE):
            most = float(np.nanmax(self.energy_from_nowhere))
            found.append(f"energy from nowhere from {time:.3g} s on: up to {most:.3g} J more than there was and than "
                         f"servos have given, with {self._largest:.3g} J at most in the model: "
                         f"{self.cause or _POSSIBLE}")
        if any(remark.kind == NOT_KNOWN for remark in self.remarks):
            found.append("energy from nowhere is not known: mocap bodies move, and nobody counts their work")
        for joint, servo in self._servos.items():
            clipped, (factor, unit) = servo.clipped, _SHOWN.get(
                servo.unit("joint_command", slides=joint in self._slides), (1.0, ""))
            if clipped:
                found.append(f"commands of joint {joint} were clipped in {clipped.ticks} of {len(self.time)} ticks, "
                             f"from {clipped.time:.3g} s on: {factor * clipped.asked:.4g} {unit} became "
                             f"{factor * clipped.given:.4g}")
        return tuple(found)

    def __getitem__(self, name: str) -> ServoRecord:
        """Return what one servo has done."""
        if name not in self._servos:
            raise UnknownNameError("joint with a servo", name, tuple(self._servos))
        return self._servos[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._servos)

    def __len__(self) -> int:
        """Return the number of servos."""
        return len(self._servos)

    def to_dataframe(self) -> pd.DataFrame:
        """Return all signals (SI) of all joints as a pandas DataFrame: columns (joint, signal), indexed by time [s].

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise MissingExtraError("pandas", "data") from None
        found = {(joint, name): servo[name] for joint, servo in self._servos.items() for name in servo.names[1:]}
        return pd.DataFrame(found, index=pd.Index(self.time, name="time")).rename_axis(
            columns=["joint", "signal"])

    def to_xarray(self) -> xr.Dataset:
        """Return all signals (SI) as an xarray Dataset over joint and time [s]; nan where a servo has none of a name.

        Raises
        ------
        MissingExtraError
            If xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError:
            raise MissingExtraError("xarray", "data") from None
        names = dict.fromkeys(name for servo in self._servos.values() for name in servo.names[1:])
        absent = np.full(len(self.time), math.nan)
        units = {name: next(servo.unit(name) for servo in self._servos.values() if name in servo) for name in names}
        return xr.Dataset(
            {name: (("joint", "time"), np.array([servo.get(name, absent) for servo in self._servos.values()]),
                    {} if self._slides and name in _OF_JOINT else {"units": units[name]}) for name in names},
            coords={"joint": list(self._servos), "time": ("time", self.time, {"units": "s"})})

    def save(self, path: str | Path, *, overwrite: bool = False, every: int = 1) -> None:
        """Write all signals of all joints to a CSV file, `joint.signal` with its unit in each column's name.

        Parameters
        ----------
        path : str or Path
        overwrite : bool
        every : int
            Of how many ticks one is written.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        signals, units = {"time": self.time[::every]}, {"time": "s"}
        for joint, servo in self._servos.items():
            for name in servo.names[1:]:
                if name in SIGNALS:
                    signals[f"{joint}.{name}"], units[f"{joint}.{name}"] = servo[name][::every], SIGNALS[name].unit
        result.save_csv(path, signals, units, overwrite=overwrite)
