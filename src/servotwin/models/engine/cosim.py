"""Lanes between two calls: what another simulator imposes on them, a tick as C asks for it, and how their runs ended.

Given numbers stand in rows, in the order below, and `has` tells which rows count. Nothing changes until all of them
have been accepted. Lanes of tiles that were given up are put together in the first `count[0]` of some places, with
their memories.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.batch.tiles import numbers_at
from servotwin.models.engine.bus.coupled_motion import APART
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.lanes import chip_of, numbers_of
from servotwin.models.engine.memory import (
    BEAT,
    NOT_ASKED,
    NOTHING,
    SAME,
    Memory,
    Point,
    memory_at,
    point_of,
    put_memory,
    put_point,
    put_vector,
    time_of,
)
from servotwin.models.engine.observe import on_bus
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import INSIDE, LOST, ON_BACKWARD, ON_FORWARD, RIGID, Mode, Vector
from servotwin.models.state.records import TILE, reader, writer
from servotwin.models.terms import elastic, frame, heat
from servotwin.models.terms.bridge import Bridge, Off
from servotwin.models.terms.control import Programs
from servotwin.models.terms.follower import Follower
from servotwin.models.terms.frame import Chip, Decision, Frame
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, at_temperature
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source, regulated
from servotwin.models.terms.stops import Stops
from servotwin.physics.electronics import control_voltage_from_pulse
from servotwin.physics.motor import electromagnetic_torque
from servotwin.physics.pieces import Piece, piece_value
from servotwin.physics.potentiometer import angle_from_voltage
from servotwin.physics.shaft import pendulum_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from servotwin.models.engine.lanes import Floats, Indices, Lanes, Smalls
    from servotwin.models.engine.memory import Memories


# --- Decisions of another simulator on a servo, as changes of its numbers and of where it stands ----------------------

def possible(given: float, followed: float, low: float, high: float, least: float, most: float) -> bool:
    """Tell whether a servo takes a command, as it is given and as the engine follows it.

    The one may be from `low` to `high`, the other lies between `least` and `most`; nan is not possible.
    """
    return low <= given <= high and least < followed < most


def with_load_inertia(given: Shaft, J_L: float, load_total: float) -> Shaft:
    """Return a shaft with another inertia J_L [kg m²] in the place of its load's, `load_total`."""
    J_out = J_L + (given.J_out - load_total)
    return Shaft(given.J + (J_out - given.J_out), given.b, J_out, given.b_out)


def on_known_bus(given: Numbers, V: float, V_oc: float, pulsed: bool) -> Numbers:
    """Return a servo on a bus of V [V] instead of a source of V_oc; without pulses that limits its mean voltage."""
    if pulsed:
        return on_bus(given, V)
    own = given.follower
    return given._replace(follower=own._replace(V_max=max(own.V_max + V - V_oc, 0.0)))


def runs_otherwise(before: Source, V: float, drop: float, pulsed: bool) -> bool:
    """Tell whether a servo may have to run in another way on a bus of V [V]; `drop` [V] is its bridge's."""
    return pulsed and ((before.V > drop) != (V > drop) or regulated(before))


def impulse_work(shaft: Shaft, alone: bool, before: float, after: float) -> float:
    """Return the kinetic energy [J] that a speed gives which is set [rad/s], to the output `alone` or to motor too."""
    J = shaft.J_out if alone else shaft.J
    return 0.5 * J * (after * after - before * before)


