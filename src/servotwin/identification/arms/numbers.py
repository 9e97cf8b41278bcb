"""What is searched in the fit of a robot, each number on a scale of its own, and what it makes of servos and links."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.checks import usual_free
from servotwin.identification.fitting.free import Space
from servotwin.models import Model
from servotwin.parameters import Servo, Supply
from servotwin.robots import Mount
from servotwin.robots.unlike import differing, of_one_form

Array = NDArray[np.float64]

VOLTAGE, RESISTANCE, LATENCY, CLOCK = (
    "supply.open_circuit_voltage", "supply.internal_resistance", "latency", "clock")
GAIN = "firmware.proportional_gain"
QUANTUM, FINER = "firmware.angle_quantum", 64.0
ZERO_SCALE, LATENCY_SCALE, OHM_SCALE, CLOCK_SCALE = 0.02, 0.01, 0.1, 0.01  # rad, s, ohm, share
_ZERO_STD = 0.05  # rad: how far a horn may sit off
_VOLTAGE_STD = 0.03
_LEAST_STD, _ANY_STD = 0.1, 0.7  # of logarithms: of what a file says how far it may be off, and of all else
_MOTOR, _MOTOR_STD = ("motor.armature_resistance", "output_torque_constant"), 0.15  # that sheets tell fairly
_LATENCIES = (-0.03, 0.2)  # s
_CLOCKS = (-0.03, 0.15)  # share by which turns take longer than stamps say; believed to be within its scale
_GAINS, GAIN_STD = math.log(10.0), 1.5  # how far a gain may be off its register's, either way, and is believed to be
_MOST_ZERO, _MOST_OHMS, _USUAL_OHMS = 0.35, 2.0, 0.1  # rad, ohm: at most, and of wires that nobody has measured


class Number(NamedTuple):
    """One number of the fit.

    Parameters
    ----------
    name : str
    unit : str
    start, lower, upper : float
        On its scale.
    belief : float
        Standard deviation about the start, on its scale; inf: none.
    scale : float
        Value of 1 on its scale, or of exp(0) where it is logarithmic (SI).
    logarithmic : bool
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    belief: float
    scale: float
    logarithmic: bool

    def value(self, x: float) -> float:
        """Return the value (SI)."""
        return self.scale * math.exp(x) if self.logarithmic else self.scale * x


@dataclass(frozen=True, eq=False)
class Group:
    """Joints whose servos are equal but for registers."""

    name: str
    joints: tuple[int, ...]
    space: Space


