"""`curves`: a servo's sheet as it should have been, computed from its parameters."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin import signals
from servotwin.datasheet.full_drive import FullDrive, SpeedCurve, speed_curve
from servotwin.datasheet.holding import (
    Buzz,
    Held,
    Span,
    at_temperatures,
    at_voltage,
    buzz,
    hold,
    holding_errors,
    smallest_move,
    smallest_stir,
    spans,
    variants,
    warned_once,
    with_spans,
)
from servotwin.datasheet.static_loop import Loop, loop_of
from servotwin.datasheet.turning import SpeedMap, is_pulsed, slow_rotor, still_pulses, wheel_speed_of
from servotwin.datasheet.warming import HOT_WINDING, MAGNET_COEFFICIENT, Lift, lift_of, masses_by_mass, thermal_masses
from servotwin.errors import InputError
from servotwin.linear import frequency_response
from servotwin.look import escape, number, table
from servotwin.models import Model, default_model, mid_travel
from servotwin.parameters import PrintedPoint, printed_fact, printed_points
from servotwin.parameters.servo_file import ELSE, POINT
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, Temperatures
from servotwin.simulation.simulator import simulate
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters import Servo


# --- Printed figures beside those of the servo made of the sheet, simulated, figure by figure -------------------------

_MOST_OFF = 0.15  # of a printed figure: what is further off is flagged
_MOST_TIME = 1.4  # times the printed time for 60°, in which a step of 60° from rest passes 54°
_STEP, _PASSED = math.radians(60.0), math.radians(54.0)
_SETTLES = 1.0  # s
_SHARE = 0.25  # of the stall torque, which a servo holds


class Figure(NamedTuple):
    """A printed figure and what the servo does (SI).

    Parameters
    ----------
    name : str
        In words, such as "stall torque".
    unit : str
    voltage : float
        Supply voltage that it holds for [V].
    printed, simulated : float
        A time for 60° as such.
    source : str
        Where it is printed.
    remark : str
        Why it is off, where that is known.
    """

    name: str
    unit: str
    voltage: float
    printed: float
    simulated: float
    source: str
    remark: str = ""

    @property
    def off(self) -> float:
        """How far the servo is off what is printed, of that [1]."""
        return self.simulated / self.printed - 1.0

    @property
    def flag(self) -> str:
        """The same in words, where it is off by more than 15 %; else empty."""
        if abs(self.off) <= _MOST_OFF:
            return ""
        why = f" ({self.remark})" if self.remark else ""
        return (f"{self.name} at {self.voltage:g} V: {self.simulated:.3g} {self.unit} simulated, {self.printed:.3g} "
                f"printed{why}")


def printed_beside(servo: Servo, *, steady: bool = False) -> tuple[Figure, ...]:
    """Return every figure that a sheet prints of what a servo does, with what it does when it is simulated.

    Torque, speed and currents at each voltage are those of the model's steady motion at full drive; travel, pulses and
    deadband those of its chip or program.

    Parameters
    ----------
    servo : Servo
        With a table [sheet].
    steady : bool
        Whether to leave out what has to be simulated pulse by pulse.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> found = printed_beside(load_servo("hitec-hs-645mg"), steady=True)
    >>> [(figure.name, round(figure.off, 2)) for figure in found[:2]]
    [('stall torque', 0.01), ('time for 60 deg', -0.03)]
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a sheet contradicts itself is said elsewhere
        return tuple(_figures(servo, steady=steady))


def _figures(servo: Servo, *, steady: bool) -> Iterator[Figure]:
    model = _quiet_model(servo)
    others = servo.sheet.get(ELSE)
    printed = [each for each in (servo.sheet, *(others if isinstance(others, list) else []))
               if isinstance(each, Mapping)]
    for each in printed:
        yield from _at_a_voltage(model, each, steady=steady)
    if not steady:
        yield from _of_the_whole(model)


