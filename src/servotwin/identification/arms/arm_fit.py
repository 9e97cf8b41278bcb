"""What the fit of a robot found: servos, supply, links, zeros and latency, and how far it is from the real one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.numbers import Numbers
from servotwin.identification.arms.windows import LeftOut
from servotwin.identification.fitting.checks import checked_level
from servotwin.identification.fitting.fit import Interval
from servotwin.identification.fitting.registers import RegisterSearch
from servotwin.identification.fitting.uncertainty import Uncertainty
from servotwin.identification.fitting.words import Unidentifiable
from servotwin.parameters import Servo, Supply
from servotwin.robots import RobotValidation

Array = NDArray[np.float64]
BELIEFS = "by beliefs"
HALF = 0.5  # of what is known of a number


class ArmCause(NamedTuple):
    """What would explain more: its name, a sentence, by how much the cost of the first stage falls, its joints."""

    name: str
    sentence: str
    gain: float
    joints: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmFit:
    """The outcome of `identify` with a robot.

    Parameters
    ----------
    model : MjModel
        Of the robot, with the masses that were found.
    servos : mapping of str to Servo
        Fitted, by joint.
    supply : Supply, optional
        That all share.
    masses : mapping of str to float
        How many times as heavy as in the robot's file the links are.
    zeros : mapping of str to float
        By how much joints of the robot are ahead of what was measured [rad]
    latency : float
        Between the reading of positions and when the goal of the same row acts [s]
    names : tuple of str
    estimates : mapping of str to float
        Values of all names (SI); masses as factors.
    units : mapping of str to str
    unidentifiable : tuple of Unidentifiable
        What the episodes cannot tell apart, in words.
    at_bound : tuple of str
    training, before : RobotValidation
        Errors of the fitted robot and of that before the fit on the episodes that were fitted.
    holdout, before_holdout : RobotValidation, optional
        The same on episodes that were not; None where there was one only.
    noise : mapping of str to float
        Standard deviation of the positions of each joint [rad], and of the stamps, `clock` [s]
    left_out : tuple of LeftOut
    causes : tuple of ArmCause
        What would explain more, the best first.
    warnings : tuple of str
    prior_share : mapping of str to float
        How much of what is known of each number is belief, from 0 to 1. Empty without intervals.
    stages : mapping of str to float
        CPU seconds that each stage took.
    interrupted : bool
        Whether it was stopped before its end.
    unknown : tuple of str
        What is not known because of that.
    registers : RegisterSearch, optional
        Of bus servos of one family: what stands in registers that nobody recorded.
    """

    model: Any = field(repr=False)
    servos: Mapping[str, Servo]
    supply: Supply | None
    masses: Mapping[str, float]
    zeros: Mapping[str, float]
    latency: float
    names: tuple[str, ...]
    estimates: Mapping[str, float]
    units: Mapping[str, str]
    unidentifiable: tuple[Unidentifiable, ...]
    at_bound: tuple[str, ...]
    training: RobotValidation = field(repr=False)
    before: RobotValidation = field(repr=False)
    holdout: RobotValidation | None = field(repr=False)
    before_holdout: RobotValidation | None = field(repr=False)
    noise: Mapping[str, float]
    left_out: tuple[LeftOut, ...]
    causes: tuple[ArmCause, ...]
    warnings: tuple[str, ...]
    numbers: Numbers = field(repr=False)
    best: Array = field(repr=False)
    doubt: Uncertainty | None = field(repr=False)
    prior_share: Mapping[str, float] = field(default_factory=dict)
    stages: Mapping[str, float] = field(default_factory=dict)
    level: float = 0.95
    interrupted: bool = False
    unknown: tuple[str, ...] = ()
    registers: RegisterSearch | None = field(default=None, repr=False)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names that the episodes alone do not determine."""
        return tuple(dict.fromkeys(name for item in self.unidentifiable for name in item.parameters))

    def intervals(self, level: float | None = None) -> dict[str, Interval]:
        """Return the interval of every name (SI).

        Beliefs count in all of them: how far masses, servos and the supply may be off what files say. Their method is
        "normal" of what the episodes tell, "by beliefs" where most of it is belief, "at bound", or "not sought".

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        wanted = self.level if level is None else checked_level(level)
        return {name: self._interval(k, name, wanted) for k, name in enumerate(self.names)}

    def _interval(self, k: int, name: str, level: float) -> Interval:
        if self.doubt is None:
            return Interval(math.nan, math.nan, "not sought")
        if name in self.at_bound:
            return Interval(math.nan, math.nan, "at bound")
        doubt = self.doubt
        told = name not in self.undetermined and self.prior_share[name] < HALF
        reach = doubt.quantile(level, k) * float(doubt.std[k])
        ends = [self.numbers.value(k, float(np.clip(self.best[k] + side * reach, self.numbers.lower[k],
                                                    self.numbers.upper[k]))) for side in (-1.0, 1.0)]
        return Interval(ends[0], ends[1], "normal" if told else BELIEFS)

    @property
    def sentence(self) -> str:
        """How far the simulated robot is from the real one."""
        judged, before, where = (self.training, self.before, "fitted") if (
            self.holdout is None or self.before_holdout is None) else (self.holdout, self.before_holdout, "unseen")
        return (f"the simulated joints are {math.degrees(judged.rms()):.2f} deg rms off the measured ones on {where} "
                f"episodes, {math.degrees(before.rms()):.2f} deg before the fit")

    def __str__(self) -> str:
        """Return the sentence, causes, a line for each estimate, and what the episodes cannot say."""
        lines = []
        for name, (lower, upper, method) in self.intervals().items():
            spread = f"{lower:z.4g} to {upper:z.4g} ({method})" if lower == lower else method
            lines.append(f"{name} = {self.estimates[name]:z.4g} {self.units[name]}, {100 * self.level:g} %: {spread}")
        return "\n".join((self.sentence, *(cause.sentence for cause in self.causes), *lines,
                          *map(str, self.unidentifiable), *map(str, self.left_out), *self.warnings))

    def facts(self) -> dict[str, Any]:
        """Return all of it as plain numbers in SI units."""
        def told(found: RobotValidation | None) -> dict[str, Any] | None:
            return None if found is None else {
                "rms": found.rms(), "joints": {joint: kinds["all"].rms for joint, kinds in
                                               found.errors["servos"].items()}}

        return {
            "sentence": self.sentence, "latency": self.latency, "estimates": dict(self.estimates),
            "units": dict(self.units), "masses": dict(self.masses), "zeros": dict(self.zeros),
            "intervals": {name: {"lower": one.lower, "upper": one.upper, "method": one.method}
                          for name, one in self.intervals().items()},
            "supply": None if self.supply is None else {"open_circuit_voltage": self.supply.open_circuit_voltage,
                                                        "internal_resistance": self.supply.internal_resistance},
            "undetermined": [str(item) for item in self.unidentifiable], "at_bound": list(self.at_bound),
            "fitted": told(self.training), "unseen": told(self.holdout), "before": told(self.before),
            "before_unseen": told(self.before_holdout), "noise": dict(self.noise),
            "left_out": [window._asdict() for window in self.left_out],
            "causes": [cause._asdict() for cause in self.causes], "warnings": list(self.warnings),
            "interrupted": self.interrupted, "unknown": list(self.unknown),
            "registers": None if self.registers is None else self.registers.facts, "cpu_seconds": dict(self.stages)}

    def report(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write an HTML page.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        from servotwin.identification.report.arm_page import write_arm_report

        return write_arm_report(self, Path(path), overwrite=overwrite)
