"""The parameter groups, by the tables of a servo file.

Names, letters and ranges are those of Urrea & Kern (2011) where the paper has them; the theory pages list both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ParameterError
from servotwin.units import is_finite, si_unit
from servotwin.units.quantities import number_and_unit, quantity

# --- A parameter group: a frozen dataclass whose fields say unit, range, meaning and symbol ---------------------------

# They check themselves; a field that is None is absent: the effect is off, or not known.

POSITIVE = "a positive number"
NOT_NEGATIVE = "a number of at least 0"
ANY = "a finite number"
AT_LEAST_ONE = "a number of at least 1"
FRACTION = "a number from 0 to 1"

class Range(NamedTuple):
    """Between which numbers a value has to be."""

    low: float = -math.inf
    high: float = math.inf
    open: bool = False  # whether `low` is not possible itself

    def __call__(self, x: Any) -> Any:
        """Tell whether a number, or each number of a column, is there."""
        return (x > self.low if self.open else x >= self.low) & (x <= self.high)


RULES = {POSITIVE: Range(0.0, open=True), NOT_NEGATIVE: Range(0.0), ANY: Range(), AT_LEAST_ONE: Range(1.0),
         FRACTION: Range(0.0, 1.0)}
"""Numbers that each rule allows."""


class Relation(NamedTuple):
    """Relations between fields of a group; of columns, lane by lane, or for all lanes alike."""

    what: str
    holds: bool | NDArray[np.bool_]
    got: Any
    allowed: str
    bound: Any = None  # a number that `allowed` ends with

    def check(self) -> None:
        """Raise ParameterError if it does not hold; of columns, for the first such lane."""
        if self.holds is True or np.all(self.holds):
            return
        lane = None
        if any(isinstance(x, np.ndarray) for x in (self.holds, self.got)):
            lane = int(np.argmin(self.holds))  # 0 where what does not hold is the same in all lanes
        got, bound = (x[lane].item() if isinstance(x, np.ndarray) else x for x in (self.got, self.bound))
        raise ParameterError(self.what if lane is None else f"{self.what} of lane {lane}", got=got,
                             allowed=self.allowed if bound is None else f"{self.allowed} = {bound!r}")


class Plausible(NamedTuple):
    """Between which numbers (SI) a parameter of a servo lies, and by what source; others have probably a wrong unit."""

    low: float
    high: float
    source: str


class Basis(NamedTuple):
    """Sources of plausible ranges."""

    source: str

    def of(self, low: float, high: float) -> Plausible:
        """Return a range (SI) with this source."""
        return Plausible(low, high, self.source)


CATALOG = Basis("the servos of the catalog and about ten times beyond; assumed")
THEORY = Basis("values and priors of the theory pages and about ten times beyond; assumed")
PROGRAMS = Basis("registers and programs of digital and bus servos and about ten times beyond; assumed")
TURNS = Basis("about three turns either way; assumed")
CELSIUS = Basis("temperatures that servos bear; assumed")
SHARE = Basis("a share, by what it means")


def parameter(symbol: str, dimension: str, rule: str, meaning: str, plausible: Plausible) -> Any:
    """Declare a number that may be absent."""
    return field(default=None, metadata={"symbol": symbol, "dimension": dimension, "rule": rule, "meaning": meaning,
                                         "plausible": plausible})


def table(symbol: str, dimension: str, meaning: str, plausible: Plausible) -> Any:
    """Declare a table of numbers that may be absent."""
    return field(default=None, metadata={"symbol": symbol, "dimension": dimension, "rule": "table",
                                         "meaning": meaning, "plausible": plausible})


def choice(options: tuple[str, ...], meaning: str) -> Any:
    """Declare a word out of a few that may be absent."""
    return field(default=None, metadata={"symbol": "", "dimension": "word", "rule": options, "meaning": meaning,
                                         "plausible": None})


@dataclass(frozen=True, kw_only=True)
class Group:
    """Base of all groups: checks every field once, and the relations between fields."""

    title: ClassVar[str]
    less = cast("tuple[tuple[str, str], ...]", ())  # no field, and no annotation that would make it one
    """Fields of which the first has to be less than the second."""

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if value is not None:
                object.__setattr__(self, f.name, self._checked(f.name, value, f.metadata))
        for relation in self._relations():
            relation.check()

    def _checked(self, name: str, value: Any, metadata: Any) -> Any:
        rule = metadata["rule"]
        what = f"{self.title}.{name}"
        if isinstance(rule, tuple):
            if value not in rule:
                raise ParameterError(what, got=value, allowed=" or ".join(rule))
            return value
        if rule == "table":
            if isinstance(value, np.ndarray) and value.ndim == 1:
                value = value.tolist()
            if not isinstance(value, list | tuple) or not all(is_finite(x) for x in value) or not value:
                unit = si_unit(metadata["dimension"])
                raise ParameterError(what, got=value, allowed=f"a list of finite numbers [{unit}]")
            return tuple(float(x) for x in value)
        if not is_finite(value) or not RULES[rule](float(value)):  # the float is kept, so it is what counts
            raise ParameterError(what, got=value, allowed=f"{rule} [{si_unit(metadata['dimension'])}]")
        return float(value)

    def _relations(self) -> Iterator[Relation]:
        """Return what has to hold between several fields."""
        for pair in self.less:
            yield from self._less(*pair)

    def _only_with(self, name: str, partners: tuple[str, ...]) -> Iterator[Relation]:
        """Yield that a field may be given only where all its partners are."""
        value = getattr(self, name)
        if value is not None and any(getattr(self, partner) is None for partner in partners):
            names = ", ".join(f"{self.title}.{partner}" for partner in partners)
            yield Relation(f"{self.title}.{name}", False, value, f"only together with {names}")

    def _less(self, low: str, high: str) -> Iterator[Relation]:
        a, b = getattr(self, low), getattr(self, high)
        if a is not None and b is not None:
            yield Relation(f"{self.title}.{low}", a < b, a, f"less than {self.title}.{high}", b)


def check_column(what: str, column: NDArray[np.float64], rule: str, unit: str) -> None:
    """Raise ParameterError that names the first lane whose number is not finite or breaks the rule.

    Examples
    --------
    >>> check_column("gear.gear_reduction", np.array([2.0, 1.0]), AT_LEAST_ONE, "1")
    """
    Relation(what, np.isfinite(column) & RULES[rule](column), column, f"{rule} [{unit}]").check()


# --- The firmware of a servo with a microcontroller: all that its program makes of goal, angle and time ---------------

# Gains are in duty (1: the bridge always on) per unit of the output shaft. A maker's registers are set into these
# numbers by `parameters.registers`.

MOST_WAITING = 16  # duties, or goals, that may be on their way
_SLACK = 1e-9


@dataclass(frozen=True, kw_only=True)
class Firmware(Group):
    """The control loop of a digital or bus servo, tick by tick; angles at the output shaft."""

    title = "firmware"
    less = (("lower_goal", "upper_goal"),)
    control_period: float | None = parameter(
        "T_c", "time", POSITIVE, "time between two ticks of the control loop", PROGRAMS.of(2e-05, 0.1))
    control_phase: float | None = parameter(
        "t_phi", "time", NOT_NEGATIVE, "time of the first tick", PROGRAMS.of(0.0, 0.1))
    compute_delay: float | None = parameter(
        "T_d", "time", NOT_NEGATIVE, "from a tick until its duty is applied", PROGRAMS.of(0.0, 0.1))
    angle_quantum: float | None = parameter(
        "Delta", "angle", POSITIVE, "output angle per count; absent: not counted", PROGRAMS.of(1e-06, 0.1))
    filter_weight: float | None = parameter(
        "a", "number", FRACTION, "weight of the newest angle; absent: 1, no filter", SHARE.of(0.0, 1.0))
    deadband_angle: float | None = parameter(
        "h", "angle", NOT_NEGATIVE, "half width of the dead zone of the error", PROGRAMS.of(0.0, 0.2))
    deadband_law: str | None = choice(
        ("subtract", "gate"), "whether the dead zone is taken off the error beyond it; absent: it is")
    proportional_gain: float | None = parameter(
        "k_p", "inverse angle", POSITIVE, "duty per error", PROGRAMS.of(0.01, 1000.0))
    integral_gain: float | None = parameter(
        "k_i", "inverse angle and time", NOT_NEGATIVE, "duty per error and time", PROGRAMS.of(0.0, 10000.0))
    derivative_gain: float | None = parameter(
        "k_d", "inverse speed", NOT_NEGATIVE, "duty per rate", PROGRAMS.of(0.0, 10.0))
    velocity_feedforward: float | None = parameter(
        "k_v", "inverse speed", NOT_NEGATIVE, "duty per profile's speed", PROGRAMS.of(0.0, 10.0))
    acceleration_feedforward: float | None = parameter(
        "k_a", "inverse acceleration", NOT_NEGATIVE, "duty per profile's acceleration", PROGRAMS.of(0.0, 1.0))
    derivative_of: str | None = choice(("error", "measurement"), "what the derivative is of; absent: the error")
    derivative_ticks: float | None = parameter(
        "m", "number", AT_LEAST_ONE, "ticks for which a derivative is held", PROGRAMS.of(1.0, 1000.0))
    derivative_threshold: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "smaller changes have no derivative", PROGRAMS.of(0.0, 0.2))
    integral_limit: float | None = parameter(
        "", "number", NOT_NEGATIVE, "most duty of the integral; absent or 0: any", PROGRAMS.of(0.0, 10.0))
    anti_windup: float | None = parameter(
        "kappa", "angle", NOT_NEGATIVE, "error taken off per duty beyond a limit", PROGRAMS.of(0.0, 100.0))
    integral_at_rest: str | None = choice(("yes", "no"), "whether it integrates at rest alone; absent: no")
    rest_travel: float | None = parameter(
        "", "angle", POSITIVE, "less travel in derivative_ticks counts as rest", PROGRAMS.of(1e-06, 0.2))
    duty_quantum: float | None = parameter(
        "delta", "number", POSITIVE, "step of the duty; absent: none", PROGRAMS.of(1e-06, 0.1))
    whole_counts: str | None = choice(("yes", "no"), "whether it computes in whole counts and steps; absent: no")
    minimum_duty: float | None = parameter(
        "", "number", FRACTION, "added to any duty that is not 0", SHARE.of(0.0, 1.0))
    torque_limit: float | None = parameter(
        "", "number", FRACTION, "most duty that the loop asks for; absent: 1", SHARE.of(0.0, 1.0))
    duty_limit: float | None = parameter(
        "", "number", FRACTION, "most duty that the bridge gets; absent: 1", SHARE.of(0.0, 1.0))
    duty_slew: float | None = parameter(
        "", "rate", POSITIVE, "most change of the duty per time", PROGRAMS.of(0.1, 100000.0))
    current_limit: float | None = parameter(
        "I_m", "current", POSITIVE, "current that the duty is kept within", PROGRAMS.of(0.01, 100.0))
    current_sense: str | None = choice(("motor", "bus"), "which current that is; absent: the motor's")
    off_state: str | None = choice(
        ("brake", "diode", "coast"), "what the bridge does while it is off within a PWM period; absent: it brakes")
    torque_off_state: str | None = choice(("open", "brake"), "the bridge with torque off; absent: open")
    pulse_resolution: float | None = parameter(
        "q_t", "time", POSITIVE, "step in which a pulse is measured", PROGRAMS.of(1e-09, 0.0001))
    command_kind: str | None = choice(("pulse", "goal"), "what comes in: pulses, or goals on a bus; absent: pulses")
    bus_latency: float | None = parameter(
        "", "time", NOT_NEGATIVE, "from the write of a goal until it counts", PROGRAMS.of(0.0, 0.5))
    lower_goal: float | None = parameter("", "angle", ANY, "goals below are raised to it", TURNS.of(-20.0, 20.0))
    upper_goal: float | None = parameter("", "angle", ANY, "goals above are lowered to it", TURNS.of(-20.0, 20.0))
    speed_limit: float | None = parameter(
        "v", "output speed", POSITIVE, "most speed of the profile; absent: any", PROGRAMS.of(0.01, 200.0))
    acceleration_limit: float | None = parameter(
        "a", "angular acceleration", POSITIVE, "acceleration of the profile; absent: any", PROGRAMS.of(0.1, 100000.0))
    minimum_speed: float | None = parameter(
        "v_0", "output speed", NOT_NEGATIVE, "least speed of a profile on its way", PROGRAMS.of(0.0, 20.0))
    overload_duty: float | None = parameter(
        "", "number", FRACTION, "more duty starts the clock of the overload trip", SHARE.of(0.0, 1.0))
    overload_time: float | None = parameter("", "time", NOT_NEGATIVE, "after which it trips", PROGRAMS.of(0.0, 100.0))
    stall_travel: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "more travel starts that clock anew", PROGRAMS.of(0.0, 6.3))
    overload_output: float | None = parameter(
        "", "number", FRACTION, "most duty once tripped; 0: limp", SHARE.of(0.0, 1.0))
    overload_latches: str | None = choice(("yes", "no"), "whether only a power cycle ends the trip; absent: no")
    trip_current: float | None = parameter("", "current", POSITIVE, "current that trips", PROGRAMS.of(0.01, 100.0))
    trip_time: float | None = parameter(
        "", "time", NOT_NEGATIVE, "for which it has to flow on end", PROGRAMS.of(0.0, 100.0))
    trip_temperature: float | None = parameter(
        "", "temperature", POSITIVE, "housing temperature that trips", CELSIUS.of(290.0, 430.0))
    undervoltage: float | None = parameter(
        "", "voltage", POSITIVE, "bus voltage below which it stops or starts anew", PROGRAMS.of(0.5, 100.0))
    undervoltage_action: str | None = choice(("reset", "stop"), "what it does then; absent: it stops")
    restart_time: float | None = parameter("", "time", NOT_NEGATIVE, "that a reset takes", PROGRAMS.of(0.0, 10.0))
    signal_timeout: float | None = parameter(
        "", "time", POSITIVE, "without a command it acts as signal_loss says", PROGRAMS.of(0.001, 100.0))
    signal_loss: str | None = choice(("hold", "limp", "failsafe"), "what it does without a command; absent: hold")
    failsafe_angle: float | None = parameter(
        "", "angle", ANY, "goal without a command, where signal_loss is failsafe", TURNS.of(-20.0, 20.0))
    soft_start_duty: float | None = parameter(
        "", "number", FRACTION, "most duty just after power-up", SHARE.of(0.0, 1.0))
    soft_start_time: float | None = parameter(
        "", "time", NOT_NEGATIVE, "for so long after the first goal", PROGRAMS.of(0.0, 100.0))

    def _relations(self) -> Iterator[Relation]:
        yield from super()._relations()
        T_c, most = self.control_period, MOST_WAITING - 1
        for name, time in (("compute_delay", self.compute_delay), ("bus_latency", self.bus_latency)):
            if T_c is not None and time is not None:
                yield Relation(f"firmware.{name}", time <= most * T_c * (1.0 + _SLACK), time,
                               f"at most {most} times firmware.control_period", most * T_c)
        if self.derivative_ticks is not None:
            m = self.derivative_ticks
            yield Relation("firmware.derivative_ticks", m == m // 1, m, "a whole number")
        if self.whole_counts == "yes":
            yield from self._only_with("whole_counts", ("angle_quantum", "duty_quantum"))
        if self.integral_at_rest == "yes":
            yield from self._only_with("integral_at_rest", ("rest_travel",))
        if self.signal_loss == "failsafe":
            yield from self._only_with("signal_loss", ("failsafe_angle",))


# --- The parameter groups, by the tables of a servo file --------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class Motor(Group):
    """The DC motor, at its own shaft (paper, eq. 4-15)."""

    title = "motor"
    armature_resistance: float | None = parameter(
        "R_a", "resistance", POSITIVE, "armature resistance (7)", CATALOG.of(0.02, 200.0))
    armature_inductance: float | None = parameter(
        "L_a", "inductance", POSITIVE, "armature inductance (7)", CATALOG.of(1e-06, 0.05))
    torque_constant: float | None = parameter(
        "k_a", "torque per current", POSITIVE, "torque per current (4, 26)", CATALOG.of(0.02, 30.0))
    back_emf_constant: float | None = parameter(
        "k_b", "voltage per speed", POSITIVE, "back-EMF per speed (6, 24)", CATALOG.of(0.02, 30.0))
    rotor_inertia: float | None = parameter(
        "J_m", "inertia", POSITIVE, "inertia of rotor and first gear (10)", CATALOG.of(1e-07, 2.0))
    motor_viscous_friction: float | None = parameter(
        "B_m", "torque per speed", NOT_NEGATIVE, "viscous friction (10)", CATALOG.of(0.0, 1.0))
    brush_drop_voltage: float | None = parameter(
        "V_br", "voltage", NOT_NEGATIVE, "voltage lost at the brushes", THEORY.of(0.0, 3.0))


@dataclass(frozen=True, kw_only=True)
class Gear(Group):
    """The gear train (paper, eq. 16-22); the paper's n is 1/gear_reduction."""

    title = "gear"
    gear_reduction: float | None = parameter(
        "N = 1/n", "number", AT_LEAST_ONE, "motor turns per output turn (18)", CATALOG.of(1.0, 4000.0))
    backlash: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "total play between motor and output, at the output", THEORY.of(0.0, 0.2))
    output_inertia: float | None = parameter(
        "", "inertia", NOT_NEGATIVE, "inertia of gear wheel and horn", THEORY.of(0.0, 0.1))
    stiffness: float | None = parameter(
        "k_g", "torque per angle", POSITIVE, "stiffness between motor and output", THEORY.of(1.0, 100000.0))
    damping: float | None = parameter(
        "", "torque per speed", NOT_NEGATIVE, "damping beside that stiffness", THEORY.of(0.0, 100.0))

    def _relations(self) -> Iterator[Relation]:
        yield from self._only_with("damping", ("stiffness",))


