"""How a servo drives at rest, and what would stop it, as rows of text and as facts for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.simulation.remarks import drive_words, swing_words

if TYPE_CHECKING:
    from servotwin.datasheet import Buzz, Remedy
    from servotwin.simulation import Rest

_NUMBERS = {
    "firmware.deadband_angle": ("a dead zone of {} either way", math.degrees(1.0), "deg"),
    "electronics.deadband": ("a deadband of {}", 1e6, "us"),
    "electronics.voltage_deadband": ("a deadband of {}", 1e3, "mV"),
    "load.coulomb_torque": ("friction of {} more at the shaft", 1e3, "mN m"),
    "firmware.proportional_gain": ("a proportional gain of {}", 1.0, "1/rad"),
    "electronics.stretcher_gain": ("a stretcher gain of {}", 1.0, ""),
    "electronics.bridge_gain": ("a bridge gain of {}", 1.0, ""),
}


def rest_words(rest: Rest | None) -> str:
    """Return what a servo does at rest, as people read it; nothing where that is not known.

    Examples
    --------
    >>> import servotwin as st
    >>> rest_words(st.datasheet.buzz(st.PulseServo(st.load_servo("hitec-hs-755hb"))).rest)
    'drives 50 times a second, duty 0.6 %, 0.011 A in the mean, less and less'
    """
    if rest is None or rest.moves_on:
        return ""
    if rest.swing > 0.0:
        return f"{swing_words(rest.swing, rest.frequency)}; {drive_words(rest.drive_rate, rest.duty, rest.current)}"
    if not rest.duty > 0.0:
        return "does not drive" if rest.duty == 0.0 else f"{rest.current:.3f} A in the mean"
    fades = ", less and less" if rest.fades else ""
    return drive_words(rest.drive_rate, rest.duty, rest.current) + fades


def remedy_words(remedies: tuple[Remedy, ...]) -> str:
    """Return what would bring a servo to rest, each by itself.

    Examples
    --------
    >>> from servotwin.datasheet import Remedy
    >>> remedy_words((Remedy("electronics.deadband", 4e-6, 9e-6), Remedy("load.coulomb_torque", 0.0, 2e-3)))
    'a deadband of 9 us instead of 4, or friction of 2 mN m more at the shaft'
    """
    return ", or ".join(map(_remedy, remedies))


def _remedy(remedy: Remedy) -> str:
    form, factor, unit = _NUMBERS[remedy.name]
    said = form.format(f"{factor * remedy.needed:.3g} {unit}".strip())
    return said if remedy.now == 0.0 else f"{said} instead of {factor * remedy.now:.3g}"


def buzz_facts(found: Buzz) -> dict[str, Any]:
    """Return the same in SI, ready for JSON."""
    return {"rest": None if found.rest is None else found.rest._asdict(),
            "remedies": [remedy._asdict() for remedy in found.remedies]}
