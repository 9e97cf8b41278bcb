"""The chip of one servo: what a frame measures, decides and drives; the potentiometer with table, play and steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from .pulse_servo import Chip


@dataclass(frozen=True)
class Potentiometer:
    """v_o = Quant(p q_w + b_o + ε(q_w)); q_w follows q through the play."""

    p: float
    b_o: float = 0.0
    angles: tuple[float, ...] = ()
    errors: tuple[float, ...] = ()
    step: float = 0.0  # voltage per count, 0: none
    play: float = 0.0

    def error(self, q: float) -> float:
        """ε: linear between the table's points, held at its ends."""
        if not self.angles:
            return 0.0
        if q <= self.angles[0]:
            return self.errors[0]
        for (a, b), (x, y) in zip(pairwise(self.angles), pairwise(self.errors), strict=True):
            if q <= b:
                return x + (y - x) * (q - a) / (b - a)
        return self.errors[-1]

    def smooth(self, q: float) -> float:
        return self.p * q + self.b_o + self.error(q)

    def voltage(self, q: float) -> float:
        v = self.smooth(q)
        return self.step * math.floor(v / self.step + 0.5) if self.step else v

    def tie(self, q: float) -> float:
        """How far v is from the voltage at which the count changes [V]."""
        if not self.step:
            return math.inf
        x = self.smooth(q) / self.step + 0.5
        return self.step * abs(x - round(x))

    def wiper(self, before: float, q: float) -> float:
        """Wiper angle after a motion in one direction to q."""
        return min(max(before, q - 0.5 * self.play), q + 0.5 * self.play)

    def angle(self, v: float) -> float:
        """Angle whose voltage, without steps, is v; found by halving, for the table may bend anywhere."""
        reach = max((abs(e) for e in self.errors), default=0.0) / self.p + 1e-9
        low, high = (v - self.b_o) / self.p - reach, (v - self.b_o) / self.p + reach
        if not self.errors:
            return (v - self.b_o) / self.p
        while low < (middle := 0.5 * (low + high)) < high:
            low, high = (middle, high) if self.smooth(middle) < v else (low, middle)
        return low


@dataclass
class Frames:
    """The frame logic of one servo as time goes by."""

    chip: Chip
    pot: Potentiometer
    width: Callable[[float], float]
    edges: tuple[float, ...] | None
    shifts: Callable[[int], float]
    drive: int = 0
    drive_end: float = math.inf
    clock: float = -math.inf
    frame: int = 0
    error: float = 0.0
    margin: float = math.inf  # smallest ||e| − w/2| [s]
    tie: float = math.inf  # smallest distance from a change of the count [V]
    pending: list[tuple[float, int, float, float]] = field(default_factory=list)  # at, sign, length, error

    def next_edge(self) -> float:
        if self.edges is None:
            return self.frame * self.chip.period
        return self.edges[self.frame] if self.frame < len(self.edges) else math.inf

    def horizon(self) -> float:
        """The next instant at which something is due."""
        decision = self.pending[0][0] if self.pending else math.inf
        off = min(self.drive_end, self.clock) if self.drive else math.inf
        return min(decision, off, self.next_edge())

    def switch(self, t: float) -> list[str]:
        """The end of the drive, then the decisions that are due; what happened."""
        done = []
        if self.drive and t >= min(self.drive_end, self.clock):
            self.drive = 0
            done.append("drive_end")
        while self.pending and self.pending[0][0] <= t:
            at, sign, length, self.error = self.pending.pop(0)
            self.drive_end = at + length
            self.drive = sign if length > 0.0 and at < self.clock else 0
            done.append("decision")
        return done

    def measure(self, wiper: float, terminal: float, sag: float) -> None:
        """One-shot against command; a pulse outside the accepted widths decides nothing and restarts no clock."""
        chip, edge = self.chip, self.next_edge()
        self.frame += 1
        t_in = self.width(edge)
        if not chip.shortest <= t_in <= chip.longest:
            return
        self.clock = edge + chip.timeout
        v = self.pot.voltage(wiper) + chip.beta * terminal + chip.c_s * sag
        T_os = max(0.0, chip.T_0 + chip.slope * v) + self.shifts(self.frame - 1)
        e = t_in - T_os
        u = abs(e) - 0.5 * chip.deadband
        self.margin, self.tie = min(self.margin, abs(u)), min(self.tie, self.pot.tie(wiper))
        new = (edge + max(t_in, T_os), (e > 0) - (e < 0), chip.drive_time(u), e)
        # Each drive ends at the next frame's decision: one that would come after it never drives.
        self.pending = [old for old in self.pending if old[0] < new[0]] + [new]


def make_chip(v: Mapping[str, Any]) -> Chip:
    def of(name: str, default: Any) -> Any:
        return v.get(f"electronics.{name}", default)

    return Chip(
        T_0=of("one_shot_offset", 0.0), slope=v["electronics.one_shot_slope"], p=v["potentiometer.feedback_gain"],
        b_o=v.get("potentiometer.feedback_offset", 0.0), beta=of("back_emf_injection", 0.0),
        c_s=of("supply_coupling", 0.0), deadband=of("deadband", 0.0), gain=v["electronics.stretcher_gain"],
        t_min=of("minimum_drive_time", 0.0), tau_s=of("stretcher_time_constant", None),
        timeout=of("pulse_timeout", math.inf), shortest=of("pulse_width_min", 0.0),
        longest=of("pulse_width_max", math.inf), period=of("frame_period", 0.02),
    )


def make_potentiometer(v: Mapping[str, Any]) -> Potentiometer:
    def of(name: str, default: Any) -> Any:
        return v.get(f"potentiometer.{name}", default)

    return Potentiometer(
        p=of("feedback_gain", None), b_o=of("feedback_offset", 0.0), angles=tuple(of("linearity_angle", ())),
        errors=tuple(of("linearity_error", ())), step=of("quantisation", 0.0), play=of("backlash", 0.0))
