"""What hangs on the pins of a board: a simulated servo, driven by the edges of its pulses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.bench.recording.wiring import Wiring
from servotwin.errors import InputError
from servotwin.models.digital import DigitalServo
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.wiring import PULSE_RANGE
from servotwin.physics.pieces import Piece, Pieces
from servotwin.signals import Signal
from servotwin.simulation import Simulator, State
from servotwin.simulation.frames import times_asked
from servotwin.simulation.simulator import simulated
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.simulation import Result

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

    A rising edge does not tell how wide its pulse will be, and no servo knows: it decides when the pulse has ended
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
