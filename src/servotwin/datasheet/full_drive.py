"""A servo at full drive: what it turns, draws and lifts while its bridge does not pause.

Far from its goal a servo drives without a pause, so speed over torque needs no chip: it is the steady motion of the
model's own motor, bridge, source and gear friction. All is for motion towards +q.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.loads import Load, as_load
from servotwin.models.digital import DigitalServo
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.memory import started
from servotwin.models.state.modes import FORWARD, FREE, RIGID, Mode, Vector
from servotwin.models.terms import bridge as bridge_term
from servotwin.models.terms import duty, source
from servotwin.models.terms.control import NOT_STARTED
from servotwin.models.terms.elastic import NO_ELASTIC
from servotwin.models.terms.heat import NO_HEAT
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import NO_PLAY
from servotwin.models.terms.sensor import NO_SENSOR
from servotwin.models.terms.stops import NO_STOPS, Stops
from servotwin.physics import motor
from servotwin.physics.pieces import constant_pieces
from servotwin.physics.thermal import REFERENCE_TEMPERATURE
from servotwin.simulation.engine import Plan, RunLog, State, run
from servotwin.simulation.trajectory import Motions, Trajectory

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from servotwin.loads import Part
    from servotwin.models import Model
    from servotwin.models.columns import Samples
    from servotwin.physics.thermal import Temperatures
    Array = NDArray[np.float64]


# --- A servo at full drive: what it turns, draws and lifts while its bridge does not pause ----------------------------

_LONGEST_SWING = 30.0  # s; what takes longer creeps


class Swing(NamedTuple):
    """A turn at full drive, from rest.

    Parameters
    ----------
    time : float
        Until the shaft has turned so far; nan where it does not [s].
    mean_current : float
        Of the supply, over that time [A].
    """

    time: float
    mean_current: float


@dataclass(frozen=True)
class FullDrive:
    """The steady motion of a servo whose bridge drives without a pause, or at the most duty that its program gives.

    Parameters
    ----------
    model : Model
        With a supply: `PulseServo`, `PulseServoInductive`, `BoundedServo` or `DigitalServo`.

    Raises
    ------
    InputError
        If the model has no supply, or its supply cannot turn the shaft.

    Examples
    --------
    >>> import servotwin as st
    >>> drive = FullDrive(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> round(drive.no_load_speed, 3), round(drive.stall_torque, 3)
    (4.646, 1.651)
    """

    model: Model

    def __post_init__(self) -> None:
        name = self.model.servo.name
        plant = self._plant
        if not (source.present(plant.source) or math.isfinite(plant.follower.V_max)):
            raise InputError(f"full drive of {type(self.model).__name__}", allowed=
                             "a model with a supply: PulseServo, PulseServoInductive, BoundedServo or DigitalServo")
        voltage = self.model.value("supply.open_circuit_voltage")
        if self._duty == 0.0 or not self.acceleration(0.0, 0.0) > 0.0:
            raise InputError(f"{name} does not turn at {voltage:g} V",
                             allowed="a supply and a most duty that overcome bridge, brushes and friction")

    @cached_property
    def _plant(self) -> Numbers:
        return self.loaded(None)

    def loaded(self, load: Load | Part | None) -> Numbers:
        """Return the numbers of servo and load, without what an endless steady motion does not meet."""
        packed = self.model.pack(as_load(load))
        if isinstance(self.model, DigitalServo):
            packed = duty.at_duty(packed, self._duty)
        return packed._replace(
            motor=packed.motor._replace(L=0.0), follower=packed.follower._replace(half_deadband=0.0), stops=NO_STOPS,
            play=NO_PLAY, sensor=NO_SENSOR, heat=NO_HEAT, elastic=NO_ELASTIC)

    @cached_property
    def _duty(self) -> float:
        return float(self.model.most_duty) if isinstance(self.model, DigitalServo) else 1.0

    @cached_property
    def _share(self) -> float:
        """How much of the supply's voltage, and of the motor's current in the supply, there is at that duty."""
        return duty.share_of(self._plant.bridge, self._duty) if duty.present(self._plant.bridge) else 1.0

    @cached_property
    def voltage(self) -> float:
        """The input of the plant at full drive: the supply behind its bridge, or an error that saturates it [V]."""
        plant = self._plant
        return plant.source.V if source.present(plant.source) else 2.0 * plant.follower.V_max / plant.follower.gain

    def current(self, speed: float) -> float:
        """Return the current of the supply [A] at a speed [rad/s]; that of the motor is the same at full duty."""
        return self._share * self._motor_current(speed)

    def _motor_current(self, speed: float) -> float:
        zone = currents.zone_of(self._plant, self.voltage, 0.0, 0.0, speed, 0.0)
        return currents.current(self._plant, zone, self.voltage, 0.0, speed)

    def bus_voltage(self, speed: float) -> float:
        """Return what is left of the source's voltage [V] at a speed [rad/s]."""
        plant = self._plant
        if plant.source.V == 0.0:
            return self.model.value("supply.open_circuit_voltage")
        zone = currents.zone_of(plant, self.voltage, 0.0, 0.0, speed, 0.0)
        return bridge_term.bus_voltage(plant.bridge, plant.source, plant.motor, zone, self.voltage, speed,
                                       self._motor_current(speed)) / self._share

    def acceleration(self, speed: float, torque: float) -> float:
        """Return the acceleration [rad/s²] at a speed [rad/s] that is not negative, against a torque [N m]."""
        plant, y = self._plant, _state(0.0, speed)
        zone = currents.zone_of(plant, self.voltage, 0.0, 0.0, speed, 0.0)
        sliding = FORWARD if contacts.has_friction(plant) else FREE
        return contacts.acceleration(plant, Mode(zone, sliding, RIGID, FREE, 0), self.voltage, torque, y)

    def torque(self, speed: float) -> float:
        """Return the torque [N m] against which the shaft turns steadily at a speed [rad/s]; 0 beyond no load."""
        most = motor.electromagnetic_torque(self._motor_current(speed), self._plant.motor.K)
        if not self.acceleration(speed, 0.0) > 0.0:
            return 0.0
        return _root(lambda tau: self.acceleration(speed, tau), 0.0, most)

    @cached_property
    def no_load_speed(self) -> float:
        """Steady speed of the free shaft [rad/s]."""
        plant = self._plant
        most = plant.source.V if source.present(plant.source) else plant.follower.V_max
        limit = most / motor.back_emf(1.0, plant.motor.K_b)
        return _root(lambda w: self.acceleration(w, 0.0), 0.0, limit)

    @cached_property
    def slowest(self) -> float:
        """Speed of the most torque [rad/s]: 0, unless static friction fades with speed."""
        if self._plant.friction.w_s == 0.0:
            return 0.0
        from scipy.optimize import minimize_scalar

        speeds = np.linspace(0.0, self.no_load_speed, 101)
        at = int(np.argmax([self.torque(w) for w in speeds.tolist()]))
        if at == 0:
            return 0.0
        found = minimize_scalar(lambda w: -self.torque(w), bounds=(speeds[at - 1], speeds[at + 1]), method="bounded",
                                options={"xatol": 1e-9 * self.no_load_speed})
        return float(found.x)

    @cached_property
    def stall_torque(self) -> float:
        """The most torque against which the shaft still turns [N m]: what brings it to a stand."""
        return self.torque(self.slowest)

    @cached_property
    def stall_current(self) -> float:
        """Current of the standing servo at full drive [A]."""
        return self.current(0.0)

    @cached_property
    def starting_torque(self) -> float:
        """The most torque against which the shaft starts from rest [N m]: static friction counts in full."""
        tau_m = motor.electromagnetic_torque(self._motor_current(0.0), self._plant.motor.K)

        def beyond(tau: float) -> float:
            return tau_m - tau - contacts.holding_bounds(self._plant, tau_m, -tau)[1]

        return _root(beyond, 0.0, tau_m) if beyond(0.0) > 0.0 else 0.0

    def speed(self, torque: float) -> float:
        """Return the steady speed [rad/s] against a torque [N m]; 0 from the stall torque on."""
        if not math.isfinite(torque):
            raise InputError("torque", got=torque, allowed="a finite number [N m]")
        if torque >= self.stall_torque:
            return 0.0
        high = self.no_load_speed if torque >= 0.0 else 10.0 * self.no_load_speed
        return _root(lambda w: self.acceleration(w, torque), self.slowest, high)

    def swing(self, load: Load | Part | None, start: float, end: float) -> Swing:
        """Return how the shaft turns from rest at one angle to a larger one [rad]; `load` acts all the way."""
        hung = as_load(load)
        plant = self.loaded(hung)._replace(stops=Stops(-math.inf, end, 0.0))
        record = RunLog()
        state = State(time=0.0, places=self.model.states, memory=started(_state(start, 0.0), RIGID, NOT_STARTED))
        run(Plan(plant, constant_pieces(self.voltage), hung.torque_pieces), state, _LONGEST_SWING, record)
        time = next((event.time for event in record.events if event.kind == "upper stop"), math.nan)
        if math.isnan(time):
            return Swing(math.nan, math.nan)
        moving = Trajectory(Motions(record.parts).between(until=time))
        return Swing(time, float(moving.integral(self._currents)[0]) / time)

    def _currents(self, samples: Samples) -> NDArray[np.float64]:
        return np.array([[self.current(w) for w in samples.speed.tolist()]])


def _state(angle: float, speed: float) -> Vector:
    cool = REFERENCE_TEMPERATURE
    return Vector(angle, speed, 0.0, cool, cool, angle, speed)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function that falls through 0 between two numbers does so."""
    if function(high) >= 0.0:
        return high
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=1e-15, rtol=8.9e-16, maxiter=200))


# --- Torque, speed, current, power and efficiency of a servo at full drive, at one voltage and one --------------------

POINTS = 121
_SIXTY = np.pi / 3.0


class OperatingPoint(NamedTuple):
    """A steady motion at full drive: torque [N m], speed [rad/s], current [A], power [W] and efficiency [1]."""

    torque: float
    speed: float
    current: float
    power: float
    efficiency: float


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpeedCurve:
    """A servo at full drive, from standing still to turning freely.

    Parameters
    ----------
    drive : FullDrive
        Drive that all follows from: any other point, and torques and currents at both ends.
    temperatures : Temperatures
        Of winding and housing [K].
    speed : ndarray, shape (n,)
        Rising from 0 to the speed without load [rad/s].
    torque : ndarray, shape (n,)
        Against which the shaft turns so fast [N m].
    current : ndarray, shape (n,)
        Of the supply, and of the motor [A].
    power : ndarray, shape (n,)
        Given to the load [W].
    efficiency : ndarray, shape (n,)
        That power over what the servo takes at its plug [1].
    """

    drive: FullDrive
    temperatures: Temperatures
    speed: Array
    torque: Array
    current: Array
    power: Array
    efficiency: Array

    def __repr__(self) -> str:
        return (f"SpeedCurve({self.drive.model!r}, stall {self.stall_torque:.3g} N m, "
                f"no load {self.no_load_speed:.3g} rad/s)")

    @property
    def stall_torque(self) -> float:
        """The most torque against which the shaft still turns [N m]."""
        return self.drive.stall_torque

    @property
    def stall_current(self) -> float:
        """Current of the standing servo at full drive [A]."""
        return self.drive.stall_current

    @property
    def no_load_speed(self) -> float:
        """Speed of the free shaft [rad/s]."""
        return self.drive.no_load_speed

    @property
    def no_load_current(self) -> float:
        """Current while the shaft turns freely [A]."""
        return float(self.current[-1])

    @property
    def time_60(self) -> float:
        """Time for 60 degrees at the speed without load, as sheets print it [s]."""
        return _SIXTY / self.no_load_speed

    @property
    def most_power(self) -> OperatingPoint:
        """The point of this curve at which the load is given most power."""
        return self._point(int(np.argmax(self.power)))

    @property
    def best_efficiency(self) -> OperatingPoint:
        """The point of this curve of the best efficiency."""
        return self._point(int(np.argmax(self.efficiency)))

    def at(self, torque: float) -> OperatingPoint:
        """Return the steady motion against a torque [N m]; of speed 0 from the stall torque on."""
        speed = self.drive.speed(torque)
        current, power = self.drive.current(speed), torque * speed
        taken = self.drive.bus_voltage(speed) * current
        return OperatingPoint(torque, speed, current, power, power / taken if taken > 0.0 else 0.0)

    def _point(self, k: int) -> OperatingPoint:
        return OperatingPoint(*(float(values[k]) for values in (
            self.torque, self.speed, self.current, self.power, self.efficiency)))


def speed_curve(model: Model, temperatures: Temperatures) -> SpeedCurve:
    """Return the curve of a model whose resistance and magnets are those at these temperatures [K]."""
    drive = FullDrive(model)
    speed = np.linspace(0.0, drive.no_load_speed, POINTS)
    torque = np.array([*(drive.torque(w) for w in speed[:-1].tolist()), 0.0])
    current = np.array([drive.current(w) for w in speed.tolist()])
    volts = np.array([drive.bus_voltage(w) for w in speed.tolist()])
    power = torque * speed
    taken = volts * current
    efficiency = np.divide(power, taken, out=np.zeros_like(power), where=taken > 0.0)
    for values in (speed, torque, current, power, efficiency):
        values.setflags(write=False)
    return SpeedCurve(drive=drive, temperatures=temperatures, speed=speed, torque=torque, current=current, power=power,
                      efficiency=efficiency)
