"""Pulse servos side by side: a block of lanes goes from frame to frame, each through up to four phases.

In a frame window the bridge finishes the drive left over from the frame before, rests until the decision, drives, and
rests. All lanes take the first leg of a phase together, without branches, so that a compiler can run them in vectors;
those that stop or pass the edge of a dead zone on the way go on alone. A lane that hits a stop, decides after the
next edge or needs too many legs is marked and left to `walk`. What a lane does never depends on its neighbours.

All numbers of a block stand in one array, a row of BLOCK lanes for each quantity, so that the compiler sees which
places are apart. Times within a frame count from its edge, so that float32 keeps their digits; edges are float64.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.kernels import frame, legs
from servotwin.models.kernels.elementary import decay, fma
from servotwin.models.kernels.frame import Chip
from servotwin.models.kernels.hybrid import BACKWARD, FORWARD, FREE, STUCK, Plant
from servotwin.models.kernels.legs import Shaft
from servotwin.models.kernels.noise import gaussian
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]
    Indices = NDArray[np.int64]
    Smalls = NDArray[np.int8]

_FEW = 4  # lanes that go on one by one rather than all together
BLOCK = 64  # lanes that go together; their numbers fit into the first cache

# Rows of the block: the shaft's numbers, the chip's, what the chip measures the current with, then state and plan.
_SHAFT = 0
_CHIP = _SHAFT + 20 * BLOCK
_BACK_EMF, _D_DRIVE, _R_DRIVE, _D_OFF, _R_OFF = range(_CHIP + 20 * BLOCK, _CHIP + 25 * BLOCK, BLOCK)
_STATE = _CHIP + 25 * BLOCK
_Q, _W, _DRIVE, _LEFT, _CLOCK, _ERROR, _WIDTH, _DRAW, _WINDOW, _REMAINING, _EDGE, _LOST = range(
    _STATE, _STATE + 12 * BLOCK, BLOCK)
_PLAN = _STATE + 12 * BLOCK
_END1, _END2, _END3, _TIME1, _TIME2, _TIME3, _TIME4, _DRIVE1, _DRIVE3, _NEW_ERROR, _TIME, _POWER, _ENDS, _V_M, _V_BUS = (
    range(_PLAN, _PLAN + 15 * BLOCK, BLOCK))
_STARTS = _PLAN + 15 * BLOCK  # angle and speed at the start of each phase
_Q1, _W1, _Q2, _W2, _Q3, _W3, _Q4, _W4 = range(_STARTS, _STARTS + 8 * BLOCK, BLOCK)
_WAY = _STARTS + 8 * BLOCK  # to the edge of a leg, by lane; and five rows for the lanes that go there
_EDGE_SPEED, _PULL_THERE, _RATE, _PER_RATE, _A, _B, _C, _D, _E = range(_WAY, _WAY + 9 * BLOCK, BLOCK)
_G = _WAY + 9 * BLOCK  # what the further legs of such lanes read
NUMBERS = _G + 14 * BLOCK

# Rows of float64: this frame's edge and the next one, when the command needs a look, the next output, the period
_NOW, _NEXT, _DUE, _OUTPUT, _PERIOD = range(0, 5 * BLOCK, BLOCK)
TIMES = 5 * BLOCK
# Rows of int64: the command's piece and its last one, the next output, first edge and number of edges (−1: regular)
_PIECE, _LAST, _INDEX, _FIRST, _COUNT, _WHICH = range(0, 6 * BLOCK, BLOCK)
INTEGERS = 6 * BLOCK


class Lanes(NamedTuple):
    """What comes in, for all lanes of a chunk; each array has a column or an entry for each lane."""

    plants: Numbers  # (28, B), fields of Plant
    chips: Numbers  # (20, B), fields of Chip
    torque: Numbers
    angle: Numbers
    speed: Numbers
    seeds: Indices
    pieces: Numbers  # (n, 7)
    piece_first: Indices
    piece_count: Indices
    edges: Numbers
    edge_first: Indices
    edge_count: Indices


class Outputs(NamedTuple):
    """What goes out: (B, T) each, or (0, 0) where it is not wanted; and which lanes were given up."""

    angle: Numbers
    speed: Numbers
    contact: Smalls
    drive: Smalls
    error: Numbers
    given_up: Smalls


def run(lanes: Lanes, duration: float, times: Numbers, outputs: Outputs, s: Numbers, t: Numbers, n: Indices) -> None:
    """Run all lanes of a chunk; `s`, `t` and `n` are room for NUMBERS, TIMES and INTEGERS."""
    start = 0
    total = lanes.angle.size
    while start < total:
        size = min(BLOCK, total - start)
        run_block(lanes, start, size, duration, times, outputs, s, t, n)
        start += size


def run_block(lanes: Lanes, start: int, size: int, duration: float, times: Numbers, outputs: Outputs,
              s: Numbers, t: Numbers, n: Indices) -> None:
    """Run the lanes from `start` on, `size` of them."""
    own_edges = full = noisy = late = False
    for j in range(size):
        lane = start + j
        _fill(lanes, lane, j, s, t, n)
        own_edges = own_edges or n[_COUNT + j] >= 0
        late = late or (n[_COUNT + j] == 0 or (n[_COUNT + j] > 0 and lanes.edges[n[_FIRST + j]] > 0.0))
        noisy = noisy or lanes.chips[6, lane] != 0.0
        full = full or noisy or lanes.chips[4, lane] != 0.0 or lanes.chips[5, lane] != 0.0 or lanes.chips[10, lane] != 0.0
        n[_INDEX + j] = 0
        t[_OUTPUT + j] = times[0] if times.size > 0 else math.inf
    k = -1 if late else 0
    while _edges(lanes, k, size, own_edges, duration, s, t, n) > 0:
        _commands(lanes, size, t, n, s)
        if noisy:
            for j in range(size):
                s[_DRAW + j] = gaussian(lanes.seeds[start + j], k)
        if full:
            _measure_voltages(size, s)
            _plan_all(size, s)
        else:
            _plan(size, s)
        wanted = _wanted(size, t)
        _phases(size, wanted > 0, s, n)
        if wanted > 0:
            _write(start, size, times, outputs, s, t, n)
        k += 1
    for j in range(size):
        outputs.given_up[start + j] = 1 if s[_LOST + j] != 0.0 else 0


def _fill(lanes: Lanes, lane: int, j: int, s: Numbers, t: Numbers, n: Indices) -> None:
    """Put a lane's numbers into column j of the block."""
    plant = plant_at(lanes.plants, lane)
    _put_shaft(legs.shaft_of(plant, lanes.torque[lane]), s, j)
    for i in range(20):
        s[_CHIP + i * BLOCK + j] = lanes.chips[i, lane]
    s[_BACK_EMF + j] = plant.K_b
    s[_D_DRIVE + j] = plant.D_drive
    s[_R_DRIVE + j] = plant.R_drive
    s[_D_OFF + j] = plant.D_off
    s[_R_OFF + j] = plant.R_off
    s[_Q + j] = lanes.angle[lane]
    s[_W + j] = lanes.speed[lane]
    s[_DRIVE + j] = s[_LEFT + j] = s[_ERROR + j] = s[_LOST + j] = s[_DRAW + j] = s[_NEW_ERROR + j] = 0.0
    s[_CLOCK + j] = math.inf
    t[_PERIOD + j] = lanes.chips[14, lane]
    t[_DUE + j] = -math.inf
    n[_PIECE + j] = lanes.piece_first[lane]
    n[_LAST + j] = lanes.piece_first[lane] + lanes.piece_count[lane] - 1
    n[_FIRST + j] = lanes.edge_first[lane]
    n[_COUNT + j] = lanes.edge_count[lane]


