"""Kernels that look at lanes as they stand, one by one or side by side, under their present inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.lanes import chip_of, inputs_of, numbers_of
from servotwin.models.engine.memory import memory_at, time_of
from servotwin.models.engine.observe import Observed, observed, told_by
from servotwin.models.engine.run.run import as_now, mode_under, told
from servotwin.models.state.modes import RIGID, Vector
from servotwin.models.state.records import TILE
from servotwin.models.terms import duty
from servotwin.models.terms.frame import present as pulsed_chip
from servotwin.models.terms.numbers import warm
from servotwin.models.terms.sensor import slack
from servotwin.physics.pieces import piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories


def one_by_one(lanes: Lanes, curve: Floats, torque_rows: Floats, torque_first: Indices, torque_count: Indices,
               which: Indices, memories: Memories, seen: Floats) -> None:
    """Look at the lanes named in `which`, whose memories are given; `seen` has a row of signals for each."""
    for k in range(which.size):
        lane = which[k]
        numbers, chip = numbers_of(lanes, lane), chip_of(lanes, lane)
        inputs = inputs_of(lanes, curve, torque_rows[torque_first[lane]:torque_first[lane] + torque_count[lane]], lane)
        memory = memory_at(memories, k)
        point, now, time = memory.point, memory.chip, time_of(memory)
        u, tau = told(numbers, pulsed_chip(chip), inputs, memory)
        numbers = as_now(numbers, inputs, memory)
        mode = mode_under(numbers, u, tau, memory)
        shown = observed(warm(numbers, point.y), curve, mode, piece_value(u, time), piece_value(tau, time), point.y,
                         point.wiper, now.drive, now.error)
        put(seen, lane, told_by(numbers.bridge, memory.firm[0], shown) if duty.present(numbers.bridge) else shown)


def side_by_side(lanes: Lanes, curve: Floats, which: Indices, tile_rows: Any, seen: Floats) -> None:
    """Look at the lanes named in `which`, which tiles of a form hold."""
    for k in range(which.size):
        lane, servo, j = which[k], tile_rows[k // TILE].servo, k % TILE
        numbers, tau = numbers_of(lanes, lane), lanes.torque[lane]
        q, w, drive, error = 1.0 * servo.q[j], 1.0 * servo.w[j], 1.0 * servo.drive[j], 1.0 * servo.error[j]  # float64
        wiper, mesh = 1.0 * servo.wiper[j] if slack(numbers.sensor) else q, int(servo.mesh[j])
        q_m, w_m = (q, w) if mesh == RIGID else (1.0 * servo.q_m[j], 1.0 * servo.w_m[j])
        y = Vector(q, w, 1.0 * servo.i[j], 1.0 * servo.T_w[j], 1.0 * servo.T_h[j], q_m, w_m)
        numbers = warm(numbers, y)
        u = drive * numbers.source.V
        mode = contacts.settled(numbers, currents.zone_of(numbers, u, 0.0, q, w_m, y.i), u, tau, y, mesh, False)
        put(seen, lane, observed(numbers, curve, mode, u, tau, y, wiper, drive, error))


def put(seen: Floats, lane: int, values: Observed) -> None:
    """Put the signals of a lane into its row."""
    for k in range(len(values)):
        seen[lane, k] = values[k]
