"""The table of causes: which numbers each is made of, what is usual of them, and how far they are taken away."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import ServotwinError
from servotwin.models import BoundedServo, DigitalServo
from servotwin.parameters import printed_fact, printed_points
from servotwin.physics.gear import output_torque
from servotwin.simulation.metrics import resolution

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.loads import Load
    from servotwin.models import Model


# --- A cause: one number of a servo or its load, and how it is taken away ---------------------------------------------

_LEAST = 1e-3  # of its end, from which a number of 0 goes there


class Patient(NamedTuple):
    """A servo and its load, and what is usual is measured by.

    Parameters
    ----------
    model : Model
    load : Load
    voltages : tuple of float
        Lowest and highest of the sheet; the servo's own without one [V].
    resistance : float
        Of the winding [ohm].
    stall_torque, stall_current : float
        At the sheet's highest voltage, from a source that gives all [N m], [A].
    rotor : float
        Inertia of the rotor at the output [kg m²].
    own_frames : bool
        Whether frames come as the servo's file says, and not as the command does.
    """

    model: Model
    load: Load
    voltages: tuple[float, float]
    resistance: float
    stall_torque: float
    stall_current: float
    rotor: float
    own_frames: bool = True


class Usual(NamedTuple):
    """Between which values a number usually lies (SI), and where that is from."""

    low: float
    high: float
    source: str


class Number(NamedTuple):
    """One row of the table of causes.

    Parameters
    ----------
    cause : str
        Such as "deadband".
    name : str
        Dotted, such as "electronics.deadband".
    rises : bool
        Whether it is taken away upwards.
    now : callable
        Returns the number of a patient; None where there is none.
    usual : callable
        Returns what is usual.
    end : callable
        Returns how far it is taken.
    put : callable
        Returns the patient with another value.
    cure : str
        With a place for the needed value, such as "widen to {}".
    unit : str
    factor : float
        From SI to the unit.
    """

    cause: str
    name: str
    rises: bool
    now: Callable[[Patient], float | None]
    usual: Callable[[Patient], Usual]
    end: Callable[[Patient], float]
    put: Callable[[Patient, float], Patient]
    cure: str
    unit: str = ""
    factor: float = 1.0

    def stops(self, patient: Patient) -> tuple[float, ...]:
        """Return the values to which it is taken: into what is usual, and to its end; none where it is there."""
        now = self.now(patient)
        if now is None:
            return ()
        usual, end = self.usual(patient), self.end(patient)
        near = usual.low if self.rises else usual.high
        wanted = dict.fromkeys((near, end))
        return tuple(value for value in wanted if (value > now if self.rises else value < now))

    def oddness(self, patient: Patient) -> float:
        """Return how far the number is from what is usual, in its direction: the logarithm of their ratio, or 0."""
        now, usual = self.now(patient), self.usual(patient)
        if now is None or (now == 0.0 and not self.name.startswith("supply")):
            return 0.0  # it is off
        if self.rises:
            return max(0.0, math.log(usual.low / now)) if now > 0.0 and usual.low > 0.0 else 0.0
        return max(0.0, math.log(now / usual.high)) if usual.high > 0.0 else (math.inf if now > 0.0 else 0.0)

    def between(self, now: float, end: float, share: float) -> float:
        """Return the value that is a share of the way from one to the other."""
        if now < 0.0 or end <= 0.0:
            return now + share * (end - now)
        start = max(now, _LEAST * end)
        return float(start * (end / start)**share)


def patient_of(model: Model, load: Load, *, own_frames: bool = True) -> Patient:
    """Return a servo and its load with what is usual is measured by."""
    own = float(model.value("supply.open_circuit_voltage"))
    printed = [point.supply_voltage for point in printed_points(model.servo) if point.supply_voltage]
    low, high = min(printed, default=own), max(printed, default=own)
    resistance = model.value("motor.armature_resistance")
    current = max(high - model.value_or("supply.bridge_drop_voltage", 0.0)
                  - model.value_or("motor.brush_drop_voltage", 0.0), 0.1 * high) / resistance
    reduction = model.value("gear.gear_reduction")
    return Patient(
        model=model, load=load, voltages=(low, high), resistance=resistance,
        stall_torque=float(output_torque(model.value("motor.torque_constant") * current, reduction)),
        stall_current=current, rotor=model.value("motor.rotor_inertia") * reduction**2, own_frames=own_frames)


def with_values(patient: Patient, values: dict[str, float | None]) -> Patient:
    """Return a patient with other parameters of the servo."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return patient._replace(model=type(patient.model)(patient.model.servo.replace(values)))


