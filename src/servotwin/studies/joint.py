"""Numbers that are fixed together: what is drawn in their place, and how they follow from it.

A servo file states each number with its own spread, but a sheet fixes several of them together: the torque constant
and the gear reduction by their product, the feedback gain and the slope of the one-shot by theirs. Drawn one by one
they make servos that no sheet describes. So a joint draws what is known, and its parameters follow.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.parameters import Quantity, Servo
from servotwin.parameters.servo import OUTPUT_SIDE, N, motor_side, output_value
from servotwin.parameters.servo_file import ELSE, Figure, figure
from servotwin.physics import (
    averaged_bridge_gain,
    load_share,
    no_load_current_of,
    sheet_resistance,
    sheet_stall_torque,
    sheet_torque_constant,
    stall_current_for,
)
from servotwin.physics.sheet import LEAST_EFFICIENCY
from servotwin.studies.kinds import Choice, Distribution, Normal, Uniform

if TYPE_CHECKING:
    from servotwin.models import Model


# --- Numbers that are fixed together: what is drawn in their place, and how they follow from it -----------------------

Column = NDArray[Any]

TINY = float(np.nextafter(0.0, 1.0))
_SAME = 1e-4  # relative: ends of ranges that a file of six digits gives differ by less
_HOLDS = 0.01  # relative: how well a relation has to hold in the file, for a parameter to follow from it


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """A number that is drawn in place of parameters that follow from it.

    Parameters
    ----------
    dimension : str
        Of `servotwin.units`.
    lower, upper : float
        Least and largest possible value (SI).
    nominal : float
        Of the servo as its file has it (SI).
    spread : Distribution, optional
        Spread that the servo's file states, or that is assumed; None where it is not drawn.
    """

    dimension: str
    lower: float
    upper: float
    nominal: float
    spread: Distribution | None = None


class Joint(ABC):
    """Numbers that are fixed together."""

    coordinates: Mapping[str, Coordinate]
    """Numbers that may be drawn, by name."""
    covers: frozenset[str]
    """Dotted names of parameters that follow, so that their own spreads do not count."""

    @abstractmethod
    def follow(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return the parameters (SI, dotted names) that follow from what is drawn; what follows from nothing is absent.

        Parameters
        ----------
        drawn : mapping of str to ndarray, shape (lanes,)
            All that is drawn, by name (SI).
        """


DIMENSIONS: dict[str, str] = {
    "sheet.no_load_speed": "output speed", "sheet.stall_torque": "torque", "sheet.no_load_current": "current",
    "sheet.gear_efficiency": "number", "sheet.viscous_share": "number",
    "calibration.angle_per_pulse": "angle per pulse", "calibration.zero_pulse": "time",
    **{name: side.dimension for name, side in OUTPUT_SIDE.items()},
}
"""Of everything that a joint may draw, by name."""


def own_spread(quantity: Quantity, factor: float = 1.0) -> Distribution | None:
    """Return the spread that a file states of a number, times a positive factor; None where it states none.

    A standard error is a normal distribution about the value, a range a uniform one; where one bound is given, the
    value is the other.

    Examples
    --------
    >>> own_spread(Quantity(value=3.0, unit="ohm", origin="assumed", upper=4.0))
    Uniform(lower=3.0, upper=4.0)
    """
    value = quantity.value
    if not isinstance(value, float):
        return None
    if quantity.std:
        return Normal(factor * value, factor * quantity.std)
    lower = value if quantity.lower is None else quantity.lower
    upper = value if quantity.upper is None else quantity.upper
    return Uniform(factor * lower, factor * upper) if factor * lower < factor * upper else None


