"""`servotwin doctor`: why a servo buzzes, sags, overshoots, gets warm, trips or does not move; or this installation."""

from __future__ import annotations

import math
import os
import platform
import re
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.log import Reading
from servotwin.cli.option_records import LEFT_OUT, usual, with_records
from servotwin.cli.terminal import emit_json, pairs, patience, show, table
from servotwin.errors import CommandError, InputError
from servotwin.logs.formats import MENDS

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.diagnosis import Cause, Diagnosis, Finding, Looked, Measured
    from servotwin.diagnosis.api import BrownOut
    from servotwin.logs import Log
    from servotwin.models import Model


# --- A diagnosis as rows of text, and as facts for JSON ---------------------------------------------------------------

_COMMANDS = {"wide": "in a step of 60 deg", "small": "in a step of 3 deg", "given": "in the run"}


def diagnosis_facts(found: Diagnosis, *, command: str | None, load: str, log: str | None) -> dict[str, Any]:
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
    from servotwin.cli.summary import rest_words

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


def diagnosis_parts(found: Diagnosis, said: dict[str, Any], *, verbose: bool) -> list[RenderableType]:
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


# --- The installation -------------------------------------------------------------------------------------------------

_NOT_FOR_USERS = {"all", "dev", "docs", "test", "test-web", "lint", "wheels", "peers"}
_FOR = {
    "data": "results as pandas and xarray, datasets of LeRobot", "sweep": "workers of a dask scheduler",
    "robots": "MuJoCo, Gymnasium, robot", "video": "angles from videos", "bench": "boards and servos on a bus",
    "web": "the bench in a browser", "mpc": "predictive control", "compile": "a compiler, where there is none",
    "learn": "policies", "export": "checks of exported models",
}