def plant_at(c: Numbers, j: int) -> Plant:
    """Return the plant in column j."""
    return Plant(c[0, j], c[1, j], c[2, j], c[3, j], c[4, j], c[5, j], c[6, j], c[7, j], c[8, j], c[9, j], c[10, j],
                 c[11, j], c[12, j], c[13, j], c[14, j], c[15, j], c[16, j], c[17, j], c[18, j], c[19, j], c[20, j],
                 c[21, j], c[22, j], c[23, j], c[24, j], c[25, j], c[26, j], c[27, j])


def _put_shaft(shaft: Shaft, s: Numbers, j: int) -> None:
    s[_SHAFT + j] = shaft.rate_drive
    s[_SHAFT + BLOCK + j] = shaft.rate_off
    s[_SHAFT + 2 * BLOCK + j] = shaft.rate_free
    s[_SHAFT + 3 * BLOCK + j] = shaft.per_rate_drive
    s[_SHAFT + 4 * BLOCK + j] = shaft.per_rate_off
    s[_SHAFT + 5 * BLOCK + j] = shaft.per_rate_free
    s[_SHAFT + 6 * BLOCK + j] = shaft.push
    s[_SHAFT + 7 * BLOCK + j] = shaft.drag_drive
    s[_SHAFT + 8 * BLOCK + j] = shaft.drag_off
    s[_SHAFT + 9 * BLOCK + j] = shaft.speed
    s[_SHAFT + 10 * BLOCK + j] = shaft.gap_drive
    s[_SHAFT + 11 * BLOCK + j] = shaft.gap_off
    s[_SHAFT + 12 * BLOCK + j] = shaft.friction_forward
    s[_SHAFT + 13 * BLOCK + j] = shaft.friction_backward
    s[_SHAFT + 14 * BLOCK + j] = shaft.against
    s[_SHAFT + 15 * BLOCK + j] = shaft.start_forward
    s[_SHAFT + 16 * BLOCK + j] = shaft.start_backward
    s[_SHAFT + 17 * BLOCK + j] = shaft.start_off
    s[_SHAFT + 18 * BLOCK + j] = shaft.lower
    s[_SHAFT + 19 * BLOCK + j] = shaft.upper