def placed(point: Point, angle: float, speed: float, sets_angle: bool, sets_speed: bool, half_play: float,
           half_slack: float, sprung: bool) -> Point:
    """Return a point with another angle [rad] or speed [rad/s] of the output, from which a new motion begins.

    Motor and potentiometer go along as far as their play. Where the speed is set too, the shaft is one that another
    simulator moves: the motor goes along so that the play stays as it is, or teeth that have met within a tick would be
    apart again. The other end of a spring (`sprung`) goes along so that the twist stays, and keeps its
    speed.
    """
    q, w, i, T_w, T_h, q_motor, w_motor = point.y
    wiper, play = point.wiper, half_play > 0.0
    if sets_angle:
        q_motor = behind(q_motor, q, angle, half_play, sprung or sets_speed) if sprung or play else angle
        q, wiper = angle, carried(wiper, angle, half_slack)
    if sets_speed:
        w = speed
        w_motor = w_motor if play or sprung else speed
    y = Vector(q, w, i, T_w, T_h, q_motor, w_motor)
    mode = Mode(point.mode.zone, point.mode.contact, INSIDE if play else RIGID, point.mode.motor,
                point.mode.share)
    return Point(point.time, y, mode, math.inf, y, point.step, wiper)


def behind(follows: float, before: float, angle: float, half_play: float, together: bool) -> float:
    """Return the angle [rad] of what is behind a gear whose output is put from an angle to another one."""
    return follows + (angle - before) if together else carried(follows, angle, half_play)


def carried(follows: float, angle: float, half_play: float) -> float:
    """Return an angle [rad] that goes along with another one as far as the play between them."""
    return min(max(follows, angle - half_play), angle + half_play)


# --- From servos side by side to servos one by one, and back: the same memory, stored in two ways ---------------------

def remembered(tile: Any, j: int, firm: Programs) -> Memory:
    """Return the memory of a servo that runs side by side, where times count from now [s].

    Without slack the potentiometer goes with the shaft. `firm` is what stands in the place of a program's memory.
    """
    servo, clock, regular, number = tile.servo, tile.clock, tile.count.edges[j] < 0, tile.count.number[j]
    now = clock.since[j] - clock.length[j] if regular else clock.edge[j] + clock.since[j]
    q, w, drive, gear = 1.0 * servo.q[j], 1.0 * servo.w[j], 1.0 * servo.drive[j], servo.mesh[j]  # float64 as records
    pushed = ON_FORWARD if gear == ON_FORWARD else ON_BACKWARD if gear == ON_BACKWARD else RIGID
    mesh = INSIDE if gear == INSIDE else pushed
    y = Vector(q, w, 1.0 * servo.i[j], 1.0 * servo.T_w[j], 1.0 * servo.T_h[j],
               q if gear == RIGID else 1.0 * servo.q_m[j], w if gear == RIGID else 1.0 * servo.w_m[j])
    chip = Frame(
        number, tile.count.first_draw[j] + number, drive, now + servo.left[j] if drive != 0.0 else math.inf,
        now + servo.silence[j], 0, 1.0 * servo.error[j],
        Decision(now + servo.due[j], 1.0 * servo.sign[j], 1.0 * servo.duration[j], 1.0 * servo.decided[j]),
        Decision(now + servo.later_due[j], 1.0 * servo.later_sign[j], 1.0 * servo.later_duration[j],
                 1.0 * servo.later_decided[j]))
    wiper = 1.0 * servo.wiper[j] if tile.hung.half_slack[j] > 0.0 else q
    point = Point(now, y, Mode(0, 0, mesh, 0, 0), math.inf, y, 1.0 * servo.step[j], wiper)
    return Memory(number if regular else 0, clock.period[j] if regular else BEAT, point, chip, NOTHING, math.inf,
                  NOTHING, math.inf, NOT_ASKED, firm)


