"""One voltage, or one scale of all loads or of the angle, that explains contradictions between logs and servo file.

The motion of a servo says its numbers only relative to the voltage and to the loads that the logs state. If the supply
has a times the voltage that is said, a fit finds the torque constant 1/a and the resistances 1/a² times as large; if
all loads are b times as large, it finds inertia and friction 1/b and the resistances b times as large, for
J q'' = K/R (s V - K q') - tau_c holds with these as with the true ones. If the angle is c times what the shaft turns
through, it finds the gain of the potentiometer, the torque constant and friction 1/c times as large, inertia and
viscous friction 1/c².
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np

_TORQUE = ("output_torque_constant", "motor.torque_constant", "motor.back_emf_constant")
_RESISTANCE = ("motor.armature_resistance", "supply.internal_resistance", "supply.bridge_drop_resistance")
_MECHANICAL = ("output_inertia", "motor.rotor_inertia", "gear.output_inertia", "output_coulomb_torque",
               "friction.coulomb_torque_forward", "friction.coulomb_torque_backward", "motor.motor_viscous_friction")
_SQUARED = ("output_inertia", "motor.rotor_inertia", "gear.output_inertia", "motor.motor_viscous_friction")
_GAIN = "potentiometer.feedback_gain"  # which an angle's scale alone may explain
_POWERS: Mapping[str, Mapping[str, float]] = {  # of a factor of voltage, load or angle, in what a fit finds
    "voltage": {**dict.fromkeys(_TORQUE, -1.0), **dict.fromkeys(_RESISTANCE, -2.0)},
    "load": {**dict.fromkeys(_RESISTANCE, 1.0), **dict.fromkeys(_MECHANICAL, -1.0)},
    "angle": {_GAIN: -1.0, **dict.fromkeys(_TORQUE, -1.0), **dict.fromkeys(_MECHANICAL, -1.0),
              **dict.fromkeys(_SQUARED, -2.0)},
}
_FEWEST = 2
_APART = 3.5  # standard errors, beyond which something is still contradicted
_NUMBERS = {2: "both", 3: "all three", 4: "all four", 5: "all five"}


class Contradicted(Protocol):
    """What logs say of a number, and what a file says (SI)."""

    @property
    def name(self) -> str: ...  # noqa: D102 - as of `Yielded`
    @property
    def file(self) -> float: ...  # noqa: D102
    @property
    def file_std(self) -> float: ...  # noqa: D102
    @property
    def logs(self) -> float: ...  # noqa: D102
    @property
    def logs_std(self) -> float: ...  # noqa: D102


class Agreeing(NamedTuple):
    """A number of which logs and file do not contradict each other; as `Contradicted`."""

    name: str
    file: float
    file_std: float
    logs: float
    logs_std: float


class _Scale(NamedTuple):
    """The factor that explains everything best, and the largest contradiction that is left [standard errors]."""

    factor: float
    left: float


def common_cause(contradicted: Sequence[Contradicted], agreeing: Sequence[Contradicted] = (), *, voltage: float,
                 drop_voltage: float = 0.0) -> str | None:
    """Return one sentence on the voltage or the scale that would explain all contradictions; None without one.

    Parameters
    ----------
    contradicted : sequence of Contradicted
        At least two, or the gain of the potentiometer, which a scale of the angle explains as well.
    agreeing : sequence of Contradicted
        Numbers that must not be contradicted by it.
    voltage, drop_voltage : float
        That are said of the supply, and the drop of the bridge [V].

    Examples
    --------
    >>> items = [Agreeing("motor.armature_resistance", 3.0, 0.1, 4.15, 0.05),
    ...          Agreeing("output_torque_constant", 1.0, 0.01, 1.176, 0.01)]
    >>> print(common_cause(items, voltage=6.0))
    a supply of 5.1 V instead of 6 V would explain both: measure it, or search for supply.open_circuit_voltage
    """
    known = [one for one in contradicted if _usable(one)]
    fewest = 1 if any(one.name == _GAIN for one in known) else _FEWEST
    if len(known) < max(fewest, len(contradicted)):
        return None
    others = [one for one in agreeing if _usable(one)]
    found = {cause: _scale(known, others, powers) for cause, powers in _POWERS.items()
             if all(one.name in powers for one in known) and (cause != "angle" or fewest == 1)}
    good = {cause: scale for cause, scale in found.items() if scale.left < _APART}
    if not good:
        return None
    cause = min(good, key=lambda name: good[name].left)
    factor, many = good[cause].factor, _NUMBERS.get(len(known), f"all {len(known)}")
    if cause == "voltage":
        supply = drop_voltage + factor * (voltage - drop_voltage)
        return (f"a supply of {supply:.2g} V instead of {voltage:g} V would explain {many}: measure it, or search for "
                "supply.open_circuit_voltage")
    if cause == "angle":
        return (f"or the angle is scaled by {factor:.3g}, and torque constant, friction and inertia with it: check "
                "what its sensor counts")
    return (f"loads {factor:.2g} times as large as the logs say would explain {many}: check them, or search for one, "
            "such as load.inertia")


def _usable(one: Contradicted) -> bool:
    return min(one.file, one.logs) > 0.0 and all(math.isfinite(x) for x in (one.file_std, one.logs_std))


def _scale(known: Sequence[Contradicted], others: Sequence[Contradicted], powers: Mapping[str, float]) -> _Scale:
    """Return the factor by least squares of logarithms, and how far the worst number is off with it."""
    items = [*known, *others]
    power = np.array([powers.get(one.name, 0.0) for one in items])
    off = np.array([math.log(one.logs / one.file) for one in items])
    std = np.array([math.hypot(one.file_std / one.file, one.logs_std / one.logs) for one in items])
    std = np.maximum(std, 1e-6)
    x = float(np.sum(power * off / std**2) / np.sum(power**2 / std**2))
    return _Scale(math.exp(x), float(np.max(np.abs(off - power * x) / std)))
