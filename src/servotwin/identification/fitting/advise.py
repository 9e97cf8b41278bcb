"""Which experiment next: the one whose predicted log would narrow the widest interval most.

Every candidate is simulated with the servo as it is known now; what its log would say is its Fisher information, which
adds to that of the logs there are (Goodwin & Payne 1977). Nothing is guessed: a candidate that would not help shows it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.fit import Fit
from servotwin.identification.fitting.search.case import DELAY_SCALE, Point
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.free import Priors, Space, nominal
from servotwin.loads import Inertia, Load, Pendulum
from servotwin.logs.log import Log
from servotwin.models import Model
from servotwin.parameters import Servo

Array = NDArray[np.float64]

_DURATION, _STEP = 4.0, 0.02  # s, of a log that is tried, unless there are logs to go by
_ENCODER = 1e-3  # rad, noise of an angle, assumed where no log says it
_FURTHER = 0.01  # of its largest value: noise of a sensor that no log has, assumed
_TOLD = 1.1
_UNKNOWN = 20.0  # standard error of what nothing tells, scaled
_SENSORS = {"supply_current": "supply current", "armature_current": "motor current"}
_VOLTAGE = "supply.open_circuit_voltage"


@dataclass(frozen=True)
class Experiment:
    """A log that could be recorded next, and how surely the parameters would be known with it.

    Parameters
    ----------
    motion : str
        Commanded motion, in words.
    load : str
        Load on the shaft, in words.
    voltage : float
        Of the supply [V].
    sensors : tuple of str
        Signals that are measured.
    widths : mapping of str to float
        Predicted half width of each 95 % interval, relative to the value (or to a typical one where that is 0).
    alone : mapping of str to float
        The same of the logs alone, priors left out.
    command : Log
        The command itself, at its times.
    """

    motion: str
    load: str
    voltage: float
    sensors: tuple[str, ...]
    widths: Mapping[str, float]
    alone: Mapping[str, float]
    command: Log

    @property
    def widest(self) -> float:
        """The largest of the half widths."""
        return max(self.widths.values())

    def __str__(self) -> str:
        more = [_SENSORS[name] for name in self.sensors if name in _SENSORS]
        return f"{self.motion}, {self.load}, {self.voltage:.3g} V" + (f", with {' and '.join(more)}" if more else "")


@dataclass(frozen=True)
class Advice:
    """Experiments in the order of what they would bring.

    Parameters
    ----------
    now : mapping of str to float
        Half widths of the 95 % intervals as they are, as in `Experiment.widths`: logs and priors together.
    alone : mapping of str to float
        The same of the logs alone: what the priors say is left out.
    widest : str
        The parameter that is known worst.
    experiments : tuple of Experiment
        The best first: the smallest widest interval.
    """

    now: Mapping[str, float]
    alone: Mapping[str, float]
    widest: str
    experiments: tuple[Experiment, ...]

    def __str__(self) -> str:
        best, name = self.experiments[0], self.widest
        text = f"next: {best}; {name} from {_share(self.now[name])} to {_share(best.widths[name])}"
        # Where priors say more than a tenth of it, what the logs say is stated apart
        if self.alone[name] <= _TOLD * self.now[name] and best.alone[name] <= _TOLD * best.widths[name]:
            return text
        return f"{text}; by logs alone, without priors, from {_share(self.alone[name])} to {_share(best.alone[name])}"


def _share(width: float) -> str:
    return "undetermined" if width > 1.96 * _UNKNOWN / 2.0 else f"±{100.0 * width:.3g} %"


def advise(known: Fit | Servo, *, model: type[Model] | None = None, free: Sequence[str] | None = None,
           priors: Priors | str | None = "servo", logs: Sequence[Log] = (),
           sensors: Sequence[str] = ("supply_current",), voltages: Sequence[float] | None = None) -> Advice:
    """Say which experiment would narrow the widest interval most.

    Parameters
    ----------
    known : Fit or Servo
        A fit gives what its logs say already, and its settings; a servo is where to begin without any log.
    model, free, priors
        As of `identify`; of a servo alone.
    logs : sequence of Log
        Show range, step and frame period that are usual; those of the fit unless given.
    sensors : sequence of str
        Further signals that could be measured: "supply_current", "armature_current".
    voltages : sequence of float, optional
        Supply voltages that could be set [V]; the present one and 4/5 of it unless given.

    Raises
    ------
    InputError
        If a sensor or voltage makes no sense, or no candidate can be simulated.

    Examples
    --------
    >>> import servotwin as st
    >>> advice = advise(st.load_servo("hitec-hs-755hb"), free=["output_inertia"], priors=None, sensors=())
    >>> advice.widest, advice.experiments[0].widths["output_inertia"] < 0.1
    ('output_inertia', True)
    """
    start = _Known.of_fit(known, logs) if isinstance(known, Fit) else _Known.of_servo(known, model, free, priors, logs)
    for name in sensors:
        if name not in _SENSORS or name not in start.model.available:
            raise InputError("sensors", got=name, allowed=", ".join(n for n in _SENSORS if n in start.model.available))
    there = float(start.model.value(_VOLTAGE))
    levels = tuple(dict.fromkeys((there, 0.8 * there) if voltages is None else voltages))
    for level in levels:
        if not (isinstance(level, int | float) and math.isfinite(level) and level > 0.0):
            raise InputError("voltages", got=level, allowed="positive numbers [V]")
    tried = [(motion, text, level, _log(start, motion, command, load, level, tuple(sensors)))
             for (motion, command), (text, load), level in
             itertools.product(_motions(start).items(), _loads(start).items(), levels)]
    forecast = Forecast([log for *_, log in tried], start.model, start.space,
                        tuple(n for n in start.nuisance if n in ("delay", "angle_offset")), (start.sensor, *sensors))
    forecast.strict = False
    noise = dict(start.noise)
    experiments = []
    for (motion, text, level, log), k in zip(tried, range(len(tried)), strict=True):
        part = forecast.at(Point(start.shared, ((),) * len(tried)), cases=[k])[0]  # type: ignore[arg-type]
        if not np.isfinite(part.residual).all():
            continue
        size = len(log.time)
        for count in range(len(sensors) + 1):
            information = np.zeros_like(start.information)
            for at, name in enumerate((start.sensor, *sensors[:count])):
                rows = slice(at * size, (at + 1) * size)
                largest = float(np.abs(part.residual[rows]).max(initial=0.0))
                sigma = noise.get(name, _FURTHER * largest if name in _SENSORS else _ENCODER)
                slope = part.shared[rows] / max(sigma, 1e-12)
                information += slope.T @ slope
            experiments.append(Experiment(motion, text, level, (start.sensor, *sensors[:count]),
                                          start.widths(start.information + information),
                                          start.widths(start.of_logs + information), log))
    if not experiments:
        raise InputError("experiments", got="none that could be simulated to its end", allowed="another servo or load")
    now = start.widths(start.information)
    widest = max(now, key=lambda name: now[name])
    # Of experiments that bring the same, the one with the fewest sensors
    ranked = sorted(experiments, key=lambda e: (round(math.log(max(e.widest, 1e-9)), 1), len(e.sensors), e.widest))
    return Advice(now, start.widths(start.of_logs), widest, tuple(ranked))


@dataclass(frozen=True, eq=False)
class _Known:
    """Knowledge before the next experiment."""

    model: Model
    space: Space
    nuisance: tuple[str, ...]
    shared: Array
    information: Array  # of logs and priors
    of_logs: Array  # of logs alone
    scale: Array  # from a scaled number to a share of its value
    names: tuple[str, ...]
    noise: Mapping[str, float]
    sensor: str
    logs: tuple[Log, ...]

    @classmethod
    def of_fit(cls, fit: Fit, logs: Sequence[Log]) -> _Known:
        if fit.doubt is None:
            raise InputError("advise", got="a fit without intervals", allowed="one with intervals=True that was not "
                             "interrupted")
        sensor = "output_angle" if "output_angle" in fit.noise else "feedback_voltage"
        return cls(fit.model, fit.space, fit.names[len(fit.space):], fit.best, _information(fit),
                   _information(fit, alone=True), _scales(fit.space, fit.best), fit.names, fit.noise, sensor,
                   tuple(logs) or tuple(trace.log for trace in fit.traces))

    @classmethod
    def of_servo(cls, servo: Servo, kind: type[Model] | None, free: Sequence[str] | None, priors: Priors | str | None,
                 logs: Sequence[Log]) -> _Known:
        model = checks.checked_servo(servo, kind)
        space = Space(model, tuple(free) if free is not None else checks.usual_free(model), priors=priors)
        nuisance = ("delay", "angle_offset")
        shared = np.concatenate([space.start, [0.02 / DELAY_SCALE, 0.0]])
        beliefs = [p.scaled_prior for p in space.parameters]
        weight = np.array([*(1.0 / b[1] if b else 0.0 for b in beliefs), 0.0, 0.0])
        return cls(model, space, nuisance, shared, np.diag(weight**2), np.zeros((len(shared),) * 2),
                   _scales(space, shared), (*space.names, *nuisance), {}, "output_angle", tuple(logs))

    def widths(self, information: Array) -> dict[str, float]:
        """Return the half widths of the 95 % intervals of the searched parameters."""
        least = np.diag(np.full(len(information), 1.0 / _UNKNOWN**2))
        std = np.sqrt(np.diag(np.linalg.inv(information + least)))
        return {name: 1.96 * float(std[k] * self.scale[k]) for k, name in enumerate(self.space.names)}


def _information(fit: Fit, *, alone: bool = False) -> Array:
    """Return what logs and priors say, or logs alone, as surely as the intervals of a fit do."""
    dropped = {one.name for one in fit.yielded}
    weight = np.zeros(len(fit.names))
    for k, p in enumerate(fit.space.parameters):
        if p.scaled_prior is not None and p.name not in dropped and not alone:
            weight[k] = 1.0 / p.scaled_prior[1]
    doubt = fit.doubt
    if doubt is None:
        return np.diag(weight**2)
    covariance = doubt.alone if alone else doubt.covariance
    known = np.diag(covariance) > 0.0
    ratio = np.diag(doubt.curvature)[known] / np.diag(doubt.covariance)[known]
    information = doubt.information * float(np.median(ratio))
    if fit.allowed is not None and fit.unidentifiable:  # what rounding says of what is open is nothing
        closed = np.eye(len(weight)) - fit.allowed.open @ np.linalg.pinv(fit.allowed.open)
        information = closed @ information @ closed
    information = information + np.diag(weight**2)
    if not fit.unidentifiable:
        inner = np.ix_(known, known)
        information[inner] = np.linalg.inv(covariance[inner])
    return information


def _scales(space: Space, x: Array) -> Array:
    """Return by which share of a value, or of a typical one, it changes with its scaled number."""
    return np.array([1.0 if p.logarithmic else p.scale / max(abs(float(p.value(x[k]))), 0.2 * p.scale)
                     for k, p in enumerate(space.parameters)])


def _motions(known: _Known) -> dict[str, Array]:
    """Return commands [rad or s], about the middle of those that are usual."""
    time = _times(known)
    low, high = _range(known)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    rng = np.random.default_rng(0)
    bits = np.repeat(rng.choice([-1.0, 1.0], len(time) // 6 + 1), 6)[:len(time)]
    stairs = np.repeat(rng.permutation(np.linspace(-1.0, 1.0, 8)), len(time) // 8 + 1)[:len(time)]
    triangle = 2.0 / math.pi * np.arcsin(np.sin(2.0 * math.pi * time / (0.5 * time[-1])))
    chirp = np.sin(2.0 * math.pi * (0.3 + 0.35 * 3.0 * time / time[-1]) * time)
    shapes = {"large steps": stairs, "small steps": 0.1 * stairs, "slow triangle": triangle, "chirp": 0.5 * chirp,
              "fast random steps": 0.5 * bits}
    return {name: middle + half * shape for name, shape in shapes.items()}


def _range(known: _Known) -> tuple[float, float]:
    """Return the lowest and highest usual command [rad or s]."""
    if known.logs:
        return min(float(log.held.min()) for log in known.logs), max(float(log.held.max()) for log in known.logs)
    servo = known.model.servo
    low, high = servo.get("stops.lower_angle"), servo.get("stops.upper_angle")
    if isinstance(low, float) and isinstance(high, float):
        return 0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high
    return -0.5, 0.5


def _times(known: _Known) -> Array:
    step = float(np.median([np.median(np.diff(log.time)) for log in known.logs])) if known.logs else _STEP
    step = max(round(step, 9), 1e-3)
    # Whole nanoseconds, so that an edge of a frame is where a log writes it
    return np.round(np.arange(math.ceil(_DURATION / step)) * step, 9)


def _loads(known: _Known) -> dict[str, Load]:
    """Return loads that anyone can hang on a horn, and those of the logs."""
    own = float(nominal(known.model.servo, "output_inertia") or 1e-3)
    gain = float(nominal(known.model.servo, "output_torque_constant") or 1.0)
    stall = gain * known.model.value(_VOLTAGE) / known.model.value("motor.armature_resistance")
    mass = 0.2 * stall / (9.81 * 0.1)
    found = {"nothing on the horn": Load(), f"a disc of {own:.2g} kg m²": Load() + Inertia(own),
             f"{mass:.2g} kg on an arm of 0.1 m": Load() + Pendulum(mass=mass, length=0.1, hanging_angle=-math.pi / 2)}
    if known.logs and known.logs[0].load != Load():
        found = {"the load of the logs": known.logs[0].load, **found}
    return found


def _log(known: _Known, motion: str, command: Array, load: Load, voltage: float, sensors: tuple[str, ...]) -> Log:
    time = _times(known)
    first = known.logs[0] if known.logs else None
    parameters = dict(first.parameters) if first is not None else {}
    return Log(name=motion, time=time, command=command, command_kind=first.command_kind if first else "angle",
               measured={name: np.zeros(len(time)) for name in (known.sensor, *sensors)}, load=load, motion=motion,
               parameters={**parameters, _VOLTAGE: voltage})


