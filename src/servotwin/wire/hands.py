"""A hand that moves limp servos, by a file of angles over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from servotwin.errors import InputError
from servotwin.tables.text import read_text
from servotwin.wire.bus import Bus


def hand_of(path: str | Path, bus: Bus, names: Mapping[int, str]) -> Callable[[Bus], None]:
    """Return what moves the servos of a bus as a file says: columns time_s, and degrees by joint or ID.

    Between rows angles are straight lines; at the end it begins anew. A servo whose torque is on does not feel it.

    Raises
    ------
    InputError
        If the file has no times, or columns of joints that there are not.
    """
    rows = _table(Path(path))
    time, ids = rows.pop("time_s"), {name: id for id, name in names.items() if name}
    of: dict[int, np.ndarray] = {}
    for column, values in rows.items():
        word = column.removesuffix("_deg")
        id = ids.get(word, int(word) if word.isdecimal() else None)
        if not column.endswith("_deg") or id not in bus.ids:
            raise InputError(f"{path}: column", got=column, allowed=", ".join(
                f"{names.get(one) or one}_deg" for one in bus.ids))
        of[id] = np.radians(values)
    span = float(time[-1] - time[0])

    def move(moved: Bus) -> None:
        now = float(time[0]) + (math.fmod(moved.time, span) if span > 0.0 else 0.0)
        for id, angles in of.items():
            moved.hand(id, float(np.interp(now, time, angles)))

    return move


def _table(path: Path) -> dict[str, np.ndarray]:
    text = read_text(path)
    lines = [line.strip() for line in (*text.lines, text.rest) if line.strip() and line[:1] != "#"]
    head = [word.strip() for word in lines[0].split(",")] if lines else []
    if "time_s" not in head or len(head) < 2 or len(set(head)) < len(head):
        raise InputError(f"{path}", got=", ".join(head) or "nothing",
                         allowed="columns time_s and angles, each once, such as time_s,shoulder_pan_deg")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            row = [float(word) for word in line.split(",")]
        except ValueError:
            row = []
        if len(row) != len(head) or not all(map(math.isfinite, row)):
            raise InputError(f"{path}, row {number}", got=line, allowed=f"{len(head)} numbers")
        rows.append(row)
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(head)).T
    found = dict(zip(head, columns, strict=True))
    if not rows or np.any(np.diff(found["time_s"]) < 0.0):
        raise InputError(f"{path}", got="no rows" if not rows else "times that go back",
                         allowed="rows in order of time")
    return found
