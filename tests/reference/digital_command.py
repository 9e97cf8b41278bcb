"""What reaches the firmware of the digital servo: pulses by their falling edges, or goals that are written to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .digital_plant import Piece

WHOLE = 1e-9  # so near to a whole number a value is that number


class Arrival(NamedTuple):
    """A goal angle [rad] that counts from the first tick at or after a time."""

    time: float
    goal: float


def floor(x: float) -> int:
    """Floor, where nearly whole counts as whole."""
    return math.floor(x + WHOLE)


class Commands:
    """All goals that a run brings, asked for tick by tick."""

    def __init__(self, values: Mapping[str, Mapping[str, Any]], command: Mapping[str, Any], slack: float) -> None:
        firmware = values["firmware"]
        self.low, self.high = float(firmware.get("lower_goal", -math.inf)), float(firmware.get("upper_goal", math.inf))
        self.quantum, self.slack = firmware.get("angle_quantum"), slack
        self.latency = firmware.get("bus_latency", 0.0)
        self.waiting: list[Arrival] = []
        self.pieces: tuple[Piece, ...] = ()
        self.written: float | None = None
        if command["kind"] == "pulse":
            self.waiting = _pulses(values, command["edges"], command["widths"])
        else:
            self.pieces = tuple(Piece(*piece) for piece in command["pieces"])

    def clipped(self, goal: float) -> float:
        return min(max(goal, self.low), self.high)

    def until(self, t: float) -> list[Arrival]:
        """What arrived since the last tick, up to now."""
        if self.pieces:
            new = self._read(t)
            return [] if new is None else [new]
        count = sum(arrival.time <= t + self.slack for arrival in self.waiting)
        found, self.waiting = self.waiting[:count], self.waiting[count:]
        return [Arrival(arrival.time, self.clipped(arrival.goal)) for arrival in found]

    def _rounded(self, goal: float) -> float:
        return goal if self.quantum is None else self.quantum * math.floor(goal / self.quantum + 0.5)

    def _read(self, t: float) -> Arrival | None:
        """The goal as it was written a latency ago, if it is another than before."""
        at = t - self.latency
        begun = [k for k, piece in enumerate(self.pieces) if piece.start <= at + self.slack]
        if not begun:
            return None
        goal = self._rounded(self.pieces[begun[-1]].at(at))
        if goal == self.written:
            return None
        self.written = goal
        return Arrival(self._since(begun[-1], at) + self.latency, self.clipped(goal))

    def _since(self, k: int, at: float) -> float:
        """When the goal took the rounded value that it has at a time."""
        piece = self.pieces[k]
        if piece.slope == 0.0:
            return piece.start
        if self.quantum is None:
            return at
        edge = self._rounded(piece.at(at)) - math.copysign(0.5 * self.quantum, piece.slope)
        return max(piece.start, piece.start + (edge - piece.value) / piece.slope)


def _pulses(values: Mapping[str, Mapping[str, Any]], edges: Sequence[float], widths: Sequence[float]) -> list[Arrival]:
    """Accepted pulses as the angles whose pulse they are, in order."""
    chip, pot = values["electronics"], values["potentiometer"]
    step = values["firmware"].get("pulse_resolution")
    least, most = chip.get("pulse_width_min", 0.3e-3), chip.get("pulse_width_max", 2.7e-3)
    found = []
    for edge, width in zip(edges, widths, strict=True):
        t = width if step is None else step * floor(width / step)
        if least <= t <= most:
            v_o = (t - chip["one_shot_offset"]) / chip["one_shot_slope"]
            found.append(Arrival(edge + width, (v_o - pot.get("feedback_offset", 0.0)) / pot["feedback_gain"]))
    return found
