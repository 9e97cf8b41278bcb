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
from typing import Any

from servotwin.errors import HIDDEN, InputError, UnknownNameError
from servotwin.models.engine.live.posts import UNITS
from servotwin.models.engine.live.screen import FIELDS
from servotwin.text import LONGEST_NAME
from servotwin.units import factor, is_finite, si_unit

# --- Rules of what a page and a scene may say -------------------------------------------------------------------------

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
        what, allowed = (rule[key].replace("{name}", name) for key in ("what", "allowed"))
        raise InputError(what, got=_told(rule, value), allowed=allowed)
    return found


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


# --- All that a page and a scene may say, as `rules`: commands, actions, what a scene holds ---------------------------

RATES = (1.0, 2000.0)
"""Lowest and highest frame rate of the transmitter [Hz]."""
FRAME_RATE = 50.0  # Hz, unless a scene gives another
MOST_SAMPLES = 200_000  # of a recorded command
LONGEST = 1e6  # s
LOAD_FIELDS = ("inertia", "viscous_friction", "torque", "coulomb_torque", "mass", "arm", "hanging_angle")
"""Numbers of a load: [kg m²], [N m s/rad], [N m], [N m], [kg], [m], [rad]."""
SUPPLY_FIELDS = ("open_circuit_voltage", "internal_resistance", "current_limit")
"""Numbers of a supply that all share: [V], [ohm], [A]."""
CONTROL_FIELDS = ("command_share", "reference_share", "sampling_delay")
"""Numbers of a control circuit: as `servotwin.bench.ControlSupply` [1], [1], [s]."""
_MOST_PUSH = 1e3  # N m: beyond any servo
_MOST_STEPS = 1000  # of a staircase, one way
_SEEDS = 2**53 - 1
_POSITIVE = ("dwell", "frequency", "start_frequency", "end_frequency", "duration")


def _span(what: str, low: float, high: float, **more: Any) -> Rule:
    return number(what, f"a number from {low:g} to {high:g}", low, high, **more)


def _field(shape: str, name: str) -> Rule:
    what: dict[str, Any] = {"what": f"{name} of a command of shape {shape}", "needed": True}
    if name == "hold":
        return {"is": "word", "of": ("previous", "linear"), "usual": "previous", "allowed": "previous, linear", **what}
    if shape == "recorded":
        more = {"as_many_as": "time"} if name == "value" else {}
        return {"is": "list", "least": 2, "most": MOST_SAMPLES, "told": "length",
                "allowed": f"a list of 2 to {MOST_SAMPLES} numbers", **what, **more,
                "each": {"is": "number", "got": "something that is no finite number", "allowed": "finite numbers",
                         "what": what["what"]}}
    if name == "steps":
        allowed = f"a whole number from 1 to {_MOST_STEPS}"
        return {"is": "whole", "low": 1, "high": _MOST_STEPS, "allowed": allowed, **what}
    if name in _POSITIVE:
        return {**number("", "a positive number", 0.0, open=True), **what}
    if name == "period":
        return {**number("", "at least 0; 0: once", 0.0), **what}
    return {**number("", "a finite number"), **what}


_UNIT: Rule = {"is": "word", "of": UNITS, "what": "unit of a command", "allowed": ", ".join(UNITS), "needed": True}
COMMAND: Rule = {
    "is": "variant", "by": "shape", "what": "command",
    "allowed": "a table with a shape, a unit and what the shape is given by",
    "choice": {"what": "shape of a command", "allowed": ", ".join(FIELDS)},
    "tables": {shape: {
        "is": "table", "unknown": f"field of a command of shape {shape}", "known": ("unit", *names),
        "fields": {"shape": {"is": "word", "of": (shape,), "what": "shape", "allowed": shape}, "unit": _UNIT,
                   **{name: _field(shape, name) for name in names}}} for shape, names in FIELDS.items()}}
_OF_CONTROL = "{name} of the control circuit"
CONTROL: Rule = {"is": "table", "some": True, "what": "control circuit",
                 "allowed": f"a table of {', '.join(CONTROL_FIELDS)}", "fields": {
                     **{name: _span(_OF_CONTROL, 0.0, 1.0) for name in CONTROL_FIELDS[:2]},
                     CONTROL_FIELDS[2]: number(_OF_CONTROL, "a number of seconds, 0 or more", 0.0)}}
