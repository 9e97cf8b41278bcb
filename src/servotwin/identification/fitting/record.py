"""A fitted servo: its numbers with origin and spread, and the record of the fit in its file."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.free import LUMPED, Space
from servotwin.identification.logs.log import Log
from servotwin.parameters import Servo
from servotwin.parameters.output_side import N
from servotwin.parameters.quantity import Quantity
from servotwin.simulation.lane_loads import LOAD_NAMES

if TYPE_CHECKING:
    from servotwin.identification.fitting.fit import Fit
    from servotwin.identification.fitting.intervals import Ends
    from servotwin.identification.fitting.uncertainty import Uncertainty

Array = NDArray[np.float64]


def identified_servo(servo: Servo, space: Space, shared: Array, doubt: Uncertainty | None, ends: Mapping[int, Ends],
                     level: float) -> Servo:
    """Return a servo with the values of a point; their origin is "identified", their range the interval."""
    found = space.servo_at(shared[:len(space)])
    quantities = dict(found.quantities)
    for k, p in enumerate(space.parameters):
        if p.name in LOAD_NAMES:
            continue
        members, power, _ = LUMPED.get(p.name, ((p.name,), 0, ""))
        spread: tuple[float, float] | None = None
        if doubt is not None and k in ends:
            a, b = (float(np.clip(p.value(shared[k] + end * doubt.std[k]), p.lower, p.upper))
                    for end in (ends[k].lower, ends[k].upper))
            spread = min(a, b), max(a, b)
        factor = float(found.get(N) or 1.0) ** power  # type: ignore[arg-type]
        for member in members:
            value = found.get(member)
            given: dict[str, Any] = {}
            if spread is not None and isinstance(value, int | float) and math.isfinite(spread[0] + spread[1]):
                given = {"lower": min(spread[0] / factor, float(value)), "upper": max(spread[1] / factor, float(value))}
            said = f"{100 * level:g} % interval" if given else "not determined by the logs alone"
            if p.name in LUMPED:
                said = f"as {p.name}; {said}"
            quantities[member] = Quantity(value=value, unit=found.quantities[member].unit,  # type: ignore[arg-type]
                                          origin="identified", source=f"fit to logs, see [fit]; {said}", **given)
    return replace(found, quantities=quantities)


def with_what_logs_say(servo: Servo, logs: Sequence[Log], searched: Sequence[str]) -> Servo:
    """Return a servo with the parameters that all logs give alike, such as their supply voltage.

    Parameters
    ----------
    servo : Servo
    logs : sequence of Log
        Those that were fitted.
    searched : sequence of str
        What the fit found, which stays.
    """
    first, *others = logs
    stays = {member for name in searched for member in (LUMPED[name][0] if name in LUMPED else (name,))}
    alike = {name: value for name, value in first.parameters.items() if name not in stays
             and value != servo.get(name) and all(log.parameters.get(name) == value for log in others)}
    if not alike:
        return servo
    said = servo.replace(alike)
    quantities = {name: Quantity(value=float(value), unit=said.quantities[name].unit, origin="measured",
                                 source="said of all logs that were fitted, in their sidecars")
                  for name, value in alike.items()}
    return replace(said, quantities={**said.quantities, **quantities})


def data_hash(logs: Sequence[Log]) -> str:
    """Return a hash of all that logs say.

    Examples
    --------
    >>> log = Log(name="a", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0]})
    >>> data_hash([log]) == data_hash([log]), len(data_hash([log]))
    (True, 64)
    """
    digest = hashlib.sha256()
    for log in logs:
        digest.update(repr((log.name, log.command_kind, log.command_hold, sorted(log.parameters.items()), log.left_out,
                            log.load)).encode())
        digest.update(np.ascontiguousarray(log.time).tobytes())
        digest.update(np.ascontiguousarray(log.command).tobytes())
        for name in sorted(log.measured):
            digest.update(name.encode() + np.ascontiguousarray(log.measured[name]).tobytes())
        if log.torque_on is not None:
            digest.update(np.packbits(log.torque_on).tobytes())
    return digest.hexdigest()


def with_record(fit: Fit, logs: Sequence[Log], fitted: Sequence[int]) -> Fit:
    """Return a fit whose servo holds the record: data, model, version, bounds, errors, conditions."""
    import servotwin

    motions = Counter(log.motion or "other" for log in logs)
    record: dict[str, Any] = {
        "data": f"sha256:{data_hash(logs)}", "logs": len(logs), "fitted_logs": len(fitted),
        "model": type(fit.model).__name__, "version": servotwin.__version__, "level": fit.level,
        "free": list(fit.space.names),
        "bounds": {p.name: [p.lower, p.upper] for p in fit.space.parameters},
        "at_bound": list(fit.at_bound), "undetermined": [str(item) for item in fit.unidentifiable],
        "nuisance": {name: fit.estimates[name] for name in fit.names if name not in fit.space.names},
        "load": {p.name: fit.estimates[p.name] for p in fit.space.parameters if p.name in LOAD_NAMES},
        "noise": dict(fit.noise),
        "conditions": {"motions": dict(motions), **_conditions(logs)},
        "training_error": fit.training.by().copy() if fit.training else {},
        "holdout_error": fit.holdout.by().copy() if fit.holdout else {},
    }
    if fit.interrupted:
        record["interrupted"] = True
    servo = replace(fit.servo, fit={key: value for key, value in record.items() if value not in ({}, [])})
    return replace(fit, servo=servo, model=type(fit.model)(servo))


def _conditions(logs: Sequence[Log]) -> dict[str, Any]:
    """Return labels and parameters of the logs: one value, or all that there are."""
    gathered: dict[str, dict[Any, None]] = {}
    for log in logs:
        for name, value in (*log.conditions.items(), *log.parameters.items()):
            gathered.setdefault(name, {})[value] = None
    return {name: next(iter(values)) if len(values) == 1 else list(values)
            for name, values in gathered.items() if len(values) <= 8}
