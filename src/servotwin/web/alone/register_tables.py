"""What registers make of a bus servo's program, as tables: for each the pieces of straight lines that it moves.

The registers of a catalog servo are written by the package's own laws, value by value; where a register does not go by
few straight lines it has no table, and the page says that only a server writes it.
"""

from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING, Any

from servotwin.errors import ParameterError
from servotwin.parameters.firmware import Firmware
from servotwin.parameters.group import RULES
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.table import Family, Setting, family_label, written
from servotwin.web.live.registers import register_facts

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo

_MOST_PIECES = 8
_ALL = 1100  # values that are all tried; of more, the ends and some between
_ENDS, _BETWEEN = 70, 400
_SAME = 1e-12

Made = tuple[Any, ...] | None  # what the numbers of a register are at a value; None: the value is refused


def register_tables(model: Model) -> list[dict[str, Any]] | None:
    """Return the registers of a servo that the page can write, as plain data; None of a servo without.

    Examples
    --------
    >>> import servotwin as st
    >>> tables = register_tables(st.DigitalServo(st.load_servo("feetech-sts3215-12v")))
    >>> one, = (table for table in tables if table["name"] == "P_Coefficient")
    >>> one["numbers"], len(one["pieces"]), one["shared"]
    (['firmware.proportional_gain'], 1, [])
    """
    servo = model.servo
    label, facts = family_label(servo), register_facts(servo)
    if label is None or facts is None:
        return None
    family = register_family_of(servo)
    return [table for one in facts if (table := _table(family, servo, one)) is not None]


def family_names(servo: Servo) -> dict[str, Any] | None:
    """Return what the family of a servo's registers is called, and the names of all of them; None without.

    Examples
    --------
    >>> import servotwin as st
    >>> family_names(st.load_servo("feetech-sts3215-12v"))["names"][:2]
    ['P_Coefficient', 'D_Coefficient']
    """
    label = family_label(servo)
    if label is None:
        return None
    family = register_family_of(servo)
    return {"label": label, "names": [*family.registers, *family.other_names]}


def _table(family: Family, servo: Servo, facts: dict[str, Any]) -> dict[str, Any] | None:
    name = facts["name"]
    moved = [other for other, source in family.copied.items() if source == name]
    settings = [one for one in family.settings if any(own in one.registers for own in (name, *moved))]
    raw, register = written(family, servo), family.registers[name]

    def made(value: int) -> Made:
        now = {**raw, name: value, **dict.fromkeys(moved, value)}
        try:
            family.check(now)
        except ParameterError:
            return None
        found = tuple(one.value(now, servo) for one in settings)
        return found if all(map(_fits, settings, found)) else None

    values = register.only or _values(register.lower, register.upper)
    pieces = _pieces([(value, made(value)) for value in values])
    if len(pieces) > _MOST_PIECES:
        return None
    shared = sorted({other for one in settings for other in one.registers} - {name, *moved, *family.masks})
    return {**facts, "numbers": [f"firmware.{one.name}" for one in settings], "pieces": pieces,
            "shared": [*shared, *(mask for mask in family.masks if any(mask in one.registers for one in settings)
                                  and mask != name)],
            "what": f"register {name} ({register.address}) of {family.model if family.reference else family.label}",
            "allowed": register.allowed}


def _fits(setting: Setting, value: Any) -> bool:
    """Tell whether a number of the firmware keeps its rule."""
    rule = Firmware.__dataclass_fields__[setting.name].metadata["rule"]
    if not isinstance(value, float) or rule not in RULES:
        return True
    low, high, open_ = RULES[rule]
    return bool((low < value if open_ else low <= value) and value <= high)


def _values(low: int, high: int) -> list[int]:
    """Return values of a register from the lowest to the highest, all of them where there are few."""
    if high - low <= _ALL:
        return list(range(low, high + 1))
    rng = random.Random(0)
    ends = {one for n in range(_ENDS) for one in (low + n, high - n)}
    about_powers = {sign * 2**k + d for k in range(31) for d in (-1, 0, 1) for sign in (-1, 1)}
    some = {rng.randint(low, high) for _ in range(_BETWEEN)}
    return sorted(one for one in ends | about_powers | some if low <= one <= high)


def _pieces(made: list[tuple[int, Made]]) -> list[list[Any]]:
    """Return pieces of straight lines: from which value on, the numbers there, and by how much they grow a step."""
    found: list[list[Any]] = []
    n = 0
    while n < len(made):
        start, at = made[n]
        if at is None:
            found.append([start])
            n += 1
            while n < len(made) and made[n][1] is None:
                n += 1
            continue
        slopes: tuple[float, ...] = (0.0,) * len(at)
        if n + 1 < len(made) and made[n + 1][1] is not None:
            over, after = made[n + 1][0] - start, made[n + 1][1]
            slopes = tuple((b - a) / over if isinstance(a, float) and isinstance(b, float) else 0.0
                           for a, b in zip(at, after or (), strict=True))
        found.append([start, list(at), list(slopes)])
        n += 1
        while n < len(made) and _on_line(made[n][1], made[n][0] - start, at, slopes):
            n += 1
    return found


def _on_line(now: Made, steps: int, at: tuple[Any, ...], slopes: tuple[float, ...]) -> bool:
    return now is not None and all(
        math.isclose(value, first + slope * steps, rel_tol=_SAME, abs_tol=1e-15)
        if isinstance(value, float) and isinstance(first, float) else value == first
        for value, first, slope in zip(now, at, slopes, strict=True))
