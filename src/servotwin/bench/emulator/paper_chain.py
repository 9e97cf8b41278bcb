"""The paper's bench through the emulated chain: knob, converter, firmware, pin, servo, potentiometer, display."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from servotwin.bench.backends.emulated import EmulatedBackend
from servotwin.bench.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER, Converter, Reading, bench_servo
from servotwin.bench.emulator.plant import Front, ServoOnPins
from servotwin.errors import BenchError
from servotwin.models import PulseServo
from servotwin.parameters import load_servo
from servotwin.physics import feedback_voltage
from servotwin.signals import constant

if TYPE_CHECKING:
    from servotwin.models import Model

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
    target = float(model.start_angle(model.command(constant(_pulse_of(voltage), unit="s")).table[0].value))
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


def _pulse_of(voltage: float) -> float:
    from servotwin.bench.generator import PulseGenerator

    return PulseGenerator().width(INPUT_CONVERTER.count(voltage))


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
    >>> from servotwin.bench.emulator.paper_chain import display_of
    >>> display_of(Reading(command_voltage=1.425, command_count=582, feedback_voltage=1.253, feedback_count=497,
    ...                    pulse_rate=61.035, output_angle=1.5708, pulse_width=1526e-6))
    ('1.424 582 1526us', '1.251 497 61  91')
    """
    v_i = (reading.command_count + 0.5 - INPUT_CONVERTER.offset) / INPUT_CONVERTER.gain
    v_o = math.floor(1e3 * (reading.feedback_count + 44.1) / 432.65 + 0.5) / 1e3
    q = round((v_o - 0.5878) / 7.324e-3)
    return (f"{v_i:5.3f}{reading.command_count:4d} {round(1e6 * reading.pulse_width):4d}us",
            f"{v_o:5.3f}{reading.feedback_count:4d}{int(reading.pulse_rate):3d}{q:4d}")