def beside_flags(servo: Servo, figures: Iterable[Figure], motion: Motion | None = None) -> tuple[str, ...]:
    """Return what of a servo does not go with its sheet, each in words that name it and both numbers.

    Figures that are off by more than 15 %, a rotor that takes longer to speed up than the printed time, and a step of
    60° that takes longer than 1.4 times that.
    """
    slow, said = slow_rotor(servo), {figure.name if figure.remark else figure.flag: figure.flag
                                     for figure in reversed([*figures]) if figure.flag}
    found = [*([slow] if slow is not None else []), *reversed(said.values())]
    if motion is not None and motion.late and servo.kind != "bus":  # of a bus servo its registers decide
        found.append(f"60 deg from rest: {motion.words}, {motion.printed_time:.3g} s for 60 deg printed")
    return tuple(found)


class Motion(NamedTuple):
    """A step of 60° from rest in the middle of the travel, and a load that is held there.

    Parameters
    ----------
    passes : float
        When it passes 54°; nan where it does not [s].
    overshoot : float
        Beyond its target, of the way [1].
    printed_time : float
        For 60° at the servo's voltage; nan where that is not printed [s].
    torque, error : float
        A quarter of the stall torque [N m], and how far it pulls the servo off; nan where that does not stand [rad].
    spans : mapping of str to Span
        Ranges of `passes`, `overshoot` and `error`, where they rest on guesses.
    """

    passes: float
    overshoot: float
    printed_time: float
    torque: float
    error: float
    spans: Mapping[str, Span]

    @property
    def late(self) -> bool:
        """Whether the step takes longer than 1.4 times the printed time."""
        return self.printed_time > 0.0 and not self.passes <= _MOST_TIME * self.printed_time

    @property
    def words(self) -> str:
        """When it passes 54°."""
        return "does not pass 54 deg" if math.isnan(self.passes) else f"passes 54 deg after {self.passes:.3g} s"


def motion_of(servo: Servo) -> Motion | None:
    """Return how a servo moves and holds, with ranges; None of one that turns without end.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> found = motion_of(load_servo("hitec-hs-645mg"))
    >>> found.late, round(found.passes, 2)
    (False, 0.21)
    """
    model = _quiet_model(servo)
    if model.endless:
        return None
    torque = _SHARE * FullDrive(model).stall_torque
    own = _moves_and_holds(model, torque)
    found = spans(own, (_moves_and_holds(each, torque) for each in variants(model, rotor=True)))
    at, volts = printed_points(servo), model.value("supply.open_circuit_voltage")
    printed = next((point.time_60 for point in at if point.time_60 and point.supply_voltage == volts), math.nan)
    return Motion(own["passes"], own["overshoot"], float(printed), torque, own["error"], found)


def _moves_and_holds(model: Model, torque: float) -> dict[str, float]:
    start = mid_travel(model) - 0.5 * _STEP
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a contradiction is said elsewhere
        run = simulate(model, signals.step(start, start + _STEP, at=0.0, unit="rad"), duration=_SETTLES,
                       output_step=5e-4)
        held = hold(model, torque)
    turned = run["output_angle"] - start
    passed = run.time[turned > _PASSED]
    return {"passes": float(passed[0]) if len(passed) else math.nan,
            "overshoot": max(0.0, float(turned.max()) / _STEP - 1.0), "error": held.error}


def _quiet_model(servo: Servo) -> Model:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # which model stands for it is said elsewhere
        return default_model(servo)


def _at_a_voltage(model: Model, table: Mapping[str, Any], *, steady: bool) -> Iterator[Figure]:
    """Yield the figures of one row of the sheet."""
    volts = printed_fact(table, "supply_voltage")
    if volts is None:
        return
    try:
        there = at_voltage(model, volts)
        drive = FullDrive(there)
    except InputError:
        return  # a supply that the model refuses, or that does not turn it, is said by all that simulates it
    free = drive.no_load_speed
    values = {"stall_torque": ("stall torque", "N m", drive.stall_torque),
              "speed_per_60deg": ("time for 60 deg", "s", math.pi / 3.0 / free),
              "no_load_current": ("current without load", "A", drive.current(free)),
              "stall_current": ("stall current", "A", drive.stall_current)}
    for key in POINT:
        printed = printed_fact(table, key)
        if key in values and printed:
            name, unit, simulated = values[key]
            yield Figure(name, unit, volts, printed, simulated, _source(table, key))
    idle = printed_fact(table, "idle_current")
    if idle and not steady and not model.endless:
        yield Figure("current at rest", "A", volts, idle, hold(there, 0.0).current, _source(table, "idle_current"),
                     "the model has no current of its own electronics")


