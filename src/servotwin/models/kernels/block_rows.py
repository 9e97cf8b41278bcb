"""The room in which pulse servos run side by side: what stands where.

All numbers of a block stand in one array, a row of BLOCK lanes for each quantity, so that the compiler sees which
places are apart. Times within a frame count from its edge, so that float32 keeps their digits; edges are float64.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.kernels import legs
from servotwin.models.kernels.frame import Chip
from servotwin.models.kernels.legs import Shaft
from servotwin.models.kernels.plant import Plant

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]
    Indices = NDArray[np.int64]
    Smalls = NDArray[np.int8]

FEW = 2  # lanes that are not worth going together
BLOCK = 128  # lanes that go together; their numbers fit into the first cache

# Rows of the block: the shaft's numbers, the chip's, what the chip measures the current with, then state and plan.
SHAFT = 0
(RATE_DRIVE, RATE_OFF, RATE_FREE, PER_RATE_DRIVE, PER_RATE_OFF, PER_RATE_FREE, PUSH, DRAG_DRIVE, DRAG_OFF, SPEED,
 GAP_DRIVE, GAP_OFF, FRICTION_FORWARD, FRICTION_BACKWARD, AGAINST, START_FORWARD, START_BACKWARD, START_OFF, LOWER,
 UPPER) = range(SHAFT, SHAFT + 20 * BLOCK, BLOCK)
CHIP = SHAFT + 20 * BLOCK
BACK_EMF, D_DRIVE, R_DRIVE, D_OFF, R_OFF = range(CHIP + 20 * BLOCK, CHIP + 25 * BLOCK, BLOCK)
STATE = CHIP + 25 * BLOCK
Q, W, DRIVE, LEFT, CLOCK, ERROR, WIDTH, DRAW, WINDOW, REMAINING, EDGE, LOST = range(
    STATE, STATE + 12 * BLOCK, BLOCK)
PLAN = STATE + 12 * BLOCK
END1, END2, END3, TIME1, TIME2, TIME3, TIME4, DRIVE1, DRIVE3, NEW_ERROR, TIME, POWER, ENDS, V_M, V_BUS = range(
    PLAN, PLAN + 15 * BLOCK, BLOCK)
STARTS = PLAN + 15 * BLOCK  # angle and speed at the start of each phase
Q1, W1, Q2, W2, Q3, W3, Q4, W4 = range(STARTS, STARTS + 8 * BLOCK, BLOCK)
LEG = STARTS + 8 * BLOCK
EDGE_SPEED, PULL_THERE, RATE, PER_RATE, PULL, WAY_TIME, WAY_ANGLE = range(LEG, LEG + 7 * BLOCK, BLOCK)
NUMBERS = LEG + 7 * BLOCK

# Rows of float64: this frame's edge and the next one, when the command needs a look, the next output, the period
NOW, NEXT, DUE, OUTPUT, PERIOD = range(0, 5 * BLOCK, BLOCK)
TIMES = 5 * BLOCK
# Rows of int64: the command's piece and its last one, the next output, first edge and number of edges (−1: regular),
# and a list of lanes. Lists are written without branches: a wrong guess costs more than an entry.
PIECE, LAST, INDEX, FIRST, COUNT, WHICH = range(0, 6 * BLOCK, BLOCK)
INTEGERS = 6 * BLOCK


class Lanes(NamedTuple):
    """What comes in, for all lanes of a chunk; each array has a column or an entry for each lane."""

    plants: Numbers  # (49, B), fields of Plant
    chips: Numbers  # (21, B), fields of Chip
    start: Numbers  # (7, B), numbers of the state at t = 0
    torque: Numbers
    seeds: Indices
    pieces: Numbers  # (n, 7)
    piece_first: Indices
    piece_count: Indices
    edges: Numbers
    edge_first: Indices
    edge_count: Indices


class Outputs(NamedTuple):
    """What goes out: (B, T) each, or (0, 0) where it is not wanted; which lanes were given up, and where all ended."""

    angle: Numbers
    speed: Numbers
    contact: Smalls
    drive: Smalls
    error: Numbers
    given_up: Smalls
    final: Numbers  # (B, 4), float64: last angle and speed, temperatures of winding and housing


def fill_shafts(plants: Numbers, torque: Numbers, start: int, size: int, s: Numbers) -> None:
    """Put what the legs and the measurement of the current read into the block."""
    for j in range(size):
        plant = plant_at(plants, start + j)
        _put_shaft(legs.shaft_of(plant, torque[start + j]), s, j)
        s[BACK_EMF + j] = plant.K_b
        s[D_DRIVE + j] = plant.D_drive
        s[R_DRIVE + j] = plant.R_drive
        s[D_OFF + j] = plant.D_off
        s[R_OFF + j] = plant.R_off


def fill(lanes: Lanes, lane: int, j: int, s: Numbers, t: Numbers, n: Indices) -> None:
    """Put a lane's state and the places of its command into column j of the block."""
    s[Q + j] = lanes.start[0, lane]
    s[W + j] = lanes.start[1, lane]
    s[DRIVE + j] = s[LEFT + j] = s[ERROR + j] = s[LOST + j] = s[DRAW + j] = s[NEW_ERROR + j] = 0.0
    s[CLOCK + j] = math.inf
    t[PERIOD + j] = lanes.chips[14, lane]
    t[DUE + j] = -math.inf
    n[PIECE + j] = lanes.piece_first[lane]
    n[LAST + j] = lanes.piece_first[lane] + lanes.piece_count[lane] - 1
    n[FIRST + j] = lanes.edge_first[lane]
    n[COUNT + j] = lanes.edge_count[lane]


