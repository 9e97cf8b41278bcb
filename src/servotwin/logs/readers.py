"""Logs from files and folders, whichever known format they are in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from servotwin.errors import InputError, UnknownNameError
from servotwin.logs.column_words import SAID
from servotwin.logs.columns import Column, si_unit_of
from servotwin.logs.formats import FORMATS, formats_that_hold, log_formats
from servotwin.logs.log import Log
from servotwin.logs.mends import checked_mends
from servotwin.logs.register_columns import OPTION
from servotwin.logs.sidecar import (
    FOLDER_FILE,
    FORMAT,
    column_entries,
    patterns_of,
    read_json,
    sidecar_path,
    values_in,
    write_json,
)
from servotwin.parameters import Servo
from servotwin.signals.signal import warn_of_time_base
from servotwin.units.words import unit_shown

# --- The user's words on columns, kept in sidecars --------------------------------------------------------------------

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


# --- Logs from files and folders, whichever known format they are in --------------------------------------------------

_CSV_ENDINGS = (".csv", ".tsv")


def read_logs(path: str | Path, format: str = "auto", *, sidecar: str | Path | None = None,
              columns: str | Mapping[str, str] | None = None, joints: str | Mapping[str, str] | None = None,
              mend: Sequence[str] = (), unknown_step: bool = False, registers: str | Servo | None = None) -> list[Log]:
    r"""Return the logs in a file or folder, in the order of the file names.

    Parameters
    ----------
    path : str or Path
        A table, whose sidecar says more; a JSON file of a known format; a folder of such files; or a dataset.
    format : str
        A name of `LOG_FORMATS` or of a plug-in, or "auto", which tells by the content; JSON files of a folder that are
        no logs are then passed over.
    sidecar : str or Path, optional
        Sidecar of all CSV files, in place of a `logs.json` in their folder.
    columns : str or mapping, optional
        Which column of the CSV files is which signal, in which unit: ``"time=t:ms angle=pos:deg-90"``. Columns that it
        leaves out are known by name or guessed; `Log.reading` shows it.
    joints : str or mapping, optional
        Which joints of a LeRobot dataset, and their unit: ``"shoulder_pan:deg"``.
    mend : sequence of str
        Mends of tables, of what is not certain: "torn", "reset", "drop-repeated", "spread-repeated", "clock16",
        "thousands".
    unknown_step : bool
        Whether the command of a table without one may be the one step that its angle shows.
    registers : str or Servo, optional
        Servo of which the registers name the columns of tables where they hold raw numbers: a family such as
        ``"feetech-sts"``, a model such as ``"XM430-W350"``, or the servo itself, of which only what cannot be degrees
        is taken for counts.

    Raises
    ------
    InputError
        If there is no log, one cannot be read, or two have one name: one line that names the file.
    MissingExtraError
        If it is a LeRobot dataset, and pyarrow is not installed.

    Warns
    -----
    UserWarning
        If the times of a log look as if they were a thousand times too long or too short.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> for name in ("a", "b"):
    ...     _ = (folder / f"{name}.csv").write_text("time,pulse_width_us,output_angle\n0,1500,0\n1,1600,2\n2,1600,3\n")
    >>> [log.name for log in read_logs(folder)]
    ['a', 'b']
    """
    if format not in FORMATS and format not in log_formats():
        raise UnknownNameError("format of logs", str(format), ("auto", *log_formats()))
    path, mends = Path(path), checked_mends(mend)
    for name, dataset in formats_that_hold("dataset").items():
        if format == name or (format == "auto" and dataset.room.recognises(path)):
            if columns is not None:
                raise InputError(f"--columns for {path}", got=f"a dataset ({name})",
                                 allowed="--joint (joints=), which says the units of its joints")
            if isinstance(registers, str):
                raise InputError(f"--registers for {path}", got=f"a dataset ({name})", allowed="tables")
            return list(dataset.room.logs_of(path, joints=joints))
    if joints is not None:
        raise InputError(f"--joint for {path}", got="no dataset", allowed="--columns (columns=) for tables")
    files = _files(path, format) if _is_folder(path) else [path]
    given = {"sidecar": sidecar, "columns": columns, "mend": mends, "unknown_step": unknown_step,
             "registers": registers}
    logs = [log for file in files for log in _logs(file, format, given, alone=file is path)]
    if not logs:
        raise InputError(f"{path}", got="a folder without logs", allowed="*.csv, *.json of a known format ("
                         + ", ".join(formats_that_hold("json")) + "), or a dataset")
    seen: dict[str, str] = {}
    for log in logs:
        if log.name in seen:
            raise InputError(f"{path}: name of a log", allowed="a name for each log",
                             got=f"{log.name} in {seen[log.name]} and in {Path(log.source).name}")
        seen[log.name] = Path(log.source).name
        warn_of_time_base(log.time, log.held, log.command_kind, f"log {log.name!r}")
    return logs


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):  # reading says what is wrong with the name
        return False


def _files(folder: Path, format: str) -> list[Path]:
    try:
        files = sorted(file for file in folder.iterdir() if file.is_file() and not file.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror})") from None
    named = patterns_of(folder / FOLDER_FILE)
    tables = [file for file in files if file.suffix.lower() in _CSV_ENDINGS or (
        file.suffix.lower() == ".txt" and any(values_in(pattern, file.name) is not None for pattern in named))]
    beside = {file.stem for file in tables}
    others = [file for file in files if file.suffix.lower() == ".json" and file.name != FOLDER_FILE
              and file.stem not in beside]
    asked = ("table", "json") if format == "auto" else (log_formats()[format].holds,)
    return sorted((tables if "table" in asked else []) + (others if "json" in asked else []))


def _logs(file: Path, format: str, given: Mapping[str, Any], *, alone: bool) -> list[Log]:
    name = "csv" if format == "auto" and not _is_json(file) else format
    if name != "auto" and log_formats()[name].holds == "table":
        return list(log_formats()[name].room.logs_of(file, **given))
    for said in ("columns", "registers"):
        if alone and isinstance(given[said], str | Mapping):
            raise InputError(f"--{said} for {file}", got="JSON", allowed="tables; JSON says what it holds")
    content: Any = read_json(file)
    if name != "auto":
        return list(log_formats()[name].room.logs_of(file, content))
    if isinstance(content, dict) and content.get("format") == FORMAT:
        if not alone:
            return []
        raise InputError(f"{file}", got="a sidecar", allowed="the CSV file that it describes, or its folder")
    rooms = [known.room for known in formats_that_hold("json").values()]
    known = next((room for room in rooms if room.recognises(content)), None)
    if known is None:
        if not alone:
            return []
        raise InputError(f"{file}", got="JSON that is no known log", allowed="one of the formats "
                         + ", ".join(formats_that_hold("json")))
    return list(known.logs_of(file, content))


def _is_json(file: Path) -> bool:
    """Return whether a file begins as JSON does."""
    try:
        with file.open("rb") as stream:
            head = stream.read(256)
    except (OSError, ValueError):
        return file.suffix.lower() == ".json"
    return head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[")