def scaled_spread(quantity: Quantity, partner: Quantity, nominal: float) -> Distribution | None:
    """Return the spread of the product of two numbers of which the first was found from the second.

    Where the range of the first holds that of one over the second, what it has beyond it is that of the product;
    otherwise the product is as uncertain as the first.

    Parameters
    ----------
    quantity, partner : Quantity
        Positive numbers.
    nominal : float
        Value that the product counts as, in place of the product of the values.

    Returns
    -------
    Distribution or None
        None where nothing is left.

    Examples
    --------
    >>> gain = Quantity(value=0.5, unit="V/rad", origin="assumed", lower=0.36, upper=0.66)
    >>> slope = Quantity(value=1.2, unit="s/V", origin="assumed", lower=1.0, upper=1.5)
    >>> scaled_spread(gain, slope, 600.0)
    Uniform(lower=540.0, upper=660.0)
    """
    value, with_value = quantity.value, partner.value
    if not (isinstance(value, float) and isinstance(with_value, float)) or value == 0.0:
        return None
    if quantity.std:
        return Normal(nominal, abs(nominal / value) * quantity.std)
    low, high = _ends(quantity)
    least, most = _ends(partner)
    ends = low * most, high * least
    if not ends[0] <= 1.0 + _SAME or not ends[1] >= 1.0 - _SAME:
        ends = low, high
    if max(abs(end - 1.0) for end in ends) <= _SAME:
        return None
    return Uniform(*sorted((round(nominal * ends[0], 15), round(nominal * ends[1], 15))))


def _ends(quantity: Quantity) -> tuple[float, float]:
    """Return the ends of a range over the value."""
    value = float(quantity.value)  # type: ignore[arg-type]
    lower = value if quantity.lower is None else quantity.lower
    upper = value if quantity.upper is None else quantity.upper
    return lower / value, upper / value


def number(servo: Servo, name: str, default: float = math.nan) -> float:
    """Return a parameter (SI); the default where the servo does not give it as a number."""
    value = servo.get(name)
    return value if isinstance(value, float) else default


def holds(value: float, law: float) -> bool:
    """Return whether a parameter of the file is what a relation makes of others.

    Examples
    --------
    >>> holds(45.67, 45.675), holds(45.67, 60.0)
    (True, False)
    """
    return math.isfinite(law) and abs(value - law) <= _HOLDS * abs(value)


# --- Pulse and angle --------------------------------------------------------------------------------------------------

_GAIN, _OFFSET = "potentiometer.feedback_gain", "potentiometer.feedback_offset"
_SLOPE, _BEGIN, _BACK = ("electronics.one_shot_slope", "electronics.one_shot_offset",
                         "electronics.pulse_to_voltage_gain")
_BESIDE, _START = "electronics.command_offset", "electronics.command_pulse_offset"
_K, _FRAME, _WIDTH = "electronics.stretcher_gain", "electronics.frame_period", "electronics.deadband"
_SUPPLY, _DROP = "supply.open_circuit_voltage", "supply.bridge_drop_voltage"
_RATE, _ZERO = "calibration.angle_per_pulse", "calibration.zero_pulse"


