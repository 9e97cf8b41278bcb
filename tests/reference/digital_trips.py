"""What stops the digital servo by itself: overload, current, heat and a bus that falls too low."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

OVERLOAD, CURRENT, HEAT, UNDERVOLTAGE = 1, 2, 3, 4
COOLER = 5.0  # K below the temperature that trips
EVEN = 1e-12  # duties closer than this are equal: sums of steps are not exact


class Seen(Protocol):
    """What trips look at."""

    @property
    def current(self) -> float: ...
    @property
    def bus(self) -> float: ...
    @property
    def housing(self) -> float: ...


class Clock(NamedTuple):
    """A running overload clock."""

    start: int
    y: float
    side: int


class Trips:
    """State of all four; `unit` is that of y."""

    def __init__(self, f: Mapping[str, Any], unit: float, tie: float) -> None:
        self.f, self.tie = f, tie
        self.travel = f.get("stall_travel", math.inf) / unit
        self.output = f.get("overload_output", 0.0)
        self.clock: Clock | None = None
        self.flowing: int | None = None  # tick since which too much current flows
        self.side = 0
        self.overload = self.current = self.heat = self.low = self.reset = False

    @property
    def code(self) -> int:
        """The highest that acts; 0: none."""
        acting = ((OVERLOAD, self.overload), (CURRENT, self.current), (HEAT, self.heat), (UNDERVOLTAGE, self.low))
        return max((code for code, acts in acting if acts), default=0)

    @property
    def limp(self) -> bool:
        return self.current or (self.overload and self.output == 0.0)

    @property
    def stopped(self) -> bool:
        """Duty 0, goal and reference at the angle."""
        return self.heat or self.low

    @property
    def allowed(self) -> float:
        return 0.0 if self.stopped else self.output if self.overload else math.inf

    def command(self) -> None:
        """A new goal ends a current trip."""
        if self.current:
            self.current, self.flowing = False, None

    def judge(self, n: int, w: float, y: float, seen: Seen, torque: bool, limp: bool, T_c: float) -> None:
        """Look at all four at tick number n, after w."""
        if "overload_time" in self.f and "overload_duty" in self.f:
            self._overload(n, w, y, torque, limp, T_c)
        self._current(n, abs(seen.current), T_c)
        hottest = self.f.get("trip_temperature")
        if hottest is not None:
            self.heat = seen.housing > (hottest - COOLER if self.heat else hottest)
        least = self.f.get("undervoltage")
        if least is not None:
            below = seen.bus < least
            self.reset = below and self.f.get("undervoltage_action") == "reset"
            self.low = below and not self.reset

    def _overload(self, n: int, w: float, y: float, torque: bool, limp: bool, T_c: float) -> None:
        if self.overload:
            eased = w * self.side < self.output - EVEN or not torque
            if not eased or self.f.get("overload_latches") == "yes":
                return
            self.overload, self.clock = False, None
        if self.clock is not None and (limp or w * self.clock.side < self.output - EVEN):
            self.clock = None
        moved = self.clock is not None and abs(y - self.clock.y) > self.travel + self.tie
        if moved or (self.clock is None and abs(w) > self.f["overload_duty"] + EVEN):
            self.clock = Clock(n, y, 1 if w > 0.0 else -1)
        if self.clock is not None and (n - self.clock.start) * T_c >= self.f["overload_time"] - 1e-9 * T_c:
            self.overload, self.side, self.clock = True, self.clock.side, None

    def _current(self, n: int, current: float, T_c: float) -> None:
        most = self.f.get("trip_current")
        if most is None or self.current:
            return
        if current < most:
            self.flowing = None
            return
        self.flowing = n if self.flowing is None else self.flowing
        self.current = (n - self.flowing) * T_c >= self.f.get("trip_time", 0.0) - 1e-9 * T_c
