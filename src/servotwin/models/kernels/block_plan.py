"""What a block of lanes does at the edge of a frame: look up the pulse, measure, decide, divide the window."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin.models.kernels import block_rows as at
from servotwin.models.kernels import frame
from servotwin.models.kernels.frame import Chip
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    from servotwin.models.kernels.block_rows import Indices, Numbers


def edges(listed: Numbers, k: int, size: int, own: bool, duration: float, s: Numbers, t: Numbers, n: Indices) -> int:
    """Enter frame k: set its edge, window and what remains of the run; return how many lanes go on.

    `listed` are the edges of commands that bring their own.
    """
    alive = 0
    for j in range(size):
        t[at.NOW + j] = k * t[at.PERIOD + j]
        t[at.NEXT + j] = (k + 1) * t[at.PERIOD + j]
        s[at.EDGE + j] = 1.0
    if own or k < 0:
        for j in range(size):
            _own_edge(listed, k, j, s, t, n)
    for j in range(size):
        now = t[at.NOW + j]
        s[at.WINDOW + j] = t[at.NEXT + j] - now
        s[at.REMAINING + j] = max(duration - now, 0.0)
        alive += 1 if now <= duration else 0
    return alive


def _own_edge(listed: Numbers, k: int, j: int, s: Numbers, t: Numbers, n: Indices) -> None:
    """Set the edges of a lane whose command brings its own, or of the time before frame 0."""
    count = n[at.COUNT + j]
    if k < 0:
        first = listed[n[at.FIRST + j]] if count > 0 else math.inf
        t[at.NOW + j] = 0.0
        t[at.NEXT + j] = first if count >= 0 else 0.0
        s[at.EDGE + j] = 0.0
    elif count >= 0:
        t[at.NOW + j] = listed[n[at.FIRST + j] + k] if k < count else math.inf
        t[at.NEXT + j] = listed[n[at.FIRST + j] + k + 1] if k + 1 < count else math.inf


def commands(r: Numbers, size: int, t: Numbers, n: Indices, s: Numbers) -> None:
    """Look up the pulse width of every lane whose piece is over or not constant, in the rows `r`."""
    due = 0
    for j in range(size):
        now, then = t[at.NOW + j], t[at.DUE + j]
        due += 1 if then <= now < math.inf else 0
    if due == 0:
        return
    due = 0
    for j in range(size):
        now, then = t[at.NOW + j], t[at.DUE + j]
        n[at.WHICH + due] = j
        due += 1 if then <= now < math.inf else 0
    for k in range(due):
        j = n[at.WHICH + k]
        now = t[at.NOW + j]
        i, last = n[at.PIECE + j], n[at.LAST + j]
        while i < last and now >= r[i + 1, 0]:
            i += 1
        n[at.PIECE + j] = i
        if r[i, 2] != 0.0 or r[i, 3] != 0.0:
            s[at.WIDTH + j] = piece_value(Piece(r[i, 0], r[i, 1], r[i, 2], r[i, 3], r[i, 4], r[i, 5], r[i, 6]), now)
        else:
            s[at.WIDTH + j] = r[i, 1]
            t[at.DUE + j] = r[i + 1, 0] if i < last else math.inf


def measure_voltages(size: int, s: Numbers) -> None:
    """Set what the motor's voltage and the supply's sag add to the one-shot's measure."""
    for j in range(size):
        chip = at.chip_at(s, j)
        drive = s[at.DRIVE + j]
        off = drive == 0.0
        back_emf = s[at.BACK_EMF + j] * s[at.W + j]
        D = s[at.D_OFF + j] if off else s[at.D_DRIVE + j]
        R = s[at.R_OFF + j] if off else s[at.R_DRIVE + j]
        x = drive * chip.V_oc - back_emf
        i = (x - math.copysign(D, x)) / R if abs(x) > D else 0.0
        v_m, V_bus = _terminal_voltage(chip, drive, back_emf, i)
        s[at.V_M + j] = v_m
        s[at.V_BUS + j] = V_bus


def plan(size: int, s: Numbers) -> None:
    """Plan the window of all lanes, where no chip has noise, a coupling or an RC stretcher."""
    for j in range(size):
        _plan_lane(at.plain_chip_at(s, j), 0.0, 0.0, 0.0, s, j)


def plan_all(size: int, s: Numbers) -> None:
    """Plan the window of all lanes."""
    for j in range(size):
        _plan_lane(at.chip_at(s, j), s[at.V_M + j], s[at.V_BUS + j], s[at.DRAW + j], s, j)


def _plan_lane(chip: Chip, v_m: float, V_bus: float, draw: float, s: Numbers, j: int) -> None:
    """Measure, decide, and divide the window into its phases."""
    width, window, remaining = s[at.WIDTH + j], s[at.WINDOW + j], s[at.REMAINING + j]
    drive = s[at.DRIVE + j]
    new = frame.decide(chip, 0.0, width, chip.p * s[at.Q + j] + chip.b_o, v_m, V_bus, draw)
    valid = frame.accepted(chip, width) and s[at.EDGE + j] != 0.0
    clock = chip.timeout if valid else s[at.CLOCK + j]
    decision = new.time if valid else math.inf
    old_end = min(s[at.LEFT + j], clock)
    new_end = min(new.time + new.duration, clock)
    end1 = max(min(min(old_end, decision), window), 0.0)
    end2 = min(decision, window)
    end3 = max(min(new_end, window), end2) if valid else end2
    cut = min(window, remaining)
    s[at.END1 + j] = end1
    s[at.END2 + j] = end2
    s[at.END3 + j] = end3
    one, two, three = min(end1, cut), min(end2, cut), min(end3, cut)
    s[at.TIME1 + j] = one
    s[at.TIME2 + j] = two - one
    s[at.TIME3 + j] = three - two
    s[at.TIME4 + j] = cut - three
    s[at.DRIVE1 + j] = drive
    s[at.DRIVE3 + j] = new.sign if valid else 0.0
    s[at.ERROR + j] = s[at.NEW_ERROR + j]
    s[at.NEW_ERROR + j] = new.error if valid else s[at.ERROR + j]
    left = (new.time + new.duration if valid else s[at.LEFT + j]) - window
    goes_on = (new.sign if valid else drive) if left > 0.0 and clock >= window else 0.0
    s[at.LEFT + j] = left if goes_on != 0.0 else 0.0
    s[at.DRIVE + j] = goes_on
    s[at.CLOCK + j] = clock - window
    s[at.LOST + j] = 1.0 if valid and new.time > window and window < remaining else s[at.LOST + j]


def wanted(size: int, t: Numbers) -> int:
    """Return how many lanes have outputs in this window."""
    wanted = 0
    for j in range(size):
        wanted += 1 if t[at.OUTPUT + j] < t[at.NEXT + j] else 0
    return wanted


def _terminal_voltage(chip: Chip, drive: float, back_emf: float, i: float) -> tuple[float, float]:
    """Return v_m at the motor's terminals and V_bus of the supply, for the current i."""
    if i != 0.0:
        v_m = back_emf + chip.R_a * i + math.copysign(chip.V_br, i)
        if drive != 0.0:
            return v_m, chip.V_oc - chip.R_b * drive * i
        return v_m, chip.V_oc + (chip.R_b * abs(i) if chip.coast > 0.0 else 0.0)
    return (back_emf if drive != 0.0 or chip.coast > 0.0 else 0.0), chip.V_oc
