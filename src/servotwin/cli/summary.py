"""What a simulation is summed up to: one set of facts (SI), shown as a table or as JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from servotwin import units
from servotwin.cli.rest_words import remedy_words, rest_words
from servotwin.cli.span_words import with_span
from servotwin.datasheet.rotor import slow_rotor
from servotwin.errors import InputError
from servotwin.models import MODELS
from servotwin.simulation.remarks import Remark
from servotwin.simulation.rest import Rest

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters.quantity import Quantity
    from servotwin.simulation import Result
    from servotwin.simulation.remarks import Sag

NONE = "-"
_LAST = 0.5  # s, or half of a shorter run: over which the speed of a servo that turns endlessly is meant
_ENERGY = ("winding", "bridge", "brush", "conversion", "friction", "stops", "load", "stored")


def facts(result: Result) -> dict[str, Any]:
    """Return what is worth knowing of a result, in SI, ready for JSON.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> found = facts(st.simulate(model, st.signals.step(0.0, 90.0, at=0.1, unit="deg"), duration=1.0))
    >>> found["model"], found["status"], 1.5 < found["final_angle"] < 1.6
    ('bounded', 'COMPLETED', True)
    """
    metrics = None
    try:
        metrics = result.step_metrics()
    except InputError:
        pass  # no step
    angle = result.model.layout[0]
    return {
        "servo": result.model.servo.name,
        "title": result.model.servo.title,
        "model": model_name(result.model),
        "status": result.status.name,
        "duration": float(result.time[-1]),
        "angle": angle,
        "final_angle": float(result.at(angle, [result.time[-1]])[0]),
        "step_metrics": None if metrics is None else dataclasses.asdict(metrics),
        "time_to_target": math.nan if metrics is None else metrics.arrival_time,
        "holding_error": result.holding_error,
        "rest": None if result.rest is None else result.rest._asdict(),
        **({"mean_speed": result.mean("output_speed", result.ended - min(_LAST, 0.5 * result.ended))}
           if result.model.endless else {}),
        "mean_current": result.mean_current,
        "peak_current": result.peak("armature_current") if metrics is None else metrics.peak_current,
        "supply": None if result.sag is None else supply_facts(result.sag),
        "energy": dataclasses.asdict(result.energy),
        "remarks": [remark.facts for remark in result.remarks],
        "solution": dataclasses.asdict(result.stats),
        "flags": [slow] if (slow := slow_rotor(result.model.servo)) is not None else [],
        "set": was_set(result.model),
        "assumed": assumed(result.model),
        "ignored": list(result.model.ignored),
    }


def supply_facts(sag: Sag) -> dict[str, float | None]:
    """Return how far a supply fell, in SI, ready for JSON; no limit of current is null."""
    return sag._asdict() | {"limit": sag.limit if math.isfinite(sag.limit) else None}


def supply_row(sag: Mapping[str, Any]) -> tuple[str, str]:
    """Return the same as label and text.

    Examples
    --------
    >>> supply_row({"voltage": 1.75, "time": 0.1234, "low": 0.8, "limited": 0.8, "limit": 0.2})
    ('supply', '1.75 V at least, at 0.123 s')
    """
    return "supply", f"{sag['voltage']:.2f} V at least, at {sag['time']:.3g} s"


def figures(found: Mapping[str, Any]) -> dict[str, float]:
    """Return those of the facts that may rest on guesses, by name."""
    names = ("final_angle", "time_to_target", "holding_error", "mean_speed", "mean_current", "peak_current")
    metrics = found["step_metrics"] or {}
    return {name: found[name] for name in names if name in found} | {
        name: metrics[name] for name in ("rise_time", "settling_time", "overshoot", "slew_rate") if name in metrics}


def model_name(model: Model) -> str:
    """Return the name that `--model` has for a model."""
    return next(name for name, kind in MODELS.items() if kind is type(model))


def assumed(model: Model) -> list[str]:
    """Return the dotted names that a model reads and nobody measured or set."""
    return [name for name, known in _read(model).items() if known.origin == "assumed" and not known.was_set]


def was_set(model: Model) -> list[str]:
    """Return the dotted names that a model reads and the user set.

    Examples
    --------
    >>> import servotwin as st
    >>> was_set(st.PulseServo(st.load_servo("hitec-hs-755hb").replace({"supply.open_circuit_voltage": 5.0})))
    ['supply.open_circuit_voltage']
    """
    return [name for name, known in _read(model).items() if known.was_set]


def _read(model: Model) -> dict[str, Quantity]:
    servo = model.servo
    read = dict.fromkeys((*model.requires, *model.optional))
    return {name: servo.source(name) for name in read if servo.get(name) is not None}


def lines(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the facts as pairs of label and text, in the units of people.

    Examples
    --------
    >>> energy = {"supply": 2.0, "winding": 1.5, "friction": 0.5}
    >>> lines({"final_angle": 3.14159265, "mean_current": 0.2, "peak_current": 1.8, "energy": energy})[:2]
    [('final angle', '180.00 deg'), ('current', '0.200 A in the mean, 1.800 A at most')]
    """
    rows = [(label, found[key]) for key, label in (("command", "command"), ("load", "load")) if key in found]
    ranges = found.get("ranges", {})

    def shown(name: str, value: float, form: str, unit: str, dimension: str, note: str = "") -> str:
        by = units.to_si(1.0, unit, dimension)
        return with_span(value / by, ranges.get(name), form, unit, scale=1.0 / by, note=note)

    rows.append((_angle_label(found), shown("final_angle", found["final_angle"], ".2f", "deg", "angle")))
    if "mean_speed" in found:
        rows.append(("speed", f"{shown('mean_speed', found['mean_speed'], '.1f', 'rpm', 'speed')} in the mean of the "
                              "end"))
    rows += _arrival_rows(found, shown)
    rows += _step_rows(found.get("step_metrics"), shown)
    rows += _rest_rows(found)
    mean, most = (shown(name, found[name], ".3f", "A", "current") for name in ("mean_current", "peak_current"))
    rows.append(("current", f"{mean} in the mean, {most} at most"))
    rows += [supply_row(found["supply"])] if found.get("supply") else []
    energy = found["energy"]
    parts = [f"{name} {energy[name]:.4g} J" for name in _ENERGY if abs(energy.get(name, 0.0)) > 1e-9]
    rows.append(("energy", f"{energy['supply']:z.4g} J supplied: {', '.join(parts) or 'nothing moved'}"))
    return rows


