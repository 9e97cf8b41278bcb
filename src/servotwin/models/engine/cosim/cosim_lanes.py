"""The sets of lanes of which a tick consists, in tiles or in records: what is asked of each between its kernels.

Lanes of tiles that were given up are put together in the first `count[0]` of some places, with their memories.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.bus.coupled_motion import APART
from servotwin.models.engine.cosim.cosim_calls import ANGLE, SPEED, shaft_at, stops_at
from servotwin.models.engine.cosim.imposed_state import behind, carried, impulse_work, placed
from servotwin.models.engine.cosim.layout_convert import put_beside, remembered
from servotwin.models.engine.memory import memory_at, point_of, put_memory, put_point, put_vector, time_of
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import INSIDE, LOST
from servotwin.models.state.records import TILE

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices
    from servotwin.models.engine.memory import Memories


def gather_lost(which: Indices, status: Any, command: Floats, pieces: Floats, tile_rows: Any, count: Indices,
                places: Indices, lanes: Indices, durations: Floats, memories: Memories) -> int:
    """Put together the lanes of tiles that were given up; return how many there are. They owe nothing any more.

    What they are told is put into their `pieces`.
    """
    n = 0
    for k in range(which.size):
        tile, j, lane = tile_rows[k // TILE], k % TILE, which[k]
        if tile.clock.owed[j] > 0.0:
            if status[lane] == COMPLETED:
                put_memory(memories.rows[n], remembered(tile, j, memories.firms[n:n + 1]))
                places[n], lanes[n], durations[n], pieces[lane, 1] = k, lane, tile.clock.owed[j], command[lane]
                n += 1
            tile.clock.owed[j] = 0.0
    count[0] = n
    return n


def to_records(places: Indices, tile_rows: Any, memories: Memories) -> None:
    """Put what lanes at these places of tiles remember into records."""
    for k in range(places.size):
        tile = tile_rows[places[k] // TILE]
        put_memory(memories.rows[k], remembered(tile, places[k] % TILE, memories.firms[k:k + 1]))


def to_tiles(places: Indices, lanes: Indices, memories: Memories, periods: Floats, tile_rows: Any) -> None:
    """Put what lanes remember in records into tiles; their frames are regular, of these periods from now on [s]."""
    for k in range(places.size):
        put_beside(memory_at(memories, k), periods[lanes[k]], tile_rows[places[k] // TILE], places[k] % TILE)


def forget_motions(rows: Any) -> None:
    """Let the motions of all lanes in records begin anew: their numbers are others."""
    for k in range(len(rows)):
        rows[k].point.anchor_time = math.inf


def impose_on_tiles(has: Indices, given: Floats, numbers: Any, which: Indices, places: Indices, work: Floats,
                    tile_rows: Any) -> None:
    """Set angles and speeds of lanes at these places of tiles, and book the work of the impulses [J]."""
    for k in range(which.size):
        lane, servo, j = which[k], tile_rows[places[k] // TILE].servo, places[k] % TILE
        own, i = numbers[lane // TILE], lane % TILE
        half = own.play.half[i]
        if half > 0.0:
            servo.mesh[j] = INSIDE
        if has[SPEED] != 0:
            after = given[SPEED, lane]
            work[lane] += impulse_work(shaft_at(own.shaft, i), half > 0.0, 1.0 * servo.w[j], after)
            servo.w[j] = after
            servo.w_m[j] = servo.w_m[j] if half > 0.0 else after
        if has[ANGLE] != 0:
            angle = within_stops(own, i, given[ANGLE, lane])
            before = 1.0 * servo.q[j]
            servo.q[j], servo.wiper[j] = angle, carried(1.0 * servo.wiper[j], angle, own.sensor.half_slack[i])
            servo.q_m[j] = behind(1.0 * servo.q_m[j], before, angle, half, has[SPEED] != 0) if half > 0.0 else angle


def impose_on_records(has: Indices, given: Floats, numbers: Any, which: Indices, places: Indices, work: Floats,
                      rows: Any) -> None:
    """Set angles and speeds of lanes at these places of records, and book the work of the impulses [J]."""
    for k in range(which.size):
        lane, point = which[k], point_of(rows[places[k]].point)
        own, i = numbers[lane // TILE], lane % TILE
        half, angle, sprung = own.play.half[i], 0.0, own.elastic.k[i] > 0.0
        if has[SPEED] != 0:
            alone = half > 0.0 or (sprung and own.elastic.J[i] == 0.0)
            work[lane] += impulse_work(shaft_at(own.shaft, i), alone, point.y.w, given[SPEED, lane])
        if has[ANGLE] != 0:
            angle = within_stops(own, i, given[ANGLE, lane])
        put_point(rows[places[k]].point, placed(point, angle, given[SPEED, lane], has[ANGLE] != 0, has[SPEED] != 0,
                                                half, own.sensor.half_slack[i], sprung))


def within_stops(numbers: Any, i: int, angle: float) -> float:
    """Return an angle [rad], or the stop where another simulator's has given way, of a lane in a tile of numbers."""
    stops = stops_at(numbers.stops, i)
    return min(max(angle, stops.lower), stops.upper)


def show_tiles(which: Indices, tile_rows: Any, shaft: Floats) -> None:
    """Put angles [rad] and speeds [rad/s] of lanes in tiles into the rows of `shaft`."""
    for k in range(which.size):
        servo = tile_rows[k // TILE].servo
        shaft[0, which[k]], shaft[1, which[k]] = servo.q[k % TILE], servo.w[k % TILE]


def show_records(which: Indices, rows: Any, shaft: Floats) -> None:
    """Put angles [rad] and speeds [rad/s] of lanes in records into the rows of `shaft`."""
    for k in range(which.size):
        shaft[0, which[k]], shaft[1, which[k]] = rows[k].point.y.q, rows[k].point.y.w


def read_clocks(which: Indices, status: Any, ended: Floats, rows: Any, clock: Floats) -> None:
    """Put the times of lanes in records into `clock` [s]."""
    for k in range(which.size):
        lane = which[k]
        clock[lane] = time_of(rows[k]) if status[lane] == COMPLETED else ended[lane]


def take_status(which: Indices, status: Any, own: Indices) -> None:
    """Tell lanes on buses which of them have failed."""
    for k in range(which.size):
        own[k] = status[which[k]]


def note_lost_buses(which: Indices, own: Indices, rows: Any, status: Any, ended: Floats) -> None:
    """Note which lanes on buses have failed, and when; they are nan from there on."""
    for k in range(which.size):
        if own[k] != COMPLETED and status[which[k]] == COMPLETED:
            status[which[k]], ended[which[k]] = own[k], time_of(rows[k])
            put_vector(rows[k].point.y, LOST)


def break_up(joined: Indices, shared: Any, rows: Any) -> None:
    """Let nobody on any bus move together until time goes on, and all motions begin anew."""
    for k in range(joined.size):
        joined[k], rows[k].point.anchor_time = -1, math.inf
    for k in range(len(shared)):
        shared[k].phase, shared[k].jumped = APART, 1
