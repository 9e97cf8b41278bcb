"""What the page knows of the world: the catalog, lessons, names, ranges and rules, as plain values."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import units
from servotwin.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER, ControlSupply, PulseGenerator
from servotwin.errors import ServotwinError
from servotwin.loads import Load, Pendulum
from servotwin.models import DigitalServo
from servotwin.models.engine.live import posts, screen
from servotwin.models.engine.live.posts import UNITS
from servotwin.models.engine.live.screen import FIELDS
from servotwin.models.outputs import SIGNALS
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.given import field_of
from servotwin.parameters import GROUPS, catalog_names
from servotwin.parameters.group import RULES
from servotwin.parameters.quantity import SET_BY_USER
from servotwin.parameters.servo import KINDS as KINDS_OF_SERVOS
from servotwin.signals.signal import KINDS
from servotwin.simulation.bus import OF_BUS
from servotwin.simulation.engine import failure
from servotwin.simulation.result import shown_columns
from servotwin.simulation.start import Status
from servotwin.web.alone.bounds import bounds_of
from servotwin.web.alone.csv_rules import csv_rules
from servotwin.web.alone.limits import limits
from servotwin.web.alone.register_tables import family_names, register_tables
from servotwin.web.alone.words import WORDS
from servotwin.web.lessons import mystery
from servotwin.web.lessons.lessons import lessons
from servotwin.web.live import said
from servotwin.web.live.beginning import NO_PLAY, load_of, middle_of, models_of
from servotwin.web.live.commands import command_signal
from servotwin.web.live.export import APART, SCRIPT, STEP
from servotwin.web.live.export import KINDS as KINDS_OF_FILES
from servotwin.web.live.facts import SLIDER, facts_of, load_facts
from servotwin.web.live.live_bench import WHOLE
from servotwin.web.live.scene import TABLES, TOP, Scene
from servotwin.web.live.scene_servo import SERVO_MODELS, SceneServo, model_named
from servotwin.web.server.catalog import catalog_list, curves_data

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo

_OF_ALL = ("name", "symbol", "unit", "dimension", "meaning", "shown", "rule", "choices")  # alike of all servos
_SPREAD = ("std", "lower", "upper")
_OF_EACH = ("value", "origin", "source", "spread", "low", "high")


def world(first: Scene) -> dict[str, Any]:
    """Return what the page knows, as plain values; `first` is the bench that it begins with.

    Raises
    ------
    InputError
        If that bench is one that the page cannot have.
    """
    example = facts_of(models_of(Scene(servos=(SceneServo(id=catalog_names()[0]),)))[0], first)
    return {
        "first": first.text(), "lessons": [{**one.listed(), "text": one.scene.text()} for one in lessons()],
        "servos": {name: _servo(name) for name in catalog_names()}, "catalog": catalog_list(), "curves": _curves(),
        "parameters": [[one[key] for key in _OF_ALL] for one in example["parameters"]], "of_all": _OF_ALL,
        "of_each": _OF_EACH, "given": {
            one["name"]: None if one["rule"] == "table" else field_of(one["name"]) for one in example["parameters"]},
        "models": {name: _model(name) for name in SERVO_MODELS}, "loads": load_facts(Scene(servos=first.servos)),
        "load": _LOADS, "of_bus": OF_BUS, "switched": [
            name for name in SERVO_MODELS if issubclass(model_named(name), SwitchedServo)],
        "signals": {name: {"unit": one.unit, "meaning": one.meaning} for name, one in SIGNALS.items()},
        "columns": screen.COLUMNS, "events": {str(code): word for code, word in screen.SHOWN.items()},
        "rules": {"actions": said.ACTIONS, "for_all": said.FOR_ALL, "scene": said.SCENE, "view": said.VIEW,
                  "servo": said.SERVO, "loads": {name: _load_rule(name) for name in _LOADS}},
        "mystery": {
            "base": mystery.BASE, "hidden": mystery.unknowns(), "both_ways": mystery.BOTH_WAYS,
            "friction": mystery.FRICTION, "good": mystery.GOOD, "fair": mystery.FAIR, "seeds": mystery.SEEDS},
        "file": {"groups": [*GROUPS], "spread": _SPREAD, "no_play": NO_PLAY, "usual": KINDS_OF_SERVOS[0], "units": {
            name: {unit: units.factor(unit, name) for unit in known} for name, known in units.DIMENSIONS.items()}},
        "files": _files(), "csv": csv_rules(),
        "no_load": _no_load(), "made": ["", "no_inertia"],
        "set": {"origin": "assumed", "source": SET_BY_USER, "spread": ""},
        "slider": SLIDER, "ranges": {name: _ends(one) for name, one in RULES.items()},
        "less": [[f"{title}.{name}" for name in pair] for title, group in GROUPS.items() for pair in group.less],
        "limits": limits(), "words": WORDS, "shapes": FIELDS, "units": UNITS,
        "kinds": {unit: KINDS[unit][0] for unit in UNITS}, "lines": "linear", "hold": "hold",
        "degrees": "deg", "whole": WHOLE, "status": [_failed(one) for one in Status],
        "scene": {"servo": [*said.SERVO["fields"]], "sources": said.SOURCES, "tables": TABLES, "top": TOP,
                  "row": (3, 4)},
        "control": _control(),
        "converters": [{"name": name, "of": of, "gain": one.gain, "offset": one.offset, "highest": one.highest}
                       for name, of, one in (("command_count", "command_voltage", INPUT_CONVERTER),
                                             ("feedback_count", "feedback_voltage", FEEDBACK_CONVERTER))]}


_GAIN = "firmware.proportional_gain"
_LOADS = {"load.inertia": "inertia", "load.viscous_friction": "viscous_friction", "load.torque": "torque",
          "load.coulomb_torque": "coulomb_torque", "load.pendulum.mass": "mass", "load.pendulum.length": "arm",
          "load.pendulum.hanging_angle": "hanging_angle"}
"""Fields of a scene's load, by what an action calls them."""


