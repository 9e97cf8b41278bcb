"""What the lanes of a `VectorSimulator` remember, as something to keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Common(NamedTuple):
    """What lanes on shared supplies remember together.

    Each lane's bus and its place among those that move together there (−1: none), shape (lanes,); and a record of
    `models.engine.bus.bus_records.Shared` for each bus.
    """

    bus_of: NDArray[np.int64]
    joined: NDArray[np.int64]
    shared: Mapping[int, Any]


@dataclass(frozen=True, eq=False)
class VectorMemory:
    """Everything that the lanes of a `VectorSimulator` remember; picklable.

    Parameters
    ----------
    model : str
        Name of the model's class.
    records, firms : ndarray, shape (lanes,)
        Records of each lane: of `models.engine.memory.Memory`, and of `models.terms.control.Firm`.
    command, torque : ndarray, shape (lanes,)
        What each is told: width of the pulse [s] or control voltage [V]; external torque [N m].
    status, ended : ndarray, shape (lanes,)
        Code of its `Status`, and when it failed [s].
    work : ndarray, shape (lanes,)
        Of the speeds that were set [J].
    numbers : ndarray
        Tiles of `models.terms.numbers.Numbers`: what the lanes were. They are not restored; a lane that has others by
        then goes on from where it stood.
    common : Common, optional
        Of lanes that share supplies.
    """

    model: str
    records: NDArray[Any]
    firms: NDArray[Any]
    command: Array
    torque: Array
    status: NDArray[np.int8]
    ended: Array
    work: Array
    numbers: NDArray[Any]
    common: Common | None = None


class Piece(NamedTuple):
    """Rows of bytes in memory, each so many bytes behind the one before."""

    address: int
    rows: int
    stride: int
    bytes: int


def piece_of(array: NDArray[Any]) -> Piece:
    """Return an array as one row."""
    return Piece(array.ctypes.data, 1, array.nbytes, array.nbytes)
