"""`servotwin robot fit`: servos, supply, links, zeros and latency of a robot from its episodes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import robot_options as options
from servotwin.cli import shared_options as shared
from servotwin.cli.robot_validate import DatasetArgument, ForceOption, OutOption
from servotwin.cli.terminal import emit_json, json_text, pairs, show, table
from servotwin.text import file_stems

if TYPE_CHECKING:
    from servotwin.cli.outputs import Target
    from servotwin.identification.arms import ArmFit

SUMMARY, ERRORS, WINDOWS, PAGE = "summary.json", "errors.png", "windows.png", "index.html"
_FIT = "Fit"


def fit(
    model_file: options.ModelArgument, logs: DatasetArgument, servo: options.ServoOption = None,
    mount: options.MountOption = None, model: options.ModelOption = None, change: options.SetOption = None,
    register: options.RegisterOption = None, supply: options.SupplyOption = None,
    package: options.PackageOption = None,
    calibration: options.CalibrationOption = None, episode: options.EpisodesOption = None,
    unit: options.UnitOption = None,
    each: Annotated[bool, typer.Option("--each", help="Fit every servo by itself (default: one for all that are "
                                       "equal).", rich_help_panel=_FIT)] = False,
    masses: Annotated[float, typer.Option(metavar="SHARE", help="How far the masses of the robot's file may be off, as "
                                          "a standard deviation; 0: they are right.", rich_help_panel=_FIT)] = 0.1,
    holdout: Annotated[int | None, typer.Option(metavar="COUNT", help="Episodes, the last ones, that are not fitted "
                                                "but predicted (default: a fourth, at least one of two).",
                                                rich_help_panel=_FIT)] = None,
    intervals: Annotated[bool, typer.Option("--intervals/--no-intervals", help="Without them it is a first result in a "
                                            "third of the time.", rich_help_panel=_FIT)] = True,
    diagnose: Annotated[bool, typer.Option("--trials/--no-trials", help="Whether causes are sought where a belief "
                                           "is pushed far.", rich_help_panel=_FIT)] = True,
    within: Annotated[str | None, typer.Option(metavar="DURATION", help="Stop after this time, such as 90s or 5min, "
                                               "and keep the best so far, as Ctrl-C does.",
                                               rich_help_panel=_FIT)] = None,
    out: OutOption = None, force: ForceOption = False, as_json: shared.JsonOption = False,
) -> None:
    """Fit the servos of a robot."""
    from servotwin.cli import robot_files as files
    from servotwin.cli.fit_words import duration
    from servotwin.cli.robot_words import as_options
    from servotwin.cli.stopping import best_kept, end_if_stopped
    from servotwin.identification.arms import identify_arm
    from servotwin.identification.arms.identify_arm import UNKNOWN, mounts_of, plant_of
    from servotwin.robots.episode import joints_of_dataset

    limit = duration("--within", within)
    plant, unknown = plant_of(UNKNOWN, joints_of_dataset(logs)) if model_file == UNKNOWN else (None, ())
    asked = options.asked_robot(model_file, logs, servo=servo or [], mount=mount or [], model=model,
                                change=change or [], register=register or [], supply=supply, calibration=calibration,
                                episodes=episode or [], unit=unit or [], package=package or [], plant=plant)

    def done(names: Sequence[str]) -> tuple[ArmFit, dict[str, Any]]:
        targets = files.targets_of(out, names, force=force, inputs=[logs]) if out is not None else []
        with as_options(), best_kept(shown=not as_json) as progress:
            found = identify_arm(asked.motions, UNKNOWN if unknown else asked.plant, asked.mounts, bus=asked.bus,
                                 each=each, masses=masses, holdout=holdout, intervals=intervals, diagnose=diagnose,
                                 within=limit, progress=progress)
        told = {"robot": model_file, "episodes": [one.source for one in asked.motions], **found.facts()}
        told["warnings"] = [*asked.said, *told["warnings"]]
        _write(found, told, targets, stems, force=force)
        told["files"] = [str(target.path) for target in targets]
        if not as_json:
            _show(found, told)
        return found, told

    with as_options():  # of the servos at recorded joints, the only ones that are fitted
        stems = file_stems(mounts_of(asked.mounts, model_file, asked.plant, asked.motions)[0])
    servos = [f"{stem}.toml" for stem in stems.values()]
    windows = files.joint_pages(WINDOWS, len(stems))
    if out is None:
        found, told = done([])
    else:
        with files.folder(out):
            found, told = done([*servos, SUMMARY, ERRORS, *windows, PAGE])
    if as_json:
        emit_json(told)
    end_if_stopped(found, timed=within is not None)


def _show(found: ArmFit, told: dict[str, Any]) -> None:
    from servotwin.identification.report.page import error_rows, estimate_rows

    head, rows = error_rows(found)
    said = [*map(str, found.unidentifiable), *map(str, found.left_out), *told["warnings"]]
    show(f"{told['robot']}: {told['sentence']}", *(f"! {cause.sentence}" for cause in found.causes), "",
         "simulated less measured, rms (deg)", table(head, rows), "",
         table(("number", "value", f"{100 * found.level:g} % interval", "known"), estimate_rows(found)), "",
         pairs([*(("note", text) for text in said),
                *((("written", told["files"][-1]),) if told["files"] else ())]))


def _write(found: ArmFit, told: dict[str, Any], targets: Sequence[Target], stems: dict[str, str], *,
           force: bool) -> None:
    if not targets:
        return
    from servotwin import plotting
    from servotwin.cli.outputs import staged
    from servotwin.cli.robot_files import joint_pages
    from servotwin.cli.robot_page import figure, figures
    from servotwin.cli.robot_validate_page import errors_picture, write_windows
    from servotwin.identification.report.page import arm_page

    judged = found.holdout or found.training
    with staged(targets, force=force) as drafts:
        places: dict[str, Path] = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        for joint, servo in found.servos.items():
            servo.save(places[f"{stems[joint]}.toml"], overwrite=True)
        places[SUMMARY].write_bytes((json_text(told) + "\n").encode())
        plotting.save(errors_picture(judged), places[ERRORS])
        write_windows(judged, places)
        pictures = figure(ERRORS, "The same beside ideal actuators.") + figures(
            joint_pages(WINDOWS, len(judged.windows)), "The second of each joint in which the fitted servos are "
            "furthest off, the worst joint first.")
        places[PAGE].write_bytes(arm_page(found, pictures).encode())
