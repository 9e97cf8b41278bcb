"""Motor and gear: what a sheet prints, or what acts at the output shaft, and R, k_a, k_b and friction from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from servotwin.parameters import Servo
from servotwin.parameters.output_side import OUTPUT_SIDE, N, motor_side, output_value
from servotwin.studies.joint import TINY, Column, Coordinate, Joint, number, own_spread
from servotwin.studies.kinds import Choice
from servotwin.studies.sheet_numbers import SheetNumbers, sheet_numbers

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