def parameter(cause: str, name: str, cure: str, *, rises: bool, usual: Callable[[Patient], Usual],
              end: Callable[[Patient], float] | None = None, unit: str = "", factor: float = 1.0) -> Number:
    """Return the row of one parameter; it ends at the far end of what is usual unless said otherwise."""
    def now(patient: Patient) -> float | None:
        if name.startswith("electronics.frame") and not patient.own_frames:
            return None
        reads = (*patient.model.requires, *patient.model.optional)
        value = patient.model.value_or(name, math.nan) if name in reads else math.nan
        return None if math.isnan(value) else float(value)

    def far(patient: Patient) -> float:
        return usual(patient).high if rises else usual(patient).low

    def put(patient: Patient, value: float) -> Patient:
        return with_values(patient, {name: value})

    return Number(cause, name, rises, now, usual, end or far, put, cure, unit, factor)


def zone_name(model: Model) -> str:
    """Return the parameter that is the deadband of a model."""
    return ("firmware.deadband_angle" if isinstance(model, DigitalServo) else "electronics.voltage_deadband"
            if isinstance(model, BoundedServo) else "electronics.deadband")


def friction_now(patient: Patient) -> float:
    """Return the Coulomb torque of motor and gear at the output, the larger of both ways [N m]."""
    model = patient.model
    most = max(model.value_or("friction.coulomb_torque_forward", 0.0),
               model.value_or("friction.coulomb_torque_backward", 0.0))
    return float(output_torque(most, model.value("gear.gear_reduction")))


def with_friction(patient: Patient, value: float) -> Patient:
    """Return a patient with another Coulomb torque of motor and gear [N m]."""
    by = value / friction_now(patient)
    return with_values(patient, {name: by * patient.model.value_or(name, 0.0) for name in (
        "friction.coulomb_torque_forward", "friction.coulomb_torque_backward")})


def with_load(patient: Patient, **values: Any) -> Patient:
    """Return a patient with other numbers of its load."""
    return patient._replace(load=replace(patient.load, **values))


def gravity(load: Load) -> float:
    """Return the most torque of all pendulums together [N m]."""
    return float(sum(each.gravity_torque for each in load.pendulums))


def with_gravity(patient: Patient, value: float) -> Patient:
    """Return a patient whose pendulums are lighter, so that they pull with so much [N m]."""
    load = patient.load
    by = value / gravity(load)
    lighter = tuple(replace(each, mass=each.mass * by, inertia=None if each.inertia is None else each.inertia * by)
                    for each in load.pendulums) if by > 0.0 else ()
    return patient._replace(load=replace(load, pendulums=lighter))


# --- The table of causes ----------------------------------------------------------------------------------------------

_DEG, _US, _MS, _MNM = math.degrees(1.0), 1e6, 1e3, 1e3
_ANALOG_ZONE, _DIGITAL_ZONE = (4e-6, 10e-6), (1e-6, 4e-6)  # s, full width
_ASSUMED = "assumed"
_CATALOG = "as the catalog assumes of a servo without a printed one"


def _zone_usual(patient: Patient) -> Usual:
    model = patient.model
    if isinstance(model, DigitalServo) and model.takes_goals:
        quantum = float(model.firmware().quantum)
        return Usual(quantum, 4.0 * quantum, "one to four counts, assumed")
    width = _DIGITAL_ZONE if isinstance(model, DigitalServo) else _ANALOG_ZONE
    printed = printed_fact(model.servo.sheet, "deadband")
    low, high = (width if printed is None else (min(width[0], printed), max(width[1], printed)))
    by = _per_width(patient)
    return Usual(by * low, by * high, "the sheet, and what is usual of its kind" if printed else _CATALOG)


