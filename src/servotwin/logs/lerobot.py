"""Datasets of LeRobot as logs: one a joint and episode; `lerobot_data` says what a dataset holds."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError, MissingExtraError, UnitError, UnknownNameError
from servotwin.logs.columns import Column
from servotwin.logs.csv_logs import in_file
from servotwin.logs.formats import ReadColumn, Reading
from servotwin.logs.log import Log
from servotwin.logs.sidecar import read_json
from servotwin.parameters.registers.held import left_by_lerobot
from servotwin.tables import TextTable, read_table
from servotwin.text import checked_name
from servotwin.units.words import scaled_unit, unit_shown, units_written

# --- A dataset of LeRobot: its joints, and the goals and positions of every episode -----------------------------------

# A dataset is a folder with `meta/info.json` and Parquet files below `data` (versions 2.0, 2.1 and 3.0 of the format,
# https://github.com/huggingface/lerobot). `action` holds the goals of all joints, `observation.state` their positions.
#
# The format does not say what their unit is. Robots with Feetech or Dynamixel servos recorded degrees before the
# hardware interface of June 2025 (joints are named `main_...` there), then -100 to 100 of each joint's calibrated range
# or, with `use_degrees`, degrees; degrees are the default since February 2026 (issue 1259 and pull request 2968 of
# huggingface/lerobot). Values of that range are cut off at 100, so positions beyond it are degrees. The gripper has 0
# to 100 in all of these.

ACTION, STATE = "action", "observation.state"
_INFO = Path("meta") / "info.json"
_RANGE = 100.0  # of normalised positions
_ROUNDING = 1e-3  # of float32 at its end
_SERVO_ROBOTS = ("so100", "so101", "so_", "koch", "lekiwi", "moss", "bi_so")  # beginnings of `robot_type`
_NO_POSITIONS = (".vel", ".torque", ".effort", ".current")
_REGULAR = 1e-3  # of a step: float32 rounds stamps of an hour by as much
_OLD = "main_"  # how joints were named before June 2025


@dataclass(frozen=True)
class Joint:
    """A joint: its name, its places in `action` and `observation.state`, and whether it surely has degrees."""

    name: str
    column: str
    action: int
    state: int
    in_degrees: bool = False

    @property
    def is_gripper(self) -> bool:
        """Whether it has 0 to 100 rather than -100 to 100."""
        return "gripper" in self.name.lower() and not self.in_degrees

    @property
    def is_old(self) -> bool:
        """Whether it was recorded before June 2025, with its zero elsewhere than in the middle of the range."""
        return self.column.startswith(_OLD)


def dataset_of(path: Path) -> Path | None:
    """Return the folder of the dataset that a path belongs to, None where it is none.

    Parameters
    ----------
    path : Path
        The folder, its `meta/info.json`, or one of its Parquet files.
    """
    try:
        if path.is_dir():
            return path if (path / _INFO).is_file() else None
        if path.name == "info.json" and path.parent.name == "meta":
            return path.parent.parent
        if path.suffix.lower() == ".parquet":
            return next((folder for folder in path.absolute().parents if (folder / _INFO).is_file()), None)
    except (OSError, ValueError):  # reading says what is wrong with the name
        pass
    return None


@dataclass(frozen=True)
class Dataset:
    """A dataset of which only `meta/info.json` was read.

    Parameters
    ----------
    folder : Path
    info : mapping
        Of `meta/info.json`.
    joints : list of Joint
    files : list of Path
        With its rows.
    read : callable, optional
        Returns its rows; those of the Parquet files unless given.
    unit_from : str
        From what it is known that positions are degrees; empty where only they tell.
    """

    folder: Path
    info: Mapping[str, Any]
    joints: list[Joint]
    files: list[Path]
    read: Callable[[], Rows] | None = None
    unit_from: str = ""

    def rows(self) -> Rows:
        """Return what its files hold.

        Raises
        ------
        InputError
            If there are none, or one cannot be read.
        MissingExtraError
            If pyarrow is not installed.
        """
        if self.read is not None:
            return self.read()
        if not self.files:
            raise InputError(f"{self.folder}", got="no data/**/*.parquet",
                             allowed="a dataset with its data, not only meta")
        return rows_of_files(self.files, max(joint.action for joint in self.joints) + 1,
                    max(joint.state for joint in self.joints) + 1)

    def degrees(self, rows: Rows) -> str:
        """Return from what the positions are known to be degrees; empty where they are not."""
        if self.unit_from:
            return self.unit_from
        body = [joint for joint in self.joints if not joint.is_gripper]
        if not body or not str(self.info.get("robot_type") or "").startswith(_SERVO_ROBOTS):
            return ""
        if all(joint.is_old for joint in body):
            return "its name: before June 2025 LeRobot recorded degrees"
        if max(float(np.max(np.abs(rows.states[:, joint.state]))) for joint in body) > _RANGE + _ROUNDING:
            return "the values: a range would end at 100"
        return ""


def open_dataset(path: Path) -> Dataset:
    """Return the dataset that a path belongs to.

    Parameters
    ----------
    path : Path
        Its folder, its `meta/info.json`, or one of its Parquet files, which is then the only one that counts.

    Raises
    ------
    InputError
        If it is none, or has no joints.
    """
    folder = dataset_of(path)
    if folder is None and (table := open_joint_table(path)) is not None:
        return table
    if folder is None:
        raise no_dataset(path)
    info = read_json(folder / _INFO)
    files = [path] if path.suffix.lower() == ".parquet" else sorted((folder / "data").rglob("*.parquet"))
    return Dataset(folder, info, _joints(folder, info), files)


def _joints(folder: Path, info: object) -> list[Joint]:
    features = info.get("features") if isinstance(info, Mapping) else None
    if not isinstance(features, Mapping) or ACTION not in features or STATE not in features:
        raise InputError(f"{folder / _INFO}: features", allowed=f"among them {ACTION} and {STATE}",
                         got=", ".join(map(str, features)) if isinstance(features, Mapping) else "none")
    action, state = (_names(folder, features[key]) for key in (ACTION, STATE))
    if not action or not state:
        sizes = [_size(features[key]) for key in (ACTION, STATE)]
        if not sizes[0] or sizes[0] != sizes[1]:
            raise InputError(f"{folder / _INFO}: features", got=f"no names, and shapes {sizes[0]} and {sizes[1]}",
                             allowed="names of the joints, or equal shapes")
        action = state = [str(k) for k in range(sizes[0])]
    found = [Joint(name.removesuffix(".pos").removeprefix(_OLD), name, action.index(name), k)
             for k, name in enumerate(state) if name in action and not name.endswith(_NO_POSITIONS)]
    if not found:
        raise InputError(f"{folder / _INFO}: names", got=f"{', '.join(action)}; {', '.join(state)}",
                         allowed=f"joints that {ACTION} and {STATE} have in common")
    return found


def _names(folder: Path, feature: object) -> list[str]:
    names = feature.get("names") if isinstance(feature, Mapping) else None
    if isinstance(names, Mapping):  # {"motors": [...]}
        names = next((value for value in names.values() if isinstance(value, list)), None)
    what = f"{folder / _INFO}: name of a joint"
    return [checked_name(what, str(name), math.inf) for name in names] if isinstance(names, list) else []


def _size(feature: object) -> int:
    shape = feature.get("shape") if isinstance(feature, Mapping) else None
    return int(shape[0]) if isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int) else 0


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of a dataset, in the order of episodes and frames.

    Parameters
    ----------
    actions, states : ndarray, shape (n, joints)
    time : ndarray, shape (n,)
        [s]
    episode : ndarray of int, shape (n,)
    """

    actions: NDArray[np.float64]
    states: NDArray[np.float64]
    time: NDArray[np.float64]
    episode: NDArray[Any]

    def episodes(self) -> list[tuple[int, int, int]]:
        """Return the first row, the one after the last, and the number of each episode."""
        ends = np.flatnonzero(np.diff(self.episode)) + 1
        starts = [0, *ends.tolist()]
        return [(a, b, int(self.episode[a])) for a, b in zip(starts, [*ends.tolist(), self.episode.size], strict=True)]

    def clock(self) -> str:
        """Return what the stamps are, in words: numbers of frames, or read off a clock."""
        steps = np.concatenate([np.diff(self.time[a:b]) for a, b, _ in self.episodes()])
        if not steps.size:
            return "one frame"
        usual = float(np.median(steps))
        regular = bool(np.all(np.abs(steps - usual) < _REGULAR * usual))
        what = "numbers of frames over the rate, not read off a clock" if regular else "read off a clock"
        return f"{1.0 / max(usual, 1e-9):.3g} Hz, stamps are {what}"