def _shaft_at(s: Numbers, j: int) -> Shaft:
    return Shaft(
        s[_SHAFT + j], s[_SHAFT + BLOCK + j], s[_SHAFT + 2 * BLOCK + j], s[_SHAFT + 3 * BLOCK + j],
        s[_SHAFT + 4 * BLOCK + j], s[_SHAFT + 5 * BLOCK + j], s[_SHAFT + 6 * BLOCK + j], s[_SHAFT + 7 * BLOCK + j],
        s[_SHAFT + 8 * BLOCK + j], s[_SHAFT + 9 * BLOCK + j], s[_SHAFT + 10 * BLOCK + j], s[_SHAFT + 11 * BLOCK + j],
        s[_SHAFT + 12 * BLOCK + j], s[_SHAFT + 13 * BLOCK + j], s[_SHAFT + 14 * BLOCK + j],
        s[_SHAFT + 15 * BLOCK + j], s[_SHAFT + 16 * BLOCK + j], s[_SHAFT + 17 * BLOCK + j],
        s[_SHAFT + 18 * BLOCK + j], s[_SHAFT + 19 * BLOCK + j])


def _driven_shaft_at(s: Numbers, j: int) -> Shaft:
    """Return a shaft for drives alone: the numbers between drives are replaced, so that choosing costs nothing."""
    x = _shaft_at(s, j)
    return Shaft(x.rate_drive, x.rate_drive, x.rate_free, x.per_rate_drive, x.per_rate_drive, x.per_rate_free, x.push,
                 x.drag_drive, x.drag_drive, x.speed, x.gap_drive, x.gap_drive, x.friction_forward,
                 x.friction_backward, x.against, x.start_forward, x.start_backward, 0.0, x.lower, x.upper)


