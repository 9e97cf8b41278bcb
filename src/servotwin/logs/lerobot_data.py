"""What a dataset of LeRobot holds: its joints, and the goals and positions of every episode.

A dataset is a folder with `meta/info.json` and Parquet files below `data` (versions 2.0, 2.1 and 3.0 of the format,
https://github.com/huggingface/lerobot). `action` holds the goals of all joints, `observation.state` their positions.

The format does not say what their unit is. Robots with Feetech or Dynamixel servos recorded degrees before the
hardware interface of June 2025 (joints are named `main_...` there), then -100 to 100 of each joint's calibrated range
or, with `use_degrees`, degrees; degrees are the default since February 2026 (issue 1259 and pull request 2968 of
huggingface/lerobot). Values of that range are cut off at 100, so positions beyond it are degrees. The gripper has 0 to
100 in all of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError
from servotwin.logs.sidecar import read_json
from servotwin.text import checked_name

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
    from servotwin.logs.joint_tables import no_dataset, open_joint_table

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
