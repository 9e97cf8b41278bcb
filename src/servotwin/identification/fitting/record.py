"""A fitted servo: its numbers with origin and spread, and the record of the fit in its file."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.fit import LEAST_SHARE
from servotwin.identification.fitting.free import LUMPED, FreeParameter, Space
from servotwin.logs.log import Log
from servotwin.parameters import Servo
from servotwin.parameters.servo import N, Quantity
from servotwin.simulation.lanes.inputs import LOAD_NAMES

if TYPE_CHECKING:
    from servotwin.identification.fitting.fit import Fit
    from servotwin.identification.fitting.yielding import Doubts

Array = NDArray[np.float64]

_MOVED = "this value goes with the others of a fit, whose logs do not determine it, see [fit]"


def identified_servo(servo: Servo, space: Space, shared: Array, doubts: Doubts, level: float,
                     yielded: Sequence[str] = ()) -> Servo:
    """Return a servo with the values of a point.

    What the logs determine is "identified", and its range is the interval. What they leave open keeps its origin, its
    source and its spread; its value is the one that goes with the others.

    Parameters
    ----------
    servo : Servo
        Before the fit.
    space : Space
    shared : ndarray, shape (p,)
    doubts : Doubts
    level : float
        Of the intervals.
    yielded : sequence of str
        Names whose prior was dropped: what the file said of them does not hold, and is not kept.
    """
    found = space.servo_at(shared[:len(space)])
    quantities = dict(found.quantities)
    open_ = {name for item in doubts.unidentifiable for name in item.parameters}
    for k, p in enumerate(space.parameters):
        if p.name in LOAD_NAMES:
            continue
        members, power, _ = LUMPED.get(p.name, ((p.name,), 0, ""))
        factor = float(found.get(N) or 1.0) ** power  # type: ignore[arg-type]
        spread = _spread(p, k, shared, doubts, factor)
        for member in members:
            value, unit = float(found.get(member)), found.quantities[member].unit  # type: ignore[arg-type]
            if p.name in open_ and p.name not in yielded:
                quantities[member] = _kept(servo.quantities.get(member), value, unit)
                continue
            given = {"lower": min(spread[0], value), "upper": max(spread[1], value)} if spread else {}
            said = f"{100 * level:g} % interval" if given else _unsure(doubts, p.name in open_)
            if p.name in LUMPED:
                said = f"as {p.name}; {said}"
            quantities[member] = Quantity(value=value, unit=unit, origin="identified",
                                          source=f"fit to logs, see [fit]; {said}", **given)
    return replace(found, quantities=quantities)


def _unsure(doubts: Doubts, left_open: bool) -> str:
    """Return why a value that a fit found has no range."""
    if left_open:
        return "the logs alone do not determine it, and contradict what the file said of it"
    if any(each.method == "linearised" for each in doubts.ends.values()):
        return "the fit was stopped before it was determined"
    return "no interval was sought" if doubts.doubt is None else "ended at a bound of the search"


def _spread(p: FreeParameter, k: int, shared: Array, doubts: Doubts, factor: float) -> tuple[float, float] | None:
    """Return the interval of a number's members; None where it has none."""
    if doubts.doubt is None or k not in doubts.ends:
        return None
    ends, std = doubts.ends[k], float(doubts.doubt.std[k])
    a, b = (float(np.clip(p.value(shared[k] + end * std), p.lower, p.upper)) / factor
            for end in (ends.lower, ends.upper))
    return (min(a, b), max(a, b)) if math.isfinite(a + b) else None


def _kept(before: Quantity | None, value: float, unit: str) -> Quantity:
    """Return what was known of a number that a fit did not determine, with the value that goes with the others."""
    if before is None:
        return Quantity(value=value, unit=unit, origin="assumed", source=f"no source; {_MOVED}")
    if not isinstance(before.value, float) or before.value == value:
        return before
    said = (before.source or "no source").removesuffix(f"; {_MOVED}")
    lower = None if before.lower is None else min(before.lower, value)
    upper = None if before.upper is None else max(before.upper, value)
    return replace(before, value=value, source=f"{said}; {_MOVED}", lower=lower, upper=upper)


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


def with_record(fit: Fit, logs: Sequence[Log], fitted: Sequence[int], mend: Sequence[str] = ()) -> Fit:
    """Return a fit whose servo holds the record: data, model, version, bounds, errors, conditions.

    Parameters
    ----------
    fit : Fit
    logs : sequence of Log
        As they were given.
    fitted : sequence of int
        Which of them were fitted.
    mend : sequence of str
        Kinds of findings that were mended in them.
    """
    import servotwin

    motions = Counter(log.motion or "other" for log in logs)
    record: dict[str, Any] = {
        "data": f"sha256:{data_hash(logs)}", "logs": len(logs), "fitted_logs": len(fitted),
        "model": type(fit.model).__name__, "version": servotwin.__version__, "level": fit.level,
        "free": list(fit.space.names),
        "bounds": {p.name: [p.lower, p.upper] for p in fit.space.parameters},
        "at_bound": list(fit.at_bound), "undetermined": [str(item) for item in fit.unidentifiable],
        "yielded": [str(one) for one in fit.yielded], "widened": [str(one) for one in fit.widened],
        "prior_share": {name: round(share, 3) for name, share in fit.prior_share.items() if share >= LEAST_SHARE},
        "nuisance": {name: fit.estimates[name] for name in fit.names if name not in fit.space.names},
        "load": {p.name: fit.estimates[p.name] for p in fit.space.parameters if p.name in LOAD_NAMES},
        "noise": dict(fit.noise),
        "mended": list(mend),
        "conditions": {"motions": dict(motions), **_conditions(logs)},
        "training_error": fit.training.by().copy() if fit.training else {},
        "holdout_error": fit.holdout.by().copy() if fit.holdout else {},
    }
    if fit.phased:
        record["frame_phase"] = "of each log"
    if fit.ticked:
        record["control_phase"] = "of each log"
    if fit.verdict is not None:
        record["verdict"] = {"sentence": fit.verdict.sentence, "holds": fit.verdict.holds, "ratio": fit.verdict.ratio,
                             "causes": [cause.name for cause in fit.verdict.causes]}
    if fit.interrupted:
        record |= {"interrupted": True, "unknown": list(fit.unknown)}
    servo = replace(fit.servo, fit={key: value for key, value in record.items() if value not in ({}, [])})
    return replace(fit, servo=servo, model=type(fit.model)(servo))


def stopped(fit: Fit, missing: Sequence[str]) -> Fit:
    """Return a fit that a stop has left without something, and that says so."""
    if not missing:
        return fit
    said = f"stopped: the best so far; not known are {', '.join(missing)}"
    return replace(fit, interrupted=True, unknown=tuple(missing), warnings=(said, *fit.warnings))


def _conditions(logs: Sequence[Log]) -> dict[str, Any]:
    """Return labels and parameters of the logs: one value, or all that there are."""
    gathered: dict[str, dict[Any, None]] = {}
    for log in logs:
        for name, value in (*log.conditions.items(), *log.parameters.items()):
            gathered.setdefault(name, {})[value] = None
    return {name: next(iter(values)) if len(values) == 1 else list(values)
            for name, values in gathered.items() if len(values) <= 8}
