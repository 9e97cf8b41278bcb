"""What the lanes of a `VectorSimulator` are: checked inputs as numbers of the engine, and what of them shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, LoadError
from servotwin.loads import Load
from servotwin.models.columns import LanePieces
from servotwin.models.engine.memory import put_memory, started
from servotwin.models.engine.modes import INSIDE, RIGID
from servotwin.models.engine.records import TILE, columns_of, mapped, put_columns, tiles_with
from servotwin.models.engine.tiles import Lanes as Columns
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.numbers import NEUTRAL, Numbers
from servotwin.simulation import lane_runs
from servotwin.simulation.lane_inputs import LAWS, Lanes, lanes_of
from servotwin.simulation.lane_memory import RECORD
from servotwin.simulation.lanes import Tables
from servotwin.simulation.packing import Asked, Chunk, Commands, flat, groups
from servotwin.simulation.start import start_vector

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_SLACK = 1e-9  # rad: another simulator's stop may give way so much


class Imposed(NamedTuple):
    """What another simulator decides; nan where it does not, shape (lanes,)."""

    load_inertia: Array
    bus_voltage: Array


class LaneNumbers:
    """The lanes of a `VectorSimulator` as columns of numbers.

    Attributes
    ----------
    columns : models.engine.tiles.Lanes
    numbers : Numbers
        Of arrays (lanes,).
    torque : Tables
        Recorded torque over time; a lane without one has no row.
    curve : ndarray, shape (2, n)
        Angles [rad] and errors [V] of the potentiometers.
    """

    def __init__(self, inputs: Lanes, imposed: Imposed | None = None) -> None:
        self.inputs, self.model, self.count = inputs, inputs.model, inputs.count
        nothing = np.full(self.count, math.nan)
        self.imposed = Imposed(nothing, nothing.copy())
        commands = Commands(inputs)
        self.chunks = [Chunk(inputs, commands, which) for which in groups(inputs, commands)]
        self.pulsed = LAWS[type(inputs.model)] == "pulse"
        self.curve = np.array(inputs.model.curve(), np.float64).reshape(2, -1)
        self.neutral = np.empty(self.count)
        self.columns, self.torque = self._packed()
        self.frame_period = self.columns.chips["frame_period"].ravel()[:self.count]
        self.load_total, self._V_oc = np.empty((2, self.count))
        for chunk in self.chunks:
            self.load_total[chunk.which] = flat(chunk.load.total_inertia)
            self._V_oc[chunk.which] = flat(chunk.model.value("supply.open_circuit_voltage"))
        self.numbers: Any = columns_of(Numbers, self.columns.numbers, slice(self.count))
        self.chips = columns_of(Chip, self.columns.chips, slice(self.count))
        self._given = mapped(np.copy, self.numbers)
        if imposed is not None:
            for put, values in ((self.hang, imposed.load_inertia), (self.feed, imposed.bus_voltage)):
                which = np.flatnonzero(~np.isnan(values))
                put(which, values[which])

    def _packed(self) -> tuple[Columns, Tables]:
        B = self.count
        numbers, chips, start = tiles_with(Numbers, NEUTRAL, B), tiles_with(Chip, NO_CHIP, B), np.empty((7, B))
        torque, first, count = np.empty(B), np.zeros(B, np.int64), np.zeros(B, np.int64)
        rows: list[Array] = []
        for chunk in self.chunks:
            asked = Asked(1.0, np.zeros(1), (), "float64")
            work = chunk.work(asked, ())
            packed, which = lane_runs.lanes_of(work), chunk.which
            put_columns(numbers, which, columns_of(Numbers, packed.numbers, slice(len(which))))
            put_columns(chips, which, columns_of(Chip, packed.chips, slice(len(which))))
            start[:, which] = packed.start
            torque[which] = packed.torque
            first[which], count[which] = work.torque.first + sum(map(len, rows)), work.torque.count
            rows.append(work.torque.rows)
            self.neutral[which] = work.command.rows[work.command.first, 1]
        pieces = np.zeros((B, 7))
        index, none = np.arange(B), np.zeros(B, np.int64)
        columns = Columns(numbers, chips, start, torque, self.inputs.seeds.astype(np.int64), pieces, index, none + 1,
                          np.zeros(0), none, none - 1)
        return columns, Tables(first, count, np.concatenate(rows).reshape(-1, 7))

    def hang(self, which: Indices, J_L: Array) -> None:
        """Put inertias [kg m²] in the place of those of some lanes' loads."""
        self.imposed.load_inertia[which] = J_L
        given = self._given.shaft
        own = given.J_out[which] - self.load_total[which]
        self._put("shaft", which, J=given.J[which] + (J_L + own - given.J_out[which]), J_out=J_L + own)

    def feed(self, which: Indices, V: Array) -> None:
        """Put voltages [V] in the place of what some lanes' supplies would leave."""
        self.imposed.bus_voltage[which] = V
        V_oc = self._V_oc[which]
        if not self.pulsed:
            self._put("follower", which, V_max=np.maximum(self._given.follower.V_max[which] + V - V_oc, 0.0))
            return
        bridge, source = (mapped(lambda x: x[which], part) for part in (self._given.bridge, self._given.source))
        for name, off in (("off", bridge.off), ("silence", bridge.silence)):
            opens, battery = off.coast > 0.0, np.isinf(source.I_max)
            self._put(f"bridge.{name}", which, D=off.D + np.where(opens, V - V_oc, 0.0),
                      R=off.R - np.where(opens & battery, source.R_b, 0.0))
        self._put("bridge", which, R_drive=bridge.R_drive - source.R_b)
        self._put("source", which, V=V, R_b=np.zeros_like(V), I_max=np.full_like(V, math.inf))

    def _put(self, room: str, which: Indices, **columns: Array) -> None:
        own, packed = self.numbers, self.columns.numbers
        for part in room.split("."):
            own, packed = getattr(own, part), packed[part]
        for name, values in columns.items():
            getattr(own, name)[which] = packed[name][which // TILE, which % TILE] = values

    def changed(self, which: Indices, parameters: Mapping[str, Any]) -> LaneNumbers:
        """Return these lanes with other parameters in some of them.

        Raises
        ------
        InputError
            Or one of its kinds, as `simulate_many` has them; names the lane.
        """
        inputs = self.inputs
        if not isinstance(parameters, Mapping):
            raise InputError("parameters", got=parameters, allowed="a mapping of names to numbers or arrays (SI)")
        merged = {name: self._merged(name, value, which) for name, value in parameters.items()}
        known = {**inputs.numbers, **inputs.words}
        loads = [inputs.loads[k] for k in inputs.load_of.tolist()]
        inputs = lanes_of(inputs.model, inputs.commands[0], loads, {**known, **merged}, None, inputs.seeds)
        return LaneNumbers(inputs, self.imposed)

    def _merged(self, name: str, value: Any, which: Indices) -> Any:
        """Return a parameter of all lanes, of which some have new values."""
        if len(which) == self.count:
            return value
        now = {**self.inputs.numbers, **self.inputs.words}.get(name)
        if now is None:
            now = self._shared(name)
        if isinstance(now, np.ndarray):
            column = now.astype(object) if now.dtype.kind == "U" else now.copy()
        else:
            column = np.full(self.count, now, dtype=object if isinstance(now, str) else np.float64)
        given = np.asarray(value)
        if given.shape not in ((), (len(which),)):
            raise InputError(name, got=f"an array of shape {given.shape}",
                             allowed=f"a number, or an array ({len(which)},)")
        column[which] = given
        return column.tolist() if column.dtype == object else column

    def _shared(self, name: str) -> Any:
        group, _, key = name.partition(".")
        if group == "load":
            load: Any = self.inputs.loads[0]
            for part in key.split("."):
                load = getattr(load, part)
            return load
        value = self.inputs.model.servo.get(name)
        if value is None:
            raise InputError(f"parameters: {name}", got="a value for some lanes only",
                             allowed="one for all, for the servo does not give it")
        return value

    # --- where lanes are ----------------------------------------------------------------------------------------------

    def start(self, which: Indices, command: Array, angle: Array | None) -> NDArray[Any]:
        """Return the memories of lanes at rest, under commands of all lanes as the engine follows them.

        Raises
        ------
        InputError
            If an angle is beyond a stop; names the lane.
        """
        rest = np.zeros(1, RECORD)
        put_memory(rest[0], started((0.0,) * 7, RIGID))
        records = np.repeat(rest, len(which))
        place = np.full(self.count, -1)
        place[which] = np.arange(len(which))
        for chunk in self.chunks:
            own = chunk.which[place[chunk.which] >= 0]
            if not len(own):
                continue
            part = Chunk(chunk.lanes, chunk.commands, own)
            q = part.model.start_angle(cast("Any", command[own, None])) if angle is None else angle[place[own], None]
            y = np.empty((7, len(own), 1))
            for k, values in enumerate(start_vector(part.model.states, part.numbers, q, {})):
                y[k] = values
            if angle is not None:
                self.check_angles(angle[place[own]], own)
            play = self.numbers.play.half[own] > 0.0
            point = records["point"]
            for name in ("y", "anchor"):
                point[name][place[own]] = y[:, :, 0].T
            point["wiper"][place[own]] = y[0, :, 0]
            point["mode"]["mesh"][place[own]] = np.where(play, INSIDE, RIGID)
        return records

    def check_angles(self, angle: Array, which: Indices) -> None:
        """Raise InputError if an angle [rad] is beyond a stop; names the lane."""
        lower, upper = self.numbers.stops.lower[which], self.numbers.stops.upper[which]
        good = (angle >= lower - _SLACK) & (angle <= upper + _SLACK)
        if not good.all():
            k = int(np.argmin(good))
            raise InputError(f"output_angle of lane {which[k]}", got=float(angle[k]),
                             allowed=f"{lower[k]:.6g} to {upper[k]:.6g} rad, between the stops")

    def check_recorded(self, time: Callable[[], Array], duration: float) -> None:
        """Raise LoadError if a recorded torque ends before lanes that go on for a duration [s] do; names the lane."""
        if not self.torque.count.any():
            return
        now = time()
        for lane in np.flatnonzero(self.torque.count).tolist():
            load = self.inputs.loads[self.inputs.load_of[lane]]
            try:
                load.check_span(0.0, float(now[lane]) + duration)
            except LoadError as error:
                raise LoadError(f"{error.what} of lane {lane}", got=error.got, allowed=error.allowed) from None

    # --- what shows ---------------------------------------------------------------------------------------------------

    def observe(self, name: str, samples: SimpleNamespace, command: Array, torque: Array) -> Array:
        """Return a signal of all lanes that are in the states of `samples`, with fields of shape (lanes,)."""
        found = np.empty(self.count)
        for chunk in self.chunks:
            which = chunk.which
            own = SimpleNamespace(**{field: values[which, None] for field, values in vars(samples).items()
                                     if values is not None})
            own.time = np.zeros(1)
            if np.isnan(self.imposed.bus_voltage[which]).all():
                own.bus = None
            else:
                V = self.imposed.bus_voltage[which, None]
                own.bus = np.where(np.isnan(V), self.numbers.source.V[which, None], V)
            drive, load = _constant(command[which]), self._load(chunk, samples.time[which], torque)
            values = chunk.model.output(name, cast("Any", own), cast("Any", drive), load)
            found[which] = np.broadcast_to(values, (len(which), 1))[:, 0]
        return found

    def _load(self, chunk: Chunk, time: Array, torque: Array) -> Load:
        """Return the loads of lanes with all that acts on them now."""
        which, load = chunk.which, chunk.load
        changed = object.__new__(Load)
        for field in fields(load):
            object.__setattr__(changed, field.name, getattr(load, field.name))
        J_L = self.imposed.load_inertia[which]
        if not np.isnan(J_L).all():
            more = np.where(np.isnan(J_L), 0.0, J_L - self.load_total[which])
            object.__setattr__(changed, "inertia", load.inertia + more[:, None])
        own = self.columns.torque[which] + torque[which] + self._recorded(which, time)
        changed.__dict__["torque_pieces"] = _constant(own)
        return changed

    def _recorded(self, which: Indices, time: Array) -> Array:
        first, count, rows = self.torque.first[which], self.torque.count[which], self.torque.rows
        found = np.zeros(len(which))
        for k in np.flatnonzero(count).tolist():
            table = rows[first[k]:first[k] + count[k]]
            row = table[max(int(np.searchsorted(table[:, 0], time[k], side="right")) - 1, 0)]
            found[k] = row[1] + row[2] * (time[k] - row[0])
        return found


def _constant(values: Array) -> LanePieces:
    rows = np.zeros((len(values), 7))
    rows[:, 1] = values
    index = np.arange(len(values))
    return LanePieces(rows, index, np.ones_like(index))


