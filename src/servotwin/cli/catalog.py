"""`servotwin catalog`: which servos there are, what is known of one, and what a servo file gives."""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli.catalog_registers import registers
from servotwin.cli.catalog_which import which
from servotwin.cli.from_sheet import from_sheet
from servotwin.cli.terminal import emit_help, emit_json, pairs, patience, show, table

if TYPE_CHECKING:
    from servotwin.parameters import Servo

_TELLING = ("impossible", "sources disagree", "digital", "bus", "currents unknown", "stall current unknown",
            "running current unknown")  # what a list has room for
_Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]

catalog = typer.Typer(
    help="List and show the servos that come with servotwin; make and check servo files.",
    epilog="Example: servotwin catalog show hitec-hs-755hb")


@catalog.callback(invoke_without_command=True)
def _catalog(context: typer.Context) -> None:
    """Show the help where nothing is asked."""
    if context.invoked_subcommand is None:
        emit_help(context)


@catalog.command("list", help="List the servos in the catalog.", epilog="Example: servotwin catalog list --json")
def list_servos(as_json: _Json = False) -> None:
    """List the servos of the catalog."""
    from servotwin.cli.servo_facts import headline
    from servotwin.parameters import catalog_names, load_servo

    with patience("reading the catalog"):
        found = [headline(load_servo(name)) for name in catalog_names()]
    if as_json:
        emit_json(found)
        return
    rows = [(servo["id"], servo["title"], _number(servo["supply_voltage"], "{:.3g} V"),
             _number(servo["stall_torque"], "{:.3g} N m"),
             _number(servo["twin_stall_torque"], "{:.3g} N m"), _number(servo["speed"], "{:.0f} deg/s"),
             _brief(servo["flags"])) for servo in found]
    show(table(("id", "title", "at", "torque", "of twin", "speed", "flags"), rows))


@catalog.command("show", help="Show every parameter of a servo and its source.",
                 epilog="Example: servotwin catalog show hitec-hs-755hb")
def show_servo(
    servo: Annotated[str, typer.Argument(metavar="ID", help="Catalog id, or path of a servo file (.toml).")],
    as_json: _Json = False,
) -> None:
    """Show every parameter of a servo."""
    from servotwin.cli.servo_facts import headline, parameters
    from servotwin.cli.servo_page import figures, heading, parameter_table
    from servotwin.parameters import load_servo

    loaded = load_servo(servo)
    facts, found = headline(loaded), parameters(loaded)
    if as_json:
        emit_json({**facts, "notes": loaded.notes.strip(), "parameters": found})
        return
    show(*heading(loaded), *figures(facts), "", *parameter_table(found))


@catalog.command("check", help="Check a servo file and say which models it can run.",
                 epilog="Example: servotwin catalog check my-servo.toml")
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A servo file (.toml).")],
    as_json: _Json = False,
) -> None:
    """Check a servo file."""
    from servotwin.cli.servo_facts import readiness
    from servotwin.datasheet.rotor import slow_rotor
    from servotwin.parameters import load_servo

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        servo = load_servo(file)
        models = readiness(servo)
    slow = slow_rotor(servo)
    found = {
        "file": str(file), "id": servo.name, "title": servo.title, "kind": servo.kind, "parameters": len(servo.names()),
        "origins": dict(Counter(servo.source(name).origin for name in servo.names())), "models": models,
        "warnings": [*dict.fromkeys(str(warning.message) for warning in caught), *([slow] if slow is not None else [])],
    }
    if as_json:
        emit_json(found)
    else:
        _show_check(servo, found)


def _show_check(servo: Servo, found: dict[str, Any]) -> None:

    origins = ", ".join(f"{count} {origin}" for origin, count in found["origins"].items()) or "none"
    given: dict[str, list[str]] = {}
    for name in servo.names():
        group, _, key = name.partition(".")
        given.setdefault(group, []).append(key)
    show(f"{found['file']}: {servo.title} ({servo.name}), a valid file of a servo of kind {servo.kind}",
         pairs([("parameters", f"{found['parameters']} ({origins})"),
                *[(group, ", ".join(keys)) for group, keys in given.items()]]),
         "models",
         pairs([(name, _ready(model)) for name, model in found["models"].items()]),
         *[f"warning: {text}" for text in found["warnings"]])


def _ready(model: dict[str, Any]) -> str:
    if not model["runs"]:
        return "cannot run: " + (f"lacks {', '.join(model['lacks'])}" if model["lacks"] else model["problem"])
    return "runs" + (f", {len(model['ignored'])} parameters not read" if model["ignored"] else "")


def _brief(flags: list[str]) -> str:
    """Return the flags that matter most when one looks for a servo, each in a word or two."""
    short = (flag.partition(":")[0].replace("current not given", "current unknown").replace(
        "no current given", "currents unknown") for flag in flags)
    return "; ".join(dict.fromkeys(flag for flag in short if flag in _TELLING))


def _number(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


catalog.command("from-sheet", help="Make a servo file from a data sheet.", epilog=(
    'Example: servotwin catalog from-sheet --name my-servo --torque "13.2 kgf.cm" --speed "0.23 s/60deg" '
    '--running-current "285 mA" --at 6V --deadband "8 us" --out my-servo.toml\n\n'
    "Example: servotwin catalog from-sheet --csv sheets.csv --out my-catalog"))(from_sheet)
catalog.command("registers", help="Show what the registers of a model of bus servo hold when it is new, and which page "
                "prints it.", epilog="Example: servotwin catalog registers XL330-M288")(registers)
catalog.command("which", help="Which servo: those that lift a mass, follow a motion or keep limits, side by side, "
                "and why the others do not.", epilog=(
    "Example: servotwin catalog which --lift 0.5kg --arm 10cm --voltage 5 --time 0.3\n\n"
    "Example: servotwin catalog which --lift 50g --arm 8cm --supply usb "
    "--among towerpro-sg90,towerpro-mg90s,hitec-hs-422\n\n"
    "Example: servotwin catalog which --robot arm.xml --motion wave.csv --limit mass=60g,current=1A"))(which)
