"""Models: parameters joined to laws, a command conversion, and named output signals."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, cast, final

import numpy as np

from servotwin.errors import CommandError, InputError, LoadError, MissingParameterError, UnknownNameError
from servotwin.models import outputs
from servotwin.models.columns import LanePieces, LaneServo, LaneSignal
from servotwin.models.state.modes import Vector
from servotwin.models.terms import wiring
from servotwin.models.terms.given import Given, Hung, given_of, hung_of
from servotwin.models.terms.wiring import PULSE_RANGE, TRAVEL_SLACK, Line
from servotwin.parameters import Servo
from servotwin.physics.laws import array_form

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.models.columns import Samples
    from servotwin.models.terms.firmware import Firmware
    from servotwin.models.terms.frame import Chip
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal


KINDS = {"command_voltage": "voltage", "command_angle": "angle", "pulse_width": "pulse_width"}
"""The kind of command that a signal stands for."""


class Place(NamedTuple):
    """A state: its signal name, its name in `state.modes.Vector`, and the factor from there to the signal."""

    name: str
    at: str
    factor: float


class Model(ABC):
    """A fidelity: immutable once built, without state of its own.

    Parameters
    ----------
    servo : Servo
        Must give every parameter of `requires`.

    Raises
    ------
    MissingParameterError
        If the servo lacks a required parameter; all that are missing are named.
    """

    requires: ClassVar[tuple[str, ...]]
    """Dotted names without which the model cannot be built."""
    optional: ClassVar[tuple[str, ...]] = ()
    """Dotted names that are used where given."""
    layout: ClassVar[tuple[str, ...]]
    """Signal names of all states that the class can have, angle and speed first."""
    signals: ClassVar[tuple[str, ...]]
    """Names of all output signals that the class can have, `time` apart."""

    bears_flexible: ClassVar[bool] = False
    """Whether the class follows a body behind an elastic shaft."""

    _given: Given | None = None
    _packed: tuple[Load, Numbers] | None = None
    _shown: tuple[Load, tuple[str, ...]] | None = None

    def __init__(self, servo: Servo) -> None:
        if not isinstance(servo, Servo):
            raise InputError(f"servo of {type(self).__name__}", got=servo, allowed="a servo, such as load_servo(...)")
        missing = [name for name in self.requires if servo.get(name) is None]
        if missing:
            raise MissingParameterError(type(self).__name__, servo.name, missing)
        self._servo = servo
        self._prepare()
        self._warn()

    @final
    def over(self, servo: LaneServo) -> Self:
        """Return this model over many lanes: its numbers may be columns (B, 1), and so is what it computes of them."""
        lanes = object.__new__(type(self))
        lanes._servo = servo  # type: ignore[assignment]  # reads as a servo does
        lanes._prepare()
        return lanes

    def _prepare(self) -> None:  # noqa: B027 - a hook that most models do not need
        """Derive what depends on several parameters, once."""

    def _warn(self) -> None:  # noqa: B027 - likewise
        """Warn of what is odd in one servo."""

    @property
    def servo(self) -> Servo:
        """The servo whose parameters are used."""
        return self._servo

    @property
    def ignored(self) -> tuple[str, ...]:
        """Dotted names that the servo gives and this model does not read."""
        read = set(self.requires) | set(self.optional)
        return tuple(name for name in self._servo.names() if name not in read)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._servo.name!r})"

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._servo == other._servo

    def __hash__(self) -> int:
        return hash((type(self), self._servo.name))

    @final
    def value(self, name: str) -> float:
        """Return a required parameter (SI); over lanes it may be a column."""
        number: Any = self._servo.get(name)
        if isinstance(number, np.ndarray):
            return number  # type: ignore[return-value]  # the formulas take both
        if not isinstance(number, int | float):
            raise MissingParameterError(type(self).__name__, self._servo.name, [name])
        return float(number)

    @final
    def value_or(self, name: str, default: float) -> float:
        """Return an optional parameter (SI), or its default where the servo does not give it."""
        number: Any = self._servo.get(name)
        if isinstance(number, np.ndarray):
            return number  # type: ignore[return-value]
        return float(number) if isinstance(number, int | float) else default

    @property
    def given(self) -> Given:
        """The servo's numbers that this model reads, each a number or a column of lanes."""
        if self._given is None:
            self._given = given_of(self._servo, (*self.requires, *self.optional))
        return self._given

    def made_of(self, law: Callable[..., Any], *more: Any) -> Any:
        """Return what a function of `terms` makes of what is given; of columns it makes columns."""
        given, columns = self.given, isinstance(self._servo, LaneServo)
        for each in more:
            for x in each if isinstance(each, tuple) else (each,):
                columns = columns or isinstance(x, np.ndarray)
        return (array_form(law) if columns else law)(given, *more)

    def hung(self, load: Load) -> Hung:
        """Return the numbers of a load.

        Raises
        ------
        LoadError
            If the load has a body behind an elastic shaft, and the model follows none.
        """
        if load.flexibles and not self.bears_flexible:
            raise LoadError(f"load.flexible of {type(self).__name__}", got="a body behind an elastic shaft",
                            allowed="PulseServo, PulseServoInductive or DigitalServo, which follow two bodies")
        return hung_of(load)

    @property
    def endless(self) -> bool:
        """Whether the shaft turns without end: the feedback stands at `potentiometer.fixed_angle`, and is read."""
        name = "potentiometer.fixed_angle"
        return name in self.optional and self.servo.get(name) is not None

    @property
    def available(self) -> tuple[str, ...]:
        """Names of the output signals that can be computed for this servo, `time` apart.

        Where `electronics.voltage_to_pulse_gain` is optional and absent, no voltage stands for a command.
        """
        gain = "electronics.voltage_to_pulse_gain"
        if gain in self.optional and self.servo.get(gain) is None:
            return tuple(name for name in self.signals if name != "command_voltage")
        return self.signals

    @final
    def signals_with(self, *loads: Load) -> tuple[str, ...]:
        """Return names of the output signals under some loads: `load_angle` too where one is behind a spring."""
        more = ("load_angle",) if any(load.flexibles for load in loads) else ()
        return (*self.available, *more)

    @property
    def states(self) -> tuple[Place, ...]:
        """Which signals are states of this servo, and where the engine keeps them."""
        return tuple(Place(name, at, 1.0) for name, at in zip(self.layout, Vector._fields, strict=False))

    @abstractmethod
    def pack(self, load: Load) -> Numbers:
        """Return everything that the engine reads, as plain floats."""

    @final
    def plant(self, load: Load) -> Numbers:
        """Return `pack(load)`, which is kept for the next time."""
        packed = self._packed
        if packed is None or packed[0] is not load:
            packed = self._packed = (load, self.pack(load))
        return packed[1]

    @abstractmethod
    def command(self, signal: Signal) -> Pieces:
        """Return the signal as what the model follows: armature voltage (motors) or control voltage (servos) [V].

        Raises
        ------
        CommandError
            If the model cannot take this kind of command, or it asks for an angle outside the travel.
        """

    @abstractmethod
    def start_angle(self, drive: float) -> float:
        """Return the angle [rad] at which the model rests under a command `drive` [V] that never changed."""

    @final
    def output(self, name: str, samples: Samples, drive: Pieces, load: Load) -> NDArray[np.float64]:
        """Return an output signal (SI), shape (n,).

        Raises
        ------
        UnknownNameError
            If the model does not have it; the message lists those that it has.
        """
        if name == "time":
            return samples.time
        if self._shown is None or self._shown[0] is not load:
            self._shown = (load, self.signals_with(load))
        names = self._shown[1]
        if name not in names:
            raise UnknownNameError(f"signal of {type(self).__name__}", name, ("time", *names))
        return outputs.SIGNALS[name].compute(self, samples, drive, load)

    def firmware(self, signal: Signal | None = None) -> Firmware | None:
        """Return the numbers of the program under this command; None for models without one."""
        return None

    def chip(self, signal: Signal | None = None) -> Chip | None:
        """Return the numbers of the frame logic under this command; None for models without pulses."""
        return None

    def framed(self, signal: Signal, until: float) -> Signal:
        """Return a command with its pulses one by one as far as `until` [s] where it has silences, else as it is.

        Raises
        ------
        CommandError
            If it has silences, and the model follows no single pulses.
        """
        check_sent(signal, self)
        return signal

    def edges(self, signal: Signal) -> tuple[float, ...] | None:
        """Return when the frames of a command start [s]; None where they come regularly, or there are none."""
        return None

    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return angles [rad] and errors [V] of the potentiometer's linearity table; empty without one."""
        return (), ()

    def command_signal(self, name: str, drive: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `command_voltage`, `command_angle` or `pulse_width` that stand for a control voltage [V]."""
        raise UnknownNameError(f"signal of {type(self).__name__}", name, ("time", *self.available))


def feedback_line(model: Model) -> Line:
    """Return how the feedback voltage [V] follows the angle [rad]."""
    return cast("Line", model.made_of(wiring.feedback_line))


def solved(line: Line, y: Any) -> Any:
    """Return where a straight line has the value y."""
    gain, offset = line
    return (y - offset) / gain


def clipped(x: float, low: float, high: float) -> float:
    """Return the number, or each of a column, within its bounds."""
    if any(isinstance(number, np.ndarray) for number in (x, low, high)):
        return np.minimum(np.maximum(x, low), high)  # type: ignore[no-any-return]
    return min(max(x, low), high)


def check_sent(signal: Signal | LaneSignal, model: Model) -> None:
    """Raise CommandError if a command has silences, which a model of the mean of pulses does not have."""
    if signal.silences:
        raise CommandError(
            f"command for {type(model).__name__}", got=f"no pulses from {max(signal.silences[0][0], 0.0):g} s on",
            allowed="pulses throughout: take PulseServo, or end before the silence")


def check_travel(signal: Signal | LaneSignal, servo: Servo) -> None:
    """Raise CommandError if an angle command leaves the travel that the servo gives."""
    _check_angles(signal, servo, servo.get("stops.lower_angle"), servo.get("stops.upper_angle"), "the travel")


def check_goals(signal: Signal | LaneSignal, model: Model) -> None:
    """Raise CommandError if an angle command leaves the goals that a digital servo takes."""
    servo = model.servo
    _check_angles(signal, servo, servo.get("firmware.lower_goal"), servo.get("firmware.upper_goal"), "the goals")


def _check_angles(signal: Signal | LaneSignal, servo: Servo, lower: Any, upper: Any, which: str) -> None:
    low = -math.inf if lower is None else lower
    high = math.inf if upper is None else upper
    lowest, highest = signal.pieces.extremes
    bad = _First((lowest < low - TRAVEL_SLACK) | (highest > high + TRAVEL_SLACK))
    if bad:
        low, high = bad.of(low), bad.of(high)
        angle = bad.of(lowest) if bad.of(lowest) < low - TRAVEL_SLACK else bad.of(highest)
        raise CommandError(
            f"angle command{bad.lane(signal)}", got=f"{math.degrees(angle):.6g} deg",
            allowed=f"{math.degrees(low):.6g} to {math.degrees(high):.6g} deg, {which} of {servo.name}")


def check_widths(signal: Signal | LaneSignal, widths: Pieces | LanePieces, period: float) -> None:
    """Raise CommandError if a pulse width [s] is not positive, or not shorter than a frame [s]."""
    lowest, highest = widths.extremes
    bad = _First((lowest <= 0.0) | (highest >= period))
    if bad:
        width = bad.of(lowest) if bad.of(lowest) <= 0.0 else bad.of(highest)
        frame = bad.of(period)
        raise CommandError(
            f"pulse width{bad.lane(signal)}", got=f"{1e6 * width:.6g} us",
            allowed="more than 0 us" + (f" and less than a frame of {1e6 * frame:.6g} us" if frame < math.inf else ""))


def check_accepted(signal: Signal | LaneSignal, model: Model) -> None:
    """Raise CommandError if a command of pulses, for a model of their mean, has one that the chip refuses.

    Bounds are `electronics.pulse_width_min` and `electronics.pulse_width_max`, or `PULSE_RANGE`.
    """
    shortest, longest = (model.value_or(f"electronics.pulse_width_{end}", usual)
                         for end, usual in zip(("min", "max"), PULSE_RANGE, strict=True))
    lowest, highest = signal.pieces.extremes
    bad = _First((lowest < shortest) | (highest > longest))
    if not bad:
        return
    short = bad.of(lowest) < bad.of(shortest)
    k, start = bad.piece(signal, short)
    raise CommandError(
        f"pulse width{bad.lane(signal)}, piece {k} of the command (from {start:g} s on)",
        got=f"{1e6 * bad.of(lowest if short else highest):.6g} us",
        allowed=f"{1e6 * bad.of(shortest):.6g} to {1e6 * bad.of(longest):.6g} us, the pulses that {model.servo.name} "
        "accepts")


class _First:
    """The first lane for which something is so; without lanes, whether it is."""

    def __init__(self, so: Any) -> None:
        self._so = np.ravel(so)
        self._lane = int(np.argmax(self._so))

    def __bool__(self) -> bool:
        return bool(self._so[self._lane])

    def of(self, value: Any) -> float:
        """Return that lane's of a column, or the number."""
        return float(np.ravel(value)[self._lane if np.size(value) > 1 else 0])

    def piece(self, signal: Signal | LaneSignal, lowest: bool) -> tuple[int, float]:
        """Return number and start [s] of the piece that has that lane's lowest, or highest, value."""
        pieces = signal.pieces.of(self._lane) if isinstance(signal.pieces, LanePieces) else signal.pieces
        return pieces.extreme(lowest)

    def lane(self, signal: Signal | LaneSignal) -> str:
        """Return how an error names the lane."""
        return f" of lane {signal.lanes[self._lane]}" if isinstance(signal, LaneSignal) else ""
