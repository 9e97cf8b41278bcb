"""The reference angle's way to the goal: speed, acceleration and least speed of the firmware's profile."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


class Profile:
    """r and its speed, in units of angle and units per second."""

    def __init__(self, f: Mapping[str, Any], unit: float, tie: float) -> None:
        self.T_c, self.tie = float(f["control_period"]), tie
        self.v = float(f.get("speed_limit", math.inf)) / unit
        self.a = float(f.get("acceleration_limit", math.inf)) / unit
        self.v_0 = float(f.get("minimum_speed", 0.0)) / unit
        self.present = math.isfinite(self.v) or math.isfinite(self.a)
        self.r = self.speed = 0.0
        self.on_course = True

    def rest(self, angle: float) -> None:
        """Stand at an angle."""
        self.r, self.speed = angle, 0.0

    def leave(self) -> None:
        """A goal that was not there before."""
        self.on_course = False

    def _braking(self) -> float:
        """Way on which the speed falls to 0, tick by tick."""
        step = self.a * self.T_c
        if math.isinf(step):
            return 0.0
        k = math.floor(abs(self.speed) / step)
        return 0.5 * k * (2.0 * abs(self.speed) - (k + 1) * step) * self.T_c

    def step(self, goal: float, new: bool) -> None:
        """One tick towards the goal."""
        if not self.present:
            self.r = goal
            return
        if new:
            self.leave()
        D, S, step = goal - self.r, self._braking(), self.a * self.T_c
        s = (D > 0.0) - (D < 0.0)
        if not self.on_course and s * self.speed >= 0.0 and abs(D) + self.tie >= S:
            self.on_course = True
        speed = abs(self.speed)
        if not self.on_course:
            left = speed - step
            self.speed = 0.0 if left <= self.v_0 + self.tie else math.copysign(left, self.speed)
            self.r += self.speed * self.T_c
            return
        speed = speed - step if abs(D) - self.tie <= S and speed > 0.0 else min(speed + step, self.v)
        speed = max(speed, self.v_0)
        if speed * self.T_c >= abs(D) - self.tie:
            self.r, self.speed = goal, 0.0
            return
        self.speed = s * speed
        self.r += self.speed * self.T_c
