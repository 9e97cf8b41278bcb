"""Lanes of a `VectorSimulator`: checked inputs as numbers of the engine, and what of them shows."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import CommandError, InputError, LoadError
from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, DigitalServo
from servotwin.models.base import Model
from servotwin.models.columns import LanePieces, LaneSignal
from servotwin.models.engine.cosim import INERTIA, SLACK, VOLTAGE
from servotwin.models.engine.lanes import Lanes
from servotwin.models.engine.memory import Memories, put_started
from servotwin.models.state.modes import INSIDE, NOWHERE, RIGID, Vector
from servotwin.models.state.noise import chosen
from servotwin.models.state.records import TILE, columns_of, fields_of
from servotwin.models.terms.elastic import Elastic
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import Play
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.stops import Stops
from servotwin.models.terms.wiring import PULSE_RANGE, TRAVEL_SLACK
from servotwin.simulation.bus import Supplies, check_rigid, supplies_of
from servotwin.simulation.compile import kernels
from servotwin.simulation.compile.layout import GIVEN
from servotwin.simulation.lanes.forms import TICKS
from servotwin.simulation.lanes.inputs import LOAD_NAMES, LaneInputs, lanes_of
from servotwin.simulation.lanes.packed import Packed, Torques
from servotwin.simulation.lanes.packing import Chunk, Commands, flat, groups
from servotwin.simulation.lanes.tick_room import asked
from servotwin.simulation.lanes.whole_runs import nothing_yet, taken
from servotwin.units import is_finite, is_masked

if TYPE_CHECKING:
    from servotwin.models import Model


# --- Inputs of lanes at a tick, as the engine follows it: pulse width [s] or control voltage [V] ----------------------

_KINDS = {"pulse_width": "pulse_width", "command_angle": "angle", "command_voltage": "voltage"}


class _Scale(NamedTuple):
    """engine = gain · given + offset, and within which bounds given is surely good; each a number or (lanes,)."""

    gain: Any
    offset: Any
    low: float
    high: float


_INSIDE = 1e-9  # of a range whose ends are not possible themselves


class _Bounds(NamedTuple):
    """Commands of each lane: given from low to high, as the engine follows it between least and most; (lanes,)."""

    low: Any
    high: Any
    least: Any
    most: Any


class Translator:
    """Commands of lanes as the engine follows them; what it has found out once it keeps."""

    def __init__(self, numbers: LaneNumbers) -> None:
        self._numbers = numbers
        self._scales: dict[str, _Scale] = {}

    def command(self, pulse_width: Any, command_angle: Any, command_voltage: Any, which: Any) -> Any:
        """Return the command of all lanes, or of some, as the engine follows it; None where none is given.

        Raises
        ------
        InputError
            If two are given, or one is not possible; names lane and argument.
        """
        if pulse_width is not None:
            name, given = "pulse_width", pulse_width
            several = command_angle is not None or command_voltage is not None
        elif command_angle is not None:
            name, given, several = "command_angle", command_angle, command_voltage is not None
        elif command_voltage is not None:
            name, given, several = "command_voltage", command_voltage, False
        else:
            return None
        if several:
            raise InputError("command", got="more than one", allowed="one of " + ", ".join(_KINDS))
        scale = self._scales.get(name) or self._scale(name)
        if type(given) is float:
            good = scale.low < given < scale.high
        else:
            if is_masked(given):
                raise InputError(name, got="a masked array", allowed="numbers, none of them masked")
            try:
                given = np.asarray(given, dtype=np.float64)
            except (TypeError, ValueError, OverflowError):
                raise InputError(name, got=given, allowed="a number, or one number per lane") from None
            count = self._numbers.count if which is None else len(which)
            if given.shape not in ((), (count,)):
                raise InputError(name, got=f"an array of shape {given.shape}",
                                 allowed=f"a number, or an array ({count},)")
            good = given.size == 0 or bool(scale.low < given.min() and given.max() < scale.high)  # nan is neither
        if not good:
            self._look(name, given, which)
        gain, offset = scale.gain, scale.offset
        if which is not None:
            gain, offset = (x[which] if isinstance(x, np.ndarray) else x for x in (gain, offset))
        return gain * given + offset

    def table(self) -> Array:
        """Return gain, offset and bounds of each kind of command and lane, shape (3, lanes, 6); nan: not possible."""
        found = np.full((len(_KINDS), self._numbers.count, 6), math.nan)
        for rows, name in zip(found, _KINDS, strict=True):
            with contextlib.suppress(InputError):  # a servo may lack what a kind of command needs
                for k, column in enumerate(self._columns(name)):
                    rows[:, k] = column
        return found

    def _scale(self, name: str) -> _Scale:
        """Find out how the models take this kind of command."""
        gain, offset, low, high, least, most = self._columns(name)
        ends = np.sort([(least - offset) / gain, (most - offset) / gain], axis=0)
        low, high = float(np.maximum(low, ends[0]).max()), float(np.minimum(high, ends[1]).min())
        if np.ptp(gain) == 0.0 and np.ptp(offset) == 0.0:
            found = _Scale(float(gain[0]), float(offset[0]), low, high)
        else:
            found = _Scale(gain, offset, low, high)
        self._scales[name] = found
        return found

    def _columns(self, name: str) -> Array:
        """Return gain, offset and bounds of each lane, shape (6, lanes)."""
        found = np.empty((6, self._numbers.count))
        for chunk in self._numbers.chunks:
            rows = np.zeros((1, 7))
            pieces = cast("LanePieces", chunk.model.command(
                cast("Any", _signal(name, rows, chunk.which, math.nan, math.nan))))
            for column, values in zip(found, (pieces.gain, pieces.offset, *_bounds(name, chunk.model)), strict=True):
                column[chunk.which] = flat(values)
        return found

    def _look(self, name: str, given: Any, which: Any) -> None:
        """Raise CommandError if a command is not possible, lane by lane."""
        lanes = np.arange(self._numbers.count) if which is None else which
        values = np.broadcast_to(np.asarray(given, dtype=np.float64), lanes.shape)
        if not np.isfinite(values).all():
            k = int(np.argmin(np.isfinite(values)))
            raise CommandError(f"{name} of lane {lanes[k]}", got=float(values[k]), allowed="a finite number")
        for chunk in self._numbers.chunks:
            own = np.flatnonzero(np.isin(lanes, chunk.which))
            if not len(own):
                continue
            rows = np.zeros((len(own), 7))
            rows[:, 1] = values[own]
            Chunk(chunk.lanes, chunk.commands, lanes[own]).model.command(
                cast("Any", _signal(name, rows, lanes[own], values[own, None], values[own, None])))


def _bounds(name: str, model: Model) -> _Bounds:
    """Return what a model takes, as `models.base` checks it; numbers or columns."""
    low, high, least, most = -math.inf, math.inf, -math.inf, math.inf
    if name == "command_angle":
        low, high = (model.value_or(f"stops.{end}_angle", limit) + slack for end, limit, slack in (
            ("lower", -math.inf, -TRAVEL_SLACK), ("upper", math.inf, TRAVEL_SLACK)))
    if isinstance(model, AveragedServo | AveragedServoInductive | BoundedServo):
        if name == "pulse_width":
            low, high = (model.value_or(f"electronics.pulse_width_{end}", usual)
                         for end, usual in zip(("min", "max"), PULSE_RANGE, strict=True))
    elif not (isinstance(model, DigitalServo) and model.takes_goals):
        least, most = 0.0, cast("Any", model).frame_period  # the other models have pulses
    if isinstance(model, DigitalServo) and name == "command_angle":
        low = np.maximum(low, model.value_or("firmware.lower_goal", -math.inf) - TRAVEL_SLACK)
        high = np.minimum(high, model.value_or("firmware.upper_goal", math.inf) + TRAVEL_SLACK)
    return _Bounds(low, high, least, most)


def _signal(name: str, rows: Array, lanes: Any, low: Any, high: Any) -> LaneSignal:
    first = np.arange(len(lanes)) if len(rows) > 1 or len(lanes) == 1 else np.zeros(len(lanes), np.int64)
    return LaneSignal(_KINDS[name], LanePieces(rows, first, np.ones_like(first), low=low, high=high), None, None, lanes)


# --- Lanes of a `VectorSimulator` -------------------------------------------------------------------------------------

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
TUNED = frozenset(f"firmware.{name}" for name in (
    "proportional_gain", "integral_gain", "derivative_gain", "derivative_ticks", "derivative_threshold",
    "integral_limit", "rest_travel", "deadband_angle", "minimum_duty", "torque_limit", "duty_limit", "duty_slew",
    "current_limit", "speed_limit", "acceleration_limit", "minimum_speed", "overload_duty", "overload_time",
    "overload_output", "stall_travel", "trip_current", "trip_time", "trip_temperature", "undervoltage"))
"""Numbers of a program that its ticks read, and nothing else."""


def _in_rows(tiles: Any) -> Array:
    """Return tiles as numbers, shape (tiles, numbers of a lane, TILE)."""
    found: Array = tiles.view(np.float64).reshape(len(tiles), -1, TILE)
    return found


class Imposed(NamedTuple):
    """Decisions of another simulator; nan where there are none, shape (lanes,)."""

    load_inertia: Array
    bus_voltage: Array


class LaneNumbers:
    """The lanes of a `VectorSimulator` as columns of numbers.

    Attributes
    ----------
    columns : models.engine.lanes.Lanes
    available : tuple of str
        Names of the signals, `time` apart.
    reduction : ndarray, shape (lanes,)
        N of each gear.
    torque : Torques
    curve : ndarray, shape (n, 2)
        Rows of angle [rad] and error [V] of the potentiometers.
    given : ndarray
        Tiles of the numbers as servo and load say them, without what is imposed.
    load_total, V_oc : ndarray, shape (lanes,)
        Inertia of each load [kg m²], and voltage of each supply without a current [V].
    accuracy : float
        Of what is integrated [rad].
    supplies : Supplies
        Those that lanes share.
    """

    def __init__(self, inputs: LaneInputs, accuracy: float, supplies: Supplies, imposed: Imposed | None = None) -> None:
        self.inputs, self.model, self.count = inputs, inputs.model, inputs.count
        self.accuracy, self.supplies = accuracy, supplies
        self.available = inputs.model.signals_with(*inputs.loads)
        nothing = np.full(self.count, math.nan)
        self.imposed = Imposed(nothing, nothing.copy())
        self.neutral = np.empty(self.count)
        self._given = self._joined()
        law, _, self.curve, self.torque = self._given
        self.pulsed, self.digital = law != "bounded", law == "digital"  # whether there is a bridge, and a program
        self.recorded = bool(self.torque.count.any())  # whether a record of torque may end
        self.columns = self._given.columns()
        self.frame_period = self.columns.chips["frame_period"].ravel()[:self.count]
        self.load_total, self.reduction, self.V_oc = np.empty((3, self.count))
        for chunk in self.chunks:
            self.load_total[chunk.which] = flat(chunk.load.total_inertia)
            self.reduction[chunk.which] = flat(chunk.model.value("gear.gear_reduction"))
            self.V_oc[chunk.which] = flat(chunk.model.value_or("supply.open_circuit_voltage", math.nan))
        for k in np.concatenate([*supplies.lanes, np.zeros(0, np.int64)]).tolist():
            check_rigid(f"lane {k} on a bus", Elastic(*(x[0] for x in self.now(Elastic, np.array([k])))))
        self.given = self.columns.numbers.copy()
        self._models: dict[int, Model] = {}  # of lanes that were retuned
        if imposed is not None:
            hung, fed = (np.flatnonzero(~np.isnan(values)) for values in imposed)
            if len(hung):
                self.impose(hung, imposed.load_inertia[hung], None)
            if len(fed):
                self.impose(fed, None, imposed.bus_voltage[fed])

    @cached_property
    def chunks(self) -> list[Chunk]:
        """The lanes in groups of one structure."""
        commands = Commands(self.inputs)
        return [Chunk(own, commands, part) for which in groups(self.inputs, commands)
                for own, part in self.supplies.parts(self.inputs, which)]

    def _joined(self) -> Packed:
        """Return all lanes, whose inputs stay the same for ever."""
        parts = [(chunk.which, chunk.packed(self.accuracy)) for chunk in self.chunks]
        lanes, B = [part.lanes for _, part in parts], self.count

        def joined(*values: Any) -> Any:
            if hasattr(values[0], "_fields"):
                return type(values[0])(*map(joined, *values))
            column = np.empty((*np.shape(values[0])[:-1], B))
            for (which, _), x in zip(parts, values, strict=True):
                column[..., which] = x
            return column

        at = np.cumsum([0, *(len(part.torque.rows) for _, part in parts)])
        first, count = np.zeros((2, B), np.int64)
        for (which, part), rows in zip(parts, at, strict=False):
            first[which], count[which] = part.torque.first + rows, part.torque.count
            self.neutral[which] = part.lanes.pieces[part.lanes.piece_first, 1]
        index, none = np.arange(B), np.zeros(B, np.int64)
        numbers, chips, start, torque = (joined(*(getattr(own, name) for own in lanes))
                                         for name in ("numbers", "chips", "start", "torque"))
        own = Lanes(numbers, chips, start, torque, self.inputs.seeds.astype(np.int64), np.zeros((B, 7)), index,
                      none + 1, np.zeros(0), none, none - 1, self.accuracy,
                      joined(*(own.firmware for own in lanes)) if parts[0][1].law == "digital" else None)
        rows = np.concatenate([part.torque.rows for _, part in parts])
        return Packed(parts[0][1].law, own, parts[0][1].curve, Torques(rows, first, count))

    def packed(self) -> Packed:
        """Return the lanes as they are now, as `forms.kinds_of` asks them."""
        own, every = self.columns, slice(self.count)
        firmware = Firmware(*(own.firmware[name] for name in Firmware._fields)) if self.digital else None
        return self._given._replace(lanes=own._replace(
            numbers=columns_of(Numbers, own.numbers, every), chips=columns_of(Chip, own.chips, every),
            firmware=firmware))

    @cached_property
    def translate(self) -> Translator:
        """The translation of these lanes' commands."""
        return Translator(self)

    def now(self, kind: Any, which: Indices | None = None) -> Any:
        """Return a term's record of numbers of some lanes, or of all, as they are now, each an array."""
        name = next(name for name, term in fields_of(Numbers) if term is kind)
        return columns_of(kind, self.columns.numbers[name],
                          slice(self.count) if which is None else which)

    def impose(self, which: Indices, J_L: Array | None, V: Array | None) -> bool:
        """Put inertias [kg m²] and bus voltages [V] in the place of those of some lanes' loads and supplies.

        Return whether the lanes may have to run in another way than before.
        """
        has, given = asked({INERTIA: J_L, VOLTAGE: V}, which, self.count)
        return bool(kernels(TICKS).change(has, given, which, self.given, self.load_total, self.V_oc, self.pulsed,
                                          *self.imposed, self.columns.numbers))

    def retuned(self, which: Indices, parameters: Mapping[str, Any]) -> bool:
        """Take other numbers of programs in place, where nothing else follows from them; return whether that was all.

        So it is with lanes on shared supplies, whose kernels read them at every tick: a few microseconds, and motions
        continue, where `changed` lays all lanes out anew.

        Raises
        ------
        InputError
            Or one of its kinds, if a value is not possible; then nothing has changed.
        """
        if not self.digital or not TUNED.issuperset(parameters) or np.any(self.supplies.bus_of[which] < 0):
            return False
        numbers, values = dict(self.inputs.numbers), dict[str, Array]()
        for name, value in parameters.items():
            if isinstance(value, str) or (name not in numbers and self.inputs.model.servo.get(name) is None):
                return False
            given = np.asarray(value)
            if given.dtype.kind not in "iuf" or given.shape not in ((), which.shape):
                return False
            values[name] = np.broadcast_to(given.astype(np.float64), which.shape)
            numbers[name] = numbers[name].copy() if name in numbers else np.full(self.count, self._now(name))
            numbers[name][which] = values[name]
        models = dict[int, Any]()
        for k, lane in enumerate(which.tolist()):
            model: Any = self._models.get(lane) or self.inputs.lane_model(lane)
            own = {name: float(column[k]) for name, column in values.items()}
            models[lane] = type(model)(model.servo.replace(own))
        self._models |= models
        for lane, model in models.items():
            self.columns.firmware[lane] = tuple(np.float64(x) for x in model.firmware(None))
        self.inputs = replace(self.inputs, numbers=numbers)
        return True

    def changed(self, which: Indices, parameters: Mapping[str, Any], bus: Any = None) -> LaneNumbers:
        """Return these lanes with other parameters in some of them, and other supplies on their buses.

        Raises
        ------
        InputError
            Or one of its kinds, as `simulate_many` has them; names the lane.
        """
        inputs = self.inputs
        if not isinstance(parameters, Mapping):
            raise InputError("parameters", got=parameters, allowed="a mapping of names to numbers or arrays (SI)")
        self.supplies.check_parameters(list(parameters), which)
        merged = {name: self._merged(name, value, which) for name, value in parameters.items()}
        known = {**inputs.numbers, **inputs.words}
        loads = [inputs.loads[k] for k in inputs.load_of.tolist()]
        inputs = lanes_of(inputs.model, inputs.commands[0], loads, {**known, **merged}, None, inputs.seeds)
        supplies = self.supplies if bus is None else supplies_of(bus, inputs.model, inputs.count)
        return LaneNumbers(inputs, self.accuracy, supplies, self.imposed)

    def repacked(self, which: Indices, parameters: Mapping[str, Any]) -> LaneNumbers | None:
        """Return some lanes with other parameters, packed by themselves; None where they need more than their places.

        Nothing is said of what is not possible: `changed` does.
        """
        inputs = self.inputs
        known = {**inputs.numbers, **inputs.words}
        if np.any(self.supplies.bus_of[which] >= 0) or not isinstance(parameters, Mapping):
            return None
        for name, value in parameters.items():
            shared = name in inputs.numbers or name in LOAD_NAMES or is_finite(inputs.model.servo.get(name))
            if not shared or np.shape(value) not in ((), which.shape) or np.asarray(value).dtype.kind not in "iuf":
                return None
        values = {name: column[which] for name, column in known.items()} | dict(parameters)
        loads = [inputs.loads[k] for k in inputs.load_of[which].tolist()]
        try:
            own = lanes_of(inputs.model, inputs.commands[0], loads, values, None, inputs.seeds[which])
            part = LaneNumbers(own, self.accuracy, Supplies((), (), len(which)))
        except InputError:
            return None
        fits = (part.available == self.available and np.array_equal(part.curve, self.curve)
                and np.array_equal(part.frame_period, self.frame_period[which]))
        return part if fits else None

    def take(self, which: Indices, part: LaneNumbers, names: Iterable[str], of: Any = slice(None)) -> None:
        """Put lanes of a part, or some of those, into their places; of these names they have other numbers."""
        numbers = dict(self.inputs.numbers)
        for name in names:
            column = numbers[name].copy() if name in numbers else np.full(self.count, self._now(name))
            column[which] = part.inputs.numbers[name][of] if name in part.inputs.numbers else part._now(name)
            numbers[name] = column
        self.inputs = replace(self.inputs, numbers=numbers)
        if 0 in which:
            self.inputs = replace(self.inputs, model=self.inputs.lane_model(0))
        for kept in ("chunks", "translate"):
            self.__dict__.pop(kept, None)
        own, theirs, every = self.columns, part.columns, np.arange(part.count)[of]
        for there, here in ((theirs.numbers, own.numbers), (theirs.numbers, self.given), (theirs.chips, own.chips)):
            _in_rows(here)[which // TILE, :, which % TILE] = _in_rows(there)[every // TILE, :, every % TILE]
        if self.digital:
            own.firmware[which] = theirs.firmware[of]
        own.torque[which] = theirs.torque[of]
        for name in ("load_total", "reduction", "V_oc", "neutral"):
            getattr(self, name)[which] = getattr(part, name)[of]
        for k, values in enumerate(self.imposed):
            again = which[~np.isnan(values[which])]
            if len(again):
                self.impose(again, values[again] if k == 0 else None, values[again] if k == 1 else None)

    def _merged(self, name: str, value: Any, which: Indices) -> Any:
        """Return a parameter of all lanes, of which some have new values."""
        if len(which) == self.count:
            return value
        now = {**self.inputs.numbers, **self.inputs.words}.get(name)
        if now is None:
            now = self._now(name)
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

    def _now(self, name: str) -> Any:
        """Return a parameter that is no column as it stands: of loads, that of each lane where they differ."""
        group, _, key = name.partition(".")
        if group == "load":
            read = attrgetter(key)
            values = [read(load) for load in self.inputs.loads]
            return values[0] if len(values) == 1 else np.array(values, np.float64)[self.inputs.load_of]
        value = self.inputs.model.servo.get(name)
        if value is None:
            raise InputError(f"parameters: {name}", got="a value for some lanes only",
                             allowed="one for all, for the servo does not give it")
        return value

    # --- where lanes are ----------------------------------------------------------------------------------------------

    def start(self, which: Indices, command: Array, angle: Array | None) -> Memories:
        """Return the memories of lanes at rest, under commands of all lanes as the engine follows them.

        Raises
        ------
        InputError
            If an angle is beyond a stop; names the lane.
        """
        place, y = np.full(self.count, -1), np.empty((7, self.count))
        place[which] = np.arange(len(which))
        if angle is not None:
            self.check_angles(angle, which)
        for chunk in self.chunks:
            own = chunk.which[place[chunk.which] >= 0]
            if len(own):
                initial = {} if angle is None else {"output_angle": angle[place[own], None]}
                y[:, own] = Chunk(chunk.lanes, chunk.commands, own).started(command[own, None], initial)
        rest = nothing_yet(1)
        put_started(rest, 0, NOWHERE, RIGID)
        memories = taken(rest, np.zeros(len(which), np.int64))
        point = memories.rows["point"]
        for k, name in enumerate(Vector._fields):
            point["y"][name] = point["anchor"][name] = y[k, which]
        point["wiper"] = y[0, which]
        point["mode"]["mesh"] = np.where(self.now(Play, which).half > 0.0, INSIDE, RIGID)
        return memories

    def check_angles(self, angle: Array, which: Indices) -> None:
        """Raise InputError if an angle [rad] is beyond a stop; names the lane."""
        lower, upper, _ = self.now(Stops, which)
        good = (angle >= lower - SLACK) & (angle <= upper + SLACK)
        if not good.all():
            k = int(np.argmin(good))
            raise InputError(f"output_angle of lane {which[k]}", got=float(angle[k]),
                             allowed=f"{lower[k]:.6g} to {upper[k]:.6g} rad, between the stops")

    def command_ends(self, name: str) -> tuple[Array, Array]:
        """Return the lowest and highest command of each lane, of the kind `name`.

        Raises
        ------
        InputError
            If a servo takes none of this kind.
        """
        gain, offset, low, high, least, most = self.translate.table()[GIVEN.index(name)].T
        if np.isnan(gain).any():
            raise InputError(f"{name} of lane {np.isnan(gain).argmax()}", allowed="no command of this kind")
        ends = np.sort([(least - offset) / gain, (most - offset) / gain], axis=0)
        inside = _INSIDE * (ends[1] - ends[0])
        inside[~np.isfinite(inside)] = 0.0
        return np.maximum(low, ends[0] + inside), np.minimum(high, ends[1] - inside)

    def travel(self) -> tuple[Array, Array]:
        """Return the stops of each lane [rad]; infinite where there are none."""
        stops = self.now(Stops)
        return np.array(stops.lower), np.array(stops.upper)

    def own_inertia(self) -> Array:
        """Return of each lane what turns with the output without its load, the motor included unless it has play."""
        name = next(name for name, term in fields_of(Numbers) if term is Shaft)
        shaft = columns_of(Shaft, self.given[name], slice(self.count))  # the same whatever load is imposed
        apart = (self.now(Play).half > 0.0) | (self.now(Elastic).k > 0.0)
        return np.asarray(np.where(apart, shaft.J_out, shaft.J) - self.load_total)

    def check_recorded(self, now: Array, duration: float) -> None:
        """Raise LoadError if a recorded torque ends before lanes that advance by a duration [s] do; names the lane."""
        for lane in np.flatnonzero(self.torque.count).tolist():
            load = self.inputs.loads[self.inputs.load_of[lane]]
            try:
                load.check_span(0.0, float(now[lane]) + duration)
            except LoadError as error:
                raise LoadError(f"{error.what} of lane {lane}", got=error.got, allowed=error.allowed) from None

    def record_ends(self) -> Array:
        """Return when the recorded torque of each lane ends [s]: inf without one, −inf where it begins late."""
        ends = np.full(self.count, math.inf)
        for lane in np.flatnonzero(self.torque.count).tolist():
            first, last = self.inputs.loads[self.inputs.load_of[lane]].time_span
            ends[lane] = last if first <= 0.0 else -math.inf
        return ends

    # --- what shows ---------------------------------------------------------------------------------------------------

    def commanded(self, name: str, command: Array) -> Array:
        """Return `command_voltage`, `command_angle` or `pulse_width` of all lanes, as the engine follows it."""
        found = np.empty(self.count)
        for chunk in self.chunks:
            found[chunk.which] = chunk.model.command_signal(name, command[chunk.which, None])[:, 0]
        return found


# --- Lanes that are other servos from reset to reset ------------------------------------------------------------------

class Variants:
    """Servos of which a lane is one from reset to reset; which, follows from its seed and how many it has had before.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (n,)
        Their parameters by dotted name.
    draws : ndarray of int, shape (lanes,)
        How many each lane has had before the present one.
    numbers : LaneNumbers
        All of them, a lane of each; where lanes differ otherwise too, as in the first.

    Raises
    ------
    InputError
        Or one of its kinds, if one of them is not possible; names it.
    """

    def __init__(self, columns: Any, seeds: NDArray[np.int64], *, model: Model, command: Any, load: Any,
                 parameters: Mapping[str, Any], accuracy: float) -> None:
        if not isinstance(columns, Mapping) or not columns:
            raise InputError("variants", got=columns, allowed="a mapping of names to arrays (SI)")
        if not isinstance(parameters, Mapping):
            raise InputError("parameters", got=parameters, allowed="a mapping of names to numbers or arrays (SI)")
        twice = next((name for name in columns if name in parameters), None)
        if twice is not None:
            raise InputError(f"variants: {twice}", got="a parameter of all lanes too", allowed="one of both")
        self.columns = {name: np.asarray(values) for name, values in columns.items()}
        self.count = max((values.size for values in self.columns.values()), default=0)
        for name, values in self.columns.items():
            if values.ndim != 1 or len(values) != self.count or self.count == 0:
                raise InputError(f"variants: {name}", got=f"an array of shape {values.shape}",
                                 allowed="an array (n,) with a value of each servo, of one length n for all names")
        self._seeds, self.draws = seeds, np.zeros(len(seeds), np.int64)
        first = {name: np.asarray(value).ravel()[0] for name, value in parameters.items() if np.size(value)}
        try:
            own = lanes_of(model, command, load[0] if isinstance(load, list | tuple) and load else load,
                           first | self.columns, None, np.arange(self.count))
            self.numbers = LaneNumbers(own, accuracy, Supplies((), (), self.count))
        except InputError as error:
            if " of lane " not in error.what:
                raise
            raise type(error)(error.what.replace(" of lane ", " of variant "), got=error.got,
                              allowed=error.allowed) from None

    def of(self, which: Any) -> Indices:
        """Return which of them lanes are now."""
        found: Indices = np.asarray(chosen(cast("Any", self._seeds[which]), cast("Any", self.draws[which]), self.count))
        return found

    def now(self, which: Any = slice(None)) -> dict[str, NDArray[Any]]:
        """Return the parameters of lanes as they are now."""
        return {name: values[self.of(which)] for name, values in self.columns.items()}

    def drawn(self, which: Indices) -> dict[str, NDArray[Any]]:
        """Return those of lanes that are the next ones from now on."""
        self.draws[which] += 1
        return self.now(which)
