"""The JSON beside a CSV log: what the numbers alone do not say."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin import units
from servotwin.errors import InputError, LoadError, UnknownNameError
from servotwin.loads import Flexible, Load, Pendulum, Recorded, Spring
from servotwin.loads.load import STANDARD_GRAVITY
from servotwin.logs.columns import COMMANDS, NAMES, SWITCH, TIME, Column, check_unit, si_unit_of
from servotwin.parameters import write_file
from servotwin.tables.reading import read_bytes
from servotwin.units import is_finite
from servotwin.units.words import unit_word

if TYPE_CHECKING:
    from servotwin.logs.log import Log

# --- A load in words and numbers, as a sidecar holds it, under the names that a load's fields have everywhere ---------

_PARTS: dict[str, tuple[str, Any]] = {"pendulum": ("pendulums", Pendulum), "spring": ("springs", Spring),
                                      "recorded": ("recorded", Recorded), "flexible": ("flexibles", Flexible)}
_NUMBERS = ("inertia", "viscous_friction", "torque", "coulomb_torque")


@dataclass(frozen=True)
class Drum:
    """A weight that the shaft winds up.

    Parameters
    ----------
    mass, radius : float
        [kg], [m]
    inertia : float
        Of the drum [kg m²].
    """

    mass: float
    radius: float
    inertia: float = 0.0


def load_from_words(content: object) -> Load:
    """Return the load that a mapping describes, in SI.

    Parameters
    ----------
    content : mapping
        `inertia`, `viscous_friction`, `torque`, `coulomb_torque` and the parts `pendulum`, `spring`, `recorded`,
        `flexible`; each part a mapping of its fields, or a list of such; and `drum`, a weight that the shaft winds up.

    Raises
    ------
    LoadError, UnknownNameError
        If it is none, has an unknown name, or a part lacks a number.

    Examples
    --------
    >>> load_from_words({"inertia": 1e-3, "pendulum": {"mass": 0.5, "length": 0.1}}).pendulum.mass
    0.5
    """
    if not isinstance(content, Mapping):
        raise LoadError("load", got=content, allowed='a mapping, such as {"inertia": 0.001}')
    given: dict[str, Any] = {}
    drum = Load()
    for name, value in content.items():
        if name in _NUMBERS:
            given[name] = value
        elif name == "drum":
            drum = _drum(value)
        elif name in _PARTS:
            key, kind = _PARTS[name]
            given[key] = tuple(_part(f"load.{name}", kind, each) for each in
                               (value if isinstance(value, list) else [value]))
        else:
            raise UnknownNameError("name in a load", name, (*_NUMBERS, *_PARTS, "drum"))
    return Load(**given) + drum


def _drum(content: object) -> Load:
    """Return the load of a weight on a drum: its torque, and what turns with the shaft."""
    drum = _part("load.drum", Drum, content)
    for name, value in (("mass", drum.mass), ("radius", drum.radius), ("inertia", drum.inertia)):
        if not is_finite(value) or value < 0.0:
            raise LoadError(f"load.drum: {name}", got=value, allowed="a number, 0 or more")
    return Load(torque=drum.mass * STANDARD_GRAVITY * drum.radius, inertia=drum.mass * drum.radius**2 + drum.inertia)


def words_of_load(load: Load) -> dict[str, Any]:
    """Return what `load_from_words` makes the same load of; what is 0 or absent is left out.

    Examples
    --------
    >>> from servotwin.loads import Inertia, Spring
    >>> words_of_load(Inertia(1e-3) + Spring(2.0))
    {'inertia': 0.001, 'spring': {'stiffness': 2.0, 'rest_angle': 0.0}}
    """
    words: dict[str, Any] = {name: getattr(load, name) for name in _NUMBERS if getattr(load, name) != 0.0}
    for name, (key, kind) in _PARTS.items():
        parts = [{f.name: _plain(getattr(part, f.name)) for f in fields(kind) if getattr(part, f.name) is not None}
                 for part in getattr(load, key)]
        if parts:
            words[name] = parts[0] if len(parts) == 1 else parts
    return words


def _part(what: str, kind: Any, content: object) -> Any:
    if not isinstance(content, Mapping):
        raise LoadError(what, got=content, allowed="a mapping of its fields")
    names = [f.name for f in fields(kind)]
    for name in content:
        if name not in names:
            raise UnknownNameError(f"name in {what}", name, names)
    lacking = [f.name for f in fields(kind) if f.default is MISSING and f.name not in content]
    if lacking:
        raise LoadError(what, got=", ".join(content) or "nothing", allowed=f"also {', '.join(lacking)}")
    return kind(**content)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value

# --- JSON files at the edge: read whole, refused in one line ----------------------------------------------------------

def read_json(path: str | Path) -> Any:
    """Return the content of a JSON file.

    Raises
    ------
    InputError
        If it cannot be read, is not UTF-8 or no valid JSON (says the line), or has a key twice in one object.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.json"
    >>> _ = file.write_text('{"mass": 0.5}')
    >>> read_json(file)
    {'mass': 0.5}
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not readable as text ({error})") from None
    if not text.strip():
        raise InputError(f"{path}", got="an empty file", allowed="JSON")
    try:
        return json.loads(text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: line {error.lineno} is not valid JSON ({error.msg})") from None
    except RecursionError:
        raise InputError(f"{path}: is not valid JSON (nested too deeply)") from None
    except InputError as error:
        raise InputError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None
    except ValueError as error:  # an integer of thousands of digits
        raise InputError(f"{path}: is not valid JSON ({error})") from None


def write_json(path: str | Path, content: Mapping[str, Any], *, overwrite: bool = False) -> None:
    """Write a JSON file; a failure leaves what was there untouched.

    Raises
    ------
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    write_file(path, json_bytes(content), overwrite=overwrite)


def json_bytes(content: Mapping[str, Any]) -> bytes:
    """Return the contents of a JSON file."""
    return (json.dumps(content, indent=1) + "\n").encode()


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("key of an object", got=f"{twice} twice", allowed="once")
    return made

# --- Values in the names of files: what `lift{mass}.txt` says of `lift200.txt`, and sidecars that use it --------------

_PLACE = re.compile(r"\{([a-z_]\w*)\}", re.IGNORECASE)
_VALUE = r"(?P<{}>[+-]?\d+(?:[.,]\d+)?)"
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*?)?\s*")


def has_values(pattern: str) -> bool:
    """Tell whether a pattern of names takes values out of them."""
    return _PLACE.search(pattern) is not None


def values_in(pattern: str, name: str) -> dict[str, str] | None:
    """Return the values in a name that fits a pattern, None where it does not fit.

    Examples
    --------
    >>> values_in("lift{mass}g_{run}.*", "lift200g_3.csv"), values_in("lift{mass}.txt", "drop.txt")
    ({'mass': '200', 'run': '3'}, None)
    >>> values_in("*.csv", "run.csv")
    {}
    """
    if not has_values(pattern):
        return {} if fnmatchcase(name, pattern) else None
    marks = _PLACE.findall(pattern)
    if len(set(marks)) < len(marks):
        raise InputError("values in a name", got=pattern, allowed="each of them once")
    parts = _PLACE.split(pattern)  # text, name, text, ...
    form = "".join(_VALUE.format(part) if k % 2 else re.escape(part).replace(r"\*", ".*").replace(r"\?", ".")
                   for k, part in enumerate(parts))
    match = re.fullmatch(form, name)
    return None if match is None else {key: value.replace(",", ".") for key, value in match.groupdict().items()}


def filled_in(what: str, content: Any, values: dict[str, str]) -> Any:
    """Return an entry of a sidecar with values in the place of their names, in SI where a unit stands behind.

    Raises
    ------
    InputError
        If it names a value that the name does not hold, or the unit is none.

    Examples
    --------
    >>> filled_in("load", {"drum": {"mass": "{mass}g", "radius": 0.1}, "note": "no {k}"}, {"mass": "200", "k": "3"})
    {'drum': {'mass': 0.2, 'radius': 0.1}, 'note': 'no 3'}
    """
    if isinstance(content, dict):
        return {key: filled_in(f"{what}, {key}", value, values) for key, value in content.items()}
    if isinstance(content, list):
        return [filled_in(what, value, values) for value in content]
    if not isinstance(content, str) or not has_values(content):
        return content
    for name in _PLACE.findall(content):
        if name not in values:
            raise UnknownNameError(f"value of a name in {what}", name, values)
    text = _PLACE.sub(lambda match: values[match[1]], content)
    match = _QUANTITY.fullmatch(text)
    if match is None or not _PLACE.match(content.strip()):
        return text
    if match[2] is None:
        return float(match[1])
    unit = unit_word(match[2])
    if unit is None or unit[1] not in units.DIMENSIONS:
        raise InputError(what, got=content, allowed="a value and its unit, such as {mass}g")
    return float(units.to_si(float(match[1]), unit[0], unit[1]))

# --- The JSON beside a CSV log: what the numbers alone do not say -----------------------------------------------------

FORMAT = "servotwin-log-1"
FOLDER_FILE = "logs.json"
_TEXTS = ("name", "motion", "source")
_KEYS = (*_TEXTS, "conditions", "load", "parameters", "leave_out", "command_hold", "command", "columns",
         "drop_repeated", "recorded")
_MERGED = ("conditions", "parameters")  # entry by entry, where folder and file both speak
_SIGNS = ("sign_bit", "bits")
_COLUMN_KEYS = ("column", "unit", "scale", "offset", *_SIGNS)
_MOST_BITS = 64


@dataclass(frozen=True, kw_only=True)
class Sidecar:
    """The content of a sidecar; keys that it leaves out have their defaults.

    Parameters
    ----------
    log : mapping
        Arguments of `Log`: name, motion, conditions, load, parameters, left_out, command_hold, source.
    command : str, optional
        Which column is the command, where the file has several.
    columns : mapping of str to Column, optional
        Signal to column; None: the header says it.
    drop_repeated : bool
        Rows with the same stamp as the row before are passed over.
    """

    log: Mapping[str, Any] = field(default_factory=dict)
    command: str | None = None
    columns: Mapping[str, Column] | None = None
    drop_repeated: bool = False


def sidecar_path(path: Path) -> Path:
    """Return where the sidecar of a CSV file is: beside it, with the ending .json."""
    return path.parent / f"{path.stem}.json"


def sidecar_of(path: Path, shared: Path | None = None) -> Sidecar:
    """Return what is said about a CSV file, by its own sidecar before the one that it shares with others.

    Parameters
    ----------
    path : Path
        The CSV file.
    shared : Path, optional
        Of all files that have no own; `logs.json` in the same folder unless given.

    Raises
    ------
    InputError
        If a sidecar holds something wrong: names file, key, got and allowed.
    """
    own = sidecar_path(path)
    common = path.parent / FOLDER_FILE if shared is None else shared
    said: dict[str, Any] = {}
    if shared is not None or common.is_file():
        said = _checked(common, read_json(common), path.name)
    if own not in (common, path) and own.is_file():
        said = _merged(said, _checked(own, read_json(own), None))
    log = {name: said[name] for name in (*_TEXTS, "conditions", "parameters", "load", "command_hold") if name in said}
    if "leave_out" in said:
        log["left_out"] = said["leave_out"]
    return Sidecar(log=log, command=said.get("command"), columns=said.get("columns"),
                   drop_repeated=said.get("drop_repeated", False))


def patterns_of(shared: Path) -> tuple[str, ...]:
    """Return the patterns of names under `files` of a folder's sidecar; none where there is no such file."""
    content = read_json(shared) if shared.is_file() else {}
    files = content.get("files", {}) if isinstance(content, dict) else {}
    return tuple(files) if isinstance(files, dict) else ()


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    made = {**below, **above}
    for key in _MERGED:
        if key in below and key in above:
            made[key] = {**below[key], **above[key]}
    return made


def _checked(file: Path, content: object, member: str | None) -> dict[str, Any]:
    """Return what a sidecar says, checked; `member` is the file of a folder that it speaks of, None for its own."""
    if not isinstance(content, dict):
        raise InputError(f"{file}", got=type(content).__name__, allowed=f'an object with "format": "{FORMAT}"')
    if content.get("format") != FORMAT:
        raise InputError(f"{file}: format", got=content.get("format", "none"), allowed=f'"{FORMAT}"')
    said = _entries(f"{file}", {k: v for k, v in content.items() if k not in ("format", "files")})
    if member is None:
        if "files" in content:
            raise InputError(f"{file}: files", got="in the sidecar of one file", allowed=f"in {FOLDER_FILE} only")
        return said
    files = content.get("files", {})
    if not isinstance(files, dict):
        raise InputError(f"{file}: files", got=files, allowed='an object, such as {"step*.csv": {"motion": "step"}}')
    for pattern, entries in files.items():
        what = f"{file}: files, {pattern}"
        if not isinstance(entries, dict):
            raise InputError(what, got=entries, allowed="an object with the keys of a sidecar")
        values = values_in(pattern, member)
        if values is not None or not has_values(pattern):
            more = _entries(what, filled_in(what, entries, values or {}) if values else entries)
            said = said if values is None else _merged(said, more)
    return said


def _entries(where: str, content: Mapping[str, Any]) -> dict[str, Any]:
    said: dict[str, Any] = {}
    for key, value in content.items():
        if key not in _KEYS:
            raise InputError(f"{where}: {UnknownNameError('key', key, _KEYS)}")
        what = f"{where}: {key}"
        try:
            said[key] = _entry(what, key, value)
        except UnknownNameError as error:
            raise InputError(f"{what}: {error}") from None
        except InputError as error:
            known = error.what.startswith(where)
            raise InputError(error.what if known else f"{what}, {error.what}", error.got, error.allowed) from None
    return said


def _entry(what: str, key: str, value: Any) -> Any:
    if key in _TEXTS:
        if not isinstance(value, str):
            raise InputError(what, got=value, allowed="a text")
        return value
    if key == "recorded":  # what a recorder tells of its bench, for people
        if not isinstance(value, dict):
            raise InputError(what, got=value, allowed="an object")
        return value
    if key == "drop_repeated":
        if not isinstance(value, bool):
            raise InputError(what, got=value, allowed="true or false")
        return value
    if key == "command":
        return _one_of(what, value, tuple(COMMANDS))
    if key == "command_hold":
        return _one_of(what, value, ("previous", "linear"))
    if key == "load":
        return load_from_words(value)
    if key == "leave_out":
        if not isinstance(value, list):
            raise InputError(what, got=value, allowed="a list of windows [start, stop]")
        return value
    if not isinstance(value, dict):
        raise InputError(what, got=value, allowed="an object")
    return _columns(what, value) if key == "columns" else value


def _one_of(what: str, value: object, allowed: tuple[str, ...]) -> object:
    if value not in allowed:
        raise InputError(what, got=value, allowed=", ".join(allowed))
    return value


def _columns(what: str, content: Mapping[str, Any]) -> dict[str, Column]:
    return {name: _column(f"{what}, {name}", name, entry) for name, entry in content.items()}


def _column(what: str, name: str, entry: object) -> Column:
    if name not in NAMES:
        raise InputError(f"{what}: {UnknownNameError('signal', name, NAMES)}")
    if not isinstance(entry, dict):
        raise InputError(what, got=entry, allowed='an object, such as {"column": "angle", "unit": "deg"}')
    allowed = ("column",) if name == SWITCH else (*_COLUMN_KEYS, "from_first") if name == TIME else _COLUMN_KEYS
    for key in entry:
        if key not in allowed:
            raise InputError(f"{what}: {UnknownNameError('key', key, allowed)}")
    column, from_first = entry.get("column"), entry.get("from_first", False)
    if not isinstance(column, str):
        raise InputError(f"{what}, column", got=column, allowed="the name of a column, as the header says it")
    if not isinstance(from_first, bool):
        raise InputError(f"{what}, from_first", got=from_first, allowed="true or false")
    for key in ("scale", "offset"):
        if not is_finite(entry.get(key, 1.0)) or (key == "scale" and entry.get(key, 1.0) == 0.0):
            raise InputError(f"{what}, {key}", got=entry[key], allowed="a finite number" + ", not 0" * (key == "scale"))
    for key in _SIGNS:
        number = entry.get(key, 1)
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= _MOST_BITS:
            raise InputError(f"{what}, {key}", got=number, allowed=f"a whole number from 1 to {_MOST_BITS}")
    unit = check_unit(f"{what}, unit", entry.get("unit", si_unit_of(name)), name)
    return Column(column, unit, float(entry.get("scale", 1.0)), float(entry.get("offset", 0.0)), from_first,
                  entry.get("sign_bit"), entry.get("bits"))


def column_entries(columns: Mapping[str, Column]) -> dict[str, dict[str, Any]]:
    """Return what a sidecar says of columns under `columns`; what is as usual is left out.

    Examples
    --------
    >>> column_entries({"output_angle": Column("pos", "deg", offset=-90.0)})
    {'output_angle': {'column': 'pos', 'unit': 'deg', 'offset': -90.0}}
    """
    made: dict[str, dict[str, Any]] = {}
    for name, column in columns.items():
        entry: dict[str, Any] = {"column": column.column}
        if name != SWITCH:
            entry["unit"] = column.unit
        if column.scale != 1.0:
            entry["scale"] = column.scale
        if column.offset != 0.0:
            entry["offset"] = column.offset
        if column.from_first:
            entry["from_first"] = True
        entry |= {key: value for key, value in zip(_SIGNS, (column.sign_bit, column.bits), strict=True)
                  if value is not None}
        made[name] = entry
    return made


def sidecar_words(log: Log) -> dict[str, Any]:
    """Return the content of the sidecar of a log; what is empty is left out."""
    content: dict[str, Any] = {
        "format": FORMAT, "name": log.name, "motion": log.motion, "source": log.source,
        "conditions": dict(log.conditions), "load": words_of_load(log.load), "parameters": dict(log.parameters),
        "leave_out": [list(window) for window in log.left_out], "command_hold": log.command_hold}
    return {key: value for key, value in content.items() if value}
