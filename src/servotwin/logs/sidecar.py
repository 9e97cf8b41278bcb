"""The JSON beside a CSV log: what the numbers alone do not say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, UnknownNameError
from servotwin.logs.columns import COMMANDS, NAMES, SWITCH, TIME, Column, check_unit, si_unit_of
from servotwin.logs.json_file import read_json
from servotwin.logs.load_words import load_from_words, words_of_load
from servotwin.logs.name_values import filled_in, has_values, values_in
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.logs.log import Log

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
    """What a sidecar says; what it leaves out has its default.

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
