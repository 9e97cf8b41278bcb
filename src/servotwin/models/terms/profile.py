"""The profile of a digital servo: where its reference is on the way to a goal, at limited speed and acceleration."""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.terms.firmware import Firmware
from servotwin.physics.firmware import NEARLY, braking_distance


def present(firmware: Firmware) -> bool:
    """Tell whether the reference takes time to get to a goal."""
    return firmware.v < math.inf or firmware.a < math.inf


def follow(firmware: Firmware, firm: Any) -> None:
    """Let the reference go on by a tick."""
    if not present(firmware):
        firm.r, firm.rate = firm.goal, 0.0
        return
    T_c, rest = firmware.T_c, firm.goal - firm.r
    way = math.copysign(1.0, rest)
    speed, change = abs(firm.rate), firmware.a * T_c
    S = braking_distance(speed, firmware.a, T_c)
    if firm.on_course == 0 and way * firm.rate >= 0.0 and S <= abs(rest) * (1.0 + NEARLY):
        firm.on_course = 1
    if firm.on_course == 0:  # it brakes, goes too far, and comes back
        speed = speed - change if speed - change > firmware.v_0 + NEARLY * change else 0.0
        firm.rate = math.copysign(speed, firm.rate)
        firm.r += firm.rate * T_c
        return
    speed = max(speed - change, 0.0) if S >= abs(rest) * (1.0 - NEARLY) else min(speed + change, firmware.v)
    speed = max(speed, firmware.v_0)
    if speed * T_c >= abs(rest) * (1.0 - NEARLY):
        firm.r, firm.rate = firm.goal, 0.0
    else:
        firm.rate = way * speed
        firm.r += firm.rate * T_c
