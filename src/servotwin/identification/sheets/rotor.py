"""The rotor of a servo whose sheet does not tell it: by the mechanical time constant, which hardly depends on size.

τ_m = J R/K_out² of an assembled servo, J with the wheels of its gear, is 36 to 52 ms of identified XL330, XL-320 and
STS3215, 19 to 22 ms of the Miuzei 25 kg and an MG90S, 11 to 18 ms of MX-64 and MX-106, whose motors are coreless. From
rest 60° take about τ_m longer than at full speed, so that the printed time for 60° bounds it too.
"""

from __future__ import annotations

import re

from servotwin.identification.sheets.motor_range import Range

CORED = Range(value=25e-3, lower=12e-3, upper=55e-3)  # s, iron-core brushed motors; assumed
CORELESS = Range(value=12e-3, lower=5e-3, upper=20e-3)  # s, coreless and brushless ones; assumed
SHARE, MOST_SHARE = 0.35, 0.6  # of the time for 60°: what τ_m is at most, and the end of its range
_LIGHT = re.compile(r"(core|iron|brush|slot)[\s-]?less|bldc|hollow[\s-]?cup", re.IGNORECASE)


def is_coreless(motor_type: str) -> bool:
    """Return whether words for a motor mean a coreless or a brushless one; without words it is one with an iron core.

    Examples
    --------
    >>> [is_coreless(words) for words in ("coreless", "Brushless", "3-pole", "iron core", "brushed", "")]
    [True, True, False, False, False, False]
    """
    return _LIGHT.search(motor_type) is not None


def time_constant(motor_type: str, time_60: float) -> Range:
    """Return the mechanical time constant that is assumed [s].

    Parameters
    ----------
    motor_type : str
        As the sheet says it.
    time_60 : float
        Printed time for 60° at the voltage of the servo [s].

    Examples
    --------
    >>> time_constant("", 0.2)
    Range(value=0.025, lower=0.012, upper=0.055)
    >>> found = time_constant("coreless", 0.02)
    >>> round(found.value, 6), round(found.lower, 6), round(found.upper, 6)
    (0.007, 0.002917, 0.012)
    """
    usual = CORELESS if is_coreless(motor_type) else CORED
    value = min(usual.value, SHARE * time_60)
    return Range(value=value, lower=value * usual.lower / usual.value, upper=min(usual.upper, MOST_SHARE * time_60))


def assumed_inertia(motor_type: str, time_60: float, output_torque_constant: float, resistance: float) -> Range:
    """Return the inertia of rotor and gear that is assumed, at the output: τ_m K_out²/R [kg m²].

    Parameters
    ----------
    motor_type : str
    time_60 : float
        [s].
    output_torque_constant : float
        K_out = N k_a [N m/A].
    resistance : float
        R of the circuit, bridge and wiring included [ohm].

    Examples
    --------
    >>> round(assumed_inertia("", 0.23, 1.04, 3.04).value, 5)
    0.00889
    """
    tau, by = time_constant(motor_type, time_60), output_torque_constant**2 / resistance
    return Range(value=tau.value * by, lower=tau.lower * by, upper=tau.upper * by)


def rotor_source(motor_type: str, time_60: float) -> str:
    """Return by which rule it is assumed, for people."""
    usual = CORELESS if is_coreless(motor_type) else CORED
    kind = "coreless and brushless" if usual is CORELESS else "iron-core"
    value = 1e3 * time_constant(motor_type, time_60).value
    return (f"no source: J R/K_out^2 of {value:.3g} ms, over gear_reduction^2; "
            f"{1e3 * usual.value:g} ms ({1e3 * usual.lower:g} to {1e3 * usual.upper:g}) for {kind} motors, at most "
            f"{SHARE:g} ({MOST_SHARE:g}) of the printed time for 60 degrees")