def _per_width(patient: Patient) -> float:
    """Return what a second of pulse width is in the unit of the model's deadband."""
    model = patient.model
    slope = model.value_or("electronics.one_shot_slope", 1.0)
    if isinstance(model, BoundedServo):
        return 1.0 / slope
    if isinstance(model, DigitalServo):
        return 0.5 / (slope * model.value_or("potentiometer.feedback_gain", 1.0))
    return 1.0


def _zone_now(patient: Patient) -> float | None:
    model = patient.model
    if isinstance(model, DigitalServo):
        return float(model.firmware().h)
    return float(model.value_or(zone_name(model), 0.0))


def finest_of(patient: Patient) -> float:
    """Return what a servo need not tell apart: its count, or its deadband, that of none wider than usual [rad].

    An effect of a wide deadband alone is a symptom.
    """
    own, usual = float(resolution(patient.model)), _zone_usual(patient).high
    if (_zone_now(patient) or 0.0) <= usual:
        return own
    return min(own, float(resolution(_put_zone(patient, usual).model)))


def _put_zone(patient: Patient, value: float) -> Patient:
    return with_values(patient, {zone_name(patient.model): value})


def _zone(*, rises: bool) -> tuple[Number, ...]:
    def row(kind: Callable[[Patient], bool], unit: str, factor: float) -> Number:
        return Number(
            "deadband", "deadband", rises, lambda patient: _zone_now(patient) if kind(patient) else None, _zone_usual,
            lambda patient: _zone_usual(patient).high if rises else _zone_usual(patient).low, _put_zone,
            "widen it to {}" if rises else "narrow it to {}", unit, factor)

    return (row(lambda patient: isinstance(patient.model, DigitalServo), "deg either way", _DEG),
            row(lambda patient: isinstance(patient.model, BoundedServo), "mV", 1e3),
            row(lambda patient: not isinstance(patient.model, DigitalServo | BoundedServo), "us", _US))


def _digital_gain(patient: Patient) -> Usual:
    model = patient.model
    if isinstance(model, DigitalServo) and model.takes_goals:
        return Usual(1.1, 5.3, "the factory's registers, from an XL330 to an STS3215")
    return Usual(3.0, 20.0, _CATALOG)


def _bridge_gain(patient: Patient) -> Usual:
    now = patient.model.value("electronics.bridge_gain")
    return Usual(now / 3.0, now * 3.0, "a third to three times as it is")


def _fixed(low: float, high: float, source: str = _CATALOG) -> Callable[[Patient], Usual]:
    return lambda patient: Usual(low, high, source)


def _stall_share(low: float, high: float, source: str) -> Callable[[Patient], Usual]:
    return lambda patient: Usual(low * patient.stall_torque, high * patient.stall_torque, source)


def _current(low: float, source: str) -> Callable[[Patient], Usual]:
    return lambda patient: Usual(low * patient.stall_current, 1.2 * patient.stall_current, source)


def _zero(patient: Patient) -> float:
    return 0.0


def _gains() -> tuple[Number, ...]:
    rows = []
    for name, usual, unit in (("electronics.stretcher_gain", _fixed(60.0, 200.0), ""),
                              ("electronics.bridge_gain", _bridge_gain, ""),
                              ("firmware.proportional_gain", _digital_gain, "1/rad")):
        rows += [parameter("gain", name, "lower it to {}", rises=False, usual=usual, unit=unit),
                 parameter("gain", name, "raise it to {}", rises=True, usual=usual, unit=unit)]
    return (*rows, parameter("gain", "firmware.integral_gain", "lower the integral's to {}", rises=False,
                             usual=_fixed(0.0, 10.0, _ASSUMED), unit="1/(rad s)"))