_ONE_SHARE = ("load_friction", "load_friction_stribeck")
_TWO_SHARES = ("load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
               "load_friction_external_stribeck", "load_friction_motor_quad", "load_friction_external_quad")


@dataclass(frozen=True, kw_only=True)
class Friction(Group):
    """Dry friction of motor and gear (paper, eq. 37-41), at the motor shaft; both Coulomb torques are magnitudes.

    The friction behind the play is given at the output shaft.
    """

    title = "friction"
    coulomb_torque_forward: float | None = parameter(
        "F_ec1", "torque", NOT_NEGATIVE, "Coulomb torque forward (41)", CATALOG.of(0.0, 10.0))
    coulomb_torque_backward: float | None = parameter(
        "F_ec2", "torque", NOT_NEGATIVE, "Coulomb torque backward (41)", CATALOG.of(0.0, 10.0))
    zero_crossing_slope: float | None = parameter(
        "k", "inverse speed", POSITIVE, "slope of tanh at speed zero (41)", THEORY.of(0.01, 10000.0))
    breakaway_ratio: float | None = parameter(
        "r", "number", AT_LEAST_ONE, "static over Coulomb friction", THEORY.of(1.0, 10.0))
    stribeck_speed: float | None = parameter(
        "v_s", "speed", POSITIVE, "motor speed at which static friction fades", THEORY.of(0.0001, 100.0))
    stribeck_exponent: float | None = parameter(
        "alpha", "number", POSITIVE, "how sharply it fades", THEORY.of(0.1, 10.0))
    load_friction: float | None = parameter(
        "K_l", "number", NOT_NEGATIVE, "gear friction per torque through the gear", CATALOG.of(0.0, 3.0))
    load_friction_stribeck: float | None = parameter(
        "K_ls", "number", NOT_NEGATIVE, "its static part", CATALOG.of(0.0, 3.0))
    load_friction_motor: float | None = parameter(
        "K_m", "number", NOT_NEGATIVE, "gear friction per motor torque", CATALOG.of(0.0, 3.0))
    load_friction_external: float | None = parameter(
        "K_e", "number", NOT_NEGATIVE, "gear friction per load torque", CATALOG.of(0.0, 3.0))
    load_friction_motor_stribeck: float | None = parameter(
        "K_ms", "number", NOT_NEGATIVE, "static part of K_m", CATALOG.of(0.0, 3.0))
    load_friction_external_stribeck: float | None = parameter(
        "K_es", "number", NOT_NEGATIVE, "static part of K_e", CATALOG.of(0.0, 3.0))
    load_friction_motor_quad: float | None = parameter(
        "K_mq", "inverse torque", NOT_NEGATIVE, "quadratic in motor torque", THEORY.of(0.0, 100.0))
    load_friction_external_quad: float | None = parameter(
        "K_eq", "inverse torque", NOT_NEGATIVE, "quadratic in load torque", THEORY.of(0.0, 100.0))
    bearing_coulomb_torque: float | None = parameter(
        "T_o", "torque", NOT_NEGATIVE,
        "part of the Coulomb friction that stands behind the play, at the output shaft; absent: 0.06 of it",
        THEORY.of(0.0, 1.0))

    def _relations(self) -> Iterator[Relation]:
        yield from self._only_with("stribeck_exponent", ("stribeck_speed",))
        # Models M3 and M4 have one share for all torque through the gear, M5 and M6 one for each side of it.
        one = [name for name in _ONE_SHARE if getattr(self, name) is not None]
        two = [name for name in _TWO_SHARES if getattr(self, name) is not None]
        if one and two:
            yield Relation(f"friction.{two[0]}", False, getattr(self, two[0]),
                           f"not beside friction.{one[0]}, which belongs to another friction law")


