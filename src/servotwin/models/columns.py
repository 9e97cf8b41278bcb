"""Many lanes at once: a servo, a command and pieces whose numbers are columns; and samples of a run over time.

A column has the shape (B, 1), so that it broadcasts over times: what a formula makes of columns and of a signal over
time is an array (B, T). The models' formulas take a number and a column alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.physics.laws import array_form
from servotwin.physics.pieces import Piece, Pieces, piece_value

if TYPE_CHECKING:
    from servotwin.parameters import Servo


# --- Many lanes at once -----------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LaneServo:
    """A servo of which some numbers are columns; reads as a `Servo` does.

    Parameters
    ----------
    servo : Servo
        Gives what is the same in all lanes.
    columns : mapping of str to ndarray, shape (B, 1)
        By dotted name (SI); checked before.
    """

    servo: Servo
    columns: Mapping[str, Array]

    @property
    def name(self) -> str:
        """That of the servo."""
        return self.servo.name

    def get(self, name: str) -> Any:
        """Return a value (SI) by its dotted name, a column where lanes differ, None where it is absent."""
        column = self.columns.get(name)
        return self.servo.get(name) if column is None else column


@dataclass(frozen=True, eq=False)
class LanePieces:
    """A function of time per lane, gain · y + offset of a table of pieces; lanes may share tables.

    Parameters
    ----------
    rows : ndarray, shape (n, 7)
        Pieces as in `physics.pieces.Piece`, table behind table.
    first, count : ndarray of int, shape (B,)
        The table of a lane is rows[first : first + count].
    gain, offset : float or ndarray, shape (B, 1)
    low, high : float or ndarray, shape (B, 1)
        Lowest and highest value of each lane's table.

    Examples
    --------
    >>> rows = np.zeros((2, 7))
    >>> rows[:, 1] = 1.0, 2.0
    >>> LanePieces(rows, np.array([0, 1]), np.array([1, 1])).scaled(10.0, 1.0)([0.0, 5.0])
    array([[11., 11.],
           [21., 21.]])
    """

    rows: Array
    first: Indices
    count: Indices
    gain: float | Array = 1.0
    offset: float | Array = 0.0
    low: float | Array = 0.0
    high: float | Array = 0.0

    @property
    def extremes(self) -> tuple[Any, Any]:
        """Lowest and highest value of each lane, numbers or columns."""
        a, b = self.gain * self.low + self.offset, self.gain * self.high + self.offset
        return np.minimum(a, b), np.maximum(a, b)

    def scaled(self, gain: float | Array, offset: float | Array) -> LanePieces:
        """Return gain · y + offset."""
        return replace(self, gain=gain * self.gain, offset=gain * self.offset + offset)

    def of(self, lane: int) -> Pieces:
        """Return the function of one lane, by its place."""
        one = slice(lane, lane + 1)
        gain, offset = (x[one] if isinstance(x, np.ndarray) else x for x in (self.gain, self.offset))
        _, _, rows = LanePieces(self.rows, self.first[one], self.count[one], gain, offset).tables()
        return Pieces(tuple(Piece(*row) for row in rows.tolist()))

    @property
    def initial(self) -> Array:
        """The value of each lane's first piece, shape (B, 1)."""
        return np.asarray(self.gain * self.rows[self.first, 1:2] + self.offset)

    def __call__(self, time: ArrayLike) -> Array:
        """Return the values at `time` [s], an array (T,); shape (B, T), or (1, T) where all lanes are the same."""
        t = np.asarray(time, dtype=np.float64)
        first, lane = np.unique(self.first, return_inverse=True)
        count = np.zeros_like(first)
        count[lane] = self.count
        low = np.repeat(first[:, None], t.size, axis=1)
        high = low + count[:, None]
        for _ in range(int(count.max(initial=1)).bit_length()):  # bisection, in all tables at once
            middle = (low + high) // 2
            begun = (middle > low) & (self.rows[middle, 0] <= t)
            low, high = np.where(begun, middle, low), np.where(begun, high, np.maximum(middle, low + 1))
        y = array_form(piece_value)(Piece(*np.moveaxis(self.rows[low], -1, 0)), t)
        return np.asarray(self.gain * (y if len(first) == 1 else y[lane]) + self.offset)

    def tables(self) -> tuple[Indices, Indices, Array]:
        """Return first and count of each lane, and the rows with gain and offset applied; only rows that are used."""
        first, count, lane = self.first, self.count, np.arange(len(self.first))
        own = isinstance(self.gain, np.ndarray) or isinstance(self.offset, np.ndarray)
        if not own and (np.diff(first) <= 0).any():  # lanes may share tables
            first, lane = np.unique(self.first, return_inverse=True)
            count = np.zeros_like(first)
            count[lane] = self.count
        place = np.cumsum(count) - count
        if np.array_equal(first, place):
            rows = self.rows[:count.sum()].copy()
        else:
            rows = self.rows[np.repeat(first - place, count) + np.arange(count.sum())]
        gain, offset = (np.repeat(np.broadcast_to(x, (len(first), 1)), count, axis=0)
                        if isinstance(x, np.ndarray) else x for x in (self.gain, self.offset))
        rows[:, 1:2] = gain * rows[:, 1:2] + offset
        rows[:, 2:4] *= gain  # slope and amplitude
        return place[lane], count[lane], rows


@dataclass(frozen=True, eq=False)
class LaneSignal:
    """A command per lane, all of one kind; reads as a `Signal` does.

    Parameters
    ----------
    kind : str
        "angle", "pulse_width" or "voltage".
    pieces : LanePieces
        Values in SI.
    frame_period : float or ndarray, shape (B, 1), optional
        [s]
    edges : tuple, optional
        Anything but None where the frames do not come regularly.
    lanes : ndarray of int, shape (B,)
        Numbers of the lanes, for errors.
    """

    kind: str
    pieces: LanePieces
    frame_period: float | Array | None
    edges: tuple[()] | None
    lanes: Indices
    silences: tuple[()] = ()  # they are edges by then


# --- States of a run at many times, the input of every output signal --------------------------------------------------

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
