"""`servotwin export`: servos for programs that have no Python."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import Commands, usual, with_records
from servotwin.cli.terminal import emit_help, emit_json, pairs, patience, show

if TYPE_CHECKING:
    from servotwin.export import CCode

_ACCURACY = 1e-9
_Plant = Annotated[shared.Plant, {
    "model": "digital, pulse, pulse-inductive, bounded, averaged or averaged-inductive (default: by the kind of the "
    "servo).",
    "load": "Load, such as inertia=1e-3 or pendulum=0.1:0.12; repeatable, or with commas."}]

export = Commands(
    help="Write a servo as a program that needs no Python.",
    epilog="Example: servotwin export c hitec-hs-755hb --out firmware")


@export.callback(invoke_without_command=True)
def _export(context: typer.Context) -> None:
    """Show the help where no command is given."""
    if context.invoked_subcommand is None:
        emit_help(context)


@usual("out", "name", "model", "load", "set", "supply", "parameters", "dtype", "force", "json")
@with_records
def c(
    *,
    servo: shared.ServoArgument,
    out: Annotated[Path, typer.Option(
        metavar="DIR", help="Folder for the two files; made where there is none.", rich_help_panel=shared.OUTPUT)],
    name: Annotated[str | None, typer.Option(
        metavar="NAME", help="Of the files, and the beginning of all names in them (default: the servo's).",
        rich_help_panel=shared.OUTPUT)] = None,
    plant: _Plant,
    parameters: Annotated[bool, typer.Option(
        "--parameters", help="Add a function that makes the table of other parameters.",
        rich_help_panel=shared.OUTPUT)] = False,
    accuracy: shared.UsualAccuracyOption = None,
    dtype: Annotated[str, typer.Option(
        metavar="DTYPE", help="float64, or float32: all numbers but times have 32 bits, and angles are good to some "
        "1e-5 rad, of a servo on a bus to some counts.",
        rich_help_panel=shared.OUTPUT)] = "float64",
    ending: shared.Ending,
) -> None:
    """Write a servo as C99: a header and a source."""
    from servotwin.export import c as exported

    chosen = plant.of(servo)
    hangs = plant.load_on(chosen)
    with patience(f"printing {chosen.servo.name}"):
        code = exported(chosen, hangs, name=name, parameters=parameters, accuracy=accuracy, dtype=dtype)
        files = code.write(out, overwrite=ending.force)
    facts = _facts(code) | {"model": type(chosen).__name__, "files": [str(path) for path in files]}
    if ending.as_json:
        emit_json(facts)
        return
    show(pairs([("model", type(chosen).__name__), ("left out", facts["left_out"]),
                *(("written", _sized(path)) for path in files)]))


def _sized(path: Path) -> str:
    """Return a path with the size of its file."""
    return f"{path} ({path.stat().st_size / 1000:.0f} kB)"


def _facts(code: CCode) -> dict[str, Any]:
    return {"name": code.name, "left_out": code.left_out}


export.command("c", help="Write a servo as C99: a header and a source, without allocation or globals.",
               epilog="Example: servotwin export c hitec-hs-755hb --out firmware\n\n"
                      "Example: servotwin export c feetech-sts3215-12v --load inertia=1e-3 --out arm --name elbow")(c)


@usual("out", "fmi", "model", "load", "set", "supply", "sources", "force", "json")
@with_records
def fmu(
    *,
    servo: shared.ServoArgument,
    out: Annotated[Path, typer.Option(metavar="FILE.fmu", help="The archive.", rich_help_panel=shared.OUTPUT)],
    fmi: Annotated[str, typer.Option(metavar="VERSION", help="2.0 or 3.0.", rich_help_panel=shared.OUTPUT)] = "2.0",
    sources: Annotated[bool, typer.Option(
        "--sources", help="Leave the library out: a tool compiles the sources.",
        rich_help_panel=shared.OUTPUT)] = False,
    name: Annotated[str | None, typer.Option(
        metavar="NAME", help="The model identifier (default: the servo's name).",
        rich_help_panel=shared.OUTPUT)] = None,
    plant: _Plant,
    accuracy: shared.AccuracyOption = _ACCURACY,
    ending: Annotated[shared.Ending, {"force": "Replace an existing file."}],
) -> None:
    """Write a servo as an FMU for co-simulation."""
    from servotwin.export import fmu as exported

    chosen = plant.of(servo)
    hangs = plant.load_on(chosen)
    with patience(f"compiling {chosen.servo.name}"):
        made = exported(chosen, hangs, fmi=fmi, name=name, accuracy=accuracy, sources=sources)
        path = made.write(out, overwrite=ending.force)
    of = {kind: [each.name for each in made.variables if each.causality == kind]
          for kind in ("input", "output", "parameter")}
    facts = {"name": made.name, "fmi": made.version, "model": type(chosen).__name__, "inputs": of["input"],
             "outputs": of["output"], "parameters": of["parameter"], "file": str(path)}
    if ending.as_json:
        emit_json(facts)
        return
    show(pairs([("model", type(chosen).__name__), ("FMI", made.version), ("inputs", ", ".join(of["input"])),
                ("outputs", ", ".join(of["output"])), ("parameters", f"{len(of['parameter'])} of the servo file"),
                ("written", _sized(path))]))


export.command("fmu", help="Write a servo as an FMU for co-simulation, FMI 2.0 or 3.0, with library and sources.",
               epilog="Example: servotwin export fmu hitec-hs-755hb --out hs755hb.fmu\n\n"
                      "Example: servotwin export fmu hitec-hs-755hb --load pendulum=0.1:0.12 --fmi 3.0 "
                      "--out pendulum.fmu")(fmu)
