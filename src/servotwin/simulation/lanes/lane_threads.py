"""Lanes that advance one a thread: their columns, what they are called with, and the way from records and back.

The text is one (`simulation.compile.threads`): a GPU goes through it with a thread for each lane, a processor lane
after lane, with the same digits.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.engine.memory import SAME, Memories, put_started
from servotwin.models.engine.one_lane import FOLLOWED
from servotwin.models.state.modes import NOWHERE, RIGID
from servotwin.models.state.noise import chosen
from servotwin.models.state.records import TILE, columns_of, mapped, rows_of, tiles_with
from servotwin.models.terms import wiring
from servotwin.models.terms.control import WAITING
from servotwin.models.terms.dependence import (
    AT_COMMANDS,
    AT_STOPS,
    BEYOND,
    BY_SHARE,
    DROPS,
    DRY,
    FADING,
    ON_HEAT,
    ON_Q,
    ONE_WAY,
    PLAY,
    PROGRAM,
    PULSES,
    PWM,
    REGULATED,
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
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.wiring import Wiring
from servotwin.simulation.compile import threads
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.threads import BARE, PULSES_BY_ARCS, PULSES_BY_LEGS, RINGS, SEEN, TICKS, LaneText
from servotwin.simulation.lanes.cuda import Gpu, GpuArray, Visit, for_each, guest, is_guest, stream_of
from servotwin.simulation.lanes.forms import WORDS, Terms
from servotwin.simulation.lanes.whole_runs import nothing_yet, taken

if TYPE_CHECKING:
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers

_BY_ARCS = STRAIGHT | DRY | AT_STOPS | SHOWN | PULSES | SLACK | STEPS | TABLE
_BY_LEGS = _BY_ARCS | DROPS | SILENCE | PLAY | TWO_BODIES | BY_SHARE | REGULATED | FADING | ON_HEAT
_BY_TICKS = _BY_LEGS & ~PULSES | PROGRAM | PWM | ONE_WAY | AT_COMMANDS | BEYOND
REMEMBERED = ("reals", "wholes", "rings", "status")
PLAIN_REGISTERS, MOST_REGISTERS = 128, 168  # of a thread by arcs, and by anything else: more threads, or no spills
Arrays = Mapping[str, NDArray[Any]]
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
    terms = Terms(own.numbers, own.chips, program, inputs=TABLE if packed.curve.size else 0)
    flags = terms.followed
    digital, floats = numbers.digital, dtype == "float32"
    left = flags & ~(_BY_TICKS if digital else _BY_LEGS)
    words = [word for flag, word in _WORDS.items() if left & flag]
    if np.any(terms.ask(FADING) & terms.ask(PLAY)):
        words.append("friction that fades behind play of the gear")
    if flags & FADING and flags & ON_HEAT:
        words.append("friction that fades beside heat")
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
                         allowed="pulse servos and digital servos without inductance, springs, pendulums and friction "
                                 "that fades beside heat or behind play of the gear, each on a supply of its own")
    if digital:
        return LaneText(TICKS, flags, floats)
    return LaneText(PULSES_BY_LEGS if flags & ~_BY_ARCS else PULSES_BY_ARCS, flags, floats)


def _wirings_of(numbers: LaneNumbers) -> NDArray[Any]:
    """Return tiles with how each lane takes commands."""
    columns = np.empty((len(Wiring._fields), numbers.count))
    for chunk in numbers.chunks:
        law = wiring.digital if numbers.digital else wiring.pulsed
        for column, values in zip(columns, mapped(np.ravel, chunk.model.made_of(law, math.nan)), strict=True):
            column[chunk.which] = values
    return tiles_with(Wiring, Wiring(*columns), numbers.count)


def _bare(numbers: LaneNumbers) -> NDArray[np.float64]:
    """Return what lanes are beside their tiles, a row for each of `threads.BARE`."""
    shaft = columns_of(Shaft, numbers.given["shaft"], slice(numbers.count))
    return np.array([numbers.columns.torque, shaft.J_out - numbers.load_total, shaft.J - shaft.J_out,
                     numbers.reduction, period_of(numbers)])


def period_of(numbers: LaneNumbers) -> NDArray[np.float64]:
    """Return how long frames of pulses last, or ticks [s]."""
    found: NDArray[np.float64] = numbers.columns.firmware["T_c"] if numbers.digital else numbers.frame_period
    return found


class OnProcessor:
    """Where a processor goes through texts: its arrays are those of numpy."""

    def __init__(self, texts: Sequence[LaneText], arrays: Arrays) -> None:
        self._texts, self._arrays = texts, arrays
        self.addresses = {name: array.ctypes.data for name, array in arrays.items()}

    def put_on(self, stream: int) -> None:
        """Let work be on a stream from now on; a processor has none."""

    def call(self, k: int, entry: str, table: ctypes.Structure, lanes: int) -> None:
        """Let all lanes go through an entry of the k-th text."""
        function = getattr(threads.library(self._texts[k]), entry)
        function(ctypes.byref(table), ctypes.c_int64(0), ctypes.c_int64(lanes))

    def any_left(self) -> bool:
        """Tell whether a list may have lanes."""
        return bool(self._arrays["count"][0])

    def clear(self, name: str) -> None:
        """Set an array to 0."""
        self._arrays[name][:] = 0

    def seen(self, name: str) -> Any:
        """Return an array, in place."""
        return self._arrays[name]

    def numbers_of(self, lanes: Any) -> None:
        """Return that an array is none of numbers of lanes on a GPU."""

    def given(self, name: str, values: Any) -> int:
        """Return the address of numbers that somebody gives, one for each lane or for all."""
        self._arrays[name][:] = values
        return self.addresses[name]

    def fetch(self, *names: str) -> None:
        """Bring arrays to the processor, where they are not there."""

    def send(self, *names: str) -> None:
        """Bring them back."""


class OnGpu:
    """Where a GPU does, a thread for each lane: its arrays have a copy on the processor, fetched when that is read."""

    def __init__(self, texts: Sequence[LaneText], arrays: Arrays, device: str) -> None:
        self._gpu, self._arrays = Gpu(device), arrays
        self._kernels = [self._gpu.kernels(
            threads.ptx(text), threads.entries(text),
            MOST_REGISTERS if text.beside or text.way != PULSES_BY_ARCS else PLAIN_REGISTERS) for text in texts]
        self._own = {name: self._gpu.array(array) for name, array in arrays.items()}
        self.addresses = {name: array.address for name, array in self._own.items()}
        self._stream, self._guests = 0, dict[str, Any]()

    def put_on(self, stream: int) -> None:
        """Let work be on a stream from now on, after all that is on the one before."""
        if stream != self._stream:
            self._gpu.follows(stream, self._stream)
            self._stream = stream
            for array in self._own.values():
                array.stream = stream

    def call(self, k: int, entry: str, table: ctypes.Structure, lanes: int) -> None:
        """Put an entry of the k-th text on the stream, for all lanes."""
        self._gpu.launch(self._kernels[k][entry], lanes, table, self._stream)

    def any_left(self) -> bool:
        """Tell whether a list may have lanes: the kernel that goes over it reads how many."""
        return True

    def clear(self, name: str) -> None:
        """Set an array to 0."""
        self._own[name].clear()

    def seen(self, name: str) -> Any:
        """Return an array, in place."""
        return self._own[name]

    def given(self, name: str, values: Any) -> int:
        """Return the address of numbers that somebody gives: an array on the device stays where it is."""
        own = self._own[name]
        if is_guest(values):
            found = self._guests[name] = for_each(name, values, self._gpu, own.shape, own.dtype, self._stream)
            return found.address
        self._arrays[name][:] = values
        own.write(self._arrays[name])
        return own.address

    def numbers_of(self, lanes: Any) -> Visit | None:
        """Return whole numbers that somebody gives for lanes; None where it is no array of such, but a mask."""
        found = self._guests["which"] = guest("lanes", lanes, self._gpu, self._stream)
        return found if found.kind in ("i4", "i8") and len(found.shape) == 1 else None

    def fetch(self, *names: str) -> None:
        """Bring arrays to the processor."""
        for name in names:
            self._arrays[name][:] = self._own[name].read()

    def send(self, *names: str) -> None:
        """Bring them back."""
        for name in names:
            self._own[name].write(self._arrays[name])


class ThreadedLanes:
    """Lanes of one text, with all that they remember in columns.

    Parameters
    ----------
    numbers : LaneNumbers
    dtype : str
        "float64" or "float32": of all numbers, throughout.
    device : str
        "cpu", or "cuda" with or without ":" and the number of a GPU, where all of it stands and runs.
    variants : LaneNumbers, optional
        Servos of which `change` gives a lane another one.

    Attributes
    ----------
    text : LaneText

    Raises
    ------
    InputError
        If lanes have what no text follows, there is no such device, or no compiler for it.
    """

    def __init__(self, numbers: LaneNumbers, dtype: str = "float64", device: str = "cpu",
                 variants: LaneNumbers | None = None) -> None:
        self._numbers, self.text = numbers, text_of(variants or numbers, dtype)
        real, count = self.text.real, numbers.count
        of = [numbers] if variants is None else [numbers, variants]
        places = count if variants is None else -(-count // TILE) * TILE + variants.count
        names = threads.columns(self.text.way)
        self._place = {path: (kind, k) for kind, paths in zip(("reals", "wholes"), names, strict=True)
                       for k, path in enumerate(paths)}
        by_ticks = self.text.way == TICKS
        arrays = {
            "numbers": self._typed(Numbers, [own.columns.numbers for own in of]), "seeds": numbers.columns.seeds,
            "curve": np.ascontiguousarray(numbers.curve, real), "command": np.zeros(count, real),
            "torque": np.zeros(count, real), "reals": np.zeros((len(names[0]), count), real),
            "wholes": np.zeros((len(names[1]), count), np.int32), "status": np.zeros(count, np.int32),
            "rings": np.zeros((count if by_ticks else 0, len(RINGS), WAITING), real),
            "wirings": self._typed(Wiring, [_wirings_of(own) for own in of]),
            "bare": np.zeros((len(BARE), places), real),
            **{name: np.zeros(count, real) for name in ("angle", "speed", "inertia", "voltage", "followed", "total")},
            **{name: np.zeros(count, np.uint8) for name in ("torque_enable", "mask")},
            **{name: np.full(count, math.nan, real) for name in ("hung", "fed")},
            "draws": np.zeros(count, np.int32), "variant": np.zeros(count, np.int32),
            "seen": np.zeros((len(SEEN), count), real),
            "left": np.zeros(count, np.int32), "count": np.zeros(1, np.int32)}
        for own, first in zip(of, (0, places - of[-1].count), strict=False):
            arrays["bare"][:, first:first + own.count] = _bare(own)
        if by_ticks:
            arrays["programs"] = np.zeros(places, [(name, real) for name in Firmware._fields])
            for own, first in zip(of, (0, places - of[-1].count), strict=False):
                arrays["programs"][first:first + own.count] = own.columns.firmware
        else:
            arrays["chips"] = self._typed(Chip, [own.columns.chips for own in of])
            arrays["arcs"] = np.zeros(-(-count // TILE), rows_of(ArcNumbers, real))
        if variants is not None:
            arrays["variant"][:] = chosen(cast("Any", numbers.columns.seeds), 0, variants.count)
        self._arrays, self._texts = arrays, [self.text]
        if self.text.way == PULSES_BY_ARCS:
            self._texts.append(LaneText(PULSES_BY_LEGS, self.text.flags, self.text.floats))
        self._texts.append(LaneText(self.text.way, self.text.flags, self.text.floats, beside=True))
        self._at = OnProcessor(self._texts, arrays) if device == "cpu" else OnGpu(self._texts, arrays, device)
        self._of = threads.table_type(self.text.floats)(
            lanes=count, places=places, variants=0 if variants is None else variants.count, program_step=1,
            curve_rows=len(numbers.curve), **self._at.addresses)
        self.tell(torque=0.0)
        if self.text.way == PULSES_BY_ARCS:
            self._at.call(0, "servotwin_prepare", self._of, count)
        elif self.text.way == PULSES_BY_LEGS:
            self._of.left = None  # all lanes, not those of a list

    def _typed(self, kind: Any, parts: list[NDArray[Any]]) -> NDArray[Any]:
        """Return tiles, one after the other, with numbers of this text's type."""
        tiles = np.concatenate(parts)
        found = np.empty(len(tiles), rows_of(kind, self.text.real))
        found.view(self.text.real)[:] = tiles.view(np.float64)
        return found

    def put_on(self, stream: Any) -> None:
        """Let work be on a stream from now on: a handle, or one of another library; on a GPU, else there is none."""
        self._at.put_on(stream_of(stream))

    def tell(self, command: Any = None, torque: Any = None, *, kind: int = FOLLOWED, mask: Any = None) -> None:
        """Give lanes commands of a kind, and torques beside their loads [N m]; they stay until others come.

        A lane that gets a command which its servo does not take has failed. `mask` tells which lanes are meant, all
        unless given: numbers of 8 bits. On a GPU, here and in all that follows, the work is put on the stream
        (`put_on`); arrays that are there already are read in place, and then nothing is allocated and nothing waits.
        """
        self._do("tell", kind, command=command, torque=torque, mask=mask)

    def advance(self, duration: float, command: Any = None, torque: Any = None, *, kind: int = FOLLOWED) -> None:
        """Advance all lanes by a time [s], under commands and torques as `tell` takes them, or those before."""
        if command is not None or torque is not None:
            self.tell(command, torque, kind=kind)
        self._of.duration = duration
        self._at.clear("count")
        for k in range(len(self._texts) - 1):
            if k == 0 or self._at.any_left():
                self._at.call(k, "servotwin_advance", self._of, self._numbers.count)

    def begin(self, angle: Any = None, *, mask: Any = None) -> None:
        """Put lanes to rest at an angle [rad], or where they have no error where that is nan, and their clocks to 0.

        Noise continues where it was.
        """
        self._do("begin", angle=angle, mask=mask)

    def impose(self, *, angle: Any = None, speed: Any = None, inertia: Any = None, voltage: Any = None,
               torque_enable: Any = None, mask: Any = None) -> None:
        """Impose angles [rad], speeds [rad/s], inertias of loads [kg m²] and bus voltages [V]; nan: not.

        As `VectorSimulator.set` does. `torque_enable` is whether torque of digital servos is on.
        """
        self._do("impose", angle=angle, speed=speed, inertia=inertia, voltage=voltage, torque_enable=torque_enable,
                 mask=mask)

    def mask_of(self, lanes: Any) -> Any:
        """Return an array on the GPU, given for lanes, as a mask: numbers of lanes have another one made of them."""
        numbers = self._at.numbers_of(lanes)
        if numbers is None:
            return lanes
        self._of.kind, self._of.count_given, self._of.which = 8 * int(numbers.kind[1]), *numbers.shape, numbers.address
        self._at.clear("mask")
        self._of.mask = self._at.addresses["mask"]
        if self._of.count_given:
            self._at.call(len(self._texts) - 1, "servotwin_mark", self._of, self._of.count_given)
        return self.array("mask")

    def change(self, *, mask: Any = None) -> None:
        """Let lanes be other servos, each the next that is drawn for it; memories and inertias that were imposed stay.

        Noise continues where it was.
        """
        self._do("change", mask=mask)

    def look(self) -> Any:
        """Return what shows, shape (`threads.SEEN`, lanes), in place."""
        self._do("look")
        return self.array("seen")

    def _do(self, entry: str, kind: int = FOLLOWED, **given: Any) -> None:
        """Let all lanes go through an entry beside time, with what is given, and without what is None."""
        self._of.kind = kind
        for name, values in given.items():
            setattr(self._of, name, None if values is None else self._at.given(name, values))
        self._at.call(len(self._texts) - 1, f"servotwin_{entry}", self._of, self._numbers.count)

    @property
    def left(self) -> int:
        """How many lanes arcs have left to legs in the latest call."""
        self._at.fetch("count")
        return int(self._arrays["count"][0])

    @property
    def status(self) -> Any:
        """0 of each lane, or the code of a `Status`, shape (lanes,), in place; a lane that has failed is nan."""
        return self.array("status")

    def array(self, name: str) -> Any:
        """Return an array by its name in `threads`' table, in place: where the lanes are."""
        return self._at.seen(name)

    # --- what lanes remember ------------------------------------------------------------------------------------------

    def column(self, path: str) -> Any:
        """Return the column of something that lanes remember, shape (lanes,), in place: where the lanes are."""
        name, k = self._place[path]
        found = self.array(name)
        return found.row(k) if isinstance(found, GpuArray) else found[k]

    def _column(self, path: str) -> NDArray[Any]:
        name, k = self._place[path]
        found: NDArray[Any] = self._arrays[name][k]
        return found

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of each lane since it was reset [s]."""
        self._at.fetch("reals", "wholes")
        found: NDArray[np.float64] = self._column("stand.frames") * self._period + self._column("stand.time")
        return found

    @property
    def _period(self) -> NDArray[np.float64]:
        return period_of(self._numbers)

    def put(self, which: NDArray[np.int64], memories: Memories) -> None:
        """Let some lanes remember what records say."""
        self._at.fetch(*REMEMBERED)
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
        else:
            self._set(which, "now", self._chips_at(rows, frames, shift))
        self._arrays["status"][which] = 0
        self._at.send(*REMEMBERED)

    def _chips_at(self, rows: Any, frames: NDArray[np.int64], shift: NDArray[np.float64]) -> Any:
        """Return what chips remember, by times since the latest edge."""
        now, point = rows["chip"].copy(), rows["point"]
        for group, name in ((now, "drive_end"), (now, "clock"), (now["pending"], "time"), (now["later"], "time")):
            group[name] -= shift
        now["number"] = np.maximum(now["number"], frames)
        now["silent"] = np.where(point["anchor_time"] == np.inf, now["clock"] <= point["time"] - shift, now["silent"])
        return now

    def memories(self, which: NDArray[np.int64]) -> Memories:
        """Return what some lanes remember, as records."""
        self._at.fetch(*REMEMBERED)
        rest = nothing_yet(1)
        put_started(rest, 0, NOWHERE, RIGID)
        found = taken(rest, np.zeros(len(which), np.int64))
        rows, period = found.rows, self._period[which]
        frames, point = self._column("stand.frames")[which], rows["point"]
        rows["frames"], rows["beat"] = frames, period
        self._get(which, "stand.y", point["y"])
        for name in point["y"].dtype.names or ():
            point["anchor"][name] = point["y"][name]
        point["mode"]["mesh"], point["wiper"] = self._column("stand.mesh")[which], self._column("stand.wiper")[which]
        point["time"] = self._column("stand.time")[which]
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
                self._arrays["rings"][which, RINGS.index(name)] = value
            else:
                self._column(own)[which] = value

    def _get(self, which: Any, path: str, into: Any) -> None:
        for name in into.dtype.names:
            value, own = into[name], f"{path}.{identifier(name)}"
            if value.dtype.names:
                self._get(which, own, value)
            elif name in RINGS:
                value[:] = self._arrays["rings"][which, RINGS.index(name)]
            else:
                into[name] = self._column(own)[which]
