"""The arguments of `simulate_many`, checked before anything runs: what differs from lane to lane as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import CommandError, InputError, LoadError, ParameterError, UnknownNameError
from servotwin.loads import Flexible, Load, Pendulum, Spring, as_load
from servotwin.models import (
    AveragedServo,
    AveragedServoInductive,
    BoundedServo,
    DCMotor,
    DigitalServo,
    GearedMotor,
    Model,
    PulseServo,
    PulseServoInductive,
)
from servotwin.models.columns import LanePieces
from servotwin.parameters import GROUPS, Servo
from servotwin.parameters.groups import check_columns
from servotwin.signals import Signal
from servotwin.signals.signal import headers
from servotwin.units import is_finite, is_masked

# --- Loads of many lanes: their numbers by dotted name, one by one and as columns -------------------------------------

Kind = TypeVar("Kind")
_PARTS: dict[str, type[Pendulum] | type[Spring] | type[Flexible]] = {
    "pendulum": Pendulum, "spring": Spring, "flexible": Flexible}
_OWN = ("inertia", "viscous_friction", "torque", "coulomb_torque")
LOAD_NAMES = (*(f"load.{name}" for name in _OWN),
              *(f"load.{part}.{f.name}" for part, kind in _PARTS.items() for f in fields(kind)))


def check_number(name: str, values: Any) -> None:
    """Raise LoadError if a number of a load, or one lane's of a column, is out of its range."""
    _, *part, key = name.split(".")
    kind = _PARTS[part[0]] if part else Load
    good, allowed = np.isfinite(values), "a finite number"
    if key in getattr(kind, "positive", ()):
        good, allowed = good & (np.asarray(values) > 0.0), "a finite positive number"
    if key in kind.not_negative:
        good, allowed = good & (np.asarray(values) >= 0.0), "a finite number of at least 0"
    if np.all(good):
        return
    if np.ndim(values) == 0:
        raise LoadError(name, got=float(values), allowed=allowed)
    lane = int(np.argmin(good))
    raise LoadError(f"{name} of lane {lane}", got=float(values[lane]), allowed=allowed)


def with_numbers(load: Load, numbers: Mapping[str, float]) -> Load:
    """Return a load with some numbers replaced, by dotted name.

    Raises
    ------
    LoadError
        If a name is that of a pendulum, a spring or a flexible body, and the load has not exactly one.

    Examples
    --------
    >>> with_numbers(Load(inertia=1e-3), {"load.torque": 0.1}).torque
    0.1
    """
    own = {name.split(".")[1]: value for name, value in numbers.items() if name.count(".") == 1}
    changed: dict[str, Any] = dict(own)
    for part in _PARTS:
        new = {name.split(".")[2]: value for name, value in numbers.items() if name.startswith(f"load.{part}.")}
        if new:
            changed[f"{part}s"] = (replace(getattr(load, part), **new),)
    return replace(load, **changed) if changed else load


def structure(load: Load) -> tuple[object, ...]:
    """Return what two loads must share to stand in one column: their parts, and which numbers these have."""
    return (len(load.springs), tuple(p.inertia is None for p in load.pendulums),
            tuple(body.inertia is None for body in load.flexibles))


def column_load(loads: Sequence[Load], load_of: Indices, numbers: Mapping[str, Array]) -> Load:
    """Return the loads of many lanes as one, whose numbers are columns (B, 1) where lanes differ.

    Parameters
    ----------
    loads : sequence of Load
        Of one structure.
    load_of : ndarray of int, shape (B,)
    numbers : mapping
        Columns (B, 1) by dotted name that stand for the loads' own.
    """
    def column(name: str, items: Sequence[Any]) -> Any:
        if name in numbers:
            return numbers[name]
        values = [getattr(item, name.rpartition(".")[2]) for item in items]
        if values[0] is None or all(value == values[0] for value in values):
            return values[0]
        return np.array(values, dtype=np.float64)[load_of, None]

    def parts(kind: Any, part: str) -> tuple[Any, ...]:
        return tuple(_unchecked(kind, {f.name: column(f"load.{part}.{f.name}", items) for f in fields(kind)})
                     for items in zip(*(getattr(load, f"{part}s") for load in loads), strict=True))

    own = {name: column(f"load.{name}", loads) for name in _OWN}
    load = _unchecked(Load, own | {f"{part}s": parts(kind, part) for part, kind in _PARTS.items()} | {"recorded": ()})
    recorded = recorded_torque(loads, load_of)
    load.__dict__["torque_pieces"] = recorded.scaled(1.0, load.torque)  # stands for the cached property
    return load