def put_beside(memory: Memory, period: float, tile: Any, j: int) -> None:
    """Put what a servo remembers beside others, whose frames are regular, of a period [s], from now on."""
    now, beat, chip, y = memory.point.time, memory.beat, memory.chip, memory.point.y
    servo, clock, pending, later = tile.servo, tile.clock, chip.pending, chip.later
    servo.q[j], servo.w[j], servo.i[j], servo.T_w[j], servo.T_h[j] = y.q, y.w, y.i, y.T_w, y.T_h
    servo.q_m[j], servo.w_m[j], servo.mesh[j] = y.q_m, y.w_m, 1.0 * memory.point.mode.mesh
    servo.wiper[j], servo.step[j] = memory.point.wiper, memory.point.step
    servo.drive[j], servo.left[j] = chip.drive, chip.drive_end - now if chip.drive != 0.0 else 0.0
    servo.silence[j], servo.error[j] = chip.clock - now, chip.error
    servo.due[j], servo.sign[j] = pending.time - now, pending.sign
    servo.duration[j], servo.decided[j] = pending.duration, pending.error
    servo.later_due[j], servo.later_sign[j] = later.time - now, later.sign
    servo.later_duration[j], servo.later_decided[j] = later.duration, later.error
    time, same = memory.frames * beat + now, beat == period
    number = chip.number if same else math.ceil(time / period - SAME)
    to_next = max((chip.number - memory.frames) * beat - now if same else number * period - time, 0.0)
    clock.period[j], clock.edge[j], clock.since[j], clock.length[j] = (
        period, (number - 1) * period, period - to_next, period)
    tile.count.number[j], tile.count.first_draw[j] = number, chip.draws - number


# --- One tick as a program in C asks for it, in loops over lanes ------------------------------------------------------

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

    Return 1 where a lane may have to run in another way from now on, else 0. Imposed values stay in `inertias` and
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


# --- The sets of lanes of which a tick consists, in tiles or in records -----------------------------------------------

def gather_lost(which: Indices, status: Any, command: Floats, pieces: Floats, tile_rows: Any, count: Indices,
                places: Indices, lanes: Indices, durations: Floats, memories: Memories) -> int:
    """Put together the lanes of tiles that were given up; return how many there are. They owe nothing any more.

    Their commands are put into their `pieces`.
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
    """Let no servos on any bus move together until time advances, and all motions begin anew."""
    for k in range(joined.size):
        joined[k], rows[k].point.anchor_time = -1, math.inf
    for k in range(len(shared)):
        shared[k].phase, shared[k].jumped = APART, 1


# --- Remarks on the end of a run: of its last pulses, of end stops, and of the load -----------------------------------

ON_STOP, CANNOT_HOLD = 1, 2  # added up
_AT_STOP = 1e-6  # rad, relative beyond 1 rad: single precision
_ROUNDING = 1e-9  # rad


def last_frame(period: float, edges: Sequence[float] | NDArray[np.float64], duration: float) -> int:
    """Return the number of the last frame that starts before the end of a run; −1 where none does."""
    if period > 0.0:
        k = int(duration / period) + 1
    else:
        k = len(edges) - 1
    while k >= 0 and frame.edge_time(period, edges, k) >= duration:
        k -= 1
    return k


def piece_before(table: NDArray[np.float64], time: float, included: bool) -> Piece:
    """Return the piece of a table in force at `time` [s], or just before it; the first one before all."""
    low, high = 0, table.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        start = table[middle, 0]
        if start < time or (included and start == time):
            low = middle
        else:
            high = middle
    return Piece(table[low, 0], table[low, 1], table[low, 2], table[low, 3], table[low, 4], table[low, 5],
                 table[low, 6])


def width_at(command: NDArray[np.float64], time: float) -> float:
    """Return the width [s] of a pulse that starts at `time` [s]."""
    return piece_value(piece_before(command, time, True), time)


def refused_from(chip: Chip, command: NDArray[np.float64], period: float,
                 edges: Sequence[float] | NDArray[np.float64], duration: float) -> float:
    """Return when the first pulse came [s] from which on the chip refuses all; nan where it takes the last one."""
    first = math.nan
    k = last_frame(period, edges, duration)
    while k >= 0:
        t = frame.edge_time(period, edges, k)
        if frame.accepted(chip, width_at(command, t)):
            break
        first = t
        k -= 1
    return first


def told(pulsed: bool, numbers: Numbers, chip: Chip, command: NDArray[np.float64], period: float,
         edges: Sequence[float] | NDArray[np.float64], duration: float) -> tuple[float, float]:
    """Return the angle [rad] that the servo was sent to last, and how far from it nothing is done."""
    p, b_o = numbers.sensor.p, numbers.sensor.b_o
    if not pulsed:
        voltage = piece_value(piece_before(command, duration, False), duration)
        return angle_from_voltage(voltage, p, b_o), angle_from_voltage(numbers.follower.half_deadband, p)
    k = last_frame(period, edges, duration)
    width = width_at(command, frame.edge_time(period, edges, k) if k >= 0 else duration)
    voltage, slack = (control_voltage_from_pulse(width, chip.slope, chip.T_0),
                      control_voltage_from_pulse(chip.half_deadband, chip.slope))
    return angle_from_voltage(voltage, p, b_o), angle_from_voltage(slack, p)


def starts(numbers: Numbers, forward: bool, torque: float, tau: float, q: float) -> bool:
    """Tell whether a motor's torque [N m] turns a shaft that stands at q, against friction and load."""
    against = external_torque(numbers.load, tau, q)
    if elastic.behind(numbers.elastic):
        against += pendulum_torque(q, numbers.elastic.gravity, numbers.elastic.hanging_angle)
    if forward:
        return torque - against > contacts.holding_bounds(numbers, torque, -against)[1]
    return -torque - against < -contacts.holding_bounds(numbers, -torque, -against)[0]


