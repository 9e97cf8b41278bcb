"""A table of weights, currents, speeds or sags, as people make them at home: its columns in SI, checked."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.bench import load_names as names
from servotwin.bench.load_names import Name, name_of
from servotwin.bench.table_columns import last_place
from servotwin.errors import InputError
from servotwin.logs.column_values import COMMAND, COMMAND_ANGLE, PULSE, TIME, meaning_of
from servotwin.logs.sidecar import FOLDER_FILE, sidecar_path
from servotwin.tables import read_table
from servotwin.units import is_finite
from servotwin.units.quantities import quantity

LEAST_ROWS = 3
_MEASURED = (names.CURRENT, names.SPEED, names.TIME, names.SAG, names.ANGLE)
_ARM_IN_NAME = re.compile(r"(?<![a-z])(?:arm|drum|radius|lever)[_=\- ]?(\d+(?:[.,]\d+)?)[ _]?(mm|cm|m|in)(?![a-z])",
                          re.IGNORECASE)


class _Range(NamedTuple):
    lower: float
    upper: float  # in SI: beyond it the unit of the column cannot be right


_RANGES = {names.LOAD: _Range(0.0, 2000.0), names.ARM: _Range(1e-4, 2.0), names.CURRENT: _Range(0.0, 60.0),
           names.SPEED: _Range(0.0, 150.0), names.TIME: _Range(1e-3, 600.0), names.SAG: _Range(-math.pi, math.pi),
           names.ANGLE: _Range(-60.0, 60.0), names.VOLTAGE: _Range(0.1, 60.0)}
_MOST_TORQUE = 100.0  # N m


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A column in SI.

    Parameters
    ----------
    name : str
        In the table.
    values : ndarray, shape (n,)
    step : float
        The last place that it was written with.
    turn : float
        Where a speed was written as a time: the angle of that time [rad]; else nan.
    """

    name: str
    values: NDArray[np.float64] = field(repr=False)
    step: float
    turn: float = math.nan

    @property
    def timed(self) -> bool:
        """Whether it is a speed that was written as a time, so that the error grows with its square."""
        return not math.isnan(self.turn)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadTable:
    """The columns of a table of loads, in SI; what it lacks is None.

    Parameters
    ----------
    source : str
    torque : Reading, optional
        Of the load at the shaft [N m].
    current : Reading, optional
        [A].
    speed : Reading, optional
        [rad/s].
    sag : Reading, optional
        How far the shaft stands off its goal [rad].
    voltage : Reading, optional
        Of the supply [V].
    arm : float, optional
        On which weights hung [m].
    relative : bool
        Whether the sag is counted from that of the lightest load on.
    ignored : tuple of str
    remarks : tuple of str
    """

    source: str
    torque: Reading | None = None
    current: Reading | None = None
    speed: Reading | None = None
    sag: Reading | None = None
    voltage: Reading | None = None
    arm: float | None = None
    relative: bool = False
    ignored: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[Reading, ...]:
        """Those that there are."""
        return tuple(one for one in (self.torque, self.voltage, self.current, self.speed, self.sag) if one is not None)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return int(self.columns[0].values.size)


def is_load_table(path: str | Path) -> bool:
    """Return whether a file's header is that of a table of loads, or of voltage and speed; with stamps it is a log."""
    table = read_table(path, _known)
    roles = set()
    for k, column in enumerate(table.header):
        try:
            found = name_of(column, table.units[k] if k < len(table.units) else "")
        except InputError:
            roles.add(names.LOAD)  # without a unit: whoever reads it says so
            continue
        meant = meaning_of(column) if found is None else None
        if meant is not None and meant.role in (TIME, PULSE, COMMAND, COMMAND_ANGLE):
            return False
        if found is not None:
            roles.add(found.role)
    return names.LOAD in roles or (names.VOLTAGE in roles and bool({names.SPEED, names.TIME} & roles))


