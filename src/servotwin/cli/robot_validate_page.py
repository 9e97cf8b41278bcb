"""The page of `servotwin robot validate`: HTML beside its pictures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import plotting
from servotwin.cli.robot_files import joint_pages
from servotwin.cli.robot_page import STYLE, figure, figures
from servotwin.cli.robot_validate import ERRORS, WINDOWS, degrees, head, rows
from servotwin.look import document, escape, table
from servotwin.robots.replay import ALL, SERVOS
from servotwin.text import shortened

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

    from servotwin.robots import RobotValidation

_BESIDE = 0.5  # s, that pictures show before and after a window


def errors_picture(found: RobotValidation) -> Figure:
    """Return the error of every joint by servos and rivals."""
    return plotting.ranking(list(found.joints), x_label="simulated less measured, rms (°)", values={
        name: [math.degrees(kinds[joint][ALL].rms) for joint in found.joints]
        for name, kinds in found.errors.items()})


def write_windows(found: RobotValidation, places: Mapping[str, Path]) -> None:
    """Draw the worst second of each joint, page by page, into the places of their names."""
    traces = []
    for window in found.windows:
        one = found.replays[window.replay]
        inside = (one.time >= window.start - _BESIDE) & (one.time <= window.stop + _BESIDE)
        goal = one.run.motion.angles.get(window.joint, np.full(len(one.time), math.nan))
        best = min((name for name in found.errors if name != SERVOS), key=found.rms)
        traces.append(plotting.ReplayTrace(
            f"{shortened(window.joint.replace('_', ' '))}: {degrees(window.rms)}° rms, {window.kind}", one.time[inside],
            goal[inside], one.measured[window.joint][inside],
            {name: one.simulated[name][window.joint][inside] for name in (SERVOS, best)}))
    for page, name in enumerate(joint_pages(WINDOWS, len(traces)), 1):
        plotting.save(plotting.replay_windows(traces, page=page), places[name])


def page(found: RobotValidation, told: dict[str, Any]) -> str:
    """Return the page."""
    title = f"{told['robot']}: simulated beside measured"
    seconds = sum(one.run.motion.duration for one in found.replays)
    lead = (f"The goals of {len(found.replays)} episode{'s' * (len(found.replays) != 1)} ({seconds:.4g} s) went "
            f"through the robot with its servos ({', '.join(sorted(set(told['servos'].values())))}); its joints are "
            f"{degrees(found.rms())}° rms off the measured ones.")
    cards = "".join(f"<li><b>{degrees(found.rms(name))}°</b>{escape(name)}</li>" for name in found.errors)
    notes = "".join(f"<li>{escape(text)}</li>" for text in told["notes"])
    drawn = table([escape(cell) for cell in head(found)],
                  [[escape(cell.replace("-", "−") if cell == "-" else cell) for cell in row] for row in rows(found)],
                  caption="Simulated less measured angle, rms (°); at most: the largest single one of the servos")
    late = ", ".join(f"{escape(name)} {1e3 * value:.0f} ms" for name, value in found.latency.items())
    return document(title, (
        f'<h1>{escape(title)}</h1>\n<p class="lead">{escape(lead)}</p>\n<ul class="numbers">{cards}</ul>\n'
        + (f'<div class="note"><ul>{notes}</ul></div>\n' if notes else "")
        + f'<h2>Joint by joint</h2>\n<div class="joints">{drawn}</div>\n'
        + figure(ERRORS, "The same, all samples.") + "<h2>Where it is worst</h2>\n"
        + figures(joint_pages(WINDOWS, len(found.windows)), "The second of each joint in which the servos are furthest "
                  "off, the worst joint first; beside the best of the other actuators.")
        + f"<h2>When goals act</h2>\n<p>Later than the positions of their row were read by: {late}; each is the one "
        f"time of all joints at which it fits best.</p>\n{_READING}"), style=STYLE)


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Moving</b>: goal or joint is faster than 4°/s; <b>resting</b>: neither is; <b>under load</b>: to hold or move the
joint as the goals say takes over a tenth of the torque that its servo has at standstill.</li>
<li><b>Ideal actuators</b> are exactly on the goals; <b>&lt;position&gt;</b> are MuJoCo's actuators, with numbers that
files for the SO-100 and SO-101 have: kp 998 (kv 2.7, damping 0.6, armature 0.028, 2.94 N m), kp 50 (damping 1, armature
0.005) and kp 17.8 (damping 0.6, armature 0.028, 3.35 N m).</li>
<li><b>Files.</b> <a href="summary.json">summary.json</a>: all numbers of this page, in SI units.</li></ul></section>
"""
