"""Servo and model out of the words of an argument SERVO and the options `--model` and `--set`."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from servotwin.models import Model
    from servotwin.parameters import Servo


def class_of(name: str, among: Sequence[str] | None = None) -> type[Model]:
    """Return the class of a model by the name that `--model` has for it.

    Parameters
    ----------
    name : str
    among : sequence of str, optional
        Names that are allowed; all unless given.

    Raises
    ------
    UnknownNameError
        If there is none of this name.

    Examples
    --------
    >>> class_of("pulse").__name__
    'PulseServo'
    """
    from servotwin.errors import UnknownNameError
    from servotwin.models import MODELS

    if name not in (among or MODELS):
        raise UnknownNameError("model", name, among or MODELS)
    return MODELS[name]


def model_of(servo: str, name: str | None, change: Sequence[str], among: Sequence[str] | None = None,
             register: Sequence[str] = (), supply: str | None = None, assumed: Sequence[str] = ()) -> Model:
    """Return the model of a servo.

    Parameters
    ----------
    servo : str
        Id in the catalog, or path of a servo file.
    name : str or None
        Of the model; None: the one that stands for this servo.
    change : sequence of str
        Words of `--set`.
    among : sequence of str, optional
        Names that are allowed; all unless given.
    register : sequence of str
        Words of `--register`; they come first.
    supply : str, optional
        Words of `--supply`; what `--set` says comes after it.
    assumed : sequence of str
        Sets of registers that nobody said; those of `--register` go before them.

    Raises
    ------
    ServotwinError
        If servo, model, a register or a changed parameter is not known or not possible.

    Examples
    --------
    >>> model_of("hitec-hs-755hb", "bounded", ["motor.armature_resistance=3.1"])
    BoundedServo('hitec-hs-755hb')
    """
    from servotwin.models import default_model

    kind = None if name is None else class_of(name, among)
    changed = servo_of(servo, change, register, supply, assumed)
    return default_model(changed) if kind is None else kind(changed)


def servo_of(servo: str, change: Sequence[str], register: Sequence[str] = (), supply: str | None = None,
             assumed: Sequence[str] = ()) -> Servo:
    """Return a servo with the registers of `--register`, on the supply of `--supply`, as `--set` changes it.

    Examples
    --------
    >>> servo_of("hitec-hs-755hb", ["motor.armature_resistance=3.1"]).motor.armature_resistance
    3.1
    """
    from servotwin.cli.register_words import with_registers
    from servotwin.cli.settings import settings
    from servotwin.parameters import load_servo
    from servotwin.parameters.registers.held import register_family_of
    from servotwin.parameters.registers.table import set_registers

    plain = load_servo(servo)
    for name in assumed:
        plain = set_registers(register_family_of(plain), name, plain, assumed=True)
    known = found = with_registers(plain, register)
    if supply is not None:
        from servotwin.datasheet.conditions import on_supply
        from servotwin.parameters import Supply

        found = on_supply(found, Supply.of(supply, what="--supply"), source="set by --supply")
    made = found.replace(settings(change), source="set by --set") if change else found
    volts = made.supply.open_circuit_voltage
    if volts is not None and volts != known.supply.open_circuit_voltage:
        _check_sheet(known, volts)
    return made


def _check_sheet(servo: Servo, volts: float) -> None:
    """Warn of a supply far from the maker's sheet; of twice as much simulations themselves do."""
    from servotwin.datasheet.conditions import highest_voltage, is_above_sheet, is_below_sheet, lowest_voltage

    most = highest_voltage(servo)
    if is_below_sheet(servo, volts):
        warnings.warn(f"{servo.name}: its sheet begins at {lowest_voltage(servo):g} V, and the supply has {volts:g} V",
                      UserWarning, stacklevel=3)
    if is_above_sheet(servo, volts) and volts <= 2.0 * most:
        warnings.warn(f"{servo.name}: its sheet ends at {most:g} V, and the supply has {volts:g} V", UserWarning,
                      stacklevel=3)