def installation_facts() -> dict[str, Any]:
    """Return what is installed, ready for JSON.

    Examples
    --------
    >>> found = installation_facts()
    >>> found["servotwin"], found["backend"] in ("c", "plain"), "data" in found["extras"]
    ('0.1.0', True, True)
    """
    from servotwin import __version__, plugins
    from servotwin.simulation.compile import backend, finding

    found = [compiler.command for compiler in finding.compilers()]
    shipped = [*finding.shipped_folder().glob("*")]
    plain = backend.is_plain() or not (found or shipped)
    return {
        "servotwin": __version__, "python": platform.python_version(), "system": platform.platform(),
        "processors": os.cpu_count(), "level": finding.level(),
        "packages": {name: _version(name) for name in ("numpy", "scipy", "matplotlib", "control")},
        "backend": "plain" if plain else "c", "compilers": [" ".join(command) for command in found],
        "shipped_kernels": len(shipped), "cache": _cache(), "extras": _extras(), "plugins": plugins.named(),
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _cache() -> dict[str, Any]:
    """Return where compiled kernels are kept, why they are not loaded from there, how many, and their size [bytes]."""
    from servotwin.simulation.compile import storage

    folder = storage.cache_folder()
    files = [path for path in folder.glob("*") if path.is_file()] if folder.is_dir() else []
    return {"folder": str(folder), "distrust": storage.distrust(folder), "files": len(files),
            "bytes": sum(path.stat().st_size for path in files)}


def _extras() -> dict[str, list[str]]:
    """Return the packages that each extra lacks."""
    lacking: dict[str, list[str]] = {}
    for text in metadata.requires("servotwin") or []:
        extra = re.search(r"extra == ['\"]([^'\"]+)['\"]", text)
        if extra is None or extra[1] in _NOT_FOR_USERS:
            continue
        name = re.match(r"[A-Za-z0-9._-]+", text)
        missing = lacking.setdefault(extra[1], [])
        if name is not None and _version(name[0]) is None:
            missing.append(name[0])
    return lacking


def installation_parts(found: dict[str, Any]) -> list[RenderableType]:
    """Return what is installed as it is shown."""
    packages = ", ".join(f"{name} {version or 'missing'}" for name, version in found["packages"].items())
    cache = found["cache"]
    rows = [
        ("servotwin", f"{found['servotwin']}, Python {found['python']}, {found['system']}"),
        ("packages", packages),
        ("processor", f"{found['processors']} cores, {found['level']}"),
        ("kernels", _kernels(found)),
        ("compiler", found["compilers"][0] if found["compilers"] else "none"),
        ("cache", f"{cache['folder']}, {cache['files']} files, {cache['bytes'] / 1e6:.1f} MB"
         + (f"; not used, for {cache['distrust']}" if cache["distrust"] else "")),
    ]
    added = [f"{name} ({group.replace('_', ' ')})" for group, names in found["plugins"].items() for name in names]
    rows += [("plug-ins", ", ".join(added))] if added else []
    extras = [(name, "yes" if not lacking else "no", _FOR.get(name, ""),
               f'pip install "servotwin[{name}]"' if lacking else "") for name, lacking in found["extras"].items()]
    return [pairs(rows), "", table(("extra", "here", "for", "to have it"), extras)]


def _kernels(found: dict[str, Any]) -> str:
    if found["backend"] == "plain":
        return ("in plain Python, slow where many servos run" if os.environ.get("SERVOTWIN_BACKEND") == "plain" else
                'in plain Python, for there is no compiler: pip install "servotwin[compile]"')
    many = found["shipped_kernels"]
    return f"compiled (C), {f'{many} files came with the package' if many else 'when needed'}"


# --- `servotwin doctor`: why a servo buzzes, sags, overshoots, gets warm, trips or does not move; or this -------------

_LOOKED_AT = 2.0  # s in which a board is looked at
_LONGEST = 60.0  # s, without a log: every cause asks for a run of as much
_MODELS = ("digital", "pulse", "pulse-inductive", "bounded")


@usual("step", "load", "set", "supply", "board", "json")
@with_records
def doctor(
    *,
    servo: Annotated[str | None, typer.Argument(
        help="Catalog id, or path of a servo file (.toml); none: look at this installation.")] = None,
    log: Annotated[Path | None, typer.Argument(
        metavar="LOG", help="A log of this servo: the symptoms are looked for in it too, and its command is run.")]
    = None,
    words: shared.CommandWords,
    plant: Annotated[shared.Plant, {
        "load": "Load on the shaft, as of simulate: torque=0.5kgf.cm, inertia=1e-4, arm=0.5kg:10cm; repeatable or with "
        "commas.",
        "change": "Change or add a parameter, such as supply.internal_resistance=2ohm; repeatable; with a unit, or in "
        "SI units."}],
    board: Annotated[str | None, typer.Option(
        metavar="BOARD", help="Say whether a board on the same supply browns out, and what would keep it running: uno, "
        "nano, esp32 (with an AMS1117) or esp32-ldo.", rich_help_panel=shared.PLANT)] = None,
    seed: shared.SeedOption = 0,
    duration: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Time to simulate (default 6, or more where a protection waits longer); of a log, how "
        "much of it is looked at (default all).",
        rich_help_panel=shared.OUTPUT)] = None,
    reading: Annotated[Reading, {
        "joint": LEFT_OUT, "raw": LEFT_OUT, "leave_out": LEFT_OUT,
        "mend": f"What to put right in the log's file first: {', '.join(MENDS)}; repeatable or with commas."}],
    verbose: Annotated[bool, typer.Option(
        "--verbose", help="Print all thresholds, also those that nothing comes near.", rich_help_panel=shared.OUTPUT)]
    = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Say why a servo buzzes, sags, overshoots, gets warm, trips or does not move; alone: look at this installation."""
    if servo is None:
        _look_at_installation(given=words != shared.CommandWords() or plant != shared.Plant()
                              or bool(duration or verbose or board), as_json=as_json)
        return
    made = plant.of(servo, _MODELS)
    read = None if log is None else _log(log, lambda: reading.logs(
        [log], made, registers=bool(plant.register), quiet=as_json))
    _diagnose(made, read, words, plant, duration, seed, board=board, verbose=verbose, as_json=as_json)


def _look_at_installation(*, given: bool, as_json: bool) -> None:
    if given:
        raise InputError("doctor", got="options of a servo, but no servo", allowed="a catalog id or a servo file first")
    found = installation_facts()
    if as_json:
        emit_json(found)
        return
    show(*installation_parts(found))


def _log(path: Path, read: Callable[[], list[Log]]) -> Log:
    logs = read()
    if len(logs) != 1:
        raise InputError(str(path), got=f"{len(logs)} logs", allowed="one: servotwin log with --out FILE.csv writes "
                         "each to a file of its own, FILE-1.csv and so on")
    return logs[0]


def _diagnose(made: Model, log: Log | None, words: shared.CommandWords, plant: shared.Plant, duration: float | None,
              seed: int, *, board: str | None, verbose: bool, as_json: bool) -> None:
    from servotwin.cli import option_values
    from servotwin.diagnosis import diagnose
    from servotwin.loads import Load

    longest = _LONGEST if log is None else max(_LONGEST, log.duration)
    if duration is not None and not (math.isfinite(duration) and 0.0 < duration <= longest):
        raise InputError("--duration", got=duration, allowed=f"a positive number of seconds up to {longest:g}")
    if log is not None and words != shared.CommandWords():
        raise CommandError("a command beside a log", got=f"--{words.shape}", allowed="one of them: a log has its own")
    signal = None if words == shared.CommandWords() else words.signal(duration or _LONGEST)
    with patience("taking causes away"):
        found = diagnose(made, signal, load=plant.load_on(made), duration=duration, log=log, seed=seed)
    facts = diagnosis_facts(found, command=None if signal is None else words.described(duration or _LONGEST),
                               load=option_values.described(plant.load), log=None if log is None else log.name)
    more = []
    if board is not None:
        from servotwin.diagnosis.api import brown_out

        own = plant.load_on(made)
        seen = brown_out(made, signal, board, log=log, load=own if log is None or own != Load() else log.load,
                         duration=duration or (_LOOKED_AT if log is None else log.duration))
        facts["board"] = board_facts(seen)
        more = board_parts(seen)
    if as_json:
        emit_json(facts)
        return
    show(*diagnosis_parts(found, facts, verbose=verbose), *more)
