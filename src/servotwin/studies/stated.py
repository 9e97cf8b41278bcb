"""What a servo file states of its own spread, and how parameters follow from what is drawn of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from servotwin.studies.calibration_joint import CalibrationJoint
from servotwin.studies.joint import Column, Coordinate, own_spread
from servotwin.studies.kinds import Distribution
from servotwin.studies.motor_joint import MotorJoint

if TYPE_CHECKING:
    from servotwin.models import Model


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