@dataclass(frozen=True, kw_only=True)
class Potentiometer(Group):
    """The position sensor (paper, eq. 38; Table II)."""

    title = "potentiometer"
    feedback_gain: float | None = parameter(
        "p", "voltage per angle", POSITIVE, "voltage per output angle (38)", CATALOG.of(0.02, 10.0))
    feedback_offset: float | None = parameter(
        "b_o", "voltage", ANY, "voltage at output angle 0", CATALOG.of(-15.0, 15.0))
    backlash: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "total play between output and potentiometer", THEORY.of(0.0, 0.2))
    noise: float | None = parameter("", "voltage", NOT_NEGATIVE, "noise, rms", THEORY.of(0.0, 0.3))
    linearity_angle: tuple[float, ...] | None = table(
        "", "angle", "angles of the linearity table", TURNS.of(-20.0, 20.0))
    linearity_error: tuple[float, ...] | None = table(
        "", "voltage", "voltage added at these angles", THEORY.of(-3.0, 3.0))
    quantisation: float | None = parameter(
        "", "voltage per count", POSITIVE, "voltage per count", THEORY.of(1e-06, 0.1))
    fixed_angle: float | None = parameter(
        "", "angle", ANY,
        "angle at which a potentiometer off the shaft stands: the servo turns without end", TURNS.of(-20.0, 20.0))

    def _relations(self) -> Iterator[Relation]:
        angles, errors = self.linearity_angle, self.linearity_error
        if (angles is None) != (errors is None) or (angles and errors and len(angles) != len(errors)):
            yield Relation("potentiometer.linearity_error", False, errors,
                           "as many values as potentiometer.linearity_angle")
        if angles and any(b <= a for a, b in pairwise(angles)):
            yield Relation("potentiometer.linearity_angle", False, angles, "increasing angles")


