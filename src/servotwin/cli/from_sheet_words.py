"""What `servotwin catalog from-sheet` tells of a sheet and of the servo made of it, as facts and as lines."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.cli.span_words import with_span
from servotwin.cli.terminal import pairs, table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.identification import Sheet
    from servotwin.parameters import Servo

_UNCHECKED = "not checked, needs a current"


def sheet_facts(sheet: Sheet, servo: Servo, *, steady: bool = False) -> dict[str, Any]:
    """Return what follows from a sheet, and the servo made of it beside each printed figure, in SI, ready for JSON.

    Parameters
    ----------
    sheet : Sheet
    servo : Servo
        Made of it.
    steady : bool
        Whether to leave out what has to be simulated pulse by pulse.
    """
    from dataclasses import asdict

    from servotwin.cli.servo_facts import headline, parameters
    from servotwin.datasheet.beside import beside_flags, motion_of, printed_beside
    from servotwin.identification import motor_range, sheet_contradictions
    from servotwin.identification.sheets.motor_range import no_load_current_is_known, stall_current_is_known

    motor, contradictions = motor_range(sheet), sheet_contradictions(sheet)
    ranges = {name: asdict(getattr(motor, name)) for name in (
        "resistance", "output_torque_constant", "gear_efficiency", "no_load_current", "coulomb_torque")}
    possible = motor.possible and not contradictions
    checked = stall_current_is_known(sheet) or no_load_current_is_known(sheet)
    beside, motion = printed_beside(servo, steady=steady), None if steady else motion_of(servo)
    head = headline(servo)
    return {**head, "flags": [*head["flags"], *beside_flags(servo, beside, motion)],
            "possible": possible if checked or not possible else None,
            "contradictions": [asdict(one) for one in contradictions],
            "voltages": [point.supply_voltage for point in sheet.main],
            "motor": {**ranges, "drop_voltage": motor.drop_voltage},
            "figures": [{**figure._asdict(), "off": figure.off} for figure in beside],
            "motion": None if motion is None else motion._asdict(), "notes": servo.notes.strip(),
            "parameters": parameters(servo)}


def lines(found: dict[str, Any]) -> list[RenderableType]:
    """Return what the sheet says of the motor, whether it can be true, and what the servo does beside it."""
    names = {"resistance": ("resistance of the motor's circuit", "ohm"),
             "output_torque_constant": ("torque per current, at the output", "N m/A"),
             "gear_efficiency": ("efficiency of the gear", "1"), "no_load_current": ("running current", "A"),
             "coulomb_torque": ("Coulomb friction, at the output", "N m")}
    rows = [(words, f"{found['motor'][name]['value']:z.4g}", unit,
             f"{found['motor'][name]['lower']:z.4g} to {found['motor'][name]['upper']:z.4g}")
            for name, (words, unit) in names.items()]
    volts = ", ".join(f"{v:g} V" for v in found["voltages"])
    possible = {True: "yes", False: "NO", None: _UNCHECKED}[found["possible"]]
    parts: list[RenderableType] = [
        pairs([("voltages", volts), ("possible", possible), ("flags", "; ".join(found["flags"]) or "none")]),
        *[one["text"] for one in found["contradictions"]], "",
        table(("what follows", "value", "unit", "range"), rows)]
    beside = [(figure["name"], f"{figure['voltage']:g} V", f"{figure['printed']:.4g}", f"{figure['simulated']:.4g}",
               figure["unit"], f"{100.0 * figure['off']:+z.0f} %") for figure in found["figures"]]
    if beside:
        parts += ["", table(("printed figure", "at", "printed", "simulated", "unit", "off"), beside)]
    return parts if found["motion"] is None else [*parts, "", pairs(_motion(found["motion"]))]


def ranged(found: dict[str, float]) -> str:
    """Return a value with its range."""
    return f"{found['value']:z.3g} ({found['lower']:z.3g} to {found['upper']:z.3g})"


def _motion(found: dict[str, Any]) -> list[tuple[str, str]]:
    spans = found["spans"]
    passes = ("does not pass 54 deg" if math.isnan(found["passes"]) else
              f"passes 54 deg after {with_span(found['passes'], spans.get('passes'), '.3f', 's')}")
    over = with_span(100.0 * found["overshoot"], spans.get("overshoot"), ".1f", "%", scale=100.0)
    held = ("does not hold it" if math.isnan(found["error"]) else
            f"{with_span(math.degrees(found['error']), spans.get('error'), '.1f', 'deg', scale=math.degrees(1.0))} off")
    said = [("60 deg from rest", f"{passes}, overshoot {over}"), (f"holding {found['torque']:.2g} N m", held)]
    return [*said, ("ranges", "with what is guessed at the ends of its own")] if spans else said
