"""One tick as a program in C asks for it, in loops over lanes: what it gives is checked, imposed and followed.

Given numbers stand in rows, in the order below, and `has` tells which rows count. Nothing changes until all of them
have been accepted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.batch.tiles import numbers_at
from servotwin.models.engine.cosim.imposed_state import on_known_bus, possible, runs_otherwise, with_load_inertia
from servotwin.models.state.records import TILE, reader, writer
from servotwin.models.terms.bridge import Bridge, Off
from servotwin.models.terms.follower import Follower
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.models.terms.stops import Stops

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices

PULSE_WIDTH, COMMAND_ANGLE, COMMAND_VOLTAGE, TORQUE, ANGLE, SPEED, INERTIA, VOLTAGE = range(8)
ACCEPTED = 0
BAD_DURATION, BAD_NUMBER, BAD_COMMAND, BAD_ANGLE, BAD_INERTIA, BAD_VOLTAGE, BEYOND_RECORD = range(4, 11)
LONGEST = 1e5  # s: nothing stops a kernel, and millions of frames take seconds
SLACK = 1e-9  # rad: another simulator's stop may give way so much
_LATE = 1e-12  # of an instant: a sum of ticks may end a rounding late

shaft_at = reader("shaft_at", Shaft)
source_at = reader("source_at", Source)
stops_at = reader("stops_at", Stops)
put_shaft = writer("put_shaft", Shaft)
put_source = writer("put_source", Source)
put_follower = writer("put_follower", Follower)
put_off = writer("put_off", Off)


def accept(now: Floats, has: Indices, given: Floats, scales: Floats, numbers: Any, clock: Floats, ends: Floats,
           bus_of: Indices, wanted: Floats) -> int:
    """Return `ACCEPTED`, or what is wrong with what is given; put commands into `wanted` as the engine follows them.

    `now` has the duration [s]; `scales`, for each kind of command and lane, gain, offset and the bounds of
    `possible`. `clock` and `ends` are the time of each lane, and when its recorded torque is over [s];
    `bus_of` is negative where a lane shares no supply, whose voltage would not be anyone's to give.
    """
    duration = now[0]
    if not 0.0 <= duration <= LONGEST:
        return BAD_DURATION
    lanes = clock.size
    for row in range(PULSE_WIDTH, VOLTAGE + 1):
        for k in range(lanes):
            if has[row] != 0 and not math.isfinite(given[row, k]):
                return BAD_NUMBER
    if has[PULSE_WIDTH] + has[COMMAND_ANGLE] + has[COMMAND_VOLTAGE] > 1:
        return BAD_COMMAND
    for kind in range(COMMAND_VOLTAGE + 1):
        for k in range(lanes):
            if has[kind] != 0:
                wanted[k] = scales[kind, k, 0] * given[kind, k] + scales[kind, k, 1]
                if not possible(given[kind, k], wanted[k], scales[kind, k, 2], scales[kind, k, 3], scales[kind, k, 4],
                                scales[kind, k, 5]):
                    return BAD_COMMAND
    for k in range(lanes):
        if has[INERTIA] != 0 and given[INERTIA, k] < 0.0:
            return BAD_INERTIA
        if has[VOLTAGE] != 0 and (given[VOLTAGE, k] <= 0.0 or bus_of[k] >= 0):
            return BAD_VOLTAGE
        if has[ANGLE] != 0:
            stops = stops_at(numbers[k // TILE].stops, k % TILE)
            if not stops.lower - SLACK <= given[ANGLE, k] <= stops.upper + SLACK:
                return BAD_ANGLE
        end = clock[k] + duration
        if end > ends[k] + _LATE * abs(end):
            return BEYOND_RECORD
    return ACCEPTED


def change(has: Indices, given: Floats, which: Indices, before: Any, load_total: Floats, V_oc: Floats, pulsed: bool,
           inertias: Floats, voltages: Floats, numbers: Any) -> int:
    """Put imposed inertias and voltages into the numbers of some lanes, `before` as servo and load say them.

    Return 1 where a lane may have to run in another way from now on, else 0. What is imposed stays in `inertias` and
    `voltages`.
    """
    otherwise = 0
    for k in which:
        tile, own, j = numbers[k // TILE], before[k // TILE], k % TILE
        if has[INERTIA] != 0:
            inertias[k] = given[INERTIA, k]
            put_shaft(tile.shaft, j, with_load_inertia(shaft_at(own.shaft, j), inertias[k], load_total[k]))
        if has[VOLTAGE] != 0:
            V = given[VOLTAGE, k]
            voltages[k] = V
            if runs_otherwise(source_at(tile.source, j), V, own.bridge.D_drive[j], pulsed):
                otherwise = 1
            new = on_known_bus(numbers_at(own, j), V, V_oc[k], pulsed)
            put_bridge(tile.bridge, j, new.bridge)
            put_source(tile.source, j, new.source)
            put_follower(tile.follower, j, new.follower)
    return otherwise


def put_bridge(rows: Any, j: int, bridge: Bridge) -> None:
    """Put the numbers of a bridge into a tile."""
    rows.D_drive[j] = bridge.D_drive
    rows.R_drive[j] = bridge.R_drive
    put_off(rows.off, j, bridge.off)
    put_off(rows.silence, j, bridge.silence)
    rows.V_br[j] = bridge.V_br


def follow(has: Indices, given: Floats, wanted: Floats, base: Floats, command: Floats, torque: Floats, total: Floats,
           pieces: Floats, now: Floats) -> None:
    """Let commands and external torques that are given be those from now on; `now` says whether torques are others."""
    commanded = has[PULSE_WIDTH] + has[COMMAND_ANGLE] + has[COMMAND_VOLTAGE] != 0
    for k in range(command.size):
        if commanded:
            command[k] = wanted[k]
        pieces[k, 1] = command[k]
        if has[TORQUE] != 0 and given[TORQUE, k] != torque[k]:
            now[1] = 1.0
    if has[TORQUE] != 0 and now[1] != 0.0:
        for k in range(command.size):
            torque[k] = given[TORQUE, k]
            total[k] = base[k] + torque[k]
