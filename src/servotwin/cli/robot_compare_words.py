"""What `servotwin robot compare` says: tables, factors, and where each controller loses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from servotwin.robots.comparison import CONDITIONS, FIDELITIES, NOMINAL
from servotwin.robots.steering import STEERINGS

if TYPE_CHECKING:
    from servotwin.robots.comparison import Comparison, Outcome

TITLES = {
    "plain": "plain commands", "deadband": "deadband compensation", "feedforward": "(40) as feedforward",
    "pid": "PID", "motor-pid": "PID at motors", "play": "PID at motors, play compensated",
    "computed-torque": "computed torque", "observer": "disturbance observer"}
"""Of the controllers; the last five drive the motors past the chips."""
CONDITION_HEAD = ("controller", *CONDITIONS)
_NONE = math.nan
_BAD = 1.2  # times its nominal error: worth a word


def facts(comparison: Comparison, done: Sequence[Outcome]) -> dict[str, Any]:
    """Return all of it as plain numbers in SI units."""
    names = ("contour_rms", "contour_largest", "tool_rms", "angle_rms", "effort", "chatter", "energy")
    return {"servo": comparison.servo.name, "bus_servo": comparison.bus_servo.name, "speed": comparison.speed,
            "cases": [{**each.case._asdict(), **{name: _NONE if each.metrics is None else getattr(each.metrics, name)
                                                 for name in names}, "failure": each.failure} for each in done]}


def errors(done: Sequence[Outcome], controller: str, servos: str, condition: str, task: tuple[str, str] | None = None,
           what: str = "tool_rms") -> float:
    """Return a metric, the mean over all tasks unless one is named; nan where there is none."""
    found = [math.nan if each.metrics is None else float(getattr(each.metrics, what)) for each in done
             if (each.case.controller, each.case.servos, each.case.condition) == (controller, servos, condition)
             and (task is None or (each.case.robot, each.case.task) == task)]
    return sum(found) / len(found) if found else math.nan


def tasks(done: Sequence[Outcome]) -> list[tuple[str, str]]:
    """Return robots and their tasks, in order."""
    return list(dict.fromkeys((each.case.robot, each.case.task) for each in done))


def condition_rows(done: Sequence[Outcome]) -> list[list[str]]:
    """Return a row for each controller: its error in each condition, with pulse servos."""
    return [[TITLES[name], *(millimetres(errors(done, name, "pulse", condition)) for condition in CONDITIONS)]
            for name in STEERINGS]


def fidelity_rows(done: Sequence[Outcome], task: tuple[str, str], what: str) -> list[list[str]]:
    """Return a row for each controller: its error on a task by servos of every fidelity."""
    return [[TITLES[name], *(millimetres(errors(done, name, servos, NOMINAL, task, what)) for servos in FIDELITIES)]
            for name in STEERINGS]


def cost_rows(done: Sequence[Outcome], servos: str) -> list[list[str]]:
    """Return a row for each controller: effort, chatter and energy, means of all tasks; factor over plain commands."""
    rows = []
    for name, make in STEERINGS.items():
        effort, chatter, energy, tool = (errors(done, name, servos, NOMINAL, None, what)
                                         for what in ("effort", "chatter", "energy", "tool_rms"))
        plain = errors(done, "plain", servos, NOMINAL)
        unit = "V/s" if make().bare else "rad/s"
        rows.append([TITLES[name], f"{effort:.2f} V", f"{chatter:.3g} {unit}",
                     "-" if math.isnan(energy) else f"{energy:.1f} J", f"{plain / tool:.1f}"])
    return rows


def losses(done: Sequence[Outcome]) -> list[str]:
    """Return a sentence for each controller: where it loses most, against itself and against plain commands."""
    said = []
    for name in STEERINGS:
        own = errors(done, name, "pulse", NOMINAL)
        grown = {condition: errors(done, name, "pulse", condition) / own for condition in CONDITIONS
                 if condition != NOMINAL}
        grown = {condition: ratio for condition, ratio in grown.items() if not math.isnan(ratio)}
        if not grown:
            continue
        worst = max(grown, key=lambda condition: grown[condition])
        behind = [condition for condition in CONDITIONS if name != "plain" and errors(
            done, name, "pulse", condition) > errors(done, "plain", "pulse", condition)]
        text = f"{TITLES[name]}: {millimetres(own)} nominal"
        text += (f", {grown[worst]:.1f} times that in the worst condition ({worst})" if grown[worst] > _BAD else
                 ", and nearly the same in every condition")
        said.append(text + (f"; worse than plain commands: {', '.join(behind)}" if behind else ""))
    return said


def millimetres(value: float) -> str:
    """Return a length [m] in mm with three digits."""
    return "-" if math.isnan(value) else f"{1e3 * value:.3g} mm"
