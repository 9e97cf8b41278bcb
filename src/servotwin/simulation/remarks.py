"""What a completed run leaves to be said: pulses that were refused, an end stop, a load that is too much.

A remark is no failure: the run reached its end, and `Status` says so. One look at the end of the run finds it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.models.engine import ending
from servotwin.models.terms.chip import NO_CHIP
from servotwin.physics.pieces import piece_value

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from servotwin.simulation.result import Result

REFUSED, ON_STOP, CANNOT_HOLD = KINDS = ("pulses refused", "ended on a stop", "cannot hold")
COLUMNS = {kind: kind.replace(" ", "_") for kind in KINDS}
"""Name of a table's column that holds the time of a kind."""

_MARKS = {ON_STOP: ending.ON_STOP, CANNOT_HOLD: ending.CANNOT_HOLD}


class Remark(NamedTuple):
    """What a user should know of a run.

    Parameters
    ----------
    kind : str
        "pulses refused": the last pulse is too short or too long for the chip, and so are all from `time` on.
        "ended on a stop": it rests on an end stop, and its command asks for an angle elsewhere.
        "cannot hold": it is off its command, and full drive from a standstill does not turn the load towards it, where
        the shaft stands or where it was sent.
    time : float
        Of the first such pulse; otherwise the end of the run, of which the remark speaks [s].

    Examples
    --------
    >>> Remark("cannot hold", 1.5).words
    'cannot hold its load at 1.5 s'
    """

    kind: str
    time: float

    @property
    def words(self) -> str:
        """The remark as people read it."""
        return words(self.kind, f"{self.time:g} s")


class LaneRemark(NamedTuple):
    """A remark on one lane of many: the lane's number, kind and time [s] as in `Remark`."""

    lane: int
    kind: str
    time: float


class ServoRemark(NamedTuple):
    """A remark on one servo of several on a supply: its name, kind and time [s] as in `Remark`."""

    servo: str
    kind: str
    time: float


def words(kind: str, time: str = "") -> str:
    """Return a kind of remark as people read it, with its time where one is given.

    Examples
    --------
    >>> words("pulses refused", "0.1 s"), words("ended on a stop")
    ('all pulses refused from 0.1 s on', 'ended on a stop that it was not sent to')
    """
    text, before, after = {
        REFUSED: ("all pulses refused", "from", "on"), ON_STOP: ("ended on a stop that it was not sent to", "at", ""),
        CANNOT_HOLD: ("cannot hold its load", "at", "")}[kind]
    return " ".join(filter(None, (text, before, time, after))) if time else text


def remarks_of(result: Result) -> tuple[Remark, ...]:
    """Return the remarks on a run; none on one that ended before its time."""
    if not result.status.ok:
        return ()
    model, load, end = result.model, result.load, result.ended
    numbers, chip, edges = model.plant(load), model.chip(result.command), model.edges(result.command) or ()
    period = 0.0 if chip is None or model.edges(result.command) is not None else chip.frame_period
    refused = math.nan if chip is None else ending.refused_from(chip, result.drive.rows, period, edges, end)
    last = result.trajectory.at(np.array([end]))
    source = numbers.source.V
    if last.bus is not None:  # what is left by the other servos
        own = float(model.output("supply_current", last, result.drive, load)[0])
        source = float(last.bus[0]) + numbers.source.R_b * own
    tau = piece_value(ending.piece_before(load.torque_pieces.rows, end, False), end)
    final = [float(values[0]) for values in (last.angle, last.speed, last.winding, last.housing)]
    marks = ending.marks(chip is not None, numbers, chip or NO_CHIP, result.drive.rows, tau, period, edges, end, source,
                         not math.isnan(refused), final)
    return tuple(Remark(remark.kind, remark.time) for remark in lane_remarks([refused], [marks], end))


def lane_remarks(refused: ArrayLike, marks: ArrayLike, end: float) -> tuple[LaneRemark, ...]:
    """Return the remarks on many lanes, in the order of the lanes.

    Parameters
    ----------
    refused, marks : array_like, shape (B,)
        As in `lanes.Raw`.
    end : float
        Of the runs [s].

    Examples
    --------
    >>> lane_remarks([np.nan, 0.02], [2, 0], 1.5)
    (LaneRemark(lane=0, kind='cannot hold', time=1.5), LaneRemark(lane=1, kind='pulses refused', time=0.02))
    """
    since, codes = np.asarray(refused, dtype=np.float64), np.asarray(marks)
    found = []
    for lane in np.flatnonzero(~np.isnan(since) | (codes != 0)).tolist():
        if not np.isnan(since[lane]):
            found.append(LaneRemark(lane, REFUSED, float(since[lane])))
        found += [LaneRemark(lane, kind, end) for kind, mark in _MARKS.items() if codes[lane] & mark]
    return tuple(found)


def columns(remarks: Sequence[LaneRemark], lanes: int) -> dict[str, NDArray[np.float64]]:
    """Return a column for each kind of remark, by its name in `COLUMNS`: its time [s], nan where it is not said.

    Examples
    --------
    >>> columns([LaneRemark(1, "cannot hold", 1.5)], 2)["cannot_hold"].tolist()
    [nan, 1.5]
    """
    found = {name: np.full(lanes, np.nan) for name in COLUMNS.values()}
    for lane, kind, time in remarks:
        found[COLUMNS[kind]][lane] = time
    return found


def of_columns(table: Mapping[str, NDArray[np.float64]]) -> tuple[LaneRemark, ...]:
    """Return the remarks that the columns of a table hold, in the order of the lanes.

    Examples
    --------
    >>> of_columns(columns([LaneRemark(1, "cannot hold", 1.5)], 2))
    (LaneRemark(lane=1, kind='cannot hold', time=1.5),)
    """
    found = [LaneRemark(lane, kind, float(table[name][lane]))
             for kind, name in COLUMNS.items() for lane in np.flatnonzero(~np.isnan(table[name])).tolist()]
    return tuple(sorted(found, key=lambda remark: remark.lane))