def _of_the_whole(model: Model) -> Iterator[Figure]:
    """Yield the figures of chip or program: deadband, and the angle between two pulses."""
    sheet, volts = model.servo.sheet, model.value("supply.open_circuit_voltage")
    if "pulse_width" not in model.available:
        return
    width = printed_fact(sheet, "deadband")
    if width:
        simulated = _deadband(model)
        if not math.isnan(simulated):
            yield Figure("deadband", "us", volts, 1e6 * width, 1e6 * simulated, _source(sheet, "deadband"))
    low, high, travel = (printed_fact(sheet, key) for key in ("pulse_min", "pulse_max", "travel"))
    if low and high and travel and not model.endless:
        angles = [math.degrees(_angle_at(model, pulse)) for pulse in (low, high)]
        yield Figure("travel", "deg", volts, math.degrees(travel), angles[1] - angles[0], _source(sheet, "travel"))


def _deadband(model: Model) -> float:
    """Return the full width of the pulses [s] that do not move the free shaft."""
    if is_pulsed(model):
        still = still_pulses(model, wheel_speed_of(model))
        return math.nan if still is None else still[1] - still[0]
    slope, p = model.servo.electronics.one_shot_slope, model.servo.potentiometer.feedback_gain
    return math.nan if slope is None or p is None else 2.0 * slope * p * smallest_stir(model)


def _angle_at(model: Model, pulse: float) -> float:
    """Return where a servo stands after a while of pulses of a width [s], or where a stop holds it [rad]."""
    return float(simulate(model, signals.constant(1e6 * pulse, unit="us"), duration=0.1,
                          output_times=[0.0, 0.1])["output_angle"][-1])


def _source(table: Mapping[str, Any], key: str) -> str:
    entry = table.get(key)
    return str(entry.get("source", "")) if isinstance(entry, Mapping) else ""


# --- `curves`: a servo's sheet as it should have been, computed from its parameters -----------------------------------

AMPLITUDES = tuple(math.radians(a) for a in (2.0, 5.0, 15.0, 45.0))
FREQUENCIES = tuple(2.0 * math.pi * f for f in np.geomspace(1.0, 20.0, 10).tolist())
_SAME_VOLTAGE = 1e-6  # V
_ROOM = 0.95  # of half the travel: what a sine may take of it


class Bandwidth(NamedTuple):
    """Up to which frequency sines of an amplitude are followed within 3 dB.

    Parameters
    ----------
    amplitude : float
        Of the commanded angle [rad].
    frequency : float
        0 where they are not at the lowest, inf where they still are at the highest that was tried [Hz].
    """

    amplitude: float
    frequency: float


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class VoltageSheet:
    """A servo at one supply voltage.

    Parameters
    ----------
    voltage : float
        [V].
    cold, hot : SpeedCurve
        With all parts at 25 °C, and warm.
    smallest_move : float
        The smallest step of the command that the free shaft follows to half [rad].
    smallest_pulse : float
        The same as a pulse width; nan where the model has no pulses [s].
    holding : tuple of Held
        Errors under shares of the cold stall torque.
    bandwidth : tuple of Bandwidth
        Empty where it was not asked for.
    printed : tuple of PrintedPoint
        Printed values for this voltage, one a source; empty where the sheet prints none.
    lift : Lift, optional
        Where a mass was given.
    loop : Loop, optional
        Of a digital servo.
    buzz : Buzz, optional
        How the servo drives at rest without a load; none of one that turns without end.
    move_span : Span, optional
        Range of `smallest_move`, where it rests on guesses; those of holding are beside it.
    turning : SpeedMap, optional
        Speed over pulse width of a servo that turns endlessly by pulses.
    still : tuple of float, optional
        The shortest and the longest pulse at which that stands; None where it always creeps [s].
    """

    voltage: float
    cold: SpeedCurve
    hot: SpeedCurve
    smallest_move: float
    smallest_pulse: float
    holding: tuple[Held, ...]
    bandwidth: tuple[Bandwidth, ...]
    printed: tuple[PrintedPoint, ...]
    lift: Lift | None
    loop: Loop | None
    buzz: Buzz | None = None
    move_span: Span | None = None
    turning: SpeedMap | None = None
    still: tuple[float, float] | None = None

    def __repr__(self) -> str:
        return f"VoltageSheet({self.voltage:g} V, stall {self.cold.stall_torque:.3g} N m)"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DataSheet:
    """A servo's sheet, computed: one part for each supply voltage.

    Parameters
    ----------
    model : Model
        As it was given.
    voltages : tuple of VoltageSheet
    """

    model: Model
    voltages: tuple[VoltageSheet, ...]

    def __repr__(self) -> str:
        return f"DataSheet({self.model!r}, {', '.join(f'{part.voltage:g} V' for part in self.voltages)})"

    def _repr_html_(self) -> str:
        """Return the main figures of each voltage, cold, as notebooks show them."""
        head = ["V", "stall torque [N m]", "stall current [A]", "speed [rad/s]", "60° [s]", "smallest move [rad]"]
        rows = [[number(x) for x in (part.voltage, part.cold.stall_torque, part.cold.stall_current,
                                     part.cold.no_load_speed, part.cold.time_60, part.smallest_move)]
                for part in self.voltages]
        return table(head, rows, caption=escape(self.servo.title or self.servo.name))

    @property
    def servo(self) -> Servo:
        """The servo whose sheet it is."""
        return self.model.servo

    def at(self, voltage: float) -> VoltageSheet:
        """Return the part for one of the voltages [V].

        Raises
        ------
        InputError
            If it was not computed.
        """
        for part in self.voltages:
            if abs(part.voltage - voltage) < _SAME_VOLTAGE:
                return part
        raise InputError("voltage of a data sheet", got=voltage,
                         allowed=", ".join(f"{part.voltage:g}" for part in self.voltages) + " V, which were computed")


