"""`servotwin doctor`: why a servo buzzes, sags, overshoots, gets warm, trips or does not move; or this installation."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import log_reading
from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, patience, show
from servotwin.logs.mend_names import MENDS

if TYPE_CHECKING:
    from servotwin.cli.command_words import CommandWords
    from servotwin.logs import Log
    from servotwin.models import Model

_LOOKED_AT = 2.0  # s in which a board is looked at
_LONGEST = 60.0  # s, without a log: every cause asks for a run of as much
_MODELS = ("digital", "pulse", "pulse-inductive", "bounded")


def doctor(
    servo: Annotated[str | None, typer.Argument(
        help="Catalog id, or path of a servo file (.toml); none: look at this installation.")] = None,
    log: Annotated[Path | None, typer.Argument(
        metavar="LOG", help="A log of this servo: the symptoms are looked for in it too, and its command is run.")]
    = None,
    step: shared.StepOption = None,
    ramp: shared.RampOption = None,
    sine: shared.SineOption = None,
    chirp: shared.ChirpOption = None,
    prbs: shared.PrbsOption = None,
    constant: shared.ConstantOption = None,
    pulses: shared.PulsesOption = None,
    command: shared.CommandOption = None,
    unit: Annotated[str | None, typer.Option(
        metavar="UNIT", help="Unit of the command: deg (default), rad, us, ms, s, V or mV.",
        rich_help_panel=shared.COMMAND)] = None,
    at: shared.AtOption = None,
    over: shared.OverOption = None,
    hold: shared.HoldOption = None,
    column: shared.ColumnOption = None,
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="digital, pulse, pulse-inductive or bounded (default: by the kind of the servo).",
        rich_help_panel=shared.PLANT)] = None,
    load: Annotated[list[str] | None, typer.Option(
        metavar="PART=VALUE", help="Load on the shaft, as of simulate: torque=0.5kgf.cm, inertia=1e-4, "
        "arm=0.5kg:10cm; repeatable or with commas.", rich_help_panel=shared.PLANT)] = None,
    change: Annotated[list[str] | None, typer.Option(
        "--set", metavar="GROUP.NAME=VALUE", help="Change or add a parameter, such as supply.internal_resistance=2ohm; "
        "repeatable; with a unit, or in SI units.", rich_help_panel=shared.PLANT)] = None,
    register: shared.RegisterOption = None,
    supply: shared.SupplyOption = None,
    board: Annotated[str | None, typer.Option(
        metavar="BOARD", help="Say whether a board on the same supply browns out, and what would keep it running: uno, "
        "nano, esp32 (with an AMS1117) or esp32-ldo.", rich_help_panel=shared.PLANT)] = None,
    seed: Annotated[int, typer.Option(
        metavar="NUMBER", help="Seed for the noise of the potentiometer.", rich_help_panel=shared.PLANT)] = 0,
    duration: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Time to simulate (default 6, or more where a protection waits longer); of a log, how "
        "much of it is looked at (default all).",
        rich_help_panel=shared.OUTPUT)] = None,
    file_format: log_reading.FormatOption = "auto",
    columns: log_reading.ColumnsOption = None,
    rate: log_reading.RateOption = None,
    commanded: log_reading.CommandedOption = None,
    mend: Annotated[list[str] | None, typer.Option(
        metavar="KIND", help=f"What to put right in the log's file first: {', '.join(MENDS)}; repeatable or with "
        "commas.", rich_help_panel=log_reading.PANEL)] = None,
    verbose: Annotated[bool, typer.Option(
        "--verbose", help="Print all thresholds, also those that nothing comes near.", rich_help_panel=shared.OUTPUT)]
    = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Say why a servo buzzes, sags, overshoots, gets warm, trips or does not move; alone: look at this installation."""
    from servotwin.cli.command_words import CommandWords
    from servotwin.cli.model_words import model_of

    words = CommandWords(step=step, ramp=ramp, sine=sine, chirp=chirp, prbs=prbs, constant=constant, pulses=pulses,
                         command=command, unit=unit, at=at, over=over, hold=hold, column=column)
    if servo is None:
        _look_at_installation(given=words != CommandWords() or bool(load or change or register or supply or model
                                                                    or duration or verbose or board), as_json=as_json)
        return
    made = model_of(servo, model, change or [], _MODELS, register or [], supply)
    read = None if log is None else _log(log, lambda: log_reading.read(
        [log], file_format, columns, None, [], mend=mend, rate=rate, commanded=commanded, quiet=as_json,
        registers=bool(register), model=made))
    _diagnose(made, read, words, load or [], duration, seed, board=board, verbose=verbose, as_json=as_json)


def _look_at_installation(*, given: bool, as_json: bool) -> None:
    from servotwin.cli import installation
    from servotwin.errors import InputError

    if given:
        raise InputError("doctor", got="options of a servo, but no servo", allowed="a catalog id or a servo file first")
    found = installation.facts()
    if as_json:
        emit_json(found)
        return
    show(*installation.parts(found))


def _log(path: Path, read: Callable[[], list[Log]]) -> Log:
    from servotwin.errors import InputError

    logs = read()
    if len(logs) != 1:
        raise InputError(str(path), got=f"{len(logs)} logs", allowed="one: servotwin log with --out FILE.csv writes "
                         "each to a file of its own, FILE-1.csv and so on")
    return logs[0]


def _diagnose(made: Model, log: Log | None, words: CommandWords, load: list[str], duration: float | None, seed: int, *,
              board: str | None, verbose: bool, as_json: bool) -> None:
    from servotwin.cli import doctor_words, load_words
    from servotwin.cli.command_words import CommandWords
    from servotwin.diagnosis import diagnose
    from servotwin.errors import CommandError, InputError
    from servotwin.loads import Load

    longest = _LONGEST if log is None else max(_LONGEST, log.duration)
    if duration is not None and not (math.isfinite(duration) and 0.0 < duration <= longest):
        raise InputError("--duration", got=duration, allowed=f"a positive number of seconds up to {longest:g}")
    if log is not None and words != CommandWords():
        raise CommandError("a command beside a log", got=f"--{words.shape}", allowed="one of them: a log has its own")
    signal = None if words == CommandWords() else words.signal(duration or _LONGEST)
    with patience("taking causes away"):
        found = diagnose(made, signal, load=load_words.load_from(load, made), duration=duration, log=log,
                         seed=seed)
    facts = doctor_words.facts(found, command=None if signal is None else words.described(duration or _LONGEST),
                               load=load_words.described(load), log=None if log is None else log.name)
    more = []
    if board is not None:
        from servotwin.diagnosis.brown_out import brown_out

        own = load_words.load_from(load, made)
        seen = brown_out(made, signal, board, log=log, load=own if log is None or own != Load() else log.load,
                         duration=duration or (_LOOKED_AT if log is None else log.duration))
        facts["board"] = doctor_words.board_facts(seen)
        more = doctor_words.board_parts(seen)
    if as_json:
        emit_json(facts)
        return
    show(*doctor_words.parts(found, facts, verbose=verbose), *more)
