"""Searched numbers: named parameters of servo and load, each on a scale of its own, with bounds and priors."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.models import Model
from servotwin.parameters import GROUPS, Servo
from servotwin.parameters.groups import MOST_WAITING
from servotwin.parameters.servo import OUTPUT_SIDE, N, check_name, motor_side, output_value, unit_of
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.units import is_finite, si_unit

# --- How large searched parameters are where a servo says nothing of them, and between which bounds they are sought ---

TYPICAL: dict[str, float] = {  # where a servo gives nothing, or 0: the size at which a parameter begins to matter
    "friction.breakaway_ratio": 1.3, "friction.stribeck_exponent": 1.0,
    "friction.load_friction": 0.1, "friction.load_friction_stribeck": 0.1,
    "friction.load_friction_motor": 0.1, "friction.load_friction_external": 0.1,
    "friction.load_friction_motor_stribeck": 0.1, "friction.load_friction_external_stribeck": 0.1,
    "friction.load_friction_motor_quad": 0.05, "friction.load_friction_external_quad": 0.05,
    "electronics.deadband": 5e-6, "electronics.minimum_drive_time": 2e-4, "electronics.stretcher_time_constant": 0.02,
    "electronics.back_emf_injection": 0.02, "electronics.supply_coupling": 0.05, "electronics.one_shot_offset": 1e-4,
    "electronics.voltage_deadband": 5e-3, "electronics.command_offset": 0.05,
    "potentiometer.feedback_offset": 0.05, "potentiometer.backlash": 5e-3, "gear.backlash": 0.01,
    "firmware.derivative_gain": 0.05, "firmware.integral_gain": 1.0, "firmware.deadband_angle": 5e-3,
    "firmware.minimum_duty": 0.02, "firmware.filter_weight": 0.5, "firmware.compute_delay": 1e-3,
    "firmware.duty_limit": 0.9, "firmware.torque_limit": 0.9, "firmware.velocity_feedforward": 0.02,
    "firmware.acceleration_feedforward": 1e-3, "motor.brush_drop_voltage": 0.2, "supply.internal_resistance": 0.3,
    "supply.bridge_drop_voltage": 0.3, "supply.bridge_drop_resistance": 0.2, "stops.restitution": 0.2,
}
RANGES: dict[str, tuple[float, float]] = {  # of what is searched between bounds of its own, unless the caller says
    "firmware.filter_weight": (0.02, 1.0), "firmware.minimum_duty": (0.0, 0.5), "firmware.duty_limit": (0.05, 1.0),
    "firmware.torque_limit": (0.05, 1.0), "firmware.control_period": (2e-4, 0.02),
}
JUMPS = (  # what acts by jumps, where no search finds its way
    "firmware.angle_quantum", "firmware.duty_quantum", "firmware.pulse_resolution", "firmware.derivative_ticks",
    "firmware.control_phase",
)


# --- Searched numbers -------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
Bounds = Mapping[str, tuple[float, float]]
Priors = Mapping[str, tuple[float, float]]
ANY_PARAMETER = ("motor.armature_resistance", "motor.rotor_inertia", "motor.torque_constant", "gear.gear_reduction")
"""One of these is in the space, and stays, where nothing is searched: no log sets all of them."""
LUMPED: dict[str, tuple[tuple[str, ...], int, str]] = {  # name -> members, power of N that leads to the motor, unit
    name: (OUTPUT_SIDE[name].members, OUTPUT_SIDE[name].power, si_unit(OUTPUT_SIDE[name].dimension))
    for name in ("output_torque_constant", "output_inertia", "output_coulomb_torque")
}
"""Parameters at the output shaft, which are what motion alone can tell (physics of a geared motor, no N)."""
_WIDE = 20.0  # default bounds: so many times the nominal value, either way
_START = 3.0  # default random starts: so many times, either way


@dataclass(frozen=True, kw_only=True)
class FreeParameter:
    """One searched number x; its value is scale · exp(x) or scale · x.

    Parameters
    ----------
    name : str
        Dotted name of servo or load, or a lumped name.
    unit : str
        SI.
    start : float
        Value that the servo gives, or a typical one (SI).
    scale : float
        Positive, or not 0 (SI).
    logarithmic : bool
        A positive quantity is searched by its logarithm.
    lower, upper : float
        Bounds of the value (SI).
    prior : tuple of float, optional
        Mean and standard deviation of the value (SI).
    of_file : bool
        Whether the prior is what the servo's file states, not one that the caller gave.
    bounded : bool
        Whether the caller gave the bounds; random starts then fill them.
    """

    name: str
    unit: str
    start: float
    scale: float
    logarithmic: bool
    lower: float
    upper: float
    prior: tuple[float, float] | None = None
    of_file: bool = False
    bounded: bool = False

    def scaled(self, value: float) -> float:
        """Return x of a value (SI)."""
        return math.log(value / self.scale) if self.logarithmic else value / self.scale

    def value(self, x: Any) -> Any:
        """Return the value (SI) of x, a number or an array."""
        return self.scale * np.exp(x) if self.logarithmic else self.scale * x

    def slope(self, x: float) -> float:
        """Return d value / d x (SI)."""
        return float(self.value(x)) if self.logarithmic else self.scale

    @property
    def scaled_prior(self) -> tuple[float, float] | None:
        """Mean and standard deviation of x under the prior."""
        if self.prior is None:
            return None
        mean, std = self.prior
        return self.scaled(mean), std / (mean if self.logarithmic else self.scale)


class Space:
    """All searched parameters, and how their values become parameters of lanes.

    Parameters
    ----------
    model : Model
        Reads the parameters; its servo gives the nominal values.
    free : sequence of str
        Dotted names of servo and load, or lumped names.
    bounds : mapping, optional
        Lowest and highest value by name (SI).
    priors : mapping or "servo", optional
        Mean and standard deviation by name (SI); "servo" takes the spread that the servo's file states.

    Raises
    ------
    InputError
        If a name is unknown, not read by the model or given twice, or bounds or a prior make no sense.

    Examples
    --------
    >>> import servotwin as st
    >>> space = Space(st.PulseServo(st.load_servo("hitec-hs-755hb")), ["output_torque_constant"])
    >>> sorted(space.columns(space.start[None, :]))
    ['motor.back_emf_constant', 'motor.torque_constant']
    """

    def __init__(self, model: Model, free: Sequence[str], *, bounds: Bounds | None = None,
                 priors: Priors | str | None = None, load: Mapping[str, float] | None = None) -> None:
        if isinstance(free, str) or not isinstance(free, Sequence) or not free:
            raise InputError("free", got=free, allowed="a list of at least one name")
        _check_names(model, free)
        self.servo = model.servo
        if not isinstance(bounds or {}, Mapping):
            raise InputError("bounds", got=bounds, allowed="a mapping of names to (lowest, highest)")
        limits, beliefs = dict(bounds or {}), _beliefs(model.servo, free, priors)
        for what, names in (("bounds", limits), ("priors", beliefs)):
            for name in names:
                if name not in free:
                    raise InputError(f"{what}: {name}", got="a name that is not free", allowed=", ".join(free))
        said = stated(model.servo, [*beliefs])
        self.parameters = tuple(
            replace(_parameter(model.servo, name, limits.get(name), beliefs.get(name), load or {}),
                    of_file=name in beliefs and beliefs[name] == said.get(name)) for name in free)
        self.names = tuple(free)
        self.start = np.array([p.scaled(p.start) for p in self.parameters])
        self.lower = np.array([p.scaled(p.lower) if p.lower > 0.0 or not p.logarithmic else -math.inf
                               for p in self.parameters])
        self.upper = np.array([p.scaled(p.upper) for p in self.parameters])

    def __len__(self) -> int:
        return len(self.parameters)

    def changed(self, model: Model, names: Sequence[str], *, believed: Collection[str] | None = None,
                at: Array | None = None) -> Space:
        """Return the space of another model or other names: bounds and priors stay, and what is said of the load.

        Parameters
        ----------
        model : Model
        names : sequence of str
        believed : collection of str, optional
            Names whose priors stay; all unless given.
        at : ndarray, shape (p,), optional
            Where numbers of the load stand; where they began unless given.
        """
        kept = [(k, p) for k, p in enumerate(self.parameters) if p.name in names]
        return Space(
            model, names, bounds={p.name: (p.lower, p.upper) for _, p in kept if p.bounded},
            priors={p.name: p.prior for _, p in kept
                    if p.prior is not None and (believed is None or p.name in believed)} or None,
            load={p.name: p.start if at is None else float(p.value(at[k]))
                  for k, p in enumerate(self.parameters) if p.name in LOAD_NAMES})

    def values(self, x: Array) -> Array:
        """Return the values (SI) of points x, shape (…, p)."""
        return np.stack([p.value(x[..., k]) for k, p in enumerate(self.parameters)], axis=-1)

    def slopes(self, x: Array) -> Array:
        """Return d value / d x (SI) at a point, shape (p,)."""
        return np.array([p.slope(float(x[k])) for k, p in enumerate(self.parameters)])

    def shares(self, x: Array) -> Array:
        """Return d ln(value) / d x at a point, shape (p,); nan where a value is not positive."""
        values = self.values(x[None, :len(self)])[0]
        return np.array([self.parameters[k].slope(float(x[k])) / v if v > 0.0 else math.nan
                         for k, v in enumerate(values)])

    def columns(self, x: Array) -> dict[str, Array]:
        """Return the parameters of servo and load (SI) at points x, shape (B, p): one column (B,) per dotted name."""
        values = self.values(x)
        own = {name: values[:, k] for k, name in enumerate(self.names)}
        reduction: Any = own.get(N, self.servo.get(N))
        columns = {name: column for name, column in own.items() if name not in LUMPED}
        return columns | motor_side({name: own[name] for name in LUMPED if name in own}, reduction)

    def servo_at(self, x: Array) -> Servo:
        """Return the servo with the values of a point; numbers of the load apart."""
        return self.servo.replace({name: float(column[0]) for name, column in self.columns(x[None, :]).items()
                                   if name not in LOAD_NAMES}, source="where a search of a fit stands")

    def random(self, rng: np.random.Generator) -> Array:
        """Return a random start: anywhere between bounds that were given, else about the nominal values."""
        return np.array([_random(p, rng) for p in self.parameters])


def _random(p: FreeParameter, rng: np.random.Generator) -> float:
    if p.bounded:
        return float(rng.uniform(p.scaled(p.lower), p.scaled(p.upper)))
    if p.logarithmic:
        x = p.scaled(p.start) + rng.uniform(-1.0, 1.0) * math.log(_START)
    elif p.lower >= 0.0:
        x = p.lower / p.scale + rng.uniform(0.0, _START) * max(p.start - p.lower, 0.0) / p.scale
    else:
        x = p.scaled(p.start) + rng.uniform(-1.0, 1.0)
    return float(np.clip(x, p.scaled(p.lower), p.scaled(p.upper)))


def _check_names(model: Model, free: Sequence[str]) -> None:
    read = (*model.requires, *model.optional)
    seen: dict[str, str] = {}
    for name in free:
        if name not in LUMPED and name not in LOAD_NAMES and name not in read:
            names = {f"{group}.{key}" for group, kind in GROUPS.items() for key in kind.__dataclass_fields__}
            if name in names:
                raise ParameterError(f"free: {type(model).__name__} does not read {name!r}",
                                     allowed=", ".join((*LUMPED, *read, *LOAD_NAMES)))
            raise UnknownNameError("free parameter", name, (*LUMPED, *read, *LOAD_NAMES))
        for member in LUMPED[name][0] if name in LUMPED else (name,):
            if member in seen:
                raise InputError(f"free: {name}", got=f"also {seen[member]}" if seen[member] != name else "twice",
                                 allowed=f"one of them: both set {member}")
            seen[member] = name
        if name not in LUMPED and name not in LOAD_NAMES:
            group, key = check_name(name)
            if GROUPS[group].__dataclass_fields__[key].metadata["dimension"] == "word" \
                    or GROUPS[group].__dataclass_fields__[key].metadata["rule"] == "table":
                raise ParameterError(f"free: {name}", got="a word or a table", allowed="a number")
            if name in JUMPS:
                raise ParameterError(f"free: {name}", got="a number that acts by jumps",
                                     allowed="one that acts smoothly; compare fits to choose such a number")


def unit_of_free(name: str) -> str:
    """Return the SI unit of a free parameter.

    Examples
    --------
    >>> unit_of_free("output_inertia"), unit_of_free("load.inertia")
    ('kg m2', 'kg m2')
    """
    if name in LUMPED:
        return LUMPED[name][2]
    if name in LOAD_NAMES:
        from servotwin.studies import dimension_of

        return si_unit(dimension_of(name))
    return unit_of(name)


def nominal(servo: Servo, name: str) -> float | None:
    """Return the value (SI) of a free parameter that a servo gives; None where it gives none.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> nominal(servo, "output_torque_constant") == servo.gear.gear_reduction * servo.motor.torque_constant
    True
    """
    if name not in LUMPED:
        value = servo.get(name)
        if name == "firmware.deadband_angle" and value is None:
            return _deadband(servo)
        return float(value) if isinstance(value, int | float) else None
    return output_value(servo, name)


def _deadband(servo: Servo) -> float | None:
    """Return the half dead zone of the error that a deadband of pulses is [rad]."""
    width, slope, gain = (servo.get(name) for name in (
        "electronics.deadband", "electronics.one_shot_slope", "potentiometer.feedback_gain"))
    if not all(isinstance(x, int | float) and x > 0.0 for x in (width, slope, gain)):
        return None
    return 0.5 * width / (slope * gain)  # type: ignore[operator]


def _parameter(servo: Servo, name: str, limits: tuple[float, float] | None, belief: tuple[float, float] | None,
               load: Mapping[str, float]) -> FreeParameter:
    value = load.get(name, 0.0) if name in LOAD_NAMES else nominal(servo, name)
    typical = _typical(servo, name)
    there = name in TYPICAL or name == "friction.stribeck_speed"  # else what is absent is 0
    start = value if value is not None else typical if there else 0.0
    scale = max(abs(start), typical if start == 0.0 else 0.0) or 1.0
    rule = _rule(name)
    logarithmic = rule == "a positive number" and start > 0.0
    floor = {"a positive number": 0.0, "a number of at least 0": 0.0, "a number of at least 1": 1.0,
             "a number from 0 to 1": 0.0}.get(rule, -math.inf)
    ceiling = 1.0 if rule == "a number from 0 to 1" else math.inf
    if logarithmic:
        lower, upper = start / _WIDE, start * _WIDE
    else:
        lower, upper = max(floor, start - _WIDE * scale), min(ceiling, start + _WIDE * scale)
    lower, upper = _within(servo, name, start, (lower, upper))
    if limits is not None:
        lower, upper = _limits(name, limits, floor, ceiling, positive=logarithmic)
        start = min(max(start, lower), upper)
    if name == N:
        lower = max(lower, 1.0)
    if belief is not None and logarithmic and belief[0] <= 0.0:
        raise InputError(f"prior of {name}", got=belief[0], allowed="a positive mean")
    return FreeParameter(name=name, unit=unit_of_free(name), start=start, scale=scale, logarithmic=logarithmic,
                         lower=lower, upper=upper, prior=belief, bounded=limits is not None)


def _within(servo: Servo, name: str, start: float, wide: tuple[float, float]) -> tuple[float, float]:
    """Return the range of a search that its own nature narrows; it holds where the search starts."""
    low, high = RANGES.get(name, wide)
    tick = nominal(servo, "firmware.control_period")
    if name in ("firmware.compute_delay", "firmware.bus_latency") and tick is not None:
        high = min(high, (MOST_WAITING - 1) * tick)
    return min(low, start), max(high, start)


def _typical(servo: Servo, name: str) -> float:
    """Return the size at which a parameter begins to matter beside what the servo has; 0 where none is known."""
    if name in TYPICAL:
        return TYPICAL[name]
    reduction = nominal(servo, N) or 1.0
    gain, resistance = nominal(servo, "output_torque_constant"), nominal(servo, "motor.armature_resistance")
    inertia, voltage = nominal(servo, "output_inertia"), nominal(servo, "supply.open_circuit_voltage")
    if name == "friction.stribeck_speed":
        return 0.2 * reduction  # 0.2 rad/s at the output shaft
    if name in ("load.inertia", "gear.output_inertia", "load.pendulum.inertia"):
        return 0.5 * (inertia or 0.0)
    if not gain or not resistance:
        return 0.0
    damping, stall = gain**2 / resistance, gain * (voltage or 6.0) / resistance
    sizes = {"motor.motor_viscous_friction": 0.1 * damping / reduction**2, "load.viscous_friction": 0.1 * damping,
             "load.torque": 0.1 * stall, "load.coulomb_torque": 0.05 * stall, "output_coulomb_torque": 0.05 * stall}
    sizes |= {member: 0.05 * stall / reduction for member in LUMPED["output_coulomb_torque"][0]}
    return sizes.get(name, 0.0)


def _rule(name: str) -> str:
    if name in LUMPED:
        return "a positive number" if name != "output_coulomb_torque" else "a number of at least 0"
    if name in LOAD_NAMES:
        return "a number of at least 0" if name in (
            "load.inertia", "load.viscous_friction", "load.coulomb_torque", "load.pendulum.mass",
            "load.pendulum.length", "load.pendulum.inertia", "load.spring.stiffness") else "a finite number"
    group, key = check_name(name)
    rule: str = GROUPS[group].__dataclass_fields__[key].metadata["rule"]
    return rule


def _limits(name: str, limits: Any, floor: float, ceiling: float, *, positive: bool) -> tuple[float, float]:
    try:
        lower, upper = (float(x) for x in limits)
    except (TypeError, ValueError):
        raise InputError(f"bounds of {name}", got=limits, allowed="two numbers, the lower one first (SI)") from None
    good = math.isfinite(lower) and math.isfinite(upper) and lower < upper and lower >= floor and upper <= ceiling
    if not good or (positive and lower <= 0.0):
        raise InputError(f"bounds of {name}", got=f"{lower} to {upper}",
                         allowed=f"two finite numbers, the lower one first, {_rule(name)} (SI)")
    return lower, upper


def _beliefs(servo: Servo, free: Sequence[str], priors: Priors | str | None) -> dict[str, tuple[float, float]]:
    if priors is None or priors == "servo":
        return {} if priors is None else stated(servo, free)
    if not isinstance(priors, Mapping):
        raise InputError("priors", got=priors, allowed='"servo", None or a mapping of names to (mean, std)')
    for name, belief in priors.items():
        good = isinstance(belief, Sequence) and len(belief) == 2 and all(is_finite(x) for x in belief)
        if not good or belief[1] <= 0.0:
            raise InputError(f"prior of {name}", got=belief, allowed="mean and standard deviation (SI), the latter "
                             "positive")
    return {name: (float(mean), float(std)) for name, (mean, std) in priors.items()}


def stated(servo: Servo, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of those names of which the servo's file states them (SI)."""
    found = {name: _stated(servo, name) for name in names if name not in LOAD_NAMES}
    return {name: belief for name, belief in found.items() if belief is not None}


