"""Which servo: what each of some does with a task and within limits, and every reason why one does not suit."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.holding import (
    Span,
    at_voltage,
    buzz,
    changed,
    highest_voltage,
    is_above_sheet,
    is_below_sheet,
    lowest_voltage,
    smallest_move,
    spans,
    supply_values,
    variants,
)
from servotwin.datasheet.sheet import spanned_lift
from servotwin.datasheet.warming import Lift, check_lift, swing_up
from servotwin.errors import InputError
from servotwin.models import DigitalServo, default_model
from servotwin.parameters import catalog_names, load_servo, printed_fact, printed_flags
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Mapping

    from servotwin.models import Model
    from servotwin.parameters import Servo, Supply
    from servotwin.simulation import Rest


# --- Which servo: what each of some does with a task and within limits, and every reason why one does not -------------

class Reason(NamedTuple):
    """Why a servo does not suit: what it is about, such as "torque" or "mass", and one phrase."""

    kind: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The limits of a servo; None where that does not matter.

    Parameters
    ----------
    current : float, optional
        The most that it draws, where it starts or is blocked [A].
    mass : float, optional
        [kg]
    voltage : float, optional
        That its sheet has to reach [V].
    travel : float, optional
        At least [rad].
    time : float, optional
        The longest for 60°: with a lift from 30° below the horizontal to 30° above, else without load [s].
    kind : str, optional
        "analog", "digital" or "bus".
    price : float, optional
        At most, in the currency of the prices.
    """

    current: float | None = None
    mass: float | None = None
    voltage: float | None = None
    travel: float | None = None
    time: float | None = None
    kind: str | None = None
    price: float | None = None


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A servo, what it can do on its supply, and what speaks against it.

    Parameters
    ----------
    servo : Servo
    model : Model, optional
        On the supply; None where that is not for this servo.
    mass, price, travel : float
        nan where it is not known [kg, of the prices, rad].
    most_torque : float
        The most that it lifts from rest [N m].
    margin : float
        That over the torque of the lift; nan without one.
    time : float
        For 60°, as of `Limits` [s].
    stall_current : float
        [A]
    reasons : tuple of Reason
        Why it does not suit; empty where it does.
    notes : tuple of str
        Notes to read before buying.
    """

    servo: Servo
    model: Model | None = None
    mass: float = math.nan
    price: float = math.nan
    travel: float = math.nan
    most_torque: float = math.nan
    margin: float = math.nan
    time: float = math.nan
    stall_current: float = math.nan
    reasons: tuple[Reason, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def suits(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reasons


@dataclass(frozen=True, kw_only=True)
class AtRest:
    """The simulated figures of a candidate.

    Parameters
    ----------
    smallest_move : float
        The smallest step that the free shaft follows to half [rad].
    move_span : Span, optional
        Its range, where it rests on guesses and that was asked for.
    rest : Rest, optional
        How it drives at rest without a load.
    lift : Lift, optional
        Droop and heat with the mass of the lift.
    """

    smallest_move: float
    move_span: Span | None
    rest: Rest | None
    lift: Lift | None


def travel_of(servo: Servo) -> float:
    """Return the travel of a servo: that of its sheet, else of its goals or stops; nan where it has none [rad].

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [round(math.degrees(travel_of(load_servo(name)))) for name in ("towerpro-mg996r", "towerpro-sg90")]
    [120, 200]
    """
    printed = printed_fact(servo.sheet, "travel")
    if printed is not None:
        return printed
    for low, high in ((servo.firmware.lower_goal, servo.firmware.upper_goal),
                      (servo.stops.lower_angle, servo.stops.upper_angle)):
        if low is not None and high is not None:
            return high - low
    return math.nan


def candidate(servo: Servo, supply: Supply | float, *, lift: tuple[float, float] | None = None,
              limits: Limits | None = None, price: float = math.nan) -> Candidate:
    """Return a servo beside a lift and limits, with every reason why it does not suit.

    Parameters
    ----------
    servo : Servo
    supply : Supply or float
        A number is the voltage of its own supply [V].
    lift : tuple of float, optional
        Mass [kg] and arm [m].
    limits : Limits, optional
    price : float

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> found = candidate(load_servo("towerpro-sg90"), 5.0, lift=(0.5, 0.1), limits=Limits(kind="digital"))
    >>> [reason.kind for reason in found.reasons]
    ['torque', 'kind']
    """
    limits = Limits() if limits is None else limits
    volts = float(supply if isinstance(supply, int | float) else supply.open_circuit_voltage or 0.0)
    mass, most = printed_fact(servo.sheet, "mass"), highest_voltage(servo)
    known = {"servo": servo, "mass": math.nan if mass is None else mass, "price": price, "travel": travel_of(servo)}
    if is_above_sheet(servo, volts):
        return _judged(known, [Reason("voltage", f"its sheet ends at {most:g} V")], limits)
    if is_below_sheet(servo, volts):
        return _judged(known, [Reason("voltage", f"its sheet begins at {lowest_voltage(servo):g} V")], limits)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # said in the notes
            drive = FullDrive(_supplied(default_model(servo), supply))
    except InputError as error:
        return _judged(known, [Reason("voltage", str(error))], limits)
    capable = min(drive.stall_torque, drive.starting_torque)
    speed = drive.no_load_speed
    time, reasons = math.pi / 3.0 / speed if speed > 0.0 else math.nan, []
    if drive.model.endless:
        reasons.append(Reason("travel", "turns without end and holds no angle"))
    elif lift is not None:
        torque = check_lift(*lift)
        known["margin"] = capable / torque
        time = swing_up(drive, *lift).time if capable > torque else math.nan
        if capable <= torque:
            reasons.append(Reason("torque", f"lifts {capable:.3g} N m of {torque:.3g}"))
        elif math.isnan(time):
            reasons.append(Reason("time", "creeps"))
    known |= {"model": drive.model, "most_torque": capable, "time": time, "stall_current": drive.stall_current}
    return _judged(known, reasons, limits, notes_of(drive.model, volts))


def _supplied(model: Model, supply: Supply | float) -> Model:
    if isinstance(supply, int | float):
        return at_voltage(model, float(supply))
    return changed(model, supply_values(model.servo, supply))


def _judged(known: Mapping[str, object], reasons: list[Reason], limits: Limits,
            notes: tuple[str, ...] = ()) -> Candidate:
    made = Candidate(**known, notes=notes)  # type: ignore[arg-type]
    return Candidate(**known, notes=notes, reasons=(*reasons, *_broken(made, limits)))  # type: ignore[arg-type]


def _broken(made: Candidate, limits: Limits) -> list[Reason]:
    """Return the limits that a candidate does not keep; what is not known keeps none."""
    found, most = [], highest_voltage(made.servo)
    if limits.time is not None and made.time > limits.time:
        found.append(Reason("time", f"takes {made.time:.2f} s"))
    if limits.current is not None and made.stall_current > limits.current:
        found.append(Reason("current", f"draws {made.stall_current:.2f} A where it starts or is blocked"))
    if limits.mass is not None and not made.mass <= limits.mass:
        found.append(Reason("mass", _or_unknown("weighs", 1e3 * made.mass, "g", "mass")))
    if limits.voltage is not None and not most >= limits.voltage:
        found.append(Reason("voltage", f"its sheet ends at {most:g} V"))
    if limits.travel is not None and not made.travel >= limits.travel - 1e-9:
        found.append(Reason("travel", _or_unknown("travels", math.degrees(made.travel), "deg", "travel")))
    if limits.kind is not None and made.servo.kind != limits.kind:
        found.append(Reason("kind", f"is {made.servo.kind}"))
    if limits.price is not None and not made.price <= limits.price:
        found.append(Reason("price", _or_unknown("costs", made.price, "", "price")))
    return found


def _or_unknown(verb: str, value: float, unit: str, what: str) -> str:
    return f"its {what} is not known" if math.isnan(value) else f"{verb} {value:.4g} {unit}".rstrip()


def notes_of(model: Model, voltage: float) -> tuple[str, ...]:
    """Return the notes on a servo on a supply [V] to read before buying."""
    servo = model.servo
    most = highest_voltage(servo)
    notes = [f"its sheet ends at {most:g} V"] if 0.0 < most < voltage else []
    if servo.kind != "analog":
        notes.append(servo.kind if isinstance(model, DigitalServo) else f"{servo.kind}, computed as analog")
    flags = printed_flags(servo)
    notes += ["impossible sheet"] if any(flag.startswith("impossible") for flag in flags) else []
    notes += ["sources disagree"] if any(flag.startswith("sources disagree") for flag in flags) else []
    return tuple(notes)


def standing_of(model: Model, lift: tuple[float, float] | None = None, *, ranges: bool = False) -> AtRest:
    """Return what a candidate does where it stands; with ranges of what rests on guesses it takes three times as long.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> found = standing_of(candidate(load_servo("gobilda-2000-135"), 6.0).model, (0.3, 0.1))
    >>> round(math.degrees(found.smallest_move), 1), round(math.degrees(found.lift.held.error), 1)
    (0.9, 6.8)
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        others = variants(model) if ranges else ()
        step = smallest_move(model)
        moves = spans({"": step}, ({"": smallest_move(other)} for other in others))
        return AtRest(smallest_move=step, move_span=moves.get(""), rest=buzz(model).rest,
                        lift=None if lift is None else spanned_lift(model, *lift, others))