@dataclass(frozen=True, kw_only=True)
class Electronics(Group):
    """Pulse-to-voltage converter, comparator and bridge (paper, eq. 38), and the chip at pulse level."""

    title = "electronics"
    less = (("pulse_width_min", "pulse_width_max"),)
    bridge_gain: float | None = parameter(
        "A", "voltage gain", POSITIVE, "gain of the bridge (38)", CATALOG.of(0.1, 10000.0))
    comparator_gain: float | None = parameter(
        "k_s", "voltage gain", POSITIVE, "gain of the comparator (38)", CATALOG.of(0.01, 1000.0))
    voltage_to_pulse_gain: float | None = parameter(
        "k_p1", "time per voltage", POSITIVE, "pulse per command voltage (38)", CATALOG.of(1e-05, 0.05))
    pulse_to_voltage_gain: float | None = parameter(
        "k_p2", "voltage per time", POSITIVE, "voltage per pulse width (38)", CATALOG.of(10.0, 100000.0))
    command_offset: float | None = parameter(
        "b_i", "voltage", ANY, "control voltage at command voltage 0", CATALOG.of(-15.0, 15.0))
    command_pulse_offset: float | None = parameter(
        "t_0", "time", ANY, "pulse width at command voltage 0", CATALOG.of(-0.01, 0.01))
    voltage_deadband: float | None = parameter(
        "w_v", "voltage", NOT_NEGATIVE, "full width of the deadband, averaged models", CATALOG.of(0.0, 1.0))
    frame_period: float | None = parameter("T_f", "time", POSITIVE, "period of the pulses", THEORY.of(0.0002, 0.2))
    deadband: float | None = parameter(
        "w", "time", NOT_NEGATIVE, "full width of the comparator's deadband", CATALOG.of(1e-07, 0.0005))
    stretcher_gain: float | None = parameter(
        "K", "number", POSITIVE, "drive time per pulse error", CATALOG.of(1.0, 5000.0))
    minimum_drive_time: float | None = parameter("t_min", "time", NOT_NEGATIVE, "shortest drive", THEORY.of(0.0, 0.01))
    stretcher_time_constant: float | None = parameter(
        "tau_s", "time", POSITIVE, "of an RC stretcher; absent: linear", THEORY.of(0.001, 1.0))
    off_state: str | None = choice(("brake", "coast"), "what the bridge does between drives")
    silence_state: str | None = choice(
        ("brake", "coast"), "what it does before the first pulse and after pulse_timeout; absent: as off_state")
    one_shot_offset: float | None = parameter(
        "T_0", "time", ANY, "width of the one-shot at feedback voltage 0", CATALOG.of(-0.01, 0.01))
    one_shot_slope: float | None = parameter(
        "1/s_r", "time per voltage", POSITIVE, "one-shot width per feedback voltage", CATALOG.of(1e-05, 0.05))
    back_emf_injection: float | None = parameter(
        "beta", "number", ANY, "share of the motor's voltage in the feedback", SHARE.of(-1.0, 1.0))
    supply_coupling: float | None = parameter(
        "c_s", "number", ANY, "share of a supply sag in the feedback", SHARE.of(-1.0, 1.0))
    pulse_timeout: float | None = parameter(
        "", "time", POSITIVE, "drive ends so long after the last pulse", THEORY.of(0.001, 30.0))
    pulse_width_min: float | None = parameter("", "time", POSITIVE, "shortest pulse accepted", CATALOG.of(1e-05, 0.02))
    pulse_width_max: float | None = parameter("", "time", POSITIVE, "longest pulse accepted", CATALOG.of(0.0001, 0.05))