def _stated(servo: Servo, name: str) -> tuple[float, float] | None:
    """Return mean and standard deviation that the servo's file states.

    An interval of an earlier fit is one of a normal law. Any other range says no more than from where to where: it is
    uniform, and counts by its mean square distance from the value, on the scale of the search.
    """
    from scipy.special import ndtri

    member = LUMPED[name][0][0] if name in LUMPED else name
    value = servo.get(member)
    if not isinstance(value, int | float):
        return None
    quantity = servo.source(member)
    reduction: Any = servo.get(N) or 1.0
    factor = float(reduction) ** LUMPED[name][1] if name in LUMPED else 1.0
    if quantity.std:
        return factor * float(value), factor * quantity.std
    if quantity.lower is None or quantity.upper is None or quantity.upper <= quantity.lower:
        return None
    mean, lower, upper = float(value), quantity.lower, quantity.upper
    if mean == 0.0:
        mean = 0.5 * (lower + upper)
    if quantity.origin == "identified":
        level = float(servo.fit.get("level", 0.95))
        std = (upper - lower) / (2.0 * float(ndtri(0.5 + 0.5 * level)))
    elif _rule(name) == "a positive number" and lower > 0.0:
        std = mean * _uniform(math.log(lower / mean), math.log(upper / mean))
    else:
        std = _uniform(lower - mean, upper - mean)
    return factor * mean, factor * std


def _uniform(lower: float, upper: float) -> float:
    """Return the root of the mean square of what is uniform between two numbers: width / √12 if 0 is their middle."""
    return math.sqrt((lower**2 + lower * upper + upper**2) / 3.0)