def rows_of_files(files: list[Path], action_size: int, state_size: int) -> Rows:
    """Return the rows of Parquet files."""
    parts = [_read(file, action_size, state_size) for file in files]
    order = np.lexsort((np.concatenate([p["timestamp"] for p in parts]),
                        np.concatenate([p["episode_index"] for p in parts])))
    return Rows(*(np.concatenate([p[key] for p in parts])[order]
                  for key in (ACTION, STATE, "timestamp", "episode_index")))


def _read(file: Path, action_size: int, state_size: int) -> dict[str, NDArray[Any]]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise MissingExtraError("pyarrow", "data") from None
    names = (ACTION, STATE, "timestamp", "episode_index")
    try:
        there = pyarrow.parquet.read_schema(file).names
        for name in names:
            if name not in there:
                raise InputError(f"{file}: columns", got=", ".join(there), allowed=f"also {name}")
        table = pyarrow.parquet.read_table(file, columns=list(names))
    except FileNotFoundError:
        raise InputError(f"{file}: no such file") from None
    except (OSError, pyarrow.ArrowException) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise InputError(f"{file}: not readable as Parquet ({reason})") from None
    if not table.num_rows:
        raise InputError(f"{file}", got="no rows", allowed="at least three of each episode")
    made = {}
    for name, size in ((ACTION, action_size), (STATE, state_size), ("timestamp", 1), ("episode_index", 1)):
        column = table[name].combine_chunks()
        nested = pyarrow.types.is_list(column.type) or pyarrow.types.is_fixed_size_list(column.type) or (
            pyarrow.types.is_large_list(column.type))
        flat = column.flatten() if nested else column
        if column.null_count or flat.null_count or len(flat) % table.num_rows or len(flat) // table.num_rows < size:
            raise InputError(f"{file}: {name}", got=f"{len(flat)} values in {table.num_rows} rows",
                             allowed=f"{size} in every row, as meta/info.json says")
        values = flat.to_numpy(zero_copy_only=False).reshape(table.num_rows, -1)
        made[name] = values[:, 0] if size == 1 and name not in (ACTION, STATE) else np.asarray(values, dtype=np.float64)
    made["timestamp"] = np.asarray(made["timestamp"], dtype=np.float64)
    return made