@dataclass(frozen=True, kw_only=True)
class Supply(Group):
    """Battery or regulator, and what the bridge takes of it."""

    title = "supply"
    less = (("bridge_drop_voltage", "open_circuit_voltage"),)
    open_circuit_voltage: float | None = parameter(
        "V_oc", "voltage", POSITIVE, "voltage without load", CATALOG.of(0.5, 100.0))
    internal_resistance: float | None = parameter(
        "R_b", "resistance", NOT_NEGATIVE, "resistance of the source", THEORY.of(0.0, 20.0))
    bridge_drop_voltage: float | None = parameter(
        "V_ce0", "voltage", NOT_NEGATIVE, "constant drop of a conducting pair", THEORY.of(0.0, 5.0))
    bridge_drop_resistance: float | None = parameter(
        "r_c", "resistance", NOT_NEGATIVE, "resistance of a conducting pair", THEORY.of(0.0, 20.0))
    current_limit: float | None = parameter(
        "", "current", POSITIVE, "most that the source gives", THEORY.of(0.01, 100.0))

    @classmethod
    def of(cls, text: str, *, what: str = "supply") -> Supply:
        """Return the supply that a text names, such as "usb", "12V:0.1ohm" or "5V:0.5A".

        Parameters
        ----------
        text : str
            "usb" (5 V, 0.5 A), or a voltage and, each after a colon, resistance and limit of current; numbers without
            a unit are volts and ohms.
        what : str
            Name of the supply in an error.

        Raises
        ------
        InputError
            If it has another form.

        Examples
        --------
        >>> Supply.of("usb") == Supply.of("5V:0.5A"), Supply.of("12:0.15").internal_resistance
        (True, 0.15)
        """
        return cls(**supply_numbers(text, what))


