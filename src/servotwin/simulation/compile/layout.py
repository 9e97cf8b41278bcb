"""The words of what a program in C hands over at a tick, and of the simulator behind it; each has eight bytes."""

from __future__ import annotations

from servotwin.models.engine import cosim

VERSION = 1
GIVEN = ("pulse_width", "command_angle", "command_voltage", "external_torque", "set_output_angle", "set_output_speed",
         "set_load_inertia", "set_bus_voltage")
"""Addresses of what comes in, in the order of `engine.ticks`."""
SHOWN = ("output_angle", "output_speed", "load_torque", "armature_current", "bus_voltage", "supply_current")
"""Addresses of what goes out, those of the shaft first."""
TICK = ("version", "lanes", "duration", "simulator", *GIVEN, *SHOWN, "status")
"""Members of `struct servotwin_tick`, in their order."""

STAGES = ("clock", "accept", "change", "refit", "impose", "follow", "advance", "show", "look")
"""Calls of a tick: programs, each a list of chains of calls."""
HANDLE = ("lanes", "given", "has", "now", "status", "shaft", "seen", "fresh", "renew", *STAGES)
"""Words of a simulator: a number, and addresses."""

DONE = cosim.ACCEPTED
NOTHING_GIVEN, OTHER_VERSION, OTHER_LANES = range(1, 4)
NOT_RENEWED = 11
MESSAGES = {
    DONE: "done",
    NOTHING_GIVEN: "no struct, or no simulator in it",
    OTHER_VERSION: "the struct has another version",
    OTHER_LANES: "the struct has another number of lanes",
    cosim.BAD_DURATION: f"the duration is not a number of seconds from 0 to {cosim.LONGEST:.0e}",
    cosim.BAD_NUMBER: "a number is not finite",
    cosim.BAD_COMMAND: "a command is not possible, or more than one is given",
    cosim.BAD_ANGLE: "an angle is beyond a stop",
    cosim.BAD_INERTIA: "an inertia is negative",
    cosim.BAD_VOLTAGE: "a bus voltage is not positive, or is one that lanes share",
    cosim.BEYOND_RECORD: "a recorded torque ends before",
    NOT_RENEWED: "lanes that run in another way now could not be prepared",
}
"""Meanings of the numbers that a tick returns."""
