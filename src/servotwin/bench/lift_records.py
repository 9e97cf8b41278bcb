"""Records of a servo that lifts weights at full speed, one weight a file: a row of a table of loads from each.

The command was one jump, which no column has. The shaft waits, speeds up with one time constant and turns steadily:
q = q0 + w (t − t0 − T (1 − e^{−(t − t0)/T})) from t0 on, and the current falls with the same time constant to what it
draws steadily. Both are fitted at once, up to where the shaft comes to its goal.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.load_columns import LEAST_ROWS, LoadTable, Reading, arm_beside, load_table
from servotwin.bench.table_columns import fit_line
from servotwin.errors import InputError
from servotwin.logs.column_values import meaning_of
from servotwin.logs.column_words import Wanted, column_said, wanted_columns
from servotwin.tables import TextTable, read_table
from servotwin.units import to_si
from servotwin.units.quantities import number_and_unit

Array = NDArray[np.float64]
PLACE = re.compile(r"\{(mass|weight|load|torque)(?::([^{}]+))?\}")
_LEAST_SAMPLES = 20
_END = 0.9  # of the travel, where a servo that arrives begins to slow down
_ARRIVED = 8  # samples on the last angle: else the record ended before the servo arrived
_LEAST_IDLE = 8  # samples before the shaft turns, in which a jump of the current is looked for
_CLEAR = 6.0  # times the noise before it
_GRAMS = 10.0  # a largest number of at least this, without a unit, is in grams
_ROLES = {"time": "time", "output_angle": "angle", "angle": "angle", "supply_current": "current",
          "armature_current": "current"}


class LiftRecord(NamedTuple):
    """What one record of a lift says (SI).

    Parameters
    ----------
    file : str
    load : float
        As the file's name has it.
    speed, current : float
        Steady; the current is nan where none was logged.
    dead_time : float
        From the first row to the first motion [s].
    rise : float
        Time constant of speeding up [s].
    """

    file: str
    load: float
    speed: float
    current: float
    dead_time: float
    rise: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Lifts:
    """A table made of records, and these.

    Parameters
    ----------
    table : LoadTable
    records : tuple of LiftRecord
    """

    table: LoadTable
    records: tuple[LiftRecord, ...] = field(repr=False)


def is_pattern(path: str | Path) -> bool:
    """Return whether a path names files by the weight in them, such as `lift{mass:g}.txt`."""
    return PLACE.search(Path(path).name) is not None


def lifts(pattern: str | Path, *, columns: str | Mapping[str, str] | None = None, arm: float | None = None) -> Lifts:
    """Return the table that records of lifts make, one weight a file.

    Parameters
    ----------
    pattern : str or Path
        With the weight in the file's name: `lift{mass:g}.txt`, or `{load:N}`, `{torque:N m}`.
    columns : str or mapping, optional
        What the columns are, as of `read_logs`: ``"time=1:ms angle=2:deg current=3:A"``; names in a header are known.
    arm : float, optional
        On which the weights hung, or the radius of the drum [m].

    Raises
    ------
    InputError
        If there are too few files, one cannot be read, or its shaft does not turn.
    """
    path = Path(pattern)
    found = _files(path)
    match = PLACE.search(path.name)
    unit, remarks = (match[2] if match is not None and match[2] else ""), []
    name = match[1] if match is not None else "mass"
    if not unit:
        most = max(load for _, load in found)
        if name == "torque" or most < _GRAMS:
            raise InputError(f"{path}: unit of {{{name}}}", got="none",
                             allowed=f"one in the pattern, such as {path.name.replace('}', ':g}')}")
        unit = "g"
        remarks.append(f"the numbers in the names of files are read as g; another unit: {{{name}:kg}}")
    records = sorted((record_of(file, load, columns) for file, load in found), key=lambda one: one.load)
    data = {f"{name} [{unit}]": [one.load for one in records], "speed [rad/s]": [one.speed for one in records]}
    if all(np.isfinite(one.current) for one in records):
        data["current [A]"] = [one.current for one in records]
    said = arm if arm is not None else arm_beside(path)
    table = load_table(data, arm=said, source=str(path))
    if table.speed is not None:
        table = replace(table, speed=Reading(name="steady speed", values=table.speed.values, step=0.0))
    if table.current is not None:
        table = replace(table, current=Reading(name="steady current", values=table.current.values, step=0.0))
    dead = np.array([one.dead_time for one in records])
    remarks.append(f"the shaft begins to turn {1e3 * float(np.median(dead)):.3g} ms after the first row "
                   f"({1e3 * dead.min():.3g} to {1e3 * dead.max():.3g} ms): dead time, if the command jumped there")
    return Lifts(table=replace(table, remarks=(*table.remarks, *remarks)), records=tuple(records))


def _files(path: Path) -> list[tuple[Path, float]]:
    parts = PLACE.split(path.name)
    if len(parts) != 4:
        raise InputError(str(path), got="two places in braces", allowed="one, such as lift{mass:g}.txt")
    form = re.compile(re.escape(parts[0]) + r"(\d+(?:[.,]\d+)?)" + re.escape(parts[3]))
    found = [(file, float(match[1].replace(",", "."))) for file in sorted(path.parent.glob("*"))
             if (match := form.fullmatch(file.name)) is not None]
    if len(found) < LEAST_ROWS:
        raise InputError(f"{path}: files", got=len(found),
                         allowed=f"at least {LEAST_ROWS}, each with its load in its name")
    return found


def record_of(file: Path, load: float, columns: str | Mapping[str, str] | None) -> LiftRecord:
    """Return what one record says: dead time, steady speed and steady current."""
    table = read_table(file, lambda name: meaning_of(name) is not None)
    said = _said(table, columns)
    time, angle = (_column(table, said, role, dimension) for role, dimension in (("time", "time"), ("angle", "angle")))
    if time is None or angle is None:
        lacks = " and ".join(name for name, values in (("time", time), ("angle", angle)) if values is None)
        raise InputError(f"{file}: columns", got=f"no {lacks} among {', '.join(table.header)}",
                         allowed='--columns "time=1:ms angle=2:deg current=3:A"')
    current = _column(table, said, "current", "current")
    if time.size < _LEAST_SAMPLES or (np.diff(time) < 0.0).any():
        raise InputError(f"{file}: time", got=f"{time.size} rows" if time.size < _LEAST_SAMPLES else "stamps that fall",
                         allowed=f"at least {_LEAST_SAMPLES} rising ones")
    speed, steady, dead, rise = _fitted(str(file), time - time[0], np.sign(angle[-1] - angle[0]) * (angle - angle[0]),
                                        current)
    return LiftRecord(file=str(file), load=load, speed=speed, current=steady, dead_time=dead, rise=rise)


def _said(table: TextTable, columns: str | Mapping[str, str] | None) -> dict[str, Wanted]:
    given = wanted_columns(columns)
    made = {_ROLES[name]: one for name, one in given.items() if name in _ROLES}
    for column in table.header if table.has_header else ():
        meant = meaning_of(column)
        if meant is not None and meant.role in _ROLES:
            made.setdefault(_ROLES[meant.role], Wanted(meant.role, column, meant.unit))
    return made


def _column(table: TextTable, said: Mapping[str, Wanted], role: str, dimension: str) -> Array | None:
    if role not in said:
        return None
    one = said[role]
    if one.signal in _ROLES and one.signal != "angle":
        _, column = column_said(one, one.column)
        return np.asarray(to_si(column.scale * table.numbers(one.column) + column.offset, column.unit, dimension))
    return np.asarray(to_si(table.numbers(one.column), one.unit, dimension))


def _fitted(file: str, time: Array, turned: Array, current: Array | None) -> tuple[float, float, float, float]:
    """Return steady speed and current, dead time and time constant of a motion from rest; `turned` rises from 0."""
    from scipy.optimize import least_squares

    travel = float(turned.max())
    step = float(np.min(np.diff(np.unique(turned)))) if np.unique(turned).size > 1 else 0.0
    if travel < 5.0 * step or step == 0.0:
        raise InputError(f"{file}: angle", got="a shaft that does not turn", allowed="a motion of some counts at least")
    arrived = int((turned > travel - 0.5 * step).sum()) >= _ARRIVED
    end = int(np.argmax(turned >= _END * travel)) if arrived else time.size
    t, q = time[:end], turned[:end]
    half = int(np.argmax(q >= 0.5 * q[-1]))
    pace = 0.5 * float(q[-1]) / max(float(t[-1] - t[half]), 1e-6)
    first = float(t[int(np.argmax(q > 1.5 * step))])
    jump = None if current is None else _jump(t, current[:end], first)

    def angle(x: Array) -> Array:
        s = np.maximum(t - x[1], 0.0)
        return np.asarray((x[0] * (s - x[2] * (1.0 - np.exp(-s / x[2]))) + x[3] - q) / (0.5 * step))

    # counts are rounded down or to the next, which only a known start can tell from a later one
    start = [pace, max(first - 0.02, 0.0) if jump is None else jump, 0.03, 0.0]
    free = [1e-9 if jump is not None else float(t[-1]), 1e-9 if jump is None else step]
    found = least_squares(angle, start, x_scale=[pace, 0.01, 0.01, step], bounds=(
        [0.0, max(start[1] - free[0], 0.0), 1e-4, -free[1]], [np.inf, start[1] + free[0], float(t[-1]), free[1]]))
    speed, begin, rise, _ = found.x.tolist()
    steady = float("nan") if current is None else _steady(t, current[:end], begin, rise)
    return speed, steady, begin, rise


def _jump(t: Array, i: Array, first: float) -> float | None:
    """Return when the current jumps, between two rows, before the shaft has turned; None where it does not clearly."""
    before = int(np.searchsorted(t, first))
    if before < _LEAST_IDLE:
        return None
    idle = i[:max(before // 2, _LEAST_IDLE // 2)]
    level, noise = float(np.median(idle)), float(np.std(idle))
    high = float(i[:before + 1].max())
    if high - level < _CLEAR * max(noise, 1e-6):
        return None
    k = int(np.argmax(i > 0.5 * (high + level)))
    return 0.5 * float(t[max(k - 1, 0)] + t[k])


def _steady(t: Array, i: Array, begin: float, rise: float) -> float:
    """Return the current that is left when what starts the shaft has faded with its time constant."""
    moving = t > begin + 1e-3
    decay = np.exp(-(t[moving] - begin) / rise)
    if moving.sum() < LEAST_ROWS or np.ptp(decay) == 0.0:
        return float(np.median(i))
    return fit_line(decay, i[moving]).intercept


def length_of(text: str | None) -> float | None:
    """Return an arm in metres out of words such as "1cm"; None for None.

    Raises
    ------
    InputError
        If it is no positive length with a unit.
    """
    from servotwin.units.quantities import quantity

    if text is None:
        return None
    if number_and_unit(text) is None:
        raise InputError("--arm", got=text, allowed="a length with its unit, such as 1cm")
    return quantity("--arm", text, "length", positive=True)