def _idle_shaft_at(s: Numbers, j: int) -> Shaft:
    """Return a shaft for the time between drives alone."""
    x = _shaft_at(s, j)
    return Shaft(x.rate_off, x.rate_off, x.rate_free, x.per_rate_off, x.per_rate_off, x.per_rate_free, 0.0,
                 x.drag_off, x.drag_off, 0.0, x.gap_off, x.gap_off, x.friction_forward, x.friction_backward,
                 x.against, x.start_off, x.start_off, x.start_off, x.lower, x.upper)


def _chip_at(s: Numbers, j: int) -> Chip:
    c = _CHIP + j
    return Chip(
        s[c], s[c + BLOCK], s[c + 2 * BLOCK], s[c + 3 * BLOCK], s[c + 4 * BLOCK], s[c + 5 * BLOCK],
        s[c + 6 * BLOCK], s[c + 7 * BLOCK], s[c + 8 * BLOCK], s[c + 9 * BLOCK], s[c + 10 * BLOCK],
        s[c + 11 * BLOCK], s[c + 12 * BLOCK], s[c + 13 * BLOCK], s[c + 14 * BLOCK], s[c + 15 * BLOCK],
        s[c + 16 * BLOCK], s[c + 17 * BLOCK], s[c + 18 * BLOCK], s[c + 19 * BLOCK])


