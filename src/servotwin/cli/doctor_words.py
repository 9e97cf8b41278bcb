"""A diagnosis as rows of text, and as facts for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.cli.rest_words import rest_words
from servotwin.cli.terminal import pairs, table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.diagnosis import Cause, Diagnosis, Finding, Looked, Measured
    from servotwin.diagnosis.brown_out import BrownOut

_COMMANDS = {"wide": "in a step of 60 deg", "small": "in a step of 3 deg", "given": "in the run"}


def facts(found: Diagnosis, *, command: str | None, load: str, log: str | None) -> dict[str, Any]:
    """Return a diagnosis in SI, ready for JSON."""
    from servotwin.cli.summary import model_name

    return {
        "servo": found.model.servo.name, "title": found.model.servo.title, "model": model_name(found.model),
        "command": command or ("of the log" if log else "steps of 60 and of 3 deg"), "load": load, "log": log,
        "findings": [_finding(each) for each in found.findings],
        "log_only": list(found.log_only), "untold": list(found.untold),
        "looked_at": None if found.looked is None else found.looked._asdict(),
        "thresholds": {each.symptom.name: {
            "threshold": each.symptom.threshold, "source": each.symptom.source, "run": each.run._asdict(),
            "log": None if each.log is None else each.log._asdict(), "near": each.near} for each in found.measured},
    }


def _finding(found: Finding) -> dict[str, Any]:
    return {
        "symptom": found.symptom.name, "words": seen_words(found), "value": found.run.value, "limit": found.run.limit,
        "command": found.command, "log": None if found.log is None else found.log._asdict() | {
            "found": found.log.found},
        "causes": [_cause(each) for each in found.causes],
        "pair": None if found.pair is None else [_cause(each) for each in found.pair],
        "together": [each.cause for each in found.together],
    }


def _cause(cause: Cause) -> dict[str, Any]:
    said = {name: value for name, value in cause._asdict().items() if name != "number"}
    return said | {"cure": cause.cure}


def seen_words(found: Finding) -> str:
    """Return how a symptom shows, in the units of people."""
    record, value, limit = found.record, found.run.value, found.run.limit
    rest = record.rest
    said = {
        "trips": f"by {record.trip}",
        "does not move": f"{100.0 * value:.0f} % of the way is missing",
        "buzzes": "" if rest is None else rest_words(rest._replace(current=math.nan)).split(", nan A")[0],
        "overshoots": f"by {100.0 * value:.0f} % of the step",
        "sags": f"stands {math.degrees(value):.1f} deg off, {math.degrees(limit):.1f} allowed",
        "gets warm": f"{value:.0f} K above the air after ten minutes, {limit:.0f} allowed",
    }[found.symptom.name]
    return ", ".join(filter(None, (said, _COMMANDS[found.command])))


def parts(found: Diagnosis, said: dict[str, Any], *, verbose: bool) -> list[RenderableType]:
    """Return a diagnosis as it is shown: what was looked at, symptoms, causes with their cures, and thresholds.

    Of the thresholds those that run or log come near; if `verbose`, all.
    """
    from servotwin.datasheet import thermal_masses

    head = f"{said['title']} ({said['servo']}), model {said['model']}; {said['command']}; load {said['load']}"
    shown: list[RenderableType] = [head]
    if found.looked is not None:
        shown.append(_looked_words(found.looked))
    for each in found.findings:
        shown += ["", *_shown(each)]
    if any(each.causes for each in found.findings):
        shown += ["", "cured: which part of it goes with this change alone; *: not usual"]
    if not found.findings:
        where = " in the run" if found.log_only else ", in run and log" if said["log"] else ""
        shown += ["", f"nothing found{where}"]
    if found.log_only:
        shown += ["", f"! the log shows that it {' and '.join(found.log_only)}, this servo as given does not: say what "
                      "hangs on it and what feeds it (--load, --set), fit its file (servotwin fit), or see "
                      "whether the log is at fault (servotwin log)"]
    if found.untold:
        shown += ["", f"cannot be told here: {', '.join(found.untold)}"]
    masses = thermal_masses(found.model.servo)
    if masses is not None and masses.assumed and any(
            each.symptom.name == "gets warm" and not math.isnan(each.run.value) for each in found.measured):
        shown += ["", "thermal numbers assumed by the servo's mass"]
    told = [each for each in found.measured if verbose or each.near]
    if not told:
        return [*shown, "", "no threshold is near, half of it or more; --verbose prints them all"]
    return [*shown, "", "thresholds" if verbose else "thresholds that are near, half of them or more (--verbose: all)",
            pairs([(each.symptom.name, _threshold_words(each)) for each in told])]


def _looked_words(looked: Looked) -> str:
    part = (f"all {looked.whole:.1f} s" if looked.seconds >= looked.whole else
            f"the first {looked.seconds:.1f} of {looked.whole:.1f} s")
    if not looked.stretches:
        return f"looked at {part} of the log: its target never stands still for half a second, or its noise is not told"
    moves = looked.stretches - looked.rests
    return (f"looked at {part} of the log: the target rests for half a second or more {looked.stretches} times, the "
            f"shaft at the end of {looked.rests}" + (f" (of {moves} it is still on its way)" if moves else "")
            + f"; fast swings of less than {math.degrees(looked.swing):.2f} deg are not told from noise")


def _threshold_words(one: Measured) -> str:
    """Return how near run and log come to a threshold, in the units of people, and what that is."""
    symptom = one.symptom
    judged = {"the run": one.run} | ({} if one.log is None else {"the log": one.log})
    near = [f"{figure(symptom.factor * each.value)} of {figure(symptom.factor * each.limit)} {symptom.unit} in {name}"
            for name, each in judged.items() if math.isfinite(each.value) and each.limit > 0.0]
    return "; ".join([*near, f"{symptom.threshold} ({symptom.source})"])


def _shown(found: Finding) -> list[RenderableType]:
    log = ""
    if found.log is not None:
        log = "" if math.isnan(found.log.value) else "; the log shows it too" if found.log.found else (
            "; the log does not show it")
    lines: list[RenderableType] = [f"{found.symptom.name}: {seen_words(found)}{log}"]
    if found.causes:
        lines.append(table(("cause", "cure", "cured", "now, and what is usual"), [
            (each.cause, each.cure, "all" if each.cures else f"{100.0 * each.share:.0f} %", _usual(each))
            for each in found.causes]))
    if found.pair is not None:
        one, other = found.pair
        lines.append(f"only together: {one.cause} ({one.cure}) and {other.cause} ({other.cure})")
    elif not found.causes:
        lines.append("no cause of the table takes any of it away")
    if found.together:
        lines.append(f"{' and '.join(each.cause for each in found.together)} act together: either cure will do")
    return lines


def figure(value: float) -> str:
    """Return a number of three digits as people write it.

    Examples
    --------
    >>> figure(2500.0), figure(0.12345), figure(1e-7)
    ('2500', '0.123', '1e-07')
    """
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def _usual(cause: Cause) -> str:
    number = cause.number
    low, high = (figure(number.factor * value) for value in cause.usual)
    now = figure(number.factor * cause.now)
    return f"{now}, {low} to {high} {number.unit}".strip() + ("" if cause.odd == 1.0 else " *")


def board_facts(found: BrownOut) -> dict[str, Any]:
    """Return what a board on the supply does, in SI, ready for JSON."""
    return {**found.board._asdict(), "outcome": found.outcome, "voltage": found.voltage, "time": found.time,
            "log": None if found.log_outcome is None else {
                "outcome": found.log_outcome, "voltage": found.log_voltage, "time": found.log_time},
            "cures": [cure._asdict() for cure in found.cures]}


def board_parts(found: BrownOut) -> list[RenderableType]:
    """Return the same as it is shown."""
    board = found.board
    seen = [("the run", found.outcome, found.voltage, found.time)]
    if found.log_outcome is not None:
        seen.append(("the log", found.log_outcome, found.log_voltage, found.log_time))
    rows = [(f"in {where}", f"{outcome}: {volts:.2f} V at least, at {time:.3g} s")
            for where, outcome, volts, time in seen]
    rows += [("cure", cure.words + ("" if math.isnan(cure.voltage) else f" ({cure.voltage:.2f} V at least)"))
             for cure in found.cures]
    if found.cures:
        rows.append(("capacitor", "no cure: the start of a motor takes some 4 mC (0.2 A for 20 ms), for which 470 uF "
                     "fall by 8.5 V; it takes spikes under a millisecond"))
    return ["", f"browns out? {board.title}: its 5 V pin needs {board.lower:.3g} to {board.upper:.3g} V "
            f"({board.source})", pairs(rows)]
