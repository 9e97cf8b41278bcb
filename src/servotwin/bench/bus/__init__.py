"""Servos on a wire that tell where they are: Feetech and Dynamixel, through the makers' own packages."""

from servotwin.bench.bus.bus import Bus, BusEvent, BusRig, columns_of, rig_of
from servotwin.bench.bus.families import MODELS, BusFamily, BusModel
from servotwin.bench.bus.scan import BAUDS, IDS, FoundServo, scan, wire_of
from servotwin.bench.bus.sdk_wire import Answer, BusWire

__all__ = ["BAUDS", "IDS", "MODELS", "Answer", "Bus", "BusEvent", "BusFamily", "BusModel", "BusRig", "BusWire",
           "FoundServo", "columns_of", "rig_of", "scan", "wire_of"]
