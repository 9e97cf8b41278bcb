"""A servo that stands: how far a load pulls it off, what it draws, and the smallest command that moves it."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from servotwin import loads, physics, signals
from servotwin.errors import InputError
from servotwin.loads import Coulomb, as_load
from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive, mid_travel
from servotwin.models.outputs import warm_plant
from servotwin.parameters import operating_voltages, sheet_voltages
from servotwin.parameters.servo import SET_BY_USER
from servotwin.physics import Temperatures, magnet_factor, winding_resistance
from servotwin.physics.gear import output_torque
from servotwin.simulation.metrics import resolution
from servotwin.simulation.rest import rest_of
from servotwin.simulation.simulator import simulate
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.models.columns import Samples
    from servotwin.parameters import Servo, Supply
    from servotwin.signals import Signal
    from servotwin.simulation import Rest, Result


# --- The same servo at another supply voltage, or warm ----------------------------------------------------------------

_Model = TypeVar("_Model", bound="Model")
_MOST = 2.0  # times the highest voltage that the sheet prints
_ABOVE = 1.25  # times that, at which no servo is proposed whose range no sheet states; assumed
_BELOW = 0.9  # times the lowest: a servo for 12 V runs on three cells, which are called 11.1 V; assumed, likewise
_THERMAL = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient", "ambient",
            "magnet_coefficient")


def highest_voltage(servo: Servo) -> float:
    """Return the highest supply voltage of the sheet [V].

    The upper end of the range that the maker states; without one the highest voltage that figures are printed for, and
    without such figures that of the servo.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> highest_voltage(load_servo("gobilda-2000-135")), highest_voltage(load_servo("towerpro-mg996r"))
    (7.4, 7.2)
    """
    found = sheet_voltages(servo)
    return (servo.supply.open_circuit_voltage or 0.0) if found is None else found[1]


def is_above_sheet(servo: Servo, voltage: float) -> bool:
    """Tell whether a supply voltage [V] is so far above the highest of a sheet that the servo may not bear it.

    That is above the range that the maker states, or far above the figures of a sheet that states none.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [is_above_sheet(load_servo("gobilda-2000-135"), volts) for volts in (8.4, 12.0)]
    [False, True]
    >>> is_above_sheet(load_servo("towerpro-mg996r"), 7.4)
    True
    """
    most = highest_voltage(servo)
    return voltage > (most if operating_voltages(servo) else _ABOVE * most) > 0.0


def lowest_voltage(servo: Servo) -> float:
    """Return the lowest supply voltage of the sheet; 0 without one [V].

    The lower end of the range that the maker states, else the lowest voltage that figures are printed for. A bus
    servo's register Min_Voltage_Limit lies below that: there its alarm sets in, which is no promise that it works.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> lowest_voltage(load_servo("gobilda-2000-135")), lowest_voltage(load_servo("dynamixel-mx-28"))
    (4.8, 10.0)
    """
    found = sheet_voltages(servo)
    return 0.0 if found is None else found[0]


def is_below_sheet(servo: Servo, voltage: float) -> bool:
    """Tell whether a supply voltage [V] is so far below the lowest of a sheet that the servo may not work.

    That is below the range that the maker states, or far below the figures of a sheet that states none.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [is_below_sheet(load_servo("feetech-sts3215-12v"), volts) for volts in (11.1, 5.0)]
    [False, True]
    """
    least = lowest_voltage(servo)
    return 0.0 < voltage < (least if operating_voltages(servo) else _BELOW * least)


def check_voltage(servo: Servo, voltage: float) -> float:
    """Return a supply voltage [V] that may be asked for.

    Raises
    ------
    InputError
        If it is not positive, or more than twice what the sheet states.
    """
    most = _MOST * highest_voltage(servo)
    allowed = "a positive number [V]" + (f" up to {most:g}, twice the highest of the sheet" if most else "")
    if not (is_finite(voltage) and voltage > 0.0 and (not most or voltage <= most)):
        raise InputError(f"supply voltage of {servo.name}", got=voltage, allowed=allowed)
    return float(voltage)


def at_voltage(model: _Model, voltage: float) -> _Model:
    """Return the model at another supply voltage [V]; the gain of a mean bridge goes with the supply that it switches.

    Examples
    --------
    >>> import servotwin as st
    >>> at_voltage(st.PulseServo(st.load_servo("hitec-hs-755hb")), 4.8).servo.supply.open_circuit_voltage
    4.8
    """
    return changed(model, _voltage_values(model.servo, voltage))


def on_supply(servo: Servo, supply: Supply, *, source: str = SET_BY_USER) -> Servo:
    """Return a servo on another supply: its voltage, resistance and limit of current replace those of the servo.

    Raises
    ------
    InputError
        If the supply has no voltage, or one that is not for this servo.

    Examples
    --------
    >>> from servotwin.parameters import Supply, load_servo
    >>> on_supply(load_servo("hitec-hs-755hb"), Supply.of("usb")).supply.current_limit
    0.5
    """
    return servo.replace(supply_values(servo, supply), source=source)


def supply_values(servo: Servo, supply: Supply) -> dict[str, Any]:
    """Return the parameters of a servo that another supply changes, by dotted name."""
    if supply.open_circuit_voltage is None:
        raise InputError("open_circuit_voltage of a supply", allowed="a positive number [V]")
    return _voltage_values(servo, supply.open_circuit_voltage) | {
        f"supply.{name}": getattr(supply, name) for name in ("internal_resistance", "current_limit")}


def _voltage_values(servo: Servo, voltage: float) -> dict[str, Any]:
    check_voltage(servo, voltage)
    drop = servo.supply.bridge_drop_voltage or 0.0
    if voltage <= drop + (servo.motor.brush_drop_voltage or 0.0):
        raise InputError(f"{servo.name} does not turn at {voltage:g} V",
                         allowed="a supply that overcomes bridge, brushes and friction")
    values: dict[str, Any] = {"supply.open_circuit_voltage": voltage}
    gain, own = servo.electronics.bridge_gain, servo.supply.open_circuit_voltage
    if gain is not None and own is not None and own > drop:
        values["electronics.bridge_gain"] = gain * (voltage - drop) / (own - drop)
    return values


def at_temperatures(model: _Model, now: Temperatures, magnet_coefficient: float) -> _Model:
    """Return the model with a winding and a housing that keep these temperatures [K].

    Parameters
    ----------
    model : Model
    now : Temperatures
        Copper follows the winding, magnets the housing.
    magnet_coefficient : float
        [1/K].
    """
    servo = model.servo
    field = float(magnet_factor(now.housing, magnet_coefficient))
    values: dict[str, Any] = {f"thermal.{name}": None for name in _THERMAL if getattr(servo.thermal, name) is not None}
    values["motor.armature_resistance"] = float(winding_resistance(
        now.winding, model.value("motor.armature_resistance")))
    for name in ("motor.torque_constant", "motor.back_emf_constant"):
        values[name] = model.value(name) * field
    return changed(model, values)


def changed(model: _Model, values: dict[str, Any]) -> _Model:
    """Return the model with some parameters replaced; what it warns of it has said before."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return type(model)(model.servo.replace(values))