def recorded_torque(loads: Sequence[Load], load_of: Indices) -> LanePieces:
    """Return the recorded torque of each lane; a load without one has a single piece that is 0."""
    tables = [np.zeros((1, 7)) if load.recorded_pieces is None else np.array(load.recorded_pieces.table)
              for load in loads]
    count = np.array([len(table) for table in tables])
    first = np.cumsum(count) - count
    return LanePieces(np.concatenate(tables), first[load_of], count[load_of])


def _unchecked(kind: type[Kind], numbers: Mapping[str, Any]) -> Kind:
    """Return a load or part whose numbers are columns, which were checked before."""
    item = object.__new__(kind)
    for name, value in numbers.items():
        object.__setattr__(item, name, value)
    return item


# --- The arguments of `simulate_many`, checked before anything runs ---------------------------------------------------

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
LAWS: dict[type[Model], str] = {
    DCMotor: "voltage", GearedMotor: "voltage", AveragedServo: "bounded", AveragedServoInductive: "bounded",
    BoundedServo: "bounded", PulseServo: "pulse", PulseServoInductive: "pulse", DigitalServo: "digital"}
"""How each model is commanded; the averaged servos are bounded ones without bounds, under a smoothed friction."""


@dataclass(frozen=True, eq=False)
class LaneInputs:
    """The inputs: values common to all lanes once, others as arrays (B,).

    Parameters
    ----------
    model : Model
        Of lane 0.
    count : int
        Number of lanes B.
    numbers, words : mapping of str to ndarray, shape (B,)
        Numbers and words of servo and load that differ, by dotted name.
    commands, loads : tuple
        Each once; `command_of` and `load_of` say which is a lane's.
    initial : mapping of str to ndarray, shape (B,) or (1,)
        Initial values by state name.
    seeds : ndarray of int64, shape (B,)
    """

    model: Model
    count: int
    numbers: Mapping[str, Array]
    words: Mapping[str, NDArray[np.str_]]
    commands: tuple[Signal, ...]
    command_of: Indices
    loads: tuple[Load, ...]
    load_of: Indices
    initial: Mapping[str, Array]
    seeds: Indices

    @cached_property
    def headers(self) -> NDArray[Any]:
        """Those of `commands`."""
        return headers(self.commands)

    def load(self, lane: int) -> Load:
        """Return the load of a lane."""
        numbers = {name: float(column[lane]) for name, column in self.numbers.items() if name in LOAD_NAMES}
        return with_numbers(self.loads[self.load_of[lane]], numbers)

    def lane_model(self, lane: int) -> Model:
        """Return the model of a lane."""
        values: dict[str, Any] = {name: float(column[lane]) for name, column in self.numbers.items()
                                  if name not in LOAD_NAMES}
        values |= {name: str(column[lane]) for name, column in self.words.items()}
        return type(self.model)(self.model.servo.replace(values)) if values else self.model

    def initial_of(self, lane: int) -> dict[str, float]:
        """Return the initial values of a lane."""
        return {name: float(column[lane if len(column) > 1 else 0]) for name, column in self.initial.items()}


def lanes_of(model: Model, command: object, load: object, parameters: object, initial: object,
             seeds: object) -> LaneInputs:
    """Check the arguments of `simulate_many` that differ from lane to lane, and zip them.

    Raises
    ------
    InputError
        Or one of its kinds; names what is wrong, and the lane.
    """
    if type(model) not in LAWS:
        raise InputError("model of many lanes", got=model, allowed=" or ".join(kind.__name__ for kind in LAWS))
    given = _named("parameters", parameters)
    for name in given:
        check_name(model, name)
    values = {name: _value(name, value) for name, value in given.items()}
    start = {name: _numbers(f"initial {name}", value) for name, value in _named("initial", initial).items()}
    _check_states(model, start)
    commands, command_of = _once(command)
    _check_commands(commands, command_of)
    parts, load_of = _once(load)
    loads = _loads(parts, load_of)
    seed = None if seeds is None else _seeds(seeds)
    count = _common_length({
        **values, **{f"initial {name}": value for name, value in start.items()},
        "command": command_of, "load": load_of, **({} if seed is None else {"seeds": seed})})
    values = {name: value[0].item() if isinstance(value, np.ndarray) and value.size == 1 else value
              for name, value in values.items()}
    columns = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    servo = _servo_of_first(model.servo, {name: v for name, v in values.items() if name not in LOAD_NAMES})
    of_load = {name: value for name, value in values.items() if name in LOAD_NAMES}
    loads = _with_numbers(loads, load_of, of_load)
    return LaneInputs(
        model=model if servo is model.servo else type(model)(servo), count=count,
        numbers={name: column for name, column in columns.items() if column.dtype.kind == "f"},
        words={name: column for name, column in columns.items() if column.dtype.kind == "U"},
        commands=commands, command_of=_spread(command_of, count), loads=loads, load_of=_spread(load_of, count),
        initial={name: np.atleast_1d(value) for name, value in start.items()},
        seeds=np.arange(count) if seed is None else _spread(np.atleast_1d(seed), count))


