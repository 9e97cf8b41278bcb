"""What a bench begins with: its models, what hangs on their shafts, and the first command of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from servotwin import loads
from servotwin.models import mid_travel
from servotwin.models.switched import SwitchedServo
from servotwin.web.live.actions import Action
from servotwin.web.live.shared_supply import hung

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.web.live.scene import Scene

_ARM = 0.1  # m, of a scene that gives none
_PLAY = "gear.backlash"
NO_PLAY = "none, unless it is changed at the bench"
"""Source of the play of a servo of which none is known."""


def models_of(scene: Scene) -> tuple[Model, ...]:
    """Return the models of a scene's servos, on the supply that they share, if there is one.

    Raises
    ------
    InputError
        Or one of its kinds, if one of them is not possible.

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> models_of(Scene(servos=(SceneServo(id="hitec-hs-755hb"),)))
    (PulseServo('hitec-hs-755hb'),)
    """
    models = [_with_play(servo.built()) for servo in scene.servos]
    return hung(models, load_of(scene), scene.supply) if scene.supply else tuple(models)


def _with_play(model: Model) -> Model:
    """Return a model whose play is given, 0 if it is not known, so that there can be some while time goes on."""
    if not isinstance(model, SwitchedServo) or model.servo.get(_PLAY) is not None:
        return model
    return type(model)(model.servo.replace({_PLAY: 0.0}, source=NO_PLAY))


def load_of(scene: Scene) -> Load:
    """Return what hangs on each shaft: always all of it, so that each number can change while time goes on.

    Raises
    ------
    LoadError
        If a number is out of its range.

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> load_of(Scene(servos=(SceneServo(id="hitec-hs-755hb"),), load={"mass": 0.2})).pendulum.mass
    0.2
    """
    own: dict[str, Any] = dict(scene.load)
    arm = loads.Pendulum(mass=own.pop("mass", 0.0), length=own.pop("arm", _ARM),
                         hanging_angle=own.pop("hanging_angle", 0.0))
    return loads.Load(**own) + arm


def first_commands(scene: Scene, models: Sequence[Model]) -> list[Action]:
    """Return the commands at t = 0 that a scene says, and for servos without one the middle of their travel.

    They begin with one for each servo, or with one for all.

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> scene = Scene(servos=(SceneServo(id="hitec-hs-755hb"), SceneServo(id="towerpro-mg996r")))
    >>> [(action.value["value"], action.servo) for action in first_commands(scene, models_of(scene))]
    [(90.0, 0), (0.0, 1)]
    """
    said = [action for action in scene.actions if action.kind == "command" and action.time == 0.0]
    if any(action.servo is None for action in said):
        return []
    told = {action.servo for action in said}
    found = [(k, middle_of(model)) for k, model in enumerate(models) if k not in told]
    if not told and len({value for _, value in found}) == 1:
        return [Action(0.0, "command", _hold(found[0][1]))]
    return [Action(0.0, "command", _hold(value), k) for k, value in found]


def first_of(actions: Sequence[Action], servo: int) -> dict[str, Any]:
    """Return the first command of a servo, which is there."""
    return next(dict(action.value) for action in actions
                if action.kind == "command" and action.servo in (None, servo))


def middle_of(model: Model) -> float:
    """Return the middle of a model's travel, as a first command has it [deg]."""
    return round(math.degrees(mid_travel(model)), 3)


def _hold(value: float) -> dict[str, Any]:
    return {"shape": "hold", "unit": "deg", "value": value}