ACTIONS: dict[str, Rule] = {
    "command": COMMAND,
    "set": {"is": "table", "some": True, "what": "numbers to set",
            "allowed": "a table of dotted names and values in SI",
            "each": {"is": "number or text", "what": "{name}", "allowed": "a finite number in SI, or a word"}},
    "push": number("push", f"a torque of at most {_MOST_PUSH:g} N m", -_MOST_PUSH, _MOST_PUSH),
    "frames": {"is": "table", "some": True, "what": "frames", "allowed": "a table of rate [Hz] and lost [share]",
               "fields": {"rate": _span("frames: rate", *RATES), "lost": _span("frames: lost", 0.0, 1.0)}},
    "register": {"is": "table", "some": True, "what": "registers",
                 "allowed": "a table of the maker's names and whole numbers",
                 "each": {"is": "whole", "what": "register {name}", "allowed": "a whole number"}},
    "torque": {"is": "truth", "what": "torque", "allowed": "true or false"},
    "control": CONTROL}
"""Actions at a bench, by kind."""
FOR_ALL = ("frames", "control")
"""Kinds of actions that no single servo hears."""


def _numbers(key: str, names: tuple[str, ...]) -> Rule:
    return {"is": "table", "what": f"{key} of a scene", "allowed": f"a table [{key}]", "unknown": f"{key} of a scene",
            "fields": {name: number(f"{key}.{name} of a scene", "a finite number in SI") for name in names}}


VIEW: Rule = {"is": "table", "names": r"[\w.-]{1,60}", "what": "view", "told": "type",
              "allowed": "a table of words, numbers, true and false",
              "each": {"is": "plain", "what": "view", "allowed": "a table of words, numbers, true and false"}}
_OF_SERVO = "{name} of a servo of a scene"
_WORDS_OF_SERVO: dict[str, Any] = {
    "is": "text", "most": 200_000, "what": _OF_SERVO, "told": "type", "allowed": "a text"}
SOURCES = ("id", "file", "mystery")
"""Where the numbers of a scene's servo come from: one of these."""
SERVO: Rule = {
    "is": "table", "what": "servo of a scene", "allowed": "a table [[servo]]", "unknown": "key of a servo of a scene",
    "fields": {
        "id": _WORDS_OF_SERVO, "file": _WORDS_OF_SERVO,
        "mystery": {"is": "whole", "low": 0, "high": _SEEDS, "what": _OF_SERVO,
                    "allowed": "a whole number of at least 0"},
        "model": {**_WORDS_OF_SERVO, "usual": ""},
        "parameters": {"is": "table", "what": _OF_SERVO, "allowed": "a table of names and values", "usual": {},
                       "each": {"is": "number or text", "what": "parameters: {name}",
                                "allowed": "a finite number in SI, or a word"}},
        "registers": {"is": "table", "what": _OF_SERVO, "allowed": "a table of names and values", "usual": {},
                      "each": {"is": "whole", "what": "registers: {name}", "allowed": "a whole number"}}}}
SCENE: dict[str, Rule] = {
    "name": {"is": "text", "most": LONGEST_NAME, "what": "name of a scene",
             "without": HIDDEN.pattern, "usual": "",
             "allowed": f"a text of at most {LONGEST_NAME} characters, none of them a control or bidirectional one"},
    "seed": {"is": "whole", "low": 0, "high": _SEEDS, "what": "seed of a scene",
             "allowed": "a whole number of at least 0", "usual": 0},
    "frame_rate": _span("frame_rate of a scene", *RATES, usual=FRAME_RATE),
    "end": _span("end of a scene", 0.0, LONGEST, usual=0.0),
    "load": _numbers("load", LOAD_FIELDS), "supply": _numbers("supply", SUPPLY_FIELDS), "control": CONTROL}
"""Parts of a scene beside its servos, its actions, its view and its lesson."""

_SHOWN = {"time": "us", "angle": "deg", "inertia": "g cm2", "inductance": "mH", "torque": "mN m",
          "torque per current": "mN m/A"}
"""Units in which people read some dimensions; SI else."""


def shown_in(dimension: str) -> dict[str, Any]:
    """Return the unit in which the page shows a dimension, and how much of SI one of it is.

    Examples
    --------
    >>> shown_in("torque"), shown_in("word")
    ({'unit': 'mN m', 'factor': 0.001}, {'unit': '', 'factor': 1.0})
    """
    unit = "" if dimension == "word" else _SHOWN.get(dimension, si_unit(dimension))
    return {"unit": unit, "factor": factor(unit, dimension) if unit else 1.0}
