"""What a servo does that a recipe of MuJoCo's actuators has to copy: what it lifts, and how far a load pulls it off."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import loads, signals
from servotwin.datasheet.conditions import changed
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.lift import GRAVITY
from servotwin.errors import InputError
from servotwin.models import AveragedServo, BoundedServo, mid_travel
from servotwin.simulation.simulator import simulate

if TYPE_CHECKING:
    from servotwin.models import Model

Array = NDArray[np.float64]
WAY, REST, RAMP, SETTLE = math.radians(60.0), 0.3, 1.6, 1.4  # rad, s: a goal stands, comes slowly, and stands
LAST = 20  # of 0.01 s, over which what pulses do to a shaft that stands is averaged
_ARM = 0.1  # m
_GONE = ("stops.lower_angle", "stops.upper_angle", "potentiometer.noise")


class Droops(NamedTuple):
    """Commanded less actual angle under a load that pulls down, where the shaft has come up, and down, slowly [rad]."""

    up: float
    down: float


def without_ends(model: Model) -> Model:
    """Return a model without stops, which would hold what the servo does not, and without noise."""
    return changed(model, {name: None for name in _GONE if model.servo.get(name) is not None})


def eased(time: Array, way: float) -> Array:
    """Return a goal [rad] that goes half a way below 0 to half a way above, slowly, and stands there."""
    return np.asarray(-0.5 * way * np.cos(math.pi * np.clip((time - REST) / RAMP, 0.0, 1.0)))


def inertia_under(torque: float) -> float:
    """Return the inertia of a mass on an arm of 0.1 m whose weight makes a torque [kg m²]."""
    return torque * _ARM / GRAVITY


def lift_of_twin(model: Model) -> float:
    """Return the most torque that a servo lifts from rest, as `curves` has it [N m]."""
    drive = FullDrive(BoundedServo(model.servo) if isinstance(model, AveragedServo) else model)
    return float(min(drive.stall_torque, drive.starting_torque))


def droops_of_twin(model: Model, torque: float, inertia: float) -> Droops:
    """Return where a servo stands under a torque [N m] with an inertia [kg m²] at its goal.

    Raises
    ------
    InputError
        If it does not hold so much for as long as that takes.
    """
    free, middle, time = without_ends(model), mid_travel(model), np.arange(0.0, REST + RAMP + SETTLE, 0.01)
    found = []
    for way in (WAY, -WAY):
        goal = middle + 0.5 * way
        result = simulate(free, signals.samples(time, middle + eased(time, way), unit="rad", hold="linear"),
                          duration=REST + RAMP + SETTLE, output_step=0.01,
                          load=loads.Constant(torque) + loads.Inertia(inertia))
        trips = [remark.kind for remark in result.remarks if remark.kind.startswith("tripped")]
        last = result["output_angle"][-LAST:]
        if trips or not result.status.ok or abs(goal - last[-1]) > 0.75 * WAY:
            raise InputError(f"load of a recipe of {model.servo.name}", got=f"{torque:.3g} N m, under which it "
                             f"{'is ' + trips[0] if trips else 'does not come up'}", allowed="less [N m]")
        found.append(goal - float(last.mean()))
    return Droops(*found)
