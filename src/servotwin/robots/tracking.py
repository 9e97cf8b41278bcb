"""How well a servo has made its joint follow a motion, and what that took."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.robots.record import ServoRecord
from servotwin.simulation.remarks import Remark

Array = NDArray[np.float64]
_LONGEST_DELAY = 0.5  # s
_REST = 0.1  # s, over whose mean a servo is said to stand off
_DELAYS = 101


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """What one servo has done while it followed a motion.

    Errors are goal less joint, of a hinge [rad], of a slide [m]; what a servo lacks is nan.

    Parameters
    ----------
    rms, largest, mean : float
        Error during the motion: root mean square, largest magnitude, mean.
    delay : float
        By which the goal follows the joint best; nan of a joint that has no motion [s]
    rms_delayed : float
        Error that is left with that delay.
    droop_before, droop_after : float
        Error at the end of the settling, and of the rest after the motion.
    peak_current, mean_current : float
        Of the motor among the ends of all ticks, and mean of what the servo took of its supply, from the beginning of
        the motion on [A]
    lowest_voltage : float
        Of its supply [V]
    winding, housing : float
        Highest temperatures [K]
    remarks : tuple of Remark
        Trips of a digital servo, and that it does not come to rest.
    """

    rms: float
    largest: float
    mean: float
    delay: float
    rms_delayed: float
    droop_before: float
    droop_after: float
    peak_current: float
    mean_current: float
    lowest_voltage: float
    winding: float
    housing: float
    remarks: tuple[Remark, ...]


def tracking_of(record: ServoRecord, goal: Array, duration: float,
                lowest: tuple[float, float] | None = None) -> Tracking:
    """Return how a servo has followed goals, at the times of its record.

    Parameters
    ----------
    record : ServoRecord
    goal : ndarray, shape (n,)
        Of the joint: of a hinge [rad], of a slide [m]
    duration : float
        Of the motion, which begins at time 0 [s]
    lowest : tuple (float, float), optional
        Least voltage of its supply from then on, within ticks too [V], and when [s]
    """
    time, angle = record.time, record["joint_angle"]
    error = goal - angle
    moving = (time >= 0.0) & (time <= duration)
    delay, left = best_delay(time, goal, angle, moving)
    from_start = time >= 0.0
    drawn = "supply_current" if "supply_current" in record else "armature_current"
    return Tracking(
        rms=_rms(error[moving]), largest=float(np.abs(error[moving]).max()), mean=float(error[moving].mean()),
        delay=delay, rms_delayed=left, droop_before=_mean(error[(time <= 0.0) & (time > -_REST)]),
        droop_after=_mean(error[time > time[-1] - _REST]),
        peak_current=_highest(record, "armature_current", from_start),
        mean_current=float(record[drawn][from_start].mean()),
        lowest_voltage=_lowest(record, from_start) if lowest is None else lowest[0],
        winding=_highest(record, "winding_temperature", from_start),
        housing=_highest(record, "housing_temperature", from_start), remarks=record.remarks)


def _lowest(record: ServoRecord, some: NDArray[np.bool_]) -> float:
    return float(record["bus_voltage"][some].min()) if "bus_voltage" in record else math.nan


def best_delay(time: Array, goal: Array, angle: Array, moving: NDArray[np.bool_]) -> tuple[float, float]:
    """Return by which delay [s] a goal follows an angle best, up to 0.5 s, and the error that is left, rms.

    Examples
    --------
    >>> time = np.linspace(0.0, 2.0, 2001)
    >>> delay, left = best_delay(time, np.sin(6.0 * time), np.sin(6.0 * (time - 0.08)), time > 0.5)
    >>> round(delay, 4), left < 1e-4
    (0.08, True)
    """
    if np.ptp(goal) == 0.0:
        return math.nan, math.nan

    def left(delay: float) -> float:
        return _rms(np.interp(time[moving] - delay, time, goal) - angle[moving])

    delays = np.linspace(0.0, _LONGEST_DELAY, _DELAYS)
    errors = [left(delay) for delay in delays.tolist()]
    at, step = int(np.argmin(errors)), float(delays[1])
    best = float(delays[at])
    for _ in range(20):  # halves the steps around the best
        step *= 0.5
        near = [max(best - step, 0.0), best, best + step]
        best = min(near, key=left)
    return best, left(best)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else math.nan


def _highest(record: ServoRecord, name: str, inside: NDArray[np.bool_]) -> float:
    return float(np.abs(record[name][inside]).max()) if name in record else math.nan