def load_table(table: str | Path | Mapping[str, ArrayLike], *, arm: float | None = None,
               source: str | None = None) -> LoadTable:
    """Return the columns of a table of loads.

    Parameters
    ----------
    table : str, Path or mapping
        A CSV file with a header, or columns of equal length by name. Names have units: `mass_g`, `load [N]`,
        `torque_kgf_cm`, `current_mA`, `speed_deg_s`, `time_60deg_s`, `sag_deg`, `supply_voltage_V`, `arm_cm`.
    arm : float, optional
        On which the weights hung [m]; else a column, the file's name (`lift_arm2cm.csv`) or `"arm": "2cm"` in the JSON
        beside it says it.
    source : str, optional

    Raises
    ------
    InputError
        If the file cannot be read, a column is not usable, or nobody says the arm.

    Examples
    --------
    >>> table = load_table({"mass_g": [100, 200, 320], "current_mA": [230, 300, 370]}, arm=0.01)
    >>> [round(value, 5) for value in table.torque.values.tolist()]
    [0.00981, 0.01961, 0.03138]
    """
    where = "table" if isinstance(table, Mapping) else str(table)
    found: dict[str, tuple[Name, str, NDArray[np.float64]]] = {}
    ignored = []
    for column, below, values in _columns(table):
        try:
            meant = name_of(column, below)
        except InputError as error:
            raise InputError(f"{where}: {error.what}", error.got, error.allowed) from None
        if meant is None:
            ignored.append(column)
            continue
        if isinstance(values, InputError):
            raise values
        if meant.role in found:
            raise InputError(f"{where}: columns of {meant.role}", got=f"{found[meant.role][1]} and {column}",
                             allowed="one")
        found[meant.role] = meant, column, _checked(where, meant, column, values)
    made = _torque(where, table, found, arm)
    return LoadTable(source=source or ("a table without a name" if isinstance(table, Mapping) else where),
                     ignored=tuple(ignored), **made, **_measured(where, found, ignored))


def _known(column: str) -> bool:
    try:
        return name_of(column) is not None
    except InputError:
        return True


def _columns(table: str | Path | Mapping[str, ArrayLike]
             ) -> list[tuple[str, str, NDArray[np.float64] | InputError]]:
    if isinstance(table, Mapping):
        given = {name: np.asarray(values, dtype=np.float64) for name, values in table.items()}
        if len({values.shape for values in given.values()}) > 1:
            raise InputError("table: lengths of the columns", got=[values.size for values in given.values()],
                             allowed="all equal")
        return [(name, "", values) for name, values in given.items()]
    read = read_table(table, _known)
    read.check_lengths(shorter=True)
    columns: list[tuple[str, str, NDArray[np.float64] | InputError]] = []
    for k, name in enumerate(read.header):
        try:
            values: NDArray[np.float64] | InputError = read.numbers(name)
        except InputError as error:
            values = error
        if not isinstance(values, InputError) and (bad := np.flatnonzero(~np.isfinite(values))).size:
            values = InputError(f"{table}: line {read.rows[bad[0]].line}, {name}", got=float(values[bad[0]]),
                                allowed="a finite number")
        columns.append((name, read.units[k] if k < len(read.units) else "", values))
    return columns


def _checked(where: str, meant: Name, column: str, given: NDArray[np.float64]) -> NDArray[np.float64]:
    if given.size < LEAST_ROWS:
        raise InputError(f"{where}: rows", got=int(given.size), allowed=f"at least {LEAST_ROWS}")
    values, allowed = meant.factor * given, _RANGES[meant.role]
    outside = ~((values >= allowed.lower) & (values <= allowed.upper))
    if outside.any():
        row = int(np.argmax(outside))
        raise InputError(f"{where}: {column}, row {row + 1}", got=float(given[row]),
                         allowed=f"{allowed.lower / meant.factor:.3g} to {allowed.upper / meant.factor:.3g}; is the "
                         "unit right?")
    return values


def _reading(found: tuple[Name, str, NDArray[np.float64]]) -> Reading:
    meant, column, values = found
    return Reading(name=column, values=values, step=meant.factor * last_place(values / meant.factor))


def _torque(where: str, table: object, found: dict[str, tuple[Name, str, NDArray[np.float64]]],
            arm: float | None) -> dict[str, Any]:
    """Return the torque of the load and the arm, as fields of a table."""
    if names.LOAD not in found:
        return {}
    meant, column, values = found[names.LOAD]
    if np.ptp(values) == 0.0:
        raise InputError(f"{where}: {column}", got="the same in all rows", allowed="loads that differ")
    load = _reading(found[names.LOAD])
    made: dict[str, Any] = {}
    if meant.on_arm:
        lengths = _arm_of(where, table, found.get(names.ARM), arm, column)
        values = values * lengths
        load = Reading(name=column, values=values, step=load.step * float(np.max(lengths)))
        made["arm"] = float(np.mean(lengths))
    elif arm is not None:
        raise InputError("--arm", got=f"{arm:g} m", allowed=f"none, for {column} is a torque")
    if float(values.max()) > _MOST_TORQUE:
        raise InputError(f"{where}: {column}", got=f"a torque of {float(values.max()):.3g} N m",
                         allowed=f"up to {_MOST_TORQUE:g} N m; are the units of load and arm right?")
    return {**made, "torque": load}


