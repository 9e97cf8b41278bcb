"""`servotwin catalog`: which servos there are, what is known of one, and what a servo file gives."""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli.terminal import emit_help, emit_json, pairs, show, table

if TYPE_CHECKING:
    from servotwin.parameters import Servo

_Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]

catalog = typer.Typer(
    help="Servos that come with servotwin, and checking a servo file.",
    epilog="Example: servotwin catalog show hitec-hs-755hb")


@catalog.callback(invoke_without_command=True)
def _catalog(context: typer.Context) -> None:
    """Show the help where nothing is asked."""
    if context.invoked_subcommand is None:
        emit_help(context)


@catalog.command("list", help="List the servos of the catalog.", epilog="Example: servotwin catalog list --json")
def list_servos(as_json: _Json = False) -> None:
    """List the servos of the catalog."""
    from servotwin.cli.servo_facts import headline
    from servotwin.parameters import catalog_names, load_servo

    found = [headline(load_servo(name)) for name in catalog_names()]
    if as_json:
        emit_json(found)
        return
    rows = [(servo["id"], servo["title"], _number(servo["supply_voltage"], "{:.3g} V"),
             _number(servo["stall_torque"], "{:.3g} N m"), _number(servo["speed"], "{:.3g} deg/s")) for servo in found]
    show(table(("id", "title", "at", "torque", "speed"), rows))


@catalog.command("show", help="Show every parameter of a servo and its source.",
                 epilog="Example: servotwin catalog show hitec-hs-755hb")
def show_servo(
    servo: Annotated[str, typer.Argument(metavar="ID", help="Id in the catalog, or path of a servo file (.toml).")],
    as_json: _Json = False,
) -> None:
    """Show every parameter of a servo."""
    from servotwin.cli.servo_facts import headline, parameters
    from servotwin.parameters import load_servo

    loaded = load_servo(servo)
    found = parameters(loaded)
    if as_json:
        emit_json({**headline(loaded), "notes": loaded.notes.strip(), "parameters": found})
        return
    sources = list(dict.fromkeys(row["source"] for row in found if row["source"]))
    rows: list[tuple[str, ...]] = []
    group = ""
    for row in found:
        table_name, _, key = row["name"].partition(".")
        if table_name != group:
            rows.append((table_name, *[""] * 5))
            group = table_name
        source = f"[{sources.index(row['source']) + 1}]" if row["source"] else ""
        rows.append((f"  {key}", _value(row["value"]), row["unit"], row["origin"], row["spread"], source))
    show(f"{loaded.title} ({loaded.name})", " ".join(loaded.notes.split()), "",
         table(("parameter", "value", "unit", "origin", "spread", "source"), rows, wraps="spread"), "",
         *[f"[{k}] {source}" for k, source in enumerate(sources, start=1)])


@catalog.command("check", help="Check a servo file, and which models it can run.",
                 epilog="Example: servotwin catalog check my-servo.toml")
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A servo file (.toml).")],
    as_json: _Json = False,
) -> None:
    """Check a servo file."""
    from servotwin.cli.servo_facts import readiness
    from servotwin.parameters import load_servo

    servo = load_servo(file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        models = readiness(servo)
    found = {
        "file": str(file), "id": servo.name, "title": servo.title, "parameters": len(servo.names()),
        "origins": dict(Counter(servo.source(name).origin for name in servo.names())), "models": models,
        "warnings": list(dict.fromkeys(str(warning.message) for warning in caught)),
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
    show(f"{found['file']}: {servo.title} ({servo.name}), a valid servo file",
         pairs([("parameters", f"{found['parameters']} ({origins})"),
                *[(group, ", ".join(keys)) for group, keys in given.items()]]),
         "models",
         pairs([(name, _ready(model)) for name, model in found["models"].items()]),
         *[f"warning: {text}" for text in found["warnings"]])


def _ready(model: dict[str, Any]) -> str:
    if not model["runs"]:
        return "cannot run: " + (f"lacks {', '.join(model['lacks'])}" if model["lacks"] else model["problem"])
    return "runs" + (f", {len(model['ignored'])} parameters not read" if model["ignored"] else "")


def _number(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _value(value: Any) -> str:
    return ", ".join(f"{x:.5g}" for x in value) if isinstance(value, list) else (
        value if isinstance(value, str) else f"{value:.5g}")