@dataclass(frozen=True, kw_only=True)
class Stops(Group):
    """End stops of the output shaft."""

    title = "stops"
    less = (("lower_angle", "upper_angle"),)
    lower_angle: float | None = parameter("", "angle", ANY, "lowest output angle", TURNS.of(-20.0, 20.0))
    upper_angle: float | None = parameter("", "angle", ANY, "highest output angle", TURNS.of(-20.0, 20.0))
    restitution: float | None = parameter(
        "", "number", FRACTION, "speed after over speed before an impact", SHARE.of(0.0, 1.0))


_MASSES = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient")


@dataclass(frozen=True, kw_only=True)
class Thermal(Group):
    """Two thermal masses, winding and housing."""

    title = "thermal"
    winding_capacity: float | None = parameter("", "heat capacity", POSITIVE, "of the winding", THEORY.of(0.05, 500.0))
    housing_capacity: float | None = parameter("", "heat capacity", POSITIVE, "of the housing", THEORY.of(0.5, 5000.0))
    winding_to_housing: float | None = parameter(
        "", "thermal resistance", POSITIVE, "from winding to housing", THEORY.of(0.1, 500.0))
    housing_to_ambient: float | None = parameter(
        "", "thermal resistance", POSITIVE, "from housing to the air", THEORY.of(0.1, 500.0))
    ambient: float | None = parameter("", "temperature", POSITIVE, "temperature of the air", CELSIUS.of(200.0, 400.0))
    magnet_coefficient: float | None = parameter(
        "", "inverse temperature", ANY, "of k_a and k_b", THEORY.of(-0.02, 0.02))

    def _relations(self) -> Iterator[Relation]:
        # Heat is on with all four numbers of the two masses, and off with none.
        for name in _MASSES:
            yield from self._only_with(name, tuple(partner for partner in _MASSES if partner != name))
        yield from self._only_with("magnet_coefficient", _MASSES)


