"""Torque, speed, current, power and efficiency of a servo at full drive, at one voltage and one temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.datasheet.full_drive import FullDrive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.models import Model
    from servotwin.physics.thermal import Temperatures

    Array = NDArray[np.float64]

POINTS = 121
_SIXTY = np.pi / 3.0


class OperatingPoint(NamedTuple):
    """A steady motion at full drive: torque [N m], speed [rad/s], current [A], power [W] and efficiency [1]."""

    torque: float
    speed: float
    current: float
    power: float
    efficiency: float


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpeedCurve:
    """What a servo does at full drive, from standing still to turning freely.

    Parameters
    ----------
    drive : FullDrive
        What all follows from: any other point, and torques and currents at both ends.
    temperatures : Temperatures
        Of winding and housing [K].
    speed : ndarray, shape (n,)
        Rising from 0 to the speed without load [rad/s].
    torque : ndarray, shape (n,)
        Against which the shaft turns so fast [N m].
    current : ndarray, shape (n,)
        Of the supply, and of the motor [A].
    power : ndarray, shape (n,)
        Given to the load [W].
    efficiency : ndarray, shape (n,)
        That power over what the servo takes at its plug [1].
    """

    drive: FullDrive
    temperatures: Temperatures
    speed: Array
    torque: Array
    current: Array
    power: Array
    efficiency: Array

    def __repr__(self) -> str:
        return (f"SpeedCurve({self.drive.model!r}, stall {self.stall_torque:.3g} N m, "
                f"no load {self.no_load_speed:.3g} rad/s)")

    @property
    def stall_torque(self) -> float:
        """The most torque against which the shaft still turns [N m]."""
        return self.drive.stall_torque

    @property
    def stall_current(self) -> float:
        """Current of the standing servo at full drive [A]."""
        return self.drive.stall_current

    @property
    def no_load_speed(self) -> float:
        """Speed of the free shaft [rad/s]."""
        return self.drive.no_load_speed

    @property
    def no_load_current(self) -> float:
        """Current while the shaft turns freely [A]."""
        return float(self.current[-1])

    @property
    def time_60(self) -> float:
        """Time for 60 degrees at the speed without load, as sheets print it [s]."""
        return _SIXTY / self.no_load_speed

    @property
    def most_power(self) -> OperatingPoint:
        """The point of this curve at which the load is given most power."""
        return self._point(int(np.argmax(self.power)))

    @property
    def best_efficiency(self) -> OperatingPoint:
        """The point of this curve of the best efficiency."""
        return self._point(int(np.argmax(self.efficiency)))

    def at(self, torque: float) -> OperatingPoint:
        """Return the steady motion against a torque [N m]; of speed 0 from the stall torque on."""
        speed = self.drive.speed(torque)
        current, power = self.drive.current(speed), torque * speed
        taken = self.drive.bus_voltage(speed) * current
        return OperatingPoint(torque, speed, current, power, power / taken if taken > 0.0 else 0.0)

    def _point(self, k: int) -> OperatingPoint:
        return OperatingPoint(*(float(values[k]) for values in (
            self.torque, self.speed, self.current, self.power, self.efficiency)))


def speed_curve(model: Model, temperatures: Temperatures) -> SpeedCurve:
    """Return the curve of a model whose resistance and magnets are those at these temperatures [K]."""
    drive = FullDrive(model)
    speed = np.linspace(0.0, drive.no_load_speed, POINTS)
    torque = np.array([*(drive.torque(w) for w in speed[:-1].tolist()), 0.0])
    current = np.array([drive.current(w) for w in speed.tolist()])
    volts = np.array([drive.bus_voltage(w) for w in speed.tolist()])
    power = torque * speed
    taken = volts * current
    efficiency = np.divide(power, taken, out=np.zeros_like(power), where=taken > 0.0)
    for values in (speed, torque, current, power, efficiency):
        values.setflags(write=False)
    return SpeedCurve(drive=drive, temperatures=temperatures, speed=speed, torque=torque, current=current, power=power,
                      efficiency=efficiency)
