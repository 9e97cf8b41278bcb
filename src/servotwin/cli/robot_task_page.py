"""What the page of an arm says of its task: contour error, and the use of a redundant joint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from servotwin.cli.robot_page import STYLE, figure, film
from servotwin.look import document, escape, table


def task_section(found: Mapping[str, Any], ways: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the section on tool and redundancy, for the page of servos that did a task.

    Parameters
    ----------
    found : mapping
        Facts of the task.
    ways, rows : sequence
        Table of the ways in which the joints may move.
    """
    metrics, ideal = found["task_metrics"], found["ideal_contour"]
    head = ["actuators", "contour error, rms", "largest", "behind, rms", "servos' angles, rms", "motor voltage, rms",
            "command goes", "energy"]
    lines = [["servos", _mm(metrics["contour_rms"]), _mm(metrics["contour_largest"]), _mm(metrics["tool_rms"]),
              f"{math.degrees(metrics['angle_rms']):.2f}°", f"{metrics['effort']:.2f} V",
              _chatter(metrics["chatter"], bypassed=found["chips_bypassed"]), _joules(metrics["energy"])],
             ["ideal", _mm(ideal["rms"]), _mm(ideal["largest"]), "–", "–", "–", "–", "–"]]
    drawn = table(head, [[escape(cell) for cell in line] for line in lines], text_columns=len(head))
    return ('<h2>The tool</h2>\n<p>The contour error is the distance of the tool from its path, however late it is.</p>'
            f'\n<div class="joints">{drawn}</div>\n'
            + figure("tool.png", "The tool's path, asked for and done, and its distance from the path over time.")
            + _redundancy(ways, rows))


def ideal_page(found: Mapping[str, Any], files: Sequence[str], ways: Sequence[str],
               rows: Sequence[Sequence[str]]) -> str:
    """Return the page of a task that ideal actuators did."""
    ideal, title = found["ideal_contour"], f"{found['robot']}: {found['task']}"
    torques = table(["joint", "largest torque or force"], [
        [escape(joint), f"{value:.3g} {'N' if joint == 'lift' else 'N m'}"]
        for joint, value in found["largest_torque"].items()], text_columns=2)
    body = (f'<h1>{escape(title)}</h1>\n<p class="lead">Ideal actuators: joints are exactly where inverse kinematics '
            f"wants them, for {found['duration']:.4g} s. The tool is at most {_mm(ideal['largest'])} beside its path, "
            f"{_mm(ideal['rms'])} rms.</p>\n{film(files).replace('; pale: the same with ideal actuators', '')}"
            + figure("tool.png", "The tool's path and its distance from it over time.")
            + _redundancy(ways, rows) + f'<h2>What it takes</h2>\n<div class="joints">{torques}</div>\n')
    return document(title, body, style=STYLE)


def _redundancy(ways: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    drawn = table(list(ways), [[escape(cell) for cell in row] for row in rows], text_columns=len(ways))
    return (f'<h2>Redundancy</h2>\n<div class="joints">{drawn}</div>\n'
            + figure("redundancy.png", "How far each hinge goes in its range, and its torque by rigid bodies alone, "
                     "with ideal actuators. Limits left: distance to the nearest limit, of half a range."))


def _mm(value: float) -> str:
    return f"{1e6 * value:.2g} µm" if value < 1e-5 else f"{1e3 * value:.3g} mm"


def _chatter(value: float, *, bypassed: bool) -> str:
    return f"{value:.3g} {'V/s' if bypassed else 'rad/s'}"


def _joules(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g} J"
