"""`servotwin catalog which`: the servos of the catalog that lift a mass."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli.terminal import emit_json, patience, show, table

if TYPE_CHECKING:
    from servotwin.datasheet import Lifter, Lifters

_WHY = {"torque": "lack the torque", "time": "are too slow", "voltage": "are not for this voltage"}


def which(
    lift: Annotated[str, typer.Option(metavar="MASS", help="Mass to lift, such as 0.5kg, 120g, 4oz or 1lb.")],
    arm: Annotated[str, typer.Option(metavar="LENGTH", help="Length of the arm, such as 10cm, 80mm or 4in.")],
    voltage: Annotated[str, typer.Option(metavar="VOLTS", help="Supply voltage.")] = "6",
    time: Annotated[str | None, typer.Option(
        metavar="SECONDS", help="Longest time allowed for 60 degrees, from 30 below the horizontal to 30 above.")]
    = None,
    why: Annotated[bool, typer.Option("--why", help="Also list the servos that cannot, and why.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in SI units.")] = False,
) -> None:
    """List the servos of the catalog that lift a mass on an arm at all angles, lightest first."""
    from servotwin.cli.lift_words import asked_lift
    from servotwin.datasheet import servos_that_lift
    from servotwin.units.quantities import quantity

    mass, length = asked_lift(lift, arm) or (math.nan, math.nan)
    volts = quantity("--voltage", voltage, "voltage", bare=True, positive=True)
    longest = None if time is None else quantity("--time", time, "time", bare=True, positive=True)
    with patience("asking the catalog"):
        found = servos_that_lift(mass, length, voltage=volts, time=longest)
    if as_json:
        emit_json(_facts(found))
        return
    within = "" if longest is None else f", 60 deg within {longest:g} s"
    head = f"{1e3 * mass:.4g} g on {1e2 * length:.4g} cm ({found.torque:.3g} N m) at {volts:g} V{within}"
    show(head, *_answer(found), *(["", _refused(found)] if why and found.refused else []))


def _answer(found: Lifters) -> list[Any]:
    count = Counter(each.kind for each in found.refused)
    cannot = ", ".join(f"{count[kind]} {words}" for kind, words in _WHY.items() if count[kind])
    tail = f"{len(found.refused)} cannot: {cannot}" if cannot else "all servos of the catalog can"
    if not found.found:
        return ["no servo of the catalog can", tail]
    rows = [(each.servo.name, _weight(each), f"{each.margin:.2f}", f"{each.most_torque:.3g} N m", f"{each.time:.2f} s",
             "; ".join(each.notes)) for each in found.found]
    return ["", table(("id", "mass", "margin", "lifts", "60 deg in", "note"), rows), "", tail]


def _weight(each: Lifter) -> str:
    return "unknown" if math.isnan(each.mass) else f"{1e3 * each.mass:.4g} g"


def _refused(found: Lifters) -> Any:
    return table(("cannot", "why"), [(each.servo.name, each.reason) for each in found.refused])


def _facts(found: Lifters) -> dict[str, Any]:
    return {
        "torque": found.torque, "supply_voltage": found.voltage,
        "found": [{"id": each.servo.name, "title": each.servo.title, "mass": each.mass, "margin": each.margin,
                   "most_torque": each.most_torque, "time_60": each.time, "notes": list(each.notes)}
                  for each in found.found],
        "refused": [{"id": each.servo.name, "kind": each.kind, "reason": each.reason} for each in found.refused]}
