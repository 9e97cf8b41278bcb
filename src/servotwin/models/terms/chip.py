"""The chip of a pulse servo: what it measures with, what it ignores, and how long it drives."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.terms.dependence import PULSES
from servotwin.models.terms.given import Given, either

READS = (
    "electronics.frame_period", "electronics.deadband", "electronics.minimum_drive_time",
    "electronics.stretcher_time_constant", "electronics.one_shot_offset", "electronics.back_emf_injection",
    "electronics.supply_coupling", "electronics.pulse_timeout", "electronics.pulse_width_min",
    "electronics.pulse_width_max", "potentiometer.noise",
)
"""What may be given of a pulse servo."""

FRAME = 0.02  # s, from pulse to pulse where nothing says otherwise


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


def pack(given: Given, period: float) -> Chip:
    """Return the numbers of a servo's chip in frames of so many seconds; nan: the frames that the servo gives."""
    T_f = either(period, either(given.electronics_frame_period, FRAME))
    return Chip(
        either(given.electronics_one_shot_offset, 0.0), given.electronics_one_shot_slope,
        either(given.electronics_back_emf_injection, 0.0), either(given.electronics_supply_coupling, 0.0),
        either(given.potentiometer_noise, 0.0), 0.5 * either(given.electronics_deadband, 0.0),
        given.electronics_stretcher_gain, either(given.electronics_minimum_drive_time, 0.0),
        either(given.electronics_stretcher_time_constant, 0.0), either(given.electronics_pulse_width_min, 0.0),
        either(given.electronics_pulse_width_max, math.inf),
        _edges_first(either(given.electronics_pulse_timeout, math.inf), T_f), T_f, given.supply_open_circuit_voltage)


def _edges_first(timeout: float, period: float) -> float:
    """Return a timeout [s], longer by 1e-11 where it is a whole number of frames.

    The edge that comes as it runs out then restarts the clock, whichever way k T_f is rounded.
    """
    if timeout == math.inf:
        return timeout
    frames = max(math.floor(timeout / period + 0.5), 1.0)
    return timeout * (1.0 + 1e-11) if abs(timeout - frames * period) <= 1e-9 * period else timeout
