"""`curves`: a servo's sheet as it should have been, computed from its parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.datasheet.buzzing import Buzz, buzz
from servotwin.datasheet.conditions import at_temperatures, at_voltage, warned_once
from servotwin.datasheet.curve import SpeedCurve, speed_curve
from servotwin.datasheet.guesses import Span, spans, variants
from servotwin.datasheet.holding import Held, holding_errors, smallest_move, with_spans
from servotwin.datasheet.lift import Lift, lift_of
from servotwin.datasheet.loop import Loop, loop_of
from servotwin.datasheet.turning import SpeedMap, is_pulsed, still_pulses, wheel_speed_of
from servotwin.datasheet.warming import HOT_WINDING, MAGNET_COEFFICIENT, masses_by_mass, thermal_masses
from servotwin.errors import InputError
from servotwin.linear import frequency_response
from servotwin.look import escape, number, table
from servotwin.models import Model, mid_travel
from servotwin.parameters import PrintedPoint, printed_points
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, Temperatures
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters import Servo

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
    """What a servo does at one supply voltage.

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
        What the sheet prints for this voltage, one a source; empty where it does not.
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
