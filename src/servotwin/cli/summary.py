"""The summary of a simulation: one set of facts (SI), shown as a table or as JSON."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from servotwin import plotting, units
from servotwin.cli.terminal import pairs, table, with_span
from servotwin.datasheet.turning import slow_rotor
from servotwin.errors import InputError, MissingParameterError, ServotwinError
from servotwin.loads import as_load
from servotwin.models import MODELS, DigitalServo, default_model
from servotwin.models.engine.dynamics.currents import stall_current
from servotwin.models.terms.duty import at_duty
from servotwin.parameters import printed_flags, printed_points
from servotwin.physics import stall_torque
from servotwin.simulation.remarks import Remark, drive_words, swing_words, words
from servotwin.simulation.rest import Rest
from servotwin.studies import dimension_of

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.datasheet import Buzz, Remedy
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.parameters.servo import Quantity
    from servotwin.simulation import Result
    from servotwin.simulation.remarks import Sag
    from servotwin.studies import Study


# --- How a servo drives at rest, and what would stop it, as rows of text and as facts for JSON ------------------------

_NUMBERS = {
    "firmware.deadband_angle": ("a dead zone of {} either way", math.degrees(1.0), "deg"),
    "electronics.deadband": ("a deadband of {}", 1e6, "us"),
    "electronics.voltage_deadband": ("a deadband of {}", 1e3, "mV"),
    "load.coulomb_torque": ("friction of {} more at the shaft", 1e3, "mN m"),
    "firmware.proportional_gain": ("a proportional gain of {}", 1.0, "1/rad"),
    "electronics.stretcher_gain": ("a stretcher gain of {}", 1.0, ""),
    "electronics.bridge_gain": ("a bridge gain of {}", 1.0, ""),
}


def rest_words(rest: Rest | None) -> str:
    """Return what a servo does at rest, as people read it; nothing where that is not known.

    Examples
    --------
    >>> import servotwin as st
    >>> rest_words(st.datasheet.buzz(st.PulseServo(st.load_servo("hitec-hs-755hb"))).rest)
    'drives 50 times a second, duty 0.6 %, 0.011 A in the mean, less and less'
    """
    if rest is None or rest.moves_on:
        return ""
    if rest.swing > 0.0:
        return f"{swing_words(rest.swing, rest.frequency)}; {drive_words(rest.drive_rate, rest.duty, rest.current)}"
    if not rest.duty > 0.0:
        return "does not drive" if rest.duty == 0.0 else f"{rest.current:.3f} A in the mean"
    fades = ", less and less" if rest.fades else ""
    return drive_words(rest.drive_rate, rest.duty, rest.current) + fades


def remedy_words(remedies: tuple[Remedy, ...]) -> str:
    """Return what would bring a servo to rest, each by itself.

    Examples
    --------
    >>> from servotwin.datasheet import Remedy
    >>> remedy_words((Remedy("electronics.deadband", 4e-6, 9e-6), Remedy("load.coulomb_torque", 0.0, 2e-3)))
    'a deadband of 9 us instead of 4, or friction of 2 mN m more at the shaft'
    """
    return ", or ".join(map(_remedy, remedies))


def _remedy(remedy: Remedy) -> str:
    form, factor, unit = _NUMBERS[remedy.name]
    said = form.format(f"{factor * remedy.needed:.3g} {unit}".strip())
    return said if remedy.now == 0.0 else f"{said} instead of {factor * remedy.now:.3g}"


def buzz_facts(found: Buzz) -> dict[str, Any]:
    """Return the same in SI, ready for JSON."""
    return {"rest": None if found.rest is None else found.rest._asdict(),
            "remedies": [remedy._asdict() for remedy in found.remedies]}


# --- Facts of the catalog commands on a servo, ready for JSON ---------------------------------------------------------

def headline(servo: Servo) -> dict[str, Any]:
    """Return id, title, kind, supply voltage [V], stall torque [N m] and speed [deg/s] of its data sheet, and flags.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> headline(load_servo("hitec-hs-755hb"))["title"]
    'Hitec HS-755HB'
    """
    printed = printed_points(servo)[0]
    return {
        "id": servo.name, "title": servo.title, "kind": servo.kind,
        "supply_voltage": printed.supply_voltage,
        "stall_torque": printed.stall_torque,
        "twin_stall_torque": twin_torque(servo),
        "speed": 60.0 / printed.time_60 if printed.time_60 else None,
        "flags": list(printed_flags(servo)),
    }


def twin_torque(servo: Servo) -> float | None:
    """Return the stall torque [N m] of the twin at the voltage of the sheet; None where the file has no motor.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(twin_torque(load_servo("hitec-hs-755hb")), 2)
    1.65
    """
    voltage = printed_points(servo)[0].supply_voltage
    at = servo if voltage is None else servo.replace({"supply.open_circuit_voltage": voltage})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            model = default_model(at)
            plant = model.pack(as_load(None))
        except ServotwinError:
            return None
    if isinstance(model, DigitalServo):
        plant = at_duty(plant, float(model.most_duty))
    current = stall_current(plant, plant.source.V)
    return float(stall_torque(current, plant.motor.K, plant.friction.F_forward, plant.friction.K_m, plant.friction.K_e))


def parameters(servo: Servo) -> list[dict[str, Any]]:
    """Return every given parameter with value (SI), unit, origin, spread and source.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> parameters(servo_from_values("mine", {"motor": {"armature_resistance": 3.0}}))[0]["origin"]
    'assumed'
    """
    rows = []
    for name in servo.names():
        q = servo.source(name)
        value = list(q.value) if isinstance(q.value, tuple) else q.value
        rows.append({"name": name, "value": value, "unit": q.unit, "origin": q.origin, "spread": q.spread,
                     "std": q.std, "lower": q.lower, "upper": q.upper, "source": q.source})
    return rows


def readiness(servo: Servo) -> dict[str, dict[str, Any]]:
    """Return for each model whether the servo can run it, what it lacks, and what would not be read.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> readiness(servo_from_values("mine", {"gear": {"gear_reduction": 280.0}}))["dc-motor"]["lacks"][0]
    'motor.armature_resistance'
    """
    found: dict[str, dict[str, Any]] = {}
    for name, kind in MODELS.items():
        lacks: list[str] = []
        ignored: list[str] = []
        problem = None
        try:
            ignored = list(kind(servo).ignored)
        except MissingParameterError as error:
            lacks = list(error.names)
        except ServotwinError as error:
            problem = str(error)
        found[name] = {"runs": not lacks and problem is None, "lacks": lacks, "problem": problem, "ignored": ignored}
    return found


# --- A servo as a table: every parameter with value, unit, origin, spread and source ----------------------------------

def heading(servo: Servo) -> list[RenderableType]:
    """Return title, kind, notes and flags of a servo."""
    said = printed_flags(servo)
    return [f"{servo.title} ({servo.name}), {servo.kind}", " ".join(servo.notes.split()),
            *([f"flags: {'; '.join(said)}"] if said else [])]


def servo_rows(facts: dict[str, Any]) -> list[RenderableType]:
    """Return the stall torque of the sheet and that of the twin, as `headline` tells them."""
    said = [f"{facts[key]:.3g} N m {words}" for key, words in (
        ("stall_torque", "by the sheet"), ("twin_stall_torque", "by these parameters")) if facts[key] is not None]
    at = f" at {facts['supply_voltage']:.3g} V" if facts["supply_voltage"] is not None else ""
    return [f"stall torque{at}: {', '.join(said)}"] if said else []


def parameter_table(rows: list[dict[str, Any]]) -> list[RenderableType]:
    """Return parameters and sources of a servo, as `parameters` tells them."""
    sources = list(dict.fromkeys(row["source"] for row in rows if row["source"]))
    lines: list[tuple[str, ...]] = []
    group = ""
    for row in rows:
        table_name, _, key = row["name"].partition(".")
        if table_name != group:
            lines.append((table_name, *[""] * 5))
            group = table_name
        source = f"[{sources.index(row['source']) + 1}]" if row["source"] else ""
        lines.append((f"  {key}", _value(row["value"]), row["unit"], row["origin"], row["spread"], source))
    return [table(("parameter", "value", "unit", "origin", "spread", "source"), lines), "",
            *[f"[{k}] {source}" for k, source in enumerate(sources, start=1)]]


def _value(value: Any) -> str:
    return ", ".join(f"{x:z.5g}" for x in value) if isinstance(value, list) else (
        value if isinstance(value, str) else f"{value:z.5g}")


# --- The summary of a simulation: one set of facts (SI), shown as a table or as JSON ----------------------------------

NONE = "-"
_LAST = 0.5  # s, or half of a shorter run: over which the speed of a servo that turns endlessly is meant
_ENERGY = ("winding", "bridge", "brush", "conversion", "friction", "stops", "load", "stored")


def facts(result: Result) -> dict[str, Any]:
    """Return the facts of a result that matter, in SI, ready for JSON.

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

    angle_label = "final motor angle" if found.get("angle") == "motor_angle" else "final angle"
    rows.append((angle_label, shown("final_angle", found["final_angle"], ".2f", "deg", "angle")))
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


