"""How far the supply falls: least voltage, when, for how long, and whether that is beyond what the model knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models import DigitalServo
from servotwin.models.engine.memory import FLAT
from servotwin.parameters.registers.held import registers_of
from servotwin.simulation.metrics import least

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.models.samples import Samples
    from servotwin.parameters import Servo, Supply
    from servotwin.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
LOW = 0.8
"""Of the supply's voltage: below it a servo has a fifth less torque and speed, `assumed` to be what people notice."""
LONG = 0.02
"""s, a frame of pulses: a supply that is low or at its limit for less holds nothing back, `assumed`."""
ELECTRONICS = 3.0
"""V, below which chips of analog servos stop, `assumed`: sheets print 4.8 V."""
_SAME = 1e-6  # of the supply's voltage: what it falls by less is rounding


class Sag(NamedTuple):
    """How far a supply fell.

    Parameters
    ----------
    voltage, time : float
        Least voltage [V] and when it came first [s].
    low, limited : float
        For how long it was below 0.8 of its voltage without load, and at its limit of current [s].
    limit : float
        That limit, inf where it has none [A].
    """

    voltage: float
    time: float
    low: float
    limited: float
    limit: float

    @property
    def holds_back(self) -> bool:
        """Whether it was low or at its limit for a frame or more."""
        return self.low >= LONG or self.limited >= LONG


def sag_of(trajectories: Sequence[Trajectory], voltage: Callable[[Samples], Array], supply: Supply) -> Sag | None:
    """Return how far a supply fell that servos are on; None where it stayed as it is.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        Of all servos on it.
    voltage : callable
        Of the supply [V], by samples of a trajectory.
    supply : Supply
    """
    V = supply.open_circuit_voltage or math.nan
    limit = math.inf if supply.current_limit is None else supply.current_limit
    if not may_fall(supply):
        return None
    different = {one.segments.starts.tobytes(): one for one in reversed(trajectories)}
    found = [least(one, voltage) for one in different.values() if one.segments]
    if not found:  # a run that failed at once
        return None
    lowest = min(one.value for one in found)
    first = min(one.time for one in found if one.value <= lowest + FLAT)
    if not lowest < V * (1.0 - _SAME):
        return None
    ends = LOW * V, V * (1.0 - _SAME) - (supply.internal_resistance or 0.0) * limit  # at its limit it lies below

    def below(samples: Samples) -> Array:
        return (voltage(samples) < np.array(ends)[:, None]).astype(np.float64)

    low, limited = trajectories[0].integral(below).tolist() if lowest < max(ends) else (0.0, 0.0)
    return Sag(lowest, first, low, limited, limit)


def may_fall(supply: Supply) -> bool:
    """Tell whether the voltage of a supply may fall."""
    return bool(supply.internal_resistance) or supply.current_limit is not None


def sag_in(time: Array, voltage: Array, supply: Supply, lowest: tuple[float, float] | None = None) -> Sag | None:
    """Return how far a supply fell, among samples that are evenly spaced: time [s] and voltage [V], shape (n,).

    `lowest` is its least voltage [V] and when it came first [s] where these are known between samples too.
    """
    V, limit = supply.open_circuit_voltage or math.nan, supply.current_limit or math.inf
    least = lowest[0] if lowest is not None else float(voltage.min()) if len(time) else math.nan
    if not len(time) or not least < V * (1.0 - _SAME):
        return None
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    at_limit = V * (1.0 - _SAME) - (supply.internal_resistance or 0.0) * limit
    low, limited = (step * float(np.count_nonzero(voltage < end)) for end in (LOW * V, at_limit))
    when = lowest[1] if lowest is not None else float(time[np.argmax(voltage <= least + FLAT)])
    return Sag(least, when, low, limited, limit)


class Floor(NamedTuple):
    """The voltage below which nobody knows what a servo does [V], and whether a register says so."""

    voltage: float
    of_register: bool


def floor_of(servo: Servo) -> Floor:
    """Return below which voltage nobody knows what a servo does.

    That is Min_Voltage_Limit of a servo with registers, what its maker promises; else what chips need.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [floor_of(load_servo(name)).voltage for name in ("feetech-sts3215-12v", "towerpro-sg90")]
    [4.0, 3.0]
    """
    held = registers_of(servo).get("Min_Voltage_Limit")
    return Floor(ELECTRONICS, False) if held is None or not held.value else Floor(0.1 * held.value, True)


def watches_its_supply(model: Model) -> bool:
    """Tell whether a protection of the servo's program acts where its supply is low."""
    return isinstance(model, DigitalServo) and model.servo.firmware.undervoltage is not None
