"""`servotwin bench record` and `rehearse`: experiments on a bench, or on an emulated one, become logs."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import bench_options as words
from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit, emit_json, show, table, typed

if TYPE_CHECKING:
    from servotwin.bench.recording import Experiment, Limits, Recorded, Wiring
    from servotwin.cli.bench_jobs import Job
    from servotwin.loads import Load
    from servotwin.models import Model

_FIDELITIES = ("pulse", "pulse-inductive", "digital")
_SLICE = 0.1  # s


def record(
    servo: Annotated[str, typer.Argument(
        help="What is on the bench: catalog id or servo file (.toml), or any words where the logs are for others.")],
    out: words.OutOption,
    port: words.PortOption = None,
    bus: Annotated[str | None, typer.Option(
        metavar="FAMILY", help="Bus servos at a USB adapter instead of a board: feetech or dynamixel.",
        rich_help_panel=words.BENCH)] = None,
    identity: Annotated[list[int] | None, typer.Option(
        "--id", metavar="NUMBER", help="Of a servo on the bus, repeatable: all move at once, and each has its log; the "
        "only one that answers unless given.", rich_help_panel=words.BENCH)] = None,
    baud: Annotated[int | None, typer.Option(
        metavar="BIT/S", help="Of the bus; found unless given.", rich_help_panel=words.BENCH)] = None,
    wiring: words.WiringOption = None,
    experiment: words.ExperimentOption = "steps",
    span: words.RangeOption = None,
    voltage: words.VoltageOption = None,
    current_limit: words.CurrentOption = None,
    duration: words.DurationOption = 10.0,
    frame_period: words.FramePeriodOption = "20ms",
    rate: words.RateOption = "fast",
    seed: words.SeedOption = 0,
    load: words.LoadOption = None,
    licence: words.LicenceOption = "not said",
    author: words.AuthorOption = "",
    note: words.NoteOption = "",
    force: words.ForceOption = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Record experiments."""
    from servotwin.cli.bench_jobs import Files, OneServo, SeveralServos, bus_of, recorded
    from servotwin.errors import InputError

    kind = "pulse_width" if bus is None else "angle"
    if bus is None and (identity or baud is not None):
        raise InputError("--id" if identity else "--baud", got="no --bus",
                         allowed="with --bus feetech or dynamixel")
    limits = words.limits_from(kind, span, voltage, current_limit)
    about = words.about_from(servo, licence, author, note, load)
    period = words.seconds("--frame-period", frame_period)
    made = _experiments(experiment, limits, servo, load, duration, period, seed)
    files = Files(out, limits, about, force)
    files.check(made, identity or [])
    job: Job
    if bus is None:
        from servotwin.bench.backends import SerialBackend
        from servotwin.bench.recording import AnalogRig

        job = OneServo(AnalogRig(SerialBackend(words.port_from(port)), words.wiring_from(wiring), rate=rate), files)
    else:
        job = SeveralServos(bus_of(bus, words.port_from(port), identity or [], baud, period), files)
    with files.made():
        done = recorded(job, made)
    _report(done, out, servo, job, as_json=as_json)


