"""Lifting a mass on an arm: whether, how fast, at which current, and how warm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin import loads
from servotwin.datasheet.conditions import warned_once
from servotwin.datasheet.full_drive import FullDrive, Swing
from servotwin.datasheet.holding import Held, hold
from servotwin.datasheet.warming import Warming, thermal_masses, warmed
from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.models import Model

GRAVITY = 9.80665
_THIRTY = math.radians(30.0)


@dataclass(frozen=True, kw_only=True)
class Lift:
    """What a servo does with a mass on an arm that it turns up and down.

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
