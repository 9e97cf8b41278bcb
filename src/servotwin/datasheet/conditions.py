"""The same servo at another supply voltage, or warm."""

from __future__ import annotations

import contextlib
import warnings
from typing import TYPE_CHECKING, Any, TypeVar

from servotwin.errors import InputError
from servotwin.parameters import operating_voltages, sheet_voltages
from servotwin.parameters.quantity import SET_BY_USER
from servotwin.physics import Temperatures, magnet_factor, winding_resistance
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Iterator

    from servotwin.models import Model
    from servotwin.parameters import Servo, Supply

_Model = TypeVar("_Model", bound="Model")
_MOST = 2.0  # times the highest voltage that the sheet prints
_ABOVE = 1.25  # times that, at which nobody is told to buy a servo whose range no sheet states; assumed
_BELOW = 0.9  # times the lowest: a servo for 12 V runs on three cells, which are called 11.1 V; assumed, likewise
_THERMAL = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient", "ambient",
            "magnet_coefficient")


def highest_voltage(servo: Servo) -> float:
    """Return the highest supply voltage of the sheet [V].

    The upper end of the range that the maker states; without one the highest voltage that figures are printed for, and
    without such figures that of the servo.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> highest_voltage(load_servo("gobilda-2000-135")), highest_voltage(load_servo("towerpro-mg996r"))
    (7.4, 7.2)
    """
    found = sheet_voltages(servo)
    return (servo.supply.open_circuit_voltage or 0.0) if found is None else found[1]


def is_above_sheet(servo: Servo, voltage: float) -> bool:
    """Tell whether a supply voltage [V] is so far above the highest of a sheet that the servo may not bear it.

    That is above the range that the maker states, or far above the figures of a sheet that states none.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [is_above_sheet(load_servo("gobilda-2000-135"), volts) for volts in (8.4, 12.0)]
    [False, True]
    >>> is_above_sheet(load_servo("towerpro-mg996r"), 7.4)
    True
    """
    most = highest_voltage(servo)
    return voltage > (most if operating_voltages(servo) else _ABOVE * most) > 0.0


def lowest_voltage(servo: Servo) -> float:
    """Return the lowest supply voltage of the sheet; 0 without one [V].

    The lower end of the range that the maker states, else the lowest voltage that figures are printed for. A bus
    servo's register Min_Voltage_Limit lies below that: there its alarm sets in, which is no promise that it works.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> lowest_voltage(load_servo("gobilda-2000-135")), lowest_voltage(load_servo("dynamixel-mx-28"))
    (4.8, 10.0)
    """
    found = sheet_voltages(servo)
    return 0.0 if found is None else found[0]


def is_below_sheet(servo: Servo, voltage: float) -> bool:
    """Tell whether a supply voltage [V] is so far below the lowest of a sheet that the servo may not work.

    That is below the range that the maker states, or far below the figures of a sheet that states none.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [is_below_sheet(load_servo("feetech-sts3215-12v"), volts) for volts in (11.1, 5.0)]
    [False, True]
    """
    least = lowest_voltage(servo)
    return 0.0 < voltage < (least if operating_voltages(servo) else _BELOW * least)


def check_voltage(servo: Servo, voltage: float) -> float:
    """Return a supply voltage [V] that may be asked for.

    Raises
    ------
    InputError
        If it is not positive, or more than twice what the sheet knows.
    """
    most = _MOST * highest_voltage(servo)
    allowed = "a positive number [V]" + (f" up to {most:g}, twice the highest of the sheet" if most else "")
    if not (is_finite(voltage) and voltage > 0.0 and (not most or voltage <= most)):
        raise InputError(f"supply voltage of {servo.name}", got=voltage, allowed=allowed)
    return float(voltage)


def at_voltage(model: _Model, voltage: float) -> _Model:
    """Return the model at another supply voltage [V]; the gain of a mean bridge goes with the supply that it switches.

    Examples
    --------
    >>> import servotwin as st
    >>> at_voltage(st.PulseServo(st.load_servo("hitec-hs-755hb")), 4.8).servo.supply.open_circuit_voltage
    4.8
    """
    return changed(model, _voltage_values(model.servo, voltage))


def on_supply(servo: Servo, supply: Supply, *, source: str = SET_BY_USER) -> Servo:
    """Return a servo on another supply: its voltage, resistance and limit of current replace those of the servo.

    Raises
    ------
    InputError
        If the supply has no voltage, or one that is not for this servo.

    Examples
    --------
    >>> from servotwin.parameters import Supply, load_servo
    >>> on_supply(load_servo("hitec-hs-755hb"), Supply.of("usb")).supply.current_limit
    0.5
    """
    return servo.replace(supply_values(servo, supply), source=source)


def supply_values(servo: Servo, supply: Supply) -> dict[str, Any]:
    """Return the parameters of a servo that another supply changes, by dotted name."""
    if supply.open_circuit_voltage is None:
        raise InputError("open_circuit_voltage of a supply", allowed="a positive number [V]")
    return _voltage_values(servo, supply.open_circuit_voltage) | {
        f"supply.{name}": getattr(supply, name) for name in ("internal_resistance", "current_limit")}


def _voltage_values(servo: Servo, voltage: float) -> dict[str, Any]:
    check_voltage(servo, voltage)
    drop = servo.supply.bridge_drop_voltage or 0.0
    if voltage <= drop + (servo.motor.brush_drop_voltage or 0.0):
        raise InputError(f"{servo.name} does not turn at {voltage:g} V",
                         allowed="a supply that overcomes bridge, brushes and friction")
    values: dict[str, Any] = {"supply.open_circuit_voltage": voltage}
    gain, own = servo.electronics.bridge_gain, servo.supply.open_circuit_voltage
    if gain is not None and own is not None and own > drop:
        values["electronics.bridge_gain"] = gain * (voltage - drop) / (own - drop)
    return values


def at_temperatures(model: _Model, now: Temperatures, magnet_coefficient: float) -> _Model:
    """Return the model with a winding and a housing that keep these temperatures [K].

    Parameters
    ----------
    model : Model
    now : Temperatures
        Copper follows the winding, magnets the housing.
    magnet_coefficient : float
        [1/K].
    """
    servo = model.servo
    field = float(magnet_factor(now.housing, magnet_coefficient))
    values: dict[str, Any] = {f"thermal.{name}": None for name in _THERMAL if getattr(servo.thermal, name) is not None}
    values["motor.armature_resistance"] = float(winding_resistance(
        now.winding, model.value("motor.armature_resistance")))
    for name in ("motor.torque_constant", "motor.back_emf_constant"):
        values[name] = model.value(name) * field
    return changed(model, values)


def changed(model: _Model, values: dict[str, Any]) -> _Model:
    """Return the model with some parameters replaced; what it warns of it has said before."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return type(model)(model.servo.replace(values))


@contextlib.contextmanager
def warned_once() -> Iterator[None]:
    """Let each warning through once, however many runs give it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for message, category in dict.fromkeys((str(each.message), each.category) for each in caught):
        warnings.warn(message, category, stacklevel=4)
