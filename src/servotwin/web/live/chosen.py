"""Which servos stand on the bench, as a page asks for them: of the catalog, or kept as they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from servotwin.errors import InputError
from servotwin.web.live.said import SUPPLY_FIELDS
from servotwin.web.live.scene import MOST_SERVOS, Scene
from servotwin.web.live.scene_servo import SceneServo, read_scene_servo


def with_servos(scene: Scene, asked: Any, supply: Any = None) -> Scene:
    """Return a bench with other servos, which begins anew; load and transmitter stay.

    Parameters
    ----------
    scene : Scene
        As it is.
    asked : list of mapping
        Of each servo "id", a name of the catalog, or "keep", its number on the bench; and its "model".
    supply : mapping, optional
        Numbers of a supply that all share (SI), by `SUPPLY_FIELDS`.

    Raises
    ------
    InputError
        If that asks for nothing that can be.

    Examples
    --------
    >>> scene = Scene(servos=(SceneServo(mystery=3),), load={"inertia": 1e-3})
    >>> new = with_servos(scene, [{"keep": 0, "model": "PulseServo"}, {"id": "hitec-hs-755hb"}])
    >>> [servo.mystery for servo in new.servos], new.load
    ([3, None], {'inertia': 0.001})
    """
    if not isinstance(asked, list) or not 1 <= len(asked) <= MOST_SERVOS:
        raise InputError("servos", got=len(asked) if isinstance(asked, list) else asked,
                         allowed=f"a list of 1 to {MOST_SERVOS}")
    if supply is not None and not (isinstance(supply, Mapping) and set(supply) <= set(SUPPLY_FIELDS)):
        raise InputError("supply", got=supply, allowed=f"a table of {', '.join(SUPPLY_FIELDS)}")
    servos = tuple(_one(scene, one) for one in asked)
    return replace(scene, servos=servos, supply=dict(supply or {}), name="", end=0.0, actions=(), control={}, lesson={})


def _one(scene: Scene, asked: Any) -> SceneServo:
    if not isinstance(asked, Mapping) or "keep" not in asked:
        return read_scene_servo(asked)
    k, model = asked["keep"], asked.get("model", "")
    if isinstance(k, bool) or not isinstance(k, int) or not 0 <= k < len(scene.servos):
        raise InputError("servo to keep", got=k, allowed=f"a whole number from 0 to {len(scene.servos) - 1}")
    read_scene_servo({"id": "", "model": model})
    return replace(scene.servos[k], model=model)
