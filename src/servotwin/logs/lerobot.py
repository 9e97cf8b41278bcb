"""Datasets of LeRobot as logs: one a joint and episode; `lerobot_data` says what a dataset holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from servotwin.errors import InputError, UnitError, UnknownNameError
from servotwin.logs.columns import Column
from servotwin.logs.csv_logs import in_file
from servotwin.logs.joint_tables import is_joint_table
from servotwin.logs.lerobot_data import ACTION, STATE, Joint, Rows, dataset_of, open_dataset
from servotwin.logs.log import Log
from servotwin.logs.reading import ReadColumn, Reading
from servotwin.parameters.registers.held import left_by_lerobot
from servotwin.units.words import scaled_unit, unit_shown, units_written

ALL = "*"
_OPTION = "--joint"


def recognises(path: Path) -> bool:
    """Return whether a path belongs to a dataset."""
    return dataset_of(path) is not None or is_joint_table(path)


def logs_of(path: Path, *, joints: str | Mapping[str, str] | None) -> list[Log]:
    """Return the logs of a dataset, as `read_lerobot_logs` does."""
    return read_lerobot_logs(path, joints=joints)


def read_lerobot_logs(path: str | Path, *, joints: str | Mapping[str, str] | None = None) -> list[Log]:
    """Return the joints of a LeRobot dataset as logs, one a joint and episode.

    A loop of LeRobot stamps its beginning, reads positions, and sends goals some milliseconds later, so that a goal
    acts on the positions of later rows. Rows stay as they are: the `delay` of a fit is the time from the reading of
    positions to when the goal of the same row acts. A remark of each log says so, and what its stamps are.

    Parameters
    ----------
    path : str or Path
        The dataset's folder, or one of its Parquet files; or a table (CSV) that has an action and a state of several
        joints, such as `action.elbow_deg` and `state.elbow_deg`.
    joints : str or mapping, optional
        Which joints, and the unit of their positions: ``"shoulder_pan:deg,elbow_flex:0.93deg"``,
        ``{"elbow_flex": "0.93deg"}``, ``"shoulder_pan"``; `*` stands for all others but the gripper. All but the
        gripper unless given. A unit with a scale is for positions from -100 to 100 of a range: half the range in
        degrees, divided by 100.

    Raises
    ------
    InputError
        If it is no such dataset, has no such joint, or the unit of a joint is not known: one line.
    MissingExtraError
        If pyarrow is not installed.
    """
    dataset = open_dataset(Path(path))
    folder, known = dataset.folder, dataset.joints
    asked = _asked(joints)
    chosen = _chosen(folder, known, asked)
    data = dataset.rows()
    degrees = dataset.degrees(data)
    columns = _columns(folder, chosen, asked, data, degrees)
    left = [joint.name for joint in known if joint not in chosen and joint.is_gripper and joints is None]
    clock = (f"loop of {data.clock()}; positions are read at a stamp and the goal of its row acts later: the delay of "
             "a fit is the time between")
    remarks = (*(f"{name} was left out: it has 0 to 100 of its range; {_OPTION} {name}:0.9deg reads it, with what "
                 "one of these is" for name in left), clock)
    robot = str(dataset.info.get("robot_type") or "")
    remarks += (left_by_lerobot(robot),) if left_by_lerobot(robot) else ()
    return [_log(folder, data, joint, columns[joint.name], (start, stop), {
        "joint": joint.name, "episode": float(episode), **({"robot": robot} if robot else {})}, remarks)
        for start, stop, episode in data.episodes() for joint in chosen]


def _asked(joints: object) -> dict[str, str]:
    """Return units by joint, empty where only the joint was named."""
    if joints is None:
        return {}
    form = "names of joints and their units, such as shoulder_pan:deg or '*:deg'"
    if isinstance(joints, str):
        words = [word.strip() for word in joints.split(",") if word.strip()]
        if not words:
            raise InputError(_OPTION, got=joints, allowed=form)
        pairs = [(name.strip(), unit.strip()) for name, _, unit in (word.partition(":") for word in words)]
    elif isinstance(joints, Mapping) and all(isinstance(x, str) for pair in joints.items() for x in pair):
        pairs = list(joints.items())
    else:
        raise InputError(_OPTION, got=joints, allowed=form)
    names = [name for name, _ in pairs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(_OPTION, got=f"{twice} twice", allowed="once")
    return dict(pairs)


def _chosen(folder: Path, known: list[Joint], asked: Mapping[str, str]) -> list[Joint]:
    for name in asked:
        if name != ALL and not any(name in (joint.name, joint.column) for joint in known):
            raise UnknownNameError(f"joint of {folder}", name, [joint.name for joint in known])
    named = [joint for joint in known if {joint.name, joint.column} & set(asked)]
    rest = [joint for joint in known if joint not in named and not joint.is_gripper]
    return [joint for joint in known if joint in named or ((ALL in asked or not asked) and joint in rest)]


def _columns(folder: Path, chosen: list[Joint], asked: Mapping[str, str], data: Rows, degrees: str,
             ) -> dict[str, tuple[Column, str]]:
    """Return the unit of each joint's positions, and how it was known."""
    made, lacking = {}, []
    for joint in chosen:
        text = asked.get(joint.name) or asked.get(joint.column) or ("" if joint.is_gripper else asked.get(ALL, ""))
        if text:
            unit, dimension, scale, offset = scaled_unit(f"{_OPTION} {joint.name}", text)
            if dimension != "angle":
                raise UnitError(f"{_OPTION} {joint.name}", got=text, allowed=units_written("angle"))
            made[joint.name] = (Column(joint.column, unit, scale, offset), _OPTION)
        elif degrees and not joint.is_gripper:
            made[joint.name] = (Column(joint.column, "deg"), f"guessed from {degrees}")
        else:
            lacking.append(joint)
    if lacking:
        states = np.concatenate([data.states[:, joint.state] for joint in lacking])
        one = lacking[0].name
        what = "0 to 100" if all(joint.is_gripper for joint in lacking) else "-100 to 100"
        raise InputError(
            f"{folder}: unit of {', '.join(joint.name for joint in lacking)} is not known (values "
            f"{np.min(states):.4g} to {np.max(states):.4g}: degrees, or {what} of a range)",
            allowed=f'{_OPTION} {one}:deg or, for a range, {_OPTION} {one}:0.9deg with what one of these is'
            + (f'; {_OPTION} "*:deg" for all' if what == "-100 to 100" else ""))
    return made


def _log(folder: Path, data: Rows, joint: Joint, said: tuple[Column, str], rows: tuple[int, int],
         conditions: dict[str, float | str], remarks: tuple[str, ...]) -> Log:
    column, known = said
    a, b = rows
    name = f"{joint.name} {conditions['episode']:06.0f}"
    unit = unit_shown(column.unit, column.scale, column.offset)
    reading = Reading(file=str(folder), remarks=remarks, columns=(
        ReadColumn(f"{ACTION} {joint.column}", "command_angle", unit, known),
        ReadColumn(f"{STATE} {joint.column}", "output_angle", unit, known)))
    with in_file(folder, name):
        return Log(name=name, source=str(folder), time=data.time[a:b], command_kind="angle",
                   command=column.to_si(data.actions[a:b, joint.action], "command_angle"),
                   measured={"output_angle": column.to_si(data.states[a:b, joint.state], "output_angle")},
                   conditions=conditions, reading=reading)
