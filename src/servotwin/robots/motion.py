"""What the joints of a robot are to do, from a table or a recorded episode of LeRobot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin import units
from servotwin.errors import InputError, UnitError, UnknownNameError
from servotwin.logs.joint_tables import is_joint_table
from servotwin.robots.episode import episode_goals
from servotwin.tables import TextTable, read_table
from servotwin.units.words import unit_word, units_written

_TIMES = {"time": "s", "time_s": "s", "time_ms": "ms"}
_DIMENSIONS = ("angle", "length")  # of a hinge and of a slide
_DATASET_ENDING = ".parquet"


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Goals of the joints of a robot over time.

    Parameters
    ----------
    time : (n,) array
        Of the samples; begins at 0 and increases [s]
    angles : mapping of str to (n,) array
        Goal of each joint that moves: of a hinge [rad], of a slide [m]
    source : str
        Where it comes from.
    still : tuple of str
        Joints that it says nothing of: they hold still where they are.
    robot : str
        LeRobot's name of the kind of robot that it was recorded with; empty where that is not known.
    measured : mapping of str to (n,) array
        Where joints were at these times, as far as it was recorded: of a hinge [rad], of a slide [m]

    Raises
    ------
    InputError
        If time does not begin at 0 and increase, there are less than two samples, or one is no finite number.

    Examples
    --------
    >>> wave = Motion(time=[0.0, 1.0, 2.0], angles={"elbow": [0.0, 0.5, 0.0]}, source="by hand")
    >>> wave.at("elbow", [-1.0, 0.5, 1.5, 9.0]).tolist(), wave.duration, wave.joints
    ([0.0, 0.25, 0.25, 0.0], 2.0, ('elbow',))
    """

    time: NDArray[np.float64]
    angles: Mapping[str, NDArray[np.float64]]
    source: str
    still: tuple[str, ...] = field(default=())
    robot: str = ""
    measured: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check, and keep own copies that nobody changes."""
        time = self._array("time", self.time)
        if time.ndim != 1 or time.size < 2:
            raise InputError(f"{self.source}: time", got=f"{time.size} sample{'s' * (time.size != 1)}",
                             allowed="at least two")
        if time[0] != 0.0 or not np.all(np.diff(time) > 0.0):
            raise InputError(f"{self.source}: time", got=f"{time[0]:.9g} s to {time[-1]:.9g} s",
                             allowed="increasing times that begin at 0")
        if not self.angles:
            raise InputError(f"{self.source}: joints", got="none", allowed="at least one that moves")
        angles = {str(joint): self._array(joint, values) for joint, values in self.angles.items()}
        measured = {str(joint): self._array(joint, values) for joint, values in self.measured.items()}
        for joint, values in (*angles.items(), *measured.items()):
            if values.shape != time.shape:
                raise InputError(f"{self.source}: {joint}", got=f"shape {values.shape}", allowed=f"{time.shape}")
        for name, value in (("time", time), ("angles", angles), ("measured", measured), ("still", tuple(self.still))):
            object.__setattr__(self, name, value)

    def _array(self, name: str, values: object) -> NDArray[np.float64]:
        try:
            made = np.array(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{self.source}: {name}", got=values, allowed="numbers") from None
        if not np.all(np.isfinite(made)):
            raise InputError(f"{self.source}: {name}", got=float(made[~np.isfinite(made)][0]),
                             allowed="finite numbers")
        made.setflags(write=False)
        return made

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move."""
        return tuple(self.angles)

    @overload
    def at(self, joint: str, time: float) -> float: ...
    @overload
    def at(self, joint: str, time: ArrayLike) -> float | NDArray[np.float64]: ...
    def at(self, joint: str, time: ArrayLike) -> float | NDArray[np.float64]:
        """Return the goal of a joint: linear between samples, held before the first and after the last.

        Parameters
        ----------
        joint : str
        time : float or array
            [s]

        Returns
        -------
        float or array
            Of the shape of `time`: of a hinge [rad], of a slide [m]

        Raises
        ------
        UnknownNameError
            If it says nothing of this joint.
        """
        if joint not in self.angles:
            raise UnknownNameError(f"joint of {self.source}", joint, self.joints)
        found = np.interp(np.asarray(time, dtype=np.float64), self.time, self.angles[joint])
        return float(found) if found.ndim == 0 else np.asarray(found)