# --- Which servos lift a mass: those of the catalog that do, lightest first, and why the others do not ----------------

@dataclass(frozen=True, kw_only=True)
class Lifter:
    """A servo that lifts the mass.

    Parameters
    ----------
    servo : Servo
    mass : float
        Of the servo, as its sheet prints it; nan where it does not [kg].
    most_torque : float
        The most that it lifts [N m].
    margin : float
        That torque over the one that is asked for.
    time : float
        From 30° below the horizontal to 30° above, from rest [s].
    notes : tuple of str
        Notes to read before buying.
    """

    servo: Servo
    mass: float
    most_torque: float
    margin: float
    time: float
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Refused:
    """A servo that does not lift the mass, or not in time; `kind` is "voltage", "torque" or "time"."""

    servo: Servo
    kind: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Lifters:
    """Which servos lift a mass: those that do, lightest first and unknown masses last, and those that do not."""

    torque: float
    voltage: float
    found: tuple[Lifter, ...]
    refused: tuple[Refused, ...]


def servos_that_lift(mass: float, arm: float, *, voltage: float, time: float | None = None,
                     servos: Iterable[Servo] | None = None) -> Lifters:
    """Return the servos that lift a mass on an arm at all angles, lightest first.

    Parameters
    ----------
    mass, arm : float
        Of the point mass [kg], and its distance from the shaft [m].
    voltage : float
        Of the supply [V].
    time : float, optional
        The longest that 60° may take, from 30° below the horizontal to 30° above, from rest [s].
    servos : iterable of Servo, optional
        Those of the catalog unless given.

    Returns
    -------
    Lifters

    Raises
    ------
    InputError
        If a number is not positive.

    Examples
    --------
    >>> import servotwin as st
    >>> found = st.servos_that_lift(0.02, 0.05, voltage=5.0).found
    >>> found[0].servo.name, round(found[0].margin)
    ('hitec-hs-55', 11)
    """
    torque = check_lift(mass, arm)
    for name, value, unit in (("voltage", voltage, "V"), ("time", time, "s")):
        if value is not None and not (is_finite(value) and value > 0.0):
            raise InputError(name, got=value, allowed=f"a positive number [{unit}]")
    among = [load_servo(name) for name in catalog_names()] if servos is None else list(servos)
    judged = [_lifted(servo, mass, arm, voltage, time) for servo in among]
    found = [each for each in judged if isinstance(each, Lifter)]
    order = sorted(found, key=lambda each: (math.isnan(each.mass), each.mass, -each.margin, each.servo.name))
    return Lifters(torque=torque, voltage=voltage, found=tuple(order),
                   refused=tuple(each for each in judged if isinstance(each, Refused)))


def _lifted(servo: Servo, mass: float, arm: float, voltage: float, time: float | None) -> Lifter | Refused:
    found = candidate(servo, voltage, lift=(mass, arm), limits=Limits(time=time))
    if found.reasons:
        return Refused(servo=servo, kind=found.reasons[0].kind, reason=found.reasons[0].text)
    return Lifter(servo=servo, mass=found.mass, most_torque=found.most_torque, margin=found.margin, time=found.time,
                  notes=found.notes)
