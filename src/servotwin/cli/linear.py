"""`servotwin linear`: a servo where it is linear, how far from that it is, and the gain that it should have."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import usual, with_records
from servotwin.cli.terminal import emit_json, pairs, patience, show, show_report
from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.cli.output_files import Target
    from servotwin.linear import Tuning
    from servotwin.linear.overview import Overview
    from servotwin.loads import Load
    from servotwin.models import Model

_MODELS = ("digital", "pulse", "pulse-inductive", "bounded", "averaged", "averaged-inductive")
_ENDINGS = {"--out": (".html", ".htm"), "--plot": (".png", ".svg", ".pdf"), "--csv": (".csv",)}
_VIEW, _TUNE = "What to compute", "Which gain"


@usual("amplitude", "frame", "tune", "phase-margin", "overshoot", "load", "set", "out", "plot", "force", "json")
@with_records
def linear(
    *,
    servo: shared.ServoArgument,
    amplitude: Annotated[list[str] | None, typer.Option(
        metavar="ANGLE", help="Amplitudes of the simulated sines, such as 1deg,5deg (default: 1, 5 and 20 degrees).",
        rich_help_panel=_VIEW)] = None,
    frame: Annotated[list[str] | None, typer.Option(
        metavar="TIME", help="Frame periods to compare, such as 20ms,10ms,3ms (default: 20, 10 and 5 ms of a pulse "
        "servo); with --tune the one to tune for.", rich_help_panel=_VIEW)] = None,
    angle: Annotated[str | None, typer.Option(
        metavar="ANGLE", help="About which it moves (default: the middle of its travel).",
        rich_help_panel=_VIEW)] = None,
    tune: Annotated[bool, typer.Option(
        "--tune", help="Find the gain for --phase-margin or --overshoot: P of a program, or that of a loop around a "
        "pulse servo.", rich_help_panel=_TUNE)] = False,
    phase_margin: Annotated[str | None, typer.Option(
        metavar="ANGLE", help="Wanted phase margin, at least, such as 50deg.", rich_help_panel=_TUNE)] = None,
    overshoot: Annotated[str | None, typer.Option(
        metavar="PERCENT", help="Wanted overshoot of a simulated step, such as 10%.", rich_help_panel=_TUNE)] = None,
    step: Annotated[str | None, typer.Option(
        metavar="ANGLE", help="Size of that step (default: 10deg).", rich_help_panel=_TUNE)] = None,
    derivative: Annotated[bool, typer.Option(
        "--derivative", help="Look for D too.", rich_help_panel=_TUNE)] = False,
    plant: Annotated[shared.Plant, {
        "model": f"{', '.join(_MODELS)} (default: by the kind of the servo).",
        "load": "Load, such as inertia=1e-3 or pendulum=0.1:0.12; repeatable, or with commas."}],
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.html", help="Write a page with tables and pictures.", rich_help_panel=shared.OUTPUT)] = None,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw gain and phase over frequency: .png, .svg or .pdf.",
        rich_help_panel=shared.OUTPUT)] = None,
    csv: Annotated[Path | None, typer.Option(
        "--csv", metavar="FILE.csv", help="Write gains and phases, a row for each frequency.",
        rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Show the linear views of a servo, or find its gain."""
    from servotwin.cli import linear_report as words

    chosen = plant.of(servo, _MODELS)
    hangs = plant.load_on(chosen)
    words.check_together({"--amplitude": amplitude, "--angle": angle, "--phase-margin": phase_margin,
                          "--overshoot": overshoot, "--step": step, "--derivative": derivative or None}, tune=tune)
    asked = {"amplitudes": []} if tune else words.asked(chosen, amplitude, frame, angle)
    targets = _targets({"--out": out, "--plot": plot, "--csv": csv}, servo, len(asked["amplitudes"]), tune=tune,
                       force=ending.force)
    if tune:
        wanted = words.wanted(phase_margin=phase_margin, overshoot=overshoot, step=step, frame=frame,
                              derivative=derivative)
        _tune(chosen, hangs, wanted, as_json=ending.as_json)
        return
    found = _computed(chosen, hangs, asked)
    _write(found, targets, force=ending.force)
    facts = words.facts(found) | {"files": [str(target.path) for target in targets]}
    if ending.as_json:
        emit_json(facts)
        return
    name = chosen.servo.name
    show_report(f"{chosen.servo.title or name} ({name}), model {type(chosen).__name__}", words.report(found),
                *(["", pairs([("written", str(target.path)) for target in targets])] if targets else []))


def _targets(paths: dict[str, Path | None], servo: str, amplitudes: int, *, tune: bool, force: bool) -> list[Target]:
    from servotwin.cli.output_files import Target, check_targets, page_name
    from servotwin.look import CURVES_A_PAGE, pages

    several = {"--plot": pages(amplitudes, CURVES_A_PAGE)}
    targets = [Target(option=option, path=Path(page_name(str(path), page)), endings=_ENDINGS[option], page=page)
               for option, path in paths.items() if path is not None for page in several.get(option, [1])]
    if tune and targets:
        raise InputError(targets[0].option, got=str(targets[0].path), allowed="no file beside --tune, which prints")
    check_targets(targets, force=force, inputs=[Path(servo)])
    return targets


def _computed(model: Model, load: Load, asked: dict[str, Any]) -> Overview:
    from servotwin.linear.overview import overview

    with patience(f"simulating sines of {model.servo.name}"):
        return overview(model, load, **asked)


def _tune(model: Model, load: Load, wanted: dict[str, Any], *, as_json: bool) -> None:
    from servotwin.cli.linear_report import tuning_facts, tuning_pairs
    from servotwin.linear import tune

    with patience(f"simulating steps of {model.servo.name}"):
        found: Tuning = tune(model, load, **wanted)
    if as_json:
        emit_json(tuning_facts(found))
    else:
        show(f"{found.model.servo.title or found.model.servo.name} ({found.model.servo.name})", "",
             pairs(tuning_pairs(found)))


def _write(found: Overview, targets: list[Target], *, force: bool) -> None:
    from servotwin.cli.output_files import staged

    with patience("drawing"), staged(targets, force=force) as drafts:
        for target, draft in zip(targets, drafts, strict=True):
            if target.option == "--out":
                from servotwin.cli.linear_report import report

                draft.write_text(report(found).page, encoding="utf-8", newline="\n")
            elif target.option == "--plot":
                from servotwin import plotting
                from servotwin.cli.linear_report import by_amplitude

                plotting.save(by_amplitude(found, target.page), draft)
            else:
                from servotwin.cli.linear_report import columns
                from servotwin.tables import csv_text

                draft.write_bytes(csv_text(columns(found), digits=12).encode())
