"""How much arithmetic the closed form needs for a fleet: the legs that really move, counted on the fleet itself."""

from typing import NamedTuple

import numpy as np
from fleet import Fleet, columns
from formulas import State, frame

# Operations of the functions in pulse.c; a fused multiply-add counts as two, a division as one.
EXPONENTIAL = {"float64": 31, "float32": 21}
LOGARITHM = {"float64": 26, "float32": 16}


class Count(NamedTuple):
    """Means over all frames of all lanes."""

    phases: float  # in which the shaft moved
    sliding: float  # legs from a speed on: 11 operations and an exponential
    stopped: float  # of them, those that reach speed zero: 3 operations and a logarithm
    released: float  # legs from rest on: 10 operations and an exponential

    def operations(self, dtype: str) -> float:
        """Return floating-point operations for each frame, with 14 for one-shot, error, stretcher and times."""
        power, log = EXPONENTIAL[dtype], LOGARITHM[dtype]
        return 14 + self.sliding * (11 + power) + self.stopped * (3 + log) + self.released * (10 + power)


def count(fleet: Fleet, frames: int) -> tuple[Count, np.ndarray]:
    """Run the formulas in NumPy; return the count and the angles at the end [rad]."""
    lane, rest = columns(fleet), np.zeros(len(fleet))
    state = State(fleet.angle, rest, rest, rest)
    total = np.zeros(4)
    with np.errstate(divide="ignore", invalid="ignore"):
        for t_in in fleet.pulses(frames):
            state, phases = frame(np, lane, state, t_in)
            for legs in phases:
                moving = legs.sliding | legs.released
                total += [x.mean() for x in (moving, legs.sliding, legs.stopped, legs.released)]
    return Count(*(total / frames)), state.angle