class Numbers:
    """All numbers of the fit of a robot.

    Parameters
    ----------
    mounts : mapping of str to Mount
        By joint.
    links : sequence of str
        Names of the links whose masses are searched; none where they are known.
    bus : Supply, optional
        That all servos share.
    each : bool
        Whether every joint's servo is searched by itself; else one for all that are equal.
    masses : float
        How far the masses of the file may be off, as a share: standard deviation; bounds are three times as far.
    free : sequence of str, optional
        Of the servos; what angles can tell unless given.
    zeros : bool
        Whether the joints' zeros are searched.
    gains : sequence of str
        Joints whose servos' proportional gain may be other than their registers say.
    counted : bool
        Whether stamps count turns of a loop, and so do not say how long these took.
    """

    def __init__(self, mounts: Mapping[str, Mount], links: Sequence[str], bus: Supply | None, *, each: bool = False,
                 masses: float = 0.1, free: Sequence[str] | None = None, zeros: bool = True,
                 gains: Sequence[str] = (), counted: bool = False) -> None:
        alike = of_one_form([mount.model for mount in mounts.values()])
        self.mounts = {joint: Mount(model, mount.zero, mount.direction, mount.ratio)
                       for (joint, mount), model in zip(mounts.items(), alike, strict=True)}
        self.joints, self.bus = tuple(mounts), bus
        self.links = tuple(links)
        self.groups = self._groups(each, free)
        numbers: list[Number] = []
        self._at: dict[str, slice] = {}
        for group in self.groups:
            self._at[group.name] = slice(len(numbers), len(numbers) + len(group.space))
            numbers += self._of_servo(group)
        if bus is not None and bus.open_circuit_voltage is not None:
            volts = float(bus.open_circuit_voltage)
            numbers.append(Number(VOLTAGE, "V", 0.0, -0.4, 0.4, _VOLTAGE_STD, volts, True))
            ohms, most = (bus.internal_resistance or _USUAL_OHMS) / OHM_SCALE, _MOST_OHMS / OHM_SCALE
            numbers.append(Number(RESISTANCE, "ohm", ohms, 0.0, most, max(ohms, 1.0), OHM_SCALE, False))
        if masses > 0.0:
            numbers += [Number(f"mass.{link}", "1", 0.0, -3.0 * masses, 3.0 * masses, masses, 1.0, True)
                        for link in self.links]
        if zeros:
            numbers += [Number(f"zero.{joint}", "rad", 0.0, -_MOST_ZERO / ZERO_SCALE, _MOST_ZERO / ZERO_SCALE,
                               _ZERO_STD / ZERO_SCALE, ZERO_SCALE, False) for joint in self.joints]
        numbers += [Number(f"gain.{joint}", "1", 0.0, -_GAINS, _GAINS, GAIN_STD, 1.0, True) for joint in gains]
        numbers.append(Number(LATENCY, "s", 1.0, _LATENCIES[0] / LATENCY_SCALE, _LATENCIES[1] / LATENCY_SCALE, math.inf,
                              LATENCY_SCALE, False))
        if counted:
            numbers.append(Number(CLOCK, "1", 0.0, _CLOCKS[0] / CLOCK_SCALE, _CLOCKS[1] / CLOCK_SCALE, 1.0,
                                  CLOCK_SCALE, False))
        self.all = tuple(numbers)
        self.names = tuple(one.name for one in numbers)
        self.start = np.array([one.start for one in numbers])
        self.lower, self.upper = (np.array([getattr(one, side) for one in numbers]) for side in ("lower", "upper"))
        self.weight = np.array([1.0 / one.belief for one in numbers])

    def __len__(self) -> int:
        return len(self.all)

    def _groups(self, each: bool, free: Sequence[str] | None) -> tuple[Group, ...]:
        found: dict[str, list[int]] = {}
        for k, (joint, mount) in enumerate(self.mounts.items()):
            found.setdefault(joint if each else mount.model.servo.name, []).append(k)
        made = []
        for name, joints in found.items():
            model = self.mounts[self.joints[joints[0]]].model
            names = list(free) if free is not None else arm_free(model)
            made.append(Group(name, tuple(joints), Space(model, names, priors="servo")))
        return tuple(made)

    def _of_servo(self, group: Group) -> list[Number]:
        prefix = f"{group.name}: " if len(self.groups) > 1 else ""
        found = []
        for p in group.space.parameters:
            said = p.scaled_prior
            usual = _MOTOR_STD if p.name in _MOTOR else _ANY_STD
            std = max(said[1], _LEAST_STD) if said is not None and p.logarithmic else usual
            found.append(Number(prefix + p.name, p.unit, p.scaled(p.start), p.scaled(p.lower) if p.lower > 0.0
                                or not p.logarithmic else -20.0, p.scaled(p.upper),
                                std if p.logarithmic else 2.0, p.scale, p.logarithmic))
        return found

    # --- what a point means -------------------------------------------------------------------------------------------

    def _value(self, x: Array, name: str, otherwise: float) -> float:
        return self.all[self.names.index(name)].value(float(x[self.names.index(name)])) if name in self.names \
            else otherwise

    def latency(self, x: Array) -> float:
        """Return how much later goals act than positions of their row are read [s]."""
        return self._value(x, LATENCY, 0.0)

    def turn(self, x: Array) -> float:
        """Return how many times as long as stamped a turn of the loop takes."""
        return 1.0 + self._value(x, CLOCK, 0.0)

    def zeros(self, x: Array) -> Array:
        """Return by how much the joints of the robot are ahead of what is measured, shape (joints,) [rad]."""
        return np.array([self._value(x, f"zero.{joint}", 0.0) for joint in self.joints])

    def masses(self, x: Array) -> Array:
        """Return how many times as heavy as in the file the links are, shape (links,)."""
        return np.array([self._value(x, f"mass.{link}", 1.0) for link in self.links])

    def supply(self, x: Array) -> Supply | None:
        """Return the shared supply."""
        if self.bus is None:
            return None
        return Supply(open_circuit_voltage=self._value(x, VOLTAGE, 0.0) or self.bus.open_circuit_voltage,
                      internal_resistance=self._value(x, RESISTANCE, 0.0) or None,
                      current_limit=self.bus.current_limit)

    def servo(self, x: Array, joint: int) -> Servo:
        """Return the servo of a joint at a point."""
        group = next(one for one in self.groups if joint in one.joints)
        servo = self.mounts[self.joints[joint]].model.servo
        columns = group.space.columns(x[None, self._at[group.name]])
        values = {name: float(column[0]) for name, column in columns.items()}
        share = self._value(x, f"gain.{self.joints[joint]}", 1.0)
        if share != 1.0:
            values[GAIN] = share * float(servo.get(GAIN))  # type: ignore[arg-type]
        return servo.replace(values, source="where a search of a fit stands")

    def mounts_at(self, x: Array, *, fine: bool = False) -> dict[str, Mount]:
        """Return all servos at a point, as they sit at their joints; zeros are in the mounts, for servos count.

        Parameters
        ----------
        x : ndarray
        fine : bool
            With counts so fine that derivatives do not show them.
        """
        found = {}
        for k, (name, mount) in enumerate(self.mounts.items()):
            servo = self.servo(x, k)
            quantum = servo.get(QUANTUM)
            if fine and isinstance(quantum, float) and quantum > 0.0:
                servo = servo.replace({QUANTUM: quantum / FINER})
            found[name] = Mount(type(mount.model)(servo), mount.zero + float(self.zeros(x)[k]), mount.direction,
                                mount.ratio)
        return found

    def columns(self, x: Array) -> list[dict[str, Array]]:
        """Return the searched parameters of each joint's servo at points x, shape (copies, numbers)."""
        found: list[dict[str, Array]] = [{} for _ in self.joints]
        for group in self.groups:
            own = group.space.columns(x[:, self._at[group.name]])
            for joint in group.joints:
                found[joint] = dict(own)
        if VOLTAGE in self.names:
            volts = np.array([self._value(one, VOLTAGE, 0.0) for one in x])
            ohms = np.array([self._value(one, RESISTANCE, 0.0) for one in x])
            for one in found:
                one |= {VOLTAGE: volts, RESISTANCE: ohms}
        if any(name.startswith("gain.") for name in self.names):
            for name, mount, own in zip(self.joints, self.mounts.values(), found, strict=True):
                said = float(mount.model.servo.get(GAIN))  # type: ignore[arg-type]
                own[GAIN] = said * np.array([self._value(at, f"gain.{name}", 1.0) for at in x])
        return found

    def value(self, k: int, x: float) -> float:
        """Return the value of a number (SI)."""
        return self.all[k].value(x)


