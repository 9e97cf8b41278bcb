"""Servos on a wire: twins that answer where programs look for Feetech's and Dynamixel's servos."""

from servotwin.wire.bus import Bus, Counts
from servotwin.wire.crew import Seen
from servotwin.wire.faults import KINDS, Fault, Faults, read_faults

__all__ = ["KINDS", "Bus", "Counts", "Fault", "Faults", "Seen", "read_faults"]
