"""The report of a robot's fit: one HTML page that needs nothing but itself."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.look import document, escape, table
from servotwin.parameters import write_file

if TYPE_CHECKING:
    from servotwin.identification.arms.arm_fit import ArmFit
    from servotwin.robots import RobotValidation


def write_arm_report(fit: ArmFit, path: Path, *, overwrite: bool = False) -> Path:
    """Write the report of a robot's fit; raises if the file exists and may not be replaced."""
    write_file(path, arm_page(fit).encode(), overwrite=overwrite)
    return Path(path)


def arm_page(fit: ArmFit, pictures: str = "") -> str:
    """Return the report as HTML; `pictures` are figures that stand beside it."""
    title = "The servos of a robot, from its episodes"
    said = [*(cause.sentence for cause in fit.causes), *map(str, fit.unidentifiable), *map(str, fit.left_out),
            *fit.warnings]
    notes = "".join(f"<li>{escape(text)}</li>" for text in said)
    body = (f'<h1>{title}</h1>\n<p class="lead">{escape(fit.sentence)}.</p>\n'
            + (f'<div class="note"><ul>{notes}</ul></div>\n' if notes else "")
            + f"<h2>Joint by joint</h2>\n{errors_table(fit)}{pictures}<h2>What was found</h2>\n{estimates_table(fit)}"
            + _READING)
    return document(title, body)


def degrees(value: float) -> str:
    """Return an angle [rad] in degrees."""
    return "–" if math.isnan(value) else f"{math.degrees(value):.2f}"


def error_rows(fit: ArmFit) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the errors of all joints, fitted and unseen, before and after [deg]."""
    columns: list[tuple[str, RobotValidation]] = [("fitted, before", fit.before), ("fitted", fit.training)]
    if fit.holdout is not None and fit.before_holdout is not None:
        columns += [("unseen, before", fit.before_holdout), ("unseen", fit.holdout)]
    rows = [[joint, *(degrees(found.errors["servos"][joint]["all"].rms) for _, found in columns),
             degrees(fit.noise[joint])] for joint in fit.training.joints]
    return ["joint", *(name for name, _ in columns), "noise"], rows


def errors_table(fit: ArmFit) -> str:
    """Return the errors of all joints as HTML."""
    head, rows = error_rows(fit)
    return table([escape(cell) for cell in head], [[escape(cell) for cell in row] for row in rows],
                 caption="Simulated less measured angle, rms (°)")


def estimate_rows(fit: ArmFit) -> list[list[str]]:
    """Return a row for each number: name, value, interval, how that was found."""
    made = []
    for name, (lower, upper, method) in fit.intervals().items():
        spread = "–" if math.isnan(lower) else f"{lower:.4g} to {upper:.4g}"
        made.append([name, f"{fit.estimates[name]:.4g} {fit.units[name]}".removesuffix(" 1"), spread, method])
    return made


def estimates_table(fit: ArmFit) -> str:
    """Return the estimates as HTML."""
    return table(["number", "value", f"{100 * fit.level:g} % interval", "known"],
                 [[escape(cell) for cell in row] for row in estimate_rows(fit)], text_columns=4)


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Unseen</b>: episodes that were not fitted. <b>Before</b>: by the servos and the robot as their files have them,
at the latency that fits these best.</li>
<li><b>mass.…</b> are factors on the masses of the robot's file; <b>zero.…</b> is by how much a joint of the robot's
model is ahead of what was measured; <b>latency</b> is from the reading of positions to when the goal of the same row
acts; <b>clock</b> is the share by which turns of the loop take longer than stamps say that only count them.</li>
<li><b>by beliefs</b>: episodes alone do not tell it; the interval stands on what the files of servo and robot say, and
on how far masses may be off.</li></ul></section>
"""
