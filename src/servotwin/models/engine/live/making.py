"""A servo at a bench, made of what is given of it and of what hangs on its shaft."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.loads.parts import STANDARD_GRAVITY
from servotwin.models.engine.live.posts import Follow, put_chip, put_follow, put_lines, put_numbers
from servotwin.models.engine.live.screen import Lines
from servotwin.models.state.records import record_reader, record_writer
from servotwin.models.terms import chip, firmware, packing, wiring
from servotwin.models.terms.chip import NO_CHIP
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware, takes_goals
from servotwin.models.terms.given import Given, either, is_given
from servotwin.models.terms.hung import Hung, inertia_on
from servotwin.models.terms.sensor import stands

AVERAGED, BOUNDED, PULSED, DIGITAL = range(4)
FAMILIES = {"AveragedServo": AVERAGED, "AveragedServoInductive": AVERAGED, "BoundedServo": BOUNDED,
            "PulseServo": PULSED, "PulseServoInductive": PULSED, "DigitalServo": DIGITAL}
"""Which models are made alike."""
MADE, NO_INERTIA = 0, 1  # how it ends
_NONE = Follow(0.0, 0.0)


class Weights(NamedTuple):
    """What hangs on a shaft at a bench (SI); `torque` pushes towards smaller angles."""

    inertia: float
    viscous_friction: float
    torque: float
    coulomb_torque: float
    mass: float  # at the end of an arm
    arm: float  # length of it
    hanging_angle: float


given_in = record_reader("given_in", Given)
weights_in = record_reader("weights_in", Weights)
put_program = record_writer("put_program", Firmware)


def make(post: Any, program: Any, family: int, given: Given, weights: Weights) -> int:
    """Make a servo; return `MADE`, or what forbids it: then it is what it was."""
    hung = hung_of(weights)
    if (given.gear_backlash > 0.0 or given.gear_stiffness > 0.0) and not inertia_on(given, hung) > 0.0:
        return NO_INERTIA
    if family == PULSED:
        put_numbers(post.numbers, packing.pulsed(given, hung, 0.0))
    elif family == DIGITAL:
        put_numbers(post.numbers, packing.digital(given, hung, 0.0))
    elif family == BOUNDED:
        put_numbers(post.numbers, packing.bounded(given, hung))
    else:
        put_numbers(post.numbers, packing.averaged(given, hung))
    post.pulsed = 1 if family == PULSED or (family == DIGITAL and not takes_goals(given)) else 0
    put_chip(post.chip, chip.pack(given, math.nan) if family == PULSED else NO_CHIP)
    put_program(program, firmware.pack(given, math.nan) if family == DIGITAL else NO_FIRMWARE)
    _tell(post, family, given)
    post.torque = weights.torque
    return MADE


def hung_of(weights: Weights) -> Hung:
    """Return a load as servos are made of it."""
    return Hung(weights.inertia + weights.mass * weights.arm * weights.arm, weights.viscous_friction,
                weights.coulomb_torque, 0.0, 0.0, weights.mass * STANDARD_GRAVITY * weights.arm, weights.hanging_angle,
                0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _tell(post: Any, family: int, given: Given) -> None:
    """Note how a servo follows commands, and where it may begin."""
    angle, width, voltage = _NONE, _NONE, _NONE
    has_gain = is_given(given.electronics_voltage_to_pulse_gain)
    post.lowest, post.highest = -math.inf, math.inf
    if family == DIGITAL and takes_goals(given):
        angle = Follow(1.0, 0.0)
    elif family == DIGITAL or family == PULSED:
        told = family == PULSED or (is_given(given.electronics_one_shot_slope)
                                    and is_given(given.potentiometer_feedback_gain))
        width = Follow(1.0, 0.0) if told else _NONE
        if told and not stands(given):
            angle = _line(wiring.pulse_of_angle(given))
            voltage = _line(wiring.pulse_of_voltage(given)) if has_gain else _NONE
    else:
        averaged = family == AVERAGED
        angle = _line(wiring.feedback_line(given))
        width = _line(wiring.averaged_by_pulse(given) if averaged else wiring.bounded_by_pulse(given))
        if has_gain:
            voltage = _line(wiring.averaged_by_voltage(given) if averaged else wiring.bounded_by_voltage(given))
    if family != AVERAGED:
        post.lowest = either(given.stops_lower_angle, -math.inf)
        post.highest = either(given.stops_upper_angle, math.inf)
    if family == DIGITAL:
        post.lowest = max(post.lowest, either(given.firmware_lower_goal, -math.inf))
        post.highest = min(post.highest, either(given.firmware_upper_goal, math.inf))
    put_follow(post.width, width)
    put_follow(post.angle, angle)
    put_follow(post.voltage, voltage)
    put_lines(post.lines, Lines(_slope(voltage), _start(voltage), _slope(angle), _start(angle), _slope(width),
                                _start(width), either(given.gear_gear_reduction, 1.0)))


def _line(gain_and_offset: tuple[float, float]) -> Follow:
    return Follow(gain_and_offset[0], gain_and_offset[1])


def _slope(line: Follow) -> float:
    """Return by how much a command changes with what the servo follows; 0 where it takes none."""
    return 1.0 / line.gain if line.gain != 0.0 else 0.0


def _start(line: Follow) -> float:
    """Return the command where what the servo follows is 0."""
    return -line.offset / line.gain if line.gain != 0.0 else 0.0
