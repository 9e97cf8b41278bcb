"""The bench: a servo behind a converter and a pulse generator, read by a display."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from servotwin.bench.converter import FEEDBACK_CONVERTER, INPUT_CONVERTER, Converter
from servotwin.bench.generator import PulseGenerator
from servotwin.bench.reading import Reading, TableRow
from servotwin.errors import CommandError, InputError, MissingParameterError
from servotwin.physics import feedback_voltage
from servotwin.signals import constant, pulse_train
from servotwin.simulation import Simulator, simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.signals import Signal
    from servotwin.simulation import Result, State

_LOOK = 0.25  # s between two looks whether the shaft stands
_GENERATOR = "the generator of the bench"
_LOOP, _STRETCH = "electronics.bridge_gain", "electronics.stretcher_gain"


@dataclass(frozen=True, eq=False, kw_only=True)
class BenchRun:
    """A run of the bench under a command that changes.

    Parameters
    ----------
    bench : Bench
    command : Signal
        The command voltage that was given.
    counts : tuple of int
        What the converter at the command read, once a frame.
    pulses : Signal
        The pulses that the generator made of it.
    result : Result
        The servo's answer, with its signals and metrics.
    """

    bench: Bench
    command: Signal
    counts: tuple[int, ...]
    pulses: Signal
    result: Result = field(repr=False)

    def reading(self, time: float) -> Reading:
        """Return what the display shows at a time of the run [s]: command and pulse of the frame, servo of now."""
        if not 0.0 <= time <= self.result.ended:
            raise InputError("time of a reading", got=time, allowed=f"0 to {self.result.ended:g} s")
        period = self.bench.generator.frame_period
        frame = min(int(time / period * (1.0 + 1e-15)), len(self.counts) - 1)
        angle = float(self.result.at("output_angle", [time])[0])
        return self.bench._display(float(self.command(frame * period)), self.counts[frame], angle)


class Bench:
    """The paper's bench around a servo.

    Parameters
    ----------
    model : Model
        A servo that takes pulses. Its parameters are used as they are: `bench_servo` gives a servo file the frame
        of the bench.
    load : Load, optional
        What hangs on the shaft; nothing unless given.
    input_converter, feedback_converter : Converter
        At the command and at the potentiometer.
    generator : PulseGenerator, optional
        The bench's unless given.

    Examples
    --------
    >>> import servotwin as st
    >>> bench = Bench(st.BoundedServo(bench_servo(st.load_servo("hitec-hs-755hb"))))
    >>> row, = bench.measure([1.425])
    >>> round(1e6 * row.reading.pulse_width), 80 < math.degrees(row.reading.output_angle) < 100
    (1526, True)
    """

    def __init__(self, model: Model, *, load: Load | Part | None = None,
                 input_converter: Converter = INPUT_CONVERTER, feedback_converter: Converter = FEEDBACK_CONVERTER,
                 generator: PulseGenerator | None = None) -> None:
        if "pulse_width" not in model.signals:
            raise InputError("model on the bench", got=type(model).__name__, allowed="a servo that takes pulses")
        self.model = model
        self.input_converter = input_converter
        self.feedback_converter = feedback_converter
        self.generator = generator or PulseGenerator()
        self._simulator = Simulator(model, load)
        self._p = model.value("potentiometer.feedback_gain")
        self._b_o = model.value("potentiometer.feedback_offset")
        self._half_deadband = _half_deadband(model)

    @property
    def load(self) -> Load:
        """What hangs on the shaft."""
        return self._simulator.load

    def pulse_width(self, command_voltage: float) -> float:
        """Return the pulse width that a constant command voltage [V] becomes [s]."""
        return self.generator.width(self.input_converter.count(command_voltage))

    def reading(self, command_voltage: float, output_angle: float) -> Reading:
        """Return what the display shows with this voltage [V] at the input and the shaft at this angle [rad]."""
        return self._display(command_voltage, self.input_converter.count(command_voltage), output_angle)

    def _display(self, command_voltage: float, count: int, angle: float) -> Reading:
        v_o = float(feedback_voltage(angle, self._p, self._b_o))
        return Reading(
            command_voltage=command_voltage, command_count=count, feedback_voltage=v_o,
            feedback_count=self.feedback_converter.count(v_o), pulse_rate=self.generator.pulse_rate,
            output_angle=angle, pulse_width=self.generator.width(count))

    def run(self, command: Signal, duration: float, *, output_step: float | None = None) -> BenchRun:
        """Return a run under a command voltage that may change; it is read once a frame, and the pulse held for it.

        Parameters
        ----------
        command : Signal
            In volts; the first frame starts at t = 0, and the servo rests before it where `command.initial` asks.
        duration : float
            Positive [s].
        output_step : float, optional
            As for `simulate`.

        Raises
        ------
        CommandError
            If the command is no voltage.
        InputError
            If the duration or the output step is out of range.

        Examples
        --------
        >>> import servotwin as st
        >>> bench = Bench(st.BoundedServo(bench_servo(st.load_servo("hitec-hs-755hb"))))
        >>> run = bench.run(st.signals.step(0.609, 1.425, at=0.1, unit="V"), 1.0)
        >>> run.counts[0], run.counts[-1], run.reading(1.0).command_count
        (248, 582, 582)
        """
        counts = [self.input_converter.count(float(v)) for v in command(self.frames(command, duration))]
        return self.follow(command, counts, duration, output_step=output_step)

    def frames(self, command: Signal, duration: float) -> NDArray[np.float64]:
        """Return when the pulses of a run start [s], shape (n,).

        Raises
        ------
        CommandError
            If the command is no voltage.
        InputError
            If the duration is not positive.
        """
        if command.kind != "voltage":
            raise CommandError("command of the bench", got=f"unit {command.unit}", allowed="V, mV")
        if isinstance(duration, bool) or not (math.isfinite(duration) and duration > 0.0):
            raise InputError("duration", got=duration, allowed="a positive number of seconds")
        period = self.generator.frame_period
        return np.asarray(np.arange(math.ceil(duration / period)) * period, dtype=np.float64)

    def follow(self, command: Signal, counts: Sequence[int], duration: float, *,
               output_step: float | None = None) -> BenchRun:
        """Return the run in which the converter has read these counts, one a frame.

        Parameters
        ----------
        command : Signal
            Of which the counts were read; the servo rests where `command.initial` asks.
        counts : sequence of int
            As many as `frames` has edges.
        duration : float
            Positive [s].
        output_step : float, optional
            As for `simulate`.

        Raises
        ------
        InputError
            If there are more or fewer counts than frames.
        """
        edges = self.frames(command, duration)
        if len(counts) != edges.size:
            raise InputError("counts of a run", got=len(counts), allowed=f"{edges.size}, one a frame")
        train = pulse_train(edges, [self.generator.width(count) for count in counts], unit="s")
        pulses = replace(train, initial=self.pulse_width(command.initial))
        result = simulate(self.model, pulses, duration=duration, load=self.load, output_step=output_step)
        return BenchRun(bench=self, command=command, counts=tuple(counts), pulses=pulses, result=result)

    def measure(self, command_voltages: ArrayLike, *, approach: float = math.radians(30.0),
                dwell: float = 5.0) -> tuple[TableRow, ...]:
        """Return the table of readings for constant command voltages.

        A deadband and friction make a servo stop short, so each angle is approached from below and from above and
        the row shows the mean. Half the difference is the standing band.

        Parameters
        ----------
        command_voltages : array_like, shape (n,)
            [V]
        approach : float
            How far away the shaft starts, less where the travel ends, positive [rad].
        dwell : float
            Longest wait for the shaft to stand still, positive [s].

        Raises
        ------
        InputError
            If an argument is out of range, or the command leads to the very end of the travel.
        """
        for name, value in (("approach", approach), ("dwell", dwell)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(name, got=value, allowed="a positive number")
        volts = np.atleast_1d(np.asarray(command_voltages, dtype=np.float64))
        return tuple(self._row(v, approach, dwell) for v in volts.ravel().tolist())

    def _row(self, voltage: float, approach: float, dwell: float) -> TableRow:
        period = self.generator.frame_period
        pulses = constant(self.pulse_width(voltage), unit="s", frame_period=period)
        target = self._simulator.initial(pulses)["output_angle"]
        (below, rests_below), (above, rests_above) = (
            self._settled(pulses, target + side * approach, dwell) for side in (-1.0, 1.0))
        low, high = below["output_angle"], above["output_angle"]
        band = 0.5 * abs(high - low)
        dead = min(band, self._half_deadband)
        mean = 0.5 * (low + high)
        return TableRow(
            reading=self.reading(voltage, mean), from_below=self.reading(voltage, low),
            from_above=self.reading(voltage, high), target_angle=target,
            target_voltage=float(feedback_voltage(target, self._p, self._b_o)), standing_band=band,
            deadband_band=dead, friction_band=band - dead,
            at_rest=rests_below and rests_above, dwell=max(below.time, above.time))

    def _settled(self, pulses: Signal, start: float, dwell: float) -> tuple[State, bool]:
        """Return the state once the shaft stands still, or after the longest wait, and whether it stands still.

        Between two pulses a servo may stand without being at rest, so it also has to be where it was a look ago.
        """
        lower = self.model.servo.get("stops.lower_angle")
        upper = self.model.servo.get("stops.upper_angle")
        low = lower if isinstance(lower, int | float) else -math.inf
        high = upper if isinstance(upper, int | float) else math.inf
        state = self._simulator.initial(pulses, {"output_angle": min(max(start, low), high)})
        looks = max(math.ceil(dwell / _LOOK), 2)
        for k in range(1, looks + 1):
            before = state["output_angle"]
            state = self._simulator.advance(state, dwell * k / looks, pulses)
            if state["output_speed"] == 0.0 and state["output_angle"] == before:
                return state, True
        return state, False


def _half_deadband(model: Model) -> float:
    """Return how far from the target the electronics of a model give up [rad]."""
    p = model.value("potentiometer.feedback_gain")
    if "electronics.deadband" in model.optional:
        width = model.value_or("electronics.deadband", 0.0)
        return 0.5 * width / (p * model.value("electronics.one_shot_slope"))
    if "electronics.voltage_deadband" in model.optional:
        return 0.5 * model.value_or("electronics.voltage_deadband", 0.0) / p
    return 0.0


def bench_servo(servo: Servo, generator: PulseGenerator | None = None) -> Servo:
    """Return a servo at the frame period of the bench, the loop gain of its mean voltage rescaled.

    By `physics.electronics.averaged_bridge_gain` the product A k_s goes as 1/T_f: more pulses a second drive more. A
    servo that gives a stretcher gain and no bridge gain, as `PulseServo` needs it, only gets the frame period.

    Parameters
    ----------
    servo : Servo
        Without a frame period of its own it counts as one for 20 ms.
    generator : PulseGenerator, optional
        The bench's unless given.

    Raises
    ------
    MissingParameterError
        If the servo gives neither a bridge gain nor a stretcher gain.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = bench_servo(st.load_servo("hitec-hs-755hb"))
    >>> round(1e3 * servo.electronics.frame_period, 3)
    16.384
    """
    gain, period = servo.get(_LOOP), servo.get("electronics.frame_period")
    after = (generator or PulseGenerator()).frame_period
    if gain is None and servo.get(_STRETCH) is not None:
        return servo.replace({"electronics.frame_period": after}, source=_GENERATOR)
    if not isinstance(gain, int | float):
        raise MissingParameterError("Bench", servo.name, [_LOOP])
    before = float(period) if isinstance(period, int | float) else 0.02
    return servo.replace({"electronics.frame_period": after, _LOOP: gain * before / after}, source=_GENERATOR)
