"""What hangs on the pins of a board: a simulated servo, driven by the edges of its pulses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.bench.recording.wiring import Wiring
from servotwin.errors import InputError
from servotwin.models import Model
from servotwin.physics import feedback_voltage
from servotwin.signals import Signal, pulse_train
from servotwin.simulation import Simulator, State
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.loads import Load, Part

_NEVER = 1e9  # s
_LONGEST = 0.0029  # s; no servo takes such a pulse, and the firmware makes none that is longer by much
_TAP = (0.42, 0.59)  # V/rad, V: of a servo that tells none; about those of the paper's bench (Table II), assumed
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
    high, and once more from the rising edge when the falling one has come.

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
        Where it begins [rad]; the middle of its travel or pulses unless given.
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
        if "pulse_width" not in model.signals or not hasattr(model, "edges"):
            raise InputError("model on the bench", got=type(model).__name__, allowed="a servo that takes pulses")
        if not (is_finite(noise) and noise >= 0.0):
            raise InputError("noise at the pins", got=noise, allowed="a number of at least 0 [V]")
        self.model, self._simulator = model, Simulator(model, load, seed)
        self._fronts = {**{name: Front(*one) for name, one in _FRONTS.items()}, **(fronts or {})}
        self._command, self._noise, self._rng = command, noise, np.random.default_rng(seed)
        silent = pulse_train([_NEVER], [1.5e-3], unit="s")
        self._tap = _tap_of(model)
        self._signal = silent
        start = None if output_angle is None else {"output_angle": output_angle}
        self._state: State = self._simulator.initial(silent, start)  # at the last edge
        self._high: Signal | None = None  # while a pulse is high: one that does not end
        self._rose = 0.0
        self._seen: State = self._state
        self.edges: list[tuple[float, float]] = []

    def rise(self, time: float) -> None:
        """Take the rising edge of a pulse [s]."""
        self._state = self._seen = self._simulator.advance(self._state, time, self._signal)
        self._rose, self._high = time, pulse_train([time], [_LONGEST], unit="s")

    def fall(self, time: float) -> None:
        """Take the falling edge of a pulse [s]."""
        if self._high is None:
            return
        width = time - self._rose
        self.edges.append((self._rose, width))
        self._signal, self._high = pulse_train([self._rose], [width], unit="s"), None
        self._state = self._seen = self._simulator.advance(self._state, time, self._signal)

    def state(self, time: float) -> State:
        """Return the state at a time, as it is if no edge comes before it, not before the last edge [s]."""
        before = self._seen if time >= self._seen.time else self._state
        self._seen = self._simulator.advance(before, time, self._signal if self._high is None else self._high)
        return self._seen

    def voltage(self, channel: str, time: float) -> float:
        """Return the voltage at the pin of a channel [V]."""
        front = self._fronts[channel]
        noise = self._noise * float(self._rng.standard_normal()) if self._noise else 0.0
        return front.gain * self._value(channel, time) + front.offset + noise

    def _value(self, channel: str, time: float) -> float:
        if channel == "command":
            return 0.0 if self._command is None else float(self._command(time))
        state = self.state(time)
        if channel == "tap":
            return self._tap(state)
        name = "supply_current" if channel == "shunt" else "bus_voltage"
        command = self._signal if self._high is None else self._high
        return self._simulator.observe(state, name, command)


def _tap_of(model: Model) -> Callable[[State], float]:
    """Return how the tap shows the angle: by the servo's potentiometer, or one that is assumed."""
    gain, offset = (model.servo.get(f"potentiometer.{name}") for name in ("feedback_gain", "feedback_offset"))
    p, b_o = (float(gain), float(offset)) if is_finite(gain) and is_finite(offset) else _TAP
    return lambda state: float(feedback_voltage(state["output_angle"], p, b_o))
