"""The chip of a pulse servo: what it measures with, what it ignores, and how long it drives.

A frame starts at the rising edge of its pulse. There the one-shot measures the shaft; when the longer of the two
pulses is over, the bridge drives for as long as the stretcher says, or until the next decision.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.state.noise import gaussian
from servotwin.models.terms.dependence import PULSES
from servotwin.models.terms.given import Given, either
from servotwin.physics import pulse

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray


# --- The chip of a pulse servo: what it measures with, what it ignores, and how long it drives ------------------------

READS = (
    "electronics.frame_period", "electronics.deadband", "electronics.minimum_drive_time",
    "electronics.stretcher_time_constant", "electronics.one_shot_offset", "electronics.back_emf_injection",
    "electronics.supply_coupling", "electronics.pulse_timeout", "electronics.pulse_width_min",
    "electronics.pulse_width_max", "potentiometer.noise",
)
"""Optional numbers of a pulse servo."""
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


# --- The chip at each pulse -------------------------------------------------------------------------------------------

class Decision(NamedTuple):
    """The decision of a frame: from `time` on, drive with `sign` for `duration`."""

    time: float
    sign: float
    duration: float
    error: float


class Frame(NamedTuple):
    """Everything that the chip remembers."""

    number: int  # of the next frame, lost pulses counted
    draws: int  # of noise so far, one a frame
    drive: float  # −1, 0, +1: how the bridge drives now
    drive_end: float
    clock: float  # the drive ends here at the latest
    silent: int  # 1: no pulse has been taken yet, or none for as long as the chip waits
    error: float  # of the latest decision
    pending: Decision
    later: Decision  # a second one, where a frame starts before the one before has been decided


NOTHING = Decision(math.inf, 0.0, 0.0, 0.0)
CROWDED = -1  # as the number of a frame: more than two decisions would have to wait
AT_START = Frame(0, 0, 0.0, math.inf, -math.inf, 1, 0.0, NOTHING, NOTHING)


def decide(chip: Chip, time: float, t_in: float, v_o: float, v_m: float, V_bus: float, draw: float) -> Decision:
    """Return what the frame that starts at `time` decides; `draw` is its Gaussian draw."""
    v_eff = pulse.effective_voltage(v_o, chip.noise * draw, v_m, V_bus - chip.V_oc, chip.beta, chip.c_s)
    T_os = pulse.one_shot_width(v_eff, chip.slope, chip.T_0)
    e = pulse.error_time(t_in, T_os)
    t_on = pulse.drive_time(e, chip.K, 2.0 * chip.half_deadband, chip.t_min, chip.tau_s)
    sign = 0.0 if t_on == 0.0 else math.copysign(1.0, e)
    return Decision(time + pulse.decision_delay(t_in, T_os), sign, t_on, e)


def accepted(chip: Chip, t_in: float) -> bool:
    """Tell whether a pulse is neither too short nor too long."""
    return chip.shortest <= t_in <= chip.longest


def may_refuse(chip: Chip) -> bool:
    """Tell whether there are pulses that are not taken."""
    return chip.shortest > 0.0 or chip.longest < math.inf


def edge(chip: Chip, frame: Frame, time: float, t_in: float, v_o: float, v_m: float, V_bus: float, seed: int) -> Frame:
    """Return the frame state after the rising edge of a pulse of the width t_in."""
    if not accepted(chip, t_in):
        return Frame(frame.number + 1, frame.draws + 1, frame.drive, frame.drive_end, frame.clock, frame.silent,
                     frame.error, frame.pending, frame.later)
    draw = gaussian(seed, frame.draws) if chip.noise > 0.0 else 0.0
    new = decide(chip, time, t_in, v_o, v_m, V_bus, draw)
    number, pending, later = frame.number + 1, frame.pending, frame.later
    if new.time <= pending.time:  # where another waits, it would be replaced as soon as it comes
        pending, later = new, NOTHING
    elif new.time <= later.time:
        later = new
    else:
        number = CROWDED
    return Frame(number, frame.draws + 1, frame.drive, frame.drive_end, time + chip.timeout, 0, frame.error,
                 pending, later)


def edge_time(period: float, edges: Sequence[float] | NDArray[np.float64], k: int) -> float:
    """Return when frame k starts: every `period`, or where that is 0 at its own edge; inf after the last."""
    if period > 0.0:
        return k * period
    return edges[k] if k < len(edges) else math.inf


def numbered(frame: Frame, number: int, silent: int) -> Frame:
    """Return the frame state before the frame of this number, silent or not."""
    return Frame(number, frame.draws, frame.drive, frame.drive_end, frame.clock, silent, frame.error, frame.pending,
                 frame.later)


def shifted(frame: Frame, shift: float) -> Frame:
    """Return the frame state by times that count from an instant that is later by `shift` [s]."""
    return Frame(frame.number, frame.draws, frame.drive, frame.drive_end - shift, frame.clock - shift, frame.silent,
                 frame.error, _later(frame.pending, shift), _later(frame.later, shift))


def _later(decision: Decision, shift: float) -> Decision:
    return Decision(decision.time - shift, decision.sign, decision.duration, decision.error)


def next_switch(frame: Frame, heeds_silence: bool) -> float:
    """Return when the bridge switches next, edges apart; `heeds_silence` where it does so as pulses stay away."""
    if frame.drive != 0.0:
        return min(frame.pending.time, frame.drive_end, frame.clock)
    if heeds_silence and frame.silent == 0:
        return min(frame.pending.time, frame.clock)
    return frame.pending.time


def switched(frame: Frame, time: float) -> Frame:
    """Return the frame state after all that switches at `time`: the end of a drive, then decisions."""
    drive, end, error = frame.drive, frame.drive_end, frame.error
    pending, later = frame.pending, frame.later
    if drive != 0.0 and (end <= time or frame.clock <= time):
        drive, end = 0.0, math.inf
    while pending.time <= time:
        drive, end, error = pending.sign, pending.time + pending.duration, pending.error
        if drive == 0.0 or end <= time or frame.clock <= time:
            drive, end = 0.0, math.inf
        pending, later = later, NOTHING
    return Frame(frame.number, frame.draws, drive, end, frame.clock, 1 if frame.clock <= time else 0, error, pending,
                 later)
