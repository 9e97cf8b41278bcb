"""The sum of all that hangs on the shaft, in one normal form, and what every part of it is."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from servotwin import physics
from servotwin.errors import LoadError
from servotwin.physics.pieces import Piece, Pieces, constant_pieces
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from servotwin.loads.parts import Flexible, Pendulum, Recorded, Spring


class Part(ABC):
    """One thing that hangs on the shaft; parts and loads add up to a load."""

    @abstractmethod
    def as_load(self) -> Load:
        """Return this part alone, in normal form."""

    def __add__(self, other: Part | Load) -> Load:
        return self.as_load() + other


@dataclass(frozen=True, kw_only=True)
class Load:
    """All parts of a load, added up; `a + b` and `b + a` are equal.

    The torque against the motion that does not depend on acceleration is

        τ_ext + B_L q̇ + τ_C sgn(q̇),   τ_ext = τ + Σ k (q − q_r) + Σ m g l sin(q − q_h) + τ_recorded(t)

    Parameters
    ----------
    inertia : float
        Moment of inertia J_L without that of the pendulums [kg m²].
    viscous_friction : float
        B_L [N m s/rad].
    torque : float
        Constant external torque; positive pushes towards −q [N m].
    coulomb_torque : float
        Dry friction of the load itself; holds the shaft at rest and opposes motion both ways [N m].
    springs : tuple of Spring
    pendulums : tuple of Pendulum
    recorded : tuple of Recorded
    flexibles : tuple of Flexible
        At most one: a body behind a spring on the shaft, which is none of the above.

    Examples
    --------
    >>> from servotwin.loads import Inertia, Pendulum
    >>> load = Inertia(1e-3) + Inertia(2e-3) + Pendulum(mass=0.1, length=0.12)
    >>> load.inertia, load.pendulum.mass
    (0.003, 0.1)
    """

    not_negative: ClassVar[tuple[str, ...]] = ("inertia", "viscous_friction", "coulomb_torque")

    inertia: float = 0.0
    viscous_friction: float = 0.0
    torque: float = 0.0
    coulomb_torque: float = 0.0
    springs: tuple[Spring, ...] = ()
    pendulums: tuple[Pendulum, ...] = ()
    recorded: tuple[Recorded, ...] = ()
    flexibles: tuple[Flexible, ...] = ()

    def __post_init__(self) -> None:
        for name in self.not_negative:
            value = getattr(self, name)
            if not (is_finite(value) and value >= 0.0):
                raise LoadError(f"load.{name}", got=value, allowed="a finite number of at least 0")
        if not is_finite(self.torque):
            raise LoadError("load.torque", got=self.torque, allowed="a finite number [N m]")
        if len(self.flexibles) > 1:
            raise LoadError("load.flexible", got=f"{len(self.flexibles)} bodies behind springs", allowed="at most one")
        first, last = self.time_span
        if not first < last:
            raise LoadError("recorded torques", got="recordings that do not overlap", allowed="a common time span")

    def __add__(self, other: Part | Load) -> Load:
        more = as_load(other)
        return Load(
            inertia=self.inertia + more.inertia,
            viscous_friction=self.viscous_friction + more.viscous_friction,
            torque=self.torque + more.torque,
            coulomb_torque=self.coulomb_torque + more.coulomb_torque,
            springs=tuple(sorted(self.springs + more.springs, key=repr)),
            pendulums=tuple(sorted(self.pendulums + more.pendulums, key=repr)),
            recorded=tuple(sorted(self.recorded + more.recorded, key=repr)),
            flexibles=self.flexibles + more.flexibles,
        )

    @property
    def spring(self) -> Spring:
        """The spring, where the load has exactly one."""
        if len(self.springs) != 1:
            raise LoadError("load.spring", got=f"{len(self.springs)} springs", allowed="exactly one")
        return self.springs[0]

    @property
    def pendulum(self) -> Pendulum:
        """The pendulum, where the load has exactly one."""
        if len(self.pendulums) != 1:
            raise LoadError("load.pendulum", got=f"{len(self.pendulums)} pendulums", allowed="exactly one")
        return self.pendulums[0]

    @property
    def flexible(self) -> Flexible:
        """The body behind a spring, where the load has one."""
        if not self.flexibles:
            raise LoadError("load.flexible", got="no body behind a spring", allowed="exactly one")
        return self.flexibles[0]

    @cached_property
    def total_inertia(self) -> float:
        """Moment of inertia of all that turns with the shaft, pendulums included [kg m²]."""
        return self.inertia + sum(p.moment_of_inertia for p in self.pendulums)

    @cached_property
    def elasticity(self) -> tuple[float, float]:
        """Stiffness [N m/rad] and rest angle [rad] of the one spring that all springs add up to."""
        if len(self.springs) == 1:
            return self.springs[0].stiffness, self.springs[0].rest_angle
        stiffness = sum(s.stiffness for s in self.springs)
        torque = sum(s.stiffness * s.rest_angle for s in self.springs)
        return _number(stiffness), _number(torque / (stiffness + (stiffness == 0.0)))

    @cached_property
    def gravity(self) -> tuple[float, float]:
        """Amplitude [N m] and hanging angle [rad] of the one sine of q that all pendulums add up to."""
        if len(self.pendulums) == 1:
            return self.pendulums[0].gravity_torque, self.pendulums[0].hanging_angle
        c = sum(p.gravity_torque * np.cos(p.hanging_angle) for p in self.pendulums)
        s = sum(p.gravity_torque * np.sin(p.hanging_angle) for p in self.pendulums)
        return _number(np.hypot(c, s)), _number(np.arctan2(s, c))

    @cached_property
    def torque_pieces(self) -> Pieces:
        """The part of τ_ext that depends on time alone [N m]."""
        return self._recorded_pieces(self.torque) if self.recorded else constant_pieces(self.torque)

    @cached_property
    def recorded_pieces(self) -> Pieces | None:
        """The sum of all recordings [N m], None without any."""
        return self._recorded_pieces(0.0) if self.recorded else None

    def _recorded_pieces(self, constant: float) -> Pieces:
        t = np.unique(np.concatenate([r.time for r in self.recorded]))
        first, last = self.time_span
        t = t[(t >= first) & (t <= last)]
        y = constant + sum(np.interp(t, r.time, r.torque) for r in self.recorded)
        with np.errstate(over="ignore"):
            slope = np.diff(y) / np.diff(t)
        if not np.isfinite(slope).all():
            raise LoadError("recorded torques", got="a slope beyond all numbers", allowed="finite slopes [N m/s]")
        rows = zip(t[:-1].tolist(), y[:-1].tolist(), slope.tolist(), strict=True)
        return Pieces(tuple(Piece(*row) for row in rows))

    @property
    def time_span(self) -> tuple[float, float]:
        """First and last time for which the load is known [s]; recordings bound it."""
        return (max((r.time[0] for r in self.recorded), default=-math.inf),
                min((r.time[-1] for r in self.recorded), default=math.inf))

    def external_torque(self, time: ArrayLike, angle: ArrayLike) -> NDArray[np.float64]:
        """Return τ_ext(t, q) [N m] at `time` [s] and `angle` [rad], arrays of one shape.

        Raises
        ------
        LoadError
            Outside the span of a recorded torque.
        """
        t, q = np.asarray(time, dtype=np.float64), np.asarray(angle, dtype=np.float64)
        self.check_span(float(np.min(t, initial=math.inf)), float(np.max(t, initial=-math.inf)))
        amplitude, hanging = self.gravity
        stiffness, rest = self.elasticity
        return np.asarray(self.torque_pieces(t) + physics.spring_torque(q, stiffness, rest)
                          + physics.pendulum_torque(q, amplitude, hanging))

    def check_span(self, start: float, end: float) -> None:
        """Raise LoadError unless the load is known from `start` to `end` [s]."""
        first, last = self.time_span
        slack = 1e-12 * max(abs(start), abs(end))  # a sum of steps may end a rounding late
        if start < first - slack or end > last + slack:
            raise LoadError("recorded torque", got=f"a run from {start:g} to {end:g} s",
                            allowed=f"times from {first:g} to {last:g} s, which the record covers")


def _number(value: Any) -> float:
    """Return a number as a plain float, and a column as it is."""
    return value if np.ndim(value) else float(value)


def as_load(load: Part | Load | None) -> Load:
    """Return any load, part or None (a free shaft) in normal form.

    Raises
    ------
    LoadError
        If it is not a load.
    """
    if load is None:
        return Load()
    if isinstance(load, Load):
        return load
    if isinstance(load, Part):
        return load.as_load()
    raise LoadError("load", got=type(load).__name__, allowed="a load of servotwin.loads, or a sum of them")
