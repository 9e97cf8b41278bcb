"""What the pulse-level reference solves for: shaft with its bridge, and chip, in SI at the output shaft."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Shaft:
    """Motor, gear, supply and load, everything at the output shaft."""

    J: float
    B: float
    K: float  # torque per current, N k_a
    K_b: float  # back-EMF per speed, N k_b
    forward: float  # N F_ec1, resists w > 0
    backward: float  # N F_ec2
    breakaway: float = 1.0
    coulomb: float = 0.0  # of the load
    R_a: float
    R_b: float = 0.0
    r_c: float = 0.0
    V_oc: float
    V_ce0: float = 0.0
    V_br: float = 0.0
    coasts: bool = False
    stiffness: float = 0.0
    rest: float = 0.0
    gravity: float = 0.0
    hanging: float = 0.0
    knots: tuple[float, ...] = (0.0,)  # external torque over time: linear between the knots
    torques: tuple[float, ...] = (0.0,)
    lower: float = -math.inf
    upper: float = math.inf
    restitution: float = 0.0

    def torque(self, t: float) -> float:
        """External torque that depends on time alone."""
        n = bisect.bisect_right(self.knots, t) - 1
        if n < 0 or n == len(self.knots) - 1:
            return self.torques[max(n, 0)]
        return self.torques[n] + self.torque_slope(t) * (t - self.knots[n])

    def torque_slope(self, t: float) -> float:
        n = bisect.bisect_right(self.knots, t) - 1
        if n < 0 or n == len(self.knots) - 1:
            return 0.0
        return (self.torques[n + 1] - self.torques[n]) / (self.knots[n + 1] - self.knots[n])

    def external(self, t: float, q: float) -> float:
        return self.torque(t) + self.stiffness * (q - self.rest) + self.gravity * math.sin(q - self.hanging)

    def bridge(self, drive: int) -> tuple[float, float, float]:
        """Loop that the bridge closes: (source, voltage lost whatever the current, resistance)."""
        if drive:
            return drive * self.V_oc, self.V_ce0 + self.V_br, self.R_a + self.r_c + self.R_b
        if self.coasts:  # va = −sgn(i) (V_bus + V_ce0), V_bus = V_oc + R_b |i|
            return 0.0, self.V_oc + self.V_ce0 + self.V_br, self.R_a + self.R_b
        return 0.0, self.V_br, self.R_a

    def current(self, drive: int, w: float) -> float:
        """Armature current; none where the loop's voltage does not exceed what it loses."""
        source, lost, R = self.bridge(drive)
        x = source - self.K_b * w
        return 0.0 if abs(x) <= lost else (x - math.copysign(lost, x)) / R

    def terminal(self, drive: int, w: float) -> float:
        """Motor terminal voltage v_m."""
        i = self.current(drive, w)
        if not drive and not self.coasts:
            return 0.0
        if i == 0.0:
            return self.K_b * w
        return self.K_b * w + self.R_a * i + math.copysign(self.V_br, i)

    def bus(self, drive: int, w: float) -> float:
        """V_bus: the current returns to the source while coasting, stays in the winding while braking."""
        i = self.current(drive, w)
        if drive:
            return self.V_oc - self.R_b * drive * i
        return self.V_oc + self.R_b * abs(i) if self.coasts else self.V_oc


@dataclass(frozen=True, kw_only=True)
class Chip:
    """One-shot, deadband, stretcher and frame."""

    T_0: float = 0.0
    slope: float  # 1/s_r
    p: float
    b_o: float = 0.0
    beta: float = 0.0
    c_s: float = 0.0
    deadband: float = 0.0  # full width
    gain: float
    t_min: float = 0.0
    tau_s: float | None = None
    timeout: float = math.inf
    shortest: float = 0.0
    longest: float = math.inf
    period: float = 0.02

    def drive_time(self, u: float) -> float:
        if u <= 0.0:
            return 0.0
        if self.tau_s is None:
            return self.t_min + self.gain * u
        return self.t_min + self.tau_s * math.log1p(self.gain * u / self.tau_s)

    def zero_error_angle(self, width: float) -> float:
        return ((width - self.T_0) / self.slope - self.b_o) / self.p