# --- Tables (CSV) of several joints: an action and a state of each, as LeRobot calls goals and positions --------------

# `action.elbow_flex.pos`, `action_elbow_deg`, `elbow.goal` are goals; `observation.state.elbow_flex.pos`,
# `state_elbow_deg`, `elbow.measured` positions. Such a table is read as a dataset of LeRobot is.

_SIDES = {ACTION: ("action", "goal", "command", "target"),
          STATE: ("observation.state", "observation_state", "state", "measured", "position")}
_TIMES = {"time": "s", "time_s": "s", "time_ms": "ms", "t": "s", "timestamp": "s", "timestamp_s": "s",
          "timestamp_ms": "ms"}
_EPISODES = ("episode_index", "episode")
_UNIT = re.compile(r"(?:_|\s*[\[(])(deg|rad)[\])]?$", re.IGNORECASE)
_FEWEST = 2  # joints: a table of one is a log
_HEAD = 1 << 20  # bytes
_BETWEEN = "._/: "


def side_of(column: str) -> tuple[str, str, str] | None:
    """Return whether a column is an action or a state, of which joint, and in which unit ("" where it does not say).

    Examples
    --------
    >>> side_of("action.elbow_flex.pos"), side_of("state_elbow_deg"), side_of("elbow/goal [rad]"), side_of("elbow")
    (('action', 'elbow_flex', ''), ('observation.state', 'elbow', 'deg'), ('action', 'elbow', 'rad'), None)
    """
    text = column.strip()
    found = _UNIT.search(text)
    unit, text = (found[1].lower(), text[:found.start()]) if found else ("", text)
    for side, words in _SIDES.items():
        for word in words:
            for sign in _BETWEEN:
                joint = (text[len(word) + 1:] if text.lower().startswith(word + sign) else
                         text[:-len(word) - 1] if text.lower().endswith(sign + word) else "")
                joint = joint.removesuffix(".pos")
                if joint:
                    return side, joint, unit
    return None


