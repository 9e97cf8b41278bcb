"""A simulated servo on the pins of a board: edges of its pulses drive it, and voltages show what it does.

What a pulse means is known when it ends: the servo decides then, and not before. So while one is high the state runs
on from the rising edge as under a pulse that has no end yet, and as it falls it is gone through again with its width.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.bench.emulator.front_end import CHANNELS, FrontEnd, checked
from servotwin.errors import InputError
from servotwin.models.base import PULSE_RANGE
from servotwin.models.digital import DigitalServo
from servotwin.models.switched import SwitchedServo
from servotwin.physics.pieces import Piece, Pieces
from servotwin.signals import Signal
from servotwin.simulation import Simulator
from servotwin.simulation.simulator import simulated
from servotwin.simulation.times import times_asked
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.simulation import Result, State

_SIGNALS = {"tap": "feedback_voltage", "shunt": "supply_current", "supply": "bus_voltage"}
_ENDLESS = 1e3  # s; longer than any servo takes
_CENTRE = 1.5e-3  # s; where the servo stands before its first pulse, unless it is told; the usual centre, assumed


class ServoPlant:
    """A servo with its load, driven by edges.

    Parameters
    ----------
    model : PulseServo, PulseServoInductive or DigitalServo
        A digital one that is told by pulses.
    load : Load, optional
    channels : mapping of str to FrontEnd, optional
        What stands before the pins "tap" (the potentiometer's voltage), "shunt" (the supply current), "supply" (its
        voltage) and "command"; each as it is unless given.
    command : float or Signal
        Command voltage of mode "paper" [V].
    initial : mapping, optional
        State at t = 0, as in `Simulator.initial`; at rest where 1.5 ms asks for unless given.
    seed : int
        Of the noise of servo and pins.

    Raises
    ------
    InputError
        If the model does not take pulses, or a number is out of its range.

    Examples
    --------
    >>> import servotwin as st
    >>> plant = ServoPlant(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> for k in range(50):
    ...     plant.rise(0.02 * k)
    ...     plant.fall(0.02 * k + 2e-3)
    >>> 1.5 < plant.voltages(1.0)[0] < 1.6
    True
    """

    def __init__(self, model: Model, load: Load | Part | None = None, *,
                 channels: Mapping[str, FrontEnd] | None = None, command: float | Signal = 0.0,
                 initial: Mapping[str, float] | None = None, seed: int = 0) -> None:
        if not isinstance(model, SwitchedServo) or (isinstance(model, DigitalServo) and model.takes_goals):
            raise InputError("servo on a board", got=type(model).__name__,
                             allowed="PulseServo, PulseServoInductive, or a DigitalServo that takes pulses")
        self.model = model
        self.channels = checked(channels)
        self.command = _voltage(command)
        self._stages = [(_SIGNALS.get(name), self.channels[name]) for name in CHANNELS]
        self._longest = model.value_or("electronics.pulse_width_max", PULSE_RANGE[1])
        self._noise = [random.Random(seed * len(CHANNELS) + k) for k in range(len(CHANNELS))]
        self._simulator = Simulator(model, load, seed)
        self._command = _train([(math.inf, _CENTRE)])
        self._width = _CENTRE  # of the pulse that has risen last
        self._state = self._before = self._simulator.initial(self._command, initial)
        self._initial, self._start = initial, self._state["output_angle"]
        self._risen: float | None = None  # the edge of the pulse that is high
        self.edges: list[tuple[float, float]] = []
        """Rising edge and width of each pulse that has ended [s]."""

    @property
    def time(self) -> float:
        """How far the servo is [s]."""
        return self._state.time

    def rise(self, time: float) -> None:
        """Take the rising edge of a pulse [s]."""
        if self._risen is not None:
            return
        self._before = self._to(time)
        self._risen = self._before.time
        self._told(self._longest)

    def fall(self, time: float) -> None:
        """Take the falling edge of a pulse [s]."""
        if self._risen is None or time <= self._risen:
            return
        width = time - self._risen
        self.edges.append((self._risen, width))
        self._told(width)
        self._state = self._simulator.advance(self._before, max(time, self._state.time), self._command)
        self._risen = None

    def voltage(self, channel: int, time: float) -> float:
        """Return the voltage at the pin of a channel at a time [s], not before the last one [V]."""
        if not 0 <= channel < len(self._stages):
            return 0.0
        name, stage = self._stages[channel]
        if name is None:
            value = float(self.command(time)) if isinstance(self.command, Signal) else self.command
        else:
            value = self._simulator.observe(self._to(time), name, self._command)
        volts = stage.gain * value + stage.offset
        return volts + self._noise[channel].gauss(0.0, stage.noise) if stage.noise else volts

    def voltages(self, time: float) -> Sequence[float]:
        """Return the voltages at the pins of all channels at a time [s], not before the last one [V]."""
        return [self.voltage(channel, time) for channel in range(len(CHANNELS))]

    def signal(self, name: str) -> float:
        """Return any signal of the servo as it stands now (SI), without front end and noise."""
        return self._simulator.observe(self._state, name, self._command)

    def run(self, until: float) -> None:
        """Let time pass [s]."""
        self._to(until)

    def truth(self, duration: float | None = None, *, output_times: ArrayLike | None = None) -> Result:
        """Simulate anew, from the start, what the pulses so far have done, and return the result.

        Parameters
        ----------
        duration : float, optional
            As far as the servo is unless given [s].
        output_times : array_like, optional
            [s]

        Raises
        ------
        InputError
            If no time has passed.
        """
        until = self.time if duration is None else duration
        edges = [*self.edges, *([] if self._risen is None else [(self._risen, self._width)])]
        command = _train(edges or [(math.inf, _CENTRE)])
        initial = self._initial or {"output_angle": self._start}
        times = times_asked(until, None, output_times)
        return simulated(self._simulator, command, until, times, initial)

    def _to(self, time: float) -> State:
        """Return the state at a time, or as it is where that has gone by."""
        state = self._state
        if time <= state.time:
            return state
        if self._risen is not None and time - self._risen > self._longest and self._width != _ENDLESS:
            # Longer than the servo takes: whatever its end will be, it counts as none
            self._told(_ENDLESS)
            state = self._simulator.advance(self._before, state.time, self._command)
        self._state = state = self._simulator.advance(state, time, self._command)
        return state

    def _told(self, width: float) -> None:
        """Take a width for that of the pulse that has risen [s]."""
        self._width = width
        self._command = _train([(self._before.time, width)])


def _train(edges: Sequence[tuple[float, float]]) -> Signal:
    """Return pulses as a command; the checks of `pulse_train` are those of hands that write."""
    pieces = Pieces(tuple(Piece(rise if math.isfinite(rise) else 0.0, width) for rise, width in edges))
    return Signal(pieces=pieces, unit="s", initial=edges[0][1], edges=tuple(rise for rise, _ in edges))


def _voltage(command: float | Signal) -> float | Signal:
    if isinstance(command, Signal):
        if command.kind != "voltage":
            raise InputError("command voltage of a board", got=f"a {command.kind.replace('_', ' ')}",
                             allowed="a voltage")
        return command
    if not is_finite(command):
        raise InputError("command voltage of a board", got=command, allowed="a finite number [V]")
    return float(command)
