"""Digital servos side by side: a tile of lanes goes from tick to tick.

A lane of which something else is due at a tick than its law, as a goal on its way or a protection that counts, decides
alone, as `control.tick` has it. One that hits a stop leaves in the middle of its tick, and what is left of the call is
for `runs`. What a lane does never depends on its neighbours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller
from servotwin.models.engine.batch import digital_rounds as rounds
from servotwin.models.engine.batch import digital_tiles as tiles
from servotwin.models.engine.lanes import ARRIVED, inputs_of, numbers_of
from servotwin.models.engine.legs import tick_legs
from servotwin.models.engine.memory import SAME, in_force
from servotwin.models.state.modes import BACKWARD, FORWARD, FREE, RIGID, STUCK, Mode, one_body
from servotwin.models.terms import control, profile
from servotwin.models.terms.control import NOTHING_SENSED
from servotwin.models.terms.sensor import sensed_voltage

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories


def go_on(lanes: Lanes, curve: Floats, torques: Floats, torque_first: Indices, torque_count: Indices,
          which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats, memories: Memories,
          status: Indices, room: Any) -> None:
    """Let the lanes named in `which` go on side by side, as far as that leads; `runs.go_on` finishes them all.

    The arguments are those of `runs.go_on`, and room for a tile. Durations [s] and outputs that are left to do, and
    the status of lanes that have gone on, are noted for it.
    """
    tile, size = room[0], 0
    for k in range(which.size):
        lane = which[k]
        torque = torques[torque_first[lane]:torque_first[lane] + torque_count[lane]]
        if status[k] != ARRIVED and tiles.enter(lanes, curve, torque, k, lane, durations[k], times, first_output[k],
                                                memories, tile, size):
            size += 1
        if size == tiles.TOGETHER or (size > 0 and k == which.size - 1):
            _through(lanes, curve, times, outputs, memories, tile, size)
            tiles.leave(lanes, durations, first_output, memories, status, tile, size)
            size = 0


def _through(lanes: Lanes, curve: Floats, times: Floats, outputs: Floats, memories: Memories, tile: Any,
             size: int) -> None:
    """Let all lanes of a tile go on from tick to tick."""
    senses = rounds.any_senses(tile, size)
    going, news, following = rounds.asked(tile, size)
    while going > 0:
        if news > 0:
            for j in range(size):
                if tile.clock.left[j] > 0.0 and tile.clock.tick[j] >= tile.clock.hears[j]:
                    _hear(lanes, curve, memories, tile, j)
        if following > 0:
            rounds.follow(tile, size)
        if senses:
            rounds.watch(tile, size)
        else:
            for j in range(size):
                tile.plan.usual[j] = 1.0
        if rounds.decide(tile, size) > 0:
            for j in range(size):
                if tile.plan.usual[j] == 0.0 and tile.clock.left[j] > 0.0:
                    _decide_alone(lanes, curve, memories, tile, j)
        if rounds.move(tile, size) > 0:
            for j in range(size):
                if tile.plan.ends[j] > 0.0:
                    rounds.move_on(tile, j)
        if rounds.with_outputs(tile, size) > 0:
            for j in range(size):
                if rounds.is_wanted(tile, j):
                    _write(times, outputs, memories, tile, j)
        rounds.tick_over(tile, size)
        going, news, following = rounds.asked(tile, size)


def _hear(lanes: Lanes, curve: Floats, memories: Memories, tile: Any, j: int) -> None:
    """Let the program of a lane listen."""
    k, lane = tile.place.k[j], tile.place.lane[j]
    firmware, firm = lanes.firmware[lane], memories.firms[k]
    inputs = inputs_of(lanes, curve, curve[:0], lane)
    now = (tile.place.frames[j] + tile.clock.tick[j]) * firmware.T_c + firmware.t_phi
    if controller.has_news(firmware, firm, now):
        tiles.store(firmware, tile, j, firm)
        controller.listen(inputs, firm, now)
        tiles.load(firmware, firm, tile, j)
        tile.clock.hears[j], tile.clock.follows[j] = tiles.ticks(firmware, tile, j, firm.hears) - 1e-6, 0.0
        if firmware.goals > 0.0 and firm.known == 0 and not profile.present(firmware):
            written = now - firmware.latency
            piece, end = in_force(inputs.command, 0.0, written + SAME * firmware.T_c, 0.0)
            if piece.start <= written and (piece.slope != 0.0 or piece.amplitude != 0.0):
                tiles.put_piece(tile.piece, j, piece)
                tile.clock.follows[j] = 1.0
                tile.clock.hears[j] = tiles.ticks(firmware, tile, j, end + firmware.latency) - 1e-6


def _decide_alone(lanes: Lanes, curve: Floats, memories: Memories, tile: Any, j: int) -> None:
    """Let the program of one lane decide."""
    k, lane = tile.place.k[j], tile.place.lane[j]
    firmware, firm, numbers = lanes.firmware[lane], memories.firms[k], numbers_of(lanes, lane)
    tiles.store(firmware, tile, j, firm)
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
    tiles.load(firmware, firm, tile, j)
    tile.plan.given[j] = given


def _write(times: Floats, outputs: Floats, memories: Memories, tile: Any, j: int) -> None:
    """Write the outputs of a lane in this tick."""
    k, dry, T_c = tile.place.k[j], tile.body.dry[j] > 0.0, tile.program.T_c[j]
    firm, y = memories.firms[k], memories.rows[k].point.y
    firm.duty = tile.loop.duty[j]
    if tile.plan.usual[j] > 0.0:
        firm.r = firm.goal = tile.loop.goal[j]
    while rounds.is_wanted(tile, j):
        s = min(max(tile.clock.output[j] - tile.clock.tick[j], 0.0), 1.0) * T_c
        q, w, way = rounds.seen(tile, j, s)
        contact = FREE
        if dry:
            contact = STUCK if way == 0.0 else FORWARD if way > 0.0 else BACKWARD
        here = one_body(q, w, y)
        tick_legs.show_one(outputs[k], tile.place.output[j], here, Mode(0, contact, RIGID, FREE, 0), firm)
        tile.place.output[j] += 1
        tiles.await_output(times, tile, j)
