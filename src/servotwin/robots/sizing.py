"""Is the servo big enough: what a motion takes of each joint, in the curve of its servo.

All is at the shaft of the servo: speed and torque of the joint through ratio and direction of its mount, with what the
servo's own rotor and gear take. Where the torque drives the motion, the servo has what its curve at full drive gives at
this speed; where it holds the motion back, at least what it has at rest, for friction and back-EMF help it then. On a
shared supply it counts what the others leave: the least voltage that they left in the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.datasheet.full_drive import FullDrive, SpeedCurve, speed_curve
from servotwin.datasheet.holding import at_temperatures, at_voltage, changed
from servotwin.datasheet.warming import WIRE_LIMIT, Masses, thermal_masses
from servotwin.errors import InputError
from servotwin.physics import Temperatures, winding_resistance
from servotwin.physics.thermal import COPPER_COEFFICIENT, REFERENCE_TEMPERATURE, copper_loss
from servotwin.robots.servos.mount import supplied
from servotwin.simulation.remarks import LOW, Remark

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.robots.run import RobotRun
    from servotwin.robots.servos.record import ServoRecord


# --- How warm the servos of a robot get, in a motion and where it continues for ever ----------------------------------

Array = NDArray[np.float64]



_DUTIES = ("firmware.torque_limit", "firmware.duty_limit")
_LONGEST = 3600.0  # s; what is not too hot by then never gets so
_SOON = 600.0  # s
_STEPS = 720
_MELTED = 1e4  # K; beyond it numbers say nothing


@dataclass(frozen=True, kw_only=True)
class Heating:
    """How warm a servo gets whose motion is repeated without a pause.

    Parameters
    ----------
    heat : float
        Mean of i² R over the motion [W].
    winding, housing : float
        Temperatures to which they come in the end; inf where there is none [K].
    limit_time : float
        When the winding passes 130 °C, beginning cool; nan where it does not within an hour [s].
    trip_temperature : float
        Of the housing, at which the program trips; inf where it does not [K].
    trip_time : float
        When it gets so hot, likewise [s].
    soon : Temperatures
        After ten minutes, beginning cool [K].
    masses : Masses
    """

    heat: float
    winding: float
    housing: float
    limit_time: float
    trip_temperature: float
    trip_time: float
    soon: Temperatures
    masses: Masses



def mean_heat(record: ServoRecord, masses: Masses, since: float, until: float) -> float:
    """Return the mean heat of a winding between two times [W]: what both masses have kept and given to the air.

    Samples of a current that flows in short pulses would not tell. A model without temperatures has no such pulses.
    """
    inside = (record.time >= since) & (record.time <= until)
    time = record.time[inside]
    if time.size < 2:
        return math.nan
    if "winding_temperature" not in record:
        R = record.mount.model.value("motor.armature_resistance")
        return copper_loss(math.sqrt(float(np.mean(record["armature_current"][inside]**2))), R)
    winding, housing = record["winding_temperature"][inside], record["housing_temperature"][inside]
    lost = float(np.trapezoid(housing - masses.ambient, time)) / masses.housing_to_ambient
    kept = masses.winding_capacity * (winding[-1] - winding[0]) + masses.housing_capacity * (housing[-1] - housing[0])
    return max((float(kept) + lost) / float(time[-1] - time[0]), 0.0)


def heating(heat: float, mean_winding: float, masses: Masses, trip_temperature: float = math.inf) -> Heating:
    """Return how warm a servo gets that continues to make a heat [W], which grows with the resistance of its copper.

    Parameters
    ----------
    heat : float
        While the winding was at `mean_winding` [W]
    mean_winding : float
        [K]
    masses : Masses
    trip_temperature : float
        Of the housing, at which the servo's program trips [K]

    Examples
    --------
    >>> from servotwin.datasheet.warming import masses_by_mass
    >>> cool, hot = (heating(heat, 298.15, masses_by_mass(0.055)) for heat in (0.5, 3.0))
    >>> round(cool.winding), cool.limit_time, hot.winding > 403.15, round(hot.limit_time)
    (315, nan, True, 553)
    """
    per_watt = masses.winding_to_housing + masses.housing_to_ambient
    cold = heat / float(winding_resistance(mean_winding, 1.0))  # at the reference temperature
    slope = COPPER_COEFFICIENT * cold * per_watt
    first = cold * per_watt * float(winding_resistance(masses.ambient, 1.0))
    rise = math.inf if slope >= 1.0 else first / (1.0 - slope)
    winding_time, housing_time, soon = _passing(cold, masses, WIRE_LIMIT, trip_temperature)
    return Heating(
        heat=heat, winding=masses.ambient + rise, housing=masses.ambient + rise * masses.housing_to_ambient / per_watt,
        limit_time=winding_time, trip_temperature=trip_temperature, trip_time=housing_time, soon=soon,
        masses=masses)


def _passing(cold: float, masses: Masses, winding: float, housing: float) -> tuple[float, float, Temperatures]:
    """Return when winding and housing pass temperatures [K], of a heat [W] made at the reference temperature.

    And the temperatures after ten minutes.
    """
    now, step, found = Temperatures(masses.ambient, masses.ambient), _LONGEST / _STEPS, [math.nan, math.nan]
    soon = now
    for k in range(_STEPS):
        if now.winding > _MELTED:
            break
        after = masses.after(step, cold * float(winding_resistance(now.winding, 1.0)), now)
        for at, (limit, old, new) in enumerate(zip((winding, housing), now, after, strict=True)):
            if math.isnan(found[at]) and new > limit:
                found[at] = step * (k + float((limit - old) / (new - old)))
        now = Temperatures(float(after.winding), float(after.housing))
        soon = now if (k + 1) * step <= _SOON else soon
    return found[0], found[1], soon


def lasting_torque(model: Model, masses: Masses) -> float:
    """Return the torque that a servo can lift slowly without end: its winding comes to 130 °C [N m].

    Where it holds still instead, friction helps it. 0 where that current does not move the shaft, nan of a model that
    has no limit of current.
    """
    if "supply.current_limit" not in model.optional:
        return math.nan
    hot = masses.with_winding(WIRE_LIMIT)
    warm = at_temperatures(model, hot, masses.magnet_coefficient)
    allowed = (WIRE_LIMIT - masses.ambient) / (masses.winding_to_housing + masses.housing_to_ambient)
    limit = math.sqrt(allowed / warm.value("motor.armature_resistance"))
    # At full duty the current of the supply is that of the motor; what the program's own duty gives is the other bound.
    free = {name: None for name in _DUTIES if warm.servo.get(name) is not None}
    try:
        by_heat = FullDrive(changed(warm, {**free, "supply.current_limit": limit})).stall_torque
        return min(by_heat, FullDrive(warm).stall_torque)
    except InputError:  # the shaft does not turn by it
        return 0.0


# --- Is the servo big enough: what a motion takes of each joint, in the curve of its servo ----------------------------

_FREE = 1e-9  # N m, below which nothing is asked of a servo
_LOOK = 0.02  # s, over which what a servo delivers is averaged: a frame of pulses
_SAGS = 0.99  # of the supply's voltage: what others leave above it is not distinguished
_MOST_TOLD = 100.0  # times
_ZERO_CELSIUS = 273.15
_COOL = Temperatures(REFERENCE_TEMPERATURE, REFERENCE_TEMPERATURE)


class Demand(NamedTuple):
    """The torque asked of a shaft, or delivered by it, over time.

    Parameters
    ----------
    speed : ndarray, shape (n,)
        Magnitude [rad/s]
    torque : ndarray, shape (n,)
        Of the servo: positive where it drives the motion, negative where it holds it back [N m]
    """

    speed: Array
    torque: Array


class Worst(NamedTuple):
    """The time [s] at which a servo has least to spare: speed [rad/s], torque asked of it, torque it has [N m]."""

    time: float
    speed: float
    torque: float
    available: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Sizing:
    """Whether the servo of a joint is big enough for a motion.

    Parameters
    ----------
    joint : str
    curve : SpeedCurve
        Of the cold servo, alone on its supply.
    voltage : float
        Of that supply [V]
    sagged : SpeedCurve, optional
        With the least voltage that others on the supply left in the run, where that is more than 1 % less.
    left_voltage : float
        That voltage [V]
    top_speed : float
        Without load, or what its program allows [rad/s]
    needed, delivered : Demand
        By the ideal motion, and in the run, there as means over 20 ms; times are those of the run.
    margin : float
        Smallest torque available, with what others leave of the supply, over torque needed; 0 where the motion is too
        fast, inf where it takes no torque.
    short : float
        How long the motion asks for more than the servo has [s]
    worst : Worst
        Where the margin is.
    rms_torque, rms_delivered : float
        Root mean square over the motion [N m]
    lasting_torque : float
        That the servo can lift slowly without end; nan where that is not known [N m]
    heating : Heating, optional
        Of a motion that is repeated; None where thermal masses are not known.
    trips : tuple of Remark
        Of the run.
    unjudged : str
        Why nothing can be said about this, as of the run; empty if it can.
    held : str
        First contact that presses on the joint while it moves, in words.
    """

    joint: str
    curve: SpeedCurve
    voltage: float
    sagged: SpeedCurve | None
    left_voltage: float
    top_speed: float
    needed: Demand
    delivered: Demand
    margin: float
    short: float
    worst: Worst
    rms_torque: float
    rms_delivered: float
    lasting_torque: float
    heating: Heating | None
    trips: tuple[Remark, ...]
    unjudged: str = ""
    held: str = ""

    @property
    def big_enough(self) -> bool:
        """Whether the servo has what the motion takes, stays cool enough, and does not trip; no if it is not judged."""
        return not self.problems

    @property
    def problems(self) -> tuple[str, ...]:
        """Faults, the worst first; empty where the servo is big enough."""
        if self.unjudged:
            return (f"not judged: {self.unjudged}",)
        found = [f"{trip.kind} at {trip.time:.2f} s" for trip in self.trips]
        if self.margin < 1.0:
            found.append(self._shortage())
        return (*found, *([] if self.heating is None else _too_hot(self.heating)))

    @property
    def verdict(self) -> str:
        """One sentence.

        Where the margin is less than 1 the servo may come through nevertheless, later than it should.
        """
        said = list(self.problems)
        if not said:
            times = f"more than {_MOST_TOLD:.0f}" if self.margin > _MOST_TOLD else f"{self.margin:.2g}"
            said.append(f"big enough: {times} times what is needed")
        return "; ".join([*said, *([self.held] if self.held and not self.unjudged else [])])

    def _shortage(self) -> str:
        at = self.worst
        speed = f"{math.degrees(at.speed):.0f} deg/s"
        when = f"at {at.time:.2f} s" + (f" and for {self.short:.2f} s in all" if self.short > 0.0 else "")
        held = "" if not self.left_voltage < LOW * self.voltage else (
            f", held back by its supply: the others leave it {self.left_voltage:.2g} V of {self.voltage:g} V")
        if at.available == 0.0:
            return (f"too slow {when}: the motion needs {speed}, the servo turns at most "
                    f"{math.degrees(self.top_speed):.0f} deg/s{held}")
        return (f"too weak {when}: the motion needs {at.torque:.3g} N m at {speed}, the servo has {at.available:.3g} "
                f"N m{held}")


def _too_hot(found: Heating) -> list[str]:
    """Say what happens to a servo that continues its motion."""
    limits = ((found.winding, WIRE_LIMIT, found.limit_time, "gets too hot: its winding"),
              (found.housing, found.trip_temperature, found.trip_time, "trips by heat: its housing"))
    said = []
    for end, limit, time, words in limits:
        if end > limit:
            when = f"{time:.0f} s" if time < 100.0 else f"{time / 60.0:.0f} min"
            said.append(f"{words} passes {limit - _ZERO_CELSIUS:.0f} deg C after "
                        f"{'more than an hour' if math.isnan(time) else when} of this motion")
    return said


def sizing_of(run: RobotRun) -> dict[str, Sizing]:
    """Return for each joint of a run whether its servo is big enough for the motion.

    The motion is what counts, from its beginning to its end; before and after it the robot stands.

    Parameters
    ----------
    run : RobotRun

    Raises
    ------
    InputError
        If a supply does not turn a servo.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots import Motion, run_motion, sizing_of
    >>> nod = Motion(time=[0.0, 0.5, 1.0], angles={"wrist_flex": [0.0, 0.4, 0.0]}, source="a nod")
    >>> run = run_motion("so101", {"wrist_flex": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}, nod)
    >>> sizing_of(run)["wrist_flex"].big_enough
    True
    """
    return {joint: _sized(run, joint) for joint in run.mounts}



def shaft_demand(speed: Array, torque: Array, gain: float) -> Demand:
    """Return speed and torque of a joint as those of its servo, which a gain makes of it.

    Examples
    --------
    >>> shaft_demand(np.array([-1.0]), np.array([0.5]), -2.0)
    Demand(speed=array([0.5]), torque=array([-1.]))
    """
    return Demand(np.abs(speed / gain), np.where(speed / gain < 0.0, -1.0, 1.0) * torque * gain)


def available(curve: SpeedCurve, demand: Demand, top_speed: float) -> Array:
    """Return the torque [N m] that a servo has at the speeds of a demand: 0 where it does not get so fast.

    Parameters
    ----------
    curve : SpeedCurve
    demand : Demand
    top_speed : float
        That its program allows; without load it does not get faster either, unless it is driven [rad/s]
    """
    has = np.interp(demand.speed, curve.speed, curve.torque, right=0.0)
    # A torque that holds back lets a shaft turn faster than without load: there the curve has negative torque.
    for k in np.flatnonzero(demand.torque < 0.0).tolist():
        w, tau = float(demand.speed[k]), float(demand.torque[k])
        driven = w <= curve.no_load_speed or curve.drive.speed(tau) >= w
        has[k] = curve.stall_torque if driven else 0.0
    has[demand.speed > top_speed] = 0.0
    return has


def _sized(run: RobotRun, joint: str) -> Sizing:
    mount, record, supply = run.mounts[joint], run.record[joint], run.supply_of(joint)
    model = supplied(mount.model, supply)
    curve, voltage, left = speed_curve(model, _COOL), model.value("supply.open_circuit_voltage"), _left(run, joint)
    sagged = _sagged(model, left) if left < _SAGS * voltage else None
    limit = model.servo.firmware.speed_limit
    program = float(limit) if limit else math.inf
    weakest = sagged or curve
    course = run.ideal.courses[joint]
    needed = shaft_demand(course.speed, run.ideal.torque[joint] + _loose(run, joint) * course.acceleration, mount.gain)
    inside = (run.time >= 0.0) & (run.time <= run.motion.duration)
    has = available(weakest, needed, program)
    asked = np.where(np.abs(needed.torque) > _FREE, np.abs(needed.torque), _FREE)
    ratio = np.where((np.abs(needed.torque) > _FREE) | (has == 0.0), has / asked, math.inf)
    at = int(np.flatnonzero(inside)[np.lexsort((-needed.speed[inside], ratio[inside]))[0]])  # fastest of the worst
    delivered = _delivered(run, joint)
    masses = thermal_masses(mount.model.servo)
    return Sizing(
        joint=joint, curve=curve, voltage=voltage, sagged=sagged, left_voltage=left,
        top_speed=min(program, weakest.no_load_speed), needed=needed, delivered=delivered, margin=float(ratio[at]),
        short=float(np.count_nonzero(ratio[inside] < 1.0) * (run.time[1] - run.time[0])),
        worst=Worst(float(run.time[at]), float(needed.speed[at]), float(abs(needed.torque[at])), float(has[at])),
        rms_torque=_rms(needed.torque[inside]), rms_delivered=_rms(delivered.torque[inside]),
        lasting_torque=math.nan if masses is None else lasting_torque(model, masses),
        heating=None if masses is None else _heating(run, joint), trips=record.trips, unjudged=run.unjudged,
        held=next((f"held by {touch.first} against {touch.second} from {max(touch.time, 0.0):.2f} s on"
                   for touch in run.ideal.touches if joint in touch.joints), ""))


def _heating(run: RobotRun, joint: str) -> Heating | None:
    record, masses = run.record[joint], thermal_masses(run.mounts[joint].model.servo)
    if masses is None:
        return None
    winding = (float(record["winding_temperature"].mean()) if "winding_temperature" in record
               else REFERENCE_TEMPERATURE)
    heat = mean_heat(record, masses, 0.0, run.motion.duration)
    trip = run.mounts[joint].model.servo.firmware.trip_temperature
    return None if math.isnan(heat) else heating(heat, winding, masses, math.inf if trip is None else trip)


def _left(run: RobotRun, joint: str) -> float:
    """Return the least voltage [V] that others on its supply have left a servo, its own sag not counted."""
    supply, record = run.supply_of(joint), run.record[joint]
    if supply is None or not supply.internal_resistance or "bus_voltage" not in record:
        return math.inf
    left = record["bus_voltage"] + supply.internal_resistance * record["supply_current"]
    return float(left[run.time >= 0.0].min())


def _sagged(model: Model, left: float) -> SpeedCurve | None:
    try:
        return speed_curve(at_voltage(model, left), _COOL)
    except InputError:  # it does not turn at all
        return None


def _loose(run: RobotRun, joint: str) -> float:
    """Return the inertia at the joint [kg m² or kg] of a rotor that play or an elastic gear parts from the shaft."""
    mount, value = run.mounts[joint], run.mounts[joint].model.value_or
    rotor = value("gear.gear_reduction", 0.0) ** 2 * value("motor.rotor_inertia", 0.0)
    whole = (rotor + value("gear.output_inertia", 0.0)) / mount.gain**2
    return max(whole - float(run.model.dof_armature[run.model.joint(joint).dofadr[0]]), 0.0)


def _delivered(run: RobotRun, joint: str) -> Demand:
    """Return what a servo gave to its joint, and to its own rotor and gear, as means over a frame."""
    record, mount = run.record[joint], run.mounts[joint]
    speed = record["output_speed"] * mount.gain
    step = float(run.time[1] - run.time[0])
    count = max(round(_LOOK / step), 1)
    speed, torque = (np.convolve(values, np.ones(count) / count, "same") for values in (speed, record["joint_torque"]))
    return shaft_demand(speed, torque + _loose(run, joint) * np.gradient(speed, step), mount.gain)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