@contextlib.contextmanager
def warned_once() -> Iterator[None]:
    """Let each warning through once, however many runs give it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for message, category in dict.fromkeys((str(each.message), each.category) for each in caught):
        warnings.warn(message, category, stacklevel=4)


# --- Ranges of what rests on guesses: the same figure of the servo with its guesses at the ends of their --------------

# A guess is a parameter that is assumed within a range; what a person set is none. The servo is computed again with all
# that makes it give way more at the softer end, with all of it at the stiffer end, and with the lightest and the
# heaviest rotor; a figure's range goes from the least to the greatest of these and its own value.

# Which end of its range lets a servo give way more, or creep up less
_SOFTER = {
    "electronics.stretcher_gain": "lower", "electronics.bridge_gain": "lower",
    "electronics.minimum_drive_time": "lower", "electronics.deadband": "upper",
    "electronics.voltage_deadband": "upper", "firmware.proportional_gain": "lower",
    "firmware.deadband_angle": "upper", "firmware.minimum_duty": "lower"}
_OTHER_END = {"lower": "upper", "upper": "lower"}
_ROTOR = "motor.rotor_inertia"


class Span(NamedTuple):
    """From the least to the greatest that guesses make of a figure; inf where one of them makes it never.

    Parameters
    ----------
    lower, upper : float
    """

    lower: float
    upper: float


def guesses(model: Model, *, rotor: bool = False) -> tuple[str, ...]:
    """Return the dotted names of the guesses behind what a servo does when it stands; with its rotor, when it moves.

    Examples
    --------
    >>> import servotwin as st
    >>> guesses(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    ('electronics.stretcher_gain', 'electronics.minimum_drive_time')
    """
    read = {*model.requires, *model.optional}
    return tuple(name for name in (*_SOFTER, *((_ROTOR,) if rotor else ())) if name in read and _ends(model, name))


def variants(model: Model, *, rotor: bool = False) -> tuple[Model, ...]:
    """Return the servo at the ends of its guesses: the softer and the stiffer one, and those of its rotor.

    Parameters
    ----------
    model : Model
    rotor : bool
        Whether the rotor matters too, as in motion.
    """
    found = guesses(model, rotor=rotor)
    standing = [name for name in found if name != _ROTOR]
    changes = [{name: _ends(model, name)[_SOFTER[name] if soft else _OTHER_END[_SOFTER[name]]] for name in standing}
               for soft in (True, False)] if standing else []
    if _ROTOR in found:
        changes += [{_ROTOR: end} for end in _ends(model, _ROTOR).values()]
    return tuple(changed(model, dict(change)) for change in changes)


def spans(value: Mapping[str, float], others: Iterable[Mapping[str, float]]) -> dict[str, Span]:
    """Return the range of each figure that is a number and not the same for all.

    Parameters
    ----------
    value : mapping of str to float
        Of the servo as it is.
    others : iterable of mapping
        Of its variants; nan where one of them never gets there.

    Examples
    --------
    >>> spans({"a": 2.0, "b": 1.0}, [{"a": 1.0, "b": 1.0}, {"a": math.nan, "b": 1.0}])
    {'a': Span(lower=1.0, upper=inf)}
    """
    rest, found = list(others), {}
    for name, own in value.items():
        seen = [own, *(math.inf if math.isnan(other[name]) else other[name] for other in rest)]
        if not math.isnan(own) and min(seen) < max(seen):
            found[name] = Span(min(seen), max(seen))
    return found


def spanned(model: Model, figures: Callable[[Model], Mapping[str, float]], *, rotor: bool = False) -> dict[str, Span]:
    """Return the ranges of the figures that a function computes of a model."""
    return spans(figures(model), map(figures, variants(model, rotor=rotor)))


def _ends(model: Model, name: str) -> dict[str, float]:
    """Return the ends of the range of a guess; empty where it is none."""
    if model.servo.get(name) is None:
        return {}
    known = model.servo.source(name)
    if known.origin != "assumed" or known.was_set or known.lower is None or known.upper is None \
            or not known.lower < known.upper:
        return {}
    return {"lower": known.lower, "upper": known.upper}


# --- Why a servo buzzes: how it drives at rest, and which single number would stop that -------------------------------

_STEP = math.radians(10.0)
_AT, _DURATION = 0.1, 3.0  # s
_DOUBLINGS, _HALVINGS = 12, 3
_FIRST = 1.0 / 64.0  # of the servo's own friction, with which the search begins
_WIDEST = math.radians(10.0)  # of a deadband, half width


class Remedy(NamedTuple):
    """A number that would bring a servo to rest, all others as they are.

    Parameters
    ----------
    name : str
        Of the parameter; "load.coulomb_torque" is friction at the output shaft, beside that of the servo.
    now, needed : float
        As it is, and the least change of it that was found to do, within 9 % (SI).
    """

    name: str
    now: float
    needed: float


@dataclass(frozen=True, kw_only=True)
class Buzz:
    """How a servo drives at rest.

    Parameters
    ----------
    rest : Rest, optional
        None where command or load do not stand still for half a second.
    remedies : tuple of Remedy
        Deadband, friction and gain, each that does; empty where the servo is quiet.
    """

    rest: Rest | None
    remedies: tuple[Remedy, ...]


def buzz(model: Model, load: Load | Part | None = None, command: Signal | None = None, *,
         duration: float = _DURATION) -> Buzz:
    """Return how often and with what current a servo drives at rest, and which number would stop it.

    The remedy is found by simulation: a number is changed by factors of two until the servo is quiet, and then
    bisected.

    Parameters
    ----------
    model : PulseServo, PulseServoInductive, BoundedServo or DigitalServo
    load : Load, optional
        Nothing unless given.
    command : Signal, optional
        A step of 10° to the middle of the travel unless given.
    duration : float
        Of the run [s].

    Raises
    ------
    InputError
        If the model is another, or turns without end.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb").replace(
    ...     {"electronics.stretcher_gain": 1000.0, "electronics.off_state": "coast"})
    >>> found = buzz(st.PulseServo(servo))
    >>> found.rest.swing > 0.0, found.remedies[0].name
    (True, 'electronics.deadband')
    """
    if not isinstance(model, PulseServo | PulseServoInductive | BoundedServo | DigitalServo) or model.endless:
        raise InputError("model that may buzz", got=model, allowed="a servo that holds an angle behind a bridge")
    middle = mid_travel(model)
    told = command or signals.step(middle - _STEP, middle, at=_AT, unit="rad")
    hung = as_load(load)

    def run(one: Model, friction: float = 0.0) -> Result:
        return simulate(one, told, duration=duration, load=hung + Coulomb(friction), output_times=[duration])

    def rest(one: Model, friction: float = 0.0) -> Rest | None:
        return rest_of(run(one, friction), with_current=False)

    found = run(model).rest
    if found is None or not found.restless:
        return Buzz(rest=found, remedies=())
    return Buzz(rest=found, remedies=tuple(remedy for remedy in (
        _deadband(model, rest), _friction(model, rest), _gain(model, rest)) if remedy is not None))


def _deadband(model: Model, rest: Callable[..., Rest | None]) -> Remedy | None:
    name = ("firmware.deadband_angle" if isinstance(model, DigitalServo) else "electronics.voltage_deadband" if
            isinstance(model, BoundedServo) else "electronics.deadband")
    now, finest = model.value_or(name, 0.0), float(resolution(model))
    if isinstance(model, DigitalServo):
        now = float(model.firmware().h)
        first, most = max(now, 0.5 * finest), _WIDEST
    elif now > 0.0:
        first, most = now, now * _WIDEST / (0.5 * finest)
    else:
        return None
    return _remedy(name, now, first, most, lambda value: rest(changed(model, {name: value})))


def _friction(model: Model, rest: Callable[..., Rest | None]) -> Remedy | None:
    own = float(output_torque(model.value("friction.coulomb_torque_forward"), model.value("gear.gear_reduction")))
    if not own > 0.0:
        return None

    def quiet(value: float) -> bool:
        return _quiet(rest(model, value))

    first = _FIRST * own
    for _ in range(_DOUBLINGS if quiet(first) else 0):
        if not quiet(0.5 * first):
            return _remedy("load.coulomb_torque", 0.0, 0.5 * first, first, lambda value: rest(model, value))
        first *= 0.5
    return _remedy("load.coulomb_torque", 0.0, first, own, lambda value: rest(model, value))


def _gain(model: Model, rest: Callable[..., Rest | None]) -> Remedy | None:
    name = ("firmware.proportional_gain" if isinstance(model, DigitalServo) else "electronics.bridge_gain" if
            isinstance(model, BoundedServo) else "electronics.stretcher_gain")
    now = model.value(name)
    found = _remedy(name, now, 1.0, 2.0**_DOUBLINGS, lambda factor: rest(changed(model, {name: now / factor})))
    return None if found is None else found._replace(needed=now / found.needed)


def _quiet(found: Rest | None) -> bool:
    return found is not None and not found.restless and not found.moves_on


def _remedy(name: str, now: float, first: float, most: float, at: Callable[[float], Rest | None]) -> Remedy | None:
    """Return the least value beyond `first`, which does not do, and up to `most`, at which a servo is quiet."""
    low, high = first, 2.0 * first
    while not _quiet(at(high)):
        low, high = high, 2.0 * high
        if low >= most:
            return None
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if _quiet(at(middle)) else (middle, high)
    return Remedy(name, now, high)


# --- A servo that stands ----------------------------------------------------------------------------------------------

SETTLE, LOOK = 1.5, 0.5  # s: what is stated of standing holds for the mean of the last half second of two, or more
_STANDS = math.radians(2.0)  # rad/s: what goes faster at the end does not stand
_FURTHEST_STEP = math.radians(20.0)
_WAIT, _MEAN = 1.0, 0.1  # s, after which a command has been followed or not, and over which the angle is averaged
_FOLLOWED = 0.5  # of the command
_HOLDING_HALVINGS = 18
_SOON = 0.2  # s, in which a command either moves the shaft or does not
_STIRRED = 1e-9  # rad
_TRIPS = "trips by "  # begins the events of a protection


class Held(NamedTuple):
    """A servo under a constant torque, 1.5 to 2 s after that was put on, or longer by what a protection waits.

    Parameters
    ----------
    torque : float
        Towards −q [N m].
    error : float
        Commanded less mean angle; nan where the shaft does not stand [rad].
    current : float
        Mean of the supply [A].
    heat : float
        Mean of i² R in the winding [W].
    trip : str
        Protection by which a digital servo trips under it, "overload" or "current"; empty where it does not.
    span : Span, optional
        Range of `error`, where it rests on guesses; computed by `with_spans`.
    """

    torque: float
    error: float
    current: float
    heat: float
    trip: str = ""
    span: Span | None = None

    @property
    def stands(self) -> bool:
        """Whether the shaft stands at the end, or all but stands."""
        return not math.isnan(self.error)


def hold(model: Model, torque: float, *, inertia: float = 0.0) -> Held:
    """Return how a servo holds a constant torque [N m] in mid-travel; `inertia` is the load's [kg m²]."""
    asked, settle = mid_travel(model), SETTLE + _patience(model)
    end = settle + LOOK
    result = simulate(_without_stops(model), signals.constant(asked, unit="rad"), duration=end,
                      load=loads.Constant(torque) + loads.Inertia(inertia), output_times=[settle, end])
    trip = next((event.kind.removeprefix(_TRIPS) for event in result.events if event.kind.startswith(_TRIPS)), "")
    before, after = result["output_angle"].tolist()
    if trip or not (result.status.ok and abs(after - before) <= _STANDS * LOOK):
        return Held(torque, math.nan, math.nan, math.nan, trip)
    angle, current, heat = _means(result, settle)
    return Held(torque, asked - angle, current, heat)


