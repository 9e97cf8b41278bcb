"""The folder of a study: what defines it, a file for each finished chunk, and what came out."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin import __version__
from servotwin.errors import InputError, OutputError
from servotwin.parameters import write_file
from servotwin.parameters.output_file import undone
from servotwin.tables.columns import check_format, encoded, read_columns

Column = NDArray[Any]

STUDY, SUMMARY = "study.json", "summary.json"
_FOLLOWING = ("parameters_sha256", "chunk")  # from all the others
_MOST_NAMED = 6  # of what differs
_LIBRARIES = ("numpy", "scipy")


class Folder:
    """A folder that belongs to one study.

    Parameters
    ----------
    path : str or Path
        Made where it is not there; its parent must be.
    definition : mapping
        All that defines the study, ready for JSON.
    file_format : str
        "csv" or "parquet".
    resume : bool
        Whether a folder with the same study is gone on with.

    Raises
    ------
    OutputError
        If it cannot be written, or holds anything and `resume` is false, or anything else than this study.
    """

    def __init__(self, path: str | Path, definition: Mapping[str, Any], *, file_format: str, resume: bool) -> None:
        check_format(file_format)
        self.path, self._format = Path(path), file_format
        own = {**definition, "servotwin": __version__, "format": file_format}
        new = not self.path.exists()
        with undone(self._remove_empty if new else lambda: None):
            self._make()
            if not self._empty():
                if not resume:
                    raise OutputError(f"{self.path} is not empty; resume=True (--resume) goes on with the study there")
                self._check_same(own)
                return
            versions = {"python": platform.python_version(), **{name: metadata.version(name) for name in _LIBRARIES}}
            self._write(STUDY, _json({"sha256": _fingerprint(own), "definition": own, "versions": versions}))

    def _remove_empty(self) -> None:
        with contextlib.suppress(OSError, ValueError):  # it has the study, or never was
            self.path.rmdir()

    def _make(self) -> None:
        if "\0" in str(self.path):
            raise OutputError(f"{str(self.path)!r} cannot be a folder (a path holds no NUL)")
        try:
            self.path.mkdir(exist_ok=True)
        except FileExistsError:
            raise OutputError(f"{self.path} is no folder") from None
        except OSError as error:
            reason = error.strerror if self.path.parent.exists() else f"no folder {self.path.parent}"
            raise OutputError(f"{self.path} cannot be made ({reason})") from None

    def _empty(self) -> bool:
        try:
            return not any(self.path.iterdir())
        except OSError as error:
            raise OutputError(f"{self.path} cannot be read ({error.strerror})") from None

    def _check_same(self, own: Mapping[str, Any]) -> None:
        file = self.path / STUDY
        try:
            theirs = _flat(dict(json.loads(file.read_text(encoding="utf-8"))["definition"]))
        except (OSError, ValueError, KeyError, TypeError):
            raise OutputError(f"{self.path} holds no study that could be gone on with ({STUDY} is missing or broken); "
                              "name another folder") from None
        ours = _flat(json.loads(json.dumps(own)))
        differ = [name for name in dict.fromkeys((*ours, *theirs)) if theirs.get(name) != ours.get(name)]
        if differ:
            said = [name for name in differ if name not in _FOLLOWING] or differ
            more = f"; {len(said) - _MOST_NAMED} more" if len(said) > _MOST_NAMED else ""
            raise OutputError(f"{file} is of another study: " + "; ".join(
                f"{name} is {_short(ours, name)} and was {_short(theirs, name)}" for name in said[:_MOST_NAMED]) + more
                + "; repeat it as it was, or name another folder")

    def _write(self, name: str, content: bytes) -> None:
        try:
            write_file(self.path / name, content, overwrite=True)
        except OutputError as error:
            raise OutputError(f"{error.what}; what is finished is kept, and resume=True (--resume) goes on") from None

    def _chunk(self, k: int) -> Path:
        return self.path / f"lanes-{k:05}.{self._format}"

    def has(self, k: int) -> bool:
        """Return whether a chunk is finished."""
        return self._chunk(k).exists()

    def write(self, k: int, columns: Mapping[str, Column]) -> None:
        """Write a chunk, whole or not at all.

        Raises
        ------
        OutputError
            If that fails; what is finished stays.
        """
        self._write(self._chunk(k).name, encoded(columns, self._format))

    def read(self, k: int, names: tuple[str, ...], lanes: int) -> dict[str, Column]:
        """Return the columns of a finished chunk.

        Raises
        ------
        InputError
            If the file is not what was written.
        """
        file = self._chunk(k)
        found = read_columns(file)
        if tuple(found) != names or len(found["lane"]) != lanes:
            raise InputError(f"{file} is not what the study wrote; delete it and go on with resume=True (--resume)")
        return {**found, "lane": found["lane"].astype(np.int64)}

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write what came out."""
        self._write(SUMMARY, _json(summary))


def _json(content: Mapping[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def _fingerprint(definition: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(definition, sort_keys=True).encode()).hexdigest()


def _short(content: Mapping[str, Any], name: str) -> str:
    """Return a value as a line has room for it."""
    text = json.dumps(content[name]) if name in content else "not given"
    return text if len(text) <= 60 else f"{text[:40]} ..."


def _flat(content: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Return nested mappings as one, with dotted names."""
    found: dict[str, Any] = {}
    for name, value in content.items():
        found |= _flat(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
    return found
