"""Rules of what a page and a scene may say: plain data, which Python and the page as one file go by alike.

A rule is a table. Its `is` says what the value has to be:

number, whole
    From `low` to `high`, both included unless `open`; those that are absent do not bind.
number or text, truth, text
    A text has at most `most` characters, and nothing that the pattern `without` matches.
word
    One of `of`.
table
    Of `fields`, a rule for each name, where `fields` is given, else of any names whose values follow `each`; with
    `some` it is not empty. Of a field that is missing `usual` counts, else it is left out, or refused where it is
    `needed`.
variant
    A table whose field `by` says which of `tables` it is.
list
    Of `least` to `most` values that follow `each`; `as_many_as` names a list of the same table.

`what` and `allowed` are what a refusal says; `{name}` in them is the name of the field.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NoReturn

from servotwin.errors import InputError, UnknownNameError
from servotwin.units import is_finite

Rule = Mapping[str, Any]


def number(what: str, allowed: str, low: float | None = None, high: float | None = None, **more: Any) -> Rule:
    """Return the rule of a number.

    Examples
    --------
    >>> checked(number("push", "at most 2 N m", -2.0, 2.0), 1)
    1.0
    """
    ends = {name: end for name, end in (("low", low), ("high", high)) if end is not None}
    return {"is": "number", "what": what, "allowed": allowed, **ends, **more}


def checked(rule: Rule, value: Any, name: str = "", table: Mapping[str, Any] | None = None) -> Any:
    """Return a value as a rule has it: floats, whole numbers, words, truths, lists, and tables with all usual values.

    Parameters
    ----------
    rule : mapping
    value : object
    name : str
        Of the field that it is.
    table : mapping, optional
        In which it stands.

    Raises
    ------
    InputError
        If it does not follow the rule.

    Examples
    --------
    >>> checked({"is": "truth", "what": "torque", "allowed": "true or false"}, 1)
    Traceback (most recent call last):
      ...
    servotwin.errors.InputError: torque: got 1, allowed: true or false
    """
    found = _KINDS[rule["is"]](rule, value, name, table or {})
    if found is None:
        _refuse(rule, value, name)
    return found


def _refuse(rule: Rule, value: Any, name: str) -> NoReturn:
    what, allowed = (rule[key].replace("{name}", name) for key in ("what", "allowed"))
    raise InputError(what, got=_told(rule, value), allowed=allowed)


def _told(rule: Rule, value: Any) -> Any:
    """Return what a refusal tells of a value: of some only their type or their length."""
    told = rule.get("told")
    if told == "type":
        return type(value).__name__
    if told == "length" and isinstance(value, list | tuple):
        return len(value)
    return rule["got"] if "got" in rule else value


def _within(rule: Rule, value: float) -> bool:
    low, high = rule.get("low", -float("inf")), rule.get("high", float("inf"))
    return bool(low < value < high) if rule.get("open") else bool(low <= value <= high)


def _number(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> float | None:
    return float(value) if is_finite(value) and _within(rule, value) else None


def _whole(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> int | None:
    return int(value) if is_finite(value) and value == int(value) and _within(rule, value) else None


def _number_or_text(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> float | str | None:
    return value if isinstance(value, str) else float(value) if is_finite(value) else None


def _plain(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> Any:
    if isinstance(value, bool | str):
        return value
    return value if is_finite(value) else None


def _truth(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> bool | None:
    return value if isinstance(value, bool) else None


def _text(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> str | None:
    if not isinstance(value, str) or len(value) > rule.get("most", len(value)):
        return None
    return None if "without" in rule and re.search(rule["without"], value) else value


def _word(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> str | None:
    if isinstance(value, str) and value in rule["of"]:
        return value
    if "unknown" in rule and isinstance(value, str):
        raise UnknownNameError(rule["unknown"], value, rule["of"])
    return None


def _table(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> dict[str, Any] | None:
    if not isinstance(value, Mapping) or (rule.get("some") and not value):
        return None
    fields = rule.get("fields")
    if fields is None:
        if not all(isinstance(key, str) and re.fullmatch(rule.get("names", ".*"), key) for key in value):
            return None
        return {key: checked(rule["each"], one, key, value) for key, one in value.items()}
    for key in value:
        if key not in fields and "unknown" in rule:
            raise UnknownNameError(rule["unknown"], str(key), rule.get("known", tuple(fields)))
        if key not in fields:
            return None
    found: dict[str, Any] = {}
    for key, own in fields.items():
        if key in value or own.get("needed"):
            found[key] = checked(own, value.get(key, own.get("usual")), key, value)
        elif "usual" in own:
            found[key] = own["usual"]
    return found


def _variant(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> dict[str, Any] | None:
    if not isinstance(value, Mapping):
        return None
    which = checked({**rule["choice"], "is": "word", "of": tuple(rule["tables"])}, value.get(rule["by"]))
    return _table(rule["tables"][which], value, name, table)


def _list(rule: Rule, value: Any, name: str, table: Mapping[str, Any]) -> list[Any] | None:
    if not isinstance(value, list | tuple) or not rule.get("least", 0) <= len(value) <= rule["most"]:
        return None
    other = table.get(rule.get("as_many_as", ""), value)
    if not isinstance(other, list | tuple) or len(other) != len(value):
        raise InputError(rule["what"].replace("{name}", name), got=f"{len(value)} numbers", allowed="as many as times")
    return [checked(rule["each"], one, name, table) for one in value]


_KINDS = {"number": _number, "whole": _whole, "number or text": _number_or_text, "plain": _plain, "truth": _truth,
          "text": _text, "word": _word, "table": _table, "variant": _variant, "list": _list}
