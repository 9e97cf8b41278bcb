"""The goals of an episode of a LeRobot dataset, as angles of the robot's joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError, UnitError, UnknownNameError
from servotwin.logs.lerobot_data import Dataset, Joint, Rows, open_dataset
from servotwin.robots.calibration import DEGREES, OPENING, RANGE, Calibration, joint_angles, read_calibration
from servotwin.units.words import scaled_unit, units_written

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
    """What a joint's goals are: their form, after scale and offset."""

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