def curves(model: Model, voltage: float | Iterable[float] | None = None, lift: tuple[float, float] | None = None, *,
           hot: float = HOT_WINDING, bandwidth: bool = True) -> DataSheet:
    """Compute the sheet of a servo from its parameters.

    Speed, torque and current come from the steady motion of the model at full drive, load friction, bridge, source and
    current limit included; what the servo does around standing still is simulated, pulse by pulse or tick by tick.

    Parameters
    ----------
    model : Model
        `PulseServo`, `PulseServoInductive`, `BoundedServo` or `DigitalServo`.
    voltage : float or sequence of float, optional
        Supply voltages; the servo's own unless given [V].
    lift : tuple of float, optional
        A mass [kg] and the length of the arm [m] on which the servo lifts it.
    hot : float
        Temperature of the winding in the hot curves [K]; magnets and housing are as warm as they get with it.
    bandwidth : bool
        Whether to simulate sines, which takes longer than all else.

    Returns
    -------
    DataSheet

    Raises
    ------
    InputError
        If the model has no supply, a voltage is not positive, does not turn the servo, or is more than twice the
        highest that the sheet prints; if mass or arm are not positive, or `hot` is below 25 °C.

    Examples
    --------
    >>> import servotwin as st
    >>> sheet = st.curves(st.PulseServo(st.load_servo("hitec-hs-311")), voltage=[4.8, 6.0], bandwidth=False)
    >>> [round(part.cold.stall_torque, 2) for part in sheet.voltages], sheet.at(6.0).printed[0].stall_torque
    ([0.29, 0.39], 0.3432)
    """
    if not isinstance(model, Model):
        raise InputError("model", got=model, allowed="a model of a servo, such as PulseServo(load_servo(...))")
    if not (is_finite(hot) and hot >= REFERENCE_TEMPERATURE):
        raise InputError("temperature of the hot winding", got=hot, allowed="at least 298.15 K")
    asked = _voltages(model, voltage)
    with warned_once():
        warm, ends = [at_voltage(model, V) for V in asked], variants(model)
        return DataSheet(model=model, voltages=tuple(
            _at(each, V, lift, hot, [at_voltage(end, V) for end in ends], bandwidth=bandwidth)
            for each, V in zip(warm, asked, strict=True)))


def hot_temperatures(servo: Servo, winding: float) -> Temperatures:
    """Return the temperatures [K] of a servo whose winding has come to rest at this one [K].

    Which part of the rise the housing takes is that of the servo's thermal numbers; of assumed ones, whatever the
    mass, 43 %.
    """
    return (thermal_masses(servo) or masses_by_mass(1.0)).with_winding(winding)


