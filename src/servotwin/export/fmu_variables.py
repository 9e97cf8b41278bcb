"""The variables of an FMU: what a co-simulation sets and reads of a servo, with units, bounds and references."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

from servotwin.models.terms.given import field_of
from servotwin.parameters.group import AT_LEAST_ONE, FRACTION, NOT_NEGATIVE, POSITIVE
from servotwin.parameters.groups import GROUPS
from servotwin.units import si_unit

TIME, COMMAND, TORQUE, ANGLE, FRAMES_BEGIN, FIRST_SIGNAL, FIRST_PARAMETER = 0, 1, 2, 3, 4, 10, 100
_BOUNDS = {POSITIVE: (0.0, math.inf, True), NOT_NEGATIVE: (0.0, math.inf, False), AT_LEAST_ONE: (1.0, math.inf, False),
           FRACTION: (0.0, 1.0, False)}
_BASE: dict[str, dict[str, int]] = {
    "kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "A": {"A": 1}, "K": {"K": 1}, "rad": {"rad": 1}, "1": {},
    "Hz": {"s": -1}, "N": {"kg": 1, "m": 1, "s": -2}, "J": {"kg": 1, "m": 2, "s": -2}, "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2}}
_FACTOR = re.compile(r"([A-Za-z]+|1)(\d*)")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU.

    Parameters
    ----------
    name : str
    reference : int
        FMI's value reference.
    causality : {"independent", "input", "output", "parameter"}
    unit, meaning : str
    start : float or None
        None of what is computed.
    low, high : float
        Bounds of what may be set; infinite where there are none.
    is_open : bool
        Whether the lower one is excluded.
    said : str
        Bounds in words, where numbers do not tell them.
    """

    name: str
    reference: int
    causality: str
    unit: str
    meaning: str
    start: float | None = None
    low: float = -math.inf
    high: float = math.inf
    is_open: bool = False
    said: str = ""

    @property
    def allowed(self) -> str:
        """The bounds in words."""
        if self.said:
            return self.said
        if self.low == -math.inf and self.high == math.inf:
            return "a finite number"
        if self.high == math.inf:
            return f"{'more than' if self.is_open else 'at least'} {self.low:g}"
        return f"from {self.low:g} to {self.high:g}"


def inputs_of(goals: bool, command: float, low: float, high: float) -> tuple[Variable, Variable]:
    """Return command and torque, which are held over a step."""
    name, unit = ("command_angle", "rad") if goals else ("pulse_width", "s")
    meaning = "goal that the servo is told" if goals else "width of the pulses that the servo is told"
    said = "" if goals else "a width of more than 0 and less than a frame [s], from the first step on"
    return (Variable(name, COMMAND, "input", unit, meaning, command, low, high, said=said),
            Variable("external_torque", TORQUE, "input", "N m",
                     "torque beside that of the load; positive pushes towards smaller angles", 0.0))


def beginning_of(angle: float, frames: bool) -> Iterator[Variable]:
    """Yield where the servo rests at first, and when its first pulse comes where it has frames."""
    yield Variable("start.output_angle", ANGLE, "parameter", "rad", "where the shaft rests at first", angle)
    if frames:
        yield Variable("start.frames_begin", FRAMES_BEGIN, "parameter", "s",
                       "when the first frame begins, less than a frame period after the start", 0.0, 0.0)


def signals_of(named: list[tuple[str, str, str]]) -> list[Variable]:
    """Return the signals of names, units and meanings."""
    return [Variable(name, FIRST_SIGNAL + k, "output", unit, meaning) for k, (name, unit, meaning) in enumerate(named)]


def parameters_of(values: dict[str, float]) -> list[Variable]:
    """Return the parameters of dotted names."""
    found = []
    for k, (name, value) in enumerate(values.items()):
        metadata = metadata_of(name)
        low, high, is_open = _BOUNDS.get(metadata["rule"], (-math.inf, math.inf, False))
        found.append(Variable(name, FIRST_PARAMETER + k, "parameter", si_unit(metadata["dimension"]),
                              str(metadata["meaning"]), value, low, high, is_open))
    return found


def metadata_of(name: str) -> Any:
    """Return what a group says of a parameter by its dotted name."""
    title, _, own = name.partition(".")
    return next(f.metadata for f in fields(GROUPS[title]) if f.name == own)


def numbers_of(model: Any) -> dict[str, float]:
    """Return the parameters of a model that are given and are numbers, by dotted name."""
    found = {}
    for name in (*model.requires, *model.optional):
        rule, value = metadata_of(name)["rule"], getattr(model.given, field_of(name), math.nan)
        if isinstance(rule, str) and rule != "table" and not math.isnan(value):
            found[name] = float(value)
    return found


def base_units(unit: str) -> dict[str, int]:
    """Return the exponents of SI's base units, and of the radian, in a unit as the package writes it.

    Examples
    --------
    >>> base_units("N m s/rad"), base_units("1/(rad s)")
    ({'kg': 1, 'm': 2, 's': -1, 'rad': -1}, {'rad': -1, 's': -1})
    """
    above, _, below = unit.partition("/")
    powers: dict[str, int] = {}
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for symbol, power in _FACTOR.findall(part):
            for base, own in _BASE[symbol].items():
                powers[base] = powers.get(base, 0) + sign * own * int(power or 1)
    return {base: power for base, power in powers.items() if power}