# --- A study in tables: quantiles of the metrics, the tornado of one, and what failed ---------------------------------

_MOST_BARS = 12
_MOST_FAILURES = 3
_MOST_LANES = 5  # of a kind of remark


def sections(study: Study, metric: str, files: Sequence[str], given: Sequence[str] = ()) -> list[RenderableType]:
    """Return what is printed of a study; `metric` is that of the tornado, and `given` what the user set."""
    definition = study.definition
    head = f"{definition['servo']}, {definition['model']}, {len(study)} lanes, {definition['duration']:g} s"
    follow = [("follow", ", ".join(study.followed))] if study.followed else []
    rows = [("varied", ", ".join(study.parameters)), *follow, ("failed", _failed(study)), *_remarks(study),
            *([("set", names(given))] if given else []), *(("written", name) for name in files)]
    return [head, pairs(rows), "", _quantiles(study), "", f"what moves {plotting.metric_shown(metric).words}, one at a "
            "time, and its share of the variance", *_tornado(study, metric)]


def _failed(study: Study) -> str:
    failures = study.failures
    named = "; ".join(f"lane {f.lane} at {f.time:g} s: {f.cause}" for f in failures[:_MOST_FAILURES])
    more = f"; and {len(failures) - _MOST_FAILURES} more" if len(failures) > _MOST_FAILURES else ""
    return f"{len(failures)}: {named}{more}" if failures else "none"


