"""Pulse servos side by side: a block of lanes goes from frame to frame, each through up to four phases.

In a frame window the bridge finishes the drive left over from the frame before, rests until the decision, drives, and
rests. A lane that hits a stop, decides after the next edge or needs too many legs is marked and left to `runs`. What
a lane does never depends on its neighbours.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin.models.kernels import block_phases, block_plan, legs
from servotwin.models.kernels import block_rows as at
from servotwin.models.kernels.legs import Shaft
from servotwin.models.kernels.noise import gaussian
from servotwin.models.kernels.plant import BACKWARD, FORWARD, FREE, STUCK

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Indices, Lanes, Numbers, Outputs


def run(lanes: Lanes, braked: bool, duration: float, times: Numbers, outputs: Outputs, s: Numbers, t: Numbers,
        n: Indices) -> None:
    """Run all lanes of a chunk, all of them `braked` or none.

    `s`, `t` and `n` are room for at.NUMBERS, at.TIMES and at.INTEGERS numbers.
    """
    start = 0
    total = lanes.torque.size
    while start < total:
        size = min(at.BLOCK, total - start)
        run_block(lanes, start, size, braked, duration, times, outputs, s, t, n)
        start += size


def run_block(lanes: Lanes, start: int, size: int, braked: bool, duration: float, times: Numbers, outputs: Outputs,
              s: Numbers, t: Numbers, n: Indices) -> None:
    """Run the lanes from `start` on, `size` of them."""
    own_edges = full = noisy = late = False
    at.fill_chips(lanes, start, size, s)
    at.fill_shafts(lanes.plants, lanes.torque, start, size, s)
    for j in range(size):
        lane = start + j
        at.fill(lanes, lane, j, s, t, n)
        own_edges = own_edges or n[at.COUNT + j] >= 0
        late = late or (n[at.COUNT + j] == 0 or (n[at.COUNT + j] > 0 and lanes.edges[n[at.FIRST + j]] > 0.0))
        noisy = noisy or lanes.chips[6, lane] != 0.0
        full = full or _needs_all(lanes.chips, lane)
        n[at.INDEX + j] = 0
        t[at.OUTPUT + j] = times[0] if times.size > 0 else math.inf
    k = -1 if late else 0
    while block_plan.edges(lanes.edges, k, size, own_edges, duration, s, t, n) > 0:
        block_plan.commands(lanes.pieces, size, t, n, s)
        if noisy:
            for j in range(size):
                s[at.DRAW + j] = gaussian(lanes.seeds[start + j], k)
        if full:
            block_plan.measure_voltages(size, s)
            block_plan.plan_all(size, s)
        else:
            block_plan.plan(size, s)
        wanted = block_plan.wanted(size, t)
        block_phases.phases(size, wanted > 0, braked, s, n)
        if wanted > 0:
            _write(start, size, times, outputs, s, t, n)
        k += 1
    for j in range(size):
        outputs.given_up[start + j] = 1 if s[at.LOST + j] != 0.0 else 0
        outputs.final[start + j, 0] = s[at.Q + j]
        outputs.final[start + j, 1] = s[at.W + j]


def _needs_all(c: Numbers, lane: int) -> bool:
    """Tell whether a chip has noise, a coupling or an RC stretcher."""
    return bool(c[4, lane] != 0.0 or c[5, lane] != 0.0 or c[6, lane] != 0.0 or c[10, lane] != 0.0)


def _write(start: int, size: int, times: Numbers, outputs: Outputs, s: Numbers, t: Numbers, n: Indices) -> None:
    """Write the outputs of this window, each from the leg that holds it."""
    for j in range(size):
        while t[at.OUTPUT + j] < t[at.NEXT + j]:
            o = n[at.INDEX + j]
            if s[at.LOST + j] == 0.0:
                s[at.TIME + j] = t[at.OUTPUT + j] - t[at.NOW + j]
                _write_one(start + j, o, j, outputs, s)
            n[at.INDEX + j] = o + 1
            t[at.OUTPUT + j] = times[o + 1] if o + 1 < times.size else math.inf


def _write_one(lane: int, o: int, j: int, outputs: Outputs, s: Numbers) -> None:
    x = s[at.TIME + j]
    drive, error, q, w, begin = s[at.DRIVE1 + j], s[at.ERROR + j], s[at.Q1 + j], s[at.W1 + j], 0.0
    if x >= s[at.END3 + j]:
        drive, error, q, w, begin = 0.0, s[at.NEW_ERROR + j], s[at.Q4 + j], s[at.W4 + j], s[at.END3 + j]
    elif x >= s[at.END2 + j]:
        drive, error, q, w, begin = s[at.DRIVE3 + j], s[at.NEW_ERROR + j], s[at.Q3 + j], s[at.W3 + j], s[at.END2 + j]
    elif x >= s[at.END1 + j]:
        drive, q, w, begin = 0.0, s[at.Q2 + j], s[at.W2 + j], s[at.END1 + j]
    shaft = at.shaft_at(s, j)
    q, w, _ = legs.slide(shaft, drive, q, w, x - begin)
    if outputs.angle.size > 0:
        outputs.angle[lane, o] = q
    if outputs.speed.size > 0:
        outputs.speed[lane, o] = w
    if outputs.contact.size > 0:
        outputs.contact[lane, o] = _contact(shaft, drive, w)
    if outputs.drive.size > 0:
        outputs.drive[lane, o] = 1 if drive > 0.0 else (-1 if drive < 0.0 else 0)
    if outputs.error.size > 0:
        outputs.error[lane, o] = error


def _contact(shaft: Shaft, drive: float, w: float) -> int:
    if shaft.friction_forward == 0.0 and shaft.friction_backward == 0.0:
        return FREE
    way = w if w != 0.0 else legs.start_of(shaft, drive)
    if way == 0.0:
        return STUCK
    return FORWARD if way > 0.0 else BACKWARD
