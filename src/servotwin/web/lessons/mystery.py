"""A mystery servo: one of which some numbers are hidden behind a seed, to be found by measuring."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import InputError, UnknownNameError
from servotwin.parameters import load_servo
from servotwin.parameters.servo import unit_of
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters import Servo
    from servotwin.web.live.scene import Scene

BASE = "hitec-hs-755hb"
"""The servo that it is made of."""
_GOOD, _FAIR = 0.05, 0.15  # of the truth


class Hidden(NamedTuple):
    """A number that is hidden: its name, what it is, and the range it is drawn from, as factors of the base's."""

    name: str
    meaning: str
    low: float
    high: float


HIDDEN = (
    Hidden("electronics.deadband", "full width of the deadband", 0.75, 4.0),
    Hidden("electronics.stretcher_gain", "drive time per pulse error", 0.4, 1.8),
    Hidden("motor.armature_resistance", "resistance of motor and bridge", 0.7, 1.6),
    Hidden("motor.rotor_inertia", "inertia of the rotor", 0.4, 3.0),
    Hidden("friction.coulomb_torque", "friction at the motor, both ways alike", 0.5, 2.0),
)
"""What is hidden."""
_BOTH_WAYS = ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward")


def mystery_servo(seed: int) -> Servo:
    """Return the servo behind a seed.

    Examples
    --------
    >>> mystery_servo(7) == mystery_servo(7), mystery_servo(7).name
    (True, 'mystery')
    """
    values: dict[str, float | str | tuple[float, ...] | None] = {}
    for name, value in truth(seed).items():
        values |= dict.fromkeys(_BOTH_WAYS, value) if name == "friction.coulomb_torque" else {name: value}
    return replace(load_servo(BASE), name="mystery", title=f"Mystery servo {seed}").replace(values)


def mystery_scene(seed: object) -> Scene:
    """Return a bench with the servo behind a seed.

    Raises
    ------
    InputError
        If it is no seed.
    """
    from servotwin.web.live.scene import Scene
    from servotwin.web.live.scene_servo import SceneServo

    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
        raise InputError("seed of a mystery servo", got=seed, allowed="a whole number from 0 to 2147483647")
    return Scene(servos=(SceneServo(mystery=seed, model="PulseServo"),), name=f"Mystery servo {seed}")


def truth(seed: int) -> dict[str, float]:
    """Return the hidden numbers behind a seed (SI), each drawn evenly over the logarithm of its range."""
    base, draw = load_servo(BASE), random.Random(f"mystery {seed}")
    found = {}
    for name, _, low, high in HIDDEN:
        usual: Any = base.get(_BOTH_WAYS[0] if name == "friction.coulomb_torque" else name)
        found[name] = float(usual) * low * (high / low) ** draw.random()
    return found


def unknowns() -> list[dict[str, Any]]:
    """Return what is hidden and from which range it is drawn (SI), for the page.

    Examples
    --------
    >>> unknowns()[0]["name"], unknowns()[0]["unit"]
    ('electronics.deadband', 's')
    """
    base, found = load_servo(BASE), []
    for name, meaning, low, high in HIDDEN:
        own = _BOTH_WAYS[0] if name == "friction.coulomb_torque" else name
        usual: Any = base.get(own)
        found.append({"name": name, "meaning": meaning, "unit": unit_of(own), "low": low * usual, "high": high * usual})
    return found


def compare(seed: int, guess: object) -> list[dict[str, Any]]:
    """Return truth and guess side by side, with the error as a share of the truth.

    Parameters
    ----------
    seed : int
    guess : mapping of str to float
        By the names of `HIDDEN` (SI); what is left out counts as not guessed.

    Raises
    ------
    InputError
        If it holds anything else.

    Examples
    --------
    >>> compare(7, truth(7))[0]["said"]
    'found'
    """
    if not isinstance(guess, Mapping) or not guess:
        raise InputError("guess", got=guess, allowed="a table of numbers in SI")
    hidden = truth(seed)
    for name, value in guess.items():
        if name not in hidden:
            raise UnknownNameError("number of a mystery servo", str(name), tuple(hidden))
        if not is_finite(value):
            raise InputError(f"guess of {name}", got=value, allowed="a finite number in SI")
    rows = []
    for name, value in hidden.items():
        error = None if name not in guess else float(guess[name]) / value - 1.0
        said = ("not guessed" if error is None else "found" if abs(error) <= _GOOD else "near" if abs(error) <= _FAIR
                else "off")
        rows.append({"name": name, "truth": value if error is not None else None, "guess": guess.get(name),
                     "error": error, "said": said})
    return rows


def is_hidden(name: str) -> bool:
    """Tell whether a parameter of a mystery servo is not shown.

    Examples
    --------
    >>> is_hidden("electronics.deadband"), is_hidden("gear.gear_reduction")
    (True, False)
    """
    return name in _BOTH_WAYS or any(name == one.name for one in HIDDEN)
