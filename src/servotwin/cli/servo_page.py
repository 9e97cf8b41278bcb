"""A servo as a table: every parameter with value, unit, origin, spread and source."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.cli.terminal import table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.parameters import Servo


def heading(servo: Servo) -> list[RenderableType]:
    """Return title, kind, notes and flags of a servo."""
    from servotwin.parameters import printed_flags

    said = printed_flags(servo)
    return [f"{servo.title} ({servo.name}), {servo.kind}", " ".join(servo.notes.split()),
            *([f"flags: {'; '.join(said)}"] if said else [])]


def figures(facts: dict[str, Any]) -> list[RenderableType]:
    """Return the stall torque of the sheet and that of the twin, as `servo_facts.headline` tells them."""
    said = [f"{facts[key]:.3g} N m {words}" for key, words in (
        ("stall_torque", "by the sheet"), ("twin_stall_torque", "by these parameters")) if facts[key] is not None]
    at = f" at {facts['supply_voltage']:.3g} V" if facts["supply_voltage"] is not None else ""
    return [f"stall torque{at}: {', '.join(said)}"] if said else []


def parameter_table(rows: list[dict[str, Any]]) -> list[RenderableType]:
    """Return parameters and sources of a servo, as `servo_facts.parameters` tells them."""
    sources = list(dict.fromkeys(row["source"] for row in rows if row["source"]))
    lines: list[tuple[str, ...]] = []
    group = ""
    for row in rows:
        table_name, _, key = row["name"].partition(".")
        if table_name != group:
            lines.append((table_name, *[""] * 5))
            group = table_name
        source = f"[{sources.index(row['source']) + 1}]" if row["source"] else ""
        lines.append((f"  {key}", _value(row["value"]), row["unit"], row["origin"], row["spread"], source))
    return [table(("parameter", "value", "unit", "origin", "spread", "source"), lines), "",
            *[f"[{k}] {source}" for k, source in enumerate(sources, start=1)]]


def _value(value: Any) -> str:
    return ", ".join(f"{x:z.5g}" for x in value) if isinstance(value, list) else (
        value if isinstance(value, str) else f"{value:z.5g}")
