"""`servotwin catalog registers`: what the registers of a model of bus servo hold, and which page prints it."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from servotwin.cli.terminal import emit_json, pairs, show, table


def registers(
    model: Annotated[str | None, typer.Argument(
        metavar="MODEL", help="A model such as XL330-M288; none: all models, and how many values are assumed.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show the registers of bus servos."""
    if model is None:
        _all(as_json=as_json)
    else:
        _one(model, as_json=as_json)


def _all(*, as_json: bool) -> None:
    from servotwin.parameters.registers.listing import listed_models

    found = [{"family": each.family, "model": each.name, "number": each.number, "registers": each.rows,
              "assumed": each.assumed, "page": each.page} for each in listed_models()]
    if as_json:
        emit_json(found)
        return
    rows = [(str(each["family"]), str(each["model"]), str(each["number"]), str(each["registers"]),
             str(each["assumed"]), str(each["page"]) or "none was seen") for each in found]
    show(table(("family", "model", "number", "registers", "assumed", "page"), rows))


def _one(name: str, *, as_json: bool) -> None:
    from servotwin.parameters.registers.listing import listed_model, rows_of

    model = listed_model(name)
    rows: list[dict[str, Any]] = [row._asdict() for row in rows_of(model)]
    facts = {"family": model.family, "model": model.name, "number": model.number, "registers": model.rows,
             "assumed": model.assumed, "page": model.page}
    if as_json:
        emit_json({**facts, "rows": rows})
        return
    show(pairs([("family", model.family), ("model number", str(model.number)), ("page", model.page or "none was seen"),
                ("registers", f"{model.rows}, {model.assumed} of them assumed")]), "",
         table(("address", "register", "new", "range", "printed in"),
               [(str(row["address"]), row["name"], str(row["value"]), f"{row['lower']} to {row['upper']}",
                 row["document"] or "assumed") for row in rows]))