def _patience(model: Model) -> float:
    """Return for how long [s] a protection of a digital servo waits before it acts."""
    if not isinstance(model, DigitalServo):
        return 0.0
    of = model.servo.firmware
    waits = [time for threshold, time in ((of.overload_duty, of.overload_time), (of.trip_current, of.trip_time))
             if threshold is not None and time is not None]
    return max(waits, default=0.0)


def holding_errors(model: Model, stall_torque: float, shares: tuple[float, ...] = (0.1, 0.25, 0.5, 0.75, 0.9)
                   ) -> tuple[Held, ...]:
    """Return how a servo holds shares of its stall torque [N m]."""
    return tuple(hold(model, share * stall_torque) for share in shares)


def with_spans(held: Sequence[Held], others: Sequence[Model], *, inertia: float = 0.0) -> tuple[Held, ...]:
    """Return how a servo holds some torques with the ranges of its errors.

    Parameters
    ----------
    held : sequence of Held
    others : sequence of Model
        The servo with its guesses at the ends of their ranges.
    inertia : float
        Of the load [kg m²].
    """
    found = spans({str(k): each.error for k, each in enumerate(held)}, (
        {str(k): hold(other, each.torque, inertia=inertia).error for k, each in enumerate(held)} for other in others))
    return tuple(each._replace(span=found.get(str(k))) for k, each in enumerate(held))


