"""The work of reading a log that was brought: bytes in, logs and how they were read out."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import re
import warnings
import zlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.errors import InputError, ServotwinError
from servotwin.logs import Log, Reading, read_logs
from servotwin.logs.log import reading_facts
from servotwin.web.server.messages import LONGEST_UPLOAD
from servotwin.web.server.own.frames import RefusedError

if TYPE_CHECKING:
    from servotwin.web.server.own.work import Tell

_STEM = "uploaded-log"
_ENDINGS = (".csv", ".tsv", ".txt", ".json")
_COMPUTED = ("motor_torque", "error_time", "drive")
"""Signals that a simulation writes and no sensor measures."""
UNITS = {"pulse_width": ("us", 1e6), "angle": ("deg", 180.0 / np.pi), "voltage": ("V", 1.0)}
"""In which unit a bench takes a command of each kind, and how many of it an SI unit has."""
MOST_PLAYED = 20_000
"""Changes of a command that a bench can play."""
DIGITS = 9  # of a command that is played
_MEMORY = 2_000_000_000  # bytes: a usual log of 20 MB takes half of it
_MOST_RUNS = 1000


def work(given: dict[str, Any], tell: Tell) -> tuple[dict[str, Any], list[bytes]]:
    """Return what is reported of a log, and as bytes: the file, the logs, and the commands that can be played.

    Parameters
    ----------
    given : dict
        `raw` (bytes of the file, packed where `packed`), `label`, `folder` (empty), `columns`, `mend`.
    tell : callable

    Raises
    ------
    RefusedError
        With the packed file, so that it can be read again with other words.
    """
    _bound_memory()
    raw: bytes = zlib.decompress(given["raw"]) if given["packed"] else given["raw"]
    packed: bytes = given["raw"] if given["packed"] else zlib.compress(raw, 1)
    try:
        logs, more = _read(raw, given)
        if len(logs) > _MOST_RUNS:
            raise InputError(given["label"], got=f"{len(logs)} runs", allowed=f"at most {_MOST_RUNS}")
    except ServotwinError as error:
        raise RefusedError(_plain(str(error), given["label"]), [packed]) from None
    kept = zlib.compress(pickle.dumps(logs), 1)
    if len(packed) + len(kept) > LONGEST_UPLOAD:
        raise InputError(given["label"], got=f"{(len(packed) + len(kept)) / 1e6:.0f} MB once packed",
                         allowed=f"at most {LONGEST_UPLOAD / 1e6:.0f} MB: a shorter log")
    played = zlib.compress(json.dumps([_played(log) for log in logs]).encode(), 1)
    return log_facts(logs, given["label"], more), [packed, kept, played]


def _read(raw: bytes, given: dict[str, Any]) -> tuple[list[Log], list[str]]:
    """Return the logs of a file, and what was said while it was read."""
    label, folder = given["label"], Path(given["folder"])
    if raw[:4] in (b"PAR1", b"PK\x03\x04") or label.lower().endswith((".parquet", ".zip")):
        raise InputError(label, got="a file of a dataset, or an archive",
                         allowed="one table or JSON file; a LeRobot dataset is a folder, which `servotwin fit` reads")
    os.chdir(folder)  # so that no message names a place of this computer
    ending = Path(label).suffix.lower()
    file = Path(f"{_STEM}{ending if ending in _ENDINGS else '.csv'}")
    file.write_bytes(raw)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mends = [word for word in re.split(r"[,\s]+", given["mend"]) if word]
        logs = read_logs(file, columns=given["columns"] or None, mend=mends)
    said = [_plain(str(one.message), label) for one in caught if issubclass(one.category, UserWarning)]
    return [_renamed(log, label) for log in logs], said


def _renamed(log: Log, label: str) -> Log:
    name = Path(label).stem or label
    reading = None if log.reading is None else replace(log.reading, file=label, remarks=tuple(
        _plain(one, label) for one in log.reading.remarks))
    return replace(log, name=log.name.replace(_STEM, name), source=label, reading=reading)


def _plain(line: str, label: str) -> str:
    """Return a line about the file under the name that it came with."""
    for ending in _ENDINGS:
        line = line.replace(f"{_STEM}{ending}", label)
    return line.replace(_STEM, label)


def log_facts(logs: list[Log], label: str, more: list[str]) -> dict[str, Any]:
    """Return what a page gets of logs: how their columns were read, and what each run holds."""
    groups = reading_facts(logs)
    first: Reading | None = logs[0].reading
    remarks = dict.fromkeys([*more, *(remark for group in groups for remark in group["remarks"])])
    return {
        "name": label, "columns": groups[0]["columns"] if groups else [],
        "unread": list(first.unread) if first is not None else [], "remarks": list(remarks)[:20],
        "computed": is_computed(logs[0]), "runs": [_run_facts(log) for log in logs]}


def is_computed(log: Log) -> bool:
    """Tell whether a log holds what only a simulation has."""
    return any(name in log.measured for name in _COMPUTED)


def _run_facts(log: Log) -> dict[str, Any]:
    unit, factor = UNITS[log.command_kind]
    held = factor * log.held
    return {"name": log.name, "motion": log.motion, "rows": len(log), "duration": log.duration,
            "command": {"kind": log.command_kind, "unit": unit, "low": float(held.min()), "high": float(held.max()),
                        "hold": log.command_hold, "changes": len(log.changes)},
            "measured": list(log.measured), "played": _changes(log) is not None}


def _changes(log: Log) -> np.ndarray | None:
    """Return the samples that say all of a command; None of one that is too long to be played."""
    ends = [0, len(log) - 1]
    some = np.arange(len(log)) if log.command_hold == "linear" else np.unique(np.concatenate([ends, log.changes]))
    return some if len(some) <= MOST_PLAYED else None


def _played(log: Log) -> dict[str, Any] | None:
    """Return a log's command as a bench takes it; None of one that is too long."""
    some = _changes(log)
    if some is None:
        return None
    unit, factor = UNITS[log.command_kind]
    return {"shape": "recorded", "unit": unit, "hold": log.command_hold,
            "time": [float(f"{x:.{DIGITS}g}") for x in (log.time - log.start)[some].tolist()],
            "value": [float(f"{x:.{DIGITS}g}") for x in (factor * log.held)[some].tolist()]}


def _bound_memory() -> None:
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