def _voltages(model: Model, voltage: float | Iterable[float] | None) -> tuple[float, ...]:
    if voltage is None:
        return (model.value("supply.open_circuit_voltage"),)
    found = tuple(voltage) if isinstance(voltage, Iterable) else (voltage,)
    if not found:
        raise InputError("voltage", got="none", allowed="at least one")
    for each in found:
        if not is_finite(each):
            raise InputError("voltage", got=each, allowed="a positive number [V], or several")
    return tuple(dict.fromkeys(float(each) for each in found))


def _at(model: Model, voltage: float, lift: tuple[float, float] | None, hot: float, others: Sequence[Model], *,
        bandwidth: bool) -> VoltageSheet:
    servo = model.servo
    masses, cool = thermal_masses(servo), Temperatures(REFERENCE_TEMPERATURE, REFERENCE_TEMPERATURE)
    magnet = MAGNET_COEFFICIENT if masses is None else masses.magnet_coefficient
    cold = speed_curve(model, cool)
    printed = tuple(point for point in printed_points(servo)
                    if point.supply_voltage is not None and abs(point.supply_voltage - voltage) < _SAME_VOLTAGE)
    warm = hot_temperatures(servo, hot)
    if model.endless:  # it holds no angle, and no angle is asked of it
        if lift is not None:
            raise InputError(f"lift by {servo.name}", got="potentiometer.fixed_angle",
                             allowed="a servo that holds an angle")
        turning = wheel_speed_of(model) if is_pulsed(model) else None
        return VoltageSheet(
            voltage=voltage, cold=cold, hot=speed_curve(at_temperatures(model, warm, magnet), warm),
            smallest_move=math.nan, smallest_pulse=math.nan, holding=(), bandwidth=(), printed=printed, lift=None,
            loop=None, turning=turning, still=None if turning is None else still_pulses(model, turning))
    step = smallest_move(model)
    moves = spans({"": step}, ({"": smallest_move(other)} for other in others))
    return VoltageSheet(
        voltage=voltage, cold=cold, hot=speed_curve(at_temperatures(model, warm, magnet), warm),
        smallest_move=step, smallest_pulse=_as_pulse(model, step), move_span=moves.get(""),
        holding=with_spans(holding_errors(model, cold.stall_torque), others),
        bandwidth=bandwidths(model) if bandwidth else (), printed=printed,
        lift=None if lift is None else spanned_lift(model, *lift, others), loop=loop_of(model), buzz=buzz(model))


def spanned_lift(model: Model, mass: float, arm: float, others: Sequence[Model]) -> Lift:
    """Return what a servo does with a mass [kg] on an arm [m], and by its variants the range of the error."""
    found = lift_of(model, mass, arm)
    return replace(found, held=with_spans([found.held], others, inertia=mass * arm * arm)[0])


def _as_pulse(model: Model, angle: float) -> float:
    slope, p = model.servo.electronics.one_shot_slope, model.servo.potentiometer.feedback_gain
    return math.nan if slope is None or p is None or "pulse_width" not in model.available else slope * p * angle


def bandwidths(model: Model, amplitudes: tuple[float, ...] = AMPLITUDES,
               frequencies: tuple[float, ...] = FREQUENCIES) -> tuple[Bandwidth, ...]:
    """Return up to which frequency a free servo follows sines of some amplitudes [rad] within 3 dB.

    `frequencies` [rad/s] are those that are tried, from 1 to 20 Hz unless given.
    """
    middle, stops = mid_travel(model), model.servo.stops
    room = min((abs(stop - middle) for stop in (stops.lower_angle, stops.upper_angle) if stop is not None),
               default=math.inf)
    sizes = [size for size in amplitudes if size <= _ROOM * room]
    period = model.value_or("electronics.frame_period", 0.02)
    below = [w for w in frequencies if w < 0.9 * math.pi / period]
    seen = frequency_response(model, below, amplitude=sizes)
    return tuple(Bandwidth(size, 0.0 if math.isnan(w) else w / (2.0 * math.pi))
                 for size, w in zip(sizes, seen.bandwidth(reference=1.0).tolist(), strict=True))
