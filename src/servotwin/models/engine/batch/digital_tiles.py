"""Tiles of digital servos that go from tick to tick side by side: what they are, remember and work with."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.dynamics import contacts
from servotwin.models.engine.lanes import UNDERWAY, inputs_of, numbers_of
from servotwin.models.engine.memory import (
    SAME,
    Inputs,
    Point,
    instant,
    memory_at,
    origin_of,
    put_memory,
    resumed,
)
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.state.modes import BACKWARD, FORWARD, RIGID, Mode, one_body
from servotwin.models.state.records import reader, room, rows_of, tile_of, writer
from servotwin.models.terms import profile, sensor, shaft, source, trips
from servotwin.models.terms.bridge import Bridge
from servotwin.models.terms.control import NOWHERE, WAITING
from servotwin.models.terms.duty import BRAKE
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import Sensor
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.physics.motor import back_emf, electromagnetic_torque, steady_armature_current
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories

_GIVEN = Piece()  # what a servo follows that a program drives
TOGETHER = 64  # lanes: what they work with fits into the nearest cache


class Body(NamedTuple):
    """What moves: motor and shaft, the friction that it slides against [N m], and between which stops."""

    motor: Motor
    shaft: Shaft
    dry: float  # 1: with dry friction
    against_forward: float  # of a shaft that slides forward; negative of one that slides backward
    against_backward: float
    hold_forward: float  # most that friction holds against a start
    hold_backward: float
    lower: float
    upper: float
    tau: float  # constant, external


class Loop(NamedTuple):
    """What a servo remembers from tick to tick, as `control.Firm` has it."""

    q: float
    w: float
    duty: float
    coming: float  # duty of the latest tick, where it waits for the next
    decided: float
    y: float
    y_then: float
    x: float
    D: float
    resting: float
    excess: float
    age: float
    renewal: float  # ticks until the derivative is renewed
    goal: float
    written: float
    heard: float
    calm: float  # 1: nothing but the law decides


class Clock(NamedTuple):
    """Where a lane is in time, in ticks since the instant from which its memory counts."""

    tick: float  # the next one
    left: float  # that it still goes in this call
    follows: float  # 1: its goal moves by a piece of its own
    last: float  # 1: with these the call is over
    hears: float  # from when on there may be news
    output: float  # the next one; inf: none


class Place(NamedTuple):
    """Which lane stands here."""

    k: int  # of those that run
    lane: int
    frames: int
    output: int


class Plan(NamedTuple):
    """What is worked out in one tick."""

    delayed: float  # 1: a duty waits for the next tick
    alone: float  # 1: it always decides alone
    usual: float  # 1: it has decided with the others
    V_bus: float
    given: float  # duty of this tick
    way: float  # −1, 0, +1: how it moves
    rate: float  # λ [1/s]
    pull: float  # f [rad/s²]
    ends: float  # 1: it comes to rest within the tick
    lost: float
    q0: float  # where it was before
    w0: float


def _tile_type() -> np.dtype[Any]:
    rows: dict[str, Any] = {name: rows_of(kind, "float64", TOGETHER) for name, kind in (
        ("program", Firmware), ("body", Body), ("path", Bridge), ("supply", Source), ("sensor", Sensor),
        ("loop", Loop), ("clock", Clock), ("plan", Plan), ("piece", Piece))}
    return tile_of({**rows, "place": rows_of(Place, "int64", TOGETHER)}, TOGETHER)


TILE_TYPE = _tile_type()
firmware_at, put_firmware = reader("firmware_at", Firmware), writer("put_firmware", Firmware)
body_at, put_body = reader("body_at", Body), writer("put_body", Body)
path_at, put_path = reader("path_at", Bridge), writer("put_path", Bridge)
supply_at, put_supply = reader("supply_at", Source), writer("put_supply", Source)
sensor_at, put_sensor = reader("sensor_at", Sensor), writer("put_sensor", Sensor)
piece_at, put_piece = reader("piece_at", Piece), writer("put_piece", Piece)


def tile_room() -> NDArray[Any]:
    """Return room for a tile."""
    return room(1, TILE_TYPE)


def possible(numbers: Numbers, inputs: Inputs) -> bool:
    """Tell whether a servo's current always flows freely, so that every tick is two arcs at most, end stops apart."""
    if source.regulated(numbers.source) or sensor.slack(numbers.sensor) or len(inputs.torque) > 0:
        return False
    if may_depend(numbers, _GIVEN) != 0 or numbers.bridge.pwm != BRAKE:
        return False
    if numbers.bridge.D_drive != 0.0 or numbers.bridge.V_br != 0.0 or numbers.bridge.off.D != 0.0:
        return False
    firmware = inputs.firmware[0]
    return bool(firmware.T_d == 0.0 or abs(firmware.T_d - firmware.T_c) <= SAME * firmware.T_c)