def _frames() -> tuple[Number, ...]:
    frame, tick = _fixed(10e-3, 20e-3), _fixed(0.3e-3, 3e-3)
    return (
        parameter("frame rate", "electronics.frame_period", "send pulses every {}", rises=False, usual=frame,
                  unit="ms", factor=_MS),
        parameter("frame rate", "electronics.frame_period", "send pulses every {} only", rises=True, usual=frame,
                  unit="ms", factor=_MS),
        parameter("frame rate", "firmware.control_period", "a tick of {}", rises=False, usual=tick, unit="ms",
                  factor=_MS),
        parameter("frame rate", "firmware.compute_delay", "a delay of {}", rises=False, usual=_fixed(0.0, 1e-3),
                  unit="ms", factor=_MS))


def _plays() -> tuple[Number, ...]:
    usual = _fixed(0.0, math.radians(1.0), "about 1 deg, as of an STS3215")
    return tuple(parameter("play", name, text, rises=False, usual=usual, end=_zero, unit="deg", factor=_DEG)
                 for name, text in (("gear.backlash", "at most {} in the gear"),
                                    ("potentiometer.backlash", "at most {} before the potentiometer")))


def _frictions() -> tuple[Number, ...]:
    def usual(patient: Patient) -> Usual:
        low, high = (0.005, 0.1) if patient.model.servo.sheet.get("registers") == "dynamixel-x" else (0.04, 0.3)
        return _stall_share(low, high, f"{100.0 * low:g} to {100.0 * high:g} % of the stall torque, as the catalog "
                            "assumes")(patient)

    rubs = _stall_share(0.0, 0.1, "a tenth of the stall torque at most, assumed")
    return (
        Number("friction", "friction", False, friction_now, usual, lambda patient: usual(patient).low, with_friction,
               "at most {} at the output", "mN m", _MNM),
        parameter("friction", "friction.breakaway_ratio", "at most {} times as much at rest as sliding", rises=False,
                  usual=_fixed(1.0, 2.0)),
        Number("friction", "load.coulomb_torque", False, lambda patient: patient.load.coulomb_torque, rubs, _zero,
               lambda patient, value: with_load(patient, coulomb_torque=value), "at most {} of the load", "mN m", _MNM),
        Number("friction", "load.viscous_friction", False, lambda patient: patient.load.viscous_friction,
               _fixed(0.0, 1.0, _ASSUMED), _zero, lambda patient, value: with_load(patient, viscous_friction=value),
               "at most {} of the load", "N m s/rad"))


def _supplies() -> tuple[Number, ...]:
    def volts(patient: Patient) -> Usual:
        return Usual(*patient.voltages, "the voltages of its sheet")

    return (
        parameter("supply", "supply.internal_resistance", "at most {} between source and servo", rises=False,
                  usual=lambda patient: Usual(0.0, 0.1 * patient.resistance, "a tenth of the winding's, assumed"),
                  end=_zero, unit="ohm"),
        parameter("supply", "supply.open_circuit_voltage", "{} or more", rises=True, usual=volts, unit="V"),
        parameter("supply", "supply.open_circuit_voltage", "{} or less", rises=False, usual=volts, unit="V"),
        parameter("supply", "supply.current_limit", "one that gives {}", rises=True, unit="A",
                  usual=_current(1.0, "what it draws at stall")))


def _registers() -> tuple[Number, ...]:
    most = _fixed(0.8, 1.0, _ASSUMED)
    rows = [parameter("register", f"firmware.{name}", f"{text} of {{}}", rises=True, usual=usual, unit=unit,
                      factor=factor) for name, text, usual, unit, factor in (
        ("torque_limit", "torque limit", most, "%", 100.0), ("duty_limit", "duty limit", most, "%", 100.0),
        ("overload_duty", "overload torque", _fixed(0.5, 1.0, _ASSUMED), "%", 100.0),
        ("trip_current", "protection current", _current(0.6, _ASSUMED), "A", 1.0),
        ("current_limit", "current limit", _current(0.6, _ASSUMED), "A", 1.0))]
    return (*rows, parameter(
        "register", "firmware.undervoltage", "an undervoltage of {}", rises=False, unit="V",
        usual=lambda patient: Usual(0.3 * patient.voltages[0], 0.85 * patient.voltages[0],
                                    "85 % of the sheet's lowest, assumed")),
        parameter("register", "firmware.minimum_duty", "a startup force of {}", rises=False, usual=_fixed(0.0, 0.1),
                  unit="%", factor=100.0))


