"""The program of the digital servo, tick by tick: angle, profile, errors, duty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .digital_circuit import Bridge
from .digital_command import WHOLE, Commands
from .digital_profile import Profile
from .digital_trips import Trips


class Sensed(NamedTuple):
    """What the servo sees at a tick: angle from its sensor, and what its bridge and supply just now do."""

    angle: float
    speed: float
    current: float
    bus: float
    housing: float
    resistance: float
    back_emf: float  # K_b [V s/rad]


class Tick(NamedTuple):
    """One row of what a tick decided; angles in rad."""

    time: float
    duty: float  # nan: open
    goal: float
    reference: float
    trip: int
    y: float


def cut(x: float) -> float:
    """Towards 0; nearly whole counts as whole."""
    near = round(x)
    return float(near if abs(x - near) <= WHOLE else math.trunc(x))


def clip(x: float, bound: float) -> float:
    return min(max(x, -bound), bound)


@dataclass
class _Memory:
    """All that power-up forgets."""

    number: int = 0
    goal: float | None = None  # in units, as y and r
    last: float = -math.inf  # arrival of the newest command
    lost: bool = False
    first_goal: int | None = None
    y: float = 0.0
    history: list[float] = field(default_factory=list)  # of x, from number 0 on
    angles: list[float] = field(default_factory=list)  # of y, from number 0 on
    held: float = 0.0  # D
    J: float = 0.0
    beyond: float = 0.0  # (u − w) + (J − I) of the tick before
    duty: float = 0.0


class Firmware:
    """Group `firmware` at work; a unit is a count with whole counts, else a radian."""

    def __init__(self, values: Mapping[str, Mapping[str, Any]], commands: Commands, seed: int) -> None:
        self.f = f = dict(values["firmware"])
        chip, pot = values.get("electronics", {}), values.get("potentiometer", {})
        self.T_c, self.commands = f["control_period"], commands
        self.whole, self.quantum = f.get("whole_counts") == "yes", f.get("angle_quantum")
        self.unit = float(self.quantum) if self.whole and self.quantum else 1.0
        self.tie = WHOLE if self.whole else WHOLE * (self.quantum or 1e-3)
        h = f.get("deadband_angle")
        if h is None:
            h = 0.5 * chip["deadband"] / (pot["feedback_gain"] * chip["one_shot_slope"]) if "deadband" in chip else 0.0
        self.h = self._whole(h / self.unit)
        self.m = int(f.get("derivative_ticks", 1))
        self.pot, self.noise = pot, np.random.default_rng(seed)
        self.dead_until = -math.inf
        self.least_tie = math.inf  # distance of a measured angle from a change of its count [counts]
        self._power_up()

    def _power_up(self) -> None:
        self.mem, self.trips = _Memory(), Trips(self.f, self.unit, self.tie)
        self.profile = Profile(self.f, self.unit, self.tie)

    def _whole(self, x: float) -> float:
        return cut(x) if self.whole else x

    def _step(self, duty: float) -> float:
        """A term of the duty in whole steps."""
        quantum = self.f.get("duty_quantum")
        return duty if quantum is None else quantum * cut(duty / quantum)

    # One tick ------------------------------------------------------------------------------------------------------

    def tick(self, t: float, sensed: Sensed, torque: bool) -> tuple[Tick, Bridge]:
        """Decide; `torque` off makes it limp."""
        if t < self.dead_until - self.commands.slack:
            self.commands.until(t)
            return self._dead(t)
        M, f, U = self.mem, self.f, self.unit
        if M.number == 0:
            self._forget_commands(t)
        M.number += 1
        new = self._commands(t)
        if M.goal is not None and M.first_goal is None:
            M.first_goal = M.number
        travel = self._measure(sensed.angle)
        if self.trips.stopped:
            M.goal = M.y
            self.profile.rest(M.y)
        limp = self._silent(t, new) or M.goal is None or not torque or self.trips.limp
        w = 0.0 if limp else self._loop(travel, new)
        self.trips.judge(M.number, w, M.y, sensed, torque, limp, self.T_c)
        if self.trips.reset:
            self.dead_until = t + f.get("restart_time", 0.0)
            self._power_up()
            return self._dead(t)
        if self.trips.stopped:
            M.goal = M.y
            self.profile.rest(M.y)
        limp = limp or self.trips.limp
        if limp:
            self._go_limp()
        bridge = self._off(torque) if limp else Bridge(f.get("off_state", "brake"), self._duty(w, sensed))
        M.duty = 0.0 if limp else bridge.duty
        goal = math.nan if M.goal is None else M.goal * U
        duty = math.nan if limp else bridge.duty
        return Tick(t, duty, goal, self.profile.r * U, self.trips.code, M.y * U), bridge

    def _dead(self, t: float) -> tuple[Tick, Bridge]:
        return Tick(t, math.nan, math.nan, math.nan, 4, math.nan), Bridge("open")

    def _off(self, torque: bool) -> Bridge:
        brakes = not torque and self.f.get("torque_off_state") == "brake"
        return Bridge("brake", 0.0) if brakes else Bridge("open")

    def _forget_commands(self, t: float) -> None:
        """What came while it was dead is lost."""
        if self.dead_until > -math.inf:
            self.commands.until(min(t, self.dead_until - 2.0 * self.commands.slack))

    def _commands(self, t: float) -> bool:
        """Take what has arrived."""
        M, arrived = self.mem, self.commands.until(t)
        if arrived:
            before = M.goal
            M.last, M.goal, M.lost = arrived[-1].time, arrived[-1].goal / self.unit, False
            self.trips.command()
            return M.goal != before
        return False

    def _silent(self, t: float, new: bool) -> bool:
        """Whether it is limp for want of a command; failsafe sets its goal."""
        M, f = self.mem, self.f
        timeout = f.get("signal_timeout")
        if timeout is None or M.goal is None or t - M.last < timeout - self.commands.slack:
            return False
        if f.get("signal_loss") == "failsafe" and not M.lost:
            M.goal = self.commands.clipped(f["failsafe_angle"]) / self.unit
            self.profile.leave()
        M.lost = True
        return bool(f.get("signal_loss") == "limp")

    def _measure(self, angle: float) -> float:
        """Step 1; the travel in the last whole block of m ticks, inf before there is one."""
        M, pot = self.mem, self.pot
        if pot.get("noise"):
            angle += self.noise.normal(0.0, pot["noise"]) / pot["feedback_gain"]
        a = self.f.get("filter_weight", 1.0)
        if self.quantum is not None:
            x = angle / self.quantum + 0.5
            self.least_tie = min(self.least_tie, abs(x - round(x)))
            angle = math.floor(x) * (1.0 if self.whole else self.quantum)
        M.y = angle if M.number == 1 else self._whole((1.0 - a) * M.y + a * angle)
        if M.number == 1:
            M.angles.append(M.y)
            M.history.append(-M.y if self.f.get("derivative_of") == "measurement" else 0.0)
            self.profile.rest(M.y)
        M.angles.append(M.y)
        last = M.number // self.m * self.m
        return abs(M.angles[last] - M.angles[last - self.m]) if last else math.inf

    def _go_limp(self) -> None:
        M = self.mem
        M.J = M.held = M.beyond = 0.0
        M.history = [-M.y if self.f.get("derivative_of") == "measurement" else 0.0] * (M.number + 1)
        self.profile.rest(M.y)

    # Steps 2 to 5 --------------------------------------------------------------------------------------------------

    def _loop(self, travel: float, new: bool) -> float:
        """The duty w that the loop asks for."""
        M, f = self.mem, self.f
        before = self.profile.speed
        if not self.trips.stopped:
            self.profile.step(M.goal or 0.0, new)
        rate = self.profile.speed * self.unit
        bend = (rate - before * self.unit) / self.T_c
        e = self._whole(self.profile.r) - M.y
        inside = abs(e) <= self.h + self.tie * (self.h > 0.0)
        taken = 0.0 if f.get("deadband_law") == "gate" else self.h
        z = 0.0 if inside else math.copysign(abs(e) - taken, e)
        u = (self._step(f["proportional_gain"] * z * self.unit) + self._integral(z, travel) + self._derivative(z)
             + self._step(f.get("velocity_feedforward", 0.0) * rate)
             + self._step(f.get("acceleration_feedforward", 0.0) * bend))
        u = self._step(u)  # a sum of whole steps is one, but for rounding
        if abs(u) > WHOLE * (f.get("duty_quantum") or 0.0):
            u += math.copysign(f.get("minimum_duty", 0.0), u)
        w = clip(u, f.get("torque_limit", 1.0))
        M.beyond += u - w
        return w

    def _integral(self, z: float, travel: float) -> float:
        M, f = self.mem, self.f
        rests = travel < f.get("rest_travel", 0.0) / self.unit - self.tie and not self.trips.code
        if f.get("integral_at_rest") != "yes" or rests:
            error = z * self.unit - f.get("anti_windup", 0.0) * M.beyond
            M.J += f.get("integral_gain", 0.0) * self.T_c * error
        J, limit = self._step(M.J), f.get("integral_limit") or math.inf
        M.beyond = J - clip(J, limit)
        return clip(J, limit)

    def _derivative(self, z: float) -> float:
        M, f, m = self.mem, self.f, self.m
        M.history.append(-M.y if f.get("derivative_of") == "measurement" else z)
        if M.number % m == 0:
            change = M.history[M.number] - M.history[M.number - m]
            small = abs(change) < f.get("derivative_threshold", 0.0) / self.unit - self.tie
            rate = change * self.unit / (m * self.T_c)
            M.held = 0.0 if small else self._step(f.get("derivative_gain", 0.0) * rate)
        return M.held

    # Steps 5 and 6 -------------------------------------------------------------------------------------------------

    def _duty(self, w: float, sensed: Sensed) -> float:
        M, f = self.mem, self.f
        limit = f.get("duty_limit", 1.0)
        most = min(limit, self.trips.allowed)
        since = (M.number - (M.first_goal or 0)) * self.T_c
        if "soft_start_time" in f and since < f["soft_start_time"] - self.commands.slack:
            most = min(most, f.get("soft_start_duty", 1.0))
        d = clip(w, most)
        if "duty_slew" in f:
            step = f["duty_slew"] * self.T_c
            d = min(max(d, M.duty - step), M.duty + step)
        if "current_limit" in f and sensed.bus > 0.0:
            d = self._within(d, sensed)
        return clip(d, limit)

    def _within(self, d: float, sensed: Sensed) -> float:
        """The duty whose current is within the limit at this very instant."""
        E, V, R, I_m = sensed.back_emf * sensed.speed, sensed.bus, sensed.resistance, float(self.f["current_limit"])
        if self.f.get("current_sense") == "bus":
            root = math.sqrt(E * E + 4.0 * V * R * I_m)
            return min(max(d, 0.5 * (E - root) / V), 0.5 * (E + root) / V)
        return min(max(d, (E - R * I_m) / V), (E + R * I_m) / V)
