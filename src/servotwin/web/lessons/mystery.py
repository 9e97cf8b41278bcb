"""A mystery servo: one of which some numbers are hidden behind a seed, to be found by measuring."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import InputError, UnknownNameError
from servotwin.models.state.noise import drawn
from servotwin.parameters import load_servo
from servotwin.parameters.servo import dimension_of, unit_of
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters import Servo

BASE = "hitec-hs-755hb"
"""The servo that it is made of."""
FRICTION = "friction.coulomb_torque"
SEEDS = 2**31 - 1
GOOD, FAIR = 0.05, 0.15  # of the truth


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
    Hidden(FRICTION, "friction at the motor, both ways alike", 0.5, 2.0),
)
"""The hidden numbers."""
BOTH_WAYS = ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward")


def mystery_servo(seed: int) -> Servo:
    """Return the servo behind a seed.

    Examples
    --------
    >>> mystery_servo(7) == mystery_servo(7), mystery_servo(7).name
    (True, 'mystery')
    """
    values: dict[str, float | str | tuple[float, ...] | None] = {}
    for name, value in truth(seed).items():
        values |= dict.fromkeys(BOTH_WAYS, value) if name == FRICTION else {name: value}
    return replace(load_servo(BASE), name="mystery", title=f"Mystery servo {seed}").replace(values)



def truth(seed: int) -> dict[str, float]:
    """Return the hidden numbers behind a seed (SI), each drawn evenly over the logarithm of its range."""
    return {one["name"]: drawn(seed, k, one["low"], one["high"]) for k, one in enumerate(unknowns())}



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
        said = ("not guessed" if error is None else "found" if abs(error) <= GOOD else "near" if abs(error) <= FAIR
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
    return name in BOTH_WAYS or any(name == one.name for one in HIDDEN)


def known_of(now: Servo) -> Servo:
    """Return what a pupil sees of a mystery servo: the base servo, with what was changed at the bench in sight.

    Parameters
    ----------
    now : Servo
        The mystery servo with its numbers of now.

    Examples
    --------
    >>> known = known_of(mystery_servo(7).replace({"supply.open_circuit_voltage": 5.0}))
    >>> known.supply.open_circuit_voltage, known.motor == load_servo(BASE).motor
    (5.0, True)
    """
    base = load_servo(BASE)
    seen = {name: now.get(name) for name in now.names() if not is_hidden(name) and now.get(name) != base.get(name)}
    return base.replace(seen)


def sought() -> dict[str, tuple[float, float]]:
    """Return what a fit of a mystery servo searches, and between which values (SI): what the page tells of it.

    Friction is sought at the output, where both ways are one number.

    Examples
    --------
    >>> list(sought())[-1]
    'output_coulomb_torque'
    """
    reduction: Any = load_servo(BASE).get("gear.gear_reduction")
    found = {}
    for one in unknowns():
        at_output = one["name"] == FRICTION
        times = reduction if at_output else 1.0
        found["output_coulomb_torque" if at_output else one["name"]] = (times * one["low"], times * one["high"])
    return found


def guess_of(servo: Servo, unsure: Collection[str] = ()) -> dict[str, float]:
    """Return the guess that a fitted servo is, by the names of `HIDDEN` (SI), without what the fit is not sure of.

    Examples
    --------
    >>> compare(7, guess_of(mystery_servo(7)))[4]["said"], len(guess_of(mystery_servo(7), ["electronics.deadband"]))
    ('found', 4)
    """
    found = {}
    for name, *_ in HIDDEN:
        friction = name == FRICTION
        value: Any = servo.get(BOTH_WAYS[0] if friction else name)
        if ("output_coulomb_torque" if friction else name) not in unsure and isinstance(value, float):
            found[name] = value
    return found



def unknowns() -> list[dict[str, Any]]:
    """Return what is hidden and from which range it is drawn (SI), for the page.

    Examples
    --------
    >>> unknowns()[0]["name"], unknowns()[0]["unit"]
    ('electronics.deadband', 's')
    """
    from servotwin.web.live.rules import shown_in

    base, found = load_servo(BASE), []
    for name, meaning, low, high in HIDDEN:
        own = BOTH_WAYS[0] if name == FRICTION else name
        usual: Any = base.get(own)
        found.append({"name": name, "meaning": meaning, "unit": unit_of(own), "low": low * usual, "high": high * usual,
                      "shown": shown_in(dimension_of(own))})
    return found
