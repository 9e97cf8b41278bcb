"""The chip of a pulse servo: what it measures with, what it ignores, and how long it drives."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.terms.dependence import PULSES
from servotwin.models.terms.given import Given

READS = (
    "electronics.frame_period", "electronics.deadband", "electronics.minimum_drive_time",
    "electronics.stretcher_time_constant", "electronics.one_shot_offset", "electronics.back_emf_injection",
    "electronics.supply_coupling", "electronics.pulse_timeout", "electronics.pulse_width_min",
    "electronics.pulse_width_max", "potentiometer.noise",
)
"""What may be given of a pulse servo."""


class Chip(NamedTuple):
    """Numbers of the frame logic."""

    T_0: float
    slope: float  # 1/s_r
    beta: float
    c_s: float
    noise: float  # V rms
    half_deadband: float
    K: float
    t_min: float
    tau_s: float  # 0: linear stretcher
    shortest: float  # pulse widths that are taken, bounds included
    longest: float
    timeout: float  # inf: none
    frame_period: float
    V_oc: float  # from which the bus sags


NO_CHIP = Chip(*[0.0] * 14)  # of a plant that follows its command at all times
ACTS = dict.fromkeys((
    "T_0", "slope", "beta", "c_s", "noise", "half_deadband", "K", "t_min", "tau_s", "shortest", "longest", "timeout",
    "frame_period", "V_oc"), PULSES)
"""Where each number acts."""


def present(chip: Chip) -> bool:
    """Tell whether pulses are decided upon, frame by frame."""
    return chip.frame_period > 0.0


def needs(chip: Chip) -> int:
    """Return what there is to be followed of the chip."""
    return PULSES if chip.K != 0.0 else 0  # edges may come at times of their own


def pack(model: Given, period: Any, timeout: Any) -> Chip:
    """Return the numbers of a model's chip in frames of so many seconds, of which it misses so many [s]."""
    return Chip(
        T_0=model.value_or("electronics.one_shot_offset", 0.0), slope=model.value("electronics.one_shot_slope"),
        beta=model.value_or("electronics.back_emf_injection", 0.0),
        c_s=model.value_or("electronics.supply_coupling", 0.0), noise=model.value_or("potentiometer.noise", 0.0),
        half_deadband=0.5 * model.value_or("electronics.deadband", 0.0),
        K=model.value("electronics.stretcher_gain"), t_min=model.value_or("electronics.minimum_drive_time", 0.0),
        tau_s=model.value_or("electronics.stretcher_time_constant", 0.0),
        shortest=model.value_or("electronics.pulse_width_min", 0.0),
        longest=model.value_or("electronics.pulse_width_max", math.inf),
        timeout=timeout, frame_period=period, V_oc=model.value("supply.open_circuit_voltage"))
