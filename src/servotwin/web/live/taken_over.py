"""A bench with a servo that was fitted, beside or instead of the one that the fit began with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError
from servotwin.units import is_finite
from servotwin.web.live.actions import Action
from servotwin.web.live.said import SUPPLY_FIELDS
from servotwin.web.live.scene import MOST_SERVOS, Scene
from servotwin.web.live.scene_servo import SceneServo

if TYPE_CHECKING:
    from servotwin.models import Model

HOW = ("beside", "instead")
"""Ways to take a servo over."""
_FIELDS = {"load.pendulum.mass": "mass", "load.pendulum.length": "arm", "load.pendulum.hanging_angle": "hanging_angle"}


def taken_over(scene: Scene, models: Sequence[Model], load: Mapping[str, float], frame_rate: float, file: str,
               model: str, servo: int, how: str) -> Scene:
    """Return a bench at its beginning with one servo more, or another one; all else is as it is now.

    Parameters
    ----------
    scene : Scene
        As it is now.
    models : sequence of Model
        With their numbers of now.
    load : mapping
        What was changed of loads, by dotted name (SI).
    frame_rate : float
        Of now [Hz].
    file : str
        The text of the servo file.
    model : str
        Its fidelity.
    servo : int
        The servo that the fit began with.
    how : str
        Of `HOW`.

    Raises
    ------
    InputError
        If there is no room for it.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.parameters.servo_file import servo_text
    >>> scene, servo = st.web.Scene(servos=(SceneServo(id="hitec-hs-755hb"),)), st.load_servo("hitec-hs-755hb")
    >>> made = taken_over(scene, [st.PulseServo(servo)], {"load.inertia": 1e-3}, 50.0, servo_text(servo), "PulseServo",
    ...                   0, "beside")
    >>> len(made.servos), made.load["inertia"], made.servos[1].servo() == servo
    (2, 0.001, True)
    """
    if how == "beside" and len(scene.servos) >= MOST_SERVOS:
        raise InputError("servos", got=f"{len(scene.servos)} and one more", allowed=f"at most {MOST_SERVOS}; take it "
                         "over instead of another")
    new = SceneServo(file=file, model=model)
    kept = [_as_now(one, now) for one, now in zip(scene.servos, models, strict=True)]
    if how == "beside" or servo >= len(kept):
        kept.append(new)
    else:
        kept[servo] = new
    supply = {key: value for key in SUPPLY_FIELDS if is_finite(value := models[0].servo.get(f"supply.{key}"))}
    changed = {_FIELDS.get(name, name.removeprefix("load.")): value for name, value in load.items()}
    command = next((action.value for action in reversed(scene.actions)
                    if action.kind == "command" and action.servo is None and action.time <= scene.end), None)
    return replace(scene, servos=tuple(kept), load={**scene.load, **changed}, frame_rate=frame_rate, end=0.0,
                   supply=supply if scene.supply else {}, lesson={},
                   actions=() if command is None else (Action(0.0, "command", command),))


def _as_now(servo: SceneServo, now: Model) -> SceneServo:
    """Return a servo of a scene that begins with its numbers of now."""
    before = servo.servo()
    changed: dict[str, Any] = {}
    for name in dict.fromkeys((*before.names(), *now.servo.names())):
        value = now.servo.get(name)
        if value != before.get(name) and (is_finite(value) or isinstance(value, str)):
            changed[name] = value
    return replace(servo, parameters={**servo.parameters, **changed}) if changed else servo