GROUPS: dict[str, type[Group]] = {
    group.title: group for group in (
        Motor, Gear, Friction, Electronics, Potentiometer, Firmware, Supply, Stops, Thermal)
}


def check_columns(group: str, values: Mapping[str, Any]) -> None:
    """Check the values of a group of which some are columns, one number per lane.

    Parameters
    ----------
    group : str
    values : mapping
        Value by field, None where absent; a column has shape (B,).

    Raises
    ------
    ParameterError
        If a value breaks its range, or two break their relation; names the lane where columns take part.
    """
    checked: Group = object.__new__(GROUPS[group])
    for f in fields(GROUPS[group]):
        value = values.get(f.name)
        if f.metadata["rule"] == "table":  # all lanes share it
            value = value if value is None else checked._checked(f.name, value, f.metadata)
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
            check_column(f"{group}.{f.name}", value, f.metadata["rule"], si_unit(f.metadata["dimension"]))
        elif isinstance(value, np.ndarray):
            options = f.metadata["rule"]
            Relation(f"{group}.{f.name}", np.isin(value, options), value, " or ".join(options)).check()
        elif value is not None:
            value = checked._checked(f.name, value, f.metadata)
        object.__setattr__(checked, f.name, value)
    for relation in checked._relations():
        relation.check()

