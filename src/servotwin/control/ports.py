"""Ports of controllers: they measure, send, and advance time; simulated here, hardware later."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from servotwin import physics
from servotwin.control.controller import ANGLE, VOLTAGE, Measured, Readings
from servotwin.control.inverse import ServoInverse, inverse_of
from servotwin.errors import InputError
from servotwin.loads import as_load
from servotwin.models import DCMotor, DigitalServo, GearedMotor, Model
from servotwin.models.switched import SwitchedServo
from servotwin.parameters import Servo
from servotwin.physics import feedback_voltage
from servotwin.physics.pieces import Piece, Pieces, constant_pieces
from servotwin.signals import Signal
from servotwin.simulation import Result, Simulator, Status
from servotwin.simulation.engine import RunLog, State
from servotwin.simulation.trajectory import Motions
from servotwin.simulation.trajectory import Trajectory as Motion
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.control.controller import Sensor
    from servotwin.loads import Load, Part
    Array = NDArray[np.float64]


# --- How a command gets to a simulated servo --------------------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class Wire:
    """The value sent for a command.

    Parameters
    ----------
    takes : str
        "armature_voltage" or "command_angle".
    unit : str
        Of what is sent, as signals have it.
    carried : callable
        Value that is sent for a command, the nearest that the wire can carry (SI).
    at_rest : callable
        Value that is sent to a servo that rests at an angle (SI).
    frame, lag : float
        How often a new command can matter, and how long it needs besides until it acts [s].
    """

    takes: str
    unit: str
    carried: Callable[[float], float]
    at_rest: Callable[[float], float]
    frame: float = 0.0
    lag: float = 0.0


def wire_of(model: Model, believed: Servo, resolution: float) -> Wire:
    """Return how commands get to a model; pulses have steps of `resolution` [s] and the calibration of a servo."""
    if isinstance(model, DCMotor | GearedMotor):
        V = model.servo.get("supply.open_circuit_voltage")
        most = V if isinstance(V, float) else math.inf
        return Wire(takes=VOLTAGE, unit="V", carried=lambda v: _within(v, -most, most), at_rest=lambda q: 0.0)
    if isinstance(model, DigitalServo) and model.takes_goals:
        tick, late = model.value("firmware.control_period"), model.value_or("firmware.compute_delay", 0.0)
        if "potentiometer.fixed_angle" in model.servo.names():
            return _duties(model, tick, late)
        lower, upper = _travel(model, "firmware.lower_goal", "firmware.upper_goal")
        return Wire(takes=ANGLE, unit="rad", carried=lambda q: _within(q, lower, upper),
                    at_rest=lambda q: _within(q, lower, upper), frame=tick, lag=late)
    if isinstance(model, SwitchedServo):
        return _pulses(model, believed, resolution)
    lower, upper = _travel(model)
    return Wire(takes=ANGLE, unit="rad", carried=lambda q: _within(q, lower, upper), at_rest=lambda q: q)


def _duties(model: DigitalServo, tick: float, late: float) -> Wire:
    """Return the wire to a bridge whose goals are duties, `bare_bridge`: v = d (V_oc − V_ce0)."""
    V = model.value("supply.open_circuit_voltage") - model.value_or("supply.bridge_drop_voltage", 0.0)
    return Wire(takes=VOLTAGE, unit="rad", carried=lambda v: _within(v / V, -1.0, 1.0), at_rest=lambda q: 0.0,
                frame=tick, lag=late)


def _pulses(model: SwitchedServo, believed: Servo, resolution: float) -> Wire:
    """Return the wire that carries pulses, of the width that stands for an angle: T_0 + (p q + b_o)/s_r."""
    def number(name: str, default: float | None = None) -> float:
        value = believed.get(name)
        if isinstance(value, float):
            return value
        if default is None:
            raise InputError(f"pulses for {believed.name}", got=f"no {name}", allowed="a servo that gives it")
        return default

    slope, T_0 = number("electronics.one_shot_slope"), number("electronics.one_shot_offset", 0.0)
    p, b_o = number("potentiometer.feedback_gain"), number("potentiometer.feedback_offset", 0.0)
    frame = model.frame_period
    shortest = max(model.value_or("electronics.pulse_width_min", 0.0), resolution, 1e-9)
    longest = min(model.value_or("electronics.pulse_width_max", math.inf), 0.999 * frame)

    def width(q: float) -> float:
        t = physics.pulse_width_from_feedback(physics.feedback_voltage(q, p, b_o), slope, T_0)
        return _within(resolution * round(t / resolution) if resolution > 0.0 else t, shortest, longest)

    return Wire(takes=ANGLE, unit="s", carried=width, at_rest=width, frame=frame,
                lag=model.value_or("firmware.compute_delay", 0.0))


def _travel(model: Model, *goals: str) -> tuple[float, float]:
    names = [("stops.lower_angle", "stops.upper_angle"), goals] if goals else [("stops.lower_angle",
                                                                               "stops.upper_angle")]
    given = [(model.value_or(low, -math.inf), model.value_or(high, math.inf)) for low, high in names]
    return max(low for low, _ in given), min(high for _, high in given)


def _within(value: float, lower: float, upper: float) -> float:
    return min(max(value, lower), upper)


# --- The bridge of a servo without its chip: a goal is a duty, every millisecond --------------------------------------

_TAPPED = ("potentiometer.feedback_gain", "potentiometer.feedback_offset")  # still there for who taps it


def bare_bridge(servo: Servo, *, duty_steps: int = 1000, period: float = 1e-3, delay: float = 0.0) -> DigitalServo:
    """Return motor, gear and bridge of a servo without its own loop, commanded by duties: the chip is bypassed.

    Its program hands a goal on as the duty, as servos with a mode for PWM do; `SimulatedServo` takes voltages for it
    and sends v/(V_oc − V_ce0). The potentiometer can still be tapped; end stops do not count.

    Parameters
    ----------
    servo : Servo
        Analog or digital; of its program nothing is left.
    duty_steps : int
        Of full duty.
    period : float
        Of the program [s].
    delay : float
        From a tick until its duty holds [s].

    Raises
    ------
    InputError
        If a number makes no sense.
    MissingParameterError
        If the servo lacks numbers of motor, gear or supply.

    Examples
    --------
    >>> import servotwin as st
    >>> bridge = bare_bridge(st.load_servo("hitec-hs-755hb"))
    >>> result = st.simulate(bridge, st.signals.constant(0.5, unit="rad"), duration=0.5)
    >>> f"{result['output_speed'][-1]:.3f} rad/s at {result['duty'][-1]:g} of the duty"
    '1.952 rad/s at 0.5 of the duty'
    """
    if not (isinstance(duty_steps, int) and duty_steps >= 1):
        raise InputError("duty_steps", got=duty_steps, allowed="a whole number of at least 1")
    if not (is_finite(period) and period > 0.0):
        raise InputError("period of the bridge", got=period, allowed="a positive number of seconds")
    gone = ("firmware.", "electronics.", "potentiometer.", "stops.")
    nothing = dict.fromkeys(name for name in servo.names() if name.startswith(gone) and name not in _TAPPED)
    return DigitalServo(servo.replace({
        **nothing, "firmware.control_period": period, "firmware.compute_delay": delay, "firmware.command_kind": "goal",
        "firmware.proportional_gain": 1.0, "firmware.duty_quantum": 1.0 / duty_steps,
        "firmware.deadband_angle": 0.0, "firmware.lower_goal": -1.0, "firmware.upper_goal": 1.0,
        "potentiometer.fixed_angle": 0.0}, source="the chip bypassed"))


# --- Ports of controllers ---------------------------------------------------------------------------------------------

class Port(Protocol):
    """Four things to do with a servo, or with all servos of a robot at once."""

    @property
    def takes(self) -> str:
        """Commands that it takes: "armature_voltage" or "command_angle"."""

    @property
    def frame(self) -> float:
        """How often a new command can matter; 0: at any time [s]."""

    @property
    def lag(self) -> float:
        """How long a command needs until it acts, in the mean [s]."""

    @property
    def nominal(self) -> ServoInverse | None:
        """The plant as its maker states it, for a look at stability before running; None where there is none."""

    @property
    def time(self) -> float:
        """Now [s]."""

    def start(self, angle: Any) -> None:
        """Begin anew at time 0, at rest at an angle [rad]."""

    def measure(self) -> Measured:
        """Return what the sensors show now."""

    def send(self, command: Any) -> None:
        """Command a voltage [V] or an angle [rad] from now on."""

    def wait(self, until: float) -> None:
        """Return at a time [s]."""

    def record(self, time: Array) -> Mapping[str, Any]:
        """Return true signals since the start at times [s], by name; none on hardware, which has none."""


class SimulatedServo:
    """A servo on a `Simulator`, with the sensors, the steps and the delay of the one who controls it.

    Its commands depend on the model: a motor and a `bare_bridge` take voltages, a servo takes angles. These go out as
    pulses, by the sender's own calibration, or as goals on a bus.

    Parameters
    ----------
    model : Model
    load : Load, optional
        The load on the shaft.
    sensors : sequence of Sensor
        All that a controller sees; nothing unless given.
    believed : Servo, optional
        Its calibration makes pulses of angles; the model's own unless given.
    resolution : float
        Of the pulses that are sent, 1 us unless given [s].
    delay : float
        From a command until it is sent, as a program computes or a bus transmits [s].
    seed : int
        Of all noise.

    Raises
    ------
    InputError
        If a number makes no sense.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Encoder
    >>> port = SimulatedServo(st.PulseServo(st.load_servo("hitec-hs-755hb")), sensors=[Encoder(count=0.0)])
    >>> port.takes, port.frame
    ('command_angle', 0.02)
    >>> port.start(0.5)
    >>> port.send(1.0)
    >>> port.wait(1.0)
    >>> round(port.measure()["output_angle"], 2)
    0.99
    """

    def __init__(self, model: Model, load: Load | Part | None = None, *, sensors: Sequence[Sensor] = (),
                 believed: Servo | None = None, resolution: float = 1e-6, delay: float = 0.0, seed: int = 0) -> None:
        for name, value in (("resolution", resolution), ("delay", delay)):
            if not (is_finite(value) and value >= 0.0):
                raise InputError(f"{name} of SimulatedServo", got=value, allowed="a number of at least 0 [s]")
        self._simulator = Simulator(model, load, seed)
        self._wire: Wire = wire_of(model, believed or model.servo, resolution)
        self._sensors, self._delay, self._seed = tuple(sensors), float(delay), seed
        self.nominal: ServoInverse | None = inverse_of(model, as_load(load))
        self.start(0.0)

    @property
    def takes(self) -> str:
        """A voltage of a motor or a bare bridge, an angle of a servo."""
        return self._wire.takes

    @property
    def frame(self) -> float:
        """Of the pulses, or the period of the program [s]."""
        return self._wire.frame

    @property
    def lag(self) -> float:
        """From a command until it acts, the wait for a frame apart [s]."""
        return self._delay + self._wire.lag

    @property
    def time(self) -> float:
        """Now [s]."""
        return self._state.time

    def start(self, angle: Any) -> None:
        """Begin anew at time 0, at rest at an angle [rad]."""
        rest = self._wire.at_rest(float(angle))
        self._signal = self._constant(rest)
        self._state: State = self._simulator.initial(
            self._signal, {"output_angle": float(angle)} if "output_angle" in self._state_names else None)
        self._sent: list[tuple[float, float]] = [(0.0, rest)]
        self._coming: deque[tuple[float, float]] = deque()
        self._readings = Readings(self._sensors, self._seed)
        self._record = RunLog()

    @property
    def _state_names(self) -> tuple[str, ...]:
        return tuple(place.name for place in self._simulator.model.states)

    def measure(self) -> Measured:
        """Return what the sensors show now."""
        return self._readings.at(self.time, self._true)

    def _true(self, name: str) -> float:
        state, model = self._state, self._simulator.model
        if name in state.names:
            return state[name]
        if name == "feedback_voltage" and "potentiometer.fixed_angle" in model.servo.names():
            p, b_o = (model.value_or(f"potentiometer.feedback_{part}", 0.0) for part in ("gain", "offset"))
            return float(feedback_voltage(state["output_angle"], p, b_o))  # of the wiper, which its chip does not see
        return self._simulator.observe(state, name, self._signal)

    def send(self, command: Any) -> None:
        """Command a voltage [V] or an angle [rad] from now on, the nearest that the wire carries."""
        if not is_finite(command):
            raise InputError(f"command at {self.time:g} s", got=command, allowed="a finite number")
        self._coming.append((self.time + self._delay, self._wire.carried(float(command))))

    def wait(self, until: float) -> None:
        """Return at a time [s]."""
        while self._coming and self._coming[0][0] < until - 1e-12:
            at, value = self._coming.popleft()
            if at > self.time:
                self._advance(at)
            if value != self._sent[-1][1]:
                self._signal = self._constant(value)
                self._sent.append((self.time, value))
        if until > self.time:
            self._advance(until)

    def _advance(self, until: float) -> None:
        self._state = self._simulator.recorded(self._state, until, self._signal, self._record)

    def _constant(self, value: float) -> Signal:
        return Signal(pieces=constant_pieces(value), unit=self._wire.unit, initial=value)

    def result(self, time: Array) -> Result:
        """Return all that has happened since the start, at times [s], as `simulate` would."""
        last = dict(self._sent)  # of two commands at one time the later one
        pieces = Pieces(tuple(Piece(start=at, value=value) for at, value in last.items()))
        command, simulator = Signal(pieces=pieces, unit=self._wire.unit, initial=self._sent[0][1]), self._simulator
        return Result(model=simulator.model, command=command, load=simulator.load,
                      drive=simulator.model.command(command), time=np.asarray(time, dtype=np.float64),
                      trajectory=Motion(Motions(self._record.parts)), events=tuple(self._record.events),
                      status=Status.COMPLETED, ended=self.time, cause=Status.COMPLETED.message)

    def record(self, time: Array) -> Mapping[str, Any]:
        """Return true signals since the start at times [s]: a `Result`."""
        found: Any = self.result(time)  # reads as a mapping does
        return found  # type: ignore[no-any-return]