def arm_free(model: Model) -> list[str]:
    """Return what is searched of a servo in an arm: what angles tell of its plant, play and friction under load too."""
    more = [name for name in ("gear.backlash", "friction.load_friction", "friction.load_friction_motor",
                              "friction.load_friction_external") if model.servo.get(name)]
    return [*(name for name in usual_free(model) if not name.startswith("firmware.")), *more]


def model_columns(models: Sequence[Model], columns: Sequence[Mapping[str, Array]], copies: int, *,
                  fine: bool = False) -> dict[str, Any]:
    """Return parameters of lanes, copies by joints: what is searched, and what differs among the joints' servos.

    Parameters
    ----------
    models : sequence of Model
        Of the joints.
    columns : sequence of mapping
        Searched parameters of each joint, arrays (copies,).
    copies : int
    fine : bool
        With counts so fine that derivatives do not show them.
    """
    joints = [f"{k + 1}" for k in range(len(models))]
    searched = list(dict.fromkeys(name for one in columns for name in one))
    unlike = differing(models, joints)
    made: dict[str, Any] = {name: np.tile(np.array(unlike[name]), copies) for name in unlike if name not in searched}
    for name in searched:
        said = [np.full(copies, model.value_or(name, 0.0)) for model in models]
        made[name] = np.stack([one.get(name, said[k]) for k, one in enumerate(columns)], axis=1).ravel()
    counts = [model.value_or(QUANTUM, 0.0) for model in models]
    if fine and all(count > 0.0 for count in counts):
        made[QUANTUM] = np.tile(np.array(counts) / FINER, copies)
    return made
