"""`servotwin robot compare`: one task by servos of every fidelity and under every controller, in one table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import robot_arm as arms
from servotwin.cli import robot_files as files
from servotwin.cli import shared_options as shared
from servotwin.cli.robot_page import STYLE, figure
from servotwin.cli.terminal import emit_json, json_text, pairs, show
from servotwin.cli.terminal import table as shown_table
from servotwin.look import document, escape, table
from servotwin.tables import csv_text

if TYPE_CHECKING:
    from servotwin.robots.arm import Arm
    from servotwin.robots.comparison import Case
    from servotwin.robots.task_run import TaskRun

_TABLE, _SUMMARY, _PICTURE, _PAGE = "compare.csv", "summary.json", "tool.png", "index.html"
HEAD = ("servos", "controller", "believes", "contour", "largest", "behind", "motor", "commands", "energy")


def compare(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="scara, scara-4 (without the third link) or two-link.")],
    out: arms.OutOption, task: arms.TaskOption = "circle", size: arms.SizeOption = None,
    speed: arms.SpeedOption = 0.08,
    servo: Annotated[str, typer.Option(
        metavar="ID", help="Analog servo of all joints: catalog id, or path of a servo file.")] = "hitec-hs-755hb",
    bus_servo: Annotated[str, typer.Option(
        metavar="ID", help="Digital servo that it is compared with.")] = "feetech-sts3215-12v",
    payload: Annotated[str, typer.Option(
        metavar="MASS", help="That the tool carries; controllers with wrong beliefs know nothing of it.")] = "50g",
    force: arms.ForceOption = False, as_json: shared.JsonOption = False,
) -> None:
    """Compare fidelities and controllers on one task."""
    from servotwin.cli.model_words import servo_of
    from servotwin.robots import comparison
    from servotwin.robots.kinematics import follow
    from servotwin.simulation.progress import shown

    arm, believed = _arm(robot, arms.mass(payload)), _arm(robot, 0.0)
    path = arms.path_of(arm, task, size, speed)
    with files.folder(out):
        targets = files.targets_of(out, [_TABLE, _SUMMARY, _PICTURE, _PAGE], force=force)
        joints = follow(arm, path)
        chosen = list(comparison.cases(servo_of(servo, []), servo_of(bus_servo, []), believed))
        runs = []
        with shown(not as_json, len(chosen), "doing the task") as tell:
            for case in chosen:
                runs += comparison.compared(joints, [case])
                tell(len(runs))
        found = _facts(arm, runs, chosen)
        _write(runs, chosen, found, targets, force=force)
    found["files"] = [str(target.path) for target in targets]
    if as_json:
        emit_json(found)
        return
    show(f"{arm.name}: {path.name}, {path.duration:.4g} s", shown_table(HEAD, _rows(found)), "",
         pairs([("written", found["files"][-1])]))


def _arm(name: str, payload: float) -> Arm:
    from servotwin.cli.robot_words import as_options
    from servotwin.errors import UnknownNameError
    from servotwin.robots import scara, two_link

    made = {"scara": lambda: scara(payload=payload), "scara-4": lambda: scara(third_link=False, payload=payload),
            "two-link": lambda: two_link(payload=payload)}
    if name not in made:
        raise UnknownNameError("robot to compare on", name, made)
    with as_options():
        return made[name]()


def _facts(arm: Arm, runs: Sequence[TaskRun], chosen: Sequence[Case]) -> dict[str, Any]:
    ideal = runs[0].ideal_contour
    return {"robot": arm.name, "task": runs[0].path.path.name, "duration": runs[0].path.path.duration,
            "ideal_contour": {"rms": ideal.rms, "largest": ideal.largest},
            "cases": [{"servos": case.servos, "servo": case.model.servo.name, "controller": case.controller,
                       "believes": case.believes, **run.metrics._asdict()}
                      for case, run in zip(chosen, runs, strict=True)]}


def _rows(found: dict[str, Any]) -> list[tuple[str, ...]]:
    ideal = found["ideal_contour"]
    exact = (f"{1e3 * ideal[name]:.5f} mm" for name in ("rms", "largest"))
    rows: list[tuple[str, ...]] = [("ideal", "", "", *exact, "", "", "", "")]
    for case in found["cases"]:
        unit = "rad/s" if case["controller"] in ("plain", "feedforward") else "V/s"
        rows.append((case["servos"], case["controller"], case["believes"], f"{1e3 * case['contour_rms']:.3f} mm",
                     f"{1e3 * case['contour_largest']:.3f} mm", f"{1e3 * case['tool_rms']:.2f} mm",
                     f"{case['effort']:.2f} V", f"{case['chatter']:.3g} {unit}",
                     "" if math.isnan(case["energy"]) else f"{case['energy']:.1f} J"))
    return rows


def _write(runs: Sequence[TaskRun], chosen: Sequence[Case], found: dict[str, Any], targets: Sequence[Any], *,
           force: bool) -> None:
    from servotwin import plotting
    from servotwin.cli.outputs import staged

    plain = [(case, run) for case, run in zip(chosen, runs, strict=True) if case.controller == "plain"]
    traces = [plotting.ToolTrace(case.servos, run.run.time[run.moving], run.tool[run.moving], run.contour.error)
              for case, run in plain]
    with staged(targets, force=force) as drafts:
        places: dict[str, Path] = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        plotting.save(plotting.tool_paths(runs[0].path.path.line, traces), places[_PICTURE])
        columns = {name: [case[name] for case in found["cases"]] for name in found["cases"][0]}
        places[_TABLE].write_bytes(csv_text(columns, digits=9).encode())
        places[_SUMMARY].write_bytes((json_text(found) + "\n").encode())
        places[_PAGE].write_bytes(_page(found).encode())


def _page(found: dict[str, Any]) -> str:
    title = f"{found['robot']}: {found['task']}, compared"
    drawn = table(list(HEAD), [[escape(cell) for cell in row] for row in _rows(found)], text_columns=len(HEAD))
    body = (f"<h1>{escape(title)}</h1>\n<p class=\"lead\">One path of the joints, {found['duration']:.4g} s, by servos "
            f"of every fidelity under plain commands, and by pulse servos under every controller.</p>\n"
            f'<div class="joints">{drawn}</div>\n'
            + figure("tool.png", "The tool's path under plain commands, and its distance from the one asked for.")
            + _READING)
    return document(title, body, style=STYLE)


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Contour.</b> Distance of the tool from its path, root mean square and largest, however late it is;
<b>behind</b>: from where it should be at the time, the lag included.</li>
<li><b>Motor.</b> Its voltage, root mean square over all joints; <b>commands</b>: how far they go up and down per
second.</li>
<li><b>Believes.</b> Wrong: the controller knows nothing of the payload, has 20 % too much resistance and 30 % too
little friction.</li>
<li><b>Controllers.</b> Plain sends angles; feedforward moves them so that the servo's own loop gives the voltage that
the arm takes; the others bypass the chips and command voltages, by encoders of 4096 counts at the horns.</li>
<li><b>Energy</b> is not known of models without a supply.</li></ul></section>
"""
