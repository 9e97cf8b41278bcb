"""A servo's sheet as it should have been: curves, holding, lifting and warming, and which servo lifts what."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servotwin.datasheet.beside import Figure, Motion, beside_flags, motion_of, printed_beside
    from servotwin.datasheet.buzzing import Buzz, Remedy, buzz
    from servotwin.datasheet.choice import Candidate, Limits, Reason, candidate, standing_of, travel_of
    from servotwin.datasheet.curve import OperatingPoint, SpeedCurve
    from servotwin.datasheet.full_drive import FullDrive, Swing
    from servotwin.datasheet.guesses import Span
    from servotwin.datasheet.holding import Held
    from servotwin.datasheet.lift import Lift, lift_of
    from servotwin.datasheet.loop import Loop, Protection, Standing
    from servotwin.datasheet.rotor import slow_rotor, time_constant_of
    from servotwin.datasheet.sheet import Bandwidth, DataSheet, VoltageSheet, curves
    from servotwin.datasheet.turning import SpeedMap, wheel_speed_of
    from servotwin.datasheet.warming import Masses, Warming, thermal_masses
    from servotwin.datasheet.which import Lifter, Lifters, Refused, servos_that_lift

__all__ = [
    "Bandwidth", "Buzz", "Candidate", "DataSheet", "Figure", "FullDrive", "Held", "Lift", "Lifter", "Lifters", "Limits",
    "Loop", "Masses", "Motion", "OperatingPoint", "Protection", "Reason", "Refused", "Remedy", "Span", "SpeedCurve",
    "SpeedMap", "Standing", "Swing", "VoltageSheet", "Warming", "beside_flags", "buzz", "candidate", "curves",
    "lift_of", "motion_of", "printed_beside", "servos_that_lift", "slow_rotor", "standing_of", "thermal_masses",
    "time_constant_of", "travel_of", "wheel_speed_of",
]

# public name -> file that defines it: `simulate` asks for ranges, and must not wait for what `curves` loads
_FILES = {
    **dict.fromkeys(("Figure", "Motion", "beside_flags", "motion_of", "printed_beside"), "beside"),
    **dict.fromkeys(("Buzz", "Remedy", "buzz"), "buzzing"),
    **dict.fromkeys(("Candidate", "Limits", "Reason", "candidate", "standing_of", "travel_of"), "choice"),
    **dict.fromkeys(("OperatingPoint", "SpeedCurve"), "curve"), **dict.fromkeys(("FullDrive", "Swing"), "full_drive"),
    **dict.fromkeys(("Lift", "lift_of"), "lift"), **dict.fromkeys(("Loop", "Protection", "Standing"), "loop"),
    **dict.fromkeys(("slow_rotor", "time_constant_of"), "rotor"), "Held": "holding", "Span": "guesses",
    **dict.fromkeys(("Bandwidth", "DataSheet", "VoltageSheet", "curves"), "sheet"),
    **dict.fromkeys(("SpeedMap", "wheel_speed_of"), "turning"),
    **dict.fromkeys(("Masses", "Warming", "thermal_masses"), "warming"),
    **dict.fromkeys(("Lifter", "Lifters", "Refused", "servos_that_lift"), "which"),
}


def __getattr__(name: str) -> Any:
    if name in _FILES:
        return getattr(import_module(f"servotwin.datasheet.{_FILES[name]}"), name)
    raise AttributeError(f"module 'servotwin.datasheet' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
