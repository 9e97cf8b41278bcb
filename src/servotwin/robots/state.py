"""What MuJoCo and the servos remember, as something to keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class DriveState:
    """The state of MuJoCo's data and of the servos in it; picklable.

    Parameters
    ----------
    engine : ndarray
        MuJoCo's state, `mjSTATE_INTEGRATION`.
    constraint : ndarray, shape (nv,)
        Forces of contacts and limits at the last step, which the servos meet in the next one.
    servos : ndarray
        What the servos remember, and what they were told.
    """

    engine: NDArray[np.float64]
    constraint: NDArray[np.float64]
    servos: NDArray[np.float64]
