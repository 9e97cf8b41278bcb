"""Servos on a wire: twins that answer where programs look for Feetech's and Dynamixel's servos."""

from servotwin.wire.bus import KINDS, Bus, Counts, Fault, Faults, read_faults
from servotwin.wire.twins import Seen

__all__ = ["KINDS", "Bus", "Counts", "Fault", "Faults", "Seen", "read_faults"]