def _loads() -> tuple[Number, ...]:
    third = _stall_share(0.0, 1.0 / 3.0, "a third of the stall torque, as Feetech rates its servos")

    def put_torque(patient: Patient, value: float) -> Patient:
        return with_load(patient, torque=math.copysign(value, patient.load.torque))

    def put_springs(patient: Patient, value: float) -> Patient:
        by = value / _stiffness(patient)
        softer = tuple(replace(each, stiffness=each.stiffness * by) for each in patient.load.springs)
        return patient._replace(load=replace(patient.load, springs=softer))

    return (
        Number("load", "load.torque", False, lambda patient: abs(patient.load.torque), third, _zero, put_torque,
               "at most {}", "mN m", _MNM),
        Number("load", "load.pendulum", False, lambda patient: gravity(patient.load), third, _zero, with_gravity,
               "at most {} of its weight", "mN m", _MNM),
        Number("load", "load.inertia", False, lambda patient: patient.load.inertia, lambda patient: Usual(
            0.0, 10.0 * patient.rotor, "ten times the rotor's at the output, a rule of motion control, assumed"), _zero,
            lambda patient, value: with_load(patient, inertia=value), "an inertia of at most {}", "g m2", 1e3),
        Number("load", "load.spring", False, _stiffness, _stall_share(0.0, 1.0, _ASSUMED), _zero, put_springs,
               "a spring of at most {}", "N m/rad"))


def _stiffness(patient: Patient) -> float:
    return sum(each.stiffness for each in patient.load.springs)


NUMBERS: tuple[Number, ...] = (*_zone(rises=True), *_zone(rises=False), *_gains(), *_frames(), *_plays(),
                               *_frictions(), *_supplies(), *_registers(), *_loads())
CAUSES: tuple[str, ...] = tuple(dict.fromkeys(number.cause for number in NUMBERS))


# --- Causes taken away one by one: how much of a symptom goes, and what the least change is that does -----------------

_HALVINGS = 5
_SPEAKS = 0.05  # of a symptom: what takes less away is no cause
_SEARCHED = 3  # causes whose least change is looked for where a number is unusual
_PAIRED = 0.5  # of a symptom, that two take away together and neither alone


class Strength(NamedTuple):
    """How strong a symptom is, and up to where it is none."""

    value: float
    limit: float


class Cause(NamedTuple):
    """A symptom without one number.

    Parameters
    ----------
    cause, name : str
        Of the row of the table.
    now, end : float
        As it is, and as it was taken (SI).
    share : float
        Of the symptom, that goes with it.
    cures : bool
        Whether the symptom is gone.
    needed : float
        The least change that does; nan where it does not cure (SI).
    odd : float
        How many times beyond what is usual the number is; 1 where it is within.
    usual : tuple of float
        Between which it usually is (SI).
    source : str
        Of that.
    """

    cause: str
    name: str
    now: float
    end: float
    share: float
    cures: bool
    needed: float
    odd: float
    usual: tuple[float, float]
    source: str
    number: Number

    @property
    def cure(self) -> str:
        """The remedy, with its number."""
        number = self.number
        value = number.factor * (self.end if math.isnan(self.needed) else self.needed)
        return number.cure.format(f"{rounded(value, up=number.rises)} {number.unit}".strip())


def rounded(value: float, *, up: bool) -> str:
    """Return a number of two digits that does not fall short of it.

    Examples
    --------
    >>> rounded(7.31, up=True), rounded(0.0468, up=False), rounded(0.0, up=False), rounded(1119.0, up=False)
    ('7.4', '0.046', '0', '1100')
    """
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    step = 10.0**(math.floor(math.log10(abs(value))) - 1)
    found = (math.ceil(value / step - 1e-9) if up else math.floor(value / step + 1e-9)) * step
    return f"{found:.0f}" if 1e3 <= abs(found) < 1e6 else f"{found:.3g}"


