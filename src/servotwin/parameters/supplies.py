"""Supplies in words: a voltage with resistance and limit of current, or a name."""

from __future__ import annotations

from servotwin.errors import InputError
from servotwin.units.quantities import number_and_unit, quantity

_NAMED = {"usb": {"open_circuit_voltage": 5.0, "current_limit": 0.5}}  # what USB 2.0 gives a device that asked for it
_FORM = f"{', '.join(_NAMED)}, or VOLTS[:OHMS][:AMPERES], such as 12V:0.1ohm or 5V:0.5A"
_LETTERS = ("A", "mA")
_CAPACITORS = {"pF": 1e-12, "nF": 1e-9, "uF": 1e-6, "µF": 1e-6, "μF": 1e-6, "mF": 1e-3, "F": 1.0}
_START_CHARGE = 4e-3  # C, an excess of 0.2 A while a small motor starts, 20 ms


def supply_numbers(text: str, what: str) -> dict[str, float]:
    """Return the numbers of a supply by name (SI).

    Examples
    --------
    >>> supply_numbers("6V:100mohm:2A", "--supply")
    {'open_circuit_voltage': 6.0, 'internal_resistance': 0.1, 'current_limit': 2.0}
    """
    if text.strip().lower() in _NAMED:
        return dict(_NAMED[text.strip().lower()])
    volts, *rest = (part.strip() for part in text.split(":"))
    if number_and_unit(volts) is None:
        raise InputError(what, got=text, allowed=_FORM)
    found = {"open_circuit_voltage": quantity(what, volts, "voltage", bare=True, positive=True)}
    for part in rest:
        number, unit = number_and_unit(part) or (0.0, "")
        if unit in _CAPACITORS and number > 0.0:
            fall = _START_CHARGE / (number * _CAPACITORS[unit])
            raise InputError(what, got=text, allowed="a supply without a capacitor: the start of a motor takes some 4 "
                             f"mC (0.2 A for 20 ms), for which {part} falls by {fall:.2g} V; it cures spikes under a "
                             "millisecond, and no model here knows it")
        limits = unit in _LETTERS
        name = "current_limit" if limits else "internal_resistance"
        if not part or name in found or (limits and not number > 0.0):
            raise InputError(what, got=text, allowed=_FORM)
        found[name] = (quantity(what, part, "current", positive=True) if limits
                       else quantity(f"{what}: resistance", part, "resistance", bare=True))
    return found
