"""Errors on logs that a fit has not seen, by kind of motion, load and condition, beside simpler models."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.log import Log

_FEW = 4  # logs of one kind, below which none of it is held out


@dataclass(frozen=True)
class LogError:
    """How far a model is off one log.

    Parameters
    ----------
    log, motion : str
    conditions : mapping
        Labels of the log; its supply voltage and load included.
    rms, largest : float
        Of simulated less measured [rad], or [V] where the log has no angle.
    samples : int
    spread : float
        Rms of what was measured about its mean, in the same unit; nan where it is not known.
    """

    log: str
    motion: str
    conditions: Mapping[str, float | str]
    rms: float
    largest: float
    samples: int
    spread: float = math.nan

    @property
    def fit_percent(self) -> float:
        """How much of the measured motion is reproduced: 100 all, 0 no more than by its mean."""
        return fit_percent([self])


@dataclass(frozen=True)
class ErrorTable:
    """Errors of several models on the same logs.

    Parameters
    ----------
    models : tuple of str
    errors : mapping of str to tuple of LogError
        Of each model, log by log.

    Examples
    --------
    >>> error = LogError("a", "step", {"gain": 100.0}, 0.03, 0.05, 10)
    >>> table = ErrorTable(("M1",), {"M1": (error,)})
    >>> table.by("motion"), table.by("gain")
    ({'step': {'M1': 0.03}}, {'100': {'M1': 0.03}})
    """

    models: tuple[str, ...]
    errors: Mapping[str, tuple[LogError, ...]]

    def __bool__(self) -> bool:
        return bool(self.models) and bool(self.errors[self.models[0]])

    @property
    def logs(self) -> tuple[str, ...]:
        """Names of the logs."""
        return tuple(error.log for error in self.errors[self.models[0]]) if self.models else ()

    def labels(self) -> tuple[str, ...]:
        """Return by what the errors can be sorted: "motion", and every condition of which there are several values."""
        first = self.errors[self.models[0]] if self.models else ()
        names = dict.fromkeys(name for error in first for name in error.conditions)
        return ("motion", *(name for name in names if len({_text(e.conditions.get(name)) for e in first}) > 1))

    def by(self, label: str = "motion",
           measure: Callable[[Iterable[LogError]], float] | None = None) -> dict[str, dict[str, float]]:
        """Return the rms error over all samples of each value of a label, or another measure, for each model."""
        measure, found = measure or pooled, dict[str, dict[str, float]]()
        for model in self.models:
            groups: dict[str, list[LogError]] = {}
            for error in self.errors[model]:
                value = error.motion if label == "motion" else _text(error.conditions.get(label))
                groups.setdefault(value or "other", []).append(error)
            for value, group in groups.items():
                found.setdefault(value, {})[model] = measure(group)
        return found

    def total(self, measure: Callable[[Iterable[LogError]], float] | None = None) -> dict[str, float]:
        """Return the rms error over all samples, or another measure, for each model."""
        return {model: (measure or pooled)(self.errors[model]) for model in self.models}


def pooled(errors: Iterable[LogError]) -> float:
    """Return the rms over all samples of some logs.

    Examples
    --------
    >>> pooled([LogError("a", "", {}, 3.0, 3.0, 1), LogError("b", "", {}, 4.0, 4.0, 1)])
    3.5355339059327378
    """
    items = [e for e in errors if e.samples]
    total = sum(e.samples for e in items)
    return math.sqrt(sum(e.rms**2 * e.samples for e in items) / total) if total else math.nan


def fit_percent(errors: Iterable[LogError]) -> float:
    """Return how much of the measured motion of some logs is reproduced: 100 (1 − |y − ŷ|/|y − ȳ|), ȳ of each log.

    100 is all, 0 no more than by the mean of each log, and less than 0 is worse; nan of a shaft that stands. It is the
    "fit" of the System Identification Toolbox (Ljung).

    Examples
    --------
    >>> fit_percent([LogError("a", "", {}, 1.0, 3.0, 100, 10.0), LogError("b", "", {}, 3.0, 4.0, 100, 10.0)])
    77.63932022500211
    """
    items = [e for e in errors if e.samples]
    spread = math.sqrt(sum(e.spread**2 * e.samples for e in items))
    return 100.0 * (1.0 - math.sqrt(sum(e.rms**2 * e.samples for e in items)) / spread) if spread > 0.0 else math.nan


def log_error(log: Log, difference: NDArray[np.float64], measured: NDArray[np.float64] | None = None) -> LogError:
    """Return the error of one log from the differences at its samples that count, and what was measured there."""
    conditions: dict[str, float | str] = dict(log.conditions)
    voltage = log.parameters.get("supply.open_circuit_voltage")
    if voltage is not None and "voltage" not in conditions:
        conditions["voltage"] = voltage
    if "load" not in conditions:
        conditions["load"] = _load(log)
    return LogError(log.name, log.motion, conditions, float(np.sqrt(np.mean(difference**2))),
                    float(np.abs(difference).max()), len(difference),
                    math.nan if measured is None else float(np.std(measured)))


def split(logs: Sequence[Log], holdout: Any, seed: int) -> tuple[list[int], list[int]]:
    """Return which logs are fitted and which held out.

    Parameters
    ----------
    logs : sequence of Log
    holdout : None, float or sequence of str
        None holds out a fourth of the logs of each kind of motion of which there are at least four; a fraction as many
        of each kind; names exactly these; 0 none.
    seed : int

    Raises
    ------
    InputError
        If there is no such log, or none would be left.
    """
    rng = np.random.default_rng(seed)
    if isinstance(holdout, Sequence) and not isinstance(holdout, str):
        names = [log.name for log in logs]
        for name in holdout:
            if name not in names:
                raise InputError("holdout", got=name, allowed=", ".join(names))
        out = [k for k, name in enumerate(names) if name in set(holdout)]
    else:
        share = 0.25 if holdout is None else holdout
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0.0 <= share < 1.0:
            raise InputError("holdout", got=holdout, allowed="a share of the logs below 1, or names of logs")
        kinds: dict[str, list[int]] = {}
        for k, log in enumerate(logs):
            kinds.setdefault(log.motion, []).append(k)
        out = []
        for members in kinds.values():
            if holdout is None and len(members) < _FEW:
                continue
            count = min(math.floor(share * len(members) + 0.5), len(members) - 1)
            out += rng.permutation(members)[:count].tolist() if count > 0 else []
    if len(out) == len(logs):
        raise InputError("holdout", got="all logs", allowed="some of them; the rest is fitted")
    return sorted(set(range(len(logs))) - set(out)), sorted(out)


def _load(log: Log) -> str:
    load = log.load
    parts = [f"{load.total_inertia:.3g} kg m²"] if load.total_inertia else []
    parts += [f"{p.mass * p.length * p.gravity:.3g} N m pendulum" for p in load.pendulums]
    if load.torque:
        parts.append(f"{load.torque:.3g} N m")
    return ", ".join(parts) or "none"


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, int | float) else str(value)