def marks(pulsed: bool, numbers: Numbers, chip: Chip, command: NDArray[np.float64], tau: float, period: float,
          edges: Sequence[float] | NDArray[np.float64], duration: float, source: float, refused: bool,
          final: Sequence[float] | NDArray[np.float64]) -> int:
    """Return what is so at the end of a run, as a sum of `ON_STOP` and `CANNOT_HOLD`.

    `tau` is the part of the load's torque that depends on time alone [N m], `source` the voltage of the supply, other
    servos' currents apart [V], `final` the last angle and speed, and temperatures of winding and housing.
    """
    if numbers.sensor.p == 0.0:  # neither a motor nor a servo that turns without end takes an angle
        return 0
    q, w, T_w, T_h = final[0], final[1], final[2], final[3]
    target, slack = told(pulsed, numbers, chip, command, period, edges, duration)
    if abs(target - q) <= slack + _ROUNDING:
        return 0
    found = 0
    above = q >= numbers.stops.upper - _AT_STOP * max(abs(numbers.stops.upper), 1.0)
    if w == 0.0 and (above or q <= numbers.stops.lower + _AT_STOP * max(abs(numbers.stops.lower), 1.0)):
        found += ON_STOP
    if heat.present(numbers.heat):
        numbers = at_temperature(numbers, T_w, T_h)
    torque = electromagnetic_torque(currents.stall_current(numbers, source), numbers.motor.K)
    if refused or not torque < math.inf:
        return found
    forward = target > q
    sent = min(max(target, numbers.stops.lower), numbers.stops.upper)
    if not (starts(numbers, forward, torque, tau, q) and starts(numbers, forward, torque, tau, sent)):
        found += CANNOT_HOLD
    return found


def look_at_lanes(pulsed: bool, lanes: Lanes, torques: Floats, torque_first: Indices, torque_count: Indices,
                  duration: float, final: Floats, refused: Floats, found: Smalls) -> None:
    """Look at the end of every lane: fill `refused` with `refused_from`, and `found` with `marks`."""
    for lane in range(lanes.torque.size):
        command = lanes.pieces[lanes.piece_first[lane]:lanes.piece_first[lane] + lanes.piece_count[lane]]
        own = lanes.edge_count[lane]
        edges = lanes.edges[lanes.edge_first[lane]:lanes.edge_first[lane] + max(own, 0)]
        numbers, chip = numbers_of(lanes, lane), chip_of(lanes, lane)
        period = 0.0 if own >= 0 else chip.frame_period
        tau = lanes.torque[lane]
        if torque_count[lane] > 0:
            own_torque = torques[torque_first[lane]:torque_first[lane] + torque_count[lane]]
            tau += piece_value(piece_before(own_torque, duration, False), duration)
        refused[lane] = refused_from(chip, command, period, edges, duration) if pulsed else math.nan
        found[lane] = marks(pulsed, numbers, chip, command, tau, period, edges, duration, numbers.source.V,
                            not math.isnan(refused[lane]), final[lane])
