"""Many servos at once: what a chunk of lanes is, what is asked of it, and what comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.lanes import Lanes
from servotwin.models.state.records import columns_of, mapped, record_of, tiles_with
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import Numbers

# --- Many servos at once: what a chunk of lanes is, what is asked of it, and what comes back --------------------------

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
FIELDS = ("angle", "speed", "contact", "drive", "error", "wiper", "current", "winding", "housing", "motor_angle",
          "motor_speed", "mesh")
MORE_FIELDS = ("motor", "silent", "duty", "goal", "reference", "trip")  # of servos that run one by one
ALL_FIELDS = (*FIELDS, *MORE_FIELDS)  # rows of what a run leaves behind
SMALL_FIELDS = ("contact", "drive", "mesh", "motor", "silent", "trip")  # fields that are kept as int8
_SHARED = ("pieces", "edges", "accuracy")  # by all lanes
_TILED: dict[str, Any] = {"numbers": Numbers, "chips": Chip}


@dataclass(frozen=True)
class Torques:
    """Recorded external torques [N m], a table of pieces for each lane: rows[first : first + count]; count 0: none."""

    rows: Floats
    first: Indices
    count: Indices


class Packed(NamedTuple):
    """The lanes; picklable.

    Parameters
    ----------
    law : str
        "voltage", "bounded", "pulse" or "digital".
    lanes : models.engine.lanes.Lanes
        Numbers, chips, torque and firmware as named tuples, each number one for all lanes or an array (B,); firmware
        is None where there is no program. Pieces are armature voltages or v_c [V] for "voltage" and "bounded", widths
        of pulses [s] for "pulse", either these or goals [rad] for "digital".
    curve : ndarray, shape (n, 2)
        Rows of angle [rad] and error [V] of the potentiometers, the same for all lanes.
    torque : Torques
    """

    law: str
    lanes: Lanes
    curve: Floats
    torque: Torques

    @property
    def size(self) -> int:
        """Number of lanes B."""
        return len(self.lanes.seeds)

    def part(self, start: int, stop: int) -> Packed:
        """Return some of the lanes."""
        if start == 0 and stop >= self.size:
            return self
        some = slice(start, stop)
        torque = Torques(self.torque.rows, self.torque.first[some], self.torque.count[some])
        return self._replace(torque=torque, lanes=Lanes(*(
            x if name in _SHARED else x[:, some] if name == "start" else mapped(lambda x: _sliced(x, some), x)
            for name, x in zip(Lanes._fields, self.lanes, strict=True))))

    def columns(self) -> Lanes:
        """Return the lanes as the kernels read them."""
        own = {name: as_kernels_take(x) for name, x in self.lanes._asdict().items()}
        tiled = {name: tiles_with(kind, own[name], self.size) for name, kind in _TILED.items()}
        torque = np.empty(self.size)
        torque[:] = self.lanes.torque
        return Lanes(**own | tiled)._replace(torque=torque, firmware=programs_of(self.lanes.firmware, self.size))

    @property
    def inputs(self) -> tuple[Floats, Floats, Indices, Indices]:
        """Tables that the kernels read beside the lanes: table of the potentiometers, and torques."""
        own = self.torque
        return as_kernels_take(self.curve), *map(as_kernels_take, (own.rows, own.first, own.count))


def _sliced(x: Any, some: slice) -> Any:
    return x[some] if isinstance(x, np.ndarray) and x.ndim else x


def as_kernels_take(x: Any) -> Any:
    """Return an array with its numbers in a row and to write into, anything else as it is."""
    return np.require(x, None, ("C_CONTIGUOUS", "WRITEABLE")) if isinstance(x, np.ndarray) else x


def some_of(lanes: Lanes, which: Indices) -> Lanes:
    """Return some lanes of columns."""
    if len(which) == len(lanes.torque):
        return lanes
    records = {name: tiles_with(kind, columns_of(kind, getattr(lanes, name), which), len(which))
               for name, kind in _TILED.items()}
    columns: Any = (records[name] if name in records else x if name in (*_SHARED, "firmware") else
                    np.ascontiguousarray(x[..., which]) for name, x in zip(Lanes._fields, lanes, strict=True))
    return Lanes(*columns)


def swept(lanes: Lanes) -> NDArray[np.bool_]:
    """Tell whose command has a chirp."""
    if not lanes.pieces[:, 6].any():
        return np.zeros(len(lanes.piece_first), np.bool_)
    before = np.concatenate([[0], np.cumsum(lanes.pieces[:, 6] != 0.0)])
    return np.asarray(before[lanes.piece_first + lanes.piece_count] > before[lanes.piece_first])


def programs_of(firmware: Firmware | None, lanes: int) -> NDArray[Any]:
    """Return a record of the program of each lane, whose numbers are numbers or columns; one where there is none."""
    records = np.zeros(1 if firmware is None else lanes, record_of(Firmware))
    for name, values in zip(Firmware._fields, firmware or NO_FIRMWARE, strict=True):
        records[name] = values
    return records


@dataclass(frozen=True)
class Asked:
    """The question to every chunk.

    Parameters
    ----------
    duration : float
        [s]
    times : ndarray, shape (T,)
        Output times [s], not decreasing, within [0, duration].
    outputs : tuple of str
        Names of signals.
    dtype : str
        "float64" or "float32".
    accuracy : float
        Of what is integrated [rad].
    nearly : bool
        Whether a spring or a pendulum of a digital servo may count with its torque in the middle of each tick.
    watched : bool
        Whether the least voltage of each supply is kept.
    """

    duration: float
    times: Floats
    outputs: tuple[str, ...]
    dtype: str
    accuracy: float
    nearly: bool = False
    watched: bool = False


@dataclass(frozen=True)
class Work:
    """The inputs of a chunk of lanes; picklable.

    Parameters
    ----------
    packed : Packed
    asked : Asked
    fields : tuple of str
        Of "angle" [rad], "speed" [rad/s], "contact" (`state.modes.FREE` … `ON_UPPER`), "drive" (−1, 0, +1),
        "error" (of the latest decision [s]), "wiper" (of the potentiometer [rad]) and "current" (of an armature with
        inductance [A], else 0), or of `MORE_FIELDS`; only these are computed and kept.
    """

    packed: Packed
    asked: Asked
    fields: tuple[str, ...]

    def part(self, start: int, stop: int) -> Work:
        """Return the work of some lanes."""
        return replace(self, packed=self.packed.part(start, stop))


@dataclass(frozen=True)
class Raw:
    """The answer of a chunk.

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
        Sums of `engine.cosim.ON_STOP` and `CANNOT_HOLD`.
    kernel : ndarray of int8, shape (B,)
        Place of the name of its kernels in `forms.KERNELS`.
    lowest : ndarray, shape (B, 2)
        Least voltage of its supply [V] and when it came [s]; nan where nobody watched it.
    """

    fields: dict[str, NDArray[np.generic]]
    status: NDArray[np.int8]
    ended: Floats
    final: Floats
    refused: Floats
    marks: NDArray[np.int8]
    kernel: NDArray[np.int8]
    lowest: Floats


def empty_raw(work: Work) -> Raw:
    """Return the arrays that the kernels fill."""
    lanes, asked = work.packed.size, work.asked
    kinds = {name: np.dtype(np.int8) if name in SMALL_FIELDS else np.dtype(asked.dtype) for name in work.fields}
    return Raw({name: np.zeros((lanes, len(asked.times)), kind) for name, kind in kinds.items()},
               np.zeros(lanes, np.int8), np.full(lanes, asked.duration),
               np.ascontiguousarray(work.packed.lanes.start[[0, 1, 3, 4]].T), np.full(lanes, np.nan),
               np.zeros(lanes, np.int8), np.zeros(lanes, np.int8), np.full((lanes, 2), np.nan))


# --- A law for one servo asked of many lanes --------------------------------------------------------------------------

_Which = list[NDArray[np.int64]]


class _DividedError(Exception):
    """Lanes of a group answer differently: some yes, as `holds` says."""

    def __init__(self, holds: NDArray[np.bool_]) -> None:
        self.holds = holds
        super().__init__()


class _Column(np.ndarray[Any, np.dtype[Any]]):
    """Numbers of lanes of which a group is asked, the one in `which`."""

    which: _Which

    def __array_finalize__(self, other: Any) -> None:
        self.which = getattr(other, "which", [])

    def __bool__(self) -> bool:
        holds = self.view(np.ndarray)[self.which[0]]
        yes = np.count_nonzero(holds)
        if 0 < yes < len(holds):
            raise _DividedError(holds != 0)
        return bool(yes)


def by_groups(law: Callable[..., int], lanes: int, *arguments: Any) -> NDArray[np.int64] | int:
    """Return what a law says of each lane, or of all of them if its questions do not divide them.

    Its arguments are named tuples of numbers and of columns of so many lanes.
    """
    group: _Which = [np.arange(lanes)]
    found, waiting = np.empty(lanes, np.int64), [group[0]]

    def column(values: Any) -> Any:
        if not isinstance(values, np.ndarray):
            return values
        own = values.reshape(-1).view(_Column)
        own.which = group
        return own

    given = [mapped(column, argument) for argument in arguments]
    while waiting:
        group[0] = which = waiting.pop()
        try:
            said = law(*given)
            if len(which) == lanes:
                return said
            found[which] = said
        except _DividedError as divided:
            waiting += [which[divided.holds], which[~divided.holds]]
    return found
