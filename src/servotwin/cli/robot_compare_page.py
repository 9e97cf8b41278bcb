"""The page of `servotwin robot compare`: HTML that needs nothing but the picture beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from servotwin import plotting
from servotwin.cli.robot_compare_words import (
    CONDITION_HEAD,
    TITLES,
    condition_rows,
    cost_rows,
    errors,
    fidelity_rows,
    losses,
    tasks,
)
from servotwin.cli.robot_page import figure
from servotwin.look import document, escape, table
from servotwin.robots.comparison import CONDITIONS, FIDELITIES
from servotwin.robots.steering import STEERINGS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.robots.comparison import Outcome

_STYLE = "figure img{width:100%;height:auto;max-width:48rem}td:nth-child(n+2){white-space:nowrap}"


def conditions_picture(done: Sequence[Outcome]) -> Figure:
    """Return the errors of all controllers in each condition, by pulse servos, mean of all tasks."""
    return plotting.ranking(
        [TITLES[name] for name in STEERINGS], x_label="tool behind, rms (mm)",
        values={condition: [1e3 * errors(done, name, "pulse", condition) for name in STEERINGS]
                for condition in CONDITIONS})


def page(found: dict[str, Any], done: Sequence[Outcome]) -> str:
    """Return the page of a comparison."""
    title = "Controllers of servos, compared"
    parts = [f"<h1>{title}</h1>\n<p class=\"lead\">{len(done)} runs: every task under every controller, by servos "
             f"<code>{escape(found['servo'])}</code> of every fidelity and by "
             f"<code>{escape(found['bus_servo'])}</code>; then, by pulse servos, with wrong beliefs, load, a low "
             "battery and worn gears.</p>\n",
             "<h2>When it gets hard</h2>\n", figure("conditions.png", "How far the tool is from where it should be, "
                                                    "mean of all tasks, pulse servos."),
             _table(CONDITION_HEAD, condition_rows(done), "Tool behind, rms, mean of all tasks, pulse servos"),
             "<h3>Where each loses</h3>\n<ul>" + "".join(f"<li>{escape(text)}.</li>" for text in losses(done))
             + "</ul>\n", "<h2>What it takes</h2>\n"]
    for servos in ("pulse", "digital"):
        parts.append(_table(("controller", "motor voltage, rms", "commands go up and down by", "energy",
                             "times better than plain"), cost_rows(done, servos),
                            f"Nominal, mean of all tasks, {servos} servos"))
    for robot, task in tasks(done):
        parts.append(f"<h2>{escape(robot)}: {escape(task)}</h2>\n")
        for what, words in (("tool_rms", "Tool behind, rms"), ("contour_rms", "Distance from the path, rms")):
            parts.append(_table(("controller", *FIDELITIES), fidelity_rows(done, (robot, task), what), words))
    failed = [each for each in done if each.failure]
    if failed:
        parts.append("<h2>What did not go</h2>\n<ul>" + "".join(
            f"<li>{escape(' / '.join(each.case))}: {escape(each.failure)}</li>" for each in failed) + "</ul>\n")
    return document(title, "".join(parts) + _READING, style=_STYLE)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    cells = [[escape(cell.replace("-", "−") if cell == "-" else cell) for cell in row] for row in rows]
    return table([escape(cell) for cell in head], cells, caption=escape(caption))


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Behind</b>: how far the tool is from where it should be at the time, root mean square; <b>distance from the
path</b>: however late it is.</li>
<li><b>Fidelities.</b> Ideal torque: a motor gives what it is asked for, without friction or limit. Averaged: (35) to
(41) of the paper, no limit. Bounded: limit, deadband, stiction. Pulse: single pulses of the chip, and all that the file
gives. Digital: the bus servo. Plain commands, deadband compensation and (40) go through the servo's own loop; the
others drive the motor past the chip by encoders of 4096 counts, at the horns or at the motors.</li>
<li><b>Conditions.</b> 30 % wrong: controllers believe in 30 % more resistance and rotor inertia and in 30 % less
friction. With load: the tool carries twice what they know of. Low battery: four tired cells for all servos. Worn gears:
1° of play, which the play compensation knows.</li>
<li><b>Gains</b> follow from the servo's numbers by rule, not by hand.</li></ul></section>
"""
