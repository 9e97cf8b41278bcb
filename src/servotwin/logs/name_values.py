"""Values in the names of files: what `lift{mass}.txt` says of `lift200.txt`, and sidecars that use it."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import Any

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.units.words import unit_word

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
