"""The bench: a servo behind a converter and a pulse generator, read by a display."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from servotwin.bench.generator import PulseGenerator
from servotwin.bench.table_columns import TableFit
from servotwin.errors import CommandError, InputError, MissingParameterError
from servotwin.physics import feedback_voltage
from servotwin.physics.converter import counted
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

# --- The converters of the bench: a voltage becomes a whole number of counts ------------------------------------------

@dataclass(frozen=True, kw_only=True)
class Converter:
    """An analog-digital converter: count = floor(2^bits v / reference + offset), kept within its range.

    Parameters
    ----------
    bits : int
        Number of bits, 1 to 24.
    reference : float
        Voltage of the full range, positive [V].
    offset : float
        Shift of the zero; half a count more turns cutting into rounding [counts].

    Raises
    ------
    InputError
        If a value is out of its range.

    Examples
    --------
    >>> Converter(bits=10, reference=2.5).count(1.25)
    512
    """

    bits: int = 10
    reference: float = 2.5
    offset: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.bits, bool) or not isinstance(self.bits, int) or not 1 <= self.bits <= 24:
            raise InputError("bits of a converter", got=self.bits, allowed="an integer from 1 to 24")
        if not (math.isfinite(self.reference) and self.reference > 0.0):
            raise InputError("reference of a converter", got=self.reference, allowed="a positive number [V]")
        if not math.isfinite(self.offset):
            raise InputError("offset of a converter", got=self.offset, allowed="a finite number [counts]")

    @property
    def highest(self) -> int:
        """The highest count, 2^bits − 1 [1]."""
        return int(2**self.bits) - 1

    @property
    def gain(self) -> float:
        """Counts per volt [1/V]."""
        return float(2**self.bits / self.reference)

    def count(self, voltage: float) -> int:
        """Return the count of a voltage [V].

        Raises
        ------
        InputError
            If the voltage is not finite.
        """
        if not math.isfinite(voltage):
            raise InputError("voltage at a converter", got=voltage, allowed="a finite number [V]")
        return counted(self.gain, self.offset, self.highest, voltage)


INPUT_CONVERTER = Converter(bits=10, reference=2.5, offset=-0.82)
"""At the command: the paper's 2.5 V reference (LM336Z-2.5) over 1024 counts.

The zero offset is identified from Table II of Urrea and Kern (2011): only offsets from −0.96 to below −0.68 counts
give all five pulse widths from the printed V_i; this is the middle (`zero_offset_interval`).
"""
FEEDBACK_CONVERTER = Converter(bits=10, reference=1024 / 432.65, offset=-44.1 + 0.5)
"""At the potentiometer: the straight line ADC_o = 432.65 V_o − 44.1 fitted to Table II, rounded to whole counts.