def fill_chips(lanes: Lanes, start: int, size: int, s: Numbers) -> None:
    """Put the chips of all lanes into the block."""
    for i in range(20):
        for j in range(size):
            s[CHIP + i * BLOCK + j] = lanes.chips[i, start + j]


def plant_at(c: Numbers, j: int) -> Plant:
    """Return the plant in column j."""
    return Plant(c[0, j], c[1, j], c[2, j], c[3, j], c[4, j], c[5, j], c[6, j], c[7, j], c[8, j], c[9, j], c[10, j],
                 c[11, j], c[12, j], c[13, j], c[14, j], c[15, j], c[16, j], c[17, j], c[18, j], c[19, j], c[20, j],
                 c[21, j], c[22, j], c[23, j], c[24, j], c[25, j], c[26, j], c[27, j], c[28, j], c[29, j], c[30, j],
                 c[31, j], c[32, j], c[33, j], c[34, j], c[35, j], c[36, j], c[37, j], c[38, j], c[39, j], c[40, j],
                 c[41, j], c[42, j], c[43, j], c[44, j], c[45, j], c[46, j], c[47, j], c[48, j])


def _put_shaft(shaft: Shaft, s: Numbers, j: int) -> None:
    s[RATE_DRIVE + j] = shaft.rate_drive
    s[RATE_OFF + j] = shaft.rate_off
    s[RATE_FREE + j] = shaft.rate_free
    s[PER_RATE_DRIVE + j] = shaft.per_rate_drive
    s[PER_RATE_OFF + j] = shaft.per_rate_off
    s[PER_RATE_FREE + j] = shaft.per_rate_free
    s[PUSH + j] = shaft.push
    s[DRAG_DRIVE + j] = shaft.drag_drive
    s[DRAG_OFF + j] = shaft.drag_off
    s[SPEED + j] = shaft.speed
    s[GAP_DRIVE + j] = shaft.gap_drive
    s[GAP_OFF + j] = shaft.gap_off
    s[FRICTION_FORWARD + j] = shaft.friction_forward
    s[FRICTION_BACKWARD + j] = shaft.friction_backward
    s[AGAINST + j] = shaft.against
    s[START_FORWARD + j] = shaft.start_forward
    s[START_BACKWARD + j] = shaft.start_backward
    s[START_OFF + j] = shaft.start_off
    s[LOWER + j] = shaft.lower
    s[UPPER + j] = shaft.upper


def shaft_at(s: Numbers, j: int) -> Shaft:
    """Return what the legs of lane j read."""
    return Shaft(
        s[RATE_DRIVE + j], s[RATE_OFF + j], s[RATE_FREE + j], s[PER_RATE_DRIVE + j], s[PER_RATE_OFF + j],
        s[PER_RATE_FREE + j], s[PUSH + j], s[DRAG_DRIVE + j], s[DRAG_OFF + j], s[SPEED + j], s[GAP_DRIVE + j],
        s[GAP_OFF + j], s[FRICTION_FORWARD + j], s[FRICTION_BACKWARD + j], s[AGAINST + j], s[START_FORWARD + j],
        s[START_BACKWARD + j], s[START_OFF + j], s[LOWER + j], s[UPPER + j])


def driven_shaft_at(s: Numbers, j: int) -> Shaft:
    """Return a shaft for drives alone: the numbers between drives are replaced, so that choosing costs nothing."""
    x = shaft_at(s, j)
    return Shaft(x.rate_drive, x.rate_drive, x.rate_free, x.per_rate_drive, x.per_rate_drive, x.per_rate_free, x.push,
                 x.drag_drive, x.drag_drive, x.speed, x.gap_drive, x.gap_drive, x.friction_forward,
                 x.friction_backward, x.against, x.start_forward, x.start_backward, 0.0, x.lower, x.upper)


def idle_shaft_at(s: Numbers, j: int) -> Shaft:
    """Return a shaft for the time between drives alone."""
    x = shaft_at(s, j)
    return Shaft(x.rate_off, x.rate_off, x.rate_free, x.per_rate_off, x.per_rate_off, x.per_rate_free, 0.0,
                 x.drag_off, x.drag_off, 0.0, x.gap_off, x.gap_off, x.friction_forward, x.friction_backward,
                 x.against, x.start_off, x.start_off, x.start_off, x.lower, x.upper)


def chip_at(s: Numbers, j: int) -> Chip:
    """Return the chip of lane j."""
    c = CHIP + j
    return Chip(
        s[c], s[c + BLOCK], s[c + 2 * BLOCK], s[c + 3 * BLOCK], s[c + 4 * BLOCK], s[c + 5 * BLOCK],
        s[c + 6 * BLOCK], s[c + 7 * BLOCK], s[c + 8 * BLOCK], s[c + 9 * BLOCK], s[c + 10 * BLOCK],
        s[c + 11 * BLOCK], s[c + 12 * BLOCK], s[c + 13 * BLOCK], s[c + 14 * BLOCK], s[c + 15 * BLOCK],
        s[c + 16 * BLOCK], s[c + 17 * BLOCK], s[c + 18 * BLOCK], s[c + 19 * BLOCK], 0.0)


def plain_chip_at(s: Numbers, j: int) -> Chip:
    """Return a chip without noise, coupling and RC stretcher."""
    c = CHIP + j
    return Chip(s[c], s[c + BLOCK], s[c + 2 * BLOCK], s[c + 3 * BLOCK], 0.0, 0.0, 0.0, s[c + 7 * BLOCK],
                s[c + 8 * BLOCK], s[c + 9 * BLOCK], 0.0, s[c + 11 * BLOCK], s[c + 12 * BLOCK], s[c + 13 * BLOCK],
                0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
