"""What events are called: by a number in compiled code, by words everywhere else."""

from __future__ import annotations

from servotwin.models.engine.dynamics import guards
from servotwin.models.state.modes import (
    CONDUCTING,
    CORE,
    LIMITED_BACKWARD,
    LIMITED_FORWARD,
    NO_CURRENT,
    Mode,
    at_rest,
)

NAMES = (
    *guards.EVENT_NAMES, "stick", "reversal", "current limited", "current stops", "current starts", "gear held",
    "drive backward", "drive ends", "drive forward", "silence ends", "silence begins", "pulse refused", "trip ends",
    "trips by overload", "trips by current", "trips by heat", "trips by undervoltage")
"""By their numbers; of several of one name the first is used."""
_FIRST = tuple(guards.EVENT_NAMES.index(name) for name in guards.EVENT_NAMES)
STICK, REVERSAL, LIMITED, STOPS, STARTS, HELD = range(len(guards.EVENT_NAMES), len(guards.EVENT_NAMES) + 6)
DRIVE_ENDS, SILENCE_ENDS, REFUSED, TRIP_ENDS = HELD + 2, HELD + 4, HELD + 6, HELD + 7
"""Beside `DRIVE_ENDS` stand both drives, behind `SILENCE_ENDS` that it begins, behind `TRIP_ENDS` the trips."""
NO_EVENT, _ZONE = -1, guards.EVENT_NAMES.index("zone")


def is_usual(kind: int) -> bool:
    """Tell whether an event comes with every pulse: of a bridge's drive, or of the zone of its current."""
    return kind == _ZONE or LIMITED <= kind <= STARTS or DRIVE_ENDS - 1 <= kind <= DRIVE_ENDS + 1


def kind_of(ended_by: int, after: Mode) -> int:
    """Return the number of an event that ends a mode (a guard) and after which another one holds.

    It is `NO_EVENT` for what nobody would see.
    """
    if ended_by < 0 or ended_by == guards.SHARE or ended_by == guards.CREEPS:
        return NO_EVENT
    if ended_by == guards.SPEED and at_rest(after.contact):
        return STICK
    if ended_by == guards.SPEED and after.contact != CORE:
        return REVERSAL
    if after.zone >= CONDUCTING and (ended_by == guards.ZONE_UP or ended_by == guards.ZONE_DOWN):
        if after.zone == LIMITED_BACKWARD or after.zone == LIMITED_FORWARD:
            return LIMITED
        return STOPS if after.zone == NO_CURRENT else STARTS
    return _FIRST[ended_by]
