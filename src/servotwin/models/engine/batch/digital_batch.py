"""Digital servos side by side: a tile of lanes goes from tick to tick.

A lane of which something else is due at a tick than its law, as a goal on its way or a protection that counts, decides
alone, as `control.tick` has it. One that hits a stop leaves in the middle of its tick, and what is left of the call is
for `runs`. A lane never depends on its neighbours.

Between two ticks the duty is constant, so that a shaft goes through one arc, or through two where it comes to rest in
between. A value near a limit is marked for a lane to decide alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.batch.segments.linear_segments import starting, way_to_edge
from servotwin.models.engine.dynamics import contacts
from servotwin.models.engine.lanes import ARRIVED, UNDERWAY, inputs_of, numbers_of
from servotwin.models.engine.legs import tick_legs
from servotwin.models.engine.memory import (
    FRAMES,
    SAME,
    Inputs,
    Point,
    in_force,
    instant,
    memory_at,
    origin_of,
    put_memory,
    resumed,
)
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.engine.motions.elementary import decay, fma
from servotwin.models.state.modes import BACKWARD, CONDUCTING, FORWARD, FREE, RIGID, STUCK, Mode, one_body
from servotwin.models.state.records import reader, room, rows_of, tile_of, writer
from servotwin.models.terms import bridge, control, duty, sensor, shaft, source
from servotwin.models.terms.bridge import Bridge
from servotwin.models.terms.control import NOTHING_SENSED, NOWHERE, WAITING
from servotwin.models.terms.duty import BRAKE, OPEN
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import Sensor, sensed_voltage
from servotwin.models.terms.shaft import Shaft, accelerated
from servotwin.models.terms.source import Source
from servotwin.physics.firmware import counted, duty_of
from servotwin.physics.motor import back_emf, electromagnetic_torque, steady_armature_current
from servotwin.physics.pieces import Piece, piece_value
from servotwin.physics.potentiometer import feedback_voltage

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories


# --- Tiles of digital servos that go from tick to tick side by side ---------------------------------------------------

_GIVEN = Piece()  # what a servo follows that a program drives
TOGETHER = 64  # lanes: what they work with fits into the nearest cache


class Body(NamedTuple):
    """The moving part: motor and shaft, the friction that it slides against [N m], and between which stops."""

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
    """The state of a servo from tick to tick, as `control.Firm` has it."""

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
    """Arrays of one tick."""

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
    """Put a lane into a tile; return whether it runs there at all."""
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
    return crooked or more or of_bus or T_h > firmware.trip_temperature - 2.0 * control.COOLER


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
    counts = firm.overload_clock >= 0.0 or firm.current_clock >= 0.0 or firm.soft < 0.0
    if counts or control.acting(firm) != control.NONE:
        return False
    return not control.present(firmware) or bool(firm.r == firm.goal and firm.rate == 0.0)


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
    """Put all lanes of a tile to where `runs` continues."""
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


# --- How digital servos go through a tick, all lanes of a tile in one formula -----------------------------------------

_CLOSE = 0.99  # of a limit: so near to it a lane decides alone


class Arc(NamedTuple):
    """A stretch in which a shaft moves one way: from where it is to where it comes at the end of its time."""

    q: float
    w: float
    way: float
    rate: float
    pull: float
    ends: bool  # it comes to rest before


def any_senses(tile: Any, size: int) -> bool:
    """Tell whether a program looks at currents or voltages."""
    found = False
    for j in range(size):
        found = found or control.senses(firmware_at(tile.program, j))
    return found


def asked(tile: Any, size: int) -> tuple[int, int, int]:
    """Return how many lanes continue, of how many a command may have come, and of how many the goal moves."""
    going = news = following = 0
    for j in range(size):
        going += 1 if tile.clock.left[j] > 0.0 else 0
        news += 1 if tile.clock.tick[j] >= tile.clock.hears[j] else 0
        following += 1 if tile.clock.follows[j] > 0.0 else 0
    return going, news, following


def with_outputs(tile: Any, size: int) -> int:
    """Return how many lanes have outputs in this tick."""
    wanted = 0
    for j in range(size):
        wanted += 1 if is_wanted(tile, j) else 0
    return wanted


def is_wanted(tile: Any, j: int) -> bool:
    """Tell whether the next output of a lane lies in this tick; at its end only where the call ends too."""
    clock = tile.clock
    over = clock.last[j] > 0.0 and clock.left[j] <= 1.0 and clock.output[j] < math.inf
    return bool(clock.left[j] > 0.0 and tile.plan.lost[j] == 0.0 and (
        over or clock.output[j] < clock.tick[j] + 1.0 - SAME))


def follow(tile: Any, size: int) -> None:
    """Let the programs of all lanes whose goal moves take it."""
    loop, clock = tile.loop, tile.clock
    for j in range(size):
        firmware, piece = firmware_at(tile.program, j), piece_at(tile.piece, j)
        goal, written, heard = loop.goal[j], loop.written[j], loop.heard[j]
        time = (float(tile.place.frames[j]) + clock.tick[j]) * firmware.T_c + firmware.t_phi
        new = counted(piece_value(piece, time - firmware.latency), firmware.quantum)
        takes = clock.follows[j] > 0.0 and clock.left[j] > 0.0 and new != written
        loop.goal[j] = min(max(new, firmware.lower), firmware.upper) if takes else goal
        loop.written[j] = new if takes else written
        loop.heard[j] = time if takes else heard


def watch(tile: Any, size: int) -> None:
    """Mark the lanes in whose program no current and no voltage plays a part."""
    for j in range(size):
        firmware, body = firmware_at(tile.program, j), body_at(tile.body, j)
        d = tile.loop.coming[j] if tile.plan.delayed[j] > 0.0 else tile.loop.duty[j]
        source = supply_at(tile.supply, j)
        path, supply = duty.at(path_at(tile.path, j), body.motor, source, d)
        v, R = bridge.loop(path, supply, CONDUCTING, duty.voltage(supply, d))
        i = steady_armature_current(v, tile.loop.w[j], R, body.motor.K_b)
        V_bus = source.V - source.R_b * abs(d * i)
        calm = abs(i) < _CLOSE * firmware.trip_current and V_bus * _CLOSE > firmware.undervoltage and abs(d) <= 1.0
        tile.plan.usual[j] = 1.0 if calm else 0.0
        tile.plan.V_bus[j] = V_bus


def decide(tile: Any, size: int) -> int:
    """Let the programs of all lanes decide; return how many have to do so alone."""
    loop, plan, clock, frames = tile.loop, tile.plan, tile.clock, tile.place.frames
    for j in range(size):
        firmware, sensor, motor = firmware_at(tile.program, j), sensor_at(tile.sensor, j), body_at(tile.body, j).motor
        q = loop.q[j]
        angle = (feedback_voltage(q, sensor.p, sensor.b_o) - firmware.b_o) * firmware.per_volt
        y = control.filtered(firmware, loop.y[j], counted(angle if firmware.per_volt != 0.0 else q, firmware.quantum))
        z = control.beyond_zone(firmware, loop.goal[j], y)
        x = -y if firmware.of_measurement > 0.0 else z
        renews = loop.renewal[j] <= 1.0
        derives = renews and firmware.k_d != 0.0
        D = control.derivative(firmware, x - loop.x[j]) if derives else loop.D[j]
        u, w = control.limited(firmware, duty_of(firmware.k_p, z, firmware.delta) + D)
        d = control.within(firmware, w, firmware.duty_limit, loop.decided[j])
        voltage = abs(d * plan.V_bus[j] - back_emf(loop.w[j], motor.K_b))
        limited = firmware.I_m < math.inf and voltage > _CLOSE * firmware.I_m * (
            tile.path.R_drive[j] - tile.supply.R_b[j])
        usual = (plan.usual[j] > 0.0 and loop.calm[j] > 0.0 and plan.alone[j] == 0.0 and not limited
                 and abs(w) <= _CLOSE * firmware.overload_duty
                 and (frames[j] + clock.tick[j]) * firmware.T_c + firmware.t_phi - loop.heard[j] < (
                     firmware.timeout - firmware.T_c))
        goes = usual and clock.left[j] > 0.0
        plan.usual[j] = 1.0 if usual else 0.0
        plan.given[j] = d
        loop.resting[j] = (1.0 if control.rests(firmware, y - loop.y_then[j]) else 0.0) if goes and renews else (
            loop.resting[j])
        loop.y_then[j] = y if goes and renews else loop.y_then[j]
        loop.y[j] = y if goes else loop.y[j]
        loop.x[j] = x if goes and derives else loop.x[j]
        loop.D[j] = D if goes else loop.D[j]
        loop.excess[j] = u - w if goes else loop.excess[j]
        loop.decided[j] = d if goes else loop.decided[j]
        loop.age[j] = loop.age[j] + 1.0 if goes else loop.age[j]
        loop.renewal[j] = (firmware.m if renews else loop.renewal[j] - 1.0) if goes else loop.renewal[j]
    alone = 0
    for j in range(size):
        alone += 1 if plan.usual[j] == 0.0 else 0
    return alone


def move(tile: Any, size: int) -> int:
    """Put the duties on the bridges and move all lanes through the tick; return how many have a rest in it."""
    loop, plan, clock = tile.loop, tile.plan, tile.clock
    for j in range(size):
        coming, given, before, q, w = loop.coming[j], plan.given[j], loop.duty[j], loop.q[j], loop.w[j]
        goes, time = clock.left[j] > 0.0, tile.program.T_c[j]
        d = (coming if plan.delayed[j] > 0.0 else given) if goes else before
        loop.coming[j] = given if goes else coming
        loop.duty[j] = d
        body, path, supply = body_at(tile.body, j), path_at(tile.path, j), supply_at(tile.supply, j)
        arc = _arc(body, path, supply, d, q, w, time if goes else 0.0)
        moves = arc.way != 0.0 and not arc.ends and goes
        inside = body.lower < arc.q < body.upper
        blocked = d == OPEN and back_emf(max(abs(w), abs(arc.w)), body.motor.K_b) >= path.silence.D
        plan.q0[j], plan.w0[j] = q, w
        plan.way[j], plan.rate[j], plan.pull[j] = arc.way, arc.rate, arc.pull
        plan.ends[j] = 1.0 if arc.ends and goes else 0.0
        plan.lost[j] = 1.0 if (moves and not inside) or (blocked and goes) else 0.0
        loop.q[j] = arc.q if moves else q
        loop.w[j] = arc.w if moves else w
    ending = 0
    for j in range(size):
        ending += 1 if plan.ends[j] > 0.0 else 0
    return ending


def _arc(body: Body, path: Bridge, supply: Source, d: float, q: float, w: float, time: float) -> Arc:
    """Return how a shaft moves at a duty, from an angle and a speed on."""
    path, supply = duty.at(path, body.motor, supply, d)
    v, R = bridge.loop(path, supply, CONDUCTING, duty.voltage(supply, d))
    per_volt = 0.0 if d == OPEN else torque_per_volt(body.motor, R)
    torque = per_volt * v - body.tau
    start = starting(body.hold_forward, body.hold_backward, torque)
    way = start if w == 0.0 else math.copysign(1.0, w)
    rate = fading(body, per_volt)
    pull = accelerated(body.shaft, torque - (
        body.against_forward if way > 0.0 else body.against_backward))
    once, twice = decay(rate, 1.0 / rate if rate > 0.0 else 0.0, time)
    there = fma(-rate, w, pull)
    after = fma(there, once, w)
    ends = w * pull < 0.0 and w * after <= 0.0
    return Arc(fma(there, twice, fma(w, time, q)), after, way, rate, pull, ends)


def move_on(tile: Any, j: int) -> None:
    """Move a lane that comes to rest within the tick through all of it."""
    q, w, _ = seen(tile, j, tile.program.T_c[j])
    tile.loop.q[j], tile.loop.w[j] = q, w
    inside = tile.body.lower[j] < q < tile.body.upper[j]
    tile.plan.lost[j] = tile.plan.lost[j] if inside else 1.0


def seen(tile: Any, j: int, time: float) -> tuple[float, float, float]:
    """Return angle and speed of a lane after a part of its tick [s], and which way it moves."""
    plan, d = tile.plan, tile.loop.duty[j]
    body, path, supply = body_at(tile.body, j), path_at(tile.path, j), supply_at(tile.supply, j)
    q, w, rate, pull = plan.q0[j], plan.w0[j], plan.rate[j], plan.pull[j]
    if plan.way[j] == 0.0:
        return q, w, 0.0
    if plan.ends[j] > 0.0:
        t, turn = way_to_edge(w, 0.0, pull, rate, 1.0 / rate if rate > 0.0 else 0.0)
        if t < time:
            arc = _arc(body, path, supply, d, q + turn, 0.0, time - t)
            return (arc.q, arc.w, arc.way) if arc.way != 0.0 else (q + turn, 0.0, 0.0)
    arc = _arc(body, path, supply, d, q, w, time)
    return arc.q, arc.w, arc.way


def tick_over(tile: Any, size: int) -> None:
    """End a tick; a lane that is lost stays at its beginning."""
    loop, plan, clock = tile.loop, tile.plan, tile.clock
    for j in range(size):
        lost, goes = plan.lost[j] > 0.0, clock.left[j] > 0.0
        loop.q[j] = plan.q0[j] if lost else loop.q[j]
        loop.w[j] = plan.w0[j] if lost else loop.w[j]
        clock.last[j] = -1.0 if lost else clock.last[j]
        clock.left[j] = 0.0 if lost else max(clock.left[j] - 1.0, 0.0)
        clock.tick[j] += 1.0 if goes and not lost else 0.0
    late = 0
    for j in range(size):
        late += 1 if clock.tick[j] + tile.program.t_phi[j] / tile.program.T_c[j] >= FRAMES else 0
    if late > 0:
        for j in range(size):
            if clock.tick[j] + tile.program.t_phi[j] / tile.program.T_c[j] >= FRAMES:
                tile.place.frames[j] += FRAMES
                clock.tick[j] -= FRAMES
                clock.hears[j] -= FRAMES
                clock.output[j] -= FRAMES


# --- Digital servos side by side: a tile of lanes goes from tick to tick ----------------------------------------------

def go_on(lanes: Lanes, curve: Floats, torques: Floats, torque_first: Indices, torque_count: Indices,
          which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats, memories: Memories,
          status: Indices, room: Any) -> None:
    """Advance the lanes named in `which` side by side, as far as that leads; `runs.go_on` finishes them all.

    The arguments are those of `runs.go_on`, and room for a tile. Durations [s] and outputs that are left to do, and
    the status of lanes that have advanced, are noted for it.
    """
    tile, size = room[0], 0
    for k in range(which.size):
        lane = which[k]
        torque = torques[torque_first[lane]:torque_first[lane] + torque_count[lane]]
        if status[k] != ARRIVED and enter(lanes, curve, torque, k, lane, durations[k], times, first_output[k],
                                                memories, tile, size):
            size += 1
        if size == TOGETHER or (size > 0 and k == which.size - 1):
            _through(lanes, curve, times, outputs, memories, tile, size)
            leave(lanes, durations, first_output, memories, status, tile, size)
            size = 0


def _through(lanes: Lanes, curve: Floats, times: Floats, outputs: Floats, memories: Memories, tile: Any,
             size: int) -> None:
    """Advance all lanes of a tile from tick to tick."""
    senses = any_senses(tile, size)
    going, news, following = asked(tile, size)
    while going > 0:
        if news > 0:
            for j in range(size):
                if tile.clock.left[j] > 0.0 and tile.clock.tick[j] >= tile.clock.hears[j]:
                    _hear(lanes, curve, memories, tile, j)
        if following > 0:
            follow(tile, size)
        if senses:
            watch(tile, size)
        else:
            for j in range(size):
                tile.plan.usual[j] = 1.0
        if decide(tile, size) > 0:
            for j in range(size):
                if tile.plan.usual[j] == 0.0 and tile.clock.left[j] > 0.0:
                    _decide_alone(lanes, curve, memories, tile, j)
        if move(tile, size) > 0:
            for j in range(size):
                if tile.plan.ends[j] > 0.0:
                    move_on(tile, j)
        if with_outputs(tile, size) > 0:
            for j in range(size):
                if is_wanted(tile, j):
                    _write(times, outputs, memories, tile, j)
        tick_over(tile, size)
        going, news, following = asked(tile, size)


def _hear(lanes: Lanes, curve: Floats, memories: Memories, tile: Any, j: int) -> None:
    """Let the program of a lane listen."""
    k, lane = tile.place.k[j], tile.place.lane[j]
    firmware, firm = lanes.firmware[lane], memories.firms[k]
    inputs = inputs_of(lanes, curve, curve[:0], lane)
    now = (tile.place.frames[j] + tile.clock.tick[j]) * firmware.T_c + firmware.t_phi
    if controller.has_news(firmware, firm, now):
        store(firmware, tile, j, firm)
        controller.listen(inputs, firm, now)
        load(firmware, firm, tile, j)
        tile.clock.hears[j], tile.clock.follows[j] = ticks(firmware, tile, j, firm.hears) - 1e-6, 0.0
        if firmware.goals > 0.0 and firm.known == 0 and not control.present(firmware):
            written = now - firmware.latency
            piece, end = in_force(inputs.command, 0.0, written + SAME * firmware.T_c, 0.0)
            if piece.start <= written and (piece.slope != 0.0 or piece.amplitude != 0.0):
                put_piece(tile.piece, j, piece)
                tile.clock.follows[j] = 1.0
                tile.clock.hears[j] = ticks(firmware, tile, j, end + firmware.latency) - 1e-6


def _decide_alone(lanes: Lanes, curve: Floats, memories: Memories, tile: Any, j: int) -> None:
    """Let the program of one lane decide."""
    k, lane = tile.place.k[j], tile.place.lane[j]
    firmware, firm, numbers = lanes.firmware[lane], memories.firms[k], numbers_of(lanes, lane)
    store(firmware, tile, j, firm)
    if tile.plan.delayed[j] > 0.0:
        firm.duty = tile.loop.coming[j]
    q, w, y = tile.loop.q[j], tile.loop.w[j], memories.rows[k].point.y
    here = one_body(q, w, y)
    angle = q
    if firmware.per_volt != 0.0:
        v = sensed_voltage(numbers.sensor, curve, q)
        angle = controller.angle_of(firmware, firm, v, lanes.seeds[lane])
    sensed = controller.sensed_by(numbers, firm, here) if control.senses(firmware) else NOTHING_SENSED
    now = (tile.place.frames[j] + tile.clock.tick[j]) * firmware.T_c + firmware.t_phi
    given = control.tick(firmware, firm, angle, sensed, now - firm.heard)
    load(firmware, firm, tile, j)
    tile.plan.given[j] = given


def _write(times: Floats, outputs: Floats, memories: Memories, tile: Any, j: int) -> None:
    """Write the outputs of a lane in this tick."""
    k, dry, T_c = tile.place.k[j], tile.body.dry[j] > 0.0, tile.program.T_c[j]
    firm, y = memories.firms[k], memories.rows[k].point.y
    firm.duty = tile.loop.duty[j]
    if tile.plan.usual[j] > 0.0:
        firm.r = firm.goal = tile.loop.goal[j]
    while is_wanted(tile, j):
        s = min(max(tile.clock.output[j] - tile.clock.tick[j], 0.0), 1.0) * T_c
        q, w, way = seen(tile, j, s)
        contact = FREE
        if dry:
            contact = STUCK if way == 0.0 else FORWARD if way > 0.0 else BACKWARD
        here = one_body(q, w, y)
        tick_legs.show_one(outputs[k], tile.place.output[j], here, Mode(0, contact, RIGID, FREE, 0), firm)
        tile.place.output[j] += 1
        await_output(times, tile, j)
