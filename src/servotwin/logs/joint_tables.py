"""Tables (CSV) of several joints: an action and a state of each, as LeRobot calls goals and positions.

`action.elbow_flex.pos`, `action_elbow_deg`, `elbow.goal` are goals; `observation.state.elbow_flex.pos`,
`state_elbow_deg`, `elbow.measured` positions. Such a table is read as a dataset of LeRobot is.
"""

from __future__ import annotations

import csv
import re
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError
from servotwin.logs.lerobot_data import ACTION, STATE, Dataset, Joint, Rows
from servotwin.tables import TextTable, read_table

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
