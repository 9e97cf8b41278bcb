"""TOML of plain values on one line each: what a scene is written in."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from servotwin.errors import InputError


def toml_value(value: Any) -> str:
    """Return a plain value as TOML: words, numbers, truths, lists, and mappings as inline tables.

    Raises
    ------
    InputError
        If it is something else, or a number is not finite.

    Examples
    --------
    >>> toml_value([0.5, "hold", {"load.inertia": 1e-3, "on": True}])
    '[0.5, "hold", {"load.inertia" = 0.001, on = true}]'
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float) and math.isfinite(value):
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {toml_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    raise InputError("value of a scene", got=value, allowed="words, finite numbers, true, false, lists and tables")


def toml_line(key: str, value: Any) -> str:
    r"""Return `key = value`, a text of several lines as one between three quotes.

    Examples
    --------
    >>> toml_line("seed", 3)
    'seed = 3'
    """
    if isinstance(value, str) and "\n" in value:
        inner = "\n".join(_text(line)[1:-1] for line in value.split("\n"))
        return f'{_key(key)} = """\n{inner}"""'
    return f"{_key(key)} = {toml_value(value)}"


def _text(value: str) -> str:
    """Return a basic string; what is no Unicode stands as a question mark."""
    clean = value.encode("utf-8", "replace").decode()
    return json.dumps(clean, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(key: str) -> str:
    plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if plain else _text(key)
