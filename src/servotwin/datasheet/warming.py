"""How warm a servo gets: the two thermal masses of its file, or ones assumed by its mass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin import loads
from servotwin.datasheet.full_drive import FullDrive, Swing
from servotwin.datasheet.holding import Held, at_temperatures, hold, warned_once
from servotwin.errors import InputError
from servotwin.parameters import printed_fact
from servotwin.physics import Temperatures, steady_temperatures, two_mass_temperatures
from servotwin.physics.thermal import REFERENCE_TEMPERATURE
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo


# --- How warm a servo gets: the two thermal masses of its file, or ones assumed by its mass ---------------------------

MAGNET_COEFFICIENT = -0.0015  # 1/K, assumed: -0.1 to -0.2 % per kelvin
HOT_WINDING = 373.15  # K, 100 °C: what "hot" means unless said otherwise
WIRE_LIMIT = 403.15  # K, 130 °C, class B of IEC 60085; assumed, as the class of a servo's wire is not printed
# Assumed by mass. Shares: 5 % of it is copper, the rest housing, motor and gear. Servos are bodies of one shape, so
# their time constants go as the cube root of mass; these are the middles of 10 to 30 s and 5 to 15 min, at 45 g.
_COPPER_SHARE, _COPPER, _BODY = 0.05, 385.0, 800.0  # 1, J/(kg K), J/(kg K)
_MIDDLE_MASS, _WINDING_TIME, _HOUSING_TIME = 0.045, math.sqrt(10.0 * 30.0), 60.0 * math.sqrt(5.0 * 15.0)  # kg, s, s
_LOOKS = 10


@dataclass(frozen=True, kw_only=True)
class Masses:
    """Winding and housing as two thermal masses.

    Parameters
    ----------
    winding_capacity, housing_capacity : float
        [J/K].
    winding_to_housing, housing_to_ambient : float
        [K/W].
    ambient : float
        [K].
    magnet_coefficient : float
        [1/K].
    assumed : bool
        Whether they were assumed by the servo's mass, and are not of its file.
    """

    winding_capacity: float
    housing_capacity: float
    winding_to_housing: float
    housing_to_ambient: float
    ambient: float = REFERENCE_TEMPERATURE
    magnet_coefficient: float = MAGNET_COEFFICIENT
    assumed: bool = True

    def after(self, time: float, heat: float, now: Temperatures) -> Temperatures:
        """Return the temperatures [K] after a time [s] of constant heat [W]."""
        then: Temperatures = two_mass_temperatures(
            time, heat, now.winding, now.housing, winding_capacity=self.winding_capacity,
            housing_capacity=self.housing_capacity, winding_to_housing=self.winding_to_housing,
            housing_to_ambient=self.housing_to_ambient, ambient=self.ambient)
        return then

    def with_winding(self, winding: float) -> Temperatures:
        """Return the temperatures [K] of a servo whose winding has come to rest at this one [K]."""
        per_watt = self.winding_to_housing + self.housing_to_ambient
        then: Temperatures = steady_temperatures(
            (winding - self.ambient) / per_watt, winding_to_housing=self.winding_to_housing,
            housing_to_ambient=self.housing_to_ambient, ambient=self.ambient)
        return then


@dataclass(frozen=True, kw_only=True)
class Warming:
    """A servo that holds a load for a while.

    Parameters
    ----------
    duration : float
        How long it held; less than asked for where it could not continue [s].
    now : Temperatures
        At the end [K].
    cold, warm : Held
        How it held at first and at the end; `warm.stands` is False where it gave way.
    limit_time : float
        When the winding passed 130 °C; nan where it did not [s].
    masses : Masses
    """

    duration: float
    now: Temperatures
    cold: Held
    warm: Held
    limit_time: float
    masses: Masses


def thermal_masses(servo: Servo) -> Masses | None:
    """Return the two thermal masses of a servo: its file's, else assumed by the mass on its sheet; None without both.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> masses = thermal_masses(load_servo("towerpro-mg996r"))
    >>> round(masses.housing_capacity, 1), round(masses.housing_to_ambient, 1), masses.assumed
    (41.8, 13.3, True)
    """
    given = servo.thermal
    if given.winding_capacity is not None:
        numbers = {name: getattr(given, name) for name in (
            "winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient", "ambient",
            "magnet_coefficient") if getattr(given, name) is not None}
        return Masses(**{"magnet_coefficient": 0.0, **numbers}, assumed=False)
    mass = printed_fact(servo.sheet, "mass")
    return None if mass is None else masses_by_mass(mass)


def masses_by_mass(mass: float) -> Masses:
    """Return what is assumed of a servo of this mass [kg].

    Examples
    --------
    >>> small, large = masses_by_mass(0.009), masses_by_mass(0.11)
    >>> round(small.winding_capacity * small.winding_to_housing, 1), round(
    ...     large.housing_capacity * large.housing_to_ambient / 60, 1)
    (10.1, 11.7)
    """
    C_w, C_h = _COPPER_SHARE * _COPPER * mass, (1.0 - _COPPER_SHARE) * _BODY * mass
    larger = (mass / _MIDDLE_MASS) ** (1.0 / 3.0)
    return Masses(winding_capacity=C_w, housing_capacity=C_h, winding_to_housing=_WINDING_TIME * larger / C_w,
                  housing_to_ambient=_HOUSING_TIME * larger / C_h)


def warmed(model: Model, masses: Masses, torque: float, *, inertia: float = 0.0, duration: float = 600.0) -> Warming:
    """Return how warm a servo gets while it holds a torque [N m], from one look at its pulses to the next.

    Heat is slow beside the pulses, so what two seconds of them say holds for the next minute.
    """
    step = duration / _LOOKS
    now = Temperatures(masses.ambient, masses.ambient)
    held = cold = hold(at_temperatures(model, now, masses.magnet_coefficient), torque, inertia=inertia)
    limit, time = math.nan, 0.0
    for _ in range(_LOOKS):
        if not held.stands:
            break
        after = masses.after(step, held.heat, now)
        if math.isnan(limit) and after.winding > WIRE_LIMIT:
            limit = time + _passing(masses, held.heat, now, step)
        now, time = Temperatures(float(after.winding), float(after.housing)), time + step
        held = hold(at_temperatures(model, now, masses.magnet_coefficient), torque, inertia=inertia)
    return Warming(duration=time, now=now, cold=cold, warm=held, limit_time=limit, masses=masses)


def _passing(masses: Masses, heat: float, now: Temperatures, step: float) -> float:
    """Return when within a step [s] the winding passes the limit of its wire."""
    from scipy.optimize import brentq

    return float(brentq(lambda t: float(masses.after(t, heat, now).winding) - WIRE_LIMIT, 0.0, step))


# --- Lifting a mass on an arm: whether, how fast, at which current, and how warm --------------------------------------

GRAVITY = 9.80665
_THIRTY = math.radians(30.0)


@dataclass(frozen=True, kw_only=True)
class Lift:
    """A servo with a mass on an arm that it turns up and down.

    Parameters
    ----------
    mass, arm : float
        Of the point mass [kg], at this distance [m] from the shaft; the arm itself weighs nothing.
    torque : float
        m g l, what the mass takes where the arm is horizontal, and most of all [N m].
    most_torque : float
        The most that the servo lifts, from rest [N m].
    blocked : float
        The servo does not lift while the arm is less than this below or above the horizontal; 0 where it lifts at
        all angles [rad].
    swing : Swing
        From 30° below the horizontal to 30° above at full drive, from rest; nan where it does not get there.
    held : Held
        With the arm horizontal.
    warming : Warming, optional
        After ten minutes of that; None where neither file nor sheet says what that depends on.
    """

    mass: float
    arm: float
    torque: float
    most_torque: float
    blocked: float
    swing: Swing
    held: Held
    warming: Warming | None

    @property
    def lifts(self) -> bool:
        """Whether the servo lifts the mass at all angles."""
        return self.blocked == 0.0

    @property
    def margin(self) -> float:
        """The most torque over the one that is asked for: above 1 it lifts."""
        return self.most_torque / self.torque


def check_lift(mass: float, arm: float) -> float:
    """Return m g l [N m] of a mass [kg] on an arm [m].

    Raises
    ------
    InputError
        If one of them is not positive.

    Examples
    --------
    >>> round(check_lift(0.5, 0.1), 4)
    0.4903
    """
    for name, value, unit in (("mass", mass, "kg"), ("arm", arm, "m")):
        if not (is_finite(value) and value > 0.0):
            raise InputError(f"lift {name}", got=value, allowed=f"a positive number [{unit}]")
    torque = mass * GRAVITY * arm
    if not (is_finite(torque) and torque > 0.0):
        raise InputError("lift", got=f"{mass:g} kg on {arm:g} m", allowed="a torque that a number holds")
    return torque


def pendulum(mass: float, arm: float, horizontal: float) -> loads.Pendulum:
    """Return a mass [kg] on an arm [m] that is horizontal at an angle [rad], and lifted towards +q."""
    return loads.Pendulum(mass=mass, length=arm, hanging_angle=horizontal - 0.5 * math.pi)


def swing_up(drive: FullDrive, mass: float, arm: float) -> Swing:
    """Return the turn of 60° through the horizontal, from rest at full drive."""
    return drive.swing(pendulum(mass, arm, 0.0), -_THIRTY, _THIRTY)


def lift_of(model: Model, mass: float, arm: float) -> Lift:
    """Return what a servo does with a mass [kg] on an arm [m].

    Raises
    ------
    InputError
        If mass or arm are not positive, or the model has no supply.

    Examples
    --------
    >>> import servotwin as st
    >>> lift = lift_of(st.PulseServo(st.load_servo("hitec-hs-755hb")), 0.5, 0.1)
    >>> lift.lifts, round(lift.margin, 1)
    (True, 3.4)
    """
    torque, inertia = check_lift(mass, arm), mass * arm * arm
    drive = FullDrive(model)
    most = min(drive.stall_torque, drive.starting_torque)
    blocked = math.acos(most / torque) if most < torque else 0.0
    masses = thermal_masses(model.servo)
    with warned_once():
        warming = None if masses is None else warmed(model, masses, torque, inertia=inertia)
        held = hold(model, torque, inertia=inertia) if warming is None else warming.cold
    return Lift(mass=mass, arm=arm, torque=torque, most_torque=most, blocked=blocked,
                swing=swing_up(drive, mass, arm), held=held, warming=warming)
