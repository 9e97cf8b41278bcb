"""Unlike servos of one kind side by side: what differs among them, as numbers of each."""

from __future__ import annotations

from collections.abc import Sequence

from servotwin.errors import InputError
from servotwin.models import Model

OF_THE_BUS = ("supply.open_circuit_voltage", "supply.internal_resistance", "supply.current_limit")
"""What servos on a shared supply have from that."""
_SHARE, _SHARES = "friction.load_friction", ("friction.load_friction_motor", "friction.load_friction_external")
_ABSENT = {  # numbers that say the same as nothing: those of files that change least
    "firmware.duty_slew": 1e5, "firmware.undervoltage": 0.5, "motor.motor_viscous_friction": 0.0,
    "motor.brush_drop_voltage": 0.0, "supply.bridge_drop_voltage": 0.0, "supply.bridge_drop_resistance": 0.0,
    **dict.fromkeys(_SHARES, 0.0),
}


def of_one_form(models: Sequence[Model]) -> list[Model]:
    """Return models in which load friction is written alike: one share as two equal ones, where others have two."""
    if not any(model.servo.get(name) is not None for model in models for name in _SHARES):
        return list(models)
    found = []
    for model in models:
        share = model.servo.get(_SHARE)
        found.append(model if share is None else type(model)(model.servo.replace(
            {_SHARE: None, **dict.fromkeys(_SHARES, float(share))})))  # type: ignore[arg-type]
    return found


def differing(models: Sequence[Model], names: Sequence[str]) -> dict[str, list[float | str]]:
    """Return what differs among models, of one form and kind, by name.

    Parameters
    ----------
    models : sequence of Model
    names : sequence of str
        Of the joints, for the words.

    Raises
    ------
    InputError
        If one has a number that another lacks, and no number says the same as none.
    """
    found: dict[str, list[float | str]] = {}
    first = models[0]
    for name in (*first.requires, *first.optional):
        values = [model.servo.get(name) for model in models]
        if all(value == values[0] for value in values):
            continue
        known = [_ABSENT.get(name) if value is None else value for value in values]
        usable = [value for value in known if isinstance(value, int | float | str)]
        if len(usable) < len(known):
            absent = next(joint for joint, value in zip(names, known, strict=True)
                          if not isinstance(value, int | float | str))
            raise InputError(f"{name} of servos side by side", got=f"none at joint {absent}",
                             allowed="a number of each servo, or of none: give it in its file")
        found[name] = usable
    return found