class Trials:
    """Runs of one patient with something taken away, each once.

    Parameters
    ----------
    patient : Patient
    strength : callable
        Returns how strong the symptom is in a patient.
    """

    def __init__(self, patient: Patient, strength: Callable[[Patient], Strength]) -> None:
        self.patient, self._strength = patient, strength
        self.base = strength(patient)

    def value(self, *taken: tuple[Number, float]) -> float:
        """Return how strong the symptom is with numbers at other values; inf where there is no such servo."""
        try:
            patient = self.patient
            for number, end in taken:
                patient = number.put(patient, end)
            found = self._strength(patient).value
        except (ServotwinError, ValueError, ArithmeticError):
            return math.inf
        return math.inf if math.isnan(found) else found

    def share(self, value: float) -> float:
        """Return which share of the symptom is gone."""
        return max(0.0, min(1.0, 1.0 - value / self.base.value))

    def taken(self, number: Number) -> Cause | None:
        """Return what taking one number away does; None of one that is not there, or as far as it can be."""
        now, tried = number.now(self.patient), []
        if now is None or not (stops := number.stops(self.patient)):
            return None
        for end in stops:
            value = self.value((number, end))
            tried.append((value, end))
            if value <= self.base.limit:
                break
        value, end = min(tried)
        usual = number.usual(self.patient)
        return Cause(number.cause, number.name, now, end, self.share(value), value <= self.base.limit, math.nan,
                     math.exp(min(number.oddness(self.patient), 50.0)), (usual.low, usual.high), usual.source, number)

    def with_need(self, cause: Cause) -> Cause:
        """Return a cause that cures with the least change of it that does."""
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            there = self.value((cause.number, cause.number.between(cause.now, cause.end, middle)))
            low, high = (low, middle) if there <= self.base.limit else (middle, high)
        needed = cause.end if high == 1.0 else cause.number.between(cause.now, cause.end, high)
        return cause._replace(needed=needed)

    def pair(self, causes: list[Cause]) -> tuple[Cause, Cause] | None:
        """Return the two of different causes that take most away together, where neither does alone."""
        best, found = 0.0, None
        for one, other in combinations(causes, 2):
            if one.cause == other.cause:
                continue
            value = self.value((one.number, one.end), (other.number, other.end))
            gain = self.share(value) if value > self.base.limit else 1.0 + math.log(one.odd * other.odd)
            if gain > best and gain > max(one.share, other.share) + _SPEAKS:
                best, found = gain, (one, other)
        return found if best >= _PAIRED else None


def ranked(trials: Trials) -> tuple[list[Cause], tuple[Cause, Cause] | None]:
    """Return the causes of a symptom, the likeliest first, each by its best number, and a pair where none cures alone.

    Of those that cure, the first is the one whose number is furthest from what is usual; of those that are as usual,
    the one that needs the smallest part of the way. Causes that do not cure are ordered by the share that they take
    away.
    """
    found = [each for each in map(trials.taken, NUMBERS) if each is not None]
    best: dict[str, Cause] = {}
    for each in found:
        if each.cause not in best or _rank(each) < _rank(best[each.cause]):
            best[each.cause] = each
    curing = sorted((each for each in best.values() if each.cures), key=_rank)
    looked_at = len(curing) if not (curing and curing[0].odd > 1.0) else _SEARCHED  # the rest is not separated by it
    curing = [trials.with_need(each) if k < looked_at else each for k, each in enumerate(curing)]
    others = [each for each in best.values() if not each.cures]
    causes = sorted([*curing, *(each for each in others if each.share >= _SPEAKS)], key=_rank)
    return causes, None if curing else trials.pair(
        [each for each in found if each.odd > 1.0 or each is best[each.cause]])


def _rank(cause: Cause) -> tuple[float, ...]:
    if not cause.cures:
        return (1.0, -cause.share, -cause.odd)
    whole = cause.end - cause.now
    way = 1.0 if math.isnan(cause.needed) or whole == 0.0 else (cause.needed - cause.now) / whole
    return (0.0, -cause.odd, way)
