"""States of a run at many times, the input of every output signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


@dataclass(frozen=True)
class Samples:
    """State and mode at n times; every array has shape (n,).

    Parameters
    ----------
    time : ndarray
        [s]
    angle, speed, current : ndarray
        Of the output, and of the armature [rad], [rad/s], [A]; the current only where it is a state.
    winding, housing : ndarray
        Temperatures [K], where they are states.
    motor_angle, motor_speed : ndarray
        At the output shaft [rad], [rad/s]; those of the output but in a gear with play or an elastic one. Behind an
        elastic shaft they are the load's.
    wiper : ndarray
        Angle of the potentiometer [rad].
    zone, contact, mesh, motor : ndarray of int
        Mode.
    drive, error : ndarray
        Of a pulse servo: how the bridge drives (−1, 0, +1), and the latest error decided on [s].
    silent : ndarray
        Of a pulse servo: 1 before the first pulse, and when none has come for as long as its chip waits.
    bus : ndarray, optional
        Voltage of a bus that several servos share [V]; None for a servo that has its source for itself.
    duty, goal, reference, trip : ndarray, optional
        Of a digital servo: the duty of its bridge, or `terms.duty.OPEN`, `BRAKED` [1]; goal and reference [rad]; which
        protection acts.
    """

    time: Array
    angle: Array
    speed: Array
    current: Array
    winding: Array
    housing: Array
    motor_angle: Array
    motor_speed: Array
    wiper: Array
    zone: Whole
    contact: Whole
    mesh: Whole
    motor: Whole
    drive: Array
    error: Array
    silent: Array
    bus: Array | None = None
    duty: Array | None = None
    goal: Array | None = None
    reference: Array | None = None
    trip: Array | None = None

    @classmethod
    def make(cls, time: Array, states: Array, wiper: Array, mode: Array, drive: Array, error: Array,
             silent: Array, bus: Array | None = None, told: Array | None = None) -> Samples:
        """Build from arrays of states, shape (7, n), of modes, shape (5, n), and of what a program tells, (4, n)."""
        q, w, i, T_w, T_h, q_m, w_m = states
        zone, contact, mesh, motor, _ = mode.astype(np.int64)
        return cls(time, q, w, i, T_w, T_h, q_m, w_m, wiper, zone, contact, mesh, motor, drive, error, silent,
                   bus, *(() if told is None else told))
