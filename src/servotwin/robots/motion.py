"""Motions of a robot's joints, from a table or a recorded episode of LeRobot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin import units
from servotwin.errors import InputError, UnitError, UnknownNameError
from servotwin.logs.lerobot import Dataset, Joint, Rows, is_joint_table, open_dataset
from servotwin.logs.sidecar import read_json
from servotwin.tables import TextTable, read_table
from servotwin.units.words import scaled_unit, unit_word, units_written

# --- LeRobot's normalised goals: counts of a servo, and from these angles of a joint ----------------------------------

# A calibration of LeRobot says of each joint between which counts it moves, `range_min` and `range_max`. A goal becomes
# a whole count as `_unnormalize` makes it (huggingface/lerobot, src/lerobot/motors/motors_bus.py, commit
# 049856c7cb2c719d0644004b5884a51c3ab9ed2b); what is behind the point is cut off:
#
# - -100 to 100: range_min + (x + 100)/200 (range_max - range_min), x held within -100 and 100;
# - 0 to 100, the gripper: range_min + x/100 (range_max - range_min), x held within 0 and 100;
# - degrees: (range_min + range_max)/2 + 4095/360 x, held nowhere: LeRobot gives 4095 counts to 360 degrees.
#
# `drive_mode` turns the first two round, -x and 100 - x, and leaves degrees as they are. `homing_offset` is in the
# servo, whose counts have it already. A servo has 4096 counts a turn, so the angle of a joint from the middle of its
# calibrated range is 2π/4096 (count - (range_min + range_max)/2): LeRobot's degrees up to the last count and one part
# in 4096. A dataset holds goals as float32, so where one lies on a count, it may become the count before.

RANGE, OPENING, DEGREES = "-100 to 100", "0 to 100", "degrees"
_COUNTS = 4096  # a turn, of Feetech STS and SMS and of Dynamixel X
_ANGLE = 2.0 * math.pi / _COUNTS  # of one count [rad]
_FORM = '{"shoulder_pan": {"drive_mode": 0, "range_min": 700, "range_max": 3300}, ...}, as LeRobot writes it'


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """The calibration of one joint.

    Parameters
    ----------
    range_min, range_max : int
        Counts of its servo at both ends of its range.
    inverted : bool
        Whether -100 is at `range_max`.

    Examples
    --------
    >>> elbow = Calibration(range_min=900, range_max=3100)
    >>> elbow.counts(np.array([-100.0, 0.0, 50.0]), RANGE).tolist()
    [900.0, 2000.0, 2550.0]
    >>> np.degrees(elbow.angles(elbow.counts(np.array([90.0]), DEGREES))).round(2).tolist()
    [89.91]
    """

    range_min: int
    range_max: int
    inverted: bool = False

    def counts(self, goals: NDArray[np.float64], form: str) -> NDArray[np.float64]:
        """Return the whole counts that LeRobot sends for goals.

        Parameters
        ----------
        goals : (n,) array
        form : {"-100 to 100", "0 to 100", "degrees"}
        """
        return np.trunc(self._unrounded(goals, form))

    def read_counts(self, positions: NDArray[np.float64], form: str) -> NDArray[np.float64]:
        """Return the whole counts that positions were made of.

        Examples
        --------
        >>> Calibration(range_min=900, range_max=3100).read_counts(np.array([49.9999]), RANGE).tolist()
        [2550.0]
        """
        return np.rint(self._unrounded(positions, form))

    def _unrounded(self, goals: NDArray[np.float64], form: str) -> NDArray[np.float64]:
        if form == DEGREES:
            return np.asarray(goals * (_COUNTS - 1) / 360.0 + (self.range_min + self.range_max) / 2.0)
        if self.inverted:
            goals = -goals if form == RANGE else 100.0 - goals
        return np.asarray(range_share(goals, form) * (self.range_max - self.range_min) + self.range_min)

    def angles(self, counts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the angles from the middle of the range [rad]."""
        return np.asarray(_ANGLE * (counts - (self.range_min + self.range_max) / 2.0))


