"""Masses, arms and torques out of the words of `--lift`, `--arm` and `--load`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from servotwin.cli.load_words import FORMS, mass_on_arm, parts_of, torque_of
from servotwin.errors import InputError
from servotwin.units.quantities import quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

_HERE = ("arm", "torque")  # parts of a load that a sheet takes


class AskedLift(NamedTuple):
    """What is to be lifted, mass [kg] and arm [m], and a torque [N m] whose point on the curves is shown."""

    lift: tuple[float, float] | None
    torque: float | None


def asked_lift(lift: str | None, arm: str | None) -> tuple[float, float] | None:
    """Return mass [kg] and arm [m] of `--lift` and `--arm`; None where neither is given.

    Raises
    ------
    InputError
        If one of them is missing or malformed.

    Examples
    --------
    >>> asked_lift("500g", "10cm")
    (0.5, 0.1)
    """
    if lift is None and arm is None:
        return None
    if lift is None or arm is None:
        raise InputError("--arm needs --lift MASS" if lift is None else "--lift needs --arm LENGTH",
                         allowed="both, such as --lift 0.5kg --arm 10cm")
    return quantity("--lift", lift, "mass", positive=True), quantity("--arm", arm, "length", positive=True)


def loads_of(lift: str | None, arm: str | None, load: Sequence[str]) -> AskedLift:
    """Return what the options ask for.

    Raises
    ------
    InputError
        If something is asked for twice, or the load has a part that no sheet takes.

    Examples
    --------
    >>> loads_of(None, None, ["arm=0.5kg:10cm", "torque=0.3"])
    AskedLift(lift=(0.5, 0.1), torque=0.3)
    """
    found, torque = asked_lift(lift, arm), None
    for name, value in parts_of(load):
        if name not in _HERE:
            raise InputError(f"--load {name} of servotwin curves",
                             allowed=" or ".join(f"{part}={FORMS[part]}" for part in _HERE)
                             + "; servotwin simulate takes all loads")
        if (name == "arm" and found is not None) or (name == "torque" and torque is not None):
            raise InputError(f"--load {name}", got=value, allowed="one of a kind, and not beside --lift")
        if name == "arm":
            found = mass_on_arm(value)
        else:
            torque = torque_of(value)
    return AskedLift(found, torque)
