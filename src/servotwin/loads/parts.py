"""The parts of a load: each one mechanical thing, checked once, addable to others."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from servotwin.errors import LoadError
from servotwin.loads.load import Load, Part
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Sequence

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

    What else the load has turns with the shaft. At the start the spring is not twisted.

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