This is a description and no circuit: the converter at the command has another gain and another zero.
"""

# --- Signals of the bench: the seven values of its display, and a row of its table ------------------------------------

@dataclass(frozen=True, kw_only=True)
class Reading:
    """The seven values of the display, in the paper's order.

    Parameters
    ----------
    command_voltage : float
        V_i [V].
    command_count : int
        ADC_i [counts].
    feedback_voltage : float
        V_o [V].
    feedback_count : int
        ADC_o [counts].
    pulse_rate : float
        f [Hz].
    output_angle : float
        q [rad].
    pulse_width : float
        t_a [s].

    Examples
    --------
    >>> from servotwin.bench import Bench
    >>> import servotwin as st
    >>> reading = Bench(st.BoundedServo(st.load_servo("hitec-hs-755hb"))).reading(1.425, 1.5708)
    >>> reading.command_count, round(1e6 * reading.pulse_width)
    (582, 1526)
    """

    command_voltage: float
    command_count: int
    feedback_voltage: float
    feedback_count: int
    pulse_rate: float
    output_angle: float
    pulse_width: float


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """One row of the table: the mean of an approach from below and one from above.

    Parameters
    ----------
    reading : Reading
        The mean of both; ADC_o is that of the mean V_o.
    from_below, from_above : Reading
        Displayed values after either approach.
    target_angle, target_voltage : float
        Angle [rad] and feedback voltage [V] without error, the middle of the deadband.
    standing_band : float
        Half the difference of the two angles [rad].
    deadband_band : float
        The part of it that half the electrical deadband explains [rad].
    friction_band : float
        The rest of it: friction, and the creep that had no time to end [rad].
    at_rest : bool
        Whether both approaches ended with a shaft that stands still; a smoothed friction creeps for minutes, and the
        pulses of a `PulseServo` move it by ever smaller steps.
    dwell : float
        The longer of the two waiting times [s].
    """

    reading: Reading
    from_below: Reading
    from_above: Reading
    target_angle: float
    target_voltage: float
    standing_band: float
    deadband_band: float
    friction_band: float
    at_rest: bool
    dwell: float

# --- The bench: a servo behind a converter and a pulse generator, read by a display -----------------------------------

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
        Readings of the converter at the command, one a frame.
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
        Load on the shaft; none unless given.
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
        """The load on the shaft."""
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

# --- Simulated against measured: the differences row by row, and what each is made of ---------------------------------

class Comparison(NamedTuple):
    """Simulated less measured, one row of the table.

    Parameters
    ----------
    output_angle : float
        [rad]
    feedback_voltage : float
        [V]
    pulse_width : float
        [s]
    command_count, feedback_count : int
        [counts]
    """

    output_angle: float
    feedback_voltage: float
    pulse_width: float
    command_count: int
    feedback_count: int


class Shares(NamedTuple):
    """Why a measured angle lies off the straight line q(V_i); the shares add up to `total` [rad].

    Parameters
    ----------
    total : float
        Measured angle minus the line q(V_i).
    quantum : float
        The generator's 16 µs steps: what t_a minus the line t_a(V_i) turns.
    curvature : float
        Measured angle minus the line q(t_a).
    rest : float
        The line q(t_a) of the line t_a(V_i) is not quite the line q(V_i).
    """

    total: float
    quantum: float
    curvature: float
    rest: float


class ModelShares(NamedTuple):
    """Why a simulated value differs from the measured one; the shares add up to `total` [rad] or [V].

    Parameters
    ----------
    total : float
        Simulated less measured.
    generator : float
        A pulse width other than the measured one.
    curvature : float
        The straight line over t_a less the measured value: a linear servo cannot bend.
    standing : float
        Mean of both approaches less the value without error: an unequal stop from either side.
    rest : float
        Calibration of the servo less the straight line over t_a.
    """

    total: float
    generator: float
    curvature: float
    standing: float
    rest: float


class Row(Protocol):
    """A row of a table that shows a reading."""

    @property
    def reading(self) -> Reading:
        """The text of the display."""


def compare(rows: Sequence[Row], columns: Mapping[str, ArrayLike]) -> tuple[Comparison, ...]:
    """Return simulated less measured.

    Parameters
    ----------
    rows : sequence, length n
        Of `TableRow` or `ChainRow`.
    columns : mapping
        The measured table: q_deg, V_o_V, t_a_us, ADC_i, ADC_o, each of length n.

    Raises
    ------
    InputError
        If the lengths differ.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import Bench, bench_servo
    >>> table = st.load_dataset("urrea-kern-table-2").columns
    >>> bench = Bench(st.BoundedServo(bench_servo(st.load_servo("hitec-hs-755hb"))))
    >>> max(abs(row.pulse_width) for row in compare(bench.measure(table["V_i_V"]), table)) < 1e-6
    True
    """
    measured = zip(*(_column(columns, name, len(rows)) for name in ("q_deg", "V_o_V", "t_a_us", "ADC_i", "ADC_o")),
                   strict=True)
    return tuple(
        Comparison(one.output_angle - math.radians(q), one.feedback_voltage - v_o, one.pulse_width - 1e-6 * t_a,
                   one.command_count - round(n_i), one.feedback_count - round(n_o))
        for one, (q, v_o, t_a, n_i, n_o) in zip((row.reading for row in rows), measured, strict=True))


def measured_shares(fits: Mapping[str, TableFit]) -> tuple[Shares, ...]:
    """Return, row by row, why the measured angles lie off the straight line q(V_i) [rad].

    Parameters
    ----------
    fits : mapping
        Of `table_fits`.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import table_fits
    >>> shares = measured_shares(table_fits(st.load_dataset("urrea-kern-table-2").columns))
    >>> all(abs(s.total - s.quantum - s.curvature - s.rest) < 1e-12 for s in shares)
    True
    """
    by_voltage, by_width, widths = fits["q(V_i)"].line, fits["q(t_a)"].line, fits["t_a(V_i)"].line
    volts = fits["t_a(V_i)"].x
    parts = (by_voltage.residuals, by_width.slope * np.array(widths.residuals), by_width.residuals,
             by_width(widths(volts)) - by_voltage(volts))
    return tuple(Shares(*row) for row in np.radians(np.array(parts).T).tolist())


def model_shares(rows: Sequence[TableRow], fits: Mapping[str, TableFit], *,
                 quantity: str = "output_angle") -> tuple[ModelShares, ...]:
    """Return, row by row, why a simulated value differs from the measured one.

    Parameters
    ----------
    rows : sequence of TableRow
        For the voltages of the table, in its order.
    fits : mapping
        Of `table_fits`.
    quantity : {"output_angle", "feedback_voltage"}
        [rad] or [V]

    Raises
    ------
    InputError
        If the quantity is another, or the rows are not those of the table.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import Bench, bench_servo, table_fits
    >>> table = st.load_dataset("urrea-kern-table-2").columns
    >>> bench = Bench(st.BoundedServo(bench_servo(st.load_servo("hitec-hs-755hb"))))
    >>> shares = model_shares(bench.measure(table["V_i_V"]), table_fits(table))
    >>> all(abs(s.total - s.generator - s.curvature - s.standing - s.rest) < 1e-12 for s in shares)
    True
    """
    names = {"output_angle": "q(t_a)", "feedback_voltage": "V_o(t_a)"}
    if quantity not in names:
        raise InputError("quantity", got=quantity, allowed=", ".join(names))
    fit = fits[names[quantity]]
    if len(rows) != len(fit.x):
        raise InputError("rows of the simulated table", got=len(rows), allowed=f"{len(fit.x)}, as measured")
    unit = math.pi / 180.0 if quantity == "output_angle" else 1.0
    shares = []
    for k, row in enumerate(rows):
        simulated = getattr(row.reading, quantity)
        target = row.target_angle if quantity == "output_angle" else row.target_voltage
        width = 1e6 * row.reading.pulse_width
        shares.append(ModelShares(
            total=simulated - unit * fit.y[k], generator=unit * fit.line.slope * (width - fit.x[k]),
            curvature=-unit * fit.line.residuals[k], standing=simulated - target,
            rest=target - unit * fit.line(width)))
    return tuple(shares)


def _column(columns: Mapping[str, ArrayLike], name: str, length: int) -> list[float]:
    values = np.atleast_1d(np.asarray(columns[name], dtype=np.float64)) if name in columns else np.empty(0)
    if values.size != length:
        raise InputError(f"column {name} of the measured table", got=f"{values.size} values", allowed=f"{length}")
    return [float(v) for v in values]
