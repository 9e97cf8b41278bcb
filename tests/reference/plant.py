"""What the reference solutions share: plant, load, result, start, and the cutting of time at the inputs' breaks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Signal = Callable[[float], float]


def no_torque(t: float) -> float:
    """Constant and recorded torque of a free shaft."""
    return 0.0


@dataclass(frozen=True, kw_only=True)
class Load:
    """What hangs on the output shaft; positive torque pushes it towards −q."""

    J_L: float = 0.0  # inertia, that of a pendulum included
    B_L: float = 0.0
    tau: Signal = no_torque  # constant + recorded
    tau_breaks: tuple[float, ...] = ()  # times at which tau has a jump or a kink
    pendulum: float = 0.0  # m g l
    hanging: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    coulomb: float = 0.0  # magnitude, output shaft

    def external(self, t: float, q: float) -> float:
        """τ_ext without viscous and Coulomb friction."""
        return self.tau(t) + self.pendulum * math.sin(q - self.hanging) + self.stiffness * (q - self.rest)


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Everything that a run needs; what a model does not use may keep its default."""

    R: float
    L: float = 0.0
    k_a: float
    k_b: float
    J_m: float
    B_m: float = 0.0
    N: float = 1.0
    F1: float = 0.0
    F2: float = 0.0
    k: float = 0.0
    r: float = 1.0
    A_ks: float = 0.0
    p: float = 0.0
    b_o: float = 0.0
    w_v: float = 0.0
    V_max: float = math.inf
    lower: float = -math.inf
    upper: float = math.inf
    restitution: float = 0.0
    load: Load = field(default_factory=Load)

    @property
    def J(self) -> float:
        """Inertia at the output shaft, rotor and load."""
        return self.N**2 * self.J_m + self.load.J_L

    @property
    def B(self) -> float:
        """Viscous friction at the output shaft, motor and load."""
        return self.N**2 * self.B_m + self.load.B_L


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Arrays at the asked times; `i` only where the current is a state, `events` only of the bounded model."""

    q: Array
    w: Array
    i: Array | None = None
    events: tuple[tuple[float, str], ...] = ()


def zero_error_angle(plant: Plant, v_c: Signal) -> float:
    """Start angle: v_c just before t = 0 equals p q + b_o."""
    return (v_c(math.nextafter(0.0, -1.0)) - plant.b_o) / plant.p


def segments(t_end: float, breaks: Sequence[float]) -> list[tuple[float, float]]:
    """The intervals between 0, the breaks inside (0, t_end), and t_end."""
    cuts = [0.0, *sorted({float(b) for b in breaks if 0.0 < b < t_end}), t_end]
    return list(pairwise(cuts))
