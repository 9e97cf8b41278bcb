"""Whether the numbers of a servo lie where those of servos do: one that does not is probably in another unit."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from servotwin.errors import PlausibilityWarning
from servotwin.parameters.groups import GROUPS
from servotwin.parameters.output_side import OUTPUT_SIDE
from servotwin.units import DIMENSIONS, factor, si_unit

if TYPE_CHECKING:
    from servotwin.parameters.group import Plausible
    from servotwin.parameters.servo import Servo

AT_OUTPUT = {member: side.power for side in OUTPUT_SIDE.values() for member in side.members}
"""Parameters whose range holds at the output shaft, and the power of the reduction N that leads there.

Behind a reduction of 1 a servo file may give its motor as the output shaft sees it.
"""

_SMALLEST = 1e-5  # of the high end: what is smaller in another unit is hardly meant
_CELSIUS = 273.15


def plausible_range(name: str, reduction: float | None = None) -> Plausible | None:
    """Return between which numbers (SI) a parameter is plausible; None of a word.

    Parameters
    ----------
    name : str
        Dotted.
    reduction : float, optional
        Of the servo's gear; unless given, the range of a parameter of `AT_OUTPUT` is that at the output shaft [1].

    Examples
    --------
    >>> plausible_range("electronics.deadband")[:2], plausible_range("motor.torque_constant", 300.0)[1]
    ((1e-07, 0.0005), 0.1)
    """
    group, _, key = name.partition(".")
    found: Plausible | None = GROUPS[group].__dataclass_fields__[key].metadata["plausible"]
    if found is None or reduction is None or name not in AT_OUTPUT:
        return found
    by = reduction ** AT_OUTPUT[name]
    return found._replace(low=found.low / by, high=found.high / by)


def oddity(servo: Servo, name: str, unit: str | None = None) -> str | None:
    """Return in one line what is odd about a value of a servo, and which unit was probably meant; None of another.

    0 is never odd: it says that an effect is off.

    Parameters
    ----------
    servo : Servo
    name : str
        Dotted; of a parameter that the servo gives.
    unit : str, optional
        In which it was given; the SI unit unless given.

    Examples
    --------
    >>> from servotwin.parameters.servo import servo_from_values
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     servo = servo_from_values("mine", {"electronics": {"deadband": 8.0}})
    >>> oddity(servo, "electronics.deadband")
    'mine: electronics.deadband of 8 s is not plausible (1e-07 to 0.0005 s): 8 us?'
    """
    reduction = servo.gear.gear_reduction
    found, value = plausible_range(name, reduction), servo.get(name)
    if found is None or value is None or isinstance(value, str):
        return None
    values = value if isinstance(value, tuple) else (value,)
    odd = next((one for one in values if one != 0.0 and not found.low <= one <= found.high), None)
    if odd is None:
        return None
    group, _, key = name.partition(".")
    dimension = str(GROUPS[group].__dataclass_fields__[key].metadata["dimension"])
    given = si_unit(dimension) if unit is None else unit
    number, by = odd / factor(given, dimension), factor(given, dimension)
    behind = f" behind a reduction of {reduction:g}" if name in AT_OUTPUT and reduction is not None else ""
    meant = _meant(number, given, dimension, found)
    shown = "" if given == "1" else f" {given}"
    return (f"{servo.name}: {name} of {number:.6g}{shown} is not plausible ({found.low / by:.4g} to "
            f"{found.high / by:.4g}{shown}{behind})" + (f": {number:.6g} {meant}?" if meant else ""))


def warn_of(servo: Servo, names: Iterable[str], unit: Callable[[str], str | None] = lambda name: None, *,
            stacklevel: int = 3) -> None:
    """Warn of each value that is not plausible.

    Parameters
    ----------
    servo : Servo
    names : iterable of str
        Dotted; those that the servo does not give are passed over.
    unit : callable
        Says in which unit one was given; None: in SI.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    for name in names:
        text = oddity(servo, name, unit(name))
        if text is not None:
            warnings.warn(text, PlausibilityWarning, stacklevel=stacklevel)


def _meant(number: float, given: str, dimension: str, within: Plausible) -> str:
    """Return the first other unit in which a number is plausible; empty where there is none."""
    if dimension == "temperature":
        return "deg C" if within.low <= number + _CELSIUS <= within.high else ""
    least = _SMALLEST * max(abs(within.low), within.high)
    return next((unit for unit, by in DIMENSIONS[dimension].items() if unit not in (given, "%")
                 and within.low <= number * by <= within.high and abs(number) * by >= least), "")