def read_motion(path: str | Path, joints: Iterable[str] | Mapping[str, str], *,
                unit: str | Mapping[str, str] | None = None,
                calibration: str | Path | Mapping[str, Any] | None = None, episode: int | None = None,
                ranges: Mapping[str, tuple[float, float]] | None = None) -> Motion:
    r"""Return the motion in a table, or the goals of an episode of a LeRobot dataset.

    A table (CSV) has a column `time` (or `time_s`, `time_ms`), counted from its first row, and a column for each joint
    that moves: `elbow_deg`, `elbow_rad`, `slider_mm`, or `elbow` in SI. The rest of the parameters is for datasets, and
    for tables with an action and a state of several joints (`action.elbow_deg`, `state.elbow_deg`). The positions that
    a dataset has beside its goals are `measured`.

    Goals of a dataset are degrees, or -100 to 100 of the range in which a joint was calibrated; a gripper has 0 to 100.
    Angles count from the middle of that range, as LeRobot's degrees do; `servotwin.robots.calibration` says how.
    Datasets from before June 2025 have their zero elsewhere, so their unit has to be said.

    Parameters
    ----------
    path : str or Path
        The table; or the dataset's folder, or one of its Parquet files.
    joints : iterable of str, or mapping
        Joints of the robot; a mapping says "angle" or "length" of each, of which its unit has to be.
    unit : str or mapping, optional
        Of a dataset's goals: "deg"; "range", for -100 to 100; or a unit with scale and offset that makes LeRobot's
        degrees of them. By joint, where they differ, `*` standing for all others but the gripper: ``{"*": "deg",
        "shoulder_lift": "-deg+90", "elbow_flex": "deg-90"}`` is an SO-100 from before June 2025. Unless given, it is
        degrees where numbers go beyond 100, and else an error.
    calibration : str, Path or mapping, optional
        LeRobot's calibration of the robot, a JSON file: goals become whole counts of its servos, as LeRobot sends them.
    episode : int, optional
        The first one unless given; `source` names it.
    ranges : mapping of str to (float, float), optional
        Limits of the joints in the robot's model. The middle of a calibrated range is in their middle, 0 unless given,
        and a gripper's closed end at the lower one. Without a calibration, -100 to 100 are these ends [rad]

    Raises
    ------
    InputError
        If the file cannot be read, has less than two rows, a value is no number, time does not increase, a unit is
        wrong or not known, or a joint has to have a calibration: one line.
    UnknownNameError
        If a column is no joint.
    MissingExtraError
        If it is a dataset, and pyarrow is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "wave.csv"
    >>> _ = file.write_text("time_s,elbow_deg,slider_mm\n0,0,10\n2,90,20\n")
    >>> wave = read_motion(file, ["shoulder", "elbow", "slider"])
    >>> wave.at("elbow", 2.0), wave.at("slider", 1.0), wave.still
    (1.570796, 0.015, ('shoulder',))
    """
    path = Path(path)
    known = _known(joints)
    for joint, limits in (ranges or {}).items():
        _check_limits(joint, limits)
    if is_dataset(path):
        goals = episode_goals(path, known, unit=unit, calibration=calibration, episode=episode, ranges=ranges)
        time, angles, source, robot, measured = goals.time, goals.angles, goals.source, goals.robot, goals.measured
    else:
        for name, given in (("unit", unit), ("calibration", calibration), ("episode", episode)):
            if given is not None:
                raise InputError(f"{name}= for {path}", got="a table",
                                 allowed="datasets of LeRobot; in a table, the name of a column ends in its unit")
        table = read_table(path, lambda name: name in _TIMES or _meaning(name, known) is not None)
        table.check_lengths()
        time, angles, source, robot = _time(table), _angles(table, known), f"{path}", ""
        measured = {}
    still = tuple(joint for joint in known if joint not in angles)
    return Motion(time=time, angles=angles, source=source, still=still, robot=robot, measured=measured)


def is_dataset(path: Path) -> bool:
    """Tell whether a path is of a dataset of LeRobot, or of a table that is read as one."""
    try:
        return path.is_dir() or (path.suffix.lower() == _DATASET_ENDING and path.is_file()) or is_joint_table(path)
    except (OSError, ValueError):  # reading says what is wrong with the name
        return False


