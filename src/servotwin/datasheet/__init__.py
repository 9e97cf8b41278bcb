"""A servo's sheet as it should have been: curves, holding, lifting and warming, and which servo lifts what."""

from servotwin.datasheet.curve import OperatingPoint, SpeedCurve
from servotwin.datasheet.full_drive import FullDrive, Swing
from servotwin.datasheet.holding import Held
from servotwin.datasheet.lift import Lift, lift_of
from servotwin.datasheet.loop import Loop, Protection, Standing
from servotwin.datasheet.sheet import Bandwidth, DataSheet, VoltageSheet, curves
from servotwin.datasheet.turning import SpeedMap, wheel_speed_of
from servotwin.datasheet.warming import Masses, Warming, thermal_masses
from servotwin.datasheet.which import Lifter, Lifters, Refused, servos_that_lift

__all__ = [
    "Bandwidth", "DataSheet", "FullDrive", "Held", "Lift", "Lifter", "Lifters", "Loop", "Masses", "OperatingPoint",
    "Protection", "Refused", "SpeedCurve", "SpeedMap", "Standing", "Swing", "VoltageSheet", "Warming", "curves",
    "lift_of", "servos_that_lift", "thermal_masses", "wheel_speed_of",
]
