"""Commands that the servo's chip would refuse."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from servotwin.identification.fitting.frames import has_pulses
from servotwin.identification.fitting.suspicions.look import Finding, Look


def refused(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs with pulses outside the limits that the chip takes."""
    return [finding for one in looks if has_pulses(one.model) for finding in _refused(one)]


def _refused(one: Look) -> list[Finding]:
    low = one.model.value_or("electronics.pulse_width_min", 0.0)
    high = one.model.value_or("electronics.pulse_width_max", math.inf)
    outside = ((one.drive < low) | (one.drive > high)) & one.log.sent
    if not outside.any():
        return []
    worst = one.drive[outside][np.argmax(np.maximum(low - one.drive[outside], one.drive[outside] - high))]
    return [Finding("pulses", one.log.name, (
        f"log {one.log.name!r}: {outside.sum()} of {len(outside)} commands, the first at "
        f"{one.log.time[np.argmax(outside)]:.4g} s, lie outside the {low:.4g} to {high:.4g} s that the servo's chip "
        f"takes (such as {worst:.4g} s) and would not be followed; check the unit of the command, and "
        "electronics.pulse_width_min and pulse_width_max"), None)]
