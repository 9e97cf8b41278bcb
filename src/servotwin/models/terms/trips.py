"""The protections of a digital servo: overload, current, heat, supply; what they leave of the duty."""

from __future__ import annotations

from typing import Any

from servotwin.models.terms.firmware import Firmware
from servotwin.physics.firmware import NEARLY

NONE, OVERLOAD, CURRENT, HEAT, UNDERVOLTAGE = range(5)  # as `trip` shows them
OFF = -1.0  # of a clock that does not run
COOLER = 5.0  # K below its trip it goes on again


def judge_supply(firmware: Firmware, firm: Any, V_bus: float, T_h: float) -> None:
    """Look at the voltage of the bus [V] and the temperature of the housing [K]."""
    firm.starved = 1 if V_bus < firmware.undervoltage else 0
    if T_h > firmware.trip_temperature:
        firm.hot = 1
    elif T_h < firmware.trip_temperature - COOLER:
        firm.hot = 0


def judge_current(firmware: Firmware, firm: Any, i: float) -> None:
    """Look at the current [A]: too much for too long makes it limp until the next goal."""
    if not abs(i) >= firmware.trip_current:
        firm.current_clock = OFF
        return
    firm.current_clock = 0.0 if firm.current_clock < 0.0 else firm.current_clock + firmware.T_c
    if firm.current_clock >= firmware.trip_time - NEARLY * firmware.T_c:
        firm.tripped, firm.current_clock = 1, OFF


def judge_overload(firmware: Firmware, firm: Any, w: float) -> None:
    """Look at the duty w that the loop asks for: too much for too long, at a standstill, and there is less of it."""
    eased = w * firm.overload_sign < firmware.overload_output * (1.0 - NEARLY)
    if firm.overloaded != 0:
        if firmware.latches == 0.0 and eased:
            firm.overloaded = 0
        return
    if firm.overload_clock >= 0.0:
        firm.overload_clock += firmware.T_c
        if eased:
            firm.overload_clock = OFF
        elif abs(firm.y - firm.overload_y) > firmware.stall_travel * (1.0 + NEARLY):
            _start(firm, w)
    if firm.overload_clock < 0.0 and abs(w) > firmware.overload_duty * (1.0 + NEARLY):
        _start(firm, w)
    if firm.overload_clock >= firmware.overload_time - NEARLY * firmware.T_c:
        firm.overloaded, firm.overload_clock = 1, OFF


def ease(firmware: Firmware, firm: Any) -> None:
    """Let go of the shaft: nothing is asked for, so that an overload is over, unless its trip leaves no duty at all."""
    firm.overload_clock = OFF
    if firmware.latches == 0.0 and firmware.overload_output > 0.0:
        firm.overloaded = 0


def _start(firm: Any, w: float) -> None:
    firm.overload_clock, firm.overload_y, firm.overload_sign = 0.0, firm.y, 1.0 if w > 0.0 else -1.0