def body_of(numbers: Numbers, tau: float) -> Body:
    """Return what moves, under a constant external torque [N m]."""
    backward, forward = contacts.holding_bounds(numbers, 0.0, -tau)
    return Body(numbers.motor, numbers.shaft, 1.0 if contacts.has_friction(numbers) else 0.0,
                contacts.friction_torque(numbers, FORWARD, 0.0, 0.0, 0.0),
                contacts.friction_torque(numbers, BACKWARD, 0.0, 0.0, 0.0), forward, backward, numbers.stops.lower,
                numbers.stops.upper, tau)


def torque_per_volt(own: Motor, R: float) -> float:
    """Return the torque [N m/V] that a voltage makes in a loop of so many ohms."""
    return electromagnetic_torque(steady_armature_current(1.0, 0.0, R, own.K_b), own.K)


def fading(body: Body, per_volt: float) -> float:
    """Return λ [1/s] of a shaft whose motor has so much torque per volt."""
    return shaft.accelerated(body.shaft, body.shaft.b + per_volt * back_emf(1.0, body.motor.K_b))


def enter(lanes: Lanes, curve: Floats, torque: Floats, k: int, lane: int, duration: float, times: Floats,
           output: int, memories: Memories, tile: Any, j: int) -> bool:
    """Put a lane into a tile; return whether it goes on there at all."""
    numbers, inputs = numbers_of(lanes, lane), inputs_of(lanes, curve, torque, lane)
    if not possible(numbers, inputs):
        return False
    memory = resumed(False, inputs, memory_at(memories, k), False)
    controller.resume(inputs, memory)
    firmware, firm = lanes.firmware[lane], memories.firms[k]
    t, slack, delayed = memory.point.time, SAME * firmware.T_c, firmware.T_d > 0.0
    until = instant(False, inputs, memory, t + duration)
    tick = float(firm.tick - memory.frames)
    whole = (until - t) / firmware.T_c + SAME
    left = whole - whole % 1.0
    on_tick = abs(firmware.t_phi + tick * firmware.T_c - t) <= slack
    if not on_tick or left < 1.0 or firm.waiting > (1 if delayed else 0):
        return False
    put_memory(memories.rows[k], memory)
    put_firmware(tile.program, j, firmware)
    put_body(tile.body, j, body_of(numbers, inputs.constant_torque))
    put_path(tile.path, j, numbers.bridge)
    put_supply(tile.supply, j, numbers.source)
    put_sensor(tile.sensor, j, numbers.sensor)
    tile.plan.delayed[j] = 1.0 if delayed else 0.0
    tile.plan.alone[j] = 1.0 if _is_alone(numbers, inputs, memory.point.y.T_h) else 0.0
    tile.loop.q[j], tile.loop.w[j] = memory.point.y.q, memory.point.y.w
    tile.loop.coming[j] = firm.duties[(firm.head - 1) % WAITING] if firm.waiting > 0 else firm.duty
    tile.clock.tick[j], tile.clock.left[j] = tick, left
    tile.clock.last[j] = 1.0 if abs(until - t - left * firmware.T_c) <= slack else 0.0
    tile.place.k[j], tile.place.lane[j], tile.place.frames[j] = k, lane, memory.frames
    tile.place.output[j] = output
    tile.clock.hears[j], tile.clock.follows[j] = -math.inf, 0.0
    await_output(times, tile, j)
    load(firmware, firm, tile, j)
    return True


def _is_alone(numbers: Numbers, inputs: Inputs, T_h: float) -> bool:
    """Tell whether the program of a servo has more to decide than the law with P and D."""
    firmware = inputs.firmware[0]
    measures = firmware.per_volt != 0.0
    crooked = measures and (numbers.sensor.step != 0.0 or len(inputs.curve) > 0 or firmware.noise > 0.0)
    more = firmware.k_i > 0.0 or firmware.k_v > 0.0 or firmware.k_a > 0.0 or firmware.soft_time > 0.0
    of_bus = firmware.I_m < math.inf and firmware.senses_bus > 0.0
    return crooked or more or of_bus or T_h > firmware.trip_temperature - 2.0 * trips.COOLER