def smallest_move(model: Model) -> float:
    """Return the smallest step that the free shaft follows to half, from where there is no error [rad].

    It has a second for that. The potentiometer's noise is left out: with it every command moves a little now and then.
    """
    return _least_step(model, _follows)


def smallest_stir(model: Model) -> float:
    """Return the smallest step that moves the free shaft at all: half of the deadband, and what friction adds [rad]."""
    return _least_step(model, _stirs)


def _least_step(model: Model, does: Callable[[Model, float, float], bool]) -> float:
    free, start = _without_stops(model), mid_travel(model)
    low, high = 0.0, _FURTHEST_STEP
    if not does(free, start, high):
        return math.nan
    for _ in range(_HOLDING_HALVINGS):
        half = 0.5 * (low + high)
        low, high = (low, half) if does(free, start, half) else (half, high)
    return high


def _stirs(model: Model, start: float, step: float) -> bool:
    result = simulate(model, signals.step(start, start + step, at=0.0, unit="rad"), duration=_SOON,
                      output_times=[0.0, _SOON])
    before, after = result["output_angle"].tolist()
    return bool(abs(after - before) > _STIRRED)


def _follows(model: Model, start: float, step: float) -> bool:
    result = simulate(model, signals.step(start, start + step, at=0.0, unit="rad"), duration=_WAIT,
                      output_times=np.append(0.0, np.linspace(_WAIT - _MEAN, _WAIT, 11)))
    before, *after = result["output_angle"].tolist()
    return bool(float(np.mean(after)) - before >= _FOLLOWED * step)


def _without_stops(model: Model) -> Model:
    """Return the model without stops, which would hold what the servo does not, and without noise."""
    gone = ("stops.lower_angle", "stops.upper_angle", "potentiometer.noise")
    return changed(model, {name: None for name in gone if model.servo.get(name) is not None})


def _means(result: Result, start: float) -> tuple[float, float, float]:
    """Return the means of angle [rad], supply current [A] and heat of the winding [W] from `start` [s] on."""
    model, drive, load = result.model, result.drive, result.load
    drawn = "supply_current" if "supply_current" in model.available else "armature_current"

    def looked_at(samples: Samples) -> NDArray[np.float64]:
        i = model.output("armature_current", samples, drive, load)
        return np.array([samples.angle, model.output(drawn, samples, drive, load),
                         physics.copper_loss(i, warm_plant(model, samples, load).motor.R)])

    angle, current, heat = (result.trajectory.since(start).integral(looked_at) / (result.ended - start)).tolist()
    return angle, current, heat