_NAMED = {"usb": {"open_circuit_voltage": 5.0, "current_limit": 0.5}}  # what USB 2.0 gives a device that asked for it
_FORM = f"{', '.join(_NAMED)}, or VOLTS[:OHMS][:AMPERES], such as 12V:0.1ohm or 5V:0.5A"
_LETTERS = ("A", "mA")
_CAPACITORS = {"pF": 1e-12, "nF": 1e-9, "uF": 1e-6, "µF": 1e-6, "μF": 1e-6, "mF": 1e-3, "F": 1.0}
_START_CHARGE = 4e-3  # C, an excess of 0.2 A while a small motor starts, 20 ms


def supply_numbers(text: str, what: str) -> dict[str, float]:
    """Return the numbers of a supply by name (SI).

    Examples
    --------
    >>> supply_numbers("6V:100mohm:2A", "--supply")
    {'open_circuit_voltage': 6.0, 'internal_resistance': 0.1, 'current_limit': 2.0}
    """
    if text.strip().lower() in _NAMED:
        return dict(_NAMED[text.strip().lower()])
    volts, *rest = (part.strip() for part in text.split(":"))
    if number_and_unit(volts) is None:
        raise InputError(what, got=text, allowed=_FORM)
    found = {"open_circuit_voltage": quantity(what, volts, "voltage", bare=True, positive=True)}
    for part in rest:
        number, unit = number_and_unit(part) or (0.0, "")
        if unit in _CAPACITORS and number > 0.0:
            fall = _START_CHARGE / (number * _CAPACITORS[unit])
            raise InputError(what, got=text, allowed="a supply without a capacitor: the start of a motor takes some 4 "
                             f"mC (0.2 A for 20 ms), for which {part} falls by {fall:.2g} V; it cures spikes under a "
                             "millisecond, and no model here knows it")
        limits = unit in _LETTERS
        name = "current_limit" if limits else "internal_resistance"
        if not part or name in found or (limits and not number > 0.0):
            raise InputError(what, got=text, allowed=_FORM)
        found[name] = (quantity(what, part, "current", positive=True) if limits
                       else quantity(f"{what}: resistance", part, "resistance", bare=True))
    return found
