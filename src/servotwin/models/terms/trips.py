"""The protections of a digital servo: overload, current, heat, supply; what they leave of the duty."""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.terms.firmware import Firmware
from servotwin.physics.firmware import NEARLY

NONE, OVERLOAD, CURRENT, HEAT, UNDERVOLTAGE = range(5)  # as `trip` shows them
OFF = -1.0  # of a clock that does not run
COOLER = 5.0  # K below its trip it goes on again


def acting(firm: Any) -> int:
    """Return which protection acts; of several the one that comes last in the list."""
    if firm.starved != 0:
        return UNDERVOLTAGE
    if firm.hot != 0:
        return HEAT
    if firm.tripped != 0:
        return CURRENT
    return OVERLOAD if firm.overloaded != 0 else NONE


def stop(firm: Any) -> bool:
    """Tell whether heat or supply stop it: no duty, and the shaft is where it shall be."""
    return bool(firm.hot != 0 or firm.starved != 0)


def allowed(firmware: Firmware, firm: Any) -> float:
    """Return how much duty the protections leave."""
    if stop(firm):
        return 0.0
    return firmware.overload_output if firm.overloaded != 0 else math.inf


def judge(firmware: Firmware, firm: Any, w: float, limp: bool, i: float, V_bus: float, T_h: float) -> None:
    """Look, after the loop has asked for a duty w, at all that is protected: duty, current, voltage, temperature."""
    if firmware.overload_duty < math.inf:
        _judge_overload(firmware, firm, w, limp)
    _judge_current(firmware, firm, i)
    if T_h > firmware.trip_temperature:
        firm.hot = 1
    elif T_h <= firmware.trip_temperature - COOLER:
        firm.hot = 0
    firm.starved = 1 if V_bus < firmware.undervoltage else 0


def _judge_current(firmware: Firmware, firm: Any, i: float) -> None:
    """Too much current for too long makes it limp until the next goal."""
    if not abs(i) >= firmware.trip_current:
        firm.current_clock = OFF
        return
    firm.current_clock = 0.0 if firm.current_clock < 0.0 else firm.current_clock + firmware.T_c
    if firm.current_clock >= firmware.trip_time - NEARLY * firmware.T_c:
        firm.tripped, firm.current_clock = 1, OFF


def _judge_overload(firmware: Firmware, firm: Any, w: float, limp: bool) -> None:
    """Too much duty for too long, at a standstill, and there is less of it until less is asked for."""
    eased = w * firm.overload_sign < firmware.overload_output * (1.0 - NEARLY)
    if firm.overloaded != 0:
        if firmware.latches > 0.0 or not (eased or firm.torque == 0):
            return
        firm.overloaded = 0
    if firm.overload_clock >= 0.0:
        firm.overload_clock += firmware.T_c
        if eased or limp:
            firm.overload_clock = OFF
        elif abs(firm.y - firm.overload_y) > firmware.stall_travel * (1.0 + NEARLY):
            _start(firm, w)
    if firm.overload_clock < 0.0 and abs(w) > firmware.overload_duty * (1.0 + NEARLY):
        _start(firm, w)
    if firm.overload_clock >= firmware.overload_time - NEARLY * firmware.T_c:
        firm.overloaded, firm.overload_clock = 1, OFF


def _start(firm: Any, w: float) -> None:
    firm.overload_clock, firm.overload_y, firm.overload_sign = 0.0, firm.y, 1.0 if w > 0.0 else -1.0
