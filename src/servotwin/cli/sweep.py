"""`servotwin sweep`: one servo whose parameters vary, one command, one load."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, usual, with_records
from servotwin.cli.terminal import emit_json, patience, show
from servotwin.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.studies import Study


# --- The workers of a dask scheduler, as an executor ------------------------------------------------------------------

_PATIENCE = 5.0  # s until a scheduler has answered
_RETRIES = 3  # of a chunk whose worker is lost


@contextlib.contextmanager
def executor_at(address: str | None) -> Iterator[Any]:
    """Give an executor that hands work to a dask scheduler; None without an address.

    Raises
    ------
    MissingExtraError
        If dask is not installed.
    InputError
        If no scheduler answers at this address.
    """
    if address is None:
        yield None
        return
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise MissingExtraError("distributed", "sweep") from None
    for name in ("distributed", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters becomes an error of one line
    try:  # first by hand: a client that found no scheduler complains again when it is collected
        asyncio.run(_greeted(address))
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (Exception, asyncio.CancelledError) as error:  # whatever answers there may say anything
        raise InputError("--scheduler", got=f"{address} ({type(error).__name__})",
                         allowed="the address of a dask scheduler that answers, such as tcp://host:8786") from None
    if not client.scheduler_info()["workers"]:
        warnings.warn(f"the scheduler at {address} has no worker yet: this waits for one", stacklevel=2)
    try:
        yield client.get_executor(pure=False, retries=_RETRIES)
    finally:
        client.close(timeout=_PATIENCE)


async def _greeted(address: str) -> None:
    core: Any = import_module("distributed.comm.core")
    comm = await asyncio.wait_for(core.connect(address, timeout=_PATIENCE), 1.2 * _PATIENCE)
    comm.abort()


# --- `servotwin sweep`: one servo whose parameters vary, one command, one load ----------------------------------------

_VARIED = "What varies"


@dataclass(frozen=True, kw_only=True)
class _Lanes:
    """The options of `servotwin.studies.sweep` that it has by the same names."""

    lanes: Annotated[int | None, typer.Option(
        metavar="NUMBER", help="Number of servos (default 1000, or all rows of --draws).",
        rich_help_panel=_VARIED)] = None
    sampling: Annotated[str, typer.Option(
        metavar="HOW", help="latin-hypercube, sobol or random.", rich_help_panel=_VARIED)] = "latin-hypercube"
    truncate: Annotated[bool, typer.Option(
        "--truncate", help="Truncate distributions to the physical range.", rich_help_panel=_VARIED)] = False
    seed: Annotated[int, typer.Option(
        metavar="NUMBER", help="Seed for everything random.", rich_help_panel=_VARIED)] = 0
    duration: shared.DurationOption = 1.5
    output_step: Annotated[float, typer.Option(
        metavar="SECONDS", help="Time between samples used for the metrics.", rich_help_panel=shared.OUTPUT)] = 0.01
    file_format: Annotated[str, typer.Option(
        "--format", metavar="FORMAT", help="Format of lanes: csv or parquet.", rich_help_panel=shared.OUTPUT)] = "csv"
    resume: Annotated[bool, typer.Option(
        "--resume", help="Continue the unfinished study in --out.", rich_help_panel=shared.OUTPUT)] = False


@usual("step", "load", "vary", "lanes", "metric", "out", "plot", "json")
@with_records
def sweep(
    *,
    servo: shared.ServoArgument,
    words: Annotated[shared.CommandWords, {
        "unit": "Unit of the command: deg (default), rad, us, ms, s, V or mV. An angle becomes a pulse through each "
        "servo's own calibration; us, ms and s give all servos the same pulse."}],
    plant: Annotated[shared.Plant, {
        "model": "digital, pulse, pulse-inductive or bounded (default: by the kind of the servo, pulse or digital; "
        "bounded if its file has no chip).",
        "change": "Change a nominal parameter, or add one that the servo lacks; repeatable; with a unit, or in SI "
        "units.", "register": LEFT_OUT}],
    vary: Annotated[list[str] | None, typer.Option(
        metavar="NAME=DISTRIBUTION", help="Draw a parameter of the servo or load, repeatable: normal:10%, uniform:10%, "
        "uniform:4us..8us, normal:3ohm±0.3ohm, lognormal:10%, triangular:4us..6us..8us, choice:brake,coast. A single "
        "number is a spread around the nominal value.", rich_help_panel=_VARIED)] = None,
    from_file: Annotated[bool, typer.Option(
        "--from-file", help="Draw every value for which the servo file states a spread. Values that belong together "
        "are drawn together: for a servo made from a sheet, the figures of the sheet.",
        rich_help_panel=_VARIED)] = False,
    draws: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Take the draws from a table: .csv or .parquet, one column per dotted name, in SI units.",
        rich_help_panel=_VARIED)] = None,
    study: _Lanes,
    metric: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help="Metric to show, the first one in the tornado, repeatable: overshoot, rise_time, "
        "settling_time, steady_error, slew_rate, peak_current, lowest_voltage, rms_error, peak_error, or end_ and a "
        "signal's name.",
        rich_help_panel=shared.OUTPUT)] = None,
    out: Annotated[Path | None, typer.Option(
        metavar="FOLDER", help="Write all lanes, chunk by chunk.", rich_help_panel=shared.OUTPUT)] = None,
    plot: Annotated[bool, typer.Option(
        "--plot", help="Draw tornado.png in --out.", rich_help_panel=shared.OUTPUT)] = False,
    scheduler: shared.SchedulerOption = None,
    as_json: shared.JsonOption = False,
) -> None:
    """Draw the parameters of a servo, simulate all, and say what that does to a few metrics."""
    _check_options(out, resume=study.resume, plot=plot, varies=bool(vary or from_file or draws))
    nominal = plant.of(servo)
    found = _run(nominal, words, plant, metric or [], {
        "vary": _varied(nominal, vary or [], from_file=from_file), "draws": _draws(draws), "directory": out,
        **asdict(study)}, scheduler)
    _report(found, nominal, metric or [], out, plot=plot, as_json=as_json)


def _check_options(out: Path | None, *, resume: bool, plot: bool, varies: bool) -> None:
    if not varies:
        raise InputError("nothing varies; use at least one of --vary, --from-file, --draws")
    for option, given in (("--resume", resume), ("--plot", plot)):
        if given and out is None:
            raise InputError(f"{option} needs --out FOLDER")


def _varied(model: Model, words: list[str], *, from_file: bool) -> dict[str, Any]:
    from servotwin.studies import stated

    given: dict[str, Any] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise InputError("--vary", got=word, allowed="NAME=DISTRIBUTION, such as motor.torque_constant=normal:10%")
        if name in given:
            raise InputError(f"--vary {name}", got=f"{given[name]} and {text}", allowed="one distribution")
        given[name] = text
    spreads = stated(model) if from_file else {}
    if from_file and not spreads:
        raise InputError("--from-file", got=f"servo {model.servo.name!r}, whose file states no spread",
                         allowed="std, or lower and upper, of at least one value")
    return {**spreads, **given}


def _draws(path: Path | None) -> dict[str, Any] | None:
    from servotwin.tables import read_columns

    return None if path is None else dict(read_columns(path))


def _run(model: Model, words: shared.CommandWords, plant: shared.Plant, metric: list[str], options: dict[str, Any],
         scheduler: str | None) -> Study:
    from servotwin.cli.interrupts import last_words
    from servotwin.studies import sweep as run
    from servotwin.studies.lane_metrics import checked_metrics
    from servotwin.units import is_finite

    duration = options["duration"]
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("--duration", got=duration, allowed="a positive number of seconds")
    signal = words.signal(duration)
    metrics = tuple(dict.fromkeys([*metric, *checked_metrics(None, model, signal, duration)]))
    with executor_at(scheduler) as executor, last_words(lambda: _how_to_go_on(options["directory"])):
        return run(model, signal, load=plant.load_on(model), metrics=metrics, executor=executor,
                   progress=True, **options)


def _how_to_go_on(folder: Path | None) -> str | None:
    from servotwin.studies.study import STUDY

    if folder is None or not (folder / STUDY).exists():
        return None
    return f"what is finished is in {folder}; the same command with --resume goes on"


def _report(study: Study, nominal: Model, metric: list[str], out: Path | None, *, plot: bool, as_json: bool) -> None:
    from servotwin.cli.summary import sections, was_set

    chosen = metric[0] if metric else study.metrics[0]
    files = [] if out is None else [str(out)]
    if plot and out is not None and study.tornado(chosen).bars:
        from servotwin import plotting

        with patience("drawing"):
            plotting.save(plotting.tornado(study.tornado(chosen)), out / "tornado.png", overwrite=True)
    if as_json:
        emit_json({"definition": dict(study.definition), "set": was_set(nominal), **study.summary(), "files": files})
        return
    show(*sections(study, chosen, files, was_set(nominal)))
