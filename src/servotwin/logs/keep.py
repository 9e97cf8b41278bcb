"""What the user said of columns, kept in sidecars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from servotwin.errors import InputError
from servotwin.logs.column_words import SAID
from servotwin.logs.columns import Column, si_unit_of
from servotwin.logs.log import Log
from servotwin.logs.register_columns import OPTION
from servotwin.logs.sidecar import FOLDER_FILE, FORMAT, column_entries, read_json, sidecar_path, write_json
from servotwin.units.words import unit_shown


def keep_columns(logs: Sequence[Log], folder: Path | None = None, *, overwrite: bool = False,
                 instead_of: Sequence[Log] = ()) -> list[Path]:
    """Write what was said of columns (`columns=` or `registers=` of `read_logs`) into sidecars, to be said once.

    A sidecar that is there keeps all else that it says. The logs of one folder share its `logs.json` if their columns
    are the same ones; else each has a sidecar of its own.

    Parameters
    ----------
    logs : sequence of Log
        As they were read.
    folder : Path, optional
        Where they were read from, if that was a folder.
    overwrite : bool
        Replace what a sidecar says otherwise.
    instead_of : sequence of Log
        The logs as they were read, where more was found of their columns since: what a sidecar says of these may be
        replaced.

    Returns
    -------
    list of Path
        The sidecars that were written; none where they said so already.

    Raises
    ------
    InputError
        If a sidecar says otherwise of a column, and `overwrite` is false; nothing is written then.
    OutputError
        If one cannot be written.
    """
    files = {Path(log.reading.file): dict(log.reading.layout) for log in logs
             if log.reading is not None and any(
                 one.known == SAID or one.known.startswith(OPTION) for one in log.reading.columns)}
    before = {sidecar_path(Path(log.reading.file)): dict(log.reading.layout) for log in instead_of
              if log.reading is not None}
    made = {}
    everyone = len(files) == len({log.reading.file for log in logs if log.reading is not None})
    for target, columns in _targets(files, folder if everyone else None).items():
        content = _updated(target, columns, before.get(target), overwrite=overwrite)
        if content is not None:
            made[target] = content
    for target, content in made.items():
        write_json(target, content, overwrite=True)
    return list(made)


def _targets(files: Mapping[Path, dict[str, Column]], folder: Path | None) -> dict[Path, dict[str, Column]]:
    """Return which sidecar gets which columns."""
    own = {sidecar_path(file): columns for file, columns in files.items()}
    shared = None if folder is None else folder / FOLDER_FILE
    if shared is None or not files or any(columns != next(iter(files.values())) for columns in files.values()):
        return own
    if any("columns" in _content(path) for path in own) or any(
            isinstance(entry, dict) and "columns" in entry for entry in _content(shared).get("files", {}).values()):
        return own  # what counts before logs.json
    return {shared: next(iter(files.values()))}


def _content(path: Path) -> dict[str, Any]:
    content = read_json(path) if path.is_file() else {"format": FORMAT}
    return content if isinstance(content, dict) else {}


def _updated(path: Path, columns: Mapping[str, Column], before: Mapping[str, Column] | None, *,
             overwrite: bool) -> dict[str, Any] | None:
    """Return the new content of a sidecar, None where it says all that already."""
    content = _content(path)
    said, entries = content.get("columns"), column_entries(columns)
    if isinstance(said, dict):
        other = _other(said, entries)
        if other is not None and not overwrite and (before is None or _other(said, column_entries(before))):
            here = _words(entries[other]) if other in entries else "nothing"
            raise InputError(f"{path}: columns, {other}", got=f"{_words(said[other])} there, {here} here",
                             allowed="the same; --force (overwrite=True) replaces what the sidecar says")
        if other is None and len(said) == len(entries):
            return None
    return {**content, "columns": entries}


def _other(said: Mapping[str, Any], entries: Mapping[str, Any]) -> str | None:
    """Return the first column of which a sidecar says otherwise."""
    return next((name for name in said if name not in entries or not _same(name, said[name], entries[name])), None)


def _same(name: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    usual = {"unit": si_unit_of(name), "scale": 1.0, "offset": 0.0, "from_first": False}
    return {**usual, **a} == {**usual, **b}


def _words(entry: Mapping[str, Any]) -> str:
    unit = unit_shown(str(entry.get("unit", "SI")), entry.get("scale", 1.0), entry.get("offset", 0.0))
    return f"{entry.get('column')}:{unit}"