def _load_rule(name: str) -> dict[str, Any]:
    """Return the rule of a number of a load, as `check_number` has it."""
    part = Pendulum if "pendulum" in name else Load
    if name.rpartition(".")[2] in part.not_negative:
        return {"is": "number", "what": name, "low": 0.0, "allowed": "a finite number of at least 0"}
    return {"is": "number", "what": name, "allowed": "a finite number"}


def _no_load() -> dict[str, float]:
    """Return what hangs on a shaft where a scene says nothing."""
    load = load_of(Scene(servos=(SceneServo(id=catalog_names()[0]),)))
    of_load = {name: float(getattr(load.pendulum if "pendulum" in name else load, name.rpartition(".")[2]))
               for name in _LOADS}
    return {_LOADS[name]: value for name, value in of_load.items()}


def _model(name: str) -> dict[str, Any]:
    """Return what is alike of all servos of a model."""
    kind = model_named(name)
    return {"family": posts.FAMILIES[name], "requires": kind.requires, "reads": [*kind.requires, *kind.optional]}


def _servo(name: str) -> dict[str, Any]:
    """Return what is known of a servo of the catalog, with each model that it has numbers for."""
    models: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for kind in SERVO_MODELS:
        scene = Scene(servos=(SceneServo(id=name, model=kind),))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                model, = models_of(scene)
        except ServotwinError:
            continue
        facts = facts_of(model, scene)
        found = {key: facts[key] for key in ("id", "title", "kind", "models", "horn")}
        found["registers"], found["family"] = register_tables(model), family_names(model.servo)
        found["values"] = [[one[key] for key in _OF_EACH] for one in facts["parameters"]]
        found["stated"] = _stated(model.servo)
        found |= {"notes": model.servo.notes, "sheet": dict(model.servo.sheet), "fit": dict(model.servo.fit)}
        models[kind] = {"columns": ["time", *facts["signals"]], "bounds": bounds_of(model), "middle": middle_of(model),
                        "refused": _refused(model),
                        **{key: facts[key] for key in ("travel_deg", "pulse_us", "voltage", "loop")}}
        if isinstance(model, DigitalServo) and facts["loop"]:
            models[kind]["loop"] = {**facts["loop"], "gain": _GAIN,
                                    "per_gain": model.loop_stiffness() / model.value(_GAIN)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        default = models_of(Scene(servos=(SceneServo(id=name),)))[0]
    return {**found, "model": type(default).__name__, "of": models}


def _refused(model: Model) -> dict[str, str]:
    """Return what is said of commands that a model does not take, by their units."""
    found = {}
    for unit in {*UNITS} - {*bounds_of(model)}:
        try:
            model.command(command_signal({"shape": "hold", "unit": unit, "value": 1.0}, 0.0))
        except ServotwinError as error:
            found[unit] = " ".join(str(error).split())
    return found


def _stated(servo: Servo) -> dict[str, list[float | None]]:
    """Return how sure a servo's record is of its numbers: std, lower and upper (SI) of those where it says so."""
    found = {name: [getattr(servo.source(name), key) for key in _SPREAD] for name in servo.names()}
    return {name: ends for name, ends in found.items() if any(end is not None for end in ends)}


def _control() -> dict[str, Any]:
    """Return the control circuit: what it is unless a scene says more, and its converter and generator."""
    usual, generator = ControlSupply(), PulseGenerator()
    return {"usual": {name: getattr(usual, name) for name in said.CONTROL_FIELDS},
            "longest": generator.width(INPUT_CONVERTER.highest), "delay": said.CONTROL_FIELDS[2],
            "fields": {"gain": INPUT_CONVERTER.gain, "offset": INPUT_CONVERTER.offset,
                       "highest": INPUT_CONVERTER.highest, "step": generator.step, "base": generator.base,
                       "counts_per_step": generator.counts_per_step}, "shares": said.CONTROL_FIELDS[:2],
            "unit": UNITS[2], "bus": "bus_voltage", "full": "supply.open_circuit_voltage"}


def _files() -> dict[str, Any]:
    """Return how files are written: columns of tables by signal, with their factors, and the script."""
    columns = {}
    for name, one in {"time": None, **SIGNALS}.items():
        unit = "s" if one is None else one.unit
        (at_zero, at_one), = shown_columns({name: np.array([0.0, 1.0])}, {name: unit}).values()
        shown, = shown_columns({name: np.zeros(1)}, {name: unit})
        columns[name] = [shown, float(at_one - at_zero), float(at_zero)]
    return {"columns": columns, "digits": 12, "apart": APART, "rate": 1.0 / STEP, "script": SCRIPT,
            "kinds": KINDS_OF_FILES}


def _ends(one: Any) -> dict[str, Any]:
    ends = {name: end for name, end in (("low", one.low), ("high", one.high)) if math.isfinite(end)}
    return {**ends, "open": one.open}


def _failed(status: Status) -> str:
    """Return what is said of a bench that stands; {time} is when [s]."""
    return " ".join(str(failure(status, 0.0)).replace("0 s", "{time} s").split())


def _curves() -> dict[str, Any]:
    found = {}
    for name in catalog_names():
        try:
            found[name] = curves_data(name)
        except ServotwinError as error:
            found[name] = {"error": " ".join(str(error).split())}
    return found