def load(firmware: Firmware, firm: Any, tile: Any, j: int) -> None:
    """Take what a program remembers into a tile."""
    loop, m = tile.loop, firmware.m
    loop.duty[j], loop.decided[j] = firm.duty, firm.decided
    loop.goal[j], loop.written[j], loop.heard[j] = firm.goal, firm.written, firm.heard
    loop.y[j], loop.y_then[j], loop.x[j], loop.D[j] = firm.y, firm.y_then, firm.x, firm.D
    loop.resting[j], loop.excess[j], loop.age[j] = float(firm.resting), firm.excess, float(firm.age)
    loop.renewal[j] = m - float(firm.age % int(m))
    loop.calm[j] = 1.0 if _is_calm(firmware, firm) else 0.0


def ticks(firmware: Firmware, tile: Any, j: int, time: float) -> float:
    """Return which tick of a lane comes at a time since the start [s]."""
    return float((time - (tile.place.frames[j] * firmware.T_c + firmware.t_phi)) / firmware.T_c)


def _is_calm(firmware: Firmware, firm: Any) -> bool:
    """Tell whether nothing is under way in a program."""
    if firm.torque == 0 or firm.goal == NOWHERE or firm.age == 0 or firm.restart > 0.0 or firm.lost != 0:
        return False
    if trips.acting(firm) != trips.NONE or firm.overload_clock >= 0.0 or firm.current_clock >= 0.0 or firm.soft < 0.0:
        return False
    return not profile.present(firmware) or bool(firm.r == firm.goal and firm.rate == 0.0)


def store(firmware: Firmware, tile: Any, j: int, firm: Any) -> None:
    """Put what a program remembers back from a tile."""
    loop, age = tile.loop, int(tile.loop.age[j])
    gone = age - firm.age
    if gone > 0:
        firm.draws += gone if firmware.per_volt != 0.0 else 0
        firm.soft += gone * firmware.T_c
        firm.r = loop.goal[j]
    if tile.clock.follows[j] > 0.0 and loop.written[j] != firm.written:
        firm.goal, firm.written, firm.heard = loop.goal[j], loop.written[j], loop.heard[j]
        firm.on_course = firm.tripped = 0
    firm.age, firm.resting = age, int(loop.resting[j])
    firm.duty, firm.decided = loop.duty[j], loop.decided[j]
    firm.y, firm.y_then, firm.x, firm.D, firm.excess = loop.y[j], loop.y_then[j], loop.x[j], loop.D[j], loop.excess[j]


def await_output(times: Floats, tile: Any, j: int) -> None:
    """Find when the next output of a lane is due."""
    o = tile.place.output[j]
    tile.clock.output[j] = math.inf
    if o < times.size:
        T_c = tile.program.T_c[j]
        tile.clock.output[j] = (times[o] - (tile.place.frames[j] * T_c + tile.program.t_phi[j])) / T_c


def leave(lanes: Lanes, durations: Floats, first_output: Indices, memories: Memories, status: Indices, tile: Any,
          size: int) -> None:
    """Put all lanes of a tile where `runs` goes on from."""
    for j in range(size):
        k, lane = tile.place.k[j], tile.place.lane[j]
        firmware, firm = lanes.firmware[lane], memories.firms[k]
        lost, frames = tile.clock.last[j] < 0.0, tile.place.frames[j]
        store(firmware, tile, j, firm)
        firm.tick = frames + int(tile.clock.tick[j]) + (1 if lost else 0)
        firm.waiting = 1 if tile.plan.delayed[j] > 0.0 else 0
        firm.duties[firm.head] = tile.loop.coming[j]
        firm.head = (firm.head + 1) % WAITING
        memory = memory_at(memories, k)
        q, w, y = tile.loop.q[j], tile.loop.w[j], memory.point.y
        here = one_body(q, w, y)
        t = tile.clock.tick[j] * firmware.T_c + firmware.t_phi
        gone = (frames * memory.beat + t) - (origin_of(memory) + memory.point.time)
        point = Point(t, here, Mode(0, 0, RIGID, 0, 0), math.inf, here, memory.point.step, q)
        put_memory(memories.rows[k], memory._replace(frames=frames, point=point))
        durations[k] = 0.0 if tile.clock.last[j] > 0.0 else max(durations[k] - gone, 0.0)
        first_output[k] = tile.place.output[j]
        status[k] = UNDERWAY
