"""Servos one after the other, each by the general `walk`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.models.kernels import walk
from servotwin.models.kernels.block_rows import plant_at
from servotwin.models.kernels.frame import Chip

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Indices, Lanes, Numbers, Outputs, Smalls


def walk_lanes(pulsed: bool, lanes: Lanes, torques: Numbers, torque_first: Indices, torque_count: Indices,
               which: Indices, duration: float, times: Numbers, outputs: Outputs, status: Smalls, ended: Numbers,
               room: Numbers) -> None:
    """Run the lanes named in `which`; `room` has the shape (5, T)."""
    for k in range(which.size):
        lane = which[k]
        room[:, :] = 0.0
        first, last = lanes.piece_first[lane], lanes.piece_first[lane] + lanes.piece_count[lane]
        begin, end = torque_first[lane], torque_first[lane] + torque_count[lane]
        own = lanes.edge_count[lane]
        edges = lanes.edges[lanes.edge_first[lane]:lanes.edge_first[lane] + max(own, 0)]
        period = 0.0 if own >= 0 else lanes.chips[14, lane]
        how, when = walk.walk(
            pulsed, plant_at(lanes.plants, lane), chip_at(lanes.chips, lane), lanes.pieces[first:last],
            torques[begin:end], lanes.torque[lane], period, edges, lanes.angle[lane], lanes.speed[lane],
            lanes.seeds[lane], duration, times, room)
        status[lane] = how
        ended[lane] = when
        _put(lane, room, outputs)


def chip_at(c: Numbers, j: int) -> Chip:
    """Return the chip in column j."""
    return Chip(c[0, j], c[1, j], c[2, j], c[3, j], c[4, j], c[5, j], c[6, j], c[7, j], c[8, j], c[9, j], c[10, j],
                c[11, j], c[12, j], c[13, j], c[14, j], c[15, j], c[16, j], c[17, j], c[18, j], c[19, j])


def _put(lane: int, room: Numbers, outputs: Outputs) -> None:
    for o in range(room.shape[1]):
        if outputs.angle.size > 0:
            outputs.angle[lane, o] = room[0, o]
        if outputs.speed.size > 0:
            outputs.speed[lane, o] = room[1, o]
        if outputs.contact.size > 0:
            outputs.contact[lane, o] = int(room[2, o])
        if outputs.drive.size > 0:
            outputs.drive[lane, o] = int(room[3, o])
        if outputs.error.size > 0:
            outputs.error[lane, o] = room[4, o]
