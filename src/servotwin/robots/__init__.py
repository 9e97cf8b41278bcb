"""Servos in robots: at the joints of MuJoCo models, in environments, and the motions that they follow."""

from servotwin.robots.drive import ServoDrive
from servotwin.robots.mount import Mount
from servotwin.robots.record import Record, ServoRecord
from servotwin.robots.state import DriveState

__all__ = ["DriveState", "Mount", "Record", "ServoDrive", "ServoRecord"]
