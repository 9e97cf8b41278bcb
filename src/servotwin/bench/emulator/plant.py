"""The plant at the pins of a board: a simulated servo, driven by the edges of its pulses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.bench.backends.emulated import EmulatedBackend
from servotwin.bench.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER, Converter, Reading, bench_servo
from servotwin.bench.recording.bench_wiring import Wiring
from servotwin.errors import BenchError, InputError
from servotwin.models import PulseServo
from servotwin.models.digital import DigitalServo
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.wiring import PULSE_RANGE
from servotwin.parameters import load_servo
from servotwin.physics import feedback_voltage
from servotwin.physics.pieces import Piece, Pieces
from servotwin.signals import Signal, constant
from servotwin.simulation import Simulator, State
from servotwin.simulation.frames import times_asked
from servotwin.simulation.simulator import simulated
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.simulation import Result


# --- The plant at the pins of a board: a simulated servo, driven by the edges of its pulses ---------------------------

_NEVER = 1e9  # s
_ENDLESS = 1e3  # s; no servo takes such a pulse
_GLITCH = 62.5e-9  # s, a cycle of the board: the shortest pulse that there is
_CENTRE = 1.5e-3  # s; where it stands before its first pulse: the usual centre, assumed
_SIGNALS = {"tap": "feedback_voltage", "shunt": "supply_current", "supply": "bus_voltage"}
_FRONTS = {"tap": (1.0, 0.0), "shunt": (1.0, 0.0), "supply": (0.25, 0.0), "command": (1.0, 0.0)}


class Front(NamedTuple):
    """An analog stage before a pin: gain times value and offset.

    Parameters
    ----------
    gain : float
        [V/V or V/A]
    offset : float
        [V]
    """

    gain: float
    offset: float


def fronts_of(wiring: Wiring) -> Mapping[str, Front]:
    """Return the stages that a wiring describes.

    Examples
    --------
    >>> fronts_of(Wiring())["supply"]
    Front(gain=0.25, offset=0.0)
    """
    return {name: Front(wiring.pin(name, 1.0) - wiring.pin(name, 0.0), wiring.pin(name, 0.0)) for name in _FRONTS}


class ServoOnPins:
    """A servo whose pulses are the edges at a pin, and whose tap, current and supply are voltages at others.

    A rising edge does not tell how wide its pulse will be, so a servo decides when the pulse has ended
    (physics of the pulse servo). So whatever is asked for within a pulse is computed ahead with a pulse that is still
    high, the longest that it takes, and once more from the rising edge when the falling one has come. A servo in
    silence is thus awake while a pulse is high of which it shows only then that it is too long.

    Parameters
    ----------
    model : Model
        One that takes pulses and decides after them: `PulseServo`, `PulseServoInductive`, `DigitalServo`.
    load : Load, optional
    fronts : mapping of str to Front, optional
        Stages before the pins, by channel; those of the guide's wiring unless given.
    command : Signal, optional
        Command voltage of mode "paper"; 0 V unless given.
    output_angle : float, optional
        Where it begins [rad]; at rest where 1.5 ms asks for unless given.
    noise : float
        At each pin, one standard deviation [V].
    seed : int
        Of all noise.

    Raises
    ------
    InputError
        If the model takes no pulses, or the noise makes no sense.

    Examples
    --------
    >>> import servotwin as st
    >>> plant = ServoOnPins(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> before = plant.voltage("tap", 0.01)
    >>> for k in range(20):
    ...     plant.rise(0.02 * (k + 1))
    ...     plant.fall(0.02 * (k + 1) + 2e-3)
    >>> plant.voltage("tap", 0.5) > before
    True
    """

    def __init__(self, model: Model, load: Load | Part | None = None, *, fronts: Mapping[str, Front] | None = None,
                 command: Signal | None = None, output_angle: float | None = None, noise: float = 0.0,
                 seed: int = 0) -> None:
        if not isinstance(model, SwitchedServo) or (isinstance(model, DigitalServo) and model.takes_goals):
            raise InputError("model on the bench", got=type(model).__name__,
                             allowed="PulseServo, PulseServoInductive, or a DigitalServo that takes pulses")
        if not (is_finite(noise) and noise >= 0.0):
            raise InputError("noise at the pins", got=noise, allowed="a number of at least 0 [V]")
        self.model, self._simulator = model, Simulator(model, load, seed)
        self._fronts = {**{name: Front(*one) for name, one in _FRONTS.items()}, **(fronts or {})}
        self._voltage, self._noise, self._rng = command, noise, np.random.default_rng(seed)
        self._longest = model.value_or("electronics.pulse_width_max", PULSE_RANGE[1])
        self._command = _train([(_NEVER, _CENTRE)])
        self._width = _CENTRE  # of the pulse that has risen last, or what it is taken for while it is high
        start = None if output_angle is None else {"output_angle": output_angle}
        self._before = self._state = self._simulator.initial(self._command, start)  # at the last edge, and now
        self._start = self._state["output_angle"]
        self._high = False
        self.edges: list[tuple[float, float]] = []
        """Rising edge and width of each pulse that has ended [s]."""

    @property
    def time(self) -> float:
        """How far the servo is [s]."""
        return self._state.time

    def rise(self, time: float) -> None:
        """Take the rising edge of a pulse [s]."""
        if self._high:
            return
        if time < self._state.time:  # it was asked for what would have been
            self._state = self._simulator.advance(self._before, time, self._command)
        self._before, self._high = self.state(time), True
        self._tell(self._longest)

    def fall(self, time: float) -> None:
        """Take the falling edge of a pulse [s]."""
        if not self._high:
            return
        self._tell(max(time - self._before.time, _GLITCH))
        now = max(time, self._before.time + _GLITCH)
        self._state, self._high = self._simulator.advance(self._before, now, self._command), False
        self.edges.append((self._before.time, self._width))

    def state(self, time: float) -> State:
        """Return the state at a time [s] after the last edge, as it is if no other edge comes before it."""
        if time < self._state.time:
            self._state = self._before
        elif time == self._state.time:
            return self._state
        if self._high and time - self._before.time > self._longest and self._width < _ENDLESS:
            # Longer than the servo takes, so it counts as none, wherever it ends
            self._tell(_ENDLESS)
            self._state = self._simulator.advance(self._before, self._state.time, self._command)
        self._state = self._simulator.advance(self._state, time, self._command)
        return self._state

    def voltage(self, channel: str, time: float) -> float:
        """Return the voltage at the pin of a channel at a time after the last edge, if no other comes before it [V]."""
        front = self._fronts[channel]
        noise = self._noise * float(self._rng.standard_normal()) if self._noise else 0.0
        return front.gain * self._value(channel, time) + front.offset + noise

    def truth(self, output_times: ArrayLike | None = None) -> Result:
        """Simulate anew, from the start until now, what the pulses so far have done.

        Parameters
        ----------
        output_times : array_like, optional
            Each millisecond unless given [s].

        Raises
        ------
        InputError
            If no time has passed.

        Examples
        --------
        >>> import servotwin as st
        >>> plant = ServoOnPins(st.PulseServo(st.load_servo("hitec-hs-755hb")))
        >>> plant.rise(0.001)
        >>> plant.fall(0.003)
        >>> round(float(plant.truth([0.002])["output_angle"][0] - plant.truth([0.0])["output_angle"][0]), 6)
        0.0
        """
        pulses = [*self.edges, *([(self._before.time, self._width)] if self._high else [])]
        return simulated(self._simulator, _train(pulses or [(_NEVER, _CENTRE)]), self.time,
                         times_asked(self.time, None, output_times), {"output_angle": self._start})

    def _value(self, channel: str, time: float) -> float:
        if channel == "command":
            return 0.0 if self._voltage is None else float(self._voltage(time))
        return self._simulator.observe(self.state(time), _SIGNALS[channel], self._command)

    def _tell(self, width: float) -> None:
        """Take a width for that of the pulse that has risen [s]."""
        self._width, self._command = width, _train([(self._before.time, width)])


def _train(pulses: Sequence[tuple[float, float]]) -> Signal:
    """Return rising edges and widths [s] as a command, without the checks for hands that write some."""
    edges = tuple(rise for rise, _ in pulses)
    return Signal(pieces=Pieces(tuple(Piece(*one) for one in pulses)), unit="s", initial=pulses[0][1], edges=edges)


# --- The paper's bench through the emulated chain: knob, converter, firmware, pin, servo, potentiometer, --------------

_PLAIN = Converter(bits=10, reference=2.5)  # of the board itself
_APPROACH = math.radians(30.0)  # as `Bench.measure` does
_DWELL = 5.0  # s
_RATE = 1e6 / 16384.0  # Hz, of mode "paper"


def front_of(converter: Converter) -> Front:
    """Return the analog stage that makes the board's converter another one, whose gain and zero were measured.

    Examples
    --------
    >>> front = front_of(INPUT_CONVERTER)
    >>> round(front.gain, 6), round(409.6 * front.offset, 6)
    (1.0, -0.82)
    """
    return Front(converter.gain / _PLAIN.gain, converter.offset / _PLAIN.gain)


FRONTS: Mapping[str, Front] = MappingProxyType({
    "command": front_of(INPUT_CONVERTER), "tap": front_of(FEEDBACK_CONVERTER)})
"""Of the paper's bench, whose two converters disagree in gain and zero (Table II)."""


@dataclass(frozen=True, kw_only=True)
class ChainRow:
    """A row of Table II from the emulated chain: the mean of an approach from below and one from above.

    Parameters
    ----------
    reading : Reading
        The mean of both; counts are those of the approach from below.
    from_below, from_above : Reading
        After either approach: counts and pulse as the display shows them, voltages and angle as instruments would.
    displays : tuple of (str, str)
        The two lines of the display, after either approach.
    pulses : tuple of (float, float)
        Rising edge and width of the last pulses at the pin [s].
    """

    reading: Reading
    from_below: Reading
    from_above: Reading
    displays: tuple[tuple[str, str], tuple[str, str]]
    pulses: tuple[tuple[float, float], ...]


def chain_rows(command_voltages: Sequence[float], model: Model | None = None) -> tuple[ChainRow, ...]:
    """Return the rows that the emulated bench shows for constant command voltages.

    Parameters
    ----------
    command_voltages : sequence of float
        [V]
    model : Model, optional
        `PulseServo` of the paper's HS-755HB unless given.

    Raises
    ------
    BenchError
        If simavr or a compiler is missing, or the display shows no reading.
    """
    whole = model or PulseServo(bench_servo(load_servo("hitec-hs-755hb")))
    return tuple(_row(whole, voltage) for voltage in command_voltages)


def _row(model: Model, voltage: float) -> ChainRow:
    from servotwin.bench.generator import PulseGenerator

    pulse = PulseGenerator().width(INPUT_CONVERTER.count(voltage))
    target = float(model.start_angle(model.command(constant(pulse, unit="s")).table[0].value))
    (below, shown_below, pulses), (above, shown_above, _) = (
        _settled(model, voltage, target + side * _APPROACH) for side in (-1.0, 1.0))
    middle = 0.5 * (below.output_angle + above.output_angle)
    mean = Reading(
        command_voltage=voltage, command_count=below.command_count, pulse_rate=_RATE, output_angle=middle,
        feedback_voltage=0.5 * (below.feedback_voltage + above.feedback_voltage),
        feedback_count=FEEDBACK_CONVERTER.count(0.5 * (below.feedback_voltage + above.feedback_voltage)),
        pulse_width=below.pulse_width)
    return ChainRow(reading=mean, from_below=below, from_above=above, displays=(shown_below, shown_above),
                    pulses=pulses)


def _settled(model: Model, voltage: float,
             start: float) -> tuple[Reading, tuple[str, str], tuple[tuple[float, float], ...]]:
    """Return what the bench shows some seconds after it was switched on with the shaft somewhere."""
    stops = (model.servo.get(f"stops.{side}_angle") for side in ("lower", "upper"))
    low, high = (at if isinstance(at, float) else side for at, side in zip(stops, (-math.inf, math.inf), strict=True))
    inside = min(max(start, low), high)
    plant = ServoOnPins(model, fronts=FRONTS, command=constant(voltage, unit="V"), output_angle=inside)
    board = EmulatedBackend(plant, paper=True)
    board.open()
    try:
        while board.time < _DWELL:
            board.read(0.1)
        angle = plant.state(board.time)["output_angle"]
        lines = (board.lines[0], board.lines[1])
    finally:
        board.close()
    return _reading(model, voltage, angle, lines), lines, tuple(plant.edges[-4:])


def _reading(model: Model, voltage: float, angle: float, lines: tuple[str, str]) -> Reading:
    try:
        count, width = int(lines[0][5:9]), int(lines[0][9:14])
        feedback, rate = int(lines[1][5:9]), int(lines[1][9:12])
    except ValueError:
        raise BenchError("display", f"it shows no reading but {lines[0]!r} and {lines[1]!r}") from None
    p, b_o = (model.value(f"potentiometer.{name}") for name in ("feedback_gain", "feedback_offset"))
    return Reading(
        command_voltage=voltage, command_count=count, feedback_voltage=float(feedback_voltage(angle, p, b_o)),
        feedback_count=feedback, pulse_rate=float(rate), output_angle=angle, pulse_width=1e-6 * width)


def display_of(reading: Reading) -> tuple[str, str]:
    """Return the two lines that the display owes for the counts of a reading: volts, angle and pulse made of them.

    Examples
    --------
    >>> from servotwin.bench.emulator.plant import display_of
    >>> display_of(Reading(command_voltage=1.425, command_count=582, feedback_voltage=1.253, feedback_count=497,
    ...                    pulse_rate=61.035, output_angle=1.5708, pulse_width=1526e-6))
    ('1.424 582 1526us', '1.251 497 61  91')
    """
    v_i = (reading.command_count + 0.5 - INPUT_CONVERTER.offset) / INPUT_CONVERTER.gain
    v_o = math.floor(1e3 * (reading.feedback_count + 44.1) / 432.65 + 0.5) / 1e3
    q = round((v_o - 0.5878) / 7.324e-3)
    return (f"{v_i:5.3f}{reading.command_count:4d} {round(1e6 * reading.pulse_width):4d}us",
            f"{v_o:5.3f}{reading.feedback_count:4d}{int(reading.pulse_rate):3d}{q:4d}")
