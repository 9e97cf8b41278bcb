"""A table of weights, currents, speeds or sags, as people make them at home: its columns in SI, checked."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin import units
from servotwin.bench.table_columns import fit_line, last_place
from servotwin.errors import InputError
from servotwin.logs.column_words import Wanted, column_said, wanted_columns
from servotwin.logs.columns import COMMAND, COMMAND_ANGLE, PULSE, meaning_of, words_and_unit
from servotwin.logs.columns import TIME as LOG_TIME
from servotwin.logs.sidecar import FOLDER_FILE, sidecar_path
from servotwin.tables import TextTable, read_table
from servotwin.units import is_finite, to_si
from servotwin.units.quantities import bare_unit, number_and_unit, quantity
from servotwin.units.words import unit_word

# --- Columns of a table of weights, currents and speeds: a role, a unit and a factor to SI ----------------------------

LOAD, ARM, CURRENT, SPEED, TIME, SAG, ANGLE, VOLTAGE = (
    "load", "arm", "current", "speed", "time", "sag", "angle", "voltage")
GRAVITY = 9.80665
_WORDS: dict[str, frozenset[str]] = {name: frozenset(words.split()) for name, words in {
    LOAD: "mass masses weight weights load masse gewicht last torque moment drehmoment force kraft",
    ARM: "arm radius drum lever hebel trommel",
    SAG: "sag droop error deviation durchhang abweichung fehler err",
    VOLTAGE: "supply battery bus psu source netzteil vcc volts volt voltage spannung",
}.items()}
_LETTERS = {"g": ("g", "mass"), "n": ("N", "force"), "m": ("m", "length"), "a": ("A", "current"),
            **dict.fromkeys(("oz", "ounce", "ounces"), ("oz", "mass")),
            **dict.fromkeys(("lb", "lbs", "pound", "pounds"), ("lb", "mass")),
            "in": ("in", "length"), "kgf": ("kgf", "force")}
_FORCE = {"N": 1.0, "kgf": GRAVITY}
_OF_LOAD = ("mass", "force", "torque")
_NOT_SUPPLY = frozenset("command cmd target feedback pot poti wiper signal".split())
_TURN = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*_?(?:deg|degrees|°|grad)?", re.IGNORECASE)
_TIME = re.compile(r"(?i)(?<![a-z])(time|zeit|t(?=\d)|s(?=\s*(/|per|pro|_per))|sec|seconds?)")
_MS = re.compile(r"(?i)(?<![a-z])(ms|msec|millis)(?![a-z])")
_LEAST_TURN, _MOST_TURN = 10.0, 360.0  # deg
_LOAD_UNITS = "g, kg, oz, lb, N, kgf cm, N m, N cm"


class Name(NamedTuple):
    """The meaning of a name.

    Parameters
    ----------
    role : str
    unit : str
        As the table has it.
    factor : float
        To SI; of a load that hangs on an arm to newtons, of one that is a torque to N m.
    on_arm : bool
        Whether a load becomes a torque by an arm.
    turn : float
        Of a time: the angle that is turned in it [rad].
    """

    role: str
    unit: str
    factor: float
    on_arm: bool = False
    turn: float = math.nan


def name_of(column: str, below: str = "") -> Name | None:
    """Return what a column's name says; None where it says nothing that a table of loads has.

    Raises
    ------
    InputError
        If it names a load without a unit, or in one that measures no load.

    Examples
    --------
    >>> name_of("mass_g").factor, name_of("load [kgf cm]").on_arm, name_of("time_60deg_s").role, name_of("note")
    (0.00980665, False, 'time', None)
    """
    if (time := _time(column, below)) is not None:
        return time
    words, said = words_and_unit(column, below)
    unit, dimension = unit_word(said) or next(
        (_LETTERS[word] for word in sorted({*words, bare_unit(said)}) if word in _LETTERS), (said, ""))
    if dimension in _OF_LOAD:
        return _load(column, unit, dimension)
    if dimension == "length":
        return Name(ARM, unit, units.factor(unit, dimension)) if words & _WORDS[ARM] else None
    if dimension in (CURRENT, SPEED):
        return Name(dimension, unit, units.factor(unit, dimension))
    if dimension == "voltage":
        meant = not words - {"v"} or (words & _WORDS[VOLTAGE] and not words & _NOT_SUPPLY)
        return Name(VOLTAGE, unit, units.factor(unit, dimension)) if meant else None
    if dimension == "angle":
        found = meaning_of(column, below)
        role = SAG if words & _WORDS[SAG] else ANGLE if found is not None and found.role == "angle" else None
        return None if role is None else Name(role, unit, units.factor(unit, dimension))
    if words and words <= _WORDS[LOAD] | {said.casefold()} and words & _WORDS[LOAD]:
        raise InputError(f"column {column}", got=f"the unit {said}" if said else "no unit",
                         allowed=f"one of {_LOAD_UNITS} in its name, such as mass_g or load [N]")
    return None


def _load(column: str, unit: str, dimension: str) -> Name:
    if dimension == "torque":
        return Name(LOAD, unit, units.factor(unit, dimension))
    factor = _FORCE[unit] if dimension == "force" else units.factor(unit, dimension) * GRAVITY
    return Name(LOAD, unit, factor, on_arm=True)


def _time(column: str, below: str) -> Name | None:
    """Return the time of a turn, such as `time_60deg_s`, `s/60°` or `t60`; None where it is none."""
    turns = [turn for turn in map(float, _TURN.findall(column)) if _LEAST_TURN <= turn <= _MOST_TURN]
    if _TIME.search(column) is None or not turns:
        return None
    angle = turns[0] * math.pi / 180.0
    unit = "ms" if _MS.search(column) or _MS.search(below) else "s"
    return Name(TIME, unit, units.factor(unit, "time"), turn=angle)


# --- A table of weights, currents, speeds or sags, as people make them at home ----------------------------------------

LEAST_ROWS = 3
_MEASURED = (CURRENT, SPEED, LOG_TIME, SAG, ANGLE)
_ARM_IN_NAME = re.compile(r"(?<![a-z])(?:arm|drum|radius|lever)[_=\- ]?(\d+(?:[.,]\d+)?)[ _]?(mm|cm|m|in)(?![a-z])",
                          re.IGNORECASE)


class _Range(NamedTuple):
    lower: float
    upper: float  # in SI: beyond it the unit of the column cannot be right


_RANGES = {LOAD: _Range(0.0, 2000.0), ARM: _Range(1e-4, 2.0), CURRENT: _Range(0.0, 60.0),
           SPEED: _Range(0.0, 150.0), LOG_TIME: _Range(1e-3, 600.0), SAG: _Range(-math.pi, math.pi),
           ANGLE: _Range(-60.0, 60.0), VOLTAGE: _Range(0.1, 60.0)}
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
            roles.add(LOAD)  # without a unit: whoever reads it says so
            continue
        meant = meaning_of(column) if found is None else None
        if meant is not None and meant.role in (LOG_TIME, PULSE, COMMAND, COMMAND_ANGLE):
            return False
        if found is not None:
            roles.add(found.role)
    return LOAD in roles or (VOLTAGE in roles and bool({SPEED, LOG_TIME} & roles))


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
    if LOAD not in found:
        return {}
    meant, column, values = found[LOAD]
    if np.ptp(values) == 0.0:
        raise InputError(f"{where}: {column}", got="the same in all rows", allowed="loads that differ")
    load = _reading(found[LOAD])
    made: dict[str, Any] = {}
    if meant.on_arm:
        lengths = _arm_of(where, table, found.get(ARM), arm, column)
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
    if not _RANGES[ARM].lower <= said <= _RANGES[ARM].upper:
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
    made: dict[str, Any] = {role: _reading(found[role]) for role in (CURRENT, VOLTAGE) if role in found}
    remarks = []
    if SPEED in found and LOG_TIME in found:
        raise InputError(f"{where}: speed", got=f"{found[SPEED][1]} and {found[LOG_TIME][1]}", allowed="one")
    if SPEED in found:
        made["speed"] = _reading(found[SPEED])
    elif LOG_TIME in found:
        meant, column, values = found[LOG_TIME]
        made["speed"] = Reading(name=column, values=meant.turn / values, step=_reading(found[LOG_TIME]).step,
                                turn=meant.turn)
    if SAG in found:
        made["sag"] = _reading(found[SAG])
    elif ANGLE in found and LOAD in found:
        angle, load = _reading(found[ANGLE]), found[LOAD][2]
        first, last = angle.values[int(np.argmin(load))], angle.values[int(np.argmax(load))]
        sign = 1.0 if last <= first else -1.0
        made |= {"sag": Reading(name=angle.name, values=sign * (first - angle.values), step=angle.step),
                 "relative": True}
        remarks.append(f"{angle.name} is counted from the lightest load on: how far the shaft stood off its goal there "
                       "is not known")
    if LOAD in found and not {"current", "speed", "sag"} & set(made):
        has = "has" if len(ignored) == 1 else "have"
        unknown = f"; {', '.join(ignored)} {has} no unit that says so" if ignored else ""
        raise InputError(f"{where}: columns", got=", ".join(one[1] for one in found.values()) + unknown,
                         allowed="beside the load a current (current_mA), a speed (speed_deg_s), a time "
                         "(time_60deg_s) or a sag (sag_deg)")
    if LOAD not in found and not ("voltage" in made and "speed" in made):
        raise InputError(f"{where}: columns", got=", ".join(one[1] for one in found.values()) or "none",
                         allowed="a load, such as mass_g, or a supply voltage and a speed")
    return {**made, "remarks": tuple(remarks)}


# --- Records of a servo that lifts weights at full speed, one weight a file -------------------------------------------

# The command was one jump, which no column has. The shaft waits, speeds up with one time constant and turns steadily:
# q = q0 + w (t − t0 − T (1 − e^{−(t − t0)/T})) from t0 on, and the current falls with the same time constant to what it
# draws steadily. Both are fitted at once, up to where the shaft comes to its goal.

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
    """One record of a lift (SI).

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
        Meaning of columns, as of `read_logs`: ``"time=1:ms angle=2:deg current=3:A"``; names in a header are known.
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
    if text is None:
        return None
    if number_and_unit(text) is None:
        raise InputError("--arm", got=text, allowed="a length with its unit, such as 1cm")
    return quantity("--arm", text, "length", positive=True)
