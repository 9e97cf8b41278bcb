"""JSON files at the edge: read whole, refused in one line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from servotwin.errors import InputError
from servotwin.parameters import write_file
from servotwin.tables.text import read_bytes


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