def _known(joints: Iterable[str] | Mapping[str, str]) -> dict[str, str]:
    """Return the dimension of each joint, empty where it may be either."""
    if isinstance(joints, str):
        raise InputError("joints", got=joints, allowed="a list of names")
    known = dict(joints) if isinstance(joints, Mapping) else dict.fromkeys(joints, "")
    if not known:
        raise InputError("joints", got="none", allowed="the names of the robot's joints")
    for joint, dimension in known.items():
        if dimension and dimension not in _DIMENSIONS:
            raise InputError(f"joints: {joint}", got=dimension, allowed=" or ".join(_DIMENSIONS))
    return known


def _check_limits(joint: str, limits: object) -> None:
    if not isinstance(limits, (tuple, list, np.ndarray)) or len(limits) != 2 or not all(
            map(units.is_finite, limits)) or not limits[0] < limits[1]:
        raise InputError(f"ranges: {joint}", got=limits, allowed="(lower, upper) in rad")


def _meaning(column: str, known: Mapping[str, str]) -> tuple[str, str] | None:
    """Return the joint that a column is about and the unit behind it, None where it is about none."""
    if column in known:
        return column, ""
    joint = max((name for name in known if column.startswith(f"{name}_")), key=len, default=None)
    suffix = "" if joint is None else column[len(joint) + 1:]
    return None if joint is None or unit_word(suffix) is None else (joint, suffix)


def _time(table: TextTable) -> NDArray[np.float64]:
    """Return the times, counted from the first row [s]."""
    found = [name for name in table.header if name in _TIMES]
    if len(set(found)) != 1:
        raise InputError(f"{table.path}: column of time", got=", ".join(found or table.header),
                         allowed=("one of " if found else "") + ", ".join(_TIMES))
    time = units.to_si(_numbers(table, found[0]), _TIMES[found[0]], "time")
    time = np.asarray(time - np.asarray(time)[0])
    if time.size < 2:
        raise InputError(f"{table.path}", got="one row", allowed="at least two")
    bad = np.flatnonzero(np.diff(time) <= 0.0)
    if bad.size:
        k = int(bad[0]) + 1
        raise InputError(f"{table.path}: line {table.rows[k].line}, {found[0]}", allowed="increasing times",
                         got=f"{table.cells(found[0])[k]} after {table.cells(found[0])[k - 1]}")
    return time


def _angles(table: TextTable, known: Mapping[str, str]) -> dict[str, NDArray[np.float64]]:
    """Return the goals by joint, in SI."""
    columns: dict[str, str] = {}
    for column in table.header:
        if column in _TIMES or not column:
            continue
        meaning = _meaning(column, known)
        if meaning is None:
            raise UnknownNameError(f"column of {table.path}", column, known)
        if meaning[0] in columns and columns[meaning[0]] != column:
            raise InputError(f"{table.path}: {meaning[0]}", got=f"columns {columns[meaning[0]]} and {column}",
                             allowed="one of them")
        columns[meaning[0]] = column
    if not columns:
        raise InputError(f"{table.path}: columns", got=", ".join(table.header),
                         allowed=f"also one of a joint: {', '.join(known)}")
    return {joint: _in_si(table, column, (_meaning(column, known) or (joint, ""))[1], known[joint])
            for joint, column in columns.items()}


def _in_si(table: TextTable, column: str, suffix: str, dimension: str) -> NDArray[np.float64]:
    values = _numbers(table, column)
    if not suffix:
        return values
    allowed = (dimension,) if dimension else _DIMENSIONS
    unit, measured = unit_word(suffix) or ("", "")
    if measured not in allowed:
        raise UnitError(f"{table.path}: unit of column {column}", got=suffix,
                        allowed=", ".join(map(units_written, allowed)))
    return np.asarray(units.to_si(values, unit, measured))


def _numbers(table: TextTable, column: str) -> NDArray[np.float64]:
    """Return the numbers of a column, all of them finite."""
    values = table.numbers(column)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        k = int(bad[0])
        raise InputError(f"{table.path}: line {table.rows[k].line}, {column}", got=table.cells(column)[k],
                         allowed="a finite number")
    return values
