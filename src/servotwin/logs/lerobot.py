"""Datasets of LeRobot as logs: one a joint and episode.

A dataset is a folder with `meta/info.json` and Parquet files below `data` (versions 2.0, 2.1 and 3.0 of the format,
https://github.com/huggingface/lerobot). `action` holds the goals of all joints, `observation.state` their positions.

The format does not say what their unit is. Robots with Feetech or Dynamixel servos recorded degrees before the
hardware interface of June 2025 (joints are named `main_...` there), then -100 to 100 of each joint's calibrated range
or, with `use_degrees`, degrees; degrees are the default since February 2026 (issue 1259 and pull request 2968 of
huggingface/lerobot). Values of that range are cut off at 100, so positions beyond it are degrees. The gripper has 0 to
100 in all of these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError, UnitError, UnknownNameError
from servotwin.logs.columns import Column
from servotwin.logs.csv_logs import in_file
from servotwin.logs.json_file import read_json
from servotwin.logs.log import Log
from servotwin.logs.reading import ReadColumn, Reading
from servotwin.units.words import scaled_unit, unit_shown, units_written

ACTION, STATE = "action", "observation.state"
ALL = "*"
_INFO = Path("meta") / "info.json"
_RANGE = 100.0  # of normalised positions
_ROUNDING = 1e-3  # of float32 at its end
_SERVO_ROBOTS = ("so100", "so101", "so_", "koch", "lekiwi", "moss", "bi_so")  # beginnings of `robot_type`
_NO_POSITIONS = (".vel", ".torque", ".effort", ".current")
_OPTION = "--joint"


@dataclass(frozen=True)
class _Joint:
    """A joint: its name, and its places in `action` and `observation.state`."""

    name: str
    column: str
    action: int
    state: int

    @property
    def is_gripper(self) -> bool:
        return "gripper" in self.name.lower()


def _dataset_of(path: Path) -> Path | None:
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


def recognises(path: Path) -> bool:
    """Return whether a path belongs to a dataset."""
    return _dataset_of(path) is not None


def logs_of(path: Path, *, joints: str | Mapping[str, str] | None) -> list[Log]:
    """Return the logs of a dataset, as `read_lerobot_logs` does."""
    return read_lerobot_logs(path, joints=joints)


def read_lerobot_logs(path: str | Path, *, joints: str | Mapping[str, str] | None = None) -> list[Log]:
    """Return the joints of a LeRobot dataset as logs, one a joint and episode.

    Parameters
    ----------
    path : str or Path
        The dataset's folder, or one of its Parquet files.
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
    path = Path(path)
    folder = _dataset_of(path)
    if folder is None:
        raise InputError(f"{path}", got="no dataset of LeRobot", allowed=f"a folder with {_INFO}, or a file of it")
    info = read_json(folder / _INFO)
    known = _joints(folder, info)
    asked = _asked(joints)
    chosen = _chosen(folder, known, asked)
    files = [path] if path.suffix.lower() == ".parquet" else sorted((folder / "data").rglob("*.parquet"))
    if not files:
        raise InputError(f"{folder}", got="no data/**/*.parquet", allowed="a dataset with its data, not only meta")
    data = _Data(files, max(joint.action for joint in known) + 1, max(joint.state for joint in known) + 1)
    degrees = _degrees(info, data, [joint for joint in known if not joint.is_gripper])
    columns = _columns(folder, chosen, asked, data, degrees)
    left = [joint.name for joint in known if joint not in chosen and joint.is_gripper and joints is None]
    remarks = tuple(f"{name} was left out: it has 0 to 100 of its range; {_OPTION} {name}:0.9deg reads it, with what "
                    "one of these is" for name in left)
    return [log for start, stop, episode in data.episodes()
            for joint in chosen for log in [_log(folder, data, joint, columns[joint.name], (start, stop), episode,
                                                 remarks)]]