def range_share(goals: NDArray[np.float64], form: str) -> NDArray[np.float64]:
    """Return how far into a range normalised goals are: 0 at its lower end, 1 at its upper one.

    Examples
    --------
    >>> range_share(np.array([-120.0, 50.0]), RANGE).tolist(), range_share(np.array([50.0]), OPENING).tolist()
    ([0.0, 0.75], [0.5])
    """
    return np.clip((goals + 100.0) / 200.0 if form == RANGE else goals / 100.0, 0.0, 1.0)


def joint_angles(goals: NDArray[np.float64], form: str, calibration: Calibration | None,
                 limits: tuple[float, float] | None, *, measured: bool = False) -> NDArray[np.float64]:
    """Return goals as angles of a joint [rad].

    Parameters
    ----------
    goals : (n,) array
    form : {"-100 to 100", "0 to 100", "degrees"}
        All but degrees need a calibration or limits.
    calibration : Calibration, optional
    limits : (float, float), optional
        Of the joint in the robot's model. Without a calibration they are the ends of -100 to 100. With one, they only
        say where the calibrated range lies: the middle of both is the same, or where 0 to 100 is meant, the lower end.
        Unless given, the middle is at 0 [rad]
    measured : bool
        They are positions, not goals: rounded to the nearest count, not cut off.

    Raises
    ------
    InputError
        If both are missing, and the goals are no degrees.

    Examples
    --------
    >>> joint_angles(np.array([0.0, 50.0]), OPENING, None, (-0.2, 1.8)).tolist()
    [-0.2, 0.8]
    """
    middle = 0.0 if limits is None else 0.5 * (limits[0] + limits[1])
    if calibration is not None:
        counts = calibration.read_counts(goals, form) if measured else calibration.counts(goals, form)
        if form == OPENING and limits is not None:
            closed = calibration.counts(np.zeros(1), form)
            return np.asarray(limits[0] + _ANGLE * np.abs(counts - closed))
        return middle + calibration.angles(counts)
    if form == DEGREES:
        return middle + np.radians(goals)
    if limits is None:
        raise InputError(f"goals of {form}", allowed="with a calibration, or limits of the joint")
    return limits[0] + (limits[1] - limits[0]) * range_share(goals, form)


def read_calibration(source: str | Path | Mapping[str, Any], *, drive_mode: bool = True) -> dict[str, Calibration]:
    """Return LeRobot's calibration of a robot, by joint.

    Parameters
    ----------
    source : str, Path or mapping
        Its JSON file, ``~/.cache/huggingface/lerobot/calibration/robots/TYPE/ID.json``, or what such a file holds.
    drive_mode : bool
        Whether LeRobot heeds `drive_mode`, as it does with Feetech; Dynamixel servos do so themselves.

    Raises
    ------
    InputError
        If it cannot be read, or is no calibration.

    Examples
    --------
    >>> read_calibration({"gripper": {"id": 6, "drive_mode": 0, "homing_offset": 12, "range_min": 2030,
    ...                               "range_max": 3500}})["gripper"].range_max
    3500
    """
    is_file = not isinstance(source, Mapping)
    where = f"{source}" if is_file else "calibration"
    content = read_json(source) if isinstance(source, (str, Path)) else source
    if not isinstance(content, Mapping) or not content:
        raise InputError(where, got=content, allowed=_FORM)
    return {str(joint): _calibration(f"{where}: {joint}", said, drive_mode) for joint, said in content.items()}


def _calibration(where: str, said: object, drive_mode: bool) -> Calibration:
    if not isinstance(said, Mapping):
        raise InputError(where, got=said, allowed=_FORM)
    low, high, inverted = (said.get(key, default) for key, default in (
        ("range_min", None), ("range_max", None), ("drive_mode", 0)))
    for key, value in (("range_min", low), ("range_max", high)):
        if not isinstance(value, int) or isinstance(value, bool):
            raise InputError(f"{where} {key}", got="nothing" if value is None else value, allowed="a whole number")
    if not low < high:
        raise InputError(f"{where} range_min and range_max", got=f"{low} and {high}", allowed="the smaller one first")
    if inverted not in (0, 1):
        raise InputError(f"{where} drive_mode", got=inverted, allowed="0 or 1")
    return Calibration(range_min=low, range_max=high, inverted=bool(inverted) and drive_mode)


