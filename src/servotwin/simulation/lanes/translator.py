"""What lanes are told at a tick, as the engine follows it: pulse width [s] or control voltage [V]."""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import CommandError, InputError
from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, DigitalServo
from servotwin.models.columns import LanePieces, LaneSignal
from servotwin.models.terms.wiring import PULSE_RANGE, TRAVEL_SLACK
from servotwin.simulation.lanes.packing import Chunk, flat
from servotwin.units import is_masked

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers

Array = NDArray[np.float64]
_KINDS = {"pulse_width": "pulse_width", "command_angle": "angle", "command_voltage": "voltage"}


class _Scale(NamedTuple):
    """engine = gain · given + offset, and within which bounds given is surely good; each a number or (lanes,)."""

    gain: Any
    offset: Any
    low: float
    high: float


class _Bounds(NamedTuple):
    """What each lane takes: given from low to high, as the engine follows it between least and most; (lanes,)."""

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