def framed(lanes: LaneInputs, until: float) -> LaneInputs:
    """Return lanes whose commands have their pulses one by one where they have silences, as far as `until` [s]."""
    if not any(signal.silences for signal in lanes.commands):
        return lanes
    if "electronics.frame_period" not in lanes.numbers:
        return replace(lanes, commands=tuple(lanes.model.framed(signal, until) for signal in lanes.commands))
    # Each lane has frames of its own
    commands = tuple(lanes.lane_model(lane).framed(lanes.commands[k], until)
                     for lane, k in enumerate(lanes.command_of.tolist()))
    return replace(lanes, commands=commands, command_of=np.arange(lanes.count))


def pick(lanes: Any, count: int) -> Indices:
    """Return the numbers of the lanes that a mask, or a list of numbers, means; all for None.

    Raises
    ------
    InputError
        If the mask has another length, or a lane is out of range.
    """
    if lanes is None:
        return np.arange(count)
    array = np.atleast_1d(_array(lanes))
    if array.dtype == np.bool_ and array.shape == (count,):
        return np.flatnonzero(array)
    if array.ndim != 1 or array.dtype.kind not in "iu" or is_masked(lanes):
        raise InputError("lanes", got=lanes if array.size < 20 else f"an array of shape {array.shape}",
                         allowed=f"a mask of {count} lanes, or numbers of lanes from 0 to {count - 1}")
    bad = (array < 0) | (array >= count)
    if bad.any() or len(np.unique(array)) < len(array):
        raise InputError("lanes", got=array[bad].tolist() if bad.any() else "a lane twice",
                         allowed=f"numbers of lanes from 0 to {count - 1}, each once")
    return array.astype(np.int64)


def _named(what: str, mapping: object) -> Mapping[str, Any]:
    if mapping is None:
        return {}
    if not isinstance(mapping, Mapping) or not all(isinstance(name, str) for name in mapping):
        raise InputError(what, got=mapping, allowed="a mapping of names to numbers or arrays (SI)")
    return mapping


def check_name(model: Model, name: str) -> None:
    """Raise unless the model, or a load, has this number."""
    read = (*model.requires, *model.optional)
    if name in LOAD_NAMES or name in read:
        return
    group, _, key = name.partition(".")
    if group in GROUPS and key in GROUPS[group].__dataclass_fields__:
        raise ParameterError(f"parameters: {type(model).__name__} does not read {name!r}",
                             allowed=", ".join((*read, *LOAD_NAMES)))
    raise UnknownNameError("parameter", name, (*read, *LOAD_NAMES))


def _check_states(model: Model, start: Mapping[str, Any]) -> None:
    for name, value in start.items():
        states = [place.name for place in model.states]
        if name not in states:
            raise UnknownNameError(f"state of {type(model).__name__}", name, states)
        good = np.isfinite(value)
        if not np.all(good):
            lane = int(np.argmin(good)) if np.ndim(value) else None
            raise InputError(f"initial {name}" if lane is None else f"initial {name} of lane {lane}",
                             got=float(np.ravel(value)[lane or 0]), allowed="a finite number (SI)")


def _value(name: str, value: Any) -> Any:
    """Return a parameter as None, word, table, number, or array (B,) of floats or words."""
    group, _, key = name.partition(".")
    field = GROUPS[group].__dataclass_fields__.get(key) if group in GROUPS else None
    rule = field.metadata["rule"] if field else None
    if (value is None and rule) or rule == "table":
        return value
    if not isinstance(rule, tuple):
        return _numbers(name, value)
    words = _array(value)
    if words.ndim > 1 or words.dtype.kind not in "UO" or not all(isinstance(w, str) for w in words.ravel().tolist()):
        raise ParameterError(name, got=value, allowed=f"{' or '.join(rule)}, or one such word per lane")
    return words.astype(np.str_) if words.ndim else str(words)


