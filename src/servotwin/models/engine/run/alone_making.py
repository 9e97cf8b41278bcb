"""A servo alone, made of what is given of it and of what hangs on its shaft."""

from __future__ import annotations

import math

from servotwin.models.engine.demands import demanded
from servotwin.models.engine.run.alone import Alone
from servotwin.models.terms import chip, firmware, packing, wiring
from servotwin.models.terms.chip import NO_CHIP
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.given import Given
from servotwin.models.terms.hung import Hung
from servotwin.physics.pieces import Piece


def asks(servo: Alone, own: Firmware) -> int:
    """Return all that a servo asks of the code that follows it: flags of `terms.dependence`."""
    return demanded(servo.plant, servo.chip, own, Piece())


def pulsed(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return an analog servo behind its bridge; `error` is that of its table where its feedback stands [V]."""
    numbers = packing.pulsed(given, hung, error)
    return Alone(numbers, chip.pack(given, math.nan), wiring.pulsed(given, math.nan), given.gear_gear_reduction, torque,
                 numbers.heat.T_amb, accuracy)


def digital(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return a digital servo behind its bridge, without its program."""
    numbers = packing.digital(given, hung, error)
    return Alone(numbers, NO_CHIP, wiring.digital(given, math.nan), given.gear_gear_reduction, torque,
                 numbers.heat.T_amb, accuracy)


def bounded(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return a servo whose voltage follows the error between its bounds."""
    numbers = packing.bounded(given, hung)
    return Alone(numbers, NO_CHIP, wiring.bounded(given), given.gear_gear_reduction, torque, numbers.heat.T_amb,
                 accuracy)


def averaged(given: Given, hung: Hung, error: float, torque: float, accuracy: float) -> Alone:
    """Return a servo whose voltage follows the error without bound."""
    numbers = packing.averaged(given, hung)
    return Alone(numbers, NO_CHIP, wiring.averaged(given), given.gear_gear_reduction, torque, numbers.heat.T_amb,
                 accuracy)


def program(given: Given) -> Firmware:
    """Return the program of a digital servo."""
    return firmware.pack(given, math.nan)
