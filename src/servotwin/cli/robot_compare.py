"""`servotwin robot compare`: all controllers on all tasks of the paper's arms, by servos of every fidelity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import robot_arm as arms
from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, json_text, pairs, show
from servotwin.cli.terminal import table as shown_table

if TYPE_CHECKING:
    from servotwin.cli.outputs import Target
    from servotwin.robots.comparison import Comparison, Outcome

_TABLE, _SUMMARY, _PICTURE, _PAGE = "compare.csv", "summary.json", "conditions.png", "index.html"
_WHAT = "What to compare"


def compare(
    out: arms.OutOption,
    robot: Annotated[list[str] | None, typer.Option(
        metavar="ROBOT", help="scara or two-link; repeatable (default: both).", rich_help_panel=_WHAT)] = None,
    task: Annotated[list[str] | None, typer.Option(
        metavar="TASK", help="circle, square or pick-and-place; repeatable (default: all that a robot has).",
        rich_help_panel=_WHAT)] = None,
    speed: arms.SpeedOption = 0.08,
    servo: Annotated[str, typer.Option(
        metavar="ID", help="Analog servo of all joints: catalog id, or path of a servo file.",
        rich_help_panel=_WHAT)] = "hitec-hs-755hb",
    bus_servo: Annotated[str, typer.Option(
        metavar="ID", help="Digital servo that it is compared with.", rich_help_panel=_WHAT)] = "feetech-sts3215-12v",
    force: arms.ForceOption = False, as_json: shared.JsonOption = False,
) -> None:
    """Compare controllers on all tasks by all fidelities, and when it gets hard."""
    from servotwin.cli import robot_compare_words as words
    from servotwin.cli import robot_files as files
    from servotwin.cli.model_words import servo_of
    from servotwin.robots.comparison import Comparison

    chosen = _cases(robot, task)
    comparison = Comparison(servo=servo_of(servo, []), bus_servo=servo_of(bus_servo, []), speed=speed)
    with files.folder(out):
        targets = files.targets_of(out, [_TABLE, _SUMMARY, _PICTURE, _PAGE], force=force)
        done = _outcomes(comparison, chosen, quiet=as_json)
        found = words.facts(comparison, done)
        _write(done, found, targets, force=force)
    found["files"] = [str(target.path) for target in targets]
    if as_json:
        emit_json(found)
        return
    show("distance of the tool from where it should be, rms, by pulse servos, mean of all tasks",
         shown_table(words.CONDITION_HEAD, words.condition_rows(done)), "",
         *words.losses(done), "", pairs([("written", found["files"][-1])]))


def _cases(robots: list[str] | None, tasks: list[str] | None) -> list[Any]:
    from servotwin.errors import UnknownNameError
    from servotwin.robots import comparison

    for name in robots or []:
        if name not in comparison.ROBOTS:
            raise UnknownNameError("robot to compare on", name, comparison.ROBOTS)
    known = {task for each in comparison.TASKS.values() for task in each}
    for name in tasks or []:
        if name not in known:
            raise UnknownNameError("task to compare", name, sorted(known))
    chosen = list(comparison.cases(robots or tuple(comparison.ROBOTS), tasks))
    if not chosen:
        raise UnknownNameError("task of these robots", ", ".join(tasks or []),
                               [task for name in robots or comparison.ROBOTS for task in comparison.TASKS[name]])
    return chosen


def _outcomes(comparison: Comparison, chosen: Sequence[Any], *, quiet: bool) -> list[Outcome]:
    """Do all cases; the path of the joints is found once a task."""
    from servotwin.cli.robot_words import as_options
    from servotwin.simulation.progress import shown

    paths: dict[tuple[str, str], Any] = {}
    done = []
    with shown(not quiet, len(chosen), "doing tasks") as tell:
        for case in chosen:
            key = (case.robot, case.task)
            if key not in paths:
                with as_options():
                    paths[key] = comparison.joints(case)
            done.append(comparison.outcome(case, paths[key]))
            tell(len(done))
    return done


def _write(done: Sequence[Outcome], found: dict[str, Any], targets: Sequence[Target], *, force: bool) -> None:
    from servotwin import plotting
    from servotwin.cli.outputs import staged
    from servotwin.cli.robot_compare_page import conditions_picture, page
    from servotwin.tables import csv_text

    with staged(targets, force=force) as drafts:
        places: dict[str, Path] = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        columns = {name: [case[name] for case in found["cases"]] for name in found["cases"][0]}
        places[_TABLE].write_bytes(csv_text(columns, digits=9).encode())
        places[_SUMMARY].write_bytes((json_text(found) + "\n").encode())
        plotting.save(conditions_picture(done), places[_PICTURE])
        places[_PAGE].write_bytes(page(found, done).encode())
