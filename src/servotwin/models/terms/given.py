"""Given numbers of a servo and of its load, of which terms make their own."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.parameters.groups import GROUPS, Group

if TYPE_CHECKING:
    from servotwin.loads import Load


# --- Given numbers of a servo -----------------------------------------------------------------------------------------

if TYPE_CHECKING:

    class Given(tuple[float, ...]):
        """A number for each parameter."""

        def __getattr__(self, name: str) -> float:
            """Return one, by its dotted name with _ in the place of the dot."""

        def __init__(self, **numbers: float) -> None:
            """All others are not given."""

else:
    Given = NamedTuple("Given", [(f"{title}_{f.name}", float) for title, group in GROUPS.items() for f in fields(group)
                                 if f.metadata["rule"] != "table"])
    Given.__new__.__defaults__ = (math.nan,) * len(Given._fields)
    Given.__doc__ = """Parameters of a servo (SI) by their dotted names, with _ in the place of the dot.

    Each is a number or a column of lanes; nan: not given. A word stands as its place among those that are allowed, from
    0 on. The table of a potentiometer stands elsewhere.
    """


def either(value: float, default: float) -> float:
    """Return a number, or a default where it is not given."""
    return value if value == value else default


def is_given(value: float) -> bool:
    """Tell whether a number is given."""
    return value == value


def field_of(name: str) -> str:
    """Return the field of a parameter by its dotted name.

    Examples
    --------
    >>> field_of("motor.armature_resistance")
    'motor_armature_resistance'
    """
    return name.replace(".", "_", 1)


def place(name: str, word: str) -> float:
    """Return the number that stands for the word of a parameter.

    Examples
    --------
    >>> place("electronics.off_state", "coast")
    1.0
    """
    return float(_words()[name].index(word))


def given_of(servo: Any, names: Iterable[str]) -> Given:
    """Return the parameters of a servo, or of a servo of lanes, that have these dotted names; others are not given."""
    found: dict[str, Any] = {}
    words = _words()
    for name in names:
        value = servo.get(name)
        if value is None or isinstance(value, tuple):
            continue
        if name in words:
            value = _placed(words[name], value)
        found[field_of(name)] = value
    return Given(**found)


def _placed(words: tuple[str, ...], value: Any) -> Any:
    """Return the place of a word, or of each word of a column."""
    if isinstance(value, np.ndarray):
        return sum(float(k) * (value == word) for k, word in enumerate(words))
    return float(words.index(value))


@cache
def _words() -> dict[str, tuple[str, ...]]:
    """Return what words parameters may have that are no numbers."""
    groups: dict[str, type[Group]] = GROUPS
    return {f"{title}.{f.name}": f.metadata["rule"] for title, group in groups.items() for f in fields(group)
            if isinstance(f.metadata["rule"], tuple)}


# --- The load on the shaft, as numbers alone --------------------------------------------------------------------------

class Hung(NamedTuple):
    """A load in SI, each a number or a column of lanes; torques that depend on time alone are inputs."""

    inertia: float  # pendulums included
    viscous_friction: float
    coulomb_torque: float
    stiffness: float
    rest_angle: float
    gravity_torque: float  # m g l
    hanging_angle: float
    flexible_stiffness: float  # of the shaft to another body; 0: there is none
    flexible_damping: float
    flexible_inertia: float
    flexible_viscous_friction: float
    flexible_gravity_torque: float
    flexible_hanging_angle: float


def hung_of(load: Load) -> Hung:
    """Return the numbers of a load."""
    flexible = (0.0,) * 6
    if load.flexibles:
        arm = load.flexible
        flexible = (arm.stiffness, arm.damping, arm.moment_of_inertia, arm.viscous_friction, arm.gravity_torque,
                    arm.hanging_angle)
    return Hung(load.total_inertia, load.viscous_friction, load.coulomb_torque, *load.elasticity, *load.gravity,
                *flexible)


def inertia_on(given: Given, hung: Hung) -> float:
    """Return J_L [kg m²]: the load's, and that of gear wheel and horn where the servo gives it."""
    return hung.inertia + either(given.gear_output_inertia, 0.0)
