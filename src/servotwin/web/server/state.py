"""What a page has to know of a bench as it is: taken at an instant, and put together while the bench goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.web.lessons.mystery import is_hidden, unknowns
from servotwin.web.live.facts import facts_of, load_facts

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.web.live import LiveBench, Scene


class Snapshot(NamedTuple):
    """A bench at an instant; nothing of it changes any more."""

    scene: Scene
    models: tuple[Model, ...]
    registers: tuple[Servo, ...]
    load_numbers: dict[str, float]
    columns: tuple[tuple[str, ...], ...]
    frame_rate: float


def snapshot_of(bench: LiveBench) -> Snapshot:
    """Return a bench as it is now."""
    return Snapshot(bench.scene(), bench.now_models, tuple(map(bench.register_servo, range(len(bench.models)))),
                    dict(bench.load_numbers), bench.columns, bench.frame_rate)


def state_of(seen: Snapshot) -> dict[str, Any]:
    """Return what a page has to know of a bench.

    Examples
    --------
    >>> from servotwin.web.live import LiveBench
    >>> from servotwin.web.server.first import first_scene
    >>> state = state_of(snapshot_of(LiveBench(first_scene())))
    >>> [servo["model"] for servo in state["servos"]], state["frame_rate"]
    (['PulseServo'], 50.0)
    """
    scene = seen.scene
    return {"scene": scene.text(), "name": scene.name,
            "servos": [servo_facts(seen, k) for k in range(len(scene.servos))],
            "loads": load_facts(scene, seen.load_numbers), "view": dict(scene.view), "lesson": dict(scene.lesson),
            "supply": dict(scene.supply) or None, "control": dict(scene.control) or None,
            "of_catalog": [servo.id for servo in scene.servos], "frame_rate": seen.frame_rate,
            "unknowns": unknowns() if scene.servos[0].mystery is not None else []}


def servo_facts(seen: Snapshot, servo: int) -> dict[str, Any]:
    """Return what a page knows of a servo; of a mystery not what is hidden."""
    facts = facts_of(seen.models[servo], seen.scene, seen.registers[servo])
    if seen.scene.servos[servo].mystery is not None:
        facts["parameters"] = [one for one in facts["parameters"] if not is_hidden(one["name"])]
    return {**facts, "servo": servo, "columns": seen.columns[servo]}


def changes_of(seen: Snapshot, servos: list[int]) -> dict[str, Any]:
    """Return what a page has to know of servos whose numbers were changed."""
    return {"changed": [servo_facts(seen, k) for k in servos], "loads": load_facts(seen.scene, seen.load_numbers)}