def _joints(folder: Path, info: object) -> list[_Joint]:
    features = info.get("features") if isinstance(info, Mapping) else None
    if not isinstance(features, Mapping) or ACTION not in features or STATE not in features:
        raise InputError(f"{folder / _INFO}: features", allowed=f"among them {ACTION} and {STATE}",
                         got=", ".join(map(str, features)) if isinstance(features, Mapping) else "none")
    action, state = (_names(features[key]) for key in (ACTION, STATE))
    if not action or not state:
        sizes = [_size(features[key]) for key in (ACTION, STATE)]
        if not sizes[0] or sizes[0] != sizes[1]:
            raise InputError(f"{folder / _INFO}: features", got=f"no names, and shapes {sizes[0]} and {sizes[1]}",
                             allowed="names of the joints, or equal shapes")
        action = state = [str(k) for k in range(sizes[0])]
    found = [_Joint(name.removesuffix(".pos").removeprefix("main_"), name, action.index(name), k)
             for k, name in enumerate(state) if name in action and not name.endswith(_NO_POSITIONS)]
    if not found:
        raise InputError(f"{folder / _INFO}: names", got=f"{', '.join(action)}; {', '.join(state)}",
                         allowed=f"joints that {ACTION} and {STATE} have in common")
    return found


def _names(feature: object) -> list[str]:
    names = feature.get("names") if isinstance(feature, Mapping) else None
    if isinstance(names, Mapping):  # {"motors": [...]}
        names = next((value for value in names.values() if isinstance(value, list)), None)
    return [str(name) for name in names] if isinstance(names, list) else []


def _size(feature: object) -> int:
    shape = feature.get("shape") if isinstance(feature, Mapping) else None
    return int(shape[0]) if isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int) else 0


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


def _chosen(folder: Path, known: list[_Joint], asked: Mapping[str, str]) -> list[_Joint]:
    for name in asked:
        if name != ALL and not any(name in (joint.name, joint.column) for joint in known):
            raise UnknownNameError(f"joint of {folder}", name, [joint.name for joint in known])
    named = [joint for joint in known if {joint.name, joint.column} & set(asked)]
    rest = [joint for joint in known if joint not in named and not joint.is_gripper]
    return [joint for joint in known if joint in named or ((ALL in asked or not asked) and joint in rest)]


def _columns(folder: Path, chosen: list[_Joint], asked: Mapping[str, str], data: _Data, degrees: str,
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


def _degrees(info: Mapping[str, Any], data: _Data, body: list[_Joint]) -> str:
    """Return from what the positions are known to be degrees; empty where they are not."""
    if not body or not str(info.get("robot_type") or "").startswith(_SERVO_ROBOTS):
        return ""
    if all(joint.column.startswith("main_") for joint in body):
        return "its name: before June 2025 LeRobot recorded degrees"
    if max(float(np.max(np.abs(data.states[:, joint.state]))) for joint in body) > _RANGE + _ROUNDING:
        return "the values: a range would end at 100"
    return ""


class _Data:
    """The rows of the Parquet files, in the order of episodes and frames."""

    def __init__(self, files: list[Path], action_size: int, state_size: int) -> None:
        parts = [_read(file, action_size, state_size) for file in files]
        order = np.lexsort((np.concatenate([p["timestamp"] for p in parts]),
                            np.concatenate([p["episode_index"] for p in parts])))
        self.actions, self.states, self.time, self.episode = (
            np.concatenate([p[key] for p in parts])[order] for key in (ACTION, STATE, "timestamp", "episode_index"))

    def episodes(self) -> list[tuple[int, int, int]]:
        """Return the first row, the one after the last, and the number of each episode."""
        ends = np.flatnonzero(np.diff(self.episode)) + 1
        starts = [0, *ends.tolist()]
        return [(a, b, int(self.episode[a])) for a, b in zip(starts, [*ends.tolist(), self.episode.size], strict=True)]


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


def _log(folder: Path, data: _Data, joint: _Joint, said: tuple[Column, str], rows: tuple[int, int], episode: int,
         remarks: tuple[str, ...]) -> Log:
    column, known = said
    a, b = rows
    name = f"{joint.name} {episode:06d}"
    unit = unit_shown(column.unit, column.scale, column.offset)
    reading = Reading(file=str(folder), remarks=remarks, columns=(
        ReadColumn(f"{ACTION} {joint.column}", "command_angle", unit, known),
        ReadColumn(f"{STATE} {joint.column}", "output_angle", unit, known)))
    with in_file(folder, name):
        return Log(name=name, source=str(folder), time=data.time[a:b], command_kind="angle",
                   command=column.to_si(data.actions[a:b, joint.action], "command_angle"),
                   measured={"output_angle": column.to_si(data.states[a:b, joint.state], "output_angle")},
                   conditions={"joint": joint.name, "episode": float(episode)}, reading=reading)
