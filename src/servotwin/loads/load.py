"""The sum of all that hangs on the shaft, in one normal form, and what every part of it is."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from servotwin import physics
from servotwin.errors import LoadError
from servotwin.physics.pieces import Piece, Pieces, constant_pieces
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray



# --- The sum of all that hangs on the shaft, in one normal form, and what every part of it is -------------------------

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


# --- The parts of a load: each one mechanical thing, checked once, addable to others ----------------------------------

STANDARD_GRAVITY = 9.80665  # m/s², 3rd CGPM (1901)


class _Numbers(Part):
    """A part that is given by numbers: all finite, kept as floats, and summed by name unless it says otherwise."""

    not_negative: ClassVar[tuple[str, ...]] = ()
    positive: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        for f in fields(self):  # type: ignore[arg-type]
            value = getattr(self, f.name)
            if value is None and f.default is None:
                continue
            if not is_finite(value):
                raise LoadError(f"{type(self).__name__}({f.name})", got=value, allowed="a finite number")
            object.__setattr__(self, f.name, float(value))  # a float32 would lower the precision of all that it meets
            if f.name in self.not_negative and not value >= 0.0:
                raise LoadError(f"{type(self).__name__}({f.name})", got=value, allowed="a number of at least 0")
            if f.name in self.positive and not value > 0.0:
                raise LoadError(f"{type(self).__name__}({f.name})", got=value, allowed="a positive number")

    def as_load(self) -> Load:
        """Return this part alone, in normal form."""
        return Load(**vars(self))


@dataclass(frozen=True)
class Free(_Numbers):
    """Nothing: the shaft turns freely.

    Examples
    --------
    >>> (Free() + Inertia(1e-3)).inertia
    0.001
    """


@dataclass(frozen=True)
class Inertia(_Numbers):
    """A disc: moment of inertia J_L about the shaft, at least 0 [kg m²] (paper, eq. 16).

    Examples
    --------
    >>> Inertia(1e-3).inertia
    0.001
    """

    not_negative: ClassVar[tuple[str, ...]] = ("inertia",)

    inertia: float


@dataclass(frozen=True)
class Viscous(_Numbers):
    """A damper: torque B_L q̇ against the motion, B_L at least 0 [N m s/rad] (paper, eq. 16).

    Examples
    --------
    >>> Viscous(1e-4).viscous_friction
    0.0001
    """

    not_negative: ClassVar[tuple[str, ...]] = ("viscous_friction",)

    viscous_friction: float


@dataclass(frozen=True)
class Constant(_Numbers):
    """A constant torque, a weight on a drum; positive pushes the shaft towards −q [N m].

    Examples
    --------
    >>> (Constant(0.1) + Constant(0.2)).torque
    0.3
    """

    torque: float


@dataclass(frozen=True)
class Coulomb(_Numbers):
    """Dry friction of the load: opposes motion either way and holds at rest, at least 0 [N m].

    Examples
    --------
    >>> Coulomb(0.05).coulomb_torque
    0.05
    """

    not_negative: ClassVar[tuple[str, ...]] = ("coulomb_torque",)

    coulomb_torque: float


@dataclass(frozen=True)
class Spring(_Numbers):
    """A torsion spring: torque k (q − q_r) against the motion away from its rest angle.

    Parameters
    ----------
    stiffness : float
        k, at least 0 [N m/rad].
    rest_angle : float
        q_r [rad].

    Examples
    --------
    >>> (Spring(1.0, 0.0) + Spring(1.0, 1.0)).elasticity
    (2.0, 0.5)
    """

    not_negative: ClassVar[tuple[str, ...]] = ("stiffness",)

    stiffness: float
    rest_angle: float = 0.0

    def as_load(self) -> Load:
        """Return this part alone, in normal form."""
        return Load(springs=(self,))


@dataclass(frozen=True)
class Pendulum(_Numbers):
    """A weight on an arm: torque m g l sin(q − q_h) against the motion away from hanging.

    Parameters
    ----------
    mass : float
        m, at least 0 [kg].
    length : float
        Distance l of the centre of mass from the shaft, at least 0 [m].
    inertia : float, optional
        Moment of inertia about the shaft [kg m²]; m l² unless given.
    hanging_angle : float
        Output angle q_h at which it hangs straight down [rad].
    gravity : float
        g [m/s²].

    Examples
    --------
    >>> round(Pendulum(mass=0.1, length=0.12).gravity_torque, 6)
    0.11768
    """

    not_negative: ClassVar[tuple[str, ...]] = ("mass", "length", "inertia", "gravity")

    mass: float
    length: float
    inertia: float | None = None
    hanging_angle: float = 0.0
    gravity: float = STANDARD_GRAVITY

    def as_load(self) -> Load:
        """Return this part alone, in normal form."""
        return Load(pendulums=(self,))

    @property
    def moment_of_inertia(self) -> float:
        """About the shaft [kg m²]."""
        return self.mass * self.length**2 if self.inertia is None else self.inertia

    @property
    def gravity_torque(self) -> float:
        """Amplitude m g l [N m]."""
        return self.mass * self.gravity * self.length


@dataclass(frozen=True)
class Flexible(_Numbers):
    """A body behind a spring on the shaft, such as a long arm: torque k (q − q_l) + c (q̇ − q̇_l) against the shaft.

    All other parts of the load turn with the shaft. At the start the spring is not twisted.

    Parameters
    ----------
    stiffness : float
        k, positive [N m/rad].
    inertia : float, optional
        Moment of inertia of the body about the shaft, positive [kg m²]; m l² unless given.
    damping : float
        c, at least 0 [N m s/rad].
    viscous_friction : float
        Of the body's own motion, at least 0 [N m s/rad].
    mass : float
        m, whose weight pulls at the body as at a pendulum, at least 0 [kg].
    length : float
        Distance l of the centre of mass from the shaft, at least 0 [m].
    hanging_angle : float
        Angle q_l at which it hangs straight down [rad].
    gravity : float
        g [m/s²].

    Examples
    --------
    >>> arm = Flexible(stiffness=100.0, inertia=0.01)
    >>> round(arm.held_frequency, 3)
    15.915
    """

    not_negative: ClassVar[tuple[str, ...]] = ("damping", "viscous_friction", "mass", "length", "gravity")
    positive: ClassVar[tuple[str, ...]] = ("stiffness", "inertia")

    stiffness: float
    inertia: float | None = None
    damping: float = 0.0
    viscous_friction: float = 0.0
    mass: float = 0.0
    length: float = 0.0
    hanging_angle: float = 0.0
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.moment_of_inertia > 0.0:
            raise LoadError("Flexible(inertia)", got=self.moment_of_inertia,
                            allowed="a positive number, or mass and length that make one")

    def as_load(self) -> Load:
        """Return this part alone, in normal form."""
        return Load(flexibles=(self,))

    @property
    def moment_of_inertia(self) -> float:
        """About the shaft [kg m²]."""
        return self.mass * self.length**2 if self.inertia is None else self.inertia

    @property
    def gravity_torque(self) -> float:
        """Amplitude m g l [N m]."""
        return self.mass * self.gravity * self.length

    @property
    def held_frequency(self) -> float:
        """Frequency at which it would ring, undamped, on a shaft that is held [Hz]."""
        return float(np.sqrt(self.stiffness / self.moment_of_inertia) / (2.0 * np.pi))


@dataclass(frozen=True)
class Recorded(Part):
    """A torque measured over time, linear between samples; a run outside the record is an error.

    Parameters
    ----------
    time : sequence of float, shape (n,)
        Increasing, n ≥ 2 [s].
    torque : sequence of float, shape (n,)
        Positive pushes the shaft towards −q [N m].

    Examples
    --------
    >>> Recorded([0.0, 1.0], [0.0, 0.2]).torque
    (0.0, 0.2)
    """

    time: Sequence[float]
    torque: Sequence[float]

    def __post_init__(self) -> None:
        try:
            time, torque = np.asarray(self.time, dtype=np.float64), np.asarray(self.torque, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise LoadError("Recorded(time, torque)", got="values that are no numbers", allowed="numbers") from None
        if time.ndim != 1 or time.shape != torque.shape or time.size < 2:
            raise LoadError("Recorded(time, torque)", got=f"shapes {time.shape} and {torque.shape}",
                            allowed="two arrays of one length of at least 2")
        if not (np.isfinite(time).all() and np.isfinite(torque).all()):
            raise LoadError("Recorded(time, torque)", got="values that are not finite", allowed="finite numbers")
        if not (np.diff(time) > 0.0).all():
            raise LoadError("Recorded(time)", got="times that do not increase", allowed="increasing times [s]")
        object.__setattr__(self, "time", tuple(time.tolist()))
        object.__setattr__(self, "torque", tuple(torque.tolist()))

    def as_load(self) -> Load:
        """Return this part alone, in normal form."""
        return Load(recorded=(self,))