def _arm_of(where: str, table: object, column: tuple[Name, str, NDArray[np.float64]] | None, arm: float | None,
            load: str) -> NDArray[np.float64]:
    if column is not None:
        if arm is not None:
            raise InputError("--arm", got=f"also a column {column[1]}", allowed="one of them")
        return column[2]
    said = arm if arm is not None else None if isinstance(table, Mapping) else arm_beside(Path(str(table)))
    if said is None:
        raise InputError(f"{where}: arm or drum on which {load} hangs", allowed="its length or radius: --arm 1cm, or a "
                         "column arm_cm")
    if not _RANGES[names.ARM].lower <= said <= _RANGES[names.ARM].upper:
        raise InputError("--arm", got=f"{said:g} m", allowed="0.1 mm to 2 m")
    return np.array([said])


def arm_beside(path: Path) -> float | None:
    """Return the arm [m] that a file's name or the JSON beside it says; None where neither does.

    Examples
    --------
    >>> arm_beside(Path("lift_arm2.5cm.csv"))
    0.025
    """
    if (match := _ARM_IN_NAME.search(path.stem)) is not None:
        return quantity(f"{path}: arm", f"{match[1].replace(',', '.')} {match[2]}", "length", positive=True)
    return _said_in(sidecar_path(path), path) or _said_in(path.parent / FOLDER_FILE, path)


def _said_in(beside: Path, path: Path) -> float | None:
    """Return the arm of a sidecar: `"arm": "2cm"`, or the radius [m] of a load's drum, of all files or of these."""
    if beside == path or not beside.is_file():
        return None
    try:
        said = json.loads(beside.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise InputError(str(beside), got="no JSON", allowed='an object such as {"arm": "2cm"}') from None
    if not isinstance(said, dict):
        return None
    if "arm" in said:
        return quantity(f"{beside}: arm", str(said["arm"]), "length", positive=True)
    files = said.get("files")
    name = re.sub(r":[^{}]*\}", "}", path.name)  # {mass:g} is {mass} there
    for content in (said, files.get(name) if isinstance(files, dict) else None):
        load = content.get("load") if isinstance(content, dict) else None
        drum = load.get("drum") if isinstance(load, dict) else None
        if isinstance(drum, dict) and is_finite(drum.get("radius")):
            return float(drum["radius"])
    return None


def _measured(where: str, found: dict[str, tuple[Name, str, NDArray[np.float64]]],
              ignored: Sequence[str]) -> dict[str, Any]:
    """Return current, speed, sag and voltage, as fields of a table."""
    made: dict[str, Any] = {role: _reading(found[role]) for role in (names.CURRENT, names.VOLTAGE) if role in found}
    remarks = []
    if names.SPEED in found and names.TIME in found:
        raise InputError(f"{where}: speed", got=f"{found[names.SPEED][1]} and {found[names.TIME][1]}", allowed="one")
    if names.SPEED in found:
        made["speed"] = _reading(found[names.SPEED])
    elif names.TIME in found:
        meant, column, values = found[names.TIME]
        made["speed"] = Reading(name=column, values=meant.turn / values, step=_reading(found[names.TIME]).step,
                                turn=meant.turn)
    if names.SAG in found:
        made["sag"] = _reading(found[names.SAG])
    elif names.ANGLE in found and names.LOAD in found:
        angle, load = _reading(found[names.ANGLE]), found[names.LOAD][2]
        first, last = angle.values[int(np.argmin(load))], angle.values[int(np.argmax(load))]
        sign = 1.0 if last <= first else -1.0
        made |= {"sag": Reading(name=angle.name, values=sign * (first - angle.values), step=angle.step),
                 "relative": True}
        remarks.append(f"{angle.name} is counted from the lightest load on: how far the shaft stood off its goal there "
                       "is not known")
    if names.LOAD in found and not {"current", "speed", "sag"} & set(made):
        has = "has" if len(ignored) == 1 else "have"
        unknown = f"; {', '.join(ignored)} {has} no unit that says so" if ignored else ""
        raise InputError(f"{where}: columns", got=", ".join(one[1] for one in found.values()) + unknown,
                         allowed="beside the load a current (current_mA), a speed (speed_deg_s), a time "
                         "(time_60deg_s) or a sag (sag_deg)")
    if names.LOAD not in found and not ("voltage" in made and "speed" in made):
        raise InputError(f"{where}: columns", got=", ".join(one[1] for one in found.values()) or "none",
                         allowed="a load, such as mass_g, or a supply voltage and a speed")
    return {**made, "remarks": tuple(remarks)}