def origin_lines(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return how the solution was found, and which of its parameters nobody measured."""
    solution = found["solution"]
    return [
        ("status", f"{found['status'].lower()}, {found['duration']:g} s simulated"),
        *(("remark", Remark(**remark).words) for remark in found["remarks"]),
        *(("flag", flag) for flag in found.get("flags", ())),
        ("solved", f"{solution['method']}, {solution['motions']} motions, {solution['events']} events"),
        *([("set", names(found["set"]))] if found["set"] else []),
        *([("ranges", f"with {', '.join(found['guessed'])} at the ends of theirs")]
          if found.get("ranges") else []),
        ("assumed", names(found["assumed"])),
        ("ignored", names(found["ignored"])),
    ]


def names(dotted: Sequence[str]) -> str:
    """Return dotted names, sorted by group, in words.

    Examples
    --------
    >>> names(["motor.rotor_inertia", "gear.gear_reduction", "motor.torque_constant"])
    '3: motor (rotor_inertia, torque_constant), gear (gear_reduction)'
    """
    groups: dict[str, list[str]] = {}
    for name in dotted:
        group, _, key = name.partition(".")
        groups.setdefault(group, []).append(key)
    words = ", ".join(f"{group} ({', '.join(keys)})" for group, keys in groups.items())
    return f"{len(dotted)}: {words}" if dotted else "none"


def _angle_label(found: Mapping[str, Any]) -> str:
    return "final motor angle" if found.get("angle") == "motor_angle" else "final angle"


def _arrival_rows(found: Mapping[str, Any], shown: Callable[..., str]) -> list[tuple[str, str]]:
    """Return when a servo gets to where a step sends it, and how far off it stands in the end."""
    metrics, rows = found.get("step_metrics"), []
    if metrics is not None and not math.isnan(metrics["target"]):
        arrived, near = found["time_to_target"], f"within {_deg(metrics['arrival_band']):.2g} deg"
        rows.append(("time to get there", f"does not get {near}" if math.isnan(arrived) else
                     shown("time_to_target", arrived, ".1f", "ms", "time", near)))
    error = found.get("holding_error", math.nan)
    return rows if math.isnan(error) else [
        *rows, ("holding error", shown("holding_error", error, ".2f", "deg", "angle"))]


_STEP_ROWS = (("rise_time", "rise time", ".1f", "ms", "time", "10 to 90 %"),
              ("settling_time", "settling time", ".1f", "ms", "time", "2 %"),
              ("overshoot", "overshoot", ".2f", "%", "number", ""))


def _step_rows(metrics: Mapping[str, float] | None, shown: Callable[..., str]) -> list[tuple[str, str]]:
    if metrics is None:
        return []
    rows = [(label, NONE if math.isnan(metrics[name]) else shown(name, metrics[name], form, unit, dimension, note))
            for name, label, form, unit, dimension, note in _STEP_ROWS]
    return [*rows, ("peak speed", shown("slew_rate", metrics["slew_rate"], ".1f", "deg/s", "speed"))]


def _rest_rows(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return how the bridge drives where nothing changes any more, and what would stop it; nothing of a quiet servo."""
    from servotwin.datasheet import Remedy

    rest = None if found.get("rest") is None else Rest(**found["rest"])
    if rest is None or not rest.duty > 0.0 or rest.moves_on:
        return []
    rows = [("at rest" if rest.stands else "at the end", rest_words(rest))]
    stops = remedy_words(tuple(Remedy(**each) for each in found.get("remedies", ())))
    return [*rows, *([("would stop it", stops)] if stops else [])]


def _deg(angle: float) -> float:
    return units.from_si(angle, "deg", "angle")
