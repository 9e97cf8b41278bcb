"""The current of a standing digital servo at a duty, and where the travel of a servo has its middle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin import signals
from servotwin.errors import InputError
from servotwin.models.digital import DigitalServo
from servotwin.models.engine.dynamics import currents
from servotwin.models.terms import duty
from servotwin.physics.firmware import duty_for_bus_current, duty_for_motor_current

if TYPE_CHECKING:
    from servotwin.models.base import Model
    from servotwin.models.terms.firmware import Firmware
    from servotwin.models.terms.numbers import Numbers


# --- The current of a standing digital servo at a duty, its limit of current included ---------------------------------

_ROUNDS = 30  # until a soft supply and a limit of current agree


def standing_current(numbers: Numbers, firmware: Firmware, d: float) -> float:
    """Return the current [A] of a motor that stands, at a duty that is asked for.

    Parameters
    ----------
    numbers : Numbers
        Of the plant, as at full duty.
    firmware : Firmware
        Firmware of which the limit of current holds, if it has one.
    d : float
        [1]
    """
    i = _at(numbers, d)
    if not firmware.I_m < math.inf:
        return i
    path, source = numbers.bridge, numbers.source
    R = path.R_drive - source.R_b
    V_bus, given = source.V, abs(d)
    for _ in range(_ROUNDS):
        most = (duty_for_bus_current(firmware.I_m, 0.0, R, V_bus, 1.0) if firmware.senses_bus > 0.0 else
                duty_for_motor_current(firmware.I_m, 0.0, R, V_bus))
        given = min(abs(d), most)
        i = _at(numbers, math.copysign(given, d))
        V_bus = max(source.V - source.R_b * duty.share_of(path, given) * abs(i), 0.5 * source.V)
    return i


def _at(numbers: Numbers, d: float) -> float:
    if d == 0.0:
        return 0.0
    plant = duty.at_duty(numbers, d)
    return math.copysign(currents.stall_current(plant, plant.source.V), d)


# --- Where the travel of a servo has its middle -----------------------------------------------------------------------

_NEUTRAL = 1500.0  # us


def mid_travel(model: Model) -> float:
    """Return the angle in the middle of a servo's travel.

    Parameters
    ----------
    model : Model
        Of a servo; a motor has no travel.

    Returns
    -------
    float
        Half-way between the end stops; where the servo lacks one, the angle of a pulse of 1500 us, and on a bus that
        of the goal 0, the middle of its counts [rad].

    Raises
    ------
    InputError
        If the model is that of a motor.

    Examples
    --------
    >>> import math, servotwin as st
    >>> round(math.degrees(mid_travel(st.PulseServo(st.load_servo("hitec-hs-755hb")))), 9)
    90.0
    """
    if "command_angle" not in model.signals:
        raise InputError(f"middle of the travel of {type(model).__name__}",
                         allowed="a model of a servo, not of a motor")
    lower, upper = model.servo.stops.lower_angle, model.servo.stops.upper_angle
    if lower is not None and upper is not None:
        return 0.5 * (lower + upper)
    if isinstance(model, DigitalServo) and model.takes_goals:
        return float(model.start_angle(0.0))
    return float(model.start_angle(model.command(signals.constant(_NEUTRAL, unit="us")).table[0].value))
