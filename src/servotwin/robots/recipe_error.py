"""How far a recipe of MuJoCo's actuators is off its servo: both do the same, MuJoCo's and the twin by `simulate`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import loads, signals
from servotwin.errors import InputError
from servotwin.models import mid_travel
from servotwin.robots.places import load_mujoco
from servotwin.robots.recipe_twin import (
    LAST,
    RAMP,
    REST,
    SETTLE,
    WAY,
    Droops,
    droops_of_twin,
    eased,
    inertia_under,
    without_ends,
)
from servotwin.simulation.simulator import simulate

if TYPE_CHECKING:
    from servotwin.robots.recipe import Recipe

Array = NDArray[np.float64]
_STEP, _SWING, _FREQUENCY = math.radians(30.0), math.radians(20.0), 0.5  # rad, rad, Hz
_LONG = 2.0  # s, of each
_LOOK = 0.01  # s
_TIMESTEP = 0.001  # s, of MuJoCo
_HALVINGS = 8
_RAISED = math.radians(5.0)  # that a servo has to raise what it lifts by
_FROM = math.radians(60.0)  # rad below a goal: full drive


class Actuator(NamedTuple):
    """What one of MuJoCo's actuators does by a recipe.

    Parameters
    ----------
    lift : float
        Most torque that it lifts from rest [N m].
    droops, droops_at_half : Droops
        Under the load of the recipe and under half of it [rad].
    step_rms, sine_rms : float
        Its angle less the servo's under that load, after a step of 30° and through a sine of ±20° at 0.5 Hz [rad].
    """

    lift: float
    droops: Droops
    droops_at_half: Droops
    step_rms: float
    sine_rms: float


@dataclass(frozen=True, kw_only=True)
class RecipeError:
    """Both actuators of a recipe beside the servo.

    Parameters
    ----------
    load : float
        [N m]
    lift : float
        Of the servo [N m].
    droops, droops_at_half : Droops
        Of the servo under the load and under half of it [rad].
    position, dcmotor : Actuator
    lacks : tuple of str
    """

    load: float
    lift: float
    droops: Droops
    droops_at_half: Droops
    position: Actuator
    dcmotor: Actuator
    lacks: tuple[str, ...]

    def __str__(self) -> str:
        """Return a table, and what the recipe lacks."""
        rows = [("", "servo", "<position>", "<dcmotor>"), ("lift", *(
            f"{value:.3g} N m" for value in (self.lift, self.position.lift, self.dcmotor.lift)))]
        for torque, name in ((self.load, "droops"), (0.5 * self.load, "droops_at_half")):
            for way in Droops._fields:
                rows.append((f"stands off, come {way}, {torque:.3g} N m", *(
                    f"{math.degrees(getattr(getattr(one, name), way)):.2f} deg"
                    for one in (self, self.position, self.dcmotor))))
        for name, words in (("step_rms", "off after a step of 30 deg, rms"), ("sine_rms", "off in a sine, rms")):
            rows.append((words, "", *(
                f"{math.degrees(getattr(one, name)):.2f} deg" for one in (self.position, self.dcmotor))))
        return "\n".join([f"{a:<36}{b:>12}{c:>12}{d:>12}".rstrip() for a, b, c, d in rows]
                         + [f"lacks {words}" for words in self.lacks])


def error_of(recipe: Recipe) -> RecipeError:
    """Return how far both actuators are off the servo."""
    half = droops_of_twin(recipe.model, 0.5 * recipe.load, inertia_under(0.5 * recipe.load))
    moves: list[tuple[Array, Goals]] = [(_twin(recipe, goals), goals) for goals in (_step_goals, _sine_goals)]
    found = [_done(recipe, text("joint"), moves) for text in (recipe.position, recipe.dcmotor)]
    return RecipeError(load=recipe.load, lift=recipe.lift, droops=recipe.droops, droops_at_half=half, position=found[0],
                       dcmotor=found[1], lacks=recipe.lacks)


Goals = Callable[[Array], Array]


def _step_goals(time: Array) -> Array:
    return np.where(time < REST, 0.0, _STEP)


def _sine_goals(time: Array) -> Array:
    return np.where(time < REST, 0.0, _SWING * np.sin(2.0 * math.pi * _FREQUENCY * (time - REST)))


def _twin(recipe: Recipe, goals: Goals) -> Array:
    """Return the angles of the servo about mid-travel under the load of the recipe."""
    middle, time = mid_travel(recipe.model), np.arange(0.0, REST + _LONG + _TIMESTEP, _TIMESTEP)
    command = signals.samples(time, middle + goals(time), unit="rad", hold="previous")
    result = simulate(without_ends(recipe.model), command, duration=REST + _LONG, output_step=_LOOK,
                      load=loads.Constant(recipe.load) + loads.Inertia(inertia_under(recipe.load)))
    if not result.status.ok:
        raise InputError(f"error of a recipe of {recipe.model.servo.name}", got=result.status.message, allowed="a run")
    return np.asarray(result["output_angle"] - middle)


def _done(recipe: Recipe, actuator: str, moves: Sequence[tuple[Array, Goals]]) -> Actuator:
    off = [float(np.sqrt(np.mean((_followed(recipe, actuator, recipe.load, goals, REST + _LONG) - twin)**2)))
           for twin, goals in moves]
    return Actuator(_lifted(recipe, actuator), _droops(recipe, actuator, recipe.load),
                    _droops(recipe, actuator, 0.5 * recipe.load), *off)


def arm_of(recipe: Recipe, actuator: str, inertia: float, *, joint: str | None = None) -> Any:
    """Return an MjModel of a joint `joint` with an actuator of a recipe and an inertia [kg m²], without gravity."""
    return load_mujoco().MjModel.from_xml_string(
        f'<mujoco><option timestep="{_TIMESTEP}" integrator="implicitfast" gravity="0 0 0"/><worldbody><body>'
        f'<joint name="joint" axis="0 0 1" {joint or recipe.joint()}/><inertial pos="0 0 0" mass="1" '
        f'diaginertia="{inertia:.9g} {inertia:.9g} {inertia:.9g}"/></body></worldbody>'
        f"<actuator>{actuator}</actuator></mujoco>")


def _followed(recipe: Recipe, actuator: str, torque: float, goals: Goals, duration: float, start: float = 0.0) -> Array:
    """Return the angles of a joint under a torque that pulls down, at times that are 0.01 s apart [rad]."""
    mujoco = load_mujoco()
    model = arm_of(recipe, actuator, inertia_under(torque))
    data, every = mujoco.MjData(model), round(_LOOK / _TIMESTEP)
    data.qpos[0], data.qfrc_applied[0] = start, -torque
    angles = [start]
    table = goals(np.asarray(_TIMESTEP * np.arange(round(duration / _TIMESTEP)) + 1e-9, np.float64))
    for k, goal in enumerate(table.tolist(), 1):
        data.ctrl[0] = goal
        mujoco.mj_step(model, data)
        if k % every == 0:
            angles.append(float(data.qpos[0]))
    return np.array(angles)


def _droops(recipe: Recipe, actuator: str, torque: float) -> Droops:
    """Return where the joint stands off after a goal that comes slowly, as that of `droops_of_twin`."""
    found = []
    for way in (WAY, -WAY):
        last = _followed(recipe, actuator, torque, partial(eased, way=way), REST + RAMP + SETTLE, -0.5 * way)[-LAST:]
        found.append(0.5 * way - float(last.mean()))
    return Droops(*found)


def _lifted(recipe: Recipe, actuator: str) -> float:
    """Return the most torque that is raised from rest by full drive, by halving [N m]."""
    low, high = 0.0, 2.0 * recipe.most_torque
    for _ in range(_HALVINGS):
        half = 0.5 * (low + high)
        risen = _followed(recipe, actuator, half, lambda time: np.full(len(time), _FROM), 0.5)[-1] > _RAISED
        low, high = (half, high) if risen else (low, half)
    return 0.5 * (low + high)
