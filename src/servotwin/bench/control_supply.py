"""Servo and control circuit on one supply: what the servo draws comes back in the pulse that it is to follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servotwin.errors import InputError
from servotwin.physics.converter import supplied_count
from servotwin.signals import constant
from servotwin.simulation import Simulator
from servotwin.simulation.engine import RunLog
from servotwin.simulation.trajectory import Motions, Trajectory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.bench.bench import Bench, BenchRun, Converter
    from servotwin.signals import Signal
    from servotwin.simulation import State


@dataclass(frozen=True, kw_only=True)
class ControlSupply:
    """How much of the servo's supply the control circuit feels, and when its program looks.

    With x = 1 − V_bus/V_oc, the part of its voltage that the supply has lost, the converter at the command sees
    v_i (1 − s_v x) against a reference of V_ref (1 − s_r x).

    Parameters
    ----------
    command_share : float
        s_v, 0 to 1: 1 for a potentiometer across the supply itself, 0 for a command that has a supply of its own, and
        what a regulator lets through in between [1].
    reference_share : float
        s_r, 0 to 1: 1 for a converter whose reference is the supply, 0 for a reference that stands by itself [1].
    sampling_delay : float
        From the end of a pulse to the instant at which the command for the next one is held, not negative [s]. The
        default is assumed: a program that has just sent a pulse and then reads its two voltages, for which a PIC16F87X
        takes about 0.06 ms each (40 µs to acquire, 12 times 1.6 µs to convert).

    Raises
    ------
    InputError
        If a value is out of its range.

    Examples
    --------
    >>> from servotwin.bench import INPUT_CONVERTER
    >>> sagging = ControlSupply()
    >>> sagging.count(INPUT_CONVERTER, 1.425, 0.0), sagging.count(INPUT_CONVERTER, 1.425, 0.01)
    (582, 577)
    """

    command_share: float = 1.0
    reference_share: float = 0.0
    sampling_delay: float = 2e-4

    def __post_init__(self) -> None:
        for name in ("command_share", "reference_share"):
            value = getattr(self, name)
            if isinstance(value, bool) or not (math.isfinite(value) and 0.0 <= value <= 1.0):
                raise InputError(f"{name} of the control circuit", got=value, allowed="a number from 0 to 1")
        delay = self.sampling_delay
        if isinstance(delay, bool) or not (math.isfinite(delay) and delay >= 0.0):
            raise InputError("sampling_delay of the control circuit", got=delay,
                             allowed="a number of seconds, 0 or more")

    def count(self, converter: Converter, voltage: float, sag: float) -> int:
        """Return what a converter reads of a command [V] while the supply has lost the part `sag` of its voltage.

        Raises
        ------
        InputError
            If nothing is left of the reference.
        """
        left = 1.0 - self.reference_share * sag
        if left <= 0.0:
            raise InputError("reference of a converter that hangs on the supply", got=left * converter.reference,
                             allowed="a positive voltage: the supply has broken down")
        if not math.isfinite(voltage):
            raise InputError("voltage at a converter", got=voltage, allowed="a finite number [V]")
        return supplied_count(converter.gain, converter.offset, converter.highest, voltage, sag, self.command_share,
                              self.reference_share)

    def sampling_times(self, pulses: Signal) -> NDArray[np.float64]:
        """Return when the program looks at the command, once behind each of these pulses [s], shape (n,).

        Examples
        --------
        >>> from servotwin.signals import pulse_train
        >>> ControlSupply(sampling_delay=1e-3).sampling_times(pulse_train([0.0, 0.02], [1500.0, 1600.0])).tolist()
        [0.0025, 0.0226]
        """
        edges = np.asarray(pulses.edges or (), dtype=np.float64)
        return np.asarray(edges + pulses(edges) + self.sampling_delay, dtype=np.float64)


def run_on_one_supply(bench: Bench, command: Signal, duration: float, control: ControlSupply | None = None, *,
                      output_step: float | None = None) -> BenchRun:
    """Return a run of the bench whose control circuit hangs on the supply of the servo.

    A closed loop, frame by frame: the program sends a pulse, waits for `sampling_delay`, reads the command off the
    supply as it is at that instant, and makes the next pulse of it. Nothing is drawn at random.

    Parameters
    ----------
    bench : Bench
        Its model needs a supply (`PulseServo`); how soft that is, is `supply.internal_resistance`.
    command : Signal
        Command voltage while the supply has lost nothing; the first pulse, from t = 0 on, is made of
        `command.initial`, with a servo that draws nothing yet.
    duration : float
        Positive [s].
    control : ControlSupply, optional
        A potentiometer across the supply, read at once after each pulse, unless given.
    output_step : float, optional
        As for `simulate`.

    Raises
    ------
    CommandError
        If the command is no voltage.
    InputError
        If the duration or the output step is out of range, the model has no supply, or the delay goes beyond the
        frame.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import Bench, bench_servo
    >>> soft = bench_servo(st.load_servo("hitec-hs-755hb")).replace({"supply.internal_resistance": 0.5})
    >>> run = run_on_one_supply(Bench(st.PulseServo(soft)), st.signals.step(0.609, 1.425, at=0.1, unit="V"), 0.15)
    >>> run.counts  # the command is there, the servo starts, and the supply gives way
    (248, 248, 248, 248, 248, 248, 248, 248, 582, 506)
    """
    control = control or ControlSupply()
    edges = bench.frames(command, duration).tolist()
    generator = bench.generator
    V_oc = _checked(bench, control)
    counts = [bench.input_converter.count(command.initial)]
    simulator = Simulator(bench.model, bench.load)
    state: State | None = None
    for edge in edges[:-1]:  # what follows the last pulse is not asked any more
        width = generator.width(counts[-1])
        pulses = constant(width, unit="s", frame_period=generator.frame_period)
        state = state or simulator.initial(pulses)
        looks = edge + width + control.sampling_delay
        state, bus = _advanced(simulator, state, looks, pulses)
        counts.append(control.count(bench.input_converter, float(command(looks)), 1.0 - bus / V_oc))
    return bench.follow(command, counts, duration, output_step=output_step)


def _checked(bench: Bench, control: ControlSupply) -> float:
    """Return V_oc [V] of a bench on which this control circuit can be had."""
    if "bus_voltage" not in bench.model.signals:
        raise InputError("model on one supply with its control circuit", got=type(bench.model).__name__,
                         allowed="one with a supply, such as PulseServo")
    generator = bench.generator
    most = generator.frame_period - generator.width(bench.input_converter.highest)
    if not control.sampling_delay < most:
        raise InputError("sampling_delay of the control circuit", got=control.sampling_delay,
                         allowed=f"less than {most:.6g} s, before the next frame after the longest pulse")
    return bench.model.value("supply.open_circuit_voltage")


def _advanced(simulator: Simulator, state: State, until: float, pulses: Signal) -> tuple[State, float]:
    """Return the state at `until` [s], and the voltage of the supply there [V]."""
    record = RunLog()
    after = simulator.recorded(state, until, pulses, record)
    samples = Trajectory(Motions(record.parts)).at(np.array([until]))
    bus = simulator.model.output("bus_voltage", samples, simulator.drive(pulses), simulator.load)
    return after, float(bus[0])