def _remarks(study: Study) -> list[tuple[str, str]]:
    found = []
    for kind, lanes in study.remarked().items():
        first = ", ".join(map(str, lanes[:_MOST_LANES])) + (" ..." if len(lanes) > _MOST_LANES else "")
        found.append(("remark", f"{words(kind)}: {len(lanes)} of {len(study)} (lane{'s'[:len(lanes) > 1]} {first})"))
    return found


def _quantiles(study: Study) -> RenderableType:
    found = study.quantiles()
    header = ["metric", "unit", "nominal", *(f"{100 * p:g} %" for p in next(iter(found.values())))]
    rows = []
    for name, values in found.items():
        shown = plotting.metric_shown(name)
        nominal = study.tornado(name).nominal
        rows.append([shown.words, shown.label, _text(nominal, name), *(_text(x, name) for x in values.values())])
    return table(header, rows)


def _tornado(study: Study, metric: str) -> list[RenderableType]:
    shown = plotting.metric_shown(metric)
    unit = f" ({shown.label})" if shown.label else ""
    rows, found = [], study.tornado(metric)
    for bar in found.bars[:_MOST_BARS]:
        low, high = (plotting.readable(value, dimension_of(bar.name)) for value in (bar.low, bar.high))
        share = "" if math.isnan(bar.share) else f"{100.0 * bar.share:.1f} %"
        rows.append([bar.name, low, high, _text(bar.at_low, metric), _text(bar.at_high, metric), share])
    left = [f"{len(names)} {words}" for words, names in (
        ("more move it less", found.bars[_MOST_BARS:]), ("others that vary do not move it", found.still)) if names]
    if not rows:
        return ["nothing that varies moves it, so there is no tornado"]
    return [table(["parameter", "from (5 %)", "to (95 %)", f"gives{unit}", "and", "share"], rows), *left]


def _text(value: float, metric: str) -> str:
    shown = plotting.metric_shown(metric)
    return "-" if math.isnan(value) else f"{units.from_si(value, shown.unit, shown.dimension):z.4g}"
