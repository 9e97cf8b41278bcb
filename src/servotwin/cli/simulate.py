"""`servotwin simulate`: one servo, one command, one load."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import usual, with_records
from servotwin.cli.terminal import emit_json, pairs, patience, show
from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.cli.output_files import Target
    from servotwin.models import Model
    from servotwin.signals import Signal
    from servotwin.simulation import Result

_LOOKED_AT = 3.0  # s of a servo that does not rest, for what would stop it
_LONGEST_RANGED = 5.0  # s: beyond it the ranges of guesses would take too long
_MOST_FRAMES = 1e6  # they take an hour, and each is kept for metrics and energy


@usual("step", "sine", "load", "set", "duration", "out", "plot", "force", "json")
@with_records
def simulate(
    *,
    servo: shared.ServoArgument,
    words: shared.CommandWords,
    plant: Annotated[shared.Plant, {
        "model": "digital, pulse, pulse-inductive, bounded, averaged, averaged-inductive, geared-motor or dc-motor "
        "(default: by the kind of the servo, pulse or digital; bounded if its file has no chip).",
        "load": "Load on the shaft, repeatable or with commas, in SI or with a unit: inertia=, viscous=, "
        "torque=0.5kgf.cm, coulomb=; arm=0.5kg:10cm, horizontal in the middle of the travel; SI only: "
        "pendulum=MASS:LENGTH or MASS:LENGTH:HANGING_DEG, spring=STIFFNESS or STIFFNESS:REST_DEG, recorded=FILE.csv "
        "(columns time_s, torque_Nm).",
        "change": "Change a parameter, add one that the servo lacks, such as supply.current_limit=1A; repeatable; with "
        "a unit, or in SI units."}],
    seed: shared.SeedOption = 0,
    duration: shared.DurationOption = 1.5,
    output_step: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Time between output samples (default 0.001); does not change the solution.",
        rich_help_panel=shared.OUTPUT)] = None,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Write all signals.", rich_help_panel=shared.OUTPUT)] = None,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw the response: .png, .svg or .pdf.", rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Simulate one servo under one command and one load."""
    from servotwin.cli import option_values

    targets = _checked_targets(out, plot, servo, words, plant.load, force=ending.force)
    result = _run(plant.of(servo), words, plant, duration, output_step, seed)
    found = _write(result, targets, force=ending.force)
    if duration <= _LONGEST_RANGED:
        found |= _ranges(result, words.signal(duration), found, plant, seed)
    found |= {"remedies": _remedies(result), "command": words.described(duration),
              "load": option_values.described(plant.load), "files": [str(target.path) for target in targets]}
    _report(found, as_json=ending.as_json)


def _checked_targets(out: Path | None, plot: Path | None, servo: str, words: shared.CommandWords, load: Sequence[str],
                     *, force: bool) -> list[Target]:
    from servotwin.cli.option_values import recorded_files
    from servotwin.cli.output_files import Target, check_targets

    targets = []
    if out is not None:
        targets.append(Target(option="--out", path=out, endings=(".csv",)))
    if plot is not None:
        targets.append(Target(option="--plot", path=plot, endings=(".png", ".svg", ".pdf")))
    check_targets(targets, force=force, inputs=[Path(servo), *words.inputs, *recorded_files(load)])
    return targets


def _run(model: Model, words: shared.CommandWords, plant: shared.Plant, duration: float, output_step: float | None,
         seed: int) -> Result:
    from servotwin.simulation import simulate as run

    if not (math.isfinite(duration) and duration > 0.0):
        raise InputError("--duration", got=duration, allowed="a positive number of seconds")
    if output_step is not None and not (math.isfinite(output_step) and output_step > 0.0):
        raise InputError("--output-step", got=output_step, allowed="a positive number of seconds")
    signal = words.signal(duration)
    _check_length(model, signal, duration)
    result = run(model, signal, duration=duration, load=plant.load_on(model), output_step=output_step, seed=seed,
                 progress=True)
    return result.raise_if_failed()


def _check_length(model: Model, signal: Signal, duration: float) -> None:
    """Raise InputError if a run has more frames or ticks than anybody waits for."""
    chip, firmware = model.chip(signal), model.firmware(signal)
    for one, period, what in ((chip, 0.0 if chip is None or signal.edges is not None else chip.frame_period, "frames"),
                              (firmware, 0.0 if firmware is None else firmware.T_c, "ticks")):
        if one is not None and period > 0.0 and duration > _MOST_FRAMES * period:
            raise InputError("--duration", got=duration,
                             allowed=f"at most {_MOST_FRAMES:g} {what} of {1e3 * period:g} ms")


def _write(result: Result, targets: list[Target], *, force: bool) -> dict[str, Any]:
    from servotwin.cli.output_files import staged
    from servotwin.cli.summary import facts

    with patience("writing"), staged(targets, force=force) as drafts:
        for target, draft in zip(targets, drafts, strict=True):
            if target.option == "--out":
                result.save(draft)
            else:
                from servotwin import plotting

                plotting.save(plotting.time_response(result), draft)
        return facts(result)


def _remedies(result: Result) -> list[dict[str, Any]]:
    """Return which numbers would bring a servo to rest that does not come there, or buzzes; none of another."""
    from servotwin.datasheet import buzz
    from servotwin.models.switched import SwitchedServo

    rest, model = result.rest, result.model
    if rest is None or not rest.restless or not isinstance(model, SwitchedServo):
        return []
    with patience("looking for what would stop it"):
        found = buzz(model, result.load, result.command, duration=min(result.ended, rest.since + _LOOKED_AT))
    return [remedy._asdict() for remedy in found.remedies]


def _ranges(result: Result, signal: Signal, found: dict[str, Any], plant: shared.Plant, seed: int
            ) -> dict[str, Any]:
    """Return the ranges of what rests on guesses, and these."""
    from servotwin.cli.summary import facts, figures
    from servotwin.datasheet.holding import guesses, spans, variants
    from servotwin.simulation import simulate as run

    others = []
    with patience("simulating with guesses at the ends of their ranges"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # said of the servo as it is
        for each in variants(result.model, rotor=True):
            other = run(each, signal, duration=float(result.time[-1]), load=plant.load_on(each), seed=seed,
                        output_times=[0.0, float(result.time[-1])])
            others.append(figures(facts(other)))
    own = figures(found)
    nowhere = dict.fromkeys(own, math.nan)
    return {"ranges": spans(own, [nowhere | other for other in others]),
            "guessed": list(guesses(result.model, rotor=True))}


def _report(found: dict[str, Any], *, as_json: bool) -> None:
    from servotwin.cli.summary import lines, origin_lines

    if as_json:
        emit_json(found)
        return
    written = [("written", name) for name in found["files"]]
    show(f"{found['title']} ({found['servo']}), model {found['model']}",
         pairs([*lines(found), *origin_lines(found), *written]))