def _plain_chip_at(s: Numbers, j: int) -> Chip:
    """Return a chip without noise, coupling and RC stretcher."""
    c = _CHIP + j
    return Chip(s[c], s[c + BLOCK], s[c + 2 * BLOCK], s[c + 3 * BLOCK], 0.0, 0.0, 0.0, s[c + 7 * BLOCK],
                s[c + 8 * BLOCK], s[c + 9 * BLOCK], 0.0, s[c + 11 * BLOCK], s[c + 12 * BLOCK], s[c + 13 * BLOCK],
                0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _edges(lanes: Lanes, k: int, size: int, own: bool, duration: float, s: Numbers, t: Numbers, n: Indices) -> int:
    """Enter frame k: set its edge, window and what remains of the run; return how many lanes go on."""
    alive = 0
    for j in range(size):
        t[_NOW + j] = k * t[_PERIOD + j]
        t[_NEXT + j] = (k + 1) * t[_PERIOD + j]
        s[_EDGE + j] = 1.0
    if own or k < 0:
        for j in range(size):
            _own_edge(lanes, k, j, s, t, n)
    for j in range(size):
        now = t[_NOW + j]
        s[_WINDOW + j] = t[_NEXT + j] - now
        s[_REMAINING + j] = max(duration - now, 0.0)
        alive += 1 if now <= duration else 0
    return alive


def _own_edge(lanes: Lanes, k: int, j: int, s: Numbers, t: Numbers, n: Indices) -> None:
    """Set the edges of a lane whose command brings its own, or of the time before frame 0."""
    count = n[_COUNT + j]
    if k < 0:
        first = lanes.edges[n[_FIRST + j]] if count > 0 else math.inf
        t[_NOW + j] = 0.0
        t[_NEXT + j] = first if count >= 0 else 0.0
        s[_EDGE + j] = 0.0
    elif count >= 0:
        t[_NOW + j] = lanes.edges[n[_FIRST + j] + k] if k < count else math.inf
        t[_NEXT + j] = lanes.edges[n[_FIRST + j] + k + 1] if k + 1 < count else math.inf


def _commands(lanes: Lanes, size: int, t: Numbers, n: Indices, s: Numbers) -> None:
    """Look up the pulse width of every lane whose piece is over or not constant."""
    due = 0
    for j in range(size):
        due += 1 if t[_NOW + j] >= t[_DUE + j] else 0
    if due == 0:
        return
    for j in range(size):
        now = t[_NOW + j]
        if now >= t[_DUE + j] and now < math.inf:
            i = n[_PIECE + j]
            while i < n[_LAST + j] and now >= lanes.pieces[i + 1, 0]:
                i += 1
            n[_PIECE + j] = i
            r = lanes.pieces
            s[_WIDTH + j] = piece_value(Piece(r[i, 0], r[i, 1], r[i, 2], r[i, 3], r[i, 4], r[i, 5], r[i, 6]), now)
            if r[i, 2] != 0.0 or r[i, 3] != 0.0:
                t[_DUE + j] = -math.inf
            else:
                t[_DUE + j] = r[i + 1, 0] if i < n[_LAST + j] else math.inf


def _measure_voltages(size: int, s: Numbers) -> None:
    """Set what the motor's voltage and the supply's sag add to the one-shot's measure."""
    for j in range(size):
        chip = _chip_at(s, j)
        drive = s[_DRIVE + j]
        off = drive == 0.0
        back_emf = s[_BACK_EMF + j] * s[_W + j]
        D = s[_D_OFF + j] if off else s[_D_DRIVE + j]
        R = s[_R_OFF + j] if off else s[_R_DRIVE + j]
        x = drive * chip.V_oc - back_emf
        i = (x - math.copysign(D, x)) / R if abs(x) > D else 0.0
        v_m, V_bus = frame.terminal_voltage(chip, drive, back_emf, i)
        s[_V_M + j] = v_m
        s[_V_BUS + j] = V_bus


def _plan(size: int, s: Numbers) -> None:
    for j in range(size):
        _plan_lane(_plain_chip_at(s, j), 0.0, 0.0, 0.0, s, j)


def _plan_all(size: int, s: Numbers) -> None:
    for j in range(size):
        _plan_lane(_chip_at(s, j), s[_V_M + j], s[_V_BUS + j], s[_DRAW + j], s, j)


def _plan_lane(chip: Chip, v_m: float, V_bus: float, draw: float, s: Numbers, j: int) -> None:
    """Measure, decide, and divide the window into its phases."""
    width, window, remaining = s[_WIDTH + j], s[_WINDOW + j], s[_REMAINING + j]
    drive = s[_DRIVE + j]
    new = frame.decide(chip, 0.0, width, s[_Q + j], v_m, V_bus, draw)
    valid = frame.accepted(chip, width) and s[_EDGE + j] != 0.0
    clock = chip.timeout if valid else s[_CLOCK + j]
    at = new.time if valid else math.inf
    old_end = min(s[_LEFT + j], clock)
    new_end = min(new.time + new.duration, clock)
    end1 = max(min(min(old_end, at), window), 0.0)
    end2 = min(at, window)
    end3 = max(min(new_end, window), end2) if valid else end2
    cut = min(window, remaining)
    s[_END1 + j] = end1
    s[_END2 + j] = end2
    s[_END3 + j] = end3
    one, two, three = min(end1, cut), min(end2, cut), min(end3, cut)
    s[_TIME1 + j] = one
    s[_TIME2 + j] = two - one
    s[_TIME3 + j] = three - two
    s[_TIME4 + j] = cut - three
    s[_DRIVE1 + j] = drive
    s[_DRIVE3 + j] = new.sign if valid else 0.0
    s[_ERROR + j] = s[_NEW_ERROR + j]
    s[_NEW_ERROR + j] = new.error if valid else s[_ERROR + j]
    left = (new_end if valid else old_end) - window
    goes_on = (new.sign if valid else drive) if left > 0.0 else 0.0
    s[_LEFT + j] = left if goes_on != 0.0 else 0.0
    s[_DRIVE + j] = goes_on
    s[_CLOCK + j] = clock - window
    s[_LOST + j] = 1.0 if valid and new.time > window and window < remaining else s[_LOST + j]


def _wanted(size: int, t: Numbers) -> int:
    """Return how many lanes have outputs in this window."""
    wanted = 0
    for j in range(size):
        wanted += 1 if t[_OUTPUT + j] < t[_NEXT + j] else 0
    return wanted


def _phases(size: int, keep: bool, s: Numbers, n: Indices) -> None:
    """Move all lanes through the four phases; keep the state at the start of each where it is wanted."""
    if keep:
        for j in range(size):
            s[_Q1 + j] = s[_Q + j]
            s[_W1 + j] = s[_W + j]
    for j in range(size):
        s[_TIME + j] = s[_TIME1 + j]
        s[_POWER + j] = s[_DRIVE1 + j]
    _drive(size, s, n)
    if keep:
        for j in range(size):
            s[_Q2 + j] = s[_Q + j]
            s[_W2 + j] = s[_W + j]
    for j in range(size):
        s[_TIME + j] = s[_TIME2 + j]
    _idle(size, s, n)
    if keep:
        for j in range(size):
            s[_Q3 + j] = s[_Q + j]
            s[_W3 + j] = s[_W + j]
    for j in range(size):
        s[_TIME + j] = s[_TIME3 + j]
        s[_POWER + j] = s[_DRIVE3 + j]
    _drive(size, s, n)
    if keep:
        for j in range(size):
            s[_Q4 + j] = s[_Q + j]
            s[_W4 + j] = s[_W + j]
    for j in range(size):
        s[_TIME + j] = s[_TIME4 + j]
    _idle(size, s, n)


def _drive(size: int, s: Numbers, n: Indices) -> None:
    """Move all lanes through a drive."""
    moving = 0
    for j in range(size):
        moving += 1 if s[_TIME + j] > 0.0 and s[_POWER + j] != 0.0 else 0
    if moving > 0 and _driven_legs(size, s) > 0:
        _later_legs(_to_edges(size, s, n), s, n)


def _driven_legs(size: int, s: Numbers) -> int:
    ending = 0
    for j in range(size):
        ending += _first_leg(_driven_shaft_at(s, j), s[_POWER + j], s, j)
    return ending


def _idle(size: int, s: Numbers, n: Indices) -> None:
    """Move all lanes through a time without drive."""
    moving = 0
    for j in range(size):
        s[_POWER + j] = 0.0
        start = s[_SHAFT + 17 * BLOCK + j]
        moving += 1 if s[_TIME + j] > 0.0 and (s[_W + j] != 0.0 or start != 0.0) else 0
    if moving > 0 and _idle_legs(size, s) > 0:
        _later_legs(_to_edges(size, s, n), s, n)


def _idle_legs(size: int, s: Numbers) -> int:
    ending = 0
    for j in range(size):
        ending += _first_leg(_idle_shaft_at(s, j), 0.0, s, j)
    return ending


def _first_leg(shaft: Shaft, drive: float, s: Numbers, j: int) -> int:
    """Move a lane to the end of its time if that lies in one leg; otherwise mark it and return 1."""
    time, q, w = s[_TIME + j], s[_Q + j], s[_W + j]
    leg = legs.leg_of(shaft, drive, w)
    once, twice = decay(leg.rate, leg.per_rate, time)
    v = fma(leg.pull, once, leg.v)
    to = fma(leg.direction, fma(leg.pull, twice, leg.v * time), q)
    active = time > 0.0 and legs.moves(shaft, drive, w)
    ends = active and legs.reaches_edge(leg, v)
    goes = active and not ends
    s[_ENDS + j] = 1.0 if ends else 0.0
    s[_EDGE_SPEED + j] = leg.direction * leg.edge
    s[_PULL_THERE + j] = leg.direction * leg.pull_there
    s[_RATE + j] = leg.rate
    s[_PER_RATE + j] = leg.per_rate
    s[_Q + j] = to if goes else q
    s[_W + j] = leg.direction * v if goes else w
    s[_LOST + j] = 1.0 if goes and not legs.within_stops(shaft, to) else s[_LOST + j]
    return 1 if ends else 0


def _to_edges(size: int, s: Numbers, n: Indices) -> int:
    """Take the marked lanes to the edge of their leg; list those that go on from there, and return how many."""
    count = 0
    for j in range(size):
        n[_WHICH + count] = j
        count += 1 if s[_ENDS + j] != 0.0 else 0
    for i in range(count):
        j = n[_WHICH + i]
        s[_A + i] = s[_W + j]
        s[_B + i] = s[_EDGE_SPEED + j]
        s[_C + i] = s[_PULL_THERE + j]
        s[_D + i] = s[_RATE + j]
        s[_E + i] = s[_PER_RATE + j]
    for i in range(count):
        t, turn = legs.way_to_edge(s[_A + i], s[_B + i], s[_C + i], s[_D + i], s[_E + i])
        s[_D + i] = t
        s[_E + i] = turn
    moving = 0
    for i in range(count):
        j = n[_WHICH + i]
        n[_WHICH + moving] = j
        q, w = s[_Q + j] + s[_E + i], s[_B + i]
        shaft = _shaft_at(s, j)
        inside = legs.within_stops(shaft, q)
        s[_Q + j] = q
        s[_W + j] = w
        s[_TIME + j] = max(s[_TIME + j] - s[_D + i], 0.0)
        s[_LOST + j] = s[_LOST + j] if inside else 1.0
        moving += 1 if inside and legs.moves(shaft, s[_POWER + j], w) else 0
    return moving


def _later_legs(count: int, s: Numbers, n: Indices) -> None:
    """Move the listed lanes to the end of their time: a few one by one, more side by side."""
    if count > _FEW:
        for i in range(count):
            _gather(n[_WHICH + i], i, s)
        moving = count
        rounds = 0
        while moving > _FEW and rounds < legs.MOST_LEGS:
            moving = _next_legs(count, s)
            rounds += 1
        for i in range(count):
            j = n[_WHICH + i]
            s[_Q + j] = s[_B + i]
            s[_W + j] = s[_A + i]
            s[_TIME + j] = s[_C + i]
            s[_LOST + j] = s[_E + i]
    for i in range(count):
        j = n[_WHICH + i]
        if s[_TIME + j] > 0.0 and s[_LOST + j] == 0.0:
            q, w, done = legs.slide(_shaft_at(s, j), s[_POWER + j], s[_Q + j], s[_W + j], s[_TIME + j])
            s[_Q + j] = q
            s[_W + j] = w
            s[_LOST + j] = s[_LOST + j] if done > 0.0 else 1.0


def _gather(j: int, i: int, s: Numbers) -> None:
    """Put what the further legs of lane j read into column i."""
    drive = s[_POWER + j]
    shaft = _shaft_at(s, j)
    off = drive == 0.0
    s[_A + i] = s[_W + j]
    s[_B + i] = s[_Q + j]
    s[_C + i] = s[_TIME + j]
    s[_D + i] = drive
    s[_E + i] = s[_LOST + j]
    s[_G + i] = shaft.rate_off if off else shaft.rate_drive
    s[_G + BLOCK + i] = shaft.rate_free
    s[_G + 2 * BLOCK + i] = shaft.per_rate_off if off else shaft.per_rate_drive
    s[_G + 3 * BLOCK + i] = shaft.per_rate_free
    s[_G + 4 * BLOCK + i] = shaft.push
    s[_G + 5 * BLOCK + i] = shaft.drag_off if off else shaft.drag_drive
    s[_G + 6 * BLOCK + i] = shaft.speed
    s[_G + 7 * BLOCK + i] = shaft.gap_off if off else shaft.gap_drive
    s[_G + 8 * BLOCK + i] = shaft.friction_forward
    s[_G + 9 * BLOCK + i] = shaft.friction_backward
    s[_G + 10 * BLOCK + i] = shaft.against
    s[_G + 11 * BLOCK + i] = legs.start_of(shaft, drive)
    s[_G + 12 * BLOCK + i] = shaft.lower
    s[_G + 13 * BLOCK + i] = shaft.upper


def _gathered_shaft_at(s: Numbers, i: int) -> Shaft:
    g = _G + i
    rate, per_rate, drag, gap, start = s[g], s[g + 2 * BLOCK], s[g + 5 * BLOCK], s[g + 7 * BLOCK], s[g + 11 * BLOCK]
    return Shaft(rate, rate, s[g + BLOCK], per_rate, per_rate, s[g + 3 * BLOCK], s[g + 4 * BLOCK], drag, drag,
                 s[g + 6 * BLOCK], gap, gap, s[g + 8 * BLOCK], s[g + 9 * BLOCK], s[g + 10 * BLOCK], start, start,
                 start, s[g + 12 * BLOCK], s[g + 13 * BLOCK])


def _next_legs(count: int, s: Numbers) -> int:
    """Move the gathered lanes through one more leg; return how many have time left."""
    moving = 0
    for i in range(count):
        shaft = _gathered_shaft_at(s, i)
        w, q, time, drive, lost = s[_A + i], s[_B + i], s[_C + i], s[_D + i], s[_E + i]
        leg = legs.leg_of(shaft, drive, w)
        once, twice = decay(leg.rate, leg.per_rate, time)
        v = fma(leg.pull, once, leg.v)
        ends = legs.reaches_edge(leg, v)
        edge = leg.direction * leg.edge
        t, turn = legs.way_to_edge(w, edge, leg.direction * leg.pull_there, leg.rate, leg.per_rate)
        there = q + turn if ends else fma(leg.direction, fma(leg.pull, twice, leg.v * time), q)
        active = time > 0.0 and legs.moves(shaft, drive, w)
        q = there if active else q
        w = (edge if ends else leg.direction * v) if active else w
        left = max(time - t, 0.0) if ends else 0.0
        lost = lost if legs.within_stops(shaft, q) else 1.0
        goes = active and left > 0.0 and lost == 0.0 and legs.moves(shaft, drive, w)
        s[_A + i] = w
        s[_B + i] = q
        s[_C + i] = left if goes else 0.0
        s[_E + i] = lost
        moving += 1 if goes else 0
    return moving


def _write(start: int, size: int, times: Numbers, outputs: Outputs, s: Numbers, t: Numbers, n: Indices) -> None:
    """Write the outputs of this window, each from the leg that holds it."""
    for j in range(size):
        while t[_OUTPUT + j] < t[_NEXT + j]:
            o = n[_INDEX + j]
            if s[_LOST + j] == 0.0:
                s[_TIME + j] = t[_OUTPUT + j] - t[_NOW + j]
                _write_one(start + j, o, j, outputs, s)
            n[_INDEX + j] = o + 1
            t[_OUTPUT + j] = times[o + 1] if o + 1 < times.size else math.inf


def _write_one(lane: int, o: int, j: int, outputs: Outputs, s: Numbers) -> None:
    x = s[_TIME + j]
    drive, error, q, w, begin = s[_DRIVE1 + j], s[_ERROR + j], s[_Q1 + j], s[_W1 + j], 0.0
    if x >= s[_END3 + j]:
        drive, error, q, w, begin = 0.0, s[_NEW_ERROR + j], s[_Q4 + j], s[_W4 + j], s[_END3 + j]
    elif x >= s[_END2 + j]:
        drive, error, q, w, begin = s[_DRIVE3 + j], s[_NEW_ERROR + j], s[_Q3 + j], s[_W3 + j], s[_END2 + j]
    elif x >= s[_END1 + j]:
        drive, q, w, begin = 0.0, s[_Q2 + j], s[_W2 + j], s[_END1 + j]
    shaft = _shaft_at(s, j)
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
