"""What the page knows of the world: the catalog, lessons, names and ranges, as plain values and bytes."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

from servotwin.errors import ServotwinError
from servotwin.models.engine.live import screen
from servotwin.models.outputs import SIGNALS
from servotwin.parameters import catalog_names, load_servo
from servotwin.web.alone.posts import packed_post
from servotwin.web.lessons.lessons import lessons
from servotwin.web.live.beginning import load_of, models_of
from servotwin.web.live.facts import facts_of, load_facts
from servotwin.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER
from servotwin.models.engine.live.posts import UNITS
from servotwin.models.engine.live.shapes import FIELDS
from servotwin.simulation.engine import failure
from servotwin.simulation.status import Status
from servotwin.web.alone.limits import limits
from servotwin.web.alone.words import WORDS, bounds_of
from servotwin.web.live.beginning import middle_of
from servotwin.web.live.live_bench import _WHOLE
from servotwin.web.live.scene import _TABLES, Scene
from servotwin.web.live.scene_servo import _KEYS, SERVO_MODELS, SceneServo
from servotwin.web.server.catalog import catalog_list, curves_data

if TYPE_CHECKING:
    from servotwin.models import Model

_OF_ALL = ("name", "symbol", "unit", "dimension", "meaning", "shown", "rule", "choices")  # alike of all servos
_OF_EACH = ("value", "origin", "source", "spread", "low", "high")


def world(first: Scene) -> tuple[dict[str, Any], bytes]:
    """Return what the page knows, and the records of servos one after the other."""
    records: list[bytes] = []
    servos = {name: _servo(name, records) for name in catalog_names()}
    example = facts_of(models_of(Scene(servos=(SceneServo(id=catalog_names()[0]),)))[0], first)
    told = {
        "servos": servos, "parameters": [[one[key] for key in _OF_ALL] for one in example["parameters"]],
        "first": first.text(), "lessons": [{**one.listed(), "text": one.scene.text()} for one in lessons()],
        "catalog": catalog_list(), "curves": _curves(),
        "signals": {name: {"unit": one.unit, "meaning": one.meaning} for name, one in SIGNALS.items()},
        "columns": list(screen.COLUMNS), "events": {str(code): word for code, word in screen.SHOWN.items()},
        "reads": {name: _reads(name) for name in SERVO_MODELS},
        "loads": load_facts(first), "of_all": _OF_ALL, "of_each": _OF_EACH, "limits": limits(), "words": WORDS,
        "shapes": FIELDS, "units": UNITS, "lines": "linear", "hold": "hold", "degrees": "deg", "whole": _WHOLE,
        "status": [_failed(one) for one in Status],
        "scene": {"servo": _KEYS, "tables": _TABLES},
        "converters": [{"name": name, "of": of, "gain": one.gain, "offset": one.offset, "highest": one.highest}
                       for name, of, one in (("command_count", "command_voltage", INPUT_CONVERTER),
                                             ("feedback_count", "feedback_voltage", FEEDBACK_CONVERTER))]}
    return told, b"".join(records)


def _reads(name: str) -> list[str]:
    from servotwin.web.live.scene_servo import model_named

    kind = model_named(name)
    return [*kind.requires, *kind.optional]


def _servo(name: str, records: list[bytes]) -> dict[str, Any]:
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
        found = {key: facts[key] for key in ("id", "title", "kind", "models", "horn", "registers")}
        found["values"] = [[one[key] for key in _OF_EACH] for one in facts["parameters"]]
        models[kind] = {"record": len(records), "bounds": bounds_of(model), "middle": middle_of(model), "columns": ["time", *facts["signals"]],
                        **{key: facts[key] for key in ("travel_deg", "pulse_us", "voltage", "loop")}}
        records.append(packed_post(model, load_of(scene)))
    default = models_of(Scene(servos=(SceneServo(id=name),)))[0]
    return {**found, "model": type(default).__name__, "of": models}


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