class CalibrationJoint(Joint):
    """Angle per pulse width 1/(p · one_shot_slope) and pulse at angle 0, T_0 + one_shot_slope · b_o, of a servo.

    The slope is drawn for itself: p and b_o follow, so that a pulse means the same angle whatever it is. The averaged
    models' numbers of the chip follow too, as far as they do so in the file: k_p2 = 1/slope, the offset b_i, the
    deadband w/slope in volts, and A k_s = (V_oc − V_ce0) K slope/T_f.

    Parameters
    ----------
    servo : Servo

    Examples
    --------
    >>> import servotwin as st
    >>> joint = CalibrationJoint(st.load_servo("hitec-hs-485hb"))
    >>> round(joint.coordinates["calibration.zero_pulse"].nominal * 1e6)
    1500
    """

    def __init__(self, servo: Servo) -> None:
        self._servo = servo
        self._laws: dict[str, float] = {}  # what follows besides p and b_o -> its value over the relation
        self.coordinates: dict[str, Coordinate] = {}
        self.covers = frozenset[str]()
        slope = number(servo, _SLOPE, 1.0 / number(servo, _BACK))
        gain = number(servo, _GAIN)
        if not (math.isfinite(gain) and math.isfinite(slope)):
            return
        self._per_angle, self._slope = gain * slope, slope
        # Where the chip's own offset is not given, that of the control voltage stands for it
        self._begin = number(servo, _BEGIN, 0.0 if servo.get(_SLOPE) is not None or servo.get(_BESIDE) is None else
                             number(servo, _START, 0.0) - number(servo, _BESIDE) * slope)
        self.coordinates[_RATE] = Coordinate(
            dimension="angle per pulse", lower=TINY, upper=math.inf, nominal=1.0 / self._per_angle,
            spread=self._of_rate())
        offset = servo.get(_OFFSET)
        if isinstance(offset, float):
            self.coordinates[_ZERO] = Coordinate(
                dimension="time", lower=TINY, upper=math.inf, nominal=self._begin + slope * offset,
                spread=self._of_zero(offset))
        for name, law in self._relations({}).items():
            value = servo.get(name)
            if isinstance(value, float) and holds(value, law()):
                self._laws[name] = value / law() if value else 1.0
        self.covers = frozenset((_GAIN, *((_OFFSET,) if _ZERO in self.coordinates else ()), *self._laws))

    def inputs(self) -> tuple[str, ...]:
        """Return the numbers of the chip that what follows is made of."""
        found = {_BACK: (_SLOPE,), _BESIDE: (_SLOPE, _BEGIN, _START),
                 "electronics.voltage_deadband": (_WIDTH, _SLOPE),
                 "electronics.bridge_gain": (_K, _FRAME, _SLOPE, _DROP)}
        return tuple(dict.fromkeys(name for law in self._laws for name in found[law]))

    def _scale(self) -> Quantity:
        """Return the slope, or where it is not given k_p2 in its place."""
        if self._servo.get(_SLOPE) is not None:
            return self._servo.source(_SLOPE)
        q = self._servo.source(_BACK)
        return Quantity(value=self._slope, unit="s/V", origin="assumed",
                        lower=None if q.upper is None else 1.0 / q.upper,
                        upper=None if q.lower is None else 1.0 / q.lower)

    def _of_rate(self) -> Distribution | None:
        found, nominal = scaled_spread(self._servo.source(_GAIN), self._scale(), 1.0), 1.0 / self._per_angle
        if isinstance(found, Normal):
            return Normal(nominal, nominal * found.std)
        return Uniform(nominal / found.upper, nominal / found.lower) if isinstance(found, Uniform) else None

    def _of_zero(self, offset: float) -> Distribution | None:
        quantity, slope, begin = self._servo.source(_OFFSET), self._slope, self._begin
        found = scaled_spread(quantity, self._scale(), slope * offset) if offset else own_spread(quantity, slope)
        if isinstance(found, Normal):
            return Normal(begin + found.mean, found.std)
        return Uniform(begin + found.lower, begin + found.upper) if isinstance(found, Uniform) else None

    def follow(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return what follows of potentiometer and chip."""
        active = any(name in drawn for name in self.coordinates)
        chip = [name for name in self._laws if (name == "electronics.bridge_gain" and _K in drawn)
                or (name == "electronics.voltage_deadband" and _WIDTH in drawn)]
        if not active and not chip:
            return {}
        found: dict[str, Any] = {}
        slope, begin = self._chip(drawn)
        if active:
            found[_GAIN] = 1.0 / (drawn.get(_RATE, 1.0 / self._per_angle) * slope)
        if active and _ZERO in self.coordinates:
            found[_OFFSET] = (drawn.get(_ZERO, self.coordinates[_ZERO].nominal) - begin) / slope
        relations = self._relations(drawn)
        found |= {name: factor * relations[name]() for name, factor in self._laws.items() if active or name in chip}
        return {name: column for name, column in found.items() if not isinstance(column, float)}

    def _chip(self, drawn: Mapping[str, Column]) -> tuple[Any, Any]:
        """Return slope and offset of the one-shot."""
        if self._servo.get(_SLOPE) is None and _BACK in drawn:
            return 1.0 / drawn[_BACK], drawn.get(_BEGIN, self._begin)
        return drawn.get(_SLOPE, self._slope), drawn.get(_BEGIN, self._begin)

    def _relations(self, drawn: Mapping[str, Column]) -> dict[str, Callable[[], Any]]:
        """Return what the averaged models have of the chip, by name; k_p2 where it does not stand for the slope."""
        slope, begin = self._chip(drawn)

        def of(name: str) -> Any:
            return drawn.get(name, number(self._servo, name))

        gain = number(self._servo, "electronics.comparator_gain", 1.0)
        known = {} if self._servo.get(_SLOPE) is None else {_BACK: lambda: 1.0 / slope}
        return {**known, _BESIDE: lambda: (drawn.get(_START, number(self._servo, _START, 0.0)) - begin) / slope,
                "electronics.voltage_deadband": lambda: of(_WIDTH) / slope,
                "electronics.bridge_gain": lambda: averaged_bridge_gain(
                    of(_SUPPLY), drawn.get(_DROP, number(self._servo, _DROP, 0.0)), of(_K), of(_FRAME), slope) / gain}


# --- The numbers of a sheet as the servo has them that was made of it, their spreads, and the motor that --------------

# Assumed: how far servos of one kind, and what different sellers print of it, lie from the sheet where it says nothing
TOLERANCES = {"no_load_speed": 0.10, "stall_torque": 0.15, "no_load_current": 0.15}
EFFICIENCY_TOLERANCE = 0.1  # assumed, where the gear's efficiency is
_KEYS = {"no_load_speed": "speed_per_60deg", "stall_torque": "stall_torque", "no_load_current": "no_load_current",
         "stall_current": "stall_current"}
_MOTOR = ("motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant",
          "friction.coulomb_torque_forward", "friction.coulomb_torque_backward")
_SHARES = ("friction.load_friction_motor", "friction.load_friction_external")
_OTHER_SHARES = tuple(f"friction.load_friction{end}" for end in (
    "", "_stribeck", "_motor_stribeck", "_external_stribeck", "_motor_quad", "_external_quad"))
_VISCOUS, _SHEET_DROP, _BRUSH, _BRIDGE = ("motor.motor_viscous_friction", "supply.bridge_drop_voltage",
                                    "motor.brush_drop_voltage", "supply.bridge_drop_resistance")


@dataclass(frozen=True, kw_only=True)
class SheetNumbers:
    """The sheet of a servo as its twin has it, and the motor of any other sheet.

    Parameters
    ----------
    servo : Servo
    voltage : float
        V of the sheet [V].
    left : float, optional
        1 − μ_m where the file's friction does not grow with the torque through the gear [1].
    coordinates : mapping of str to Coordinate
    covers : frozenset of str
        Parameters that follow.
    """

    servo: Servo
    voltage: float
    left: float | None
    coordinates: Mapping[str, Coordinate]
    covers: frozenset[str]

    def solved(self, drawn: Mapping[str, Column]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the parameters that N does not change, and the numbers at the output, from what is drawn (SI)."""
        w_0, T_s, I_0, eta, s = (drawn.get(name, self.coordinates[name].nominal) for name in (
            "sheet.no_load_speed", "sheet.stall_torque", "sheet.no_load_current", "sheet.gear_efficiency",
            "sheet.viscous_share"))
        V_d = sum(drawn.get(name, number(self.servo, name, 0.0)) for name in (_SHEET_DROP, _BRUSH))
        I_s = stall_current_for(self.voltage, T_s, w_0, I_0, eta, V_d, s)
        R: Any = sheet_resistance(self.voltage, I_s, V_d)
        K_out: Any = sheet_torque_constant(self.voltage, w_0, I_0, R, V_d)
        mu = load_share(eta)
        friction = K_out * I_0 * (1.0 - mu if self.left is None else self.left)
        found = {"motor.armature_resistance": R - drawn.get(_BRIDGE, number(self.servo, _BRIDGE, 0.0))}
        if self.left is None:
            found |= dict.fromkeys(_SHARES, mu)
        return found, {"output_torque_constant": K_out, "output_coulomb_torque": (1.0 - s) * friction,
                       "output_viscous_friction": s * friction / w_0}


def sheet_numbers(servo: Servo) -> SheetNumbers | None:
    """Return the sheet of a servo whose motor is as a sheet made it; None of any other.

    It is, as long as the file has a table [sheet] with torque, speed and voltage, and states a range of resistance,
    constants and friction. A fit states standard errors, and a number that was set states nothing.

    Raises
    ------
    InputError
        If a figure of the table cannot be read.

    Examples
    --------
    >>> import servotwin as st
    >>> found = sheet_numbers(st.load_servo("hitec-hs-485hb"))
    >>> {name: round(one.nominal, 3) for name, one in found.coordinates.items()}["sheet.gear_efficiency"]
    0.996
    """
    printed = dict(_figures(servo, servo.sheet, ("supply_voltage", "stall_torque", "speed_per_60deg")))
    if len(printed) < 3 or not _as_made(servo):
        return None
    V, plain = printed["supply_voltage"].value, servo.get(_SHARES[0]) is None
    twin = _twin(servo, V, printed["stall_torque"].value)
    if twin is None:
        return None
    spreads = {**{name: _tolerance(servo, name, getattr(twin, name)) for name in TOLERANCES},
               "gear_efficiency": _efficiency(servo, twin.gear_efficiency, plain=plain),
               "viscous_share": _viscous(servo, twin.viscous_share, twin.no_load_speed / twin.friction)}
    coordinates = {f"sheet.{name}": Coordinate(
        dimension=DIMENSIONS[f"sheet.{name}"], lower=0.0 if name == "viscous_share" else TINY,
        upper=math.inf if name in TOLERANCES else 1.0, nominal=getattr(twin, name), spread=spread)
        for name, spread in spreads.items()}
    return SheetNumbers(servo=servo, voltage=V, left=twin.left if plain else None, coordinates=coordinates,
                        covers=frozenset((*_MOTOR, _VISCOUS, *(() if plain else _SHARES))))


class _Twin(NamedTuple):
    """The file's servo at the sheet's voltage; friction [N m] and what of it no load changes [1]."""

    no_load_speed: float
    stall_torque: float
    no_load_current: float
    gear_efficiency: float
    viscous_share: float
    friction: float
    left: float


def _twin(servo: Servo, V: float, printed_torque: float) -> _Twin | None:
    """Return the sheet of the file's own motor: that of which `SheetNumbers.solved` makes it again."""
    K_out, tau = output_value(servo, "output_torque_constant"), output_value(servo, "output_coulomb_torque")
    if not K_out or not tau:
        return None
    b = output_value(servo, "output_viscous_friction") or 0.0
    V_d = sum(number(servo, x, 0.0) for x in (_SHEET_DROP, _BRUSH))
    R, mu = number(servo, _MOTOR[0]) + number(servo, _BRIDGE, 0.0), servo.get(_SHARES[0])
    printed = [] if isinstance(mu, float) else _anywhere(servo, "no_load_current")
    I_s: Any = (V - V_d) / R
    I_0: Any = printed[0].value if printed else no_load_current_of(
        V, R, K_out, tau, b, 1.0 - mu if isinstance(mu, float) else 1.0, V_d)
    w_0 = (V - V_d - R * I_0) / K_out
    if not (0.0 < I_0 < I_s and w_0 > 0.0):
        return None
    friction = tau + b * w_0
    s = b * w_0 / friction
    if isinstance(mu, float):
        eta = load_share(mu)
    else:  # the file's friction does not tell; the torque of the sheet does
        eta = printed_torque / float(sheet_stall_torque(K_out, I_s, I_0, 1.0, s))
        eta = min(max(eta, LEAST_EFFICIENCY), 1.0)
    T_s = float(sheet_stall_torque(K_out, I_s, I_0, eta, s))
    return _Twin(w_0, T_s, I_0, eta, s, friction, friction / (K_out * I_0))


def _figures(servo: Servo, table: Mapping[str, Any], keys: tuple[str, ...]) -> Iterator[tuple[str, Figure]]:
    for key in keys:
        found = figure(servo.name, key, table[key]) if key in table else None
        if found is not None:
            yield key, found


def _rows(servo: Servo) -> list[Mapping[str, Any]]:
    rows = servo.sheet.get(ELSE, [])
    return [row for row in rows if isinstance(row, Mapping)] if isinstance(rows, list) else []


def _anywhere(servo: Servo, name: str) -> list[Figure]:
    """Return a figure wherever the table has it, that at the sheet's own voltage first."""
    return [found for table in (servo.sheet, *_rows(servo)) for _, found in _figures(servo, table, (_KEYS[name],))]


def _at_same_voltage(servo: Servo, name: str) -> Iterator[Figure]:
    """Yield what other sources print at the sheet's own voltage."""
    own = dict(_figures(servo, servo.sheet, ("supply_voltage",)))["supply_voltage"].value
    for row in _rows(servo):
        found = dict(_figures(servo, row, ("supply_voltage", _KEYS[name])))
        if len(found) == 2 and found["supply_voltage"].value == own:
            yield found[_KEYS[name]]


def _as_made(servo: Servo) -> bool:
    """Return whether the motor is as a sheet made it: with ranges, alike both ways, of one load friction at most."""
    if any(servo.get(name) is None for name in (*_MOTOR, N)):
        return False
    made = all(q.lower is not None and q.origin in ("datasheet", "assumed") for q in map(servo.source, _MOTOR))
    shares = [servo.get(name) for name in _SHARES]
    return (made and number(servo, _MOTOR[1]) == number(servo, _MOTOR[2])
            and number(servo, _MOTOR[3]) == number(servo, _MOTOR[4]) and shares[0] == shares[1]
            and all(servo.get(name) is None for name in _OTHER_SHARES))


def _tolerance(servo: Servo, name: str, nominal: float) -> Distribution:
    """Return the spread of a printed number: that which the table states, or the assumed one, other sources within."""
    figures = _anywhere(servo, name)
    own = figures[0] if figures else None
    if own is not None and own.std:
        return Normal(nominal, nominal * own.std / own.value)
    if own is not None and (own.lower is not None or own.upper is not None):
        low, high = (own.value if end is None else end for end in (own.lower, own.upper))
        if low < high:
            return Uniform(nominal * low / own.value, nominal * high / own.value)
    ends = [1.0 - TOLERANCES[name], 1.0 + TOLERANCES[name]]
    if own is None:  # assumed within a range, which is that of the friction
        quantity, value = servo.source(_MOTOR[3]), number(servo, _MOTOR[3])
        ends += [end / value for end in (quantity.lower, quantity.upper) if end is not None]
    else:
        ends += [other.value / own.value for other in _at_same_voltage(servo, name)]
    return Uniform(nominal * min(ends), nominal * max(ends))


def _efficiency(servo: Servo, eta: float, *, plain: bool) -> Distribution | None:
    """Return the spread of the efficiency: that of the file's load friction, or the assumed one."""
    if plain:
        if _anywhere(servo, "stall_current"):  # which tells it
            return None
        return Uniform(max(eta - EFFICIENCY_TOLERANCE, LEAST_EFFICIENCY), min(eta + EFFICIENCY_TOLERANCE, 1.0))
    quantity = servo.source(_SHARES[0])
    if quantity.std:
        slope = 2.0 / (1.0 + number(servo, _SHARES[0])) ** 2
        return Normal(eta, slope * quantity.std)
    ends = sorted(load_share(end) for end in (quantity.lower, quantity.upper) if end is not None)
    ends = sorted((*ends, eta))
    return Uniform(ends[0], ends[-1]) if ends[0] < ends[-1] else None


def _viscous(servo: Servo, nominal: float, per_friction: float) -> Distribution | None:
    """Return the spread of the viscous share of the friction: that of the file's viscous friction."""
    if servo.get(_VISCOUS) is None:
        return None
    quantity, factor = servo.source(_VISCOUS), number(servo, N) ** 2 * per_friction
    if quantity.std:
        return Normal(nominal, factor * quantity.std)
    low, high = (number(servo, _VISCOUS) if end is None else end for end in (quantity.lower, quantity.upper))
    return Uniform(factor * low, factor * high) if low < high else None


# --- Motor and gear ---------------------------------------------------------------------------------------------------

_FORWARD, _BACKWARD = "friction.coulomb_torque_forward", "friction.coulomb_torque_backward"


class MotorJoint(Joint):
    """Motor and gear of a servo.

    Of a servo made of a sheet the sheet's numbers are drawn: speed and current without load, stall torque, efficiency
    of the gear; of any other, what acts at the output shaft, such as K_out = N k_a. Either way N alone changes nothing
    at the output.

    Parameters
    ----------
    servo : Servo

    Examples
    --------
    >>> import servotwin as st
    >>> joint = MotorJoint(st.load_servo("hitec-hs-755hb"))
    >>> round(joint.coordinates["sheet.stall_torque"].nominal, 3)
    1.294
    """

    def __init__(self, servo: Servo) -> None:
        self._servo = servo
        self._sheet: SheetNumbers | None = sheet_numbers(servo)
        self._at_output = {name: value for name in _sides(servo) if (value := output_value(servo, name)) is not None}
        covered = self._sheet.covers if self._sheet is not None else frozenset[str]()
        free = [name for name in self._at_output if not covered.intersection(OUTPUT_SIDE[name].members)]
        own = {name: self._own(name) for name in free}
        self.coordinates = {**(self._sheet.coordinates if self._sheet is not None else {}), **own}
        self.covers = covered | {member for name in own for member in OUTPUT_SIDE[name].members}

    def _own(self, name: str) -> Coordinate:
        side, value = OUTPUT_SIDE[name], self._at_output[name]
        quantity = self._servo.source(side.members[0])
        spread = own_spread(quantity, number(self._servo, N) ** side.power)
        if spread is None and name == "output_torque_constant" and own_spread(self._servo.source(N)) is not None:
            spread = Choice((value,))  # held while the gear reduction is drawn
        positive = name in ("output_torque_constant", "output_inertia", "output_stribeck_speed")
        return Coordinate(dimension=side.dimension, lower=TINY if positive else 0.0, upper=math.inf, nominal=value,
                          spread=spread)

    def follow(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return what follows of motor and gear."""
        if not any(name in drawn for name in self.coordinates):
            return {}
        found: dict[str, Any] = {}
        values: dict[str, Any] = {name: drawn.get(name, value) for name, value in self._at_output.items()}
        if self._sheet is not None and any(name in drawn for name in self._sheet.coordinates):
            found, more = self._sheet.solved(drawn)
            values |= {name: value for name, value in more.items() if name in values}
        nominal = number(self._servo, N)
        reduction = drawn.get(N, nominal)
        for name, value in values.items():
            if isinstance(value, float) and isinstance(reduction, float):
                continue
            for member, column in motor_side({name: value}, reduction).items():
                mean, own = self._at_output[name], number(self._servo, member) * nominal ** OUTPUT_SIDE[name].power
                found[member] = column * (own / mean) if mean and own != mean else column
        return {name: column for name, column in found.items() if not isinstance(column, float)}


def _sides(servo: Servo) -> list[str]:
    """Return the names at the output: one Coulomb torque where both ways are alike in value and spread."""
    names = list(OUTPUT_SIDE)
    if any(servo.get(name) is None for name in (_FORWARD, _BACKWARD)):
        names.remove("output_coulomb_torque")
        return names
    one, two = servo.source(_FORWARD), servo.source(_BACKWARD)
    if (one.value, one.std, one.lower, one.upper) == (two.value, two.std, two.lower, two.upper):
        return [name for name in names if not name.startswith("output_coulomb_torque_")]
    names.remove("output_coulomb_torque")
    return names


# --- The spread that a servo file states, and how parameters follow from what is drawn of it --------------------------

class Together:
    """All numbers of a servo that are fixed together, as far as a model reads what follows from them.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model) -> None:
        servo = model.servo
        self._reads = frozenset(name for name in (*model.requires, *model.optional)
                                if isinstance(servo.get(name), float))
        calibration = CalibrationJoint(servo)
        self._joints = tuple(joint for joint in (MotorJoint(servo), calibration) if joint.covers & self._reads)
        self.coordinates: Mapping[str, Coordinate] = {
            name: one for joint in self._joints for name, one in joint.coordinates.items()}
        self.unread = tuple(name for name in calibration.inputs() if name not in self._reads
                            and isinstance(servo.get(name), float)) if calibration in self._joints else ()
        self.covers = frozenset[str]().union(*(joint.covers for joint in self._joints))

    def follow(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return the parameters (SI, dotted names) that follow from what is drawn and are not drawn themselves."""
        found = {name: column for joint in self._joints for name, column in joint.follow(drawn).items()}
        return {name: found[name] for name in sorted(found) if name in self._reads and name not in drawn}

    def read(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return what of the drawn numbers the model reads itself."""
        return {name: column for name, column in drawn.items()
                if name not in self.coordinates and name not in self.unread}


def stated(model: Model) -> dict[str, Distribution]:
    """Return the spread that the servo file itself states, of numbers that can be drawn apart.

    A standard error is taken as a normal distribution about the value, a range as a uniform one; where one bound is
    given, the value is the other. Numbers that are fixed together are drawn as what fixes them:

    - Of a servo made of a sheet its speed and current without load, its stall torque and the efficiency of its gear
      (``sheet.no_load_speed`` and so on). Their spread is what the table [sheet] states, else assumed: 10 % of the
      speed, 15 % of torque and current, all that other sources print included; what was assumed for want of a figure
      keeps its range. Resistance, torque and back-EMF constant and friction follow.
    - Of any other servo the torque constant, inertia and friction at the output (``output_torque_constant`` and so on),
      where the gear reduction does not matter.
    - The angle per pulse width and the pulse at angle 0 (``calibration.angle_per_pulse``, ``calibration.zero_pulse``);
      potentiometer and averaged electronics follow with the slope of the one-shot.

    Examples
    --------
    >>> import servotwin as st
    >>> found = stated(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> found["electronics.stretcher_gain"], "motor.torque_constant" in found
    (Uniform(lower=60.0, upper=200.0), False)
    >>> [round(end, 2) for end in found["sheet.stall_torque"].ends]
    [1.12, 1.47]
    """
    servo, together = model.servo, Together(model)
    found = {name: one.spread for name, one in together.coordinates.items()}
    for name in (*model.requires, *model.optional, *together.unread):
        if isinstance(servo.get(name), float) and name not in together.covers:
            found[name] = own_spread(servo.source(name))
    return {name: spread for name, spread in found.items() if spread is not None}
