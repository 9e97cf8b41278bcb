"""Servos one after the other, each by the general `walk`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.models.kernels import walk
from servotwin.models.kernels.block_rows import plant_at
from servotwin.models.kernels.frame import Chip
from servotwin.models.kernels.plant import INSIDE, RIGID

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Indices, Lanes, Numbers


def walk_lanes(pulsed: bool, lanes: Lanes, curve: Numbers, torques: Numbers, torque_first: Indices,
               torque_count: Indices, which: Indices, duration: float, times: Numbers, outputs: Numbers,
               final: Numbers, status: Indices, ended: Numbers) -> None:
    """Run the lanes named in `which`; `outputs` has the shape (n, 13, T), as in `walk`, and is zero.

    `final`, shape (n, 4), is where they end.
    """
    for k in range(which.size):
        lane = which[k]
        first, last = lanes.piece_first[lane], lanes.piece_first[lane] + lanes.piece_count[lane]
        begin, end = torque_first[lane], torque_first[lane] + torque_count[lane]
        own = lanes.edge_count[lane]
        edges = lanes.edges[lanes.edge_first[lane]:lanes.edge_first[lane] + max(own, 0)]
        period = 0.0 if own >= 0 else lanes.chips[14, lane]
        plant, y = plant_at(lanes.plants, lane), lanes.start
        start = walk.started((y[0, lane], y[1, lane], y[2, lane], y[3, lane], y[4, lane], y[5, lane], y[6, lane]),
                             INSIDE if plant.half_play > 0.0 else RIGID)
        how, when = walk.walk(
            pulsed, plant, chip_at(lanes.chips, lane), curve, lanes.pieces[first:last], torques[begin:end],
            lanes.torque[lane], period, edges, start, lanes.seeds[lane], duration, times, outputs[k], final[k])
        status[k] = how
        ended[k] = when


def chip_at(c: Numbers, j: int) -> Chip:
    """Return the chip in column j."""
    return Chip(c[0, j], c[1, j], c[2, j], c[3, j], c[4, j], c[5, j], c[6, j], c[7, j], c[8, j], c[9, j], c[10, j],
                c[11, j], c[12, j], c[13, j], c[14, j], c[15, j], c[16, j], c[17, j], c[18, j], c[19, j], c[20, j])