# --- The goals of an episode of a LeRobot dataset, as angles of the robot's joints ------------------------------------

ALL = "*"
_NORMALISED = "range"
_DYNAMIXEL = ("koch", "omx", "viperx", "widowx", "aloha")  # beginnings of `robot_type`
_OLD_UNITS = '{"*": "deg", "shoulder_lift": "-deg+90", "elbow_flex": "deg-90"}'


@dataclass(frozen=True, eq=False, kw_only=True)
class Goals:
    """Goals of an episode.

    Parameters
    ----------
    time : (n,) array
        Counted from the first frame [s]
    angles, measured : dict of str to (n,) array
        Goals and measured positions by joint [rad]
    source : str
        Dataset and episode.
    robot : str
        LeRobot's `robot_type`, empty where the dataset does not say it.
    """

    time: NDArray[np.float64]
    angles: dict[str, NDArray[np.float64]]
    measured: dict[str, NDArray[np.float64]]
    source: str
    robot: str


@dataclass(frozen=True, kw_only=True)
class _Form:
    """The goals of a joint: their form, after scale and offset."""

    form: str
    degrees: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda goals: goals


def episode_goals(path: Path, joints: Mapping[str, str], *, unit: str | Mapping[str, str] | None,
                  calibration: str | Path | Mapping[str, Any] | None, episode: int | None,
                  ranges: Mapping[str, tuple[float, float]] | None) -> Goals:
    """Return the goals of an episode; parameters are those of `read_motion`.

    Parameters
    ----------
    joints : mapping
        "angle", "length" or nothing of each joint of the robot.

    Raises
    ------
    InputError
        If it is no dataset, or what its goals mean is not known.
    UnknownNameError
        If the robot has no such joint.
    """
    dataset = open_dataset(path)
    for joint in dataset.joints:
        if joint.name not in joints:
            raise UnknownNameError(f"joint of the robot (in {dataset.folder})", joint.name, joints)
        if joints[joint.name] == "length":
            raise UnitError(f"{dataset.folder}: {joint.name}", got="an angle", allowed=units_written("length"))
    rows = dataset.rows()
    start, stop, number = _episode(dataset, rows, episode)
    forms = _forms(dataset, rows, unit)
    robot = str(dataset.info.get("robot_type") or "")
    drive_mode = not robot.startswith(_DYNAMIXEL)
    known = None if calibration is None else read_calibration(calibration, drive_mode=drive_mode)
    angles: dict[str, NDArray[np.float64]] = {}
    measured: dict[str, NDArray[np.float64]] = {}
    for joint in dataset.joints:
        form, limits = forms[joint.name], None if dataset.unit_from else (ranges or {}).get(joint.name)
        one = None if known is None else _calibrated(known, joint, calibration)
        if form.form != DEGREES and one is None and limits is None:
            raise InputError(f"{dataset.folder}: {joint.name} has {form.form} of its calibrated range",
                             allowed="with calibration=, a file of LeRobot, or ranges=, the limits of the joint in rad")
        for found, some, at in ((angles, rows.actions, joint.action), (measured, rows.states, joint.state)):
            values = np.asarray(some[start:stop, at], dtype=np.float64)
            if not np.all(np.isfinite(values)):
                raise InputError(f"{dataset.folder}: {joint.name} in episode {number}", allowed="finite numbers",
                                 got=float(values[~np.isfinite(values)][0]))
            found[joint.name] = joint_angles(form.degrees(values), form.form, one, limits, measured=found is measured)
    time = np.asarray(rows.time[start:stop] - rows.time[start])
    return Goals(time=time, angles=angles, measured=measured, source=f"{path}, episode {number}", robot=robot)


