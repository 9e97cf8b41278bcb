"""Lanes that advance one a thread: their columns, what they are called with, and the way from records and back.

The text is that of a GPU (`simulation.compile.threads`); here a processor goes through it, lane after lane.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.engine.memory import SAME, Memories, put_started
from servotwin.models.state.modes import NOWHERE, RIGID
from servotwin.models.state.records import rows_of
from servotwin.models.terms.control import WAITING
from servotwin.models.terms.dependence import (
    AT_COMMANDS,
    AT_STOPS,
    BEYOND,
    BY_SHARE,
    DROPS,
    DRY,
    ON_Q,
    ONE_WAY,
    PLAY,
    PROGRAM,
    PULSES,
    PWM,
    SHOWN,
    SILENCE,
    SLACK,
    STEPS,
    STRAIGHT,
    TABLE,
    TWO_BODIES,
)
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import Numbers
from servotwin.simulation.compile import threads
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.threads import PULSES_BY_ARCS, PULSES_BY_LEGS, RINGS, TICKS, LaneText
from servotwin.simulation.lanes.forms import WORDS, Terms
from servotwin.simulation.lanes.whole_runs import nothing_yet, taken

if TYPE_CHECKING:
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers

_BY_ARCS = STRAIGHT | DRY | AT_STOPS | SHOWN | PULSES | SLACK | STEPS | TABLE
_BY_LEGS = _BY_ARCS | DROPS | SILENCE | PLAY | TWO_BODIES | BY_SHARE
_BY_TICKS = _BY_LEGS & ~PULSES | PROGRAM | PWM | ONE_WAY | AT_COMMANDS | BEYOND
_WORDS = WORDS | {ON_Q: "a load that hangs on the angle"}


def text_of(numbers: LaneNumbers, dtype: str) -> LaneText:
    """Return the text by which all lanes can go, one a thread.

    Raises
    ------
    InputError
        If it does not follow what some of them have; names that.
    """
    packed = numbers.packed()
    own = packed.lanes
    program = own.firmware or NO_FIRMWARE
    flags = Terms(own.numbers, own.chips, program, inputs=TABLE if packed.curve.size else 0).followed
    digital, floats = numbers.digital, dtype == "float32"
    left = flags & ~(_BY_TICKS if digital else _BY_LEGS)
    words = [word for flag, word in _WORDS.items() if left & flag]
    if numbers.supplies.lanes:
        words.append("several servos on a supply")
    if numbers.recorded:
        words.append("a recorded torque")
    if not numbers.pulsed:
        words.append("a voltage that follows the error")
    if digital and floats and np.any(program.goals == 0.0):
        words.append("goals told by pulses, in float32")
    if words or left:
        raise InputError("lanes one a thread", got=", ".join(words) or "a term that no text follows",
                         allowed="pulse servos and digital servos without heat, inductance, springs, pendulums, "
                                 "fading friction and regulators, each on a supply of its own")
    if digital:
        return LaneText(TICKS, flags, floats)
    return LaneText(PULSES_BY_LEGS if flags & ~_BY_ARCS else PULSES_BY_ARCS, flags, floats)


class ThreadedLanes:
    """Lanes of one text, with all that they remember in columns.

    Parameters
    ----------
    numbers : LaneNumbers
    dtype : str
        "float64" or "float32": of all numbers, throughout.

    Attributes
    ----------
    text : LaneText
    reals, wholes : ndarray, shape (columns, lanes)
        The memory of lanes, as `threads.columns` names it.
    status : ndarray of int32, shape (lanes,)
        0, or the code of a `Status`; a lane that has failed is nan.
    left : int
        How many lanes arcs have left to legs in the latest call.
    """

    def __init__(self, numbers: LaneNumbers, dtype: str = "float64") -> None:
        self._numbers, self.text = numbers, text_of(numbers, dtype)
        real, count = self.text.real, numbers.count
        names = threads.columns(self.text.way)
        self._place = {path: (kind, k) for kind, paths in enumerate(names) for k, path in enumerate(paths)}
        self.reals, self.wholes = np.zeros((len(names[0]), count), real), np.zeros((len(names[1]), count), np.int32)
        self.rings = np.zeros((count if self.text.way == TICKS else 0, len(RINGS), WAITING), real)
        self.status = np.zeros(count, np.int32)
        self._command, self._torque = np.zeros(count, real), np.zeros(count, real)
        self._tiles = {"numbers": self._typed(Numbers, numbers.columns.numbers)}
        if self.text.way == TICKS:
            programs = numbers.columns.firmware
            self._tiles["programs"] = programs.astype([(name, real) for name in Firmware._fields])
        else:
            self._tiles["chips"] = self._typed(Chip, numbers.columns.chips)
            self._tiles["arcs"] = np.zeros(len(self._tiles["numbers"]), rows_of(ArcNumbers, real))
        self._room = {"curve": np.ascontiguousarray(numbers.curve, real), "seeds": numbers.columns.seeds,
                      "command": self._command, "torque": self._torque, "reals": self.reals, "wholes": self.wholes,
                      "rings": self.rings, "status": self.status, "left": np.zeros(count, np.int32),
                      "count": np.zeros(1, np.int32)}
        self._of = threads.table_type(self.text.floats)(
            lanes=count, program_step=1, curve_rows=len(numbers.curve),
            **{name: array.ctypes.data for name, array in (self._tiles | self._room).items()})
        self._library = threads.library(self.text)
        self._by_legs = None
        if self.text.way == PULSES_BY_ARCS:
            self._by_legs = threads.library(LaneText(PULSES_BY_LEGS, self.text.flags, self.text.floats))
            self._call(self._library.servotwin_prepare)
        elif self.text.way == PULSES_BY_LEGS:
            self._of.left = None  # all lanes, not those of a list

    def _typed(self, kind: Any, tiles: NDArray[Any]) -> NDArray[Any]:
        """Return tiles with numbers of this text's type."""
        found = np.empty(len(tiles), rows_of(kind, self.text.real))
        found.view(self.text.real)[:] = tiles.view(np.float64)
        return found

    def _call(self, function: Any) -> None:
        function(ctypes.byref(self._of), ctypes.c_int64(0), ctypes.c_int64(self._numbers.count))

    def advance(self, duration: float, command: Any, torque: Any) -> None:
        """Advance all lanes by a time [s] under commands as the engine follows them, and torques of loads [N m]."""
        self._command[:], self._torque[:], self._of.duration = command, torque, duration
        self._room["count"][0] = 0
        self._call(self._library.servotwin_advance)
        if self._by_legs is not None and self.left:
            self._call(self._by_legs.servotwin_advance)

    @property
    def left(self) -> int:
        """How many lanes arcs have left to legs in the latest call."""
        return int(self._room["count"][0])

    # --- what lanes remember ------------------------------------------------------------------------------------------

    def column(self, path: str) -> NDArray[Any]:
        """Return the column of something that lanes remember, to be read or written in place."""
        kind, k = self._place[path]
        found: NDArray[Any] = (self.reals, self.wholes)[kind][k]
        return found

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of each lane since it was reset [s]."""
        found: NDArray[np.float64] = self.column("stand.frames") * self._period + self.column("stand.time")
        return found

    @property
    def _period(self) -> NDArray[np.float64]:
        digital, columns = self.text.way == TICKS, self._numbers.columns
        found: NDArray[np.float64] = columns.firmware["T_c"] if digital else self._numbers.frame_period
        return found

    def put(self, which: NDArray[np.int64], memories: Memories) -> None:
        """Let some lanes remember what records say."""
        rows, period = memories.rows, self._period[which]
        point = rows["point"]
        time = rows["frames"] * rows["beat"] + point["time"]
        frames = np.floor(time / period + SAME).astype(np.int64)
        shift = frames * period - rows["frames"] * rows["beat"]
        self._set(which, "stand.y", point["y"])
        self._set(which, "stand", {"mesh": point["mode"]["mesh"], "wiper": point["wiper"], "frames": frames,
                                   "time": np.maximum(point["time"] - shift, 0.0)})
        if self.text.way == TICKS:
            firm = memories.firms.copy()
            firm["tick"] -= np.where(self._told_goals(which), frames, 0)
            for name in ("heard", "since"):
                firm[name] -= np.where(self._told_goals(which), frames * period, 0.0)
            self._set(which, "firm", firm)
            self.status[which] = 0
            return
        now = rows["chip"].copy()
        for group, name in ((now, "drive_end"), (now, "clock"), (now["pending"], "time"), (now["later"], "time")):
            group[name] -= shift
        now["number"] = np.maximum(now["number"], frames)
        now["silent"] = np.where(point["anchor_time"] == np.inf, now["clock"] <= point["time"] - shift, now["silent"])
        self._set(which, "now", now)
        self.status[which] = 0

    def memories(self, which: NDArray[np.int64]) -> Memories:
        """Return what some lanes remember, as records."""
        rest = nothing_yet(1)
        put_started(rest, 0, NOWHERE, RIGID)
        found = taken(rest, np.zeros(len(which), np.int64))
        rows, period = found.rows, self._period[which]
        frames, point = self.column("stand.frames")[which], rows["point"]
        rows["frames"], rows["beat"] = frames, period
        self._get(which, "stand.y", point["y"])
        for name in point["y"].dtype.names or ():
            point["anchor"][name] = point["y"][name]
        point["mode"]["mesh"], point["wiper"] = self.column("stand.mesh")[which], self.column("stand.wiper")[which]
        point["time"] = self.column("stand.time")[which]
        if self.text.way == TICKS:
            self._get(which, "firm", found.firms)
            found.firms["tick"] += np.where(self._told_goals(which), frames, 0)
            for name in ("heard", "since"):
                found.firms[name] += np.where(self._told_goals(which), frames * period, 0.0)
        else:
            self._get(which, "now", rows["chip"])
        return found

    def _told_goals(self, which: NDArray[np.int64]) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = self._numbers.columns.firmware["goals"][which] > 0.0
        return found

    def _set(self, which: Any, path: str, values: Any) -> None:
        names = values.dtype.names if hasattr(values, "dtype") else values
        for name in names:
            value, own = values[name], f"{path}.{identifier(name)}"
            if hasattr(value, "dtype") and value.dtype.names:
                self._set(which, own, value)
            elif name in RINGS:
                self.rings[which, RINGS.index(name)] = value
            else:
                self.column(own)[which] = value

    def _get(self, which: Any, path: str, into: Any) -> None:
        for name in into.dtype.names:
            value, own = into[name], f"{path}.{identifier(name)}"
            if value.dtype.names:
                self._get(which, own, value)
            elif name in RINGS:
                value[:] = self.rings[which, RINGS.index(name)]
            else:
                into[name] = self.column(own)[which]