def rehearse(
    servo: shared.ServoArgument,
    out: Annotated[Path | None, typer.Option(
        metavar="FOLDER", help="Folder for the logs, made if it is not there.", rich_help_panel=shared.OUTPUT)] = None,
    pty: Annotated[bool, typer.Option(
        "--pty", help="Offer the board as a serial port in real time, for any program, until Ctrl-C.",
        rich_help_panel=words.BENCH)] = False,
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="pulse, pulse-inductive or digital (default: by the kind of the servo).",
        rich_help_panel=words.BENCH)] = None,
    change: Annotated[list[str] | None, typer.Option(
        "--set", metavar="NAME=VALUE", help="Replace a parameter of the servo that is emulated; repeatable.",
        rich_help_panel=words.BENCH)] = None,
    noise: Annotated[str, typer.Option(
        metavar="VOLTS", help="Noise at each pin, one standard deviation (assumed).",
        rich_help_panel=words.BENCH)] = "1mV",
    mock: Annotated[bool, typer.Option(
        "--mock", help="A board in Python instead of the firmware itself under simavr.",
        rich_help_panel=words.BENCH)] = False,
    wiring: words.WiringOption = None,
    experiment: words.ExperimentOption = "steps",
    span: words.RangeOption = None,
    voltage: words.VoltageOption = None,
    current_limit: words.CurrentOption = None,
    duration: words.DurationOption = 10.0,
    frame_period: words.FramePeriodOption = "20ms",
    rate: words.RateOption = "fast",
    seed: words.SeedOption = 0,
    load: words.LoadOption = None,
    force: words.ForceOption = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Record experiments from an emulated bench."""
    from servotwin.bench.rehearsal import rehearsal_rig
    from servotwin.cli.bench_jobs import Files, OneServo, recorded
    from servotwin.cli.load_words import load_from
    from servotwin.cli.model_words import model_of
    from servotwin.errors import InputError
    from servotwin.units.quantities import quantity

    if (out is None) is not pty or (pty and mock):
        raise InputError("--pty" if pty else "rehearse",
                         got=("with --mock" if mock else "with --out") if pty else "neither --out nor --pty",
                         allowed="--out FOLDER for logs, or --pty alone for a port")
    if out is None:
        board = model_of(servo, model, change or [], _FIDELITIES)
        _offered(board, load_from(load or [], board), words.wiring_from(wiring),
                 noise=quantity("--noise", noise, "voltage"), seed=seed)
        return
    limits = words.limits_from("pulse_width", span, voltage, current_limit)
    whole = model_of(servo, model, [*(change or []), f"supply.open_circuit_voltage={limits.voltage}V"], _FIDELITIES)
    about = words.about_from(f"{servo} (emulated)", "CC0-1.0", "", "no real servo: the firmware of the bench under "
                             "simavr, beside a simulated servo", load)
    made = _experiments(experiment, limits, servo, load, duration, words.seconds("--frame-period", frame_period), seed)
    files = Files(out, limits, about, force)
    files.check(made, [])
    rig, remark = rehearsal_rig(whole, load_from(load or [], whole), words.wiring_from(wiring), rate=rate, mock=mock,
                                noise=quantity("--noise", noise, "voltage"), seed=seed)
    if remark:
        warnings.warn(remark, stacklevel=2)
    job = OneServo(rig, files)
    with files.made():
        done = recorded(job, made)
    _report(done, out, servo, job, as_json=as_json)


def _offered(model: Model, load: Load, wiring: Wiring, *, noise: float, seed: int) -> None:
    """Let any program talk to the board, until Ctrl-C."""
    from servotwin.bench.emulator.terminal import Terminal
    from servotwin.bench.rehearsal import rehearsal_board

    board, _ = rehearsal_board(model, load, wiring, noise=noise, seed=seed, real_time=True)
    with Terminal(board) as terminal:
        emit(f"the board is at {terminal.port}, until Ctrl-C; try "
             + typed("servotwin", "bench", "check", "--port", terminal.port))
        while True:
            terminal.serve(_SLICE)


def _experiments(names: str, limits: Limits, servo: str, load: list[str] | None, duration: float,
                 frame_period: float, seed: int) -> list[Experiment]:
    from servotwin.bench.recording import experiments

    if names != "advise":
        return experiments(names, limits, duration=duration, frame_period=frame_period, seed=seed)
    return [_advised(limits, servo, frame_period)]


def _advised(limits: Limits, servo: str, frame_period: float) -> Experiment:
    """Return the command that would tell most of this servo, fitted into the range."""
    import numpy as np

    from servotwin.bench.recording import Experiment, Hold, of_log
    from servotwin.cli.terminal import patience
    from servotwin.identification import advise
    from servotwin.parameters import load_servo

    with patience("simulating experiments"):
        best = advise(load_servo(servo), voltages=[limits.voltage], sensors=()).experiments[0]
    asked = of_log(best.command, name=best.motion.replace(" ", "_"), frame_period=frame_period)
    values = np.array([one.value for one in asked.holds if one.value is not None])
    low, high = float(values.min()), float(values.max())

    def fitted(value: float | None) -> float | None:
        return None if value is None else limits.at((value - low) / (high - low) if high > low else 0.5)

    holds = [Hold(max(round(one.duration / frame_period), 1) * frame_period, fitted(one.value)) for one in asked.holds]
    return Experiment(name=asked.name, motion=asked.motion, kind=limits.kind, holds=holds, frame_period=frame_period,
                      conditions={"advised": f"{best.motion}, {best.load}"})


def _report(found: Sequence[Recorded], out: Path, servo: str, job: Job, *, as_json: bool) -> None:
    facts = job.facts()
    if as_json:
        emit_json({"logs": [{"path": str(one.path), "rows": one.rows, "seconds": one.duration} for one in found],
                   "rig": facts})
        return
    rows = [(str(one.path), str(one.rows), f"{one.duration:.2f} s") for one in found]
    lost = facts.get("lost_frames", 0)
    remark = [f"{lost} frames of the wire were lost: there are gaps in the rows"] if lost else []
    show(table(("log", "rows", "time"), rows), *remark, "", "next: " + typed("servotwin", "fit", out, "--servo", servo))
