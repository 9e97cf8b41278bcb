"""A linear system over a time in which its input does not change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]


class Step(NamedTuple):
    """x(t + T) = transition x(t) + gain u."""

    transition: Array
    gain: Array


def step_of(A: Array, B: Array, time: float) -> Step:
    """Return the step of ẋ = A x + B u over a time [s] (Van Loan, IEEE Trans. Autom. Control 23 (1978), 395).

    Examples
    --------
    >>> step = step_of(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([0.0, 2.0]), 3.0)
    >>> step.transition.tolist(), step.gain.tolist()
    ([[1.0, 3.0], [0.0, 1.0]], [9.0, 6.0])
    """
    n = len(B)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = A * time, B * time
    found = expm(whole)
    return Step(found[:n, :n], found[:n, n])
