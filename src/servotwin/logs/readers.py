"""Logs from files and folders, whichever known format they are in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from servotwin.errors import InputError, UnknownNameError
from servotwin.logs.bam_logs import bam_log, is_bam_log
from servotwin.logs.csv_logs import read_csv_log
from servotwin.logs.json_file import read_json
from servotwin.logs.lerobot import dataset_of, read_lerobot_logs
from servotwin.logs.log import Log
from servotwin.logs.miuzei import is_miuzei, miuzei_logs
from servotwin.logs.sidecar import FOLDER_FILE, FORMAT
from servotwin.signals.time_base import warn_of_time_base


class _JsonFormat(NamedTuple):
    """A format of JSON files: what its content looks like, and the logs that it holds."""

    recognises: Callable[[object], bool]
    logs: Callable[[Path, object], list[Log]]


# one line here makes a format known; `recognises` gets the content of the file
JSON_FORMATS: dict[str, _JsonFormat] = {
    "bam": _JsonFormat(is_bam_log, lambda path, content: [bam_log(path, content)]),
    "miuzei": _JsonFormat(is_miuzei, miuzei_logs),
}
FORMATS = ("auto", "csv", *JSON_FORMATS, "lerobot")
_CSV_ENDINGS = (".csv", ".tsv")


def read_logs(path: str | Path, format: str = "auto", *, sidecar: str | Path | None = None,
              columns: str | Mapping[str, str] | None = None, joints: str | Mapping[str, str] | None = None,
              ) -> list[Log]:
    r"""Return the logs in a file or folder, in the order of the file names.

    Parameters
    ----------
    path : str or Path
        A CSV file, whose sidecar says more; a JSON file of BAM or of the Miuzei data; a folder of such files; or the
        folder of a LeRobot dataset.
    format : {"auto", "csv", "bam", "miuzei", "lerobot"}
        "auto" tells by the content; JSON files of a folder that are no logs are then passed over.
    sidecar : str or Path, optional
        What holds for all CSV files, in place of a `logs.json` in their folder.
    columns : str or mapping, optional
        Which column of the CSV files is which signal, in which unit: ``"time=t:ms angle=pos:deg-90"``. What it leaves
        out is known by name or guessed; `Log.reading` shows it.
    joints : str or mapping, optional
        Which joints of a LeRobot dataset, and their unit: ``"shoulder_pan:deg"``.

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
    if format not in FORMATS:
        raise UnknownNameError("format of logs", str(format), FORMATS)
    path = Path(path)
    if format == "lerobot" or (format == "auto" and dataset_of(path) is not None):
        if columns is not None:
            raise InputError(f"--columns for {path}", got="a dataset of LeRobot",
                             allowed="--joint (joints=), which says the units of its joints")
        return read_lerobot_logs(path, joints=joints)
    if joints is not None:
        raise InputError(f"--joint for {path}", got="no dataset of LeRobot", allowed="--columns (columns=) for tables")
    files = _files(path, format) if _is_folder(path) else [path]
    given = {"sidecar": sidecar, "columns": columns}
    logs = [log for file in files for log in _logs(file, format, given, alone=file is path)]
    if not logs:
        raise InputError(f"{path}", got="a folder without logs", allowed="*.csv, *.json of a known format ("
                         + ", ".join(JSON_FORMATS) + "), or a dataset of LeRobot")
    seen: dict[str, str] = {}
    for log in logs:
        if log.name in seen:
            raise InputError(f"{path}: name of a log", allowed="a name for each log",
                             got=f"{log.name} in {seen[log.name]} and in {Path(log.source).name}")
        seen[log.name] = Path(log.source).name
        warn_of_time_base(log.time, log.command, log.command_kind, f"log {log.name!r}")
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
    tables = [file for file in files if file.suffix.lower() in _CSV_ENDINGS]
    beside = {file.stem for file in tables}
    others = [file for file in files if file.suffix.lower() == ".json" and file.name != FOLDER_FILE
              and file.stem not in beside]
    return sorted((tables if format in ("auto", "csv") else []) + (others if format != "csv" else []))


def _logs(file: Path, format: str, given: Mapping[str, Any], *, alone: bool) -> list[Log]:
    if format == "csv" or (format == "auto" and not _is_json(file)):
        return [read_csv_log(file, **given)]
    if alone and given["columns"] is not None:
        raise InputError(f"--columns for {file}", got="JSON", allowed="tables; JSON says what it holds")
    content: Any = read_json(file)
    if format != "auto":
        return JSON_FORMATS[format].logs(file, content)
    if isinstance(content, dict) and content.get("format") == FORMAT:
        if not alone:
            return []
        raise InputError(f"{file}", got="a sidecar", allowed="the CSV file that it describes, or its folder")
    known = next((known for known in JSON_FORMATS.values() if known.recognises(content)), None)
    if known is None:
        if not alone:
            return []
        raise InputError(f"{file}", got="JSON that is no known log", allowed="one of the formats "
                         + ", ".join(JSON_FORMATS))
    return known.logs(file, content)


def _is_json(file: Path) -> bool:
    """Return whether a file begins as JSON does."""
    try:
        with file.open("rb") as stream:
            head = stream.read(256)
    except (OSError, ValueError):
        return file.suffix.lower() == ".json"
    return head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[")