def _numbers(what: str, values: Any) -> Any:
    """Return one number, or one per lane as an array (B,) of floats."""
    if is_masked(values):  # what the mask hides would count
        raise InputError(what, got="a masked array", allowed="numbers, none of them masked")
    array = _array(values)
    if array.ndim > 1:
        raise InputError(what, got=values if array.size == 0 else f"an array of shape {array.shape}",
                         allowed="a number, or one number per lane")
    if array.dtype.kind in "iuf":
        return array.astype(np.float64) if array.ndim else float(array)
    for lane, value in enumerate(array.ravel().tolist()):
        if not is_finite(value):
            raise InputError(f"{what} of lane {lane}" if array.ndim else what, got=value, allowed="a finite number")
    return np.array([float(value) for value in array.ravel().tolist()]) if array.ndim else float(array.item())


def _array(values: Any) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except ValueError:  # rows of unequal lengths
        return np.empty((0, 0))


def _seeds(seeds: Any) -> Indices:
    array = _array(seeds)
    if (array.ndim > 1 or array.dtype.kind not in "iu" or is_masked(seeds)
            or (array.size and array.max() > np.iinfo(np.int64).max)):
        raise InputError("seeds", got=seeds, allowed="a whole number of 64 bits with sign, or one per lane")
    return array.astype(np.int64)


def _check_commands(signals: Sequence[object], of: Indices) -> None:
    if set(map(type, signals)) == {Signal}:
        return
    for k, signal in enumerate(signals):
        if not isinstance(signal, Signal):
            raise CommandError("command" if len(of) == 1 else f"command of lane {np.argmax(of == k)}",
                               got=type(signal).__name__, allowed="a signal of servotwin.signals, or one per lane")


def _loads(parts: Sequence[Any], of: Indices) -> tuple[Load, ...]:
    loads = []
    for k, part in enumerate(parts):
        try:
            loads.append(as_load(part))
        except LoadError as error:
            lane = "" if len(of) == 1 else f" of lane {np.argmax(of == k)}"
            raise LoadError(f"{error.what}{lane}", got=error.got, allowed=error.allowed) from None
    return tuple(loads)


def _once(given: Any) -> tuple[tuple[Any, ...], Indices]:
    """Return each item of a sequence once, and for each lane which is its own; a single thing is its only item."""
    if isinstance(given, np.ndarray):
        given = given.tolist()  # of no dimensions, it is the thing itself
    items = list(given) if isinstance(given, Sequence) else [given]
    if items and all(item is items[0] for item in items):
        return (items[0],), np.zeros(len(items), dtype=np.int64)
    ids = np.fromiter(map(id, items), dtype=np.uint64, count=len(items))
    if np.diff(np.sort(ids)).all():  # each is another
        return tuple(items), np.arange(len(items))
    _, where, index = np.unique(ids, return_index=True, return_inverse=True)
    place = np.empty_like(where)
    place[np.argsort(where)] = np.arange(len(where))  # in the order of the lanes, not of addresses
    return tuple(items[k] for k in np.sort(where).tolist()), place[index].astype(np.int64)


def _common_length(values: Mapping[str, Any]) -> int:
    lengths = {name: len(value) for name, value in values.items() if isinstance(value, np.ndarray) and value.ndim}
    several = {name: n for name, n in lengths.items() if n != 1}
    if 0 in several.values() or len(set(several.values())) > 1:
        raise InputError("numbers of lanes", got=", ".join(f"{name}: {n}" for name, n in several.items()),
                         allowed="one number of lanes, at least 1, or 1 for what all lanes share")
    return next(iter(several.values()), 1)


def _spread(index: Indices, count: int) -> Indices:
    return index if len(index) == count else np.repeat(index, count)


def _servo_of_first(servo: Servo, values: Mapping[str, Any]) -> Servo:
    """Check the parameters of all lanes, and return the servo of lane 0."""
    if not values:
        return servo
    for group, kind in GROUPS.items():
        given = {name.partition(".")[2]: value for name, value in values.items() if name.startswith(f"{group}.")}
        if given:
            own = getattr(servo, group)
            check_columns(group, {key: getattr(own, key) for key in kind.__dataclass_fields__} | given)
    return servo.with_checked({name: value[0].item() if isinstance(value, np.ndarray) else value
                               for name, value in values.items()})


def _with_numbers(loads: tuple[Load, ...], load_of: Indices, values: Mapping[str, Any]) -> tuple[Load, ...]:
    """Check the numbers of all lanes' loads, and return the loads with those that all lanes share."""
    for name, value in values.items():
        check_number(name, value)
    first = {name: value[0].item() if isinstance(value, np.ndarray) else value for name, value in values.items()}
    changed = []
    for k, load in enumerate(loads):
        try:
            changed.append(with_numbers(load, first))
        except LoadError as error:
            if len(loads) == 1:
                raise
            lane = int(np.argmax(load_of == k))
            raise LoadError(f"{error.what} of lane {lane}", got=error.got, allowed=error.allowed) from None
    return tuple(changed)