def episodes_of(path: Path) -> tuple[int, ...]:
    """Return the numbers of all episodes of a dataset."""
    return tuple(number for _, _, number in open_dataset(path).rows().episodes())


def _episode(dataset: Dataset, rows: Rows, episode: int | None) -> tuple[int, int, int]:
    """Return the first row of an episode, the one after its last, and its number."""
    found = {number: (start, stop, number) for start, stop, number in rows.episodes()}
    if episode is None:
        return next(iter(found.values()))
    if isinstance(episode, bool) or episode not in found:
        first, last = min(found), max(found)
        raise InputError(f"{dataset.folder}: episode", got=episode,
                         allowed=f"{first} to {last}" if len(found) > 1 else f"{first}")
    return found[episode]


def _calibrated(known: Mapping[str, Calibration], joint: Joint, source: object) -> Calibration:
    if joint.name not in known:
        where = "calibration" if isinstance(source, Mapping) else source
        raise InputError(f"{where}: joints", got=", ".join(known), allowed=f"also {joint.name}")
    return known[joint.name]


def _forms(dataset: Dataset, rows: Rows, unit: str | Mapping[str, str] | None) -> dict[str, _Form]:
    """Return what the goals of each joint are."""
    said = unit if isinstance(unit, Mapping) else {} if unit is None else {ALL: unit}
    for name in said:
        if name != ALL and not any(name in (joint.name, joint.column) for joint in dataset.joints):
            raise UnknownNameError(f"joint of {dataset.folder}", name, [joint.name for joint in dataset.joints])
    degrees = dataset.degrees(rows)
    made, lacking = {}, []
    for joint in dataset.joints:
        word = said.get(joint.name) or said.get(joint.column) or ("" if joint.is_gripper else said.get(ALL, ""))
        if word:
            made[joint.name] = _form(word, joint)
        elif joint.is_gripper:
            made[joint.name] = _Form(form=OPENING)
        elif degrees and not joint.is_old:
            made[joint.name] = _Form(form=DEGREES)
        else:
            lacking.append(joint)
    if lacking:
        raise _unknown(dataset, rows, lacking)
    return made


def _form(word: object, joint: Joint) -> _Form:
    what = f"unit of {joint.name}"
    if word == _NORMALISED:
        return _Form(form=OPENING if joint.is_gripper else RANGE)
    if not isinstance(word, str):
        raise UnitError(what, got=word, allowed=f"{_NORMALISED}, or {units_written('angle')}")
    unit, dimension, scale, offset = scaled_unit(what, word)
    if dimension != "angle":
        raise UnitError(what, got=word, allowed=f"{_NORMALISED}, or {units_written('angle')}")
    factor = units.to_si(1.0, unit, "angle") / units.to_si(1.0, "deg", "angle")
    return _Form(form=DEGREES, degrees=lambda goals: factor * (scale * goals + offset))


def _unknown(dataset: Dataset, rows: Rows, joints: list[Joint]) -> InputError:
    names = ", ".join(joint.name for joint in joints)
    if any(joint.is_old for joint in joints):
        return InputError(f"{dataset.folder}: zero of {names} is not known (recorded before June 2025)",
                          allowed=f"unit=, which moves it to the middle of the range: {_OLD_UNITS} for an SO-100")
    goals = np.concatenate([rows.actions[:, joint.action] for joint in joints])
    return InputError(
        f"{dataset.folder}: unit of {names} is not known (goals {np.nanmin(goals):.4g} to {np.nanmax(goals):.4g}: "
        f"degrees, or -100 to 100 of a range)", allowed='unit="deg" or unit="range"')


def joints_of_dataset(path: Path) -> tuple[str, ...]:
    """Return the names of the joints of a dataset."""
    return tuple(joint.name for joint in open_dataset(path).joints)


# --- Motions of a robot's joints, from a table or a recorded episode of LeRobot ---------------------------------------

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
    Angles count from the middle of that range, as LeRobot's degrees do; as `Calibration` has it.
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
