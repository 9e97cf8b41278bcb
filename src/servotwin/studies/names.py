"""What can be varied: of a dotted name, the dimension, the physical range and the nominal value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin import parameters
from servotwin.errors import ParameterError, UnknownNameError
from servotwin.parameters.group import AT_LEAST_ONE, FRACTION, NOT_NEGATIVE, POSITIVE
from servotwin.simulation.lanes.inputs import _PARTS, LOAD_NAMES, check_name
from servotwin.studies.joint import DIMENSIONS, TINY
from servotwin.studies.stated import Together
from servotwin.units import si_unit

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model

_RANGES = {POSITIVE: (TINY, math.inf), NOT_NEGATIVE: (0.0, math.inf), AT_LEAST_ONE: (1.0, math.inf),
           FRACTION: (0.0, 1.0)}
_PLACES_OF_JOINTS = ("sheet.", "calibration.", "output_")
_OF_LOAD = {
    "load.inertia": "inertia", "load.viscous_friction": "torque per speed", "load.torque": "torque",
    "load.coulomb_torque": "torque", "load.pendulum.mass": "mass", "load.pendulum.length": "length",
    "load.pendulum.inertia": "inertia", "load.pendulum.hanging_angle": "angle",
    "load.pendulum.gravity": "acceleration", "load.spring.stiffness": "torque per angle",
    "load.spring.rest_angle": "angle", "load.flexible.stiffness": "torque per angle",
    "load.flexible.inertia": "inertia", "load.flexible.damping": "torque per speed",
    "load.flexible.viscous_friction": "torque per speed", "load.flexible.mass": "mass",
    "load.flexible.length": "length", "load.flexible.hanging_angle": "angle", "load.flexible.gravity": "acceleration",
}


class Parameter(NamedTuple):
    """A number or word of servo or load that may differ from lane to lane.

    Parameters
    ----------
    name : str
        Dotted.
    dimension : str
        Of `servotwin.units`; "word" for words.
    lower, upper : float
        Least and largest possible value (SI).
    allowed : str
        The range in words.
    nominal : float, str or None
        What the servo or the load says (SI); None where it says nothing.
    """

    name: str
    dimension: str
    lower: float
    upper: float
    allowed: str
    nominal: float | str | None


def dimension_of(name: str) -> str:
    """Return the dimension (of `servotwin.units`) of a dotted name; "word" for words.

    Examples
    --------
    >>> dimension_of("motor.armature_resistance"), dimension_of("load.pendulum.mass")
    ('resistance', 'mass')
    >>> dimension_of("sheet.stall_torque")
    'torque'
    """
    if name in DIMENSIONS:
        return DIMENSIONS[name]
    if name in _OF_LOAD:
        return _OF_LOAD[name]
    return parameters.dimension_of(name)


def parameter(name: str, model: Model, load: Load) -> Parameter:
    """Return what is known of a dotted name, or of a number that others follow from.

    Raises
    ------
    UnknownNameError, ParameterError, LoadError
        If there is no such number, the model does not read it, or it is a table.
    """
    if name in LOAD_NAMES:
        return _of_load(name, load)
    if name not in (*model.requires, *model.optional):
        together = Together(model)
        if name.startswith(_PLACES_OF_JOINTS):
            return _of_joint(name, together, model)
        if name not in together.unread:
            check_name(model, name)
    group, _, key = name.partition(".")
    metadata = parameters.GROUPS[group].__dataclass_fields__[key].metadata
    rule, dimension, nominal = metadata["rule"], dimension_of(name), model.servo.get(name)
    if rule == "table" or isinstance(nominal, tuple):
        raise ParameterError(f"vary {name}", got="a table", allowed="a number or a word")
    if isinstance(rule, tuple):
        return Parameter(name, dimension, -math.inf, math.inf, " or ".join(rule), nominal)
    lower, upper = _RANGES.get(rule, (-math.inf, math.inf))
    return Parameter(name, dimension, lower, upper, f"{rule} [{si_unit(dimension)}]", nominal)


def _of_joint(name: str, together: Together, model: Model) -> Parameter:
    if name not in DIMENSIONS:
        raise UnknownNameError("number to draw", name, DIMENSIONS)
    if name not in together.coordinates:
        raise ParameterError(f"vary {name}", got=f"a number from which nothing of {model.servo.name!r} follows",
                             allowed=", ".join(together.coordinates) or "parameters of servo and load")
    one = together.coordinates[name]
    rule = POSITIVE if one.lower > 0.0 else NOT_NEGATIVE
    allowed = f"{rule}{'' if math.isinf(one.upper) else f', at most {one.upper:g}'} [{si_unit(one.dimension)}]"
    return Parameter(name, one.dimension, one.lower, one.upper, allowed, one.nominal)


def _of_load(name: str, load: Load) -> Parameter:
    _, *part, key = name.split(".")
    owner: Any = getattr(load, part[0]) if part else load
    kind = _PARTS[part[0]] if part else type(load)
    lower = TINY if key in getattr(kind, "positive", ()) else 0.0 if key in kind.not_negative else -math.inf
    allowed = "a finite positive number" if lower > 0.0 else "a finite number" + " of at least 0" * (lower == 0.0)
    nominal = owner.moment_of_inertia if part and key == "inertia" else getattr(owner, key)
    return Parameter(name, _OF_LOAD[name], lower, math.inf, f"{allowed} [{si_unit(_OF_LOAD[name])}]", nominal)
