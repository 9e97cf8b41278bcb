"""Many servos at once: what a chunk of lanes needs, what comes back, and the way through the compiled kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.memory import ACCURACY
from servotwin.models.engine.records import mapped

if TYPE_CHECKING:
    from servotwin.models.terms.chip import Chip
    from servotwin.models.terms.firmware import Firmware
    from servotwin.models.terms.numbers import Numbers

Floats = NDArray[np.float64]
Record = TypeVar("Record", bound=tuple[object, ...])

FIELDS = ("angle", "speed", "contact", "drive", "error", "wiper", "current", "winding", "housing", "motor_angle",
          "motor_speed", "mesh")
MORE_FIELDS = ("motor", "silent", "duty", "goal", "reference", "trip")  # of servos that run one by one
ALL_FIELDS = (*FIELDS, *MORE_FIELDS)  # rows of what a run leaves behind
SMALL_FIELDS = ("contact", "drive", "mesh", "motor", "silent", "trip")  # fields that are kept as int8


@dataclass(frozen=True)
class Tables:
    """One table per lane, all in one array; lanes may share rows.

    Parameters
    ----------
    first, count : ndarray of int64, shape (B,)
        The table of a lane is rows[first : first + count].
    rows : ndarray of float64, shape (n, 7) or (m,)
        Pieces as in `physics.pieces.Piece`, or frame edges [s].
    """

    first: NDArray[np.int64]
    count: NDArray[np.int64]
    rows: Floats

    def part(self, start: int, stop: int) -> Tables:
        """Return the tables of some lanes."""
        return Tables(self.first[start:stop], self.count[start:stop], self.rows)


def no_tables(lanes: int, width: int = 7) -> Tables:
    """Return tables without rows.

    Examples
    --------
    >>> no_tables(2).count.tolist()
    [0, 0]
    """
    none = np.zeros(lanes, dtype=np.int64)
    return Tables(none, none, np.zeros((0, width) if width else (0,)))


def regular_edges(lanes: int) -> Tables:
    """Return the edges of lanes whose frames follow at `Chip.frame_period`.

    Examples
    --------
    >>> regular_edges(2).count.tolist()
    [-1, -1]
    """
    return Tables(np.zeros(lanes, dtype=np.int64), np.full(lanes, -1, dtype=np.int64), np.zeros(0))


@dataclass(frozen=True)
class Work:
    """What a chunk of lanes needs; picklable.

    Parameters
    ----------
    law : str
        "pulse", "bounded" or "digital".
    numbers : Numbers
        Each field a number, or an array (B,).
    chip : Chip or None
        The same; its frame_period is that of the command where that gives one. None for "bounded".
    command : Tables
        Pulse width [s] for "pulse", v_c [V] for "bounded"; either a pulse width or a goal [rad] for "digital".
    torque : Tables
        Recorded external torque [N m] over time; count 0: none.
    constant_torque : float or ndarray, shape (B,)
        Added to it [N m]; positive pushes towards −q.
    edges : Tables
        Frame edges [s]; count −1: regular frames of `chip.frame_period`.
    start : ndarray, shape (7, B)
        The state at t = 0, as in `engine.modes.Vector`.
    seeds : ndarray of int64, shape (B,)
        Of the noise.
    duration : float
        [s]
    times : ndarray, shape (T,)
        Output times [s], not decreasing, within [0, duration].
    fields : tuple of str
        Of "angle" [rad], "speed" [rad/s], "contact" (`engine.modes.FREE` … `ON_UPPER`), "drive" (−1, 0, +1),
        "error" (of the latest decision [s]), "wiper" (of the potentiometer [rad]) and "current" (of an armature with
        inductance [A], else 0), or of `MORE_FIELDS`; only these
        are computed and kept.
    dtype : str
        "float64" or "float32".
    curve : tuple
        Rows of angle [rad] and error [V] of the potentiometer's linearity table, the same for all lanes.
    accuracy : float
        Of what is integrated [rad].
    firmware : Firmware, optional
        Of digital servos, each field a number or an array (B,).
    """

    law: str
    numbers: Numbers
    chip: Chip | None
    command: Tables
    torque: Tables
    constant_torque: float | Floats
    edges: Tables
    start: Floats
    seeds: NDArray[np.int64]
    duration: float
    times: Floats
    fields: tuple[str, ...]
    dtype: str
    curve: tuple[tuple[float, float], ...] = ()
    accuracy: float = ACCURACY
    firmware: Firmware | None = None

    @property
    def lanes(self) -> int:
        """Number of lanes."""
        return int(self.start.shape[1])

    def part(self, start: int, stop: int) -> Work:
        """Return the work of some lanes."""
        lanes = slice(start, stop)
        torque = self.constant_torque
        return replace(
            self, numbers=_sliced(self.numbers, lanes), chip=None if self.chip is None else _sliced(self.chip, lanes),
            firmware=None if self.firmware is None else _sliced(self.firmware, lanes),
            command=self.command.part(start, stop), torque=self.torque.part(start, stop),
            constant_torque=torque[lanes] if isinstance(torque, np.ndarray) and torque.ndim else torque,
            edges=self.edges.part(start, stop), start=self.start[:, lanes],
            seeds=self.seeds[lanes])


def _sliced(numbers: Record, lanes: slice) -> Record:
    """Return a named tuple of numbers and columns with some rows of the columns."""
    sliced: Record = mapped(lambda x: x[lanes] if isinstance(x, np.ndarray) and x.ndim else x, numbers)
    return sliced


@dataclass(frozen=True)
class Raw:
    """What comes back.

    Parameters
    ----------
    fields : dict of str to ndarray, shape (B, T)
        Of the dtype asked for, contact and drive int8; nan (0) from a failure on.
    status : ndarray of int8, shape (B,)
        Codes of `Status`.
    ended : ndarray of float64, shape (B,)
        The time of the failure, or the duration [s].
    final : ndarray of float64, shape (B, 4)
        Last angle [rad] and speed [rad/s], and temperatures of winding and housing [K].
    refused : ndarray of float64, shape (B,)
        From when on all pulses are refused [s]; nan where the last one is not.
    marks : ndarray of int8, shape (B,)
        Sums of `engine.ending.ON_STOP` and `CANNOT_HOLD`.
    """

    fields: dict[str, NDArray[np.generic]]
    status: NDArray[np.int8]
    ended: Floats
    final: Floats
    refused: Floats
    marks: NDArray[np.int8]


def empty_raw(work: Work) -> Raw:
    """Return the arrays that the kernels fill."""
    shape = (work.lanes, len(work.times))
    kinds = {name: np.dtype(np.int8) if name in SMALL_FIELDS else np.dtype(work.dtype) for name in work.fields}
    return Raw({name: np.zeros(shape, kind) for name, kind in kinds.items()}, np.zeros(work.lanes, np.int8),
               np.full(work.lanes, work.duration), np.ascontiguousarray(work.start[[0, 1, 3, 4]].T),
               np.full(work.lanes, np.nan), np.zeros(work.lanes, np.int8))
