"""From checked lanes to what the kernels read, and from raw fields to output signals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, LoadError
from servotwin.models.columns import LanePieces, LaneServo, LaneSignal
from servotwin.models.engine.lanes import Lanes
from servotwin.models.outputs import FIELDS as FIELDS_OF
from servotwin.models.state.modes import Vector
from servotwin.models.state.records import mapped
from servotwin.models.terms.frame import NO_CHIP
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import table_of
from servotwin.physics.pieces import table_rows
from servotwin.signals.signal import KIND_NAMES
from servotwin.simulation.lanes.inputs import LAWS, LOAD_NAMES, LaneInputs, column_load, recorded_torque, structure
from servotwin.simulation.lanes.packed import FIELDS, MORE_FIELDS, SMALL_FIELDS, Asked, Packed, Raw, Torques
from servotwin.simulation.start import check_start, start_vector

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.models.columns import Samples

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_MOST_FRAMES = 1e8  # of a lane: they take half a minute, in which nothing stops a kernel


class Commands:
    """The commands of all lanes as one array of pieces."""

    def __init__(self, lanes: LaneInputs) -> None:
        signals, self.of = lanes.commands, lanes.command_of
        heads = lanes.headers
        self.kinds, self.initial, self.periods = heads["kind"], heads["initial"], heads["frame_period"]
        self.low, self.high, self.count = heads["lowest"], heads["highest"], heads["pieces"]
        self.rows = table_rows([signal.pieces for signal in signals])
        self.first = np.cumsum(self.count) - self.count
        self.edge_count = np.full(len(signals), -1)
        edges: list[tuple[float, ...]] = []
        for k in np.flatnonzero(heads["edges"] >= 0).tolist():
            own = lanes.model.edges(signals[k])
            if own is not None:
                self.edge_count[k] = len(own)
                edges.append(own)
        used = np.maximum(self.edge_count, 0)
        self.edge_first = np.cumsum(used) - used
        self.edges = np.fromiter(chain.from_iterable(edges), np.float64)
        # One number for what can share columns: kind, whether it has a frame period, whether it has edges
        self.shape = 4 * self.kinds + 2 * np.isnan(self.periods) + (heads["edges"] < 0)

    def signal(self, lanes: Indices) -> LaneSignal:
        """Return the commands of some lanes, all of one kind."""
        of = self.of[lanes]
        return self._signal(lanes, LanePieces(self.rows, self.first[of], self.count[of],
                                              low=self._shared(self.low, of), high=self._shared(self.high, of)))

    def before(self, lanes: Indices) -> LaneSignal:
        """Return the commands of just before the start, held for ever."""
        of = self.of[lanes]
        rows = np.zeros((len(self.initial), 7))
        rows[:, 1] = self.initial
        value = self._shared(self.initial, of)
        return self._signal(lanes, LanePieces(rows, of, np.ones_like(of), low=value, high=value))

    def _shared(self, values: Array, of: Indices) -> Any:
        return float(values[0]) if len(values) == 1 else values[of, None]

    def _signal(self, lanes: Indices, pieces: LanePieces) -> LaneSignal:
        of = self.of[lanes]
        period = None if math.isnan(self.periods[of[0]]) else self._shared(self.periods, of)
        edges = None if self.edge_count[of[0]] < 0 else ()
        return LaneSignal(KIND_NAMES[self.kinds[of[0]]], pieces, period, edges, lanes)


def groups(lanes: LaneInputs, commands: Commands) -> Iterator[Indices]:
    """Return the lanes in groups of one structure: one kind of command and frame, same words, loads of same parts."""
    of_command = commands.shape.tolist() if np.ptp(commands.shape) else [0]
    of_load = [structure(load) for load in lanes.loads]
    code = np.zeros(lanes.count, dtype=np.int64)
    for shapes, index in ((of_command, lanes.command_of), (of_load, lanes.load_of)):
        known = {shape: k for k, shape in enumerate(dict.fromkeys(shapes))}
        if len(known) > 1:
            code = code * len(known) + np.array([known[shape] for shape in shapes])[index]
    for words in lanes.words.values():
        options, more = np.unique(words, return_inverse=True)
        code = code * len(options) + more
    if not code.any():
        yield np.arange(lanes.count)
        return
    for value in np.unique(code):
        yield np.flatnonzero(code == value)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some lanes of one structure, with columns (n, 1) where they differ."""

    lanes: LaneInputs
    commands: Commands
    which: Indices

    def part(self, start: int, stop: int) -> Chunk:
        """Return some of these lanes; the same, checks and all, where it is all of them."""
        which = self.which[start:stop]
        return self if len(which) == len(self.which) else Chunk(self.lanes, self.commands, which)

    @cached_property
    def _columns(self) -> dict[str, Array]:
        return {name: column[self.which, None] for name, column in self.lanes.numbers.items()}

    @cached_property
    def _of_loads(self) -> tuple[list[Load], Indices]:
        if len(self.lanes.loads) == 1:
            return list(self.lanes.loads), np.zeros(len(self.which), dtype=np.int64)
        used, of = np.unique(self.lanes.load_of[self.which], return_inverse=True)
        return [self.lanes.loads[k] for k in used], of

    @cached_property
    def model(self) -> Model:
        """The model over these lanes."""
        servo, first = self.lanes.model.servo, int(self.which[0])
        if self.lanes.words:
            servo = servo.replace({name: str(words[first]) for name, words in self.lanes.words.items()})
        own = {name: column for name, column in self._columns.items() if name not in LOAD_NAMES}
        return self.lanes.model.over(LaneServo(servo, own))

    @cached_property
    def load(self) -> Load:
        """Their loads."""
        numbers = {name: column for name, column in self._columns.items() if name in LOAD_NAMES}
        return column_load(*self._of_loads, numbers)

    @cached_property
    def drive(self) -> LanePieces:
        """The signal that the model follows."""
        return cast("LanePieces", self.model.command(cast("Any", self.commands.signal(self.which))))

    @cached_property
    def numbers(self) -> Numbers:
        """The lanes' numbers, each a number or a column."""
        with np.errstate(all="ignore"):
            return self.model.pack(self.load)

    @cached_property
    def start(self) -> Array:
        """The states at t = 0, shape (7, n)."""
        before = cast("LanePieces", self.model.command(cast("Any", self.commands.before(self.which))))
        return self.started(before.initial, {name: column[self.which if len(column) > 1 else [0], None]
                                             for name, column in self.lanes.initial.items()})

    def started(self, drive: Any, initial: Mapping[str, Any]) -> Array:
        """Return the states at rest under what the models follow, but for initial values by name; shape (7, n)."""
        angle: Any = initial.get("output_angle")
        if angle is None:
            angle = self.model.start_angle(drive)
        y = np.empty((7, len(self.which), 1))
        for k, values in enumerate(start_vector(self.model.states, self.numbers, angle, initial)):
            y[k] = values
        return y[:, :, 0]

    def check(self, duration: float) -> None:
        """Raise where a command, an initial value or a load is not possible; names the lane."""
        of_loads, of = self._of_loads
        for k, load in enumerate(of_loads):
            try:
                load.check_span(0.0, duration)
            except LoadError as error:
                lane = self.which[np.argmax(of == k)]
                raise LoadError(f"{error.what} of lane {lane}", got=error.got, allowed=error.allowed) from None
        with np.errstate(all="ignore"):
            _ = self.drive  # raises if it cannot be followed
        frames = np.broadcast_to(self.frames(duration), self.which.shape)
        if (frames > _MOST_FRAMES).any():
            k = int(np.argmax(frames > _MOST_FRAMES))
            period, what = ("frame period", "frames") if self.firmware is None else ("control period", "ticks")
            raise InputError(f"duration / {period} of lane {self.which[k]}", got=f"{frames[k]:.3g} {what}",
                             allowed=f"at most {_MOST_FRAMES:.0e} in one run")
        if not self.lanes.initial:
            return  # it starts between the stops, and the motor in the middle of its play
        start = self.start
        numbers = mapped(flat, self.numbers)
        with np.errstate(invalid="ignore"):
            inside = ((start[0] >= numbers.stops.lower) & (start[0] <= numbers.stops.upper) & (numbers.play.half == 0.0)
                      & (numbers.heat.C_w == 0.0))
        if inside.all():
            return
        spread = mapped(lambda x: np.broadcast_to(x, self.which.shape), numbers)
        for k in np.flatnonzero(~inside).tolist():
            one = mapped(partial(_number, k), spread)
            try:
                check_start(self.model.states, one, Vector(*start[:, k].tolist()))
            except InputError as error:
                raise InputError(f"{error.what} of lane {self.which[k]}", got=error.got,
                                 allowed=error.allowed) from None

    @cached_property
    def chip(self) -> Any:
        """The numbers of the frame logic under these commands; None for a model without frames."""
        with np.errstate(all="ignore"):
            return self.model.chip(cast("Any", self.commands.signal(self.which)))

    @cached_property
    def firmware(self) -> Any:
        """The numbers of the program under these commands; None for a model without one."""
        with np.errstate(all="ignore"):
            return self.model.firmware(cast("Any", self.commands.signal(self.which)))

    def frames(self, duration: float) -> Any:
        """Return through how many frames or ticks the lanes run, a number or one per lane; 0 for models without."""
        if self.firmware is not None:
            with np.errstate(over="ignore"):
                return duration / np.asarray(flat(self.firmware.T_c), dtype=np.float64)
        if self.chip is None:
            return 0.0
        own = self.commands.edge_count[self.commands.of[self.which]]
        with np.errstate(over="ignore"):
            return np.where(own < 0, duration / np.asarray(flat(self.chip.frame_period), dtype=np.float64), own)

    def packed(self, accuracy: float) -> Packed:
        """Return what the lanes are to the kernels, which integrate to so many radians."""
        commands, of, none = self.commands, self.commands.of[self.which], np.zeros(len(self.which), np.int64)
        with np.errstate(all="ignore"):
            numbers, chip = self.numbers, self.chip
            first, count, rows = self.drive.tables()
        torque = Torques(np.zeros((0, 7)), none, none)
        if any(load.recorded for load in self._of_loads[0]):
            at, size, recorded = recorded_torque(*self._of_loads).tables()
            has = np.array([bool(load.recorded) for load in self._of_loads[0]])[self._of_loads[1]]
            torque = Torques(recorded, at, np.where(has, size, 0))
        lanes = Lanes(
            mapped(flat, numbers), mapped(flat, chip or NO_CHIP), self.start, flat(self.load.torque),
            self.lanes.seeds[self.which], rows, first, count, commands.edges, commands.edge_first[of],
            commands.edge_count[of], accuracy, self.firmware and mapped(flat, self.firmware))
        curve = np.array(table_of(self.model.curve()), np.float64).reshape(-1, 2)
        return Packed(LAWS[type(self.model)], lanes, curve, torque)

    def fields(self, asked: Asked) -> tuple[str, ...]:
        """Return the raw fields that the outputs read: those that they look at when they are computed for all lanes.

        A lane alone would not do: the motor of a lane with play turns otherwise than the output, that of the next not.
        """
        probe = _Probe(asked.times[:1])
        probe.seen.update(FIELDS_OF[name] for name in asked.outputs if name in FIELDS_OF)
        computed = [name for name in asked.outputs if name not in FIELDS_OF]
        with np.errstate(all="ignore"):
            for name in computed:
                self.model.output(name, cast("Samples", probe), cast("Any", self.drive), self.load)
        return tuple(field for field in (*FIELDS, *MORE_FIELDS) if field in probe.seen) or FIELDS[:1]

    def outputs(self, asked: Asked, raw: Raw) -> dict[str, Array]:
        """Return the outputs (SI), each broadcastable to (n, T)."""
        fields: Mapping[str, Any] = {name: values if values.dtype.kind == "i" else values.astype(np.float64, copy=False)
                                     for name, values in raw.fields.items()}
        samples = cast("Samples", SimpleNamespace(time=asked.times, **fields))
        gone = None
        if raw.status.any():
            gone = (raw.status != 0)[:, None] & (asked.times > raw.ended[:, None])
        signals = {}
        with np.errstate(all="ignore"):
            for name in asked.outputs:
                values = fields[FIELDS_OF[name]] if name in FIELDS_OF else self.model.output(
                    name, samples, cast("Any", self.drive), self.load)
                signals[name] = values if gone is None else np.where(gone, math.nan, values)
        return signals


class _Probe:
    """Samples of one lane that remember which fields were read."""

    def __init__(self, time: Array) -> None:
        self.time = time
        self.seen: set[str] = set()

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name not in FIELDS and name not in MORE_FIELDS:
            raise AttributeError(name)
        self.seen.add(name)
        return np.zeros((1, len(self.time)), dtype=np.int8 if name in SMALL_FIELDS else np.float64)


def _number(k: int, column: Array) -> float:
    return float(column[k])


def flat(value: Any) -> Any:
    """Return a column as an array (n,), and a number as it is."""
    return np.ascontiguousarray(value[:, 0]) if isinstance(value, np.ndarray) and value.ndim else value