def is_joint_table(path: Path) -> bool:
    """Tell whether a path is of a table that has an action and a state of several joints."""
    return len(_joints_of(_header(path))) >= _FEWEST


def open_joint_table(path: Path) -> Dataset | None:
    """Return a table as a dataset, None where it is no such table.

    Raises
    ------
    InputError
        If some of its joints have a unit and others none.
    """
    found = _joints_of(_header(path))
    if len(found) < _FEWEST:
        return None
    told = [bool(unit) for sides in found.values() for _, unit in sides.values()]
    if any(told) and not all(told):
        raise InputError(f"{path}: columns", got="some with a unit and some without", allowed="a unit in all, or none")
    joints = [Joint(name, name, k, k, in_degrees=all(told)) for k, name in enumerate(found)]
    return Dataset(path, {}, joints, [path], partial(_rows, path, found),
                   "the names of the columns" if all(told) else "")


def no_dataset(path: Path) -> InputError:
    """Return what is wrong with a path that is neither a dataset of LeRobot nor a table of several joints."""
    columns = ", ".join(name for name in _header(path) if name)
    if columns:
        return InputError(f"{path}: columns", got=columns, allowed="a time, and an action and a state of each of "
                          "several joints, such as action.elbow_deg and state.elbow_deg")
    return InputError(f"{path}", got="no dataset of LeRobot", allowed="a folder with meta/info.json, a file of it, or "
                      "a table of several joints (.csv)")


def _header(path: Path) -> list[str]:
    """Return the names in the first line of a table; none where it is no table."""
    if path.suffix.lower() not in (".csv", ".tsv"):
        return []
    try:
        with path.open("rb") as stream:
            line = stream.readline(_HEAD).decode("utf-8", "replace").lstrip("\ufeff").rstrip("\r\n")
        separator = max(",;\t", key=line.count)
        return [name.strip() for name in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except (OSError, ValueError, csv.Error):  # reading says what is wrong with it
        return []


def _joints_of(header: list[str]) -> dict[str, dict[str, tuple[str, str]]]:
    """Return column and unit of action and state, by joint; joints that lack one of them are passed over."""
    found: dict[str, dict[str, tuple[str, str]]] = {}
    for column in header:
        meaning = side_of(column)
        if meaning is not None:
            found.setdefault(meaning[1], {}).setdefault(meaning[0], (column, meaning[2]))
    return {joint: sides for joint, sides in found.items() if len(sides) == len(_SIDES)}


def _rows(path: Path, joints: dict[str, dict[str, tuple[str, str]]]) -> Rows:
    """Return the rows of a table; what has a unit is made degrees."""
    table = read_table(path, lambda name: side_of(name) is not None or name.lower() in _TIMES)
    table.check_lengths()
    named = [name for name in table.header if name.lower() in _TIMES]
    if len(named) != 1:
        raise InputError(f"{path}: column of time", got=", ".join(named) or "none",
                         allowed=f"one of {', '.join(_TIMES)}")
    time = np.asarray(units.to_si(table.numbers(named[0]), _TIMES[named[0].lower()], "time"))
    own = next((name for name in table.header if name.lower() in _EPISODES), None)
    episode = np.zeros(len(time), np.int64) if own is None else table.numbers(own).astype(np.int64)
    sides = [np.column_stack([_degrees(table, *joint[side]) for joint in joints.values()]) for side in _SIDES]
    order = np.argsort(episode, kind="stable")
    return Rows(sides[0][order], sides[1][order], time[order], episode[order])


def _degrees(table: TextTable, column: str, unit: str) -> NDArray[np.float64]:
    values = table.numbers(column)
    return np.degrees(values) if unit == "rad" else values


# --- Datasets of LeRobot as logs: one a joint and episode; `lerobot_data` says what a dataset holds -------------------

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
