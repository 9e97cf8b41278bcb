"""A servo's sheet as it should have been: curves, holding, lifting and warming, and which servo lifts what."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servotwin.datasheet.choice import (
        Candidate,
        Lifter,
        Lifters,
        Limits,
        Reason,
        Refused,
        candidate,
        servos_that_lift,
        standing_of,
        travel_of,
    )
    from servotwin.datasheet.full_drive import FullDrive, OperatingPoint, SpeedCurve, Swing
    from servotwin.datasheet.holding import Buzz, Held, Remedy, Span, buzz
    from servotwin.datasheet.sheet import (
        Bandwidth,
        DataSheet,
        Figure,
        Motion,
        VoltageSheet,
        beside_flags,
        curves,
        motion_of,
        printed_beside,
    )
    from servotwin.datasheet.static_loop import Loop, Protection, Standing
    from servotwin.datasheet.turning import SpeedMap, slow_rotor, time_constant_of, wheel_speed_of
    from servotwin.datasheet.warming import Lift, Masses, Warming, lift_of, thermal_masses

__all__ = [
    "Bandwidth", "Buzz", "Candidate", "DataSheet", "Figure", "FullDrive", "Held", "Lift", "Lifter", "Lifters", "Limits",
    "Loop", "Masses", "Motion", "OperatingPoint", "Protection", "Reason", "Refused", "Remedy", "Span", "SpeedCurve",
    "SpeedMap", "Standing", "Swing", "VoltageSheet", "Warming", "beside_flags", "buzz", "candidate", "curves",
    "lift_of", "motion_of", "printed_beside", "servos_that_lift", "slow_rotor", "standing_of", "thermal_masses",
    "time_constant_of", "travel_of", "wheel_speed_of",
]

# public name -> file that defines it: `simulate` asks for ranges, and must not wait for what `curves` loads
_FILES = {
    **dict.fromkeys(("Candidate", "Lifter", "Lifters", "Limits", "Reason", "Refused", "candidate", "servos_that_lift",
                     "standing_of", "travel_of"), "choice"),
    **dict.fromkeys(("FullDrive", "OperatingPoint", "SpeedCurve", "Swing"), "full_drive"),
    **dict.fromkeys(("Buzz", "Held", "Remedy", "Span", "buzz"), "holding"),
    **dict.fromkeys(("Loop", "Protection", "Standing"), "static_loop"),
    **dict.fromkeys(("Bandwidth", "DataSheet", "Figure", "Motion", "VoltageSheet", "beside_flags", "curves",
                     "motion_of", "printed_beside"), "sheet"),
    **dict.fromkeys(("SpeedMap", "slow_rotor", "time_constant_of", "wheel_speed_of"), "turning"),
    **dict.fromkeys(("Lift", "Masses", "Warming", "lift_of", "thermal_masses"), "warming"),
}


def __getattr__(name: str) -> Any:
    if name in _FILES:
        return getattr(import_module(f"servotwin.datasheet.{_FILES[name]}"), name)
    raise AttributeError(f"module 'servotwin.datasheet' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
